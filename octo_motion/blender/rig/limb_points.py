# SPDX-License-Identifier: GPL-3.0-or-later
"""Points on the limbs of a puppet that say how it is posed: as Blender shows them, and as a pose
has them.
"""

from __future__ import annotations

from typing import Final

import bpy
import numpy as np

from ...core.posing.puppet import SIZE, Pose, closed
from ...core.rotations import Floats, conjugate, rotate
from .armature import armature_data
from .control_objects import is_object, world_place
from .puppet_reading import PuppetRig

_TWIST: Final = 0.01
"""Of a limb's length, beside it: how much its twist counts against its place."""


class LimbPoints:
    """Head, end and a point beside each limb, and for each target of inverse kinematics where that
    is; world, in sizes of the figure.

    Targets are led by their controls as far as one likes, also where the limb is stretched wholly
    and its end says nothing any more.
    """

    def __init__(self, rig: PuppetRig, armature: bpy.types.Object) -> None:
        self.size = SIZE / rig.unit
        self._rig = rig
        bones = armature_data(armature).bones
        self._numbers = np.array([bones.find(each) for each in rig.figure.names])
        self._lengths = rig.skeleton.lengths[list(rig.roles.bodies)][:, None]
        self._led: list[tuple[int, str]] = []
        self._goals: list[int] = []

    @property
    def targets(self) -> list[str]:
        """Controls that are targets, bones first."""
        return [name for _, name in self._led]

    @property
    def hard(self) -> int:
        """Numbers of heads and ends, which come first."""
        return 6 * len(self._numbers)

    def match(self, armature: bpy.types.Object, pose: Pose, led: list[tuple[int, str]]) -> None:
        """Take what is shown for a pose, and which bodies go to which targets."""
        led = sorted(led, key=lambda each: is_object(each[1]))
        bones, self._led = armature_data(armature).bones, led
        self._goals = [bones.find(name) for _, name in led if not is_object(name)]
        points, count = self.shown(armature).reshape(-1, 3) * self.size, len(self._numbers)
        heads, ends, sides = points[: 3 * count].reshape(3, -1, 3)
        back = conjugate(pose.orientations)
        feet = [body for body, _ in led]
        self._ends, self._sides = rotate(back, ends - heads), rotate(back, sides - heads)
        self._targets = rotate(back[feet], points[3 * count :] - heads[feet])
        self._off = heads - closed(self._rig.figure, pose).positions / self._rig.unit

    def of(self, pose: Pose) -> Floats:
        """All points (numbers,) in a pose."""
        pose = closed(self._rig.figure, pose)
        heads = pose.positions / self._rig.unit + self._off
        ends = heads + rotate(pose.orientations, self._ends)
        sides = heads + rotate(pose.orientations, self._sides)
        feet = [body for body, _ in self._led]
        targets = heads[feet] + rotate(pose.orientations[feet], self._targets)
        return np.concatenate([heads, ends, sides, targets]).ravel() / self.size

    def shown(self, armature: bpy.types.Object) -> Floats:
        """The same, as Blender shows it now."""
        shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        assert shown.pose is not None
        buffer = np.empty(16 * len(shown.pose.bones), dtype=np.float32)
        shown.pose.bones.foreach_get("matrix", buffer)
        # Blender hands over matrices column by column.
        every = buffer.reshape(-1, 4, 4).transpose(0, 2, 1).astype(np.float64)
        own = every[self._numbers]
        heads = own[:, :3, 3]
        ends = heads + self._lengths * own[:, :3, 1]
        sides = heads + _TWIST * self._lengths * own[:, :3, 0]
        points = np.concatenate([heads, ends, sides, every[self._goals, :3, 3]])
        world = np.array(shown.matrix_world, dtype=np.float64)
        points = points @ world[:3, :3].T + world[:3, 3]
        others = [world_place(armature, each) for each in self.targets[len(self._goals) :]]
        return np.concatenate([points, np.array(others).reshape(-1, 3)]).ravel() / self.size

    def limbs_of(self, points: Floats) -> Floats:
        """Heads and ends (2, bodies, 3) of all points (numbers,)."""
        return points[: self.hard].reshape(2, -1, 3)
