# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panels of the tab share, and the rows of their lists."""

from __future__ import annotations

from typing import Any, cast

import bpy

from ..blender.armature import active_armature
from ..core.errors import RigError


def armature_in(context: bpy.types.Context) -> bpy.types.Object | None:
    """The armature that the user works on, see ``active_armature``; ``None`` without."""
    try:
        return active_armature(context)
    except RigError:
        return None


class TabPanel:
    """Where the panels of the tab are."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Octo Motion"


class ArmaturePanel(TabPanel):
    """A panel of the active armature's settings; without an armature it is not there."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return armature_in(context) is not None

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
