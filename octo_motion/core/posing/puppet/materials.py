# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials: coefficients of the elements, from words that an artist understands.

The source leaves open how to choose K_f, D_f and D_d ([Plastic, §6]). Here a material says what can
be seen and felt: how much a joint bears before it yields, how far it springs back, how fast it
settles, how fast it gives way. The joint's *load* makes torques of that: the torque with which all
that hangs on it, stretched out level, would bend it under its own weight. So a finger and a thigh
of one material feel alike, and a figure of any size or weight behaves the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from ...errors import SettingsError
from ...rotations import Floats
from .figure import Elements, Figure
from .material_fit import MeasuredBend

GRAVITY: Final = 9.81
"""m/s², for the loads; whether the simulation has gravity is another matter."""

_LEAST_LOAD: Final = 1e-3
"""Of the largest load in the figure: what a joint with next to nothing on it counts for."""


@dataclass(frozen=True)
class Material:
    """What a joint is made of, whatever its size."""

    bears: float
    """Yield torque against the joint's load; inf never yields."""
    springs: float
    """Radians that a joint is bent by its load, or by its yield torque if that is finite: so far
    it springs back. inf has no spring."""
    settles: float
    """Seconds, D_f/K_f: how long springing back takes. Without a spring, D_f against the load."""
    gives: float
    """rad/s at twice the yield torque: τ/D_d. Without yield, 0 for a rigid series damper."""


MATERIALS: Final[Mapping[str, Material]] = MappingProxyType(
    {
        # Gives way slowly and stays: half a degree comes back.
        "clay": Material(bears=1.25, springs=np.radians(0.5), settles=0.03, gives=1.0),
        # Bends at once and springs back some.
        "wire": Material(bears=1.25, springs=np.radians(8.0), settles=0.05, gives=10.0),
        # Dry friction in a socket: firm, and hardly any spring.
        "doll": Material(bears=2.0, springs=np.radians(0.25), settles=0.03, gives=20.0),
        # Bends by its own weight and always comes back.
        "rubber": Material(bears=np.inf, springs=np.radians(20.0), settles=0.15, gives=0.0),
        # Bears nothing; a little resistance, so that it does not swing for ever.
        "limp": Material(bears=np.inf, springs=np.inf, settles=0.15, gives=0.0),
    }
)


def elements_for(
    figure: Figure,
    material: str | Material,
    strength: float = 1.0,
    own: Mapping[int, Material] | None = None,
) -> Elements:
    """The elements of a figure that is made of one material.

    Args:
        figure: the puppet; its own elements are of no account.
        material: a name in ``MATERIALS``, or one that was measured.
        strength: factor on all torques; with 1 every joint of a material that yields just bears
            what hangs on it.
        own: bodies whose joints are made of another material.

    Raises:
        SettingsError: no such material, or a strength that is not positive.
    """
    if isinstance(material, str):
        if material not in MATERIALS:
            raise SettingsError(
                f"There is no material '{material}'.", f"Choose one of {', '.join(MATERIALS)}."
            )
        material = MATERIALS[material]
    if not (np.isfinite(strength) and strength > 0.0):
        raise SettingsError(
            "The strength of the joints is not positive.", "Set it to 1, for example."
        )
    load = strength * joint_loads(figure)
    made_of = [(own or {}).get(body, material) for body in range(len(figure))]
    # Rows: stiffness, damping, flow, yield torque.
    values = np.array([_values(each, at) for each, at in zip(made_of, load.tolist(), strict=True)])
    stiffness, damping, flow, limit = values.reshape(-1, 4).T
    ones = np.ones((len(figure), 3))
    return Elements(stiffness[:, None] * ones, damping[:, None] * ones, flow[:, None] * ones, limit)


def _values(material: Material, load: float) -> tuple[float, float, float, float]:
    """K_f, D_f, D_d and τ of a joint with a load, N·m."""
    limit = material.bears * load
    bearing = limit if np.isfinite(limit) else load
    stiffness, damping = 0.0, load * material.settles
    if np.isfinite(material.springs):
        stiffness = bearing / material.springs
        damping = stiffness * material.settles
    # A joint that never yields has a series damper that never moves; any size will do.
    flow = bearing / material.gives if material.gives > 0.0 else 1e6 * load
    return stiffness, damping, flow, limit


def material_of(measured: MeasuredBend, load: float) -> Material:
    """The material of which a joint with a load has been measured.

    Args:
        measured: its coefficients.
        load: of the joint, N·m, strength included; see ``joint_loads``.
    """
    yields = bool(np.isfinite(measured.yield_torque))
    bearing = measured.yield_torque if yields else load
    return Material(
        bears=measured.yield_torque / load,
        springs=bearing / measured.stiffness,
        settles=measured.damping / measured.stiffness,
        gives=bearing / measured.flow if yields else 0.0,
    )


def joint_loads(figure: Figure) -> Floats:
    """(bodies,) N·m about each joint, of all that hangs on it, stretched out level."""
    count = len(figure)
    masses = figure.masses.copy()
    moments = figure.masses * np.linalg.norm(figure.centres, axis=1)
    for body in range(count - 1, -1, -1):
        parent = figure.parents[body]
        if parent >= 0:
            arm = float(np.linalg.norm(figure.anchors[body]))
            masses[parent] += masses[body]
            moments[parent] += moments[body] + masses[body] * arm
    loads = GRAVITY * moments
    return np.maximum(loads, _LEAST_LOAD * loads.max(initial=0.0))
