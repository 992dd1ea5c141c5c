# SPDX-License-Identifier: GPL-3.0-or-later
"""A hand that holds a puppet, and the time that passes meanwhile."""

from dataclasses import replace

import numpy as np
import pytest

from octo_motion.core.posing.puppet.figure import Figure, Pose
from octo_motion.core.posing.puppet.materials import elements_for
from octo_motion.core.posing.session import COARSEST, HandSample, Session, TickReport
from octo_motion.core.posing.solver.obstacle_shapes import Box
from octo_motion.core.posing.solver.world import WorldSettings
from octo_motion.core.rotations import (
    IDENTITY,
    Floats,
    angle_between,
    conjugate,
    from_axis_angle,
    multiply,
    rotate,
)
from tests.core.puppets import chain, doll, octopus, posed, puppet, soft

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


# --- What is bent stays ---------------------------------------------------------------------------


def arm(bones: int) -> Figure:
    """An arm of a metre that tapers, in so many bones."""
    widths = 1.0 - 0.6 * np.arange(bones) / bones
    widths /= widths.sum()
    anchors = [[0.0, 0.0, 0.0]] + [[0.0, width, 0.0] for width in widths[:-1]]
    thin = (0.12 * (1.0 - 0.6 * np.arange(bones) / bones)).tolist()
    return puppet(range(-1, bones - 1), anchors, widths.tolist(), thin)


def came_back(figure: Figure, material: str, body: int, way: Floats) -> float:
    """Of a drag of a limb's end by ``way``, m, that was held still for half a second, the share
    that is gone once it was let go."""
    figure = replace(figure, elements=elements_for(figure, material))
    session = Session(figure, posed(figure), WorldSettings(step=4e-3), clock=None)
    session.pin(0, state=True)
    start = session.pose
    point = start.positions[body] + rotate(
        start.orientations[body], [0.0, figure.lengths[body], 0.0]
    )
    hand = session.grab(body, point)
    for share in np.minimum(np.arange(1, 76) / 45.0, 1.0):
        session.tick(TICK, {hand: HandSample(point + share * way, IDENTITY)})
    held = session.held_point()
    assert held is not None
    session.release()
    ticks(session, 30)
    back = np.linalg.norm(session.world.held_point(hand) - held)
    return float(back / np.linalg.norm(held - point))


@pytest.mark.parametrize(("material", "most"), [("clay", 0.01), ("wire", 0.1), ("doll", 0.01)])
@pytest.mark.parametrize("limb", ["doll's hand", "arm of an octopus", "arm of 30 bones"])
def test_what_is_bent_and_held_still_stays(material: str, most: float, limb: str) -> None:
    """On any chain: springs of a limb's joints do not add up. 1/5 of the limb's reach and more."""
    figure, body, way = {
        "doll's hand": (doll(), 8, np.array([0.0, 0.0, 0.2])),
        "arm of an octopus": (octopus(), 12, np.array([0.12, -0.12, 0.05])),
        "arm of 30 bones": (arm(30), 29, np.array([0.05, -0.1, 0.2])),
    }[limb]
    # Measured: clay 0.1 to 0.4 %, wire 2 to 6 %, doll 0.2 to 0.7 %.
    assert came_back(figure, material, body, way) < most


def test_limb_springs_back_as_far_into_however_many_bones_it_is_divided() -> None:
    way = np.array([0.0, 0.0, 0.25])
    few, many = (came_back(arm(count), "wire", count - 1, way) for count in (6, 48))
    # Of the same limb a few links are stiffer than many: within a third.
    assert many == pytest.approx(few, rel=0.33)


@pytest.mark.parametrize("material", ["clay", "wire", "doll"])
def test_quick_drag_of_one_wrist_leaves_the_other_limbs_as_they_are(material: str) -> None:
    """Their own inertia does not shake them out of their pose, and none gets a key."""
    figure = replace(doll(), elements=elements_for(doll(), material))
    session = Session(figure, posed(figure), WorldSettings(step=2e-3), clock=None)
    session.pin(0, state=True)
    start = session.pose
    point = start.positions[8]
    hand = session.grab(8, point)
    way = np.array([-0.25, -0.3, 0.3])
    for share in (0.2, 0.4, 0.6, 0.8, 1.0):
        session.tick(TICK, {hand: HandSample(point + share * way, IDENTITY)})
    session.release()
    # With auto keying, keys are made now.
    at_release = session.touched()
    ticks(session, 60)
    arm_and_trunk = {1, 2, 5, 6, 7, 8}
    assert {6, 7} <= set(at_release) <= set(session.touched()) <= arm_and_trunk
    session.put_back()
    others = sorted(set(range(len(figure))) - set(session.touched()))
    turned = angle_between(_turns(figure, start), _turns(figure, session.pose))[others]
    # Not only too little to be keyed, but none: the figure is as its keys will have it.
    assert turned.max() < 1e-9
    ticks(session, 30)
    turned = angle_between(_turns(figure, start), _turns(figure, session.pose))[others]
    assert np.degrees(turned.max()) < 0.01


def _turns(figure: Figure, pose: Pose) -> Floats:
    parents = np.maximum(figure.parents, 0)
    own = multiply(conjugate(pose.orientations[parents]), pose.orientations)
    own[0] = pose.orientations[0]
    return own


def test_limb_that_nobody_holds_gives_way_to_what_it_is_pressed_into() -> None:
    figure = replace(doll(), elements=elements_for(doll(), "clay"))
    start = posed(figure)
    hand_at, root_at = start.positions[8], start.positions[0]
    table = Box(position=hand_at - [0.0, 0.0, 0.1], half=np.array([0.15, 0.15, 0.05]))
    session = Session(figure, start, WorldSettings(step=4e-3), [table], clock=None)
    hand = session.grab(0, root_at, IDENTITY)
    for share in np.linspace(0.0, 1.0, 60):
        session.tick(TICK, {hand: HandSample(root_at - [0.0, 0.0, 0.2 * share], IDENTITY)})
    assert {5, 6, 7, 8} & set(session.touched())
    assert not {9, 10, 11, 12} & set(session.touched())


@pytest.mark.parametrize("material", ["clay", "doll"])
def test_hand_feels_the_box_that_it_presses_a_limb_into(material: str) -> None:
    """Harder the deeper it means to go, and by the box alone: without it there is far less."""
    felt = {}
    for boxes in (True, False):
        figure = replace(doll(), elements=elements_for(doll(), material))
        start = posed(figure)
        point = start.positions[8]
        box = Box(position=point - [0.0, 0.0, 0.13], half=np.array([0.2, 0.2, 0.1]))
        session = Session(
            figure, start, WorldSettings(step=4e-3), [box] if boxes else [], clock=None
        )
        session.pin(0, state=True)
        hand = session.grab(8, point)
        forces = []
        for deep in (0.03, 0.06, 0.09):
            for _ in range(30):
                down = HandSample(point - [0.0, 0.0, deep], IDENTITY)
                session.tick(TICK, {hand: down})
            forces.append(-hand.wrench[2])
        felt[boxes] = np.array(forces)
    assert (np.diff(felt[True]) > 0.0).all()
    # Held still, the joints bear what they yield to; the box pushes back as far as the hand wants.
    assert felt[True][-1] > 3.0 * felt[False][-1]
