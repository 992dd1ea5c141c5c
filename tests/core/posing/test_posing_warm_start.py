# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the solver begins: what goes on as before takes one linear system, and nothing is lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from octo_motion.core.posing.puppet.figure import Figure
from octo_motion.core.posing.puppet.materials import elements_for
from octo_motion.core.posing.solver.holds import Coupling, HandSpring
from octo_motion.core.posing.solver.newton import InitialGuess
from octo_motion.core.posing.solver.obstacle_shapes import Plane
from octo_motion.core.posing.solver.world import World, WorldSettings
from octo_motion.core.rotations import Floats, from_axis_angle
from tests.core.puppets import chain, doll, octopus, posed, soft
from tests.core.world_probes import energy_of

WEIGHT = (0.0, 0.0, -9.81)


def lying(figure: Figure, floor: Plane, tolerance: float = 1e-3) -> World:
    settings = WorldSettings(gravity=WEIGHT, tolerance=tolerance)
    world = World(figure, posed(figure, at=(0.0, 0.0, 0.12)), settings, [floor])
    for _ in range(400):
        world.step()
    return world


def dragged(world: World, grab: HandSpring, start: Floats, first: int, steps: int) -> list[int]:
    """Pull along an arc of a circle; how many systems each step took."""
    counts: list[int] = []
    for number in range(first, first + steps):
        angle = np.pi * number / 1000.0
        way = np.array([0.3 * np.sin(angle), 0.3 - 0.3 * np.cos(angle), 0.1])
        grab.pull(start + way)
        world.step()
        assert world.last is not None
        counts.append(world.last.iterations)
    return counts


def limited(figure: Figure) -> Figure:
    ends = np.radians([[-10.0, 130.0], [-30.0, 60.0], [-40.0, 40.0]])
    return replace(figure, limits=np.tile(ends, (len(figure), 1, 1)))


@pytest.mark.parametrize("kind", ["doll", "octopus", "doll with limits"])
def test_what_slides_and_bends_on_takes_one_linear_system(kind: str):
    if kind == "octopus":
        figure = octopus(soft(97, 0.5, 0.02, 0.05, 0.1))
    else:
        figure = doll(soft(20, 40.0, 2.0, 5.0, 10.0))
    world = lying(limited(figure) if "limits" in kind else figure, Plane())
    body = len(figure) - 1
    start = world.pose().positions[body]
    counts = dragged(world, world.grab(body, start), start, 0, 300)
    assert world.last is not None
    assert world.last.rows is not None
    assert world.last.rows.slips is not None
    # Two where something starts or ceases to slip; begun at the velocities alone it were four for
    # the octopus, and three at the ends of ranges.
    assert np.mean(np.array(counts) == 1) > 0.6
    assert np.mean(counts) < 1.7


def test_what_lies_still_takes_one_linear_system():
    world = lying(doll(soft(20, 40.0, 2.0, 5.0, 10.0)), Plane())
    for _ in range(1100):
        world.step()
    for _ in range(100):
        world.step()
        assert world.last is not None
        assert world.last.iterations == 1
        # Exact, whatever the tolerance is: all laws are linear where nothing slips or flows.
        assert world.last.miss < 1e-9


def test_a_snapshot_in_the_midst_of_a_drag_brings_back_the_same_future():
    # Slipping, flowing, at the ends of ranges, held and pinned, on a plane askew.
    figure = limited(replace(doll(), elements=elements_for(doll(), "clay")))
    askew = Plane(orientation=from_axis_angle([1.0, 0.0, 0.0], 0.1))
    world = lying(figure, askew)
    world.pin(4)
    start = world.pose().positions[19]
    grab = world.grab(19, start)
    dragged(world, grab, start, 0, 150)
    state = world.state()
    assert len(state.start.contacts.slips)
    assert state.start._response is not None
    dragged(world, grab, start, 150, 60)
    first = world.pose()
    world.restore(state)
    dragged(world, grab, start, 150, 60)
    np.testing.assert_array_equal(world.pose().orientations, first.orientations)
    np.testing.assert_array_equal(world.pose().positions, first.positions)


def test_a_warm_start_does_not_change_the_answer():
    figure = limited(doll(soft(20, 40.0, 2.0, 5.0, 10.0)))
    world = lying(figure, Plane(), tolerance=1e-10)
    start = world.pose().positions[19]
    grab = world.grab(19, start)
    for number in range(0, 200, 20):
        dragged(world, grab, start, number, 20)
        problem, begin = world.problem()
        assert begin.rows is not None
        warm = world._newton.solve(problem, begin)
        cold = world._newton.solve(problem, InitialGuess(begin.speeds))
        if max(warm.miss, cold.miss) < 1e-9:
            scale = np.abs(warm.velocities).max()
            np.testing.assert_allclose(warm.velocities, cold.velocities, atol=1e-7 * scale)


def test_few_systems_a_step_are_enough_to_stay_sane():
    # Stopped early, a step is the best so far: not exact, and yet no source of energy.
    figure = replace(chain(6), elements=elements_for(chain(6), "limp"))
    world = World(
        figure,
        posed(figure, np.tile([0.3, 0.2, 0.4], (6, 1)), (0.0, 0.0, 0.8)),
        WorldSettings(gravity=WEIGHT, iterations=1),
        [Plane()],
    )
    start = energy_of(world).total
    for _ in range(600):
        world.step()
        assert energy_of(world).total <= start * 1.01
    low = world.pose().positions[:, 2].min()
    assert low > 0.0


def test_a_hand_that_suddenly_weakens_is_no_source_of_motion():
    figure = replace(chain(3), elements=elements_for(chain(3), "doll"))
    world = World(figure, posed(figure), WorldSettings(drag=2.0))
    world.pin(0)
    start = world.pose().positions[2]
    strong = Coupling(1e4, 1e2, 10.0, 1.0, force_limit=50.0, torque_limit=1.0)
    grab = world.grab(2, start, coupling=strong)
    for _ in range(50):
        grab.pull(start + np.array([0.0, 0.0, 1.0]))
        world.step()
    assert np.linalg.norm(grab.wrench[:3]) == pytest.approx(50.0, rel=1e-6)
    grab.coupling = replace(strong, force_limit=0.5)
    energy = energy_of(world).total
    for _ in range(20):
        world.step()
        # Held at its new bound at once, whatever the solver began with.
        assert np.linalg.norm(grab.wrench[:3]) <= 0.5 * (1.0 + 1e-6)
        # No more than its force can do on the way: a tenth of a metre.
        assert energy_of(world).total <= energy + 0.5 * 0.1
