# SPDX-License-Identifier: GPL-3.0-or-later
"""An arm that reaches for an object, winds about it, holds it and lets go.

A grasp is planned once: which stretch of the arm takes hold, and where on the object. That
stretch then stays fixed on the object, however object and body move; between it and the body the
arm bends as it must, without stretching. Everything else is a function of its own frame alone:
the shape that holds, the shape of the reach (see ``timeline``) and what the arm does otherwise are
blended joint by joint in angle space.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Final, Literal

import numpy as np

from ...errors import RigError, SettingsError
from ...phrases import phrase
from ...rotations import (
    Floats,
    conjugate,
    from_axis_angle,
    lerp_rotation_vectors,
    less_whole_turns,
    multiply,
    normalized,
    rotate,
    shortest_arc,
    slerp,
)
from ...smoothing import least_jerk, smooth_step
from ..gait import Arm, close_group
from ..rig import ArmFrames, frame_of, transport_frames
from .timeline import (
    Pace,
    Progress,
    Timeline,
    curled,
    embracing,
    even_bell,
    first_place,
    folded,
    front_width,
    passed,
    unhurried,
)
from .winding import Coil, Profile, Skins, Winding, WindingStart, wind

Mode = Literal["TOUCH", "COIL"]

TOUCH_TURNS: Final = 0.12
"""Of a turn that an arm lays itself on what it only touches."""
_SLACK: Final = 1.04
"""The free part of an arm is at least so many times as long as its way."""
_LOOSE: Final = 1.5
"""A free part longer than this is not made for the sake of a shorter coil."""
_LEAST_FREE: Final = 0.3
"""Share of the arm between the body and the coil, at least."""
_LEAST_HELD: Final = 0.1
"""Share of the arm that takes hold, at least."""
_TWISTED: Final = 0.8
"""The twist that brings suckers to the object lies in this last share of the free part."""
_LIFT: Final = 0.25
_HEAP: Final = (0.85, 0.3)
"""Shares of the free part's length that its way has, from which on it begins to make a knee, and at
which it does nothing else."""
_KEEPS: Final = (0.85, 0.65)
"""The same, from which on it keeps to the shape that it has as it is brought to its end."""
_KNEE: Final = np.array([1.2, 1.2, 0.4, 0.5])
"""Which way a knee goes, in lengths of the free part: out from the body and back again, up and down
again, and midway down and to the side where the object is."""
_CLEAR: Final = 0.85
"""Of the skin's radius: joints on their way keep so far from the object."""
_CLEAR_BETWEEN: Final = 0.65
"""The same for the middles of bones, which press in where an arm is wound."""
_CLEAR_ROUNDING: Final = 0.3
"""Share of that distance within which joints begin to give way."""
_FAR: Final = 3.0
_AT_FAR: Final = 0.5 * (np.sqrt(_FAR * _FAR + 1.0) - _FAR)
"""What the rounding leaves at so many roundings from the surface."""
_CLEARINGS: Final = 4
_TOGETHER: Final = 2
"""How many joints on either side of one give way with it."""
_FARTHEST: Final = 0.4
"""Bone lengths that a joint gives way in one go."""
_ENDINGS: Final = 12
"""Steps in which the free part comes to end where the coil begins …"""
_MOST_AT_ONCE: Final = 0.5
"""… and radians that a bone turns in one of them, at most."""
_STIFF: Final = 1e-4
"""What a straight arm yields to a pull along it, for the pull to be of some size."""
_IN_TIME: Final = 0.25
"""Share of its way back by which an arm lets go before an object is out of reach."""
_CLOSING: Final = 20
"""Steps of Newton's method: an arm that is close to what it holds is folded up a lot."""
_PACINGS: Final = 3
"""How often time is given anew to what it does."""
_X: Final = np.array([1.0, 0.0, 0.0])
_Y: Final = np.array([0.0, 1.0, 0.0])
_UP: Final = np.array([0.0, 0.0, 1.0])
_TURNED_OVER: Final = np.radians(160.0)
"""By how much what is brought to the mouth turns over."""
_OUTLINED: Final = 5
"""Every so many points of an object's outline are held over the ground …"""
_ROUNDED: Final = 0.5
"""… and begin to rise so many skins before they would be in it …"""
_SOON: Final = 0.25
"""… but wholly only after this share of the way."""
_BESIDE: Final = 2
"""How many arms close over what is at the mouth, beside the one that has brought it."""


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

    def at(self, before: np.ndarray, after: np.ndarray, share: Floats) -> Places:
        """Places (moments,) between those of two frames each."""
        first, second = self.positions[before], self.positions[after]
        return Places(
            first + share[:, None] * (second - first),
            slerp(self.rotations[before], self.rotations[after], share),
        )

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
class Target:
    """An object to grasp."""

    profile: Profile
    """In its own frame, armature units."""
    places: Places
    name: str = phrase("The object")
    """What errors call it."""


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
    pace: Pace | None = None
    """How its time is given to what it does; evenly without."""

    @property
    def turns(self) -> float:
        """How often it winds round the object."""
        return self.coil.angle / (2.0 * np.pi)

    def holding(self, places: Places, touched: int = 0) -> Floats:
        """Frames (frames, segments, 4) of the arm that holds the object where it is, at frames that
        follow one another; at one of them, by its number, it has touched it.
        """
        arm, coil, first = self.arm, self.coil, self.coil.first
        wound = len(coil.facing)
        own = frame_of(coil.directions, coil.facing)
        held = multiply(places.rotations[:, None], own)
        result = np.empty((len(places.positions), len(arm.bones), 4))
        result[:, :first] = self._free(places, held[:, 0], touched)
        result[:, first : first + wound] = held
        # What is left of the arm goes on straight; the reach bends it off.
        result[:, first + wound :] = held[:, -1:]
        return result

    def _free(self, places: Places, held: Floats, touched: int) -> Floats:
        """Frames (frames, first, 4) from the body to the coil."""
        arm, first = self.arm, self.coil.first
        goal = places.seen(self.coil.joints[0]) - arm.root
        lengths = arm.lengths[:first]
        outward = rotate(arm.at_rest[0], _X)
        aside = np.cross(self.up, outward)
        aside = aside if goal[touched] @ aside >= 0.0 else -aside
        shape = _approach(lengths, goal, held, outward=outward, up=self.up, aside=aside)
        shape = _ended_at(goal.T, np.ascontiguousarray(shape), lengths)
        near = np.arange(len(goal))
        for _ in range(_CLEARINGS):
            joints = arm.root + np.cumsum(
                lengths[:, None] * np.moveaxis(shape[..., near], -1, 0), axis=1
            )
            shifts = self._out_of_the_way(joints[:, :-1], places[near])
            moves = np.any(shifts != 0.0, axis=(1, 2))
            near, joints = near[moves], joints[moves]
            if len(near) == 0:
                break
            joints[:, :-1] += shifts[moves]
            pushed = np.diff(joints, axis=1, prepend=np.broadcast_to(arm.root, (len(near), 1, 3)))
            pushed = np.ascontiguousarray(np.moveaxis(normalized(pushed), 0, -1))
            shape[..., near] = _ended_at(goal[near].T, pushed, lengths)
        directions = np.moveaxis(shape, -1, 0)
        frames = transport_frames(directions, np.broadcast_to(arm.at_rest[0], (len(goal), 4)))
        # It goes on as the object turns, beyond half a turn too.
        twist = np.unwrap(_twist(frames[:, -1], held))
        before = twist[touched] - self.twist
        twist -= before - less_whole_turns(before)
        share = np.cumsum(lengths) / lengths.sum()
        angle = twist[:, None] * smooth_step((share - 1.0 + _TWISTED) / _TWISTED)
        return multiply(frames, from_axis_angle(_X, angle))

    def _out_of_the_way(self, joints: Floats, places: Places) -> Floats:
        """Shifts (frames, joints, 3) that bring joints 1 … out of the object; armature space."""
        count = joints.shape[1]
        middles = 0.5 * (joints[:, 1:] + joints[:, :-1])
        skin = self.radii[1 : count + 1]
        between = 0.5 * (skin[1:] + skin[:-1])
        inside = places.into(np.concatenate([joints, middles], axis=1))
        thick = np.concatenate([_CLEAR * skin, _CLEAR_BETWEEN * between])
        lacking = thick - self.profile.clearance(inside)
        rounding = _CLEAR_ROUNDING * thick
        shift = 0.5 * (lacking + np.sqrt(lacking * lacking + rounding * rounding))
        # Nothing gives way from afar.
        shift = np.where(lacking < -_FAR * rounding, 0.0, shift - _AT_FAR * rounding)
        most = np.maximum(shift[:, :count], 0.0)
        most[:, 1:] = np.maximum(most[:, 1:], shift[:, count:])
        most[:, :-1] = np.maximum(most[:, :-1], shift[:, count:])
        # Neighbours give way together, and none by more than bones can follow.
        for _ in range(_TOGETHER):
            around = np.pad(most, ((0, 0), (1, 1)), mode="edge")
            most = np.maximum(most, 0.5 * (around[:, 2:] + around[:, :-2]))
        farthest = _FARTHEST * self.arm.lengths[:count]
        most = farthest * np.tanh(most / farthest)
        out = self.profile.way_out(inside[:, :count], skin) * most[..., None]
        return rotate(places.rotations[:, None], out)

    def _cleared(self, frames: Floats, places: Places, amount: Floats) -> Floats:
        """An arm (frames, segments, 4) bent round the object by an amount (frames,) of 0…1."""
        arm, result = self.arm, frames.copy()
        near = np.flatnonzero(amount > 0.0)
        for _ in range(_CLEARINGS):
            joints = arm.joints(result[near])
            shifts = self._out_of_the_way(joints[:, 1:], places[near])
            moves = np.any(shifts != 0.0, axis=(1, 2))
            near, joints = near[moves], joints[moves]
            if len(near) == 0:
                break
            joints[:, 1:] += shifts[moves] * amount[near, None, None]
            along = normalized(np.diff(joints, axis=1))
            result[near] = multiply(shortest_arc(rotate(result[near], _X), along), result[near])
        return result

    def apply(self, times: Floats, places: Places, otherwise: Floats) -> Floats:
        """Rotations (frames, bones, 4) of the arm at any times (frames,), of what it does
        otherwise, alike.
        """
        arm, progress = self.arm, self.progress(times)
        moves = np.any(progress.weight(arm.along) > 0.0, axis=-1)
        result = otherwise.copy()
        if np.any(moves):
            usual = arm.shape(arm.from_bones(otherwise[moves]))
            result[moves] = arm.to_bones(self._reaching(progress[moves], places[moves], usual))
        return result

    def progress(self, times: Floats) -> Progress:
        """How far it is at times (frames,)."""
        return self.timeline.progress(times, self.pace)

    @property
    def _touches(self) -> float:
        """Where the front is along the arm when it touches; what only touches is there then with
        all that it lays on the object.
        """
        laid = 0 if self.wraps else len(self.coil.facing)
        return float(self.arm.reach[self.coil.first + laid]) + front_width(self.arm.lengths)

    def front(self, progress: Progress) -> Floats:
        """Where the front is along the arm, (moments,)."""
        lengths, touches = self.arm.lengths, self._touches
        return progress.front(
            begins=first_place(lengths),
            touches=touches,
            ends=self.arm.length + front_width(lengths) if self.wraps else touches,
            freed=float(self.arm.reach[self.coil.first]),
        )

    def _reaching(self, progress: Progress, places: Places, usual: Floats) -> Floats:
        """Frames (moments, segments, 4) of the arm at some progress, from the shape (moments,
        segments, 4) that it has otherwise.
        """
        arm, lengths = self.arm, self.arm.lengths
        front = self.front(progress)
        holding = arm.shape(self.holding(places, int(np.argmax(progress.holds))))
        reached = passed(lengths, front)
        last = self.coil.first + len(self.coil.facing)
        # Beyond the last turn the arm is left to curl off.
        reached[:, last:] = 0.0
        limp = progress.limp[:, None]
        fold = folded(lengths, front, bend=limp, curl=limp)
        fold[:, 0] = holding[:, 0]
        reaching = lerp_rotation_vectors(fold, holding, reached)
        # What holds is out of the way already.
        loose = 1.0 - least_jerk((front - self._touches) / front_width(lengths) + 1.0)
        cleared = self._cleared(arm.shaped(reaching), places, loose)
        weight = progress.weight(arm.along)
        return arm.shaped(lerp_rotation_vectors(usual, arm.shape(cleared), weight))

    def paced(self, times: Floats, places: Places, otherwise: Floats | None = None) -> Grasp:
        """The same, hurried nowhere, of an object at these places at times (frames,) and of what
        the arm does otherwise, rotations (frames, bones, 4); at rest if that is not said.
        """
        arm, grasp = self.arm, self
        usual = np.tile(arm.shape(arm.at_rest), (len(times), 1, 1))
        if otherwise is not None:
            usual = arm.shape(arm.from_bones(otherwise))

        def frames(progress: Progress, moments: Floats) -> Floats:
            before, share = _between(times, moments)
            after = np.minimum(before + 1, len(times) - 1)
            there = slerp(usual[before], usual[after], share[:, None])
            return self._reaching(progress, places.at(before, after, share), there)

        # Where object and arm are hangs on the pace, and it on where they are.
        for _ in range(_PACINGS):
            passing = self.timeline.passing(grasp.pace)
            grasp = replace(self, pace=Pace.of(frames, passing))
        return grasp


def _between(times: Floats, moments: Floats) -> tuple[np.ndarray, Floats]:
    """Which of the times (frames,), ascending, comes before each moment (moments,), and the share
    of the way to the next.
    """
    place = np.interp(moments, times, np.arange(len(times)))
    before = np.minimum(place.astype(np.intp), max(len(times) - 2, 0))
    return before, place - before


def plan_grasp(
    arm: ArmFrames,
    radii: Floats,
    target: Target,
    timeline: Timeline,
    times: Floats,
    *,
    mode: Mode = "COIL",
    turns: float = 2.0,
    up: Floats = _UP,
    name: str = phrase("The arm"),
    lets_go: bool = True,
) -> Grasp:
    """Decide which stretch of the arm takes hold, and where.

    Args:
        arm: which.
        radii: (bones + 1,) of its skin at the joints, armature units.
        target: the object, at these times.
        timeline: when.
        times: (frames,) ascending, at which the object is known.
        mode: touch it, or wind about it.
        turns: at most so many.
        up: (3,) away from the ground, armature space.
        name: what errors call the arm.
        lets_go: whether it may let go before it is asked to: when the object gets out of reach.

    Raises:
        SettingsError: the motion does not last until the touch; the object is out of reach at a
            frame at which the arm has to be at it, which is named.
        RigError: the object has no size, or the arm starts within it.
    """
    held = (times >= timeline.contact - 1e-6) & (times <= timeline.release + 1e-6)
    if not np.any(held):
        raise _outside(target, timeline, times, name)
    times, places = times[held], target.places[held]
    skins = Skins.of(target.profile, radii)
    wanted = TOUCH_TURNS if mode == "TOUCH" else turns

    def holding(count: int) -> Grasp | None:
        """How the arm holds on at so many of the frames, none if it is too short."""
        plans: list[tuple[float, Grasp]] = []
        for sense in (1, -1):
            coil = _coil(arm, skins, places[:count], Winding(wanted, sense))
            if coil is None:
                continue
            grasp = Grasp(
                *(arm, radii, target.profile, timeline, mode, coil, 0.0, up), wraps=mode == "COIL"
            )
            twist = float(_twist_without(arm, grasp.holding(places[:1])[0], coil.first))
            # Suckers come to the object with as little twist as can be.
            plans.append((abs(twist) - 1e-3 * sense, replace(grasp, twist=twist)))
        return min(plans, key=itemgetter(0))[1] if plans else None

    found, count = holding(len(times)), len(times)
    if found is None and lets_go:
        found, count = _letting_go(holding, timeline, times)
    if found is None:
        raise _too_far(arm, target, times[:count], places[:count], name)
    return found


def _letting_go(
    holding: Callable[[int], Grasp | None], timeline: Timeline, times: Floats
) -> tuple[Grasp | None, int]:
    """A grasp that lasts as long as the object is in reach, of its times (frames,), by how an arm
    holds on at so many of them; none where that is not until it is wound. And how many they are.
    """
    least = max(int(np.searchsorted(times, timeline.closed + 1e-6)), 1)
    if holding(least) is None:
        return None, least
    count = _first_true(lambda each: holding(each) is None, least, len(times)) - 1
    grasp, back = holding(count), timeline.end - timeline.release
    assert grasp is not None
    # Not before it lets go is it stretched out.
    release = max(timeline.closed, float(times[count - 1]) - _IN_TIME * back)
    return replace(grasp, timeline=replace(timeline, release=release, end=release + back)), count


def _coil(arm: ArmFrames, skins: Skins, places: Places, winding: Winding) -> Coil | None:
    """The coil of the stretch that takes hold, none if the arm is too short at some place.

    The arm takes hold with as much of it as the free part can spare at every place; where that
    is more than all the turns need, with a stretch further out, as far as that leaves the free
    part not too loose.
    """
    root = places[:1].into(arm.root[None])[0]
    # A last bone alone would hold on to nothing.
    last = int(np.searchsorted(arm.reach, (1.0 - _LEAST_HELD) * arm.length, side="right")) - 1
    last = min(max(last, 2), len(arm.bones) - 1)

    def wound(first: int) -> Coil:
        return wind(skins, arm.lengths, WindingStart(first, root), winding)

    def far(coil: Coil) -> float:
        return float(np.max(np.linalg.norm(places.seen(coil.joints[0]) - arm.root, axis=-1)))

    def enough(first: int) -> bool:
        try:
            return bool(arm.reach[first] >= _SLACK * far(wound(first)))
        except RigError:
            # With a thinner stretch it may just do.
            return False

    def spare(first: int) -> bool:
        coil = wound(first)
        short = coil.angle < 2.0 * np.pi * winding.turns - 1e-6
        return not short and bool(arm.reach[first] <= _LOOSE * far(coil))

    # At least two bones are free, and one is left to take hold.
    least = int(np.searchsorted(arm.reach, _LEAST_FREE * arm.length))
    least = min(max(least, 2), last)
    first = _first_true(enough, least, last)
    if first > last:
        wound(last)
        return None
    if first < last and spare(first):
        first = _first_true(lambda each: not spare(each), first + 1, last) - 1
    return wound(first)


def _first_true(test: Callable[[int], bool], low: int, high: int) -> int:
    """The first of low … high for which a test holds, and it holds from there on; else high + 1."""
    while low <= high:
        middle = (low + high) // 2
        if test(middle):
            high = middle - 1
        else:
            low = middle + 1
    return low


def _outside(target: Target, timeline: Timeline, times: Floats, name: str) -> SettingsError:
    """What to say of an object that would be touched when there is no motion."""
    return SettingsError(
        phrase(
            "{name} would touch {target} at frame {contact:g}, outside of the motion, which "
            "lasts from frame {first:g} to {last:g}.",
            name=name,
            target=target.name,
            contact=timeline.contact,
            first=times[0],
            last=times[-1],
        ),
        "Change the frames of the reach, or make the motion longer.",
    )


def _too_far(
    arm: ArmFrames, target: Target, times: Floats, places: Places, name: str
) -> SettingsError:
    """What to say of an object that the arm cannot hold at all of these times."""
    profile = target.profile
    axis = np.linspace(profile.heights[0], profile.heights[-1], 9)[:, None] * _UP
    ways = places.seen(profile.to_object(axis)) - arm.root
    far = np.min(np.linalg.norm(ways, axis=-1), axis=-1) / arm.length
    at = int(np.argmax(far))
    return SettingsError(
        phrase(
            "{target} is out of reach of {name} at frame {frame:g}: it is {far:.2f} arm lengths "
            "away, and some of the arm has to lie on it.",
            target=target.name,
            name=name,
            frame=times[at],
            far=far[at],
        ),
        "Move it nearer, or change the frames of the reach.",
    )


def _approach(
    lengths: Floats, goal: Floats, held: Floats, *, outward: Floats, up: Floats, aside: Floats
) -> Floats:
    """Shape (segments, 3, frames) of the way to a goal (frames, 3), before it ends there.

    A cubic Hermite curve that leaves the body half outwards and arrives as the coil begins; what
    the arm is too long bows away from the object and from the ground.
    """
    along, facing = rotate(held, _X), rotate(held, _Y)
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
    # Much too long, it would lie in a heap, and which way that leads is not to be told. Not in one
    # plane: so no bone's way comes to nothing, and turns over as the goal passes.
    out, rises, falls, leans = _KNEE
    knee = (1.0 - 2.0 * u) * (out * outward + rises * up)
    knee = knee + 6.0 * u * (1.0 - u) * (leans * aside - falls * up)
    heap = _below(far / ends[-1], _HEAP)
    return np.moveaxis(normalized(shape / ends[-1] + heap * knee), 1, -1)


def _below(share: Floats, limits: tuple[float, float]) -> Floats:
    """How far (…) shares are below two limits: from the first on a little, at the second wholly."""
    high, low = limits
    return smooth_step((high - share) / (high - low))


def _ended_at(goal: Floats, directions: Floats, lengths: Floats) -> Floats:
    """Directions (segments, 3, batch) in nearly a given shape that end at a goal (3, batch).

    Bent as much as it takes (``close_group``); but what makes a knee keeps as near as can be to the
    shape it has: the goal's direction, hardly to be told there, is not to turn it round. Of all
    turns of its segments that bring the end to where it is wanted the least are taken, by Newton's
    method.
    """
    ended = close_group(directions, lengths, goal, _CLOSING)
    knee = _below(np.linalg.norm(goal, axis=0) / lengths.sum(), _KEEPS)
    heaps = np.flatnonzero(knee > 0.0)
    if len(heaps) == 0:
        return ended
    goal, squares = goal[:, heaps], lengths * lengths
    near = ended[..., heaps] + knee[heaps] * (directions - ended)[..., heaps]
    near /= np.linalg.norm(near, axis=1, keepdims=True)
    whole = (1.0 + _STIFF) * float(squares.sum()) * np.eye(3)
    for _ in range(_ENDINGS):
        missing = goal - np.einsum("s,scb->cb", lengths, near)
        # What the end moves by, if each segment turns by its own share of a pull at the end.
        moves = whole - np.einsum("s,scb,sdb->bcd", squares, near, near)
        turn = lengths[:, None, None] * np.linalg.solve(moves, missing.T[..., None])[..., 0].T
        turn -= near * np.sum(turn * near, axis=1, keepdims=True)
        most = np.linalg.norm(turn, axis=1).max(axis=0)
        near += turn * np.minimum(1.0, _MOST_AT_ONCE / np.maximum(most, _MOST_AT_ONCE))
        near /= np.linalg.norm(near, axis=1, keepdims=True)
    ended[..., heaps] = near
    return ended


def _twist(before: Floats, after: Floats) -> Floats:
    """Angle (…) about the arm by which a frame is twisted against the one before it."""
    carried = transport_frames(rotate(after, _X)[..., None, :], before)[..., 0, :]
    turn = multiply(conjugate(carried), after)
    return 2.0 * np.arctan2(turn[..., 1], turn[..., 0])


def _twist_without(arm: ArmFrames, frames: Floats, first: int) -> Floats:
    """Twist (…) that the free part has to take on, of an arm planned without any."""
    directions = rotate(frames[:first], _X)
    plain = transport_frames(directions, arm.at_rest[0])
    return less_whole_turns(_twist(plain[-1], frames[first]))


# --- All reaches of a motion: which arm reaches when, and what it takes along ---------------------


@dataclass(frozen=True, eq=False)
class Travelling:
    """Where the armature is, as the motion carries it."""

    locations: Floats
    """(frames, 3) world."""
    orientations: Floats
    """(frames, 4) world."""
    scale: float
    ground: Callable[[Floats], Floats] | None = None
    """Heights (…) of what is below places (…, 2), world; none where there is nothing."""

    def sunk(self, points: Floats) -> Floats:
        """How deep (frames,) the lowest of points (frames, points, 3), world, is in the ground; not
        above zero where none is.
        """
        if self.ground is None:
            return np.zeros(len(points))
        return (self.ground(points[..., :2]) - points[..., 2]).max(axis=1)

    def seen(self, positions: Floats, rotations: Floats) -> Places:
        """Places in the world (frames, 3), (frames, 4) from the armature, in its units."""
        back = conjugate(self.orientations)
        return Places(
            rotate(back, positions - self.locations) / self.scale, multiply(back, rotations)
        )


@dataclass(frozen=True, eq=False)
class Reach:
    """One reach as plain data."""

    name: str
    arm: str
    """"" for the nearest."""
    mode: str
    turns: float
    timeline: Timeline
    target: str
    profile: Profile | None
    """Metres in the object's frame; a curl has none."""
    positions: Floats
    """(frames, 3) of the object, world."""
    rotations: Floats
    """(frames, 4)"""
    carry: bool = False
    """Whether the object goes along while it is held."""
    brought: float | None = None
    """Frame at which the object that is carried has been brought to the mouth, where it stays; none
    if it is not."""

    @property
    def covered(self) -> Timeline | None:
        """When the arms beside it close over what is brought to the mouth; never if it lets go
        before.
        """
        own, brought = self.timeline, self.brought
        if brought is None or own.release <= brought:
            return None
        return Timeline(own.closed, brought, brought, own.release, own.end)

    def beside_the_body(self, times: Floats) -> Floats:
        """How far (frames,) the arm works beside the body and not below it, 0…1."""
        if self.brought is None:
            return np.ones(len(times))
        if self.mode == "COVER":
            return np.zeros(len(times))
        closed = self.timeline.closed
        return 1.0 - least_jerk((times - closed) / max(0.5 * (self.brought - closed), 1e-6))

    def takes_along(self, times: Floats) -> np.ndarray:
        """At which of the times (frames,) it carries: what is at the mouth stays there."""
        lets_go = times > self.timeline.release
        return (times >= self.timeline.closed) & ~(lets_go & (self.brought is None))


@dataclass(frozen=True, eq=False)
class Carried:
    """Where an object is taken."""

    target: str
    """Name of the object."""
    frames: Floats
    """(frames,) from when it is held until it is let go."""
    positions: Floats
    """(frames, 3) world."""
    rotations: Floats
    """(frames, 4) world."""


@dataclass(frozen=True, eq=False)
class Reached:
    """What has become of the reaches of a motion."""

    notes: tuple[str, ...]
    """What the arms do, in words."""
    carried: tuple[Carried, ...]
    """The objects that they take along."""
    away: Floats
    """(frames, arms) how far each has left what it does otherwise, 0…1."""
    led: Floats
    """(frames, arms) how far each may be led another way, past the others and the body, 0…1: not
    where it works below the body."""
    held: tuple[Floats, ...]
    """For each arm (frames, joints) how far they lie on what is held, 0…1."""


@dataclass(frozen=True, eq=False)
class Reaching:
    """All reaches of a motion; in the order of the artist's list."""

    arms: tuple[Arm, ...]
    frames: tuple[ArmFrames, ...]
    radii: tuple[Floats, ...]
    standings: tuple[tuple[Floats, Floats], ...]
    """Where a pose that stays has brought what each arm hangs on: a shift (3,) and a turn (4,) of
    armature space."""
    up: Floats
    reaches: tuple[Reach, ...]

    def apply(
        self,
        times: Floats,
        rotations: Floats,
        travelling: Travelling,
        strains: Floats | None = None,
    ) -> Reached:
        """Let arms reach, in place.

        At times (frames,) of the motion, rotations (frames, bones, 4) and strains (frames, bones),
        by how much bones are longer than at rest, are of all arms, one after the other. An arm that
        reaches is as long as at rest, and what it has here is taken back in place.

        Raises:
            OctoMotionError: an object is out of reach at a frame, which is named; two reaches of
                one arm overlap.
        """
        work = _Work.of(self, times, travelling, rotations, strains)
        for reach in sorted(self.reaches, key=lambda each: each.timeline.start):
            number = self.arm_of(reach, times, work.seen(reach))
            _check_free(work.busy, number, reach, self.arms[number].name)
            work.busy.append((number, reach))
            work.move(reach, number)
        for number, reach in tuple(work.busy):
            if reach.brought is not None:
                work.cover(reach, number)
        carried: list[Carried] = []
        for way in work.ways.values():
            taken = way.takes_along(times)
            carried.append(
                Carried(way.target, times[taken], way.positions[taken], way.rotations[taken])
            )
        return Reached(tuple(work.notes), tuple(carried), work.away, work.led, work.held)

    def drawn_in(
        self, profile: Profile, position: Floats, rotation: Floats, share: Floats, number: int
    ) -> tuple[Floats, Floats]:
        """Where an object is and how it is turned, (moments, 3) and (moments, 4), armature space,
        that an arm brings from a position (3,) and rotation (4,) to the mouth, by some share
        (moments,) of the way.

        The mouth is below the middle of the arms. The object goes in under the body first and then
        up, and turns over as the arm curls in that holds it, so that nothing is wrung.
        """
        arm, (shift, turn) = self.frames[number], self.standings[number]
        up = rotate(turn, self.up)
        outward = rotate(turn, rotate(arm.at_rest[0], _X))
        aside = normalized(np.cross(up, outward))
        turned = multiply(from_axis_angle(aside, _TURNED_OVER * share), rotation)
        skin = float(np.mean([each[0] for each in self.radii]))
        roots = np.mean([each.root for each in self.frames], axis=0)
        mouth = rotate(turn, roots - skin * self.up) + shift
        middle = position + rotate(rotation, profile.center)
        size = rotate(turned[-1], profile.outline - profile.center) @ up
        way = mouth - float(size.max()) * up - middle
        rise = (way @ up) * up
        path = middle + share[:, None] * (way - rise) + (share * share)[:, None] * rise
        return path - rotate(turned, profile.center), turned

    def grasp(self, reach: Reach, number: int, target: Target, times: Floats) -> Grasp:
        """How an arm takes hold of what it reaches for."""
        mode: Mode = "TOUCH" if reach.mode == "TOUCH" else "COIL"
        return plan_grasp(
            self.frames[number],
            self.radii[number],
            target,
            reach.timeline,
            times,
            mode=mode,
            turns=reach.turns,
            up=self.up,
            name=f"'{self.arms[number].name}'",
            lets_go=not reach.carry,
        )

    def arm_of(self, reach: Reach, times: Floats, places: Places) -> int:
        """The arm that is named; else the one whose root the object is nearest to at the touch."""
        for number, arm in enumerate(self.arms):
            if arm.name == reach.arm:
                return number
        if reach.arm:
            raise RigError(
                phrase(
                    "The reach '{reach}' has no arm '{arm}' that moves.",
                    reach=reach.name,
                    arm=reach.arm,
                ),
                "Choose an arm of the list that is switched on.",
            )
        if reach.profile is None:
            raise SettingsError(
                phrase("It is not said which arm curls in '{reach}'.", reach=reach.name),
                "Choose its arm.",
            )
        at = int(np.argmin(np.abs(times - reach.timeline.contact)))
        goal = places.seen(reach.profile.center)[at]
        away = [float(np.linalg.norm(goal - arm.root) / arm.length) for arm in self.frames]
        return int(np.argmin(away))


@dataclass(eq=False)
class _Work:
    """Reaches on their way to become a motion."""

    reaching: Reaching
    times: Floats
    travelling: Travelling
    rotations: Floats
    """(frames, bones, 4) of all arms, changed in place."""
    strains: Floats | None
    """(frames, bones), likewise."""
    ways: dict[str, Reach]
    """Those that carry their objects, with where they take them, by the objects' names."""
    busy: list[tuple[int, Reach]]
    notes: list[str]
    away: Floats
    led: Floats
    held: tuple[Floats, ...]

    @classmethod
    def of(
        cls,
        reaching: Reaching,
        times: Floats,
        travelling: Travelling,
        rotations: Floats,
        strains: Floats | None,
    ) -> _Work:
        """Nobody reaches yet."""
        away, led = np.zeros((2, len(times), len(reaching.arms)))
        held = tuple(np.zeros((len(times), len(arm.bones) + 1)) for arm in reaching.arms)
        work = cls(reaching, times, travelling, rotations, strains, {}, [], [], away, led, held)
        work.carry()
        return work

    def seen(self, reach: Reach) -> Places:
        """Where a reach's object is, seen from the armature."""
        way = self.ways.get(reach.target, reach)
        return self.travelling.seen(way.positions, way.rotations)

    def move(self, reach: Reach, number: int) -> None:
        """Let an arm reach."""
        reaching, times = self.reaching, self.times
        places, arm = self._as_at_rest(number, self.seen(reach)), reaching.frames[number]
        columns = self._columns(number)
        own, progress = self.rotations[:, columns], reach.timeline.progress(times)
        if reach.profile is None:
            moved = curled(arm, reach.timeline, times, own)
        else:
            profile = reach.profile.scaled(1.0 / self.travelling.scale)
            target = Target(profile, places, f"'{reach.target}'")
            grasp = reaching.grasp(reach, number, target, times).paced(times, places, own)
            self._note(reach, number, grasp)
            moved, progress = grasp.apply(times, places, own), grasp.progress(times)
            self.held[number][:, grasp.coil.first :] += progress.holds[:, None]
        self.rotations[:, columns] = moved
        self._leaves(reach, number, progress)

    def _note(self, reach: Reach, number: int, grasp: Grasp) -> None:
        """Say what an arm does."""
        arm, release = self.reaching.arms[number].name, grasp.timeline.release
        if reach.mode != "TOUCH":
            self.notes.append(
                phrase(
                    "'{arm}' winds {turns:.1f} times round '{target}'.",
                    arm=arm,
                    turns=grasp.turns,
                    target=reach.target,
                )
            )
        if release < reach.timeline.release:
            self.notes.append(
                phrase(
                    "'{arm}' lets go of '{target}' at frame {release:.0f}, before that is out of "
                    "reach.",
                    arm=arm,
                    target=reach.target,
                    release=release,
                )
            )

    def _columns(self, number: int) -> slice:
        """Which of all bones are those of an arm."""
        first = sum(len(each.bones) for each in self.reaching.arms[:number])
        return slice(first, first + len(self.reaching.arms[number].bones))

    def _leaves(self, reach: Reach, number: int, progress: Progress) -> None:
        """Keep in mind that an arm does not do what it does otherwise."""
        self.away[:, number] += progress.away
        self.led[:, number] += progress.away * reach.beside_the_body(self.times)
        if self.strains is not None:
            weight = progress.weight(self.reaching.frames[number].along)
            self.strains[:, self._columns(number)] *= 1.0 - weight

    def cover(self, reach: Reach, number: int) -> None:
        """Let the arms beside one that brings something to the mouth lie down on that, and the web
        between them with them; those that reach for something else, or cannot, do not.
        """
        reaching, covered = self.reaching, reach.covered
        if covered is None:
            return
        roots = np.array([arm.root for arm in reaching.frames])
        lays = replace(reach, timeline=covered, mode="COVER")
        outward = rotate(reaching.frames[number].at_rest[0], _X)
        beside = np.argsort(np.linalg.norm(roots - roots[number], axis=1))[1 : 1 + _BESIDE]
        for other in beside.tolist():
            if _taken(self.busy, other, lays):
                continue
            self.busy.append((other, lays))
            arm, columns = reaching.frames[other], self._columns(other)
            # Suckers are below: about them it is the other way round.
            over = np.cross(rotate(arm.at_rest[0], _X), outward) @ reaching.up
            own, way = self.rotations[:, columns], -1.0 if over > 0.0 else 1.0
            self.rotations[:, columns] = embracing(arm, covered, self.times, own, way)
            self._leaves(lays, other, covered.progress(self.times))

    def carry(self) -> None:
        """Find out where objects are taken."""
        times, travelling = self.times, self.travelling
        for reach in self.reaching.reaches:
            held = np.flatnonzero(reach.takes_along(times))
            if not reach.carry or len(held) == 0:
                continue
            if reach.target in self.ways:
                raise SettingsError(
                    phrase(
                        "Both '{first}' and '{second}' carry '{target}'.",
                        first=self.ways[reach.target].name,
                        second=reach.name,
                        target=reach.target,
                    ),
                    "Let one of them carry it; the other arm may hold it as well.",
                )
            seen = travelling.seen(reach.positions, reach.rotations)
            line = reach.timeline
            if reach.brought is None or reach.profile is None:
                start, own = seen.positions[held[0]], seen.rotations[held[0]]
                places, turned = np.tile(start, (len(held), 1)), np.tile(own, (len(held), 1))
                share = even_bell((times[held] - line.closed) / (line.end - line.release))
            else:
                number = self.reaching.arm_of(reach, times, seen)
                share, (places, turned) = self._drawn_in(reach, number, seen, held)
            positions, rotations = reach.positions.copy(), reach.rotations.copy()
            turn = travelling.orientations[held]
            positions[held] = travelling.locations[held] + travelling.scale * rotate(turn, places)
            rotations[held] = multiply(turn, turned)
            positions[held] += self._risen(reach, share, positions[held], rotations[held])
            positions[held[-1] :], rotations[held[-1] :] = positions[held[-1]], rotations[held[-1]]
            self.ways[reach.target] = replace(reach, positions=positions, rotations=rotations)

    def _drawn_in(
        self, reach: Reach, number: int, seen: Places, held: np.ndarray
    ) -> tuple[Floats, tuple[Floats, Floats]]:
        """Shares of the way to the mouth of an object that is held at some frames (moments,), from
        where it is seen at the first of them, such that the arm is hurried nowhere; and where the
        object is then.
        """
        assert reach.profile is not None
        assert reach.brought is not None
        profile, closed = reach.profile.scaled(1.0 / self.travelling.scale), reach.timeline.closed
        begins = seen.positions[held[0]], seen.rotations[held[0]]

        def drawn(share: Floats) -> tuple[Floats, Floats]:
            return self.reaching.drawn_in(profile, *begins, share, number)

        def places(share: Floats) -> Places:
            return self._as_at_rest(number, Places(*drawn(share)))

        # The grasp hangs on where the object was before, too.
        known = self._as_at_rest(number, seen)
        evenly = places(np.linspace(0.0, 1.0, len(held)))
        known.positions[held], known.rotations[held] = evenly.positions, evenly.rotations
        target = Target(profile, known, f"'{reach.target}'")
        grasp = self.reaching.grasp(reach, number, target, self.times)
        took = max(reach.brought - closed, 1e-6)
        way = (self.times[held] - closed) / took
        share = unhurried(way, lambda each: grasp.holding(places(each)))
        return share, drawn(share)

    def _as_at_rest(self, number: int, seen: Places) -> Places:
        """Places as an arm would have them whose body is at rest."""
        shift, turn = self.reaching.standings[number]
        return Places(
            rotate(conjugate(turn), seen.positions - shift),
            multiply(conjugate(turn), seen.rotations),
        )

    def _risen(self, reach: Reach, share: Floats, positions: Floats, rotations: Floats) -> Floats:
        """By how much (frames, 3) an object at positions (frames, 3) and rotations (frames, 4),
        world, is to be higher so that it goes no deeper into the ground than where it was found, by
        shares (frames,) of the way on which it is taken.

        What is turned over on its way to the mouth has the arm below it then.
        """
        travelling, result = self.travelling, np.zeros_like(positions)
        if travelling.ground is None or reach.profile is None:
            return result
        skin = travelling.scale * float(np.mean([each.mean() for each in self.reaching.radii]))
        outline = rotate(rotations[:, None], reach.profile.outline[::_OUTLINED])
        deeper = travelling.sunk(positions[:, None] + outline)
        deeper = deeper - deeper[0] + 2.0 * skin * share * (reach.brought is not None)
        rise = 0.5 * (deeper + np.hypot(deeper, _ROUNDED * skin))
        result[:, 2] = least_jerk(share / _SOON) * rise
        return result


def _taken(busy: Sequence[tuple[int, Reach]], number: int, reach: Reach) -> Reach | None:
    """The reach that an arm is busy with when another is to begin, none if it is free."""
    for other, before in busy:
        apart = (
            reach.timeline.start >= before.timeline.end
            or before.timeline.start >= reach.timeline.end
        )
        if other == number and not apart:
            return before
    return None


def _check_free(busy: Sequence[tuple[int, Reach]], number: int, reach: Reach, arm: str) -> None:
    if (before := _taken(busy, number, reach)) is not None:
        raise SettingsError(
            phrase(
                "'{arm}' reaches in '{before}' until frame {end:g} and in '{reach}' from frame "
                "{start:g}.",
                arm=arm,
                before=before.name,
                end=before.timeline.end,
                reach=reach.name,
                start=reach.timeline.start,
            ),
            "Let one end before the other starts, or choose another arm.",
        )
