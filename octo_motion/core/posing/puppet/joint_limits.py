# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a joint turns: a range about each axis of the bone at rest, which need not be even.

A turn from rest is a twist about the bone, +Y, and then the shortest swing that brings the bone to
where it points. The swing is a rotation vector across the bone, θ n with n ⟂ y₀: its parts about X
and Z are how far the joint is bent, and have a range each, as the twist has. An elbow that opens
from 0° to 150° about X and not at all about Z is a hinge; a rig's own limits say no more than that.

With e = n × y₀ the bone points along y = cos θ y₀ + sin θ e. From ẏ = ω × y follow the rates of
bends and twist, for a relative angular velocity ω,

    ∂(θ n)/∂ω = n nᵀ + θ cot θ e eᵀ − θ e y₀ᵀ,      ∂(twist)/∂ω = y₀ + tan(θ/2) e

all in the bone's axes at rest. Each end of a range that is near is one row (``joint_stops.Stops``).
"""

from __future__ import annotations

import numpy as np

from ...rotations import Floats

_TINY = 1e-12
_ONES = np.ones(3)


def bends(turns: Floats) -> Floats:
    """How far joints are bent about X, twisted about Y, and bent about Z: (…, 3) radians.

    Turns (…, 4) are from rest, in the bone's own axes at rest.
    """
    w, x, y, z = (turns[..., part] for part in range(4))
    cosine = np.sqrt(w * w + y * y)
    sine = np.sqrt(x * x + z * z)
    # θ n from sin(θ/2) n = (x w + z y, z w − x y)/cos(θ/2).
    factor = 2.0 * np.arctan2(sine, cosine) / np.maximum(sine * cosine, _TINY)
    factor = np.where(sine < 1e-9, 2.0, factor)
    twist = 2.0 * np.arctan2(y, w)
    twist -= 2.0 * np.pi * np.round(twist / (2.0 * np.pi))
    result = np.empty((*twist.shape, 3))
    result[..., 0] = factor * (x * w + z * y)
    result[..., 1] = twist
    result[..., 2] = factor * (z * w - x * y)
    return result


def slopes(turns: Floats) -> Floats:
    """Rates of ``bends``, of turns none by a half turn, for angular velocities in the bone's axes
    at rest: (…, 3, 3).
    """
    w, x, y, z = (turns[..., part] for part in range(4))
    cosine = np.maximum(np.sqrt(w * w + y * y), _TINY)
    sine = np.sqrt(x * x + z * z)
    whole = np.maximum(sine * cosine, _TINY)
    straight = sine < 1e-9
    right = np.where(straight, 1.0, (x * w + z * y) / whole)
    back = np.where(straight, 0.0, (z * w - x * y) / whole)
    angle = 2.0 * np.arctan2(sine, cosine)
    rest = np.where(straight, 1.0, angle * (cosine * cosine - sine * sine) / (2.0 * whole))
    half = sine / cosine
    across = right * right
    along = 1.0 - across
    result = np.empty((*angle.shape, 3, 3))
    result[..., 0, 0] = across + along * rest
    result[..., 2, 2] = along + across * rest
    result[..., 0, 2] = result[..., 2, 0] = right * back * (1.0 - rest)
    result[..., 0, 1] = back * angle
    result[..., 2, 1] = -right * angle
    result[..., 1, 0] = -back * half
    result[..., 1, 1] = 1.0
    result[..., 1, 2] = right * half
    return result
