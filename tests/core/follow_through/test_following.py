# SPDX-License-Identifier: GPL-3.0-or-later
"""Follow-through of a tail on a body, in numbers alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from octo_motion.core.errors import OctoMotionError
from octo_motion.core.follow_through import (
    STEPS,
    BodyCapsules,
    BoneMotion,
    Displacement,
    Followed,
    FollowJob,
    FollowSettings,
    MovingObstacles,
    Simulation,
    displacement,
    follow,
    repeats,
)
from octo_motion.core.posing.solver import Plane, Sphere
from octo_motion.core.rotations import (
    Floats,
    angle_between,
    conjugate,
    from_rotation_vector,
    multiply,
    rotate,
    to_rotation_vector,
)
from tests.core.tails import stopping, tail_job, wagging
from tests.core.world_probes import energy_of

LENGTH, RADIUS = 0.1, 0.02
"""Of the tails' bones."""


def done(job: FollowJob) -> Followed:
    steps = follow(job)
    while True:
        try:
            next(steps)
        except StopIteration as finished:
            return finished.value


def lag(job: FollowJob, found: Followed) -> Floats:
    """(frames, bones) radians between what the action says and what came of it."""
    return angle_between(found.orientations, job.motion.orientations[:, 1:])


def joints(job: FollowJob, found: Followed) -> Floats:
    """(frames, bones + 1, 3) of heads, and the last one's tail, from orientations alone."""
    steps = rotate(found.orientations, np.array([0.0, LENGTH, 0.0]))
    return np.concatenate(
        [job.motion.positions[:, 1:2], job.motion.positions[:, 1:2] + np.cumsum(steps, axis=1)],
        axis=1,
    )


Done = tuple[FollowJob, Followed]


@pytest.fixture(scope="module")
def usual() -> Done:
    """Two seconds of a wagging body's tail."""
    job = tail_job(wagging)
    return job, done(job)


def test_what_nothing_moves_stays_as_the_action_has_it() -> None:
    job = tail_job()
    assert lag(job, done(job)).max() < 1e-12


def test_tail_lags_swings_over_and_comes_to_rest_where_the_action_has_it() -> None:
    job = tail_job(stopping, seconds=6.0)
    found = done(job)
    tip = joints(job, found)[:, -1, 1] - joints(job, found)[:, 0, 1]
    assert tip[:12].min() < -0.05  # lags: the action has it at 0
    assert tip[12:].max() > 0.02  # swings over
    assert np.abs(tip[-24:]).max() < 1e-3  # settles


def test_stronger_lags_less_and_damped_does_not_swing_over() -> None:
    def most(**settings: float) -> Floats:
        job = tail_job(stopping, FollowSettings(**settings), seconds=3.0)  # type: ignore[arg-type]
        found = done(job)
        tip = joints(job, found)[:, -1, 1] - joints(job, found)[:, 0, 1]
        return np.array([-tip.min(), tip[13:].max()])

    usual, strong, damped = most(), most(strength=4.0), most(damping=1.2)
    assert strong[0] < 0.5 * usual[0]
    assert damped[1] < 0.4 * usual[1]  # what the body's own halt flings it forward


def test_frame_is_the_same_whichever_was_asked_for_before() -> None:
    job = tail_job(wagging, FollowSettings(gravity=0.5, medium="WATER"), seconds=1.0)
    baked = done(job)
    scrubbed = Simulation(job)
    for frame in (20, 3, 24, 0, 11):
        shown = scrubbed.at(frame)[1:]
        assert np.abs(shown - baked.orientations[frame]).max() < 1e-9  # measured: 2e-11


def test_another_frame_rate_gives_the_same_motion(usual: Done) -> None:
    apart = angle_between(usual[1].turns[::2], done(tail_job(wagging, rate=60.0)).turns[::5])
    assert len(apart) == 25
    assert apart.max() < 1e-5  # measured: 3e-6, and 0.2 of lag


def test_rate_of_frames_between_steps_gives_the_same_motion() -> None:
    found = [done(tail_job(wagging, rate=rate)) for rate in (25.0, 50.0)]
    assert angle_between(found[0].turns, found[1].turns[::2]).max() < 2e-5


@pytest.fixture(scope="module")
def cycle() -> Done:
    job = tail_job(wagging, seconds=1.0)
    job = replace(job, cycle=displacement(job.motion, 0))
    return job, done(job)


def test_loop_closes_in_pose_and_speed(cycle: Done) -> None:
    job, found = cycle
    assert found.repeats
    assert np.array_equal(found.turns[0], found.turns[-1])
    speed = to_rotation_vector(multiply(found.turns[1:], conjugate(found.turns[:-1])))
    change = np.linalg.norm(np.diff(speed, axis=0), axis=-1).max(axis=0)
    seam = np.linalg.norm(speed[0] - speed[-1], axis=-1)
    assert (seam < 1.2 * change).all()
    assert lag(job, found).max() > 0.05


def test_loop_is_what_goes_on_for_long_comes_to(cycle: Done) -> None:
    long = done(tail_job(wagging, seconds=8.0))
    assert angle_between(long.turns[-25:], cycle[1].turns).max() < 2e-4


def test_loop_that_travels_and_turns_closes_too() -> None:
    def walking(times: Floats) -> tuple[Floats, Floats]:
        places, turns = wagging(times)
        places[:, 1] = -times
        return places, turns + 0.3 * times[:, None] * np.array([0.0, 0.0, 1.0])

    job = tail_job(walking, seconds=1.0)
    leads = displacement(job.motion, 0)
    assert np.linalg.norm(leads.shift) > 0.9
    found = done(replace(job, cycle=leads))
    assert found.repeats
    assert np.array_equal(found.turns[0], found.turns[-1])


@pytest.mark.parametrize("medium", ["AIR", "WATER"])
def test_loop_of_clay_that_sags_closes_unseen(medium: str) -> None:
    """It creeps on for ever, but by less and less: half a degree over a second is none."""
    settings = FollowSettings(material="CLAY", gravity=1.0, medium=medium)
    job = tail_job(wagging, settings, seconds=1.0)
    found = done(replace(job, cycle=displacement(job.motion, 0)))
    assert found.repeats
    assert found.rounds < 30
    assert np.array_equal(found.turns[0], found.turns[-1])
    speed = to_rotation_vector(multiply(found.turns[1:], conjugate(found.turns[:-1])))
    change = np.linalg.norm(np.diff(speed, axis=0), axis=-1).max(axis=0)
    seam = np.linalg.norm(speed[0] - speed[-1], axis=-1)
    assert (seam < 1.2 * change).all()


def test_loop_that_will_not_repeat_is_told_and_not_run_for_ever() -> None:
    """Without weight and springs a tail goes where it will."""
    job = tail_job(wagging, FollowSettings(material="LIMP", gravity=0.0), seconds=1.0)
    found = done(replace(job, cycle=displacement(job.motion, 0)))
    assert not found.repeats
    assert found.rounds < 50
    assert np.array_equal(found.turns[0], found.turns[-1])


def turning_by(angle: Callable[[Floats], Floats]) -> Callable[[Floats], tuple[Floats, Floats]]:
    """Turns about Z by an angle of the time."""

    def moved(times: Floats) -> tuple[Floats, Floats]:
        turns = np.zeros((len(times), 3))
        turns[:, 2] = angle(times)
        return np.zeros((len(times), 3)), turns

    return moved


@pytest.mark.parametrize(
    ("what", "seconds", "loop"),
    [
        (wagging, 1.0, True),
        (wagging, 2.0, True),
        (wagging, 0.9, False),
        # As far back as it began, and then it would have to turn round at once.
        (wagging, 0.5, False),
        (turning_by(lambda t: 0.5 * np.sin(np.pi * np.clip(t / 0.8, 0.0, 1.0)) ** 2), 1.0, True),
        (turning_by(lambda t: np.abs(np.sin(np.pi * t))), 1.0, False),
        (stopping, 1.0, True),
        (turning_by(lambda t: 0.0 * t), 0.0, False),
    ],
)
def test_motion_that_ends_as_it_begins_is_a_loop(
    what: Callable[[Floats], tuple[Floats, Floats]], seconds: float, *, loop: bool
) -> None:
    motion = tail_job(what, seconds=seconds).motion
    # The tail hangs on the body, which may be elsewhere.
    assert repeats(motion, displacement(motion, 0)) is loop


@pytest.mark.parametrize("medium", ["NONE", "WATER"])
def test_energy_is_never_gained_once_nothing_drives(medium: str) -> None:
    settings = FollowSettings(damping=0.0, gravity=1.0, buoyancy=0.5, medium=medium)
    simulation = Simulation(tail_job(stopping, settings, seconds=3.0))
    simulation.orientations(STEPS)
    energies = []
    for step in range(STEPS, 3 * STEPS):
        simulation.orientations(step)
        energies.append(energy_of(simulation._world).total)
    energy = np.array(energies)
    swing = np.ptp(energy)
    assert swing > 1e-4
    assert np.diff(energy).max() < 1e-9 * swing + 1e-12


def test_tail_sags_until_springs_bear_its_weight() -> None:
    job = tail_job(settings=FollowSettings(gravity=1.0), seconds=8.0)
    found = done(job)
    places = joints(job, found)[-1]
    centres = 0.5 * (places[1:] + places[:-1])
    masses = job.figure.masses
    # The law of the material, in words: a limb's joints together give way by 20° under the weight
    # of what hangs on them when it is stretched out level.
    reach = LENGTH * (np.arange(5) + 0.5)
    level = [9.81 * (masses[j:] * (reach[j:] - LENGTH * j)).sum() for j in range(5)]
    stiffness = np.array(level) / (np.radians(20.0) / 5)
    torque = np.array(
        [
            9.81 * (masses[j:] * np.hypot(*(centres[j:] - places[j])[:, :2].T)).sum()
            for j in range(5)
        ]
    )
    bent = angle_between(found.turns[-1], found.turns[-1] * 0.0 + [1.0, 0.0, 0.0, 0.0])
    bent[0] = lag(job, found)[-1, 0]
    assert np.abs(bent - torque / stiffness).max() < 1e-4 * bent.max()
    assert np.degrees(bent.sum()) == pytest.approx(19.3, abs=0.2)


def test_limp_tail_falls_onto_the_floor_and_not_through() -> None:
    settings = FollowSettings(material="LIMP", gravity=1.0)
    floor = Plane(position=np.array([0.0, 0.0, -0.2]))
    job = tail_job(wagging, settings, seconds=3.0, obstacles=(floor,))
    places = joints(job, done(job))
    assert places[-1, -1, 2] < -0.17
    # measured: 0.06 mm, of 40 mm across
    assert (places[:, 1:, 2] - RADIUS).min() > -0.2 - 2e-4


def test_tail_that_is_flung_stops_at_the_body() -> None:
    """A post stands beside it; the tail comes at several metres a second."""
    post = BodyCapsules((0,), np.array([[[0.3, 0.15, -0.3], [0.3, 0.15, 0.3]]]), np.array([0.03]))

    def flung(times: Floats) -> tuple[Floats, Floats]:
        places = np.zeros((len(times), 3))
        share = np.clip((times - 0.2) / 0.15, 0.0, 1.0)
        places[:, 1] = 0.12 - 0.6 * share * share * (3.0 - 2.0 * share)
        return places, np.zeros((len(times), 3))

    settings = FollowSettings(strength=0.1)
    job = tail_job(flung, settings, seconds=2.0, body=post)
    free = joints(job, done(replace(job, body=None)))
    places = joints(job, done(job))
    shares = np.linspace(0.0, 1.0, 21)[:, None]
    axes = places[:, :-1, None] + shares * (places[:, 1:] - places[:, :-1])[:, :, None]
    there = np.array([0.3, 0.15, 0.0]) + job.motion.positions[:, 0][:, None, None]
    apart = np.hypot(*np.moveaxis((axes - there)[..., :2], -1, 0)).min(axis=(1, 2))
    without = (free - there[:, :, 0])[..., 1].max()
    assert without > 0.2  # it would have gone right through
    assert apart.min() > RADIUS + 0.03 - 1e-3  # measured: 0.2 mm
    # Beyond the post it may bend about it; beside it, it is on this side.
    beside = (axes - there)[np.abs((axes - there)[..., 0]) < 0.02]
    assert len(beside) > 50
    assert beside[:, 1].max() < 0.0


def test_what_begins_in_the_body_comes_no_deeper() -> None:
    """A board of a post lies under the tail, 5 mm too high, and a limp tail falls on it."""
    under = np.array([[[0.05, 0.0, -0.045], [0.6, 0.0, -0.045]]])
    board = BodyCapsules((0,), under, np.array([0.03]))
    settings = FollowSettings(material="LIMP", gravity=1.0, friction=1.0)
    job = tail_job(settings=settings, seconds=1.0, body=board)
    places = joints(job, done(job))
    # It stays on it until it has slid off: to either side, there is nothing.
    on_it = np.abs(places[:, 2:, 1]) < 0.01
    assert places[0, -1, 2] == pytest.approx(0.0, abs=1e-3)
    assert places[:, 2:, 2][on_it].min() > -2e-3


def test_wire_keeps_its_bend_and_rubber_does_not() -> None:
    def left(material: str) -> float:
        def jerk(times: Floats) -> tuple[Floats, Floats]:
            places, turns = stopping(times)
            return 6.0 * places, turns

        job = tail_job(jerk, FollowSettings(material=material, strength=0.4), seconds=4.0)
        return float(lag(job, done(job))[-1].max())

    assert left("WIRE") > 0.05
    assert left("RUBBER") < 1e-2


def test_wind_bends_to_lee_and_water_makes_trail() -> None:
    job = tail_job(settings=FollowSettings(), seconds=1.5, wind=(0.0, 12.0, 0.0))
    assert joints(job, done(job))[-1, -1, 1] > 0.01

    def swims(times: Floats) -> tuple[Floats, Floats]:
        places = np.zeros((len(times), 3))
        places[:, 1] = -0.5 * times
        return places, np.zeros((len(times), 3))

    trails = []
    for medium in ("AIR", "WATER"):
        job = tail_job(swims, FollowSettings(medium=medium, strength=0.3), seconds=1.0)
        places = joints(job, done(job))[-1]
        trails.append(places[-1, 1] - places[0, 1])
    assert trails[1] > 0.1
    assert abs(trails[0]) < 0.01


def test_bones_may_be_of_different_strength_and_change_it(usual: Done) -> None:
    firm = np.full((1, 5), 1.0)
    firm[0, :2] = 1e4
    job = tail_job(wagging, strengths=firm)
    found = done(job)
    bent = lag(job, found).max(axis=0)
    assert bent[1] < 1e-3
    assert bent[4] > 0.03
    off = angle_between(found.turns, usual[1].turns)
    assert off.max() > 0.01
    rows = np.ones((49, 5))
    rows[24:] = 1e4
    job = tail_job(wagging, strengths=rows)
    most = lag(job, done(job)).max(axis=1)
    assert most[:24].max() > 0.05
    assert most[40:].max() < 1e-2


def test_start_at_rest_is_where_it_hangs_and_in_motion_goes_on(usual: Done) -> None:
    at_rest = tail_job(wagging, FollowSettings(start="REST"))
    assert lag(at_rest, done(at_rest))[0].max() < 1e-9
    assert lag(*usual)[0].max() > 0.05


def moved(job: FollowJob, by: Displacement) -> FollowJob:
    return replace(job, motion=by.of(job.motion))


def test_motion_elsewhere_in_the_world_is_the_same(usual: Done) -> None:
    job, found = usual
    by = Displacement(from_rotation_vector(np.array([0.4, 1.1, -0.7])), np.array([3.0, -2.0, 5.0]))
    assert angle_between(found.turns, done(moved(job, by)).turns)[:, 1:].max() < 1e-9


def jerking(times: Floats) -> tuple[Floats, Floats]:
    """Turns somewhere else at each of 24 frames a second."""
    chance = np.random.default_rng(11)
    turns = chance.uniform(-0.6, 0.6, size=(200, 3))
    frames = np.arange(200) / 24.0
    return (
        np.zeros((len(times), 3)),
        np.stack([np.interp(times, frames, each) for each in turns.T], axis=1),
    )


@pytest.mark.parametrize("material", ["WIRE", "CLAY", "DOLL", "LIMP"])
@pytest.mark.parametrize("about", [0.7, 3.0])
def test_what_gives_way_does_so_wherever_the_creature_is_turned_to(
    material: str, about: float
) -> None:
    """Over a floor, with all of its weight, jerked about."""
    settings = FollowSettings(material=material, gravity=1.0)
    floor = Plane(position=np.array([0.0, 0.0, -0.15]))
    job = tail_job(jerking, settings, count=8, seconds=1.5, obstacles=(floor,))
    by = Displacement(from_rotation_vector(np.array([0.0, 0.0, about])), np.array([3.0, -2.0, 0.0]))
    found, elsewhere = done(job), done(moved(job, by))
    assert lag(job, found).max() > 0.2
    off = angle_between(found.turns, elsewhere.turns)
    assert off.max() < 1e-3


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda job: replace(job, settings=FollowSettings(strength=0.0)), "Strength is 0"),
        (lambda job: replace(job, wind=(np.nan, 0.0, 0.0)), "Wind"),
        (lambda job: replace(job, motion=tail_job(seconds=0.0).motion), "too few frames"),
    ],
)
def test_what_makes_no_sense_is_refused(
    change: Callable[[FollowJob], FollowJob], told: str
) -> None:
    with pytest.raises(OctoMotionError, match=told):
        Simulation(change(tail_job()))


def test_tail_is_pushed_aside_by_a_ball_that_passes() -> None:
    """It moves at a metre a second, right through where the tail stands."""
    ball, radius = 0.05, RADIUS
    job = tail_job(seconds=2.0)
    times = np.arange(len(job.motion)) / job.motion.rate
    places = np.stack([0.0 * times + 0.35, times - 0.5, 0.0 * times], axis=1)[:, None]
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1, 1))
    things = MovingObstacles((Sphere(radius=ball),), BoneMotion(job.motion.rate, places, turns))
    job = replace(job, moving=things)
    simulated = done(job)
    found = joints(job, simulated)
    shares = np.linspace(0.0, 1.0, 21)[:, None]
    axes = found[:, :-1, None] + shares * (found[:, 1:] - found[:, :-1])[:, :, None]
    apart = np.linalg.norm(axes - places[:, :, None], axis=-1).min(axis=(1, 2))
    assert apart.min() > ball + radius - 2e-3
    tip = found[:, -1, 1]
    assert tip.max() > 0.1  # it is taken along …
    assert abs(tip[-1]) < 0.05  # … and comes back
    # Whoever asks for a frame first, it is the same.
    alone = Simulation(job).at(20.0)[1:]
    np.testing.assert_allclose(alone, simulated.orientations[20], atol=1e-9)
