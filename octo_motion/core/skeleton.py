# SPDX-License-Identifier: GPL-3.0-or-later
"""A skeleton as plain arrays, and its forward kinematics in batch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Final

import numpy as np

from .content_cache import content_key
from .rotations import Floats, conjugate, from_matrix, multiply, rotate

_AGREES: Final = 0.02
"""Of a factor, within which two bones are too long by the same."""
_MOST_AGREE: Final = 0.8
"""Share of the bones with children that agree on it."""
_FEWEST: Final = 3
"""Such bones: two may agree by chance."""
_AS_IT_IS: Final = 0.1
"""Of a length, by which it may be off without being made up."""


def median(values: Floats) -> float:
    """Half of some numbers (count,) are above it, at least one.

    numpy's own looks whether there are masks each time, for which it first loads all that it has
    of masked arrays: a tenth of the time that a walk of 1000 frames takes.
    """
    ordered = np.sort(values)
    half = len(ordered) // 2
    return float(ordered[half] + ordered[-half - 1]) / 2.0


def without_made_up_scale(lengths: Floats, heads: Floats, parents: Sequence[int]) -> Floats:
    """Lengths (bones,) without a factor by which an importer made all bones too long or too short.

    glTF has joints and no tails. Blender's importer lets a bone end where a child begins, but
    forgets the scale of the armature: of a figure in centimetres all bones are a hundred times as
    long as the way to the next joint. Where bones do not agree on such a factor, they stay.
    """
    below = np.flatnonzero(np.array(parents) >= 0)
    above = np.array(parents)[below]
    ways = np.linalg.norm(heads[below] - heads[above], axis=1)
    there = ways > 1e-6 * max(float(ways.max(initial=0.0)), 1e-12)
    above, logs = above[there], np.log(lengths[above[there]] / ways[there])
    order = np.argsort(above, kind="stable")
    # Not by np.unique, for the same reason as with ``median``.
    begun = np.flatnonzero(np.diff(above[order], prepend=-1))
    if len(begun) < _FEWEST:
        return lengths
    agreeing = np.abs(logs[:, None] - logs) < np.log1p(_AGREES)
    shares = np.logical_or.reduceat(agreeing[order], begun, axis=0).mean(axis=0)
    best = int(np.argmax(shares))
    factor = float(np.exp(median(logs[agreeing[:, best]])))
    made_up = shares[best] >= _MOST_AGREE and abs(np.log(factor)) > np.log1p(_AS_IT_IS)
    return lengths / factor if made_up else lengths


@dataclass(frozen=True)
class Skeleton:
    """The bones of an armature at rest, parents before children.

    Lengths and positions are in the armature's own units, orientations in its own space.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    """Index of each bone's parent, −1 for a root."""
    rest_matrices: Floats
    """(bones, 4, 4), armature space; a bone points along its local +Y."""
    lengths: Floats
    """(bones,) as :func:`without_made_up_scale` has them."""
    connected: tuple[bool, ...]
    """Whether a bone's head is fixed to its parent's tail."""
    deform: tuple[bool, ...]
    inherits_rotation: tuple[bool, ...]
    constrained: tuple[bool, ...]
    """Whether something else than keys moves the bone: constraints or drivers."""
    weighted: tuple[bool, ...]
    """Whether some mesh has a vertex group of the bone's name."""
    bendy_segments: tuple[int, ...]
    sucker_axes: tuple[str, ...]
    """Local axis that the suckers face ("-Z", "+X", …), or "" where the rig does not say."""
    tips: Mapping[str, float] = field(default_factory=dict)
    """Lengths of bones that are the last of an arm, by their skin, where it goes on beyond their
    tails: files of other programs know no tails."""

    def __len__(self) -> int:
        """Number of bones."""
        return len(self.names)

    @cached_property
    def content(self) -> bytes:
        """A key of all of it (:func:`content_key`)."""
        return content_key(*(getattr(self, each.name) for each in fields(self)))

    @cached_property
    def index(self) -> dict[str, int]:
        """Bone index by name."""
        return {name: number for number, name in enumerate(self.names)}

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """Indices of each bone's children."""
        lists: list[list[int]] = [[] for _ in self.names]
        for bone, parent in enumerate(self.parents):
            if parent >= 0:
                lists[parent].append(bone)
        return tuple(tuple(each) for each in lists)

    def ancestors(self, bone: int) -> list[int]:
        """Parents of a bone up to the root, nearest first."""
        found = []
        while (bone := self.parents[bone]) >= 0:
            found.append(bone)
        return found

    @cached_property
    def heads(self) -> Floats:
        """(bones, 3), armature space."""
        return self.rest_matrices[:, :3, 3].copy()

    @cached_property
    def tails(self) -> Floats:
        """(bones, 3), armature space."""
        return self.heads + self.rest_matrices[:, :3, 1] * self.lengths[:, None]

    @cached_property
    def rest_rotations(self) -> Floats:
        """(bones, 4) quaternions, armature space."""
        return from_matrix(self.rest_matrices[:, :3, :3])

    def pose(self, basis: Floats, locations: Floats | None = None) -> tuple[Floats, Floats]:
        """Forward kinematics of rotations (…, bones, 4), Blender's ``matrix_basis``, and locations
        (…, bones, 3) in each bone's rest frame.

        Orientations (…, bones, 4) and heads (…, bones, 3) are in armature space.
        """
        rotations = np.empty(basis.shape)
        heads = np.empty((*basis.shape[:-1], 3))
        for bone, parent in enumerate(self.parents):
            rest = self.rest_rotations[bone]
            head = self.heads[bone]
            if parent < 0:
                carried, position = np.broadcast_to(rest, basis[..., bone, :].shape), head
            else:
                # How the parent has moved from its rest pose moves its children.
                turn = multiply(
                    rotations[..., parent, :],
                    conjugate(self.rest_rotations[parent]),
                )
                position = heads[..., parent, :] + rotate(turn, head - self.heads[parent])
                carried = multiply(turn, rest)
            if locations is not None:
                # Along the axes that the parent carries, whether its rotation is inherited or not.
                position = position + rotate(carried, locations[..., bone, :])
            if not self.inherits_rotation[bone]:
                carried = np.broadcast_to(rest, basis[..., bone, :].shape)
            heads[..., bone, :] = position
            rotations[..., bone, :] = multiply(carried, basis[..., bone, :])
        return rotations, heads
