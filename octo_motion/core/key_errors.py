# SPDX-License-Identifier: GPL-3.0-or-later
"""How far values are off what they should be, as rotations, as places and at the tip of a chain.

All errors are shares of the bounds: 1 is what is allowed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from .key_limbs import LOCATION, SCALE, Limb
from .rotations import (
    Floats,
    conjugate,
    cross,
    from_axis_angle,
    from_euler,
    multiply,
    normalized,
    rotate,
    to_matrix,
)

_STEP: Final = 1e-6
"""Change of a value from which slopes of rotations are taken."""


def rotations_of(values: Floats, kind: str) -> Floats:
    """Unit quaternions (…, 4) of values (…, 3 or 4) of one of Blender's rotation modes."""
    if kind == "QUATERNION":
        return normalized(values)
    if kind == "AXIS_ANGLE":
        return from_axis_angle(normalized(values[..., 1:]), values[..., 0])
    return from_euler(values, kind)


def turns(kind: str) -> bool:
    """Whether a track of this kind is a rotation."""
    return kind not in (LOCATION, SCALE)


class Errors:
    """Errors of limbs that are alike: as many tracks of the same kinds, the same chain.

    Args:
        limbs: at least one.
    """

    def __init__(self, limbs: Sequence[Limb]) -> None:
        self.kinds = [track.kind for track in limbs[0].tracks]
        self._values = [
            np.stack([limb.tracks[place].values for limb in limbs])
            for place in range(len(self.kinds))
        ]
        frames = self._values[0].shape[1]
        self._angle = np.array([limb.angle for limb in limbs])[:, None]
        self._distance = np.stack([np.broadcast_to(limb.distance, frames) for limb in limbs])
        self._lever = np.array([limb.lever for limb in limbs])[:, None]
        self._chain = limbs[0].chain
        if self._chain is not None:
            chains = [limb.chain for limb in limbs if limb.chain is not None]
            self._rest = to_matrix(np.stack([each.rest_rotations for each in chains]))
            self._steps = np.stack([each.steps for each in chains])
            self._room = _room(limbs, frames)
        self._exact = [
            rotations_of(values, kind) if turns(kind) else values
            for values, kind in zip(self._values, self.kinds, strict=True)
        ]
        self._ends = self._ends_of(self._exact)

    def measure(self, values: Sequence[Floats]) -> tuple[Floats, Floats]:
        """Errors of other values of these limbs.

        Args:
            values: of each track (limbs, frames, components).

        Returns:
            Of each track by itself (limbs, tracks, frames), and of the tip and of what is carried
            (limbs, frames).
        """
        own = np.zeros((len(self._angle), len(self.kinds), values[0].shape[1]))
        turned, away = np.zeros((2, len(self._angle), values[0].shape[1]))
        decoded: list[Floats] = []
        for place, (kind, now, exact) in enumerate(
            zip(self.kinds, values, self._exact, strict=True)
        ):
            if turns(kind):
                rotations = rotations_of(now, kind)
                cosine = np.abs(np.einsum("...i,...i->...", rotations, exact))
                half = np.arccos(np.minimum(cosine, 1.0))
                own[:, place] = 2.0 * half / self._angle
                turned = np.maximum(turned, half)
                decoded.append(rotations)
                continue
            decoded.append(now)
            if kind == SCALE:
                own[:, place] = np.abs(now - exact).max(axis=2) / self._angle
            else:
                off = np.linalg.norm(now - exact, axis=2)
                own[:, place] = off / self._distance
                away = np.maximum(away, off)
        joint = away + self._lever * 2.0 * np.sin(turned)
        if self._chain is not None:
            off = [np.linalg.norm(each, axis=2) for each in self._ends_of(decoded) - self._ends]
            joint = np.maximum(joint, off[-1])
            bound = [each / room for each, room in zip(off, self._room, strict=True)]
            return own, np.maximum(joint / self._distance, np.max(bound, axis=0))
        return own, joint / self._distance

    def slopes(self) -> tuple[Floats, list[Floats]]:
        """What changes of the values change, to first order about those that are exact.

        Returns:
            By limb, track, direction, component and frame: the error of each track by itself, and
            those of the chain's tip and of the first of its ends that has a bound of its own, where
            any has (…, 3, 4, frames).
        """
        rows, frames = self._distance.shape
        own = np.zeros((rows, len(self.kinds), 3, 4, frames))
        radians: dict[int, Floats] = {}
        for place, (kind, values) in enumerate(zip(self.kinds, self._values, strict=True)):
            if not turns(kind):
                bound = 1.0 / (self._distance if kind == LOCATION else self._angle)
                for axis in range(3):
                    own[:, place, axis, axis] = bound
                continue
            radians[place] = self._radians(kind, values)
            reach = np.maximum(1.0 / self._angle, self._lever / self._distance)
            own[:, place] = np.moveaxis(radians[place], 1, -1) * reach[:, None, None]
        if self._chain is None:
            return own, []
        turn, steps = self._walked(self._exact)
        bones = np.arange(len(steps))[:, None, None]
        bounded = np.isfinite(self._room)
        tips = [self._moved(radians, turn, steps, np.minimum(self._distance, self._room[-1]))]
        if bounded[:-1].any():
            # Of the ends that have a bound of their own, the first one moves the others.
            first = np.where(bounded[:-1].any(axis=0), bounded[:-1].argmax(axis=0), -1)
            room = np.take_along_axis(self._room, np.maximum(first, 0)[None], axis=0)[0]
            steps = [
                step * each[..., None] for step, each in zip(steps, bones <= first, strict=True)
            ]
            tips.append(self._moved(radians, turn, steps, room))
        return own, tips

    def _moved(
        self, radians: dict[int, Floats], turn: list[Floats], steps: list[Floats], bound: Floats
    ) -> Floats:
        """How values move the end of a chain of these steps: (limbs, tracks, 3, 4, frames)."""
        assert self._chain is not None
        tip = np.zeros((len(bound), len(self.kinds), 3, 4, bound.shape[1]))
        arms, stretched = self._levers(steps)
        for bone, track in enumerate(self._chain.turned):
            if track >= 0:
                world = to_matrix(turn[bone]) @ self._rest[:, None, bone] @ radians[track]
                moved = cross(np.swapaxes(world, -1, -2), arms[bone][:, :, None])
                tip[:, track] = moved.transpose(0, 3, 2, 1)
        for bone, track in enumerate(self._chain.scaled):
            if track >= 0:
                along = self._values[track][..., 1:2]
                tip[:, track, :, 1] = np.swapaxes(stretched[bone] / along, 1, 2)
        return tip / bound[:, None, None, None]

    def _radians(self, kind: str, values: Floats) -> Floats:
        """How values turn a bone in its own axes: (limbs, frames, 3, 4)."""
        exact = rotations_of(values, kind)
        result = np.zeros((*exact.shape[:2], 3, 4))
        if kind == "QUATERNION":
            w, x, y, z = np.moveaxis(exact, -1, 0)
            rows = ((-x, w, z, -y), (-y, -z, w, x), (-z, y, -x, w))
            return 2.0 * np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
        for component in range(values.shape[2]):
            moved = values.copy()
            moved[..., component] += _STEP
            turned = multiply(conjugate(exact), rotations_of(moved, kind))
            turned *= np.where(turned[..., :1] < 0.0, -1.0, 1.0)
            result[..., component] = 2.0 * turned[..., 1:] / _STEP
        return result

    def _walked(self, decoded: Sequence[Floats]) -> tuple[list[Floats], list[Floats]]:
        """Turn (limbs, frames, 4) and step (limbs, frames, 3) of each bone, from the root."""
        assert self._chain is not None
        shape = decoded[0].shape[:2]
        rest = np.broadcast_to((1.0, 0.0, 0.0, 0.0), (*shape, 4))
        turn, longer = rest, np.ones((*shape, 1))
        found, steps = [], []
        for bone, track in enumerate(self._chain.turned):
            if not self._chain.follows[bone]:
                turn = rest
            if track >= 0:
                own = decoded[track].copy()
                own[..., 1:] = own[..., 1:] @ np.swapaxes(self._rest[:, bone], 1, 2)
                turn = multiply(turn, own)
            step = rotate(turn, self._steps[:, None, bone])
            if self._chain.scaled:
                scale = self._chain.scaled[bone]
                own_length = decoded[scale][..., 1:2] if scale >= 0 else np.ones((*shape, 1))
                longer = longer * own_length if self._chain.handed[bone] else own_length
                step = step * longer
            found.append(turn)
            steps.append(step)
        return found, steps

    def _ends_of(self, decoded: Sequence[Floats]) -> Floats:
        """Where the chain's bones end, seen from its root: (bones, limbs, frames, 3)."""
        if self._chain is None:
            return np.zeros((0, 1, 1, 3))
        return np.cumsum(self._walked(decoded)[1], axis=0)

    def _levers(self, steps: list[Floats]) -> tuple[list[Floats], list[Floats]]:
        """What turns and what stretches with each bone, (limbs, frames, 3)."""
        assert self._chain is not None
        arms, stretched = [steps[-1]], [steps[-1]]
        for bone in range(len(steps) - 2, -1, -1):
            follows = self._chain.follows[bone + 1]
            arms.append(steps[bone] + arms[-1] if follows else steps[bone])
            handed = bool(self._chain.scaled) and self._chain.handed[bone + 1]
            stretched.append(steps[bone] + stretched[-1] if handed else steps[bone])
        return arms[::-1], stretched[::-1]


def _room(limbs: Sequence[Limb], frames: int) -> Floats:
    """How far ends of bones may be off, infinite where none says: (bones, limbs, frames)."""
    none = np.full((frames, len(limbs[0].chain.turned if limbs[0].chain else ())), np.inf)
    return np.stack([none if each.room is None else each.room for each in limbs]).transpose(2, 0, 1)
