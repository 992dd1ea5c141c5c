# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms as frames along them, whatever rig they belong to: where the rig's own axes end.

Each segment has a frame: x along the segment, y towards the suckers, z across. What one frame is
against the one before is all that an arm's shape consists of; shapes are blended and bent there,
in angle space, so lengths never change. Bones come in at the ends alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...rotations import (
    Floats,
    conjugate,
    cross,
    from_axis_angle,
    from_matrix,
    multiply,
    normalized,
    rotate,
    shortest_arc,
)
from ...skeleton import Skeleton
from .arm_chains import AXES, BodyFrame, joint_positions
from .bone_rotations import ArmRest, arm_rest

_ALONG = np.array([1.0, 0.0, 0.0])
_FACING = np.array([0.0, 1.0, 0.0])
_NEARLY_ALONG = 0.3
"""Length of what is across a segment, of a unit vector that does not tell which side is which."""


@dataclass(frozen=True, eq=False)
class ArmFrames:
    """One arm of a rig, between its bones and frames along it."""

    bones: tuple[str, ...]
    root: Floats
    """(3,) P₀ at rest, armature space."""
    lengths: Floats
    """(bones,) of the segments, armature units."""
    rest: ArmRest
    own: Floats
    """(bones, 4) each segment's frame in its bone's rest frame."""

    @cached_property
    def reach(self) -> Floats:
        """(bones + 1,) distance of each joint from P₀ along the arm."""
        return np.concatenate([[0.0], np.cumsum(self.lengths)])

    @property
    def length(self) -> float:
        """Of the whole arm."""
        return float(self.reach[-1])

    @cached_property
    def at_rest(self) -> Floats:
        """(bones, 4) frames at rest, armature space."""
        still = np.zeros((1, len(self.bones), 4))
        still[..., 0] = 1.0
        return self.from_bones(still)[0]

    def from_bones(self, rotations: Floats) -> Floats:
        """Frames (…, bones, 4) in armature space of bones' rotations (…, bones, 4)."""
        # Against the bone before; of those that follow nothing, in armature space already.
        result = multiply(self.rest.carried, rotations)
        for bone, follows in enumerate(self.rest.follows):
            if follows:
                result[..., bone, :] = multiply(result[..., bone - 1, :], result[..., bone, :])
        return multiply(result, self.own)

    def to_bones(self, frames: Floats) -> Floats:
        """Rotations (…, bones, 4) in each bone's rest frame (Blender's ``matrix_basis``)."""
        orientations = multiply(frames, conjugate(self.own))
        carried = np.broadcast_to(self.rest.carried, orientations.shape).copy()
        follows = np.array(self.rest.follows)
        before = orientations[..., np.flatnonzero(follows) - 1, :]
        carried[..., follows, :] = multiply(before, self.rest.carried[follows])
        return multiply(conjugate(carried), orientations)

    def shape(self, frames: Floats) -> Floats:
        """Turns (…, bones, 4) of each frame against the one before, of the first against rest."""
        result = frames.copy()
        result[..., 0, :] = multiply(conjugate(self.at_rest[0]), frames[..., 0, :])
        result[..., 1:, :] = multiply(conjugate(frames[..., :-1, :]), frames[..., 1:, :])
        return result

    def shaped(self, shape: Floats) -> Floats:
        """Inverse of :meth:`shape`: frames (…, bones, 4) in armature space."""
        result = shape.copy()
        before = self.at_rest[0]
        for bone in range(len(self.bones)):
            before = multiply(before, shape[..., bone, :])
            result[..., bone, :] = before
        return result

    def joints(self, frames: Floats, strains: Floats | None = None) -> Floats:
        """Joints P₀ … Pₙ (…, bones + 1, 3) in armature space of an arm with these frames.

        Args:
            frames: (…, bones, 4)
            strains: (…, bones) by how much bones are longer than at rest, as a share.
        """
        lengths = self.lengths if strains is None else self.lengths * (1.0 + strains)
        steps = lengths[..., None] * rotate(frames, _ALONG)
        start = np.broadcast_to(self.root, (*steps.shape[:-2], 1, 3))
        return np.concatenate([start, self.root + np.cumsum(steps, axis=-2)], axis=-2)


def frames_of_arm(skeleton: Skeleton, bones: Sequence[str], body: BodyFrame) -> ArmFrames:
    """An arm as its rig has it.

    Suckers face the axis that the rig names, else the ground; where an arm at rest leads up or
    down, the body's axis.

    Raises:
        RigError: a bone does not exist.
    """
    joints = joint_positions(skeleton, bones)
    steps = np.diff(joints, axis=0)
    rest = arm_rest(skeleton, bones)
    order = [skeleton.index[name] for name in bones]
    orientations = skeleton.rest_rotations[order]
    down = -body.rotation[:, 2]
    inward = body.center - joints[:-1]
    inward -= np.outer(inward @ down, down)
    facing = np.empty((len(order), 3))
    for place, bone in enumerate(order):
        named = skeleton.sucker_axes[bone]
        along = rest.segments[place]
        back = conjugate(orientations[place])
        choices = [np.array(AXES[named], float)] if named in AXES else []
        choices += [rotate(back, down), rotate(back, normalized(inward[place]))]
        choices += [np.eye(3)[np.argmin(np.abs(along))]]
        sides = [choice - (choice @ along) * along for choice in choices]
        facing[place] = next(each for each in sides if np.linalg.norm(each) > _NEARLY_ALONG)
    own = frame_of(rest.segments, facing)
    return ArmFrames(tuple(bones), joints[0], np.linalg.norm(steps, axis=1), rest, own)


def frame_of(along: Floats, facing: Floats) -> Floats:
    """Quaternions (…, 4) of frames with x along (…, 3) and y as near to facing (…, 3) as can be."""
    x = normalized(along)
    y = normalized(facing - np.sum(facing * x, axis=-1, keepdims=True) * x)
    return from_matrix(np.stack(np.broadcast_arrays(x, y, cross(x, y)), axis=-1))


def bend_rotations(angles: Floats) -> Floats:
    """Turns (…, 4) by angles (…) that bend an arm to its back, away from the suckers."""
    return from_axis_angle(np.array([0.0, 0.0, 1.0]), -angles)


def transport_frames(directions: Floats, first: Floats) -> Floats:
    """Frames (…, segments, 4) without twist along directions (…, segments, 3).

    Args:
        directions: unit vectors.
        first: (…, 4) a frame before the first segment, which is turned the shortest way to it.
    """
    result = np.empty((*directions.shape[:-1], 4))
    before = first
    for segment in range(directions.shape[-2]):
        along = directions[..., segment, :]
        turn = shortest_arc(rotate(before, _ALONG), along)
        facing = rotate(turn, rotate(before, _FACING))
        before = frame_of(along, facing)
        result[..., segment, :] = before
    return result
