# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of places where the gait changes: added, removed, drawn."""

from __future__ import annotations

from typing import Any, Final, cast

import bpy
from bpy.props import FloatProperty, StringProperty

from ....blender.animation import writable_armature
from ....blender.files import gait_names, has_gait, load_gait
from ...operator_base import ListKind, ListOperator, RemoveOperator
from ...panel_base import ItemRows
from ..settings import OCTO_MOTION_PG_locomotion, locomotion_settings


def _change_settings(armature: bpy.types.Object) -> Any:
    return cast("Any", locomotion_settings(armature)).change


_PLACES: Final = ListKind(
    settings=_change_settings,
    check=writable_armature,
    items="places",
    active="active_place",
    one="a place",
    instead="Set its gait to that of the place before.",
)


class OCTO_MOTION_UL_changes(ItemRows, bpy.types.UIList):
    """A row for each place: where, and which gait from there on."""

    def draw_row(self, layout: bpy.types.UILayout, item: Any) -> None:
        row = layout.row(align=True)
        row.alert = not has_gait(item.gait)
        row.label(text=item.gait, icon="ANIM")
        row.prop(item, "position", text="", emboss=False)


class OCTO_MOTION_OT_change_add(ListOperator, bpy.types.Operator):
    bl_idname = "octo_motion.change_add"
    bl_label = "Add Change of Gait"
    bl_description = "Let another gait go from a place of the route on"
    bl_options = {"REGISTER", "UNDO"}

    KIND = _PLACES

    gait: StringProperty(
        name="Gait",
        description="The gait from there on",
        default="swim",
        search=lambda _operator, _context, _text: gait_names(),
    )
    position: FloatProperty(
        name="Position",
        description="Where along the route: 0 at its start, 1 at its end",
        subtype="FACTOR",
        default=0.5,
        min=0.0,
        max=1.0,
    )

    def edit(
        self,
        context: bpy.types.Context,  # noqa: ARG002
        armature: bpy.types.Object,  # noqa: ARG002
        settings: Any,
    ) -> None:
        load_gait(self.gait)
        item = settings.places.add()
        # Library overrides tell items apart by name.
        taken = {each.name for each in settings.places}
        number = len(settings.places)
        while f"Place {number}" in taken:
            number += 1
        item.name = f"Place {number}"
        item.gait, item.position = self.gait, self.position
        settings.active_place = len(settings.places) - 1
        settings.by = "MARKERS"


class OCTO_MOTION_OT_change_remove(RemoveOperator, bpy.types.Operator):
    bl_idname = "octo_motion.change_remove"
    bl_label = "Remove Change of Gait"
    bl_description = "Let the gait before go on here"

    KIND = _PLACES


def draw_changes(layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
    """What decides, and the list."""
    change = cast("Any", settings).change
    layout.prop(change, "by")
    if change.by == "HEIGHT":
        column = layout.column(align=True)
        column.prop(change, "gait")
        column.prop(change, "height")
        column.prop(change, "length")
    elif change.by == "MARKERS":
        row = layout.row()
        row.template_list(
            *(OCTO_MOTION_UL_changes.__name__, "", change, "places", change, "active_place"),
            rows=3,
        )
        column = row.column(align=True)
        column.operator(OCTO_MOTION_OT_change_add.bl_idname, text="", icon="ADD")
        column.operator(OCTO_MOTION_OT_change_remove.bl_idname, text="", icon="REMOVE")
        if 0 <= change.active_place < len(change.places):
            item = change.places[change.active_place]
            column = layout.column(align=True)
            column.prop(item, "gait")
            column.prop(item, "position")
            column.prop(item, "length")


CLASSES: Final = (
    OCTO_MOTION_UL_changes,
    OCTO_MOTION_OT_change_add,
    OCTO_MOTION_OT_change_remove,
)
