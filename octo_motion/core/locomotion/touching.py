# SPDX-License-Identifier: GPL-3.0-or-later
"""What is near to what in a crowd of arms, and which way it is to part.

Two capsules part straight away from each other, unless their middles have nearly met, or met and
gone on. Then there is no telling from the moment alone, and an arm that passes through another
would be pushed one way and then the other. So it is told from where the arms begin: each stays on
its own side of the other, and outside of the body. That changes with nothing, so what comes of it
has no jumps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ..rotations import Floats
from .arm_shapes import smooth
from .separation import Capsules, near, nearest, pairs_of, parts_of

GIVEN: Final = 0.05
"""Share of the thinner radius by which arms may overlap: flesh gives."""
_SOFT: Final = 0.15
"""The same from which on, before that, they begin to make way."""
NEAR: Final = 1.0
"""Sums of radii between arms up to which one may be on the wrong side of the other."""
_BESIDE: Final = 0.4
"""How much less that is where it is on the right side."""
_TINY: Final = 1e-12


@dataclass(frozen=True, eq=False)
class Crowd:
    """All arms of a body over time, in the armature's space."""

    joints: Floats
    """(frames, arms, joints, 3); of an arm that has fewer the last ones are the same."""
    radii: Floats
    """(arms, joints)"""
    at_rest: Floats
    """(arms, joints, 3)"""
    lying: np.ndarray
    """(frames, arms, joints) which joints rest on the ground and must not move."""
    kept: np.ndarray
    """(frames, arms) which arms are to stay as they are."""
    upward: Floats
    """(3,) unit: the body's."""
    up: Floats
    """(frames, 3) unit: the world's."""


@dataclass(frozen=True, eq=False)
class Touches:
    """Capsules that are near to each other, the one of an arm and the other of any chain."""

    frame: np.ndarray
    """(touches,)"""
    arms: tuple[np.ndarray, np.ndarray]
    """Numbers of their chains; those of the body come after all arms."""
    segments: tuple[np.ndarray, np.ndarray]
    shares: tuple[Floats, Floats]
    """Where on the segment, 0…1."""
    gap: Floats
    """(touches, 3) from the other to the one."""
    distance: Floats
    wide: Floats
    """Sum of the radii there."""
    thin: Floats
    """The smaller of them."""
    side: Floats
    """(touches, 3) on which side of the other the one belongs, unit."""
    pair: np.ndarray
    """(touches,) a number for each two capsules, the same at all frames."""

    @property
    def depth(self) -> Floats:
        """(touches,) by how much they overlap, as a share of the thinner radius."""
        return (self.wide - self.distance) / self.thin


class Touching:
    """The capsules that are so near to each other at some frames that they may ever touch.

    Args:
        crowd: the arms.
        still: parts of the body, one frame each.
        frames: (some,) numbers of those that matter.
        margin: sums of radii between them up to which they are near.
        without: pairs of capsules (``Touches.pair``) that are left as they are.
    """

    def __init__(
        self,
        crowd: Crowd,
        still: Sequence[Capsules],
        frames: np.ndarray,
        margin: float,
        without: np.ndarray | None = None,
    ) -> None:
        _, arms, joints, _ = crowd.joints.shape
        chains = [
            Capsules("", crowd.joints[frames, arm], crowd.radii[arm], crowd.at_rest[arm])
            for arm in range(arms)
        ]
        body = [
            Capsules("", np.repeat(each.joints, len(frames), axis=0), each.radii, each.at_rest)
            for each in still
        ]
        parts = parts_of([*chains, *body])
        self.frames = frames
        self._arms, self._segments = arms, joints - 1
        own = arms * self._segments
        self._body = parts.starts[:1, own:], parts.ends[:1, own:]
        self._radii, self._owner = parts.radii, parts.owner
        self._places = _places(crowd, len(body))
        one, other = pairs_of([*chains, *body], arms)
        if without is not None:
            asked = ~np.isin(one * len(parts.owner) + other, without)
            one, other = one[asked], other[asked]
        frame, pair = near(parts, one, other, margin)
        self._frame, self._one, self._other = frames[frame], one[pair], other[pair]
        seen = self.at(crowd.joints)
        # On its own side an arm has less far to be looked for.
        wrong = np.einsum("ci,ci->c", seen.gap, seen.side) < 0.0
        chosen = seen.distance <= (1.0 + np.where(wrong, margin, _BESIDE * margin)) * seen.wide
        self._frame = self._frame[chosen]
        self._one, self._other = self._one[chosen], self._other[chosen]

    def at(self, joints: Floats) -> Touches:
        """What is near to what, for joints (frames, arms, joints, 3)."""
        flat = len(joints), self._arms * self._segments, 3
        starts, ends = (
            np.concatenate(
                [moved.reshape(flat), np.broadcast_to(body, (len(joints), *body.shape[1:]))], axis=1
            )
            for moved, body in zip((joints[:, :, :-1], joints[:, :, 1:]), self._body, strict=True)
        )
        frame, one, other = self._frame, self._one, self._other
        p, q = starts[frame, one], starts[frame, other]
        u, v = ends[frame, one] - p, ends[frame, other] - q
        s, t = nearest(p, u, q, v)
        gap = p - q + s[:, None] * u - t[:, None] * v
        here, there = (
            (1.0 - share) * self._radii[0][which] + share * self._radii[1][which]
            for share, which in ((s, one), (t, other))
        )
        arms = self._owner[one], self._owner[other]
        side = self._places[arms[0]] - self._places[arms[1]]
        return Touches(
            frame=frame,
            arms=arms,
            segments=(one % self._segments, other % self._segments),
            shares=(s, t),
            gap=gap,
            distance=_length(gap),
            wide=here + there,
            thin=np.maximum(np.minimum(here, there), _TINY),
            side=side / np.maximum(_length(side), _TINY)[:, None],
            pair=one * len(self._owner) + other,
        )


def _places(crowd: Crowd, body: int) -> Floats:
    """Where chains (chains, 3) begin, seen from above: arms round the body, the body inside."""
    roots = crowd.at_rest[:, 1]
    middle = np.broadcast_to(crowd.at_rest[:, 0].mean(axis=0), (body, 3))
    places = np.concatenate([roots, middle])
    return places - (places @ crowd.upward)[:, None] * crowd.upward


def aside(touches: Touches) -> tuple[Floats, Floats]:
    """How the one of each pair has to move against the other for them to touch no more.

    Returns:
        Unit vectors (touches, 3) which way, and how far (touches,), 0 where they are apart.
    """
    apart = touches.distance / touches.wide
    straight = touches.gap / np.maximum(touches.distance, _TINY)[:, None]
    wrong = np.maximum(-np.einsum("ci,ci->c", straight, touches.side), 0.0)
    # From too far it is not to be told whether they have passed through each other at all.
    told = smooth((1.0 + NEAR - apart) / NEAR)
    back = np.maximum(1.0 - apart, 0.0) + wrong * told
    way = np.minimum(apart, 1.0)[:, None] * (straight + wrong[:, None] * touches.side)
    way += back[:, None] * touches.side
    way /= np.maximum(_length(way), _TINY)[:, None]
    along = np.einsum("ci,ci->c", touches.gap, way)
    # |gap + far · way| is to be as long as that.
    least = touches.wide - GIVEN * touches.thin
    across = touches.distance**2 - along**2
    far = np.sqrt(np.maximum(least**2 - across, 0.0)) - along
    soft = _SOFT * touches.thin
    far = np.where(far > soft, far, np.maximum(far + soft, 0.0) ** 2 / (4.0 * soft))
    return way, told * far


def _length(vectors: Floats) -> Floats:
    return np.sqrt(np.einsum("ci,ci->c", vectors, vectors))
