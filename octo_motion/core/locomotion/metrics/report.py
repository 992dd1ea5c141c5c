# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures of a whole motion: the worst of each kind, with its frame and its arm.

Arms on the ground are looked at on every frame and half way between frames: a foot that is right
on both may slide in between, where the way from one key to the next is no arc.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats, angle_between, rotate
from ..clearance import DEEP, Separation
from ..ground import Ground
from ..rig import ArmFrames, Poses, halfway_linear


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

    Args:
        joints: (frames, arms, joints, 3) world, frames in their order.
        lying: (frames, arms, joints) which rest.
        cycles: (frames, arms) number of each arm's cycle: in another cycle it rests anew.
        lengths: (arms,) in the units of the joints.
    """
    fresh = lying.copy()
    same = cycles[1:] == cycles[:-1]
    fresh[1:] &= ~(lying[:-1] & same[..., None])
    numbers = np.arange(len(joints))[:, None, None]
    since = np.maximum.accumulate(np.where(fresh, numbers, 0), axis=0)
    start = np.take_along_axis(joints, since[..., None], axis=0)
    moved = np.linalg.norm(joints - start, axis=-1) * lying
    return _worst(moved.max(axis=-1, initial=0.0) / lengths)


def depth(joints: Floats, ground: Ground, lengths: Floats) -> Worst:
    """How far a joint is below the ground, in arm lengths; negative if all are above.

    The root is left out: it is the body's.

    Args:
        joints: (frames, arms, joints, 3) world.
        ground: what they should be above of.
        lengths: (arms,) in the units of the joints.
    """
    below = ground.height(joints[..., 1:, :]) - joints[..., 1:, 2]
    return _worst(below.max(axis=-1) / lengths)


def strain(strains: Floats) -> Worst:
    """By how much a bone is longer or shorter than at rest, as a share: (frames, bones)."""
    return _worst(np.abs(strains))


def miss(misses: Floats) -> Worst:
    """How far an arm is from its target or its foothold: (frames, arms) arm lengths."""
    return _worst(misses)


def change(rotations: Floats, frames: Floats) -> Worst:
    """How far a bone turns from one frame to the next, radians per frame.

    Args:
        rotations: (frames, bones, 4) unit quaternions.
        frames: (frames,) ascending; need not be whole.
    """
    angle = angle_between(rotations[:-1], rotations[1:])
    return _worst(angle / np.diff(frames)[:, None])


def _worst(values: Floats) -> Worst:
    """The largest of values (frames, arms)."""
    if values.size == 0:
        return Worst(0.0, 0, 0)
    sample, arm = np.unravel_index(int(np.argmax(values)), values.shape)
    return Worst(float(values[sample, arm]), int(sample), int(arm))


KINDS: Final = ("SLIP", "DEPTH", "STRAIN", "MISS", "TURN", "OVERLAP")
"""What is measured: arm lengths that an arm slides over the ground that it holds, that its joints
are below the ground, by which share a bone is longer or shorter than at rest, arm lengths that an
arm is from its target or foothold, radians per frame that a bone turns, and radii by which arms
pass through each other or the body."""

TOLD: Final = {"SLIP": 0.01, "DEPTH": 0.005, "MISS": 1e-3, "OVERLAP": DEEP}
"""From where on a figure is too bad to pass without a word."""


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


def figures(measured: Measured) -> tuple[Figure, ...]:
    """The worst of each kind that applies, in the order of ``KINDS``."""
    found: dict[str, Figure] = {}

    def keep(kind: str, worst: Worst, names: Sequence[str], per_frame: int = 1) -> None:
        before = found.get(kind)
        # What is no number is the worst of all.
        if before is None or worst.value > before.value or np.isnan(worst.value):
            frame = int(measured.frames[worst.sample // per_frame])
            found[kind] = Figure(kind, max(worst.value, 0.0), frame, names[worst.arm])

    poses = measured.poses
    if measured.ground is not None:
        half = halfway_linear(poses) if measured.halfway is None else measured.halfway
        for number, name in enumerate(measured.names):
            joints, lying, cycles = _looked_at(measured, half, number)
            length = np.array([measured.arms[number].length * measured.scale])
            keep("SLIP", slip(joints, lying, cycles, length), [name], per_frame=2)
            keep("DEPTH", depth(joints, measured.ground, length), [name], per_frame=2)
        keep("STRAIN", strain(poses.strains), _owners(measured))
    keep("MISS", miss(measured.misses), measured.names)
    if len(measured.frames) > 1:
        keep("TURN", change(poses.rotations, measured.frames), _owners(measured))
    if measured.separation is not None:
        found["OVERLAP"] = _overlap(measured.separation, measured)
    return tuple(found[kind] for kind in KINDS if kind in found)


def _looked_at(
    measured: Measured, half: Poses, number: int
) -> tuple[Floats, np.ndarray, np.ndarray]:
    """One arm on every frame and half way between them.

    Returns:
        Its joints in the world (moments, 1, joints, 3), which of them rest on the ground
        (moments, 1, joints), and its cycles (moments, 1).
    """
    ends = np.cumsum([0, *(len(arm.bones) for arm in measured.arms)])
    bones = slice(int(ends[number]), int(ends[number + 1]))
    poses = measured.poses
    rotations = _joined(poses.rotations[:, bones], half.rotations[:, bones])
    strains = _joined(poses.strains[:, bones], half.strains[:, bones])
    locations = _joined(poses.locations, half.locations)
    orientations = _joined(poses.orientations, half.orientations)
    arm = measured.arms[number]
    own = arm.joints(arm.from_bones(rotations), strains)
    joints = locations[:, None] + rotate(orientations[:, None], measured.scale * own)
    # Half way it rests if it does so before and after.
    rests, cycle = measured.lying[number], measured.cycles[:, number : number + 1]
    still = rests[:-1] & rests[1:] & (cycle[:-1] == cycle[1:])
    lying = _joined(rests, still)
    return joints[:, None], lying[:, None], _joined(cycle, cycle[:-1])


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


def _owners(measured: Measured) -> list[str]:
    """The arm of each bone."""
    pairs = zip(measured.names, measured.arms, strict=True)
    return [name for name, arm in pairs for _ in arm.bones]
