# SPDX-License-Identifier: GPL-3.0-or-later
"""Upright onto upright stays upright, on all pairs of recorded people, measured from joints."""

from itertools import permutations

import numpy as np
import pytest

from octo_motion.core.rotations import Floats
from octo_motion.core.splicing.clip.clip import Clip, sample_clip
from octo_motion.core.splicing.clip.splice_timing import Timing
from octo_motion.core.splicing.humanoid.landmarks import Landmarks
from octo_motion.core.splicing.transfer.parts import PARTS
from octo_motion.core.splicing.transfer.splice import Splice
from tests.blender.test_splice_laws import SharedData, load, people
from tests.core.splice_bodies import spliced
from tests.referee.clip_measures import angle, lean

pytestmark = [
    pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning"),
    pytest.mark.one_blender,
    pytest.mark.usefixtures("reference_poses"),
]

PEOPLE = (
    "secondlife/avatar_walk.bvh",
    "secondlife/avatar_dance1.bvh",
    "cmu/12_01_walk.bvh",
    "cmu/01_01_hops.bvh",
    "cmu/02_02_walk_daz43.bvh",
    "cmu/pirouette_threejs.bvh",
    "animated_drawings/cmu1_jumping_jacks.bvh",
    "animated_drawings/rokoko_jesse_dance.bvh",
    "misc/assimp_Boxing_Toes.bvh",
    "rigs_with_actions/KayKit_Knight.glb",
)


def trunk(clip: Clip, marks: Landmarks) -> dict[str, Floats]:
    """Joints of the trunk over the clip."""
    index, heads = clip.skeleton.index, clip.posed()[1]
    top = marks.get("neck") or marks["head"]
    return {"hips": heads[:, index[marks["hips"]]], "neck": heads[:, index[top]]}


def at(clip: Clip, marks: Landmarks, frames: Floats) -> dict[str, Floats]:
    """The same at other moments; the clip's object stands still."""
    posture = sample_clip(clip, frames)
    turn = clip.world[0, :3, :3]
    top = marks.get("neck") or marks["head"]
    bones = {"hips": marks["hips"], "neck": top}
    return {
        joint: posture.head(clip.skeleton.index[bone]) @ turn.T for joint, bone in bones.items()
    }


def test_who_stands_upright_stays_so_whatever_legs_or_trunk_are_spliced(
    shared_data: SharedData,
) -> None:
    for (name, (base, landmarks)), (other, (clip, marks)) in permutations(
        people(shared_data, PEOPLE, 400).items(), 2
    ):
        timing = Timing(base.frames[0], clip.frames[0])
        lasts = (clip.frames[-1] - clip.frames[0]) / clip.rate * base.rate
        # Where the splice is in and has not begun to go.
        fully = (base.frames > base.frames[0] + 8) & (base.frames < base.frames[0] + lasts - 8)
        rows = np.flatnonzero(fully)
        if not len(rows):
            continue
        since = (base.frames[rows] - base.frames[0]) / base.rate * clip.rate
        there = at(clip, marks, clip.frames[0] + since)
        own = trunk(base.taken(rows), landmarks)
        for part, wanted in (("trunk", there), ("legs", own)):
            splice = Splice(PARTS[part], clip, timing, marks, travel=part == "legs")
            result = trunk(spliced(base, landmarks, splice).taken(rows), landmarks)
            off = np.abs(lean(result) - lean(wanted))
            assert np.median(off) < 1.0, (part, name, other)
            assert off.max() < 3.0, (part, name, other)


def test_a_pelvis_that_happens_to_have_the_shape_of_another_is_not_taken_for_it(
    shared_data: SharedData,
) -> None:
    # Of these two skeletons both hips and their root make the same triangle, one of them hanging
    # down where the other lies back.
    clips = [
        load(shared_data(each)) for each in ("cmu/01_01_hops.bvh", "secondlife/avatar_walk.bvh")
    ]
    for (base, landmarks), (clip, marks) in permutations(clips):
        splice = Splice(PARTS["legs"], clip, Timing(base.frames[0], clip.frames[0]), marks)
        result = spliced(base, landmarks, splice)
        moved = []
        for each, known in ((result, landmarks), (clip, marks)):
            index, heads = each.skeleton.index, each.posed()[1]
            hips, knees = (
                np.mean([heads[:, index[known[f"{joint}.{side}"]]] for side in "LR"], axis=0)
                for joint in ("thigh", "shin")
            )
            moved.append(np.median((knees - hips)[: len(clip)], axis=0))
        assert angle(*moved) < 20.0
