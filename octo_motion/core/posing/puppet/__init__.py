# SPDX-License-Identifier: GPL-3.0-or-later
"""What a puppet is: bodies, joints, their limits and materials."""

from .bone_roles import BODY, FOLLOW, SMALLEST, RigFacts, Roles, diagonal, find_roles
from .build import (
    DENSITY,
    FREE,
    SIZE,
    JointLimits,
    PosedBones,
    build_figure,
    joints_of,
    turned_bodies,
)
from .figure import Elements, Figure, JointRanges, Pose
from .joint_limits import _ONES, bends, slopes
from .kinematics import rest_pose
from .material_fit import Bend, MeasuredBend, measure_bend, measure_shown
from .materials import Material, elements_for, joint_loads, material_of
from .plastic_element import ElementResponse, PlasticLaw

__all__ = [
    "BODY",
    "DENSITY",
    "FOLLOW",
    "FREE",
    "SIZE",
    "SMALLEST",
    "_ONES",
    "Bend",
    "ElementResponse",
    "Elements",
    "Figure",
    "JointLimits",
    "JointRanges",
    "Material",
    "MeasuredBend",
    "PlasticLaw",
    "Pose",
    "PosedBones",
    "RigFacts",
    "Roles",
    "bends",
    "build_figure",
    "diagonal",
    "elements_for",
    "find_roles",
    "joint_loads",
    "joints_of",
    "material_of",
    "measure_bend",
    "measure_shown",
    "rest_pose",
    "slopes",
    "turned_bodies",
]
