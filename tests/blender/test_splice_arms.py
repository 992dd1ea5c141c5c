# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms and heads point where they do in their clip, on all pairs of recorded people, from joints.

The chest is that of its joints (shoulders, neck, spine) on average over the clip, carried by its
bone: a shrug does not tilt it.
"""

from dataclasses import replace
from itertools import pairwise, permutations

import numpy as np
import pytest

from octo_motion.core.rotations import (
    Floats,
    conjugate,
    from_rotation_vector,
    multiply,
    normalized,
    rotate,
    shortest_arc,
    to_matrix,
)
from octo_motion.core.splicing.clip.clip import Clip, sample_clip, sample_world
from octo_motion.core.splicing.clip.splice_timing import Timing, splice_window
from octo_motion.core.splicing.humanoid.landmarks import Landmarks
from octo_motion.core.splicing.transfer.parts import PARTS
from octo_motion.core.splicing.transfer.splice import Splice
from tests.bench.splice_joints import joints_at
from tests.blender.test_splice_laws import GOALS, SharedData, people
from tests.core.splice_bodies import spliced
from tests.referee.clip_measures import angle, chest

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
    "makehuman/walk1.bvh",
)


class Person:
    """A clip, and its arms as seen from its chest."""

    def __init__(self, clip: Clip, marks: Landmarks) -> None:
        self.clip, self.marks = clip, marks
        between = self._bone(clip, clip.frames).transpose(0, 2, 1) @ chest(
            joints_at(clip, marks, clip.frames)
        )
        u, _, v = np.linalg.svd(between.mean(axis=0))
        self._chest = u @ v

    def chest(self, clip: Clip, frames: Floats) -> Floats:
        """(frames, 3, 3) its axes in a clip of this skeleton."""
        return self._bone(clip, frames) @ self._chest

    def neck(self, clip: Clip, frames: Floats) -> Floats:
        """(frames, 3) from neck to head."""
        joints = joints_at(clip, self.marks, frames)
        return np.einsum("mji,mj->mi", self.chest(clip, frames), joints["head"] - joints["neck"])

    def _bone(self, clip: Clip, frames: Floats) -> Floats:
        bone = clip.skeleton.index[self.marks["chest"]]
        turned = multiply(
            sample_world(clip, frames)[0], sample_clip(clip, frames).orientation(bone)
        )
        return to_matrix(turned)

    def arm(self, clip: Clip, frames: Floats) -> Floats:
        """(frames, 3) right shoulder to hand in lengths of the arm, in a clip of this skeleton."""
        joints = joints_at(clip, self.marks, frames)
        along = [joints[f"right_{each}"] for each in ("shoulder", "elbow", "hand")]
        length = sum(np.linalg.norm(b - a, axis=-1) for a, b in pairwise(along))
        axes = self.chest(clip, frames)
        return np.einsum("mji,mj->mi", axes, along[2] - along[0]) / np.asarray(length)[:, None]


_FOUND: dict[str, Person] = {}


def persons(shared_data: SharedData) -> dict[str, Person]:
    """All of them, loaded once."""
    if not _FOUND:
        each = people(shared_data, PEOPLE, 300)
        _FOUND.update({name: Person(*one) for name, one in each.items()})
    return _FOUND


def test_a_head_lies_from_the_neck_where_it_does_in_its_clip(shared_data: SharedData) -> None:
    # However many bones bend the necks: a second one bends by up to 13° in some.
    found = persons(shared_data)
    for (name, base), (other, person) in permutations(found.items(), 2):
        if not (base.marks.get("neck") and person.marks.get("neck")):
            continue
        timing = Timing(base.clip.frames[0], person.clip.frames[0])
        splice = Splice(PARTS["head"], person.clip, timing, person.marks)
        result = spliced(base.clip, base.marks, splice)
        window = splice_window(timing, base.clip, person.clip)
        fully = window.weights >= 1.0
        ours = base.neck(result, base.clip.frames[window.frames][fully])
        theirs = person.neck(person.clip, window.splice_frames[fully])
        assert angle(ours, theirs).max(initial=0.0) < 3.0, (name, other)


def test_an_arm_points_from_the_chest_where_it_does_in_its_clip(shared_data: SharedData) -> None:
    found = persons(shared_data)
    for (name, base), (other, person) in permutations(found.items(), 2):
        for goal in GOALS:
            splice = Splice(
                PARTS["right_arm"],
                person.clip,
                Timing(base.clip.frames[0], person.clip.frames[0]),
                person.marks,
                goal,
            )
            result = spliced(base.clip, base.marks, splice)
            window = splice_window(splice.timing, base.clip, splice.clip)
            fully = window.weights >= 1.0
            ours = base.arm(result, base.clip.frames[window.frames][fully])
            theirs = person.arm(person.clip, window.splice_frames[fully])
            # How two chests are held on average differs by up to 1.9°; 0.3° is usual.
            assert angle(ours, theirs).max(initial=0.0) < 3.0, (name, other, goal)
            if goal == "exact":
                # Past the chest as it is held, a hand goes the same way.
                u, _, v = np.linalg.svd(theirs.T @ ours)
                turned = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
                off = np.linalg.norm(ours - theirs @ turned, axis=-1)
                reached = np.linalg.norm(theirs, axis=-1) < 0.97
                assert off[reached].max(initial=0.0) < 0.02, (name, other, goal)


def with_an_arm_up(person: Person, side: str = "R", shoulder: float = 25.0) -> Clip:
    """The same clip with an arm up all the time, its shoulder raised by so many degrees."""
    clip = person.clip
    skeleton, index = clip.skeleton, clip.skeleton.index
    axes = person.chest(clip, clip.frames)
    sign = 1.0 if side == "R" else -1.0
    # From the chest to this side and up, and about what points back.
    turns = sample_world(clip, clip.frames)[0]
    raised = np.einsum("mij,j->mi", axes, np.array([-0.3 * sign, 0.0, 1.0]))
    back = np.einsum("mij,j->mi", axes, np.array([0.0, np.radians(shoulder) * sign, 0.0]))
    rotations = clip.rotations.copy()

    def turn(landmark: str, by: Floats) -> None:
        bone = index[person.marks[landmark]]
        lay = skeleton.pose(rotations, clip.locations)[0][:, bone]
        rotations[:, bone] = multiply(
            rotations[:, bone], multiply(conjugate(lay), multiply(by, lay))
        )

    turn(f"clavicle.{side}", from_rotation_vector(rotate(conjugate(turns), back)))
    heads = skeleton.pose(rotations, clip.locations)[1]
    arm = (index[person.marks[f"{each}.{side}"]] for each in ("upper_arm", "forearm"))
    root, elbow = (heads[:, bone] for bone in arm)
    ways = normalized(elbow - root), normalized(rotate(conjugate(turns), raised))
    turn(f"upper_arm.{side}", shortest_arc(*ways))
    return replace(clip, rotations=rotations)


@pytest.mark.parametrize(("shoulder", "most"), [(25.0, 8.0), (0.0, 0.01)])
def test_an_arm_that_is_up_all_the_time_turns_nothing_else(
    shared_data: SharedData, shoulder: float, most: float
) -> None:
    # The other arm and the head of one clip onto a base, with an arm hanging and with an arm up.
    found = persons(shared_data)
    for number, ((name, base), (other, person)) in enumerate(permutations(found.items(), 2)):
        if number % 4:
            continue
        timing = Timing(base.clip.frames[0], person.clip.frames[0])
        seen = ("left_arm", "left_shoulder", "left_elbow"), ("head", "neck", "head")
        for part, start, end in seen:
            ways = []
            for onto in (base.clip, with_an_arm_up(base, "R", shoulder)):
                splice = Splice(PARTS[part], person.clip, timing, person.marks)
                result = spliced(onto, base.marks, splice)
                fully = splice_window(timing, onto, person.clip)
                frames = onto.frames[fully.frames][fully.weights >= 1.0]
                joints = joints_at(result, base.marks, frames)
                ways.append(joints[end] - joints[start])
            off = angle(*ways)
            # 3.3 to 6.8 where collar bones begin in the middle, 12 and more by the shoulders alone:
            # those of that person lie as much askew when both arms hang, the left one higher: where
            # the right one is not raised with its arm, it is believed. Elsewhere nothing.
            assert off.max(initial=0.0) < most, (name, other, part)
