# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bone of a skeleton answers to which on the body's other side."""

from __future__ import annotations

from ...skeleton import Skeleton
from .landmarks import Landmarks, read_names

_OTHER = {"L": "R", "R": "L"}


def mirror_images(skeleton: Skeleton, landmarks: Landmarks | None) -> tuple[int, ...]:
    """Each bone's mirror image, by index; itself where it has none, as on the mid plane.

    Landmarks tell it first, then names, and where neither does the place among the bones that hang
    on the same: fingers that are only numbered.
    """
    images = list(range(len(skeleton)))

    def pair(one: int, other: int) -> None:
        if one != other and images[one] == one and images[other] == other:
            images[one], images[other] = other, one

    for one, other in _by_landmark(skeleton, landmarks):
        pair(one, other)
    for one, other in _by_name(skeleton):
        pair(one, other)
    for one in range(len(skeleton)):
        other = images[one]
        if one < other:
            alone = [
                [child for child in skeleton.children[each] if images[child] == child]
                for each in (one, other)
            ]
            if len(alone[0]) == len(alone[1]):
                for children in zip(*alone, strict=True):
                    pair(*children)
    return tuple(images)


def opposite(landmark: str) -> str:
    """The landmark on the other side: "hand.L" is "hand.R", "head" is itself."""
    name, point, side = landmark.partition(".")
    return f"{name}{point}{_OTHER.get(side, side)}"


def _by_landmark(skeleton: Skeleton, landmarks: Landmarks | None) -> list[tuple[int, int]]:
    if landmarks is None:
        return []
    index = skeleton.index
    return [
        (index[bone], index[other])
        for name, bone in landmarks.bones.items()
        if name.endswith(".L")
        and (other := landmarks.get(opposite(name))) in index
        and bone in index
    ]


def _by_name(skeleton: Skeleton) -> list[tuple[int, int]]:
    found: dict[tuple[str, str], list[int]] = {}
    for bone, name in enumerate(read_names(skeleton.names)):
        if name.side:
            found.setdefault((name.stem, name.side), []).append(bone)
    pairs = []
    for (stem, side), bones in found.items():
        others = found.get((stem, _OTHER[side]), [])
        # Of several that are called alike nobody knows which is meant.
        if side == "L" and len(bones) == len(others) == 1:
            pairs.append((bones[0], others[0]))
    return pairs
