# SPDX-License-Identifier: GPL-3.0-or-later
"""Playing a scene through to read it, and leaving it as it was found.

Whoever sets another frame has Blender take every animated value from its keys: what artists have
set by hand since, and not yet keyed, is gone. It is not, for them, when all they did was to press
one of our buttons.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np

from ...core.errors import ClipError
from ...core.phrases import phrase
from ...core.rotations import Floats
from .actions import acting_curves
from .poses import AT_REST

_Value = tuple[bpy.types.ID, str, Any]
"""A data-block, the path of one of its properties, and what that is."""


@contextmanager
def time_kept(scene: bpy.types.Scene) -> Iterator[Callable[[float], None]]:
    """Give a scene its frame back, with everything in the file as it was there.

    What it hands out goes to a frame.
    """
    before = scene.frame_current, scene.frame_subframe
    values = list(_animated_values())

    def go_to(frame: float) -> None:
        whole = math.floor(frame)
        scene.frame_set(whole, subframe=float(frame - whole))

    try:
        yield go_to
    finally:
        if (scene.frame_current, scene.frame_subframe) != before:
            scene.frame_set(before[0], subframe=before[1])
        _set_again(values)


def _animated_values() -> Iterator[_Value]:
    """Values that some action moves: of the whole file, for data-blocks use one another."""
    for owner in _animated():
        for path in {curve.data_path for curve in acting_curves(owner.animation_data)}:
            try:
                value = owner.path_resolve(path)
            except ValueError:
                # A curve of a bone or a property that is no longer there.
                continue
            yield owner, path, _plain(value)


def _animated() -> Iterator[Any]:
    """Data-blocks of this file that have animation, node trees within others too."""
    for definition in bpy.data.bl_rna.properties:
        if definition.type != "COLLECTION":
            continue
        for each in getattr(bpy.data, definition.identifier):
            parts: tuple[Any, ...] = each, getattr(each, "node_tree", None)
            for owner in parts:
                if getattr(owner, "animation_data", None) and owner.library is None:
                    yield owner


def _plain(value: Any) -> Any:
    """A value of its own: vectors and arrays would go on to show what is there."""
    return value if isinstance(value, (bool, int, float, str)) else tuple(value)


def _set_again(values: Iterable[_Value]) -> None:
    for owner, path, value in values:
        if _plain(owner.path_resolve(path)) == value:
            continue
        if path.endswith("]"):
            place, _, key = path.rpartition('["')
            item: Any = owner.path_resolve(place) if place else owner
            item[bpy.utils.unescape_identifier(key[:-2])] = value
        else:
            place, _, name = path.rpartition(".")
            setattr(owner.path_resolve(place) if place else owner, name, value)


# --- Poses as the scene shows them, frame by frame: NLA, constraints, drivers and all -------------


def shown_poses(armature: bpy.types.Object, frames: Floats) -> tuple[Floats, Floats, Floats]:
    """What an armature looks like at these frames of the current scene.

    The scene is played through and put back to its frame; what has no keys yet survives. Returns
    bone matrices (frames, bones, 4, 4) in armature space, in the order of the armature's bones, the
    object's world matrices (frames, 4, 4), and what its own channels make of it (frames, 4, 4),
    before parents and constraints.
    """
    scene = bpy.context.scene
    assert scene is not None
    assert armature.pose is not None
    count = len(armature.pose.bones)
    bones = np.empty((len(frames), count, 4, 4))
    world, own = np.empty((2, len(frames), 4, 4))
    buffer = np.empty(16 * count, dtype=np.float32)
    with _pose_kept(armature), time_kept(scene) as go_to:
        for number, frame in enumerate(frames):
            go_to(float(frame))
            shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
            assert shown.pose is not None
            shown.pose.bones.foreach_get("matrix", buffer)
            # Blender hands over matrices column by column.
            bones[number] = buffer.reshape(count, 4, 4).transpose(0, 2, 1)
            world[number], own[number] = shown.matrix_world, shown.matrix_basis
    return bones, world, own


def play_bones(
    armature: bpy.types.Object, names: Sequence[str], moments: Floats, seconds: float
) -> Floats:
    """Where bones are in the world at the first of these moments: frames, and between frames.

    The current scene is played through and put back to its frame; what has no keys yet survives.
    After so many seconds no further moment is begun: the matrices (moments, bones, 4, 4) are of as
    many as there was time for, at least of one, or of none if the scene does not show the armature.
    """
    scene, layer = bpy.context.scene, bpy.context.view_layer
    assert scene is not None
    assert layer is not None
    # What was keyed a moment ago is not yet what shows: it is to be that which is kept.
    layer.update()
    until = time.monotonic() + seconds
    found: list[Floats] = []
    with _pose_kept(armature), time_kept(scene) as go_to:
        for moment in moments:
            go_to(float(moment))
            shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
            if not shown.is_evaluated or shown.pose is None:
                break
            bones = shown.pose.bones
            own = np.array([bones[name].matrix for name in names], dtype=np.float64)
            found.append(np.array(shown.matrix_world, dtype=np.float64) @ own)
            if time.monotonic() >= until:
                break
    return np.array(found).reshape(-1, len(names), 4, 4)


@contextmanager
def assigned(
    armature: bpy.types.Object, action: bpy.types.Action, slot: bpy.types.ActionSlot
) -> Iterator[None]:
    """An action on the armature for a while; then what it had before, its pose included.

    Raises:
        ClipError: the armature is in NLA tweak mode, on another action.
    """
    data = armature.animation_data
    had_none = data is None
    data = data or armature.animation_data_create()
    assert data is not None
    before, slot_before = data.action, data.action_slot
    if before == action and slot_before == slot:
        yield
        return
    if data.is_property_readonly("action"):
        raise ClipError(
            phrase("'{armature}' is in the tweak mode of the NLA editor.", armature=armature.name),
            "Leave tweak mode there (Tab) and try again.",
        )
    with _pose_kept(armature):
        try:
            data.action = action
            data.action_slot = slot
            yield
        finally:
            data.action = before
            if before is not None:
                data.action_slot = slot_before
            if had_none:
                armature.animation_data_clear()
            if bpy.context.view_layer is not None:
                # Blender poses all by its keys for that: now, and not when it draws next.
                bpy.context.view_layer.update()


@contextmanager
def _pose_kept(armature: bpy.types.Object) -> Iterator[None]:
    """The pose as it was: what an action that is assigned for a while moves is no one else's."""
    assert armature.pose is not None
    owners = (armature, *armature.pose.bones)
    values = [[tuple(getattr(owner, name)) for name in AT_REST] for owner in owners]
    try:
        yield
    finally:
        for owner, mine in zip(owners, values, strict=True):
            for name, value in zip(AT_REST, mine, strict=True):
                if tuple(getattr(owner, name)) != value:
                    setattr(owner, name, value)
