# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of Bézier curves: how they are fitted to a motion, few or many, and what they play."""

from .channel import Channel
from .playback import values_at
from .reduction import check_bounds, reduce_keys, reducing
from .residuals import Residuals
from .subframes import halfway_values
from .tracks import LOCATION, SCALE, BezierKeys, Limb, LimbChain, Track, chain_to_tip
from .transform_channels import ObjectChannels, RigChannels, rotation_property

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
    "reduce_keys",
    "reducing",
    "rotation_property",
    "values_at",
]
