# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bone is which, on any humanoid: from names, and from its shape where names are silent."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from octo_motion.core.rotations import from_axis_angle, to_matrix
from octo_motion.core.splicing.clip.rest_pose import with_rest_pose
from octo_motion.core.splicing.humanoid.body_height import stature
from octo_motion.core.splicing.humanoid.landmarks import (
    LANDMARKS,
    OPTIONAL,
    Landmarks,
    read_names,
)
from octo_motion.core.splicing.humanoid.mapping import map_skeleton
from tests.core.humanoids import PARENTS, humanoid, number_name
from tests.core.rigs import body_with_arms, skeleton_of

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


def scheme(middle: str, sided: str, left: str, right: str) -> dict[str, str]:
    """Names of all landmarks: "{}" in a sided name stands for the side."""
    names: dict[str, str] = dict(zip(MIDDLE, middle.split(" | "), strict=True))
    for side, word in (("L", left), ("R", right)):
        for part, name in zip(SIDED, sided.split(" | "), strict=True):
            names[f"{part}.{side}"] = name.replace("{}", word)
    return names


SCHEMES = {
    "mixamo": scheme(
        "mixamorig:Hips | mixamorig:Spine | mixamorig:Spine2 | mixamorig:Neck | mixamorig:Head",
        "mixamorig:{}Shoulder | mixamorig:{}Arm | mixamorig:{}ForeArm | mixamorig:{}Hand | "
        "mixamorig:{}UpLeg | mixamorig:{}Leg | mixamorig:{}Foot | mixamorig:{}ToeBase",
        *("Left", "Right"),
    ),
    "mixamo without colon, numbered": scheme(
        "mixamorig5Hips | mixamorig5Spine | mixamorig5Spine2 | mixamorig5Neck | mixamorig5Head",
        "mixamorig5{}Shoulder | mixamorig5{}Arm | mixamorig5{}ForeArm | mixamorig5{}Hand | "
        "mixamorig5{}UpLeg | mixamorig5{}Leg | mixamorig5{}Foot | mixamorig5{}ToeBase",
        *("Left", "Right"),
    ),
    "vrm": scheme(
        "hips | spine | upperChest | neck | head",
        "{}Shoulder | {}UpperArm | {}LowerArm | {}Hand | {}UpperLeg | {}LowerLeg | {}Foot | {}Toes",
        *("left", "right"),
    ),
    "vroid": scheme(
        "J_Bip_C_Hips | J_Bip_C_Spine | J_Bip_C_UpperChest | J_Bip_C_Neck | J_Bip_C_Head",
        "J_Bip_{}_Shoulder | J_Bip_{}_UpperArm | J_Bip_{}_LowerArm | J_Bip_{}_Hand | "
        "J_Bip_{}_UpperLeg | J_Bip_{}_LowerLeg | J_Bip_{}_Foot | J_Bip_{}_ToeBase",
        *("L", "R"),
    ),
    "unreal": scheme(
        "pelvis | spine_01 | spine_05 | neck_01 | head",
        "clavicle_{} | upperarm_{} | lowerarm_{} | hand_{} | "
        "thigh_{} | calf_{} | foot_{} | ball_{}",
        *("l", "r"),
    ),
    "rigify": scheme(
        "spine | spine.001 | spine.003 | spine.004 | spine.006",
        "shoulder.{} | upper_arm.{} | forearm.{} | hand.{} | thigh.{} | shin.{} | foot.{} | toe.{}",
        *("L", "R"),
    ),
    "rigify, deforming bones": scheme(
        "DEF-spine | DEF-spine.001 | DEF-spine.003 | DEF-spine.004 | DEF-spine.006",
        "DEF-shoulder.{} | DEF-upper_arm.{} | DEF-forearm.{} | DEF-hand.{} | DEF-thigh.{} | "
        "DEF-shin.{} | DEF-foot.{} | DEF-toe.{}",
        *("L", "R"),
    ),
    "biped": scheme(
        "Bip01 Pelvis | Bip01 Spine | Bip01 Spine2 | Bip01 Neck | Bip01 Head",
        "Bip01 {} Clavicle | Bip01 {} UpperArm | Bip01 {} Forearm | Bip01 {} Hand | "
        "Bip01 {} Thigh | Bip01 {} Calf | Bip01 {} Foot | Bip01 {} Toe0",
        *("L", "R"),
    ),
    "valve": scheme(
        "ValveBiped.Bip01_Pelvis | ValveBiped.Bip01_Spine | ValveBiped.Bip01_Spine4 | "
        "ValveBiped.Bip01_Neck1 | ValveBiped.Bip01_Head1",
        "ValveBiped.Bip01_{}_Clavicle | ValveBiped.Bip01_{}_UpperArm | "
        "ValveBiped.Bip01_{}_Forearm | ValveBiped.Bip01_{}_Hand | ValveBiped.Bip01_{}_Thigh | "
        "ValveBiped.Bip01_{}_Calf | ValveBiped.Bip01_{}_Foot | ValveBiped.Bip01_{}_Toe0",
        *("L", "R"),
    ),
    "character creator": scheme(
        "CC_Base_Hip | CC_Base_Waist | CC_Base_Spine02 | CC_Base_NeckTwist01 | CC_Base_Head",
        "CC_Base_{}_Clavicle | CC_Base_{}_Upperarm | CC_Base_{}_Forearm | CC_Base_{}_Hand | "
        "CC_Base_{}_Thigh | CC_Base_{}_Calf | CC_Base_{}_Foot | CC_Base_{}_ToeBase",
        *("L", "R"),
    ),
    "daz genesis": scheme(
        "hip | abdomenLower | chestUpper | neckLower | head",
        "{}Collar | {}ShldrBend | {}ForearmBend | {}Hand | {}ThighBend | {}Shin | {}Foot | {}Toe",
        *("l", "r"),
    ),
    "joints": scheme(
        "Hips | Chest | Chest2 | Neck | Head",
        "{}Collar | {}Shoulder | {}Elbow | {}Wrist | {}Hip | {}Knee | {}Ankle | {}Toe",
        *("Left", "Right"),
    ),
    "smpl": scheme(
        "Pelvis | Spine1 | Spine3 | Neck | Head",
        "{}_Collar | {}_Shoulder | {}_Elbow | {}_Wrist | {}_Hip | {}_Knee | {}_Ankle | {}_Foot",
        *("L", "R"),
    ),
    "kinect": scheme(
        "SpineBase | SpineMid | SpineShoulder | Neck | Head",
        "Collar{} | Shoulder{} | Elbow{} | Wrist{} | Hip{} | Knee{} | Ankle{} | Foot{}",
        *("Left", "Right"),
    ),
    "vertebrae": scheme(
        "Pelvis | L5 | T8 | Neck | Head",
        "{}Shoulder | {}UpperArm | {}ForeArm | {}Hand | {}UpperLeg | {}LowerLeg | {}Foot | {}Toe",
        *("Left", "Right"),
    ),
    "lower case": scheme(
        "hips | spine | chest | neck | head",
        "{}collar | {}upperarm | {}forearm | {}hand | {}thigh | {}shin | {}foot | {}toe",
        *("l", "r"),
    ),
    "capitals": scheme(
        "HIPS | SPINE | CHEST | NECK | HEAD",
        "{}_CLAVICLE | {}_UPPER_ARM | {}_FOREARM | {}_HAND | {}_THIGH | {}_SHIN | {}_FOOT | {}_TOE",
        *("LEFT", "RIGHT"),
    ),
    "side behind": scheme(
        "hips | spine | chest | neck | head",
        "Shoulder{} | Arm{} | ForeArm{} | Hand{} | UpLeg{} | Leg{} | Foot{} | Toe{}",
        *("Left", "Right"),
    ),
    "japanese": scheme(
        "センター | 上半身 | 上半身2 | 首 | 頭",
        "{}肩 | {}腕 | {}ひじ | {}手首 | {}足 | {}ひざ | {}足首 | {}つま先",
        *("左", "右"),
    ),
    "of a character": scheme(
        "bob_hips | bob_spine | bob_chest | bob_neck | bob_head",
        "bob_shoulder_{} | bob_arm_{} | bob_elbow_{} | bob_hand_{} | bob_leg_{} | bob_knee_{} | "
        "bob_foot_{} | bob_toe_{}",
        *("l", "r"),
    ),
}


@pytest.mark.parametrize("name", SCHEMES)
def test_all_landmarks_are_found_under_the_names_of(name: str) -> None:
    names = SCHEMES[name]

    found = map_skeleton(humanoid(names))

    assert dict(found.landmarks.bones) == names
    assert found.asked == ()
    assert found.notes == ()


@given(
    axis=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda each: np.linalg.norm(each) > 0.1),
    angle=st.floats(-3.1, 3.1),
    scale=st.floats(1e-4, 1e4),
    arms_down=st.floats(0.0, 1.5),
    scheme_name=st.sampled_from(["mixamo", "japanese", ""]),
)
def test_size_direction_and_pose_of_the_arms_change_nothing(
    axis: tuple[float, float, float], angle: float, scale: float, arms_down: float, scheme_name: str
) -> None:
    names = SCHEMES[scheme_name] if scheme_name else {each: number_name(each) for each in LANDMARKS}
    turn = to_matrix(from_axis_angle(np.array(axis) / np.linalg.norm(axis), angle))

    found = map_skeleton(humanoid(names, arms_down=arms_down, turn=turn, scale=scale))

    assert dict(found.landmarks.bones) == names


@pytest.mark.parametrize("lacking", sorted(OPTIONAL))
def test_a_bone_that_some_rigs_lack_is_left_out_and_nothing_else(lacking: str) -> None:
    part = lacking.partition(".")[0]
    without = frozenset(each for each in LANDMARKS if each.partition(".")[0] == part)
    names = SCHEMES["unreal"]

    found = map_skeleton(humanoid(names, without=without))

    assert found.asked == ()
    assert set(found.missing) == without
    assert all(found.landmarks[each] == names[each] for each in LANDMARKS if each not in without)


def test_what_was_told_by_shape_alone_is_said() -> None:
    by_shape = map_skeleton(humanoid())

    assert any("by their lengths" in note for note in by_shape.notes)


def test_without_names_and_feet_left_and_right_are_asked_and_not_guessed() -> None:
    # Feet that point straight down, like those of a doll.
    skeleton = humanoid(without=frozenset({"toe.L", "toe.R"}))
    matrices = skeleton.rest_matrices.copy()
    for side in "LR":
        foot = skeleton.index[number_name(f"foot.{side}")]
        matrices[foot, :3, :3] = matrices[skeleton.parents[foot], :3, :3]
        # Right below the hip, so that knees say nothing either.
        for part in ("shin", "foot"):
            matrices[skeleton.index[number_name(f"{part}.{side}")], 1, 3] = 0.0
    doll = skeleton_of(skeleton.names, skeleton.parents, list(matrices), list(skeleton.lengths))

    found = map_skeleton(doll)

    assert {"hand.L", "hand.R", "foot.L", "thigh.R"} <= set(found.asked)
    assert "left from right" in found.missing["hand.L"]
    assert "upper_arm.L" not in found.landmarks.bones


def test_a_missing_hand_is_asked_for_by_its_name() -> None:
    names = {**SCHEMES["unreal"], "hand.L": "claw_blade"}

    found = map_skeleton(humanoid(names))

    # The shape agrees with all other names, so it may say which bone is the hand.
    assert found.landmarks["hand.L"] == "claw_blade"

    found = map_skeleton(humanoid(SCHEMES["unreal"], without=frozenset({"hand.L"})))
    assert found.asked == ("hand.L",)
    assert found.missing["hand.L"]


def test_names_that_put_left_on_the_right_are_told_and_kept() -> None:
    names = SCHEMES["unreal"]
    swapped = {
        each: names[each[:-1] + ("R" if each.endswith("L") else "L")] if "." in each else name
        for each, name in names.items()
    }

    found = map_skeleton(humanoid(swapped))

    assert found.landmarks["hand.L"] == "hand_l"
    assert any("feet point backward" in note for note in found.notes)


def test_arms_and_legs_whose_names_contradict_each_other_are_asked_for() -> None:
    names = dict(SCHEMES["unreal"])
    for part in ("thigh", "shin", "foot", "toe"):
        names[f"{part}.L"], names[f"{part}.R"] = names[f"{part}.R"], names[f"{part}.L"]

    found = map_skeleton(humanoid(names))

    assert "hand.L" in found.asked
    assert "thigh.R" in found.asked
    assert "side of the right leg" in found.missing["hand.L"]


@pytest.mark.parametrize("arms", [4, 6, 8, 9])
def test_an_octopus_is_no_humanoid(arms: int) -> None:
    found = map_skeleton(body_with_arms(arms=arms)[0])

    assert found.problem.startswith("This is no humanoid")
    assert not found.landmarks.bones
    assert "hips" in found.asked


def test_bones_that_all_start_at_one_point_tell_nothing() -> None:
    matrices = [np.eye(4)] * len(PARENTS)
    names = list(SCHEMES["mixamo"].values())
    flat = skeleton_of(names, [-1, *[0] * (len(names) - 1)], matrices, [1.0] * len(names))

    assert map_skeleton(flat).problem == "All bones start at one point."


@pytest.mark.parametrize(
    "name",
    [
        *("IK-foot.l", "elbowIK.l", "PoleTargetL", "upperarm_twist_01_l", "lThumb1", "leftEye"),
        *("mixamorig:LeftHandIndex1", "HeadTop_End", "MCH-thigh_parent.L", "foot_spin_ik.L"),
        *("左足ＩＫ", "neckDummy", "LeftInHandIndex", "hand_tweak.L", "figureHair"),
    ],
)
def test_targets_twist_bones_and_fingers_are_no_landmarks(name: str) -> None:
    assert read_names([name])[0].weights == {}


@pytest.mark.parametrize(
    ("name", "side"),
    [
        *(("lForeArm", "L"), ("rforearm", "R"), ("LEFTARM", "L"), ("Arm_R", "R"), ("armleft", "L")),
        *(("左ひじ", "L"), ("Bip01 R Hand", "R"), ("RHipJoint", "R"), ("J_Bip_L_Hand", "L")),
        *(("L5", ""), ("leg", ""), ("Root", ""), ("lowerback", ""), ("rib", ""), ("left", "L")),
    ],
)
def test_side_of_a_name(name: str, side: str) -> None:
    assert read_names([name])[0].side == side


def test_fingers_beside_a_palm_do_not_hide_the_hand() -> None:
    """Three palm bones at one wrist: the one straight on is taken, and the artist is told."""
    skeleton = humanoid({**SCHEMES["vrm"], "hand.L": "Palm2.L"})
    wrist = skeleton.index["Palm2.L"]
    matrices = [*skeleton.rest_matrices]
    names, parents = [*skeleton.names], [*skeleton.parents]
    lengths = [*skeleton.lengths]
    for number, bend in ((1, 0.4), (3, -0.4)):
        turned = matrices[wrist].copy()
        turned[:3, :3] = (
            to_matrix(from_axis_angle(np.array([0.0, 0.0, 1.0]), bend)) @ turned[:3, :3]
        )
        matrices.append(turned)
        names.append(f"Palm{number}.L")
        parents.append(skeleton.parents[wrist])
        lengths.append(lengths[wrist])

    found = map_skeleton(skeleton_of(names, parents, matrices, lengths))

    assert found.landmarks["hand.L"] == "Palm2.L"
    assert found.notes == ("The left hand has 3 bones: 'Palm2.L' was taken.",)


def test_an_arm_without_collar_bone_begins_at_the_shoulder() -> None:
    names = SCHEMES["kinect"]
    without = frozenset({"clavicle.L", "clavicle.R"})

    found = map_skeleton(humanoid(names, without=without))

    assert found.landmarks["upper_arm.L"] == "ShoulderLeft"
    assert set(found.missing) == without


HELPERS = {
    # name of a bone by landmark, and what hangs beside or below it at the same place
    "unreal": ("upperarm_twist_01_{}", "upper_arm", "ik_hand_{}", "hand", "weapon_{}", "hand"),
    "japanese": ("{}腕捩", "upper_arm", "{}足ＩＫ", "foot", "{}足D", "thigh"),
    "vroid": ("J_Sec_{}_Bust1", "chest", "J_Sec_{}_SkirtSide0", "hips", "J_Adj_{}_Eye", "head"),
    "rigify": ("upper_arm_ik.{}", "upper_arm", "thigh_tweak.{}", "thigh", "heel.02.{}", "foot"),
}
WORDS = {"unreal": "lr", "japanese": "左右", "vroid": "LR", "rigify": "LR"}


@pytest.mark.parametrize("name", HELPERS)
def test_helpers_beside_the_bones_change_nothing(name: str) -> None:
    names = SCHEMES[name]
    skeleton = humanoid(names)
    all_names, parents = [*skeleton.names], [*skeleton.parents]
    matrices, lengths = [*skeleton.rest_matrices], [*skeleton.lengths]
    patterns = HELPERS[name]
    for pattern, landmark in zip(patterns[::2], patterns[1::2], strict=True):
        for side, word in zip("LR", WORDS[name], strict=True):
            bone = names.get(landmark) or names[f"{landmark}.{side}"]
            parents.append(skeleton.index[bone])
            all_names.append(pattern.replace("{}", word))
            matrices.append(matrices[skeleton.index[bone]])
            lengths.append(0.05)

    found = map_skeleton(skeleton_of(all_names, parents, matrices, lengths))

    assert dict(found.landmarks.bones) == names
    assert found.notes == ()


MMD = {
    # bone: parent, and the landmark whose place it has
    "全ての親": ("", "hips"),
    "センター": ("全ての親", "hips"),
    "グルーブ": ("センター", "hips"),
    "腰": ("グルーブ", "hips"),
    "上半身": ("腰", "spine"),
    "上半身2": ("上半身", "chest"),
    "首": ("上半身2", "neck"),
    "頭": ("首", "head"),
    "両目": ("頭", "head"),
    "下半身": ("腰", "hips"),
    **{
        name.replace("?", side): (parent.replace("?", side), f"{landmark}.{letter}")
        for side, letter in (("左", "L"), ("右", "R"))
        for name, parent, landmark in (
            *(("?肩P", "上半身2", "clavicle"), ("?肩", "?肩P", "clavicle")),
            *(("?肩C", "?肩", "upper_arm"), ("?腕", "?肩C", "upper_arm")),
            *(("?腕捩", "?腕", "middle of upper_arm"), ("?ひじ", "?腕捩", "forearm")),
            *(("?手捩", "?ひじ", "middle of forearm"), ("?手首", "?手捩", "hand")),
            *(("?親指０", "?手首", "end of hand"), ("?人指１", "?手首", "end of hand")),
            *(("腰キャンセル?", "下半身", "thigh"), ("?足", "腰キャンセル?", "thigh")),
            *(("?ひざ", "?足", "shin"), ("?足首", "?ひざ", "foot"), ("?つま先", "?足首", "toe")),
            *(("?足D", "腰キャンセル?", "thigh"), ("?ひざD", "?足D", "shin")),
            *(("?足首D", "?ひざD", "foot"), ("?足先EX", "?足首D", "toe")),
            *(("?足IK親", "全ての親", "foot"), ("?足ＩＫ", "?足IK親", "foot")),
            ("?つま先ＩＫ", "?足ＩＫ", "toe"),
        )
    },
}
"""The usual skeleton of a dancer, with all that moves it."""


def test_the_usual_dancer_is_known_among_all_that_moves_it() -> None:
    body = humanoid({each: each for each in LANDMARKS})
    places = [MMD[name][1] for name in MMD]
    rows = [body.index[place.split()[-1]] for place in places]
    matrices = [body.rest_matrices[row].copy() for row in rows]
    for matrix, place, row in zip(matrices, places, rows, strict=True):
        share = {"middle": 0.5, "end": 1.0}.get(place.split()[0], 0.0)
        matrix[:3, 3] += share * body.lengths[row] * matrix[:3, 1]
    index = {name: number for number, name in enumerate(MMD)}
    parents = [index.get(parent, -1) for parent, _ in MMD.values()]
    lengths = [float(body.lengths[row]) for row in rows]

    found = map_skeleton(skeleton_of(list(MMD), parents, matrices, lengths))

    names = dict(SCHEMES["japanese"], hips="腰")
    assert dict(found.landmarks.bones) == names
    assert found.notes == ()


@pytest.mark.parametrize(
    ("name", "side", "landmark"),
    [
        *(("腕.R", "R", "upper_arm"), ("ひじ_左", "L", "forearm"), ("足左", "L", "thigh")),
        *(("右ヒジ", "R", "forearm"), ("右ﾋｻﾞ", "R", "shin"), ("左ツマ先", "L", "toe")),
        *(("右大腿部", "R", "thigh"), ("左股関節", "L", "thigh"), ("右足先", "R", "toe")),
        *(("みぎひじ", "R", "forearm"), ("左鎖骨", "L", "clavicle"), ("骨盤", "", "hips")),
        *(("胸部", "", "chest"), ("頭部", "", "head"), ("右太腿", "R", "thigh")),
    ],
)
def test_japanese_names_are_known_in_any_kana_and_with_the_side_at_either_end(
    name: str, side: str, landmark: str
) -> None:
    (found,) = read_names([name])
    assert found.side == side
    assert max(found.weights, key=lambda each: found.weights[each]) == landmark


@pytest.mark.parametrize(
    "name", ["右腕捩", "左手捩", "右親指０", "左人指１", "右ダミー", "全ての親"]
)
def test_japanese_twist_bones_and_fingers_are_no_landmarks(name: str) -> None:
    (found,) = read_names([name])
    assert found.machinery
    assert found.weights == {}


@given(seed=st.integers(0, 1000), scale=st.floats(1e-3, 1e3))
def test_a_body_is_as_tall_whatever_its_rest_pose_is(seed: int, scale: float) -> None:
    """Its thighs begin at 0.95, its head's joint is at 1.58, its ankles are at 0.1."""
    body = humanoid({each: each for each in LANDMARKS}, scale=scale)
    landmarks = Landmarks({each: each for each in LANDMARKS})
    height = stature(body, landmarks)
    assert height == pytest.approx(scale * (1.58 - 0.1) / 0.88, rel=0.005)
    turns = np.random.default_rng(seed).normal(size=(len(body), 4))
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    assert stature(with_rest_pose(body, turns), landmarks) == pytest.approx(height, rel=1e-9)


@pytest.mark.parametrize("lacking", ["head", "foot.L", "thigh.R"])
def test_how_tall_a_body_is_cannot_be_told_without_legs_and_head(lacking: str) -> None:
    body = humanoid({each: each for each in LANDMARKS})
    bones = {each: each for each in LANDMARKS if each != lacking}
    assert stature(body, Landmarks(bones)) is None
    assert stature(body, Landmarks(bones | {lacking: "gone"})) is None
