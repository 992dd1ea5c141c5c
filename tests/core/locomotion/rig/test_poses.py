# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones follow their segments whatever their axes, and twist by bank alone."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.locomotion.rig.bone_rotations import (
    ArmRest,
    arm_rest,
    rotate_bones,
    sucker_sides,
)
from octo_motion.core.rotations import Floats, angle_between, normalized, rotate
from octo_motion.core.skeleton import Skeleton
from tests.core.rigs import bone_matrix, skeleton_of

seeds = st.integers(0, 2**31)


def a_chain(
    random: np.random.Generator,
    count: int = 6,
    *,
    helpers: bool = False,
    not_inheriting: tuple[str, ...] = (),
    imported: bool = False,
) -> tuple[Skeleton, list[str]]:
    """A bent chain of rolled bones; perhaps with helpers, or with axes that lie anywhere."""
    names, parents, matrices, lengths, chain = ["body"], [-1], [np.eye(4)], [1.0], []
    head, along = np.zeros(3), np.array([1.0, 0.0, 0.0])
    for number in range(count):
        along = normalized(along + random.normal(0.0, 0.3, 3))
        if helpers:
            parents.append(len(names) - 1)
            names.append(f"helper{number}")
            matrices.append(bone_matrix(head, random.normal(size=3), random.uniform(0, 6)))
            lengths.append(0.1)
        parents.append(len(names) - 1)
        names.append(f"bone{number}")
        chain.append(names[-1])
        axis = random.normal(size=3) if imported else along
        matrices.append(bone_matrix(head, axis, random.uniform(0, 6)))
        lengths.append(0.01 if imported else 1.0)
        head = head + along
    return skeleton_of(names, parents, matrices, lengths, not_inheriting), chain


def posed_segments(skeleton: Skeleton, chain: list[str], rotations: Floats) -> Floats:
    """Directions (bones − 1, frames, 3) from head to head after forward kinematics."""
    basis = np.zeros((rotations.shape[1], len(skeleton), 4))
    basis[..., 0] = 1.0
    order = [skeleton.index[name] for name in chain]
    basis[:, order] = np.moveaxis(rotations, 0, 1)
    _, heads = skeleton.pose(basis)
    return np.moveaxis(normalized(np.diff(heads[:, order], axis=1)), 1, 0)


def rotations_of(rest: ArmRest, directions: Floats, bank: Floats) -> Floats:
    """Rotations (bones, frames, 4) of a single arm, from directions (bones, frames, 3)."""
    columns = np.moveaxis(directions, -1, 1)[..., None]
    return np.moveaxis(rotate_bones([rest], columns, bank[..., None])[:, 0], 1, 0)


def wanted_directions(random: np.random.Generator, count: int, frames: int = 5) -> Floats:
    steps = random.normal(0.0, 0.4, (count, frames, 3))
    return normalized(np.array([1.0, 0.0, 0.0]) + np.cumsum(steps, axis=0))


@given(seed=seeds, helpers=st.booleans(), imported=st.booleans(), banked=st.booleans())
def test_segments_point_where_the_solver_wants_them(
    seed: int,
    *,
    helpers: bool,
    imported: bool,
    banked: bool,
) -> None:
    random = np.random.default_rng(seed)
    skeleton, chain = a_chain(random, helpers=helpers, imported=imported)
    wanted = wanted_directions(random, len(chain))
    bank = random.normal(0.0, 1.0, wanted.shape[:2]) * banked

    rotations = rotations_of(arm_rest(skeleton, chain), wanted, bank)

    assert np.allclose(posed_segments(skeleton, chain, rotations), wanted[:-1], atol=1e-6)


@given(seeds)
def test_bones_that_do_not_inherit_rotation_are_posed_from_their_own_rest(seed: int) -> None:
    random = np.random.default_rng(seed)
    skeleton, chain = a_chain(random, not_inheriting=("bone2", "bone4"))
    wanted = wanted_directions(random, len(chain))

    rotations = rotations_of(arm_rest(skeleton, chain), wanted, np.zeros(wanted.shape[:2]))

    assert np.allclose(posed_segments(skeleton, chain, rotations), wanted[:-1], atol=1e-6)


@given(seeds)
def test_a_bone_turns_no_further_than_its_segment_does(seed: int) -> None:
    # The smallest rotation: any twist would add to the angle between the directions.
    random = np.random.default_rng(seed)
    skeleton, chain = a_chain(random, imported=True)
    rest = arm_rest(skeleton, chain)
    wanted = wanted_directions(random, len(chain))

    rotations = rotations_of(rest, wanted, np.zeros(wanted.shape[:2]))

    turned = angle_between(rotations, np.array([1.0, 0.0, 0.0, 0.0]))
    after = rotate(rotations, rest.segments[:, None])
    between = np.arccos(np.clip(np.sum(after * rest.segments[:, None], axis=-1), -1.0, 1.0))
    assert np.allclose(turned, between, atol=1e-6)


@given(seeds)
def test_segments_are_met_by_way_of_outward_too_and_rest_stays_rest(seed: int) -> None:
    random = np.random.default_rng(seed)
    skeleton, chain = a_chain(random, imported=True, not_inheriting=("bone2",))
    rest = replace(arm_rest(skeleton, chain), outward=normalized(random.normal(size=3)))
    wanted = wanted_directions(random, len(chain))
    order = [skeleton.index[name] for name in chain]
    at_rest = rotate(skeleton.rest_rotations[order], rest.segments)[:, None]

    rotations = rotations_of(rest, wanted, np.zeros(wanted.shape[:2]))
    unmoved = rotations_of(rest, at_rest, np.zeros(at_rest.shape[:2]))

    assert np.allclose(posed_segments(skeleton, chain, rotations), wanted[:-1], atol=1e-6)
    assert np.allclose(posed_segments(skeleton, chain, unmoved), at_rest[:-1], atol=1e-6)


@given(seeds)
def test_an_arm_that_hangs_at_rest_rears_up_without_a_snap(seed: int) -> None:
    random = np.random.default_rng(seed)
    matrices = [np.eye(4)] + [
        bone_matrix(np.array([0.0, 0.0, -each]), np.array([0.0, 0.0, -1.0]), random.uniform(0, 6))
        for each in range(4)
    ]
    names = ["body", *(f"bone{each}" for each in range(4))]
    skeleton = skeleton_of(names, [-1, 0, 1, 2, 3], matrices, [1.0] * 5)
    rest = replace(arm_rest(skeleton, names[1:]), outward=np.array([1.0, 0.0, 0.0]))
    # Past straight up, a little to one side: opposite to how it hangs.
    steps = np.radians(np.arange(60.0, 121.0))
    way = np.stack([np.cos(steps), np.full(len(steps), 0.01), np.sin(steps)], axis=-1)
    wanted = np.broadcast_to(normalized(way), (4, len(steps), 3))

    rotations = rotations_of(rest, wanted, np.zeros((4, len(steps))))

    # A step of the direction is 1°; three times that leaves room for what a way round costs.
    assert np.degrees(angle_between(rotations[:, 1:], rotations[:, :-1]).max()) <= 3.0


@given(seeds)
def test_at_rest_no_bone_turns(seed: int) -> None:
    random = np.random.default_rng(seed)
    skeleton, chain = a_chain(random, helpers=True)
    rest = arm_rest(skeleton, chain)
    order = [skeleton.index[name] for name in chain]
    directions = rotate(skeleton.rest_rotations[order], rest.segments)[:, None]

    rotations = rotations_of(rest, directions, np.zeros(directions.shape[:2]))

    assert np.max(angle_between(rotations, np.array([1.0, 0.0, 0.0, 0.0]))) <= 1e-6


@given(seeds)
def test_bones_that_hang_straight_down_have_the_side_of_the_bone_before(seed: int) -> None:
    """They had none, and rolled with it: tips that lay on the ground crept by 2 % of an arm."""
    random = np.random.default_rng(seed)
    down = np.array([0.0, 0.0, -1.0])
    slanting = normalized(np.array([[1.0, 0.0, -0.4], [0.5, 0.0, -1.0]]))
    axes = [*slanting, down, down]
    heads = np.cumsum([np.zeros(3), *axes[:-1]], axis=0)
    matrices = [np.eye(4)] + [
        bone_matrix(head, axis, random.uniform(0, 6))
        for head, axis in zip(heads, axes, strict=True)
    ]
    names = ["body", *(f"bone{each}" for each in range(4))]
    skeleton = skeleton_of(names, [-1, 0, 1, 2, 3], matrices, [1.0] * 5)

    sides = sucker_sides(skeleton, names[1:], down)

    world = rotate(skeleton.rest_rotations[1:], sides)
    # The arm bends in one plane: below it, then before it.
    wanted = [normalized(down - (down @ axis) * axis) for axis in slanting]
    assert np.allclose(world[:2], wanted, atol=1e-5)
    assert np.allclose(world[2:], np.array([[-1.0, 0.0, 0.0]] * 2), atol=1e-5)
