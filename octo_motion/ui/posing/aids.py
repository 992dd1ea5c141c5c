# SPDX-License-Identifier: GPL-3.0-or-later
"""What helps an artist while a figure is posed: its other side goes along, and where it was is
remembered to be drawn.
"""

from __future__ import annotations

from typing import Final

import bpy
import numpy as np

from ...blender.rig import Puppet
from ...core.posing.puppet import Pose
from ...core.posing.session import HandSample, Session
from ...core.posing.solver import HandSpring
from ...core.posing.symmetry import Mirror, opposite_point
from ...core.rotations import Floats

_MOST_POINTS: Final = 900
"""Of an arc: fifteen seconds."""
_MOST_GHOSTS: Final = 500
"""Frames whose poses are remembered."""


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
        self._hands: dict[HandSpring, tuple[HandSpring, Mirror, Floats, Floats]] = {}

    def take(self, spring: HandSpring) -> None:
        """Take hold on the other side as well; of what has none, nothing."""
        other = self.opposite.get(spring.body)
        held = {each.body for each in self._session.world.grabs}
        if other is None or other in held:
            return
        session = self._session
        pose, point = session.pose, session.world.held_point(spring)
        there = opposite_point(session.figure, pose, (spring.body, other), point)
        mirror = Mirror.of(session.figure, pose, self._side)
        again = session.world.grab(other, there, None, spring.coupling)
        self._hands[spring] = again, mirror, point, there

    def samples(self, hands: dict[HandSpring, HandSample]) -> dict[HandSpring, HandSample]:
        """Where all hands are, those on the other side too."""
        self.let_go()
        found = dict(hands)
        for spring, sample in hands.items():
            if spring in self._hands:
                again, mirror, start, there = self._hands[spring]
                place = there + mirror.way(sample.position - start)
                found[again] = HandSample(place, mirror.turn(sample.orientation))
        return found

    def let_go(self) -> None:
        """Where a hand has let go, so does the other one."""
        grabs = self._session.world.grabs
        for spring in [each for each in self._hands if each not in grabs]:
            again = self._hands.pop(spring)[0]
            self._session.release(again)


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
