# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of a body are as large as their skin, however long their bones are."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.rig.armature import skin_parts


def head(tail: tuple[float, float, float]) -> Any:
    """A ball of radius 0.5 round (0, 0, 1), and a bone from the origin that it follows."""
    armature: Any = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for name in ("Head", "Bare"):
        bone = armature.data.edit_bones.new(name)
        bone.head, bone.tail = (0.0, 0.0, 0.0), tail
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, location=(0.0, 0.0, 1.0))
    ball: Any = bpy.context.object
    ball.vertex_groups.new(name="Head").add(range(len(ball.data.vertices)), 1.0, "REPLACE")
    ball.modifiers.new("Armature", "ARMATURE").object = armature
    bpy.context.view_layer.update()
    return armature


@pytest.mark.parametrize("tail", [(0.0, 0.0, 3.0), (0.0, 0.0, 0.1), (2.0, 0.0, 0.0)])
def test_a_head_reaches_as_far_as_its_skin_whatever_its_bone(
    tail: tuple[float, float, float],
) -> None:
    ((name, ends, radii),) = skin_parts(head(tail), ["Head", "Bare"])

    assert name == "Head"
    farthest = np.linalg.norm(ends - (0.0, 0.0, 1.0), axis=1) + radii
    # Three quarters of the vertices lie within the radius; it is a rounded measure.
    assert np.all(farthest <= 0.6)
    assert np.all(radii >= 0.35)
