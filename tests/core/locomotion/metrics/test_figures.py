# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of whole motions: each finds the fault that was put in, with its frame and its arm."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from octo_motion.core.locomotion.clearance import BodyVolume
from octo_motion.core.locomotion.clearance.capsule_overlap import Overlap, Separation
from octo_motion.core.locomotion.ground.surface import LevelGround
from octo_motion.core.locomotion.metrics.report import (
    KINDS,
    Figure,
    Measured,
    Played,
    finding_figures,
    played_arm,
    warnings_for_figures,
)
from octo_motion.core.locomotion.rig.bone_rotations import ArmFrames, ArmRest
from octo_motion.core.locomotion.rig.joint_room import ArmSkin
from octo_motion.core.locomotion.rig.poses import Poses
from octo_motion.core.rotations import IDENTITY, from_axis_angle, to_matrix
from octo_motion.core.steps import finished

COUNT = 5
"""Frames, from 10 on."""
Y = np.array([0.0, 1.0, 0.0])


def straight_arm() -> ArmFrames:
    """Two bones of length 1 along X, whose rest frames are the armature's."""
    still = np.tile(IDENTITY, (2, 1))
    rest = ArmRest(np.tile([1.0, 0.0, 0.0], (2, 1)), still, (False, True))
    return ArmFrames(("upper", "lower"), np.zeros(3), np.ones(2), rest, still)


def poses(count: int = COUNT) -> Poses:
    """Two arms that lie straight, a hand's breadth above the ground, and do not move."""
    return Poses(
        rotations=np.tile(IDENTITY, (count, 4, 1)),
        strains=np.zeros((count, 4)),
        locations=np.tile([0.0, 0.0, 0.1], (count, 1)),
        orientations=np.tile(IDENTITY, (count, 1)),
    )


def still() -> Measured:
    """A motion without a fault: all joints rest."""
    return Measured(
        frames=np.arange(10.0, 10.0 + COUNT),
        arms=[straight_arm(), straight_arm()],
        names=["left", "right"],
        poses=poses(),
        misses=np.zeros((COUNT, 2)),
        scale=1.0,
        ground=LevelGround(0.0),
        lying=[np.ones((COUNT, 3), dtype=bool), np.ones((COUNT, 3), dtype=bool)],
        cycles=np.zeros((COUNT, 2), dtype=int),
        separation=Separation(np.zeros(COUNT), ()),
        every=1,
    )


def about(value: float) -> Any:
    """What a figure is to be but for rounding."""
    return pytest.approx(value)


def found(measured: Measured) -> dict[str, Figure]:
    return {figure.kind: figure for figure in finished(finding_figures(measured))}


def test_all_kinds_are_there_in_their_order_and_nothing_is_wrong_with_what_lies_still() -> None:
    told = finished(finding_figures(still()))
    assert tuple(figure.kind for figure in told) == KINDS
    assert [figure.value for figure in told] == [0.0] * len(KINDS)
    # What is above the ground is not below it by less than nothing.
    assert np.signbit([figure.value for figure in told]).sum() == 0


def test_a_body_that_drifts_lets_its_arms_slip() -> None:
    motion = still()
    motion.poses.locations[3:, 0] = 0.2
    # Both arms are two units long and slip alike; the first is named.
    assert found(motion)["SLIP"] == Figure("SLIP", about(0.1), 13, "left")


def test_a_slip_between_frames_is_found_and_has_the_frame_before() -> None:
    motion = still()
    half = poses(COUNT - 1)
    half.locations[2, 0] = 0.2
    assert found(replace(motion, halfway=half))["SLIP"] == Figure("SLIP", about(0.1), 12, "left")
    assert found(motion)["SLIP"].value == 0.0


def test_a_tip_that_is_right_on_frames_alone_is_found_out_between_them() -> None:
    """Keys on both frames hold the tip where it is; half way the body is off the arc."""
    motion = still()
    angle = np.array([0.0, 0.0, 1.0, 1.0, 1.0])
    motion.poses.rotations[:, 2] = from_axis_angle(Y, -angle)
    motion.poses.locations[:, 0] = 2.0 - 2.0 * np.cos(angle)
    motion.poses.locations[:, 2] = 0.1 - 2.0 * np.sin(angle)
    tip = np.zeros((COUNT, 3), dtype=bool)
    tip[:, 2] = True
    figure = found(replace(motion, lying=[np.zeros_like(tip), tip]))["SLIP"]
    off = [2.0 * np.cos(0.5) - 1.0 - np.cos(1.0), 2.0 * np.sin(0.5) - np.sin(1.0)]
    assert figure == Figure("SLIP", about(np.hypot(*off) / 2.0), 11, "right")


def test_what_rests_only_before_or_only_after_does_not_slip_in_between() -> None:
    motion = still()
    half = poses(COUNT - 1)
    half.locations[1, 0] = 5.0
    lying = np.ones((COUNT, 3), dtype=bool)
    lying[2:] = False
    assert found(replace(motion, halfway=half, lying=[lying, lying]))["SLIP"].value == 0.0
    cycles = np.zeros((COUNT, 2), dtype=int)
    cycles[2:] = 1
    assert found(replace(motion, halfway=half, cycles=cycles))["SLIP"].value == 0.0


def test_depth_is_that_of_the_deepest_joint_in_arm_lengths_of_the_world() -> None:
    motion = replace(still(), scale=10.0)
    motion.poses.rotations[4, 2] = from_axis_angle(Y, np.array(np.pi / 2.0))
    # The second arm hangs straight down from 0.1: its tip, 20 metres long, is 19.9 below.
    assert found(motion)["DEPTH"] == Figure("DEPTH", about(19.9 / 20.0), 14, "right")


def test_strain_turn_and_miss_name_the_bones_own_arm() -> None:
    motion = still()
    motion.poses.strains[1, 3] = -0.25
    motion.poses.rotations[2:, 1] = from_axis_angle(Y, np.array(0.7))
    motion.misses[3, 1] = 0.04
    told = found(motion)
    assert told["STRAIN"] == Figure("STRAIN", 0.25, 11, "right")
    assert told["TURN"] == Figure("TURN", about(0.7), 11, "left")
    assert told["MISS"] == Figure("MISS", 0.04, 13, "right")


def test_overlaps_are_told_with_both_and_with_the_frame_that_was_looked_at() -> None:
    deepest = Overlap("left", "Head", 1, 0.3)
    motion = replace(still(), separation=Separation(np.zeros(3), (deepest,)), every=2)
    assert found(motion)["OVERLAP"] == Figure("OVERLAP", 0.3, 12, "left, Head")
    assert "OVERLAP" not in found(replace(motion, separation=None))


def test_what_holds_no_ground_has_no_slip_depth_or_strain() -> None:
    assert set(found(replace(still(), ground=None))) == {"MISS", "TURN", "OVERLAP"}


def test_what_is_no_number_is_the_worst_of_all() -> None:
    motion = still()
    motion.poses.rotations[3, 0] = np.nan
    told = found(motion)
    assert np.isnan([told["SLIP"].value, told["DEPTH"].value, told["TURN"].value]).all()
    assert told["SLIP"].arm == told["DEPTH"].arm == "left"


def test_one_frame_is_measured_too() -> None:
    motion = still()
    one = replace(
        motion,
        frames=motion.frames[:1],
        poses=poses(1),
        misses=motion.misses[:1],
        lying=[each[:1] for each in motion.lying],
        cycles=motion.cycles[:1],
    )
    assert set(found(one)) == set(KINDS) - {"TURN"}


def test_a_bone_turns_in_the_world_whatever_turns_it() -> None:
    motion = still()
    # The body by 0.3, the bone above by 0.4, and it itself by 0.5, all about the same axis.
    motion.poses.orientations[2:] = from_axis_angle(Y, np.array(0.3))
    motion.poses.rotations[2:, 2] = from_axis_angle(Y, np.array(0.4))
    motion.poses.rotations[2:, 3] = from_axis_angle(Y, np.array(0.5))
    assert found(motion)["TURN"] == Figure("TURN", about(1.2), 11, "right")


def round_skin(radius: float) -> ArmSkin:
    """A tube about a straight arm."""
    across = np.tile(np.eye(3)[1:], (2, 1, 1))
    return ArmSkin(np.full(3, radius), across, np.full((2, 2, 72), radius))


def test_depth_is_that_of_the_skin() -> None:
    motion = replace(still(), skins=[round_skin(0.05), round_skin(0.15)])
    assert found(motion)["DEPTH"] == Figure("DEPTH", about(0.05 / 2.0), 10, "right")


def test_skin_that_is_flat_below_is_as_deep_as_it_reaches_there() -> None:
    flat = round_skin(0.15)
    flat.reaches[:] = 0.02
    motion = replace(still(), skins=[flat, flat])
    assert found(motion)["DEPTH"].value == 0.0
    motion.poses.locations[3, 2] = 0.0
    assert found(motion)["DEPTH"] == Figure("DEPTH", about(0.01), 13, "left")


def creeping(count: int = 25, step: float = 0.004) -> Measured:
    """A second in place, in which the body stays, and both arms lie and creep to the side."""
    angle = step * np.arange(count) / 2.0
    turned = poses(count)
    turned.rotations[:, [0, 2]] = from_axis_angle(np.array([0.0, 0.0, 1.0]), angle)[:, None]
    return replace(
        still(),
        frames=np.arange(10.0, 10.0 + count),
        poses=turned,
        misses=np.zeros((count, 2)),
        lying=[np.zeros((count, 3), dtype=bool)] * 2,
        cycles=np.zeros((count, 2), dtype=int),
        skins=[round_skin(0.1), round_skin(0.1)],
        stays=(np.tile([0.0, 0.0, 0.1], (count, 1)), np.tile(IDENTITY, (count, 1))),
    )


def test_what_lies_on_the_ground_and_creeps_drifts_though_the_gait_holds_nothing() -> None:
    told = found(creeping())
    # Its ends left out, from the middle to either side eleven steps of the tip's.
    assert told["DRIFT"] == Figure("DRIFT", about(2.0 * np.sin(0.011)), 11, "left")
    assert told["SLIP"].value == 0.0


def test_what_is_in_the_air_is_taken_along_or_is_soon_gone_does_not_drift() -> None:
    motion = creeping()
    motion.poses.locations[:, 2] = 0.2
    assert found(replace(motion, stays=None))["DRIFT"].value == 0.0
    # A tenth of an arm length a second is 0.0042 a frame.
    assert found(creeping(step=0.02))["DRIFT"].value == 0.0
    assert found(creeping(count=7))["DRIFT"].value == 0.0


def test_what_goes_with_the_body_does_not_rest() -> None:
    motion = replace(creeping(step=0.0), stays=None)
    motion.poses.locations[:, 0] = 0.02 * np.arange(25)
    assert found(motion)["DRIFT"].value == 0.0


def test_what_is_played_counts_before_what_was_computed() -> None:
    motion = still()
    moments = np.arange(10.0, 14.1, 0.5)
    np.testing.assert_array_equal(motion.moments, moments)
    own = np.tile(np.eye(4), (len(moments), 2, 1, 1))
    own[:, :, :3, 3] = [[0.0, 0.0, 0.1], [1.0, 0.0, 0.1]]
    # Blender's bones lead along their Y.
    own[:, :, :3, :3] = to_matrix(from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(-np.pi / 2)))
    left = played_arm(own, 1.0)
    np.testing.assert_allclose(left[0][0, 2], [2.0, 0.0, 0.1], atol=1e-12)
    own = own.copy()
    own[5:, 1, 2, 3] = -0.3
    own[6:, 1, :3, :3] = 1.5 * np.eye(3)
    right = played_arm(own, 1.0)
    told = found(replace(motion, played=Played(*map(list, zip(left, right, strict=True)))))
    assert told["DEPTH"] == Figure("DEPTH", about(0.15), 12, "right")
    assert told["TURN"] == Figure("TURN", about(np.pi / 2.0), 12, "right")
    assert told["SLIP"].arm == told["STRAIN"].arm == "right"


def test_what_one_would_see_is_said_in_one_sentence_the_worst_first() -> None:
    fine = [
        Figure("SLIP", 0.01, 3, "A"),
        Figure("TURN", 1.0, 3, "A"),
        Figure("STRAIN", 9.0, 3, "A"),
    ]
    assert warnings_for_figures(fine) == ()
    # Misses and overlaps have sentences of their own.
    assert warnings_for_figures([Figure("MISS", 1.0, 3, "A"), Figure("OVERLAP", 1.0, 3, "A")]) == ()
    seen = [
        Figure("SLIP", 0.02, 4, "A"),
        Figure("DRIFT", 0.1, 5, "B"),
        Figure("DEPTH", 0.04, 6, "C"),
    ]
    assert warnings_for_figures(seen) == (
        (
            "One sees that 'C' is 4.0 % of its length below the ground at frame 6; 'B' drifts by "
            "10.0 % of its length while it rests, at frame 5; 'A' slips by 2.0 % of its length at "
            "frame 4."
        ),
    )
    (told,) = warnings_for_figures([Figure("TURN", np.radians(89.0), 7, "D"), seen[0]])
    assert told == (
        "The motion breaks: 'D' turns by 89° at frame 7; 'A' slips by 2.0 % of its length at "
        "frame 4."
    )
    (told,) = warnings_for_figures([Figure("DEPTH", np.nan, 7, "D")])
    assert told.startswith("The motion breaks: 'D' is nan %")


class Step:
    """Ground that is 1 higher from x = 1.9 on."""

    def height(self, points: Any) -> Any:
        return np.where(points[..., 0] < 1.9, 0.0, 1.0)

    def slope(self, points: Any) -> Any:
        return 0.0 * points[..., :2]


def test_beside_a_wall_an_arm_is_as_deep_as_the_wall_is_near() -> None:
    # The tips, at x = 2, are 0.9 below the step, and a tenth beside its wall: an eighth of that.
    told = found(replace(still(), ground=Step()))["DEPTH"]
    assert told == Figure("DEPTH", about(0.45 / 8.0), 10, "left")


@pytest.mark.parametrize(("frames", "part"), [(1, "less than 1 %"), (40, "10 %")])
def test_an_overlap_is_never_told_at_none_of_the_frames(frames: int, part: str) -> None:
    depths = np.zeros(400)
    depths[:frames] = 0.9
    found = Separation(depths, (Overlap("left", "right", 0, 0.9),))
    (told,) = BodyVolume.told(found, 1, np.arange(400.0))
    assert told.endswith(f"something overlaps at {part} of the frames.")
