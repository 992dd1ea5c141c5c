# SPDX-License-Identifier: GPL-3.0-or-later
"""What the pictures of Blender's own window show."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

import bpy
import experiment
import numpy as np
import stage
from mathutils import Euler, Quaternion
from screen import Screen
from stage import Pixels, Points

Taking = Generator[float, None, Pixels]


def panel() -> Taking:
    """A walking octopus, and all panels that it takes to make it walk."""
    screen = Screen(1200)
    opened = ("rig", "arms", "route", "ground", "gait", "generate", "quality")
    yield from screen.open(opened)
    octopus = _add_octopus(screen)
    with screen.override():
        bpy.ops.octo_motion.add_route()
        _select(octopus)
        bpy.ops.octo_motion.generate_locomotion()
    stage.the_scene().frame_set(128)
    octopus.show_in_front = False
    yield from screen.look(_turned(66.0, 43.0), _skin(octopus), margin=0.08)
    return (yield from screen.take())


def gait_table() -> Taking:
    """The walk's angles, to be edited."""
    screen = Screen(640)
    yield from screen.open(("gait", "table"), present=("gait", "table"))
    _add_octopus(screen)
    with screen.override():
        bpy.ops.octo_motion.gait_load()
    return (yield from screen.take_panels())


def targets() -> Taking:
    """What the swim has an arm reach for, beside the table that says so."""
    screen = Screen(940, 620)
    yield from screen.open(("gait", "table"), present=("gait", "table"))
    octopus = _add_octopus(screen)
    settings = octopus.octo_motion.locomotion
    with screen.override():
        bpy.ops.octo_motion.detect_arms()
        bpy.ops.octo_motion.setup_load(name="swim")
        bpy.ops.octo_motion.add_route()
        _select(octopus)
        bpy.ops.octo_motion.generate_locomotion()
        bpy.ops.octo_motion.gait_load()
    settings.route.hide_set(state=True)
    settings.active_arm, settings.show_targets = 1, True
    octopus.show_in_front = False
    stage.the_scene().frame_set(90)
    yield from screen.look(_turned(70.0, 70.0), _skin(octopus), margin=0.08)
    return (yield from screen.take())


def splicing() -> Taking:
    """Two arms of other clips on a walk."""
    screen = Screen(940)
    yield from screen.open(("splicing", "splice", "splice_timing"))
    clips = experiment.find_clips(experiment.CLIPS)
    walker, *others = [_imported(path) for path in (clips.walk, clips.right, clips.left)]
    _select(walker)
    for part, source in zip(("RIGHT_ARM", "LEFT_ARM"), others, strict=True):
        bpy.ops.octo_motion.splice_add(part=part, source=source.name)
        source.hide_set(state=True)
    walker.octo_motion.splicing.splices[1].base_start = 10.0
    bpy.ops.octo_motion.splice_build()
    # The one arm is behind the head, and the other one stretched.
    stage.the_scene().frame_set(27)
    yield from screen.look(_turned(80.0, -40.0), _bones(walker))
    return (yield from screen.take())


def posing() -> Taking:
    """An arm of the octopus is pulled up with the mouse."""
    screen = Screen(940, 530)
    yield from screen.open(("posing",))
    octopus = _add_octopus(screen)
    octopus.octo_motion.tool = "POSE"
    yield from screen.look(_turned(66.0, 25.0), _skin(octopus), margin=0.1)
    with screen.override():
        bpy.ops.octo_motion.pose_start("INVOKE_DEFAULT")
    tip = octopus.matrix_world @ octopus.pose.bones["arm2.10.R"].center
    start = screen.pixels_of(np.array([tip]))[0]
    yield from screen.drag(start, start + np.array([50.0, 212.0]))
    pixels = yield from screen.take()
    yield from screen.press("ESC")
    return pixels


def _add_octopus(screen: Screen) -> Any:
    with screen.override():
        bpy.ops.octo_motion.add_octopus()
    return bpy.context.view_layer.objects.active


def _imported(path: Any) -> Any:
    bpy.ops.octo_motion.import_clips(filepath=str(path), fit="NONE", frame_view=False)
    return bpy.context.view_layer.objects.active


def _select(chosen: Any) -> None:
    for each in bpy.data.objects:
        each.select_set(each == chosen)
    bpy.context.view_layer.objects.active = chosen


def _skin(armature: Any) -> Points:
    return stage.skin_points(armature, [stage.the_scene().frame_current]).reshape(-1, 3)


def _bones(armature: Any) -> Points:
    ends = [end for bone in armature.pose.bones for end in (bone.head, bone.tail)]
    return np.array([armature.matrix_world @ each for each in ends], dtype=np.float64)


def _turned(down: float, about: float) -> Quaternion:
    """A view: degrees from looking straight down, and about the vertical."""
    return Euler((np.radians(down), 0.0, np.radians(about))).to_quaternion()
