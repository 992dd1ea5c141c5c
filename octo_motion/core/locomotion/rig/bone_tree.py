# SPDX-License-Identifier: GPL-3.0-or-later
"""The bones that matter on an armature as a tree, and the chains that end in its tips."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...errors import RigError
from ...skeleton import Skeleton
from .arm_chains import COINCIDENT, LEAST_BONES, MOST_BONES

REMEDY: Final = "Select the bones of one arm, from its root to its tip, and click Add."

_TIP_MARKERS: Final = ("_end", ".end", "_nub", "nub", "_leaf", "_endsite")
_CONTROL_PREFIXES: Final = ("ORG-", "MCH-", "CTRL-", "CTRL_", "VIS-", "IK-", "IK_", "FK-", "FK_")


@dataclass(frozen=True)
class BoneTree:
    """The bones that are looked at, with all others taken out."""

    members: tuple[int, ...]
    parents: dict[int, int]
    """Nearest ancestor in the tree, −1 for none."""
    children: dict[int, list[int]]
    """By parent; −1 lists the roots."""
    heights: dict[int, int]
    """Bones on the longest way from a bone (counted) to a tip."""


@dataclass(frozen=True)
class BoneChain:
    """Bones in a row, root to tip, by their numbers."""

    bones: tuple[int, ...]
    attachment: int
    """The bone of the tree that it springs from, −1 for none."""
    length: float
    """Along the joints, armature units."""

    def __len__(self) -> int:
        """Number of bones."""
        return len(self.bones)


def candidate_chains(skeleton: Skeleton) -> tuple[BoneTree, list[BoneChain]]:
    """The chains of the first kind of bones that has any: weighted, deforming, all.

    Raises:
        RigError: no chain has a number of bones that an arm can have.
    """
    numbers = range(len(skeleton))
    tips = {bone for bone in numbers if _is_tip_marker(skeleton, bone)}
    deforming = {bone for bone in numbers if skeleton.deform[bone]}
    weighted = {bone for bone in deforming if skeleton.weighted[bone]}
    longest = 0
    for members in (weighted, deforming - tips, set(numbers) - tips):
        tree = _tree_of(skeleton, members)
        chains = _chains_of(skeleton, tree)
        usable = [chain for chain in chains if LEAST_BONES <= len(chain) <= MOST_BONES]
        if usable:
            chosen = _without_twins(skeleton, usable)
            twins = {bone for chain in usable if chain not in chosen for bone in chain.bones}
            return (_tree_of(skeleton, members - twins) if twins else tree), chosen
        longest = max([longest, *map(len, chains)])
    if longest > MOST_BONES:
        raise RigError(
            f"No arms were found: the chain of {longest} bones has more than {MOST_BONES}.",
            REMEDY,
        )
    raise RigError(
        f"No arms were found: no {LEAST_BONES} bones form a chain with a free tip.",
        "An arm needs at least three bones in a row; subdivide its bones, or select another "
        "armature.",
    )


def _tree_of(skeleton: Skeleton, members: set[int]) -> BoneTree:
    nearest: list[int] = []
    parents: dict[int, int] = {}
    children: dict[int, list[int]] = {-1: []}
    for bone, parent in enumerate(skeleton.parents):
        above = -1 if parent < 0 else parent if parent in members else nearest[parent]
        nearest.append(above)
        if bone in members:
            parents[bone] = above
            children[bone] = []
            children[above].append(bone)
    heights: dict[int, int] = {}
    for bone in reversed(parents):
        heights[bone] = 1 + max((heights[child] for child in children[bone]), default=0)
    return BoneTree(tuple(parents), parents, children, heights)


def _chains_of(skeleton: Skeleton, tree: BoneTree) -> list[BoneChain]:
    """All chains that end in a tip, of any number of bones, helpers left out."""
    following = {bone: _continuation(skeleton, tree, bone) for bone in tree.members}
    chains: list[BoneChain] = []
    for start in tree.members:
        parent = tree.parents[start]
        if parent >= 0 and following[parent] == start:
            continue
        bones = [start]
        while (after := following[bones[-1]]) is not None:
            bones.append(after)
        if _branches(tree, bones[-1]):
            continue
        if parent < 0:
            bones = _without_body(tree, bones)
        bones = _without_offsets(skeleton, tree, bones)
        if bones:
            attachment = tree.parents[bones[0]]
            chains.append(BoneChain(tuple(bones), attachment, _length(skeleton, bones)))
    return chains


def _branches(tree: BoneTree, bone: int) -> bool:
    return sum(tree.heights[child] > 1 for child in tree.children[bone]) > 1


def _continuation(skeleton: Skeleton, tree: BoneTree, bone: int) -> int | None:
    """The child with which a chain goes on; ``None`` at a tip and where chains part."""
    children = tree.children[bone]
    leading = [child for child in children if tree.heights[child] > 1]
    if leading:
        return leading[0] if len(leading) == 1 else None
    return _next_tip(skeleton, tree, bone, children)


def _next_tip(skeleton: Skeleton, tree: BoneTree, bone: int, tips: Iterable[int]) -> int | None:
    """Which of several childless bones is the chain's last one, and which are helpers.

    The chain's last bone begins where the chain leads to: at the tail of the bone before it, or
    (in imported rigs, whose tails lie anywhere) where the last segment's continuation ends.
    """
    head, tail = skeleton.heads[bone], skeleton.tails[bone]
    parent = tree.parents[bone]
    before = head - skeleton.heads[parent] if parent >= 0 else tail - head
    segment = float(np.linalg.norm(before)) or float(skeleton.lengths[bone])
    direction = (tail - head) / max(float(skeleton.lengths[bone]), 1e-12)

    def misfit(tip: int) -> float:
        gap = min(
            float(np.linalg.norm(skeleton.heads[tip] - tail)),
            float(np.linalg.norm(skeleton.heads[tip] - head - before)),
        )
        turn = 1.0 - float(np.dot(skeleton.rest_matrices[tip, :3, 1], direction))
        return gap / segment + 0.25 * turn - (1.0 if skeleton.connected[tip] else 0.0)

    ahead = [
        tip
        for tip in tips
        # A helper sits at the joint itself; the chain's next bone is a segment further on.
        if np.linalg.norm(skeleton.heads[tip] - head) > 0.3 * min(segment, skeleton.lengths[bone])
    ]
    return min(ahead, key=lambda tip: (misfit(tip), skeleton.names[tip]), default=None)


def _without_body(tree: BoneTree, bones: list[int]) -> list[int]:
    """A lone chain without the body it begins with: the bone most helpers (eyes, mantle) stand on.

    Where several arms part, the tree itself shows where the body ends; a single arm's chain runs
    on to the root bone.
    """
    standing = [len(tree.children[bone]) for bone in bones]
    most = max(standing)
    if most > 2 and standing.count(most) == 1:
        return bones[standing.index(most) + 1 :]
    return bones


def _without_offsets(skeleton: Skeleton, tree: BoneTree, bones: list[int]) -> list[int]:
    """A chain without helpers between its bones: those that begin where the next bone begins."""
    segments = np.linalg.norm(np.diff(skeleton.heads[bones], axis=0), axis=1)
    least = COINCIDENT * max(float(segments.sum()), 1e-12)
    kept = [
        bone
        for bone, segment in zip(bones, [*segments.tolist(), np.inf], strict=True)
        if segment > least
    ]
    if len(kept) < len(bones):
        # Then the last one may be such a helper as well, and its only child the chain's last bone.
        tips = tree.children[bones[-1]]
        offsets = np.linalg.norm(skeleton.heads[tips] - skeleton.heads[bones[-1]], axis=1)
        if len(tips) == 1 and offsets[0] <= least:
            kept[-1] = tips[0]
    return kept


def _without_twins(skeleton: Skeleton, chains: list[BoneChain]) -> list[BoneChain]:
    """Of chains lying over one another with different roles, those that best are the arm.

    Deform flags and weights have been used up by now. What is left to tell: keys have an effect
    on bones without constraints, and then the habits of control rigs' names. Chains of the same
    role all stay.
    """
    layers: dict[tuple[int, ...], list[BoneChain]] = {}
    for chain in chains:
        ends = skeleton.heads[[chain.bones[0], chain.bones[-1]]] / max(chain.length, 1e-12)
        key = (len(chain), *np.round(ends * 1e3).astype(int).ravel().tolist())
        layers.setdefault(key, []).append(chain)

    def role(chain: BoneChain) -> tuple[bool, int]:
        name = skeleton.names[chain.bones[0]]
        rank = 0 if name.upper().startswith("DEF") else 2 if is_control_name(name) else 1
        return any(skeleton.constrained[bone] for bone in chain.bones), rank

    return [
        chain
        for layer in layers.values()
        for best in [min(map(role, layer))]
        for chain in layer
        if role(chain) == best
    ]


def is_control_name(name: str) -> bool:
    """Whether control rigs use such a name for their inner works, not for the artist's bones."""
    return name.upper().startswith(_CONTROL_PREFIXES)


def _is_tip_marker(skeleton: Skeleton, bone: int) -> bool:
    """Whether it is the extra bone that some exporters put at the end of each chain."""
    parent = skeleton.parents[bone]
    if parent < 0 or skeleton.children[bone]:
        return False
    name, above = skeleton.names[bone].lower(), skeleton.names[parent].lower()
    return name.endswith(_TIP_MARKERS) and name.startswith(above)


def _length(skeleton: Skeleton, bones: Sequence[int]) -> float:
    """Length along the joints; the last bone, whose tail may lie anywhere, counts as the mean."""
    if len(bones) < 2:
        return float(skeleton.lengths[bones[0]])
    segments = np.linalg.norm(np.diff(skeleton.heads[list(bones)], axis=0), axis=1)
    return float(segments.sum() * len(bones) / len(segments))
