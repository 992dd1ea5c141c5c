# SPDX-License-Identifier: GPL-3.0-or-later
"""What a shot's settings are for core: how arms move, how the body travels, and when."""

from __future__ import annotations

import math
from typing import Final

import bpy
import numpy as np

from ....blender.files import sample_weight_curve
from ....core.content_cache import ContentCache, content_key
from ....core.errors import SettingsError
from ....core.keyframes import check_bounds
from ....core.locomotion.gait import Arm, GaitPoser, GaitSettings, GaitTable
from ....core.locomotion.motion import Tolerances
from ....core.locomotion.path import (
    Route,
    TravelSettings,
    duration,
    strides,
    travel_in_place,
    whole_frames,
)
from ....core.locomotion.rig import ArmFrames, BodyFrame, frames_of_arm
from ....core.rotations import Floats
from ....core.skeleton import Skeleton
from ..settings.properties import OCTO_MOTION_PG_locomotion

MOST_FRAMES: Final = 100_000
"""A journey of more is a slip of the hand: over an hour at 24 frames a second."""

LAST_FRAME: Final = 1_048_574
"""The last frame that Blender knows; the first is as far below zero."""

_HELD: Final = 0.003
"""Arm lengths that few keys may be off where a joint rests on the ground: it would slide."""
_WEIGHT_SAMPLES: Final = 33
_HEADING_STEP: Final = 0.2
"""Radians: no arm that stands half way between two others is a matter of rounding."""

_generators: Final[ContentCache[GaitPoser]] = ContentCache(12)
_frames_known: Final[ContentCache[list[ArmFrames]]] = ContentCache(4)


def frames_of_arms(skeleton: Skeleton, arms: tuple[Arm, ...], body: BodyFrame) -> list[ArmFrames]:
    """What leads from bones of each arm to its joints."""
    bones = [arm.bones for arm in arms]
    return _frames_known.get(
        content_key(skeleton, bones, body),
        lambda: [frames_of_arm(skeleton, each, body) for each in bones],
    )


def generator_of(
    skeleton: Skeleton, arms: tuple[Arm, ...], body: BodyFrame, settings: GaitSettings
) -> GaitPoser:
    """What moves these arms, the same as before while nothing of it has changed."""
    key = content_key(skeleton, arms, body, settings)
    return _generators.get(key, lambda: GaitPoser(skeleton, arms, body, settings))


def gait_settings(
    settings: OCTO_MOTION_PG_locomotion, gait: GaitTable, lean: float = 0.0
) -> GaitSettings:
    """How the arms move.

    Args:
        settings: of the armature.
        gait: which gait.
        lean: radians from the body's +Z back to the way that it swims along.
    """
    if settings.use_weight_curve:
        drawn = sample_weight_curve(settings.weight_curve, _WEIGHT_SAMPLES)
        weights = tuple(float(each) for each in np.clip(drawn, 0.01, 1.0))
    else:
        weights = (settings.weight_root, settings.weight_tip)
    return GaitSettings(
        gait=gait,
        contraction=settings.contraction,
        weights=weights,
        softness=settings.softness,
        stretch_slack=settings.give,
        smoothing_cycles=settings.steady,
        lateral_bend=settings.sway,
        phase_spread=settings.phase_spread,
        variation=(settings.variation_min, settings.variation_max),
        seed=settings.seed,
        period=settings.cycles if settings.travel_on == "NONE" else 0,
        turning=settings.turning,
        heading=_heading(settings),
        raise_to_floor=settings.stand,
        swim_lean=0.0 if gait.on_ground else lean,
    )


def _heading(settings: OCTO_MOTION_PG_locomotion) -> float:
    """Radians from the way that the body goes to its front, in steps in which arms change roles."""
    if settings.heading != "ALONG":
        return 0.0
    return _HEADING_STEP * round(settings.heading_angle / _HEADING_STEP)


def travel_settings(
    settings: OCTO_MOTION_PG_locomotion, gait: GaitTable, stride: float, lean: float = 0.0
) -> TravelSettings:
    """How the body travels.

    Args:
        settings: of the armature.
        gait: which gait.
        stride: metres.
        lean: radians from the body's +Z back to the way that it swims along.
    """
    travel = TravelSettings(
        manner="WALK" if gait.on_ground else "SWIM",
        speed=settings.speed_mode,
        ease_in=settings.ease_in,
        ease_out=settings.ease_out,
        stride=stride,
        heading=settings.heading,
        heading_angle=settings.heading_angle,
        burst=settings.burst,
        stroke_phase=gait.power_phase,
        look_ahead=settings.look_ahead,
        bank=settings.bank_in_turns,
        keep_upright=settings.keep_upright,
        corner=settings.corner,
        lean=0.0 if gait.on_ground else lean,
    )
    return travel_in_place(travel) if settings.travel_on == "NONE" else travel


def tolerances_of(settings: OCTO_MOTION_PG_locomotion, arm_length: float) -> Tolerances | None:
    """How far few keys may be off, none where every frame has a key.

    Raises:
        SettingsError: without tolerance, no key can be left out.
    """
    if settings.keys != "REDUCED":
        return None
    check_bounds(settings.key_angle, settings.key_distance)
    return Tolerances(
        settings.key_angle,
        settings.key_distance * arm_length,
        settings.key_columns == "BONE",
        _HELD * arm_length,
    )


def height_of(settings: OCTO_MOTION_PG_locomotion, gait: GaitTable, clearance: float) -> float:
    """Metres of the body above its route; clearance is what the gait needs above the ground."""
    if settings.height_mode == "MANUAL":
        return settings.height
    return clearance if gait.on_ground else 0.0


def timing(
    settings: OCTO_MOTION_PG_locomotion,
    route: Route,
    travel: TravelSettings,
    render: bpy.types.RenderSettings,
) -> tuple[float, Floats, Floats]:
    """Seconds that the journey takes, its frames, and the share of its time at each."""
    rate = render.fps / render.fps_base
    start = settings.frame_start
    if settings.timing == "RANGE":
        length = settings.frame_end - start
        if length < 1:
            raise SettingsError(
                f"The motion ends at frame {settings.frame_end} and starts at {start}.",
                "Let it end after its start.",
            )
        exact = float(length)
    elif settings.timing == "SPEED":
        exact = duration(route, travel, settings.speed) * rate
    else:
        # At full speed a cycle takes the cycle time; so many cycles make the route.
        cycles = strides(route, travel)
        cruising = route.length / (cycles * settings.cycle_time)
        exact = duration(route, travel, cruising) * rate
    if settings.travel_on == "NONE":
        exact = whole_frames(exact)
    if exact > MOST_FRAMES:
        raise SettingsError(
            f"The motion would take {exact:,.0f} frames, more than {MOST_FRAMES:,}.",
            "Shorten the route, or make the body faster.",
        )
    # The motion is the same at any frame rate: it ends when it ends, and the frame after that
    # holds the end. A length that is whole but for rounding does not need that frame.
    count = max(math.ceil(exact - 1e-4), 1) + 1
    if start < -LAST_FRAME:
        raise SettingsError(
            f"The motion would start at frame {start:,}, before Blender's first.",
            "Let it start later.",
        )
    if start + count - 1 > LAST_FRAME:
        raise SettingsError(
            f"The motion would end at frame {start + count - 1:,}, after Blender's last.",
            "Let it start earlier.",
        )
    steps = np.arange(count, dtype=np.float64)
    return exact / rate, start + steps, np.minimum(steps / exact, 1.0)
