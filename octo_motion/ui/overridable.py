# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's kinds of properties, such that a library override may change them.

Only names that Blender tells the items of a linked list apart by are not: they are made with
``bpy.props``.
"""

from __future__ import annotations

from functools import partial
from typing import Final

from bpy import props

BoolProperty: Final = partial(props.BoolProperty, override={"LIBRARY_OVERRIDABLE"})
EnumProperty: Final = partial(props.EnumProperty, override={"LIBRARY_OVERRIDABLE"})
FloatProperty: Final = partial(props.FloatProperty, override={"LIBRARY_OVERRIDABLE"})
FloatVectorProperty: Final = partial(props.FloatVectorProperty, override={"LIBRARY_OVERRIDABLE"})
IntProperty: Final = partial(props.IntProperty, override={"LIBRARY_OVERRIDABLE"})
PointerProperty: Final = partial(props.PointerProperty, override={"LIBRARY_OVERRIDABLE"})
StringProperty: Final = partial(props.StringProperty, override={"LIBRARY_OVERRIDABLE"})
CollectionProperty: Final = partial(
    props.CollectionProperty, override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"}
)
