# SPDX-License-Identifier: GPL-3.0-or-later
"""The splice whose timing is dragged, as a strip with its fades over timeline and dope sheet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import blf
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...core.phrases import phrase
from ...core.rotations import Floats
from ...core.splicing.clip import Clip, Timing, splice_span
from ..language import translated

_FULL: Final = (0.95, 0.6, 0.1, 0.6)
_LINE: Final = (1.0, 0.8, 0.3, 1.0)
_AWAY: Final = (0.9, 0.2, 0.15, 0.7)
_HEIGHT: Final = 22.0
_MARGIN: Final = 6.0
_TEXT: Final = 12.0
"""Pixels."""


@dataclass(frozen=True)
class Strip:
    """When a splice acts on its base, in the base's frames."""

    start: float
    end: float
    ease_in: float
    ease_out: float
    base: tuple[float, float]
    """First and last frame of the base."""
    cyclic: bool
    """Whether the base begins again, so that nothing is outside."""

    @property
    def warning(self) -> str:
        """What there is to say of a splice that acts on no frame of its base, "" if it does."""
        first, last = self.base
        if self.cyclic or (self.start <= last and self.end > first):
            return ""
        if self.end <= first:
            return phrase(
                "The splice lies before its base (frames {first:g} to {last:g}): nothing of it is "
                "seen.",
                first=first,
                last=last,
            )
        return phrase(
            "The splice lies after its base (frames {first:g} to {last:g}): nothing of it is seen.",
            first=first,
            last=last,
        )

    def outline(self) -> Floats:
        """Corners (4, 2) of how much it acts, frames and 0…1: it comes, stays, goes, ends."""
        end = min(self.end, max(self.base[1], self.start))
        come, go = self.start + self.ease_in, end - self.ease_out
        if come > go:
            # Both at once: it goes before it has come.
            come = go = 0.5 * (come + go)
        come, go = np.clip([come, go], self.start, end)
        return np.array([[self.start, 0.0], [come, 1.0], [go, 1.0], [end, 0.0]])


def strip_of(timing: Timing, base: Clip, clip: Clip) -> Strip:
    """The strip of a splice of a clip on a base.

    Raises:
        ClipError: the timing makes no sense.
    """
    start, end = splice_span(timing, base, clip)
    frames = float(base.frames[0]), float(base.frames[-1])
    return Strip(start, end, timing.ease_in, timing.ease_out, frames, base.cyclic)


class StripOverlay:
    """Draws a strip until it is taken down."""

    def __init__(self, strip: Callable[[], Strip | None], name: str) -> None:
        self._strip = strip
        self._name = name
        space = bpy.types.SpaceDopeSheetEditor
        self._handler: Any = space.draw_handler_add(self._draw, (), "WINDOW", "POST_PIXEL")
        self.redraw()

    def redraw(self) -> None:
        """Let the editors draw it anew."""
        manager: Any = bpy.context.window_manager
        for window in manager.windows if manager is not None else ():
            for area in window.screen.areas:
                if area.type == "DOPESHEET_EDITOR":
                    area.tag_redraw()

    def take_down(self) -> None:
        """Draw it no more; safe to call twice."""
        if self._handler is not None:
            bpy.types.SpaceDopeSheetEditor.draw_handler_remove(self._handler, "WINDOW")
            self._handler = None
            self.redraw()

    def _draw(self) -> None:
        strip, region = self._strip(), bpy.context.region
        if strip is None or region is None:
            return
        scale = bpy.context.preferences.system.ui_scale
        low, high = _MARGIN * scale, (_MARGIN + _HEIGHT) * scale
        frames, acting = strip.outline().T
        across = [region.view2d.view_to_region(frame, 0.0, clip=False)[0] for frame in frames]
        corners = np.stack([across, low + (high - low) * acting], axis=1)
        feet = np.stack([across, np.full(4, low)], axis=1)
        shader = gpu.shader.from_builtin("UNIFORM_COLOR")
        gpu.state.blend_set("ALPHA")
        try:
            sides = np.stack([feet, corners], axis=1).reshape(-1, 2).astype(np.float32)
            _fill(shader, "TRI_STRIP", sides, _AWAY if strip.warning else _FULL)
            _fill(shader, "LINE_STRIP", corners.astype(np.float32), _LINE)
        finally:
            gpu.state.blend_set("NONE")
        blf.size(0, _TEXT * scale)
        blf.color(0, 1.0, 1.0, 1.0, 1.0)
        blf.position(0, max(across[0], 0.0) + _MARGIN * scale, low + _MARGIN * scale, 0.0)
        blf.draw(0, translated(strip.warning) if strip.warning else self._name)


def _fill(shader: Any, kind: Any, points: Any, colour: tuple[float, ...]) -> None:
    batch = batch_for_shader(shader, kind, {"pos": points})
    shader.bind()
    shader.uniform_float("color", colour)
    batch.draw(shader)
