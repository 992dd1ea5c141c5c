# SPDX-License-Identifier: GPL-3.0-or-later
"""Imported clips are as tall as people, stand side by side, and are in sight."""

from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.scene import ImportedClip, place_clip
from tests.ui.rig import click, joints_in_world, keys

Data = Callable[[str], Path]

pytestmark = [
    pytest.mark.one_blender,
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

BODY: dict[str, tuple[str, tuple[float, float, float]]] = {
    # joint: parent, offset from it; a person of 100 units, whose ankles are 4 above the ground
    "Hips": ("", (0.0, 52.0, 0.0)),
    "Spine": ("Hips", (0.0, 8.0, 0.0)),
    "Chest": ("Spine", (0.0, 10.0, 0.0)),
    "Neck": ("Chest", (0.0, 14.0, 0.0)),
    "Head": ("Neck", (0.0, 8.0, 0.0)),
    **{
        f"{side}{joint}": (parent if parent in {"Hips", "Chest"} else f"{side}{parent}", offset)
        for side, sign in (("Left", 1.0), ("Right", -1.0))
        for joint, parent, offset in (
            ("Arm", "Chest", (sign * 10.0, 12.0, 0.0)),
            ("ForeArm", "Arm", (sign * 16.0, 0.0, 0.0)),
            ("Hand", "ForeArm", (sign * 14.0, 0.0, 0.0)),
            ("UpLeg", "Hips", (sign * 5.0, 0.0, 0.0)),
            ("Leg", "UpLeg", (0.0, -24.0, 0.0)),
            ("Foot", "Leg", (0.0, -24.0, 0.0)),
            ("Toe", "Foot", (0.0, -4.0, 8.0)),
        )
    },
}
ENDS = {"Head": (0.0, 8.0, 0.0), "Hand": (0.0, 0.0, 3.0), "Toe": (0.0, 0.0, 3.0)}
FRAMES = 21


def write_bvh(
    path: Path,
    turns: Mapping[str, tuple[float, float, float]],
    *,
    scale: float = 1.0,
    way: tuple[float, float, float] = (0.0, 0.0, 0.0),
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Path:
    """A clip in which joints turn further and further, up to these angles (Z, X, Y in degrees),
    while the hips go a way; at its start they are so far off their place.
    """
    lines, order = ["HIERARCHY"], list[str]()

    def joint(name: str, depth: int) -> None:
        parent, offset = BODY[name]
        order.append(name)
        numbers = " ".join(f"{scale * each:.6f}" for each in (offset if parent else (0, 0, 0)))
        moves = "6 Xposition Yposition Zposition" if not parent else "3"
        lines.extend((f"{'JOINT' if parent else 'ROOT'} {name}", "{", f"OFFSET {numbers}"))
        lines.append(f"CHANNELS {moves} Zrotation Xrotation Yrotation")
        children = [each for each, (above, _) in BODY.items() if above == name]
        for each in children:
            joint(each, depth + 1)
        if not children:
            end = next(value for part, value in ENDS.items() if name.endswith(part))
            numbers = " ".join(f"{scale * each:.6f}" for each in end)
            lines.extend(("End Site", "{", f"OFFSET {numbers}", "}"))
        lines.append("}")

    joint("Hips", 0)
    lines += ["MOTION", f"Frames: {FRAMES}", "Frame Time: 0.0416666667"]
    for share in np.linspace(0.0, 1.0, FRAMES):
        place = np.array(BODY["Hips"][1]) + np.array(start) + share * np.array(way)
        row = [*(scale * place), *(share * angle for angle in turns.get("Hips", (0, 0, 0)))]
        for name in order[1:]:
            row += [share * angle for angle in turns.get(name, (0, 0, 0))]
        lines.append(" ".join(f"{each:.6f}" for each in row))
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return path


WALK = {"LeftUpLeg": (0.0, -25.0, 0.0), "RightUpLeg": (0.0, 20.0, 0.0)}
WAVE = {"RightArm": (-60.0, 0.0, 0.0), "RightForeArm": (-40.0, 10.0, 0.0)}
SIT = {
    **{f"{side}UpLeg": (0.0, -90.0, 0.0) for side in ("Left", "Right")},
    **{f"{side}Leg": (0.0, 90.0, 0.0) for side in ("Left", "Right")},
}


def import_all(*paths: Path, **options: Any) -> list[Any]:
    """Armatures of files, in their order."""
    files = [{"name": each.name} for each in paths]
    before = set(bpy.data.objects)
    click("import_clips", directory=str(paths[0].parent), files=files, **options)
    made = [each for each in bpy.data.objects if each not in before and each.type == "ARMATURE"]
    return [next(each for each in made if each.name.startswith(path.stem)) for path in paths]


def joint_of(armature: Any, bone: str, frame: float = 1.0) -> np.ndarray:
    number = armature.data.bones.find(bone)
    return joints_in_world(armature, frame)[number, 0]


def height(armature: Any, foot: str = "LeftFoot", head: str = "Head") -> float:
    """What an upright body's height is, told by its ankle and its head's joint at the start."""
    return float(joint_of(armature, head)[2] - joint_of(armature, foot)[2]) / 0.88


# --- As tall as a person, or as the one that is there ---------------------------------------------


@pytest.mark.parametrize("scale", [0.01, 0.16, 1.72, 100.0])
def test_a_body_of_any_units_comes_as_tall_as_a_person(scale: float, tmp_path: Path) -> None:
    (body,) = import_all(write_bvh(tmp_path / "walk.bvh", WALK, scale=scale))
    assert height(body) == pytest.approx(1.7, rel=1e-4)
    points = joints_in_world(body, 1.0)
    assert np.ptp(points[..., 2]) == pytest.approx(1.7, rel=0.02)
    # It stands as it stood: upright, with its face to −Y.
    assert joint_of(body, "LeftToe")[1] < joint_of(body, "LeftFoot")[1] - 0.1


def test_bodies_that_sit_or_bow_get_the_size_of_those_that_stand(tmp_path: Path) -> None:
    bow = {"Hips": (0.0, 90.0, 0.0)}
    clips = (("walk", WALK), ("sit", SIT), ("bow", bow))
    paths = [write_bvh(tmp_path / f"{name}.bvh", turns, scale=3.0) for name, turns in clips]
    scales = [tuple(each.scale) for each in import_all(*paths)]
    assert scales[0] == pytest.approx(scales[1], rel=1e-6)
    assert scales[0] == pytest.approx(scales[2], rel=1e-6)


def test_keys_stay_as_the_file_has_them(tmp_path: Path) -> None:
    path = write_bvh(tmp_path / "walk.bvh", WALK, scale=20.0, way=(0, 0, 40))
    (fitted,) = import_all(path)
    (own,) = import_all(path, fit="NONE")
    assert tuple(own.scale) == (1.0, 1.0, 1.0)
    ours, theirs = (keys(each.animation_data.action) for each in (fitted, own))
    assert ours.keys() == theirs.keys()
    for each in ours:
        np.testing.assert_array_equal(ours[each], theirs[each])


def test_a_clip_gets_the_height_of_the_active_armature_or_of_a_body_that_is_there(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = write_bvh(tmp_path / "walk.bvh", WALK, scale=5.0)
    (hero,) = import_all(path, height=2.2)
    assert height(hero) == pytest.approx(2.2, rel=1e-4)
    hero.name = "Hero"
    import_all(path, height=1.1)
    bpy.context.view_layer.objects.active = hero
    capfd.readouterr()
    (one,) = import_all(path)
    assert "the height that 'Hero' has: 2.2 m" in capfd.readouterr().out
    assert height(one) == pytest.approx(2.2, rel=1e-4)

    bpy.ops.mesh.primitive_cube_add()
    for each in [each for each in bpy.data.objects if each.type == "ARMATURE" and each != hero]:
        bpy.data.objects.remove(each)
    (other,) = import_all(path)
    assert height(other) == pytest.approx(2.2, rel=1e-4)
    (asked,) = import_all(path, height=0.5)
    assert height(asked) == pytest.approx(0.5, rel=1e-4)


def test_a_person_is_as_tall_in_a_scene_of_other_units(tmp_path: Path) -> None:
    bpy.context.scene.unit_settings.scale_length = 0.01
    (body,) = import_all(write_bvh(tmp_path / "walk.bvh", WALK))
    assert height(body) == pytest.approx(170.0, rel=1e-4)


SNAKE = """HIERARCHY
ROOT a
{
OFFSET 0 0 0
CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
JOINT b
{
OFFSET 0 0 30
CHANNELS 3 Zrotation Xrotation Yrotation
End Site
{
OFFSET 0 0 20
}
}
}
MOTION
Frames: 2
Frame Time: 0.04
0 0 0 0 0 0 0 0 0
0 0 5 0 0 0 0 0 40
"""


def test_what_is_no_humanoid_keeps_its_size_unless_it_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "snake.bvh"
    path.write_text(SNAKE, encoding="utf-8")
    (own,) = import_all(path, height=2.0)
    assert tuple(own.scale) == (1.0, 1.0, 1.0)
    (fitted,) = import_all(path, height=2.0, fit="ALL")
    assert np.ptp(joints_in_world(fitted, 1.0)[..., 1]) == pytest.approx(2.0, rel=1e-5)


def test_bvh_fbx_and_gltf_of_one_motion_come_as_tall_as_each_other(shared_data: Data) -> None:
    """Whatever scale and axes the formats give the armature object."""
    bodies = [
        *import_all(shared_data("secondlife/avatar_walk.bvh"), side_by_side=False),
        *import_all(shared_data("derived_fbx_gltf/sl_walk.fbx"), side_by_side=False, height=1.7),
    ]
    # Files of one name each.
    click("import_clips", filepath=str(shared_data("derived_fbx_gltf/sl_walk.glb")), height=1.7)
    bodies.append(bpy.context.object)
    for frame in (1.0, 10.0, 20.5):
        expected = {name: joint_of(bodies[0], name, frame) for name in ("head", "lHand", "rFoot")}
        for each in bodies[1:]:
            for name, place in expected.items():
                np.testing.assert_allclose(joint_of(each, name, frame), place, atol=2e-3)


def test_clips_of_real_skeletons_come_as_tall_as_each_other(shared_data: Data) -> None:
    names = {
        "secondlife/avatar_walk.bvh": ("lFoot", "rFoot", "head"),
        "cmu/12_01_walk.bvh": ("LeftFoot", "RightFoot", "Head"),
        "cmu/02_02_walk_daz43.bvh": ("lFoot", "rFoot", "head"),
        "misc/walk01.bvh": ("LeftFoot", "RightFoot", "Head"),
        "animated_drawings/fair1_dab.bvh": ("LeftFoot", "RightFoot", "Head"),
    }
    heights = []
    for name, (left, right, head) in names.items():
        (body,) = import_all(shared_data(name), height=1.7)
        first, last = body.animation_data.action.frame_range
        frames = np.linspace(first, last, 20)
        tall = []
        for frame in frames:
            top = joint_of(body, head, frame)[2]
            tall += [(top - joint_of(body, foot, frame)[2]) / 0.88 for foot in (left, right)]
        heights.append(max(tall))
    assert heights == pytest.approx([1.7] * len(names), rel=0.08)


# --- A splice does not mind -----------------------------------------------------------------------


def spliced(folder: Path, part: str, **options: Any) -> np.ndarray:
    """Joints of a walk with a part of another clip, (frames, bones, 3), seen from the walk's
    armature.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    walk, wave = import_all(folder / "walk.bvh", folder / "wave.bvh", **options)
    for each in bpy.data.objects:
        each.select_set(each in {walk, wave})
    bpy.context.view_layer.objects.active = walk
    bpy.ops.octo_motion.splice_add(part=part)
    if part == "LEGS":
        walk.octo_motion.splicing.splices[0].with_travel = True
    assert bpy.ops.octo_motion.splice_build() == {"FINISHED"}
    back = np.linalg.inv(np.array(walk.matrix_world))
    joints = np.array([joints_in_world(walk, frame)[:, 0] for frame in (1.0, 7.5, 14.0, 21.0)])
    return joints @ back[:3, :3].T + back[:3, 3]


@pytest.mark.parametrize("part", ["RIGHT_ARM", "TRUNK", "LEGS"])
def test_splices_are_the_same_whatever_size_and_place_clips_have(part: str, tmp_path: Path) -> None:
    write_bvh(tmp_path / "walk.bvh", WALK, scale=0.7, way=(10, 0, 60))
    write_bvh(tmp_path / "wave.bvh", WAVE | SIT, scale=30.0, way=(0, -5, 20), start=(40, 0, 30))
    own = spliced(tmp_path, part, fit="NONE", side_by_side=False)
    fitted = spliced(tmp_path, part)
    # Of a body of 70 units, keys in single precision.
    np.testing.assert_allclose(fitted, own, atol=70.0 * 2e-5)


# --- Side by side ---------------------------------------------------------------------------------


def box(armature: Any) -> np.ndarray:
    """Least and most of all joints and ends over the whole clip, (2, 3)."""
    points = [joints_in_world(armature, frame) for frame in range(1, FRAMES + 1)]
    flat = np.array(points).reshape(-1, 3)
    return np.array([flat.min(axis=0), flat.max(axis=0)])


def three(folder: Path) -> list[Path]:
    """Of many units, each from another place, one through the ground and one above it."""
    return [
        write_bvh(folder / "walk.bvh", WALK, scale=0.3, way=(80, 0, 160), start=(0, -52, 0)),
        write_bvh(folder / "wave.bvh", WAVE, scale=40.0, start=(300, 70, -20)),
        write_bvh(folder / "sit.bvh", SIT, way=(0, -24, -20), start=(-90, 0, 400)),
    ]


def test_several_clips_stand_in_a_row_and_never_in_one_another(tmp_path: Path) -> None:
    bodies = import_all(*three(tmp_path))
    boxes = [box(each) for each in bodies]
    for before, after in pairwise(boxes):
        # Beside each other on all of their ways, with some room between, but not far.
        assert 0.2 < after[0, 0] - before[1, 0] < 1.0
    for body, each in zip(bodies, boxes, strict=True):
        assert abs(each[0, 2]) < 0.05 * 1.7
        assert abs(joint_of(body, "Hips")[1]) < 0.2
        assert height(body) == pytest.approx(1.7, rel=1e-4)
    assert abs(joint_of(bodies[0], "Hips")[0]) < 0.1


def test_what_is_large_moves_its_neighbours_apart_and_no_others(tmp_path: Path) -> None:
    paths = [write_bvh(tmp_path / f"{name}.bvh", WAVE) for name in ("walk", "wave")]
    snake = tmp_path / "snake.bvh"
    snake.write_text(SNAKE.replace("OFFSET 0 0 30", "OFFSET 0 90 0"), encoding="utf-8")
    one, other, large = import_all(*paths, snake)
    assert np.ptp(joints_in_world(large, 1.0)[..., 2]) > 50.0
    assert 0.2 < box(other)[0, 0] - box(one)[1, 0] < 1.0
    assert box(large)[0, 0] - box(other)[1, 0] > 10.0


def test_a_file_with_its_own_ground_keeps_it(tmp_path: Path) -> None:
    """Its lowest joint is a little off the ground, where its sole is."""
    paths = [
        write_bvh(tmp_path / f"{name}.bvh", turns, start=(0, up, 0))
        for name, turns, up in (("walk", {}, 2.0), ("wave", WAVE, -3.0))
    ]
    one, other = import_all(*paths)
    assert box(one)[0, 2] == pytest.approx(0.02 * 1.7, abs=1e-3)
    assert box(other)[0, 2] == pytest.approx(-0.03 * 1.7, abs=1e-3)


def test_clips_stay_where_their_files_have_them_if_asked_and_alone(tmp_path: Path) -> None:
    one, two, _ = import_all(*three(tmp_path), side_by_side=False)
    (alone,) = import_all(tmp_path / "wave.bvh")
    assert all(tuple(each.location) == (0.0, 0.0, 0.0) for each in (one, two, alone))


def test_undo_takes_all_of_them_back(tmp_path: Path) -> None:
    paths = three(tmp_path)
    bpy.ops.ed.undo_push(message="before")
    import_all(*paths)
    bpy.ops.ed.undo()
    assert len(bpy.data.objects) == len(bpy.data.actions) == 0


def test_a_body_that_is_moved_by_keys_of_its_object_is_carried() -> None:
    """Joints are twice as far from the origin, and moved, between frames too."""
    bpy.ops.object.armature_add()
    armature: Any = bpy.context.object
    armature.rotation_euler.x = 0.5
    for frame, x in ((1, 0.0), (11, 5.0)):
        armature.location.x = x
        armature.scale = (0.01, 0.01, 0.01)
        armature.keyframe_insert("location", frame=frame)
        armature.keyframe_insert("scale", frame=frame)
    before = {frame: joints_in_world(armature, frame) for frame in (1.0, 4.5, 11.0)}
    action = armature.animation_data.action
    clip = ImportedClip(
        file="walk.fbx",
        armatures=(armature.name,),
        actions=(action.name,),
        rate=24.0,
        notes=(),
        blocks=frozenset({armature.session_uid, action.session_uid}),
    )
    move = np.array([3.0, -1.0, 2.0])
    placed = place_clip(clip, bpy.context.scene, scale=2.0, move=move)
    for frame, joints in before.items():
        np.testing.assert_allclose(joints_in_world(armature, frame), 2.0 * joints + move, atol=1e-5)
    # It goes with the clip when that is taken back.
    assert armature.parent.session_uid in placed.blocks


# --- In sight -------------------------------------------------------------------------------------


def views() -> list[Any]:
    return [
        area.spaces.active.region_3d
        for area in bpy.context.window_manager.windows[0].screen.areas
        if area.type == "VIEW_3D"
    ]


def test_the_view_shows_what_was_imported(tmp_path: Path) -> None:
    paths = three(tmp_path)
    bodies = import_all(*paths)
    (view,) = views()
    middle = np.mean([joint_of(each, "Chest") for each in bodies], axis=0)
    assert np.linalg.norm(np.array(view.view_location) - middle) < 2.0
    assert 2.0 < view.view_distance < 30.0
    before = tuple(view.view_location)
    import_all(paths[1], frame_view=False)
    assert tuple(view.view_location) == before


def test_a_view_through_the_camera_stays_one(tmp_path: Path) -> None:
    bpy.ops.object.camera_add()
    bpy.context.scene.camera = bpy.context.object
    (view,) = views()
    view.view_perspective = "CAMERA"
    import_all(*three(tmp_path))
    assert view.view_perspective == "CAMERA"
