# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows that bind points of bodies: contacts with friction, and holds (pins and grabs).

Each row answers the velocity w of a point, or of a turn, with an impulse p(w), the nearest one
that the row can give to what it would give without bound: of a hold within a ball, of a contact
within Coulomb's cone |p_t| ≤ μ p_n. With a gain a, the gap g and the last step's friction b,

    y_n = −a (w_n + g/h),   y_t = b − a w_t
    apart    p = 0                                                 where μ |y_t| < −y_n
    sticks   p = y                                                 where |y_t| ≤ μ y_n
    slips    p_n = (y_n + μ |y_t|)/(1 + μ²),  p_t = μ p_n y_t/|y_t|     between

That is the cone complementarity of Anitescu (2006), softened as by Castro et al. (2022): every
impulse is the slope of a convex function of the velocities, so the step has one solution and it can
always be found. What sticks is held by b wholly once it is at rest, so it does not creep; what
rests sinks in by h p_n/a, less than a micrometre. By itself this law lifts what slips off with
w_n = μ |w_t|. So the gap is seen as g + h μ |w_t|, with |w_t| from before (De Saxcé and Feng 1998):
at the solution where both are the same, it is Coulomb's own law.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..rotations import Floats, cross
from .contacts import Contacts
from .kinematics import skew

Integers = NDArray[np.int64]

_GAIN = 10.0
"""a in masses of the body: a contact settles within a step, as from a push against a wall."""
_LEAST_SHARE = 0.002
"""Of the figure's mass: what the lightest body counts for there."""
_WEIGHT = 9.81
_TINY = 1e-300
_UNIT = np.eye(3)
_ONES = np.ones(3)


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
    """(holds, 3) impulses at rest: p = bias − a w."""
    bounds: Floats
    """(holds,) greatest impulse; inf where there is none."""
    errors: Floats
    """(holds, 3) how far they are from where they are pinned, made good without velocity."""

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.bodies)


@dataclass(frozen=True, eq=False)
class Answer:
    """What the rows do at some velocities, and what is needed for their slopes."""

    impulses: Floats
    """(rows, 3) p on the body."""
    sticks: NDArray[np.bool_]
    """(contacts,)"""
    slips: NDArray[np.bool_] | None
    """(contacts,) None where none does."""
    toward: Floats
    """(contacts, 3) the way of friction where it slips, unit."""
    aside: Floats
    """(contacts,) |p_t|/|y_t| where it slips: what holds it against slipping another way."""
    shares: Floats
    """(holds,) of the impulse without bound."""


class Rows:
    """Contacts and holds of one step, as arrays: contacts first."""

    def __init__(  # noqa: PLR0917
        self,
        contacts: Contacts,
        holds: Holds | None,
        origin: Floats,
        masses: Floats,
        step: float,
        grips: Floats | None = None,
    ) -> None:
        """Put them together.

        Args:
            contacts: those near enough.
            holds: pins and grabs; None where there are none.
            origin: (3,) the common one of spatial velocities.
            masses: (bodies,)
            step: h.
            grips: (contacts, 3) friction of the step before; None where nothing touched.
        """
        self.contacts = contacts
        self.holds = holds
        count = len(contacts.bodies)
        self.count = count
        """Number of contacts, the first rows."""
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
        self.places = points
        """(rows, 3) of their points, from the origin."""
        size = len(self.bodies)
        self.reach = np.empty((size, 3, 6))
        """(rows, 3, 6) from a spatial velocity to that of the point or turn."""
        self.reach[:, :, :3] = skew(-points)
        self.reach[:, :, 3:] = _UNIT
        if holds is not None:
            turning = count + np.flatnonzero(holds.turns)
            self.reach[turning, :, :3] = _UNIT
            self.reach[turning, :, 3:] = 0.0
        self.paired = np.flatnonzero(self.others >= 0)
        """Rows between two bodies of the figure."""
        whole = float(masses.sum())
        lightest = masses[contacts.bodies]
        if len(self.paired):
            other = masses[contacts.others[self.paired]]
            lightest[self.paired] = np.minimum(lightest[self.paired], other)
        self.gains = _GAIN * np.maximum(lightest, _LEAST_SHARE * whole)
        """(contacts,) a."""
        # As deep as what rests with twice the figure's weight on one point: so far the contact is a
        # spring. What is deeper is made good by ``corrections``.
        self._spring = 2.0 * _WEIGHT * step * whole / self.gains
        self._closing = np.maximum(contacts.gaps / step, -self._spring)
        self.rates = self._closing
        """(contacts,) g/h + μ |w_t|, as ``follow`` was told |w_t| last."""
        self._followed = np.zeros(count)
        self._fastest = 0.0
        self._step = step
        self.grips: Floats | None = None
        """(contacts, 3) b; None for zero."""
        if grips is not None and count:
            normals = contacts.normals
            self.grips = grips - ((grips * normals) @ _ONES)[:, None] * normals
        self._spread = 1.0 / (1.0 + contacts.friction * contacts.friction)
        self.still = not self.targets.any()
        """Whether no obstacle moves: then w is the velocity of the points themselves."""

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.bodies)

    def speeds(self, velocities: Floats) -> Floats:
        """The rows' velocities w (rows, 3), of spatial velocities (bodies, 6)."""
        own = velocities[self.bodies]
        if len(self.paired):
            own[self.paired] -= velocities[self.others[self.paired]]
        result = (self.reach @ own[:, :, None])[:, :, 0]
        return result if self.still else result - self.targets

    def follow(self, speeds: Floats, tolerance: float, *, slips_none: bool = False) -> bool:
        """Take |w_t| from w (rows, 3); false where that changes no rate by ``tolerance``, m/s.

        ``slips_none`` tells that nothing slips at w, which saves looking.
        """
        count = self.count
        if not count:
            return False
        if slips_none and self._fastest <= tolerance:
            return False
        normals, w = self.contacts.normals, speeds[:count]
        across = w - ((w * normals) @ _ONES)[:, None] * normals
        slip = np.sqrt((across * across) @ _ONES)
        change = self.contacts.friction * np.abs(slip - self._followed)
        if change.max() <= tolerance:
            return False
        self._followed = slip
        self._fastest = float((self.contacts.friction * slip).max())
        self.rates = self._closing + self.contacts.friction * slip
        return True

    def answer(self, speeds: Floats) -> Answer:
        """Impulses at w (rows, 3)."""
        count = self.count
        holds = self.holds
        impulses = np.empty_like(speeds)
        sticks, slips, toward, aside = _NOBODY, None, _NO_ROWS, _NO_ONES
        if count:
            normals, friction = self.contacts.normals, self.contacts.friction
            w = speeds[:count] if holds is not None else speeds
            into = (w * normals) @ _ONES
            push = self.gains * (-self.rates - into)
            pull = self.gains[:, None] * (into[:, None] * normals - w)
            if self.grips is not None:
                pull += self.grips
            size = np.sqrt((pull * pull) @ _ONES)
            most = friction * push
            sticks = size <= most
            slipping = push + friction * size > 0.0
            slipping &= ~sticks
            load = np.where(sticks, push, 0.0)
            if slipping.any():
                slips = slipping
                size += _TINY
                sliding = self._spread * (push + friction * size)
                load = np.where(slips, sliding, load)
                aside = friction * sliding / size
                toward = pull / size[:, None]
                pull *= np.where(slips, aside, sticks)[:, None]
            else:
                pull *= sticks[:, None]
            impulses[:count] = load[:, None] * normals + pull
        if holds is None:
            return Answer(impulses, sticks, slips, toward, aside, _NO_ONES)
        wanted = holds.biases - holds.gains[:, None] * speeds[count:]
        shares = np.minimum(holds.bounds / (np.sqrt((wanted * wanted) @ _ONES) + _TINY), 1.0)
        impulses[count:] = shares[:, None] * wanted
        return Answer(impulses, sticks, slips, toward, aside, shares)

    def slopes(self, answer: Answer) -> Floats:
        """−∂p/∂w (rows, 3, 3), symmetric and positive semidefinite."""
        count = self.count
        slopes = np.empty((len(self.bodies), 3, 3))
        if count:
            block = np.where(answer.sticks, self.gains, 0.0)[:, None, None] * _UNIT
            slips = answer.slips
            if slips is not None:
                normals = self.contacts.normals
                gains = np.where(slips, self.gains, 0.0)
                way = normals + self.contacts.friction[:, None] * answer.toward
                block += ((gains * self._spread)[:, None] * way)[:, :, None] * way[:, None, :]
                sideways = cross(normals, answer.toward)
                held = np.where(slips, gains * answer.aside, 0.0)
                block += (held[:, None] * sideways)[:, :, None] * sideways[:, None, :]
            slopes[:count] = block
        holds = self.holds
        if holds is not None:
            shares = answer.shares
            slope = (holds.gains * shares)[:, None, None] * _UNIT
            full = shares < 1.0
            if full.any():
                way = answer.impulses[count:] / holds.bounds[:, None]
                part = np.where(full, holds.gains * shares, 0.0)[:, None] * way
                slope -= part[:, :, None] * way[:, None, :]
            slopes[count:] = slope
        return slopes

    def corrections(self, fastest: float) -> Floats | None:
        """Velocities (rows, 3) that make good what has slipped in; None where nothing has.

        Overlap that is deeper than it need be and pins that are off their place, a fifth of it
        each step and no faster than ``fastest``. Used for positions alone, never kept as velocity.
        """
        count = self.count
        step = self._step
        depth = -self.contacts.gaps - step * self._spring
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


_NOBODY = np.zeros(0, dtype=bool)
_NO_ROWS = np.zeros((0, 3))
_NO_ONES = np.zeros(0)
