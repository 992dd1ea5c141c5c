# SPDX-License-Identifier: GPL-3.0-or-later
"""Few keys in place of one per frame: what belongs together, how far it may be off, what plays."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
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
    Track,
    chain_to_tip,
    reducing,
    rotation_property,
    values_at,
)
from ...rotations import Floats, from_mode_values
from ...skeleton import Skeleton
from ...steps import evenly
from ..gait import Arm
from ..metrics import Measured
from ..rig import Poses, carried_by_root_bone, halfway_linear
from .job import Creature, Tolerances

_BONES_AT_ONCE: Final = 16
"""How many are looked at in one step."""
MANTLE_GROUP: Final = "Mantle"

_TRAVEL_SHARE: Final = 0.25
"""Of the distance that a tip may be off, what travel may take at most."""


@dataclass(frozen=True, eq=False)
class Motion:
    """All channels of one shot, by what an animator moves as one."""

    travel: Sequence[Channel]
    """A location and a rotation, of the object or of a bone; none in place."""
    arms: Sequence[Channel]
    """Rotations of the arms' bones, one arm after the other."""
    mantle: Sequence[Channel]
    """Rotations of the body's bones that move by themselves …"""
    widths: Sequence[Channel] = ()
    """… and scales."""
    stretch: Sequence[Channel] = ()
    """Scales of the arms' bones that stretch."""
    lying: Sequence[np.ndarray] = ()
    """For each arm (moments, joints) which rest on the ground, none where nothing does."""


def reduced(
    frames: Floats,
    creature: Creature,
    motion: Motion,
    tolerances: Tolerances,
    *,
    every: int = 1,
    dense: bool = False,
    loops: bool = False,
) -> Generator[float, None, list[Channel]]:
    """The channels with few keys, grouped by arm, in steps that yield the share that is done.

    The creature's arms are those of the channels, in their order, whose values are those of frames
    (moments,); of these ``every`` so many is a frame, from the first to the last. Dense, there is a
    key on every frame all the same; in a loop the motion goes on from its last frame to its first.

    Raises:
        SettingsError: without tolerance, no key can be left out.
    """
    parts: list[Sequence[Channel]] = []
    limbs: list[Limb] = []
    found: list[list[BezierKeys]] = []
    distance: float | Floats = tolerances.distance
    carried: float | Floats = 0.0
    if motion.travel:
        travel, unit = _travel(creature, motion, tolerances)
        keys = reducing(frames, [travel], every=every, all_of_them=dense, loops=loops)
        found += yield from evenly(keys, 0.0)
        parts.append(motion.travel)
        # What it does not take is left to the arms, frame by frame.
        played = [values_at(keys, frames) for keys in found[0]]
        carried = Residuals(travel).measure(played)[1] * travel.distance / unit
        distance = distance - carried
    rest = iter(motion.arms)
    for number, arm in enumerate(creature.arms):
        turned = [next(rest) for _ in arm.bones]
        stretched = [each for each in motion.stretch if each.group in arm.bones]
        parts.append([replace(each, group=arm.name) for each in (*turned, *stretched)])
        lying = motion.lying[number] if motion.lying else None
        left = replace(tolerances, distance=distance, held=tolerances.held - carried)
        limbs.append(_limb(creature, arm, turned, stretched, left, lying=lying))
    if own := [*motion.mantle, *motion.widths]:
        parts.append([replace(each, group=MANTLE_GROUP) for each in own])
        tracks = _tracks(motion.mantle, _modes(creature, [each.group for each in motion.mantle]))
        tracks += [Track(each.values, SCALE) for each in motion.widths]
        columns = range(len(tracks)) if tolerances.by_bone else None
        limbs.append(Limb(tracks, tolerances.angle, tolerances.distance, columns=columns))
    found += yield from reducing(frames, limbs, every=every, all_of_them=dense, loops=loops)
    return [
        replace(channel, values=channel.values[::every], keys=keys)
        for part, each in zip(parts, found, strict=True)
        for channel, keys in zip(part, each, strict=True)
    ]


def _limb(
    creature: Creature,
    arm: Arm,
    turned: Sequence[Channel],
    stretched: Sequence[Channel],
    tolerances: Tolerances,
    *,
    lying: np.ndarray | None,
) -> Limb:
    """What belongs together of one arm, and how far that may be off."""
    tracks = _tracks(turned, _modes(creature, arm.bones))
    tracks += [Track(each.values, SCALE) for each in stretched]
    chain = _chain(creature, arm, [each.group for each in stretched])
    return Limb(
        tracks=tracks,
        angle=tolerances.angle,
        distance=tolerances.distance,
        chain=chain,
        columns=range(len(tracks)) if tolerances.by_bone else None,
        room=None if lying is None else _room(chain, lying, tolerances.held),
    )


def _chain(creature: Creature, arm: Arm, stretched: Sequence[str]) -> LimbChain:
    """An arm's chain, of which some bones stretch: their tracks come after those of all turns."""
    chain = chain_to_tip(creature.skeleton, arm.bones)
    if not stretched:
        return chain
    tracks = {name: len(arm.bones) + place for place, name in enumerate(stretched)}
    return replace(
        chain,
        scaled=tuple(tracks.get(name, -1) for name in arm.bones),
        handed=tuple(creature.channels.handed(arm.bones)),
    )


def _room(chain: LimbChain, lying: np.ndarray, held: float | Floats) -> Floats:
    """How far the ends of the bones of an arm may be off (moments, bones), as its joints rest."""
    (turned,) = np.nonzero(np.array(chain.turned) >= 0)
    result = np.full((len(lying), len(chain.turned)), np.inf)
    # What rides along between two bones of the arm belongs to the first of them.
    ends = [*(turned[1:] - 1), len(chain.turned) - 1]
    result[:, ends] = np.where(lying[:, 1:], np.reshape(held, (-1, 1)), np.inf)
    return result


def _modes(creature: Creature, bones: Sequence[str]) -> list[str]:
    return [creature.channels.modes[name] for name in bones]


def _tracks(channels: Sequence[Channel], kinds: Sequence[str]) -> list[Track]:
    # In memory channels lie curve by curve, and tracks are searched frame by frame.
    values = [np.ascontiguousarray(channel.values) for channel in channels]
    return [Track(own, kind) for own, kind in zip(values, kinds, strict=True)]


def _travel(creature: Creature, motion: Motion, tolerances: Tolerances) -> tuple[Limb, float]:
    """The body's travel, whose turns carry the tips of the arms; the armature's unit in its own."""
    if bone := creature.root_bone:
        (mode,) = _modes(creature, [bone])
        pivot = creature.skeleton.heads[creature.skeleton.index[bone]]
        unit = 1.0
    else:
        assert creature.channels.own is not None
        mode = creature.channels.own.rotation_mode
        pivot = np.zeros(3)
        # The armature's unit, as the object's location has it.
        unit = creature.scale / creature.channels.own.unit
    held = tolerances.held if motion.lying else np.inf
    limb = Limb(
        tracks=_tracks(motion.travel, [LOCATION, mode]),
        angle=tolerances.angle,
        distance=_TRAVEL_SHARE * min(tolerances.distance, held) * unit,
        lever=max(_reach(creature.skeleton, arm, pivot) for arm in creature.arms) * unit,
    )
    return limb, unit


def _reach(skeleton: Skeleton, arm: Arm, pivot: Floats) -> float:
    """How far from a point an arm can reach."""
    root = skeleton.heads[skeleton.index[arm.bones[0]]]
    steps = chain_to_tip(skeleton, arm.bones).steps
    return float(np.linalg.norm(root - pivot)) + float(np.linalg.norm(steps, axis=1).sum())


# --- What few keys play, on frames and half way between them, to be measured ----------------------


def measuring_keyed(
    measured: Measured, creature: Creature, channels: Sequence[Channel], *, travels: bool
) -> Generator[float, None, Measured]:
    """What is measured of a motion, of what its keys play in place of what was computed; in steps.

    Whether arms overlap, and how far they are from their targets, stays as it was computed.
    Channels are all that the motion has, those with few keys and those with one on each frame.
    Where nothing takes it along, it is measured as if something did.
    """
    frames = measured.frames
    halves = 0.5 * (frames[:-1] + frames[1:])
    by_path = {channel.data_path: channel for channel in channels}
    poses = yield from _played_poses(
        *(measured.poses, creature, by_path, frames, frames), travels=travels
    )
    halfway = yield from _played_poses(
        *(halfway_linear(measured.poses), creature, by_path, frames, halves), travels=travels
    )
    return replace(measured, poses=poses, halfway=halfway, turning=None)


def _played_poses(
    computed: Poses,
    creature: Creature,
    channels: Mapping[str, Channel],
    frames: Floats,
    times: Floats,
    *,
    travels: bool,
) -> Generator[float, None, Poses]:
    """What channels play at some times, in steps; what they do not move is as it was computed."""

    def played(path: str) -> Floats | None:
        channel = channels.get(path)
        if channel is None:
            return None
        if channel.keys is not None:
            return values_at(channel.keys, times)
        columns = [np.interp(times, frames, column) for column in channel.values.T]
        return np.stack(columns, axis=-1)

    own, named = creature.channels, [name for arm in creature.bones for name in arm]
    rotations = computed.rotations.copy()
    alongs: dict[str, Floats] = {}
    for place, name in enumerate(named):
        if place % _BONES_AT_ONCE == 0:
            yield 1.0
        turned = played(own.rotation_path(name))
        if turned is not None:
            rotations[:, place] = from_mode_values(turned, own.modes[name])
        scaled = played(own.path(name, "scale"))
        if scaled is not None:
            alongs[name] = scaled[:, 1]
    strains = own.strains(creature.bones, alongs, len(times))
    if not travels:
        return Poses(rotations, strains, computed.locations, computed.orientations)
    if bone := creature.root_bone:
        location, rotation, mode = (
            own.path(bone, "location"),
            own.rotation_path(bone),
            own.modes[bone],
        )
    else:
        assert own.own is not None
        mode = own.own.rotation_mode
        location, rotation = "location", rotation_property(mode)
    moved, turned = played(location), played(rotation)
    if moved is None or turned is None:
        return Poses(rotations, strains, computed.locations, computed.orientations)
    turns = from_mode_values(turned, mode)
    if bone:
        places = carried_by_root_bone(creature.skeleton, bone, creature.world, moved, turns)
    else:
        assert own.own is not None
        places = own.own.places(moved, turns)
    return Poses(rotations, strains, *places)
