# SPDX-License-Identifier: GPL-3.0-or-later
"""Few Bézier keys in Blender: played back within their bounds, and known when they are edited."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation import actions
from octo_motion.core.keyframes import Limb, Track, reduce_keys
from octo_motion.core.keyframes.channels import Channel
from octo_motion.core.rotations import Floats, angle_between, from_matrix, from_rotation_vector
from tests.blender.test_actions import basis_rotations, channelbag, make_armature, pose_bones

ANGLE = np.radians(0.5)
DISTANCE = 0.01
COUNT = 120
FRAMES = np.arange(1.0, COUNT + 1.0)


def swinging(count: int = COUNT, bones: int = 3) -> Floats:
    """Rotations (frames, bones, 4) with a jolt every now and then."""
    time = np.arange(count)[:, None, None]
    turn = 0.6 * np.sin(time / 9.0 + np.arange(3) + 0.7 * np.arange(bones)[:, None])
    turn = turn + 0.3 * np.abs((time % 40) - 20.0) / 20.0
    return from_rotation_vector(turn)


def places(count: int = COUNT) -> Floats:
    time = np.arange(count) / 20.0
    return np.stack([40.0 + time, np.sin(time), 0.1 * np.abs(np.sin(3.0 * time))], axis=1)


def channels_of(
    obj: bpy.types.Object, *, reduced: bool = True, group: str = "", angle: float = ANGLE
) -> list[Channel]:
    """A travel and three bones, in the rotation modes that the bones have."""
    names = [bone.name for bone in pose_bones(obj)]
    turned = actions.read_channels(obj, names).rotations(names, swinging(bones=len(names)))
    moved = Channel("location", places(), "Object Transforms")
    if not reduced:
        return [moved, *turned]
    modes = [bone.rotation_mode for bone in pose_bones(obj)]
    tracks = [Track(each.values, mode) for each, mode in zip(turned, modes, strict=True)]
    arm, travel = reduce_keys(
        FRAMES,
        [
            Limb(tracks, angle, 1e9),
            Limb([Track(moved.values, "LOCATION")], ANGLE, DISTANCE),
        ],
    )
    return [
        replace(moved, keys=travel[0]),
        *(
            replace(each, keys=keys, group=group or each.group)
            for each, keys in zip(turned, arm, strict=True)
        ),
    ]


def write(obj: bpy.types.Object, previous: Any = None, **options: Any) -> bpy.types.Action:
    return actions.write_action(obj, "Walk", FRAMES, channels_of(obj, **options), previous=previous)


def a_curve(action: bpy.types.Action, path: str = "rotation") -> bpy.types.FCurve:
    # Of the location, the second component is the first that does not run straight on.
    return next(
        each
        for each in channelbag(action).fcurves
        if path in each.data_path and each.array_index == 1
    )


# --- Playing --------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["QUATERNION", "AXIS_ANGLE", "XYZ", "ZXY"])
def test_bones_and_travel_are_within_their_bounds_at_every_frame(mode: str) -> None:
    obj = make_armature()
    for bone in pose_bones(obj):
        bone.rotation_mode = mode
    action = write(obj)
    for frame, turns, place in zip(FRAMES, swinging(), places(), strict=True):
        # What Blender hands out has single precision, as matrices: a hundredth of a bound.
        off = angle_between(from_matrix(basis_rotations(obj, frame)), turns)
        assert off.max() <= 1.01 * ANGLE
        evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
        assert np.linalg.norm(np.array(evaluated.location) - place) <= DISTANCE * 1.001
    assert actions.key_count(action) < COUNT * len(channelbag(action).fcurves) / 3


def test_between_frames_curves_stay_beside_the_dense_motion() -> None:
    obj = make_armature()
    write(obj)
    dense = swinging()
    for frame in np.arange(0, COUNT - 1, 3):
        for part in (0.25, 0.5, 0.75):
            now = from_matrix(basis_rotations(obj, FRAMES[frame] + part))
            nearest = np.minimum(
                angle_between(now, dense[frame]), angle_between(now, dense[frame + 1])
            )
            step = angle_between(dense[frame], dense[frame + 1])
            assert (nearest <= 0.5 * step + 2.0 * ANGLE).all()


def test_handles_are_free_at_corners_and_aligned_elsewhere() -> None:
    obj = make_armature()
    # So tight that there are keys between the jolts.
    channels = channels_of(obj, angle=0.02 * ANGLE)
    action = actions.write_action(obj, "Walk", FRAMES, channels, previous=None)
    kinds = set()
    for channel in channels:
        assert channel.keys is not None
        for curve in channelbag(action).fcurves:
            if curve.data_path != channel.data_path:
                continue
            for key, smooth in zip(curve.keyframe_points, channel.keys.smooth, strict=True):
                assert key.interpolation == "BEZIER"
                kinds.add(key.handle_left_type)
                expected = "ALIGNED" if smooth else "FREE"
                assert (key.handle_left_type, key.handle_right_type) == (expected, expected)
    assert kinds == {"ALIGNED", "FREE"}


# --- Edited or not --------------------------------------------------------------------------------


def test_updated_saved_and_opened_again_they_are_not_edited(tmp_path: Path) -> None:
    obj = make_armature()
    action = write(obj)
    assert not actions.is_edited(action)
    for _ in range(50):
        for curve in channelbag(action).fcurves:
            curve.update()
    assert not actions.is_edited(action)
    file = str(tmp_path / "walk.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    bpy.ops.wm.open_mainfile(filepath=file)
    again = bpy.data.actions[0]
    assert not actions.is_edited(again)
    assert write(bpy.data.objects["Rig"], again) == again


def slide(curve: bpy.types.FCurve) -> None:
    curve.keyframe_points[2].co.y += 1e-4


def turn_handle(curve: bpy.types.FCurve) -> None:
    key = curve.keyframe_points[2]
    key.handle_left.y -= 0.01
    key.handle_right.y += 0.01


def lengthen_handle(curve: bpy.types.FCurve) -> None:
    key = curve.keyframe_points[2]
    key.handle_left = key.co + 0.9 * (key.handle_left - key.co)


def straighten(curve: bpy.types.FCurve) -> None:
    key = curve.keyframe_points[2]
    key.handle_left_type = key.handle_right_type = "VECTOR"


def make_linear(curve: bpy.types.FCurve) -> None:
    for key in curve.keyframe_points:
        key.interpolation = "LINEAR"


def insert(curve: bpy.types.FCurve) -> None:
    curve.keyframe_points.insert(2.5, 0.0)


@pytest.mark.parametrize(
    "edit", [slide, turn_handle, lengthen_handle, straighten, make_linear, insert]
)
@pytest.mark.parametrize("path", ["location", "rotation"])
def test_an_edited_key_or_handle_is_kept(
    edit: Callable[[bpy.types.FCurve], None], path: str
) -> None:
    obj = make_armature()
    action = write(obj)
    curve = a_curve(action, path)
    edit(curve)
    curve.update()
    assert actions.is_edited(action)
    assert write(obj, action) != action


# --- Dense and reduced ----------------------------------------------------------------------------


def test_reduced_and_dense_keys_replace_each_other_in_place() -> None:
    obj = make_armature()
    dense = write(obj, reduced=False)
    before = actions.key_count(dense)
    groups = {group.name for group in channelbag(dense).groups}
    reduced = write(obj, dense, group="Arm")
    assert reduced == dense
    assert actions.key_count(reduced) < before / 3
    assert {group.name for group in channelbag(reduced).groups} == {"Object Transforms", "Arm"}
    again = write(obj, reduced, reduced=False)
    assert again == dense
    assert actions.key_count(again) == before
    assert {group.name for group in channelbag(again).groups} == groups
    assert not actions.is_edited(again)
    for curve in channelbag(again).fcurves:
        assert {key.interpolation for key in curve.keyframe_points} == {"LINEAR"}


def test_where_an_artist_has_put_a_curve_it_stays() -> None:
    obj = make_armature()
    action = write(obj, group="Arm")
    bag = channelbag(action)
    a_curve(action).group = bag.groups.new("Mine")
    assert write(obj, action, group="Arm") == action
    assert {group.name for group in bag.groups} == {"Object Transforms", "Arm", "Mine"}
