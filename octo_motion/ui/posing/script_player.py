# SPDX-License-Identifier: GPL-3.0-or-later
"""A session of posing from a file: the same hand, without a mouse, the same each time."""

from __future__ import annotations

from dataclasses import dataclass, field
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
from ...core.posing.solver import HandSpring
from ...core.rotations import IDENTITY, Floats, from_rotation_vector, multiply
from ..language import reported
from ..operator_base import ArmatureOperator, FileOperator
from .properties import posing_settings
from .puppet_session import PuppetSession, counted_bones

TICK: Final = 1.0 / 60.0
"""Seconds: a script moves the hand as often as the mouse does."""


@dataclass(eq=False)
class _Hand:
    """A hand of a script, and where it is."""

    spring: HandSpring
    place: Floats
    """(3,) world."""
    turn: Floats = field(default_factory=IDENTITY.copy)
    """(4,) since it took hold."""


@dataclass(eq=False)
class _Way:
    """A pull that is going on."""

    hand: _Hand
    end: Floats
    swing: Floats
    """(3,) rotation vector."""
    ticks: int
    passed: int = 0

    def __post_init__(self) -> None:
        self._start, self._turned = self.hand.place, self.hand.turn

    def go_on(self) -> bool:
        """One tick more; whether it is there."""
        self.passed += 1
        share = self.passed / self.ticks
        self.hand.place = self._start + share * (self.end - self._start)
        self.hand.turn = multiply(from_rotation_vector(share * self.swing), self._turned)
        return self.passed >= self.ticks


class Player:
    """Plays a script on a session that has no clock, so that each run is the same."""

    def __init__(self, session: PuppetSession, script: PoseScript) -> None:
        self._session = session
        self._script = script
        self._hands: dict[str, _Hand] = {}
        self._ways: list[_Way] = []
        self._played = 0.0
        """Seconds since the frame that is shown while recording."""
        self.keys = 0
        """How many bones and objects were keyed, all in all."""

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
        while self._ways:
            self._tick()

    def _grab(self, step: ScriptStep) -> None:
        before = self._hands.pop(step.hand, None)
        if before is not None:
            self._drop(before)
            self._session.core.release(before.spring)
        spring, place = self._session.take_bone(step.bone, step.at)
        self._hands[step.hand] = _Hand(spring, place)

    def _pull(self, step: ScriptStep) -> None:
        self._forget_lost()
        hand = self._hands.get(step.hand)
        if hand is None:
            raise SettingsError("Nothing is held.", "Put a step 'grab' before it.")
        self._drop(hand)
        end = hand.place if step.to is None else np.array(step.to)
        if step.by is not None:
            end = hand.place + np.array(step.by)
        ticks = max(1, round(step.seconds / TICK))
        way = _Way(hand, end, np.radians(np.array(step.turn)), ticks)
        self._ways.append(way)
        while not step.meanwhile and way in self._ways:
            self._tick()

    def _wait(self, step: ScriptStep) -> None:
        for _ in range(round(step.seconds / TICK)):
            self._tick()

    def _release(self, step: ScriptStep) -> None:
        hand = self._hands.pop(step.hand, None)
        if hand is None or not step.hand:
            # Without a name, all of them.
            self._hands.clear()
            self._ways.clear()
            self.keys += len(self._session.release())
            return
        self._drop(hand)
        self.keys += len(self._session.release(hand.spring))

    def _pin(self, step: ScriptStep) -> None:
        self._session.core.pin(self._session.body(step.bone), state=True)

    def _unpin(self, step: ScriptStep) -> None:
        self._session.core.pin(self._session.body(step.bone), state=False)

    def _frame(self, step: ScriptStep) -> None:
        scene = self._session.scene()
        if not self._session.recording:
            scene.frame_set(step.frame)
            self._forget_lost()
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
        self._hands.clear()
        self._ways.clear()
        self._session.restore()

    def _drop(self, hand: _Hand) -> None:
        """A hand is on no way any more."""
        self._ways = [each for each in self._ways if each.hand is not hand]

    def _forget_lost(self) -> None:
        """Hands that a change of frame has taken the puppet out of hold nothing."""
        held = self._session.core.world.grabs
        self._hands = {name: each for name, each in self._hands.items() if each.spring in held}
        self._ways = [each for each in self._ways if each.hand.spring in held]

    def _tick(self) -> None:
        self._ways = [each for each in self._ways if not each.go_on()]
        hands = {each.spring: (each.place, each.turn) for each in self._hands.values()}
        self._session.tick(TICK, hands=hands)
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
        if definition is None or definition.type == "POINTER" or name in _OF_OBJECTS:
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


def _figure(scene: bpy.types.Scene, name: str) -> bpy.types.Object:
    """Another armature of the scene.

    Raises:
        SettingsError: there is none.
    """
    found = next((each for each in scene.objects if each.name == name), None)
    if found is None or found.type != "ARMATURE":
        raise SettingsError(
            phrase(
                "The script poses '{name}' along, and the scene has no such armature.", name=name
            ),
            "Correct its name in the script.",
        )
    return found


_OF_OBJECTS: Final = frozenset({"obstacle", "moves", "mass"})
"""Settings that count on other objects than armatures."""


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
        others = [_figure(scene, name) for name in script.figures]
        session = PuppetSession(armature, scene, clock=None, partners=others)
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
                phrase(
                    "Played '{path}': keyed {bones}.",
                    path=path.name,
                    bones=counted_bones(player.keys),
                )
            ),
        )
