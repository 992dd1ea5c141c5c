# SPDX-License-Identifier: GPL-3.0-or-later
"""Add › Armature › Octopus: the default rig and its skin, proportions in the redo panel."""

from __future__ import annotations

from typing import Final

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty
from bpy_extras.object_utils import AddObjectHelper, add_object_align_init
from mathutils import Matrix

from ....blender.scene import add_octopus
from ....core.locomotion.octopus import ARMS, JOINTS, OctopusShape
from ...local_view import show_in_local_view
from ...operator_base import OctoOperator

_DEFAULT: Final = OctopusShape()
_FORM: Final = ("arms", "joints", "arm_length", "first_diameter", "taper", "with_mesh")
_PLACE: Final = ("align", "location", "rotation")


class OCTO_MOTION_OT_add_octopus(OctoOperator, AddObjectHelper, bpy.types.Operator):
    bl_idname = "octo_motion.add_octopus"
    bl_label = "Octopus"
    bl_description = (
        "Add an octopus to animate: an armature whose arms mirror by name, facing -Y at the 3D "
        "cursor, with a skin that bends with it"
    )
    bl_options = {"REGISTER", "UNDO"}

    arms: IntProperty(
        name="Arms",
        description=(
            "Number of arms, evenly spread. Pairs count from the front; an odd arm is at the back"
        ),
        default=_DEFAULT.arms,
        min=ARMS[0],
        max=ARMS[1],
        soft_max=16,
    )
    joints: IntProperty(
        name="Joints per Arm",
        description="Number of bones in each arm. More bend more finely and cost more keys",
        default=_DEFAULT.joints,
        min=JOINTS[0],
        max=JOINTS[1],
        soft_max=48,
    )
    arm_length: FloatProperty(
        name="Arm Length",
        description="Length of an arm from its root to its tip",
        subtype="DISTANCE",
        default=_DEFAULT.arm_length,
        min=0.01,
        soft_min=0.1,
        soft_max=10.0,
        precision=3,
        step=1,
    )
    first_diameter: FloatProperty(
        name="First Diameter",
        description="Thickness of an arm at its root. Head and mantle grow with it",
        subtype="DISTANCE",
        default=_DEFAULT.first_diameter,
        min=0.001,
        soft_min=0.01,
        soft_max=1.0,
        precision=3,
        step=1,
    )
    taper: FloatProperty(
        name="Taper",
        description=(
            "How much thinner and shorter the bones get towards the tip: 0 keeps all alike, "
            "1 makes a cone"
        ),
        subtype="FACTOR",
        default=_DEFAULT.taper,
        min=0.0,
        max=1.0,
    )
    with_mesh: BoolProperty(
        name="Mesh",
        description="Add the skin too, weighted to the bones. Without it the armature comes alone",
        default=True,
    )

    def draw(self, context: bpy.types.Context) -> None:  # noqa: ARG002 - Blender's signature
        layout = self.layout
        assert layout is not None
        layout.use_property_split = True
        # What it is first, where it is last, as in Blender's own Add operators.
        for names in (_FORM, _PLACE):
            column = layout.column()
            for name in names:
                column.prop(self, name)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Switch to object mode first")
            return False
        return True

    def run(self, context: bpy.types.Context) -> None:
        shape = OctopusShape(
            arms=self.arms,
            joints=self.joints,
            arm_length=self.arm_length,
            first_diameter=self.first_diameter,
            taper=self.taper,
        )
        armature = add_octopus(context, shape, self._place(context), with_skin=self.with_mesh)
        show_in_local_view(context, armature, *armature.children)

    def _place(self, context: bpy.types.Context) -> Matrix:
        """Where Blender puts new objects; without a 3D view there is none to align them to."""
        if not isinstance(context.space_data, bpy.types.SpaceView3D):
            preferred = context.preferences.edit.object_align
            if self.align == "VIEW":
                self.align = "WORLD"
            if preferred == "VIEW" and not self.properties.is_property_set("rotation"):
                self.rotation = (0.0, 0.0, 0.0)
        return add_object_align_init(context, self)


def draw_in_add_menu(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """Entry for Add › Armature."""
    layout = self.layout
    assert layout is not None
    layout.operator(OCTO_MOTION_OT_add_octopus.bl_idname, icon="OUTLINER_OB_ARMATURE")
