# SPDX-License-Identifier: GPL-3.0-or-later
"""Pseudo-targets."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from octo_motion.core.locomotion.gait.ccd import (
    SHORTEST,
    contraction,
    link_rotations,
    pseudo_targets,
)
from octo_motion.core.rotations import Floats
from tests.core import oracle

LENGTHS = np.array(oracle.ARM_GROUP_LENGTHS)
angles = arrays(np.float64, (3, 3), elements=st.floats(-np.pi, np.pi))


def targets_of(values: Floats, factor: float = 1.0) -> Floats:
    widths = LENGTHS * (1.0 + contraction(values, factor))
    return pseudo_targets(link_rotations(values), widths)


@pytest.mark.parametrize(
    ("gait", "expected"),
    [(oracle.WALK_ANGLES, oracle.WALK_TARGETS), (oracle.SWIM_ANGLES, oracle.SWIM_TARGETS)],
)
def test_targets_of_both_gaits_are_where_the_paper_puts_them(
    gait: list[list[float]], expected: list[list[list[float]]]
) -> None:
    values = np.zeros((len(oracle.PHASES), 3, 3))
    values[..., 0] = np.array(gait).T

    found = targets_of(values)

    assert np.max(np.abs(found[:, 1:, [0, 2]] - np.array(expected))) <= 1e-9
    assert not np.any(found[:, :, 1])


def test_at_zero_angles_the_targets_lie_on_the_straight_arm() -> None:
    reach = np.concatenate([[0.0], np.cumsum(LENGTHS)])

    assert np.allclose(targets_of(np.zeros((3, 3))), reach[:, None] * [1.0, 0.0, 0.0])


@given(angles)
def test_links_are_as_wide_as_their_contraction_says(values: Floats) -> None:
    widths = np.linalg.norm(np.diff(targets_of(values), axis=0), axis=-1)

    turn = np.hypot(values[:, 0], values[:, 1])
    assert np.allclose(
        widths, LENGTHS * np.maximum(1.0 - turn / (2.0 * np.pi), SHORTEST), atol=1e-12
    )


@given(angles)
def test_without_contraction_links_keep_their_length(values: Floats) -> None:
    widths = np.linalg.norm(np.diff(targets_of(values, 0.0), axis=0), axis=-1)

    assert np.allclose(widths, LENGTHS, atol=1e-12)


@given(angles)
def test_bank_moves_no_target(values: Floats) -> None:
    without = values.copy()
    without[:, 2] = 0.0

    assert np.array_equal(targets_of(values), targets_of(without))


def test_head_raises_and_pitch_turns_anticlockwise() -> None:
    raised = targets_of(np.array([[0.5, 0, 0], [0, 0, 0], [0, 0, 0]]))
    turned = targets_of(np.array([[0, 0.5, 0], [0, 0, 0], [0, 0, 0]]))

    assert np.all(raised[1:, 2] > 0.0)
    assert np.allclose(raised[:, 1], 0.0)
    assert np.all(turned[1:, 1] > 0.0)
    assert np.allclose(turned[:, 2], 0.0)


def test_a_link_carries_those_after_it() -> None:
    first = link_rotations(np.array([[0.4, 0.2, 0], [0.1, -0.3, 0], [0.2, 0.2, 0]]))
    rest = link_rotations(np.array([[0.0, 0.0, 0], [0.1, -0.3, 0], [0.2, 0.2, 0]]))

    from octo_motion.core.rotations import angle_between, multiply

    assert np.max(angle_between(first, multiply(first[0], rest))) <= 1e-12
