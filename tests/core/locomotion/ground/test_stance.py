# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that hold the ground: no sliding, nothing through it, no pops, on any ground and rig."""

import functools
from typing import Any

import numpy as np
import pytest

from octo_motion.core.errors import SettingsError
from octo_motion.core.locomotion.ground.footholds import ContactOverride
from octo_motion.core.locomotion.ground.surface import StanceSettings, normals
from octo_motion.core.locomotion.metrics import report as quality
from octo_motion.core.rotations import multiply, rotate
from tests.core.grounds import (
    FRAMES,
    GROUNDS,
    STRAIGHT,
    TURN,
    Walker,
    deepest_joint,
    largest_turn,
    walker,
)

ONE = np.ones(8)


@functools.cache
def walking(ground: str, **options: Any) -> Walker:
    route = TURN if ground == "turn" else STRAIGHT
    return walker(GROUNDS["plane" if ground == "turn" else ground], route=route, **options)


PLACES = [*GROUNDS, "turn"]
RIGS = [{"stretch": True}, {}, {"joints": 7}, {"joints": 30}, {"joints": 3}]


@pytest.fixture(params=[(ground, 0) for ground in PLACES] + [("bumps", 1), ("bumps", 2)], ids=str)
def walk(request: pytest.FixtureRequest) -> Walker:
    """Arms of 12 bones that stretch on every ground; others on the hardest."""
    ground, rig = request.param
    return walking(ground, **RIGS[rig])


def test_what_lies_on_the_ground_does_not_slide(walk: Walker) -> None:
    poses = walk.pose(walk.times)
    for joints, lying, arms in zip(poses.joints, poses.in_contact, walk.walk.builds, strict=True):
        worst = quality.slip(joints, lying, poses.cycles[:, list(arms)], np.ones(len(arms)))
        # Newton's method leaves rounding alone.
        assert worst.value < 1e-6
    assert poses.misses.max() < 1e-6


@pytest.mark.parametrize("ground", PLACES)
def test_nor_does_it_between_two_frames(ground: str) -> None:
    walk = walking(ground)
    joints, half = walk.played(walk.times)
    poses = walk.pose(half)
    order = [arm for arms in walk.walk.builds for arm in arms]
    lying = np.concatenate(poses.in_contact, axis=1)
    exact = np.concatenate(poses.joints, axis=1)
    error = np.linalg.norm(joints[:, order] - exact, axis=-1) * lying
    # At most a hundredth of the arm; what is measured is three thousandths.
    assert error.max() < 0.01


def test_no_joint_is_below_the_ground(walk: Walker) -> None:
    for joints in walk.pose(walk.times).joints:
        assert deepest_joint(joints, walk.ground) < 0.005


def test_several_arms_stand_at_any_time(walk: Walker) -> None:
    lying = walk.pose(walk.times).in_contact
    standing = sum(each.any(axis=-1).sum(axis=1) for each in lying)
    assert standing.min() >= 2
    assert standing.mean() > 3.0


def test_a_part_of_the_arm_lies_down_not_its_tip_alone(walk: Walker) -> None:
    (lying,) = walk.pose(walk.times).in_contact
    middle = np.abs(walk.since(walk.times)) < 0.02
    shares = lying.sum(axis=-1)[middle[:, list(walk.walk.builds[0])]]
    assert shares.min() >= 0.25 * lying.shape[-1]


@pytest.mark.parametrize("rig", RIGS, ids=str)
def test_motion_is_continuous(rig: dict[str, Any]) -> None:
    walk = walking("bumps", **rig)
    cycle = walk.travel.stride / walk.route.length
    turns = [
        largest_turn(walk.pose(np.linspace(0.4, 0.4 + cycle, count * FRAMES + 1)).rotations)
        for count in (1, 2, 4, 8)
    ]
    # As of the gait itself: steps halve with the frame time once frames resolve a stretched arm.
    # Three stiff bones have to fold a lot in one joint.
    assert turns[0] < np.radians(50.0 if rig != {"joints": 3} else 90.0)
    assert turns[2] < 0.5 * turns[0]
    assert turns[3] < 0.75 * turns[2]


@pytest.mark.parametrize("weights", [(1.0, 0.05), (0.05, 1.0)], ids=["root", "tip"])
def test_weights_leave_footholds_and_continuity_as_they_are(weights: tuple[float, float]) -> None:
    walk = walking("bumps", stretch=True, weights=weights)
    poses = walk.pose(walk.times)
    assert poses.misses.max() < 1e-6
    for joints, lying, arms in zip(poses.joints, poses.in_contact, walk.walk.builds, strict=True):
        assert deepest_joint(joints, walk.ground) < 0.005
        worst = quality.slip(joints, lying, poses.cycles[:, list(arms)], np.ones(len(arms)))
        assert worst.value < 1e-6
    cycle = walk.travel.stride / walk.route.length
    turns = [
        largest_turn(walk.pose(np.linspace(0.4, 0.4 + cycle, count * FRAMES + 1)).rotations)
        for count in (1, 4, 8)
    ]
    assert turns[0] < np.radians(50.0)
    assert turns[1] < 0.5 * turns[0]
    assert turns[2] < 0.75 * turns[1]


def test_a_tip_that_lies_down_does_not_twitch() -> None:
    walk = walking("plane", stretch=True, radii=(0.12, 0.012))
    cycle = walk.travel.stride / walk.route.length
    count = 480
    poses = walk.pose(np.linspace(0.4, 0.4 + 1.3 * cycle, int(1.3 * count)))
    joints, lying = poses.joints[0], poses.in_contact[0][..., -1]
    segments = np.diff(joints, axis=2)
    segments /= np.linalg.norm(segments, axis=-1, keepdims=True)
    cosines = np.sum(segments[:, :, 1:] * segments[:, :, :-1], axis=-1)
    bends = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))[:, :, -3:]
    landings = np.argwhere(lying[1:] & ~lying[:-1])
    landed = landings[landings[:, 0] > count // 8]
    assert len(landed) >= 6
    for frame, arm in landed:
        while_it_comes_down = bends[frame - count // 8 : frame + 1, arm]
        again = while_it_comes_down - np.minimum.accumulate(while_it_comes_down, axis=0)
        assert while_it_comes_down[0].max() > 10.0
        assert again.max() < 1.0


def test_a_frame_does_not_depend_on_others() -> None:
    walk = walking("bumps", stretch=True)
    times = np.linspace(0.2, 0.6, 40)
    whole = walk.pose(times)
    order = np.random.default_rng(2).permutation(40)
    mixed = walk.pose(times[order])
    alone = walk.pose(times[7:8])
    np.testing.assert_allclose(mixed.rotations, whole.rotations[order], atol=1e-9)
    np.testing.assert_allclose(alone.rotations[0], whole.rotations[7], atol=1e-9)


def test_bones_that_may_not_stretch_keep_their_length() -> None:
    walk = walking("bumps")
    poses = walk.pose(walk.times)
    assert np.abs(poses.strains).max() == 0.0
    lengths = np.linalg.norm(np.diff(poses.joints[0], axis=2), axis=-1)
    np.testing.assert_allclose(lengths, np.broadcast_to(lengths[:1], lengths.shape), rtol=1e-9)


@pytest.mark.parametrize("limit", [0.1, 0.4])
def test_others_stretch_within_the_limit_and_where_they_lie_not_at_all(limit: float) -> None:
    walk = walking("slope", stretch=True, settings=StanceSettings(stretch=limit))
    poses = walk.pose(walk.times)
    assert 0.1 * limit < poses.strains.max() <= limit
    lying = poses.in_contact[0][:, :, :-1] & poses.in_contact[0][:, :, 1:]
    strains = poses.strains.reshape(len(walk.times), 8, 12)[:, list(walk.walk.builds[0])]
    assert np.abs(strains[lying]).max() < 1e-9


def test_arms_swing_clear_of_the_ground() -> None:
    lift = StanceSettings().lift
    walk = walking("plane", stretch=True)
    since = np.abs(walk.since(walk.times))
    poses = walk.pose(walk.times)
    heights = poses.joints[0][..., 1:, 2].min(axis=-1)
    assert heights[since[:, list(walk.walk.builds[0])] > 0.45].min() > 0.8 * lift


@pytest.mark.parametrize("ground", ["plane", "bumps"])
@pytest.mark.parametrize("gait", ["walk", "hurry"])
def test_a_walk_starts_and_ends_at_rest(ground: str, gait: str) -> None:
    walk = walking(ground, stretch=True, rest=1.0, gait=gait)
    poses = walk.pose(walk.times)
    (joints,), (lying,) = poses.joints, poses.in_contact
    order = list(walk.walk.builds[0])
    # All arms lie down at both ends, a third of what lies down at most is peeled off …
    assert lying[[0, -1]].sum(axis=-1).min() >= 4
    assert lying.any(axis=-1).sum(axis=1).min() >= 3
    assert quality.slip(joints, lying, poses.cycles[:, order], ONE).value < 1e-6
    assert deepest_joint(joints, walk.ground) < 0.005
    heights = joints[[0, -1]][lying[[0, -1]]]
    assert (heights[:, 2] - walk.ground.height(heights)).max() < 0.06
    # … the body stops, and nothing is much quicker there than half way: arms that have held on for
    # longer have farther to go.
    speed = np.linalg.norm(np.diff(joints, axis=0), axis=-1).max(axis=(1, 2))
    assert speed[[0, -1]].max() < 0.01 * speed.max()
    distance = walk.places(walk.times)[0].distance
    stride = walk.travel.stride
    ends = (distance < stride) | (distance > walk.route.length - stride)
    assert speed[ends[1:]].max() < 1.4 * speed[~ends[1:]].max()
    np.testing.assert_allclose(distance[-1], walk.route.length)


@pytest.mark.parametrize("ground", ["plane", "bumps", "turn"])
def test_suckers_face_the_ground_where_the_arm_lies(ground: str) -> None:
    walk = walking(ground, stretch=True, rolls=None)
    poses = walk.pose(walk.times)
    _, _, bodies = walk.places(walk.times)
    basis = np.zeros((len(walk.times), len(walk.skeleton), 4))
    basis[..., 0] = 1.0
    basis[:, [walk.skeleton.index[bone] for bone in walk.generator.bones]] = poses.rotations
    frames, _ = walk.skeleton.pose(basis)
    for place, arm in enumerate(walk.walk.builds[0]):
        bones = [walk.skeleton.index[bone] for bone in walk.generator.arms[arm].bones]
        turned = multiply(bodies[:, None], frames[:, bones])
        # Bones that say nothing have their suckers on the side that looks down at rest.
        below = rotate(turned, np.array([0.0, 0.0, -1.0]))
        along = rotate(turned, np.array([0.0, 1.0, 0.0]))
        down = -normals(walk.ground, poses.joints[0][:, place, :-1])
        down -= np.sum(down * along, axis=-1, keepdims=True) * along
        cosine = np.sum(below * down, axis=-1) / np.linalg.norm(down, axis=-1)
        lying = poses.in_contact[0][:, place, :-1] & poses.in_contact[0][:, place, 1:]
        assert np.degrees(np.arccos(cosine[lying].min())) < 25.0


def test_no_bone_is_twisted_far_against_the_one_before() -> None:
    walk = walking("bumps", stretch=True)
    rotations = walk.pose(walk.times).rotations
    twist = np.abs(np.degrees(2.0 * np.arctan2(rotations[..., 2], rotations[..., 0])))
    # More from one bone to the next would pinch the skin like a candy wrapper.
    assert np.minimum(twist, 360.0 - twist).max() < 35.0


def test_the_body_stays_on_its_route_and_follows_the_ground() -> None:
    walk = walking("slope", stretch=True)
    travel, centres, _ = walk.places(walk.times)
    np.testing.assert_allclose(centres[:, :2], travel.positions[:, :2], atol=1e-9)
    height = centres[:, 2] - walk.ground.height(centres)
    np.testing.assert_allclose(height, height[0], atol=2e-3)
    bumpy = walking("bumps", stretch=True)
    _, centres, _ = bumpy.places(bumpy.times)
    assert (centres[:, 2] - bumpy.ground.height(centres)).min() > 0.5 * bumpy.line.clearances.min()


# --- What the artist wants of single contacts -----------------------------------------------------


def holds(walk: Walker, arm: int) -> dict[int, Any]:
    return {each.cycle: each for each in walk.walk.footholds() if each.arm == arm}


def test_a_contact_that_was_moved_is_where_it_was_moved_to_and_the_others_stay() -> None:
    free = walking("bumps", stretch=True)
    old = holds(free, 2)[3]
    goal = old.position + np.array([0.05, -0.04, 9.0])
    wish = ContactOverride(2, 3, position=goal, heading=old.heading + 0.2)
    walk = walker(GROUNDS["bumps"], stretch=True, wishes=[wish])
    new = holds(walk, 2)[3]
    np.testing.assert_allclose(new.position[:2], goal[:2], atol=1e-12)
    assert 0.0 < new.position[2] - walk.ground.height(new.position) < 0.05
    others = [each for each in walk.walk.footholds() if (each.arm, each.cycle) != (2, 3)]
    for each in others:
        np.testing.assert_array_equal(each.position, holds(free, each.arm)[each.cycle].position)
    poses = walk.pose(walk.times)
    worst = quality.slip(
        poses.joints[0], poses.in_contact[0], poses.cycles[:, list(walk.walk.builds[0])], ONE
    )
    assert worst.value < 1e-6


def test_a_contact_that_was_deleted_is_gone_and_the_arm_stays_in_the_air() -> None:
    walk = walker(GROUNDS["plane"], stretch=True, wishes=[ContactOverride(2, 3, removed=True)])
    assert 3 not in holds(walk, 2)
    poses = walk.pose(walk.times)
    place = walk.walk.builds[0].index(2)
    assert not poses.in_contact[0][poses.cycles[:, 2] == 3, place].any()
    assert poses.in_contact[0][poses.cycles[:, 2] == 2, place].any()


def test_a_contact_can_come_later() -> None:
    free, walk = (
        walker(GROUNDS["plane"], stretch=True, wishes=wishes)
        for wishes in ((), [ContactOverride(2, 3, shift=0.1)])
    )
    old, new = holds(free, 2)[3], holds(walk, 2)[3]
    assert new.touch_down - old.touch_down == pytest.approx(0.1 * 2.0 * np.pi)
    assert new.lift_off - old.lift_off == pytest.approx(0.1 * 2.0 * np.pi)


def test_a_contact_out_of_reach_is_told_and_nothing_breaks() -> None:
    far = holds(walking("plane"), 2)[3].position + np.array([0.0, 0.0, 0.0])
    far[:2] += 1.5
    walk = walker(GROUNDS["plane"], wishes=[ContactOverride(2, 3, position=far)])
    poses = walk.pose(walk.times)
    frame, arm = np.unravel_index(poses.misses.argmax(), poses.misses.shape)
    assert arm == 2
    assert poses.cycles[frame, arm] == 3
    assert poses.misses.max() > 0.5
    assert np.isfinite(poses.rotations).all()


def test_the_seed_does_not_matter_where_nothing_varies() -> None:
    one, other = (walker(GROUNDS["plane"], seed=seed).walk.footholds() for seed in (1, 2))
    assert all(np.array_equal(a.position, b.position) for a, b in zip(one, other, strict=True))


def test_settings_that_make_no_sense_are_told() -> None:
    with pytest.raises(SettingsError, match=r"Hold is 0\.95"):
        StanceSettings(duty=0.95)
    with pytest.raises(SettingsError, match="Planted is 0"):
        StanceSettings(planted=0.0)
    with pytest.raises(SettingsError, match="Lift is not a number"):
        StanceSettings(lift=float("nan"))
