# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading a scene at other frames leaves it as it was found, with all that nobody has keyed yet."""

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.scene_playback import shown_poses, time_kept
from octo_motion.blender.scene.grasp_target import read_places
from tests.ui.rig import make_octopus


def moving(name: str = "Cube") -> Any:
    """A mesh with a shape, keyed at frames 1 and 20 in several kinds of properties."""
    mesh: Any = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    item: Any = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    item.shape_key_add(name="Basis")
    item.shape_key_add(name="Bent.up")
    item["mood"] = 1.0
    item.color = (1.0, 1.0, 1.0, 1.0)
    for frame, value in ((1, 0.0), (20, 1.0)):
        item.location, item["mood"], item.color = (value, 0, 0), value, (value, 0, 0, 1)
        bent = mesh.shape_keys.key_blocks["Bent.up"]
        bent.value = value
        item.keyframe_insert("location", frame=frame)
        item.keyframe_insert('["mood"]', frame=frame)
        item.keyframe_insert("color", index=0, frame=frame)
        bent.keyframe_insert("value", frame=frame)
    bpy.context.scene.frame_set(7, subframe=0.5)
    return item


def by_hand(item: Any) -> Callable[[], tuple[Any, ...]]:
    """Set all of it by hand, without keys, and tell how to look at it."""
    item.location, item["mood"], item.color = (5.0, 6.0, 7.0), 8.0, (0.5, 0.25, 0.125, 1.0)
    shapes = item.data.shape_keys.key_blocks
    shapes["Bent.up"].value = 0.875

    def state() -> tuple[Any, ...]:
        scene = bpy.context.scene
        return (
            *(scene.frame_current, scene.frame_subframe, item["mood"]),
            *(tuple(item.location), tuple(item.color), shapes["Bent.up"].value),
        )

    return state


@pytest.mark.parametrize("frames", [(1.0, 10.5, 20.0), (1.0, 20.0, 7.5)])
def test_what_was_set_by_hand_is_still_there_after_the_scene_was_read(
    frames: tuple[float, ...],
) -> None:
    """Also if the last frame that is read is the scene's own."""
    prey = moving("Prey")
    state = by_hand(moving())
    before = state()
    places, _ = read_places(prey, np.array(frames))
    assert places[0, 0] == pytest.approx(0.0, abs=1e-6)
    assert np.ptp(places[:, 0]) == pytest.approx(1.0, abs=1e-6)
    assert state() == before


def test_a_pose_of_another_armature_survives_as_well() -> None:
    bones = {}
    for name in ("First", "Second"):
        bone = make_octopus(name).pose.bones[0]
        for frame, turn in ((1, 0.0), (20, 0.5)):
            bone.rotation_quaternion = (1.0, turn, 0.0, 0.0)
            bone.keyframe_insert("rotation_quaternion", frame=frame)
        bones[name] = bone
    bpy.context.scene.frame_set(5)
    for bone in bones.values():
        bone.rotation_quaternion = (0.5, 0.5, 0.5, 0.5)
    shown_poses(bpy.data.objects["First"], np.array([1.0, 2.0]))
    for bone in bones.values():
        assert tuple(bone.rotation_quaternion) == (0.5, 0.5, 0.5, 0.5)


def test_a_scene_is_given_back_after_a_failure() -> None:
    state = by_hand(moving())
    before = state()

    def fail() -> None:
        with time_kept(bpy.context.scene) as go_to:
            go_to(13.25)
            assert state() != before
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert state() == before


def test_curves_of_what_is_no_longer_there_do_no_harm() -> None:
    item = moving()
    del item["mood"]
    item.location = (5.0, 6.0, 7.0)
    with time_kept(bpy.context.scene) as go_to:
        go_to(1.0)
    assert tuple(item.location) == (5.0, 6.0, 7.0)
