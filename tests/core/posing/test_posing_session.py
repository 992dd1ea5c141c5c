# SPDX-License-Identifier: GPL-3.0-or-later
"""A hand that holds a puppet, and the time that passes meanwhile."""

from dataclasses import replace

import numpy as np
import pytest

from octo_motion.core.posing.puppet.figure import Figure, Pose
from octo_motion.core.posing.session import COARSEST, HandSample, Session, TickReport
from octo_motion.core.posing.solver.world import WorldSettings
from octo_motion.core.rotations import IDENTITY, Floats, angle_between, from_axis_angle
from tests.core.puppets import chain, posed, soft

TICK = 1.0 / 60.0


def clay(count: int = 4) -> Figure:
    """A rod of joints that give way: enough for what a session does with them."""
    return chain(count, elements=soft(count, 40.0, 2.0, 4.0, 1.0))


class Clock:
    """Seconds that pass when they are told to, or a little each time someone looks."""

    def __init__(self, each_look: float = 0.0) -> None:
        self.now = 0.0
        self.each_look = each_look

    def __call__(self) -> float:
        self.now += self.each_look
        return self.now


def session_of(step: float = 4e-3, clock: Clock | None = None) -> Session:
    """A session with long steps: most of what it does hangs on none of that."""
    figure = clay()
    session = Session(figure, posed(figure), WorldSettings(step=step), clock=clock)
    session.pin(0, state=True)
    return session


def ticks(session: Session, count: int, seconds: float = TICK) -> TickReport:
    """The last of several ticks."""
    report = session.tick(seconds)
    for _ in range(count - 1):
        report = session.tick(seconds)
    return report


def tip(session: Session) -> tuple[int, Floats]:
    return len(session.figure) - 1, session.pose.positions[-1] + [0.0, 0.1, 0.0]


def pull(session: Session, way: tuple[float, float, float], seconds: float = 1.0) -> None:
    body, point = tip(session)
    hand = session.grab(body, point)
    count = round(seconds / TICK)
    for number in range(count):
        target = point + (number + 1) / count * np.array(way)
        session.tick(TICK, {hand: HandSample(target, IDENTITY)})


def same(first: Pose, second: Pose) -> bool:
    return bool(
        (first.positions == second.positions).all()
        and (first.orientations == second.orientations).all()
    )


def test_limb_follows_the_hand_and_stays_where_it_is_left() -> None:
    session = session_of()
    start = session.pose
    pull(session, (0.25, -0.1, 0.1))
    held = session.held_point()
    assert held is not None
    assert session.held is not None
    assert np.linalg.norm(held - session.held.target_position) < 0.1
    session.release()
    ticks(session, 60)
    left = session.pose
    ticks(session, 60)
    assert np.linalg.norm(left.positions[-1] - start.positions[-1]) > 0.1
    assert np.abs(session.pose.positions - left.positions).max() < 5e-3


def test_same_hand_gives_the_same_pose_bit_by_bit() -> None:
    poses = []
    for _ in range(2):
        session = session_of()
        pull(session, (0.25, -0.1, 0.1))
        session.release()
        session.tick(0.3)
        poses.append(session.pose)
    assert same(*poses)


def test_puppet_that_nobody_touches_does_not_move_and_costs_nothing() -> None:
    session = session_of()
    report = ticks(session, 60)
    assert report.resting
    assert report.steps == 0
    assert session.touched() == []


def test_time_that_blender_was_busy_is_not_made_up_for() -> None:
    session = session_of()
    session.grab(*tip(session))
    assert session.tick(5.0).simulated == pytest.approx(0.1)


def test_ticks_of_any_length_add_up_to_the_time_that_has_passed() -> None:
    session = session_of(step=1e-3)
    session.grab(*tip(session))
    for seconds in (0.0004, 0.0004, 0.0004, 0.0173, 0.0085, 0.0002):
        session.tick(seconds)
    assert session.time == pytest.approx(0.027)


def test_steps_become_longer_while_the_computer_is_too_slow_and_shorter_again() -> None:
    clock = Clock(each_look=0.05)
    session = session_of(step=1e-3, clock=clock)
    session.grab(*tip(session))
    report = ticks(session, 30)
    assert report.step == COARSEST
    clock.each_look = 0.0
    report = ticks(session, 60)
    assert report.step == pytest.approx(1e-3)


def test_it_is_told_how_much_slower_than_real_time_the_puppet_is() -> None:
    session = session_of(clock=Clock())
    session.grab(*tip(session))
    report = ticks(session, 40, 0.2)
    assert report.ratio == pytest.approx(0.5, abs=0.02)


def test_window_does_not_stand_still_while_a_large_figure_is_computed() -> None:
    # Each tick takes 0.4 seconds, however few its steps.
    session = session_of(clock=Clock(each_look=0.4))
    session.grab(*tip(session))
    assert session.tick(0.1).steps == 25
    report = ticks(session, 20, 0.1)
    assert report.steps <= 10
    assert report.ratio < 0.5


def test_longer_steps_keep_what_is_held_and_pinned() -> None:
    session = session_of()
    pull(session, (0.2, 0.0, 0.0), seconds=0.5)
    before = session.held_point()
    session.change(step=2e-3)
    assert session.held_point() == pytest.approx(before)
    assert session.pins.keys() == {0}
    session.tick(0.1)
    # The hand goes on pulling, but nothing jumps.
    assert session.held_point() == pytest.approx(before, abs=0.05)


def test_material_is_changed_in_the_hand() -> None:
    session = session_of()
    pull(session, (0.2, 0.0, 0.0), seconds=0.3)
    before = session.pose
    session.change_elements(soft(4, 1.0, 1.0, 1.0, 0.1))
    assert same(session.pose, before)
    session.tick(TICK)


def test_turn_of_the_hand_turns_the_limb() -> None:
    session = session_of()
    body, point = tip(session)
    start = session.pose.orientations[-1]
    hand = session.grab(body, point)
    for number in range(60):
        turn = from_axis_angle([0.0, 1.0, 0.0], 0.02 * (number + 1))
        session.tick(TICK, {hand: HandSample(point, turn)})
    assert angle_between(start, session.pose.orientations[-1]) > 0.3


def test_pinned_limb_stays_while_its_neighbours_are_pulled() -> None:
    session = session_of()
    session.pin(2, state=True)
    place = session.pose.positions[2]
    pull(session, (0.1, -0.1, 0.1))
    assert session.pose.positions[2] == pytest.approx(place, abs=1e-3)
    session.pin(2, state=False)
    assert session.pins.keys() == {0}


def test_touched_are_the_joints_that_were_bent() -> None:
    session = session_of()
    session.pin(2, state=True)
    pull(session, (0.1, -0.05, 0.0))
    session.release()
    assert session.touched() == [3]


def test_restore_brings_back_the_pose_at_the_start() -> None:
    session = session_of()
    start = session.pose
    pull(session, (0.2, 0.0, 0.1))
    session.restore()
    assert session.held is None
    assert session.pose.positions == pytest.approx(start.positions, abs=1e-12)
    assert np.abs(session.world.velocities()).max() == 0.0


def test_each_step_back_is_one_drag() -> None:
    session = session_of()
    start = session.pose
    pull(session, (0.2, 0.0, 0.1))
    session.release()
    first = session.pose
    pull(session, (-0.2, 0.0, 0.1))
    assert session.step_back()
    assert session.pose.positions == pytest.approx(first.positions, abs=1e-12)
    assert session.step_back()
    assert session.pose.positions == pytest.approx(start.positions, abs=1e-12)
    assert not session.step_back()


def test_pose_of_another_frame_is_taken_over_at_rest() -> None:
    session = session_of()
    pull(session, (0.2, 0.0, 0.1))
    other = posed(session.figure, np.tile([0.2, 0.0, 0.1], (4, 1)))
    session.adopt(other)
    assert session.held is None
    assert session.pose.positions == pytest.approx(other.positions, abs=1e-12)
    ticks(session, 30)
    assert session.pose.positions == pytest.approx(other.positions, abs=1e-4)


def test_pose_whose_joints_are_elsewhere_is_taken_over_as_it_is() -> None:
    """Bones that are stretched or moved at another frame: nothing jumps back to where they were."""
    session = session_of()
    session.pin(2, state=True)
    longer = clay()
    anchors = longer.anchors * np.array([[1.0], [1.3], [0.8], [1.1]])
    other = posed(replace(longer, anchors=anchors), np.tile([0.2, 0.0, 0.1], (4, 1)))
    session.adopt(other)
    assert session.pose.positions == pytest.approx(other.positions, abs=1e-12)
    assert session.pins.keys() == {0, 2}
    ticks(session, 30)
    assert session.pose.positions == pytest.approx(other.positions, abs=1e-4)
    pull(session, (0.1, 0.0, 0.0))
    ways = np.linalg.norm(np.diff(session.pose.positions, axis=0), axis=1)
    assert ways == pytest.approx(np.linalg.norm(np.diff(other.positions, axis=0), axis=1))


def test_each_hand_leads_its_own_limb() -> None:
    session = session_of()
    start = session.pose.positions
    hands = {
        session.grab(2, start[2]): HandSample(start[2] + [0.1, 0.0, 0.0], IDENTITY),
        session.grab(3, start[3]): HandSample(start[3] + [0.1, 0.0, 0.1], IDENTITY),
    }
    for _ in range(60):
        session.tick(TICK, hands)
    for hand, sample in hands.items():
        assert session.world.held_point(hand) == pytest.approx(sample.position, abs=0.05)
    first, second = hands
    session.release(first)
    assert session.world.grabs == (second,)
    assert not session.resting
    assert session.touched() == [1, 2, 3]
