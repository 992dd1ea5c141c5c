# SPDX-License-Identifier: GPL-3.0-or-later
"""A body for an armature that has none: rounded limbs, trunk and head, in colours by part.

Each limb is a mesh of its own on its bone, made to the measure of the rest pose. What is what comes
from the landmarks, so any humanoid can be dressed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import bpy
import numpy as np
import stage
from mathutils import Matrix
from stage import Colour, Points

from octo_motion.blender.rig.armature import read_skeleton
from octo_motion.core.skeleton import Skeleton
from octo_motion.core.splicing.humanoid.landmarks import Landmarks
from octo_motion.core.splicing.humanoid.mapping import map_skeleton

_SIDES: Final = 20
_RINGS: Final = 7
"""Of each rounded end."""
_USUAL: Final = 1.7
"""Metres from sole to crown of the body that the thicknesses are meant for."""


@dataclass(frozen=True)
class _Shape:
    """A rounded body along a line, thicker or thinner at its end, wider across than deep."""

    bone: str
    """Landmark of the bone that carries it."""
    start: Points
    end: Points
    thick: tuple[float, float]
    """Radii at start and end, metres on a body of usual height."""
    wide: float = 1.0
    """Width across the body, as a multiple of the depth."""


def dress(armature: bpy.types.Object, colours: Mapping[str, Colour], usual: Colour) -> None:
    """Give an armature a body.

    Args:
        armature: a humanoid in a rest pose that one can stand in.
        colours: colour by part, such as ``"arm.R"``, ``"leg.L"``, ``"head"``, ``"trunk"``.
        usual: colour of all other parts.
    """
    skeleton = read_skeleton(armature)
    marks = map_skeleton(skeleton).landmarks
    size = _height(skeleton, marks) / _USUAL
    left = _left(skeleton, marks)
    for shape in _shapes(skeleton, marks, size):
        colour = colours.get(_part(shape.bone), usual)
        mesh = _mesh(shape, size, left, colour)
        limb = bpy.data.objects.new(f"{armature.name} {shape.bone}", mesh)
        stage.the_scene().collection.objects.link(limb)
        bone = skeleton.index[marks[shape.bone]]
        limb.parent, limb.parent_type, limb.parent_bone = armature, "BONE", skeleton.names[bone]
        # Children of bones hang on the tail.
        tail = Matrix.Translation((0.0, skeleton.lengths[bone], 0.0))
        rest = Matrix(skeleton.rest_matrices[bone].tolist()) @ tail
        limb.matrix_parent_inverse = rest.inverted()


def height(armature: bpy.types.Object) -> float:
    """From sole to crown, world units."""
    skeleton = read_skeleton(armature)
    scale = armature.matrix_world.median_scale
    return scale * _height(skeleton, map_skeleton(skeleton).landmarks)


def _part(landmark: str) -> str:
    kind, _, side = landmark.partition(".")
    if kind in {"clavicle", "upper_arm", "forearm", "hand"}:
        return f"arm.{side}"
    if kind in {"thigh", "shin", "foot", "toe"}:
        return f"leg.{side}"
    return "head" if kind in {"head", "neck"} else "trunk"


def _shapes(skeleton: Skeleton, marks: Landmarks, size: float) -> list[_Shape]:
    def head(landmark: str) -> Points:
        return skeleton.heads[skeleton.index[marks[landmark]]]

    def at(landmark: str, *others: str) -> Points:
        known = next(name for name in (landmark, *others) if marks.get(name))
        return head(known)

    hips = 0.5 * (head("thigh.L") + head("thigh.R"))
    chest, neck = head("chest"), at("neck", "head")
    waist = at("spine", "chest")
    up = (neck - hips) / np.linalg.norm(neck - hips)
    front = np.cross(_left(skeleton, marks), up)
    shoulders = 0.5 * (head("upper_arm.L") + head("upper_arm.R"))
    skull = head("head")
    crown = skull + 0.215 * size * up
    middle = 0.5 * (waist + chest)
    shapes = [
        _Shape("hips", hips - 0.01 * size * up, waist, (0.098, 0.09), 1.45),
        _Shape("spine" if marks.get("spine") else "hips", waist, chest, (0.088, 0.094), 1.35),
        _Shape("chest", middle, shoulders - 0.02 * size * up, (0.094, 0.098), 1.66),
        _Shape(
            "neck" if marks.get("neck") else "head", neck - 0.04 * size * up, skull, (0.052, 0.048)
        ),
        _Shape(
            "head",
            skull + 0.05 * size * up + 0.012 * size * front,
            crown - 0.07 * size * up,
            (0.072, 0.086),
            0.92,
        ),
        # A nose, so that one sees where the head faces.
        _Shape(
            "head",
            skull + (0.075 * up + 0.075 * front) * size,
            skull + (0.07 * up + 0.098 * front) * size,
            (0.016, 0.014),
        ),
    ]
    for side in "LR":
        elbow, wrist = head(f"forearm.{side}"), head(f"hand.{side}")
        along = (wrist - elbow) / np.linalg.norm(wrist - elbow)
        ankle = head(f"foot.{side}")
        ground = ankle - 0.055 * size * up
        toes = ground + 0.17 * size * front
        shapes += [
            _Shape(f"upper_arm.{side}", head(f"upper_arm.{side}"), elbow, (0.052, 0.04)),
            _Shape(f"forearm.{side}", elbow, wrist, (0.041, 0.03)),
            _Shape(
                f"hand.{side}",
                wrist + 0.03 * size * along,
                wrist + 0.11 * size * along,
                (0.034, 0.03),
            ),
            _Shape(f"thigh.{side}", head(f"thigh.{side}"), head(f"shin.{side}"), (0.085, 0.056)),
            _Shape(f"shin.{side}", head(f"shin.{side}"), ankle, (0.057, 0.037)),
            _Shape(f"foot.{side}", ground - 0.03 * size * front, toes, (0.037, 0.03), 1.15),
        ]
    return shapes


def _height(skeleton: Skeleton, marks: Landmarks) -> float:
    names = ("foot.L", "shin.L", "thigh.L", "chest", "head")
    joints = skeleton.heads[[skeleton.index[marks[name]] for name in names]]
    # Ankle and crown lie beyond the outermost joints.
    return 1.22 * float(np.linalg.norm(np.diff(joints, axis=0), axis=1).sum())


def _left(skeleton: Skeleton, marks: Landmarks) -> Points:
    one, other = (skeleton.heads[skeleton.index[marks[f"thigh.{side}"]]] for side in "LR")
    return (one - other) / np.linalg.norm(one - other)


def _mesh(shape: _Shape, size: float, left: Points, colour: Colour) -> bpy.types.Mesh:
    first, last = (radius * size for radius in shape.thick)
    axis = shape.end - shape.start
    length = float(np.linalg.norm(axis))
    axis = axis / length
    across = left - (left @ axis) * axis
    if np.linalg.norm(across) < 0.3:
        across = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [0.0, 1.0, 0.0])
    across = across / np.linalg.norm(across)
    deep = np.cross(axis, across)
    bow = np.linspace(0.0, 0.5 * np.pi, _RINGS)
    # Rings from near one pole to near the other.
    places = np.concatenate([-first * np.cos(bow[1:]), length + last * np.sin(bow[:-1])])
    radii = np.concatenate([first * np.sin(bow[1:]), last * np.cos(bow[:-1])])
    angles = np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False)
    circle = shape.wide * np.cos(angles)[:, None] * across + np.sin(angles)[:, None] * deep
    rings = shape.start + places[:, None, None] * axis + radii[:, None, None] * circle
    poles = np.stack([shape.start - first * axis, shape.end + last * axis])
    vertices = np.concatenate([rings.reshape(-1, 3), poles])
    count = len(places)
    low, high = count * _SIDES, count * _SIDES + 1
    faces: list[tuple[int, ...]] = []
    for side in range(_SIDES):
        after = (side + 1) % _SIDES
        faces.append((low, after, side))
        faces.append((high, (count - 1) * _SIDES + side, (count - 1) * _SIDES + after))
        faces += [
            (
                at * _SIDES + side,
                at * _SIDES + after,
                (at + 1) * _SIDES + after,
                (at + 1) * _SIDES + side,
            )
            for at in range(count - 1)
        ]
    mesh = bpy.data.meshes.new(shape.bone)
    mesh.from_pydata(vertices.tolist(), [], faces)
    mesh.polygons.foreach_set("use_smooth", np.ones(len(mesh.polygons), dtype=bool))
    mesh.materials.append(stage.new_material(shape.bone, colour, roughness=0.7))
    return mesh
