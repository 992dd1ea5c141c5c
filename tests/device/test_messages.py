# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages: what is sent is what is read; anything else is refused, and nothing else happens."""

from __future__ import annotations

import dataclasses
import math
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.posing.solver.obstacle_shapes import (
    Box,
    Capsule,
    Hull,
    Mesh,
    Obstacle,
    Plane,
    Sphere,
)
from octo_motion.device import messages as say
from octo_motion.device.calibration import Calibration, Phase
from octo_motion.device.codec import MessageError
from tests.core.puppets import chain, doll, posed, soft

CORNERS = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 0, 1], [0, 1, 1]]])
FIGURE = doll(soft(20, 1.0, 2.0, 3.0, 4.0))
FIGURE.elements.yield_torque[3] = np.inf  # a joint that never gives way
POSE = posed(FIGURE)
V, Q = (1.0, -2.0, 3.0), (0.5, 0.5, 0.5, 0.5)
TIMES = (1e-6, 2e-6, 3e-6, 4e-3)

EXAMPLES: list[say.Message] = [
    say.Hello(123, "3.13.0", "real-time"),
    say.FigureMessage.of(FIGURE),
    say.Place(POSE.positions, POSE.orientations),
    say.PoseMessage(2, 7, 0.014, POSE.positions, POSE.orientations),
    say.Pins((1, 0, 2)),
    say.Tick(7, 0.016, 3, (4,), np.ones((1, 3)), np.array([Q])),
    say.Take(4, 2, V, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)),
    say.LetGo(4),
    say.TurnBack((1, 0) * 10, POSE.positions, POSE.orientations),
    say.Ticked(
        *(7, 2, 9, 0.5, 0.016, 16, 1.0, 1e-3, *(False,), POSE.positions, POSE.orientations),
        *(POSE.orientations, POSE.positions, POSE.positions, POSE.positions, POSE.positions),
        *((1, 0) * 10, (3,), (4,), np.ones((1, 6))),
    ),
    say.Grab(1, grab=True),
    say.Settings(force=0.5, toggle=True),
    say.Workspace(1, V, Q, 2.0),
    say.DeviceMessage(*(1, True, 1, 8.0, 0.4, 640.0, 1.5, "Händchen", "1:2", ("Schlüssel",))),
    say.PointerMessage(1, 7, V, Q, V, V, V, 3),
    say.Button(1, 2, pressed=True),
    say.Times(999.9, TIMES, TIMES, 3, 0.001, 1.0, 0.012),
    say.Notice("Problem.", "Remedy."),
    say.Goodbye(),
    say.Buzz(1),
    say.WorldMessage(gravity=(0.0, 0.0, -9.81)),
    say.ObstacleMessage.of(3, Sphere(radius=0.5)),
    say.Calibrate(1, say.Order.BEGIN),
    say.CalibrationMessage.of(1, Calibration((0.1, 0.0, 0.0, 0.0, 0.0, 0.0)), Phase.REACH),
    say.HandMessage(1, 2.0, 3, V, Q, V, V, V, V, 5),
    say.HeldMessage(1, 2, *(True,), 3.0, 0.05, V, Q, V, V, say.Pull(1, 2, 3, 4, 5, 6), V, V),
    say.LoopTimesMessage(1000.0, TIMES, TIMES, 0),
]


def sent_and_read(message: say.Message) -> say.Message:
    data = say.pack(message)
    kind, length = say.read_header(data[: say.HEADER.size])
    assert length == len(data) - say.HEADER.size
    return say.read_body(kind, data[say.HEADER.size :])


def same(first: Any, second: Any) -> bool:
    return all(
        np.array_equal(getattr(first, each.name), getattr(second, each.name))
        for each in dataclasses.fields(first)
    )


@pytest.mark.parametrize("message", EXAMPLES, ids=lambda each: type(each).__name__)
def test_message_arrives_as_it_was_sent(message: say.Message) -> None:
    got = sent_and_read(message)
    assert type(got) is type(message)
    assert same(got, message)


def test_every_kind_of_message_has_an_example_here() -> None:
    assert {each.KIND for each in EXAMPLES} == set(say.KINDS)
    assert len(say.KINDS) == len(EXAMPLES)


def test_figure_arrives_whole() -> None:
    got = sent_and_read(say.FigureMessage.of(FIGURE))
    assert isinstance(got, say.FigureMessage)
    figure = got.figure()
    assert figure.names == FIGURE.names
    assert figure.parents == FIGURE.parents
    assert np.array_equal(figure.inertias, FIGURE.inertias)
    assert np.array_equal(figure.elements.yield_torque, FIGURE.elements.yield_torque)


@pytest.mark.parametrize(
    "change",
    [
        {"parents": (0,) * 20},
        {"parents": (-1,) + (19,) * 19},
        {"masses": np.zeros(20)},
        {"lengths": FIGURE.lengths[:-1]},
        {"names": FIGURE.names[:-1]},
        {"yield_torque": np.full(20, -np.inf)},
    ],
    ids=["own parent", "parent after child", "no mass", "short array", "no name", "no yield"],
)
def test_figure_that_is_none_is_refused(change: dict[str, Any]) -> None:
    message = dataclasses.replace(say.FigureMessage.of(FIGURE), **change)
    got = sent_and_read(message)
    assert isinstance(got, say.FigureMessage)
    with pytest.raises(MessageError):
        got.figure()


@pytest.mark.parametrize(
    "changes",
    [
        {"masses": np.array([1.0, 1.0, 1e300])},
        {"masses": np.array([1.0, 1.0, 1e-300])},
        {"masses": np.array([1e6, 1.0, 1e-6])},
        {"lengths": np.array([1.0, 1.0, 1e200])},
        {"radii": np.array([0.1, 0.1, 1e100])},
        {"anchors": np.full((3, 3), 1e30)},
        {"inertias": np.zeros((3, 3, 3))},
        {"inertias": np.tile(1e200 * np.eye(3), (3, 1, 1))},
        {"inertias": np.tile(-np.eye(3), (3, 1, 1))},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_figure_of_absurd_bodies_is_refused_when_it_is_read(changes: dict[str, Any]) -> None:
    """Its first step would make numbers that are none, and a hand would hold them."""
    good = say.FigureMessage.of(chain(3))
    good.figure()
    with pytest.raises(MessageError):
        dataclasses.replace(good, **changes).figure()


def test_mites_and_giants_are_figures() -> None:
    for size in (1e-3, 1.0, 1e3):
        good = say.FigureMessage.of(chain(3))
        scaled = {
            name: size * getattr(good, name)
            for name in ("anchors", "lengths", "centres", "capsules", "radii")
        }
        inertias = size**5 * good.inertias
        dataclasses.replace(
            good, **scaled, masses=size**3 * good.masses, inertias=inertias
        ).figure()


@pytest.mark.parametrize(
    "obstacle",
    [
        Plane(position=np.array([0.0, 0.0, -1.0])),
        Sphere(radius=0.5),
        Capsule(ends=np.array([[0.0, 0, 0], [0, 0, 1]]), radius=0.1),
        Box(half=np.array([1.0, 2.0, 3.0])),
        Hull(corners=np.concatenate([CORNERS, CORNERS[:, ::-1] + 0.3])),
        Mesh(corners=CORNERS, thickness=0.2),
    ],
    ids=lambda each: type(each).__name__,
)
def test_obstacle_arrives_as_it_is(obstacle: Obstacle) -> None:
    message = sent_and_read(say.ObstacleMessage.of(9, obstacle))
    assert isinstance(message, say.ObstacleMessage)
    got = message.obstacle()
    assert got is not None
    assert type(got) is type(obstacle)
    points = np.array([[0.1, 0.2, 0.3], [0.0, 0.0, 0.9]])
    for a, b in zip(got.closest(points, 1.0), obstacle.closest(points, 1.0), strict=True):
        assert np.allclose(a, b)


def test_obstacle_that_is_gone_is_told() -> None:
    got = sent_and_read(say.ObstacleMessage.of(9, None))
    assert isinstance(got, say.ObstacleMessage)
    assert got.obstacle() is None


@pytest.mark.parametrize(("shape", "points"), [(3, 1), (4, 0), (5, 4), (6, 0), (7, 0), (1, 1)])
def test_obstacle_that_makes_no_sense_is_refused(shape: int, points: int) -> None:
    message = dataclasses.replace(
        say.ObstacleMessage.of(0, Plane()), shape=shape, points=np.ones((points, 3))
    )
    with pytest.raises(MessageError):
        message.obstacle()


def test_other_version_is_refused_by_name() -> None:
    header = say.HEADER.pack(say.MAGIC, say.VERSION + 1, 14, 0)
    with pytest.raises(MessageError, match=f"version {say.VERSION + 1} of the messages"):
        say.read_header(header)


@pytest.mark.parametrize(
    "header",
    [
        say.HEADER.pack(b"GET ", 1, 14, 0),
        say.HEADER.pack(say.MAGIC, say.VERSION, 99, 0),
        say.HEADER.pack(say.MAGIC, say.VERSION, 2, say.MOST_BYTES + 1),
    ],
    ids=["other language", "unknown kind", "too long"],
)
def test_header_that_is_not_ours_is_refused(header: bytes) -> None:
    with pytest.raises(MessageError):
        say.read_header(header)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_none_are_refused(bad: float) -> None:
    for message in (say.Workspace(0, (bad, 0.0, 0.0)), say.Settings(force=bad)):
        data = say.pack(message)
        with pytest.raises(MessageError):
            say.read_body(message.KIND, data[say.HEADER.size :])
    positions = POSE.positions.copy()
    positions[3, 1] = bad
    data = say.pack(say.Place(positions, POSE.orientations))
    with pytest.raises(MessageError):
        say.read_body(say.Place.KIND, data[say.HEADER.size :])


@pytest.mark.parametrize("message", EXAMPLES, ids=lambda each: type(each).__name__)
def test_half_of_a_message_and_more_than_one_are_refused(message: say.Message) -> None:
    body = say.pack(message)[say.HEADER.size :]
    for broken in (body[: len(body) // 2], body[:-1], body + b"\0"):
        if broken != body:
            with pytest.raises(MessageError):
                say.read_body(message.KIND, broken)


def test_count_that_promises_too_much_reserves_nothing() -> None:
    with pytest.raises(MessageError):
        say.read_body(say.Pins.KIND, struct.pack("<H", 0xFFFF))
    with pytest.raises(MessageError):
        say.read_body(say.Place.KIND, struct.pack("<I", 0xFFFFFFFF))


@given(kind=st.sampled_from(sorted(say.KINDS)), body=st.binary(max_size=400))
@settings(max_examples=400)
def test_any_bytes_are_a_message_or_are_refused(kind: int, body: bytes) -> None:
    try:
        message = say.read_body(kind, body)
        if isinstance(message, say.FigureMessage):
            message.figure()
        if isinstance(message, say.ObstacleMessage):
            message.obstacle()
        if isinstance(message, say.Settings):
            message.response()
        if isinstance(message, say.WorldMessage):
            message.settings()
    except MessageError:
        pass


@given(st.data())
@settings(max_examples=300)
def test_message_with_a_few_bytes_changed_is_read_or_refused(data: st.DataObject) -> None:
    message = data.draw(st.sampled_from(EXAMPLES))
    body = bytearray(say.pack(message)[say.HEADER.size :])
    for _ in range(data.draw(st.integers(1, 5)) if body else 0):
        body[data.draw(st.integers(0, len(body) - 1))] = data.draw(st.integers(0, 255))
    try:
        got = say.read_body(message.KIND, bytes(body))
        if isinstance(got, say.FigureMessage):
            got.figure()
        if isinstance(got, say.ObstacleMessage):
            got.obstacle()
    except MessageError:
        pass
