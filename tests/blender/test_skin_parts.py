# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of a body are as large as their skin, however long their bones are."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.rig.armature import skin_parts


def head(
    tail: tuple[float, float, float], form: tuple[float, float, float] = (1.0, 1.0, 1.0)
) -> Any:
    """A ball of radius 0.5 round (0, 0, 1), of some form, and a bone from the origin that it
    follows.
    """
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
    for vertex in ball.data.vertices:
        vertex.co = [own * share for own, share in zip(vertex.co, form, strict=True)]
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


@pytest.mark.parametrize("form", [(0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
def test_skin_that_is_a_line_or_a_point_is_no_part(form: tuple[float, float, float]) -> None:
    """Arms were 5·10³⁰ of its radius deep in such a helper bone, and made way for nothing else."""
    assert skin_parts(head((0.0, 0.0, 1.0), form), ["Head", "Bare"]) == []


def outside(points: Any, joints: Any, radii: Any) -> Any:
    """How far (n,) points are out of a chain of capsules, less than zero for those in it."""
    found = np.full(len(points), np.inf)
    for number in range(len(joints) - 1):
        step, way = joints[number + 1] - joints[number], points - joints[number]
        share = np.clip(way @ step / max(float(step @ step), 1e-12), 0.0, 1.0)
        thick = radii[number] + share * (radii[number + 1] - radii[number])
        away = np.linalg.norm(way - share[:, None] * step, axis=1)
        found = np.minimum(found, away - thick)
    return found


def skin() -> Any:
    """(vertices, 3) world."""
    ball: Any = next(each for each in bpy.data.objects if each.type == "MESH")
    return np.array([ball.matrix_world @ vertex.co for vertex in ball.data.vertices])


@pytest.mark.parametrize(
    ("form", "most"),
    [
        ((1.0, 1.0, 1.0), 0.03),
        ((1.15, 0.9, 1.4), 0.075),
        ((0.9, 1.15, 1.4), 0.075),
        ((1.0, 0.6, 1.6), 0.15),
    ],
)
def test_a_body_that_is_wider_than_deep_is_taken_to_be_as_its_skin(
    form: tuple[float, float, float], most: float
) -> None:
    ((_, joints, radii),) = skin_parts(head((0.0, 0.0, 1.0), form), ["Head", "Bare"])
    left = np.abs(outside(skin(), joints, radii))
    assert left.max() < most
    assert np.median(left) < 0.6 * most


def test_a_body_that_goes_on_in_another_part_is_taken_to_reach_its_open_end() -> None:
    armature = head((0.0, 0.0, 1.0), (0.4, 0.4, 1.0))
    ball: Any = next(each for each in bpy.data.objects if each.type == "MESH")
    for vertex in ball.data.vertices:
        # A tube below, of which a ball's end is above.
        if vertex.co[2] < 0.0:
            side = np.array(vertex.co[:2])
            vertex.co[:2] = 0.2 * side / max(float(np.linalg.norm(side)), 1e-9)
    ((_, joints, radii),) = skin_parts(armature, ["Head", "Bare"])
    points = skin()
    assert outside(points, joints, radii).max() < 0.08
    assert (joints[:, 2] - radii).min() > points[:, 2].min() - 0.13
