# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms are found on whatever rig an artist brings; what is no arm is not taken for one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.errors import RigError
from octo_motion.core.locomotion.rig.arm_chains import (
    ArmChain,
    Side,
    arrange,
    body_frame,
    body_rotation,
    chain_of,
    joint_positions,
    name_side,
    natural_key,
    nearest_axis,
    place_added,
)
from octo_motion.core.locomotion.rig.detection import Detection, control_chain, detect_arms
from octo_motion.core.rotations import Floats
from octo_motion.core.skeleton import Skeleton

UP, FRONT = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])


class Rig:
    """Bones added one by one; parents are named and come first."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.parents: list[str] = []
        self.heads: list[Floats] = []
        self.tails: list[Floats] = []
        self.deform: list[bool] = []
        self.constrained: list[bool] = []
        self.weighted: list[bool] = []

    def bone(
        self,
        name: str,
        head: Sequence[float] | Floats,
        tail: Sequence[float] | Floats,
        parent: str = "",
        *,
        deform: bool = True,
        constrained: bool = False,
        weighted: bool = False,
    ) -> str:
        self.names.append(name)
        self.parents.append(parent)
        self.heads.append(np.array(head, float))
        self.tails.append(np.array(tail, float))
        self.deform.append(deform)
        self.constrained.append(constrained)
        self.weighted.append(weighted)
        return name

    def chain(
        self,
        names: Sequence[str],
        root: Sequence[float] | Floats,
        tip: Sequence[float] | Floats,
        parent: str = "",
        **flags: bool,
    ) -> tuple[str, ...]:
        """A straight chain of equal bones."""
        joints = np.linspace(root, tip, len(names) + 1)
        for name, head, tail in zip(names, joints[:-1], joints[1:], strict=True):
            parent = self.bone(name, head, tail, parent, **flags)
        return tuple(names)

    def skeleton(self, scale: float = 1.0) -> Skeleton:
        matrices = np.zeros((len(self.names), 4, 4))
        heads, tails = scale * np.array(self.heads), scale * np.array(self.tails)
        lengths = np.linalg.norm(tails - heads, axis=1)
        matrices[:, :3, 1] = (tails - heads) / lengths[:, None]
        matrices[:, :3, 3] = heads
        matrices[:, 3, 3] = 1.0
        index = {name: number for number, name in enumerate(self.names)}
        parents = tuple(index.get(name, -1) for name in self.parents)
        count = len(self.names)
        return Skeleton(
            names=tuple(self.names),
            parents=parents,
            rest_matrices=matrices,
            lengths=lengths,
            connected=tuple(
                parent >= 0 and bool(np.allclose(tails[parent], head, atol=1e-9 * scale))
                for parent, head in zip(parents, heads, strict=True)
            ),
            deform=tuple(self.deform),
            inherits_rotation=(True,) * count,
            constrained=tuple(self.constrained),
            weighted=tuple(self.weighted),
            bendy_segments=(1,) * count,
            sucker_axes=("",) * count,
        )


def outward(azimuth: float, front: float = 0.0) -> Floats:
    """Direction of an arm: degrees from the front (−Y), positive to the left (+X)."""
    angle = np.radians(azimuth + front)
    return np.array([np.sin(angle), -np.cos(angle), 0.0])


def angles(count: int) -> list[float]:
    """Azimuths of the arms of an octopus, in degrees, left ones first."""
    left = [(number + 0.5) * 360.0 / count for number in range(count // 2)]
    return [*left, *(-angle for angle in left)]


def octopus(
    azimuths: Iterable[float] = tuple(angles(8)),
    bones: int = 6,
    names: str = "tentacle{arm}_{bone}",
    turned: float = 0.0,
    **flags: bool,
) -> Rig:
    """A body with straight arms two metres long."""
    rig = Rig()
    rig.bone("root", (0, 0, 0), (0, 0.3, 0), deform=False)
    rig.bone("body", (0, 0, 1), (0, 0, 1.5), "root")
    for arm, azimuth in enumerate(azimuths):
        side = "L" if azimuth > 0 else "R"
        direction, height = outward(azimuth, turned), np.array([0.0, 0.0, 1.0])
        chain = [names.format(arm=arm, bone=bone, side=side) for bone in range(bones)]
        rig.chain(chain, 0.3 * direction + height, 2.3 * direction + height, "body", **flags)
    return rig


def detect(rig: Rig, scale: float = 1.0, **given_axes: str) -> Detection:
    return detect_arms(rig.skeleton(scale), UP, FRONT, **given_axes)


def humanoid(arm: Sequence[str], leg: Sequence[str]) -> Rig:
    rig = Rig()
    rig.bone("hips", (0, 0, 1), (0, 0, 1.1))
    rig.chain(["spine", "chest", "neck", "head"], (0, 0, 1.1), (0, 0, 1.8), "hips")
    for side, sign in (("L", 1.0), ("R", -1.0)):
        names = [f"{name}.{side}" for name in arm]
        rig.chain(names, (0.2 * sign, 0, 1.5), (0.9 * sign, 0, 1.5), "chest")
        names = [f"{name}.{side}" for name in leg]
        rig.chain(names, (0.1 * sign, 0, 1.0), (0.1 * sign, 0, 0.0), "hips")
    return rig


def placed(
    arms: Iterable[ArmChain], pair: Callable[[int], int] = int
) -> list[tuple[tuple[str, ...], Side, int]]:
    """Bones, side and pair of arms, their pairs renumbered."""
    return [(arm.bones, arm.side, pair(arm.pair)) for arm in arms]


# --- What is found ------------------------------------------------------------------------------


def test_pairs_are_numbered_from_the_front_left_before_right() -> None:
    found = detect(octopus())
    assert [arm.name for arm in found.arms] == [
        f"Arm {pair} {side}" for pair in (1, 2, 3, 4) for side in "LR"
    ]
    degrees = [np.degrees(arm.azimuth) for arm in found.arms]
    np.testing.assert_allclose(
        degrees, [22.5, -22.5, 67.5, -67.5, 112.5, -112.5, 157.5, -157.5], atol=1e-6
    )
    assert (found.up, found.front, found.root_bone, found.notes) == ("Z", "-Y", "root", ())
    np.testing.assert_allclose(found.body.center, [0, 0, 1], atol=1e-12)


@given(
    arms=st.integers(1, 32).map(lambda pairs: 2 * pairs),
    bones=st.integers(3, 30),
    scale=st.floats(1e-3, 1e3),
)
def test_any_number_of_arms_and_bones_at_any_scale(arms: int, bones: int, scale: float) -> None:
    found = detect(octopus(angles(arms), bones), scale)
    assert len(found.arms) == arms
    assert {len(arm.bones) for arm in found.arms} == {bones}
    assert sorted(arm.pair for arm in found.arms) == sorted(2 * [*range(1, arms // 2 + 1)])
    for left, right in zip(found.arms[::2], found.arms[1::2], strict=True):
        assert (left.side, right.side, left.pair) == ("LEFT", "RIGHT", right.pair)
        assert left.azimuth == pytest.approx(-right.azimuth, abs=1e-6)


@given(order=st.permutations(range(8)))
def test_the_order_of_bones_in_the_rig_does_not_matter(order: list[int]) -> None:
    azimuths = angles(8)
    found = detect(octopus([azimuths[number] for number in order], names="x{bone}_{arm}"))
    degrees = [np.degrees(arm.azimuth) for arm in found.arms]
    np.testing.assert_allclose(
        degrees, [22.5, -22.5, 67.5, -67.5, 112.5, -112.5, 157.5, -157.5], atol=1e-6
    )


@given(
    arms=st.sampled_from([2, 4, 6, 8, 12]),
    bones=st.integers(4, 16),
    slope=st.floats(-60.0, 40.0),
    curl=st.floats(-150.0, 150.0),
)
def test_arms_that_hang_and_curl_keep_their_sides_and_pairs(
    arms: int, bones: int, slope: float, curl: float
) -> None:
    """Slope at the root and turn over the whole length, up and down, in degrees."""
    rig = Rig()
    rig.bone("body", (0, 0, 0), (0, 0, 0.5))
    for arm, azimuth in enumerate(angles(arms)):
        direction, parent = outward(azimuth), "body"
        head = 0.3 * direction
        for number in range(bones):
            angle = np.radians(slope + curl * number / bones)
            tail = head + 2.0 / bones * (np.cos(angle) * direction + np.sin(angle) * UP)
            parent = rig.bone(f"x{number}_{arm}", head, tail, parent)
            head = tail
    found = detect(rig)
    pairs = arms // 2
    assert [(arm.side, arm.pair) for arm in found.arms] == [
        (side, pair) for pair in range(1, pairs + 1) for side in ("LEFT", "RIGHT")
    ]
    assert [arm.bones[0] for arm in found.arms[::2]] == [f"x0_{arm}" for arm in range(pairs)]


def test_an_odd_arm_at_the_back_has_no_side() -> None:
    found = detect(octopus([60.0, -60.0, 180.0]))
    assert [(arm.side, arm.pair) for arm in found.arms] == [
        ("LEFT", 1),
        ("RIGHT", 1),
        ("CENTER", 2),
    ]
    assert found.arms[2].name == "Arm 2"


def test_a_single_arm_of_a_body_begins_where_the_body_ends() -> None:
    rig = Rig()
    rig.bone("root", (0, 0, 0), (0, 0, 0.2))
    rig.bone("body", (0, 0, 0.2), (0, 0, 0.5), "root")
    rig.bone("eye.L", (0.1, 0, 0.4), (0.1, -0.1, 0.4), "body")
    rig.bone("eye.R", (-0.1, 0, 0.4), (-0.1, -0.1, 0.4), "body")
    arm = rig.chain([f"a{number}" for number in range(5)], (0, 0, 0.5), (0, -3, 0.5), "body")
    assert [found.bones for found in detect(rig).arms] == [arm]


def test_helpers_beside_joints_and_suckers_are_not_in_the_arms() -> None:
    rig = octopus()
    for name, head in list(zip(rig.names, rig.heads, strict=True)):
        if name.startswith("tentacle"):
            rig.bone(f"{name}_scaleCompensation", head, head + 0.02 * UP, name)
            rig.bone(f"{name}_sucker", head - 0.05 * UP, head - 0.1 * UP, name)
    found = detect(rig)
    assert len(found.arms) == 8
    assert all(
        bone.startswith("tentacle") and bone[-1].isdigit()
        for arm in found.arms
        for bone in arm.bones
    )
    assert {len(arm.bones) for arm in found.arms} == {6}


def test_helpers_between_two_joints_are_left_out() -> None:
    rig = Rig()
    rig.bone("body", (0, 0, 0), (0, 0, 0.5))
    for side in (1.0, -1.0):
        parent = "body"
        for number in range(5):
            head = np.array([side * (0.2 + number), 0.0, 0.0])
            parent = rig.bone(f"offset{number}_{side}", head, head + 0.3 * UP, parent)
            parent = rig.bone(
                f"joint{number}_{side}", head, head + np.array([side, 0.0, 0.0]), parent
            )
    found = detect(rig)
    assert [arm.bones for arm in found.arms] == [
        tuple(f"joint{number}_{side}" for number in range(5)) for side in (1.0, -1.0)
    ]


def test_bones_that_exporters_put_at_the_tips_are_not_in_the_arms() -> None:
    rig = octopus()
    for name, tail in list(zip(rig.names, rig.tails, strict=True)):
        if name.endswith("_5"):
            rig.bone(f"{name}_end", tail, tail + 0.3 * UP, name)
    assert {len(arm.bones) for arm in detect(rig).arms} == {6}


def test_such_bones_are_known_with_vertex_groups_and_numbers_of_the_file() -> None:
    """Importers give vertex groups to all bones, some programs a number to all names."""
    rig = octopus(bones=5, names="tentacle{arm}_{bone}_0{arm}", weighted=True)
    for name, tail in list(zip(rig.names, rig.tails, strict=True)):
        if "_4_" in name:
            marker = name[:-3] + "_End_0" + name[-1]
            rig.bone(marker, tail, tail + 0.3 * UP, name, weighted=True)
    found = detect(rig)
    assert len(found.arms) == 8
    assert {len(arm.bones) for arm in found.arms} == {5}


def test_an_arm_of_three_bones_keeps_the_one_that_is_called_its_end() -> None:
    rig = octopus(bones=2, weighted=True)
    for name, tail in list(zip(rig.names, rig.tails, strict=True)):
        if name.endswith("_1"):
            further = tail + (tail - rig.heads[rig.names.index(name)])
            rig.bone(f"{name}_end", tail, further, name, weighted=True)
    assert {len(arm.bones) for arm in detect(rig).arms} == {3}


_MANTLE_UP = ((0, 0.3, 1.2), (0, 0.6, 3.2))
_FIN_LEFT, _FIN_RIGHT = ((0.2, 0, 1.5), (1.5, 0, 2.5)), ((-0.2, 0, 1.5), (-1.5, 0, 2.5))


@pytest.mark.parametrize(
    ("parts", "parent"),
    [
        ({"mantle{}": ((0, 0.3, 1.2), (0, 2.2, 1.9))}, "body"),
        ({"Mantle_{}": _MANTLE_UP, "Siphon_{}": ((0, 0, 1), (0, -1, 1))}, "body"),
        ({"FinL{}": _FIN_LEFT, "FinR{}": _FIN_RIGHT}, "body"),
        ({"eye.L.{}": _FIN_LEFT, "eye.R.{}": _FIN_RIGHT}, "body"),
        ({"tail_{}": ((0, 0.3, 1), (0, 2.3, 1))}, "root"),
    ],
)
def test_parts_of_a_body_that_are_as_long_as_arms_are_told_by_their_names(
    parts: dict[str, tuple[Sequence[float], Sequence[float]]], parent: str
) -> None:
    rig = octopus(bones=3, weighted=True)
    for name, (root, tip) in parts.items():
        rig.chain([name.format(bone) for bone in range(3)], root, tip, parent, weighted=True)
    found = detect(rig)
    assert {arm.bones[0] for arm in found.arms} == {f"tentacle{arm}_0" for arm in range(8)}
    assert found.root_bone == "root"


def test_webs_between_arms_are_no_arms() -> None:
    rig = octopus(bones=4, weighted=True)
    for number, azimuth in enumerate(angles(8)):
        way = outward(azimuth + 22.5)
        bones = [f"web{number}_{bone}" for bone in range(3)]
        rig.chain(bones, 0.3 * way + UP, 1.3 * way + UP, "body", weighted=True)
    assert len(detect(rig).arms) == 8


def test_arms_of_a_head_are_arms() -> None:
    found = detect(octopus(names="head_arm_{arm}.{bone}"))
    assert len(found.arms) == 8


def test_a_snake_gets_a_clear_answer() -> None:
    rig = Rig()
    rig.bone("body", (0, 0, 0), (0, 0, 0.3))
    rig.chain(["tail.01", "tail.02", "tail.03"], (0, 0.3, 0.2), (0, 2, 0.2), "body")
    rig.chain(["neck.01", "neck.02", "head"], (0, -0.3, 0.2), (0, -1.5, 1), "body")
    with pytest.raises(RigError, match="look like limbs of a body"):
        detect(rig)


def test_a_mantle_of_some_bones_is_no_arm() -> None:
    rig = octopus()
    rig.chain(["mantle1", "mantle2", "mantle3", "mantle4"], (0, 0, 1.5), (0, 0, 3), "body")
    found = detect(rig)
    assert len(found.arms) == 8
    assert all("mantle" not in bone for arm in found.arms for bone in arm.bones)


def test_two_root_bones_are_no_obstacle() -> None:
    rig = octopus()
    rig.bone("eye", (0, 0, 2), (0, -0.1, 2))
    found = detect(rig)
    assert len(found.arms) == 8
    assert found.root_bone == ""


def test_bones_with_weights_count_if_there_are_any() -> None:
    rig = octopus(weighted=True)
    for number in range(3):
        rig.chain([f"extra{number}_{bone}" for bone in range(6)], (0, 0, number), (0, -2, number))
    found = detect(rig)
    assert len(found.arms) == 8
    assert all(bone.startswith("tentacle") for arm in found.arms for bone in arm.bones)


def test_a_chain_without_deforming_bones_is_found_too() -> None:
    rig = octopus(deform=False)
    rig.deform = [False] * len(rig.names)
    assert len(detect(rig).arms) == 8


def test_legs_of_an_insect_along_its_spine_count_as_arms() -> None:
    rig = Rig()
    parent = ""
    for segment in range(3):
        y = 0.3 * segment
        parent = rig.bone(f"body{segment}", (0, y, 0), (0, y + 0.3, 0), parent)
        for side, sign in (("L", 1.0), ("R", -1.0)):
            names = [f"leg{segment}{number}.{side}" for number in range(4)]
            rig.chain(names, (0.1 * sign, y, 0), (1.5 * sign, y, 0), parent)
    assert len(detect(rig).arms) == 6


def test_arms_of_a_squid_in_bunches_along_its_body_count_as_arms() -> None:
    """Those in the middle of a bunch have a bone less than those beside them."""
    rig = Rig()
    rig.bone("mantle", (0, 2, 0), (0, 0, 0))
    for bunch, z in (("middle", 0.0), ("upper", 0.3), ("lower", -0.3)):
        rig.bone(bunch, (0, 0, z), (0, -0.2, z), "mantle" if bunch == "middle" else "middle")
        for place, count in ((-1, 5), (0, 4), (1, 5)):
            names = [f"{bunch}{place}_{number}" for number in range(count)]
            rig.chain(names, (0.2 * place, -0.2, z), (0.3 * place, -3.0, z), bunch)
    assert len(detect(rig).arms) == 9


def test_arms_upright_in_the_middle_get_no_side_and_the_artist_is_told() -> None:
    rig = Rig()
    rig.bone("body", (0, 0, -0.5), (0, 0, 0))
    for arm in range(4):
        rig.chain([f"a{arm}_{number}" for number in range(5)], (0, 0, 0), (0, 0, 3), "body")
    found = detect(rig)
    assert [(arm.side, arm.pair) for arm in found.arms] == [
        ("CENTER", number) for number in (1, 2, 3, 4)
    ]
    (note,) = found.notes
    assert "4 arms stand upright" in note
    assert "set them by hand" in note


# --- What is not ---------------------------------------------------------------------------------


def test_a_humanoid_gets_a_clear_answer() -> None:
    arm, leg = ("clavicle", "upper", "lower", "palm"), ("femur", "tibia", "pes")
    with pytest.raises(RigError, match=r"look like limbs of a body.*Select the bones of one arm"):
        detect(humanoid(arm, leg))


def test_a_humanoid_whose_control_bones_make_six_limbs_gets_it_too() -> None:
    rig = humanoid(("upperarm", "lowerarm", "wrist", "hand"), ("upperleg", "leg", "foot", "toes"))
    for side, sign in (("L", 1.0), ("R", -1.0)):
        names = [f"control{number}.{side}" for number in range(4)]
        rig.chain(names, (0.1 * sign, 0.1, 0), (0.1 * sign, 0.9, 0), "hips")
    with pytest.raises(RigError, match="look like limbs of a body"):
        detect(rig)


def test_a_hand_with_fingers_on_a_body_is_no_octopus() -> None:
    rig = humanoid(("upper", "lower", "palm"), ("femur", "tibia", "pes"))
    for side, sign in (("L", 1.0), ("R", -1.0)):
        for finger in range(5):
            y = 0.02 * (finger - 2)
            names = [f"finger{finger}{number}.{side}" for number in range(3)]
            rig.chain(names, (0.9 * sign, y, 1.5), (1.0 * sign, y, 1.5), f"palm.{side}")
    with pytest.raises(RigError, match="like fingers"):
        detect(rig)


def test_an_armature_without_three_bones_in_a_row_gets_a_clear_answer() -> None:
    rig = Rig()
    rig.bone("body", (0, 0, 0), (0, 0, 1))
    for number in range(6):
        direction = outward(60.0 * number)
        rig.chain([f"a{number}", f"b{number}"], direction, 3.0 * direction, "body")
    with pytest.raises(RigError, match=r"no 3 bones form a chain.*subdivide"):
        detect(rig)


def test_a_chain_of_too_many_bones_is_named_with_its_number() -> None:
    rig = Rig()
    rig.chain([f"a{number}" for number in range(250)], (0, 0, 0), (0, -9, 0))
    with pytest.raises(RigError, match="chain of 250 bones has more than 200"):
        detect(rig)


def test_more_than_64_arms_are_refused_with_their_number() -> None:
    with pytest.raises(RigError, match="66 chains could be arms, and 64 is the most"):
        detect(octopus(angles(66), bones=3))


# --- Deforming chains and control chains ----------------------------------------------------------


def control_rig(*, controls: bool, own_constraints: bool = False) -> Rig:
    """Each arm three or four times: deforming, mechanism, tweaks, and the artist's controls."""
    rig = Rig()
    rig.bone("root", (0, 0, 0), (0, 0.3, 0), deform=False)
    rig.bone("DEF-body", (0, 0, 0), (0, 0, 0.5), "root")
    for arm, azimuth in enumerate(angles(8)):
        direction = outward(azimuth)
        for layer, deform in (("DEF-", True), ("ORG-", False)):
            names = [f"{layer}t{arm}_{bone}" for bone in range(5)]
            rig.chain(
                names, 0.3 * direction, 2.3 * direction, "DEF-body", deform=deform, constrained=True
            )
        if controls:
            names = [f"t{arm}_{bone}" for bone in range(5)]
            rig.chain(names, 0.3 * direction, 2.3 * direction, "root", deform=False)
            for bone in range(5):
                head = rig.heads[rig.names.index(f"t{arm}_{bone}")]
                rig.bone(
                    f"tweak_t{arm}_{bone}", head, head + 0.1 * direction, f"t{arm}_{bone}",
                    deform=False,
                )  # fmt: skip
                if own_constraints and bone:
                    rig.constrained[rig.names.index(f"t{arm}_{bone}")] = True
    return rig


def test_where_constraints_move_the_deforming_bones_the_controls_are_listed() -> None:
    found = detect(control_rig(controls=True))
    assert {arm.bones for arm in found.arms} == {
        tuple(f"t{arm}_{bone}" for bone in range(5)) for arm in range(8)
    }
    assert not any(arm.driven for arm in found.arms)
    (note,) = found.notes
    assert "Constraints move the bones that deform 8 arms" in note
    assert "'t0_0'" in note


def test_constraints_on_the_controls_themselves_are_told() -> None:
    found = detect(control_rig(controls=True, own_constraints=True))
    assert all(arm.bones[0].startswith("t") and arm.driven for arm in found.arms)
    assert "32 of these have constraints of their own ('t0_1' …): mute those" in found.notes[1]


def test_without_controls_the_artist_is_told_that_keys_have_no_effect() -> None:
    found = detect(control_rig(controls=False))
    assert all(arm.bones[0].startswith("DEF-") and arm.driven for arm in found.arms)
    (note,) = found.notes
    assert "move 8 arms" in note
    assert "keys have no effect while the constraints are on" in note


def test_deforming_bones_without_constraints_are_listed_though_there_are_controls() -> None:
    rig = control_rig(controls=True)
    rig.constrained = [False] * len(rig.names)
    found = detect(rig)
    assert all(arm.bones[0].startswith("DEF-") for arm in found.arms)
    assert found.notes == ()


def test_an_unweighted_rig_without_deform_flags_shows_its_free_layer_alone() -> None:
    rig = control_rig(controls=True)
    rig.deform = [False] * len(rig.names)
    found = detect(rig)
    assert {arm.bones[0] for arm in found.arms} == {f"t{arm}_0" for arm in range(8)}


def test_control_chain_of_an_arm() -> None:
    skeleton = control_rig(controls=True).skeleton()
    deforming = [f"DEF-t3_{bone}" for bone in range(5)]
    assert control_chain(skeleton, deforming) == tuple(f"t3_{bone}" for bone in range(5))
    assert control_chain(control_rig(controls=False).skeleton(), deforming) == ()


# --- Which way the body faces ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("turned", "front"), [(0.0, "-Y"), (90.0, "X"), (180.0, "Y"), (-90.0, "-X")]
)
def test_names_of_left_and_right_tell_where_the_front_is(turned: float, front: str) -> None:
    found = detect(octopus(names="t{arm}_{bone}.{side}", turned=turned))
    assert found.front == front
    for arm in found.arms:
        assert arm.side == ("LEFT" if arm.bones[0].endswith(".L") else "RIGHT")
    degrees = [np.degrees(arm.azimuth) for arm in found.arms]
    np.testing.assert_allclose(
        degrees, [22.5, -22.5, 67.5, -67.5, 112.5, -112.5, 157.5, -157.5], atol=1e-6
    )
    if turned:
        assert f"Front was set to {front}" in found.notes[0]
    else:
        assert found.notes == ()


def test_symmetry_tells_where_the_front_is() -> None:
    azimuths = [15.0, -15.0, 40.0, -40.0, 85.0, -85.0]
    found = detect(octopus(azimuths, turned=90.0))
    assert found.front == "X"
    assert "The arms mirror each other across X: Front was set to X." in found.notes[0]
    degrees = [np.degrees(arm.azimuth) for arm in found.arms]
    # Seen from the middle of the roots, which lies ahead of where the arms' lines meet.
    np.testing.assert_allclose(degrees, [15, -15, 40, -40, 85, -85], atol=6)


def test_the_artists_front_wins() -> None:
    found = detect(octopus(names="t{arm}_{bone}.{side}"), front="X")
    assert found.front == "X"
    assert found.notes == ()
    # Geometry contradicts some of the names: those go where they lie.
    for arm in found.arms:
        assert arm.side == ("LEFT" if arm.azimuth > 0 else "RIGHT")


def test_front_and_up_on_one_axis_are_refused() -> None:
    with pytest.raises(RigError, match=r"front \(-Z\) and up \(Z\) lie on one axis"):
        detect(octopus(), up="Z", front="-Z")


def test_the_up_axis_follows_from_the_artists_front() -> None:
    found = detect(octopus(), front="Z")
    assert found.up != "Z"
    assert found.front == "Z"


def test_a_rig_that_lies_on_its_side_knows_its_up() -> None:
    found = detect_arms(octopus().skeleton(), np.array([0.0, 1.0, 0.1]), FRONT)
    assert found.up == "Y"
    assert found.front in {"X", "-X", "Z", "-Z"}


@given(
    st.sampled_from(["X", "-X", "Y", "-Y", "Z", "-Z"]),
    st.sampled_from(["X", "-X", "Y", "-Y", "Z", "-Z"]),
)
def test_body_axes_are_a_rotation(up: str, front: str) -> None:
    if up[-1] == front[-1]:
        with pytest.raises(RigError, match="Choose a front axis across the up axis"):
            body_rotation(up, front)
        return
    rotation = body_rotation(up, front)
    np.testing.assert_array_equal(rotation @ rotation.T, np.eye(3))
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert nearest_axis(-rotation[:, 1]) == front
    assert nearest_axis(rotation[:, 2], across=front) == up


# --- Arms by hand ---------------------------------------------------------------------------------


def test_selected_bones_are_put_in_order_and_gaps_are_allowed() -> None:
    skeleton = octopus().skeleton()
    chosen = ("tentacle0_5", "tentacle0_1", "tentacle0_3", "tentacle0_1")
    assert chain_of(skeleton, chosen) == ("tentacle0_1", "tentacle0_3", "tentacle0_5")


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ((), "at least 3 bones in a row, not 0"),
        (("tentacle0_0", "tentacle0_1"), r"at least 3 bones in a row, not 2.*subdivide"),
        (("tentacle0_0", "tentacle1_0", "body"), r"'tentacle0_0' and 'tentacle1_0' are not in one"),
        (("tentacle0_0", "nothing"), r"no bone 'nothing'.*Detect the arms again"),
    ],
)
def test_bones_that_are_no_arm_are_refused(names: tuple[str, ...], message: str) -> None:
    with pytest.raises(RigError, match=message):
        chain_of(octopus().skeleton(), names)


def test_a_helper_among_the_selected_bones_is_named() -> None:
    rig = Rig()
    parent = ""
    for number in range(4):
        parent = rig.bone(f"joint{number}", (0, -number, 0), (0, -number - 1, 0), parent)
    rig.bone("helper", (0, -3, 0), (0, -3, 1), parent)
    with pytest.raises(RigError, match="'joint3' and 'helper' start at the same point"):
        chain_of(rig.skeleton(), rig.names)


def test_too_many_selected_bones_are_refused() -> None:
    rig = Rig()
    rig.chain([f"a{number}" for number in range(201)], (0, 0, 0), (0, -9, 0))
    with pytest.raises(RigError, match="200 bones at most, not 201"):
        chain_of(rig.skeleton(), rig.names)


def test_joints_of_an_imported_rig_whose_tails_lie_anywhere() -> None:
    rig = Rig()
    parent = ""
    for number in range(4):
        parent = rig.bone(f"b{number}", (0, -number, 0), (0, -number, 1), parent)
    joints = joint_positions(rig.skeleton(), rig.names)
    np.testing.assert_allclose(joints, [(0, -number, 0) for number in range(5)])
    tidy = octopus([90.0], bones=4).skeleton()
    tip = joint_positions(tidy, [f"tentacle0_{bone}" for bone in range(4)])[-1]
    np.testing.assert_allclose(tip, tidy.tails[-1])


def test_arms_by_hand_are_arranged_like_detected_ones() -> None:
    skeleton = octopus().skeleton()
    found = detect_arms(skeleton, UP, FRONT)
    bones = [arm.bones for arm in reversed(found.arms)]
    arranged = arrange(skeleton, bones, body_frame(skeleton, bones, "Z", "-Y"))
    # Sums in another order differ in the last digit.
    for one, other in zip(arranged, found.arms, strict=True):
        assert one.azimuth == pytest.approx(other.azimuth, abs=1e-12)
        assert replace(one, azimuth=0.0) == replace(other, azimuth=0.0)
    assert arrange(skeleton, [], body_frame(skeleton, [], "Z", "-Y")) == ()


@pytest.mark.parametrize(
    ("name", "side"),
    [
        ("arm.L", "LEFT"),
        ("arm_r_01", "RIGHT"),
        ("l-tentacle", "LEFT"),
        ("RIGHT arm", "RIGHT"),
        ("mixamorig:LeftArm", "LEFT"),
        ("tentacleRight2", "RIGHT"),
        ("joint57_L_054", "LEFT"),
        ("Bone.001", None),
        ("roller", None),
        ("bright", None),
        ("leftover", None),
        ("Lefty", None),
    ],
)
def test_sides_in_names(name: str, side: str | None) -> None:
    assert name_side(name) == side


def test_names_sort_by_their_numbers() -> None:
    assert sorted(["Bone.10", "Bone.9", "Bone", "Bone.9a"], key=natural_key) == [
        "Bone",
        "Bone.9",
        "Bone.9a",
        "Bone.10",
    ]


def test_named_partners_share_a_pair_even_where_they_do_not_mirror() -> None:
    rig = octopus([20.0, -60.0, 100.0, -140.0])
    renames = {0: "front", 1: "front", 2: "back", 3: "back"}
    rig.names = [
        name
        if not name.startswith("tentacle")
        else f"{renames[int(name[8])]}{name[10:]}.{'LR'[int(name[8]) % 2]}"
        for name in rig.names
    ]
    rig.parents = ["root" if name == "body" else "" for name in rig.names]
    skeleton = rig.skeleton()
    arms = [
        tuple(f"{which}{bone}.{side}" for bone in range(6))
        for which in ("front", "back")
        for side in "LR"
    ]
    arranged = arrange(skeleton, arms, body_frame(skeleton, arms, "Z", "-Y"))
    assert [(arm.bones[0], arm.pair) for arm in arranged] == [
        ("front0.L", 1),
        ("front0.R", 1),
        ("back0.L", 2),
        ("back0.R", 2),
    ]


def test_an_arm_that_something_drives_says_so() -> None:
    rig = octopus()
    skeleton = rig.skeleton()
    held = replace(skeleton, constrained=tuple(name == "tentacle2_3" for name in skeleton.names))
    found = detect_arms(held, UP, FRONT)
    assert [arm.bones[0] for arm in found.arms if arm.driven] == ["tentacle2_0"]
    assert "Constraints or drivers move 1 arm," in found.notes[0]


def test_an_added_arm_gets_its_partners_pair() -> None:
    skeleton = octopus().skeleton()
    found = detect_arms(skeleton, UP, FRONT)
    for arm in found.arms:
        # The artist has numbered the pairs the other way round.
        others = placed((each for each in found.arms if each != arm), lambda pair: 5 - pair)
        added = place_added(skeleton, arm.bones, others, found.body)
        assert (added.side, added.pair) == (arm.side, 5 - arm.pair)
        assert added.name == f"Arm {5 - arm.pair} {arm.side[0]}"


def test_an_added_arm_never_doubles_a_side_and_pair() -> None:
    skeleton = octopus([30.0, 80.0, 130.0]).skeleton()
    found = detect_arms(skeleton, UP, FRONT)
    first, *others = found.arms
    listed = placed(others, lambda pair: pair - 1)
    added = place_added(skeleton, first.bones, listed, found.body)
    assert (added.side, added.pair) == ("LEFT", 3)
    alone = place_added(skeleton, first.bones, [], found.body)
    assert (alone.side, alone.pair) == (first.side, 1)


def test_a_bone_belongs_to_one_arm_only() -> None:
    skeleton = octopus().skeleton()
    found = detect_arms(skeleton, UP, FRONT)
    others = placed(found.arms)
    with pytest.raises(RigError, match=r"'tentacle0_1' belongs to another arm.*Remove that arm"):
        place_added(skeleton, ("tentacle0_1", "tentacle0_2", "tentacle0_3"), others, found.body)
