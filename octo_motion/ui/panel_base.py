# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panels of the tab share, and the rows of their lists."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, ClassVar, Final, cast
from unicodedata import east_asian_width

import bpy

from ..blender.rig import active_armature
from ..core.errors import RigError
from .language import OWN, translated
from .manual import draw_manual_button
from .tool import tool_of

_CHARACTER: Final = 6.5
"""Pixels that a letter of Blender's own font takes on the average, …"""
_MARGIN: Final = 80.0
"""… and that margins, tabs and the icon take from a sidebar's width."""
_USUAL_WIDTH: Final = 280.0
_FEWEST: Final = 16
"""Letters in a line, however narrow the sidebar."""
_UNBROKEN: Final = re.compile(
    r"[\u3001-\u9fff\uff00-\uffef](?:[\u30fc\u3041\u3043\u3045\u3047\u3049\u3063\u3083\u3085\u3087"
    r"\u30a1\u30a3\u30a5\u30a7\u30a9\u30c3\u30e3\u30e5\u30e7]|[\u3001\u3002\u300d\uff09\uff1a])*"
    r"|[^\s\u3001-\u9fff\uff00-\uffef]+\s*|\s+"
)
"""Words with what follows them, and Japanese letters with those that must not begin a line."""


def armature_in(context: bpy.types.Context) -> bpy.types.Object | None:
    """The armature that the user works on, see ``active_armature``; ``None`` without."""
    try:
        return active_armature(context)
    except RigError:
        return None


def draw_sentence(layout: Any, context: bpy.types.Context, text: str, icon: str) -> None:
    """A sentence in as many lines as the sidebar needs for it: Blender would cut it off."""
    region, preferences = context.region, context.preferences
    scale = preferences.system.ui_scale if preferences is not None else 1.0
    width = region.width / scale if region is not None else _USUAL_WIDTH
    characters = max(int((width - _MARGIN) / _CHARACTER), _FEWEST)
    column = layout.column(align=True)
    for number, line in enumerate(lines_of(translated(text), characters)):
        column.label(text=line, icon="BLANK1" if number else icon, translate=False)


def lines_of(text: str, characters: int) -> list[str]:
    """A text in lines of so many letters at most. Japanese ones take the room of two, and a line
    may end between them, but for what must not begin one.
    """
    lines, room = [""], 0
    for part in _UNBROKEN.findall(text):
        size = sum(2 if east_asian_width(each) in "WF" else 1 for each in part.rstrip())
        if room + size > characters and lines[-1]:
            lines.append("")
            room = 0
        lines[-1] += part
        room += size + len(part) - len(part.rstrip())
    return [line.rstrip() for line in lines]


def draw_live_error(layout: Any, settings: Any) -> None:
    """Why what is live does not follow at the moment, if that is so."""
    if settings.live_error:
        row = layout.row()
        row.alert = True
        draw_sentence(row, bpy.context, settings.live_error, "ERROR")


def draw_list(
    layout: Any,
    row_type: type,
    settings: Any,
    names: tuple[str, str],
    buttons: Sequence[Any],
    **size: int,
) -> Any:
    """A list with its buttons; the column of the buttons, for more.

    The names are those of the list in its settings, and of the number of its active item; the
    buttons operators that add, that remove, and, if there is one, that move; the size how many rows
    it shows.
    """
    items, active = names
    row = layout.row()
    row.template_list(row_type.__name__, "", settings, items, settings, active, **size)
    column = row.column(align=True)
    for operator, icon in zip(buttons, ("ADD", "REMOVE"), strict=False):
        column.operator(operator.bl_idname, text="", icon=icon)
    for operator in buttons[2:]:
        column.separator()
        for direction in ("UP", "DOWN"):
            button = column.operator(operator.bl_idname, text="", icon=f"TRIA_{direction}")
            button.direction = direction
    return column


class TabPanel:
    """Where the panels of the tab are."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Octo Motion"
    bl_translation_context = OWN

    def draw_header_preset(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        """Blender's place at the right of a panel's header."""
        draw_manual_button(cast("Any", self).layout, type(self))


class ArmaturePanel(TabPanel):
    """A panel of the active armature's settings; without an armature it is not there, nor where
    another tool is shown than the one that it belongs to.
    """

    tool: ClassVar[str] = ""
    """Identifier of that tool; none for all of them."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        armature = armature_in(context)
        return armature is not None and cls.tool in {"", tool_of(armature)}

    def draw(self, context: bpy.types.Context) -> None:
        armature = armature_in(context)
        assert armature is not None
        layout = cast("Any", self).layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        # Greyed out where nothing that is set would be saved.
        layout.enabled = armature.is_editable
        self.show(layout, self.settings_of(armature))

    @staticmethod
    def settings_of(armature: bpy.types.Object) -> Any:
        """Which of the armature's settings the panel is about."""
        raise NotImplementedError

    def show(self, layout: Any, settings: Any) -> None:
        """Draw the panel."""
        raise NotImplementedError


class ItemRows:
    """Mix-in for lists: write ``draw_row``."""

    def draw_item(  # noqa: PLR0917 - Blender's order
        self,
        context: bpy.types.Context | None,  # noqa: ARG002
        layout: bpy.types.UILayout,
        data: Any,  # noqa: ARG002
        item: Any,
        icon: int | None,  # noqa: ARG002
        active_data: Any,  # noqa: ARG002
        active_property: str | None,  # noqa: ARG002
        index: int | None = 0,  # noqa: ARG002
        flt_flag: int | None = 0,  # noqa: ARG002
    ) -> None:
        """Blender's entry point."""
        self.draw_row(layout, item)

    def draw_row(self, layout: bpy.types.UILayout, item: Any) -> None:
        """Draw the row of one item."""
        raise NotImplementedError
