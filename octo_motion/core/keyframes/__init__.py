# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of Bézier curves: how they are fitted to a motion, few or many, and what they play."""

from .channels import (
    BezierKeys,
    Channel,
    ObjectChannels,
    RigChannels,
    halfway_values,
    in_rotation_mode,
    rotation_property,
    values_at,
)
from .reduction import check_bounds, reduce_keys, reducing
from .residuals import Residuals
from .tracks import LOCATION, SCALE, Limb, LimbChain, Track, chain_to_tip

__all__ = [
    "LOCATION",
    "SCALE",
    "BezierKeys",
    "Channel",
    "Limb",
    "LimbChain",
    "ObjectChannels",
    "Residuals",
    "RigChannels",
    "Track",
    "chain_to_tip",
    "check_bounds",
    "halfway_values",
    "in_rotation_mode",
    "reduce_keys",
    "reducing",
    "rotation_property",
    "values_at",
]
