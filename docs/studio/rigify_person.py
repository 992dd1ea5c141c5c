# SPDX-License-Identifier: GPL-3.0-or-later
"""A person of Rigify that is posed by hand, in pictures: what was pulled, and the controls that
have got keys for it.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, Final

import bpy
import numpy as np
import puppets
import stage
from mathutils import Matrix
from puppets import Pull
from stage import Colour, Pixels

_GENERATE: Final = """
import os
import sys
import bpy
bpy.ops.preferences.addon_enable(module="rigify")
for each in list(bpy.data.objects):
    bpy.data.objects.remove(each)
bpy.ops.object.armature_human_metarig_add()
metarig = bpy.context.object
bpy.ops.pose.rigify_generate()
bpy.data.objects.remove(metarig)
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[1])
# Blender 4.5 does not end by itself with an add-on at work.
os._exit(0)
"""
"""Run by a Python of its own: the add-on does not outlive a fresh start."""

_KEYED: Final[Colour] = (0.95, 0.32, 0.03)
_THICK: Final = 0.006
_RADII: Final = (
    (("hand", "palm"), 0.025),
    (("thumb", "f_"), 0.011),
    (("spine.004", "spine.005"), 0.04),
    (("spine.006",), 0.085),
    (("spine",), 0.11),
    (("shoulder", "upper_arm", "forearm", "foot", "toe"), 0.042),
    (("thigh", "shin"), 0.06),
)
"""Of wooden limbs, by how names go on after *DEF-*."""
_PULLS: Final = (
    Pull("DEF-hand.L", (-0.15, -0.35, 0.45), seconds=1.0),
    Pull("DEF-shin.R", (-0.02, -0.45, 0.35), seconds=1.0),
)


def picture() -> Pixels:
    """A hand is lifted and a knee bent; the controls that are keyed then."""
    with tempfile.TemporaryDirectory(prefix="octo-motion-") as folder:
        path = Path(folder) / "person.blend"
        subprocess.run(
            [sys.executable, "-c", _GENERATE, str(path)], check=True, capture_output=True
        )
        bpy.ops.wm.open_mainfile(filepath=str(path))
    objects: Any = bpy.data.objects
    figure = next(each for each in objects if each.type == "ARMATURE")
    bpy.context.view_layer.objects.active = figure
    names = [each.name for each in figure.data.bones]
    limbs = {name: radius for name in names if (radius := _radius(name)) is not None}
    puppets.dress(figure, limbs)
    return puppets.sheet(figure, _PULLS, np.array([-0.5, 0.85, -0.16]), keyed=_show_controls)


def _radius(name: str) -> float | None:
    """How thick a limb is; none for what is no limb, or lies in one."""
    limb = name.removeprefix("DEF-")
    if limb == name or limb.startswith(("pelvis", "breast", "ear")):
        return None
    return next((radius for begins, radius in _RADII if limb.startswith(begins)), None)


def _show_controls(figure: Any, names: list[str]) -> None:
    """Draw the shapes of controls as wires, where they are now."""
    for name in names:
        bone = figure.pose.bones[name]
        shape = bone.custom_shape
        if shape is None:
            continue
        at = bone.custom_shape_transform or bone
        size = np.array(bone.custom_shape_scale_xyz) * (
            bone.length if bone.use_custom_shape_bone_size else 1.0
        )
        shown = Matrix.LocRotScale(
            bone.custom_shape_translation, bone.custom_shape_rotation_euler, size.tolist()
        )
        curve = bpy.data.curves.new(name, "CURVE")
        curve.dimensions, curve.bevel_depth = "3D", _THICK
        matrix = figure.matrix_world @ at.matrix @ shown
        for edge in shape.data.edges:
            spline = curve.splines.new("POLY")
            spline.points.add(1)
            for point, vertex in zip(spline.points, edge.vertices, strict=True):
                point.co = (*(matrix @ shape.data.vertices[vertex].co), 1.0)
        curve.materials.append(stage.new_material(name, _KEYED))
        stage.the_scene().collection.objects.link(bpy.data.objects.new(name, curve))
