# SPDX-License-Identifier: GPL-3.0-or-later
"""What ``Object.octo_motion.locomotion`` has of live motion."""

from __future__ import annotations

from typing import Any, Final

import bpy

from ...overridable import BoolProperty, StringProperty

SWITCHED: Final[set[str]] = set()
"""Names of the armatures whose Live was switched, until somebody has looked."""


def _tell(settings: Any, _context: bpy.types.Context) -> None:
    """A change in the panel is told to everyone by Blender, one by a script only like this."""
    SWITCHED.add(settings.id_data.name)
    settings.id_data.update_tag(refresh={"OBJECT"})


class LiveSettings:
    """Whether the motion follows its route and its settings by itself."""

    live: BoolProperty(
        name="Live",
        description="Make the motion anew by itself whenever its route, its ground or a setting "
        "changes, with a key on every frame. Generate measures it and leaves out keys. Switches "
        "itself off when you edit the action",
        update=_tell,
    )
    live_error: StringProperty(
        name="Live Error",
        description="Why the motion does not follow at the moment; the last one that could be "
        "made is still there",
        options={"HIDDEN"},
    )
