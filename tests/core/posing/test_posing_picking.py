# SPDX-License-Identifier: GPL-3.0-or-later
"""What the mouse points at."""

import numpy as np
import pytest

from octo_motion.core.posing.picking import pick
from octo_motion.core.posing.puppet import capsules_in_world
from tests.core.puppets import doll, octopus, posed

UP = np.array([0.0, 0.0, 1.0])


def test_limb_in_front_is_hit_where_its_surface_is() -> None:
    figure = octopus()
    pose = posed(figure)
    ends = capsules_in_world(figure, pose)
    middle = ends[40].mean(axis=0)
    hit = pick(figure, pose, middle + 5.0 * UP, -2.0 * UP)
    assert hit is not None
    assert hit.body == 40
    assert hit.point == pytest.approx(middle + figure.radii[40] * UP, abs=1e-9)
    assert hit.distance == pytest.approx(5.0 - figure.radii[40])


def test_nearer_of_two_limbs_is_hit() -> None:
    figure = doll()
    pose = posed(figure)
    middles = capsules_in_world(figure, pose).mean(axis=1)
    left, right = 14, 18
    far = 5.0 * (middles[left] - middles[right]) / np.linalg.norm(middles[left] - middles[right])
    for near, side in ((left, 1.0), (right, -1.0)):
        hit = pick(figure, pose, middles[near] + side * far, -side * far)
        assert hit is not None
        assert hit.body == near


def test_thin_arm_is_hit_within_a_margin_and_not_beyond() -> None:
    figure = octopus()
    pose = posed(figure)
    tip = capsules_in_world(figure, pose)[-1].mean(axis=0)
    beside = tip + 5.0 * UP + 0.05 * np.array([1.0, 1.0, 0.0])
    assert pick(figure, pose, beside, -UP) is None
    hit = pick(figure, pose, beside, -UP, margin=0.02)
    assert hit is not None
    assert hit.body == len(figure) - 1


def test_nothing_behind_the_eye_is_hit() -> None:
    figure = doll()
    pose = posed(figure)
    assert pick(figure, pose, 10.0 * UP, UP, margin=0.5) is None
