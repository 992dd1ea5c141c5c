# SPDX-License-Identifier: GPL-3.0-or-later
"""Dragging a timing without a window: numbers and a pose come of it, and nothing else changes."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Final, Literal

import bpy

from ...blender.animation import pose_values, restore_pose, show_pose
from ...core.errors import OctoMotionError, WriteError
from ...core.splicing.transfer import SplicePreview
from .stack import Stack, local_object

PER_PIXEL: Final = 0.1
"""Frames that a pixel of the mouse's way is worth."""

FINE: Final = 0.1
"""Of that, with Shift."""

Handle = Literal["base", "splice"]


class TimingDrag:
    """The two starts of a splice, one of them moved by hand: on the base, or in the clip.

    Args:
        base_start: frame of the base at which the splice begins.
        splice_start: frame of the clip that is shown then.
    """

    def __init__(self, base_start: float, splice_start: float) -> None:
        self.handle: Handle = "base"
        self.typed = ""
        """What the keyboard has given so far."""
        self._dragged: dict[Handle, float] = {"base": base_start, "splice": splice_start}
        self._starts = dict(self._dragged)

    @property
    def starts(self) -> tuple[float, float]:
        """Frames of the base and of the clip."""
        return self._starts["base"], self._starts["splice"]

    def tick(self, pixels: float, *, fine: bool = False) -> None:
        """The mouse has moved: by whole frames, or ``fine`` by a tenth as much and by hundredths.

        What was typed counts until it is taken back.
        """
        if self.typed or pixels == 0.0:
            return
        value = self._dragged[self.handle] + pixels * PER_PIXEL * (FINE if fine else 1.0)
        self._dragged[self.handle] = value
        self._starts[self.handle] = round(value, 2 if fine else 0)

    def type(self, character: str) -> bool:
        """A key for the number: digit, point, minus, or "" to take the last back.

        Returns:
            Whether it is one.
        """
        if character == "":
            self.typed = self.typed[:-1]
        elif character == "-":
            # As everywhere in Blender, it turns the sign.
            self.typed = self.typed[1:] if self.typed.startswith("-") else f"-{self.typed}"
        elif character in ".," and "." not in self.typed:
            self.typed += "."
        elif character in tuple("0123456789"):
            self.typed += character
        else:
            return False
        try:
            value = float(self.typed)
        except ValueError:
            value = round(self._dragged[self.handle])
        self._starts[self.handle] = value
        return True

    def switch(self) -> None:
        """Move the other start from now on."""
        self._dragged = dict(self._starts)
        self.typed = ""
        self.handle = "splice" if self.handle == "base" else "base"

    def told(self) -> str:
        """The numbers, the one that moves marked."""
        shown = {name: f"{value:g}" for name, value in self._starts.items()}
        if self.typed:
            shown[self.handle] = f"[{self.typed}|]"
        marks = {name: "▸ " if name == self.handle else "" for name in shown}
        return (
            f"{marks['base']}Base Start: {shown['base']}    "
            f"{marks['splice']}Clip Start: {shown['splice']}"
        )


class DragSession:
    """A drag on an armature: its pose follows, also when the frame changes, until it is taken down.

    Args:
        stack: all that was read.
        number: which of its splices, none that is muted.
        scene: whose current frame is shown.
    """

    def __init__(self, stack: Stack, number: int, scene: bpy.types.Scene) -> None:
        splice = stack.splices[number]
        assert splice is not None
        self.number = number
        self.stack = stack
        self.drag = TimingDrag(splice.timing.base_start, splice.timing.splice_start)
        self._timing = splice.timing
        beneath = [each for each in stack.splices[:number] if each is not None]
        above = [each for each in stack.splices[number + 1 :] if each is not None]
        self._live = SplicePreview(
            stack.base.clip, stack.base.landmarks, [*beneath, splice, *above], len(beneath)
        )
        self._pose = pose_values(local_object(stack.armature))
        self._scene = scene.name
        self._frame = scene.frame_current_final
        self._down = False
        # A change of frame poses the armature as its action says.
        bpy.app.handlers.frame_change_post.append(self._follow)

    def show(self) -> None:
        """Pose the armature as the result is at the current frame.

        Raises:
            OctoMotionError: the armature is gone, or the timing makes no sense.
        """
        scene = bpy.data.scenes.get(self._scene)
        if self._down or scene is None:
            return
        armature = local_object(self.stack.armature)
        base_start, splice_start = self.drag.starts
        timing = replace(self._timing, base_start=base_start, splice_start=splice_start)
        clip = self._live.at(scene.frame_current_final, timing)
        scales = None if clip.scales is None else clip.scales[0]
        show_pose(armature, clip.skeleton.names, clip.rotations[0], clip.locations[0], scales)

    def step(self, frames: int) -> None:
        """Go so many frames on, or back."""
        scene = bpy.data.scenes.get(self._scene)
        if scene is not None:
            scene.frame_set(scene.frame_current + frames)

    def tear_down(self) -> None:
        """Give the armature its pose back; safe to call twice."""
        if self._down:
            return
        self._down = True
        followers = bpy.app.handlers.frame_change_post
        if self._follow in followers:
            followers.remove(self._follow)
        try:
            armature = local_object(self.stack.armature)
        except WriteError:
            return
        restore_pose(armature, self._pose)
        scene = bpy.data.scenes.get(self._scene)
        if scene is not None and scene.frame_current_final != self._frame:
            scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)

    def _follow(self, scene: bpy.types.Scene, *_: object) -> None:
        if scene.name != self._scene:
            return
        # The next event of the drag says what is wrong.
        with suppress(OctoMotionError):
            self.show()
