# SPDX-License-Identifier: GPL-3.0-or-later
"""Importing clips: right speed, one collection, nothing left of files that are refused."""

import json
import re
from base64 import b64encode
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.rig.armature import read_skeleton
from octo_motion.blender.scene import imports
from octo_motion.blender.scene.imports import NOTE, import_clip
from octo_motion.core.errors import ClipError
from octo_motion.core.splicing.humanoid.mapping import map_skeleton
from octo_motion.ui.splicing import import_clips as import_session
from octo_motion.ui.splicing.import_clips import OCTO_MOTION_OT_import_clips
from tests.ui.locomotion.test_generate import Press, Window
from tests.ui.rig import click, joints_in_world, keys

Data = Callable[[str], Path]

pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

REFUSED = {
    "10_zero_frames": "Line 129: there are no frames",
    "14_frame_time_zero": "Line 129: the frame time is 0 seconds",
    "15_frame_time_missing": "Line 129: .* 'Frame Time:'",
    "16_frame_time_negative": "Line 129: the frame time is -0.05 seconds",
    "17_frame_time_tiny": "Line 129: .* 10000 frames a second",
    "22_missing_space_slimevr": "Line 130: '-1.524539-7.5' is no number",
    "35_empty_file": "The file is empty",
    "37_hierarchy_only": "Line 126: .* there is no MOTION",
}
RATES = {
    "AdityaHa": (2, 4.0),
    "HoldTeddyByArm": (10, 3.0),
    "SL_Avatar_Tpose": (1, 30.0),
    "TeddyDangle": (6, 2.0),
    "TeddyIdle": (7, 2.0),
    "cossack dance 2": (49, 32.0),
}


def everything() -> dict[str, Any]:
    """All data-blocks, and all of the scene that importers like to change."""
    definitions = bpy.data.bl_rna.properties
    kinds = [each.identifier for each in definitions if each.type == "COLLECTION"]
    contents: dict[str, Any] = {kind: sorted(getattr(bpy.data, kind).keys()) for kind in kinds}
    contents["scene"] = of_the_scene()
    active = bpy.context.view_layer.objects.active
    contents["active"] = active and active.name
    contents["selected"] = [each.name for each in bpy.context.selected_objects]
    return contents


def of_the_scene() -> tuple[float, ...]:
    scene: Any = bpy.context.scene
    render = scene.render
    return (
        *(render.fps, render.fps_base, scene.frame_start, scene.frame_end),
        *(scene.frame_current, scene.frame_subframe, scene.unit_settings.scale_length),
    )


def times(action: Any) -> np.ndarray:
    """Frames of all keys of an action."""
    return np.unique(np.concatenate([each[:, 0] for each in keys(action).values()]))


def heads_at(armature: Any, frame: float) -> np.ndarray:
    """Where the bones begin, in the order of the file."""
    scene: Any = bpy.context.scene
    current = scene.frame_current
    heads = joints_in_world(armature, frame)[:, 0]
    scene.frame_set(current)
    return heads


def import_files(*paths: Path) -> set[str]:
    (folder,) = {each.parent for each in paths}
    files = [{"name": each.name} for each in paths]
    return click("import_clips", directory=str(folder), files=files)


def names_in(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.bvh"))


@pytest.mark.one_blender
def test_every_damaged_file_is_imported_right_or_refused_with_the_line(shared_data: Data) -> None:
    scene: Any = bpy.context.scene
    scene.render.fps = 30
    control = joints = None
    for path in names_in(shared_data("malformed")):
        before = everything()
        if path.stem in REFUSED:
            with pytest.raises(ClipError, match=REFUSED[path.stem]):
                import_clip(path, bpy.context)
            assert everything() == before, path.name
            continue
        clip = import_clip(path, bpy.context)
        assert of_the_scene() == before["scene"], path.name
        assert clip.armatures == clip.actions == (path.stem,)
        action: Any = bpy.data.actions[path.stem]
        frames = 1 if path.stem == "11_one_frame" else 25
        # 25 frames of a twentieth of a second at 30 frames per second.
        np.testing.assert_allclose(times(action), 1.0 + 1.5 * np.arange(frames), atol=1e-4)
        assert (action.frame_start, action.frame_end) == pytest.approx((1.0, times(action)[-1]))
        values = [each[0, 1] for each in keys(action).values()]
        assert np.isfinite(values).all()
        control = control or values
        heads = heads_at(bpy.data.objects[path.stem], 8.5)
        joints = heads if joints is None else joints
        if re.match("0[1-9]|19|2[0-9]|34|42", path.stem):
            # Of 80 units, single precision.
            np.testing.assert_allclose(heads, joints, atol=1e-4, err_msg=path.name)
        # A bone without an end points elsewhere, so its angles are others.
        if re.match("0[1-79]|19|2[0-9]|34|42", path.stem):
            # Angles of −0 come as a few 1e-21.
            assert values == pytest.approx(control, abs=1e-12), path.name
    assert [each.name for each in scene.collection.children] == ["Clips"]
    assert len(scene.collection.objects) == 0


@pytest.mark.parametrize("name", RATES)
def test_real_files_of_odd_rates_play_at_their_own_speed(name: str, shared_data: Data) -> None:
    frames, rate = RATES[name]
    import_files(shared_data(f"odd_real/{name}.bvh"))

    action: Any = bpy.data.actions[name]
    expected = 1.0 + np.arange(frames) * 24.0 / rate
    # The files give frame times of few digits.
    np.testing.assert_allclose(times(action), expected, rtol=1e-4)
    assert action[NOTE]["rate"] == pytest.approx(rate, rel=1e-4)
    assert action[NOTE]["file"] == f"{name}.bvh"


@pytest.mark.parametrize(
    ("clip", "rate"),
    [("punch_L", (24, 1.0)), ("throw_R", (30, 1.001)), ("walk", (25, 1.0)), ("walk", (60, 1.5))],
)
def test_bvh_fbx_and_gltf_of_one_motion_lie_on_the_same_frames(
    clip: str, rate: tuple[int, float], shared_data: Data
) -> None:
    scene: Any = bpy.context.scene
    scene.render.fps, scene.render.fps_base = rate
    before = of_the_scene()
    import_files(shared_data(f"secondlife/avatar_{clip}.bvh"))
    import_files(*(shared_data(f"derived_fbx_gltf/sl_{clip}.{kind}") for kind in ("fbx", "glb")))

    bvh, fbx, gltf = (
        bpy.data.actions[name] for name in (f"avatar_{clip}", f"sl_{clip}", f"sl_{clip}.001")
    )
    seconds = (times(bvh) - 1.0) * rate[1] / rate[0]
    own = bvh[NOTE]["rate"]
    np.testing.assert_allclose(seconds, np.arange(len(seconds)) / own, atol=1e-4)
    np.testing.assert_allclose(times(gltf), times(bvh), atol=1e-2)
    # The exporter had left out keys that lie on a line, none of them first or last.
    np.testing.assert_allclose(times(fbx)[[0, -1]], times(bvh)[[0, -1]], atol=1e-3)
    assert all(np.abs(times(bvh) - each).min() < 1e-2 for each in times(fbx))
    for each in (bvh, fbx, gltf):
        assert each[NOTE]["rate"] == pytest.approx(bvh[NOTE]["rate"], rel=1e-3)
    assert of_the_scene() == before
    assert "Icosphere" not in "".join([*bpy.data.objects.keys(), *bpy.data.meshes.keys()])
    assert list(bpy.data.collections.keys()) == ["Clips"]


def test_a_clip_stands_as_blenders_own_importer_shows_it(shared_data: Data) -> None:
    path = shared_data("secondlife/avatar_punch_L.bvh")
    bpy.ops.import_anim.bvh(filepath=str(path))
    own: Any = bpy.context.object
    own_joints = [joints_in_world(own, frame) for frame in (1, 9, 25)]
    click("import_clips", filepath=str(path), fit="NONE")
    clip: Any = bpy.context.object

    assert clip != own
    for frame, joints in zip((1, 9, 25), own_joints, strict=True):
        found = joints_in_world(clip, 1.0 + (frame - 1) * 24.0 / 20.0)
        np.testing.assert_allclose(found, joints, atol=1e-3)  # of 80 units, single precision


def upright(name: str) -> Any:
    """From feet to head of an armature, world, at rest and at the middle of its action."""
    armature: Any = bpy.data.objects[name]
    marks = map_skeleton(read_skeleton(armature)).landmarks
    names = [marks["head"], marks["foot.L"], marks["foot.R"]]
    first, last = armature.animation_data.action.frame_range
    bpy.context.scene.frame_set(int(0.5 * (first + last)))
    heads = [
        np.array([armature.matrix_world @ bones[each].head for each in names])
        for bones in (armature.pose.bones,)
    ]
    heads.append(
        np.array([armature.matrix_world @ armature.data.bones[n].head_local for n in names])
    )
    along = [each[0] - each[1:].mean(axis=0) for each in heads]
    return [each / np.linalg.norm(each) for each in along]


@pytest.mark.parametrize(
    "name",
    [
        *("makehuman/walk1", "makehuman/tpose", "animated_drawings/fair1_dab"),
        *("animated_drawings/fair1_jumping", "pybvh/bvh_example", "pybvh/standard_skeleton"),
    ],
)
def test_bodies_of_files_whose_z_axis_points_up_stand(name: str, shared_data: Data) -> None:
    clip = import_clip(shared_data(f"{name}.bvh"), bpy.context)
    assert any("Z axis points up" in note for note in clip.notes)
    assert all(each[2] > 0.9 for each in upright(Path(name).name))
    assert len(bpy.data.armatures) == len(bpy.data.actions) == 1


@pytest.mark.parametrize(
    "name",
    [
        *("secondlife/avatar_sit_ground", "secondlife/avatar_backflip", "cmu/12_01_walk"),
        *("animated_drawings/rokoko_jesse_dance", "odd_real/cossack dance 2"),
    ],
)
def test_files_whose_y_axis_points_up_are_left_as_they_are(name: str, shared_data: Data) -> None:
    clip = import_clip(shared_data(f"{name}.bvh"), bpy.context)
    assert not any("axis" in note for note in clip.notes)


def test_which_axis_points_up_can_be_said(shared_data: Data) -> None:
    path = shared_data("makehuman/walk1.bvh")
    assert not import_clip(path, bpy.context, up="Y").notes
    assert upright("walk1")[0][1] < -0.9
    assert not import_clip(path, bpy.context, up="Z").notes
    assert upright("walk1.001")[0][2] > 0.9
    click("import_clips", filepath=str(path), up="Y")
    assert upright("walk1.002")[0][1] < -0.9


def test_a_rig_with_many_actions_shows_the_first_and_keeps_all(shared_data: Data) -> None:
    import_files(shared_data("rigs_with_actions/KayKit_Knight.glb"))

    armature: Any = bpy.context.object
    assert armature.name == "KayKit_Knight"
    assert len(bpy.data.actions) == 76
    assert all(each.use_fake_user for each in bpy.data.actions)
    assert len(armature.animation_data.nla_tracks) == 0
    assert armature.animation_data.action is not None
    assert armature.animation_data.action_slot is not None


# Blender's exporter, with numpy.
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_what_belongs_to_one_take_of_an_fbx_file_stays_together(tmp_path: Path) -> None:
    """A smile that begins in the middle of a walk does not begin with the walk."""
    bpy.ops.object.armature_add()
    armature: Any = bpy.context.object
    bone = armature.pose.bones[0]
    for frame in (1, 60):
        bone.location.x = frame
        bone.keyframe_insert("location", frame=frame)
    bpy.ops.mesh.primitive_cube_add()
    face: Any = bpy.context.object
    face.parent = armature
    face.shape_key_add(name="Basis")
    smile = face.shape_key_add(name="Smile")
    for frame, value in ((30, 0.0), (40, 1.0), (50, 0.0)):
        smile.value = value
        smile.keyframe_insert("value", frame=frame)
    bpy.context.scene.frame_end = 60
    path = tmp_path / "walk.fbx"
    bpy.ops.export_scene.fbx(
        filepath=str(path),
        bake_anim_use_all_actions=False,
        bake_anim_use_nla_strips=False,
        bake_anim_force_startend_keying=False,
    )
    bpy.ops.wm.read_factory_settings(use_empty=True)
    clip = import_clip(path, bpy.context, 11)
    assert len(clip.actions) == len(bpy.data.actions) == 2
    for action in bpy.data.actions:
        assert (action.frame_start, action.frame_end) == (times(action)[0], times(action)[-1])
    assert {action.frame_start for action in bpy.data.actions} == {11.0, 40.0}


def test_each_take_of_an_fbx_file_begins_at_the_first_frame(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Called as Blender's own exporter calls the actions of an armature, and others their takes."""

    def importer(**_: str) -> set[str]:
        bpy.ops.object.armature_add()
        armature: Any = bpy.context.object
        bone = armature.pose.bones[0]
        for name, start in (
            ("Armature|Armature|Walk", 1),
            ("Face|Armature|Walk", 5),
            ("Armature|Armature|Run", 30),
            ("Armature|Take 1|Base", 60),
            ("Face|Take 1|Base", 58),
        ):
            armature.animation_data_clear()
            bone.keyframe_insert("location", frame=start)
            bone.keyframe_insert("location", frame=start + 20)
            armature.animation_data.action.name = name
        return {"FINISHED"}

    operators = SimpleNamespace(import_scene=SimpleNamespace(fbx=importer))
    monkeypatch.setattr(imports, "bpy", SimpleNamespace(**vars(bpy) | {"ops": operators}))
    (tmp_path / "takes.fbx").write_bytes(b"Kaydara")
    clip = import_clip(tmp_path / "takes.fbx", bpy.context)
    starts = {name: bpy.data.actions[name].frame_start for name in clip.actions}
    assert starts == {
        "takes Armature|Walk": 1.0,
        "takes Armature|Walk.001": 5.0,
        "takes Armature|Run": 1.0,
        "takes Take 1|Base": 3.0,
        "takes Take 1|Base.001": 1.0,
    }


def test_one_damaged_file_stops_none_of_the_others(shared_data: Data, tmp_path: Path) -> None:
    for name in ("secondlife/avatar_walk.bvh", "malformed/10_zero_frames.bvh"):
        (tmp_path / Path(name).name).write_bytes(shared_data(name).read_bytes())
    (tmp_path / "broken.glb").write_bytes(b"glTF but no more")
    (tmp_path / "broken.fbx").write_bytes(b"no FBX at all")

    done = import_files(*sorted(tmp_path.iterdir()), tmp_path / "absent.bvh")

    assert done == {"FINISHED"}
    assert list(bpy.data.objects.keys()) == ["avatar_walk"]
    assert list(bpy.data.actions.keys()) == ["avatar_walk"]
    assert list(bpy.data.collections.keys()) == ["Clips"]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("clip.bvh", b"", "'clip.bvh' was not imported. The file is empty"),
        ("clip.fbx", b"no FBX at all", "'clip.fbx' was not imported. It is no binary FBX"),
        ("clip.glb", b"glTF but no more", "'clip.glb' was not imported. Blender's importer"),
        ("clip.txt", b"walk", "'.txt' files are no motion"),
        ("clip.bvh", None, "There is no such file"),
    ],
)
def test_a_file_that_cannot_be_used_changes_nothing(
    name: str, content: bytes | None, message: str, tmp_path: Path
) -> None:
    bpy.ops.object.armature_add()
    before = everything()
    if content is not None:
        (tmp_path / name).write_bytes(content)

    with pytest.raises(RuntimeError, match=re.escape(message)):
        bpy.ops.octo_motion.import_clips(filepath=str(tmp_path / name))

    assert everything() == before


def gltf_of_two_nodes() -> dict[str, Any]:
    """One node turns the other on; no skin says that they are bones."""
    seconds = np.array([0.0, 0.5, 1.0], dtype=np.float32).tobytes()
    turns = np.array([[0, 0, 0, 1], [0.6, 0, 0, 0.8], [0, 0, 0, 1]], dtype=np.float32).tobytes()
    content = "data:application/octet-stream;base64," + b64encode(seconds + turns).decode()
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "Hips", "children": [1]}, {"name": "Spine", "translation": [0, 0.3, 0]}],
        "buffers": [{"uri": content, "byteLength": 60}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 12},
            {"buffer": 0, "byteOffset": 12, "byteLength": 48},
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": 3,
                "type": "SCALAR",
                "min": [0.0],
                "max": [1.0],
            },
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC4"},
        ],
        "animations": [
            {
                "channels": [{"sampler": 0, "target": {"node": 1, "path": "rotation"}}],
                "samplers": [{"input": 0, "output": 1}],
            }
        ],
    }


def without_skin() -> str:
    return json.dumps(gltf_of_two_nodes())


def compressed() -> str:
    content = gltf_of_two_nodes()
    name = "KHR_draco_mesh_compression"
    content["extensionsUsed"] = content["extensionsRequired"] = [name]
    place = {"type": "VEC3", "min": [0.0, 0.0, 0.0], "max": [1.0, 1.0, 1.0]}
    content["accessors"].append({"componentType": 5126, "count": 3, **place})
    content["accessors"].append({"componentType": 5123, "count": 3, "type": "SCALAR"})
    content["bufferViews"].append({"buffer": 0, "byteOffset": 0, "byteLength": 60})
    packed = {name: {"bufferView": 2, "attributes": {"POSITION": 0}}}
    mesh = {"attributes": {"POSITION": 2}, "indices": 3, "extensions": packed}
    content["meshes"] = [{"primitives": [mesh]}]
    content["nodes"].append({"mesh": 0})
    content["scenes"][0]["nodes"].append(2)
    return json.dumps(content)


def without_its_buffer() -> str:
    content = gltf_of_two_nodes()
    content["buffers"][0]["uri"] = "missing.bin"
    return json.dumps(content)


def of_a_strange_extension() -> str:
    content = gltf_of_two_nodes()
    content["extensionsUsed"] = content["extensionsRequired"] = ["KHR_not_known"]
    return json.dumps(content)


def in_text_form() -> str:
    return "; FBX 7.4.0 project file\nFBXHeaderExtension:  {\n}\n"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.gltf", without_skin, r"not the bones of an armature\. Export it with the mesh"),
        ("a.gltf", without_its_buffer, r"'missing\.bin'\. Put that file beside it"),
        ("a.gltf", of_a_strange_extension, r"KHR_not_known .* without this extension"),
        ("a.fbx", in_text_form, r"no binary FBX file\. Export it again as binary FBX"),
    ],
)
def test_what_to_export_otherwise_is_said_of_a_file_that_cannot_be_used(
    name: str, content: Callable[[], str], message: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(content(), encoding="utf-8")
    before = everything()
    with pytest.raises(ClipError) as error:
        import_clip(tmp_path / name, bpy.context)
    assert re.search(message, str(error.value))
    assert "/" not in str(error.value)
    assert everything() == before


def test_meshes_that_are_compressed_are_read_or_named(tmp_path: Path) -> None:
    """A path of Blender's own library was all that was said; that of 4.5 passes them over."""
    path = tmp_path / "a.gltf"
    path.write_text(compressed(), encoding="utf-8")
    with pytest.raises(ClipError) as error:
        import_clip(path, bpy.context)
    assert re.search("compressed by Draco|moves objects", str(error.value))
    assert ".so" not in str(error.value)


def test_a_rig_without_motion_is_refused_and_leaves_nothing(shared_data: Data) -> None:
    before = everything()
    with pytest.raises(ClipError, match="Its armature has no motion"):
        import_clip(shared_data("rigs_with_actions/Quaternius_Superhero_Male.glb"), bpy.context)
    assert everything() == before


def test_without_a_file_nothing_is_imported() -> None:
    with pytest.raises(RuntimeError, match="No file is given"):
        bpy.ops.octo_motion.import_clips()


def test_import_is_one_undo_step(shared_data: Data) -> None:
    bpy.ops.ed.undo_push(message="before")
    paths = [shared_data(f"secondlife/avatar_{name}.bvh") for name in ("walk", "run")]
    import_files(*paths)
    assert len(bpy.data.actions) == 2
    bpy.ops.ed.undo()
    assert len(bpy.data.actions) == len(bpy.data.objects) == len(bpy.data.collections) == 0


def test_clips_are_imported_in_object_mode_alone() -> None:
    bpy.ops.object.armature_add()
    bpy.ops.object.mode_set(mode="EDIT")
    assert not bpy.ops.octo_motion.import_clips.poll()


def test_first_frame_and_collection_are_as_asked(shared_data: Data) -> None:
    path = shared_data("secondlife/avatar_walk.bvh")
    click("import_clips", filepath=str(path), frame_start=101)
    click("import_clips", filepath=str(path))

    first, second = (bpy.data.actions[name] for name in ("avatar_walk", "avatar_walk.001"))
    assert times(first)[0] == pytest.approx(101.0)
    np.testing.assert_allclose(times(second) + 100.0, times(first), atol=1e-4)
    assert len(bpy.data.collections["Clips"].objects) == 2
    assert {each.name for each in bpy.context.selected_objects} == {"avatar_walk.001"}


HINGES = """HIERARCHY
ROOT 下半身
{
OFFSET 0 90 0
CHANNELS 4 Yposition Zrotation Xrotation Yrotation
JOINT 右足
{
OFFSET -10 -5 0
CHANNELS 2 Zrotation Xrotation
JOINT 右ひざ
{
OFFSET 0 -40 0
CHANNELS 1 Xrotation
JOINT 右足首
{
OFFSET 0 -40 0
CHANNELS 0
JOINT 右つま先
{
OFFSET 0 -5 12
CHANNELS 1 Zrotation
End Site
{
OFFSET 0 0 5
}
}
}
}
}
}
MOTION
Frames: 3
Frame Time: 0.041666666666666664
90 0 0 0 0 0 0 0
95 0 0 30 10 20 60 5
92 5 -10 -30 -10 -35 75 -15
"""


def turned(axis: str, degrees: float) -> np.ndarray:
    """(3, 3) of an axis of the file."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    first, second = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[[first, first, second, second], [first, second, first, second]] = (
        *(cosine, -sine),
        *(sine, cosine),
    )
    return matrix


def test_joints_that_turn_about_one_axis_are_where_the_file_says(tmp_path: Path) -> None:
    """Worked out here from the file's own numbers; BVH's Y is Blender's Z."""
    path = tmp_path / "hinges.bvh"
    path.write_bytes(HINGES.encode("cp932"))
    before = path.read_bytes()
    import_files(path)

    assert path.read_bytes() == before
    armature: Any = bpy.data.objects["hinges"]
    names = ["下半身", "右足", "右ひざ", "右足首", "右つま先"]
    assert [bone.name for bone in armature.data.bones] == names
    rows = [[float(word) for word in row.split()] for row in HINGES.splitlines()[-3:]]
    for frame, row in enumerate(rows, 1):
        height, z, x, y, thigh_z, thigh_x, knee, _ = row
        turn = turned("Z", z) @ turned("X", x) @ turned("Y", y)
        place = np.array([0.0, height, 0.0])
        expected = [place]
        joints = (
            ((-10.0, -5.0, 0.0), turned("Z", thigh_z) @ turned("X", thigh_x)),
            ((0.0, -40.0, 0.0), turned("X", knee)),
            ((0.0, -40.0, 0.0), np.eye(3)),
            ((0.0, -5.0, 12.0), np.eye(3)),
        )
        for offset, own in joints:
            place = place + turn @ np.array(offset)
            turn = turn @ own
            expected.append(place)
        in_blender = np.array(expected) @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
        np.testing.assert_allclose(heads_at(armature, frame), in_blender, atol=1e-4)


# --- File by file, in a window --------------------------------------------------------------------


class Operator:
    """The operator's methods on a plain object: Blender makes real ones only with a window."""

    _browsing = False
    frame_start = 1
    filepath = ""
    up = "AUTO"
    fit = "HUMANOIDS"
    height = 0.0
    side_by_side = frame_view = True

    def __init__(self, folder: Path, names: list[str]) -> None:
        self.directory = str(folder)
        self.files = [SimpleNamespace(name=name) for name in names]
        self.reports: list[str] = []

    def report(self, _kind: set[str], text: str) -> None:
        self.reports.append(text)

    def __getattr__(self, name: str) -> Any:
        found = getattr(OCTO_MOTION_OT_import_clips, name)
        return found.__get__(self) if callable(found) else found


CLEAN = ["timer off", "progress off", "text off"]
THREE = ["avatar_walk.bvh", "avatar_run.bvh", "avatar_jump.bvh"]


def begun(shared_data: Data, names: list[str]) -> tuple[Any, Any]:
    folder = shared_data(f"secondlife/{THREE[0]}").parent
    operator, window = Operator(folder, names), Window()
    assert operator.invoke(window, Press("LEFTMOUSE")) == {"RUNNING_MODAL"}
    assert window.calls == ["timer on", "progress on", "modal", "text on"]
    return operator, window


def test_several_files_come_one_after_the_other(shared_data: Data) -> None:
    operator, window = begun(shared_data, THREE)
    counts = []
    while operator.modal(window, Press("TIMER")) == {"RUNNING_MODAL"}:
        counts.append(len(bpy.data.actions))
        assert operator.modal(window, Press("LEFTMOUSE")) == {"RUNNING_MODAL"}
    assert counts == [1, 2, 3]
    assert window.calls[-3:] == CLEAN
    assert operator.reports == ["3 clips imported. Fitted to the height: 1.7 m."]
    layer: Any = bpy.context.view_layer
    assert layer.objects.active.name == "avatar_walk"
    assert all(each.select_get() for each in bpy.data.objects)


def test_esc_between_files_leaves_nothing_behind(shared_data: Data) -> None:
    bpy.ops.object.armature_add()
    bpy.ops.mesh.primitive_cube_add()
    before = everything()
    operator, window = begun(shared_data, THREE)
    operator.modal(window, Press("TIMER"))
    operator.modal(window, Press("TIMER"))
    assert len(bpy.data.actions) == 2
    assert operator.modal(window, Press("ESC")) == {"CANCELLED"}
    assert everything() == before
    assert window.calls[-3:] == CLEAN
    assert operator.reports == ["Cancelled: nothing was imported."]
    # Blender may call it as well, when it quits.
    operator.cancel(window)
    assert window.calls.count("timer off") == 1


def test_esc_keeps_what_was_imported_before(shared_data: Data) -> None:
    import_files(shared_data("derived_fbx_gltf/sl_walk.glb"))
    before = everything()
    operator, window = begun(shared_data, THREE)
    operator.modal(window, Press("TIMER"))
    operator.modal(window, Press("ESC"))
    assert everything() == before
    assert list(bpy.data.collections.keys()) == ["Clips"]


def test_a_fault_in_the_middle_leaves_nothing_behind(
    shared_data: Data, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = everything()
    operator, window = begun(shared_data, THREE)
    operator.modal(window, Press("TIMER"))

    def fail(*_: object, **__: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(import_session, "import_clip", fail)
    with pytest.raises(ZeroDivisionError):
        operator.modal(window, Press("TIMER"))
    assert everything() == before
    assert window.calls[-3:] == CLEAN


def test_files_that_are_all_refused_are_told_at_the_end(shared_data: Data) -> None:
    before = everything()
    operator, window = begun(shared_data, ["absent.bvh", "none.fbx"])
    result = {"RUNNING_MODAL"}
    while result == {"RUNNING_MODAL"}:
        result = operator.modal(window, Press("TIMER"))
    assert result == {"CANCELLED"}
    assert operator.reports[0].startswith("'absent.bvh' was not imported. There is no such file.")
    assert everything() == before


def test_progress_goes_on_within_a_file(shared_data: Data) -> None:
    told: list[float] = []
    path = shared_data("rigs_with_actions/KayKit_Knight.glb")
    session = import_session.ImportSession([path, path.with_name("absent.bvh")], 1, bpy.context)
    assert list(session.steps(told.append)) == [0.5, 1.0]
    assert told == sorted(told)
    # Of its 76 actions each counts.
    assert len([share for share in told if 0.0 < share < 0.5]) > 70
