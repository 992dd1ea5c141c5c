# SPDX-License-Identifier: GPL-3.0-or-later
"""Coefficients measured from a drag: bend a joint once, hold it, let go.

An artist says it in words that need no fit (``Bend``): under this pull, for so long, it bends so
far, so much of that stays, and what springs back takes so long. With a steady torque T above what
the joint is to bear, τ, for t seconds, eq. 20–23 give

    stays = (T − τ) t / D_d,      bends − stays = T (1 − exp(−K_f t / D_f)) / K_f

so that each coefficient follows from one of the words. Acted out with a limb in the hand
(``measure_shown``), the words are read off the record.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...errors import SettingsError
from ...rotations import Floats

_FEW: Final = 12
_LEAST: Final = float(np.radians(0.1))
"""Radians below which a bend is none."""
_STIFFEST: Final = float(np.radians(0.5))
"""Radians by which everything springs back, as clay does."""
_CLEAR: Final = float(np.radians(1.0))
"""Radians that a hand means when it moves a limb."""
_REST: Final = 0.1
"""Seconds that a hand holds still where it means to stay."""
_SETTLES: Final = 0.03
"""Seconds, where nothing was shown."""


@dataclass(frozen=True)
class MeasuredBend:
    """Coefficients of one joint about one axis."""

    stiffness: float
    """K_f, N·m/rad."""
    damping: float
    """D_f, N·m·s/rad."""
    flow: float
    """D_d, N·m·s/rad; inf for a joint that never yields."""
    yield_torque: float
    """N·m; inf likewise."""


@dataclass(frozen=True)
class Bend:
    """What a joint is to do when it is pulled once."""

    torque: float
    """N·m of the pull."""
    bears: float
    """N·m that the joint bears without giving way."""
    seconds: float
    """How long it is pulled."""
    bends: float
    """Radians at the end of the pull."""
    stays: float
    """Radians that are left once it has come to rest; 0 for a joint that never gives way."""
    settles: float
    """Seconds that springing back takes, D_f/K_f."""


def measure_bend(bend: Bend) -> MeasuredBend:
    """The element that does what a bend says.

    Raises:
        SettingsError: nothing is bent, more stays than was bent, or the pull is too weak for
            anything to stay.
    """
    if not bend.bends > _LEAST:
        raise SettingsError("The joint is not bent.", "Bend it by a few degrees at least.")
    if bend.stays > bend.bends + 1e-9:
        raise SettingsError(
            "More of the bend stays than there was.", "Let at most as much stay as it was bent by."
        )
    yields = bend.stays > 0.0
    if yields and bend.torque <= bend.bears:
        raise SettingsError(
            "The pull is no stronger than what the joint bears, so that nothing would stay.",
            "Pull harder, or let it bear less.",
        )
    # Without any spring at all, steps would have to be as short as it is stiff.
    spring = max(bend.bends - bend.stays, _STIFFEST)
    reached = -np.expm1(-bend.seconds / bend.settles)
    stiffness = bend.torque * float(reached) / spring
    return MeasuredBend(
        stiffness,
        stiffness * bend.settles,
        (bend.torque - bend.bears) * bend.seconds / bend.stays if yields else np.inf,
        bend.bears if yields else np.inf,
    )


def measure_shown(
    times: Floats, angles: Floats, released: float, torque: float, bears: float
) -> Bend:
    """What was acted out with a limb: it is bent, let go, and led to where it is to stay.

    Args:
        times: (samples,) seconds in which the limb was held, ascending.
        angles: (samples,) radians it was turned by.
        released: the time when it was let go for the first time.
        torque: N·m that the pull stands for.
        bears: N·m that the joint is to bear.

    Raises:
        SettingsError: nothing was bent, or it had not come to rest yet.
    """
    t, angle = np.asarray(times, dtype=np.float64), np.asarray(angles, dtype=np.float64)
    pulling = t <= released
    bends = float(angle[pulling][-1]) if pulling.any() else 0.0
    if not bends > _CLEAR:
        raise SettingsError(
            "The drag has bent nothing.",
            "Drag the limb about its joint, by a few degrees at least.",
        )
    late = angle[t >= t[-1] - _REST]
    if not pulling.all() and np.ptp(late) > max(_CLEAR, 0.1 * bends):
        raise SettingsError(
            "The limb was still moving when it was let go.",
            "Hold it still for a moment before you let go.",
        )
    begun = int(np.argmax(angle > 0.02 * bends))
    seconds = max(released - float(t[max(begun - 1, 0)]), 0.05)
    stays = float(np.clip(angle[-1], 0.0, bends))
    if stays < max(_CLEAR, 0.02 * bends):
        stays = 0.0
    settles = _SETTLES
    if bends - stays > max(_CLEAR, 0.02 * bends) and (~pulling).sum() >= _FEW:
        # As if the spring were alone: how fast it goes back to where it stays.
        back = t[~pulling] - released
        left = np.clip((angle[~pulling] - stays) / (bends - stays), 0.0, 1.0)
        area = 0.5 * float(((left[1:] + left[:-1]) * np.diff(back)).sum())
        settles = float(np.clip(area, 0.005, 5.0))
    return Bend(torque, bears, seconds, bends, stays, settles)
