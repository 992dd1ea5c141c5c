# SPDX-License-Identifier: GPL-3.0-or-later
"""From what a device says to what it means: zero and range, learned, and how a push becomes speed.

The cap of an old space mouse does not come back quite to its middle, and does not reach as far as
its maker says; the middle of a force device's room is not always where its firmware counts from.
Both are learned: what the axes say at rest, and the least and the most that they ever say.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, fields
from enum import IntEnum
from math import copysign, isfinite
from typing import Final

import numpy as np

from ..core.errors import DeviceError
from ..core.phrases import phrase
from ..core.rotations import Floats
from ..core.rotations.scalars import subtract
from .driver import Axes, Kind, Sample, six

_ONES: Final[Axes] = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Response:
    """Speed at a push p of −1…1: ``gain · full speed · sign(p) · ((|p| − d) / (1 − d)) ^ curve``.

    Raises:
        DeviceError: a value is out of its range.
    """

    speed: float = 0.4
    """m/s at full push with gain 1."""
    angular_speed: float = 2.0
    """rad/s at full push with gain 1."""
    gain: Axes = _ONES
    """Any number; negative turns an axis round."""
    dead_zone: Axes = (0.05, 0.05, 0.05, 0.05, 0.05, 0.05)
    """0 to 0.9 of the full push, which does nothing."""
    curve: Axes = (1.5, 1.5, 1.5, 1.5, 1.5, 1.5)
    """0.2 to 5; 1 is proportional, above 1 is finer in the middle."""

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if not all(map(isfinite, value if isinstance(value, tuple) else (value,))):
                raise DeviceError(
                    phrase(
                        "The device's {setting} is not a number.",
                        setting=each.name.replace("_", " "),
                    ),
                    "Set it to a finite number.",
                )
        if not all(0.0 <= zone <= 0.9 for zone in self.dead_zone):
            raise DeviceError(
                "The device's dead zone is out of range.", "Choose a share from 0 to 0.9."
            )
        if not all(0.2 <= power <= 5.0 for power in self.curve):
            raise DeviceError(
                "The device's curve is out of range.", "Choose an exponent from 0.2 to 5."
            )

    def speeds(self, push: Axes) -> Axes:
        """m/s along and rad/s about the axes, for a push of −1…1 on each."""
        full = (self.speed,) * 3 + (self.angular_speed,) * 3
        return six(map(_response, push, full, self.gain, self.dead_zone, self.curve))


def _response(push: float, full: float, gain: float, zone: float, curve: float) -> float:
    beyond = min(1.0, abs(push)) - zone
    if beyond <= 0.0:
        return 0.0
    return copysign((beyond / (1.0 - zone)) ** curve, push) * gain * full


# --- Zero and range -------------------------------------------------------------------------------

_NOTHING: Final[Axes] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_REST_SECONDS: Final = 1.0
"""For so long the device must be left alone."""
_TREMBLES: Final = 0.05
"""Of the full push: by which a cap at rest changes at most."""
_FARTHEST_REST: Final = 0.5
"""Of the full push: a cap farther away is not at rest, but pushed."""
_LEAST_PUSH: Final = 0.2
"""Of the full push: an axis that got less far was not meant to be calibrated."""
_LEAST_WAY: Final = 0.01
"""m, likewise of a pose device."""
_EVERY: Final = 0.01
"""s between two values that are kept while the device is left alone."""


class Phase(IntEnum):
    """How far a calibration has come."""

    DONE = 0
    REST = 1
    """The device must be left alone."""
    REACH = 2
    """It is to be moved as far as it goes, each way."""
    FAILED = 3
    """It was not moved; what held before goes on."""


@dataclass(frozen=True)
class Calibration:
    """What a device says at rest, and at the ends of each axis.

    Of rate devices pushes, −1…1 by the maker's range; of others the position in metres, and zeros
    for turning.

    Raises:
        DeviceError: an axis has no range, or a number is not finite.
    """

    rest: Axes = _NOTHING
    least: Axes = (-1.0, -1.0, -1.0, -1.0, -1.0, -1.0)
    most: Axes = _ONES

    def __post_init__(self) -> None:
        numbers = [each for field in fields(self) for each in getattr(self, field.name)]
        ends = zip(self.least, self.rest, self.most, strict=True)
        if not all(map(isfinite, numbers)) or not all(a <= b <= c for a, b, c in ends):
            raise DeviceError("The device's calibration is damaged.", "Calibrate it again.")

    def push(self, raw: Axes) -> Axes:
        """−1…1 along each axis of a rate device, 0 at its own rest and 1 at its own end."""
        return six(map(_share, raw, self.rest, self.least, self.most))

    @property
    def width(self) -> float:
        """The longest way, in metres, of a pose device."""
        return max(most - least for least, most in zip(self.least[:3], self.most[:3], strict=True))


NONE: Final = Calibration()
"""Of a device that is as its maker says."""


def corrected(sample: Sample, kind: Kind, calibration: Calibration, response: Response) -> Sample:
    """What a device says, after its own zero and range; of a rate device also how fast it moves."""
    if kind is Kind.POSE:
        x, y, z = calibration.rest[:3]
        return sample._replace(position=subtract(sample.position, (x, y, z)))
    if sample.push is None:
        return sample
    x, y, z, a, b, c = response.speeds(calibration.push(sample.push))
    return sample._replace(velocity=(x, y, z), angular_velocity=(a, b, c))


def _share(raw: float, rest: float, least: float, most: float) -> float:
    end = most - rest if raw > rest else rest - least
    return max(-1.0, min(1.0, (raw - rest) / end)) if end > 0.0 else 0.0


class Calibrator:
    """Learns a device's zero and range from what it says.

    A rate device must first be left alone; of a pose device the middle of its way is the zero.
    """

    def __init__(self, kind: Kind) -> None:
        self.phase = Phase.REST if kind is Kind.RATE else Phase.REACH
        self._kind = kind
        self._quiet: deque[tuple[float, Axes]] = deque()
        self._rest = np.zeros(6)
        self._least: Floats | None = None
        self._most = self._rest

    def feed(self, now: float, sample: Sample) -> None:
        """Take what the device says now."""
        raw = (*sample.position, 0.0, 0.0, 0.0)
        if self._kind is Kind.RATE:
            raw = sample.push or _NOTHING
        if self.phase is Phase.REST:
            self._wait(now, raw)
        elif self.phase is Phase.REACH:
            first = self._least is None
            self._least = np.array(raw) if first else np.minimum(self._least, raw)
            self._most = np.array(raw) if first else np.maximum(self._most, raw)

    def _wait(self, now: float, raw: Axes) -> None:
        quiet = self._quiet
        if quiet and now - quiet[-1][0] < _EVERY:
            return
        quiet.append((now, raw))
        values = np.array([each for _, each in quiet])
        if np.ptp(values, axis=0).max() > _TREMBLES or abs(values[-1]).max() > _FARTHEST_REST:
            quiet.clear()
        elif now - quiet[0][0] >= _REST_SECONDS:
            self._rest = values.mean(axis=0)
            self.phase = Phase.REACH

    @property
    def so_far(self) -> Calibration:
        """What the device has said by now."""
        least, most = (self._rest, self._rest) if self._least is None else (self._least, self._most)
        if self._kind is Kind.POSE:
            return _calibration(0.5 * (least + most), least, most)
        rest = self._rest
        return _calibration(rest, np.minimum(rest, least), np.maximum(rest, most))

    def finish(self) -> Calibration:
        """What was learned; ends that were not reached are as on the other side, or as made.

        Raises:
            DeviceError: the device was not moved, or not left alone before.
        """
        learned = self.so_far
        if not reached(learned, self._kind)[0]:
            self.phase = Phase.FAILED
            raise DeviceError(
                "The device was not moved, so it was not calibrated.",
                "Leave it alone for a second, then move it as far as it goes, each way.",
            )
        self.phase = Phase.DONE
        if self._kind is Kind.POSE:
            return learned
        rest, down, up = _ways(learned)
        moved = np.maximum(down, up) >= _LEAST_PUSH
        least = rest - np.where(down < _LEAST_PUSH, up, down)
        most = rest + np.where(up < _LEAST_PUSH, down, up)
        return _calibration(rest, np.where(moved, least, -1.0), np.where(moved, most, 1.0))


def reached(learned: Calibration, kind: Kind) -> tuple[int, int]:
    """How many ends have been reached, and how many there are; of a room, how many of its ways."""
    _, down, up = _ways(learned)
    if kind is Kind.POSE:
        return int((down + up >= _LEAST_WAY)[:3].sum()), 3
    ways = np.concatenate([down, up])
    return int((ways >= _LEAST_PUSH).sum()), len(ways)


def _ways(learned: Calibration) -> tuple[Floats, Floats, Floats]:
    """(6,) the rest, and how far each axis goes below and above it."""
    rest = np.array(learned.rest)
    return rest, rest - learned.least, learned.most - rest


def _calibration(rest: Floats, least: Floats, most: Floats) -> Calibration:
    return Calibration(six(rest), six(least), six(most))
