# SPDX-License-Identifier: GPL-3.0-or-later
"""An arm that reaches for an object, winds about it, holds it and lets go.

A grasp is planned once: which stretch of the arm takes hold, and where on the object. That
stretch then stays fixed on the object, however object and body move; between it and the body the
arm bends as it must, without stretching. Everything else is a function of its own frame alone:
the shape that holds, the shape of the reach (see ``reach``) and what the arm does otherwise are
blended joint by joint in angle space.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from ..errors import SettingsError
from ..rotations import (
    Floats,
    conjugate,
    from_axis_angle,
    multiply,
    normalized,
    rotate,
    shortest_arc,
)
from .arm_frames import (
    ArmFrames,
    blended,
    composed,
    frame_of,
    relative,
    transported,
)
from .ccd import closed
from .coil import Coil, Profile, Winding, wind
from .reach import Timeline, eased, first_place, folded, front_width, passed

Mode = Literal["TOUCH", "COIL"]

TOUCH_TURNS: Final = 0.12
"""Of a turn that an arm lays itself on what it only touches."""
_SLACK: Final = 1.04
"""The free part of an arm is at least so many times as long as its way."""
_LOOSE: Final = 1.5
"""A free part longer than this is not made for the sake of a shorter coil."""
_LEAST_FREE: Final = 0.3
"""Share of the arm between the body and the coil, at least."""
_TWISTED: Final = 0.8
"""The twist that brings suckers to the object lies in this last share of the free part."""
_LIFT: Final = 0.25
_CLEAR: Final = 0.85
"""Of the skin's radius: joints on their way keep so far from the object."""
_CLEAR_ROUNDING: Final = 0.3
"""Of the skin's radius: within it, joints begin to give way."""
_CLEARINGS: Final = 4
_X: Final = np.array([1.0, 0.0, 0.0])
_Y: Final = np.array([0.0, 1.0, 0.0])
_UP: Final = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Places:
    """Where the object is at some frames, seen from the armature, in its units."""

    positions: Floats
    """(frames, 3) of the object's origin."""
    rotations: Floats
    """(frames, 4)"""

    def __getitem__(self, chosen: slice | np.ndarray) -> Places:
        """Some of the frames."""
        return Places(self.positions[chosen], self.rotations[chosen])

    def seen(self, points: Floats) -> Floats:
        """Points (…, 3) of the object's frame in armature space, (frames, …, 3)."""
        shape = (len(self.positions), *(1,) * (points.ndim - 1))
        turned = rotate(self.rotations.reshape(*shape, 4), points)
        return turned + self.positions.reshape(*shape, 3)

    def into(self, points: Floats) -> Floats:
        """Points (frames, …, 3) of armature space in the object's frame."""
        shape = (len(self.positions), *(1,) * (points.ndim - 2))
        moved = points - self.positions.reshape(*shape, 3)
        return rotate(conjugate(self.rotations).reshape(*shape, 4), moved)


@dataclass(frozen=True, eq=False)
class Grasp:
    """What has been planned; see :func:`plan_grasp`."""

    arm: ArmFrames
    radii: Floats
    """(bones + 1,) of the skin at the joints."""
    profile: Profile
    timeline: Timeline
    mode: Mode
    coil: Coil
    twist: float
    """Radians of the free part when it touches: later ones are the nearest to it."""
    up: Floats
    """(3,) away from the ground, armature space."""
    wraps: bool
    """Whether it winds on after the touch."""

    @property
    def turns(self) -> float:
        """How often it winds round the object."""
        return self.coil.angle / (2.0 * np.pi)

    def holding(self, places: Places) -> Floats:
        """Frames (frames, segments, 4) of the arm that holds the object where it is."""
        arm, coil, first = self.arm, self.coil, self.coil.first
        wound = len(coil.facing)
        own = frame_of(coil.directions, coil.facing)
        held = multiply(places.rotations[:, None], own)
        result = np.empty((len(places.positions), len(arm.bones), 4))
        result[:, :first] = self._free(places, held[:, 0])
        result[:, first : first + wound] = held
        # What is left of the arm goes on straight; the reach bends it off.
        result[:, first + wound :] = held[:, -1:]
        return result

    def _free(self, places: Places, held: Floats) -> Floats:
        """Frames (frames, first, 4) from the body to the coil."""
        arm, first = self.arm, self.coil.first
        goal = places.seen(self.coil.joints[0]) - arm.root
        lengths = arm.lengths[:first]
        along, facing = rotate(held, _X), rotate(held, _Y)
        shape = _approach(lengths, goal, along, facing, rotate(arm.at_rest[0], _X), self.up)
        shape = closed(np.ascontiguousarray(shape), lengths, goal.T)
        for _ in range(_CLEARINGS):
            steps = lengths[:, None] * np.moveaxis(shape, -1, 0)
            joints = arm.root + np.cumsum(steps, axis=1)
            moved = joints[:, :-1] + self._out_of_the_way(joints[:, :-1], places)
            joints = np.concatenate(
                [np.zeros_like(goal)[:, None] + arm.root, moved, joints[:, -1:]], axis=1
            )
            pushed = np.moveaxis(normalized(np.diff(joints, axis=1)), 0, -1)
            shape = closed(np.ascontiguousarray(pushed), lengths, goal.T)
        directions = np.moveaxis(shape, -1, 0)
        frames = transported(directions, np.broadcast_to(arm.at_rest[0], (len(goal), 4)))
        twist = _twist(frames[:, -1], held)
        twist = self.twist + np.angle(np.exp(1j * (twist - self.twist)))
        share = np.cumsum(lengths) / lengths.sum()
        ramp = np.clip((share - 1.0 + _TWISTED) / _TWISTED, 0.0, 1.0)
        angle = twist[:, None] * (ramp * ramp * (3.0 - 2.0 * ramp))
        return multiply(frames, from_axis_angle(_X, angle))

    def _out_of_the_way(self, joints: Floats, places: Places) -> Floats:
        """Shifts (frames, joints, 3) that bring joints 1 … out of the object; armature space."""
        inside = places.into(joints)
        skin = self.radii[1 : joints.shape[1] + 1]
        lacking = _CLEAR * skin - self.profile.clearance(inside)
        rounding = _CLEAR_ROUNDING * skin
        # Not more than halfway through: beyond that there is no telling which side is nearer.
        shift = 0.5 * (lacking + np.sqrt(lacking * lacking + rounding * rounding))
        shift = np.where(lacking < -3.0 * rounding, 0.0, shift - _at(3.0) * rounding)
        out = self.profile.way_out(inside) * np.maximum(shift, 0.0)[..., None]
        return rotate(places.rotations[:, None], out)

    def _cleared(self, frames: Floats, places: Places, amount: Floats) -> Floats:
        """An arm (frames, segments, 4) bent round the object by an amount (frames,) of 0…1."""
        arm = self.arm
        for _ in range(_CLEARINGS):
            joints = arm.joints(frames)
            shifts = self._out_of_the_way(joints[:, 1:], places) * amount[:, None, None]
            joints[:, 1:] += shifts
            along = normalized(np.diff(joints, axis=1))
            frames = multiply(shortest_arc(rotate(frames, _X), along), frames)
        return frames

    def apply(self, times: Floats, places: Places, otherwise: Floats) -> Floats:
        """Rotations (frames, bones, 4) of the arm, of what it does otherwise (frames, bones, 4).

        Args:
            times: (frames,) any, in any order.
            places: of the object at these times.
            otherwise: in each bone's rest frame, as the result.
        """
        arm, lengths, timeline = self.arm, self.arm.lengths, self.timeline
        weight = timeline.weight(times, arm.reach[:-1] / arm.length)
        moves = np.any(weight > 0.0, axis=-1)
        result = otherwise.copy()
        if not np.any(moves):
            return result
        width = front_width(lengths)
        touches = arm.reach[self.coil.first] + width
        ends = arm.length + width if self.wraps else touches
        front_at = first_place(lengths)
        front = timeline.front(times[moves], front_at, touches, ends)
        holding = relative(self.holding(places[moves]))
        reached = passed(lengths, front)
        last = self.coil.first + len(self.coil.facing)
        # Beyond the last turn the arm is left to curl off.
        reached[:, last:] = 0.0
        fold = folded(lengths, front)
        fold[:, 0] = holding[:, 0]
        reaching = blended(fold, holding, reached)
        # What holds is out of the way already.
        loose = 1.0 - eased((front - front_at) / (touches - front_at))
        cleared = self._cleared(composed(reaching), places[moves], loose)
        reaching = relative(cleared)
        usual = relative(arm.from_bones(otherwise[moves]))
        shape = composed(blended(usual, reaching, weight[moves]))
        result[moves] = arm.to_bones(shape)
        return result


def plan_grasp(
    arm: ArmFrames,
    radii: Floats,
    profile: Profile,
    timeline: Timeline,
    times: Floats,
    places: Places,
    *,
    mode: Mode = "COIL",
    turns: float = 2.0,
    up: Floats = _UP,
    name: str = "The arm",
    target: str = "the object",
) -> Grasp:
    """Decide which stretch of the arm takes hold, and where.

    Args:
        arm: which.
        radii: (bones + 1,) of its skin at the joints, armature units.
        profile: the object's, in its own frame, armature units.
        timeline: when.
        times: (frames,) ascending, at which the object is known.
        places: where it is then.
        mode: touch it, or wind about it.
        turns: at most so many.
        up: (3,) away from the ground, armature space.
        name: what errors call the arm.
        target: what they call the object.

    Raises:
        SettingsError: the motion does not last from the touch to the release; the object is out
            of reach at a frame between the two, which is named.
        RigError: the object has no size, or the arm starts within it.
    """
    held = (times >= timeline.contact - 1e-6) & (times <= timeline.release + 1e-6)
    if not np.any(held):
        raise SettingsError(
            f"{name} would touch {target} at frame {timeline.contact:g}, outside of the motion, "
            f"which lasts from frame {times[0]:g} to {times[-1]:g}.",
            "Change the frames of the reach, or make the motion longer.",
        )
    touch = np.flatnonzero(held)[:1]
    root = places[touch].into(arm.root[None])[0]
    wanted = TOUCH_TURNS if mode == "TOUCH" else turns
    best: tuple[float, Grasp] | None = None
    missing = (0.0, 0)
    # At least two bones, and one is left to take hold.
    least = int(np.searchsorted(arm.reach, _LEAST_FREE * arm.length))
    least = min(max(least, 2), len(arm.bones) - 1)
    for sense in (1, -1):
        winding = Winding(wanted, sense)
        found: Coil | None = None
        for first in range(least, len(arm.bones)):
            coil = wind(profile, arm.lengths, radii, first, root, winding)
            ways = np.linalg.norm(places[held].seen(coil.joints[0]) - arm.root, axis=-1)
            far = float(ways.max())
            if arm.reach[first] < _SLACK * far:
                if first == len(arm.bones) - 1:
                    missing = (far, int(np.flatnonzero(held)[np.argmax(ways)]))
                continue
            if found is not None and (
                coil.angle < 2.0 * np.pi * wanted - 1e-6 or arm.reach[first] > _LOOSE * far
            ):
                break
            found = coil
        if found is None:
            continue
        common = (arm, radii, profile, timeline, mode, found)
        grasp = Grasp(*common, 0.0, up, mode == "COIL")
        whole = grasp.holding(places[touch])
        free = found.first
        twist = float(_twist_without(arm, whole[0], free))
        cost = abs(twist) - 1e-3 * sense
        if best is None or cost < best[0]:
            best = cost, Grasp(*common, twist, up, mode == "COIL")
    if best is None:
        far, at = missing
        raise SettingsError(
            f"{target} is out of reach of {name} at frame {times[at]:g}: it is "
            f"{far / arm.length:.2f} arm lengths away.",
            "Move it nearer, or change the frames of the reach.",
        )
    return best[1]


def _at(slacks: float) -> float:
    """What the rounding leaves at so many roundings from the surface."""
    return 0.5 * (np.sqrt(slacks * slacks + 1.0) - slacks)


def _approach(
    lengths: Floats, goal: Floats, along: Floats, facing: Floats, outward: Floats, up: Floats
) -> Floats:
    """Shape (segments, 3, frames) of the way to a goal (frames, 3), before it is closed.

    A cubic Hermite curve that leaves the body half outwards and arrives as the coil begins; what
    the arm is too long bows away from the object and from the ground.
    """
    far = np.linalg.norm(goal, axis=-1, keepdims=True)
    straight = goal / np.maximum(far, 1e-9)
    leaves = normalized(straight + 0.5 * outward) * far
    arrives = along * far
    bow = normalized(_LIFT * up - facing)
    bow = bow - np.sum(bow * straight, axis=-1, keepdims=True) * straight
    ends = np.cumsum(lengths)
    u = ((ends - 0.5 * lengths) / ends[-1])[:, None, None]
    slack = np.maximum(ends[-1] / np.maximum(far, 1e-9) - 1.0, 0.0)
    bowed = np.sqrt(np.minimum(slack, 1.0) + 1e-4)
    shape = (
        (6.0 * u - 6.0 * u * u) * goal
        + (1.0 - 4.0 * u + 3.0 * u * u) * leaves
        + (3.0 * u * u - 2.0 * u) * arrives
        + 3.0 * bowed * far * (1.0 - 2.0 * u) * bow
    )
    return np.moveaxis(normalized(shape), 1, -1)


def _twist(before: Floats, after: Floats) -> Floats:
    """Angle (…) about the arm by which a frame is twisted against the one before it."""
    carried = transported(rotate(after, _X)[..., None, :], before)[..., 0, :]
    turn = multiply(conjugate(carried), after)
    return 2.0 * np.arctan2(turn[..., 1], turn[..., 0])


def _twist_without(arm: ArmFrames, frames: Floats, first: int) -> Floats:
    """Twist (…) that the free part has to take on, of an arm planned without any."""
    directions = rotate(frames[:first], _X)
    plain = transported(directions, arm.at_rest[0])
    return np.angle(np.exp(1j * _twist(plain[-1], frames[first])))
