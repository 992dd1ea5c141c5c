# SPDX-License-Identifier: GPL-3.0-or-later
"""Few keys in place of one per frame: what belongs together, and how far it may be off."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ...keyframes import (
    LOCATION,
    SCALE,
    BezierKeys,
    Channel,
    Limb,
    LimbChain,
    Residuals,
    RigChannels,
    Track,
    chain_to_tip,
    reduce_keys,
    reducing,
    values_at,
)
from ...rotations import Floats
from ...skeleton import Skeleton
from ..gait import Arm
from .job import Tolerances

MANTLE_GROUP: Final = "Mantle"

_TRAVEL_SHARE: Final = 0.25
"""Of the distance that a tip may be off, what travel may take at most."""


@dataclass(frozen=True, eq=False)
class Body:
    """What moves."""

    channels: RigChannels
    scale: float
    """Metres of the armature's unit."""
    skeleton: Skeleton
    arms: Sequence[Arm]
    mantle: Sequence[str]
    """Bones."""
    travel_bone: str
    """"" where the object travels."""

    def modes(self, bones: Sequence[str]) -> list[str]:
        """Rotation modes of bones."""
        return [self.channels.modes[name] for name in bones]


@dataclass(frozen=True, eq=False)
class Motion:
    """All channels of one shot, by what an animator moves as one."""

    travel: Sequence[Channel]
    """A location and a rotation, of the object or of a bone; none in place."""
    arms: Sequence[Channel]
    """Rotations of the arms' bones, one arm after the other."""
    mantle: Sequence[Channel]
    stretch: Sequence[Channel] = ()
    """Scales of the arms' bones that stretch."""
    lying: Sequence[np.ndarray] = ()
    """For each arm (moments, joints) which rest on the ground, none where nothing does."""

    def all(self) -> list[Channel]:
        """Every channel, as one key per frame."""
        return [*self.travel, *self.arms, *self.mantle, *self.stretch]


def reduced(
    frames: Floats,
    body: Body,
    motion: Motion,
    tolerances: Tolerances,
    *,
    every: int = 1,
    dense: bool = False,
    loops: bool = False,
) -> Generator[float, None, list[Channel]]:
    """The channels with few keys, grouped by arm, in steps that yield the share that is done.

    Args:
        frames: (moments,) at which the channels have their values.
        body: its arms and mantle are those of the channels, in their order.
        motion: the channels.
        tolerances: how far they may be off.
        every: at every how many of these moments there is a frame, from the first to the last.
        dense: whether there is a key on every frame all the same.
        loops: whether the motion goes on from its last frame to its first.

    Raises:
        SettingsError: without tolerance, no key can be left out.
    """
    parts: list[Sequence[Channel]] = []
    limbs: list[Limb] = []
    found: list[list[BezierKeys]] = []
    distance: float | Floats = tolerances.distance
    carried: float | Floats = 0.0
    if motion.travel:
        travel, unit = _travel(body, motion, tolerances)
        found += reduce_keys(frames, [travel], every=every, all_of_them=dense, loops=loops)
        parts.append(motion.travel)
        # What it does not take is left to the arms, frame by frame.
        played = [values_at(keys, frames) for keys in found[0]]
        carried = Residuals(travel).measure(played)[1] * travel.distance / unit
        distance = distance - carried
    rest = iter(motion.arms)
    for number, arm in enumerate(body.arms):
        turned = [next(rest) for _ in arm.bones]
        stretched = [each for each in motion.stretch if each.group in arm.bones]
        parts.append([replace(each, group=arm.name) for each in (*turned, *stretched)])
        lying = motion.lying[number] if motion.lying else None
        left = replace(tolerances, distance=distance, held=tolerances.held - carried)
        limbs.append(_limb(body, arm, turned, stretched, left, lying=lying))
    if body.mantle:
        parts.append([replace(each, group=MANTLE_GROUP) for each in motion.mantle])
        tracks = _tracks(motion.mantle, body.modes(body.mantle))
        columns = range(len(tracks)) if tolerances.by_bone else None
        limbs.append(Limb(tracks, tolerances.angle, tolerances.distance, columns=columns))
    found += yield from reducing(frames, limbs, every=every, all_of_them=dense, loops=loops)
    return [
        replace(channel, values=channel.values[::every], keys=keys)
        for part, each in zip(parts, found, strict=True)
        for channel, keys in zip(part, each, strict=True)
    ]


def _limb(
    body: Body,
    arm: Arm,
    turned: Sequence[Channel],
    stretched: Sequence[Channel],
    tolerances: Tolerances,
    *,
    lying: np.ndarray | None,
) -> Limb:
    """What belongs together of one arm, and how far that may be off."""
    tracks = _tracks(turned, body.modes(arm.bones))
    tracks += [Track(each.values, SCALE) for each in stretched]
    chain = _chain(body, arm, [each.group for each in stretched])
    return Limb(
        tracks=tracks,
        angle=tolerances.angle,
        distance=tolerances.distance,
        chain=chain,
        columns=range(len(tracks)) if tolerances.by_bone else None,
        room=None if lying is None else _room(chain, lying, tolerances.held),
    )


def _chain(body: Body, arm: Arm, stretched: Sequence[str]) -> LimbChain:
    """An arm's chain, of which some bones stretch: their tracks come after those of all turns."""
    chain = chain_to_tip(body.skeleton, arm.bones)
    if not stretched:
        return chain
    tracks = {name: len(arm.bones) + place for place, name in enumerate(stretched)}
    return replace(
        chain,
        scaled=tuple(tracks.get(name, -1) for name in arm.bones),
        handed=tuple(body.channels.handed(arm.bones)),
    )


def _room(chain: LimbChain, lying: np.ndarray, held: float | Floats) -> Floats:
    """How far the ends of the bones of an arm may be off (moments, bones), as its joints rest."""
    (turned,) = np.nonzero(np.array(chain.turned) >= 0)
    result = np.full((len(lying), len(chain.turned)), np.inf)
    # What rides along between two bones of the arm belongs to the first of them.
    ends = [*(turned[1:] - 1), len(chain.turned) - 1]
    result[:, ends] = np.where(lying[:, 1:], np.reshape(held, (-1, 1)), np.inf)
    return result


def _length(skeleton: Skeleton, arm: Arm) -> float:
    return float(np.linalg.norm(chain_to_tip(skeleton, arm.bones).steps, axis=1).sum())


def _tracks(channels: Sequence[Channel], kinds: Sequence[str]) -> list[Track]:
    return [Track(channel.values, kind) for channel, kind in zip(channels, kinds, strict=True)]


def _travel(body: Body, motion: Motion, tolerances: Tolerances) -> tuple[Limb, float]:
    """The body's travel, whose turns carry the tips of the arms; the armature's unit in its own."""
    if body.travel_bone:
        (mode,) = body.modes([body.travel_bone])
        pivot = body.skeleton.heads[body.skeleton.index[body.travel_bone]]
        unit = 1.0
    else:
        assert body.channels.own is not None
        mode = body.channels.own.rotation_mode
        pivot = np.zeros(3)
        # The armature's unit, as the object's location has it.
        unit = body.scale / body.channels.own.unit
    held = tolerances.held if motion.lying else np.inf
    limb = Limb(
        tracks=_tracks(motion.travel, [LOCATION, mode]),
        angle=tolerances.angle,
        distance=_TRAVEL_SHARE * min(tolerances.distance, held) * unit,
        lever=max(_reach(body.skeleton, arm, pivot) for arm in body.arms) * unit,
    )
    return limb, unit


def _reach(skeleton: Skeleton, arm: Arm, pivot: Floats) -> float:
    """How far from a point an arm can reach."""
    root = skeleton.heads[skeleton.index[arm.bones[0]]]
    return float(np.linalg.norm(root - pivot)) + _length(skeleton, arm)
