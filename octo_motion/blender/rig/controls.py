# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig's controls: which bones an artist moves, and which limbs hang on each of them.

Nothing here knows a kind of rig. What a bone hangs on is its parent, the targets of its constraints
and the bones that its drivers read; whether and how it follows is left to Blender to work out.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import bpy
import numpy as np
from mathutils import Quaternion, Vector

from ...core.rotations import Floats, angle_between, conjugate, multiply
from .armature import acts, armature_data, driven_channels, set_rotation
from .control_objects import Control, control_of, is_object, object_control, units_of

_MECHANISM: Final = re.compile(r"(DEF|ORG|MCH|VIS)-", re.IGNORECASE)
"""Names of bones that are no controls."""
_CORRECTION: Final = re.compile(r".*tweak", re.IGNORECASE)
"""Names of controls that only correct, by a little, what others do."""
_READ_BONE: Final = re.compile(r'pose\.bones\["((?:[^"\\]|\\.)*)"\]')
FULL: Final = 1.0 - 1e-6
_TRIED: Final = 0.1
"""Radians, and shares of the rig's length, by which controls are moved to see what they bend."""
_TRIES: Final = 3
_STIFF: Final = 0.02
"""Share of that by which a joint that no control bends may seem to bend: inverse kinematics leave
that much open."""

ControlValues = dict[str, tuple[float, ...]]
"""Of a control's channels, by name."""


def hangs_on(armature: bpy.types.Object) -> dict[str, set[str]]:
    """For each bone all bones on whose poses its own depends, itself among them, as it stands; and
    the objects among them that are controls, by their names as such.

    Constraints that are muted or without influence count for nothing.
    """
    shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert shown.pose is not None
    direct: dict[str, set[str]] = {}
    chains: dict[str, set[str]] = {}
    for bone in shown.pose.bones:
        needed = {bone.parent.name} if bone.parent is not None else set()
        for constraint in bone.constraints:
            if not acts(constraint):
                continue
            targets = _targets(constraint, armature.name)
            own: Any = constraint
            replaces = own.type == "COPY_TRANSFORMS" and own.mix_mode == "REPLACE"
            if replaces and targets and constraint.influence >= FULL:
                # Whatever came before is gone.
                needed = targets
                continue
            needed |= targets
            if constraint.type in {"IK", "SPLINE_IK"}:
                for each in ik_chain(bone, own):
                    chains.setdefault(each, set()).update(targets | {bone.name})
        direct[bone.name] = needed
    for name, more in chains.items():
        direct[name] |= more
    for name, read in _driven_by(armature).items():
        direct.setdefault(name, set()).update(read)
    for name in set().union(*direct.values()) - direct.keys():
        direct[name] = set()
    return {name: _closure(name, direct) for name in direct}


def ik_chain(bone: bpy.types.PoseBone, constraint: Any) -> list[str]:
    """Names of the bones that a constraint of inverse kinematics on a bone bends."""
    first = bone if getattr(constraint, "use_tail", True) else bone.parent
    chain = [] if first is None else [first, *first.parent_recursive]
    return [each.name for each in chain[: constraint.chain_count or len(chain)]]


def goal_bones(armature: bpy.types.Object) -> set[str]:
    """Bones that inverse kinematics reach for or point at, muted or not, and that it bends not."""
    assert armature.pose is not None
    goals: set[str] = set()
    chained: set[str] = set()
    for bone in armature.pose.bones:
        for constraint in bone.constraints:
            if constraint.type == "IK":
                goals |= _targets(constraint, armature.name)
                chained.update(ik_chain(bone, constraint))
    carried = {
        each.name
        for name in chained
        for each in armature_data(armature).bones[name].parent_recursive
    }
    return goals - chained - carried


def leading_objects(armature: bpy.types.Object) -> dict[str, list[str]]:
    """Objects that are neither controls nor carried by bones of the armature, by name, with the
    bones that inverse kinematics bend after them: no key of a control moves those.
    """
    assert armature.pose is not None
    found: dict[str, list[str]] = {}
    for bone in armature.pose.bones:
        for constraint in bone.constraints:
            own: Any = constraint
            if own.type not in {"IK", "SPLINE_IK"} or not acts(own) or own.target is None:
                continue
            inside = own.target == armature
            chain = ik_chain(bone, own)
            if chain and not inside and not _controls_behind(own.target, "", armature.name):
                found.setdefault(own.target.name, []).extend(chain)
    return found


@dataclass(frozen=True)
class Reach:
    """One chain of inverse kinematics that is at work."""

    chain: tuple[str, ...]
    """Its bones, from the end to the root."""
    goal: str
    """The control that it reaches for; empty if that is none of the rig's."""
    pole: str


def reaches(armature: bpy.types.Object) -> list[Reach]:
    """Chains of two bones and more that inverse kinematics bend now."""
    assert armature.pose is not None
    found: list[Reach] = []
    for bone in armature.pose.bones:
        for each in bone.constraints:
            own: Any = each
            if own.type != "IK" or not acts(own):
                continue
            chain = ik_chain(bone, own)
            if len(chain) > 1:
                goal = _lead(armature, own.target, own.subtarget)
                pole = _lead(armature, own.pole_target, own.pole_subtarget)
                found.append(Reach(tuple(chain), goal, pole))
    return found


def _lead(armature: bpy.types.Object, target: Any, subtarget: str) -> str:
    """The control that a target is itself: a bone of the armature, or an object; or none."""
    if target == armature:
        return subtarget
    return "" if target is None else object_control(target)


def spline_leads(armature: bpy.types.Object) -> set[str]:
    """Bones that bend the curves along which inverse kinematics lay chains now."""
    assert armature.pose is not None
    return {
        name
        for bone in armature.pose.bones
        for each in bone.constraints
        if each.type == "SPLINE_IK" and acts(each)
        for name in _targets(each, armature.name)
    }


def _targets(constraint: Any, armature: str) -> set[str]:
    """Controls, bones of the armature by its name, on which what a constraint follows depends."""
    found: set[str] = set()
    for kind in ("", "pole_"):
        target = getattr(constraint, f"{kind}target", None)
        found |= _controls_behind(target, getattr(constraint, f"{kind}subtarget", ""), armature)
    for each in getattr(constraint, "targets", ()):
        if getattr(each, "weight", 1.0) > 0.0:
            found |= _controls_behind(each.target, each.subtarget, armature)
    return found


def _controls_behind(
    target: Any,
    subtarget: str,
    armature: str,
    passed: frozenset[str] = frozenset(),
    *,
    carries: bool = False,
) -> set[str]:
    """The bone of the armature that is meant, or another object if that is a control, and those
    that carry it or bend it, as hooks bend the curve of a spline.

    Objects that were passed on the way are not looked at again. What only ``carries`` others is
    there for more than a limb, perhaps for all of a scene, and none.
    """
    if target is None or target.name in passed:
        return set()
    if target.name == armature:
        return {subtarget} if subtarget else set()
    passed |= {target.name}
    found = _controls_behind(target.parent, target.parent_bone, armature, passed, carries=True)
    if not carries and (control := object_control(target)):
        found.add(control)
    for each in (*target.modifiers, *target.constraints):
        own: Any = each
        if each.type == "HOOK":
            found |= _controls_behind(own.object, own.subtarget, armature, passed, carries=carries)
        elif isinstance(each, bpy.types.Constraint) and acts(each):
            more = getattr(own, "target", None), getattr(own, "subtarget", "")
            found |= _controls_behind(*more, armature, passed, carries=carries)
    return found


def _driven_by(armature: bpy.types.Object) -> dict[str, set[str]]:
    """For each bone whose place or rotation a driver moves, the bones that the driver reads."""
    found: dict[str, set[str]] = {}
    for name, channel, curve in driven_channels(armature):
        if curve.mute or curve.driver is None or not channel.startswith(("location", "rotation")):
            continue
        for variable in curve.driver.variables:
            for target in variable.targets:
                read = _READ_BONE.match(target.data_path or "")
                bone = target.bone_target or (read and bpy.utils.unescape_identifier(read[1]))
                if target.id == armature and bone:
                    found.setdefault(name, set()).add(bone)
    return found


def _closure(name: str, direct: Mapping[str, set[str]]) -> set[str]:
    found, waiting = {name}, [name]
    while waiting:
        for each in direct.get(waiting.pop(), ()):
            if each not in found:
                found.add(each)
                waiting.append(each)
    return found


def is_correction(name: str) -> bool:
    """Whether a control only corrects what others do, by its name."""
    return bool(_CORRECTION.match(name))


def control_names(armature: bpy.types.Object, needed: Iterable[str]) -> list[str]:
    """Of what bones hang on, that which an artist moves: shown, free, and no mechanism."""
    return [each for each in _moved_by_hand(armature, needed) if not is_correction(each)]


def correction_names(armature: bpy.types.Object, needed: Iterable[str]) -> list[str]:
    """The same, of those that only correct what these do."""
    return [each for each in _moved_by_hand(armature, needed) if is_correction(each)]


def _moved_by_hand(armature: bpy.types.Object, needed: Iterable[str]) -> list[str]:
    assert armature.pose is not None
    names = set(needed)
    driven = {
        name
        for name, channel, _ in driven_channels(armature)
        if channel.startswith(("location", "rotation"))
    }
    return [
        bone.name
        for bone in armature.pose.bones
        if bone.name in names
        and bone.name not in driven
        and not _MECHANISM.match(bone.name)
        and is_shown(bone)
        and Channels(bone).count
    ] + [
        name
        for name in sorted(filter(is_object, names))
        if Channels(control_of(armature, name)).count
    ]


def is_shown(bone: bpy.types.PoseBone) -> bool:
    """Whether a bone can be seen, and so be taken."""
    own: Any = bone
    if bone.bone.hide or getattr(own, "hide", False):
        return False
    collections = bone.bone.collections
    return not collections or any(each.is_visible_effectively for each in collections)


def stiff_joints(armature: bpy.types.Object, joints: Mapping[str, str], size: float) -> set[str]:
    """Of bones by the one that they are to bend against, those that none of the controls bends.

    All controls are moved at random, a few times, and put back as they were.

    Args:
        armature: that can be posed.
        joints: the bone above by bone.
        size: of the rig in the world.
    """
    assert armature.pose is not None
    needs = hangs_on(armature)
    names = control_names(armature, set().union(*(needs[each] for each in joints)))
    bones = [control_of(armature, each) for each in names]
    values = [control_values(each) for each in bones]
    channels = [Channels(each) for each in bones]
    random = np.random.default_rng(1)
    before = _bends(armature, joints)
    most = np.zeros(len(joints))
    for _ in range(_TRIES):
        for bone, each in zip(bones, channels, strict=True):
            each.write(bone, random.uniform(-_TRIED, _TRIED, each.count), size)
        turned = angle_between(_bends(armature, joints), before)
        most = np.maximum(most, turned)
    for bone, kept in zip(bones, values, strict=True):
        set_control_values(bone, kept)
    _bends(armature, joints)
    return {bone for bone, angle in zip(joints, most, strict=True) if angle < _STIFF * _TRIED}


def control_values(control: Control) -> ControlValues:
    """Where a control goes and how it turns, in all of its rotation modes."""
    channels = "location", "rotation_quaternion", "rotation_axis_angle", "rotation_euler"
    return {each: tuple(getattr(control, each)) for each in channels}


def set_control_values(control: Control, values: ControlValues) -> None:
    """Let a control be as it was, to the last bit."""
    for channel, value in values.items():
        setattr(control, channel, value)


def set_all_values(armature: bpy.types.Object, values: Mapping[str, ControlValues]) -> None:
    """The same of several controls, by name."""
    for name, each in values.items():
        set_control_values(control_of(armature, name), each)


def _bends(armature: bpy.types.Object, joints: Mapping[str, str]) -> Floats:
    """Orientations (joints, 4) of bones seen from those above, as Blender shows them."""
    shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert shown.pose is not None
    bones = shown.pose.bones
    pairs = [
        [np.array(bones[each].matrix.to_quaternion()) for each in (bone, above)]
        for bone, above in joints.items()
    ]
    turned = np.array(pairs, dtype=np.float64)
    return multiply(conjugate(turned[:, 1]), turned[:, 0])


class Channels:
    """What of a control can be moved, from how it stands: first it turns, then it goes."""

    def __init__(self, control: Control, *, turned: bool = True, placed: bool = True) -> None:
        self._units = units_of(control)
        self._place = Vector(control.location[:])
        self._turn = _turn(control)
        held = np.array(control.lock_rotation)
        if control.rotation_mode in {"QUATERNION", "AXIS_ANGLE"} and control.lock_rotations_4d:
            held = held | control.lock_rotation_w
        self._angles = np.array(control.rotation_euler, dtype=np.float64)
        self._euler = control.rotation_mode not in {"QUATERNION", "AXIS_ANGLE"} and bool(held.any())
        self._turns = np.flatnonzero(~held & turned)
        free = np.zeros(0, dtype=np.int64)
        if placed and not _is_connected(control):
            free = np.flatnonzero(~np.array(control.lock_location))
        self._moves = free

    @property
    def goes(self) -> bool:
        """Whether it can be moved, not only turned."""
        return bool(len(self._moves))

    @property
    def count(self) -> int:
        return len(self._turns) + len(self._moves)

    def write(self, control: Control, values: Floats, size: float) -> None:
        """Move the control by values (count,): radians, and shares of a size, metres."""
        turn = np.zeros(3)
        turn[self._turns] = values[: len(self._turns)]
        if self._euler:
            control.rotation_euler = (self._angles + turn).tolist()
        elif len(self._turns):
            angle = float(np.linalg.norm(turn))
            more = Quaternion(turn.tolist(), angle) if angle > 0.0 else Quaternion()
            set_rotation(control, self._turn @ more)
        place = np.array(self._place, dtype=np.float64)
        place[self._moves] += self._units * size * values[len(self._turns) :]
        if len(self._moves):
            control.location = place.tolist()

    def is_moved(self, control: Control) -> tuple[bool, bool]:
        """Whether it is turned, and whether it is elsewhere, than it was."""
        turned = self._turn.rotation_difference(_turn(control)).angle
        return min(turned, 2.0 * np.pi - turned) > 1e-4, (
            (Vector(control.location[:]) - self._place).length > 1e-6
        )


def _turn(control: Control) -> Quaternion:
    if isinstance(control, bpy.types.PoseBone):
        return control.matrix_basis.to_quaternion()
    # By its own values: the matrix of an object has its delta transform as well.
    if control.rotation_mode == "QUATERNION":
        return control.rotation_quaternion.normalized()
    if control.rotation_mode == "AXIS_ANGLE":
        angle, *axis = np.array(control.rotation_axis_angle).tolist()
        return Quaternion(axis, angle)
    return control.rotation_euler.to_quaternion()


def _is_connected(control: Control) -> bool:
    """Whether it is a bone that goes where its parent ends."""
    if not isinstance(control, bpy.types.PoseBone):
        return False
    return control.bone.use_connect and control.parent is not None
