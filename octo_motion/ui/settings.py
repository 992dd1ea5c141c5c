# SPDX-License-Identifier: GPL-3.0-or-later
"""``Object.octo_motion``: the one property that the add-on gives to objects."""

from __future__ import annotations

from typing import Final

import bpy
from bpy.app.handlers import persistent

from .declared_settings import PointerProperty, make_overridable
from .locomotion import OCTO_MOTION_PG_contact, OCTO_MOTION_PG_locomotion
from .posing import OCTO_MOTION_PG_posing
from .splicing import OCTO_MOTION_PG_splicing


class OCTO_MOTION_PG_object(bpy.types.PropertyGroup):
    """All settings of an object, by feature."""

    locomotion: PointerProperty(
        name="Locomotion",
        description="How the armature walks or swims",
        type=OCTO_MOTION_PG_locomotion,
    )
    contact: PointerProperty(
        name="Contact",
        description="What a marker of a contact with the ground stands for",
        type=OCTO_MOTION_PG_contact,
    )
    splicing: PointerProperty(
        name="Splicing",
        description="What splicing knows of the armature",
        type=OCTO_MOTION_PG_splicing,
    )
    posing: PointerProperty(
        name="Posing",
        description="How the armature is posed by hand, and what stops it",
        type=OCTO_MOTION_PG_posing,
    )


CLASSES: Final = (OCTO_MOTION_PG_object,)


@persistent
def _before_saving(*_: object) -> None:
    for each in bpy.data.objects:
        if each.override_library is not None:
            make_overridable(each)


def register() -> None:
    """Give objects their settings."""
    bpy.types.Object.octo_motion = PointerProperty(  # type: ignore[attr-defined]
        name="Octo Motion",
        description="Settings of Octo Motion",
        type=OCTO_MOTION_PG_object,
    )
    bpy.app.handlers.save_pre.append(_before_saving)


def unregister() -> None:
    """Take the settings away."""
    bpy.app.handlers.save_pre.remove(_before_saving)
    del bpy.types.Object.octo_motion  # type: ignore[attr-defined]
