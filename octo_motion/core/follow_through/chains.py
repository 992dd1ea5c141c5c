# SPDX-License-Identifier: GPL-3.0-or-later
"""Chains of bones: those of a selection, and those whose names say that they hang and swing."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Final

from ..skeleton import Skeleton

_LOOSE: Final = frozenset(
    {
        *("tail", "ear", "ears", "hair", "bang", "bangs", "braid", "ponytail", "pigtail", "plait"),
        *("antenna", "antennae", "feeler", "whisker", "beard", "mane", "crest", "comb", "wattle"),
        *("cape", "cloak", "coat", "scarf", "skirt", "dress", "ribbon", "rope", "chain", "strap"),
        *("tassel", "flag", "cloth", "dangle", "jiggle", "belly", "breast", "boob", "chest_soft"),
        *("fat", "flap", "fin", "feather", "tentacle", "mantle", "lobe", "trunk", "dewlap", "hood"),
    }
)
_WORD: Final = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
Chain = tuple[int, ...]


def chains_of(skeleton: Skeleton, bones: Collection[int]) -> list[Chain]:
    """Bones as chains, each from its first to its last; where they fork, the longer way goes on."""
    chosen = set(bones)
    below = {bone: [each for each in skeleton.children[bone] if each in chosen] for bone in chosen}
    depth: dict[int, int] = {}
    for bone in sorted(chosen, key=lambda each: -len(skeleton.ancestors(each))):
        depth[bone] = 1 + max((depth[each] for each in below[bone]), default=0)
    starts = [bone for bone in sorted(chosen) if skeleton.parents[bone] not in chosen]
    found: list[Chain] = []
    while starts:
        bone = starts.pop(0)
        chain = [bone]
        while below[bone]:
            onward = max(below[bone], key=lambda each: (depth[each], -each))
            starts += [each for each in below[bone] if each != onward]
            chain.append(bone := onward)
        found.append(tuple(chain))
    return found


def between(skeleton: Skeleton, first: int, last: int) -> Chain:
    """All bones from one to another beneath it; none if it is not."""
    way = [last, *skeleton.ancestors(last)]
    return tuple(way[way.index(first) :: -1]) if first in way else ()


def find_loose(skeleton: Skeleton) -> list[Chain]:
    """Chains whose names say that they hang and swing: tails, ears, hair, cloth, antennae.

    Bones that something else moves are left out.
    """
    named = [
        bone
        for bone, name in enumerate(skeleton.names)
        if _LOOSE & {word.casefold() for word in _WORD.findall(name)}
        and not skeleton.constrained[bone]
        and skeleton.parents[bone] >= 0
    ]
    return chains_of(skeleton, named)
