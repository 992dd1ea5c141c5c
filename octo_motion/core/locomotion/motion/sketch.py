# SPDX-License-Identifier: GPL-3.0-or-later
"""One frame of a motion that is nearly one that is known, long before it is planned.

Whoever drags a route or a slider wants to see at once where that leads. What a change does to a
frame is soon worked out: the place where the body is then, and the arms there in the gait and on
their footholds, by themselves. What is made of that by the frames around it (swings evened out,
arms that make way, what is between frames), takes long, and is little. So it is taken to be what it
is in the motion that is known, less and less the farther the gait has moved on.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ...content_cache import content_key
from ...rotations import Floats, conjugate, multiply, slerp
from ...steps import finished
from ..body import OrganPoses
from ..gait import RoughGaitPoser
from ..path import Route, distances_at
from ..rig import ArmMotion
from .job import MotionJob
from .pipeline import (
    Body,
    Glimpsed,
    KnownMotion,
    beside_neighbours,
    body_at,
    glimpsed,
    organs_at,
    way_of,
)
from .planning import MotionPlan, plan_near, slowed_route

_WINDOW: Final = 12
"""Moments to either side of one of which it is found at once what the frames around them make of
the arms; arms of an even gait are as far as the body at all of them, others within some frames."""


@dataclass(frozen=True, eq=False)
class _Made:
    """What the frames around them make of arms, at some moments around a frame."""

    first: int
    """Number of the first of these moments …"""
    known: tuple[int, int]
    """… and of the first and the last that there might be."""
    phases: Floats
    """(moments, arms) radians, never less than at the moment before."""
    shifts: Floats
    """(moments, 3) metres that the body is beside where it is roughly."""
    turns: Floats
    """(moments, bones, 4) what bones are turned by, each in its own frame …"""
    strains: Floats
    """… and (moments, bones) by how much they are longer."""

    def has(self, number: int) -> bool:
        """Whether a moment is well among them, or at an end of all that is known."""
        last, (begin, end) = self.first + len(self.phases), self.known
        far = _WINDOW // 2
        return (self.first == begin or number >= self.first + far) and (
            last == end or number < last - far
        )


class Sketch:
    """Frames of motions that are nearly one that is known.

    Args:
        known: the one that is known.
    """

    def __init__(self, known: KnownMotion) -> None:
        self._known = known
        self._made: dict[bool, _Made] = {}
        """By whether what moves the arms is made anew."""
        self._organs: tuple[float, OrganPoses] | None = None
        self._body = _body_key(known.plan.job)
        when = known.plan.schedule
        distance = distances_at(when.route, when.travel, known.plan.moments[1])
        self._strides: Floats = distance / when.travel.stride
        """(moments,) that the body has come, at all of the motion."""
        centres, held, come = way_of(known.plan)
        self._way = centres, held
        along = np.linspace(0.0, 1.0, len(centres)), come / when.route.length
        self._shares: Floats = np.clip(np.concatenate(along), 0.0, 1.0)
        """Of the route's length at which these are."""
        self._on_route = self._route_at(when.route)
        """The route there."""

    def may_show(self, job: MotionJob) -> bool:
        """Whether a motion can be drawn so: on one gait all the way, in the world as it
        is planned, and it begins and ends as it likes; its arms and way of moving are the same.
        """
        plan, known = self._known.plan, self._known.plan.job
        return (
            plan.segments.transitions is None
            and plan.carry is None
            and plan.laid is None
            and _is_simple(known)
            and _is_simple(job)
            and job.in_place == known.in_place
            and job.creature.bones == known.creature.bones
            and _manner(job) == _manner(known)
            and _body_key(job) == self._body
        )

    def preparing(self, frame: float) -> Generator[float, None, None]:
        """Work out beforehand, in steps, what will be asked for near a frame."""
        plan = self._known.plan
        moment = plan.moment_of(frame)
        for anew in (False, True):
            yield from self._making(moment, anew=anew)
            yield 0.9
        frames, times = (each[moment : moment + 1] for each in plan.moments)
        self._organs = frame, organs_at(plan, frames, body_at(plan, times).keyed, None)

    def at(self, job: MotionJob, frame: float) -> list[Glimpsed]:
        """What a motion is nearly at a frame: the values of all channels.

        Raises:
            OctoMotionError: something is wrong that the user can put right.
        """
        plan, moment = finished(plan_near(job, self._known.plan, frame, frame))
        body = body_at(plan, plan.moments[1][moment])
        arms = finished(_by_themselves(plan, body))
        come = float(body.travel.distance[0]) / plan.schedule.travel.stride
        moments = np.arange(len(self._strides), dtype=np.float64)
        near = round(float(np.interp(come, self._strides, moments)))
        made = self._made_around(near, anew=isinstance(plan.first.poser, RoughGaitPoser))
        arms = self._with_what_is_made(made, arms, plan, body)
        beside = made.shifts[min(max(near - made.first, 0), len(made.shifts) - 1)]
        body = replace(body, keyed=(body.keyed[0] + beside, body.keyed[1]))
        frames = plan.moments[0][moment]
        if self._organs is None or self._organs[0] != frame:
            self._organs = frame, organs_at(plan, frames, body.keyed, None)
        return glimpsed(plan, arms, body, frames, self._organs[1])

    def way(self, job: MotionJob) -> tuple[Floats, Floats]:
        """Where a motion nearly leads, as ``way_of`` has it: places of the body's centre and of
        footholds are as far beside the route as those that are known.
        """
        plan, (centres, held) = self._known.plan, self._way
        route, before = slowed_route(job) or plan.schedule.route, plan.schedule.route
        places = np.concatenate([centres, held])
        if route is before:
            return centres, held
        moved = self._route_at(route) - self._on_route
        if plan.standing:
            ground, beside = plan.standing[0].ground, (places + moved)[:, :2]
            moved[:, 2] = ground.height(beside) - ground.height(places[:, :2])
        places = places + moved
        return places[: len(centres)], places[len(centres) :]

    def _route_at(self, route: Route) -> Floats:
        return route.position(route.parameter_near(self._shares * route.length))

    def _made_around(self, number: int, *, anew: bool) -> _Made:
        """What is made of arms around one of the moments."""
        finished(self._making(number, anew=anew))
        return self._made[anew]

    def _making(self, number: int, *, anew: bool) -> Generator[float, None, None]:
        known, plan = self._known, self._known.plan
        begin, end = known.first, known.first + len(known.arms.rotations)
        number = min(max(number, begin), end - 1)
        if anew in self._made and self._made[anew].has(number):
            return
        first, last = max(number - _WINDOW, begin), min(number + _WINDOW + 1, end)
        frames, times = plan.moments
        there = body_at(plan, times[first:last])
        yield 0.1
        plan, part = yield from plan_near(
            plan.job, plan, frames[first], frames[last - 1], anew=anew
        )
        yield 0.4
        body = body_at(plan, plan.moments[1][part])
        yield 0.5
        bare = yield from _by_themselves(plan, body)
        whole = known.arms.at(slice(first - begin, last - begin))
        self._made[anew] = _Made(
            first,
            (begin, end),
            _phases(plan, body),
            there.keyed[0] - body.keyed[0],
            multiply(conjugate(bare.rotations), whole.rotations),
            whole.strains - bare.strains,
        )

    @staticmethod
    def _with_what_is_made(made: _Made, arms: ArmMotion, plan: MotionPlan, body: Body) -> ArmMotion:
        """Arms at one moment, with what the frames around it make of them: of each arm what they do
        where it is as far in its cycle.
        """
        last, numbers = len(made.phases) - 1, np.arange(float(len(made.phases)))
        wanted = zip(_phases(plan, body)[0].tolist(), made.phases.T, strict=True)
        places = np.array([np.interp(phase, own, numbers) for phase, own in wanted])
        places = np.repeat(places, plan.segments.bones)
        before = np.minimum(places.astype(np.int64), max(last - 1, 0))
        after, share, bones = np.minimum(before + 1, last), places - before, np.arange(len(places))
        turns = slerp(made.turns[before, bones], made.turns[after, bones], share)
        here, then = made.strains[before, bones], made.strains[after, bones]
        return replace(
            arms,
            rotations=multiply(arms.rotations, turns),
            strains=arms.strains + here + share * (then - here),
        )


def _by_themselves(plan: MotionPlan, body: Body) -> Generator[float, None, ArmMotion]:
    """Arms in the gait and on their footholds, and between their neighbours as they are there, in
    steps.
    """
    arms = yield from plan.segments.posing_by_themselves(body.travel, body.places)
    return replace(arms, rotations=beside_neighbours(plan, arms))


def _phases(plan: MotionPlan, body: Body) -> Floats:
    """Each arm's own phase (moments, arms), radians."""
    walk, phase = plan.segments.walks[0], body.travel.phase
    if walk is None:
        return np.repeat(phase[:, None], len(plan.segments.bones), axis=1)
    return walk.arm_phases(phase)


def _body_key(job: MotionJob) -> bytes:
    """A key of what a body does by itself, whatever its arms do."""
    body = job.body
    return content_key(
        *(body.settings, body.breathing, body.unlike, body.seed, body.look_at, job.streamline),
        job.timing.rate,
    )


def _manner(job: MotionJob) -> tuple[bool, str]:
    table = job.gaits[0].settings.gait
    return table.on_ground, table.manner


def _is_simple(job: MotionJob) -> bool:
    rolls = job.ground is not None and (
        job.ground.moving is not None or job.ground.stance.up == "GROUND"
    )
    given = job.begin is not None or job.end is not None or job.reaching is not None
    return not (rolls or given or job.changes)
