# SPDX-License-Identifier: GPL-3.0-or-later
"""How long a step may be so that simulated time keeps up with the clock."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class StepLength:
    """Lengthens steps that take too long, and shortens them when there is time again."""

    nominal: float
    """s of the shortest step, which is the most exact."""
    coarsest: float
    """s of the longest: beyond, a fast hand would shake the puppet."""
    busy: float
    """Share of real time that steps may take; above, they get longer."""
    idle: float
    """Of ``busy``: below, they get shorter again."""
    learning: float
    """Of one more measurement, in ``load``."""
    load: float = 0.0
    """s of work for a simulated second, of late."""

    def after(self, spent: float, simulated: float, step: float) -> float:
        """The step, s, to go on with.

        Args:
            spent: s that were worked.
            simulated: s that came of it, above zero.
            step: s of a step now.
        """
        self.load += self.learning * (spent / simulated - self.load)
        wanted = step
        if self.load > self.busy and step < self.coarsest:
            wanted = min(2.0 * step, self.coarsest)
        elif self.load < self.idle * self.busy and step > self.nominal:
            wanted = max(0.5 * step, self.nominal)
        # A step costs about the same, however long it is.
        self.load *= step / wanted
        return wanted
