# SPDX-License-Identifier: GPL-3.0-or-later
"""A simulated puppet in Blender's world and units; the puppet's own metres stay inside."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import bpy
import numpy as np

from ...blender.rig import Puppet, read_rig
from ...core.errors import OctoMotionError, RigError
from ...core.posing.picking import Hit, pick
from ...core.posing.puppet import Elements, Figure, Material, Pose, capsules_in_world, joint_loads
from ...core.posing.session import Session, hand_for
from ...core.posing.solver import HandSpring
from ...core.rotations import Floats
from .custom_material import coefficients, measured_joint
from .measuring_hand import MeasuringHand
from .properties import posing_settings
from .session_settings import GRAVITY, BoneMaterials, SessionSettings


class PosedPuppet:
    """An armature's puppet that is simulated as the panel's settings say.

    Args:
        armature: the armature object.
        scene: whose obstacles count.
        clock: as of ``Session``.

    Raises:
        OctoMotionError: it cannot be posed.
    """

    def __init__(
        self,
        armature: bpy.types.Object,
        scene: bpy.types.Scene,
        clock: Callable[[], float] | None,
    ) -> None:
        panel: Any = posing_settings(armature)
        self.puppet = Puppet(armature, read_rig(armature, smallest=panel.smallest))
        self.settings = SessionSettings.of(armature)
        self.materials = BoneMaterials(self.puppet)
        self.measuring: MeasuringHand | None = None
        self.warning = ""
        """What is wrong with the scene, and keeps nobody from posing."""
        self._scene = scene.session_uid
        figure = self.puppet.figure
        self.core = Session(
            replace(figure, elements=self.settings.elements(figure, self.materials.by_body)),
            self.puppet.rig.pose,
            self.settings.world_settings(),
            self.settings.obstacles(self.puppet, scene),
            clock=clock,
        )
        self.core.coupling = hand_for(figure, self.settings.strength)
        self._weights = joint_loads(figure)
        self.settings.hold_root(self.puppet, self.core)

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
        """The puppet."""
        return self.core.figure

    @property
    def shown_pose(self) -> Pose:
        """Where the bodies are, with the joint bent that is being measured."""
        return self.core.pose if self.measuring is None else self.measuring.pose()

    @property
    def held(self) -> HandSpring | None:
        """What the hand holds, if it holds anything."""
        return self.core.held

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

    @property
    def size(self) -> float:
        """The largest extent of the puppet as it stands, in units of the world."""
        return float(np.ptp(self.capsules()[0].reshape(-1, 3), axis=0).max())

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

    @property
    def root_is_held(self) -> bool:
        """Whether the root neither moves nor turns."""
        return self.settings.root == "HELD"

    def pins(self) -> list[int]:
        """Bodies that the artist has nailed to their places, or that are by the settings."""
        return sorted(self.core.pins)

    def toggle_pin(self, body: int) -> str:
        """Nail a body to its place or take the nail out; what was done, in words."""
        state = body not in self.core.pins
        self.core.pin(body, state=state)
        return f"{self.bone(body)} {'pinned' if state else 'free again'}"

    def pick(self, origin: Floats, direction: Floats, *, margin: float = 0.0) -> Hit | None:
        """The body that a ray of the world meets; the hit's point is in the puppet's metres."""
        return pick(self.figure, self.shown_pose, origin * self.unit, direction, margin=margin)

    def point_on(self, bone: str, share: float) -> tuple[int, Floats]:
        """The body of a bone, and the point (3,) at a share of its length, puppet metres.

        Raises:
            RigError: there is no such bone.
        """
        body = self.body(bone)
        start, end = capsules_in_world(self.figure, self.core.pose)[body]
        # Capsules end a radius before the limb does.
        way = end - start
        size = float(np.linalg.norm(way))
        radius = self.figure.radii[body] * (way / size if size > 0.0 else way)
        point = (start - radius) + share * (way + 2.0 * radius) if size > 1e-9 else start
        return body, point

    # --- Settings -------------------------------------------------------------------------------

    def apply_settings(self, armature: bpy.types.Object) -> None:
        """Take what was changed in the panel."""
        settings = SessionSettings.of(armature)
        if settings == self.settings:
            return
        before, self.settings = self.settings, settings
        if before.joints != settings.joints:
            self.core.change_elements(self._elements())
            self.core.coupling = hand_for(self.figure, settings.strength)
        if before.ground != settings.ground:
            self.see_obstacles()
        self.core.change(**settings.world)
        if before.root != settings.root:
            settings.hold_root(self.puppet, self.core)

    def see_obstacles(self) -> None:
        """Take obstacles as they are now; with one that is damaged, they stay as they were."""
        try:
            self.core.change_obstacles(self.settings.obstacles(self.puppet, self.scene()))
            self.warning = ""
        except OctoMotionError as error:
            self.warning = str(error)

    # --- Measuring ------------------------------------------------------------------------------

    def measure(self, body: int) -> None:
        """From now on the hand shows how the joint of a limb is to bend, and nothing resists.

        Raises:
            RigError: the limb has no joint.
        """
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
        measured, material = measured_joint(self.figure, body, self.settings.strength, bend)
        self.take_material(material, self.bone(body) if bone_only else "")
        self.drop_measure()
        return coefficients(self.bone(body), measured)

    def take_material(self, material: Material, bone: str) -> None:
        """Let the figure, or one bone's joint, be of a material; taken back by ``cancel``.

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
        return self.settings.elements(self.figure, self.materials.by_body)
