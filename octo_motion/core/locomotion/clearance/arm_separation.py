# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms of a rig kept apart: from the rotations of its bones to a crowd, and back.

Of an arm with many bones some joints stand for all: what lies between two of them moves as one.
Bones follow their segments by the smallest turn, so nothing is twisted by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats, components_first, conjugate, normalized, rotate, shortest_arc
from ..ground import Ground
from ..rig import ArmBatch, ArmFrames, batches_by_bones
from .capsule_overlap import Capsules
from .overlap_contacts import Crowd, Opened
from .overlap_solver import parted

MOST_CAPSULES: Final = 16
"""Of an arm; those of more bones are taken together."""
_WIDTH: Final = 28.0
"""Means over time (``over_time.blurred``) to a cycle of the gait."""
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


@dataclass(frozen=True, eq=False)
class Bulk:
    """What there is of a creature that must not pass through itself."""

    arms: Sequence[ArmFrames]
    radii: Sequence[Floats]
    """Of each arm (bones + 1,) at its joints, armature units."""
    still: Sequence[Capsules]
    """Parts of the body, one frame each."""
    upward: Floats
    """(3,) unit: the body's, armature space."""
    opened: Opened | None = None
    """Where arms stand round a body that swims as it lies, none for others."""


def joints_that_count(bones: int) -> np.ndarray:
    """Numbers of the joints of an arm of so many bones that stand for all."""
    return np.unique(np.linspace(0, bones, min(bones, MOST_CAPSULES) + 1).astype(int))


def width_of(frames_per_cycle: float) -> int:
    """Width of the means over time for a gait of so many frames to the cycle."""
    return int(np.clip(np.rint(frames_per_cycle / _WIDTH), 1, _MOST_WIDTH))


def separate_arms(
    bulk: Bulk,
    rotations: Floats,
    strains: Floats,
    *,
    in_contact: Sequence[np.ndarray],
    busy: np.ndarray,
    travel: tuple[Floats, Floats],
    ground: Ground | None,
    scale: float,
    frames_per_cycle: float,
    cyclic: bool = False,
) -> Floats | None:
    """Rotations (frames, bones, 4) of arms that have made way; none if nobody has to.

    Args:
        bulk: the arms and the body.
        rotations: (frames, bones, 4) of all arms, one after the other.
        strains: (frames, bones) by how much bones are longer than at rest, as a share.
        in_contact: for each arm (frames, joints) which joints rest on the ground.
        busy: (frames, arms) which arms must not be moved.
        travel: locations (frames, 3) and orientations (frames, 4) of the armature, world.
        ground: what they walk on, if anything.
        scale: metres of the armature's unit.
        frames_per_cycle: of the gait: the shorter, the quicker arms make way.
        cyclic: whether the last frame is the first again.
    """
    ends = np.cumsum([0, *(len(arm.bones) for arm in bulk.arms)])
    some, chosen = _joints_chosen(bulk.arms)
    posed = [
        _Posed.of(numbers, together, ends, rotations)
        for numbers, together in batches_by_bones(bulk.arms)
    ]
    joints = np.empty((len(rotations), len(bulk.arms), len(chosen[0]), 3))
    for each in posed:
        joints[:, each.numbers] = each.joints(strains)[:, :, chosen[each.numbers[0]]]
    locations, orientations = travel
    crowd = Crowd(
        joints=joints,
        radii=np.stack([own[which] for own, which in zip(bulk.radii, chosen, strict=True)]),
        at_rest=np.stack(
            [arm.joints(arm.at_rest)[which] for arm, which in zip(bulk.arms, chosen, strict=True)]
        ),
        in_contact=np.stack(
            [_in_contact(own, which) for own, which in zip(in_contact, chosen, strict=True)], axis=1
        ),
        kept=busy,
        upward=bulk.upward,
        opened=bulk.opened,
        up=rotate(conjugate(orientations), _UP),
    )
    floor = Surface(ground, locations, orientations, scale) if ground is not None else None
    moved = parted(crowd, bulk.still, floor=floor, width=width_of(frames_per_cycle), cyclic=cyclic)
    if moved is None:
        return None
    result = rotations.copy()
    for each in posed:
        each.turn(result, crowd.joints, moved, some[each.numbers[0]])
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
    def of(
        cls, numbers: list[int], together: ArmBatch, ends: np.ndarray, rotations: Floats
    ) -> _Posed:
        """Some arms, as the rotations (frames, bones, 4) of all have them.

        Args:
            numbers: which arms.
            together: these arms.
            ends: (all arms + 1,) where each arm's bones begin.
            rotations: (frames, bones, 4) of all.
        """
        columns = ends[numbers][:, None] + np.arange(len(together.lengths))
        own = np.moveaxis(rotations[:, columns], (2, 3), (0, 1))
        arm = np.tile(np.arange(len(numbers)), len(rotations))
        turned = together.orientations(own.reshape(*own.shape[:2], -1), arm)
        return cls(numbers, together, columns, turned)

    def joints(self, strains: Floats) -> Floats:
        """(frames, arms, bones + 1, 3) for strains (frames, all bones)."""
        count, bones = self.columns.shape
        own = np.moveaxis(strains[:, self.columns], 2, 0).reshape(bones, -1)
        arm = np.tile(np.arange(count), len(strains))
        found = self.together.joints(self.orientations, arm, own)
        return np.moveaxis(found.reshape(bones + 1, 3, -1, count), (0, 1), (2, 3))

    def turn(self, rotations: Floats, before: Floats, after: Floats, which: np.ndarray) -> None:
        """Turn bones along with their segments, by the smallest turn.

        Args:
            rotations: (frames, all bones, 4), changed in place.
            before: (frames, all arms, joints, 3)
            after: the same, as they are to be.
            which: numbers of the joints that stand for all of these arms.
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
