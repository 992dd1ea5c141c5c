# SPDX-License-Identifier: GPL-3.0-or-later
"""The material that was measured: kept in the armature's settings, or with a bone for it alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import bpy
import numpy as np

from ...blender.rig import armature_data, bone_materials, set_bone_material
from ...core.errors import RigError
from ...core.posing.puppet import (
    Bend,
    Figure,
    Material,
    MeasuredBend,
    joint_loads,
    material_of,
    measure_bend,
)
from .properties import posing_settings

CUSTOM: Final = "CUSTOM"
NAMES: Final = (
    *("material", "custom_yields", "custom_bears", "custom_springs"),
    *("custom_settles", "custom_gives"),
)
"""The settings that hold it."""


def chosen_material(settings: Any) -> str | Material:
    """What a figure is made of, for ``elements_for``.

    Args:
        settings: the armature's, or anything with the same names.
    """
    if settings.material != CUSTOM:
        return settings.material.lower()
    yields = settings.custom_yields
    return Material(
        bears=settings.custom_bears if yields else float(np.inf),
        springs=settings.custom_springs,
        settles=settings.custom_settles,
        gives=settings.custom_gives if yields else 0.0,
    )


def measured_joint(
    figure: Figure, body: int, strength: float, bend: Bend
) -> tuple[MeasuredBend, Material]:
    """Coefficients of a joint that does what a bend says, and the material that has them.

    Args:
        figure: the puppet.
        body: whose joint it is.
        strength: of the settings.
        bend: its torques in loads of the joint.

    Raises:
        RigError: the body hangs on nothing.
        SettingsError: the bend makes no sense.
    """
    if figure.parents[body] < 0:
        raise RigError(
            f"'{figure.names[body]}' hangs on no other limb, so it has no joint to bend.",
            "Choose a limb further out.",
        )
    load = strength * float(joint_loads(figure)[body])
    torques = {"torque": bend.torque * load, "bears": bend.bears * load}
    measured = measure_bend(Bend(**{**vars(bend), **torques}))
    return measured, material_of(measured, load)


def keep_material(armature: bpy.types.Object, settings: Any, material: Material, bone: str) -> None:
    """Make the figure of a material, or one bone's joint.

    Args:
        armature: the armature object.
        settings: its own of posing.
        material: the new one.
        bone: the one that it is for; empty for all.

    Raises:
        WriteError: the bones are linked.
    """
    if bone:
        set_bone_material(armature, bone, material)
        return
    settings.material = CUSTOM
    settings.custom_yields = bool(np.isfinite(material.bears))
    if settings.custom_yields:
        settings.custom_bears = material.bears
        settings.custom_gives = material.gives
    settings.custom_springs = material.springs
    settings.custom_settles = material.settles


def kept_before(
    armature: bpy.types.Object, settings: Any, bone: str
) -> Callable[[bpy.types.Object], None]:
    """What puts back the armature's material of now; asked for before ``keep_material``."""
    values = {each: getattr(settings, each) for each in NAMES}
    own = bone_materials(armature).get(bone)

    def put_back(armature: bpy.types.Object) -> None:
        if bone:
            if bone in armature_data(armature).bones:
                set_bone_material(armature, bone, own)
            return
        now = posing_settings(armature)
        for each, value in values.items():
            setattr(now, each, value)

    return put_back


def coefficients(bone: str, measured: MeasuredBend) -> str:
    """The coefficients, for people."""
    text = f"{bone}: K_f {measured.stiffness:.3g} N·m/rad, D_f {measured.damping:.3g} N·m·s/rad"
    if not np.isfinite(measured.yield_torque):
        return text + ", never gives way"
    return text + f", D_d {measured.flow:.3g} N·m·s/rad, yields at {measured.yield_torque:.3g} N·m"
