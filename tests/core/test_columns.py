# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns turn vectors as rotations do, one or several by each quaternion."""

import numpy as np
import pytest

from octo_motion.core import batched as columns
from octo_motion.core.rotations import normalized, rotate


@pytest.mark.parametrize("many", [1, 4, 12])
def test_several_vectors_are_turned_as_each_by_itself(many: int) -> None:
    random = np.random.default_rng(many)
    turns = normalized(random.normal(size=(50, 4)))
    vectors = random.normal(size=(many, 50, 3))
    expected = rotate(turns, vectors)

    together = columns.turned(turns.T, np.swapaxes(vectors, 1, 2))
    alone = [columns.turned(turns.T, each.T) for each in vectors]

    np.testing.assert_allclose(np.swapaxes(together, 1, 2), expected, atol=1e-14)
    np.testing.assert_allclose(np.stack(alone), together, atol=1e-14)


def test_vectors_of_hardly_any_length_turn_nothing_whatever_is_beside_them() -> None:
    # Opposite, of no length, and so short that squares of it are lost; and one as it should be.
    start = np.array([[1.0, 0.0, 1e-13, 1.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    goal = np.array([[-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 1e-12, 1.0], [0.0, 0.0, 0.0, 0.0]])
    turns = columns.smallest_arc(start, goal)
    np.testing.assert_allclose(np.linalg.norm(turns, axis=0), 1.0, atol=1e-12)
    np.testing.assert_allclose(turns[:, 1:3], [[1.0, 1.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    np.testing.assert_allclose(rotate(turns[:, 3], start[:, 3]), goal[:, 3], atol=1e-12)
