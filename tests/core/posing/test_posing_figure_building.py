# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones as rigid bodies."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.posing.puppet.bone_roles import RigFacts, find_roles
from octo_motion.core.posing.puppet.build import (
    JointLimits,
    PosedBones,
    build_figure,
    turned_bodies,
)
from octo_motion.core.posing.puppet.figure import Figure, Pose, pose_of
from octo_motion.core.rotations import (
    IDENTITY,
    Floats,
    angle_between,
    conjugate,
    from_axis_angle,
    from_rotation_vector,
    multiply,
    rotate,
)
from octo_motion.core.skeleton import Skeleton
from tests.core.humanoids import PARENTS, humanoid
from tests.core.puppets import capsule_inertia
from tests.core.rigs import body_with_arms, bone_matrix, skeleton_of

BODY = humanoid({name: name for name in PARENTS})


def posed(skeleton: Skeleton, basis: Floats | None = None, turn: Floats = IDENTITY) -> PosedBones:
    if basis is None:
        basis = np.tile(IDENTITY, (len(skeleton), 1))
    rotations, heads = skeleton.pose(basis)
    return PosedBones(
        heads=rotate(turn, heads),
        rotations=multiply(turn, rotations),
        lengths=skeleton.lengths.copy(),
        turn=turn,
    )


def built(
    skeleton: Skeleton, bones: PosedBones | None = None, **more: object
) -> tuple[Figure, Pose]:
    roles = find_roles(skeleton, RigFacts())
    return build_figure(skeleton, roles, bones or posed(skeleton), **more)  # type: ignore[arg-type]


def random_basis(count: int, seed: int, size: float = 0.6) -> Floats:
    return from_rotation_vector(np.random.default_rng(seed).normal(0.0, size, (count, 3)))


@given(st.integers(0, 10_000))
def test_figure_stands_where_the_bones_stand_in_any_pose(seed: int) -> None:
    turn = from_rotation_vector(np.random.default_rng(seed + 1).normal(0.0, 1.0, 3))
    bones = posed(BODY, random_basis(len(BODY), seed), turn)
    figure, pose = built(BODY, bones)
    # Joints put together from the figure alone lead to the same places.
    parents = np.array(figure.parents)
    own = pose.orientations.copy()
    hanging = parents >= 0
    own[hanging] = multiply(
        conjugate(pose.orientations[parents[hanging]]), pose.orientations[hanging]
    )
    again = pose_of(figure, own, pose.positions)
    assert again.positions == pytest.approx(pose.positions, abs=1e-12)
    assert angle_between(again.orientations, pose.orientations).max() < 1e-7


def test_orientations_at_rest_are_those_of_the_rest_pose_whatever_the_pose_is() -> None:
    at_rest, _ = built(BODY)
    bent, _ = built(BODY, posed(BODY, random_basis(len(BODY), 3)))
    assert angle_between(at_rest.rest, bent.rest).max() < 1e-7


def test_mass_and_inertia_are_those_of_a_solid_capsule() -> None:
    figure, _ = built(BODY)
    arm = figure.names.index("upper_arm.L")
    straight = float(np.linalg.norm(figure.capsules[arm, 1] - figure.capsules[arm, 0]))
    mass, inertia = capsule_inertia(straight, float(figure.radii[arm]))
    assert figure.masses[arm] == pytest.approx(mass)
    assert figure.inertias[arm] == pytest.approx(inertia, rel=1e-9, abs=1e-12)
    assert figure.centres[arm] == pytest.approx([0.0, 0.5 * figure.lengths[arm], 0.0])


def test_capsule_reaches_from_the_bones_head_to_its_tail() -> None:
    figure, _ = built(BODY)
    thigh = figure.names.index("thigh.R")
    radius = figure.radii[thigh]
    assert figure.capsules[thigh, 0] == pytest.approx([0.0, radius, 0.0])
    assert figure.capsules[thigh, 1] == pytest.approx([0.0, figure.lengths[thigh] - radius, 0.0])


def test_skin_tells_how_thick_a_limb_is() -> None:
    rng = np.random.default_rng(5)
    bone = BODY.index["forearm.L"]
    angle = rng.uniform(0.0, 2.0 * np.pi, 400)
    share = rng.uniform(0.0, BODY.lengths[bone], 400)
    ring = np.stack([0.06 * np.cos(angle), share, 0.06 * np.sin(angle)], axis=1)
    cloud = BODY.heads[bone] + rotate(BODY.rest_rotations[bone], ring)
    figure, _ = built(BODY, skin={bone: cloud})
    assert figure.radii[figure.names.index("forearm.L")] == pytest.approx(0.06, rel=1e-6)


def test_limb_without_skin_beside_one_with_skin_is_as_thick() -> None:
    bone = BODY.index["forearm.L"]
    rng = np.random.default_rng(5)
    cloud = BODY.heads[bone] + rng.normal(0.0, 0.05, (100, 3))
    figure, _ = built(BODY, skin={bone: cloud})
    names = figure.names
    assert figure.radii[names.index("upper_arm.L")] == figure.radii[names.index("forearm.L")]


def test_tiny_bone_beside_large_ones_has_a_mass_that_can_be_simulated() -> None:
    octopus, _, _ = body_with_arms(joints=30, taper=0.97)
    figure, _ = built(octopus)
    assert figure.masses.min() >= 1e-3 * figure.masses.max() * (1.0 - 1e-12)
    assert np.linalg.eigvalsh(figure.inertias).min() > 0.0


def test_bone_whose_tail_an_importer_made_up_reaches_to_the_next_joint() -> None:
    # As in files of glTF without lengths: bones of a centimetre, joints a metre apart.
    up = np.array([0.0, 0.0, 1.0])
    rig = skeleton_of(
        ["a", "b", "c"],
        [-1, 0, 1],
        [bone_matrix(np.array([height, 0.0, 0.0]), up, 0.0) for height in (0.0, 1.0, 1.8)],
        [0.01, 0.01, 0.01],
    )
    figure, _ = built(rig)
    assert figure.lengths == pytest.approx([1.0, 0.8, 0.4])
    tips = np.linalg.norm(figure.capsules[:, 1], axis=1) + figure.radii
    assert tips == pytest.approx(figure.lengths)


def test_pose_beyond_a_limit_widens_it_so_that_nothing_snaps() -> None:
    basis = np.tile(IDENTITY, (len(BODY), 1))
    shin = BODY.index["shin.L"]
    basis[shin] = from_axis_angle([1.0, 0.0, 0.0], 1.2)
    knee = JointLimits(x=(0.0, 0.5), twist=(-0.1, 0.1))
    figure, _ = built(BODY, posed(BODY, basis), limits={"shin.L": knee, "shin.R": knee})
    left, right = figure.names.index("shin.L"), figure.names.index("shin.R")
    ranges = figure.limits
    # A pose at the very end of a range is given room as well.
    assert ranges[left, 0] == pytest.approx([0.0, 1.2], abs=2e-3)
    assert ranges[left, 0, 1] > 1.2
    assert ranges[right, 0] == pytest.approx([0.0, 0.5], abs=2e-3)
    assert ranges[right, 1] == pytest.approx([-0.1, 0.1])
    free = [-np.pi, np.pi]
    assert ranges[right, 2] == pytest.approx(free)
    assert ranges[figure.names.index("foot.L")] == pytest.approx(np.tile(free, (3, 1)))


def test_touched_is_what_was_turned_and_a_root_that_was_moved() -> None:
    figure, pose = built(BODY)
    orientations, positions = pose.orientations.copy(), pose.positions.copy()
    hand = figure.names.index("hand.L")
    orientations[hand] = multiply(orientations[hand], from_axis_angle([1.0, 0.0, 0.0], 0.1))
    positions[0] += [0.0, 0.0, 0.2]
    after = Pose(positions, orientations)
    assert turned_bodies(figure, pose, after) == [0, hand]
    assert turned_bodies(figure, pose, pose) == []


def test_whole_figure_that_is_carried_round_is_touched_at_its_root_alone() -> None:
    figure, pose = built(BODY)
    turn = from_axis_angle([0.0, 0.0, 1.0], 0.7)
    after = Pose(rotate(turn, pose.positions), multiply(turn, pose.orientations))
    assert turned_bodies(figure, pose, after) == [0]
