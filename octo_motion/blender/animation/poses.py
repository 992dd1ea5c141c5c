# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones' own poses: those that stay behind, that are only shown, and that no action moves."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Final

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from ...core.keyframes import Channel, constant_keys, in_rotation_mode, rotation_property
from ...core.rotations import Floats, from_mode_values
from ...core.skeleton import Skeleton
from ..rig import bone_and_property, carrying_axes
from .actions import acting_curves, curves_of, is_generated, key_points, strip_curves

AT_REST: Final[Mapping[str, tuple[float, ...]]] = {
    "location": (0.0, 0.0, 0.0),
    "scale": (1.0, 1.0, 1.0),
    "rotation_quaternion": (1.0, 0.0, 0.0, 0.0),
    "rotation_euler": (0.0, 0.0, 0.0),
    "rotation_axis_angle": (0.0, 0.0, 1.0, 0.0),
}
"""Values of a bone's properties at rest."""

LENGTH: Final = ("scale", "location")
"""Channels of bones that stretch."""
_UNSCALED: Final = 1e-3
_UNSHEARED: Final = 1e-3
"""Factors that are no scale, and cosines that are no shear."""
_TINY: Final = 1e-6
"""Factor below which a bone is scaled to nothing, and has no orientation."""
_UNMOVED: Final = 1e-6
"""By how much a value may be off that at rest and be it: single precision."""
_STILL: Final = 0.01
"""Bone lengths, radians and factors by which a bone may be off its rest pose unnoticed."""


def animated_bones(
    action: bpy.types.Action, channels: tuple[str, ...] = ("location", "rotation_")
) -> set[str]:
    """Names of the bones whose channels of these kinds the action keys."""
    # The components of a property have the same path.
    found = map(bone_and_property, {curve.data_path for curve in curves_of(action)})
    return {name for name, channel in found if name and channel.startswith(channels)}


def rest_properties(armature: bpy.types.Object, paths: Iterable[str]) -> None:
    """Put bones' properties, by data path, back to what they are at rest; others are passed."""
    bones = armature.pose.bones if armature.pose is not None else {}
    for name, channel in map(bone_and_property, paths):
        if name in bones and channel in AT_REST:
            setattr(bones[name], channel, AT_REST[channel])


def standing_of(
    armature: bpy.types.Object, bone: str, *, left_out: Collection[str] = ()
) -> tuple[Floats, Floats]:
    """Where the poses of a bone's ancestors, but for some, have brought what it hangs on.

    That is a shift (3,) and a turn (4,) of armature space; scale is left out.
    """
    assert armature.pose is not None
    ancestors = list(reversed(armature.pose.bones[bone].parent_recursive))
    moved = Matrix.Identity(4)
    for each in ancestors:
        rest = each.bone.matrix_local
        if each.name not in left_out:
            # What it does to its own rest, in armature space, carried by those above it.
            moved = moved @ rest @ each.matrix_basis @ rest.inverted_safe()
    shift, turn, _ = moved.decompose()
    return np.array(shift, dtype=np.float64), np.array(turn, dtype=np.float64)


def as_posed(
    armature: bpy.types.Object, skeleton: Skeleton, posed: Iterable[str], kept: Iterable[str]
) -> Skeleton | None:
    """The rest skeleton as if some bones' poses of now were part of it; all others are at rest.

    None where its numbers cannot tell it: something else than its pose moves a bone, some of
    ``kept``, which must keep their shape, would be sheared or scaled unequally, or a rotation or a
    scale is not handed on as a whole.
    """
    assert armature.pose is not None
    bones, posed = armature.pose.bones, set(posed)
    if any(skeleton.constrained[skeleton.index[name]] for name in posed):
        return None
    basis = {name: np.array(bones[name].matrix_basis, dtype=np.float64) for name in posed}
    sizes = [np.linalg.norm(each[:3, :3], axis=0) for each in basis.values()]
    scaled = any(np.abs(size - 1.0).max() > _UNSCALED for size in sizes)
    moved: list[Floats] = []
    for number, parent in enumerate(skeleton.parents):
        bone = bones[skeleton.names[number]].bone
        if not skeleton.inherits_rotation[number] or (scaled and bone.inherit_scale != "FULL"):
            return None
        rest = skeleton.rest_matrices[number]
        matrix = rest
        if parent >= 0:
            matrix = moved[parent] @ np.linalg.inv(skeleton.rest_matrices[parent]) @ rest
        moved.append(matrix @ basis.get(skeleton.names[number], np.eye(4)))
    matrices = np.stack(moved)
    axes = matrices[:, :3, :3]
    sizes = np.cbrt(np.abs(np.linalg.det(axes)))
    if sizes.min() < _TINY:
        return None
    sheared = np.abs(np.swapaxes(axes, 1, 2) @ axes / sizes[:, None, None] ** 2 - np.eye(3))
    order = [skeleton.index[name] for name in kept]
    if sheared[order].max(initial=0.0) > _UNSHEARED:
        return None
    # The turns of what is sheared, as near as can be.
    before, _, after = np.linalg.svd(axes)
    matrices[:, :3, :3] = before @ after
    tips = {name: far * float(sizes[skeleton.index[name]]) for name, far in skeleton.tips.items()}
    return replace(skeleton, rest_matrices=matrices, lengths=skeleton.lengths * sizes, tips=tips)


def displaced_bones(
    armature: bpy.types.Object, turned: Iterable[str], carrying: Iterable[str]
) -> list[str]:
    """Those of the bones that are posed by more than what is going to be keyed.

    Of bones whose rotation is going to be keyed, location and scale count; of those that carry
    others and get no keys, rotation as well.
    """
    if armature.pose is None:
        return []
    bones = armature.pose.bones
    found: list[str] = []
    for name in turned:
        bone = bones[name]
        moved = np.abs(np.array(bone.location)).max() / bone.length
        if max(moved, np.abs(np.array(bone.scale) - 1.0).max()) > _STILL:
            found.append(name)
    for name in carrying:
        basis = np.array(bones[name].matrix_basis)
        basis[:3, 3] /= bones[name].length
        if np.abs(basis - np.eye(4)).max() > _STILL:
            found.append(name)
    return found


def posed_channels(
    armature: bpy.types.Object,
    names: Iterable[str],
    *,
    passing: Collection[str] = (),
    own: Collection[bpy.types.Action] = (),
) -> list[tuple[str, str]]:
    """Bones and properties of theirs that are not at rest now, or that NLA strips move.

    Args:
        armature: the armature object.
        names: of the bones looked at; those that are no bone's are passed.
        passing: data paths of what does not stay as it is: of these what strips move counts alone.
        own: actions whose strips do not count.
    """
    if armature.pose is None:
        return []
    strips = strip_curves(armature.animation_data, own)
    bones, beneath = armature.pose.bones, {curve.data_path for curve in strips}
    found: list[tuple[str, str]] = []
    for name in dict.fromkeys(names):
        bone = bones.get(name)
        if bone is None:
            continue
        for channel in ("location", rotation_property(bone.rotation_mode), "scale"):
            # A few numbers at a time: numpy would take longer to be called than to compare them.
            values, rests = (*getattr(bone, channel),), AT_REST[channel]
            away = values != rests and not all(
                abs(now - rest) <= _UNMOVED for now, rest in zip(values, rests, strict=True)
            )
            if not (away or beneath):
                continue
            path = bone.path_from_id(channel)
            if (away and path not in passing) or path in beneath:
                found.append((name, channel))
    return found


def rest_channel(
    armature: bpy.types.Object, name: str, channel: str, frames: Floats, *, few: bool
) -> Channel:
    """A bone's property that is at rest at frames (frames,), few: by a single key."""
    assert armature.pose is not None
    values = np.tile(AT_REST[channel], (len(frames), 1))
    path = armature.pose.bones[name].path_from_id(channel)
    return Channel(path, values, name, constant_keys(frames[0], values[0]) if few else None)


# --- A pose that is only shown: put on an armature for a while, without keys, and taken off again


PoseValues = dict[str, tuple[tuple[float, ...], ...]]
"""A bone's own values by its name."""


def pose_values(armature: bpy.types.Object) -> PoseValues:
    """The pose that an armature has now."""
    if armature.pose is None:
        return {}
    return {
        bone.name: tuple(tuple(getattr(bone, channel)) for channel in AT_REST)
        for bone in armature.pose.bones
    }


def posed_value(values: PoseValues, bone: str, channel: str) -> tuple[float, ...]:
    """One property of a bone of :func:`pose_values`; at rest if there is no such bone."""
    own = values.get(bone)
    return AT_REST[channel] if own is None else own[tuple(AT_REST).index(channel)]


def restore_pose(armature: bpy.types.Object, values: PoseValues) -> None:
    """Put bones back to values of :func:`pose_values`; bones that are gone are passed."""
    if armature.pose is None:
        return
    for bone in armature.pose.bones:
        for channel, value in zip(AT_REST, values.get(bone.name, ()), strict=False):
            setattr(bone, channel, value)


@contextmanager
def pose_kept(armature: bpy.types.Object) -> Iterator[None]:
    """Let bones without keys keep their pose.

    For an action that is new on the armature, or has new curves, Blender would pose all bones by
    their keys, those that are posed and not keyed yet as well.
    """
    values = pose_values(armature)
    try:
        yield
    finally:
        if bpy.context.view_layer is not None:
            bpy.context.view_layer.update()
        restore_pose(armature, values)


def show_pose(
    armature: bpy.types.Object,
    names: Sequence[str],
    rotations: Floats,
    locations: Floats,
    scales: Floats | None = None,
) -> None:
    """Pose bones, without keys: the next change of frame brings back what the action says.

    Rotations (bones, 4) are from rest, locations (bones, 3) in each bone's rest frame, scales
    (bones, 3). Bones that are gone are passed.
    """
    if armature.pose is None:
        return
    bones = armature.pose.bones
    sizes = [None] * len(names) if scales is None else scales.tolist()
    for name, rotation, location, size in zip(
        names, rotations.tolist(), locations.tolist(), sizes, strict=True
    ):
        bone = bones.get(name)
        if bone is not None:
            place = Vector(location)
            if not bone.bone.use_local_location:
                place = carrying_axes(bone.bone) @ place
            basis = Matrix.LocRotScale(place[:], Quaternion(rotation), size)
            # What is so already, but for rounding, may be a pose without keys.
            if np.abs(np.subtract(basis, bone.matrix_basis)).max() > _UNMOVED:
                bone.matrix_basis = basis


PropertyValues = dict[str, tuple[float, ...]]
"""Values of an object's properties by data path."""


def show_values(armature: bpy.types.Object, values: Mapping[str, Sequence[float]]) -> None:
    """Set properties of an armature and its bones, without keys, by their data paths.

    The next change of frame brings back what the action says. Bones that are gone are passed.
    """
    for path, own in values.items():
        owner, name = _owner_of(armature, path)
        if owner is not None:
            setattr(owner, name, own)


def shown_values(armature: bpy.types.Object, paths: Iterable[str]) -> PropertyValues:
    """What properties are now that :func:`show_values` is to set, by their data paths."""
    found: PropertyValues = {}
    for path in paths:
        owner, name = _owner_of(armature, path)
        if owner is not None:
            found[path] = tuple(getattr(owner, name))
    return found


def _owner_of(armature: bpy.types.Object, path: str) -> tuple[Any, str]:
    """What has the property of a data path, none if it is gone, and the property's name."""
    owner, _, name = path.rpartition(".")
    if not owner:
        return armature, name
    try:
        return armature.path_resolve(owner), name
    except ValueError:
        return None, name


# --- Poses without keys: what a bone keeps of its own where an action says nothing ----------------
#
# Most bones are then at rest. But glTF files pose bones once and leave them out of their actions,
# and rigs come with hands that are set half closed. Blender shows such a pose under any action;
# once an action that keys all bones has been on the armature, it is gone. So it is kept beforehand,
# and taken anew when an artist has changed it meanwhile.


UnkeyedPose = dict[tuple[str, str], tuple[float, ...]]
"""Values by bone and property, where they are not those at rest."""

_SAME: Final = 1e-5
"""How far values may be off a curve, single precision, and be taken from it."""

KEPT: Final = "octo_motion_unkeyed_pose"
"""Custom property of an armature object: its unkeyed pose before we last gave it an action."""


def unkeyed_pose(armature: bpy.types.Object) -> UnkeyedPose:
    """What bones keep where an action has no curve for them.

    That is the present pose where no action moves it now. Where one does, or where one that we made
    has left its own pose behind, it is what was kept.
    """
    pose = _kept(armature)
    if armature.pose is None:
        return pose
    # An artist may change the rotation mode of a bone that is moved: then no mode of it is free.
    moved = {(name, _plain(channel)) for name, channel in _moved(armature)}
    ours = _Generated(armature)
    for bone in armature.pose.bones:
        for channel in ("location", "scale", rotation_property(bone.rotation_mode)):
            place = bone.name, channel
            values = tuple(getattr(bone, channel))
            if (bone.name, _plain(channel)) in moved or ours.left_behind(bone, channel, values):
                continue
            pose.pop(place, None)
            if values != AT_REST[channel]:
                pose[place] = values
    return pose


def _plain(channel: str) -> str:
    return "rotation" if channel.startswith("rotation") else channel


def keep_unkeyed_pose(armature: bpy.types.Object) -> None:
    """Note the unkeyed pose on the armature, before an action is given to it that keys all."""
    kept: dict[str, dict[str, list[float]]] = {}
    for (name, channel), values in unkeyed_pose(armature).items():
        kept.setdefault(name, {})[channel] = list(values)
    armature[KEPT] = kept


def _kept(armature: bpy.types.Object) -> UnkeyedPose:
    kept = armature.get(KEPT)
    if kept is None or armature.pose is None:
        return {}
    pose: UnkeyedPose = {}
    bones = armature.pose.bones
    for name, channels in kept.items():
        bone = bones.get(name)
        for channel, values in channels.items():
            if bone is not None and channel.startswith("rotation"):
                # The bone may have another rotation mode by now.
                wanted = rotation_property(bone.rotation_mode)
                pose[name, wanted] = _converted(channel, tuple(values), bone.rotation_mode)
            else:
                pose[name, channel] = tuple(values)
    return pose


def _converted(channel: str, values: tuple[float, ...], mode: str) -> tuple[float, ...]:
    """Values of a rotation in a bone's mode; Euler angles are taken to be of its order."""
    if channel == rotation_property(mode):
        return values
    # Of three angles the order is not known; the other two are modes of their own.
    before = channel.removeprefix("rotation_").upper() if len(values) == 4 else "XYZ"
    turn = from_mode_values(np.array([values]), before)
    return tuple(in_rotation_mode(turn, mode)[0].tolist())


class _Generated:
    """The actions that were made here for an armature: what they leave is nobody's pose."""

    def __init__(self, armature: bpy.types.Object) -> None:
        self._armature = armature
        self._curves: dict[str, list[dict[int, bpy.types.FCurve]]] | None = None

    def left_behind(
        self, bone: bpy.types.PoseBone, channel: str, values: tuple[float, ...]
    ) -> bool:
        """Whether one of them shows these values at some time."""
        if self._armature.get(KEPT) is None:
            # None was made before.
            return False
        if self._curves is None:
            self._curves = self._read()
        path = bone.path_from_id(channel)
        return any(_shows(curves, values) for curves in self._curves.get(path, ()))

    def _read(self) -> dict[str, list[dict[int, bpy.types.FCurve]]]:
        found: dict[str, list[dict[int, bpy.types.FCurve]]] = {}
        for action in bpy.data.actions:
            if not is_generated(action):
                continue
            own: dict[str, dict[int, bpy.types.FCurve]] = {}
            for curve in curves_of(action):
                own.setdefault(curve.data_path, {})[curve.array_index] = curve
            for path, components in own.items():
                found.setdefault(path, []).append(components)
        return found


def _shows(curves: Mapping[int, bpy.types.FCurve], values: tuple[float, ...]) -> bool:
    """Whether F-curves of a property have these values at a frame, or between two."""
    count = min(len(curve.keyframe_points) for curve in curves.values())
    if count == 0 or set(curves) != set(range(len(values))):
        return False
    rows = np.empty((count, len(values)))
    for component, curve in curves.items():
        rows[:, component] = key_points(curve)[:count, 1]
    start = rows[:-1] if count > 1 else rows
    along = rows[1:] - start if count > 1 else np.zeros_like(rows)
    away = np.array(values) - start
    share = np.sum(away * along, axis=1) / np.maximum(np.sum(along**2, axis=1), 1e-30)
    nearest = away - np.clip(share, 0.0, 1.0)[:, None] * along
    return bool(np.linalg.norm(nearest, axis=1).min() < _SAME * max(1.0, np.abs(rows).max()))


def _moved(armature: bpy.types.Object) -> Iterator[tuple[str, str]]:
    """Bones and properties that some action moves at present."""
    for path in {curve.data_path for curve in acting_curves(armature.animation_data)}:
        name, channel = bone_and_property(path)
        if name:
            yield name, channel
