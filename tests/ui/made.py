# SPDX-License-Identifier: GPL-3.0-or-later
"""A motion from the settings of an armature, and what a test looks at of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import bpy
import numpy as np

from octo_motion.core.locomotion.gait import Arm, GaitPoser, GaitTable
from octo_motion.core.locomotion.ground import GroundedPoses, GroundedWalk
from octo_motion.core.locomotion.metrics import finding_figures, report
from octo_motion.core.locomotion.motion import MotionPlan, MotionResult, pose
from octo_motion.core.locomotion.motion.segments import Standing, Transitions
from octo_motion.core.locomotion.path import Route, Travel, TravelSettings, plan_travel
from octo_motion.core.locomotion.rig import BodyFrame
from octo_motion.core.rotations import angle_between
from octo_motion.core.skeleton import Skeleton
from octo_motion.core.steps import finished
from octo_motion.ui.locomotion.writing import Shot, Summary
from octo_motion.ui.locomotion.writing import prepare as shot_of


@dataclass(frozen=True)
class Stood:
    """A walk that holds the ground, with its footholds."""

    standing: Standing
    walk: GroundedWalk

    def __getattr__(self, name: str) -> Any:
        return getattr(self.standing, name)

    def pose(self, travel: Travel, part: slice, places: tuple[Any, Any]) -> GroundedPoses:
        """The arms at some of the frames, each by itself."""
        where = places[0][part], places[1][part]
        return self.walk.pose(travel.phase[part], travel.turn[part], *where)


class Made:
    """One motion: prepared, then computed, then written."""

    def __init__(self, shot: Shot) -> None:
        self.shot = shot
        self.on_frames_alone = False
        """Whether it is not worked out between frames, however few they are."""

    def compute(self) -> Iterator[float]:
        if not self.on_frames_alone:
            yield from self.shot.compute()
            return
        plan = self.shot.plan()
        plan.__dict__["subframe_sampled"] = False
        self.shot.result = yield from pose(plan)

    def write(self) -> Summary:
        return self.shot.write()

    @property
    def result(self) -> MotionResult:
        assert self.shot.result is not None
        return self.shot.result

    @cached_property
    def plan(self) -> MotionPlan:
        return self.shot.result.plan if self.shot.result is not None else self.shot.plan()

    @property
    def standing(self) -> Stood | None:
        standing, walk = self.plan.first.standing, self.plan.segments.walks[0]
        return Stood(standing, walk) if standing is not None and walk is not None else None

    @property
    def rotations(self) -> np.ndarray:
        return self.result.arms.rotations[:: self.every]

    @property
    def strains(self) -> np.ndarray:
        return self.result.arms.strains[:: self.every]

    @property
    def misses(self) -> np.ndarray:
        return self.result.arms.misses[:: self.every]

    @property
    def late(self) -> np.ndarray:
        return self.result.arms.late[:: self.every]

    @property
    def in_contact(self) -> list[np.ndarray]:
        return self.result.arms.in_contact

    @property
    def arms(self) -> tuple[Arm, ...]:
        return self.shot.job.creature.arms

    @property
    def note(self) -> str:
        return self.shot.note

    @property
    def skeleton(self) -> Skeleton:
        return self.shot.job.creature.skeleton

    @property
    def body(self) -> BodyFrame:
        return self.shot.job.creature.body

    @property
    def gait(self) -> GaitTable:
        return self.shot.job.gaits[0].settings.gait

    @property
    def scale(self) -> float:
        return self.shot.job.creature.scale

    @property
    def generator(self) -> GaitPoser:
        return self.plan.first.poser

    @property
    def frames(self) -> np.ndarray:
        return self.plan.schedule.frames

    @property
    def times(self) -> np.ndarray:
        return self.plan.schedule.times

    @property
    def route(self) -> Route:
        return self.plan.schedule.route

    @property
    def travel(self) -> TravelSettings:
        return self.plan.schedule.travel

    @property
    def transitions(self) -> Transitions:
        assert self.plan.segments.transitions is not None
        return self.plan.segments.transitions

    @property
    def cycle(self) -> float:
        return self.plan.pace.mean

    @property
    def warnings(self) -> tuple[str, ...]:
        return self.plan.warnings if self.shot.result is None else self.shot.result.warnings

    @property
    def swimming(self) -> np.ndarray:
        """(moments,) how far the body has gone over from a walk to a swim."""
        schedule, standing = self.plan.schedule, self.plan.first.standing
        bearings = standing.bearings if standing is not None else None
        travel = plan_travel(schedule.route, schedule.travel, self.plan.moments[1], bearings)
        swimming = self.plan.segments.swimming(travel.distance)
        assert swimming is not None
        return swimming

    @property
    def depth_of_bones(self) -> float:
        """Arm lengths that joints are below the ground; the figure DEPTH is that of the skin."""
        assert self.result.measured is not None
        found = finished(finding_figures(replace(self.result.measured, skins=None)))
        return next(each.value for each in found if each.kind == "DEPTH")

    @property
    def turn_at_joints(self) -> float:
        """Radians per frame against the bone above; the figure TURN is that in the world."""
        measured = self.result.measured
        assert measured is not None
        rotations = measured.poses.rotations
        return report.change(angle_between(rotations[:-1], rotations[1:]), measured.frames).value

    @property
    def every(self) -> int:
        return 2 if self.plan.subframe_sampled else 1

    def __getattr__(self, name: str) -> Any:
        return getattr(self.plan if self.shot.result is None else self.shot.result, name)


def prepare(armature: bpy.types.Object, context: bpy.types.Context, *, live: bool = False) -> Made:
    """Read what a motion needs."""
    return Made(shot_of(armature, context, live=live))
