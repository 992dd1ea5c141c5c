# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference pose of a body, drawn as a stick figure beside it: seen at once if it is wrong."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Final

import bpy
import numpy as np

from ...blender.animation import read_clip
from ...blender.rig import world_matrix
from ...core.errors import ClipError
from ...core.phrases import as_phrase, phrase
from ...core.rotations import Floats
from ...core.splicing.clip import Clip, average_pose, with_rest_pose
from ...core.splicing.humanoid import Landmarks
from ...core.splicing.transfer import find_reference_pose, reference_doubts
from ..language import reported
from ..overlay_lines import draw_lines
from .bodies import known_landmarks
from .splice_operators import StackOperator

_LEFT: Final = (0.35, 0.6, 1.0, 1.0)
_RIGHT: Final = (1.0, 0.4, 0.35, 1.0)
_MIDDLE: Final = (1.0, 1.0, 1.0, 1.0)
_FORWARD: Final = (0.4, 0.9, 0.4, 1.0)

_WIDTH: Final = 3.0
_BESIDE: Final = 0.8
"""Of the figure's height: how far to the side it stands."""
_NOSE: Final = 0.25
"""Of the figure's height: length of the line that shows where it faces."""

Colour = tuple[float, float, float, float]

Lines = tuple[Floats, Floats]
"""Ends of lines (points, 3), two for each, and their colours (points, 4)."""


def figure_lines(clip: Clip, landmarks: Landmarks) -> Lines:
    """The reference pose as lines, upright, facing −Y, its feet at height 0, in armature units.

    Raises:
        ClipError: none can be found.
    """
    found = find_reference_pose(clip, landmarks)
    if found is None:
        raise ClipError(
            "The joints of this body do not tell how it stands.",
            "Look at hips, chest, thighs and upper arms in the table, or choose another action.",
        )
    rested = with_rest_pose(clip.skeleton, found.orientations, found.offsets)
    heads = {
        name: rested.heads[rested.index[bone]]
        for name, bone in landmarks.bones.items()
        if bone in rested.index
    }
    chains: list[tuple[Colour, tuple[str, ...]]] = [
        (_MIDDLE, ("hips", "spine", "chest", "neck", "head"))
    ]
    for side, colour in (("L", _LEFT), ("R", _RIGHT)):
        arm = ("clavicle", "upper_arm", "forearm", "hand")
        leg = ("thigh", "shin", "foot", "toe")
        chains.append((colour, ("chest", *(f"{each}.{side}" for each in arm))))
        chains.append((colour, ("hips", *(f"{each}.{side}" for each in leg))))
    points: list[Floats] = []
    colours: list[Colour] = []
    for colour, names in chains:
        for start, end in pairwise([heads[each] for each in names if each in heads]):
            points += [start, end]
            colours += [colour, colour]
    all_points = np.array(points)
    height = float(np.ptp(all_points[:, 2]))
    middle = heads["hips"] - [0.0, 0.0, all_points[:, 2].min()]
    all_points = all_points - heads["hips"] + middle
    nose = np.array([middle, middle - [0.0, _NOSE * height, 0.0]])
    ends = np.concatenate([all_points, nose])
    ends[:, :2] -= middle[:2]
    return ends, np.array([*colours, _FORWARD, _FORWARD])


_shown: dict[str, Any] = {}
"""Draw handlers by name of the armature."""


def is_shown(armature: bpy.types.Object) -> bool:
    """Whether the figure of an armature is drawn."""
    return armature.name_full in _shown


def take_down(name: str) -> None:
    """Draw the figure of an armature no more."""
    handle = _shown.pop(name, None)
    if handle is not None:
        bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")


def take_down_all() -> None:
    """Leave no drawing behind."""
    for name in list(_shown):
        take_down(name)


def _draw(name: str, lines: Lines) -> None:
    armature = bpy.data.objects.get(name)
    context: Any = bpy.context
    if armature is None or context.region_data is None:
        return
    world = world_matrix(armature)
    size = float(np.cbrt(abs(np.linalg.det(world[:3, :3]))))
    points, colours = size * lines[0], lines[1]
    points = points + world[:3, 3] + [_BESIDE * float(np.ptp(points[:, 2])), 0.0, 0.0]
    draw_lines([(points, colours, _WIDTH)])


class OCTO_MOTION_OT_reference_show(StackOperator, bpy.types.Operator):
    bl_idname = "octo_motion.reference_show"
    bl_label = "Show Reference Pose"
    bl_description = (
        "Draw a stick figure in the reference pose beside the body, or take it away: it is to "
        "stand upright with its arms out, its left blue and its right red, and to face where the "
        "green line points. What the action does not tell is said"
    )

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        name = armature.name_full
        if is_shown(armature):
            take_down(name)
            return
        clip = read_clip(armature)
        known = known_landmarks(armature, clip.skeleton, average_pose(clip))
        if known.landmarks is None:
            raise ClipError(
                phrase(
                    "'{armature}' has no landmarks. {problem}",
                    armature=armature.name,
                    problem=as_phrase(known.problem),
                ),
                "Fill the table.",
            )
        lines = figure_lines(clip, known.landmarks)
        _shown[name] = bpy.types.SpaceView3D.draw_handler_add(
            _draw, (name, lines), "WINDOW", "POST_VIEW"
        )
        doubts = reference_doubts(clip, known.landmarks)
        for each in doubts:
            self.report({"WARNING"}, reported(each))
        if not doubts:
            self.report({"INFO"}, "Joints tell how this body stands.")
