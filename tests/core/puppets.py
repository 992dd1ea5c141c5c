# SPDX-License-Identifier: GPL-3.0-or-later
"""Puppets for the tests of posing, made of numbers alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from octo_motion.core.posing.puppet.figure import Elements, Figure, Pose, pose_of
from octo_motion.core.posing.puppet.joint_limits import bends
from octo_motion.core.posing.solver.holds import Coupling
from octo_motion.core.posing.solver.world import World
from octo_motion.core.rotations import Floats, from_rotation_vector, multiply, normalized, rotate
from tests.core.world_probes import energy_of, joint_turns

DENSITY = 1000.0
HANDS = 2
"""At most so many tear at a figure at a time."""


def capsule_inertia(length: float, radius: float) -> tuple[float, Floats]:
    """Mass and inertia about the middle of a solid capsule along Y, density of water."""
    tube = DENSITY * np.pi * radius**2 * length
    ball = DENSITY * 4.0 / 3.0 * np.pi * radius**3
    across = tube * (length**2 / 12.0 + radius**2 / 4.0) + ball * (
        0.4 * radius**2 + length**2 / 4.0 + 3.0 * length * radius / 8.0
    )
    about = tube * radius**2 / 2.0 + ball * 0.4 * radius**2
    return tube + ball, np.diag([across, about, across])


def soft(count: int, stiffness: float, damping: float, flow: float, limit: float) -> Elements:
    """The same element at every joint."""
    ones = np.ones(count)
    return Elements(stiffness * ones, damping * ones, flow * ones, np.full(count, limit))


def free(count: int) -> Elements:
    """Joints that turn without resistance."""
    return soft(count, 0.0, 0.0, 0.0, np.inf)


def puppet(
    parents: Sequence[int],
    anchors: Sequence[Sequence[float]],
    lengths: Sequence[float],
    radii: Sequence[float],
    elements: Elements | None = None,
    *,
    rest: Floats | None = None,
    limits: Floats | None = None,
) -> Figure:
    """Capsules along Y from each joint."""
    count = len(parents)
    bodies = [
        capsule_inertia(length, radius) for length, radius in zip(lengths, radii, strict=True)
    ]
    size = np.array(lengths, dtype=np.float64)
    ends = np.zeros((count, 2, 3))
    ends[:, 1, 1] = size
    unturned = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    return Figure(
        names=tuple(f"bone {number}" for number in range(count)),
        parents=tuple(parents),
        anchors=np.array(anchors, dtype=np.float64),
        rest=unturned if rest is None else rest,
        lengths=size,
        masses=np.array([mass for mass, _ in bodies]),
        centres=ends.mean(axis=1),
        inertias=np.array([inertia for _, inertia in bodies]),
        capsules=ends,
        radii=np.array(radii, dtype=np.float64),
        limits=np.tile([-np.pi, np.pi], (count, 3, 1)) if limits is None else limits,
        elements=elements or free(count),
    )


def chain(count: int, length: float = 0.2, radius: float = 0.03, **more: Elements) -> Figure:
    """Bones one after another."""
    anchors = [[0.0, 0.0, 0.0]] + [[0.0, length, 0.0]] * (count - 1)
    return puppet(
        range(-1, count - 1), anchors, [length] * count, [radius] * count, more.get("elements")
    )


def doll(elements: Elements | None = None) -> Figure:
    """Twenty bones with the proportions of a person of 1.7 m."""
    parents = [-1, 0, 1, 2, 3, 2, 5, 6, 7, 2, 9, 10, 11, 0, 13, 14, 15, 0, 17, 18]
    lengths = [0.12, 0.16, 0.2, 0.1, 0.2] + [0.15, 0.3, 0.25, 0.16] * 2 + [0.42, 0.42, 0.16, 0.07]
    lengths += [0.42, 0.42, 0.16]
    radii = [0.1, 0.09, 0.1, 0.05, 0.08] + [0.05, 0.045, 0.035, 0.03] * 2
    radii += [0.07, 0.05, 0.035, 0.03, 0.07, 0.05, 0.035]
    turns = np.zeros((20, 3))
    anchors = [[0.0, lengths[parent] if parent >= 0 else 0.0, 0.0] for parent in parents]
    for side, first in ((1.0, 5), (-1.0, 9)):
        anchors[first] = [0.05 * side, 0.16, 0.0]
        turns[first, 2] = -0.5 * np.pi * side
    for side, first in ((1.0, 13), (-1.0, 17)):
        anchors[first] = [0.09 * side, 0.0, 0.0]
        turns[first, 0] = np.pi
        turns[first + 2, 0] = -0.5 * np.pi
    return puppet(parents, anchors, lengths, radii, elements, rest=from_rotation_vector(turns))


def octopus(elements: Elements | None = None, joints: int = 12) -> Figure:
    """A mantle and eight arms that taper slightly: 97 bones."""
    parents, anchors, lengths, radii = [-1], [[0.0, 0.0, 0.0]], [0.3], [0.15]
    turns = [np.zeros(3)]
    for arm in range(8):
        angle = np.pi / 8 + arm * np.pi / 4
        for joint in range(joints):
            parents.append(len(parents) - 1 if joint else 0)
            width = 0.08 * (1.0 - 0.03 * joint)
            anchors.append(
                [0.0, lengths[-1], 0.0]
                if joint
                else [0.15 * np.sin(angle), 0.15 * np.cos(angle), 0.0]
            )
            lengths.append(width)
            radii.append(0.5 * width)
            turns.append(np.array([0.0, 0.0, -angle]) if not joint else np.zeros(3))
    return puppet(
        parents, anchors, lengths, radii, elements, rest=from_rotation_vector(np.array(turns))
    )


def tree(rng: np.random.Generator, count: int, elements: Elements | None = None) -> Figure:
    """A random tree of random capsules."""
    parents = [-1] + [int(rng.integers(0, body)) for body in range(1, count)]
    lengths = rng.uniform(0.1, 0.4, count)
    radii = rng.uniform(0.2, 0.4, count) * lengths
    anchors = [[0.0, 0.0, 0.0]]
    aside = 0.3 * radii[0] * rng.normal(size=count)
    anchors += [[aside[body], lengths[parents[body]], 0.0] for body in range(1, count)]
    rest = normalized(rng.normal(size=(count, 4)))
    return puppet(parents, anchors, lengths.tolist(), radii.tolist(), elements, rest=rest)


def posed(
    figure: Figure, turns: Floats | None = None, at: Sequence[float] = (0.0, 0.0, 0.0)
) -> Pose:
    """The figure with its joints turned from rest by rotation vectors in the parents' frames."""
    own = figure.rest
    if turns is not None:
        own = multiply(from_rotation_vector(turns), own)
    return pose_of(figure, own, np.tile(np.array(at, dtype=np.float64), (len(figure), 1)))


def opening(figure: Figure, pose: Pose) -> float:
    """Greatest gap of a joint, against the length of its bone."""
    parents = np.array(figure.parents)
    hanging = parents >= 0
    above = parents[hanging]
    if not len(above):
        return 0.0
    arms = rotate(pose.orientations[above], figure.anchors[hanging])
    gaps = pose.positions[above] + arms - pose.positions[hanging]
    return float((np.linalg.norm(gaps, axis=1) / figure.lengths[hanging]).max())


@dataclass
class Torn:
    """What came of tearing at a figure."""

    steps: int = 0
    widest: float = 0.0
    """Opening of a joint, against its bone's length."""
    fastest: float = 0.0
    """m/s"""
    broken: int = 0
    """Steps after which some number was not finite."""
    unsettled: int = 0
    """Steps for which the solver took the best answer so far."""
    energy: float = 0.0
    """Joules, the most that the figure held."""
    alone: int = 0
    """Steps in which no hand held it."""
    gain: float = 0.0
    """Joules, the most that the energy grew by in one of these."""
    overrun: float = 0.0
    """Radians by which a joint was beyond the end of its range."""


def torn(
    world: World, rng: np.random.Generator, steps: int, hand: Coupling | None = None
) -> Iterator[Torn]:
    """Random grabs, pulls and pins; what came of them so far, after each step.

    ``hand`` is how firmly they hold; without, ten times as firmly as a session's.
    """
    figure = world.figure
    found = Torn()
    unrest = figure.rest * [1.0, -1.0, -1.0, -1.0]
    limited = np.array(figure.parents) >= 0
    least, most = np.moveaxis(figure.limits, -1, 0)
    energy = energy_of(world).total
    for _ in range(steps):
        if len(world.grabs) < HANDS and rng.random() < 0.03:
            body = int(rng.integers(len(figure)))
            at = world.pose().positions[body]
            turned = np.array([1.0, 0.0, 0.0, 0.0]) if rng.random() < 0.5 else None
            world.grab(body, at, turned, hand)
        if world.grabs and rng.random() < 0.03:
            world.release(world.grabs[int(rng.integers(len(world.grabs)))])
        for grab in world.grabs:
            turn = None if grab.target_orientation is None else rng.normal(size=4)
            grab.pull(grab.target_position + 0.05 * rng.normal(size=3), turn)
        if rng.random() < 0.01:
            body = int(rng.integers(len(figure)))
            (world.unpin if body in world.pins else world.pin)(body)
        if len(world.pins) > 2:
            world.unpin(min(world.pins))
        world.step()
        pose, velocities = world.pose(), world.velocities()
        before, energy = energy, energy_of(world).total
        assert world.last is not None
        bent = bends(multiply(unrest, joint_turns(world)))
        over = np.maximum(least - bent, bent - most)[limited]
        found.steps += 1
        found.widest = max(found.widest, opening(figure, pose))
        found.fastest = max(found.fastest, float(np.abs(velocities[:, :3]).max()))
        found.broken += not (np.isfinite(pose.positions).all() and np.isfinite(velocities).all())
        found.unsettled += world.last.miss > world.settings.tolerance
        found.overrun = max(found.overrun, float(over.max(initial=0.0)))
        found.energy = max(found.energy, energy)
        if not world.grabs:
            found.alone += 1
            found.gain = max(found.gain, energy - before)
        yield found
