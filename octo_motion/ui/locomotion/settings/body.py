# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of what a body does by itself while its arms carry it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final, NamedTuple

import bpy

from ....core.locomotion.body import BodySettings
from ... import declared_settings as props
from ...declared_settings import assign, declared

CURRENT: Final = 2
"""Which settings a saved file knows: 1 since the body moves by itself, 2 since arms of a walk hold
on for half a cycle, and the body slows down in bends."""


class _Before(NamedTuple):
    """What settings that a file does not tell were worth when it was saved."""

    known: int
    """Files that know this have the defaults of now."""
    groups: Callable[[Any], Iterable[Any]]
    """Those that have the settings, of the locomotion of an object."""
    values: Mapping[str, float]
    """By the setting's name."""


_BEFORE: Final = (
    _Before(
        1,
        lambda locomotion: (locomotion.body,),
        dict.fromkeys(("surge", "mantle", "siphon", "eyes", "head"), 0.0),
    ),
    _Before(1, lambda locomotion: (locomotion,), {"breathing": 0.0, "uneven": 0.0}),
    _Before(2, lambda locomotion: (locomotion,), {"slow_in_bends": 0.0}),
    _Before(2, lambda locomotion: (locomotion.ground,), {"duty": 0.55}),
    _Before(2, lambda locomotion: locomotion.along, {"hold": 0.55}),
)


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
    """Let creatures of files that were saved with other defaults move as they did."""
    for locomotion in _used(objects):
        knows = locomotion.body.file_knows
        for before in _BEFORE:
            if knows < before.known:
                for group in before.groups(locomotion):
                    _fill(group, before.values)
        locomotion.body.file_knows = CURRENT


def _fill(group: Any, values: Mapping[str, float]) -> None:
    """Set what a group's file does not tell."""
    for name, value in values.items():
        if not group.is_property_set(name):
            setattr(group, name, value)


def _used(objects: Iterable[bpy.types.Object]) -> Iterator[Any]:
    """The settings of locomotion of objects that have any."""
    for each in objects:
        settings = getattr(each, "octo_motion", None)
        if each.type != "ARMATURE" or settings is None or not each.is_editable:
            continue
        locomotion = settings.locomotion
        if len(locomotion.arms) or locomotion.result is not None:
            yield locomotion
