# SPDX-License-Identifier: GPL-3.0-or-later
"""Playing a scene through to read it, and leaving it as it was found.

Whoever sets another frame has Blender take every animated value from its keys: what artists have
set by hand since, and not yet keyed, is gone. It is not, for them, when all they did was to press
one of our buttons.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import bpy

from .actions import flattened

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
        for path in _paths(owner.animation_data):
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


def _paths(data: bpy.types.AnimData) -> set[str]:
    tracks = data.nla_tracks if data.use_nla else ()
    strips = [strip for track in tracks for strip in flattened(track.strips)]
    acting = [
        (data.action, data.action_slot),
        *((each.action, each.action_slot) for each in strips),
    ]
    return {
        curve.data_path
        for action, slot in acting
        if action is not None and slot is not None
        for layer in action.layers
        for strip in layer.strips
        if isinstance(strip, bpy.types.ActionKeyframeStrip)
        if (channelbag := strip.channelbag(slot)) is not None
        for curve in channelbag.fcurves
    }


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
