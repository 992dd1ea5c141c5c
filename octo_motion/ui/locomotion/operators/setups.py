# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole set-ups of locomotion, kept in Blender's own preset way, with a picture of each that comes
with the add-on.

A set-up is how the creature moves: gait and table, height, stance, rhythm. Which arms it has, where
it goes, over which ground, in which frames and with which keys are not part of it.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import bpy
import bpy.utils.previews
from bl_ui.utils import PresetPanel
from bpy.props import StringProperty

from ....blender.animation import writable_armature
from ....blender.files import load_gait
from ....blender.rig import active_armature
from ....core.errors import OctoMotionError, SettingsError
from ....core.phrases import as_phrase, phrase
from ...declared_settings import assign, plain
from ...language import hinted, translated
from ...operator_base import ARMATURE, ArmatureOperator, ArmaturePresetAdd, window_manager
from ..settings import (
    DEFAULT_GAIT,
    OCTO_MOTION_PG_locomotion,
    locomotion_settings,
    matched,
    read_gait,
    set_gait,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

FOLDER: Final = "octo_motion/setups"
PACKAGE: Final = Path(__file__).resolve().parents[3]
"""The folder that holds ``presets``."""

ORDER: Final = (
    *("walk", "hurry", "prowl", "tiptoe", "crawl", "settle", "swim", "jet_escape"),
    *("idle", "curl", "walk_as_published", "swim_as_published"),
)
"""In which set-ups that come with the add-on are shown; others follow by name."""

APART: Final = frozenset(
    {
        *("table", "change", "name", "seed", "active_arm", "active_reach", "cycles", "repeat"),
        *("along", "active_along", "begin_pose", "end_pose"),
        *("setup", "live", "live_error", "extended_from", "extended_to", "show_targets"),
        *("tell_overlaps", "body_front", "body_up", "root_bone", "spline", "height", "height_mode"),
        *("keep_pose", "body.file_knows", "body.mantle_bone", "body.siphon_bone"),
        *("body.eye_left", "body.eye_right"),
        *("ground.start_at_rest", "ground.come_to_rest", "ground.rest_within"),
        *("heading", "heading_angle", "gait", "timing", "speed", "frame_start", "frame_end"),
        *("travel_on", "extend_scene_range", "keys", "key_angle", "key_distance", "key_columns"),
    }
)
"""Settings of the rig, the shot and the keys: no set-up of a motion changes them. The table of the
gait goes as a whole."""

_ON_THE_SPOT: Final = frozenset({"idle", "curl"})
"""Gaits of set-ups that stay where they are."""
_BACKWARDS: Final = frozenset({"tiptoe"})
"""Gaits of set-ups that go backwards."""
_SINGLE: Final = frozenset({"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"})


def governed() -> tuple[str, ...]:
    """The settings that a set-up holds, as paths from the settings of locomotion."""
    return tuple(_paths(OCTO_MOTION_PG_locomotion.bl_rna, ""))


def _paths(kind: Any, prefix: str) -> Iterator[str]:
    for each in kind.properties:
        path = f"{prefix}{each.identifier}"
        if path in APART or each.identifier in {"rna_type", "name"}:
            continue
        if each.type in _SINGLE and not each.is_readonly:
            yield path
        elif each.type == "POINTER" and each.fixed_type.base == bpy.types.PropertyGroup.bl_rna:
            yield from _paths(each.fixed_type, f"{path}.")


def setup_paths() -> dict[str, Path]:
    """Files of all set-ups by name; one of the user's does not hide one of the add-on's."""
    found: dict[str, Path] = {}
    for folder in bpy.utils.preset_paths(FOLDER):
        for path in sorted(Path(folder).glob("*.py")):
            if path.stem not in found or path.is_relative_to(PACKAGE):
                found[path.stem] = path
    first = [name for name in ORDER if name in found]
    rest = sorted((name for name in found if name not in ORDER), key=str.casefold)
    return {name: found[name] for name in (*first, *rest)}


def _group_of(settings: Any, path: str) -> tuple[Any, str]:
    owner, _, name = path.rpartition(".")
    return settings.path_resolve(owner) if owner else settings, name


def reset(settings: Any) -> None:
    """Give all settings that a set-up holds their defaults."""
    for path in governed():
        group, name = _group_of(settings, path)
        definition = group.bl_rna.properties[name]
        is_array = getattr(definition, "is_array", False)
        assign(group, name, definition.default_array[:] if is_array else definition.default)
    set_gait(settings, load_gait(DEFAULT_GAIT))


def _put_back(group: Any, before: dict[str, Any]) -> None:
    """Give a group of properties the values that :func:`plain` has told of it."""
    for name, value in before.items():
        if group.bl_rna.properties[name].type == "COLLECTION":
            for item, own in matched(group, name, value):
                _put_back(item, own)
        else:
            assign(group, name, value)


def shown_name(name: str) -> str:
    """How a file's name is shown."""
    return bpy.path.display_name(name)


class OCTO_MOTION_OT_setup_load(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.setup_load"
    bl_label = "Load Set-Up"
    bl_description = (
        "Move like this: gait, stance and rhythm are set, while arms, route, ground, frames and "
        "keys stay as they are"
    )

    name: StringProperty(
        name="Name",
        description="Set-up to load",
        search=lambda _operator, _context, _text: list(setup_paths()),
        options={"SKIP_SAVE"},
    )

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        writable_armature(armature)
        paths = setup_paths()
        path = paths.get(self.name)
        if path is None:
            raise SettingsError(
                phrase("There is no set-up '{name}'.", name=self.name),
                phrase("Choose one of {names}.", names=", ".join(paths)),
            )
        settings: Any = locomotion_settings(armature)
        owned = ("travel_on", "heading_angle", "gait", *governed())
        before = {path: settings.path_resolve(path) for path in owned}
        table = plain(settings.table, without=frozenset({"as_text"}))
        if settings.travel_on == "NONE" and settings.gait in _ON_THE_SPOT:
            # It stayed because of the set-up before.
            settings.travel_on = "OBJECT"
        if settings.gait in _BACKWARDS and abs(abs(settings.heading_angle) - math.pi) < 1e-3:
            settings.heading_angle = 0.0
        reset(settings)
        try:
            # The file is about the active object, which may as well be a route or a marker.
            with context.temp_override(object=armature):
                bpy.utils.execfile(str(path))
            read_gait(settings)
        except Exception as error:
            # Whatever a file of the user's does: nothing of it is left.
            for path, value in before.items():
                assign(*_group_of(settings, path), value)
            # At last: the name of a gait, when it is set, fills the table.
            _put_back(settings.table, table)
            raise SettingsError(
                phrase(
                    "The set-up '{name}' is damaged: {error}.",
                    name=self.name,
                    error=as_phrase(error).open_ended(),
                ),
                "Remove it, or keep it anew.",
            ) from error
        settings.setup = self.name
        # What is live follows: Blender itself tells nobody what a script sets.
        armature.update_tag(refresh={"OBJECT"})


class OCTO_MOTION_MT_setups(bpy.types.Menu):
    bl_label = "Set-Ups"
    bl_description = "Ready ways to move, and those that you have kept"

    def draw(self, context: bpy.types.Context | None) -> None:  # noqa: ARG002
        layout = cast("Any", self).layout
        for name, icon in _icons():
            _button(layout, name, text=shown_name(name), icon_value=icon)


class OCTO_MOTION_OT_setup_add(  # pyright: ignore[reportIncompatibleMethodOverride]
    ArmaturePresetAdd, bpy.types.Operator
):
    bl_idname = "octo_motion.setup_add"
    bl_label = "Keep as Set-Up"
    bl_description = "Keep how the creature moves, for all armatures and files"
    preset_menu = "OCTO_MOTION_MT_setups"
    preset_subdir = FOLDER
    preset_defines = [
        *ARMATURE,
        "settings = armature.octo_motion.locomotion",
    ]

    @property
    def preset_values(self) -> list[str]:
        # The text first: the name of the gait, when it is set, is then that of the table.
        return [
            *("settings.table.as_text", "settings.gait"),
            *(f"settings.{path}" for path in governed()),
        ]


class OCTO_MOTION_PT_setups(PresetPanel, bpy.types.Panel):
    bl_label = "Set-Ups"
    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"
    preset_subdir = FOLDER
    preset_operator = OCTO_MOTION_OT_setup_load.bl_idname
    preset_add_operator = OCTO_MOTION_OT_setup_add.bl_idname

    def draw(self, context: bpy.types.Context) -> None:
        """The user's own, then a field to keep one more."""
        layout = cast("Any", self).layout
        layout.operator_context = "EXEC_DEFAULT"
        column = layout.column(align=True)
        for name in (name for name, icon in _icons() if not icon):
            row = column.row(align=True)
            _button(row, name, text=shown_name(name))
            remove = row.operator(self.preset_add_operator, text="", icon="REMOVE")
            remove.name, remove.remove_name = name, True
        row = layout.row()
        row.prop(window_manager(context), "preset_name", text="")
        add = row.operator(self.preset_add_operator, text="", icon="ADD")
        add.name = cast("Any", window_manager(context)).preset_name


def draw_setups(layout: Any) -> None:
    """The picture of the set-up that was chosen last: a click shows those of all."""
    layout.template_icon_view(
        window_manager(bpy.context), _SHOWN, show_labels=True, scale=5.0, scale_popup=5.0
    )


_SHOWN: Final = "octo_motion_setup"
"""A property of the window manager: the armature's set-up, to see and to choose."""
_items: dict[tuple[str, str, int, int], tuple[str, str, str, int, int]] = {}
"""Blender keeps no text of its own, and draws later: what it was told once has to stay."""


def _offered(_manager: Any, _context: bpy.types.Context | None) -> Any:
    # What a function offers Blender shows as it is, in whatever language it speaks.
    return [
        _item(name, translated(shown_name(name)), icon, number)
        for number, (name, icon) in enumerate(_icons())
    ]


def _item(name: str, shown: str, icon: int, number: int) -> tuple[str, str, str, int, int]:
    key = name, shown, icon, number
    if key not in _items:
        told = hinted(phrase("Move like this: {shown}", shown=shown))
        _items[key] = name, shown, told, icon, number
    return _items[key]


def _current(_manager: Any) -> int:
    """Which one the armature has; a file of an earlier version tells its gait alone."""
    try:
        settings = locomotion_settings(active_armature(bpy.context))
    except OctoMotionError:
        return 0
    names = list(setup_paths())
    chosen = settings.setup or settings.gait
    return names.index(chosen) if chosen in names else 0


def _choose(_manager: Any, number: int) -> None:
    name = list(setup_paths())[number]
    load: Any = bpy.ops.octo_motion.setup_load  # type: ignore[attr-defined]
    try:
        # One step of undo, which a property of the window manager is not.
        load("EXEC_DEFAULT", True, name=name)  # noqa: FBT003 - Blender takes it so
    except RuntimeError as error:
        if bpy.app.background:
            raise
        told = str(error).strip()
        for kind in ("Error", bpy.app.translations.pgettext_rpt("Error")):
            told = told.removeprefix(f"{kind}: ")

        def tell(menu: Any, _context: bpy.types.Context) -> None:
            menu.layout.label(text=told)

        window_manager(bpy.context).popup_menu(tell, title="Set-Up", icon="ERROR")


def _button(layout: Any, name: str, **look: Any) -> None:
    layout.operator(OCTO_MOTION_OT_setup_load.bl_idname, **look).name = name


_previews: list[Any] = []
"""One collection while the add-on is on: Blender frees pictures by it."""


def _icons() -> Iterator[tuple[str, int]]:
    """Each set-up with the number of its picture, 0 for none."""
    for name, path in setup_paths().items():
        picture = path.with_suffix(".png")
        if not _previews or not picture.exists():
            yield name, 0
            continue
        loaded = _previews[0]
        image = loaded[name] if name in loaded else loaded.load(name, str(picture), "IMAGE")
        yield name, image.icon_id


def register() -> None:
    """Make the add-on's set-ups known to Blender, and a place for their pictures."""
    bpy.utils.register_preset_path(str(PACKAGE))
    shown = bpy.props.EnumProperty(
        name="Set-Up",
        description="How it moves: gait, stance and rhythm. Arms, route, ground, frames and keys "
        "stay as they are",
        items=_offered,
        get=_current,
        set=_choose,
        options={"SKIP_SAVE"},
    )
    setattr(bpy.types.WindowManager, _SHOWN, shown)
    _previews.append(bpy.utils.previews.new())


def unregister() -> None:
    """Take that back."""
    while _previews:
        bpy.utils.previews.remove(_previews.pop())
    delattr(bpy.types.WindowManager, _SHOWN)
    bpy.utils.unregister_preset_path(str(PACKAGE))
