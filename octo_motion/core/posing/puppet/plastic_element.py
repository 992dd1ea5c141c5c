# SPDX-License-Identifier: GPL-3.0-or-later
"""The plastic element: a spring beside a damper, and a second damper in series that gives way.

[Plastic, eq. 16–26] puts a Voigt part (K_f beside D_f, displacement q_f) in series with a damper
D_d. Ours has a threshold as well: the series damper moves only where the load λ exceeds the yield
torque τ (a Bingham element),

    λ = −K_f q_f − D_f w_f,    w = w_f + w_d,    D_d w_d = −(|λ| − τ)₊ λ/|λ|.

With τ = 0 this is the source's element. Over a backward step h, with G = K_f h + D_f and the load
that the element would bear if it did not flow, λ_e = −K_f q_f[t] − G w[t+1],

    |λ_e| ≤ τ:   λ = λ_e,                                      w_d = 0
    otherwise:   λ = (D_d λ_e + G τ s) / (D_d + G),            w_d = −s (|λ_e| − τ) / (D_d + G),

with s = λ_e/|λ_e|, and q_f[t+1] = q_f[t] + h (w − w_d). At τ = 0 that is eq. 25 with
C = (D_d + G)/(D_d G) and D = K_f/G, and eq. 21 for q_f. λ falls as w grows and λ·w_d ≤ 0 whatever
the step: the element stores or loses energy and never makes any. It is alike about all axes, so
these may be any, and all functions work on arrays (joints, 3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...rotations import Floats
from .figure import Elements, Flags, Integers

_TINY = 1e-300
_ONES = np.ones(3)
_UNIT = np.eye(3)


@dataclass(frozen=True, eq=False)
class ElementResponse:
    """How the elements answer a relative angular velocity w over one step."""

    law: PlasticLaw
    load: Floats
    """(joints, 3) λ, the torque on the child, N·m."""
    trial: Floats
    """(joints, 3) λ_e, what it would be without flow."""
    size: Floats
    """(joints,) |λ_e|; of no account where nothing flows."""
    flows: Flags | None
    """(joints,) where the series damper moves; None where all hold: the load is linear in w."""

    @property
    def slope(self) -> Floats:
        """(joints, 3, 3) −∂λ/∂w, symmetric and positive semidefinite, N·m·s/rad."""
        law = self.law
        if self.flows is None:
            return law.diagonal
        # Along s only what the flow leaves, across it also the turning of s.
        which = self.flows.nonzero()[0]
        size = self.size.take(which) + _TINY
        toward = self.trial.take(which, 0) / size[:, None]
        gain = law.backward.take(which)
        ratio = gain * law.shared_yield.take(which) / size
        across = gain * law.kept.take(which) + ratio
        blocks = across[:, None, None] * _UNIT
        blocks -= (ratio[:, None] * toward)[:, :, None] * toward[:, None, :]
        slope = law.diagonal.copy()
        slope[which] = blocks
        return slope

    def flow_of(self, which: Integers) -> Floats:
        """(which, 3) w_d, rad/s, of those elements, of which each flows."""
        law = self.law
        size = self.size.take(which)
        excess = (size - law.yield_torque.take(which)) / (size + _TINY)
        toward = self.trial.take(which, 0) * excess[:, None]
        return -toward * law.compliance.take(which)[:, None]


class PlasticLaw:
    """The elements of a figure for one step length, with what hangs on both alone worked out."""

    def __init__(self, elements: Elements, step: float) -> None:
        self.step = step
        self.stiffness = np.array(elements.stiffness, dtype=np.float64)
        self.backward = self.stiffness * step + elements.damping
        """G = K_f h + D_f."""
        whole = np.asarray(elements.flow, dtype=np.float64) + self.backward
        with np.errstate(divide="ignore", invalid="ignore"):
            self.compliance = np.where(whole > 0.0, 1.0 / whole, 0.0)
            """1/(D_d + G), zero where the series damper is rigid."""
            self.mobility = np.where(self.backward > 0.0, 1.0 / self.backward, 0.0)
            """1/G, zero where there is no element."""
        self.share = self.backward * self.compliance
        """G/(D_d + G), of a load above yield: what the flow takes away."""
        self.kept = 1.0 - self.share
        self.yield_torque = np.array(elements.yield_torque, dtype=np.float64)
        yields = np.isfinite(self.yield_torque)
        self.shared_yield = self.share * np.where(yields, self.yield_torque, 0.0)
        """G τ/(D_d + G)."""
        self.can_flow = bool(np.any((self.compliance > 0.0) & yields))
        self.diagonal = self.backward[:, None, None] * _UNIT
        """(joints, 3, 3) slope of an element that holds."""
        self.held = step * self.diagonal
        """The same for the impulse over a step."""

    def at_rest(self, spring: Floats) -> Floats:
        """−K_f q_f (joints, 3), the load at rest without flow."""
        return -self.stiffness[:, None] * spring

    def respond(self, at_rest: Floats, speed: Floats) -> ElementResponse:
        """The response from the load at rest (joints, 3) and w (joints, 3) at the step's end."""
        return self.answer(at_rest - self.backward[:, None] * speed)

    def answer(self, trial: Floats) -> ElementResponse:
        """The same from λ_e (joints, 3)."""
        if not self.can_flow:
            return ElementResponse(self, trial, trial, _NONE, None)
        size = np.sqrt((trial * trial) @ _ONES)
        # With a threshold of 0 it flows even at rest: there its law is linear.
        flows = size >= self.yield_torque
        if not flows.any():
            return ElementResponse(self, trial, trial, size, None)
        which = flows.nonzero()[0]
        factor = self.shared_yield.take(which) / (size.take(which) + _TINY)
        factor += self.kept.take(which)
        load = trial.copy()
        load[which] = trial.take(which, 0) * factor[:, None]
        return ElementResponse(self, load, trial, size, flows)


_NONE = np.zeros(0)
