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

Where coefficients differ about a bone's axes (``AxisLaw``), K_f, D_f and D_d are diagonal there;
the yield torque still bounds the load as a vector: what the series damper spends is
τ |w_d| + ½ w_d·D_d w_d, whose slope is the load while it moves. With v = −w_d and s = |v|

    v = s λ_e/((D_d + G) s + τ),      |λ_e/((D_d + G) s + τ)| = 1,      λ = λ_e − G v,

of which only s has to be found. With equal coefficients it is the law above, and at τ = 0 each axis
is the source's element by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...rotations import Floats
from .figure import Elements, Flags, Integers

_TINY = 1e-300
_ONES = np.ones(3)
_UNIT = np.eye(3)


# Not frozen, as a frozen one takes eight times as long to make, in every step.
@dataclass(eq=False)
class ElementResponse:
    """How the elements answer a relative angular velocity w over one step."""

    law: PlasticLaw
    load: Floats
    """(joints, 3) λ, the torque on the child, N·m."""
    trial: Floats
    """(joints, 3) λ_e, what it would be without flow."""
    flows: Flags | None
    """(joints,) where the series damper moves; None where all hold: the load is linear in w."""
    which: Integers
    """(which,) those joints."""
    toward: Floats
    """(which, 3) of these, λ_e/|λ_e|; …"""
    size: Floats
    """(which,) … and |λ_e|."""
    flow: Floats | None = None
    """(which, 3) w_d; None where it follows from the load, see ``flows_with``."""
    bent: Floats | None = None
    """(which, 3, 3) the slopes; None likewise."""

    @property
    def slope(self) -> Floats:
        """(joints, 3, 3) −∂λ/∂w, symmetric and positive semidefinite, N·m·s/rad."""
        slope = self.law.diagonal
        if self.flows is not None:
            slope = slope.copy()
            slope[self.which] = self.bends()
        return slope

    def bends(self) -> Floats:
        """(which, 3, 3) the slopes of what flows."""
        if self.bent is not None:
            return self.bent
        # Along s only what the flow leaves, across it also the turning of s.
        law, which, toward = self.law, self.which, self.toward
        gain = law.backward.take(which)
        ratio = gain * law.shared_yield.take(which) / self.size
        across = gain * law.kept.take(which) + ratio
        blocks = across[:, None, None] * _UNIT
        blocks -= (ratio[:, None] * toward)[:, :, None] * toward[:, None, :]
        return blocks

    def flows_with(self) -> Floats:
        """(which, 3) w_d, rad/s, of what flows."""
        if self.flow is not None:
            return self.flow
        law, which = self.law, self.which
        excess = (law.yield_torque.take(which) - self.size) * law.compliance.take(which)
        return self.toward * excess[:, None]

    def planes(self, at_rest: Floats, speeds: Floats | None) -> tuple[Floats, Floats]:
        """The impulse over a step as a plane that touches it at w (joints, 3): p = right − slope w,
        (joints, 3, 3) and (joints, 3).

        ``at_rest`` is the load at rest; without w it is where elements have the load ``trial``.
        What holds is its own plane, whatever w is.
        """
        law, which = self.law, self.which
        slopes, right = law.held.copy(), law.step * at_rest
        bent = law.step * self.bends()
        if speeds is None:
            at = law.speed_at(which, at_rest.take(which, 0) - self.trial.take(which, 0))
        else:
            at = speeds.take(which, 0)
        slopes[which] = bent
        right[which] = law.step * self.load.take(which, 0) + (bent @ at[:, :, None])[:, :, 0]
        return slopes, right


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
        self._stiffness3 = np.tile(-self.stiffness[:, None], 3)
        self._backward3 = np.tile(self.backward[:, None], 3)
        self._square_yield = self.yield_torque * self.yield_torque
        self.diagonal = self.backward[:, None, None] * _UNIT
        """(joints, 3, 3) slope of an element that holds."""
        self.held = step * self.diagonal
        """The same for the impulse over a step."""

    def seen_in(self, frames: Floats) -> PlasticLaw:  # noqa: ARG002
        """The law of a step in world axes, of bones with axes (joints, 3, 3)."""
        return self

    def speed_at(self, which: Integers, change: Floats) -> Floats:
        """(which, 3) w that takes so much from the loads (which, 3) of elements without flow."""
        return change * self.mobility.take(which)[:, None]

    def at_rest(self, spring: Floats) -> Floats:
        """−K_f q_f (joints, 3), the load at rest without flow."""
        return self._stiffness3 * spring

    def drawn(self, speed: Floats) -> Floats:
        """G w (joints, 3), the load on what stands still while the spring's rest turns with w."""
        return self._backward3 * speed

    def respond(self, at_rest: Floats, speed: Floats) -> ElementResponse:
        """The response from the load at rest (joints, 3) and w (joints, 3) at the step's end."""
        return self.answer(at_rest - self._backward3 * speed)

    def answer(self, trial: Floats) -> ElementResponse:
        """The same from λ_e (joints, 3)."""
        if not self.can_flow:
            return _held(self, trial)
        square = (trial * trial) @ _ONES
        # With a threshold of 0 it flows even at rest: there its law is linear.
        flows = square >= self._square_yield
        which = flows.nonzero()[0]
        if not len(which):
            return _held(self, trial)
        size = np.sqrt(square.take(which)) + _TINY
        toward = trial.take(which, 0) / size[:, None]
        load = trial.copy()
        borne = self.shared_yield.take(which) + self.kept.take(which) * size
        load[which] = toward * borne[:, None]
        return ElementResponse(self, load, trial, flows, which, toward, size)


def _held(law: PlasticLaw, trial: Floats) -> ElementResponse:
    """Where nothing flows."""
    return ElementResponse(law, trial, trial, None, _NOBODY, _NO_ROWS, _NO_ONES)


class AxisLaw(PlasticLaw):
    """Elements whose coefficients (joints, 3) differ about the bones' axes: bend, twist, bend."""

    def __init__(self, elements: Elements, step: float, frames: Floats | None = None) -> None:
        """Of bones with axes (joints, 3, 3); those of the world, where it is not known yet."""
        self.step = step
        self._elements = elements
        self._stiff = _three(elements.stiffness)
        self._back = self._stiff * step + _three(elements.damping)
        self._whole = self._back + _three(elements.flow)
        self.yield_torque = elements.yield_torque
        self._can_flow = (self._whole > 0.0).all(axis=1)
        self._frames = np.tile(_UNIT, (len(self._stiff), 1, 1)) if frames is None else frames
        self._back_turned = self._frames.transpose(0, 2, 1)
        self.diagonal = (self._frames * self._back[:, None, :]) @ self._back_turned
        self.held = step * self.diagonal

    def seen_in(self, frames: Floats) -> AxisLaw:
        return AxisLaw(self._elements, self.step, frames)

    def _along(self, factors: Floats, vectors: Floats) -> Floats:
        """Vectors (joints, 3), world, each times the factors (joints, 3) of its joint's axes."""
        own = (self._back_turned @ vectors[:, :, None])[:, :, 0] * factors
        return (self._frames @ own[:, :, None])[:, :, 0]

    def speed_at(self, which: Integers, change: Floats) -> Floats:
        back = self._back.take(which, 0)
        mobility = np.divide(1.0, back, out=np.zeros_like(back), where=back > 0.0)
        frames = self._frames.take(which, 0)
        own = (change[:, None, :] @ frames)[:, 0] * mobility
        return (frames @ own[:, :, None])[:, :, 0]

    def at_rest(self, spring: Floats) -> Floats:
        return self._along(-self._stiff, spring)

    def drawn(self, speed: Floats) -> Floats:
        return (self.diagonal @ speed[:, :, None])[:, :, 0]

    def respond(self, at_rest: Floats, speed: Floats) -> ElementResponse:
        return self.answer(at_rest - (self.diagonal @ speed[:, :, None])[:, :, 0])

    def answer(self, trial: Floats) -> ElementResponse:
        size = np.sqrt((trial * trial) @ _ONES)
        flows = (size >= self.yield_torque) & (size > 0.0) & self._can_flow
        which = flows.nonzero()[0]
        if not len(which):
            return _held(self, trial)
        frames = self._frames.take(which, 0)
        back, limit = self._back.take(which, 0), self.yield_torque.take(which)[:, None]
        own = (trial.take(which, 0)[:, None, :] @ frames)[:, 0]
        whole = self._whole.take(which, 0)
        speed = _overstressed(own, whole, limit)
        way = own / (whole * speed + limit)
        # (D_d + G) + τ/s (1 − v̂ v̂ᵀ), times s: the inverse of what the flow answers.
        firm = speed[:, :, None] * whole[:, :, None] * _UNIT
        firm += limit[:, :, None] * (_UNIT - way[:, :, None] * way[:, None, :])
        inner = back[:, :, None] * (speed[:, :, None] * np.linalg.inv(firm)) * back[:, None, :]
        slopes = frames @ (back[:, :, None] * _UNIT - inner) @ frames.transpose(0, 2, 1)
        flow = -(frames @ (speed * way)[:, :, None])[:, :, 0]
        load = trial.copy()
        load[which] -= (frames @ (back * speed * way)[:, :, None])[:, :, 0]
        size = size.take(which)
        toward = trial.take(which, 0) / size[:, None]
        return ElementResponse(self, load, trial, flows, which, toward, size, flow, slopes)


def _overstressed(trial: Floats, whole: Floats, limit: Floats) -> Floats:
    """(joints, 1) s with |λ_e/((D_d + G) s + τ)| = 1, for |λ_e| ≥ τ: Newton's method on one over
    that length, which is concave, from below.
    """
    speed = np.full_like(limit, _LEAST_SPEED)
    for _ in range(_MOST_ROUNDS):
        given = whole * speed + limit
        parts = (trial / given) ** 2
        length = np.sqrt(parts.sum(axis=1, keepdims=True))
        slope = (parts * whole / given).sum(axis=1, keepdims=True) / length**3
        further = np.maximum((1.0 - 1.0 / length) / slope, 0.0)
        speed += further
        if (further <= 1e-14 * speed).all():
            break
    return speed


def law_of(elements: Elements, step: float) -> PlasticLaw:
    """The law of elements: the quick one, unless coefficients differ about some bone's axes."""
    three = (elements.stiffness, elements.damping, elements.flow)
    alike = all(each.ndim == 1 or np.array_equal(each[:, :1] + 0.0 * each, each) for each in three)
    if not alike:
        return AxisLaw(elements, step)
    stiffness, damping, flow = (each if each.ndim == 1 else each[:, 0] for each in three)
    return PlasticLaw(Elements(stiffness, damping, flow, elements.yield_torque), step)


def _three(coefficients: Floats) -> Floats:
    """(joints, 3) of coefficients (joints,) alike about all axes, or (joints, 3)."""
    return coefficients if coefficients.ndim == 2 else np.tile(coefficients[:, None], 3)


_MOST_ROUNDS = 60
_LEAST_SPEED = 1e-12
"""rad/s"""
_NOBODY = np.zeros(0, np.int64)
_NO_ROWS = np.zeros((0, 3))
_NO_ONES = np.zeros(0)
