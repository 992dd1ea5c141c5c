# SPDX-License-Identifier: GPL-3.0-or-later
"""A loop has no seam: its end is its beginning, in position and in motion, for every gait."""

import dataclasses

import numpy as np
import pytest

from octo_motion.core.errors import SettingsError
from octo_motion.core.locomotion.gait import table as gait
from octo_motion.core.locomotion.gait.gait_poser import Arm, GaitPoser, GaitSettings
from octo_motion.core.locomotion.gait.variation import variation
from octo_motion.core.locomotion.path.course import (
    route_in_place,
    travel_in_place,
    whole_frames,
)
from octo_motion.core.locomotion.path.travel import TravelSettings, plan_travel
from octo_motion.core.rotations import Floats, angle_between
from tests.core.rigs import body_with_arms

PRESETS = gait.gait_presets()
every_preset = pytest.mark.parametrize("name", sorted(PRESETS))
every_length = pytest.mark.parametrize("cycles", [1, 3])
FRAMES = 48


def looped(name: str, cycles: int, shares: Floats) -> Floats:
    """Rotations (shares, bones, 4) of a loop with random additions and odd phases of the arms."""
    table = PRESETS[name]
    skeleton, arms, body = body_with_arms(8, 12)
    odd: list[Arm] = [
        dataclasses.replace(arm, phase=0.37 * number) for number, arm in enumerate(arms)
    ]
    settings = GaitSettings(table, variation=(-0.2, 0.2), seed=5, period=cycles)
    generator = GaitPoser(skeleton, odd, body, settings)
    travel = travel_in_place(
        TravelSettings(
            manner="SWIM" if table.manner == "SWIM" else "WALK",
            stride=table.stride,
            stroke_phase=table.power_phase,
            burst=0.6,
        )
    )
    plan = plan_travel(route_in_place(table.stride, cycles), travel, shares)
    assert np.abs(plan.turn).max() < 1e-9
    return generator.pose(plan.phase, plan.turn).rotations


@every_preset
@every_length
def test_the_last_frame_is_the_first(name: str, cycles: int) -> None:
    ends = looped(name, cycles, np.array([0.0, 1.0]))
    assert np.max(angle_between(ends[0], ends[1])) < 1e-6


@every_preset
@every_length
def test_at_the_seam_the_motion_is_as_smooth_as_anywhere(name: str, cycles: int) -> None:
    # A gait's table is linear between knots, so its slope changes at every knot, and where knots
    # of some arm meet the seam it may change there too: but by no more than it does within the
    # loop, where another arm, whose knots lie elsewhere, passes them.
    count = FRAMES * cycles * 8
    poses = looped(name, cycles, np.arange(count + 1) / count)
    steps = np.diff(poses, axis=0)
    within = np.linalg.norm(np.diff(steps, axis=0), axis=-1).max(axis=0).reshape(8, 12)
    seam = np.linalg.norm(steps[0] - steps[-1], axis=-1).reshape(8, 12)
    # A corner that falls between two samples is seen by half in each.
    assert np.all(seam <= 2.1 * within.max(axis=0))


@every_preset
def test_the_seam_is_where_one_puts_it(name: str) -> None:
    # What follows the first frame is what would follow the last: a loop begun later is the same
    # loop, sub-frames included.
    table = PRESETS[name]
    skeleton, arms, body = body_with_arms(8, 7)
    generator = GaitPoser(
        skeleton, arms, body, GaitSettings(table, variation=(-0.2, 0.2), seed=3, period=2)
    )
    around = np.array([-1e-3, -1e-4, 0.0, 1e-4, 1e-3])
    straight = np.zeros((len(around), 2))
    before = generator.pose(around, straight).rotations
    after = generator.pose(4.0 * np.pi + around, straight).rotations
    assert np.max(angle_between(before, after)) < 1e-6
    slopes = np.diff(before, axis=0), np.diff(after, axis=0)
    np.testing.assert_allclose(slopes[0], slopes[1], atol=1e-9)


def test_without_a_period_random_additions_never_come_again() -> None:
    table = PRESETS["walk"]
    phases = np.array([[0.5], [0.5 + 2.0 * np.pi], [0.5 + 4.0 * np.pi]])
    free = variation(table, phases, (1,), (-1.0, 1.0), 0)
    assert not np.allclose(free[0], free[2])
    bound = variation(table, phases, (1,), (-1.0, 1.0), 0, cycle_period=2)
    np.testing.assert_allclose(bound[0], bound[2], atol=1e-12)
    assert not np.allclose(bound[0], bound[1])


def test_a_loop_lasts_whole_frames() -> None:
    assert whole_frames(47.6) == 48.0
    assert whole_frames(0.2) == 2.0


def test_what_makes_no_loop_is_told() -> None:
    with pytest.raises(SettingsError, match="0 cycles"):
        route_in_place(1.0, 0)
