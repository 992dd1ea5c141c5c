# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators on gait tables: presets, files, knots and curves of single pairs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Final, cast

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from ....blender.animation import writable_armature
from ....blender.files import (
    SUFFIX,
    gait_names,
    read_gait_file,
    remove_gait,
    save_gait,
    user_gait_names,
    write_gait,
)
from ....blender.rig import active_armature
from ....core.errors import GaitError
from ....core.locomotion.gait import CYCLE, GaitCurve, renamed_gait
from ....core.phrases import phrase
from ...language import reported, translated
from ...operator_base import ArmatureOperator, FileOperator, window_manager
from ...panel_base import ArmaturePanel, ItemRows, draw_list
from ..settings import (
    SIDES,
    OCTO_MOTION_PG_gait_curve,
    OCTO_MOTION_PG_gait_table,
    OCTO_MOTION_PG_locomotion,
    fill_curve,
    fill_gait_table,
    fill_offsets,
    fill_table,
    locomotion_settings,
    read_gait,
    set_gait,
    used,
)


def _writable(context: bpy.types.Context) -> OCTO_MOTION_PG_locomotion:
    """Settings that can be written."""
    armature = active_armature(context)
    writable_armature(armature)
    return locomotion_settings(armature)


class _GaitOperator(ArmatureOperator):
    """An operator on the gait of an armature whose settings can be written."""

    def run(self, context: bpy.types.Context) -> None:
        self.edit(_writable(context))

    def edit(self, settings: OCTO_MOTION_PG_locomotion) -> None:
        raise NotImplementedError


def _editable_table(settings: OCTO_MOTION_PG_locomotion) -> Any:
    """The table, filled from its preset if it was not yet."""
    if not used(settings.table.curves):
        set_gait(settings, read_gait(settings))
    return settings.table


def _editable_curve(settings: OCTO_MOTION_PG_locomotion, pair: int) -> Any:
    """The table's item with the angles of a pair."""
    listed = used(_editable_table(settings).curves)
    return next(curve for curve in listed if curve.pair == pair)


def _row(name: str, description: str) -> Any:
    return IntProperty(
        name=name, description=description, default=-1, min=-1, options={"SKIP_SAVE"}
    )


def _active(collection: Any, index: int, what: str) -> Any:
    if not 0 <= index < len(collection):
        raise GaitError(
            phrase("No {what} is chosen.", what=what),
            phrase("Choose one, or add one."),
        )
    return collection[index]


def _chosen_curve(settings: OCTO_MOTION_PG_locomotion) -> tuple[int, GaitCurve]:
    """The pair that is chosen in the list, 0 for all, and its angles."""
    pair = 0
    if listed := used(settings.table.curves):
        pair = _active(listed, settings.table.active_curve, "pair").pair
    return pair, read_gait(settings).curves[pair]


# --- Presets -------------------------------------------------------------------------------------


class OCTO_MOTION_OT_gait_load(_GaitOperator, bpy.types.Operator):
    bl_idname = "octo_motion.gait_load"
    bl_label = "Load Gait"
    bl_description = "Load a gait into the table, in place of what is there"

    name: StringProperty(
        name="Name",
        description="Gait to load; without a name the current one is loaded afresh",
        search=lambda _operator, _context, _text: gait_names(),
        options={"SKIP_SAVE"},
    )

    def edit(self, settings: OCTO_MOTION_PG_locomotion) -> None:
        fill_gait_table(settings, self.name or settings.gait)


class OCTO_MOTION_OT_gait_save(_GaitOperator, bpy.types.Operator):
    bl_idname = "octo_motion.gait_save"
    bl_label = "Save Gait as Preset"
    bl_description = "Keep the table among your own gaits, for this and all other files"

    name: StringProperty(
        name="Name", description="What the gait is called from now on", options={"SKIP_SAVE"}
    )
    overwrite: BoolProperty(
        name="Overwrite",
        description="Replace a gait of yours that has this name",
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:  # noqa: ARG002
        current = locomotion_settings(active_armature(context)).gait
        own = current in user_gait_names()
        self.name = current if own else f"my {current}"
        self.overwrite = own
        return window_manager(context).invoke_props_dialog(self)

    def edit(self, settings: OCTO_MOTION_PG_locomotion) -> None:
        table = renamed_gait(read_gait(settings), self.name.strip())
        save_gait(table, overwrite=self.overwrite)
        set_gait(settings, table)
        self.report({"INFO"}, reported(phrase("Saved the gait '{table}'.", table=table.name)))


class OCTO_MOTION_OT_gait_remove(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.gait_remove"
    bl_label = "Remove Gait Preset"
    bl_description = (
        "Delete a gait of yours from disk, for all files. The table keeps what is loaded"
    )
    # A deleted file does not come back with undo; the settings stay as they are.
    bl_options = {"REGISTER"}

    name: StringProperty(
        name="Name",
        description="Gait to delete; without a name the current one",
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:
        return window_manager(context).invoke_confirm(self, event)

    def run(self, context: bpy.types.Context) -> None:
        name = self.name or _writable(context).gait
        remove_gait(name)
        self.report({"INFO"}, reported(phrase("Removed the gait '{name}'.", name=name)))


class _GaitFile(FileOperator):
    """Asks for a gait's file."""

    filename_ext: Final = SUFFIX

    filepath: StringProperty(
        name="File",
        description="The gait's file (JSON)",
        subtype="FILE_PATH",
        options={"SKIP_SAVE", "PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    filter_glob: StringProperty(default=f"*{SUFFIX}", options={"HIDDEN"})

    def _path(self) -> Path:
        if not self.filepath:
            raise GaitError("No file is given.", "Choose one.")
        return Path(bpy.path.abspath(self.filepath))


class OCTO_MOTION_OT_gait_export(_GaitFile, ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.gait_export"
    bl_label = "Export Gait"
    bl_description = "Write the table to a JSON file, to hand it on or to edit it as text"
    # A file that was written stays when something else is undone.
    bl_options = {"REGISTER"}

    check_existing: BoolProperty(default=True, options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:  # noqa: ARG002
        """Propose the gait's name, in the file browser."""
        if not self.filepath:
            name = bpy.path.clean_name(locomotion_settings(active_armature(context)).gait)
            self.filepath = f"{name}{SUFFIX}"
        return self.browse(context)

    def check(self, context: bpy.types.Context) -> bool:  # noqa: ARG002
        proper = bpy.path.ensure_ext(self.filepath, SUFFIX)
        if proper == self.filepath:
            return False
        self.filepath = proper
        return True

    def run(self, context: bpy.types.Context) -> None:
        # Of a linked armature as well.
        table = read_gait(locomotion_settings(active_armature(context)))
        path = self._path()
        write_gait(table, path)
        self.report(
            {"INFO"},
            reported(
                phrase("Wrote the gait '{table}' to '{path}'.", table=table.name, path=path.name)
            ),
        )


class OCTO_MOTION_OT_gait_import(_GaitFile, _GaitOperator, bpy.types.Operator):
    bl_idname = "octo_motion.gait_import"
    bl_label = "Import Gait"
    bl_description = "Load the table from a JSON file"

    def edit(self, settings: OCTO_MOTION_PG_locomotion) -> None:
        set_gait(settings, read_gait_file(self._path()))


# --- The table -----------------------------------------------------------------------------------


class OCTO_MOTION_OT_gait_curve_add(_GaitOperator, bpy.types.Operator):
    bl_idname = "octo_motion.gait_curve_add"
    bl_label = "Add Pair"
    bl_description = "Give one pair of arms angles of its own, to begin with those it has now"

    pair: IntProperty(
        name="Pair",
        description="Pair of arms, 1 in front; 0 takes the first that has none of its own",
        min=0,
        options={"SKIP_SAVE"},
    )

    def edit(self, settings: OCTO_MOTION_PG_locomotion) -> None:
        table = read_gait(settings)
        taken = set(table.curves)
        pair = self.pair or next(each for each in range(1, len(taken) + 2) if each not in taken)
        if pair in taken:
            raise GaitError(
                phrase("Pair {pair} has angles of its own already.", pair=pair),
                "Choose another pair.",
            )
        curves = {**table.curves, pair: table.curves[0]}
        fill_table(_editable_table(settings), replace(table, curves=curves))
        settings.table.active_curve = sorted(curves).index(pair)


class OCTO_MOTION_OT_gait_curve_remove(_GaitOperator, bpy.types.Operator):
    bl_idname = "octo_motion.gait_curve_remove"
    bl_label = "Remove Pair"
    bl_description = "Let the chosen pair move like all others again"

    def edit(self, settings: OCTO_MOTION_PG_locomotion) -> None:
        table, group = read_gait(settings), settings.table
        pair = _active(used(group.curves), group.active_curve, "pair").pair
        if pair == 0:
            raise GaitError("The angles for all arms cannot be removed.", "Choose a pair.")
        before = group.active_curve
        curves = {each: curve for each, curve in table.curves.items() if each != pair}
        fill_table(group, replace(table, curves=curves))
        group.active_curve = before - 1


class OCTO_MOTION_OT_gait_knot_add(_GaitOperator, bpy.types.Operator):
    bl_idname = "octo_motion.gait_knot_add"
    bl_label = "Add Knot"
    bl_description = "Add a knot half-way to the next one, without changing the motion"

    knot: _row("Knot", "Row after which the knot is added, counted from 0; -1 fills the widest gap")

    def edit(self, settings: OCTO_MOTION_PG_locomotion) -> None:
        pair, shape = _chosen_curve(settings)
        # As they are listed, which need not be in order.
        listed = used(settings.table.curves)
        phases = shape.phases[:-1].tolist()
        if listed:
            phases = [each.phase for each in used(listed[settings.table.active_curve].knots)]
        if self.knot >= len(phases):
            raise GaitError(
                phrase("There is no row {knot}.", knot=self.knot), "Choose a knot of the table."
            )
        if self.knot < 0:
            gap = int(np.argmax(np.diff(shape.phases)))
        else:
            phase = phases[self.knot] % CYCLE
            gap = int(np.clip(np.searchsorted(shape.phases, phase + 1e-4) - 1, 0, None))
            gap = min(gap, len(shape.phases) - 2)
        middle = 0.5 * (shape.phases[gap] + shape.phases[gap + 1])
        if shape.phases[gap + 1] - shape.phases[gap] < np.radians(1.0):
            raise GaitError("There is no room for a knot.", "Move the next knot further away.")
        angles = shape.evaluate(np.array([middle]))[0]
        curve = _editable_curve(settings, pair)
        # Sorted, and with a knot at 0 if there was none: the same motion, in good order.
        fill_curve(
            curve,
            GaitCurve(
                np.insert(shape.phases, gap + 1, middle),
                np.insert(shape.angles, gap + 1, angles, axis=0),
                free=shape.free,
            ),
        )
        curve.active_knot = gap + 1


class OCTO_MOTION_OT_gait_knot_remove(_GaitOperator, bpy.types.Operator):
    bl_idname = "octo_motion.gait_knot_remove"
    bl_label = "Remove Knot"
    bl_description = "Remove this knot: the angles then run evenly between its neighbours"

    knot: _row("Knot", "Row to remove, counted from 0; -1 takes the last")

    def edit(self, settings: OCTO_MOTION_PG_locomotion) -> None:
        pair, shape = _chosen_curve(settings)
        count = len(shape.phases) - 1
        knot = self.knot if self.knot >= 0 else count - 1
        if knot >= count:
            raise GaitError(
                phrase("There is no row {knot}.", knot=knot), "Choose a knot of the table."
            )
        if knot == 0:
            raise GaitError("A cycle cannot do without its first knot.", "Change its angles.")
        shape = GaitCurve(
            np.delete(shape.phases, knot), np.delete(shape.angles, knot, axis=0), free=shape.free
        )
        fill_curve(_editable_curve(settings, pair), shape)


class OCTO_MOTION_OT_gait_offset_add(_GaitOperator, bpy.types.Operator):
    bl_idname = "octo_motion.gait_offset_add"
    bl_label = "Add Offset"
    bl_description = "Give one arm a phase of its own, whatever the spread says"

    pair: IntProperty(name="Pair", description="Pair of the arm, 1 in front", min=1, default=1)
    side: EnumProperty(name="Side", description="Side of the arm", items=SIDES)

    def edit(self, settings: OCTO_MOTION_PG_locomotion) -> None:
        table = read_gait(settings)
        if (self.pair, self.side) in table.offsets:
            raise GaitError(
                phrase(
                    "Pair {pair} {side} has an offset already.",
                    pair=self.pair,
                    side=self.side.lower(),
                ),
                "Change that one, or choose another arm.",
            )
        offsets = {**table.offsets, (self.pair, self.side): 0.0}
        fill_offsets(_editable_table(settings), offsets)
        settings.table.active_offset = sorted(offsets).index((self.pair, self.side))


class OCTO_MOTION_OT_gait_offset_remove(_GaitOperator, bpy.types.Operator):
    bl_idname = "octo_motion.gait_offset_remove"
    bl_label = "Remove Offset"
    bl_description = "Let this arm follow the spread again"

    offset: _row("Offset", "Row to remove, counted from 0; -1 takes the last")

    def edit(self, settings: OCTO_MOTION_PG_locomotion) -> None:
        offsets = sorted(read_gait(settings).offsets.items())
        number = self.offset if self.offset >= 0 else len(offsets) - 1
        _active(offsets, number, "offset")
        del offsets[number]
        fill_offsets(_editable_table(settings), dict(offsets))


class OCTO_MOTION_MT_gait_offset(bpy.types.Menu):
    bl_label = "Add Offset"
    bl_description = "Give one arm a phase of its own, whatever the spread says"

    def draw(self, context: bpy.types.Context | None) -> None:
        layout = cast("Any", self).layout
        settings = locomotion_settings(active_armature(cast("bpy.types.Context", context)))
        taken = {(each.pair, each.side) for each in used(settings.table.offsets)}
        for pair, side, name in sorted({(arm.pair, arm.side, arm.name) for arm in settings.arms}):
            if (pair, side) not in taken:
                chosen = layout.operator(OCTO_MOTION_OT_gait_offset_add.bl_idname, text=name)
                chosen.pair, chosen.side = pair, side
        if not settings.arms:
            layout.label(text="Detect the arms first", icon="INFO")


class OCTO_MOTION_MT_gaits(bpy.types.Menu):
    bl_label = "Gaits"
    bl_description = "Load another gait into the table"

    def draw(self, context: bpy.types.Context | None) -> None:  # noqa: ARG002
        layout = cast("Any", self).layout
        for name in gait_names():
            button = layout.operator(
                OCTO_MOTION_OT_gait_load.bl_idname, text=bpy.path.display_name(name)
            )
            button.name = name


class OCTO_MOTION_MT_gait(bpy.types.Menu):
    bl_label = "Gait"
    bl_description = "Load, save, import and export gaits"

    def draw(self, context: bpy.types.Context | None) -> None:  # noqa: ARG002
        layout = cast("Any", self).layout
        layout.operator(OCTO_MOTION_OT_gait_load.bl_idname, text="Reload", icon="FILE_REFRESH")
        layout.separator()
        layout.operator(OCTO_MOTION_OT_gait_save.bl_idname, text="Save as Preset…", icon="ADD")
        layout.operator(OCTO_MOTION_OT_gait_remove.bl_idname, text="Remove Preset", icon="REMOVE")
        layout.separator()
        layout.operator(OCTO_MOTION_OT_gait_import.bl_idname, text="Import…", icon="IMPORT")
        layout.operator(OCTO_MOTION_OT_gait_export.bl_idname, text="Export…", icon="EXPORT")


# --- The table drawn ------------------------------------------------------------------------------


_SIDE_LETTERS: Final = {"LEFT": "L", "RIGHT": "R", "CENTER": ""}


class OCTO_MOTION_PT_table(ArmaturePanel, bpy.types.Panel):
    bl_label = "Table"
    bl_parent_id = "OCTO_MOTION_PT_gait"
    bl_options = {"DEFAULT_CLOSED"}
    settings_of = staticmethod(locomotion_settings)

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        table = settings.table
        layout.prop(settings, "show_targets")
        layout.row().prop(table, "manner", expand=True)
        if table.manner == "SWIM":
            layout.prop(table, "power_phase")
        column = layout.column(align=True)
        column.prop(table, "spread_pairs", text="Spread Pairs")
        column.prop(table, "spread_sides")
        _draw_offsets(layout, table)
        curves = used(table.curves)
        if not curves:
            layout.operator(
                OCTO_MOTION_OT_gait_load.bl_idname, text="Edit Angles", icon="GREASEPENCIL"
            )
            return
        buttons = OCTO_MOTION_OT_gait_curve_add, OCTO_MOTION_OT_gait_curve_remove
        names = "curves", "active_curve"
        draw_list(layout, OCTO_MOTION_UL_gait_curves, table, names, buttons, rows=2)
        if 0 <= table.active_curve < len(curves):
            _draw_knots(layout, table, curves[table.active_curve])


def _draw_offsets(layout: Any, table: OCTO_MOTION_PG_gait_table) -> None:
    column = layout.column(align=True)
    for number, offset in enumerate(used(table.offsets)):
        row = column.row(align=True)
        row.prop(
            offset,
            "phase",
            text=translated(
                phrase(
                    "Arm {pair} {side_letter}",
                    pair=offset.pair,
                    side_letter=_SIDE_LETTERS[offset.side],
                )
            ),
        )
        remove = row.operator(
            OCTO_MOTION_OT_gait_offset_remove.bl_idname, text="", icon="X", emboss=False
        )
        remove.offset = number
    layout.menu(OCTO_MOTION_MT_gait_offset.__name__, icon="ADD")


def _draw_knots(
    layout: Any, table: OCTO_MOTION_PG_gait_table, curve: OCTO_MOTION_PG_gait_curve
) -> None:
    layout.use_property_split = False
    layout.row().prop(table, "shown_angle", expand=True)
    angle = table.shown_angle.lower()
    column = layout.column(align=True)
    row = column.row(align=True)
    for title in (phrase("Phase"), phrase("Root"), phrase("Middle"), phrase("Tip")):
        row.label(text=translated(title))
    row.label(text="", icon="BLANK1")
    for number, knot in enumerate(used(curve.knots)):
        row = column.row(align=True)
        row.prop(knot, "phase", text="")
        for link in range(3):
            row.prop(knot, angle, index=link, text="")
        remove = row.operator(
            OCTO_MOTION_OT_gait_knot_remove.bl_idname, text="", icon="X", emboss=False
        )
        remove.knot = number
    layout.operator(OCTO_MOTION_OT_gait_knot_add.bl_idname, icon="ADD")
    if table.manner != "SWIM":
        layout.prop(curve, "free")


class OCTO_MOTION_UL_gait_curves(ItemRows, bpy.types.UIList):
    """A row for the angles of all arms, and one for each pair that has its own."""

    def draw_row(self, layout: bpy.types.UILayout, item: Any) -> None:
        if item.unused:
            layout.active = False
            layout.label(text="Unused, of the linked file")
        elif item.pair == 0:
            layout.label(text="All Arms", icon="FCURVE")
        else:
            row = layout.row()
            row.label(text="Only Pair", icon="FCURVE")
            row.prop(item, "pair", text="", emboss=False)
