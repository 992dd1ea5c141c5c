# SPDX-License-Identifier: GPL-3.0-or-later
"""A walk on the ground: the gait's arms, brought to their footholds while the body passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ...batched import turned
from ...rotations import Floats, conjugate, from_matrix, multiply, rotate
from ...skeleton import Skeleton
from ..gait import CYCLE, Build, GaitPoser, bone_twists
from ..path import Line
from ..rig import ArmSkin, BodyFrame, Facing, carried_to, rotate_bones, sucker_sides
from .arm_curves import unit
from .contact_timing import ContactTiming, EvenTiming
from .footholds import ContactOverride, Footholds, cycles_at, lay, relaid
from .skin_under_joints import Seen, skin_below
from .stance_settings import Limbs, StanceSettings
from .stance_swing import (
    Batch,
    Stance,
    StancePose,
    airborne,
    kept_over_ground,
    pulled_to_footholds,
    stance_at,
)
from .surface import Ground
from .swing_smoothing import SwingSmoothing

_ASKEW: Final = np.radians(35.0)
"""How far from straight outward a foothold may lie, and an arm from there."""
_TURN: Final = 6.0
"""Radians that the suckers of an arm are turned at most from root to tip."""
_MOST_TURN: Final = 0.6
"""The same from one bone to the next."""
_FIRST_TURN: Final = 0.3
"""Share of it at the root, which the body's skin surrounds."""
_LOOKS: Final = 16
"""Moments of a cycle at which it is looked at which side of its skin an arm lies on."""


@dataclass(frozen=True, eq=False)
class GroundedPoses:
    """Arms on the ground at some frames; joints of arms of different builds are apart."""

    rotations: Floats
    """(frames, bones, 4) unit quaternions in each bone's rest frame."""
    strains: Floats
    """(frames, bones) by how much each bone is longer than at rest, as a share."""
    misses: Floats
    """(frames, arms) distance of an arm that holds on from its foothold, in arm lengths."""
    joints: tuple[Floats, ...]
    """For each build (frames, arms, segments + 1, 3), world."""
    in_contact: tuple[np.ndarray, ...]
    """For each build (frames, arms, segments + 1): which joints rest on the ground."""
    cycles: np.ndarray
    """(frames, arms) number of the cycle that each arm is in."""
    shapes: tuple[Floats, ...]
    """For each build (segments, 3, frames, arms): the gait's own, in the arms' frames."""
    evened: tuple[Floats, ...]
    """For each build (segments, 3, frames, arms): what evening out over time has added to the arms'
    directions, world; empty where nothing was evened out."""

    def part(self, frames: slice) -> GroundedPoses:
        """Some of the frames."""
        return GroundedPoses(
            self.rotations[frames],
            self.strains[frames],
            self.misses[frames],
            tuple(each[frames] for each in self.joints),
            tuple(each[frames] for each in self.in_contact),
            self.cycles[frames],
            tuple(each[:, :, frames] for each in self.shapes),
            tuple(each[:, :, frames] for each in self.evened),
        )


@dataclass(frozen=True, eq=False)
class Raise:
    """What is asked of arms that are to be higher than they need be."""

    lift: Floats
    """(frames, arms) arm lengths, where they do not lie."""
    shapes: tuple[Floats, ...] | None = None
    """``GroundedPoses.shapes`` of the same frames, none where nobody has kept them."""
    evened: tuple[Floats, ...] = ()
    """``GroundedPoses.evened`` of the same frames."""

    @property
    def arms(self) -> list[int]:
        """Those that are raised at any frame."""
        return np.flatnonzero(np.any(self.lift > 0.0, axis=0)).tolist()


@dataclass(frozen=True, eq=False)
class Foothold:
    """One foothold, as it is shown to the artist."""

    arm: int
    cycle: int
    position: Floats
    """(3,) the joint that touches first, world."""
    heading: float
    """Radians about world Z from +X."""
    touch_down: float
    """Phase of the body, radians, at which the arm touches …"""
    lift_off: float
    """… and at which it lets go."""
    lasts: float
    """Cycles of the arm in between, which a body at rest is slow to come through."""
    short: float
    """Arm lengths by which it is out of reach."""


class GroundedWalk:
    """A body that walks over a ground.

    Args:
        skeleton: the rig.
        poser: its gait.
        body: where the body lies in armature space.
        line: its way.
        ground: what it walks on.
        settings: how arms hold on.
        scale: metres of the armature's unit.
        radii: for each arm (bones + 1,) armature units from each joint to the skin below it.
        may_stretch: for each arm, whether its bones may get longer.
        phases: the first and the last of the body's phases, radians.
        contact_overrides: the artist's footholds.
        timing: when arms hold on; none for the gait's own.
        cyclic: whether each cycle is like the one before.
        skins: of each arm: where one is not round, it lies on the side that is below. None for
            round ones.
    """

    def __init__(  # noqa: PLR0917 - what it is made of, in the order in which it is made
        self,
        skeleton: Skeleton,
        poser: GaitPoser,
        body: BodyFrame,
        line: Line,
        ground: Ground,
        settings: StanceSettings,
        *,
        scale: float,
        radii: Sequence[Floats],
        may_stretch: Sequence[bool],
        phases: tuple[float, float],
        contact_overrides: Sequence[ContactOverride] = (),
        timing: ContactTiming | None = None,
        cyclic: bool = False,
        skins: Sequence[ArmSkin] = (),
    ) -> None:
        self._poser, self._line, self._ground = poser, line, ground
        self._settings, self._scale, self._cyclic = settings, scale, cyclic
        self._middle = poser.settings.gait.power_phase
        self._body_turn = from_matrix(body.rotation)
        self._stride = line.settings.stride
        self._timing = timing or EvenTiming(self._stride, poser.offsets)
        ends, _ = cycles_at(self.arm_phases(np.array(phases)), self._middle)
        first, last = ends
        self._cycles = int(first.min()), int(last.max())
        self._last = first, last
        down = -body.rotation[:, 2]
        self._sides = [sucker_sides(skeleton, arm.bones, down) for arm in poser.arms]
        # Where nothing varies at random, the seed does not matter.
        seed = poser.settings.seed if any(poser.settings.variation) else 0
        self._limbs: list[tuple[Build, Limbs, Footholds]] = []
        for build in poser.builds:
            for stretch in sorted({may_stretch[arm] for arm in build.arms}):
                arms = tuple(arm for arm in build.arms if may_stretch[arm] == stretch)
                part = Build(arms, build.chain, build.widths)
                limbs = self._limbs_of(part, radii, stretch=stretch)
                footholds = lay(
                    limbs,
                    line,
                    ground,
                    settings,
                    self._timing,
                    middle=self._middle,
                    cycles=self._cycles,
                    contact_overrides=contact_overrides,
                    seed=seed,
                    cyclic=cyclic,
                )
                self._limbs.append((part, limbs, footholds))
        if not self._are_round(skins):
            below = self._below(skins, phases)
            self._limbs = [
                (build, limbs, relaid(footholds, limbs, ground, own))
                for (build, limbs, footholds), own in zip(self._limbs, below, strict=True)
            ]

    def _are_round(self, skins: Sequence[ArmSkin]) -> bool:
        return not skins or all(
            skins[arm].is_round(self._sides[arm], footholds.touching)
            for build, _, footholds in self._limbs
            for arm in build.arms
        )

    def _below(self, skins: Sequence[ArmSkin], phases: tuple[float, float]) -> list[Floats]:
        """For each build (arms, cycles, segments + 1 − c) metres from joints to the skin below.

        Which side of a bone is below is what the arms show as they would lie if they were round.

        Args:
            skins: of all arms.
            phases: the first and the last of the body's, radians.
        """
        looks = int(np.ceil((phases[1] - phases[0]) / CYCLE * _LOOKS)) + 1
        phase = np.linspace(*phases, looks)
        centres, orientations = self._line.at(phase / CYCLE * self._stride)
        pose = self.pose(phase, np.zeros((looks, 2)), centres, orientations)
        ends = np.cumsum([0] + [len(arm.bones) for arm in self._poser.arms])
        to_world = multiply(orientations, conjugate(self._body_turn))
        found: list[Floats] = []
        for number, (build, _, footholds) in enumerate(self._limbs):
            below = np.empty(footholds.skins.shape)
            for place, arm in enumerate(build.arms):
                own = pose.rotations[:, None, ends[arm] : ends[arm + 1]]
                carried = carried_to([self._poser.rests[arm]], own)[:, 0]
                cycles = pose.cycles[:, arm] - footholds.first
                seen = Seen(
                    joints=pose.joints[number][:, place],
                    orientations=multiply(to_world[:, None], carried),
                    upward=footholds.normals[place, cycles],
                    rests=pose.in_contact[number][:, place, footholds.touching :],
                    cycles=0 * cycles if self._cyclic else cycles,
                )
                known = footholds.skins[place, :1] if self._cyclic else footholds.skins[place]
                below[place] = skin_below(skins[arm], seen, known, self._ground, scale=self._scale)
            found.append(below)
        return found

    def _limbs_of(self, build: Build, radii: Sequence[Floats], *, stretch: bool) -> Limbs:
        generator, columns = self._poser, list(build.arms)
        lengths = self._scale * build.chain.lengths[:, None] * generator.lengths[columns]
        limbs = Limbs(
            arms=build.arms,
            roots=self._scale * generator.roots[columns],
            outward=generator.outward[columns],
            offsets=generator.offsets[columns],
            lengths=lengths,
            radii=self._scale * np.stack([radii[arm] for arm in columns], axis=1),
            aims=np.zeros((len(columns), 2)),
            may_stretch=stretch,
            free=np.array(
                [generator.settings.gait.curve(generator.arms[arm].pair).free for arm in columns]
            ),
        )
        steps = build.chain.lengths[:, None, None] * generator.middle_shapes(columns)
        joint = limbs.touching(self._settings.planted)
        near, far = steps[:joint].sum(axis=0), steps[joint:].sum(axis=0)
        aims = np.arctan2([near[1], far[1]], [near[0], far[0]]).T
        return replace(limbs, aims=_ASKEW * np.tanh(aims / _ASKEW))

    def arm_phases(self, phase: Floats) -> Floats:
        """Each arm's own phase (frames, arms) at the body's phases (frames,)."""
        return self._timing.phases(self._stride * np.asarray(phase) / CYCLE)

    def pose(
        self,
        phase: Floats,
        turn: Floats,
        centres: Floats,
        orientations: Floats,
        higher: Raise | None = None,
        *,
        smoothing: SwingSmoothing | None = None,
    ) -> GroundedPoses:
        """The arms at some frames.

        Args:
            phase: (frames,) of the body's gait, radians.
            turn: (frames, 2) turn that lies ahead, in the body's XY plane.
            centres: (frames, 3) of the body, world.
            orientations: (frames, 4) of the canonical body, world.
            higher: which arms are to be higher, and nothing is said of the others; none for all
                of them, as high as they have to be.
            smoothing: how arms in the air are evened out over frames that follow one another, none
                for each frame by itself. Those that are within its reach of an end that is none of
                the motion's own are of no use.
        """
        generator = self._poser
        frames, count = len(phase), len(generator.arms)
        wanted = range(count) if higher is None else higher.arms
        phases = self.arm_phases(phase)
        angles, steering = generator.asked_at(phases, turn, self._timing.cycle_period)
        cycles, since = cycles_at(phases, self._middle)
        ends = np.cumsum([0] + [len(arm.bones) for arm in generator.arms])
        rotations = np.zeros((frames, ends[-1], 4))
        strains = np.zeros((frames, ends[-1]))
        misses = np.zeros((frames, count))
        joints, in_contact, asked, evened = [], [], [], []
        to_armature = multiply(self._body_turn, conjugate(orientations))
        for number, (build, limbs, footholds) in enumerate(self._limbs):
            chosen = [place for place, arm in enumerate(build.arms) if arm in wanted]
            columns = [build.arms[place] for place in chosen]
            many, batch = len(columns), frames * len(columns)
            own, segments = angles[:, columns], len(build.chain.lengths)
            if not columns:
                joints.append(np.zeros((segments + 1, frames, 0, 3)))
                in_contact.append(np.zeros((segments + 1, frames, 0), dtype=bool))
                continue
            if higher is None or higher.shapes is None:
                every = list(build.arms)
                shapes, _ = generator.shapes(build, angles[:, every], steering[:, every])
                asked.append(shapes)
            else:
                shapes = higher.shapes[number]
            shapes = shapes[..., chosen]
            facing = multiply(orientations[:, None], generator.outward[columns]).reshape(batch, 4).T
            shapes = turned(facing, shapes.reshape(segments, 3, batch))
            roots = centres[:, None] + rotate(orientations[:, None], limbs.roots[chosen])
            arms = Batch(
                limbs,
                np.tile(chosen, frames),
                np.ascontiguousarray(roots.reshape(batch, 3).T),
                turned(facing, np.array([1.0, 0.0, 0.0])[:, None]),
                turned(facing, np.array([0.0, 0.0, 1.0])[:, None]),
                self._lifted(limbs, higher, chosen, columns, frames),
            )
            times = (each[:, columns].reshape(batch) for each in (cycles, since))
            stance = stance_at(arms, footholds, *times)
            longer, ways = pulled_to_footholds(arms, shapes, stance, self._ground, self._settings)
            each_frame = segments, 3, frames, many
            if higher is not None and higher.evened:
                added = higher.evened[number][..., chosen].reshape(ways.shape)
                ways = unit(ways + added)
            elif higher is None and smoothing is not None:
                before, share = ways, airborne(stance).reshape(frames, many)
                ways = smoothing.evened(ways.reshape(each_frame), share).reshape(ways.shape)
                evened.append((ways - before).reshape(each_frame))
            pose = kept_over_ground(arms, (longer, ways), stance, self._ground, self._settings)
            posed = self._rotations(columns, pose, stance, to_armature, bone_twists(build, own))
            longer = pose.strains.reshape(segments, frames, many)
            for place, arm in enumerate(columns):
                rotations[:, ends[arm] : ends[arm + 1]] = posed[:, place]
                strains[:, ends[arm] : ends[arm + 1]] = longer[:, :, place].T
            misses[:, columns] = (pose.misses / arms.reach[-1]).reshape(frames, many)
            joints.append(np.moveaxis(pose.joints.reshape(segments + 1, 3, frames, many), 1, -1))
            in_contact.append(pose.in_contact.reshape(segments + 1, frames, many))
        return GroundedPoses(
            rotations,
            strains,
            misses,
            tuple(np.moveaxis(each, 0, 2) for each in joints),
            tuple(np.moveaxis(each, 0, 2) for each in in_contact),
            cycles,
            tuple(asked),
            tuple(evened),
        )

    def _rotations(
        self,
        columns: list[int],
        pose: StancePose,
        stance: Stance,
        to_armature: Floats,
        bank: Floats,
    ) -> Floats:
        """Rotations (frames, arms, bones, 4) of arms that stand, their suckers to the ground.

        Args:
            columns: which arms.
            pose: how they stand.
            stance: how they hold on.
            to_armature: (frames, 4) from the world to the armature.
            bank: (bones, frames, arms) radians that the gait twists them by.
        """
        segments, many = len(pose.directions), len(columns)
        shape = segments, 3, len(to_armature), many
        back = np.ascontiguousarray(np.repeat(to_armature, many, axis=0).T)
        towards = turned(back, -stance.upwards(segments)).reshape(shape)
        along = np.minimum(_FIRST_TURN + np.arange(segments) / 3.0, 1.0)
        most = min(_MOST_TURN, _TURN / segments) * along
        turns = most[:, None, None] * stance.weight.reshape(shape[2:])
        return rotate_bones(
            [self._poser.rests[arm] for arm in columns],
            turned(back, pose.directions).reshape(shape),
            bank,
            Facing([self._sides[arm] for arm in columns], towards, turns),
        )

    @staticmethod
    def _lifted(
        limbs: Limbs, higher: Raise | None, chosen: list[int], columns: list[int], frames: int
    ) -> Floats:
        """Metres (frames × arms) that arms are to be higher."""
        if higher is None:
            return np.zeros(frames * len(columns))
        return (higher.lift[:, columns] * limbs.reach[-1, chosen]).reshape(-1)

    @property
    def radii(self) -> list[Floats]:
        """For each arm (joints,) metres from each joint to the skin below it."""
        places = {
            arm: limbs.radii[:, place]
            for build, limbs, _ in self._limbs
            for place, arm in enumerate(build.arms)
        }
        return [places[arm] for arm in sorted(places)]

    @property
    def builds(self) -> tuple[tuple[int, ...], ...]:
        """Numbers of the arms of each build, in the order of ``GroundedPoses.joints``."""
        return tuple(build.arms for build, _, _ in self._limbs)

    def by_arm(self, values: Sequence[np.ndarray], higher: Raise | None = None) -> list[np.ndarray]:
        """What poses have for each build (frames, arms, …), for each arm (frames, …) instead.

        Args:
            values: of the builds.
            higher: which arms they were asked of, none for all; of others it is none at all.
        """
        wanted = range(len(self._poser.arms)) if higher is None else higher.arms
        found = {arm: np.zeros((0, 1, 3)) for arm in range(len(self._poser.arms))}
        found |= {
            arm: each[:, place]
            for arms, each in zip(self.builds, values, strict=True)
            for place, arm in enumerate(arm for arm in arms if arm in wanted)
        }
        return [found[arm] for arm in sorted(found)]

    def footholds(self) -> list[Foothold]:
        """All footholds that are there, arm by arm."""
        found: list[Foothold] = []
        first, last = self._last
        for build, limbs, laid in self._limbs:
            for place, arm in enumerate(build.arms):
                for cycle in range(int(first[arm]), int(last[arm]) + 1):
                    at = place, cycle - laid.first
                    if not laid.present[at]:
                        continue
                    turns = (
                        self._middle / CYCLE
                        + cycle
                        + np.array([laid.touch_down[at], laid.lift_off[at]])
                    )
                    ends = self._timing.distances([arm], turns[None])[0] * CYCLE / self._stride
                    found.append(
                        Foothold(
                            arm,
                            cycle,
                            laid.joints[place, cycle - laid.first, 0],
                            float(laid.headings[at]),
                            float(ends[0]),
                            float(ends[1]),
                            float(laid.lift_off[at] - laid.touch_down[at]),
                            float(laid.short[at] / limbs.reach[-1, place]),
                        )
                    )
        return sorted(found, key=lambda each: (each.arm, each.cycle))
