# SPDX-License-Identifier: GPL-3.0-or-later
"""A solid floor through the scene: its settings, and its row in a panel."""

from __future__ import annotations

from typing import Any

from . import declared_settings as props


class Floor:
    """What a group of properties has that knows a floor."""

    floor: props.BoolProperty(name="Floor", description="A solid floor through the whole scene")
    floor_height: props.FloatProperty(
        name="Height",
        description="Height of the floor",
        subtype="DISTANCE",
        soft_min=-10.0,
        soft_max=10.0,
    )


def draw_floor(layout: Any, settings: Any) -> None:
    """A tick box, and the height beside it."""
    row = layout.row(heading="Floor")
    row.prop(settings, "floor", text="")
    height = row.row()
    height.active = settings.floor
    height.prop(settings, "floor_height", text="")
