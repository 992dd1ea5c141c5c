# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding the chains of bones that are arms, on whatever armature an artist brings.

1. Bones that move the mesh are looked at: those with the deform flag and a vertex group; without
   vertex groups the deform flag alone, without that all bones. They form a tree, other bones
   between them skipped; chains are its branches that end in a tip, but for those that are named
   after another part of a body.
2. Arms are a family of such chains: alike in bones and length, long compared with the rest of the
   rig, springing from one place.
3. Where constraints move those, the control bones at the same joints take their place.
4. Names and symmetry tell which way the body faces; sides and pairs follow.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...errors import RigError
from ...phrases import phrase
from ...rotations import Floats, normalized
from ...skeleton import Skeleton, median
from .arm_chains import (
    AXES,
    COINCIDENT,
    LEAST_BONES,
    MOST_ARMS,
    MOST_BONES,
    ArmChain,
    BodyFrame,
    arm_shapes,
    arrange,
    body_frame,
    body_rotation,
    is_driven,
    joint_positions,
    mirror_distances,
    name_side,
    nearest_axis,
)

REMEDY: Final = "Select the bones of one arm, root to tip, and click + beside the list."

_TIP_MARKERS: Final = ("_end", ".end", "_nub", "nub", "_leaf", "_endsite")
_NUMBERED: Final = re.compile(r"(.+)[._]\d+")
_OTHER_PARTS: Final = frozenset(
    {"antenna", "antennae", "beak", "ear", "ears", "eye", "eyes", "eyestalk", "fin", "fins"}
    | {"funnel", "hair", "hat", "head", "hyponome", "jaw", "mantle", "mouth", "neck", "siphon"}
    | {"spine", "syphon", "tail", "tongue", "web", "webbing"}
)
"""What bones of other parts of a body are called …"""
_ARM_WORD: Final = re.compile(r"arm|feeler|leg|limb|tentac")
"""… unless this is in their names, too: arms of the head."""
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
    # Importers give vertex groups to all bones of a file, to these as well.
    for members in (weighted - tips, weighted, deforming - tips, set(numbers) - tips):
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
            phrase(
                "No arms were found: the chain of {longest} bones has more than {most_bones}.",
                longest=longest,
                most_bones=MOST_BONES,
            ),
            REMEDY,
        )
    raise RigError(
        phrase(
            "No arms were found: no {least_bones} bones form a chain with a free tip.",
            least_bones=LEAST_BONES,
        ),
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
    if name.endswith(_TIP_MARKERS):
        return name.startswith(above)
    # Some programs put a number behind all names.
    bare, upper = (_NUMBERED.fullmatch(each) for each in (name, above))
    return (
        bare is not None
        and upper is not None
        and bare[1].endswith(_TIP_MARKERS)
        and bare[1].startswith(upper[1])
    )


def without_other_parts(
    skeleton: Skeleton, tree: BoneTree, chains: list[BoneChain]
) -> tuple[BoneTree, list[BoneChain]]:
    """A rig without the chains most of whose bones are named after a part of a body that is no arm.

    A mantle that lies back is as long as the arms and springs from where they do; fins, stalks of
    eyes and webs even come in pairs. Where no chain has another name, none is an arm.
    """
    others = [chain for chain in chains if _is_named_after_other_part(skeleton, chain)]
    bones = {bone for chain in others for bone in chain.bones}
    if not bones:
        return tree, chains
    left = _tree_of(skeleton, set(tree.members) - bones)
    return left, [chain for chain in chains if bones.isdisjoint(chain.bones)]


def _is_named_after_other_part(skeleton: Skeleton, chain: BoneChain) -> bool:
    count = 0
    for bone in chain.bones:
        # Words apart: LeftEye_01 is left and eye.
        name = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", skeleton.names[bone]).lower()
        words = set(re.findall(r"[a-z]+", name))
        count += not words.isdisjoint(_OTHER_PARTS) and _ARM_WORD.search(name) is None
    return 2 * count > len(chain)


def _length(skeleton: Skeleton, bones: Sequence[int]) -> float:
    """Length along the joints; the last bone, whose tail may lie anywhere, counts as the mean."""
    if len(bones) < 2:
        return float(skeleton.lengths[bones[0]])
    segments = np.linalg.norm(np.diff(skeleton.heads[list(bones)], axis=0), axis=1)
    return float(segments.sum() * len(bones) / len(segments))


# --- Which chains of a rig are the arms of one body, and which are limbs, fingers or a tail -------
#
# Arms are alike in bones and length, long compared with the rest of the rig, and spring from one
# place. A rig with a second set of limbs somewhere else (arms *and* legs, hands with fingers) is a
# body with a skeleton, not an octopus.


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
    """The largest family of chains, ending in a tip of the tree, that passes for the arms of one
    body.

    Up is the name of the armature's axis that is the body's.

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
    odd = np.flatnonzero(np.abs(elevations - median(elevations)) > np.radians(60.0))
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
    distance = median(np.linalg.norm(skeleton.heads[others] - center, axis=1))
    return bool(distance <= _LARGEST_REST * _typical_length(family))


def _stands_off_one_body(tree: BoneTree, family: tuple[BoneChain, ...]) -> bool:
    """Whether no chain springs from further down the spine than another, or many of a kind do."""
    attachments = {chain.attachment for chain in family} - {-1}
    for attachment in attachments:
        above = tree.parents[attachment]
        while above >= 0:
            if above in attachments:
                counts = [len(chain) for chain in family]
                of_a_kind = max(counts) - min(counts) <= 1
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
    return median(np.array([chain.length for chain in family]))


# Arm lengths: how far mirror images may lie apart, on average, for a rig to be symmetric.
_SYMMETRIC: Final = 0.05
# Arm lengths: how far an arm may lean out and still count as upright.
_UPRIGHT: Final = 1e-3


@dataclass(frozen=True)
class Detection:
    """What was found on an armature."""

    arms: tuple[ArmChain, ...]
    body: BodyFrame
    root_bone: str
    """The bone that carries the whole body, "" if there is none."""
    up: str
    """Armature axis that is the body's up, such as "Z"."""
    front: str
    """Armature axis that the body faces, such as "-Y"."""
    notes: tuple[str, ...] = ()
    """Sentences that the artist should read."""


def detect_arms(
    skeleton: Skeleton,
    world_up: Floats,
    world_front: Floats,
    *,
    up: str | None = None,
    front: str | None = None,
) -> Detection:
    """The arms of an octopus, or of anything built like one.

    Where constraints move the arms that deform, and the rig has control bones at the same joints,
    the arms are the control bones: what the artist keys.

    Args:
        skeleton: the rig.
        world_up: (3,) the world's up (+Z), in armature space.
        world_front: (3,) where a character faces (the world's −Y), in armature space.
        up: axis of the armature that is the body's up, if the artist has said so.
        front: axis of the armature that the body faces, if the artist has said so. Else it is
            read from bone names and from the symmetry of the arms, and is ``world_front`` where
            they do not tell.

    Raises:
        RigError: nothing on the armature looks like arms, or front and up lie on one axis.
    """
    if up is None:
        up = nearest_axis(world_up, across=front)
    elif front is not None:
        body_rotation(up, front)  # raises where they lie on one axis
    tree, chains = candidate_chains(skeleton)
    family = best_family(skeleton, *without_other_parts(skeleton, tree, chains), up)
    if len(family) > MOST_ARMS:
        raise RigError(
            phrase(
                "{count} chains could be arms, and {most_arms} is the most.",
                count=len(family),
                most_arms=MOST_ARMS,
            ),
            REMEDY,
        )
    deforming = [tuple(skeleton.names[bone] for bone in chain.bones) for chain in family]
    arms, notes = _keyable(skeleton, deforming)
    if front is None:
        usual = nearest_axis(world_front, across=up)
        front, reason = _facing(skeleton, arms, up, usual)
        notes += reason
    body = body_frame(skeleton, arms, up, front)
    notes += _unclear_directions(skeleton, arms, body)
    return Detection(
        arms=arrange(skeleton, arms, body),
        body=body,
        root_bone=_root_bone(skeleton, tree, family),
        up=up,
        front=front,
        notes=tuple(notes),
    )


def control_chain(skeleton: Skeleton, bones: Sequence[str]) -> tuple[str, ...]:
    """The chain that an animator keys where constraints move the arm: its free twin, or ``()``.

    Control rigs lay several chains over one another: one that deforms, one or more that carry
    constraints, and one for the animator. The last is the one of the same joints whose root is
    not constrained, with as few constrained bones as there are.

    Raises:
        RigError: a bone does not exist.
    """
    joints = joint_positions(skeleton, bones)
    reach = float(np.linalg.norm(np.diff(joints, axis=0), axis=1).sum())
    own = set(bones)

    def at(joint: Floats, candidates: Sequence[int]) -> list[int]:
        distances = np.linalg.norm(skeleton.heads[list(candidates)] - joint, axis=1)
        near = (distances < COINCIDENT * reach).tolist()
        return [
            bone
            for bone, is_near in zip(candidates, near, strict=True)
            if is_near and skeleton.names[bone] not in own
        ]

    roots = at(joints[0], range(len(skeleton)))
    twins = [[root] for root in roots if not skeleton.constrained[root]]
    for joint in joints[1:-1]:
        # A child at the next joint that itself leads on; a tweak bone sits there alone.
        twins = [[*twin, bone] for twin in twins for bone in at(joint, skeleton.children[twin[-1]])]
    if not twins:
        return ()
    best = min(
        twins,
        key=lambda twin: (
            sum(skeleton.constrained[bone] for bone in twin),
            is_control_name(skeleton.names[twin[0]]),
            -float(skeleton.lengths[twin].sum()),
            skeleton.names[twin[0]],
        ),
    )
    return tuple(skeleton.names[bone] for bone in best)


def _root_bone(skeleton: Skeleton, tree: BoneTree, family: tuple[BoneChain, ...]) -> str:
    """The topmost bone that carries all that deforms and that keys can move."""
    arms = {bone for chain in family for bone in chain.bones}
    carried = [0] * len(skeleton)
    for bone in tree.members:
        carried[bone] = 1
    for bone in reversed(range(len(skeleton))):
        if skeleton.parents[bone] >= 0:
            carried[skeleton.parents[bone]] += carried[bone]
    for bone in range(len(skeleton)):
        if (
            carried[bone] == len(tree.members)
            and bone not in arms
            and not skeleton.constrained[bone]
        ):
            return skeleton.names[bone]
    return ""


def _keyable(
    skeleton: Skeleton, deforming: list[tuple[str, ...]]
) -> tuple[list[tuple[str, ...]], list[str]]:
    """Each arm's bones that keys can move, and what the artist should know about them."""
    arms: list[tuple[str, ...]] = []
    exchanged = held = 0
    further: set[str] = set()
    for bones in deforming:
        controls = control_chain(skeleton, bones) if is_driven(skeleton, bones) else ()
        arms.append(controls or bones)
        if controls:
            exchanged += 1
            further.update(bone for bone in controls if is_driven(skeleton, [bone]))
        else:
            held += is_driven(skeleton, bones)
    notes: list[str] = []
    if exchanged:
        example = next(bones[0] for bones in arms if bones not in deforming)
        notes.append(
            phrase(
                "Constraints move the bones that deform {arms}: the list has the control bones "
                "at the same joints ('{example}' …).",
                arms=_arms(exchanged),
                example=example,
            )
        )
    if further:
        notes.append(
            phrase(
                "{count} of these have constraints of their own ('{example}' …): mute those if "
                "the arms bend more than they should.",
                count=len(further),
                example=min(further),
            )
        )
    if held:
        notes.append(
            phrase(
                "Constraints or drivers move {arms}, and no control bones were found: keys have "
                "no effect while the constraints are on.",
                arms=_arms(held),
            )
        )
    return arms, notes


def _arms(number: int) -> str:
    return phrase("1 arm") if number == 1 else phrase("{number} arms", number=number)


def _facing(
    skeleton: Skeleton, arms: list[tuple[str, ...]], up: str, usual: str
) -> tuple[str, list[str]]:
    """The axis that the body faces, and the reason where it is not the usual one."""
    rotation = body_rotation(up, usual)
    shapes = arm_shapes(skeleton, arms, BodyFrame(np.zeros(3), rotation))
    shapes -= shapes[:, :1].mean(axis=0)
    # Where the arms lie, (arms, 2) towards the usual left and back.
    places = (shapes.mean(axis=1) + shapes[:, -1] - shapes[:, 0])[:, :2]

    signs = [{"LEFT": 1.0, "RIGHT": -1.0, None: 0.0}[name_side(bones[0])] for bones in arms]
    if len(set(signs) - {0.0}) == 2:
        left = signs @ places
        sideways, along = float(left[0]), float(left[1])
        if sideways >= 0.5 * float(np.hypot(sideways, along)):
            return usual, []
        axis = nearest_axis(rotation[:, :2] @ left, across=up)
        # What lies to the left of the front: front = left × up.
        front = nearest_axis(np.cross(np.array(AXES[axis], float), np.array(AXES[up], float)))
        return front, [
            phrase(
                "The bones named left lie towards {axis}: Front was set to {front}.",
                axis=axis,
                front=front,
            )
        ]

    if len(arms) > 2:
        across = mirror_distances(shapes, axis=0).min(axis=1).mean()
        lengthwise = mirror_distances(shapes, axis=1).min(axis=1).mean()
        if lengthwise < _SYMMETRIC and across > 3.0 * lengthwise:
            # The rest of the body is where the arms are not.
            ahead = 1.0 if places[:, 0].mean() >= 0.0 else -1.0
            front = nearest_axis(ahead * rotation[:, 0])
            axis = front.removeprefix("-")
            reason = phrase(
                "The arms mirror each other across {axis}: Front was set to {front}. Change "
                "it and detect again if the body faces the other way.",
                axis=axis,
                front=front,
            )
            return front, [reason]
    return usual, []


def _unclear_directions(
    skeleton: Skeleton, arms: list[tuple[str, ...]], body: BodyFrame
) -> list[str]:
    """What to say of arms whose side cannot be told, because they stand on the body's axis."""
    shapes = arm_shapes(skeleton, arms, body)
    upright = int(np.sum(np.linalg.norm(shapes[..., :2], axis=-1).max(axis=1) < _UPRIGHT))
    if not upright or len(arms) == 1:
        return []
    who = phrase("1 arm stands") if upright == 1 else phrase("{number} arms stand", number=upright)
    note = phrase(
        "{who} upright in the middle of the body: sides and pairs cannot be told from the rest "
        "pose; set them by hand.",
        who=who,
    )
    return [note]
