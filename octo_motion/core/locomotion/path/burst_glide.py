# SPDX-License-Identifier: GPL-3.0-or-later
"""Burst and glide: how far a swimming body has come at each phase of its stroke.

The power stroke pushes for a quarter of the cycle; water slows the body in proportion to its
speed. Speed v over the phase φ is then the periodic solution of ``v′ + v/λ = push(φ)``: it rises
during the stroke and fades exponentially afterwards. Its integral needs no quadrature, for
``∫v = λ (∫push − v)``. [Octopus] moves its body evenly; this is ours.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from ...rotations import Floats
from ..gait import CYCLE

_REACH: Final = 0.25 * np.pi
"""The push lasts from this phase before its middle to this phase after it: β₁ of the swim table
falls from +10° to −80° within π/2."""
_FADE: Final = 1.0
"""λ: the phase within which a gliding body loses all but 1/e of its speed. At the end of a glide
of 3π/2 about 1 % is left of the stroke's speed."""


def stroke_distance(phase: ArrayLike, burst: float, stroke_phase: float) -> Floats:
    """Distance covered since phase 0, in units in which one stroke is 2π.

    Strictly increasing, equal to the phase at whole strokes, twice continuously differentiable.

    Args:
        phase: (…,) radians, unwrapped.
        burst: 0 steady (distance = phase) … 1 all travel comes from the push.
        stroke_phase: phase of the middle of the push.

    Returns:
        (…,)
    """
    turned = np.asarray(phase, dtype=np.float64)
    start = np.array(-stroke_phase)
    fading = _FADE * (_speed(turned + start) - _speed(start))
    pushed = _push_so_far(turned + start) - _push_so_far(start)
    return (1.0 - burst) * turned + burst * (pushed - fading)


def stroke_speed(phase: ArrayLike, burst: float, stroke_phase: float) -> Floats:
    """Derivative of :func:`stroke_distance` by the phase ``(…,)``: mean 1, always positive."""
    return (1.0 - burst) + burst * _speed(np.asarray(phase, dtype=np.float64) - stroke_phase)


def phase_at_distance(distance: float, burst: float, stroke_phase: float) -> float:
    """Inverse of :func:`stroke_distance` for one distance, by bisection."""
    low, high = distance - CYCLE, distance + CYCLE
    while low < (middle := 0.5 * (low + high)) < high:
        if stroke_distance(middle, burst, stroke_phase) < distance:
            low = middle
        else:
            high = middle
    return high


def _wrapped(phase: Floats) -> Floats:
    """The phase from the middle of the push on, from −_REACH up to a cycle later."""
    return np.mod(phase + _REACH, CYCLE) - _REACH


_K: Final = np.pi / _REACH
_RATE: Final = 1.0 / _FADE
_HEIGHT: Final = _RATE * CYCLE / _REACH
"""Peak of the push, such that the speed's mean over a cycle is 1."""


def _driven(offset: Floats) -> Floats:
    """The speed while pushing, without its fading part."""
    swing = _RATE * np.cos(_K * offset) + _K * np.sin(_K * offset)
    return 0.5 * _HEIGHT * (_FADE + swing / (_RATE**2 + _K**2))


_GLIDE: Final = float(np.exp(-_RATE * (CYCLE - 2.0 * _REACH)))
_EDGE: Final = float(_driven(np.array(_REACH)))
# The push is as strong at its start as at its end, and the glide leads from its end to its start.
_FADING: Final = (
    -_EDGE * (1.0 - _GLIDE) / (np.exp(_RATE * _REACH) - _GLIDE * np.exp(-_RATE * _REACH))
)
_RELEASED: Final = _EDGE + float(_FADING * np.exp(-_RATE * _REACH))


def _speed(phase: Floats) -> Floats:
    offset = _wrapped(phase)
    pushing = _driven(offset) + _FADING * np.exp(-_RATE * offset)
    gliding = _RELEASED * np.exp(-_RATE * (offset - _REACH))
    return np.where(offset < _REACH, pushing, gliding)


def _push_so_far(phase: Floats) -> Floats:
    """∫push · λ over the phase, from an arbitrary start: 2π for each cycle."""
    offset = _wrapped(phase)
    inside = np.minimum(offset, _REACH)
    risen = 0.5 * _HEIGHT * _FADE * (inside + _REACH + np.sin(_K * inside) / _K)
    return risen + (phase - offset)
