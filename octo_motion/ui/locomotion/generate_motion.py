# SPDX-License-Identifier: GPL-3.0-or-later
"""One shot from settings to keys: read → plain arrays → compute → write.

:func:`prepare` reads everything and finds everything that is wrong; :meth:`Shot.compute` works on
plain arrays alone, in steps, and may be dropped between any two; :meth:`Shot.write` changes the
file. So whoever runs it, an operator with a progress bar or a batch without a window, can stop
before anything has changed.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import bpy
import numpy as np

from ...blender.animation import as_posed, writable_armature
from ...blender.files import load_gait
from ...blender.rig import read_skeleton, world_matrix
from ...blender.scene import read_route
from ...core.errors import RouteError
from ...core.locomotion.gait import GaitPoser, GaitTable
from ...core.locomotion.ground import ContactOverride
from ...core.locomotion.path import route_in_place, unhurried
from ...core.locomotion.rig import find_mantle, lies_back, stretch_mantle
from ..plain import plain
from .reading import (
    GaitSegment,
    chosen_root_bone,
    gait_settings,
    gaits_of,
    generator_of,
    height_of,
    keyed_anew,
    listed_arms,
    listed_body,
    pace_of,
    posed_carriers,
    read_apart,
    read_changes,
    read_reaches,
    read_standing,
    resting,
    timing,
    tolerances_of,
    too_few_frames,
    travel_settings,
    uniform_scale,
    warnings_for_constraints,
    warnings_for_display,
    warnings_for_driven,
    warnings_for_poses,
)
from .reading import plan_transitions as plan_changes
from .settings.contact_overrides import overrides_for_core, read_overrides
from .settings.in_place import breathing_channels
from .settings.properties import OCTO_MOTION_PG_locomotion, locomotion_settings, read_gait
from .writing import Shot, Summary

RESULTS: Final = frozenset({"result", "shown", "figures", "live", "live_error"})
"""What is no setting, though it is kept with them."""
_ROUTE_SAMPLES: Final = 257
_QUICKLY: Final = 12_000
"""Bones times frames up to which it is soon done to look between frames, too."""


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
    """Read all that the journey of an armature needs. Nothing is changed.

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
    in_place = settings.travel_on == "NONE"
    if settings.route is None and not in_place:
        raise RouteError(
            f"'{armature.name}' has no route.", "Choose a curve as its route, or add one."
        )
    _check_route_stays(settings, armature)
    scene = context.scene
    assert scene is not None
    for edited in (settings.route, settings.ground.object):
        if edited is not None and edited.mode == "EDIT":
            # What is evaluated is as it was when it was last written back, else one drag behind.
            edited.update_from_editmode()
            edited.data.update_tag()
    depsgraph = context.evaluated_depsgraph_get()
    skeleton = read_skeleton(armature)
    world = world_matrix(armature)
    scale = uniform_scale(armature, world)
    arms, body, detection = listed_arms(settings, armature, skeleton)
    root_bone = chosen_root_bone(settings, armature, detection)
    at_rest, rest_body = skeleton, body
    carriers = posed_carriers(settings, armature, skeleton, arms, root_bone)
    turned = [bone for arm in arms for bone in arm.bones]
    if carriers and (posed := as_posed(armature, skeleton, carriers, turned)) is not None:
        # Arms hang where the bones that carry them are.
        skeleton, carriers = posed, []
        body = listed_body(settings, posed, arms, detection)
    gait = read_gait(settings)
    # Arms that are switched off are no mantle either.
    listed = [tuple(bone.name for bone in item.bones) for item in settings.arms if item.bones]
    head = find_mantle(skeleton, listed or [arm.bones for arm in arms], body)
    lean = settings.streamline * lies_back(skeleton, head, body)
    generator = generator_of(skeleton, arms, body, gait_settings(settings, gait, lean))
    stride = gait.stride * generator.arm_length * scale
    if settings.route is None or in_place:
        route = route_in_place(stride, settings.cycles)
    else:
        route = read_route(settings.route, depsgraph, settings.spline)
    mantle: tuple[str, ...] = ()
    # A mantle that lies flat is swum along as it is.
    stretches = settings.streamline > 0.0 and not lean
    if gait.manner == "SWIM" and stretches:
        mantle = head
    travel = travel_settings(settings, gait, stride, lean)
    rest = resting(settings)
    if gait.on_ground and any(rest):
        slow = settings.ground.rest_within * stride
        travel = unhurried(travel, route.length, start=slow * rest[0], end=slow * rest[1])
    seconds, frames, times = timing(settings, route, travel, scene.render)
    breath = breathing_channels(armature, settings, head[-1] if head else "", times * seconds)
    wanted = read_overrides(settings.ground, armature)
    wishes = overrides_for_core(wanted, arms)
    reach = generator.arm_length * scale
    plane = None
    if settings.change.by == "HEIGHT":
        plane = float(route.position(np.linspace(0.0, 1.0, _ROUTE_SAMPLES))[:, 2].min())

    def read_way(
        table: GaitTable, own: GaitPoser, wished: Sequence[ContactOverride]
    ) -> GaitSegment:
        """One way of moving along this route."""
        going = travel_settings(settings, table, table.stride * own.arm_length * scale, lean)
        holding = None
        if table.on_ground and settings.ground.use:
            holding = read_standing(
                settings.ground,
                armature,
                depsgraph,
                skeleton=skeleton,
                skin=at_rest,
                arms=arms,
                generator=own,
                body=body,
                route=route,
                travel=going,
                scale=scale,
                height=settings.height if settings.height_mode == "MANUAL" else None,
                # Contacts are places in the world; in place the ground goes by.
                wishes=() if in_place else wished,
                plane=plane,
                alike=in_place,
                rest=rest,
            )
        return GaitSegment(
            table, own, going, holding, height_of(settings, table, own.clearance * scale)
        )

    def read_gait_of(name: str) -> GaitSegment:
        """One of the ways that the gait changes to."""
        table = load_gait(name)
        own = generator_of(skeleton, arms, body, gait_settings(settings, table, lean))
        return read_way(table, own, ())

    first = read_way(gait, generator, wishes)
    standing = first.standing
    changing = None
    if settings.change.by != "NONE" and not in_place:
        # The pace is the same for all gaits: a stroke's burst is the swimming way's own.
        travel = replace(travel, burst=0.0)
        names = [name for name in dict.fromkeys(gaits_of(settings.change)) if name != gait.name]
        ways = [first, *(read_gait_of(name) for name in names)]
        numbers = {gait.name: 0, **{name: number + 1 for number, name in enumerate(names)}}
        changes = read_changes(settings.change, numbers, route, reach, first)
        changing = plan_changes(ways, changes, route, wishes, [len(arm.bones) for arm in arms])
        if any(not way.gait.on_ground for way in changing.ways) and stretches:
            mantle = head
    apart = None
    tell_overlaps = settings.tell_overlaps and not live
    if settings.keep_apart or tell_overlaps:
        apart = read_apart(armature, skeleton, arms, body, live=live)
    pace = pace_of(route, travel, seconds * scene.render.fps / scene.render.fps_base)
    anew = keyed_anew(settings, armature, root_bone)
    reaching = read_reaches(
        armature, settings, at_rest, arms, keyed_anew=anew, body=rest_body, frames=frames
    )
    grounded = standing is not None or changing is not None
    soon = len(frames) * len(generator.bones) <= _QUICKLY
    return Shot(
        armature=armature.name,
        scene=scene.name,
        skeleton=skeleton,
        arms=arms,
        detection=detection,
        body=body,
        gait=gait,
        generator=generator,
        route=route,
        travel=travel,
        world=world,
        scale=scale,
        height=standing.line.clearance
        if standing
        else height_of(settings, gait, generator.clearance * scale),
        frames=frames,
        times=times,
        seconds=seconds,
        root_bone=root_bone,
        mantle=mantle,
        mantle_rotations=stretch_mantle(skeleton, mantle, body, settings.streamline),
        tolerances=None if live else tolerances_of(settings, generator.arm_length),
        # What is reached for is known on frames alone.
        hasty=grounded and pace.hasty and reaching is None and (soon or not live),
        in_place=in_place,
        repeats=in_place and settings.repeat,
        breath=breath,
        extend_scene_range=settings.extend_scene_range,
        standing=standing,
        changing=changing,
        wanted=wanted,
        apart=apart,
        keep_apart=settings.keep_apart,
        tell_overlaps=tell_overlaps,
        cycle=pace.mean,
        measure=not live,
        reaching=reaching,
        note=settings_note(settings),
        # Detection has looked for constraints itself.
        warnings=[
            *(detection.notes if detection else warnings_for_driven(skeleton, arms)),
            *warnings_for_constraints(settings, armature, skeleton, root_bone),
            *warnings_for_display(armature, scene.render),
            *warnings_for_poses(settings, armature, arms, carriers),
            *(standing.warnings if standing else ()),
            *(too_few_frames(settings, pace, scene.render) if grounded else ()),
        ],
    )


def settings_note(settings: OCTO_MOTION_PG_locomotion) -> str:
    """The settings as JSON, without what is no setting."""
    return json.dumps(plain(settings, without=RESULTS), sort_keys=True)


def _check_route_stays(settings: OCTO_MOTION_PG_locomotion, armature: bpy.types.Object) -> None:
    """A route that its own traveller carries would be somewhere else each time."""
    child = settings.route
    while child is not None and child.parent is not None:
        carried = settings.travel_on == "OBJECT" or child.parent_type == "BONE"
        if child.parent == armature and carried:
            raise RouteError(
                f"The route '{settings.route.name}' hangs on '{armature.name}' and would move "
                "with it.",
                "Clear its parent (Alt P).",
            )
        child = child.parent
