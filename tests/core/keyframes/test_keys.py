# SPDX-License-Identifier: GPL-3.0-or-later
"""Few keys that stay within their bounds at every frame, as Blender will play them back."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from octo_motion.core.errors import SettingsError
from octo_motion.core.keyframes import (
    LOCATION,
    SCALE,
    BezierKeys,
    Limb,
    LimbChain,
    Track,
    chain_to_tip,
    reduce_keys,
)
from octo_motion.core.rotations import (
    Floats,
    angle_between,
    continuous,
    from_axis_angle,
    from_euler,
    from_rotation_vector,
    normalized,
)
from octo_motion.core.skeleton import Skeleton
from tests.core.rigs import body_with_arms

pytestmark = pytest.mark.one_blender

LIMIT = np.radians(0.5)
FAR = 1e9
seeds = st.integers(0, 2**31)


def played(keys: BezierKeys, times: Floats) -> Floats:
    """The curves of a track at some frames, (frames, components).

    Where a cubic in time reaches a frame is found by halving, as no other code here does.
    """
    result = np.empty((len(times), keys.values.shape[1]))
    span = np.clip(np.searchsorted(keys.frames, times, side="right") - 1, 0, len(keys) - 2)
    for component in range(result.shape[1]):
        points = np.array([
            [keys.frames[span], keys.values[span, component]],
            keys.right[span, component].T,
            keys.left[span + 1, component].T,
            [keys.frames[span + 1], keys.values[span + 1, component]],
        ]).astype(np.float64)  # fmt: skip
        low, high = np.zeros(len(times)), np.ones(len(times))
        for _ in range(60):
            middle = 0.5 * (low + high)
            early = bezier(points[:, 0], middle) < times
            low, high = np.where(early, middle, low), np.where(early, high, middle)
        result[:, component] = bezier(points[:, 1], high)
    return result


def bezier(points: Floats, share: Floats) -> Floats:
    rest = 1.0 - share
    return (
        rest**3 * points[0]
        + 3.0 * rest**2 * share * points[1]
        + 3.0 * rest * share**2 * points[2]
        + share**3 * points[3]
    )


def wandering(random: np.random.Generator, frames: int, bones: int, rough: float) -> Floats:
    """Rotations (frames, bones, 4) that swing to and fro, with a jolt here and there."""
    phase = np.linspace(0.0, random.uniform(1.0, 20.0), frames)[:, None, None]
    turn = 0.5 * np.sin(phase * random.uniform(0.2, 1.0, (bones, 3)) + random.uniform(0, 6, 3))
    jolts = np.cumsum(random.random((frames, bones, 1)) < 0.05, axis=0) % 2
    return continuous(from_rotation_vector(turn + rough * jolts * random.normal(size=3)))


def limb_of(rotations: Floats, *, angle: float = LIMIT, distance: float = FAR) -> Limb:
    tracks = [Track(rotations[:, bone], "QUATERNION") for bone in range(rotations.shape[1])]
    return Limb(tracks, angle, distance)


def swing(frames: int, period: float, reach: float = 0.5) -> Floats:
    turns = reach * np.sin(2.0 * np.pi * np.arange(frames) / period)
    return from_axis_angle([1.0, 0.0, 0.0], turns)[:, None]


def an_arm(random: np.random.Generator, joints: int = 7) -> tuple[Skeleton, list[str], LimbChain]:
    skeleton, arms, _ = body_with_arms(arms=1, joints=joints, rolls=random)
    return skeleton, list(arms[0].bones), chain_to_tip(skeleton, arms[0].bones)


# --- Bounds ---------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(seeds, st.integers(2, 150), st.integers(1, 4), st.floats(0.05, 5.0), st.floats(0.0, 1.0))
def test_every_bone_is_within_the_angle_at_every_frame(
    seed: int, count: int, bones: int, degrees: float, rough: float
) -> None:
    frames = np.arange(7.0, count + 7.0)
    motion = wandering(np.random.default_rng(seed), count, bones, rough)
    (keys,) = reduce_keys(frames, [limb_of(motion, angle=np.radians(degrees))])
    for bone, track in enumerate(keys):
        off = angle_between(normalized(played(track, frames)), motion[:, bone])
        assert off.max() <= np.radians(degrees) * (1.0 + 1e-6)


@settings(max_examples=30)
@given(seeds, st.floats(1e-4, 0.05))
# Of which one bone cannot make up for the others.
@example(seed=2460, distance=1e-4)
def test_the_tip_is_within_the_distance_at_every_frame(seed: int, distance: float) -> None:
    random = np.random.default_rng(seed)
    skeleton, bones, chain = an_arm(random)
    motion = wandering(random, 80, len(bones), 0.3)
    dense = limb_of(motion, angle=0.2, distance=distance)
    (keys,) = reduce_keys(np.arange(80.0), [Limb(dense.tracks, 0.2, distance, chain=chain)])
    kept = np.stack([normalized(played(track, np.arange(80.0))) for track in keys], axis=1)
    off = np.linalg.norm(tips(skeleton, bones, kept) - tips(skeleton, bones, motion), axis=1)
    assert off.max() <= distance * (1.0 + 1e-6)


def tips(skeleton: Skeleton, bones: list[str], rotations: Floats) -> Floats:
    """By the skeleton's own forward kinematics: another way than the one that is tested."""
    basis = np.tile([1.0, 0.0, 0.0, 0.0], (len(rotations), len(skeleton), 1))
    order = [skeleton.index[name] for name in bones]
    basis[:, order] = rotations
    turned, heads = skeleton.pose(basis)
    matrix = 2.0 * turned[:, order[-1], [1, 2, 3]] * turned[:, order[-1], [2, 2, 2]]
    w, x, y, z = turned[:, order[-1]].T
    matrix = np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], axis=1)
    return heads[:, order[-1]] + matrix * skeleton.lengths[order[-1]]


@pytest.mark.parametrize("kind", ["AXIS_ANGLE", "XYZ", "ZXY"])
def test_other_rotation_modes_are_measured_as_rotations(kind: str) -> None:
    frames = np.arange(120.0)
    if kind == "AXIS_ANGLE":
        axes = normalized(np.column_stack([np.cos(0.05 * frames), np.sin(0.05 * frames), frames]))
        values = np.column_stack([np.sin(0.2 * frames), axes])
    else:
        values = np.sin(0.1 * frames[:, None] * [1.0, 0.7, 1.3]) * [2.0, 0.8, 3.0]

    def rotations(values: Floats) -> Floats:
        if kind == "AXIS_ANGLE":
            return from_axis_angle(normalized(values[:, 1:]), values[:, 0])
        return from_euler(values, kind)

    ((keys,),) = reduce_keys(frames, [Limb([Track(values, kind)], LIMIT, FAR)])
    off = angle_between(rotations(played(keys, frames)), rotations(values))
    assert off.max() <= LIMIT * (1.0 + 1e-6)
    assert len(keys) < 60


@settings(max_examples=30)
@given(seeds, st.floats(1e-3, 0.1), st.floats(0.0, 2.0))
def test_travel_and_what_it_carries_are_within_the_distance(
    seed: int, distance: float, lever: float
) -> None:
    random = np.random.default_rng(seed)
    frames = np.arange(90.0)
    places = np.cumsum(random.normal(0.0, 0.1, (90, 3)), axis=0)
    turns = wandering(random, 90, 1, 0.2)[:, 0]
    limb = Limb([Track(places, "LOCATION"), Track(turns, "QUATERNION")], 0.1, distance, lever)
    ((place, turn),) = reduce_keys(frames, [limb])
    angles = angle_between(normalized(played(turn, frames)), turns)
    away = np.linalg.norm(played(place, frames) - places, axis=1)
    assert (away + lever * angles).max() <= distance * (1.0 + 1e-3)
    assert angles.max() <= 0.1 * (1.0 + 1e-6)
    np.testing.assert_array_equal(place.frames, turn.frames)


@pytest.mark.parametrize("start", [-5_000.0, 0.25, 120_000.0, 1_000_000.0])
def test_bounds_hold_where_single_precision_frames_are_coarse(start: float) -> None:
    frames = start + np.arange(200.0)
    motion = swing(200, 23.0, reach=1.5)
    ((keys,),) = reduce_keys(frames, [limb_of(motion, angle=np.radians(0.1))])
    kept = normalized(played(keys, frames.astype(np.float32).astype(np.float64)))
    assert angle_between(kept, motion[:, 0]).max() <= np.radians(0.1) * (1.0 + 1e-6)
    assert len(keys) < 100


# --- What an animator sees ------------------------------------------------------------------------


@settings(max_examples=40)
@given(seed=seeds, count=st.integers(2, 100), shared=st.booleans())
def test_keys_stand_on_frames_and_the_motion_begins_and_ends_exactly(
    *, seed: int, count: int, shared: bool
) -> None:
    frames = np.arange(1.0, count + 1.0)
    motion = wandering(np.random.default_rng(seed), count, 3, 0.5)
    columns = None if shared else range(3)
    (keys,) = reduce_keys(frames, [replace(limb_of(motion), columns=columns)])
    for bone, track in enumerate(keys):
        if shared:
            np.testing.assert_array_equal(track.frames, keys[0].frames)
        places = np.searchsorted(frames, track.frames)
        np.testing.assert_array_equal(frames[places], track.frames)
        assert angle_between(normalized(track.values), motion[places, bone]).max() <= LIMIT
        ends = motion[[0, -1], bone].astype(np.float32)
        np.testing.assert_array_equal(track.values[[0, -1]], ends)
        assert track.frames[0] == frames[0]
        assert track.frames[-1] == frames[-1]
        assert (np.diff(track.frames) > 0.0).all()


@settings(max_examples=40)
@given(seeds, st.integers(2, 100))
def test_handles_stand_on_their_side_of_the_key_within_the_span(seed: int, count: int) -> None:
    motion = wandering(np.random.default_rng(seed), count, 2, 0.5)
    (keys,) = reduce_keys(np.arange(1.0, count + 1.0), [limb_of(motion)])
    for track in keys:
        at = track.frames[:, None]
        assert (track.left[..., 0] < at).all()
        assert (track.right[..., 0] > at).all()
        assert (track.left[1:, :, 0] > at[:-1]).all()
        assert (track.right[:-1, :, 0] < at[1:]).all()
        assert np.isfinite(track.left).all()
        assert np.isfinite(track.right).all()


@settings(max_examples=40)
@given(seeds)
def test_smooth_keys_have_handles_in_one_line(seed: int) -> None:
    motion = wandering(np.random.default_rng(seed), 100, 2, 0.3)
    (keys,) = reduce_keys(np.arange(100.0), [limb_of(motion)])
    for track in keys:
        before = track.values - track.left[..., 1]
        before /= track.frames[:, None] - track.left[..., 0]
        after = track.right[..., 1] - track.values
        after /= track.right[..., 0] - track.frames[:, None]
        np.testing.assert_allclose(before[track.smooth], after[track.smooth], rtol=1e-4, atol=1e-5)


def test_a_smooth_motion_has_smooth_keys_alone() -> None:
    (keys,) = reduce_keys(np.arange(241.0), [limb_of(swing(241, 60.0))])
    assert keys[0].smooth[1:-1].mean() > 0.8


def test_a_jolt_is_a_corner_on_its_frame() -> None:
    turns = np.abs(np.arange(100) - 40.0) * 0.02
    motion = from_axis_angle([0.0, 0.0, 1.0], turns)[:, None]
    ((keys,),) = reduce_keys(np.arange(100.0), [limb_of(motion, angle=np.radians(0.1))])
    assert 40.0 in keys.frames
    assert not keys.smooth[list(keys.frames).index(40.0)]
    assert len(keys) <= 8


# --- How few --------------------------------------------------------------------------------------


def test_what_stays_or_moves_as_one_cubic_has_two_keys() -> None:
    frames = np.arange(60.0)
    still = np.tile([1.0, 2.0, 3.0], (60, 1))
    share = frames[:, None] / 59.0
    cubic = share**3 * [4.0, 0.0, 1.0] - share * [0.0, 5.0, 2.0]
    for values in (still, cubic):
        limb = Limb([Track(values, "LOCATION")], LIMIT, 1e-3)
        ((keys,),) = reduce_keys(frames, [limb])
        assert len(keys) == 2


def test_a_swing_has_a_few_keys_for_each_period() -> None:
    ((keys,),) = reduce_keys(np.arange(481.0), [limb_of(swing(481, 48.0))])
    # Two to four cubics make a period of a sine; ten periods.
    assert len(keys) <= 45


def test_wider_bounds_have_no_more_keys() -> None:
    motion = swing(481, 48.0)
    counts = [
        len(reduce_keys(np.arange(481.0), [limb_of(motion, angle=np.radians(each))])[0][0])
        for each in (0.05, 0.2, 0.8, 3.2)
    ]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > counts[-1]


def test_bones_with_key_frames_of_their_own_have_fewer_keys() -> None:
    turns = np.sin(2.0 * np.pi * (np.arange(241)[:, None] / [40.0, 67.0, 96.0] + [0.0, 0.3, 0.7]))
    motion = from_axis_angle([1.0, 0.0, 0.0], 0.6 * turns)
    limb = limb_of(motion)
    (arm,) = reduce_keys(np.arange(241.0), [limb])
    (bones,) = reduce_keys(np.arange(241.0), [replace(limb, columns=range(3))])
    assert sum(map(len, bones)) < 0.75 * sum(map(len, arm))
    assert len({len(each) for each in bones}) > 1


def test_bones_make_up_for_each_other_at_the_tip() -> None:
    """With bounds for its bones alone a tip would be off by more than half as much again."""
    random = np.random.default_rng(3)
    skeleton, bones, chain = an_arm(random)
    frames = np.arange(161.0)
    phases = random.uniform(0.0, 6.0, (len(bones), 3))
    turn = 0.4 * np.sin(0.2 * frames[:, None, None] + phases)
    motion = continuous(from_rotation_vector(turn))
    free = replace(limb_of(motion), chain=chain, columns=range(len(bones)))

    def off(keys: list[BezierKeys]) -> float:
        kept = np.stack([normalized(played(track, frames)) for track in keys], axis=1)
        gone = tips(skeleton, bones, kept) - tips(skeleton, bones, motion)
        return float(np.linalg.norm(gone, axis=1).max())

    (loose,) = reduce_keys(frames, [replace(free, chain=None)])
    bound = 0.6 * off(loose)
    (tight,) = reduce_keys(frames, [replace(free, distance=bound)])
    assert off(tight) <= bound * (1.0 + 1e-6)
    assert sum(map(len, tight)) < 1.15 * sum(map(len, loose))


# --- Stretching and loops -------------------------------------------------------------------------


@settings(max_examples=20)
@given(seeds, st.floats(1e-3, 0.05))
def test_what_stretches_keeps_its_tip_and_its_scales(seed: int, distance: float) -> None:
    random = np.random.default_rng(seed)
    skeleton, bones, chain = an_arm(random, joints=4)
    frames = np.arange(70.0)
    motion = wandering(random, 70, len(bones), 0.2)
    along = 1.0 + 0.4 * np.sin(0.2 * frames[:, None] + random.uniform(0.0, 6.0, len(bones)))
    scales = np.stack([along**-0.5, along, along**-0.5], axis=2)
    handed = [bool(each) for each in random.random(len(bones)) < 0.5]
    count = len(bones)
    chain = replace(chain, scaled=tuple(range(count, 2 * count)), handed=tuple(handed))
    limb = limb_of(motion, angle=0.02, distance=distance)
    tracks = [*limb.tracks, *(Track(scales[:, bone], SCALE) for bone in range(count))]
    limb = replace(limb, tracks=tracks, chain=chain, columns=range(2 * count))
    (keys,) = reduce_keys(frames, [limb])
    now = [played(track, frames) for track in keys]
    for bone in range(count):
        assert np.abs(now[count + bone] - scales[:, bone]).max() <= 0.02 * (1.0 + 1e-5)
    kept = np.stack([normalized(each) for each in now[:count]], axis=1)
    few = stretched_tips(skeleton, bones, kept, np.stack(now[count:], axis=1)[..., 1], handed)
    off = np.linalg.norm(few - stretched_tips(skeleton, bones, motion, along, handed), axis=1)
    assert off.max() <= distance * (1.0 + 1e-5)


def stretched_tips(
    skeleton: Skeleton, bones: list[str], rotations: Floats, along: Floats, handed: Sequence[bool]
) -> Floats:
    """By the skeleton's forward kinematics: the steps between joints, each as long as it is."""
    basis = np.tile([1.0, 0.0, 0.0, 0.0], (len(rotations), len(skeleton), 1))
    order = [skeleton.index[name] for name in bones]
    basis[:, order] = rotations
    _, heads = skeleton.pose(basis)
    points = np.concatenate([heads[:, order], tips(skeleton, bones, rotations)[:, None]], axis=1)
    total, longer = np.zeros((len(rotations), 3)), np.ones(len(rotations))
    for bone in range(len(bones)):
        longer = along[:, bone] * (longer if handed[bone] else 1.0)
        total += (points[:, bone + 1] - points[:, bone]) * longer[:, None]
    return total


def test_a_bound_may_change_from_frame_to_frame() -> None:
    frames = np.arange(120.0)
    places = np.stack([np.sin(0.15 * frames), np.cos(0.4 * frames), 0.0 * frames], axis=1)
    bound = np.where(frames < 60.0, 0.05, 0.002)
    ((keys,),) = reduce_keys(frames, [Limb([Track(places, LOCATION)], 1.0, bound)])
    off = np.linalg.norm(played(keys, frames) - places, axis=1)
    assert (off <= bound * (1.0 + 1e-5)).all()


@settings(max_examples=20)
@given(seed=seeds, count=st.integers(20, 90), shared=st.booleans())
def test_a_loop_meets_in_position_and_slope(*, seed: int, count: int, shared: bool) -> None:
    random = np.random.default_rng(seed)
    phase = 2.0 * np.pi * np.arange(count + 1)[:, None, None] / count
    turn = 0.5 * np.sin(phase * [1, 2, 1] + random.uniform(0.0, 6.0, (2, 3)))
    motion = continuous(from_rotation_vector(turn))
    motion[-1] = motion[0]
    limb = replace(limb_of(motion), columns=None if shared else range(2))
    (keys,) = reduce_keys(np.arange(count + 1.0), [limb], loops=True)
    for track in keys:
        np.testing.assert_array_equal(track.values[0], track.values[-1])
        start = (track.right[0, :, 1] - track.values[0]) / (track.right[0, :, 0] - track.frames[0])
        end = (track.values[-1] - track.left[-1, :, 1]) / (track.frames[-1] - track.left[-1, :, 0])
        # Single precision of values about 1, over a frame or more.
        np.testing.assert_allclose(start, end, atol=2e-6)


@pytest.mark.parametrize("exact", [False, True])
def test_keys_stand_on_whole_frames_where_motion_is_known_between_them(*, exact: bool) -> None:
    frames = np.arange(0.0, 60.5, 0.5)
    motion = swing(len(frames), 37.0)
    ((keys,),) = reduce_keys(frames, [limb_of(motion)], every=2, all_of_them=exact)
    np.testing.assert_array_equal(keys.frames, np.round(keys.frames))
    off = angle_between(normalized(played(keys, frames)), motion[:, 0])
    assert off.max() <= LIMIT * (1.0 + 1e-6)
    if exact:
        np.testing.assert_array_equal(keys.frames, np.arange(61.0))
        np.testing.assert_array_equal(keys.values, motion[::2, 0].astype(np.float32))
    else:
        assert len(keys) < 25


# --- Many at once ---------------------------------------------------------------------------------


def test_limbs_have_the_same_keys_alone_and_together() -> None:
    random = np.random.default_rng(4)
    frames = np.arange(150.0)
    limbs = [
        limb_of(wandering(random, 150, bones, 0.4), angle=angle)
        for bones, angle in ((2, 0.01), (3, 0.02), (2, 0.03), (1, 0.01))
    ]
    limbs.append(Limb([Track(np.cumsum(random.normal(size=(150, 3)), 0), "LOCATION")], 1.0, 0.5))
    together = reduce_keys(frames, limbs)
    for limb, keys in zip(limbs, together, strict=True):
        (alone,) = reduce_keys(frames, [limb])
        for one, other in zip(alone, keys, strict=True):
            np.testing.assert_array_equal(one.frames, other.frames)
            np.testing.assert_array_equal(one.left, other.left)
            np.testing.assert_array_equal(one.right, other.right)
            np.testing.assert_array_equal(one.smooth, other.smooth)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_shortest_motions_have_keys_too(count: int) -> None:
    motion = swing(count, 7.0)
    ((keys,),) = reduce_keys(np.arange(float(count)), [limb_of(motion)])
    assert 1 <= len(keys) <= count
    assert np.isfinite(keys.left).all()
    assert (keys.left[..., 0] < keys.frames[:, None]).all()
    assert (keys.right[..., 0] > keys.frames[:, None]).all()


@pytest.mark.parametrize(("angle", "distance"), [(0.0, 1.0), (1.0, 0.0), (-1.0, 1.0)])
def test_without_tolerance_is_refused(angle: float, distance: float) -> None:
    limb = limb_of(swing(10, 5.0), angle=angle, distance=distance)
    with pytest.raises(SettingsError, match="tolerance"):
        reduce_keys(np.arange(10.0), [limb])
