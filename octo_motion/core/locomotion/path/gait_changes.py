# SPDX-License-Identifier: GPL-3.0-or-later
"""From one way of moving to another along the route: walk, crawl and swim.

Body and arms do not change together. The body goes over from one way to the other along a stretch
of the route. An arm goes over while it holds on to nothing: from when it lets go of its last
foothold of the one way until it takes its first of the other. So nothing slips, and a body that
swims away is still pushed off by the arms that let go last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...errors import SettingsError
from ...rotations import Floats, conjugate, continuous, from_rotation_vector, multiply
from ...smoothing import least_jerk

_HELD: Final = 0.3
"""Share of a change, from either end, in which arms may still hold on, or hold on again: in between
the body turns too far for an arm to follow."""


@dataclass(frozen=True)
class GaitTransition:
    """Where one way of moving becomes another. Metres along the route."""

    start: float
    end: float
    way: int
    """Number of the way from here on; 0 is the one that the route begins with."""

    @property
    def middle(self) -> float:
        """Halfway."""
        return 0.5 * (self.start + self.end)


@dataclass(frozen=True, eq=False)
class Windows:
    """When each arm goes over at one change, and the footholds that it does without."""

    start: Floats
    """(arms,) metres along the route."""
    end: Floats
    """(arms,)"""
    dropped_before: tuple[NDArray[np.bool_], ...]
    """For each arm, which stances of the way before are left out."""
    dropped_after: tuple[NDArray[np.bool_], ...]
    """For each arm, which stances of the way after."""


def check_transitions(
    changes: Sequence[GaitTransition], length: float
) -> tuple[GaitTransition, ...]:
    """The changes in the order of the route.

    Raises:
        SettingsError: one is not on the route, or two overlap.
    """
    ordered = tuple(sorted(changes, key=lambda each: each.middle))
    for each in ordered:
        if not (np.isfinite(each.start) and np.isfinite(each.end) and each.end > each.start):
            raise SettingsError("A change of gait has no length.", "Give it one above 0.")
        if each.middle < 0.0 or each.middle > length:
            raise SettingsError(
                "A change of gait is not on the route.", "Give it a place from 0 to 1."
            )
    for before, after in pairwise(ordered):
        if after.start < before.end - 1e-9:
            raise SettingsError(
                "Two changes of gait overlap.", "Move them apart, or make them shorter."
            )
    return ordered


def transitions_by_height(
    distance: Floats, height: Floats, *, take_off: float, length: float
) -> tuple[GaitTransition, ...]:
    """Way 1 wherever the route is higher over the ground than so much, way 0 elsewhere.

    All is in metres: distances (samples,) along the route, ascending, heights (samples,) there, and
    the length of each change. Shorter stretches of either way are left out.
    """
    above = height > take_off
    borders = np.flatnonzero(above[1:] != above[:-1])
    found: list[GaitTransition] = [GaitTransition(-length, 0.0, 1)] if above[0] else []
    for border in borders:
        rise = height[border + 1] - height[border]
        share = (take_off - height[border]) / rise
        middle = distance[border] + share * (distance[border + 1] - distance[border])
        way = int(above[border + 1])
        if found and middle - found[-1].middle < 1.5 * length:
            # There and back within one change: neither is worth its while.
            found.pop()
            continue
        found.append(
            GaitTransition(float(middle - 0.5 * length), float(middle + 0.5 * length), way)
        )
    return tuple(found)


def way_weights(changes: Sequence[GaitTransition], ways: int, distance: Floats) -> Floats:
    """How far the body goes each way (…, ways) at distances (…,); they sum to 1."""
    weights = np.zeros((*distance.shape, ways))
    weights[..., 0] = 1.0
    for change in changes:
        over = least_jerk((distance - change.start) / (change.end - change.start))
        weights *= (1.0 - over)[..., None]
        weights[..., change.way] += over
    return weights


def transition_windows(
    change: GaitTransition,
    before: Sequence[tuple[Floats, Floats]],
    after: Sequence[tuple[Floats, Floats]],
) -> Windows:
    """When each arm goes over from one way to the other, by where its stances (stances,) begin and
    end in the way before and in the way after.
    """
    held = _HELD * (change.end - change.start)
    starts, ends = np.empty(len(before)), np.empty(len(before))
    first_drops, last_drops = [], []
    for arm, ((on, off), (next_on, next_off)) in enumerate(zip(before, after, strict=True)):
        dropped = (0.5 * (on + off) > change.middle) | (off > change.start + held)
        kept = off[~dropped]
        start = max(change.start, float(kept.max()) if len(kept) else change.start)
        late = (0.5 * (next_on + next_off) < change.middle) | (next_on < change.end - held)
        coming = next_on[~late]
        end = min(change.end, float(coming.min()) if len(coming) else change.end)
        starts[arm], ends[arm] = start, end
        first_drops.append(dropped)
        last_drops.append(late)
    return Windows(starts, ends, tuple(first_drops), tuple(last_drops))


def slowing(way: Floats, within: float) -> Floats:
    """A way (…,) from 0 on that comes to a stop: at full speed at 0, still from ``within`` on."""
    inside = np.clip(way, 0.0, within)
    return inside - 0.5 * inside * inside / within


def blend_motions(first: Floats, second: Floats, share: Floats) -> Floats:
    """Motions (frames, …, 4) a share (frames, …) of the way from one to the other.

    Half way each bone turns the shortest way, and before and after the same way round, however
    far apart the two motions come: no bone turns now this way and now that.
    """
    turn = continuous(multiply(conjugate(first), second))
    nearest = np.argmin(np.abs(share - 0.5), axis=0)
    middle = np.take_along_axis(turn[..., 0], nearest[None], axis=0)
    turn = np.where((middle < 0.0)[..., None], -turn, turn)
    sine = np.linalg.norm(turn[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, turn[..., :1])
    # Beyond half a turn the cosine is negative: the angle goes on to a whole one.
    axis = turn[..., 1:] / np.maximum(sine, 1e-12)
    return multiply(first, from_rotation_vector(share[..., None] * angle * axis))
