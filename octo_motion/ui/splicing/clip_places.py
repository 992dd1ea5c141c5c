# SPDX-License-Identifier: GPL-3.0-or-later
"""How tall imported clips are, and where they stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import bpy
import numpy as np

from ...blender.scene import ImportedClip, place_clip, room_of
from ...core.errors import OctoMotionError
from ...core.phrases import phrase
from ...core.rotations import Floats
from .bodies import height_of

Fit = Literal["NONE", "HUMANOIDS", "ALL"]

PERSON: Final = 1.7
"""Metres; the height of a clip's body where nothing else tells it."""

_ROUNDING: Final = 1e-5
"""Factors that are no nearer to one than this are meant."""

_SPARE: Final = 0.25
"""Room between two clips that stand side by side, in heights of the taller one."""

_STANDING: Final = 0.05
"""Of a body's height, what it may be above or below the ground and stand on it all the same."""


@dataclass(frozen=True)
class Placing:
    """What is asked for."""

    fit: Fit = "HUMANOIDS"
    """Which clips get a height."""
    height: float = 0.0
    """World units; 0 is that of :func:`target_height`."""
    side_by_side: bool = True
    """Whether several clips stand in a row."""


def target_height(context: bpy.types.Context) -> tuple[float, str]:
    """How tall a body should be, world units: as the active armature is, else as the first humanoid
    in the view layer, else as a person; and the name of the armature.
    """
    layer, scene = context.view_layer, context.scene
    assert layer is not None
    assert scene is not None
    active = layer.objects.active
    others = [each for each in layer.objects if each.type == "ARMATURE" and each != active]
    if active is not None and active.type == "ARMATURE":
        others.insert(0, active)
    for each in others:
        height = height_of(each)
        if height is not None:
            return height, each.name
    return PERSON / scene.unit_settings.scale_length, ""


def place_clips(
    clips: Sequence[ImportedClip],
    context: bpy.types.Context,
    placing: Placing,
    target: tuple[float, str],
) -> tuple[list[ImportedClip], str]:
    """Give clips their size and their places, all at once.

    Args:
        clips: as they were imported.
        context: with their scene and view layer.
        placing: what is asked for.
        target: of :func:`target_height`, before the clips were there.

    Returns:
        The clips, with what was made for them, and a sentence on their height, "" if they have the
        one of their files.
    """
    layer, scene = context.view_layer, context.scene
    assert layer is not None
    assert scene is not None
    layer.update()
    height = placing.height or target[0]
    scales = [_scale(clip, placing.fit, height) for clip in clips]
    moves = [np.zeros(3)] * len(clips)
    if placing.side_by_side and len(clips) > 1:
        moves = _row([scale * _room(clip) for clip, scale in zip(clips, scales, strict=True)])
    placed = [
        place_clip(clip, scene, scale=scale, move=move) if scale != 1.0 or move.any() else clip
        for clip, scale, move in zip(clips, scales, moves, strict=True)
    ]
    layer.update()
    if all(scale == 1.0 for scale in scales):
        return placed, ""
    metres = height * scene.unit_settings.scale_length
    whose = (
        "" if placing.height or not target[1] else phrase(" that '{target}' has", target=target[1])
    )
    return placed, phrase(
        "Fitted to the height{whose}: {metres:.3g} m.", whose=whose, metres=metres
    )


def _scale(clip: ImportedClip, fit: Fit, height: float) -> float:
    """What brings a clip to a height; 1 if it is not to have one."""
    if fit == "NONE":
        return 1.0
    heights = (height_of(bpy.data.objects[name]) for name in clip.armatures)
    own = next((each for each in heights if each is not None), None)
    if own is None and fit == "ALL":
        own = float(np.ptp(_room(clip)[0], axis=0).max())
    scale = height / own if own else 1.0
    return scale if abs(scale - 1.0) > _ROUNDING else 1.0


def _room(clip: ImportedClip) -> Floats:
    """Points of a clip's bodies over time, (frames, points, 3); of one that cannot be read, where
    its objects are.
    """
    try:
        return room_of(clip)
    except OctoMotionError:
        places = [bpy.data.objects[name].matrix_world.translation for name in clip.armatures]
        return np.array(places, dtype=np.float64)[None]


def _row(rooms: Sequence[Floats]) -> list[Floats]:
    """Moves (3,) after which bodies begin on a line along X, one beside the other on all of their
    ways, the first one at the origin, and stand on the ground.
    """
    heights = [float(np.ptp(room[0, :, 2])) for room in rooms]
    moves: list[Floats] = []
    end = before = 0.0
    for room, height in zip(rooms, heights, strict=True):
        begins = 0.5 * (room[0].min(axis=0) + room[0].max(axis=0))
        least, most = room[..., 0].min(), room[..., 0].max()
        spare = _SPARE * max(before, height)
        across = end + spare - least if moves else -begins[0]
        end, before = across + most, height
        lowest = room[..., 2].min()
        # A file that has its own ground near enough keeps it: soles are below their joints.
        down = 0.0 if abs(lowest) < _STANDING * height else -lowest
        moves.append(np.array([across, -begins[1], down]))
    return moves
