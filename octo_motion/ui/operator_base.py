# SPDX-License-Identifier: GPL-3.0-or-later
"""What all operators share: our errors become Blender's reports."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..core.errors import OctoMotionError

if TYPE_CHECKING:
    import bpy
    from bpy.stub_internal.rna_enums import OperatorReturnItems


class OctoOperator:
    """Mix-in for operators: write ``run``, and raise ``OctoMotionError`` before changing anything.

    An error that a user can put right becomes one report and ``CANCELLED``. Anything else is a
    fault of ours and surfaces as Python's own traceback.
    """

    def run(self, context: bpy.types.Context) -> None:
        """Do the work, or raise ``OctoMotionError`` and leave everything as it was."""
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[OperatorReturnItems]:
        """Blender's entry point."""
        try:
            self.run(context)
        except OctoMotionError as error:
            self.report({"ERROR"}, str(error))  # type: ignore[attr-defined]
            return {"CANCELLED"}
        return {"FINISHED"}
