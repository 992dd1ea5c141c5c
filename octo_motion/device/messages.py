# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender, the bridge and the loop at the device say to each other.

A message is a header (magic, version, kind, length of what follows) and fields of fixed layout;
docs/device.md has the table. Whoever reads one gets a frozen object or a ``MessageError``.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field, fields
from enum import IntEnum
from typing import Annotated, ClassVar, Final, NamedTuple, Self

import numpy as np

from ..core.errors import DeviceError, OctoMotionError
from ..core.posing.puppet import Elements, Figure, Pose
from ..core.posing.session import HandSample
from ..core.posing.solver import (
    Box,
    Capsule,
    Coupling,
    Hull,
    Mesh,
    Obstacle,
    Plane,
    Sphere,
    WorldSettings,
)
from ..core.rotations import Floats
from ..core.rotations.scalars import IDENTITY, ZERO, Quaternion, Vector, normalized
from .calibration import Calibration, Phase, Response
from .codec import (
    F64,
    FLAG,
    I32,
    QUATERNION,
    SIX,
    U8,
    U16,
    U32,
    VECTOR,
    Many,
    MessageError,
    Number,
    Record,
    Said,
    Table,
    Text,
)
from .driver import Axes

VERSION: Final = 6
MAGIC: Final = b"OMDV"
HEADER: Final = struct.Struct("<4sHHI")
MOST_BYTES: Final = 4_000_000
"""Of one message: a figure of 4096 bodies needs 2 MB, a mesh of 50,000 triangles 3.6 MB."""
MOST_POINTS: Final = 150_000
_LIGHTEST, _HEAVIEST, _LARGEST = 1e-15, 1e12, 1e6
"""kg and m of a body: of mites, and of more than ships."""
_NEARLY: Final = 1e-3
"""By which the length of an orientation may be off 1."""
_FARTHEST: Final = 1e12
"""m, m/s and rad/s: what is more is none of a puppet's."""
MOST_HANDS: Final = 64
"""Of Blender's own: mouse, scripts, and what they do on the other side."""
_APART: Final = 1e9
"""Times as heavy as another body of one figure: solvers tell no more apart."""


@dataclass(frozen=True)
class Message:
    """What all messages have in common.

    A message is right by its bytes and may still make no sense; then what makes something else of
    it raises ``MessageError``.
    """

    KIND: ClassVar[int]


# --- Blender and the bridge ----------------------------------------------------------------------


@dataclass(frozen=True)
class Hello(Message):
    """The bridge's first message: who it is, and how well it may keep time."""

    KIND = 1
    process: Annotated[int, U32]
    python: Annotated[str, Text(64)]
    priority: Annotated[str, Text(32)]
    """Of the loop at the device: real-time, raised or normal."""


@dataclass(frozen=True, eq=False)
class FigureMessage(Message):
    """The puppet; ends what was simulated before."""

    KIND = 2
    names: Annotated[tuple[str, ...], Many(Text(256), 4096)]
    parents: Annotated[tuple[int, ...], Many(I32, 4096)]
    anchors: Annotated[Floats, Table((3,))]
    rest: Annotated[Floats, Table((4,))]
    lengths: Annotated[Floats, Table()]
    masses: Annotated[Floats, Table()]
    centres: Annotated[Floats, Table((3,))]
    inertias: Annotated[Floats, Table((3, 3))]
    capsules: Annotated[Floats, Table((2, 3))]
    radii: Annotated[Floats, Table()]
    limits: Annotated[Floats, Table((3, 2))]
    stiffness: Annotated[Floats, Table((3,))]
    damping: Annotated[Floats, Table((3,))]
    flow: Annotated[Floats, Table((3,))]
    yield_torque: Annotated[Floats, Table(endless=True)]
    owners: Annotated[tuple[int, ...], Many(U16, 4096)] = ()
    heavy: Annotated[tuple[int, ...], Many(U8, 4096)] = ()

    @classmethod
    def of(cls, figure: Figure) -> FigureMessage:
        own = {**vars(figure), **vars(figure.elements)}
        for each in ("stiffness", "damping", "flow"):
            # About a bone's three axes, alike or not.
            own[each] = np.broadcast_to(own[each].T, (3, len(figure))).T
        for each in ("parents", "owners", "heavy"):
            own[each] = tuple(map(int, own[each]))
        return cls(**{each.name: own[each.name] for each in fields(cls)})

    def figure(self) -> Figure:
        count = len(self.names)
        if len(self.parents) != count or any(
            len(value) != count
            for each in fields(self)
            if isinstance(value := getattr(self, each.name), np.ndarray)
        ):
            raise MessageError("arrays of different lengths")
        if any(not -1 <= parent < index for index, parent in enumerate(self.parents)):
            raise MessageError("a parent does not come before its child")
        if {len(self.owners), len(self.heavy)} - {0, count}:
            raise MessageError("arrays of different lengths")
        if count == 0 or (self.masses <= 0.0).any() or (self.lengths <= 0.0).any():
            raise MessageError("a body without mass or length")
        self._weigh()
        if (self.yield_torque < 0.0).any():
            raise MessageError("a joint that yields to less than nothing")
        return self._made()

    def _weigh(self) -> None:
        """Refuse what no solver can move: its first step would make numbers that are none."""
        masses, turning = self.masses, np.linalg.eigvalsh(self.inertias)
        if masses.max() > _HEAVIEST or masses.min() < _LIGHTEST or self.lengths.max() > _LARGEST:
            raise MessageError("a body of a mass or length that cannot be")
        if masses.max() > _APART * masses.min():
            raise MessageError("bodies of masses that do not go together")
        reach = np.maximum(self.lengths, self.radii)
        for values in (self.anchors, self.centres, self.capsules, self.radii):
            if np.abs(values).max() > _LARGEST:
                raise MessageError("a body of a size that cannot be")
        heaviest = masses * np.maximum(reach, np.abs(self.capsules).max(axis=(1, 2))) ** 2
        if turning.min() <= 0.0 or (turning.max(axis=1) > _APART * heaviest).any():
            raise MessageError("a body that cannot turn like that")

    def _made(self) -> Figure:
        return Figure(
            *(self.names, self.parents, self.anchors, self.rest, self.lengths, self.masses),
            *(self.centres, self.inertias, self.capsules, self.radii),
            self.limits,
            Elements(self.stiffness, self.damping, self.flow, self.yield_torque),
            self.owners,
            tuple(map(bool, self.heavy)),
        )


def _no_points() -> Floats:
    return np.zeros((0, 3))


def _no_turns() -> Floats:
    return np.zeros((0, 4))


@dataclass(frozen=True, eq=False)
class Place(Message):
    """Blender to bridge: the puppet is to stand like this, at rest, or moving as it says."""

    KIND = 3
    positions: Annotated[Floats, Table((3,))]
    orientations: Annotated[Floats, Table((4,))]
    rest: Annotated[Floats, Table((4,))] = field(default_factory=_no_turns)
    linear: Annotated[Floats, Table((3,))] = field(default_factory=_no_points)
    angular: Annotated[Floats, Table((3,))] = field(default_factory=_no_points)
    spin: Annotated[Floats, Table((3,))] = field(default_factory=_no_points)

    def motion(self, count: int) -> dict[str, Floats]:
        """What of ``WorldSnapshot.bodies`` it says, of so many bodies; nothing of one at rest."""
        motion = {name: getattr(self, name) for name in MOTION}
        sizes = {len(each) for each in motion.values()}
        if {len(self.positions), len(self.orientations)} != {count} or sizes not in ({0}, {count}):
            raise MessageError("a pose of another figure")
        _check_turns(self.orientations, self.rest)
        for each in (self.positions, self.linear, self.angular, self.spin):
            _check_size(each, _FARTHEST)
        return {"orientations": self.orientations, **motion} if sizes == {count} else {}


MOTION: Final = ("rest", "linear", "angular", "spin")
"""What a moving puppet has besides its pose, by names of ``WorldSnapshot.bodies``."""


def _check_turns(*turns: Floats) -> None:
    for each in turns:
        _check_size(each, 2.0)
        if not (np.abs(np.linalg.norm(each, axis=1) - 1.0) < _NEARLY).all():
            raise MessageError("an orientation that is none")


def _check_size(numbers: Floats, most: float) -> None:
    if np.abs(numbers).max(initial=0.0) > most:
        raise MessageError("a number that is too large")


@dataclass(frozen=True, eq=False)
class PoseMessage(Message):
    """Bridge to Blender: the puppet stands like this."""

    KIND = 4
    placed: Annotated[int, U32]
    """How often it was put into a pose: what was said before the last one is out of date."""
    step: Annotated[int, U32]
    time: Annotated[float, F64]
    """s simulated since the figure came."""
    positions: Annotated[Floats, Table((3,))]
    orientations: Annotated[Floats, Table((4,))]


@dataclass(frozen=True)
class Pins(Message):
    """Blender to bridge: which bodies stay where they are."""

    KIND = 5
    pinned: Annotated[tuple[int, ...], Many(U8, 4096)]
    """For each body 0: free, 1: its joint stays in its place, 2: and it does not turn."""

    @classmethod
    def of(cls, pins: dict[int, bool], count: int) -> Pins:
        """The message that pins bodies, by number whether firmly, of so many."""
        return cls(tuple(1 + pins[body] if body in pins else 0 for body in range(count)))

    def pins(self) -> dict[int, bool]:
        """By body that is pinned, whether its orientation is held as well."""
        return {body: pin > 1 for body, pin in enumerate(self.pinned) if pin}


@dataclass(frozen=True)
class Grab(Message):
    """Blender to bridge: a key stands in for a device's button."""

    KIND = 6
    pointer: Annotated[int, U8]
    grab: Annotated[bool, FLAG]
    """False lets go."""


@dataclass(frozen=True)
class Settings(Message):
    """Blender to bridge: how devices behave."""

    KIND = 7
    force: Annotated[float, F64] = 1.0
    """0 to 1 of the force that the device can give."""
    grab_button: Annotated[int, U8] = 0
    """255: none."""
    key_button: Annotated[int, U8] = 1
    """255: none."""
    toggle: Annotated[bool, FLAG] = False
    """One press grabs and another lets go; else the button is held."""
    dead_man: Annotated[bool, FLAG] = True
    """Without a hand on a device that has a sensor for it, there is no force."""
    reach: Annotated[float, F64] = 0.1
    """m, how near to a body the pointer must be to grab it."""
    speed: Annotated[float, F64] = Response.speed
    angular_speed: Annotated[float, F64] = Response.angular_speed
    gain: Annotated[Axes, SIX] = Response.gain
    dead_zone: Annotated[Axes, SIX] = Response.dead_zone
    curve: Annotated[Axes, SIX] = Response.curve

    def response(self) -> Response:
        """Of space mice."""
        try:
            return Response(self.speed, self.angular_speed, self.gain, self.dead_zone, self.curve)
        except DeviceError as error:
            raise MessageError(error.problem) from error


@dataclass(frozen=True)
class Workspace(Message):
    """Blender to bridge: where a device's room lies in the scene."""

    KIND = 8
    pointer: Annotated[int, U8]
    origin: Annotated[Vector, VECTOR] = ZERO
    """World, of the middle of the device's room."""
    orientation: Annotated[Quaternion, QUATERNION] = IDENTITY
    """World, of the device's axes: the view's, so that right is right."""
    scale: Annotated[float, F64] = 1.0
    """m in the scene for each m of the hand."""


@dataclass(frozen=True)
class DeviceMessage(Message):
    """Bridge to Blender: a device came, changed or went."""

    KIND = 9
    pointer: Annotated[int, U8]
    present: Annotated[bool, FLAG]
    kind: Annotated[int, U8]
    """As ``driver.Kind``."""
    force: Annotated[float, F64]
    """N, 0 without force."""
    torque: Annotated[float, F64]
    """N·m, 0 without torque."""
    stiffness: Annotated[float, F64]
    """N/m of the coupling, 0 without force."""
    angular_stiffness: Annotated[float, F64]
    """N·m/rad of the coupling."""
    name: Annotated[str, Text(128)]
    identity: Annotated[str, Text(400)]
    """The same for the same device next time."""
    buttons: Annotated[tuple[str, ...], Many(Text(64), 64)]


@dataclass(frozen=True)
class PointerMessage(Message):
    """Bridge to Blender, as often as poses: where a pointer is and what it feels."""

    KIND = 10
    pointer: Annotated[int, U8]
    body: Annotated[int, I32]
    """Held, −1: none."""
    position: Annotated[Vector, VECTOR]
    """World, of the device."""
    orientation: Annotated[Quaternion, QUATERNION]
    coupled_position: Annotated[Vector, VECTOR]
    """World, of the point that is held; the device's own where nothing is."""
    force: Annotated[Vector, VECTOR]
    """N on the hand, device axes."""
    torque: Annotated[Vector, VECTOR]
    buttons: Annotated[int, U32]


@dataclass(frozen=True)
class Button(Message):
    """Bridge to Blender: a device's button was pressed or let go."""

    KIND = 11
    pointer: Annotated[int, U8]
    button: Annotated[int, U8]
    pressed: Annotated[bool, FLAG]


@dataclass(frozen=True)
class LoopTimesMessage(Message):
    """Loop to bridge, once a second: how well time is kept."""

    KIND = 22
    rate: Annotated[float, F64]
    """Hz of the loop at the device, on average."""
    late: Annotated[tuple[float, ...], Number("d", 4)]
    """s by which the time between two ticks is off: at 50, 99, 99.9 % and the longest."""
    computing: Annotated[tuple[float, ...], Number("d", 4)]
    """s from a tick's begin to its end, likewise."""
    missed: Annotated[int, U32]
    """Ticks left out since the one before took too long."""


@dataclass(frozen=True)
class Times(LoopTimesMessage):
    """Bridge to Blender, once a second: the loop's times, and those of the simulation."""

    KIND = 12
    step: Annotated[float, F64]
    """s that a step of the simulation takes to compute."""
    pace: Annotated[float, F64]
    """Simulated against real time; 1 keeps up."""
    lag: Annotated[float, F64]
    """s from what a hand that holds something does to the pose that follows from it."""


@dataclass(frozen=True)
class Notice(Message):
    """Bridge to Blender: something for the user to read."""

    KIND = 13
    problem: Annotated[str, Said()]
    remedy: Annotated[str, Said()]


@dataclass(frozen=True)
class Goodbye(Message):
    """Either way: this ends."""

    KIND = 14


@dataclass(frozen=True)
class Buzz(Message):
    """Blender to bridge: let a device push gently, a moment each way."""

    KIND = 15
    pointer: Annotated[int, U8]


@dataclass(frozen=True)
class WorldMessage(Message):
    """Blender to bridge: what holds for the whole simulation, see ``WorldSettings``."""

    KIND = 16
    step: Annotated[float, F64] = 2e-3
    gravity: Annotated[Vector, VECTOR] = ZERO
    self_collision: Annotated[bool, FLAG] = False
    friction: Annotated[float, F64] = 0.6
    drag: Annotated[float, F64] = 0.0

    def settings(self) -> WorldSettings:
        if not 1e-4 <= self.step <= 0.02 or self.friction < 0.0 or self.drag < 0.0:
            raise MessageError("settings of the world that cannot be")
        return WorldSettings(**vars(self))


@dataclass(frozen=True)
class _Shape:
    """Which attributes of a kind of obstacle a message carries as size and as points."""

    kind: type[Obstacle]
    size: str = ""
    points: str = ""
    layout: tuple[int, ...] = (0, 3)
    """Shape of the attribute that is points."""


_SHAPES: Final = {
    1: _Shape(Plane),
    2: _Shape(Sphere, "radius"),
    3: _Shape(Capsule, "radius", "ends", (2, 3)),
    4: _Shape(Box, "", "half", (3,)),
    5: _Shape(Hull, "", "corners", (-1, 3, 3)),
    6: _Shape(Mesh, "thickness", "corners", (-1, 3, 3)),
}


@dataclass(frozen=True, eq=False)
class ObstacleMessage(Message):
    """Blender to bridge: something that the puppet can touch, new or elsewhere."""

    KIND = 17
    number: Annotated[int, U16]
    """The sender's; the same number replaces."""
    shape: Annotated[int, U8] = 0
    """0: gone; else as in ``_SHAPES``."""
    position: Annotated[Vector, VECTOR] = ZERO
    orientation: Annotated[Quaternion, QUATERNION] = IDENTITY
    size: Annotated[float, F64] = 0.0
    """Radius of sphere and capsule, thickness of a mesh."""
    points: Annotated[Floats, Table((3,), MOST_POINTS)] = field(default_factory=_no_points)
    """Ends of a capsule, half sizes of a box, three corners for each triangle; own frame."""
    body: Annotated[int, I32] = -1
    """The body whose shape it is, −1 for none."""

    @classmethod
    def of(cls, number: int, obstacle: Obstacle | None) -> ObstacleMessage:
        if obstacle is None:
            return cls(number)
        kinds = (each for each, shape in _SHAPES.items() if type(obstacle) is shape.kind)
        kind = next(kinds, None)
        if kind is None:
            raise MessageError(f"no message carries a {type(obstacle).__name__}")
        shape = _SHAPES[kind]
        return cls(
            *(number, kind, tuple(obstacle.position), tuple(obstacle.orientation)),
            size=getattr(obstacle, shape.size, 0.0),
            points=getattr(obstacle, shape.points, _no_points()).reshape(-1, 3),
            body=obstacle.body,
        )

    def obstacle(self) -> Obstacle | None:
        """The obstacle that came; None: it is gone."""
        if self.shape == 0:
            return None
        turn = normalized(self.orientation)
        shape = _SHAPES.get(self.shape)
        if turn is None or shape is None or self.size < 0.0:
            raise MessageError("an obstacle that cannot be")
        try:
            points = self.points.reshape(shape.layout)
            own = {shape.size: self.size, shape.points: points}
            return shape.kind(
                position=np.array(self.position),
                orientation=np.array(turn),
                body=max(self.body, -1),
                **{name: value for name, value in own.items() if name},
            )
        except ValueError as error:
            raise MessageError("an obstacle with a wrong number of points") from error
        except OctoMotionError as error:
            raise MessageError(error.problem) from error


class Order(IntEnum):
    """What is to be done about a device's calibration."""

    CANCEL = 0
    BEGIN = 1
    FINISH = 2


@dataclass(frozen=True)
class Calibrate(Message):
    """Blender to bridge: learn a device's zero and range, or stop learning."""

    KIND = 18
    pointer: Annotated[int, U8]
    order: Annotated[int, U8]
    """As ``Order``."""


@dataclass(frozen=True)
class CalibrationMessage(Message):
    """Either way: a device's zero and range, to be used or as far as they are learned."""

    KIND = 19
    pointer: Annotated[int, U8]
    phase: Annotated[int, U8]
    """As ``calibration.Phase``; to the bridge: done."""
    rest: Annotated[Axes, SIX]
    least: Annotated[Axes, SIX]
    most: Annotated[Axes, SIX]

    @classmethod
    def of(cls, pointer: int, calibration: Calibration, phase: Phase = Phase.DONE) -> Self:
        return cls(pointer, phase, calibration.rest, calibration.least, calibration.most)

    def calibration(self) -> Calibration:
        try:
            return Calibration(self.rest, self.least, self.most)
        except DeviceError as error:
            raise MessageError(error.problem) from error


# --- A session whose hands are in Blender, too ---------------------------------------------------


@dataclass(frozen=True, eq=False)
class Tick(Message):
    """Blender to bridge: so much time has passed, and Blender's own hands are here. Answered with
    ``Ticked``.
    """

    KIND = 23
    number: Annotated[int, U32]
    seconds: Annotated[float, F64]
    balanced: Annotated[int, U16]
    """Bodies, from the first, that are to keep their balance; 0: none."""
    hands: Annotated[tuple[int, ...], Many(U32, MOST_HANDS)]
    positions: Annotated[Floats, Table((3,), MOST_HANDS)]
    orientations: Annotated[Floats, Table((4,), MOST_HANDS)]

    def samples(self) -> dict[int, HandSample]:
        """Where hands are, by their numbers."""
        if not len(self.hands) == len(self.positions) == len(self.orientations):
            raise MessageError("arrays of different lengths")
        if self.seconds < 0.0:
            raise MessageError("time does not run backwards")
        _check_turns(self.orientations)
        _check_size(self.positions, _FARTHEST)
        places = zip(self.hands, self.positions, self.orientations, strict=True)
        return {hand: HandSample(position, turn) for hand, position, turn in places}


@dataclass(frozen=True)
class Take(Message):
    """Blender to bridge: one more hand of Blender's takes hold of a body."""

    KIND = 24
    hand: Annotated[int, U32]
    body: Annotated[int, U16]
    point: Annotated[Vector, VECTOR]
    """World."""
    pull: Annotated[tuple[float, ...], SIX]
    """As ``Coupling`` has it."""

    def coupling(self) -> Coupling:
        _check_size(np.array(self.point), _FARTHEST)
        if min(self.pull) < 0.0:
            raise MessageError("a hand that pushes away")
        return Coupling(*self.pull)


@dataclass(frozen=True)
class LetGo(Message):
    """Blender to bridge: a hand of Blender's lets go."""

    KIND = 25
    hand: Annotated[int, U32]


@dataclass(frozen=True, eq=False)
class TurnBack(Message):
    """Blender to bridge: some joints are to be as in a pose, while all else goes on."""

    KIND = 26
    joints: Annotated[tuple[int, ...], Many(U8, 4096)]
    """For each body 1 or 0."""
    positions: Annotated[Floats, Table((3,))]
    orientations: Annotated[Floats, Table((4,))]

    def pose(self, count: int) -> Pose:
        if {len(self.joints), len(self.positions), len(self.orientations)} != {count}:
            raise MessageError("a pose of another figure")
        _check_turns(self.orientations)
        return Pose(self.positions, self.orientations)


@dataclass(frozen=True, eq=False)
class Ticked(Message):
    """Bridge to Blender: what has come of a tick. Blender could go on from it by itself."""

    KIND = 27
    number: Annotated[int, U32]
    """The tick's."""
    placed: Annotated[int, U32]
    step: Annotated[int, U32]
    time: Annotated[float, F64]
    """These as in ``PoseMessage``."""
    simulated: Annotated[float, F64]
    steps: Annotated[int, U32]
    ratio: Annotated[float, F64]
    length: Annotated[float, F64]
    resting: Annotated[bool, FLAG]
    """These as in ``TickReport``."""
    positions: Annotated[Floats, Table((3,))]
    orientations: Annotated[Floats, Table((4,))]
    rest: Annotated[Floats, Table((4,))]
    linear: Annotated[Floats, Table((3,))]
    angular: Annotated[Floats, Table((3,))]
    spin: Annotated[Floats, Table((3,))]
    loads: Annotated[Floats, Table((3,))]
    """N·m that joints bear, world."""
    pulled: Annotated[tuple[int, ...], Many(U8, 4096)]
    """For each joint whether it was pulled since the last pose it was put into."""
    carried: Annotated[tuple[int, ...], Many(U16, 4096)]
    """Bodies that something below carries."""
    hands: Annotated[tuple[int, ...], Many(U32, MOST_HANDS)]
    wrenches: Annotated[Floats, Table((6,), MOST_HANDS)]
    """N and N·m with which these hands of Blender's pull."""


# --- The bridge and the loop at the device -------------------------------------------------------


@dataclass(frozen=True)
class HandMessage(Message):
    """Loop to bridge, each tick: what a hand does."""

    KIND = 20
    pointer: Annotated[int, U8]
    time: Annotated[float, F64]
    grab: Annotated[int, U32]
    """Counts grabs; 0 while nothing is wanted."""
    position: Annotated[Vector, VECTOR]
    orientation: Annotated[Quaternion, QUATERNION]
    velocity: Annotated[Vector, VECTOR]
    angular_velocity: Annotated[Vector, VECTOR]
    force: Annotated[Vector, VECTOR]
    torque: Annotated[Vector, VECTOR]
    buttons: Annotated[int, U32]


class Pull(NamedTuple):
    """How the simulation ties the held body to the pointer, and how the body gives way."""

    stiffness: float = 0.0
    """N/m of the simulation's own coupling."""
    damping: float = 0.0
    """N·s/m"""
    angular_stiffness: float = 0.0
    """N·m/rad"""
    angular_damping: float = 0.0
    """N·m·s/rad"""
    mobility: float = 0.0
    """1/kg of the body at the point held; 0: it keeps its velocity whatever pulls."""
    angular_mobility: float = 0.0
    """1/(kg·m²)"""


@dataclass(frozen=True)
class HeldMessage(Message):
    """Bridge to loop, each step: the held body, at the point where it is held."""

    KIND = 21
    pointer: Annotated[int, U8]
    grab: Annotated[int, U32]
    """Which grab this answers."""
    held: Annotated[bool, FLAG]
    """False: there was nothing near, or it was let go."""
    time: Annotated[float, F64]
    """When this was true, by ``time.perf_counter``."""
    holds: Annotated[float, F64] = 0.0
    """s for which the next message is not expected, since the simulation's steps take so long: the
    local model goes on alone until then, and counts as fresh."""
    position: Annotated[Vector, VECTOR] = ZERO
    orientation: Annotated[Quaternion, QUATERNION] = IDENTITY
    velocity: Annotated[Vector, VECTOR] = ZERO
    angular_velocity: Annotated[Vector, VECTOR] = ZERO
    pull: Annotated[tuple[float, ...], SIX] = Pull()
    force: Annotated[Vector, VECTOR] = ZERO
    """N, that the simulation's own coupling used in its last step."""
    torque: Annotated[Vector, VECTOR] = ZERO
    """N·m, likewise."""


KINDS: Final[dict[int, type[Message]]] = {
    kind.KIND: kind for kind in (*Message.__subclasses__(), *LoopTimesMessage.__subclasses__())
}
RECORDS: Final = {kind: Record(kind) for kind in KINDS.values()}


def pack(message: Message) -> bytes:
    """A message with its header."""
    body = RECORDS[type(message)].pack(message)
    return HEADER.pack(MAGIC, VERSION, message.KIND, len(body)) + body


def read_header(data: bytes) -> tuple[int, int]:
    """Kind of a message, and how many bytes follow its header.

    Raises:
        MessageError: no header of ours, another version, an unknown kind, or too long.
    """
    magic, version, kind, length = HEADER.unpack(data)
    if magic != MAGIC:
        raise MessageError("not one of our messages")
    if version != VERSION:
        raise MessageError(f"version {version} of the messages, not {VERSION}")
    if kind not in KINDS:
        raise MessageError(f"an unknown kind of message, {kind}")
    if length > MOST_BYTES:
        raise MessageError("a message is too long")
    return kind, length


def read_body(kind: int, body: bytes) -> Message:
    """The message of a kind whose bytes these are.

    Raises:
        MessageError: they are not.
    """
    return KINDS[kind](*RECORDS[KINDS[kind]].unpack(body))
