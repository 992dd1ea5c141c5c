# SPDX-License-Identifier: GPL-3.0-or-later
"""Joints that turn so far and no further, each way as far as the rig says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.posing.puppet.figure import Figure
from octo_motion.core.posing.puppet.joint_limits import bends, slopes
from octo_motion.core.posing.puppet.materials import elements_for
from octo_motion.core.posing.session import hand_for
from octo_motion.core.posing.solver.holds import Coupling
from octo_motion.core.posing.solver.obstacle_shapes import Plane
from octo_motion.core.posing.solver.world import World, WorldSettings
from octo_motion.core.rotations import (
    Floats,
    from_axis_angle,
    from_rotation_vector,
    multiply,
    normalized,
    rotate,
)
from tests.core.puppets import chain, doll, opening, posed, soft, tree
from tests.core.world_probes import energy_of, joint_turns, set_velocities

FREE = (-np.pi, np.pi)
SLOP = np.radians(0.2)
"""What a stop gives way by under a pull of many times the limb's weight."""


def limited(figure: Figure, *ranges: tuple[tuple[float, float], ...]) -> Figure:
    """The figure with these ranges, degrees, at its last joints."""
    whole = np.tile(FREE, (len(figure), 3, 1))
    whole[-len(ranges) :] = np.radians(np.array(ranges))
    return replace(figure, limits=whole)


def elbow(material: str = "limp") -> Figure:
    """Two bones in a hinge about X that opens from 0° to 150°."""
    figure = chain(2)
    figure = replace(figure, elements=elements_for(figure, material))
    return limited(figure, ((0.0, 150.0), (0.0, 0.0), (0.0, 0.0)))


def pulled(figure: Figure, angle: float, aside: float = 0.0, step: float = 1e-3) -> Floats:
    """Bends (3,) of the last joint, degrees, once a hand has led its tip round by an angle."""
    world = World(figure, posed(figure), WorldSettings(step=step))
    world.pin(0, firm=True)
    joint, arm = world.pose().positions[1], np.array([0.0, 0.2, 0.0])
    firm = Coupling.for_figure(figure)
    grab = world.grab(1, joint + arm, coupling=firm)
    for number in range(round(1.6 / step)):
        share = min(number * step / 0.8, 1.0)
        turn = from_axis_angle([1.0, 0.0, 0.0], share * np.radians(angle))
        place = joint + np.array([aside * share, 0.0, 0.0]) + rotate(turn, arm)
        grab.pull(place)
        world.step()
    assert opening(figure, world.pose()) < 1e-9
    return np.degrees(bends(joint_turns(world)[1]))


# --- What a bend is ------------------------------------------------------------------------------


@given(st.floats(0.0, 3.0), st.floats(-3.1, 3.1), st.floats(0.0, 6.28))
def test_a_turn_is_a_twist_and_then_a_bend(swing: float, twist: float, way: float):
    axis = np.array([np.cos(way), 0.0, np.sin(way)])
    turn = multiply(from_axis_angle(axis, swing), from_axis_angle([0.0, 1.0, 0.0], twist))
    expected = [swing * axis[0], twist, swing * axis[2]]
    for sign in (1.0, -1.0):
        assert bends(sign * turn) == pytest.approx(expected, abs=1e-6)


@given(st.integers(0, 2**31))
@settings(max_examples=50)
def test_slopes_of_the_bends_are_their_derivatives(seed: int):
    turn = normalized(np.random.default_rng(seed).normal(size=4))
    if turn[0] ** 2 + turn[2] ** 2 < 0.02:
        return
    for axis, found in zip(np.eye(3), slopes(turn).T, strict=True):
        ways = from_rotation_vector(np.array([1e-6, -1e-6])[:, None] * axis)
        ahead, behind = bends(multiply(ways, turn))
        assert (ahead - behind) / 2e-6 == pytest.approx(found, rel=1e-6, abs=1e-6)


def test_a_bone_at_rest_bends_about_its_own_axes():
    unturned = np.array([1.0, 0.0, 0.0, 0.0])
    assert not bends(unturned).any()
    np.testing.assert_array_equal(slopes(unturned), np.eye(3))


# --- What holds it -------------------------------------------------------------------------------


@pytest.mark.parametrize("step", [1e-3, 4e-3])
def test_an_elbow_that_is_pulled_backwards_stays_straight(step: float):
    assert pulled(elbow(), -90.0, step=step) == pytest.approx([0.0, 0.0, 0.0], abs=0.2)


@pytest.mark.parametrize("step", [1e-3, 4e-3])
def test_an_elbow_opens_as_far_as_it_may_and_no_further(step: float):
    assert pulled(elbow(), 100.0, step=step)[0] == pytest.approx(100.0, abs=2.0)
    assert pulled(elbow(), 175.0, step=step) == pytest.approx([150.0, 0.0, 0.0], abs=0.2)


def test_an_elbow_that_is_pulled_aside_neither_leans_nor_twists():
    found = pulled(elbow(), 80.0, aside=0.3)
    assert found[0] > 30.0
    assert found[1:] == pytest.approx([0.0, 0.0], abs=0.2)


def test_what_is_limited_one_way_is_free_the_other():
    figure = limited(replace(chain(2), elements=elements_for(chain(2), "limp")), ((-20, 180),) * 3)
    assert pulled(figure, -90.0)[0] == pytest.approx(-20.0, abs=0.2)
    assert pulled(figure, 90.0)[0] == pytest.approx(90.0, abs=2.0)


def test_a_pull_that_lasts_does_not_push_a_joint_through_its_end():
    world = World(elbow("clay"), posed(elbow()), WorldSettings(step=4e-3))
    world.pin(0, firm=True)
    world.forces[1, 3:] = -20.0 * float(world.figure.elements.yield_torque[1]) * np.eye(3)[0]
    for _ in range(250):
        world.step()
    early = bends(joint_turns(world)[1])[0]
    for _ in range(2500):
        world.step()
    assert bends(joint_turns(world)[1])[0] == pytest.approx(early, abs=1e-4)
    assert abs(early) < SLOP


def test_a_twist_ends_on_each_side_where_it_should():
    figure = replace(chain(2), elements=elements_for(chain(2), "limp"))
    figure = limited(figure, ((-180.0, 180.0), (-10.0, 60.0), (-180.0, 180.0)))
    for way, end in ((1.0, 60.0), (-1.0, -10.0)):
        world = World(figure, posed(figure), WorldSettings())
        world.pin(0, firm=True)
        world.forces[1, 3:] = way * np.array([0.0, 5.0, 0.0])
        for _ in range(800):
            world.step()
        assert np.degrees(bends(joint_turns(world)[1])[1]) == pytest.approx(end, abs=0.2)


def test_a_fast_limb_does_not_jump_over_the_end_of_its_range():
    figure = elbow()
    world = World(figure, posed(figure), WorldSettings(step=4e-3))
    world.pin(0, firm=True)
    velocities = np.zeros((2, 6))
    velocities[1] = [0.0, 0.0, 6.0, 60.0, 0.0, 0.0]
    set_velocities(world, velocities)
    for _ in range(100):
        world.step()
        bend = np.degrees(bends(joint_turns(world)[1]))
        # 14° a step: the end is met within the step that would pass it.
        assert -0.5 < bend[0] < 150.5
        assert bend[1:] == pytest.approx([0.0, 0.0], abs=0.5)


@given(seed=st.integers(0, 2**31), touching=st.booleans())
@settings(max_examples=12, deadline=None)
def test_energy_never_grows_at_the_ends_of_ranges(seed: int, touching: bool):  # noqa: FBT001
    rng = np.random.default_rng(seed)
    count = 6
    figure = tree(rng, count, soft(count, *np.exp(rng.uniform(-4.0, 0.0, 4))))
    ends = np.sort(rng.uniform(-1.0, 1.0, (count, 3, 2)), axis=2)
    ends[..., 0] = np.minimum(ends[..., 0], 0.0)
    ends[..., 1] = np.maximum(ends[..., 1], 0.0)
    figure = replace(figure, limits=ends)
    world = World(
        figure,
        posed(figure, at=(0.0, 0.0, 0.3)),
        WorldSettings(step=float(np.exp(rng.uniform(-8.0, -5.5))), tolerance=1e-8, iterations=50),
        [Plane(position=np.array([0.0, 0.0, -0.5]))] if touching else [],
    )
    set_velocities(world, 2.0 * rng.normal(size=(count, 6)))
    world.step()
    energy = start = energy_of(world).total
    for _ in range(80):
        world.step()
        now = energy_of(world).total
        # Of the contacts' give, and of joints that are led back slowly.
        assert now <= energy + 1e-4 * start
        energy = now
    assert energy <= start * (1.0 + 1e-6)


def test_a_limited_doll_that_is_thrown_about_stays_in_its_ranges():
    figure = doll()
    figure = replace(figure, elements=elements_for(figure, "limp"))
    ends = np.radians([[-10.0, 90.0], [-20.0, 40.0], [-30.0, 30.0]])
    figure = replace(figure, limits=np.tile(ends, (20, 1, 1)))
    rng = np.random.default_rng(3)
    world = World(figure, posed(figure), WorldSettings(step=2e-3, gravity=(0.0, 0.0, -9.81)))
    worst = 0.0
    for _ in range(6):
        body = int(rng.integers(20))
        grab = world.grab(body, world.pose().positions[body], coupling=hand_for(figure))
        way = 0.5 * rng.normal(size=3)
        for _ in range(100):
            grab.pull(grab.target_position + 0.01 * way)
            world.step()
            own = multiply(figure.rest * [1.0, -1.0, -1.0, -1.0], joint_turns(world))
            angles = bends(own)[1:]
            worst = max(worst, float(np.maximum(ends[:, 0] - angles, angles - ends[:, 1]).max()))
        world.release(grab)
    # Where a joint slides along one end at tens of radians a second.
    assert np.degrees(worst) < 2.0
