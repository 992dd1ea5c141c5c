# SPDX-License-Identifier: GPL-3.0-or-later
"""How much room arms that hold on leave each other, seen from above.

An arm that holds on is, from above, a line from the body to where it meets the ground, and from
there to its tip. Two such lines that come near each other are arms that lie on each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats

_FREE: Final = np.linspace(0.4, 1.0, 6)
"""Places that are looked at between body and ground: near the body all arms are close …"""
_LYING: Final = np.linspace(0.2, 1.0, 5)
"""… and those on the ground."""


@dataclass(frozen=True, eq=False)
class Outline:
    """Arms from above, metres; shapes that go together."""

    roots: Floats
    """(…, 2) where they begin."""
    places: Floats
    """(…, 2) where they meet the ground."""
    tips: Floats
    """(…, 2) where they end."""

    def points(self) -> Floats:
        """(…, points, 2) along them, but for where they are close to the body."""
        roots, places, tips = (each[..., None, :] for each in (self.roots, self.places, self.tips))
        free, lying = _FREE[:, None], _LYING[:, None]
        before, after = roots + free * (places - roots), places + lying * (tips - places)
        shape = np.broadcast_shapes(before.shape[:-2], after.shape[:-2])
        return np.concatenate(
            [np.broadcast_to(each, (*shape, *each.shape[-2:])) for each in (before, after)], axis=-2
        )


def clearance(one: Outline, other: Outline) -> Floats:
    """How far (…,) each of some arms is from one of others."""
    apart = one.points()[..., :, None, :] - other.points()[..., None, :, :]
    return np.sqrt(np.min(np.sum(apart * apart, axis=-1), axis=(-2, -1)))
