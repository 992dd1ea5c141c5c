# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones of a body that move by themselves: found by name, by place, by what hangs on what."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...errors import RigError
from ...phrases import phrase
from ...rotations import Floats
from ...skeleton import Skeleton
from ..rig import BodyFrame, find_mantle


@dataclass(frozen=True)
class Organs:
    """Bones of a body that move by themselves; where there is none, it is "" or ()."""

    mantle: tuple[str, ...] = ()
    """Root to tip. Where there are several, the first one is the head."""
    siphon: str = ""
    eyes: tuple[str, ...] = ()


_EYE: Final = re.compile(
    r"(?<![a-z])eyes?(?!\s*_?-?\.?(?:brow|lid|lash|target|track|master))(?![a-z])"
)
_SIPHON: Final = re.compile(r"siphon|syphon|funnel|hyponome")
"""What bones are called, in small letters …"""
_NO_BONE: Final = "-"
"""… and what is given by hand for a part that a body has not."""


def find_organs(
    skeleton: Skeleton,
    arms: Sequence[Sequence[str]],
    body: BodyFrame,
    *,
    mantle: str = "",
    siphon: str = "",
    eyes: tuple[str, str] = ("", ""),
) -> Organs:
    """The bones of a body that move by themselves: by what they are called, where they are at rest,
    and what hangs on what.

    Args:
        skeleton: the rig.
        arms: bones of each, root to tip.
        body: where the body lies in the armature.
        mantle: its last bone, "" to find it, "-" for none.
        siphon: likewise.
        eyes: likewise, the left one and the right one.

    Raises:
        RigError: there is no such bone, or it carries an arm or belongs to one.
    """
    limbs = {skeleton.index[bone] for bones in arms for bone in bones}
    carrying = {each for bones in arms for each in skeleton.ancestors(skeleton.index[bones[0]])}
    for name in (mantle, siphon, *eyes):
        _check_bone(skeleton, name, limbs | carrying)
    path = find_mantle(skeleton, arms, body) if not mantle else ()
    if mantle not in {"", _NO_BONE}:
        bone = skeleton.index[mantle]
        above = [each for each in skeleton.ancestors(bone) if each not in carrying]
        path = tuple(skeleton.names[each] for each in (*reversed(above), bone))
    free = [
        each
        for each in range(len(skeleton))
        if each not in limbs
        and each not in carrying
        and skeleton.names[each] not in path
        and not skeleton.constrained[each]
    ]
    return Organs(
        path,
        _found_siphon(skeleton, free, body) if not siphon else siphon.replace(_NO_BONE, ""),
        _found_eyes(skeleton, free, body, eyes),
    )


def _check_bone(skeleton: Skeleton, name: str, taken: set[int]) -> None:
    if name in {"", _NO_BONE}:
        return
    if name not in skeleton.index:
        raise RigError(
            phrase("There is no bone '{name}' to be a part of the body.", name=name),
            "Choose another in the panel Body, or leave it empty to find it.",
        )
    if skeleton.index[name] in taken:
        raise RigError(
            phrase(
                "The bone '{name}' cannot move by itself: it carries arms or belongs to one.",
                name=name,
            ),
            "Choose another in the panel Body, or '-' for none.",
        )


def _found_siphon(skeleton: Skeleton, free: Sequence[int], body: BodyFrame) -> str:
    """By its name; of several the one nearest to the middle, and of these the first."""
    named = [each for each in free if _SIPHON.search(skeleton.names[each].lower())]
    if not named:
        return ""
    aside = np.abs(body.to_body(skeleton.heads[named])[:, 0])
    return skeleton.names[named[int(np.argmin(np.round(aside, 6)))]]


def _found_eyes(
    skeleton: Skeleton, free: Sequence[int], body: BodyFrame, given: tuple[str, str]
) -> tuple[str, ...]:
    """Those given, else a pair by name, the left one first; else two bones on whose places at rest
    eyes would be.
    """
    if all(given):
        return tuple(each for each in given if each != _NO_BONE)
    places = body.to_body(skeleton.heads)
    named = [each for each in free if _EYE.search(_words(skeleton.names[each]))]
    # Nothing hangs on an eye but what belongs to it.
    named = [each for each in named if not any(a in named for a in skeleton.ancestors(each))]
    pair = _pair(places, named)
    if not pair:
        leaves = [
            each
            for each in free
            if not skeleton.children[each] and places[each, 2] > 0.0 and skeleton.deform[each]
        ]
        alone = [each for each in leaves if len(_like(skeleton, leaves, each)) == 2]
        pair = _pair(places, alone) if len(alone) == 2 else ()
    found = [skeleton.names[each] for each in pair]
    chosen = [own or (found[side] if found else "") for side, own in enumerate(given)]
    return tuple(each for each in chosen if each and each != _NO_BONE)


def _words(name: str) -> str:
    """A name in small letters, its words apart: LeftEye is left eye."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower().replace("_", " ")


def _pair(places: Floats, bones: Sequence[int]) -> tuple[int, ...]:
    """The first two bones that mirror each other, the left one first; none if no two do."""
    for place, first in enumerate(bones):
        for second in bones[place + 1 :]:
            mirrored = places[second] * np.array([-1.0, 1.0, 1.0])
            apart = abs(places[first, 0] - places[second, 0])
            if np.linalg.norm(places[first] - mirrored) < _MIRRORED * apart:
                left = first if places[first, 0] > places[second, 0] else second
                return left, first + second - left
    return ()


_MIRRORED: Final = 0.1
"""Of the way between two bones, how far one may be from where the other is in a mirror."""


def _like(skeleton: Skeleton, bones: Sequence[int], bone: int) -> list[int]:
    """Those of the bones that hang on the same one and are as long."""
    return [
        each
        for each in bones
        if skeleton.parents[each] == skeleton.parents[bone]
        and np.isclose(skeleton.lengths[each], skeleton.lengths[bone], rtol=1e-3)
    ]
