# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows that bind points of bodies: contacts with friction, and holds (pins and grabs).

Each row answers the velocity w of a point, or of a turn, with an impulse p(w), the nearest one
that the row can give to what it would give without bound: of a hold within a ball, of a contact
within Coulomb's cone |p_t| ≤ μ p_n. With a gain a, the gap g and the last step's friction b,

    y_n = −a (w_n + g/h),   y_t = b − a w_t
    apart    p = 0                                                 where μ |y_t| < −y_n
    sticks   p = y                                                 where |y_t| < μ y_n
    slips    p_n = (y_n + μ |y_t|)/(1 + μ²),  p_t = μ p_n y_t/|y_t|     between

or p = P(y), the nearest point of a cone, with y = y₀ − a w. Stretching y stretches p alike, so that
p = P′(y) y: a tangent of the law is the matrix P′ alone, whatever the velocity is.

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

from ...rotations import Floats
from ...rotations.small_batches import matvec, skew, vecdot
from ..puppet import Flags, Integers
from .contact_detection import Contacts

_GAIN = 10.0
"""a in masses of the body: a contact settles within a step, as from a push against a wall."""
_LEAST_SHARE = 0.002
"""Of the figure's mass: what the lightest body counts for there."""
_WEIGHT = 9.81
_TINY = 1e-300
_UNIT = np.eye(3)
_FLAT = np.eye(2)


@dataclass(eq=False)
class Holds:
    """Points held in place and turns held back; rows of pins and grabs."""

    bodies: Integers
    """(holds,)"""
    points: Floats
    """(holds, 3) world; of no account where a turn is held."""
    turns: Flags
    """(holds,) whether the row holds the body's turn, not a point."""
    gains: Floats
    """(holds,) a: N·s per m/s, or N·m·s per rad/s."""
    biases: Floats
    """(holds, 3) impulses at rest: p = bias − a w."""
    bounds: Floats
    """(holds,) greatest impulse; inf where there is none."""
    errors: Floats | None
    """(holds, 3) how far they are from where they are pinned, made good without velocity; None
    where none is pinned."""

    def __len__(self) -> int:
        return len(self.bodies)


_Touch = tuple[Flags, Flags | None, Floats, Floats, Floats | Flags]


@dataclass(eq=False)
class RowImpulses:
    """What the rows do at some velocities, and what is needed for their slopes."""

    wanted: Floats
    """(rows, 3) y."""
    impulses: Floats
    """(rows, 3) p on the body."""
    sticks: Flags
    """(contacts,)"""
    slips: Flags | None
    """(contacts,) None where none does."""
    across: Floats
    """(contacts, 3) y_t."""
    size: Floats
    """(contacts,) |y_t|."""
    shares: Floats | Flags
    """(contacts,) |p_t|/|y_t|; where it slips, what holds it against slipping another way."""
    held: Floats
    """(holds,) share of the impulse without bound."""
    full: bool = False
    """Whether some hold gives as much as it can."""


@dataclass(eq=False)
class Tangent:
    """The rows' laws as planes: p = P y + rest."""

    shares: Floats | None
    """(rows,) where P is this times the unit matrix; else None."""
    planes: Floats | None
    """(rows, 3, 3) P, symmetric and positive semidefinite; else None."""
    rest: Floats | None
    """(rows, 3) None where it is zero."""
    sticks: bytes
    """Which contacts stick."""

    def same(self, answer: RowImpulses) -> bool:
        """Whether these planes are the law at another place, where nothing slips."""
        if self.planes is not None or self.sticks != answer.sticks.tobytes():
            return False
        return not answer.full

    def impulses(self, wanted: Floats) -> Floats:
        """(rows, 3) p at y."""
        if self.planes is None:
            assert self.shares is not None
            return self.shares[:, None] * wanted
        result = matvec(self.planes, wanted)
        return result if self.rest is None else result + self.rest

    def blocks(self) -> Floats:
        """(rows, 3, 3) P."""
        if self.planes is None:
            assert self.shares is not None
            return self.shares[:, None, None] * _UNIT
        return self.planes


class Pattern:
    """What hangs only on which bodies touch or are held: the same for many steps in a row."""

    def __init__(
        self, contacts: Contacts, holds: Holds | None, masses: Floats, step: float, friction: float
    ) -> None:
        """For bodies of masses (bodies,), steps of h and Coulomb's coefficient μ."""
        self._contacts, self._holds = contacts, holds
        count = len(contacts.bodies)
        self.bodies, self.others = contacts.bodies, contacts.others
        if holds is not None:
            self.bodies = np.concatenate([contacts.bodies, holds.bodies])
            self.others = np.concatenate([contacts.others, np.full(len(holds), -1)])
        self.paired = np.flatnonzero(self.others >= 0)
        whole = float(masses.sum())
        lightest = masses[contacts.bodies]
        if len(self.paired):
            other = masses[contacts.others[self.paired]]
            lightest[self.paired] = np.minimum(lightest[self.paired], other)
        self.contact_gains = _GAIN * np.maximum(lightest, _LEAST_SHARE * whole)
        self.gains = self.contact_gains
        if holds is not None:
            self.gains = np.concatenate([self.contact_gains, holds.gains])
            self.turning = count + np.flatnonzero(holds.turns)
            self.unbound = np.ones(len(holds))
            """(holds,) shares of impulses that are within their bounds."""
        # As deep as what rests with twice the figure's weight on one point: so far the contact is a
        # spring. What is deeper is made good by ``corrections``.
        self.deepest = -2.0 * _WEIGHT * step * whole / self.contact_gains
        """(contacts,) least g/h that counts, m/s."""
        self.deepest_gaps = step * self.deepest
        self.column = np.tile(self.gains[:, None], 3)
        """(rows, 3) a, in three columns alike."""
        self.friction = friction
        self.slipping = friction / self.contact_gains
        self.spread = 1.0 / (1.0 + friction * friction)
        self.along = self.spread * np.array([[1.0, friction], [friction, friction * friction]])
        """(2, 2) in n and t, what a slipping contact answers along the edge of its cone."""

    def fits(self, contacts: Contacts, holds: Holds | None) -> bool:
        """Whether the same bodies touch and are held, in the same way."""
        if not _alike(contacts, self._contacts, ("bodies", "others")):
            return False
        if holds is None or self._holds is None:
            return holds is self._holds
        return _alike(holds, self._holds, ("bodies", "turns", "gains"))


def _alike(one: object, other: object, names: tuple[str, ...]) -> bool:
    """Whether arrays of two things are equal; most often they are the same ones."""
    for name in names:
        first, second = getattr(one, name), getattr(other, name)
        if first is not second and not np.array_equal(first, second):
            return False
    return True


class Rows:
    """Contacts and holds of one step, as arrays: contacts first."""

    def __init__(  # noqa: PLR0917
        self,
        contacts: Contacts,
        holds: Holds | None,
        origin: Floats,
        masses: Floats,
        step: float,
        friction: float,
        grips: Floats | None = None,
        pattern: Pattern | None = None,
    ) -> None:
        """Put them together, as seen from the common origin (3,) of spatial velocities.

        The pattern and the friction (contacts, 3) of contacts, ``grips``, across their normals, are
        those of the step before.
        """
        self.contacts = contacts
        self.holds = holds
        if pattern is None or not pattern.fits(contacts, holds):
            pattern = Pattern(contacts, holds, masses, step, friction)
        self.pattern = pattern
        self.count = len(contacts.bodies)
        """Number of contacts, the first rows."""
        self.bodies, self.others = pattern.bodies, pattern.others
        self.paired = pattern.paired
        """Rows between two bodies of the figure."""
        self.gains = pattern.contact_gains
        """(contacts,) a."""
        points = contacts.points
        if holds is not None:
            points = np.concatenate([points, holds.points])
        self.places = points - origin
        self.reach = (self.places @ _REACH + _REACH_AT_ORIGIN).reshape(-1, 3, 6)
        """(rows, 3, 6) from a spatial velocity to that of the point or turn."""
        if holds is not None and len(pattern.turning):
            self.reach[pattern.turning] = _TURNS
        self._step = step
        self._followed: Floats | None = None
        self._slip_of: RowImpulses | None = None
        self._slip = _NO_ONES
        self._closing = contacts.gaps
        if self.count:
            self._closing = np.maximum(contacts.gaps / step, pattern.deepest)
        self.rates = self._closing
        """(contacts,) g/h + μ |w_t|, as ``follow`` was told |w_t| last."""
        self.grips = grips
        """(contacts, 3) b; None for zero."""
        self._asked: Floats | None = None

    def __len__(self) -> int:
        return len(self.bodies)

    @property
    def asked(self) -> Floats:
        """(rows, 3) y₀: what a row wants to give where its point does not move in the world."""
        if self._asked is None:
            self._asked = self._ask()
        return self._asked

    def _ask(self) -> Floats:
        """The same, from the rates."""
        count, holds, contacts = self.count, self.holds, self.contacts
        result = np.empty((len(self.bodies), 3))
        if count:
            asked = result if holds is None else result[:count]
            np.multiply(contacts.normals, (-self.gains * self.rates)[:, None], out=asked)
            if self.grips is not None:
                asked += self.grips
            if contacts.speeds is not None:
                # What counts is how fast the point moves over the surface that it touches.
                asked += self.gains[:, None] * contacts.speeds
        if holds is not None:
            result[count:] = holds.biases
        return result

    def wanted(self, velocities: Floats) -> Floats:
        """What rows want to give, y (rows, 3), at spatial velocities (bodies, 6)."""
        return self.asked - self.pattern.column * self.speeds(velocities)

    def speeds(self, velocities: Floats) -> Floats:
        """The rows' velocities w (rows, 3), of spatial velocities (bodies, 6)."""
        own = velocities.take(self.bodies, 0)
        if len(self.paired):
            own[self.paired] -= velocities[self.others[self.paired]]
        return matvec(self.reach, own)

    def slip(self, answer: RowImpulses) -> Floats:
        """(contacts,) μ |w_t|, m/s: what slipping as then adds to the rates."""
        if self._slip_of is not answer:
            # y_t = b − a w_t.
            apart = answer.across if self.grips is None else answer.across - self.grips
            self._slip = self.pattern.slipping * np.sqrt(vecdot(apart, apart))
            self._slip_of = answer
        return self._slip

    def slip_at(self, velocities: Floats) -> Floats:
        """(contacts,) the same at spatial velocities (bodies, 6)."""
        normals, w = self.contacts.normals, self.speeds(velocities)[: self.count]
        if self.contacts.speeds is not None:
            w = w - self.contacts.speeds
        across = w - vecdot(w, normals)[:, None] * normals
        return self.pattern.friction * np.sqrt(vecdot(across, across))

    def follow(self, slip: Floats, tolerance: float) -> bool:
        """Take over μ |w_t| (contacts,); false where that changes no rate by ``tolerance``, m/s."""
        change = slip if self._followed is None else np.abs(slip - self._followed)
        if not len(change) or change.max() <= tolerance:
            return False
        self._followed = slip
        self.rates = self._closing + slip
        self._asked = None
        return True

    @property
    def followed(self) -> bool:
        return self._followed is not None

    def respond(self, wanted: Floats) -> RowImpulses:
        """Impulses at y (rows, 3)."""
        count, holds = self.count, self.holds
        impulses = np.empty_like(wanted)
        if holds is None:
            return RowImpulses(wanted, impulses, *self._touch(wanted, impulses), _NO_ONES)
        pulls = wanted[count:]
        square, held = vecdot(pulls, pulls), self.pattern.unbound
        full = bool(np.count_nonzero(square > holds.bounds * holds.bounds))
        if full:
            held = np.minimum(holds.bounds / (np.sqrt(square) + _TINY), 1.0)
            np.multiply(pulls, held[:, None], out=impulses[count:])
        else:
            impulses[count:] = pulls
        touch = _UNTOUCHED
        if count:
            touch = self._touch(wanted[:count], impulses[:count])
        return RowImpulses(wanted, impulses, *touch, held, full=full)

    def _touch(self, y: Floats, impulses: Floats) -> _Touch:
        """Contacts' impulses (contacts, 3) at y, and what ``RowImpulses`` tells of them."""
        normals, friction = self.contacts.normals, self.pattern.friction
        push = vecdot(y, normals)
        across = y - push[:, None] * normals
        size = np.sqrt(vecdot(across, across))
        # Less, not equal: without friction nothing sticks, and what is apart is not drawn.
        sticks = size < friction * push
        lift = push + friction * size
        slips = (lift > 0.0) > sticks
        if not np.count_nonzero(slips):
            np.multiply(y, sticks[:, None], out=impulses)
            return sticks, None, across, size, sticks
        # The greater one is y_n where it sticks, and neither is above zero where it is apart.
        load = np.maximum(push, self.pattern.spread * lift)
        np.maximum(load, 0.0, out=load)
        shares = np.minimum(friction * load / (size + _TINY), 1.0)
        np.multiply(normals, load[:, None], out=impulses)
        impulses += shares[:, None] * across
        return sticks, slips, across, size, shares

    def tangent(self, answer: RowImpulses) -> Tangent:
        """The laws as planes that touch them at y."""
        holds, count = self.holds, self.count
        sticks = answer.sticks.tobytes()
        full = answer.full
        if answer.slips is None and not full:
            shares = answer.held
            if count:
                shares = np.concatenate([answer.sticks, shares], dtype=np.float64)
            return Tangent(shares, None, None, sticks)
        planes = np.empty((len(self), 3, 3))
        if count:
            self._cones(answer, planes[:count])
        rest = None
        if holds is not None:
            held = answer.held
            planes[count:] = held[:, None, None] * _UNIT if full else _UNIT
            if full:
                pulls = answer.impulses[count:]
                # Not by the bound: it may have changed since.
                way = pulls / (np.sqrt(vecdot(pulls, pulls)) + _TINY)[:, None]
                part = np.where(held < 1.0, held, 0.0)[:, None] * way
                planes[count:] -= part[:, :, None] * way[:, None, :]
                rest = np.zeros((len(self), 3))
                rest[count:] = np.where((held < 1.0)[:, None], pulls, 0.0)
        return Tangent(None, planes, rest, sticks)

    def _cones(self, answer: RowImpulses, planes: Floats) -> None:
        """Fill in P′ of the contacts (contacts, 3, 3)."""
        if answer.slips is None:
            np.multiply(answer.sticks[:, None, None], _UNIT, out=planes)
            return
        # Where it slips, 1/(1 + μ²) along n + μ t, |p_t|/|y_t| sideways of n and t:
        # c 1 + (n + μ t)(n + μ t)ᵀ/(1 + μ²) − c (n nᵀ + t tᵀ) = c 1 + [n t] k [n t]ᵀ.
        pattern, shares = self.pattern, answer.shares
        plane = np.empty((len(shares), 2, 3))
        plane[:, 0] = self.contacts.normals
        np.divide(answer.across, (answer.size + _TINY)[:, None], out=plane[:, 1])
        inner = pattern.along - shares[:, None, None] * _FLAT
        inner *= answer.slips[:, None, None]
        np.matmul(plane.transpose(0, 2, 1), inner @ plane, out=planes)
        planes += shares[:, None, None] * _UNIT

    def corrections(self, fastest: float) -> Floats | None:
        """Velocities (rows, 3) that make good what has slipped in; None where nothing has.

        Overlap that is deeper than it need be and pins that are off their place, a fifth of it
        each step and no faster than ``fastest``. Used for positions alone, never kept as velocity.
        """
        count = self.count
        step = self._step
        room = self.contacts.gaps - self.pattern.deepest_gaps if count else _NO_ONES
        deep = count > 0 and room.min() < 0.0
        errors = None if self.holds is None else self.holds.errors
        off = errors is not None and np.count_nonzero(errors) > 0
        if not (deep or off):
            return None
        result = np.zeros((len(self.bodies), 3))
        if deep:
            speed = np.clip(-0.2 / step * room, 0.0, fastest)
            result[:count] = speed[:, None] * self.contacts.normals
        if off:
            assert errors is not None
            speed = 0.2 / step * errors
            length = np.sqrt(vecdot(speed, speed)) + _TINY
            result[count:] = speed * np.minimum(fastest / length, 1.0)[:, None]
        return result


_NOBODY = np.zeros(0, dtype=bool)
_NO_ROWS = np.zeros((0, 3))
_NO_ONES = np.zeros(0)
_UNTOUCHED: _Touch = (_NOBODY, None, _NO_ROWS, _NO_ONES, _NO_ONES)
_REACH = np.zeros((3, 18))
_REACH.reshape(3, 3, 6)[:, :, :3] = -skew(np.eye(3))
_TURNS = np.concatenate([np.eye(3), np.zeros((3, 3))], axis=1)
_REACH_AT_ORIGIN = np.concatenate([np.zeros((3, 3)), np.eye(3)], axis=1).ravel()
