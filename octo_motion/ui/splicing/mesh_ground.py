# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh on which feet stand."""

from __future__ import annotations

from typing import Final

import bpy
import numpy as np

from ...blender.scene import read_triangles
from ...core.locomotion.ground import Ground, sample_ground

_SAMPLES: Final = 500
"""Along the longer side of a mesh."""


def mesh_ground(mesh: bpy.types.Object) -> Ground:
    """The highest faces of a mesh, wherever somebody walks on it.

    Raises:
        GroundError: it is no mesh, or has no faces.
    """
    triangles, content = read_triangles(mesh, bpy.context.evaluated_depsgraph_get())
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    middle = 0.5 * (low + high)
    size = max(float((high - low)[:2].max()), 1e-6)
    return sample_ground(
        triangles,
        np.array([(middle[0], middle[1], high[2])]),
        np.zeros(1, dtype=bool),
        reach=0.5 * size,
        spacing=size / _SAMPLES,
        headroom=size,
        content=content,
    )
