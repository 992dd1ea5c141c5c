# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bone of one skeleton answers to which of another, and how they lie in each other.

Two skeletons differ in proportions, rest pose and bone axes. What a bone of the splice clip does
is carried over by one constant rotation per bone: seen from the body's frame, the base's bone is
the splice's bone times that constant. It is found at rest. Where a bone's direction matters (arms,
legs, chains), the splice's rest pose is first laid onto the base's, joint by joint from the body
outwards, by the smallest rotations: a rest pose with hanging arms then serves as well as one with
arms spread, and directions are kept exactly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import IDENTITY, Floats, conjugate, multiply, normalized, rotate, shortest_arc
from ...skeleton import Skeleton
from .landmarks import LANDMARKS, Landmarks

_SAME: Final = 0.005
"""Of a part's whole length: how much bones may differ in length and count as the same body's."""

_UNLIKE: Final = float(np.cos(np.radians(45.0)))
"""Cosine of the angle at which bones of two rest poses are no longer the same in the same pose.
Some files' bones all lie along one axis at rest."""

_AIMED: Final = frozenset({"upper_arm", "forearm", "thigh", "shin"})
"""Landmarks whose direction is what they show, whatever their bodies are."""

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
    same_rest: bool
    """Whether rest poses, axes and sizes are the same: locations can be taken over."""


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
    """Splice bone by base bone: landmarks first, then names, without prefix and case."""
    pairs: dict[int, int] = {}
    inside, theirs = set(bones), set(splice_bones)
    ours, others = landmarks
    if ours is not None and others is not None:
        for name in LANDMARKS:
            bone = base.index.get(ours.get(name) or "", -1)
            answer = splice.index.get(others.get(name) or "", -1)
            if bone in inside and answer in theirs:
                pairs[bone] = answer
    taken = set(pairs.values())
    by_name = {_plain(splice.names[bone]): bone for bone in splice_bones if bone not in taken}
    for bone in bones:
        if bone not in pairs and _plain(base.names[bone]) in by_name:
            pairs[bone] = by_name.pop(_plain(base.names[bone]))
    return pairs


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
) -> Correspondence:
    """The constants of matched bones.

    Args:
        base: the base's skeleton.
        splice: the splice clip's.
        pairs: splice bone by base bone.
        frames_at_rest: orientations (4,) of the body's frame at rest, base and splice.
        landmarks: the base's and the splice clip's, none for a chain.
        aim_all: whether directions matter for all bones, as in a chain.
    """
    marks, others = landmarks
    kinds = {} if marks is None else {name: key for key, name in marks.bones.items()}
    clavicles = {bone for bone in pairs if kinds.get(base.names[bone], "").startswith("clavicle")}
    # Whether a collar bone comes along says nothing of how arm and hand are built.
    limbs = {bone: other for bone, other in pairs.items() if bone not in clavicles}
    same_body = _same_body(base, splice, limbs)
    same_with_clavicles = same_body and _same_body(base, splice, pairs)
    our_back, their_back = (conjugate(each) for each in frames_at_rest)
    laid: dict[int, Floats] = {}
    constants: dict[int, Floats] = {}
    for bone in sorted(pairs):
        other = pairs[bone]
        landmark = kinds.get(base.names[bone], "")
        kind = landmark.partition(".")[0]
        lay = next((laid[each] for each in base.ancestors(bone) if each in laid), IDENTITY)
        follower = _follower(base, bone, pairs, marks, landmark)
        if follower is not None:
            ours = rotate(our_back, base.heads[follower] - base.heads[bone])
            theirs = rotate(their_back, splice.heads[pairs[follower]] - splice.heads[other])
            ours, theirs = normalized(ours), normalized(rotate(lay, theirs))
            # Clavicles, feet, spines and heads are built differently, but hang on alike at rest:
            # unless one rest pose is none to stand in.
            same = same_with_clavicles if bone in clavicles else same_body
            aimed = aim_all or same or kind in _AIMED or not kind or np.dot(ours, theirs) < _UNLIKE
            if aimed and np.any(ours) and np.any(theirs):
                lay = multiply(shortest_arc(theirs, ours), lay)
        elif kind == "foot" and marks is not None and others is not None:
            side = landmark.partition(".")[2]
            feet = _Foot(base, marks, bone, side), _Foot(splice, others, other, side)
            if any(each.toe is not None and each.pointed for each in feet) and not all(
                each.pointed for each in feet
            ):
                ours, theirs = rotate(our_back, feet[0].along), rotate(their_back, feet[1].along)
                lay = multiply(shortest_arc(rotate(lay, theirs), ours), lay)
        laid[bone] = lay
        rest = multiply(our_back, base.rest_rotations[bone])
        other_rest = multiply(their_back, splice.rest_rotations[other])
        constants[bone] = multiply(conjugate(multiply(lay, other_rest)), rest)
    return Correspondence(pairs, constants, same_body, _same_rest(base, splice, pairs))


def chain_length(skeleton: Skeleton, bones: Sequence[int]) -> float:
    """Length of the line through these bones' heads, armature units."""
    return float(np.linalg.norm(np.diff(skeleton.heads[list(bones)], axis=0), axis=1).sum())


def _plain(name: str) -> str:
    return name.rpartition(":")[2].casefold()


def _follower(
    base: Skeleton,
    bone: int,
    pairs: Mapping[int, int],
    landmarks: Landmarks | None,
    landmark: str,
) -> int | None:
    """The matched bone at whose head this one ends."""
    kind, _, side = landmark.partition(".")
    if landmarks is not None and kind in _NEXT:
        following = f"{_NEXT[kind]}.{side}" if side else _NEXT[kind]
        number = base.index.get(landmarks.get(following) or "", -1)
        if number in pairs:
            return number
    return next((child for child in base.children[bone] if child in pairs), None)


def _same_body(base: Skeleton, splice: Skeleton, pairs: Mapping[int, int]) -> bool:
    """Whether the bones are of the same lengths, up to one factor, and joined alike."""
    inner = [bone for bone in pairs if base.parents[bone] in pairs]
    if not inner or any(splice.parents[pairs[b]] != pairs[base.parents[b]] for b in inner):
        return False
    parents = [base.parents[bone] for bone in inner]
    ours = np.linalg.norm(base.heads[inner] - base.heads[parents], axis=1)
    others = splice.heads[[pairs[bone] for bone in inner]]
    theirs = np.linalg.norm(others - splice.heads[[pairs[bone] for bone in parents]], axis=1)
    if theirs.sum() == 0.0:
        return True
    return bool(
        np.abs(ours - theirs * (ours.sum() / theirs.sum())).max() < _SAME * max(ours.sum(), 1e-12)
    )


def _same_rest(base: Skeleton, splice: Skeleton, pairs: Mapping[int, int]) -> bool:
    if not pairs:
        return False
    ours = base.rest_matrices[list(pairs)]
    theirs = splice.rest_matrices[list(pairs.values())]
    return bool(np.allclose(ours, theirs, rtol=1e-5, atol=1e-6 * np.abs(ours).max()))
