# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever files differ in, splices are the same: a few copies of a few people, by the buttons.

``make bench ARGS=copies`` does all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.referee.copies import Off, keep, sweep

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")

SharedData = Callable[[str], Path]

STACKS = ("arms and head", "legs and trunk")
WALK, THROW = "secondlife/avatar_walk.bvh", "secondlife/avatar_throw_R.bvh"


def differences(
    data: SharedData, folder: Path, pair: tuple[str, str], changes: tuple[str, ...]
) -> list[Off]:
    people = {}
    for name in pair:
        file, _, action = name.partition("#")
        people[name] = keep(data(file), folder, changes, action)
    return list(sweep(people, [pair], changes, STACKS))


@pytest.mark.parametrize(
    "pair",
    [
        (WALK, "cmu/12_01_walk.bvh"),
        # Joints of its legs are moved by keys, and rest elsewhere.
        (WALK, "rigs_with_actions/KayKit_Knight.glb#Walking_A"),
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


def test_what_moves_joints_is_spliced_alike_onto_bones_that_are_connected_and_that_are_not(
    shared_data: SharedData, tmp_path: Path
) -> None:
    # The Knight's controls tear feet off shins; in a BVH file bones are connected, in a copy not.
    pair = "cmu/12_01_walk.bvh", "rigs_with_actions/KayKit_Knight.glb#Walking_A"
    for off in differences(shared_data, tmp_path, pair, ("as built",)):
        assert off.fading < 1e-3, off
        assert off.turn < 1.0, off


@pytest.mark.parametrize("pair", [(WALK, THROW), (THROW, WALK)])
def test_two_files_of_one_body_that_rest_in_one_pose_are_spliced_alike(
    shared_data: SharedData, tmp_path: Path, pair: tuple[str, str]
) -> None:
    for off in differences(shared_data, tmp_path, pair, ("bone axes", "glb", "bvh")):
        assert off.fading < 1e-3, off
        assert off.turn < 1.0, off


def test_one_body_in_two_rest_poses_is_little_wrung(
    shared_data: SharedData, tmp_path: Path
) -> None:
    # Its elbows bend anyhow, and no joint tells how it is turned about itself: shoulders are off
    # by 22° in the worst frame (39° from each clip alone), thighs by 10° (12°).
    for off in differences(shared_data, tmp_path, (THROW, WALK), ("rest pose",)):
        assert off.joints < 1e-3, off
        assert off.fading < 0.02, off
        assert all(off.turns.get(f"{side}Shldr", 0.0) < 30.0 for side in "lr"), off
        assert all(off.turns.get(f"{side}Thigh", 0.0) < 20.0 for side in "lr"), off
