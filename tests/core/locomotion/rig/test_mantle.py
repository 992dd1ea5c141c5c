# SPDX-License-Identifier: GPL-3.0-or-later
"""A swimming body stretches head and mantle out in line with its arms."""

import dataclasses

import numpy as np
import pytest

from octo_motion.core.locomotion.rig.arm_chains import BodyFrame, body_frame
from octo_motion.core.locomotion.rig.poses import find_mantle, lies_back, stretch_mantle
from octo_motion.core.rotations import Floats, angle_between, rotate
from octo_motion.core.skeleton import Skeleton
from tests.core.rigs import body_with_arms, bone_matrix, skeleton_of

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def octopus(lean: float = 40.0) -> tuple[Skeleton, list[tuple[str, ...]], BodyFrame]:
    """Arms, and above them a head and a mantle that leans back, with an eye and a siphon."""
    arms_alone, arms, _ = body_with_arms(4, 3)
    names = [*arms_alone.names, "head", "mantle", "eye", "siphon"]
    last = len(arms_alone)
    parents = [*arms_alone.parents, 0, last, last, last]
    angle = np.radians(lean)
    along = np.array([0.0, np.sin(angle), np.cos(angle)])
    neck = np.array([0.0, 0.05, 0.2])
    matrices = [
        *arms_alone.rest_matrices,
        bone_matrix(np.zeros(3), neck, 0.3),
        bone_matrix(neck, along, -0.7),
        bone_matrix(neck, np.array([1.0, 0.0, 0.2]), 0.0),
        bone_matrix(neck, np.array([0.0, 1.0, -1.0]), 0.0),
    ]
    lengths = [*arms_alone.lengths, float(np.linalg.norm(neck)), 0.4, 0.1, 0.1]
    skeleton = skeleton_of(names, parents, matrices, lengths)
    bones = [arm.bones for arm in arms]
    return skeleton, bones, body_frame(skeleton, bones, "Z", "-Y")


def posed_along(skeleton: Skeleton, mantle: tuple[str, ...], turns: Floats) -> Floats:
    """Directions (bones, 3) of the mantle's bones once turned."""
    basis = np.tile(IDENTITY, (len(skeleton), 1))
    basis[[skeleton.index[name] for name in mantle]] = turns
    orientations, _ = skeleton.pose(basis)
    return rotate(
        orientations[[skeleton.index[name] for name in mantle]], np.array([0.0, 1.0, 0.0])
    )


def test_head_and_mantle_are_found_and_eyes_and_siphon_left_alone() -> None:
    assert find_mantle(*octopus()) == ("head", "mantle")


def test_fully_stretched_they_point_the_way_that_the_body_swims() -> None:
    skeleton, arms, body = octopus()
    mantle = find_mantle(skeleton, arms, body)

    turns = stretch_mantle(skeleton, mantle, body, 1.0)

    assert np.allclose(posed_along(skeleton, mantle, turns), [0.0, 0.0, 1.0], atol=1e-9)


def test_not_stretched_they_stay_at_rest() -> None:
    skeleton, arms, body = octopus()

    turns = stretch_mantle(skeleton, find_mantle(skeleton, arms, body), body, 0.0)

    assert np.max(angle_between(turns, IDENTITY)) <= 1e-7


def test_the_more_is_asked_for_the_straighter_they_are() -> None:
    skeleton, arms, body = octopus()
    mantle = find_mantle(skeleton, arms, body)

    upright = [
        posed_along(skeleton, mantle, stretch_mantle(skeleton, mantle, body, amount))[-1, 2]
        for amount in (0.0, 0.3, 0.6, 1.0)
    ]

    assert np.all(np.diff(upright) > 0.0)


def turned_aside(lean: float) -> tuple[Skeleton, list[tuple[str, ...]], BodyFrame]:
    """The same with a body that takes its left for its front: the mantle leans to a side."""
    skeleton, arms, _ = octopus(lean)
    return skeleton, arms, body_frame(skeleton, arms, "Z", "X")


@pytest.mark.parametrize("body", [octopus(120.0), turned_aside(80.0)])
def test_a_part_that_hangs_down_or_lies_across_the_body_is_left_alone(
    body: tuple[Skeleton, list[tuple[str, ...]], BodyFrame],
) -> None:
    assert find_mantle(*body) == ()


@pytest.mark.parametrize("lean", [80.0, 90.0, 100.0])
def test_a_mantle_that_lies_flat_is_swum_along_as_it_lies(lean: float) -> None:
    skeleton, arms, body = octopus(lean)
    mantle = find_mantle(skeleton, arms, body)
    assert mantle == ("head", "mantle")
    # The head stands upright: it is the mantle's own lean that counts.
    assert np.degrees(lies_back(skeleton, mantle, body)) == pytest.approx(lean)


def test_a_mantle_that_can_be_raised_does_not_lie() -> None:
    skeleton, arms, body = octopus(70.0)
    assert lies_back(skeleton, find_mantle(skeleton, arms, body), body) == 0.0
    assert lies_back(skeleton, (), body) == 0.0


def test_a_flat_mantle_may_be_level_with_the_arms_or_a_little_lower() -> None:
    skeleton, arms, body = octopus(92.0)
    matrices = skeleton.rest_matrices.copy()
    for name in ("head", "mantle", "eye", "siphon"):
        matrices[skeleton.index[name], 2, 3] -= 0.2
    low = dataclasses.replace(skeleton, rest_matrices=matrices)
    assert body.to_body(low.tails[low.index["mantle"]])[2] < 0.0
    assert find_mantle(low, arms, body) == ("head", "mantle")


def test_stalks_that_stand_higher_than_a_mantle_that_lies_back_are_not_taken_for_it() -> None:
    skeleton, arms, body = octopus(70.0)
    eye = skeleton.index["eye"]
    matrices = skeleton.rest_matrices.copy()
    matrices[eye] = bone_matrix(np.array([0.05, 0.0, 0.2]), np.array([0.0, 0.0, 1.0]), 0.0)
    lengths = skeleton.lengths.copy()
    lengths[eye] = 0.3
    stalked = dataclasses.replace(skeleton, rest_matrices=matrices, lengths=lengths)
    assert stalked.tails[eye, 2] > stalked.tails[stalked.index["mantle"], 2]
    assert find_mantle(stalked, arms, body) == ("head", "mantle")


def test_bones_without_length_that_importers_put_in_between_ride_along() -> None:
    """Each bone of the mantle hangs on a twin that begins where it does, and points anywhere."""
    skeleton, arms, body = octopus()
    names, parents = list(skeleton.names), list(skeleton.parents)
    matrices, lengths = list(skeleton.rest_matrices), list(skeleton.lengths)
    for name in ("head", "mantle"):
        bone = names.index(name)
        astray = bone_matrix(matrices[bone][:3, 3], np.array([0.0, -1.0, 0.1]), 0.4)
        names.append(f"{name} twin")
        parents.append(parents[bone])
        matrices.append(astray)
        lengths.append(0.2)
        parents[bone] = len(names) - 1
        # Importers do not know where a bone ends.
        matrices[bone] = astray
    # Parents come first. Eye and siphon begin where the mantle does, and nobody could tell them.
    kept = [bone for bone, name in enumerate(names) if name not in {"eye", "siphon"}]
    order = sorted(kept, key=lambda bone: _depth(parents, bone))
    place = {bone: number for number, bone in enumerate(order)}
    imported = skeleton_of(
        [names[bone] for bone in order],
        [place.get(parents[bone], -1) for bone in order],
        [matrices[bone] for bone in order],
        [lengths[bone] for bone in order],
    )
    mantle = find_mantle(imported, arms, body)
    assert mantle == ("head", "mantle")
    turns = stretch_mantle(imported, mantle, body, 1.0)
    basis = np.tile(IDENTITY, (len(imported), 1))
    basis[[imported.index[name] for name in mantle]] = turns
    _, heads = imported.pose(basis)
    first, second = (heads[imported.index[name]] for name in mantle)
    assert np.allclose((second - first) / np.linalg.norm(second - first), [0, 0, 1], atol=1e-9)


def _depth(parents: list[int], bone: int) -> int:
    return 0 if bone < 0 else 1 + _depth(parents, parents[bone])


def test_a_mantle_beside_the_bone_that_carries_the_arms_belongs_to_it() -> None:
    """Two bones without parents that begin at one place: one carries arms, one is the mantle."""
    skeleton, arms, body = octopus()
    head = skeleton.index["head"]
    parents = list(skeleton.parents)
    parents[head] = -1
    apart = dataclasses.replace(skeleton, parents=tuple(parents))
    assert find_mantle(apart, arms, body) == ("head", "mantle")
    matrices = apart.rest_matrices.copy()
    for name in ("head", "mantle", "eye", "siphon"):
        matrices[apart.index[name], :3, 3] += 0.1
    assert find_mantle(dataclasses.replace(apart, rest_matrices=matrices), arms, body) == ()


def test_a_part_that_constraints_move_is_left_to_them() -> None:
    skeleton, arms, body = octopus()
    driven = tuple(name == "mantle" for name in skeleton.names)

    assert find_mantle(dataclasses.replace(skeleton, constrained=driven), arms, body) == ()


def test_a_body_of_arms_alone_has_no_mantle() -> None:
    skeleton, arms, body = body_with_arms(4, 3)
    bones = [arm.bones for arm in arms]

    assert find_mantle(skeleton, bones, body) == ()
    assert stretch_mantle(skeleton, (), body, 1.0).shape == (0, 4)
