# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender may have of the events that a session does not take itself.

What a key does is said by Blender's keymaps, the artist's own changes among them: an event goes on
to Blender if all that it could set off there is a change of view, time, playback or layout, or the
file's own (save, open, quit). Editing waits until the session is over.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Final

import bpy

from ..panel_base import TabPanel
from .controls import Outcome

_FREE: Final = re.compile(
    r"view2d\..*"
    r"|view3d\.(rotate|move|zoom|zoom_border|dolly|navigate|walk|fly|localview|ndof_.*|view_.*"
    r"|toggle_(shading|xray))"
    r"|(action|graph|nla)\.view_.*"
    r"|anim\.(change_frame|previewrange_.*|channels?_view_.*)"
    r"|screen\.(animation_.*|(frame|time|keyframe|marker)_(jump|offset)|screen_full_area"
    r"|region_quadview|workspace_cycle)"
    r"|wm\.(save_.*mainfile|open_mainfile|quit_blender)"
)
"""Operators that change nothing in the scene but the frame."""
_FREE_MENUS: Final = re.compile(r".*_MT_(view|shading)_pie|TOPBAR_MT_file_(new|open_recent)")
_FREE_TOGGLES: Final = re.compile(r"space_data\..*")
"""Data that ``wm.context_toggle`` changes: how an editor shows things."""
_ENDS: Final = frozenset({"object.mode_set", "object.mode_set_with_submode"})

_MODE_MAPS: Final = {"POSE": "Pose", "OBJECT": "Object Mode"}
_MAPS: Final = {"VIEW_3D": ("Object Non-modal",)}
"""Keymaps without an editor of their own, by editor; others lie over a plane."""
_PLANE_MAPS: Final = ("View2D", "Animation")
_EVERYWHERE: Final = ("Frames", "Screen", "Window")
_WHEEL: Final = {"WHEELUPMOUSE": "WHEELINMOUSE", "WHEELDOWNMOUSE": "WHEELOUTMOUSE"}
_MODIFIERS: Final = ("shift", "ctrl", "alt", "oskey")
_BUTTONS: Final = frozenset({"LEFTMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE"})
"""With which panels and headers are used."""

_TABS: Final = 24.0
"""Width of a sidebar's tabs, in pixels of a screen without scaling."""
_GIZMO: Final = (100.0, 280.0)
"""Width and height of the corner with the gizmo and the buttons of navigation, likewise, where it
has the size that it comes with: 80."""


def left_to_blender(window: Any, event: Any, mode: str) -> Outcome:
    """What becomes of an event that a session has no use for, in a mode of the armature.

    ``FINISH`` where it would change the mode: that ends posing, and is used up by it.
    """
    if event.value == "NOTHING":
        # The mouse moves, or a timer runs.
        return Outcome.PASSED
    area, region = _under(window, event.mouse_x, event.mouse_y)
    if event.type in _BUTTONS and _is_for_buttons(area, region, event):
        return Outcome.PASSED
    found = [*_meanings(event, "" if area is None else area.type, mode)]
    if event.value == "PRESS" and any(item.idname in _ENDS for item in found):
        return Outcome.FINISH
    return Outcome.PASSED if found and all(_is_free(item) for item in found) else Outcome.TAKEN


def _meanings(event: Any, area: str, mode: str) -> Iterator[Any]:
    """Items of the keymaps that an event may set off over an editor, whichever comes first."""
    manager = bpy.context.window_manager
    config = manager.keyconfigs.user if manager is not None else None
    own = _MAPS.get(area, _PLANE_MAPS if area else ())
    names = {*own, *_EVERYWHERE, _MODE_MAPS.get(mode, "") if area == "VIEW_3D" else ""}
    kinds = {event.type, _WHEEL.get(event.type, event.type)}
    for keymap in config.keymaps if config is not None else ():
        belongs = keymap.space_type == area or keymap.name in names
        if not belongs or keymap.region_type != "WINDOW" or keymap.is_modal:
            continue
        if " Tool: " in keymap.name:
            # Of tools, one of which is chosen: they have the mouse's own buttons.
            continue
        for item in keymap.keymap_items:
            if item.type in kinds and item.active and item.key_modifier == "NONE":
                wanted = (getattr(item, each) for each in _MODIFIERS)
                held = (getattr(event, each, False) for each in _MODIFIERS)
                if item.any or all(a in {-1, b} for a, b in zip(wanted, held, strict=True)):
                    yield item


def _is_free(item: Any) -> bool:
    if item.idname.startswith("wm.call_menu"):
        return bool(_FREE_MENUS.fullmatch(item.properties.name))
    if item.idname.startswith("wm.context_toggle"):
        return bool(_FREE_TOGGLES.fullmatch(item.properties.data_path))
    return bool(_FREE.fullmatch(item.idname))


def _under(window: Any, x: int, y: int) -> tuple[Any, Any]:
    """Area and region under a pixel of the window; none between areas, and over the top bar."""
    for area in window.screen.areas if window is not None else ():
        if not _holds(area, x, y):
            continue
        # The last ones lie over those before.
        over = [each for each in area.regions if _holds(each, x, y)]
        return area, min(over, key=lambda each: each.type == "WINDOW", default=None)
    return None, None


def _holds(place: Any, x: int, y: int) -> bool:
    across = min(place.width, place.height) > 1
    return across and place.x <= x < place.x + place.width and place.y <= y < place.y + place.height


def _is_for_buttons(area: Any, region: Any, event: Any) -> bool:
    """Whether the mouse is over buttons that may be used: our panel, time, view and layout."""
    if area is None:
        return True
    if region is None:
        return False
    scale = _scale()
    if region.type in {"HEADER", "FOOTER"}:
        return area.ui_type == "TIMELINE" or region.type == "FOOTER"
    if area.type != "VIEW_3D":
        return False
    if region.type == "UI":
        inside = event.mouse_x - region.x
        if region.alignment != "LEFT":
            inside = region.width - inside
        return inside <= _TABS * scale or region.active_panel_category == TabPanel.bl_category
    space = area.spaces.active
    if region.type != "WINDOW" or not (space.show_gizmo and space.show_gizmo_navigate):
        return False
    right, top = region.x + region.width, region.y + region.height
    for each in area.regions:
        if each.type in {"UI", "HEADER", "TOOL_HEADER"} and min(each.width, each.height) > 1:
            if each.type == "UI" and each.x > region.x + region.width // 2:
                right = min(right, each.x)
            elif each.type != "UI" and each.y > region.y + region.height // 2:
                top = min(top, each.y)
    width, height = (scale * each for each in _GIZMO)
    return right - event.mouse_x <= width and top - event.mouse_y <= height


def _scale() -> float:
    preferences = bpy.context.preferences
    return (preferences and preferences.system.ui_scale) or 1.0
