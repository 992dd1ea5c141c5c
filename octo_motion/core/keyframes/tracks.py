# SPDX-License-Identifier: GPL-3.0-or-later
"""What is keyed: tracks, limbs that hang together, and the keys that are found for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..rotations import Floats
from ..skeleton import Skeleton

LOCATION: Final = "LOCATION"
SCALE: Final = "SCALE"

Integers = NDArray[np.intp]
Booleans = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Track:
    """One animated property, at every frame."""

    values: Floats
    """(frames, components)"""
    kind: str
    """``"LOCATION"``, ``"SCALE"``, or Blender's rotation mode: ``"QUATERNION"``, ``"AXIS_ANGLE"``,
    ``"XYZ"``…"""


@dataclass(frozen=True, eq=False)
class LimbChain:
    """Forward kinematics from a limb's tracks to the position of its tip."""

    turned: tuple[int, ...]
    """For each bone from root to tip, the track that rotates it; −1 for one without."""
    follows: tuple[bool, ...]
    """Whether the bone before turns this one."""
    rest_rotations: Floats
    """(bones, 4)"""
    steps: Floats
    """(bones, 3) from each bone's head to the next one's, the last to its tail, at rest."""
    scaled: tuple[int, ...] = ()
    """For each bone the track that scales it, −1 for one without; empty where none does."""
    handed: tuple[bool, ...] = ()
    """Whether the scale of the bone before makes this one longer, too; as many as ``scaled``."""


@dataclass(frozen=True, eq=False)
class Limb:
    """Tracks that move one thing, and how far they may be off.

    The distance bounds the sum of each location's error and ``lever`` times each rotation's
    (the length of the chord), and the error of the chain's tip.
    """

    tracks: Sequence[Track]
    angle: float
    """Radians by which each rotation may be off, and share by which each scale may be."""
    distance: float | Floats
    """In the units of the locations and of the chain; the same at all frames, or (frames,)."""
    lever: float = 0.0
    chain: LimbChain | None = None
    columns: Sequence[int] | None = None
    """Of each track, which key frames it has: those of all with the same number. Without, all
    tracks have theirs in common. See :meth:`column_numbers`."""
    room: Floats | None = None
    """(frames, bones) how far the ends of the chain's bones may be off, those of the tip among
    them; infinite where nothing but the rest says so."""

    def column_numbers(self) -> list[int]:
        """Of each track its column of key frames, numbered from 0."""
        given = self.columns if self.columns is not None else [0] * len(self.tracks)
        numbers = {column: number for number, column in enumerate(dict.fromkeys(given))}
        return [numbers[column] for column in given]

    def at(self, moments: Booleans) -> Limb:
        """The same at some of its frames (frames,)."""
        return replace(
            self,
            tracks=[Track(each.values[moments], each.kind) for each in self.tracks],
            distance=np.broadcast_to(self.distance, len(moments))[moments],
            room=None if self.room is None else self.room[moments],
        )


@dataclass(frozen=True, eq=False)
class BezierKeys:
    """Keys of one track in single precision, as Blender keeps them."""

    frames: NDArray[np.float32]
    """(keys,)"""
    values: NDArray[np.float32]
    """(keys, components)"""
    left: NDArray[np.float32]
    """(keys, components, 2) frame and value of the handles before the keys."""
    right: NDArray[np.float32]
    """(keys, components, 2) likewise after them."""
    smooth: Booleans
    """(keys,) whether both handles lie on one line, as Blender's aligned ones do."""

    def __len__(self) -> int:
        """Number of keys of each component."""
        return len(self.frames)


def bezier_keys(
    frames: Floats, values: Floats, out: Floats, into: Floats, smooth: Booleans
) -> BezierKeys:
    """Keys with handles at thirds of the time between two of them.

    Args:
        frames: (keys,) at least two.
        values: (keys, components)
        out: (keys − 1, components) values of the handles after all keys but the last one.
        into: (keys − 1, components) values of the handles before all but the first one.
        smooth: (keys,) whether both handles lie on one line.
    """
    third = np.diff(frames)[:, None] / 3.0
    own = np.stack(np.broadcast_arrays(frames[:, None], values), axis=-1)
    left, right = own.copy(), own.copy()
    left[1:, :, 0] -= third
    left[1:, :, 1] = into
    right[:-1, :, 0] += third
    right[:-1, :, 1] = out
    # Nothing lies before the first key and after the last: their handles go straight on.
    left[0], right[-1] = 2.0 * own[0] - right[0], 2.0 * own[-1] - left[-1]
    inner = smooth.copy()
    inner[[0, -1]] = False
    return BezierKeys(
        frames=frames.astype(np.float32),
        values=values.astype(np.float32),
        left=left.astype(np.float32),
        right=right.astype(np.float32),
        smooth=inner,
    )


def chain_to_tip(skeleton: Skeleton, bones: Sequence[str]) -> LimbChain:
    """The chain of an arm whose tracks are the rotations of its bones, root to tip.

    Bones in between that have no track ride along; what the first bone hangs on stays at rest.
    """
    tracks = {skeleton.index[name]: number for number, name in enumerate(bones)}
    path = [skeleton.index[bones[-1]]]
    while path[-1] != skeleton.index[bones[0]]:
        path.append(skeleton.parents[path[-1]])
    path.reverse()
    points = [*(skeleton.heads[bone] for bone in path), skeleton.tails[path[-1]]]
    return LimbChain(
        turned=tuple(tracks.get(bone, -1) for bone in path),
        follows=tuple(skeleton.inherits_rotation[bone] for bone in path),
        rest_rotations=skeleton.rest_rotations[path],
        steps=np.diff(points, axis=0),
    )
