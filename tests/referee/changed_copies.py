# SPDX-License-Identifier: GPL-3.0-or-later
"""People copied so that every joint moves as before, and yet all that a file may differ in differs.

What is played of an armature is put onto another one: with other rest poses and bone axes, other
units, elsewhere in the world, at other frames, with other kinds of keys, or through another file
format. Whoever looks at joints sees the same person.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from .recording import Floats, show

MODES = ("QUATERNION", "XYZ", "ZYX", "YXZ", "AXIS_ANGLE", "ZXY", "XZY", "YZX")


@dataclass(frozen=True, eq=False)
class Played:
    """An armature over time, whatever moved it."""

    names: list[str]
    parents: list[int]
    rest: Floats
    """(bones, 4, 4), armature space."""
    poses: Floats
    """(frames, bones, 4, 4), armature space; no scale."""
    lengths: Floats
    world: Floats
    """(frames, 4, 4)"""
    frames: Floats

    @classmethod
    def of(cls, armature: Any, frames: Floats) -> Played:
        """What a scene shows of an armature."""
        bones = list(armature.data.bones)
        names = [each.name for each in bones]
        parents = [-1 if each.parent is None else names.index(each.parent.name) for each in bones]
        poses, world = [], []
        for frame in frames:
            show(bpy.context.scene, float(frame))
            seen = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
            world.append(np.array(seen.matrix_world))
            poses.append([np.array(seen.pose.bones[name].matrix) for name in names])
        moved = np.array(poses)
        moved[..., :3, :3] = _turns(moved)
        rest = np.array([np.array(each.matrix_local) for each in bones])
        lengths = np.array([each.length for each in bones])
        return cls(names, parents, rest, moved, lengths, np.array(world), np.array(frames))


@dataclass(frozen=True, eq=False)
class Copy:
    """A person who moves as another one does."""

    armature: Any
    into: Floats
    """(4, 4) from the world in which the other one is."""
    shift: float = 0.0
    """Frames by which this one comes later."""
    stretch: float = 1.0
    """Frames that take one of the other's."""

    def frames(self, frames: Floats) -> Floats:
        """When this one is where the other one is at some frames."""
        return self.stretch * frames + self.shift


def _turns(matrices: Floats) -> Floats:
    axes = matrices[..., :3, :3]
    return axes / np.linalg.norm(axes, axis=-2, keepdims=True)


def _inverse(matrices: Floats) -> Floats:
    return np.linalg.inv(matrices)


def random_turns(count: int, seed: int) -> Floats:
    """(count, 4, 4) rotations without rhyme or reason."""
    axes, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(count, 3, 3)))
    made = np.broadcast_to(np.eye(4), (count, 4, 4)).copy()
    made[:, :3, :3] = axes * np.linalg.det(axes)[:, None, None]
    return made


def resting(person: Played, pose: Floats, axes: Floats) -> Played:
    """With another rest pose and other bone axes.

    Args:
        person: as played.
        pose: (bones, 4, 4) rotations of bones at rest, armature space.
        axes: (bones, 4, 4) rotations of their axes, along these.
    """
    poses = person.poses @ axes
    rest = person.rest @ axes
    for bone, parent in enumerate(person.parents):
        turned = pose[bone] @ person.rest[bone] @ axes[bone]
        if parent >= 0:
            # Where it sits on its parent stays, so what is rigid stays so.
            usual = _inverse(person.poses[:, parent]) @ person.poses[:, bone, :, 3:]
            at = _inverse(axes[parent]) @ np.median(usual, axis=0)
            turned[:3, 3] = (rest[parent] @ at)[:3, 0]
        else:
            turned[:3, 3] = person.rest[bone, :3, 3]
        rest[bone] = turned
    return replace(person, poses=poses, rest=rest)


def in_units(person: Played, unit: Floats) -> Played:
    """With other units and axes of its armature, which its object makes good.

    Args:
        person: as played.
        unit: (4, 4) from the old armature space to the new one: turned and scaled.
    """
    scale = float(np.cbrt(np.linalg.det(unit[:3, :3])))
    made = [unit @ each for each in (person.poses, person.rest)]
    for each in made:
        each[..., :3, :3] = _turns(each)
    poses, rest = made
    world = person.world @ _inverse(unit)
    return replace(person, poses=poses, rest=rest, lengths=scale * person.lengths, world=world)


def carried_by_object(person: Played) -> Played:
    """With the way of its first bone on the object."""
    way = np.broadcast_to(np.eye(4), person.world.shape).copy()
    way[:, :3, 3] = person.poses[:, 0, :3, 3] - person.poses[:1, 0, :3, 3]
    poses = _inverse(way)[:, None] @ person.poses
    return replace(person, poses=poses, world=person.world @ way)


def on_a_root(person: Played) -> Played:
    """With a bone on the ground that carries the whole, and its way."""
    way = np.broadcast_to(np.eye(4), person.world.shape).copy()
    way[:, :2, 3] = person.poses[:, 0, :2, 3]
    return replace(
        person,
        names=["root", *person.names],
        parents=[-1, *(max(each, -1) + 1 for each in person.parents)],
        rest=np.concatenate([np.eye(4)[None], person.rest]),
        poses=np.concatenate([way[:, None], person.poses], axis=1),
        lengths=np.concatenate([person.lengths[:1], person.lengths]),
    )


def build(
    person: Played, name: str, modes: tuple[str, ...] = ("QUATERNION",), *, alone: bool = False
) -> Any:
    """An armature with an action in the scene; ``alone``, every second bone turns by itself."""
    scene: Any = bpy.context.scene
    made: Any = bpy.data.objects.new(name, bpy.data.armatures.new(name))
    scene.collection.objects.link(made)
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = made
    made.select_set(state=True)
    bpy.ops.object.mode_set(mode="EDIT")
    bones = made.data.edit_bones
    for bone, parent in enumerate(person.parents):
        each = bones.new(person.names[bone])
        each.tail = (0.0, max(float(person.lengths[bone]), 1e-6), 0.0)
        each.matrix = Matrix(person.rest[bone].tolist())
        if parent >= 0:
            each.parent = bones[person.names[parent]]
            each.use_inherit_rotation = not (alone and bone % 2)
    bpy.ops.object.mode_set(mode="OBJECT")
    # What Blender made of it, to the last digit.
    rest = np.array([np.array(made.data.bones[each].matrix_local) for each in person.names])
    keys: dict[str, Floats] = {}
    for bone, parent in enumerate(person.parents):
        own, rests = person.poses[:, bone], rest[bone]
        if parent >= 0:
            own = _inverse(person.poses[:, parent]) @ own
            rests = _inverse(rest[parent]) @ rests
        pose_bone = made.pose.bones[person.names[bone]]
        pose_bone.rotation_mode = modes[bone % len(modes)]
        moved = _inverse(rests) @ own
        if not pose_bone.bone.use_inherit_rotation:
            moved = _turned_alone(pose_bone, person.poses[:, bone], person.poses[:, parent])
        keys |= _keys(pose_bone.path_from_id(), pose_bone.rotation_mode, moved)
    made.rotation_mode = "QUATERNION"
    if np.ptp(person.world, axis=0).max() > 0.0:
        keys |= _keys("", "QUATERNION", person.world)
    made.matrix_world = Matrix(person.world[0].tolist())
    _key(made, person.frames, keys)
    return made


def _turned_alone(bone: Any, poses: Floats, carriers: Floats) -> Floats:
    """What moves a bone (frames, 4, 4) that does not turn with its parent, as Blender has it."""
    own = bone.bone
    return np.array(
        [
            own.convert_local_to_pose(
                Matrix(pose.tolist()),
                own.matrix_local,
                parent_matrix=Matrix(carrier.tolist()),
                parent_matrix_local=own.parent.matrix_local,
                invert=True,
            )
            for pose, carrier in zip(poses, carriers, strict=True)
        ]
    )


def _keys(path: str, mode: Any, matrices: Floats) -> dict[str, Floats]:
    """Values (frames, channels) by data path."""
    each = [Matrix(matrix) for matrix in matrices.tolist()]
    start = f"{path}." if path else ""
    found = {f"{start}location": matrices[:, :3, 3]}
    values: list[Any] = []
    for matrix in each:
        turn = matrix.to_quaternion()
        if mode == "QUATERNION":
            if values and turn.dot(values[-1]) < 0.0:
                turn.negate()
            values.append(turn)
        elif mode == "AXIS_ANGLE":
            axis, angle = turn.to_axis_angle()
            values.append((angle, *axis))
        else:
            values.append(turn.to_euler(mode, values[-1]) if values else turn.to_euler(mode))
    names = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}
    found[start + names.get(mode, "rotation_euler")] = np.array([list(each) for each in values])
    return found


def _key(armature: Any, frames: Floats, keys: dict[str, Floats]) -> None:
    armature.animation_data_create()
    action = bpy.data.actions.new(armature.name)
    armature.animation_data.action = action
    slot = action.slots.new("OBJECT", armature.name)
    armature.animation_data.action_slot = slot
    strip = action.layers.new("Layer").strips.new(type="KEYFRAME")
    curves = strip.channelbag(slot, ensure=True).fcurves
    for path, values in keys.items():
        for index in range(values.shape[1]):
            curve = curves.new(path, index=index)
            curve.keyframe_points.add(len(frames))
            places = np.stack([frames, values[:, index]], axis=-1)
            curve.keyframe_points.foreach_set("co", places.ravel().astype(np.float32))
            curve.keyframe_points.foreach_set("interpolation", [1] * len(frames))
            curve.update()


def _exported(kind: str) -> Callable[[Played, Path], Copy]:
    """Written by Blender into a file of this kind, and read again."""

    def through(person: Played, folder: Path) -> Copy:
        if kind == "bvh":
            # It knows no object.
            person = in_units(person, person.world[0])
        made = build(person, "sent")
        bpy.ops.object.select_all(action="DESELECT")
        made.select_set(state=True)
        scene: Any = bpy.context.scene
        scene.frame_start, scene.frame_end = int(person.frames[0]), int(person.frames[-1])
        file = str(folder / f"sent.{kind}")
        _EXPORTS[kind](file)
        bpy.data.actions.remove(made.animation_data.action)
        bpy.data.objects.remove(made)
        before = set(bpy.data.objects)
        _IMPORTS[kind](file)
        new = [each for each in bpy.data.objects if each not in before]
        armature: Any = next(each for each in new if each.type == "ARMATURE")
        first = armature.animation_data.action.frame_range[0]
        return Copy(armature, np.eye(4), float(first - person.frames[0]))

    return through


_EXPORTS: dict[str, Callable[[str], Any]] = {
    "bvh": lambda file: bpy.ops.export_anim.bvh(
        filepath=file,
        frame_start=bpy.context.scene.frame_start,
        frame_end=bpy.context.scene.frame_end,
        root_transform_only=False,
        rotate_mode="XYZ",
    ),
    "glb": lambda file: bpy.ops.export_scene.gltf(
        filepath=file,
        use_selection=True,
        export_optimize_animation_size=False,
        export_animation_mode="ACTIVE_ACTIONS",
    ),
    "fbx": lambda file: bpy.ops.export_scene.fbx(
        filepath=file,
        use_selection=True,
        add_leaf_bones=False,
        bake_anim_simplify_factor=0.0,
        bake_anim_use_nla_strips=False,
        bake_anim_use_all_actions=False,
    ),
}
_IMPORTS: dict[str, Callable[[str], Any]] = {
    "bvh": lambda file: bpy.ops.import_anim.bvh(
        filepath=file,
        update_scene_fps=False,
        use_fps_scale=False,
        axis_forward="Y",
        axis_up="Z",
    ),
    "glb": lambda file: bpy.ops.import_scene.gltf(filepath=file),
    "fbx": lambda file: bpy.ops.import_scene.fbx(filepath=file),
}


def _turned(degrees: float, axis: Any) -> Floats:
    return np.array(Matrix.Rotation(np.radians(degrees), 4, axis))


def _scaled(factor: float) -> Floats:
    return np.diag([factor, factor, factor, 1.0])


def _with(change: Callable[[Played], Played], **more: Any) -> Callable[[Played, Path], Copy]:
    return lambda person, _: Copy(build(change(person), "copy", **more), np.eye(4))


def _placed(into: Floats) -> Callable[[Played, Path], Copy]:
    return lambda person, _: Copy(build(replace(person, world=into @ person.world), "copy"), into)


def _at(shift: float, stretch: float = 1.0) -> Callable[[Played, Path], Copy]:
    def later(person: Played, _: Path) -> Copy:
        made = Copy(None, np.eye(4), shift, stretch)
        armature = build(replace(person, frames=made.frames(person.frames)), "copy")
        return replace(made, armature=armature)

    return later


def _rested(seed: int) -> Callable[[Played], Played]:
    def change(person: Played) -> Played:
        count = len(person.names)
        return resting(person, random_turns(count, seed), random_turns(count, seed + 1))

    return change


def _axes(person: Played) -> Played:
    """The same rest pose, other bone axes."""
    count = len(person.names)
    still = np.broadcast_to(np.eye(4), (count, 4, 4))
    return resting(person, still, random_turns(count, 9))


ELSEWHERE = _turned(130.0, "Z")
ELSEWHERE[:3, 3] = 3.0, -7.0, 0.0

CHANGES: dict[str, Callable[[Played, Path], Copy]] = {
    "as built": _with(lambda person: person),
    "rest pose": _with(_rested(3)),
    "another rest pose": _with(_rested(5)),
    "bone axes": _with(_axes),
    "rotation modes": _with(lambda person: person, modes=MODES),
    "turns by itself": _with(lambda person: person, alone=True),
    "centimetres": _with(lambda person: in_units(person, _scaled(100.0) @ _turned(-90.0, "X"))),
    "hundredfold": _placed(_scaled(100.0)),
    "a hundredth": _placed(_scaled(0.01)),
    "elsewhere": _placed(ELSEWHERE),
    "on a root": _with(on_a_root),
    "way on the object": _with(carried_by_object),
    "before 0": _at(-20.0),
    "on half frames": _at(1000.5),
    "between frames": _at(0.37),
    "fps": _at(0.0, 2.0),
    "glb": _exported("glb"),
    "fbx": _exported("fbx"),
    "bvh": _exported("bvh"),
}
"""How copies differ. ``fps`` changes base and clip at once, for a scene has one frame rate."""
