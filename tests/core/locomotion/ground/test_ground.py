# SPDX-License-Identifier: GPL-3.0-or-later
"""What a creature walks on: planes, meshes sampled onto a grid, and the route itself."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.errors import GroundError
from octo_motion.core.locomotion.ground.surface import (
    HeightField,
    LevelGround,
    ground_along_path,
    normals,
    passes_over_itself,
    sample_ground,
)
from octo_motion.core.rotations import Floats

PATH = np.stack([np.zeros(41), -np.linspace(0.0, 4.0, 41), np.zeros(41)], axis=1)
ALL = np.ones(len(PATH), dtype=bool)
NEED: dict[str, Any] = {"reach": 1.5, "spacing": 0.05, "headroom": 2.0}


def square(low: float, high: float, z: float = 0.0, rise: float = 0.0) -> Floats:
    """Two triangles, (2, 3, 3), from low to high in x and y, rising along −y."""
    corners = np.array([[low, low, 0], [high, low, 0], [high, high, 0], [low, high, 0]], float)
    corners[:, 2] = z - rise * corners[:, 1]
    return corners[[[0, 1, 2], [0, 2, 3]]]


points = st.tuples(st.floats(-1.4, 1.4), st.floats(-5.4, 1.4)).map(np.array)


@given(points, st.floats(-0.5, 0.5))
def test_a_sloping_face_is_met_exactly(point: Floats, rise: float) -> None:
    ground = sample_ground(square(-9, 9, 0.3, rise), PATH, ALL, **NEED)
    assert ground.height(point) == pytest.approx(0.3 - rise * point[1], abs=1e-9)
    # A sample's width from the border, where the grid ends, slopes are halved.
    if abs(point[0]) < 1.3 and -5.3 < point[1] < 1.3:
        assert ground.slope(point) == pytest.approx([0.0, -rise], abs=1e-9)


@given(points)
def test_a_plane_and_its_sampled_face_agree(point: Floats) -> None:
    plane = LevelGround(0.3, (0.0, -0.25))
    field = sample_ground(square(-9, 9, 0.3, 0.25), PATH, ALL, **NEED)
    assert field.height(point) == pytest.approx(plane.height(point), abs=1e-9)
    up = normals(plane, point)
    assert np.linalg.norm(up) == pytest.approx(1.0)
    assert up == pytest.approx(np.array([0.0, 0.25, 1.0]) / np.hypot(0.25, 1.0))


def test_fine_faces_are_sampled_like_coarse_ones() -> None:
    x = np.linspace(-3.0, 3.0, 241)
    y = np.linspace(-7.0, 3.0, 401)
    z = 0.15 * np.sin(5.0 * x[:, None]) * np.cos(5.0 * y)
    grid = np.stack([*np.broadcast_arrays(x[:, None], y), z], axis=-1)
    corners = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=-2)
    faces = np.concatenate([corners[..., [0, 1, 2], :], corners[..., [0, 2, 3], :]])
    ground = sample_ground(
        faces.reshape(-1, 3, 3), PATH, ALL, reach=1.5, spacing=0.025, headroom=2.0
    )
    at = np.random.default_rng(1).uniform([-1.4, -5.0], [1.4, 1.0], (500, 2))
    exact = 0.15 * np.sin(5.0 * at[:, 0]) * np.cos(5.0 * at[:, 1])
    # Bilinear between samples: an eighth of the curvature, 3.75, times the spacing squared.
    np.testing.assert_allclose(ground.height(at), exact, atol=3.75 * 2 * 0.025**2 / 8 * 1.2)


def test_a_roof_above_the_route_is_no_ground() -> None:
    faces = np.concatenate([square(-9, 9, 0.0), square(-9, 9, 3.0)])
    assert sample_ground(faces, PATH, ALL, **NEED).height(np.zeros(2)) == pytest.approx(0.0)


def test_a_route_drawn_deep_below_a_mountain_still_walks_on_it() -> None:
    ground = sample_ground(square(-9, 9, 5.0), PATH, ALL, **NEED)
    assert ground.height(np.zeros(2)) == pytest.approx(5.0)


def test_of_a_solid_body_the_top_counts() -> None:
    faces = np.concatenate([square(-9, 9, -1.0), square(-9, 9, 0.2)])
    assert sample_ground(faces, PATH, ALL, **NEED).height(np.zeros(2)) == pytest.approx(0.2)


def test_beside_its_border_the_ground_goes_on_level() -> None:
    ground = sample_ground(square(-5.0, 0.5, 0.0, 0.1), PATH, ALL, **NEED)
    assert ground.height(np.array([1.2, -2.0])) == pytest.approx(0.2, abs=0.02)


def test_a_ground_without_faces_is_told() -> None:
    with pytest.raises(GroundError, match=r"no faces\. Choose a mesh"):
        sample_ground(np.empty((0, 3, 3)), PATH, ALL, **NEED)


def test_upright_faces_alone_are_no_ground() -> None:
    wall = np.array([[[0.0, -9.0, 0.0], [0.0, 9.0, 0.0], [0.0, 0.0, 9.0]]])
    with pytest.raises(GroundError, match="leaves the ground after 0 %"):
        sample_ground(wall, PATH, ALL, **NEED)


@pytest.mark.parametrize("nowhere", [np.nan, np.inf])
@pytest.mark.parametrize("axis", [0, 2])
def test_a_face_with_a_corner_that_is_nowhere_is_no_ground(nowhere: float, axis: int) -> None:
    broken = square(-1.0, 1.0)
    broken[0, 1, axis] = nowhere
    faces = np.concatenate([square(-9, 9, 0.3), broken])
    ground = sample_ground(faces, PATH, ALL, **NEED)
    # All of the other face counts, and where there is none of it the one below.
    assert ground.height(np.array([0.5, -0.8])) == pytest.approx(0.3)
    assert np.all(np.isfinite(ground.heights))


def test_a_route_that_leaves_the_ground_is_told_where() -> None:
    with pytest.raises(GroundError, match=r"leaves the ground after 5[0-9] % of its length"):
        sample_ground(square(-2.1, 2.1), PATH, ALL, **NEED)
    # Beyond the route's ends there may be none.
    assert sample_ground(square(-2.1, 2.1), PATH, PATH[:, 1] > -2.0, **NEED).height(PATH[0]) == 0.0


def test_without_a_mesh_the_ground_is_as_high_as_the_route() -> None:
    level = ground_along_path(PATH + np.array([0, 0, 0.7]), reach=1.5, spacing=0.1, softness=0.3)
    assert level == LevelGround(0.7)
    rising = PATH + np.array([0.0, 0.0, 0.2]) * -PATH[:, 1:2]
    ground = ground_along_path(rising, reach=1.5, spacing=0.1, softness=0.3)
    for side in (-1.0, 0.0, 1.0):
        at = np.array([side, -2.0])
        assert ground.height(at) == pytest.approx(0.4, abs=0.01)
        assert ground.slope(at) == pytest.approx([0.0, -0.2], abs=0.02)


def test_a_spiral_stair_is_noticed() -> None:
    turn = np.linspace(0.0, 4.0 * np.pi, 200)
    stair = np.stack([2.0 * np.cos(turn), 2.0 * np.sin(turn), turn / np.pi], axis=1)
    assert passes_over_itself(stair, 0.5, 0.5)
    assert not passes_over_itself(stair[:90], 0.5, 0.5)


def test_far_away_the_grid_answers_with_its_border() -> None:
    field = HeightField((0.0, 0.0), 1.0, np.array([[0.0, 1.0], [2.0, 3.0]]))
    assert field.height(np.array([0.5, 0.5])) == pytest.approx(1.5)
    assert field.height(np.array([99.0, -99.0])) == pytest.approx(2.0)


@pytest.mark.parametrize("cells", [1, 4, 17, 60, 200])
def test_a_slope_is_the_same_ground_however_finely_it_is_cut(cells: int) -> None:
    places = np.linspace(-8.0, 8.0, cells + 1)
    x, y = np.meshgrid(places, places, indexing="ij")
    corners = np.stack([x, y, 0.1 * x - 0.2 * y], axis=-1)
    a, b, c, d = corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]
    halves = [np.stack(each, axis=2).reshape(-1, 3, 3) for each in ((a, b, c), (a, c, d))]
    path = PATH - 0.2 * PATH[:, 1:2] * np.array([0.0, 0.0, 1.0])

    ground = sample_ground(np.concatenate(halves), path, ALL, **NEED)

    at = np.random.default_rng(0).uniform([-1.0, -4.0], [1.0, 0.0], (200, 2))
    np.testing.assert_allclose(ground.height(at), at @ [0.1, -0.2], atol=1e-12)
