# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons about a puppet: which bones are limbs, what is solid, how a joint gives way."""

from __future__ import annotations

from functools import partial
from typing import Any, Final, cast

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, FloatVectorProperty, StringProperty

from ...blender.animation import make_pose_asset, writable_armature
from ...blender.rig import (
    Puppet,
    active_armature,
    bone_materials,
    mark_bones,
    read_rig,
    selected_bones,
    set_bone_material,
)
from ...core.errors import OctoMotionError, RigError, WriteError
from ...core.phrases import phrase
from ...core.posing.puppet import Bend, Figure, JointCoefficients
from ..language import reported
from ..operator_base import ArmatureOperator, OctoOperator
from .measuring_hand import BEARS, check_joint, coefficients, measured_joint
from .properties import MOVES, OBSTACLES, STANDS, posing_settings
from .puppet_session import PuppetSession, active_session, counted_bones, counted_objects
from .session_settings import joints_of_now, keep_material


class OCTO_MOTION_OT_pose_asset(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.pose_asset"
    bl_label = "Pose as Asset"
    bl_description = (
        "Put the pose that the armature has now into Blender's pose library, of this file: all of "
        "it, or the selected bones of pose mode. From there it can be applied, blended and mirrored"
    )

    name: StringProperty(
        name="Name",
        description="Of the asset; the armature's and the frame if empty",
        options={"SKIP_SAVE"},
    )

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        pose = armature.pose
        names = selected_bones(armature) if armature.mode == "POSE" else []
        names = names or [each.name for each in (pose.bones if pose is not None else ())]
        frame = context.scene.frame_current
        made = make_pose_asset(armature, names, self.name or f"{armature.name} {frame}")
        if not bpy.app.background:
            # A picture of it, which Blender draws in its own time.
            made.asset_generate_preview()
        told = phrase(
            "'{name}' is in the pose library: {bones}.",
            name=made.name,
            bones=counted_bones(len(names)),
        )
        self.report({"INFO"}, reported(told))


class OCTO_MOTION_OT_pose_mark_bones(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.pose_mark_bones"
    bl_label = "Mark Bones"
    bl_description = (
        "Decide for the selected bones whether they are limbs of the puppet or only follow the "
        "bone they hang on, where it was told wrongly by itself"
    )

    mark: EnumProperty(
        name="Mark",
        description="What the selected bones are",
        items=(
            ("BODY", "Limb", "They can be grabbed and bent", 0),
            ("FOLLOW", "Follows", "They keep their pose and follow their parent", 1),
            ("AUTO", "Automatic", "Names, skin and constraints decide", 2),
        ),
        default="BODY",
    )

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        writable_armature(armature)
        names = selected_bones(armature)
        if not names:
            raise RigError("No bones are selected.", "Select bones in pose mode.")
        data = armature.data
        if data is None or not data.is_editable:
            raise WriteError(
                phrase(
                    "The bones of '{armature}' are linked and read-only.", armature=armature.name
                ),
                "Mark them in the linked file.",
            )
        mark_bones(armature, list(names), "" if self.mark == "AUTO" else self.mark)
        self.report({"INFO"}, reported(phrase("Marked {bones}.", bones=counted_bones(len(names)))))


class OCTO_MOTION_OT_pose_obstacle(OctoOperator, bpy.types.Operator):
    bl_idname = "octo_motion.pose_obstacle"
    bl_label = "Mark Obstacle"
    bl_description = "Let the selected objects stop puppets, as a shape of your choice"

    kind: EnumProperty(
        name="Shape", description="What puppets take them for", items=OBSTACLES, default="BOX"
    )

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:
        return (
            "Go to object mode or pose mode first" if context.mode not in {"OBJECT", "POSE"} else ""
        )

    def run(self, context: bpy.types.Context) -> None:
        chosen = _solid_objects(context)
        for item in chosen:
            own: Any = item
            own.octo_motion.posing.obstacle = self.kind
        self.report(
            {"INFO"}, reported(phrase("Marked {objects}.", objects=counted_objects(len(chosen))))
        )


class OCTO_MOTION_OT_pose_loose(OctoOperator, bpy.types.Operator):
    bl_idname = "octo_motion.pose_loose"
    bl_label = "Let Be Pushed"
    bl_description = (
        "Let puppets push, lift and topple the selected objects while they are posed, or let them "
        "stand still again"
    )

    moves: EnumProperty(
        name="Movement", description="What happens to them", items=MOVES, default="MOVES"
    )
    mass: FloatProperty(
        name="Mass",
        description="How heavy each is to push, kg; 0 takes its volume for wood",
        min=0.0,
        soft_max=1000.0,
    )

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:
        return OCTO_MOTION_OT_pose_obstacle.obstacle(context)

    def run(self, context: bpy.types.Context) -> None:
        chosen = _solid_objects(context)
        for item in chosen:
            own: Any = item
            settings = own.octo_motion.posing
            settings.moves = self.moves
            if self.moves != STANDS:
                settings.mass = self.mass
                if settings.obstacle in {"NONE", "PLANE"}:
                    settings.obstacle = "HULL" if item.type == "MESH" else "BOX"
        self.report(
            {"INFO"}, reported(phrase("Marked {objects}.", objects=counted_objects(len(chosen))))
        )


def _solid_objects(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The selected objects that can be solid.

    Raises:
        RigError: there are none.
        WriteError: one is linked.
    """
    chosen = [each for each in context.selected_objects if each.type != "ARMATURE"]
    if not chosen:
        raise RigError(
            "No object that could be an obstacle is selected.", "Select a mesh or an empty."
        )
    for each in chosen:
        if not each.is_editable:
            raise WriteError(
                phrase("'{each}' is linked and read-only here.", each=each.name),
                "Make a library override.",
            )
    return chosen


# --- Saying how a joint is to give way, and getting the material that does so ---------------------


_InLoads: Final = partial(FloatProperty, min=0.01, max=1000.0, soft_max=10.0)
_Angle: Final = partial(FloatProperty, subtype="ANGLE", min=0.0, max=float(np.pi))
_Seconds: Final = partial(FloatProperty, subtype="TIME_ABSOLUTE", max=60.0)


class OCTO_MOTION_OT_pose_measure(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.pose_measure"
    bl_label = "Measure Joint"
    bl_description = (
        "Say how the joint of the active bone is to give way: so far under this pull, so much of "
        "it to stay. The figure gets the material that does so"
    )

    bone: StringProperty(
        name="Bone", description="The limb whose joint is bent; empty for the active bone"
    )
    pull: _InLoads(
        name="Pull",
        description="How hard it is pulled, in the weight of what hangs on the joint",
        default=2.0,
    )
    seconds: _Seconds(
        name="Time",
        description="How long it is pulled",
        default=0.5,
        min=0.01,
    )
    bends: _Angle(
        name="Bends",
        description="How far the joint is bent at the end of the pull",
        default=float(np.radians(30.0)),
    )
    stays: _Angle(
        name="Stays",
        description="How much of the bend is left afterwards; 0 springs back always",
        default=float(np.radians(20.0)),
    )
    settles: _Seconds(
        name="Settles",
        description="How long springing back takes",
        default=0.05,
        min=0.001,
        precision=3,
    )
    bears: _InLoads(
        name="Bears",
        description="What the joint bears without giving way, in the weight of what hangs on it",
        default=BEARS,
    )
    bone_only: BoolProperty(
        name="This Bone Only",
        description="Let this joint alone be of the material, and the others stay as they are",
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:  # noqa: ARG002
        """For the bone that is active now, whatever it was for before."""
        self.bone = ""
        return self.execute(context)

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        writable_armature(armature)
        settings: Any = posing_settings(armature)
        session = _session_of(armature)
        figure, body = joint_of(context, armature, session, self.bone)
        bend = Bend(self.pull, self.bears, self.seconds, self.bends, self.stays, self.settles)
        measured, material = measured_joint(figure, body, settings.strength, bend)
        bone = figure.names[body] if self.bone_only else ""
        if session is not None:
            session.take_material(material, bone)
        else:
            keep_material(armature, settings, material, bone)
        self.report({"INFO"}, reported(coefficients(figure.names[body], measured)))


_AboutAxes: Final = partial(FloatVectorProperty, size=3, min=0.0, precision=4, subtype="XYZ")
_ABOUT: Final = "about the bone's X, Y (twist) and Z, {}. {}"


class OCTO_MOTION_OT_pose_coefficients(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.pose_coefficients"
    bl_label = "Joint Coefficients"
    bl_description = (
        "Type the coefficients of the active bone's joint, of the three-element model, about each "
        "of its axes. They count for a figure that is 1.5 m across, as every puppet is"
    )

    bone: StringProperty(
        name="Bone", description="The limb whose joint it is; empty for the active bone"
    )
    stiffness: _AboutAxes(
        name="K_f, N·m/rad",
        description="Spring " + _ABOUT.format("N·m/rad", "It springs back what it is bent by"),
        default=(10.0,) * 3,
    )
    damping: _AboutAxes(
        name="D_f, N·m·s/rad",
        description="Damper beside the spring "
        + _ABOUT.format("N·m·s/rad", "Against the spring it is how long springing back takes"),
        default=(0.5,) * 3,
    )
    flow: _AboutAxes(
        name="D_d, N·m·s/rad",
        description="Damper in series "
        + _ABOUT.format("N·m·s/rad", "The smaller, the faster the joint gives way"),
        default=(1.0,) * 3,
        min=1e-6,
    )
    yields: BoolProperty(
        name="Gives Way", description="Keep a bend, instead of springing back always", default=True
    )
    yield_torque: FloatProperty(
        name="Yields at, N·m",
        description="Torque, N·m, that the joint bears without giving way; 0 creeps always",
        default=1.0,
        min=0.0,
        precision=4,
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:  # noqa: ARG002
        """Begin with what the joint of the active bone has now."""
        self.bone = ""
        try:
            armature = active_armature(context)
            session = _session_of(armature)
            figure, body = joint_of(context, armature, session, "")
            if session is not None:
                elements = session.figure.elements
            else:
                settings: Any = posing_settings(armature)
                rig = read_rig(armature, smallest=settings.smallest)
                elements = joints_of_now(Puppet(armature, rig))
        except OctoMotionError as error:
            self.report({"ERROR"}, reported(error))
            return {"CANCELLED"}
        self.bone = figure.names[body]
        for name in ("stiffness", "damping", "flow"):
            setattr(self, name, np.broadcast_to(getattr(elements, name)[body], 3))
        limit = float(elements.yield_torque[body])
        self.yields = bool(np.isfinite(limit))
        self.yield_torque = limit if self.yields else 1.0
        assert context.window_manager is not None
        return cast("set[Any]", context.window_manager.invoke_props_dialog(self))

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        writable_armature(armature)
        session = _session_of(armature)
        figure, body = joint_of(context, armature, session, self.bone)
        check_joint(figure, body)
        stiffness, damping, flow = (
            (each[0], each[1], each[2]) for each in (self.stiffness, self.damping, self.flow)
        )
        limit = self.yield_torque if self.yields else float(np.inf)
        typed = JointCoefficients(stiffness, damping, flow, limit)
        if session is not None:
            session.take_material(typed, figure.names[body])
        else:
            set_bone_material(armature, figure.names[body], typed)
        self.report(
            {"INFO"},
            reported(phrase("{name} has coefficients of its own", name=figure.names[body])),
        )


def joint_of(
    context: bpy.types.Context,
    armature: bpy.types.Object,
    session: PuppetSession | None,
    name: str,
) -> tuple[Figure, int]:
    """A figure and the body of a bone, of the active one without a name.

    Raises:
        RigError: there is none.
    """
    active = context.active_pose_bone
    name = name or (active.name if active is not None else "")
    if not name:
        raise RigError(
            "No bone is active.", "Make the limb active in pose mode, or measure while posing."
        )
    if session is not None:
        return session.figure, session.body(name)
    settings: Any = posing_settings(armature)
    rig = read_rig(armature, smallest=settings.smallest)
    return rig.figure, rig.body(name, armature.name)


class OCTO_MOTION_OT_pose_forget_measured(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.pose_forget_measured"
    bl_label = "Forget Measured Bones"
    bl_description = (
        "Let bones that have a material of their own be of the figure's again: the selected ones "
        "in pose mode, or all"
    )

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        writable_armature(armature)
        own = set(bone_materials(armature))
        if context.mode == "POSE" and (chosen := own & set(selected_bones(armature))):
            own = chosen
        if not own:
            raise RigError("No bone has a material of its own.", "Measure one with This Bone Only.")
        for name in own:
            set_bone_material(armature, name, None)
        session = _session_of(armature)
        if session is not None:
            session.read_materials()
        self.report(
            {"INFO"},
            reported(
                phrase("Of the figure's material again: {bones}.", bones=counted_bones(len(own)))
            ),
        )


def _session_of(armature: bpy.types.Object) -> PuppetSession | None:
    session = active_session()
    return session if session is not None and session.puppet.name == armature.name else None
