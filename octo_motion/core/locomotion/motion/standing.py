# SPDX-License-Identifier: GPL-3.0-or-later
"""A walk that holds the ground: the ground under its way, its height over it, its footholds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...content_cache import ContentCache, content_key
from ...rotations import Floats
from ..gait import GaitPoser
from ..ground import (
    BodyLine,
    ContactOverride,
    ContactTiming,
    CrawlingBody,
    CrawlSettings,
    EvenTiming,
    Ground,
    GroundedWalk,
    LevelGround,
    StanceSettings,
    body_line,
    crawling,
    crawling_in_place,
    easy_height,
    ground_along_path,
    leaning,
    passes_over_itself,
    sample_ground,
    span,
    timing_at_rest,
)
from ..path import Bearings, Line, Route, Travel, TravelSettings, bearings_of, strides, walked_at
from .job import Creature, GroundJob

_FINE: Final = 0.03
"""Arm lengths between the samples of a ground …"""
_COARSE: Final = 0.1
"""… and of one that only follows the route."""
_AROUND: Final = 1.8
"""Arm lengths to all sides of the route that the ground is sampled."""
_HEADROOM: Final = 2.0
"""Arm lengths above the route up to which a surface is ground and not a roof."""
_LOWEST: Final = 0.12
"""Arm lengths that a body is above its ground at least."""
_PATH_STEP: Final = 0.1
"""Arm lengths between the points of the route that the ground is looked for under."""

_OVER_ITSELF: Final = (
    "The route passes over itself: the ground between its levels is half way up. Choose a mesh as "
    "the ground, or switch Hold the Ground off."
)

_grounds: Final[ContentCache[Ground]] = ContentCache(2)


@dataclass(frozen=True, eq=False)
class Standing:
    """A walk's ground and its way over it; :meth:`walk` lays the footholds."""

    creature: Creature
    poser: GaitPoser
    job: GroundJob
    line: BodyLine
    bearings: Bearings
    ground: Ground
    timing: ContactTiming | None
    """When arms hold on; none for the gait's own."""
    phases: tuple[float, float]
    """The first and the last of the body's phases, radians."""
    cyclic: bool
    """Whether each cycle is like the one before: a loop in place."""
    warnings: tuple[str, ...] = ()

    @property
    def stretching(self) -> bool:
        """Whether any bones may stretch."""
        return any(self.job.may_stretch)

    @property
    def radii(self) -> list[Floats]:
        """For each arm (bones + 1,) armature units from each joint to the skin below it."""
        return [each.radii for each in self.job.skins]

    def place(self, travel: Travel) -> tuple[Floats, Floats]:
        """World positions (frames, 3) and orientations (frames, 4) of the canonical body."""
        centres, upright = self.line.ride(travel.positions, travel.distance)
        return centres, leaning(upright, travel.rotations)

    def walk(self, line: Line, overrides: Sequence[ContactOverride]) -> GroundedWalk:
        """The walk with its footholds.

        Args:
            line: the body's way: this walk's own, or one that other ways of moving are part of.
            overrides: the artist's, for single contacts.
        """
        creature = self.creature
        return GroundedWalk(
            creature.skeleton,
            self.poser,
            creature.body,
            line,
            self.ground,
            settings=self.job.stance,
            scale=creature.scale,
            radii=self.radii,
            may_stretch=self.job.may_stretch,
            phases=self.phases,
            contact_overrides=overrides,
            timing=self.timing,
            cyclic=self.cyclic,
            skins=self.job.skins,
        )


def stand(
    creature: Creature,
    poser: GaitPoser,
    job: GroundJob,
    route: Route,
    travel: TravelSettings,
    *,
    height: float | None,
    plane: float | None = None,
    cyclic: bool = False,
) -> Standing:
    """Find the ground under a walk, its height over it, and when its arms hold on.

    Args:
        creature: whose walk it is.
        poser: its gait.
        job: the ground, and how arms hold on to it.
        route: where to.
        travel: how it travels.
        height: metres from the ground to the body's centre, none for as high as the gait is.
        plane: world Z of the level ground where no mesh is set, none to follow the route.
        cyclic: whether each cycle is like the one before, on level ground: for a loop in place.

    Raises:
        GroundError: the route leaves the ground.
    """
    scale, warnings, bearings = creature.scale, job.warnings, bearings_of(route, travel)
    if cyclic:
        ground, warnings = LevelGround(0.0), ()
    elif job.mesh is None and plane is not None:
        ground = LevelGround(plane)
    else:
        reach = poser.arm_length * scale
        ground, more = _ground(job.mesh, route, travel, bearings, reach=reach)
        warnings = (*more, *warnings)
    under = _under(poser, [each.radii for each in job.skins])
    line = body_line(
        route,
        travel,
        bearings,
        ground,
        clearance=_height(poser, job, under) * scale if height is None else height,
        reach=poser.arm_length * scale,
        lean=job.stance.lean,
        smoothing=job.stance.smoothing,
        under=under * scale,
    )
    return Standing(
        creature=creature,
        poser=poser,
        job=job,
        line=line,
        bearings=bearings,
        ground=ground,
        timing=_timing(poser, job, line, route, scale=scale, cyclic=cyclic),
        phases=(0.0, 2.0 * np.pi * strides(route, travel)),
        cyclic=cyclic,
        warnings=warnings,
    )


def _timing(
    poser: GaitPoser, job: GroundJob, line: BodyLine, route: Route, *, scale: float, cyclic: bool
) -> ContactTiming | None:
    """When arms hold on, where that is not the gait's own even timing."""
    gait, stance, timing = poser.settings.gait, job.stance, None
    if gait.manner == "CRAWL":
        near, far = span(stance, may_stretch=any(job.may_stretch))
        settings = CrawlSettings(near, far, planted=stance.planted, seed=poser.settings.seed)
        body = CrawlingBody(
            line,
            poser.roots * scale,
            poser.outward,
            reach=poser.arm_length * scale,
            middle=gait.power_phase,
            duty=stance.duty,
        )
        timing = crawling_in_place(body, settings) if cyclic else crawling(body, settings, job.rest)
    if not any(job.rest):
        return timing
    return timing_at_rest(
        timing or EvenTiming(line.settings.stride, poser.offsets),
        route.length,
        start=job.rest[0],
        end=job.rest[1],
        middle=gait.power_phase,
        duty=stance.duty,
    )


def _under(poser: GaitPoser, radii: Sequence[Floats]) -> float:
    """How far a body's skin reaches below its centre where its arms begin, armature units."""
    skins = [radius[0] - root[2] for radius, root in zip(radii, poser.roots, strict=True)]
    return float(max(skins))


def _height(poser: GaitPoser, job: GroundJob, under: float) -> float:
    """As high as the gait is, and as low as arms reach with ease, armature units."""
    radii = [each.radii for each in job.skins]
    thickness = float(np.mean([each[len(each) // 2] for each in radii]))
    easy = _within_reach(poser, radii, job.may_stretch, job.stance)
    return max(min(poser.clearance + thickness, easy), under, _LOWEST * poser.arm_length)


def _within_reach(
    poser: GaitPoser, radii: Sequence[Floats], stretches: Sequence[bool], stance: StanceSettings
) -> float:
    """Greatest height at which all arms hold the ground with ease, armature units.

    What a gait asks for may be more than arms are long before they come to lie.
    """
    gait, heights = poser.settings.gait, [np.inf]
    for build in poser.builds:
        along = np.concatenate([[0.0], np.cumsum(build.chain.lengths)])
        for arm in build.arms:
            if not gait.curve(poser.arms[arm].pair).free:
                reach = along * poser.lengths[arm]
                easy = easy_height(reach, radii[arm], stance, may_stretch=stretches[arm])
                heights.append(easy - poser.roots[arm][2])
    return min(heights)


def _ground(
    mesh: tuple[Floats, bytes] | None,
    route: Route,
    travel: TravelSettings,
    bearings: Bearings,
    *,
    reach: float,
) -> tuple[Ground, tuple[str, ...]]:
    """The ground of a walk, and what there is to warn of."""
    beyond = 0.0 if route.cyclic else travel.stride + reach
    count = int(np.ceil((route.length + 2.0 * beyond) / (_PATH_STEP * reach))) + 1
    distance = np.linspace(-beyond, route.length + beyond, count)
    path, _ = walked_at(route, travel, bearings, distance)
    if mesh is None:
        warnings = ()
        if passes_over_itself(path, 0.5 * reach, 0.5 * reach):
            warnings = (_OVER_ITSELF,)
        around, spacing = _AROUND * reach, _COARSE * reach
        ground = ground_along_path(path, reach=around, spacing=spacing, softness=0.3 * reach)
        return ground, warnings
    inside = (distance >= 0.0) & (distance <= route.length)
    triangles, content = mesh
    sizes = {"reach": _AROUND * reach, "spacing": _FINE * reach, "headroom": _HEADROOM * reach}
    ground = _grounds.get(
        content_key(content, path, inside, sizes),
        lambda: sample_ground(triangles, path, inside, **sizes, content=content),
    )
    return ground, ()
