# SPDX-License-Identifier: GPL-3.0-or-later
"""What all operators share: our errors become Blender's reports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import bpy
from bl_operators.presets import AddPresetBase
from bpy.props import EnumProperty

from ..blender.animation import renumber_keys
from ..blender.rig import active_armature, linked_names
from ..core.errors import OctoMotionError, RigError
from ..core.files import plain_name
from ..core.phrases import as_phrase, phrase
from .language import hinted, reported

if TYPE_CHECKING:
    from bpy.stub_internal.rna_enums import OperatorReturnItems


class OctoOperator:
    """Mix-in for operators: write ``run``, and raise ``OctoMotionError`` before changing anything.

    An error that a user can put right becomes one report and ``CANCELLED``. Anything else is a
    fault of ours and surfaces as Python's own traceback.
    """

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:  # noqa: ARG003
        """Why it cannot be done now, for the tooltip; "" if it can."""
        return ""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Blender's entry point."""
        found = cls.obstacle(context)
        if found:
            cls.poll_message_set(hinted(found))  # type: ignore[attr-defined]
        return not found

    def run(self, context: bpy.types.Context) -> None:
        """Do the work, or raise ``OctoMotionError`` and leave everything as it was."""
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[OperatorReturnItems]:
        """Blender's entry point."""
        try:
            self.run(context)
        except OctoMotionError as error:
            self.report({"ERROR"}, reported(error))  # type: ignore[attr-defined]
            return {"CANCELLED"}
        return {"FINISHED"}


class FileOperator(OctoOperator):
    """Mix-in: asks for a file first, unless one was dropped."""

    filepath = ""
    """A property of the operator's."""

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:  # noqa: ARG002
        """Blender's entry point."""
        return self.execute(context) if self.filepath else self.browse(context)

    def browse(self, context: bpy.types.Context) -> set[Any]:
        """Open the file browser."""
        window_manager(context).fileselect_add(cast("bpy.types.Operator", self))
        return {"RUNNING_MODAL"}


def window_manager(context: bpy.types.Context) -> bpy.types.WindowManager:
    """The window manager, which is there as long as Blender runs."""
    assert context.window_manager is not None
    return context.window_manager


# --- What operators on the active armature share --------------------------------------------------


class ArmatureOperator(OctoOperator):
    """An operator on the armature that the user works on, see ``active_armature``."""

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:
        if context.mode not in {"OBJECT", "POSE"}:
            # Undo in other modes takes back what was done in that mode, and nothing else.
            return "Go to object mode or pose mode first"
        return without_armature(context)


def without_armature(context: bpy.types.Context) -> str:
    """Why there is no armature to work on, "" if there is one."""
    try:
        active_armature(context)
    except RigError as error:
        return as_phrase(error).open_ended()
    return ""


# --- What operators on the lists of an armature's settings share: arms, splices -------------------


@dataclass(frozen=True)
class ListKind:
    """A list, and the words for its items."""

    settings: Callable[[bpy.types.Object], Any]
    """The settings of an armature object that have the list."""
    check: Callable[[bpy.types.Object], None]
    """Raises if what is changed on the armature would not be saved."""
    items: str
    """Name of the list, also for people: "arms"."""
    active: str
    """Name of the setting with the number of the active item."""
    one: str
    """An item, for people: "an arm"."""
    instead: str
    """What to do with a linked item that cannot be removed: a sentence."""

    def active_item(self, settings: Any) -> Any:
        """The list's active item, ``None`` in an empty list."""
        items, number = getattr(settings, self.items), getattr(settings, self.active)
        return items[number] if 0 <= number < len(items) else None


class ListOperator(ArmatureOperator):
    """An operator on the list of the active armature."""

    # A value and no annotation: what Blender 4.5 evaluates of one keeps it from ending.
    KIND = cast("ListKind", None)

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        self.KIND.check(armature)
        self.edit(context, armature, self.KIND.settings(armature))

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:
        """Do the work on an armature that can be edited."""
        raise NotImplementedError


class ItemOperator(ListOperator):
    """An operator on the list's active item."""

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:
        if found := super().obstacle(context):
            return found
        chosen = cls.KIND.active_item(cls.KIND.settings(active_armature(context)))
        return (
            ""
            if chosen is not None
            else phrase("Choose {one} in the list first", one=as_phrase(cls.KIND.one))
        )


class RemoveOperator(ItemOperator):
    """Takes the active item off the list."""

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        kind = self.KIND
        name = kind.active_item(settings).name
        if name in linked_names(settings, kind.items):
            raise RigError(
                phrase("'{name}' is in the linked file and cannot be removed here.", name=name),
                kind.instead,
            )
        items, number = getattr(settings, kind.items), getattr(settings, kind.active)
        behind = {each: each - 1 for each in range(number + 1, len(items))}
        items.remove(number)
        _keys_follow(settings, kind, {number: None, **behind})
        setattr(settings, kind.active, max(0, min(number, len(items) - 1)))


class MoveOperator(ItemOperator):
    """Moves the active item by one place."""

    direction: EnumProperty(
        name="Direction",
        items=(
            ("UP", "Up", "Towards the first"),
            ("DOWN", "Down", "Towards the last"),
        ),
    )

    def execute(self, context: bpy.types.Context) -> set[OperatorReturnItems]:
        settings = self.KIND.settings(active_armature(context))
        if not 0 <= self._target(settings) < len(getattr(settings, self.KIND.items)):
            # It is the first or the last already: no undo step for that.
            return {"CANCELLED"}
        return super().execute(context)

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        kind = self.KIND
        name = kind.active_item(settings).name
        if name in linked_names(settings, kind.items):
            raise RigError(
                phrase(
                    "'{name}' is in the linked file, where the order of its {items} is set.",
                    name=name,
                    items=as_phrase(kind.items),
                ),
                phrase(
                    "Move {items} that were added in this file, or change the order there.",
                    items=as_phrase(kind.items),
                ),
            )
        number, target = getattr(settings, kind.active), self._target(settings)
        getattr(settings, kind.items).move(number, target)
        _keys_follow(settings, kind, {number: target, target: number})
        setattr(settings, kind.active, target)

    def _target(self, settings: Any) -> int:
        return getattr(settings, self.KIND.active) + (-1 if self.direction == "UP" else 1)


def _keys_follow(settings: Any, kind: ListKind, places: Mapping[int, int | None]) -> None:
    """Keys of a list's settings stay with their items: in the action that is seen, and those that
    the settings name.
    """
    data = settings.id_data.animation_data
    actions = [None if data is None else data.action]
    actions += [getattr(settings, name, None) for name in ("base", "result")]
    renumber_keys(actions, settings.path_from_id(kind.items), places)


# --- What operators share that keep settings of an armature as a preset, Blender's own kind -------


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
        found = without_armature(context)
        if found:
            cast("Any", cls).poll_message_set(hinted(found))
        return not found

    @staticmethod
    def as_filename(name: Any) -> Any:
        """The name of a file; Blender itself would take that of a device on Windows."""
        blenders: Any = AddPresetBase.as_filename
        return plain_name(blenders(name))

    def execute(self, context: bpy.types.Context) -> Any:
        """Write the file, or remove it."""
        with context.temp_override(object=active_armature(context)):
            return super().execute(context)


# --- Views that show a few objects alone ----------------------------------------------------------


def show_in_local_view(context: bpy.types.Context, *added: bpy.types.Object) -> None:
    """Let what is added join the objects that the view shows, where it shows a few alone."""
    space = context.space_data
    if isinstance(space, bpy.types.SpaceView3D) and space.local_view:
        for each in added:
            each.local_view_set(space, state=True)
