# SPDX-License-Identifier: GPL-3.0-or-later
"""A session whose steps the bridge takes: the same numbers, and no physics in Blender."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from octo_motion.core.posing.puppet import Figure
from octo_motion.core.posing.session import HandSample
from octo_motion.core.posing.solver import Plane, World, WorldSettings
from octo_motion.core.rotations import IDENTITY, Floats, from_axis_angle
from octo_motion.core.rotations.scalars import Vector
from octo_motion.device import bridge_process
from octo_motion.device import messages as say
from octo_motion.device.bridge_process import Bridge
from octo_motion.device.ipc import ALONE, Client, ClientState
from octo_motion.device.shared_session import GOES_ON, SharedSession
from octo_motion.device.simulation import Simulation
from tests.core.puppets import chain, doll, octopus, posed, soft
from tests.device.bridges import PATIENCE, bridge_of

TICK = 1.0 / 60.0
CLAY = doll(soft(20, 40.0, 2.0, 4.0, 1.0))
SIDE = np.array([1.0, 0.0, 0.0])


def hand_message(now: float, grab: int, at: Vector) -> say.HandMessage:
    """Of a device's hand at a place, which rests."""
    still, turn = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    return say.HandMessage(0, now, grab, at, turn, still, still, still, still, 0)


class Line:
    """One end of a line in this very process, over which messages go as bytes."""

    def __init__(self) -> None:
        self.other: Line | None = None
        self.came: list[say.Message] = []
        self.most_waiting = 0
        self.log: list[say.Message] = []

    def send(self, message: say.Message, *, droppable: bool = False) -> bool:  # noqa: ARG002
        data = say.pack(message)
        kind, _ = say.read_header(data[: say.HEADER.size])
        self.log.append(message)
        assert self.other
        self.other.came.append(say.read_body(kind, data[say.HEADER.size :]))
        return True

    def receive(self) -> list[say.Message]:
        came, self.came = self.came, []
        return came


def joined() -> tuple[Client, Bridge, Line]:
    """A client and its bridge, in this process; and the client's end of the line."""
    here, there = Line(), Line()
    here.other, there.other = there, here
    client: Any = Client()
    child = SimpleNamespace(channel=here, running=False, stop=lambda *_: None)
    client._take(child)
    line: Any = there
    return client, Bridge(line, None), here


@pytest.fixture(autouse=True)
def still(monkeypatch: pytest.MonkeyPatch) -> None:
    """No clock lengthens the bridge's steps."""
    monkeypatch.setattr(bridge_process, "Simulation", partial(Simulation, clock=lambda: 0.0))


class Pair:
    """The same session twice: in place, and in a bridge."""

    def __init__(self, figure: Figure = CLAY, **settings: Any) -> None:
        obstacles = (Plane(position=np.array([0.0, 0.0, -0.4])),)
        self.figure = figure
        self.alone, self.shared = (
            SharedSession(
                figure, posed(figure), WorldSettings(step=2e-3, **settings), obstacles, clock=None
            )
            for _ in range(2)
        )
        client, self.bridge, self.line = joined()
        self.shared.share(client)
        for each in self.both:
            each.pin(0, state=True, firm=False)
        self.now = 0.0
        self.held: list[Any] = []
        self.shared.tick(0.0)
        self.answer()

    @property
    def both(self) -> tuple[SharedSession, SharedSession]:
        return self.alone, self.shared

    def answer(self) -> None:
        self.now += TICK
        self.bridge.turn(self.now)

    def grab(self, body: int) -> None:
        self.held = []
        for each in self.both:
            self.held.append(each.grab(body, each.pose.positions[body] + [0.0, 0.02, 0.0]))

    def release(self) -> None:
        for each in self.both:
            each.release()

    def tick(self, way: Floats | None = None, turn: Floats = IDENTITY) -> None:
        """One tick more of each; the hand that holds has gone a way from where it took hold."""
        for each, spring in zip(self.both, self.held or [None, None], strict=True):
            hands = {}
            if way is not None and spring is not None:
                hands[spring] = HandSample(self.start + way, turn)
            each.tick(TICK, hands)
        self.answer()

    def drag(self, body: int, way: tuple[float, float, float], ticks: int = 30) -> None:
        self.grab(body)
        self.start = self.held[0].target_position.copy()
        for number in range(1, ticks + 1):
            share = number / ticks
            self.tick(share * np.array(way), from_axis_angle(SIDE, 0.4 * share))
        self.settle()

    def settle(self) -> None:
        """What Blender hears one tick later, it hears now."""
        self.shared.tick(0.0)
        self.answer()

    def difference(self) -> float:
        one, other = (each.world.state().bodies for each in self.both)
        return max(float(np.abs(one[name] - other[name]).max()) for name in one)


@pytest.mark.parametrize(
    "settings",
    [{}, {"gravity": (0.0, 0.0, -9.81)}, {"self_collision": True, "drag": 3.0}],
    ids=["no weight", "weight", "limbs touch"],
)
def test_same_hand_gives_the_same_poses_in_the_bridge_as_in_place(
    settings: dict[str, Any],
) -> None:
    pair = Pair(**settings)
    pair.drag(9, (0.2, -0.1, 0.15))
    assert np.abs(pair.alone.pose.positions - posed(CLAY).positions).max() > 0.05
    assert pair.difference() < 1e-12
    pair.release()
    for _ in range(20):
        pair.tick()
    pair.settle()
    assert pair.difference() < 1e-12
    assert pair.shared.touched() == pair.alone.touched()
    np.testing.assert_allclose(pair.shared.loads(), pair.alone.loads(), atol=1e-9)
    assert pair.shared.carried() == pair.alone.carried()


def test_undo_pins_materials_and_restoring_are_the_same_in_the_bridge() -> None:
    pair = Pair()
    pair.drag(9, (0.2, -0.1, 0.15))
    pair.release()
    for each in pair.both:
        each.pin(4, state=True)
        each.change_elements(soft(20, 80.0, 2.0, 4.0, 2.0))
        each.change(friction=0.2)
    pair.drag(12, (-0.2, 0.1, 0.0))
    assert pair.difference() < 1e-12
    assert [each.step_back() for each in pair.both] == [True, True]
    pair.tick()
    pair.settle()
    assert pair.difference() < 1e-12
    pair.drag(12, (0.0, 0.1, 0.1))
    assert pair.difference() < 1e-12
    for each in pair.both:
        each.put_back()
    pair.tick(np.array([0.0, 0.1, 0.12]))
    pair.settle()
    assert pair.difference() < 1e-12
    assert pair.shared.touched() == pair.alone.touched()
    for each in pair.both:
        each.restore()
    pair.drag(9, (0.1, 0.0, 0.1))
    assert pair.difference() < 1e-12


def test_balance_is_kept_in_the_bridge_as_in_place() -> None:
    pair = Pair(gravity=(0.0, 0.0, -9.81))
    for each in pair.both:
        each.pin(0, state=False)
        each.kept = range(20)
    pair.drag(9, (0.3, 0.0, 0.0))
    assert pair.alone.world.forces[0].any()
    assert pair.difference() < 1e-12


def test_blender_takes_no_step_while_a_bridge_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """However slow the physics: a figure of many bones costs Blender a message each way."""
    pair = Pair(octopus(joints=24))
    steps: list[int] = []
    step = World.step

    def counted(world: World) -> None:
        steps.append(id(world))
        step(world)

    monkeypatch.setattr(World, "step", counted)
    pair.drag(9, (0.1, 0.0, 0.1), ticks=3)
    assert id(pair.alone.world) in steps
    assert id(pair.shared.world) not in steps
    assert pair.difference() < 1e-12


def test_bridge_that_is_slow_is_asked_once_and_gets_all_the_time() -> None:
    pair = Pair()
    pair.grab(9)
    asked = len(pair.line.log)
    for _ in range(10):
        pair.shared.tick(TICK)
    ticks = [each for each in pair.line.log[asked:] if isinstance(each, say.Tick)]
    assert len(ticks) == 1
    pair.answer()
    pair.shared.tick(TICK)
    pair.answer()
    last = pair.line.log[-1]
    assert isinstance(last, say.Tick)
    assert last.seconds == pytest.approx(10.0 * TICK)


def test_redraw_that_takes_long_does_not_slow_the_puppet_down() -> None:
    """Blender by itself makes up for 0.1 s at most: it would stand still for longer and longer."""
    pair = Pair()
    pair.grab(9)
    target = np.add(pair.shared.pose.positions[9], [0.1, 0.0, 0.1])
    hand = pair.held[1]
    before = pair.shared.time
    for _ in range(4):
        pair.shared.tick(0.3, {hand: HandSample(target, IDENTITY)})
        pair.answer()
    report = pair.shared.tick(0.0)
    assert report.simulated == pytest.approx(0.3, abs=5e-3)
    assert pair.shared.time - before == pytest.approx(1.2, abs=0.02)
    np.testing.assert_allclose(hand.target_position, target)
    assert pair.bridge.simulation
    (there,) = pair.bridge.simulation.own.values()
    np.testing.assert_allclose(there.target_position, target)


def test_mouse_and_device_hold_two_limbs_of_one_session() -> None:
    """The device's hand keeps time by itself; the mouse's goes to where it is between ticks."""
    pair = Pair(chain(6, elements=soft(6, 40.0, 2.0, 100.0, 1.0)))
    client, bridge, session = pair.shared._client, pair.bridge, pair.shared
    assert client
    simulation = bridge.simulation
    assert simulation
    tip, middle = session.pose.positions[[5, 2]]
    x, y, z = map(float, np.add(tip, [0.0, 0.15, 0.0]))
    mouse = session.grab(2, middle)
    for number in range(300):
        now = 1.0 + 2e-3 * number
        share = min(1.0, number / 200)
        at = (x + 0.2 * share, y, z)
        bridge._heard[0] = hand_message(now, 1, at)
        if number % 8 == 0:
            session.tick(
                TICK, {mouse: HandSample(np.add(middle, [0.0, 0.0, 0.1 * share]), IDENTITY)}
            )
        bridge.turn(now)
    session.tick(TICK)
    assert simulation.hands[0].spring is not None
    assert len(simulation.world.grabs) == 2
    assert client.pointers[0].body == 5
    assert session.pose.positions[2][2] - middle[2] > 0.02
    assert session.pose.positions[5][0] - tip[0] > 0.1
    assert {2, 5} & set(session.touched())
    # What the device took hold of can be taken back, too; then both let go.
    assert session.step_back()
    session.tick(TICK)
    bridge._heard.clear()
    bridge.turn(2.0)
    assert not simulation.world.grabs


def test_balance_is_kept_while_a_device_keeps_time_too() -> None:
    pair = Pair(gravity=(0.0, 0.0, -9.81))
    pair.shared.pin(0, state=False)
    pair.shared.kept = range(20)
    pair.bridge._heard[0] = hand_message(0.0, 0, (9.0, 9.0, 9.0))
    simulation = pair.bridge.simulation
    assert simulation
    for number in range(300):
        if number % 8 == 0:
            pair.shared.tick(TICK)
        pair.bridge.turn(1.0 + 2e-3 * number)
    assert simulation.keeps_time
    assert simulation.world.forces[0].any()
    pair.shared.kept = range(0)
    for number in range(20):
        pair.shared.tick(TICK)
        pair.bridge.turn(2.0 + TICK * number)
    assert not simulation.world.forces[0].any()


@pytest.mark.parametrize(
    "message",
    [
        say.Take(1, 20, (0.0, 0.0, 0.0), (1.0,) * 6),
        say.Take(1, 2, (0.0, 0.0, 0.0), (-1.0,) * 6),
        say.Tick(1, -1.0, 0, (), np.zeros((0, 3)), np.zeros((0, 4))),
        say.Tick(1, 1.0, 0, (1,), np.zeros((0, 3)), np.zeros((0, 4))),
        say.Tick(1, 1.0, 0, (1,), np.zeros((1, 3)), np.zeros((1, 4))),
        say.TurnBack((1, 0), np.zeros((2, 3)), np.tile(IDENTITY, (2, 1))),
        say.Place(np.zeros((20, 3)), np.zeros((20, 4))),
        say.Place(np.zeros((20, 3)), np.tile(IDENTITY, (20, 1)), np.tile(IDENTITY, (3, 1))),
    ],
    ids=["no body", "pushes", "back in time", "nowhere", "no turn", "other", "no turns", "few"],
)
def test_nonsense_changes_nothing_in_the_bridge_and_is_answered(message: say.Message) -> None:
    pair = Pair()
    client = pair.shared._client
    assert client
    client.poll()
    client.send(message)
    pair.answer()
    client.poll()
    assert len(client.notices) == 1
    pair.drag(9, (0.2, -0.1, 0.15), ticks=5)
    assert pair.difference() < 1e-12


# --- The bridge as a process ----------------------------------------------------------------------


@pytest.fixture
def client() -> Iterator[Client]:
    client = Client()
    yield client
    client.stop()


def session_with(client: Client) -> SharedSession:
    session = SharedSession(CLAY, posed(CLAY), WorldSettings())
    session.pin(0, state=True)
    session.share(client)
    return session


def tick_until(session: SharedSession, what: Callable[[], object], **more: Any) -> None:
    latest = time.monotonic() + PATIENCE
    while not what():
        session.tick(TICK, **more)
        assert time.monotonic() < latest
        time.sleep(0.005)


def test_drag_that_begins_before_the_bridge_answers_goes_on_as_it_began(client: Client) -> None:
    client.start_soon((ALONE,))
    session = session_with(client)
    point = session.pose.positions[9]
    hand = session.grab(9, point)
    there = {hand: HandSample(np.add(point, [0.1, 0.0, 0.1]), IDENTITY)}
    tick_until(session, lambda: client.state is ClientState.RUNNING, hands=there)
    session.tick(TICK, there)
    assert not session.shared
    assert np.linalg.norm(session.pose.positions[9] - point) > 0.01
    session.release()
    tick_until(session, lambda: session.shared)


def test_bridge_killed_in_mid_drag_leaves_the_drag_and_says_so_once(client: Client) -> None:
    client.start((ALONE,))
    session = session_with(client)
    tick_until(session, lambda: client.ticked or client.steps)
    point = session.pose.positions[9]
    hand = session.grab(9, point)
    there = {hand: HandSample(np.add(point, [0.1, 0.0, 0.1]), IDENTITY)}
    tick_until(
        session, lambda: np.linalg.norm(session.pose.positions[9] - point) > 0.05, hands=there
    )
    assert session.shared
    before = session.pose
    process = client._child
    assert process
    assert bridge_of(client)
    process._process.kill()
    tick_until(session, lambda: not session.shared, hands=there)
    assert session.said == GOES_ON
    session.said = ""
    assert session.held is hand
    # It goes on from where it was led: no jump.
    assert np.abs(session.pose.positions - before.positions).max() < 0.1
    for _ in range(30):
        session.tick(TICK, there)
    held = session.held_point()
    assert held is not None
    np.testing.assert_allclose(held, np.add(point, [0.1, 0.0, 0.1]), atol=0.05)
    assert session.said == ""
    assert set(session.touched())
    session.release()
    client.restart()
    tick_until(session, lambda: session.shared and client.steps > 0)


def test_bridge_that_does_not_start_leaves_the_session_where_it_is(
    client: Client, tmp_path: Any
) -> None:
    client.start_soon((ALONE,), python=tmp_path / "none")
    session = session_with(client)
    tick_until(session, lambda: session.said)
    assert session.said == GOES_ON
    assert "does not start" in client.notices[0].problem
    session.said = ""
    session.tick(TICK)
    assert session.said == ""


def test_bridge_that_nobody_wants_any_more_ends_as_soon_as_it_answers(client: Client) -> None:
    client.start_soon((ALONE,))
    starting = client._starting
    assert starting
    client.stop()
    latest = time.monotonic() + PATIENCE
    while starting._thread.is_alive():
        assert time.monotonic() < latest
        time.sleep(0.01)
    assert starting.child is None or not starting.child.running
    assert client.state is ClientState.OFF
    client.poll()
    assert client.state is ClientState.OFF
