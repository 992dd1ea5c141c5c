# SPDX-License-Identifier: GPL-3.0-or-later
"""Add › Curve › Octopus Route: the route of [Octopus] §3.5, given by four control points."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import FloatVectorProperty

from ....blender.scene import add_route_curve, suggested_control_points
from ....core.errors import WriteError
from ....core.locomotion.path import Route
from ...local_view import show_in_local_view
from ...operator_base import OctoOperator
from ...panel_base import armature_in
from ..settings import locomotion_settings

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
    bl_options = {"REGISTER", "UNDO"}

    b0: _control_point("B0", "Start of the route, in world space")
    b1: _control_point("B1", "Handle of the start: the route leaves towards it")
    b2: _control_point("B2", "Handle of the end: the route arrives from it")
    b3: _control_point("B3", "End of the route, in world space")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode not in {"OBJECT", "POSE"}:
            cls.poll_message_set("Leave edit mode first")
            return False
        return True

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
        route = add_route_curve("Octopus Route", points, _collection(context))
        show_in_local_view(context, route)
        if armature is None:
            _make_active(context, route)
        elif not _assign(armature, route):
            self.report({"WARNING"}, f"'{armature.name}' is linked: it keeps its own route.")


def draw_in_add_menu(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """Entry for Add › Curve."""
    layout = self.layout
    assert layout is not None
    layout.operator(OCTO_MOTION_OT_add_route.bl_idname, icon="CURVE_BEZCURVE")


def _collection(context: bpy.types.Context) -> bpy.types.Collection:
    for collection in (context.collection, context.scene.collection):
        if collection is not None and collection.is_editable:
            return collection
    raise WriteError("The scene is linked from another file.", "Work in a scene of this file.")


def _assign(armature: bpy.types.Object, route: bpy.types.Object) -> bool:
    """Make the curve the armature's route; False if the armature cannot be written."""
    if not armature.is_editable:
        return False
    locomotion_settings(armature).route = route
    return True


def _make_active(context: bpy.types.Context, route: bpy.types.Object) -> None:
    """As other Add operators do, where there is no armature to go on with."""
    for each in context.selected_objects:
        each.select_set(state=False)
    route.select_set(state=True)
    context.view_layer.objects.active = route
