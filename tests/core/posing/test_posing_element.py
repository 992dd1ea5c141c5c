# SPDX-License-Identifier: GPL-3.0-or-later
"""The plastic element alone: the source's experiment, its laws, materials and measuring."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.errors import SettingsError
from octo_motion.core.posing.puppet.figure import Elements, Pose
from octo_motion.core.posing.puppet.materials import MATERIALS, elements_for, joint_loads
from octo_motion.core.posing.puppet.plastic_element import ElementResponse, PlasticLaw, law_of
from octo_motion.core.posing.solver.world import World, WorldSettings
from octo_motion.core.rotations import (
    Floats,
    angle_between,
    conjugate,
    from_rotation_vector,
    multiply,
    rotate,
    to_matrix,
    to_rotation_vector,
)
from tests.core.oracles.drag_fit import measure
from tests.core.puppets import chain, doll, free, octopus, posed, puppet, soft
from tests.core.world_probes import bend_springs, joint_springs, joint_turns

# [Plastic, Fig. 5]: 0.1 kg pushed for a while, then let go. The force and how long are ours.
MASS, K_F, D_F, D_D, FORCE, LOADED = 0.1, 1.0, 10.0, 100.0, 1.0, 5.0
# Closed form of the same, worked out on its own: time, displacement, velocity, spring.
CLOSED = np.array(
    [
        [0.1, 0.009758571311316964, 0.10920995469781335, 0.00886778126602506],
        [0.5, 0.05266335299805357, 0.10532809787972827, 0.04776868109583725],
        [1.0, 0.1041542599227675, 0.10067434830781327, 0.09425493427068438],
        [2.0, 0.20043805965188427, 0.09203732178776652, 0.18053009697213268],
        [5.0, 0.4430334875687798, 0.07075647469090843, 0.3931042440403479],
        [6.0, 0.40669380908303626, -0.03570512539138958, 0.35665810395139025],
        [10.0, 0.2890031887571899, -0.023924269516576873, 0.23897926447994716],
        [15.0, 0.19489014595535084, -0.014503534116082557, 0.1448756424107179],
        [25.0, 0.1032487183526306, -0.005330207917432511, 0.05324338813147893],
        [65.0, 0.0509713829145084, -9.723561959374691e-05, 0.0009712855322784042],
    ]
)
# Displacement at 5 s and 65 s by backward steps, likewise.
DISCRETE = {
    0.02: (0.4427297300361497, 0.050976479581130406),
    0.01: (0.4428815265388413, 0.05097392965983547),
    0.002: (0.4430030821854118, 0.05097189190513915),
    0.001: (0.44301828405295457, 0.05097163732268635),
}


def flow_of(answer: ElementResponse) -> Floats:
    """(1, 3) w_d of one element."""
    return np.zeros((1, 3)) if answer.flows is None else answer.flows_with()


def scalar_law(step: float) -> PlasticLaw:
    return PlasticLaw(soft(1, K_F, D_F, D_D, 0.0), step)


def respond(law: PlasticLaw, spring: Floats, speed: Floats) -> ElementResponse:
    return law.respond(law.at_rest(spring), speed)


def played(step: float, until: float) -> Floats:
    """(steps, 4) time, displacement, velocity, spring of the experiment."""
    law = scalar_law(step)
    count = round(until / step)
    x = v = q = 0.0
    history = np.empty((count, 4))
    spring, speed = np.zeros((1, 3)), np.zeros((1, 3))
    for number in range(count):
        force = FORCE if (number + 0.5) * step < LOADED else 0.0
        # m (v' − v) = h (F + λ(v')): λ is linear as long as there is no threshold.
        spring[0, 0], speed[0, 0] = q, v
        answer = respond(law, spring, speed)
        v += step * (force + answer.load[0, 0]) / (MASS + step * answer.slope[0, 0, 0])
        speed[0, 0] = v
        answer = respond(law, spring, speed)
        x += step * v
        q += step * (v - flow_of(answer)[0, 0])
        history[number] = (number + 1) * step, x, v, q
    return history


@pytest.mark.parametrize("step", list(DISCRETE))
def test_source_experiment_has_the_known_displacements(step: float):
    # The finest steps only as long as they are loaded: a residue takes a minute.
    whole = step >= 0.01
    history = played(step, 65.0 if whole else LOADED)
    loaded, residue = DISCRETE[step]
    assert history[round(LOADED / step) - 1, 1] == pytest.approx(loaded, rel=1e-9)
    if whole:
        assert history[-1, 1] == pytest.approx(residue, rel=1e-9)


def test_source_experiment_converges_to_the_closed_form_at_first_order():
    errors: list[float] = []
    for step in (0.02, 0.01, 0.005):
        history = played(step, 10.0)
        rows = CLOSED[CLOSED[:, 0] <= 10.0]
        found = history[np.round(rows[:, 0] / step).astype(int) - 1]
        errors.append(float(np.abs(found[:, 1:2] - rows[:, 1:2]).max()))
    # Halving the step halves the error; 10 % for the terms of second order.
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.1)


def test_source_experiment_rises_springs_back_in_part_and_keeps_a_residue():
    x = played(0.05, 120.0)[:, 1]
    top = round(LOADED / 0.05) - 1
    assert np.all(np.diff(x[:top]) > 0.0)
    assert np.all(np.diff(x[top + 10 :]) <= 0.0)
    # F T / D_d, whatever K_f, D_f and m.
    assert x[-1] == pytest.approx(FORCE * LOADED / D_D, rel=1e-3)


def test_turning_joint_of_a_world_repeats_the_source_experiment():
    # A pinned root whose inertia about its joint is the source's mass; small angles, no limits.
    figure = puppet([-1], [[0.0, 0.0, 0.0]], [0.1], [0.02], soft(1, K_F, D_F, D_D, 0.0))
    centred = replace(figure, centres=np.zeros((1, 3)), inertias=MASS * np.eye(3)[None])
    world = World(centred, posed(centred), WorldSettings(step=0.02))
    world.pin(0)
    world.forces[0, 3] = FORCE
    for _ in range(250):
        world.step()
    # The discrete solution is met up to the pin's give, a ten-thousandth.
    turned = angle_between([1.0, 0.0, 0.0, 0.0], world.pose().orientations[0])
    assert turned == pytest.approx(DISCRETE[0.02][0], rel=1e-3)
    assert joint_springs(world)[0, 0] == pytest.approx(0.3931, rel=1e-3)
    world.forces[0, 3] = 0.0
    for _ in range(3000):
        world.step()
    turned = angle_between([1.0, 0.0, 0.0, 0.0], world.pose().orientations[0])
    assert turned == pytest.approx(DISCRETE[0.02][1], rel=1e-3)


numbers = st.floats(1e-3, 1e3)


@given(
    stiffness=numbers,
    damping=numbers,
    flow=numbers,
    limit=st.one_of(st.just(0.0), numbers),
    step=st.floats(1e-5, 1e2),
    mass=numbers,
    start=st.floats(-10.0, 10.0),
)
@settings(max_examples=25, deadline=None)
def test_element_is_stable_at_every_step_length(  # noqa: PLR0917
    stiffness: float,
    damping: float,
    flow: float,
    limit: float,
    step: float,
    mass: float,
    start: float,
):
    def axis(value: float) -> Floats:
        return np.array([[value, 0.0, 0.0]])

    law = PlasticLaw(soft(1, stiffness, damping, flow, limit), step)
    v, q = start, 0.0
    energy = 0.5 * mass * v * v
    for _ in range(20):
        # λ falls with v: halve the interval in which m (v' − v) = h λ(v') lies.
        low, high = -abs(v) - abs(q) / step - 1.0, abs(v) + abs(q) / step + 1.0
        new = v
        for _ in range(80):
            new = 0.5 * (low + high)
            load = respond(law, axis(q), axis(new)).load[0, 0]
            if mass * (new - v) - step * load > 0.0:
                high = new
            else:
                low = new
        answer = respond(law, axis(q), axis(new))
        q += step * (new - flow_of(answer)[0, 0])
        v = new
        now = 0.5 * mass * v * v + 0.5 * stiffness * q * q
        assert now <= energy * (1.0 + 1e-9) + 1e-12
        energy = now


vectors = st.lists(st.floats(-5.0, 5.0), min_size=3, max_size=3).map(np.array)


@given(spring=vectors, speed=vectors, limit=st.floats(0.0, 5.0))
@settings(max_examples=60, deadline=None)
def test_series_damper_only_ever_takes_energy_away(spring: Floats, speed: Floats, limit: float):
    law = PlasticLaw(soft(1, 3.0, 0.1, 0.5, limit), 0.01)
    answer = respond(law, spring[None], speed[None])
    assert np.all(answer.load * flow_of(answer) <= 1e-12)
    assert np.linalg.eigvalsh(answer.slope[0]).min() >= -1e-9


def test_slope_of_the_element_is_its_derivative():
    law = PlasticLaw(soft(1, 3.0, 0.2, 0.7, 1.0), 0.01)
    rng = np.random.default_rng(3)
    for _ in range(20):
        spring, speed = rng.normal(size=(1, 3)), 5.0 * rng.normal(size=(1, 3))
        slope = respond(law, spring, speed).slope[0]
        for axis in range(3):
            nudge = 1e-6 * np.eye(3)[axis]
            change = (
                respond(law, spring, speed + nudge).load - respond(law, spring, speed - nudge).load
            )
            np.testing.assert_allclose(-change[0] / 2e-6, slope[:, axis], atol=1e-6)


def test_nothing_flows_below_yield_and_only_beyond_it_above():
    law = PlasticLaw(soft(1, 1.0, 2.0, 10.0, 4.0), 0.01)
    still = respond(law, np.zeros((1, 3)), np.array([[1.9, 0.0, 0.0]]))
    assert still.flows is None
    flowing = respond(law, np.zeros((1, 3)), np.array([[4.0, 0.0, 0.0]]))
    assert flowing.flows is not None
    # D_d w_d = −(|λ| − τ) sign λ, whatever the spring does.
    assert 10.0 * flow_of(flowing)[0, 0] == pytest.approx(-flowing.load[0, 0] - 4.0)


@pytest.mark.parametrize("material", ["clay", "wire", "doll"])
def test_a_made_figure_bears_its_own_weight_in_any_pose(material: str):
    figure = chain(4)
    figure = replace(figure, elements=elements_for(figure, material))
    # Held level by the root's joint: the worst pose there is.
    flat = posed(figure)
    world = World(
        figure,
        flat,
        WorldSettings(step=4e-3, gravity=(0.0, 0.0, -9.81), drag=2.0),
    )
    world.pin(0)
    for _ in range(750):
        world.step()
    before = world.pose().orientations
    for _ in range(250):
        world.step()
    moved = np.degrees(angle_between(before, world.pose().orientations).max())
    # Nothing creeps; what is left is the springs' settling.
    assert moved < 0.01


def test_rubber_comes_back_and_limp_falls():
    figure = chain(3)
    start = posed(figure, np.array([[0.0, 0.0, 0.0], [0.6, 0.0, 0.0], [0.0, 0.0, 0.6]]))
    rubber = replace(figure, elements=elements_for(figure, "rubber"))
    world = World(rubber, posed(rubber), WorldSettings(drag=5.0))
    world.pin(0)
    bend_springs(world, start)
    for _ in range(3000):
        world.step()
    back = angle_between(joint_turns(world), figure.rest)
    assert np.degrees(back.max()) < 1.0
    limp = replace(figure, elements=elements_for(figure, "limp"))
    world = World(
        limp,
        posed(limp),
        WorldSettings(step=2e-3, gravity=(0.0, 0.0, -9.81)),
    )
    world.pin(0)
    for _ in range(2000):
        world.step()
    tips = rotate(world.pose().orientations, [0.0, 1.0, 0.0])
    np.testing.assert_allclose(tips, np.tile([0.0, 0.0, -1.0], (3, 1)), atol=0.1)


def test_materials_feel_alike_at_any_size_of_figure():
    small, large = doll(), doll()
    large = replace(
        large,
        anchors=10.0 * large.anchors,
        centres=10.0 * large.centres,
        masses=1000.0 * large.masses,
    )
    ratio = elements_for(large, "clay").yield_torque / elements_for(small, "clay").yield_torque
    np.testing.assert_allclose(ratio, 1e4)


def test_loads_grow_from_tip_to_root_of_an_arm():
    figure = octopus()
    loads = joint_loads(figure)
    first = figure.parents.index(0)
    assert np.all(np.diff(loads[first : first + 11]) < 0.0)
    assert loads[0] == loads.max()


def test_unknown_material_and_no_strength_are_told():
    for material, strength in (("glass", 1.0), ("clay", 0.0), ("clay", float("nan"))):
        with pytest.raises(SettingsError):
            elements_for(chain(2), material, strength)
    assert set(MATERIALS) == {"clay", "wire", "doll", "rubber", "limp"}


def drag(truth: tuple[float, float, float, float]) -> tuple[Floats, Floats, Floats]:
    """A record of a joint that is bent, held and let go, by small steps of its own."""
    stiffness, damping, flow, limit = truth
    times = np.linspace(0.0, 4.0, 401)
    torque = np.interp(times, [0.0, 1.0, 1.5, 2.0, 4.0], [0.0, 12.0, 12.0, 0.0, 0.0])
    angles = np.zeros(401)
    spring = slid = 0.0
    for index in range(1, 401):
        for part in np.linspace(0.0, 1.0, 51)[1:]:
            step = (times[index] - times[index - 1]) / 50.0
            load = torque[index - 1] + part * (torque[index] - torque[index - 1])
            spring += step * (load - stiffness * spring) / (damping + step * stiffness)
            slid += step * max(load - limit, 0.0) / flow
        angles[index] = spring + slid
    return times, torque, angles


@pytest.mark.parametrize("truth", [(50.0, 3.0, 10.0, 6.0), (200.0, 2.0, 30.0, 8.0)])
def test_one_drag_measures_the_joint(truth: tuple[float, float, float, float]):
    times, torques, angles = drag(truth)
    found = measure(times, torques, angles)
    # The record has steps of 10 ms; what happens within one is not seen.
    assert found.stiffness == pytest.approx(truth[0], rel=0.01)
    assert found.damping == pytest.approx(truth[1], rel=0.1)
    assert found.flow == pytest.approx(truth[2], rel=0.02)
    assert found.yield_torque == pytest.approx(truth[3], rel=0.02)
    rng = np.random.default_rng(1)
    noisy = measure(
        times, torques + 0.05 * rng.normal(size=401), angles + 1e-3 * rng.normal(size=401)
    )
    assert noisy.yield_torque == pytest.approx(truth[3], rel=0.05)
    assert noisy.stiffness == pytest.approx(truth[0], rel=0.05)


def test_a_drag_that_never_yields_measures_a_spring():
    times, torques, angles = drag((50.0, 3.0, 10.0, 60.0))
    rng = np.random.default_rng(1)
    found = measure(times, torques, angles + 1e-3 * rng.normal(size=401))
    assert np.isinf(found.yield_torque)
    assert np.isinf(found.flow)
    assert found.stiffness == pytest.approx(50.0, rel=0.02)


def test_a_useless_record_is_told():
    even = np.linspace(0.0, 1.0, 100)
    for record in (
        (even[:5], even[:5], even[:5]),
        (even, 0.0 * even, 0.0 * even),
        (even[::-1], even, even),
        (even, even * np.nan, even),
    ):
        with pytest.raises(ValueError, match="recorded drag"):
            measure(*record)


def test_spring_is_kept_in_the_material_however_the_figure_turns():
    figure = chain(3, elements=soft(3, 2.0, 0.05, 1.0, 0.5))
    world = World(figure, posed(figure), WorldSettings(step=2e-3))
    bent = posed(figure, np.array([[0.0, 0.0, 0.0], [0.3, 0.1, 0.0], [0.0, 0.4, 0.2]]))
    bend_springs(world, bent)
    springs = joint_springs(world)
    turned = from_rotation_vector(np.array([0.7, -1.1, 2.0]))
    pose = world.pose()
    bend_springs(
        world,
        Pose(
            rotate(turned, pose.positions),
            np.stack([multiply(turned, one) for one in pose.orientations]),
        ),
    )
    np.testing.assert_allclose(joint_springs(world)[1:], springs[1:], atol=1e-12)
    # And it goes on alike: the same figure in another direction moves the same way.
    other = World(figure, posed(figure), WorldSettings(step=2e-3))
    bend_springs(other, bent)
    for _ in range(200):
        world.step()
        other.step()
    np.testing.assert_allclose(joint_springs(world)[1:], joint_springs(other)[1:], atol=1e-9)
    np.testing.assert_allclose(
        np.abs((joint_turns(world)[1:] * joint_turns(other)[1:]).sum(-1)), 1.0, atol=1e-12
    )
    assert free(1).yield_torque[0] == np.inf


# --- Coefficients about each axis -----------------------------------------------------------------


def uneven(limit: float, count: int = 1) -> Elements:
    """Stiffest against twist, and giving way about Z the most."""
    three = ([3.0, 40.0, 8.0], [0.2, 1.0, 0.5], [0.7, 9.0, 0.2])
    stiffness, damping, flow = (np.tile(each, (count, 1)) for each in three)
    return Elements(stiffness, damping, flow, np.full(count, limit))


def turned_law(elements: Elements, seed: int) -> tuple[PlasticLaw, Floats]:
    """The law of bones that stand anyhow, and their axes (joints, 3, 3)."""
    vectors = np.random.default_rng(seed).normal(size=(len(elements.yield_torque), 3))
    frames = to_matrix(from_rotation_vector(vectors))
    return law_of(elements, 0.01).seen_in(frames), frames


@given(seed=st.integers(0, 1000), limit=st.sampled_from([0.0, 1.0, 5.0, np.inf]))
@settings(deadline=None)
def test_alike_about_all_axes_is_one_law_however_it_is_written(seed: int, limit: float):
    rng = np.random.default_rng(seed)
    one = soft(5, 3.0, 0.2, 0.7, limit)
    # One joint that is not alike: the others are worked out by the law of axes as well.
    mixed = uneven(limit, 5)
    for field in ("stiffness", "damping", "flow"):
        getattr(mixed, field)[1:] = getattr(one, field)[1:, None]
    law, _ = turned_law(mixed, seed)
    springs, speeds = rng.normal(size=(2, 5, 3))
    same, axes = respond(PlasticLaw(one, 0.01), springs, speeds), respond(law, springs, speeds)
    np.testing.assert_allclose(axes.load[1:], same.load[1:], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(axes.slope[1:], same.slope[1:], rtol=1e-7, atol=1e-9)


@given(seed=st.integers(0, 1000), limit=st.sampled_from([0.0, 0.5, 3.0]))
@settings(deadline=None)
def test_uneven_element_obeys_its_law_spends_energy_and_has_its_slope(seed: int, limit: float):
    rng = np.random.default_rng(seed)
    elements = uneven(limit)
    law, (frame,) = turned_law(elements, seed)
    spring, speed = rng.normal(size=(2, 1, 3))
    answer = respond(law, spring, speed)
    load, flow = answer.load[0] @ frame, flow_of(answer)[0] @ frame
    q, w = spring[0] @ frame, speed[0] @ frame
    k, d, over = (np.ravel(each) for each in (elements.stiffness, elements.damping, elements.flow))
    # λ = −K_f q_f[t+1] − D_f w_f and, while it flows, λ = −τ w_d/|w_d| − D_d w_d.
    np.testing.assert_allclose(load, -k * (q + 0.01 * (w - flow)) - d * (w - flow), atol=1e-9)
    size = np.linalg.norm(flow)
    if size > 0.0:
        np.testing.assert_allclose(load, -limit * flow / size - over * flow, atol=1e-7)
    else:
        assert np.linalg.norm(load) <= limit
    assert load @ flow <= 0.0
    for axis in range(3):
        nudge = np.zeros((1, 3))
        nudge[0, axis] = 1e-6
        change = respond(law, spring, speed + nudge).load - respond(law, spring, speed - nudge).load
        np.testing.assert_allclose(-change[0] / 2e-6, answer.slope[0][:, axis], atol=1e-5)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_joint_has_the_source_residue_about_each_axis_by_itself(axis: int):
    """F T/D_d, with a D_d of its own about each axis of the bone, which stands askew."""
    flow = np.array([[50.0, 200.0, 100.0]])
    elements = Elements(np.full((1, 3), 10.0), np.full((1, 3), 1.0), flow, np.zeros(1))
    figure = puppet([-1], [[0.0, 0.0, 0.0]], [0.1], [0.02], elements)
    centred = replace(figure, centres=np.zeros((1, 3)), inertias=MASS * np.eye(3)[None])
    start = posed(centred, np.array([[0.4, -0.3, 0.8]]))
    world = World(centred, start, WorldSettings(step=0.02))
    world.pin(0)
    bone = to_matrix(start.orientations[0])[:, axis]
    world.forces[0, 3:] = FORCE * bone
    for number in range(1500):
        if number == round(LOADED / 0.02):
            world.forces[:] = 0.0
        world.step()
    left = to_rotation_vector(
        multiply(world.pose().orientations[0], conjugate(start.orientations[0]))
    )
    assert left == pytest.approx(FORCE * LOADED / flow[0, axis] * bone, rel=5e-3, abs=1e-4)
