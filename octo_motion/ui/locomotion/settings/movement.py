# SPDX-License-Identifier: GPL-3.0-or-later
"""How the arms move: the gait that is chosen, its table, and what varies it."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ....blender.files import curve_node, ensure_weight_curve, gait_names, load_gait
from ....core.errors import GaitError
from ....core.locomotion.gait import GaitSettings, GaitTable
from ...declared_settings import declared
from ...overridable import BoolProperty, FloatProperty, PointerProperty, StringProperty
from .gait import DEFAULT_GAIT, OCTO_MOTION_PG_gait_table, fill_table, read_table, used


def _is_weight_curve(_settings: Any, candidate: bpy.types.NodeTree) -> bool:
    return curve_node(candidate) is not None


def _gait_names(_settings: Any, _context: Any, _text: str) -> list[str]:
    return gait_names()


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

    gait: StringProperty(
        name="Gait",
        description="The gait that is loaded. Choosing one loads its table, which can be edited",
        default=DEFAULT_GAIT,
        search=_gait_names,
        search_options=set(),
        update=_load_gait,
    )
    table: PointerProperty(
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
    phase_spread: declared(GaitSettings, "phase_spread")
    turning: declared(GaitSettings, "turning")
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
    )
    seed: declared(GaitSettings, "seed")
    weight_root: FloatProperty(
        name="Weight Root",
        description="How readily joints at the arm's root bend. Lower weights spread a bend over "
        "more joints",
        subtype="FACTOR",
        default=GaitSettings.weights[0],
        min=0.01,
        max=1.0,
    )
    weight_tip: FloatProperty(
        name="Tip",
        description="How readily joints at the arm's tip bend. Lower than at the root, the bend "
        "moves to the root",
        subtype="FACTOR",
        default=GaitSettings.weights[-1],
        min=0.01,
        max=1.0,
    )
    use_weight_curve: BoolProperty(
        name="Curve",
        description="Draw the weights as a curve from the arm's root, left, to its tip, right",
        update=_make_weight_curve,
    )
    weight_curve: PointerProperty(
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
    preset = load_gait(settings.gait)
    if used(settings.table.curves):
        raise GaitError(
            f"The gait '{settings.gait}' is not loaded, '{settings.table.name}' is.",
            "Choose the gait anew.",
        )
    return read_table(settings.table, preset)
