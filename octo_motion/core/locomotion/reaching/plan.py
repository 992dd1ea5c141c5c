# SPDX-License-Identifier: GPL-3.0-or-later
"""All reaches of a motion: which arm reaches when, and what it takes along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...errors import RigError, SettingsError
from ...rotations import Floats, conjugate, multiply, rotate
from ..gait import Arm
from ..rig import ArmFrames
from .curl import curled
from .grasp import Grasp, Mode, Places, Target, plan_grasp
from .timeline import Timeline
from .winding import Profile


@dataclass(frozen=True, eq=False)
class Travelling:
    """Where the armature is, as the motion carries it."""

    locations: Floats
    """(frames, 3) world."""
    orientations: Floats
    """(frames, 4) world."""
    scale: float

    def seen(self, positions: Floats, rotations: Floats) -> Places:
        """Places in the world (frames, 3), (frames, 4) from the armature, in its units."""
        back = conjugate(self.orientations)
        return Places(
            rotate(back, positions - self.locations) / self.scale, multiply(back, rotations)
        )


@dataclass(frozen=True, eq=False)
class Reach:
    """One reach as plain data."""

    name: str
    arm: str
    """"" for the nearest."""
    mode: str
    turns: float
    timeline: Timeline
    target: str
    profile: Profile | None
    """Metres in the object's frame; a curl has none."""
    positions: Floats
    """(frames, 3) of the object, world."""
    rotations: Floats
    """(frames, 4)"""
    carry: bool = False
    """Whether the object goes along while it is held."""


@dataclass(frozen=True, eq=False)
class Carried:
    """Where an object is taken."""

    target: str
    """Name of the object."""
    frames: Floats
    """(frames,) from when it is held until it is let go."""
    positions: Floats
    """(frames, 3) world."""
    rotations: Floats
    """(frames, 4) world."""


@dataclass(frozen=True, eq=False)
class Reaching:
    """All reaches of a motion; in the order of the artist's list."""

    arms: tuple[Arm, ...]
    frames: tuple[ArmFrames, ...]
    radii: tuple[Floats, ...]
    standings: tuple[tuple[Floats, Floats], ...]
    """Where a pose that stays has brought what each arm hangs on: a shift (3,) and a turn (4,) of
    armature space."""
    up: Floats
    reaches: tuple[Reach, ...]

    def apply(
        self,
        times: Floats,
        rotations: Floats,
        travelling: Travelling,
        strains: Floats | None = None,
    ) -> tuple[tuple[str, ...], tuple[Carried, ...]]:
        """Let arms reach, in place; what they do in words, and the objects that they carry.

        Args:
            times: (frames,) of the motion.
            rotations: (frames, bones, 4) of all arms, one after the other.
            travelling: where the armature is.
            strains: (frames, bones) by how much bones are longer than at rest; an arm that
                reaches is as long as at rest, and what it has here is taken back in place.

        Raises:
            OctoMotionError: an object is out of reach at a frame, which is named; two reaches of
                one arm overlap.
        """
        ends = np.cumsum([0, *(len(arm.bones) for arm in self.arms)])
        busy: list[tuple[int, Reach]] = []
        notes: list[str] = []
        ways = _ways(self.reaches, times, travelling)
        for reach in sorted(self.reaches, key=lambda each: each.timeline.start):
            way = ways.get(reach.target, reach)
            seen = travelling.seen(way.positions, way.rotations)
            number = self._arm(reach, times, seen)
            shift, turn = self.standings[number]
            places = Places(
                rotate(conjugate(turn), seen.positions - shift),
                multiply(conjugate(turn), seen.rotations),
            )
            _check_free(busy, number, reach, self.arms[number].name)
            busy.append((number, reach))
            columns = slice(int(ends[number]), int(ends[number + 1]))
            own, arm = rotations[:, columns], self.frames[number]
            if strains is not None:
                weight = reach.timeline.weight(times, arm.reach[:-1] / arm.length)
                strains[:, columns] *= 1.0 - weight
            if reach.profile is None:
                rotations[:, columns] = curled(arm, reach.timeline, times, own)
                continue
            profile = reach.profile.scaled(1.0 / travelling.scale)
            grasp = self._grasp(reach, number, Target(profile, places, f"'{reach.target}'"), times)
            rotations[:, columns] = grasp.apply(times, places, own)
            if reach.mode != "TOUCH":
                notes.append(
                    f"'{self.arms[number].name}' winds {grasp.turns:.1f} times round "
                    f"'{reach.target}'."
                )
        carried: list[Carried] = []
        for way in ways.values():
            held = (times >= way.timeline.closed) & (times <= way.timeline.release)
            carried.append(
                Carried(way.target, times[held], way.positions[held], way.rotations[held])
            )
        return tuple(notes), tuple(carried)

    def _grasp(self, reach: Reach, number: int, target: Target, times: Floats) -> Grasp:
        """How an arm takes hold of what it reaches for."""
        mode: Mode = "TOUCH" if reach.mode == "TOUCH" else "COIL"
        return plan_grasp(
            self.frames[number],
            self.radii[number],
            target,
            reach.timeline,
            times,
            mode=mode,
            turns=reach.turns,
            up=self.up,
            name=f"'{self.arms[number].name}'",
        )

    def _arm(self, reach: Reach, times: Floats, places: Places) -> int:
        """The arm that is named; else the one whose root the object is nearest to at the touch."""
        for number, arm in enumerate(self.arms):
            if arm.name == reach.arm:
                return number
        if reach.arm:
            raise RigError(
                f"The reach '{reach.name}' has no arm '{reach.arm}' that moves.",
                "Choose an arm of the list that is switched on.",
            )
        if reach.profile is None:
            raise SettingsError(
                f"It is not said which arm curls in '{reach.name}'.", "Choose its arm."
            )
        at = int(np.argmin(np.abs(times - reach.timeline.contact)))
        goal = places.seen(reach.profile.center)[at]
        away = [float(np.linalg.norm(goal - arm.root) / arm.length) for arm in self.frames]
        return int(np.argmin(away))


def _ways(reaches: Sequence[Reach], times: Floats, travelling: Travelling) -> dict[str, Reach]:
    """Reaches that carry their objects, with where they take them, by the objects' names."""
    ways: dict[str, Reach] = {}
    for reach in reaches:
        held = np.flatnonzero((times >= reach.timeline.closed) & (times <= reach.timeline.release))
        if not reach.carry or len(held) == 0:
            continue
        if reach.target in ways:
            raise SettingsError(
                f"Both '{ways[reach.target].name}' and '{reach.name}' carry '{reach.target}'.",
                "Let one of them carry it; the other arm may hold it as well.",
            )
        seen = travelling.seen(reach.positions, reach.rotations)
        positions, rotations = reach.positions.copy(), reach.rotations.copy()
        turn = travelling.orientations[held]
        positions[held] = travelling.locations[held] + travelling.scale * rotate(
            turn, seen.positions[held[0]]
        )
        rotations[held] = multiply(turn, seen.rotations[held[0]])
        positions[held[-1] :], rotations[held[-1] :] = positions[held[-1]], rotations[held[-1]]
        ways[reach.target] = replace(reach, positions=positions, rotations=rotations)
    return ways


def _check_free(busy: Sequence[tuple[int, Reach]], number: int, reach: Reach, arm: str) -> None:
    for other, before in busy:
        if other == number and reach.timeline.start < before.timeline.end:
            raise SettingsError(
                f"'{arm}' reaches in '{before.name}' until frame {before.timeline.end:g} and in "
                f"'{reach.name}' from frame {reach.timeline.start:g}.",
                "Let one end before the other starts, or choose another arm.",
            )
