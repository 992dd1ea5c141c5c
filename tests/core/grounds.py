# SPDX-License-Identifier: GPL-3.0-or-later
"""Walks over grounds, made from numbers: no Blender needed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from octo_motion.core.locomotion.gait.gait_poser import GaitPoser, GaitSettings
from octo_motion.core.locomotion.gait.table import gait_presets
from octo_motion.core.locomotion.ground.contact_timing import (
    BodyLine,
    EvenTiming,
    finding_line,
    leaning,
    timing_at_rest,
)
from octo_motion.core.locomotion.ground.footholds import ContactOverride, cycles_at
from octo_motion.core.locomotion.ground.surface import (
    Ground,
    HeightField,
    LevelGround,
    StanceSettings,
)
from octo_motion.core.locomotion.ground.walk import GroundedPoses, GroundedWalk
from octo_motion.core.locomotion.path.route import Route
from octo_motion.core.locomotion.path.travel import (
    TravelSettings,
    bearings_of,
    plan_travel,
    unhurried,
)
from octo_motion.core.locomotion.rig.arm_chains import BodyFrame
from octo_motion.core.locomotion.rig.poses import object_transforms
from octo_motion.core.rotations import Floats, normalized, rotate
from octo_motion.core.skeleton import Skeleton
from octo_motion.core.steps import finished
from tests.core.rigs import body_with_arms

STRAIGHT = Route.bezier([[[0, 0, 0], [0, -1.5, 0], [0, -3.0, 0], [0, -4.5, 0]]])
ARC = 2.0 * 0.5523
TURN = Route.bezier([[[0, 0, 0], [0, -ARC, 0], [2 - ARC, -2, 0], [2, -2, 0]]])
"""A quarter of a circle with a radius of two arm lengths."""
FRAMES = 48
"""Of a cycle, at full speed."""


def bumps(height: float = 0.3) -> HeightField:
    """Hills of a height, from valley to top, 1.2 and 1.0 arm lengths apart."""
    spacing = 0.025
    x, y = np.arange(-3.0, 5.5, spacing), np.arange(-7.5, 3.0, spacing)
    waves = np.sin(2.0 * np.pi * x[:, None] / 1.2) * np.cos(2.0 * np.pi * y / 1.0)
    return HeightField((float(x[0]), float(y[0])), spacing, 0.5 * height * waves)


GROUNDS: dict[str, Ground] = {
    "plane": LevelGround(0.0),
    "slope": LevelGround(0.0, (0.0, float(np.tan(np.radians(20.0))))),
    "side slope": LevelGround(0.0, (float(np.tan(np.radians(20.0))), 0.0)),
    "bumps": bumps(),
}


@dataclass(eq=False)
class Walker:
    """A body of unit arm length that walks."""

    skeleton: Skeleton
    generator: GaitPoser
    body: BodyFrame
    route: Route
    travel: TravelSettings
    line: BodyLine
    ground: Ground
    walk: GroundedWalk

    @property
    def times(self) -> Floats:
        """(frames,) share of the journey, a cycle taking about as many as ``FRAMES``."""
        return np.linspace(0.0, 1.0, int(FRAMES * self.route.length / self.travel.stride) + 1)

    def pose(self, times: Floats) -> GroundedPoses:
        """The arms at shares of the journey."""
        travel, centres, orientations = self.places(times)
        return self.walk.pose(travel.phase, travel.turn, centres, orientations)

    def places(self, times: Floats) -> tuple[Any, Floats, Floats]:
        """Travel, and the body's centres (frames, 3) and orientations (frames, 4)."""
        travel = plan_travel(self.route, self.travel, times, self.line.bearings)
        centres, upright = self.line.ride(travel.positions, travel.distance)
        return travel, centres, leaning(upright, travel.rotations)

    def since(self, times: Floats) -> Floats:
        """(frames, arms) cycles since the middle of each arm's hold."""
        travel, _, _ = self.places(times)
        phases = self.walk.arm_phases(travel.phase)
        return cycles_at(phases, self.generator.settings.gait.power_phase)[1]

    def played(self, times: Floats) -> tuple[Floats, Floats]:
        """Joints (frames − 1, arms, joints, 3) as they are played half way between two keys.

        Keys are linear; bones do not stretch.
        """
        _, centres, orientations = self.places(times)
        locations, turns = object_transforms(self.body, 1.0, centres, orientations)
        rotations = self.pose(times).rotations
        basis = np.zeros((len(times) - 1, len(self.skeleton), 4))
        basis[..., 0] = 1.0
        order = [self.skeleton.index[bone] for bone in self.generator.bones]
        basis[:, order] = between(rotations)
        frames, heads = self.skeleton.pose(basis)
        arms = []
        for arm in self.generator.arms:
            bones = [self.skeleton.index[bone] for bone in arm.bones]
            reach = np.array([0.0, self.skeleton.lengths[bones[-1]], 0.0])
            tip = heads[:, bones[-1]] + rotate(frames[:, bones[-1]], reach)
            arms.append(np.concatenate([heads[:, bones], tip[:, None]], axis=1))
        joints = np.stack(arms, axis=1)
        at = 0.5 * (locations[1:] + locations[:-1])
        joints = rotate(between(turns)[:, None, None], joints) + at[:, None, None]
        return joints, 0.5 * (times[1:] + times[:-1])


def between(rotations: Floats) -> Floats:
    """Half way between quaternions (frames, …, 4) and the next, as linear keys are played."""
    sign = np.sign(np.sum(rotations[1:] * rotations[:-1], axis=-1, keepdims=True))
    return normalized(rotations[:-1] + sign * rotations[1:])


def walker(
    ground: Ground,
    *,
    joints: int = 12,
    arms: int = 8,
    gait: str = "walk",
    route: Route = STRAIGHT,
    stretch: bool = False,
    settings: StanceSettings = StanceSettings(),  # noqa: B008 - frozen
    wishes: Sequence[ContactOverride] = (),
    rolls: np.random.Generator | None = None,
    rest: float = 0.0,
    radii: tuple[float, float] = (0.045, 0.012),
    **options: Any,
) -> Walker:
    """A body with straight tapering arms of length 1 that walks at even speed.

    With ``rest`` it starts and ends at a standstill, within so many cycles.
    """
    skeleton, made, body = body_with_arms(arms, joints, rolls=rolls)
    table = gait_presets()[gait]
    generator = GaitPoser(skeleton, made, body, GaitSettings(table, raise_to_floor=True, **options))
    travel = TravelSettings(stride=table.stride * generator.arm_length)
    rhythm = None
    if rest:
        slow = rest * travel.stride
        travel = unhurried(travel, route.length, start=slow, end=slow)
        rhythm = timing_at_rest(
            EvenTiming(travel.stride, generator.offsets),
            route.length,
            start=True,
            end=True,
            middle=table.power_phase,
            duty=settings.duty,
        )
    bearings = bearings_of(route, travel)
    line = finished(
        finding_line(
            route,
            travel,
            bearings,
            ground,
            clearance=generator.clearance + 0.03,
            reach=1.0,
            lean=settings.lean,
            smoothing=settings.smoothing,
        )
    )
    walk = GroundedWalk(
        skeleton,
        generator,
        body,
        line,
        ground,
        settings=settings,
        scale=1.0,
        radii=[np.linspace(*radii, joints + 1)] * arms,
        may_stretch=[stretch] * arms,
        phases=(0.0, 2.0 * np.pi * route.length / travel.stride),
        contact_overrides=wishes,
        timing=rhythm,
    )
    return Walker(skeleton, generator, body, route, travel, line, ground, walk)


def largest_turn(rotations: Floats) -> float:
    """Radians that a bone turns at most from one of the frames to the next."""
    cosine = np.abs(np.sum(rotations[1:] * rotations[:-1], axis=-1))
    return float(2.0 * np.arccos(np.clip(cosine, 0.0, 1.0)).max())


def deepest_joint(joints: np.ndarray, ground: Ground, length: float = 1.0) -> float:
    """How far a joint (…, joints, 3) but for the root, the body's, is below the ground.

    In arms of that length; negative if all are above it.
    """
    below = ground.height(joints[..., 1:, :]) - joints[..., 1:, 2]
    return float(below.max()) / length
