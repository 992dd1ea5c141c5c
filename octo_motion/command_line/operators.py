# SPDX-License-Identifier: GPL-3.0-or-later
"""From Blender to a job file, and back: what is open as shots, and baked shots as actions."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import bpy
from bpy.props import BoolProperty, IntProperty, StringProperty

from ..core.errors import OctoMotionError, RigError, WriteError
from ..core.files import plain_name
from ..core.phrases import phrase
from ..ui.language import reported
from ..ui.locomotion import locomotion_settings
from ..ui.operator_base import FileOperator
from ..ui.splicing import splicing_settings
from ..ui.steps import Step, menu_entry, registered
from .job_report import REPORT_ENDING, read_report

SHOTS: Final = "octo_motion_shots"
"""Property of a scene that keeps the actions of shots in the file, by the shots' names."""


def _creatures(context: bpy.types.Context, *, selected: bool) -> Iterator[tuple[str, Any]]:
    """Kind of shot and armature, for all that were set up."""
    assert context.scene is not None
    objects = context.selected_objects if selected else context.scene.objects
    for each in sorted(objects, key=lambda each: each.name):
        if each.type != "ARMATURE" or each.library is not None:
            continue
        stack: Any = splicing_settings(each)
        if len(stack.splices):
            yield "splice", each
        elif len(locomotion_settings(each).arms):
            yield "generate", each


def _has_unsaved_changes() -> bool:
    # Without a window Blender 4.5 counts a file as changed that was saved just now.
    return bpy.data.is_dirty and not bpy.app.background


def _texts(creatures: list[tuple[str, Any]], seeds: int) -> Iterator[str]:
    """The tables of the shots of creatures; each that is random with so many seeds."""
    for kind, armature in creatures:
        name = plain_name(armature.name)
        if kind == "splice":
            yield _table(name, armature, 'kind = "splice"\n')
            continue
        settings: Any = locomotion_settings(armature)
        # The mesh of the ground, the route, lists and all settings are as the file has them.
        if seeds == 1:
            yield _table(name, armature)
            continue
        for seed in range(settings.seed, settings.seed + seeds):
            yield _table(f"{name}_seed{seed}", armature, f"settings = {{ seed = {seed} }}\n")


def _table(name: str, armature: bpy.types.Object, more: str = "") -> str:
    # A text of JSON is one of TOML too.
    quoted = [json.dumps(each, ensure_ascii=False) for each in (name, armature.name)]
    return f"\n[[shots]]\nname = {quoted[0]}\narmature = {quoted[1]}\n{more}"


class OCTO_MOTION_OT_write_job(FileOperator, bpy.types.Operator):
    bl_idname = "octo_motion.write_job"
    bl_label = "Octo Motion Job (.toml)"
    bl_options = {"REGISTER"}
    bl_description = (
        "Write a job file that makes the motion of every creature in this scene anew, on the "
        "command line or a render farm. The job reads this .blend file: save it first"
    )

    filepath: StringProperty(
        name="File Path", description="The job file", subtype="FILE_PATH", options={"SKIP_SAVE"}
    )
    filter_glob: StringProperty(default="*.toml", options={"HIDDEN"})
    seeds: IntProperty(
        name="Seeds",
        description="Shots of each creature, with one random seed after the other. One: as it is",
        default=1,
        min=1,
        soft_max=100,
    )
    selected: BoolProperty(
        name="Selected Only", description="Leave out creatures that are not selected"
    )

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:  # noqa: ARG003
        if not bpy.data.filepath:
            return "Save the file first: the job reads it"
        return ""

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:
        """Open the file browser, beside the file."""
        self.filepath = str(Path(bpy.data.filepath).with_suffix(".toml"))
        return super().invoke(context, event)

    def run(self, context: bpy.types.Context) -> None:
        if _has_unsaved_changes():
            raise WriteError("The file has changes that are not saved.", "Save it, then again.")
        if not self.filepath:
            raise WriteError("No file is given.", "Give the path of a .toml file.")
        creatures = list(_creatures(context, selected=self.selected))
        if not creatures:
            raise RigError(
                "No creature is set up here.",
                "Click Detect Arms, or build splices, and save the file.",
            )
        # Late, so that artists without jobs do not wait for it.
        from .job import read_job  # noqa: PLC0415
        from .outputs import write_text  # noqa: PLC0415
        from .records import Records  # noqa: PLC0415
        from .vocabulary import known  # noqa: PLC0415

        path = Path(bpy.path.abspath(self.filepath)).with_suffix(".toml")
        records = Records(path, path.with_suffix(REPORT_ENDING))
        file = records.relative(Path(bpy.data.filepath))
        tables = list(_texts(creatures, self.seeds))
        head = (
            f"# Shots of {Path(bpy.data.filepath).name}, with its settings as they are.\n\n"
            f"[defaults]\nfile = {json.dumps(file, ensure_ascii=False)}\n"
            'output = "shots/{name}.blend"\n'
        )
        write_text(path, head + "".join(tables))
        read_job(path, known(), records.report)
        self.report(
            {"INFO"},
            reported(phrase("'{path}' has {count} shots.", path=path.name, count=len(tables))),
        )


class OCTO_MOTION_OT_link_shots(FileOperator, bpy.types.Operator):
    bl_idname = "octo_motion.link_shots"
    bl_label = "Octo Motion Shots (.report.json)"
    bl_options = {"REGISTER", "UNDO"}
    bl_description = (
        "Link what a job has made: the action of each shot of its report. They are kept in the "
        "file, and can be chosen as any other action"
    )

    filepath: StringProperty(
        name="File Path",
        description="The report of the job",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})
    append: BoolProperty(
        name="Append", description="Copy the actions into this file, in place of linking them"
    )

    def run(self, context: bpy.types.Context) -> None:
        scene: Any = context.scene
        report = Path(bpy.path.abspath(self.filepath))
        records = read_report(report) if self.filepath and report.is_file() else {}
        if not records:
            raise OctoMotionError("That is no report with shots.", "Choose the job's report.")
        made: dict[str, Any] = {}
        for record in records.values():
            blend = next((each for each in record.outputs if each.endswith(".blend")), "")
            path = report.parent / blend
            if not (record.action and blend and path.is_file()):
                continue
            library: Any = bpy.data.libraries.load(str(path), link=not self.append)
            with library as (inside, taken):
                taken.actions = [record.action] if record.action in inside.actions else []
            if taken.actions:
                made[record.name] = taken.actions[0]
        if not made:
            raise OctoMotionError(
                phrase(
                    "None of the {count} shots has a .blend file with its action.",
                    count=len(records),
                ),
                "Bake the job, and keep the report where it was written.",
            )
        if SHOTS not in scene:
            scene[SHOTS] = {}
        for name, action in made.items():
            # A user of each, for what has none is not saved.
            scene[SHOTS][name] = action
        self.report(
            {"INFO"},
            reported(
                phrase(
                    "{count} of {total} shots are here as actions.",
                    count=len(made),
                    total=len(records),
                )
            ),
        )


def draw_in_export_menu(menu: Any, _context: bpy.types.Context) -> None:
    """File › Export."""
    menu.layout.operator(OCTO_MOTION_OT_write_job.bl_idname)


def draw_in_link_menu(menu: Any, _context: bpy.types.Context) -> None:
    """File › Import."""
    menu.layout.operator(OCTO_MOTION_OT_link_shots.bl_idname)


def draw_button(panel: Any, _context: bpy.types.Context) -> None:
    """Below all else in the panel Generate."""
    panel.layout.operator(OCTO_MOTION_OT_write_job.bl_idname, text="Write Job", icon="EXPORT")


def steps() -> list[Step]:
    """What the add-on does to have these operators, and where they are found."""
    return [
        registered(OCTO_MOTION_OT_write_job),
        registered(OCTO_MOTION_OT_link_shots),
        menu_entry("TOPBAR_MT_file_export", draw_in_export_menu),
        menu_entry("TOPBAR_MT_file_import", draw_in_link_menu),
        menu_entry("OCTO_MOTION_PT_generate", draw_button),
    ]
