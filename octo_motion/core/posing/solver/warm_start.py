# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the solver begins: with what joints, contacts and holds did in the step before."""

from __future__ import annotations

from copy import copy

import numpy as np

from ...rotations import Floats
from ...rotations.small_batches import vecdot
from ..puppet import ElementResponse, Flags, Integers, PlasticLaw
from .bodies import Bodies
from .constraint_rows import RowImpulses, Rows
from .contact_detection import Contacts
from .newton import InitialGuess, Solution
from .problem import Problem
from .tree import Tree


class WarmStart:
    """What one step leaves to the next."""

    def __init__(self, tree: Tree) -> None:
        self._tree = tree
        self.contacts = ContactMemory()
        self.forget()

    def forget(self) -> None:
        """Begin anew, from rest."""
        self.speeds: Floats = np.zeros((len(self._tree.layout.bodies), 3))
        """(slots, 3) u."""
        self._response: ElementResponse | None = None
        self._pressed = _NOBODY
        self.contacts.forget()

    def use_law(self, law: PlasticLaw) -> None:
        """What elements bore without flow is seen with another law."""
        if self._response is not None:
            self._response = law.answer(self._response.trial)

    def start(self, problem: Problem, bodies: Bodies) -> InitialGuess:
        """Where to begin with a step's problem; its rows are told how fast they slip."""
        rows = self._rows(problem, bodies) if len(problem.rows.bodies) else None
        pressed = None
        if problem.stops:
            pressed = (problem.stops[0].labels[:, None] == self._pressed).any(axis=1)
        return InitialGuess(self.speeds, rows, self._response, pressed)

    def _rows(self, problem: Problem, bodies: Bodies) -> RowImpulses:
        """What the rows of this step did in the step before."""
        rows, memory = problem.rows, self.contacts
        before = memory.before(rows)
        if before is None:
            # New rows begin with what they would do at the velocities of before.
            self._tree.place(problem.joints)
            there = rows.wanted(self._tree.velocities(self.speeds))
            before = memory.before_or(rows, there)
            rows.follow(rows.slip_at(bodies.velocities(problem.skewed)), 0.0)
        elif before.slips is not None:
            known = len(memory.slips) == rows.count
            slip = memory.slips if known else rows.slip_at(bodies.velocities(problem.skewed))
            rows.follow(slip, 0.0)
        return before

    def keep(self, problem: Problem, solution: Solution, most: float) -> None:
        """Remember a step; ``most`` is the friction of a contact that is held on to, N·s."""
        self.speeds = solution.speeds
        self._response = None if solution.response.flows is None else solution.response
        self._pressed = _NOBODY
        if solution.pressed is not None:
            self._pressed = problem.stops[0].labels[solution.pressed]
        self.contacts.keep(problem.rows, solution.rows, most)

    def state(self) -> WarmStart:
        """A copy, to come back to. No array of it is changed later: each step makes its own."""
        kept = copy(self)
        kept.contacts = copy(self.contacts)
        return kept

    def restore(self, state: WarmStart, law: PlasticLaw) -> None:
        self.speeds, self._pressed = state.speeds, state._pressed
        self._response = state._response
        self.use_law(law)
        memory = state.contacts
        self.contacts.set(memory.labels, memory.normals, memory.grips, memory.wanted, memory.slips)


class ContactMemory:
    """Friction, slip and wishes of the last step's contacts, found again by their labels."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        self.set(np.zeros(0, np.int64), _NO_ROWS, _NO_ROWS, _NO_ROWS, _NO_ONES)

    def set(
        self, labels: Integers, normals: Floats, grips: Floats, wanted: Floats, slips: Floats
    ) -> None:
        """Take over what a snapshot has."""
        self.labels = labels
        self._key = labels.tobytes()
        self.normals = normals
        """(contacts, 3) of the step before."""
        self.grips = grips
        """(contacts, 3) friction b of the step before, N·s."""
        self.wanted = wanted
        """(rows, 3) y of the step before, see ``rows``."""
        self.slips = slips
        """(contacts,) μ |w_t| at its end, m/s; none where it is not known, or nothing slipped."""
        self._answer: RowImpulses | None = None

    def grips_of(self, contacts: Contacts) -> Floats | None:
        """(contacts, 3) b of these contacts, across their normals, zero for those that are new;
        None where all are.
        """
        if not (len(self.labels) and len(contacts.labels)):
            return None
        normals = contacts.normals
        if self.knows(contacts):
            grips = self.grips
            if normals is self.normals or np.array_equal(normals, self.normals):
                return grips
        else:
            found, same = self._places(contacts)
            grips = self.grips.take(found, 0) * same
        return grips - vecdot(grips, normals)[:, None] * normals

    def knows(self, contacts: Contacts) -> bool:
        """Whether these are the contacts of the step before."""
        return contacts.labels is self.labels or contacts.labels.tobytes() == self._key

    def before(self, rows: Rows) -> RowImpulses | None:
        """What these rows did in the step before; None where some are new."""
        if len(self.wanted) != len(rows) or not self.knows(rows.contacts):
            return None
        if self._answer is not None and self.normals is rows.contacts.normals:
            return self._answer
        return rows.respond(self.wanted)

    def before_or(self, rows: Rows, there: Floats) -> RowImpulses:
        """The same, with y (rows, 3) for those that are new."""
        count = rows.count
        if len(self.labels) and count:
            found, same = self._places(rows.contacts)
            there[:count] = np.where(same, self.wanted.take(found, 0), there[:count])
        return rows.respond(there)

    def _places(self, contacts: Contacts) -> tuple[Integers, Flags]:
        """Where contacts are in what is remembered, and (contacts, 1) whether they are there."""
        order = self.labels.argsort()
        ordered = self.labels.take(order)
        place = np.minimum(ordered.searchsorted(contacts.labels), len(order) - 1)
        return order.take(place), (ordered.take(place) == contacts.labels)[:, None]

    def keep(self, rows: Rows, answer: RowImpulses | None, most: float) -> None:
        """Remember what the rows of a step did, and of a contact's friction so much at most, N·s:
        less than that of a blow.
        """
        if answer is None:
            if len(self.wanted):
                self.forget()
            return
        contacts = rows.contacts
        if not rows.count:
            if len(self.labels) or len(self.slips):
                self.forget()
            self.wanted, self._answer, self.normals = answer.wanted, answer, contacts.normals
            return
        shares = answer.shares
        size = shares * answer.size
        if size.max() > most:
            shares = shares * np.minimum(most / (size + 1e-300), 1.0)
        if contacts.labels is not self.labels:
            self.labels, self._key = contacts.labels, contacts.labels.tobytes()
        self.grips = answer.across * shares[:, None]
        self.wanted = answer.wanted
        self.slips = _NO_ONES if answer.slips is None else rows.slip(answer)
        self._answer, self.normals = answer, contacts.normals


_NO_ROWS = np.zeros((0, 3))
_NO_ONES = np.zeros(0)
_NOBODY = np.zeros(0, np.int64)
