# SPDX-License-Identifier: GPL-3.0-or-later
"""Where along the route the gait changes, as it is set: ``octo_motion.locomotion.change``."""

from __future__ import annotations

from typing import Any, Final

import bpy

from ....blender.files import gait_names
from ...declared_settings import (
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)


def _gait_names(_settings: Any, _context: Any, _text: str) -> list[str]:
    return gait_names()


def _length() -> Any:
    return FloatProperty(
        name="Length",
        description="How long the change takes along the route, in arm lengths. The body goes over "
        "all the while; each arm as soon as it holds on to nothing",
        default=1.5,
        min=0.1,
        soft_max=5.0,
        step=10,
    )


class ChangeItem(bpy.types.PropertyGroup):
    """A place of the route from which on another gait goes."""

    name: bpy.props.StringProperty(
        name="Name", description="What this change is called in the list"
    )
    gait: StringProperty(
        name="Gait",
        description="The gait from here on. Its own strides, the other settings of this armature",
        default="swim",
        search=_gait_names,
        search_options=set(),
    )
    position: FloatProperty(
        name="Position",
        description="Where along the route the change is half done: 0 at its start, 1 at its end",
        subtype="FACTOR",
        default=0.5,
        min=0.0,
        max=1.0,
        precision=3,
    )
    length: _length()


class OCTO_MOTION_PG_change(bpy.types.PropertyGroup):
    """Changes of gait along the route."""

    by: EnumProperty(
        name="Change Gait",
        description="Whether the gait changes along the route, and what decides where",
        items=(
            ("NONE", "Never", "One gait all the way", 0),
            (
                "HEIGHT",
                "By Height",
                "Where the route is high over the ground, or its lowest point, another gait goes",
                1,
            ),
            ("MARKERS", "At Places", "At the places of a list, each with its own gait", 2),
        ),
    )
    gait: StringProperty(
        name="Above",
        description="The gait that goes where the route is high over the ground",
        default="swim",
        search=_gait_names,
        search_options=set(),
    )
    height: FloatProperty(
        name="Height",
        description="Height of the route over the ground at which the change is half done, in arm "
        "lengths",
        default=0.5,
        min=0.0,
        soft_max=3.0,
        step=5,
    )
    length: _length()
    places: CollectionProperty(
        name="Places",
        description="Places of the route where the gait changes, in any order",
        type=ChangeItem,
    )
    active_place: IntProperty(name="Active Place", options={"HIDDEN"})


CLASSES: Final = (ChangeItem, OCTO_MOTION_PG_change)
