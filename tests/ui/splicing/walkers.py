# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies unlike each other that walk, made from numbers: it is known when each foot stands.

They face −Y. A foot comes down flat, lifts its heel about the ball, and swings.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

CYCLE = 32
"""Frames of two steps."""
STANDS, LIFTS = 0.45, 0.6
"""Shares of the cycle up to which a foot is flat, and on its ball."""
PITCH = np.radians(20.0)


@dataclass(frozen=True)
class Body:
    """Sizes in metres."""

    thigh: float = 0.42
    shin: float = 0.42
    ankle: float = 0.09
    foot: float = 0.15
    hips: float = 0.1
    head: float = 0.22
    clavicles: bool = True
    toes: bool = True
    loose_feet: bool = False
    """Whether feet hang on the root, as controls have placed them."""
    hips_on_torso: bool = False
    """Whether a torso of one bone, which begins at the hips, carries them."""
    scale: float = 1.0
    """Of the armature object; its bones are as much smaller."""

    @property
    def leg(self) -> float:
        """From hip to ankle."""
        return self.thigh + self.shin


BODIES = {
    "like it": Body(),
    "short legs, wide hips": Body(0.16, 0.12, 0.07, 0.12, 0.16),
    "big head, no collar bones": Body(0.3, 0.25, head=0.7, clavicles=False),
    "no toes": Body(0.35, 0.4, 0.07, toes=False),
    "loose feet": Body(0.25, 0.35, 0.06, toes=False, loose_feet=True),
    "hips on a torso": Body(0.2, 0.2, 0.06, clavicles=False, hips_on_torso=True),
    "a hundred times as large": Body(0.5, 0.45, 0.1, 0.2, scale=100.0),
}


def _heads(body: Body) -> dict[str, tuple[str, tuple[float, float, float]]]:
    """Parent and place of each bone."""
    top = body.leg + body.ankle
    arm = "clavicle" if body.clavicles else ""
    bones = {
        "root": ("", (0.0, 0.1, 0.0)),
        "hips": ("root", (0.0, 0.0, top + 0.05)),
        "spine": ("hips", (0.0, 0.0, top + 0.15)),
        "chest": ("spine", (0.0, 0.0, top + 0.3)),
        "neck": ("chest", (0.0, 0.0, top + 0.52)),
        "head": ("neck", (0.0, 0.0, top + 0.6)),
    }
    if body.hips_on_torso:
        bones["chest"] = ("root", bones["hips"][1])
        bones["hips"] = ("chest", bones["hips"][1])
        del bones["spine"]
    for side, sign in (("L", 1.0), ("R", -1.0)):
        x = sign * body.hips
        if body.clavicles:
            bones[f"clavicle.{side}"] = ("chest", (sign * 0.03, 0.0, top + 0.48))
        above = f"{arm}.{side}" if arm else "chest"
        bones[f"upper_arm.{side}"] = (above, (sign * 0.18, 0.0, top + 0.48))
        bones[f"forearm.{side}"] = (f"upper_arm.{side}", (sign * 0.45, 0.01, top + 0.48))
        bones[f"hand.{side}"] = (f"forearm.{side}", (sign * 0.7, 0.0, top + 0.48))
        bones[f"thigh.{side}"] = ("hips", (x, 0.0, top))
        bones[f"shin.{side}"] = (f"thigh.{side}", (x, -0.001, body.ankle + body.shin))
        above = "root" if body.loose_feet else f"shin.{side}"
        bones[f"foot.{side}"] = (above, (x, 0.0, body.ankle))
        if body.toes:
            bones[f"toe.{side}"] = (f"foot.{side}", (x, -body.foot, 0.02))
    return bones


def make_body(name: str, body: Body) -> Any:
    """An armature that rests standing on the ground."""
    armature: Any = bpy.data.objects.new(name, bpy.data.armatures.new(name))
    bpy.context.scene.collection.objects.link(armature)
    armature.scale = (body.scale,) * 3
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    bones = _heads(body)
    for bone, (_, place) in bones.items():
        made = armature.data.edit_bones.new(bone)
        below = [each for each, (above, _) in bones.items() if above == bone]
        end = bones[below[0]][1] if len(below) == 1 else (place[0], place[1], place[2] + body.head)
        if not below and bone.startswith(("foot", "toe")):
            end = (place[0], place[1] - 0.07, place[2])
        made.head, made.tail = Vector(place) / body.scale, Vector(end) / body.scale
    for bone, (parent, _) in bones.items():
        armature.data.edit_bones[bone].parent = armature.data.edit_bones.get(parent)
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


@dataclass(frozen=True)
class Step:
    """Where a foot is: its ankle, and how much its heel is up."""

    y: float
    z: float
    pitch: float


def step(body: Body, phase: float, stride: float) -> Step:
    """Of a foot at a phase of a walk, one cycle of which goes by a stride."""
    rounds, share = np.floor(phase), phase - np.floor(phase)
    ball = np.array([-body.foot, 0.02 - body.ankle])

    def about_ball(pitch: float) -> tuple[float, float]:
        turn = np.array([[np.cos(pitch), -np.sin(pitch)], [np.sin(pitch), np.cos(pitch)]])
        y, z = ball - turn @ ball
        return float(y), float(z)

    start = -stride * (rounds + 0.25)
    if share <= STANDS:
        return Step(start, body.ankle, 0.0)
    if share <= LIFTS:
        pitch = PITCH * (1.0 - np.cos(np.pi * (share - STANDS) / (LIFTS - STANDS))) / 2.0
        y, z = about_ball(pitch)
        return Step(start + y, body.ankle + z, pitch)
    gone = (share - LIFTS) / (1.0 - LIFTS)
    eased = gone * gone * (3.0 - 2.0 * gone)
    y, z = about_ball(PITCH)
    lift = 0.1 * body.leg * np.sin(np.pi * gone) ** 2
    return Step(
        start + (1.0 - eased) * y - eased * stride,
        body.ankle + (1.0 - eased) * z + lift,
        PITCH * (1.0 - eased),
    )


def walk(armature: Any, body: Body, cycles: int = 3) -> Any:
    """Key a walk, first frame 1; it ends in the pose in which it begins."""
    frames = cycles * CYCLE + 1
    stride = 0.8 * body.leg
    armature.animation_data_clear()
    action = bpy.data.actions.new(f"{armature.name} Walk")
    armature.animation_data_create().action = action
    for frame in range(1, frames + 1):
        phase = (frame - 1) / CYCLE
        _pose(armature, body, phase, stride)
        for bone in armature.pose.bones:
            bone.rotation_mode = "QUATERNION"
            bone.keyframe_insert("rotation_quaternion", frame=frame)
            if bone.name == _carrier(body) or (body.loose_feet and bone.name.startswith("foot")):
                bone.keyframe_insert("location", frame=frame)
    return action


def _carrier(body: Body) -> str:
    """The bone that carries the whole."""
    return "chest" if body.hips_on_torso else "hips"


def _pose(armature: Any, body: Body, phase: float, stride: float) -> None:
    size = 1.0 / body.scale
    hips = Vector((0.0, -stride * phase, -0.1 * body.leg + 0.01 * np.cos(4.0 * np.pi * phase)))
    swing = 0.3 * np.sin(2.0 * np.pi * phase)
    for bone in armature.pose.bones:
        bone.matrix_basis = Matrix()
    _turn(armature, _carrier(body), 0.0, hips * size)
    for side, offset in (("L", 0.0), ("R", 0.5)):
        foot = step(body, phase + offset, stride)
        foot = Step(foot.y + offset * stride, foot.z, foot.pitch)
        top = body.leg + body.ankle + hips.z
        way = np.array([foot.y - hips.y, foot.z - top])
        length = min(float(np.hypot(*way)), 0.9999 * body.leg)
        bend = np.arccos(
            (length**2 - body.thigh**2 - body.shin**2) / (2.0 * body.thigh * body.shin)
        )
        # Angle of the way from straight down, towards the back.
        angle = float(np.arctan2(way[0], -way[1]))
        lead = float(np.arctan2(body.shin * np.sin(bend), body.thigh + body.shin * np.cos(bend)))
        thigh, shin = angle - lead, angle - lead + bend
        _turn(armature, f"thigh.{side}", thigh)
        _turn(armature, f"shin.{side}", shin - thigh)
        if body.loose_feet:
            place = Vector((0.0, foot.y, foot.z - body.ankle))
            _turn(armature, f"foot.{side}", foot.pitch, place * size)
        else:
            _turn(armature, f"foot.{side}", foot.pitch - shin)
        if body.toes:
            _turn(armature, f"toe.{side}", -foot.pitch)
        _turn(armature, f"upper_arm.{side}", 0.0, roll=(1.0 if side == "L" else -1.0) * 1.2)
        _turn(armature, f"forearm.{side}", -0.2 - 0.1 * swing)


def _turn(
    armature: Any, name: str, angle: float, move: Vector | None = None, *, roll: float = 0.0
) -> None:
    """Turn a bone about the body's left–right axis, and roll it about the front–back one."""
    bone = armature.pose.bones.get(name)
    if bone is None:
        return
    rest = bone.bone.matrix_local.to_quaternion()
    turn = Quaternion((1.0, 0.0, 0.0), angle) @ Quaternion((0.0, 1.0, 0.0), roll)
    bone.rotation_mode = "QUATERNION"
    bone.rotation_quaternion = rest.inverted() @ turn @ rest
    if move is not None:
        bone.location = rest.inverted() @ move


def stands(frames: np.ndarray, side: str, *, ball: bool) -> np.ndarray:
    """Whether the ankle (or the ball) of a foot stands at these frames, well within its stance."""
    share = ((frames - 1.0) / CYCLE + (0.5 if side == "R" else 0.0)) % 1.0
    first, last = (0.05, LIFTS - 0.05) if ball else (0.05, STANDS - 0.04)
    return (share > first) & (share < last)


def holds(frames: np.ndarray, side: str, *, ball: bool) -> list[np.ndarray]:
    """Rows of the frames of each hold."""
    mask = stands(frames, side, ball=ball)
    edges = np.flatnonzero(np.diff(mask.astype(int))) + 1
    return [rows for rows in np.split(np.arange(len(frames)), edges) if mask[rows[0]]]
