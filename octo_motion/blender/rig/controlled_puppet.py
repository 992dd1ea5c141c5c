# SPDX-License-Identifier: GPL-3.0-or-later
"""A puppet whose limbs something else moves: its pose is given to the rig's controls.

Blender is asked what inverse kinematics, constraints and drivers make of the controls, until the
limbs stand as the puppet does.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...core.errors import WriteError
from ...core.phrases import phrase
from ...core.posing.control_fit import ControlFit
from ...core.posing.puppet import Pose, closed, turned_bodies
from ...core.rotations import Floats, angle_between
from .control_objects import control_of, is_object, lead_to, object_of, world_place
from .controls import (
    Channels,
    ControlValues,
    Reach,
    control_names,
    control_values,
    correction_names,
    hangs_on,
    is_correction,
    reaches,
    set_all_values,
    spline_leads,
)
from .limb_points import LimbPoints
from .puppet import Puppet
from .puppet_reading import PuppetRig, bent_bones

_CLOSE: Final = 6e-5
"""Of the figure's size: where limbs stand as wanted, a tenth of a millimetre on a body."""
_TOLD: Final = 4e-4
"""Of the figure's size: what is farther off is told, a millimetre on a body."""
_MOVED: Final = 3e-4
"""Of the figure's size: a limb that has gone by more is to move."""
_SAME_POSE: Final = 1e-6
"""Puppet metres and radians: poses that are no farther apart are one."""
_SAME: Final = 0.01
"""Of the figure's size: joints closer than this are the same joint."""
_FAR: Final = 0.02
"""Of the figure's size: a limb that is farther off is aimed anew."""
_BENT: Final = 2e-3
"""Of the figure's size: a limb whose middle is nearer to its line is straight."""
_LITTLE: Final = 3e-3
"""Of the figure's size: what is farther off is not for controls that only correct."""
_WORTH: Final = 0.5
"""Of what is off: controls that leave more of it are not moved."""
_AGAIN: Final = 15
"""Of how many poses that are written one looks for controls that are to move as well."""


@dataclass(frozen=True, eq=False)
class _Stood:
    """A pose, and how the controls showed it."""

    pose: Pose
    values: dict[str, ControlValues]
    told: str
    """What of it they could not show."""

    def shows(self, pose: Pose) -> bool:
        """Whether it is this pose."""
        apart = np.abs(self.pose.positions - pose.positions).max()
        turned = angle_between(self.pose.orientations, pose.orientations).max()
        return bool(max(apart, turned) < _SAME_POSE)


class ControlledPuppet(Puppet):
    """A puppet that is posed through controls."""

    def __init__(self, armature: bpy.types.Object, rig: PuppetRig) -> None:
        super().__init__(armature, rig)
        bent = bent_bones(armature, wholly=True)
        needed = set().union(*rig.needs.values())
        found = control_names(armature, needed) + correction_names(armature, needed)
        free = [each for each in found if not (each in rig.needs and each in bent)]
        self._limbs = {each: _hanging(rig, each) for each in free}
        """Of each control the bodies that hang on it."""
        self._needs = hangs_on(armature)
        self._trunk = rig.roles.parents.index(-1)
        self._leading: set[str] = set()
        """Controls that lead inverse kinematics by their place, and carry nothing beside."""
        self._points = LimbPoints(rig, armature)
        self._size = self._points.size
        self._goal = rig.pose
        self.read()

    # --- What is shown --------------------------------------------------------------------------

    def read(self) -> Pose:
        armature = self.armature()
        self._origins = {name: Channels(control_of(armature, name)) for name in self._limbs}
        self._stood: list[_Stood] = []
        pose = super().read()
        self._go_on(pose)
        self._keep("")
        return pose

    def write(self, pose: Pose) -> list[str]:
        """Lead the controls on towards a pose; names of those that are on their way."""
        self._goal = pose
        self._writes += 1
        if self._fit is None or self._writes % _AGAIN == 0:
            self._take(self._narrow(self._turned()), placed=False)
        if self._fit is not None:
            self._fit.step(self._points.of(pose))
        return [name.strip() for name in self._moving]

    def settle(self) -> str:
        known = self._stood_before()
        if known is not None:
            set_all_values(self.armature(), known.values)
            self._go_on(self._shown() if known.told else self._goal)
            return known.told
        goal = self._points.of(self._goal)
        turned = self._turned()
        wanted = set(turned)
        if wanted:
            self._aim(goal)
        off, close = self._misses(goal), _CLOSE
        # First what has been bent; then what does not go along by itself.
        for find in (self._narrow, self._wide):
            if off.max() <= close:
                break
            controls, close = find(wanted), _TOLD
            off = self._tried(controls, goal, off, turned)
            if corrections := _corrections(self._limbs, off):
                off = self._tried(controls + corrections, goal, off, turned)
            wanted |= set(np.flatnonzero(off > _TOLD).tolist())
        told = "" if off.max() <= _TOLD else _told(self.figure.names, off * self._size)
        self._keep(told)
        # What was missed would count as shown, and be there still when the limb is back.
        self._go_on(self._shown() if told else self._goal)
        return told

    def shown_for(self, pose: Pose) -> Pose | None:
        shown = self._shown()
        apart = closed(self.figure, pose).positions - closed(self.figure, shown).positions
        if np.linalg.norm(apart, axis=1).max() <= _TOLD * self._size * self.rig.unit:
            return None
        self._go_on(shown)
        self._keep("")
        return shown

    def local(self, pose: Pose) -> tuple[Floats, Floats]:  # noqa: ARG002
        """Of bones that something else moves no rotation could be recorded.

        Raises:
            WriteError: always.
        """
        raise WriteError(
            phrase(
                "'{name}' is posed through its controls: a drag cannot be recorded.", name=self.name
            ),
            "Key its poses with K.",
        )

    def forget(self) -> None:
        super().forget()
        self._fit, self._moving = None, {}

    def with_followers(self, bodies: Iterable[int]) -> list[int]:
        return sorted(bodies)

    def places(self, body: int) -> bool:  # noqa: ARG002
        return False

    def keyed(self, bodies: Iterable[int], *, all_bones: bool = False) -> list[tuple[str, bool]]:
        found = self._to_key(set(bodies), all_bones=all_bones)
        return [(name, placed) for name, placed in found if not is_object(name)]

    def leading(self) -> list[bpy.types.Object]:
        return [object_of(name) for name in self._limbs if is_object(name)]

    def keyed_objects(
        self, bodies: Iterable[int], *, all_bones: bool = False
    ) -> list[bpy.types.Object]:
        found = self._to_key(set(bodies), all_bones=all_bones)
        return [object_of(name) for name, _ in found if is_object(name)]

    # --- Inside -----------------------------------------------------------------------------------

    def _to_key(self, wanted: set[int], *, all_bones: bool) -> list[tuple[str, bool]]:
        """Controls that get keys for bodies, and whether they are placed as well as turned."""
        armature = self.armature()
        found: list[tuple[str, bool]] = []
        for name, limbs in self._limbs.items():
            origin = self._origins[name]
            turned, placed = origin.is_moved(control_of(armature, name))
            # Controls give the pose together: what has moved is keyed whichever limb was asked for.
            asked = all_bones and limbs & wanted and not is_correction(name)
            if (wanted and (turned or placed)) or asked:
                found.append((name, placed or (all_bones and origin.goes)))
        return found

    def _go_on(self, pose: Pose) -> None:
        """Go on from what is shown now, which is the pose from now on, as near as it is."""
        armature = self.armature()
        self._base = self._goal = pose
        self._fit: ControlFit | None = None
        self._moving: dict[str, Channels] = {}
        self._placed = False
        self._writes = 0
        self._start = self._points.shown(armature).reshape(-1, 3)
        self._points.match(armature, pose, self._find_reaches(armature))

    def _keep(self, told: str) -> None:
        """Remember which values of the controls the pose is shown by."""
        self._stood.append(_Stood(self._goal, self._values(), told))

    def _values(self) -> dict[str, ControlValues]:
        armature = self.armature()
        return {name: control_values(control_of(armature, name)) for name in self._limbs}

    def _stood_before(self) -> _Stood | None:
        """How the pose was shown before, if it was: what is undone leaves no trace."""
        return next((each for each in reversed(self._stood) if each.shows(self._goal)), None)

    def _aim(self, goal: Floats) -> None:
        """Bring goals and poles of inverse kinematics to where the limbs want them, about.

        From there least squares find the rest: which way a knee bends they would not turn over.
        """
        armature = self.armature()
        now = self._points.shown(armature).reshape(-1, 3) * self._size
        for reach, joints in self._reaches:
            before = self._start[joints] * self._size
            after = goal.reshape(-1, 3)[joints] * self._size
            off = np.linalg.norm(after - now[joints], axis=1).max()
            if np.abs(after - before).max() <= _MOVED * self._size or off < _FAR * self._size:
                continue
            ways = {reach.goal: after[2] - before[2]}
            if reach.pole in self._poles:
                place = self._poles[reach.pole]
                ways[reach.pole] = _swivelled(place, before, after, self._size) - place
            for name, way in ways.items():
                if name in self._limbs and Channels(control_of(armature, name)).goes:
                    place = Vector((self._poles[name] + way).tolist())
                    lead_to(armature, name, place, self._leads[name])
            self._fit, self._moving = None, {}

    def _find_reaches(self, armature: bpy.types.Object) -> list[tuple[int, str]]:
        """Of chains of inverse kinematics: at which joints theirs are, and what leads them.

        Returns the bodies at their ends, and the controls that are their targets.
        """
        shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        assert shown.pose is not None
        bones, world = shown.pose.bones, shown.matrix_world
        points = self._start[: 2 * len(self.figure)] * self._size
        bending = spline_leads(armature) & self._limbs.keys()
        self._leading |= {each for each in bending if self._trunk not in self._limbs[each]}
        led_bodies: list[tuple[int, str]] = []
        self._reaches: list[tuple[Reach, list[int]]] = []
        self._poles: dict[str, Floats] = {}
        self._leads: dict[str, Matrix | None] = {}
        for reach in reaches(armature):
            middle = bones[reach.chain[len(reach.chain) // 2 - 1]]
            own = (bones[reach.chain[-1]].head, middle.head, bones[reach.chain[0]].tail)
            wanted = np.array([world @ each for each in own])
            apart = np.linalg.norm(points[None] - wanted[:, None], axis=2)
            if apart.min(axis=1).max() > _SAME * self._size:
                continue
            joints = apart.argmin(axis=1).tolist()
            self._reaches.append((reach, joints))
            ends = apart[2, : len(self.figure)]
            if reach.goal and ends.min() <= _SAME * self._size:
                led_bodies.append((int(ends.argmin()), reach.goal))
            above = self.figure.parents[joints[0] % len(self.figure)]
            led = self._needs.get(reach.goal, set()) | self._needs.get(reach.pole, set())
            self._leading |= {
                name for name in led & set(self._limbs) if above not in self._limbs[name]
            }
            for name in {reach.goal, reach.pole} & set(self._limbs):
                self._poles[name] = np.array(world_place(armature, name))
                self._leads[name] = bones[name].matrix.copy() if not is_object(name) else None
        return led_bodies

    def _turned(self) -> set[int]:
        """Bodies that are turned against what they hang on since the bones were read."""
        return set(turned_bodies(self.figure, self._base, self._goal))

    def _misses(self, goal: Floats) -> Floats:
        """(bodies,) how far each limb is from where it is wanted, in sizes of the figure."""
        now = self._points.shown(self.armature())
        apart = np.linalg.norm(self._points.limbs_of(now - goal), axis=2)
        return apart.max(axis=0)

    def _going(self) -> set[int]:
        """Bodies that are to go somewhere else."""
        before, after = self._points.of(self._base), self._points.of(self._goal)
        way = np.linalg.norm(self._points.limbs_of(after - before), axis=2).max(axis=0)
        return set(np.flatnonzero(way > _MOVED).tolist())

    def _wide(self, wanted: set[int]) -> list[str]:
        """Controls on which these bodies hang, and those that lead others that have been moved."""
        moved = self._going() | wanted
        return [
            name
            for name, limbs in self._limbs.items()
            if limbs & (moved if name in self._leading else wanted) and not is_correction(name)
        ]

    def _narrow(self, wanted: set[int]) -> list[str]:
        """Controls of bodies on which nothing hangs that is to stay where it is."""
        moved = self._going() | wanted
        return [
            name
            for name in self._wide(wanted)
            if name in self._leading or self._limbs[name] <= moved
        ]

    def _tried(self, names: list[str], goal: Floats, off: Floats, turned: set[int]) -> Floats:
        """(bodies,) how far limbs are off with these controls moved; where that leaves most of how
        far they were off, controls stay as they are.
        """
        before = self._values()
        self._take(names, placed=True, anew=True)
        if self._fit is None:
            return off
        own = _beginning_at(turned, [self._limbs[name] for name in self._moving])
        self._fit.settle(goal, self._points.hard, _CLOSE, _TOLD, own)
        found = self._misses(goal)
        if found.max() <= max(_TOLD, _WORTH * off.max()):
            return found
        set_all_values(self.armature(), before)
        return off

    def _take(self, names: list[str], *, placed: bool, anew: bool = False) -> None:
        """Let these controls be the ones that are moved; if they are already, they stay so."""
        if list(self._moving) == names and not anew and (self._placed or not placed):
            return
        self._placed = placed
        armature = self.armature()
        self._moving = {
            name: Channels(
                control_of(armature, name),
                turned=not is_correction(name),
                placed=is_correction(name)
                or name in self._leading
                or (placed and self._trunk in self._limbs[name]),
            )
            for name in names
        }
        counts = [each.count for each in self._moving.values()]
        self._fit = None
        if not sum(counts):
            return
        limbs = np.zeros((len(names), 3, len(self.figure), 3), dtype=bool)
        for row, name in enumerate(names):
            limbs[row, :, sorted(self._limbs[name])] = True
        needs = [self._needs[target] for target in self._points.targets]
        led = [[name in need for need in needs for _ in range(3)] for name in names]
        moves = np.concatenate([limbs.reshape(len(names), -1), np.array(led, dtype=bool)], axis=1)
        self._fit = ControlFit(self._shape, counts, np.repeat(moves, counts, axis=0))

    def _shape(self, values: Floats) -> Floats:
        armature, start = self.armature(), 0
        for name, each in self._moving.items():
            own = values[start : start + each.count]
            each.write(control_of(armature, name), own, self._size)
            start += each.count
        return self._points.shown(armature)


def _hanging(rig: PuppetRig, control: str) -> frozenset[int]:
    """Bodies that hang on a control."""
    names = rig.figure.names
    return frozenset(body for body, name in enumerate(names) if control in rig.needs[name])


def _beginning_at(bodies: set[int], limbs: Sequence[frozenset[int]]) -> list[int]:
    """Numbers of the controls, by the bodies on each, that begin at one of some bodies."""
    return [number for number, each in enumerate(limbs) if min(each, default=-1) in bodies]


def _told(names: Sequence[str], off: Floats) -> str:
    """Which limb is farthest off, of (bodies,) metres."""
    body = int(np.argmax(off))
    return phrase(
        "{name} is {far:.3g} off: its controls do not reach",
        name=names[body],
        far=float(off[body]),
    )


def _corrections(limbs: Mapping[str, frozenset[int]], off: Floats) -> list[str]:
    """Of controls with the bodies that hang on them, those that correct limbs which are off
    (bodies,) by little, as where inverse kinematics stretch bones; none for more, or for less than
    what is told.
    """
    if not _TOLD < off.max() <= _LITTLE:
        return []
    beside = set(np.flatnonzero(off > _CLOSE).tolist())
    return [name for name, bodies in limbs.items() if is_correction(name) and bodies & beside]


def _swivelled(place: Floats, before: Floats, after: Floats, size: float) -> Floats:
    """Where a pole (3,) goes for which a limb of joints (3, 3) bends to the side it is bent to.

    It goes round the line from the limb's root to its end, and no farther. A straight limb bends to
    no side, and leaves it where it is.
    """
    axes, bends = zip(*(_bend_axes(each) for each in (before, after)), strict=True)
    if min(bends) < _BENT * size:
        return place
    was, now = axes[0].T @ (place - before[0]), axes[1].T @ (place - after[0])
    turn = np.arctan2(was[2], was[1]) - np.arctan2(now[2], now[1])
    c, s = np.cos(turn), np.sin(turn)
    round_it = np.array([now[0], c * now[1] - s * now[2], s * now[1] + c * now[2]])
    return after[0] + axes[1] @ round_it


def _bend_axes(joints: Floats) -> tuple[Floats, float]:
    """(3, 3) as columns: along a limb of joints (3, 3), to its bend, across; how far that is."""
    along = joints[2] - joints[0]
    along /= max(float(np.linalg.norm(along)), 1e-12)
    bend = joints[1] - joints[0]
    bend = bend - (bend @ along) * along
    far = float(np.linalg.norm(bend))
    bend /= max(far, 1e-12)
    return np.stack([along, bend, np.cross(along, bend)], axis=1), far


def puppet_of(armature: bpy.types.Object, rig: PuppetRig) -> Puppet:
    """The puppet of an armature, posed by its bones or through controls."""
    return ControlledPuppet(armature, rig) if rig.needs else Puppet(armature, rig)
