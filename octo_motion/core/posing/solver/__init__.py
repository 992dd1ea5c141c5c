# SPDX-License-Identifier: GPL-3.0-or-later
"""What moves a puppet: one step of a rigid-body world with plastic joints and contacts."""

from .blas_threads import OneThread
from .carried_world import CarriedThings, CarriedWorld, Leading
from .contact_detection import CarriedCapsules
from .holds import Coupling, HandSpring
from .obstacle_shapes import (
    Box,
    Capsule,
    Hull,
    Mesh,
    Obstacle,
    Plane,
    Sphere,
    nearest_on_segments,
)
from .world import World, WorldSettings, WorldSnapshot

__all__ = [
    "Box",
    "Capsule",
    "CarriedCapsules",
    "CarriedThings",
    "CarriedWorld",
    "Coupling",
    "HandSpring",
    "Hull",
    "Leading",
    "Mesh",
    "Obstacle",
    "OneThread",
    "Plane",
    "Sphere",
    "World",
    "WorldSettings",
    "WorldSnapshot",
    "nearest_on_segments",
]
