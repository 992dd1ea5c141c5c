# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of locomotion, which live on the armature object: ``octo_motion.locomotion``.

Their names are what scripts use. Where core has a default, it is the default here.
"""

from __future__ import annotations

from typing import Any, Final, cast

import bpy
import numpy as np
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ....blender.files import curve_node, ensure_weight_curve, gait_names, load_gait
from ....blender.rig import armature_data
from ....core.errors import GaitError
from ....core.locomotion.gait import MOST_STEADY, GaitSettings, GaitTable
from ....core.locomotion.path import TravelSettings
from ...override_flags import OVERRIDE, OVERRIDE_LIST
from ...override_groups import make_overridable
from .arms import ArmItem
from .changes import OCTO_MOTION_PG_change
from .gait import DEFAULT_GAIT, OCTO_MOTION_PG_gait_table, fill_table, read_table, used
from .ground import OCTO_MOTION_PG_ground
from .in_place import TRAVEL_IN_PLACE, InPlace
from .keep_apart import KeepingApart
from .live import LiveSettings
from .quality import QualityReport
from .reaches import Reaches

AXES: Final = (
    ("X", "X", "The armature's own +X", 0),
    ("Y", "Y", "The armature's own +Y", 1),
    ("Z", "Z", "The armature's own +Z", 2),
    ("-X", "-X", "The armature's own −X", 3),
    ("-Y", "-Y", "The armature's own −Y", 4),
    ("-Z", "-Z", "The armature's own −Z", 5),
)


def _is_curve(_settings: Any, candidate: bpy.types.Object) -> bool:
    return candidate.type == "CURVE"


def _is_weight_curve(_settings: Any, candidate: bpy.types.NodeTree) -> bool:
    return curve_node(candidate) is not None


def _gait_names(_settings: Any, _context: Any, _text: str) -> list[str]:
    return gait_names()


def _load_gait(settings: OCTO_MOTION_PG_locomotion, _context: bpy.types.Context) -> None:
    if used(settings.table.curves) and settings.table.name == settings.gait:
        return
    try:
        fill_gait_table(settings, settings.gait)
    except GaitError:
        # Generating says it, and the panel shows it: here is nobody to tell.
        return


def _make_weight_curve(settings: OCTO_MOTION_PG_locomotion, _context: bpy.types.Context) -> None:
    if settings.use_weight_curve:
        settings.weight_curve = ensure_weight_curve(
            settings.weight_curve, settings.weight_root, settings.weight_tip
        )


class OCTO_MOTION_PG_locomotion(
    QualityReport, Reaches, InPlace, KeepingApart, LiveSettings, bpy.types.PropertyGroup
):
    """How an armature walks or swims along a route."""

    # --- The rig -------------------------------------------------------------------------------

    arms: CollectionProperty(
        name="Arms",
        description="The arms that are moved; without any, they are detected when generating",
        type=ArmItem,
        override=OVERRIDE_LIST,
    )
    active_arm: IntProperty(name="Active Arm", options={"HIDDEN"}, override=OVERRIDE)
    body_front: EnumProperty(
        name="Front",
        description="Which way the body faces, as an axis of the armature",
        items=AXES,
        default="-Y",
        override=OVERRIDE,
    )
    body_up: EnumProperty(
        name="Up",
        description="Where the body's top is, as an axis of the armature",
        items=AXES,
        default="Z",
        override=OVERRIDE,
    )
    root_bone: StringProperty(
        name="Root Bone",
        description="Bone that carries the whole body; it can take the travel along the route",
        override=OVERRIDE,
    )

    # --- The route -----------------------------------------------------------------------------

    route: PointerProperty(
        name="Route",
        description="Curve to travel along. For a walk it lies on the ground",
        type=bpy.types.Object,
        poll=_is_curve,
        override=OVERRIDE,
    )
    spline: IntProperty(
        name="Spline",
        description="Which of the curve's splines to follow, counted from 0; -1 takes the longest",
        default=-1,
        min=-1,
        override=OVERRIDE,
    )
    speed_mode: EnumProperty(
        name="Pace",
        description="How travel is spread over the time",
        items=(
            ("EVEN", "Even", "Equal distances in equal times, however the curve is drawn", 0),
            (
                "NATURAL",
                "Natural",
                "The curve's own parameter runs evenly: slower where its points lie close",
                1,
            ),
        ),
        override=OVERRIDE,
    )
    ease_in: FloatProperty(
        name="Ease In",
        description="Share of the time spent speeding up from a standstill",
        subtype="FACTOR",
        default=0.1,
        min=0.0,
        max=1.0,
        override=OVERRIDE,
    )
    ease_out: FloatProperty(
        name="Ease Out",
        description="Share of the time spent slowing down to a standstill",
        subtype="FACTOR",
        default=0.1,
        min=0.0,
        max=1.0,
        override=OVERRIDE,
    )
    heading: EnumProperty(
        name="Heading",
        description="Which way a walking body faces; a swimming one turns with its route",
        items=(
            ("ALONG", "Along", "Turn with the route", 0),
            ("FIXED", "Fixed", "Keep facing one way, as an octopus can while it crawls", 1),
        ),
        default=TravelSettings.heading,
        override=OVERRIDE,
    )
    heading_angle: FloatProperty(
        name="Angle",
        description="Along: how far the front is turned away from travel, to the left, so that a "
        "body can crawl sideways. Fixed: compass angle of the front about Z, 0 faces -Y",
        subtype="ANGLE",
        default=TravelSettings.heading_angle,
        soft_min=-np.pi,
        soft_max=np.pi,
        step=500,
        precision=1,
        override=OVERRIDE,
    )
    keep_upright: BoolProperty(
        name="Keep Upright",
        description="Walking, stay upright on a slope instead of leaning with it",
        default=TravelSettings.keep_upright,
        override=OVERRIDE,
    )
    look_ahead: FloatProperty(
        name="Look Ahead",
        description="How many strides ahead the body looks for the turn that its arms prepare",
        default=TravelSettings.look_ahead,
        min=0.0,
        soft_max=5.0,
        step=10,
        override=OVERRIDE,
    )
    corner: FloatProperty(
        name="Corner",
        description="Strides before and after a sharp corner within which the body turns; "
        "gentle bends are left as they are",
        default=TravelSettings.corner,
        min=0.01,
        soft_max=2.0,
        step=5,
        override=OVERRIDE,
    )
    height_mode: EnumProperty(
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
        override=OVERRIDE,
    )
    height: FloatProperty(
        name="Height",
        description="Distance of the body's center above the route",
        subtype="DISTANCE",
        soft_min=-10.0,
        soft_max=10.0,
        override=OVERRIDE,
    )

    stand: BoolProperty(
        name="Stand",
        description="Walking, arms that would reach deeper than most lie down at their depth, so "
        "that several stand on the ground together. Off, the gait's angles alone count, and the "
        "creature hangs on the tip of its deepest arm",
        default=True,  # other than in core, where the source's walk is the default
        override=OVERRIDE,
    )

    ground: PointerProperty(
        name="Ground",
        description="What a walking creature stands on, and how",
        type=OCTO_MOTION_PG_ground,
        override=OVERRIDE,
    )
    change: PointerProperty(
        name="Change of Gait",
        description="Where along the route the gait changes",
        type=OCTO_MOTION_PG_change,
        override=OVERRIDE,
    )

    # --- The gait ------------------------------------------------------------------------------

    gait: StringProperty(
        name="Gait",
        description="The gait that is loaded. Choosing one loads its table, which can be edited",
        default=DEFAULT_GAIT,
        search=_gait_names,
        search_options=set(),
        update=_load_gait,
        override=OVERRIDE,
    )
    table: PointerProperty(
        name="Gait Table",
        description="The gait itself: angles of the arms over one cycle",
        type=OCTO_MOTION_PG_gait_table,
        override=OVERRIDE,
    )
    contraction: FloatProperty(
        name="Contraction",
        description="How much an arm shortens as it bends: 1 as an octopus does, 0 not at all",
        default=GaitSettings.contraction,
        min=0.0,
        soft_max=1.0,
        max=4.0,
        step=5,
        override=OVERRIDE,
    )
    softness: FloatProperty(
        name="Softness",
        description="How far a bend spreads over neighbouring joints: 0 leaves it where it falls",
        subtype="FACTOR",
        default=GaitSettings.softness,
        min=0.0,
        max=1.0,
        override=OVERRIDE,
    )
    give: FloatProperty(
        name="Give",
        description="How far an arm may reach beyond its targets as it straightens, in lengths of "
        "a third of it: it straightens gently. 0 meets them exactly, and snaps straight",
        subtype="FACTOR",
        default=0.08,
        min=0.0,
        max=1.0,
        soft_max=0.3,
        override=OVERRIDE,
    )
    steady: FloatProperty(
        name="Steady",
        description="How much of a cycle movement is evened out over, before and after each "
        "moment: arms in the air move smoothly. 0 keeps every corner of the gait's table",
        default=0.08,
        min=0.0,
        max=MOST_STEADY,
        soft_max=0.15,
        step=1,
        precision=3,
        override=OVERRIDE,
    )
    sway: FloatProperty(
        name="Sway",
        description="Bend across the gait's own that keeps an arm from becoming a straight line",
        subtype="ANGLE",
        default=GaitSettings.lateral_bend,
        min=0.0,
        max=0.5 * np.pi,
        soft_max=np.radians(45.0),
        step=100,
        precision=1,
        override=OVERRIDE,
    )
    phase_spread: FloatProperty(
        name="Phase Spread",
        description="How far the arms are apart in the cycle: 1 as the gait says, 0 all together",
        default=GaitSettings.phase_spread,
        soft_min=0.0,
        soft_max=2.0,
        step=5,
        override=OVERRIDE,
    )
    turning: FloatProperty(
        name="Turning",
        description="Share of the turn that lies ahead which the arms take on",
        default=GaitSettings.turning,
        min=0.0,
        soft_max=1.0,
        max=4.0,
        step=5,
        override=OVERRIDE,
    )
    burst: FloatProperty(
        name="Burst",
        description="Swimming: 0 glides evenly, 1 shoots ahead with each stroke and nearly stops",
        subtype="FACTOR",
        default=TravelSettings.burst,
        min=0.0,
        max=1.0,
        override=OVERRIDE,
    )
    streamline: FloatProperty(
        name="Streamline",
        description="Swimming: how far head and mantle stretch out along the way. At 0 they lean "
        "back as they do at rest. A body whose mantle lies flat behind it swims as it lies instead",
        subtype="FACTOR",
        default=1.0,
        min=0.0,
        max=1.0,
        override=OVERRIDE,
    )
    bank_in_turns: FloatProperty(
        name="Bank in Turns",
        description="Swimming: how far the body rolls into a turn. At 1, a turn of 45° in a "
        "stride rolls it by 38°",
        default=TravelSettings.bank,
        min=0.0,
        soft_max=1.0,
        max=4.0,
        step=5,
        override=OVERRIDE,
    )

    # --- Variation -----------------------------------------------------------------------------

    variation_min: FloatProperty(
        name="Variation Min",
        description="Least random addition to the gait's angles, drawn anew for each cycle",
        subtype="ANGLE",
        default=GaitSettings.variation[0],
        soft_min=-0.5 * np.pi,
        soft_max=0.0,
        min=-np.pi,
        max=np.pi,
        step=100,
        precision=1,
        override=OVERRIDE,
    )
    variation_max: FloatProperty(
        name="Max",
        description="Greatest random addition to the gait's angles, drawn anew for each cycle",
        subtype="ANGLE",
        default=GaitSettings.variation[1],
        soft_min=0.0,
        soft_max=0.5 * np.pi,
        min=-np.pi,
        max=np.pi,
        step=100,
        precision=1,
        override=OVERRIDE,
    )
    seed: IntProperty(
        name="Seed",
        description="Another number gives another variation, the same number the same one",
        default=GaitSettings.seed,
        min=0,
        override=OVERRIDE,
    )

    # --- Joint weights -------------------------------------------------------------------------

    weight_root: FloatProperty(
        name="Weight Root",
        description="How readily joints at the arm's root bend. Lower weights spread a bend over "
        "more joints",
        subtype="FACTOR",
        default=GaitSettings.weights[0],
        min=0.01,
        max=1.0,
        override=OVERRIDE,
    )
    weight_tip: FloatProperty(
        name="Tip",
        description="How readily joints at the arm's tip bend. Lower than at the root, the bend "
        "moves to the root",
        subtype="FACTOR",
        default=GaitSettings.weights[-1],
        min=0.01,
        max=1.0,
        override=OVERRIDE,
    )
    use_weight_curve: BoolProperty(
        name="Curve",
        description="Draw the weights as a curve from the arm's root, left, to its tip, right",
        update=_make_weight_curve,
        override=OVERRIDE,
    )
    weight_curve: PointerProperty(
        name="Weight Curve",
        description="Node group that keeps the curve of joint weights",
        type=bpy.types.NodeTree,
        poll=_is_weight_curve,
        override=OVERRIDE,
    )

    # --- Timing and result ---------------------------------------------------------------------

    timing: EnumProperty(
        name="Timing",
        description="What decides how long the journey takes",
        items=(
            ("CADENCE", "Cycle", "The time that one cycle of the gait takes", 0),
            ("SPEED", "Speed", "The speed of the body", 1),
            ("RANGE", "Frames", "The first and the last frame", 2),
        ),
        override=OVERRIDE,
    )
    cycle_time: FloatProperty(
        name="Cycle",
        description="Time that one cycle of the gait takes at full speed",
        subtype="TIME_ABSOLUTE",
        unit="TIME_ABSOLUTE",
        default=2.0,
        min=0.01,
        soft_min=0.2,
        soft_max=20.0,
        step=10,
        override=OVERRIDE,
    )
    speed: FloatProperty(
        name="Speed",
        description="Full speed of the body along the route",
        unit="VELOCITY",
        default=0.5,
        min=1e-5,
        soft_max=10.0,
        step=10,
        override=OVERRIDE,
    )
    frame_start: IntProperty(
        name="Start", description="First frame of the motion", default=1, override=OVERRIDE
    )
    frame_end: IntProperty(
        name="End", description="Last frame of the motion", default=250, override=OVERRIDE
    )
    travel_on: EnumProperty(
        name="Travel on",
        description="What carries the body along the route",
        items=(
            ("OBJECT", "Object", "The armature object moves", 0),
            ("BONE", "Root Bone", "The object stays; its root bone moves, as game engines like", 1),
            TRAVEL_IN_PLACE,
        ),
        override=OVERRIDE,
    )
    extend_scene_range: BoolProperty(
        name="Extend Scene Range",
        description="Move the scene's end frame if the motion lasts longer, so that playback and "
        "rendering show all of it. The range is never shortened, and the message says so when it "
        "is extended. Switch it off where a shot has its length",
        default=True,
        override=OVERRIDE,
    )
    keys: EnumProperty(
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
        override=OVERRIDE,
    )
    key_angle: FloatProperty(
        name="Angle",
        description="How far any bone may be turned away, at any frame, where there are few keys",
        subtype="ANGLE",
        default=np.radians(0.5),
        min=0.0,
        max=np.pi,
        soft_max=np.radians(10.0),
        step=10,
        precision=2,
        override=OVERRIDE,
    )
    key_distance: FloatProperty(
        name="Distance",
        description="How far any arm's tip may be away, at any frame, where there are few keys. "
        "In arm lengths",
        default=0.005,
        min=0.0,
        soft_max=0.1,
        step=0.1,
        precision=4,
        override=OVERRIDE,
    )
    key_columns: EnumProperty(
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
        override=OVERRIDE,
    )
    result: PointerProperty(
        name="Result",
        description="The action that was generated last. It is made anew in place until you edit "
        "it; then it is yours, and the next one is a new action",
        type=bpy.types.Action,
        override=OVERRIDE,
    )


CLASSES: Final = (OCTO_MOTION_PG_locomotion,)


def locomotion_settings(armature: bpy.types.Object) -> OCTO_MOTION_PG_locomotion:
    """The settings of an armature object.

    Raises:
        RigError: the object is no armature.
    """
    armature_data(armature)
    make_overridable(armature)
    return cast("OCTO_MOTION_PG_locomotion", armature.octo_motion.locomotion)  # type: ignore[attr-defined]


def fill_gait_table(settings: OCTO_MOTION_PG_locomotion, name: str) -> None:
    """Fill the editable table with a gait of the extension or of the user's.

    Raises:
        GaitError: there is no such gait, or its file is damaged.
    """
    set_gait(settings, load_gait(name))


def set_gait(settings: OCTO_MOTION_PG_locomotion, table: GaitTable) -> None:
    """Fill the editable table with any gait, of the user's presets or not."""
    # In this order: the gait that is in the table already is not loaded once more.
    fill_table(settings.table, table)
    settings.gait = table.name


def read_gait(settings: OCTO_MOTION_PG_locomotion) -> GaitTable:
    """The gait as it is set.

    Raises:
        GaitError: no gait of the chosen name could be loaded, or the table is no gait.
    """
    if used(settings.table.curves) and settings.table.name == settings.gait:
        return read_table(settings.table)
    preset = load_gait(settings.gait)
    if used(settings.table.curves):
        raise GaitError(
            f"The gait '{settings.gait}' is not loaded, '{settings.table.name}' is.",
            "Choose the gait anew.",
        )
    return read_table(settings.table, preset)
