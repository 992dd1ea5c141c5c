# SPDX-License-Identifier: GPL-3.0-or-later
"""The action of a base of which some bones move otherwise for a time: its own curves, but there.

What is written hangs on one question, asked bone by bone and moment by moment: is this where the
base has it? Where it is, the base's curves stay, with their keys, handles and interpolation. Where
it is not, there are keys.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.errors import WriteError
from ...core.keyframes import (
    STEP,
    Channel,
    RigChannels,
    Stretch,
    going_on_from,
    in_rotation_mode,
    rotation_property,
    runs_of,
    stretch_keys,
)
from ...core.phrases import phrase
from ...core.rotations import Floats
from ...core.splicing.clip import Clip
from ...core.steps import finished
from ..rig import pose_of
from .actions import (
    add_cycles,
    assign_generated,
    generated_action,
    group_named,
    is_setting,
    key_points,
    mark_generated,
    own_channelbag,
    read_channels,
    shown_curves,
    writable_armature,
)
from .clips import bone_channels, location_axes, slot_of
from .fcurves import KeyArrays, bezier_arrays, evaluate_fcurve, replace_stretch, write_keys
from .kept_curves import (
    can_be_cut,
    copy_curve,
    keep_between,
    key_ends,
    straight_keys,
    write_baked,
    write_stretches,
)
from .poses import AT_REST, PoseValues, UnkeyedPose, keep_unkeyed_pose, unkeyed_pose
from .splice_layer import check_layers, lay_over, take_off

_SAME_TURN: Final = 4e-6
"""Radians by which a bone may be off and be where the base has it: rounding, …"""
_SAME_PLACE: Final = 1e-6
"""… shares of the body's size, …"""
_SAME_SIZE: Final = 1e-6
"""… and factors of its scale."""

_BOUND: Final = 3e-4
"""Radians, shares of the body's size and factors by which keys may be off between them."""

_SEAM: Final = 0.5
"""How far values of one and the same rotation are apart if they are not of one way round."""

_Booleans = NDArray[np.bool_]
_Curves = dict[str, dict[int, bpy.types.FCurve]]
"""By property, then by component."""


@dataclass(frozen=True, eq=False)
class SplicedMotion:
    """A base and what was made of it, at the moments that matter."""

    base: Clip
    """As its action plays it."""
    result: Clip
    """The same moments of the same skeleton; cyclic if it is to repeat as the base does."""
    first: float
    """The base's first frame, …"""
    last: float
    """… and its last one: beyond them, nothing is said of its motion."""
    anew: Clip | None = None
    """The result on all whole frames, for bones that get keys on each of them, …"""
    bones: Collection[str] = ()
    """… and which these are."""
    channels: Sequence[Channel] = ()
    """What else is otherwise, on all of the base's frames: their own keys, or one on each frame."""


@dataclass(frozen=True, eq=False)
class _Property:
    """A property of a bone that is otherwise for a time."""

    path: str
    bone: str
    stretches: Sequence[Stretch]
    bound: float


def write_spliced(
    armature: bpy.types.Object,
    action: bpy.types.Action,
    slot: bpy.types.ActionSlot | None,
    motion: SplicedMotion,
    *,
    name: str,
    note: str,
    previous: bpy.types.Action | None = None,
    settings: str = "",
) -> bpy.types.Action:
    """Give an armature a copy of a base's action in which some bones move otherwise for a time.

    Args:
        armature: the armature object.
        action: that of the base.
        slot: its slot; if none is given the one that the armature uses, or would.
        motion: what is played, and what is to be.
        name: name of a new action.
        note: what it was made from, kept with the action.
        previous: an action written here before, to be written anew if nobody has edited it.
        settings: path of settings whose keys go along from the action that the armature has.

    Returns:
        The action, assigned to the armature.

    Raises:
        WriteError: the armature is read-only, or in NLA tweak mode.
    """
    writable_armature(armature)
    unkeyed = unkeyed_pose(armature)

    def target() -> bpy.types.Action:
        keep_unkeyed_pose(armature)
        result = generated_action(armature, name, previous)
        take_off(armature, result)
        return result

    result = finished(
        filling_spliced(
            armature, action, slot, motion, target=target, unkeyed=unkeyed, settings=settings
        )
    )
    assign_generated(armature, result, note)
    rest_unkeyed(armature, result, unkeyed)
    return result


def filling_spliced(
    armature: bpy.types.Object,
    action: bpy.types.Action,
    slot: bpy.types.ActionSlot | None,
    motion: SplicedMotion,
    *,
    target: Callable[[], bpy.types.Action],
    unkeyed: UnkeyedPose,
    posed: PoseValues | None = None,
    settings: str = "",
) -> Generator[None, None, bpy.types.Action]:
    """Fill an action in steps, between which neither the base's action nor the armature's may get
    or lose curves; see :func:`write_spliced`.

    Args:
        armature: the armature object.
        action: that of the base.
        slot: its slot; if none is given the one that the armature uses, or would.
        motion: what is played, and what is to be.
        target: gives the action to fill once all is known that goes into it.
        unkeyed: the armature's unkeyed pose.
        posed: how it is posed, if that is known.
        settings: path of settings whose keys go along from the action that the armature has.
    """
    base = _curves(armature, action, slot or slot_of(armature, action))
    base |= _setting_curves(armature, settings)
    yield
    changed = yield from _changing(armature, motion, base, unkeyed)
    result = target()
    writer = _Writer(own_channelbag(result, result.slots[0]), motion)
    otherwise = {each.path for each in changed} | {each.data_path for each in motion.channels}
    for path, components in base.items():
        for component, curve in components.items():
            writer.copy(path, component, curve, keys=path not in otherwise)
        yield
    yield from _writing_changed(armature, writer, changed, base, posed)
    if motion.base.cyclic:
        writer.let_repeat(repeats=motion.result.cyclic)
    result.use_cyclic = motion.result.cyclic
    result.use_frame_range = True
    result.frame_start, result.frame_end = motion.first, motion.last
    return result


def write_layer(
    armature: bpy.types.Object,
    action: bpy.types.Action,
    slot: bpy.types.ActionSlot | None,
    motion: SplicedMotion,
    *,
    name: str,
    note: str,
    previous: bpy.types.Action | None = None,
) -> bpy.types.Action:
    """The same as a layer of the NLA over the base: an action that has nothing but what is changed,
    over the time in which it is, on a track of its own.

    Raises:
        WriteError: the armature is read-only, in NLA tweak mode, or its NLA is switched off.
    """
    writable_armature(armature)
    check_layers(armature)
    slot, unkeyed = slot or slot_of(armature, action), unkeyed_pose(armature)

    def target() -> bpy.types.Action:
        keep_unkeyed_pose(armature)
        return generated_action(armature, name, previous)

    result = finished(filling_layer(armature, action, slot, motion, target=target, unkeyed=unkeyed))
    mark_generated(armature, result, note)
    lay_over(armature, result, action, slot)
    return result


def filling_layer(
    armature: bpy.types.Object,
    action: bpy.types.Action,
    slot: bpy.types.ActionSlot,
    motion: SplicedMotion,
    *,
    target: Callable[[], bpy.types.Action],
    unkeyed: UnkeyedPose,
    posed: PoseValues | None = None,
) -> Generator[None, None, bpy.types.Action]:
    """The same in steps, as :func:`filling_spliced`."""
    base = _curves(armature, action, slot)
    yield
    changed = yield from _changing(armature, motion, base, unkeyed)
    result = target()
    writer = _Writer(own_channelbag(result, result.slots[0]), motion)
    yield from _writing_changed(armature, writer, changed, base, posed)
    ends = [each.frames[[0, -1]] for found in changed for each in found.stretches]
    first, last = motion.first, motion.last
    if ends and motion.anew is None and not motion.channels:
        first, last = float(np.min(ends)), float(np.max(ends))
    yield from writer.keeping_between(first, last)
    result.use_cyclic, result.use_frame_range = False, True
    result.frame_start, result.frame_end = first, last
    return result


def _writing_changed(
    armature: bpy.types.Object,
    writer: _Writer,
    changed: Sequence[_Property],
    base: _Curves,
    posed: PoseValues | None,
) -> Generator[None, None, None]:
    for each in changed:
        writer.change(each, base.get(each.path, {}))
        yield
    motion = writer.motion
    if motion.anew is not None:
        channels = yield from bone_channels(armature, motion.anew, motion.bones, posed)
        for channel in channels:
            writer.replace(channel, motion.anew.frames)
    for channel in motion.channels:
        writer.replace(channel, motion.base.frames)
    writer.finish()


def _curves(
    armature: bpy.types.Object, action: bpy.types.Action, slot: bpy.types.ActionSlot
) -> _Curves:
    """The curves of a base that act on something that there is, with keys that are numbers."""
    found: _Curves = defaultdict(dict)
    there: dict[str, bool] = {}
    for curve in shown_curves(action, slot):
        path = curve.data_path
        if path not in there:
            there[path] = _resolves(armature, path)
        if there[path] and np.isfinite(key_points(curve)).all():
            found[path][curve.array_index] = curve
    return dict(found)


def _setting_curves(armature: bpy.types.Object, path: str) -> _Curves:
    """Curves of settings in the action that an armature has; none without a path."""
    data = armature.animation_data
    if not path or data is None or data.action is None or data.action_slot is None:
        return {}
    found = _curves(armature, data.action, data.action_slot)
    return {each: curves for each, curves in found.items() if each.startswith(path)}


def _resolves(armature: bpy.types.Object, path: str) -> bool:
    try:
        armature.path_resolve(path)
    except ValueError:
        return False
    return True


def rest_unkeyed(
    armature: bpy.types.Object, action: bpy.types.Action, unkeyed: UnkeyedPose
) -> None:
    """Put what the action has no curve for where the base has it: another action may have left
    its own pose there.
    """
    (slot,) = action.slots
    keyed = {curve.data_path for curve in shown_curves(action, slot)}
    for bone in pose_of(armature).bones:
        for channel in ("location", "scale", rotation_property(bone.rotation_mode)):
            values = unkeyed.get((bone.name, channel), AT_REST[channel])
            if bone.path_from_id(channel) in keyed or tuple(getattr(bone, channel)) == values:
                continue
            setattr(bone, channel, values)


# --- What is otherwise than in the base -----------------------------------------------------------


def _changing(
    armature: bpy.types.Object, motion: SplicedMotion, base: _Curves, unkeyed: UnkeyedPose
) -> Generator[None, None, list[_Property]]:
    """All properties of bones that are somewhere not what the base has, in steps."""
    skeleton = motion.base.skeleton
    found = _Changes(motion, base, unkeyed, read_channels(armature, skeleton.names))
    yield
    turned, moved, scaled = yield from found.differing()
    result: list[_Property] = []
    for number, bone in enumerate(skeleton.names):
        if bone in motion.bones:
            continue
        if turned[:, number].any():
            result.append(found.rotation(number, turned[:, number]))
        if moved[:, number].any() and not skeleton.connected[number]:
            axes = location_axes(armature, skeleton, number)
            values = motion.result.locations[:, number] @ axes.T
            result.append(found.vector(number, "location", values, moved[:, number]))
        if scaled[:, number].any():
            assert motion.result.scales is not None
            values = motion.result.scales[:, number]
            result.append(found.vector(number, "scale", values, scaled[:, number]))
        yield
    return result


class _Changes:
    """Finds the stretches of a motion."""

    def __init__(
        self, motion: SplicedMotion, base: _Curves, unkeyed: UnkeyedPose, known: RigChannels
    ) -> None:
        self._motion, self._base, self._unkeyed, self._known = motion, base, unkeyed, known
        skeleton = motion.base.skeleton
        self._size = float(np.ptp(skeleton.heads, axis=0).max() + skeleton.lengths.max())

    def differing(self) -> Generator[None, None, tuple[_Booleans, _Booleans, _Booleans]]:
        """Where rotations, locations and scales are not the base's, (moments, bones) each; in
        steps.
        """
        base, result = self._motion.base, self._motion.result
        # Half the angle between quaternions that are close together, of either sign.
        apart = [
            np.abs(result.rotations + sign * base.rotations).max(axis=-1) for sign in (1.0, -1.0)
        ]
        yield
        turned = 2.0 * np.minimum(*apart) > _SAME_TURN
        moved = np.abs(result.locations - base.locations).max(axis=-1) > _SAME_PLACE * self._size
        scaled = np.zeros_like(moved)
        if result.scales is not None:
            before = 1.0 if base.scales is None else base.scales
            yield
            scaled = np.abs(result.scales - before).max(axis=-1) > _SAME_SIZE
        return turned, moved, scaled

    def rotation(self, number: int, differs: _Booleans) -> _Property:
        """A bone's rotation, in its own mode."""
        bone = self._motion.base.skeleton.names[number]
        mode = self._known.modes[bone]
        turns = self._motion.result.rotations[:, number]

        def continuous(rows: slice, start: Floats) -> Floats:
            return going_on_from(in_rotation_mode(turns[rows], mode), mode, start)

        stretches = self._stretches(bone, rotation_property(mode), continuous, differs)
        return self._property(bone, rotation_property(mode), stretches)

    def vector(self, number: int, name: str, values: Floats, differs: _Booleans) -> _Property:
        """A bone's location or scale (moments, 3)."""
        bone = self._motion.base.skeleton.names[number]

        def own(rows: slice, _: Floats) -> Floats:
            return values[rows].copy()

        return self._property(bone, name, self._stretches(bone, name, own, differs))

    def _property(self, bone: str, name: str, stretches: Sequence[Stretch]) -> _Property:
        bound = _BOUND * self._size if name == "location" else _BOUND
        return _Property(self._known.path(bone, name), bone, stretches, bound)

    def _stretches(
        self,
        bone: str,
        name: str,
        values: Callable[[slice, Floats], Floats],
        differs: _Booleans,
    ) -> list[Stretch]:
        """The stretches of a property; its values are asked for with what to go on from."""
        path, still = self._known.path(bone, name), self._unkeyed.get((bone, name), AT_REST[name])
        stretches = []
        for first, last in runs_of(differs, self._motion.base.frames):
            frames = self._motion.base.frames[first : last + 1]
            ends = self._values(path, still, frames[[0, -1]])
            own = values(slice(first, last + 1), ends[0])
            are_open = bool(differs[first]), bool(differs[last])
            stretches.append(_joining(frames, own, ends, are_open))
        return stretches

    def _values(self, path: str, still: Sequence[float], frames: Floats) -> Floats:
        """What the base's curves say at frames, (frames, components)."""
        result = np.tile(np.array(still, dtype=np.float64), (len(frames), 1))
        for component, curve in self._base.get(path, {}).items():
            if component < result.shape[1]:
                result[:, component] = evaluate_fcurve(curve, frames)
        return result


def _joining(frames: Floats, values: Floats, ends: Floats, are_open: tuple[bool, bool]) -> Stretch:
    """A stretch that meets the curves on either side.

    Args:
        frames: (moments,)
        values: (moments, components)
        ends: (2, components) what the curves have at the first and the last moment.
        are_open: whether there are none before, or after.
    """
    if not are_open[0]:
        values[0] = ends[0]
    if not are_open[1]:
        cut = frames[-1] - frames[-2] < 2.0 * STEP
        if not cut and np.abs(values[-1] - ends[1]).max() > _SEAM:
            # The same, but by another way round: it changes over where no one looks.
            frames = np.insert(frames, -1, frames[-1] - STEP)
            values = np.insert(values, -1, values[-1], axis=0)
        values[-1] = ends[1]
    return Stretch(frames, values, *are_open)


# --- Writing --------------------------------------------------------------------------------------


class _Writer:
    """Fills a channelbag: curves that are there already are filled anew, all others go."""

    def __init__(self, channelbag: bpy.types.ActionChannelbag, motion: SplicedMotion) -> None:
        self._channelbag, self.motion = channelbag, motion
        self._old = {(each.data_path, each.array_index): each for each in channelbag.fcurves}
        self._made: dict[tuple[str, int], bpy.types.FCurve] = {}

    def copy(self, path: str, component: int, curve: bpy.types.FCurve, *, keys: bool) -> None:
        """A curve of the base, as it is; its keys if they are wanted."""
        group = curve.group.name if curve.group is not None else ""
        copy_curve(curve, self._curve(path, component, group), keys=keys)

    def change(self, changed: _Property, kept: Mapping[int, bpy.types.FCurve]) -> None:
        """A property that is otherwise for a time; ``kept`` are the base's curves of it."""
        keys = [stretch_keys(each, changed.bound, _cuts(each)) for each in changed.stretches]
        pairs = list(zip(changed.stretches, keys, strict=True))
        for component in range(pairs[0][0].values.shape[1]):
            own = kept.get(component)
            curve = self._curve(changed.path, component, changed.bone)
            if own is None or can_be_cut(own, changed.stretches):
                write_stretches(curve, own, pairs, component)
                continue
            base = self.motion
            frames = np.arange(np.ceil(4.0 * base.first), np.floor(4.0 * base.last) + 1.0) / 4.0
            pieces = [(each.frames, each.values[:, component]) for each in changed.stretches]
            write_baked(curve, own, pieces, frames, changed.bound)

    def replace(self, channel: Channel, frames: Floats) -> None:
        """A property that has a key on each frame (frames,), or keys of its own."""
        for component in range(channel.values.shape[1]):
            curve = self._curve(channel.data_path, component, channel.group)
            for modifier in list(curve.modifiers):
                curve.modifiers.remove(modifier)
            write_keys(curve, channel_keys(channel, component, frames))

    def keeping_between(self, first: float, last: float) -> Iterator[None]:
        """Let curves have no keys but between two frames, and at both, in steps."""
        for curve in self._made.values():
            keep_between(curve, first, last)
            yield

    def let_repeat(self, *, repeats: bool) -> None:
        """Let all curves repeat the base's cycle, as far as no modifiers do, or none of them."""
        for curve in self._made.values():
            if not repeats:
                for modifier in [each for each in curve.modifiers if each.type == "CYCLES"]:
                    curve.modifiers.remove(modifier)
            elif not (len(curve.modifiers) or curve.is_empty or is_setting(curve.data_path)):
                key_ends(curve, self.motion.first, self.motion.last)
                add_cycles(curve)

    def finish(self) -> None:
        """What is not wanted any more goes."""
        for place, curve in self._old.items():
            if place not in self._made:
                self._channelbag.fcurves.remove(curve)
        for group in list(self._channelbag.groups):
            if not len(group.channels):
                self._channelbag.groups.remove(group)

    def _curve(self, path: str, component: int, group: str) -> bpy.types.FCurve:
        place = path, component
        if place in self._made:
            return self._made[place]
        curve = self._old.get(place)
        if curve is None:
            curve = self._channelbag.fcurves.new(path, index=component)
        if group and (curve.group is None or curve.group.name != group):
            curve.group = group_named(self._channelbag, group)
        self._made[place] = curve
        return curve


def channel_keys(channel: Channel, component: int, frames: Floats) -> KeyArrays:
    """Keys of one component: the channel's own, or straight ones on each frame (frames,)."""
    if channel.keys is not None:
        return bezier_arrays(channel.keys, component)
    return straight_keys(np.column_stack([frames, channel.values[:, component]]))


def write_into(
    armature: bpy.types.Object,
    action: bpy.types.Action,
    slot: bpy.types.ActionSlot | None,
    frames: Floats,
    channels: Sequence[Channel],
) -> None:
    """Put channels into an action itself, in place of the keys that it has between two frames.

    Args:
        armature: the armature object.
        action: the action.
        slot: its slot; if none is given the one that the armature uses, or would.
        frames: (frames,) of the channels' values.
        channels: what is otherwise.

    Raises:
        WriteError: the armature or the action is read-only.
    """
    writable_armature(armature)
    if not action.is_editable:
        raise WriteError(
            phrase("The action '{action}' is linked and read-only.", action=action.name),
            "Choose New Layer or New Action as the Result.",
        )
    channelbag = own_channelbag(action, slot or slot_of(armature, action))
    for channel in channels:
        for component in range(channel.values.shape[1]):
            curve = channelbag.fcurves.find(channel.data_path, index=component)
            if curve is None:
                curve = channelbag.fcurves.new(channel.data_path, index=component)
                curve.group = group_named(channelbag, channel.group)
            replace_stretch(curve, channel_keys(channel, component, frames))


def _cuts(stretch: Stretch) -> Floats:
    """Moments on either side of a cut: both have keys."""
    close = np.flatnonzero(np.diff(stretch.frames) < 2.0 * STEP)
    return stretch.frames[np.union1d(close, close + 1)]
