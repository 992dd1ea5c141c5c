# SPDX-License-Identifier: GPL-3.0-or-later
"""Passivity observer and controller: the hand never gets more energy than it gave.

After Hannaford and Ryu, "Time-domain passivity control of haptic interfaces" (2002), in impedance
form: the device tells how it moved, and is given a force. The observer sums the work that the hand
did against the force of each period; this is exact, since the force is held while the hand moves.
Where the sum would fall below zero, the controller adds damping, as much as brings it back.

Three things beyond the source. The sum has a ceiling: energy spent long ago on bending a joint is
no licence to shake the hand now, so what can ever come back is bounded by ``most``. And the damping
has one: a damper of α on a hand of mass m sampled every T is itself active from α T = 2 m on. Ten
times the device's own damping calms all from 0.05 to 0.4 kg at eight times the passive stiffness.
So damping alone cannot keep back a strong slow push, as of a puppet that was bent with more work
than the hand did (the simulation's own coupling helps); while the store is nearly empty, what
drives the hand fades, and smoothly, for a hand that trembles would feel leaps as a buzz.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from ...core.rotations.scalars import ZERO, Vector, dot, scale

DAMPING: Final = 10.0
"""Times the device's own damping, the most that the controller adds."""
_EMPTYING: Final = 0.5
"""Share of the store, below which what drives the hand fades."""
_FALL: Final = 0.005
_RISE: Final = 0.03
"""s in which it fades, and comes back: by leaps it would buzz."""
STORED: Final = 0.02
"""J of pushing that can be given back, a 2 N push over 1 cm; of turning likewise."""


@dataclass
class Observer:
    """Energy that flowed from the hand into the loop, of pushing or of turning."""

    most: float
    """J that can be stored, and so given back."""
    most_damping: float
    """N·s/m (N·m·s/rad) that the controller may add."""
    energy: float = 0.0
    """J, of the hand's, that the loop holds."""
    _share: float = 1.0
    """Of the coupling's force: less while it drives the hand and the store is nearly empty."""
    given: float = 0.0
    """J that the loop gave beyond what it had got: stays near 0 unless damping was capped."""

    def observe(self, force: Vector, moved: Vector) -> None:
        """Account for one period.

        Args:
            force: What acted on the hand throughout it.
            moved: How the hand moved (turned) in it.
        """
        self.energy = min(self.most, self.energy - dot(force, moved))
        self.given = max(self.given, -self.energy)

    def damping(self, force: Vector, velocity: Vector, period: float) -> Vector:
        """Force to add so that the coming period does not give what is not there.

        Args:
            force: What the coupling asks for.
            velocity: The hand's, expected to go on for this period.
            period: s
        """
        speed_squared = dot(velocity, velocity)
        if speed_squared <= 0.0:
            return ZERO
        left = self.energy - dot(force, velocity) * period
        if left >= 0.0:
            return ZERO
        amount = min(self.most_damping, -left / (speed_squared * period))
        return scale(velocity, -amount)

    def allowed(self, force: Vector, velocity: Vector, period: float) -> Vector:
        """What is left of a force that drives the hand while the store runs out.

        Args:
            force: What the coupling asks for.
            velocity: The hand's.
            period: s
        """
        drives = dot(force, velocity) > 0.0
        wanted = max(0.0, min(1.0, self.energy / (_EMPTYING * self.most))) if drives else 1.0
        self._share += min(1.0, period / (_FALL if wanted < self._share else _RISE)) * (
            wanted - self._share
        )
        return scale(force, self._share)

    def forget(self) -> None:
        """Start anew, at a grab: nothing is stored, nothing may be given."""
        self.energy, self._share = 0.0, 1.0
