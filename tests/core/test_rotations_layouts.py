# SPDX-License-Identifier: GPL-3.0-or-later
"""An operation does the same in each layout: components last, first, or one number at a time."""

import numpy as np
import pytest

from octo_motion.core import rotations
from octo_motion.core.rotations import components_first, normalized, rotate, scalars, small_batches


@pytest.mark.parametrize("many", [1, 4, 12])
def test_several_vectors_are_turned_as_each_by_itself(many: int) -> None:
    random = np.random.default_rng(many)
    turns = normalized(random.normal(size=(50, 4)))
    vectors = random.normal(size=(many, 50, 3))
    expected = rotate(turns, vectors)

    together = components_first.rotate(turns.T, np.swapaxes(vectors, 1, 2))
    alone = [components_first.rotate(turns.T, each.T) for each in vectors]

    np.testing.assert_allclose(np.swapaxes(together, 1, 2), expected, atol=1e-14)
    np.testing.assert_allclose(np.stack(alone), together, atol=1e-14)


def test_vectors_of_hardly_any_length_turn_nothing_whatever_is_beside_them() -> None:
    # Opposite, of no length, and so short that squares of it are lost; and one as it should be.
    start = np.array([[1.0, 0.0, 1e-13, 1.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    goal = np.array([[-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 1e-12, 1.0], [0.0, 0.0, 0.0, 0.0]])
    turns = components_first.shortest_arc(start, goal)
    np.testing.assert_allclose(np.linalg.norm(turns, axis=0), 1.0, atol=1e-12)
    np.testing.assert_allclose(turns[:, 1:3], [[1.0, 1.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    np.testing.assert_allclose(rotate(turns[:, 3], start[:, 3]), goal[:, 3], atol=1e-12)


def test_components_first_the_operations_are_the_same() -> None:
    random = np.random.default_rng(5)
    a, b = normalized(random.normal(size=(2, 20, 4)))
    u, v = normalized(random.normal(size=(2, 20, 3)))
    for found, expected in (
        (components_first.multiply(a.T, b.T).T, rotations.multiply(a, b)),
        (components_first.conjugate(a.T).T, rotations.conjugate(a)),
        (np.moveaxis(components_first.to_matrix(a.T), -1, 0), rotations.to_matrix(a)),
        (components_first.cross(u.T, v.T).T, rotations.cross(u, v)),
        (components_first.dot(u.T, v.T), rotations.dot(u, v)),
        (components_first.normalized(3.0 * u.T).T, u),
        (components_first.shortest_arc(u.T, v.T).T, rotations.shortest_arc(u, v)),
    ):
        np.testing.assert_allclose(found, expected, atol=1e-14)


def test_few_are_the_same_to_the_last_bit_as_among_many() -> None:
    a, b = np.random.default_rng(6).normal(size=(2, 4, 35, 20))
    u, v = np.random.default_rng(7).normal(size=(2, 5, 3, 700))
    turns, vectors = components_first.multiply(a, b), components_first.cross(u, v)
    few = components_first.multiply(a[:, :7], b[:, :7])
    np.testing.assert_array_equal(few, turns[:, :7])
    np.testing.assert_array_equal(components_first.multiply(a[:, 0], b[:, 0]), turns[:, 0])
    few = components_first.cross(u[..., :7], v[..., :7])
    np.testing.assert_array_equal(few, vectors[..., :7])


def test_scalars_do_the_same_as_arrays() -> None:
    a, b = normalized([[0.9, -0.2, 0.4, 0.1], [-0.3, 0.5, 0.2, 0.7]])
    one: scalars.Quaternion = (float(a[0]), float(a[1]), float(a[2]), float(a[3]))
    two: scalars.Quaternion = (float(b[0]), float(b[1]), float(b[2]), float(b[3]))
    u: scalars.Vector = (0.5, -1.5, 0.25)
    v: scalars.Vector = (1.0, 0.75, -0.5)
    for found, expected in (
        (scalars.multiply(one, two), rotations.multiply(a, b)),
        (scalars.conjugate(one), rotations.conjugate(a)),
        (scalars.rotate(one, u), rotations.rotate(a, u)),
        (scalars.cross(u, v), rotations.cross(np.array(u), np.array(v))),
        (scalars.dot(u, v), rotations.dot(np.array(u), np.array(v))),
        (scalars.from_rotation_vector(u), rotations.from_rotation_vector(u)),
        (scalars.to_rotation_vector(one), rotations.to_rotation_vector(a)),
    ):
        np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("older", [False, True])
def test_products_of_small_batches_are_those_of_each_pair(older: bool) -> None:  # noqa: FBT001
    """With numpy's own calls, and with those that stand for them where numpy is older."""
    names = ("vecdot", "matvec", "vecmat")
    vecdot, matvec, vecmat = (getattr(small_batches, older * "_" + each) for each in names)
    chance = np.random.default_rng(7)
    wide, three, six = (chance.normal(size=(5, *each)) for each in ((3, 6), (3,), (6,)))
    for row in range(5):
        assert matvec(wide, six)[row] == pytest.approx(wide[row] @ six[row])
        assert vecmat(three, wide)[row] == pytest.approx(three[row] @ wide[row])
        assert vecdot(wide, wide[::-1])[row] == pytest.approx(np.diag(wide[row] @ wide[4 - row].T))
        assert vecdot(six, six[::-1])[row] == pytest.approx(six[row] @ six[4 - row])
