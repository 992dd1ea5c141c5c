# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn of devices: each pointer, and the spring to the limb that it holds."""

from __future__ import annotations

from typing import Final

import numpy as np

from ...core.rotations import Floats
from .device_hands import DeviceHands
from .device_ndof import NdofHands
from .overlay import Lines, overlay_lines

_FREE: Final = (0.6, 0.9, 1.0, 1.0)
_HOLDING: Final = (1.0, 0.6, 0.1, 1.0)
_STRONG: Final = (1.0, 0.1, 0.1, 1.0)
_SIZE: Final = 0.03
"""Of the figure."""


def device_lines(hands: DeviceHands | NdofHands, eye: Floats, *, loads: bool = True) -> Lines:
    """All lines of a session with devices, in the world; as ``overlay_lines``."""
    found = overlay_lines(hands, eye, loads=loads)  # type: ignore[arg-type]
    size = _SIZE * hands.session.size
    for each in hands.shown():
        cross = np.stack([each.position - size * np.eye(3), each.position + size * np.eye(3)], 1)
        colour = _FREE if each.body < 0 else _HOLDING
        found.append(_line(cross.reshape(-1, 3), colour, 2.0))
        if each.body >= 0:
            spring = np.stack([each.coupled, each.position])
            mixed = np.array(_HOLDING) + min(1.0, each.force) * np.subtract(_STRONG, _HOLDING)
            found.append(_line(spring, tuple(mixed), 3.0))
    return found


def _line(points: Floats, colour: tuple[float, ...], width: float) -> tuple[Floats, Floats, float]:
    return points, np.tile(np.array(colour), (len(points), 1)), width
