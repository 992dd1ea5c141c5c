# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks of real rigs: each bone that is found is the one an artist would point at."""

import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.rig.armature import read_skeleton
from octo_motion.core.skeleton import Skeleton
from octo_motion.core.splicing.humanoid.landmarks import LANDMARKS
from octo_motion.core.splicing.humanoid.mapping import SkeletonMapping, map_skeleton

Data = Callable[[str], Path]

# Blender's BVH importer leaves its file to the garbage collector.
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

MIDDLE: tuple[str, ...] = ("hips", "spine", "chest", "neck", "head")
SIDED: tuple[str, ...] = (
    "clavicle",
    "upper_arm",
    "forearm",
    "hand",
    "thigh",
    "shin",
    "foot",
    "toe",
)


def names_of(middle: str, sided: str, left: str, right: str) -> dict[str, str]:
    """Bone names by landmark: "-" where a rig has none, "{}" for the side."""
    names: dict[str, str] = dict(zip(MIDDLE, middle.split(), strict=True))
    for side, word in (("L", left), ("R", right)):
        for part, name in zip(SIDED, sided.split(), strict=True):
            names[f"{part}.{side}"] = name.replace("{}", word)
    return {landmark: name for landmark, name in names.items() if name != "-"}


SECOND_LIFE = names_of(
    "hip abdomen chest neck head",
    "{}Collar {}Shldr {}ForeArm {}Hand {}Thigh {}Shin {}Foot -",
    *("l", "r"),
)
CMU = names_of(
    "Hips LowerBack Spine1 Neck Head",
    "{}Shoulder {}Arm {}ForeArm {}Hand {}UpLeg {}Leg {}Foot {}ToeBase",
    *("Left", "Right"),
)
FOUR_SPINES = names_of(
    "Hips Spine Spine3 Neck Head",
    "{}Shoulder {}Arm {}ForeArm {}Hand {}UpLeg {}Leg {}Foot {}ToeBase",
    *("Left", "Right"),
)
MAKEHUMAN = names_of(
    "root spine05 spine01 neck01 head",
    "clavicle.{} upperarm01.{} lowerarm01.{} wrist.{} upperleg01.{} lowerleg01.{} foot.{} -",
    *("L", "R"),
)
ARMS_OF_MIXAMO = "{}Arm {}ForeArm {}Hand {}UpLeg {}Leg {}Foot"

RIGS: dict[str, dict[str, str]] = {
    "animated_drawings/cmu1_jumping_jacks.bvh": names_of(
        "Hips lowerback Chest2 lowerneck Head",
        "{}Collar {}Shoulder {}Elbow {}Wrist {}Hip {}Knee {}Ankle {}Toe",
        *("Left", "Right"),
    ),
    "animated_drawings/fair1_dab.bvh": FOUR_SPINES,
    "animated_drawings/fair1_jumping.bvh": FOUR_SPINES,
    "animated_drawings/rokoko_jesse_dance.bvh": {**FOUR_SPINES, "chest": "Spine2"},
    "cmu/01_01_hops.bvh": CMU,
    "cmu/12_01_walk.bvh": CMU,
    "cmu/12_03_walk.bvh": CMU,
    "cmu/02_02_walk_daz43.bvh": SECOND_LIFE,
    "cmu/03_02_uneven_walk_daz43.bvh": SECOND_LIFE,
    "cmu/111_28_daz43.bvh": SECOND_LIFE,
    "cmu/pirouette_threejs.bvh": SECOND_LIFE,
    "cmu/03_01_lowercase_names.bvh": {each: name.lower() for each, name in SECOND_LIFE.items()},
    # Its names were given to the wrong bones: the thigh is called a leg, the buttock an upper leg.
    "cmu/111_28_renamed_mixamorig.bvh": names_of(
        "Armature_mixamorigHips Armature_mixamorigSpine Armature_mixamorigSpine2 "
        "Armature_mixamorigNeck Armature_mixamorigHead",
        "#Collar Armature_mixamorig{}Shoulder Armature_mixamorig{}ForeArm "
        "Armature_mixamorig{}Hand Armature_mixamorig{}Leg #Shin Armature_mixamorig{}Foot -",
        *("Left", "Right"),
    ),
    "makehuman/pose_fight01.bvh": MAKEHUMAN,
    "makehuman/tpose.bvh": MAKEHUMAN,
    "makehuman/walk1.bvh": names_of(
        "Root Spine1 Spine3 Neck Head",
        "Clavicle_{} UpArm_{} LoArm_{} Hand_{} UpLeg_{} LoLeg_{} Foot_{} Toe_{}",
        *("L", "R"),
    ),
    "misc/assimp_Boxing_Toes.bvh": names_of(
        "Hips Ab Chest Neck Head",
        "{}Collar {}Shoulder {}Elbow {}Wrist {}Hip {}Knee {}Ankle {}Toes",
        *("Left", "Right"),
    ),
    "misc/bvhio_example.bvh": names_of(
        "Hips - Chest Neck Head",
        "{}Collar {}UpArm {}LowArm {}Hand {}UpLeg {}LowLeg {}Foot -",
        *("Left", "Right"),
    ),
    "misc/walk01.bvh": names_of(
        "Hips Spine Spine1 Neck Head", f"{{}}Shoulder {ARMS_OF_MIXAMO} -", *("Left", "Right")
    ),
    "pybvh/bvh_example.bvh": FOUR_SPINES,
    "pybvh/standard_skeleton.bvh": FOUR_SPINES,
    "pybvh/bvh_test3.bvh": {
        **FOUR_SPINES,
        "toe.L": "LeftForeFoot",
        "toe.R": "RightForeFoot",
    },
    "rigs_with_actions/KayKit_Knight.glb": names_of(
        "hips spine chest - head",
        "- upperarm.{} lowerarm.{} wrist.{} upperleg.{} lowerleg.{} foot.{} toes.{}",
        *("l", "r"),
    ),
    "rigs_with_actions/Quaternius_Superhero_Male.glb": names_of(
        "pelvis spine_01 spine_03 neck_01 Head",
        "clavicle_{} upperarm_{} lowerarm_{} hand_{} thigh_{} calf_{} foot_{} ball_{}",
        *("l", "r"),
    ),
    "rigs_with_actions/RobotExpressive.glb": names_of(
        "Body Abdomen Torso_1 Neck Head_1",
        "Shoulder{} UpperArm{} LowerArm{} Palm2{} UpperLeg{} LowerLeg{} Foot{} -",
        *("L", "R"),
    ),
    **{
        f"derived_fbx_gltf/sl_{clip}.{kind}": SECOND_LIFE
        for clip in ("punch_L", "throw_R", "walk")
        for kind in ("fbx", "glb")
    },
    "malformed/25_japanese_utf8.bvh": names_of(
        "センター 上半身 上半身2 首 頭",
        "{}肩 {}腕 {}ひじ {}手首 {}足 {}ひざ {}足首 -",
        *("左", "右"),
    ),
    "malformed/23_colon_names_mixamorig.bvh": {
        each: f"mixamorig:{name}"
        for each, name in names_of(
            "Hips Spine Spine1 Neck Head", f"{{}}Shoulder {ARMS_OF_MIXAMO} -", *("Left", "Right")
        ).items()
    },
    "malformed/29_quotes_dots_slashes.bvh": {
        each: f'rig/"{name}"\\.001' for each, name in SECOND_LIFE.items()
    },
    "malformed/27_duplicate_names.bvh": {
        **SECOND_LIFE,
        "hand.L": "hand",
        "hand.R": "hand.001",
        "foot.L": "foot",
        "foot.R": "foot.001",
    },
    **{
        f"odd_real/{name}.bvh": SECOND_LIFE
        for name in (
            *("AdityaHa", "HoldTeddyByArm", "SL_Avatar_Tpose", "TeddyDangle", "TeddyIdle"),
            "cossack dance 2",
        )
    },
}

NO_HUMANOIDS = {
    "octo/octopus_cheli_sanjuan.glb": "6 limbs of one length start at 'Root_M_01'",
    "octo/nssm_octopus.blend": "8 limbs of one length start at 'Bone.001'",
    "octo/assimp_animation_with_skeleton.fbx": "no pair of limbs",
    "misc/fairmotion_sinusoidal.bvh": "4 bones",
    "misc/bvh_anim_test_simple.bvh": "2 bones",
    "pybvh/full_precision_frame_time.bvh": "2 bones",
}


def skeletons(path: Path, folder: Path) -> list[Skeleton]:
    """The skeletons of a file; of mocap its first frame is enough."""
    if path.suffix == ".bvh":
        text = path.read_text(encoding="utf-8")
        head, motion = re.split(r"(?=MOTION)", text, maxsplit=1)
        lines = [line for line in motion.splitlines() if line.strip()]
        short = [lines[0], "Frames: 1", lines[2], lines[3]]
        path = folder / path.name
        path.write_text(head + "\n".join(short) + "\n", encoding="utf-8")
    importers: dict[str, Any] = {
        ".blend": bpy.ops.wm.open_mainfile,
        ".glb": bpy.ops.import_scene.gltf,
        ".fbx": bpy.ops.import_scene.fbx,
        ".bvh": bpy.ops.import_anim.bvh,
    }
    importers[path.suffix](filepath=str(path))
    bpy.context.view_layer.update()
    return [read_skeleton(each) for each in bpy.data.objects if each.type == "ARMATURE"]


def expected_names(rig: str) -> dict[str, str]:
    """Names in which "#" is the side as one small letter."""
    return {
        landmark: name.replace("#", landmark[-1].lower()) for landmark, name in RIGS[rig].items()
    }


def check_lengths(skeleton: Skeleton, found: SkeletonMapping) -> None:
    """Arms and legs of a body: two parts of about the same length, legs longer than the neck."""
    head = {
        each: skeleton.heads[skeleton.index[name]] for each, name in found.landmarks.bones.items()
    }
    for side in "LR":
        for parts in (("upper_arm", "forearm", "hand"), ("thigh", "shin", "foot")):
            joints = [head[f"{part}.{side}"] for part in parts]
            upper, lower = np.linalg.norm(np.diff(joints, axis=0), axis=1)
            # The robot's lower arms are twice as long as its upper arms.
            assert 0.4 < upper / lower < 2.1
    for parts in (("upper_arm", "forearm"), ("thigh", "shin")):
        left, right = (
            np.linalg.norm(head[f"{parts[0]}.{s}"] - head[f"{parts[1]}.{s}"]) for s in "LR"
        )
        # Captured people are a few per cent from symmetry, the robot's shoulders 15 %.
        assert left == pytest.approx(right, rel=0.16)


@pytest.mark.parametrize("rig", RIGS)
def test_landmarks_of(rig: str, shared_data: Data, tmp_path: Path) -> None:
    (skeleton,) = skeletons(shared_data(rig), tmp_path)

    found = map_skeleton(skeleton)

    assert dict(found.landmarks.bones) == expected_names(rig)
    assert found.asked == ()
    assert found.problem == ""
    palms = rig.endswith("RobotExpressive.glb")
    assert len(found.notes) == (2 if palms else 0)
    check_lengths(skeleton, found)


def test_all_clips_of_second_life_have_the_same_landmarks(
    shared_data: Data, tmp_path: Path
) -> None:
    files = sorted(shared_data("secondlife").glob("*.bvh"))
    assert len(files) == 20
    for path in files:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        (skeleton,) = skeletons(path, tmp_path)
        found = map_skeleton(skeleton)
        assert dict(found.landmarks.bones) == SECOND_LIFE, path.name
        assert found.notes == ()


@pytest.mark.parametrize("rig", NO_HUMANOIDS)
def test_what_is_no_humanoid_is_said_with_the_reason(
    rig: str, shared_data: Data, tmp_path: Path
) -> None:
    for skeleton in skeletons(shared_data(rig), tmp_path):
        found = map_skeleton(skeleton)
        assert NO_HUMANOIDS[rig] in found.problem
        assert not found.landmarks.bones


def test_eight_rigify_tentacles_are_eight_limbs_and_not_their_copies(
    shared_data: Data, tmp_path: Path
) -> None:
    rigs = skeletons(shared_data("octo/rigify_simple_tentacle_8arm.blend"), tmp_path)
    assert len(rigs) == 2
    for skeleton in rigs:
        assert "8 limbs" in map_skeleton(skeleton).problem


RIGIFY_HUMAN = """
import bpy, addon_utils, json, os, sys
from octo_motion.blender.rig.armature import read_skeleton
from octo_motion.core.splicing.humanoid.mapping import map_skeleton

bpy.ops.wm.read_factory_settings(use_empty=True)
addon_utils.enable("rigify", default_set=True)
bpy.ops.object.armature_human_metarig_add()
meta = bpy.context.object
bpy.ops.pose.rigify_generate()
(rig,) = (each for each in bpy.data.objects if each.type == "ARMATURE" and each != meta)
found = []
for armature in (meta, rig):
    skeleton = read_skeleton(armature)
    bones = dict(map_skeleton(skeleton).landmarks.bones)
    driven = [name for name in bones.values() if skeleton.constrained[skeleton.index[name]]]
    found.append([bones, driven])
print("FOUND " + json.dumps(found), flush=True)
# Rigify leaves operators behind, at which Blender 4.5 hangs when Python ends.
os._exit(0)
"""


def test_a_rigify_human_lists_the_bones_that_an_artist_keys() -> None:
    run = subprocess.run(
        [sys.executable, "-c", RIGIFY_HUMAN],
        cwd=Path(__file__).resolve().parents[2],
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    (line,) = (line for line in run.stdout.splitlines() if line.startswith("FOUND "))
    (metarig, _), (generated, driven) = json.loads(line.removeprefix("FOUND "))

    assert metarig == names_of(
        "spine spine.001 spine.003 spine.004 spine.006",
        "shoulder.{} upper_arm.{} forearm.{} hand.{} thigh.{} shin.{} foot.{} toe.{}",
        *("L", "R"),
    )
    assert generated == names_of(
        "torso spine_fk.002 spine_fk.003 neck head",
        "shoulder.{} upper_arm_fk.{} forearm_fk.{} hand_fk.{} "
        "thigh_fk.{} shin_fk.{} foot_fk.{} toe_fk.{}",
        *("L", "R"),
    )
    assert set(generated) == set(LANDMARKS)
    assert driven == []
