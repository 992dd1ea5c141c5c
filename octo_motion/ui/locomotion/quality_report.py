# SPDX-License-Identifier: GPL-3.0-or-later
"""How good a generated motion is: the worst of each kind, and a button that goes there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, cast

import bpy
import numpy as np
from bpy.props import CollectionProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ...blender.armature import active_armature
from ...core.errors import SettingsError
from ...core.locomotion import quality
from ...core.locomotion.arm_frames import ArmFrames
from ...core.locomotion.ground import Ground
from ...core.locomotion.quality import Worst
from ...core.locomotion.separation import Separation
from ...core.rotations import Floats, rotate
from .armature_operator import ArmatureOperator

if TYPE_CHECKING:
    from .properties import OCTO_MOTION_PG_locomotion

KINDS: Final = (
    ("SLIP", "Slip", "How far an arm slides over the ground that it holds, in arm lengths", 0),
    ("DEPTH", "Depth", "How far an arm's bones are below the ground, in arm lengths", 1),
    ("STRAIN", "Strain", "By how much a bone is longer than at rest, as a share", 2),
    ("MISS", "Miss", "How far an arm is from its target or foothold, in arm lengths", 3),
    ("CHANGE", "Turn", "How far a bone turns from one frame to the next", 4),
    ("OVERLAP", "Overlap", "How deep arms pass through each other or the body, in radii", 5),
)

_NAMES: Final = {kind: name for kind, name, _, _ in KINDS}


@dataclass(frozen=True)
class Figure:
    """The worst of one kind."""

    kind: str
    """Of ``KINDS``."""
    value: float
    """Arm lengths, shares, radians per frame, radii."""
    frame: int
    arm: str
    """Name, of an overlap of both."""


@dataclass(frozen=True, eq=False)
class Measured:
    """What the figures are taken from."""

    frames: Floats
    """(frames,)"""
    arms: Sequence[ArmFrames]
    names: Sequence[str]
    rotations: Floats
    """(frames, bones, 4)"""
    strains: Floats
    """(frames, bones)"""
    misses: Floats
    """(frames, arms) arm lengths."""
    locations: Floats
    """(frames, 3) of the armature, world."""
    orientations: Floats
    """(frames, 4)"""
    scale: float
    ground: Ground | None
    lying: Sequence[np.ndarray]
    """For each arm (frames, joints) which rest on the ground."""
    cycles: np.ndarray
    """(frames, arms)"""
    separation: Separation | None
    every: int
    """At every how many frames overlaps were looked for."""


def figures(measured: Measured) -> tuple[Figure, ...]:
    """The worst of each kind that applies."""
    found: dict[str, tuple[Worst, str]] = {}

    def keep(kind: str, worst: Worst, names: Sequence[str]) -> None:
        if kind not in found or worst.value > found[kind][0].value:
            found[kind] = worst, names[worst.arm]

    ends = np.cumsum([0, *(len(arm.bones) for arm in measured.arms)])
    if measured.ground is not None:
        for number, arm in enumerate(measured.arms):
            bones = slice(int(ends[number]), int(ends[number + 1]))
            own = arm.joints(
                arm.from_bones(measured.rotations[:, bones]), measured.strains[:, bones]
            )
            turned = rotate(measured.orientations[:, None], measured.scale * own)
            world = (measured.locations[:, None] + turned)[:, None]
            length, name = (
                np.array([arm.length * measured.scale]),
                measured.names[number : number + 1],
            )
            lying = measured.lying[number][:, None]
            cycles = measured.cycles[:, number : number + 1]
            keep("SLIP", quality.slip(world, lying, cycles, length), name)
            keep("DEPTH", quality.depth(world, measured.ground, length), name)
        keep("STRAIN", quality.strain(measured.strains), _owners(measured))
    keep("MISS", quality.miss(measured.misses), measured.names)
    if len(measured.frames) > 1:
        keep("CHANGE", quality.change(measured.rotations, measured.frames), _owners(measured))
    result = [
        Figure(kind, max(worst.value, 0.0), int(measured.frames[worst.sample]), name)
        for kind, (worst, name) in found.items()
    ]
    if measured.separation is not None:
        deepest = measured.separation.worst
        if deepest is None:
            result.append(Figure("OVERLAP", 0.0, int(measured.frames[0]), ""))
        else:
            frame = int(measured.frames[deepest.frame * measured.every])
            both = f"{deepest.first}, {deepest.second}"
            result.append(Figure("OVERLAP", max(float(deepest.depth), 0.0), frame, both))
    return tuple(result)


def _owners(measured: Measured) -> list[str]:
    """The arm of each bone."""
    pairs = zip(measured.names, measured.arms, strict=True)
    return [name for name, arm in pairs for _ in arm.bones]


def shown(kind: str, value: float) -> str:
    """A figure as people read it."""
    if kind == "CHANGE":
        return f"{np.degrees(value):.1f}° a frame"
    if kind == "OVERLAP":
        return f"{value:.1f} radii"
    return f"{100.0 * value:.2g} %"


class FigureItem(bpy.types.PropertyGroup):
    """The worst of one kind, as it is kept with the settings."""

    kind: EnumProperty(name="Kind", description="What was measured", items=KINDS)
    value: FloatProperty(
        name="Value",
        description="Slip, depth and miss in arm lengths, strain as a share, turn in radians per "
        "frame, overlap in radii",
        precision=5,
    )
    frame: IntProperty(name="Frame", description="Where it is worst")
    arm: StringProperty(name="Arm", description="Of which arm; of an overlap both")


class QualityReport:
    """What ``Object.octo_motion.locomotion`` has of it."""

    figures: CollectionProperty(
        name="Quality",
        description="The worst of each kind in the motion that was generated last",
        type=FigureItem,
    )


def write_figures(settings: OCTO_MOTION_PG_locomotion, found: Sequence[Figure]) -> None:
    """Keep figures with the settings."""
    items = cast("Any", settings).figures
    items.clear()
    for figure in found:
        item = items.add()
        item.name = figure.kind
        item.kind, item.value = figure.kind, figure.value
        item.frame, item.arm = figure.frame, figure.arm


def draw_figures(layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
    """A row for each figure, with a button that goes to its frame."""
    column = layout.column(align=True)
    for item in cast("Any", settings).figures:
        row = column.row(align=True)
        row.label(text=f"{_NAMES[item.kind]}: {shown(item.kind, item.value)}")
        jump = row.operator(
            OCTO_MOTION_OT_quality_jump.bl_idname, text=f"{item.frame}", icon="TIME"
        )
        jump.kind = item.kind


class OCTO_MOTION_OT_quality_jump(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.quality_jump"
    bl_label = "Go to Worst Frame"
    bl_description = "Go to the frame where this is worst"
    # The current frame is no step of undo, here as in Blender's timeline.
    bl_options = {"REGISTER"}

    kind: EnumProperty(name="Kind", description="Which figure", items=KINDS)

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        settings = cast("Any", armature).octo_motion.locomotion
        item = next((each for each in settings.figures if each.kind == self.kind), None)
        if item is None:
            raise SettingsError(
                f"Nothing is known of {_NAMES[self.kind].lower()}.", "Generate a motion first."
            )
        assert context.scene is not None
        context.scene.frame_set(item.frame)
        self.report({"INFO"}, f"{_NAMES[item.kind]} {shown(item.kind, item.value)}: {item.arm}")


CLASSES: Final = (FigureItem,)
OPERATORS: Final = (OCTO_MOTION_OT_quality_jump,)
