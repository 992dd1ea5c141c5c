# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys that a session of posing makes, by the rules of Blender's own keying, and can take back.

As long as the session lasts, everything that it changes in an action is noted: each curve as it
was before its first key, the action and the NLA tracks. ``take_back`` restores all of it. Actions
are known by their session's number: meanwhile they may be renamed, and a linked one may be called
like one of this file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal

import bpy
import numpy as np

from ...core.errors import WriteError
from ...core.keyframes import (
    LOCATION,
    Channel,
    Limb,
    Track,
    going_on_from,
    reduce_keys,
    rotation_property,
)
from ...core.phrases import phrase
from ...core.rotations import Floats
from ..rig import carrying_axes
from .actions import (
    channelbags_of,
    curves_of,
    group_named,
    own_channelbag,
    read_channels,
    writable_object,
)
from .fcurves import KeyArrays, bezier_arrays, read_keys, replace_stretch, write_keys
from .pose_layers import BLENDING, blend_about, bone_paths, is_dense

Target = Literal["CURRENT", "COPY", "LAYER", "CHOSEN"]


@dataclass(frozen=True)
class Keyed:
    """A bone to key: its rotation has changed, and perhaps its location."""

    bone: str
    placed: bool = False


_BLENDING: Final = ("action_blend_type", "action_influence", "action_extrapolation")
"""How an armature's action lies over its NLA tracks."""


@dataclass(eq=False)
class _Before:
    """An action as it was before the session's first key in it."""

    had_data: bool
    action: int
    """The action that the armature had, 0 for none."""
    slot: int
    blending: tuple[Any, ...]
    keyed: int = 0
    """The action that keys go to, …"""
    keyed_slot: int = 0
    """… and the handle of its slot."""
    curves: dict[str, dict[int, KeyArrays]] = field(default_factory=dict)
    """By property, of those that got keys, and by component."""
    groups: set[str] = field(default_factory=set)
    made: bool = False
    """Whether that action was made for the keys."""
    track: str | None = None
    """The NLA track that was made, if one was."""
    beneath: str = ""
    """Name of the action that became a strip because it has a key on every frame."""
    fake_user: bool = False
    new_slot: int | None = None
    """Handle of the slot that was made in a chosen action."""


@dataclass(frozen=True)
class _Layer:
    """What single keys go to where the action itself has keys on every frame."""

    blend: float
    paths: tuple[str, ...]
    """How the data paths begin of what gets keys."""
    frame: float

    def is_needed(self, data: bpy.types.AnimData) -> bool:
        action, slot = data.action, data.action_slot
        if action is None or slot is None or BLENDING in action:
            return False
        return is_dense(action, slot, self.paths, self.frame)


class PoseKeys:
    """Keys on one armature.

    They go to the action that it has (a new one if it has none), a copy of it, a new action over it
    in the NLA, or a chosen one, as the target says. Where that has a key on every frame, they go to
    a new action over it, which comes in and goes out over ``blend`` frames.

    Raises:
        WriteError: it cannot be animated here, or the chosen action is gone or read-only.
    """

    def __init__(
        self,
        armature: bpy.types.Object,
        target: Target = "CURRENT",
        chosen: bpy.types.Action | None = None,
        *,
        blend: float = 8.0,
    ) -> None:
        writable_object(armature)
        self._blend = blend
        self._target: Target = target
        self._chosen = _number(chosen)
        self._noted: list[_Before] = []
        """One for each action that got keys: artists may give the armature another meanwhile."""
        self.count = 0
        """How many times keys were made."""
        self.layered = ""
        """The action with a key on every frame over which the last keys lie, if they do."""
        if target == "CHOSEN":
            _chosen_action(self._chosen)
        data = armature.animation_data
        if target == "CURRENT" and data is not None and data.action is not None:
            _writable_action(data.action)

    def insert(
        self,
        armature: bpy.types.Object,
        keyed: Iterable[Keyed],
        frame: float,
        *,
        auto: bool = False,
    ) -> list[str]:
        """Key bones as they are, by the scene's keying set and the settings of (auto) keying.

        Without a keying set the channels that posing moves get keys: rotation, and the location of
        bones that were moved as a whole. Returns names of the bones that got a key: with *Only
        Insert Needed* not all may.

        Raises:
            WriteError: the action cannot be written.
        """
        bones = list(keyed)
        scene = bpy.context.scene
        assert scene is not None
        known = len(self._noted)
        self._prepare(armature, (bone_paths(each.bone for each in bones), frame))
        options, kind = keying_options(scene, auto=auto), key_type(scene)
        if self._blends(armature):
            # What is there to be keyed is in the motion beneath.
            options.discard("INSERTKEY_AVAILABLE")
        active = scene.keying_sets_all.active
        assert scene.tool_settings is not None
        if auto and not scene.tool_settings.use_keyframe_insert_keyingset:
            active = None
        if active is not None and active.is_path_absolute:
            how = with_keying_set(options, active), kind
            done = self._insert_paths(armature, active, frame, how)
        else:
            done = []
            for each in bones:
                bone = armature.pose.bones[each.bone] if armature.pose is not None else None
                if bone is None:
                    continue
                how = with_keying_set(options, active), kind
                results = [
                    self._insert(armature, bone.path_from_id(channel), frame, each.bone, how)
                    for channel in keyed_properties(bone, active, placed=each.placed)
                ]
                if any(results):
                    done.append(each.bone)
        if not done and len(self._noted) > known:
            # No action is left behind that nothing went into.
            self.drop_last(armature)
        self._inserted(armature, frame, any_done=bool(done))
        return [name for name in done if name]

    def check_motion(self, armature: bpy.types.Object) -> None:
        """See whether a motion can be written into the action as it is.

        Raises:
            WriteError: what the action has is not what is shown.
        """
        data = armature.animation_data
        if data is None or data.action is None or not data.use_nla:
            return
        if self._target == "LAYER" and not self._noted:
            return
        beneath = any(not track.mute for track in data.nla_tracks)
        if beneath and (data.action_blend_type != "REPLACE" or data.action_influence < 1.0):
            raise WriteError(
                phrase(
                    "The action of '{armature}' adds to its NLA tracks, or is blended with them.",
                    armature=armature.name,
                ),
                "Let the keys go to a new layer, or set the action to Replace in the NLA editor.",
            )

    def insert_motion(
        self,
        armature: bpy.types.Object,
        frames: Floats,
        rotations: Mapping[str, Floats],
        locations: Mapping[str, Floats],
        *,
        angle: float,
        distance: float,
    ) -> int:
        """Write a motion as few keys, in place of what the bones had between its ends; number of
        key frames.

        At frames (frames,), ascending, bones have rotations (frames, 4) from rest, and locations
        (frames, 3) in their rest frames. Each may be off by an angle, radians, and a distance,
        armature units.
        """
        if not rotations or len(frames) < 2:
            return 0
        self._prepare(armature)
        names = list(rotations)
        assert armature.pose is not None
        bones, known = armature.pose.bones, read_channels(armature, [*names, *locations])
        modes = [bones[name].rotation_mode for name in names]
        turns = np.stack([rotations[name] for name in names], axis=1)
        action, slot = _assigned(armature)
        turned = [
            _going_on(action, slot, channel, mode, float(frames[0]))
            for channel, mode in zip(known.rotations(names, turns), modes, strict=True)
        ]
        placed = [
            known.location(name, _placed(bones[name].bone, each))
            for name, each in locations.items()
        ]
        tracks = [Track(each.values, mode) for each, mode in zip(turned, modes, strict=True)]
        tracks += [Track(each.values, LOCATION) for each in placed]
        (found,) = reduce_keys(frames, [Limb(tracks, angle, distance)])
        for channel, keys in zip([*turned, *placed], found, strict=True):
            self._replace(
                armature, channel, [bezier_arrays(keys, n) for n in range(channel.values.shape[1])]
            )
        self.count += 1
        mark_file_changed()
        return len(found[0])

    def drop_last(self, armature: bpy.types.Object) -> None:
        """Undo what was noted last."""
        _take_back(armature, self._noted.pop())

    def take_back(self, armature: bpy.types.Object) -> None:
        """Undo all keys, actions and tracks of this session; safe to call twice.

        An action that the artist has given the armature since is left to it.
        """
        while self._noted:
            _take_back(armature, self._noted.pop())

    # --- Where keys go ----------------------------------------------------------------------

    def _prepare(
        self, armature: bpy.types.Object, near: tuple[tuple[str, ...], float] | None = None
    ) -> None:
        """Note how things are, and give the armature the action that keys go to.

        What is to get a single key at a frame, by how its data paths begin, is near.

        Raises:
            WriteError: there is none that could be written; nothing has changed then.
        """
        data = armature.animation_data
        if self._noted and data is not None and _has(data, self._noted[-1]):
            return
        writable_object(armature)
        had_data = data is not None
        data = data or armature.animation_data_create()
        assert data is not None
        before = _Before(
            had_data=had_data,
            action=_number(data.action),
            slot=data.action_slot_handle,
            blending=tuple(getattr(data, each) for each in _BLENDING),
            fake_user=data.action.use_fake_user if data.action else False,
        )
        try:
            layer = _Layer(self._blend, *near) if near is not None else None
            _give_action(armature, data, before, (self._target, self._chosen), layer)
            assert data.action is not None
            _writable_action(data.action)
        except BaseException:
            before.keyed = _number(data.action)
            _take_back(armature, before)
            raise
        self._noted.append(before)

    # --- Single keys ------------------------------------------------------------------------

    def _blends(self, armature: bpy.types.Object) -> bool:
        """Whether keys go to a layer over an action that has some on every frame."""
        return BLENDING in _assigned(armature)[0]

    def _inserted(self, armature: bpy.types.Object, frame: float, *, any_done: bool) -> None:
        """See to what goes with keys at a frame, if there are any."""
        self.layered = ""
        if not any_done:
            return
        self.count += 1
        mark_file_changed()
        if self._blends(armature):
            blend_about(*_assigned(armature), self._noted[-1].curves, frame)
            self.layered = self._noted[-1].beneath

    def _note(self, armature: bpy.types.Object, path: str) -> None:
        """Keep the curves of a property as they were before their first key."""
        noted = self._noted[-1].curves
        if path not in noted:
            curves = curves_of(*_assigned(armature))
            noted[path] = {
                each.array_index: read_keys(each) for each in curves if each.data_path == path
            }

    def _insert(
        self,
        armature: bpy.types.Object,
        path: str,
        frame: float,
        group: str,
        how: tuple[set[str], str],
        *,
        component: int = -1,
    ) -> bool:
        self._note(armature, path)
        options, kind = how
        try:
            return armature.keyframe_insert(
                path,
                index=component,
                frame=frame,
                group=group,
                options=options,  # type: ignore[arg-type]
                keytype=kind,  # type: ignore[arg-type]
            )
        except RuntimeError:
            # Blender raises where a key is not needed, or a curve is locked.
            return False

    def _insert_paths(
        self,
        armature: bpy.types.Object,
        keying_set: bpy.types.KeyingSet,
        frame: float,
        how: tuple[set[str], str],
    ) -> list[str]:
        """Names of the bones that got keys, empty ones for other properties."""
        done: list[str] = []
        for path in keying_set.paths:
            if path.id != armature:
                continue
            name = path.data_path.partition('pose.bones["')[2].partition('"]')[0]
            try:
                value = armature.path_resolve(path.data_path)
            except ValueError:
                # A bone or a property that is no longer there.
                continue
            single = not path.use_entire_array and hasattr(value, "__len__")
            component = path.array_index if single else -1
            if self._insert(armature, path.data_path, frame, name, how, component=component):
                done.append(bpy.utils.unescape_identifier(name))
        return list(dict.fromkeys(done))

    def _replace(
        self, armature: bpy.types.Object, channel: Channel, keys: Sequence[KeyArrays]
    ) -> None:
        self._note(armature, channel.data_path)
        channelbag = own_channelbag(*_assigned(armature))
        for component, each in enumerate(keys):
            curve = channelbag.fcurves.find(channel.data_path, index=component)
            if curve is not None and (curve.lock or (curve.group and curve.group.lock)):
                continue
            if curve is None:
                curve = channelbag.fcurves.new(channel.data_path, index=component)
                curve.group = group_named(channelbag, channel.group)
            replace_stretch(curve, each)


def mark_file_changed() -> None:
    """Let Blender ask before it closes a file with what a session has changed so far.

    Blender notes that with each undo step, and a session is one of them, at its end. Where
    preferences want no undo steps at all, pushing one makes the note alone.
    """
    preferences = bpy.context.preferences
    if bpy.data.is_dirty or preferences is None:
        return
    edit, unsaved = preferences.edit, preferences.is_dirty
    steps = edit.undo_steps
    edit.undo_steps = 0
    try:
        bpy.ops.ed.undo_push(message="Pose by Hand")
    finally:
        edit.undo_steps = steps
        preferences.is_dirty = unsaved


def _assigned(armature: bpy.types.Object) -> tuple[bpy.types.Action, bpy.types.ActionSlot]:
    """The action and the slot that keys go to, once the armature has them."""
    data = armature.animation_data
    assert data is not None
    assert data.action is not None
    assert data.action_slot is not None
    return data.action, data.action_slot


def _give_action(
    armature: bpy.types.Object,
    data: bpy.types.AnimData,
    before: _Before,
    where: tuple[Target, int],
    layer: _Layer | None,
) -> None:
    """Give the armature the action that keys go to, and note which that is.

    Raises:
        WriteError: there is none that could be written.
    """
    target, chosen_number = where
    if target == "CHOSEN":
        chosen = _chosen_action(chosen_number)
        if chosen != data.action:
            _keep(data.action)
            data.action = chosen
            before.new_slot = _use_slot(data, armature)
    action, slot = data.action, data.action_slot
    blends = target != "LAYER" and layer is not None and layer.is_needed(data)
    if target == "COPY" and action is not None and not blends:
        copy = action.copy()
        assert copy is not None
        before.made = True
        _keep(action)
        data.action = copy
        data.action_slot = next(
            (each for each in copy.slots if slot and each.identifier == slot.identifier), None
        )
    elif (target == "LAYER" or blends) and action is not None and slot is not None:
        if not data.use_nla:
            raise WriteError(
                phrase(
                    "The NLA of '{armature}' is switched off: no layer would be seen.",
                    armature=armature.name,
                ),
                "Switch it on in the NLA editor, or let the keys go to another action.",
            )
        before.track = _push_down(data, action, slot)
    if data.action is None or before.track is not None:
        made = bpy.data.actions.new(f"{armature.name} Pose")
        made.slots.new("OBJECT", armature.name)
        made.layers.new("Layer").strips.new(type="KEYFRAME")
        data.action = made
        before.made = True
        data.action_slot = made.slots[made.slots[0].identifier]
        data.action_blend_type, data.action_influence = "REPLACE", 1.0
        if blends and layer is not None and action is not None:
            data.action_blend_type = "COMBINE"
            made[BLENDING], before.beneath = layer.blend, action.name
    assert data.action is not None
    _writable_action(data.action)
    if data.action_slot is None:
        before.new_slot = _use_slot(data, armature)
    before.keyed, before.keyed_slot = _number(data.action), data.action_slot_handle
    channelbags = channelbags_of(*_assigned(armature))
    before.groups = {group.name for each in channelbags for group in each.groups}


def _push_down(
    data: bpy.types.AnimData, action: bpy.types.Action, slot: bpy.types.ActionSlot
) -> str:
    """Make an NLA strip of the action that is played; the name of its track."""
    track = data.nla_tracks.new()
    track.name = f"{action.name} below"
    strip = track.strips.new(action.name, round(action.frame_range[0]), action)
    strip.action_slot = slot
    _blend_alike(strip, data)
    # Strips are made on whole frames; this one is to play what was played before.
    length = strip.frame_end - strip.frame_start
    strip.frame_start = action.frame_range[0]
    strip.frame_end = strip.frame_start + length
    return track.name


def _take_back(armature: bpy.types.Object, before: _Before) -> None:
    keyed = _action_of(before.keyed)
    if keyed is not None and not before.made:
        _restore_curves(keyed, before)
    data = armature.animation_data
    if data is not None and _number(data.action) == before.keyed:
        action = _action_of(before.action)
        data.action = action
        if action is not None:
            data.action_slot = next(
                (slot for slot in action.slots if slot.handle == before.slot), None
            )
            if action.library is None:
                action.use_fake_user = before.fake_user
        for name, value in zip(_BLENDING, before.blending, strict=True):
            setattr(data, name, value)
        if before.track is not None and before.track in data.nla_tracks:
            data.nla_tracks.remove(data.nla_tracks[before.track])
    if keyed is not None and before.new_slot is not None and not before.made:
        for slot in keyed.slots:
            if slot.handle == before.new_slot:
                keyed.slots.remove(slot)
                break
    if keyed is not None and before.made and keyed.users <= keyed.use_fake_user:
        bpy.data.actions.remove(keyed)
    unused = data is not None and not (data.action or data.nla_tracks or data.drivers)
    if not before.had_data and unused:
        armature.animation_data_clear()


def _going_on(
    action: bpy.types.Action, slot: bpy.types.ActionSlot, channel: Channel, mode: str, start: float
) -> Channel:
    """The same turns in the sign or the round that the curves have where they begin.

    Else the way there from the key before would lead through a whole turn.
    """
    values = channel.values
    curves = {
        curve.array_index: curve
        for curve in curves_of(action, slot)
        if curve.data_path == channel.data_path and len(curve.keyframe_points)
    }
    if len(curves) < values.shape[1]:
        return channel
    before = np.array([curves[each].evaluate(start) for each in range(values.shape[1])])
    return replace(channel, values=going_on_from(values, mode, before))


def _placed(bone: bpy.types.Bone, locations: Floats) -> Floats:
    """Locations (frames, 3) in a bone's rest frame, along the axes that it is placed in."""
    return locations if bone.use_local_location else locations @ np.array(carrying_axes(bone)).T


def _number(action: bpy.types.Action | None) -> int:
    """By which an action is known as long as its file is open, 0 for none."""
    return 0 if action is None else action.session_uid


def _action_of(number: int) -> bpy.types.Action | None:
    return next((each for each in bpy.data.actions if each.session_uid == number), None)


def _has(data: bpy.types.AnimData, before: _Before) -> bool:
    """Whether the armature still has the action and the slot that keys went to."""
    return (_number(data.action), data.action_slot_handle) == (before.keyed, before.keyed_slot)


def _chosen_action(number: int) -> bpy.types.Action:
    if not number:
        raise WriteError(
            "No action is chosen for the keys.", "Choose one in the panel Pose, under Keys."
        )
    action = _action_of(number)
    if action is None:
        raise WriteError("The action for the keys is gone.", "Choose another one.")
    _writable_action(action)
    return action


def _writable_action(action: bpy.types.Action) -> None:
    if action.library is not None or not action.is_editable:
        raise WriteError(
            phrase("Action '{action}' is linked and read-only.", action=action.name),
            "Let the keys go to a copy, or to a layer.",
        )


def _keep(action: bpy.types.Action | None) -> None:
    """Save an action that is taken off from being purged."""
    if action is not None and action.library is None:
        action.use_fake_user = True


def _blend_alike(strip: bpy.types.NlaStrip, data: bpy.types.AnimData) -> None:
    """Let a strip lie over what is below it as the action did."""
    strip.blend_type = data.action_blend_type
    strip.extrapolation = data.action_extrapolation
    if data.action_influence < 1.0:
        strip.use_animated_influence = True
        curve = strip.fcurves.find("influence")
        assert curve is not None
        curve.keyframe_points.insert(strip.frame_start, data.action_influence, options={"REPLACE"})


def _restore_curves(action: bpy.types.Action, before: _Before) -> None:
    slot = next((each for each in action.slots if each.handle == before.keyed_slot), None)
    channelbag = next(channelbags_of(action, slot), None) if slot is not None else None
    if channelbag is None:
        return
    for curve in list(channelbag.fcurves):
        if curve.data_path not in before.curves:
            continue
        keys = before.curves[curve.data_path].get(curve.array_index)
        if keys is None:
            channelbag.fcurves.remove(curve)
        else:
            write_keys(curve, keys)
    for group in list(channelbag.groups):
        if group.name not in before.groups and not len(group.channels):
            channelbag.groups.remove(group)


def _use_slot(data: bpy.types.AnimData, armature: bpy.types.Object) -> int | None:
    """Take the slot of the action that is the armature's, by name or as the only one.

    Returns the handle of a slot that had to be made.
    """
    action = data.action
    assert action is not None
    fitting = [slot for slot in action.slots if slot.target_id_type in ("OBJECT", "UNSPECIFIED")]
    for slot in fitting:
        if slot.identifier == f"OB{armature.name}" or armature in slot.users():
            data.action_slot = slot
            return None
    if len(fitting) == 1:
        data.action_slot = fitting[0]
        return None
    made = action.slots.new("OBJECT", armature.name)
    data.action_slot = made
    return made.handle


# --- The artist's own settings of keying: which channels get a key, and under which conditions ----


_SETS: Final[tuple[tuple[str, str], ...]] = (
    ("Loc", "location"),
    ("Rot", "rotation"),
    ("Scal", "scale"),
)
"""Parts of the names of Blender's own keying sets, and what they key."""


def keying_options(scene: bpy.types.Scene, *, auto: bool) -> set[str]:
    """The artist's settings of keying, those of Insert Keyframe or of auto keying."""
    preferences = bpy.context.preferences
    assert preferences is not None
    assert scene.tool_settings is not None
    found: set[str] = set()
    edit = preferences.edit
    if edit.use_auto_keyframe_insert_needed if auto else edit.use_keyframe_insert_needed:
        found.add("INSERTKEY_NEEDED")
    if auto and edit.use_keyframe_insert_available:
        found.add("INSERTKEY_AVAILABLE")
    if auto and scene.tool_settings.auto_keying_mode == "REPLACE_KEYS":
        found.add("INSERTKEY_REPLACE")
    if edit.use_visual_keying:
        found.add("INSERTKEY_VISUAL")
    if scene.tool_settings.use_keyframe_cycle_aware:
        found.add("INSERTKEY_CYCLE_AWARE")
    return found


def key_type(scene: bpy.types.Scene) -> str:
    """The kind of keys that the timeline is set to."""
    assert scene.tool_settings is not None
    return scene.tool_settings.keyframe_type


def with_keying_set(options: set[str], active: bpy.types.KeyingSet | None) -> set[str]:
    """The options, with what a keying set says of them."""
    if active is None:
        return options
    result = set(options)
    for own, option in (("needed", "INSERTKEY_NEEDED"), ("visual", "INSERTKEY_VISUAL")):
        if getattr(active, f"use_insertkey_override_{own}"):
            result.discard(option)
            result |= {option} if getattr(active, f"use_insertkey_{own}") else set()
    if active.bl_idname == "Available":
        result.add("INSERTKEY_AVAILABLE")
    elif active.type_info is not None and "Visual" in active.bl_idname:
        result.add("INSERTKEY_VISUAL")
    return result


def keyed_properties(
    bone: bpy.types.PoseBone, active: bpy.types.KeyingSet | None, *, placed: bool
) -> list[str]:
    """Properties of a bone that get a key."""
    rotation = rotation_property(bone.rotation_mode)
    if active is not None:
        name = active.bl_idname
        if name.startswith(("Available", "WholeCharacter")):
            return ["location", rotation, "scale"]
        found = [channel for part, channel in _SETS if part in name and "Delta" not in name]
        if found:
            return [rotation if each == "rotation" else each for each in found]
    return ["location", rotation] if placed else [rotation]
