# SPDX-License-Identifier: GPL-3.0-or-later
"""A video of the scene, written by Blender itself."""

from __future__ import annotations

from pathlib import Path

import bpy
import stage


def render_film(path: Path, size: tuple[int, int]) -> None:
    """Render all frames of the scene into an H.264 video, and set the scene back to pictures.

    Args:
        path: the file, ending in ``.mp4``.
        size: width and height in pixels, even numbers.
    """
    render = stage.the_scene().render
    stage.set_resolution(*size)
    stage.set_note(render, "")
    _set_medium(render, "VIDEO", "FFMPEG")
    ffmpeg = render.ffmpeg
    assert ffmpeg is not None
    ffmpeg.format = "MPEG4"
    ffmpeg.codec = "H264"
    ffmpeg.constant_rate_factor = "HIGH"
    ffmpeg.gopsize = 12
    render.filepath = str(path)
    bpy.ops.render.render(animation=True)
    _set_medium(render, "IMAGE", "PNG")


def _set_medium(render: bpy.types.RenderSettings, medium: str, file_format: str) -> None:
    # Blender 5 wants the kind of medium before its format.
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = medium
    render.image_settings.file_format = file_format
