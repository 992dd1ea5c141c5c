# SPDX-License-Identifier: GPL-3.0-or-later
"""What a drag shows: the result at one frame, quick enough for every move of the mouse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from ...core.splicing.clip import Clip
from ...core.splicing.splice import Splice, Splicer, build
from ...core.splicing.timing import window
from .stack import Stack

GROUND_FRAMES: Final = 120
"""Frames from which a preview of legs that travel tells the ground."""


class Preview:
    """A stack whose result is looked at frame by frame while one splice is retimed.

    What does not hang on that timing is computed once: all splices beneath it, and which bones
    answer to which.

    Args:
        stack: all that was read.
        number: the splice, none that is muted.

    Raises:
        ClipError: a bone or landmark is missing, or a timing makes no sense.
    """

    def __init__(self, stack: Stack, number: int) -> None:
        splice = stack.splices[number]
        assert splice is not None
        self._splice = splice
        self._landmarks = stack.base.landmarks
        beneath = [each for each in stack.splices[:number] if each is not None]
        self._above = [each for each in stack.splices[number + 1 :] if each is not None]
        self._base = build(stack.base.clip, self._landmarks, beneath)
        self._splicer = Splicer(self._base, self._landmarks, splice)

    def at(self, frame: float, base_start: float, splice_start: float) -> Clip:
        """The result at the base's frame nearest to this one, in a clip that has no other."""
        timing = replace(self._splice.timing, base_start=base_start, splice_start=splice_start)
        number = int(np.abs(self._base.frames - frame).argmin())
        splices = [replace(self._splice, timing=timing), *self._above]
        if any(each.travel for each in splices):
            return self._with_travel(number, splices)
        moment = self._splicer.at(timing, slice(number, number + 1))
        return build(moment, self._landmarks, self._above)

    def _with_travel(self, number: int, splices: Sequence[Splice]) -> Clip:
        """Where legs have led to hangs on other frames: where each splice begins and ends, and
        some that tell the ground.
        """
        base = self._base
        count = min(len(base), GROUND_FRAMES)
        chosen = {number, *np.linspace(0, len(base) - 1, count).astype(int).tolist()}
        for splice in splices:
            span = window(splice.timing, base, splice.clip).frames
            if span.start < span.stop:
                chosen |= {span.start, span.stop - 1}
        rows = sorted(chosen)
        few = build(_taken(base, rows), self._landmarks, splices)
        return _taken(few, [rows.index(number)])


def _taken(clip: Clip, rows: Sequence[int]) -> Clip:
    chosen = np.asarray(rows, dtype=np.intp)
    return replace(
        clip,
        frames=clip.frames[chosen],
        rotations=clip.rotations[chosen],
        locations=clip.locations[chosen],
        world=clip.world[chosen],
    )
