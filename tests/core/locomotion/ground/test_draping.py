# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that choose where on uneven ground they lie well."""

import numpy as np

from octo_motion.core.locomotion.ground.footholds import settled
from octo_motion.core.locomotion.ground.surface import Ground, HeightField, LevelGround
from octo_motion.core.rotations import rotate_in_plane

ROOTS = np.tile(np.array([0.0, 0.0, 0.16]), (8, 5, 1))
AIMS = np.tile(rotate_in_plane(np.array([1.0, 0.0]), np.linspace(0.0, 6.0, 8))[:, None], (1, 5, 1))
AWAY = np.tile(np.linspace(0.4, 0.7, 5), (8, 1))
SIZES = np.tile([1.0, 0.3], (8, 1))


def ridge(height: float = 0.16, at: float = 0.55) -> HeightField:
    """A hill all round, whose crest is some way from the middle, smooth on both sides."""
    spacing = 0.01
    x = np.arange(-1.6, 1.6, spacing)
    away = np.hypot(x[:, None], x)
    return HeightField((-1.6, -1.6), spacing, height * np.exp(-(((away - at) / 0.16) ** 2)))


def falls(ground: Ground, turns: np.ndarray, farther: np.ndarray) -> np.ndarray:
    """By how much the ground falls away under each arm, radians."""
    way = rotate_in_plane(AIMS, turns)
    along = np.linspace(0.0, 0.3, 13)[:, None, None]
    places = ROOTS[..., :2] + (AWAY + farther + along)[..., None] * way
    slopes = np.arctan(np.diff(ground.height(places), axis=0) / (0.3 / 12.0))
    return np.max(np.maximum.accumulate(slopes, axis=0) - slopes, axis=0)


def test_on_level_ground_and_on_a_slope_no_arm_looks_around() -> None:
    for ground in (LevelGround(0.0), LevelGround(0.0, (0.1, 0.2))):
        turns, farther = settled(ground, ROOTS, AIMS, AIMS, AWAY, sizes=SIZES)
        assert not turns.any()
        assert not farther.any()


def test_an_arm_that_would_hang_over_a_crest_takes_hold_before_or_behind_it() -> None:
    ground = ridge()
    none = np.zeros(AWAY.shape)
    turns, farther = settled(ground, ROOTS, AIMS, AIMS, AWAY, sizes=SIZES)
    before, after = falls(ground, none, none), falls(ground, turns, farther)
    assert np.all(after <= before + 1e-9)
    worst = before > np.radians(70.0)
    assert worst.any()
    assert after[worst].mean() < 0.7 * before[worst].mean()
    assert np.abs(farther).max() <= 0.12
    assert np.abs(turns).max() <= np.radians(18.0)


def test_arms_that_have_no_choice_stay_where_they_are() -> None:
    away = np.where(np.arange(5) == 1, AWAY, np.nan)
    turns, farther = settled(ridge(), ROOTS, AIMS, AIMS, away, sizes=SIZES)
    chosen = (turns != 0.0) | (farther != 0.0)
    assert chosen[:, 1].all()
    assert not chosen[:, [0, 2, 3, 4]].any()
