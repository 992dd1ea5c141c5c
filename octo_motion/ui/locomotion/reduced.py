# SPDX-License-Identifier: GPL-3.0-or-later
"""Few keys in place of one per frame: what belongs together, and how far it may be off."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import bpy
import numpy as np

from ...blender import actions
from ...core.keys import LOCATION, Limb, Track, chain_to_tip, reducing
from ...core.locomotion.generator import Arm
from ...core.rotations import Floats
from ...core.skeleton import Skeleton

MANTLE_GROUP: Final = "Mantle"

_TRAVEL_SHARE: Final = 0.25
"""Of the distance that a tip may be off, what travel may take; the rest is the arm's own."""

_STRETCH_SHARE: Final = 0.25
"""Of the same distance, what the length of stretching bones may take."""


@dataclass(frozen=True, eq=False)
class Tolerances:
    """How far the motion may be off at any frame."""

    angle: float
    """Radians, of each bone against its parent."""
    distance: float
    """Of each arm's tip, in the armature's units."""


@dataclass(frozen=True, eq=False)
class Body:
    """What moves."""

    armature: bpy.types.Object
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
        assert self.armature.pose is not None
        return [self.armature.pose.bones[name].rotation_mode for name in bones]


@dataclass(frozen=True, eq=False)
class Motion:
    """All channels of one shot, by what an animator moves as one."""

    travel: Sequence[actions.Channel]
    """A location and a rotation, of the object or of a bone; none in place."""
    arms: Sequence[actions.Channel]
    """Rotations of the arms' bones, one arm after the other."""
    mantle: Sequence[actions.Channel]
    stretch: Sequence[actions.Channel] = ()
    """Scales of the arms' bones that stretch."""

    def all(self) -> list[actions.Channel]:
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
) -> Generator[float, None, list[actions.Channel]]:
    """The channels with few keys, grouped by arm, in steps that yield the share that is done.

    Args:
        frames: (moments,) at which the channels have their values.
        body: its arms and mantle are those of the channels, in their order.
        motion: the channels.
        tolerances: how far they may be off.
        every: at every how many of these moments there is a frame, from the first to the last.
        dense: whether there is a key on every frame all the same.

    Raises:
        SettingsError: without tolerance, no key can be left out.
    """
    parts: list[Sequence[actions.Channel]] = []
    limbs: list[Limb] = []
    if motion.travel:
        parts.append(motion.travel)
        limbs.append(_travel(body, motion, tolerances))
    rest = iter(motion.arms)
    for arm in body.arms:
        part = [replace(next(rest), group=arm.name) for _ in arm.bones]
        parts.append(part)
        limbs.append(
            Limb(
                tracks=_tracks(part, body.modes(arm.bones)),
                angle=tolerances.angle,
                distance=(1.0 - _TRAVEL_SHARE - _STRETCH_SHARE * bool(motion.stretch))
                * tolerances.distance,
                chain=chain_to_tip(body.skeleton, arm.bones),
            )
        )
    if body.mantle:
        part = [replace(each, group=MANTLE_GROUP) for each in motion.mantle]
        parts.append(part)
        tracks = _tracks(part, body.modes(body.mantle))
        limbs.append(Limb(tracks, tolerances.angle, tolerances.distance))
    for arm, part in _by_arm(body.arms, motion.stretch):
        # A share of a bone's length: of all of them together, that share of the arm's.
        bound = _STRETCH_SHARE * tolerances.distance / _length(body.skeleton, arm)
        parts.append([replace(each, group=arm.name) for each in part])
        limbs.append(Limb([Track(each.values, LOCATION) for each in part], np.pi, bound))
    found = yield from reducing(frames, limbs, every=every, all_of_them=dense)
    return [
        replace(channel, values=channel.values[::every], keys=keys)
        for part, each in zip(parts, found, strict=True)
        for channel, keys in zip(part, each, strict=True)
    ]


def _by_arm(
    arms: Sequence[Arm], channels: Sequence[actions.Channel]
) -> list[tuple[Arm, list[actions.Channel]]]:
    """Channels of bones, by the arm that the bones belong to."""
    owners = {bone: arm.name for arm in arms for bone in arm.bones}
    found: dict[str, list[actions.Channel]] = {arm.name: [] for arm in arms}
    for channel in channels:
        found[owners[channel.group]].append(channel)
    return [(arm, found[arm.name]) for arm in arms if found[arm.name]]


def _length(skeleton: Skeleton, arm: Arm) -> float:
    return float(np.linalg.norm(chain_to_tip(skeleton, arm.bones).steps, axis=1).sum())


def _tracks(channels: Sequence[actions.Channel], kinds: Sequence[str]) -> list[Track]:
    return [Track(channel.values, kind) for channel, kind in zip(channels, kinds, strict=True)]


def _travel(body: Body, motion: Motion, tolerances: Tolerances) -> Limb:
    """The body's travel, whose turns carry the tips of the arms."""
    if body.travel_bone:
        (mode,) = body.modes([body.travel_bone])
        pivot = body.skeleton.heads[body.skeleton.index[body.travel_bone]]
        unit = 1.0
    else:
        mode = body.armature.rotation_mode
        pivot = np.zeros(3)
        # The armature's unit, as the object's location has it.
        unit = body.scale / actions.channel_unit(body.armature)
    return Limb(
        tracks=_tracks(motion.travel, [LOCATION, mode]),
        angle=tolerances.angle,
        distance=_TRAVEL_SHARE * tolerances.distance * unit,
        lever=max(_reach(body.skeleton, arm, pivot) for arm in body.arms) * unit,
    )


def _reach(skeleton: Skeleton, arm: Arm, pivot: Floats) -> float:
    """How far from a point an arm can reach."""
    root = skeleton.heads[skeleton.index[arm.bones[0]]]
    return float(np.linalg.norm(root - pivot)) + _length(skeleton, arm)
