# SPDX-License-Identifier: GPL-3.0-or-later
"""Add › Armature › Octopus, the default rig, and Add › Curve › Octopus Route to go along."""

from __future__ import annotations

from functools import partial
from typing import Any, Final, cast

import bpy
import numpy as np
from bpy.props import BoolProperty, FloatProperty, FloatVectorProperty, IntProperty
from bpy_extras.object_utils import AddObjectHelper, add_object_align_init
from mathutils import Matrix

from ....blender.scene import (
    add_octopus,
    add_route_curve,
    own_collection,
    show_selected,
    suggested_control_points,
)
from ....core.errors import WriteError
from ....core.locomotion.octopus import ARMS, JOINTS, WEB, OctopusShape
from ....core.locomotion.path import Route
from ....core.phrases import phrase
from ...language import reported
from ...operator_base import OctoOperator, show_in_local_view
from ...panel_base import armature_in
from ...preferences import begin_as_preferred, preferred_size
from ..settings import locomotion_settings
from .arms import collect_arms, list_arms

_Distance: Final = partial(FloatProperty, subtype="DISTANCE", precision=3, step=1)
_DEFAULT: Final = OctopusShape()
_SHAPE: Final = ("arms", "joints", "arm_length", "first_diameter", "taper")
_LENGTHS: Final = ("arm_length", "first_diameter")
_PLACE: Final = ("align", "location", "rotation")


class OCTO_MOTION_OT_add_octopus(OctoOperator, AddObjectHelper, bpy.types.Operator):
    bl_idname = "octo_motion.add_octopus"
    bl_label = "Octopus"
    bl_description = (
        "Add an octopus to animate: an armature whose arms mirror by name, facing -Y at the 3D "
        "cursor, with a skin that bends with it"
    )

    arms: IntProperty(
        name="Arms",
        description=(
            "Number of arms, evenly spread. Pairs count from the front; an odd arm is in front"
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
    arm_length: _Distance(
        name="Arm Length",
        description="Length of an arm from its root to its tip",
        default=_DEFAULT.arm_length,
        min=0.01,
        soft_min=0.1,
        soft_max=10.0,
    )
    first_diameter: _Distance(
        name="First Diameter",
        description="Thickness of an arm at its root. Head and mantle grow with it",
        default=_DEFAULT.first_diameter,
        min=0.001,
        soft_min=0.01,
        soft_max=1.0,
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
    size: _Distance(
        name="Size",
        description=(
            "Length of an arm; the body grows with it. 0 for what Arm Length and First Diameter "
            "say, as scripts get it"
        ),
        default=0.0,
        min=0.0,
        soft_max=10.0,
        options={"SKIP_SAVE"},
    )
    with_mesh: BoolProperty(
        name="Mesh",
        description="Add the skin too, weighted to the bones. Without it the armature comes alone",
        default=True,
    )
    web: BoolProperty(
        name="Web",
        description=(
            "Stretch a thin web between neighbouring arms, which opens and folds with them. "
            "There is none with one or two arms"
        ),
        default=True,
    )
    web_reach: FloatProperty(
        name="Web Reach",
        description="How far the web reaches along the arms, as a share of their length",
        subtype="FACTOR",
        default=_DEFAULT.web,
        min=WEB[0],
        max=WEB[1],
        soft_min=0.25,
        soft_max=0.6,
    )

    ready: BoolProperty(
        name="Ready to Move",
        description=(
            "Give it a collection of its own, list its arms, and show it as large as the views can"
        ),
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:  # noqa: ARG002
        """Clicked, it is ready to move; a script that says nothing gets the rig alone."""
        self.ready = True
        given = self.properties.is_property_set
        if not any(given(name) for name in ("size", *_LENGTHS)):
            self.size = preferred_size()
        return self.execute(context)

    def draw(self, context: bpy.types.Context) -> None:  # noqa: ARG002 - Blender's signature
        layout = cast("Any", self).layout
        layout.use_property_split = True
        # What it is first, where it is last, as in Blender's own Add operators.
        column = layout.column()
        column.prop(self, "size")
        for name in (*_SHAPE, "with_mesh"):
            if name not in _LENGTHS or not self.size:
                column.prop(self, name)
        if self.with_mesh:
            column.prop(self, "web")
            if self.web:
                column.prop(self, "web_reach")
        column = layout.column()
        for name in _PLACE:
            column.prop(self, name)

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:
        return "" if context.mode == "OBJECT" else "Switch to object mode first"

    def run(self, context: bpy.types.Context) -> None:
        shape = OctopusShape(
            **{name: getattr(self, name) for name in _SHAPE},
            web=self.web_reach if self.web else 0.0,
        )
        if self.size:
            shape = shape.of_arm_length(self.size)
        place = self._place(context)
        armature = add_octopus(context, shape, place, with_skin=self.with_mesh, apart=self.ready)
        show_in_local_view(context, armature, *armature.children)
        if self.ready:
            # What was placed a moment ago counts.
            context.view_layer.update()
            settings = locomotion_settings(armature)
            list_arms(armature, settings)
            collect_arms(armature, settings)
            begin_as_preferred(settings, {"keys": "keys"})
            show_selected(context)

    def _place(self, context: bpy.types.Context) -> Matrix:
        """Where Blender puts new objects; without a 3D view there is none to align them to."""
        if not isinstance(context.space_data, bpy.types.SpaceView3D):
            preferred = context.preferences.edit.object_align
            if self.align == "VIEW":
                self.align = "WORLD"
            if preferred == "VIEW" and not self.properties.is_property_set("rotation"):
                self.rotation = (0.0, 0.0, 0.0)
        return add_object_align_init(context, self)


def draw_octopus_entry(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """Entry for Add › Armature."""
    cast("Any", self).layout.operator(
        OCTO_MOTION_OT_add_octopus.bl_idname, icon="OUTLINER_OB_ARMATURE"
    )


# --- Add › Curve › Octopus Route: the route of [Octopus] §3.5, given by four control points -------


_POINTS = ("b0", "b1", "b2", "b3")


def _control_point(name: str, description: str) -> object:
    return FloatVectorProperty(
        name=name,
        description=f"{description}. Left alone, it suits the active armature",
        subtype="TRANSLATION",
        # The armature decides anew each time.
        options={"SKIP_SAVE"},
    )


class OCTO_MOTION_OT_add_route(OctoOperator, bpy.types.Operator):
    bl_idname = "octo_motion.add_route"
    bl_label = "Octopus Route"
    bl_description = "Add a curve of four control points and make it the armature's route"

    b0: _control_point("B0", "Start of the route, in world space")
    b1: _control_point("B1", "Handle of the start: the route leaves towards it")
    b2: _control_point("B2", "Handle of the end: the route arrives from it")
    b3: _control_point("B3", "End of the route, in world space")

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:
        return "" if context.mode in {"OBJECT", "POSE"} else "Leave edit mode first"

    def run(self, context: bpy.types.Context) -> None:
        active = context.object
        # Beside a route that is there, a curve is one more: whoever goes along that one goes on.
        is_curve = active is not None and active.type == "CURVE"
        armature = None if is_curve else armature_in(context)
        suggested = suggested_control_points(armature, context)
        for name, point in zip(_POINTS, suggested, strict=True):
            if not self.properties.is_property_set(name):
                setattr(self, name, point)
        points = np.array([getattr(self, name) for name in _POINTS])
        # Raises, before anything is made, if they lead nowhere.
        Route.bezier(points[None])
        route = add_route_curve("Octopus Route", points, _collection(context, armature))
        show_in_local_view(context, route)
        if armature is None:
            # As other Add operators do, where there is no armature to go on with.
            for each in context.selected_objects:
                each.select_set(state=False)
            route.select_set(state=True)
            context.view_layer.objects.active = route
        elif armature.is_editable:
            locomotion_settings(armature).route = route
        else:
            self.report(
                {"WARNING"},
                reported(
                    phrase(
                        "'{armature}' is linked: it keeps its own route.", armature=armature.name
                    )
                ),
            )


def draw_route_entry(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """Entry for Add › Curve."""
    cast("Any", self).layout.operator(OCTO_MOTION_OT_add_route.bl_idname, icon="CURVE_BEZCURVE")


def _collection(
    context: bpy.types.Context, armature: bpy.types.Object | None
) -> bpy.types.Collection:
    own = own_collection(armature) if armature is not None else None
    for collection in (own, context.collection, context.scene.collection):
        if collection is not None and collection.is_editable:
            return collection
    raise WriteError("The scene is linked from another file.", "Work in a scene of this file.")
