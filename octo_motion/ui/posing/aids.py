# SPDX-License-Identifier: GPL-3.0-or-later
"""What helps an artist while a figure is posed: its other side goes along, and where it was is
remembered to be drawn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import bpy
import numpy as np

from ...blender.rig import Puppet
from ...core.posing.puppet import Pose
from ...core.posing.session import HandSample, Session
from ...core.posing.solver import Coupling, HandSpring
from ...core.posing.symmetry import Mirror, opposite_point
from ...core.rotations import IDENTITY, Floats, conjugate, from_rotation_vector, multiply

_MOST_POINTS: Final = 900
"""Of an arc: fifteen seconds."""
_MOST_GHOSTS: Final = 500
"""Frames whose poses are remembered."""
_HELD: Final = from_rotation_vector(np.array([1e-6, 0.0, 0.0]))
"""A turn that nobody sees."""


@dataclass(frozen=True, eq=False)
class HeldByDevice:
    """What a hand at a device holds."""

    body: int
    point: Floats
    """(3,) where the point is that it holds."""
    hand: HandSample
    """Where it is itself, ahead of that."""
    coupling: Coupling
    """Of its spring."""


@dataclass(frozen=True, eq=False)
class _Mirrored:
    """A hand on the other side."""

    spring: HandSpring
    mirror: Mirror
    start: Floats
    """(3,) where the hand that it does as took hold."""
    there: Floats
    """(3,) where it took hold itself."""
    body: int
    """That the other hand holds."""
    turned: Floats
    """(4,) how that hand was turned then."""

    def sample(self, place: Floats, turn: Floats) -> HandSample:
        """Where it is while the other hand is at a place (3,) and turned (4,)."""
        way = self.mirror.way(place - self.start)
        turned = multiply(turn, conjugate(self.turned))
        return HandSample(self.there + way, self.mirror.turn(turned))


class OtherSide:
    """Hands that do on the other side what the artist's hands do on one."""

    def __init__(self, puppet: Puppet, session: Session) -> None:
        self._session = session
        index = {name: body for body, name in enumerate(puppet.figure.names)}
        self.opposite = {
            body: index[other]
            for name, body in index.items()
            if (other := bpy.utils.flip_name(name)) != name and other in index
        }
        """Bodies of the two sides, by name: .L and .R, left and right, as Blender has it."""
        axes = np.array(puppet.armature().matrix_world, dtype=np.float64)[:3, :3]
        self._side = axes[:, 0] / np.linalg.norm(axes[:, 0])
        self._hands: dict[HandSpring, _Mirrored] = {}
        self._devices: dict[int, _Mirrored | None] = {}
        """By a device's number; None for one that has none on the other side."""
        self._held: dict[int, HandSample] = {}
        """By device, where its hand is."""

    def take(self, spring: HandSpring) -> None:
        """Take hold on the other side as well; of what has none, nothing."""
        point = self._session.world.held_point(spring)
        taken = self._take(spring.body, point, IDENTITY, spring.coupling)
        if taken is not None:
            self._hands[spring] = taken

    def follow(self, held: Mapping[int, HeldByDevice]) -> None:
        """Do as hands at devices do, which are not this session's own; by a device's number."""
        for number, taken in list(self._devices.items()):
            body = held[number].body if number in held else -1
            if taken is not None and body == taken.body:
                continue
            if taken is not None:
                self._session.release(taken.spring)
            if body < 0 or taken is not None:
                del self._devices[number]
        elsewhere = {each.body for each in held.values()}
        for number, each in held.items():
            if number not in self._devices:
                free = self.opposite.get(each.body) not in elsewhere
                held_so = (each.body, each.point, each.hand.orientation, each.coupling)
                self._devices[number] = self._take(*held_so) if free else None
        self._held = {number: each.hand for number, each in held.items()}

    def samples(self, hands: dict[HandSpring, HandSample]) -> dict[HandSpring, HandSample]:
        """Where all hands are, those on the other side too."""
        self.let_go()
        found = dict(hands)
        for spring, sample in hands.items():
            if spring in self._hands:
                taken = self._hands[spring]
                found[taken.spring] = taken.sample(sample.position, sample.orientation)
        for number, taken in self._devices.items():
            if taken is not None and taken.spring in self._session.world.grabs:
                hand = self._held[number]
                # A mouse that has not turned lets the bone turn; a device holds it as it is.
                turn = multiply(hand.orientation, _HELD)
                found[taken.spring] = taken.sample(hand.position, turn)
        return found

    def let_go(self) -> None:
        """Where a hand has let go, so does the other one."""
        grabs = self._session.world.grabs
        for spring in [each for each in self._hands if each not in grabs]:
            self._session.release(self._hands.pop(spring).spring)

    def _take(
        self, body: int, point: Floats, turned: Floats, coupling: Coupling
    ) -> _Mirrored | None:
        """Take hold where the other side of a point (3,) of a body is, if there is one, for a hand
        that is turned (4,).
        """
        session, other = self._session, self.opposite.get(body)
        if other is None or other in {each.body for each in session.world.grabs}:
            return None
        there = opposite_point(session.figure, session.pose, (body, other), point)
        mirror = Mirror.of(session.figure, session.pose, self._side)
        spring = session.world.grab(other, there, None, coupling)
        return _Mirrored(spring, mirror, point, there, body, turned)


class Traces:
    """Where a drag's hand and the limb in it have been, and how the figure stood at frames."""

    def __init__(self) -> None:
        self.hand: list[Floats] = []
        """(3,) each, world."""
        self.tip: list[Floats] = []
        self.poses: dict[float, Pose] = {}
        """By frame."""

    def begin(self) -> None:
        """A new drag."""
        self.hand, self.tip = [], []

    def add(self, hand: Floats, tip: Floats) -> None:
        """One moment more of a drag."""
        self.hand.append(np.array(hand))
        self.tip.append(np.array(tip))
        del self.hand[:-_MOST_POINTS], self.tip[:-_MOST_POINTS]

    def stood(self, frame: float, pose: Pose) -> None:
        """How the figure stands at a frame."""
        self.poses.pop(frame, None)
        self.poses[frame] = pose
        while len(self.poses) > _MOST_GHOSTS:
            del self.poses[next(iter(self.poses))]

    def ghosts(self, frame: float, count: int, step: int) -> list[tuple[bool, Pose]]:
        """Poses at so many frames before and after one, in steps, as far as they are known; whether
        each comes later.
        """
        wanted = [frame + way * step * number for number in range(1, count + 1) for way in (-1, 1)]
        return [(each > frame, self.poses[each]) for each in wanted if each in self.poses]
