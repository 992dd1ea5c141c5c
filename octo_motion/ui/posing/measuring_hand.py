# SPDX-License-Identifier: GPL-3.0-or-later
"""Showing with a limb how its joint is to give way: the hand leads it, and nothing resists."""

from __future__ import annotations

from typing import Final

import numpy as np

from ...core.errors import RigError
from ...core.phrases import joined_phrases, phrase
from ...core.posing.puppet import (
    Bend,
    Figure,
    Material,
    MeasuredBend,
    Pose,
    joint_loads,
    material_of,
    measure_bend,
    measure_shown,
)
from ...core.rotations import (
    IDENTITY,
    Floats,
    conjugate,
    multiply,
    rotate,
    shortest_arc,
    to_rotation_vector,
)

BEARS: Final = 1.25
"""What the joint bears afterwards, in its loads: it holds up what hangs on it."""


class MeasuringHand:
    """The joint of a limb that is bent by hand, to measure what it is to be made of.

    Nothing but what hangs on the joint is moved.

    Raises:
        RigError: the limb hangs on nothing.
    """

    def __init__(self, figure: Figure, pose: Pose, body: int) -> None:
        check_joint(figure, body)
        self.body = body
        self.pull = 2.0
        """How hard the joint is pulled, in its loads."""
        self._figure = figure
        self._start = pose
        self._turn = IDENTITY.copy()
        self._arm: Floats | None = None
        self._times: list[float] = []
        self._turns: list[Floats] = []
        self._released: float | None = None
        self._passed = 0.0
        moved = np.zeros(len(figure), dtype=bool)
        moved[body] = True
        for each, parent in enumerate(figure.parents):
            moved[each] |= parent >= 0 and bool(moved[parent])
        self._moved = moved

    @property
    def shown(self) -> bool:
        """Whether the limb was bent and let go."""
        return self._released is not None

    @property
    def angle(self) -> float:
        """Radians by which the joint is bent now."""
        return float(np.linalg.norm(to_rotation_vector(self._turn)))

    def takes(self, body: int) -> bool:
        """Whether a body hangs on the joint, so that it can be bent there."""
        return bool(self._moved[body])

    def pose(self) -> Pose:
        """The figure with its joint bent."""
        joint = self._start.positions[self.body]
        positions, orientations = self._start.positions.copy(), self._start.orientations.copy()
        positions[self._moved] = joint + rotate(self._turn, positions[self._moved] - joint)
        orientations[self._moved] = multiply(self._turn, orientations[self._moved])
        return Pose(positions, orientations)

    def grab(self, point: Floats) -> None:
        """Take hold at a point (3,) of a limb that hangs on the joint."""
        joint = self._start.positions[self.body]
        arm = rotate(conjugate(self._turn), point - joint)
        length = float(np.linalg.norm(arm))
        self._arm = arm / length if length > 1e-9 else None

    def tick(self, seconds: float, point: Floats) -> None:
        """The hand that holds has gone to a point (3,) in the time that has passed."""
        if self._arm is None:
            return
        way = point - self._start.positions[self.body]
        length = float(np.linalg.norm(way))
        if length > 1e-9:
            self._turn = shortest_arc(self._arm, way / length)
        self._passed += seconds
        self._times.append(self._passed)
        self._turns.append(to_rotation_vector(self._turn))

    def release(self) -> None:
        """Let go; the joint stays where it was led."""
        if self._arm is not None and self._times and self._released is None:
            self._released = self._passed
        self._arm = None

    def bend(self) -> Bend:
        """What was shown, its torques in loads of the joint.

        Raises:
            SettingsError: nothing was bent, or it had not come to rest.
        """
        released = self._passed if self._released is None else self._released
        if not self._times:
            return measure_shown(np.zeros(1), np.zeros(1), 0.0, self.pull, BEARS)
        times, turns = np.array(self._times), np.array(self._turns)
        # About the axis of the first drag: a second one may pass beside it.
        axis = turns[times <= released][-1]
        size = float(np.linalg.norm(axis))
        angles = turns @ (axis / size) if size > 0.0 else np.zeros(len(turns))
        return measure_shown(times, angles, released, self.pull, BEARS)


def check_joint(figure: Figure, body: int) -> None:
    """See whether a body has a joint that can be bent.

    Raises:
        RigError: it hangs on nothing.
    """
    if figure.parents[body] < 0:
        raise RigError(
            phrase(
                "'{name}' hangs on no other limb, so it has no joint to bend.",
                name=figure.names[body],
            ),
            "Choose a limb further out.",
        )


def measured_joint(
    figure: Figure, body: int, strength: float, bend: Bend
) -> tuple[MeasuredBend, Material]:
    """Coefficients of a joint that does what a bend says, its torques in loads of the joint, and
    the material that has them.

    Raises:
        RigError: the body hangs on nothing.
        SettingsError: the bend makes no sense.
    """
    check_joint(figure, body)
    load = strength * float(joint_loads(figure)[body])
    torques = {"torque": bend.torque * load, "bears": bend.bears * load}
    measured = measure_bend(Bend(**{**vars(bend), **torques}))
    return measured, material_of(measured, load)


def coefficients(bone: str, measured: MeasuredBend) -> str:
    """The coefficients, for people."""
    text = phrase(
        "{bone}: K_f {stiffness:.3g} N·m/rad, D_f {damping:.3g} N·m·s/rad",
        bone=bone,
        stiffness=measured.stiffness,
        damping=measured.damping,
    )
    if not np.isfinite(measured.yield_torque):
        return joined_phrases("", (text, ", never gives way"))
    gives_way = phrase(
        ", D_d {flow:.3g} N·m·s/rad, yields at {yield_torque:.3g} N·m",
        flow=measured.flow,
        yield_torque=measured.yield_torque,
    )
    return joined_phrases("", (text, gives_way))
