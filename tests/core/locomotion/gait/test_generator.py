# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms of any build follow their gait: on target, in one piece, without a pop or a twist."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.errors import RigError, SettingsError
from octo_motion.core.locomotion.gait import table as gait
from octo_motion.core.locomotion.gait.gait_poser import Arm, ArmPoses, GaitPoser, GaitSettings
from octo_motion.core.locomotion.rig.arm_chains import BodyFrame
from octo_motion.core.rotations import Floats, angle_between, from_axis_angle, normalized, rotate
from octo_motion.core.skeleton import Skeleton
from tests.core.rigs import UP, body_with_arms, posed_joints

pytestmark = pytest.mark.one_blender

PRESETS = gait.gait_presets()
BUILDS = (3, 7, 12, 30)
every_preset = pytest.mark.parametrize("name", sorted(PRESETS))
every_build = pytest.mark.parametrize("joints", BUILDS)
few = settings(max_examples=12)


def cycle(frames: int) -> Floats:
    return np.linspace(0.0, 2.0 * np.pi, frames + 1)


def straight(frames: int) -> Floats:
    return np.zeros((frames, 2))


def posed(generator: GaitPoser, frames: int = 48) -> ArmPoses:
    phases = cycle(frames)
    return generator.pose(phases, straight(len(phases)))


# --- What it must reach (on every preset and build) -------------------------------------------


@every_preset
@every_build
def test_groups_end_within_a_thousandth_of_the_arm_from_their_targets(
    name: str, joints: int
) -> None:
    skeleton, arms, body = body_with_arms(8, joints)
    generator = GaitPoser(skeleton, arms, body, GaitSettings(PRESETS[name]))

    assert posed(generator, 360).misses.max() <= 1e-3


@every_preset
@every_build
def test_bones_keep_their_lengths_and_stay_joined(name: str, joints: int) -> None:
    skeleton, arms, body = body_with_arms(8, joints, 0.6)
    generator = GaitPoser(skeleton, arms, body, GaitSettings(PRESETS[name]))

    poses = posed(generator)

    for arm in arms:
        solved = posed_joints(skeleton, arm, poses.rotations, generator.bones)
        lengths = np.linalg.norm(np.diff(solved, axis=1), axis=-1)
        rest = skeleton.lengths[[skeleton.index[bone] for bone in arm.bones]]
        assert np.max(np.abs(lengths - rest)) <= 1e-6 * 0.6


@every_preset
@every_build
def test_no_bone_pops(name: str, joints: int) -> None:
    # A pop keeps its size however small the time step; all else halves with the step, once steps
    # are fine enough to see the fastest moment: when a group passes through its full length.
    skeleton, arms, body = body_with_arms(1, joints)
    generator = GaitPoser(skeleton, arms, body, GaitSettings(PRESETS[name]))

    coarse, fine = (
        angle_between(turns[:-1], turns[1:]).max(axis=0)
        for turns in (posed(generator, frames).rotations for frames in (12288, 24576))
    )

    moving = coarse > 1e-6
    assert np.all(fine[moving] <= 0.6 * coarse[moving])


@every_preset
def test_the_reported_miss_is_the_one_that_the_bones_show(name: str) -> None:
    skeleton, arms, body = body_with_arms(4, 12)
    with_gait = GaitSettings(PRESETS[name])
    generator = GaitPoser(skeleton, arms, body, with_gait)
    poses = posed(generator)

    # Arm 0 points halfway between front and left. Seen in its frame, x outward:
    arm = arms[0]
    solved = posed_joints(skeleton, arm, poses.rotations, generator.bones)
    local = rotate(from_axis_angle(UP, 0.25 * np.pi), solved - solved[:, :1])

    from octo_motion.core.locomotion.gait.ccd import contraction, link_rotations, pseudo_targets

    angles = generator.settings.gait.curve(arm.pair).evaluate(generator.arm_phases(cycle(48))[:, 0])
    angles[..., 1] *= -1.0  # left: towards the front is clockwise
    lengths = skeleton.lengths[[skeleton.index[bone] for bone in arm.bones]]
    groups = np.add.reduceat(lengths, [0, *np.cumsum(generator_sizes(lengths))[:2]])
    targets = pseudo_targets(link_rotations(angles), groups * (1.0 + contraction(angles)))
    ends = local[:, np.cumsum(generator_sizes(lengths))]
    missed = np.linalg.norm(ends - targets[:, 1:], axis=-1) / lengths.sum()
    assert np.allclose(missed, poses.misses[:, 0], atol=1e-6)
    assert missed.max() <= 1e-3


def generator_sizes(lengths: Floats) -> tuple[int, int, int]:
    from octo_motion.core.locomotion.gait.ccd import split_groups

    return split_groups(lengths)


# --- A frame depends on that frame alone ---------------------------------------------------------


@few
@given(st.integers(0, 2**31), st.sampled_from(sorted(PRESETS)))
def test_frames_come_out_alike_in_any_order_and_alone(seed: int, name: str) -> None:
    skeleton, arms, body = body_with_arms(3, 7)
    generator = GaitPoser(
        skeleton, arms, body, GaitSettings(PRESETS[name], variation=(-0.2, 0.2), seed=seed)
    )
    random = np.random.default_rng(seed)
    phases = random.uniform(0.0, 60.0, 40)
    turn = random.normal(0.0, 0.5, (40, 2))

    together = generator.pose(phases, turn).rotations

    order = random.permutation(40)
    shuffled = generator.pose(phases[order], turn[order]).rotations
    alone = generator.pose(phases[7:8], turn[7:8]).rotations
    # Sums over other batches are rounded otherwise.
    assert np.max(angle_between(shuffled, together[order])) <= 1e-7
    assert np.max(angle_between(alone[0], together[7])) <= 1e-7


def test_long_shots_do_not_differ_from_short_ones() -> None:
    skeleton, arms, body = body_with_arms(8, 3)
    generator = GaitPoser(skeleton, arms, body, GaitSettings(PRESETS["walk"]))
    phases = np.linspace(0.0, 100.0, 1500)  # more than are solved at a time

    whole = generator.pose(phases, straight(1500)).rotations
    part = generator.pose(phases[700:720], straight(20)).rotations

    assert np.max(angle_between(whole[700:720], part)) <= 1e-9


@pytest.mark.parametrize("limits", [(0.0, 0.0), (-0.1, 0.1)])
def test_no_frames_are_no_poses(limits: tuple[float, float]) -> None:
    skeleton, arms, body = body_with_arms(2, 3)
    generator = GaitPoser(skeleton, arms, body, GaitSettings(PRESETS["walk"], variation=limits))

    assert generator.pose(np.empty(0), np.empty((0, 2))).rotations.shape == (0, 6, 4)


# --- Any rig -------------------------------------------------------------------------------------


@few
@given(st.integers(0, 2**31), st.sampled_from(BUILDS))
def test_rest_pose_and_bone_roll_do_not_change_where_the_joints_go(seed: int, joints: int) -> None:
    random = np.random.default_rng(seed)
    bent = np.array([1.0, 0.0, 0.0]) + random.normal(0.0, 0.4, (joints, 3))
    settings_ = GaitSettings(PRESETS["walk"], variation=(-0.2, 0.2), seed=seed)
    plain = body_with_arms(4, joints)
    # Bent within the vertical plane, so that the arm points the same way seen from above.
    bent[:, 1] = 0.0
    odd = body_with_arms(4, joints, rest=normalized(bent), rolls=random)

    found = []
    for skeleton, arms, body in (plain, odd):
        generator = GaitPoser(skeleton, arms, body, settings_)
        poses = posed(generator, 24)
        joints_of = [posed_joints(skeleton, arm, poses.rotations, generator.bones) for arm in arms]
        found.append(np.stack([each - each[:, :1] for each in joints_of]))

    assert np.max(np.abs(found[0] - found[1])) <= 1e-6


@pytest.mark.parametrize(("arms", "joints"), [(1, 3), (1, 200), (5, 4), (64, 5), (6, 11)])
def test_any_number_of_arms_and_bones_reaches_its_targets(arms: int, joints: int) -> None:
    skeleton, listed, body = body_with_arms(arms, joints)
    generator = GaitPoser(skeleton, listed, body, GaitSettings(PRESETS["walk"]))

    poses = posed(generator, 40)

    assert poses.rotations.shape == (41, arms * joints, 4)
    assert poses.misses.max() <= 1e-3


def test_arms_of_different_builds_are_each_solved_with_their_own() -> None:
    skeleton, arms, body = body_with_arms(2, 12)
    shorter = (arms[0], dataclasses.replace(arms[1], bones=arms[1].bones[:8]))
    both = GaitPoser(skeleton, shorter, body, GaitSettings(PRESETS["walk"]))
    alone = GaitPoser(skeleton, shorter[1:], body, GaitSettings(PRESETS["walk"]))

    mixed = posed(both).rotations[:, 12:]

    assert np.max(angle_between(mixed, posed(alone).rotations)) <= 1e-9


def test_the_size_of_the_rig_does_not_change_its_rotations() -> None:
    small = body_with_arms(2, 12, 0.01)
    large = body_with_arms(2, 12, 100.0)

    one, other = (
        posed(GaitPoser(*rig, GaitSettings(PRESETS["swim"]))).rotations for rig in (small, large)
    )

    # Segments are compared as shares of the arm, to six digits.
    assert np.max(angle_between(one, other)) <= 1e-5


# --- What the settings do ------------------------------------------------------------------------


def generated(rig: tuple[Skeleton, tuple[Arm, ...], BodyFrame], **changes: object) -> GaitPoser:
    skeleton, arms, body = rig
    chosen = {"gait": PRESETS["walk"], **changes}
    return GaitPoser(skeleton, arms, body, GaitSettings(**chosen))  # type: ignore[arg-type]


def test_zero_variation_is_the_table_itself_whatever_the_seed() -> None:
    rig = body_with_arms(4, 6)

    plain = posed(generated(rig)).rotations
    seeded = posed(generated(rig, variation=(0.0, 0.0), seed=7)).rotations

    assert np.array_equal(plain, seeded)


def test_the_same_seed_gives_the_same_keys_and_another_seed_others() -> None:
    rig = body_with_arms(4, 6)

    first, again, other = (
        posed(generated(rig, variation=(-0.2, 0.2), seed=seed)).rotations for seed in (1, 1, 2)
    )

    assert np.array_equal(first, again)
    assert np.max(angle_between(first, other)) > 0.05


@pytest.mark.parametrize("name", ["walk", "walk_literal"])
def test_left_and_right_mirror_each_other(name: str) -> None:
    table = dataclasses.replace(PRESETS[name], spread_sides=0.0)
    skeleton, arms, body = body_with_arms(6, 9)
    generator = GaitPoser(skeleton, arms, body, GaitSettings(table))
    poses = posed(generator)

    left, right = (
        posed_joints(skeleton, arm, poses.rotations, generator.bones) for arm in (arms[0], arms[5])
    )

    assert np.max(np.abs(left * [-1.0, 1.0, 1.0] - right)) <= 1e-9


def test_positive_pitch_turns_arms_of_both_sides_to_the_front() -> None:
    table = dataclasses.replace(
        PRESETS["walk_literal"],
        curves={0: gait.curve_from_degrees([0, 180, 360], pitch=[[30] * 3, [0] * 3, [0] * 3])},
    )
    skeleton, arms, body = body_with_arms(2, 6)  # to the left and to the right
    generator = GaitPoser(skeleton, arms, body, GaitSettings(table))
    poses = posed(generator, 2)

    for arm in arms:
        joints = posed_joints(skeleton, arm, poses.rotations, generator.bones)
        assert np.all(joints[:, -1, 1] < -0.3)  # the front is -Y


def test_flip_mirrors_what_an_arm_takes_for_the_front() -> None:
    skeleton, arms, body = body_with_arms(2, 6)
    plain = GaitPoser(skeleton, arms, body, GaitSettings(PRESETS["walk_literal"]))
    flipped = GaitPoser(
        skeleton,
        (dataclasses.replace(arms[0], flip=True), arms[1]),
        body,
        GaitSettings(PRESETS["walk_literal"]),
    )

    one, other = (
        posed_joints(skeleton, arms[0], posed(each).rotations, each.bones)
        for each in (plain, flipped)
    )

    assert np.max(np.abs(one * [1.0, -1.0, 1.0] - other)) <= 1e-9


def test_an_arms_own_phase_puts_it_ahead() -> None:
    skeleton, arms, body = body_with_arms(2, 6)
    ahead = (dataclasses.replace(arms[0], phase=0.5 * np.pi), arms[1])
    plain = GaitPoser(skeleton, arms, body, GaitSettings(PRESETS["walk"]))
    shifted = GaitPoser(skeleton, ahead, body, GaitSettings(PRESETS["walk"]))

    now = shifted.pose(np.array([1.0]), straight(1)).rotations
    later = plain.pose(np.array([1.0 + 0.5 * np.pi]), straight(1)).rotations

    assert np.max(angle_between(now[:, :6], later[:, :6])) <= 1e-9


def test_without_phase_spread_all_arms_move_together() -> None:
    skeleton, arms, body = body_with_arms(8, 6)
    generator = GaitPoser(skeleton, arms, body, GaitSettings(PRESETS["walk"], phase_spread=0.0))

    heights = [
        posed_joints(skeleton, arm, posed(generator).rotations, generator.bones)[..., 2]
        for arm in arms
    ]

    assert np.max(np.ptp(heights, axis=0)) <= 1e-9


def test_arms_turn_towards_the_goal_by_the_share_asked_for() -> None:
    skeleton, arms, body = body_with_arms(4, 12)
    generator = GaitPoser(skeleton, arms, body, GaitSettings(PRESETS["swim"], turning=0.5))
    left = np.array([[0.4, 0.0]])
    phase = np.array([0.2])

    plain = posed_pitches(skeleton, arms, generator, phase, np.zeros((1, 2)))
    turned = posed_pitches(skeleton, arms, generator, phase, left)

    # Arms at ±45° and ±135° from the front: all lie halfway across the turn to the left. Those
    # in front swing to it anticlockwise, those behind clockwise.
    expected = 0.5 * 0.4 * np.cos(0.25 * np.pi) * np.array([1.0, -1.0, -1.0, 1.0])
    # The solver steers the target exactly, and ends within its tolerance of it.
    assert np.allclose(turned - plain, expected, atol=2e-3)


def posed_pitches(
    skeleton: Skeleton, arms: tuple[Arm, ...], generator: GaitPoser, phase: Floats, turn: Floats
) -> Floats:
    """Compass angle of each arm's tip, seen from its root."""
    poses = generator.pose(phase, turn)
    tips = []
    for arm in arms:
        joints = posed_joints(skeleton, arm, poses.rotations, generator.bones)[0]
        tips.append(joints[-1] - joints[0])
    return np.array([np.arctan2(tip[1], tip[0]) for tip in tips])


PROFILES = {
    "root": (1.0, 0.05),
    "tip": (0.05, 1.0),
    "middle": (0.05, 1.0, 0.05),
    "ends": (1.0, 0.05, 1.0),
    "one joint": (0.01, 0.01, 0.01, 1.0, 0.01, 0.01, 0.01),
}


def bend_centroid(rig: tuple[Skeleton, tuple[Arm, ...], BodyFrame], generator: GaitPoser) -> float:
    """Number of the joint, 0 at the root, about which the bends of a cycle lie."""
    skeleton, arms, _ = rig
    poses = posed(generator, 96)
    joints = posed_joints(skeleton, arms[0], poses.rotations, generator.bones)
    ways = normalized(np.diff(joints, axis=1))
    bends = np.arccos(np.clip(np.sum(ways[:, 1:] * ways[:, :-1], axis=-1), -1.0, 1.0))
    return float(np.sum(bends * np.arange(1, bends.shape[1] + 1)) / np.sum(bends))


@pytest.mark.parametrize("name", ["walk", "swim"])
@pytest.mark.parametrize("softness", [0.0, 0.8])
def test_weights_move_the_bend_along_the_arm(name: str, softness: float) -> None:
    rig = body_with_arms(1, 12)

    def centroid(*weights: float) -> float:
        made = generated(
            rig, gait=PRESETS[name], weights=weights, softness=softness, stretch_slack=0.08
        )
        return bend_centroid(rig, made)

    # Joints of twelve: 2.5 and 3.1 with softness, 2.4 and 2.9 without.
    assert centroid(0.05, 1.0) - centroid(1.0, 0.05) >= 1.5
    # Alike, they matter little, and as the source says: towards 1 the tip bends, towards 0 the
    # root. By 0.3 joints without softness, by 0.02 with it.
    assert 0.0 < centroid(1.0) - centroid(0.05) < 0.5


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("joints", [6, 7, 12])
@pytest.mark.parametrize("name", ["walk", "swim", "hurry"])
def test_an_arm_of_any_weights_meets_its_targets_and_does_not_pop(
    name: str, joints: int, profile: str
) -> None:
    rig = body_with_arms(1, joints)
    generator = generated(rig, gait=PRESETS[name], weights=PROFILES[profile])
    coarse, fine = (posed(generator, frames) for frames in (6144, 12288))

    assert fine.misses.max() <= 1e-3
    steps = [
        angle_between(poses.rotations[:-1], poses.rotations[1:]).max() for poses in (coarse, fine)
    ]
    assert steps[1] <= 0.75 * steps[0]


def test_arms_have_weights_of_their_own() -> None:
    skeleton, arms, body = body_with_arms(4, 12)
    own = (dataclasses.replace(arms[0], weights=(0.05, 1.0)), *arms[1:])
    alone, all_alike, mixed = (
        GaitPoser(skeleton, each, body, GaitSettings(PRESETS["swim"], weights=weights))
        for each, weights in ((arms, (0.05, 1.0)), (arms, (0.4,)), (own, (0.4,)))
    )
    theirs, others, both = (posed(each).rotations for each in (alone, all_alike, mixed))

    np.testing.assert_allclose(both[:, :12], theirs[:, :12], atol=1e-9)
    np.testing.assert_allclose(both[:, 12:], others[:, 12:], atol=1e-9)
    with pytest.raises(SettingsError, match="A joint's weight is not between 0 and 1"):
        GaitPoser(
            *(skeleton, (dataclasses.replace(arms[0], weights=(2.0,)),), body),
            GaitSettings(PRESETS["swim"]),
        )


def test_softness_takes_the_sharpest_bends_off() -> None:
    rig = body_with_arms(1, 12)

    def bends(softness: float) -> Floats:
        turns = posed(generated(rig, softness=softness)).rotations
        return angle_between(turns, np.array([1.0, 0.0, 0.0, 0.0]))

    sharp, softer, soft = (bends(softness) for softness in (0.0, 0.5, 1.0))
    assert np.max(soft) < 0.9 * np.max(sharp)
    assert np.mean(soft**2) < np.mean(softer**2) < np.mean(sharp**2)


def test_give_takes_the_snap_out_of_an_arm_that_straightens() -> None:
    rig = body_with_arms(1, 12)

    def snaps(give: float) -> float:
        turns = posed(generated(rig, stretch_slack=give), 480).rotations
        return float(angle_between(turns[1:], turns[:-1]).max())

    assert snaps(0.08) < 0.5 * snaps(0.0)
    # What it lets an arm reach beyond its targets is not missed, and nothing else is.
    assert posed(generated(rig, stretch_slack=0.08)).misses.max() <= 1e-3


def with_segments(
    rig: tuple[Skeleton, tuple[Arm, ...], BodyFrame], shares: Sequence[float], root: float
) -> tuple[Skeleton, tuple[Arm, ...], BodyFrame]:
    """A rig whose straight arms have segments of these lengths, so far from the body's axis."""
    skeleton, arms, body = rig
    matrices, lengths = skeleton.rest_matrices.copy(), skeleton.lengths.copy()
    for arm in arms:
        bones = [skeleton.index[bone] for bone in arm.bones]
        outward = matrices[bones[0], :3, 1]
        for bone, start, share in zip(bones, np.cumsum([root, *shares]), shares, strict=False):
            matrices[bone, :3, 3], lengths[bone] = start * outward, share
    return dataclasses.replace(skeleton, rest_matrices=matrices, lengths=lengths), arms, body


@pytest.mark.parametrize("name", ["swim", "jet_escape"])
@pytest.mark.parametrize(
    "shares",
    [
        # Two bones to the first group, one of them short: its elbow is sharp.
        (0.1, 0.35, 0.35, 0.2),
        (1.0 / 6.0,) * 6,
        (1.0 / 7.0,) * 7,
    ],
)
def test_an_elbow_of_two_bones_does_not_change_sides_at_a_stroke(
    name: str, shares: tuple[float, ...]
) -> None:
    """At 48 frames a cycle; before, it did by 22 to 31° within one."""
    rig = with_segments(body_with_arms(1, len(shares)), shares, 0.1)
    generator = generated(rig, gait=PRESETS[name], stretch_slack=0.08, smoothing_cycles=0.08)
    turns = posed(generator).rotations
    assert np.degrees(angle_between(turns[:-1], turns[1:]).max()) < 14.0


@pytest.mark.parametrize("shares", [(0.1, 0.35, 0.35, 0.2), (1.0 / 12.0,) * 12])
def test_arms_that_spring_from_one_point_trail_side_by_side(shares: tuple[float, ...]) -> None:
    """Before, their outer halves trailed in one line, none 0.02 arm lengths beside it."""
    rig = with_segments(body_with_arms(8, len(shares)), shares, 0.0)
    generator = generated(
        rig, gait=PRESETS["jet_escape"], stretch_slack=0.08, smoothing_cycles=0.08
    )
    turns = posed(generator).rotations
    joints = np.stack([posed_joints(rig[0], arm, turns, generator.bones) for arm in rig[1]], axis=1)
    outer = joints[:, :, len(shares) // 2 :, :2]
    assert np.linalg.norm(outer, axis=-1).mean(axis=1).min() > 0.07


def test_arms_with_room_at_their_roots_trail_as_the_gait_says() -> None:
    rig = body_with_arms(8, 12)
    near, far = (with_segments(rig, (1.0 / 12.0,) * 12, root) for root in (0.11, 0.3))
    one, other = (posed(generated(each, gait=PRESETS["jet_escape"])) for each in (near, far))
    assert np.max(angle_between(one.rotations, other.rotations)) <= 1e-6


def test_a_body_that_lies_closes_its_arms_before_its_face_and_opens_them_all_round() -> None:
    """Its arms point to the front and the sides at rest, none to the back, where its mantle is."""
    skeleton, arms, body = body_with_arms(16, 6)
    ahead = [
        arm for arm in arms if body.to_body(skeleton.heads[skeleton.index[arm.bones[0]]])[1] < 0
    ]
    body = dataclasses.replace(body, center=np.zeros(3))
    generator = GaitPoser(
        skeleton,
        ahead,
        body,
        GaitSettings(PRESETS["swim"], stretch_slack=0.08, swim_lean=0.5 * np.pi),
    )
    assert len(ahead) == 8
    turns = posed(generator).rotations
    tips = np.stack(
        [posed_joints(skeleton, arm, turns, generator.bones)[:, -1] for arm in ahead], axis=1
    )
    closed, opened = tips[24], tips[6]
    assert np.all(closed[:, 1] < -0.6)
    assert np.all(np.linalg.norm(closed[:, [0, 2]], axis=1) < 0.7)
    # Seen from ahead they leave no gap wider than a quarter of the round, and none behind.
    around = np.sort(np.arctan2(opened[:, 0], opened[:, 2]))
    assert np.max(np.diff(around, append=around[0] + 2.0 * np.pi)) < np.radians(95.0)
    assert np.all(opened[:, 1] > -0.4)
    # Those in the middle of the fan go over the top, and left stays left.
    left = np.array([arm.side == "LEFT" for arm in ahead])
    assert np.all((opened[:, 0] > 0.0) == left)


def test_walking_and_swimming_arms_do_not_wring_themselves() -> None:
    # Twist about its own bone: what a straight arm carried along the same way would not have.
    for name in ("walk", "swim"):
        skeleton, arms, body = body_with_arms(2, 12)
        generator = GaitPoser(skeleton, arms, body, GaitSettings(PRESETS[name]))
        turns = posed(generator).rotations
        twist = 2.0 * np.arctan2(np.abs(turns[..., 2]), np.abs(turns[..., 0]))
        assert np.max(twist) <= 1e-9


def test_bank_twists_each_group_by_its_own_angle() -> None:
    curve = gait.curve_from_degrees([0, 180, 360], bank=[[30, 30, 30], [0, 0, 0], [-12, -12, -12]])
    table = dataclasses.replace(PRESETS["swim"], curves={0: curve})
    skeleton, arms, body = body_with_arms(2, 12, taper=0.0)
    generator = GaitPoser(skeleton, arms, body, GaitSettings(table, lateral_bend=0.0))

    turns = posed(generator, 2).rotations[0].reshape(2, 12, 4)
    twist = np.degrees(2.0 * np.arctan2(turns[..., 2], turns[..., 0]))

    expected = np.repeat([30 / 4, 0.0, -12 / 4], 4)
    assert np.allclose(twist, expected * np.array([[-1.0], [1.0]]), atol=1e-6)


def test_suckers_stay_below_while_walking() -> None:
    # Local -Z is the sucker side of a rig whose bones are rolled with Z up.
    skeleton, arms, body = body_with_arms(8, 12)
    generator = GaitPoser(skeleton, arms, body, GaitSettings(PRESETS["walk"]))
    basis = np.zeros((97, len(skeleton), 4))
    basis[..., 0] = 1.0
    basis[:, [skeleton.index[bone] for bone in generator.bones]] = posed(generator, 96).rotations
    orientations, _ = skeleton.pose(basis)
    order = [skeleton.index[bone] for bone in generator.bones]
    along = rotate(orientations[:, order], np.array([0.0, 1.0, 0.0]))
    suckers = rotate(orientations[:, order], np.array([0.0, 0.0, -1.0]))
    # Wherever the arm goes outward. Where it is folded back under itself it lies on its back.
    outward = normalized(skeleton.heads[order] * [1.0, 1.0, 0.0])
    lying = np.sum(along * outward, axis=-1) > 0.5

    assert np.count_nonzero(lying) > 0.5 * lying.size
    assert np.all(suckers[..., 2][lying] < -0.4)


def test_clearance_is_how_deep_a_whole_cycle_reaches() -> None:
    skeleton, arms, body = body_with_arms(8, 12)
    generator = GaitPoser(skeleton, arms, body, GaitSettings(PRESETS["walk"], variation=(0.0, 0.1)))
    plain = GaitPoser(skeleton, arms, body, GaitSettings(PRESETS["walk"]))

    lowest = min(
        posed_joints(skeleton, arm, posed(plain, 96).rotations, plain.bones)[..., 2].min()
        for arm in arms
    )

    assert generator.clearance == plain.clearance
    assert plain.clearance == pytest.approx(-lowest, abs=1e-9)


# --- Standing ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "always"), [("walk", 2), ("walk_search", 1)])
@pytest.mark.parametrize("joints", [7, 12, 30])
def test_standing_there_are_arms_on_the_ground_at_any_time_and_none_is_below(
    name: str, always: int, joints: int
) -> None:
    skeleton, arms, body = body_with_arms(8, joints)
    generator = GaitPoser(skeleton, arms, body, GaitSettings(PRESETS[name], raise_to_floor=True))

    poses = posed(generator, 96)

    heights = np.array(
        [
            posed_joints(skeleton, arm, poses.rotations, generator.bones)[..., 2].min(axis=1)
            for arm in arms
        ]
    )
    heights += generator.clearance
    # The clearance looks at as many phases as there are frames here.
    assert heights.min() >= -1e-9
    standing = np.count_nonzero(heights < 0.05, axis=0)
    assert standing.min() >= always
    assert standing.mean() >= 2.0
    assert poses.misses.max() <= 1e-3


@pytest.mark.parametrize("joints", [7, 12, 30])
def test_standing_pops_nothing(joints: int) -> None:
    skeleton, arms, body = body_with_arms(1, joints)
    generator = GaitPoser(skeleton, arms, body, GaitSettings(PRESETS["walk"], raise_to_floor=True))

    coarse, fine = (
        angle_between(turns[:-1], turns[1:]).max(axis=0)
        for turns in (posed(generator, frames).rotations for frames in (12288, 24576))
    )

    assert np.all(fine <= 0.6 * coarse)


@pytest.mark.parametrize(("name", "joints"), [("walk_literal", 12), ("swim", 12), ("walk", 3)])
def test_level_gaits_swimmers_and_stiff_arms_stand_on_nothing(name: str, joints: int) -> None:
    rig = body_with_arms(2, joints)

    plain, standing = (
        posed(generated(rig, gait=PRESETS[name], raise_to_floor=stand)).rotations
        for stand in (False, True)
    )

    assert np.array_equal(plain, standing)


# --- Faults --------------------------------------------------------------------------------------


def test_no_arms_are_a_clear_error() -> None:
    skeleton, _, body = body_with_arms(2, 3)

    with pytest.raises(RigError, match=r"The list of arms is empty\. Detect the arms"):
        GaitPoser(skeleton, (), body, GaitSettings(PRESETS["walk"]))


def test_arms_that_share_a_bone_are_a_clear_error() -> None:
    skeleton, arms, body = body_with_arms(2, 6)
    sharing = (arms[0], dataclasses.replace(arms[1], bones=arms[0].bones[2:]))

    with pytest.raises(RigError, match=r"Bone 'arm0\.2' is in two arms, 'Arm 0' and 'Arm 1'\."):
        GaitPoser(skeleton, sharing, body, GaitSettings(PRESETS["walk"]))


def test_a_bone_that_is_gone_is_a_clear_error() -> None:
    skeleton, arms, body = body_with_arms(2, 6)
    gone = (dataclasses.replace(arms[0], bones=(*arms[0].bones, "lost")),)

    with pytest.raises(RigError, match="has no bone 'lost'"):
        GaitPoser(skeleton, gone, body, GaitSettings(PRESETS["walk"]))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"lateral_bend": float("nan")}, "Sway is not a number."),
        ({"weights": (0.5, 0.0)}, "A joint's weight is not between 0 and 1."),
        ({"weights": (1.5,)}, "A joint's weight is not between 0 and 1."),
        ({"weights": ()}, "A joint's weight is not between 0 and 1."),
        ({"variation": (0.2, 0.1)}, "The variation's minimum is greater than its maximum."),
        ({"contraction": -0.5}, "Contraction is -0.5."),
        ({"softness": 1.5}, "Softness is 1.5."),
        ({"stretch_slack": -0.1}, "Give is -0.1."),
    ],
)
def test_a_senseless_setting_is_a_clear_error(changes: dict[str, object], message: str) -> None:
    with pytest.raises(SettingsError) as caught:
        GaitSettings(PRESETS["walk"], **changes)  # type: ignore[arg-type]

    assert message in str(caught.value)
