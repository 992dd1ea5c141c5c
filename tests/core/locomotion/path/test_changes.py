# SPDX-License-Identifier: GPL-3.0-or-later
"""Walk, crawl and swim along one route: where each begins, and which arms go over when."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.errors import SettingsError
from octo_motion.core.locomotion.path.gait_changes import (
    GaitTransition,
    check_transitions,
    transition_windows,
    transitions_by_height,
    way_weights,
)
from octo_motion.core.rotations import normalized

unit = st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).map(np.array)
quaternions = unit.filter(lambda each: np.linalg.norm(each) > 0.1).map(normalized)


@given(st.lists(st.floats(-3.0, 30.0), min_size=1, max_size=30))
def test_body_is_always_on_its_way_and_on_one_alone_outside_of_changes(at: list[float]) -> None:
    changes = (
        GaitTransition(2.0, 4.0, 1),
        GaitTransition(5.0, 6.0, 2),
        GaitTransition(8.0, 9.0, 0),
    )
    distance = np.array(at)
    weights = way_weights(changes, 3, distance)
    np.testing.assert_allclose(weights.sum(axis=-1), 1.0)
    assert weights.min() >= 0.0
    outside = ~np.any([(each.start < distance) & (distance < each.end) for each in changes], axis=0)
    assert np.all(np.isin(weights[outside], (0.0, 1.0)))
    assert np.all(weights[distance >= 9.0, 0] == 1.0)


def test_speed_of_a_change_neither_jumps_at_its_start_nor_at_its_end() -> None:
    change = (GaitTransition(1.0, 2.0, 1),)
    for edge in (1.0, 2.0):
        steps = []
        for fine in (1e-3, 0.5e-3):
            weights = way_weights(change, 2, edge + fine * np.arange(-1.0, 2.0))
            steps.append(np.abs(np.diff(weights[:, 1], 2)).max())
        assert steps[1] < 0.3 * steps[0]


def test_route_that_rises_is_swum_and_walked_where_it_comes_down() -> None:
    distance = np.linspace(0.0, 20.0, 400)
    height = 2.0 * np.exp(-((distance - 10.0) ** 2) / 8.0)
    up, down = transitions_by_height(distance, height, take_off=1.0, length=2.0)
    assert (up.way, down.way) == (1, 0)
    assert np.interp(up.middle, distance, height) == pytest.approx(1.0, abs=1e-3)
    assert up.middle + down.middle == pytest.approx(20.0, abs=0.05)


def test_hop_too_short_for_a_change_is_walked() -> None:
    distance = np.linspace(0.0, 20.0, 400)
    height = 2.0 * np.exp(-((distance - 10.0) ** 2) / 0.5)
    assert transitions_by_height(distance, height, take_off=1.0, length=2.0) == ()


def test_route_that_begins_high_is_swum_from_its_start() -> None:
    distance = np.linspace(0.0, 20.0, 400)
    first, last = transitions_by_height(distance, 3.0 - 0.2 * distance, take_off=1.0, length=2.0)
    assert first.end <= 0.0
    assert (first.way, last.way, last.middle) == (1, 0, pytest.approx(10.0))


holds = st.lists(st.floats(0.05, 1.0), min_size=0, max_size=30).map(
    lambda widths: (
        np.cumsum([0.0, *widths])[0:-1:2],
        np.cumsum([0.0, *widths])[1::2][: len(np.cumsum([0.0, *widths])[0:-1:2])],
    )
)


@given(st.lists(st.tuples(holds, holds), min_size=1, max_size=4), st.floats(0.5, 8.0))
def test_no_arm_goes_over_while_it_holds_on(
    arms: list[tuple[tuple[np.ndarray, np.ndarray], ...]], start: float
) -> None:
    change = GaitTransition(start, start + 2.0, 1)
    before, after = [each[0] for each in arms], [each[1] for each in arms]
    found = transition_windows(change, before, after)
    assert np.all(found.end - found.start >= 0.4 * 2.0 - 1e-9)
    assert np.all(found.start >= change.start - 1e-9)
    assert np.all(found.end <= change.end + 1e-9)
    for arm in range(len(arms)):
        (_, off), (on, _) = before[arm], after[arm]
        assert np.all(off[~found.dropped_before[arm]] <= found.start[arm] + 1e-9)
        assert np.all(on[~found.dropped_after[arm]] >= found.end[arm] - 1e-9)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ([GaitTransition(1.0, 3.0, 1), GaitTransition(2.0, 4.0, 0)], "Two changes of gait overlap"),
        ([GaitTransition(11.0, 13.0, 1)], "is not on the route"),
        ([GaitTransition(1.0, 1.0, 1)], "has no length"),
        ([GaitTransition(float("nan"), 1.0, 1)], "has no length"),
    ],
)
def test_senseless_changes_are_refused(changes: list[GaitTransition], told: str) -> None:
    with pytest.raises(SettingsError, match=told):
        check_transitions(changes, 10.0)
