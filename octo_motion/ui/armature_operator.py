# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators on the active armature share."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..blender.rig import active_armature
from ..core.errors import RigError
from .operator_base import OctoOperator

if TYPE_CHECKING:
    import bpy


class ArmatureOperator(OctoOperator):
    """An operator on the armature that the user works on, see ``active_armature``."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode not in {"OBJECT", "POSE"}:
            # Undo in other modes takes back what was done in that mode, and nothing else.
            cls.poll_message_set("Go to object mode or pose mode first")  # type: ignore[attr-defined]
            return False
        try:
            active_armature(context)
        except RigError as error:
            cls.poll_message_set(str(error).rstrip("."))  # type: ignore[attr-defined]
            return False
        return True
