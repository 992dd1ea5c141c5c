# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion clips to splice, made from curves: a walk, a throw, a punch, and a dance of a small body.

Nobody was recorded: joint angles are smooth curves through a few key poses, and feet that stand are
held where they stand. The files are the project's own, so examples and measurements need no others.

    python docs/studio/performers.py docs/examples/clips
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from octo_motion.core.rotations import (
    Floats,
    conjugate,
    continuous_euler,
    from_axis_angle,
    from_matrix,
    multiply,
    normalized,
    rotate,
    to_euler,
)

RATE: Final = 30
"""Frames per second."""

# BVH's axes: X to the body's left, Y up, Z to the front.
_X, _Y, _Z = np.eye(3)

_JOINTS: Final = (
    ("Hips", "", (0.0, 0.0, 0.0)),
    ("Spine", "Hips", (0.0, 0.10, -0.01)),
    ("Chest", "Spine", (0.0, 0.15, 0.0)),
    ("Neck", "Chest", (0.0, 0.25, 0.0)),
    ("Head", "Neck", (0.0, 0.10, 0.02)),
)
_SIDE_JOINTS: Final = (
    ("Shoulder", "Chest", (0.03, 0.20, 0.02)),
    ("Arm", "Shoulder", (0.15, 0.0, -0.02)),
    ("ForeArm", "Arm", (0.29, 0.0, 0.0)),
    ("Hand", "ForeArm", (0.26, 0.0, 0.0)),
    ("UpLeg", "Hips", (0.09, -0.04, 0.0)),
    ("Leg", "UpLeg", (0.0, -0.43, 0.0)),
    ("Foot", "Leg", (0.0, -0.41, 0.0)),
    ("Toe", "Foot", (0.0, -0.06, 0.13)),
)
"""Of the left side, metres; arms are stretched out sideways."""
_ENDS: Final = {"Head": (0.0, 0.20, 0.0), "Hand": (0.16, 0.0, 0.0), "Toe": (0.0, 0.0, 0.07)}
_SOLE: Final = 0.09
"""Height of the ankle when the foot stands."""
_HEEL: Final = np.array([0.0, -_SOLE, -0.05])
_BALL: Final = np.array([0.0, -0.06, 0.13])
"""Where the foot rolls, seen from the ankle."""
_ARM_JOINTS: Final = ("Arm", "ForeArm", "Hand")


@dataclass(frozen=True)
class Body:
    """What one performer is built like."""

    size: float = 1.0
    """Of the whole body."""
    arms: float = 1.0
    """Length of the arms, beyond that."""
    arms_down: float = 0.0
    """Radians that the arms hang down in the rest pose."""
    name: str = "{side}{joint}"
    """What joints are called."""


@dataclass
class Acting:
    """What joints do over the frames: orientations in body space, and the way of the hips."""

    times: Floats
    turns: dict[str, Floats]
    """(frames, 4) of a joint, relative to its parent, as long as the arms are stretched at rest."""
    hips: Floats
    """(frames, 3)"""


ADULT: Final = Body()
SMALL: Final = Body(size=0.68, arms=0.92, arms_down=np.radians(55.0), name="rig:{side}_{joint}")


# --- Curves --------------------------------------------------------------------------------------


def curve(times: Floats, keys: Sequence[tuple[float, float]]) -> Floats:
    """Values through keys (time, value) that rests at each of them where the course turns back, and
    runs on where it does not (monotone cubic after Fritsch and Carlson).
    """
    places, values = np.array(keys, dtype=np.float64).T
    steps = np.diff(places)
    slopes = np.diff(values) / steps
    tangents = np.zeros(len(keys))
    same = slopes[1:] * slopes[:-1] > 0.0
    before, after = slopes[:-1][same], slopes[1:][same]
    tangents[1:-1][same] = 2.0 * before * after / (before + after)
    number = np.clip(np.searchsorted(places, times, side="right") - 1, 0, len(keys) - 2)
    width = steps[number]
    share = np.clip((times - places[number]) / width, 0.0, 1.0)
    rise = share * share * (3.0 - 2.0 * share)
    return (
        values[number]
        + (values[number + 1] - values[number]) * rise
        + width * tangents[number] * share * (1.0 - share) ** 2
        - width * tangents[number + 1] * share * share * (1.0 - share)
    )


def _about(axis: Floats, degrees: Floats | float) -> Floats:
    return from_axis_angle(axis, np.radians(degrees))


def _turns(*turns: Floats) -> Floats:
    """One after the other, the last one first."""
    result = turns[0]
    for each in turns[1:]:
        result = multiply(result, each)
    return result


def _arm(
    acting: Acting,
    side: str,
    forward: Floats,
    spread: Floats,
    elbow: Floats,
    *,
    outwards: Floats | float = 0.0,
) -> None:
    """An arm.

    Args:
        acting: written to.
        side: "Left" or "Right".
        forward: degrees that the upper arm swings forward from hanging.
        spread: degrees that it is off the body.
        elbow: degrees that the elbow is bent.
        outwards: degrees that an arm that points ahead is turned to its own side.
    """
    sign = 1.0 if side == "Left" else -1.0
    aside = _about(_Y, sign * np.broadcast_to(outwards, forward.shape))
    hanging = _about(_Z, -sign * (90.0 - spread))
    acting.turns[f"{side}Arm"] = _turns(aside, _about(_X, -forward), hanging)
    acting.turns[f"{side}ForeArm"] = _about(_Y, -sign * elbow)


# --- Legs ----------------------------------------------------------------------------------------


def _leg(acting: Acting, side: str, ankles: Floats, pitch: Floats, heading: float = 0.0) -> None:
    """A leg whose ankle is at these places (frames, 3), the foot's toes ``pitch`` degrees up."""
    sign = 1.0 if side == "Left" else -1.0
    offsets = {name: np.array(offset) for name, _, offset in _SIDE_JOINTS}
    pelvis = acting.turns["Hips"]
    hips = acting.hips + rotate(pelvis, offsets["UpLeg"] * (sign, 1.0, 1.0))
    upper, lower = -offsets["Leg"][1], -offsets["Foot"][1]
    way = ankles - hips
    distance = np.linalg.norm(way, axis=-1, keepdims=True)
    along = way / distance
    distance = np.minimum(distance, 0.9995 * (upper + lower))
    foot = _turns(_about(_Y, np.full(len(pitch), heading)), _about(_X, -pitch))
    ahead = normalized(rotate(pelvis, _Z) + rotate(_about(_Y, heading), _Z))
    ahead = normalized(ahead - np.sum(ahead * along, axis=-1, keepdims=True) * along)
    reach = (upper**2 + distance**2 - lower**2) / (2.0 * distance)
    bend = np.sqrt(np.maximum(upper**2 - reach**2, 0.0))
    knees = hips + reach * along + bend * ahead
    ends = hips + distance * along
    left = np.cross(ahead, along)
    thigh = _axes(left, (hips - knees) / upper)
    shin = _axes(left, (knees - ends) / lower)
    toe = np.maximum(-pitch, 0.0) * (ankles[:, 1] < _SOLE + 0.12)
    acting.turns[f"{side}UpLeg"] = multiply(conjugate(pelvis), thigh)
    acting.turns[f"{side}Leg"] = multiply(conjugate(thigh), shin)
    acting.turns[f"{side}Foot"] = multiply(conjugate(shin), foot)
    acting.turns[f"{side}Toe"] = _about(_X, -toe)


def _axes(left: Floats, up: Floats) -> Floats:
    left = normalized(left - np.sum(left * up, axis=-1, keepdims=True) * up)
    return from_matrix(np.stack([left, up, np.cross(left, up)], axis=-1))


def _rolled(places: Floats, pitch: Floats) -> Floats:
    """Ankles of feet that stand with their heel or ball where they are flat on the ground."""
    pivots = np.where(pitch[:, None] > 0.0, _HEEL, _BALL)
    return places + pivots - rotate(_about(_X, -pitch), pivots)


def _acting(seconds: float) -> Acting:
    times = np.arange(round(seconds * RATE) + 1) / RATE
    still = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (len(times), 4))
    names = [f"{side}{name}" for side in ("Left", "Right") for name, *_ in _SIDE_JOINTS]
    turns = {name: still.copy() for name in (*names, *(each[0] for each in _JOINTS))}
    return Acting(times, turns, np.zeros((len(times), 3)))


# --- What they do --------------------------------------------------------------------------------


def walk(seconds: float = 5.0, *, cycle: float = 1.1, stride: float = 1.25) -> Acting:
    """Straight ahead."""
    acting = _acting(seconds)
    times = acting.times
    phase = times / cycle
    swing = np.cos(2.0 * np.pi * phase)
    acting.hips = np.stack(
        [
            0.018 * np.sin(2.0 * np.pi * phase),
            0.925 - 0.018 * np.cos(4.0 * np.pi * (phase - 0.04)),
            stride * phase,
        ],
        axis=-1,
    )
    sway = np.sin(2.0 * np.pi * phase)
    acting.turns["Hips"] = _turns(_about(_Y, -6.0 * swing), _about(_Z, 2.5 * sway))
    acting.turns["Spine"] = _turns(_about(_Y, 7.0 * swing), _about(_Z, -1.5 * sway), _about(_X, 3))
    acting.turns["Chest"] = _turns(_about(_Y, 5.0 * swing), _about(_Z, -1.0 * sway))
    acting.turns["Neck"] = _about(_Y, -3.0 * swing)
    acting.turns["Head"] = _turns(_about(_Y, -3.0 * swing), _about(_X, -2.0))
    for side, sign, shift in (("Left", 1.0, 0.0), ("Right", -1.0, 0.5)):
        own = phase + shift
        step, share = np.floor(own), own - np.floor(own)
        pitch = curve(
            share, [(0.0, 18.0), (0.1, 0.0), (0.36, 0.0), (0.62, -48.0), (0.85, 6.0), (1.0, 18.0)]
        )
        landing = stride * (step - shift) + 0.5 * 0.5 * stride
        ahead = np.array([0.0, 0.0, 1.0])
        flat = np.array([sign * 0.075, _SOLE, 0.0]) + landing[:, None] * ahead
        standing = _rolled(flat, pitch)
        leaving = _rolled(flat, np.full(len(share), -48.0))
        arriving = _rolled(flat, np.full(len(share), 18.0)) + stride * ahead
        moved = np.clip((share - 0.62) / 0.38, 0.0, 1.0)
        eased = (moved * moved * (3.0 - 2.0 * moved))[:, None]
        lift = np.array([0.0, 1.0, 0.0]) * (0.05 * np.sin(np.pi * moved) ** 2)[:, None]
        flying = leaving + eased * (arriving - leaving) + lift
        ankles = np.where((share < 0.62)[:, None], standing, flying)
        _leg(acting, side, ankles, pitch)
        forward = -np.cos(2.0 * np.pi * own)
        _arm(acting, side, 6.0 + 24.0 * forward, np.full(len(own), 9.0), 17.0 + 11.0 * forward)
    return acting


def _stand(acting: Acting, feet: Mapping[str, tuple[float, float, float]], height: Floats) -> None:
    """Feet that stay: (x, z, degrees turned outwards) by side."""
    acting.hips[:, 1] = height
    for side, (x, z, out) in feet.items():
        ankles = np.broadcast_to([x, _SOLE, z], acting.hips.shape)
        outwards = out if side == "Left" else -out
        _leg(acting, side, ankles, np.zeros(len(acting.times)), outwards)


def throw() -> Acting:
    """The right arm goes back, up and round, and throws; the body turns with it."""
    acting = _acting(2.6)
    times = acting.times
    yaw = curve(times, [(0, 0), (0.9, -30), (1.4, 28), (1.7, 30), (2.5, 0), (2.6, 0)])
    bow = curve(times, [(0, 0), (0.9, -7), (1.5, 14), (2.4, 0), (2.6, 0)])
    acting.hips[:, 2] = curve(times, [(0, 0), (0.85, -0.09), (1.45, 0.12), (2.5, 0), (2.6, 0)])
    acting.turns["Hips"] = _about(_Y, 0.4 * yaw)
    acting.turns["Spine"] = _turns(_about(_Y, 0.3 * yaw), _about(_X, 0.5 * bow))
    acting.turns["Chest"] = _turns(_about(_Y, 0.5 * yaw), _about(_X, 0.5 * bow))
    acting.turns["Neck"] = _about(_Y, -0.5 * yaw)
    acting.turns["Head"] = _turns(_about(_Y, -0.6 * yaw), _about(_X, -0.7 * bow))
    height = curve(times, [(0, 0.93), (0.9, 0.895), (1.4, 0.88), (2.5, 0.93), (2.6, 0.93)])
    _stand(acting, {"Left": (0.10, 0.16, 8.0), "Right": (-0.11, -0.14, 20.0)}, height)
    _arm(
        acting,
        "Right",
        # Backwards and all the way round.
        -curve(
            times,
            [(0, 0), (0.35, -38), (0.95, 150), (1.3, 275), (1.6, 345), (2.4, 360), (2.6, 360)],
        ),
        curve(times, [(0, 9), (0.9, 24), (1.3, 12), (1.6, -6), (2.4, 9), (2.6, 9)]),
        curve(times, [(0, 18), (0.35, 30), (0.92, 75), (1.25, 8), (1.6, 25), (2.4, 18), (2.6, 18)]),
    )
    _arm(
        acting,
        "Left",
        curve(times, [(0, 4), (0.85, 62), (1.4, -20), (2.4, 4), (2.6, 4)]),
        curve(times, [(0, 9), (0.85, 22), (1.4, 18), (2.4, 9), (2.6, 9)]),
        curve(times, [(0, 18), (0.85, 20), (1.4, 55), (2.4, 18), (2.6, 18)]),
    )
    return acting


def turn(acting: Acting | None = None) -> Acting:
    """The right arm goes round at the shoulder, forwards, twice; standing, or in what is given."""
    standing = acting is None
    acting = acting or _acting(3.0)
    times = acting.times
    whole = 720.0 * np.clip((times - 0.2) / 2.5, 0.0, 1.0)
    if standing:
        sway = np.sin(np.radians(whole))
        acting.turns["Chest"] = _turns(_about(_Y, 5.0 * sway), _about(_Z, 3.0 * sway))
        _stand(
            acting,
            {"Left": (0.10, 0.02, 8.0), "Right": (-0.10, -0.02, 8.0)},
            0.925 + 0.0 * times,
        )
        still = np.zeros(len(times))
        _arm(acting, "Left", still + 4.0, still + 9.0, still + 18.0)
    _arm(acting, "Right", whole, np.full(len(times), 14.0), 14.0 + 6.0 * np.cos(np.radians(whole)))
    return acting


def punch() -> Acting:
    """Fists up, and the left one straight ahead."""
    acting = _acting(1.8)
    times = acting.times
    yaw = curve(times, [(0, 0), (0.35, 12), (0.62, -24), (0.75, -24), (1.3, 0), (1.8, 0)])
    acting.hips[:, 2] = curve(times, [(0, 0), (0.35, -0.03), (0.65, 0.09), (1.4, 0), (1.8, 0)])
    acting.turns["Hips"] = _about(_Y, 0.35 * yaw)
    acting.turns["Spine"] = _turns(_about(_Y, 0.3 * yaw), _about(_X, 4.0))
    acting.turns["Chest"] = _turns(_about(_Y, 0.45 * yaw), _about(_X, 4.0))
    acting.turns["Head"] = _turns(_about(_Y, -0.9 * yaw), _about(_X, -4.0))
    height = curve(times, [(0, 0.93), (0.35, 0.90), (0.65, 0.89), (1.4, 0.93), (1.8, 0.93)])
    _stand(acting, {"Left": (0.10, 0.18, 4.0), "Right": (-0.11, -0.16, 25.0)}, height)
    fist = [(0.0, 6.0), (0.3, 32.0)]
    _arm(
        acting,
        "Left",
        curve(times, [*fist, (0.62, 88), (0.75, 88), (1.1, 34), (1.4, 30), (1.8, 6)]),
        curve(times, [(0, 9), (0.3, 18), (0.62, 2), (0.75, 2), (1.1, 18), (1.8, 9)]),
        curve(
            times, [(0, 20), (0.3, 128), (0.62, 4), (0.75, 4), (1.1, 125), (1.4, 110), (1.8, 20)]
        ),
        # Ahead of the hips, not of the chest that is turned away.
        outwards=np.maximum(-0.8 * yaw, 0.0),
    )
    _arm(
        acting,
        "Right",
        curve(times, [*fist, (1.4, 32), (1.8, 6)]),
        curve(times, [(0, 9), (0.3, 14), (1.4, 14), (1.8, 9)]),
        curve(times, [(0, 20), (0.3, 130), (1.4, 130), (1.8, 20)]),
    )
    return acting


def dance(seconds: float = 3.0) -> Acting:
    """On the spot: knees bend, hips go round, arms wave."""
    acting = _acting(seconds)
    beat = 2.0 * np.pi * acting.times / 1.0
    acting.hips[:, 0] = 0.06 * np.sin(0.5 * beat)
    acting.turns["Hips"] = _turns(
        _about(_Y, 10.0 * np.sin(0.5 * beat)), _about(_Z, -4.0 * np.sin(0.5 * beat))
    )
    acting.turns["Spine"] = _turns(
        _about(_Z, 8.0 * np.sin(0.5 * beat)), _about(_X, 6.0 - 4.0 * np.cos(beat))
    )
    acting.turns["Chest"] = _turns(
        _about(_Y, -14.0 * np.sin(0.5 * beat)), _about(_Z, 4.0 * np.sin(beat))
    )
    acting.turns["Neck"] = _about(_X, 6.0 * np.sin(beat))
    acting.turns["Head"] = _turns(
        _about(_Z, 9.0 * np.sin(0.5 * beat)), _about(_X, 5.0 * np.sin(beat))
    )
    _stand(
        acting, {"Left": (0.13, 0.0, 12.0), "Right": (-0.13, 0.0, 12.0)}, 0.89 + 0.03 * np.cos(beat)
    )
    for side, shift in (("Left", 0.0), ("Right", np.pi)):
        wave = np.sin(0.5 * beat + shift)
        _arm(
            acting,
            side,
            25.0 + 35.0 * wave,
            50.0 + 30.0 * np.cos(0.5 * beat + shift),
            55.0 + 40.0 * wave,
        )
    return acting


# --- Files ---------------------------------------------------------------------------------------


def bvh(acting: Acting, body: Body) -> str:
    """The motion as a BVH file, in metres."""
    names = _names(body)
    rows: list[tuple[str, str, Floats]] = [
        (name, parent, np.array(offset)) for name, parent, offset in _JOINTS
    ]
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        for name, parent, offset in _SIDE_JOINTS:
            longer = body.arms if name in ("ForeArm", "Hand") else 1.0
            above = parent if parent in ("Chest", "Hips") else f"{side}{parent}"
            rows.append((f"{side}{name}", above, longer * np.array(offset) * (sign, 1.0, 1.0)))
    lays = {name: _rest_turn(name, body) for name, _, _ in rows}
    parents = {name: parent for name, parent, _ in rows}
    offsets = {
        name: body.size * (rotate(lays[parent], offset) if parent else offset)
        for name, parent, offset in rows
    }
    order: list[str] = []
    lines = ["HIERARCHY"]

    def write(name: str, depth: int) -> None:
        order.append(name)
        pad = "\t" * depth
        lines.append(f"{pad}{'JOINT' if depth else 'ROOT'} {names[name]}")
        lines.append(f"{pad}{{")
        x, y, z = offsets[name]
        lines.append(f"{pad}\tOFFSET {x:.4f} {y:.4f} {z:.4f}")
        place = "" if depth else "Xposition Yposition Zposition "
        lines.append(f"{pad}\tCHANNELS {3 if depth else 6} {place}Zrotation Xrotation Yrotation")
        for child, parent in parents.items():
            if parent == name:
                write(child, depth + 1)
        for ending, end in _ENDS.items():
            if name.removeprefix("Left").removeprefix("Right") == ending:
                sign = -1.0 if name.startswith("Right") else 1.0
                x, y, z = body.size * rotate(lays[name], np.array(end) * (sign, 1.0, 1.0))
                lines.append(f"{pad}\tEnd Site")
                lines.append(f"{pad}\t{{")
                lines.append(f"{pad}\t\tOFFSET {x:.4f} {y:.4f} {z:.4f}")
                lines.append(f"{pad}\t}}")
        lines.append(f"{pad}}}")

    write("Hips", 0)
    columns = [body.size * acting.hips]
    for name in order:
        above = lays[parents[name]] if parents[name] else np.array([1.0, 0.0, 0.0, 0.0])
        # The rest pose with hanging arms is undone first.
        turn = multiply(multiply(above, acting.turns[name]), conjugate(lays[name]))
        x, y, z = np.degrees(continuous_euler(to_euler(turn, "YXZ"), "YXZ")).T
        columns.append(np.stack([z, x, y], axis=-1))
    values = np.concatenate(columns, axis=1)
    lines += ["MOTION", f"Frames: {len(values)}", f"Frame Time: {1.0 / RATE:.7f}"]
    for row in values:
        place = " ".join(f"{value:.4f}" for value in row[:3])
        # Minus nought is nought.
        angles = " ".join(f"{round(value, 2) + 0.0:g}" for value in row[3:])
        lines.append(f"{place} {angles}")
    return "\n".join(lines) + "\n"


def _names(body: Body) -> dict[str, str]:
    names = {name: body.name.format(side="", joint=name).replace("_", "") for name, *_ in _JOINTS}
    for side in ("Left", "Right"):
        for joint, *_ in _SIDE_JOINTS:
            names[f"{side}{joint}"] = body.name.format(side=side, joint=joint)
    return names


def _rest_turn(name: str, body: Body) -> Floats:
    """How the rest pose of a joint is turned from the one with arms stretched out sideways."""
    side = "Left" if name.startswith("Left") else "Right"
    if name.removeprefix(side) not in _ARM_JOINTS:
        return np.array([1.0, 0.0, 0.0, 0.0])
    sign = 1.0 if side == "Left" else -1.0
    return from_axis_angle(_Z, -sign * body.arms_down)


PERFORMANCES: Final = {
    "walk": (walk, ADULT),
    "throw": (throw, ADULT),
    "punch": (punch, ADULT),
    "dance": (dance, SMALL),
}
"""By name: what is done, and by whom."""


def main() -> None:
    """Write all clips into a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="where the files go")
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for name, (act, body) in PERFORMANCES.items():
        path = folder / f"{name}.bvh"
        path.write_text(bvh(act(), body), encoding="utf-8", newline="\n")
        print(f"{path}  {path.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
