# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bones of a rig are limbs of a puppet."""

from dataclasses import replace

import numpy as np
import pytest

from octo_motion.core.errors import RigError
from octo_motion.core.posing.puppet.bone_roles import RigFacts, find_roles, is_helper_name
from octo_motion.core.skeleton import Skeleton
from tests.core.humanoids import PARENTS, humanoid
from tests.core.rigs import body_with_arms, bone_matrix, skeleton_of

LANDMARKS = {name: name for name in PARENTS}


def with_bone(
    skeleton: Skeleton,
    name: str,
    parent: str,
    *,
    head: tuple[float, float, float],
    way: tuple[float, float, float] = (0.0, 0.0, 0.1),
) -> Skeleton:
    """The skeleton with one more bone."""
    direction = np.array(way)
    return skeleton_of(
        [*skeleton.names, name],
        [*skeleton.parents, skeleton.index[parent] if parent else -1],
        [*skeleton.rest_matrices, bone_matrix(np.array(head), direction, 0.0)],
        [*skeleton.lengths, float(np.linalg.norm(direction))],
    )


def limbs(skeleton: Skeleton, facts: RigFacts | None = None) -> set[str]:
    roles = find_roles(skeleton, facts or RigFacts())
    return {skeleton.names[bone] for bone in roles.bodies}


def hangs_on(skeleton: Skeleton, bone: str, facts: RigFacts | None = None) -> str | None:
    roles = find_roles(skeleton, facts or RigFacts())
    bodies = [skeleton.names[each] for each in roles.bodies]
    parent = roles.parents[bodies.index(bone)]
    return bodies[parent] if parent >= 0 else None


def test_every_bone_of_a_plain_body_is_a_limb_and_hangs_on_its_parent() -> None:
    body = humanoid(LANDMARKS)
    roles = find_roles(body, RigFacts())
    assert limbs(body) == set(body.names)
    for number, bone in enumerate(roles.bodies):
        parent = body.parents[bone]
        assert roles.parents[number] == (roles.bodies.index(parent) if parent >= 0 else -1)
        assert roles.parents[number] < number


@pytest.mark.parametrize(
    "name",
    [
        *("forearm_twist.L", "LeftForeArmRoll", "handIK.l", "PoleTargetR", "control-heel-roll.l"),
        *("joint37_R_04_scaleCompensation", "index_04_leaf_l", "HeadTop_End", "handslot.r"),
        *("eye.L", "Jaw", "Tongue2", "orbicularis03.R", "MCH-spine", "mixamorig:LeftEye"),
    ],
)
def test_helper_follows_what_it_hangs_on(name: str) -> None:
    assert is_helper_name(name)
    body = with_bone(humanoid(LANDMARKS), name, "forearm.L", head=(0.5, 0.0, 1.46))
    roles = find_roles(body, RigFacts())
    assert name not in limbs(body)
    assert body.names[roles.bodies[roles.follows[body.index[name]]]] == "forearm.L"


@pytest.mark.parametrize(
    "name",
    ["Bone.002", "arm1.01.L", "mixamorig:LeftForeArm", "hand.l", "Head", "Spine1", "tail_03"],
)
def test_name_of_a_limb_is_not_taken_for_a_helpers(name: str) -> None:
    assert not is_helper_name(name)


def test_rig_all_of_whose_bones_are_called_like_helpers_is_posed_nevertheless() -> None:
    body = humanoid({name: f"ctrl_{name}" for name in PARENTS})
    assert len(limbs(body)) == len(body)


def test_bone_without_length_follows() -> None:
    body = with_bone(humanoid(LANDMARKS), "dot", "forearm.L", head=(0.5, 0, 1.46), way=(0, 0, 1e-5))
    assert "dot" not in limbs(body)


def test_fingers_follow_where_the_artist_raises_the_smallest_bone() -> None:
    body = with_bone(
        humanoid(LANDMARKS), "finger.L", "hand.L", head=(0.8, 0, 1.46), way=(0.03, 0, 0)
    )
    assert "finger.L" in limbs(body)
    assert "finger.L" not in limbs(body, RigFacts(smallest=0.02))


def test_bones_without_skin_follow_where_there_is_a_skin() -> None:
    body = with_bone(humanoid(LANDMARKS), "weapon_rail", "hand.L", head=(0.8, 0, 1.46))
    skin = dict.fromkeys(LANDMARKS, 1.0)
    assert limbs(body, RigFacts(weights=skin)) == set(LANDMARKS)


def test_bones_that_do_not_deform_follow() -> None:
    body = with_bone(humanoid(LANDMARKS), "lever", "hand.L", head=(0.8, 0, 1.46))
    deform = tuple(name != "lever" for name in body.names)
    assert "lever" not in limbs(replace(body, deform=deform))


def test_what_joins_several_limbs_is_a_body_even_without_skin() -> None:
    octopus, arms, _ = body_with_arms()
    skin = {bone: 1.0 for arm in arms for bone in arm.bones}
    assert "root" in limbs(octopus, RigFacts(weights=skin))
    assert hangs_on(octopus, arms[3].bones[0], RigFacts(weights=skin)) == "root"


def test_root_on_the_ground_that_carries_the_hips_alone_follows_nothing() -> None:
    body = humanoid(LANDMARKS)
    rooted = skeleton_of(
        ["root", *body.names],
        [-1, *(parent + 1 for parent in body.parents)],
        [bone_matrix(np.zeros(3), np.array([0.0, -0.5, 0.0]), 0.0), *body.rest_matrices],
        [0.5, *body.lengths],
    )
    roles = find_roles(rooted, RigFacts(weights=dict.fromkeys(LANDMARKS, 1.0)))
    assert "root" not in {rooted.names[bone] for bone in roles.bodies}
    assert roles.follows[0] == -1
    assert roles.parents.count(-1) == 1


def test_foot_for_inverse_kinematics_hangs_on_the_shin_though_its_bone_hangs_on_the_root() -> None:
    body = humanoid(LANDMARKS)
    parents = list(body.parents)
    parents[body.index["foot.L"]] = -1
    loose = replace(body, parents=tuple(parents))
    assert hangs_on(loose, "foot.L") == "shin.L"
    roles = find_roles(loose, RigFacts())
    assert roles.carriers[roles.bodies.index(loose.index["foot.L"])] == -1


def test_two_separate_trees_of_bones_become_one_puppet() -> None:
    body = with_bone(humanoid(LANDMARKS), "rucksack", "", head=(0.0, 0.25, 1.35))
    roles = find_roles(body, RigFacts())
    assert roles.parents.count(-1) == 1
    assert hangs_on(body, "rucksack") == "chest"


def test_bone_that_constraints_move_gives_way_to_the_control_at_its_joint() -> None:
    body = humanoid(LANDMARKS)
    head = tuple(body.heads[body.index["forearm.L"]].tolist())
    way = tuple((0.9 * (body.tails - body.heads)[body.index["forearm.L"]]).tolist())
    rig = with_bone(body, "FK_forearm.L", "upper_arm.L", head=head, way=way)
    rig = replace(rig, deform=tuple(name != "FK_forearm.L" for name in rig.names))
    found = limbs(rig, RigFacts(moved=frozenset({"forearm.L"})))
    assert "FK_forearm.L" in found
    assert "forearm.L" not in found


def test_rig_that_constraints_move_altogether_is_refused_with_what_to_do() -> None:
    body = humanoid(LANDMARKS)
    with pytest.raises(RigError, match=r"Constraints or drivers move all limbs .* Mute them"):
        find_roles(body, RigFacts(moved=frozenset(body.names)), "Rig")


def test_what_the_artist_marks_counts_more_than_names_and_skin() -> None:
    body = with_bone(humanoid(LANDMARKS), "eye.L", "head", head=(0.05, -0.1, 1.7))
    facts = RigFacts(marks={"eye.L": "BODY", "toe.R": "FOLLOW"})
    assert "eye.L" in limbs(body, facts)
    assert "toe.R" not in limbs(body, facts)


def test_rig_without_anything_to_pose_is_refused() -> None:
    body = humanoid(LANDMARKS)
    marks = dict.fromkeys(body.names, "FOLLOW")
    with pytest.raises(RigError, match="no bone that could be posed"):
        find_roles(body, RigFacts(marks=marks))


def test_rig_of_no_size_is_refused() -> None:
    body = humanoid(LANDMARKS, scale=0.0)
    with pytest.raises(RigError, match="'Dot' has no size"):
        find_roles(body, RigFacts(), "Dot")
