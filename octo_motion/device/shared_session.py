# SPDX-License-Identifier: GPL-3.0-or-later
"""A session of posing in Blender whose steps the bridge takes, where there is one.

Blender's redraw then waits for no physics, and physics for no redraw. All that is changed in
Blender is changed in the session here; at each tick the bridge is told what it does not know yet,
and what has come of the tick before is taken over: where all bodies are and how they move. So a
bridge that is lost leaves nothing behind that the session could not go on from by itself.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, field, fields
from typing import Any, Final

import numpy as np

from ..core.phrases import phrase
from ..core.posing.balance import carried, keep_balance
from ..core.posing.puppet import Figure, Flags, Pose
from ..core.posing.session import REST_TIME, HandSample, Session, TickReport, lead
from ..core.posing.solver import HandSpring, Obstacle
from ..core.rotations import Floats
from .ipc import Client, ClientState
from .messages import (
    MOTION,
    Button,
    FigureMessage,
    LetGo,
    Pins,
    Place,
    Take,
    Tick,
    Ticked,
    TurnBack,
    WorldMessage,
)

GOES_ON: Final = phrase("The program that simulates has ended: Blender goes on by itself")

_PATIENCE: Final = 3.0
"""s that a tick may go unanswered."""


@dataclass
class _Told:
    """What a bridge knows."""

    bridge: object
    """Which one it is."""
    figure: Figure | None = None
    world: WorldMessage | None = None
    obstacles: tuple[Obstacle, ...] = ()
    pins: dict[int, bool] = field(default_factory=dict[int, bool])
    hands: dict[HandSpring, int] = field(default_factory=dict[HandSpring, int])
    """By what they hold, their numbers."""
    placed: bool = False
    """Whether the figure stands there as it stands here."""
    waiting: float | None = None
    """Since when a tick has not been answered, by ``time.monotonic``."""


class SharedSession(Session):
    """A session that simulates by itself until a bridge does, and again once that is lost."""

    def __init__(self, *given: Any, **named: Any) -> None:
        """As ``Session``."""
        super().__init__(*given, **named)
        self.kept = range(0)
        """Bodies of the first figure, if it is to keep its balance."""
        self.buttons: list[Button] = []
        """That were pressed or let go at devices; to be cleared by the caller."""
        self.said = ""
        """Once: what has happened to the bridge, for people; to be cleared by the caller."""
        self._client: Client | None = None
        self._told: _Told | None = None
        self._step_there = self.world.settings.step
        self._report = TickReport(0.0, 0, 1.0, self._step_there, resting=False)
        self._passed = 0.0
        self._asked = 0
        self._given = 0
        self._grabbing: set[int] = set()
        self._loads: Floats | None = None
        self._carried: list[int] = []
        self._useless: object = None

    def share(self, client: Client, step: float | None = None) -> None:
        """Let a bridge take the steps from now on, as soon as it is there and nobody holds
        anything; s of one step, if other than here.
        """
        self._client, self._told = client, None
        self._step_there = step or self._step_there

    @property
    def shared(self) -> bool:
        """Whether a bridge takes the steps now."""
        return self._told is not None

    def loads(self) -> Floats:
        """(bodies, 3) torques that joints bear, see ``World.joint_loads``."""
        return self.world.joint_loads() if self._loads is None else self._loads

    def carried(self) -> list[int]:
        """Bodies that something below has carried in the last step."""
        return self._carried if self.shared else carried(self)

    # --- What of a session is otherwise ----------------------------------------------------------

    def tick(
        self, seconds: float, hands: Mapping[HandSpring, HandSample] | None = None
    ) -> TickReport:
        """As ``Session.tick``; of a bridge, what has come of the tick before."""
        hands = hands or {}
        told = self._bridge()
        if told is None or self._client is None:
            keep_balance(self, self.kept)
            return super().tick(seconds, hands)
        self._hear(self._client, told)
        self._passed += max(seconds, 0.0)
        self._tell(self._client, told)
        if told.waiting is None:
            self._ask(self._client, told, hands)
        return self._report

    def show(self, pose: Pose) -> None:
        super().show(pose)
        self._put()

    def _step(self, taken: list[Any], kept: list[Any]) -> bool:
        done = super()._step(taken, kept)
        self._put()
        return done

    def _turn_back(self, joints: Flags, pose: Pose) -> None:
        super()._turn_back(joints, pose)
        if self._told is not None and self._client is not None and self._told.placed:
            turned = tuple(map(int, joints))
            self._client.send(TurnBack(turned, pose.positions, pose.orientations))

    def _put(self) -> None:
        if self._told is not None:
            self._told.placed = False

    # --- The bridge ------------------------------------------------------------------------------

    def _bridge(self) -> _Told | None:
        """What the bridge knows that takes the steps; None where there is none."""
        client, told = self._client, self._told
        if client is None:
            return None
        before = client.state
        self.buttons += client.poll()
        there = client.bridge is not None and client.bridge is not self._useless
        if told is not None and told.waiting is not None and client.ticked is None:
            late = time.monotonic() - told.waiting > _PATIENCE
            if late or client.silent:
                # It hangs, or does not take what it is told.
                there, self._useless = False, told.bridge
        if told is not None and not (there and client.bridge is told.bridge):
            self._told = self._loads = None
            self.said = GOES_ON
        elif before is not client.state is ClientState.LOST:
            self.said = GOES_ON
        elif told is None and there and not self.world.grabs:
            # Never in the middle of a drag: that goes on as it began.
            self._told = _Told(client.bridge)
            self._passed = 0.0
        return self._told

    def _hear(self, client: Client, told: _Told) -> None:
        """Take over what has come of the last tick."""
        answer, client.ticked = client.ticked, None
        if answer is None or not told.placed or answer.number != self._asked:
            return
        told.waiting = None
        if len(answer.positions) != len(self.figure):
            return
        held = {number for number, each in client.pointers.items() if each.body >= 0}
        if held - self._grabbing:
            # Before the first pose that follows from a grab: that is what a step back leads to.
            self.remember()
        self._grabbing = held
        if not (answer.resting and self._report.resting):
            self._take(answer)
        pulled = np.array(answer.pulled, dtype=bool)
        self.pulled = None if self.pulled is None or not len(pulled) else self.pulled | pulled
        numbers = {number: spring for spring, number in told.hands.items()}
        for number, wrench in zip(answer.hands, answer.wrenches, strict=False):
            if number in numbers:
                numbers[number].wrench = wrench
        self._report = TickReport(
            *(answer.simulated, answer.steps, answer.ratio, answer.length, answer.resting)
        )

    def _take(self, answer: Ticked) -> None:
        motion = {name: getattr(answer, name) for name in ("orientations", *MOTION)}
        roots = answer.positions[np.array(self.figure.parents) < 0]
        self.move_on({"roots": roots, **motion})
        self._loads, self._carried = answer.loads, list(answer.carried)
        self._calm = REST_TIME if answer.resting else 0.0
        self.time = answer.time

    def _tell(self, client: Client, told: _Told) -> None:
        """Say what the bridge does not know yet."""
        settings = self.world.settings
        wanted = WorldMessage(
            *(self._step_there, settings.gravity, settings.self_collision),
            *(settings.friction, settings.drag),
        )
        if wanted != told.world:
            told.world = wanted
            client.send(wanted)
        if self.world.obstacles != told.obstacles:
            _send_obstacles(client, told.obstacles, self.world.obstacles)
            told.obstacles = self.world.obstacles
        if self.figure is not told.figure:
            # Of another material it goes on as it moves.
            if told.figure is None or self.figure.anchors is not told.figure.anchors:
                told.placed, told.pins = False, {}
            told.figure = self.figure
            client.send(FigureMessage.of(self.figure))
        if not told.placed:
            self._place(client, told)
        if self.pins != told.pins:
            told.pins = self.pins
            client.send(Pins.of(told.pins, len(self.figure)))
        self._tell_hands(client, told)

    def _place(self, client: Client, told: _Told) -> None:
        pose, moving = self.pose, self.world.state().bodies
        client.send(Place(pose.positions, pose.orientations, *(moving[name] for name in MOTION)))
        told.placed, told.waiting = True, None
        told.hands.clear()
        # Hands that still hold will let go: that is no grab of their own.
        self._grabbing = set(client.pointers)

    def _tell_hands(self, client: Client, told: _Told) -> None:
        for spring in [each for each in told.hands if each not in self.world.grabs]:
            client.send(LetGo(told.hands.pop(spring)))
        for spring in self.world.grabs:
            if spring not in told.hands:
                self._given += 1
                told.hands[spring] = self._given
                x, y, z = map(float, spring.target_position)
                pull = astuple(spring.coupling)
                client.send(Take(self._given, spring.body, (x, y, z), pull))

    def _ask(self, client: Client, told: _Told, hands: Mapping[HandSpring, HandSample]) -> None:
        """Have the time that has passed simulated, with hands on their way to where they are."""
        there = {each: hand for each, hand in hands.items() if each in told.hands}
        # Should the bridge be lost, they go on from where they were led.
        lead(there)
        self._asked += 1
        client.send(
            Tick(
                *(self._asked, self._passed, len(self.kept)),
                tuple(told.hands[each] for each in there),
                np.array([hand.position for hand in there.values()]).reshape(-1, 3),
                np.array([hand.orientation for hand in there.values()]).reshape(-1, 4),
            )
        )
        told.waiting, self._passed = time.monotonic(), 0.0


def _send_obstacles(
    client: Client, before: Sequence[Obstacle], obstacles: Sequence[Obstacle]
) -> None:
    for number, obstacle in enumerate(obstacles):
        # All of them are read anew at each frame; what has not moved need not be sent again.
        if number >= len(before) or not _alike(obstacle, before[number]):
            client.send_obstacle(number, obstacle)
    for number in range(len(obstacles), len(before)):
        client.send_obstacle(number, None)


def _alike(first: Obstacle, second: Obstacle) -> bool:
    return type(first) is type(second) and all(
        np.array_equal(getattr(first, each.name), getattr(second, each.name))
        for each in fields(first)
        if each.init
    )
