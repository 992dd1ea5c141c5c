# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns turn vectors as rotations do, one or several by each quaternion."""

import numpy as np
import pytest

from octo_motion.core.locomotion import columns
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
