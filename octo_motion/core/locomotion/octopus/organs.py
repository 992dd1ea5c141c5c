# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyes, siphon and suckers, which take the place of patches of the skin."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...rotations import Floats, normalized
from .rig import EYE_LEFT, EYE_RIGHT, HEAD, SIPHON
from .shape import EYE_ANGLE, EYE_STATION, MANTLE_WIDEST, SIPHON_STATION, BodyForm, OctopusShape
from .sheets import END_ROWS, HEAD_ROWS, Sheet
from .surface import (
    Indices,
    Influences,
    SkinMaterial,
    Surface,
    along_arm,
    cap_size,
    mixed,
    patch_border,
    rigid,
    sheet_quads,
)

_EYE_PATCH: Final = 1.85
"""Reach of the patch from the eye's middle, in radii of the eyeball."""
_LIDS: Final = np.array(
    [(80, 1.42, 0), (64, 1.36, 2), (52, 1.24, 8), (46, 1.09, 12), (48, 0.95, 12)],
    dtype=np.float64,
)
"""Rings of the skin round the eye: angle from the gaze, distance from its centre in radii, and
how many degrees the upper lid hangs down."""
_SLOPE_STEPS: Final = (0.3, 0.65)
"""Rings between the head and the lids."""
_EYEBALL_COLUMNS: Final = 24
_EYEBALL: Final = np.array(
    [(152, 152), (120, 120), (90, 90), (66, 64), (48, 42), (37, 24), (32, 14), (30, 11.5)],
    dtype=np.float64,
)
"""Rings of the eyeball from the back to the pupil: its half width and half height as angles."""
_PUPIL_RINGS: Final = 2
"""How many of the last rings of faces are the pupil's."""

_SIPHON_PATCH: Final = 0.32
"""Reach of the patch from the siphon's root, in crown radii."""
_SIPHON: Final = np.array(
    [(0.10, 0.20), (0.28, 0.150), (0.46, 0.135), (0.50, 0.115), (0.46, 0.095),
     (0.28, 0.09)]
)  # fmt: skip
"""Rings of the siphon, out over its rim and in again: place along it, radius, in crown radii."""
_SIPHON_SHARES: Final = np.array([0.1, 0.4, 0.8, 1.0, 1.0, 1.0, 1.0, 1.0])
"""How much each ring goes with the siphon's bone, and not with the head's."""


def add_head_details(
    surface: Surface, form: BodyForm, sheet: Sheet, vertices: Indices
) -> NDArray[np.bool_]:
    """Eyes in their lids, and the siphon; (rows − 1, columns) whether a face of the upper sheet, of
    vertices (rows, columns), is still wanted.
    """
    count = vertices.shape[1]
    wanted = np.ones((len(vertices) - 1, count), dtype=bool)
    normals = _normals(sheet.points)

    front = sheet.front
    middle = front + round(EYE_ANGLE * count / math.tau)
    rows, columns = _patch(sheet.points, EYE_STATION, middle, _EYE_PATCH * form.eye_radius)
    loop = patch_border(vertices[np.ix_(rows, columns)])
    around = _border(sheet, normals, rows, columns)
    _add_eye(surface, form, loop, around, len(rows) - 1, bone=EYE_LEFT)
    with surface.mirrored():
        # The right eye's vertices, in the order of the left eye's.
        other = patch_border(vertices[np.ix_(rows, (2 * front - columns) % count)])
        _add_eye(surface, form, other, around, len(rows) - 1, bone=EYE_RIGHT)
    wanted[np.ix_(rows[:-1], columns[:-1])] = False
    wanted[np.ix_(rows[:-1], (2 * front - columns[1:]) % count)] = False

    behind, reach = front + count // 2, _SIPHON_PATCH * form.unit
    rows, columns = _patch(sheet.points, SIPHON_STATION, behind, reach)
    loop = patch_border(vertices[np.ix_(rows, columns)])
    around = _border(sheet, normals, rows, columns)
    _add_siphon(surface, form, loop, around, len(rows) - 1)
    wanted[np.ix_(rows[:-1], columns[:-1])] = False
    return wanted


def _patch(points: Floats, station: float, column: int, reach: float) -> tuple[Indices, Indices]:
    """Rows and columns of a patch round a column's point at a station of the body's axis."""
    row = END_ROWS + round((HEAD_ROWS - 1) * (1.0 - station / MANTLE_WIDEST))
    down = np.linalg.norm(points[:, column] - points[row, column], axis=-1) > reach
    across = np.linalg.norm(points[row] - points[row, column], axis=-1) > reach
    first = int(np.flatnonzero(down[:row])[-1])
    last = row + int(np.flatnonzero(down[row:])[0])
    half = int(np.flatnonzero(across[column:])[0])
    return np.arange(first, last + 1), np.arange(column - half, column + half + 1)


class _Border(NamedTuple):
    """The sheet on the loop round a patch: points and outward normals, (n, 3)."""

    points: Floats
    normals: Floats
    influences: Influences
    """(n, k)"""


def _border(sheet: Sheet, normals: Floats, rows: Indices, columns: Indices) -> _Border:
    row, column = np.meshgrid(rows, columns, indexing="ij")
    loop = patch_border(row), patch_border(column)
    bones, weights = sheet.influences
    return _Border(sheet.points[loop], normals[loop], Influences(bones[loop], weights[loop]))


def _normals(points: Floats) -> Floats:
    """Outward unit normals of a sheet, (rows, columns, 3)."""
    down = np.gradient(points, axis=0)
    round_the_axis = np.roll(points, -1, axis=1) - np.roll(points, 1, axis=1)
    return normalized(np.cross(down, round_the_axis))


def _frame(axis: Floats) -> tuple[Floats, Floats]:
    """Unit vectors right and up of one who looks at where ``axis`` comes from."""
    up = normalized(np.array([0.0, 0.0, 1.0]) - axis[2] * axis)
    return np.cross(up, axis), up


def _directions_round(axis: Floats, offsets: Floats) -> Floats:
    """Unit vectors (n, 3) across the axis towards the offsets (n, 3)."""
    right, up = _frame(axis)
    return normalized((offsets @ right)[:, None] * right + (offsets @ up)[:, None] * up)


def _add_eye(
    surface: Surface, form: BodyForm, loop: Indices, around: _Border, first_side: int, *, bone: int
) -> None:
    """The left eye: lids that close the loop (n,), and a ball within them."""
    centre, gaze, radius = form.eye_centre, form.eye_gaze, form.eye_radius
    outward = _directions_round(gaze, around.points - centre)
    angle, distance, drop = _LIDS.T[..., None]
    upwards = np.maximum(outward @ _frame(gaze)[1], 0.0)
    polar = np.radians(angle - drop * upwards)[..., None]
    lids = centre + radius * distance[..., None] * (np.sin(polar) * outward + np.cos(polar) * gaze)
    rings = np.concatenate([_slope(around, lids[0]), lids])
    # The head's skin may bend towards the mantle; the lids must fit the ball.
    shares = np.array([*_SLOPE_STEPS, *np.ones(len(lids))])
    influences = _from_border(around, HEAD, shares)
    last = surface.add_rings(loop, rings, influences, [SkinMaterial.SKIN] * len(rings))
    surface.add_cap(last, rings[-1], rigid(HEAD, (1, 1)), SkinMaterial.SKIN, first_side=first_side)
    _add_eyeball(surface, form, bone)


def _slope(foot: _Border, edge: Floats) -> Floats:
    """Rings (r, n, 3) from a border to an edge (n, 3) that leave the surface without a crease."""
    way = edge - foot.points
    rise = np.sum(way * foot.normals, axis=-1, keepdims=True) * foot.normals
    bend = foot.points + 0.6 * (way - rise)
    t = np.array(_SLOPE_STEPS)[:, None, None]
    return (1.0 - t) ** 2 * foot.points + 2.0 * t * (1.0 - t) * bend + t**2 * edge


def _from_border(around: _Border, bone: int, shares: Floats) -> Influences:
    """Influences of rings (r, n, k): a bone gets the shares (r,), the border's bones the rest."""
    bones, weights = around.influences
    grid = (len(shares), *weights.shape)
    border = Influences(np.broadcast_to(bones, grid), np.broadcast_to(weights, grid))
    return mixed(border, rigid(bone, grid[:-1]), np.broadcast_to(shares[:, None], grid[:-1]))


def _add_eyeball(surface: Surface, form: BodyForm, bone: int) -> None:
    """A ball of its own, with the flat pupil that octopuses have."""
    centre, gaze, radius = form.eye_centre, form.eye_gaze, form.eye_radius
    influences = rigid(bone, (1, 1))
    right, up = _frame(gaze)
    # The corner of the grids at back and front, half a side from the top, makes them symmetric.
    side, _ = cap_size(_EYEBALL_COLUMNS)
    turn = math.tau * (np.arange(_EYEBALL_COLUMNS) - 0.5 * side) / _EYEBALL_COLUMNS + 0.5 * math.pi
    x, y = np.radians(_EYEBALL[:, :1]) * np.cos(turn), np.radians(_EYEBALL[:, 1:]) * np.sin(turn)
    polar = np.hypot(x, y)
    outward = (x / polar)[..., None] * right + (y / polar)[..., None] * up
    rings = centre + radius * (np.sin(polar)[..., None] * outward + np.cos(polar)[..., None] * gaze)

    def onto_ball(points: Floats) -> Floats:
        return centre + radius * normalized(points - centre)

    back = surface.add_vertices(rings[0], rigid(bone, (1,)))
    reverse = -np.arange(_EYEBALL_COLUMNS) + side
    surface.add_cap(
        back[reverse],
        rings[0][reverse],
        influences,
        SkinMaterial.EYE,
        first_side=side,
        onto=onto_ball,
    )
    eye_rings = len(rings) - 1 - _PUPIL_RINGS
    materials = [SkinMaterial.EYE] * eye_rings + [SkinMaterial.PUPIL] * _PUPIL_RINGS
    front = surface.add_rings(back, rings[1:], influences, materials)
    surface.add_cap(
        front, rings[-1], influences, SkinMaterial.PUPIL, first_side=side, onto=onto_ball
    )


def _add_siphon(
    surface: Surface, form: BodyForm, loop: Indices, around: _Border, first_side: int
) -> None:
    """A tube that closes the loop (n,)."""
    root = form.siphon_root
    axis = normalized(form.siphon_tip - root)
    outward = _directions_round(axis, around.points - np.mean(around.points, axis=0))
    along, radius = form.unit * _SIPHON[:, :1, None], form.unit * _SIPHON[:, 1:, None]
    tube = root + along * axis + radius * outward
    rings = np.concatenate([_slope(around, tube[0]), tube])
    influences = _from_border(around, SIPHON, _SIPHON_SHARES)
    last = surface.add_rings(loop, rings, influences, [SkinMaterial.SKIN] * len(rings))
    surface.add_cap(
        last, rings[-1], rigid(SIPHON, (1, 1)), SkinMaterial.BEAK, first_side=first_side
    )


# --- Suckers: round cups that take the place of patches of two by two faces under the arms --------


_MOST: Final = 4000
"""Of more suckers, only every second, third … gets made."""
_BARE_TIP: Final = 1
"""Patches at the tip without suckers."""
_FILL: Final = 0.45
"""Radius of a sucker in widths of its patch."""
_RINGS: Final = np.array([(1.0, 0.04), (0.95, 0.42), (0.62, 0.46), (0.42, 0.12)])
"""From foot over rim into the cup: radius, height over the skin, in radii of the sucker."""
_MATERIALS: Final = (
    SkinMaterial.UNDERSIDE,
    SkinMaterial.SUCKER,
    SkinMaterial.SUCKER,
    SkinMaterial.SUCKER,
)
_DIRECTIONS: Final = np.radians(225.0 + 45.0 * np.arange(8))
"""Of the vertices round a patch, from the one at its corner (0, 0)."""


def add_ventral_strips(
    surface: Surface, shape: OctopusShape, strips: Indices, points: Floats, distance: Floats
) -> None:
    """Faces of the arms' undersides, with suckers.

    Strips (arms, rows, columns + 1) are vertices, rows outwards, columns even in number and from
    left to right, so that faces look down; points (arms, rows, columns + 1, 3) are where they are,
    and distances (rows,) those from P₀.
    """
    pairs = (strips.shape[1] - 1) // 2
    lanes = (strips.shape[2] - 1) // 2
    row = 2 * np.arange(pairs)[:, None, None, None] + np.arange(3)[:, None]
    column = 2 * np.arange(lanes)[:, None, None] + np.arange(3)
    patches = strips[:, row, column]
    every = math.ceil(shape.arms * pairs * lanes / _MOST)
    pair = np.arange(pairs)
    with_sucker = (pair < pairs - _BARE_TIP) & (pair % every == 0)

    surface.add_quads(sheet_quads(patches[:, ~with_sucker]), SkinMaterial.UNDERSIDE)
    surface.add_quads(sheet_quads(strips[:, 2 * pairs :]), SkinMaterial.UNDERSIDE)
    _add_suckers(
        surface,
        patches[:, with_sucker],
        points[:, row, column][:, with_sucker],
        _rigid_to_arms(shape, distance[1 : 2 * pairs : 2][with_sucker]),
    )


def _rigid_to_arms(shape: OctopusShape, distance: Floats) -> Influences:
    """Influences (arms, suckers, 1, 1, k): a sucker keeps its form when its arm bends."""
    arm, along = np.broadcast_arrays(np.arange(shape.arms)[:, None], distance)
    influences = along_arm(shape, arm, along)
    return Influences(influences.bones[:, :, None, None], influences.weights[:, :, None, None])


def _add_suckers(
    surface: Surface, patches: Indices, points: Floats, influences: Influences
) -> None:
    """Suckers in patches (arms, suckers, lanes, 3, 3)."""
    along = np.mean(points[..., 2, :, :] - points[..., 0, :, :], axis=-2)
    across = np.mean(points[..., :, 2, :] - points[..., :, 0, :], axis=-2)
    width = np.minimum(np.linalg.norm(along, axis=-1), np.linalg.norm(across, axis=-1))
    radius = (_FILL * width)[..., None]
    u = normalized(along)
    v = normalized(across - np.sum(across * u, axis=-1, keepdims=True) * u)
    normal = np.cross(u, v)
    centre = points[..., 1, 1, :]

    circle = (
        u[..., None, :] * np.cos(_DIRECTIONS)[:, None]
        + v[..., None, :] * np.sin(_DIRECTIONS)[:, None]
    )
    rings = np.stack(
        [
            (centre + height * radius * normal)[..., None, :] + size * radius[..., None] * circle
            for size, height in _RINGS
        ],
        axis=-3,
    )
    ringwise = Influences(influences.bones[..., None, :], influences.weights[..., None, :])
    loop = surface.add_rings(patch_border(patches), rings, ringwise, _MATERIALS)
    surface.add_cap(loop, rings[..., -1, :, :], ringwise, SkinMaterial.SUCKER, first_side=2)
