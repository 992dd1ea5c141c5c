# SPDX-License-Identifier: GPL-3.0-or-later
"""The fast solver against the source's Gauss–Seidel, and the parts that it is made of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.posing.puppet.figure import Elements
from octo_motion.core.posing.solver.constraint_rows import Holds, RowImpulses, Rows
from octo_motion.core.posing.solver.contact_detection import Contacts
from octo_motion.core.posing.solver.newton import InitialGuess
from octo_motion.core.posing.solver.obstacle_shapes import Box, Plane
from octo_motion.core.posing.solver.tree import Layout, Tree, plan
from octo_motion.core.posing.solver.world import World, WorldSettings
from octo_motion.core.rotations import (
    Floats,
    conjugate,
    from_rotation_vector,
    multiply,
    small_batches,
    to_matrix,
    to_rotation_vector,
)
from tests.core.oracles import gauss_seidel
from tests.core.puppets import chain, doll, octopus, posed, soft, tree

seeds = st.integers(0, 2**31)


def busy_world(seed: int) -> World:
    """A small figure of which everything is asked at once."""
    rng = np.random.default_rng(seed)
    count = 4
    even = soft(count, 3.0, 0.1, 0.3, 0.5)
    elements = Elements(
        even.stiffness * rng.uniform(0.5, 2.0, (count, 3))[:, 0] if seed % 2 else even.stiffness,
        even.damping,
        even.flow,
        np.zeros(count) if seed % 3 == 0 else even.yield_torque,
    )
    figure = tree(rng, count, elements)
    if seed % 2 == 0:
        ends = np.array([[-0.4, 0.2], [-0.3, 0.3], [-0.1, 0.4]])
        figure = replace(figure, limits=np.tile(ends, (count, 1, 1)))
    return World(
        figure,
        posed(figure, 0.5 * rng.normal(size=(count, 3)), (0.0, 0.0, 0.12)),
        WorldSettings(
            step=5e-3,
            gravity=(0.0, 0.0, -9.81),
            tolerance=1e-10,
            iterations=100,
            self_collision=True,
        ),
        [
            Plane(),
            Box(position=np.array([0.3, 0.0, 0.1]), half=np.array([0.1, 0.5, 0.1])),
        ],
    )


# Figures on which Gauss–Seidel arrives within some hundred sweeps; on others it takes thousands,
# and comes as near to the fast solver as its own changes still are from nothing.
@pytest.mark.one_blender
@pytest.mark.parametrize("seed", [0, 1, 5, 12, 13, 21, 30, 32])
def test_fast_solver_gives_the_answer_of_gauss_seidel(seed: int):
    world = busy_world(seed)
    rng = np.random.default_rng(seed)
    compared = touched = 0
    for number in range(61):
        if number == 15:
            body = len(world.figure) - 1
            at = world.pose().positions[body]
            hand = None if seed % 2 else np.array([1.0, 0.0, 0.0, 0.0])
            grab = world.grab(body, at, hand)
            grab.pull(at + 0.1 * rng.normal(size=3), hand)
        if number == 40:
            world.pin(0)
        if number % 20 == 0:
            problem, start = world.problem()
            fast = world._newton.solve(problem, start)
            slow = gauss_seidel.solve(problem, world.figure.parents, sweeps=600, tolerance=1e-11)
            assert fast.miss < 1e-9
            if slow.change <= 1e-11:
                compared += 1
                touched += len(problem.rows.contacts)
                # Both solve the same laws; what is left is Gauss–Seidel's last change, times the
                # sweeps that its slowest error would still take.
                scale = np.abs(slow.velocities).max()
                np.testing.assert_allclose(fast.velocities, slow.velocities, atol=1e-8 * scale)
        world.step()
    assert compared >= 1
    assert touched > 0


def test_answer_does_not_hang_on_where_the_solver_begins():
    world = busy_world(1)
    for _ in range(60):
        world.step()
    problem, start = world.problem()
    solver = world._newton
    warm = solver.solve(problem, start)
    problem, _ = world.problem()
    cold = solver.solve(problem, InitialGuess(np.zeros_like(start.speeds)))
    np.testing.assert_allclose(warm.velocities, cold.velocities, atol=1e-7)


@given(seed=seeds, count=st.integers(1, 12))
@settings(max_examples=25, deadline=None)
def test_trunk_and_branches_solve_what_the_whole_matrix_does(seed: int, count: int):
    rng = np.random.default_rng(seed)
    figure = tree(rng, count)
    whole, parted = Tree(figure), Tree(figure)
    # The plan for so few bodies is one matrix; cut it at every subtree of up to three.
    sizes = parted.above.sum(axis=0)
    limit = min(3, count - 1)
    groups = [
        np.flatnonzero(parted.above[:, top]).tolist()
        for top in range(count)
        if sizes[top] <= limit and (figure.parents[top] < 0 or sizes[figure.parents[top]] > limit)
    ]
    parted.use(_layout(count, groups))
    points = rng.normal(size=(count, 3))
    inertias = rng.normal(size=(count, 6, 6))
    inertias = inertias @ inertias.transpose(0, 2, 1) + np.eye(6)
    momenta = rng.normal(size=(count, 6, 2))
    answers: list[np.ndarray] = []
    for one in (whole, parted):
        one.place(points)
        slots = len(one.layout.bodies)
        blocks = np.zeros((slots, 3, 3))
        blocks[one.joint_slot] = 0.5 * np.eye(3)
        composite = (one.beyond @ inertias.reshape(-1, 36)).reshape(slots, 6, 6)
        one.assemble(one.motion @ composite, blocks)
        summed = (one.beyond @ momenta.reshape(count, -1)).reshape(slots, 6, 2)
        speeds = one.solve(one.motion @ summed)
        answers.append(
            np.stack([one.velocities(speeds[..., column].copy()) for column in range(2)])
        )
    np.testing.assert_allclose(answers[0], answers[1], atol=1e-8)


def _layout(count: int, groups: list[list[int]]) -> Layout:
    gone = {body for group in groups for body in group}
    bodies = [0, *(body for body in range(count) if body not in gone)]
    shifts = [True] + [False] * (len(bodies) - 1)
    trunk = len(bodies)
    width = max((len(group) for group in groups), default=0)
    for group in groups:
        bodies += group + [-1] * (width - len(group))
        shifts += [False] * width
    return Layout(trunk, len(groups), width, np.array(bodies), np.array(shifts))


def test_arms_of_the_octopus_are_branches_and_a_doll_is_one_matrix():
    octo = octopus()
    layout = plan(np.array(octo.parents), Tree(octo).above)
    assert (layout.trunk, layout.branches, layout.width) == (2, 8, 12)
    small = chain(5)
    assert plan(np.array(small.parents), Tree(small).above).branches == 0
    assert len(Tree(doll()).layout.bodies) >= 21


def test_velocities_that_the_tree_allows_keep_joints_closed():
    rng = np.random.default_rng(4)
    figure = tree(rng, 9)
    one = Tree(figure)
    pose = posed(figure, rng.normal(size=(9, 3)))
    one.place(pose.positions)
    velocities = one.velocities(rng.normal(size=(len(one.layout.bodies), 3)))
    for body, parent in enumerate(figure.parents):
        if parent >= 0:
            at = pose.positions[body]
            own = velocities[body, 3:] + np.cross(velocities[body, :3], at)
            its = velocities[parent, 3:] + np.cross(velocities[parent, :3], at)
            np.testing.assert_allclose(own, its, atol=1e-9)


@given(seed=seeds)
@settings(max_examples=40, deadline=None)
def test_slopes_of_contacts_and_holds_are_derivatives_of_convex_functions(seed: int):
    rng = np.random.default_rng(seed)
    count = 6
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    contacts = Contacts(
        np.zeros(count, np.int64),
        np.full(count, -1),
        rng.normal(size=(count, 3)),
        normals,
        1e-3 * rng.normal(size=count),
        np.arange(count),
    )
    holds = Holds(
        np.zeros(2, np.int64),
        np.zeros((2, 3)),
        np.array([False, True]),
        np.array([3.0, 5.0]),
        rng.normal(size=(2, 3)),
        np.array([0.5, np.inf]),
        np.zeros((2, 3)),
    )
    friction = float(rng.uniform(0.0, 1.5))
    grips = 20.0 * rng.normal(size=(count, 3))
    rows = Rows(contacts, holds, np.zeros(3), np.ones(1), 1e-2, friction, grips)
    speeds = rng.normal(size=(count + 2, 3))

    def impulses(speeds: Floats) -> RowImpulses:
        return rows.respond(rows.asked - rows.pattern.column * speeds)

    answer = impulses(speeds)
    slopes = rows.pattern.gains[:, None, None] * rows.tangent(answer).blocks()
    np.testing.assert_allclose(slopes, slopes.transpose(0, 2, 1), atol=1e-9)
    assert np.linalg.eigvalsh(slopes).min() > -1e-9
    for axis in range(3):
        nudge = 1e-7 * np.eye(3)[axis]
        change = impulses(speeds + nudge).impulses - impulses(speeds - nudge).impulses
        np.testing.assert_allclose(-change / 2e-7, slopes[..., axis], atol=1e-3)
    # Within Coulomb's cone, and never a pull.
    push = (answer.impulses[:count] * normals).sum(axis=1)
    across = np.linalg.norm(answer.impulses[:count] - push[:, None] * normals, axis=1)
    assert np.all(push >= -1e-12)
    assert np.all(across <= friction * push + 1e-9)


def test_small_products_agree_with_the_rotations_of_the_project():
    rng = np.random.default_rng(2)
    a, b = from_rotation_vector(rng.normal(size=(2, 7, 3)))
    np.testing.assert_allclose(small_batches.multiply(a, b), multiply(a, b), atol=1e-14)
    np.testing.assert_allclose(
        small_batches.multiply_conjugate(a, b), multiply(a, conjugate(b)), atol=1e-14
    )
    np.testing.assert_allclose(
        small_batches.conjugate_multiply(a, b), multiply(conjugate(a), b), atol=1e-14
    )
    np.testing.assert_allclose(small_batches.to_matrix(a), to_matrix(a), atol=1e-14)
    left, right = small_batches.left_factor(a), small_batches.right_factor(b)
    np.testing.assert_allclose(small_batches.product(left, right), multiply(a, b), atol=1e-14)
    np.testing.assert_allclose(
        small_batches.inverse_product(left, right), multiply(conjugate(a), b), atol=1e-14
    )
    there, back = small_batches.to_transforms(left, small_batches.right_factor(a))
    np.testing.assert_allclose(there[:, :3, :3], to_matrix(a), atol=1e-14)
    np.testing.assert_allclose(there[:, 3], np.tile([0.0, 0.0, 0.0, 1.0], (7, 1)), atol=1e-14)
    np.testing.assert_allclose(back, there.transpose(0, 2, 1), atol=1e-14)
    vectors = np.concatenate([rng.normal(size=(7, 3)), np.zeros((1, 3)), [[1e-9, 0.0, 0.0]]])
    turns = small_batches.from_rotation_vector(vectors)
    np.testing.assert_allclose(turns, from_rotation_vector(vectors), atol=1e-14)
    np.testing.assert_allclose(
        small_batches.to_rotation_vector(turns), to_rotation_vector(turns), atol=1e-14
    )
    np.testing.assert_allclose(
        small_batches.skew(vectors) @ [1.0, 2.0, 3.0], np.cross(vectors, [1.0, 2.0, 3.0])
    )
