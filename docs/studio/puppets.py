# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures that are posed by hand, in pictures: before, while a limb is pulled, and after."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import bpy
import contact_sheet
import numpy as np
import stage
from mathutils import Matrix, Vector
from stage import Colour, Pixels, Points

from octo_motion.core.rotations import from_axis_angle
from octo_motion.ui.posing.puppet_session import PuppetSession

_UP: Final = np.array([0.0, 0.0, 1.0])
_CELL: Final = (300, 260)
_WOOD: Final[Colour] = (0.62, 0.38, 0.18)
_JOINT: Final[Colour] = (0.30, 0.16, 0.07)
_PULL: Final[Colour] = (0.95, 0.32, 0.03)
_TICK: Final = 1.0 / 60.0

_MIDDLE: Final = (
    ("hips", "", (0.0, 0.0, 0.94), (0.0, 0.0, 1.04), 0.105),
    ("spine", "hips", (0.0, 0.0, 1.04), (0.0, 0.0, 1.18), 0.085),
    ("chest", "spine", (0.0, 0.0, 1.18), (0.0, 0.0, 1.42), 0.125),
    ("neck", "chest", (0.0, 0.0, 1.44), (0.0, 0.0, 1.53), 0.04),
    ("head", "neck", (0.0, 0.0, 1.53), (0.0, 0.0, 1.76), 0.095),
)
_SIDE: Final = (
    ("upper_arm", "chest", (0.17, 0.0, 1.38), (0.34, 0.0, 1.16), 0.045),
    ("forearm", "upper_arm", (0.34, 0.0, 1.16), (0.49, -0.02, 0.95), 0.038),
    ("hand", "forearm", (0.49, -0.02, 0.95), (0.57, -0.03, 0.82), 0.035),
    ("thigh", "hips", (0.09, 0.0, 0.92), (0.10, -0.01, 0.50), 0.065),
    ("shin", "thigh", (0.10, -0.01, 0.50), (0.10, 0.01, 0.09), 0.048),
    ("foot", "shin", (0.10, 0.01, 0.09), (0.10, -0.17, 0.04), 0.042),
)
"""Bones of a wooden doll: name, parent, head, tail and radius, metres; the left side."""


@dataclass(frozen=True)
class Pull:
    """A drag: at the end of a bone, by a way in the world, turned about its axis."""

    bone: str
    by: tuple[float, float, float]
    turn: float = 0.0
    """Degrees about the vertical."""
    seconds: float = 0.8


def octopus() -> Pixels:
    """An arm of the octopus is pulled up, then another one bent aside."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.octo_motion.add_octopus()
    figure = bpy.context.object
    assert figure is not None
    figure.octo_motion.posing.material = "CLAY"
    pulls = (
        Pull("arm1.10.L", (0.10, 0.26, 0.34)),
        Pull("arm1.11.R", (-0.22, 0.24, 0.16)),
    )
    return sheet(figure, pulls, np.array([0.25, 0.85, -0.38]))


def doll() -> Pixels:
    """A wooden doll waves, takes a step and looks aside."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    figure = make_doll()
    figure.octo_motion.posing.material = "DOLL"
    pulls = (
        Pull("hand.L", (0.05, -0.15, 0.85), seconds=1.2),
        Pull("shin.R", (-0.02, -0.55, 0.45), seconds=1.2),
        Pull("head", (0.04, -0.06, -0.02), turn=60.0),
    )
    return sheet(figure, pulls, np.array([-0.45, 0.85, -0.16]), shown=2)


def sheet(
    figure: bpy.types.Object,
    pulls: Sequence[Pull],
    forward: Points,
    *,
    shown: int | None = None,
    keyed: Callable[[bpy.types.Object, list[str]], None] | None = None,
) -> Pixels:
    """Before, at the end of each of the first pulls, and after all of them.

    What has got keys then is shown beside by ``keyed``, if that is given.
    """
    figure.show_in_front = False
    scene = stage.the_scene()
    stage.set_light(scene)
    points = [stage.skin_points(figure, [1])]
    pictures = _Cells(figure, forward)
    pictures.take("before")
    session = PuppetSession(figure, scene, clock=None)
    for number, pull in enumerate(pulls):
        start = session.grab_bone(pull.bone, 1.0)
        way = np.array(pull.by)
        count = round(pull.seconds / _TICK)
        hand = start
        for tick in range(1, count + 1):
            share = tick / count
            hand = start + share * way
            turn = from_axis_angle(_UP, np.radians(share * pull.turn))
            session.tick(_TICK, hand, turn)
        if shown is None or number < shown:
            held = session.held_point()
            assert held is not None
            # From where the limb was: the drag's whole way.
            pictures.take("pulled", arrow=(start, hand))
        session.release()
        for _ in range(30):
            session.tick(_TICK)
    names = [] if keyed is None else session.key()
    session.finish()
    bpy.context.view_layer.update()
    points.append(stage.skin_points(figure, [1]))
    pictures.take("let go")
    if keyed is not None:
        pictures.take("keyed", beside=lambda: keyed(figure, names))
    return pictures.rendered(np.concatenate([each.reshape(-1, 3) for each in points]))


class _Cells:
    """Moments of one figure, kept as copies, and rendered with one camera."""

    def __init__(self, figure: bpy.types.Object, forward: Points) -> None:
        self._figure = figure
        self._forward = forward
        self._moments: list[tuple[str, list[bpy.types.Object]]] = []
        self._points: list[Points] = []

    def take(
        self,
        note: str,
        arrow: tuple[Points, Points] | None = None,
        beside: Callable[[], None] = lambda: None,
    ) -> None:
        """Keep how the figure stands now, and what is made beside it."""
        bpy.context.view_layer.update()
        before = set(bpy.data.objects)
        stage.leave_copy(self._figure)
        if arrow is not None:
            _arrow(*arrow)
            self._points.append(np.stack(arrow))
        beside()
        made = [each for each in bpy.data.objects if each not in before]
        for each in made:
            each.hide_render = True
        self._moments.append((note, made))

    def rendered(self, points: Points) -> Pixels:
        """All moments side by side."""
        for child in self._figure.children:
            child.hide_render = True
        everything = np.concatenate([points, *self._points])
        stage.add_ground(everything, min(0.0, float(points[:, 2].min())))
        camera = stage.add_camera("Camera", lens=60.0)
        stage.set_resolution(*_CELL)
        stage.look(camera, self._forward, _UP)
        stage.frame_points(camera, everything, margin=0.02)
        pictures = []
        for note, made in self._moments:
            for each in made:
                each.hide_render = False
            pictures.append(stage.render_pixels(*_CELL, note=note))
            for each in made:
                each.hide_render = True
        return contact_sheet.joined([pictures])


def _arrow(start: Points, end: Points) -> None:
    """From where a limb was taken to where it was pulled."""
    way = Vector((end - start).tolist())
    length = way.length
    outline = [
        (0.0, 0.0),
        (0.008, 0.0),
        (0.008, length - 0.09),
        (0.03, length - 0.09),
        (0.0, length),
    ]
    arrow = _turned("Arrow", outline, _PULL)
    arrow.matrix_world = (
        Matrix.Translation(start.tolist()) @ way.to_track_quat("Z", "Y").to_matrix().to_4x4()
    )


Limb = tuple[str, str, tuple[float, float, float], tuple[float, float, float], float]
"""A bone: name, parent, head, tail and radius, metres."""


def make_doll(more: Sequence[Limb] = ()) -> bpy.types.Object:
    """An armature whose bones carry stiff parts of wood; with more bones, if there are any."""
    figure = bpy.data.objects.new("Doll", bpy.data.armatures.new("Doll"))
    stage.the_scene().collection.objects.link(figure)
    bpy.context.view_layer.objects.active = figure
    bpy.ops.object.mode_set(mode="EDIT")
    assert isinstance(figure.data, bpy.types.Armature)
    bones = figure.data.edit_bones
    thick: dict[str, float] = {}
    for name, parent, head, tail, radius in (*_MIDDLE, *more):
        bone = bones.new(name)
        bone.head, bone.tail = Vector(head), Vector(tail)
        bone.parent = bones.get(parent)
        thick[name] = radius
    for side, sign in (("L", 1.0), ("R", -1.0)):
        for name, parent, head, tail, radius in _SIDE:
            bone = bones.new(f"{name}.{side}")
            bone.head = Vector((sign * head[0], head[1], head[2]))
            bone.tail = Vector((sign * tail[0], tail[1], tail[2]))
            bone.parent = bones.get(f"{parent}.{side}") or bones[parent]
            thick[bone.name] = radius
    bpy.ops.object.mode_set(mode="OBJECT")
    for side in "LR":
        _hinge(figure, f"shin.{side}", 150.0)
    dress(figure, thick)
    return figure


def dress(figure: bpy.types.Object, thick: Mapping[str, float]) -> None:
    """Let bones carry stiff parts of wood, so thick by name."""
    assert isinstance(figure.data, bpy.types.Armature)
    for name, radius in thick.items():
        bone = figure.data.bones[name]
        for part, colour in _parts(bone.length, radius):
            made = _turned(name, part, colour)
            made.parent, made.parent_type, made.parent_bone = figure, "BONE", name
            # Parts hang on a bone's tail, and bones point along their Y.
            made.matrix_parent_inverse = Matrix.Translation((0.0, -bone.length, 0.0))
            made.matrix_basis = Matrix.Rotation(-0.5 * np.pi, 4, "X")
    bpy.context.view_layer.update()


def _hinge(figure: bpy.types.Object, name: str, opens: float) -> None:
    """Let a joint bend backwards by so many degrees, and no other way."""
    assert figure.pose is not None
    bone = figure.pose.bones[name]
    axes = np.array(bone.bone.matrix_local)[:3, :3]
    # The axis of the bone that lies across the figure, and which way round.
    across = max("xz", key=lambda axis: abs(axes[0, "xyz".index(axis)]))
    end = np.radians(opens) * np.sign(axes[0, "xyz".index(across)])
    for axis in "xyz":
        setattr(bone, f"lock_ik_{axis}", axis != across)
    setattr(bone, f"use_ik_limit_{across}", True)
    setattr(bone, f"ik_min_{across}", min(end, 0.0))
    setattr(bone, f"ik_max_{across}", max(end, 0.0))


def _parts(length: float, radius: float) -> list[tuple[list[tuple[float, float]], Colour]]:
    """Outlines (distance from the axis, height) of a limb, and of the ball at its joint."""
    steps = np.linspace(0.0, np.pi, 13)
    middle, half = 0.5 * length, 0.5 * length
    # Fuller than an ellipse, as turned wood is.
    limb = [(radius * np.sin(each) ** 0.6, middle - half * np.cos(each)) for each in steps.tolist()]
    size = min(0.62 * radius, 0.045)
    ball = [(size * np.sin(each), -size * np.cos(each)) for each in steps.tolist()]
    return [(limb, _WOOD), (ball, _JOINT)]


def _turned(name: str, outline: Sequence[tuple[float, float]], colour: Colour) -> bpy.types.Object:
    """A body of revolution about Z."""
    sides = 24
    angles = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    radius, height = np.array(outline).T
    points = np.stack(
        [
            radius[:, None] * np.cos(angles),
            radius[:, None] * np.sin(angles),
            np.broadcast_to(height[:, None], (len(outline), sides)),
        ],
        axis=-1,
    )
    faces = [
        (
            row * sides + at,
            row * sides + (at + 1) % sides,
            (row + 1) * sides + (at + 1) % sides,
            (row + 1) * sides + at,
        )
        for row in range(len(outline) - 1)
        for at in range(sides)
    ]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.reshape(-1, 3).tolist(), [], faces)
    mesh.shade_smooth()
    mesh.materials.append(stage.new_material(name, colour, roughness=0.6))
    made = bpy.data.objects.new(name, mesh)
    stage.the_scene().collection.objects.link(made)
    return made
