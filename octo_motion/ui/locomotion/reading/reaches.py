# SPDX-License-Identifier: GPL-3.0-or-later
"""Reaches of the list, from properties to arms that reach: read, then computed on arrays."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import bpy
import numpy as np

from ....blender.animation import object_channels, standing_of, writable_object, write_action
from ....blender.rig import radii_of_skin
from ....blender.scene import (
    can_be_carried,
    carrying_note,
    hangs_on,
    home_of,
    is_carried,
    left_behind,
    put_back,
    read_form,
    read_places,
)
from ....core.errors import RigError, SettingsError
from ....core.locomotion.gait import Arm
from ....core.locomotion.reaching import (
    Mode,
    Places,
    Profile,
    Target,
    Timeline,
    curled,
    plan_grasp,
    profile_of,
)
from ....core.locomotion.rig import ArmFrames, BodyFrame, frames_of_arm
from ....core.rotations import Floats, conjugate, multiply, rotate
from ....core.skeleton import Skeleton

_AXES: Final = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}


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
    """All reaches of a motion; see :func:`read_reaches`."""

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
            mode: Mode = "TOUCH" if reach.mode == "TOUCH" else "COIL"
            grasp = plan_grasp(
                arm,
                self.radii[number],
                Target(reach.profile.scaled(1.0 / travelling.scale), places, f"'{reach.target}'"),
                reach.timeline,
                times,
                mode=mode,
                turns=reach.turns,
                up=self.up,
                name=f"'{self.arms[number].name}'",
            )
            rotations[:, columns] = grasp.apply(times, places, own)
            if mode == "COIL":
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


def write_carried(armature: bpy.types.Object, carried: Sequence[Carried]) -> None:
    """Give objects the keys of their ways; those that they got before are made anew.

    What is no longer carried loses them, and stands where it stood before.

    Raises:
        WriteError: an object has become read-only.
    """
    for target in left_behind(armature.name, {each.target for each in carried}):
        put_back(target)
    for each in carried:
        target = bpy.data.objects.get(each.target)
        if target is None:
            continue
        data = target.animation_data
        write_action(
            target,
            f"{target.name} Carried",
            each.frames,
            object_channels(target, each.positions, each.rotations),
            previous=data.action if data is not None else None,
            settings_note=carrying_note(armature.name),
        )


def _check_free(busy: Sequence[tuple[int, Reach]], number: int, reach: Reach, arm: str) -> None:
    for other, before in busy:
        if other == number and reach.timeline.start < before.timeline.end:
            raise SettingsError(
                f"'{arm}' reaches in '{before.name}' until frame {before.timeline.end:g} and in "
                f"'{reach.name}' from frame {reach.timeline.start:g}.",
                "Let one end before the other starts, or choose another arm.",
            )


def read_reaches(
    armature: bpy.types.Object,
    settings: Any,
    skeleton: Skeleton,
    arms: tuple[Arm, ...],
    *,
    keyed_anew: Collection[str],
    body: BodyFrame,
    frames: Floats,
) -> Reaching | None:
    """What the list of reaches asks for; none if it is empty or muted.

    Args:
        armature: the armature object.
        settings: its settings.
        skeleton: its bones at rest.
        arms: its arms.
        keyed_anew: bones whose present pose does not last.
        body: where the body lies in it.
        frames: (frames,) of the motion.

    Raises:
        OctoMotionError: an object is missing, has no surface, or moves with the armature; frames
            are out of order.
    """
    items = [item for item in settings.reaches if not item.mute]
    if not items:
        return None
    radii = radii_of_skin(armature, [arm.bones for arm in arms])
    return Reaching(
        arms=arms,
        frames=tuple(frames_of_arm(skeleton, arm.bones, body) for arm in arms),
        radii=tuple(radii),
        standings=tuple(standing_of(armature, arm.bones[0], left_out=keyed_anew) for arm in arms),
        up=body.rotation[:, 2],
        reaches=tuple(_reach(item, armature, frames) for item in items),
    )


def _reach(item: Any, armature: bpy.types.Object, frames: Floats) -> Reach:
    closed = item.frame_contact + (item.coil_frames if item.mode == "COIL" else 0)
    timeline = Timeline(
        *(item.frame_start, item.frame_contact, min(closed, item.frame_release)),
        *(item.frame_release, item.frame_release + item.back_frames),
    )
    still = np.zeros((len(frames), 3)), np.tile([1.0, 0.0, 0.0, 0.0], (len(frames), 1))
    if item.mode == "CURL":
        return Reach(item.name, item.arm, item.mode, 0.0, timeline, "", None, *still)
    if item.target is None:
        raise SettingsError(
            f"The reach '{item.name}' has no object.", "Choose what it reaches for, or mute it."
        )
    if hangs_on(item.target, armature):
        raise SettingsError(
            f"'{item.target.name}' hangs on '{armature.name}', which reaches for it.",
            "Clear its parent and its constraints to the armature.",
        )
    carry = item.carry and item.mode == "COIL"
    if carry:
        writable_object(item.target)
        if not can_be_carried(item.target):
            raise SettingsError(
                f"'{item.target.name}' moves by itself and cannot be carried.",
                "Remove its action, constraints and physics, or switch Carry off.",
            )
    axis = np.array(_AXES[item.axis]) if item.axis in _AXES else None
    profile = profile_of(*read_form(item.target), axis)
    asked = (frames >= timeline.start) & (frames <= timeline.end)
    positions, rotations = still
    if carry or is_carried(item.target, armature.name):
        # Keys that it got before are made anew, or taken away.
        position, rotation = home_of(item.target)
        positions, rotations = (
            np.tile(position, (len(frames), 1)),
            np.tile(rotation, (len(frames), 1)),
        )
    elif np.any(asked):
        positions[asked], rotations[asked] = read_places(item.target, frames[asked])
        # Before and after, nothing asks where it is.
        first, last = np.flatnonzero(asked)[[0, -1]]
        positions[:first], rotations[:first] = positions[first], rotations[first]
        positions[last + 1 :], rotations[last + 1 :] = positions[last], rotations[last]
    return Reach(
        item.name, item.arm, item.mode, item.turns, timeline, item.target.name, profile,
        positions, rotations, carry,
    )  # fmt: skip
