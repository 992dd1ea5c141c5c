# SPDX-License-Identifier: GPL-3.0-or-later
"""Splices that are built by themselves while one sets them, see :mod:`~octo_motion.ui.live`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import bpy
import numpy as np

from ...blender.animation import (
    SplicedMotion,
    StandIn,
    curves_of,
    is_setting,
)
from ...core.splicing.clip import Clip
from ..declared_settings import plain
from .following import (
    ClipLive,
    Following,
    LeftAloneError,
    check_ours,
    not_ours,
    setting_action,
)
from .properties import splicing_settings
from .stack import (
    NO_SETTINGS,
    Filled,
    KeptClips,
    Stack,
    filling_splices,
    is_source,
    local_object,
    prepare_splices,
    reading_between,
    write_splices,
)
from .timing_settings import matched_markers

_NO_MATTER: Final = NO_SETTINGS | {"active_splice", "retarget", "landmarks"}
"""Settings that a result does not hang on; landmarks are looked at with the bodies."""


class _FollowingSplices(Following):
    """One armature's splices as they are set now."""

    def __init__(self, armature: bpy.types.Object, kept: KeptClips) -> None:
        settings = splicing_settings(armature)
        self._stack = prepare_splices(armature, between=False, kept=kept)
        data = armature.animation_data
        own = data.action if data is not None else None
        super().__init__(
            armature,
            [each for each in (settings.base, own) if each is not None],
        )
        shown = (item.visual for item in settings.splices if not item.mute)
        self._as_shown = settings.visual or any(shown)
        self._preview = self._stack.preview(0) if self._stack.acting else None
        self._made: tuple[Stack, SplicedMotion] | None = None
        self._pose_is_ours = not _plays_another(armature)

    def pose(self, frame: float) -> Clip | None:
        if not self._pose_is_ours:
            return None
        base = self._stack.base.clip
        if self._preview is None:
            return base.taken([int(np.abs(base.frames - frame).argmin())])
        with self._stack.naming():
            return self._preview.at(frame, self._stack.acting[0].timing)

    def working(self) -> Iterator[object]:
        armature = local_object(self.name)
        if why := _plays_another(armature):
            raise LeftAloneError(why)
        yield from check_ours(armature, _previous(armature))
        if self._as_shown:
            # That plays the scene, which cannot be done in turns.
            return
        stack = yield from reading_between(self._stack, self.unkeyed)
        motion = yield from stack.computing()
        self.stand_in = StandIn(armature, _previous(armature), stack.result_name)
        self._made = stack, motion
        yield
        yield from filling_splices(stack, motion, self._filled(self.stand_in))

    def _filled(self, stand_in: StandIn) -> Filled:
        return Filled(stand_in, self.unkeyed, self.posed)

    def write(self) -> None:
        armature = local_object(self.name)
        if self._made is None:
            stack = prepare_splices(armature)
            self._made = stack, stack.compute()
        filled = None if self.stand_in is None else self._filled(self.stand_in)
        write_splices(*self._made, filled)


def _previous(armature: bpy.types.Object) -> bpy.types.Action | None:
    """The result that is to be made anew; none if somebody splices from it."""
    previous = splicing_settings(armature).result
    return None if previous is None or is_source(previous) else previous


def _plays_another(armature: bpy.types.Object) -> str:
    """Why an armature plays something else than base and result, "" if it does not."""
    settings, data = splicing_settings(armature), armature.animation_data
    playing = data.action if data is not None else None
    if playing is None or playing in {settings.base, settings.result}:
        return ""
    if all(is_setting(curve.data_path) for curve in curves_of(playing)):
        return ""
    return not_ours(playing)


class _LiveSplices(ClipLive):
    """Splices that follow."""

    def settings(self, armature: bpy.types.Object) -> Any:
        return splicing_settings(armature)

    def begin(self, armature: bpy.types.Object, kept: KeptClips) -> Following:
        return _FollowingSplices(armature, kept)

    def others(self, armature: bpy.types.Object) -> list[bpy.types.Object]:
        items = splicing_settings(armature).splices
        found = {each.source.name_full: each.source for each in items if each.source is not None}
        return [each for each in found.values() if each != armature]

    def asked(self, armature: bpy.types.Object) -> Any:
        settings = splicing_settings(armature)
        markers = [
            [(each.name, each.base, each.clip) for each in matched_markers(settings, item)]
            for item in settings.splices
            if item.match_markers
        ]
        return [plain(settings, without=_NO_MATTER), markers]

    def further(self, armature: bpy.types.Object) -> Iterator[bpy.types.ID | None]:
        settings = splicing_settings(armature)
        yield from (settings.base, setting_action(armature), armature.parent)
        for item in settings.splices:
            yield from (item.action, item.ground)
            if item.match_markers:
                yield bpy.context.scene


live_spliced: Final = _LiveSplices()
