# SPDX-License-Identifier: GPL-3.0-or-later
"""An arm's measures."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.locomotion.gait import ccd as arm
from tests.core import oracle


def test_default_arm_has_the_measures_of_the_paper() -> None:
    segments = 0.5 * arm.diameters(12, 1.0, 0.01)
    sizes = arm.split_groups(segments)

    assert np.allclose(arm.diameters(12, 1.0, 0.01), oracle.ARM_DIAMETERS, rtol=0, atol=1e-12)
    assert np.allclose(segments, oracle.ARM_SEGMENTS, rtol=0, atol=1e-12)
    assert sizes == (4, 4, 4)
    assert np.allclose(arm.group_lengths(segments, sizes), oracle.ARM_GROUP_LENGTHS, atol=1e-12)
    assert segments.sum() == pytest.approx(oracle.ARM_LENGTH, abs=1e-12)


@pytest.mark.parametrize("joints", [3, 6, 12, 30, 99])
def test_even_arms_are_split_into_thirds(joints: int) -> None:
    assert arm.split_groups(np.ones(joints)) == (joints // 3,) * 3


@given(st.lists(st.floats(0.01, 10.0), min_size=3, max_size=24))
def test_groups_are_as_equal_as_whole_bones_allow(lengths: list[float]) -> None:
    values = np.array(lengths)

    sizes = arm.split_groups(values)

    def unevenness(cut: tuple[int, int, int]) -> float:
        return float(np.sum(arm.group_lengths(values, cut) ** 2)) / values.sum() ** 2

    count = len(lengths)
    best = min(
        unevenness((first, second - first, count - second))
        for first, second in itertools.combinations(range(1, count), 2)
    )
    assert min(sizes) >= 1
    assert sum(sizes) == count
    # 1e-9 is what decides between cuts that are equally good.
    assert unevenness(sizes) <= best + 2e-9
    assert arm.group_lengths(values, sizes).sum() == pytest.approx(values.sum(), rel=1e-12)
