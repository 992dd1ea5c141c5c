# SPDX-License-Identifier: GPL-3.0-or-later
"""A motion that follows a change: what is in sight at once, all of it in steps."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import bpy
import numpy as np

from ....blender.animation import (
    LENGTH,
    PropertyValues,
    animated_bones,
    show_values,
    shown_values,
)
from ....blender.rig import bone_and_property
from ....core.locomotion.motion import glimpse, pose, way_of
from ...overlay_lines import Lines
from ..reading import previous_action
from ..settings import locomotion_settings
from .shot import Shot, prepare, rerouted

_PATH: Final = (1.0, 0.75, 0.2, 0.9)
_FOOTHOLD: Final = (0.3, 0.9, 0.85, 0.9)
_MARK: Final = 0.03
"""Arm lengths: half of a foothold's mark."""


class Following:
    """One armature's motion as its settings are now, of which nothing is written yet.

    Names are kept, not references to Blender's data: it lives on while Blender goes on.

    Args:
        armature: that moves.
        context: with its scene.
        before: of what was being followed, and takes the place of the motion itself.
        known: the shot as it was read last, if nothing but the route has changed since.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """

    def __init__(
        self,
        armature: bpy.types.Object,
        context: bpy.types.Context,
        before: PropertyValues | None = None,
        known: Shot | None = None,
    ) -> None:
        self.shot: Shot = (
            rerouted(known, armature, context)
            if known is not None
            else prepare(armature, context, live=True)
        )
        self._plan = plan = self.shot.plan()
        few = locomotion_settings(armature).keys == "REDUCED"
        self.exact = not few and plan.wants_subframes == plan.subframe_sampled
        """Whether what is written has the keys that Generate makes."""
        self.before: PropertyValues = before if before is not None else {}
        """What the armature was before anything was shown."""

    def lines(self) -> Lines:
        """The body's way and its footholds, as lines in the world; nothing in place."""
        job = self.shot.job
        if job.in_place:
            return []
        centres, held = way_of(self._plan)
        size = _MARK * self._plan.first.poser.arm_length * job.creature.scale
        ends = size * np.eye(3)[:2]
        marks = np.stack([held[:, None] - ends, held[:, None] + ends], axis=2).reshape(-1, 3)
        path = np.repeat(centres, 2, axis=0)[1:-1]
        return [
            (points, np.tile(colour, (len(points), 1)), width)
            for points, colour, width in ((path, _PATH, 2.0), (marks, _FOOTHOLD, 2.5))
        ]

    def show(self, armature: bpy.types.Object, frame: float) -> None:
        """Let the armature be as it is going to be at a frame.

        Reaches are left out of that: what they reach for hangs on all frames.

        Raises:
            OctoMotionError: something is wrong that the user can put right.
        """
        if self.shot.job.reaching is not None:
            return
        values = {each.data_path: each.values.tolist() for each in glimpse(self._plan, frame)}
        for path in self._stretched(armature) - values.keys():
            values[path] = [0.0 if path.endswith(".location") else 1.0] * 3
        new = [path for path in values if path not in self.before]
        self.before.update(shown_values(armature, new))
        show_values(armature, values)

    def _stretched(self, armature: bpy.types.Object) -> set[str]:
        """Paths of scales and locations of the arms' bones that a motion before has moved."""
        previous = previous_action(armature, locomotion_settings(armature))
        paths = {path for path in self.before if path.endswith(LENGTH)}
        for kind in LENGTH:
            bones = animated_bones(previous, (kind,)) if previous is not None else set[str]()
            paths |= {f'pose.bones["{bpy.utils.escape_identifier(each)}"].{kind}' for each in bones}
        own = {bone for arm in self.shot.job.creature.bones for bone in arm}
        return {path for path in paths if bone_and_property(path)[0] in own}

    def give_back(self, armature: bpy.types.Object) -> None:
        """Let the armature be as it was before anything was shown."""
        show_values(armature, self.before)
        self.before.clear()

    def steps(self) -> Iterator[float]:
        """Work all of it out, yielding the share that is done."""
        self.shot.result = yield from pose(self._plan, brief=True)

    def write(self) -> None:
        """Give the armature its motion; that the one before is not edited is known."""
        self.before.clear()
        self.shot.write(unedited=True)
