# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bones beneath a hand are which fingers, in the names of any program.

"mixamorig:LeftHandIndex1", "index_01_l", "Bip01 L Finger1", "lIndex1" and "人指１.L" are the same
joint.
"""

from __future__ import annotations

import re
from types import MappingProxyType
from typing import Final

import numpy as np

from ...rotations import Floats
from ...skeleton import Skeleton
from .landmarks import words_of

FINGERS: Final = ("thumb", "index", "middle", "ring", "pinky")

_WORDS: Final = MappingProxyType(
    dict(zip(FINGERS, FINGERS, strict=True))
    | {
        "mid": "middle",
        "pointer": "index",
        "little": "pinky",
        "small": "pinky",
        "pinkie": "pinky",
        "親指": "thumb",
        "人指": "index",
        "人差指": "index",
        "中指": "middle",
        "薬指": "ring",
        "小指": "pinky",
    }
)
_STARTS: Final = re.compile("|".join(sorted(_WORDS, key=len, reverse=True)))
_PALM: Final = ("metacarpal", "carpal", "inhand", "palm")
"""In names of bones within the palm."""
_ENDS: Final = frozenset({"end", "nub", "tip", "site", "ee"})


def finger_bones(skeleton: Skeleton, hand: int) -> dict[tuple[str, int], int]:
    """Bones by finger and number, from the first joint outside of the palm, 0, to the tip."""
    groups: dict[str, list[int]] = {}
    numbered: dict[int, list[int]] = {}
    for bone in range(len(skeleton)):
        if hand not in skeleton.ancestors(bone):
            continue
        words = words_of(skeleton.names[bone])
        if _ENDS.intersection(words) or any(each in "".join(words) for each in _PALM):
            continue
        name, number = _told(words)
        if name:
            groups.setdefault(name, []).append(bone)
        elif number is not None:
            numbered.setdefault(number, []).append(bone)
    if not groups and numbered:
        # Counted from the thumb.
        first = min(numbered)
        groups = {
            FINGERS[number - first]: bones
            for number, bones in numbered.items()
            if number - first < len(FINGERS)
        }
    elif len(numbered) == 1 and "middle" not in groups:
        # Game characters have one for all that are neither thumb nor index.
        groups["middle"] = next(iter(numbered.values()))
    return {
        (name, place): bone
        for name, bones in groups.items()
        for place, bone in enumerate(_one_row(skeleton, bones))
    }


def palm_roots(skeleton: Skeleton, hand: int) -> tuple[int, int, int] | None:
    """Bones at the roots of index, middle and little finger, or those that there are instead: they
    tell how the palm lies; none where they do not.
    """
    roots = {
        name: bone for (name, place), bone in finger_bones(skeleton, hand).items() if not place
    }
    last = roots.get("pinky", roots.get("ring"))
    if last is None or "index" not in roots:
        return None
    return roots["index"], roots.get("middle", roots["index"]), last


def _told(words: tuple[str, ...]) -> tuple[str, int | None]:
    """Which finger a name says, or its number."""
    for place, word in enumerate(words):
        found = _STARTS.match(word) or (_STARTS.search(word) if not word.isascii() else None)
        if found and not (found[0] in {"mid", "small", "little", "ring", "index"} and _odd(word)):
            return _WORDS[found[0]], None
        following = words[place + 1 : place + 2]
        if word in {"finger", "fingers"} and following and following[0].isdigit():
            return "", int(following[0][0])
    return "", None


def _odd(word: str) -> bool:
    """Whether a word only begins like a finger's: "midway"."""
    rest = _STARTS.sub("", word, count=1)
    return rest not in {"", "finger", "dle", "l", "r", "left", "right"}


def _one_row(skeleton: Skeleton, bones: list[int]) -> list[int]:
    """Those that hang on each other, from the first one."""
    row: list[int] = []
    for bone in bones:
        if not row or row[-1] in skeleton.ancestors(bone):
            row.append(bone)
    return row


def palm_directions(heads: Floats, hand: int, roots: tuple[int, int, int]) -> tuple[Floats, Floats]:
    """Along the hand and across it, from index to little finger: (…, 3) each of any length.

    Args:
        heads: (…, bones, 3) of all bones.
        hand: the hand's bone.
        roots: see :func:`palm_roots`.
    """
    index, middle, last = (heads[..., each, :] for each in roots)
    return np.asarray(middle - heads[..., hand, :]), np.asarray(last - index)
