# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that puppets push about: each a body of the simulation, and its own transform."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import bpy
import numpy as np
from mathutils import Matrix

from ...core.errors import RigError, WriteError
from ...core.phrases import phrase
from ...core.posing.puppet import DENSITY, Figure, Pose, inertia_of, solid_moments, thing
from ...core.posing.solver import Box, Capsule, Hull, Obstacle, Plane, Sphere
from ...core.rotations import Floats, from_matrix, to_matrix
from ..rig import acts
from .surfaces import read_obstacle

_WOOD: Final = 0.5
"""Of a puppet's density, where no mass is said."""
_LIGHTEST: Final = 1e-6
"""Of what a cube of water weighs that is as large as a puppet."""
_HEAVIEST: Final = 1e4
_FLATTEST: Final = 1e-3
"""Of its size: for inertia nothing counts as thinner, or it would spin without end."""
_CHANNELS: Final = (
    *("location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle", "scale"),
)

Transform = tuple[tuple[float, ...], ...]


class LooseObject:
    """A local object that can be pushed about, whatever it is called meanwhile.

    Raises:
        RigError: it has no size, no surface, no end, or something else moves it.
        WriteError: it is linked.
    """

    def __init__(
        self, item: bpy.types.Object, kind: str, unit: float, *, mass: float, heavy: bool
    ) -> None:
        """Of an object that is taken for a shape, with a mass, kg, 0 for one of wood, which has
        weight or floats.
        """
        if item.library is not None or not item.is_editable:
            raise WriteError(
                phrase("'{item}' is linked and cannot be pushed about.", item=item.name),
                "Make a library override, or let it stand still (Pose > World).",
            )
        if any(acts(each) for each in item.constraints):
            raise RigError(
                phrase("Constraints hold '{item}': it cannot be pushed about.", item=item.name),
                "Mute them, or let it stand still (Pose > World).",
            )
        shape = read_obstacle(item, "HULL" if kind == "MESH" else kind, unit)
        if isinstance(shape, Plane):
            raise RigError(
                phrase(
                    "'{item}' is marked as a plane, which has no end and cannot be pushed about.",
                    item=item.name,
                ),
                "Mark it as a box, or let it stand still (Pose > World).",
            )
        self.name = item.name
        self._number = item.session_uid
        self._unit = unit
        given = mass * unit**3 if mass > 0.0 else 0.0
        self.figure, self.pose, self._shape = _body_of(item.name, shape, given, heavy=heavy)
        self._world = _world_of(item)
        self._start = self._written = self.pose
        self.before = transform_of(item)
        """What it was like at first, for ``restore``."""

    def found(self) -> bpy.types.Object:
        """The object, as it is now.

        Raises:
            RigError: it is gone.
        """
        found = bpy.data.objects.get((self.name, None))
        if found is None or found.session_uid != self._number:
            everything = (each for each in bpy.data.objects if each.session_uid == self._number)
            found = next(everything, None)
        if found is None:
            raise RigError(phrase("'{name}' is gone.", name=self.name), "Start posing again.")
        self.name = found.name
        return found

    def shape(self, body: int) -> Obstacle | None:
        """The shape that a body of the simulation has as this object; None where its capsule is."""
        return None if self._shape is None else replace(self._shape, body=body)

    def read(self) -> Pose:
        """Where it is, as it is shown now."""
        moved = _world_of(self.found()) @ np.linalg.inv(self._world)
        turn, place = _rigid(moved)
        pose = Pose(
            self._start.positions @ turn.T + place * self._unit,
            from_matrix(turn @ to_matrix(self._start.orientations)),
        )
        self._written = pose
        return pose

    def write(self, pose: Pose) -> bool:
        """Put it where its body is; whether it had to be moved."""
        same = np.array_equal(pose.positions, self._written.positions)
        if same and np.array_equal(pose.orientations, self._written.orientations):
            return False
        item = self.found()
        turn = to_matrix(pose.orientations[0]) @ to_matrix(self._start.orientations[0]).T
        moved = np.eye(4)
        moved[:3, :3] = turn
        moved[:3, 3] = (pose.positions[0] - turn @ self._start.positions[0]) / self._unit
        scale = item.scale.copy()
        item.matrix_world = Matrix((moved @ self._world).tolist())
        # Turning and scaling are told apart to rounding alone.
        item.scale = scale
        self._written = pose
        return True

    def restore(self) -> None:
        """Put it back to where it was at first."""
        put_transform(self.found(), self.before)


def transform_of(item: bpy.types.Object) -> Transform:
    """The values of an object's own transform."""
    return tuple(tuple(getattr(item, each)) for each in _CHANNELS)


def put_transform(item: bpy.types.Object, values: Transform) -> None:
    """Give an object values of ``transform_of``."""
    for channel, value in zip(_CHANNELS, values, strict=True):
        setattr(item, channel, value)


def _world_of(item: bpy.types.Object) -> Floats:
    shown: Any = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array(shown.matrix_world, dtype=np.float64)


def _rigid(matrix: Floats) -> tuple[Floats, Floats]:
    """The rotation (3, 3) and the place (3,) of a matrix that may have scaled since."""
    left, _, right = np.linalg.svd(matrix[:3, :3])
    return left @ right, matrix[:3, 3]


def _body_of(
    name: str, shape: Obstacle, mass: float, *, heavy: bool
) -> tuple[Figure, Pose, Obstacle | None]:
    """The body, where its frame is, and its shape in that frame where it is no capsule."""
    frame, place = shape.orientation, shape.position
    own: Obstacle | None = None
    if isinstance(shape, Hull):
        volume, middle, second = solid_moments(shape.corners)
        own = Hull(corners=shape.corners - middle)
        ends, radius = _inside(own.bounds)
        place = middle
    elif isinstance(shape, Box):
        volume, own = 8.0 * float(shape.half.prod()), Box(half=shape.half)
        second = volume / 3.0 * np.diag(shape.half**2)
        ends, radius = _inside(own.bounds)
    else:
        assert isinstance(shape, Sphere | Capsule)
        ends = shape.ends if isinstance(shape, Capsule) else np.zeros((2, 3))
        radius = shape.radius
        volume, second = _rod(ends, radius)
    weight = mass or _WOOD * DENSITY * volume
    weight = min(max(weight, _LIGHTEST * DENSITY), _HEAVIEST * DENSITY)
    size = float(np.ptp(shape.bounds, axis=0).max())
    second = second / max(volume, 1e-300) + (_FLATTEST * size) ** 2 * np.eye(3)
    figure = thing(name, weight, inertia_of(weight * second), ends, radius, heavy=heavy)
    return figure, Pose(place[None].copy(), frame[None].copy()), own


def _inside(bounds: Floats) -> tuple[Floats, float]:
    """Ends (2, 3) and radius of a capsule within bounds: by it, it is picked."""
    half, middle = 0.5 * (bounds[1] - bounds[0]), bounds.mean(axis=0)
    along = int(np.argmax(half))
    radius = float(half.min())
    ends = np.tile(middle, (2, 1))
    ends[0, along] -= half[along] - radius
    ends[1, along] += half[along] - radius
    return ends, radius


def _rod(ends: Floats, radius: float) -> tuple[float, Floats]:
    """Volume and ∫ r rᵀ (3, 3) about the middle of a capsule with ends (2, 3), or a ball."""
    way = ends[1] - ends[0]
    length = float(np.linalg.norm(way))
    axis = way / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    tube, ball = np.pi * radius**2 * length, 4.0 / 3.0 * np.pi * radius**3
    across = 0.25 * tube * radius**2 + 0.2 * ball * radius**2
    along = tube * length**2 / 12.0 + ball * (
        0.2 * radius**2 + 0.25 * length**2 + 0.375 * length * radius
    )
    both = np.outer(axis, axis)
    return tube + ball, across * (np.eye(3) - both) + along * both
