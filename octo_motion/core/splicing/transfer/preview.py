# SPDX-License-Identifier: GPL-3.0-or-later
"""A stack looked at frame by frame, quick enough for every move of the mouse."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..clip import Clip, Timing
from ..humanoid import Landmarks
from .splice import Splice, build_splices, splicers


class SplicePreview:
    """The result of a stack at single frames, while one of its splices is timed anew.

    What does not hang on that timing is computed once: all splices beneath it, which bones answer
    to which, where the ground is. Each look then takes the frame in sight and the few others that
    it hangs on.

    Args:
        base: the base.
        landmarks: the base's.
        splices: the stack, the first one first.
        number: the splice that is timed, none that is muted.

    Raises:
        ClipError: a bone or landmark is missing, or a timing makes no sense.
    """

    def __init__(
        self, base: Clip, landmarks: Landmarks | None, splices: Sequence[Splice], number: int
    ) -> None:
        self._base = build_splices(base, landmarks, splices[:number])
        # Made ready on the stack's own base: it tells the ground.
        self._levels = splicers(base, landmarks, splices[number:])
        self._above = [each.window(each.splice.timing) for each in self._levels[1:]]

    def at(self, frame: float, timing: Timing) -> Clip:
        """The result at the base's frame nearest to this one, in a clip that has no other.

        Raises:
            ClipError: the timing makes no sense.
        """
        spans = [self._levels[0].window(timing), *self._above]
        row = int(np.abs(self._base.frames - frame).argmin())
        needed = [row]
        for level, span in zip(self._levels[::-1], spans[::-1], strict=True):
            needed = level.needed(span, needed)
        rows = np.asarray(needed, dtype=np.intp)
        result = self._base.taken(rows)
        for level, span in zip(self._levels, spans, strict=True):
            result = level.onto(result, span.taken(rows))
        return result.taken([needed.index(row)])
