# SPDX-License-Identifier: GPL-3.0-or-later
"""A creature at some moments: how its bones are turned and stretched, and where it is."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ...content_cache import part_of
from ...keyframes import halfway_values
from ...rotations import (
    Floats,
    conjugate,
    continuous,
    from_matrix,
    multiply,
    normalized,
    rotate,
    shortest_arc,
)
from ...skeleton import Skeleton
from ...smoothing import blurred, covered, smooth_step, spans
from .arm_chains import BodyFrame, joint_positions
from .bone_rotations import ArmFrames, along_segments, arm_rest, rotate_bones, turns_in_world


@dataclass(frozen=True, eq=False)
class Poses:
    """A creature at some moments."""

    rotations: Floats
    """(moments, bones, 4) of all arms, one after the other."""
    strains: Floats
    """(moments, bones)"""
    locations: Floats
    """(moments, 3) of the armature, world."""
    orientations: Floats
    """(moments, 4)"""


@dataclass(eq=False)
class ArmMotion:
    """All arms at some moments, while they are worked out."""

    rotations: Floats
    """(moments, bones, 4) of all arms, one after the other."""
    strains: Floats
    """(moments, bones) by how much bones are longer than at rest, as a share."""
    late: Floats
    """(moments, arms) arm lengths from an arm to the foothold that it cannot reach."""
    misses: Floats
    """(moments, arms) arm lengths from an arm to the targets of its gait."""
    in_contact: list[np.ndarray]
    """For each arm (moments, joints) which rest on the ground."""
    cycles: np.ndarray
    """(moments, arms) number of each arm's cycle."""

    @classmethod
    def at_rest(cls, moments: int, bones: Sequence[int]) -> ArmMotion:
        """Arms at rest, each of so many bones, that hold on to nothing for so many moments."""
        rotations = np.zeros((moments, sum(bones), 4))
        rotations[..., 0] = 1.0
        return cls(
            rotations=rotations,
            strains=np.zeros((moments, sum(bones))),
            late=np.zeros((moments, len(bones))),
            misses=np.zeros((moments, len(bones))),
            in_contact=[np.zeros((moments, each + 1), dtype=bool) for each in bones],
            cycles=np.zeros((moments, len(bones)), dtype=np.int64),
        )

    def at(self, moments: np.ndarray | slice) -> ArmMotion:
        """The same at some of these moments."""
        return part_of(self, moments, axis=0)

    def copy(self) -> ArmMotion:
        """The same, whose poses may be changed."""
        return replace(
            self,
            rotations=self.rotations.copy(),
            strains=self.strains.copy(),
            late=self.late.copy(),
        )


def halfway_automatic(poses: Poses, *, cyclic: bool) -> Poses:
    """Half way between frames (frames − 1), as Blender plays keys with automatic handles, of a loop
    whose curves repeat if cyclic.
    """
    return Poses(
        _automatic(continuous(poses.rotations), cyclic=cyclic, turns=True),
        _automatic(poses.strains, cyclic=cyclic),
        _automatic(poses.locations, cyclic=cyclic),
        _automatic(continuous(poses.orientations), cyclic=cyclic, turns=True),
    )


def _automatic(values: Floats, *, cyclic: bool, turns: bool = False) -> Floats:
    """Half way between values (frames, …) whose keys have automatic handles.

    The slope at a key is that from its neighbour before to the one after; at either end of a curve
    that does not repeat it is level. The handle's length is Blender's.
    """
    slopes = np.zeros_like(values)
    slopes[1:-1] = 0.5 * (values[2:] - values[:-2])
    if cyclic and len(values) > 2:
        # The last frame is the first again; of a turn it may be so the other way round.
        same = np.sum(values[-1] * values[0], axis=-1, keepdims=True)
        sign = np.where(same < 0.0, -1.0, 1.0) if turns else 1.0
        slopes[0] = 0.5 * (values[1] - values[0] + sign * (values[-1] - values[-2]))
        slopes[-1] = sign * slopes[0]
    half = halfway_values(values, slopes)
    return normalized(half) if turns else half


def halfway_linear(poses: Poses) -> Poses:
    """Half way between frames (frames − 1), straight on from each to the next."""
    return Poses(
        _half_turns(poses.rotations),
        0.5 * (poses.strains[:-1] + poses.strains[1:]),
        0.5 * (poses.locations[:-1] + poses.locations[1:]),
        _half_turns(poses.orientations),
    )


def _half_turns(turns: Floats) -> Floats:
    """Unit quaternions (frames − 1, …, 4) half way between those of frames (frames, …, 4)."""
    before, after = turns[:-1], turns[1:]
    other = np.sum(before * after, axis=-1, keepdims=True) < 0.0
    return normalized(before + np.where(other, -after, after))


# --- Where the armature, or its root bone, must be for the body to be on its route ----------------


def object_transforms(
    body: BodyFrame, scale: float, positions: Floats, rotations: Floats
) -> tuple[Floats, Floats]:
    """World locations (frames, 3) and orientations (frames, 4) of an armature object of uniform
    scale.

    Positions (frames, 3) and rotations (frames, 4), world, are of the body's centre and of the
    canonical body.
    """
    turned = multiply(rotations, conjugate(from_matrix(body.rotation)))
    return positions - rotate(turned, scale * body.center), turned


def root_bone_transforms(
    skeleton: Skeleton,
    bone: str,
    world: Floats,
    locations: Floats,
    orientations: Floats,
) -> tuple[Floats, Floats]:
    """Locations (frames, 3) and rotations (frames, 4) of a bone, in its rest frame.

    The bone carries the body as the object would have, were the object at ``locations`` and
    ``orientations`` of ``object_transforms``; its own parents stay at rest, and the object by its
    world matrix (4, 4), of uniform scale.
    """
    scale = float(np.cbrt(abs(np.linalg.det(world[:3, :3]))))
    still = conjugate(from_matrix(world[:3, :3] / scale))
    # The motion that the whole armature would make, seen from the armature where it stands.
    turn = multiply(still, orientations)
    shift = rotate(still, locations - world[:3, 3]) / scale
    number = skeleton.index[bone]
    rest = skeleton.rest_rotations[number]
    head = skeleton.heads[number]
    moved = rotate(turn, head) + shift - head
    return rotate(conjugate(rest), moved), multiply(conjugate(rest), multiply(turn, rest))


def carried_by_root_bone(
    skeleton: Skeleton, bone: str, world: Floats, locations: Floats, rotations: Floats
) -> tuple[Floats, Floats]:
    """Inverse of :func:`root_bone_transforms`, of which it takes the results.

    Locations (frames, 3) and orientations (frames, 4) are those in the world that the object would
    have to have, were it the one that travels.
    """
    scale = float(np.cbrt(abs(np.linalg.det(world[:3, :3]))))
    stands = from_matrix(world[:3, :3] / scale)
    number = skeleton.index[bone]
    rest, head = skeleton.rest_rotations[number], skeleton.heads[number]
    turn = multiply(multiply(rest, rotations), conjugate(rest))
    shift = rotate(rest, locations) + head - rotate(turn, head)
    return world[:3, 3] + scale * rotate(stands, shift), multiply(stands, turn)


# --- Head and mantle of a swimming body: stretched out along the way, in line with the arms -------
#
# At rest an octopus carries its mantle leaning back. Swimming it goes mantle first, and a mantle
# that hangs off to the side would brake it. One that leans is raised. One that lies flat behind
# the head, on bodies that are built lying as a squid is, would swallow the head: such a body
# swims as it lies, and its arms close before its face.


_FARTHEST_LEAN: Final = np.radians(75.0)
"""A part that leans further than this is not built to be straightened: it would swallow the head
that it lies behind."""
_FARTHEST_BACK: Final = np.radians(105.0)
"""A mantle that hangs lower than this behind the head does not lie."""
_MOST_ASIDE: Final = np.radians(30.0)
"""Nor does one that points this far to a side."""
_SAME_PLACE: Final = 1e-3
"""Joints that are closer than this share of the body's size are one."""


def find_mantle(
    skeleton: Skeleton, arms: Sequence[Sequence[str]], body: BodyFrame
) -> tuple[str, ...]:
    """Bones from what the arms (bones root to tip) stand on to the tip of the largest part that is
    no arm; none if there is no such part above the arms or level behind them, or if it can neither
    be raised nor be swum along.

    Bones without length of their own, as importers put between others, are left out: they ride
    along.
    """
    limbs = {skeleton.index[bone] for bones in arms for bone in bones}
    carrying: set[int] = set()
    for bones in arms:
        bone = skeleton.parents[skeleton.index[bones[0]]]
        while bone >= 0:
            carrying.add(bone)
            bone = skeleton.parents[bone]
    same = _SAME_PLACE * float(np.max(np.ptp(skeleton.heads, axis=0), initial=0.0))
    best: tuple[int, ...] = ()
    largest = 0.0
    for tip in sorted(set(range(len(skeleton))) - limbs):
        path = _path(skeleton, tip, carrying, same)
        if not path or not limbs.isdisjoint(path):
            continue
        joints = joint_positions(skeleton, [skeleton.names[bone] for bone in path])
        size = float(np.linalg.norm(joints[-1] - joints[0]))
        # Of two that come equally far, the one that hangs on the other.
        if size > largest - same and _is_above(body.to_body(joints[-1]), size):
            best, largest = path, size
    if any(skeleton.constrained[bone] for bone in best):
        return ()
    mantle = tuple(skeleton.names[bone] for bone in best)
    if len(_not_raised(skeleton, mantle, body)) and not lies_back(skeleton, mantle, body):
        return ()
    return mantle


def lies_back(skeleton: Skeleton, mantle: Sequence[str], body: BodyFrame) -> float:
    """How far from the body's +Z a mantle lies back that is not to be raised, radians; else 0."""
    lying = _not_raised(skeleton, mantle, body)
    if not len(lying):
        return 0.0
    aside, behind, above = (lying[-1] - lying[0]).tolist()
    lean = float(np.arctan2(behind, above))
    if not 0.0 < lean < _FARTHEST_BACK or abs(aside) > np.tan(_MOST_ASIDE) * np.hypot(
        behind, above
    ):
        return 0.0
    return lean


def stretch_mantle(
    skeleton: Skeleton, mantle: Sequence[str], body: BodyFrame, amount: float
) -> Floats:
    """Rotations (bones, 4) in each bone's rest frame that stretch the mantle towards the body's +Z:
    by 0 it stays at rest, by 1 it is straight.
    """
    if not mantle:
        return np.empty((0, 4))
    rest = normalized(np.diff(joint_positions(skeleton, mantle), axis=0))
    towards = normalized((1.0 - amount) * rest + amount * body.rotation[:, 2])
    turns = rotate_bones(
        [arm_rest(skeleton, mantle)],
        towards[:, :, None, None],
        np.zeros((len(mantle), 1, 1)),
    )
    return turns[0, 0]


def _is_above(tip: Floats, size: float) -> bool:
    """Whether a part of such a size whose tip (3,) is there, canonical, is above the arms.

    One that lies behind them may be level with them.
    """
    _, behind, above = tip.tolist()
    return above > 0.0 or (behind > 0.0 and above > np.cos(_FARTHEST_BACK) * size)


def _not_raised(skeleton: Skeleton, mantle: Sequence[str], body: BodyFrame) -> Floats:
    """Canonical joints (n, 3) of a mantle from the first bone on that leans too far to be raised.

    None at all if it can be.
    """
    if not mantle:
        return np.empty((0, 3))
    joints = body.to_body(joint_positions(skeleton, mantle))
    rising = normalized(np.diff(joints, axis=0))[:, 2]
    far = np.flatnonzero(rising < np.cos(_FARTHEST_LEAN))
    return joints[far[0] :] if len(far) else np.empty((0, 3))


def _path(skeleton: Skeleton, tip: int, carrying: set[int], same: float) -> tuple[int, ...]:
    """Bones from below what carries the arms to a tip; none if it does not hang on that.

    A bone without a parent hangs on what carries the arms if it begins where that begins or ends.
    """
    path: list[int] = []
    bone = tip
    while bone >= 0 and bone not in carrying:
        if not path or np.linalg.norm(skeleton.heads[bone] - skeleton.heads[path[-1]]) > same:
            path.append(bone)
        bone = skeleton.parents[bone]
    if bone < 0 and path:
        ends = [place[each] for each in carrying for place in (skeleton.heads, skeleton.tails)]
        start = skeleton.heads[path[-1]]
        if all(np.linalg.norm(end - start) > same for end in ends):
            return ()
    return tuple(reversed(path))


# --- Bones that would turn faster than an eye can follow take their time --------------------------
#
# Where a walk is tighter or steeper than its arms are made for, they are asked for poses on one
# frame and for others on the next. Nothing in the motion of one frame can help that: an arm in
# the air that has to be elsewhere at once sets out earlier, and comes later. All that happens is
# a mean over the frames round the one that is too fast, as wide as it has to be: none where
# nothing is.


_FASTEST: Final = np.radians(28.0) * 24.0
"""Radians a second that bones may turn in the world …"""
_IN_A_CYCLE: Final = np.radians(930.0)
"""… and radians in a cycle of the gait, if that is more: Hurry may turn by 39° in a frame. At 700
it is 4 % of an arm in bumps instead of 1 %; at 1150 it turns by 41° on stairs instead of 37°, arms
of long bones by 47°."""
_WIDEST: Final = 0.34
"""Seconds to either side over which means are taken at most …"""
_TRIED: Final = (0.125, 0.25, 0.25, 0.5, 0.5, 1.0)
"""… and the shares of that which are taken where the one before was not enough."""
_TORN: Final = 2.5
"""Times that from which on an arm lets go rather than pop: that it holds on is no longer seen. At 2
Hurry slides over bumps by 8 % of an arm of long bones instead of 0.6 %."""
_RESTING: Final = 0.05
"""Seconds before and after a hold within which an arm comes to stay what it is: at once, arms that
stand in a pose of the artist's would turn by 83° in a frame as the body leaves them."""
_JERK: Final = np.radians(15.0) * 24.0
"""Radians a second that a bone sets out with all at once, when it is …"""
_ABRUPT: Final = 5.0
"""… so many times what it turned by in the frame before: who sees it takes it for a jerk …"""
_QUICKEST: Final = 0.9
"""… unless a cycle of the gait takes fewer seconds: then whatever moves sets out so."""
_AT_ONCE: Final = 0.04
"""Seconds to either side over which a mean is taken of a bone that does."""
_LATE: Final = 0.5 / 24.0
"""Seconds by which what was held until then sets out later at most …"""
_STAYS_LATE: Final = 4.0 / 24.0
"""… for so long …"""
_IN_TIME: Final = 8.0 / 24.0
"""… and seconds after which it is in time again. By means alone, which move nothing that is held,
57 bones still set out so on eight ways of Hurry, with this two."""
_SOFTENINGS: Final = 5
"""How often it is at most: with two, nine of the seventeen bones that do in Hurry over bumps, on a
slope and up stairs do still, with five two."""
_HELPED: Final = 0.5
"""Share of what a turn is too fast by that must be gone for bones to have been given time."""
_SAME: Final = 1e-6
"""Radians by which a turn may be another and still be the same …"""
_UNSEEN: Final = np.radians(0.5)
"""… and by which it may be more for making way: what nobody sees."""


def fastest_turn(rate: float, per_cycle: float) -> float:
    """Radians that a bone may turn in a frame, at so many frames a second and in a cycle."""
    return max(_FASTEST / rate, _IN_A_CYCLE / per_cycle)


def turn_limits(
    rate: float, per_cycle: float, reaching: np.ndarray | None = None, every: int = 1
) -> Floats:
    """Radians (moments − every, arms) that bones may turn within a frame: as quick gaits are, so
    may arms be, but those that are ``reaching`` (moments, arms). (1, 1) where none ever is.
    """
    most = fastest_turn(rate, per_cycle)
    if reaching is None:
        return np.full((1, 1), most)
    return np.where(reaching[every:] | reaching[:-every], fastest_turn(rate, np.inf), most)


def easing_turns(
    arms: Sequence[ArmFrames],
    rotations: Floats,
    orientations: Floats,
    held: Sequence[np.ndarray],
    *,
    rate: float,
    limits: Floats,
    every: int = 1,
    cyclic: bool = False,
    turning: Floats | None = None,
) -> Generator[None, None, tuple[Floats, Floats] | None]:
    """Arms whose bones turn no faster than an eye can follow, wherever they are free to; in steps.

    Args:
        arms: in the order of their bones.
        rotations: (moments, bones, 4) of all arms, one after the other.
        orientations: (moments, 4) of the armature, world.
        held: for each arm (moments, bones or 1) which bones are to stay as they are.
        rate: frames per second.
        limits: how far bones may turn, of :func:`turn_limits`.
        every: at every how many moments there is a frame.
        cyclic: whether the last moment is the first again.
        turning: what :func:`turns_in_world` says of them, if that is known.

    Returns:
        Rotations (moments, bones, 4), and how far each arm was moved (moments, arms), 0…1; none
        where nothing is too fast.
    """
    result, moved, start = rotations, np.zeros((len(rotations), len(arms))), 0
    if turning is None:
        turning = turns_in_world(arms, rotations, orientations, every)
        yield
    limits = np.broadcast_to(limits, (len(turning), len(arms)))
    for number, arm in enumerate(arms):
        own = slice(start, start + len(arm.bones))
        start, most = own.stop, limits[:, number]
        if not (turning[:, own] > most[:, None]).any():
            continue
        before = _in_world(arm, rotations[:, own], orientations, cyclic=cyclic)
        if before is None:
            continue
        taking_time = _TakingTime(every, every * rate, cyclic, most)
        # What holds on need not let go of what it has only rolled too fast.
        frames, rolled = taking_time.rolled(before)
        frames, share = taking_time.eased(frames, held[number])
        some = np.flatnonzero(np.maximum(share.max(axis=1), rolled))
        if not len(some):
            continue
        if result is rotations:
            result = rotations.copy()
        result[some, own] = _of_bones(arm, frames[some], orientations[some])
        # What holds on is not to be moved for its tip.
        moved[:, number] = share.min(axis=1)
        yield
    return None if result is rotations else (result, moved)


def softening_starts(
    arms: Sequence[ArmFrames],
    rotations: Floats,
    orientations: Floats,
    held: Sequence[np.ndarray],
    *,
    rate: float,
    per_cycle: float,
    every: int = 1,
    cyclic: bool = False,
    turning: Floats | None = None,
) -> Generator[None, None, tuple[Floats, Floats] | None]:
    """Rotations (moments, bones, 4) of arms of which no bone sets out all at once that is free to
    do otherwise, and how far each arm was moved (moments, arms), 0…1; none where nothing does. In
    steps.

    Arguments are as of :func:`easing_turns`; a cycle of the gait takes so many frames. Means are
    narrow: what is shown of a motion long before it is worked out looks but some frames around.
    """
    if per_cycle < _QUICKEST * rate:
        return None
    taking_time = _TakingTime(every, every * rate, cyclic)
    result, whole = rotations, np.zeros((len(rotations), len(arms)))
    for _ in range(_SOFTENINGS):
        if turning is None:
            turning = turns_in_world(arms, result, orientations, every)
            yield
        starts, turning, before, start = _starts(turning, rate, every), None, result, 0
        for number, arm in enumerate(arms):
            own = slice(start, start + len(arm.bones))
            start, sudden = own.stop, starts[:, own].any(axis=1)
            if not sudden.any():
                continue
            frames = _in_world(arm, result[:, own], orientations, cyclic=cyclic)
            if frames is None:
                continue
            frames, share = taking_time.softened(frames, held[number], sudden)
            some = np.flatnonzero(share.max(axis=1))
            if not len(some):
                continue
            if result is before:
                result = before.copy()
            whole[:, number] = np.maximum(whole[:, number], share.min(axis=1))
            result[some, own] = _of_bones(arm, frames[some], orientations[some])
            yield
        if result is before:
            break
    return None if result is rotations else (result, whole)


def keeping_where_gentle(
    arms: Sequence[ArmFrames],
    before: Floats,
    changed: Floats,
    orientations: Floats,
    *,
    rate: float,
    limits: Floats,
    lower: np.ndarray | None = None,
    every: int = 1,
    cyclic: bool = False,
) -> Generator[None, None, Floats]:
    """Rotations (moments, bones, 4), changed from what they were before; as before wherever an arm
    sets out all at once by more for it, turns by more than it may, or comes to be ``lower``
    (moments, arms) than it ought to. In steps; arguments are as of :func:`easing_turns`, and each
    stretch counts by itself.
    """
    then = turns_in_world(arms, before, orientations, every)
    yield
    now = turns_in_world(arms, changed, orientations, every)
    yield
    more = np.subtract(*(each * _starts(each, rate, every) for each in (now, then)))
    worse = np.zeros((len(changed), len(arms)))
    ends = np.cumsum([len(arm.bones) for arm in arms])
    worse[every:] = np.add.reduceat(more, np.concatenate([[0], ends[:-1]]), axis=1)
    if lower is not None:
        worse[lower] = np.inf
    return (
        yield from _kept(
            *(arms, before, changed, orientations),
            limits=limits,
            every=every,
            cyclic=cyclic,
            spoilt=lambda was, left: left > max(was, 0.0) + _SAME,
            worse=worse,
            turning=(then, now),
        )
    )


def _in_world(
    arm: ArmFrames, rotations: Floats, orientations: Floats, *, cyclic: bool
) -> Floats | None:
    """Frames (moments, bones, 4) of an arm in the world, from its bones' rotations, each near to
    the one before; none where that is not so from the last of a loop to the first.
    """
    frames = continuous(multiply(orientations[:, None], arm.from_bones(rotations)))
    torn = cyclic and np.any(np.sum(frames[-1] * frames[0], axis=-1) < 0.0)
    return None if torn else frames


def _of_bones(arm: ArmFrames, frames: Floats, orientations: Floats) -> Floats:
    """Its bones' rotations (moments, bones, 4) from its frames in the world."""
    return arm.to_bones(multiply(conjugate(orientations[:, None]), frames))


@dataclass(frozen=True, eq=False)
class _TakingTime:
    """Means over time of frames (moments, bones, 4) of an arm, world, where it is too fast."""

    every: int
    """At every how many moments there is a frame."""
    rate: float
    """Moments a second."""
    cyclic: bool
    """Whether the last moment is the first again."""
    most: Floats | float = np.inf
    """(moments − every,) radians that bones may turn within a frame."""

    def eased(self, before: Floats, held: np.ndarray) -> tuple[Floats, Floats]:
        """The frames, and how far means count in them (moments, bones or 1): not while they are
        held (moments, bones or 1), but where they would pop. Next to that they see half as far as
        it is away: the arm leaves it as it did, and does not cut through the ground.
        """
        rests = max(1, round(_RESTING * self.rate))
        loose = 1.0 - covered(held.astype(np.float64), rests, cyclic=self.cyclic)
        frames, whole = before, np.zeros(held.shape)
        for part in _TRIED:
            width, turning = self._width(part), _turns(frames, self.every)
            near, torn = (
                self._near(turning > each * self.most, width)[:, None] for each in (1.0, _TORN)
            )
            share = np.maximum(near * loose, torn)
            if not share.any():
                break
            frames = self._mean(frames, share, width, fixed=held & (torn <= 0.0))
            whole = np.maximum(whole, share)
        return frames, whole

    def rolled(self, before: Floats) -> tuple[Floats, Floats]:
        """The frames, which roll about their segments no faster than they may turn, and how far
        means count in that (moments,). The segments are where they were: what holds on does so, and
        may take its time as what is free.
        """
        frames, whole = before, np.zeros(len(before))
        for part in _TRIED:
            width = self._width(part)
            share = self._near(_rolls(frames, self.every) > self.most, width)
            if not share.any():
                break
            mean, some = self._mean(frames, share[:, None], width), np.flatnonzero(share)
            back = shortest_arc(along_segments(mean[some]), along_segments(before[some]))
            frames = frames.copy()
            frames[some] = multiply(back, mean[some])
            whole = np.maximum(whole, share)
        return frames, whole

    def softened(
        self, before: Floats, held: np.ndarray, sudden: np.ndarray
    ) -> tuple[Floats, Floats]:
        """The same where bones set out all at once (moments − every,): later by a moment those of
        an arm that has just let go, for nothing before that may move; else by means over a frame
        about it.
        """
        frames, late, left = self._later(before, held, sudden)
        width = max(1, round(_AT_ONCE * self.rate))
        loose = 1.0 - covered(held.astype(np.float64), width, cyclic=self.cyclic)
        share = self._near(left, width)[:, None] * loose
        if share.any():
            frames = self._mean(frames, share, width, fixed=held)
        return frames, np.maximum(share, late)

    def _later(
        self, before: Floats, held: np.ndarray, sudden: np.ndarray
    ) -> tuple[Floats, Floats, np.ndarray]:
        """Frames in which what lets go is late at first and in time again before it is to hold on
        anew, where that was (moments, bones or 1), and what is left that sets out all at once.
        """
        frames, late, left = before.copy(), np.zeros(held.shape), sudden.copy()
        holds, last = held.any(axis=1), len(before) - 1 - int(self.cyclic)
        for number in np.flatnonzero(sudden).tolist():
            if not holds[max(number - 2 * self.every, 0) : number + self.every].any():
                continue
            again = np.flatnonzero(holds[number + self.every :])
            seconds = min(_IN_TIME, (again[0] if len(again) else len(before)) / self.rate)
            if seconds < _STAYS_LATE + 4.0 * _LATE:
                continue
            left[number] = False
            after = np.arange(number + 1, min(number + round(seconds * self.rate), last) + 1)
            since = (after - number) / self.rate
            fading = smooth_step((since - _STAYS_LATE) / (seconds - _STAYS_LATE))
            place = after - self.rate * np.minimum(0.5 * since, _LATE) * (1.0 - fading)
            low = np.minimum(place.astype(np.intp), len(before) - 2)
            share = (place - low)[:, None, None]
            there = normalized(frames[low] + share * (frames[low + 1] - frames[low]))
            free = ~held[after]
            frames[after] = np.where(free[..., None], there, frames[after])
            late[after] = np.maximum(late[after], free)
        return frames, late, left

    def _width(self, part: float) -> int:
        return max(1, round(part * _WIDEST * self.rate))

    def _near(self, fast: np.ndarray, width: int) -> Floats:
        """How near (moments,), 0…1, a frame is that is too fast (moments − every,)."""
        within = np.zeros(len(fast) + self.every, dtype=bool)
        for step in range(self.every + 1):
            within[step : step + len(fast)] |= fast
        return covered(within.astype(np.float64), width, cyclic=self.cyclic)

    def _mean(
        self, frames: Floats, share: Floats, width: int, *, fixed: np.ndarray | None = None
    ) -> Floats:
        if fixed is None:
            mean = blurred(frames, width, cyclic=self.cyclic)
        else:
            mean = np.empty_like(frames)
            kinds, which = np.unique(fixed, axis=1, return_inverse=True)
            which = np.broadcast_to(which.ravel(), frames.shape[1])
            for kind, each in enumerate(kinds.T):
                own = which == kind
                mean[:, own] = blurred(frames[:, own], width, cyclic=self.cyclic, fixed=each)
        return normalized(frames + share[..., None] * (mean - frames))


def keeping_where_it_helps(
    arms: Sequence[ArmFrames],
    before: Floats,
    eased: Floats,
    orientations: Floats,
    *,
    limits: Floats,
    every: int = 1,
    cyclic: bool = False,
) -> Generator[None, None, Floats]:
    """Rotations (moments, bones, 4), eased from what they were before; as before wherever an arm
    did not turn by more than it may, and where it still does by nearly as much more. In steps.

    Arguments are as of :func:`easing_turns`.

    Each stretch of an arm counts by itself: what cannot be helped at one place of a long way
    spoils nothing at another, and what is too fast in a hold changes nothing before and after it.
    """
    return (
        yield from _kept(
            *(arms, before, eased, orientations),
            limits=limits,
            every=every,
            cyclic=cyclic,
            spoilt=lambda was, left: left > _HELPED * was or was <= 0.0,
        )
    )


def keeping_where_calm(
    arms: Sequence[ArmFrames],
    before: Floats,
    changed: Floats,
    orientations: Floats,
    *,
    limits: Floats,
    every: int = 1,
    cyclic: bool = False,
) -> Generator[None, None, Floats]:
    """Rotations (moments, bones, 4), changed from what they were before; as before wherever an arm
    turns by more for it than it may. In steps; arguments are as of :func:`easing_turns`, and each
    stretch counts by itself, as there.
    """
    return (
        yield from _kept(
            *(arms, before, changed, orientations),
            limits=limits,
            every=every,
            cyclic=cyclic,
            spoilt=lambda was, left: left > max(was, 0.0) + _UNSEEN,
        )
    )


def _kept(
    arms: Sequence[ArmFrames],
    before: Floats,
    changed: Floats,
    orientations: Floats,
    *,
    limits: Floats,
    every: int,
    cyclic: bool,
    spoilt: Callable[[float, float], bool],
    worse: Floats | None = None,
    turning: tuple[Floats, Floats] | None = None,
) -> Generator[None, None, Floats]:
    """Rotations (moments, bones, 4), and as before wherever a stretch of an arm is spoilt: told by
    what it turned by beyond the limits at most, and what it turns by beyond them now; or all in all
    ``worse`` (moments, arms). Before and after they turn by so much (moments − every, bones), if
    that is known.
    """
    if turning is None:
        then = turns_in_world(arms, before, orientations, every)
        yield
        turning = then, turns_in_world(arms, changed, orientations, every)
        yield
    result, start = changed.copy(), 0
    limits = np.broadcast_to(limits, (len(turning[0]), len(arms)))
    for number, arm in enumerate(arms):
        own = slice(start, start + len(arm.bones))
        start, most = own.stop, limits[:, number, None]
        stretches = [[each] for each in spans((before[:, own] != changed[:, own]).any(axis=(1, 2)))]
        if cyclic and len(stretches) > 1 and _goes_round(stretches, len(before)):
            stretches = [stretches[-1] + stretches[0], *stretches[1:-1]]
        for stretch in stretches:
            was, left = (
                max(
                    (each[:, own] - most)[max(first - every, 0) : end].max(initial=-np.inf)
                    for first, end in stretch
                )
                for each in turning
            )
            hopeless = worse is not None and (
                sum(worse[first : end + 2 * every, number].sum() for first, end in stretch) > _SAME
            )
            if hopeless or spoilt(was, left):
                for first, end in stretch:
                    result[first:end, own] = before[first:end, own]
    return result


def _goes_round(stretches: list[list[tuple[int, int]]], count: int) -> bool:
    """Whether the last stretch of a loop of so many moments goes on as the first one."""
    return stretches[0][0][0] == 0 and stretches[-1][0][1] == count


def _turns(frames: Floats, every: int) -> Floats:
    """Radians (moments − every,) that the quickest of the bones turns within a frame."""
    same = np.abs(np.sum(frames[every:] * frames[:-every], axis=-1))
    return 2.0 * np.arccos(np.minimum(same, 1.0)).max(axis=1, initial=0.0)


def _starts(turning: Floats, rate: float, every: int) -> np.ndarray:
    """Where (moments − every, bones) bones that turn so (moments − every, bones), radians within a
    frame, set out all at once, at so many frames a second.
    """
    result = np.zeros(turning.shape, dtype=bool)
    after = turning[every:]
    result[every:] = (after > _ABRUPT * turning[:-every]) & (after > _JERK / rate)
    return result


def _rolls(frames: Floats, every: int) -> Floats:
    """Radians (moments − every,) that the quickest of the bones rolls about its segment within a
    frame.
    """
    before, after = frames[:-every], frames[every:]
    swing = shortest_arc(along_segments(before), along_segments(after))
    same = np.abs(np.sum(multiply(swing, before) * after, axis=-1))
    return 2.0 * np.arccos(np.minimum(same, 1.0)).max(axis=1, initial=0.0)
