# SPDX-License-Identifier: GPL-3.0-or-later
"""The pseudo-targets that the gait has for an arm, drawn over the viewport.

Drawing reads and works nothing out: what is to be seen anew is found a moment later, by a timer,
as a motion is that is live.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import blf
import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d

from ...blender.rig import world_matrix
from ...core.errors import OctoMotionError
from ...core.locomotion.motion import GaitTargets, gait_targets
from ...core.rotations import Floats
from ..declared_settings import plain
from ..overlay_lines import Lines, draw_lines
from ..panel_base import armature_in
from .settings import locomotion_settings
from .writing import RESULTS, prepare

_GROUPS: Final = ((1.0, 0.85, 0.2, 1.0), (0.3, 0.9, 0.85, 1.0), (1.0, 0.45, 0.75, 1.0))
"""Colours of root, middle and tip."""
_BONES: Final = 0.45
"""How opaque the joints of a group are drawn."""
_MARK: Final = 0.025
"""Arm lengths: half of a mark's width."""
_LINK, _JOINTS, _MISSED = 2.5, 5.0, 1.0
"""Widths in pixels: of a link, of the joints that are to reach its end, and of how far these are
from it."""
_TEXT: Final = 12.0
_NO_MATTER: Final = RESULTS | {
    *("show_targets", "active_arm", "contacts", "figures", "reaches", "active_reach", "shown"),
    *("active_curve", "active_change", "shown_angle", "live", "live_error"),
}


@dataclass(frozen=True)
class _Known:
    content: str
    """What they were found from."""
    targets: GaitTargets | None
    """None where the settings make no motion: Generate says why."""


_known: dict[str, _Known] = {}
"""By name of the armature."""
_handlers: list[Any] = []


def target_lines(armature: bpy.types.Object, targets: GaitTargets, arm: int, frame: float) -> Lines:
    """The chain of an arm at a frame, and the joints that are to reach it, as lines in the world.

    Each group of joints has the colour of its link.
    """
    places = _in_world(armature, targets.at(frame, arm))
    pose: Any = armature.pose
    size = _MARK * float(np.sum(np.linalg.norm(np.diff(places, axis=0), axis=1)))
    lines: Lines = []
    for number, (bones, colour) in enumerate(zip(targets.groups[arm], _GROUPS, strict=True)):
        link, end = places[number : number + 2], places[number + 1]
        mark = np.stack([end - size * np.eye(3), end + size * np.eye(3)], axis=1).reshape(-1, 3)
        lines.append(_coloured(np.concatenate([link, mark]), colour, _LINK))
        if any(bone not in pose.bones for bone in bones):
            continue
        joints = [pose.bones[bone].head for bone in bones] + [pose.bones[bones[-1]].tail]
        matrix = world_matrix(armature)
        seen = np.array(joints) @ matrix[:3, :3].T + matrix[:3, 3]
        pairs = np.repeat(seen, 2, axis=0)[1:-1]
        lines.append(_coloured(pairs, (*colour[:3], _BONES), _JOINTS))
        lines.append(_coloured(np.stack([seen[-1], end]), colour, _MISSED))
    return lines


def _coloured(points: Floats, colour: tuple[float, ...], width: float) -> Any:
    return points, np.tile(np.array(colour), (len(points), 1)), width


def _in_world(armature: bpy.types.Object, places: Floats) -> Floats:
    """Places (n, 3) of the body as it is at rest, where the body is now."""
    matrix = world_matrix(armature)
    root = locomotion_settings(armature).root_bone
    pose: Any = armature.pose
    if root in pose.bones:
        # It may carry the body along the route.
        bone = pose.bones[root]
        matrix = matrix @ np.array(bone.matrix @ bone.bone.matrix_local.inverted())
    return places @ matrix[:3, :3].T + matrix[:3, 3]


def content_of(armature: bpy.types.Object) -> str:
    """All that an artist may change and that the targets hang on, as text."""
    settings = locomotion_settings(armature)
    scene: Any = bpy.context.scene
    route, splines = settings.route, []
    if route is not None:
        for spline in getattr(route.data, "splines", ()):
            for point in spline.bezier_points:
                splines += [*point.handle_left, *point.co, *point.handle_right]
            for point in spline.points:
                splines += [*point.co]
    arms = [[bone.name for bone in arm.bones] for arm in settings.arms]
    place = [] if route is None else [value for row in route.matrix_world for value in row]
    rate = scene.render.fps, scene.render.fps_base
    return json.dumps([plain(settings, without=_NO_MATTER), splines, arms, place, rate])


def find(name: str, content: str) -> None:
    """Find the targets of an armature, as its settings are now."""
    armature = bpy.data.objects.get((name, None))
    if armature is None or armature.type != "ARMATURE":
        _known.pop(name, None)
        return
    try:
        found = gait_targets(prepare(armature, bpy.context, live=True).job)
    except OctoMotionError:
        found = None
    _known[name] = _Known(content, found)
    for window in getattr(bpy.context.window_manager, "windows", ()):
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def _shown(context: Any, *, look: bool) -> tuple[bpy.types.Object, GaitTargets, int] | None:
    """The armature whose targets are to be drawn here, its targets and the active arm.

    It is looked whether they are still so, or not.
    """
    if context.region_data is None or not context.space_data.overlay.show_overlays:
        return None
    armature: Any = armature_in(context)
    if armature is None or not armature.is_property_set("octo_motion"):
        return None
    settings = locomotion_settings(armature)
    if not settings.show_targets or armature.library is not None or armature.mode == "EDIT":
        return None
    known = _known.get(armature.name)
    if look:
        content = content_of(armature)
        if known is None or known.content != content:
            _ask(armature.name, content)
    if known is None or known.targets is None:
        return None
    arms = known.targets.groups
    enabled = [number for number, arm in enumerate(settings.arms) if arm.enabled]
    active = enabled.index(settings.active_arm) if settings.active_arm in enabled else 0
    return armature, known.targets, min(active, len(arms) - 1)


_waiting: list[Any] = []
"""What the timer is to do, once."""


def _ask(name: str, content: str) -> None:
    if not _waiting:
        _waiting.append(partial(find, name, content))
        bpy.app.timers.register(_find_waiting, first_interval=0.0)


def _find_waiting() -> None:
    while _waiting:
        _waiting.pop()()


def _draw() -> None:
    context: Any = bpy.context
    shown = _shown(context, look=True)
    if shown is not None:
        draw_lines(target_lines(*shown, context.scene.frame_current_final))


def _draw_names() -> None:
    context: Any = bpy.context
    shown = _shown(context, look=False)
    if shown is None:
        return
    armature, targets, arm = shown
    blf.size(0, _TEXT * context.preferences.system.ui_scale)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    places = _in_world(armature, targets.at(context.scene.frame_current_final, arm))
    for number, place in enumerate(places):
        at = location_3d_to_region_2d(context.region, context.region_data, place)
        if at is not None:
            blf.position(0, at.x + _TEXT, at.y + 0.5 * _TEXT, 0.0)
            blf.draw(0, f"Q{number}")


def listen() -> None:
    """Draw in all 3D viewports, where an armature asks for it."""
    for draw, when in ((_draw, "POST_VIEW"), (_draw_names, "POST_PIXEL")):
        _handlers.append(bpy.types.SpaceView3D.draw_handler_add(draw, (), "WINDOW", when))


def listen_no_more() -> None:
    """Leave no drawing behind."""
    while _handlers:
        bpy.types.SpaceView3D.draw_handler_remove(_handlers.pop(), "WINDOW")
    if bpy.app.timers.is_registered(_find_waiting):
        bpy.app.timers.unregister(_find_waiting)
    _waiting.clear()
    _known.clear()
