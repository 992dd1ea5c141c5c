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
from ...rotations.small_batches import matvec, vecdot, vecmat
from .figure import Elements, Flags

_TINY = 1e-60
_UNIT = np.eye(3)


# Not frozen, as a frozen one takes eight times as long to make, in every step.
@dataclass(eq=False)
class ElementResponse:
    """How the elements answer a relative angular velocity w over one step.

    All joints are worked out alike, whether they flow or hold: to pick out some of a few hundred
    takes longer.
    """

    law: PlasticLaw
    load: Floats
    """(joints, 3) λ, the torque on the child, N·m."""
    trial: Floats
    """(joints, 3) λ_e, what it would be without flow."""
    flows: Flags | None = None
    """(joints,) where the series damper moves; None where all hold: the load is linear in w."""
    size: Floats | None = None
    """(joints,) |λ_e|; None where it is not needed."""
    pace: Floats | None = None
    """(joints,) |w_d|/|λ_e|, …"""
    share: Floats | None = None
    """(joints,) … and |λ|/|λ_e|; None where they are not needed."""
    flow: Floats | None = None
    """(joints, 3) w_d; None where it follows from the pace, see ``flows_with``."""
    bent: Floats | None = None
    """(joints, 3, 3) the slopes of impulses over a step; None likewise, see ``slopes``."""

    @property
    def slope(self) -> Floats:
        """(joints, 3, 3) −∂λ/∂w, symmetric and positive semidefinite, N·m·s/rad."""
        return self.slopes() / self.law.step

    def slopes(self) -> Floats:
        """(joints, 3, 3) the same for the impulse over a step."""
        if self.flows is None:
            return self.law.held
        if self.bent is not None:
            return self.bent
        assert self.size is not None
        assert self.share is not None
        # Along λ_e only what the flow leaves, across it also the turning of λ_e.
        law, size, trial = self.law, self.size, self.trial
        ratio = law.bending / (size * size * size)
        ratio *= self.flows
        blocks = law.held * self.share[:, None, None]
        blocks -= (ratio[:, None] * trial)[:, :, None] * trial[:, None, :]
        return blocks

    def flows_with(self) -> Floats:
        """(joints, 3) w_d, rad/s; zero of what holds. Only where something flows."""
        if self.flow is not None:
            return self.flow
        assert self.pace is not None
        return self.trial * -self.pace[:, None]

    def planes(self, at_rest: Floats, speeds: Floats | None) -> tuple[Floats, Floats]:
        """The impulse over a step as a plane that touches it at w (joints, 3): p = right − slope w,
        (joints, 3, 3) and (joints, 3).

        ``at_rest`` is the load at rest; without w it is where elements have the load ``trial``.
        """
        law = self.law
        slopes = self.slopes()
        at = law.speed_at(at_rest - self.trial) if speeds is None else speeds
        right = matvec(slopes, at)
        right += law.step * self.load
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
        self.yield_torque = np.array(elements.yield_torque, dtype=np.float64)
        yields = np.isfinite(self.yield_torque)
        self._paces = np.where(yields, self.compliance, 0.0)
        self._least = self._paces * np.where(yields, self.yield_torque, 0.0)
        # w_d = −λ_e (1 − τ/|λ_e|)/(D_d + G): nothing below yield.
        self.can_flow = bool(np.any(self._paces > 0.0))
        self.gain = step * self.backward
        """(joints,) h G."""
        self.bending = self.gain * self.backward * self._least
        """(joints,) h G² τ/(D_d + G)."""
        self._stiffness3 = np.tile(-self.stiffness[:, None], 3)
        self._backward3 = np.tile(self.backward[:, None], 3)
        self._mobility3 = np.tile(self.mobility[:, None], 3)
        self.diagonal = self.backward[:, None, None] * _UNIT
        """(joints, 3, 3) slope of an element that holds."""
        self.held = step * self.diagonal
        """The same for the impulse over a step."""

    def seen_in(self, frames: Floats) -> PlasticLaw:  # noqa: ARG002
        """The law of a step in world axes, of bones with axes (joints, 3, 3)."""
        return self

    def speed_at(self, change: Floats) -> Floats:
        """(joints, 3) w that takes so much from the loads (joints, 3) of elements without flow."""
        return change * self._mobility3

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
            return ElementResponse(self, trial, trial)
        size = np.sqrt(vecdot(trial, trial))
        size += _TINY
        # With a threshold of 0 it flows even at rest: there its law is linear.
        pace = self._paces - self._least / size
        flows = pace > 0.0
        if not np.count_nonzero(flows):
            return ElementResponse(self, trial, trial)
        pace *= flows
        share = 1.0 - self.backward * pace
        return ElementResponse(self, trial * share[:, None], trial, flows, size, pace, share)


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
        own = matvec(self._back_turned, vectors) * factors
        return matvec(self._frames, own)

    def speed_at(self, change: Floats) -> Floats:
        mobility = np.divide(1.0, self._back, out=np.zeros_like(self._back), where=self._back > 0.0)
        return self._along(mobility, change)

    def at_rest(self, spring: Floats) -> Floats:
        return self._along(-self._stiff, spring)

    def drawn(self, speed: Floats) -> Floats:
        return matvec(self.diagonal, speed)

    def respond(self, at_rest: Floats, speed: Floats) -> ElementResponse:
        return self.answer(at_rest - matvec(self.diagonal, speed))

    def answer(self, trial: Floats) -> ElementResponse:
        size = np.sqrt(vecdot(trial, trial))
        flows = (size >= self.yield_torque) & (size > 0.0) & self._can_flow
        which = flows.nonzero()[0]
        if not len(which):
            return ElementResponse(self, trial, trial)
        frames = self._frames.take(which, 0)
        back, limit = self._back.take(which, 0), self.yield_torque.take(which)[:, None]
        own = vecmat(trial.take(which, 0), frames)
        whole = self._whole.take(which, 0)
        speed = _overstressed(own, whole, limit)
        way = own / (whole * speed + limit)
        # (D_d + G) + τ/s (1 − v̂ v̂ᵀ), times s: the inverse of what the flow answers.
        firm = speed[:, :, None] * whole[:, :, None] * _UNIT
        firm += limit[:, :, None] * (_UNIT - way[:, :, None] * way[:, None, :])
        inner = back[:, :, None] * (speed[:, :, None] * np.linalg.inv(firm)) * back[:, None, :]
        bent = self.held.copy()
        bent[which] = (
            self.step * frames @ (back[:, :, None] * _UNIT - inner) @ frames.transpose(0, 2, 1)
        )
        flow = np.zeros_like(trial)
        flow[which] = -matvec(frames, speed * way)
        load = trial.copy()
        load[which] -= matvec(frames, back * speed * way)
        return ElementResponse(self, load, trial, flows, flow=flow, bent=bent)


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
