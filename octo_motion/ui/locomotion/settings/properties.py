# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of locomotion, which live on the armature object: ``octo_motion.locomotion``.

Their names are what scripts use. What core reads is declared beside core's own field, see
core/settings.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, Final, cast

import bpy
import numpy as np

from ....blender.files import curve_node, ensure_weight_curve, load_gait
from ....blender.rig import armature_data
from ....core.errors import GaitError
from ....core.locomotion.gait import GaitSettings, GaitTable, gait_presets
from ....core.locomotion.metrics import Figure
from ....core.locomotion.path import TravelSettings
from ....core.phrases import phrase
from ... import declared_settings as props
from ...declared_settings import declared, emptied, make_overridable
from ...live import tell_switched
from .body import OCTO_MOTION_PG_body
from .gait import (
    DEFAULT_GAIT,
    GaitName,
    OCTO_MOTION_PG_gait_table,
    fill_table,
    read_table,
    used,
    weight_property,
)
from .lists import (
    AlongItem,
    ArmList,
    OCTO_MOTION_PG_change,
    OCTO_MOTION_PG_given_pose,
    OCTO_MOTION_PG_ground,
    Reaches,
)

KINDS: Final = (
    ("SLIP", "Slip", "How far an arm slides over the ground that it holds, in arm lengths", 0),
    ("DRIFT", "Drift", "How far what rests on the ground creeps while it does, in arm lengths", 6),
    ("DEPTH", "Depth", "How far an arm's skin is below the ground, in arm lengths", 1),
    ("STRAIN", "Strain", "By how much a bone is longer or shorter than at rest, as a share", 2),
    ("MISS", "Miss", "How far an arm is from its target or foothold, in arm lengths", 3),
    ("TURN", "Turn", "How far a bone turns in the world from one frame to the next", 4),
    ("OVERLAP", "Overlap", "How deep arms pass through each other or the body, in radii", 5),
)

KIND_NAMES: Final = {kind: name for kind, name, _, _ in KINDS}


class FigureItem(bpy.types.PropertyGroup):
    """The worst of one kind, as it is kept with the settings."""

    kind: props.EnumProperty(name="Kind", description="What was measured", items=KINDS)
    value: props.FloatProperty(
        name="Value",
        description="Slip, drift, depth and miss in arm lengths, strain as a share, turn in "
        "radians per frame, overlap in radii",
        precision=5,
    )
    frame: props.IntProperty(
        name="Frame",
        description="Where it is worst; between two frames the first of them",
    )
    arm: props.StringProperty(name="Arm", description="Of which arm; of an overlap both")
    known: props.BoolProperty(
        name="Known",
        description="Whether it was measured in this motion. Off for what a linked file tells of "
        "another one",
        default=True,
    )


def known_figures(settings: Any) -> list[Any]:
    """Items of the figures that were measured, in the order of ``KINDS``."""
    items = settings.figures
    found = {item.kind: item for item in items if item.known}
    return [found[kind] for kind in KIND_NAMES if kind in found]


def write_figures(settings: Any, found: Sequence[Figure]) -> None:
    """Keep figures with the settings."""
    items = settings.figures
    for item in emptied(settings, "figures"):
        item.known = False
    for figure in found:
        item = items.get(figure.kind)
        if item is None:
            item = items.add()
            item.name = item.kind = figure.kind
        item.value, item.frame, item.arm = figure.value, figure.frame, figure.arm
        item.known = True


def _is_weight_curve(_settings: Any, candidate: Any) -> bool:
    return curve_node(candidate) is not None


def _load_gait(settings: Any, _context: bpy.types.Context) -> None:
    if used(settings.table.curves) and settings.table.name == settings.gait:
        return
    try:
        fill_gait_table(settings, settings.gait)
    except GaitError:
        # Generating says it, and the panel shows it: here is nobody to tell.
        return


def _make_weight_curve(settings: Any, _context: bpy.types.Context) -> None:
    if settings.use_weight_curve:
        settings.weight_curve = ensure_weight_curve(
            settings.weight_curve, settings.weight_root, settings.weight_tip
        )


class Movement:
    """What ``Object.octo_motion.locomotion`` has of the gait."""

    gait: GaitName(
        name="Gait",
        description="The gait that is loaded. Choosing one loads its table, which can be edited",
        default=DEFAULT_GAIT,
        update=_load_gait,
    )
    setup: props.StringProperty(
        name="Set-Up",
        description="The set-up that was loaded last",
        options={"HIDDEN"},
    )
    table: props.PointerProperty(
        name="Gait Table",
        description="The gait itself: angles of the arms over one cycle",
        type=OCTO_MOTION_PG_gait_table,
    )
    contraction: declared(GaitSettings, "contraction")
    softness: declared(GaitSettings, "softness")
    give: declared(GaitSettings, "stretch_slack")
    steady: declared(GaitSettings, "smoothing_cycles")
    sway: declared(GaitSettings, "lateral_bend")
    stand: declared(GaitSettings, "raise_to_floor")
    show_targets: props.BoolProperty(
        name="Show Targets",
        description="Draw what the gait has the active arm reach for over the viewport: its three "
        "links from Q0 to Q3, and the joints that are to end there, as an overlay",
    )
    phase_spread: declared(GaitSettings, "phase_spread")
    turning: declared(GaitSettings, "turning")
    uneven: declared(GaitSettings, "uneven")
    variation_min: props.AngleProperty(
        name="Variation Min",
        description="Least random addition to the gait's angles, drawn anew for each cycle",
        default=GaitSettings.variation[0],
        soft_min=-0.5 * np.pi,
        soft_max=0.0,
        min=-np.pi,
        max=np.pi,
        step=100,
    )
    variation_max: props.AngleProperty(
        name="Max",
        description="Greatest random addition to the gait's angles, drawn anew for each cycle",
        default=GaitSettings.variation[1],
        soft_min=0.0,
        soft_max=0.5 * np.pi,
        min=-np.pi,
        max=np.pi,
        step=100,
    )
    seed: declared(GaitSettings, "seed")
    weight_root: weight_property("Weight Root", 0)
    weight_tip: weight_property("Tip", -1)
    use_weight_curve: props.BoolProperty(
        name="Curve",
        description="Draw the weights as a curve from the arm's root, left, to its tip, right",
        update=_make_weight_curve,
    )
    weight_curve: props.PointerProperty(
        name="Weight Curve",
        description="Node group that keeps the curve of joint weights",
        type=bpy.types.NodeTree,
        poll=_is_weight_curve,
    )


def fill_gait_table(settings: Movement, name: str) -> None:
    """Fill the editable table with a gait of the extension or of the user's.

    Raises:
        GaitError: there is no such gait, or its file is damaged.
    """
    set_gait(settings, load_gait(name))


def set_gait(settings: Movement, table: GaitTable) -> None:
    """Fill the editable table with any gait, of the user's presets or not."""
    # In this order: the gait that is in the table already is not loaded once more.
    fill_table(settings.table, table)
    settings.gait = table.name


def read_gait(settings: Movement) -> GaitTable:
    """The gait as it is set.

    Raises:
        GaitError: no gait of the chosen name could be loaded, or the table is no gait.
    """
    if used(settings.table.curves) and settings.table.name == settings.gait:
        return read_table(settings.table)
    # Files are asked for what is not built in alone.
    preset = gait_presets().get(settings.gait) or load_gait(settings.gait)
    if used(settings.table.curves):
        raise GaitError(
            phrase(
                "The gait '{gait}' is not loaded, '{table}' is.",
                gait=settings.gait,
                table=settings.table.name,
            ),
            "Choose the gait anew.",
        )
    return read_table(settings.table, preset)


# --- The route, and how it is travelled -----------------------------------------------------------


class RouteSettings:
    """What ``Object.octo_motion.locomotion`` has of the route."""

    route: props.PointerProperty(
        name="Route",
        description="Curve to travel along. For a walk it lies on the ground",
        type=bpy.types.Object,
        poll=props.is_of({"CURVE"}),
    )
    spline: props.IntProperty(
        name="Spline",
        description="Which of the curve's splines to follow, counted from 0; -1 takes the longest",
        default=-1,
        min=-1,
    )
    speed_mode: declared(TravelSettings, "speed")
    ease_in: declared(TravelSettings, "ease_in")
    stalk: declared(TravelSettings, "stalk")
    slow_in_bends: declared(TravelSettings, "slow_in_bends")
    ease_out: declared(TravelSettings, "ease_out")
    heading: declared(TravelSettings, "heading")
    heading_angle: declared(TravelSettings, "heading_angle")
    keep_upright: declared(TravelSettings, "keep_upright")
    look_ahead: declared(TravelSettings, "look_ahead")
    corner: declared(TravelSettings, "corner")
    burst: declared(TravelSettings, "burst")
    bank_in_turns: declared(TravelSettings, "bank")
    streamline: props.FactorProperty(
        name="Streamline",
        description="Swimming: how far head and mantle stretch out along the way. At 0 they lean "
        "back as they do at rest. A body whose mantle lies flat behind it swims as it lies instead",
        default=1.0,
    )
    height_mode: props.EnumProperty(
        name="Height",
        description="How high above the route the body's center travels",
        items=(
            (
                "AUTO",
                "Automatic",
                "Walking: as high as the arms need to stand on the route. Swimming: on it",
                0,
            ),
            ("MANUAL", "Manual", "As high as given", 1),
        ),
    )
    height: props.FloatProperty(
        name="Height",
        description="Distance of the body's center above the route",
        subtype="DISTANCE",
        soft_min=-10.0,
        soft_max=10.0,
    )
    along: props.CollectionProperty(
        name="Along the Route",
        description="Values that settings have at places of the route, in any order",
        type=AlongItem,
    )
    active_along: props.IntProperty(name="Active Value", options={"HIDDEN"})


# --- When the motion is, what it moves, and which keys it gets ------------------------------------


_Seconds: Final = partial(
    props.FloatProperty, subtype="TIME_ABSOLUTE", unit="TIME_ABSOLUTE", soft_max=20.0, step=10
)
_IN_PLACE: Final = (
    "Nothing travels: whole cycles on the spot, whose last frame meets the first, for games and "
    "for a creature that stays. No route is needed; a root bone lifts the body to its height over "
    "the armature's origin"
)


class Timing:
    """What ``Object.octo_motion.locomotion`` has of time, of the body's travel and breath."""

    timing: props.EnumProperty(
        name="Timing",
        description="What decides how long the journey takes",
        items=(
            ("CADENCE", "Cycle", "The time that one cycle of the gait takes", 0),
            ("SPEED", "Speed", "The speed of the body", 1),
            ("RANGE", "Frames", "The first and the last frame", 2),
        ),
    )
    cycle_time: _Seconds(
        name="Cycle",
        description="Time that one cycle of the gait takes at full speed",
        default=2.0,
        min=0.01,
        soft_min=0.2,
    )
    speed: props.FloatProperty(
        name="Speed",
        description="Full speed of the body along the route",
        unit="VELOCITY",
        default=0.5,
        min=1e-5,
        soft_max=10.0,
        step=10,
    )
    frame_start: props.IntProperty(name="Start", description="First frame of the motion", default=1)
    frame_end: props.IntProperty(name="End", description="Last frame of the motion", default=250)
    travel_on: props.EnumProperty(
        name="Travel on",
        description="What carries the body along the route",
        items=(
            ("OBJECT", "Object", "The armature object moves", 0),
            ("BONE", "Root Bone", "The object stays; its root bone moves, as game engines like", 1),
            ("NONE", "In Place", _IN_PLACE, 2),
        ),
    )
    extend_scene_range: props.BoolProperty(
        name="Extend Scene Range",
        description="Move the scene's end frame if the motion lasts longer, so that playback and "
        "rendering show all of it. The range is never shortened, and the message says so when it "
        "is extended. Switch it off where a shot has its length",
        default=True,
    )
    cycles: props.IntProperty(
        name="Cycles",
        description="In place: how many cycles of the gait the loop has. Random additions repeat "
        "with the loop, so more cycles look less even",
        default=1,
        min=1,
        soft_max=12,
        max=10_000,
    )
    repeat: props.BoolProperty(
        name="Repeat",
        description="In place: curves repeat before and after the loop, by Cycles modifiers. "
        "Exporters take the loop alone",
        default=True,
    )
    breathing: props.FactorProperty(
        name="Breathing",
        description="How much wider the mantle gets with each breath; 0 for none",
        default=0.05,
        soft_max=0.3,
        step=1,
    )
    breath_time: _Seconds(
        name="Breath",
        description="Time that one breath takes at rest; a body that goes fast breathes faster. A "
        "loop takes a whole number of breaths",
        default=3.0,
        min=0.05,
    )


class Outcome:
    """What ``Object.octo_motion.locomotion`` has of what is made: keys, quality, live."""

    keys: props.EnumProperty(
        name="Keys",
        description="How many keys the motion gets",
        items=(
            ("DENSE", "All", "A key on every frame: the motion exactly as computed", 0),
            (
                "REDUCED",
                "Few",
                "As few keys as the tolerance allows, with handles; each arm in one group",
                1,
            ),
        ),
    )
    key_angle: props.FloatProperty(
        name="Angle",
        description="How far any bone may be turned away, at any frame, where there are few keys",
        subtype="ANGLE",
        default=np.radians(0.5),
        min=0.0,
        max=np.pi,
        soft_max=np.radians(10.0),
        step=10,
        precision=2,
    )
    key_distance: props.FloatProperty(
        name="Distance",
        description="How far any arm's tip may be away, at any frame, where there are few keys. "
        "In arm lengths",
        default=0.005,
        min=0.0,
        soft_max=0.1,
        step=0.1,
        precision=4,
    )
    key_columns: props.EnumProperty(
        name="Columns",
        description="Which channels have their keys at the same frames, where there are few keys",
        items=(
            (
                "ARM",
                "Each Arm",
                "An arm's pose is one column, easy to retime. Some two thirds more keys",
                0,
            ),
            (
                "BONE",
                "Each Bone",
                "Each bone has keys where it needs them: the fewest. Arms stay channel groups",
                1,
            ),
        ),
        default="BONE",
    )
    result: props.PointerProperty(
        name="Result",
        description="The action that was generated last. It is made anew in place until you edit "
        "it; then it is yours, and the next one is a new action",
        type=bpy.types.Action,
    )
    extended_from: props.IntProperty(
        name="Extended From",
        description="Where the scene ended before it was extended for this motion",
        options={"HIDDEN"},
    )
    extended_to: props.IntProperty(
        name="Extended To",
        description="Where it ends since; 0 if it was not extended",
        options={"HIDDEN"},
    )
    keep_apart: props.BoolProperty(
        name="Keep Apart",
        description="Arms that would pass through each other or through the body make way: those "
        "in the air, and what does not lie on the ground of those that hold on",
        default=True,
    )
    tell_overlaps: props.BoolProperty(
        name="Tell Overlaps",
        description="After generating, say at which frame an arm passes deepest through another "
        "or through the body, if by more than a tenth of its thickness",
        default=True,
    )
    figures: props.CollectionProperty(
        name="Quality",
        description="The worst of each kind in the motion that was generated last",
        type=FigureItem,
    )
    live: props.BoolProperty(
        name="Live",
        description="Make the motion anew by itself whenever its route, its ground or a setting "
        "changes: the frame in sight at once, all others while Blender idles. Generate measures "
        "it. Switches itself off when you edit the action",
        update=tell_switched,
    )
    live_error: props.StringProperty(
        name="Live Error",
        description="Why the motion does not follow at the moment; the last one that could be "
        "made is still there",
        options={"HIDDEN"},
    )


class OCTO_MOTION_PG_locomotion(
    ArmList, RouteSettings, Movement, Reaches, Timing, Outcome, bpy.types.PropertyGroup
):
    """How an armature walks or swims along a route."""

    ground: props.PointerProperty(
        name="Ground",
        description="What a walking creature stands on, and how",
        type=OCTO_MOTION_PG_ground,
    )
    body: props.PointerProperty(
        name="Body",
        description="What the body does by itself while its arms carry it",
        type=OCTO_MOTION_PG_body,
    )
    change: props.PointerProperty(
        name="Change of Gait",
        description="Where along the route the gait changes",
        type=OCTO_MOTION_PG_change,
    )
    begin_pose: props.PointerProperty(
        name="Begin",
        description="A pose that the motion begins in",
        type=OCTO_MOTION_PG_given_pose,
    )
    end_pose: props.PointerProperty(
        name="End",
        description="A pose that the motion ends in",
        type=OCTO_MOTION_PG_given_pose,
    )


def locomotion_settings(armature: bpy.types.Object) -> OCTO_MOTION_PG_locomotion:
    """The settings of an armature object.

    Raises:
        RigError: the object is no armature.
    """
    armature_data(armature)
    make_overridable(armature)
    return cast("OCTO_MOTION_PG_locomotion", armature.octo_motion.locomotion)  # type: ignore[attr-defined]
