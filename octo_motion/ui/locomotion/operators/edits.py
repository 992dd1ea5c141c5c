# SPDX-License-Identifier: GPL-3.0-or-later
"""A layer for an artist's own keys over a generated motion."""

from __future__ import annotations

from typing import Any

import bpy

from ....blender.animation import edit_layer, lay_edits, writable_armature
from ....blender.rig import active_armature
from ....core.errors import SettingsError
from ....core.phrases import phrase
from ...language import reported
from ...operator_base import ArmatureOperator
from ..reading import playing_action, previous_action
from ..settings import locomotion_settings


class OCTO_MOTION_OT_edit_on_top(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.edit_on_top"
    bl_label = "Edit on Top"
    bl_description = (
        "Lay an action of your own over the generated motion: what you key from now on is added to "
        "it, and stays, in its cycle, when the motion is generated anew"
    )

    def run(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        armature = active_armature(bpy.context)
        writable_armature(armature)
        motion = previous_action(armature, locomotion_settings(armature))
        if motion is None:
            raise SettingsError(
                phrase("'{armature}' has no generated motion.", armature=armature.name),
                "Generate one first.",
            )
        if (layer := edit_layer(armature, motion)) is None:
            playing = playing_action(armature)
            if playing is not None and playing != motion:
                raise SettingsError(
                    phrase(
                        "'{armature}' plays '{playing}', and not '{motion}'.",
                        armature=armature.name,
                        playing=playing.name,
                        motion=motion.name,
                    ),
                    "Choose the motion in the Action Editor first.",
                )
            layer = lay_edits(armature, motion)
        told = phrase(
            "Keys go to '{layer}', over '{motion}'.", layer=layer.name, motion=motion.name
        )
        self.report({"INFO"}, reported(told))


def draw_edits(layout: Any, armature: bpy.types.Object, motion: bpy.types.Action) -> None:
    """The button, or the layer that is there."""
    layer = edit_layer(armature, motion)
    if layer is None:
        layout.operator(OCTO_MOTION_OT_edit_on_top.bl_idname, icon="ACTION_TWEAK")
    else:
        layout.label(text=layer.name, icon="ACTION_TWEAK", translate=False)
