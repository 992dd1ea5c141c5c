# SPDX-License-Identifier: GPL-3.0-or-later
"""Skeletons as programs and people make them: names, order of parents, twist bones, helpers."""

from tests.core.strangers import Bone, kind

_FINGERS = ("Thumb", "Index", "Middle", "Ring", "Pinky")


def fingers(hand: str, pattern: str, names: tuple[str, ...], count: int = 3, first: int = 1) -> str:
    """Chains of fingers; "#" stands for the finger, "%" for its number."""
    keys = ("thumb", "index", "middle", "ring", "pinky")
    lines = []
    for name, key in zip(names, keys, strict=True):
        words = (
            pattern.replace("#", name).replace("%", str(first + n)) + f"@{key}{n}"
            for n in range(count)
        )
        lines.append(f"{hand} {' '.join(words)}")
    return "\n".join(lines)


KINDS: dict[str, tuple[Bone, ...]] = {
    "mixamo": kind(
        """
- mixamorig:Hips@hips mixamorig:Spine@s1 mixamorig:Spine1@s4 mixamorig:Spine2@chest
  mixamorig:Neck@neck mixamorig:Head@head mixamorig:HeadTop_End@top
mixamorig:Spine2 mixamorig:{}Shoulder@clavicle mixamorig:{}Arm@upper_arm
  mixamorig:{}ForeArm@forearm mixamorig:{}Hand@hand
mixamorig:Hips mixamorig:{}UpLeg@thigh mixamorig:{}Leg@shin mixamorig:{}Foot@foot
  mixamorig:{}ToeBase@toe mixamorig:{}Toe_End@tip
"""
        + fingers("mixamorig:{}Hand", "mixamorig:{}Hand#%", _FINGERS, 4),
        *("Left", "Right"),
    ),
    "biped, triangles": kind(
        """
- Bip01@hips Bip01~Pelvis@hips Bip01~Spine@s1 Bip01~Spine1@s4 Bip01~Spine2@chest Bip01~Neck@neck
  Bip01~Head@head Bip01~HeadNub@top
Bip01~Neck Bip01~{}~Clavicle@clavicle Bip01~{}~UpperArm@upper_arm Bip01~{}~Forearm@forearm
  Bip01~{}~Hand@hand Bip01~{}~Finger0@index0 Bip01~{}~Finger0Nub@index1
Bip01~Spine Bip01~{}~Thigh@thigh Bip01~{}~Calf@shin Bip01~{}~Foot@foot Bip01~{}~Toe0@toe
  Bip01~{}~Toe0Nub@tip
Bip01 Bip01~Footsteps@root
""",
        *("L", "R"),
    ),
    "biped 001": kind(
        """
- Bip001@hips Bip001~Pelvis@hips Bip001~Spine@s1 Bip001~Spine1@chest Bip001~Neck@neck
  Bip001~Head@head
Bip001~Spine1 Bip001~{}~Clavicle@clavicle Bip001~{}~UpperArm@upper_arm Bip001~{}~Forearm@forearm
  Bip001~{}~Hand@hand Bip001~{}~Finger0@thumb0 Bip001~{}~Finger01@thumb1
Bip001~{}~Hand Bip001~{}~Finger1@index0 Bip001~{}~Finger11@index1
Bip001~{}~UpperArm Bip001~{}UpArmTwist@upper_arm Bip001~{}UpArmTwist1@upper_arm_middle
Bip001~{}~Forearm Bip001~{}~ForeTwist@forearm Bip001~{}~ForeTwist1@forearm_middle
Bip001~Pelvis Bip001~{}~Thigh@thigh Bip001~{}~Calf@shin Bip001~{}~Foot@foot Bip001~{}~Toe0@toe
Bip001 Bip001~Prop1@root
""",
        *("L", "R"),
    ),
    "character creator": kind(
        """
- RL_BoneRoot@root CC_Base_Hip@hips CC_Base_Waist@s1 CC_Base_Spine01@s4 CC_Base_Spine02@chest
  CC_Base_NeckTwist01@neck CC_Base_NeckTwist02@neck2 CC_Base_Head@head CC_Base_FacialBone@jaw
  CC_Base_JawRoot@jaw CC_Base_Tongue01@jaw
CC_Base_Hip CC_Base_Pelvis@seat
CC_Base_FacialBone CC_Base_{}_Eye@eye
CC_Base_Spine02 CC_Base_{}_RibsTwist@bust CC_Base_{}_Breast@bust
CC_Base_Spine02 CC_Base_{}_Clavicle@clavicle CC_Base_{}_Upperarm@upper_arm
  CC_Base_{}_Forearm@forearm CC_Base_{}_Hand@hand
CC_Base_{}_Upperarm CC_Base_{}_UpperarmTwist01@upper_arm CC_Base_{}_UpperarmTwist02@upper_arm_middle
CC_Base_{}_Forearm CC_Base_{}_ForearmTwist01@forearm CC_Base_{}_ForearmTwist02@forearm_middle
CC_Base_{}_Forearm CC_Base_{}_ElbowShareBone@forearm
CC_Base_Pelvis CC_Base_{}_Thigh@thigh CC_Base_{}_Calf@shin CC_Base_{}_Foot@foot
  CC_Base_{}_ToeBase@toe CC_Base_{}_BigToe1@tip
CC_Base_{}_Thigh CC_Base_{}_ThighTwist01@thigh CC_Base_{}_ThighTwist02@thigh_middle
CC_Base_{}_Calf CC_Base_{}_CalfTwist01@shin CC_Base_{}_CalfTwist02@shin_middle
CC_Base_{}_Calf CC_Base_{}_KneeShareBone@shin
CC_Base_{}_Foot CC_Base_{}_ToeBaseShareBone@toe
"""
        + fingers("CC_Base_{}_Hand", "CC_Base_{}_#%", ("Thumb", "Index", "Mid", "Ring", "Pinky")),
        *("L", "R"),
    ),
    "unreal 4": kind(
        """
- root@root pelvis@hips spine_01@s1 spine_02@s4 spine_03@chest neck_01@neck head@head
spine_03 clavicle_{}@clavicle upperarm_{}@upper_arm lowerarm_{}@forearm hand_{}@hand
upperarm_{} upperarm_twist_01_{}@upper_arm
lowerarm_{} lowerarm_twist_01_{}@forearm_middle
pelvis thigh_{}@thigh calf_{}@shin foot_{}@foot ball_{}@toe
thigh_{} thigh_twist_01_{}@thigh
calf_{} calf_twist_01_{}@shin_middle
root ik_foot_root@root
ik_foot_root ik_foot_{}@foot
root ik_hand_root@root ik_hand_gun@root
ik_hand_gun ik_hand_{}@hand
"""
        + fingers("hand_{}", "#_0%_{}", ("thumb", "index", "middle", "ring", "pinky")),
        *("l", "r"),
    ),
    "unreal 5": kind(
        """
- root@root pelvis@hips spine_01@s1 spine_02@s2 spine_03@s4 spine_04@s6 spine_05@chest
  neck_01@neck neck_02@neck2 head@head
spine_05 clavicle_{}@clavicle upperarm_{}@upper_arm lowerarm_{}@forearm hand_{}@hand
clavicle_{} clavicle_out_{}@clavicle
clavicle_{} clavicle_scap_{}@clavicle
upperarm_{} upperarm_twist_01_{}@upper_arm_middle upperarm_twistCor_01_{}@upper_arm_middle
upperarm_{} upperarm_correctiveRoot_{}@upper_arm upperarm_bck_{}@upper_arm
lowerarm_{} lowerarm_correctiveRoot_{}@forearm lowerarm_in_{}@forearm
lowerarm_{} lowerarm_twist_02_{}@forearm_middle
hand_{} wrist_inner_{}@hand
hand_{} index_metacarpal_{}@hand index_01_{}@index0 index_02_{}@index1 index_03_{}@index2
hand_{} middle_metacarpal_{}@hand middle_01_{}@middle0 middle_02_{}@middle1
hand_{} thumb_01_{}@thumb0 thumb_02_{}@thumb1 thumb_03_{}@thumb2
pelvis thigh_{}@thigh calf_{}@shin foot_{}@foot ball_{}@toe bigtoe_01_{}@tip
thigh_{} thigh_correctiveRoot_{}@thigh thigh_fwd_{}@thigh
thigh_{} thigh_twist_01_{}@thigh_middle
calf_{} calf_correctiveRoot_{}@shin calf_kneeBack_{}@shin
foot_{} ankle_bck_{}@foot
root interaction@root
root center_of_mass@root
root ik_foot_root@root
ik_foot_root ik_foot_{}@foot
""",
        *("l", "r"),
    ),
    "smpl": kind(
        """
- root@root Pelvis@hips Spine1@s1 Spine2@s4 Spine3@chest Neck@neck Head@head
Spine3 {}_Collar@clavicle {}_Shoulder@upper_arm {}_Elbow@forearm {}_Wrist@hand {}_Hand@index1
Pelvis {}_Hip@thigh {}_Knee@shin {}_Ankle@foot {}_Foot@toe
""",
        *("L", "R"),
    ),
    "smpl, average": kind(
        """
- m_avg_root@root m_avg_Pelvis@hips m_avg_Spine1@s1 m_avg_Spine2@s4 m_avg_Spine3@chest
  m_avg_Neck@neck m_avg_Head@head
m_avg_Spine3 m_avg_{}_Collar@clavicle m_avg_{}_Shoulder@upper_arm m_avg_{}_Elbow@forearm
  m_avg_{}_Wrist@hand m_avg_{}_Hand@index1
m_avg_Pelvis m_avg_{}_Hip@thigh m_avg_{}_Knee@shin m_avg_{}_Ankle@foot m_avg_{}_Foot@toe
""",
        *("L", "R"),
    ),
    "smpl-x": kind(
        """
- root@root pelvis@hips spine1@s1 spine2@s4 spine3@chest neck@neck head@head jaw@jaw
head {}_eye_smplhf@eye
spine3 {}_collar@clavicle {}_shoulder@upper_arm {}_elbow@forearm {}_wrist@hand
pelvis {}_hip@thigh {}_knee@shin {}_ankle@foot {}_foot@toe
"""
        + fingers("{}_wrist", "{}_#%", ("thumb", "index", "middle", "ring", "pinky")),
        *("left", "right"),
    ),
    "rokoko": kind(
        """
- Hips@hips Spine1@s1 Spine2@s2 Spine3@s4 Spine4@chest Neck@neck Head@head
Spine4 {}Shoulder@clavicle {}Arm@upper_arm {}ForeArm@forearm {}Hand@hand
Hips {}Thigh@thigh {}Shin@shin {}Foot@foot {}Toe@toe {}ToeTip@tip
"""
        + fingers("{}Hand", "{}Finger#%", ("1", "2", "3", "4", "5")),
        *("Left", "Right"),
    ),
    "xsens": kind(
        """
- Hips@hips Chest@s1 Chest2@s3 Chest3@s5 Chest4@chest Neck@neck Head@head
Chest4 {}Collar@clavicle {}Shoulder@upper_arm {}Elbow@forearm {}Wrist@hand
Hips {}Hip@thigh {}Knee@shin {}Ankle@foot {}Toe@toe
""",
        *("Left", "Right"),
    ),
    "xsens, fbx": kind(
        """
- Reference@root Pelvis@hips L5@s1 L3@s3 T12@s5 T8@chest Neck@neck Head@head
T8 {}Shoulder@clavicle {}UpperArm@upper_arm {}ForeArm@forearm {}Hand@hand
Pelvis {}UpperLeg@thigh {}LowerLeg@shin {}Foot@foot {}Toe@toe
""",
        *("Left", "Right"),
    ),
    "neuron": kind(
        """
- Robot_Hips@hips Robot_Spine@s1 Robot_Spine1@s4 Robot_Spine2@chest Robot_Neck@neck
  Robot_Neck1@neck2 Robot_Head@head
Robot_Spine2 Robot_{}Shoulder@clavicle Robot_{}Arm@upper_arm Robot_{}ForeArm@forearm
  Robot_{}Hand@hand
Robot_Hips Robot_{}UpLeg@thigh Robot_{}Leg@shin Robot_{}Foot@foot
"""
        + fingers("Robot_{}Hand", "Robot_{}Hand#%", _FINGERS),
        *("Left", "Right"),
    ),
    "motive": kind(
        """
- Skeleton_001@root Skeleton_001_Hip@hips Skeleton_001_Ab@s1 Skeleton_001_Chest@chest
  Skeleton_001_Neck@neck Skeleton_001_Head@head
Skeleton_001_Chest Skeleton_001_{}Shoulder@clavicle Skeleton_001_{}UArm@upper_arm
  Skeleton_001_{}FArm@forearm Skeleton_001_{}Hand@hand
Skeleton_001_Hip Skeleton_001_{}Thigh@thigh Skeleton_001_{}Shin@shin Skeleton_001_{}Foot@foot
  Skeleton_001_{}Toe@toe
""",
        *("L", "R"),
    ),
    "kinect azure": kind(
        """
- PELVIS@hips SPINE_NAVEL@s1 SPINE_CHEST@chest NECK@neck HEAD@head NOSE@nose
HEAD EYE_{}@eye
HEAD EAR_{}@eye
SPINE_CHEST CLAVICLE_{}@clavicle SHOULDER_{}@upper_arm ELBOW_{}@forearm WRIST_{}@hand
  HAND_{}@index0 HANDTIP_{}@index2
WRIST_{} THUMB_{}@thumb1
PELVIS HIP_{}@thigh KNEE_{}@shin ANKLE_{}@foot FOOT_{}@toe
""",
        *("LEFT", "RIGHT"),
    ),
    "human ik": kind(
        """
- Character1_Reference@root Character1_Hips@hips Character1_Spine@s1 Character1_Spine1@s4
  Character1_Spine2@chest Character1_Neck@neck Character1_Head@head
Character1_Spine2 Character1_{}Shoulder@clavicle Character1_{}Arm@upper_arm
  Character1_{}ForeArm@forearm Character1_{}Hand@hand
Character1_{}Arm Character1_{}ArmRoll@upper_arm_middle
Character1_{}ForeArm Character1_{}ForeArmRoll@forearm_middle
Character1_Hips Character1_{}UpLeg@thigh Character1_{}Leg@shin Character1_{}Foot@foot
  Character1_{}ToeBase@toe
""",
        *("Left", "Right"),
    ),
    "genesis 8": kind(
        """
- hip@hips abdomenLower@s1 abdomenUpper@s3 chestLower@s5 chestUpper@chest neckLower@neck
  neckUpper@neck2 head@head
hip pelvis@seat
chestUpper {}Pectoral@bust
chestUpper {}Collar@clavicle {}ShldrBend@upper_arm {}ShldrTwist@upper_arm_middle
  {}ForearmBend@forearm {}ForearmTwist@forearm_middle {}Hand@hand
{}Hand {}Thumb1@thumb0 {}Thumb2@thumb1
{}Hand {}Carpal1@hand {}Index1@index0 {}Index2@index1
{}Hand {}Carpal2@hand {}Mid1@middle0 {}Mid2@middle1
pelvis {}ThighBend@thigh {}ThighTwist@thigh_middle {}Shin@shin {}Foot@foot {}Metatarsals@foot
  {}Toe@toe {}BigToe@tip
""",
        *("l", "r"),
    ),
    "genesis 9": kind(
        """
- hip@hips spine1@s1 spine2@s3 spine3@s5 spine4@chest neck1@neck neck2@neck2 head@head
hip pelvis@seat
spine4 {}_pectoral@bust
spine4 {}_shoulder@clavicle {}_upperarm@upper_arm {}_forearm@forearm {}_hand@hand
{}_upperarm {}_upperarmtwist1@upper_arm
{}_upperarm {}_upperarmtwist2@upper_arm_middle
{}_forearm {}_forearmtwist1@forearm
{}_forearm {}_forearmtwist2@forearm_middle
{}_hand {}_indexmetacarpal@hand {}_index1@index0
{}_hand {}_thumb1@thumb0 {}_thumb2@thumb1
pelvis {}_thigh@thigh {}_shin@shin {}_foot@foot {}_metatarsal@foot {}_toes@toe {}_bigtoe1@tip
{}_thigh {}_thightwist1@thigh
{}_thigh {}_thightwist2@thigh_middle
""",
        *("l", "r"),
    ),
    "auto-rig pro": kind(
        """
- root.x@hips spine_01.x@s1 spine_02.x@chest neck.x@neck head.x@head
spine_02.x shoulder.{}@clavicle arm_stretch.{}@upper_arm forearm_stretch.{}@forearm hand.{}@hand
shoulder.{} arm_twist.{}@upper_arm
forearm_stretch.{} forearm_twist.{}@forearm_middle
root.x thigh_stretch.{}@thigh leg_stretch.{}@shin foot.{}@foot toes_01.{}@toe
root.x thigh_twist.{}@thigh
leg_stretch.{} leg_twist.{}@shin_middle
"""
        + fingers("hand.{}", "#%.{}", ("thumb", "index", "middle", "ring", "pinky")),
        *("l", "r"),
    ),
    "game characters": kind(
        """
- Root@root Hips@hips Spine_01@s1 Spine_02@s4 Spine_03@chest Neck@neck Head@head Eyes@eye
Spine_03 Clavicle_{}@clavicle Shoulder_{}@upper_arm Elbow_{}@forearm Hand_{}@hand
  IndexFinger_01_{}@index0 IndexFinger_02_{}@index1
Hand_{} Finger_01_{}@middle0 Finger_02_{}@middle1
Hand_{} Thumb_01_{}@thumb0 Thumb_02_{}@thumb1
Hips UpperLeg_{}@thigh LowerLeg_{}@shin Ankle_{}@foot Ball_{}@toe Toes_{}@tip
""",
        *("L", "R"),
    ),
    "avatar with volumes": kind(
        """
- mPelvis@hips mTorso@s1 mChest@chest mNeck@neck mHead@head mSkull@top
mPelvis PELVIS@seat
mPelvis BUTT@seat
mTorso BELLY@s2
mChest CHEST@chest
mNeck NECK@neck
mHead HEAD@head
mHead mEye{}@eye
mChest mCollar{}@clavicle mShoulder{}@upper_arm mElbow{}@forearm mWrist{}@hand
mPelvis mHip{}@thigh mKnee{}@shin mAnkle{}@foot mFoot{}@toe mToe{}@tip
""",
        *("Left", "Right"),
    ),
    "roblox": kind(
        """
- HumanoidRootNode@root LowerTorso@hips UpperTorso@chest Head@head
UpperTorso {}UpperArm@upper_arm {}LowerArm@forearm {}Hand@hand
LowerTorso {}UpperLeg@thigh {}LowerLeg@shin {}Foot@foot
""",
        *("Left", "Right"),
    ),
    "chat avatar": kind(
        """
- Armature@root Hips@hips Spine@s1 Chest@chest Neck@neck Head@head LeftEye@eye
Head Hair~root@top Hair~front~1@top Hair~front~2@nose
Chest Breast~{}@bust
Chest {}~shoulder@clavicle {}~arm@upper_arm {}~elbow@forearm {}~wrist@hand
Hips {}~leg@thigh {}~knee@shin {}~ankle@foot {}~toe@toe
"""
        + fingers(
            "{}~wrist",
            "#%_{}",
            ("Thumb", "IndexFinger", "MiddleFinger", "RingFinger", "LittleFinger"),
        ),
        *("Left", "Right"),
    ),
    "deep motion": kind(
        """
- root_JNT@root hips_JNT@hips spine_JNT@s1 spine1_JNT@s4 spine2_JNT@chest neck_JNT@neck
  head_JNT@head
spine2_JNT {}_shoulder_JNT@clavicle {}_arm_JNT@upper_arm {}_forearm_JNT@forearm {}_hand_JNT@hand
  {}_handIndex1_JNT@index0
hips_JNT {}_upleg_JNT@thigh {}_leg_JNT@shin {}_foot_JNT@foot {}_toebase_JNT@toe
""",
        *("l", "r"),
    ),
    "advanced skeleton": kind(
        """
- Root_M@hips RootPart1_M@s1 Spine1_M@s2 Spine1Part1_M@s3 Chest_M@chest Neck_M@neck
  NeckPart1_M@neck2 Head_M@head Jaw_M@jaw
Head_M Eye_{}@eye
Chest_M Scapula_{}@clavicle Shoulder_{}@upper_arm ShoulderPart1_{}@upper_arm_middle
  Elbow_{}@forearm ElbowPart1_{}@forearm_middle Wrist_{}@hand IndexFinger1_{}@index0
  IndexFinger2_{}@index1
Root_M Hip_{}@thigh HipPart1_{}@thigh_middle Knee_{}@shin KneePart1_{}@shin_middle Ankle_{}@foot
  Toes_{}@toe ToesEnd_{}@tip
""",
        *("L", "R"),
    ),
    "xnalara": kind(
        """
- root~ground@root root~hips@hips spine~lower@s1 spine~middle@s4 spine~upper@chest
  head~neck~lower@neck head~neck~upper@head
root~hips pelvis@seat
spine~upper arm~{}~shoulder~1@clavicle arm~{}~shoulder~2@upper_arm arm~{}~elbow@forearm
  arm~{}~wrist@hand arm~{}~finger~1a@thumb0 arm~{}~finger~1b@thumb1
arm~{}~wrist arm~{}~finger~2a@index0 arm~{}~finger~2b@index1
pelvis leg~{}~thigh@thigh leg~{}~knee@shin leg~{}~ankle@foot leg~{}~toes@toe
""",
        *("left", "right"),
    ),
    "acclaim": kind(
        """
- root@hips lowerback@s1 upperback@s4 thorax@chest lowerneck@neck upperneck@neck2 head@head
thorax {}clavicle@clavicle {}humerus@upper_arm {}radius@forearm {}wrist@hand {}hand@index0
  {}fingers@index1
{}hand {}thumb@thumb0
root {}hipjoint@hip_joint {}femur@thigh {}tibia@shin {}foot@foot {}toes@toe
""",
        *("l", "r"),
    ),
    "markerless": kind(
        """
- worldbody@root pelvis@hips torso@chest head@head
torso {}_uarm@upper_arm {}_larm@forearm {}_hand@hand
pelvis {}_thigh@thigh {}_shank@shin {}_foot@foot {}_toes@toe
""",
        *("l", "r"),
    ),
    "captury": kind(
        """
- Root@root Hips@hips Spine@s1 Spine1@s2 Spine2@s4 Spine3@s6 Spine4@chest Neck@neck Head@head
  HeadEE@top
Spine4 {}Shoulder@clavicle {}Arm@upper_arm {}ForeArm@forearm {}Hand@hand {}HandEE@index1
Hips {}UpLeg@thigh {}Leg@shin {}Foot@foot {}ToeBase@toe {}FootEE@tip
""",
        *("Left", "Right"),
    ),
    "names of bones": kind(
        """
- pelvis@hips lumbar@s1 thoracic@chest cervical@neck skull@head
thoracic {}_scapula@clavicle {}_humerus@upper_arm {}_ulna@forearm {}_carpals@hand
pelvis {}_femur@thigh {}_tibia@shin {}_talus@foot {}_toes@toe
""",
        *("left", "right"),
    ),
    "numbers": kind(
        """
- Bone@hips Bone.001@s1 Bone.002@chest Bone.003@neck Bone.004@head
Bone.002 Bone.{}10@clavicle Bone.{}11@upper_arm Bone.{}12@forearm Bone.{}13@hand
Bone Bone.{}20@thigh Bone.{}21@shin Bone.{}22@foot Bone.{}23@toe
""",
        *("0", "1"),
    ),
    "german": kind(
        """
- Becken@hips Wirbel1@s1 Brustkorb@chest Hals@neck Kopf@head
Brustkorb Schulter_{}@clavicle Oberarm_{}@upper_arm Unterarm_{}@forearm Hand_{}@hand
Becken Oberschenkel_{}@thigh Unterschenkel_{}@shin Fuss_{}@foot Zehen_{}@toe
""",
        *("L", "R"),
    ),
    "rigify, deform bones": kind(
        """
- root@root DEF-spine@hips DEF-spine.001@s1 DEF-spine.002@s4 DEF-spine.003@chest
  DEF-spine.004@neck DEF-spine.005@neck2 DEF-spine.006@head
DEF-spine.003 DEF-shoulder.{}@clavicle DEF-upper_arm.{}@upper_arm
  DEF-upper_arm.{}.001@upper_arm_middle DEF-forearm.{}@forearm
  DEF-forearm.{}.001@forearm_middle DEF-hand.{}@hand DEF-f_index.01.{}@index0
DEF-spine.003 DEF-breast.{}@bust
DEF-spine DEF-pelvis.{}@hips
DEF-spine DEF-thigh.{}@thigh DEF-thigh.{}.001@thigh_middle DEF-shin.{}@shin
  DEF-shin.{}.001@shin_middle DEF-foot.{}@foot DEF-toe.{}@toe
""",
        *("L", "R"),
    ),
    "french": kind(
        """
- bassin@hips colonne@s1 poitrine@chest cou@neck tête@head
poitrine clavicule_{}@clavicle bras_{}@upper_arm avant_bras_{}@forearm main_{}@hand
bassin cuisse_{}@thigh jambe_{}@shin pied_{}@foot orteils_{}@toe
""",
        *("gauche", "droite"),
    ),
    "spanish": kind(
        """
- cadera@hips columna@s1 pecho@chest cuello@neck cabeza@head
pecho clavicula_{}@clavicle brazo_{}@upper_arm antebrazo_{}@forearm mano_{}@hand
cadera muslo_{}@thigh pierna_{}@shin pie_{}@foot
""",
        *("izq", "der"),
    ),
    "portuguese": kind(
        """
- quadril@hips coluna@s1 peito@chest pescoço@neck cabeça@head
peito ombro_{}@clavicle braço_{}@upper_arm antebraço_{}@forearm mão_{}@hand
quadril coxa_{}@thigh perna_{}@shin pé_{}@foot
""",
        *("esquerdo", "direito"),
    ),
    "italian": kind(
        """
- bacino@hips colonna@s1 torace@chest collo@neck testa@head
torace clavicola_{}@clavicle braccio_{}@upper_arm avambraccio_{}@forearm mano_{}@hand
bacino coscia_{}@thigh gamba_{}@shin piede_{}@foot
""",
        *("sx", "dx"),
    ),
    "chinese": kind(
        """
- 骨盆@hips 脊椎@s1 胸@chest 颈@neck 头@head
胸 {}锁骨@clavicle {}上臂@upper_arm {}前臂@forearm {}手@hand
骨盆 {}大腿@thigh {}小腿@shin {}脚@foot {}脚趾@toe
""",
        *("左", "右"),
    ),
}

# What a landmark's bone should be where it is not the first one with the place of its name.
EXPECTED: dict[str, dict[str, str]] = {
    # Both legs and trunk hang on it.
    "biped, triangles": {"hips": "Bip01 Spine"},
    "biped 001": {"hips": "Bip001 Pelvis"},
}
