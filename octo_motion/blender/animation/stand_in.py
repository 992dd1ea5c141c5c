# SPDX-License-Identifier: GPL-3.0-or-later
"""An action that gets its keys in turns while another one is played, and then takes its place."""

from __future__ import annotations

from typing import Final

import bpy

from ...core.errors import WriteError
from ...core.phrases import phrase
from .actions import MARK, assign_action, new_action
from .poses import UnkeyedPose, keep_unkeyed_pose
from .splice_layer import lay_over, take_off
from .spliced_action import rest_unkeyed

_STANDS_IN: Final = "octo_motion_stands_in"
"""Custom property of an action that is being written."""

_HIDDEN: Final = ".Octo Motion"
"""What it is called meanwhile: Blender's menus leave such names out."""


class StandIn:
    """An action in the making: a copy of the one that it is to replace, with its colours, groups
    and slot, or a new one.

    Nobody uses it until it is whole; so it is neither seen nor saved.

    Args:
        armature: that is to have it.
        previous: what it replaces; none for nothing.
        name: what it is called if that is so.
    """

    def __init__(
        self, armature: bpy.types.Object, previous: bpy.types.Action | None, name: str
    ) -> None:
        self._name = name
        self._previous = "" if previous is None else previous.name
        made = previous.copy() if previous is not None else new_action(armature, name)
        assert made is not None
        made.name, made.use_fake_user = _HIDDEN, False
        made[_STANDS_IN] = True
        if previous is None:
            # Whoever looks for motions is to know that it is none of an artist's.
            made[MARK] = {"owner": armature.name}
        self._hidden, self._number = made.name, made.session_uid

    @property
    def is_there(self) -> bool:
        """Whether nobody has taken it away."""
        found = bpy.data.actions.get(self._hidden)
        return found is not None and found.session_uid == self._number

    @property
    def action(self) -> bpy.types.Action:
        """It.

        Raises:
            WriteError: somebody has taken it away.
        """
        if not self.is_there:
            raise WriteError(phrase("'{name}' is gone.", name=self._name), "Build again.")
        return bpy.data.actions[self._hidden]

    def take_place(self) -> bpy.types.Action:
        """Be what the other one was, for all that used it; that is gone then.

        Raises:
            WriteError: one of the two is gone.
        """
        action = self.action
        if self._previous:
            previous = bpy.data.actions.get(self._previous)
            if previous is None:
                raise WriteError(phrase("'{name}' is gone.", name=self._previous), "Build again.")
            fake = previous.use_fake_user
            previous.user_remap(action)
            bpy.data.actions.remove(previous)
            action.name, action.use_fake_user = self._previous, fake
        else:
            action.name = self._name
        del action[_STANDS_IN]
        action[MARK]["name"] = action.name
        return action

    def drop(self) -> None:
        """Leave nothing of it; safe to call twice."""
        if self.is_there:
            bpy.data.actions.remove(bpy.data.actions[self._hidden])


def drop_stand_ins() -> None:
    """Leave nothing of all that were in the making: a step back may have brought them back."""
    for action in list(bpy.data.actions):
        if _STANDS_IN in action:
            bpy.data.actions.remove(action)


def play_spliced(
    armature: bpy.types.Object, stand_in: StandIn, unkeyed: UnkeyedPose
) -> bpy.types.Action:
    """Give an armature a spliced action that is filled and marked, see
    :func:`~octo_motion.blender.animation.filling_spliced`.
    """
    keep_unkeyed_pose(armature)
    result = stand_in.take_place()
    take_off(armature, result)
    assign_action(armature, result)
    rest_unkeyed(armature, result, unkeyed)
    return result


def play_clip(armature: bpy.types.Object, stand_in: StandIn) -> bpy.types.Action:
    """The same of a whole clip."""
    keep_unkeyed_pose(armature)
    result = stand_in.take_place()
    assign_action(armature, result)
    return result


def play_layer(
    armature: bpy.types.Object,
    stand_in: StandIn,
    base: bpy.types.Action,
    slot: bpy.types.ActionSlot,
) -> bpy.types.Action:
    """The same of a layer over its base."""
    keep_unkeyed_pose(armature)
    result = stand_in.take_place()
    lay_over(armature, result, base, slot)
    return result
