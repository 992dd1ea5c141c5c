# SPDX-License-Identifier: GPL-3.0-or-later
"""[Plastic, §5.2 and its open work] in numbers: poses put onto a doll with and without force.

Hand and device are the extension's simulated ones. What the person does is a model, as plain as can
be: the hand goes to where the limb shall be, the eye sees late where the limb is, and now and then
the hand corrects for what is missing. It does not know of joints, and learns nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from octo_motion.core.posing.puppet import elements_for
from octo_motion.core.posing.puppet.figure import Pose
from octo_motion.core.posing.session import hand_for
from octo_motion.core.posing.solver.world import World, WorldSettings
from octo_motion.core.rotations import (
    Floats,
    angle_between,
    conjugate,
    from_rotation_vector,
    multiply,
    rotate,
    to_rotation_vector,
)
from octo_motion.device.haptics.force import gains_for, wrench
from octo_motion.device.sources.simulated_hand import Hand
from tests.core.puppets import doll, posed

POSES: Final = 10
_LIMBS: Final = ((5, 6, 7, 8), (9, 10, 11, 12), (13, 14, 15), (17, 18, 19), (3, 4))
"""Arms, legs and head of the doll, from root to end."""
_STEP: Final = 4e-3
_SCALE: Final = 5.0
"""Metres of the doll's world for one of the device's."""
_LATE: Final = 0.15
"""Seconds until what is seen has an effect."""
_NEAR: Final = (0.02, np.radians(6.0))
"""Metres and radians that are near enough to let go, if they last …"""
_CALM: Final = 0.2
"""… so many seconds."""
_LONGEST: Final = 6.0
_SETTLES: Final = 0.5
"""Seconds after which it is judged what came of it."""


@dataclass(frozen=True)
class Person:
    """How somebody moves who sees where the limb is, late."""

    first: float
    """Seconds of the first movement."""
    again: float
    """Seconds between corrections, and that one takes."""
    gain: float
    """Of what is seen to be missing, that is corrected at a time."""


PEOPLE: Final = {"careful": Person(0.8, 0.3, 0.7), "hasty": Person(0.4, 0.12, 1.0)}


@dataclass
class _Way:
    """Where the hand wants to be: one smooth movement after another."""

    place: Floats
    turn: Floats
    """(3,) rotation vectors."""
    begins: float = 0.0
    lasts: float = 0.0
    way: Floats | None = None
    swing: Floats | None = None

    def at(self, seconds: float) -> tuple[Floats, Floats]:
        """Place and turn: of least jerk between rest and rest."""
        if self.way is None or self.swing is None:
            return self.place, self.turn
        share = min(max((seconds - self.begins) / self.lasts, 0.0), 1.0)
        eased = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        return self.place + eased * self.way, self.turn + eased * self.swing

    def go(self, seconds: float, lasts: float, way: Floats, swing: Floats) -> None:
        """Begin another movement from where the last one is."""
        self.place, self.turn = self.at(seconds)
        self.begins, self.lasts, self.way, self.swing = seconds, lasts, way, swing


def hand(*, quick: bool = False) -> Any:
    """Pose error, seconds and overshoot of given poses, with force on the hand and without."""
    count = 1 if quick else POSES
    return {
        f"{name}, {way}": [_put(number, person, felt=way == "force") for number in range(count)]
        for name, person in PEOPLE.items()
        for way in ("force", "none")
    }


def given_pose(number: int) -> tuple[tuple[int, ...], Pose]:
    """A limb of the doll, and the doll with that limb as it shall be."""
    random = np.random.default_rng(100 + number)
    limb = _LIMBS[number % len(_LIMBS)]
    figure = doll()
    turns = np.zeros((len(figure), 3))
    for body in limb:
        way = random.normal(size=3)
        turns[body] = random.uniform(0.2, 0.5) * way / np.linalg.norm(way)
    return limb, posed(figure, turns)


def _put(number: int, person: Person, *, felt: bool) -> dict[str, float]:
    limb, wanted = given_pose(number)
    figure = doll()
    figure = replace(figure, elements=elements_for(figure, "doll"))
    world = World(figure, posed(figure), WorldSettings(step=_STEP, drag=2.0))
    world.pin(0)
    end = limb[-1]
    tip = np.array([0.0, figure.lengths[end], 0.0])

    def shown(pose: Pose) -> tuple[Floats, Floats]:
        return pose.positions[end] + rotate(pose.orientations[end], tip), pose.orientations[end]

    start, start_turn = shown(world.pose())
    goal, goal_turn = shown(wanted)
    grab = world.grab(end, start, np.array([1.0, 0.0, 0.0, 0.0]), hand_for(figure))
    swing = to_rotation_vector(multiply(goal_turn, conjugate(start_turn)))
    way = _Way(np.zeros(3), np.zeros(3))
    way.go(0.0, person.first, (goal - start) / _SCALE, swing)
    hand = Hand(wish=_wish(way))
    gains = gains_for(hand.device, _STEP)
    seen: list[tuple[Floats, Floats]] = []
    longest = float(np.linalg.norm(goal - start))
    beyond, near, corrected, seconds, force = 0.0, 0.0, person.first, 0.0, 0.0
    while seconds < _LONGEST and near < _CALM:
        hand.move(_STEP)
        seconds += _STEP
        turned = np.array(hand.orientation)
        place = start + _SCALE * np.array(hand.position)
        velocity = np.array([*(_SCALE * np.array(hand.velocity)), *hand.angular_velocity])
        grab.pull(place, turned, velocity)
        world.step()
        now, orientation = shown(world.pose())
        if felt:
            held = multiply(orientation, conjugate(start_turn))
            asked = wrench(
                gains,
                _plain((now - place) / _SCALE),
                _plain(to_rotation_vector(multiply(held, conjugate(turned)))),
                *((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
            )
            limits = (hand.device.force, hand.device.torque)
            pairs = zip(asked, limits, strict=True)
            parts = [_clamped(np.array(part), most) for part, most in pairs]
            force = max(force, float(np.linalg.norm(parts[0])))
            hand.feel(_plain(parts[0]), _plain(parts[1]))
        missing = goal - now, to_rotation_vector(multiply(goal_turn, conjugate(orientation)))
        seen.append(missing)
        along = float((now - goal) @ (goal - start)) / longest**2
        beyond = max(beyond, along)
        late = seen[max(0, len(seen) - 1 - round(_LATE / _STEP))]
        sizes = [float(np.linalg.norm(part)) for part in late]
        calm = sizes[0] < _NEAR[0] and sizes[1] < _NEAR[1]
        near = near + _STEP if calm else 0.0
        if seconds - corrected >= person.again and not calm:
            corrected = seconds
            share = person.gain
            way.go(seconds, person.again, share * late[0] / _SCALE, share * late[1])
    world.release(grab)
    for _ in range(round(_SETTLES / _STEP)):
        world.step()
    pose = world.pose()
    off = [angle_between(pose.orientations[body], wanted.orientations[body]) for body in limb]
    return {
        "tip": 1000.0 * float(np.linalg.norm(shown(pose)[0] - goal)),
        "limb": float(np.degrees(np.mean(off))),
        "seconds": seconds,
        "overshoot": 100.0 * beyond,
        "force": force,
        "done": float(near >= _CALM),
    }


def _wish(way: _Way) -> Callable[[float], Any]:
    def wish(seconds: float) -> Any:
        place, turn = way.at(seconds)
        return _plain(place), tuple(from_rotation_vector(turn).tolist())

    return wish


def _plain(vector: Floats) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return (x, y, z)


def _clamped(vector: Floats, most: float) -> Floats:
    return vector * min(1.0, most / max(float(np.linalg.norm(vector)), 1e-12))


_MEASURES: Final = {
    "tip": "tip, mm",
    "limb": "limb, °",
    "seconds": "time, s",
    "overshoot": "overshoot, %",
    "force": "force, N",
}


def hand_text(found: Any) -> str:
    """The table."""
    lines = [f"{'':<16}" + "".join(f"{title:>14}" for title in _MEASURES.values()) + f"{'done':>9}"]
    for name, rows in found.items():
        cells = "".join(f"{np.median([row[key] for row in rows]):>14.1f}" for key in _MEASURES)
        done = sum(row["done"] for row in rows)
        lines.append(f"{name:<16}{cells}{done:>6.0f}/{len(rows)}")
    return "\n".join(
        [
            *lines,
            "",
            "medians of given poses; tip, limb: off the pose half a second after letting go;",
            "  overshoot: of the way, beyond where it shall be; force: on the hand at most; done:",
            "  near enough to let go within 6 s. The person is a model: nobody was asked",
        ]
    )


def hand_told(found: Any) -> str:
    """What the row says."""
    said = []
    for name, rows in found.items():
        tip, seconds, beyond = (
            np.median([row[key] for row in rows]) for key in ("tip", "seconds", "overshoot")
        )
        said.append(f"{name}: {tip:.0f} mm off, in {seconds:.1f} s, {beyond:.0f} % too far")
    count = len(next(iter(found.values())))
    return f"by a simulated person, {count} poses, medians: " + "; ".join(said)
