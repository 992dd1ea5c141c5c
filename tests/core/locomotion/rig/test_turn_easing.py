# SPDX-License-Identifier: GPL-3.0-or-later
"""What would turn too fast for an eye takes its time; all else stays as it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from octo_motion.core.locomotion.rig.bone_rotations import ArmFrames, frames_of_arm
from octo_motion.core.locomotion.rig.poses import (
    easing_turns,
    keeping_where_calm,
    keeping_where_gentle,
    keeping_where_it_helps,
    turn_limits,
)
from octo_motion.core.rotations import Floats, from_axis_angle, rotate
from octo_motion.core.steps import finished
from tests.core.rigs import body_with_arms

FRAMES = 240
FASTEST = np.radians(28.0) * 24.0
"""Radians a second."""
SLOWLY = 1e6
"""Frames of a cycle."""
STILL = np.tile([1.0, 0.0, 0.0, 0.0], (FRAMES, 1))


def eased_turns(*args: Any, **kwargs: Any) -> tuple[Floats, Floats] | None:
    return finished(easing_turns(*args, **kwargs))


def where_it_helps(*args: Any, **kwargs: Any) -> Floats:
    return finished(keeping_where_it_helps(*args, **kwargs))


def arms_of() -> list[ArmFrames]:
    skeleton, arms, body = body_with_arms(4, 6)
    return [frames_of_arm(skeleton, arm.bones, body) for arm in arms]


def flipping(angle: float, at: int, arms: int, bones: int, bone: int) -> Floats:
    """All bones at rest, but one of the first arm that turns at once."""
    result = np.zeros((FRAMES, arms * bones, 4))
    result[..., 0] = 1.0
    result[at:, bone] = from_axis_angle(np.array([1.0, 0.0, 0.0]), np.array(angle))
    return result


def largest(rotations: Floats) -> float:
    """Radians a frame."""
    same = np.abs(np.sum(rotations[1:] * rotations[:-1], axis=-1))
    return float(2.0 * np.arccos(np.minimum(same, 1.0)).max())


@pytest.mark.parametrize("rate", [24.0, 96.0])
@pytest.mark.parametrize("degrees", [50.0, 160.0])
def test_a_bone_that_flips_in_the_air_takes_its_time(rate: float, degrees: float) -> None:
    arms = arms_of()
    bones = len(arms[0].bones)
    rotations = flipping(np.radians(degrees), 120, len(arms), bones, 3)
    free = [np.zeros((FRAMES, 1), dtype=bool)] * len(arms)
    found = eased_turns(arms, rotations, STILL, free, rate=rate, limits=turn_limits(rate, SLOWLY))
    assert found is not None
    eased, changed = found
    assert largest(eased) <= 1.001 * FASTEST / rate
    # Long before and after it, and of the other arms, nothing is changed.
    np.testing.assert_array_equal(eased[:, bones:], rotations[:, bones:])
    some = changed[:, 0] > 0.0
    np.testing.assert_array_equal(eased[~some], rotations[~some])
    assert not some[[0, -1]].any()
    assert not changed[:, 1:].any()


def test_what_is_slow_enough_is_left_alone() -> None:
    arms = arms_of()
    rotations = flipping(0.9 * FASTEST / 24.0, 120, len(arms), len(arms[0].bones), 3)
    free = [np.zeros((FRAMES, 1), dtype=bool)] * len(arms)
    assert (
        eased_turns(arms, rotations, STILL, free, rate=24.0, limits=turn_limits(24.0, SLOWLY))
        is None
    )


def test_an_arm_that_holds_on_lets_go_only_of_what_would_pop() -> None:
    arms = arms_of()
    bones = len(arms[0].bones)
    held = [np.ones((FRAMES, 1), dtype=bool)] * len(arms)
    some = flipping(1.2 * FASTEST / 24.0, 120, len(arms), bones, 3)
    assert eased_turns(arms, some, STILL, held, rate=24.0, limits=turn_limits(24.0, SLOWLY)) is None
    found = eased_turns(
        arms,
        flipping(np.radians(120.0), 120, len(arms), bones, 3),
        STILL,
        held,
        rate=24.0,
        limits=turn_limits(24.0, SLOWLY),
    )
    assert found is not None
    assert largest(found[0]) < np.radians(45.0)


@pytest.mark.parametrize("rate", [24.0, 96.0])
@pytest.mark.parametrize("degrees", [50.0, 130.0])
def test_an_arm_that_holds_on_takes_its_time_to_roll_and_lies_as_it_did(
    rate: float, degrees: float
) -> None:
    arms = arms_of()
    arm, bones = arms[0], len(arms[0].bones)
    about = rotate(arm.own[3], np.array([1.0, 0.0, 0.0]))
    rotations = flipping(0.0, 120, len(arms), bones, 3)
    rotations[120:, 3] = from_axis_angle(about, np.radians(np.array(degrees)))
    held = [np.ones((FRAMES, 1), dtype=bool)] * len(arms)
    found = eased_turns(arms, rotations, STILL, held, rate=rate, limits=turn_limits(rate, SLOWLY))
    assert found is not None
    eased, moved = found
    assert largest(eased) <= 1.001 * FASTEST / rate
    assert not moved.any()
    before, after = (arm.joints(arm.from_bones(each[:, :bones])) for each in (rotations, eased))
    np.testing.assert_allclose(after, before, atol=1e-9 * arm.length)


def test_a_gait_in_a_hurry_may_turn_faster() -> None:
    arms = arms_of()
    rotations = flipping(np.radians(36.0), 120, len(arms), len(arms[0].bones), 3)
    free = [np.zeros((FRAMES, 1), dtype=bool)] * len(arms)
    assert (
        eased_turns(arms, rotations, STILL, free, rate=24.0, limits=turn_limits(24.0, 24.0)) is None
    )
    assert (
        eased_turns(arms, rotations, STILL, free, rate=24.0, limits=turn_limits(24.0, 60.0))
        is not None
    )


def test_an_arm_that_reaches_takes_its_time_in_a_hurry_too() -> None:
    arms = arms_of()
    bones = len(arms[0].bones)
    rotations = flipping(np.radians(36.0), 120, len(arms), bones, 3)
    rotations[180:, bones + 3] = rotations[120, 3]
    free = [np.zeros((FRAMES, 1), dtype=bool)] * len(arms)
    reaching = np.zeros((FRAMES, len(arms)), dtype=bool)
    reaching[100:150, 0] = True
    limits = turn_limits(24.0, 24.0, reaching)
    found = eased_turns(arms, rotations, STILL, free, rate=24.0, limits=limits)
    assert found is not None
    eased, _ = found
    assert largest(eased[:150]) <= 1.001 * FASTEST / 24.0
    np.testing.assert_array_equal(eased[:, bones:], rotations[:, bones:])
    helped = where_it_helps(arms, rotations, eased, STILL, limits=limits)
    np.testing.assert_array_equal(helped, eased)


def test_each_stretch_counts_by_itself() -> None:
    """What cannot be helped at one place spoils nothing at another."""
    arms = arms_of()
    bones = len(arms[0].bones)
    free = [np.zeros((FRAMES, 1), dtype=bool)] * len(arms)
    most = FASTEST / 24.0
    # A little too fast early on, far too fast later.
    before = flipping(1.1 * most, 60, len(arms), bones, 3)
    before[180:, 3] = from_axis_angle(np.array([1.0, 0.0, 0.0]), np.array(4.0 * most))
    eased, _ = eased_turns(
        arms, before, STILL, free, rate=24.0, limits=turn_limits(24.0, SLOWLY)
    ) or (before, None)
    assert largest(eased) <= 1.001 * most
    # Something brings the later one back nearly to where it was.
    spoilt = eased.copy()
    spoilt[120:] = before[120:]
    spoilt[180] = spoilt[179]
    found = where_it_helps(arms, before, spoilt, STILL, limits=np.full((1, 1), most))
    assert largest(found[:120]) <= 1.001 * most
    np.testing.assert_array_equal(found[120:], before[120:])


def test_a_stretch_in_which_nothing_was_too_fast_stays_as_it_was() -> None:
    arms = arms_of()
    most = FASTEST / 24.0
    before = flipping(0.9 * most, 120, len(arms), len(arms[0].bones), 3)
    changed = before.copy()
    changed[118:123, 3] = before[118, 3]
    np.testing.assert_array_equal(
        where_it_helps(arms, before, changed, STILL, limits=np.full((1, 1), most)), before
    )


@pytest.mark.parametrize("rate", [24.0, 96.0])
def test_a_tip_that_comes_down_after_its_arm_takes_its_time_and_what_lies_stays(
    rate: float,
) -> None:
    arms = arms_of()
    bones = len(arms[0].bones)
    rotations = flipping(1.8 * FASTEST / rate, 120, len(arms), bones, bones - 1)
    held = [np.broadcast_to(np.arange(bones) < bones - 2, (FRAMES, bones))] * len(arms)
    found = eased_turns(arms, rotations, STILL, held, rate=rate, limits=turn_limits(rate, SLOWLY))
    assert found is not None
    eased, moved = found
    assert largest(eased) <= 1.001 * FASTEST / rate
    np.testing.assert_allclose(eased[:, : bones - 2], rotations[:, : bones - 2], atol=1e-12)
    # The arm itself holds on: it is not to be lifted for its tip.
    assert not moved.any()


def test_an_arm_that_makes_way_too_fast_goes_as_before_and_the_others_make_way() -> None:
    arms = arms_of()
    bones = len(arms[0].bones)
    limits = turn_limits(24.0, SLOWLY)
    before = flipping(0.0, 120, len(arms), bones, 3)
    changed = flipping(1.2 * FASTEST / 24.0, 120, len(arms), bones, 3)
    changed[:, bones + 3] = flipping(0.8 * FASTEST / 24.0, 60, len(arms), bones, 3)[:, 3]
    kept = finished(keeping_where_calm(arms, before, changed, STILL, limits=limits))
    np.testing.assert_array_equal(kept[:, :bones], before[:, :bones])
    np.testing.assert_array_equal(kept[:, bones:], changed[:, bones:])
    # What was as fast before is not laid at its door.
    fast = flipping(1.2 * FASTEST / 24.0, 120, len(arms), bones, 4)
    changed = fast.copy()
    changed[:, 3] = from_axis_angle(np.array([1.0, 0.0, 0.0]), np.full(FRAMES, 0.1))
    kept = finished(keeping_where_calm(arms, fast, changed, STILL, limits=limits))
    np.testing.assert_array_equal(kept, changed)


def test_arms_change_where_fewer_bones_set_out_all_at_once_and_nowhere_where_more_do() -> None:
    arms = arms_of()
    bones, limits = len(arms[0].bones), turn_limits(24.0, SLOWLY)
    jerk = 0.9 * FASTEST / 24.0
    # Two bones of one arm, and one of another, stand still and are off all at once.
    before = flipping(jerk, 60, len(arms), bones, 2)
    before[:, 4] = flipping(jerk, 64, len(arms), bones, 4)[:, 4]
    before[:, bones + 3] = flipping(jerk, 60, len(arms), bones, 3)[:, 3]
    changed = before.copy()
    # Of the one arm one of both does so no more, of the other one more does.
    changed[60:, 2] = before[59, 2]
    changed[:, bones + 1] = flipping(jerk, 62, len(arms), bones, 1)[:, 1]
    kept = finished(keeping_where_gentle(arms, before, changed, STILL, rate=24.0, limits=limits))
    np.testing.assert_array_equal(kept[:, :bones], changed[:, :bones])
    np.testing.assert_array_equal(kept[:, bones:], before[:, bones:])
