# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones of a body that move by themselves: found by name, by place, by what hangs on what; and what
of the body's own motion each of them gets.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...errors import RigError
from ...phrases import phrase
from ...rotations import (
    IDENTITY,
    Floats,
    conjugate,
    from_rotation_vector,
    multiply,
    normalized,
    rotate,
)
from ...skeleton import Skeleton
from ...smoothing import smooth_step
from ..rig import BodyFrame, find_mantle
from .by_itself import SelfMotion


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


# --- What each bone gets --------------------------------------------------------------------------

_OF_HEAD: Final = 0.12
"""Share of the mantle's swing that the head takes, where there is one."""
_BULGE: Final = 0.35
"""How much shorter a mantle gets, as a share of how much wider it gets."""
_AGAINST: Final = 0.9
"""Radians that the siphon turns against the travel of a swim at most, and …"""
_AGAINST_WALK: Final = 0.4
"""… the share of it in a walk."""
_PUFF: Final = 0.3
"""By how much wider it is while water leaves it."""
_SLOW: Final = 0.15
"""Arm lengths per second at which half of what hangs on a direction of travel is there."""
_GLANCE: Final = 0.2
"""Radians that eyes turn to where the body goes at most …"""
_LOOK: Final = 0.7
"""… and to what they look at."""
_HEAD_ABOUT: Final = 0.4
"""Share of looking about that the head does."""
_SURE: Final = 0.1, 0.4
"""Sine of the angle between gaze and the vertical from which on a slit can be level."""
_SHUT: Final = 0.9
"""Share of an eye's height that it takes away."""
_OUTWARD: Final = 0.2
"""Cosine of the angle between an eye's bone and the way out of the head: from here on it looks
along its bone."""


@dataclass(frozen=True, eq=False)
class BodyMoments:
    """Where a body is at some moments."""

    times: Floats
    """(moments,) seconds."""
    orientations: Floats
    """(moments, 4) of the armature, world."""
    look: Floats | None
    """(moments, 3) where from the eyes what they look at is, world; none for nothing."""
    held: Floats
    """(moments, bones of the mantle, 4) from rest: what the mantle is stretched out by."""


@dataclass(frozen=True, eq=False)
class OrganPoses:
    """Bones of a body that move by themselves, at some moments."""

    bones: tuple[str, ...]
    rotations: Floats
    """(moments, bones, 4) from rest."""
    scales: dict[str, Floats]
    """(moments, 3) of those that may get wider or narrower."""

    def at(self, part: slice) -> OrganPoses:
        """The same at some of the moments."""
        scales = {name: each[part] for name, each in self.scales.items()}
        return OrganPoses(self.bones, self.rotations[part], scales)


def pose_organs(
    motion: SelfMotion, organs: Organs, skeleton: Skeleton, up: Floats, moments: BodyMoments
) -> OrganPoses:
    """The bones of a body as it moves by itself.

    Args:
        motion: how it does.
        organs: its bones.
        skeleton: the rig.
        up: (3,) unit, the body's up at rest, as the armature has it.
        moments: when, and where it is then.
    """
    posing = _Posing(motion, organs, skeleton, up, moments)
    names = [*organs.mantle, *([organs.siphon] if organs.siphon else []), *organs.eyes]
    for bone in sorted(skeleton.index[name] for name in names):
        posing.add(bone)
    bones = tuple(name for name in names if posing.turns(name))
    rotations = [posing.bases[skeleton.index[name]] for name in bones]
    count = len(moments.times)
    return OrganPoses(
        bones,
        np.stack(rotations, axis=1) if rotations else np.zeros((count, 0, 4)),
        dict(posing.scales()),
    )


def carriages(
    organs: OrganPoses, skeleton: Skeleton, names: Iterable[str]
) -> dict[str, tuple[Floats, Floats]]:
    """How bones of the body are taken along, from rest, armature space: turns (moments, 4) about
    its origin, and shifts (moments, 3) after these. Breath widens, and takes nothing along.
    """
    count = len(organs.rotations)
    own = dict(zip(organs.bones, np.moveaxis(organs.rotations, 1, 0), strict=True))
    at_rest = np.broadcast_to(IDENTITY, (count, 4)), np.zeros((count, 3))
    known: dict[int, tuple[Floats, Floats]] = {-1: at_rest}

    def carriage(bone: int) -> tuple[Floats, Floats]:
        if bone not in known:
            turns, shifts = above = carriage(skeleton.parents[bone])
            inherits, rotations = skeleton.inherits_rotation[bone], own.get(skeleton.names[bone])
            if not inherits or rotations is not None:
                head, rest = skeleton.heads[bone], skeleton.rest_rotations[bone]
                at = rotate(turns, head) + shifts
                turns = turns if inherits else at_rest[0]
                if rotations is not None:
                    turns = multiply(turns, multiply(multiply(rest, rotations), conjugate(rest)))
                above = turns, at - rotate(turns, head)
            known[bone] = above
        return known[bone]

    return {name: carriage(skeleton.index[name]) for name in names}


_ALONG: Final = np.array([0.0, 1.0, 0.0])
_UP: Final = np.array([0.0, 0.0, 1.0])


class _Posing:
    """Bones one after the other, parents before children."""

    def __init__(
        self,
        motion: SelfMotion,
        organs: Organs,
        skeleton: Skeleton,
        up: Floats,
        moments: BodyMoments,
    ) -> None:
        self._motion, self._organs, self._skeleton = motion, organs, skeleton
        self._up, self._moments = up, moments
        self._settings = motion.settings
        self.bases: dict[int, Floats] = {}
        """By bone (moments, 4) from rest."""
        self._posed: dict[int, Floats] = {}
        """By bone (moments, 4) in the armature."""

    def turns(self, name: str) -> bool:
        """Whether a bone is to have a rotation of its own."""
        settings = self._settings
        if name in self._organs.eyes:
            return settings.eyes > 0.0
        if name == self._organs.siphon:
            return settings.siphon > 0.0
        stretched = self._moments.held.shape[1] > 0
        return stretched or settings.mantle > 0.0 or settings.head > 0.0

    def add(self, bone: int) -> None:
        """Pose one more."""
        skeleton, name = self._skeleton, self._skeleton.names[bone]
        rest = skeleton.rest_rotations[bone]
        carried = np.broadcast_to(rest, (len(self._moments.times), 4))
        above = next((each for each in skeleton.ancestors(bone) if each in self._posed), -1)
        if above >= 0 and skeleton.inherits_rotation[bone]:
            turn = multiply(self._posed[above], conjugate(skeleton.rest_rotations[above]))
            carried = multiply(turn, rest)
        posed = carried
        if name in self._organs.mantle and self._moments.held.shape[1]:
            posed = multiply(carried, self._moments.held[:, self._organs.mantle.index(name)])
        if self.turns(name):
            posed = multiply(self._turn(bone, name, posed), posed)
        self._posed[bone] = posed
        self.bases[bone] = multiply(conjugate(carried), posed)

    def _turn(self, bone: int, name: str, posed: Floats) -> Floats:
        """What turns (moments, 4) a bone besides what it hangs on, as the armature has it."""
        if name in self._organs.eyes:
            return self._look(bone, posed)
        if name == self._organs.siphon:
            # It stays where it is between the arms while the head looks about.
            return from_rotation_vector(self._against(posed) - self._about())
        return from_rotation_vector(self._swing(self._organs.mantle.index(name), posed))

    def _swing(self, place: int, posed: Floats) -> Floats:
        """Rotation vectors (moments, 3) of a bone of the mantle."""
        motion, many = self._motion, len(self._organs.mantle)
        swing = motion.at(motion.swing, self._moments.times)
        along = rotate(posed, _ALONG)
        back = swing[:, 3:]
        whole = np.cross(along, swing[:, :3]) + back
        whole -= np.sum(along * back, axis=1, keepdims=True) * along
        if many == 1:
            return whole
        if place:
            return (1.0 - _OF_HEAD) / (many - 1) * whole
        return _OF_HEAD * whole + motion.at(motion.steady, self._moments.times) + self._about()

    def _about(self) -> Floats:
        """Rotation vectors (moments, 3) of a head that looks about; none is moved without one."""
        motion, has_head = self._motion, len(self._organs.mantle) > 1
        share = has_head * self._settings.head * _HEAD_ABOUT
        return share * motion.at(motion.about, self._moments.times)[:, None] * self._up

    def _against(self, posed: Floats) -> Floats:
        """Rotation vectors (moments, 3) of the siphon."""
        motion, times = self._motion, self._moments.times
        way = motion.at(motion.way, times)
        jet = -way / (np.linalg.norm(way, axis=1, keepdims=True) + _SLOW)
        swims = motion.at(motion.track.swimming, times)[:, None]
        share = _AGAINST_WALK + (1.0 - _AGAINST_WALK) * swims
        return self._settings.siphon * _AGAINST * share * np.cross(rotate(posed, _ALONG), jet)

    def _look(self, bone: int, posed: Floats) -> Floats:
        """Turns (moments, 4) of an eye: towards what it looks at, its slit level."""
        moments, motion, amount = self._moments, self._motion, self._settings.eyes
        gaze, above = self._rest_gaze(bone)
        turned = multiply(posed, conjugate(self._skeleton.rest_rotations[bone]))
        to_world = multiply(moments.orientations, turned)
        gaze, above = rotate(to_world, gaze), rotate(to_world, above)
        if moments.look is not None:
            towards, most = moments.look, _LOOK
            towards = towards / np.maximum(np.linalg.norm(towards, axis=1, keepdims=True), 1e-9)
        else:
            way = motion.at(motion.way, moments.times)
            way = way / (np.linalg.norm(way, axis=1, keepdims=True) + _SLOW)
            towards, most = rotate(moments.orientations, way), _GLANCE
        glance = from_rotation_vector(amount * most * np.cross(gaze, towards))
        if moments.look is None:
            about = amount * motion.at(motion.about, moments.times)
            above_it = rotate(moments.orientations, self._up)
            glance = multiply(from_rotation_vector(about[:, None] * above_it), glance)
        gaze, above = rotate(glance, gaze), rotate(glance, above)
        level = _UP - gaze[:, 2:] * gaze
        roll = np.arctan2(
            np.sum(np.cross(above, level) * gaze, axis=1), np.sum(above * level, axis=1)
        )
        low, high = _SURE
        sure = smooth_step((np.linalg.norm(level, axis=1) - low) / (high - low))
        roll = min(amount, 1.0) * sure * np.unwrap(roll)
        whole = multiply(from_rotation_vector(roll[:, None] * gaze), glance)
        return multiply(multiply(conjugate(moments.orientations), whole), moments.orientations)

    def _rest_gaze(self, bone: int) -> tuple[Floats, Floats]:
        """Where an eye looks at rest (3,), and its up (3,), as the armature has them: along its
        bone, unless that leads into the head.
        """
        skeleton = self._skeleton
        eyes = [skeleton.index[name] for name in self._organs.eyes]
        gaze = rotate(skeleton.rest_rotations[bone], _ALONG)
        outward = skeleton.heads[bone] - skeleton.heads[eyes].mean(axis=0)
        if len(eyes) > 1 and gaze @ normalized(outward) < _OUTWARD:
            gaze = normalized(outward)
        return gaze, normalized(self._up - (self._up @ gaze) * gaze)

    def scales(self) -> Iterator[tuple[str, Floats]]:
        """Of the bones that may get wider or narrower (moments, 3)."""
        motion, times, organs = self._motion, self._moments.times, self._organs
        if organs.mantle:
            filled = motion.at(motion.filled, times)
            across = 1.0 + filled
            yield organs.mantle[-1], np.stack([across, 1.0 - _BULGE * filled, across], axis=1)
        if organs.siphon:
            puff = 1.0 + _PUFF * self._settings.siphon * motion.at(motion.outflow, times)
            yield organs.siphon, np.stack([puff, np.ones(len(times)), puff], axis=1)
        shut = motion.at(motion.shut, times)
        for place, name in enumerate(organs.eyes if self._settings.eyes > 0.0 else ()):
            bone = self._skeleton.index[name]
            axes = self._skeleton.rest_matrices[bone][:3, :3]
            high = 2 * int(abs(axes[:, 2] @ self._up) >= abs(axes[:, 0] @ self._up))
            scale = np.ones((len(times), 3))
            scale[:, high] -= min(self._settings.eyes, 1.0) * _SHUT * shut[:, place]
            yield name, scale
