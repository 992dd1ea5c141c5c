# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms whose segments have the same proportions: one solution in batch serves them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...rotations import Floats
from .ccd import JointChain
from .joint_groups import group_lengths, split_groups
from .pseudo_targets import BANK


@dataclass(frozen=True, eq=False)
class Build:
    """Arms whose segments have the same proportions, solved together."""

    arms: tuple[int, ...]
    chain: JointChain
    widths: Floats
    """(links,) rest lengths H_g, in arm lengths."""


def builds_of(
    segments: Sequence[Floats], weights: Sequence[float], *, on_ground: bool
) -> tuple[Build, ...]:
    """Arms by how they are built.

    Args:
        segments: for each arm (bones,) the lengths of its segments, any unit.
        weights: of the joints, at even steps from an arm's root to its tip [Octopus, eq. 3.7].
        on_ground: whether they walk.
    """
    shares = [lengths / float(lengths.sum()) for lengths in segments]
    same: dict[tuple[float, ...], list[int]] = {}
    for arm, own in enumerate(shares):
        # Bones' lengths are single precision.
        same.setdefault(tuple(np.round(own, 6).tolist()), []).append(arm)
    builds = []
    for arms in same.values():
        own = shares[arms[0]]
        sizes = split_groups(own)
        sampled = np.interp(np.cumsum(own) - own, np.linspace(0.0, 1.0, len(weights)), weights)
        chain = JointChain(own, sizes, sampled, pairs_as_asked=not on_ground)
        builds.append(Build(tuple(arms), chain, group_lengths(own, sizes)))
    return tuple(builds)


def bone_twists(build: Build, angles: Floats) -> Floats:
    """Radians (segments, frames, arms) by which each bone is twisted against the one before.

    Args:
        build: which arms.
        angles: (frames, arms, links, 3) of these; bank is spread evenly over its group.
    """
    sizes = build.chain.sizes
    shares = np.moveaxis(angles[..., BANK], -1, 0) / np.array(sizes)[:, None, None]
    return np.repeat(shares, sizes, axis=0)
