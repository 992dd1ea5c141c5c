# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that hold the ground, in the world's measure, and how they do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import SettingsError
from ...rotations import Floats


@dataclass(frozen=True)
class StanceSettings:
    """How arms hold on to the ground. Lengths in arm lengths, angles in radians."""

    duty: float = 0.55
    """Share of the cycle that an arm holds on."""
    planted: float = 0.3
    """Share of the arm that lies down."""
    stretch: float = 0.4
    """How much longer bones may get that may stretch."""
    lift: float = 0.06
    """How far above the ground an arm is moved at least."""
    lean: float = 0.7
    """How far the body leans with the ground."""
    smoothing: float = 0.35
    """How far along the way the body evens the ground out."""

    def __post_init__(self) -> None:
        numbers = (self.duty, self.planted, self.stretch, self.lift, self.lean, self.smoothing)
        if not np.all(np.isfinite(numbers)):
            raise SettingsError("A setting of the ground is not a number.", "Set it anew.")
        if not 0.1 <= self.duty <= 0.85:
            raise SettingsError(
                f"Arms hold on for {self.duty:g} of the cycle.", "Give 0.1 to 0.85."
            )
        if not 0.1 <= self.planted <= 0.8:
            raise SettingsError(
                f"{self.planted:g} of each arm lies on the ground.", "Give 0.1 to 0.8."
            )


@dataclass(frozen=True, eq=False)
class Limbs:
    """Arms that are built alike, in the world's measure."""

    arms: tuple[int, ...]
    """Their numbers among all arms of the body."""
    roots: Floats
    """(arms, 3) metres from the body's centre, in the body's frame."""
    outward: Floats
    """(arms, 4) from an arm's own frame, x outward and z up, to the body's."""
    offsets: Floats
    """(arms,) radians that each arm's phase is ahead of the body's."""
    lengths: Floats
    """(segments, arms) metres."""
    radii: Floats
    """(segments + 1, arms) metres from each joint to the skin below it."""
    aims: Floats
    """(arms, 2) radians about the arm's vertical: where the gait has the foothold, and which way
    the arm lies from there, from straight outward."""
    may_stretch: bool = False
    free: np.ndarray | None = None
    """(arms,) whether the gait keeps an arm off the ground, none if it keeps no arm off."""

    @property
    def reach(self) -> Floats:
        """(segments + 1, arms) metres along the arm to each joint."""
        return np.concatenate([0.0 * self.lengths[:1], np.cumsum(self.lengths, axis=0)])

    def touching(self, planted: float) -> int:
        """The joint that touches first, so that about a share of the arm lies beyond it."""
        return touching(self.reach[:, 0], planted)


def touching(reach: Floats, planted: float) -> int:
    """The joint of an arm, of all along it (segments + 1,), that touches first."""
    segments = len(reach) - 1
    free = int(np.argmin(np.abs(reach / reach[-1] - (1.0 - planted))))
    return int(np.clip(free, min(2, segments - 1), segments - 1))
