# SPDX-License-Identifier: GPL-3.0-or-later
"""From the settings of a splice to its timing: fades, a rate with keys, markers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final, cast

import bpy
import numpy as np

from ...blender.animation import setting_values
from ...core.errors import ClipError
from ...core.phrases import phrase
from ...core.rotations import Floats
from ...core.splicing.clip import After, Clip, MarkerPair, RateCurve, Timing

_PER_FRAME: Final = 4
"""Samples of a setting that has keys."""


def read_timing(settings: Any, item: Any, base: Clip) -> Timing:
    """When a splice acts, and which moment of its clip is shown then.

    Args:
        settings: of the armature's splicing.
        item: the splice.
        base: what it goes onto.

    Raises:
        ClipError: markers are to be matched, and there are none; or keys are no numbers.
    """
    ease_in, ease_out = fades(item, base.rate)
    markers = matched_markers(settings, item) if item.match_markers else ()
    if item.match_markers and not markers:
        raise ClipError(
            "Base and clip have no marker of the same name.",
            "Give pose markers of both actions the same name (Action Editor, Marker), or turn off "
            "Match Markers.",
        )
    return Timing(
        base_start=item.base_start,
        splice_start=item.splice_start,
        rate=item.rate,
        length=item.length or None,
        ease_in=ease_in,
        ease_out=ease_out,
        after=cast("After", item.after.lower()),
        rates=_rates(settings, item, base.frames),
        markers=markers,
    )


def fades(item: Any, rate: float) -> tuple[float, float]:
    """How long a splice comes and goes, in frames of a base with this rate per second."""
    if item.fade_unit == "SECONDS":
        return item.fade_in_seconds * rate, item.fade_out_seconds * rate
    return item.ease_in, item.ease_out


def matched_markers(settings: Any, item: Any) -> tuple[MarkerPair, ...]:
    """Markers of the same name in the base and the clip of a splice; of several that are called
    alike the first belongs to the first, and so on.

    Those of the base are the pose markers of its action, else the scene's of that name.
    """
    scene = bpy.context.scene
    if item.action is None or scene is None:
        return ()
    theirs = _by_name(item.action.pose_markers)
    ours = _by_name(scene.timeline_markers)
    if settings.base is not None:
        ours |= _by_name(settings.base.pose_markers)
    pairs = [
        MarkerPair(name, float(frame), float(moment))
        for name, frames in ours.items()
        for frame, moment in zip(frames, theirs.get(name, ()), strict=False)
    ]
    return tuple(sorted(pairs, key=lambda each: each.base))


def _by_name(markers: Iterable[Any]) -> dict[str, list[int]]:
    found: dict[str, list[int]] = {}
    for each in sorted(markers, key=lambda marker: marker.frame):
        found.setdefault(each.name, []).append(each.frame)
    return found


def read_weight(settings: Any, item: Any, base: Clip) -> tuple[Floats, Floats] | None:
    """Frames of the base and the weight of a splice there; none if it is 1 throughout.

    Raises:
        ClipError: it has keys that are no numbers.
    """
    keyed = _keyed(settings, item, "weight", base.frames)
    if keyed is not None:
        return keyed
    if item.weight == 1.0:
        return None
    return base.frames[:1], np.array([item.weight])


def _rates(settings: Any, item: Any, frames: Floats) -> RateCurve | None:
    """The rate over the base's frames, none if it has no keys."""
    keyed = _keyed(settings, item, "rate", frames)
    return None if keyed is None else RateCurve(*keyed)


def _keyed(settings: Any, item: Any, name: str, frames: Floats) -> tuple[Floats, Floats] | None:
    """Moments over the base's frames and a setting's values there, none if it has no keys."""
    count = _PER_FRAME * max(round(frames[-1] - frames[0]), 1) + 1
    looks = np.linspace(frames[0], frames[-1], count)
    slot = settings.base.slots.get(settings.base_slot) if settings.base_slot else None
    values = setting_values(item.id_data, item.path_from_id(name), looks, settings.base, slot)
    if values is None:
        return None
    if not np.isfinite(values).all():
        raise ClipError(
            phrase("The keys of its {name} are no finite numbers.", name=name),
            "Repair or delete them.",
        )
    limits = item.bl_rna.properties[name]
    return looks, np.clip(values, limits.hard_min, limits.hard_max)
