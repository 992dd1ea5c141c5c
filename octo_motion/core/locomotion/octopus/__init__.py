# SPDX-License-Identifier: GPL-3.0-or-later
"""The creature that comes with the add-on: bones, skin and weights."""

from .mesh import build_mesh
from .rig import ARM_COLLECTIONS, FIRST_ARM_BONE, SUCKER_AXIS, OctopusBones, build_bones
from .shape import ARMS, JOINTS, WEB, OctopusShape
from .surface import OctopusMesh, SkinMaterial

__all__ = [
    "ARMS",
    "ARM_COLLECTIONS",
    "FIRST_ARM_BONE",
    "JOINTS",
    "SUCKER_AXIS",
    "WEB",
    "OctopusBones",
    "OctopusMesh",
    "OctopusShape",
    "SkinMaterial",
    "build_bones",
    "build_mesh",
]
