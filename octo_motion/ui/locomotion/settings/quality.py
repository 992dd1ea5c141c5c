# SPDX-License-Identifier: GPL-3.0-or-later
"""How good a generated motion is: the worst of each kind, kept with the settings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import bpy

from ....blender.overrides import linked_names
from ....core.locomotion.metrics import Figure
from ...overridable import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)

KINDS: Final = (
    ("SLIP", "Slip", "How far an arm slides over the ground that it holds, in arm lengths", 0),
    ("DEPTH", "Depth", "How far an arm's bones are below the ground, in arm lengths", 1),
    ("STRAIN", "Strain", "By how much a bone is longer or shorter than at rest, as a share", 2),
    ("MISS", "Miss", "How far an arm is from its target or foothold, in arm lengths", 3),
    ("TURN", "Turn", "How far a bone turns from one frame to the next", 4),
    ("OVERLAP", "Overlap", "How deep arms pass through each other or the body, in radii", 5),
)

KIND_NAMES: Final = {kind: name for kind, name, _, _ in KINDS}


class FigureItem(bpy.types.PropertyGroup):
    """The worst of one kind, as it is kept with the settings."""

    kind: EnumProperty(name="Kind", description="What was measured", items=KINDS)
    value: FloatProperty(
        name="Value",
        description="Slip, depth and miss in arm lengths, strain as a share, turn in radians per "
        "frame, overlap in radii",
        precision=5,
    )
    frame: IntProperty(
        name="Frame",
        description="Where it is worst; between two frames the first of them",
    )
    arm: StringProperty(name="Arm", description="Of which arm; of an overlap both")
    known: BoolProperty(
        name="Known",
        description="Whether it was measured in this motion. Off for what a linked file tells of "
        "another one",
        default=True,
    )


class QualityReport:
    """What ``Object.octo_motion.locomotion`` has of it."""

    figures: CollectionProperty(
        name="Quality",
        description="The worst of each kind in the motion that was generated last",
        type=FigureItem,
    )


def known_figures(settings: Any) -> list[Any]:
    """Items of the figures that were measured, in the order of ``KINDS``."""
    items = settings.figures
    found = {item.kind: item for item in items if item.known}
    return [found[kind] for kind in KIND_NAMES if kind in found]


def write_figures(settings: Any, found: Sequence[Figure]) -> None:
    """Keep figures with the settings.

    What a library override has from its linked file can be changed, but not removed.
    """
    items = settings.figures
    linked = linked_names(settings, "figures")
    for number in reversed(range(len(items))):
        if items[number].name in linked:
            items[number].known = False
        else:
            items.remove(number)
    for figure in found:
        item = items.get(figure.kind)
        if item is None:
            item = items.add()
            item.name = item.kind = figure.kind
        item.value, item.frame, item.arm = figure.value, figure.frame, figure.arm
        item.known = True


CLASSES: Final = (FigureItem,)
