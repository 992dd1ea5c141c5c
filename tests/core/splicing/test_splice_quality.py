# SPDX-License-Identifier: GPL-3.0-or-later
"""The measures of a splice: known answers, and what must not change them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.rotations import Floats, from_rotation_vector, multiply, rotate
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.clip.splice_timing import Timing
from octo_motion.core.splicing.transfer.parts import ARM, PARTS, Part
from octo_motion.core.splicing.transfer.splice import Splice
from tests.bench.plain_copy import plain_copy
from tests.bench.splice_quality import (
    Seam,
    feet_at_rest,
    foot_slip,
    limb_length,
    log_dimensionless_jerk,
    out_of_reach,
    path_error,
    seams,
    turn_error,
)
from tests.core.splice_bodies import (
    LANDMARKS,
    humanoid,
    in_another_file,
    motion,
    moved,
    spliced,
    turned_about,
)

HEAD, LEGS, RIGHT_ARM, TRUNK = (PARTS[name] for name in ("head", "legs", "right_arm", "trunk"))

SMOOTHEST = -np.log(720.0 / 1.875**2)
"""Of the way from rest to rest with the least jerk: 720 is its jerk's integral, 1.875 its highest
speed, for a way of length one in a second."""


def least_jerk(frames: int) -> Floats:
    """From (0, 0, 0) to (1, 0, 0) within a second."""
    share = np.linspace(0.0, 1.0, frames)
    along = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    return np.stack([along, 0.0 * along, 0.0 * along], axis=-1)


def body(seed: int = 1, frames: int = 40) -> Clip:
    random = np.random.default_rng(seed)
    return motion(random, humanoid(random), frames)


def another(clip: Clip, seed: int = 2) -> Clip:
    """Another motion of the same body."""
    return motion(np.random.default_rng(seed), clip.skeleton, len(clip))


def turned(clip: Clip, bone: str, turn: Floats) -> Clip:
    """A bone turned further, about an axis of its own."""
    rotations = clip.rotations.copy()
    number = clip.skeleton.index[bone]
    rotations[:, number] = multiply(rotations[:, number], turn)
    return replace(clip, rotations=rotations)


# --- Smoothness ----------------------------------------------------------------------------------


def test_the_smoothest_way_from_rest_to_rest_has_the_known_jerk() -> None:
    # Differences are of second order: 400 frames miss by about 1 %.
    assert log_dimensionless_jerk(least_jerk(401), 400.0) == pytest.approx(SMOOTHEST, abs=0.03)
    assert pytest.approx(-5.32, abs=0.01) == SMOOTHEST


@given(
    size=st.floats(0.01, 100.0),
    pace=st.floats(1.0, 240.0),
    axis=st.tuples(*(st.floats(-2.0, 2.0) for _ in range(3))),
    shift=st.tuples(*(st.floats(-2.0, 2.0) for _ in range(3))),
)
def test_size_pace_and_place_do_not_change_smoothness(
    size: float, pace: float, axis: tuple[float, ...], shift: tuple[float, ...]
) -> None:
    path = least_jerk(31) + 0.05 * np.sin(np.linspace(0.0, 9.0, 31))[:, None] * [0.0, 1.0, 0.5]
    other = size * (rotate(from_rotation_vector(np.array(axis)), path) + np.array(shift))
    expected = log_dimensionless_jerk(path, 30.0)
    assert log_dimensionless_jerk(other, pace) == pytest.approx(expected, abs=1e-4)


def test_a_jump_is_less_smooth_and_rest_says_nothing() -> None:
    path = least_jerk(61)
    jump = path.copy()
    jump[30:] += [0.0, 0.05, 0.0]
    assert log_dimensionless_jerk(jump, 60.0) < log_dimensionless_jerk(path, 60.0) - 1.0
    assert np.isnan(log_dimensionless_jerk(np.ones((9, 3)), 30.0))
    with pytest.raises(ValueError, match="five frames"):
        log_dimensionless_jerk(path[:4], 60.0)


# --- What was seen -------------------------------------------------------------------------------


@pytest.mark.parametrize("part", PARTS.values(), ids=lambda part: part.name)
def test_a_clip_misses_itself_by_nothing(part: Part) -> None:
    clip = body()
    splice = Splice(part, clip, Timing(1.0, 1.0), LANDMARKS)
    errors = (
        path_error(clip, LANDMARKS, splice),
        turn_error(clip, LANDMARKS, splice),
    )
    assert all(len(each) == len(clip) for each in errors)
    assert sum(each.shape[1] for each in errors) == len(splice.part.sides)
    assert all(np.abs(each).max(initial=0.0) < 1e-6 for each in errors)


def test_an_arm_that_hangs_instead_of_pointing_aside_misses_by_the_root_of_two() -> None:
    random = np.random.default_rng(3)
    clip = motion(random, humanoid(random), 8, strength=0.0)
    skeleton = clip.skeleton
    # Straight aside from shoulder to hand; then down, by a quarter turn about the body's Y axis.
    names = ("upper_arm.R", "forearm.R", "hand.R")
    matrices = skeleton.rest_matrices.copy()
    for number, name in enumerate(names):
        matrices[skeleton.index[name], :3, 3] = (-0.18 - 0.3 * number, 0.0, 1.44)
    skeleton = replace(skeleton, rest_matrices=matrices)
    straight = replace(clip, skeleton=skeleton)
    arm = skeleton.rest_rotations[skeleton.index["upper_arm.R"]]
    inverse = arm * np.array([1.0, -1.0, -1.0, -1.0])
    quarter = multiply(multiply(inverse, turned_about((0.0, 1.0, 0.0), -0.5 * np.pi)), arm)
    hanging = turned(straight, "upper_arm.R", quarter)
    splice = Splice(RIGHT_ARM, hanging, Timing(1.0, 1.0), LANDMARKS)
    assert limb_length(skeleton, LANDMARKS, ARM.limb_on("R")) == pytest.approx(0.6)
    assert path_error(straight, LANDMARKS, splice) == pytest.approx(np.sqrt(2.0))


def test_a_hand_is_out_of_reach_by_what_the_arm_is_too_short() -> None:
    clip = body()
    skeleton = clip.skeleton
    splice = Splice(RIGHT_ARM, clip, Timing(1.0, 1.0), LANDMARKS)
    assert out_of_reach(clip, LANDMARKS, splice).max() == 0.0
    # The other body is built alike, but its chest and shoulders are twice as wide: seen from the
    # chest its hands are farther away.
    matrices = skeleton.rest_matrices.copy()
    for name in ("upper_arm", "forearm", "hand", "finger"):
        matrices[skeleton.index[f"{name}.R"], 0, 3] -= 0.9
    wide = replace(clip, skeleton=replace(skeleton, rest_matrices=matrices))
    splice = replace(splice, clip=wide)
    beyond = out_of_reach(clip, LANDMARKS, splice)
    assert beyond.max() > 0.1
    for goal in ("direction", "exact"):
        result = spliced(clip, LANDMARKS, replace(splice, goal=goal))
        left = out_of_reach(result, LANDMARKS, splice)
        assert (path_error(result, LANDMARKS, splice) >= left - 1e-9).all()


def test_only_frames_in_which_the_splice_is_fully_in_count() -> None:
    clip = body()
    timing = Timing(11.0, 1.0, length=20.0, ease_in=5.0, ease_out=5.0)
    splice = Splice(RIGHT_ARM, another(clip), timing, LANDMARKS)
    assert path_error(clip, LANDMARKS, splice).shape == (11, 1)
    result = spliced(clip, LANDMARKS, splice)
    assert path_error(result, LANDMARKS, splice).max() < 1e-6
    assert path_error(clip, LANDMARKS, splice).max() > 0.05


@pytest.mark.parametrize(("part", "bone"), [(HEAD, "head"), (TRUNK, "chest")])
def test_a_head_or_chest_that_is_turned_is_off_by_that_angle(part: Part, bone: str) -> None:
    clip = body()
    other = turned(clip, bone, turned_about((0.0, 0.6, 0.8), 0.3))
    splice = Splice(part, other, Timing(1.0, 1.0), LANDMARKS)
    assert turn_error(clip, LANDMARKS, splice) == pytest.approx(0.3)


def test_where_the_body_stands_and_faces_does_not_matter() -> None:
    clip = body()
    other = another(clip)
    away = moved(clip, turned_about((0.0, 0.0, 1.0), 2.0), np.array([3.0, 1.0, 0.0]))
    for part in PARTS.values():
        splice = Splice(part, other, Timing(1.0, 1.0), LANDMARKS)
        for measure in (path_error, turn_error):
            here, there = (measure(each, LANDMARKS, splice) for each in (clip, away))
            assert there == pytest.approx(here, abs=1e-6)


@pytest.mark.parametrize("part", PARTS.values(), ids=lambda part: part.name)
def test_on_one_skeleton_a_bone_by_bone_copy_is_as_good_on_another_it_is_not(part: Part) -> None:
    base = body()
    other = another(base)
    splice = Splice(part, other, Timing(1.0, 1.0), LANDMARKS)
    copied = plain_copy(base, LANDMARKS, splice)
    assert path_error(copied, LANDMARKS, splice).max(initial=0.0) < 1e-6
    assert turn_error(copied, LANDMARKS, splice).max(initial=0.0) < 1e-6
    # The same motion in a file whose rest pose is posed.
    posed = in_another_file(np.random.default_rng(7), other, posed_rest=True)
    splice = replace(splice, clip=posed)
    copied, ours = (
        path_error(make(base, LANDMARKS, splice), LANDMARKS, splice)
        for make in (plain_copy, spliced)
    )
    assert ours.max(initial=0.0) < 1e-6
    assert copied.size == 0 or copied.max() > 0.05


# --- Seams ---------------------------------------------------------------------------------------


def test_a_clip_on_itself_is_as_rough_as_it_is() -> None:
    clip = body(frames=60)
    timing = Timing(20.0, 20.0, length=25.0, ease_in=6.0, ease_out=6.0)
    splice = Splice(RIGHT_ARM, clip, timing, LANDMARKS)
    found = seams(spliced(clip, LANDMARKS, splice), clip, LANDMARKS, splice)
    assert len(found) == 2
    for seam in found:
        assert seam.roughness == pytest.approx(0.0, abs=1e-6)


def test_a_hard_cut_is_rougher_than_an_eased_one() -> None:
    clip = body(frames=60)
    hard = Splice(RIGHT_ARM, another(clip), Timing(20.0, 1.0, length=25.0), LANDMARKS)
    eased = replace(hard, timing=replace(hard.timing, ease_in=8.0, ease_out=8.0))
    rough, soft = (
        seams(spliced(clip, LANDMARKS, each), clip, LANDMARKS, each) for each in (hard, eased)
    )
    assert len(rough) == len(soft) == 2
    for cut, ease in zip(rough, soft, strict=True):
        assert cut.roughness > ease.roughness + 1.0


def test_roughness_is_against_the_rougher_source() -> None:
    assert Seam(result=-8.0, base=-6.0, splice=-7.0).roughness == pytest.approx(1.0)


def test_a_splice_that_lasts_from_end_to_end_has_no_seams() -> None:
    clip = body()
    splice = Splice(LEGS, another(clip), Timing(1.0, 1.0), LANDMARKS)
    assert seams(spliced(clip, LANDMARKS, splice), clip, LANDMARKS, splice) == []


# --- Feet ----------------------------------------------------------------------------------------


def standing(frames: int = 10) -> Clip:
    random = np.random.default_rng(5)
    clip = motion(random, humanoid(random), frames, strength=0.0)
    return replace(clip, locations=np.zeros_like(clip.locations))


def sliding(clip: Clip, step: tuple[float, float, float]) -> Clip:
    """The object carried along, so far each frame."""
    world = clip.world.copy()
    world[:, :3, 3] += np.arange(len(clip))[:, None] * np.array(step)
    return replace(clip, world=world)


def test_feet_of_a_body_that_stands_are_at_rest_and_do_not_slip() -> None:
    clip = standing()
    still = feet_at_rest(clip, LANDMARKS)
    assert still.shape == (10, 4)
    assert still.all()
    slip = foot_slip(clip, LANDMARKS, still)
    assert slip.shape == (9 * 4,)
    assert slip.max() < 1e-12


def test_slip_is_the_way_along_the_ground_in_metres() -> None:
    clip = standing()
    still = feet_at_rest(clip, LANDMARKS)
    away = sliding(clip, (0.03, 0.04, 0.5))
    assert foot_slip(away, LANDMARKS, still) == pytest.approx(0.05)
    assert foot_slip(away, LANDMARKS, np.zeros_like(still)).shape == (0,)


def test_feet_that_move_or_are_in_the_air_are_not_at_rest() -> None:
    clip = standing()
    assert not feet_at_rest(sliding(clip, (0.05, 0.0, 0.0)), LANDMARKS).any()
    risen = clip.world.copy()
    risen[5:, 2, 3] += 0.4
    still = feet_at_rest(replace(clip, world=risen), LANDMARKS)
    assert still[:4].all()
    assert not still[4:].any()


def test_feet_of_a_body_without_toes_are_their_ankles() -> None:
    clip = standing()
    bones = {name: bone for name, bone in LANDMARKS.bones.items() if "toe" not in name}
    bare = type(LANDMARKS)(bones)
    assert feet_at_rest(clip, bare).shape == (10, 2)
    assert foot_slip(clip, bare, feet_at_rest(clip, LANDMARKS)).shape == (9 * 2,)
