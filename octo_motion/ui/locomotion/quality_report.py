# SPDX-License-Identifier: GPL-3.0-or-later
"""How good a generated motion is: the worst of each kind, and a button that goes there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, cast

import bpy
import numpy as np
from bpy.props import CollectionProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ...blender.armature import active_armature
from ...core.errors import SettingsError
from ...core.locomotion.figures import Figure
from .armature_operator import ArmatureOperator

if TYPE_CHECKING:
    from .properties import OCTO_MOTION_PG_locomotion

KINDS: Final = (
    ("SLIP", "Slip", "How far an arm slides over the ground that it holds, in arm lengths", 0),
    ("DEPTH", "Depth", "How far an arm's bones are below the ground, in arm lengths", 1),
    ("STRAIN", "Strain", "By how much a bone is longer or shorter than at rest, as a share", 2),
    ("MISS", "Miss", "How far an arm is from its target or foothold, in arm lengths", 3),
    ("TURN", "Turn", "How far a bone turns from one frame to the next", 4),
    ("OVERLAP", "Overlap", "How deep arms pass through each other or the body, in radii", 5),
)

_NAMES: Final = {kind: name for kind, name, _, _ in KINDS}


def shown(kind: str, value: float) -> str:
    """A figure as people read it."""
    if kind == "TURN":
        return f"{np.degrees(value):.1f}° a frame"
    if kind == "OVERLAP":
        return f"{value:.1f} radii"
    percent = 100.0 * value
    # The aims are hundredths of a percent; of what is large nobody wants to know so much.
    return f"{percent:.2f} %" if percent < 1.0 else f"{percent:.1f} %"


class FigureItem(bpy.types.PropertyGroup):
    """The worst of one kind, as it is kept with the settings."""

    kind: EnumProperty(name="Kind", description="What was measured", items=KINDS)
    value: FloatProperty(
        name="Value",
        description="Slip, depth and miss in arm lengths, strain as a share, turn in radians per "
        "frame, overlap in radii",
        precision=5,
    )
    frame: IntProperty(
        name="Frame", description="Where it is worst; between two frames the first of them"
    )
    arm: StringProperty(name="Arm", description="Of which arm; of an overlap both")


class QualityReport:
    """What ``Object.octo_motion.locomotion`` has of it."""

    figures: CollectionProperty(
        name="Quality",
        description="The worst of each kind in the motion that was generated last",
        type=FigureItem,
    )


def write_figures(settings: OCTO_MOTION_PG_locomotion, found: Sequence[Figure]) -> None:
    """Keep figures with the settings."""
    items = cast("Any", settings).figures
    items.clear()
    for figure in found:
        item = items.add()
        item.name = figure.kind
        item.kind, item.value = figure.kind, figure.value
        item.frame, item.arm = figure.frame, figure.arm


def draw_figures(layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
    """A row for each figure, with a button that goes to its frame."""
    column = layout.column(align=True)
    for item in cast("Any", settings).figures:
        row = column.row(align=True)
        row.label(text=_told(item))
        jump = row.operator(
            OCTO_MOTION_OT_quality_jump.bl_idname, text=f"{item.frame}", icon="TIME"
        )
        jump.kind = item.kind


def _told(item: Any) -> str:
    """A figure, and the arm that it is of."""
    told = f"{_NAMES[item.kind]}: {shown(item.kind, item.value)}"
    return f"{told}, {item.arm}" if item.arm else told


class OCTO_MOTION_OT_quality_jump(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.quality_jump"
    bl_label = "Go to Worst Frame"
    bl_description = "Go to the frame where this is worst"
    # The current frame is no step of undo, here as in Blender's timeline.
    bl_options = {"REGISTER"}

    kind: EnumProperty(name="Kind", description="Which figure", items=KINDS)

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        settings = cast("Any", armature).octo_motion.locomotion
        item = next((each for each in settings.figures if each.kind == self.kind), None)
        if item is None:
            raise SettingsError(
                f"Nothing is known of {_NAMES[self.kind].lower()}.", "Generate a motion first."
            )
        assert context.scene is not None
        context.scene.frame_set(item.frame)
        self.report({"INFO"}, f"{_told(item)}.")


CLASSES: Final = (FigureItem,)
OPERATORS: Final = (OCTO_MOTION_OT_quality_jump,)
