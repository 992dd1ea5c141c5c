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

from ..rotations import Floats, cross
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
class Pieces:
    """Which piece of its law each row is on, for some impulses and velocities."""

    miss: float
    """Largest difference of an impulse from what its law asks, N·s; 0 where none were given."""
    acts: NDArray[np.bool_]
    """(contacts,) pressing."""
    slips: NDArray[np.bool_] | None
    """(contacts,) pressing and slipping; None where none is."""
    toward: Floats
    """(contacts, 3) the way of friction where it slips."""
    aside: Floats
    """(contacts,) what holds against slipping another way."""
    wanted: Floats
    """(holds, 3) impulses of the holds without bounds."""
    shares: Floats
    """(holds,) of these that the bounds allow."""


@dataclass(frozen=True, eq=False)
class Tangent:
    """Rows replaced by linear ones: p = offsets − slopes w."""

    offsets: Floats
    """(rows, 3)"""
    slopes: Floats
    """(rows, 3, 3)"""
    symmetric: bool
    """Whether all slopes are; not where a contact slips, for its load sets its friction."""

    def impulses(self, speeds: Floats) -> Floats:
        """p (rows, 3) at w (rows, 3)."""
        return self.offsets - (self.slopes @ speeds[:, :, None])[:, :, 0]


class Rows:
    """Contacts and holds of one step, as arrays: contacts first."""

    def __init__(
        self,
        contacts: Contacts,
        holds: Holds | None,
        origin: Floats,
        masses: Floats,
        gain: float,
        step: float,
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
        self.reach[:, :, 3:] = _UNIT
        if holds is not None:
            turning = count + np.flatnonzero(holds.turns)
            self.reach[turning, :, :3] = _UNIT
            self.reach[turning, :, 3:] = 0.0
        self._scales = masses[contacts.bodies]
        self._kept = (1.0 - self._scales / gain)[:, None]
        self.still = holds is None and not self.targets.any()
        """Whether no obstacle moves: then w is the velocity of the points themselves."""
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
        result = (self.reach @ own[:, :, None])[:, :, 0]
        return result if self.still else result - self.targets

    def pieces(self, impulses: Floats | None, speeds: Floats) -> Pieces:
        """The pieces next to impulses and velocities that need not fit each other.

        A contact's law is p = Π(p − r (w + p/a)), Π the nearest point of Coulomb's cone at the
        load p_n, for any r > 0 [Alart and Curnier 1991]. The piece of Π that the argument lies in
        tells whether the contact is apart, sticks or slips, and which way. With r near the mass
        that the contact feels, a foot that would slip back and forth is found to stick.

        Args:
            impulses: (rows, 3); where None, or NaN in a row, nothing is known of them and
                contacts that close are taken to stick.
            speeds: (rows, 3) w.
        """
        count = len(self.contacts)
        acts, slips, toward, aside = _NOTHING
        miss = 0.0
        if count:
            w = speeds[:count]
            normals = self.contacts.normals
            into = (w * normals) @ _ONES
            closing = into + self._rates
            if impulses is None:
                acts = closing <= 0.0
            else:
                known, scales = impulses[:count], self._scales
                # Of new ones nothing is known but whether they close.
                fresh = np.isnan(known[:, 0])
                fresh = fresh if fresh.any() else None
                if fresh is not None:
                    known = np.where(fresh[:, None], 0.0, known)
                push = (known * normals) @ _ONES
                load = push - scales * (closing + push / self.gain)
                acts = load >= 0.0
                np.maximum(load, 0.0, out=load)
                # Across the normal: p_t (1 − r/a) − r w_t.
                slide = self._kept * known - scales[:, None] * w
                slide -= ((slide * normals) @ _ONES)[:, None] * normals
                size = np.sqrt((slide * slide) @ _ONES)
                size += _TINY
                share = np.minimum(self.contacts.friction * load / size, 1.0)
                right = share[:, None] * slide + load[:, None] * normals
                miss = float(np.abs(right - known).max())
                slipping = acts & (share < 1.0)
                if fresh is not None:
                    slipping &= ~fresh
                if slipping.any():
                    slips = slipping
                    toward = slide / size[:, None]
                    aside = scales * share / np.maximum(1.0 - share, 1e-9)
                    np.minimum(aside, self.gain, out=aside)
        holds = self.holds
        if holds is None:
            return Pieces(miss, acts, slips, toward, aside, _NO_ROWS, _NO_ONES)
        wanted = holds.biases - holds.gains[:, None] * speeds[count:]
        shares = np.minimum(holds.bounds / (np.sqrt((wanted * wanted) @ _ONES) + _TINY), 1.0)
        if impulses is not None:
            right = shares[:, None] * wanted
            miss = max(miss, float(np.abs(impulses[count:] - right).max()))
        return Pieces(miss, acts, slips, toward, aside, wanted, shares)

    def tangent(self, pieces: Pieces, speeds: Floats) -> Tangent:
        """The linear rows of these pieces, found at w (rows, 3)."""
        count = len(self.contacts)
        size = len(self.bodies)
        offsets = np.empty((size, 3))
        slopes = np.empty((size, 3, 3))
        if count:
            self._contact_tangent(pieces, offsets[:count], slopes[:count])
        holds = self.holds
        if holds is not None:
            shares, wanted = pieces.shares, pieces.wanted
            slope = (holds.gains * shares)[:, None, None] * _UNIT
            full = shares < 1.0
            if full.any():
                length = np.sqrt((wanted * wanted) @ _ONES) + _TINY
                way = np.where(full, np.sqrt(holds.gains * shares) / length, 0.0)[:, None] * wanted
                slope -= way[:, :, None] * way[:, None, :]
            slopes[count:] = slope
            offsets[count:] = shares[:, None] * wanted
            offsets[count:] += (slope @ speeds[count:, :, None])[:, :, 0]
        return Tangent(offsets, slopes, pieces.slips is None)

    def _contact_tangent(self, pieces: Pieces, offsets: Floats, slopes: Floats) -> None:
        normals = self.contacts.normals
        stiff = np.where(pieces.acts, self.gain, 0.0)
        slips = pieces.slips
        if slips is None:
            # Sticks or is apart: a (or 0), the same in all directions.
            slopes[:] = stiff[:, None, None] * _UNIT
            offsets[:] = (-stiff * self._rates)[:, None] * normals
            return
        toward = pieces.toward
        grip = np.where(slips, self.contacts.friction, 0.0)
        push_way = normals + grip[:, None] * toward
        sideways = cross(normals, toward)
        slopes[:] = np.where(slips, 0.0, stiff)[:, None, None] * _UNIT
        pressed = (np.where(slips, stiff, 0.0)[:, None] * push_way)[:, :, None]
        slopes += pressed * normals[:, None, :]
        held = np.where(slips, pieces.aside, 0.0)
        slopes += (held[:, None] * sideways)[:, :, None] * sideways[:, None, :]
        offsets[:] = (-stiff * self._rates)[:, None] * push_way

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


_UNIT = np.eye(3)
_ONES = np.ones(3)
_NO_ROWS = np.zeros((0, 3))
_NO_ONES = np.zeros(0)
_NOTHING = (np.zeros(0, dtype=bool), None, _NO_ROWS, _NO_ONES)
