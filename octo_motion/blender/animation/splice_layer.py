# SPDX-License-Identifier: GPL-3.0-or-later
"""An action as a layer of the NLA: on a track of its own, over the action that it was made from."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from ...core.errors import WriteError
from ...core.phrases import phrase
from .actions import MARK, curves_of, is_setting

_TRACK = "track"
_BENEATH = "beneath"
"""What an action's mark has the names of its tracks as: of the layer, and of the base below it, if
that was made for it."""


def check_layers(armature: bpy.types.Object) -> None:
    """Make sure that a layer would be seen.

    Raises:
        WriteError: the NLA is switched off.
    """
    data = armature.animation_data
    if data is not None and not data.use_nla:
        raise WriteError(
            phrase(
                "The NLA of '{armature}' is switched off: no layer would be seen.",
                armature=armature.name,
            ),
            "Switch it on in the NLA editor, or choose New Action as the Result.",
        )


def lay_over(
    armature: bpy.types.Object,
    action: bpy.types.Action,
    base: bpy.types.Action,
    slot: bpy.types.ActionSlot,
) -> None:
    """Let an armature play an action over its base, within the action's frame range.

    The base goes on as it is played, if that is by the NLA; else it gets a track. A layer that is
    there already stays, with all that was set of its strip; its range follows the action's.

    Args:
        armature: the armature object.
        action: the layer, made here.
        base: what is beneath.
        slot: its slot.
    """
    data = armature.animation_data or armature.animation_data_create()
    assert data is not None
    mark = action[MARK]
    if not _plays(data, base):
        track = data.nla_tracks.new()
        track.name = f"{base.name} Base"
        mark[_BENEATH] = track.name
        make_strip(track, base, slot)
    if data.action is not None and any(
        not is_setting(curve.data_path) for curve in curves_of(data.action)
    ):
        # On top of all tracks, it would be all that is seen.
        before, data.action = data.action, None
        if before.library is None:
            before.use_fake_user = True
    found = _layer(data, action)
    if found is None:
        track = data.nla_tracks.new()
        track.name = action.name
        mark[_TRACK] = track.name
        found = make_strip(track, action, action.slots[0])
        found.blend_type, found.extrapolation = "REPLACE", "NOTHING"
    else:
        fit_strip(found, action)


def take_off(armature: bpy.types.Object, action: bpy.types.Action | None) -> None:
    """Remove the tracks that were made for a layer, if the action is one."""
    data = armature.animation_data
    if action is None or data is None or MARK not in action:
        return
    mark = action[MARK]
    for key in (_TRACK, _BENEATH):
        track = data.nla_tracks.get(mark.get(key, ""))
        if track is not None and len(track.strips) < 2:
            data.nla_tracks.remove(track)
        if key in mark:
            del mark[key]


@contextmanager
def layers_off(armature: bpy.types.Object, action: bpy.types.Action | None) -> Iterator[None]:
    """The track of a layer that was made here is muted for a while: what is beneath shows."""
    data = armature.animation_data
    track = None
    if action is not None and data is not None and MARK in action:
        track = data.nla_tracks.get(action[MARK].get(_TRACK, ""))
    if track is None or track.mute:
        yield
        return
    track.mute = True
    try:
        yield
    finally:
        track.mute = False


def _plays(data: bpy.types.AnimData, base: bpy.types.Action) -> bool:
    tracks = (track for track in data.nla_tracks if not track.mute)
    return any(
        strip.action == base and not strip.mute for track in tracks for strip in track.strips
    )


def _layer(data: bpy.types.AnimData, action: bpy.types.Action) -> bpy.types.NlaStrip | None:
    track = data.nla_tracks.get(action[MARK].get(_TRACK, ""))
    strips = () if track is None else track.strips
    return next((strip for strip in strips if strip.action == action), None)


def make_strip(
    track: bpy.types.NlaTrack, action: bpy.types.Action, slot: bpy.types.ActionSlot
) -> bpy.types.NlaStrip:
    """A strip of an action that plays all of it."""
    strip = track.strips.new(action.name, round(action.frame_range[0]), action)
    strip.action_slot = slot
    fit_strip(strip, action)
    return strip


def fit_strip(strip: bpy.types.NlaStrip, action: bpy.types.Action) -> None:
    """Let a strip play all of an action at its own frames; strips are made on whole ones."""
    first, last = action.frame_range
    strip.action_frame_start, strip.action_frame_end = first, last
    # The end first: a strip cannot begin behind it.
    strip.frame_end = max(last, strip.frame_end)
    strip.frame_start = first
    strip.frame_end = last
