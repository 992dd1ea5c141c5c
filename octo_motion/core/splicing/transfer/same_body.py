# SPDX-License-Identifier: GPL-3.0-or-later
"""Two clips of one body whose files rest otherwise: reference poses that agree bone by bone.

Found from each clip alone, two reference poses of one body differ by what the two motions leave
open: how a limb is turned about itself where its elbow bends this way and that. Here more is known.
Where both rest in the same pose, only axes differ, and that tells all. Else joints that sit on the
same bone tell how it lies in both files; and what they do not, the moments at which the limb lies
alike in both clips: there its bones are turned alike. Bones that end a limb lie on what carries
them as each clip alone says.

Two rest poses that people stand in differ as limbs are lifted and bent, seldom as they are turned
about themselves: a T, an A, arms that hang. So the one is laid over the other by the smallest turns
from the body outwards, and believed where the motion does not speak against it: what is no pose
does so at once.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import (
    Floats,
    angle_between,
    conjugate,
    from_matrix,
    multiply,
    normalized,
    rotate,
    shortest_arc,
    to_matrix,
)
from ...skeleton import Skeleton
from ..clip import Clip, spread_clip, usual_offsets
from ..humanoid import Landmarks, matched_bones

_LOOKS: Final = 120
"""Moments of each clip that are compared with all of the other's."""

_ALIKE: Final = np.radians(10.0)
"""How far segments may lie off each other, and the moments still count as much as the best ones."""

_UNLIKE: Final = np.radians(45.0)
"""Off by so much, even the best moments say little more than each clip alone."""

_HALF: Final = 0.5
"""How much they say at most. What each clip alone tells of the elbow's plane is off the other way:
over 190 pairs of clips with elbows that bend anyhow, half of each is off by 10° in the median,
where either alone is by 16° and 31°."""

_POSE: Final = np.radians(60.0)
"""How far a pelvis or chest may lean, and a leg be turned about itself, against what the motion
says where a rest pose is believed."""

_ARM: Final = np.radians(110.0)
"""Likewise of an arm, of which a motion says less: off by 60° in one pair of clips of ten whose
elbows bend anyhow, and by 99° at most."""

_OPPOSITE: Final = float(np.cos(np.radians(150.0)))
"""Cosine of the angle between directions beyond which there is no smallest turn to speak of."""

_FLAT: Final = 0.05
"""Of their length: joints that spread less than this sideways do not tell how a bone is turned."""

_SAME: Final = 0.02
"""Of their distance: how far joints that sit on a bone may be off, and are the same ones."""

_POSED: Final = 2e-3
"""Of the body's size: how far joints may lie off where the other file has them at rest, and it is
the same pose."""


@dataclass(frozen=True, eq=False)
class _Moments:
    """One of the clips, at some moments."""

    skeleton: Skeleton
    turns: Floats
    """(moments, bones, 4)"""
    heads: Floats
    offsets: Floats
    """(bones, 3), of each along its parent's axes."""

    @classmethod
    def of(cls, clip: Clip) -> _Moments:
        looks = spread_clip(clip, _LOOKS)
        turns, heads = clip.skeleton.pose(looks.rotations, looks.locations)
        return cls(clip.skeleton, turns, heads, usual_offsets(clip))

    def seen(self, anchor: int, bone: int, child: int) -> Floats:
        """(moments, 3) from a bone's joint to its child's, along an anchor's axes."""
        way = normalized(self.heads[:, child] - self.heads[:, bone])
        return rotate(conjugate(self.turns[:, anchor]), way)

    def turned(self, anchor: int, bone: int) -> Floats:
        """(moments, 4), along an anchor's axes."""
        return multiply(conjugate(self.turns[:, anchor]), self.turns[:, bone])


def agreeing(
    clips: tuple[Clip, Clip], landmarks: tuple[Landmarks, Landmarks], found: tuple[Floats, Floats]
) -> Floats:
    """The second clip's reference pose (bones, 4) as the first one's has the same bones.

    Args:
        clips: of one body, on their own rest poses.
        landmarks: of each.
        found: orientations (bones, 4) of their reference poses.
    """
    base, splice = (each.skeleton for each in clips)
    pairs = matched_bones(base, range(len(base)), splice, range(len(splice)), landmarks)
    same = _rest_in_one_pose(base, splice, pairs)
    if same is None:
        marked = {name: base.index.get(bone, -1) for name, bone in landmarks[0].bones.items()}
        finder = _Ways(clips, pairs, found)
        told = finder.all({marked.get(f"foot.{side}", -1) for side in "LR"})
        ways = finder.posed(told, marked)
    else:
        ways = same
    orientations = found[1].copy()
    for bone, way in ways.items():
        orientations[pairs[bone]] = multiply(found[0][bone], way)
    return orientations


def _rest_in_one_pose(
    base: Skeleton, splice: Skeleton, pairs: Mapping[int, int]
) -> dict[int, Floats] | None:
    """By bone, what (4,) turns the splice's axes into the base's, if both rest in one pose."""
    ours, theirs = list(pairs), list(pairs.values())
    places = [each - each.mean(axis=0) for each in (base.heads[ours], splice.heads[theirs])]
    sizes = [max(float(np.linalg.norm(each)), 1e-12) for each in places]
    first, second = (each / size for each, size in zip(places, sizes, strict=True))
    whole = _laid_over(first, second)
    if whole is None or np.linalg.norm(first - rotate(whole, second), axis=1).max() > _POSED:
        return None
    turned = multiply(whole, splice.rest_rotations[theirs])
    ways = multiply(conjugate(base.rest_rotations[ours]), turned)
    return dict(zip(ours, ways, strict=True))


class _Ways:
    """By bone of the base, what turns vectors along the splice's axes into those along its own."""

    def __init__(
        self, clips: tuple[Clip, Clip], pairs: Mapping[int, int], found: tuple[Floats, Floats]
    ) -> None:
        self._pairs, self._found = pairs, found
        self._base, self._splice = (_Moments.of(each) for each in clips)
        skeleton = self._base.skeleton
        others = self._splice.skeleton.parents
        self._children: dict[int, list[int]] = {
            bone: [
                child
                for child in skeleton.children[bone]
                if child in pairs
                and others[pairs[child]] == answer
                and np.any(self._base.offsets[child])
            ]
            for bone, answer in pairs.items()
        }
        self._ways: dict[int, Floats] = {}
        self._anchored: set[int] = set()

    def all(self, feet: Collection[int]) -> dict[int, Floats]:
        """Of all bones on a body whose place joints tell. Feet that end a leg stand as before."""
        anchors: dict[int, int] = {}
        for bone in sorted(self._pairs):
            told = self._by_joints(bone)
            if told is not None:
                self._ways[bone], anchors[bone] = told, bone
                self._anchored.add(bone)
                continue
            parent = self._base.skeleton.parents[bone]
            if parent not in anchors:
                continue
            anchors[bone] = anchors[parent]
            if self._children[bone]:
                self._ways[bone] = self._by_moments(bone, anchors[bone])
            else:
                carrier = anchors[parent] if bone in feet else parent
                self._ways[bone] = self._carried(bone, carrier)
        return self._ways

    def posed(self, told: Mapping[int, Floats], marked: Mapping[str, int]) -> dict[int, Floats]:
        """What was told of all bones, and of those whose rest poses are believed what these say.

        Args:
            told: by the motion.
            marked: the base's bones by landmark.
        """
        rested = self._by_rest(told)
        off = {bone: float(angle_between(told[bone], way)) for bone, way in rested.items()}

        def believed(names: Collection[str], most: float) -> bool:
            bones = [marked[name] for name in names if name in marked]
            return all(off.get(bone, np.inf) < most for bone in bones)

        if not believed([f"{each}.{side}" for each in ("thigh", "shin") for side in "LR"], _POSE):
            return dict(told)
        doubted = {
            marked[f"upper_arm.{side}"]
            for side in "LR"
            if f"upper_arm.{side}" in marked
            and not believed([f"{each}.{side}" for each in ("upper_arm", "forearm")], _ARM)
        }
        above = self._base.skeleton.ancestors
        return dict(told) | {
            bone: way for bone, way in rested.items() if doubted.isdisjoint((bone, *above(bone)))
        }

    def _by_rest(self, told: Mapping[int, Floats]) -> dict[int, Floats]:
        """The splice's rest pose laid over the base's by the smallest turns; none of bones beneath
        one that points the other way, or of a trunk that is bent too far.
        """
        base, splice = (each.skeleton.rest_rotations for each in (self._base, self._splice))
        laid: dict[int, Floats] = {}
        first = None
        for bone in sorted(told):
            other, parent = self._pairs[bone], self._base.skeleton.parents[bone]
            if bone in self._anchored:
                lay = multiply(multiply(base[bone], told[bone]), conjugate(splice[other]))
                first = lay if first is None else first
                if angle_between(first, lay) > _POSE:
                    return {}
            elif parent in laid:
                lay = laid[parent]
            else:
                continue
            if bone not in self._anchored and self._children[bone]:
                ours, theirs = (normalized(each[0]) for each in self._joints(bone))
                ours, theirs = (
                    rotate(base[bone], ours),
                    rotate(multiply(lay, splice[other]), theirs),
                )
                if ours @ theirs < _OPPOSITE:
                    continue
                lay = multiply(shortest_arc(theirs, ours), lay)
            laid[bone] = lay
        return {
            bone: multiply(multiply(conjugate(base[bone]), lay), splice[self._pairs[bone]])
            for bone, lay in laid.items()
            if bone not in self._anchored
        }

    def _carried(self, bone: int, carrier: int) -> Floats:
        """As it lies on what carries it in either reference pose."""
        ours, theirs = self._found
        above = multiply(conjugate(ours[bone]), ours[carrier])
        beneath = multiply(conjugate(theirs[self._pairs[carrier]]), theirs[self._pairs[bone]])
        return multiply(multiply(above, self._ways[carrier]), beneath)

    def _joints(self, bone: int) -> tuple[Floats, Floats]:
        """Where children sit on a bone, along the base's and along the splice's axes."""
        children = self._children[bone]
        answers = [self._pairs[each] for each in children]
        return self._base.offsets[children], self._splice.offsets[answers]

    def _by_joints(self, bone: int) -> Floats | None:
        """From the joints that sit on it, none where they lie in one line."""
        ours, theirs = self._joints(bone)
        if len(ours) < 2:
            return None
        way = _laid_over(ours, theirs)
        # A finger that is taken for another one tells nothing.
        sizes = np.linalg.norm(ours), np.linalg.norm(theirs)
        if way is None or np.linalg.norm(ours / sizes[0] - rotate(way, theirs) / sizes[1]) > _SAME:
            return None
        return way

    def _by_moments(self, bone: int, anchor: int) -> Floats:
        """From moments at which the bone and those beside it lie alike, seen from an anchor."""
        answer, over = self._pairs[bone], self._pairs[anchor]
        to_ours = self._ways[anchor]
        own = multiply(conjugate(self._found[0][bone]), self._found[1][answer])
        off = np.zeros((len(self._base.turns), len(self._splice.turns)))
        for first, second in self._beside(bone, anchor):
            ours = self._base.seen(anchor, first, second)
            theirs = self._splice.seen(over, self._pairs[first], self._pairs[second])
            off += np.arccos(np.clip(ours @ rotate(to_ours, theirs).T, -1.0, 1.0)) ** 2
        weights = np.exp(-(off - off.min()) / (2.0 * _ALIKE**2))
        ours = to_matrix(conjugate(self._base.turned(anchor, bone)))
        theirs = to_matrix(multiply(to_ours, self._splice.turned(over, answer)))
        mean = np.einsum("mij,mn,njk->ik", ours, weights, theirs) / weights.sum()
        trust = _HALF * float(np.exp(-off.min() / _UNLIKE**2))
        way = _nearest(trust * mean + (1.0 - trust) * to_matrix(own))
        ours, theirs = (normalized(each[0]) for each in self._joints(bone))
        return multiply(shortest_arc(rotate(way, theirs), ours), way)

    def _beside(self, bone: int, anchor: int) -> Sequence[tuple[int, int]]:
        """Segments whose directions tell how a limb lies there: joint and next joint."""
        parent = self._base.skeleton.parents[bone]
        found = [] if parent == anchor else [(parent, bone)]
        for child in self._children[bone][:1]:
            found += [(bone, child), *((child, each) for each in self._children[child][:1])]
        return found


def _laid_over(ours: Floats, theirs: Floats) -> Floats | None:
    """The rotation (4,) that lays points (n, 3) over others, seen from one place; none where they
    lie in one line.
    """
    if any(_in_line(each) for each in (ours, theirs)):
        return None
    return _nearest(ours.T @ theirs)


def _in_line(points: Floats) -> bool:
    spread = np.linalg.svd(points, compute_uv=False)
    return bool(spread[1] <= _FLAT * spread[0])


def _nearest(matrix: Floats) -> Floats:
    """The rotation (4,) nearest to a matrix."""
    left, _, right = np.linalg.svd(matrix)
    proper = np.diag([1.0, 1.0, np.linalg.det(left @ right)])
    return from_matrix(left @ proper @ right)
