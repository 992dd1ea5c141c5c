# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms reach as octopuses do, hold what stands or moves, and let go without a jerk."""

from dataclasses import dataclass

import numpy as np
import pytest

from octo_motion.core.errors import RigError, SettingsError
from octo_motion.core.locomotion.gait import table as gait
from octo_motion.core.locomotion.gait.gait_poser import GaitPoser, GaitSettings
from octo_motion.core.locomotion.reaching.grasp import Grasp, Mode, Places, Target, plan_grasp
from octo_motion.core.locomotion.reaching.timeline import Timeline, curled, front_width
from octo_motion.core.locomotion.reaching.winding import profile_of
from octo_motion.core.locomotion.rig.bone_rotations import ArmFrames, frames_of_arm
from octo_motion.core.rotations import IDENTITY, Floats, angle_between, from_axis_angle, rotate
from octo_motion.core.smoothing import least_jerk
from tests.core import objects
from tests.core.rigs import body_with_arms, posed_joints

BUILDS = (3, 7, 12, 30)
every_build = pytest.mark.parametrize("joints", BUILDS)
TIMELINE = Timeline(start=10, contact=40, closed=55, release=80, end=110)
UP = np.array([0.0, 0.0, 1.0])
WHERE = np.array([0.5, -0.45, -0.2])


def frames(step: float = 1.0) -> Floats:
    return np.arange(0.0, 120.0 + 0.5 * step, step)


def still(times: Floats, where: Floats = WHERE) -> Places:
    return Places(np.tile(where, (len(times), 1)), np.tile(IDENTITY, (len(times), 1)))


def swaying(times: Floats) -> Places:
    """An object that moves and turns all the time, as seen from a body that walks."""
    phase = 0.12 * times[:, None]
    shift = 0.06 * np.concatenate([np.sin(phase), np.cos(1.3 * phase), 0.5 * np.sin(phase)], 1)
    tilt = from_axis_angle(np.array([0.6, 0.8, 0.0]), 0.25 * np.sin(0.1 * times))
    return Places(WHERE + shift, tilt)


@dataclass(frozen=True)
class Case:
    arm: ArmFrames
    radii: Floats
    grasp: Grasp
    otherwise: GaitPoser
    column: slice

    def base(self, times: Floats) -> Floats:
        poses = self.otherwise.pose(0.1 * times, np.zeros((len(times), 2)))
        return poses.rotations[:, self.column]

    def rotations(self, times: Floats, places: Places) -> Floats:
        return self.grasp.apply(times, places, self.base(times))

    def joints(self, times: Floats, places: Places) -> Floats:
        return self.arm.joints(self.arm.from_bones(self.rotations(times, places)))


def case(
    joints: int = 12,
    form: objects.Form | None = None,
    places: Places | None = None,
    *,
    mode: Mode = "COIL",
    rolls: bool = False,
) -> Case:
    random = np.random.default_rng(1) if rolls else None
    skeleton, arms, body = body_with_arms(8, joints, rolls=random)
    arm = frames_of_arm(skeleton, arms[0].bones, body)
    radii = np.interp(arm.reach, [0.0, 1.0], [0.05, 0.008])
    times = frames()
    profile = profile_of(*(form or objects.rod()))
    target = Target(profile, places or still(times), "'Rod'")
    grasp = plan_grasp(arm, radii, target, TIMELINE, times, mode=mode, name="'Arm 1 L'")
    grasp = grasp.paced(times, target.places)
    generator = GaitPoser(skeleton, arms, body, GaitSettings(gait.gait_presets()["walk"]))
    return Case(arm, radii, grasp, generator, slice(0, joints))


# --- Frames along an arm --------------------------------------------------------------------------


@every_build
def test_bones_and_frames_along_the_arm_are_the_same_thing(joints: int) -> None:
    random = np.random.default_rng(joints)
    skeleton, arms, body = body_with_arms(3, joints, rolls=random)
    arm = frames_of_arm(skeleton, arms[1].bones, body)
    rotations = random.normal(size=(4, joints, 4))
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    along = arm.from_bones(rotations)
    assert np.max(angle_between(arm.to_bones(along), rotations)) < 1e-7
    assert np.max(angle_between(arm.shaped(arm.shape(along)), along)) < 1e-6
    solved = posed_joints(skeleton, arms[1], rotations, arms[1].bones)
    np.testing.assert_allclose(arm.joints(along), solved, atol=1e-9)


def test_suckers_face_the_ground_where_the_rig_does_not_say() -> None:
    skeleton, arms, body = body_with_arms(8, 5, rolls=np.random.default_rng(2))
    for each in arms:
        arm = frames_of_arm(skeleton, each.bones, body)
        facing = rotate(arm.at_rest, np.array([0.0, 1.0, 0.0]))
        np.testing.assert_allclose(facing, np.tile(-UP, (5, 1)), atol=1e-9)


# --- The reach ------------------------------------------------------------------------------------


def bend(reaching: Case, times: Floats) -> Floats:
    """Place of the bend (frames, 3)."""
    along = reaching.joints(times, still(times))
    arm, width = reaching.arm, front_width(reaching.arm.lengths)
    front = reaching.grasp.front(reaching.grasp.progress(times))
    return np.stack(
        [
            _at(joints, arm.reach, place)
            for joints, place in zip(along, front - 0.5 * width, strict=True)
        ]
    )


def _at(joints: Floats, reach: Floats, place: float) -> Floats:
    return np.array([np.interp(place, reach, joints[:, axis]) for axis in range(3)])


def test_the_bend_speeds_up_once_and_slows_down_once() -> None:
    times = frames(0.25)
    moving = (times >= 25.0) & (times <= TIMELINE.contact)
    point = bend(case(60), times[moving])
    speed = np.linalg.norm(np.diff(point, axis=0), axis=1)
    speed = np.convolve(speed, np.ones(5) / 5.0, "valid")  # joints are 1.5 % of the arm apart
    peak = int(np.argmax(speed))
    assert 0 < peak < len(speed) - 1
    assert np.all(np.diff(speed[: peak + 1]) > -0.03 * speed.max())
    assert np.all(np.diff(speed[peak:]) < 0.03 * speed.max())
    assert speed[-1] < 0.1 * speed.max()


def test_the_bend_stays_near_a_plane() -> None:
    times = frames(0.25)
    moving = (times >= 25.0) & (times <= TIMELINE.contact)
    point = bend(case(60), times[moving])
    centred = point - point.mean(axis=0)
    spread = np.linalg.svd(centred, compute_uv=False)
    assert spread[2] < 0.08 * spread[0]


def test_before_and_after_the_arm_does_what_its_gait_says() -> None:
    reaching = case()
    times = frames()
    result = reaching.rotations(times, still(times))
    apart = (times <= TIMELINE.start) | (times >= TIMELINE.end)
    np.testing.assert_array_equal(result[apart], reaching.base(times)[apart])
    assert not np.allclose(result[~apart], reaching.base(times)[~apart])


@every_build
def test_halving_the_time_step_halves_the_largest_change(joints: int) -> None:
    reaching = case(joints, places=swaying(frames()))
    coarse, fine = (
        angle_between(turns[:-1], turns[1:]).max()
        for turns in (
            # What the gait does between two frames is another matter.
            reaching.grasp.apply(times, swaying(times), reaching.base(0.0 * times + 7.0))
            for times in (frames(0.1), frames(0.05))
        )
    )
    # A pop would keep its size.
    assert fine < 0.6 * coarse


def test_a_frame_does_not_depend_on_others() -> None:
    reaching = case(places=swaying(frames()))
    times = frames()
    together = reaching.rotations(times, swaying(times))
    order = np.random.default_rng(0).permutation(len(times))[:20]
    for number in order:
        alone = times[number : number + 1]
        np.testing.assert_allclose(
            reaching.rotations(alone, swaying(alone))[0], together[number], atol=1e-9
        )


@every_build
@pytest.mark.parametrize("name", ["rod", "bottle", "ball", "box"])
def test_the_arm_does_not_pass_through_what_it_holds(joints: int, name: str) -> None:
    form = getattr(objects, name)()
    where = WHERE + (0.2 if name in {"ball", "box"} else 0.0) * UP
    times = frames(0.5)
    reaching = case(joints, form, still(frames(), where))
    held = (times >= TIMELINE.contact) & (times <= TIMELINE.release)
    points = reaching.joints(times, still(times, where))
    middles = 0.5 * (points[:, 1:] + points[:, :-1])
    skin = 0.5 * (reaching.radii[1:] + reaching.radii[:-1])
    clear = reaching.grasp.profile.clearance(still(times, where).into(middles)) / skin
    # Bones press in by 0.3 of the skin; flesh gives. While the arm winds, by up to a half.
    assert clear[(times >= TIMELINE.closed) & held].min() > 0.6
    assert clear[held].min() > 0.45


@pytest.mark.parametrize("joints", [*BUILDS, 200])
def test_what_holds_stays_where_it_is_on_an_object_that_moves(joints: int) -> None:
    times = frames()
    reaching = case(joints, places=swaying(times), rolls=True)
    held = (times >= TIMELINE.closed) & (times <= TIMELINE.release)
    places = swaying(times[held])
    coil = reaching.grasp.coil
    points = places.into(reaching.joints(times[held], places))
    stretch = points[:, coil.first : coil.first + len(coil.joints)]
    assert np.max(np.linalg.norm(stretch - coil.joints, axis=-1)) < 1e-6


def test_suckers_face_the_rod_while_it_is_held() -> None:
    times = frames()
    reaching = case(30)
    held = (times >= TIMELINE.closed) & (times <= TIMELINE.release)
    along = reaching.arm.from_bones(reaching.rotations(times, still(times))[held])
    first = reaching.grasp.coil.first
    facing = rotate(along[:, first:], np.array([0.0, 1.0, 0.0]))
    points = reaching.arm.joints(along)
    middles = 0.5 * (points[:, 1:] + points[:, :-1])[:, first:]
    outward = (middles - WHERE) * [1.0, 1.0, 0.0]
    outward /= np.linalg.norm(outward, axis=-1, keepdims=True)
    assert np.max(np.sum(facing * outward, axis=-1)) < -0.95


def test_twist_is_spread_and_wrings_no_bone() -> None:
    times = frames()
    reaching = case(12)
    held = (times >= TIMELINE.closed) & (times <= TIMELINE.release)
    rotations = reaching.rotations(times, still(times))[held]
    along = reaching.arm.shape(reaching.arm.from_bones(rotations))
    twist = 2.0 * np.arctan2(np.abs(along[..., 1]), np.abs(along[..., 0]))[:, 1:]
    assert np.degrees(twist.max()) < 30.0


def test_a_touch_leaves_the_tip_free() -> None:
    times = frames()
    reaching = case(30, mode="TOUCH")
    at = np.searchsorted(times, 60.0)
    points = reaching.joints(times, still(times))[at]
    clear = reaching.grasp.profile.clearance(points - WHERE)
    first = reaching.grasp.coil.first
    assert clear[first] == pytest.approx(reaching.radii[first], abs=0.02)
    assert clear[-1] > 0.05
    assert reaching.grasp.turns < 0.3


@pytest.mark.parametrize("mode", ["COIL", "TOUCH"])
@pytest.mark.parametrize("joints", [7, 12, 30])
@pytest.mark.parametrize("past", [(-0.1, 0.15, -0.15), (0.05, 0.0, -0.2), (0.2, -0.05, 0.0)])
def test_an_arm_much_too_long_does_not_turn_over_as_what_it_holds_passes_its_root(
    joints: int, mode: Mode, past: tuple[float, float, float]
) -> None:
    ends = case(joints).arm.root + np.array(past)

    def passing(times: Floats) -> Places:
        share = least_jerk((times - 45.0) / 35.0)[:, None]
        return Places(WHERE + share * (ends - WHERE), still(times).rotations)

    reaching, largest = case(joints, places=passing(frames()), mode=mode), []
    for step in (0.125, 0.0625):
        times = frames(step)
        times = times[(times >= TIMELINE.contact) & (times <= TIMELINE.release)]
        points = reaching.joints(times, passing(times))
        along = np.diff(points, axis=1) / reaching.arm.lengths[:, None]
        largest.append(float(np.linalg.norm(np.diff(along, axis=0), axis=-1).max()))
        first = reaching.grasp.coil.first
        there = passing(times).seen(reaching.grasp.coil.joints[0])
        closed = times >= TIMELINE.closed
        np.testing.assert_allclose(points[closed, first], there[closed], atol=1e-9)
    # It turned over between two frames, however near, and was up to 0.6 off.
    assert largest[1] < 0.6 * largest[0], largest


def test_an_object_that_gets_out_of_reach_is_let_go_before() -> None:
    times = frames()
    places = still(times)
    places.positions[70:, 0] += 2.0
    reaching = case(places=places)
    assert 55.0 <= reaching.grasp.timeline.release < 70.0
    # It takes as long to go back.
    assert reaching.grasp.timeline.end - reaching.grasp.timeline.release == 30.0
    # Until then it holds it as one that stays.
    points, still_there = reaching.joints(times, places), case().joints(times, still(times))
    first = reaching.grasp.coil.first
    at = np.searchsorted(times, 58.0)
    np.testing.assert_allclose(points[at, first:], still_there[at, first:], atol=1e-9)


def test_an_object_that_is_carried_out_of_reach_is_told_with_its_frame() -> None:
    times = frames()
    places = still(times)
    places.positions[50:, 0] += 2.0  # before the arm is wound about it
    with pytest.raises(SettingsError, match=r"'Rod' is out of reach of 'Arm 1 L' at frame 50"):
        case(places=places)
    gone = still(times)
    gone.positions[90:, 0] += 2.0  # after it has been let go
    assert case(places=gone).grasp.turns > 0.3


def test_an_object_that_the_arm_starts_in_is_told() -> None:
    with pytest.raises(RigError, match="within the object"):
        case(form=objects.rod(0.4), places=still(frames(), np.array([0.1, -0.1, -0.3])))


def test_a_reach_outside_of_the_motion_is_told() -> None:
    skeleton, arms, body = body_with_arms(2, 6)
    arm = frames_of_arm(skeleton, arms[0].bones, body)
    times = np.arange(5.0)
    target = Target(profile_of(*objects.rod()), still(times))
    with pytest.raises(SettingsError, match="outside of the motion"):
        plan_grasp(arm, np.full(7, 0.02), target, TIMELINE, times)


@pytest.mark.parametrize(
    "wrong", [(10, 10, 20, 30, 40), (10, 20, 15, 30, 40), (10, 20, 30, 25, 40), (0, 1, 2, 3, 3)]
)
def test_times_out_of_order_are_told(wrong: tuple[float, ...]) -> None:
    with pytest.raises(SettingsError, match="out of order"):
        Timeline(*wrong)


def test_a_motion_that_ends_before_the_release_holds_on() -> None:
    reaching = case()
    times = frames()[:70]
    assert np.all(reaching.grasp.progress(times).weight(np.array([0.0, 1.0]))[-1] == 1.0)
    points = reaching.joints(times, still(times))
    first = reaching.grasp.coil.first
    np.testing.assert_allclose(points[-1, first:], points[60, first:], atol=1e-6)


def test_the_way_of_least_jerk_starts_and_ends_at_rest() -> None:
    t = np.linspace(-0.5, 1.5, 4001)
    way = least_jerk(t)
    assert way[0] == 0.0
    assert way[-1] == 1.0
    assert np.max(np.diff(way, 2)) < 2e-6  # no corner
    np.testing.assert_allclose(way + least_jerk(1.0 - t), 1.0, atol=1e-12)


# --- The curl -------------------------------------------------------------------------------------


@every_build
def test_a_curl_rolls_the_tip_up_and_stretches_it_again(joints: int) -> None:
    skeleton, arms, body = body_with_arms(4, joints)
    arm = frames_of_arm(skeleton, arms[0].bones, body)
    times = frames(0.5)
    rest = np.tile(IDENTITY, (len(times), joints, 1))
    result = curled(arm, TIMELINE, times, rest)
    away = np.linalg.norm(arm.joints(arm.from_bones(result))[:, -1] - arm.root, axis=-1)
    apart = (times <= TIMELINE.start) | (times >= TIMELINE.end)
    np.testing.assert_array_equal(result[apart], rest[apart])
    held = (times >= TIMELINE.contact) & (times <= TIMELINE.release)
    assert np.all(away[held] < 0.75)
    coarse = angle_between(result[:-2:2], result[2::2]).max()
    assert angle_between(result[:-1], result[1:]).max() < 0.6 * coarse
