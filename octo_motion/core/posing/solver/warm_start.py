# SPDX-License-Identifier: GPL-3.0-or-later
"""What contacts remember from one step to the next: their friction, and what they asked for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...rotations import Floats
from .constraint_rows import Answer, Rows
from .contact_detection import Contacts


class ContactMemory:
    """Friction, slip and wishes of the last step's contacts, found again by their labels."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self.set(np.zeros(0, np.int64), _NO_ROWS, _NO_ROWS, _NO_ONES)

    def set(self, labels: NDArray[np.int64], grips: Floats, wanted: Floats, slips: Floats) -> None:
        """Take over what a snapshot has."""
        self.labels = labels
        self._key = labels.tobytes()
        self.grips = grips
        """(contacts, 3) friction b of the step before, N·s."""
        self.wanted = wanted
        """(rows, 3) y of the step before, see ``rows``."""
        self.slips = slips
        """(contacts,) μ |w_t| at its end, m/s; none where it is not known, or nothing slipped."""
        self._answer: Answer | None = None
        self._normals: Floats | None = None

    def grips_of(self, contacts: Contacts) -> Floats | None:
        """(contacts, 3) b of these contacts, zero for those that are new; None where all are."""
        if not (len(self.labels) and len(contacts.labels)):
            return None
        if self.knows(contacts):
            return self.grips
        found, same = self._places(contacts)
        return self.grips.take(found, 0) * same

    def knows(self, contacts: Contacts) -> bool:
        """Whether these are the contacts of the step before."""
        return contacts.labels.tobytes() == self._key

    def before(self, rows: Rows) -> Answer | None:
        """What these rows did in the step before; None where some are new."""
        if len(self.wanted) != len(rows) or not self.knows(rows.contacts):
            return None
        if self._answer is not None and self._normals is rows.contacts.normals:
            return self._answer
        return rows.respond(self.wanted)

    def before_or(self, rows: Rows, there: Floats) -> Answer:
        """The same, with y (rows, 3) for those that are new."""
        count = rows.count
        if len(self.labels) and count:
            found, same = self._places(rows.contacts)
            there[:count] = np.where(same, self.wanted.take(found, 0), there[:count])
        return rows.respond(there)

    def _places(self, contacts: Contacts) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Where contacts are in what is remembered, and (contacts, 1) whether they are there."""
        order = self.labels.argsort()
        ordered = self.labels.take(order)
        place = np.minimum(ordered.searchsorted(contacts.labels), len(order) - 1)
        return order.take(place), (ordered.take(place) == contacts.labels)[:, None]

    def keep(self, rows: Rows, answer: Answer | None, most: Floats | float) -> None:
        """Remember a step.

        Args:
            rows: of the step.
            answer: what they did.
            most: (contacts,) friction that is held on to, N·s: less than that of a blow.
        """
        if answer is None:
            if len(self.wanted):
                self.forget()
            return
        contacts = rows.contacts
        size = answer.shares * answer.size
        shares = answer.shares * np.minimum(most / (size + 1e-300), 1.0)
        if contacts.labels is not self.labels:
            self.labels, self._key = contacts.labels, contacts.labels.tobytes()
        self.grips = answer.across * shares[:, None]
        self.wanted = answer.wanted
        self.slips = _NO_ONES if answer.slips is None else rows.slip(answer)
        self._answer, self._normals = answer, contacts.normals


_NO_ROWS = np.zeros((0, 3))
_NO_ONES = np.zeros(0)
