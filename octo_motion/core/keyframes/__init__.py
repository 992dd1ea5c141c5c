# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of Bézier curves: how they are fitted to a motion, few or many, and what they play."""

from .altered_spans import STEP, Stretch, runs_of, stretch_keys
from .channels import (
    BezierKeys,
    Channel,
    ObjectChannels,
    RigChannels,
    constant_keys,
    going_on_from,
    halfway_values,
    in_rotation_mode,
    rotation_property,
    values_at,
)
from .reduction import check_bounds, reduce_keys, reducing
from .residuals import Residuals
from .segments import cut_segment, segment_values
from .tracks import LOCATION, SCALE, Limb, LimbChain, Track, chain_to_tip

__all__ = [
    "LOCATION",
    "SCALE",
    "STEP",
    "BezierKeys",
    "Channel",
    "Limb",
    "LimbChain",
    "ObjectChannels",
    "Residuals",
    "RigChannels",
    "Stretch",
    "Track",
    "chain_to_tip",
    "check_bounds",
    "constant_keys",
    "cut_segment",
    "going_on_from",
    "halfway_values",
    "in_rotation_mode",
    "reduce_keys",
    "reducing",
    "rotation_property",
    "runs_of",
    "segment_values",
    "stretch_keys",
    "values_at",
]
