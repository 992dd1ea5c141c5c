# SPDX-License-Identifier: GPL-3.0-or-later
"""How thick the skin is about bones, measured on the meshes that an armature deforms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.content_cache import ContentCache, content_key
from ...core.locomotion.rig import ArmSkin, arm_skin, joint_positions, nearest_bones
from ...core.rotations import Floats
from ...core.skeleton import Skeleton
from .armature import deformed_meshes

_MOST_POINTS: Final = 6000
"""Points of a skin that are looked at; an arm's thickness needs no more."""

_THICKEST: Final = 0.2
"""Arm lengths from an arm's middle line: what is further away is not its skin."""

_SLENDER: Final = (0.03, 0.008)
"""Radius of an arm without a skin at its root and at its tip, in arm lengths."""

_PLACED_TO: Final = 1e-5
"""Share of an armature's size, and of 1, to which it is known where its skin is."""

_SHARE: Final = 0.9
"""Of the points round a joint, the share that lies nearer to it than its radius: an arm lies on its
suckers, and on what comes out at bends …"""

_STANDS_OUT: Final = 1.25
"""… unless they are so many times as far away as half of them: webs and fins are no thickness …"""

_AT_LEAST: Final = 0.7
"""… but then this share lies nearer."""

_skins_known: Final[ContentCache[list[ArmSkin]]] = ContentCache(4)

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


def vertex_positions(mesh: bpy.types.Mesh) -> NDArray[np.float32]:
    """(vertices, 3) in the mesh's own space."""
    points = np.empty((len(mesh.vertices), 3), dtype=np.float32)
    if len(points):
        # The attribute is much quicker to read than the property that shows the same.
        attribute: Any = mesh.attributes["position"]
        attribute.data.foreach_get("vector", points.ravel())
    return points


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
    return content_key(
        [
            (tuple(group.name for group in item.vertex_groups), points)
            for item, points, _ in _meshes(armature)
        ]
    )


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


def _meshes(
    armature: bpy.types.Object,
) -> Iterator[tuple[bpy.types.Object, Floats, int]]:
    """Meshes that the armature deforms, points of theirs, and at every how many these are."""
    inverse = np.array(armature.matrix_world.inverted_safe(), dtype=np.float64)
    for item in deformed_meshes(armature):
        mesh = item.data
        assert isinstance(mesh, bpy.types.Mesh)
        step = max(1, -(-len(mesh.vertices) // _MOST_VERTICES))
        points = vertex_positions(mesh)
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


def arm_skins(
    armature: bpy.types.Object, skeleton: Skeleton, arms: Sequence[Sequence[str]]
) -> list[ArmSkin]:
    """How far the skin of each arm is from its bones at rest.

    Where no mesh hangs on the armature, arms are taken to be slender.
    """
    joints = [joint_positions(skeleton, bones) for bones in arms]
    frames = [skeleton.rest_rotations[[skeleton.index[name] for name in bones]] for bones in arms]
    points = _skin(armature, float(np.ptp(np.concatenate(joints), axis=0).max()))
    return _skins_known.get(
        content_key(points, joints, frames), lambda: _arm_skins(points, joints, frames)
    )


def _arm_skins(points: Floats, joints: Sequence[Floats], frames: Sequence[Floats]) -> list[ArmSkin]:
    """The same from points of the skin.

    Args:
        points: (n, 3).
        joints: for each arm (bones + 1, 3).
        frames: for each arm (bones, 4) its bones' rest orientations.
    """
    lengths = [float(np.linalg.norm(np.diff(each, axis=0), axis=1).sum()) for each in joints]
    found = [nearest_bones(points, each) for each in joints]
    distances = np.stack([np.linalg.norm(off, axis=1) for _, _, off in found])
    nearest = distances.argmin(axis=0)
    skins = []
    for arm, (bone, share, _) in enumerate(found):
        own = (nearest == arm) & (distances[arm] < _THICKEST * lengths[arm])
        slender = lengths[arm] * np.linspace(*_SLENDER, len(joints[arm]))
        radii = _radii(distances[arm][own], (bone + share)[own], slender)
        skins.append(arm_skin(points[own], joints[arm], frames[arm], radii))
    return skins


def _skin(armature: bpy.types.Object, size: float) -> Floats:
    """Some points (n, 3) of the meshes that the armature moves, at rest, armature space.

    Args:
        armature: the armature object.
        size: how large it is, armature units.
    """
    inverse = np.linalg.inv(np.array(armature.matrix_world, dtype=np.float64))
    found: list[tuple[np.ndarray, Floats]] = []
    for item in deformed_meshes(armature):
        mesh = item.data
        assert isinstance(mesh, bpy.types.Mesh)
        points = vertex_positions(mesh)
        place = inverse @ np.array(item.matrix_world, dtype=np.float64)
        # Wherever the armature has walked to, its skin is as thick.
        place[:3, :3] = np.round(place[:3, :3] / _PLACED_TO) * _PLACED_TO
        place[:3, 3] = np.round(place[:3, 3] / (_PLACED_TO * size)) * (_PLACED_TO * size)
        found.append((points, place))
    step = max(1, sum(len(points) for points, _ in found) // _MOST_POINTS)
    parts, passed = [np.empty((0, 3))], 0
    for points, place in found:
        some = points[-passed % step :: step].astype(np.float64)
        parts.append(some @ place[:3, :3].T + place[:3, 3])
        passed += len(points)
    return np.concatenate(parts)


def _radii(distance: Floats, along: Floats, otherwise: Floats) -> Floats:
    """The radius at each joint (joints,), where there are points round it, else its neighbours'."""
    places = np.arange(len(otherwise))
    radii = np.full(len(otherwise), np.nan)
    for joint in places:
        near = distance[np.abs(along - joint) <= 0.5]
        if len(near):
            half, many, most = np.quantile(near, [0.5, _AT_LEAST, _SHARE])
            radii[joint] = max(many, min(most, _STANDS_OUT * half))
    known = np.isfinite(radii)
    if not np.any(known):
        return otherwise
    return np.interp(places, places[known], radii[known])
