# SPDX-License-Identifier: GPL-3.0-or-later
"""An artist's keys over a generated motion stay, in their cycles, when it is made anew."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Quaternion

from tests.ui.rig import Octopus, click, generate, give_route, joints_in_world

WAY = ((0.0, 0.0, 0.0), (0.0, -0.8, 0.0), (0.0, -1.2, 0.0), (0.3, -1.6, 0.0))
LONGER = ((0.0, 0.0, 0.0), (0.0, -1.2, 0.0), (0.0, -1.8, 0.0), (0.3, -3.2, 0.0))
OCTOPUS = Octopus(route=WAY, settings={"tell_overlaps": False, "keep_apart": False})
BONE = "Arm1_4.L"
FRAMES = (5, 20, 33)


def played(armature: Any) -> np.ndarray:
    return np.array([joints_in_world(armature, float(frame)) for frame in FRAMES])


def keyed(armature: Any, frame: int) -> None:
    """A bend of half a radian at a frame, none ten frames before and after."""
    bone = armature.pose.bones[BONE]
    path = bone.path_from_id("rotation_quaternion")
    layer = armature.animation_data.action
    for at, angle in ((frame - 10, 0.0), (frame, 0.5), (frame + 10, 0.0)):
        for index, value in enumerate(Quaternion((1.0, 0.0, 0.0), angle)[:]):
            curve = layer.fcurve_ensure_for_datablock(armature, path, index=index)
            curve.keyframe_points.insert(at, value)
            curve.update()


def bent(armature: Any, motion: Any, frame: int) -> float:
    """Radians between what is played and what the motion has at a frame."""
    bpy.context.scene.frame_set(frame)
    path = armature.pose.bones[BONE].path_from_id("rotation_quaternion")
    curves = {
        each.array_index: each.evaluate(frame)
        for each in motion.layers[0].strips[0].channelbags[0].fcurves
        if each.data_path == path
    }
    own = Quaternion([curves[index] for index in range(4)]).normalized()
    return own.rotation_difference(armature.pose.bones[BONE].rotation_quaternion).angle


def test_one_click_changes_nothing_that_plays(octopus: Any) -> None:
    motion = generate(octopus)
    before = played(octopus)
    click("edit_on_top")
    data = octopus.animation_data
    assert data.action != motion
    (track,) = data.nla_tracks
    assert [strip.action for strip in track.strips] == [motion]
    np.testing.assert_allclose(played(octopus), before, atol=1e-5)
    # Again, nothing more happens.
    click("edit_on_top")
    assert len(data.nla_tracks) == 1


def test_edits_stay_when_the_motion_is_made_anew(octopus: Any) -> None:
    motion = generate(octopus)
    click("edit_on_top")
    layer = octopus.animation_data.action
    keyed(octopus, 30)
    assert bent(octopus, motion, 30) == pytest.approx(0.5, abs=1e-3)
    octopus.octo_motion.locomotion.softness = 0.0
    assert generate(octopus) == layer
    data = octopus.animation_data
    assert octopus.octo_motion.locomotion.result == motion
    assert [each.action for track in data.nla_tracks for each in track.strips] == [motion]
    assert bent(octopus, motion, 30) == pytest.approx(0.5, abs=1e-3)
    assert bent(octopus, motion, 15) == pytest.approx(0.0, abs=1e-3)
    # As it would be without a layer.
    layer.slots[0].name_display = "Edits"
    with_layer = np.array([joints_in_world(octopus, 10.0), joints_in_world(octopus, 45.0)])
    data.action = None
    plain = np.array([joints_in_world(octopus, 10.0), joints_in_world(octopus, 45.0)])
    np.testing.assert_allclose(with_layer, plain, atol=1e-5)


def test_edits_go_with_their_cycles_and_strips_with_the_motion(octopus: Any) -> None:
    settings = octopus.octo_motion.locomotion
    settings.ground.come_to_rest = settings.ground.start_at_rest = False
    settings.ease_in = settings.ease_out = 0.0
    motion = generate(octopus)
    click("edit_on_top")
    keyed(octopus, 40)
    # Half as fast: each cycle takes twice as long.
    settings.cycle_time *= 2.0
    generate(octopus)
    assert bent(octopus, motion, 79) == pytest.approx(0.5, abs=0.05)
    (strip,) = octopus.animation_data.nla_tracks[0].strips
    assert (strip.frame_start, strip.frame_end) == pytest.approx(tuple(motion.frame_range))
    give_route(octopus, LONGER)
    generate(octopus)
    # The cycle that it is in is where it was.
    assert bent(octopus, motion, 79) == pytest.approx(0.5, abs=0.05)
    assert strip.frame_end == pytest.approx(motion.frame_range[1])


def test_without_a_motion_there_is_nothing_to_edit(octopus: Any) -> None:
    with pytest.raises(RuntimeError, match="has no generated motion"):
        click("edit_on_top")
    generate(octopus)
    octopus.animation_data.action = bpy.data.actions.new("Mine")
    with pytest.raises(RuntimeError, match="plays 'Mine'"):
        click("edit_on_top")
