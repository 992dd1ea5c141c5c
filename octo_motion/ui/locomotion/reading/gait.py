# SPDX-License-Identifier: GPL-3.0-or-later
"""What a shot's settings are for core: how arms move, how the body travels, and when."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ....blender.files import load_gait, sample_weight_curve
from ....core.keyframes import check_bounds
from ....core.locomotion.gait import GaitSettings, GaitTable
from ....core.locomotion.motion import GaitJob, Tolerances
from ....core.locomotion.path import TravelSettings
from ...declared_settings import read_settings
from ..settings import OCTO_MOTION_PG_locomotion, read_gait

_HELD: Final = 0.003
"""Arm lengths that few keys may be off where a joint rests on the ground: it would slide."""
_WEIGHT_SAMPLES: Final = 33
_HEADING_STEP: Final = 0.2
"""Radians: no arm that stands half way between two others is a matter of rounding."""


def gait_settings(settings: OCTO_MOTION_PG_locomotion, gait: GaitTable) -> GaitSettings:
    """How the arms move in a gait."""
    if settings.use_weight_curve:
        drawn = sample_weight_curve(settings.weight_curve, _WEIGHT_SAMPLES)
        weights = tuple(float(each) for each in np.clip(drawn, 0.01, 1.0))
    else:
        weights = (settings.weight_root, settings.weight_tip)
    return read_settings(
        GaitSettings,
        settings,
        gait=gait,
        weights=weights,
        variation=(settings.variation_min, settings.variation_max),
        period=settings.cycles if settings.travel_on == "NONE" else 0,
        heading=_heading(settings),
    )


def _heading(settings: OCTO_MOTION_PG_locomotion) -> float:
    """Radians from the way that the body goes to its front, in steps in which arms change roles."""
    if settings.heading != "ALONG":
        return 0.0
    return _HEADING_STEP * round(settings.heading_angle / _HEADING_STEP)


def travel_settings(settings: OCTO_MOTION_PG_locomotion, gait: GaitTable) -> TravelSettings:
    """How the body travels in a gait; its stride is in arm lengths."""
    return read_settings(
        TravelSettings,
        settings,
        manner="WALK" if gait.on_ground else "SWIM",
        stride=gait.stride,
        stroke_phase=gait.power_phase,
    )


def read_gaits(settings: OCTO_MOTION_PG_locomotion, others: Sequence[str]) -> tuple[GaitJob, ...]:
    """The gait that is set, and those of these names that it changes to.

    Raises:
        GaitError: a gait is missing, or its table cannot be used.
    """
    tables = [read_gait(settings), *(load_gait(name) for name in others)]
    return tuple(
        GaitJob(gait_settings(settings, each), travel_settings(settings, each)) for each in tables
    )


def tolerances_of(settings: OCTO_MOTION_PG_locomotion) -> Tolerances | None:
    """How far few keys may be off, in arm lengths; none where every frame has a key.

    Raises:
        SettingsError: without tolerance, no key can be left out.
    """
    if settings.keys != "REDUCED":
        return None
    check_bounds(settings.key_angle, settings.key_distance)
    by_bone = settings.key_columns == "BONE"
    return Tolerances(settings.key_angle, settings.key_distance, by_bone, _HELD)
