# SPDX-License-Identifier: GPL-3.0-or-later
"""``Object.octo_motion.splicing``: what splicing knows of an armature."""

from __future__ import annotations

from typing import Final, cast

import bpy

from ...blender.rig import armature_data
from ..overridable import PointerProperty
from ..override_groups import make_overridable
from .landmark_properties import OCTO_MOTION_PG_landmarks
from .splice_properties import SpliceStack


class OCTO_MOTION_PG_splicing(SpliceStack, bpy.types.PropertyGroup):
    """Settings of splicing, saved with the armature object."""

    landmarks: PointerProperty(
        name="Landmarks",
        description="Which bone is which part of the body",
        type=OCTO_MOTION_PG_landmarks,
    )


CLASSES: Final[tuple[type, ...]] = (OCTO_MOTION_PG_splicing,)


def splicing_settings(armature: bpy.types.Object) -> OCTO_MOTION_PG_splicing:
    """The settings of an armature object.

    Raises:
        RigError: the object is no armature.
    """
    armature_data(armature)
    make_overridable(armature)
    return cast("OCTO_MOTION_PG_splicing", armature.octo_motion.splicing)  # type: ignore[attr-defined]
