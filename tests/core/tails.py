# SPDX-License-Identifier: GPL-3.0-or-later
"""Tails for the tests of follow-through, made of numbers alone: a body that moves, and a chain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from octo_motion.core.follow_through import (
    BoneMotion,
    FollowJob,
    FollowSettings,
    Limbs,
)
from octo_motion.core.posing.puppet import Figure, joined
from octo_motion.core.rotations import Floats, from_rotation_vector, multiply, rotate
from tests.core.puppets import chain

Way = Callable[[Floats], tuple[Floats, Floats]]
"""From times (times,) to where a body is (times, 3) and its rotation vector (times, 3)."""

SIDEWAYS = from_rotation_vector(np.array([0.0, 0.0, -0.5 * np.pi]))
"""From a bone along Y to one along X."""


def standing(times: Floats) -> tuple[Floats, Floats]:
    """Nothing moves."""
    return np.zeros((len(times), 3)), np.zeros((len(times), 3))


def wagging(times: Floats) -> tuple[Floats, Floats]:
    """Turns to and fro about Z, once a second."""
    turns = np.zeros((len(times), 3))
    turns[:, 2] = 0.6 * np.sin(2.0 * np.pi * times)
    return np.zeros((len(times), 3)), turns


def stopping(times: Floats) -> tuple[Floats, Floats]:
    """Goes sideways for half a second, and stops."""
    places = np.zeros((len(times), 3))
    share = np.clip(times / 0.5, 0.0, 1.0)
    places[:, 1] = 0.5 * share * share * (3.0 - 2.0 * share)
    return places, np.zeros((len(times), 3))


def tail_motion(way: Way, figure: Figure, rate: float, seconds: float) -> BoneMotion:
    """A body, and a tail that sticks out along X as stiff as a stick."""
    times = np.arange(round(rate * seconds) + 1) / rate
    places, turns = way(times)
    turned = from_rotation_vector(turns)
    count = len(figure)
    positions = np.empty((len(times), count + 1, 3))
    orientations = np.empty((len(times), count + 1, 4))
    positions[:, 0], orientations[:, 0] = places, turned
    reach = np.concatenate([[0.0], np.cumsum(figure.lengths)[:-1]])
    for bone in range(count):
        positions[:, bone + 1] = places + rotate(turned, np.array([reach[bone], 0.0, 0.0]))
        orientations[:, bone + 1] = multiply(turned, SIDEWAYS)
    return BoneMotion(rate, positions, orientations)


def tail_job(
    way: Way = standing,
    settings: FollowSettings | None = None,
    *,
    count: int = 5,
    tails: int = 1,
    rate: float = 24.0,
    seconds: float = 2.0,
    **more: object,
) -> FollowJob:
    """Tails of so many bones, one above the other, on a body that goes its way."""
    figure = joined([chain(count, 0.1, 0.02)] * tails)
    figure = replace(figure, owners=(), heavy=())
    motion = tail_motion(way, chain(count, 0.1, 0.02), rate, seconds)
    bones, parents = list[int](), list[int]()
    for tail in range(tails):
        bones += range(tail * count + 1, (tail + 1) * count + 1)
        parents += [each + tail * count if each >= 0 else -1 for each in range(-1, count - 1)]
    limbs = Limbs(tuple(bones), tuple(parents), (0,) * tails)
    above = [motion.positions[:, 1:] + [0.0, 0.0, 0.1 * tail] for tail in range(tails)]
    motion = BoneMotion(
        rate,
        np.concatenate([motion.positions[:, :1], *above], axis=1),
        np.concatenate([motion.orientations[:, :1], *[motion.orientations[:, 1:]] * tails], axis=1),
    )
    job = FollowJob(limbs, figure, motion, settings or FollowSettings())
    return replace(job, **more)
