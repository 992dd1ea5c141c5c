# SPDX-License-Identifier: GPL-3.0-or-later
"""The body is where the route wants it, whether the object moves or a root bone."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.locomotion.rig.arm_chains import body_frame
from octo_motion.core.locomotion.rig.poses import object_transforms, root_bone_transforms
from octo_motion.core.rotations import (
    angle_between,
    from_matrix,
    multiply,
    normalized,
    rotate,
    to_matrix,
)
from tests.core.rigs import body_with_arms

seeds = st.integers(0, 2**31)
axes = st.sampled_from([("Z", "-Y"), ("Y", "Z"), ("-X", "Y")])


@given(seeds, axes, st.floats(0.01, 10.0))
def test_the_object_puts_the_bodys_centre_and_axes_where_they_belong(
    seed: int, up_and_front: tuple[str, str], scale: float
) -> None:
    random = np.random.default_rng(seed)
    skeleton, arms, _ = body_with_arms(4, 3)
    body = body_frame(skeleton, [arm.bones for arm in arms], *up_and_front)
    positions = random.normal(size=(6, 3))
    rotations = normalized(random.normal(size=(6, 4)))

    locations, orientations = object_transforms(body, scale, positions, rotations)

    centres = locations + rotate(orientations, scale * body.center)
    assert np.allclose(centres, positions, atol=1e-9)
    axes_in_world = multiply(orientations, from_matrix(body.rotation))
    assert np.max(angle_between(axes_in_world, rotations)) <= 1e-7


@given(seeds, st.floats(0.01, 10.0))
def test_a_root_bone_carries_the_arms_as_the_object_would(seed: int, scale: float) -> None:
    random = np.random.default_rng(seed)
    skeleton, _, _ = body_with_arms(3, 3)
    locations = random.normal(size=(6, 3))
    orientations = normalized(random.normal(size=(6, 4)))
    still = normalized(random.normal(size=4))
    world = np.eye(4)
    world[:3, :3] = scale * to_matrix(still)
    world[:3, 3] = random.normal(size=3)

    shifts, turns = root_bone_transforms(skeleton, "root", world, locations, orientations)

    basis = np.zeros((6, len(skeleton), 4))
    basis[..., 0] = 1.0
    basis[:, 0] = turns
    moves = np.zeros((6, len(skeleton), 3))
    moves[:, 0] = shifts
    _, heads = skeleton.pose(basis, moves)
    by_bone = scale * rotate(still, heads) + world[:3, 3]
    by_object = locations[:, None] + scale * rotate(orientations[:, None], skeleton.heads)
    assert np.allclose(by_bone, by_object, atol=1e-6)
