# SPDX-License-Identifier: GPL-3.0-or-later
"""A walk's ground, from the settings to what core works with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import bpy
import numpy as np

from ....blender.animation import may_stretch
from ....blender.scene import arm_skins, is_enabled, read_triangles
from ....core.content_cache import ContentCache, content_key
from ....core.locomotion.gait import Arm, GaitPoser
from ....core.locomotion.ground import (
    BodyLine,
    ContactOverride,
    CrawlSettings,
    EvenTiming,
    Ground,
    GroundedPoses,
    GroundedWalk,
    LevelGround,
    Raise,
    StanceSettings,
    SwingSmoothing,
    body_line,
    crawling,
    crawling_in_place,
    easy_height,
    frames_around,
    ground_along_path,
    leaning,
    passes_over_itself,
    sample_ground,
    span,
    timing_at_rest,
)
from ....core.locomotion.path import (
    Bearings,
    Line,
    Route,
    Travel,
    TravelSettings,
    bearings_of,
    strides,
    walked_at,
)
from ....core.locomotion.rig import BodyFrame
from ....core.rotations import Floats
from ....core.skeleton import Skeleton
from ..settings.ground import OCTO_MOTION_PG_ground, stance_settings
from ..settings.properties import OCTO_MOTION_PG_locomotion

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


_BARE: Final = (
    "The ground '{name}' is disabled in viewports or excluded: its modifiers do not count. Hide it "
    "with its eye in the outliner instead."
)

_grounds: Final[ContentCache[Ground]] = ContentCache(2)


@dataclass(frozen=True, eq=False)
class Standing:
    """A walk that holds the ground, ready to be computed."""

    walk: GroundedWalk
    line: BodyLine
    bearings: Bearings
    stretching: bool
    """Whether any bones may stretch."""
    build: Callable[[Line, Sequence[ContactOverride]], GroundedWalk]
    """The same walk along another line, with other wishes."""
    ground: Ground
    warnings: tuple[str, ...] = ()

    def place(self, travel: Travel) -> tuple[Floats, Floats]:
        """World positions (frames, 3) and orientations (frames, 4) of the canonical body."""
        centres, upright = self.line.ride(travel.positions, travel.distance)
        return centres, leaning(upright, travel.rotations)

    def pose(
        self,
        travel: Travel,
        part: slice | np.ndarray,
        places: tuple[Floats, Floats],
        higher: Raise | None = None,
    ) -> GroundedPoses:
        """The arms at some of the frames, whose places :meth:`place` has found.

        Args:
            travel: the body's.
            part: which frames.
            places: of all frames.
            higher: arms that are to be higher, of which alone there is to be said something.
        """
        centres, orientations = places
        phase, turn = travel.phase[part], travel.turn[part]
        return self.walk.pose(phase, turn, centres[part], orientations[part], higher)

    def pose_steadily(
        self,
        travel: Travel,
        part: slice,
        places: tuple[Floats, Floats],
        steady: SwingSmoothing | None,
        *,
        cyclic: bool,
    ) -> GroundedPoses:
        """The arms at frames that follow one another, evened out over time in the air.

        Args:
            travel: the body's.
            part: which frames, from one to another.
            places: of all frames.
            steady: how they are evened out, none for each frame by itself.
            cyclic: whether the last frame is the first again.
        """
        if steady is None:
            return self.pose(travel, part, places)
        centres, orientations = places
        frames, own = frames_around(part, steady.reach, len(centres), cyclic=cyclic)
        phase, turn = travel.phase[frames], travel.turn[frames]
        stood = self.walk.pose(phase, turn, centres[frames], orientations[frames], smoothing=steady)
        return stood.part(own)


def resting(settings: OCTO_MOTION_PG_locomotion) -> tuple[bool, bool]:
    """Whether all arms lie on the ground at the start of a walk, and at its end."""
    ground = settings.ground
    if not ground.use or settings.travel_on == "NONE":
        return False, False
    return (
        ground.start_at_rest and settings.ease_in > 0.0,
        ground.come_to_rest and settings.ease_out > 0.0,
    )


def read_standing(
    settings: OCTO_MOTION_PG_ground,
    armature: bpy.types.Object,
    depsgraph: bpy.types.Depsgraph,
    *,
    skeleton: Skeleton,
    skin: Skeleton,
    arms: Sequence[Arm],
    generator: GaitPoser,
    body: BodyFrame,
    route: Route,
    travel: TravelSettings,
    scale: float,
    height: float | None,
    wishes: Sequence[ContactOverride],
    plane: float | None = None,
    alike: bool = False,
    rest: tuple[bool, bool] = (False, False),
) -> Standing:
    """Read the ground under a walk, and lay its footholds.

    Args:
        settings: how it stands.
        armature: the armature object.
        depsgraph: the evaluated scene.
        skeleton: the rig, as its arms hang.
        skin: the rig at rest, as its skin is made for.
        arms: its arms.
        generator: its gait.
        body: where the body lies in armature space.
        route: where to.
        travel: how it travels.
        scale: metres of the armature's unit.
        height: metres from the ground to the body's centre, none for as high as the gait is.
        wishes: the artist's, for single contacts.
        plane: world Z of the level ground where no mesh is set, none to follow the route.
        alike: whether each cycle is like the one before, on level ground: for a loop in place.
        rest: whether all arms lie on the ground at the start, and at the end.

    Raises:
        GroundError: the ground is no mesh, has no faces, or the route leaves it.
    """
    stance = stance_settings(settings)
    reach = generator.arm_length * scale
    bearings = bearings_of(route, travel)
    if alike:
        ground, warnings = LevelGround(0.0), ()
    elif settings.object is None and plane is not None:
        ground, warnings = LevelGround(plane), ()
    else:
        ground, warnings = _ground(
            settings, depsgraph, route=route, travel=travel, bearings=bearings, reach=reach
        )
    skins = arm_skins(armature, skin, [arm.bones for arm in arms])
    radii = [each.radii for each in skins]
    stretch = [may_stretch(armature, arm.bones) for arm in arms]
    under = _under(generator, radii)
    if height is None:
        thickness = float(np.mean([each[len(each) // 2] for each in radii]))
        height = min(
            generator.clearance + thickness, _within_reach(generator, radii, stretch, stance)
        )
        height = max(height, under, _LOWEST * generator.arm_length) * scale
    line = body_line(
        route,
        travel,
        bearings,
        ground,
        clearance=height,
        reach=reach,
        lean=stance.lean,
        smoothing=stance.smoothing,
        under=under * scale,
    )
    rhythm = None
    gait = generator.settings.gait
    if gait.manner == "CRAWL":
        near, far = span(stance, may_stretch=any(stretch))
        make = crawling_in_place if alike else partial(crawling, stands=rest)
        rhythm = make(
            line,
            generator.roots * scale,
            generator.outward,
            CrawlSettings(near, far, planted=stance.planted, seed=generator.settings.seed),
            reach=reach,
            middle=gait.power_phase,
            duty=stance.duty,
        )
    if any(rest):
        rhythm = timing_at_rest(
            rhythm or EvenTiming(travel.stride, generator.offsets),
            route.length,
            start=rest[0],
            end=rest[1],
            middle=gait.power_phase,
            duty=stance.duty,
        )

    def build(along: Line, wished: Sequence[ContactOverride]) -> GroundedWalk:
        return GroundedWalk(
            skeleton,
            generator,
            body,
            along,
            ground,
            settings=stance,
            scale=scale,
            radii=radii,
            may_stretch=stretch,
            phases=(0.0, 2.0 * np.pi * strides(route, travel)),
            contact_overrides=wished,
            timing=rhythm,
            cyclic=alike,
            skins=skins,
        )

    walk = build(line, wishes)
    return Standing(walk, line, bearings, any(stretch), build, ground, warnings)


def _under(generator: GaitPoser, radii: Sequence[Floats]) -> float:
    """How far a body's skin reaches below its centre where its arms begin, armature units."""
    skins = [radius[0] - root[2] for radius, root in zip(radii, generator.roots, strict=True)]
    return float(max(skins))


def _within_reach(
    generator: GaitPoser, radii: Sequence[Floats], stretches: Sequence[bool], stance: StanceSettings
) -> float:
    """Greatest height at which all arms hold the ground with ease, armature units.

    What a gait asks for may be more than arms are long before they come to lie.
    """
    gait, heights = generator.settings.gait, [np.inf]
    for build in generator.builds:
        along = np.concatenate([[0.0], np.cumsum(build.chain.lengths)])
        for arm in build.arms:
            if not gait.curve(generator.arms[arm].pair).free:
                reach = along * generator.lengths[arm]
                easy = easy_height(reach, radii[arm], stance, may_stretch=stretches[arm])
                heights.append(easy - generator.roots[arm][2])
    return min(heights)


def _ground(
    settings: OCTO_MOTION_PG_ground,
    depsgraph: bpy.types.Depsgraph,
    *,
    route: Route,
    travel: TravelSettings,
    bearings: Bearings,
    reach: float,
) -> tuple[Ground, tuple[str, ...]]:
    """The ground of a walk, and what there is to warn of."""
    beyond = 0.0 if route.cyclic else travel.stride + reach
    count = int(np.ceil((route.length + 2.0 * beyond) / (_PATH_STEP * reach))) + 1
    distance = np.linspace(-beyond, route.length + beyond, count)
    path, _ = walked_at(route, travel, bearings, distance)
    if settings.object is None:
        warnings = ()
        if passes_over_itself(path, 0.5 * reach, 0.5 * reach):
            warnings = (_OVER_ITSELF,)
        frames_around = _AROUND * reach
        spacing = _COARSE * reach
        ground = ground_along_path(path, reach=frames_around, spacing=spacing, softness=0.3 * reach)
        return ground, warnings
    inside = (distance >= 0.0) & (distance <= route.length)
    triangles, content = read_triangles(settings.object, depsgraph)
    sizes = {"reach": _AROUND * reach, "spacing": _FINE * reach, "headroom": _HEADROOM * reach}
    ground = _grounds.get(
        content_key(content, path, inside, sizes),
        lambda: sample_ground(triangles, path, inside, **sizes, content=content),
    )
    if len(settings.object.modifiers) > 0 and not is_enabled(settings.object, depsgraph):
        return ground, (_BARE.format(name=settings.object.name),)
    return ground, ()
