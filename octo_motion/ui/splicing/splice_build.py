# SPDX-License-Identifier: GPL-3.0-or-later
"""The buttons that build the stack, and that ask for a timing."""

from __future__ import annotations

from typing import Any, Final

import bpy
from bpy.props import IntProperty

from ...core.splicing.transfer import Suggestion
from ..override_groups import assign
from .splice_list import SpliceOperator, StackOperator
from .stack import SpliceSummary, Stack, prepare_splices, suggestions, write_splices

MOST_SUGGESTIONS: Final = 5


def set_timing(item: Any, base_start: float, splice_start: float) -> None:
    """Set where a splice begins."""
    assign(item, "base_start", base_start)
    assign(item, "splice_start", splice_start)


class OCTO_MOTION_OT_splice_build(StackOperator, bpy.types.Operator):
    bl_idname = "octo_motion.splice_build"
    bl_label = "Build Splices"
    bl_description = (
        "Put all splices of the list onto the base, as one new action. What was built before is "
        "made anew in place; an action that you have edited, the base and the clips are kept"
    )
    bl_options = {"REGISTER", "UNDO"}

    def edit(
        self,
        context: bpy.types.Context,  # noqa: ARG002
        armature: bpy.types.Object,
        settings: Any,  # noqa: ARG002
    ) -> None:
        stack = prepare_splices(armature)
        tell(self, write_splices(stack, stack.compute()))


class OCTO_MOTION_OT_splice_suggest_timing(SpliceOperator, bpy.types.Operator):
    bl_idname = "octo_motion.splice_suggest_timing"
    bl_label = "Suggest Timing"
    bl_description = (
        "Begin the active splice where the legs of base and clip do the same, and build. The best "
        "moments are told; choose another one in the panel of the last operation"
    )
    bl_options = {"REGISTER", "UNDO"}

    choice: IntProperty(
        name="Choice",
        description="Which of the suggestions to take, 1 is the best",
        default=1,
        min=1,
        max=MOST_SUGGESTIONS,
        options={"SKIP_SAVE"},
    )
    told: str = ""

    def draw(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        layout = self.layout
        assert layout is not None
        layout.prop(self, "choice")
        for line in self.told.splitlines():
            layout.label(text=line)

    def edit(
        self,
        context: bpy.types.Context,  # noqa: ARG002
        armature: bpy.types.Object,
        settings: Any,
    ) -> None:
        number = settings.active_splice
        stack = prepare_splices(armature)
        found = suggestions(stack, number, MOST_SUGGESTIONS)
        chosen = found[min(self.choice, len(found)) - 1]
        stack = stack.retimed(number, chosen.base_start, chosen.splice_start)
        clip = stack.compute()
        set_timing(settings.splices[number], chosen.base_start, chosen.splice_start)
        made = write_splices(stack, clip)
        lines = [_line(rank, each) for rank, each in enumerate(found, 1)]
        self.told = "\n".join(lines)
        told = f"Begins at {chosen.base_start:g}. Best first: {'; '.join(lines)}."
        tell(self, made, told)


def _line(rank: int, found: Suggestion) -> str:
    return f"{rank}: frame {found.base_start:g} ({found.cost:.2f} leg lengths apart)"


def build_retimed(
    armature: bpy.types.Object,
    settings: Any,
    number: int,
    starts: tuple[float, float],
    prepared: Stack | None = None,
) -> SpliceSummary:
    """Set where a splice begins, on base and clip, and build.

    Raises:
        OctoMotionError: something is wrong that the user can put right; nothing has changed.
    """
    stack = (prepared or prepare_splices(armature)).retimed(number, *starts)
    clip = stack.compute()
    set_timing(settings.splices[number], *starts)
    return write_splices(stack, clip)


def tell(operator: bpy.types.Operator, made: SpliceSummary, message: str = "") -> None:
    """Report what was made, and then, to stay on screen, what is to be looked at."""
    operator.report({"INFO"}, message or made.message)
    for each in made.warnings:
        operator.report({"WARNING"}, each)


CLASSES: Final[tuple[type, ...]] = (
    OCTO_MOTION_OT_splice_build,
    OCTO_MOTION_OT_splice_suggest_timing,
)
