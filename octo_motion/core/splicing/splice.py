# SPDX-License-Identifier: GPL-3.0-or-later
"""Splicing: a part of one clip put onto another, and stacks of such splices.

After Takebayashi, Nishio and Kobori, "Motion synthesis based on splicing of parts" [Splice]: what
is kept of a part is where it lies as seen from the chest (the trunk: from the pelvis), and a
splice's result can be the base of the next. Beyond the source: legs are seen from the pelvis,
unless asked otherwise, for a chest that bows would lift them off the ground; a limb may reach for
the exact point; clavicles may belong to the arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from ..errors import ClipError
from ..rotations import (
    Floats,
    conjugate,
    continuous,
    from_rotation_vector,
    multiply,
    to_rotation_vector,
)
from .carry import Side, carriers, carry
from .clip import Clip
from .landmarks import Landmarks
from .parts import Part
from .posture import posture_of, sampled
from .timing import Timing, Window, window
from .travel import move_hips

Reach = Literal["direction", "exact"]
SeenFrom = Literal["", "chest", "pelvis"]

_LEG_PIECES: Final = frozenset({"leg.L", "leg.R"})


@dataclass(frozen=True, eq=False)
class Splice:
    """One part of one clip, and when. All that is needed to do it again."""

    part: Part
    clip: Clip
    timing: Timing
    landmarks: Landmarks | None = None
    """Of the splice clip's skeleton; a chain needs none."""
    reach: Reach = "direction"
    """Hands and feet in the direction where they were seen (the source), or on the very point."""
    travel: bool = False
    """Whether legs bring the splice clip's way through the world with them."""
    clavicle: bool = True
    """Whether an arm takes its clavicle along, where both skeletons have one; the source's joint
    is the shoulder."""
    seen_from: SeenFrom = ""
    """From where legs are seen: the pelvis if empty, the chest in the source."""
    mute: bool = False


def build(base: Clip, landmarks: Landmarks | None, splices: Sequence[Splice]) -> Clip:
    """All splices of a stack, each onto the result of those before. Nothing given is changed.

    Raises:
        ClipError: a bone or landmark is missing, or a timing makes no sense.
    """
    result = base
    for each in splices:
        if not each.mute:
            result = spliced(result, landmarks, each)
    return result


def spliced(base: Clip, landmarks: Landmarks | None, splice: Splice) -> Clip:
    """One splice onto a clip; the result has the base's frames, bones and name.

    Raises:
        ClipError: a bone or landmark is missing, or the timing makes no sense.
    """
    return Splicer(base, landmarks, splice).at(splice.timing)


class Splicer:
    """A splice made ready: what does not hang on its timing is found once.

    For a timing that is dragged, with few frames in sight: poses do not hang on each other.
    """

    def __init__(self, base: Clip, landmarks: Landmarks | None, splice: Splice) -> None:
        """Match the two skeletons.

        Raises:
            ClipError: a bone or landmark is missing.
        """
        if splice.travel and not _LEG_PIECES.intersection(splice.part.pieces):
            raise ClipError(
                f"The part '{splice.part.name}' has no legs to travel with.", "Turn travel off."
            )
        seen_from = "pelvis" if splice.travel else splice.seen_from
        sides = Side(base, landmarks), Side(splice.clip, splice.landmarks)
        self._base, self._splice = base, splice
        self._pieces = carriers(splice.part, *sides, clavicle=splice.clavicle, seen_from=seen_from)

    def at(self, timing: Timing, frames: slice | None = None) -> Clip:
        """The base with the part spliced on at this timing, all of it or these frames.

        Raises:
            ClipError: the timing makes no sense.
        """
        if frames is not None and self._splice.travel:
            # Where the legs have led to by then is known only from the start on.
            return _cut(self.at(timing), frames)
        base = self._base if frames is None else _cut(self._base, frames)
        span = window(timing, base, self._splice.clip)
        if span.frames.stop == span.frames.start:
            return base
        rotations, locations = base.rotations.copy(), base.locations.copy()
        before = posture_of(base.skeleton, base.rotations[span.frames], base.locations[span.frames])
        moment = sampled(self._splice.clip, span.splice_frames)
        # Views: what is written here is written into the whole.
        turned, moved = rotations[span.frames], locations[span.frames]
        exact = self._splice.reach == "exact"
        for piece in self._pieces:
            carry(piece, before, moment, turned, moved, exact=exact)
        if (span.weights < 1.0).any():
            bones = sorted({bone for piece in self._pieces for bone in piece.bones})
            _ease(base, span, bones, turned, moved)
        if self._splice.travel:
            whole = posture_of(base.skeleton, base.rotations, base.locations)
            move_hips(self._pieces[0], span, whole, rotations, locations)
        return replace(base, rotations=rotations, locations=locations)


def _cut(clip: Clip, frames: slice) -> Clip:
    return replace(
        clip,
        frames=clip.frames[frames],
        rotations=clip.rotations[frames],
        locations=clip.locations[frames],
        world=clip.world[frames],
    )


def _ease(
    base: Clip, span: Window, bones: Sequence[int], rotations: Floats, locations: Floats
) -> None:
    """Mix the base back in where the splice comes and goes."""
    leaving = span.weights < span.entering
    for chosen in (np.flatnonzero((span.weights < 1.0) & side) for side in (~leaving, leaving)):
        if not len(chosen):
            continue
        frames = chosen + span.frames.start
        weights = span.weights[chosen][:, None]
        own = base.rotations[frames][:, bones]
        # The way round is chosen once, where the two are about equally strong, and kept: the short
        # way frame by frame would jump where they are half a turn apart.
        between = continuous(multiply(conjugate(own), rotations[chosen][:, bones]))
        middle = np.argmin(np.abs(weights[:, 0] - 0.5))
        between = np.where(between[middle, :, :1] < 0.0, -between, between)
        mixed = multiply(own, _power(between, weights))
        # Where the splice has no weight yet, the very values of the base.
        rotations[np.ix_(chosen, bones)] = np.where(weights[..., None] == 0.0, own, mixed)
        still = base.locations[frames][:, bones]
        there = locations[np.ix_(chosen, bones)]
        locations[np.ix_(chosen, bones)] = still + weights[..., None] * (there - still)


def _power(quaternions: Floats, shares: Floats) -> Floats:
    """A share of each rotation, along the way round that its sign says."""
    far = quaternions[..., :1] < 0.0
    vector = to_rotation_vector(quaternions)
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    # The sign of a quaternion tells the short way round from the long one.
    long_way = 1.0 - 2.0 * np.pi / np.maximum(angle, 1e-9)
    vector = np.where(far, vector * long_way, vector)
    return from_rotation_vector(vector * shares[..., None])
