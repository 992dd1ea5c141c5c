# SPDX-License-Identifier: GPL-3.0-or-later
"""A session of posing on an armature, without a window: the mouse, a device and scripts share it.

Points are in the world and in Blender's units; the puppet's own metres stay inside.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import bpy
import numpy as np

from ...blender.animation import (
    Keyed,
    PoseKeys,
    mark_file_changed,
    pose_kept,
    pose_values,
    restore_pose,
    writable_armature,
)
from ...blender.scene import part_of_pose
from ...core.errors import OctoMotionError, RigError, SettingsError
from ...core.phrases import as_phrase, joined_phrases, phrase
from ...core.posing.balance import Balance, balance_now
from ...core.posing.picking import Hit, pick
from ...core.posing.puppet import (
    Elements,
    Figure,
    JointCoefficients,
    Material,
    Pose,
    capsules_in_world,
    joined_elements,
    joint_loads,
    part_of,
)
from ...core.posing.session import HandSample, TickReport, hand_for
from ...core.posing.solver import HandSpring, OneThread, WorldSettings
from ...core.rotations import IDENTITY, Floats, rotate
from ...device.shared_session import SharedSession
from .aids import OtherSide, Traces
from .companions import Companions, company_of, elements_beside, hold_partners
from .measuring_hand import MeasuringHand, coefficients, measured_joint
from .properties import posing_settings
from .recording import Recording
from .session_settings import GRAVITY, BoneMaterials, SessionSettings


class PosedPuppet:
    """An armature's puppet that is simulated as the panel's settings say, with a scene's obstacles.

    Raises:
        OctoMotionError: it cannot be posed.
    """

    def __init__(
        self,
        armature: bpy.types.Object,
        scene: bpy.types.Scene,
        clock: Callable[[], float] | None,
        partners: Sequence[bpy.types.Object] = (),
    ) -> None:
        self.puppet = company_of(armature, partners, scene)
        self.settings = SessionSettings.of(armature)
        self.materials = BoneMaterials(self.puppet.main)
        self.measuring: MeasuringHand | None = None
        self.warning = ""
        """What is wrong with the scene, and keeps nobody from posing."""
        self.missed = ""
        """What of the last drag the rig's controls cannot give, if it is posed through these."""
        self._scene = scene.session_uid
        figure = self.puppet.figure
        self.core = SharedSession(
            replace(figure, elements=self._elements_of(self.puppet.main.figure)),
            self.puppet.pose,
            WorldSettings(**self.settings.world),
            self.settings.obstacles(self.puppet, scene),
            clock=clock,
        )
        self.core.coupling = hand_for(self.own_figure, self.settings.strength)
        self._weights = joint_loads(figure)
        self.settings.hold_root(self.puppet.main, self.core)
        hold_partners(self.puppet, self.core)
        self.other_side = OtherSide(self.puppet.main, self.core)
        self.traces = Traces()

    # --- What is there --------------------------------------------------------------------------

    def scene(self) -> bpy.types.Scene:
        """The scene of the session.

        Raises:
            RigError: it is gone.
        """
        found = next((each for each in bpy.data.scenes if each.session_uid == self._scene), None)
        if found is None:
            raise RigError("The scene of the session is gone.", "Start posing again.")
        return found

    @property
    def unit(self) -> float:
        """Puppet metres of one unit of the world."""
        return self.puppet.rig.unit

    @property
    def figure(self) -> Figure:
        return self.core.figure

    @property
    def own_figure(self) -> Figure:
        """Of the armature alone, without what is beside it."""
        return part_of(self.core.figure, 0)

    @property
    def shown_pose(self) -> Pose:
        """Where the bodies are, with the joint bent that is being measured."""
        return self.core.pose if self.measuring is None else self.measuring.pose()

    @property
    def held(self) -> HandSpring | None:
        """What the first hand holds, if any holds anything."""
        return self.core.held

    def still_held(self, spring: HandSpring | None) -> HandSpring | None:
        """What a hand holds, if nothing has taken it out of the hand."""
        return spring if spring in self.core.world.grabs else None

    def bone(self, body: int) -> str:
        return self.figure.names[body]

    def body(self, bone: str) -> int:
        """The body of a bone, or the one that a helper bone follows.

        Raises:
            RigError: there is no such bone, or it follows nothing.
        """
        return self.puppet.body(bone)

    def capsules(self) -> tuple[Floats, Floats]:
        """Ends (bodies, 2, 3) and radii (bodies,) of the limbs in the world."""
        return (
            capsules_in_world(self.figure, self.shown_pose) / self.unit,
            self.figure.radii / self.unit,
        )

    @property
    def size(self) -> float:
        """The largest extent of the puppet as it stands, in units of the world."""
        ends = self.capsules()[0][self.puppet.own]
        return float(np.ptp(ends.reshape(-1, 3), axis=0).max())

    def held_point(self, spring: HandSpring | None = None) -> Floats | None:
        """(3,) the point in a hand, the first if it is not said which, world."""
        point = self.core.held_point(spring)
        return None if point is None else point / self.unit

    def loads(self) -> Floats:
        """(bodies,) what each joint bears: 1 where it gives way, or bears all that hangs on it."""
        loads = np.linalg.norm(self.core.loads(), axis=1)
        limit = self.figure.elements.yield_torque
        limit = np.where(np.isfinite(limit) & (limit > 0.0), limit, self._weights)
        return loads / limit

    def balance(self) -> Balance:
        """Of the armature's figure: it stands on what is pinned, and on what it touches."""
        return balance_now(self.core, self.puppet.own, self.core.carried())

    def pull(self, spring: HandSpring | None = None) -> float:
        """How hard a hand pulls, the first if it is not said which, in weights of the figure."""
        spring = spring or self.held
        weight = -GRAVITY[2] * float(self.figure.masses[self.puppet.own].sum())
        return 0.0 if spring is None else float(np.linalg.norm(spring.wrench[:3])) / weight

    def pins(self) -> list[int]:
        """Bodies that the artist has nailed to their places, or that are by the settings."""
        return sorted(self.core.pins)

    def toggle_pin(self, body: int) -> str:
        """Nail a body to its place or take the nail out; what was done, in words."""
        state = body not in self.core.pins
        self.core.pin(body, state=state)
        other = self.other_side.opposite.get(body)
        if self.settings.mirror and other is not None:
            self.core.pin(other, state=state)
        return phrase("{bone} pinned" if state else "{bone} free again", bone=self.bone(body))

    def pick(self, origin: Floats, direction: Floats, *, margin: float = 0.0) -> Hit | None:
        """The body that a ray of the world meets; the hit's point is in the puppet's metres."""
        return pick(self.figure, self.shown_pose, origin * self.unit, direction, margin=margin)

    def grab_bone(self, bone: str, share: float) -> Floats:
        """Take hold of a bone by name, at a share of its length; the point (3,) in the world.

        Raises:
            RigError: there is no such bone.
        """
        self.core.release()
        return self.take_bone(bone, share)[1]

    def take_bone(self, bone: str, share: float) -> tuple[HandSpring, Floats]:
        """Take hold of a bone with one more hand; what holds it, and the point (3,) in the world.

        Raises:
            RigError: there is no such bone.
        """
        body, pose = self.body(bone), self.core.pose
        # From the joint to the limb's end, in the middle of which its mass is: of a ball too.
        way = 2.0 * share * self.figure.centres[body]
        point = pose.positions[body] + rotate(pose.orientations[body], way)
        return self.take(body, point), point / self.unit

    def take(self, body: int, point: Floats) -> HandSpring:
        """Take hold of a body at a point (3,) in the puppet's metres with one more hand, and with
        one on the other side where that is wanted.
        """
        spring = self.core.grab(body, point)
        self.missed = ""
        self.traces.begin()
        if posing_settings(self.puppet.armature()).mirror:
            self.other_side.take(spring)
        return spring

    def is_edited(self) -> bool:
        """Whether the armature is in edit mode, where nothing is posed.

        Raises:
            RigError: it is gone.
        """
        return any(each.mode == "EDIT" for each in self.puppet.armatures())

    # --- Settings -------------------------------------------------------------------------------

    def apply_settings(self, armature: bpy.types.Object) -> None:
        settings = SessionSettings.of(armature)
        if settings == self.settings:
            return
        before, self.settings = self.settings, settings
        if before.joints != settings.joints:
            self.core.change_elements(self._elements())
            self.core.coupling = hand_for(self.own_figure, settings.strength)
        if before.ground != settings.ground:
            self.see_obstacles()
        self.core.change(**settings.world)
        if before.root != settings.root:
            settings.hold_root(self.puppet.main, self.core)

    def see_obstacles(self) -> None:
        """Take obstacles as they are now; with one that is damaged, they stay as they were."""
        try:
            self.core.change_obstacles(self.settings.obstacles(self.puppet, self.scene()))
            self.warning = ""
        except OctoMotionError as error:
            self.warning = as_phrase(error)

    # --- Measuring ------------------------------------------------------------------------------

    def drop_measure(self) -> None:
        """End measuring without a result; the figure stands as before."""
        if self.measuring is not None:
            self.measuring = None
            self.puppet.forget()
            self.puppet.write(self.core.pose)

    def take_measure(self, *, bone_only: bool = False) -> str:
        """End measuring, and let the figure, or only the joint that was bent, be of what was shown;
        the coefficients, in words.

        Raises:
            SettingsError: what was shown makes no sense; measuring goes on.
            WriteError: the bones are linked; likewise.
        """
        assert self.measuring is not None
        body, bend = self.measuring.body, self.measuring.bend()
        measured, material = measured_joint(self.own_figure, body, self.settings.strength, bend)
        self.take_material(material, self.bone(body) if bone_only else "")
        self.drop_measure()
        return coefficients(self.bone(body), measured)

    def take_material(self, material: Material | JointCoefficients, bone: str) -> None:
        """Let the figure, or one bone's joint, be of a material, or this one of coefficients; taken
        back by ``cancel``.

        Raises:
            WriteError: the bones are linked.
        """
        self.materials.take(material, bone)
        self._apply_materials()

    def read_materials(self) -> None:
        """Take the materials of single bones anew."""
        self.materials.read()
        self._apply_materials()

    def _apply_materials(self) -> None:
        self.settings = SessionSettings.of(self.puppet.armature())
        self.core.change_elements(self._elements())

    def _elements(self) -> Elements:
        return self._elements_of(self.own_figure)

    def _elements_of(self, figure: Figure) -> Elements:
        own = self.settings.elements(figure, self.materials.by_body)
        return joined_elements([own, *elements_beside(self.puppet)])


_active: list[PuppetSession] = []


def active_session() -> PuppetSession | None:
    """The session that is going on, if one is."""
    return _active[0] if _active else None


class KeyedPuppet(PosedPuppet):
    """A puppet whose pose can be keyed.

    Raises:
        OctoMotionError: it cannot be posed, or not be keyed.
    """

    def __init__(
        self,
        armature: bpy.types.Object,
        scene: bpy.types.Scene,
        clock: Callable[[], float] | None,
        partners: Sequence[bpy.types.Object] = (),
    ) -> None:
        writable_armature(armature)
        super().__init__(armature, scene, clock, partners)
        self.companions = Companions(self.puppet)
        settings: Any = posing_settings(armature)
        self.keys = PoseKeys(armature, settings.keys_to, settings.action, blend=settings.key_blend)

    def key(self, *, all_bones: bool = False, bones: Iterable[str] | None = None) -> list[str]:
        """Key the bones that were touched, or all limbs, at the current frame; the bones that got a
        key.
        """
        if bones is not None:
            bodies = [self.body(each) for each in bones]
        else:
            bodies = list(range(len(self.figure))) if all_bones else self._touched()
        return self._insert(bodies, all_bones=all_bones)

    def words_for(self, keyed: list[str]) -> str:
        """Which bones got keys now, or why none did, for people."""
        if keyed:
            things = self.companions.objects_among(keyed)
            told = phrase(
                "Keyed {bones} at frame {frame}",
                bones=_bones_and_things(len(keyed) - things, things),
                frame=self.scene().frame_current,
            )
            if beneath := self.keys.layered or self.companions.layered:
                over = phrase(
                    ", in a layer over {beneath}, which has keys on every frame", beneath=beneath
                )
                return joined_phrases("", (told, over))
            return told
        if self.core.touched():
            return phrase("Nothing keyed: by the settings of keying, no bone needs or takes a key")
        return phrase("Nothing to key: no bone was moved")

    def settle(self) -> None:
        """Let the bones show the pose that the figure has."""
        self.missed = self.puppet.settle() or self.missed

    def _touched(self) -> list[int]:
        """Bodies that are keyed; what no eye sees of others is put back."""
        touched = self.puppet.with_followers(self.core.touched())
        self.core.put_back()
        self.puppet.write(self.core.pose)
        return touched

    def _insert(
        self, bodies: Iterable[int], *, auto: bool = False, all_bones: bool = False
    ) -> list[str]:
        self.settle()
        wanted = list(bodies)
        own = [body for body in wanted if body in self.puppet.own]
        keyed = [Keyed(*each) for each in self.puppet.main.keyed(own, all_bones=all_bones)]
        frame, armature = self.scene().frame_current_final, self.puppet.armature()
        done: list[str] = []
        self.traces.stood(frame, self.core.pose)
        if keyed:
            with pose_kept(armature):
                done = self.keys.insert(armature, keyed, frame, auto=auto)
        return done + self.companions.insert(wanted, frame, auto=auto, all_bones=all_bones)


class RecordedPuppet(KeyedPuppet):
    """A puppet whose drags can be recorded while the frames go by."""

    _recording: Recording | None = None

    @property
    def recording(self) -> bool:
        """Whether the motion of the drag is kept while the frames go by."""
        return self._recording is not None

    def toggle_record(self) -> str:
        """Begin to record, or write what was recorded; what was done, in words.

        Raises:
            WriteError: a motion cannot be written.
        """
        if self.recording:
            bones, frames = self.stop_record()
            return phrase(
                "Recorded {bones} on {frames}",
                bones=counted_bones(bones),
                frames=_key_frames(frames),
            )
        self.record()
        return phrase("Recording while the frames go by: play, and drag")

    def record(self) -> None:
        """Begin to keep the pose at each frame, from this one on.

        Raises:
            WriteError: a motion could not be written.
        """
        self.keys.check_motion(self.puppet.armature())
        self.companions.check_motion()
        frame, pose = self.scene().frame_current_final, self.core.pose
        self._recording = Recording(self.puppet.main, frame, self._own(pose))
        self.companions.record(frame, pose)

    def _own(self, pose: Pose) -> Pose:
        return part_of_pose(pose, self.puppet.own)

    def stop_record(self) -> tuple[int, int]:
        """Write what was kept as few keys; number of bones and of key frames."""
        recording, self._recording = self._recording, None
        if recording is None:
            return 0, 0
        with pose_kept(self.puppet.armature()):
            bones, count = recording.write(self.keys)
        others = self.companions.write_motion()
        if (recording.go_along(bones) or others) and bpy.context.view_layer is not None:
            bpy.context.view_layer.update()
            self._adopt()
        return len(bones) + others, count

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
            self.companions.write_motion()
            self.core.adopt(self.puppet.read())
            return
        pose = self.core.pose
        self.puppet.write(pose)
        recording.keep(frame, self._own(pose))
        self.companions.keep(frame, pose)


class PuppetSession(RecordedPuppet):
    """An armature in a hand, from start to end; without a clock it is repeatable.

    Raises:
        OctoMotionError: it cannot be posed; nothing has changed then.
    """

    def __init__(
        self,
        armature: bpy.types.Object,
        scene: bpy.types.Scene,
        *,
        clock: Callable[[], float] | None = time.perf_counter,
        partners: Sequence[bpy.types.Object] = (),
    ) -> None:
        """Of an armature, and of other ones that are posed along with it."""
        going_on = active_session()
        if going_on is not None:
            raise RigError(
                phrase("'{puppet}' is being posed already.", puppet=going_on.puppet.name),
                "End that session first, with Enter or Esc over its viewport.",
            )
        super().__init__(armature, scene, clock, partners)
        self._values = pose_values(armature)
        self._frame = self._started = scene.frame_current_final
        self.traces.stood(self._frame, self.core.pose)
        self.ended = False
        """Whether it is over."""
        self._moving = False
        """Whether what the bones show is on its way."""
        self._let_go = False
        """Whether a hand has let go of what moves since."""
        self.report: TickReport | None = None
        self._trouble: OctoMotionError | None = None
        self._one_thread = OneThread()
        for called, handler in self._handlers():
            called.append(handler)
        _active.append(self)

    # --- The hand -------------------------------------------------------------------------------

    def release(self, spring: HandSpring | None = None) -> list[str]:
        """Let go, with one hand or with all; with auto keying, what was moved gets keys. The keyed
        bones.
        """
        if self.held is None:
            return []
        self.core.release(spring)
        self.settle()
        self._let_go = True
        mark_file_changed()
        tools = self.scene().tool_settings
        if tools.use_keyframe_insert_auto and self._recording is None:
            return self._insert(self._touched(), auto=True)
        return []

    # --- Time -----------------------------------------------------------------------------------

    def tick(
        self,
        seconds: float,
        position: Floats | None = None,
        turn: Floats | None = None,
        *,
        hands: Mapping[HandSpring, tuple[Floats, Floats]] | None = None,
    ) -> TickReport:
        """Simulate so many seconds of real time, and pose the armature.

        The first hand is at a position (3,), world, and has turned by (4,) since it took hold; of
        others, or of all, ``hands`` has the same.

        Raises:
            RigError: the armature is gone, changed or in edit mode.
        """
        trouble, self._trouble = self._trouble, None
        if trouble is not None:
            raise trouble
        armature = self.puppet.armature()
        if self.is_edited():
            raise RigError(
                phrase("'{armature}' is in edit mode.", armature=armature.name),
                "Leave it and start again.",
            )
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
        held = {
            spring: HandSample(place * self.unit, turned)
            for spring, (place, turned) in (hands or {}).items()
        }
        if self.held is not None and position is not None:
            turned = IDENTITY if turn is None else turn
            held[self.held] = HandSample(position * self.unit, turned)
        self.core.kept = self.puppet.own if self.settings.balance == "KEPT" else range(0)
        self.report = self.core.tick(seconds, self.other_side.samples(held))
        point = self.held_point()
        if self.settings.trails and point is not None and held:
            self.traces.add(next(iter(held.values())).position / self.unit, point)
        if not self.report.resting:
            self.puppet.write(self.core.pose)
            self._moving = True
        elif self._moving:
            self._come_to_rest()
        return self.report

    def _come_to_rest(self) -> None:
        self._moving = False
        self.settle()
        if self._let_go and self.missed:
            shown = self.puppet.shown_for(self.core.pose)
            if shown is None:
                # It has sprung back to where they do reach.
                self.missed = ""
            else:
                # It is where one sees it, and can be taken hold of there.
                self.core.come_to(shown)
        # Only once: its own weight would lead it away again.
        self._let_go = False

    def measure(self, body: int) -> None:
        """From now on the hand shows how the joint of a limb is to bend, and nothing resists.

        Raises:
            RigError: the limb has no joint, or is that of another figure.
            SettingsError: a recording is going on.
        """
        if self.recording:
            raise SettingsError("A recording is going on.", "End it before you measure.")
        if body not in self.puppet.own:
            raise RigError(
                phrase(
                    "'{bone}' does not belong to '{puppet}'.",
                    bone=self.bone(body),
                    puppet=self.puppet.name,
                ),
                "Measure it in a session of its own.",
            )
        self.core.release()
        self.measuring = MeasuringHand(self.figure, self.core.pose, body)

    # --- Ends -----------------------------------------------------------------------------------

    def restore(self) -> None:
        """Back to the pose at the start; keys stay."""
        self.core.restore()
        self._stepped(done=True)

    def step_back(self) -> bool:
        """Back to before the last grab; whether there was one."""
        return self._stepped(self.core.step_back())

    def step_forward(self) -> bool:
        """On to what the last step back has undone; whether there was one."""
        return self._stepped(self.core.step_forward())

    def _stepped(self, done: bool) -> bool:  # noqa: FBT001 - what has come of the step
        if done:
            self.missed = ""
            self.puppet.write(self.core.pose)
            self.settle()
        return done

    def finish(self) -> None:
        """End, and keep the pose and the keys; safe to call twice.

        Raises:
            OctoMotionError: what is still to be keyed cannot be; it is over all the same.
        """
        if self.ended:
            return
        try:
            self.drop_measure()
            self.release()
            self.settle()
            if self._recording is not None:
                self.stop_record()
        finally:
            self._leave()

    def cancel(self) -> None:
        """End, and put back pose and keys as they were; safe to call twice."""
        if self.ended:
            return
        self.core.release()
        self._leave()
        try:
            armature = self.puppet.main.found()
            scene = self.scene()
        except OctoMotionError:
            return
        with pose_kept(armature):
            self.materials.take_back(armature)
            self.keys.take_back(armature)
        restore_pose(armature, self._values)
        self.companions.take_back()
        if scene.frame_current_final != self._started:
            # What has keys is at another frame now.
            scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)

    def abandon(self, *_: object) -> None:
        """End without touching the file, which is about to go; safe to call twice."""
        if not self.ended:
            self._leave()

    def _handlers(self) -> tuple[tuple[Any, Any], ...]:
        """Blender's lists of what it calls, and what it is to call of this session."""
        known = bpy.app.handlers
        return (
            (known.frame_change_post, self._follow),
            (known.undo_post, self._undone),
            (known.redo_post, self._undone),
            (known.load_pre, self.abandon),
        )

    def _leave(self) -> None:
        self.ended = True
        self._one_thread.end()
        for called, handler in self._handlers():
            if handler in called:
                called.remove(handler)
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
                self.traces.stood(self._frame, self.core.pose)
            else:
                self._record_frame(self._recording, self._frame)
        except OctoMotionError as error:
            # The next tick says so.
            self._trouble = error
        if self.settings.use_obstacles:
            self.see_obstacles()


def _bones_and_things(bones: int, things: int) -> str:
    if not things:
        return counted_bones(bones)
    objects = counted_objects(things)
    if not bones:
        return objects
    return phrase("{bones} and {objects}", bones=counted_bones(bones), objects=objects)


def counted_bones(count: int) -> str:
    """So many bones, in words."""
    return phrase("1 bone") if count == 1 else phrase("{count} bones", count=count)


def counted_objects(count: int) -> str:
    """So many objects, in words."""
    return phrase("1 object") if count == 1 else phrase("{count} objects", count=count)


def _key_frames(count: int) -> str:
    return phrase("1 key frame") if count == 1 else phrase("{count} key frames", count=count)
