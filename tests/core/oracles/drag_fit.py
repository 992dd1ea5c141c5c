# SPDX-License-Identifier: GPL-3.0-or-later
"""An element fitted to the record of a joint that was bent, held and let go.

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

from typing import Final

import numpy as np

from octo_motion.core.posing.puppet import MeasuredBend
from octo_motion.core.rotations import Floats

_SPLITS: Final = 24
_FEW: Final = 12
_ROUNDS: Final = 60
_TRIED: Final = 3


def measure(times: Floats, torques: Floats, angles: Floats) -> MeasuredBend:
    """Fit an element to a recorded drag.

    Args:
        times: (samples,) seconds, ascending.
        torques: (samples,) N·m applied to the joint about one axis.
        angles: (samples,) radians that it has turned since it was relaxed.

    Raises:
        ValueError: too short a record, or one in which nothing happens.
    """
    t, load, angle = (np.asarray(array, dtype=np.float64) for array in (times, torques, angles))
    finite = all(bool(np.isfinite(array).all()) for array in (t, load, angle))
    if len(t) < 2 * _FEW or not finite or np.any(np.diff(t) <= 0.0):
        raise ValueError("The recorded drag is too short or broken.")
    if np.ptp(load) <= 0.0 or np.ptp(angle) <= 0.0:
        raise ValueError("Nothing moved in the recorded drag.")
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
        stiffness, damping = np.exp(firm[:2])
        flow = limit = np.inf
    return MeasuredBend(float(stiffness), float(damping), float(flow), float(limit))


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
