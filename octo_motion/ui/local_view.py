# SPDX-License-Identifier: GPL-3.0-or-later
"""Views that show a few objects alone."""

from __future__ import annotations

import bpy


def show_in_local_view(context: bpy.types.Context, *added: bpy.types.Object) -> None:
    """Let what is added join the objects that the view shows, where it shows a few alone."""
    space = context.space_data
    if isinstance(space, bpy.types.SpaceView3D) and space.local_view:
        for each in added:
            each.local_view_set(space, state=True)
