# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion in place that repeats: whole cycles of a gait, and a breath.

The arms' phases are whole turns apart at the two ends, whatever offsets they have and whatever the
gait; so the last frame is the first one in position, and what comes after the first frame is what
would come after the last: the seam is a moment like any other.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from ...errors import SettingsError
from ...rotations import Floats
from .route import Route
from .travel import TravelSettings

_BULGE: Final = 0.35
"""How much shorter a mantle gets, as a share of how much wider it gets."""
_INHALE: Final = 0.42
"""Share of a breath spent breathing in, which is quicker than breathing out."""


def route_in_place(stride: float, cycles: int) -> Route:
    """A straight way that takes so many strides: what a body in place would have travelled.

    Args:
        stride: metres.
        cycles: of the gait.

    Raises:
        SettingsError: there is not one whole cycle.
    """
    if cycles < 1:
        raise SettingsError(f"The loop has {cycles} cycles.", "Give at least 1.")
    return Route.poly([[0.0, 0.0, 0.0], [0.0, -stride * cycles, 0.0]])


def travel_in_place(travel: TravelSettings) -> TravelSettings:
    """The same gait at even speed from the first frame to the last."""
    return replace(travel, speed="EVEN", ease_in=0.0, ease_out=0.0)


def whole_frames(frames: float) -> float:
    """As many frames as a loop of about that length has."""
    return float(max(round(frames), 2))


def breathing_scales(times: Floats, amount: float, *, breath: float, whole: float | None) -> Floats:
    """Scales (frames, 3) of a mantle that breathes: across, along the bone, across.

    It fills rather quickly and empties slowly, without a corner between the two.

    Args:
        times: (frames,) seconds.
        amount: by how much it gets wider, as a share.
        breath: seconds that a breath takes.
        whole: seconds of a loop, which takes a whole number of breaths, at least one; none: it
            is no loop.

    Raises:
        SettingsError: a breath takes no time.
    """
    if not breath > 0.0:
        raise SettingsError(f"A breath takes {breath:g} seconds.", "Give more than 0.")
    if whole is not None:
        breath = whole / max(round(whole / breath), 1)
    share = np.mod(times / breath, 1.0)
    # Half a turn for breathing in and half a turn for breathing out.
    turn = np.interp(share, [0.0, _INHALE, 1.0], [0.0, 0.5, 1.0])
    filled = amount * 0.5 * (1.0 - np.cos(2.0 * np.pi * turn))
    across, along = 1.0 + filled, 1.0 - _BULGE * filled
    return np.stack([across, along, across], axis=-1)
