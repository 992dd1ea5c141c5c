# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of landmarks kept for a kind of skeleton, and known again where one appears."""

from __future__ import annotations

from typing import Any, cast

import bpy
from bpy.props import BoolProperty, StringProperty

from ...blender.files import (
    load_mapping,
    mapping_names,
    remove_mapping,
    save_mapping,
)
from ...blender.rig import active_armature
from ...core.errors import RigError
from ...core.phrases import phrase
from ...core.splicing.humanoid import new_mapping
from ..language import reported, translated
from ..operator_base import ArmatureOperator, window_manager
from .bodies import REFERENCE_KEY, parents_of, saved_landmarks, saved_reference
from .properties import (
    read_landmarks,
    splicing_settings,
    write_landmarks,
    write_reference,
)
from .splice_operators import StackOperator


class OCTO_MOTION_OT_mapping_save(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.mapping_save"
    bl_label = "Save Mapping"
    bl_description = (
        "Keep the table for this kind of skeleton, for all files. Wherever an armature has the "
        "same bones, with whatever prefix and other bones besides, the table is filled with it "
        "before anything is found"
    )
    # A file that was written stays when something else is undone.
    bl_options = {"REGISTER"}

    name: StringProperty(
        name="Name",
        description="What the kind of skeleton is called",
        options={"SKIP_SAVE"},
    )
    overwrite: BoolProperty(
        name="Overwrite",
        description="Replace a mapping of that name",
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:  # noqa: ARG002
        """Ask for the name."""
        armature = active_armature(context)
        own = saved_landmarks(armature).mapping
        self.name = own or armature.name
        self.overwrite = bool(own)
        return window_manager(context).invoke_props_dialog(self)

    def run(self, context: bpy.types.Context) -> None:
        # Of a linked armature as well.
        armature = active_armature(context)
        name = self.name.strip()
        landmarks = read_landmarks(splicing_settings(armature).landmarks)
        further = _further(name)
        further.pop(REFERENCE_KEY, None)
        if landmarks.reference != "":
            further[REFERENCE_KEY] = landmarks.reference
        mapping = new_mapping(name, parents_of(armature), landmarks, further)
        save_mapping(mapping, overwrite=self.overwrite)
        self.report({"INFO"}, reported(phrase("Saved the mapping '{name}'.", name=name)))


def _further(name: str) -> dict[str, Any]:
    """What a file of that name has that is not known here."""
    try:
        return dict(load_mapping(name).further)
    except RigError:
        return {}


def _names(_operator: Any, _context: bpy.types.Context, _text: str) -> list[str]:
    return mapping_names()


class OCTO_MOTION_OT_mapping_load(StackOperator, bpy.types.Operator):
    bl_idname = "octo_motion.mapping_load"
    bl_label = "Load Mapping"
    bl_description = "Fill the table from this mapping, in place of what is there"

    name: StringProperty(
        name="Name", description="Mapping to load", search=_names, options={"SKIP_SAVE"}
    )

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        mapping = load_mapping(self.name)
        landmarks = mapping.on(parents_of(armature))
        if landmarks is None:
            raise RigError(
                phrase(
                    "'{armature}' is no skeleton of the kind '{mapping}'.",
                    armature=armature.name,
                    mapping=mapping.name,
                ),
                "Choose another mapping, or fill the table by hand.",
            )
        write_landmarks(settings.landmarks, landmarks.bones)
        write_reference(settings.landmarks, saved_reference(mapping.further))
        self.report({"INFO"}, reported(phrase("Mapping: {mapping} (saved).", mapping=mapping.name)))


class OCTO_MOTION_OT_mapping_remove(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.mapping_remove"
    bl_label = "Remove Mapping"
    bl_description = "Delete a saved mapping from disk, for all files. Tables stay as they are"
    # A deleted file does not come back with undo; the settings stay as they are.
    bl_options = {"REGISTER"}

    name: StringProperty(
        name="Name",
        description="Mapping to delete; without a name that of the armature's kind",
        search=_names,
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:
        """Ask first."""
        return window_manager(context).invoke_confirm(self, event)

    def run(self, context: bpy.types.Context) -> None:
        name = self.name or saved_landmarks(active_armature(context)).mapping
        remove_mapping(name)
        self.report({"INFO"}, reported(phrase("Removed the mapping '{name}'.", name=name)))


class OCTO_MOTION_MT_mappings(bpy.types.Menu):
    bl_label = "Saved Mappings"
    bl_description = "Tables that are kept for a kind of skeleton, and known again by its bones"

    def draw(self, context: bpy.types.Context | None) -> None:  # noqa: ARG002
        layout = cast("Any", self).layout
        for name in mapping_names():
            load = layout.operator(
                OCTO_MOTION_OT_mapping_load.bl_idname, text=name, translate=False
            )
            load.name = name
        layout.separator()
        layout.operator_context = "INVOKE_DEFAULT"
        layout.operator(OCTO_MOTION_OT_mapping_save.bl_idname, text="Save Mapping…", icon="ADD")
        for name in mapping_names():
            remove = layout.operator(
                OCTO_MOTION_OT_mapping_remove.bl_idname,
                text=translated(phrase("Remove {name}", name=name)),
                icon="REMOVE",
            )
            remove.name = name


def draw_mapping(layout: bpy.types.UILayout, settings: Any) -> None:
    """Which saved mapping the table is from, and the menu of all."""
    saved = saved_landmarks(settings.id_data)
    text = OCTO_MOTION_MT_mappings.bl_label
    if saved.mapping:
        table = read_landmarks(settings.landmarks).bones
        same = all(table.get(each, bone) == bone for each, bone in saved.bones.items())
        text = phrase(
            "Mapping: {mapping} (saved)" if same else "Mapping: {mapping} (changed)",
            mapping=saved.mapping,
        )
    layout.menu(OCTO_MOTION_MT_mappings.__name__, text=translated(text))
    for sentence in saved.damaged:
        layout.label(text=translated(sentence), icon="ERROR")
