# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the body is along a route on which it goes first one way and then another.

Each way of moving has its own place for the body at a distance along the route: over the ground,
upright; or through the water, mantle first. Where one becomes the other the body goes over, its
place in a straight line and its bearing by the shortest turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...errors import SettingsError
from ...phrases import phrase
from ...rotations import Floats, rotation_vector_between, slerp_in_sense
from ...smoothing import least_jerk
from ..gait import CYCLE
from ..rig import lift_to_floor
from .gait_changes import GaitTransition
from .route import Route
from .travel import (
    AlongRoute,
    Bearings,
    Travel,
    TravelSettings,
    raised_along,
    stroke_distance,
    travel_at,
    walked_at,
)


class Line(Protocol):
    """A body's places along its route, also before and after it."""

    @property
    def route(self) -> Route:
        """Where to."""
        ...

    @property
    def settings(self) -> TravelSettings:
        """How; its stride is that of the gait."""
        ...

    def at(self, distance: ArrayLike) -> tuple[Floats, Floats]:
        """World positions (…, 3) and orientations (…, 4) of the body at distances (…,)."""
        ...


@dataclass(frozen=True, eq=False)
class SwumLine:
    """A swimming body, which starts with a stroke."""

    route: Route
    settings: TravelSettings
    bearings: Bearings
    start: float
    """Metres along the route at which it is in the middle of a stroke."""
    height: float = 0.0
    """Metres above the route."""
    floor: Line | None = None
    """Where it would walk, none if there is no ground."""
    room: float = 0.0
    """Metres above that, below which it does not come …"""
    softness: float = 0.0
    """… and within which it comes near to that."""

    def phase(self, distance: Floats) -> Floats:
        """Phase of the gait (…,), radians."""
        return self.settings.stroke_phase + CYCLE * (distance - self.start) / self.settings.stride

    def travel(self, distance: Floats) -> Travel:
        """The body at distances (n,), where it shoots ahead of them and falls behind."""
        settings = self.settings
        phase = self.phase(distance)
        here = stroke_distance(phase, settings.burst, settings.stroke_phase) - phase
        middle = np.array(settings.stroke_phase)
        there = stroke_distance(middle, settings.burst, settings.stroke_phase) - middle
        along = distance + settings.stride / CYCLE * (here - there)
        return travel_at(self.route, settings, self.bearings, along, phase)

    def at(self, distance: ArrayLike) -> tuple[Floats, Floats]:
        """World positions (…, 3) and orientations (…, 4)."""
        wanted = np.asarray(distance, dtype=np.float64)
        travel = self.travel(wanted.reshape(-1))
        positions = travel.positions.copy()
        positions[:, 2] += self.height + raised_along(self.route, self.settings, travel.distance)
        if self.floor is not None:
            over = positions[:, 2] - self.floor.at(travel.distance)[0][:, 2] - self.room
            positions[:, 2] += lift_to_floor(over, self.softness)
        return positions.reshape(*wanted.shape, 3), travel.rotations.reshape(*wanted.shape, 4)


@dataclass(frozen=True, eq=False)
class WalkedLine:
    """A walking body that holds no ground."""

    route: Route
    settings: TravelSettings
    bearings: Bearings
    height: float
    """Metres above the route."""

    def at(self, distance: ArrayLike) -> tuple[Floats, Floats]:
        """World positions (…, 3) and orientations (…, 4)."""
        wanted = np.asarray(distance, dtype=np.float64)
        flat = wanted.reshape(-1)
        positions, rotations = walked_at(self.route, self.settings, self.bearings, flat)
        positions[:, 2] += self.height + raised_along(self.route, self.settings, flat)
        return positions.reshape(*wanted.shape, 3), rotations.reshape(*wanted.shape, 4)


@dataclass(frozen=True, eq=False)
class Course:
    """The body's places along the whole route."""

    lines: Sequence[Line]
    """One for each way."""
    changes: Sequence[GaitTransition]

    @cached_property
    def _senses(self) -> list[Floats]:
        """Which way round the body turns at each change, as it does half way."""
        found, way = [], 0
        for change in self.changes:
            middle = np.array([change.middle])
            (_, before), (_, after) = (self.lines[each].at(middle) for each in (way, change.way))
            found.append(rotation_vector_between(before, after)[0])
            way = change.way
        return found

    def at(self, distance: ArrayLike) -> tuple[Floats, Floats]:
        """World positions (…, 3) and orientations (…, 4) of the body at distances (…,)."""
        wanted = np.asarray(distance, dtype=np.float64)
        flat = wanted.reshape(-1)
        positions, rotations = self.lines[0].at(flat)
        for number, change in enumerate(self.changes):
            over = least_jerk((flat - change.start) / (change.end - change.start))
            later = over > 0.0
            if not np.any(later):
                continue
            place, bearing = self.lines[change.way].at(flat[later])
            share = over[later]
            positions[later] += share[:, None] * (place - positions[later])
            rotations[later] = slerp_in_sense(
                rotations[later], bearing, share, self._senses[number]
            )
        return positions.reshape(*wanted.shape, 3), rotations.reshape(*wanted.shape, 4)

    def line(self, way: int) -> CourseLine:
        """The course as the walker of one way needs it."""
        return CourseLine(self, self.lines[way].route, self.lines[way].settings)


@dataclass(frozen=True, eq=False)
class CourseLine:
    """The places of the whole course, with the stride of one of its ways."""

    course: Course
    route: Route
    settings: TravelSettings

    def at(self, distance: ArrayLike) -> tuple[Floats, Floats]:
        """World positions (…, 3) and orientations (…, 4) of the body at distances (…,)."""
        return self.course.at(distance)


# --- Motion in place that repeats: whole cycles of a gait -----------------------------------------
#
# The arms' phases are whole turns apart at the two ends, whatever offsets they have and whatever
# the gait; so the last frame is the first one in position, and what comes after the first frame
# is what would come after the last: the seam is a moment like any other.


def route_in_place(stride: float, cycles: int) -> Route:
    """A straight way that takes so many strides, metres: what a body in place would have travelled.

    Raises:
        SettingsError: there is not one whole cycle.
    """
    if cycles < 1:
        raise SettingsError(
            phrase("The loop has {cycles} cycles.", cycles=cycles), "Give at least 1."
        )
    return Route.poly([[0.0, 0.0, 0.0], [0.0, -stride * cycles, 0.0]])


def travel_in_place(travel: TravelSettings) -> TravelSettings:
    """The same gait at even speed from the first frame to the last, everywhere the same."""
    return replace(travel, speed="EVEN", ease_in=0.0, ease_out=0.0, stalk=0.0, along=AlongRoute())


def whole_frames(frames: float) -> float:
    """As many frames as a loop of about that length has."""
    return float(max(round(frames), 2))
