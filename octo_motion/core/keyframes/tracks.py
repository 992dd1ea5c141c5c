# SPDX-License-Identifier: GPL-3.0-or-later
"""What is keyed: tracks, limbs that hang together, and the keys that are found for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..rotations import Floats
from ..skeleton import Skeleton
from .channels import Booleans, halfway_values

LOCATION: Final = "LOCATION"
SCALE: Final = "SCALE"

Integers = NDArray[np.intp]


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


# --- Moments between frames, as frames alone do not say how curves have to go ---------------------
#
# A curve from one key to another a few frames later has handles that no frame has much to say
# about: it may be right at every frame and swing out in between, where a foot would slide. So the
# motion is looked at half way between frames, too: as it would go with a key on each of them and
# automatic handles.


@dataclass(frozen=True, eq=False)
class Fine:
    """A limb at all moments at which it is looked at."""

    times: Floats
    """(moments,)"""
    limb: Limb
    allowed: Booleans
    """(moments,) where there may be a key."""

    def marked(self, marks: Booleans) -> Booleans:
        """Marks (rows, moments) that are given at frames (rows, frames), or at all moments."""
        if marks.shape[1] == len(self.times):
            return marks
        result = np.zeros((len(marks), len(self.times)), dtype=bool)
        result[:, self.allowed] = marks
        return result

    def between(self, first: int, last: int) -> Fine:
        """The same from one of its moments to another one."""
        chosen = np.zeros(len(self.times), dtype=bool)
        chosen[first : last + 1] = True
        return Fine(self.times[chosen], self.limb.at(chosen), self.allowed[chosen])


def with_halves(times: Floats, limb: Limb) -> Fine:
    """A limb on times (frames,), at least two, and half way between them."""

    def closer(bound: Floats) -> Floats:
        """Bounds half way, which are those of both frames."""
        looser = np.isinf(bound[:-1]) | np.isinf(bound[1:])
        return joined(bound, np.where(looser, np.inf, np.minimum(bound[:-1], bound[1:])))

    tracks = [Track(joined(each.values, _halves(each.values)), each.kind) for each in limb.tracks]
    finer = replace(
        limb,
        tracks=tracks,
        distance=closer(np.broadcast_to(limb.distance, len(times))),
        room=None if limb.room is None else closer(limb.room),
    )
    moments = joined(times, 0.5 * (times[:-1] + times[1:]))
    return Fine(moments, finer, np.arange(len(moments)) % 2 == 0)


def looked_at(times: Floats, limb: Limb, every: int) -> Fine:
    """A limb at all moments that matter: between frames, too, where something hangs on it.

    Of times (moments,), at least two, ``every`` so many is a frame, from the first to the last.
    """
    if every == 1 and (limb.chain is not None or limb.lever > 0.0):
        return with_halves(times, limb)
    return Fine(times, limb, np.arange(len(times)) % every == 0)


def joined(frames: NDArray[Any], halves: NDArray[Any]) -> NDArray[Any]:
    """What is on frames (frames, …) and half way between them (frames − 1, …), in turn."""
    result = np.empty((len(frames) + len(halves), *frames.shape[1:]), dtype=frames.dtype)
    result[::2], result[1::2] = frames, halves
    return result


def _halves(values: Floats) -> Floats:
    """Half way from each frame's values (frames, components) to the next one's."""
    slopes = np.gradient(values, axis=0)
    slopes[[0, -1]] = 0.0
    return halfway_values(values, slopes)
