# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion clips as plain arrays, and where their bones are at any time."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from ...rotations import (
    Floats,
    angle_between,
    conjugate,
    from_matrix,
    from_rotation_vector,
    multiply,
    normalized,
    rotate,
    slerp,
    to_matrix,
    to_rotation_vector,
)
from ...skeleton import Skeleton
from ...steps import finished

MOTION_SUFFIXES: Final = (".bvh", ".fbx", ".glb", ".gltf")
"""Endings of the files from which clips may come."""


_CLOSED: Final = 1e-3
"""Radians by which bones of two poses may be turned otherwise, and the poses be the same."""


@dataclass(frozen=True, eq=False)
class Clip:
    """The motion of one armature, frame by frame."""

    name: str
    skeleton: Skeleton
    frames: Floats
    """(frames,) ascending frame numbers; fractions are allowed."""
    rate: float
    """Frames per second."""
    rotations: Floats
    """(frames, bones, 4) unit quaternions in each bone's rest frame (Blender's matrix_basis)."""
    locations: Floats
    """(frames, bones, 3) in each bone's rest frame, armature units."""
    world: Floats
    """(frames, 4, 4) world matrix of the armature object; uniform scale."""
    scales: Floats | None = None
    """(frames, bones, 3) of bones that get longer or thicker without bending those they carry; none
    if there are none. They go along with a part, and count for nothing else."""
    own: Floats | None = None
    """(frames, 4, 4) of ``world`` what the object's own channels make, where parents or constraints
    may carry it further; none if nothing is known of that."""
    cyclic: bool = False
    """Whether the last frame is the first one again, over and over, wherever that leads."""

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.frames)

    @cached_property
    def scale(self) -> float:
        """World size of one armature unit, metres."""
        return float(np.cbrt(abs(np.linalg.det(self.world[0, :3, :3]))))

    @property
    def cycle(self) -> float:
        """Frames after which it begins again; infinite if it does not."""
        return float(self.frames[-1] - self.frames[0]) if self.cyclic else np.inf

    @cached_property
    def closed(self) -> bool:
        """Whether it ends in the pose in which it begins, wherever that stands."""
        return bool(angle_between(self.rotations[0], self.rotations[-1]).max() < _CLOSED)

    def posed(self) -> tuple[Floats, Floats]:
        """World orientations (frames, bones, 4) and head positions (frames, bones, 3)."""
        orientations, heads = self.skeleton.pose(self.rotations, self.locations)
        turn = from_matrix(self.world[:, :3, :3] / self.scale)[:, None]
        shift = self.world[:, None, :3, 3]
        return multiply(turn, orientations), shift + self.scale * rotate(turn, heads)

    @property
    def inheriting(self) -> Clip:
        """The same motion of bones that all turn with their parents."""
        return self.on_bones((True,) * len(self.skeleton))

    def on_bones(self, inherits: tuple[bool, ...]) -> Clip:
        """The same motion of bones that turn with their parents or not (bones,)."""
        if inherits == self.skeleton.inherits_rotation:
            return self
        skeleton = replace(self.skeleton, inherits_rotation=inherits)
        posed = self.skeleton.pose(self.rotations, self.locations)
        rotations, locations = unposed(skeleton, *posed)
        return replace(self, skeleton=skeleton, rotations=rotations, locations=locations)

    def taken(self, rows: ArrayLike) -> Clip:
        """Some of its frames alone, by number from 0, ascending."""
        chosen = np.asarray(rows, dtype=np.intp)
        return replace(
            self,
            frames=self.frames[chosen],
            rotations=self.rotations[chosen],
            locations=self.locations[chosen],
            world=self.world[chosen],
            scales=None if self.scales is None else self.scales[chosen],
            own=None if self.own is None else self.own[chosen],
        )


# --- Forward kinematics of just those bones that are asked for, and backwards, for all frames -----


class Posture:
    """Where bones are, in armature space, bone by bone as needed.

    What was computed is kept: a bone's rotation must not change after it, or one beneath it, has
    been asked for.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        rotations: Callable[[Sequence[int]], Floats],
        location: Callable[[int], Floats],
    ) -> None:
        self.skeleton = skeleton
        self.rotations = rotations
        """(frames, bones, 4) of some bones, each in its rest frame."""
        self.location = location
        """(frames, 3) of a bone, in its rest frame."""
        self._orientations: dict[int, Floats] = {}
        self._heads: dict[int, Floats] = {}
        self._turns: dict[int, Floats] = {}

    def rotation(self, bone: int) -> Floats:
        """(frames, 4) of a bone, in its rest frame."""
        return self.rotations([bone])[:, 0]

    def turn(self, bone: int) -> Floats:
        """How a bone has turned from its rest pose, (frames, 4)."""
        if bone not in self._turns:
            back = conjugate(self.skeleton.rest_rotations[bone])
            self._turns[bone] = multiply(self.orientation(bone), back)
        return self._turns[bone]

    def carried(self, bone: int) -> Floats:
        """A bone's orientation before its own rotation, (frames, 4) or (4,)."""
        rest, parent = self.skeleton.rest_rotations[bone], self.skeleton.parents[bone]
        if parent < 0 or not self.skeleton.inherits_rotation[bone]:
            return rest
        return multiply(self.turn(parent), rest)

    def location_axes(self, bone: int) -> Floats:
        """The axes in which a bone's location is given, (frames, 4) or (4,)."""
        rest, parent = self.skeleton.rest_rotations[bone], self.skeleton.parents[bone]
        return rest if parent < 0 else multiply(self.turn(parent), rest)

    def unmoved_head(self, bone: int) -> Floats:
        """Where a bone's head is before its own location, (frames, 3) or (3,)."""
        parent = self.skeleton.parents[bone]
        if parent < 0:
            return self.skeleton.heads[bone]
        offset = self.skeleton.heads[bone] - self.skeleton.heads[parent]
        return self.head(parent) + rotate(self.turn(parent), offset)

    def orientation(self, bone: int) -> Floats:
        """(frames, 4), armature space."""
        if bone not in self._orientations:
            self._orientations[bone] = multiply(self.carried(bone), self.rotation(bone))
        return self._orientations[bone]

    def head(self, bone: int) -> Floats:
        """(frames, 3), armature space."""
        if bone not in self._heads:
            moved = self.location(bone)
            position = self.unmoved_head(bone)
            if np.any(moved):
                position = position + rotate(self.location_axes(bone), moved)
            self._heads[bone] = np.broadcast_to(position, moved.shape)
        return self._heads[bone]


def posture_of(skeleton: Skeleton, rotations: Floats, locations: Floats) -> Posture:
    """The posture of arrays (frames, bones, 4) and (frames, bones, 3)."""
    return Posture(skeleton, lambda bones: rotations[:, bones], lambda bone: locations[:, bone])


def sample_clip(
    clip: Clip, frames: Floats, seams: Floats | None = None, seam_speeds: Floats | None = None
) -> Posture:
    """A clip at any times, in its own frame numbers; beyond its ends it stands still.

    Args:
        clip: the clip.
        frames: (frames,)
        seams: (frames,) how much of the step from the clip's last pose to its first is added; below
            zero behind it.
        seam_speeds: (frames,) likewise of the step in speed, in frames of the clip.
    """
    before, after, share = _between(clip, frames)
    between = share.any()
    seams = np.zeros(len(frames)) if seams is None else seams
    # Who has made a clip end in the pose in which it begins has made a loop.
    speeds = np.zeros(len(frames)) if seam_speeds is None or clip.closed else seam_speeds
    looped = seams.any()

    def rotations(bones: Sequence[int]) -> Floats:
        own = np.asarray(bones, dtype=np.intp)
        values = clip.rotations[before[:, None], own]
        if between:
            values = slerp(values, clip.rotations[after[:, None], own], share[:, None])
        if looped:
            ends = clip.rotations[_SEAM][:, own]
            values = multiply(values, seam_turns(ends, clip.frames[_SEAM], seams, speeds))
        return values

    def location(bone: int) -> Floats:
        values = clip.locations[before, bone]
        if between:
            values = values + share[:, None] * (clip.locations[after, bone] - values)
        if looped:
            ends = clip.locations[_SEAM, bone]
            values = values + seam_shifts(ends, clip.frames[_SEAM], seams, speeds)
        return values

    return Posture(clip.skeleton, rotations, location)


def sample_scales(
    clip: Clip, frames: Floats, seams: Floats, seam_speeds: Floats, bones: Sequence[int]
) -> Floats:
    """Scales (frames, bones, 3) of some bones of a clip at any times, like :func:`sample_clip`."""
    if clip.scales is None:
        return np.ones((len(frames), len(bones), 3))
    before, after, share = _between(clip, frames)
    own = np.asarray(bones, dtype=np.intp)
    values = clip.scales[before[:, None], own]
    values += share[:, None, None] * (clip.scales[after[:, None], own] - values)
    return values + seam_shifts(clip.scales[_SEAM][:, own], clip.frames[_SEAM], seams, seam_speeds)


def clip_at(clip: Clip, frames: Floats) -> Generator[None, None, Clip]:
    """A clip on other frames (frames,), within its own: from frame to frame the shortest way; in
    steps.
    """
    before, after, share = _between(clip, frames)
    part = share[:, None, None]

    def mixed(values: Floats) -> Floats:
        return values[before] + part * (values[after] - values[before])

    world = mixed(clip.world)
    turns, _, scale = sample_world(clip, frames)
    world[:, :3, :3] = scale * to_matrix(turns)
    rotations = np.empty((len(frames), *clip.rotations.shape[1:]))
    for first in range(0, rotations.shape[1], _AT_ONCE):
        some = clip.rotations[:, first : first + _AT_ONCE]
        rotations[:, first : first + _AT_ONCE] = slerp(some[before], some[after], part[..., 0])
        yield
    return replace(
        clip,
        frames=frames,
        rotations=rotations,
        locations=mixed(clip.locations),
        world=world,
        scales=None if clip.scales is None else mixed(clip.scales),
        own=None if clip.own is None else mixed(clip.own),
    )


def spread_clip(clip: Clip, count: int) -> Clip:
    """Poses of a clip at so many moments evenly over its time: what is told from them is the same
    at any frame rate. Itself if it has but one frame.
    """
    if len(clip) < 2:
        return clip
    poses = replace(clip, scales=None, own=None)
    return finished(clip_at(poses, np.linspace(clip.frames[0], clip.frames[-1], count)))


def sample_world(clip: Clip, frames: Floats) -> tuple[Floats, Floats, float]:
    """The armature object at any times: rotations (frames, 4), places (frames, 3), and scale."""
    before, after, share = _between(clip, frames)
    first, second = clip.world[before], clip.world[after]
    turns = from_matrix(first[:, :3, :3] / clip.scale)
    if share.any():
        turns = slerp(turns, from_matrix(second[:, :3, :3] / clip.scale), share)
    places = first[:, :3, 3] + share[:, None] * (second[:, :3, 3] - first[:, :3, 3])
    return turns, places, clip.scale


def _between(clip: Clip, frames: Floats) -> tuple[np.ndarray, np.ndarray, Floats]:
    """Indices of the clip's frames on either side of each time, and how far it is between."""
    place: Floats = np.interp(frames, clip.frames, np.arange(len(clip), dtype=np.float64))
    # A time that misses a frame by rounding alone is that frame.
    whole = np.round(place)
    place = np.where(np.abs(place - whole) < 1e-6, whole, place)
    before = np.floor(place).astype(np.intp)
    after = np.minimum(before + 1, len(clip) - 1)
    return before, after, np.asarray(place - before)


# --- Where a clip begins again: what brings its last pose and speed and its first ones together ---


_AT_ONCE: Final = 20
"""Bones that are turned at one step."""

_SEAM: Final = np.array([-2, -1, 0, 1])
"""The frames of a clip from which the steps at its seam are told."""


def seam_turns(ends: Floats, frames: Floats, seams: Floats, speeds: Floats) -> Floats:
    """Rotations (frames, …, 4) to be made before those of a clip, in its bones' own axes.

    Args:
        ends: (4, …, 4) rotations in the last two frames of the clip and in its first two.
        frames: (4,) their numbers.
        seams: (frames,) shares of the step in pose, below zero behind the seam.
        speeds: (frames,) likewise of the step in speed.
    """
    shape = (-1, *(1,) * (ends.ndim - 1))
    step = to_rotation_vector(multiply(conjugate(ends[1]), ends[2]))
    leaves = to_rotation_vector(multiply(conjugate(ends[0]), ends[1])) / (frames[1] - frames[0])
    arrives = to_rotation_vector(multiply(conjugate(ends[2]), ends[3])) / (frames[3] - frames[2])
    # Seen from the last pose, and from the first one.
    across = from_rotation_vector(step)
    swings = rotate(across, arrives) - leaves, arrives - rotate(conjugate(across), leaves)
    seams, speeds = seams.reshape(shape), speeds.reshape(shape)
    swing = from_rotation_vector(speeds * np.where(seams >= 0.0, *swings))
    return multiply(swing, from_rotation_vector(seams * step))


def seam_shifts(ends: Floats, frames: Floats, seams: Floats, speeds: Floats) -> Floats:
    """What is to be added (frames, …, 3) to places or sizes; see :func:`seam_turns`."""
    shape = (-1, *(1,) * (ends.ndim - 1))
    leaves = (ends[1] - ends[0]) / (frames[1] - frames[0])
    arrives = (ends[3] - ends[2]) / (frames[3] - frames[2])
    step = seams.reshape(shape) * (ends[2] - ends[1])
    return step + speeds.reshape(shape) * (arrives - leaves)


# --- Forward kinematics backwards: from where the bones are to how each is turned and moved -------


def unposed(skeleton: Skeleton, orientations: Floats, heads: Floats) -> tuple[Floats, Floats]:
    """Rotations (…, bones, 4) and locations (…, bones, 3) in each bone's rest frame.

    The inverse of ``Skeleton.pose``: of orientations (…, bones, 4) and heads (…, bones, 3) in
    armature space.
    """
    rotations, locations = np.empty(orientations.shape), np.empty(heads.shape)
    for bone, parent in enumerate(skeleton.parents):
        rest, position = skeleton.rest_rotations[bone], skeleton.heads[bone]
        carried = rest
        if parent >= 0:
            turn = multiply(
                orientations[..., parent, :], conjugate(skeleton.rest_rotations[parent])
            )
            position = heads[..., parent, :] + rotate(turn, position - skeleton.heads[parent])
            carried = multiply(turn, rest)
        moved = heads[..., bone, :] - position
        locations[..., bone, :] = rotate(conjugate(carried), moved)
        if not skeleton.inherits_rotation[bone]:
            carried = rest
        rotations[..., bone, :] = multiply(conjugate(carried), orientations[..., bone, :])
    return rotations, locations


def orientations_of(matrices: Floats) -> Floats:
    """Orthonormal axes (…, 3, 3) of matrices that may scale and shear.

    Y, along which a bone points, keeps its direction, and X its side.
    """
    y = normalized(matrices[..., :, 1])
    x = matrices[..., :, 0]
    x = normalized(x - np.sum(x * y, axis=-1, keepdims=True) * y)
    return np.stack([x, y, np.cross(x, y)], axis=-1)


# --- Bones that are scaled: where they and those they carry come to lie ---------------------------


_LEAST: Final = 1e-4
"""Scale of what is scaled to nothing, to hide it: which way it points is still to be seen."""


def without_scale(
    skeleton: Skeleton, rotations: Floats, locations: Floats, scales: Floats
) -> tuple[Floats, Floats]:
    """Rotations and locations that put all bones where they are when each scales its children.

    For bones that inherit all of their parent's scale and rotation, which is the usual. All are
    (frames, bones, 4) or (frames, bones, 3), in each bone's rest frame.
    """
    scales = np.where(np.abs(scales) < _LEAST, _LEAST, scales)
    basis = np.zeros((*rotations.shape[:2], 4, 4))
    basis[..., :3, :3] = to_matrix(rotations) * scales[..., None, :]
    basis[..., :3, 3] = locations
    basis[..., 3, 3] = 1.0
    posed = np.empty_like(basis)
    for bone, parent in enumerate(skeleton.parents):
        rest = skeleton.rest_matrices[bone]
        if parent < 0:
            posed[:, bone] = rest @ basis[:, bone]
        else:
            offset = np.linalg.inv(skeleton.rest_matrices[parent]) @ rest
            posed[:, bone] = posed[:, parent] @ offset @ basis[:, bone]
    return unposed(skeleton, from_matrix(orientations_of(posed[..., :3, :3])), posed[..., :3, 3])
