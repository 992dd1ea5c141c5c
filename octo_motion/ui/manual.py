# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual, which comes with the extension: a page for each panel, setting and operator."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import bpy
from bpy.props import StringProperty

from .steps import Step

_PACKAGE: Final = Path(__file__).resolve().parent.parent
_INSTALLED: Final = _PACKAGE / "manual"
"""Where the zip has its pages …"""
_SOURCES: Final = _PACKAGE.parent / "docs"
"""… and where the sources have theirs."""

PAGES: Final = (
    ("octo_motion_ot_add_octopus*", "the-octopus"),
    ("octo_motion_ot_add_route*", "the-route"),
    ("octo_motion_ot_gait_*", "the-table"),
    ("octo_motion_ot_setup_*", "set-ups"),
    ("octo_motion_ot_contact*", "contacts-by-hand"),
    ("octo_motion_ot_reach_*", "reaching-and-holding"),
    ("octo_motion_ot_change_*", "change-of-gait"),
    ("octo_motion_ot_along_*", "settings-along-the-route"),
    ("octo_motion_ot_pose_take*", "begin-and-end-in-a-pose"),
    ("octo_motion_ot_import_clips*", "clips"),
    ("octo_motion_ot_retarget*", "retarget"),
    ("octo_motion_ot_splice_drag_timing*", "timing-of-a-splice"),
    ("octo_motion_ot_splice*", "splicing"),
    ("octo_motion_ot_pose_device*", "device"),
    ("octo_motion_ot_pose*", "posing-by-hand"),
    ("octo_motion_ot_*", "the-first-walk"),
    ("octo_motion_pg_locomotion*", "the-first-walk"),
    ("octo_motion_pg_ground*", "the-ground"),
    ("octo_motion_pg_splicing*", "splicing"),
    ("octo_motion_pg_retarget*", "retarget"),
    ("octo_motion_pg_landmarks*", "landmarks"),
    ("octo_motion_pg_posing*", "posing-by-hand"),
    ("octo_motion_pg_device*", "device"),
    ("octo_motion_pg_*", "the-first-walk"),
)
"""What Blender's Online Manual asks for, in small letters, and the chapter that tells of it; the
first that fits counts."""

CHAPTERS: Final = {
    "rig": "rigs-of-your-own",
    "generate": "the-first-walk",
    "route": "the-route",
    "heading": "the-route",
    "gait": "gaits",
    "variation": "making-it-less-even",
    "weights": "how-the-arms-bend",
    "frames": "timing",
    "arms": "rigs-of-your-own",
    "table": "the-table",
    "body": "the-body",
    "body_bones": "the-body",
    "ground": "the-ground",
    "contact": "contacts-by-hand",
    "reaches": "reaching-and-holding",
    "change": "change-of-gait",
    "along": "settings-along-the-route",
    "given_poses": "begin-and-end-in-a-pose",
    "quality": "quality",
    "splicing": "the-first-splice",
    "splice": "parts-and-sources",
    "splice_timing": "timing-of-a-splice",
    "retarget": "retarget",
    "landmarks": "landmarks",
    "posing": "the-first-pose",
    "posing_aids": "the-first-pose",
    "posing_world": "solid-things",
    "posing_bones": "which-bones-are-limbs",
    "posing_keys": "keys-and-recording",
    "posing_device": "device",
    "follow_through": "follow-through",
    "follow_world": "follow-through",
    "follow_contacts": "follow-through",
    "follow_keys": "follow-through",
}
"""Chapter of each panel, by the end of its class's name."""


def manual_url(chapter: str = "") -> str:
    """Where a chapter is, on this computer; the manual's beginning without."""
    page = "device" if chapter == "device" else "guide"
    where = f"#{chapter}" if chapter and chapter != page else ""
    installed = _INSTALLED / f"{page}.html"
    found = installed if installed.is_file() else _SOURCES / f"{page}.md"
    return found.as_uri() + where


def manual_map() -> tuple[str, tuple[tuple[str, str], ...]]:
    """What Blender's Online Manual in a right click's menu opens."""
    begins = manual_url().rpartition("/")[0] + "/"
    kinds = {"ot": "bpy.ops.octo_motion.", "pg": "bpy.types."}
    found: list[tuple[str, str]] = []
    for name, chapter in PAGES:
        kind = name.removeprefix("octo_motion_")[:2]
        pattern = name.removeprefix("octo_motion_ot_") if kind == "ot" else name
        found.append((kinds[kind] + pattern, manual_url(chapter).removeprefix(begins)))
    return begins, tuple(found)


class OCTO_MOTION_OT_manual(bpy.types.Operator):
    bl_idname = "octo_motion.manual"
    bl_label = "Manual"
    bl_description = "Open the page of the manual that tells of this"
    bl_options = {"INTERNAL"}

    chapter: StringProperty(
        name="Chapter", description="Which chapter of the manual", options={"SKIP_SAVE"}
    )

    def execute(self, context: bpy.types.Context) -> set[Any]:  # noqa: ARG002 - Blender's signature
        """Open it in the browser."""
        bpy.ops.wm.url_open(url=manual_url(self.chapter))
        return {"FINISHED"}


def draw_manual_button(layout: Any, panel: type) -> None:
    """The question mark in the header of a panel of ours."""
    chapter = CHAPTERS.get(panel.__name__.removeprefix("OCTO_MOTION_PT_"))
    if chapter is not None:
        button = layout.operator(
            OCTO_MOTION_OT_manual.bl_idname, text="", icon="QUESTION", emboss=False
        )
        button.chapter = chapter


STEPS: Final = (
    Step(
        lambda: bpy.utils.register_manual_map(manual_map),
        lambda: bpy.utils.unregister_manual_map(manual_map),
    ),
)
