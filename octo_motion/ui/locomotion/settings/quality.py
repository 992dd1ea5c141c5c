# SPDX-License-Identifier: GPL-3.0-or-later
"""How good a generated motion is: the worst of each kind, and a button that goes there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, cast

import bpy
import numpy as np
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)

from ....blender.overrides import linked_names
from ....blender.rig import active_armature
from ....core.errors import RigError, SettingsError
from ....core.locomotion.metrics import TOLD, Figure
from ...armature_operator import ArmatureOperator
from ...override_flags import OVERRIDE, OVERRIDE_LIST

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

_WORDS: Final = 0.7
"""Share of a row that a figure and its arm need beside the button."""
_NAMES: Final = {kind: name for kind, name, _, _ in KINDS}


def shown(kind: str, value: float) -> str:
    """A figure as people read it."""
    if kind == "TURN":
        return f"{np.degrees(value):.1f}°"
    if kind == "OVERLAP":
        return f"{value:.2f} radii"
    percent = 100.0 * value
    # The aims are hundredths of a percent; of what is large nobody wants to know so much.
    return f"{percent:.2f} %" if percent < 1.0 else f"{percent:.1f} %"


class FigureItem(bpy.types.PropertyGroup):
    """The worst of one kind, as it is kept with the settings."""

    kind: EnumProperty(name="Kind", description="What was measured", items=KINDS, override=OVERRIDE)
    value: FloatProperty(
        name="Value",
        description="Slip, depth and miss in arm lengths, strain as a share, turn in radians per "
        "frame, overlap in radii",
        precision=5,
        override=OVERRIDE,
    )
    frame: IntProperty(
        name="Frame",
        description="Where it is worst; between two frames the first of them",
        override=OVERRIDE,
    )
    arm: StringProperty(
        name="Arm", description="Of which arm; of an overlap both", override=OVERRIDE
    )
    known: BoolProperty(
        name="Known",
        description="Whether it was measured in this motion. Off for what a linked file tells of "
        "another one",
        default=True,
        override=OVERRIDE,
    )


class QualityReport:
    """What ``Object.octo_motion.locomotion`` has of it."""

    figures: CollectionProperty(
        name="Quality",
        description="The worst of each kind in the motion that was generated last",
        type=FigureItem,
        override=OVERRIDE_LIST,
    )


def known_figures(settings: OCTO_MOTION_PG_locomotion) -> list[Any]:
    """Items of the figures that were measured, in the order of ``KINDS``."""
    items = cast("Any", settings).figures
    found = {item.kind: item for item in items if item.known}
    return [found[kind] for kind in _NAMES if kind in found]


def write_figures(settings: OCTO_MOTION_PG_locomotion, found: Sequence[Figure]) -> None:
    """Keep figures with the settings.

    What a library override has from its linked file can be changed, but not removed.
    """
    items = cast("Any", settings).figures
    linked = linked_names(settings, "figures")
    for number in reversed(range(len(items))):
        if items[number].name in linked:
            items[number].known = False
        else:
            items.remove(number)
    for figure in found:
        item = items.get(figure.kind)
        if item is None:
            item = items.add()
            item.name = item.kind = figure.kind
        item.value, item.frame, item.arm = figure.value, figure.frame, figure.arm
        item.known = True


def draw_figures(layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
    """A row for each figure, with a button that goes to its frame."""
    column = layout.column(align=True)
    for item in known_figures(settings):
        row = column.split(factor=_WORDS, align=True)
        words = row.row()
        words.alert = item.value > TOLD.get(item.kind, np.inf)
        words.label(text=_told(item))
        jump = row.operator(
            OCTO_MOTION_OT_quality_jump.bl_idname, text=f"{item.frame}", icon="TIME"
        )
        jump.kind = item.kind


def _told(item: Any) -> str:
    """A figure, and the arm that it is of."""
    told = f"{_NAMES[item.kind]}: {shown(item.kind, item.value)}"
    return f"{told}, {item.arm}" if item.arm else told


def _figure(context: bpy.types.Context, kind: str) -> Any:
    """What is known of one kind, None if nothing is."""
    settings = cast("Any", active_armature(context)).octo_motion.locomotion
    return next((each for each in known_figures(settings) if each.kind == kind), None)


class OCTO_MOTION_OT_quality_jump(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.quality_jump"
    bl_label = "Go to Worst Frame"
    bl_description = "Go to the frame where this is worst"
    # The current frame is no step of undo, here as in Blender's timeline.
    bl_options = {"REGISTER"}

    kind: EnumProperty(name="Kind", description="Which figure", items=KINDS)

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        """What the figure means, and all of what the sidebar may be too narrow for."""
        try:
            item = _figure(context, properties.kind)
        except RigError:
            item = None
        if item is None:
            return cls.bl_description
        meaning = next(told for kind, _, told, _ in KINDS if kind == item.kind)
        return f"{meaning}. Go to frame {item.frame}, where it is worst. {_told(item)}"

    def run(self, context: bpy.types.Context) -> None:
        item = _figure(context, self.kind)
        if item is None:
            raise SettingsError(
                f"Nothing is known of {_NAMES[self.kind].lower()}.", "Generate a motion first."
            )
        assert context.scene is not None
        context.scene.frame_set(item.frame)
        self.report({"INFO"}, f"{_told(item)}.")


CLASSES: Final = (FigureItem,)
OPERATORS: Final = (OCTO_MOTION_OT_quality_jump,)
