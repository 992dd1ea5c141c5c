# SPDX-License-Identifier: GPL-3.0-or-later
"""What a device's reports show, beside what they say: how old they are, how fast, how late.

A device may say of itself what is not so, from haste, damage or an old firmware. Damping by a speed
that is not there drives the hand, a report that is sent again and again looks like a hand that
stands still, and a spring is safe only for the delay that it was made for.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import Final

from ...core.rotations.scalars import (
    Vector,
    add,
    clamp_length,
    conjugate,
    length,
    multiply,
    scale,
    subtract,
    to_rotation_vector,
)
from ..driver import Dynamics, Kind, Sample
from .force import gains_for
from .passivity import DOUBTED

_LOOKS_BACK: Final = 0.004
"""s over which positions show a speed."""
_SPEED_OFF: Final = 0.02
_TURN_OFF: Final = 0.2
_SHARE_OFF: Final = 0.25
"""m/s, rad/s, and a share of it: by which a speed that is told may differ from what is seen."""
_CLOCKS_OFF: Final = 1e-3
"""Share of time by which a device's clock may be slower than ours."""
_LEARNS: Final = 0.1
_NOTED: Final = 5e-5
_LATEST: Final = 0.1
"""s over which a device's delay is measured, by which it changes something, and at most."""


class Evidence:
    """What is known of a device by what it did, sample by sample."""

    def __init__(self, device: Dynamics, period: float, kind: Kind) -> None:
        self._device, self._period, self._kind = device, period, kind
        self.gains = gains_for(device, period)
        """Of the coupling, for the delay that is told or measured, whichever is longer."""
        self._late = self._softened = device.delay
        """s, as measured, and as the gains have it."""
        self.doubt = DOUBTED
        """s: forces are under way no longer than this, by what the device shows."""
        self._behind = 0.0
        """s by which the device's clock is behind ours at the least."""
        self._clock = -math.inf
        """What it said last."""
        self.clock_moved = math.inf
        """When it last said something else; a device without a clock never stands still."""
        self._way: deque[Sample] = deque()
        """The samples of the last moment."""

    def of(self, sample: Sample) -> Sample:
        """A sample as it must be taken: its age by the device's clock, its speed by its way."""
        if self._kind is not Kind.POSE:
            return sample
        self._measure_delay(sample)
        return self._believed(self._aged(sample))

    def _aged(self, sample: Sample) -> Sample:
        """As old as the device's own clock says.

        A clock that stands still or falls behind is that of a report that is sent again and again,
        or has waited somewhere. One that goes back is another one.
        """
        clock, last = sample.clock, self._clock
        if clock is None:
            return sample
        behind = sample.time - clock
        if clock < last or last == -math.inf or behind < self._behind:
            self._behind = behind
        elif clock > last:
            self._behind += _CLOCKS_OFF * (clock - last)
        if clock != last:
            self.clock_moved = sample.time
        self._clock = clock
        return sample._replace(time=sample.time - max(0.0, behind - self._behind))

    def _measure_delay(self, sample: Sample) -> None:
        """Learn how late forces come; soften the coupling for a device that is later than it says.

        Forces are as late as the newest that had reached it was, but for the loop's own period.
        """
        if self._device.force <= 0.0:
            return
        shown = min(DOUBTED, sample.delay + self._period) if sample.delay else DOUBTED
        if sample.delay and shown > self.doubt:
            self.doubt = shown
        else:
            self.doubt += min(1.0, self._period / _LEARNS) * (shown - self.doubt)
        if not sample.delay:
            return
        late = max(self._device.delay, min(_LATEST, sample.delay - self._period))
        self._late += min(1.0, self._period / _LEARNS) * (late - self._late)
        if abs(self._late - self._softened) > _NOTED:
            self._softened = self._late
            self.gains = gains_for(replace(self._device, delay=self._late), self._period)

    def _believed(self, sample: Sample) -> Sample:
        """With the speed that positions show, or nearly that if the device tells one.

        What it says of its speed is finer than what its positions show, and comes sooner.
        """
        way = self._way
        while len(way) > 1 and sample.time - way[1].time >= _LOOKS_BACK:
            way.popleft()
        seconds = sample.time - way[0].time if way else 0.0
        if seconds > 0.0:
            first, device = way[0], self._device
            moved = scale(subtract(sample.position, first.position), 1.0 / seconds)
            turned = to_rotation_vector(multiply(sample.orientation, conjugate(first.orientation)))
            coarse, coarse_turn = device.resolution / seconds, device.angular_resolution / seconds
            spun = scale(turned, 1.0 / seconds)
            sample = sample._replace(
                velocity=_near(sample.velocity, moved, _SPEED_OFF + coarse),
                angular_velocity=_near(sample.angular_velocity, spun, _TURN_OFF + coarse_turn),
            )
        if not way or sample.time > way[-1].time:
            way.append(sample)
        return sample


def _near(told: Vector, seen: Vector, off: float) -> Vector:
    """What is told of a speed, as far as it is near what is seen."""
    return add(seen, clamp_length(subtract(told, seen), off + _SHARE_OFF * length(seen)))
