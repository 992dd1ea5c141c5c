# SPDX-License-Identifier: GPL-3.0-or-later
"""A humanoid by the names of its bones.

Limbs are the sequences that fit names and lengths best, the trunk is what carries them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ...rotations import Floats
from ...skeleton import Skeleton
from .landmarks import BoneName

ARM: Final = ("clavicle", "upper_arm", "forearm", "hand")
LEG: Final = ("thigh", "shin", "foot", "toe")
OPTIONAL_PARTS: Final = frozenset({"clavicle", "toe"})

_LEAST_WEIGHT: Final = 0.12
"""Below, a name says nothing."""

_SURELY: Final = 0.5
"""Weight of a name that leaves little doubt."""

_ON_THE_MIDDLE: Final = 0.012
_NEAR_IT: Final = 0.05
"""Of a body's size: how far bones of the middle lie beside it, as they should and at most."""


@dataclass(frozen=True, eq=False)
class BodyProportions:
    """A skeleton with what its names say, and its mid plane as far as names tell."""

    skeleton: Skeleton
    names: tuple[BoneName, ...]
    sides: tuple[str, ...]
    """Side of each bone: its own, else that of the nearest ancestor that has one."""
    size: float
    """Diagonal of the box around the body, armature units."""
    left: Floats | None
    """(3,) unit vector to the side whose bones are named left; none without such names."""
    middle: Floats
    """(3,) a point of the mid plane."""

    def common_ancestor(self, bones: Sequence[int]) -> int | None:
        """The lowest bone that is or carries all of these."""
        first, *others = ([bone, *self.skeleton.ancestors(bone)] for bone in bones)
        return next((bone for bone in first if all(bone in chain for chain in others)), None)

    def between(self, pairs: Sequence[Sequence[int]]) -> BodyProportions:
        """The same with the mid plane between pairs of bones, left and right."""
        left, right = self.skeleton.heads[np.array(pairs).T]
        across = (left - right).sum(axis=0)
        length = float(np.linalg.norm(across))
        axis = across / length if length > 1e-6 * self.size else None
        return replace(self, left=axis, middle=(0.5 * (left + right)).mean(axis=0))

    def weight(self, bone: int, part: str) -> float:
        """How well a bone's name fits a landmark without side, 0…1."""
        return self.names[bone].weights.get(part, 0.0)

    def off_middle(self, bone: int) -> float:
        """Distance of a bone's head from the mid plane, as a share of the body's size."""
        if self.left is None:
            return 1.0
        return abs(float((self.skeleton.heads[bone] - self.middle) @ self.left)) / self.size


def body_of(skeleton: Skeleton, names: tuple[BoneName, ...]) -> BodyProportions:
    """Size, sides and mid plane of a skeleton."""
    sides: list[str] = []
    for name, parent in zip(names, skeleton.parents, strict=True):
        sides.append(name.side or (sides[parent] if parent >= 0 else ""))
    heads = skeleton.heads[[not each.machinery for each in names]]
    if len(heads) < 2:
        heads = skeleton.heads
    size = float(np.linalg.norm(np.ptp(heads, axis=0))) or 1.0
    stems: dict[tuple[str, str], int] = {}
    for bone, name in enumerate(names):
        if name.side:
            stems.setdefault((name.side, name.stem), bone)
    pairs = [
        (bone, stems["R", stem])
        for (side, stem), bone in stems.items()
        if side == "L" and ("R", stem) in stems
    ]
    body = BodyProportions(skeleton, names, tuple(sides), size, None, heads.mean(axis=0))
    return body.between(pairs) if pairs else body


def find_limb(
    body: BodyProportions, parts: tuple[str, ...], side: str
) -> tuple[dict[str, int], dict[str, list[int]]]:
    """The bones of a limb by what their names say, and those that may as well be hand or toe.

    Of all ways to choose one bone for each part, the one with the best sum of the names' weights
    and of how well neighbours follow one another, found by dynamic programming.
    """
    candidates = {
        part: {
            bone: weight
            for bone in range(len(body.skeleton))
            if body.sides[bone] == side and (weight := _fit(body, bone, part)) > _LEAST_WEIGHT
        }
        for part in parts
    }
    chosen = _best_sequence(body, {part: each for part, each in candidates.items() if each})
    rivals: dict[str, list[int]] = {}
    for part in ("hand", "toe"):
        if part not in chosen:
            continue
        bone = chosen[part]
        rivals[part] = [
            other
            for other, weight in candidates[part].items()
            if weight >= candidates[part][bone] and _are_beside(body, bone, other)
        ]
        if part == "hand" and rivals[part] and "forearm" in chosen:
            chosen[part] = _straightest(body, chosen["forearm"], [bone, *rivals[part]])
    if {"foot", "toe"} <= chosen.keys():
        chosen["toe"] = _ball(body, chosen["foot"], chosen["toe"])
    return chosen, {part: others for part, others in rivals.items() if others}


def _ball(body: BodyProportions, foot: int, toe: int) -> int:
    """Where a foot rolls: "ankle → foot → toe" begins its foot there, where toes are at its tip."""
    path = body.skeleton.ancestors(toe)
    between = path[: path.index(foot)] if foot in path else []
    heads = body.skeleton.heads
    reach = float(np.linalg.norm(heads[toe] - heads[foot]))
    return next(
        (
            bone
            for bone in between
            if body.weight(bone, "foot") > _SURELY
            and float(np.linalg.norm(heads[bone] - heads[foot])) > _SURELY * reach
        ),
        toe,
    )


def _are_beside(body: BodyProportions, one: int, other: int) -> bool:
    """Whether two bones hang on the same limb, but neither on the other."""
    return (
        one != other
        and body.names[one].layer == body.names[other].layer
        and one not in body.skeleton.ancestors(other)
        and other not in body.skeleton.ancestors(one)
        and bool(set(body.skeleton.ancestors(one)[:2]) & set(body.skeleton.ancestors(other)[:2]))
    )


def _straightest(body: BodyProportions, before: int, bones: Sequence[int]) -> int:
    """The bone whose far end deviates least from the one before it."""
    skeleton = body.skeleton
    along = skeleton.heads[list(bones)].mean(axis=0) - skeleton.heads[before]

    def deviation(bone: int) -> float:
        children = skeleton.children[bone]
        tip = skeleton.heads[list(children)].mean(axis=0) if children else skeleton.tails[bone]
        way = tip - skeleton.heads[before]
        return -float(way @ along) / max(float(np.linalg.norm(way)), 1e-12)

    return min(bones, key=deviation)


def _fit(body: BodyProportions, bone: int, part: str) -> float:
    """Weight of a bone for a part by its own name and place."""
    weight = body.weight(bone, part)
    if weight == 0.0:
        return 0.0
    if body.skeleton.constrained[bone]:
        # Keys have no effect on it; there is another one that moves it.
        weight -= 0.3 * weight
    parent = body.skeleton.parents[bone]
    if _leads_to_its_own(body.skeleton, bone):
        # "__Clavicle → Clavicle": the first one bridges the gap to the joint.
        weight *= 0.6
    elif (
        parent >= 0
        and body.weight(parent, part) >= body.weight(bone, part)
        and not _leads_to_its_own(body.skeleton, parent)
    ):
        # "upperarm01 → upperarm02": the first one is the joint.
        weight -= 0.1 * weight
    if part in {"upper_arm", "thigh"} and body.off_middle(bone) < 0.005:
        # A limb starts beside the mid plane: "hip joint" bones lie on it.
        weight *= 0.3
    if part == "clavicle" and body.off_middle(bone) < 0.005:
        # So does a collar bone, where there are two in a row.
        weight *= 0.85
    return weight


def _leads_to_its_own(skeleton: Skeleton, bone: int) -> bool:
    """Whether a bone is called as its child is, but for underscores in front."""
    name = skeleton.names[bone]
    bare = name.lstrip("_")
    return bare != name and any(skeleton.names[each] == bare for each in skeleton.children[bone])


def _best_sequence(
    body: BodyProportions, candidates: Mapping[str, Mapping[int, float]]
) -> dict[str, int]:
    best: dict[tuple[str, int], tuple[float, dict[str, int]]] = {}
    for part, bones in candidates.items():
        following: dict[tuple[str, int], tuple[float, dict[str, int]]] = {}
        for bone, weight in bones.items():
            options = [(weight, {part: bone})]
            options += [
                (
                    score + weight + _follows(body, before, bone, chain) - _left_out(last, part),
                    {**chain, part: bone},
                )
                for (last, before), (score, chain) in best.items()
                if bone not in chain.values()
            ]
            following[part, bone] = max(options, key=lambda option: option[0])
        # A part may be left out: chains that end before stay in the race.
        best |= following
    if not best:
        return {}
    return max(best.values(), key=lambda option: option[0])[1]


def _left_out(before: str, part: str) -> float:
    """What it costs to leave out parts that every body has between two."""
    parts = ARM if part in ARM else LEG
    between = parts[parts.index(before) + 1 : parts.index(part)]
    return 0.5 * sum(each not in OPTIONAL_PARTS for each in between)


def _follows(body: BodyProportions, before: int, bone: int, chain: Mapping[str, int]) -> float:
    """How well a bone follows the one before it in the limb; 0.2 at best."""
    skeleton = body.skeleton
    part = next(name for name, each in chain.items() if each == before)
    gap = float(np.linalg.norm(skeleton.heads[bone] - skeleton.heads[before]))
    score = -_unevenness(body, before, chain, gap) if part in {"forearm", "shin"} else 0.0
    if body.names[bone].layer != body.names[before].layer:
        score -= 0.3
    if part != "clavicle" and gap < 0.01 * body.size:
        score -= 1.0
    if skeleton.parents[bone] == before:
        return score + 0.2
    if before in body.skeleton.ancestors(bone):
        return score + 0.2 - _skipped(body, before, bone, part, gap)
    near = 0.05 * body.size + 0.2 * skeleton.lengths[before]
    if float(np.linalg.norm(skeleton.heads[bone] - skeleton.tails[before])) < near:
        # The rig moves it by constraints: feet and hands of IK rigs.
        return score - 0.3
    return score - (0.5 if _continues(body, before, bone, chain) else 2.0)


def _upper(before: int, chain: Mapping[str, int]) -> int | None:
    """The bone at which the upper part of a limb begins, if the lower one begins at ``before``."""
    uppers = (chain[part] for part in ("upper_arm", "thigh") if part in chain)
    return next((bone for bone in uppers if bone != before), None)


def _continues(body: BodyProportions, before: int, bone: int, chain: Mapping[str, int]) -> bool:
    """Whether a bone lies where the lower part of a limb would end, about as long as the upper."""
    start = _upper(before, chain)
    if start is None:
        return False
    heads = body.skeleton.heads
    upper, lower = heads[before] - heads[start], heads[bone] - heads[before]
    lengths = float(np.linalg.norm(upper)), float(np.linalg.norm(lower))
    straight = float(upper @ lower) > 0.5 * lengths[0] * lengths[1]
    return straight and 0.6 * lengths[0] < lengths[1] < 1.7 * lengths[0]


def _unevenness(body: BodyProportions, before: int, chain: Mapping[str, int], gap: float) -> float:
    """What it costs if the two long parts of a limb are of very different lengths."""
    start = _upper(before, chain)
    if start is None:
        return 0.0
    upper = float(np.linalg.norm(body.skeleton.heads[before] - body.skeleton.heads[start]))
    least = 0.01 * body.size
    return min(1.0, 0.3 * abs(float(np.log(max(gap, least) / max(upper, least)))))


def _skipped(body: BodyProportions, before: int, bone: int, part: str, gap: float) -> float:
    """What it costs to leave out the bones between two: the more, the longer they are."""
    heads = body.skeleton.heads
    cost = 0.0
    child = bone
    for between in body.skeleton.ancestors(bone):
        if between == before:
            break
        name = body.names[between]
        step = float(np.linalg.norm(heads[child] - heads[between])) / max(gap, 1e-9)
        if not name.machinery:
            # Another bone of the same part is no loss: "DEF-thigh → DEF-thigh.001".
            alike = name.weights.get(part, 0.0) / max(body.weight(before, part), 1e-9)
            cost += min(step, 1.0) * (1.0 - min(alike, 1.0))
        child = between
    return cost * (0.3 if part in {"clavicle", "foot"} else 2.0)


# --- Hips, spine, chest, neck and head of a humanoid, between limbs that are known ----------------


_NEAR_THE_LEGS: Final = 0.9
"""How far the hips may lie from the middle of the thighs' heads, in lengths of a thigh."""


def find_trunk(
    body: BodyProportions, thighs: Sequence[int], shins: Sequence[int], shoulders: Sequence[int]
) -> dict[str, int]:
    """The bones of the trunk between limbs, left and right each; shoulders are clavicles or upper
    arms.
    """
    head = _named(body, "head")
    if head is None:
        head = _end_of_middle(body, thighs, shoulders)
    if head is None:
        return {}
    found = {"head": head}
    chest = _carrier(body, [*shoulders, head], "chest")
    neck = None
    if chest is not None and body.weight(chest, "neck") > _SURELY:
        # Some programs hang collar bones on the neck: what it stands on is the chest all the same.
        above = [bone for bone in body.skeleton.ancestors(chest) if _is_free(body, bone)]
        if len(above) > 1 and head != chest:
            neck, chest = chest, above[0]
    if chest is not None:
        found["chest"] = chest
    hips = _hips(body, thighs, shins, head if chest is None else chest)
    if hips is not None:
        found["hips"] = hips
    if hips is None or chest is None:
        return found
    # "Body → Hips → Abdomen": what is named after the pelvis does not bend the trunk.
    bending = [bone for bone in _between(body, hips, chest) if body.weight(bone, "hips") < 1.0]
    if bending:
        found["spine"] = bending[0]
    necks = _between(body, chest, head) if neck is None else [neck]
    if necks:
        named = (bone for bone in necks if body.weight(bone, "neck") > _SURELY)
        found["neck"] = next(named, necks[0])
    return found


def _hips(
    body: BodyProportions, thighs: Sequence[int], shins: Sequence[int], upper: int
) -> int | None:
    """The bone that carries legs and trunk, if it is at the pelvis; else the one so named."""
    heads = body.skeleton.heads
    middle = heads[list(thighs)].mean(axis=0)
    length = float(np.linalg.norm(heads[list(thighs)] - heads[list(shins)], axis=1).mean())
    carrier = _carrier(body, [*thighs, upper], "hips")
    if carrier is not None and np.linalg.norm(heads[carrier] - middle) < _NEAR_THE_LEGS * length:
        return carrier
    carriers = {bone for thigh in thighs for bone in body.skeleton.ancestors(thigh)}
    named = [
        bone
        for bone in sorted(carriers)
        if body.weight(bone, "hips") >= 0.7 and not body.sides[bone]
    ]
    return max(named, key=lambda bone: body.weight(bone, "hips"), default=None)


def _carrier(body: BodyProportions, bones: Sequence[int], part: str) -> int | None:
    """The lowest bone that carries all of these and that keys can move."""
    shared = body.common_ancestor(bones)
    if shared is None:
        return _named(body, part)
    above = body.skeleton.ancestors(shared)
    chain = above if shared in bones else [shared, *above]
    return next((bone for bone in chain if _is_free(body, bone)), None)


def _is_free(body: BodyProportions, bone: int) -> bool:
    """Whether an artist moves it: no machinery, nothing that follows another bone."""
    return not (
        body.names[bone].machinery
        or body.names[bone].layer == "org"
        or body.skeleton.constrained[bone]
    )


def _between(body: BodyProportions, lower: int, upper: int) -> list[int]:
    """The free bones between two, from the lower one up."""
    chain = body.skeleton.ancestors(upper)
    if lower not in chain:
        return []
    between = chain[: chain.index(lower)][::-1]
    free = [bone for bone in between if _is_free(body, bone)]
    # In some rigs the neck itself is called a twist bone.
    return free or between


def _named(body: BodyProportions, part: str) -> int | None:
    """The bone of the middle whose name says it is this part, the first one down the tree."""
    best: int | None = None
    most = 0.5
    for bone, side in enumerate(body.sides):
        weight = 0.0 if side else body.weight(bone, part)
        if body.skeleton.constrained[bone]:
            weight *= 0.7
        if weight > most + 1e-9:
            best, most = bone, weight
    return best


def _end_of_middle(
    body: BodyProportions, thighs: Sequence[int], shoulders: Sequence[int]
) -> int | None:
    """The last bone of the row that goes up from between the shoulders, where none is named."""
    skeleton = body.skeleton
    start = body.common_ancestor(shoulders)
    if start is None:
        return None
    up = skeleton.heads[start] - skeleton.heads[list(thighs)].mean(axis=0)
    step = 0.005 * body.size * float(np.linalg.norm(up))
    carriers = {bone for each in shoulders for bone in (each, *skeleton.ancestors(each))}
    row: list[int] = []
    bone = start
    while True:
        children = [
            child
            for child in skeleton.children[bone]
            if child not in carriers
            and not body.sides[child]
            and not body.names[child].machinery
            and _goes_up(skeleton, child, up)
            # A face starts within the head.
            and (not row or float((skeleton.heads[child] - skeleton.heads[bone]) @ up) > step)
        ]
        # In a motion, a neck may be off the middle for a while.
        if len(children) > 1:
            near = [child for child in children if body.off_middle(child) < _ON_THE_MIDDLE]
            children = near or [child for child in children if body.off_middle(child) < _NEAR_IT]
        if len(children) != 1:
            break
        bone = children[0]
        row.append(bone)
    return row[-1] if row else None


def _goes_up(skeleton: Skeleton, bone: int, up: Floats) -> bool:
    """Whether a bone leads on: jaw and hair turn back."""
    children = skeleton.children[bone]
    if points_to_its_end(skeleton, skeleton.parents[bone], bone):
        return float(skeleton.rest_matrices[bone][:3, 1] @ up) > 0.0
    if not children:
        return True
    way = skeleton.heads[list(children)].mean(axis=0) - skeleton.heads[bone]
    return float(way @ up) >= 0.0


def points_to_its_end(skeleton: Skeleton, bone: int, child: int) -> bool:
    """Whether a bone's own Y axis leads to the next one, as Blender draws it: in files of other
    programs it may lie anyhow.
    """
    way = skeleton.heads[child] - skeleton.heads[bone]
    along = float(way @ skeleton.rest_matrices[bone][:3, 1])
    return along > 0.9 * float(np.linalg.norm(way)) > 0.0
