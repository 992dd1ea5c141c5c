# SPDX-License-Identifier: GPL-3.0-or-later
"""Our rotations mean what Blender means by them."""

import itertools

# mathutils comes with bpy, and only after it.
import bpy  # noqa: F401  # pyright: ignore[reportUnusedImport]
import mathutils
import numpy as np
import pytest

from octo_motion.core import rotations
from octo_motion.core.rotations import EULER_ORDERS

RANDOM_QUATERNIONS = rotations.normalized(np.random.default_rng(7).normal(size=(200, 4)))
RANDOM_ANGLES = np.random.default_rng(8).uniform(-7.0, 7.0, size=(200, 3))
SINGLE_PRECISION = 2e-6
"""mathutils computes in single precision."""


def apart(ours: np.ndarray, blenders: mathutils.Quaternion) -> float:
    return float(rotations.angle_between(ours, rotations.normalized(blenders)))


@pytest.mark.parametrize("order", EULER_ORDERS)
def test_euler_angles_turn_as_blenders_do(order: str) -> None:
    for angles, ours in zip(RANDOM_ANGLES, rotations.from_euler(RANDOM_ANGLES, order), strict=True):
        euler = mathutils.Euler(angles.tolist(), order)
        assert apart(ours, euler.to_quaternion()) < SINGLE_PRECISION


@pytest.mark.parametrize("order", EULER_ORDERS)
def test_blender_reads_our_euler_angles_as_the_quaternion_they_come_from(order: str) -> None:
    eulers = rotations.to_euler(RANDOM_QUATERNIONS, order)
    for q, angles in zip(RANDOM_QUATERNIONS, eulers, strict=True):
        euler = mathutils.Euler(angles.tolist(), order)
        assert apart(q, euler.to_quaternion()) < SINGLE_PRECISION


@pytest.mark.parametrize("order", EULER_ORDERS)
def test_first_frame_has_the_euler_angles_that_blender_would_give_it(order: str) -> None:
    eulers = rotations.to_euler(RANDOM_QUATERNIONS, order)
    for q, angles in zip(RANDOM_QUATERNIONS, eulers, strict=True):
        blenders = mathutils.Quaternion(q.tolist()).to_euler(order)  # type: ignore[arg-type]
        difference = rotations.continuous_euler(angles[None], order)[0] - np.array(blenders)
        whole = 2.0 * np.pi * np.round(difference / (2.0 * np.pi))
        # Single precision loses the first and last angle near the poles of the middle one.
        pole = abs(np.cos(angles["XYZ".index(order[1])]))
        assert np.abs(difference - whole).max() * pole < SINGLE_PRECISION


def test_products_matrices_and_turned_vectors_are_blenders() -> None:
    v = np.array([0.3, -1.2, 0.7])
    for p, q in itertools.pairwise(RANDOM_QUATERNIONS):
        first, second = mathutils.Quaternion(p.tolist()), mathutils.Quaternion(q.tolist())
        assert apart(rotations.multiply(p, q), first @ second) < SINGLE_PRECISION
        np.testing.assert_allclose(rotations.to_matrix(p), np.array(first.to_matrix()), atol=1e-6)
        assert apart(rotations.from_matrix(first.to_matrix()), first) < SINGLE_PRECISION
        turned = first @ mathutils.Vector(v.tolist())
        np.testing.assert_allclose(rotations.rotate(p, v), np.array(turned), atol=1e-6)


def test_axis_and_angle_are_blenders() -> None:
    result = rotations.continuous_axis_angle(RANDOM_QUATERNIONS)
    for q, (angle, *axis) in zip(RANDOM_QUATERNIONS, result.tolist(), strict=True):
        assert apart(q, mathutils.Quaternion(axis, angle)) < 1e-5
