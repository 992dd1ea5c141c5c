# SPDX-License-Identifier: GPL-3.0-or-later
"""The octopus' web: a thin skin of two sheets between neighbouring arms.

It goes on where the arms' roots end, and changes nothing of what is there: the arms' own vertices
stay, their sides between the sheets go, and new vertices come after all others. The sheets hang
between the arms in an arch, and a little lower than their middle lines, so that they fold to the
side of the suckers where the arms close.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from ...rotations import Floats
from .shape import OctopusShape
from .sheets import ArmLayout, web_depth, web_power
from .surface import (
    Indices,
    Influences,
    SkinMaterial,
    Surface,
    along_arm,
    mixed,
    ramp,
    sheet_quads,
)

_MIDDLE: Final = 0.69
"""Depth of the margin's arch: how far its middle reaches, of the straight line between arms. Where
it reaches further, arms that swing across each other turn more of it over."""
_ARCH: Final = 2.5
"""Power of the arch's form, that of a chain."""
_SAG: Final = 0.38
"""How far the middle hangs below the arms' middle lines, of the height of those over ground."""
_OWN: Final = 0.11
"""Share of the way to the middle that goes with its own arm alone, at the margin."""
_EVEN: Final = 0.43
"""How even the shares of two arms are across the rest of the web, 0 to 1."""
_SLOWER: Final = 0.64
"""How fast the bones along the arms change in the web, of how fast they do on the arms."""
_SOON: Final = 6.0
"""How steeply they come to that beside an arm."""
_THIN: Final = 0.02
"""Half the thickness of the web, of the arm's first diameter."""


def add_web(
    surface: Surface, layout: ArmLayout, margins: tuple[Indices, Indices], tube: Indices
) -> tuple[Indices, Indices]:
    """The web from the margins of the sheets above and below to its own margins.

    Margins are (arms, web + 1); the tube (arms, rows, ring) begins with the sheets' last row.
    """
    dorsal, rows = layout.columns.dorsal, layout.web_rows
    following = np.roll(tube, -1, axis=0)
    # Edges of each gap above and below: an arm's left side, the next one's right.
    edges = (
        (tube[:, 1 : rows + 1, dorsal], following[:, 1 : rows + 1, 0]),
        (tube[:, 1 : rows + 1, dorsal + 1], following[:, 1 : rows + 1, -1]),
    )
    sheets = []
    for sign, margin, (left, right) in zip((1.0, -1.0), margins, edges, strict=True):
        points, influences = _between_arms(layout, sign)
        inside = surface.add_vertices(points, influences)
        grown = np.concatenate([left[..., None], inside, right[..., None]], axis=-1)
        sheets.append(np.concatenate([margin[:, None], grown], axis=1))
    above, below = sheets
    surface.add_quads(sheet_quads(above), SkinMaterial.SKIN)
    # From the same corner on, so that both sheets are cut along the same diagonals.
    surface.add_quads(sheet_quads(below)[..., [0, 3, 2, 1]], SkinMaterial.UNDERSIDE)
    return above[:, -1], below[:, -1]


def _between_arms(layout: ArmLayout, sign: float) -> tuple[Floats, Influences]:
    """Points (arms, rows, web − 1, 3) between each arm and the next, and what moves them."""
    shape, half = layout.shape, layout.columns.web // 2
    first = layout.web_row + 1
    distance = layout.stations[first : first + layout.web_rows]
    outline = layout.section(distance)[0 if sign > 0.0 else 1][:, -1]
    side_angle = np.arctan2(outline[:, 1], outline[:, 0])[:, None]
    side_radius = np.hypot(outline[:, 0], outline[:, 1])[:, None]
    side_height = (outline[:, 2] - shape.arm_height)[:, None]

    # From an arm's side (0) to the middle (1) and back to the next one's side.
    v = 1.0 - np.abs(np.arange(1.0 - half, half)) / half
    grown = (np.arange(layout.web_rows) + 1.0)[:, None] / layout.web_rows
    depth = web_depth(shape) + (_last_depth(shape) - web_depth(shape)) * grown
    power = web_power(shape) + (_ARCH - web_power(shape)) * grown
    arch = depth + (1.0 - depth) * (1.0 - v) ** power
    radius = shape.crown_radius + (side_radius - shape.crown_radius) * arch

    sag = _SAG * ramp(0.0, 0.5, grown) * (shape.arm_height - _lowest(layout, distance))
    thin = sign * np.minimum(_THIN * shape.first_diameter, np.abs(side_height))
    slack = 1.0 - (1.0 - v) ** _ARCH
    height = shape.arm_height + thin + (side_height - thin) * (1.0 - v) ** 2 - sag * slack

    angle = side_angle + (shape.half_sector - side_angle) * v
    angle = np.where(np.arange(2 * half - 1) < half, angle, 2.0 * shape.half_sector - angle)
    turn = shape.angles[:, None, None] + angle
    points = np.stack(
        np.broadcast_arrays(radius * np.sin(turn), -radius * np.cos(turn), height), axis=-1
    )
    return points, _influences(layout, radius, distance, v, grown)


def _last_depth(shape: OctopusShape) -> float:
    return max(web_depth(shape), _MIDDLE * math.cos(shape.half_sector))


def _lowest(layout: ArmLayout, distance: Floats) -> Floats:
    """Height (rows, 1) of the arms' undersides."""
    return np.min(layout.section(distance)[1][..., 2], axis=1, keepdims=True)


def _influences(
    layout: ArmLayout, radius: Floats, distance: Floats, v: Floats, grown: Floats
) -> Influences:
    """Each point follows the arms' bones beside it, more those of the nearer arm.

    Between the arms the bones change slower than the place: what an arm's bend turns about a point
    further in is drawn together less on the inside of the bend. Beside an arm the web is its own;
    from there on the shares are half way between even ones, with which the web shrinks evenly where
    arms close in, and ones that begin and end flat, with which it leaves each arm as it does at
    rest.
    """
    shape, half = layout.shape, layout.columns.web // 2
    own = _OWN * grown
    inwards = np.maximum(v - own, 0.0) / (1.0 - own)
    smooth = ramp(0.0, 1.0, inwards)
    near = 0.5 * (smooth + (inwards - smooth) * _EVEN * ramp(0.0, 0.5, grown))
    share = np.where(np.arange(2 * half - 1) < half, near, 1.0 - near)
    where = np.clip(radius - shape.crown_radius, 0.0, distance[:, None])
    margin = _margin(layout, v)
    slower = 1.0 - (1.0 - _SLOWER) * np.minimum(_SOON * v, 1.0)
    beside = np.minimum(where, margin + slower * (where - margin))
    grid = (shape.arms, *beside.shape)
    arm = np.arange(shape.arms)[:, None, None]
    return mixed(
        along_arm(shape, *np.broadcast_arrays(arm, beside)),
        along_arm(shape, *np.broadcast_arrays((arm + 1) % shape.arms, beside)),
        np.broadcast_to(share, grid),
    )


def _margin(layout: ArmLayout, v: Floats) -> Floats:
    """Distances (1, web − 1) from P₀ at which the web goes on from the arms' roots."""
    shape = layout.shape
    side = layout.section(layout.stations[[layout.web_row]])[0][:, -1]
    reach = np.hypot(side[:, :1], side[:, 1:2]) - shape.crown_radius
    depth = web_depth(shape)
    return reach * (depth + (1.0 - depth) * (1.0 - v) ** web_power(shape))
