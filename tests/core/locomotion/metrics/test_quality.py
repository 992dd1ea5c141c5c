# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of a motion: each finds the fault that was put in, and where."""

import numpy as np
import pytest

from octo_motion.core.locomotion.metrics import report as quality
from octo_motion.core.rotations import angle_between, from_axis_angle


def still() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ten frames of two arms with three joints that all lie still, 0.1 above the ground."""
    joints = np.zeros((10, 2, 3, 3))
    joints[..., 2] = 0.1
    return joints, np.ones((10, 2, 3), dtype=bool), np.zeros((10, 2), dtype=int)


def test_slip_is_counted_from_where_a_joint_came_to_rest() -> None:
    joints, lying, cycles = still()
    joints[4:, 1, 2, 0] = 0.2
    assert quality.slip(joints, lying, cycles, np.array([1.0, 2.0])) == quality.Worst(0.1, 4, 1)
    lying[3, 1, 2] = False
    assert quality.slip(joints, lying, cycles, np.ones(2)).value == 0.0
    lying[3, 1, 2] = True
    cycles[4:, 1] = 1
    assert quality.slip(joints, lying, cycles, np.ones(2)).value == 0.0


def test_depth_is_that_of_the_deepest_joint() -> None:
    below = np.full((10, 2, 3), -0.1)
    below[6, 0, 1] = 0.15
    assert quality.depth(below) == quality.Worst(0.15, 6, 0)


def test_change_is_the_angle_from_frame_to_frame() -> None:
    turn = np.array([0.0, 0.1, 0.3, 0.3])
    rotations = from_axis_angle(np.array([0.0, 1.0, 0.0]), turn)[:, None]
    rotations[2] *= -1.0
    worst = quality.change(
        angle_between(rotations[:-1], rotations[1:]), np.array([1.0, 2.0, 2.5, 3.5])
    )
    assert worst.value == pytest.approx(0.4)
    assert (worst.sample, worst.arm) == (1, 0)


def test_strain_counts_both_ways() -> None:
    assert quality.strain(np.array([[0.1, -0.3], [0.2, 0.0]])) == quality.Worst(0.3, 0, 1)
    assert quality.miss(np.zeros((0, 4))) == quality.Worst(0.0, 0, 0)
