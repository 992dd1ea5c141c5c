# SPDX-License-Identifier: GPL-3.0-or-later
"""The octopus' proportions and bones, as plain numbers."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.errors import SettingsError
from octo_motion.core.locomotion.octopus.rig import (
    ARM_COLLECTIONS,
    FIRST_ARM_BONE,
    OctopusBones,
    arm_bone_names,
    arm_pairs,
    build_bones,
)
from octo_motion.core.locomotion.octopus.shape import ARMS, JOINTS, OctopusShape

pytestmark = pytest.mark.one_blender

# The source's example, [Octopus] eq. 3.1 and 3.2: 12 joints, w₀ = 1, τ = 0.01.
SOURCE_DIAMETERS = (1.0, 0.99, 0.98, 0.97, 0.96, 0.95, 0.94, 0.93, 0.92, 0.91, 0.9, 0.89)
SOURCE_SEGMENTS = (0.5, 0.495, 0.49, 0.485, 0.48, 0.475, 0.47, 0.465, 0.46, 0.455, 0.45, 0.445)
SOURCE = OctopusShape(joints=12, first_diameter=1.0, taper=0.12, arm_length=sum(SOURCE_SEGMENTS))

shapes = st.builds(
    OctopusShape,
    arms=st.integers(*ARMS),
    joints=st.integers(JOINTS[0], 40),
    arm_length=st.floats(0.1, 50.0),
    first_diameter=st.floats(0.001, 5.0),
    taper=st.floats(0.0, 1.0),
)


def lengths_of_first_arm(bones: OctopusBones, joints: int) -> Any:
    arm = slice(FIRST_ARM_BONE, FIRST_ARM_BONE + joints)
    return np.linalg.norm(bones.tails[arm] - bones.heads[arm], axis=-1)


def test_the_sources_arm_comes_out_as_printed() -> None:
    np.testing.assert_allclose(SOURCE.diameters, SOURCE_DIAMETERS, atol=1e-9)
    np.testing.assert_allclose(SOURCE.segments, SOURCE_SEGMENTS, atol=1e-9)
    np.testing.assert_allclose(
        lengths_of_first_arm(build_bones(SOURCE), 12), SOURCE_SEGMENTS, atol=1e-9
    )


def test_a_longer_arm_has_the_same_proportions() -> None:
    longer = OctopusShape(joints=12, first_diameter=1.0, taper=0.12, arm_length=57.0)
    np.testing.assert_allclose(
        lengths_of_first_arm(build_bones(longer), 12) / 57.0,
        np.array(SOURCE_SEGMENTS) / sum(SOURCE_SEGMENTS),
        atol=1e-9,
    )


def test_eight_arms_stand_45_degrees_apart_from_the_front() -> None:
    bones = build_bones(OctopusShape())
    roots = slice(FIRST_ARM_BONE, None, 12)
    way = bones.tails[roots] - bones.heads[roots]
    # From the front, −Y, towards the left, +X.
    angles = np.degrees(np.arctan2(way[:, 0], -way[:, 1]))
    expected = {
        "arm1.01.L": 22.5, "arm2.01.L": 67.5, "arm3.01.L": 112.5, "arm4.01.L": 157.5,
        "arm4.01.R": -157.5, "arm3.01.R": -112.5, "arm2.01.R": -67.5, "arm1.01.R": -22.5,
    }  # fmt: skip
    assert bones.names[roots] == tuple(expected)
    np.testing.assert_allclose(angles, list(expected.values()), atol=1e-9)


def test_names_are_the_documented_ones() -> None:
    names = build_bones(OctopusShape()).names
    assert names[:FIRST_ARM_BONE] == (
        "root", "body", "head", "mantle", "siphon", "eye.L", "eye.R",
    )  # fmt: skip
    assert names[FIRST_ARM_BONE] == "arm1.01.L"
    assert {"arm1.12.L", "arm4.12.R"} <= set(names)
    assert len(names) == FIRST_ARM_BONE + 8 * 12


def test_an_odd_arm_is_in_the_middle_in_front_and_has_no_side() -> None:
    # Behind it would be below the mantle and the siphon, and the one that is left to tiptoe on.
    assert arm_pairs(5) == ((1, ""), (2, "L"), (3, "L"), (3, "R"), (2, "R"))
    assert arm_pairs(1) == ((1, ""),)
    bones = build_bones(OctopusShape(arms=5))
    tip = bones.tails[bones.names.index("arm1.12")]
    np.testing.assert_allclose(tip[0], 0.0, atol=1e-12)
    assert tip[1] < -0.5


def test_numbers_have_as_many_digits_as_they_need_so_that_names_sort() -> None:
    names = arm_bone_names(64, 200)
    assert names[0][0] == "arm01.001.L"
    assert names[0][-1] == "arm01.200.L"
    assert names[-1][0] == "arm01.001.R"
    assert list(names[0]) == sorted(names[0])


@given(shapes)
def test_arms_lie_parallel_to_the_ground_with_their_dorsal_side_up(shape: OctopusShape) -> None:
    bones = build_bones(shape)
    arms = bones.matrices[FIRST_ARM_BONE:]
    np.testing.assert_allclose(arms[:, 2, 1], 0.0, atol=1e-9)
    np.testing.assert_allclose(arms[:, :3, 2], np.broadcast_to([0, 0, 1], (len(arms), 3)))


@given(shapes)
def test_every_bone_has_a_right_handed_frame_and_a_parent_before_it(shape: OctopusShape) -> None:
    bones = build_bones(shape)
    axes = bones.matrices[:, :3, :3]
    np.testing.assert_allclose(
        axes @ np.swapaxes(axes, 1, 2), np.broadcast_to(np.eye(3), axes.shape), atol=1e-9
    )
    np.testing.assert_allclose(np.linalg.det(axes), 1.0, atol=1e-9)
    assert all(parent < index for index, parent in enumerate(bones.parents))
    assert bones.parents.count(-1) == 1


@given(shapes)
def test_connected_bones_start_where_their_parents_end(shape: OctopusShape) -> None:
    bones = build_bones(shape)
    for index, (parent, connected) in enumerate(zip(bones.parents, bones.connected, strict=True)):
        if connected:
            np.testing.assert_allclose(
                bones.heads[index], bones.tails[parent], atol=1e-9 * shape.arm_length
            )


@given(shapes)
def test_left_and_right_are_mirror_images(shape: OctopusShape) -> None:
    bones = build_bones(shape)
    index = {name: number for number, name in enumerate(bones.names)}
    size = shape.arm_length + shape.first_diameter
    for name, number in index.items():
        stem, dot, side = name.rpartition(".")
        partner = index[stem + dot + {"L": "R", "R": "L"}.get(side, side)]
        for ends in (bones.heads, bones.tails):
            np.testing.assert_allclose(ends[number] * [-1, 1, 1], ends[partner], atol=1e-12 * size)


@given(shapes)
def test_each_arm_is_in_the_collection_of_its_side(shape: OctopusShape) -> None:
    bones = build_bones(shape)
    left, right, middle = ARM_COLLECTIONS
    for name, collection in list(zip(bones.names, bones.collections, strict=True))[FIRST_ARM_BONE:]:
        expected = left if name.endswith(".L") else right if name.endswith(".R") else middle
        assert collection == expected


def test_a_single_root_lies_on_the_ground_and_moves_everything() -> None:
    bones = build_bones(OctopusShape())
    np.testing.assert_array_equal(bones.heads[0], (0, 0, 0))
    np.testing.assert_allclose(bones.matrices[0], np.eye(4), atol=1e-12)
    assert not bones.deform[0]
    assert all(bones.deform[1:])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"arms": 0}, "Arms is 0. Choose a value from 1 to 64."),
        ({"arms": 65}, "Arms is 65. Choose a value from 1 to 64."),
        ({"joints": 2}, "Joints per arm is 2. Choose a value from 3 to 200."),
        ({"joints": 201}, "Joints per arm is 201. Choose a value from 3 to 200."),
        ({"taper": 1.5}, "Taper is 1.5. Choose a value from 0 to 1."),
        ({"taper": float("nan")}, "Taper is nan. Choose a value from 0 to 1."),
        ({"mesh_taper": -0.1}, "Mesh taper is -0.1. Choose a value from 0 to 1."),
        ({"arm_length": 0.0}, "Arm length is 0. Choose a length greater than zero."),
        ({"arm_length": float("inf")}, "Arm length is inf. Choose a length greater than zero."),
        ({"first_diameter": -1.0}, "First diameter is -1. Choose a length greater than zero."),
        (
            {"arm_length": 0.01, "joints": 200, "taper": 1.0},
            (
                "The last bones of an arm would be only 5e-07 m long. "
                "Choose longer arms, fewer joints or less taper."
            ),
        ),
    ],
)
def test_impossible_choices_are_refused_with_what_to_do(wrong: Any, message: str) -> None:
    with pytest.raises(SettingsError) as caught:
        OctopusShape(**wrong)
    assert str(caught.value) == message
