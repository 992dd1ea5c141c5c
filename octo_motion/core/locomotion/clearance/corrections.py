# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that make way: for each other and the body, and for the ground between two frames, in water,
and where they go over to either.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np

from ...phrases import phrase
from ...rotations import (
    Floats,
    components_first,
    conjugate,
    multiply,
    normalized,
    rotate,
    shortest_arc,
)
from ...smoothing import covered, smooth_step, spans
from ...steps import finished
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
from .capsule_overlap import Capsules, Crowd, Opened, Separation, measuring_overlap
from .overlap_solver import parting
from .way_past import Haste, Passing, led_past

# --- Arms that keep apart, and are led past each other --------------------------------------------

MOST_CAPSULES: Final = 16
"""Of an arm; those of more bones are taken together. With eight of the default octopus' twelve
bones Curl turns by 0.17 radians from frame to frame instead of 0.15."""
_WIDTH: Final = 28.0
"""Means over time (``smoothing.blurred``) to a cycle of the gait. With twice as many Curl turns by
0.20 radians from frame to frame instead of 0.15."""
_MOST_WIDTH: Final = 24

_UP: Final = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Surface:
    """A ground in the space of an armature that moves over it."""

    ground: Ground
    locations: Floats
    """(frames, 3) of the armature, world."""
    orientations: Floats
    """(frames, 4)"""
    scale: float
    """Metres of the armature's unit."""

    def clearance(self, frames: np.ndarray, points: Floats) -> Floats:
        """Height (items, joints) of points (items, joints, 3) above it, armature units."""
        turned = rotate(self.orientations[frames][:, None], self.scale * points)
        world = self.locations[frames][:, None] + turned
        return (world[..., 2] - self.ground.height(world[..., :2])) / self.scale


def joints_that_count(bones: int) -> np.ndarray:
    """Numbers of the joints of an arm of so many bones that stand for all."""
    return np.unique(np.linspace(0, bones, min(bones, MOST_CAPSULES) + 1).astype(int))


def width_of(frames_per_cycle: float) -> int:
    """Width of the means over time for a gait of so many frames to the cycle."""
    return int(np.clip(np.rint(frames_per_cycle / _WIDTH), 1, _MOST_WIDTH))


def separating_arms(
    volume: BodyVolume,
    rotations: Floats,
    strains: Floats,
    *,
    in_contact: Sequence[np.ndarray],
    busy: np.ndarray,
    travel: tuple[Floats, Floats],
    ground: Ground | None,
    scale: float,
    frames_per_cycle: float,
    most: float,
    opened: Opened | None = None,
    nearest: bool = False,
    cyclic: bool = False,
) -> Generator[float, None, Floats | None]:
    """Rotations (frames, bones, 4) of arms that have made way; none if nobody has to. In steps
    that yield the share that is done.

    Args:
        volume: the arms and the body.
        rotations: (frames, bones, 4) of all arms, one after the other.
        strains: (frames, bones) by how much bones are longer than at rest, as a share.
        in_contact: for each arm (frames, joints) which joints rest on the ground.
        busy: (frames, arms) which arms must not be moved.
        travel: locations (frames, 3) and orientations (frames, 4) of the armature, world.
        ground: what they walk on, if anything.
        scale: metres of the armature's unit.
        frames_per_cycle: of the gait: the shorter, the quicker arms make way.
        most: radians that an arm which makes way may turn in a frame.
        opened: where arms stand round a body that swims as it lies, none for others.
        nearest: whether they go the nearest way, and not each to the side on which it belongs.
        cyclic: whether the last frame is the first again.
    """
    making = _Crowded.making(
        volume, rotations, strains, in_contact=in_contact, busy=busy, travel=travel, opened=opened
    )
    crowd = yield from making
    yield 0.0
    moved = yield from parting(
        crowd.crowd,
        volume.body,
        floor=_floor(travel, ground, scale),
        width=width_of(frames_per_cycle),
        most=most,
        nearest=nearest,
        cyclic=cyclic,
    )
    return crowd.turned(rotations, moved)


def lead_past(
    volume: BodyVolume,
    rotations: Floats,
    strains: Floats,
    *,
    share: Floats,
    above: Floats,
    held: Sequence[np.ndarray],
    travel: tuple[Floats, Floats],
    ground: Ground | None,
    scale: float,
    frames_per_cycle: float,
    haste: Haste,
) -> Floats | None:
    """Rotations (frames, bones, 4) of arms that reach past the others; none if they do anyway.

    Args:
        volume: the arms and the body.
        rotations: (frames, bones, 4) of all arms, one after the other.
        strains: (frames, bones) by how much bones are longer than at rest, as a share.
        share: (frames, arms) how far arms may be led past the others and the body, 0…1.
        above: (frames, arms) how far they may be led over the ground, 0…1.
        held: for each arm (frames, joints) how far joints are to stay where they are, 0…1.
        travel: locations (frames, 3) and orientations (frames, 4) of the armature, world.
        ground: what is below them, if anything.
        scale: metres of the armature's unit.
        frames_per_cycle: of the gait: the shorter, the quicker arms make way.
        haste: how fast they may be led.
    """
    lying = [each > 0.0 for each in held]
    nobody = np.zeros(share.shape, dtype=bool)
    crowd = finished(
        _Crowded.making(volume, rotations, strains, in_contact=lying, busy=nobody, travel=travel)
    )
    holds = np.stack([each.max(axis=1) for each in held], axis=1)
    passing = Passing(share, above, holds, crowd.crowd.in_contact.argmax(axis=2))
    moved = led_past(
        crowd.crowd,
        volume.body,
        passing,
        _floor(travel, ground, scale),
        width=width_of(frames_per_cycle),
        haste=haste,
    )
    return crowd.turned(rotations, moved)


def _floor(travel: tuple[Floats, Floats], ground: Ground | None, scale: float) -> Surface | None:
    return Surface(ground, *travel, scale) if ground is not None else None


@dataclass(frozen=True, eq=False)
class _Crowded:
    """All arms of a motion, by the joints that stand for all."""

    crowd: Crowd
    posed: list[_Posed]
    some: list[np.ndarray]

    @classmethod
    def making(
        cls,
        volume: BodyVolume,
        rotations: Floats,
        strains: Floats,
        *,
        in_contact: Sequence[np.ndarray],
        busy: np.ndarray,
        travel: tuple[Floats, Floats],
        opened: Opened | None = None,
    ) -> Generator[float, None, _Crowded]:
        """What arms with these rotations and strains, as in :func:`separating_arms`, are; in
        steps.
        """
        some, chosen = _joints_chosen(volume.arms)
        posed = _Posed.of_all(volume.arms, rotations)
        yield 0.0
        joints = np.empty((len(rotations), len(volume.arms), len(chosen[0]), 3))
        for each in posed:
            joints[:, each.numbers] = each.joints(strains)[:, :, chosen[each.numbers[0]]]
            yield 0.0
        crowd = Crowd(
            joints=joints,
            radii=np.stack([own[which] for own, which in zip(volume.radii, chosen, strict=True)]),
            at_rest=np.stack(
                [arm.joints(arm.at_rest)[at] for arm, at in zip(volume.arms, chosen, strict=True)]
            ),
            in_contact=np.stack(
                [_in_contact(own, at) for own, at in zip(in_contact, chosen, strict=True)], axis=1
            ),
            kept=busy,
            upward=volume.upward,
            opened=opened,
            up=rotate(conjugate(travel[1]), _UP),
        )
        return cls(crowd, posed, some)

    def turned(self, rotations: Floats, moved: Floats | None) -> Floats | None:
        """Rotations (frames, bones, 4) with joints (frames, arms, joints, 3) that were moved."""
        if moved is None:
            return None
        result = rotations.copy()
        for each in self.posed:
            each.turn(result, self.crowd.joints, moved, self.some[each.numbers[0]])
        return result


def _joints_chosen(arms: Sequence[ArmFrames]) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """For each arm the joints that stand for all, and as many of them for every arm.

    Arms with fewer joints than others end in the same one several times.
    """
    some = [joints_that_count(len(arm.bones)) for arm in arms]
    most = max(len(each) for each in some)
    return some, [np.append(each, np.repeat(each[-1:], most - len(each))) for each in some]


@dataclass(frozen=True, eq=False)
class _Posed:
    """Arms of as many bones each, at all frames."""

    numbers: list[int]
    """Which of all arms they are."""
    together: ArmBatch
    columns: np.ndarray
    """(arms, bones) which of all bones are theirs."""
    orientations: Floats
    """(bones, 4, frames × arms)"""

    @classmethod
    def of_all(cls, arms: Sequence[ArmFrames], rotations: Floats) -> list[_Posed]:
        """All arms, as rotations (frames, bones, 4) have them, by how many bones they have."""
        ends = np.cumsum([0, *(len(arm.bones) for arm in arms)])
        found: list[_Posed] = []
        for numbers, together in batches_by_bones(arms):
            columns = ends[numbers][:, None] + np.arange(len(together.lengths))
            own = np.moveaxis(rotations[:, columns], (2, 3), (0, 1))
            arm = np.tile(np.arange(len(numbers)), len(rotations))
            turned = together.orientations(own.reshape(*own.shape[:2], -1), arm)
            found.append(cls(numbers, together, columns, turned))
        return found

    def joints(self, strains: Floats) -> Floats:
        """(frames, arms, bones + 1, 3) for strains (frames, all bones)."""
        count, bones = self.columns.shape
        own = np.moveaxis(strains[:, self.columns], 2, 0).reshape(bones, -1)
        arm = np.tile(np.arange(count), len(strains))
        found = self.together.joints(self.orientations, arm, own)
        return np.moveaxis(found.reshape(bones + 1, 3, -1, count), (0, 1), (2, 3))

    def turn(self, rotations: Floats, before: Floats, after: Floats, which: np.ndarray) -> None:
        """Turn bones (frames, all bones, 4) along with their segments, by the smallest turn, in
        place.

        Joints (frames, all arms, joints, 3) are as before and as they are to be; ``which`` are the
        numbers of those that stand for all of these arms.
        """
        count = len(self.columns)
        start, end = (each[:, self.numbers, : len(which)] for each in (before, after))
        frame, arm = np.nonzero((start != end).reshape(len(start), count, -1).any(axis=2))
        if not len(frame):
            # Others have made way.
            return
        first, second = (normalized(np.diff(each[frame, arm], axis=1)) for each in (start, end))
        turned = np.flatnonzero((first != second).reshape(len(first), -1).any(axis=1))
        frame, arm = frame[turned], arm[turned]
        turns = shortest_arc(first[turned], second[turned])
        per_bone = np.repeat(np.moveaxis(turns, 0, 2), np.diff(which), axis=0)
        own = self.orientations[..., frame * count + arm]
        moved = np.stack(
            [
                components_first.multiply(turn, each)
                for turn, each in zip(per_bone, own, strict=True)
            ]
        )
        fresh = self.together.rotations(moved, arm)
        rotations[frame[:, None], self.columns[arm]] = np.moveaxis(fresh, 2, 0)


def _in_contact(joints: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Which of some joints (frames, some) stand for one that lies: what lies moves nowhere."""
    passed = np.concatenate([np.zeros((len(joints), 1), dtype=int), joints.cumsum(axis=1)], axis=1)
    before, after = np.append(which[:1], which[:-1]), np.append(which[1:], which[-1:])
    # From after the joint before to before the joint after, its own place included.
    first = np.where(before < which, before + 1, which)
    last = np.where(after > which, after, which + 1)
    return passed[:, last] > passed[:, first]


# --- How much room a creature takes, and whether its arms keep apart ------------------------------


DEEP: Final = 0.1
"""Share of a radius by which arms may overlap without a word: flesh gives."""

_MOST_PARTED: Final = 200_000_000
"""Distances with more of which arms are not kept apart: half a minute where all are tangled."""

_MOST_DISTANCES: Final = 60_000_000
"""With more, of very many arms over very many frames, only every second, third … is measured."""


@dataclass(frozen=True, eq=False)
class BodyVolume:
    """How much room a creature's arms and body take."""

    arms: tuple[ArmFrames, ...]
    names: tuple[str, ...]
    radii: tuple[Floats, ...]
    """Of each arm (bones + 1,) at its joints, armature units."""
    body: tuple[Capsules, ...]
    """Parts of the body, by their bones: one frame each, or as many as are asked of the arms."""
    upward: Floats
    """(3,) unit: the body's, armature space."""

    def carried(
        self, carriages: Mapping[str, tuple[Floats, Floats]], wider: Mapping[str, float]
    ) -> BodyVolume:
        """The same whose body moves as its bones do, by their names: turns (frames, 4) from rest
        about the origin, and shifts (frames, 3) after these; and some are so much wider.
        """
        body = [
            replace(
                each,
                joints=rotate(turns[:, None], each.at_rest) + shifts[:, None],
                radii=wider.get(each.name, 1.0) * each.radii,
            )
            for each in self.body
            for turns, shifts in [carriages[each.name]]
        ]
        return replace(self, body=tuple(body))

    def _distances(self, frames: int) -> int:
        """How many there are to be looked at over so many frames."""
        capsules = sum(min(len(arm.bones), MOST_CAPSULES) for arm in self.arms) + len(self.body)
        return frames * capsules * capsules

    def too_many(self, frames: int) -> str:
        """Why arms cannot be kept apart over so many frames, "" if they can."""
        if self._distances(frames) <= _MOST_PARTED:
            return ""
        return phrase(
            "Arms are not kept apart: {count} arms over {frames:,} frames would take too "
            "long. Make shorter motions, or switch arms off.",
            count=len(self.arms),
            frames=frames,
        )

    def measure(self, rotations: Floats, strains: Floats) -> tuple[Separation, int]:
        """What overlaps, as :meth:`measuring` finds."""
        return finished(self.measuring(rotations, strains))

    def measuring(
        self, rotations: Floats, strains: Floats
    ) -> Generator[None, None, tuple[Separation, int]]:
        """What overlaps, and at every how many frames it was looked for; in steps.

        Rotations (frames, bones, 4) and strains (frames, bones) are of all arms, one after the
        other.
        """
        every = max(1, -(-self._distances(len(rotations)) // _MOST_DISTANCES))
        looked = rotations[::every]
        ends = np.cumsum([0, *(len(arm.bones) for arm in self.arms)])
        chains: list[Capsules] = []
        for number, arm in enumerate(self.arms):
            columns = slice(int(ends[number]), int(ends[number + 1]))
            own, longer = looked[:, columns], strains[::every, columns]
            some = joints_that_count(len(arm.bones))
            joints, rest = arm.joints(arm.from_bones(own), longer), arm.joints(arm.at_rest)
            radii = self.radii[number][some]
            chains.append(Capsules(self.names[number], joints[:, some], radii, rest[some]))
            yield
        body = [
            replace(each, joints=np.broadcast_to(joints, (len(looked), *joints.shape[1:])))
            for each in self.body
            for joints in [each.joints[:: every if len(each.joints) > 1 else 1]]
        ]
        return (yield from measuring_overlap(chains, body)), every

    @staticmethod
    def told(found: Separation, every: int, frames: Floats) -> tuple[str, ...]:
        """A sentence on the deepest overlap that :meth:`measure` found, none if arms keep apart.

        Frames (frames,) are their numbers in the scene.
        """
        worst = found.worst
        if worst is None or worst.depth <= DEEP:
            return ()
        share = 100.0 * float(np.mean(found.depths > DEEP))
        part = f"{share:.0f} %" if share >= 1.0 else phrase("less than 1 %")
        told = phrase(
            "'{first}' passes through '{second}' at frame {frame:.0f}, by {depth:.1f} of "
            "the radius; something overlaps at {part} of the frames.",
            first=worst.first,
            second=worst.second,
            frame=frames[worst.frame * every],
            depth=worst.depth,
            part=part,
        )
        return (told,)


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
_ARMS_AT_ONCE: Final = 3
"""Arms that are looked at in one step. One by one, the way of the body, which all share, takes as
long as they do."""
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

    def room(self, poses: Poses, radii: Sequence[Floats]) -> Floats:
        """Arm lengths (moments, arms) that the lowest skin of each arm is above the ground, at each
        moment and half way to those before and after it.

        Radii are metres from each joint (joints,) of an arm to the skin below it.
        """

        def lowest(at: Poses) -> Floats:
            heights = [
                (own[:, 1:, 2] - self.ground.height(own[:, 1:]) - skin[1:]).min(axis=1)
                for own, skin in zip(self.joints(at), radii, strict=True)
            ]
            return np.stack(heights, axis=1) / [arm.length * self.scale for arm in self.arms]

        found, half = lowest(poses), lowest(halfway_automatic(poses, cyclic=self.cyclic))
        found[:-1] = np.minimum(found[:-1], half)
        found[1:] = np.minimum(found[1:], half)
        return found

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


def raising_between_frames(
    course: ArmsOverGround,
    poses: Poses,
    joints: Sequence[Floats],
    again: Callable[[np.ndarray, Floats], Generator[None, None, tuple[Poses, Sequence[Floats]]]],
) -> Generator[None, None, Poses]:
    """The same motion, without arms that dip into the ground between frames; in steps.

    Poses of all frames are left as they are; joints of each arm are (frames, joints, 3). ``again``
    makes poses of some frames (n,), in steps, with arms (n, arms) so many arm lengths higher, and
    the joints of each arm; of arms that are nowhere higher it need say nothing.
    """
    if len(poses.rotations) < 2:
        return poses
    clear = course.clear(joints)
    lift = np.zeros(clear.shape)
    yield
    every = list(range(len(course.arms)))
    tried = [(poses, (yield from _dipping(course, poses, clear, every)))]
    for _ in range(_ROUNDS):
        yield
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
        fresh, places = yield from again(chosen, lift[chosen])
        yield
        arms = np.flatnonzero(np.any(lift[chosen] > 0.0, axis=0)).tolist()
        rotations, strains, deep = last.rotations.copy(), last.strains.copy(), deep.copy()
        for bones in (course.bones[arm] for arm in arms):
            rotations[chosen, bones] = fresh.rotations[:, bones]
            strains[chosen, bones] = fresh.strains[:, bones]
        clear[np.ix_(chosen, arms)] = course.clear(places, arms)
        higher = Poses(rotations, strains, poses.locations, poses.orientations)
        deep[:, arms] = yield from _dipping(course, higher, clear, arms)
        tried.append((higher, deep))
    return _best(course, tried, lift > 0.0)


def _dipping(
    course: ArmsOverGround, poses: Poses, clear: Floats, arms: Sequence[int]
) -> Generator[None, None, Floats]:
    """How deep some arms dip, as :meth:`ArmsOverGround.dips` says of them, in steps."""
    found = []
    for first in range(0, len(arms), _ARMS_AT_ONCE):
        found.append(course.dips(poses, clear, arms[first : first + _ARMS_AT_ONCE]))
        yield
    return np.concatenate(found, axis=1)


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
_RAMP: Final = 0.2
"""Share of the way from one gait to another within which arms come to be raised, or are no more:
of its cube root, for who sets out at rest has hardly gone anywhere in a third of his time, and it
is where he will be that is below. Anything from 0.06 to 0.3 is as good; with the share itself, tips
are 0.7 to 1 % of an arm in bumps as arms set out for a swim."""
_ALONG: Final = np.array([1.0, 0.0, 0.0])


def afloat(
    swims: Sequence[bool], shares: Sequence[Floats], crouched: Floats | float = 0.0
) -> Floats:
    """How far arms (frames, arms) are to be kept off the ground, 0…1.

    Those that walk see to it themselves; all that swim (one segment of the route at least) or go
    over from one gait to another do not. Shares say for each change how far each arm (frames, arms)
    has gone over; however little, it is raised as far as the body has ``crouched`` (frames, 1).
    """
    result = np.full(shares[0].shape if shares else (1, 1), float(swims[0]))
    for swum, share in zip(swims[1:], shares, strict=True):
        leaving = np.maximum(result, _raised(share))
        coming = _raised(1.0 - share) if not swum else 1.0
        between = (share > 0.0) & ((share < 1.0) | swum)
        result = np.where(share > 0.0, np.maximum(leaving * coming, between * crouched), result)
    return result


def _raised(share: Floats) -> Floats:
    """How far arms are raised that have gone so far of the way from a gait that sees to it."""
    return smooth_step(np.cbrt(share / _RAMP))


def keeping_off_ground(
    course: ArmsOverGround,
    poses: Poses,
    radii: Sequence[Floats],
    loose: Floats,
    *,
    closer: float = 0.0,
) -> Generator[None, None, Floats]:
    """Rotations (frames, bones, 4) of the same arms off the ground, in steps.

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
        yield
    return result
