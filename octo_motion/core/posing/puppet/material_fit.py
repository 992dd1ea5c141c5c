# SPDX-License-Identifier: GPL-3.0-or-later
"""Coefficients measured from a drag: bend a joint once, hold it, let go.

An artist says it in words that need no fit (``Bend``): under this pull, for so long, it bends so
far, so much of that stays, and what springs back takes so long. With a steady torque T above what
the joint is to bear, τ, for t seconds, eq. 20–23 give

    stays = (T − τ) t / D_d,      bends − stays = T (1 − exp(−K_f t / D_f)) / K_f

so that each coefficient follows from one of the words. Acted out with a limb in the hand
(``measure_shown``), the words are read off the record.

What is recorded of a joint that is really pulled is the torque on it and how far it turned, about
one axis. The element answers with

    q̇_f = w − w_d,   λ = K q_f + D q̇_f (the torque that was applied),   D_d w_d = (|λ| − τ)₊ sign λ

Each of the four coefficients shows in a part of the record of its own:

- While |λ| ≤ τ nothing flows, so λ = K q + D w with the q from where it is relaxed: a straight
  line fit to the part before it first yields gives K and D.
- Above, the flow is what the angle does beyond the spring; a line through its speed against λ has
  the slope 1/D_d and meets zero at τ.

Both fits hang on where it first yields. That is found by trying: the split with the least error of
the whole record, played again through the element, is taken, and then refined.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...errors import SettingsError
from ...rotations import Floats

_SPLITS: Final = 24
_FEW: Final = 12
_ROUNDS: Final = 60
_TRIED: Final = 3
_LEAST: Final = float(np.radians(0.1))
"""Radians below which a bend is none."""
_STIFFEST: Final = float(np.radians(0.5))
"""Radians by which everything springs back, as clay does."""
_CLEAR: Final = float(np.radians(1.0))
"""Radians that a hand means when it moves a limb."""
_REST: Final = 0.1
"""Seconds that a hand holds still where it means to stay."""
_SETTLES: Final = 0.03
"""Seconds, where nothing was shown."""


@dataclass(frozen=True)
class MeasuredBend:
    """Coefficients of one joint about one axis."""

    stiffness: float
    """K_f, N·m/rad."""
    damping: float
    """D_f, N·m·s/rad."""
    flow: float
    """D_d, N·m·s/rad; inf where the joint never yielded."""
    yield_torque: float
    """N·m; inf where it never yielded."""
    error: float
    """Radians, root mean square of the angle played again against the recorded one."""


@dataclass(frozen=True)
class Bend:
    """What a joint is to do when it is pulled once."""

    torque: float
    """N·m of the pull."""
    bears: float
    """N·m that the joint bears without giving way."""
    seconds: float
    """How long it is pulled."""
    bends: float
    """Radians at the end of the pull."""
    stays: float
    """Radians that are left once it has come to rest; 0 for a joint that never gives way."""
    settles: float
    """Seconds that springing back takes, D_f/K_f."""


def measure_bend(bend: Bend) -> MeasuredBend:
    """The element that does what a bend says.

    Raises:
        SettingsError: nothing is bent, more stays than was bent, or the pull is too weak for
            anything to stay.
    """
    if not bend.bends > _LEAST:
        raise SettingsError("The joint is not bent.", "Bend it by a few degrees at least.")
    if bend.stays > bend.bends + 1e-9:
        raise SettingsError(
            "More of the bend stays than there was.", "Let at most as much stay as it was bent by."
        )
    yields = bend.stays > 0.0
    if yields and bend.torque <= bend.bears:
        raise SettingsError(
            "The pull is no stronger than what the joint bears, so that nothing would stay.",
            "Pull harder, or let it bear less.",
        )
    # Without any spring at all, steps would have to be as short as it is stiff.
    spring = max(bend.bends - bend.stays, _STIFFEST)
    reached = -np.expm1(-bend.seconds / bend.settles)
    stiffness = bend.torque * float(reached) / spring
    return MeasuredBend(
        stiffness,
        stiffness * bend.settles,
        (bend.torque - bend.bears) * bend.seconds / bend.stays if yields else np.inf,
        bend.bears if yields else np.inf,
        0.0,
    )


def measure_shown(
    times: Floats, angles: Floats, released: float, torque: float, bears: float
) -> Bend:
    """What was acted out with a limb: it is bent, let go, and led to where it is to stay.

    Args:
        times: (samples,) seconds in which the limb was held, ascending.
        angles: (samples,) radians it was turned by.
        released: the time when it was let go for the first time.
        torque: N·m that the pull stands for.
        bears: N·m that the joint is to bear.

    Raises:
        SettingsError: nothing was bent, or it had not come to rest yet.
    """
    t, angle = np.asarray(times, dtype=np.float64), np.asarray(angles, dtype=np.float64)
    pulling = t <= released
    bends = float(angle[pulling][-1]) if pulling.any() else 0.0
    if not bends > _CLEAR:
        raise SettingsError(
            "The drag has bent nothing.",
            "Drag the limb about its joint, by a few degrees at least.",
        )
    late = angle[t >= t[-1] - _REST]
    if not pulling.all() and np.ptp(late) > max(_CLEAR, 0.1 * bends):
        raise SettingsError(
            "The limb was still moving when it was let go.",
            "Hold it still for a moment before you let go.",
        )
    begun = int(np.argmax(angle > 0.02 * bends))
    seconds = max(released - float(t[max(begun - 1, 0)]), 0.05)
    stays = float(np.clip(angle[-1], 0.0, bends))
    if stays < max(_CLEAR, 0.02 * bends):
        stays = 0.0
    settles = _SETTLES
    if bends - stays > max(_CLEAR, 0.02 * bends) and (~pulling).sum() >= _FEW:
        # As if the spring were alone: how fast it goes back to where it stays.
        back = t[~pulling] - released
        left = np.clip((angle[~pulling] - stays) / (bends - stays), 0.0, 1.0)
        area = 0.5 * float(((left[1:] + left[:-1]) * np.diff(back)).sum())
        settles = float(np.clip(area, 0.005, 5.0))
    return Bend(torque, bears, seconds, bends, stays, settles)


def measure(times: Floats, torques: Floats, angles: Floats) -> MeasuredBend:
    """Fit an element to a recorded drag.

    Args:
        times: (samples,) seconds, ascending.
        torques: (samples,) N·m applied to the joint about one axis.
        angles: (samples,) radians that it has turned since it was relaxed.

    Raises:
        SettingsError: too short a record, or one in which nothing happens.
    """
    t, load, angle = (np.asarray(array, dtype=np.float64) for array in (times, torques, angles))
    finite = all(bool(np.isfinite(array).all()) for array in (t, load, angle))
    if len(t) < 2 * _FEW or not finite or np.any(np.diff(t) <= 0.0):
        raise SettingsError(
            "The recorded drag is too short or broken.",
            "Bend the joint again, for a second or two.",
        )
    if np.ptp(load) <= 0.0 or np.ptp(angle) <= 0.0:
        raise SettingsError(
            "Nothing moved in the recorded drag.", "Bend the joint until it gives way, then let go."
        )
    # At most some hundred samples: more say nothing new about four numbers.
    if len(t) > 800:
        even = np.linspace(t[0], t[-1], 800)
        load, angle, t = np.interp(even, t, load), np.interp(even, t, angle), even
    guesses = [_guess(t, load, angle, share) for share in np.linspace(0.02, 1.0, _SPLITS)]
    scored = sorted(((_error(t, load, angle, guess), guess) for guess in guesses), key=_first)
    error, best = min((_refined(t, load, angle, guess) for guess in scored[:_TRIED]), key=_first)
    # What a joint that never yields explains as well needs no flow.
    peak = float(np.abs(load).max())
    firm = _guess(t, load, angle, 2.0)
    firm_error, firm = _refined(t, load, angle, (_error(t, load, angle, firm), firm))
    stiffness, damping, flow, limit = np.exp(best)
    if firm_error <= 1.03 * error or limit >= 0.999 * peak:
        error, (stiffness, damping) = firm_error, np.exp(firm[:2])
        flow = limit = np.inf
    return MeasuredBend(float(stiffness), float(damping), float(flow), float(limit), error)


def _first(item: tuple[float, Floats]) -> float:
    return item[0]


def _guess(t: Floats, load: Floats, angle: Floats, share: float) -> Floats:
    """Logarithms of K, D, D_d, τ if the joint first yields at a share of the greatest torque."""
    speed = np.gradient(angle, t)
    peak = float(np.abs(load).max())
    limit = share * peak
    above = np.abs(load) > limit
    end = int(np.argmax(above)) if above.any() else len(t)
    end = max(end, _FEW)
    system = np.stack([angle[:end], speed[:end]], axis=1)
    stiffness, damping = np.linalg.lstsq(system, load[:end], rcond=None)[0]
    most = float(np.abs(angle).max())
    stiffness = float(np.clip(stiffness, 1e-3 * peak / most, 1e6 * peak / most))
    damping = float(np.clip(damping, 1e-4 * stiffness, 1e3 * stiffness))
    flow = peak * (t[-1] - t[0]) / most
    if above.sum() >= _FEW:
        excess = float((np.abs(load[above]) - limit).sum())
        flow = max(excess, 1e-9) / max(float(np.abs(speed[above]).sum()), 1e-9)
    return np.log(np.array([stiffness, damping, max(flow, 1e-12), max(limit, 1e-9 * peak)]))


def _played(t: Floats, load: Floats, logarithms: Floats) -> Floats:
    """(samples,) angles of the element under the recorded torque, backward steps (eq. 17, 20)."""
    stiffness, damping, flow, limit = np.exp(logarithms)
    steps = np.diff(t, prepend=t[0])
    slid = np.cumsum(steps * np.sign(load) * np.maximum(np.abs(load) - limit, 0.0) / flow)
    spring = np.empty_like(load)
    value = 0.0
    kept = damping / (damping + stiffness * steps)
    fed = load * steps / (damping + stiffness * steps)
    for index in range(len(load)):
        value = kept[index] * value + fed[index]
        spring[index] = value
    return spring + slid


def _error(t: Floats, load: Floats, angle: Floats, logarithms: Floats) -> float:
    difference = _played(t, load, logarithms) - angle
    return float(np.sqrt(np.mean(difference * difference)))


def _refined(
    t: Floats, load: Floats, angle: Floats, start: tuple[float, Floats]
) -> tuple[float, Floats]:
    """Levenberg–Marquardt on the logarithms, which keeps all four positive."""
    error, best = start
    damp = 1e-2
    for _ in range(_ROUNDS):
        played = _played(t, load, best)
        slopes = np.stack(
            [(_played(t, load, best + 1e-5 * unit) - played) / 1e-5 for unit in np.eye(4)], axis=1
        )
        normal = slopes.T @ slopes
        scale = np.maximum(np.diag(normal), 1e-12 * np.trace(normal) + 1e-300)
        way = np.linalg.solve(normal + damp * np.diag(scale), slopes.T @ (angle - played))
        tried = best + np.clip(way, -1.0, 1.0)
        now = _error(t, load, angle, tried)
        if now < error:
            done = now > (1.0 - 1e-7) * error
            best, error, damp = tried, now, max(0.3 * damp, 1e-9)
            if done:
                break
        else:
            damp *= 5.0
            if damp > 1e8:
                break
    return error, best
