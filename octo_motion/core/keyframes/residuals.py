# SPDX-License-Identifier: GPL-3.0-or-later
"""How far values are off what they should be: as they are, and to first order of what is changed.

Errors are those of rotations, of places and along a chain of bones, and shares of the bounds: 1 is
what is allowed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..rotations import Floats, conjugate, from_mode_values, multiply, rotate, to_matrix
from .channels import Booleans
from .tracks import LOCATION, SCALE, Integers, Limb, LimbChain


def turns(kind: str) -> bool:
    """Whether a track of this kind is a rotation."""
    return kind not in (LOCATION, SCALE)


def walked(chain: LimbChain, decoded: Sequence[Floats]) -> tuple[Floats, Floats]:
    """A chain from its root to its tip, its tracks decoded to rotations (frames, 4) or scales
    (frames, 3): turn (bones, frames, 4) of each bone away from rest, and its step (bones, frames,
    3).
    """
    frames = len(decoded[0])
    rest = np.broadcast_to((1.0, 0.0, 0.0, 0.0), (frames, 4))
    axes = to_matrix(chain.rest_rotations)
    turn, longer = rest, np.ones((frames, 1))
    found, steps = [], []
    for bone, track in enumerate(chain.turned):
        if not chain.follows[bone]:
            turn = rest
        if track >= 0:
            own = decoded[track].copy()
            own[:, 1:] = own[:, 1:] @ axes[bone].T
            turn = multiply(turn, own)
        step = rotate(turn, chain.steps[bone])
        if chain.scaled:
            scale = chain.scaled[bone]
            own_length = decoded[scale][:, 1:2] if scale >= 0 else np.ones((frames, 1))
            longer = longer * own_length if chain.handed[bone] else own_length
            step = step * longer
        found.append(turn)
        steps.append(step)
    return np.stack(found), np.stack(steps)


class Residuals:
    """Errors of one limb."""

    def __init__(self, limb: Limb) -> None:
        self._limb = limb
        self._kinds = [track.kind for track in limb.tracks]
        self._exact = self._decoded([track.values for track in limb.tracks])
        self._ends = self._ends_of(self._exact)

    def measure(self, values: Sequence[Floats]) -> tuple[Floats, Floats]:
        """Errors of other values of this limb, of each track (frames, components).

        They are of each track by itself (tracks, frames), and of the tip, of the joints that rest
        and of what is carried (frames,).
        """
        limb, frames = self._limb, len(values[0])
        own = np.zeros((len(values), frames))
        turned, away = np.zeros((2, frames))
        decoded = self._decoded(values)
        for place, (kind, now, exact) in enumerate(
            zip(self._kinds, decoded, self._exact, strict=True)
        ):
            if kind == SCALE:
                own[place] = np.abs(now - exact).max(axis=1) / limb.angle
            elif kind == LOCATION:
                off = np.linalg.norm(now - exact, axis=1)
                own[place] = off / limb.distance
                away = np.maximum(away, off)
            else:
                cosine = np.abs(np.einsum("fi,fi->f", now, exact))
                half = np.arccos(np.minimum(cosine, 1.0))
                own[place] = 2.0 * half / limb.angle
                turned = np.maximum(turned, half)
        joint = (away + limb.lever * 2.0 * np.sin(turned)) / limb.distance
        if limb.chain is not None:
            off = np.linalg.norm(self._ends_of(decoded) - self._ends, axis=2)
            joint = np.maximum(joint, off[-1] / limb.distance)
            if limb.room is not None:
                joint = np.maximum(joint, (off / limb.room.T).max(axis=0))
        return own, joint

    def _decoded(self, values: Sequence[Floats]) -> list[Floats]:
        return [
            from_mode_values(each, kind) if turns(kind) else each
            for each, kind in zip(values, self._kinds, strict=True)
        ]

    def _ends_of(self, decoded: Sequence[Floats]) -> Floats:
        """Where the chain's bones end, seen from its root: (bones, frames, 3)."""
        if self._limb.chain is None:
            return np.zeros((0, len(decoded[0]), 3))
        return np.cumsum(walked(self._limb.chain, decoded)[1], axis=0)


# --- What changes of values change, to first order: each track's own error, and where bones end ---
#
# A bone that turns by a small angle carries along all that follows it [the geometric Jacobian of a
# chain, e.g. Murray, Li & Sastry, *A Mathematical Introduction to Robotic Manipulation*, 1994,
# §3.4]: turns of bones add up from the root on, and so do the moves of their ends. Worked out in
# that order, the ends of all bones cost hardly more than that of the tip.


Singles = NDArray[np.float32]

_STEP: Final = 1e-6
"""Change of a value from which slopes of rotations are taken."""
_RIDGE: Final = 1.0
"""Weight, against what is seen of them, of changes that are not seen: of a quaternion's length.
The more alike both weigh, the fewer steps it takes to fit them."""
_KINK: Final = 0.1
"""Bounds by which the motion must turn aside at the seam of a loop to be let have a corner."""
_FEW: Final = 5
"""Frames of a loop in which corners cannot be told from bends."""
_APART: Final = 1e-5
"""Values that differ by less meet at the seam."""


class LinearModel:
    """A limb near its motion, at all frames that are fitted."""

    def __init__(self, limb: Limb) -> None:
        values = [track.values for track in limb.tracks]
        kinds = [track.kind for track in limb.tracks]
        frames = len(values[0])
        self.targets = np.zeros((4, len(values), frames))
        """(4, tracks, frames) values; components that a track does not have are 0."""
        for place, each in enumerate(values):
            self.targets[: each.shape[1], place] = each.T
        self._own = np.zeros((3, 4, len(values), frames), dtype=np.float32)
        decoded = [
            from_mode_values(each, kind) if turns(kind) else each
            for each, kind in zip(values, kinds, strict=True)
        ]
        world: dict[int, Floats] = {}
        # What a chain moves is looked at by itself.
        lever = limb.lever if limb.chain is None else 0.0
        self._ends: _Ends | None = None
        if limb.chain is not None:
            turn, steps = walked(limb.chain, decoded)
            axes = to_matrix(limb.chain.rest_rotations)
            for bone, track in enumerate(limb.chain.turned):
                if track >= 0:
                    world[track] = to_matrix(turn[bone]) @ axes[bone]
            self._ends = _Ends(limb, limb.chain, steps)
        for place, (kind, each) in enumerate(zip(kinds, values, strict=True)):
            if not turns(kind):
                bound = limb.angle if kind == SCALE else limb.distance
                self._own[range(3), range(3), place] = 1.0 / bound
                continue
            slopes = _turned(kind, each)
            if place in world:
                slopes = world[place] @ slopes
            reach = np.maximum(1.0 / limb.angle, lever / np.broadcast_to(limb.distance, frames))
            self._own[:, :, place] = np.moveaxis(slopes * reach[:, None, None], 0, -1)
        self._size: Singles = (self._own**2).sum(axis=(0, 1)) / np.float32(3.0)
        turning = np.array([turns(kind) for kind in kinds], dtype=np.float32)
        self._ridge: Singles = (_RIDGE * self._size * turning[:, None]).astype(np.float32)

    def errors(self, off: Singles) -> list[Singles]:
        """Errors of each track (3, tracks, frames) whose values change by ``off`` (4, tracks,
        frames), and of ends of bones (3, ends, frames) where there is a chain.
        """
        own = np.einsum("dctf,ctf->dtf", self._own, off)
        return [own] if self._ends is None else [own, self._ends.errors(own)]

    def pull(self, off: Singles, pulls: Sequence[Singles], weight: Singles) -> Singles:
        """Transpose of :meth:`errors` by ``pulls`` like the errors, and what keeps changes ``off``
        of values (4, tracks, frames) small that are not seen; ``weight`` (tracks, frames) is that
        of each track's own error.
        """
        own = pulls[0] if self._ends is None else pulls[0] + self._ends.pull(pulls[1])
        result = np.einsum("dctf,dtf->ctf", self._own, own)
        result += (weight * self._ridge) * off
        return result

    def weights(self, own: Singles) -> Singles:
        """Curvature of weighted squares of tracks' own errors, for a value: (tracks, frames)."""
        return (own * (self._size + self._ridge)).astype(np.float32, copy=False)

    def culprits(self, off: Singles, frames: Integers) -> Singles:
        """How much each track has to do with the worst end's being off (tracks, frames) at some
        frames, where values change by ``off`` (4, tracks, frames).
        """
        own, *rest = self.errors(off)
        if self._ends is None:
            return np.zeros((own.shape[1], len(frames)), dtype=np.float32)
        (ends,) = rest
        sizes = (ends[..., frames] ** 2).sum(axis=0)
        only = np.zeros_like(ends)
        only[..., frames] = np.where(sizes == sizes.max(axis=0), ends[..., frames], 0.0)
        return (own * self._ends.pull(only)).sum(axis=0)[:, frames]

    def turns_at_the_seam(self, frames: Integers) -> Booleans:
        """Whether tracks (tracks,) have a corner where a loop goes on from its start, told from
        those of its frames between which nothing is left out.
        """
        if len(frames) < _FEW:
            return np.ones(self.targets.shape[1], dtype=bool)
        bends = np.diff(self.targets[..., frames[[-3, -2, 0, 1, 2]]], 2, axis=2)
        bends = np.einsum("dct,ctf->dtf", self._own[..., 0], bends)
        before, at, after = np.linalg.norm(bends, axis=0).T
        # A tight bend is one on both sides, too.
        aside = (at > _KINK) & (at > 2.0 * np.maximum(before, after))
        apart = np.abs(self.targets[..., 0] - self.targets[..., -1]).max(axis=0) > _APART
        return apart | aside


class _Ends:
    """Where bones of a chain end, as shares of their bounds.

    Rows are those ends that have room of their own, the first of all the tip with its distance.
    """

    def __init__(self, limb: Limb, chain: LimbChain, steps: Floats) -> None:
        tracks, bones, frames = len(limb.tracks), len(steps), steps.shape[1]
        room = np.full((bones, frames), np.inf) if limb.room is None else limb.room.T
        (held,) = np.nonzero(np.isfinite(room).any(axis=1))
        tip = np.broadcast_to(1.0 / np.asarray(limb.distance), (1, frames))
        self._share = np.concatenate([tip, 1.0 / room[held]]).astype(np.float32)
        self._ends = np.concatenate([[bones - 1], held])
        self._steps = np.ascontiguousarray(np.moveaxis(steps, 2, 0).astype(np.float32))
        # A track's own error is what it turns or stretches as a share of the angle.
        self._angle = np.float32(limb.angle)
        self._turns = _Carried(chain.turned, chain.follows, tracks)
        self._scales = _Carried(chain.scaled, chain.handed, tracks) if chain.scaled else None
        self._along = np.zeros((tracks, frames), dtype=np.float32)
        for track in chain.scaled:
            if track >= 0:
                self._along[track] = self._angle / limb.tracks[track].values[:, 1]

    def errors(self, own: Singles) -> Singles:
        """How tracks' own errors (3, tracks, frames) move ends: (3, ends, frames)."""
        moved = _cross(self._turns.of_bones(self._angle * own), self._steps)
        if self._scales is not None:
            moved += self._scales.of_bones(self._along * own[1]) * self._steps
        for bone in range(1, moved.shape[1]):
            moved[:, bone] += moved[:, bone - 1]
        return moved[:, self._ends] * self._share

    def pull(self, ends: Singles) -> Singles:
        """Transpose of :meth:`errors`."""
        moved = np.zeros_like(self._steps)
        for row, bone in enumerate(self._ends):
            moved[:, bone] += self._share[row] * ends[:, row]
        for bone in range(moved.shape[1] - 1, 0, -1):
            moved[:, bone - 1] += moved[:, bone]
        result = self._angle * self._turns.of_tracks(_cross(self._steps, moved))
        if self._scales is not None:
            along = (self._steps * moved).sum(axis=0)
            result[1] += self._along * self._scales.of_tracks(along)
        return result


class _Carried:
    """How tracks move the bones of a chain: by what they do themselves and by those before.

    Sums from bone to bone, for the matrix that they stand for is as large as the chain is long, and
    numpy's linear algebra wakes threads for its products: beside other programs these wait for each
    other many times as long as a sum takes.

    Of each bone ``moved`` is its track, −1 for none, and ``on`` whether the one before takes it
    along; ``tracks`` are so many in all.
    """

    def __init__(self, moved: Sequence[int], on: Sequence[bool], tracks: int) -> None:
        self._tracks = tracks
        self._moved = [(bone, track) for bone, track in enumerate(moved) if track >= 0]
        self._bones = len(moved)
        self._followers = [bone for bone in range(1, len(moved)) if on[bone]]

    def of_bones(self, own: Singles) -> Singles:
        """What tracks (…, tracks, frames) do to bones (…, bones, frames)."""
        result = np.zeros((*own.shape[:-2], self._bones, own.shape[-1]), dtype=np.float32)
        for bone, track in self._moved:
            result[..., bone, :] = own[..., track, :]
        for bone in self._followers:
            result[..., bone, :] += result[..., bone - 1, :]
        return result

    def of_tracks(self, bones: Singles) -> Singles:
        """Transpose of :meth:`of_bones`; bones (…, bones, frames) are summed up in place."""
        for bone in reversed(self._followers):
            bones[..., bone - 1, :] += bones[..., bone, :]
        result = np.zeros((*bones.shape[:-2], self._tracks, bones.shape[-1]), dtype=np.float32)
        for bone, track in self._moved:
            result[..., track, :] += bones[..., bone, :]
        return result


def _cross(one: Singles, two: Singles) -> Singles:
    """Cross products of vectors (3, …)."""
    result = np.empty_like(two)
    for axis in range(3):
        ahead, behind = (axis + 1) % 3, (axis + 2) % 3
        np.multiply(one[ahead], two[behind], out=result[axis])
        result[axis] -= one[behind] * two[ahead]
    return result


def _turned(kind: str, values: Floats) -> Floats:
    """How values (frames, components) turn a bone in its own axes: (frames, 3, 4)."""
    exact = from_mode_values(values, kind)
    if kind == "QUATERNION":
        w, x, y, z = exact.T
        rows = ((-x, w, z, -y), (-y, -z, w, x), (-z, y, -x, w))
        return 2.0 * np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    result = np.zeros((len(exact), 3, 4))
    for component in range(values.shape[1]):
        moved = values.copy()
        moved[:, component] += _STEP
        turned = multiply(conjugate(exact), from_mode_values(moved, kind))
        turned *= np.where(turned[:, :1] < 0.0, -1.0, 1.0)
        result[..., component] = 2.0 * turned[:, 1:] / _STEP
    return result
