# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons of follow-through: the motion itself, and the list of chains."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, cast

import bpy

from ...blender.rig import (
    active_armature,
    read_skeleton,
    require_editable,
    select_pose_bones,
    selected_bones,
)
from ...core.errors import OctoMotionError, RigError
from ...core.follow_through import Chain, between, chains_of, find_loose
from ...core.phrases import phrase
from ...core.skeleton import Skeleton
from ..language import reported
from ..modal_job import ModalJob
from ..operator_base import (
    ArmatureOperator,
    ItemOperator,
    ListKind,
    ListOperator,
    RemoveOperator,
    window_manager,
)
from ..panel_base import ItemRows
from .following import FollowSession, FollowSummary
from .properties import follow_settings

_CHAINS = ListKind(
    settings=follow_settings,
    check=require_editable,
    items="chains",
    active="active_chain",
    one="a chain",
    instead="Untick it instead.",
)
_PATIENCE = 0.5
"""Seconds that the window may stand still."""


class OCTO_MOTION_OT_follow_through(ModalJob, ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.follow_through"
    bl_label = "Follow Through"
    bl_description = (
        "Let the chains of the list, or the selected bones if it is empty, follow the armature's "
        "action: they lag, swing, stop at what is in their way and settle. The action itself stays "
        "as it is. What was made before is made anew in place"
    )

    _session: FollowSession | None = None

    def run(self, context: bpy.types.Context) -> None:
        session = FollowSession(active_armature(context))
        manager = window_manager(context)
        manager.progress_begin(0.0, 1.0)
        try:
            for share in session.steps():
                manager.progress_update(share)
        finally:
            manager.progress_end()
        self._tell(session.end())

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:  # noqa: ARG002
        """Run at once if that is quick, else go on with progress and Esc."""
        try:
            self._session = FollowSession(active_armature(context))
        except OctoMotionError as error:
            self.report({"ERROR"}, reported(error))
            return {"CANCELLED"}
        return self.begin(context, self._session.steps(), _PATIENCE)

    def conclude(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        assert self._session is not None
        self._tell(self._session.end())

    def status(self, progress: float) -> str:
        return phrase("Follow-through: {percent:.0f} %    Esc: stop", percent=100.0 * progress)

    def _tell(self, summary: FollowSummary) -> None:
        self.report({"INFO"}, reported(summary.message))
        for warning in summary.warnings:
            self.report({"WARNING"}, reported(warning))


class _ChainOperator(ListOperator):
    KIND = _CHAINS


class OCTO_MOTION_OT_follow_add(_ChainOperator, bpy.types.Operator):
    bl_idname = "octo_motion.follow_add"
    bl_label = "Add Selected Bones"
    bl_description = "Add the bones that are selected in pose mode, as chains"

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        skeleton = read_skeleton(armature)
        picked = [skeleton.index[each] for each in selected_bones(armature)]
        if not picked:
            raise RigError("No bones are selected.", "Select some in pose mode.")
        add_chains(settings, skeleton, chains_of(skeleton, picked))


class OCTO_MOTION_OT_follow_find(_ChainOperator, bpy.types.Operator):
    bl_idname = "octo_motion.follow_find"
    bl_label = "Find Loose Bones"
    bl_description = (
        "Add the chains whose names say that they hang and swing: tails, ears, hair, cloth, "
        "antennae; and the outer thirds of the arms that the panel Arms has"
    )

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        find_chains(armature, settings)


class OCTO_MOTION_OT_follow_remove(RemoveOperator, bpy.types.Operator):
    bl_idname = "octo_motion.follow_remove"
    bl_label = "Remove Chain"
    bl_description = "Take the chain off the list. The bones themselves stay"
    KIND = _CHAINS


class OCTO_MOTION_OT_follow_select(ItemOperator, bpy.types.Operator):
    bl_idname = "octo_motion.follow_select"
    bl_label = "Select Bones"
    bl_description = "Select the chain's bones in pose mode"
    KIND = _CHAINS

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        skeleton, item = read_skeleton(armature), settings.chains[settings.active_chain]
        ends = [skeleton.index.get(each) for each in (item.name, item.last or item.name)]
        if None in ends:
            raise RigError(
                phrase("There is no bone '{name}'.", name=item.name), "Choose the bones again."
            )
        first, last = cast("list[int]", ends)
        names = [skeleton.names[each] for each in between(skeleton, first, last)]
        select_pose_bones(armature, names)


class OCTO_MOTION_UL_follow_chains(ItemRows, bpy.types.UIList):
    def draw_row(self, layout: bpy.types.UILayout, item: Any) -> None:
        row: Any = layout.row(align=True)
        row.prop(item, "use", text="")
        ends = item.name if item.last in {"", item.name} else f"{item.name} … {item.last}"
        row.label(text=ends, translate=False)
        row.prop(item, "strength", text="", emboss=False)


def add_chains(settings: Any, skeleton: Skeleton, chains: Iterable[Chain]) -> None:
    """Add chains that the list does not have yet."""
    known = {each.name for each in settings.chains}
    for chain in chains:
        first, last = skeleton.names[chain[0]], skeleton.names[chain[-1]]
        if first in known:
            continue
        item = settings.chains.add()
        item.name, item.last = first, last
        settings.active_chain = len(settings.chains) - 1


def find_chains(armature: bpy.types.Object, settings: Any) -> None:
    """List the chains whose names say that they hang and swing, and outer thirds of arms.

    Raises:
        RigError: there are none.
    """
    skeleton = read_skeleton(armature)
    found = [*find_loose(skeleton), *_outer_thirds(armature, skeleton)]
    if not found:
        raise RigError(
            phrase(
                "No bone of '{armature}' has a name such as Tail, Ear, Hair or Cape.",
                armature=armature.name,
            ),
            "Select bones in pose mode, and add them.",
        )
    add_chains(settings, skeleton, found)


def _outer_thirds(armature: bpy.types.Object, skeleton: Skeleton) -> list[Chain]:
    """Of each arm that locomotion knows, its outer third."""
    own: Any = armature
    found: list[Chain] = []
    for item in own.octo_motion.locomotion.arms:
        names = [each.name for each in item.bones if each.name in skeleton.index]
        outer = names[-max(len(names) // 3, 1) :] if len(names) > 2 else ()
        if outer:
            found.append(tuple(skeleton.index[each] for each in outer))
    return found
