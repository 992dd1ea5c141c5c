# SPDX-License-Identifier: GPL-3.0-or-later
"""What sets out all at once does so more gently; all else stays as it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from octo_motion.core.locomotion.rig.bone_rotations import ArmFrames, turns_in_world
from octo_motion.core.locomotion.rig.poses import (
    keeping_where_gentle,
    softening_starts,
    turn_limits,
)
from octo_motion.core.rotations import Floats, from_axis_angle
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
    return finished(keeping_where_gentle(arms, before, after, STILL, **around))


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


def letting_go(rate: float, again: int = FRAMES) -> tuple[list[ArmFrames], Floats, np.ndarray]:
    """A bone that is held until a frame, and then turns by 150° in a third of a second, hardly
    before it is quick; and where (frames, 1) it is held, from some frame on again.
    """
    arms = arms_of()
    bones = len(arms[0].bones)
    rotations = flipping(0.0, AT, len(arms), bones, 3)
    share = np.clip((np.arange(FRAMES) - AT) / rate * 3.0, 0.0, 1.0)
    angle = np.radians(150.0) * np.sin(0.5 * np.pi * share) ** 1.2
    axis = np.tile([1.0, 0.0, 0.0], (FRAMES, 1))
    rotations[:, 3] = from_axis_angle(axis, angle)
    held = np.ones((FRAMES, 1), dtype=bool)
    held[AT + 1 : again] = False
    return arms, rotations, held


@pytest.mark.parametrize("rate", [24.0, 48.0])
def test_an_arm_that_lets_go_sets_out_gently_and_is_in_time_for_its_next_hold(rate: float) -> None:
    arms, rotations, held = letting_go(rate)
    assert starts(arms, rotations, rate)
    around = [held, *([np.ones_like(held)] * (len(arms) - 1))]
    steps = softening_starts(arms, rotations, STILL, around, rate=rate, per_cycle=SLOWLY)
    found = finished(steps)
    assert found is not None
    assert not starts(arms, found[0], rate)
    # What holds on stays, and a third of a second later all is as it was.
    same = np.r_[: AT + 1, AT + round(0.4 * rate) : FRAMES]
    np.testing.assert_allclose(found[0][same], rotations[same], atol=1e-12)
    turns = turns_in_world(arms, found[0], STILL, 1)
    assert turns.max() <= 1.05 * turns_in_world(arms, rotations, STILL, 1).max()


def test_an_arm_that_holds_on_again_at_once_is_not_late() -> None:
    arms, rotations, held = letting_go(24.0, again=AT + 4)
    around = [held, *([np.ones_like(held)] * (len(arms) - 1))]
    found = finished(softening_starts(arms, rotations, STILL, around, rate=24.0, per_cycle=SLOWLY))
    assert found is None


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
