# SPDX-License-Identifier: GPL-3.0-or-later
"""A session of posing from a file: the same hand, without a mouse, the same each time."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import bpy
import numpy as np
from bpy.props import StringProperty

from ...blender.rig import active_armature
from ...core.errors import OctoMotionError, SettingsError
from ...core.files import read_text
from ...core.phrases import phrase
from ...core.posing.pose_script import PoseScript, ScriptStep, parse_script
from ...core.rotations import IDENTITY, Floats, from_rotation_vector, multiply
from ..language import reported
from ..operator_base import ArmatureOperator, FileOperator
from .properties import posing_settings
from .puppet_session import PuppetSession

TICK: Final = 1.0 / 60.0
"""Seconds: a script moves the hand as often as the mouse does."""


class Player:
    """Plays a script on a session that has no clock, so that each run is the same."""

    def __init__(self, session: PuppetSession, script: PoseScript) -> None:
        self._session = session
        self._script = script
        self._hand: Floats | None = None
        self._turn = IDENTITY.copy()
        self._played = 0.0
        """Seconds since the frame that is shown while recording."""
        self.keys = 0
        """How many bones were keyed, all in all."""

    def play(self) -> None:
        """All steps, in order.

        Raises:
            OctoMotionError: a step cannot be done.
        """
        for number, step in enumerate(self._script.steps, 1):
            try:
                getattr(self, f"_{step.do}")(step)
            except OctoMotionError as error:
                raise SettingsError(
                    phrase(
                        "Step {number} of the script cannot be done: {problem}",
                        number=number,
                        problem=error.problem,
                    ),
                    error.remedy,
                ) from error

    def _grab(self, step: ScriptStep) -> None:
        self._hand = self._session.grab_bone(step.bone, step.at)
        self._turn = IDENTITY.copy()

    def _pull(self, step: ScriptStep) -> None:
        if self._hand is None:
            raise SettingsError("Nothing is held.", "Put a step 'grab' before it.")
        start, turned = self._hand, self._turn
        end = start if step.to is None else np.array(step.to)
        if step.by is not None:
            end = start + np.array(step.by)
        swing = np.radians(np.array(step.turn))
        count = max(1, round(step.seconds / TICK))
        for number in range(1, count + 1):
            share = number / count
            self._hand = start + share * (end - start)
            self._turn = multiply(from_rotation_vector(share * swing), turned)
            self._tick()

    def _wait(self, step: ScriptStep) -> None:
        for _ in range(round(step.seconds / TICK)):
            self._tick()

    def _release(self, _step: ScriptStep) -> None:
        self._hand = None
        self.keys += len(self._session.release())

    def _pin(self, step: ScriptStep) -> None:
        self._session.core.pin(self._session.body(step.bone), state=True)

    def _unpin(self, step: ScriptStep) -> None:
        self._session.core.pin(self._session.body(step.bone), state=False)

    def _frame(self, step: ScriptStep) -> None:
        scene = self._session.scene()
        if not self._session.recording:
            scene.frame_set(step.frame)
            if self._session.held is None:
                self._hand = None
        # While recording, time goes by from frame to frame, and the hand waits.
        while scene.frame_current < step.frame:
            self._tick()

    def _key(self, step: ScriptStep) -> None:
        bones = None if isinstance(step.bones, str) else step.bones
        self.keys += len(self._session.key(all_bones=step.bones == "all", bones=bones))

    def _record(self, _step: ScriptStep) -> None:
        self._session.record()

    def _stop(self, _step: ScriptStep) -> None:
        bones, count = self._session.stop_record()
        self.keys += bones * count

    def _restore(self, _step: ScriptStep) -> None:
        self._hand = None
        self._session.restore()

    def _tick(self) -> None:
        self._session.tick(TICK, self._hand, self._turn)
        if not self._session.recording:
            return
        # The scene plays at its own rate.
        self._played += TICK
        scene = self._session.scene()
        assert scene.render is not None
        length = scene.render.fps_base / scene.render.fps
        while self._played >= length - 1e-9:
            self._played -= length
            scene.frame_set(scene.frame_current + 1)


def apply_settings(armature: bpy.types.Object, values: Any) -> None:
    """Set what a script sets on the armature's settings.

    Raises:
        SettingsError: there is no such setting, or it does not take the value.
    """
    settings: Any = posing_settings(armature)
    for name, value in values.items():
        definition = settings.bl_rna.properties.get(name)
        if definition is None or definition.type == "POINTER" or name == "obstacle":
            raise SettingsError(
                phrase("There is no setting '{name}' of posing.", name=name), "Check its name."
            )
        try:
            setattr(settings, name, value)
        except (TypeError, ValueError):
            raise SettingsError(
                phrase(
                    "The setting '{name}' of posing does not take {value!r}.",
                    name=name,
                    value=value,
                ),
                "See the scripting reference.",
            ) from None


def play_file(armature: bpy.types.Object, scene: bpy.types.Scene, path: Path) -> Player:
    """Play a script of a file on an armature, and keep what comes of it.

    Raises:
        OctoMotionError: the file or a step is wrong; the armature is as it was.
    """
    try:
        text = read_text(path)
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(
            phrase("'{path}' cannot be read: {error}.", path=path.name, error=error),
            "Choose another.",
        ) from None
    script = parse_script(text, path.name)
    settings: Any = posing_settings(armature)
    before = {name: getattr(settings, name) for name in script.settings if hasattr(settings, name)}
    try:
        apply_settings(armature, script.settings)
        frame, subframe = scene.frame_current, scene.frame_subframe
        session = PuppetSession(armature, scene, clock=None)
        player = Player(session, script)
        try:
            player.play()
        except BaseException:
            if (scene.frame_current, scene.frame_subframe) != (frame, subframe):
                scene.frame_set(frame, subframe=subframe)
            session.cancel()
            raise
        session.finish()
    except BaseException:
        apply_settings(armature, before)
        raise
    return player


class OCTO_MOTION_OT_pose_script(FileOperator, ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.pose_script"
    bl_label = "Play Pose Script"
    bl_description = (
        "Pose the figure by a file of grabs, pulls, pins and keys (JSON), as by hand and the same "
        "each time"
    )

    filepath: StringProperty(
        name="File Path",
        description="The script",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def run(self, context: bpy.types.Context) -> None:
        if not self.filepath:
            raise SettingsError("No file is given.", "Choose a script of posing.")
        assert context.scene is not None
        path = Path(bpy.path.abspath(self.filepath))
        player = play_file(active_armature(context), context.scene, path)
        self.report(
            {"INFO"},
            reported(
                phrase("Played '{path}': {keys} bones keyed.", path=path.name, keys=player.keys)
            ),
        )
