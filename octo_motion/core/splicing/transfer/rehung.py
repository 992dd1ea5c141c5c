# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies whose bones hang on each other otherwise than their limbs do.

Feet of game characters that were placed by controls hang on nothing, and go where their legs end
all the same. A torso of one bone may carry the hips, though it turns about them. So these bones are
hung where they belong before anything is carried over, and put back afterwards: their keys then say
the same of where they are.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Final

import numpy as np

from ...rotations import Floats, conjugate, multiply, rotate
from ...skeleton import Skeleton
from ..clip import Clip, Posture, posture_of, spread_clip
from ..humanoid import Landmarks
from .parts import ARM, LEG
from .retarget import MappedClip

_RIGID: Final = 0.08
"""Of a bone's length: how much it may seem to stretch over a clip, and still end where the next one
begins."""

_SAMPLES: Final = 100
"""Moments of a clip that are looked at."""

_ENDS: Final = {"hand": "forearm", "foot": "shin"}


class Rehung:
    """Clips of a skeleton with bones hung on other ones, and back.

    Args:
        skeleton: as it is.
        parents: new parents, by bone.
    """

    def __init__(self, skeleton: Skeleton, parents: dict[int, int]) -> None:
        self.skeleton = skeleton
        self._parents = [parents.get(bone, own) for bone, own in enumerate(skeleton.parents)]
        self._order = np.array(_parents_first(self._parents))
        self._places = np.argsort(self._order)
        self._moved = sorted(parents)
        self.joined = self._joined_skeleton()

    def into(self, clip: Clip) -> Clip:
        """The clip of the skeleton whose limbs are whole: all bones are where they were."""
        clip = self._reordered(clip, self.joined, self._order)
        rotations, locations = clip.rotations, clip.locations
        taken = self._places
        own = posture_of(self.skeleton, rotations[:, taken], locations[:, taken])
        for bone in self._moved:
            place = int(taken[bone])
            rotations[:, place], locations[:, place] = _hung(own, bone, self._parents[bone])
        return clip

    def back(self, clip: Clip, before: Clip, given: Clip) -> Clip:
        """A clip of the skeleton as it is.

        Args:
            clip: changed, of the skeleton whose limbs are whole.
            before: the same before it was changed.
            given: the same of the skeleton as it is: what has not moved stays to the last digit.
        """
        result = self._reordered(clip, self.skeleton, self._places)
        now = posture_of(self.joined, clip.rotations, clip.locations)
        was = posture_of(self.joined, before.rotations, before.locations)
        for bone in self._moved:
            place, parent = int(self._places[bone]), self.skeleton.parents[bone]
            hung_on = -1 if parent < 0 else int(self._places[parent])
            turned, moved = _hung(
                now, place, hung_on, inherits=self.skeleton.inherits_rotation[bone]
            )
            # What carries it counts as well: it may leave a bone behind that stays.
            kept = [each for each in (place, hung_on) if each >= 0]
            still = np.ones(len(given), dtype=bool)
            for each in kept:
                still &= np.all(now.orientation(each) == was.orientation(each), axis=-1)
                still &= np.all(now.head(each) == was.head(each), axis=-1)
            for array, own, new in (
                (result.rotations, given.rotations, turned),
                (result.locations, given.locations, moved),
            ):
                array[:, bone] = np.where(still[:, None], own[:, bone], new)
        return result

    def _reordered(self, clip: Clip, skeleton: Skeleton, order: np.ndarray) -> Clip:
        return replace(
            clip,
            skeleton=skeleton,
            rotations=clip.rotations[:, order],
            locations=clip.locations[:, order],
            scales=None if clip.scales is None else clip.scales[:, order],
        )

    def _joined_skeleton(self) -> Skeleton:
        own = self.skeleton
        lists = {
            each.name: tuple(getattr(own, each.name)[bone] for bone in self._order)
            for each in fields(own)
            if isinstance(getattr(own, each.name), tuple)
        }
        parents = [self._parents[bone] for bone in self._order]
        lists["parents"] = tuple(-1 if each < 0 else int(self._places[each]) for each in parents)
        for name, value in (("connected", False), ("inherits_rotation", True)):
            kept = zip(self._order.tolist(), lists[name], strict=True)
            lists[name] = tuple(value if bone in self._moved else each for bone, each in kept)
        arrays = {
            "rest_matrices": own.rest_matrices[self._order],
            "lengths": own.lengths[self._order],
        }
        return replace(own, **lists, **arrays)


def whole_limbs(mapped: MappedClip) -> tuple[MappedClip, Rehung | None]:
    """A mapped clip with its limbs and trunk made whole, and what did it: itself and none if they
    are.
    """
    hung = find_rehung(mapped.clip, mapped.landmarks)
    if hung is None:
        return mapped, None
    return MappedClip(hung.into(mapped.clip), mapped.landmarks), hung


def find_rehung(clip: Clip, landmarks: Landmarks | None) -> Rehung | None:
    """The clip's limbs and trunk made whole; none if they are, or if what is loose does not end
    them.
    """
    if landmarks is None or not len(clip):
        return None
    skeleton = clip.skeleton
    index = {name: skeleton.index.get(bone, -1) for name, bone in landmarks.bones.items()}
    limbs = {
        index.get(f"{name}.{side}", -1)
        for kind in (ARM, LEG)
        for name in kind.limb or ()
        for side in "LR"
    }
    parents = {}
    for side in "LR":
        for end, middle in _ENDS.items():
            lower, upper = index.get(f"{end}.{side}", -1), index.get(f"{middle}.{side}", -1)
            if min(lower, upper) < 0 or upper in skeleton.ancestors(lower):
                continue
            # A bone that hangs on another limb is not this one's end.
            if limbs.isdisjoint(skeleton.ancestors(lower)) and lower not in skeleton.ancestors(
                upper
            ):
                parents[lower] = upper
    parents = {lower: upper for lower, upper in parents.items() if _ends_at(clip, upper, lower)}
    parents |= _on_hips(skeleton, index)
    return Rehung(skeleton, parents) if parents else None


def _on_hips(skeleton: Skeleton, index: dict[str, int]) -> dict[int, int]:
    """New parents of hips and of a trunk that carries them, if it turns about them."""
    hips, chest = index.get("hips", -1), index.get("chest", -1)
    arms = [index.get(f"upper_arm.{side}", -1) for side in "LR"]
    if min(hips, chest, *arms) < 0 or chest not in skeleton.ancestors(hips):
        return {}
    above = skeleton.ancestors(hips)
    # From the hips up to the chest: each hangs on the one before it.
    path = [hips, *above[: above.index(chest) + 1]]
    shoulders = skeleton.heads[arms].mean(axis=0)
    low, high = (
        float(np.linalg.norm(place - skeleton.heads[chest]))
        for place in (skeleton.heads[hips], shoulders)
    )
    if low > high or any(skeleton.connected[bone] for bone in path[:-1]):
        return {}
    return {hips: skeleton.parents[chest]} | dict(zip(path[1:], path[:-1], strict=True))


def _ends_at(clip: Clip, upper: int, lower: int) -> bool:
    """Whether one bone is always as far from the other as a bone is long."""
    looks = spread_clip(clip, _SAMPLES)
    posture = posture_of(clip.skeleton, looks.rotations, looks.locations)
    between = rotate(
        conjugate(posture.orientation(upper)), posture.head(lower) - posture.head(upper)
    )
    usual = np.median(between, axis=0)
    off = np.linalg.norm(between - usual, axis=1)
    return bool(np.quantile(off, 0.9) < _RIGID * np.linalg.norm(usual))


def _hung(
    posture: Posture, bone: int, parent: int, *, inherits: bool = True
) -> tuple[Floats, Floats]:
    """Rotation (frames, 4) and location (frames, 3) of a bone where it is, if it hangs on another
    one, or on none (−1).
    """
    skeleton = posture.skeleton
    axes, place = skeleton.rest_rotations[bone], skeleton.heads[bone]
    if parent >= 0:
        turn = posture.turn(parent)
        place = posture.head(parent) + rotate(turn, place - skeleton.heads[parent])
        axes = multiply(turn, axes)
    carried = axes if inherits else skeleton.rest_rotations[bone]
    rotation = multiply(conjugate(carried), posture.orientation(bone))
    return rotation, rotate(conjugate(axes), posture.head(bone) - place)


def _parents_first(parents: list[int]) -> list[int]:
    """Bones in an order in which each comes after its parent, else as they were."""
    order: list[int] = []
    done: set[int] = set()
    for bone in range(len(parents)):
        path = []
        while bone >= 0 and bone not in done:
            path.append(bone)
            done.add(bone)
            bone = parents[bone]  # noqa: PLW2901
        order += path[::-1]
    return order
