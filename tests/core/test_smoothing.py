# SPDX-License-Identifier: GPL-3.0-or-later
"""From rest to rest at an even pace; means that leave alone what is fixed."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.smoothing import blurred, even_pace


@given(st.floats(0.01, 0.5))
def test_an_even_pace_comes_and_goes_evenly_and_is_the_same_between(ease: float) -> None:
    share = np.linspace(-0.2, 1.2, 14001)
    way = even_pace(share, ease)
    pace = np.diff(way) / np.diff(share)
    middles = 0.5 * (share[1:] + share[:-1])
    most = 1.0 / (1.0 - ease)
    expected = most * np.clip(np.minimum(middles, 1.0 - middles) / ease, 0.0, 1.0)
    np.testing.assert_allclose(pace, expected, atol=1e-2)
    assert way[0] == 0.0
    np.testing.assert_allclose(way[-1], 1.0, atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.integers(1, 9))
def test_what_is_fixed_stays_and_none_sees_beyond_it(seed: int, width: int) -> None:
    chance = np.random.default_rng(seed)
    values, fixed = chance.normal(size=(60, 3)), np.zeros(60, dtype=bool)
    fixed[20:25] = True
    found = blurred(values, width, fixed=fixed)
    np.testing.assert_allclose(found[20:25], values[20:25], atol=1e-12)
    # Far from it, it is the mean that it always is.
    far = np.r_[0 : 20 - 6 * width, 24 + 6 * width : 60] if width < 4 else np.r_[0:0]
    np.testing.assert_allclose(found[far], blurred(values, width)[far], atol=1e-12)
    other = values.copy()
    other[30:] += 1.0
    np.testing.assert_array_equal(blurred(other, width, fixed=fixed)[:25], found[:25])


@given(st.integers(0, 2**32 - 1), st.integers(1, 9), st.integers(0, 29))
def test_in_a_loop_it_does_not_matter_where_it_starts(seed: int, width: int, start: int) -> None:
    chance = np.random.default_rng(seed)
    values, fixed = chance.normal(size=30), chance.uniform(size=30) < 0.1

    def closed(each: np.ndarray) -> np.ndarray:
        return np.concatenate([each, each[:1]])

    there, elsewhere = (
        blurred(closed(np.roll(values, by)), width, cyclic=True, fixed=closed(np.roll(fixed, by)))
        for by in (0, start)
    )
    np.testing.assert_allclose(np.roll(there[:-1], start), elsewhere[:-1], atol=1e-12)
    np.testing.assert_allclose(elsewhere[-1], elsewhere[0], atol=1e-12)
