# SPDX-License-Identifier: GPL-3.0-or-later
"""Things that a puppet pushes about: boxes, balls and hulls, and another figure beside it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from octo_motion.core.posing.puppet import (
    Figure,
    Pose,
    elements_for,
    inertia_of,
    joined,
    joined_poses,
    part_of,
    resized,
    solid_moments,
    thing,
)
from octo_motion.core.posing.session import HandSample, Session
from octo_motion.core.posing.solver import Box, Hull, Obstacle, Plane, World, WorldSettings
from octo_motion.core.rotations import IDENTITY, Floats, from_rotation_vector, multiply, rotate
from octo_motion.device.messages import (
    HEADER,
    FigureMessage,
    Message,
    ObstacleMessage,
    pack,
    read_body,
)
from tests.core.puppets import chain, posed, soft
from tests.core.world_probes import energy_of

STEP = 2e-3


def crate(name: str, half: Floats, density: float = 500.0, *, heavy: bool = True) -> Figure:
    mass = density * 8.0 * float(half.prod())
    inertia = mass / 3.0 * (half @ half * np.eye(3) - np.diag(half * half))
    return thing(name, mass, inertia, np.zeros((2, 3)), float(half.min()), heavy=heavy)


def ball(name: str, radius: float, mass: float, *, heavy: bool = True) -> Figure:
    inertia = 0.4 * mass * radius**2 * np.eye(3)
    return thing(name, mass, inertia, np.zeros((2, 3)), radius, heavy=heavy)


def faces(corners: Floats) -> Floats:
    """Triangles of a box, turned outwards, of its eight corners by the signs of their axes."""
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return np.array(
        [corners[[a, b, c]] for side in sides for a, b, c in (side[:3], (side[0], *side[2:]))]
    )


def hull_of(half: Floats, body: int = -1) -> Hull:
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    return Hull(corners=faces(signs * half), body=body)


def world_of(figures: list[Figure], poses: list[Pose], solid: list[Obstacle]) -> World:
    return World(joined(figures), joined_poses(poses), WorldSettings(step=STEP), solid)


def at(place: tuple[float, float, float], turn: tuple[float, float, float] = (0, 0, 0)) -> Pose:
    return Pose(np.array([place], float), from_rotation_vector(np.array([turn], float)))


def lowest(world: World, body: int, half: Floats) -> float:
    pose = world.pose()
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    return float((pose.positions[body] + rotate(pose.orientations[body], signs * half))[:, 2].min())


HALF = np.array([0.1, 0.2, 0.15])


def test_a_box_that_falls_comes_to_lie_on_a_face_and_stays_there() -> None:
    world = world_of(
        [crate("box", HALF)], [at((0, 0, 0.4), (0.5, 0.3, 0.1))], [Plane(), Box(half=HALF, body=0)]
    )
    for _ in range(700):
        world.step()
        assert lowest(world, 0, HALF) > -5e-4
    before = world.pose()
    assert np.isclose(before.positions[0, 2], HALF, atol=1e-4).any()
    for _ in range(300):
        world.step()
    # A micrometre is what rounding may move it in 0.6 s; measured: 2e-12 m.
    assert np.abs(world.pose().positions - before.positions).max() < 1e-9


@pytest.mark.parametrize("kind", [Box, Hull])
def test_what_is_stacked_crosswise_stands(kind: type[Obstacle]) -> None:
    """Not a corner of the upper one is over a corner of the lower one, or in it."""
    half = np.array([0.3, 0.05, 0.05])
    shapes = [Box(half=half, body=n) if kind is Box else hull_of(half, n) for n in range(2)]
    world = world_of(
        [crate("low", half), crate("high", half)],
        [at((0, 0, 0.051)), at((0, 0, 0.1525), (0, 0, np.pi / 2))],
        [Plane(), *shapes],
    )
    for _ in range(300):
        world.step()
    heights = world.pose().positions[:, 2]
    assert heights == pytest.approx([0.05, 0.15], abs=1e-4)
    assert np.abs(world.velocities()).max() < 1e-6


def test_edges_that_cross_do_not_pass_through_each_other() -> None:
    """A beam falls with its edge across the upright edge of another one that stands."""
    half = np.array([0.3, 0.05, 0.05])
    tilt = from_rotation_vector(np.array([np.pi / 4, 0.0, 0.0]))
    lying = Box(position=np.array([0.0, 0.0, 0.1]), orientation=tilt, half=half)
    crossed = from_rotation_vector(np.array([0.0, 0.0, np.pi / 2]))
    pose = Pose(np.array([[0.0, 0.0, 0.3]]), multiply(crossed, tilt)[None])
    world = world_of([crate("beam", half)], [pose], [lying, Box(half=half, body=0)])
    deepest = np.inf
    for _ in range(250):
        world.step()
        deepest = min(deepest, float(world.pose().positions[0, 2]))
        if np.abs(world.pose().positions[0, :2]).max() > 0.02:
            break
    # Edge on edge the middles are two half diagonals apart.
    assert deepest > 0.1 + 2.0 * 0.05 * np.sqrt(2.0) - 5e-4


def test_things_that_meet_keep_their_momentum_and_make_no_energy() -> None:
    boxes = [crate("a", HALF, heavy=False), crate("b", HALF, 2000.0, heavy=False)]
    figures = [*boxes, ball("c", 0.1, 2.0, heavy=False)]
    poses = [at((0, 0, 0)), at((0.35, 0.05, 0.02), (0.4, 0.2, 0)), at((-0.3, 0.02, 0.0))]
    world = world_of(figures, poses, [Box(half=HALF, body=0), Box(half=HALF, body=1)])
    world.forces[2] = [400.0, 0, 0, 0, 0, 0]
    for _ in range(30):
        world.step()
    world.forces[:] = 0.0
    masses = world.figure.masses[:, None]
    energies, momenta = [], []
    for _ in range(300):
        world.step()
        energies.append(energy_of(world).total)
        momenta.append((masses * world.velocities()[:, :3]).sum(axis=0))
    assert np.abs(world.velocities()[1]).max() > 0.05, "nothing met"
    assert np.abs(np.array(momenta) - momenta[0]).max() < 1e-9 * np.abs(momenta).max()
    # What has sunk in by a micrometre in a blow is led out again; measured: 4e-5 in a step.
    assert all(after <= before * (1.0 + 1e-4) for before, after in pairwise(energies))
    assert energies[-1] < energies[0]


def _arm_and_box() -> tuple[Session, int]:
    """A firm arm along Y, its hand level with a box that stands on the floor before it."""
    arm = chain(3, elements=soft(3, 200.0, 5.0, 5.0, 40.0))
    figures = [arm, crate("box", HALF, 50.0)]
    pose = joined_poses([posed(arm, at=(0.0, 0.0, 0.15)), at((0.0, 0.9, 0.15))])
    solid = [Plane(), Box(half=HALF, body=3)]
    session = Session(joined(figures), pose, WorldSettings(step=STEP), solid, clock=None)
    session.pin(0, state=True, firm=False)
    return session, 3


def _push_on(world: World, box: int) -> float:
    """N along Y that others push a body with."""
    contacts = world.contacts
    assert contacts is not None
    assert world.last is not None
    others = (contacts.others == box) & (contacts.bodies != box)
    return -float(world.last.impulses[: len(contacts)][others, 1].sum()) / STEP


def test_a_hand_shoves_a_box_and_feels_its_weight_and_its_friction() -> None:
    session, box = _arm_and_box()
    session.world.unpin(0)
    tip = session.pose.positions[2] + np.array([0.0, 0.2, 0.0])
    spring = session.grab(2, tip, np.array(IDENTITY))
    forces, felt = [], []
    for number in range(90):
        target = tip + np.array([0.0, 0.004 * number, 0.0])
        session.tick(1.0 / 60.0, {spring: HandSample(target, np.array(IDENTITY))})
        felt.append(float(spring.wrench[1]))
        forces.append(_push_on(session.world, box))
    moved = session.pose.positions[box]
    assert moved[1] > 1.05, "it was not pushed"
    assert moved[2] == pytest.approx(0.15, abs=1e-3), "it slides, and neither sinks in nor flies"
    assert box in session.touched()
    mass = float(session.figure.masses[box])
    # Coulomb: 0.6 of its weight; measured: within 1 %.
    assert np.mean(forces[-30:]) == pytest.approx(0.6 * 9.81 * mass, rel=0.02)
    # All that is left of the hand's pull bends nothing and speeds nothing up: it is felt.
    assert np.mean(felt[-30:]) == pytest.approx(0.6 * 9.81 * mass, rel=0.02)


def test_a_box_in_the_hand_is_lifted_and_falls_when_it_is_let_go() -> None:
    session, box = _arm_and_box()
    start = session.pose.positions[box].copy()
    spring = session.grab(box, start)
    for number in range(60):
        target = start + np.array([0.0, 0.0, 0.005 * number])
        session.tick(1.0 / 60.0, {spring: HandSample(target, np.array(IDENTITY))})
    assert session.pose.positions[box, 2] > 0.3
    session.release()
    for _ in range(90):
        session.tick(1.0 / 60.0)
    assert lowest(session.world, box, HALF) == pytest.approx(0.0, abs=1e-3)
    assert session.step_back()
    assert np.array_equal(session.pose.positions[box], start)


def test_two_figures_touch_each_other_and_their_own_limbs_do_not() -> None:
    first, second = chain(3, elements=soft(3, 20.0, 1.0, 1.0, 5.0)), chain(2)
    pose = joined_poses([posed(first), posed(second, at=(0.3, 0.2, 0.0))])
    session = Session(joined([first, second]), pose, WorldSettings(step=STEP), clock=None)
    session.pin(0, state=True)
    spring = session.grab(2, session.pose.positions[2])
    for number in range(60):
        target = pose.positions[2] + np.array([0.008 * number, 0.0, 0.0])
        session.tick(1.0 / 60.0, {spring: HandSample(target, np.array(IDENTITY))})
    gone = np.linalg.norm(session.pose.positions - pose.positions, axis=1)
    assert gone[3:].max() > 0.05, "the other one was not pushed"
    assert session.world.contacts is not None
    owners = np.array(session.figure.owners)
    touching = session.world.contacts
    assert (owners[touching.bodies] != owners[touching.others]).all()


def test_figures_that_begin_within_each_other_are_not_thrown_apart() -> None:
    pair = [chain(2), chain(2)]
    pose = joined_poses([posed(pair[0]), posed(pair[1], at=(0.03, 0.0, 0.0))])
    world = World(joined(pair), pose, WorldSettings(step=STEP))
    for _ in range(20):
        world.step()
    assert np.abs(world.pose().positions - pose.positions).max() < 1e-9


def test_a_figure_is_itself_among_others() -> None:
    arm = chain(4, elements=soft(4, 1.0, 2.0, 3.0, 4.0))
    both = joined([crate("box", HALF), arm, ball("ball", 0.1, 1.0)])
    again = part_of(both, 2)
    for name in ("anchors", "masses", "inertias", "capsules", "limits"):
        assert np.array_equal(getattr(again, name), getattr(arm, name))
    assert again.parents == arm.parents
    assert joined([arm]) is arm
    # As dense, of the same proportions: what a material makes of it grows with the fourth power.
    twice = (
        elements_for(resized(arm, 2.0), "clay").yield_torque
        / elements_for(arm, "clay").yield_torque
    )
    assert twice == pytest.approx(16.0)


def test_moments_of_a_hull_are_those_of_the_box_that_it_is() -> None:
    middle = np.array([0.3, -0.2, 0.5])
    volume, centre, second = solid_moments(hull_of(HALF).corners + middle)
    assert volume == pytest.approx(8.0 * HALF.prod())
    assert centre == pytest.approx(middle)
    assert inertia_of(500.0 * second) == pytest.approx(crate("box", HALF).inertias[0])


def _through_the_wire(message: Message) -> Message:
    data = pack(message)
    return read_body(message.KIND, data[HEADER.size :])


def test_the_process_at_the_devices_hears_of_things() -> None:
    both = joined([chain(2), crate("box", HALF)])
    heard = _through_the_wire(FigureMessage.of(both))
    assert isinstance(heard, FigureMessage)
    again = heard.figure()
    assert (again.owners, again.heavy) == (both.owners, both.heavy)
    shape = _through_the_wire(ObstacleMessage.of(0, Box(half=HALF, body=2)))
    assert isinstance(shape, ObstacleMessage)
    box = shape.obstacle()
    assert box is not None
    assert box.body == 2
