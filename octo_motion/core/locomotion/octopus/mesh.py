# SPDX-License-Identifier: GPL-3.0-or-later
"""The octopus' skin: one closed surface of quads, and eyeballs that sit in it.

Two sheets are stretched over the body. The web's margin joins them; from there on each arm is a
tube of its own, which goes on with the columns of both.
"""

from __future__ import annotations

import numpy as np

from ...rotations import Floats
from .organs import add_head_details, add_ventral_strips
from .rig import BODY, MANTLE
from .shape import BodyForm, OctopusShape, body_form
from .sheets import (
    ARMS_BELOW,
    BEAK_ROWS,
    END_POLAR,
    ArmLayout,
    Sheet,
    column_angles,
    lower_sheet,
    upper_sheet,
)
from .surface import (
    Indices,
    OctopusMesh,
    SkinMaterial,
    Surface,
    along_arm,
    cap_size,
    closed,
    rigid,
    sheet_quads,
)
from .web import add_web


def build_mesh(shape: OctopusShape) -> OctopusMesh:
    """The skin of an octopus at rest, in the space of its bones (see :func:`build_bones`)."""
    surface = Surface()
    layout = ArmLayout(shape)
    form = body_form(shape)
    upper, lower = upper_sheet(layout, form), lower_sheet(layout, form)
    above = surface.add_vertices(upper.points, upper.influences)
    below = surface.add_vertices(lower.points, lower.influences)

    wanted = add_head_details(surface, form, upper, above)
    surface.add_quads(sheet_quads(closed(above))[wanted], SkinMaterial.SKIN)
    # Both begin in front.
    _add_mantle_end(surface, form, np.roll(above[0], -upper.front))
    _add_mouth(surface, *(np.roll(each[0], -lower.front, axis=0) for each in (lower.points, below)))
    _add_underside(surface, layout, lower, below)
    margins = (
        _between(layout, _by_arm(above[-1], upper)),
        _between(layout, _by_arm(below[-1], lower)),
    )
    if not layout.web_rows:
        _add_web_margin(surface, margins)
    tubes = _add_arms(surface, layout, (upper, above), (lower, below))
    without_web = surface.count
    if layout.web_rows:
        _add_web_margin(surface, add_web(surface, layout, margins, tubes))
    return surface.mesh(without_web)


def _by_arm(row: Indices, sheet: Sheet) -> Indices:
    """A row's columns as (arms, sector)."""
    return row.reshape(-1, sheet.sector)


def _add_mantle_end(surface: Surface, form: BodyForm, loop: Indices) -> None:
    """A grid over the mantle's end, symmetric to the plane of symmetry."""
    first_side, _ = cap_size(len(loop))
    angles = column_angles(len(loop))
    border = END_POLAR * np.stack([np.sin(angles), np.cos(angles)], axis=-1)
    shift = first_side // 2

    def onto_mantle(flat: Floats) -> Floats:
        polar = np.linalg.norm(flat, axis=-1)
        angle = np.arctan2(flat[..., 0], flat[..., 1])
        return form.mantle_end(polar).points(angle[..., None])[..., 0, :]

    surface.add_cap(
        np.roll(loop, shift),
        np.roll(border, shift, axis=0),
        rigid(MANTLE, (1, 1)),
        SkinMaterial.SKIN,
        first_side=first_side,
        onto=onto_mantle,
    )


def _add_mouth(surface: Surface, points: Floats, loop: Indices) -> None:
    """A grid over the innermost row of the lower sheet, symmetric as well."""
    first_side, _ = cap_size(len(loop))
    # Seen from below the row runs clockwise.
    order = first_side // 2 - np.arange(len(loop))
    surface.add_cap(
        loop[order], points[order], rigid(BODY, (1, 1)), SkinMaterial.BEAK, first_side=first_side
    )


def _add_underside(surface: Surface, layout: ArmLayout, lower: Sheet, below: Indices) -> None:
    """The lower sheet but for the strips under the arms, which have suckers."""
    quads = sheet_quads(closed(below))[..., ::-1]
    row, column = np.ogrid[: quads.shape[0], : quads.shape[1]]
    in_sector = column % lower.sector - lower.half_web
    in_strip = (in_sector >= 0) & (in_sector < layout.columns.ventral) & (row >= ARMS_BELOW)
    surface.add_quads(quads[:BEAK_ROWS], SkinMaterial.BEAK)
    surface.add_quads(quads[BEAK_ROWS:][~in_strip[BEAK_ROWS:]], SkinMaterial.UNDERSIDE)


def _between(layout: ArmLayout, row: Indices) -> Indices:
    """Of a row (arms, sector) what lies from each arm to the next, (arms, web + 1)."""
    half = layout.columns.web // 2
    following = np.roll(row, -1, axis=0)
    return np.concatenate([row[:, -half:], following[:, : half + 1]], axis=1)


def _add_web_margin(surface: Surface, rows: tuple[Indices, Indices]) -> None:
    """Faces between the last rows (arms, web + 1) of both sheets, from each arm to the next."""
    surface.add_quads(sheet_quads(np.stack(rows, axis=1)), SkinMaterial.SKIN)


def _add_arms(
    surface: Surface,
    layout: ArmLayout,
    upper: tuple[Sheet, Indices],
    lower: tuple[Sheet, Indices],
) -> Indices:
    """Tubes from the arms' roots to the tips, and the strips with suckers from the mouth to there.

    Returns the tubes' vertices (arms, rows, ring), from the sheets' last row on.
    """
    shape = layout.shape
    dorsal, ventral = layout.columns.dorsal, layout.columns.ventral
    distance = layout.stations[layout.web_row + 1 :]
    points = _round_the_axis(shape, *layout.section(distance, layout.scales[-len(distance) :]))
    arm = np.arange(shape.arms)[:, None, None]
    influences = along_arm(shape, *np.broadcast_arrays(arm, distance[:, None]))
    vertices = surface.add_vertices(points, influences)

    # The tube starts from the sheets' last row.
    over, under = (_across_arms(sheet, each[-1:]) for sheet, each in (upper, lower))
    start = np.concatenate([over, under[..., ::-1]], axis=-1)
    tube = np.concatenate([start, vertices], axis=1)
    faces = sheet_quads(closed(tube))
    first, last = dorsal + 1, dorsal + 1 + ventral
    # Where the web is, it takes the place of the arms' sides.
    wanted = np.ones(faces.shape[:-1], dtype=bool)
    wanted[:, : layout.web_rows, [dorsal, -1]] = False
    surface.add_quads(faces[:, :, :first][wanted[:, :, :first]], SkinMaterial.SKIN)
    surface.add_quads(faces[:, :, last:][wanted[:, :, last:]], SkinMaterial.SKIN)

    sheet, below = lower
    under = _across_arms(sheet, below[ARMS_BELOW:])[..., ::-1]
    strips = np.concatenate([under, vertices[:, :, first : last + 1]], axis=1)
    under_points = np.stack(
        [_across_arms(sheet, sheet.points[ARMS_BELOW:, :, axis])[..., ::-1] for axis in range(3)],
        axis=-1,
    )
    add_ventral_strips(
        surface,
        shape,
        strips,
        np.concatenate([under_points, points[:, :, first : last + 1]], axis=1),
        np.concatenate([sheet.distances[ARMS_BELOW:], distance]),
    )
    _add_tips(surface, layout, tube[:, -1], points[:, -1])
    return tube


def _across_arms(sheet: Sheet, rows: np.ndarray) -> np.ndarray:
    """Columns that cross the arms, (arms, rows, arm columns + 1), of rows (rows, columns)."""
    sectors = rows.reshape(len(rows), -1, sheet.sector)
    first = sheet.half_web
    return np.swapaxes(sectors[..., first : first + sheet.arm_columns + 1], 0, 1)


def _round_the_axis(shape: OctopusShape, upper: Floats, lower: Floats) -> Floats:
    """Outlines in the frame of an arm as closed rings of all arms, (arms, rows, columns, 3)."""
    ring = np.concatenate([upper, lower[:, ::-1]], axis=1)
    sine, cosine = np.sin(shape.angles)[:, None, None], np.cos(shape.angles)[:, None, None]
    x = ring[..., 0] * sine + ring[..., 1] * cosine
    y = -ring[..., 0] * cosine + ring[..., 1] * sine
    return np.stack([x, y, np.broadcast_to(ring[..., 2], x.shape)], axis=-1)


def _add_tips(surface: Surface, layout: ArmLayout, loops: Indices, points: Floats) -> None:
    """Grids that close the tubes' last rings (arms, columns)."""
    shape = layout.shape
    first_side, _ = cap_size(loops.shape[-1])
    # Seen from outside the ring runs clockwise.
    order = layout.columns.dorsal // 2 + first_side // 2 - np.arange(loops.shape[-1])
    arm = np.arange(shape.arms)[:, None, None]
    surface.add_cap(
        loops[:, order],
        points[:, order],
        along_arm(shape, arm, np.full(arm.shape, shape.arm_length)),
        SkinMaterial.SKIN,
        first_side=first_side,
    )
