# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a body is at even steps of its time, whatever the frame rate.

What swings hangs on all that was before. So it is worked out at steps of its own, the same at any
frame rate, over the whole motion, and frames look it up: a frame hangs on its own time alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from ...rotations import Floats, conjugate, rotate, rotation_vector_between
from .evening import evened

_MOMENT: Final = 1.0 / 120.0
"""Seconds from one of them to the next."""
_MOST_MOMENTS: Final = 400_000
_QUIET: Final = 0.05
"""Seconds (standard deviation) over which speed and acceleration are evened out."""


def steps_of(seconds: float) -> Floats:
    """Times (n,) in seconds at which a body is looked at."""
    return np.linspace(0.0, seconds, int(np.clip(np.ceil(seconds / _MOMENT), 8, _MOST_MOMENTS)) + 1)


@dataclass(frozen=True, eq=False)
class BodyTrack:
    """Where a body is at even steps of its time."""

    times: Floats
    """(n,) seconds, from ``steps_of``."""
    locations: Floats
    """(n, 3) of the body's centre, world, in arm lengths."""
    orientations: Floats
    """(n, 4) of the armature, world."""
    strokes: Floats
    """(n,) strokes of the swim since the middle of one."""
    swimming: Floats
    """(n,) how far it swims, 0…1."""
    cyclic: bool
    """Whether it is a loop: the last moment is the first again, but for the way between."""

    @property
    def step(self) -> float:
        """Seconds from one moment to the next."""
        return float(self.times[1] - self.times[0])

    def evened(self, values: Floats, seconds: float) -> Floats:
        """Values (n, k) evened out over time (standard deviation)."""
        return evened(values, seconds / self.step, cyclic=self.cyclic)

    @cached_property
    def velocity(self) -> Floats:
        """(n, 3) arm lengths per second, world. Before its first moment a body moved on evenly."""
        first, last = self.locations[0], self.locations[-1]
        before, after = 2.0 * first - self.locations[1], 2.0 * last - self.locations[-2]
        if self.cyclic:
            before, after = first - last + self.locations[-2], last - first + self.locations[1]
        wide = np.concatenate([before[None], self.locations, after[None]])
        return self.evened((wide[2:] - wide[:-2]) / (2.0 * self.step), _QUIET)

    @cached_property
    def speed(self) -> Floats:
        """(n,) arm lengths per second."""
        return np.linalg.norm(self.velocity, axis=1)

    def seen(self, vectors: Floats) -> Floats:
        """Vectors (n, 3) of the world as the armature has them."""
        return rotate(conjugate(self.orientations), vectors)

    @cached_property
    def acceleration(self) -> Floats:
        """(n, 3) arm lengths per second squared, as the armature has it."""
        wide = self.velocity
        if self.cyclic:
            wide = np.concatenate([wide[-2:-1], wide, wide[1:2]])
            return self.seen((wide[2:] - wide[:-2]) / (2.0 * self.step))
        return self.seen(np.gradient(wide, self.step, axis=0))

    @cached_property
    def turning(self) -> Floats:
        """(n, 3) radians per second, as the armature has it."""
        turned = rotation_vector_between(self.orientations[:-1], self.orientations[1:]) / self.step
        ends = np.concatenate([turned[-1:], turned, turned[:1]])
        if not self.cyclic:
            ends = np.concatenate([turned[:1], turned, turned[-1:]])
        return self.evened(0.5 * (ends[1:] + ends[:-1]), _QUIET)


def sprung(
    values: Floats, step: float, *, frequency: float, damping: float, cyclic: bool
) -> Floats:
    """What a damped spring makes of the places (n, k) that it is drawn to, at steps of so many
    seconds: x″ + 2ζω x′ + ω² x = ω² u, exact for what is straight from step to step.

    It is at rest where it is drawn to at first; of a loop, the last value is the first.
    """
    whole = 2.0 * np.pi * frequency
    pole = whole * complex(-damping, np.sqrt(1.0 - damping * damping))

    def kept(seconds: Any) -> Any:
        # Some C libraries lack exp of complex numbers, which numpy would ask them for.
        turn = pole.imag * seconds
        return np.exp(pole.real * seconds) * (np.cos(turn) + 1j * np.sin(turn))

    keep = complex(kept(step))
    last = (keep - 1.0 - pole * step) / (pole * pole * step)
    first = (keep - 1.0) / pole - last
    state = np.empty(values.shape, dtype=np.complex128)
    state[0] = 0.0 if cyclic else -values[0] / pole
    state[1:] = first * values[:-1] + last * values[1:]
    reach, factor = 1, keep
    while reach < len(state) and abs(factor) > 1e-18:
        state[reach:] += factor * state[:-reach].copy()
        reach, factor = 2 * reach, factor * factor
    if cyclic:
        # What is left of a round at its end is there at its start.
        left = kept(step * np.arange(len(values)))
        state += left[:, None] * (state[-1] / (1.0 - left[-1]))
    return whole * whole / pole.imag * state.imag
