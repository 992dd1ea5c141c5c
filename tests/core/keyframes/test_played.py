# SPDX-License-Identifier: GPL-3.0-or-later
"""What few keys play is what was asked of them, and on the keys themselves exactly."""

import numpy as np

from octo_motion.core.keyframes import LOCATION, Limb, Track, reduce_keys
from octo_motion.core.keyframes.channels import values_at

FRAMES = np.arange(1.0, 61.0)


def test_curves_keep_to_their_bound_and_meet_their_keys() -> None:
    values = np.stack([np.sin(0.15 * FRAMES), 0.3 * np.cos(0.4 * FRAMES), 0.0 * FRAMES], axis=1)
    ((keys,),) = reduce_keys(FRAMES, [Limb([Track(values, LOCATION)], np.pi, 0.01)])
    assert len(keys) < 30
    played = values_at(keys, FRAMES)
    assert np.linalg.norm(played - values, axis=1).max() <= 0.01
    # Keys are in single precision.
    np.testing.assert_allclose(values_at(keys, keys.frames.astype(float)), keys.values, atol=1e-7)


def test_before_the_first_key_and_after_the_last_nothing_moves() -> None:
    values = np.stack([FRAMES, FRAMES, FRAMES], axis=1)
    ((keys,),) = reduce_keys(FRAMES, [Limb([Track(values, LOCATION)], np.pi, 0.01)])
    assert len(keys) == 2
    np.testing.assert_allclose(
        values_at(keys, np.array([-5.0, 1.0, 30.25, 60.0, 99.0]))[:, 0],
        [1.0, 1.0, 30.25, 60.0, 60.0],
        atol=1e-5,
    )


def test_one_key_holds_still() -> None:
    values = np.ones((1, 3))
    ((keys,),) = reduce_keys(FRAMES[:1], [Limb([Track(values, LOCATION)], np.pi, 0.01)])
    np.testing.assert_array_equal(values_at(keys, np.array([0.0, 9.0])), np.ones((2, 3)))
