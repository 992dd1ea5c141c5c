# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bones of a rig become bodies of a puppet, and which only follow.

A rig has more bones than a body has limbs: helpers that spread a twist, targets and controls of
inverse kinematics, ends that importers add, bones of the face. They are no bodies. Such a bone
keeps its pose and follows whatever it hangs on, as it does in Blender anyway.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from ...errors import RigError
from ...phrases import phrase
from ...rotations import Floats
from ...skeleton import Skeleton
from .figure import distances_to_axes

BODY: Final = "BODY"
FOLLOW: Final = "FOLLOW"

SMALLEST: Final = 2e-3
"""Bones shorter than this share of the figure are helpers, whatever they are called."""

_TWIN: Final = 1e-3
"""Of the figure's size: joints closer than this are the same joint."""
_GAP: Final = 0.05
"""Of the figure's size: a limb that begins so close to another's end belongs to it."""

_HELPER_WORDS: Final = frozenset(
    {
        *("ik", "pole", "target", "ctrl", "control", "controller", "mch", "org", "vis", "twk"),
        *("twist", "roll", "helper", "corrective", "scalecompensation", "nub", "null", "leaf"),
        *("prop", "slot", "handslot", "socket", "attach", "weapon", "tweak", "end"),
        *("poletarget", "heelik", "handik", "footik", "kneeik", "elbowik", "effector"),
    }
)
_FACE_WORDS: Final = frozenset(
    {
        *("eye", "eyes", "eyeball", "eyelid", "lid", "brow", "eyebrow", "eyelash", "face"),
        *("jaw", "chin", "lip", "lips", "mouth", "tongue", "teeth", "tooth", "cheek", "nose"),
        *("nostril", "forehead", "temple", "oris", "oculi", "orbicularis", "levator"),
        *("risorius", "special", "pupil", "beak"),
    }
)
_WORD: Final = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


@dataclass(frozen=True, eq=False)
class Roles:
    """The bones that become bodies, and the tree they make."""

    bodies: tuple[int, ...]
    """Bones, parents before children."""
    parents: tuple[int, ...]
    """For each body the index among the bodies of the one it hangs on, −1 for a root."""
    carriers: tuple[int, ...]
    """For each body the body that carries its bone in Blender, −1 for none: the parent, but for
    bones that hang on the rig's root and on a limb only by their place."""
    follows: tuple[int, ...]
    """(bones,) for each bone the body that it belongs to or is carried by, −1 for none."""
    driven: tuple[int, ...] = ()
    """Bones that would be limbs, were they not moved by constraints or drivers."""


@dataclass(frozen=True, eq=False)
class RigFacts:
    """What is known of a rig's bones beyond the skeleton."""

    moved: frozenset[str] = frozenset()
    """Bones that constraints or drivers turn, so that keys of their own have little effect."""
    weights: Mapping[str, float] = field(default_factory=dict)
    """How much skin hangs on each bone; empty where there is no skin."""
    marks: Mapping[str, str] = field(default_factory=dict)
    """What the artist has decided: "BODY" or "FOLLOW" by bone."""
    locked: frozenset[str] = frozenset()
    """Bones whose rotation is locked about all axes."""
    smallest: float = SMALLEST
    """Share of the figure's size: shorter bones follow."""
    goals: frozenset[str] = frozenset()
    """Bones that inverse kinematics reach for or point at: controls, that hang on no limb."""
    followed: str = ""
    """Another armature that most of these follow."""
    carried: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """Of bones that something else moves, those that carry them as a parent would."""
    controls: Mapping[str, int] = field(default_factory=dict)
    """Where bones are posed through controls, and are limbs whatever else moves them: on how many
    controls each depends. Empty elsewhere."""


def find_roles(skeleton: Skeleton, facts: RigFacts, name: str = "The armature") -> Roles:
    """Tell bodies from helpers; ``name`` is the armature's, for messages.

    Bones that deform are bodies, or where something else moves these, their controls at the same
    joints. Helpers by name, by size or without skin are left out; what joins several limbs is put
    in again. A limb that hangs on the rig's root but begins where another ends (feet for inverse
    kinematics) hangs on that one.

    Raises:
        RigError: the skeleton has no size, or no bone is left.
    """
    size = diagonal(skeleton.heads, skeleton.tails)
    if not size > 0.0:
        raise RigError(phrase("'{name}' has no size.", name=name), "Repair its bones or its scale.")
    # A rig in which all bones bear names of helpers means something else by them.
    chosen, driven = _chosen(skeleton, facts, size)
    if not chosen:
        chosen, driven = _chosen(skeleton, facts, size, by_name=False)
    if not chosen:
        if facts.moved:
            raise RigError(
                phrase("Constraints or drivers move all limbs of '{name}'.", name=name),
                phrase("Pose '{other}', whose bones they follow.", other=facts.followed)
                if facts.followed
                else "Mute them, or bake the motion to keys.",
            )
        raise RigError(
            phrase("'{name}' has no bone that could be posed by hand.", name=name),
            "Mark bones as limbs in the panel Pose.",
        )
    tree = _tree(skeleton, facts, _joined(skeleton, facts, chosen, size), size)
    return replace(tree, driven=tuple(sorted(driven)))


def diagonal(heads: Floats, tails: Floats) -> float:
    """The diagonal of the box about bones (bones, 3)."""
    ends = np.concatenate([heads, tails])
    return float(np.linalg.norm(ends.max(axis=0) - ends.min(axis=0)))


def is_helper_name(name: str) -> bool:
    """Whether a bone's name is that of a helper, a control or a part of the face."""
    words = [word.lower() for word in _WORD.findall(name.rpartition(":")[2])]
    joined = "".join(words)
    return (
        any(word in _HELPER_WORDS or word in _FACE_WORDS for word in words)
        or "scalecompensation" in joined
        or joined.startswith("endsite")
    )


def _chosen(
    skeleton: Skeleton, facts: RigFacts, size: float, *, by_name: bool = True
) -> tuple[set[int], set[int]]:
    """Limbs, and bones that would be limbs if nothing else moved them."""
    skinned = {name for name, weight in facts.weights.items() if weight > 0.0}
    deforming = [bone for bone, deform in enumerate(skeleton.deform) if deform]
    if any(skeleton.names[bone] in skinned for bone in deforming):
        deforming = [bone for bone in deforming if skeleton.names[bone] in skinned]
    reach = _reaches(skeleton, skinned)
    found: set[int] = set()
    lost: set[int] = set()
    for bone in deforming or range(len(skeleton)):
        mark = facts.marks.get(skeleton.names[bone])
        name = skeleton.names[bone]
        driven = name in facts.moved
        # What is driven is locked in many rigs, so that nobody takes hold of it by mistake.
        locked = name in facts.locked and not (driven or facts.controls)
        if mark is not None or locked or name in facts.goals:
            continue
        if reach[bone] < max(facts.smallest, 1e-6) * size:
            continue
        # What deforms in Rigify's rigs begins with DEF; the rest of the name counts.
        if by_name and is_helper_name(name.removeprefix("DEF-")):
            continue
        if driven and not facts.controls:
            twin = _twin(skeleton, facts, bone, size)
            if twin is None:
                lost.add(bone)
            else:
                found.add(twin)
            continue
        found.add(bone)
    marked = {skeleton.index[each] for each, mark in facts.marks.items() if mark == BODY}
    left_out = {skeleton.index[each] for each, mark in facts.marks.items() if mark == FOLLOW}
    return (found | marked) - left_out, lost - marked - left_out


def _reaches(skeleton: Skeleton, skinned: set[str]) -> Floats:
    """How far each bone (bones,) reaches: to its tail, or the next joint where that is farther.

    Importers make tails up: of some files all bones are tiny. There the end of a limb counts by
    its skin.
    """
    reach = skeleton.lengths.copy()
    for bone, parent in enumerate(skeleton.parents):
        if parent < 0:
            continue
        way = float(np.linalg.norm(skeleton.heads[bone] - skeleton.heads[parent]))
        reach[parent] = max(reach[parent], way)
        if skeleton.names[bone] in skinned:
            reach[bone] = max(reach[bone], 0.5 * way)
    return reach


def _twin(skeleton: Skeleton, facts: RigFacts, bone: int, size: float) -> int | None:
    """The bone at the same joint that an artist moves in place of one that is driven."""
    apart = np.linalg.norm(skeleton.heads - skeleton.heads[bone], axis=1)
    along = skeleton.rest_matrices[:, :3, 1] @ skeleton.rest_matrices[bone, :3, 1]
    off = np.abs(skeleton.lengths - skeleton.lengths[bone])
    carriers = facts.carried.get(skeleton.names[bone], frozenset(skeleton.names))
    fitting = [
        other
        for other in np.flatnonzero((apart < _TWIN * size) & (along > 0.9)).tolist()
        if other != bone
        and skeleton.names[other] in carriers
        and skeleton.names[other] not in facts.moved | facts.locked
        and not is_helper_name(skeleton.names[other])
    ]
    return min(fitting, key=lambda other: off[other], default=None)


def _roots(skeleton: Skeleton, chosen: set[int]) -> list[int]:
    return [bone for bone in sorted(chosen) if not chosen & set(skeleton.ancestors(bone))]


def _end_nearby(skeleton: Skeleton, chosen: set[int], root: int, size: float) -> int | None:
    """The body at whose end the limb of a root begins, of another limb than its own."""
    others = [bone for bone in chosen if bone != root and root not in skeleton.ancestors(bone)]
    if not others:
        return None
    gaps = np.linalg.norm(skeleton.tails[others] - skeleton.heads[root], axis=1)
    nearest = int(np.argmin(gaps))
    return others[nearest] if gaps[nearest] < _GAP * size else None


def _joined(skeleton: Skeleton, facts: RigFacts, chosen: set[int], size: float) -> set[int]:
    """The bodies, and the bones that they need to hang together."""
    result = set(chosen)
    if facts.controls:
        # What carries their controls is no part of the body.
        return result
    while True:
        roots = _roots(skeleton, result)
        main = max(roots, key=lambda root: _limb_size(skeleton, result, root))
        loose = [
            root
            for root in roots
            if root == main or _end_nearby(skeleton, result, root, size) is None
        ]
        hub = _common_ancestor(skeleton, facts, loose) if len(loose) > 1 else None
        if hub is None:
            return _movable(skeleton, facts, result)
        result.add(hub)


def _movable(skeleton: Skeleton, facts: RigFacts, chosen: set[int]) -> set[int]:
    """A root that is connected to its parent cannot be moved but with it."""
    result = set(chosen)
    for root in _roots(skeleton, chosen):
        bone = root
        while skeleton.connected[bone] and skeleton.parents[bone] >= 0:
            bone = skeleton.parents[bone]
            if skeleton.names[bone] in facts.moved:
                break
            result.add(bone)
    return result


def _limb_size(skeleton: Skeleton, chosen: set[int], root: int) -> float:
    beneath = [bone for bone in chosen if bone == root or root in skeleton.ancestors(bone)]
    return float(skeleton.lengths[beneath].sum())


def _common_ancestor(skeleton: Skeleton, facts: RigFacts, bones: Sequence[int]) -> int | None:
    """The lowest bone that carries all of these and that nothing else moves."""
    paths = [skeleton.ancestors(bone) for bone in bones]
    for bone in paths[0]:
        free = skeleton.names[bone] not in facts.moved
        if free and all(bone in path for path in paths[1:]):
            return bone
    return None


def _tree(skeleton: Skeleton, facts: RigFacts, chosen: set[int], size: float) -> Roles:
    def carrier(bone: int) -> int:
        return next((each for each in skeleton.ancestors(bone) if each in chosen), -1)

    above = {bone: carrier(bone) for bone in chosen}
    roots = [bone for bone in sorted(chosen) if above[bone] < 0]
    if facts.controls:
        # No bone carries the others: the trunk hangs on the fewest controls.
        main = min(roots, key=lambda root: facts.controls.get(skeleton.names[root], 0))
    else:
        main = max(roots, key=lambda root: _limb_size(skeleton, chosen, root))
    hangs = dict(above)
    for root in roots:
        if root == main:
            continue
        mate = _end_nearby(skeleton, chosen, root, size)
        if mate is None or _leads_to(hangs, mate, root):
            free = {bone for bone in chosen if not _leads_to(hangs, bone, root)}
            mate = _nearest(skeleton, free, root)
        if mate is not None:
            hangs[root] = mate
    ordered = _parents_first(hangs)
    place = {bone: number for number, bone in enumerate(ordered)}
    place[-1] = -1
    follows = [place[bone if bone in chosen else carrier(bone)] for bone in range(len(skeleton))]
    return Roles(
        bodies=tuple(ordered),
        parents=tuple(place[hangs[bone]] for bone in ordered),
        carriers=tuple(place[above[bone]] for bone in ordered),
        follows=tuple(follows),
    )


def _nearest(skeleton: Skeleton, chosen: set[int], root: int) -> int | None:
    """The body that passes nearest to where a limb begins."""
    others = [bone for bone in chosen if root not in [bone, *skeleton.ancestors(bone)]]
    if not others:
        return None
    axes = np.stack([skeleton.heads[others], skeleton.tails[others]], axis=1)
    return others[int(np.argmin(distances_to_axes(axes, skeleton.heads[root])))]


def _leads_to(hangs: Mapping[int, int], bone: int, wanted: int) -> bool:
    while bone >= 0:
        if bone == wanted:
            return True
        bone = hangs[bone]
    return False


def _parents_first(hangs: Mapping[int, int]) -> list[int]:
    # A limb at a time: chains stay together.
    children: dict[int, list[int]] = {}
    for bone in sorted(hangs):
        children.setdefault(hangs[bone], []).append(bone)
    ordered: list[int] = []
    waiting = list(reversed(children.get(-1, [])))
    while waiting:
        bone = waiting.pop()
        ordered.append(bone)
        waiting.extend(reversed(children.get(bone, [])))
    return ordered
