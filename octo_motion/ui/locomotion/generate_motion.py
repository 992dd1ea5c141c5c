# SPDX-License-Identifier: GPL-3.0-or-later
"""One shot from settings to keys: read → plain arrays → compute → write.

:func:`prepare` reads everything and works nothing out; core's ``compute`` works on plain arrays
alone, in steps, and may be dropped between any two; :meth:`Shot.write` changes the file. So whoever
runs it, an operator with a progress bar or a batch without a window, can stop before anything has
changed.
"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Final

import bpy

from ...blender.animation import writable_armature
from ...blender.rig import world_matrix
from ...core.errors import RouteError
from ...core.locomotion.motion import MotionJob, schedule
from ..plain import plain
from .reading import (
    breathing,
    read_changes,
    read_creature,
    read_gaits,
    read_ground,
    read_reaches,
    read_route_of,
    read_timing,
    read_volume,
    tolerances_of,
    warnings_for_display,
)
from .settings import OCTO_MOTION_PG_locomotion, locomotion_settings, read_overrides
from .writing import Shot, Summary

RESULTS: Final = frozenset({"result", "shown", "figures", "live", "live_error"})
"""What is no setting, though it is kept with them."""


def generate(armature: bpy.types.Object, context: bpy.types.Context) -> Summary:
    """Prepare, compute and write in one go.

    Raises:
        OctoMotionError: something is wrong that the user can put right; nothing has changed.
    """
    shot = prepare(armature, context)
    for _ in shot.compute():
        pass
    return shot.write()


def prepare(armature: bpy.types.Object, context: bpy.types.Context, *, live: bool = False) -> Shot:
    """Read all that the motion of an armature needs. Nothing is changed, nothing worked out.

    Args:
        armature: the armature object, with its settings.
        context: for the scene, its frame rate and its evaluated state.
        live: whether it is to be quick: the same motion with a key on every frame, and without
            figures of how good it is.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """
    settings = locomotion_settings(armature)
    writable_armature(armature)
    scene = context.scene
    assert scene is not None
    in_place = settings.travel_on == "NONE"
    _check_route(settings, armature)
    _write_back(settings.route, settings.ground.object)
    depsgraph = context.evaluated_depsgraph_get()
    found = read_creature(armature, settings, world_matrix(armature))
    creature, edits = found.creature, read_overrides(settings.ground, armature)
    changes, names = read_changes(settings.change, settings.gait, in_place=in_place)
    gaits = read_gaits(settings, names)
    walks = any(each.settings.gait.on_ground for each in gaits)
    job = MotionJob(
        creature=creature,
        route=None if in_place else read_route_of(settings, depsgraph),
        cycles=settings.cycles,
        repeats=in_place and settings.repeat,
        gaits=gaits,
        changes=changes,
        timing=read_timing(settings, scene.render),
        height=settings.height if settings.height_mode == "MANUAL" else None,
        streamline=settings.streamline,
        breathing=breathing(settings),
        ground=read_ground(settings, armature, depsgraph, creature, edits, walks=walks),
        volume=read_volume(settings, armature, creature, live=live),
        keep_apart=settings.keep_apart,
        tell_overlaps=settings.tell_overlaps and not live,
        reaching=None,
        tolerances=None if live else tolerances_of(settings),
        live=live,
        warnings=(*found.warnings, *warnings_for_display(armature, scene.render), *found.poses),
    )
    if any(not item.mute for item in settings.reaches):
        frames = schedule(job).frames
        job = replace(job, reaching=read_reaches(armature, settings, found, frames))
    return Shot(
        armature=armature.name,
        scene=scene.name,
        job=job,
        detection=found.detection,
        edits=edits,
        extend_scene_range=settings.extend_scene_range,
        note=settings_note(settings),
    )


def settings_note(settings: OCTO_MOTION_PG_locomotion) -> str:
    """The settings as JSON, without what is no setting."""
    return json.dumps(plain(settings, without=RESULTS), sort_keys=True)


def _write_back(*objects: bpy.types.Object | None) -> None:
    """Let what is being edited count as it is: else it would be one drag behind."""
    for each in objects:
        if each is not None and each.mode == "EDIT":
            each.update_from_editmode()
            assert each.data is not None
            each.data.update_tag()


def _check_route(settings: OCTO_MOTION_PG_locomotion, armature: bpy.types.Object) -> None:
    """A route has to be there; one that its own traveller carries would be elsewhere each time."""
    if settings.route is None and settings.travel_on != "NONE":
        raise RouteError(
            f"'{armature.name}' has no route.", "Choose a curve as its route, or add one."
        )
    route = child = settings.route
    while route is not None and child is not None and child.parent is not None:
        carried = settings.travel_on == "OBJECT" or child.parent_type == "BONE"
        if child.parent == armature and carried:
            raise RouteError(
                f"The route '{route.name}' hangs on '{armature.name}' and would move with it.",
                "Clear its parent (Alt P).",
            )
        child = child.parent
