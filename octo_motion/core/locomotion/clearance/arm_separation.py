# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that keep apart and are led past each other, and how much room a creature takes."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...phrases import phrase
from ...rotations import (
    Floats,
    components_first,
    conjugate,
    normalized,
    rotate,
    shortest_arc,
)
from ..ground import Ground
from ..rig import ArmBatch, ArmFrames, batches_by_bones
from .capsule_overlap import Capsules, Crowd, Opened, Separation, measure_overlap
from .overlap_solver import parting
from .way_past import Passing, led_past

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
    rate: float,
    opened: Opened | None = None,
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
        rate: frames per second.
        opened: where arms stand round a body that swims as it lies, none for others.
        cyclic: whether the last frame is the first again.
    """
    crowd = _Crowded.of(
        volume, rotations, strains, in_contact=in_contact, busy=busy, travel=travel, opened=opened
    )
    yield 0.0
    moved = yield from parting(
        crowd.crowd,
        volume.still,
        floor=_floor(travel, ground, scale),
        width=width_of(frames_per_cycle),
        rate=rate,
        cyclic=cyclic,
    )
    return crowd.turned(rotations, moved)


def lead_past(
    volume: BodyVolume,
    rotations: Floats,
    strains: Floats,
    *,
    share: Floats,
    held: Sequence[np.ndarray],
    travel: tuple[Floats, Floats],
    ground: Ground | None,
    scale: float,
    frames_per_cycle: float,
) -> Floats | None:
    """Rotations (frames, bones, 4) of arms that reach past the others; none if they do anyway.

    Args:
        volume: the arms and the body.
        rotations: (frames, bones, 4) of all arms, one after the other.
        strains: (frames, bones) by how much bones are longer than at rest, as a share.
        share: (frames, arms) how far arms may be led another way, 0…1.
        held: for each arm (frames, joints) how far joints are to stay where they are, 0…1.
        travel: locations (frames, 3) and orientations (frames, 4) of the armature, world.
        ground: what is below them, if anything.
        scale: metres of the armature's unit.
        frames_per_cycle: of the gait: the shorter, the quicker arms make way.
    """
    lying = [each > 0.0 for each in held]
    nobody = np.zeros(share.shape, dtype=bool)
    crowd = _Crowded.of(volume, rotations, strains, in_contact=lying, busy=nobody, travel=travel)
    holds = np.stack([each.max(axis=1) for each in held], axis=1)
    passing = Passing(share, holds, crowd.crowd.in_contact.argmax(axis=2))
    moved = led_past(
        crowd.crowd,
        volume.still,
        passing,
        _floor(travel, ground, scale),
        width=width_of(frames_per_cycle),
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
    def of(
        cls,
        volume: BodyVolume,
        rotations: Floats,
        strains: Floats,
        *,
        in_contact: Sequence[np.ndarray],
        busy: np.ndarray,
        travel: tuple[Floats, Floats],
        opened: Opened | None = None,
    ) -> _Crowded:
        """What arms with these rotations and strains, as in :func:`separating_arms`, are."""
        some, chosen = _joints_chosen(volume.arms)
        posed = _Posed.of_all(volume.arms, rotations)
        joints = np.empty((len(rotations), len(volume.arms), len(chosen[0]), 3))
        for each in posed:
            joints[:, each.numbers] = each.joints(strains)[:, :, chosen[each.numbers[0]]]
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
    still: tuple[Capsules, ...]
    """Parts of the body, one frame each."""
    upward: Floats
    """(3,) unit: the body's, armature space."""

    def _distances(self, frames: int) -> int:
        """How many there are to be looked at over so many frames."""
        capsules = sum(min(len(arm.bones), MOST_CAPSULES) for arm in self.arms) + len(self.still)
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
        """What overlaps, and at every how many frames it was looked for.

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
        still = [
            Capsules(each.name, np.tile(each.joints, (len(looked), 1, 1)), each.radii, each.at_rest)
            for each in self.still
        ]
        return measure_overlap(chains, still), every

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
