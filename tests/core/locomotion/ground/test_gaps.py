# SPDX-License-Identifier: GPL-3.0-or-later
"""What is narrower than an arm is stepped over, and nothing lies where there is nothing."""

from __future__ import annotations

import numpy as np
import pytest

from octo_motion.core.errors import GroundError
from octo_motion.core.locomotion.ground.surface import HeightField, sample_ground
from octo_motion.core.rotations import Floats
from tests.core.grounds import walker

WAY = np.stack([np.linspace(-1.0, 1.0, 41), np.zeros(41), np.zeros(41)], axis=-1)


def strip(start: float, end: float) -> Floats:
    """Two faces that cover all from one X to another."""
    a, b, c, d = (np.array([x, y, 0.0]) for x, y in
                  ((start, -3.0), (end, -3.0), (end, 3.0), (start, 3.0)))  # fmt: skip
    return np.array([[a, b, c], [a, c, d]])


def sampled(width: float, gap: float, way: Floats = WAY) -> HeightField:
    triangles = np.concatenate([strip(-3.0, -0.5 * width), strip(0.5 * width, 3.0)])
    needed = np.ones(len(way), dtype=bool)
    return sample_ground(triangles, way, needed, reach=1.0, spacing=0.02, headroom=1.0, gap=gap)


def test_a_gap_is_known_and_the_ground_goes_on_level_over_it() -> None:
    ground = sampled(0.4, 0.6)
    across = np.stack([np.linspace(-1.0, 1.0, 201), np.full(201, 0.3)], axis=-1)
    inside = np.abs(across[:, 0]) < 0.18
    outside = np.abs(across[:, 0]) > 0.22
    assert ground.is_gap(across)[inside].all()
    assert not ground.is_gap(across)[outside].any()
    assert ground.height(across) == pytest.approx(0.0)


def test_a_gap_is_as_wide_as_the_ground_says_however_far_apart_the_points_of_the_way_are() -> None:
    for places in (WAY, WAY[::4], WAY[[0, -1]]):
        assert sampled(0.42, 0.45, places).is_gap(np.zeros(2))
        with pytest.raises(GroundError, match="leaves the ground"):
            sampled(0.5, 0.45, places)


def test_what_lies_beyond_the_ground_is_no_gap() -> None:
    triangles = strip(-1.2, 1.2)
    needed = np.ones(len(WAY), dtype=bool)
    ground = sample_ground(triangles, WAY, needed, reach=1.0, spacing=0.02, headroom=1.0, gap=0.6)
    assert ground.gaps is None


def test_what_is_too_wide_is_refused() -> None:
    with pytest.raises(GroundError, match="leaves the ground after 3"):
        sampled(0.8, 0.6)
    with pytest.raises(GroundError, match="leaves the ground"):
        sampled(0.4, 0.0)


def test_arms_take_hold_beside_a_gap_and_none_lies_over_it() -> None:
    y = np.arange(-7.5, 3.0, 0.025)
    flat = np.zeros((240, len(y)))
    gaps = np.broadcast_to(np.abs(y + 2.2) < 0.3, flat.shape)
    found = []
    for ground in (HeightField((-3.0, -7.5), 0.025, flat),
                   HeightField((-3.0, -7.5), 0.025, flat, gaps)):  # fmt: skip
        poses = walker(ground).pose(np.linspace(0.3, 0.7, 97))
        lying = np.concatenate([each.reshape(-1) for each in poses.in_contact])
        places = np.concatenate([each.reshape(-1, 3) for each in poses.joints])[lying]
        found.append((np.abs(places[:, 1] + 2.2).min(), lying.sum(), poses.misses.max()))
    (_, held, _), (nearest, beside, missed) = found
    # A sample's width; without gaps it is nothing.
    assert nearest > 0.3 - 0.025
    # Most holds are found all the same, and are within reach.
    assert beside > 0.6 * held
    assert missed < 0.02
