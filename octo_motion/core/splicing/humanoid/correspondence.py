# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bone of one skeleton answers to which of another, and how they lie in each other.

Two skeletons differ in proportions, rest pose and bone axes. What a bone of the splice clip does
is carried over by one constant rotation per bone: seen from the body's frame, the base's bone is
the splice's bone times that constant. It is found at rest, where humanoids rest in their reference
poses. Where a bone's direction matters (arms, legs, necks, chains, and all bones of one body), the
splice's rest pose is first laid onto the base's by the smallest rotations: directions are then kept
exactly.

Skeletons of which no reference pose is known, and chains, are compared as their files rest: there
they are laid over each other joint by joint from the body outwards, so that hanging arms serve as
well as arms spread.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import (
    IDENTITY,
    Floats,
    angle_between,
    conjugate,
    multiply,
    normalized,
    rotate,
    shortest_arc,
)
from ...skeleton import Skeleton
from .fingers import finger_bones
from .landmarks import LANDMARKS, Landmarks

_SAME: Final = 0.005
"""Of a part's whole length: how much bones may differ in length and count as the same body's."""

_REST: Final = 1e-3
"""Radians, and of a body's size: what files lose of a rest pose by rounding."""

_UNLIKE: Final = float(np.cos(np.radians(45.0)))
"""Cosine of the angle at which bones of two rest poses are no longer the same in the same pose.
Some files' bones all lie along one axis at rest."""

_ALIKE: Final = float(np.cos(np.radians(22.5)))
"""Cosine of half the angle at which axes are no longer the same ones."""

_AIMED: Final = frozenset({"upper_arm", "forearm", "thigh", "shin", "neck"})
"""Landmarks whose direction is what they show, whatever their bodies are."""

_LIMBS: Final = frozenset({"upper_arm", "forearm", "hand", "thigh", "shin"})

_TRUNK: Final = frozenset({"spine", "chest", "neck", "head"})

_NEXT: Final = {
    "clavicle": "upper_arm",
    "upper_arm": "forearm",
    "forearm": "hand",
    "thigh": "shin",
    "shin": "foot",
    "foot": "toe",
    "neck": "head",
}


@dataclass(frozen=True, eq=False)
class Correspondence:
    """Bones of a part on both skeletons."""

    pairs: Mapping[int, int]
    """Splice bone by base bone."""
    constants: Mapping[int, Floats]
    """(4,) by base bone: seen from the body, base bone = splice bone ∘ constant."""
    same_body: bool
    """Whether all bones are of the same lengths, up to one factor."""
    size: float
    """How much larger the base's bones are: locations of the same body are taken over by it."""

    def same_axes(self, bone: int) -> bool:
        """Whether a bone's axes lie in both bodies alike, so that scales along them compare."""
        return bool(abs(self.constants[bone][0]) > _ALIKE)


class _Foot:
    """How a foot lies at rest on a body that may have no toes to say it."""

    def __init__(self, skeleton: Skeleton, landmarks: Landmarks, foot: int, side: str) -> None:
        self.toe, shin = (
            skeleton.index.get(landmarks.get(f"{name}.{side}") or "") for name in ("toe", "shin")
        )
        end = skeleton.tails[foot] if self.toe is None else skeleton.heads[self.toe]
        self.along = normalized(end - skeleton.heads[foot])
        """(3,) where it points, armature space."""
        above = skeleton.heads[foot if shin is None else shin]
        leg = normalized(skeleton.heads[foot] - above)
        self.pointed = bool(np.dot(self.along, leg) > _UNLIKE)
        """Whether it goes on straight from the shin: nobody stands so."""


def matched_bones(
    base: Skeleton,
    bones: Sequence[int],
    splice: Skeleton,
    splice_bones: Sequence[int],
    landmarks: tuple[Landmarks | None, Landmarks | None],
) -> dict[int, int]:
    """Splice bone by base bone: landmarks first, then names, without prefix and case, then fingers
    whatever they are called.
    """
    inside, theirs = set(bones), set(splice_bones)
    pairs = {
        bone: answer
        for bone, answer in _landmark_pairs(base, splice, landmarks).items()
        if bone in inside and answer in theirs
    }
    taken = set(pairs.values())
    by_name = {_plain(splice.names[bone]): bone for bone in splice_bones if bone not in taken}
    for bone in bones:
        if bone not in pairs and _plain(base.names[bone]) in by_name:
            pairs[bone] = by_name.pop(_plain(base.names[bone]))
    taken = set(pairs.values())
    for bone, answer in _finger_pairs(base, splice, landmarks):
        if bone in inside - pairs.keys() and answer in theirs - taken:
            pairs[bone] = answer
    return pairs


def _finger_pairs(
    base: Skeleton, splice: Skeleton, landmarks: tuple[Landmarks | None, Landmarks | None]
) -> Iterator[tuple[int, int]]:
    """Bones of the same finger of the same hand, counted from the palm."""
    for name in ("hand.L", "hand.R"):
        hands = [
            skeleton.index.get((marks.get(name) if marks is not None else None) or "", -1)
            for skeleton, marks in zip((base, splice), landmarks, strict=True)
        ]
        if min(hands) >= 0:
            ours, theirs = finger_bones(base, hands[0]), finger_bones(splice, hands[1])
            yield from ((bone, theirs[key]) for key, bone in ours.items() if key in theirs)


def matched_chains(
    base: Skeleton, bones: Sequence[int], splice: Skeleton, splice_bones: Sequence[int]
) -> dict[int, int]:
    """Two trees of bones matched by their shape: first children to first children."""
    pairs = {bones[0]: splice_bones[0]}
    inside, theirs = set(bones), set(splice_bones)
    for bone in bones:
        if bone not in pairs:
            continue
        answers = [child for child in splice.children[pairs[bone]] if child in theirs]
        children = [child for child in base.children[bone] if child in inside]
        pairs.update(zip(children, answers, strict=False))
    return pairs


def find_correspondence(
    base: Skeleton,
    splice: Skeleton,
    pairs: Mapping[int, int],
    frames_at_rest: tuple[Floats, Floats],
    landmarks: tuple[Landmarks | None, Landmarks | None],
    *,
    aim_all: bool = False,
    referred: bool = False,
) -> Correspondence:
    """The constants of matched bones.

    Args:
        base: the base's skeleton.
        splice: the splice clip's.
        pairs: splice bone by base bone.
        frames_at_rest: orientations (4,) of the body's frame at rest, base and splice.
        landmarks: the base's and the splice clip's, none for a chain.
        aim_all: whether directions matter for all bones, as in a chain.
        referred: whether both rest in their reference poses, where each bone lies as it should
            whatever the bones above it do.
    """
    marks, others = landmarks
    kinds = {} if marks is None else {name: key for key, name in marks.bones.items()}
    clavicles, limbs = _limbs(base, splice, pairs, landmarks, kinds)
    same_body, size = _same_body(base, splice, limbs)
    same_with_clavicles = same_body and _same_body(base, splice, pairs)[0]
    backs = tuple(conjugate(each) for each in frames_at_rest)
    on_limbs: set[int] = set()
    laid: dict[int, Floats] = {}
    constants: dict[int, Floats] = {}
    for bone, other in sorted(pairs.items()):
        landmark = kinds.get(base.names[bone], "")
        kind, _, side = landmark.partition(".")
        above = base.ancestors(bone)
        lay = next((laid[each] for each in above if each in laid and not referred), IDENTITY)
        if referred and (kind in _LIMBS or (not kind and not on_limbs.isdisjoint(above))):
            # How a limb lies along its own plane does not hang on where the body's frames are.
            on_limbs.add(bone)
        our_back, their_back = (IDENTITY, IDENTITY) if bone in on_limbs else backs
        ways = next(_ways(base, splice, pairs, bone, _followers(base, bone, marks, landmark)), None)
        if ways is not None:
            ours, theirs = (rotate(our_back, ways[0]), rotate(lay, rotate(their_back, ways[1])))
            # Clavicles, feet, spines and heads are built differently, but hang on alike at rest:
            # unless one rest pose is none to stand in.
            same = same_with_clavicles if bone in clavicles else same_body
            aimed = aim_all or same or kind in _AIMED or not kind or np.dot(ours, theirs) < _UNLIKE
            if aimed:
                lay = multiply(shortest_arc(theirs, ours), lay)
        elif kind == "foot" and marks is not None and others is not None:
            feet = _Foot(base, marks, bone, side), _Foot(splice, others, other, side)
            ours, theirs = rotate(our_back, feet[0].along), rotate(their_back, feet[1].along)
            if _stand_otherwise(feet, ours, theirs, referred=referred):
                lay = multiply(shortest_arc(rotate(lay, theirs), ours), lay)
        laid[bone] = lay
        turned = multiply(lay, multiply(their_back, splice.rest_rotations[other]))
        constants[bone] = multiply(conjugate(turned), multiply(our_back, base.rest_rotations[bone]))
    return Correspondence(pairs, constants, same_body, size)


def _limbs(
    base: Skeleton,
    splice: Skeleton,
    pairs: Mapping[int, int],
    landmarks: tuple[Landmarks | None, Landmarks | None],
    kinds: Mapping[str, str],
) -> tuple[set[int], dict[int, int]]:
    """Clavicles of the base, and the pairs of bones by which bodies are told apart."""
    clavicles = {bone for bone in pairs if kinds.get(base.names[bone], "").startswith("clavicle")}
    # Whether a collar bone comes along says nothing of how arm and hand are built.
    limbs = {bone: other for bone, other in pairs.items() if bone not in clavicles}
    if any(kind in _TRUNK for bone in pairs if (kind := kinds.get(base.names[bone], ""))):
        # The few bones of a trunk or a neck tell no body from another: all landmarks do.
        limbs |= _landmark_pairs(base, splice, landmarks)
    return clavicles, limbs


def _stand_otherwise(
    feet: tuple[_Foot, _Foot], ours: Floats, theirs: Floats, *, referred: bool
) -> bool:
    """Whether feet are built so differently that their directions have to be brought together."""
    if all(each.toe is None for each in feet):
        return False
    if referred:
        # A dancer on tiptoe does not tell how a foot stands. Nor does the end of a foot without
        # toes, which is where a file has put it.
        return all(each.toe is not None for each in feet) and bool(np.dot(ours, theirs) < _UNLIKE)
    return any(each.pointed for each in feet) and not all(each.pointed for each in feet)


def chain_length(skeleton: Skeleton, bones: Sequence[int]) -> float:
    """Length of the line through these bones' heads, armature units."""
    return float(np.linalg.norm(np.diff(skeleton.heads[list(bones)], axis=0), axis=1).sum())


def rest_alike(
    base: Skeleton, splice: Skeleton, landmarks: tuple[Landmarks | None, Landmarks | None]
) -> bool:
    """Whether all landmarks are the same on both and rest alike, axes included, wherever the whole
    stands, whichever way it faces and whatever its size.
    """
    ours, others = landmarks
    if ours is None or others is None or ours.bones.keys() != others.bones.keys():
        return False
    pairs = _landmark_pairs(base, splice, landmarks)
    if len(pairs) < len(ours.bones):
        return False
    first, second = list(pairs), list(pairs.values())
    seen = []
    for skeleton, bones in ((base, first), (splice, second)):
        back = conjugate(skeleton.rest_rotations[bones[0]])
        places = rotate(back, skeleton.heads[bones] - skeleton.heads[bones[0]])
        size = max(float(np.linalg.norm(places, axis=1).max()), 1e-12)
        seen.append((multiply(back, skeleton.rest_rotations[bones]), places / size))
    (turns, places), (other_turns, other_places) = seen
    return bool(
        angle_between(turns, other_turns).max() < _REST
        and np.abs(places - other_places).max() < _REST
    )


def same_build(base: Skeleton, splice: Skeleton, landmarks: tuple[Landmarks, Landmarks]) -> bool:
    """Whether all landmarks are joined alike by bones of the same lengths, up to one factor.

    A few bones alone are alike by chance: every pelvis is a triangle with two equal sides.
    """
    pairs = _landmark_pairs(base, splice, landmarks)
    known = [each.bones.keys() for each in landmarks]
    return known[0] == known[1] and _same_body(base, splice, pairs)[0]


def _landmark_pairs(
    base: Skeleton, splice: Skeleton, landmarks: tuple[Landmarks | None, Landmarks | None]
) -> dict[int, int]:
    """Splice bone by base bone of all landmarks that both have."""
    found = {}
    for name in LANDMARKS:
        bones = [
            skeleton.index.get((marks.get(name) if marks is not None else None) or "", -1)
            for skeleton, marks in zip((base, splice), landmarks, strict=True)
        ]
        if min(bones) >= 0:
            found[bones[0]] = bones[1]
    return found


def _plain(name: str) -> str:
    return name.rpartition(":")[2].casefold()


def _followers(
    base: Skeleton, bone: int, landmarks: Landmarks | None, landmark: str
) -> Iterator[int]:
    """Bones at whose heads this one may end, the likeliest first."""
    kind, _, side = landmark.partition(".")
    if landmarks is not None and kind in _NEXT:
        following = f"{_NEXT[kind]}.{side}" if side else _NEXT[kind]
        yield base.index.get(landmarks.get(following) or "", -1)
    yield from base.children[bone]


def _ways(
    base: Skeleton, splice: Skeleton, pairs: Mapping[int, int], bone: int, ends: Iterator[int]
) -> Iterator[tuple[Floats, Floats]]:
    """Directions (3,) on base and splice from a bone's joint to those of matched ones. A finger
    that begins where its hand does shows none, but that of rounding.
    """
    for end in ends:
        if end not in pairs:
            continue
        ours = base.heads[end] - base.heads[bone]
        theirs = splice.heads[pairs[end]] - splice.heads[pairs[bone]]
        if all(
            np.linalg.norm(way) > _REST * np.ptp(skeleton.heads, axis=0).max()
            for way, skeleton in ((ours, base), (theirs, splice))
        ):
            yield normalized(ours), normalized(theirs)


def _same_body(base: Skeleton, splice: Skeleton, pairs: Mapping[int, int]) -> tuple[bool, float]:
    """Whether the bones are of the same lengths, up to one factor, and joined alike; the factor."""
    inner = [bone for bone in pairs if base.parents[bone] in pairs]
    if not inner or any(splice.parents[pairs[b]] != pairs[base.parents[b]] for b in inner):
        return False, 1.0
    parents = [base.parents[bone] for bone in inner]
    ours = np.linalg.norm(base.heads[inner] - base.heads[parents], axis=1)
    others = splice.heads[[pairs[bone] for bone in inner]]
    theirs = np.linalg.norm(others - splice.heads[[pairs[bone] for bone in parents]], axis=1)
    if theirs.sum() == 0.0:
        return True, 1.0
    size = float(ours.sum() / theirs.sum())
    return bool(np.abs(ours - theirs * size).max() < _SAME * max(ours.sum(), 1e-12)), size
