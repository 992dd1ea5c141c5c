# SPDX-License-Identifier: GPL-3.0-or-later
"""Skeletons of bodies with arms, made from numbers: no Blender needed."""

from collections.abc import Sequence

import numpy as np

from octo_motion.core.locomotion.gait.gait_poser import Arm
from octo_motion.core.locomotion.rig.arm_chains import BodyFrame, body_frame
from octo_motion.core.rotations import Floats, from_axis_angle, rotate
from octo_motion.core.skeleton import Skeleton

UP = np.array([0.0, 0.0, 1.0])


def bone_matrix(head: Floats, along: Floats, roll: float) -> Floats:
    """A bone's rest matrix: local Y along the bone, rolled from where Z is closest to up."""
    y = along / np.linalg.norm(along)
    near = UP if abs(y[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    x = np.cross(y, near)
    x /= np.linalg.norm(x)
    x = rotate(from_axis_angle(y, roll), x)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([x, y, np.cross(x, y)], axis=1)
    matrix[:3, 3] = head
    return matrix


def body_with_arms(
    arms: int = 8,
    joints: int = 12,
    length: float = 1.0,
    *,
    taper: float = 0.5,
    rest: Floats | None = None,
    rolls: np.random.Generator | None = None,
) -> tuple[Skeleton, tuple[Arm, ...], BodyFrame]:
    """A root bone and arms all round it, the first one left of the front.

    ``rest``: (joints, 3) rest directions of the segments in the arm's frame (x outward, z up),
    straight outward if none. ``rolls``: where random bone rolls come from, none for none.
    """
    names, parents, matrices, lengths = ["root"], [-1], [bone_matrix(np.zeros(3), UP, 0.0)], [0.2]
    segments = 1.0 - taper * np.arange(joints) / joints
    segments *= length / segments.sum()
    if rest is None:
        rest = np.broadcast_to([1.0, 0.0, 0.0], (joints, 3))
    listed = []
    for number in range(arms):
        angle = (number + 0.5) * 2.0 * np.pi / arms
        outward = from_axis_angle(UP, angle - 0.5 * np.pi)
        directions = rotate(outward, np.asarray(rest))
        head = 0.1 * length * rotate(outward, np.array([1.0, 0.0, 0.0]))
        bones = []
        for joint in range(joints):
            roll = 0.0 if rolls is None else float(rolls.uniform(-np.pi, np.pi))
            parents.append(0 if joint == 0 else len(names) - 1)
            names.append(f"arm{number}.{joint}")
            matrices.append(bone_matrix(head, directions[joint], roll))
            lengths.append(segments[joint])
            bones.append(names[-1])
            head = head + segments[joint] * directions[joint]
        left = angle < np.pi
        pair = number + 1 if left else arms - number
        middle = arms % 2 == 1 and number == arms // 2
        side = "CENTER" if middle else "LEFT" if left else "RIGHT"
        listed.append(Arm(f"Arm {number}", tuple(bones), side, pair))
    skeleton = skeleton_of(names, parents, matrices, lengths)
    return skeleton, tuple(listed), body_frame(skeleton, [arm.bones for arm in listed], "Z", "-Y")


def skeleton_of(
    names: Sequence[str],
    parents: Sequence[int],
    matrices: Sequence[Floats],
    lengths: Sequence[float],
    not_inheriting: Sequence[str] = (),
) -> Skeleton:
    """A skeleton with nothing special about its bones."""
    count = len(names)
    return Skeleton(
        names=tuple(names),
        parents=tuple(parents),
        rest_matrices=np.array(matrices),
        lengths=np.array(lengths, dtype=np.float64),
        connected=(False,) * count,
        deform=(True,) * count,
        inherits_rotation=tuple(name not in not_inheriting for name in names),
        constrained=(False,) * count,
        weighted=(False,) * count,
        bendy_segments=(1,) * count,
        sucker_axes=("",) * count,
    )


def posed_joints(skeleton: Skeleton, arm: Arm, rotations: Floats, bones: Sequence[str]) -> Floats:
    """Joints P₀ … Pₙ (frames, joints + 1, 3) of an arm by forward kinematics, armature space."""
    basis = np.zeros((len(rotations), len(skeleton), 4))
    basis[..., 0] = 1.0
    basis[:, [skeleton.index[name] for name in bones]] = rotations
    orientations, heads = skeleton.pose(basis)
    order = [skeleton.index[name] for name in arm.bones]
    along = rotate(orientations[:, order[-1]], np.array([0.0, 1.0, 0.0]))
    tip = heads[:, order[-1]] + skeleton.lengths[order[-1]] * along
    return np.concatenate([heads[:, order], tip[:, None]], axis=1)
