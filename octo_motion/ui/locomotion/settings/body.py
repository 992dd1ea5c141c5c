# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of what a body does by itself while its arms carry it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, Final

import bpy

from ....core.locomotion.body import BodySettings
from ... import declared_settings as props
from ...declared_settings import assign, declared

CURRENT: Final = 1
"""Which settings a saved file knows: 1 since the body moves by itself."""
BEFORE: Final = dict.fromkeys(("surge", "mantle", "siphon", "eyes", "head"), 0.0)
"""What settings were worth before there were any, by name: files of then keep their look …"""
BEFORE_BESIDE: Final = {"breathing": 0.0, "uneven": 0.0}
"""… and those beside them."""


def _bone(name: str, description: str) -> Any:
    """A bone's name that is given by hand."""
    told = f"{description}. Empty, it is found by its name and its place; - is for none"
    return props.StringProperty(name=name, description=told)


class OCTO_MOTION_PG_body(bpy.types.PropertyGroup):
    """What a body does by itself while its arms carry it."""

    surge: declared(BodySettings, "surge")
    mantle: declared(BodySettings, "mantle")
    siphon: declared(BodySettings, "siphon")
    eyes: declared(BodySettings, "eyes")
    head: declared(BodySettings, "head")
    trail: declared(BodySettings, "trail")
    settle: declared(BodySettings, "settle")
    look_at: props.PointerProperty(
        name="Look At",
        description="Object that the eyes look at; without one, they look where the body goes",
        type=bpy.types.Object,
    )
    mantle_bone: _bone("Mantle", "Last bone of the mantle, which breathes and swings")
    siphon_bone: _bone("Siphon", "Bone of the siphon, which points against the travel")
    eye_left: _bone("Left Eye", "Bone of the left eye")
    eye_right: _bone("Right Eye", "Bone of the right eye")
    file_knows: props.IntProperty(
        name="File Knows",
        description="Which of these settings the file knew when it was saved",
        options={"HIDDEN"},
    )


def stamp(objects: Iterable[bpy.types.Object]) -> None:
    """Tell, as a file is saved, that it knows these settings."""
    for locomotion in _used(objects):
        assign(locomotion.body, "file_knows", CURRENT)


def keep_look(objects: Iterable[bpy.types.Object]) -> None:
    """Let creatures of files that were saved before there were these settings move as they did."""
    for locomotion in _used(objects):
        body = locomotion.body
        if body.file_knows >= CURRENT:
            continue
        for group, before in ((body, BEFORE), (locomotion, BEFORE_BESIDE)):
            for name, value in before.items():
                if not group.is_property_set(name):
                    setattr(group, name, value)
        body.file_knows = CURRENT


def _used(objects: Iterable[bpy.types.Object]) -> Iterator[Any]:
    """The settings of locomotion of objects that have any."""
    for each in objects:
        settings = getattr(each, "octo_motion", None)
        if each.type != "ARMATURE" or settings is None or not each.is_editable:
            continue
        locomotion = settings.locomotion
        if len(locomotion.arms) or locomotion.result is not None:
            yield locomotion
