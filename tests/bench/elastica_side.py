# SPDX-License-Identifier: GPL-3.0-or-later
"""An arm as a Cosserat rod in water, for ``reaching``: runs in an environment of its own.

The arm lies folded back near its base. A wave of activation runs from base to tip at a constant
speed; where it has passed, the arm wants to be straight and is stiffer (Yekutieli, Sagiv-Zohar,
Aharonov, Engel, Hochner and Flash, "Dynamic model of the octopus arm", Journal of Neurophysiology
94, 2005). All else follows from the equations of motion: inertia, elasticity and the water's drag.

Reads what the arm is as JSON from standard input, and writes where it is to standard output.
"""

from __future__ import annotations

import contextlib
import json
import sys
from importlib.metadata import version
from typing import Any

import elastica as ea  # pyright: ignore[reportMissingImports]
import numpy as np

_YOUNG = 1e4
"""Pascals of a relaxed arm."""
_SHEAR = 4e3
_STIFFENED = 10.0
"""How much stiffer in bending an active arm is."""
_DENSITY = 1042.0
"""Kilograms in a cubic metre, of arms and of the sea about them: nothing sinks."""
_ACROSS, _ALONG = 1.013, 0.0256
"""Drag of a cylinder across and along it (Yekutieli et al., 2005)."""
_LOSS = 2.0
"""Share of the speed that tissue takes away in a second."""
_FOLD = np.radians(150.0)
_FOLDED_AT = (0.1, 0.3)
"""Where along the arm the fold begins and ends."""
_WAVE = 0.15
"""Width of the wave's front, in arm lengths."""
_STEP = 1e-4
"""Seconds."""


def main() -> None:
    """Simulate the arm that was asked for."""
    asked = json.load(sys.stdin)
    radii, length = np.array(asked["radii"]), float(asked["length"])
    arm = _Arm(radii, length, float(asked["seconds"]))
    with contextlib.redirect_stdout(sys.stderr):  # it tells how far it is
        frames = arm.run(int(asked["frames"]))
    json.dump({"version": version("pyelastica"), "points": frames}, sys.stdout)


class _World(  # what a simulation may have
    ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping, ea.CallBacks
):
    pass


class _Wave(ea.NoForces):
    """Straightens and stiffens what it has passed, and lets the water drag."""

    def __init__(self, rod: Any, seconds: float) -> None:
        super().__init__()
        self.seconds = seconds
        self.folded, self.relaxed = rod.rest_kappa.copy(), rod.bend_matrix.copy()
        ends = np.cumsum(rod.rest_lengths)
        self.places = ends[:-1] / ends[-1]

    def apply_forces(self, system: Any, time: float = 0.0) -> None:
        front = _FOLDED_AT[0] + (1.0 + _WAVE - _FOLDED_AT[0]) * time / self.seconds
        share = np.clip((front - self.places) / _WAVE, 0.0, 1.0)
        share = share * share * (3.0 - 2.0 * share)
        system.rest_kappa[:] = self.folded * (1.0 - share)
        system.bend_matrix[:] = self.relaxed * (1.0 + (_STIFFENED - 1.0) * share)
        speeds = 0.5 * (system.velocity_collection[:, 1:] + system.velocity_collection[:, :-1])
        along = np.sum(speeds * system.tangents, axis=0) * system.tangents
        across = speeds - along
        force = _ACROSS * np.linalg.norm(across, axis=0) * across
        force += np.pi * _ALONG * np.linalg.norm(along, axis=0) * along
        force *= -_DENSITY * system.radius * system.lengths
        system.external_forces[:, 1:] += 0.5 * force
        system.external_forces[:, :-1] += 0.5 * force


class _Kept(ea.CallBackBaseClass):
    def __init__(self, step_skip: int, points: list[Any]) -> None:
        super().__init__()
        self.every, self.points = step_skip, points

    def make_callback(self, system: Any, time: float, current_step: int) -> None:  # noqa: ARG002
        if current_step % self.every == 0:
            self.points.append(system.position_collection.T.tolist())


class _Arm:
    def __init__(self, radii: Any, length: float, seconds: float) -> None:
        self.seconds = seconds
        self.world = _World()
        start, along, up = np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
        self.rod = ea.CosseratRod.straight_rod(
            *(len(radii), start, along, up, length, radii, _DENSITY),
            youngs_modulus=_YOUNG,
            shear_modulus=_SHEAR,
        )
        self._fold()
        self.world.append(self.rod)
        self.world.constrain(self.rod).using(
            ea.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,)
        )
        self.world.add_forcing_to(self.rod).using(_Wave, rod=self.rod, seconds=seconds)
        self.world.dampen(self.rod).using(
            ea.AnalyticalLinearDamper, uniform_damping_constant=_LOSS, time_step=_STEP
        )

    def _fold(self) -> None:
        """Lay the arm down as it is before it reaches, at rest."""
        rod = self.rod
        middles = (np.cumsum(rod.rest_lengths) - 0.5 * rod.rest_lengths) / rod.rest_lengths.sum()
        share = np.clip((middles - _FOLDED_AT[0]) / (_FOLDED_AT[1] - _FOLDED_AT[0]), 0.0, 1.0)
        turned = _FOLD * share * share * (3.0 - 2.0 * share)
        tangents = np.stack([np.cos(turned), np.sin(turned), np.zeros_like(turned)])
        up = np.broadcast_to(np.array([[0.0], [0.0], [1.0]]), tangents.shape)
        rod.position_collection[:, 1:] = np.cumsum(rod.rest_lengths * tangents, axis=1)
        across = np.cross(tangents, up, axis=0)
        rod.director_collection[:] = np.stack([up, across, tangents])
        rod.compute_internal_forces_and_torques(0.0)
        rod.rest_kappa[:] = rod.kappa

    def run(self, frames: int) -> list[Any]:
        """Points (frames + 1, points, 3), evenly over a time a quarter longer than the wave's."""
        points: list[Any] = []
        every = round(1.25 * self.seconds / _STEP / frames)
        self.world.collect_diagnostics(self.rod).using(_Kept, step_skip=every, points=points)
        self.world.finalize()
        steps = every * frames
        ea.integrate(ea.PositionVerlet(), self.world, steps * _STEP, steps, progress_bar=False)
        return points


if __name__ == "__main__":
    main()
