# SPDX-License-Identifier: GPL-3.0-or-later
"""What a puppet is: bodies, joints, their limits and materials."""

from .bone_roles import BODY, FOLLOW, SMALLEST, RigFacts, Roles, diagonal, find_roles
from .build import FREE, SIZE, JointLimits, PosedBones, build_figure, joints_of, turned_bodies
from .figure import (
    Elements,
    Figure,
    Flags,
    Integers,
    Pose,
    capsules_in_world,
    closed,
    distances_to_axes,
    pose_of,
    rest_pose,
)
from .joint_limits import bends, slopes
from .materials import (
    Bend,
    JointCoefficients,
    Material,
    MeasuredBend,
    elements_for,
    joint_loads,
    material_of,
    measure_bend,
    measure_shown,
)
from .plastic_element import ElementResponse, PlasticLaw, law_of

__all__ = [
    "BODY",
    "FOLLOW",
    "FREE",
    "SIZE",
    "SMALLEST",
    "Bend",
    "ElementResponse",
    "Elements",
    "Figure",
    "Flags",
    "Integers",
    "JointCoefficients",
    "JointLimits",
    "Material",
    "MeasuredBend",
    "PlasticLaw",
    "Pose",
    "PosedBones",
    "RigFacts",
    "Roles",
    "bends",
    "build_figure",
    "capsules_in_world",
    "closed",
    "diagonal",
    "distances_to_axes",
    "elements_for",
    "find_roles",
    "joint_loads",
    "joints_of",
    "law_of",
    "material_of",
    "measure_bend",
    "measure_shown",
    "pose_of",
    "rest_pose",
    "slopes",
    "turned_bodies",
]
