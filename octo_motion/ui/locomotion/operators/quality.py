# SPDX-License-Identifier: GPL-3.0-or-later
"""The worst of each kind in the panel, and a button that goes there."""

from __future__ import annotations

from typing import Any, Final

import bpy
import numpy as np
from bpy.props import EnumProperty

from ....blender.rig import active_armature
from ....core.errors import RigError, SettingsError
from ....core.locomotion.metrics import TOLD
from ....core.phrases import Phrase, as_phrase, phrase
from ...language import hinted, reported, translated
from ...operator_base import ArmatureOperator
from ...panel_base import ArmaturePanel, armature_in
from ..settings import KIND_NAMES, KINDS, known_figures, locomotion_settings

_WORDS: Final = 0.7
"""Share of a row that a figure needs beside the button."""
_MARK: Final = "ERROR"
"""Icon of a figure that is beyond its limit."""


def shown(kind: str, value: float) -> str:
    """A figure as people read it."""
    if kind == "TURN":
        return f"{np.degrees(value):.1f}°"
    if kind == "OVERLAP":
        return phrase("{value:.2f} radii", value=value)
    percent = 100.0 * value
    # The aims are hundredths of a percent; of what is large nobody wants to know so much.
    return f"{percent:.2f} %" if percent < 1.0 else f"{percent:.1f} %"


def _is_seen(item: Any) -> bool:
    """Whether one sees that a figure is too bad."""
    # What is no number is so.
    return not item.value <= TOLD.get(item.kind, np.inf)


def _told(item: Any, *, whose: bool = True) -> Phrase:
    """A figure, and the arm that it is of."""
    kind, value = as_phrase(KIND_NAMES[item.kind]), shown(item.kind, item.value)
    if item.arm and whose:
        return phrase("{kind}: {value}, {arm}", kind=kind, value=value, arm=item.arm)
    return phrase("{kind}: {value}", kind=kind, value=value)


def _figure(context: bpy.types.Context, kind: str) -> Any:
    """What is known of one kind, None if nothing is."""
    figures = known_figures(locomotion_settings(active_armature(context)))
    return next((each for each in figures if each.kind == kind), None)


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
        return hinted(
            phrase(
                "{meaning}. Go to frame {frame}, where it is worst. {told}",
                meaning=as_phrase(meaning),
                frame=item.frame,
                told=_told(item),
            )
        )

    def run(self, context: bpy.types.Context) -> None:
        item = _figure(context, self.kind)
        if item is None:
            raise SettingsError(
                phrase(
                    "Nothing is known of {kind}.", kind=as_phrase(KIND_NAMES[self.kind].lower())
                ),
                "Generate a motion first.",
            )
        assert context.scene is not None
        context.scene.frame_set(item.frame)
        self.report({"INFO"}, reported(phrase("{told}.", told=_told(item))))


class OCTO_MOTION_PT_quality(ArmaturePanel, bpy.types.Panel):
    bl_label = "Quality"
    bl_parent_id = "OCTO_MOTION_PT_generate"
    bl_options = {"DEFAULT_CLOSED"}
    settings_of = staticmethod(locomotion_settings)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        armature = armature_in(context)
        return armature is not None and bool(known_figures(locomotion_settings(armature)))

    def draw_header(self, context: bpy.types.Context) -> None:
        """A mark that shows while the panel is closed, too."""
        armature = armature_in(context)
        figures = known_figures(locomotion_settings(armature)) if armature is not None else ()
        if any(map(_is_seen, figures)):
            assert self.layout is not None
            self.layout.alert = True
            self.layout.label(text="", icon=_MARK)

    def show(self, layout: Any, settings: Any) -> None:
        """A row for each figure, with a button that goes to its frame; what one sees is marked.

        Whose it is stands below where it matters, else in the tooltip: a sidebar is narrow.
        """
        column = layout.column(align=True)
        for item in known_figures(settings):
            seen = _is_seen(item)
            row = column.split(factor=_WORDS, align=True)
            words = row.row()
            words.alert = seen
            told = _told(item, whose=False)
            words.label(text=translated(told), icon=_MARK if seen else "BLANK1")
            jump = row.operator(
                OCTO_MOTION_OT_quality_jump.bl_idname, text=f"{item.frame}", icon="TIME"
            )
            jump.kind = item.kind
            for arm in item.arm.split(", ") if seen and item.arm else ():
                whose = column.row()
                whose.alert = True
                whose.label(text=arm, icon="BLANK1", translate=False)
