# SPDX-License-Identifier: GPL-3.0-or-later
"""A throw with the right arm on the left arm of another, as Blender plays it.

What is wanted is made without the add-on: the clip's own file, mirrored in its numbers.
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from tests.referee import clip_measures as measures
from tests.referee.clips import Person, imported
from tests.referee.recording import moments, record
from tests.referee.rest_poses import Bvh, along_x, anyhow, leaning, with_rest

# Blender's importer leaves the file open.
pytestmark = [
    pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning"),
    pytest.mark.one_blender,
]

SharedData = Callable[[str], Path]

WALKS = ("secondlife/avatar_walk.bvh", "cmu/12_01_walk.bvh", "cmu/02_02_walk_daz43.bvh")
THROW = "secondlife/avatar_throw_R.bvh"
KICK = "secondlife/avatar_kick_roundhouse_R.bvh"
RESTS = {"leaning": leaning(26.0), "along x": along_x, "anyhow": anyhow(3)}
ACROSS = np.array([-1.0, 1.0, 1.0])


def other_side(name: str) -> str:
    """Left for right in names as "rHand" and "LeftFoot"."""
    sides = {"l": "r", "r": "l", "Left": "Right", "Right": "Left"}
    return re.sub(r"^(?:[lr](?=[A-Z])|Left|Right)", lambda found: sides[found[0]], name)


def mirrored_file(file: Bvh) -> Bvh:
    """In such files left is X."""
    column = 0
    motion = file.motion.copy()
    for joint in file.joints:
        for channel in joint.channels:
            if channel in {"Xposition", "Yrotation", "Zrotation"}:
                motion[:, column] *= -1.0
            column += 1
        joint.name = other_side(joint.name)
        joint.offset = joint.offset * ACROSS
        joint.end = None if joint.end is None else joint.end * ACROSS
    file.motion = motion
    return file


def spliced(base: Path, clip: Path, part: str, **settings: Any) -> tuple[Person, Person]:
    """Base and result where the splice is fully in, between frames too."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    onto, source = imported(base), imported(clip)
    for armature in (source, onto):
        bpy.context.view_layer.objects.active = armature
        bpy.ops.octo_motion.map_skeleton()
    start, end = (int(each) for each in onto.animation_data.action.frame_range)
    frames = moments(start, min(end, start + 40), 2)
    before = Person.of(record(onto, frames, with_skin=False))
    bpy.ops.octo_motion.splice_add(part=part, source=source.name)
    item: Any = onto.octo_motion.splicing.splices[0]
    item.ease_in = item.ease_out = 0.0
    for key, value in settings.items():
        setattr(item, key, value)
    bpy.ops.octo_motion.splice_build()
    return before, Person.of(record(onto, frames, with_skin=False))


def apart(one: Person, other: Person) -> float:
    """Of a body's height, how far joints are from each other at most."""
    away = max(np.abs(one.joints[each] - other.joints[each]).max() for each in one.joints)
    return float(away / np.max(measures.height_of(one.joints)))


@pytest.mark.parametrize("walk", WALKS)
def test_a_right_throw_on_the_left_arm_is_its_mirror_image(
    shared_data: SharedData, tmp_path: Path, walk: str
):
    throw = shared_data(THROW)
    wanted = mirrored_file(Bvh.read(throw)).write(tmp_path / "left_throw.bvh")
    before, result = spliced(shared_data(walk), throw, "LEFT_ARM", mirror=True)
    _, asked = spliced(shared_data(walk), wanted, "LEFT_ARM")
    assert apart(result, asked) < 1e-3
    # It is no small matter: the walk's own left hand is elsewhere, and the right one stays.
    assert apart(result, before) > 0.1
    for joint in ("right_elbow", "right_hand"):
        assert np.abs(result.joints[joint] - before.joints[joint]).max() < 1e-4
    # The elbow's plane too.
    twist = measures.twist_between(result.twist("arm", "left"), asked.twist("arm", "left"))
    assert twist < 1.0


@pytest.mark.parametrize("part", ["LEGS", "TRUNK", "HEAD", "RIGHT_LEG"])
def test_every_part_is_mirrored_and_travel_goes_the_other_way(
    shared_data: SharedData, tmp_path: Path, part: str
):
    walk, kick = shared_data(WALKS[1]), shared_data(KICK)
    wanted = mirrored_file(Bvh.read(kick)).write(tmp_path / "other_kick.bvh")
    travel = part == "LEGS"
    _, result = spliced(walk, kick, part, mirror=True, with_travel=travel)
    _, asked = spliced(walk, wanted, part, with_travel=travel)
    assert apart(result, asked) < 1e-3


@pytest.mark.parametrize("rest", RESTS)
def test_no_rest_pose_changes_a_mirrored_throw(shared_data: SharedData, tmp_path: Path, rest: str):
    walk, throw = shared_data(WALKS[1]), shared_data(THROW)
    other = with_rest(Bvh.read(throw), RESTS[rest]).write(tmp_path / "other.bvh")
    results = [
        spliced(walk, each, "LEFT_ARM", mirror=True, mode=mode)[1]
        for each in (throw, other)
        for mode in ("DIRECTION", "EXACT")
    ]
    assert apart(results[0], results[2]) < 1e-3
    assert apart(results[1], results[3]) < 1e-3


def test_twice_mirrored_a_throw_is_the_throw(shared_data: SharedData, tmp_path: Path):
    walk, throw = shared_data(WALKS[1]), shared_data(THROW)
    other = mirrored_file(Bvh.read(throw)).write(tmp_path / "left_throw.bvh")
    _, plain = spliced(walk, throw, "RIGHT_ARM")
    _, again = spliced(walk, other, "RIGHT_ARM", mirror=True)
    assert apart(plain, again) < 1e-3
