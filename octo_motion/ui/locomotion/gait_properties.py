# SPDX-License-Identifier: GPL-3.0-or-later
"""The gait table as properties that an artist edits, and the way between them and core's table.

A table without curves stands for the preset that the settings name: so a new armature has a gait
before anything was written, and a linked one stays light. Choosing a gait fills it.

Knots here need not be in order, and the last one, at 360°, is left out: it always equals the
first. So whatever an artist does with them, the table closes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Final

import bpy
import numpy as np
from bpy.props import (
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    StringProperty,
)

from ...core.errors import GaitError
from ...core.locomotion import gait
from ...core.locomotion.gait import ANGLES, CYCLE, LINKS, GaitCurve, GaitTable
from ...core.rotations import Floats

if TYPE_CHECKING:
    from bpy.stub_internal.rna_enums import (
        PropertyOverrideFlagCollectionItems,
        PropertyOverrideFlagItems,
    )

OVERRIDE: Final[set[PropertyOverrideFlagItems]] = {"LIBRARY_OVERRIDABLE"}
OVERRIDE_LIST: Final[set[PropertyOverrideFlagCollectionItems]] = {
    "LIBRARY_OVERRIDABLE",
    "USE_INSERTION",
}

DEFAULT_GAIT: Final = "walk"
_DEFAULT: Final = gait.presets()[DEFAULT_GAIT]

SIDES: Final = (
    ("LEFT", "Left", "The arm on the left", 0),
    ("RIGHT", "Right", "The arm on the right", 1),
    ("CENTER", "Center", "The arm in the middle, which has no partner", 2),
)

# Properties are single precision; people give degrees and simple fractions. Rounding brings back
# what they meant, so that a table is the same before and after its way through properties.
_DEGREE_DIGITS: Final = 4
_NUMBER_DIGITS: Final = 6


def _link_angles(name: str, description: str) -> Any:
    return FloatVectorProperty(
        name=name,
        description=f"{description}. One angle for each third of the arm, from root to tip",
        size=LINKS,
        unit="ROTATION",
        soft_min=-np.pi,
        soft_max=np.pi,
        step=500,
        precision=1,
        override=OVERRIDE,
    )


class OCTO_MOTION_PG_gait_knot(bpy.types.PropertyGroup):
    """Angles of the three links at one phase."""

    phase: FloatProperty(
        name="Phase",
        description="Where in the cycle these angles are reached; between them they run evenly",
        subtype="ANGLE",
        min=0.0,
        max=2.0 * np.pi,
        step=500,
        precision=1,
        override=OVERRIDE,
    )
    head: _link_angles("Head", "Up and down; above zero raises")
    pitch: _link_angles("Pitch", "Left and right; above zero turns to the body's front")
    bank: _link_angles("Bank", "Twist about the arm")


class OCTO_MOTION_PG_gait_curve(bpy.types.PropertyGroup):
    """The angles of one pair of arms over a cycle."""

    pair: IntProperty(
        name="Pair",
        description="Pair of arms that these angles are for, 1 in front; 0 is for all others",
        min=0,
        override=OVERRIDE,
    )
    knots: CollectionProperty(
        name="Knots",
        description="Angles at some phases; the last runs on to the first",
        type=OCTO_MOTION_PG_gait_knot,
        override=OVERRIDE_LIST,
    )
    active_knot: IntProperty(name="Active Knot", options={"HIDDEN"}, override=OVERRIDE)


class OCTO_MOTION_PG_gait_offset(bpy.types.PropertyGroup):
    """How far one arm is ahead, in place of the spread."""

    pair: IntProperty(
        name="Pair", description="Pair of the arm, 1 in front", min=1, default=1, override=OVERRIDE
    )
    side: EnumProperty(name="Side", description="Side of the arm", items=SIDES, override=OVERRIDE)
    phase: FloatProperty(
        name="Ahead",
        description="How far this arm is ahead of the body's cycle, whatever the spread says",
        subtype="ANGLE",
        soft_min=-2.0 * np.pi,
        soft_max=2.0 * np.pi,
        override=OVERRIDE,
    )


class OCTO_MOTION_PG_gait_note(bpy.types.PropertyGroup):
    """A remark that travels with the table."""

    subject: StringProperty(name="Subject", override=OVERRIDE)
    text: StringProperty(name="Text", override=OVERRIDE)


class OCTO_MOTION_PG_gait_table(bpy.types.PropertyGroup):
    """A gait table."""

    name: StringProperty(
        name="Name", description="Name of the gait that was loaded", override=OVERRIDE
    )
    description: StringProperty(
        name="Description", description="What this gait is for", override=OVERRIDE
    )
    manner: EnumProperty(
        name="Manner",
        description="How the body travels with this gait",
        items=(
            ("WALK", "Walk", "Over the ground: the body stays upright, its front ahead", 0),
            ("SWIM", "Swim", "Through the water: the mantle goes ahead and the arms trail", 1),
        ),
        default=_DEFAULT.manner,
        override=OVERRIDE,
    )
    stride: FloatProperty(
        name="Stride",
        description="How far the body travels in one cycle, in arm lengths. A longer stride "
        "covers the route in fewer cycles",
        default=_DEFAULT.stride,
        min=0.01,
        soft_min=0.1,
        soft_max=3.0,
        step=5,
        override=OVERRIDE,
    )
    spread_pairs: FloatProperty(
        name="Pairs",
        description="How the pairs follow one another: cycles from the first pair to the last. "
        "At 1 a wave runs over the arms, at 0 all pairs move together",
        default=_DEFAULT.spread_pairs,
        soft_min=-2.0,
        soft_max=2.0,
        step=5,
        override=OVERRIDE,
    )
    spread_sides: FloatProperty(
        name="Sides",
        description="Cycles that the right side is ahead of the left. At 0.5 the sides take "
        "turns, at 0 they move together",
        default=_DEFAULT.spread_sides,
        soft_min=-1.0,
        soft_max=1.0,
        step=5,
        override=OVERRIDE,
    )
    offsets: CollectionProperty(
        name="Offsets",
        description="Arms that keep a phase of their own, whatever the spread says",
        type=OCTO_MOTION_PG_gait_offset,
        override=OVERRIDE_LIST,
    )
    active_offset: IntProperty(name="Active Offset", options={"HIDDEN"}, override=OVERRIDE)
    power_phase: FloatProperty(
        name="Power Stroke",
        description="Phase at the middle of the power stroke: a swimming body shoots ahead there",
        subtype="ANGLE",
        default=_DEFAULT.power_phase,
        min=0.0,
        max=2.0 * np.pi,
        step=500,
        precision=1,
        override=OVERRIDE,
    )
    curves: CollectionProperty(
        name="Curves",
        description="Angles of the arms over one cycle: one curve for all pairs, others for "
        "single pairs. Without any, the preset's",
        type=OCTO_MOTION_PG_gait_curve,
        override=OVERRIDE_LIST,
    )
    active_curve: IntProperty(name="Active Curve", options={"HIDDEN"}, override=OVERRIDE)
    shown_angle: EnumProperty(
        name="Angle",
        description="Which of the three angles the table shows",
        items=(
            ("HEAD", "Head", "Up and down; above zero raises the arm", 0),
            ("PITCH", "Pitch", "Left and right; above zero turns to the body's front", 1),
            ("BANK", "Bank", "Twist about the arm", 2),
        ),
        override=OVERRIDE,
    )
    notes: CollectionProperty(
        name="Notes", type=OCTO_MOTION_PG_gait_note, options={"HIDDEN"}, override=OVERRIDE_LIST
    )


CLASSES: Final = (
    OCTO_MOTION_PG_gait_knot,
    OCTO_MOTION_PG_gait_curve,
    OCTO_MOTION_PG_gait_offset,
    OCTO_MOTION_PG_gait_note,
    OCTO_MOTION_PG_gait_table,
)


def fill_table(group: OCTO_MOTION_PG_gait_table, table: GaitTable) -> None:
    """Make the properties say what the table says."""
    group.name = table.name
    group.description = table.description
    group.manner = table.manner
    group.stride = table.stride
    group.spread_pairs, group.spread_sides = table.spread_pairs, table.spread_sides
    group.power_phase = table.power_phase
    group.active_curve = group.active_offset = 0
    for curve, (pair, values) in _matched(group.curves, sorted(table.curves.items())):
        curve.pair = pair
        fill_curve(curve, values)
    for offset, ((pair, side), phase) in _matched(group.offsets, sorted(table.offsets.items())):
        offset.pair, offset.side, offset.phase = pair, side, phase
    for note, (subject, text) in _matched(group.notes, table.notes.items()):
        note.subject, note.text = subject, text


def read_table(group: OCTO_MOTION_PG_gait_table, preset: GaitTable | None = None) -> GaitTable:
    """The table that the properties stand for.

    Args:
        group: the properties.
        preset: stands in for curves where the properties have none.

    Raises:
        GaitError: two curves are for one pair, two knots at one phase, a number is not finite.
    """
    if group.curves:
        description, notes = group.description, {note.subject: note.text for note in group.notes}
        curves = {curve.pair: read_curve(curve) for curve in group.curves}
        if len(curves) < len(group.curves):
            raise GaitError(
                f"Gait '{group.name}' has two curves for one pair of arms.",
                "Remove one, or change its pair.",
            )
    else:
        description, notes = (preset.description, preset.notes) if preset else ("", {})
        curves = preset.curves if preset else {}
    table = GaitTable(
        name=group.name or (preset.name if preset else ""),
        manner=group.manner,
        curves=curves,
        spread_pairs=_number(group.spread_pairs),
        spread_sides=_number(group.spread_sides),
        offsets={(each.pair, each.side): _angle(each.phase) for each in group.offsets},
        stride=_number(group.stride),
        power_phase=_angle(group.power_phase),
        description=description,
        notes=notes,
    )
    return gait.check(table)


def read_curve(curve: OCTO_MOTION_PG_gait_curve) -> GaitCurve:
    """One curve, its knots sorted and closed; not yet checked."""
    phases = np.array([_angle(knot.phase) for knot in curve.knots])
    angles = np.array(
        [[_angles(getattr(knot, name)) for name in ANGLES] for knot in curve.knots]
    ).reshape(len(phases), len(ANGLES), LINKS)
    angles = angles.transpose(0, 2, 1)
    if len(phases) == 0:
        return GaitCurve(np.array([0.0, CYCLE]), np.zeros((2, LINKS, len(ANGLES))))
    # A knot at 360° is the next cycle's first; one at 0° as well would be a second of the kind.
    phases = np.where(phases >= CYCLE - 1e-9, 0.0, phases)
    order = np.argsort(phases, kind="stable")
    phases, angles = phases[order], angles[order]
    start = angles[0]
    if phases[0] > 0.0:
        before = phases[-1] - CYCLE
        share = -before / (phases[0] - before)
        start = (1.0 - share) * angles[-1] + share * angles[0]
        phases, angles = np.append(0.0, phases), np.concatenate([start[None], angles])
    return GaitCurve(np.append(phases, CYCLE), np.concatenate([angles, start[None]]))


def fill_curve(curve: OCTO_MOTION_PG_gait_curve, values: GaitCurve) -> None:
    """Make one curve's properties say what the curve says."""
    curve.active_knot = 0
    open_knots = zip(values.phases[:-1], values.angles[:-1], strict=True)
    for knot, (phase, angles) in _matched(curve.knots, open_knots):
        knot.phase = phase
        for number, name in enumerate(ANGLES):
            setattr(knot, name, angles[:, number])


def _matched(collection: Any, values: Iterable[Any]) -> Iterable[tuple[Any, Any]]:
    """Each value with an item for it: the items that are there, in order, then new ones.

    Items are written anew rather than removed, for those that come from a linked file can be
    changed in a library override but not taken away.
    """
    wanted = list(values)
    while len(collection) > len(wanted):
        collection.remove(len(collection) - 1)
    while len(collection) < len(wanted):
        collection.add()
    return zip(collection, wanted, strict=True)


def _angle(radians: float) -> float:
    return float(_angles(np.array(radians)))


def _angles(radians: Any) -> Floats:
    degrees = np.degrees(np.asarray(radians, dtype=np.float64))
    return np.radians(np.round(degrees, _DEGREE_DIGITS))


def _number(value: float) -> float:
    return round(value, _NUMBER_DIGITS)
