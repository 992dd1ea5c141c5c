# SPDX-License-Identifier: GPL-3.0-or-later
"""The octopus' web: between all arms, a third of their length; nothing else is changed by it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from octo_motion.core.errors import SettingsError
from octo_motion.core.locomotion.octopus.mesh import build_mesh
from octo_motion.core.locomotion.octopus.shape import OctopusShape
from octo_motion.core.locomotion.octopus.surface import OctopusMesh

pytestmark = pytest.mark.one_blender

SHAPES = {
    "default": OctopusShape(),
    "three arms": OctopusShape(arms=3, joints=3),
    "seven arms": OctopusShape(arms=7, joints=30),
    "twenty arms": OctopusShape(arms=20, joints=7),
    "most arms": OctopusShape(arms=64, joints=3),
    "cones": OctopusShape(taper=1.0, mesh_taper=1.0),
    "threads": OctopusShape(arm_length=20.0, first_diameter=0.01),
}


@pytest.fixture(params=SHAPES, scope="module")
def shape(request: pytest.FixtureRequest) -> OctopusShape:
    return SHAPES[request.param]


@pytest.fixture(scope="module")
def mesh(shape: OctopusShape) -> OctopusMesh:
    return build_mesh(shape)


def faces(mesh: OctopusMesh) -> set[tuple[int, ...]]:
    return {tuple(sorted(quad)) for quad in mesh.quads.tolist()}


def touching(mesh: OctopusMesh) -> Any:
    """Vertices of the arms at which the web ends."""
    beside = np.unique(mesh.quads[np.any(mesh.web[mesh.quads], axis=1)])
    return beside[~mesh.web[beside]]


def reach(shape: OctopusShape, mesh: OctopusMesh) -> float:
    """How far along the arms the web touches them, as a share of their length."""
    points = mesh.vertices[touching(mesh)]
    # The arms lie along lines from the axis: their sides are half a diameter off these.
    angle = np.arctan2(points[:, 0], -points[:, 1])[:, None] - shape.angles
    along = np.hypot(points[:, 0], points[:, 1])[:, None] * np.cos(angle)
    return float(np.max(np.max(along, axis=1) - shape.crown_radius)) / shape.arm_length


def test_the_default_octopus_has_a_web_of_a_third_of_its_arms() -> None:
    shape = OctopusShape()
    assert shape.web == pytest.approx(1.0 / 3.0)
    # One row of faces is 2.5 % of an arm.
    assert reach(shape, build_mesh(shape)) == pytest.approx(1.0 / 3.0, abs=0.03)


def test_any_number_of_arms_from_three_on_has_it_between_each_arm_and_the_next(
    shape: OctopusShape, mesh: OctopusMesh
) -> None:
    points = mesh.vertices[mesh.web]
    turn = (np.arctan2(points[:, 0], -points[:, 1]) - shape.angles[0]) % (2.0 * np.pi)
    between = np.floor(turn / (2.0 * shape.half_sector)).astype(int)
    counts = np.bincount(between, minlength=shape.arms)
    assert counts.min() == counts.max() > 0
    assert reach(shape, mesh) == pytest.approx(1.0 / 3.0, abs=0.1)


def test_the_middle_hangs_back_in_an_arch_and_reaches_no_further_than_the_arms(
    shape: OctopusShape, mesh: OctopusMesh
) -> None:
    distance = np.hypot(*mesh.vertices[mesh.web][:, :2].T)
    at_the_arms = np.hypot(*mesh.vertices[touching(mesh)][:, :2].T)
    assert distance.max() < at_the_arms.max()
    assert distance.max() > shape.crown_radius


@pytest.mark.parametrize("arms", [1, 2])
def test_one_arm_and_two_have_none(arms: int) -> None:
    shape = OctopusShape(arms=arms)
    mesh = build_mesh(shape)
    assert not mesh.web.any()
    np.testing.assert_array_equal(mesh.vertices, build_mesh(replace(shape, web=0.0)).vertices)


def test_the_rest_of_the_skin_stays_as_it_is_without(
    shape: OctopusShape, mesh: OctopusMesh
) -> None:
    bare = build_mesh(replace(shape, web=0.0))
    count = len(bare.vertices)
    assert not bare.web.any()
    np.testing.assert_array_equal(mesh.web, np.arange(len(mesh.vertices)) >= count)
    for name in ("vertices", "bones", "weights"):
        np.testing.assert_array_equal(getattr(mesh, name)[:count], getattr(bare, name))
    # The web takes the place of some faces, all of which end where it does, and changes no other.
    gone, new = faces(bare) - faces(mesh), faces(mesh) - faces(bare)
    edge = {*touching(mesh).tolist(), *np.flatnonzero(mesh.web).tolist()}
    assert all(edge & set(face) for face in gone | new)
    assert len(gone) < len(new)


def test_at_rest_it_hangs_no_lower_than_the_arms(mesh: OctopusMesh) -> None:
    assert mesh.vertices[mesh.web][:, 2].min() > mesh.vertices[~mesh.web][:, 2].min()


def test_at_rest_its_upper_side_is_above_its_lower_side(
    shape: OctopusShape, mesh: OctopusMesh
) -> None:
    upper, lower = np.split(mesh.vertices[mesh.web], 2)
    np.testing.assert_allclose(upper[:, :2], lower[:, :2], atol=0.2 * shape.first_diameter)
    assert np.all(upper[:, 2] > lower[:, 2])


def test_it_reaches_as_far_as_one_says() -> None:
    shape = OctopusShape()
    for share in (0.3, 0.5, 0.8):
        longer = replace(shape, web=share)
        assert reach(longer, build_mesh(longer)) == pytest.approx(share, abs=0.03)
    # What the arms' roots share reaches further by itself.
    assert not build_mesh(replace(shape, web=0.1)).web.any()


@pytest.mark.parametrize("share", [-0.1, 0.9])
def test_a_web_that_cannot_be_is_refused(share: float) -> None:
    with pytest.raises(SettingsError, match="Web reach"):
        OctopusShape(web=share)


def test_each_point_follows_the_two_arms_beside_it_in_shares_that_add_up(
    shape: OctopusShape, mesh: OctopusMesh
) -> None:
    bones, weights = mesh.bones[mesh.web], mesh.weights[mesh.web]
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-9)
    arm = (bones - 7) // shape.joints
    turn = np.arctan2(mesh.vertices[mesh.web][:, 0], -mesh.vertices[mesh.web][:, 1])
    turn = (turn - shape.angles[0]) % (2.0 * np.pi)
    first = np.floor(turn / (2.0 * shape.half_sector)).astype(int)
    moved = (weights > 0.0) & (bones >= 7)
    ahead = (arm - first[:, None]) % shape.arms
    assert np.all(ahead[moved] <= 1)
