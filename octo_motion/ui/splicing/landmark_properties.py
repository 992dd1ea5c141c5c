# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bone of an armature is which part of the body, as it is saved with the armature object."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import bpy

from ...core.splicing.humanoid import LANDMARKS, Landmarks
from ..overridable import StringProperty


def _bone(name: str, description: str) -> Any:
    return StringProperty(name=name, description=description)


class OCTO_MOTION_PG_landmarks(bpy.types.PropertyGroup):
    """One bone name for each landmark; empty where the rig has none."""

    hips: _bone("Hips", "Bone of the pelvis, which carries legs and trunk")
    spine: _bone("Spine", "Lowest bone above the pelvis that bends the trunk, if there is one")
    chest: _bone("Chest", "Bone that carries neck and shoulders")
    neck: _bone("Neck", "Lowest bone of the neck, if there is one")
    head: _bone("Head", "Bone of the head")
    clavicle_l: _bone("Left Collar Bone", "Bone from the chest to the left shoulder, if any")
    upper_arm_l: _bone("Left Upper Arm", "Bone that begins at the left shoulder")
    forearm_l: _bone("Left Forearm", "Bone that begins at the left elbow")
    hand_l: _bone("Left Hand", "Bone that begins at the left wrist")
    thigh_l: _bone("Left Thigh", "Bone that begins at the left hip")
    shin_l: _bone("Left Shin", "Bone that begins at the left knee")
    foot_l: _bone("Left Foot", "Bone that begins at the left ankle")
    toe_l: _bone("Left Toes", "Bone that begins at the ball of the left foot, if there is one")
    clavicle_r: _bone("Right Collar Bone", "Bone from the chest to the right shoulder, if any")
    upper_arm_r: _bone("Right Upper Arm", "Bone that begins at the right shoulder")
    forearm_r: _bone("Right Forearm", "Bone that begins at the right elbow")
    hand_r: _bone("Right Hand", "Bone that begins at the right wrist")
    thigh_r: _bone("Right Thigh", "Bone that begins at the right hip")
    shin_r: _bone("Right Shin", "Bone that begins at the right knee")
    foot_r: _bone("Right Foot", "Bone that begins at the right ankle")
    toe_r: _bone("Right Toes", "Bone that begins at the ball of the right foot, if there is one")


PROPERTIES: Final = {each: each.replace(".", "_").lower() for each in LANDMARKS}
"""Name of the property by landmark: "upper_arm.L" is ``upper_arm_l``."""


def title(landmark: str) -> str:
    """What the table calls a landmark: "left hand"."""
    definition = OCTO_MOTION_PG_landmarks.bl_rna.properties[PROPERTIES[landmark]]
    return definition.name.lower()


def read_landmarks(group: Any) -> Landmarks:
    """The table as core's landmarks, whether the bones exist or not."""
    bones = {each: getattr(group, name) for each, name in PROPERTIES.items()}
    return Landmarks({each: bone for each, bone in bones.items() if bone})


def write_landmarks(group: Any, bones: Mapping[str, str]) -> None:
    """Fill the table; landmarks that are not named become empty."""
    for landmark, name in PROPERTIES.items():
        setattr(group, name, bones.get(landmark, ""))


CLASSES: Final[tuple[type, ...]] = (OCTO_MOTION_PG_landmarks,)
