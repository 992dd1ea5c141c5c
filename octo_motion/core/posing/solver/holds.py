# SPDX-License-Identifier: GPL-3.0-or-later
"""Pins and hands: each holds a point of a body and, where asked to, its turn; rows of a step.

A hand is a spring and a damper in six degrees of freedom, limited in force: a virtual coupling in
the sense of [Plastic, §5] and Colgate et al. (1995). The device (or mouse) moves a target, the
grabbed bone is drawn after it, and the hand feels what draws. Over a step h

    F = K e − (h K + B) (w − w_t),    |F| ≤ F_max

with e the way from the bone to the target at the step's start, w the bone's velocity at its end
(so the coupling is implicit, and stable however stiff) and w_t the target's; the same for turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from ...rotations import Floats, normalized, small_batches
from ..puppet import Figure
from .bodies import Bodies
from .constraint_rows import Holds

_GRAVITY: Final = 9.81
_FREQUENCY: Final = 8.0
"""Hz at which the whole figure would swing on the coupling: firm, and slow enough for a hand."""


@dataclass(frozen=True)
class Coupling:
    """How a hand holds a bone."""

    stiffness: float
    """N/m"""
    damping: float
    """N·s/m"""
    turning_stiffness: float
    """N·m/rad"""
    turning_damping: float
    """N·m·s/rad"""
    force_limit: float
    """N"""
    torque_limit: float
    """N·m"""

    @classmethod
    def for_figure(cls, figure: Figure, strength: float = 1.0) -> Coupling:
        """One that moves the figure as a hand would: firm against its weight and size.

        The strength is a factor on stiffness and limits.
        """
        mass = float(figure.masses.sum())
        arm = 0.25 * float(np.max(figure.lengths, initial=0.0) + _extent(figure))
        stiffness = strength * mass * (2.0 * np.pi * _FREQUENCY) ** 2
        damping = 2.0 * float(np.sqrt(stiffness * mass))
        force = strength * 30.0 * mass * _GRAVITY
        return cls(
            stiffness,
            damping,
            stiffness * arm * arm,
            damping * arm * arm,
            force,
            force * arm,
        )


@dataclass(eq=False, kw_only=True)
class Hold:
    """A point of a body that is held at a place, and the body's turn where asked to; a pin."""

    body: int
    point: Floats
    """(3,) where it is held, in the body's frame."""
    grip: Floats
    """(4,) the body's orientation seen from the hand's when it was taken hold of."""
    target_position: Floats
    """(3,) world."""
    target_orientation: Floats | None
    """(4,) of the hand, world; None lets the bone turn freely about the point."""
    target_velocity: Floats = field(default_factory=lambda: np.zeros(6))
    """(6,) linear, angular."""

    @property
    def turns(self) -> bool:
        """Whether the body's turn is held as well as its point."""
        return self.target_orientation is not None


@dataclass(eq=False, kw_only=True)
class HandSpring(Hold):
    """A bone in a hand, from ``World.grab`` until ``World.release``."""

    coupling: Coupling
    wrench: Floats = field(default_factory=lambda: np.zeros(6))
    """(6,) force N and torque N·m on the bone in the last step, about the point held, world axes.
    The hand feels the opposite."""

    def pull(
        self, position: Floats, orientation: Floats | None = None, velocity: Floats | None = None
    ) -> None:
        """Draw the point that is held to a position (3,), world.

        Without the hand's orientation (4,) the bone is free to turn. Its velocity (6,) is linear
        and angular, and at rest if not given.
        """
        self.target_position = np.array(position, dtype=np.float64)
        self.target_orientation = None if orientation is None else normalized(orientation)
        self.target_velocity = (
            np.zeros(6) if velocity is None else np.array(velocity, dtype=np.float64)
        )


def _extent(figure: Figure) -> float:
    """Greatest distance of a joint from its root along the bones, metres."""
    reach = np.zeros(len(figure))
    for body, parent in enumerate(figure.parents):
        if parent >= 0:
            reach[body] = reach[parent] + float(np.linalg.norm(figure.anchors[body]))
    return float(reach.max(initial=0.0))


# --- Rows of a step -------------------------------------------------------------------------------


_PIN_GAIN = 1e5
"""Of pins, in masses of the figure: they give way by h·g/10⁵ a second before they are put right."""


_Law = tuple[float, float, float]
"""Gain, stiffness and bound of a row."""
_Held = tuple[Hold, bool, Coupling | None]
"""What holds, whether it holds a turn as well, and a hand's coupling."""


class HoldBuilder:
    """The rows of pins and grabs, pins first; of each its point and then its turn."""

    def __init__(self, mass: float, size: float, step: float) -> None:
        """For a figure of a mass, kg, and a typical length, m, in steps of h."""
        gain = _PIN_GAIN * mass
        self._pin_laws: tuple[_Law, _Law] = ((gain, 0.0, np.inf), (gain * size**2, 0.0, np.inf))
        self._step = step
        self._held: list[_Held] = []

    def rows(self, bodies: Bodies, holds: Sequence[Hold]) -> Holds | None:
        """What holds the bodies where they are now; None where nothing does."""
        if not holds:
            return None
        held_now = [
            (each, each.turns, each.coupling if isinstance(each, HandSpring) else None)
            for each in holds
        ]
        if held_now != self._held:
            self._arrange(held_now)
            self._held = held_now
        # Points: where they are wanted, and how fast that moves.
        targets, speeds = self._wanted
        row = 0
        for hold, turns, _ in held_now:
            targets[row] = hold.target_position
            speeds[row] = hold.target_velocity[:3]
            row += 1
            if turns:
                speeds[row] = hold.target_velocity[3:]
                row += 1
        held = self._bodies
        arms = (bodies.matrices.take(held, 0) @ self._points)[:, :, 0]
        points = bodies.positions.take(held, 0)
        points += arms
        ways = targets - points
        if len(self._turning):
            ways[self._turning] = self._turns(bodies, holds)
        return Holds(
            held,
            points,
            self._turns_held,
            self._gains,
            self._stiffness * ways + self._gains3 * speeds,
            self._bounds,
            None if self._pinned is None else self._pinned * ways,
        )

    def _turns(self, bodies: Bodies, holds: Sequence[Hold]) -> Floats:
        """(turns, 3) rotation vectors from where bodies are to where they are wanted."""
        pairs = np.array([(hold.target_orientation, hold.grip) for hold in holds if hold.turns])
        wanted = small_batches.multiply(pairs[:, 0], pairs[:, 1])
        now = bodies.orientations.take(self._bodies[self._turning], 0)
        return small_batches.to_rotation_vector(small_batches.multiply_conjugate(wanted, now))

    def take(self, springs: Sequence[HandSpring], impulses: Floats) -> None:
        """Let hands feel the impulses (rows, 3) of the last ``rows``."""
        if not springs:
            return
        hands = (impulses / self._step).ravel()
        end = len(hands)
        # They come last.
        for spring, (_, turns, _) in zip(reversed(springs), reversed(self._held), strict=False):
            size = 6 if turns else 3
            end -= size
            wrench = np.zeros(6)
            wrench[:size] = hands[end : end + size]
            spring.wrench = wrench

    def _arrange(self, holds: Sequence[_Held]) -> None:
        """What stays the same as long as the same things hold in the same way."""
        # Body, whether a turn, gain, stiffness, bound, whether a pin.
        rows: list[tuple[int, bool, float, float, float, bool]] = []
        points: list[Floats] = []
        for hold, turns, coupling in holds:
            pin = coupling is None
            laws = self._pin_laws if coupling is None else self._laws(coupling)
            for turn, law in zip((False, True) if turns else (False,), laws, strict=False):
                rows.append((hold.body, turn, *law, pin))
                # Of a turn no point counts.
                points.append(hold.point)
        held, turned, gains, stiff, bounds, pinned = zip(*rows, strict=True)
        self._bodies = np.array(held)
        self._points = np.array(points)[:, :, None]
        self._turns_held = np.array(turned)
        self._turning = np.flatnonzero(self._turns_held)
        self._gains = np.array(gains)
        self._bounds = np.array(bounds)
        # Three columns alike: numbers one by one take a third of the time of a column each.
        self._gains3 = np.tile(self._gains[:, None], 3)
        self._stiffness = np.tile(np.array(stiff)[:, None], 3)
        self._pinned = np.tile(np.array(pinned, float)[:, None], 3) if any(pinned) else None
        self._wanted = np.zeros((2, len(rows), 3))

    def _laws(self, coupling: Coupling) -> tuple[_Law, _Law]:
        """Of a hand's point and of its turn."""
        h = self._step
        stiffness, turning = h * coupling.stiffness, h * coupling.turning_stiffness
        return (
            (h * (stiffness + coupling.damping), stiffness, h * coupling.force_limit),
            (h * (turning + coupling.turning_damping), turning, h * coupling.torque_limit),
        )
