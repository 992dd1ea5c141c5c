# SPDX-License-Identifier: GPL-3.0-or-later
"""From hand and body to the force on the hand: what the coupling asks for, and what is left of it.

*The virtual coupling* is a spring and a damper in six degrees of freedom between hand and body. How
stiff it may be follows from the device. A spring K and damper B, sampled every T and held in
between, act on a hand that the device itself damps with b. Colgate and Brown ("Factors affecting
the Z-width of a haptic display", 1994): the whole is passive, whoever holds it, if

    b > K T / 2 + |B|.

A further delay d between pose and force counts as more of T / 2. Abbott and Okamura ("Effects of
position quantization and sampling rate on virtual-wall passivity", 2005): where the device measures
in steps Δ and has dry friction c, also

    K <= min(2 b / T, 2 c / Δ).

The second bound is left out where a device does not know its friction or its steps. What neither
sees (a slow simulation, a scaled-up device) is the passivity controller's business.

*Passivity observer and controller*: the hand never gets more energy than it gave. After Hannaford
and Ryu, "Time-domain passivity control of haptic interfaces" (2002), in impedance form: the device
reports its motion, and is given a force. The observer sums the work that the hand did against the
force of each period; this is exact, since the force is held while the hand moves. Where the sum
would fall below zero, the controller adds damping, as much as brings it back.

Three things beyond the source. The sum has a ceiling: energy spent long ago on bending a joint is
no licence to shake the hand now, so what can ever come back is bounded by ``most``. And the damping
has one: a damper of α on a hand of mass m sampled every T is itself active from α T = 2 m on. Ten
times the device's own damping calms all from 0.05 to 0.4 kg at eight times the passive stiffness.
So damping alone cannot keep back a strong slow push, as of a puppet that was bent with more work
than the hand did (the simulation's own coupling helps); while the store is nearly empty, what
drives the hand fades, and smoothly, for a hand that trembles would feel leaps as a buzz.

*Delays* that nobody told are the third: see ``Delays``, and ``UnderWay`` for what neither sees in
time.

*The shaper* is last: how much force, how fast it may change, and when it ends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from math import isfinite
from typing import Final

import numpy as np

from ...core.rotations import Floats
from ...core.rotations.scalars import (
    ZERO,
    Vector,
    add,
    add_scaled,
    clamp_length,
    dot,
    scale,
    subtract,
)
from ..driver import FRESH_SECONDS, Dynamics

SHARE: Final = 0.8
"""Of the largest stiffness that is passive on paper, this is used: no device is what it says."""
DAMPER_SHARE: Final = 0.2
"""Of the device's own damping, this is left for the coupling's damper."""


@dataclass(frozen=True)
class Gains:
    """Stiffness and damping, of pushing and of turning, at the hand."""

    stiffness: float
    """N/m"""
    damping: float
    """N·s/m"""
    angular_stiffness: float
    """N·m/rad"""
    angular_damping: float
    """N·m·s/rad"""


def stiffest(damping: float, late: float, damper: float = 0.0) -> float:
    """The largest passive stiffness, after Colgate and Brown: ``(b − |B|) / late``.

    b damps the device and B is the coupling's damper; T / 2 + d is how late (s) a force answers.
    """
    return max(0.0, damping - abs(damper)) / late


def gains_for(device: Dynamics, period: float, share: float = SHARE) -> Gains:
    """The coupling for a device and a loop (s); by a share above 1 it may become active."""
    late = 0.5 * period + device.delay
    angular = (device.angular_damping, device.angular_friction, device.angular_resolution)
    return Gains(
        *_gains(device.damping, device.friction, device.resolution, late, share),
        *_gains(*angular, late, share),
    )


def _gains(
    damping: float, friction: float, resolution: float, late: float, share: float
) -> tuple[float, float]:
    damper = DAMPER_SHARE * damping
    most = stiffest(damping, late, damper)
    if friction > 0.0 and resolution > 0.0:
        most = min(most, 2.0 * friction / resolution)
    return share * most, min(share, 1.0) * damper


def wrench(
    gains: Gains, apart: Vector, turned: Vector, drift: Vector, spin: Vector
) -> tuple[Vector, Vector]:
    """Force and torque on the hand.

    ``apart`` (m) and ``turned`` (rad, rotation vector) lead from the hand to the body; ``drift``
    (m/s) and ``spin`` (rad/s) are the body's less the hand's.
    """
    return (
        add_scaled(scale(apart, gains.stiffness), drift, gains.damping),
        add_scaled(scale(turned, gains.angular_stiffness), spin, gains.angular_damping),
    )


# --- Passivity -----------------------------------------------------------------------------------

DAMPING: Final = 10.0
"""Times the device's own damping, the most that the controller adds."""
_EMPTYING: Final = 0.5
"""Share of the store, below which what drives the hand fades."""
_FADE_OUT: Final = 0.005
_FADE_IN: Final = 0.03
"""s in which it fades, and comes back: by leaps it would buzz."""
STORED: Final = 0.02
"""J of pushing that can be given back, a 2 N push over 1 cm; of turning likewise."""


@dataclass
class Observer:
    """Energy that flowed from the hand into the loop, of pushing or of turning."""

    most: float
    """J that can be stored, and so given back."""
    most_damping: float
    """N·s/m (N·m·s/rad) that the controller may add."""
    energy: float = 0.0
    """J, of the hand's, that the loop holds."""
    _share: float = 1.0
    """Of the coupling's force: less while it drives the hand and the store is nearly empty."""
    given: float = 0.0
    """J that the loop gave beyond what it had got: stays near 0 unless damping was capped."""

    def observe(self, force: Vector, moved: Vector) -> None:
        """Account for one period: what acted on the hand, and how that moved (turned) in it."""
        self.energy = min(self.most, self.energy - dot(force, moved))
        self.given = max(self.given, -self.energy)

    def damping(self, force: Vector, velocity: Vector, period: float) -> Vector:
        """To add to what the coupling asks for, so that no period gives what is not there.

        The hand's velocity is expected to go on for the coming period (s).
        """
        speed_squared = dot(velocity, velocity)
        if speed_squared <= 0.0:
            return ZERO
        left = self.energy - dot(force, velocity) * period
        if left >= 0.0:
            return ZERO
        amount = min(self.most_damping, -left / (speed_squared * period))
        return scale(velocity, -amount)

    def allowed(self, force: Vector, velocity: Vector, period: float) -> Vector:
        """What is left of a force that drives the hand while the store runs out; period in s."""
        drives = dot(force, velocity) > 0.0
        wanted = max(0.0, min(1.0, self.energy / (_EMPTYING * self.most))) if drives else 1.0
        takes = _FADE_OUT if wanted < self._share else _FADE_IN
        self._share += min(1.0, period / takes) * (wanted - self._share)
        return scale(force, self._share)

    def forget(self) -> None:
        """Start anew, at a grab: nothing is stored, nothing may be given."""
        self.energy, self._share = 0.0, 1.0


# --- Delays that nobody told ---------------------------------------------------------------------

DOUBTED: Final = 0.02
"""s: the longest delay that a device may have without saying so."""
LIGHTEST: Final = 0.02
LIGHTEST_TURN: Final = 1e-4
"""kg and kg·m²: of a hand with what it holds, at the least."""
_IN_FLIGHT: Final = 0.0115
"""J that such a hand may get from forces that are under way, if it goes limp."""
SUDDEN: Final = 300.0
SUDDEN_TURN: Final = 3000.0
"""m/s² and rad/s²: no hand gets faster sooner by itself."""
_CALMER: Final = 0.2
"""s in which a hand that was fast counts as a third as fast."""
_KEPT: Final = 0.005
"""J that any delay may give until the coupling is gone. It is a part of what may come back, for the
rest comes from forces that are under way and cannot be called back."""
_SOFTENS: Final = 0.5
"""Share of that, below which the coupling gets softer."""
_BEGINS: Final = 0.3
_AGAIN: Final = 2.0
_LONGEST: Final = 16.0
"""s in which it comes after a grab, and comes back when nothing was left: twice as long each time
that this was so."""
_CALMS: Final = 2.0
_CALM_LEFT: Final = 0.03
"""Times the device's own damping, that takes its place, and the share of it that is never gone: by
that alone the coupling can come back."""
GROWS: Final = 25.0
GROWS_TURNING: Final = 1.0
"""N/s and N·m/s, at most: of what grows faster, too much would be under way before anybody sees
what it does. Whatever a device can give, for hands are as heavy at a strong one."""


class UnderWay:
    """How much force may be under way to a hand of which nobody knows how heavy it is.

    However soon it is seen that a hand goes limp or turns round, the forces of the time d that they
    take still come: an impulse J = F d, of which a hand of mass m that goes with v gets

        J v + J² / 2m.

    It is most for the lightest hand, so J is bounded for that. A heavier one gets less. And a hand
    that is far from what it holds, and comes back by itself as suddenly as a hand can, gets the
    force on its way: F min(x, ½ a d²) of a distance x.
    """

    def __init__(self, period: float, most: float, lightest: float, sudden: float) -> None:
        """For a loop (s), the most force (N, or N·m), the lightest hand (kg, or kg·m²) and how soon
        it gets faster by itself (m/s², or rad/s²).
        """
        self._most, self._lightest, self._sudden = most, lightest, sudden
        self._calms = math.exp(-period / _CALMER)
        self._fastest = 0.0

    def most(self, speed: float, apart: float, late: float) -> float:
        """N, of all that is asked for, for a hand of that speed (m/s), so far (m) from what it
        holds, and forces so late (s).
        """
        speed = self._fastest = max(speed, self._calms * self._fastest)
        given = speed * speed + 2.0 * _IN_FLIGHT / self._lightest
        most = min(self._most, self._lightest * (math.sqrt(given) - speed) / late)
        way = min(apart, 0.5 * self._sudden * late * late)
        return min(most, _IN_FLIGHT / way) if way > 0.0 else most


class Delays:
    """Energy that a hand has left in the loop, for each delay that there may be.

    A device that does not say how late it answers, or says it wrongly, gets forces that belong to
    where its hand was, and a spring that answers late drives what it should hold: hand and device
    swing for ever, each time with more. Which delay is true nobody knows. But the work of the
    forces that were sent, delayed by any of them, over the way that the hand is seen to go can be
    summed, and the worst of the sums counts, less what is under way. Between two of the delays the
    work is between theirs; so whatever constant delay is true, the hand gets no more than is kept
    and what it does itself to meet forces under way.

    Where little is left the coupling fades, and damping takes its place: late as it may be, that
    takes energy from most of what a hand does, and so the coupling comes back, the more slowly the
    more often it was gone. Where nothing is left, as for a hand that swings so fast that late
    damping drives it, damping fades as well. Without delay the same sums come out better, and
    nothing fades while a limb is bent or held.
    """

    def __init__(self, period: float, grows: float, damping: float) -> None:
        """For a loop (s), how force (N, or N·m) grows (N/s), and the device's damping."""
        count = math.ceil(DOUBTED / period) + 2
        self._period = period
        self._growth = grows * period
        self._damping = _CALMS * damping
        self._energy = np.full(count, _KEPT)
        """J by delay, the longest first, at most what is kept."""
        self._forces = np.zeros((2 * count, 3))
        """Those of the last periods, twice: so that all of them are found in one piece."""
        self._at = 0
        self._share = 0.0
        self._patience = _BEGINS
        self._allowed = ZERO

    def observe(self, force: Vector, moved: Vector) -> None:
        """Account for one period: what was sent in it (N), and how the hand moved (m)."""
        count = len(self._energy)
        self._at = (self._at + 1) % count
        self._forces[self._at] = self._forces[self._at + count] = force
        self._energy -= self._last @ moved
        np.minimum(self._energy, _KEPT, out=self._energy)

    @property
    def _last(self) -> Floats:
        """(count, 3) the last forces, the oldest first."""
        return self._forces[self._at + 1 : self._at + 1 + len(self._energy)]

    def left(self, velocity: Vector) -> float:
        """J left in the worst case, once all that is under way has come at this speed (m/s)."""
        coming = self._last @ velocity
        # What is under way at a delay is all that was sent since: of none it is nothing.
        under_way = self._period * (coming.sum() - coming.cumsum())
        return float(np.minimum(self._energy, self._energy - under_way).min())

    def begin(self) -> None:
        """A grab: the coupling grows from none. What was learned of the device stays."""
        self._share, self._allowed = 0.0, ZERO
        self._forces[:] = 0.0

    def allowed(self, force: Vector, velocity: Vector, most: float) -> Vector:
        """What is left of a coupling's force (N), ``most`` of it, on a hand of that speed (m/s)."""
        left = self.left(velocity)
        wanted = max(0.0, min(1.0, left / (_SOFTENS * _KEPT)))
        if wanted <= self._share:
            if wanted == 0.0 < self._share:
                self._patience = min(_LONGEST, max(_AGAIN, 2.0 * self._patience))
            self._share = wanted
        else:
            self._share = min(wanted, self._share + self._period / self._patience)
            if self._share == 1.0:
                self._patience = max(_BEGINS, self._patience - self._period)
        # Of what it may be, for of a hand far away a small share would be much.
        wish, before = scale(clamp_length(force, most), self._share), self._allowed
        grown = subtract(wish, before)
        if dot(grown, before) >= 0.0:
            wish = add(before, clamp_length(grown, self._growth))
        self._allowed = wish
        # To a hand that swings so fast that it has turned round by then, it gives as well.
        calm = max(_CALM_LEFT, min(1.0, 1.0 + left / _KEPT))
        return add_scaled(wish, velocity, (self._share - 1.0) * calm * self._damping)


# --- Limits --------------------------------------------------------------------------------------

RISE: Final = 0.2
"""s from nothing to all of the force after a grab."""
FALL: Final = 0.03
"""s from all of the force to nothing after letting go."""
FULL_IN: Final = 0.01
"""s: from no force to the most, or from the most to none, takes at least so long. As fast as force
fades when data grows old."""
_FULL: Final = 0.5
"""Of the time that data counts as fresh, this much is without any loss of force."""


def freshness(age: float) -> float:
    """Share of the force for data of an age: 1 while fresh, fading, 0 from 20 ms on."""
    if not age < FRESH_SECONDS:  # an age that is no number is not fresh
        return 0.0
    return min(1.0, (FRESH_SECONDS - age) / (FRESH_SECONDS * (1.0 - _FULL)))


@dataclass
class Shaper:
    """Turns what the coupling asks for into what the hand gets."""

    most: float
    """N, the most that a hand is ever given."""
    most_torque: float
    """N·m, likewise."""
    share: float = 0.0
    """Of the asked force: rises after a grab, falls after letting go."""
    force: Vector = ZERO
    """What the hand gets now."""
    torque: Vector = ZERO

    def shape(
        self, force: Vector, torque: Vector, period: float, *, holding: bool, age: float
    ) -> None:
        """Set ``force`` (N) and ``torque`` (N·m) for the coming period (s), from those asked for.

        They fade where nothing is held. ``age`` (s) is that of the older of the two, the device's
        sample and the simulation's state.
        """
        fresh = freshness(age)
        if fresh <= 0.0 or not isfinite(dot(force, force) + dot(torque, torque)):
            # Not a fade but the end of one: it began when half of the time was over. And what is
            # no number, or beyond all of them, must not reach a motor.
            self.drop()
            return
        step = period / RISE if holding else -period / FALL
        self.share = max(0.0, min(1.0, self.share + step))
        part = self.share * fresh
        change = period / FULL_IN
        self.force = _toward(self.force, force, part, self.most, change)
        self.torque = _toward(self.torque, torque, part, self.most_torque, change)

    def drop(self) -> None:
        """No force from now on: the device is gone, or the loop ends."""
        self.share, self.force, self.torque = 0.0, ZERO, ZERO


def _toward(now: Vector, asked: Vector, part: float, most: float, change: float) -> Vector:
    wanted = scale(clamp_length(asked, most), part)
    return add(now, clamp_length(subtract(wanted, now), most * change))
