# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that hold the ground, in the world's measure, and how they do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...rotations import Floats
from ...settings import check_settings, setting


@dataclass(frozen=True)
class StanceSettings:
    """How arms hold on to the ground. Lengths in arm lengths, angles in radians."""

    duty: float = setting(
        "Hold",
        "Share of its cycle for which an arm holds on to the ground. More keeps more arms down at "
        "a time; less gives them longer swings",
        default=0.55,
        low=0.1,
        high=0.85,
        subtype="FACTOR",
        digits=6,
    )
    planted: float = setting(
        "Planted",
        "Share of the arm, from its tip, that lies on the ground while it holds on",
        default=0.3,
        low=0.1,
        high=0.8,
        subtype="FACTOR",
    )
    stretch: float = setting(
        "Stretch",
        "How much longer an arm may get as it pushes, becoming thinner: 0.4 is 40 %. Only bones "
        "that hand their scale on aligned or not at all stretch; others bend instead",
        default=0.4,
        low=0.0,
        high=2.0,
        soft_high=1.0,
        step=5,
    )
    lift: float = setting(
        "Lift",
        "How high above the ground an arm is at least in the middle of its swing, in arm lengths",
        default=0.06,
        low=0.0,
        high=1.0,
        soft_high=0.3,
        step=1,
        precision=3,
    )
    lean: float = setting(
        "Lean",
        "How far the body leans with the ground: 0 stays upright, 1 follows its slope",
        default=0.7,
        low=0.0,
        high=1.0,
        subtype="FACTOR",
    )
    smoothing: float = setting(
        "Smoothing",
        "Over what length the body evens the ground out, in arm lengths. Less follows every bump",
        default=0.35,
        low=0.05,
        high=10.0,
        soft_high=2.0,
        step=5,
    )

    def __post_init__(self) -> None:
        check_settings(self)


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
