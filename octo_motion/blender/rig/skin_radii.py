# SPDX-License-Identifier: GPL-3.0-or-later
"""How thick the skin is about bones, measured on the meshes that an armature deforms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import bpy
import numpy as np

from ...core.content_cache import content_key
from ...core.rotations import Floats
from .armature import deformed_meshes

_MOST_VERTICES: Final = 3_000
"""Of more, only every second, third … is looked at."""
_FEW: Final = 4
"""Vertices of a bone that do not yet tell its thickness."""
_MOST: Final = 0.75
"""Share of a bone's vertices that lie within its radius: suckers stand out a little."""
_REACHED: Final = 0.02
"""Share of a part's vertices at either end that stand out of it."""
_MUCH: Final = 1.5
"""How much larger a part about its bone may be than one about its own longest way."""
_ROUNDED: Final = 1e-6
"""To which a skin's place on its armature is known."""
_BONE_ROOT, _BONE_TIP = 0.06, 0.012
"""Radius in arm lengths at root and tip of an arm without skin."""


def radii_of_skin(armature: bpy.types.Object, chains: Sequence[Sequence[str]]) -> list[Floats]:
    """Radii (bones + 1,) of the skin at the joints of each chain, armature units.

    Within a bone's lie three quarters of the vertices that follow it more than any other bone, at
    rest. Bones without such vertices take over their neighbours'; a chain without any is given
    the slender form that arms usually have.

    Args:
        armature: the armature object.
        chains: names of bones, root to tip.
    """
    assert isinstance(armature.data, bpy.types.Armature)
    bones = armature.data.bones
    distances: dict[str, list[Floats]] = {}
    for name, points in _followers(armature):
        bone = bones.get(name)
        if bone is None:
            continue
        head, tail = (np.array(end) for end in (bone.head_local, bone.tail_local))
        along = tail - head
        share = np.clip((points - head) @ along / max(along @ along, 1e-18), 0.0, 1.0)
        off = points - head - share[:, None] * along
        distances.setdefault(name, []).append(np.linalg.norm(off, axis=1))
    measured = {name: np.concatenate(each) for name, each in distances.items()}
    return [_of_chain(bones, chain, measured) for chain in chains]


def skin_parts(
    armature: bpy.types.Object, names: Sequence[str]
) -> list[tuple[str, Floats, Floats]]:
    """Parts of a body as thick and as long as the skin that follows single bones.

    A bone's own ends tell little of that: a head is round about a bone of any length, and files
    of other programs know no tails. So a part reaches as far as its skin does along its bone, or
    along the skin's own longest way if that makes it much smaller. Bones that no skin follows are
    none.

    Args:
        armature: the armature object.
        names: of the bones.

    Returns:
        Name, ends (2, 3) and radii (2,) of each part, armature space.
    """
    assert isinstance(armature.data, bpy.types.Armature)
    bones = armature.data.bones
    found: dict[str, list[Floats]] = {name: [] for name in names}
    for name, points in _followers(armature):
        if name in found:
            found[name].append(points)
    parts: list[tuple[str, Floats, Floats]] = []
    for name, each in found.items():
        points = np.concatenate([np.zeros((0, 3)), *each])
        if len(points) < _FEW:
            continue
        head, tail = (np.array(end) for end in (bones[name].head_local, bones[name].tail_local))
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        own = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][0]
        along = (tail - head) / max(float(np.linalg.norm(tail - head)), 1e-12)
        part, other = _part(points, head, along), _part(points, middle, own)
        ends, radius = part if _volume(*part) <= _MUCH * _volume(*other) else other
        parts.append((name, ends, np.full(2, radius)))
    return parts


def _part(points: Floats, start: Floats, along: Floats) -> tuple[Floats, float]:
    """Ends (2, 3) and radius of the capsule about a line that points (n, 3) lie round."""
    seen = points - start
    height = seen @ along
    radius = float(np.quantile(np.linalg.norm(seen - height[:, None] * along, axis=1), _MOST))
    low, high = np.quantile(height, [_REACHED, 1.0 - _REACHED])
    middle = 0.5 * (low + high)
    reached = np.array([min(low + radius, middle), max(high - radius, middle)])
    return start + reached[:, None] * along, radius


def _volume(ends: Floats, radius: float) -> float:
    length = float(np.linalg.norm(ends[1] - ends[0]))
    return radius * radius * (length + 4.0 / 3.0 * radius)


def skin_key(armature: bpy.types.Object) -> bytes:
    """What the radii hang on, as far as it can be read at once: not which bones points follow."""
    return content_key([(names, points) for names, points in _skins(armature)])


def _of_chain(
    bones: bpy.types.ArmatureBones, chain: Sequence[str], measured: dict[str, Floats]
) -> Floats:
    lengths = np.array([bones[name].length for name in chain])
    middles = np.cumsum(lengths) - 0.5 * lengths
    known = [number for number, name in enumerate(chain) if len(measured.get(name, ())) >= _FEW]
    joints = np.concatenate([[0.0], np.cumsum(lengths)])
    whole = float(lengths.sum())
    if not known:
        return np.interp(joints, [0.0, whole], [_BONE_ROOT * whole, _BONE_TIP * whole])
    radii = np.array([float(np.quantile(measured[chain[number]], _MOST)) for number in known])
    places = middles[known]
    result = np.interp(joints, places, radii)
    if len(known) > 1:
        # Beyond the last middle it goes on as it went, not below a third of what it was.
        slope = (radii[-1] - radii[-2]) / (places[-1] - places[-2])
        beyond = joints > places[-1]
        result[beyond] = radii[-1] + slope * (joints[beyond] - places[-1])
        result = np.maximum(result, 0.3 * radii[-1])
    # Thicker further out are webs, fins and what few vertices do not tell.
    return np.minimum.accumulate(result)


def _skins(armature: bpy.types.Object) -> Iterator[tuple[tuple[str, ...], Floats]]:
    """Names of the vertex groups and some points (n, 3) at rest of each mesh, armature space."""
    for item, points, _ in _meshes(armature):
        yield tuple(group.name for group in item.vertex_groups), points


def _meshes(
    armature: bpy.types.Object,
) -> Iterator[tuple[bpy.types.Object, Floats, int]]:
    """Meshes that the armature deforms, points of theirs, and at every how many these are."""
    inverse = np.array(armature.matrix_world.inverted_safe(), dtype=np.float64)
    for item in deformed_meshes(armature):
        mesh = item.data
        assert isinstance(mesh, bpy.types.Mesh)
        step = max(1, -(-len(mesh.vertices) // _MOST_VERTICES))
        points = np.empty((len(mesh.vertices), 3), dtype=np.float32)
        mesh.vertices.foreach_get("co", points.ravel())
        matrix = inverse @ np.array(item.matrix_world, dtype=np.float64)
        # Wherever the armature has walked to, its skin is as thick.
        matrix = np.round(matrix / _ROUNDED) * _ROUNDED
        yield item, points[::step] @ matrix[:3, :3].T + matrix[:3, 3], step


def _followers(armature: bpy.types.Object) -> Iterator[tuple[str, Floats]]:
    """Of each mesh, the points at rest that follow a bone most, with the bone's name.

    Groups of other names say nothing of bones: masks, pins of cloth.
    """
    assert isinstance(armature.data, bpy.types.Armature)
    bones = armature.data.bones
    for item, moved, step in _meshes(armature):
        assert isinstance(item.data, bpy.types.Mesh)
        names = {group.index: group.name for group in item.vertex_groups if group.name in bones}
        owner = np.full(len(moved), -1)
        vertices = item.data.vertices
        for number in range(len(moved)):
            groups = [each for each in vertices[number * step].groups if each.group in names]
            if groups:
                owner[number] = max(groups, key=lambda each: each.weight).group
        for group in np.unique(owner[owner >= 0]).tolist():
            yield names[group], moved[owner == group]
