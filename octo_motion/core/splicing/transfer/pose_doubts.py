# SPDX-License-Identifier: GPL-3.0-or-later
"""What a clip does not tell of how its body lies, in sentences for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ...phrases import phrase
from ...rotations import Floats, angle_between, conjugate, cross, dot, multiply, normalized
from ..clip import Clip, robust_rotations
from ..humanoid import Landmarks
from .parts import spoken
from .reference_pose import BENT, LIMBS, NoFrameError, ReferenceFinder, lengths, told_by

_DOUBTFUL: Final = 0.2
"""Weight of a moment below which nobody may be said to stand."""

_TURNED: Final = np.radians(25.0)
"""How far a head may be off its rest on average, and nobody is asked where it faces."""


def reference_doubts(clip: Clip, landmarks: Landmarks) -> list[str]:
    """What a clip does not tell of how its body lies: sentences that name landmarks."""
    try:
        return _Doubter(told_by(clip, landmarks), landmarks).doubts()
    except (NoFrameError, KeyError):
        return []


class _Doubter(ReferenceFinder):
    """Looks at what the reference pose is found from for what is not there."""

    def doubts(self) -> list[str]:
        """What the moments do not tell, or tell in two ways."""
        found = []
        if self._standing.max() < _DOUBTFUL:
            found.append(
                "Nobody stands here: which way is up may be wrong. Choose a frame in which the "
                "body stands (Reference Pose, Frame)."
            )
        across = [
            self._joints(f"{joint}.L") - self._joints(f"{joint}.R")
            for joint in ("thigh", "upper_arm")
        ]
        if np.median(dot(*across)) < 0.0:
            found.append("Arms and legs are on opposite sides: look at Upper Arm and Thigh.")
        elif self._points_backwards(across[0]):
            found.append("The toes point backwards: left and right may be exchanged (Thigh, Toes).")
        for (root, middle, end), *_ in LIMBS:
            for side in "LR":
                names = [f"{each}.{side}" for each in (root, middle, end)]
                if all(each in self._bones for each in names) and self._always_straight(names):
                    found.append(
                        phrase(
                            "The {landmark} is always straight: how the limb is turned about "
                            "itself is as if it had swung there.",
                            landmark=spoken(names[1]),
                        )
                    )
        if self._turns_its_head():
            found.append(
                "The head is turned aside or bent most of the time: what it faces then counts as "
                "ahead. If heads come out turned, choose Rest as its Reference Pose."
            )
        return found

    def _turns_its_head(self) -> bool:
        """Whether the head is elsewhere on average than in a rest pose of this body: no joint tells
        where a face looks.
        """
        if "head" not in self._bones or not self._rests_in_a_pose(self._told_by_joints()):
            return False
        chest, head = self._bones["chest"], self._bones["head"]
        between = multiply(conjugate(self._turns[:, [chest]]), self._turns[:, [head]])
        mean = robust_rotations(between, self._standing[:, None])[0]
        rests = self._skeleton.rest_rotations
        return bool(angle_between(mean, multiply(conjugate(rests[chest]), rests[head])) > _TURNED)

    def _points_backwards(self, left: Floats) -> bool:
        """Whether toes lie behind their feet."""
        forward = cross(left, self._upward)
        ways = [
            dot(normalized(self._joints(f"toe.{side}") - self._joints(f"foot.{side}")), forward)
            for side in "LR"
            if {f"toe.{side}", f"foot.{side}"} <= self._bones.keys()
        ]
        return bool(ways) and float(np.median(ways)) < 0.0

    def _always_straight(self, names: Sequence[str]) -> bool:
        root, middle, end = (self._joints(each) for each in names)
        upper, lower = normalized(middle - root), normalized(end - middle)
        bend = np.arctan2(lengths(cross(upper, lower)), dot(upper, lower))
        return bool(np.quantile(bend, 0.9) < BENT[0])
