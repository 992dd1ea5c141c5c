# SPDX-License-Identifier: GPL-3.0-or-later
"""The simulation that follows an action: one motion, whoever asks for whichever frame of it.

It goes by steps of a fixed length from a fixed beginning, whatever the frame rate; frames are read
off on the way. What has been worked out is kept, so a frame is the same when it is played, scrubbed
to, or baked.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Final

import numpy as np

from ..errors import SettingsError
from ..posing.puppet import Figure, Flags, Pose, capsules_in_world
from ..posing.solver import (
    CarriedCapsules,
    CarriedThings,
    CarriedWorld,
    Leading,
    Obstacle,
    WorldSettings,
)
from ..rotations import (
    IDENTITY,
    Floats,
    angle_between,
    conjugate,
    from_rotation_vector,
    multiply,
    rotate,
    slerp,
    to_rotation_vector,
)
from ..settings import check_settings
from .limbs import (
    EARTH,
    Followed,
    Limbs,
    carried_figure,
    led_motion,
    pose_at,
    strengthened,
    touching,
    turns_to,
)
from .medium import DENSITIES, Medium
from .sampling import BoneMotion, Displacement, Sampler
from .settings import FollowSettings

STEPS: Final = 240
"""Steps in a second: of 24, 30 and 60 frames a second, each falls on one."""
BEFORE: Final = 1.0
"""Seconds that go before the first frame."""
_CHUNK: Final = 240
"""Steps that are led at a time."""
_SETTLED: Final = 1e-6
"""Error of an impulse, against the largest, with which the solver is content. With what is enough
for a hand, 5e-3, joints give way a step sooner or later in a creature that is turned elsewhere:
tails that are jerked about over a floor then bend otherwise by up to 0.22 radians, not 0.0005."""
_REPEATS: Final = 2e-5
"""Radians by which joints of two rounds may differ, and be the same."""
_UNSEEN: Final = np.radians(0.5)
"""Radians by which they may where they creep on from round to round, as clay that sags: spread over
a round nobody sees it …"""
_CREEPS: Final = 0.8
"""… where more than this share of it is left a round later. Without, clay under its own weight went
on for 60 rounds, and still differed by 0.0005."""
_MOST_ROUNDS: Final = 60
_PATIENCE: Final = 12
"""Rounds without one that is nearer to the one before it than any was: then there will be none."""


@dataclass(frozen=True, eq=False)
class BodyCapsules:
    """The rest of the body, which limbs may touch: capsules that go with bones."""

    bones: tuple[int, ...]
    """Of the skeleton."""
    ends: Floats
    """(capsules, 2, 3) in the bones' frames."""
    radii: Floats
    """(capsules,)"""


@dataclass(frozen=True, eq=False)
class MovingObstacles:
    """Things that limbs may touch, and that go their own way."""

    shapes: tuple[Obstacle, ...]
    ways: BoneMotion
    """(frames, shapes): where they are at the frames of the action."""

    def at(self, ways: BoneMotion, row: int, step: float) -> CarriedThings:
        """The things where they are at a moment, on their way to the next, in seconds."""
        found: list[Obstacle] = []
        shifts = np.diff(ways.positions[row : row + 2], axis=0)[0]
        before, after = ways.orientations[row : row + 2]
        turns = to_rotation_vector(multiply(after, conjugate(before)))
        for number, shape in enumerate(self.shapes):
            # What hangs on the shape alone is kept.
            thing = copy(shape)
            object.__setattr__(thing, "position", ways.positions[row, number])
            object.__setattr__(thing, "orientation", ways.orientations[row, number])
            found.append(thing)
        return CarriedThings(found, np.stack([shifts, turns], axis=1) / step)


@dataclass(frozen=True, eq=False)
class FollowJob:
    """All that a simulation is made from; lengths are metres of the figure's own scale."""

    limbs: Limbs
    figure: Figure
    """Of the limbs' bones alone, in their order."""
    motion: BoneMotion
    """What the action says, of all bones."""
    settings: FollowSettings
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """m/s"""
    obstacles: Sequence[Obstacle] = ()
    moving: MovingObstacles | None = None
    body: BodyCapsules | None = None
    strengths: Floats | None = None
    """(frames, bones) or (1, bones) factors on the strength of each."""
    cycle: Displacement | None = None
    """Where a cycle leads; none if it does not repeat."""

    def check(self) -> None:
        """See whether it can be simulated.

        Raises:
            SettingsError: a setting is out of range, or there are too few frames.
        """
        check_settings(self.settings)
        if not np.isfinite(self.wind).all():
            raise SettingsError("Wind is not a number.", "Set it anew.")
        if len(self.motion) < (3 if self.cycle is not None else 2):
            raise SettingsError("The action has too few frames.", "Choose a longer one.")


class Simulation:
    """A job's motion, step by step; what was worked out stays."""

    def __init__(self, job: FollowJob) -> None:
        """Begin; what is to be is worked out as it is asked for.

        Raises:
            SettingsError: a setting is out of range, or there are too few frames.
        """
        job.check()
        self.job = job
        motion, settings = job.motion, job.settings
        self.figure = carried_figure(job.limbs, job.figure, motion, settings)
        """The limbs and, in front, what carries them."""
        self.roots = len(job.limbs.carriers)
        """Number of carriers."""
        steps = STEPS * motion.seconds
        self.steps = int(np.ceil(steps - 1e-9)) if job.cycle is None else max(round(steps), 1)
        """From the first frame to the last; a cycle's are as many as fit best."""
        self.step = 1.0 / STEPS if job.cycle is None else motion.seconds / self.steps
        """s"""
        still = settings.start == "REST"
        self.led = led_motion(job.limbs, motion)
        """What leads the figure's bodies, carriers first."""
        self._sampler = Sampler(self.led, cycle=job.cycle, still=still)
        self._around: Sampler | None = None
        if job.body is not None and len(job.body.bones):
            own = motion.of(list(job.body.bones))
            self._around = Sampler(own, cycle=job.cycle, still=still)
        self._things: Sampler | None = None
        if job.moving is not None:
            # Whatever the body goes round, things are where they are.
            stays = Displacement(IDENTITY, np.zeros(3)) if job.cycle is not None else None
            self._things = Sampler(job.moving.ways, cycle=stays, still=still)
        first = 0 if job.cycle is not None else -round(BEFORE / self.step)
        self._world = self._begin(first)
        self._known: dict[int, Floats] = {}
        """By step from the first frame, orientations (bodies, 4)."""
        if first == 0:
            self._known[0] = self._world.pose().orientations
        self._going = self._advance(first)
        self._now = first

    def orientations(self, step: int) -> Floats:
        """(bodies, 4) after so many steps from the first frame, world; not before it.

        Raises:
            SettingsError: the simulation has lost itself.
        """
        while self._now < step:
            self._now = next(self._going)
        return self._known[step]

    def at(self, frame: float) -> Floats:
        """(bodies, 4) at a frame, counted from the first one: the same whenever it is asked for."""
        place = frame / self.job.motion.rate / self.step
        before = int(np.floor(place + 1e-6))
        share = np.array(place - before)
        if share <= 1e-6:
            return self.orientations(before)
        return slerp(self.orientations(before), self.orientations(before + 1), share)

    def forget(self, step: int) -> None:
        """Drop what was worked out before a step."""
        for each in [each for each in self._known if each < step]:
            del self._known[each]

    def _begin(self, first: int) -> CarriedWorld:
        """A world that stands as the action has it at a step."""
        job, settings = self.job, self.job.settings
        pose = pose_at(self.figure, self._sampler.at(np.array([first * self.step])), 0)
        floats = settings.buoyancy if settings.medium == "WATER" else 0.0
        world = CarriedWorld(
            self.figure,
            pose,
            WorldSettings(
                step=self.step,
                gravity=(0.0, 0.0, -settings.gravity * EARTH * (1.0 - floats)),
                self_collision=settings.self_collision,
                friction=settings.friction,
                tolerance=_SETTLED,
            ),
            job.obstacles,
        )
        self._medium = Medium(
            self.figure,
            DENSITIES[settings.medium],
            settings.drag,
            np.array(job.wind, dtype=np.float64),
            self.step,
        )
        self._meets, self._slack = self._meeting()
        return world

    def _meeting(self) -> tuple[Flags, Floats]:
        """(bodies, capsules) what may touch, not a limb and what carries it; and by how much they
        are in each other where the action begins.
        """
        body = self.job.body
        if body is None or not len(body.bones):
            return np.zeros((len(self.figure), 0), dtype=bool), np.zeros((len(self.figure), 0))
        motion = self.job.motion.of(list(body.bones))
        ends = capsules_in_world(self.figure, pose_at(self.figure, self.led, 0))
        others = self._ends(motion)[0]
        meets, slack = touching(ends, self.figure.radii, others, body.radii)
        for place, bone in zip(self.job.limbs.roots, self.job.limbs.carriers, strict=True):
            meets[self.roots + place, [each == bone for each in body.bones]] = False
        meets[: self.roots] = False
        return meets, slack

    def _ends(self, motion: BoneMotion) -> Floats:
        """(times, capsules, 2, 3) of the rest of the body."""
        assert self.job.body is not None
        turned = rotate(motion.orientations[:, :, None, :], self.job.body.ends)
        return motion.positions[:, :, None, :] + turned

    def _advance(self, first: int) -> Generator[int, None, None]:
        """Go on, one step at a time; yields how many from the first frame were made."""
        while True:
            # A chunk begins at the same step whoever asks for which frame, and ends with a round.
            last = first + _CHUNK
            if self.job.cycle is not None:
                last = min(last, (first // self.steps + 1) * self.steps)
            yield from self._chunk(first, last)
            first = last

    def _chunk(self, first: int, last: int) -> Iterator[int]:
        times = self.step * np.arange(first, last + 1, dtype=np.float64)
        led = self._sampler.at(times)
        leading = self._leading(led)
        ends = None if self._around is None else self._ends(self._around.at(times))
        things = None if self._things is None else self._things.at(times)
        world, count = self._world, self.roots
        world.put(Pose(led.positions[0, :count], led.orientations[0, :count]))
        for number, each in enumerate(leading):
            row = number + 1
            self._set_strengths(first + number)
            world.lead(each)
            if ends is not None:
                assert self.job.body is not None
                speeds = (ends[row] - ends[number]) / self.step
                world.capsules = CarriedCapsules(
                    ends[number], self.job.body.radii, speeds, self._meets, self._slack
                )
            if things is not None:
                assert self.job.moving is not None
                world.things = self.job.moving.at(things, number, self.step)
            if self._medium.acts:
                world.forces = self._medium.forces(world.velocities(), world.matrices)
            world.step()
            if first + row >= 0:
                self._known[first + row] = world.pose().orientations
            yield first + row
        if not np.isfinite(world.pose().orientations).all():
            raise SettingsError(
                "The simulation has come apart.", "Lower Strength, Drag or the speed of the wind."
            )

    def _leading(self, led: BoneMotion) -> list[Leading]:
        """Of each step from one moment to the next."""
        count, rate = self.roots, 1.0 / self.step
        turns = turns_to(self.figure, led.orientations)
        by = multiply(turns[1:], conjugate(turns[:-1]))
        speeds = rate * to_rotation_vector(by)
        shifts = rate * np.diff(led.positions[:, :count], axis=0)
        roots = np.concatenate([shifts, speeds[:, :count]], axis=1)
        # Carriers have no springs.
        by[:, :count], speeds[:, :count] = IDENTITY, 0.0
        return [Leading(*each) for each in zip(roots, speeds, by, strict=True)]

    def _set_strengths(self, step: int) -> None:
        """Let joints be as strong as they are at a step."""
        factors = self.job.strengths
        if factors is None:
            return
        frame = step * self.step * self.job.motion.rate
        if self.job.cycle is not None:
            frame %= len(self.job.motion) - 1
        row = int(np.clip(round(frame), 0, len(factors) - 1))
        if row != self._strength_row:
            self._strength_row = row
            all_of_them = np.concatenate([np.ones(self.roots), factors[row]])
            self._world.set_elements(strengthened(self.figure.elements, all_of_them))

    _strength_row = -1


# --- All frames -----------------------------------------------------------------------------------


def follow(job: FollowJob) -> Generator[float, None, Followed]:
    """Work out all frames of a job, in steps that yield the share that is done.

    A cycle goes on round after round until one is like the one before; what is then left of a
    difference between its ends is spread over it.
    """
    simulation = Simulation(job)
    frames = np.arange(len(job.motion), dtype=np.float64)
    if job.cycle is None:
        rows = list[Floats]()
        for frame in frames:
            rows.append(simulation.at(float(frame)))
            yield (frame + 1.0) / len(frames)
        turns = turns_to(simulation.figure, np.stack(rows))
        return _followed(simulation, turns)
    length, number = len(frames) - 1, 0
    before: Floats | None = None
    differ: list[float] = []
    for number in range(_MOST_ROUNDS):
        rows = []
        for frame in frames:
            rows.append(simulation.at(number * length + float(frame)))
            # Nobody knows how many rounds it takes.
            done = number + frame / length
            yield done / (done + 4.0)
        turns = turns_to(simulation.figure, np.stack(rows))
        if before is not None:
            apart = angle_between(turns, before)[:, simulation.roots :]
            differ.append(float(apart.max(initial=0.0)))
        before = turns
        if _repeats(differ):
            return _followed(simulation, _closed(turns), rounds=number + 1)
        if len(differ) > _PATIENCE and min(differ[-_PATIENCE:]) > min(differ[:-_PATIENCE]):
            break
        simulation.forget(number * simulation.steps)
    assert before is not None
    return _followed(simulation, _closed(before), repeats=False, rounds=number + 1)


def _repeats(differ: Sequence[float]) -> bool:
    """Whether a round is like the one before, by how much each differed, radians."""
    if not differ:
        return False
    last = differ[-1]
    creeps = len(differ) > 1 and last > _CREEPS * differ[-2]
    return last <= _REPEATS or (creeps and last <= _UNSEEN)


def _closed(turns: Floats) -> Floats:
    """A round whose last frame is its first one: what is missing comes in and stays smooth."""
    share = np.linspace(0.0, 1.0, len(turns))[:, None, None]
    eased = share * share * (3.0 - 2.0 * share)
    left = to_rotation_vector(multiply(conjugate(turns[-1]), turns[0]))
    result = multiply(turns, from_rotation_vector(eased * left))
    result[-1] = result[0]
    return result


def _followed(
    simulation: Simulation, turns: Floats, *, repeats: bool = True, rounds: int = 1
) -> Followed:
    """Of turns (frames, bodies, 4) seen from the parents'."""
    orientations = turns.copy()
    count = simulation.roots
    orientations[:, :count] = simulation.led.orientations[:, :count]
    for body, parent in enumerate(simulation.figure.parents):
        if parent >= 0:
            orientations[:, body] = multiply(orientations[:, parent], turns[:, body])
    return Followed(turns[:, count:], orientations[:, count:], repeats, rounds)
