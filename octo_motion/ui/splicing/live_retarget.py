# SPDX-License-Identifier: GPL-3.0-or-later
"""The last clip retargeted again by itself while one sets how, see :mod:`~octo_motion.ui.live`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

import bpy

from ...blender.animation import StandIn, own_action
from ...core.errors import ClipError
from ...core.locomotion.ground import Ground
from ...core.splicing.clip import Clip
from ...core.splicing.transfer import RetargetPreview
from ..declared_settings import plain
from .following import ClipLive, Following, LeftAloneError, check_ours, not_ours
from .properties import splicing_settings
from .retargeting import (
    RetargetJob,
    filling_retargeted_clip,
    prepare_retarget,
    previous_result,
    write_retargeted_clip,
)
from .stack import ClipReader, KeptClips, Source, is_source, local_object

_NO_MATTER: Final = frozenset({"live", "live_error"})


class _Previews:
    """What the frame in sight is worked out from, as long as the two clips are the same."""

    def __init__(self) -> None:
        self._known: tuple[Any, ...] = ()
        self._preview: RetargetPreview | None = None
        self.ground: Ground | None = None
        """Of the result before: it is nearly the same."""

    def of(self, job: RetargetJob) -> RetargetPreview:
        """What it is worked out from now."""
        still = job.still.world[0].tobytes(), len(job.still)
        told = [_told(each) for each in (job.base, job.source)]
        if self._preview is None or self._known != (*still, told):
            self._known = *still, told
            self._preview = RetargetPreview(job.base, job.still, job.source)
        return self._preview


def _told(source: Any) -> tuple[Any, ...]:
    marks = source.landmarks
    # At rest there is no motion: such a clip is made anew each time.
    moves = source.clip if isinstance(source, Source) and len(source.clip) > 1 else len(source.clip)
    return moves, None if marks is None else (dict(marks.bones), marks.reference)


class _FollowingRetarget(Following):
    """The clip that an armature got last, as its settings are now."""

    def __init__(self, armature: bpy.types.Object, kept: KeptClips, previews: _Previews) -> None:
        settings = splicing_settings(armature).retarget
        source, action, slot = _clip_of(settings)
        super().__init__(armature, ())
        self._job = prepare_retarget(armature, source, action, slot, reader=ClipReader(kept))
        self._previews, self._preview = previews, previews.of(self._job)
        self._as_shown = settings.visual
        self._clip: Clip | None = None
        self._pose_is_ours = not _plays_another(armature, self._job)

    def pose(self, frame: float) -> Clip | None:
        if not self._pose_is_ours:
            return None
        settings = self._job.settings
        if self._job.triangles is not None:
            settings = replace(settings, ground=self._previews.ground)
        return self._preview.at(frame, settings)

    def working(self) -> Iterator[object]:
        armature = local_object(self.name)
        if why := _plays_another(armature, self._job):
            raise LeftAloneError(why)
        yield from check_ours(armature, _playing(armature))
        if self._as_shown:
            # That plays the scene, which cannot be done in turns.
            return
        ground = self._previews.ground = yield from self._job.finding_ground()
        clip = yield from self._preview.whole(replace(self._job.settings, ground=ground))
        previous = _playing(armature)
        if previous is None or is_source(previous):
            previous = previous_result(armature, self._job)
        self.stand_in = StandIn(armature, previous, self._job.result_name)
        self._clip = clip
        yield
        yield from filling_retargeted_clip(self._job, clip, self.stand_in.action, self.posed)

    def write(self) -> None:
        armature = local_object(self.name)
        if self._clip is None:
            source, action, slot = _clip_of(splicing_settings(armature).retarget)
            self._job = prepare_retarget(armature, source, action, slot)
            self._clip = self._job.compute()
        write_retargeted_clip(self._job, self._clip, stand_in=self.stand_in)


def _clip_of(settings: Any) -> tuple[bpy.types.Object, bpy.types.Action, str]:
    if settings.from_armature is None or settings.from_action is None:
        raise ClipError(
            "The clip that was retargeted last is gone, or there was none.",
            "Retarget one from an armature of this file.",
        )
    return settings.from_armature, settings.from_action, settings.from_slot


def _playing(armature: bpy.types.Object) -> bpy.types.Action | None:
    own = own_action(armature)
    return None if own is None else own[0]


def _plays_another(armature: bpy.types.Object, job: RetargetJob) -> str:
    """Why an armature plays something else than what was made of the clip, "" if it does not."""
    playing = _playing(armature)
    if playing is None or job.made(playing):
        return ""
    return not_ours(playing)


class _LiveRetarget(ClipLive):
    """Retargets that follow."""

    def __init__(self) -> None:
        super().__init__()
        self.previews: dict[str, _Previews] = {}

    def settings(self, armature: bpy.types.Object) -> Any:
        return splicing_settings(armature).retarget

    def begin(self, armature: bpy.types.Object, kept: KeptClips) -> Following:
        previews = self.previews.setdefault(armature.name, _Previews())
        return _FollowingRetarget(armature, kept, previews)

    def others(self, armature: bpy.types.Object) -> list[bpy.types.Object]:
        source = splicing_settings(armature).retarget.from_armature
        return [] if source in {None, armature} else [source]

    def asked(self, armature: bpy.types.Object) -> Any:
        settings = splicing_settings(armature)
        base = settings.base.name if settings.base is not None else ""
        return [plain(settings.retarget, without=_NO_MATTER), base, settings.base_slot]

    def further(self, armature: bpy.types.Object) -> Iterator[bpy.types.ID | None]:
        settings = splicing_settings(armature)
        retarget = settings.retarget
        yield from (retarget.from_action, retarget.ground, retarget.standing, settings.base)
        yield armature.parent

    def clear(self) -> None:
        super().clear()
        self.previews.clear()


live_retargeted: Final = _LiveRetarget()
