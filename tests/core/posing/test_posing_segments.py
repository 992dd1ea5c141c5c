# SPDX-License-Identifier: GPL-3.0-or-later
"""Long chains, solved in segments: the same answers as of one system, in time that grows evenly."""

from __future__ import annotations

import numpy as np
import pytest

from octo_motion.core.posing.puppet import Figure, elements_for, joined
from octo_motion.core.posing.solver import Plane, World, WorldSettings
from octo_motion.core.posing.solver.cuts import Cuts
from octo_motion.core.posing.solver.segments import SegmentedTree, cut_at, tree_of
from octo_motion.core.posing.solver.tree import Tree
from octo_motion.core.rotations import Floats
from tests.core.puppets import chain, doll, octopus, posed, puppet


def comb(teeth: int = 12, length: int = 4) -> Figure:
    """A chain from each second link of which another one hangs."""
    parents = list(range(-1, 2 * teeth - 1))
    anchors = [[0.0, 0.0, 0.0]] + [[0.0, 0.1, 0.0]] * (2 * teeth - 1)
    for tooth in range(teeth):
        at = 2 * tooth
        for number in range(length):
            parents.append(at if number == 0 else len(parents) - 1)
            anchors.append([0.05, 0.0, 0.02] if number == 0 else [0.0, 0.1, 0.0])
    count = len(parents)
    order = np.random.default_rng(3).uniform(0.06, 0.12, count)
    return puppet(parents, anchors, order.tolist(), [0.03] * count)


def two_chains() -> Figure:
    """Of two roots: what is in no tree with the other is in no segment with it."""
    parents = [*range(-1, 29), -1, *range(30, 59)]
    anchors = [[0.0, 0.0, 0.0] if parent < 0 else [0.0, 0.1, 0.0] for parent in parents]
    return puppet(parents, anchors, [0.1] * 60, [0.02] * 60)


def hair(strands: int = 12, length: int = 10) -> Figure:
    """Strands with a root each, so that no cut of one sees a cut of another."""
    return joined([chain(length, 0.1, 0.02)] * strands)


FIGURES = {
    "chain": chain(100),
    "comb": comb(),
    "two chains": two_chains(),
    "doll": doll(),
    "hair": hair(),
}


@pytest.mark.parametrize("name", FIGURES)
@pytest.mark.parametrize("size", [3, 7])
def test_segments_have_the_solution_of_one_system(name: str, size: int) -> None:
    figure, chance = FIGURES[name], np.random.default_rng(5)
    count = len(figure)
    whole, cut = Tree(figure), SegmentedTree(figure, cut_at(figure.parents, size))
    onto = np.zeros((count, 4))
    onto[chance.integers(0, count, 4), np.arange(4)] = 1.0
    onto[2, 3] -= 1.0
    inertias = chance.normal(size=(count + 4, 6, 6))
    inertias = inertias @ inertias.transpose(0, 2, 1) + 0.1 * np.eye(6)
    inertias[-4:] *= 0.01
    stack = np.concatenate([inertias, chance.normal(size=(count + 4, 6, 2))], axis=2)
    blocks = chance.normal(size=(count, 3, 3))
    blocks = blocks @ blocks.transpose(0, 2, 1)
    # Joints without any resistance, in a row, are the hardest.
    blocks[count // 2 :] = 0.0
    points = chance.normal(size=(count, 3))
    answers: list[Floats] = []
    for tree in (whole, cut):
        tree.place(points)
        tree.use_rows(onto)
        joints = np.zeros((len(tree.layout.bodies), 3, 3))
        joints[tree.joint_slot] = blocks
        right = tree.fill(tree.summed(stack[:-4]), stack[-4:], joints)
        solved = tree.solve_all(right)
        slots = len(tree.layout.bodies)
        speeds = solved[: 3 * slots, 0].reshape(slots, 3)
        pulled = tree.spread(np.eye(6)[:, :2], np.repeat(tree.moved[:, [1, 3]], [1, 1], axis=1))
        both = tree.solve_all(pulled)
        sums = tree.from_roots(points)
        found = (tree.velocities(speeds), sums, pulled.T @ both)
        answers.append(np.concatenate([each.ravel() for each in found]))
    most = np.abs(answers[0]).max()
    # Measured: 4e-12.
    assert np.abs(answers[1] - answers[0]).max() < 1e-9 * most


def test_a_long_chain_moves_as_one_system_has_it() -> None:
    """Pinned at one end, pulled at the other over a floor, with joints that give way."""
    figure = chain(60, 0.05, 0.02)
    figure = chain(60, 0.05, 0.02, elements=elements_for(figure, "clay"))
    ends: list[Floats] = []
    for segmented in (False, True):
        settings = WorldSettings(step=2e-3, gravity=(0.0, 0.0, -9.81))
        world = World(figure, posed(figure, at=(0.0, 0.0, 0.03)), settings, [Plane()])
        if segmented:
            world._tree = SegmentedTree(figure, cut_at(figure.parents, 9))
            world._bodies._tree = world._warm._tree = world._tree
            world._warm.forget()
            world.change(WorldSettings(step=2e-3, gravity=(0.0, 0.0, -9.8100001)))
            world.change(settings)
        else:
            world._tree = Tree(figure)
            world._bodies._tree = world._warm._tree = world._tree
            world._warm.forget()
            world._use(settings)
        world.pin(0)
        at = world.pose().positions[-1]
        spring = world.grab(59, at)
        for number in range(60):
            spring.pull(at + np.array([0.004 * number, -0.001 * number, 0.002 * number]))
            world.step()
        ends.append(np.concatenate([world.pose().positions, world.velocities()[:, :3]], axis=1))
    assert np.abs(ends[0][:, :3] - ends[0][0, :3]).max() > 0.1
    # Rounding, and what a pose makes of it in 60 steps.
    assert np.abs(ends[1] - ends[0]).max() < 1e-9


@pytest.mark.parametrize("length", [6, 7, 10, 16, 30])
def test_a_head_full_of_strands_is_solved(length: int) -> None:
    """Each cut once, or not at all: all cuts go in one round, and none is left."""
    figure = hair(30, length)
    tree = tree_of(figure)
    assert tree.cost > 0.0
    ends: list[Floats] = []
    for each in (tree, Tree(figure)):
        world = World(figure, posed(figure), WorldSettings(gravity=(0.0, 0.0, -9.81)))
        world._tree = world._bodies._tree = world._warm._tree = each
        world._warm.forget()
        world._use(world.settings)
        for body in range(0, len(figure), length):
            world.pin(body)
        start = world.pose().positions
        for _ in range(20):
            world.step()
        ends.append(world.pose().positions)
        assert np.abs(ends[-1] - start).max() > 1e-4
    assert np.abs(ends[1] - ends[0]).max() < 1e-9


@pytest.mark.parametrize("count", [2, 9, 10, 25, 61])
def test_cuts_that_go_in_rounds_have_the_solution_of_one_system(count: int) -> None:
    """In a row, and with three that see each other at its end."""
    chance = np.random.default_rng(count)
    beside = [(n, n + 1) for n in range(count - 1)] + (
        [(count - 3, count - 1)] if count > 2 else []
    )
    pairs = [(n, n) for n in range(count)] + beside + [(b, a) for a, b in beside]
    whole = np.zeros((count, 12, count, 12))
    blocks = np.zeros((len(pairs) + 1, 12, 12))
    for a, b in pairs:
        if a <= b:
            whole[a, :, b] += chance.normal(size=(12, 12)) + 20.0 * (a == b) * np.eye(12)
            whole[b, :, a] = whole[a, :, b].T
        if a == b:
            whole[a, :, a] += whole[a, :, a].T.copy()
    for number, (a, b) in enumerate(pairs):
        blocks[number] = whole[a, :, b]
    right = chance.normal(size=(count, 12, 2))
    cuts = Cuts(count, pairs)
    found = cuts.solve(blocks, right)
    size = 12 * count
    expected = np.linalg.solve(whole.reshape(size, size), right.reshape(size, 2))
    np.testing.assert_allclose(found[:-1].reshape(size, 2), expected, atol=1e-12)
    assert not found[-1].any()
    # Few at once, however many there are.
    assert cuts.at_once <= 9


def test_segments_are_taken_where_they_are_quicker() -> None:
    for short in (doll(), octopus(), chain(20)):
        assert not isinstance(tree_of(short), SegmentedTree)
    for count in (100, 200):
        found = tree_of(chain(count))
        assert isinstance(found, SegmentedTree)
        # As much again for twice the length, not eight times.
        assert found.segments.width <= 16
    assert tree_of(chain(200)).cost < 2.0 * tree_of(chain(100)).cost
    assert tree_of(chain(800)).cost < 2.2 * tree_of(chain(400)).cost


def test_every_body_is_in_one_segment_that_hangs_together() -> None:
    for figure in FIGURES.values():
        cut = cut_at(figure.parents, 6)
        assert sorted(body for each in cut.bodies for body in each) == list(range(len(figure)))
        for bodies in cut.bodies:
            assert all(figure.parents[body] in bodies for body in bodies[1:])
