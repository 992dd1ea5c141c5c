# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms on ground of any kind, that may also move: skin and what rests, against the faces nearest.

Nothing here knows which way is up, or how a motion was made: a hold is a bone whose skin lies on
the ground and that stays where it is for a while, as seen from the face below it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import bpy
import numpy as np
from mathutils.bvhtree import BVHTree

from .creature_measures import CREEPING, LONG, NEAR, Worst
from .recording import Flags, Floats, Integers, Recording, show

_SOME = 6
"""Of the skin, one vertex of so many is looked at …"""
_DEPTHS = 12
"""… and all of them at one moment of so many."""
_FAR = 0.5
"""Arm lengths: skin farther from each face neither rests on it nor is alone in what is below."""


@dataclass(frozen=True, eq=False)
class HeldGround:
    """A mesh at the moments of a recording."""

    points: Floats
    """(moments, vertices, 3), metres."""
    triangles: Integers
    """(triangles, 3)."""
    side: float
    """1 on the side that its faces show, -1 on the other."""

    @cached_property
    def moves(self) -> bool:
        """Whether it moves at all."""
        return bool(np.any(self.points != self.points[0]))

    @cached_property
    def still(self) -> BVHTree:
        """Its faces at the first moment."""
        return self.tree(0)

    @classmethod
    def of(cls, ground: Any, frames: Floats, side: float = 1.0) -> HeldGround:
        """A mesh object's, as it is played."""
        found: list[Floats] = []
        triangles = np.empty(0, np.int32)
        for frame in frames:
            show(_scene(), float(frame))
            played = ground.evaluated_get(bpy.context.evaluated_depsgraph_get())
            mesh = played.to_mesh()
            mesh.calc_loop_triangles()
            local = np.empty(3 * len(mesh.vertices), np.float32)
            mesh.vertices.foreach_get("co", local)
            triangles = np.empty(3 * len(mesh.loop_triangles), np.int32)
            mesh.loop_triangles.foreach_get("vertices", triangles)
            world = np.array(played.matrix_world)
            found.append(local.reshape(-1, 3).astype(float) @ world[:3, :3].T + world[:3, 3])
            played.to_mesh_clear()
        return cls(np.array(found), triangles.reshape(-1, 3), side)

    def tree(self, moment: int) -> BVHTree:
        """Its faces at a moment; of ground that stays, always the same ones."""
        if moment and not self.moves:
            return self.still
        return BVHTree.FromPolygons(self.points[moment].tolist(), self.triangles.tolist())

    def above(self, moment: int, faces: Integers, places: Floats) -> Floats:
        """How far places (n, 3) are from the planes of faces (n,), on the side these show."""
        corners = self.points[moment if self.moves else 0][self.triangles[faces]]
        first, second, third = np.moveaxis(corners, 1, 0)
        normal = np.cross(second - first, third - first)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        return np.einsum("ni,ni->n", places - first, normal)

    def seen_from(self, face: int, moments: slice, places: Floats) -> Floats:
        """Places (moments, 3) as somebody on one of the faces sees them."""
        first, second, third = np.moveaxis(self.points[moments][:, self.triangles[face]], 1, 0)
        along = (second - first) / np.linalg.norm(second - first, axis=1, keepdims=True)
        normal = np.cross(along, third - first)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        axes = np.stack([along, np.cross(normal, along), normal], axis=1)
        # From the middle: what is left of a face that deforms is its own stretch.
        return np.einsum("nij,nj->ni", axes, places - (first + second + third) / 3.0)


@dataclass(frozen=True)
class Held:
    """How arms keep to their ground."""

    drift: Worst
    """Arm lengths over a hold, as seen from the ground."""
    sink: Worst
    """Arm lengths that skin is in the ground."""
    holds: int
    """How many there were."""


def held(
    recording: Recording, arms: Sequence[Sequence[str]], ground: HeldGround, length: float
) -> Held:
    """How well arms hold on, and how deep their skin is in the ground."""
    rows = np.concatenate([recording.chain(arm) for arm in arms])
    gaps, faces, depths = _looked_at(recording, rows, ground, length)
    middles, lying = recording.middles[:, rows], gaps < NEAR * length
    slow = CREEPING * length / recording.fps
    drift, holds = Worst(0.0, float(recording.frames[0])), 0
    for column, row in enumerate(rows):
        neighbours = [each for each in (column - 1, column, column + 1) if 0 <= each < len(rows)]
        down = lying[:, neighbours].all(axis=1)
        for first, last in _runs(down):
            face = int(faces[(first + last) // 2, column])
            path = ground.seen_from(face, slice(first, last), middles[first:last, column])
            still = np.linalg.norm(np.diff(path, axis=0), axis=1) < slow
            for start, end in _runs(still):
                if (end - start) / recording.fps < LONG:
                    continue
                own = path[start + 1 : end]
                away = np.linalg.norm(own - own[len(own) // 2], axis=1) / length
                holds += 1
                if away.max() > drift.value:
                    at = float(recording.frames[first + start + 1 + int(away.argmax())])
                    drift = Worst(float(away.max()), at, recording.names[row])
    return Held(drift, Worst.of(depths / length, recording.frames, recording.names), holds)


def _looked_at(
    recording: Recording, rows: Integers, ground: HeldGround, length: float
) -> tuple[Floats, Integers, Floats]:
    """How far each bone's nearest skin is from the ground and which face that is, (moments, rows)
    both, and how deep the skin of all bones is in it (moments, bones).
    """
    moments = len(recording.frames)
    gaps, faces = np.full((moments, len(rows)), np.inf), np.zeros((moments, len(rows)), dtype=int)
    depths = np.zeros((moments, len(recording.names)))
    columns = np.full(len(recording.names), -1)
    columns[rows] = np.arange(len(rows))
    far_off = [_FarOff(skin.points.shape[1]) for skin in recording.skins]
    for moment in range(moments):
        tree = ground.tree(moment)
        for skin, far in zip(recording.skins, far_off, strict=True):
            step = slice(None, None, _SOME if moment % _DEPTHS else 1)
            picked = np.arange(len(skin.bones))[step]
            picked = picked[columns[skin.bones[picked]] >= 0]
            if not ground.moves:
                picked = picked[far.may_be_within(NEAR * length, picked, skin.points[moment])]
            places, bones = skin.points[moment][picked], skin.bones[picked]
            found = [tree.find_nearest(place, _FAR * length) for place in places.tolist()]
            far.seen(
                picked, places, [_FAR * length if each[3] is None else each[3] for each in found]
            )
            near = np.array([each[2] is not None for each in found], bool)
            if not near.any():
                continue
            bones = bones[near]
            face = np.array([each[2] for each in found if each[2] is not None])
            apart = np.array([each[3] for each in found if each[3] is not None])
            below = -ground.side * ground.above(moment, face, places[near])
            # What is in the ground is to be seen each time, however deep it is.
            far.apart[picked[near][below > 0.0]] = 0.0
            np.maximum.at(depths[moment], bones, below)
            # The nearest of each bone's skin comes last, and so is the one that stays.
            last = np.argsort(-apart, kind="stable")
            face, apart, own = face[last], apart[last], columns[bones[last]]
            nearer = apart < gaps[moment, own]
            gaps[moment, own[nearer]], faces[moment, own[nearer]] = apart[nearer], face[nearer]
    return gaps, faces, depths


class _FarOff:
    """Skin that was so far from ground which stays that it can't have come near meanwhile: it is
    not looked for anew.
    """

    def __init__(self, count: int) -> None:
        self.apart = np.zeros(count)
        """(points,) metres from the ground when they were looked for last …"""
        self.places = np.zeros((count, 3))
        """… and where (points, 3) they were then."""

    def may_be_within(self, distance: float, picked: Integers, points: Floats) -> Flags:
        """Which of those picked may be nearer than this."""
        way = np.linalg.norm(points[picked] - self.places[picked], axis=1)
        return self.apart[picked] - way <= distance

    def seen(self, picked: Integers, places: Floats, apart: Sequence[float]) -> None:
        self.places[picked], self.apart[picked] = places, apart


def _runs(flags: Flags) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.pad(flags.astype(int), 1)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _scene() -> bpy.types.Scene:
    scene = bpy.context.scene
    assert scene is not None
    return scene
