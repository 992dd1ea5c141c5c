# SPDX-License-Identifier: GPL-3.0-or-later
"""What contacts remember from one step to the next: their friction, and what they asked for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..rotations import Floats
from .contacts import Contacts
from .rows import Answer


class ContactMemory:
    """Friction and wishes of the last step's contacts, found again by their labels."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self.set(np.zeros(0, np.int64), _NO_ROWS, _NO_ROWS)

    def set(self, labels: NDArray[np.int64], grips: Floats, wanted: Floats) -> None:
        """Take over what a snapshot has."""
        self.labels = labels
        self._key = labels.tobytes()
        self.grips = grips
        """(contacts, 3) friction b of the step before, N·s."""
        self.wanted = wanted
        """(contacts, 3) y of the step before, see ``rows``."""
        self._answer: Answer | None = None
        self._normals: Floats | None = None

    def answer(self, contacts: Contacts) -> Answer | None:
        """What these contacts did in the step before, where not even their normals are others."""
        return self._answer if contacts.normals is self._normals else None

    def recall(
        self, contacts: Contacts
    ) -> tuple[Floats | None, Floats | None, NDArray[np.bool_] | None]:
        """Friction, wishes and which of them are known, for these contacts.

        Returns:
            (contacts, 3) b and y, and (contacts, 1) whether they are known; they are zero where
            not. All None where nothing is known, the last one None where all is.
        """
        if not (len(self.labels) and len(contacts.labels)):
            return None, None, None
        if contacts.labels.tobytes() == self._key:
            return self.grips, self.wanted, None
        order = self.labels.argsort()
        ordered = self.labels.take(order)
        place = np.minimum(ordered.searchsorted(contacts.labels), len(order) - 1)
        same = (ordered.take(place) == contacts.labels)[:, None]
        found = order.take(place)
        return self.grips.take(found, 0) * same, self.wanted.take(found, 0) * same, same

    def keep(self, contacts: Contacts, answer: Answer | None, most: Floats | float) -> None:
        """Remember a step.

        Args:
            contacts: of the step.
            answer: what they did.
            most: (contacts,) friction that is held on to, N·s: less than that of a blow.
        """
        count = len(contacts.labels)
        if answer is None or not count:
            if len(self.labels):
                self.forget()
            return
        size = answer.shares * answer.size
        shares = answer.shares * np.minimum(most / (size + 1e-300), 1.0)
        labels, wanted = contacts.labels, answer.wanted
        if labels is not self.labels:
            self.labels, self._key = labels, labels.tobytes()
        self.grips = answer.across * shares[:, None]
        self.wanted = wanted if len(wanted) == count else wanted[:count].copy()
        self._answer, self._normals = answer, contacts.normals


_NO_ROWS = np.zeros((0, 3))
