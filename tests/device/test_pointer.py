# SPDX-License-Identifier: GPL-3.0-or-later
"""A device in the loop: grabbing, feeling, letting go, and what happens when something fails."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from octo_motion.core.posing.solver.holds import Coupling
from octo_motion.core.posing.solver.world import WorldSettings
from octo_motion.core.rotations import from_rotation_vector
from octo_motion.core.rotations.scalars import IDENTITY, ZERO, Quaternion, Vector, length
from octo_motion.device.calibration import Calibration
from octo_motion.device.driver import DeviceLostError, Kind, Sample
from octo_motion.device.haptics.pointer import Pointer
from octo_motion.device.messages import DeviceMessage, HeldMessage, Settings, Workspace
from octo_motion.device.simulation import Simulation, coupling_for
from octo_motion.device.sources.simulated_hand import Hand, SimulatedHand
from tests.core.puppets import chain, posed, soft
from tests.device.parts import FakeDriver

pytestmark = pytest.mark.one_blender

PERIOD = 0.001


class Table:
    """A device on a table, a pointer, and a clock that the test turns."""

    def __init__(self, driver: FakeDriver | None = None, settings: Settings | None = None) -> None:
        self.driver = driver or FakeDriver()
        self.pointer = Pointer(0, self.driver, PERIOD, settings or Settings())
        self.now = 10.0
        self.place: Vector = ZERO
        self.turn: Quaternion = IDENTITY
        self.velocity: Vector = ZERO
        self.buttons = 0
        self.hand_there = True
        self.silent = False

    def ticks(
        self, count: int = 1, held: HeldMessage | None = None, *, answer: bool = True
    ) -> None:
        for _ in range(count):
            self.now += PERIOD
            if not self.silent:
                self.driver.samples.append(
                    Sample(
                        *(self.now, self.place, self.turn, self.velocity, ZERO),
                        *(self.buttons, self.hand_there),
                        # It says at once which force has come.
                        delay=PERIOD,
                    )
                )
            if held is not None and answer:
                self.hold(held)
            self.pointer.tick(self.now)

    def hold(self, held: HeldMessage, holds: float = 0.0, before: int = 0) -> None:
        """Answer the grab, or one so many before it."""
        grab = self.pointer.grab - before
        self.pointer.hold(replace(held, grab=grab, time=self.now, holds=holds), self.now)

    @property
    def force(self) -> float:
        return length(self.driver.sent[-1][0])


ROCK = HeldMessage(0, 0, held=True, time=0.0)


def grabbed(settings: Settings | None = None) -> Table:
    """A hand that holds a rock and has pulled 5 mm away from it."""
    table = Table(settings=settings)
    table.buttons = 1
    table.ticks(5, ROCK)
    table.place = (0.005, 0.0, 0.0)
    table.ticks(400, ROCK)
    return table


def test_hand_that_holds_nothing_feels_nothing() -> None:
    table = Table()
    table.place = (0.1, 0.0, 0.0)
    table.ticks(300)
    assert table.force == 0.0


def test_hand_is_drawn_back_to_what_it_holds() -> None:
    table = grabbed()
    force, _ = table.driver.sent[-1]
    assert force[0] == pytest.approx(-0.005 * 640.0, rel=0.02)
    assert force[1:] == (0.0, 0.0)


def test_turning_away_is_felt_as_torque() -> None:
    table = Table()
    table.buttons = 1
    table.ticks(5, ROCK)
    w, x, y, z = map(float, from_rotation_vector([0.0, 0.1, 0.0]))
    table.turn = (w, x, y, z)
    table.ticks(400, ROCK)
    _, torque = table.driver.sent[-1]
    assert torque == pytest.approx((0.0, -0.1 * 1.536, 0.0), rel=0.02)


def test_grab_begins_without_a_jump() -> None:
    table = Table()
    table.place = (0.005, 0.0, 0.0)
    table.buttons = 1
    table.ticks(1, ROCK)
    table.ticks(30, ROCK)
    sizes = [length(force) for force, _ in table.driver.sent]
    changes = [b - a for a, b in itertools.pairwise(sizes)]
    assert max(changes) < 0.03  # of 3.2 N within 0.2 s


def test_letting_go_ends_the_force_within_a_moment() -> None:
    table = grabbed()
    table.buttons = 0
    table.ticks(31, ROCK)
    assert table.force == 0.0
    assert table.pointer.grab == 0


def test_button_held_or_toggled_as_the_artist_chose() -> None:
    table = Table(settings=Settings(toggle=True))
    for buttons, wanted in ((1, True), (0, True), (1, False), (0, False), (1, True)):
        table.buttons = buttons
        table.ticks(2)
        assert bool(table.pointer.grab) is wanted
    assert [press for press in table.pointer.presses if press[1]] == [(0, True)] * 3


def test_silent_simulation_takes_the_force_away_in_twenty_milliseconds() -> None:
    table = grabbed()
    before = table.force
    table.ticks(21, answer=False)
    sizes = [length(force) for force, _ in table.driver.sent[-22:]]
    assert before > 3.0
    assert sizes[-1] == 0.0
    assert all(b <= a + 1e-9 for a, b in itertools.pairwise(sizes))
    assert max(a - b for a, b in itertools.pairwise(sizes)) <= 0.11 * 8.0


def test_slow_simulation_may_be_silent_for_as_long_as_a_step_takes_and_no_longer() -> None:
    table = grabbed()
    table.hold(ROCK, holds=0.05)
    before = table.force
    table.ticks(55, answer=False)
    assert table.force == pytest.approx(before)
    table.ticks(16, answer=False)
    assert table.force == 0.0


def test_no_simulation_is_trusted_for_longer_than_a_tenth_of_a_second() -> None:
    table = grabbed()
    table.hold(ROCK, holds=10.0)
    table.ticks(121, answer=False)
    assert table.force == 0.0


def test_silent_device_takes_the_force_away_in_twenty_milliseconds() -> None:
    table = grabbed()
    table.silent = True
    table.ticks(21, ROCK)
    assert table.force == 0.0


def test_simulation_that_stays_silent_ends_the_grab() -> None:
    table = grabbed()
    table.ticks(300)
    assert table.pointer.grab == 0


def test_force_comes_back_gently_after_a_short_stall() -> None:
    table = grabbed()
    table.ticks(25)
    table.ticks(10, ROCK)
    assert 0.0 < table.force < 0.3
    table.ticks(300, ROCK)
    assert table.force > 3.0


def test_force_comes_back_gently_when_the_loop_itself_stood_still() -> None:
    """A laptop that slept: the device let go long ago, and must not be given all at once."""
    table = grabbed()
    assert table.force > 3.0
    table.now += 3.0
    table.ticks(1, ROCK)
    assert table.force < 0.05
    table.ticks(10, ROCK)
    assert 0.0 < table.force < 0.3
    table.ticks(300, ROCK)
    assert table.force > 3.0


def test_loop_that_is_slow_by_itself_gives_force() -> None:
    driver = FakeDriver()
    pointer = Pointer(0, driver, 0.02, Settings())
    pointer.want(grab=True)
    now = 10.0
    for index in range(100):
        now += 0.02 if index % 3 else 0.03
        driver.samples.append(Sample(now, (0.02 * min(1.0, 0.1 * index), 0.0, 0.0), IDENTITY))
        pointer.hold(replace(ROCK, grab=pointer.grab, time=now), now)
        pointer.tick(now)
    assert length(driver.sent[-1][0]) > 0.1


def test_device_never_gets_what_is_no_number() -> None:
    table = grabbed()
    table.pointer.workspace = Workspace(0, scale=5e-324)
    table.ticks(50, ROCK)
    assert all(math.isfinite(each) for force, _ in table.driver.sent for each in force)
    assert table.force == 0.0


def test_device_without_a_hand_on_it_gives_no_force() -> None:
    table = grabbed()
    table.hand_there = False
    table.ticks(40, ROCK)
    assert table.force == 0.0
    ignoring = grabbed(Settings(dead_man=False))
    ignoring.hand_there = False
    ignoring.ticks(40, ROCK)
    assert ignoring.force > 3.0


def test_force_slider_scales_what_is_felt() -> None:
    full, half = grabbed(), grabbed(Settings(force=0.5))
    assert half.force == pytest.approx(0.5 * full.force, rel=1e-3)


def test_lost_device_is_told_to_whoever_runs_the_loop() -> None:
    table = grabbed()
    table.driver.gone = True
    with pytest.raises(DeviceLostError):
        table.ticks(1, ROCK)
    table.pointer.close()
    assert table.driver.sent[-1] == (ZERO, ZERO)


def test_grab_that_is_refused_is_over_until_the_next_one() -> None:
    table = Table()
    table.buttons = 1
    table.ticks(5)
    grab = table.pointer.grab
    table.pointer.hold(HeldMessage(0, grab, held=False, time=table.now), table.now)
    assert table.pointer.grab == 0
    table.ticks(5)
    assert table.pointer.grab == 0
    table.buttons = 0
    table.ticks(1)
    table.buttons = 1
    table.ticks(1)
    assert table.pointer.grab == grab + 1
    table.pointer.hold(HeldMessage(0, grab, held=False, time=table.now), table.now)
    assert table.pointer.grab == grab + 1


def test_answer_to_an_older_grab_is_not_felt() -> None:
    table = grabbed()
    table.buttons = 0
    table.ticks(40, ROCK)
    table.buttons = 1
    table.ticks(1)
    table.hold(ROCK, before=1)
    table.ticks(50)
    assert table.force == 0.0


def test_workspace_says_where_the_hand_is_in_the_scene() -> None:
    table = Table()
    w, x, y, z = map(float, from_rotation_vector([0.0, 0.0, 0.5 * math.pi]))
    table.pointer.place(Workspace(0, (1.0, 2.0, 3.0), (w, x, y, z), 10.0))
    table.place = (0.1, 0.0, 0.0)
    table.velocity = (0.0, 0.2, 0.0)
    table.ticks(1)
    assert table.pointer.position == pytest.approx((1.0, 3.0, 3.0))
    assert table.pointer.velocity == pytest.approx((-2.0, 0.0, 0.0))


def test_moving_the_workspace_lets_go_first() -> None:
    table = grabbed()
    table.pointer.place(table.pointer.workspace)
    table.pointer.place(Workspace(0, (5.0, 0.0, 0.0)))
    table.ticks(31, ROCK)
    assert table.pointer.grab == 0
    assert table.force == 0.0


@pytest.mark.parametrize("what", ["view", "calibration", "calibrating"])
def test_what_moves_the_hands_place_under_it_does_not_push_the_hand(what: str) -> None:
    """It lets go, and what the place jumps by must not be felt while the force fades."""
    table = Table()
    table.buttons = 1
    table.ticks(5, ROCK)
    table.place = (0.0005, 0.0, 0.0)
    table.ticks(400, ROCK)
    before = table.force
    assert 0.1 < before < 1.0
    match what:
        case "view":
            table.pointer.place(Workspace(0, (1.0, 0.0, 0.0)))
        case "calibration":
            table.pointer.correct(Calibration(rest=(0.2, 0.0, 0.0, 0.0, 0.0, 0.0)))
        case _:
            table.pointer.calibrate(begin=True)
            table.place = (0.1, 0.0, 0.0)
    count = len(table.driver.sent)
    table.ticks(60)
    forces = [length(force) for force, _ in table.driver.sent[count:]]
    assert max(forces) <= before
    assert forces[-1] == 0.0


@pytest.mark.parametrize(
    ("place", "turn"),
    [((0.2, 0.0, 0.0), IDENTITY), (ZERO, (0.0, 1.0, 0.0, 0.0))],
)
def test_device_that_is_reset_in_mid_grab_does_not_push(place: Vector, turn: Quaternion) -> None:
    """Firmware that starts anew counts from another place."""
    table = Table()
    table.buttons = 1
    table.ticks(300, ROCK)
    table.place, table.turn = place, turn
    count = len(table.driver.sent)
    table.ticks(60, ROCK)
    assert max(length(force) for force, _ in table.driver.sent[count:]) < 0.01
    assert max(length(torque) for _, torque in table.driver.sent[count:]) < 1e-3
    assert table.pointer.grab == 0


def test_hand_that_is_torn_away_as_fast_as_a_hand_can_still_holds() -> None:
    table = Table()
    table.buttons = 1
    table.ticks(300, ROCK)
    for index in range(20):
        table.place = (0.006 * index, 0.0, 0.0)  # 6 m/s
        table.ticks(1, ROCK)
    # Force grows no faster than a hand may get if the device is late.
    assert table.pointer.grab
    table.ticks(200, ROCK)
    assert table.pointer.grab
    assert table.force > 3.0


def test_scaled_workspace_is_as_stiff_to_the_hand() -> None:
    table = Table()
    table.pointer.place(Workspace(0, ZERO, IDENTITY, 10.0))
    table.buttons = 1
    table.ticks(5, ROCK)
    table.place = (0.005, 0.0, 0.0)
    table.ticks(400, ROCK)
    assert table.force == pytest.approx(0.005 * 640.0, rel=0.02)


def test_space_mouse_moves_its_pointer_with_the_speed_of_the_push() -> None:
    table = Table(FakeDriver(dynamics=None, kind=Kind.RATE))
    table.velocity = (0.4, 0.0, 0.0)
    table.ticks(500)
    assert table.pointer.position == pytest.approx((0.2, 0.0, 0.0))
    assert table.driver.sent == []
    table.pointer.place(Workspace(0, (1.0, 0.0, 0.0), IDENTITY, 2.0))
    table.ticks(500)
    assert table.pointer.position == pytest.approx((1.4, 0.0, 0.0))


def test_device_that_is_being_calibrated_does_not_push() -> None:
    """The hand moves it to its ends, and must be the only one that does."""
    table = Table()
    table.ticks(5)
    table.pointer.test(table.now)
    table.ticks(50)
    table.pointer.calibrate(begin=True)
    table.ticks(40)
    assert table.force == 0.0
    table.pointer.test(table.now)
    table.ticks(100)
    assert table.force == 0.0


def test_test_of_a_device_is_a_gentle_push_each_way() -> None:
    table = Table()
    table.pointer.test(table.now)
    table.ticks(800)
    pushes = [force[0] for force, _ in table.driver.sent]
    assert 0.3 < max(pushes) <= 0.15 * 8.0 + 1e-9
    assert -0.15 * 8.0 - 1e-9 <= min(pushes) < -0.3
    assert pushes[-1] == 0.0


# --- With a real puppet --------------------------------------------------------------------------


class Bench:
    """A puppet in the simulation, a simulated hand, and a clock; a step every so many ticks."""

    def __init__(
        self, every: int = 4, yielding: float = 1.0, step: float = 0.0, cost: float = 0.0
    ) -> None:
        """A step of the simulation takes ``cost`` seconds to compute, by its own clock."""
        self.figure = chain(3, elements=soft(3, 40.0, 2.0, 100.0, yielding))
        self.simulation = Simulation(
            *(self.figure, posed(self.figure)),
            settings=WorldSettings(step=step or every * PERIOD),
            clock=itertools.count(0.0, cost).__next__,
        )
        self.simulation.pin({0: False})
        self.now = 0.0
        self.hand = Hand(tremor=0.0)
        self.driver = SimulatedHand(self.hand, clock=lambda: self.now)
        self.pointer = Pointer(0, self.driver, PERIOD)
        x, y, z = map(float, self.simulation.session.pose.positions[2] + [0.0, 0.15, 0.0])
        self.pointer.place(Workspace(0, (x, y, z)))
        self.every = every
        self.log: list[tuple[Vector, Vector]] = []
        self.work = 0.0
        """J that the hand got."""
        self.most_work = 0.0

    def run(self, seconds: float) -> None:
        for tick in range(round(seconds / PERIOD)):
            self.now += PERIOD
            before = self.hand.position
            force = self.pointer.force
            self.pointer.tick(self.now)
            moved = np.subtract(self.hand.position, before)
            self.work += float(np.dot(force, moved))
            self.most_work = max(self.most_work, self.work)
            if tick % self.every == 0:
                self.simulation.hear(self.pointer.message(self.now))
                self.simulation.step(self.now)
                for held in self.simulation.held(self.now):
                    self.pointer.hold(held, self.now)
            self.log.append((self.pointer.force, self.pointer.torque))


@pytest.mark.parametrize("every", [1, 4, 10])
def test_puppet_follows_the_hand_and_the_hand_feels_it(every: int) -> None:
    bench = Bench(every)
    bench.run(0.1)
    bench.driver.buttons = 1
    bench.run(0.3)
    hand = bench.simulation.hands[0]
    assert hand.spring
    assert hand.spring.body == 2
    bench.hand.wish = lambda _t: ((0.04, 0.0, 0.02), IDENTITY)
    start = bench.simulation.session.pose.orientations[1:]
    bench.run(1.0)
    assert np.abs(bench.simulation.session.pose.orientations[1:] - start).max() > 0.02
    felt = max(length(force) for force, _ in bench.log)
    assert 0.05 < felt <= 8.0
    assert bench.work <= 0.02 + 1e-3, "no more than the store holds came out"
    # Calm at the end: the hand stands still, whatever the step of the simulation.
    assert length(bench.hand.velocity) < 0.02


@pytest.mark.parametrize("every", [15, 34, 60])
def test_simulation_slower_than_the_loop_is_felt_through_the_local_model(every: int) -> None:
    """Steps of 8 ms that take longer: the loop goes on without them, and the force with it."""
    bench = Bench(every, step=8e-3, cost=every * PERIOD)
    bench.run(0.1)
    bench.driver.buttons = 1
    bench.run(2.5)
    assert bench.simulation.pace == pytest.approx(8.0 / every, rel=0.1)
    assert bench.simulation.holds == pytest.approx(1.5e-3 * every, rel=0.02)
    bench.hand.wish = lambda t: ((0.02 * math.sin(6.0 * t), 0.0, 0.04), IDENTITY)
    bench.run(1.0)
    bench.log.clear()
    bench.run(2.0)
    sizes = [length(force) for force, _ in bench.log]
    assert min(sizes) > 0.01, "force at every tick"
    assert 0.05 < max(sizes) < 8.0
    changes = [length(tuple(np.subtract(b[0], a[0]))) for a, b in itertools.pairwise(bench.log)]
    assert max(changes) < 0.25 * max(sizes), "no click when the simulation speaks"
    assert bench.work <= 0.02 + 1e-3, "no more than the store holds came out"


def test_steps_get_longer_when_all_that_is_done_beside_them_takes_too_long() -> None:
    simulation = Bench(2).simulation

    def work(seconds: float) -> float:
        for _ in range(200):
            simulation.worked(seconds)
        return simulation.step_seconds

    assert work(0.0012) == 2e-3
    assert work(0.0018) == 4e-3
    assert work(0.02) == 8e-3, "and no longer: what is coarser would shake"
    assert work(0.0018) == 8e-3, "not to and fro"
    assert work(0.0005) == 2e-3


@pytest.mark.parametrize("scale", [3.0, 10.0])
@pytest.mark.parametrize("every", [2, 25])
def test_hand_never_gets_more_energy_than_it_gave(scale: float, every: int) -> None:
    """What the simulation's own coupling puts into the puppet is no gift to the hand."""
    bench = Bench(every, step=2e-3, cost=1e-4, yielding=50.0)
    space = bench.pointer.workspace
    bench.pointer.place(Workspace(0, space.origin, space.orientation, scale))
    bench.run(0.1)
    bench.driver.buttons = 1
    bench.run(0.3)
    bench.hand.wish = lambda t: (
        (0.04 * math.sin(3.0 * t), 0.0, 0.04 * math.cos(3.0 * t)),
        IDENTITY,
    )
    bench.run(4.0)
    assert bench.most_work < 0.002
    assert bench.pointer.given < 0.005
    forces = [force for force, _ in bench.log]
    assert max(map(length, forces)) > 0.1
    changes = [length(tuple(np.subtract(b, a))) for a, b in itertools.pairwise(forces)]
    assert np.percentile(changes, 95) < 0.3, "and it does not buzz"


@pytest.mark.parametrize(("cost", "pace"), [(0.0005, 1.0), (0.0039, 0.5)])
def test_steps_that_a_busy_machine_left_out_are_made_up_for_if_there_is_time(
    cost: float, pace: float
) -> None:
    bench = Bench(4, step=2e-3, cost=cost)  # woken only every 4 ms
    bench.driver.buttons = 1
    bench.run(1.0)
    assert bench.simulation.pace == pytest.approx(pace, abs=0.01)
    assert bench.simulation.session.time == pytest.approx(pace, abs=0.1)
    bench.simulation.step(bench.now + 0.2)
    assert bench.simulation.session.time <= pace + 0.12, "after a long pause it is not hurried"


@pytest.mark.parametrize("gaps", [(0.003, 0.001), (0.001,), (0.0025, 0.0035, 0.0001), (0.002,)])
def test_puppet_never_runs_ahead_of_the_clock_however_it_is_woken(gaps: tuple[float, ...]) -> None:
    """A body that is ahead of the hand pulls it along: the two would shake each other."""
    simulation = Bench(2, cost=1e-5).simulation
    elapsed = 0.0
    simulation.step(100.0)
    begun = simulation.session.time
    for gap in itertools.islice(itertools.cycle(gaps), 150):
        elapsed += gap
        simulation.step(100.0 + elapsed)
        assert simulation.session.time - begun <= elapsed + 0.5 * simulation.step_seconds + 1e-9
        simulation.session.wake()
    assert simulation.session.time - begun >= elapsed - simulation.step_seconds


def test_one_late_step_does_not_make_a_slow_simulation() -> None:
    bench = Bench(2)
    bench.driver.buttons = 1
    bench.run(0.2)
    assert bench.simulation.holds == 0.0
    bench.simulation.step(bench.now + 0.06)
    assert bench.simulation.holds == 0.0


@pytest.mark.parametrize("stiffness", [5.0, 640.0, 1e6])
@pytest.mark.parametrize("scale", [0.1, 1.0, 30.0])
def test_softest_device_moves_the_puppet_and_the_stiffest_does_not_shake_it(
    stiffness: float, scale: float
) -> None:
    bench = Bench(4)
    device = DeviceMessage(*(0, True, 1, 8.0, 0.4, stiffness, 1.0, "Device", "1:2", ()))
    coupling = coupling_for(bench.figure, posed(bench.figure), device, scale)
    weight = 9.81 * float(bench.figure.masses.sum())
    assert 0.1 * 0.7 * coupling.stiffness > 0.9 * weight  # drawn out by a tenth, it lifts all
    assert coupling.stiffness <= Coupling.for_figure(bench.figure).stiffness
    assert coupling.damping > 0.0


def test_twist_of_a_held_limb_is_felt() -> None:
    bench = Bench(4, yielding=5.0)
    bench.driver.buttons = 1
    bench.run(0.3)
    along = from_rotation_vector([0.0, 0.5, 0.0])
    w, x, y, z = map(float, along)
    bench.hand.wish = lambda _t: (ZERO, (w, x, y, z))
    bench.run(0.5)
    force, torque = bench.pointer.force, bench.pointer.torque
    assert torque[1] < -0.01, "the limb turns back about its own axis"
    assert abs(torque[1]) > 3.0 * max(abs(torque[0]), abs(torque[2]))
    assert length(force) < 1.0


def test_let_go_limb_keeps_its_pose() -> None:
    bench = Bench(4, yielding=0.2)
    bench.driver.buttons = 1
    bench.run(0.2)
    bench.hand.wish = lambda _t: ((0.05, 0.0, 0.0), IDENTITY)
    bench.run(1.0)
    bench.driver.buttons = 0
    bench.run(0.5)
    kept = bench.simulation.session.pose.orientations
    assert bench.pointer.force == ZERO
    bench.run(1.0)
    assert np.abs(bench.simulation.session.pose.orientations - kept).max() < 0.02
