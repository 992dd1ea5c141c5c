# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways from 0 to 1 that begin and end gently, of shares (…); they are held beyond both ends."""

from __future__ import annotations

import numpy as np

from .rotations import Floats


def smooth_step(share: Floats) -> Floats:
    """``3t² − 2t³``: level at both ends."""
    t = np.clip(share, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def least_jerk(share: Floats) -> Floats:
    """``10t³ − 15t⁴ + 6t⁵``: no acceleration at its ends either.

    Of all movements from rest to rest in a time it has the least jerk (Flash and Hogan, "The
    coordination of arm movements", Journal of Neuroscience 5, 1985). Next to a hold nothing moves
    at first.
    """
    t = np.clip(share, 0.0, 1.0)
    return t * t * t * (10.0 + t * (6.0 * t - 15.0))
