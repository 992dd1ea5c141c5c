# SPDX-License-Identifier: GPL-3.0-or-later
"""What sets out all at once does so more gently; all else stays as it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from octo_motion.core.locomotion.rig.bone_rotations import ArmFrames, turns_in_world
from octo_motion.core.locomotion.rig.poses import (
    keeping_softer_starts,
    softening_starts,
    turn_limits,
)
from octo_motion.core.rotations import Floats
from octo_motion.core.steps import finished
from tests.core.locomotion.rig.test_turn_easing import FRAMES, SLOWLY, STILL, arms_of, flipping

AT = 120


def softened(
    arms: list[ArmFrames],
    rotations: Floats,
    *,
    held: bool = False,
    rate: float = 24.0,
    **others: Any,
) -> tuple[Floats, Floats] | None:
    still = [np.full((FRAMES, 1), held) for _ in arms]
    others = {"per_cycle": SLOWLY, **others}
    return finished(softening_starts(arms, rotations, STILL, still, rate=rate, **others))


def kept(arms: list[ArmFrames], before: Floats, after: Floats, lower: Any = None) -> Floats:
    where = np.zeros((FRAMES, len(arms)), dtype=bool) if lower is None else lower
    around: dict[str, Any] = {"rate": 24.0, "limits": turn_limits(24.0, SLOWLY), "lower": where}
    return finished(keeping_softer_starts(arms, before, after, STILL, **around))


def starts(arms: list[ArmFrames], rotations: Floats, rate: float = 24.0) -> int:
    """How often a bone turns by 15° in 1/24 s and by five times what it did in the frame before."""
    turns = np.degrees(turns_in_world(arms, rotations, STILL, 1)) * rate / 24.0
    return int(np.sum((turns[1:] > 15.0) & (turns[1:] > 5.0 * turns[:-1])))


@pytest.mark.parametrize("rate", [24.0, 48.0])
def test_a_bone_that_sets_out_all_at_once_begins_gently(rate: float) -> None:
    arms = arms_of()
    bones = len(arms[0].bones)
    rotations = flipping(np.radians(20.0) * 24.0 / rate, AT, len(arms), bones, 3)
    assert starts(arms, rotations, rate)
    found = softened(arms, rotations, rate=rate)
    assert found is not None
    assert not starts(arms, found[0], rate)
    # A third of a second before and after it, and of the other arms, nothing is changed.
    near = round(0.3 * rate)
    same = np.r_[: AT - near, AT + near : FRAMES]
    np.testing.assert_array_equal(found[0][same], rotations[same])
    np.testing.assert_array_equal(found[0][:, bones:], rotations[:, bones:])
    assert not found[1][same].any()
    assert not found[1][:, 1:].any()


def test_what_sets_out_slowly_or_holds_on_or_goes_in_a_hurry_is_left_alone() -> None:
    arms = arms_of()
    bones = len(arms[0].bones)
    slow = flipping(np.radians(14.0), AT, len(arms), bones, 3)
    assert softened(arms, slow) is None
    sudden = flipping(np.radians(20.0), AT, len(arms), bones, 3)
    assert softened(arms, sudden, held=True) is None
    assert softened(arms, sudden, per_cycle=18.0) is None
    assert softened(arms, sudden, per_cycle=24.0) is not None


def test_what_comes_to_be_too_low_or_too_fast_for_it_goes_as_before() -> None:
    arms = arms_of()
    bones = len(arms[0].bones)
    sudden = flipping(np.radians(20.0), AT, len(arms), bones, 3)
    found = softened(arms, sudden)
    assert found is not None
    np.testing.assert_array_equal(kept(arms, sudden, found[0]), found[0])
    lower = np.zeros((FRAMES, len(arms)), dtype=bool)
    lower[AT - 1, 0] = True
    np.testing.assert_array_equal(kept(arms, sudden, found[0], lower), sudden)
    # What is low elsewhere, or another arm's, is another matter.
    lower[AT - 1, 0], lower[AT - 1, 1], lower[20, 0] = False, True, True
    np.testing.assert_array_equal(kept(arms, sudden, found[0], lower), found[0])
    fast = sudden.copy()
    fast[AT - 4 : AT - 2, 3] = flipping(np.radians(40.0), 0, len(arms), bones, 3)[:2, 3]
    np.testing.assert_array_equal(kept(arms, sudden, fast), sudden)
