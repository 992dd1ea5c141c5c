# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms of one build, brought from their gait's shapes to their footholds, at any frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ...rotations import Floats, components_first, multiply, rotate
from ..gait import Build, GaitPoser, bone_twists
from ..rig import Facing, rotate_bones
from .footholds import Footholds
from .grounded_poses import Raise
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


@dataclass(frozen=True, eq=False)
class Moments:
    """What is asked of all arms of a body at some frames, and where it is then."""

    angles: Floats
    """(frames, arms, links, 3) as of ``GaitPoser.asked_at`` …"""
    steering: Floats
    """(frames, arms) … and likewise."""
    cycles: np.ndarray
    """(frames, arms) number of the cycle that each arm is in."""
    since: Floats
    """(frames, arms) cycles since the middle of its stance."""
    centres: Floats
    """(frames, 3) of the body, world."""
    orientations: Floats
    """(frames, 4) of the canonical body, world."""
    to_armature: Floats
    """(frames, 4) from the world to the armature."""


@dataclass(frozen=True, eq=False)
class PartPoses:
    """Some arms of one build at some frames."""

    arms: list[int]
    """Their numbers among all arms of the body."""
    rotations: Floats
    """(frames, arms, bones, 4) unit quaternions in each bone's rest frame."""
    strains: Floats
    """(bones, frames, arms) by how much each bone is longer than at rest, as a share."""
    misses: Floats
    """(frames, arms) distance of an arm in stance from its foothold, in arm lengths."""
    joints: Floats
    """(frames, arms, segments + 1, 3), world."""
    in_contact: np.ndarray
    """(frames, arms, segments + 1) which joints rest on the ground."""
    shapes: Floats | None = None
    """(segments, 3, frames, arms of the build) the gait's own; none where they were known."""
    evened: Floats | None = None
    """(segments, 3, frames, arms) what evening out over time has added; none if it was not asked.
    """

    @classmethod
    def of_none(cls, frames: int, bones: int) -> PartPoses:
        """Of no arms at all."""
        return cls(
            [],
            np.zeros((frames, 0, bones, 4)),
            np.zeros((bones, frames, 0)),
            np.zeros((frames, 0)),
            np.zeros((frames, 0, bones + 1, 3)),
            np.zeros((frames, 0, bones + 1), dtype=bool),
        )


@dataclass(frozen=True, eq=False)
class WalkPart:
    """Arms of one build, all of which may stretch or none, on their ground."""

    poser: GaitPoser
    ground: Ground
    settings: StanceSettings
    sides: Sequence[Floats]
    """Of all arms of the body (bones, 3): where their suckers are, in the bones' rest frames."""
    build: Build
    limbs: Limbs
    footholds: Footholds

    def pose(
        self,
        number: int,
        moments: Moments,
        higher: Raise | None,
        smoothing: SwingSmoothing | None,
    ) -> PartPoses:
        """The arms at some frames.

        Args:
            number: of this part among all, as ``Raise`` counts them.
            moments: the frames.
            higher: which arms are to be higher, none for all as high as they have to be.
            smoothing: how arms in the air are evened out over frames that follow one another.
        """
        wanted = self.build.arms if higher is None else higher.arms
        chosen = [place for place, arm in enumerate(self.build.arms) if arm in wanted]
        columns = [self.build.arms[place] for place in chosen]
        frames, many = len(moments.angles), len(columns)
        bones = len(self.build.chain.lengths)
        if not columns:
            return PartPoses.of_none(frames, bones)
        asked = None
        if higher is None or higher.shapes is None:
            every = list(self.build.arms)
            shapes, _ = self.poser.shapes(
                self.build, moments.angles[:, every], moments.steering[:, every]
            )
            asked = shapes
        else:
            shapes = higher.shapes[number]
        arms, facing = self._batch(moments, chosen, higher)
        shapes = components_first.rotate(facing, shapes[..., chosen].reshape(bones, 3, -1))
        times = (each[:, columns].reshape(-1) for each in (moments.cycles, moments.since))
        stance = stance_at(arms, self.footholds, *times)
        strains, ways = pulled_to_footholds(arms, shapes, stance, self.ground, self.settings)
        evened, each_frame = None, (bones, 3, frames, many)
        if higher is not None and higher.evened:
            ways = components_first.normalized(
                ways + higher.evened[number][..., chosen].reshape(ways.shape)
            )
        elif higher is None and smoothing is not None:
            before, share = ways, airborne(stance).reshape(frames, many)
            ways = smoothing.evened(ways.reshape(each_frame), share).reshape(ways.shape)
            evened = (ways - before).reshape(each_frame)
        pose = kept_over_ground(arms, (strains, ways), stance, self.ground, self.settings)
        twists = bone_twists(self.build, moments.angles[:, columns])
        joints = pose.joints.reshape(bones + 1, 3, frames, many)
        in_contact = pose.in_contact.reshape(bones + 1, frames, many)
        return PartPoses(
            arms=columns,
            rotations=self._rotations(columns, pose, stance, moments.to_armature, twists),
            strains=pose.strains.reshape(bones, frames, many),
            misses=(pose.misses / arms.reach[-1]).reshape(frames, many),
            joints=np.moveaxis(joints, (0, 1), (2, 3)),
            in_contact=np.moveaxis(in_contact, 0, 2),
            shapes=asked,
            evened=evened,
        )

    def _batch(
        self, moments: Moments, chosen: list[int], higher: Raise | None
    ) -> tuple[Batch, Floats]:
        """Some arms at the frames, and what turns each one's own frame to the world's (4, batch).

        Args:
            moments: the frames.
            chosen: places of the arms in the build.
            higher: by how much they are to be higher.
        """
        columns = [self.build.arms[place] for place in chosen]
        turn = moments.orientations[:, None]
        facing = multiply(turn, self.poser.outward[columns]).reshape(-1, 4).T
        roots = moments.centres[:, None] + rotate(turn, self.limbs.roots[chosen])
        lift = np.zeros(facing.shape[-1])
        if higher is not None:
            lift = (higher.lift[:, columns] * self.limbs.reach[-1, chosen]).reshape(-1)
        batch = Batch(
            self.limbs,
            np.tile(chosen, len(moments.angles)),
            np.ascontiguousarray(roots.reshape(-1, 3).T),
            components_first.rotate(facing, np.array([1.0, 0.0, 0.0])[:, None]),
            components_first.rotate(facing, np.array([0.0, 0.0, 1.0])[:, None]),
            lift,
        )
        return batch, facing

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
        towards = components_first.rotate(back, -stance.upwards(segments)).reshape(shape)
        along = np.minimum(_FIRST_TURN + np.arange(segments) / 3.0, 1.0)
        most = min(_MOST_TURN, _TURN / segments) * along
        turns = most[:, None, None] * stance.weight.reshape(shape[2:])
        return rotate_bones(
            [self.poser.rests[arm] for arm in columns],
            components_first.rotate(back, pose.directions).reshape(shape),
            bank,
            Facing([self.sides[arm] for arm in columns], towards, turns),
        )


def limbs_of(
    poser: GaitPoser,
    build: Build,
    radii: Sequence[Floats],
    *,
    scale: float,
    planted: float,
    may_stretch: bool,
) -> Limbs:
    """Arms of one build in the world's measure, and where their gait has its footholds.

    Args:
        poser: their gait.
        build: the arms.
        radii: for each arm of the body (bones + 1,) armature units from joints to the skin below.
        scale: metres of the armature's unit.
        planted: share of an arm that lies down.
        may_stretch: whether their bones may get longer.
    """
    columns, gait = list(build.arms), poser.settings.gait
    limbs = Limbs(
        arms=build.arms,
        roots=scale * poser.roots[columns],
        outward=poser.outward[columns],
        offsets=poser.offsets[columns],
        lengths=scale * build.chain.lengths[:, None] * poser.lengths[columns],
        radii=scale * np.stack([radii[arm] for arm in columns], axis=1),
        aims=np.zeros((len(columns), 2)),
        may_stretch=may_stretch,
        free=np.array([gait.curve(poser.arms[arm].pair).free for arm in columns]),
    )
    steps = build.chain.lengths[:, None, None] * poser.middle_shapes(columns)
    joint = limbs.touching(planted)
    near, far = steps[:joint].sum(axis=0), steps[joint:].sum(axis=0)
    aims = np.arctan2([near[1], far[1]], [near[0], far[0]]).T
    return replace(limbs, aims=_ASKEW * np.tanh(aims / _ASKEW))
