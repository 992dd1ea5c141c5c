# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms kept off the ground: between two frames, in water, and where they go over to either."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np

from ...rotations import Floats, components_first, conjugate, multiply, rotate, shortest_arc
from ...smoothing import covered, smooth_step, spans
from ..ground import Ground, raise_over_ground
from ..rig import (
    TOLERATED,
    ArmBatch,
    ArmFrames,
    JointRoom,
    Poses,
    batches_by_bones,
    halfway_automatic,
    loose_from_root,
    room_needed,
)

# --- Arms that would dip into the ground between two frames, raised at these ----------------------
#
# On every frame an arm is off the ground. From one to the next keys lead each bone on by itself,
# and where a fast arm turns far in one frame, the way between two poses is not the arm's own: it
# may lead through a bump. The frames round such a moment are posed again, with the arm higher by
# as much as it was too low.


_SPARE: Final = 0.003
"""Arm lengths above the ground that a joint is raised to which dips into it between frames. Of this
and the next ones half or twice as much changes no figure of a cycle of half a second by a
tenth, nor does any of them matter in the set-ups' own time, in which arms do not dip."""
_ROUNDS: Final = 4
_BETTER: Final = 0.9
"""Share of a dip that may be left after a round for another to be worth its while."""
_ASTRAY: Final = 0.125
"""By how much an arm is astray half way between frames at most, in arm lengths: for straight keys,
and with the whole arm as a lever, an eighth of what each of its bones' quaternions bends by, twice
as that is half an angle, and half as there are two such frames."""
_RAISED_FRAMES: Final = 1
"""Frames of the means by which arms rise and sink again: smoothly, within six frames."""
_JERK: Final = np.radians(5.0)
"""How much farther a bone of an arm that is raised may turn within a frame."""
_MOST: Final = 0.25
"""Arm lengths that an arm is raised at most: what needs more is no matter of frames."""


@dataclass(frozen=True, eq=False)
class ArmsOverGround:
    """The arms of a body over time, and what they are above of."""

    arms: Sequence[ArmFrames]
    ground: Ground
    scale: float
    """Metres of the armature's unit."""
    cyclic: bool = False
    """Whether the last frame is the first again, and the motion repeats."""

    @cached_property
    def bones(self) -> list[slice]:
        """Which bones of all arms' are those of each."""
        ends = np.cumsum([0, *(len(arm.bones) for arm in self.arms)]).tolist()
        return [slice(start, end) for start, end in pairwise(ends)]

    def joints(self, poses: Poses) -> list[Floats]:
        """Joints of each arm (moments, joints, 3), world."""
        found = []
        for arm, own in zip(self.arms, self.bones, strict=True):
            rotations = np.ascontiguousarray(poses.rotations[:, own])
            joints = self.scale * arm.joints(arm.from_bones(rotations), poses.strains[:, own])
            found.append(poses.locations[:, None] + rotate(poses.orientations[:, None], joints))
        return found

    @cached_property
    def _batches(self) -> list[tuple[list[int], ArmBatch]]:
        """The arms by how many bones they have."""
        return batches_by_bones(self.arms)

    def clear(self, joints: Sequence[Floats], arms: Sequence[int] | None = None) -> Floats:
        """Arm lengths (frames, arms) that the lowest of each arm's joints (frames, joints, 3),
        world, is above the ground, of some arms or all.
        """
        found = []
        for number in range(len(self.arms)) if arms is None else arms:
            own, length = joints[number][:, 1:], self.arms[number].length
            height = own[..., 2] - self.ground.height(own)
            found.append(height.min(axis=1) / (length * self.scale))
        return np.stack(found, axis=1)

    def dips(self, poses: Poses, clear: Floats, arms: Sequence[int] | None = None) -> Floats:
        """Arm lengths (frames − 1, arms) that each one's lowest joint is below the ground half way
        between frames; 0 where it cannot be.

        At the frames they are ``clear`` (frames, all arms) arm lengths above it. Some arms are
        looked at, or all.
        """
        frames, count = poses.rotations.shape[:2]
        found = np.zeros((frames - 1, len(self.arms)))
        for numbers, together in self._batches:
            wanted = [place for place, each in enumerate(numbers) if arms is None or each in arms]
            if not wanted:
                continue
            own, place = [numbers[each] for each in wanted], np.array(wanted)
            bones = np.concatenate([np.arange(count)[self.bones[each]] for each in own])
            rotations = poses.rotations[:, bones]
            astray = _bends(rotations).reshape(frames, len(own), -1).sum(axis=2)
            least = np.minimum(clear[:-1, own], clear[1:, own])
            # Half way between which frames, and which arm.
            moment, arm = np.nonzero(_ASTRAY * (astray[:-1] + astray[1:]) > least + TOLERATED)
            if not len(moment):
                continue
            half = halfway_automatic(
                Poses(rotations, poses.strains[:, bones], poses.locations, poses.orientations),
                cyclic=self.cyclic,
            )
            shape = frames - 1, len(own), len(together.lengths)
            turns = half.rotations.reshape(*shape, 4)[moment, arm]
            strains = half.strains.reshape(shape)[moment, arm]
            which = place[arm]
            there = together.orientations(np.moveaxis(turns, 0, 2), which)
            joints = self.scale * together.joints(there, which, strains.T)[1:]
            world = components_first.rotate(
                np.ascontiguousarray(half.orientations[moment].T), joints
            )
            world += half.locations[moment].T
            below = self.ground.height(np.moveaxis(world, 1, -1)) - world[:, 2]
            lengths = np.array([self.arms[each].length for each in own])[arm]
            found[moment, np.array(own)[arm]] = below.max(axis=0) / (lengths * self.scale)
        return found if arms is None else found[:, list(arms)]


def _bends(values: Floats) -> Floats:
    """Second differences of quaternions (frames, bones, 4), how long they are (frames, bones)."""
    last = [2 * values[:1] - values[1:2], values, 2 * values[-1:] - values[-2:-1]]
    around = np.concatenate(last)
    second = around[2:] - 2.0 * values + around[:-2]
    w, x, y, z = np.moveaxis(second, -1, 0)
    return np.sqrt(w * w + x * x + y * y + z * z)


def raise_between_frames(
    course: ArmsOverGround,
    poses: Poses,
    joints: Sequence[Floats],
    again: Callable[[np.ndarray, Floats], tuple[Poses, Sequence[Floats]]],
) -> Poses:
    """The same motion, without arms that dip into the ground between frames.

    Poses of all frames are left as they are; joints of each arm are (frames, joints, 3). ``again``
    makes poses of some frames (n,), with arms (n, arms) so many arm lengths higher, and the joints
    of each arm; of arms that are nowhere higher it need say nothing.
    """
    if len(poses.rotations) < 2:
        return poses
    clear = course.clear(joints)
    lift = np.zeros(clear.shape)
    tried = [(poses, course.dips(poses, clear))]
    for _ in range(_ROUNDS):
        last, deep = tried[-1]
        # What dips no less for having been raised is not raised any further.
        before = tried[-2][1] if len(tried) > 1 else np.zeros_like(deep)
        worth = (deep > TOLERATED) & ((before <= TOLERATED) | (deep < _BETTER * before))
        asked = _at_frames(np.where(worth, deep + _SPARE, 0.0), cyclic=course.cyclic)
        more = covered(asked, _RAISED_FRAMES, cyclic=course.cyclic)
        chosen = np.flatnonzero(np.any(more > 0.0, axis=1))
        if not len(chosen):
            break
        lift = np.minimum(lift + more, _MOST)
        fresh, places = again(chosen, lift[chosen])
        arms = np.flatnonzero(np.any(lift[chosen] > 0.0, axis=0)).tolist()
        rotations, strains, deep = last.rotations.copy(), last.strains.copy(), deep.copy()
        for bones in (course.bones[arm] for arm in arms):
            rotations[chosen, bones] = fresh.rotations[:, bones]
            strains[chosen, bones] = fresh.strains[:, bones]
        clear[np.ix_(chosen, arms)] = course.clear(places, arms)
        higher = Poses(rotations, strains, poses.locations, poses.orientations)
        deep[:, arms] = course.dips(higher, clear, arms)
        tried.append((higher, deep))
    return _best(course, tried, lift > 0.0)


def _best(
    course: ArmsOverGround, tried: Sequence[tuple[Poses, Floats]], raised: np.ndarray
) -> Poses:
    """Of several ways to raise arms, wherever one was raised, the one with the least dip.

    A higher arm may dip the more, where it has to come down from there in a frame. And one that
    folds may jerk when it is raised: better it dips than that. What was tried are poses, and what
    :meth:`ArmsOverGround.dips` says of them; they differ where arms (frames, arms) were raised.
    """
    if len(tried) == 1:
        return tried[0][0]
    rotations, strains = tried[0][0].rotations.copy(), tried[0][0].strains.copy()
    for number, bones in enumerate(course.bones):
        for first, end in spans(raised[:, number]):
            moments = slice(max(first - 1, 0), end)
            depths = [deep[moments, number].max(initial=0.0) for _, deep in tried]
            turns = [
                _largest_turn(poses.rotations[max(first - 1, 0) : end + 1, bones])
                for poses, _ in tried
            ]
            jerky = np.array(turns) > turns[0] + _JERK
            badness = np.where(jerky, np.inf, np.maximum(depths, TOLERATED))
            poses, _ = tried[int(np.argmin(badness))]
            rotations[first:end, bones] = poses.rotations[first:end, bones]
            strains[first:end, bones] = poses.strains[first:end, bones]
    whole = tried[0][0]
    return Poses(rotations, strains, whole.locations, whole.orientations)


def _largest_turn(rotations: Floats) -> float:
    """Radians that a bone turns at most from one of the frames (frames, bones, 4) to the next."""
    cosines = np.abs(np.einsum("fbi,fbi->fb", rotations[1:], rotations[:-1]))
    return float(2.0 * np.arccos(np.minimum(cosines.min(initial=1.0), 1.0)))


def _at_frames(halfway: Floats, *, cyclic: bool) -> Floats:
    """The greater (frames, …) of values half way (frames − 1, …) before and after each frame."""
    none = np.zeros((1, *halfway.shape[1:]))
    before, after = (halfway[-1:], halfway[:1]) if cyclic else (none, none)
    return np.maximum(np.concatenate([before, halfway]), np.concatenate([halfway, after]))


# --- Arms that neither lie nor walk kept off the ground: those of a swimmer, and on their way there
#
# A gait in the water knows no ground. Where a body takes off from it, or comes down to it, arms
# would hang into it. They are raised just as arms are that swing, by turning the bones before their
# lowest joints as little as it takes; each bone keeps its own twist.


_SWIM_ROUNDS: Final = 6
_SOFT: Final = 0.5
"""Share of the height that a joint needs within which it begins to be raised."""
_RAMP: Final = 0.15
"""Share of the way from one gait to another within which arms come to be raised, or are no more."""
_ALONG: Final = np.array([1.0, 0.0, 0.0])


def afloat(swims: Sequence[bool], shares: Sequence[Floats]) -> Floats:
    """How far arms (frames, arms) are to be kept off the ground, 0…1.

    Those that walk see to it themselves; all that swim (one segment of the route at least) or go
    over from one gait to another do not. Shares say for each change how far each arm (frames, arms)
    has gone over.
    """
    result = np.full(shares[0].shape if shares else (1, 1), float(swims[0]))
    for swum, share in zip(swims[1:], shares, strict=True):
        leaving = np.maximum(result, smooth_step(share / _RAMP))
        coming = smooth_step((1.0 - share) / _RAMP) if not swum else 1.0
        result = np.where(share > 0.0, leaving * coming, result)
    return result


def keep_off_ground(
    course: ArmsOverGround,
    poses: Poses,
    radii: Sequence[Floats],
    loose: Floats,
    *,
    closer: float = 0.0,
) -> Floats:
    """Rotations (frames, bones, 4) of the same arms off the ground.

    Radii are metres from each joint (joints,) of an arm to the skin below it, or for all frames
    (frames, joints); ``loose`` (frames, arms) is how far each is to be raised, 0…1. They may come
    ``closer`` than arms keep off elsewhere, by so many arm lengths.
    """
    result = poses.rotations.copy()
    for number, arm in enumerate(course.arms):
        chosen, bones = np.flatnonzero(loose[:, number] > 0.0), course.bones[number]
        if not len(chosen):
            continue
        frames = arm.from_bones(np.ascontiguousarray(poses.rotations[chosen, bones]))
        lengths = course.scale * arm.lengths * (1.0 + poses.strains[chosen, bones])
        facing = poses.orientations[chosen, None]
        directions = rotate(multiply(facing, frames), _ALONG)
        roots = poses.locations[chosen] + rotate(facing[:, 0], course.scale * arm.root)
        reach = np.concatenate([np.zeros((len(chosen), 1)), np.cumsum(lengths, axis=1)], axis=1)
        below = np.broadcast_to(radii[number], (len(loose), reach.shape[1]))[chosen]
        needed = room_needed(below, reach[:, -1:], -closer * reach[:, -1:])
        own = loose_from_root(reach, reach[:, -1:]) * loose[chosen, number, None]
        room = JointRoom(
            np.ascontiguousarray(needed.T),
            np.ascontiguousarray(own.T),
            _SOFT * needed.max(axis=1),
        )
        turned = raise_over_ground(
            np.ascontiguousarray(np.moveaxis(directions, 0, -1)),
            np.ascontiguousarray(lengths.T),
            room,
            free=np.ones_like(lengths.T),
            roots=np.ascontiguousarray(roots.T),
            ground=course.ground,
            iterations=_SWIM_ROUNDS,
        )
        back = conjugate(facing)
        before, after = (rotate(back, each) for each in (directions, np.moveaxis(turned, -1, 0)))
        moved = np.any(np.abs(after - before) > 1e-12, axis=(1, 2))
        higher = multiply(shortest_arc(before[moved], after[moved]), frames[moved])
        result[chosen[moved], bones] = arm.to_bones(higher)
    return result
