# SPDX-License-Identifier: GPL-3.0-or-later
"""The gait table as properties that an artist edits, and the way between them and core's table.

A table without curves stands for the preset that the settings name: so a new armature has a gait
before anything was written, and a linked one stays light. Choosing a gait fills it.

Knots here need not be in order, and the last one, at 360°, is left out: it always equals the
first. So whatever an artist does with them, the table closes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any, Final

import bpy
import numpy as np

from ....blender.files import gait_names
from ....core.errors import GaitError
from ....core.locomotion.gait import (
    ANGLES,
    CYCLE,
    LINKS,
    GaitCurve,
    GaitSettings,
    GaitTable,
    check_gait,
    gait_from_json,
    gait_presets,
    gait_to_json,
)
from ....core.phrases import phrase
from ....core.rotations import Floats
from ... import declared_settings as props
from ...declared_settings import assign

DEFAULT_GAIT: Final = "walk"
_DEFAULT: Final = gait_presets()[DEFAULT_GAIT]

SIDES: Final = (
    ("LEFT", "Left", "The arm on the left", 0),
    ("RIGHT", "Right", "The arm on the right", 1),
    ("CENTER", "Center", "The arm in the middle, which has no partner", 2),
)

# Properties are single precision; people give degrees and simple fractions. Rounding brings back
# what they meant, so that a table is the same before and after its way through properties.
_DEGREE_DIGITS: Final = 4
_NUMBER_DIGITS: Final = 6


def _gait_names(_owner: Any, _context: Any, _text: str) -> list[str]:
    return gait_names()


GaitName: Final = partial(props.StringProperty, search=_gait_names, search_options=set())
"""A property that names a gait, and offers those that there are."""


def weight_property(name: str, end: int) -> Any:
    """The weight of the joints at an arm's root, end 0, or its tip, end −1."""
    place, other = ("root", "tip") if end == 0 else ("tip", "root")
    return props.FactorProperty(
        name=name,
        description=f"How readily joints at the arm's {place} bend, against those at its {other}: "
        f"the higher of the two has the bends. Alike, they change next to nothing",
        default=GaitSettings.weights[end],
        min=0.01,
    )


def _unused() -> Any:
    return props.BoolProperty(
        name="Unused",
        description="Left out. Items of a linked file can be changed here, but not removed",
        options={"HIDDEN"},
    )


def _text(group: OCTO_MOTION_PG_gait_table) -> str:
    preset = gait_presets().get(group.name)
    if preset is None and not used(group.curves):
        return ""
    try:
        return gait_to_json(read_table(group, preset))
    except GaitError:
        return ""


def _set_text(group: OCTO_MOTION_PG_gait_table, text: str) -> None:
    try:
        table = gait_from_json(text, phrase("The text"))
    except GaitError:
        # Blender only prints what a property's setter raises. A name that is not the chosen
        # gait's makes everyone say so.
        assign(group, "name", "")
        return
    fill_table(group, table)


def _link_angles(name: str, description: str) -> Any:
    return props.FloatVectorProperty(
        name=name,
        description=f"{description}. One angle for each third of the arm, from root to tip",
        size=LINKS,
        unit="ROTATION",
        soft_min=-np.pi,
        soft_max=np.pi,
        step=500,
        precision=1,
    )


class OCTO_MOTION_PG_gait_knot(bpy.types.PropertyGroup):
    """Angles of the three links at one phase."""

    phase: props.AngleProperty(
        name="Phase",
        description="Where in the cycle these angles are reached; between them they run evenly",
        min=0.0,
        max=2.0 * np.pi,
    )
    head: _link_angles("Head", "Up and down; above zero raises")
    pitch: _link_angles("Pitch", "Left and right; above zero turns to the body's front")
    bank: _link_angles("Bank", "Twist about the arm")
    unused: _unused()


class OCTO_MOTION_PG_gait_curve(bpy.types.PropertyGroup):
    """The angles of one pair of arms over a cycle."""

    pair: props.IntProperty(
        name="Pair",
        description="Pair of arms that these angles are for, 1 in front; 0 is for all others",
        min=-50,
        soft_min=0,
    )
    knots: props.CollectionProperty(
        name="Knots",
        description="Angles at some phases; the last runs on to the first",
        type=OCTO_MOTION_PG_gait_knot,
    )
    free: props.BoolProperty(
        name="Off the Ground",
        description="These arms never hold on to the ground: they move as the table says",
    )
    active_knot: props.IntProperty(name="Active Knot", options={"HIDDEN"})
    unused: _unused()


class OCTO_MOTION_PG_gait_offset(bpy.types.PropertyGroup):
    """How far one arm is ahead, in place of the spread."""

    pair: props.IntProperty(
        name="Pair",
        description="Pair of the arm, 1 in front",
        min=-50,
        soft_min=1,
        default=1,
    )
    side: props.EnumProperty(name="Side", description="Side of the arm", items=SIDES)
    phase: props.AngleProperty(
        name="Ahead",
        description="How far this arm is ahead of the body's cycle, whatever the spread says",
        soft_min=-2.0 * np.pi,
        soft_max=2.0 * np.pi,
    )
    unused: _unused()


class OCTO_MOTION_PG_gait_note(bpy.types.PropertyGroup):
    """A remark that travels with the table."""

    subject: props.StringProperty(name="Subject", description="What the remark is about")
    text: props.StringProperty(name="Text", description="The remark itself")
    unused: _unused()


class OCTO_MOTION_PG_gait_table(bpy.types.PropertyGroup):
    """A gait table."""

    name: props.StringProperty(name="Name", description="Name of the gait that was loaded")
    description: props.StringProperty(name="Description", description="What this gait is for")
    manner: props.EnumProperty(
        name="Manner",
        description="How the body travels with this gait",
        items=(
            ("WALK", "Walk", "Over the ground: the body stays upright, its front ahead", 0),
            ("SWIM", "Swim", "Through the water: the mantle goes ahead and the arms trail", 1),
            (
                "CRAWL",
                "Crawl",
                "Over the ground without a rhythm, each arm in its own time, facing any way",
                2,
            ),
        ),
        default=_DEFAULT.manner,
    )
    stride: props.FloatProperty(
        name="Stride",
        description="How far the body travels in one cycle, in arm lengths. A longer stride "
        "covers the route in fewer cycles",
        default=_DEFAULT.stride,
        min=0.001,
        soft_min=0.1,
        soft_max=3.0,
        step=5,
    )
    spread_pairs: props.FloatProperty(
        name="Pairs",
        description="How the pairs follow one another: cycles from the first pair to the last. "
        "At 1 a wave runs over the arms, at 0 all pairs move together",
        default=_DEFAULT.spread_pairs,
        soft_min=-2.0,
        soft_max=2.0,
        step=5,
    )
    spread_sides: props.FloatProperty(
        name="Sides",
        description="Cycles that the right side is ahead of the left. At 0.5 the sides take "
        "turns, at 0 they move together",
        default=_DEFAULT.spread_sides,
        soft_min=-1.0,
        soft_max=1.0,
        step=5,
    )
    spread_halves: props.FloatProperty(
        name="Halves",
        description="Cycles that the rear half of the arms is ahead of the front half",
        default=_DEFAULT.spread_halves,
        options={"HIDDEN"},
    )
    offsets: props.CollectionProperty(
        name="Offsets",
        description="Arms that keep a phase of their own, whatever the spread says",
        type=OCTO_MOTION_PG_gait_offset,
    )
    active_offset: props.IntProperty(name="Active Offset", options={"HIDDEN"})
    power_phase: props.AngleProperty(
        name="Power Stroke",
        description="Phase at the middle of the power stroke: a swimming body shoots ahead there",
        default=_DEFAULT.power_phase,
        min=0.0,
        max=2.0 * np.pi,
    )
    curves: props.CollectionProperty(
        name="Curves",
        description="Angles of the arms over one cycle: one curve for all pairs, others for "
        "single pairs. Without any, the preset's",
        type=OCTO_MOTION_PG_gait_curve,
    )
    active_curve: props.IntProperty(name="Active Curve", options={"HIDDEN"})
    shown_angle: props.EnumProperty(
        name="Angle",
        description="Which of the three angles the table shows",
        items=(
            ("HEAD", "Head", "Up and down; above zero raises the arm", 0),
            ("PITCH", "Pitch", "Left and right; above zero turns to the body's front", 1),
            ("BANK", "Bank", "Twist about the arm", 2),
        ),
    )
    notes: props.CollectionProperty(name="Notes", type=OCTO_MOTION_PG_gait_note, options={"HIDDEN"})
    as_text: bpy.props.StringProperty(
        name="Text",
        description="The whole table as in a gait's file (JSON), to read and to set",
        get=_text,
        set=_set_text,
        options={"HIDDEN", "SKIP_SAVE"},
    )


def used(collection: Any) -> list[Any]:
    """The items of one of the table's lists that count."""
    return [item for item in collection if not item.unused]


def fill_table(group: OCTO_MOTION_PG_gait_table, table: GaitTable) -> None:
    """Make the properties say what the table says."""
    for name in (
        *("name", "description", "manner", "stride"),
        *("spread_pairs", "spread_sides", "spread_halves", "power_phase"),
    ):
        assign(group, name, getattr(table, name))
    assign(group, "active_curve", 0)
    for curve, (pair, values) in matched(group, "curves", sorted(table.curves.items())):
        assign(curve, "pair", pair)
        fill_curve(curve, values)
    fill_offsets(group, table.offsets)
    for note, (subject, text) in matched(group, "notes", table.notes.items()):
        assign(note, "subject", subject)
        assign(note, "text", text)


def fill_offsets(
    group: OCTO_MOTION_PG_gait_table, offsets: Mapping[tuple[int, str], float]
) -> None:
    """Make the table's offsets these."""
    assign(group, "active_offset", 0)
    for item, ((pair, side), phase) in matched(group, "offsets", sorted(offsets.items())):
        assign(item, "pair", pair)
        assign(item, "side", side)
        assign(item, "phase", phase)


def fill_curve(curve: OCTO_MOTION_PG_gait_curve, values: GaitCurve) -> None:
    """Make one curve's properties say what the curve says."""
    assign(curve, "active_knot", 0)
    assign(curve, "free", values.free)
    open_knots = zip(values.phases[:-1], values.angles[:-1], strict=True)
    for knot, (phase, angles) in matched(curve, "knots", open_knots):
        assign(knot, "phase", phase)
        for number, name in enumerate(ANGLES):
            assign(knot, name, angles[:, number])


def read_table(group: OCTO_MOTION_PG_gait_table, preset: GaitTable | None = None) -> GaitTable:
    """The table that the properties stand for; a preset stands in for curves where they have none.

    Raises:
        GaitError: two curves are for one pair, two knots at one phase, a number is not finite.
    """
    listed = used(group.curves)
    if listed:
        description = group.description
        notes = {note.subject: note.text for note in used(group.notes)}
        curves = {curve.pair: read_curve(curve) for curve in listed}
        if len(curves) < len(listed):
            raise GaitError(
                phrase("Gait '{group}' has two curves for one pair of arms.", group=group.name),
                "Remove one, or change its pair.",
            )
    else:
        description, notes = (preset.description, preset.notes) if preset else ("", {})
        curves = preset.curves if preset else {}
    offsets = preset.offsets if preset and not listed else {}
    own = {(each.pair, each.side): _angle(each.phase) for each in used(group.offsets)}
    table = GaitTable(
        name=group.name or (preset.name if preset else ""),
        manner=group.manner,
        curves=curves,
        spread_pairs=_number(group.spread_pairs),
        spread_sides=_number(group.spread_sides),
        spread_halves=_number(group.spread_halves),
        offsets={**offsets, **own},
        stride=_number(group.stride),
        power_phase=_angle(group.power_phase),
        description=description,
        notes=notes,
    )
    return check_gait(table)


def read_curve(curve: OCTO_MOTION_PG_gait_curve) -> GaitCurve:
    """One curve, its knots sorted and closed; not yet checked."""
    knots = used(curve.knots)
    if not knots:
        angles = np.zeros((2, LINKS, len(ANGLES)))
        return GaitCurve(np.array([0.0, CYCLE]), angles, free=curve.free)
    phases = np.array([_angle(knot.phase) for knot in knots])
    angles = np.stack(
        [np.stack([_angles(getattr(knot, name)) for name in ANGLES], axis=1) for knot in knots]
    )
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
    angles = np.concatenate([angles, start[None]])
    return GaitCurve(np.append(phases, CYCLE), angles, free=curve.free)


def matched(group: Any, name: str, values: Iterable[Any]) -> Iterable[tuple[Any, Any]]:
    """Each value with an item of a list for it: those that are there, in order, then new ones.

    Items left over are removed, or marked as unused where they come from a linked file: in a
    library override they can be changed but not taken away.
    """
    collection, wanted = getattr(group, name), list(values)
    least = max(len(wanted), _linked_count(group, name))
    while len(collection) > least:
        collection.remove(len(collection) - 1)
    while len(collection) < len(wanted):
        # Library overrides tell items apart by name, and lose some of those that have none.
        collection.add().name = str(len(collection))
    for number, item in enumerate(collection):
        assign(item, "unused", number >= len(wanted))
    return zip(collection, wanted, strict=False)


def _linked_count(group: Any, name: str) -> int:
    """How many items of a list a library override has from its linked file."""
    override = group.id_data.override_library if group.id_data else None
    if override is None or override.reference is None:
        return 0
    try:
        original = override.reference.path_resolve(group.path_from_id())
    except ValueError:
        # Within an item that was added here.
        return 0
    return len(getattr(original, name))


def _angle(radians: float) -> float:
    return float(_angles(np.array(radians)))


def _angles(radians: Any) -> Floats:
    degrees = np.degrees(np.asarray(radians, dtype=np.float64))
    return np.radians(np.round(degrees, _DEGREE_DIGITS))


def _number(value: float) -> float:
    return round(value, _NUMBER_DIGITS)
