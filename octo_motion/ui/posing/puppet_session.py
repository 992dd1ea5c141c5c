# SPDX-License-Identifier: GPL-3.0-or-later
"""A session of posing on an armature, without a window: the mouse, a device and scripts share it.

Points are in the world and in Blender's units; the puppet's own metres stay inside.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from typing import Any, Final

import bpy
import numpy as np

from ...blender.animation import (
    Keyed,
    PoseKeys,
    PoseValues,
    pose_values,
    restore_pose,
    writable_armature,
)
from ...blender.rig import Puppet, bone_materials, is_part_of, read_rig
from ...blender.scene import read_obstacle
from ...core.errors import OctoMotionError, RigError, SettingsError
from ...core.posing.picking import Hit, capsules_in_world, pick
from ...core.posing.puppet import Figure, Material, Pose, elements_for, joint_loads, turned_bodies
from ...core.posing.session import TOUCHED, HandSample, Session, TickReport, hand_for
from ...core.posing.solver import Obstacle, OneThread, Plane, WorldSettings
from ...core.rotations import IDENTITY, Floats
from .custom_material import (
    chosen_material,
    coefficients,
    keep_material,
    kept_before,
    measured_joint,
)
from .measuring_hand import MeasuringHand
from .properties import marked_obstacles, posing_settings

GRAVITY: Final = (0.0, 0.0, -9.81)
_CALMING: Final = 3.0
"""1/s: how fast a free puppet without weight comes to rest."""
_LOCATION_SHARE: Final = 0.002
"""Of the figure's size: how far a recorded location's keys may be off."""


@dataclass(frozen=True)
class _Shown:
    """The settings that may be changed in the panel while the session goes on."""

    material: str
    strength: float
    custom_yields: bool
    custom_bears: float
    custom_springs: float
    custom_settles: float
    custom_gives: float
    root: str
    gravity: bool
    floor: bool
    floor_height: float
    use_obstacles: bool
    self_collision: bool
    friction: float

    @classmethod
    def of(cls, settings: Any) -> _Shown:
        return cls(**{each.name: getattr(settings, each.name) for each in fields(cls)})

    @property
    def joints(self) -> tuple[Any, float]:
        """What decides on the joints."""
        return chosen_material(self), self.strength

    @property
    def ground(self) -> tuple[bool, float, bool]:
        """What decides on obstacles."""
        return self.floor, self.floor_height, self.use_obstacles


@dataclass(frozen=True, eq=False)
class _Moment:
    """One frame of a recording."""

    pose: Pose
    rotations: Floats
    """(bodies, 4) of the bones, from rest."""
    locations: Floats
    """(bodies, 3)"""


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


class PuppetSession:
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
        settings: Any = posing_settings(armature)
        self.puppet = Puppet(armature, read_rig(armature, smallest=settings.smallest))
        self.keys = PoseKeys(armature, settings.keys_to, settings.action)
        self._scene = scene.session_uid
        self._shown = _Shown.of(settings)
        self._materials = self._bone_materials(armature)
        self._measured: list[Callable[[bpy.types.Object], None]] = []
        self.measuring: MeasuringHand | None = None
        figure = replace(self.puppet.figure, elements=self._elements(self.puppet.figure))
        self.core = Session(
            figure,
            self.puppet.rig.pose,
            self._world_settings(),
            self._obstacles(),
            clock=clock,
        )
        self.core.hand = hand_for(figure, settings.strength)
        self._weights = joint_loads(figure)
        self._hold_root()
        self._values = pose_values(armature)
        self._frame = self._started = scene.frame_current_final
        self._recorded: dict[float, _Moment] | None = None
        self._own: PoseValues = {}
        """Of the bones, when a recording was begun."""
        self._down = False
        self.told: TickReport | None = None
        self.warning = ""
        """What is wrong with the scene, and keeps nobody from posing."""
        self._trouble: OctoMotionError | None = None
        self._one_thread = OneThread()
        for called, handler in self._handlers():
            called.append(handler)
        _active.append(self)

    # --- What is there --------------------------------------------------------------------------

    @property
    def unit(self) -> float:
        """Puppet metres of one unit of the world."""
        return self.puppet.rig.unit

    @property
    def figure(self) -> Figure:
        """The puppet."""
        return self.core.figure

    @property
    def shown_pose(self) -> Pose:
        """Where the bodies are, with the joint bent that is being measured."""
        return self.core.pose if self.measuring is None else self.measuring.pose()

    def scene(self) -> bpy.types.Scene:
        """The scene of the session.

        Raises:
            RigError: it is gone.
        """
        found = next((each for each in bpy.data.scenes if each.session_uid == self._scene), None)
        if found is None:
            raise RigError("The scene of the session is gone.", "Start posing again.")
        return found

    def bone(self, body: int) -> str:
        """The bone of a body."""
        return self.figure.names[body]

    def body(self, bone: str) -> int:
        """The body of a bone, or the one that a helper bone follows.

        Raises:
            RigError: there is no such bone, or it follows nothing.
        """
        return self.puppet.rig.body(bone, self.puppet.name)

    def capsules(self) -> tuple[Floats, Floats]:
        """Ends (bodies, 2, 3) and radii (bodies,) of the limbs in the world."""
        return (
            capsules_in_world(self.figure, self.shown_pose) / self.unit,
            self.figure.radii / self.unit,
        )

    def held_point(self) -> Floats | None:
        """(3,) the point in the hand, world."""
        point = self.core.held_point()
        return None if point is None else point / self.unit

    def loads(self) -> Floats:
        """(bodies,) what each joint bears: 1 where it gives way, or bears all that hangs on it."""
        loads = np.linalg.norm(self.core.world.joint_loads(), axis=1)
        limit = self.figure.elements.yield_torque
        limit = np.where(np.isfinite(limit) & (limit > 0.0), limit, self._weights)
        return loads / limit

    def pull(self) -> float:
        """How hard the hand pulls, in weights of the whole figure."""
        weight = -GRAVITY[2] * float(self.figure.masses.sum())
        return float(np.linalg.norm(self.core.force())) / weight

    def pins(self) -> list[int]:
        """Bodies that the artist has nailed to their places, or that are by the settings."""
        return sorted(self.core.pins)

    @property
    def size(self) -> float:
        """The largest extent of the puppet as it stands, in units of the world."""
        return float(np.ptp(self.capsules()[0].reshape(-1, 3), axis=0).max())

    @property
    def root_is_held(self) -> bool:
        """Whether the root neither moves nor turns."""
        return self._shown.root == "HELD"

    # --- The hand -------------------------------------------------------------------------------

    def pick(self, origin: Floats, direction: Floats, *, margin: float = 0.0) -> Hit | None:
        """The body that a ray of the world meets; the hit's point is in the puppet's metres."""
        return pick(self.figure, self.shown_pose, origin * self.unit, direction, margin=margin)

    def grab(self, hit: Hit) -> None:
        """Take hold of a body."""
        self.core.grab(hit)

    def grab_bone(self, bone: str, share: float) -> Floats:
        """Take hold of a bone by name, at a share of its length; the point (3,) in the world."""
        body = self.body(bone)
        pose = self.core.pose
        start, end = capsules_in_world(self.figure, pose)[body]
        # Capsules end a radius before the limb does.
        way = end - start
        size = float(np.linalg.norm(way))
        radius = self.figure.radii[body] * (way / size if size > 0.0 else way)
        point = (start - radius) + share * (way + 2.0 * radius) if size > 1e-9 else start
        self.core.grab(Hit(body, point, 0.0))
        return point / self.unit

    def release(self) -> list[str]:
        """Let go; with auto keying, what the hand has moved gets keys. The keyed bones."""
        if self.core.grip is None:
            return []
        self.core.release()
        tools = self.scene().tool_settings
        if tools.use_keyframe_insert_auto and self._recorded is None:
            return self._insert(self._touched(), auto=True)
        return []

    def toggle_pin(self, body: int) -> bool:
        """Nail a body to its place or take the nail out; whether it is pinned now."""
        state = body not in self.core.pins
        self.core.pin(body, state=state)
        return state

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
        self._apply_settings(armature)
        if self._recorded is None and self.puppet.is_moved():
            # By hand, at the same frame.
            self.measuring = None
            self.puppet.forget()
            self.core.adopt(self.puppet.read())
        sample = None
        if self.measuring is not None:
            if position is not None:
                self.measuring.tick(seconds, position * self.unit)
            self.puppet.write(self.measuring.pose())
            # Time stands still meanwhile.
            self.told = TickReport(0.0, 0, 1.0, self.core.world.settings.step, resting=False)
            return self.told
        if position is not None:
            sample = HandSample(position * self.unit, IDENTITY if turn is None else turn)
        self.told = self.core.tick(seconds, sample)
        if not self.told.resting:
            self.puppet.write(self.core.pose)
        return self.told

    # --- Measuring ------------------------------------------------------------------------------

    def measure(self, body: int) -> None:
        """From now on the hand shows how the joint of a limb is to bend, and nothing resists.

        Raises:
            RigError: the limb has no joint.
            SettingsError: a recording is going on.
        """
        if self.recording:
            raise SettingsError("A recording is going on.", "End it before you measure.")
        self.core.release()
        self.measuring = MeasuringHand(self.figure, self.core.pose, body)

    def drop_measure(self) -> None:
        """End measuring without a result; the figure stands as before."""
        if self.measuring is not None:
            self.measuring = None
            self.puppet.forget()
            self.puppet.write(self.core.pose)

    def take_measure(self, *, bone_only: bool = False) -> str:
        """End measuring, and let the figure be of what was shown; the coefficients, in words.

        Args:
            bone_only: whether only the joint that was bent is.

        Raises:
            SettingsError: what was shown makes no sense; measuring goes on.
            WriteError: the bones are linked; likewise.
        """
        assert self.measuring is not None
        body, bend = self.measuring.body, self.measuring.bend()
        strength = self._shown.strength
        measured, material = measured_joint(self.figure, body, strength, bend)
        self.take_material(material, self.bone(body) if bone_only else "")
        self.drop_measure()
        return coefficients(self.bone(body), measured)

    def take_material(self, material: Material, bone: str) -> None:
        """Let the figure, or one bone's joint, be of a material; taken back by ``cancel``.

        Raises:
            WriteError: the bones are linked.
        """
        armature = self.puppet.armature()
        settings: Any = posing_settings(armature)
        self._measured.append(kept_before(armature, settings, bone))
        keep_material(armature, settings, material, bone)
        self.read_materials()

    def read_materials(self) -> None:
        """Take the materials of single bones anew."""
        self._materials = self._bone_materials(self.puppet.armature())
        self._shown = _Shown.of(posing_settings(self.puppet.armature()))
        self.core.change_elements(self._elements(self.figure))

    def _bone_materials(self, armature: bpy.types.Object) -> dict[int, Material]:
        own = bone_materials(armature)
        names = self.puppet.figure.names
        return {body: own[name] for body, name in enumerate(names) if name in own}

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
        return self._recorded is not None

    def record(self) -> None:
        """Begin to keep the pose at each frame, from this one on.

        Raises:
            WriteError: a motion could not be written.
        """
        self.keys.check_motion(self.puppet.armature())
        self._own = pose_values(self.puppet.armature())
        self._recorded = {self.scene().frame_current_final: self._moment()}

    def stop_record(self) -> tuple[int, int]:
        """Write what was kept as few keys; number of bones and of key frames."""
        armature = self.puppet.armature()
        with _pose_kept(armature):
            bones, count = self._write_record()
        if self._go_along(armature, bones) and bpy.context.view_layer is not None:
            bpy.context.view_layer.update()
            self.puppet.forget()
            self.core.adopt(self.puppet.read())
        return len(bones), count

    def _go_along(self, armature: bpy.types.Object, recorded: Iterable[str]) -> bool:
        """Let what stood still in the recording go on with what carries it; whether anything did.

        While a root bone travels, the figure's own root is held back to stay in its place, and is
        to be no further off once that is over: unless it was moved, it has got no keys.
        """
        loose = {self.bone(body) for body in range(len(self.figure)) if self.puppet.places(body)}
        now = pose_values(armature)
        back = {
            bone: own
            for bone, own in self._own.items()
            if bone in loose.difference(recorded) and now.get(bone) != own
        }
        restore_pose(armature, back)
        return bool(back)

    def _write_record(self) -> tuple[list[str], int]:
        """Names of the bones that got keys, and the number of key frames."""
        recorded, self._recorded = self._recorded, None
        if recorded is None or len(recorded) < 2:
            return [], 0
        frames = np.array(sorted(recorded))
        moments = [recorded[frame] for frame in frames]
        moved: set[int] = set()
        for each in moments[1:]:
            moved |= set(turned_bodies(self.figure, moments[0].pose, each.pose, TOUCHED))
        if not moved:
            return [], 0
        bodies = self.puppet.with_followers(moved)
        rotations = {
            self.bone(body): np.stack([each.rotations[body] for each in moments]) for body in bodies
        }
        locations = {
            self.bone(body): np.stack([each.locations[body] for each in moments])
            for body in bodies
            if self.puppet.places(body)
        }
        settings: Any = posing_settings(self.puppet.armature())
        size = float(np.ptp(self.puppet.rig.skeleton.heads, axis=0).max())
        count = self.keys.insert_motion(
            self.puppet.armature(),
            frames,
            rotations,
            locations,
            angle=settings.record_angle,
            distance=_LOCATION_SHARE * size,
        )
        return list(rotations), count

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
            if self._recorded is not None:
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
            for take_back in reversed(self._measured):
                take_back(armature)
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
        self._recorded = None
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
            if self._recorded is None:
                self.core.adopt(self.puppet.read())
            else:
                self._record_frame(self._frame)
        except OctoMotionError as error:
            # The next tick says so.
            self._trouble = error
        if self._marked or marked_obstacles(scene):
            self._see_obstacles()

    def _see_obstacles(self) -> None:
        """Take obstacles as they are now; with one that is damaged, they stay as they were."""
        try:
            self.core.change_obstacles(self._obstacles())
            self.warning = ""
        except OctoMotionError as error:
            self.warning = str(error)

    def _moment(self) -> _Moment:
        pose = self.core.pose
        return _Moment(pose, *self.puppet.local(pose))

    def _record_frame(self, frame: float) -> None:
        assert self._recorded is not None
        if self._recorded and frame < max(self._recorded):
            # Playback has come round, or someone has gone back: the take is complete.
            bones, _ = self._write_record()
            self._go_along(self.puppet.armature(), bones)
            self.core.adopt(self.puppet.read())
            return
        self._recorded[frame] = self._moment()
        self.puppet.write(self.core.pose)

    def _apply_settings(self, armature: bpy.types.Object) -> None:
        settings: Any = posing_settings(armature)
        shown = _Shown.of(settings)
        if shown == self._shown:
            return
        before, self._shown = self._shown, shown
        if before.joints != shown.joints:
            self.core.change_elements(self._elements(self.figure))
            self.core.hand = hand_for(self.figure, shown.strength)
        if before.ground != shown.ground:
            self._see_obstacles()
        wanted = self._world_settings()
        self.core.change(
            gravity=wanted.gravity,
            self_collision=wanted.self_collision,
            friction=wanted.friction,
            drag=wanted.drag,
        )
        if before.root != shown.root:
            self._hold_root()

    def _elements(self, figure: Figure) -> Any:
        return elements_for(figure, *self._shown.joints, own=self._materials)

    def _world_settings(self) -> WorldSettings:
        shown = self._shown
        calm = shown.root == "FREE" and not shown.gravity
        return WorldSettings(
            gravity=GRAVITY if shown.gravity else (0.0, 0.0, 0.0),
            self_collision=shown.self_collision,
            friction=shown.friction,
            drag=_CALMING if calm else 0.0,
        )

    def _hold_root(self) -> None:
        pose = self.puppet.armature().pose
        assert pose is not None
        for body, parent in enumerate(self.figure.parents):
            if parent < 0:
                locked = all(np.array(pose.bones[self.bone(body)].lock_location))
                if self._shown.root == "FREE" and not locked:
                    self.core.pin(body, state=False)
                else:
                    self.core.pin(body, state=True, firm=self._shown.root == "HELD")

    def _obstacles(self) -> list[Obstacle]:
        obstacles: list[Obstacle] = []
        if self._shown.floor:
            height = self._shown.floor_height * self.unit
            obstacles.append(Plane(position=np.array([0.0, 0.0, height])))
        armature = self.puppet.found()
        marked = marked_obstacles(self.scene()) if self._shown.use_obstacles else []
        self._marked = bool(marked)
        obstacles += [
            read_obstacle(item, kind, self.unit)
            for item, kind in marked
            if not is_part_of(item, armature)
        ]
        return obstacles
