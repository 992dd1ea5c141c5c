# SPDX-License-Identifier: GPL-3.0-or-later
"""What few keys are made of: moments between frames, joints that rest, slopes, curves, handles."""

from collections.abc import Generator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.keyframes import BezierKeys, reduce_keys
from octo_motion.core.keyframes.channels import values_at
from octo_motion.core.keyframes.curves import Curves
from octo_motion.core.keyframes.residuals import LinearModel, Residuals
from octo_motion.core.keyframes.search import Search
from octo_motion.core.keyframes.stretches import parts, searched
from octo_motion.core.keyframes.tracks import SCALE, Fine, Limb, Track, looked_at, with_halves
from octo_motion.core.rotations import (
    Floats,
    angle_between,
    continuous,
    from_rotation_vector,
    normalized,
)
from tests.core.keyframes.test_keys import LIMIT, an_arm, limb_of, seeds, swing, wandering


def resting_arm(seed: int, frames: int, *, room: float, stretching: bool = False) -> Limb:
    """An arm that swings, whose outer joints rest from a third of the time to two thirds."""
    random = np.random.default_rng(seed)
    _, bones, chain = an_arm(random, joints=5)
    phase = np.linspace(0.0, 6.0, frames)[:, None, None]
    turn = 0.3 * np.sin(phase * random.uniform(0.4, 1.0, (len(bones), 3)) + random.uniform(0, 6, 3))
    limb = limb_of(continuous(from_rotation_vector(turn)), angle=0.02, distance=0.05)
    held = np.full((frames, len(chain.turned)), np.inf)
    held[frames // 3 : 2 * frames // 3, 2:] = room
    limb = replace(limb, chain=chain, columns=range(len(bones)), room=held)
    if not stretching:
        return limb
    count = len(bones)
    along = 1.0 + 0.2 * np.sin(phase[:, 0] + np.arange(count))
    scales = [np.stack([each**-0.5, each, each**-0.5], axis=1) for each in along.T]
    handed = tuple(bool(each) for each in random.random(count) < 0.5)
    return replace(
        limb,
        tracks=[*limb.tracks, *(Track(each, SCALE) for each in scales)],
        columns=range(2 * count),
        chain=replace(chain, scaled=tuple(range(count, 2 * count)), handed=handed),
    )


def finished(steps: Generator[float, None, list[BezierKeys]]) -> list[BezierKeys]:
    """What comes of work that is done in steps."""
    while True:
        try:
            next(steps)
        except StopIteration as done:
            return done.value


# --- Moments between frames -----------------------------------------------------------------------


def test_between_frames_a_limb_goes_as_automatic_handles_play_it() -> None:
    times = np.arange(30.0)
    limb = resting_arm(1, 30, room=1e-3)
    fine = with_halves(times, limb)
    np.testing.assert_array_equal(fine.times, np.arange(0.0, 29.5, 0.5))
    np.testing.assert_array_equal(fine.allowed, fine.times == np.round(fine.times))
    for track, own in zip(fine.limb.tracks, limb.tracks, strict=True):
        np.testing.assert_array_equal(track.values[::2], own.values)
        # Half way a cubic is the mean of its ends and an eighth of what its slopes differ by;
        # a handle of Blender's is 1 / 2.5614 of the time long, where a cubic in time has a third.
        slopes = 0.5 * (own.values[2:] - own.values[:-2])
        bent = 0.125 * (3.0 / 2.5614) * (slopes[:-1] - slopes[1:])
        half = 0.5 * (own.values[1:-2] + own.values[2:-1]) + bent
        np.testing.assert_allclose(track.values[3:-2:2], half, atol=1e-12)


def test_half_way_a_joint_rests_if_it_does_before_and_after_and_bounds_are_the_closer_ones() -> (
    None
):
    limb = resting_arm(1, 30, room=1e-3)
    bound = np.linspace(0.02, 0.05, 30)
    fine = with_halves(np.arange(30.0), replace(limb, distance=bound))
    assert fine.limb.room is not None
    rests = np.isfinite(fine.limb.room)
    np.testing.assert_array_equal(rests[1::2], rests[:-2:2] & rests[2::2])
    np.testing.assert_array_equal(np.asarray(fine.limb.distance)[1::2], bound[:-1])


def test_what_moves_nothing_else_is_looked_at_on_frames_alone() -> None:
    times, limb = np.arange(20.0), limb_of(swing(20, 9.0))
    assert len(looked_at(times, limb, 1).times) == 20
    assert len(looked_at(times, replace(limb, lever=1.0), 1).times) == 39
    twos = looked_at(times[:-1], limb_of(swing(19, 9.0)), 2)
    np.testing.assert_array_equal(np.flatnonzero(twos.allowed), np.arange(0, 19, 2))


def test_keys_stand_where_they_are_allowed_alone() -> None:
    limb = limb_of(wandering(np.random.default_rng(5), 61, 2, 0.5))
    fine = Fine(np.arange(61.0), limb, np.arange(61) % 4 == 0)
    keyed = np.zeros((1, 61), dtype=bool)
    keyed[:, [0, -1]] = True
    (keys, _) = finished(Search(fine, keyed, np.ones((2, 61), dtype=bool)).found())
    assert set(keys.frames) <= set(range(0, 61, 4))


# --- Joints that rest -----------------------------------------------------------------------------


@settings(max_examples=15)
@given(seed=seeds, room=st.floats(2e-4, 5e-3), stretching=st.booleans())
def test_joints_that_rest_stay_within_their_room_between_frames_too(
    *, seed: int, room: float, stretching: bool
) -> None:
    times = np.arange(60.0)
    limb = resting_arm(seed, 60, room=room, stretching=stretching)
    (keys,) = reduce_keys(times, [limb])
    fine = with_halves(times, limb)
    own, joint = Residuals(fine.limb).measure([values_at(each, fine.times) for each in keys])
    # Single precision of values about 1, against the closest of these bounds.
    assert own.max() <= 1.001
    assert joint.max() <= 1.001


def test_room_costs_keys_only_where_it_is_close() -> None:
    def count(room: float) -> int:
        (keys,) = reduce_keys(np.arange(90.0), [resting_arm(3, 90, room=room)])
        return sum(map(len, keys))

    assert count(1e-4) > count(1e-3) >= count(1.0)


# --- The model ------------------------------------------------------------------------------------


@settings(max_examples=15)
@given(seed=seeds, stretching=st.booleans())
def test_the_model_tells_small_errors_as_they_are_measured(*, seed: int, stretching: bool) -> None:
    random = np.random.default_rng(seed)
    limb = resting_arm(seed, 12, room=2e-3, stretching=stretching)
    off = np.zeros((4, len(limb.tracks), 12))
    for place, track in enumerate(limb.tracks):
        width = track.values.shape[1]
        off[:width, place] = 1e-4 * random.normal(size=(width, 12))
    model, errors = LinearModel(limb), Residuals(limb)
    own, ends = (np.linalg.norm(each, axis=0) for each in model.errors(off.astype(np.float32)))
    moved = [
        track.values + off[: track.values.shape[1], place].T
        for place, track in enumerate(limb.tracks)
    ]
    measured, joint = errors.measure(moved)
    turned = [place for place, track in enumerate(limb.tracks) if track.kind != SCALE]
    # Second order: 1e-4 against bounds of 0.02 and 0.002.
    np.testing.assert_allclose(own[turned], measured[turned], rtol=0.02, atol=1e-4)
    np.testing.assert_allclose(ends.max(axis=0), joint, rtol=0.02, atol=1e-3)


@settings(max_examples=15)
@given(seed=seeds, stretching=st.booleans())
def test_pulls_are_the_transpose_of_errors(*, seed: int, stretching: bool) -> None:
    random = np.random.default_rng(seed)
    model = LinearModel(resting_arm(seed, 12, room=2e-3, stretching=stretching))
    off = random.normal(size=model.targets.shape).astype(np.float32)
    errors = model.errors(off)
    pulls = [random.normal(size=each.shape).astype(np.float32) for each in errors]
    none = np.zeros(off.shape[1:], dtype=np.float32)
    one = sum(float(np.vdot(a, b)) for a, b in zip(errors, pulls, strict=True))
    other = float(np.vdot(off, model.pull(off, pulls, none)))
    size = sum(float(np.abs(a * b).sum()) for a, b in zip(errors, pulls, strict=True))
    assert abs(one - other) <= 1e-4 * size


@settings(max_examples=20)
@given(seed=seeds, count=st.integers(3, 40))
def test_curves_with_more_keys_are_the_same_and_gathering_is_the_transpose(
    seed: int, count: int
) -> None:
    random = np.random.default_rng(seed)
    times = np.cumsum(random.uniform(0.5, 2.0, count))
    few, smooth = (random.random((3, count)) < share for share in (0.3, 0.5))
    few[:, [0, -1]] = True
    many = few | (random.random((3, count)) < 0.3)
    nowhere = np.zeros_like(few)
    before = Curves(times, few, smooth, nowhere, loops=False)
    after = Curves(times, many, nowhere, nowhere, loops=False)
    chosen = random.normal(size=(4, before.size))
    carried = after.carried_over(before, chosen)
    np.testing.assert_allclose(after.at_frames(carried), before.at_frames(chosen), atol=1e-9)
    pulls = random.normal(size=(4, 3, count)).astype(np.float32)
    single = chosen.astype(np.float32)
    one = float(np.vdot(before.spread(single), pulls))
    other = float(np.vdot(single, before.gathered(pulls)))
    assert abs(one - other) <= 1e-3 * np.linalg.norm(pulls) * np.linalg.norm(single)


# --- Laws -----------------------------------------------------------------------------------------


@settings(max_examples=20)
@given(st.integers(2, 300), st.integers(1, 4), seeds)
def test_what_never_moves_has_two_keys(count: int, bones: int, seed: int) -> None:
    turn = np.random.default_rng(seed).normal(size=(bones, 3))
    motion = np.repeat(from_rotation_vector(turn)[None], count, axis=0)
    (keys,) = reduce_keys(np.arange(float(count)), [replace(limb_of(motion), columns=range(bones))])
    assert [len(each) for each in keys] == [2] * bones


@settings(max_examples=10)
@given(seeds, st.integers(3, 30))
def test_next_to_no_tolerance_leaves_a_key_on_every_frame(seed: int, count: int) -> None:
    noise = np.random.default_rng(seed).normal(size=(count, 1, 3))
    motion = continuous(from_rotation_vector(noise))
    ((keys,),) = reduce_keys(np.arange(float(count)), [limb_of(motion, angle=1e-5)])
    assert len(keys) >= count - 1 if count > 3 else len(keys) >= 2
    off = angle_between(normalized(values_at(keys, np.arange(float(count)))), motion[:, 0])
    # Single precision of unit quaternions.
    assert off.max() <= 1e-5 + 1e-6


@settings(max_examples=10)
@given(seeds, st.integers(40, 160))
def test_few_keys_of_what_few_keys_play_are_hardly_more(seed: int, count: int) -> None:
    """What was reduced once can be reduced again to as many keys: its own would do."""
    times = np.arange(float(count))
    motion = wandering(np.random.default_rng(seed), count, 1, 0.0)
    ((once,),) = reduce_keys(times, [limb_of(motion)])
    played = normalized(values_at(once, times))[:, None]
    ((again,),) = reduce_keys(times, [limb_of(played)])
    assert len(again) <= len(once) + max(2, len(once) // 5)
    assert angle_between(normalized(values_at(again, times)), played[:, 0]).max() <= LIMIT * 1.001


# --- Long shots -----------------------------------------------------------------------------------


def long_arm(frames: int) -> Limb:
    """An arm of four bones that swings, each its own way, and is where it was after all frames."""
    _, bones, chain = an_arm(np.random.default_rng(2), joints=5)
    share = np.linspace(0.0, 2.0 * np.pi, frames)[:, None, None]
    cycles = np.arange(frames // 30, frames // 30 + 3 * len(bones)).reshape(len(bones), 3)
    turn = 0.25 * np.sin(share * cycles + cycles)
    limb = limb_of(continuous(from_rotation_vector(turn)), angle=0.01, distance=0.02)
    return replace(limb, chain=chain, columns=range(len(bones)))


def slopes(keys: BezierKeys) -> tuple[Floats, Floats]:
    """Before and after keys (keys, components)."""
    at = np.stack(np.broadcast_arrays(keys.frames[:, None], keys.values), axis=-1)
    left = (at - keys.left).astype(np.float64)
    right = (keys.right - at).astype(np.float64)
    return left[..., 1] / left[..., 0], right[..., 1] / right[..., 0]


@pytest.mark.parametrize("loops", [False, True])
def test_a_shot_that_is_cut_keeps_its_bounds_and_goes_on_in_one_line(*, loops: bool) -> None:
    times = np.arange(1701.0)
    limb = long_arm(1701)
    (found,) = reduce_keys(times, [limb], loops=loops)
    fine = with_halves(times, limb)
    own, joint = Residuals(fine.limb).measure([values_at(each, fine.times) for each in found])
    assert max(own.max(), joint.max()) <= 1.001
    for keys in found:
        # The motion has no corner, and neither have its keys, those at cuts among them.
        assert keys.smooth[1:-1].all()
        before, after = slopes(keys)
        np.testing.assert_allclose(before[1:-1], after[1:-1], atol=1e-4)
        assert (np.diff(keys.frames) > 0.0).all()
        if loops:
            np.testing.assert_allclose(before[-1], after[0], atol=1e-4)


def test_cutting_a_shot_adds_hardly_a_key() -> None:
    def per_frame(count: int) -> float:
        (found,) = reduce_keys(
            np.arange(float(count)), [long_arm(1701).at(np.arange(1701) < count)]
        )
        return sum(map(len, found)) / count

    assert per_frame(1701) <= 1.03 * per_frame(500)


def test_what_hardly_moves_is_not_cut_however_long_it_is() -> None:
    fine = looked_at(np.arange(3000.0), limb_of(swing(3000, 1500.0)), 1)
    keyed = np.zeros((1, 3000), dtype=bool)
    keyed[:, [0, 700, 1500, 2200, -1]] = True
    corners = np.zeros((1, 3000), dtype=bool)
    (part,) = parts(fine, keyed, corners)
    (keys,), _ = searched(part)
    (whole,) = finished(Search(fine, keyed, corners).found())
    np.testing.assert_array_equal(keys.frames, whole.frames)


# --- Keys on every frame --------------------------------------------------------------------------


def test_handles_of_keys_on_every_frame_follow_what_is_known_between_them() -> None:
    moments = np.arange(0.0, 200.5, 0.5)
    motion = swing(len(moments), 13.0, reach=1.0)
    ((keys,),) = reduce_keys(moments, [limb_of(motion)], every=2, all_of_them=True)
    np.testing.assert_array_equal(keys.frames, np.arange(201.0))
    off = angle_between(normalized(values_at(keys, moments)), motion[:, 0])
    # A period of 6.5 frames: automatic handles are off by some degrees half way.
    assert off.max() <= 0.2 * LIMIT
    assert keys.smooth[1:-1].all()


def test_a_jump_between_two_keys_breaks_handles_near_it_alone() -> None:
    moments = np.arange(0.0, 60.5, 0.5)
    motion = from_rotation_vector(jumping(moments))[:, None]
    ((keys,),) = reduce_keys(moments, [limb_of(motion)], every=2, all_of_them=True)
    off = angle_between(normalized(values_at(keys, moments)), motion[:, 0])
    assert off.max() <= LIMIT
    corners = np.flatnonzero(~keys.smooth[1:-1]) + 1
    assert len(corners) > 0
    assert np.abs(corners - 30.5).max() < 8.0


def jumping(moments: Floats) -> Floats:
    """Rotation vectors of a slow swing with one moment that stands out, between two frames."""
    turns = 0.2 * np.sin(0.2 * moments)
    turns[61] += 0.3
    return np.stack([turns, 0.0 * turns, 0.0 * turns], axis=1)
