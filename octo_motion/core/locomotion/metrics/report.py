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

from ...rotations import Floats, rotate
from ..clearance import DEEP, Separation
from ..ground import Ground
from ..rig import ArmFrames, Poses, halfway_linear
from . import measures as quality
from .measures import Worst

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
        for number, name in enumerate(measured.names):
            joints, lying, cycles = _looked_at(measured, number)
            length = np.array([measured.arms[number].length * measured.scale])
            keep("SLIP", quality.slip(joints, lying, cycles, length), [name], per_frame=2)
            keep("DEPTH", quality.depth(joints, measured.ground, length), [name], per_frame=2)
        keep("STRAIN", quality.strain(poses.strains), _owners(measured))
    keep("MISS", quality.miss(measured.misses), measured.names)
    if len(measured.frames) > 1:
        keep("TURN", quality.change(poses.rotations, measured.frames), _owners(measured))
    if measured.separation is not None:
        found["OVERLAP"] = _overlap(measured.separation, measured)
    return tuple(found[kind] for kind in KINDS if kind in found)


def _looked_at(measured: Measured, number: int) -> tuple[Floats, np.ndarray, np.ndarray]:
    """One arm on every frame and half way between them.

    Returns:
        Its joints in the world (moments, 1, joints, 3), which of them rest on the ground
        (moments, 1, joints), and its cycles (moments, 1).
    """
    ends = np.cumsum([0, *(len(arm.bones) for arm in measured.arms)])
    bones = slice(int(ends[number]), int(ends[number + 1]))
    poses, half = measured.poses, measured.halfway
    rotations = _halved(
        poses.rotations[:, bones], None if half is None else half.rotations[:, bones], turns=True
    )
    strains = _halved(poses.strains[:, bones], None if half is None else half.strains[:, bones])
    locations = _halved(poses.locations, None if half is None else half.locations)
    orientations = _halved(
        poses.orientations, None if half is None else half.orientations, turns=True
    )
    arm = measured.arms[number]
    own = arm.joints(arm.from_bones(rotations), strains)
    joints = locations[:, None] + rotate(orientations[:, None], measured.scale * own)
    # Half way it rests if it does so before and after.
    rests, cycle = measured.lying[number], measured.cycles[:, number : number + 1]
    still = rests[:-1] & rests[1:] & (cycle[:-1] == cycle[1:])
    lying = _joined(rests, still)
    return joints[:, None], lying[:, None], _joined(cycle, cycle[:-1])


def _halved(values: Floats, half: Floats | None, *, turns: bool = False) -> Floats:
    """Values (frames, …) with those half way in between (2 frames − 1, …).

    Args:
        values: at the frames.
        half: those half way, none for straight on from one frame to the next.
        turns: whether they are unit quaternions.
    """
    return _joined(values, halfway_linear(values, turns=turns) if half is None else half)


def _joined(values: np.ndarray, half: np.ndarray) -> np.ndarray:
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
