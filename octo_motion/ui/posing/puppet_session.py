# SPDX-License-Identifier: GPL-3.0-or-later
"""A session of posing on an armature, without a window: the mouse, a device and scripts share it.

Points are in the world and in Blender's units; the puppet's own metres stay inside.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import bpy

from ...blender.animation import Keyed, PoseKeys, pose_values, restore_pose, writable_armature
from ...core.errors import OctoMotionError, RigError, SettingsError
from ...core.posing.session import HandSample, TickReport
from ...core.posing.solver import HandSpring, OneThread
from ...core.rotations import IDENTITY, Floats
from .posed_puppet import PosedPuppet
from .properties import posing_settings
from .recording import Recording


@contextmanager
def _pose_kept(armature: bpy.types.Object) -> Iterator[None]:
    """Let bones without keys keep their pose.

    For an action that is new on the armature, or has new curves, Blender would pose all bones by
    their keys, those that are posed and not keyed yet as well.
    """
    values = pose_values(armature)
    try:
        yield
    finally:
        if bpy.context.view_layer is not None:
            bpy.context.view_layer.update()
        restore_pose(armature, values)


_active: list[PuppetSession] = []


def active_session() -> PuppetSession | None:
    """The session that is going on, if one is."""
    return _active[0] if _active else None


class PuppetSession(PosedPuppet):
    """An armature in a hand, from start to end.

    Args:
        armature: the armature object.
        scene: whose frames and obstacles count.
        clock: as of ``Session``; none makes it repeatable.

    Raises:
        OctoMotionError: it cannot be posed; nothing has changed then.
    """

    def __init__(
        self,
        armature: bpy.types.Object,
        scene: bpy.types.Scene,
        *,
        clock: Callable[[], float] | None = time.perf_counter,
    ) -> None:
        going_on = active_session()
        if going_on is not None:
            raise RigError(
                f"'{going_on.puppet.name}' is being posed already.",
                "End that session first, with Enter or Esc over its viewport.",
            )
        writable_armature(armature)
        super().__init__(armature, scene, clock)
        settings: Any = posing_settings(armature)
        self.keys = PoseKeys(armature, settings.keys_to, settings.action)
        self._values = pose_values(armature)
        self._frame = self._started = scene.frame_current_final
        self._recording: Recording | None = None
        self._down = False
        self.report: TickReport | None = None
        self._trouble: OctoMotionError | None = None
        self._one_thread = OneThread()
        for called, handler in self._handlers():
            called.append(handler)
        _active.append(self)

    # --- The hand -------------------------------------------------------------------------------

    def grab(self, body: int, point: Floats) -> None:
        """Take hold of a body at a point (3,) in the puppet's metres; what was held is let go."""
        self.core.release()
        self.core.grab(body, point)

    def grab_bone(self, bone: str, share: float) -> Floats:
        """Take hold of a bone by name, at a share of its length; the point (3,) in the world."""
        body, point = self.point_on(bone, share)
        self.grab(body, point)
        return point / self.unit

    def release(self) -> list[str]:
        """Let go; with auto keying, what the hand has moved gets keys. The keyed bones."""
        if self.held is None:
            return []
        self.core.release()
        tools = self.scene().tool_settings
        if tools.use_keyframe_insert_auto and self._recording is None:
            return self._insert(self._touched(), auto=True)
        return []

    # --- Time -----------------------------------------------------------------------------------

    def tick(
        self, seconds: float, position: Floats | None = None, turn: Floats | None = None
    ) -> TickReport:
        """Simulate, and pose the armature.

        Args:
            seconds: real time since the last tick.
            position: (3,) of the hand, world.
            turn: (4,) of the hand since it took hold.

        Raises:
            RigError: the armature is gone, changed or in edit mode.
        """
        trouble, self._trouble = self._trouble, None
        if trouble is not None:
            raise trouble
        armature = self.puppet.armature()
        if armature.mode == "EDIT":
            raise RigError(f"'{armature.name}' is in edit mode.", "Leave it and start again.")
        self.apply_settings(armature)
        if self._recording is None and self.puppet.is_moved():
            # By hand, at the same frame.
            self.measuring = None
            self._adopt()
        if self.measuring is not None:
            if position is not None:
                self.measuring.tick(seconds, position * self.unit)
            self.puppet.write(self.measuring.pose())
            # Time stands still meanwhile.
            self.report = TickReport(0.0, 0, 1.0, self.core.world.settings.step, resting=False)
            return self.report
        hands: dict[HandSpring, HandSample] = {}
        if self.held is not None and position is not None:
            turned = IDENTITY if turn is None else turn
            hands[self.held] = HandSample(position * self.unit, turned)
        self.report = self.core.tick(seconds, hands)
        if not self.report.resting:
            self.puppet.write(self.core.pose)
        return self.report

    def measure(self, body: int) -> None:
        """As ``PosedPuppet.measure``.

        Raises:
            RigError: the limb has no joint.
            SettingsError: a recording is going on.
        """
        if self.recording:
            raise SettingsError("A recording is going on.", "End it before you measure.")
        super().measure(body)

    # --- Keys -----------------------------------------------------------------------------------

    def key(self, *, all_bones: bool = False, bones: Iterable[str] | None = None) -> list[str]:
        """Key the bones that were touched, or all limbs, at the current frame.

        Returns:
            The bones that got a key.
        """
        if bones is not None:
            bodies = [self.body(each) for each in bones]
        else:
            bodies = list(range(len(self.figure))) if all_bones else self._touched()
        return self._insert(bodies)

    def _touched(self) -> list[int]:
        return self.puppet.with_followers(self.core.touched())

    def _insert(self, bodies: Iterable[int], *, auto: bool = False) -> list[str]:
        keyed = [Keyed(self.bone(body), self.puppet.places(body)) for body in bodies]
        if not keyed:
            return []
        frame, armature = self.scene().frame_current_final, self.puppet.armature()
        with _pose_kept(armature):
            return self.keys.insert(armature, keyed, frame, auto=auto)

    @property
    def recording(self) -> bool:
        """Whether the motion of the drag is kept while the frames go by."""
        return self._recording is not None

    def record(self) -> None:
        """Begin to keep the pose at each frame, from this one on.

        Raises:
            WriteError: a motion could not be written.
        """
        self.keys.check_motion(self.puppet.armature())
        self._recording = Recording(self.puppet, self.scene().frame_current_final, self.core.pose)

    def stop_record(self) -> tuple[int, int]:
        """Write what was kept as few keys; number of bones and of key frames."""
        recording, self._recording = self._recording, None
        if recording is None:
            return 0, 0
        with _pose_kept(self.puppet.armature()):
            bones, count = recording.write(self.keys)
        if recording.go_along(bones) and bpy.context.view_layer is not None:
            bpy.context.view_layer.update()
            self._adopt()
        return len(bones), count

    # --- Ends -----------------------------------------------------------------------------------

    def restore(self) -> None:
        """Back to the pose at the start; keys stay."""
        self.core.restore()
        self.puppet.write(self.core.pose)

    def step_back(self) -> bool:
        """Back to before the last grab; whether there was one."""
        done = self.core.step_back()
        if done:
            self.puppet.write(self.core.pose)
        return done

    def finish(self) -> None:
        """End, and keep the pose and the keys; safe to call twice.

        Raises:
            OctoMotionError: what is still to be keyed cannot be; it is over all the same.
        """
        if self._down:
            return
        try:
            self.drop_measure()
            self.release()
            if self._recording is not None:
                self.stop_record()
        finally:
            self._leave()

    def cancel(self) -> None:
        """End, and put back pose and keys as they were; safe to call twice."""
        if self._down:
            return
        self.core.release()
        self._leave()
        try:
            armature = self.puppet.found()
            scene = self.scene()
        except OctoMotionError:
            return
        with _pose_kept(armature):
            self.materials.take_back(armature)
            self.keys.take_back(armature)
        restore_pose(armature, self._values)
        if scene.frame_current_final != self._started:
            # What has keys is at another frame now.
            scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)

    def abandon(self) -> None:
        """End without touching the file, which is about to go; safe to call twice."""
        if not self._down:
            self._leave()

    @property
    def ended(self) -> bool:
        """Whether it is over."""
        return self._down

    def _handlers(self) -> tuple[tuple[Any, Any], ...]:
        """Blender's lists of what it calls, and what it is to call of this session."""
        known = bpy.app.handlers
        return (
            (known.frame_change_post, self._follow),
            (known.undo_post, self._undone),
            (known.redo_post, self._undone),
            (known.load_pre, self._file_goes),
        )

    def _file_goes(self, *_: object) -> None:
        self.abandon()

    def _leave(self) -> None:
        self._down = True
        self._one_thread.end()
        for called, handler in self._handlers():
            if handler in called:
                called.remove(handler)
        if self in _active:
            _active.remove(self)

    # --- Inside ---------------------------------------------------------------------------------

    def _follow(self, scene: bpy.types.Scene, *_: object) -> None:
        """A change of frame poses the armature as its action says."""
        if scene.session_uid != self._scene or scene.frame_current_final == self._frame:
            return
        self._see(scene)

    def _undone(self, *_: object) -> None:
        """Blender has put the file into another state: a recording of this one is over."""
        self._recording = None
        try:
            self._see(self.scene())
        except OctoMotionError as error:
            self._trouble = error

    def _see(self, scene: bpy.types.Scene) -> None:
        """Something else has posed the armature, and moved obstacles perhaps."""
        self._frame = scene.frame_current_final
        try:
            self.measuring = None
            self.puppet.forget()
            if self._recording is None:
                self.core.adopt(self.puppet.read())
            else:
                self._record_frame(self._recording, self._frame)
        except OctoMotionError as error:
            # The next tick says so.
            self._trouble = error
        if self.settings.use_obstacles:
            self.see_obstacles()

    def _adopt(self) -> None:
        """Go on from what the armature shows."""
        self.puppet.forget()
        self.core.adopt(self.puppet.read())

    def _record_frame(self, recording: Recording, frame: float) -> None:
        if recording.is_past(frame):
            # Playback has come round, or someone has gone back: the take is complete.
            self._recording = None
            bones, _ = recording.write(self.keys)
            recording.go_along(bones)
            self.core.adopt(self.puppet.read())
            return
        recording.keep(frame, self.core.pose)
        self.puppet.write(self.core.pose)
