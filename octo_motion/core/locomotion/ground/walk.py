# SPDX-License-Identifier: GPL-3.0-or-later
"""A walk on the ground: the gait's arms, brought to their footholds while the body passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from ...rotations import Floats, conjugate, from_matrix, multiply
from ...skeleton import Skeleton
from ..gait import CYCLE, Build, GaitPoser
from ..path import Line
from ..rig import ArmSkin, BodyFrame, carried_to, sucker_sides
from .contact_timing import ContactTiming, EvenTiming
from .footholds import ContactOverride, cycles_at, lay, relaid
from .grounded_poses import Foothold, GroundedPoses, Raise
from .skin_under_joints import Seen, skin_below
from .stance_settings import StanceSettings
from .surface import Ground
from .swing_smoothing import SwingSmoothing
from .walk_part import Moments, WalkPart, limbs_of

_LOOKS: Final = 16
"""Moments of a cycle at which it is looked at which side of its skin an arm lies on."""


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
        self._scale, self._cyclic = scale, cyclic
        self._middle = poser.settings.gait.power_phase
        self._body_turn = from_matrix(body.rotation)
        self._stride = line.settings.stride
        self._timing = timing or EvenTiming(self._stride, poser.offsets)
        ends, _ = cycles_at(self.arm_phases(np.array(phases)), self._middle)
        first, last = ends
        self._cycles = int(first.min()), int(last.max())
        self._last = first, last
        down = -body.rotation[:, 2]
        sides = [sucker_sides(skeleton, arm.bones, down) for arm in poser.arms]
        # Where nothing varies at random, the seed does not matter.
        seed = poser.settings.seed if any(poser.settings.variation) else 0
        self._ends = np.cumsum([0] + [len(arm.bones) for arm in poser.arms])
        self._parts: list[WalkPart] = []
        for build in poser.builds:
            for stretch in sorted({may_stretch[arm] for arm in build.arms}):
                arms = tuple(arm for arm in build.arms if may_stretch[arm] == stretch)
                own = Build(arms, build.chain, build.widths)
                limbs = limbs_of(
                    poser, own, radii, scale=scale, planted=settings.planted, may_stretch=stretch
                )
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
                self._parts.append(WalkPart(poser, ground, settings, sides, own, limbs, footholds))
        if not self._are_round(skins):
            below = self._below(skins, phases)
            self._parts = [
                replace(part, footholds=relaid(part.footholds, part.limbs, ground, own))
                for part, own in zip(self._parts, below, strict=True)
            ]

    def _are_round(self, skins: Sequence[ArmSkin]) -> bool:
        return not skins or all(
            skins[arm].is_round(part.sides[arm], part.footholds.touching)
            for part in self._parts
            for arm in part.build.arms
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
        to_world = multiply(orientations, conjugate(self._body_turn))
        found: list[Floats] = []
        for number, part in enumerate(self._parts):
            footholds = part.footholds
            below = np.empty(footholds.skins.shape)
            for place, arm in enumerate(part.build.arms):
                own = pose.rotations[:, None, self._ends[arm] : self._ends[arm + 1]]
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
        phases = self.arm_phases(phase)
        angles, steering = self._poser.asked_at(phases, turn, self._timing.cycle_period)
        cycles, since = cycles_at(phases, self._middle)
        to_armature = multiply(self._body_turn, conjugate(orientations))
        moments = Moments(angles, steering, cycles, since, centres, orientations, to_armature)
        parts = [
            part.pose(number, moments, higher, smoothing) for number, part in enumerate(self._parts)
        ]
        rotations = np.zeros((len(phase), self._ends[-1], 4))
        strains = np.zeros(rotations.shape[:2])
        misses = np.zeros(phases.shape)
        for part in parts:
            for place, arm in enumerate(part.arms):
                bones = slice(self._ends[arm], self._ends[arm + 1])
                rotations[:, bones] = part.rotations[:, place]
                strains[:, bones] = part.strains[:, :, place].T
            misses[:, part.arms] = part.misses
        return GroundedPoses(
            rotations,
            strains,
            misses,
            tuple(each.joints for each in parts),
            tuple(each.in_contact for each in parts),
            cycles,
            tuple(each.shapes for each in parts if each.shapes is not None),
            tuple(each.evened for each in parts if each.evened is not None),
        )

    @property
    def radii(self) -> list[Floats]:
        """For each arm (joints,) metres from each joint to the skin below it."""
        places = {
            arm: part.limbs.radii[:, place]
            for part in self._parts
            for place, arm in enumerate(part.build.arms)
        }
        return [places[arm] for arm in sorted(places)]

    @property
    def builds(self) -> tuple[tuple[int, ...], ...]:
        """Numbers of the arms of each build, in the order of ``GroundedPoses.joints``."""
        return tuple(part.build.arms for part in self._parts)

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
        for part in self._parts:
            laid, reach = part.footholds, part.limbs.reach[-1]
            for place, arm in enumerate(part.build.arms):
                for cycle in range(int(first[arm]), int(last[arm]) + 1):
                    at = place, cycle - laid.first
                    if not laid.present[at]:
                        continue
                    since = np.array([laid.touch_down[at], laid.lift_off[at]])
                    turns = self._middle / CYCLE + cycle + since
                    ends = self._timing.distances([arm], turns[None])[0] * CYCLE / self._stride
                    found.append(
                        Foothold(
                            arm,
                            cycle,
                            laid.joints[at][0],
                            float(laid.headings[at]),
                            float(ends[0]),
                            float(ends[1]),
                            float(since[1] - since[0]),
                            float(laid.short[at] / reach[place]),
                        )
                    )
        return sorted(found, key=lambda each: (each.arm, each.cycle))
