# SPDX-License-Identifier: GPL-3.0-or-later
"""What a motion has come to, ready to be written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...keyframes import Channel
from ...rotations import Floats
from ..metrics import Figure, Measured
from ..reaching import Carried
from ..rig import ArmMotion
from .planning import MotionPlan


@dataclass(frozen=True, eq=False)
class MotionResult:
    """What a motion has come to."""

    plan: MotionPlan
    channels: Sequence[Channel]
    """All that gets keys."""
    automatic: bool
    """Whether keys without handles of their own have automatic ones."""
    arms: ArmMotion
    """The arms at all moments at which they were worked out: frames, or those and half frames."""
    swimming: Floats | None
    """(frames,) how far the body swims, 0…1, where the gait changes."""
    carried: tuple[Carried, ...] = ()
    """Where arms that reach take objects."""
    measured: Measured | None = None
    """What the figures are taken from, none where they are not wanted."""
    figures: tuple[Figure, ...] = ()
    """The worst of each kind."""
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    """What arms that reach do."""

    @property
    def frames(self) -> Floats:
        """(frames,) whole numbers."""
        return self.plan.schedule.frames

    @property
    def miss(self) -> float:
        """Arm lengths that an arm is from the targets of its gait at most."""
        return float(self.arms.misses[:: self.plan.stride].max())
