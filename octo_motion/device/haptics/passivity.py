# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a force the hand gets, so that it never gets more energy than it gave.

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
"""

from __future__ import annotations

import math
from dataclasses import dataclass
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
    length,
    scale,
    subtract,
)

# --- Observer and controller ---------------------------------------------------------------------

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
        # Of what hardly moves the square, and what comes of it in a period, may be none.
        spent = dot(velocity, velocity) * period
        if spent <= 0.0:
            return ZERO
        left = self.energy - dot(force, velocity) * period
        if left >= 0.0:
            return ZERO
        amount = min(self.most_damping, -left / spent)
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
_LIGHTEST: Final = 0.02
_LIGHTEST_TURN: Final = 1e-4
"""kg and kg·m²: of a hand with what it holds, at the least."""
_IN_FLIGHT: Final = 0.0115
"""J that such a hand may get from forces that are under way, if it goes limp."""
_SUDDEN: Final = 300.0
_SUDDEN_TURN: Final = 3000.0
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
_GROWS: Final = 25.0
_GROWS_TURNING: Final = 1.0
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


# --- All of it -----------------------------------------------------------------------------------


class Passivity:
    """What a hand gets of all that the coupling asks for, of pushing or of turning."""

    def __init__(self, period: float, most: float, damping: float, *, turns: bool) -> None:
        """For a loop (s) and a device with so much force (N, or N·m) and damping."""
        self._period = period
        self._observer = Observer(STORED, DAMPING * damping)
        # Where there is no torque, none is under way.
        grows = _GROWS_TURNING if turns else _GROWS
        self._delays = Delays(period, grows, damping) if most > 0.0 else None
        hand = (_LIGHTEST_TURN, _SUDDEN_TURN) if turns else (_LIGHTEST, _SUDDEN)
        self._under_way = UnderWay(period, most, *hand)

    @property
    def given(self) -> float:
        """J that the hand got beyond what it had given."""
        return self._observer.given

    def begin(self) -> None:
        """Another grab begins."""
        self._observer.forget()
        if self._delays:
            self._delays.begin()

    def allowed(self, force: Vector, velocity: Vector, apart: float, late: float) -> Vector:
        """What is left of a force, and the damping that it takes, for a hand that goes so fast, is
        so far (m, or rad) from what it holds, and feels it so late (s).
        """
        most = self._under_way.most(length(velocity), apart, late)
        if self._delays:
            force = self._delays.allowed(force, velocity, most)
        force = self._observer.allowed(force, velocity, self._period)
        force = add(force, self._observer.damping(force, velocity, self._period))
        return clamp_length(force, most)

    def observe(self, force: Vector, moved: Vector, *, holds: bool) -> None:
        """Account for one period: what was sent in it, and how the hand moved (turned)."""
        self._observer.observe(force, moved)
        if self._delays and holds:
            self._delays.observe(force, moved)
