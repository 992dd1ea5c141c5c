# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a figure would stand: its centre of mass over what it stands on.

It stands on what is pinned and on what touches something from above. Seen from above, the convex
outline of these places has to hold the centre of mass.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ..rotations import Floats, rotate
from .puppet import Figure, Pose, capsules_in_world
from .session import Session

_FREQUENCY: Final = 2.5
"""Hz at which the centre of mass swings to where it belongs: slower than any hand."""
_STRONGEST: Final = 1.0
"""Of the figure's weight: the push that keeps it."""
_GRAVITY: Final = 9.81
_UPWARDS: Final = 0.5
"""Of a contact's normal: what leans more does not carry."""
_STILL: Final = 0.05
"""m/s²: a push that is less wakes nobody."""


@dataclass(frozen=True, eq=False)
class Balance:
    """A centre of mass and what is below it."""

    centre: Floats
    """(3,) world."""
    outline: Floats
    """(corners, 3) of what the figure stands on, in order; none where it stands on nothing."""

    @property
    def room(self) -> float:
        """How far within the outline the centre is, seen from above, metres; less than 0 where it
        would fall, and minus infinity where nothing is below.
        """
        if not len(self.outline):
            return -np.inf
        flat, point = self.outline[:, :2], self.centre[:2]
        starts, ways = flat, np.roll(flat, -1, axis=0) - flat
        lengths = np.maximum((ways * ways).sum(axis=1), 1e-300)
        shares = np.clip(((point - starts) * ways).sum(axis=1) / lengths, 0.0, 1.0)
        gaps = np.linalg.norm(starts + shares[:, None] * ways - point, axis=1)
        away = point - starts
        left = ways[:, 0] * away[:, 1] - ways[:, 1] * away[:, 0]
        inside = len(flat) > 2 and bool((left >= 0.0).all())
        return float(gaps.min()) if inside else -float(gaps.min())

    @property
    def middle(self) -> Floats:
        """(2,) of the outline, seen from above."""
        return self.outline[:, :2].mean(axis=0)


def balance_of(figure: Figure, pose: Pose, bodies: list[int], touched: list[int]) -> Balance:
    """Of some bodies of a figure, of which those stand on something that are ``touched``."""
    masses = figure.masses[bodies]
    places = pose.positions[bodies] + rotate(pose.orientations[bodies], figure.centres[bodies])
    centre = (masses[:, None] * places).sum(axis=0) / masses.sum()
    if not touched:
        return Balance(centre, np.zeros((0, 3)))
    ends = capsules_in_world(figure, pose)[touched].reshape(-1, 3).copy()
    radii = np.repeat(figure.radii[touched], 2)
    # All that a capsule covers, seen from above; as low as its lowest.
    around = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    ring = np.stack([np.cos(around), np.sin(around), np.zeros(12)], axis=1)
    spread = (ends[:, None] + radii[:, None, None] * ring).reshape(-1, 3)
    spread[:, 2] = float((ends[:, 2] - radii).min())
    return Balance(centre, spread[_outline(spread[:, :2])])


def carried(session: Session) -> list[int]:
    """Bodies that something below has carried in a session's last step."""
    contacts = session.world.contacts
    if contacts is None or not len(contacts):
        return []
    below = (contacts.normals[:, 2] > _UPWARDS) & (contacts.others < 0)
    return sorted(set(contacts.bodies[below].tolist()))


def balance_now(session: Session, own: range, carriers: Sequence[int]) -> Balance:
    """Of a session's figure, whose bodies are ``own``: it stands on what is pinned, and on what is
    carried.
    """
    parents = session.figure.parents
    pinned = {body for body in session.pins if parents[body] >= 0}
    touched = pinned.union(carriers).intersection(own)
    return balance_of(session.figure, session.pose, list(own), sorted(touched))


def keep_balance(session: Session, own: range) -> None:
    """Push the root of a session's first figure so that the figure keeps its balance; of no bodies,
    push no more.
    """
    world, force = session.world, np.zeros(3)
    masses = session.figure.masses[own.start : own.stop]
    if own and own[0] not in session.pins:
        velocity = masses @ world.velocities()[own.start : own.stop, :3] / masses.sum()
        now = balance_now(session, own, carried(session))
        force = righting_force(now, velocity, float(masses.sum()))
    if not np.array_equal(force, world.forces[own.start, :3]):
        world.forces[own.start, :3] = force
        if np.linalg.norm(force) > _STILL * float(masses.sum()):
            session.wake()


def righting_force(balance: Balance, velocity: Floats, mass: float) -> Floats:
    """(3,) N, level, that leads the centre of mass, with a velocity (3,), over the middle of what
    the figure stands on; nothing where that is nothing.
    """
    force = np.zeros(3)
    if not len(balance.outline):
        return force
    pull = 2.0 * np.pi * _FREQUENCY
    force[:2] = mass * pull * (pull * (balance.middle - balance.centre[:2]) - 2.0 * velocity[:2])
    size = float(np.linalg.norm(force))
    return force * min(1.0, _STRONGEST * mass * _GRAVITY / max(size, 1e-300))


def _outline(flat: Floats) -> list[int]:
    """The corners of the convex outline of points (points, 2), in order (Andrew 1979)."""
    order = np.lexsort((flat[:, 1], flat[:, 0])).tolist()
    if len(order) < 3:
        return order
    found: list[int] = []
    for way in (order, order[::-1]):
        chain: list[int] = []
        for each in way:
            while len(chain) > 1 and _turn(flat[chain[-2]], flat[chain[-1]], flat[each]) <= 0.0:
                chain.pop()
            chain.append(each)
        found += chain[:-1]
    return found


def _turn(a: Floats, b: Floats, c: Floats) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
