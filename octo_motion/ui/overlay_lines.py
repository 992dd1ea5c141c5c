# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines over a 3D viewport, seen through everything."""

from __future__ import annotations

from typing import Any

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..core.rotations import Floats

Lines = list[tuple[Floats, Floats, float]]
"""Points (2 · lines, 3), colours (2 · lines, 4) and width in pixels."""


def draw_lines(lines: Lines) -> None:
    """Draw lines in the region that Blender draws now, in the world."""
    context: Any = bpy.context
    shader = gpu.shader.from_builtin("POLYLINE_SMOOTH_COLOR")
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("NONE")
    try:
        for points, colours, width in lines:
            if not len(points):
                continue
            content: Any = {"pos": points.astype(np.float32), "color": colours.astype(np.float32)}
            batch = batch_for_shader(shader, "LINES", content)
            shader.bind()
            shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
            shader.uniform_float("lineWidth", width * context.preferences.system.pixel_size)
            batch.draw(shader)
    finally:
        gpu.state.blend_set("NONE")
        gpu.state.depth_test_set("NONE")
