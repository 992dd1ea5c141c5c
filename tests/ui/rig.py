# SPDX-License-Identifier: GPL-3.0-or-later
"""A small octopus and a route in Blender, for tests of what the artist does with them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np

from octo_motion.blender.scene.curves import add_route_curve
from octo_motion.ui.declared_settings import plain

ROUTE = ((0.0, 0.0, 0.0), (0.0, -2.0, 0.0), (1.0, -3.0, 0.5), (3.0, -3.0, 0.5))


def bind_skin(
    armature: Any,
    points: Sequence[Any],
    groups: Mapping[str, list[int]],
    faces: Sequence[tuple[int, ...]] = (),
) -> Any:
    """A mesh that an armature deforms, each point by one bone alone."""
    mesh = bpy.data.meshes.new("Skin")
    mesh.from_pydata(points, [], faces)
    skin: Any = bpy.data.objects.new("Skin", mesh)
    bpy.context.scene.collection.objects.link(skin)
    for name, numbers in groups.items():
        skin.vertex_groups.new(name=name).add(numbers, 1.0, "REPLACE")
    skin.parent = armature
    skin.modifiers.new("Armature", "ARMATURE").object = armature
    return skin


def make_octopus(
    name: str = "Octopus", *, arms: int = 4, joints: int = 6, length: float = 1.0
) -> Any:
    """An active armature: a root bone, and arms all round it that mirror by name."""
    armature: Any = bpy.data.objects.new(name, bpy.data.armatures.new(name))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    armature.select_set(state=True)
    bpy.ops.object.mode_set(mode="EDIT")
    edit_bones = armature.data.edit_bones
    root = edit_bones.new("Root")
    root.head, root.tail = (0.0, 0.0, 0.1 * length), (0.0, 0.0, 0.3 * length)
    for number in range(arms):
        side = "L" if number % 2 == 0 else "R"
        angle = np.pi * (number // 2 + 0.5) / (arms // 2) * (1.0 if side == "L" else -1.0)
        outward = np.array([np.sin(angle), -np.cos(angle), 0.0])
        parent = root
        for joint in range(joints):
            bone = edit_bones.new(f"Arm{number // 2 + 1}_{joint + 1}.{side}")
            start = np.array([0.0, 0.0, 0.1 * length]) + 0.1 * length * outward
            bone.head = start + length * joint / joints * outward
            bone.tail = start + length * (joint + 1) / joints * outward
            bone.parent = parent
            bone.use_connect = joint > 0
            parent = bone
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def give_route(armature: Any, points: Sequence[Sequence[float]] = ROUTE) -> Any:
    """A route of four control points for the armature."""
    route = add_route_curve("Route", np.array(points), bpy.context.scene.collection)
    armature.octo_motion.locomotion.route = route
    return route


@dataclass(frozen=True)
class Octopus:
    """What the fixture ``octopus`` makes: a module of tests names its own as ``OCTOPUS``."""

    add_on: bool = False
    """Whether it is the add-on's, with the arms that are found, or a small one of four arms …"""
    joints: int = 6
    """… of so many bones."""
    with_mesh: bool = True
    """The add-on's has a skin."""
    setup: str = ""
    """Set-up that is loaded before it gets its route."""
    route: Sequence[Sequence[float]] | Mapping[str, Sequence[float]] | None = None
    """Control points, or what Add Route is given; none for no route."""
    frames: int = 0
    """Length of its motion from frame 1; 0 leaves the timing as it is."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Settings of locomotion."""

    def make(self) -> Any:
        """The armature, active."""
        if self.add_on:
            click("add_octopus", with_mesh=self.with_mesh)
            armature: Any = bpy.context.object
            click("detect_arms")
        else:
            armature = make_octopus(joints=self.joints)
        settings = armature.octo_motion.locomotion
        if self.setup:
            bpy.ops.octo_motion.setup_load(name=self.setup)
        if isinstance(self.route, Mapping):
            click("add_route", **self.route)
        elif self.route is not None:
            give_route(armature, self.route)
        bpy.context.view_layer.objects.active = armature
        if self.frames:
            settings.timing, settings.frame_end = "RANGE", self.frames
        for name, value in self.settings.items():
            setattr(settings, name, value)
        return armature


def still(settings: Any) -> None:
    """Let a body do nothing by itself, for tests of what it is carried to."""
    settings.breathing = 0.0
    for name in ("surge", "mantle", "siphon", "eyes", "head"):
        setattr(settings.body, name, 0.0)


def generate(armature: Any) -> Any:
    """The action that the button makes."""
    bpy.context.view_layer.objects.active = armature
    operators: Any = bpy.ops.octo_motion
    assert operators.generate_locomotion() == {"FINISHED"}
    return armature.animation_data.action


def curves(action: Any) -> list[Any]:
    """All curves of an action."""
    return [
        curve
        for layer in action.layers
        for strip in layer.strips
        for bag in strip.channelbags
        for curve in bag.fcurves
    ]


def keys(action: Any) -> dict[tuple[str, int], np.ndarray]:
    """All keys of an action, (n, 2) frame and value, by path and component."""
    found = {}
    for curve in curves(action):
        values = np.empty(2 * len(curve.keyframe_points), dtype=np.float32)
        curve.keyframe_points.foreach_get("co", values)
        found[curve.data_path, curve.array_index] = values.reshape(-1, 2)
    return found


def joints_in_world(armature: Any, frame: float) -> np.ndarray:
    """World positions of all bones' heads and tails at a frame, (bones, 2, 3)."""
    scene = bpy.context.scene
    whole = int(np.floor(frame))
    scene.frame_set(whole, subframe=frame - whole)
    evaluated = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
    world = evaluated.matrix_world
    return np.array([[world @ bone.head, world @ bone.tail] for bone in evaluated.pose.bones])


def click(name: str, /, **properties: Any) -> set[str]:
    """Call an operator as a click does: with an undo step of its own."""
    operator = getattr(bpy.ops.octo_motion, name)
    return operator("EXEC_DEFAULT", True, **properties)  # noqa: FBT003


def scene_contents() -> dict[str, Any]:
    """All that an operator of locomotion can change, as plain data."""
    kinds = ("objects", "actions", "curves", "armatures", "node_groups", "meshes")
    contents: dict[str, Any] = {kind: getattr(bpy.data, kind).keys() for kind in kinds}
    contents["range"] = (bpy.context.scene.frame_start, bpy.context.scene.frame_end)
    contents["frame"] = bpy.context.scene.frame_current
    contents["mode"] = bpy.context.mode
    for action in bpy.data.actions:
        contents[f"users of {action.name}"] = (action.users, action.use_fake_user)
        contents[f"keys of {action.name}"] = {
            key: values.tobytes() for key, values in keys(action).items()
        }
    objects: Any = bpy.data.objects
    for each in objects:
        contents[f"settings of {each.name}"] = plain(each.octo_motion)
        contents[f"place of {each.name}"] = [tuple(row) for row in each.matrix_basis]
        data = each.animation_data
        contents[f"action of {each.name}"] = data and data.action and data.action.name
        for bone in each.pose.bones if each.pose else ():
            contents[f"pose of {each.name} {bone.name}"] = [tuple(r) for r in bone.matrix_basis]
    return contents
