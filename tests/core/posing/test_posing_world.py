# SPDX-License-Identifier: GPL-3.0-or-later
"""The puppet in time: known physics, energy, what stays where it is put, hands and pins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.errors import SettingsError
from octo_motion.core.posing.puppet.figure import Figure, Pose
from octo_motion.core.posing.puppet.materials import elements_for
from octo_motion.core.posing.solver.holds import Coupling
from octo_motion.core.posing.solver.obstacle_shapes import Box, Plane, Sphere
from octo_motion.core.posing.solver.world import World, WorldSettings
from octo_motion.core.rotations import Floats, angle_between, from_axis_angle, multiply, rotate
from tests.core.puppets import chain, doll, free, octopus, posed, soft, torn, tree
from tests.core.world_probes import bend_springs, energy_of, joint_turns, set_velocities

WEIGHT = (0.0, 0.0, -9.81)
DOWN = np.array([0.0, 0.0, -1.0])
seeds = st.integers(0, 2**31)


def run(world: World, seconds: float) -> None:
    for _ in range(round(seconds / world.settings.step)):
        world.step()


# Known physics


def test_free_fall_is_galileos():
    figure = tree(np.random.default_rng(1), 6)
    world = World(figure, posed(figure), WorldSettings(gravity=WEIGHT))
    start = world.pose()
    run(world, 0.5)
    # Velocity first, position with it: z = −g t (t + h)/2.
    fall = -9.81 * 0.5 * (0.5 + 1e-3) / 2.0
    np.testing.assert_allclose(
        world.pose().positions - start.positions, np.tile([0.0, 0.0, fall], (6, 1)), atol=1e-9
    )
    np.testing.assert_allclose(world.pose().orientations, start.orientations, atol=1e-9)


def test_pendulum_has_its_period():
    figure = chain(1, length=0.4)
    hanging = from_axis_angle([1.0, 0.0, 0.0], -0.5 * np.pi + 0.1)
    world = World(
        figure,
        Pose(np.zeros((1, 3)), hanging[None]),
        WorldSettings(gravity=WEIGHT),
    )
    world.pin(0)
    world.set_elements(free(1))
    mass, arm = figure.masses[0], figure.centres[0, 1]
    inertia = figure.inertias[0, 0, 0] + mass * arm * arm
    # A swing of 0.1 rad lasts 1 + 0.1²/16 times as long as a tiny one.
    period = 2.0 * np.pi * np.sqrt(inertia / (mass * 9.81 * arm)) * (1.0 + 0.01 / 16.0)
    times: list[float] = []
    before = 0.0
    for number in range(2200):
        world.step()
        side = rotate(world.pose().orientations[0], [0.0, 1.0, 0.0])[1]
        if before < 0.0 <= side:
            times.append(1e-3 * number - 1e-3 * side / (side - before))
        before = side
    measured = np.diff(times).mean()
    # First order in the step, which is a thousandth of the period.
    assert measured == pytest.approx(period, rel=2e-3)


def test_spun_top_precesses_as_euler_says():
    figure = chain(1, length=0.3, radius=0.05)
    across, about = figure.inertias[0, 0, 0], figure.inertias[0, 1, 1]
    world = World(figure, posed(figure), WorldSettings(step=5e-4))
    spin = np.array([2.0, 6.0, 0.0])
    set_velocities(world, np.concatenate([np.zeros(3), spin])[None])
    momentum = np.array([across * spin[0], about * spin[1], 0.0])
    rate = np.linalg.norm(momentum) / across
    axis = momentum / np.linalg.norm(momentum)
    run(world, 1.0)
    expected = rotate(from_axis_angle(axis, rate * 1.0), [0.0, 1.0, 0.0])
    found = rotate(world.pose().orientations[0], [0.0, 1.0, 0.0])
    # 2.6 rad of precession in a second, first order in the step.
    assert np.degrees(np.arccos(found @ expected)) < 1.0


def test_momentum_of_a_free_figure_is_kept():
    rng = np.random.default_rng(5)
    figure = tree(rng, 8, soft(8, 1.0, 0.1, 0.5, 0.2))
    world = World(figure, posed(figure), WorldSettings())
    set_velocities(world, rng.normal(size=(8, 6)))
    world.step()
    before = figure.masses @ world.velocities()[:, :3]
    run(world, 0.3)
    np.testing.assert_allclose(figure.masses @ world.velocities()[:, :3], before, atol=1e-9)


# Energy


@given(seed=seeds, count=st.integers(1, 9), touching=st.booleans(), alike=st.booleans())
@settings(max_examples=12, deadline=None)
def test_energy_never_grows_without_input(seed: int, count: int, touching: bool, alike: bool):  # noqa: FBT001
    rng = np.random.default_rng(seed)
    elements = soft(count, *np.exp(rng.uniform(-4.0, 2.0, 4)))
    if not alike:
        elements = replace(
            elements, damping=elements.damping * np.exp(rng.uniform(-1.0, 1.0, count))
        )
    figure = tree(rng, count, elements)
    world = World(
        figure,
        posed(figure, 0.5 * rng.normal(size=(count, 3)), (0.0, 0.0, 0.3)),
        WorldSettings(step=float(np.exp(rng.uniform(-8.0, -4.0))), tolerance=1e-8, iterations=50),
        [Plane(position=np.array([0.0, 0.0, -0.5]))] if touching else [],
    )
    set_velocities(world, 2.0 * rng.normal(size=(count, 6)))
    # What the joints forbid goes in the first step.
    world.step()
    energy = start = energy_of(world).total
    for _ in range(60):
        world.step()
        now = energy_of(world).total
        # Of the contacts' give; nothing else may come from nowhere.
        assert now <= energy + (1e-4 if touching else 1e-9) * start
        energy = now
    assert energy <= start * (1.0 + 1e-6)
    assert np.isfinite(world.pose().positions).all()


def test_a_figure_that_lies_on_the_floor_comes_to_rest_and_stays():
    figure = doll()
    figure = replace(figure, elements=elements_for(figure, "doll"))
    world = World(
        figure, posed(figure, at=(0.0, 0.0, 0.13)), WorldSettings(gravity=WEIGHT), [Plane()]
    )
    run(world, 1.2)
    before = world.pose()
    run(world, 0.5)
    after = world.pose()
    assert energy_of(world).kinetic < 1e-6
    # Nothing creeps: a tenth of a millimetre in half a second would be seen.
    assert np.abs(after.positions - before.positions).max() < 1e-4
    ends = after.positions[:, None] + rotate(after.orientations[:, None], figure.capsules)
    low = ends[..., 2].min(axis=1) - figure.radii
    assert low.min() > -1e-3


# What is bent stays bent


@pytest.mark.parametrize("material", ["clay", "doll", "wire"])
def test_a_joint_that_yielded_keeps_its_new_pose_a_minute_later(material: str):
    figure = chain(3)
    figure = replace(figure, elements=elements_for(figure, material))
    world = World(figure, posed(figure), WorldSettings(step=4e-3, drag=2.0))
    world.pin(0)
    tip = world.pose().positions[2] + np.array([0.0, 0.2, 0.0])
    grab = world.grab(2, tip)
    for number in range(250):
        grab.pull(tip + number / 250.0 * np.array([0.0, -0.25, 0.25]))
        world.step()
    world.release(grab)
    bent = world.pose()
    run(world, 2.0)
    settled = world.pose()
    moved = np.degrees(angle_between(settled.orientations, posed(figure).orientations))
    assert moved.max() > 20.0
    later = World(figure, settled, WorldSettings(step=0.04))
    later.pin(0)
    later.restore(world.state())
    run(later, 60.0)
    kept = np.degrees(angle_between(settled.orientations, later.pose().orientations).max())
    assert kept < 1.0
    if material != "wire":
        # Not even when the hand lets go does it spring back by much: less than a degree a joint.
        turns = np.degrees(angle_between(_turns(figure, bent), _turns(figure, settled)))
        assert turns.max() < 1.0


def _turns(figure: Figure, pose: Pose) -> Floats:
    own = pose.orientations.copy()
    for body, parent in enumerate(figure.parents):
        if parent >= 0:
            inverse = pose.orientations[parent] * np.array([1.0, -1.0, -1.0, -1.0])
            own[body] = multiply(inverse, pose.orientations[body])
    return own


def test_wire_springs_back_in_part():
    figure = chain(2)
    figure = replace(figure, elements=elements_for(figure, "wire"))
    world = World(figure, posed(figure), WorldSettings(step=2e-3, drag=2.0))
    world.pin(0)
    tip = world.pose().positions[1] + np.array([0.0, 0.2, 0.0])
    grab = world.grab(1, tip)
    for number in range(500):
        grab.pull(tip + min(number / 400.0, 1.0) * np.array([0.0, -0.15, 0.15]))
        world.step()
    pulled = angle_between(joint_turns(world), figure.rest)
    world.release(grab)
    run(world, 2.0)
    left = angle_between(joint_turns(world), figure.rest)
    assert np.degrees(left.max()) > 20.0
    assert np.degrees(pulled - left).max() > 1.0


# Hands and pins


def test_twisting_a_limb_about_its_own_axis_meets_torque():
    figure = chain(2)
    figure = replace(figure, elements=elements_for(figure, "doll"))
    world = World(figure, posed(figure), WorldSettings())
    world.pin(0, firm=True)
    start = world.pose().orientations[1]
    middle = world.pose().positions[1] + np.array([0.0, 0.1, 0.0])
    grab = world.grab(1, middle, start)
    felt: list[float] = []
    for number in range(400):
        turn = from_axis_angle([0.0, 1.0, 0.0], number / 400.0)
        grab.pull(middle, multiply(turn, start))
        world.step()
        felt.append(float(grab.wrench[4]))
    # On the limb the hand's torque is positive, on the hand the limb's is not; it grows up to yield
    # and the limb then follows the hand.
    limit = float(figure.elements.yield_torque[1])
    assert limit < felt[-1] < 1.3 * limit
    turned = angle_between(start, world.pose().orientations[1])
    assert 0.3 < turned < 1.0
    along = abs(rotate(world.pose().orientations[1], [0.0, 1.0, 0.0])[1])
    assert along > 0.999
    assert abs(grab.wrench[3]) < 0.05 * felt[-1]


def test_a_pulled_figure_follows_the_hand_and_the_hand_feels_its_weight():
    figure = doll()
    figure = replace(figure, elements=elements_for(figure, "doll"))
    world = World(figure, posed(figure), WorldSettings(step=2e-3, gravity=WEIGHT, drag=3.0))
    top = world.pose().positions[4]
    grab = world.grab(4, top)
    for _ in range(2000):
        grab.pull(top)
        world.step()
    weight = 9.81 * figure.masses.sum()
    assert grab.wrench[2] == pytest.approx(weight, rel=0.01)
    np.testing.assert_allclose(grab.wrench[:2], 0.0, atol=0.01 * weight)
    assert np.linalg.norm(world.held_point(grab) - top) < 0.05
    world.release(grab)
    assert not grab.wrench.any()
    world.release(grab)


def test_the_hand_is_limited_in_force():
    figure = chain(1)
    coupling = Coupling(1e4, 1e2, 10.0, 1.0, force_limit=5.0, torque_limit=0.1)
    world = World(figure, posed(figure), WorldSettings())
    grab = world.grab(0, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), coupling)
    far = from_axis_angle([0.0, 0.0, 1.0], 2.0)
    for _ in range(20):
        grab.pull(np.array([10.0, 0.0, 0.0]), far)
        world.step()
        assert np.linalg.norm(grab.wrench[:3]) <= 5.0 * (1.0 + 1e-9)
        assert np.linalg.norm(grab.wrench[3:]) <= 0.1 * (1.0 + 1e-9)


def test_several_pins_hold_while_the_rest_is_pulled():
    figure = doll()
    figure = replace(figure, elements=elements_for(figure, "clay"))
    world = World(figure, posed(figure), WorldSettings(step=2e-3, gravity=WEIGHT))
    for body in (0, 15, 19):
        world.pin(body)
    before = world.pose()
    assert world.pins.keys() == {0, 15, 19}
    hand = before.positions[8]
    grab = world.grab(8, hand)
    for number in range(500):
        grab.pull(hand + number / 500.0 * np.array([-0.3, 0.3, 0.4]))
        world.step()
    after = world.pose()
    np.testing.assert_allclose(
        after.positions[[0, 15, 19]], before.positions[[0, 15, 19]], atol=1e-4
    )
    # Feet are held in their turn as well; the root turns on its own element.
    assert angle_between(after.orientations[15], before.orientations[15]) < 1e-3
    assert np.linalg.norm(after.positions[8] - hand) > 0.1
    world.unpin(15)
    world.unpin(15)
    assert world.pins.keys() == {0, 19}


def test_a_root_that_is_pinned_on_its_way_stays_as_it_is_turned():
    figure = chain(2)
    figure = replace(figure, elements=elements_for(figure, "rubber"))
    world = World(figure, posed(figure), WorldSettings(drag=5.0))
    set_velocities(world, np.tile([0.0, 0.0, 0.0, 3.0, 0.0, 0.0], (2, 1)))
    run(world, 0.2)
    set_velocities(world, np.zeros((2, 6)))
    before = world.pose().orientations[0]
    assert angle_between(before, posed(figure).orientations[0]) > 0.1
    world.pin(0)
    assert energy_of(world).elastic < 1e-6
    run(world, 0.3)
    assert angle_between(world.pose().orientations[0], before) < 0.02


# Books are kept


def test_a_snapshot_brings_back_the_same_future():
    figure = doll()
    figure = replace(figure, elements=elements_for(figure, "wire"))
    world = World(
        figure, posed(figure, at=(0.0, 0.0, 0.13)), WorldSettings(gravity=WEIGHT), [Plane()]
    )
    run(world, 0.1)
    state = world.state()
    run(world, 0.1)
    first = world.pose()
    world.restore(state)
    run(world, 0.1)
    np.testing.assert_array_equal(world.pose().positions, first.positions)
    np.testing.assert_array_equal(world.pose().orientations, first.orientations)


def test_a_new_pose_is_at_rest_unless_the_springs_are_kept():
    figure = chain(3, elements=soft(3, 1.0, 0.05, 10.0, np.inf))
    world = World(figure, posed(figure), WorldSettings())
    bent = posed(figure, np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.0, 0.0, 0.4]]))
    world.set_pose(bent)
    assert energy_of(world).total == 0.0
    run(world, 0.05)
    np.testing.assert_allclose(world.pose().positions, bent.positions, atol=1e-12)
    bend_springs(world, posed(figure))
    assert energy_of(world).elastic == pytest.approx(0.5 * 2 * 0.4**2)
    run(world, 0.05)
    assert energy_of(world).kinetic > 0.0


def test_loads_are_those_of_statics():
    figure = chain(2)
    figure = replace(figure, elements=elements_for(figure, "doll"))
    world = World(figure, posed(figure), WorldSettings(gravity=WEIGHT))
    world.pin(0, firm=True)
    run(world, 0.5)
    lever = figure.masses[1] * 9.81 * figure.centres[1, 1]
    # Level, along +Y: held up by a torque about +X.
    np.testing.assert_allclose(world.joint_loads()[1], [lever, 0.0, 0.0], atol=0.01 * lever)


def test_settings_without_sense_are_told():
    figure = chain(1)
    for wrong in (
        WorldSettings(step=0.0),
        WorldSettings(step=float("nan")),
    ):
        with pytest.raises(SettingsError):
            World(figure, posed(figure), wrong)


# Nothing explodes


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_nothing_explodes_however_it_is_torn(seed: int):
    rng = np.random.default_rng(seed)
    figure = [doll(), tree(rng, 12), octopus()][seed]
    material = ["clay", "rubber", "wire"][seed]
    figure = replace(figure, elements=elements_for(figure, material))
    world = World(
        figure,
        posed(figure, at=(0.0, 0.0, 0.5)),
        WorldSettings(gravity=WEIGHT, self_collision=seed < 2),
        [
            Plane(),
            Box(position=np.array([0.4, 0.4, 0.1]), half=np.array([0.2, 0.2, 0.1])),
            Sphere(position=np.array([-0.4, 0.4, 0.1]), radius=0.2),
        ],
    )
    for found in torn(world, rng, 500 if seed < 2 else 120):
        assert not found.broken
        # The bound is 1 %; joints that are coordinates stay closed to rounding.
        assert found.widest < 1e-9
        # A hand moves at 50 m/s here; nothing may be faster than that by orders.
        assert found.fastest < 1e4
        assert found.gain <= 1e-6 * found.energy
