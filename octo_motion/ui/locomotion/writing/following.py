# SPDX-License-Identifier: GPL-3.0-or-later
"""A motion that follows a change: what is in sight at once, all of it in steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

import bpy
import numpy as np

from ....blender.animation import (
    LENGTH,
    HalfWritten,
    PropertyValues,
    curves_of,
    looking_whether_edited,
    show_values,
    shown_values,
)
from ....blender.rig import bone_and_property
from ....core.locomotion.motion import (
    Glimpsed,
    KnownMotion,
    MotionPlan,
    Sketch,
    glimpse,
    plan_motion,
    pose,
    reach_of,
    way_of,
)
from ....core.steps import finished
from ...overlay_lines import Lines
from ..reading import previous_action
from ..settings import locomotion_settings
from .shot import Before, Shot, note_of, prepare, prepare_anew

_PATH: Final = (1.0, 0.75, 0.2, 0.9)
_FOOTHOLD: Final = (0.3, 0.9, 0.85, 0.9)
_MARK: Final = 0.03
"""Arm lengths: half of a foothold's mark."""


@dataclass
class Shown:
    """What an armature was like before any frame was shown in place of its action's."""

    before: PropertyValues = field(default_factory=dict)
    """Values by path."""
    moved: set[str] | None = None
    """Paths of scales and locations of arms' bones that its action moves, once they are known."""
    half: HalfWritten | None = None
    """Its action, while it gets its keys."""


class Following:
    """One armature's motion as its settings are now, of which nothing is written yet.

    Names are kept, not references to Blender's data: it lives on while Blender goes on.

    Args:
        armature: that moves.
        context: with its scene.
        earlier: what was being followed, and is no more.
        before: the shot as it was read last, and what of that is still so.
        sketch: of a motion that this is nearly like, if there is one.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """

    def __init__(
        self,
        armature: bpy.types.Object,
        context: bpy.types.Context,
        earlier: Following | None = None,
        before: Before | None = None,
        sketch: Sketch | None = None,
    ) -> None:
        self.shot: Shot = prepare_anew(armature, context, before)
        self.shown: Shown = earlier.shown if earlier is not None else Shown()
        self.sketch = sketch if sketch is not None and sketch.may_show(self.shot.job) else None
        """What it is drawn from; none where all that is shown of it is as it will be."""
        self._plan: MotionPlan | None = None if self.sketch is not None else self.shot.plan()
        self.edited = False
        """Whether somebody has edited the motion before."""
        self.exact = False
        """Whether what is written has the keys that Generate makes."""
        self._written = False
        """Whether the action is what it will be, or nearly so."""
        self._few = locomotion_settings(armature).keys == "REDUCED"
        self._frame: float | None = None
        """The one in sight, none while nothing is shown …"""
        self._given: dict[str, list[float]] = {}
        """… and what is shown there, by data path."""
        self._news: tuple[float, Sequence[Glimpsed]] | None = None
        """What has come to be known of a frame."""

    def lines(self) -> Lines:
        """The body's way and its footholds, as lines in the world; nothing in place."""
        job = self.shot.job
        if job.in_place:
            return []
        if self._plan is None:
            assert self.sketch is not None
            centres, held = self.sketch.way(job)
        else:
            centres, held, _ = way_of(self._plan)
        size = _MARK * reach_of(job.creature)
        ends = size * np.eye(3)[:2]
        marks = np.stack([held[:, None] - ends, held[:, None] + ends], axis=2).reshape(-1, 3)
        path = np.repeat(centres, 2, axis=0)[1:-1]
        return [
            (points, np.tile(colour, (len(points), 1)), width)
            for points, colour, width in ((path, _PATH, 2.0), (marks, _FOOTHOLD, 2.5))
        ]

    def show(self, armature: bpy.types.Object, frame: float) -> None:
        """Let the armature be as it is going to be at a frame, or nearly so until it is planned.

        Reaches are left out of that: what they reach for hangs on all frames.

        Raises:
            OctoMotionError: something is wrong that the user can put right.
        """
        job = self.shot.job
        if job.reaching is not None or self._written:
            return
        self._frame = frame
        if self._plan is None:
            assert self.sketch is not None
            values = self.sketch.at(job, frame)
        else:
            glimpsed = finished(glimpse(self._plan, frame))
            self.sketch, values = self.sketch or Sketch(glimpsed.known), glimpsed.values
        self._give(armature, values)

    def _give(self, armature: bpy.types.Object, glimpsed: Sequence[Glimpsed]) -> None:
        values = {each.data_path: each.values.tolist() for each in glimpsed}
        for path in self._stretched(armature) - values.keys():
            values[path] = [0.0 if path.endswith(".location") else 1.0] * 3
        new = [path for path in values if path not in self.shown.before]
        self.shown.before.update(shown_values(armature, new))
        show_values(armature, values)
        self._given = values

    def cover(self, armature: bpy.types.Object) -> None:
        """Show the frame in sight again, where Blender has worked it out from an action that is
        half written.
        """
        if self.shown.half is not None and self.shown.half.is_seen:
            bpy.context.view_layer.update()
            show_values(armature, self._given)

    def _stretched(self, armature: bpy.types.Object) -> set[str]:
        """Paths of scales and locations of the arms' bones that a motion before has moved."""
        if self.shown.moved is None:
            previous = previous_action(armature, locomotion_settings(armature))
            paths = {path for path in self.shown.before if path.endswith(LENGTH)}
            curves = curves_of(previous) if previous is not None else ()
            paths |= {path for each in curves if (path := each.data_path).endswith(LENGTH)}
            own = {bone for arm in self.shot.job.creature.bones for bone in arm}
            self.shown.moved = {path for path in paths if bone_and_property(path)[0] in own}
        return self.shown.moved

    def take_back(self) -> None:
        """Let the action be as it was, if that has got any keys already."""
        if self.shown.half is not None:
            self.shown.half.give_back()
            self.shown.half = None

    def give_back(self, armature: bpy.types.Object) -> None:
        """Let the armature be as it was before anything was shown."""
        self.take_back()
        show_values(armature, self.shown.before)
        self.shown.before.clear()

    def steps(self) -> Iterator[float]:
        """Work all of it out, yielding the share that is done.

        What was shown nearly as it will be comes first, and is told by :meth:`tell`.
        """
        armature = bpy.data.objects.get((self.shot.armature, None))
        if armature is not None:
            self.shot.note = note_of(locomotion_settings(armature))
        yield 0.0
        if self._plan is None:
            plan = yield from plan_motion(self.shot.job)
            self._plan = plan
            if self._frame is not None:
                frame = self._frame
                glimpsed = yield from glimpse(plan, frame)
                self._news = frame, glimpsed.values
                yield 0.0
                yield from self._sketched(glimpsed.known)
        result = yield from pose(self._plan, brief=True)
        yield from self._sketched(result.known)
        self.shot.result = result
        yield 1.0
        self.exact = not self._few and self._plan.wants_subframes == self._plan.subframe_sampled
        yield from self._made()

    def exactly(self) -> Iterator[float]:
        """Work out what Generate makes, where the motion nearly so is written."""
        armature = bpy.data.objects.get((self.shot.armature, None))
        if armature is None:
            return
        # Had the rig or its skin changed meanwhile, another motion would be followed by now.
        known = self.shot.rig.detection is None and not locomotion_settings(armature).keep_pose
        self.shot = prepare(armature, bpy.context, before=Before(self.shot, rig=known))
        yield 0.0
        yield from self.shot.compute(brief=True)
        self.exact = True
        yield from self._made()

    def _made(self) -> Iterator[float]:
        armature = bpy.data.objects.get((self.shot.armature, None))
        previous = None
        if armature is not None:
            previous = previous_action(armature, locomotion_settings(armature))
        if previous is not None:
            self.edited = yield from looking_whether_edited(previous)

    def _sketched(self, known: KnownMotion) -> Iterator[float]:
        """Let the next change be drawn from what is known now."""
        sketch = Sketch(known)
        yield 1.0
        yield from sketch.preparing(self._frame or 0.0)
        self.sketch = sketch
        yield 1.0

    @property
    def has_news(self) -> bool:
        """Whether it has come to be known how what was nearly shown will be."""
        return self._news is not None

    def tell(self, armature: bpy.types.Object) -> None:
        """Show that."""
        assert self._news is not None
        (frame, values), self._news = self._news, None
        if frame == self._frame:
            self._give(armature, values)

    def filling(self, armature: bpy.types.Object) -> Iterator[float]:
        """Write most of it, in steps, that nobody has edited the motion before being known."""
        made, previous = self.shot.result, previous_action(armature, locomotion_settings(armature))
        assert made is not None
        if previous is None:
            return
        half = self.shown.half = self.shown.half or HalfWritten(previous)
        for _ in half.filling(
            made.frames,
            made.channels,
            automatic=made.automatic,
            # Few keys are as good as those on all frames, which are there by now.
            nearly=self._written,
            seen=self._frame is not None,
            repeats=self.shot.job.repeats,
        ):
            yield 1.0

    def write(self) -> None:
        """Give the armature its motion; that the one before is not edited is known."""
        self.shown.before.clear()
        self.shot.write(unedited=True, filled=self.shown.half)
        self.shown.half = None
        self._written = True
