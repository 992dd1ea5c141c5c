# SPDX-License-Identifier: GPL-3.0-or-later
"""How far an arm's skin reaches from its bones, to whichever side."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.locomotion.rig.joint_room import ArmSkin, arm_skin, nearest_bones
from octo_motion.core.rotations import Floats, conjugate, from_axis_angle, multiply, rotate

BONES = 5
RADIUS = 0.1
ROUND = 24


def tube(
    askew: Floats, *, last: int = BONES, turned: Floats | None = None
) -> tuple[ArmSkin, Floats, Floats]:
    """A straight arm along X in a tube whose middle is askew (3,), as far as its bones up to one.

    Returns the skin, the bones' rest orientations and the points.
    """
    joints = np.zeros((BONES + 1, 3))
    joints[:, 0] = np.arange(BONES + 1)
    angles = np.linspace(0.0, 2.0 * np.pi, ROUND, endpoint=False)
    ring = RADIUS * np.stack([0.0 * angles, np.cos(angles), np.sin(angles)], axis=-1)
    along = np.linspace(0.0, last, 6 * last + 1)
    points = np.concatenate([ring + askew + [x, 0.0, 0.0] for x in along])
    frames = from_axis_angle([1.0, 0.0, 0.0], np.linspace(0.0, 5.0, BONES))
    if turned is not None:
        points, joints = rotate(turned, points), rotate(turned, joints)
        frames = multiply(turned, frames)
    return arm_skin(points, joints, frames, np.full(BONES + 1, RADIUS)), frames, points


def reach(skin: ArmSkin, frames: Floats, down: Floats) -> Floats:
    """How far it reaches down (bones, 2), down being (3,) of the armature."""
    return skin.below(np.broadcast_to(rotate(conjugate(frames), down)[:, None], (BONES, 2, 3)))


@given(
    st.floats(-1.0, 1.0),
    st.floats(0.0, 2.0 * np.pi),
    st.floats(0.0, 2.0 * np.pi),
    st.floats(-np.pi, np.pi),
)
def test_it_reaches_as_far_as_the_farthest_of_it_within_a_little_roll(
    much: float, way: float, seen: float, turn: float
) -> None:
    askew = 0.5 * RADIUS * much * np.array([0.0, np.cos(way), np.sin(way)])
    turned = from_axis_angle(np.array([0.6, 0.0, 0.8]), turn)
    skin, frames, points = tube(askew, turned=turned)
    down = np.array([0.0, np.cos(seen), np.sin(seen)])
    back = rotate(conjugate(turned), points)
    farthest = (back @ down).max()
    found = reach(skin, frames, rotate(turned, down))
    assert np.all(found >= farthest - 0.03 * RADIUS)
    # What is nearly as far as round counts as round; else a little roll makes a little more.
    rolls = seen + np.linspace(-0.36, 0.36, 9)
    most = max((back @ np.array([0.0, np.cos(roll), np.sin(roll)])).max() for roll in rolls)
    highest = max(most, RADIUS) if most > 0.55 * RADIUS else max(most, 0.0)
    assert np.all(found <= highest + 0.05 * RADIUS)


def test_bones_outside_their_skin_are_not_put_into_the_ground() -> None:
    skin, frames, _ = tube(np.array([0.0, 0.0, 1.5 * RADIUS]))
    # As much room as keys need that leave something out.
    assert reach(skin, frames, np.array([0.0, 0.0, -1.0])) == pytest.approx(0.12 * RADIUS)


def test_webs_and_fins_do_not_lift_an_arm() -> None:
    skin, frames, _ = tube(np.array([0.0, 0.0, -4.0 * RADIUS]))
    assert np.all(reach(skin, frames, np.array([0.0, 0.0, -1.0])) <= 1.5 * RADIUS + 1e-12)


def test_bones_without_skin_are_as_askew_as_those_before_them() -> None:
    skin, frames, _ = tube(np.array([0.0, 0.0, 0.7 * RADIUS]), last=BONES - 2)
    found = reach(skin, frames, np.array([0.0, 0.0, -1.0]))
    assert found[-1] == pytest.approx(found[0], abs=0.05 * RADIUS)
    assert found[-1].max() < 0.5 * RADIUS


def test_an_arm_without_skin_is_round() -> None:
    joints = np.zeros((3, 3))
    joints[:, 0] = np.arange(3)
    frames = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    skin = arm_skin(np.zeros((0, 3)), joints, frames, np.array([0.3, 0.2, 0.1]))
    down = np.broadcast_to([0.0, 0.0, -1.0], (2, 2, 3))
    assert skin.below(down) == pytest.approx(np.array([[0.3, 0.2], [0.2, 0.1]]))
    assert skin.is_round(np.zeros((2, 3)), 1)


def test_a_round_skin_is_seen_to_be_round_and_an_askew_one_only_where_it_lies() -> None:
    nowhere = np.zeros((BONES, 3))
    assert tube(np.zeros(3))[0].is_round(nowhere, 2)
    skin, frames, _ = tube(np.array([0.0, 0.0, -0.5 * RADIUS]))
    below = rotate(conjugate(frames), np.array([0.0, 0.0, -1.0]))
    # Its suckers are where it reaches far enough; on its back it would hover.
    assert skin.is_round(below, 2)
    assert not skin.is_round(-below, 2)
    assert not skin.is_round(nowhere, 2)


def test_points_belong_to_the_bone_they_are_nearest_to() -> None:
    joints = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
    points = np.array([[0.25, -0.5, 0.0], [1.5, 0.75, 0.0], [-1.0, 0.0, 0.0], [1.0, 3.0, 1.0]])
    bone, share, off = nearest_bones(points, joints)
    assert bone.tolist() == [0, 1, 0, 1]
    assert share == pytest.approx([0.25, 0.75, 0.0, 1.0])
    assert off == pytest.approx(
        np.array([[0.0, -0.5, 0.0], [0.5, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 2.0, 1.0]])
    )
