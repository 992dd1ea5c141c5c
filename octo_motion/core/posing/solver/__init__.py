# SPDX-License-Identifier: GPL-3.0-or-later
"""What moves a puppet: one step of a rigid-body world with plastic joints and contacts."""

from .blas_threads import OneThread
from .holds import Coupling, HandSpring
from .obstacle_shapes import Box, Capsule, Hull, Mesh, Obstacle, Plane, Sphere
from .world import World, WorldSettings, WorldSnapshot

__all__ = [
    "Box",
    "Capsule",
    "Coupling",
    "HandSpring",
    "Hull",
    "Mesh",
    "Obstacle",
    "OneThread",
    "Plane",
    "Sphere",
    "World",
    "WorldSettings",
    "WorldSnapshot",
]
