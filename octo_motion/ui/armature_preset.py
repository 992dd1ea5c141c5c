# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators share that keep settings of an armature as a preset, Blender's own kind."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from bl_operators.presets import AddPresetBase

from ..blender.rig import active_armature
from ..core.errors import RigError

if TYPE_CHECKING:
    import bpy

ARMATURE = (
    "active = bpy.context.object",
    "armature = active if active.type == 'ARMATURE' else active.find_armature()",
)
"""First lines of a file: whose settings they are."""


class ArmaturePresetAdd(AddPresetBase):
    """Mix-in: name ``preset_menu``, ``preset_subdir`` and the ``preset_values`` of ``settings``.

    Files say whose settings they are about by the active object, as files of Blender's own do.
    What the user has at hand may as well be the armature's mesh, its route or a marker of a
    contact: while a file is written, the armature stands for it.
    """

    # A file stays when something else is undone.
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        try:
            active_armature(context)
        except RigError as error:
            cast("Any", cls).poll_message_set(str(error).rstrip("."))
            return False
        return True

    def execute(self, context: bpy.types.Context) -> Any:
        """Write the file, or remove it."""
        with context.temp_override(object=active_armature(context)):
            return super().execute(context)
