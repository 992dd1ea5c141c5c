# SPDX-License-Identifier: GPL-3.0-or-later
"""Where objects are, those too that Blender does not evaluate."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

_SAME = 1e-5
"""Share of its largest number by which a matrix may be off another, in single precision."""


def world_of(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Matrix:
    """World matrix of an object, which may be disabled in viewports, or excluded.

    Blender leaves such an object's own world matrix as it was long ago, of a file that was opened
    even at the origin, and does not always tell so: what a setting points at counts as evaluated.
    So its transform and its parents' are put together here. Where something else moves it,
    Blender's matrix is all there is.
    """
    evaluated = obj.evaluated_get(depsgraph)
    if len(obj.constraints) > 0 or obj.rigid_body is not None or obj.parent_type != "OBJECT":
        return evaluated.matrix_world
    own = obj.matrix_basis
    if obj.parent is not None:
        own = world_of(obj.parent, depsgraph) @ obj.matrix_parent_inverse @ own
    away = np.abs(np.array(evaluated.matrix_world) - np.array(own)).max()
    # The same but for rounding: what others compute from it must not change in the last digit.
    return evaluated.matrix_world if away <= _SAME * np.abs(np.array(own)).max() else own


def is_enabled(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bool:
    """Whether Blender works an object out, hidden by its eye or not: its modifiers count."""
    layer = depsgraph.view_layer
    return not obj.hide_viewport and layer is not None and obj.name in layer.objects
