# SPDX-License-Identifier: GPL-3.0-or-later
"""What must hold of splicing, on made-up bodies whose bones' axes lie anywhere."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.errors import ClipError
from octo_motion.core.rotations import (
    Floats,
    angle_between,
    from_rotation_vector,
    multiply,
    to_matrix,
)
from octo_motion.core.skeleton import Skeleton
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.clip.splice_timing import Timing
from octo_motion.core.splicing.humanoid.landmarks import Landmarks
from octo_motion.core.splicing.transfer.limb_rotation import SOFT
from octo_motion.core.splicing.transfer.parts import (
    PART_TABLE,
    PARTS,
    Part,
    PartKind,
    SeenFrom,
    chain_part,
    kind_bones,
    part_bones,
    part_named,
)
from octo_motion.core.splicing.transfer.retarget import MappedClip, find_retargets
from octo_motion.core.splicing.transfer.splice import LimbGoal, Splice, build_splices
from tests.core.rigs import skeleton_of
from tests.core.splice_bodies import (
    LANDMARKS,
    humanoid,
    in_another_file,
    motion,
    moved,
    relative,
    spliced,
    turned_about,
)

pytestmark = pytest.mark.one_blender

HEAD, LEFT_ARM, LEGS, RIGHT_ARM, TRUNK = (
    PARTS[name] for name in ("head", "left_arm", "legs", "right_arm", "trunk")
)

seeds = st.integers(0, 2**31)
parts = st.sampled_from(list(PARTS.values()))
goals = st.sampled_from(["direction", "exact"])
few = settings(max_examples=40)

FROM_START = Timing(1.0, 1.0)


def positions(clip: Clip) -> Floats:
    return clip.posed()[1]


@few
@given(seed=seeds, part=parts, goal=goals, clavicle=st.booleans())
def test_a_part_of_a_clip_on_itself_gives_the_clip_back(
    seed: int, part: Part, goal: LimbGoal, *, clavicle: bool
):
    random = np.random.default_rng(seed)
    clip = motion(random, humanoid(random))
    for travel in {False, part.kind is not None and part.kind.travels}:
        splice = Splice(part, clip, FROM_START, LANDMARKS, goal, travel, clavicle)
        result = spliced(clip, LANDMARKS, splice)
        assert angle_between(result.rotations, clip.rotations).max() < 1e-6
        assert np.abs(positions(result) - positions(clip)).max() < 1e-6


@few
@given(seed=seeds, part=parts, goal=goals)
def test_moving_and_turning_the_splice_clip_changes_nothing(seed: int, part: Part, goal: LimbGoal):
    random = np.random.default_rng(seed)
    base = motion(random, humanoid(random))
    clip = motion(random, humanoid(random, same_proportions=False))
    anyhow = from_rotation_vector(random.normal(size=3))
    about_the_vertical = turned_about((0.0, 0.0, 1.0), random.normal())
    # A trunk leans against the vertical as its clip does: laid on its back it is another one.
    usual: tuple[SeenFrom, ...] = ("",)
    seen_from: tuple[SeenFrom, ...] = ("pelvis", "joint") if part is TRUNK else usual
    for turn, seen in ((about_the_vertical, usual), (anyhow, seen_from)):
        away = moved(clip, turn, random.normal(size=3))
        for asked in seen:
            results = [
                spliced(
                    base,
                    LANDMARKS,
                    Splice(part, each, FROM_START, LANDMARKS, goal, seen_from=asked),
                )
                for each in (clip, away)
            ]
            assert angle_between(results[0].rotations, results[1].rotations).max() < 1e-6


@few
@given(seed=seeds, angle=st.floats(-3.0, 3.0))
def test_travel_begins_where_the_base_stands_and_faces(seed: int, angle: float):
    random = np.random.default_rng(seed)
    base = motion(random, humanoid(random))
    clip = motion(random, humanoid(random), strength=0.2)
    # Also about the vertical and to another height: the ground is the clip's own.
    away = moved(clip, turned_about((0.0, 0.0, 1.0), angle), np.array([3.0, -2.0, 5.0]))
    results = [
        spliced(base, LANDMARKS, Splice(LEGS, each, FROM_START, LANDMARKS, travel=True))
        for each in (clip, away)
    ]
    assert np.abs(positions(results[0]) - positions(results[1])).max() < 1e-6
    hips = base.skeleton.index["hips"]
    level = (positions(results[0]) - positions(base))[0, hips, :2]
    # The pelvis, midway between the hip joints, stands where it was; it may be tilted otherwise.
    assert np.linalg.norm(level) < 0.1


@few
@given(seed=seeds, part=parts, goal=goals, posed_rest=st.booleans())
def test_axes_units_and_rest_pose_of_the_splice_file_change_nothing(
    seed: int, part: Part, goal: LimbGoal, *, posed_rest: bool
):
    random = np.random.default_rng(seed)
    base = motion(random, humanoid(random), strength=0.4)
    clip = motion(random, base.skeleton, strength=0.4)
    other = in_another_file(random, clip, posed_rest=posed_rest)
    results = [
        spliced(base, LANDMARKS, Splice(part, each, FROM_START, LANDMARKS, goal))
        for each in (clip, other)
    ]
    # Where a rest pose is a pose, nothing tells how an end bone was turned about itself.
    ends = [base.skeleton.index[f"finger.{side}"] for side in "LR"] if posed_rest else []
    chosen = [bone for bone in range(len(base.skeleton)) if bone not in ends]
    error = np.abs(positions(results[0]) - positions(results[1]))[:, chosen].max()
    assert error < 1e-3


@few
@given(seed=seeds, part=parts, goal=goals)
def test_other_bones_keep_the_base_and_nothing_given_is_changed(
    seed: int, part: Part, goal: LimbGoal
):
    random = np.random.default_rng(seed)
    base = motion(random, humanoid(random))
    clip = motion(random, humanoid(random, same_proportions=False))
    before = [
        array.copy()
        for each in (base, clip)
        for array in (each.rotations, each.locations, each.world, each.frames)
    ]
    timing = Timing(3.0, 2.0, length=7.0, ease_in=2.0, ease_out=2.0)
    result = spliced(base, LANDMARKS, Splice(part, clip, timing, LANDMARKS, goal))
    changed = {base.skeleton.index[name] for name in part_bones(part, base.skeleton, LANDMARKS)}
    others = [bone for bone in range(len(base.skeleton)) if bone not in changed]
    assert np.array_equal(result.rotations[:, others], base.rotations[:, others])
    assert np.array_equal(result.locations, base.locations)
    assert np.array_equal(result.rotations[:3], base.rotations[:3])
    assert np.array_equal(result.rotations[9:], base.rotations[9:])
    after = [
        array
        for each in (base, clip)
        for array in (each.rotations, each.locations, each.world, each.frames)
    ]
    assert all(np.array_equal(one, two) for one, two in zip(before, after, strict=True))


@few
@given(seed=seeds, goal=goals)
def test_the_hand_goes_through_the_chest_as_it_did_in_the_splice_clip(seed: int, goal: LimbGoal):
    random = np.random.default_rng(seed)
    skeleton = humanoid(random)
    base, clip = motion(random, skeleton), motion(random, skeleton)
    result = spliced(base, LANDMARKS, Splice(RIGHT_ARM, clip, FROM_START, LANDMARKS, goal))
    for bone in ("forearm.R", "hand.R", "finger.R"):
        assert np.allclose(relative(result, bone, "chest"), relative(clip, bone, "chest"))


@few
@given(seed=seeds)
def test_without_the_clavicle_the_hand_still_lands_exactly_where_it_reaches(seed: int):
    random = np.random.default_rng(seed)
    skeleton = humanoid(random)
    base, clip = motion(random, skeleton, strength=0.3), motion(random, skeleton, strength=0.3)
    splice = Splice(RIGHT_ARM, clip, FROM_START, LANDMARKS, "exact", clavicle=False)
    result = spliced(base, LANDMARKS, splice)
    wanted = relative(clip, "hand.R", "chest")
    missed = np.linalg.norm(relative(result, "hand.R", "chest") - wanted, axis=-1)
    needed = np.linalg.norm(wanted - relative(base, "upper_arm.R", "chest"), axis=-1)
    heads = skeleton.heads[[skeleton.index[f"{n}.R"] for n in ("upper_arm", "forearm", "hand")]]
    arm = np.linalg.norm(np.diff(heads, axis=0), axis=1).sum()
    # Up to the last stretch of its reach, over which the elbow straightens gently.
    assert (missed[needed < (1.0 - 2.0 * SOFT) * arm] < 1e-3 * arm).all()
    # Out of reach the arm is stretched towards it.
    assert (missed <= np.maximum(needed - arm, 0.0) + 0.6 * SOFT * arm).all()


def test_an_arm_that_does_not_hang_on_its_collar_bone_comes_without_it():
    random = np.random.default_rng(5)
    skeleton = humanoid(random)
    parents = list(skeleton.parents)
    upper, clavicle = (skeleton.index[LANDMARKS[f"{name}.R"]] for name in ("upper_arm", "clavicle"))
    assert parents[upper] == clavicle
    parents[upper] = parents[clavicle]
    base = motion(random, skeleton)
    loose = motion(random, replace(skeleton, parents=tuple(parents)))
    for ours, theirs in ((base, loose), (loose, base)):
        with_it, without = (
            spliced(
                ours,
                LANDMARKS,
                Splice(RIGHT_ARM, theirs, FROM_START, LANDMARKS, clavicle=each),
            )
            for each in (True, False)
        )
        np.testing.assert_array_equal(with_it.rotations, without.rotations)


def test_trunk_and_head_seen_from_the_pelvis_take_the_whole_orientation():
    random = np.random.default_rng(5)
    skeleton = humanoid(random)
    base, clip = motion(random, skeleton), motion(random, skeleton)
    trunk = Splice(TRUNK, clip, FROM_START, LANDMARKS, seen_from="pelvis")
    others = [Splice(part, clip, FROM_START, LANDMARKS) for part in (HEAD, LEFT_ARM)]
    result = build_splices(base, LANDMARKS, [trunk, *others])
    assert np.allclose(relative(result, "crown", "hips"), relative(clip, "crown", "hips"))
    assert np.allclose(relative(result, "hand.L", "hips"), relative(clip, "hand.L", "hips"))


@pytest.mark.parametrize("part", [LEGS, RIGHT_ARM, TRUNK])
def test_bones_of_another_body_stay_as_long_as_its_own(part: Part):
    # A game character's controls tear feet off shins: on a person, whose bones may be connected
    # in one file and not in the next, that is neither wanted nor to be played everywhere.
    random = np.random.default_rng(8)
    base = motion(random, humanoid(random))
    clip = motion(random, humanoid(random, same_proportions=False))
    moving = clip.locations + random.normal(0.0, 0.1, clip.locations.shape)
    torn = replace(clip, locations=moving)
    connected = replace(base.skeleton, connected=tuple(each >= 0 for each in base.skeleton.parents))
    for each in (clip, torn):
        splice = Splice(part, each, FROM_START, LANDMARKS)
        result = spliced(base, LANDMARKS, splice)
        assert np.array_equal(result.locations, base.locations)
        fixed = spliced(replace(base, skeleton=connected), LANDMARKS, splice)
        assert np.array_equal(fixed.rotations, result.rotations)


def test_bones_of_the_same_body_stretch_as_in_the_clip_unless_they_cannot():
    random = np.random.default_rng(9)
    base = motion(random, humanoid(random))
    clip = motion(random, base.skeleton)
    foot = base.skeleton.index["foot.R"]
    clip.locations[:, foot] = random.normal(0.0, 0.1, (len(clip), 3))
    splice = Splice(LEGS, clip, FROM_START, LANDMARKS)
    result = spliced(base, LANDMARKS, splice)
    assert np.abs(result.locations[:, foot] - clip.locations[:, foot]).max() < 1e-9
    fixed = [bone == foot for bone in range(len(base.skeleton))]
    held = replace(base, skeleton=replace(base.skeleton, connected=tuple(fixed)))
    assert not spliced(held, LANDMARKS, splice).locations[:, foot].any()


def test_a_stack_is_rebuilt_retimed_and_reordered_as_data():
    random = np.random.default_rng(6)
    skeleton = humanoid(random)
    base, one, two = (motion(random, skeleton) for _ in range(3))
    right = Splice(RIGHT_ARM, one, FROM_START, LANDMARKS)
    left = Splice(LEFT_ARM, two, Timing(4.0, 1.0), LANDMARKS)
    both = build_splices(base, LANDMARKS, [right, left])
    assert np.array_equal(both.rotations, build_splices(base, LANDMARKS, [left, right]).rotations)
    step = spliced(spliced(base, LANDMARKS, right), LANDMARKS, left)
    # A clip with another's arm has a reference pose of its own: nearly that of the base.
    assert angle_between(both.rotations, step.rotations).max() < np.radians(0.3)
    assert np.array_equal(both.locations, step.locations)
    later = build_splices(base, LANDMARKS, [right, replace(left, timing=Timing(6.0, 1.0))])
    assert not np.array_equal(later.rotations, both.rotations)


def test_seams_are_smooth_when_eased():
    random = np.random.default_rng(7)
    skeleton = humanoid(random)
    base, clip = motion(random, skeleton, 200), motion(random, skeleton, 200)
    own = max(angle_between(c.rotations[1:], c.rotations[:-1]).max() for c in (base, clip))
    timing = Timing(30.0, 30.0, length=100.0, ease_in=30.0, ease_out=30.0)
    result = spliced(base, LANDMARKS, Splice(RIGHT_ARM, clip, timing, LANDMARKS))
    steps = angle_between(result.rotations[1:], result.rotations[:-1])
    # At most π apart, mixed within 30 frames at up to 1.5 times the mean speed, on top of both.
    assert steps.max() < 2.0 * own + 1.5 * np.pi / 30.0


def tentacles(counts: dict[str, int]) -> Skeleton:
    """Straight arms round a body, each of so many bones and one unit long."""
    names, parents, matrices = ["body"], [-1], [np.eye(4)]
    for number, (name, count) in enumerate(counts.items()):
        turn = turned_about((0.0, 0.0, 1.0), 2.0 * np.pi * number / len(counts))
        for place in range(count):
            matrix = np.eye(4)
            # A bone points along Y: turned to X, then to the arm's own direction.
            matrix[:3, :3] = to_matrix(multiply(turn, turned_about((0.0, 0.0, 1.0), -np.pi / 2)))
            matrix[:3, 3] = matrix[:3, 1] * (0.2 + place / count)
            parents.append(0 if place == 0 else len(names) - 1)
            names.append(f"{name}{place}")
            matrices.append(matrix)
    lengths = [0.1, *(1.0 / count for count in counts.values() for _ in range(count))]
    return skeleton_of(names, parents, matrices, lengths)


def test_any_chain_can_be_spliced_also_onto_another_arm():
    random = np.random.default_rng(8)
    skeleton = tentacles({"a": 6, "b": 6, "c": 6})
    base, clip = motion(random, skeleton), motion(random, skeleton)
    result = spliced(base, None, Splice(chain_part("b0", "a0"), clip, FROM_START))
    chosen = [skeleton.index[f"b{place}"] for place in range(6)]
    source = [skeleton.index[f"a{place}"] for place in range(6)]
    # Arms that stand alike on their body do the same turns.
    error = angle_between(result.rotations[:, chosen], clip.rotations[:, source])
    assert error.max() < 1e-6
    same = spliced(base, None, Splice(chain_part("a0"), clip, FROM_START))
    assert angle_between(same.rotations[:, source], clip.rotations[:, source]).max() < 1e-6


@pytest.mark.parametrize("counts", [(6, 12), (12, 6), (5, 7)])
def test_chains_of_unlike_numbers_of_bones_take_the_same_shape(counts: tuple[int, int]):
    ours, theirs = tentacles({"a": counts[0]}), tentacles({"x": counts[1]})
    base = motion(np.random.default_rng(9), ours)
    clip = motion(np.random.default_rng(9), theirs)
    bend = np.linspace(0.0, 1.5, len(clip))[:, None] / counts[1]
    rotations = from_rotation_vector(bend[..., None] * np.array([0.0, 0.0, 1.0]))
    clip = replace(clip, rotations=np.broadcast_to(rotations, clip.rotations.shape).copy())
    clip.rotations[:, 0] = base.rotations[:, 0] = (1.0, 0.0, 0.0, 0.0)
    result = spliced(base, None, Splice(chain_part("a0", "x0"), clip, FROM_START))
    tips = relative(result, f"a{counts[0] - 1}", "body")
    place = (counts[0] - 1) / counts[0] * counts[1]
    lower = relative(clip, f"x{min(int(place), counts[1] - 1)}", "body")
    assert np.linalg.norm(tips - lower, axis=-1).max() < 1.5 / min(counts)


def test_what_is_missing_is_told():
    random = np.random.default_rng(10)
    clip = motion(random, humanoid(random))
    without = Landmarks({key: value for key, value in LANDMARKS.bones.items() if key != "hand.R"})
    with pytest.raises(ClipError, match=r"right hand \(clip 'made up'\)\. Say it"):
        spliced(clip, without, Splice(RIGHT_ARM, clip, FROM_START, LANDMARKS))
    with pytest.raises(ClipError, match="not known which bones"):
        spliced(clip, LANDMARKS, Splice(RIGHT_ARM, clip, FROM_START))
    with pytest.raises(ClipError, match="no legs"):
        spliced(clip, LANDMARKS, Splice(HEAD, clip, FROM_START, LANDMARKS, travel=True))
    with pytest.raises(ClipError, match="no bone 'tail'"):
        spliced(clip, None, Splice(chain_part("tail"), clip, FROM_START))


def test_a_kind_of_part_that_the_skeleton_lacks_is_told_and_never_becomes_another():
    skeleton = humanoid(np.random.default_rng(0))
    wing = PartKind("wing", root="wing", below="chest", seen_from=("chest",))
    with pytest.raises(ClipError, match="which bone is the wing"):
        kind_bones(wing, "", skeleton, LANDMARKS, clavicle=True)
    with pytest.raises(ValueError, match="not 'wing'"):
        part_named("wing")


def test_the_table_keeps_its_order():
    names = "right_arm left_arm legs trunk head right_leg left_leg chain"
    assert [part.name for part in PART_TABLE][:8] == names.split()


@pytest.mark.parametrize("seed", range(30))
def test_taking_the_collar_bone_along_hardly_turns_the_hand(seed: int):
    """Whether arms count as the same body's must not hang on the collar bones."""
    random = np.random.default_rng(seed)
    ours = MappedClip(motion(random, humanoid(random)), LANDMARKS)
    theirs = MappedClip(motion(random, humanoid(random, same_proportions=False)), LANDMARKS)
    hand = ours.skeleton.index["hand.R"]
    with_it, without = (
        find_retargets(PARTS["right_arm"], ours, theirs, clavicle=clavicle, seen_from="")[0].match
        for clavicle in (True, False)
    )
    turn = angle_between(with_it.constants[hand], without.constants[hand])
    assert np.degrees(turn) < 1.0
    assert with_it.same_body == without.same_body
