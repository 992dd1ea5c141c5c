# SPDX-License-Identifier: GPL-3.0-or-later
"""Feet of legs that are spliced with their travel stand where those of their clip do."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from ...rotations import Floats, conjugate, multiply, rotate, slerp
from ..clip import Clip, SpliceWindow
from .foot_contacts import (
    Stance,
    ball_places,
    find_contacts,
    find_stance,
    foot_bones,
    own_paths,
)
from .foot_lock import Footing, GroundHeight, locking_feet, steps_of
from .leg_travel import leg_length
from .retarget import MappedClip, Retarget

SIGHT: Final = 2.0
"""Seconds before and after a frame on which its feet hang, as far as one can see."""

_GAP: Final = 1.5
"""Of the usual step between frames: more is a gap."""

_DIGITS: Final = 6
"""Of a frame's number that count."""

_ANKLE: Final = 0.4
"""Leg lengths: an ankle higher above where its object stands does not stand there."""

_ALIKE: Final = 1e-3
"""By how much legs may differ in length and travel as far."""


class TravelLock:
    """What does not hang on the timing.

    Args:
        retargets: of the legs, or of one of them.
        sides: on which they are, "L" and "R".
        ground: what feet stand on; none for the height at which the base stands.

    Raises:
        ClipError: a landmark is missing.
    """

    def __init__(
        self, retargets: Sequence[Retarget], sides: Sequence[str], ground: GroundHeight | None
    ) -> None:
        base, splice = retargets[0].base, retargets[0].splice
        ratio = size_ratio(retargets[0])
        alike = all(each.match.same_body for each in retargets) and abs(ratio - 1.0) < _ALIKE
        self.needed = not alike or ground is not None
        """Whether there is anything to do: feet of a body like the clip's stand as there."""
        if not self.needed:
            return
        self._base = base
        self._balls = answering_balls(retargets, sides)
        self._ground = ground
        self._stands = find_stance(own_paths(base, self._balls))
        if ground is not None:
            self._stands = above_soles(self._stands, base)
        paths = own_paths(splice)
        contacts = find_contacts(paths)
        contacts.held[:, [name not in sides for name in "LR"]] = False
        self._contacts = contacts
        self._steps = steps_of(paths, contacts, find_stance(paths), ratio)
        self._moments = paths.moments

    def onto(self, result: Clip, span: SpliceWindow) -> Generator[None, None, Clip]:
        """The result of a splice with its feet held where the splice acts, in steps.

        Whole frames are what they are without moments between them; those follow.
        """
        acting = np.arange(span.frames.start, span.frames.stop)
        own = np.round(self._base.clip.frames, _DIGITS)
        whole = np.isin(np.round(result.frames[acting], _DIGITS), own)
        held = result
        if whole.any():
            held = yield from self._held(result, acting[whole], span.taken(acting[whole]))
        if whole.all():
            return held
        finer = yield from self._held(result, acting, span)
        return _followed(held, finer, acting[whole], acting[~whole])

    def _held(
        self, result: Clip, acting: np.ndarray, span: SpliceWindow
    ) -> Generator[None, None, Clip]:
        """The same from row to row of those on which a splice acts, all others as they are.

        Of its frames some may be missing: what lies between gaps is looked at by itself.
        """
        rotations, locations = result.rotations.copy(), result.locations.copy()
        steps = np.diff(result.frames[acting])
        gaps = np.flatnonzero(steps > _GAP * np.median(steps)) + 1 if len(steps) else []
        for chosen in np.split(np.arange(len(acting)), gaps):
            footing = Footing(
                self._contacts,
                self._moments,
                self._stands,
                self._steps,
                span.splice_frames[chosen],
                self._ground,
                self._balls,
            )
            there = acting[chosen]
            locked = yield from locking_feet(
                self._base, result.taken(there), footing, span.weights[chosen]
            )
            rotations[there], locations[there] = locked.rotations, locked.locations
        return replace(result, rotations=rotations, locations=locations)


def _followed(goal: Clip, finer: Clip, done: np.ndarray, rest: np.ndarray) -> Clip:
    """A clip that is right at some of its rows, and at the rest what a finer one is there, brought
    along as that has to be at the rows beside them.
    """
    if not len(done):
        return finer
    places = np.interp(goal.frames[rest], goal.frames[done], np.arange(len(done)))
    first = places.astype(np.intp)
    after, share = np.minimum(first + 1, len(done) - 1), (places - first)[:, None]
    off = goal.locations[done] - finer.locations[done]
    locations, rotations = goal.locations.copy(), goal.rotations.copy()
    locations[rest] = (
        finer.locations[rest] + off[first] + share[..., None] * (off[after] - off[first])
    )
    turned = multiply(conjugate(finer.rotations[done]), goal.rotations[done])
    rotations[rest] = multiply(finer.rotations[rest], slerp(turned[first], turned[after], share))
    return replace(goal, rotations=rotations, locations=locations)


def size_ratio(retarget: Retarget) -> float:
    """How much longer the base's legs are than the clip's, in the world."""
    ours, theirs = retarget.base, retarget.splice
    return leg_length(ours) * ours.clip.scale / (leg_length(theirs) * theirs.clip.scale)


def answering_balls(retargets: Sequence[Retarget], sides: Sequence[str]) -> Floats:
    """Where the balls of the base's feet are as seen from their bones, (2, 3): of feet without toes
    where the clip's are, at their size.
    """
    base, source = retargets[0].base, retargets[0].splice
    found, others = ball_places(base), ball_places(source)
    size = size_ratio(retargets[0]) * source.clip.scale / base.clip.scale
    for retarget, name in zip(retargets, sides, strict=True):
        *_, foot, toe = foot_bones(base, name)
        *_, answer, other_toe = foot_bones(source, name)
        constant = retarget.match.constants.get(foot)
        if toe < 0 <= other_toe and constant is not None and retarget.match.pairs[foot] == answer:
            side = "LR".index(name)
            found[side] = size * rotate(conjugate(constant), others[side])
    return found


def above_soles(stands: Stance, base: MappedClip) -> Stance:
    """Heights above the soles, which are where the object is, if that is beneath the feet as usual;
    otherwise as low as the lowest joint.
    """
    floor = float(base.clip.world[0, 2, 3])
    lowest = min(stands.ankle, stands.ball)
    leg = leg_length(base) * base.clip.scale
    if not 0.0 <= lowest - floor < _ANKLE * leg:
        floor = lowest
    return Stance(stands.ankle - floor, stands.ball - floor)
