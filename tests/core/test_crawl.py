# SPDX-License-Identifier: GPL-3.0-or-later
"""A crawl as Levy, Flash & Hochner (2015) saw it: which arms hold, push and search."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.errors import SettingsError
from octo_motion.core.locomotion.crawl import CrawlSettings, Holds, Journey, plan_crawl

EIGHT = np.radians([22.5, -22.5, 67.5, -67.5, 112.5, -112.5, 157.5, -157.5])

journeys = st.builds(
    lambda facing, bend, length, arms: journey(facing, bend, length, EIGHT[:arms]),
    st.floats(-np.pi, np.pi),
    st.floats(-0.6, 0.6),
    st.floats(0.5, 8.0),
    st.integers(3, 8),
)


def journey(
    facing: float = 0.0, bend: float = 0.0, length: float = 6.0, azimuths: np.ndarray = EIGHT
) -> Journey:
    """A way of even curvature, the body turned away from it by an angle; arms one metre long."""
    distance = np.arange(0.0, length, 0.02)
    heading = bend * distance
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    body = np.cumsum(ahead, axis=0) * 0.02
    turned = heading[:, None] + facing + azimuths
    outward = np.stack([np.cos(turned), np.sin(turned)], axis=-1)
    return Journey(distance, body[:, None] + 0.12 * outward, outward, ahead, 1.0)


def holding(holds: Holds, distance: np.ndarray) -> np.ndarray:
    """(samples, holds)"""
    return (holds.start <= distance[:, None]) & (distance[:, None] < holds.end)


@given(journeys, st.integers(0, 9))
def test_an_arm_lets_go_before_it_takes_hold_again(way: Journey, seed: int) -> None:
    holds = plan_crawl(way, CrawlSettings(seed=seed))
    assert np.all(holds.end > holds.start)
    same = holds.arm[1:] == holds.arm[:-1]
    assert np.all(holds.start[1:][same] > holds.end[:-1][same])


@given(journeys, st.integers(0, 9))
def test_every_hold_is_within_reach_while_it_lasts(way: Journey, seed: int) -> None:
    holds = plan_crawl(way, CrawlSettings(seed=seed))
    settings = CrawlSettings()
    for number, on in enumerate(holding(holds, way.distance).T):
        if holds.start[number] < 0.0 or np.count_nonzero(on) < 2:
            continue
        reach = holds.place[number] - way.roots[on, holds.arm[number]]
        away = np.linalg.norm(reach, axis=1)
        assert away.max() <= 1.06 * settings.far + 0.02
        assert away.min() >= 0.85 * settings.near - 0.02


@pytest.mark.parametrize("facing", np.radians([0.0, 90.0, 180.0, 45.0]))
def test_whichever_way_it_faces_the_arms_behind_push(facing: float) -> None:
    way = journey(facing)
    holds = plan_crawl(way, CrawlSettings())
    behind = -way.outward[0, holds.arm] @ way.ahead[0]
    np.testing.assert_array_equal(holds.pushes, behind >= np.cos(CrawlSettings().pushing))
    seen = holds.start > 0.0
    pushes, supports = holds.pushes & seen, ~holds.pushes & seen
    # A pushing arm gets longer: its hold ends farther from its root than it began.
    for number in np.flatnonzero(pushes & (holds.end < way.distance[-1])):
        first, last = np.searchsorted(way.distance, [holds.start[number], holds.end[number]])
        roots = way.roots[[first, min(last, len(way.distance) - 1)], holds.arm[number]]
        near, far = np.linalg.norm(holds.place[number] - roots, axis=1)
        assert far > near
    share = holding(holds, way.distance)
    each_push = share[:, pushes].sum() / len(set(holds.arm[pushes]))
    each_support = share[:, supports].sum() / len(set(holds.arm[supports]))
    assert each_push > 1.1 * each_support


@pytest.mark.parametrize("facing", np.radians([0.0, 90.0, 180.0]))
def test_nearly_always_three_arms_hold_and_one_pushes(facing: float) -> None:
    way = journey(facing)
    for seed in range(8):
        holds = plan_crawl(way, CrawlSettings(seed=seed))
        on = holding(holds, way.distance)
        assert on.sum(axis=1).min() >= 1
        assert np.mean(on.sum(axis=1) >= 3) > 0.9
        assert np.mean(on[:, holds.pushes].any(axis=1)) > 0.95


def test_the_crawl_has_no_rhythm() -> None:
    way = journey(length=20.0)
    holds = plan_crawl(way, CrawlSettings())
    for arm in range(8):
        starts = holds.start[holds.arm == arm]
        steps = np.diff(starts)
        assert steps.std() > 0.1 * steps.mean()


def test_same_seed_same_crawl_another_seed_another() -> None:
    way = journey()
    first, again, other = (plan_crawl(way, CrawlSettings(seed=seed)) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.start, again.start)
    np.testing.assert_array_equal(first.place, again.place)
    assert first.start.shape != other.start.shape or np.any(first.start != other.start)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"near": 0.9}, "Let them take hold nearer than they let go."),
        ({"pause": (0.5, 0.2)}, "Exchange the two."),
        ({"far": float("nan")}, "is not a number above 0"),
    ],
)
def test_senseless_settings_are_refused(change: dict[str, Any], told: str) -> None:
    with pytest.raises(SettingsError, match=told):
        CrawlSettings(**change)


def test_journey_of_no_length_is_refused() -> None:
    way = journey(length=0.01)
    with pytest.raises(SettingsError, match="The crawl has nowhere to go"):
        plan_crawl(way, CrawlSettings())
