# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows that bind points of bodies: contacts with friction, and holds (pins and grabs).

Each row answers the velocity w (3,) of a point, or of a turn, with an impulse p(w):

    contact  p_n = max(0, −a (w_n + g/h)),   p_t = −min(a, μ p_n/|w_t|) w_t
    hold     p = b − a w, no longer than a bound

a is a gain so large that what it yields by cannot be seen; it is the softness that the source's
solver needs as well, so that contacts at more points than a body has freedoms share their load. A
gap g > 0 lets the point come just as far as the surface. The contact is Coulomb's: within the cone
it sticks (but for a), on the cone it slips against the force.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..rotations import Floats
from .contacts import Contacts
from .kinematics import skew

Integers = NDArray[np.int64]

_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Holds:
    """Points held in place and turns held back; rows of pins and grabs."""

    bodies: Integers
    """(holds,)"""
    points: Floats
    """(holds, 3) world; of no account where a turn is held."""
    turns: NDArray[np.bool_]
    """(holds,) whether the row holds the body's turn, not a point."""
    gains: Floats
    """(holds,) a: N·s per m/s, or N·m·s per rad/s."""
    biases: Floats
    """(holds, 3) b, impulses."""
    bounds: Floats
    """(holds,) greatest impulse; inf where there is none."""
    errors: Floats
    """(holds, 3) how far they are from where they are pinned, made good without velocity."""

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.bodies)


@dataclass(frozen=True, eq=False)
class Answer:
    """What the rows do at given velocities."""

    impulses: Floats
    """(rows, 3) p on the body."""
    slopes: Floats
    """(rows, 3, 3) −∂p/∂w."""
    pressing: NDArray[np.bool_]
    """(contacts,) which contacts carry load."""
    symmetric: bool
    """Whether all slopes are; not where a contact slips under a bound that its load sets."""


class Rows:
    """Contacts and holds of one step, as arrays: contacts first."""

    def __init__(
        self, contacts: Contacts, holds: Holds | None, origin: Floats, gain: float, step: float
    ) -> None:
        self.contacts = contacts
        self.holds = holds
        count = len(contacts)
        self.gain = gain
        self._rates = np.maximum(contacts.gaps, 0.0) / step
        if holds is None:
            self.bodies = contacts.bodies
            self.others = contacts.others
            points = contacts.points - origin
            self.targets = contacts.speeds
        else:
            self.bodies = np.concatenate([contacts.bodies, holds.bodies])
            self.others = np.concatenate([contacts.others, np.full(len(holds), -1)])
            points = np.concatenate([contacts.points, holds.points]) - origin
            self.targets = np.concatenate([contacts.speeds, np.zeros((len(holds), 3))])
        size = len(self.bodies)
        self.reach = np.empty((size, 3, 6))
        """(rows, 3, 6) from a spatial velocity to that of the point or turn."""
        self.reach[:, :, :3] = skew(-points)
        self.reach[:, :, 3:] = np.eye(3)
        if holds is not None:
            turning = count + np.flatnonzero(holds.turns)
            self.reach[turning, :, :3] = np.eye(3)
            self.reach[turning, :, 3:] = 0.0
        normals = contacts.normals
        self._along_normal = normals[:, :, None] * normals[:, None, :]
        self.paired = np.flatnonzero(self.others >= 0)
        """Rows between two bodies of the figure."""

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.bodies)

    def speeds(self, velocities: Floats) -> Floats:
        """w (rows, 3) of spatial velocities (bodies, 6)."""
        own = velocities[self.bodies]
        if len(self.paired):
            own[self.paired] -= velocities[self.others[self.paired]]
        return (self.reach @ own[:, :, None])[:, :, 0] - self.targets

    def answer(self, speeds: Floats, limits: Floats | None = None) -> Answer:
        """Impulses and slopes at w (rows, 3).

        Args:
            speeds: w.
            limits: (contacts,) bounds of the friction; what the contacts' own load sets if None.
        """
        count = len(self.contacts)
        size = len(self.bodies)
        impulses = np.empty((size, 3))
        slopes = np.empty((size, 3, 3))
        pressing = np.zeros(0, dtype=bool)
        symmetric = True
        if count:
            normals = self.contacts.normals
            w = speeds[:count]
            into = (w * normals).sum(axis=1)
            push = -self.gain * (into + self._rates)
            pressing = push >= 0.0
            np.maximum(push, 0.0, out=push)
            along = w - into[:, None] * normals
            slip = np.sqrt((along * along).sum(axis=1))
            bound = self.contacts.friction * push if limits is None else limits
            slip += _TINY
            factor = bound / slip
            slips = factor < self.gain
            np.minimum(factor, self.gain, out=factor)
            impulses[:count] = push[:, None] * normals - factor[:, None] * along
            # factor (1 − n nᵀ) + a n nᵀ, less the part along the slip, where friction is constant.
            stiff = np.where(pressing, self.gain, 0.0) - factor
            block = stiff[:, None, None] * self._along_normal
            if slips.any():
                toward = np.where(slips, 1.0 / slip, 0.0)[:, None] * along
                lost = factor[:, None] * toward
                if limits is None:
                    # As the load grows with the speed into the surface, friction's bound does.
                    symmetric = False
                    slope = np.where(pressing, self.gain * self.contacts.friction, 0.0)
                    lost = lost + slope[:, None] * normals
                block -= toward[:, :, None] * lost[:, None, :]
            index = _DIAGONAL
            block[:, index, index] += factor[:, None]
            slopes[:count] = block
        holds = self.holds
        if holds is not None:
            wanted = holds.biases - holds.gains[:, None] * speeds[count:]
            length = np.sqrt((wanted * wanted).sum(axis=1)) + _TINY
            share = np.minimum(holds.bounds / length, 1.0)
            impulses[count:] = share[:, None] * wanted
            slope = (holds.gains * share)[:, None, None] * np.eye(3)
            full = share < 1.0
            if full.any():
                way = np.where(full, np.sqrt(holds.gains * share) / length, 0.0)[:, None] * wanted
                slope -= way[:, :, None] * way[:, None, :]
            slopes[count:] = slope
        return Answer(impulses, slopes, pressing, symmetric)

    def corrections(self, step: float, slack: float, fastest: float) -> Floats | None:
        """Velocities (rows, 3) that make good what has slipped in; None where nothing has.

        Overlap deeper than ``slack`` and pins that are off their place, a fifth of it each step
        and no faster than ``fastest``. Used for positions alone and never kept as velocity.
        """
        count = len(self.contacts)
        depth = -self.contacts.gaps - slack
        deep = depth.max(initial=0.0) > 0.0
        off = self.holds is not None and bool(self.holds.errors.any())
        if not (deep or off):
            return None
        result = np.zeros((len(self.bodies), 3))
        if deep:
            speed = np.clip(0.2 / step * depth, 0.0, fastest)
            result[:count] = speed[:, None] * self.contacts.normals
        if off:
            assert self.holds is not None
            speed = 0.2 / step * self.holds.errors
            length = np.sqrt((speed * speed).sum(axis=1, keepdims=True)) + _TINY
            result[count:] = speed * np.minimum(fastest / length, 1.0)
        return result


_DIAGONAL = np.arange(3)
