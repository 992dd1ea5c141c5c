# SPDX-License-Identifier: GPL-3.0-or-later
"""What limbs move through: wind, air, water.

The drag of a round limb across its length is ½ ρ C 2r l |v|² (Hoerner 1965), v being how fast the
limb moves through the medium; along its length, skin friction alone is left. Over a step the force
grows with the speed, so it is taken as it will be at the step's end,

    f = c v / (1 + h c/m),    c = ½ ρ C 2r l |v|,

which never turns a speed round, however light a limb is. Without wind it takes energy only.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from ..posing.puppet import Figure
from ..rotations import Floats

DENSITIES: Final = {"NONE": 0.0, "AIR": 1.2, "WATER": 1000.0}
"""kg/m³"""

_ACROSS: Final = 1.1
"""Drag coefficient of a cylinder across its axis, …"""
_ALONG: Final = 0.05
"""… and along it."""


class Medium:
    """Forces of what a figure moves through."""

    def __init__(
        self, figure: Figure, density: float, drag: float, wind: Floats, step: float
    ) -> None:
        """For steps of so many seconds.

        The medium has a density, kg/m³, moves by ``wind`` (3,), m/s, itself, and holds back
        ``drag`` times as much as it does a plain round limb.
        """
        self.acts = density * drag > 0.0
        """Whether there is any force."""
        self._wind, self._step = wind, step
        spans = figure.capsules[:, 1] - figure.capsules[:, 0]
        self._axes = (spans / (np.linalg.norm(spans, axis=1)[:, None] + 1e-300))[:, :, None]
        face = density * drag * np.maximum(figure.radii, 0.0) * figure.lengths
        self._across, self._along = _ACROSS * face, _ALONG * face
        self._masses = figure.masses

    def forces(self, velocities: Floats, matrices: Floats) -> Floats:
        """(bodies, 6) N at the centres of mass, and no torques.

        Velocities (bodies, 6) are those of the centres first; orientations are (bodies, 3, 3).
        """
        through = self._wind - velocities[:, :3]
        axes = (matrices @ self._axes)[:, :, 0]
        along = ((through * axes) @ _ONES)[:, None] * axes
        across = through - along
        result = np.zeros((len(through), 6))
        for part, face in ((across, self._across), (along, self._along)):
            holds = face * np.sqrt((part * part) @ _ONES)
            holds /= 1.0 + self._step / self._masses * holds
            result[:, :3] += holds[:, None] * part
        return result


_ONES: Final = np.ones(3)
