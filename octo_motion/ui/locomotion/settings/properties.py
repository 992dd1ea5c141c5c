# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of locomotion, which live on the armature object: ``octo_motion.locomotion``.

Their names are what scripts use. What core reads is declared beside core's own field, see
core/settings.py.
"""

from __future__ import annotations

from typing import Final, cast

import bpy

from ....blender.rig import armature_data
from ...overridable import PointerProperty
from ...override_groups import make_overridable
from .arms import ArmList
from .changes import OCTO_MOTION_PG_change
from .ground import OCTO_MOTION_PG_ground
from .in_place import InPlace
from .keep_apart import KeepingApart
from .live import LiveSettings
from .movement import Movement
from .quality import QualityReport
from .reaches import Reaches
from .route import RouteSettings
from .timing import Keys, Timing


class OCTO_MOTION_PG_locomotion(
    ArmList,
    RouteSettings,
    Movement,
    Reaches,
    Timing,
    InPlace,
    Keys,
    KeepingApart,
    QualityReport,
    LiveSettings,
    bpy.types.PropertyGroup,
):
    """How an armature walks or swims along a route."""

    ground: PointerProperty(
        name="Ground",
        description="What a walking creature stands on, and how",
        type=OCTO_MOTION_PG_ground,
    )
    change: PointerProperty(
        name="Change of Gait",
        description="Where along the route the gait changes",
        type=OCTO_MOTION_PG_change,
    )


CLASSES: Final = (OCTO_MOTION_PG_locomotion,)


def locomotion_settings(armature: bpy.types.Object) -> OCTO_MOTION_PG_locomotion:
    """The settings of an armature object.

    Raises:
        RigError: the object is no armature.
    """
    armature_data(armature)
    make_overridable(armature)
    return cast("OCTO_MOTION_PG_locomotion", armature.octo_motion.locomotion)  # type: ignore[attr-defined]
