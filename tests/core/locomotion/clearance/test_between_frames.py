# SPDX-License-Identifier: GPL-3.0-or-later
"""Between two frames no arm dips into the ground, as far as poses at these frames can help it."""

from collections.abc import Generator

import numpy as np
import pytest

from octo_motion.core.locomotion.clearance.corrections import ArmsOverGround, raising_between_frames
from octo_motion.core.locomotion.ground.walk import Raise
from octo_motion.core.locomotion.rig.bone_rotations import frames_of_arm
from octo_motion.core.locomotion.rig.poses import Poses, object_transforms
from octo_motion.core.rotations import Floats, from_axis_angle, multiply, rotate
from octo_motion.core.steps import finished
from tests.core.grounds import GROUNDS, Walker, largest_turn, walker


class Shot:
    """A walk with so many frames to a cycle."""

    def __init__(self, walk: Walker, frames: int) -> None:
        self.walk = walk
        count = int(frames * walk.route.length / walk.travel.stride) + 1
        self.times = np.linspace(0.0, 1.0, count)
        _, centres, orientations = walk.places(self.times)
        self.going = object_transforms(walk.body, 1.0, centres, orientations)
        arms = [frames_of_arm(walk.skeleton, arm.bones, walk.body) for arm in walk.generator.arms]
        self.course = ArmsOverGround(arms, walk.ground, 1.0)
        self.asked: list[np.ndarray] = []
        self.shapes: tuple[Floats, ...] = ()

    def pose(self, chosen: np.ndarray, lift: Floats | None) -> tuple[Poses, list[Floats]]:
        travel, centres, orientations = self.walk.places(self.times[chosen])
        higher = None if lift is None else self.higher(chosen, lift)
        stood = self.walk.walk.pose(travel.phase, travel.turn, centres, orientations, higher)
        if lift is None:
            self.shapes = stood.shapes
        locations, turns = (each[chosen] for each in self.going)
        poses = Poses(stood.rotations, stood.strains, locations, turns)
        return poses, self.walk.walk.by_arm(stood.joints, higher)

    def higher(self, chosen: np.ndarray, lift: Floats) -> Raise:
        return Raise(lift, tuple(each[:, :, chosen] for each in self.shapes))

    def again(
        self, chosen: np.ndarray, lift: Floats
    ) -> Generator[None, None, tuple[Poses, list[Floats]]]:
        self.asked.append(chosen)
        yield
        return self.pose(chosen, lift)

    def whole(self) -> tuple[Poses, list[Floats]]:
        return self.pose(np.arange(len(self.times)), None)


def test_on_bumps_at_a_fast_pace_arms_are_raised_at_the_frames_round_a_dip() -> None:
    shot = Shot(walker(GROUNDS["bumps"], stretch=True), 18)
    poses, joints = shot.whole()
    low = np.zeros_like(shot.course.clear(joints))
    before = shot.course.dips(poses, low)
    assert before.max() > 0.008
    after = finished(raising_between_frames(shot.course, poses, joints, shot.again))
    # Half a hundredth of the arm, as on frames.
    assert shot.course.dips(after, low).max() < 0.005
    # Far from any dip nothing changes.
    same = np.all(after.rotations == poses.rotations, axis=(1, 2))
    assert same.mean() > 0.1
    touched = np.unique(np.concatenate(shot.asked))
    assert np.all(same[np.setdiff1d(np.arange(len(same)), touched)])


def test_an_arm_that_would_jerk_when_raised_is_left_as_it_was() -> None:
    shot = Shot(walker(GROUNDS["bumps"], stretch=True), 16)
    poses, joints = shot.whole()

    def jerky(
        chosen: np.ndarray, lift: Floats
    ) -> Generator[None, None, tuple[Poses, list[Floats]]]:
        raised, places = yield from shot.again(chosen, lift)
        aside = from_axis_angle(np.array([1.0, 0.0, 0.0]), 0.7 * (chosen % 2))
        turned = multiply(raised.rotations, aside[:, None])
        return Poses(turned, raised.strains, raised.locations, raised.orientations), places

    after = finished(raising_between_frames(shot.course, poses, joints, jerky))
    assert len(shot.asked) > 0
    assert largest_turn(after.rotations) <= largest_turn(poses.rotations) + np.radians(5.0)


def test_what_is_not_looked_at_cannot_dip() -> None:
    shot = Shot(walker(GROUNDS["bumps"], stretch=True), 24)
    poses, joints = shot.whole()
    quick = shot.course.dips(poses, shot.course.clear(joints))
    # As if every arm were at the height of the ground: then all are looked at.
    thorough = shot.course.dips(poses, np.full_like(shot.course.clear(joints), -1.0))
    np.testing.assert_allclose(quick[thorough > 0.002], thorough[thorough > 0.002], atol=1e-12)


@pytest.mark.parametrize("ground", ["plane", "slope"])
def test_at_an_easy_pace_on_level_ground_nothing_is_made_anew(ground: str) -> None:
    shot = Shot(walker(GROUNDS[ground], stretch=True), 48)
    poses, joints = shot.whole()
    assert finished(raising_between_frames(shot.course, poses, joints, shot.again)) is poses
    assert shot.asked == []


def test_joints_are_those_of_the_walk() -> None:
    shot = Shot(walker(GROUNDS["plane"]), 24)
    poses, joints = shot.whole()
    for number, arm in enumerate(shot.course.arms):
        own = slice(12 * number, 12 * number + 12)
        found = arm.joints(arm.from_bones(poses.rotations[:, own]), poses.strains[:, own])
        world = poses.locations[:, None] + rotate(poses.orientations[:, None], found)
        np.testing.assert_allclose(world, joints[number], atol=1e-9)


@pytest.mark.parametrize(("frames", "stretch"), [(14, False), (24, False), (18, True)])
def test_what_cannot_be_helped_gets_no_worse(frames: int, *, stretch: bool) -> None:
    shot = Shot(walker(GROUNDS["bumps"], stretch=stretch, rest=1.0), frames)
    poses, joints = shot.whole()
    low = np.zeros_like(shot.course.clear(joints))
    after = finished(raising_between_frames(shot.course, poses, joints, shot.again))
    assert shot.course.dips(after, low).max() <= shot.course.dips(poses, low).max()


def test_an_arm_that_is_raised_alone_is_raised_as_with_all_others() -> None:
    shot = Shot(walker(GROUNDS["bumps"], stretch=True), 18)
    shot.whole()
    chosen = np.arange(5, 25)
    lift = np.full((20, len(shot.course.arms)), 0.02)
    alone = np.zeros_like(lift)
    alone[:, 3] = 0.02

    (poses, joints), (own, places) = shot.pose(chosen, lift), shot.pose(chosen, alone)

    bones = shot.course.bones[3]
    np.testing.assert_allclose(own.rotations[:, bones], poses.rotations[:, bones], atol=1e-12)
    np.testing.assert_allclose(places[3], joints[3], atol=1e-12)
