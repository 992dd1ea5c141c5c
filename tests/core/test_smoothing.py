# SPDX-License-Identifier: GPL-3.0-or-later
"""From rest to rest: as even as can be without a jerk."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.smoothing import even_pace


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
