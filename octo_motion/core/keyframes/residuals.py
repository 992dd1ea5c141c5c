# SPDX-License-Identifier: GPL-3.0-or-later
"""How far values are off what they should be, as rotations, as places and along a chain of bones.

All errors are shares of the bounds: 1 is what is allowed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..rotations import (
    Floats,
    from_mode_values,
    multiply,
    rotate,
    to_matrix,
)
from .tracks import LOCATION, SCALE, Limb, LimbChain


def turns(kind: str) -> bool:
    """Whether a track of this kind is a rotation."""
    return kind not in (LOCATION, SCALE)


def walked(chain: LimbChain, decoded: Sequence[Floats]) -> tuple[Floats, Floats]:
    """A chain from its root to its tip.

    Args:
        chain: its bones and the tracks that move them.
        decoded: of each track its rotations (frames, 4) or its scales (frames, 3).

    Returns:
        Turn (bones, frames, 4) of each bone away from rest, and its step (bones, frames, 3).
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
        """Errors of other values of this limb.

        Args:
            values: of each track (frames, components).

        Returns:
            Of each track by itself (tracks, frames), and of the tip, of the joints that rest and of
            what is carried (frames,).
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
