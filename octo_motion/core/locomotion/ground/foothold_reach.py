# SPDX-License-Identifier: GPL-3.0-or-later
"""How far out an arm touches the ground, and for how long it can hold on there.

Everything is by arm and cycle at once, (arms, cycles): there are some hundred footholds to a route.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats
from .stance_settings import Limbs, StanceSettings, touching
from .surface import Ground

PEELING: Final = 0.5
"""Share of a stance in which the arm is peeled off towards its tip, as the body pulls. At 0.2 an
octopus that walks over bumps slips by 0.0014 arm lengths instead of 0.0005."""
_SLACK: Final = 0.84
"""Distance from root to where an arm is peeled off, as a share of it, that peels no more."""
_FEW: Final = 2
"""Joints that lie down of an arm that is too stiff to be peeled off."""
_LEFT: Final = 0.4
"""Share of the part that lies down which is not peeled off, but let go with the tip: with none of
it the last bones snap, by 0.106 of a quaternion's component from step to step instead of 0.088."""
_EASY: Final = 0.80
"""Distance from root to foothold half way through, as a share of the arm between them. At 0.9 arms
stretch by 0.26 instead of 0.25 and overlap by 0.073 radii instead of 0.057."""
_UPRIGHT: Final = 0.76
"""The same under a body that is as high as arms can bear: where it is lower, it is more."""
_TAUT: Final = 0.94
"""The same at its longest. At 0.99 arms stretch by 0.28 instead of 0.25."""
_SLACKEST: Final = 0.55
"""The same at its shortest: an arm that is slacker has to fold."""
_SHORTER: Final = 0.5
"""Share of the most stretch by which a bone that may stretch may get shorter."""
_STRETCHED: Final = 0.6
"""Share of the most stretch that footholds are laid for."""
_NEAREST: Final = 0.20
"""Arm lengths from the root, seen from above."""
_CLOSEST: Final = 0.05
"""The same where there is no other way."""
_SHORTENED: Final = (1.0, 0.85, 0.7, 0.55, 0.4, 0.25)
"""Shares of its time that a hold may be cut down to where the body moves on too far."""
_NEAR, _NEARER = 0.60, 0.28
_FAR, _FARTHER = 0.94, 0.47
"""Shares of the free part of an arm between which a place may be that it pushes away from, and by
how much more these are for each length that it may get longer by."""
_ROUNDS: Final = 3
"""How often a foothold is moved, and the ground under it looked at again."""


@dataclass(frozen=True, eq=False)
class Spots:
    """Where arms touch, and for how long."""

    distance: Floats
    """(arms, cycles) metres from the root, seen from above."""
    half: Floats
    """(arms, cycles) cycles that half of the hold lasts."""
    short: Floats
    """(arms, cycles) metres that it is out of reach."""


@dataclass(frozen=True, eq=False)
class _Reach:
    """How far arms reach while they hold on, metres (arms, 1)."""

    free: Floats
    """Length up to where they touch."""
    whole: Floats
    peeled: Floats
    """How much of what lies is peeled off as the hold ends."""
    longer: float
    """Factor that they may stretch by."""
    slackest: Floats
    """Distance from root to foothold below which they have to fold."""


class Passing:
    """Where the body carries the arms' roots, at times since the middle of each hold."""

    def __init__(self, roots: Floats, seen: Sequence[Floats]) -> None:
        self.middle = roots
        """(arms, cycles, 3) half way through, world."""
        self.touch_down, self.peeling, self.lift_off = seen
        """The same as the hold begins, as peeling begins, and as the hold ends."""


def span(settings: StanceSettings, *, may_stretch: bool) -> tuple[float, float]:
    """From where to where, seen from its root, an arm holds on with ease while the body passes.

    Arm lengths. Nearer an arm folds, farther it cannot; one that may get longer need not begin as
    near.
    """
    free = 1.0 - settings.planted
    longer = settings.stretch * may_stretch
    return (_NEAR + _NEARER * longer) * free, (_FAR + _FARTHER * longer) * free


def easy_height(
    reach: Floats, radii: Floats, settings: StanceSettings, *, may_stretch: bool
) -> float:
    """How far above the ground an arm may begin and still hold on with ease.

    Args:
        reach: (segments + 1,) along it to each joint.
        radii: (segments + 1,) from each joint to the skin below it.
        settings: how it holds on.
        may_stretch: whether its bones may get longer.
    """
    joint = touching(reach, settings.planted)
    longer = 1.0 + _STRETCHED * settings.stretch * may_stretch
    level = (_UPRIGHT * longer * reach[joint]) ** 2 - (_NEAREST * reach[-1]) ** 2
    return float(np.sqrt(max(level, 0.0)) + radii[joint])


def stance_times(settings: StanceSettings) -> tuple[tuple[float, float, float], ...]:
    """Times that :func:`spots` wants to know the roots at, for holds cut down more and more."""
    return tuple(
        (-0.5 * width, (0.5 - PEELING) * width, 0.5 * width)
        for width in (settings.duty * share for share in _SHORTENED)
    )


def spots(
    limbs: Limbs,
    ground: Ground,
    settings: StanceSettings,
    passings: Iterable[Passing],
    *,
    aim: Floats,
    away: Floats,
) -> Spots:
    """Footholds as far out as an arm holds on with ease, and near enough to be kept.

    Args:
        limbs: the arms.
        ground: what they touch.
        settings: how they hold on.
        passings: the body's, for each of :func:`stance_times`.
        aim: (arms, cycles, 2) unit vectors in which the arms are to touch, world.
        away: (arms, cycles) metres from the root, seen from above, at which they are to do so if
            they can; nan for where it is easy.
    """
    reach = _reach(limbs, settings)
    shape = aim.shape[:2]
    distance, half, short = np.zeros(shape), np.zeros(shape), np.full(shape, np.inf)
    undecided = np.ones(shape, dtype=bool)
    for times, passing in zip(stance_times(settings), passings, strict=False):
        found, lack = _spot(ground, reach, passing, aim, away)
        better = undecided & (lack < short)
        distance = np.where(better, found, distance)
        half = np.where(better, times[2], half)
        short = np.where(better, lack, short)
        undecided &= short > 0.0
        if not np.any(undecided):
            break
    return Spots(distance, half, np.maximum(short, 0.0))


def _reach(limbs: Limbs, settings: StanceSettings) -> _Reach:
    along = limbs.reach
    joint = limbs.touching(settings.planted)
    free, whole = along[joint][:, None], along[-1][:, None]
    stiff = len(along) - joint <= _FEW
    stretch = settings.stretch * limbs.may_stretch
    return _Reach(
        free=free,
        whole=whole,
        peeled=(0.0 if stiff else 1.0 - _LEFT) * (whole - free),
        longer=1.0 + _STRETCHED * stretch,
        slackest=_SLACKEST * (1.0 - _SHORTER * stretch) * free,
    )


def _spot(
    ground: Ground, reach: _Reach, passing: Passing, aim: Floats, away: Floats
) -> tuple[Floats, Floats]:
    """Distances from the root, and metres that these are wrong by, both (arms, cycles)."""
    roots, nearest = passing.middle, _NEAREST * reach.whole
    taut = _TAUT * reach.longer
    held = (
        (passing.touch_down, taut * reach.free, 0.0 * reach.free),
        (passing.peeling, taut * reach.free, 0.0 * reach.free),
        (passing.lift_off, taut * (reach.free + reach.peeled), reach.peeled),
    )
    found = np.broadcast_to(0.5 * reach.free, aim.shape[:2])
    lack = np.zeros(aim.shape[:2])
    for _ in range(_ROUNDS):
        z = ground.height(roots[..., :2] + found[..., None] * aim)
        easy = (_EASY * reach.free) ** 2 - (roots[..., 2] - z) ** 2
        least = np.broadcast_to(nearest, z.shape)
        for root in (passing.touch_down, roots, passing.lift_off):
            onto = np.sum((root[..., :2] - roots[..., :2]) * aim, axis=-1)
            slackest = reach.slackest**2 - (root[..., 2] - z) ** 2
            least = np.maximum(least, onto + np.sqrt(np.maximum(slackest, nearest**2)))
        lack, farthest = np.zeros(z.shape), np.full(z.shape, np.inf)
        for root, far, beyond in held:
            level = far**2 - (root[..., 2] - z) ** 2
            apart = roots[..., :2] - root[..., :2]
            # |apart + d aim|² ≤ level, for the largest d.
            onto = np.sum(apart * aim, axis=-1)
            inside = onto**2 - np.sum(apart**2, axis=-1) + level
            largest = np.sqrt(np.maximum(inside, 0.0)) - onto - beyond
            lack = np.maximum(lack, np.where(inside < 0.0, reach.whole, least - largest))
            farthest = np.minimum(farthest, largest)
        easily = np.sqrt(np.maximum(easy, nearest**2))
        limit = np.minimum(np.where(np.isnan(away), easily, away), farthest)
        # What is too near looks bad, but what is too far slides.
        found = np.minimum(np.maximum(limit, least), np.maximum(farthest, _CLOSEST * reach.whole))
    return found, lack


def peeled_to(limbs: Limbs, joint: int, joints: Floats, roots: Floats) -> Floats:
    """Metres along the arm (arms, cycles) up to which a body at its farthest peels it off.

    Args:
        limbs: the arms.
        joint: the one that touches first.
        joints: (arms, cycles, joints, 3) from that one on, as they lie, world.
        roots: (arms, cycles, 3) where the arms' roots are then, world.
    """
    along = limbs.reach[joint:]
    first, last = along[0][:, None], along[-1][:, None]
    result = np.broadcast_to(first, roots.shape[:2]).copy()
    if len(along) <= _FEW:
        return result
    arms, cycles = np.indices(result.shape)
    for share in np.linspace(0.0, 1.0 - _LEFT, 16):
        place = share * (last - first) + first
        number = np.clip((along[1:-1, :, None] < place).sum(axis=0), 0, len(along) - 2)
        number = np.broadcast_to(number, result.shape)
        low, high = along[number, arms], along[number + 1, arms]
        within = ((place - low) / (high - low))[..., None]
        start, end = joints[arms, cycles, number], joints[arms, cycles, number + 1]
        apart = np.linalg.norm(start + within * (end - start) - roots, axis=-1)
        result = np.where(apart >= _SLACK * place, np.maximum(result, place), result)
    return result
