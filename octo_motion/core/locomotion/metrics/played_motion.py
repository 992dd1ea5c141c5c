# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion that few keys play, on frames and half way between them, to be measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...keyframes import Channel, RigChannels, rotation_property, values_at
from ...rotations import Floats, from_mode_values
from ...skeleton import Skeleton
from ..rig import Poses, carried_by_root_bone, halfway_linear
from .report import Measured


@dataclass(frozen=True, eq=False)
class KeyedRig:
    """Whose keys they are."""

    channels: RigChannels
    skeleton: Skeleton
    arms: Sequence[Sequence[str]]
    """Bones of each arm, root to tip."""
    travels: bool
    """Whether anything takes it along; in place it is measured as if something did."""
    root_bone: str
    """"" where the object travels."""
    world: Floats
    """(4, 4) of the object, of uniform scale, where a bone travels."""


def measure_keyed(measured: Measured, rig: KeyedRig, channels: Sequence[Channel]) -> Measured:
    """What is measured of a motion, of what its keys play in place of what was computed.

    Whether arms overlap, and how far they are from their targets, stays as it was computed.

    Args:
        measured: the motion as it was computed.
        rig: whose keys they are.
        channels: all that the motion has, those that have few keys and those that have one on
            each frame.
    """
    frames = measured.frames
    halves = 0.5 * (frames[:-1] + frames[1:])
    by_path = {channel.data_path: channel for channel in channels}
    poses = _poses(measured.poses, rig, by_path, frames, frames)
    computed = measured.poses
    halfway = Poses(
        halfway_linear(computed.rotations, turns=True),
        halfway_linear(computed.strains),
        halfway_linear(computed.locations),
        halfway_linear(computed.orientations, turns=True),
    )
    return replace(measured, poses=poses, halfway=_poses(halfway, rig, by_path, frames, halves))


def _poses(
    computed: Poses,
    rig: KeyedRig,
    channels: Mapping[str, Channel],
    frames: Floats,
    times: Floats,
) -> Poses:
    """What channels play at some times; what they do not move is as it was computed."""

    def played(path: str) -> Floats | None:
        channel = channels.get(path)
        if channel is None:
            return None
        if channel.keys is not None:
            return values_at(channel.keys, times)
        columns = [np.interp(times, frames, column) for column in channel.values.T]
        return np.stack(columns, axis=-1)

    own, named = rig.channels, [name for arm in rig.arms for name in arm]
    rotations = computed.rotations.copy()
    alongs: dict[str, Floats] = {}
    for place, name in enumerate(named):
        turned = played(own.rotation_path(name))
        if turned is not None:
            rotations[:, place] = from_mode_values(turned, own.modes[name])
        scaled = played(own.path(name, "scale"))
        if scaled is not None:
            alongs[name] = scaled[:, 1]
    strains = own.strains(rig.arms, alongs, len(times))
    if not rig.travels:
        return Poses(rotations, strains, computed.locations, computed.orientations)
    if rig.root_bone:
        bone = rig.root_bone
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
    if rig.root_bone:
        places = carried_by_root_bone(rig.skeleton, rig.root_bone, rig.world, moved, turns)
    else:
        assert own.own is not None
        places = own.own.places(moved, turns)
    return Poses(rotations, strains, *places)
