# SPDX-License-Identifier: GPL-3.0-or-later
"""What a puppet touches: where surfaces are, friction at its angle, moving things, itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.errors import SettingsError
from octo_motion.core.posing.puppet.figure import Figure
from octo_motion.core.posing.puppet.materials import elements_for
from octo_motion.core.posing.solver.contact_detection import Detector, nearest_on_segments
from octo_motion.core.posing.solver.obstacle_shapes import (
    Box,
    Capsule,
    Hull,
    Mesh,
    Obstacle,
    Plane,
    Sphere,
    nearest_on_triangles,
)
from octo_motion.core.posing.solver.world import World, WorldSettings
from octo_motion.core.rotations import (
    Floats,
    from_axis_angle,
    from_rotation_vector,
    multiply,
    rotate,
    to_matrix,
)
from tests.core.puppets import chain, octopus, posed, puppet, soft
from tests.core.world_probes import energy_of, set_velocities

WEIGHT = (0.0, 0.0, -9.81)
seeds = st.integers(0, 2**31)
_FACES = [
    (0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4),
    (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5),
]  # fmt: skip


def block(half: Floats) -> Floats:
    """(12, 3, 3) triangles of a box, turned outwards."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = (signs * half)[np.array(_FACES)]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normal * corners.mean(axis=1)).sum(axis=1) < 0.0
    corners[inward] = corners[inward][:, ::-1]
    return corners


def sheet(cells: int, size: float) -> Floats:
    """(triangles, 3, 3) of a flat square at z = 0 facing up."""
    edge = np.linspace(-size, size, cells + 1)
    x, y = np.meshgrid(edge, edge, indexing="ij")
    grid = np.stack([x, y, 0.0 * x], axis=-1)
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    first = np.stack([a, b, c], axis=2).reshape(-1, 3, 3)
    second = np.stack([a, c, d], axis=2).reshape(-1, 3, 3)
    return np.concatenate([first, second])


# Surfaces


@given(seed=seeds)
@settings(max_examples=20, deadline=None)
def test_distances_and_ways_out_lead_to_the_surface(seed: int):
    rng = np.random.default_rng(seed)
    half = rng.uniform(0.2, 1.0, 3)
    ends = rng.normal(size=(2, 3))
    for obstacle in (
        Plane(),
        Sphere(radius=0.7),
        Capsule(ends=ends, radius=0.3),
        Box(half=half),
        Hull(corners=block(half)),
        Mesh(corners=block(half)),
    ):
        points = rng.uniform(-1.5, 1.5, (60, 3))
        distance, out = obstacle.closest(points, 3.0)
        found = np.isfinite(distance)
        assert found.mean() > 0.5
        points, distance, out = points[found], distance[found], out[found]
        np.testing.assert_allclose(np.linalg.norm(out, axis=1), 1.0, atol=1e-9)
        surface = points - distance[:, None] * out
        again, _ = obstacle.closest(surface, 3.0)
        np.testing.assert_allclose(again[np.isfinite(again)], 0.0, atol=1e-7)
        # One step along the way out is one step further off, but for edges met from inside.
        outside = distance > 0.0
        further, _ = obstacle.closest(points[outside] + 0.01 * out[outside], 3.0)
        np.testing.assert_allclose(further - distance[outside], 0.01, atol=1e-6)


@given(seed=seeds)
@settings(max_examples=20, deadline=None)
def test_box_hull_and_mesh_of_one_shape_agree(seed: int):
    rng = np.random.default_rng(seed)
    half = rng.uniform(0.3, 1.0, 3)
    points = rng.uniform(-1.4, 1.4, (80, 3))
    right, _ = Box(half=half).closest(points, 3.0)
    np.testing.assert_allclose(Hull(corners=block(half)).closest(points, 3.0)[0], right, atol=1e-9)
    meshed, _ = Mesh(corners=block(half)).closest(points, 3.0)
    near = np.isfinite(meshed)
    np.testing.assert_allclose(meshed[near], right[near], atol=1e-9)
    assert near.mean() > 0.9


@given(seed=seeds)
@settings(max_examples=20, deadline=None)
def test_nearest_points_are_nearer_than_any_other(seed: int):
    rng = np.random.default_rng(seed)
    triangles, points = rng.normal(size=(9, 3, 3)), rng.normal(size=(9, 3))
    nearest = nearest_on_triangles(points, triangles)
    weights = rng.dirichlet([1.0, 1.0, 1.0], size=(200, 9))
    others = (weights[..., None] * triangles).sum(axis=2)
    least = np.linalg.norm(points - others, axis=-1).min(axis=0)
    assert np.all(np.linalg.norm(points - nearest, axis=-1) <= least + 1e-9)
    first, second = rng.normal(size=(2, 9, 2, 3))
    a, b = nearest_on_segments(first, second)
    s, t = rng.uniform(size=(2, 400, 9, 1))
    on_first = first[:, 0] + s * (first[:, 1] - first[:, 0])
    on_second = second[:, 0] + t * (second[:, 1] - second[:, 0])
    least = np.linalg.norm(on_first - on_second, axis=-1).min(axis=0)
    assert np.all(np.linalg.norm(a - b, axis=-1) <= least + 1e-9)


@given(seed=seeds)
@settings(max_examples=15, deadline=None)
def test_a_turned_and_shifted_scene_has_turned_and_shifted_contacts(seed: int):
    rng = np.random.default_rng(seed)
    figure = chain(3)
    pose = posed(figure, 0.5 * rng.normal(size=(3, 3)))
    turn, shift = from_rotation_vector(rng.normal(size=3)), rng.normal(size=3)
    obstacles = [
        Plane(position=np.array([0.0, 0.0, -0.05])),
        Box(half=np.array([0.1, 0.1, 0.1]), position=np.array([0.12, 0.13, 0.02])),
        Sphere(radius=0.1, position=np.array([0.0, 0.3, 0.1])),
    ]
    moved = [
        replace(
            one,
            position=rotate(turn, one.position) + shift,
            orientation=multiply(turn, one.orientation),
        )
        for one in obstacles
    ]
    detector = Detector(figure, self_collision=False)
    here = detector.find(pose.positions, to_matrix(pose.orientations), obstacles, 0.1)
    there = detector.find(
        rotate(turn, pose.positions) + shift,
        to_matrix(multiply(turn, pose.orientations)),
        moved,
        0.1,
    )
    np.testing.assert_array_equal(here.labels, there.labels)
    np.testing.assert_allclose(here.gaps, there.gaps, atol=1e-9)
    np.testing.assert_allclose(rotate(turn, here.points) + shift, there.points, atol=1e-6)


def test_a_rod_across_an_edge_is_touched_between_its_ends():
    figure = chain(1, length=1.0, radius=0.05)
    pose = posed(figure, at=(0.0, -0.5, 0.15))
    post = Box(half=np.array([0.02, 0.02, 0.1]))
    detector = Detector(figure, self_collision=False)
    found = detector.find(pose.positions, to_matrix(pose.orientations), [post], 0.01)
    assert len(found) == 1
    np.testing.assert_allclose(found.normals, [[0.0, 0.0, 1.0]], atol=1e-6)
    assert found.gaps[0] == pytest.approx(0.0, abs=1e-9)
    # Within the post's top, up to the samples' last refinement.
    assert abs(found.points[0, 1]) <= 0.03


# Friction


def sled() -> Figure:
    """Two runners, joined so stiffly that they are one."""
    return puppet(
        [-1, 0],
        [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]],
        [0.4, 0.4],
        [0.05, 0.05],
        soft(2, 1e6, 1e3, 1.0, np.inf),
    )


def slope(kind: str, angle: float) -> Obstacle:
    turn = from_axis_angle([1.0, 0.0, 0.0], angle)
    if kind == "plane":
        return Plane(orientation=turn)
    below = rotate(turn, [0.0, 0.0, -0.5])
    half = np.array([6.0, 6.0, 0.5])
    if kind == "box":
        return Box(half=half, orientation=turn, position=below)
    if kind == "hull":
        return Hull(corners=block(half), orientation=turn, position=below)
    return Mesh(corners=sheet(12, 6.0), orientation=turn)


@pytest.mark.parametrize("kind", ["plane", "box", "hull", "mesh"])
@pytest.mark.parametrize("friction", [0.3, 0.8])
def test_a_sled_sticks_below_its_friction_angle_and_slides_above_as_coulomb_says(
    kind: str, friction: float
):
    figure = sled()
    limit = np.arctan(friction)
    slid: list[float] = []
    for angle in (limit - np.radians(1.0), limit + np.radians(1.0)):
        turn = from_axis_angle([1.0, 0.0, 0.0], angle)
        pose = posed(figure)
        start = rotate(turn, [0.0, 0.0, 0.05])
        pose = replace(
            pose,
            positions=rotate(turn, pose.positions) + start,
            orientations=multiply(turn, pose.orientations),
        )
        world = World(
            figure,
            pose,
            WorldSettings(step=2e-3, gravity=WEIGHT, friction=friction),
            [slope(kind, angle)],
        )
        for _ in range(125):
            world.step()
        halfway = world.pose().positions[0]
        for _ in range(125):
            world.step()
        way = world.pose().positions[0] - start
        slid.append(float(np.linalg.norm(way)))
        if angle > limit:
            # ½ g (sin − μ cos) t², down the slope.
            pull = 9.81 * (np.sin(angle) - friction * np.cos(angle))
            assert slid[-1] == pytest.approx(0.5 * pull * 0.25, rel=0.03)
            assert rotate(turn, [0.0, -1.0, 0.0]) @ way == pytest.approx(slid[-1], rel=1e-3)
        else:
            # It stays: half a millimetre until it bears its weight, and then nothing.
            assert slid[-1] < 5e-4
            assert np.linalg.norm(world.pose().positions[0] - halfway) < 1e-6


def test_what_slides_neither_lifts_off_nor_digs_in():
    figure = sled()
    world = World(
        figure,
        posed(figure, at=(0.0, 0.0, 0.05)),
        WorldSettings(gravity=WEIGHT, friction=0.5),
        [Plane()],
    )
    set_velocities(world, np.tile([0.0, 1.0, 0.0, 0.0, 0.0, 0.0], (2, 1)))
    for number in range(250):
        world.step()
        # Within a twentieth of a millimetre of the floor, from the first moment to the last.
        assert abs(world.pose().positions[0, 2] - 0.05) < 5e-5
        if number == 49:
            # And brakes with μ g.
            assert world.velocities()[0, 1] == pytest.approx(1.0 - 0.5 * 9.81 * 0.05, rel=0.01)
    assert np.abs(world.velocities()).max() < 1e-6


def test_a_blow_at_an_angle_slows_by_friction_as_newton_says():
    figure = sled()
    world = World(
        figure,
        posed(figure, at=(0.0, 0.0, 0.0505)),
        WorldSettings(friction=0.3),
        [Plane()],
    )
    set_velocities(world, np.tile([0.0, 2.0, -1.0, 0.0, 0.0, 0.0], (2, 1)))
    for _ in range(5):
        world.step()
    # All of the fall and μ times as much of the slide are gone.
    np.testing.assert_allclose(world.velocities()[:, :3], [[0.0, 1.7, 0.0]] * 2, atol=0.01)
    assert world.pose().positions[0, 2] == pytest.approx(0.05, abs=1e-4)


# Landing, resting, being moved


@pytest.mark.parametrize(
    "obstacle",
    [
        Plane(),
        Box(half=np.array([1.0, 1.0, 0.2]), position=np.array([0.0, 0.0, -0.2])),
        Hull(corners=block(np.array([1.0, 1.0, 0.2])), position=np.array([0.0, 0.0, -0.2])),
        Mesh(corners=sheet(10, 1.0)),
        Mesh(corners=sheet(60, 1.0)),
        Sphere(radius=50.0, position=np.array([0.0, 0.0, -50.0])),
        Capsule(
            ends=np.array([[0.0, -5.0, 0.0], [0.0, 5.0, 0.0]]),
            radius=20.0,
            position=np.array([0.0, 0.0, -20.0]),
        ),
    ],
    ids=["plane", "box", "hull", "coarse mesh", "fine mesh", "sphere", "capsule"],
)
def test_a_fallen_chain_lies_on_every_kind_of_obstacle(obstacle: Obstacle):
    figure = chain(3)
    figure = replace(figure, elements=elements_for(figure, "clay"))
    world = World(
        figure,
        posed(figure, np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 0.5], [0.0, 0.0, -0.9]]), (0, 0, 0.1)),
        WorldSettings(step=2e-3, gravity=WEIGHT),
        [obstacle],
    )
    deepest = 0.0
    for _ in range(300):
        world.step()
        assert world.contacts is not None
        deepest = min(deepest, float(world.contacts.gaps.min(initial=0.0)))
    # It lands at 1.2 m/s and never sinks deeper than a hundredth of its radius.
    assert deepest > -3e-4
    contacts = world.contacts
    assert contacts is not None
    assert len(contacts) >= 2
    assert np.abs(contacts.gaps).min() < 1e-4
    assert energy_of(world).kinetic < 1e-3


def test_what_starts_inside_is_brought_out_slowly():
    figure = chain(2)
    figure = replace(figure, elements=elements_for(figure, "doll"))
    world = World(figure, posed(figure, at=(0.0, 0.0, -0.05)), WorldSettings(step=2e-3), [Plane()])
    for _ in range(600):
        world.step()
        # The speed of getting out is not kept: without weight it would fly off for ever.
        assert np.abs(world.velocities()[:, :3]).max() < 0.05
    assert world.contacts is not None
    assert world.contacts.gaps.min(initial=0.0) > -1e-3


def test_a_rising_box_lifts_a_limb():
    figure = chain(2)
    figure = replace(figure, elements=elements_for(figure, "clay"))
    world = World(figure, posed(figure), WorldSettings(step=2e-3))
    world.pin(0)
    half = np.array([0.1, 0.1, 0.1])
    for number in range(300):
        height = -0.14 + 0.2 * number / 300.0
        world.obstacles = (Box(half=half, position=np.array([0.0, 0.35, height])),)
        world.step()
    tip = world.pose().positions[1] + rotate(world.pose().orientations[1], [0.0, 0.2, 0.0])
    assert tip[2] > 0.1


def test_limbs_collide_with_each_other_only_when_asked():
    # An arm of three bones folded back onto itself.
    figure = chain(4, radius=0.04)
    figure = replace(figure, elements=elements_for(figure, "clay"))
    least: list[float] = []
    for asked in (False, True):
        world = World(figure, posed(figure), WorldSettings(step=2e-3, self_collision=asked))
        world.pin(0, firm=True)
        tip = world.pose().positions[3] + np.array([0.0, 0.2, 0.0])
        grab = world.grab(3, tip)
        for number in range(500):
            share = number / 500.0
            angle = share * np.pi
            hand = np.array([0.0, 0.45 + 0.35 * np.cos(angle), 0.3 * np.sin(angle)])
            grab.pull(hand - np.array([0.0, 0.3, 0.1]) * share)
            world.step()
        pose = world.pose()
        ends = pose.positions[:, None] + rotate(pose.orientations[:, None], figure.capsules)
        first, second = np.array([0, 0, 1]), np.array([2, 3, 3])
        a, b = nearest_on_segments(ends[first], ends[second])
        least.append(float((np.linalg.norm(a - b, axis=1) - 0.08).min()))
    assert least[0] < -0.01
    assert least[1] > -1e-3


def test_neighbours_and_what_overlaps_at_rest_never_collide():
    figure = octopus()
    detector = Detector(figure, self_collision=True)
    pose = posed(figure)
    found = detector.find(pose.positions, to_matrix(pose.orientations), [], 1e-4)
    assert len(found) == 0 or found.gaps.min() >= -1e-12


def test_an_obstacle_without_faces_is_told():
    for kind in (Hull, Mesh):
        with pytest.raises(SettingsError):
            kind(corners=np.zeros((2, 3, 3)))
        with pytest.raises(SettingsError):
            kind(corners=np.zeros((0, 3, 3)))


def test_few_large_faces_among_many_small_ones_are_found_like_any_others():
    """A detailed statue on a wide slope: the grid is no finer than memory allows."""
    rng = np.random.default_rng(3)
    small = rng.uniform(-1.0, 1.0, (500, 1, 3)) + 0.01 * rng.normal(size=(500, 3, 3))
    slope = np.array([[[-50.0, -50.0, -20.0], [50.0, -50.0, -10.0], [50.0, 50.0, 10.0]]])
    mesh = Mesh(corners=np.concatenate([small, slope]))
    assert mesh.thickness < 0.1
    normal = np.cross(slope[0, 1] - slope[0, 0], slope[0, 2] - slope[0, 0])
    normal /= np.linalg.norm(normal)
    shares = rng.dirichlet(np.ones(3), 40)
    points = shares @ slope[0] + 0.05 * normal
    points = points[np.linalg.norm(points, axis=1) > 3.0]
    distances, ways = mesh.closest(points, 0.1)
    np.testing.assert_allclose(distances, 0.05, atol=1e-9)
    np.testing.assert_allclose(ways, np.tile(normal, (len(points), 1)), atol=1e-9)


@pytest.mark.parametrize("bones", [1, 3])
@pytest.mark.parametrize("thick", [0.002, 0.05])
@pytest.mark.parametrize("height", [1.0, 1.23])
@pytest.mark.parametrize("aside", [0.0, 40.0])
def test_what_hits_a_thin_board_at_a_hundred_metres_a_second_stays_on_its_side(
    bones: int, thick: float, height: float, aside: float
):
    """In steps of 4 ms it flies 40 cm in each, and what has hit with one end spins on its way."""
    figure = chain(bones)
    figure = replace(figure, elements=elements_for(figure, "doll"))
    tilted = np.zeros((bones, 3))
    tilted[0, 0] = 0.7 if bones > 1 else 1.2
    board = Box(half=np.array([50.0, 50.0, 0.5 * thick]))
    world = World(
        figure,
        posed(figure, tilted, at=(0.0, 0.0, height)),
        WorldSettings(step=4e-3),
        [board],
    )
    world.forces[:, :3] = figure.masses[:, None] / 4e-3 * np.array([aside, 0.0, -100.0])
    world.step()
    world.forces[:] = 0.0
    for _ in range(150):
        world.step()
    pose = world.pose()
    ends = pose.positions + rotate(pose.orientations, [0.0, 0.2, 0.0])
    assert min(pose.positions[:, 2].min(), ends[:, 2].min()) > 0.5 * thick
    # It has been stopped, not thrown back.
    assert world.velocities()[:, 2].max() < 5.0


def test_way_round_a_board_leads_to_its_other_side():
    """Only what has gone in is seen from where it went in."""
    board = Box(half=np.array([0.2, 0.2, 0.005]))
    before = np.array([[0.0, 0.0, 0.1], [0.3, 0.0, 0.1], [0.3, 0.0, 0.1], [np.nan] * 3])
    after = np.array([[0.0, 0.0, -0.1], [0.3, 0.0, -0.1], [0.1, 0.0, 0.002], [0.0, 0.0, 0.0]])
    entered, axis = board.entered(before, after)
    assert entered.tolist() == [True, False, True, False]
    assert axis[[0, 2]].tolist() == [2, 2]
