# SPDX-License-Identifier: GPL-3.0-or-later
"""Mirrored clips: what the right arm does goes onto the left one, whatever the bones' axes are."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from octo_motion.core.rotations import Floats, angle_between, from_rotation_vector
from octo_motion.core.skeleton import Skeleton
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.clip.splice_timing import Timing
from octo_motion.core.splicing.humanoid.counterparts import mirror_images
from octo_motion.core.splicing.humanoid.landmarks import Landmarks
from octo_motion.core.splicing.transfer.mirror import mirrored_clip
from octo_motion.core.splicing.transfer.parts import PARTS, Part, chain_part, opposite_part
from octo_motion.core.splicing.transfer.splice import LimbGoal, Splice
from tests.core.rigs import skeleton_of
from tests.core.splice_bodies import LANDMARKS, humanoid, motion, moved, spliced

pytestmark = pytest.mark.one_blender

seeds = st.integers(0, 2**31)
parts = st.sampled_from(list(PARTS.values()))
goals = st.sampled_from(["direction", "exact"])
few = settings(max_examples=30)

FROM_START = Timing(1.0, 1.0)
ACROSS = np.array([-1.0, 1.0, 1.0])


def other_side(name: str) -> str:
    return {"L": f"{name[:-1]}R", "R": f"{name[:-1]}L"}.get(name[-1], name)


def positions(clip: Clip) -> dict[str, Floats]:
    heads = clip.posed()[1]
    return {name: heads[:, number] for number, name in enumerate(clip.skeleton.names)}


@few
@given(seed=seeds)
def test_a_mirrored_clip_has_the_mirror_images_of_all_joints_whatever_its_axes(seed: int):
    random = np.random.default_rng(seed)
    clip = motion(random, humanoid(random, same_proportions=False))
    before = positions(clip)
    mirrored, landmarks = mirrored_clip(clip, LANDMARKS)
    assert landmarks == LANDMARKS
    for name, places in positions(mirrored).items():
        assert np.abs(places - before[other_side(name)] * ACROSS).max() < 1e-9


@few
@given(seed=seeds)
def test_mirrored_twice_a_clip_is_itself(seed: int):
    random = np.random.default_rng(seed)
    clip = motion(random, humanoid(random, same_proportions=False))
    again, landmarks = mirrored_clip(*mirrored_clip(clip, LANDMARKS))
    assert landmarks == LANDMARKS
    assert again.skeleton.names == clip.skeleton.names
    assert np.array_equal(again.skeleton.rest_matrices, clip.skeleton.rest_matrices)
    assert np.array_equal(again.rotations, clip.rotations)
    assert np.array_equal(again.locations, clip.locations)
    assert np.array_equal(again.world, clip.world)


# Bodies whose pelvises cannot be compared: their legs are seen from the hip joints.
@few
@given(seed=seeds, part=parts, goal=goals)
@example(seed=0, part=PARTS["legs"], goal="direction")
@example(seed=15, part=PARTS["right_leg"], goal="exact")
def test_a_mirrored_splice_is_the_mirror_image_of_the_splice_on_a_mirrored_base(
    seed: int, part: Part, goal: LimbGoal
):
    random = np.random.default_rng(seed)
    base = motion(random, humanoid(random))
    clip = motion(random, humanoid(random, same_proportions=False))
    travel = part.kind is not None and part.kind.travels
    splice = Splice(part, clip, FROM_START, LANDMARKS, goal, travel, mirror=True)
    result = positions(spliced(base, LANDMARKS, splice))
    plain = replace(splice, part=opposite_part(part), mirror=False)
    base_mirrored, marks = mirrored_clip(base, LANDMARKS)
    wanted = positions(spliced(base_mirrored, marks, plain))
    for name, places in result.items():
        assert np.abs(places - wanted[other_side(name)] * ACROSS).max() < 1e-6


@few
@given(seed=seeds, part=parts)
def test_where_a_mirrored_clip_stands_and_faces_changes_nothing(seed: int, part: Part):
    random = np.random.default_rng(seed)
    base = motion(random, humanoid(random))
    clip = motion(random, humanoid(random, same_proportions=False))
    # Travel goes about the vertical: the ground is level in both.
    away = moved(clip, from_rotation_vector(np.array([0.0, 0.0, 2.0])), np.array([3.0, 1.0, 0.5]))
    travel = part.kind is not None and part.kind.travels
    one, other = (
        spliced(
            base, LANDMARKS, Splice(part, each, FROM_START, LANDMARKS, travel=travel, mirror=True)
        )
        for each in (clip, away)
    )
    assert np.abs(one.posed()[1] - other.posed()[1]).max() < 1e-6


def test_of_a_mirrored_chain_the_mirror_image_is_taken_unless_another_bone_is_named():
    random = np.random.default_rng(5)
    skeleton = humanoid(random)
    base, clip = motion(random, skeleton), motion(random, skeleton)
    chains = (
        (chain_part("upper_arm.L"), "upper_arm.R"),
        (chain_part("upper_arm.L", "upper_arm.R"), "upper_arm.R"),
        (chain_part("upper_arm.R", "upper_arm.L"), "upper_arm.L"),
    )
    for part, taken in chains:
        result = spliced(base, None, Splice(part, clip, FROM_START, mirror=True))
        # Elbows bend as the mirror image's does.
        for each in ("forearm", "hand"):
            ours = skeleton.index[f"{each}.{part.root[-1]}"]
            theirs = skeleton.index[f"{each}.{taken[-1]}"]
            still = angle_between(result.rotations[:, ours], result.rotations[:1, ours])
            moves = angle_between(clip.rotations[:, theirs], clip.rotations[:1, theirs])
            assert np.abs(still - moves).max() < 1e-6


def test_fingers_that_are_only_numbered_answer_by_their_place():
    names = ["hips", "Left Hand", "a.7", "a.8", "Right Hand", "a.3", "a.4", "tail"]
    parents = [-1, 0, 1, 2, 0, 4, 5, 0]
    skeleton: Skeleton = skeleton_of(names, parents, [np.eye(4)] * 8, [0.1] * 8)
    assert mirror_images(skeleton, None) == (0, 4, 5, 6, 1, 2, 3, 7)
    landmarks = Landmarks({"hand.L": "a.7", "hand.R": "a.3"})
    assert mirror_images(skeleton, landmarks)[2] == 5


@pytest.mark.parametrize("part", PARTS.values(), ids=PARTS)
def test_the_opposite_of_the_opposite_is_the_part(part: Part):
    assert opposite_part(opposite_part(part)) == part
    assert opposite_part(part).kind == part.kind
