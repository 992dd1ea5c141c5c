# SPDX-License-Identifier: GPL-3.0-or-later
"""A motion taken from its plan to where it plays: rolled up onto its ground, or laid on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...content_cache import ContentCache, content_key
from ...rotations import IDENTITY, Floats, multiply, normalized, rotate, shortest_arc, slerp
from ...smoothing import smooth_step
from ..ground import Carpet, Ground, HeightField, Unrolled, sample_ground, turn_between
from ..path import Route
from ..rig import ArmFrames, ArmMotion, BodyFrame
from .job import EDGE, FINE, MotionJob
from .segments import Standing

_ATTACHED: Final = 0.4
"""Share of an arm from its root over which it passes from its body's turn to the ground's."""
_PASSES: Final = 4
"""Times that an arm which must not stretch is led from its root to its tip and back."""


_NEAR: Final = 0.25
"""Arm lengths about a joint in which ground that moves is looked at for how it turns …"""
_WIDE: Final = 0.5
"""… and about the body, which rides on all of it."""
_AIR: Final = (0.12, 0.45)
"""Arm lengths above the ground up to which an arm lies there, and from which on it does not."""
_CROSS: Final = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0], [0.0, 0.0]])
_UPRIGHT: Final = float(np.cos(np.radians(1.0)))
"""Cosine of how far the up of a body in place may be off the vertical, and it is laid on a mesh:
else the artist has laid it somehow."""
_RESTING: Final = 0.05
"""Arm lengths of a stride up to which a body in place rests: under one that walks there the ground
goes by, and is level."""
_ABOUT: Final = 1.8
"""Arm lengths to all sides up to which that mesh is looked at."""
_ON_GROUND: Final = 0.5
"""Arm lengths from it up to which a body stands on it, and not above or below."""

_floors: Final[ContentCache[tuple[HeightField, HeightField]]] = ContentCache(2)


@dataclass(frozen=True, eq=False)
class Carry:
    """What takes a motion to where it plays: first onto its ground, then along with it."""

    unrolled: Unrolled | None
    """None where the plan is the world."""
    reach: float
    """Metres that arms are long."""
    route: Route
    """What the body's distances are counted on."""
    carpet: Carpet | None = None
    """None where the ground stays."""

    def places(
        self, points: Floats, distance: Floats, frames: Floats | None = None, *, wide: bool = False
    ) -> tuple[Floats, Floats]:
        """Where points (moments, …, 3) of the plan are in the world, and turns (moments, …, 4) that
        lead there, about a body that has come so far (moments,).

        At frames (moments,), or before the ground moves. Wide, they ride on the ground about them,
        else on that right below them.
        """
        shape, ones = points.shape[:-1], [1] * (points.ndim - 2)
        metres = self.route.metres_at(distance)
        along = np.broadcast_to(metres.reshape(-1, *ones), shape)
        there, turns = self._up(points, along)
        if self.carpet is None or frames is None:
            return there, turns
        flat, when = points.reshape(-1, 3), np.broadcast_to(frames.reshape(-1, *ones), shape)
        before, after = (
            np.empty((len(flat), len(_CROSS), 3)),
            np.empty((len(flat), len(_CROSS), 3)),
        )
        size = (_WIDE if wide else _NEAR) * self.reach
        for number, step in enumerate(_CROSS):
            samples, faces, weights = self.carpet.around(flat[:, :2] + size * step)
            world, _ = self._up(samples, np.repeat(along.reshape(-1, 1), 4, axis=1))
            moved = self.carpet.moved(world, faces, when.reshape(-1))
            before[:, number] = np.einsum("nk,nkc->nc", weights, world)
            after[:, number] = np.einsum("nk,nkc->nc", weights, moved)
        turn = turn_between(before[:, :4], after[:, :4]).reshape(turns.shape)
        start, end = (
            (each.mean(axis=1) if wide else each[:, 4]).reshape(points.shape)
            for each in (before, after)
        )
        return end + rotate(turn, there - start), multiply(turn, turns)

    def on_ground(self, joints: Floats) -> Floats:
        """(moments, joints) how far each of an arm's joints (moments, joints, 3) goes with the
        ground: all of a body that travels do.
        """
        return np.ones(joints.shape[:-1])

    def _up(self, points: Floats, along: Floats) -> tuple[Floats, Floats]:
        """Where points (…, 3) of the plan are before the ground moves, and turns (…, 4)."""
        if self.unrolled is None:
            return points, np.broadcast_to(IDENTITY, (*points.shape[:-1], 4))
        return self.unrolled.to_world(points, along), self.unrolled.turns_at(points, along)


@dataclass(frozen=True, eq=False)
class Laid:
    """What lays a body that rests, planned on level ground, onto the ground that is there."""

    ground: Ground
    felt: Ground
    """The same with its edges rounded off, as arms feel it."""
    level: float
    """Height that the plan's ground has."""
    reach: float
    """Metres that arms are long."""
    lean: float
    """Share by which the body leans with the ground."""
    body_stays: bool
    """Whether nothing moves the body."""

    def places(
        self,
        points: Floats,
        distance: Floats,  # noqa: ARG002 - as those that travel
        frames: Floats | None = None,  # noqa: ARG002
        *,
        wide: bool = False,
    ) -> tuple[Floats, Floats]:
        """Where points (moments, …, 3) come to lie, and turns (moments, …, 4) that lead there: as
        high above the ground as they were above the level one, and turned as it is about them.
        """
        if wide and self.body_stays:
            return points, np.broadcast_to(IDENTITY, (*points.shape[:-1], 4))
        flat = points.reshape(-1, 3)
        at = (points if wide else self._anchors(points)).reshape(-1, 3)
        size = (_WIDE if wide else _NEAR) * self.reach
        before = np.empty((len(flat), len(_CROSS), 3))
        before[..., :2] = at[:, None, :2] + size * _CROSS
        before[..., 2] = self.level
        after = before.copy()
        after[..., 2] = self.felt.height(before[..., :2].reshape(-1, 2)).reshape(len(flat), -1)
        turn = turn_between(before[:, :4], after[:, :4])
        start, end = (each.mean(axis=1) if wide else each[:, 4] for each in (before, after))
        if wide:
            turn = slerp(np.broadcast_to(IDENTITY, turn.shape), turn, np.full(len(turn), self.lean))
        there = end + rotate(turn, flat - start)
        return there.reshape(points.shape), turn.reshape(*points.shape[:-1], 4)

    def on_ground(self, joints: Floats) -> Floats:
        """(moments, joints) how far each of an arm's joints (moments, joints, 3) goes with the
        ground: those that lead to where it lies, and those beyond. One in the air is the body's.
        """
        return np.broadcast_to(self._lies(joints).max(axis=1, keepdims=True), joints.shape[:-1])

    def _lies(self, joints: Floats) -> Floats:
        heights = (joints[..., 2] - self.level) / self.reach
        return smooth_step((_AIR[1] - heights) / (_AIR[1] - _AIR[0]))

    def _anchors(self, joints: Floats) -> Floats:
        """By which ground each of an arm's joints (moments, joints, 3) is laid: what lies, or leads
        there, by that below it; what is in the air beyond by that of what lies before it, so that
        its shape stays.
        """
        lies, result = self._lies(joints)[..., None], joints.copy()
        own = 1.0 - np.maximum.accumulate(lies, axis=1) * (1.0 - lies)
        for joint in range(1, joints.shape[1]):
            before = result[:, joint - 1]
            result[:, joint] = before + own[:, joint] * (joints[:, joint] - before)
        return result


def laid_on(job: MotionJob, standing: Standing | None, reach: float) -> Laid | None:
    """The mesh that lies about a body that rests in place; none where there is none, or where it is
    to stand otherwise.

    Args:
        job: the motion.
        standing: how its gait stands, if it does.
        reach: metres that arms are long.
    """
    creature, floor, ground = job.creature, job.floor, job.ground
    if not job.in_place or floor is None or ground is None or standing is None:
        return None
    if job.gaits[0].travel.stride > _RESTING:
        return None
    world, up = creature.world, creature.body.rotation[:, 2]
    upright = (world[:3, :3] @ up)[2] > _UPRIGHT * creature.scale
    if job.begin is not None or job.end is not None or not upright:
        return None
    place = world[:3, 3]

    def about() -> tuple[HeightField, HeightField]:
        sampled = sample_ground(
            floor.triangles,
            place[None],
            np.zeros(1, dtype=bool),
            reach=_ABOUT * reach,
            spacing=FINE * reach,
            headroom=reach,
            content=floor.content,
            bare=float(place[2]),
        )
        return sampled, sampled.rounded(EDGE * reach)

    sampled, felt = _floors.get(content_key(floor.content, place, reach), about)
    if abs(float(sampled.height(place[None, :2])[0] - place[2])) > _ON_GROUND * reach:
        return None
    stays, level = not creature.root_bone, float(place[2])
    if stays:
        # Nothing lifts the body to its height: level ground is as far below it as that asks for.
        level -= float(standing.line.clearances[0] - creature.scale * creature.body.center @ up)
    return Laid(sampled, felt, level, reach, ground.stance.lean, stays)


def carried(  # noqa: PLR0917 - what is carried, where it is, and when
    carry: Carry | Laid,
    frames: Sequence[ArmFrames],
    arms: ArmMotion,
    going: tuple[Floats, Floats],
    distance: Floats,
    at: Floats,
    *,
    body: BodyFrame,
    scale: float,
    may_stretch: Sequence[bool],
) -> tuple[Floats, Floats]:
    """Where the armature is in the world, locations (moments, 3) and orientations (moments, 4);
    arms are changed in place.

    The body goes as one piece; arms leave it as it turns and lie as their ground does, and what
    rests in the plan rests in the world.

    Args:
        carry: to the world.
        frames: of each arm.
        arms: as they were planned.
        going: locations and orientations of the armature in the plan.
        distance: (moments,) metres that the body has come.
        at: (moments,) frames, which need not be whole.
        body: where it is in the armature.
        scale: metres of the armature's unit.
        may_stretch: of each arm.
    """
    centre = going[0] + rotate(going[1], scale * body.center)
    place, turn = carry.places(centre, distance, at, wide=True)
    location = place + rotate(turn, going[0] - centre)
    start = 0
    for arm, stretches in zip(frames, may_stretch, strict=True):
        own = slice(start, start + len(arm.bones))
        start = own.stop
        bones = multiply(going[1][:, None], arm.from_bones(arms.rotations[:, own]))
        lengths = scale * arm.lengths * (1.0 + arms.strains[:, own])
        root = going[0] + rotate(going[1], scale * arm.root)
        steps = np.cumsum(lengths[..., None] * rotate(bones, _ALONG), axis=1)
        joints = np.concatenate([root[:, None], root[:, None] + steps], axis=1)
        there, turns = carry.places(joints, distance, at)
        with_body = place[:, None] + rotate(turn[:, None], joints - centre[:, None])
        share = smooth_step(arm.reach / (_ATTACHED * arm.length)) * carry.on_ground(joints)
        there = with_body + share[..., None] * (there - with_body)
        with_turn = np.broadcast_to(turn[:, None], turns.shape)
        turns = slerp(with_turn, turns, np.broadcast_to(share, turns.shape[:2]))
        if not stretches:
            there = _led(there, lengths)
        ways = np.diff(there, axis=1)
        middle = normalized(turns[:, :-1] + _alike(turns[:, 1:], turns[:, :-1]))
        bones = multiply(middle, bones)
        bones = multiply(shortest_arc(rotate(bones, _ALONG), normalized(ways)), bones)
        world = multiply(turn, going[1])
        back = world * np.array([1.0, -1.0, -1.0, -1.0])
        arms.rotations[:, own] = arm.to_bones(multiply(back[:, None], bones))
        if stretches:
            arms.strains[:, own] = np.linalg.norm(ways, axis=-1) / (scale * arm.lengths) - 1.0
    return location, multiply(turn, going[1])


_ALONG: Final = np.array([1.0, 0.0, 0.0])


def _alike(turns: Floats, others: Floats) -> Floats:
    """Quaternions (…, 4) of the sign of others."""
    return np.where(np.sum(turns * others, axis=-1, keepdims=True) < 0.0, -turns, turns)


def _led(joints: Floats, lengths: Floats) -> Floats:
    """Joints (moments, bones + 1, 3) of a chain with bones of these lengths (moments, bones), from
    the same root to the same tip as far as they reach, along the joints given.
    """
    result = joints.copy()
    for _ in range(_PASSES):
        for bone in range(lengths.shape[1] - 1, -1, -1):
            way = normalized(result[:, bone] - result[:, bone + 1])
            result[:, bone] = result[:, bone + 1] + lengths[:, bone, None] * way
        result[:, 0] = joints[:, 0]
        for bone in range(lengths.shape[1]):
            way = normalized(result[:, bone + 1] - result[:, bone])
            result[:, bone + 1] = result[:, bone] + lengths[:, bone, None] * way
    return result
