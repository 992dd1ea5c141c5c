# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures of a whole motion: the worst of each kind, with its frame and its arm.

They are taken from what was computed, or from what Blender plays of it where constraints, drivers
and the like make something else of the keys. Arms on the ground are looked at on every frame and
half way between frames: a foot that is right on both may slide in between, where the way from one
key to the next is no arc.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ...phrases import joined_phrases, phrase
from ...rotations import (
    Floats,
    angle_between,
    conjugate,
    continuous,
    from_matrix,
    multiply,
    normalized,
    rotate,
)
from ..clearance import DEEP, Separation
from ..ground import Ground
from ..rig import ArmFrames, ArmSkin, Poses, halfway_linear, turns_in_world


@dataclass(frozen=True)
class Worst:
    """The largest value of its kind."""

    value: float
    sample: int
    """Number of the frame among those that were given."""
    arm: int
    """Number of the arm among those that were given; of bones, of the bone."""


def slip(joints: Floats, lying: np.ndarray, cycles: np.ndarray, lengths: Floats) -> Worst:
    """How far a joint that rests on the ground has moved since it came to rest, in arm lengths.

    Joints (frames, arms, joints, 3), world, and lengths (arms,) are of one unit. Those that lie
    (frames, arms, joints) rest anew in another of each arm's cycles (frames, arms).
    """
    fresh = lying.copy()
    same = cycles[1:] == cycles[:-1]
    fresh[1:] &= ~(lying[:-1] & same[..., None])
    numbers = np.arange(len(joints))[:, None, None]
    since = np.maximum.accumulate(np.where(fresh, numbers, 0), axis=0)
    start = np.take_along_axis(joints, since[..., None], axis=0)
    moved = np.linalg.norm(joints - start, axis=-1) * lying
    return _worst(moved.max(axis=-1, initial=0.0) / lengths)


def depth(below: Floats) -> Worst:
    """How far skin is below the ground: (frames, arms, joints) arm lengths, negative above it."""
    return _worst(below.max(axis=-1))


def strain(strains: Floats) -> Worst:
    """By how much a bone is longer or shorter than at rest, as a share: (frames, bones)."""
    return _worst(np.abs(strains))


def miss(misses: Floats) -> Worst:
    """How far an arm is from its target or its foothold: (frames, arms) arm lengths."""
    return _worst(misses)


def change(turned: Floats, frames: Floats) -> Worst:
    """How far bones turn, radians per frame, by radians (frames − 1, bones) from one of the frames
    (frames,), ascending, to the next.
    """
    return _worst(turned / np.diff(frames)[:, None])


def _worst(values: Floats) -> Worst:
    """The largest of values (frames, arms)."""
    if values.size == 0:
        return Worst(0.0, 0, 0)
    sample, arm = np.unravel_index(int(np.argmax(values)), values.shape)
    return Worst(float(values[sample, arm]), int(sample), int(arm))


KINDS: Final = ("SLIP", "DRIFT", "DEPTH", "STRAIN", "MISS", "TURN", "OVERLAP")
"""What is measured: arm lengths that an arm slides over the ground that it holds, that what rests
creeps over a whole hold, that skin is below the ground, by which share a bone is longer or shorter
than at rest, arm lengths that an arm is from its target or foothold, radians per frame that a bone
turns in the world, and radii by which arms pass through each other or the body."""

TOLD: Final = {
    "SLIP": 0.01,
    "DRIFT": 0.02,
    "DEPTH": 0.005,
    "MISS": 1e-3,
    "TURN": np.radians(60.0),
    "OVERLAP": DEEP,
}
"""From where on a figure is too bad to pass without a word."""

_BREAKS: Final = {"DEPTH": 0.05, "TURN": np.radians(60.0)}
"""From where on the motion is broken there."""
_SAID: Final = {
    "SLIP": phrase("'{arm}' slips by {percent:.1f} % of its length at frame {frame}"),
    "DRIFT": phrase(
        "'{arm}' drifts by {percent:.1f} % of its length while it rests, at frame {frame}"
    ),
    "DEPTH": phrase("'{arm}' is {percent:.1f} % of its length below the ground at frame {frame}"),
    "TURN": phrase("'{arm}' turns by {degrees:.0f}° at frame {frame}"),
}
"""How what is too bad is told; misses and overlaps have sentences of their own."""
_WAYS: Final = np.concatenate([np.geomspace(1.0 / 64.0, 1.0 / 8.0, 7), np.arange(2, 9) / 8.0])
"""Shares of how deep skin is below the ground, at which it is looked for a way out to the side:
beside a cliff that is far less than how high it is."""
_AT_ONCE: Final = 256
"""Joints for which that is done at once, the deepest first."""
_TINY: Final = 1e-12


@dataclass(frozen=True)
class Figure:
    """The worst of one kind."""

    kind: str
    """Of ``KINDS``."""
    value: float
    """Arm lengths, shares, radians per frame, radii."""
    frame: int
    """Where it is worst; of what is worst between two frames the first."""
    arm: str
    """Name, of an overlap of both, "" where there is none."""


@dataclass(frozen=True, eq=False)
class Played:
    """Arms as Blender plays them, with all that constraints and drivers make of their keys."""

    joints: Sequence[Floats]
    """For each arm (2 frames − 1, joints, 3) world: on frames and half way between them."""
    orientations: Sequence[Floats]
    """For each arm (2 frames − 1, bones, 4) of its bones, world."""


def played_arm(matrices: Floats, length: float) -> tuple[Floats, Floats]:
    """What :class:`Played` has of one arm: joints (moments, bones + 1, 3) and orientations
    (moments, bones, 4).

    Matrices (moments, bones, 4, 4) are of its bones in the world, root to tip; the length is that
    of the last one, in its own units.
    """
    heads, axes = matrices[..., :3, 3], matrices[..., :3, :3]
    tip = heads[:, -1:] + length * axes[:, -1:, :, 1]
    sizes = np.linalg.norm(axes, axis=-2, keepdims=True)
    return np.concatenate([heads, tip], axis=1), from_matrix(axes / np.maximum(sizes, _TINY))


@dataclass(frozen=True, eq=False)
class Measured:
    """What the figures are taken from."""

    frames: Floats
    """(frames,)"""
    arms: Sequence[ArmFrames]
    names: Sequence[str]
    """Of the arms."""
    poses: Poses
    """At the frames."""
    misses: Floats
    """(frames, arms) arm lengths."""
    scale: float
    """Metres of the armature's unit."""
    ground: Ground | None
    """What is stood on, none where nothing holds the ground."""
    lying: Sequence[np.ndarray]
    """For each arm (frames, joints) which rest on the ground."""
    cycles: np.ndarray
    """(frames, arms) number of each arm's cycle."""
    separation: Separation | None
    """How far arms keep apart, none where nobody has looked."""
    every: int
    """At every how many frames overlaps were looked for."""
    halfway: Poses | None = None
    """Half way between frames (frames − 1); none where keys on every frame lead straight on."""
    skins: Sequence[ArmSkin] | None = None
    """Of each arm, none where nothing holds the ground."""
    rate: float = 24.0
    """Frames per second."""
    stays: tuple[Floats, Floats] | None = None
    """Locations (frames, 3) and orientations (frames, 4) of an armature that plays in place; its
    poses are those of one that goes along. None where it does."""
    played: Played | None = None
    """What Blender plays, none where that is what was computed."""
    floor: Ground | None = None
    """What lies below where nothing is stood on, or in place; none where there is nothing."""
    rolled_up: tuple[Poses, Poses] | None = None
    """What plays on frames, and half way between them, where poses are those of a plan on ground
    that is rolled out, or that moves; none where the plan is the world."""
    ground_moves: bool = False
    """Whether that ground moves: what holds is measured in the plan then."""
    turning: Floats | None = None
    """What :func:`turns_in_world` says of the poses, none where nobody has asked it."""

    @property
    def as_it_plays(self) -> Measured:
        """The same of what plays in the world, whose ground is another."""
        if self.rolled_up is None:
            return self
        poses, halfway = self.rolled_up
        return replace(self, poses=poses, halfway=halfway, rolled_up=None, turning=None)

    @property
    def moments(self) -> Floats:
        """(2 frames − 1,) frames, and half way between them."""
        return _joined(self.frames, 0.5 * (self.frames[:-1] + self.frames[1:]))


def finding_figures(measured: Measured) -> Generator[float, None, tuple[Figure, ...]]:
    """The worst of each kind that applies, in the order of ``KINDS``; an arm at a step.

    What is played counts before what was computed, but for misses and overlaps.
    """
    found: dict[str, Figure] = {}

    def keep(kind: str, worst: Worst, name: str, per_frame: int = 1) -> None:
        before = found.get(kind)
        # What is no number is the worst of all.
        if before is None or worst.value > before.value or np.isnan(worst.value):
            frame = int(measured.frames[worst.sample // per_frame])
            found[kind] = Figure(kind, max(worst.value, 0.0), frame, name)

    nowhere = measured.ground is None and measured.floor is None
    body = None if nowhere else _body(measured)
    shown = measured.as_it_plays
    turning = _turning(shown)
    for number, name in enumerate(measured.names):
        yield 1.0
        arm = None if nowhere else _moving(measured, number)
        seen = arm if arm is None or shown is measured else _moving(shown, number)
        if len(measured.frames) > 1:
            keep("TURN", change(turning[:, _bones(measured, number)], measured.frames), name)
        if arm is None or seen is None or body is None:
            continue
        length = measured.arms[number].length * measured.scale
        if measured.floor is not None:
            below = _below(measured, number, arm, arm.joints, measured.floor)
            deepest = _beside_walls(below, arm.joints[:, 1:] / length, measured.floor, length)
            keep("DEPTH", deepest, name, per_frame=2)
        if measured.ground is None:
            continue
        going = _going(measured, arm.joints)
        lying, cycles = _lying(measured, number)
        # What holds on to ground that moves goes with it, and rests in the plan alone.
        held = going if shown is measured or measured.ground_moves else seen.joints
        keep("SLIP", slip(held[:, None], lying, cycles, np.array([length])), name, per_frame=2)
        below = _below(measured, number, arm, going, measured.ground)
        deepest = _beside_walls(below, going[:, 1:] / length, measured.ground, length)
        keep("DEPTH", deepest, name, per_frame=2)
        own = arm.joints[::2, 1:] / length
        rests = resting(own, -below[::2], body / length, measured.rate)
        if shown is not measured:
            # An arm that reaches, or is in a pose, does not lie where it was planned.
            rests &= measured.lying[number][:, 1:]
        creeping = own if held is going else held[::2, 1:] / length
        keep("DRIFT", _worst(drifts(creeping, rests, measured.rate)), name)
        keep("STRAIN", strain(seen.strains), name)
    for number, name in enumerate(measured.names):
        keep("MISS", miss(measured.misses[:, number : number + 1]), name)
    if measured.separation is not None:
        found["OVERLAP"] = _overlap(measured.separation, measured)
    return tuple(found[kind] for kind in KINDS if kind in found)


def warnings_for_figures(found: Sequence[Figure]) -> tuple[str, ...]:
    """A sentence on what one would see, the worst first; none if one would see nothing.

    Misses and overlaps are left to :func:`~..motion.pipeline.warnings_for_misses` and
    :meth:`~..clearance.BodyVolume.told`.
    """
    # What is no number is beyond any limit.
    beyond = [each for each in found if each.kind in _SAID and not each.value <= TOLD[each.kind]]
    if not beyond:
        return ()
    # What breaks first, and then what is farthest beyond its limit.
    whole = {each: each.value <= _BREAKS.get(each.kind, np.inf) for each in beyond}
    beyond.sort(key=lambda each: (whole[each], TOLD[each.kind] / each.value))
    broken = not whole[beyond[0]]
    told = joined_phrases(
        "; ",
        (
            phrase(
                _SAID[each.kind],
                arm=each.arm,
                percent=100.0 * each.value,
                degrees=np.degrees(each.value),
                frame=each.frame,
            )
            for each in beyond
        ),
    )
    return (
        phrase("The motion breaks: {told}.", told=told)
        if broken
        else phrase("One sees that {told}.", told=told),
    )


# --- Arms as they are played ----------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _ArmMoving:
    """One arm as it is seen to move."""

    joints: Floats
    """(2 frames − 1, joints, 3) world."""
    orientations: Floats
    """(2 frames − 1, bones, 4) of its bones, world."""
    strains: Floats
    """(frames, bones)"""


def _places(measured: Measured, *, going: bool) -> tuple[Floats, Floats]:
    """Locations (2 frames − 1, 3) and orientations (2 frames − 1, 4) of the armature, world.

    One that stays is taken to go along, if asked so.
    """
    poses, half = measured.poses, _half(measured)
    locations = _joined(poses.locations, half.locations)
    orientations = _joined(poses.orientations, half.orientations)
    if going or measured.stays is None:
        return locations, orientations
    stayed, turned = measured.stays[0], continuous(measured.stays[1])
    half_turned = normalized(turned[1:] + turned[:-1])
    return _joined(stayed, 0.5 * (stayed[1:] + stayed[:-1])), _joined(turned, half_turned)


def _half(measured: Measured) -> Poses:
    return halfway_linear(measured.poses) if measured.halfway is None else measured.halfway


def _body(measured: Measured) -> Floats:
    """(frames, 3) the middle of where arms begin, as it is played."""
    if measured.played is not None:
        return np.mean([joints[::2, 0] for joints in measured.played.joints], axis=0)
    locations, orientations = _places(measured, going=False)
    middle = np.mean([arm.root for arm in measured.arms], axis=0)
    return (locations + rotate(orientations, measured.scale * middle))[::2]


def _turning(measured: Measured) -> Floats:
    """Radians (frames − 1, bones) by which the bones of all arms turn from frame to frame as they
    are played, world.
    """
    if measured.played is not None:
        turned = np.concatenate([each[::2] for each in measured.played.orientations], axis=1)
        return angle_between(turned[:-1], turned[1:])
    if measured.turning is not None:
        return measured.turning
    poses = measured.poses
    _, orientations = measured.stays or (poses.locations, poses.orientations)
    return turns_in_world(measured.arms, poses.rotations, orientations)


def _bones(measured: Measured, number: int) -> slice:
    """Which of all bones are an arm's."""
    start = sum(len(each.bones) for each in measured.arms[:number])
    return slice(start, start + len(measured.arms[number].bones))


def _moving(measured: Measured, number: int) -> _ArmMoving:
    """An arm as it is played."""
    arm, scale = measured.arms[number], measured.scale
    if measured.played is not None:
        joints = measured.played.joints[number]
        strains = np.linalg.norm(np.diff(joints[::2], axis=1), axis=-1) / (scale * arm.lengths)
        return _ArmMoving(joints, measured.played.orientations[number], strains - 1.0)
    poses, half, bones = measured.poses, _half(measured), _bones(measured, number)
    strains = _joined(poses.strains[:, bones], half.strains[:, bones])
    turned = arm.rest.orientations(_joined(poses.rotations[:, bones], half.rotations[:, bones]))
    own = scale * arm.joints(multiply(turned, arm.own), strains)
    locations, orientations = _places(measured, going=False)
    joints = locations[:, None] + rotate(orientations[:, None], own)
    return _ArmMoving(joints, multiply(orientations[:, None], turned), strains[::2])


def _below(
    measured: Measured, number: int, arm: _ArmMoving, joints: Floats, ground: Ground
) -> Floats:
    """Arm lengths (moments, joints − 1) that an arm's skin is below a ground, of all joints
    (moments, joints, 3) but the root.
    """
    length = measured.arms[number].length * measured.scale
    below = ground.height(joints[:, 1:]) - joints[:, 1:, 2]
    if measured.skins is not None:
        skin, scale = measured.skins[number], measured.scale
        below = _skin_below(below, skin, arm.orientations, scale, TOLD["DEPTH"] * length)
    return below / length


def _skin_below(
    below: Floats, skin: ArmSkin, orientations: Floats, scale: float, seen: float
) -> Floats:
    """Metres (moments, joints − 1) that skin is below the ground, of joints that are so far but the
    root.

    Bones are oriented (moments, bones, 4), world; the scale is metres of the armature's unit. Only
    from so many metres on does it matter that the skin may not be round.
    """
    found = below + scale * skin.radii[1:]
    some = np.flatnonzero(found.max(axis=1) > seen)
    if len(some):
        down = rotate(conjugate(orientations[some]), np.array([0.0, 0.0, -1.0]))
        reach = skin.seen_below(down)
        reach[:, :-1, 1] = np.minimum(reach[:, :-1, 1], reach[:, 1:, 0])
        found[some] = below[some] + scale * reach[..., 1]
    return found


def _beside_walls(below: Floats, joints: Floats, ground: Ground, length: float) -> Worst:
    """The deepest skin of an arm of a length in metres, beside a wall no deeper than the wall is
    near.

    Below the ground above it are (moments, joints) arm lengths, at joints (moments, joints, 3).
    """
    deepest = depth(below[:, None])
    if not deepest.value > TOLD["DEPTH"]:
        return deepest
    found, angles = Worst(0.0, 0, 0), np.arange(8) * np.pi / 4.0
    around = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    order = np.argsort(-below, axis=None, kind="stable")
    for start in range(0, len(order), _AT_ONCE):
        some = order[start : start + _AT_ONCE]
        deep, points = below.flat[some], joints.reshape(-1, 3)[some]
        if deep[0] <= found.value:
            break
        ways = deep[:, None] * _WAYS
        aside = points[:, None, None, :2] + ways[..., None, None] * around
        own = ground.height(length * points) / length - deep
        free = ground.height(length * aside) / length <= own[:, None, None]
        deep = np.minimum(deep, np.where(free.any(axis=-1), ways, np.inf).min(axis=-1))
        if deep.max() > found.value:
            place = int(deep.argmax())
            found = Worst(float(deep[place]), int(some[place]) // below.shape[1], 0)
    return found


def _going(measured: Measured, joints: Floats) -> Floats:
    """Joints (2 frames − 1, joints, 3) in the world over whose ground they go: in place it goes by.

    There they are as if the armature, which stays, went along.
    """
    if measured.stays is None:
        return joints
    location, orientation = _places(measured, going=False)
    locations, orientations = _places(measured, going=True)
    own = rotate(conjugate(orientation)[:, None], joints - location[:, None])
    return locations[:, None] + rotate(orientations[:, None], own)


def _lying(measured: Measured, number: int) -> tuple[np.ndarray, np.ndarray]:
    """One arm on every frame and half way between them: which of its joints rest on the ground
    (moments, 1, joints), and its cycles (moments, 1).
    """
    rests, cycle = measured.lying[number], measured.cycles[:, number : number + 1]
    # Half way it rests if it does so before and after.
    still = rests[:-1] & rests[1:] & (cycle[:-1] == cycle[1:])
    return _joined(rests, still)[:, None], _joined(cycle, cycle[:-1])


def _joined(values: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Values (frames, …) with those half way in between (2 frames − 1, …)."""
    result = np.empty((2 * len(values) - 1, *values.shape[1:]), dtype=values.dtype)
    result[::2], result[1::2] = values, half
    return result


def _overlap(separation: Separation, measured: Measured) -> Figure:
    deepest = separation.worst
    if deepest is None:
        return Figure("OVERLAP", 0.0, int(measured.frames[0]), "")
    frame = int(measured.frames[deepest.frame * measured.every])
    both = f"{deepest.first}, {deepest.second}"
    return Figure("OVERLAP", max(float(deepest.depth), 0.0), frame, both)


# --- What rests on the ground as one sees it, and how far it creeps while it does -----------------
#
# Nothing of that knows gaits or footholds: a joint rests where its skin lies on the ground and is
# not carried along. So a motion in place, whose arms hold nothing, is looked at as well.


_NEAR: Final = 0.012
"""Arm lengths over the ground: skin that is nearer lies on it."""
_LONG: Final = 0.3
"""Seconds: what lies for less is passing by."""
_CARRIED: Final = 0.5
"""Share of the body's speed: what is faster is taken along."""
_CREEPING: Final = 0.1
"""Arm lengths a second: what is slower rests, however slow the body is."""


def resting(joints: Floats, over: Floats, body: Floats, rate: float) -> np.ndarray:
    """Which joints of an arm rest (frames, joints).

    A joint rests while it and its neighbours on the arm lie on the ground and it is slow, both from
    the frame before and to the next. Joints (frames, joints, 3) as they are played, how high their
    skin is ``over`` the ground (frames, joints), and where the body is (frames, 3) are in arm
    lengths; ``rate`` is in frames per second.
    """
    steps = np.linalg.norm(np.diff(joints, axis=0), axis=-1)
    going = np.linalg.norm(np.diff(body, axis=0), axis=-1)
    carried = steps > np.maximum(_CARRIED * going, _CREEPING / rate)[:, None]
    moved = np.zeros(over.shape, dtype=bool)
    moved[1:] |= carried
    moved[:-1] |= carried
    lying = np.pad(over < _NEAR, ((0, 0), (1, 1)), constant_values=True)
    return lying[:, :-2] & lying[:, 1:-1] & lying[:, 2:] & ~moved


def drifts(joints: Floats, rests: np.ndarray, rate: float) -> Floats:
    """How far joints (frames, joints, 3), as they are played at a rate per second, are from where
    they are in the middle of their hold (frames, joints), by which of them rest (frames, joints).

    0 where a joint does not rest, rests for less than an eye takes for a hold, or comes to rest or
    leaves, where skin rolls on and off.
    """
    # Joint by joint, with a frame between that does not rest.
    row = np.pad(rests, ((1, 1), (0, 0))).T.ravel()
    edges = np.flatnonzero(np.diff(row))
    starts, ends = edges[::2] + 1, edges[1::2] + 1
    long = ends - starts >= _LONG * rate
    starts, ends = starts[long] + 1, ends[long] - 1
    counts = np.maximum(ends - starts, 0)
    middles = np.repeat(starts + counts // 2, counts)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    held = np.repeat(starts, counts) + within
    places = np.pad(joints, ((1, 1), (0, 0), (0, 0))).swapaxes(0, 1).reshape(-1, 3)
    found = np.zeros(len(row))
    found[held] = np.linalg.norm(places[held] - places[middles], axis=-1)
    return found.reshape(rests.shape[1], -1).T[1:-1]
