# SPDX-License-Identifier: GPL-3.0-or-later
"""Two plots of the plastic puppet: the source's experiment, and the energy of an arm let go."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import plot
from stage import Pixels

from octo_motion.core.posing.puppet.figure import Elements, Figure, Pose
from octo_motion.core.posing.puppet.materials import elements_for
from octo_motion.core.posing.solver.world import World, WorldSettings
from tests.core.world_probes import energy_of
from tests.papers.plastic import D_D, FORCE, LOADED, STEP, stepped

_BONES: Final = 6
_LENGTH: Final = 0.15
_RADIUS: Final = 0.03
_LET_GO: Final = 0.8
"""Seconds until the hand opens."""


def pixels(size: tuple[int, int]) -> Pixels:
    """Both, side by side."""
    return plot.curves_pixels([_experiment(), _energy()], size)


def _experiment() -> plot.Panel:
    """[Plastic, Fig. 5]: 0.1 kg on the three elements, pushed for a while; the force and how long,
    1 N for five seconds, are ours.
    """
    times, moved, _, springs = stepped(STEP, 30.0)
    residue = FORCE * LOADED / D_D
    return plot.Panel(
        "1 N for 5 s, then none",
        "s",
        "m",
        times,
        {"moved": moved, "spring": springs, "residue F·T/D": np.full(len(times), residue)},
    )


def _energy() -> plot.Panel:
    """An arm of wire, bent by a hand and let go: nothing of it grows by itself."""
    figure = _arm()
    pose = Pose(
        np.stack([np.zeros(_BONES), _LENGTH * np.arange(float(_BONES)), np.zeros(_BONES)], axis=1),
        np.tile([1.0, 0.0, 0.0, 0.0], (_BONES, 1)),
    )
    world = World(figure, pose, WorldSettings())
    world.pin(0)
    tip = np.array([0.0, _BONES * _LENGTH, 0.0])
    grab = world.grab(_BONES - 1, tip)
    rows: list[tuple[float, float, float]] = []
    for number in range(2000):
        if number * world.settings.step < _LET_GO:
            share = number * world.settings.step / _LET_GO
            grab.pull(tip + share * np.array([0.0, -0.35, 0.45]))
        else:
            world.release(grab)
        world.step()
        energy = energy_of(world)
        rows.append((energy.kinetic, energy.elastic, energy.kinetic + energy.elastic))
    kinetic, elastic, total = 1000.0 * np.array(rows).T
    return plot.Panel(
        "an arm, let go after 0.8 s",
        "s",
        "mJ",
        world.settings.step * np.arange(1.0, 2001.0),
        {"kinetic": kinetic, "springs": elastic, "both": total},
    )


def _arm() -> Figure:
    ends = np.zeros((_BONES, 2, 3))
    ends[:, 1, 1] = _LENGTH
    anchors = np.tile([0.0, _LENGTH, 0.0], (_BONES, 1))
    anchors[0] = 0.0
    mass = 1000.0 * np.pi * _RADIUS**2 * _LENGTH
    across = mass * (_LENGTH**2 / 12.0 + _RADIUS**2 / 4.0)
    zeros = np.zeros((_BONES, 3))
    figure = Figure(
        names=tuple(f"bone {number}" for number in range(_BONES)),
        parents=tuple(range(-1, _BONES - 1)),
        anchors=anchors,
        rest=np.tile([1.0, 0.0, 0.0, 0.0], (_BONES, 1)),
        lengths=np.full(_BONES, _LENGTH),
        masses=np.full(_BONES, mass),
        centres=ends.mean(axis=1),
        inertias=np.tile(np.diag([across, 0.5 * mass * _RADIUS**2, across]), (_BONES, 1, 1)),
        capsules=ends,
        radii=np.full(_BONES, _RADIUS),
        limits=np.tile([-np.pi, np.pi], (_BONES, 3, 1)),
        elements=Elements(zeros, zeros, zeros, np.zeros(_BONES)),
    )
    return replace(figure, elements=elements_for(figure, "wire"))
