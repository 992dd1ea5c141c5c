# SPDX-License-Identifier: GPL-3.0-or-later
"""A crawl as Levy, Flash & Hochner (2015) saw it: which arms hold, push and search."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.errors import SettingsError
from octo_motion.core.locomotion.ground.crawl_planner import (
    CrawlPath,
    CrawlSettings,
    CrawlStances,
    Outline,
    plan_crawl,
)
from octo_motion.core.locomotion.ground.footholds import span
from octo_motion.core.locomotion.ground.surface import StanceSettings

EIGHT = np.radians([22.5, -22.5, 67.5, -67.5, 112.5, -112.5, 157.5, -157.5])

tried = settings(max_examples=40)
"""Each plan has some hundred holds already."""
journeys = st.builds(
    lambda facing, bend, length, arms: journey(facing, bend, length, EIGHT[:arms]),
    st.floats(-np.pi, np.pi),
    st.floats(-0.6, 0.6),
    st.floats(0.5, 8.0),
    st.integers(3, 8),
)


def journey(
    facing: float = 0.0, bend: float = 0.0, length: float = 6.0, azimuths: np.ndarray = EIGHT
) -> CrawlPath:
    """A way of even curvature, the body turned away from it by an angle; arms one metre long."""
    distance = np.arange(0.0, length, 0.02)
    heading = bend * distance
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    body = np.cumsum(ahead, axis=0) * 0.02
    turned = heading[:, None] + facing + azimuths
    outward = np.stack([np.cos(turned), np.sin(turned)], axis=-1)
    return CrawlPath(distance, body[:, None] + 0.12 * outward, outward, ahead, 1.0)


def corner(facing: float, azimuths: np.ndarray = EIGHT) -> CrawlPath:
    """A way that turns left by a quarter within a fifth of an arm length."""
    distance = np.arange(0.0, 5.0, 0.02)
    heading = 0.5 * np.pi * np.clip((distance - 2.5) / 0.2 + 0.5, 0.0, 1.0)
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    turned = heading[:, None] + facing + azimuths
    outward = np.stack([np.cos(turned), np.sin(turned)], axis=-1)
    body = np.cumsum(ahead, axis=0) * 0.02
    return CrawlPath(distance, body[:, None] + 0.12 * outward, outward, ahead, 1.0)


def nearest(way: CrawlPath, holds: CrawlStances) -> float:
    """How near arms that hold on come to each other, seen from above."""
    middles = np.clip(0.5 * (holds.start + holds.end), 0.0, way.distance[-1])
    then = np.searchsorted(way.distance, middles)
    reach = holds.place - way.roots[then, holds.arm]
    reach /= np.linalg.norm(reach, axis=1, keepdims=True)
    tips = holds.place + CrawlSettings().planted * reach
    found = np.inf
    for sample, on in list(enumerate(holding(holds, way.distance)))[::5]:
        roots = way.roots[sample, holds.arm[on]]
        points = Outline(roots, holds.place[on], tips[on]).points()
        apart = np.linalg.norm(points[:, None, :, None] - points[None, :, None], axis=-1)
        apart[np.diag_indices(len(points))] = np.inf
        found = min(found, float(apart.min(initial=np.inf)))
    return found


def holding(holds: CrawlStances, distance: np.ndarray) -> np.ndarray:
    """(samples, holds)"""
    return (holds.start <= distance[:, None]) & (distance[:, None] < holds.end)


@tried
@given(journeys, st.integers(0, 9))
def test_an_arm_lets_go_before_it_takes_hold_again(way: CrawlPath, seed: int) -> None:
    holds = plan_crawl(way, CrawlSettings(seed=seed))
    assert np.all(holds.end > holds.start)
    same = holds.arm[1:] == holds.arm[:-1]
    assert np.all(holds.start[1:][same] > holds.end[:-1][same])


@tried
@given(journeys, st.integers(0, 9))
def test_every_hold_is_within_reach_while_it_lasts(way: CrawlPath, seed: int) -> None:
    holds = plan_crawl(way, CrawlSettings(seed=seed))
    asked = CrawlSettings()
    for number, on in enumerate(holding(holds, way.distance).T):
        if holds.start[number] < 0.0 or np.count_nonzero(on) < 2:
            continue
        reach = holds.place[number] - way.roots[on, holds.arm[number]]
        away = np.linalg.norm(reach, axis=1)
        assert away.max() <= 1.06 * asked.far + 0.02
        assert away.min() >= 0.85 * asked.near - 0.02


@pytest.mark.parametrize("facing", np.radians([0.0, 90.0, 180.0, 45.0]))
def test_whichever_way_it_faces_the_arms_behind_push(facing: float) -> None:
    way = journey(facing)
    holds = plan_crawl(way, CrawlSettings())
    behind = -way.outward[0, holds.arm] @ way.ahead[0]
    np.testing.assert_array_equal(holds.pushes, behind >= np.cos(np.radians(70.0)))
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
        assert on.sum(axis=1).min() >= 2
        assert np.mean(on.sum(axis=1) >= 3) > 0.98
        assert np.mean(on[:, holds.pushes].any(axis=1)) > 0.97


@tried
@given(journeys, st.integers(0, 9))
def test_every_hold_lasts_and_every_swing_has_its_time(way: CrawlPath, seed: int) -> None:
    holds = plan_crawl(way, CrawlSettings(seed=seed))
    assert np.all(holds.end - holds.start >= 0.16 - 1e-9)
    same = holds.arm[1:] == holds.arm[:-1]
    swings = (holds.start[1:] - holds.end[:-1])[same]
    assert np.all(swings >= 0.2 - 1e-9)


@tried
@given(journeys, st.integers(0, 9))
def test_the_plan_says_where_an_arm_takes_hold_as_seen_from_its_root(
    way: CrawlPath, seed: int
) -> None:
    holds = plan_crawl(way, CrawlSettings(seed=seed))
    inside = 0.5 * (holds.start + holds.end)
    seen = (inside > 0.0) & (inside < way.distance[-1])
    for number in np.flatnonzero(seen):
        then, arm = np.searchsorted(way.distance, inside[number]), holds.arm[number]
        reach = holds.place[number] - way.roots[then, arm]
        outward = way.outward[then, arm]
        turn = np.arctan2(outward[0] * reach[1] - outward[1] * reach[0], outward @ reach)
        # The journey is known at every fiftieth of an arm length.
        assert abs(turn - holds.turn[number]) < 0.06
        assert abs(np.hypot(*reach) - holds.away[number]) < 0.03


@pytest.mark.parametrize("many", [8, 12])
@pytest.mark.parametrize("facing", np.radians([0.0, 90.0, 180.0]))
def test_arms_that_hold_on_at_a_time_do_not_lie_on_each_other(facing: float, many: int) -> None:
    azimuths = EIGHT if many == 8 else np.linspace(-np.pi, np.pi, many, endpoint=False)
    way = corner(facing, azimuths)
    for seed in range(6):
        # An arm is some twentieth of its length thick where it lies.
        assert nearest(way, plan_crawl(way, CrawlSettings(seed=seed))) > 0.07


@pytest.mark.parametrize("length", [0.8, 1.5, 6.0])
def test_a_body_that_stands_has_all_arms_on_the_ground(length: float) -> None:
    for seed in range(8):
        way = replace(journey(length=length), stands=(True, True))
        holds = plan_crawl(way, CrawlSettings(seed=seed))
        on = holding(holds, way.distance)
        last = way.distance[-1]
        for sample, at in ((0, 0.0), (-1, last)):
            assert set(holds.arm[on[sample]]) == set(range(8))
            share = ((at - holds.start) / (holds.end - holds.start))[on[sample]]
            # None of them has only just touched, and hardly one is peeled off yet.
            assert share.min() > 0.25
            assert share.max() < 0.7
        # They let go one after the other.
        assert len(set(np.round(holds.end[on[0]], 6))) == 8
        assert on.sum(axis=1).min() >= 2
        # And the last ones lie down in time, with a swing before it that is no twitch.
        same = holds.arm[1:] == holds.arm[:-1]
        assert np.all((holds.start[1:] - holds.end[:-1])[same] > 0.13)
        assert (last - holds.start[on[-1]]).min() > 0.05


def winding(seed: int) -> CrawlPath:
    """A way full of corners, at whose ends the body stands."""
    random = np.random.default_rng(seed)
    count = int(random.integers(60, 300))
    corners = np.where(random.random(count) < 0.05, random.normal(size=count), 0.0)
    heading = np.convolve(np.pad(corners.cumsum(), 5, mode="edge"), np.full(11, 1 / 11), "valid")
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    body = np.cumsum(ahead, axis=0) * 0.02
    azimuths = EIGHT[: int(random.integers(2, 9))]
    turned = heading[:, None] + random.uniform(-np.pi, np.pi) + azimuths
    outward = np.stack([np.cos(turned), np.sin(turned)], axis=-1)
    distance = np.linspace(0.0, 0.02 * (count - 1), count)
    roots = body[:, None] + 0.12 * outward
    return CrawlPath(distance, roots, outward, ahead, 1.0, stands=(True, True))


@given(st.integers(0, 2**31), st.sampled_from([0.3, 0.6, 0.8]))
@tried
def test_coming_to_rest_every_hold_still_ends_after_it_begins(seed: int, planted: float) -> None:
    way = winding(seed)
    settings = CrawlSettings(*span(StanceSettings(planted=planted), may_stretch=False), seed=seed)
    holds = plan_crawl(way, settings)
    # As the body comes to rest, too, an arm has at least the way that it needs to lie down, but
    # for those that lie there as it gets going, or are cut down by a corner.
    assert np.min(holds.end - holds.start) >= 0.05
    after = holds.arm[1:] == holds.arm[:-1]
    assert np.all(holds.start[1:][after] > holds.end[:-1][after])


@pytest.mark.parametrize(("near", "far"), [(0.47, 0.4701), (0.01, 0.02), (0.4, 0.44)])
@pytest.mark.parametrize("arms", [1, 2, 8])
def test_a_crawl_of_short_holds_comes_to_its_end(near: float, far: float, arms: int) -> None:
    way = replace(journey(azimuths=EIGHT[:arms]), stands=(True, True))
    holds = plan_crawl(way, CrawlSettings(near, far))
    assert np.all(holds.end > holds.start)


def test_arms_that_may_stretch_take_hold_farther_out_and_hold_on_longer() -> None:
    (near, far), (nearer, less_far) = (
        span(StanceSettings(), may_stretch=each) for each in (True, False)
    )
    assert nearer < near < less_far < far
    assert far - near > less_far - nearer
    # Of its free part: nearer a knee folds, and what cannot get longer ends there.
    free = 1.0 - StanceSettings().planted
    assert near / free > 0.68
    assert less_far / free < 0.95


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
