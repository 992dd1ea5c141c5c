# SPDX-License-Identifier: GPL-3.0-or-later
"""What a shot's settings and scene are for core: gaits, route, timing, ground, changes, reaches."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final, cast

import bpy
import numpy as np

from ....blender.animation import read_pose, standing_of, writable_object
from ....blender.files import load_gait, sample_weight_curve
from ....blender.rig import (
    LimbReader,
    arm_skins,
    connected_bones,
    may_stretch,
    radii_of_skin,
)
from ....blender.scene import (
    can_be_carried,
    hangs_on,
    home_of,
    is_carried,
    is_enabled,
    may_change,
    read_form,
    read_ground_mesh,
    read_motion,
    read_places,
    read_triangles,
)
from ....core.content_cache import content_key
from ....core.errors import GroundError, SettingsError
from ....core.follow_through import limbs_of
from ....core.keyframes import check_bounds
from ....core.locomotion.body import BodySettings, Organs, find_organs
from ....core.locomotion.gait import GaitSettings, GaitTable
from ....core.locomotion.ground import GroundMesh, MovingMesh, StanceSettings
from ....core.locomotion.motion import (
    BodyJob,
    Breathing,
    ChangeAt,
    ChangesByHeight,
    Creature,
    Floor,
    GaitJob,
    GivenPose,
    GroundJob,
    Timing,
    Tolerances,
    Trailing,
)
from ....core.locomotion.path import AlongRoute, TravelSettings, ValuesAlong
from ....core.locomotion.reaching import Reach, Reaching, Timeline, profile_of
from ....core.locomotion.rig import carried_by_root_bone, frames_of_arm
from ....core.phrases import phrase
from ....core.rotations import IDENTITY, Floats, from_matrix
from ...declared_settings import read_settings
from ..settings import (
    ContactEdit,
    OCTO_MOTION_PG_change,
    OCTO_MOTION_PG_locomotion,
    Place,
    overrides_for_core,
    read_gait,
)
from .rig import RigRead, keyed_anew

_HELD: Final = 0.003
"""Arm lengths that few keys may be off where a joint rests on the ground: it would slide."""
_WEIGHT_SAMPLES: Final = 33
_HEADING_STEP: Final = 0.2
"""Radians: no arm that stands half way between two others is a matter of rounding."""


def gait_settings(settings: OCTO_MOTION_PG_locomotion, gait: GaitTable) -> GaitSettings:
    """How the arms move in a gait."""
    if settings.use_weight_curve:
        drawn = sample_weight_curve(settings.weight_curve, _WEIGHT_SAMPLES)
        weights = tuple(float(each) for each in np.clip(drawn, 0.01, 1.0))
    else:
        weights = (settings.weight_root, settings.weight_tip)
    return read_settings(
        GaitSettings,
        settings,
        gait=gait,
        weights=weights,
        variation=(settings.variation_min, settings.variation_max),
        period=settings.cycles if settings.travel_on == "NONE" else 0,
        heading=_heading(settings),
    )


def _heading(settings: OCTO_MOTION_PG_locomotion) -> float:
    """Radians from the way that the body goes to its front, in steps in which arms change roles."""
    if settings.heading != "ALONG":
        return 0.0
    return _HEADING_STEP * round(settings.heading_angle / _HEADING_STEP)


def travel_settings(settings: OCTO_MOTION_PG_locomotion, gait: GaitTable) -> TravelSettings:
    """How the body travels in a gait; its stride is in arm lengths."""
    return read_settings(
        TravelSettings,
        settings,
        manner="WALK" if gait.on_ground else "SWIM",
        stride=gait.stride,
        stroke_phase=gait.power_phase,
        along=_along(settings),
    )


def _along(settings: OCTO_MOTION_PG_locomotion) -> AlongRoute:
    """What differs along the route; heights are in arm lengths.

    Raises:
        SettingsError: a setting has two values at one place.
    """
    found: dict[str, list[tuple[float, float]]] = {}
    for item in settings.along:
        found.setdefault(item.setting.lower(), []).append((item.position, item.value))
    return AlongRoute(**{name: ValuesAlong.through(pairs) for name, pairs in found.items()})


def read_gaits(settings: OCTO_MOTION_PG_locomotion, others: Sequence[str]) -> tuple[GaitJob, ...]:
    """The gait that is set, and those of these names that it changes to.

    Raises:
        GaitError: a gait is missing, or its table cannot be used.
    """
    tables = [read_gait(settings), *(load_gait(name) for name in others)]
    return tuple(
        GaitJob(gait_settings(settings, each), travel_settings(settings, each)) for each in tables
    )


def tolerances_of(settings: OCTO_MOTION_PG_locomotion) -> Tolerances | None:
    """How far few keys may be off, in arm lengths; none where every frame has a key.

    Raises:
        SettingsError: without tolerance, no key can be left out.
    """
    if settings.keys != "REDUCED":
        return None
    check_bounds(settings.key_angle, settings.key_distance)
    by_bone = settings.key_columns == "BONE"
    return Tolerances(settings.key_angle, settings.key_distance, by_bone, _HELD)


def read_timing(settings: OCTO_MOTION_PG_locomotion, render: bpy.types.RenderSettings) -> Timing:
    """When it moves, and how fast."""
    return Timing(
        kind=settings.timing,
        start=settings.frame_start,
        end=settings.frame_end,
        speed=settings.speed,
        cycle_time=settings.cycle_time,
        rate=render.fps / render.fps_base,
        duty=max(
            (item.value for item in settings.along if item.setting == "HOLD"),
            default=settings.ground.duty,
        ),
    )


def read_body(
    settings: OCTO_MOTION_PG_locomotion, creature: Creature, organs: Organs | None = None
) -> BodyJob:
    """What the body does by itself, but for what it looks at; its organs may be known.

    Raises:
        RigError: a bone that was given by hand is not there, or cannot move by itself.
    """
    body = settings.body
    organs = organs or find_organs(
        creature.skeleton,
        creature.listed or creature.bones,
        creature.body,
        mantle=body.mantle_bone,
        siphon=body.siphon_bone,
        eyes=(body.eye_left, body.eye_right),
    )
    return BodyJob(
        settings=read_settings(BodySettings, body),
        breathing=Breathing(settings.breathing, settings.breath_time),
        organs=organs,
        unlike=1.0,
        seed=settings.seed,
        trailing=_trailing(settings, creature),
    )


def _trailing(settings: OCTO_MOTION_PG_locomotion, creature: Creature) -> Trailing | None:
    """The outer thirds of the arms as bodies, if they are to follow."""
    if not settings.body.trail:
        return None
    outer = [name for bones in creature.bones for name in bones[-max(len(bones) // 3, 1) :]]
    armature = cast("bpy.types.Object", settings.id_data)
    limbs, reader = limbs_of(creature.skeleton, outer), LimbReader(armature)
    return Trailing(limbs, reader.figure(limbs.bones, limbs.parents), reader.unit)


def read_look(
    settings: OCTO_MOTION_PG_locomotion, armature: bpy.types.Object, frames: Floats
) -> Floats | None:
    """Where what the eyes look at is at frames (frames,), world; none for nothing.

    Raises:
        SettingsError: it moves with the armature.
    """
    target = settings.body.look_at
    if target is None or settings.body.eyes <= 0.0:
        return None
    if hangs_on(target, armature):
        raise SettingsError(
            phrase(
                "'{target}' hangs on '{armature}', whose eyes look at it.",
                target=target.name,
                armature=armature.name,
            ),
            "Clear its parent and its constraints to the armature, or look at something else.",
        )
    return read_places(target, frames)[0]


# --- Where the gait changes, as the settings say --------------------------------------------------


def read_changes(
    settings: OCTO_MOTION_PG_change, first: str, *, in_place: bool
) -> tuple[ChangesByHeight | tuple[ChangeAt, ...], list[str]]:
    """Where the gait changes from the first, and the names of the gaits that it changes to.

    In place nothing travels, and the gait stays what it is.

    Raises:
        SettingsError: there is no place to change at.
    """
    if in_place or settings.by == "NONE":
        return (), []
    if settings.by == "MARKERS" and not len(settings.places):
        raise SettingsError(
            "The gait is to change at places, and there are none.",
            "Add a place, or set Change Gait to Never.",
        )
    by_height = settings.by == "HEIGHT"
    asked = [settings.gait] if by_height else [item.gait for item in settings.places]
    names = [name for name in dict.fromkeys(asked) if name != first]
    numbers = {first: 0, **{name: number + 1 for number, name in enumerate(names)}}
    if by_height:
        above = numbers[settings.gait]
        return ChangesByHeight(settings.height, settings.length, above), names
    places = [ChangeAt(item.position, item.length, numbers[item.gait]) for item in settings.places]
    return tuple(places), names


# --- Poses that the motion begins and ends in -----------------------------------------------------


def read_given_poses(
    armature: bpy.types.Object, settings: Any, creature: Creature
) -> tuple[GivenPose | None, GivenPose | None]:
    """The poses that a motion begins and ends in; none if there is no action for one."""
    begin, end = settings.begin_pose, settings.end_pose
    return (
        _given_pose(begin, armature, settings, creature),
        _given_pose(end, armature, settings, creature),
    )


def _given_pose(
    given: Any, armature: bpy.types.Object, settings: Any, creature: Creature
) -> GivenPose | None:
    """One of them.

    Raises:
        SettingsError: it is one of the motion itself.
        ClipError: the action has no slot for the armature, or no keys.
    """
    if given.action is None:
        return None
    if given.action == settings.result:
        raise SettingsError(
            phrase(
                "'{action}' is made anew, and cannot begin or end in a pose of its own.",
                action=given.action.name,
            ),
            "Take the pose with Take Pose: that keeps it.",
        )
    bones, world = read_pose(armature, given.action, given.frame)
    place = None
    if given.with_place:
        place = _given_place(bones, world, settings, creature)
    turns, moves, sizes = (
        {name: values[kind] for name, values in bones.items()} for kind in range(3)
    )
    moves, sizes = creature.channels.given(moves, sizes)
    return GivenPose(turns, moves, sizes, place, given.frames)


def _given_place(
    bones: Mapping[str, tuple[Floats, Floats, Floats]],
    world: Floats | None,
    settings: Any,
    creature: Creature,
) -> tuple[Floats, Floats] | None:
    """Where the armature is in a pose, as what travels carries it; none where that says nothing."""
    if bone := creature.root_bone:
        turned, moved, _ = bones.get(bone, (IDENTITY, np.zeros(3), None))
        places = carried_by_root_bone(
            creature.skeleton, bone, creature.world, moved[None], np.asarray(turned)[None]
        )
        return places[0][0], places[1][0]
    if world is None or settings.travel_on == "NONE":
        return None
    return world[:3, 3], from_matrix(world[:3, :3] / creature.scale)


# --- What a walk holds on to: the settings, the ground's mesh and the skin of the arms ------------


_BARE: Final = (
    "The ground '{name}' is disabled in viewports or excluded: its modifiers do not count. Hide it "
    "with its eye in the outliner instead."
)
_CONNECTED: Final = (
    "Bones of '{armature}' are connected and cannot be moved: its arms bend instead of getting "
    "longer. Disconnect Bones, in the panel Hold the Ground, lets them."
)


def resting(settings: OCTO_MOTION_PG_locomotion) -> tuple[bool, bool]:
    """Whether all arms lie on the ground at the start of a walk, and at its end."""
    ground = settings.ground
    if not ground.use or settings.travel_on == "NONE":
        return False, False
    return (
        ground.start_at_rest and settings.ease_in > 0.0,
        ground.come_to_rest and settings.ease_out > 0.0,
    )


def read_ground(
    settings: OCTO_MOTION_PG_locomotion,
    armature: bpy.types.Object,
    depsgraph: bpy.types.Depsgraph,
    creature: Creature,
    edits: Mapping[Place, ContactEdit],
    *,
    walks: bool,
    same_rig: GroundJob | None = None,
    same_mesh: GroundJob | None = None,
) -> GroundJob | None:
    """The ground under a walk with the artist's edits of single contacts, none where nothing holds
    it; of the one before what is still so, its arms or its mesh.

    Raises:
        GroundError: the ground is no mesh, or has no faces.
    """
    ground = settings.ground
    if not ground.use or not walks:
        return None
    mesh, warnings = None, list[str]()
    if ground.object is not None and settings.travel_on != "NONE":
        mesh = same_mesh.mesh if same_mesh else read_ground_mesh(ground.object, depsgraph)
        if len(ground.object.modifiers) > 0 and not is_enabled(ground.object, depsgraph):
            warnings.append(phrase(_BARE, name=ground.object.name))
    by_moving = creature.channels.moved is not None
    if by_moving and ground.stretch > 0.0 and connected_bones(armature, creature.bones):
        warnings.append(phrase(_CONNECTED, armature=armature.name))
    return GroundJob(
        stance=read_settings(StanceSettings, ground),
        skins=same_rig.skins
        if same_rig is not None
        else arm_skins(armature, creature.at_rest, creature.bones),
        may_stretch=[may_stretch(armature, bones, by_moving=by_moving) for bones in creature.bones],
        mesh=mesh,
        overrides=tuple(overrides_for_core(dict(edits), creature.arms)),
        rest=resting(settings),
        rest_within=ground.rest_within,
        warnings=tuple(warnings),
    )


def read_moving(
    ground: GroundJob,
    armature: bpy.types.Object,
    obj: bpy.types.Object | None,
    frames_of: Callable[[], Floats],
) -> GroundJob:
    """The same ground as it is at the first of some frames (n,), and how it moves over all of them:
    what tells these takes a while, and is not asked without need.

    One that hangs on the creature that walks on it is taken as it is.

    Raises:
        GroundError: it has other vertices or faces from frame to frame.
    """
    if ground.mesh is None or obj is None or hangs_on(obj, armature) or not may_change(obj):
        return ground
    frames = frames_of()
    if (read := read_motion(obj, frames)) is None:
        return ground
    moving = MovingMesh(frames, *read)
    mesh = GroundMesh(content_key(moving.triangles), lambda: moving.triangles)
    return replace(ground, mesh=mesh, moving=moving)


def read_floor(
    settings: OCTO_MOTION_PG_locomotion,
    armature: bpy.types.Object,
    depsgraph: bpy.types.Depsgraph,
    creature: Creature,
    *,
    walks: bool,
    same_rig: Floor | None = None,
    same_mesh: Floor | None = None,
) -> Floor | None:
    """The ground where nothing holds on to it: below one that swims, or about one that stays; none
    where there is none. Of the one before what is still so, its arms or its mesh.
    """
    ground, stays = settings.ground, settings.travel_on == "NONE"
    if not ground.use or ground.object is None or (walks and not stays):
        return None
    try:
        mesh = (
            (same_mesh.triangles, same_mesh.content)
            if same_mesh
            else read_triangles(ground.object, depsgraph)
        )
    except GroundError:
        # Nobody needs it: what is no ground is none to keep off.
        return None
    skins = same_rig.skins if same_rig else arm_skins(armature, creature.at_rest, creature.bones)
    return Floor(skins, *mesh)


# --- Reaches of the list: what is reached for, and where that is meanwhile ------------------------


_AXES: Final = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}


def read_reaches(
    armature: bpy.types.Object, settings: Any, rig: RigRead, frames: Floats
) -> Reaching | None:
    """What the list of reaches asks for at frames (frames,); none if it is empty or muted.

    Raises:
        OctoMotionError: an object is missing, has no surface, or moves with the armature; frames
            are out of order.
    """
    items = [item for item in settings.reaches if not item.mute]
    if not items:
        return None
    creature = rig.creature
    bones, arms = creature.bones, creature.arms
    if settings.keep_pose:
        anew = keyed_anew(settings, armature, creature.root_bone)
    else:
        anew = set(creature.skeleton.names)
    return Reaching(
        arms=arms,
        frames=tuple(frames_of_arm(creature.at_rest, each, rig.rest_body) for each in bones),
        radii=tuple(radii_of_skin(armature, bones)),
        standings=tuple(standing_of(armature, each[0], left_out=anew) for each in bones),
        up=rig.rest_body.rotation[:, 2],
        reaches=tuple(_reach(item, armature, frames) for item in items),
    )


def _reach(item: Any, armature: bpy.types.Object, frames: Floats) -> Reach:
    winds, brings = item.mode in {"COIL", "MOUTH"}, item.mode == "MOUTH"
    closed = item.frame_contact + (item.coil_frames if winds else 0)
    timeline = Timeline(
        *(item.frame_start, item.frame_contact, min(closed, item.frame_release)),
        *(item.frame_release, item.frame_release + item.back_frames),
    )
    still = np.zeros((len(frames), 3)), np.tile([1.0, 0.0, 0.0, 0.0], (len(frames), 1))
    if item.mode == "CURL":
        return Reach(item.name, item.arm, item.mode, 0.0, timeline, "", None, *still)
    if item.target is None:
        raise SettingsError(
            phrase("The reach '{item}' has no object.", item=item.name),
            "Choose what it reaches for, or mute it.",
        )
    if hangs_on(item.target, armature):
        raise SettingsError(
            phrase(
                "'{target}' hangs on '{armature}', which reaches for it.",
                target=item.target.name,
                armature=armature.name,
            ),
            "Clear its parent and its constraints to the armature.",
        )
    carry = item.carry or brings
    if carry:
        writable_object(item.target)
        if not can_be_carried(item.target):
            raise SettingsError(
                phrase(
                    "'{target}' moves by itself and cannot be carried.", target=item.target.name
                ),
                "Remove its action, constraints and physics, or let the arm coil."
                if brings
                else "Remove its action, constraints and physics, or switch Carry off.",
            )
    axis = np.array(_AXES[item.axis]) if item.axis in _AXES else None
    profile = profile_of(*read_form(item.target), axis)
    asked = (frames >= timeline.start) & (frames <= timeline.end)
    positions, rotations = still
    if carry or is_carried(item.target, armature.name):
        # Keys that it got before are made anew, or taken away.
        positions, rotations = (np.tile(each, (len(frames), 1)) for each in home_of(item.target))
    elif np.any(asked):
        positions[asked], rotations[asked] = read_places(item.target, frames[asked])
        # Before and after, nothing asks where it is.
        first, last = np.flatnonzero(asked)[[0, -1]]
        positions[:first], rotations[:first] = positions[first], rotations[first]
        positions[last + 1 :], rotations[last + 1 :] = positions[last], rotations[last]
    return Reach(
        item.name, item.arm, item.mode, item.turns, timeline, item.target.name, profile,
        positions, rotations, carry, timeline.closed + item.bring_frames if brings else None,
    )  # fmt: skip
