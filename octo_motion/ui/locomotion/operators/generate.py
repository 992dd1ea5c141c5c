# SPDX-License-Identifier: GPL-3.0-or-later
"""The button that makes the armature walk: read → plain arrays → compute → write."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import bpy

from ....blender.rig import active_armature
from ....core.errors import OctoMotionError
from ...modal_job import ModalJob
from ...operator_base import ArmatureOperator
from ..writing import Shot, Summary, generate_locomotion, prepare
from . import live

if TYPE_CHECKING:
    from bpy.stub_internal.rna_enums import OperatorReturnItems

PATIENCE: Final = 1.5
"""Seconds that the window may stand still; a longer job shows its progress and can be stopped."""


class OCTO_MOTION_OT_generate_locomotion(ModalJob, ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.generate_locomotion"
    bl_label = "Generate Locomotion"
    bl_description = (
        "Let the armature walk or swim along its route. What was generated before is made anew "
        "in place; an action that you have edited is kept, and a new one is made"
    )
    bl_options = {"REGISTER", "UNDO"}

    _shot: Shot | None = None

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        self._tell(generate_locomotion(armature, context))
        live.made(armature)

    def invoke(
        self,
        context: bpy.types.Context,
        event: bpy.types.Event,  # noqa: ARG002
    ) -> set[OperatorReturnItems]:
        """Run at once if that is quick, else go on with progress and Esc."""
        try:
            self._shot = prepare(active_armature(context), context)
        except OctoMotionError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return self.begin(context, self._shot.compute(), PATIENCE)

    def conclude(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        assert self._shot is not None
        self._tell(self._shot.write())
        live.made(bpy.data.objects[self._shot.armature, None])  # type: ignore[index]

    def status(self, progress: float) -> str:
        return f"Generating locomotion: {100.0 * progress:.0f} %    Esc: stop"

    def _tell(self, summary: Summary) -> None:
        self.report({"INFO"}, summary.message)
        # Blender's status bar keeps the last, which is to be the one that says most.
        for warning in reversed(summary.warnings):
            self.report({"WARNING"}, warning)
