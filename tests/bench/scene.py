# SPDX-License-Identifier: GPL-3.0-or-later
"""What is measured: an octopus on a route, and where its arms' groups shall be at each frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import bpy
import numpy as np

from octo_motion.blender.scene.curves import add_route_curve
from octo_motion.core.locomotion.gait.ccd import (
    contraction,
    group_lengths,
    link_rotations,
    pseudo_targets,
    split_groups,
)
from octo_motion.core.locomotion.gait.table import gait_angles
from octo_motion.core.locomotion.motion.planning import frames_of_arms
from octo_motion.core.locomotion.path.travel import plan_travel
from octo_motion.core.locomotion.rig.arm_chains import arm_azimuths, joint_positions
from octo_motion.core.rotations import Floats, from_axis_angle, rotate
from tests.ui.made import prepare

_CYCLE_FRAMES = 48
"""Two seconds at 24 frames a second: the default of the settings."""
_METRES: Final = 0.45
"""How far a route leads for each cycle."""
_LENGTHS_TRIED: Final = 6


@dataclass(frozen=True, eq=False)
class Group:
    """A third of an arm: the bones that converge to one pseudo-target."""

    bones: tuple[str, ...]
    """Root to end."""
    arm: int
    arm_length: float
    targets: Floats
    """(frames, 3) in armature space."""


@dataclass(frozen=True, eq=False)
class Curve:
    """An arm as a curve."""

    bones: tuple[str, ...]
    """Root to tip."""
    joints: Floats
    """(frames, bones + 1, 3) in armature space."""


def build(arms: int, joints: int, frames: int, gait: str, *, skin: bool) -> bpy.types.Object:
    """An octopus that has nothing but targets to meet, from frame 1 to the last of so many."""
    armature = _octopus(arms, joints, gait, skin=skin)
    settings: Any = armature.octo_motion.locomotion
    set_for_comparison(settings)
    _lay_route(settings, frames / _CYCLE_FRAMES)
    settings.timing = "RANGE"
    settings.frame_start, settings.frame_end = 1, frames
    return armature


def build_default(arms: int, joints: int, frames: int, gait: str) -> bpy.types.Object:
    """An octopus as an artist gets it, skin and all settings, on a route for about so many frames.

    How many there are follows from the route, for it starts and ends at rest.
    """
    armature = _octopus(arms, joints, gait, skin=True)
    settings: Any = armature.octo_motion.locomotion
    cycles = frames / _CYCLE_FRAMES
    for _ in range(_LENGTHS_TRIED):
        _lay_route(settings, cycles)
        found = len(prepare(armature, bpy.context).frames)
        if abs(found - frames) <= 1:
            break
        cycles *= frames / found
    return armature


def set_for_comparison(settings: Any) -> None:
    """Leave of a walk what other ways to animate can do as well: arms that meet moving targets.

    Each of these moves the arms away from the targets of the gait's formulas, or does something
    that nothing does in the other ways: holding a ground, steering, smoothing over time, keeping
    arms apart, spreading a bend over more joints than reach the target.
    """
    settings.ground.use = False
    settings.stand = False
    settings.keep_apart = settings.tell_overlaps = False
    settings.steady = 0.0
    settings.give = 0.0
    settings.softness = 0.0
    settings.turning = 0.0
    settings.variation_min = settings.variation_max = 0.0
    settings.breathing = 0.0
    for name in ("surge", "mantle", "siphon", "eyes", "head"):
        setattr(settings.body, name, 0.0)


def _octopus(arms: int, joints: int, gait: str, *, skin: bool) -> bpy.types.Object:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    operators: Any = bpy.ops.octo_motion
    operators.add_octopus(arms=arms, joints=joints, with_mesh=skin)
    armature = bpy.context.object
    assert armature is not None
    settings: Any = armature.octo_motion.locomotion
    settings.gait = gait
    return armature


def _lay_route(settings: Any, cycles: float) -> None:
    """A route so long that the gait has its usual tempo for so many cycles."""
    if settings.route is not None:
        bpy.data.objects.remove(settings.route)
    reach = _METRES * max(1.0, cycles)
    controls = reach * np.array([(0, 0, 0), (0, -0.4, 0), (0.3, -0.6, 0), (0.3, -1, 0)])
    settings.route = add_route_curve("Route", controls, bpy.context.scene.collection)


def groups(armature: bpy.types.Object) -> list[Group]:
    """All groups of all arms with their pseudo-targets, by the formulas of the gait alone."""
    shot = prepare(armature, bpy.context)
    body, skeleton = shot.body, shot.skeleton
    phases = shot.generator.arm_phases(plan_travel(shot.route, shot.travel, shot.times).phase)
    angles = gait_angles(shot.gait, phases, tuple(arm.pair for arm in shot.arms))
    azimuths = arm_azimuths(skeleton, [arm.bones for arm in shot.arms], body)
    result: list[Group] = []
    for number, arm in enumerate(shot.arms):
        joints = body.to_body(joint_positions(skeleton, arm.bones))
        segments = np.linalg.norm(np.diff(joints, axis=0), axis=1)
        sizes = split_groups(segments)
        own = angles[:, number] * np.array([1.0, arm.handedness, arm.handedness])
        widths = group_lengths(segments, sizes) * (1.0 + contraction(own))
        chain = pseudo_targets(link_rotations(own), widths)[:, 1:]
        # From the arm's frame, x outward, to the body's, whose front is −Y, and the armature's.
        outward = from_axis_angle(np.array([0.0, 0.0, 1.0]), azimuths[number] - 0.5 * np.pi)
        places = body.center + (joints[0] + rotate(outward, chain)) @ body.rotation.T
        ends = np.cumsum((0, *sizes))
        result += [
            Group(
                *(arm.bones[ends[each] : ends[each + 1]], number, float(segments.sum())),
                targets=places[:, each],
            )
            for each in range(len(sizes))
        ]
    return result


def curves(armature: bpy.types.Object) -> list[Curve]:
    """The arms as curves through all their joints, as ours shapes them over time."""
    shot = prepare(armature, bpy.context)
    for _ in shot.compute():
        pass
    frames = frames_of_arms(shot.skeleton, shot.arms, shot.body)
    ends = np.cumsum([0, *(len(arm.bones) for arm in shot.arms)])
    return [
        Curve(arm.bones, arm.joints(arm.from_bones(np.ascontiguousarray(own))))
        for arm, own in zip(frames, np.split(shot.rotations, ends[1:-1], axis=1), strict=True)
    ]


@dataclass(frozen=True)
class Quality:
    """What an animation is like, as Blender plays it."""

    largest_error: float
    """Largest distance of a group's end from its target, in arm lengths."""
    mean_error: float
    largest_turn: float
    """Degrees that a bone of an arm turns against its parent from one frame to the next, at
    most: where it is large, the animation pops."""


def quality(armature: bpy.types.Object, wanted: list[Group], frames: int) -> Quality:
    """Play the animation anew, all of it or two frames running at 500 places."""
    places = min(frames - 1, 999 if frames <= 1000 else 500)
    starts = np.unique(np.linspace(1, frames - 1, places).astype(int))
    # What is looked at is the bones; deforming the skin would only take time.
    for child in armature.children:
        child.modifiers.clear()
    bones = [bone for group in wanted for bone in group.bones]
    misses: list[float] = []
    turns: list[float] = []
    rotations: dict[int, Floats] = {}
    for start in starts.tolist():
        for number in (start, start + 1):
            if number in rotations:
                continue
            bpy.context.scene.frame_set(number)
            pose = armature.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose
            assert pose is not None
            rotations[number] = np.array([pose.bones[bone].rotation_quaternion for bone in bones])
            for group in wanted:
                tail = np.array(pose.bones[group.bones[-1]].tail)
                missed = np.linalg.norm(tail - group.targets[number - 1])
                misses.append(float(missed) / group.arm_length)
        cosine = np.abs(np.sum(rotations[start] * rotations[start + 1], axis=-1)).clip(0.0, 1.0)
        turns.append(float(np.degrees(2.0 * np.arccos(cosine.min()))))
    return Quality(max(misses), sum(misses) / len(misses), max(turns))
