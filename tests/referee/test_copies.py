# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever files differ in, splices are the same: a few copies of a few people, by the buttons.

``make bench ARGS=copies`` does all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.referee.copies import Off, keep, sweep

pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.one_blender,
]

SharedData = Callable[[str], Path]

STACKS = ("arms and head", "legs and trunk")
WALK, THROW = "secondlife/avatar_walk.bvh", "secondlife/avatar_throw_R.bvh"
CMU = "cmu/12_01_walk.bvh"
KNIGHT = "rigs_with_actions/KayKit_Knight.glb#Walking_A"


def differences(
    data: SharedData,
    folder: Path,
    pair: tuple[str, str],
    changes: tuple[str, ...],
    stacks: tuple[str, ...] = STACKS,
) -> list[Off]:
    people = {}
    for name in pair:
        file, _, action = name.partition("#")
        people[name] = keep(data(file), folder, changes, action)
    return list(sweep(people, [pair], changes, stacks))


@pytest.mark.parametrize(
    "pair",
    [
        (WALK, CMU),
        # Joints of its legs are moved by keys, and rest elsewhere.
        (WALK, KNIGHT),
        # Names that lead to themselves: __Clavicle, Clavicle.
        ("makehuman/walk1.bvh", WALK),
    ],
)
def test_a_copy_that_plays_alike_is_spliced_alike(
    shared_data: SharedData, tmp_path: Path, pair: tuple[str, str]
) -> None:
    changes = ("rest pose", "rotation modes", "centimetres", "on a root", "bvh")
    for off in differences(shared_data, tmp_path, pair, changes):
        assert not off.problem
        assert not off.landmarks
        assert off.fading < 1e-3, off
        assert off.turn < 1.0, off


def test_clips_whose_bones_turn_by_themselves_are_spliced_and_retargeted_alike(
    shared_data: SharedData, tmp_path: Path
) -> None:
    """They were up to 0.06 of the height off; a base of a splice keeps the keys of other bones."""
    stacks = (*STACKS, "whole")
    found = differences(shared_data, tmp_path, (WALK, CMU), ("turns by itself",), stacks)
    judged = [each for each in found if each.whose == "clip" or each.stack == "whole"]
    assert len(judged) == 4
    for off in judged:
        assert not off.problem
        assert off.fading < 1e-3, off
        assert off.turn < 1.0, off


def test_what_moves_joints_is_spliced_alike_onto_bones_that_are_connected_and_that_are_not(
    shared_data: SharedData, tmp_path: Path
) -> None:
    # The Knight's controls tear feet off shins; in a BVH file bones are connected, in a copy not.
    for off in differences(shared_data, tmp_path, (CMU, KNIGHT), ("as built",)):
        assert off.fading < 1e-3, off
        assert off.turn < 1.0, off


@pytest.mark.parametrize("pair", [(WALK, CMU), (KNIGHT, WALK)])
def test_keys_between_frames_are_spliced_as_those_on_frames(
    shared_data: SharedData, tmp_path: Path, pair: tuple[str, str]
) -> None:
    stacks = (*STACKS, "whole")
    for off in differences(shared_data, tmp_path, pair, ("on half frames",), stacks):
        assert not off.problem
        assert off.fading < 1e-3, off
        assert off.turn < 1.0, off


@pytest.mark.parametrize("pair", [(WALK, THROW), (THROW, WALK)])
def test_two_files_of_one_body_that_rest_in_one_pose_are_spliced_alike(
    shared_data: SharedData, tmp_path: Path, pair: tuple[str, str]
) -> None:
    for off in differences(shared_data, tmp_path, pair, ("bone axes", "glb", "bvh")):
        assert off.fading < 1e-3, off
        assert off.turn < 1.0, off


@pytest.mark.parametrize(
    "pair", [(WALK, CMU), (KNIGHT, CMU), ("cmu/02_02_walk_daz43.bvh", CMU), (CMU, KNIGHT)]
)
def test_twice_as_many_frames_a_second_are_spliced_alike(
    shared_data: SharedData, tmp_path: Path, pair: tuple[str, str]
) -> None:
    # What lies between keys is another thing in curves of quaternions than in those of angles.
    for off in differences(shared_data, tmp_path, pair, ("fps",), (*STACKS, "whole")):
        assert off.fading < 2.5e-3, off
        assert off.turn < 1.0, off


@pytest.mark.parametrize(
    "pair", [(KNIGHT, CMU), (CMU, WALK), ("makehuman/walk1.bvh", CMU), (THROW, CMU)]
)
def test_a_body_gets_a_whole_clip_alike_whatever_it_rests_like(
    shared_data: SharedData, tmp_path: Path, pair: tuple[str, str]
) -> None:
    # Controls, fingers, a jaw, hair: also what no landmark tells.
    for off in differences(shared_data, tmp_path, pair, ("rest pose",), ("whole",)):
        assert not off.problem
        assert off.joints < 1e-3, off
        assert off.turn < 1.0, off


def test_one_body_in_two_rest_poses_is_little_wrung(
    shared_data: SharedData, tmp_path: Path
) -> None:
    # Joints are where they were to the last digit, and so are the planes of elbows and knees. What
    # is left is how limbs are turned about themselves, by a constant: two files that rest alike
    # say that their axes are the same ones, a rest pose without rhyme or reason takes that away,
    # and elbows that bend anyhow do not tell it. So 21° are left (39° from each clip alone), and 8°
    # of thighs (12°). While a splice comes or goes, joints show it.
    for off in differences(shared_data, tmp_path, (THROW, WALK), ("rest pose",)):
        assert off.joints < 1e-5, off
        assert off.fading < 1e-3, off
        assert all(off.turns.get(f"{side}Shldr", 0.0) < 22.0 for side in "lr"), off
        assert all(off.turns.get(f"{side}Thigh", 0.0) < 9.0 for side in "lr"), off
