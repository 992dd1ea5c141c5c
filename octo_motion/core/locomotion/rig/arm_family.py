# SPDX-License-Identifier: GPL-3.0-or-later
"""Which chains of a rig are the arms of one body, and which are limbs, fingers or a tail.

Arms are alike in bones and length, long compared with the rest of the rig, and spring from one
place. A rig with a second set of limbs somewhere else (arms *and* legs, hands with fingers) is a
body with a skeleton, not an octopus.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from ...errors import RigError
from ...rotations import normalized
from ...skeleton import Skeleton
from .arm_chains import AXES, LEAST_BONES
from .bone_tree import REMEDY, BoneChain, BoneTree

# Arms of one family differ at most by these factors in number of bones and in length.
_ALIKE_IN_BONES: Final = 2.0
_ALIKE_IN_LENGTH: Final = 2.5
# Arm lengths: how far roots may lie from their middle, and the other bones from the arms' roots.
_WIDEST_BODY: Final = 1.0
_LARGEST_REST: Final = 3.0
# Limbs elsewhere that have this share of the family's bones make the rig something else.
_OTHER_LIMBS: Final = 0.4
# So many arms may stand along a spine (as an insect's legs do); fewer are a body's limbs.
_ARMS_ALONG_SPINE: Final = 6
# What programs call the bones of a human arm and of a human leg ("arm" and "leg" alone: anything).
_LIMB_WORDS: Final = (
    ("hand", "wrist", "forearm", "upperarm", "lowerarm", "shoulder"),
    ("foot", "toe", "thigh", "shin", "ankle", "heel", "upperleg", "lowerleg", "upleg"),
)


def best_family(
    skeleton: Skeleton, tree: BoneTree, chains: list[BoneChain], up: str
) -> tuple[BoneChain, ...]:
    """The largest family of chains that passes for the arms of one body.

    Args:
        skeleton: the rig.
        tree: the bones that are looked at.
        chains: those that end in a tip of the tree.
        up: name of the armature's axis that is the body's up.

    Raises:
        RigError: none does.
    """
    across_rig = _families(chains)
    at_one_bone = [
        family
        for attachment in dict.fromkeys(chain.attachment for chain in chains)
        for family in _families([each for each in chains if each.attachment == attachment])
    ]

    def rank(family: tuple[BoneChain, ...]) -> tuple[int, float]:
        return sum(map(len, family)), sum(chain.length for chain in family)

    for group in (across_rig, at_one_bone):
        for found in sorted(group, key=rank, reverse=True):
            family = _without_odd_one(skeleton, found, up)
            if (
                _springs_from_one_place(skeleton, family)
                and _is_large(skeleton, tree, family)
                and _stands_off_one_body(tree, family)
                and not _has_other_limbs(tree, family)
                and not _is_named_like_a_body(skeleton, family)
            ):
                return family
    raise RigError(
        "No arms were found: the chains of this armature look like limbs of a body with a spine, "
        "or like fingers.",
        REMEDY,
    )


def _families(chains: list[BoneChain]) -> list[tuple[BoneChain, ...]]:
    """Sets of chains that are alike in bones and length, one for each kind of chain."""
    found: dict[tuple[BoneChain, ...], None] = {}
    for model in {(len(chain), f"{chain.length:.4g}"): chain for chain in chains}.values():
        family = tuple(
            chain
            for chain in chains
            if _ratio(len(chain), len(model)) <= _ALIKE_IN_BONES
            and _ratio(chain.length, model.length) <= _ALIKE_IN_LENGTH
        )
        found[family] = None
    return list(found)


def _ratio(one: float, other: float) -> float:
    return max(one, other) / max(min(one, other), 1e-12)


def _without_odd_one(
    skeleton: Skeleton, family: tuple[BoneChain, ...], up: str
) -> tuple[BoneChain, ...]:
    """A family without the one short chain that stands up or hangs where all others do not.

    That is a mantle, a head or a siphon. Long chains are arms, however they are posed.
    """
    if len(family) < 4:
        return family
    directions = np.array(
        [skeleton.heads[chain.bones[-1]] - skeleton.heads[chain.bones[0]] for chain in family]
    )
    elevations = np.arcsin(np.clip(normalized(directions) @ np.array(AXES[up], float), -1.0, 1.0))
    odd = np.flatnonzero(np.abs(elevations - np.median(elevations)) > np.radians(60.0))
    if len(odd) != 1 or len(family[odd[0]]) > 5:
        return family
    return family[: odd[0]] + family[odd[0] + 1 :]


def _springs_from_one_place(skeleton: Skeleton, family: tuple[BoneChain, ...]) -> bool:
    """Whether the roots lie together; fingers of two hands, toes of two feet do not."""
    roots = skeleton.heads[[chain.bones[0] for chain in family]]
    spread = np.linalg.norm(roots - roots.mean(axis=0), axis=1).mean()
    return bool(spread <= _WIDEST_BODY * _typical_length(family))


def _is_large(skeleton: Skeleton, tree: BoneTree, family: tuple[BoneChain, ...]) -> bool:
    """Whether the rest of the rig lies within reach; a hand's fingers are far from most of it."""
    own = {bone for chain in family for bone in chain.bones}
    others = [bone for bone in tree.members if bone not in own]
    if not others:
        return True
    center = skeleton.heads[[chain.bones[0] for chain in family]].mean(axis=0)
    distance = np.median(np.linalg.norm(skeleton.heads[others] - center, axis=1))
    return bool(distance <= _LARGEST_REST * _typical_length(family))


def _stands_off_one_body(tree: BoneTree, family: tuple[BoneChain, ...]) -> bool:
    """Whether no chain springs from further down the spine than another, or many of a kind do."""
    attachments = {chain.attachment for chain in family} - {-1}
    for attachment in attachments:
        above = tree.parents[attachment]
        while above >= 0:
            if above in attachments:
                of_a_kind = len({len(chain) for chain in family}) == 1
                return of_a_kind and _paired(family) >= _ARMS_ALONG_SPINE
            above = tree.parents[above]
    return True


def _paired(family: tuple[BoneChain, ...]) -> int:
    """How many chains of a family share their bone with another: tails and necks stand alone."""
    counts: dict[int, int] = {}
    for chain in family:
        counts[chain.attachment] = counts.get(chain.attachment, 0) + 1
    return sum(count for count in counts.values() if count > 1)


def _has_other_limbs(tree: BoneTree, family: tuple[BoneChain, ...]) -> bool:
    """Whether a set of limbs of some size springs from a bone elsewhere: legs beside arms."""
    own = {bone for chain in family for bone in chain.bones}
    carrying = set(own)
    for chain in family:
        above = chain.attachment
        while above >= 0 and above not in carrying:
            carrying.add(above)
            above = tree.parents[above]
    sizes: dict[int, int] = {}
    for bone in reversed(tree.members):
        sizes[bone] = 1 + sum(sizes[child] for child in tree.children[bone])
    for parent, children in tree.children.items():
        if parent in own:
            continue
        limbs = [
            child
            for child in children
            if child not in carrying and tree.heights[child] >= LEAST_BONES
        ]
        if len(limbs) > 1:
            bones = sum(sizes[limb] for limb in limbs)
            if bones >= _OTHER_LIMBS * len(own):
                return True
    return False


def _is_named_like_a_body(skeleton: Skeleton, family: tuple[BoneChain, ...]) -> bool:
    """Whether one of the chains has a hand's bones and another has a foot's."""
    names = [" ".join(skeleton.names[bone].lower() for bone in chain.bones) for chain in family]
    return all(any(word in name for name in names for word in limb) for limb in _LIMB_WORDS)


def _typical_length(family: tuple[BoneChain, ...]) -> float:
    return float(np.median([chain.length for chain in family]))
