# SPDX-License-Identifier: GPL-3.0-or-later
"""A humanoid by its shape alone: two pairs of limbs that mirror each other, and a head.

Only distances along the bones and the tree of parents count, so the skeleton may stand, lie or
hang in any rest pose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Final

import numpy as np

from ...phrases import phrase
from ...skeleton import Skeleton
from .landmarks import BoneName

_ALIKE: Final = 0.15
"""Relative difference of length between a limb and its mirror image."""

_LONG: Final = 0.45
"""Least length of a limb, in those of the longest one."""

_MOST_LIMBS: Final = 2

_SKIPPED: Final = (0.05, 0.25)
"""What a joint within a long part of a limb costs where the limb goes straight on (twist bones),
and where it bends: 0.22 is a part 25 % longer than the other."""

_TOGETHER: Final = 0.5
"""What it costs that left and right limb start at the same place."""

_FORK: Final = 0.3
"""What it is worth that a limb ends where it forks into fingers."""

_FEWEST_BONES: Final = 15
_PAIRS: Final = {0: phrase("no pair"), 1: phrase("one pair")}
"""Hips, chest, head, and four limbs of three."""


@dataclass(frozen=True)
class Shape:
    """What the shape tells. The first limb of each pair is on one side, the second on the other."""

    arms: tuple[Mapping[str, int], ...] = ()
    legs: tuple[Mapping[str, int], ...] = ()
    trunk: Mapping[str, int] = field(default_factory=dict)
    """"hips", "chest" and "head"."""
    problem: str = ""


@dataclass(frozen=True, eq=False)
class _Tree:
    skeleton: Skeleton
    reach: tuple[float, ...]
    """Length of the longest way from each bone's head to the end of a chain."""
    next: tuple[int, ...]
    """The child on that way, −1 at its end."""

    def path(self, bone: int) -> list[int]:
        found = [bone]
        while self.next[found[-1]] >= 0:
            found.append(self.next[found[-1]])
        return found


def shape_of(skeleton: Skeleton, names: Sequence[BoneName]) -> Shape:
    """Limbs and trunk, or why there are none."""
    if len(skeleton) < _FEWEST_BONES:
        return Shape(
            problem=phrase("This is no humanoid: it has {count} bones.", count=len(skeleton))
        )
    tree = _tree(skeleton, names)
    longest = max(tree.reach, default=0.0)
    forks = {
        bone: pairs
        for bone in range(len(skeleton))
        if (pairs := _pairs(tree, bone, names, _LONG * 0.5 * longest))
    }
    forks = {
        bone: pairs
        for bone, pairs in forks.items()
        # Fingers and toes fork too, within a limb.
        if not any(
            limb in (bone, *skeleton.ancestors(bone))
            for each in forks.values()
            for pair in each
            for limb in pair
        )
    }
    many = [bone for bone, pairs in forks.items() if _count(tree, pairs) > _MOST_LIMBS]
    if many:
        return Shape(
            problem=phrase(
                "This is no humanoid: {count} limbs of one length start at '{name}'.",
                count=_count(tree, forks[many[0]]),
                name=skeleton.names[many[0]],
            )
        )
    if len(forks) != 2:
        return Shape(
            problem=phrase(
                "This is no humanoid by its shape: it has {found} of limbs that mirror each "
                "other instead of two.",
                found=_PAIRS.get(len(forks)) or phrase("{count} pairs", count=len(forks)),
            )
        )
    lower, upper = sorted(forks, key=lambda bone: len(skeleton.ancestors(bone)))
    legs = _limbs(tree, forks[lower][0], ("thigh", "shin", "foot"))
    arms = _limbs(tree, forks[upper][0], ("upper_arm", "forearm", "hand"))
    if legs is None or arms is None:
        return Shape(problem="The limbs have too few bones for a humanoid.")
    head = _head(tree, upper, forks[upper][0])
    if head is None:
        return Shape(problem="This is no humanoid by its shape: it has no head above the arms.")
    return Shape(
        arms=_same_side(skeleton, legs, arms),
        legs=tuple(legs),
        trunk={"hips": lower, "chest": upper, "head": head},
    )


def _tree(skeleton: Skeleton, names: Sequence[BoneName]) -> _Tree:
    count = len(skeleton)
    reach = [0.0] * count
    following = [-1] * count
    for bone in range(count - 1, -1, -1):
        children = [each for each in skeleton.children[bone] if not names[each].machinery]
        ways = {
            child: reach[child]
            + float(np.linalg.norm(skeleton.heads[child] - skeleton.heads[bone]))
            for child in children
        }
        if ways:
            following[bone] = max(ways, key=lambda child: ways[child])
            reach[bone] = ways[following[bone]]
        else:
            reach[bone] = float(skeleton.lengths[bone])
    return _Tree(skeleton, tuple(reach), tuple(following))


def _pairs(
    tree: _Tree, bone: int, names: Sequence[BoneName], least: float
) -> list[tuple[int, int]]:
    """Pairs of children that carry limbs of the same length, longest first."""
    limbs = [
        child
        for child in tree.skeleton.children[bone]
        if not names[child].machinery and tree.reach[child] > least and len(tree.path(child)) >= 3
    ]
    found = [
        (one, other)
        for one, other in combinations(limbs, 2)
        if abs(tree.reach[one] - tree.reach[other]) < _ALIKE * tree.reach[one]
        and abs(len(tree.path(one)) - len(tree.path(other))) <= 1
    ]
    return sorted(found, key=lambda pair: -tree.reach[pair[0]])


def _count(tree: _Tree, pairs: Sequence[tuple[int, int]]) -> int:
    """Number of limbs; copies that a rig keeps of one count once."""
    limbs = sorted({limb for pair in pairs for limb in pair})
    ends = np.array([tree.skeleton.heads[tree.path(limb)[-1]] for limb in limbs])
    coarse = 0.02 * max(tree.reach[limb] for limb in limbs)
    return len(np.unique(np.round(ends / coarse), axis=0))


def _two_long_parts(
    tree: _Tree, paths: Sequence[Sequence[int]]
) -> list[tuple[int, int, int]] | None:
    """Places on both paths of the three joints between which the two long parts of a limb lie.

    Likely are parts of equal length that make up most of the limb, of few bones, and that end
    where fingers begin. Limbs of as many bones are cut at the same places.
    """
    costs = [_costs_of_cuts(tree, path) for path in paths]
    if not all(costs):
        return None
    if len(paths[0]) != len(paths[1]):
        return [min(each, key=each.__getitem__) for each in costs]
    heads = tree.skeleton.heads
    both = {}
    for cut in costs[0].keys() & costs[1].keys():
        start, bend, _ = cut
        apart = float(np.linalg.norm(heads[paths[0][start]] - heads[paths[1][start]]))
        upper = float(np.linalg.norm(heads[paths[0][bend]] - heads[paths[0][start]]))
        # Limbs that start on the mid plane have a collar bone or a hip joint left to take off.
        both[cut] = costs[0][cut] + costs[1][cut] + (2.0 * _TOGETHER if apart < 0.2 * upper else 0)
    if not both:
        return None
    cut = min(sorted(both), key=both.__getitem__)
    return [cut, cut]


def _costs_of_cuts(tree: _Tree, path: Sequence[int]) -> dict[tuple[int, int, int], float]:
    """How unlikely each way to cut a limb in two parts is, by the places of its joints."""
    ways = np.diff(tree.skeleton.heads[list(path)], axis=0)
    steps = np.linalg.norm(ways, axis=1)
    places = np.cumsum([0.0, *steps, tree.skeleton.lengths[path[-1]]])
    total = float(places[-1])
    ways /= np.maximum(steps, 1e-12)[:, None]
    # Turns by more than 10°.
    bends = (np.einsum("ij,ij->i", ways[:-1], ways[1:]) <= np.cos(np.radians(10.0))).tolist()
    forks = [place for place, bone in enumerate(path) if len(tree.skeleton.children[bone]) > 1]
    last = min(forks[0] + 1, len(path) - 1) if forks else len(path) - 1
    costs = {}
    for start, bend, end in combinations(range(last + 1), 3):
        upper, lower = places[bend] - places[start], places[end] - places[bend]
        if min(upper, lower) <= 1e-6 * total:
            continue
        cost = abs(float(np.log(upper / lower)))
        cost += float(total - upper - lower) / total
        cost += sum(_SKIPPED[bends[joint - 1]] for joint in range(start + 1, end) if joint != bend)
        cost -= _FORK * (end in forks[:1])
        costs[start, bend, end] = cost
    return costs


def _limbs(tree: _Tree, pair: Sequence[int], names: Sequence[str]) -> list[dict[str, int]] | None:
    """The three joints of both limbs of a pair, none where they have too few bones."""
    paths = [tree.path(limb) for limb in pair]
    cuts = _two_long_parts(tree, paths)
    if cuts is None:
        return None
    limbs = []
    for path, cut in zip(paths, cuts, strict=True):
        limb = {name: path[place] for name, place in zip(names, cut, strict=True)}
        if "foot" in limb and cut[-1] + 1 < len(path):
            limb["toe"] = path[cut[-1] + 1]
        if "hand" in limb and cut[0] > 0:
            limb["clavicle"] = path[0]
        limbs.append(limb)
    return limbs


def _head(tree: _Tree, chest: int, arms: tuple[int, int]) -> int | None:
    """The end of the row of bones that goes up between the arms."""
    skeleton = tree.skeleton
    middle = [child for child in skeleton.children[chest] if child not in arms]
    if not middle:
        return None
    path = tree.path(max(middle, key=lambda child: tree.reach[child]))
    up = skeleton.heads[path[0]] - skeleton.heads[skeleton.parents[chest]]
    # Hair and jaw, at the end, turn back or aside.
    while len(path) > 1 and float(skeleton.rest_matrices[path[-1]][:3, 1] @ up) < 0.0:
        path.pop()
    return path[-1]


def _same_side(
    skeleton: Skeleton, legs: Sequence[Mapping[str, int]], arms: Sequence[Mapping[str, int]]
) -> tuple[Mapping[str, int], ...]:
    """The arms in the order of the legs."""
    heads = skeleton.heads
    # Knees and elbows too: on some rigs the limbs start at one place.
    across, arm = (
        sum((heads[one[part]] - heads[other[part]] for part in parts), np.zeros(3))
        for (one, other), parts in ((legs, ("thigh", "shin")), (arms, ("upper_arm", "forearm")))
    )
    return tuple(arms) if float(across @ arm) >= 0.0 else tuple(reversed(arms))
