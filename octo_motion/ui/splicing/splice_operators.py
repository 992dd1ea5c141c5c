# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of splices: added, removed, moved, built, timed."""

from __future__ import annotations

from itertools import chain, count
from typing import Any, Final, cast

import bpy
from bpy.props import EnumProperty, IntProperty, StringProperty

from ...blender.animation import (
    played_action,
    scene_rate,
    strips_alone,
    strips_of,
    writable_armature,
)
from ...blender.rig import active_armature
from ...core.errors import ClipError
from ...core.phrases import joined_phrases, phrase
from ...core.rotations import Floats
from ..declared_settings import assign
from ..language import reported, translated
from ..operator_base import (
    ItemOperator,
    ListKind,
    ListOperator,
    MoveOperator,
    RemoveOperator,
    window_manager,
)
from ..panel_base import ItemRows
from ..preferences import begin_as_preferred
from .live_splices import live_spliced
from .properties import PARTS, splicing_settings
from .stack import (
    ClipReader,
    ListedSpliceError,
    SpliceSummary,
    Stack,
    prepare_splices,
    read_between,
    suggestions,
    write_splices,
)

_SPARE_EASE: Final = 0.25
"""Of a clip's length: longer easing would leave little of a short clip."""


def add_splice(
    settings: Any,
    source: bpy.types.Object,
    action: bpy.types.Action,
    base_start: float,
    frames: Floats,
) -> Any:
    """Add a splice without a name to the list, of a source and its action.

    It begins at a frame of the base with the first of the clip's frames (frames,).
    """
    item = settings.splices.add()
    item.source, item.action = source, action
    item.base_start, item.splice_start = base_start, float(frames[0])
    ease = min(item.ease_in, _SPARE_EASE * float(frames[-1] - frames[0]))
    item.ease_in = item.ease_out = round(ease)
    spare = _SPARE_EASE * float(frames[-1] - frames[0]) / scene_rate()
    item.fade_in_seconds = item.fade_out_seconds = min(item.fade_in_seconds, spare)
    return item


def name_splice(settings: Any, item: Any) -> None:
    """Call a splice by its part and its clip, other than all others are called."""
    title = item.bone or item.bl_rna.properties["part"].enum_items[item.part].name
    name = f"{title}: {item.action.name}"
    taken = {each.name for each in settings.splices}
    numbered = (f"{name}.{number:03}" for number in count(1))
    item.name = next(each for each in chain((name,), numbered) if each not in taken)


class OCTO_MOTION_UL_splices(ItemRows, bpy.types.UIList):
    """A row for each splice: on or off, name, where it begins."""

    def draw_row(self, layout: bpy.types.UILayout, item: Any) -> None:
        row = layout.row(align=True)
        row.prop(item, "mute", text="", icon="HIDE_ON" if item.mute else "HIDE_OFF", emboss=False)
        name = row.row()
        name.active = not item.mute
        # Red: the source is gone.
        name.alert = item.source is None or item.action is None
        name.prop(item, "name", text="", emboss=False)
        start = row.row()
        start.alignment = "RIGHT"
        start.active = not item.mute
        start.label(text=f"{item.base_start:g}")


_SPLICES: Final = ListKind(
    settings=splicing_settings,
    check=writable_armature,
    items="splices",
    active="active_splice",
    one="a splice",
    instead="Mute it instead.",
)


def active_splice(settings: Any) -> Any:
    """The list's active splice, ``None`` in an empty list."""
    return _SPLICES.active_item(settings)


class _SelectsFailed(ListOperator):
    """Where a splice of the list cannot be built, that one becomes the active one."""

    KIND = _SPLICES

    def run(self, context: bpy.types.Context) -> None:
        # A pose that is only shown is none to be read.
        live_spliced.pause(active_armature(context))
        try:
            super().run(context)
        except ListedSpliceError as error:
            error.select()
            raise


class StackOperator(_SelectsFailed):
    """An operator on the stack of the active armature, and what else it has of splicing."""


class SpliceOperator(_SelectsFailed, ItemOperator):
    """An operator on the active splice."""


class OCTO_MOTION_OT_splice_add(StackOperator, bpy.types.Operator):
    bl_idname = "octo_motion.splice_add"
    bl_label = "Add Splice"
    bl_description = (
        "Add a part of another clip to the list. Select the armature with that clip, then Shift "
        "click the one that gets it; its action becomes the base. Without another armature you "
        "are asked for an action"
    )

    part: EnumProperty(
        name="Part", description="Which part of the body is taken", items=PARTS, default="RIGHT_ARM"
    )
    bone: StringProperty(
        name="First Bone",
        description="With the part Chain: its first bone; the active bone of pose mode if empty",
        options={"SKIP_SAVE"},
    )
    source: StringProperty(
        name="Source",
        description="Armature with the clip; the other selected one if empty, and if there is "
        "none, the active one itself",
        options={"SKIP_SAVE"},
    )
    action: StringProperty(
        name="Action",
        description="The clip; the source's own action if empty",
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:  # noqa: ARG002
        """Ask for a source if the selection names none."""
        if self.action or self.source or other_armatures(context):
            return self.execute(context)
        return window_manager(context).invoke_props_dialog(self)

    def draw(self, context: bpy.types.Context) -> None:
        layout = cast("Any", self).layout
        layout.use_property_split = True
        layout.prop(self, "part")
        if self.part == "CHAIN":
            layout.prop_search(self, "bone", active_armature(context).data, "bones")
        layout.prop_search(self, "source", bpy.data, "objects")
        layout.prop_search(self, "action", bpy.data, "actions")

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:
        base, base_slot = _base(armature, settings)
        source = self._source(context, armature)
        action, slot = self._action(source, armature)
        bone = self._bone(context, armature)
        reader = ClipReader()
        visual = settings.visual and settings.base is not None
        begins = reader.source(armature, base, base_slot, visual=visual).clip.frames[0]
        clip = reader.source(source, action, slot, visual=False).clip
        if settings.base is None:
            settings.base, settings.base_slot = base, base_slot
            begin_as_preferred(settings, {"result_as": "layer"})
        item = add_splice(settings, source, action, float(begins), clip.frames)
        item.part, item.bone, item.slot = self.part, bone, slot
        begin_as_preferred(item, {"fade_unit": "fade_unit"})
        name_splice(settings, item)
        settings.active_splice = len(settings.splices) - 1

    def _source(self, context: bpy.types.Context, armature: bpy.types.Object) -> bpy.types.Object:
        if self.source:
            found = bpy.data.objects.get(self.source)
            if found is None or found.type != "ARMATURE":
                raise ClipError(
                    phrase("There is no armature '{source}'.", source=self.source),
                    "Choose the armature of the clip.",
                )
            return found
        others = other_armatures(context)
        if len(others) > 1:
            raise ClipError(
                phrase("{count} other armatures are selected.", count=len(others)),
                "Select the one with the clip, then Shift click the one that gets it.",
            )
        if others:
            return others[0]
        if not self.action:
            raise ClipError(
                "No source is selected.",
                "Select the armature with the clip, then Shift click the one that gets it; or "
                "choose an action.",
            )
        return armature

    def _action(
        self, source: bpy.types.Object, armature: bpy.types.Object
    ) -> tuple[bpy.types.Action, str]:
        if self.action:
            action = bpy.data.actions.get(self.action)
            if action is None:
                raise ClipError(
                    phrase("There is no action '{action}'.", action=self.action),
                    "Choose the clip's action.",
                )
            return action, ""
        own = played_action(source)
        if own is None:
            raise no_action(
                source, phrase("The source '{source}' has no action.", source=source.name)
            )
        if source == armature:
            raise ClipError(
                phrase("'{source}' is both base and source.", source=source.name),
                "Choose the action of the source.",
            )
        return own

    def _bone(self, context: bpy.types.Context, armature: bpy.types.Object) -> str:
        if self.part != "CHAIN":
            return ""
        if self.bone:
            return self.bone
        active = context.active_pose_bone
        if active is None or active.id_data != armature:
            raise ClipError(
                "It is not said which chain.",
                "Click its first bone in pose mode, or enter its name.",
            )
        return active.name


class OCTO_MOTION_OT_splice_remove(RemoveOperator, bpy.types.Operator):
    bl_idname = "octo_motion.splice_remove"
    bl_label = "Remove Splice"
    bl_description = "Take the active splice off the list. Its clip stays as it is"
    KIND = _SPLICES


class OCTO_MOTION_OT_splice_move(MoveOperator, bpy.types.Operator):
    bl_idname = "octo_motion.splice_move"
    bl_label = "Move Splice"
    bl_description = (
        "Move the active splice in the list. Each goes onto the result of those above it"
    )
    KIND = _SPLICES


def other_armatures(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Selected armatures beside the active one."""
    active = active_armature(context)
    layer = context.view_layer
    assert layer is not None
    return [
        each
        for each in layer.objects
        if each.type == "ARMATURE" and each != active and each.select_get(view_layer=layer)
    ]


def _base(armature: bpy.types.Object, settings: Any) -> tuple[bpy.types.Action, str]:
    if settings.base is not None:
        return settings.base, settings.base_slot
    own = played_action(armature)
    if own is None:
        raise no_action(
            armature, phrase("'{armature}' has no action to splice onto.", armature=armature.name)
        )
    return own


def no_action(armature: bpy.types.Object, otherwise: str) -> ClipError:
    """Why no action of an armature's can be taken: its motion lies in the NLA, or as it is said."""
    if strips_of(armature):
        return strips_alone(armature)
    return ClipError(otherwise, "Give it one, or choose an action.")


# --- Building, and timing that is suggested -------------------------------------------------------


MOST_SUGGESTIONS: Final = 5


class OCTO_MOTION_OT_splice_build(StackOperator, bpy.types.Operator):
    bl_idname = "octo_motion.splice_build"
    bl_label = "Build Splices"
    bl_description = (
        "Put all splices of the list onto the base, as one new action. What was built before is "
        "made anew in place; an action that you have edited, the base and the clips are kept"
    )

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        stack = prepare_splices(armature)
        report_built(self, write_splices(stack, stack.compute()))
        live_spliced.made(armature)


class OCTO_MOTION_OT_splice_suggest_timing(SpliceOperator, bpy.types.Operator):
    bl_idname = "octo_motion.splice_suggest_timing"
    bl_label = "Suggest Timing"
    bl_description = (
        "Begin the active splice where the legs of base and clip do the same, and build. The best "
        "moments are told; choose another one in the panel of the last operation"
    )

    choice: IntProperty(
        name="Choice",
        description="Which of the suggestions to take, 1 is the best",
        default=1,
        min=1,
        max=MOST_SUGGESTIONS,
        options={"SKIP_SAVE"},
    )
    found: str = ""

    def draw(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        layout = cast("Any", self).layout
        layout.prop(self, "choice")
        for line in self.found.splitlines():
            layout.label(text=line)

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        number = settings.active_splice
        stack = prepare_splices(armature, between=False)
        found = suggestions(stack, number, MOST_SUGGESTIONS)
        chosen = found[min(self.choice, len(found)) - 1]
        starts = chosen.base_start, settings.splices[number].splice_start
        made = build_retimed(armature, settings, number, starts, stack)
        lines = [
            phrase(
                "{rank}: frame {start:g} ({cost:.2f} leg lengths apart)",
                rank=rank,
                start=each.base_start,
                cost=each.cost,
            )
            for rank, each in enumerate(found, 1)
        ]
        self.found = "\n".join(map(translated, lines))
        message = phrase(
            "Begins at {start:g}. Best first: {lines}.",
            start=chosen.base_start,
            lines=joined_phrases("; ", lines),
        )
        report_built(self, made, message)


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
    prepared = prepared or prepare_splices(armature, between=False)
    stack = read_between(prepared.retimed(number, *starts))
    motion = stack.compute()
    for name, start in zip(("base_start", "splice_start"), starts, strict=True):
        assign(settings.splices[number], name, start)
    summary = write_splices(stack, motion)
    live_spliced.made(armature)
    return summary


def report_built(operator: bpy.types.Operator, made: SpliceSummary, message: str = "") -> None:
    """Report what was made, and then, to stay on screen, what is to be looked at."""
    operator.report({"INFO"}, reported(message or made.message))
    for each in made.warnings:
        operator.report({"WARNING"}, reported(each))
