# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays to actions: keys in bulk, and never a key lost that an artist has set.

An action made here carries a mark: whose it is, and a fingerprint of its keys as written. As long
as the fingerprint still fits and nothing else uses the action, it may be written anew in place.
Any other action is left exactly as it is.
"""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from operator import is_not, itemgetter
from typing import Any, Final

import bpy
import numpy as np

from ...core.errors import RigError, WriteError
from ...core.keyframes import (
    BezierKeys,
    Channel,
    ObjectChannels,
    RigChannels,
    rotation_property,
)
from ...core.phrases import phrase
from ...core.rotations import IDENTITY, Floats, from_matrix, from_mode_values
from ...core.steps import finished
from ..rig import ALIGNED, armature_data, pose_of

MARK: Final = "octo_motion_generated"
"""Custom property of an action made here: a group with the fields of ``_mark``."""

_ENUMERATION: Final = np.uint8
"""What Blender keeps a key's enumerations in: with another type it copies them one by one."""
_MARK_VERSION: Final = 1
"""Counts up when the fingerprint is taken otherwise: older actions then count as edited."""

_HANDLE_SLACK: Final = 1e-3
"""Share of a handle's length by which it may stray: each time that Blender aligns handles, it
rounds them anew."""

_TRAVELS: Final = 1e-4
"""Difference between the first and last value of a place from which on a loop leads elsewhere."""

_BEING_WRITTEN: Final = ""
"""Fingerprint of an action while it gets its keys."""
_KINDS: Final = ("interpolation", "handle_left_type", "handle_right_type", "type")
_RANGE: Final = ("use_frame_range", "frame_start", "frame_end", "use_cyclic")
_PLACES: Final = ("co", "handle_left", "handle_right")
"""All that is kept of a key."""
CHANNELS_AT_ONCE: Final = 6
"""How many get their keys at one step at most, while Blender goes on …"""
_FRAMES_AT_ONCE: Final = 2_500
"""… and how many frames all of them together, of a long motion: a few milliseconds."""
_SEEN_AT_ONCE: Final = 3
"""The same where Blender may look at each of them, and works the frame out again."""
_CURVES_AT_ONCE: Final = 50
"""How many are read at one step to see whether they have been edited."""
_TOLD_AT_ONCE: Final = 20
"""How many Blender looks at anew at one step: after each of them it works the frame out again."""
_LOOKED_AT_AT_ONCE: Final = 40
"""How many channels it is looked at in one step whether they are what they are to be."""
_LEAST_SPACING: Final = 0.01
"""Blender takes keys that are no further apart, in frames, for one and the same."""


def writable_armature(obj: bpy.types.Object) -> None:
    """Make sure that an action can be given to this armature, and will be saved with the file.

    Raises:
        RigError: the object is no armature.
        WriteError: it is linked, a library override that is not editable, or in NLA tweak mode.
    """
    armature_data(obj)
    writable_object(obj)


def writable_object(obj: bpy.types.Object) -> None:
    """The same for any object.

    Raises:
        WriteError: it is linked, a library override that is not editable, or in NLA tweak mode.
    """
    # Python may assign an action to a linked object: it animates, and is gone when the file is
    # opened again. Of a local object with linked armature data, and of an editable override, the
    # action is saved.
    if obj.library is not None:
        problem = phrase(
            "'{obj}' is linked from '{library}' and is read-only here.",
            obj=obj.name,
            library=obj.library.name,
        )
        if all(scene.library is not None for scene in obj.users_scene):
            raise WriteError(
                problem,
                "Link its collection into a scene of this file and make a library override "
                "(Object > Library Override > Make).",
            )
        raise WriteError(problem, "Make a library override (Object > Library Override > Make).")
    if obj.override_library is not None and obj.override_library.is_system_override:
        raise WriteError(
            phrase("'{obj}' is a library override that is not editable.", obj=obj.name),
            "Make it editable: select it and choose Object > Library Override > Make.",
        )
    data = obj.animation_data
    if data is not None and data.use_tweak_mode:
        raise WriteError(
            phrase("'{obj}' is in the tweak mode of the NLA editor.", obj=obj.name),
            "Leave tweak mode there (Tab) and try again.",
        )
    if data is not None and data.is_property_readonly("action"):
        raise WriteError(
            phrase("The animation of '{obj}' is read-only.", obj=obj.name),
            "Choose an object that can be edited.",
        )


def read_channels(
    armature: bpy.types.Object, bones: Sequence[str], *, travels: bool = False
) -> RigChannels:
    """What the channels of some bones are called, and in which rotation modes they are.

    Args:
        armature: the armature object.
        bones: names of its bones.
        travels: whether the object's own channels are wanted as well.

    Raises:
        RigError: the armature has no such bone; the parent's scale is zero in some direction.
    """
    pose_bones = _pose_bones(armature, bones)
    return RigChannels(
        paths={bone.name: bone.path_from_id() for bone in pose_bones},
        modes={bone.name: bone.rotation_mode for bone in pose_bones},
        aligned=frozenset(bone.name for bone in pose_bones if bone.bone.inherit_scale == ALIGNED),
        own=read_object_channels(armature) if travels else None,
    )


def read_object_channels(obj: bpy.types.Object) -> ObjectChannels:
    """How an object's own channels stand to the world at the current frame.

    The parent is taken as it stands; if it moves, it carries the object along. A parent with
    unequal scales shears what hangs on it: the rotation is then the nearest there is.

    Raises:
        RigError: the parent's scale is zero in some direction.
    """
    return ObjectChannels(
        rotation_mode=obj.rotation_mode,
        frame=parent_frame(obj),
        turn=_parent_turn(obj),
        delta_location=np.array(obj.delta_location),
        delta_rotation=delta_rotation(obj),
    )


def write_action(
    obj: bpy.types.Object,
    name: str,
    frames: Floats,
    channels: Sequence[Channel],
    *,
    previous: bpy.types.Action | None,
    settings_note: str = "",
    repeats: bool = False,
    replaceable: bool = False,
    automatic: bool = False,
    beneath: bool = False,
    filled: HalfWritten | None = None,
) -> bpy.types.Action:
    """Give an object an action with these channels: their own keys, or one key per frame.

    ``previous`` is written anew in place, and keeps its name, slot and users, if it was made here
    for this object, nobody has edited it since, and no other object, NLA strip or constraint uses
    it. Otherwise it is left alone and a new action is made. The action that the object had until
    now is never changed; if nothing else uses it, a fake user saves it from being purged.

    Args:
        obj: the object to animate.
        name: name of a new action.
        frames: (frames,), ascending; fractions are kept.
        channels: values at these frames.
        previous: the action to write anew, or none.
        settings_note: kept with the action, for whoever wants to know how it was made.
        repeats: whether curves go on before their first key and after their last, over and over.
        replaceable: whether :func:`may_replace` has just said yes of ``previous``.
        automatic: whether keys on every frame have automatic handles, and lead straight on if not.
        beneath: whether the object goes on with the action that it has, which lies over this one.
        filled: what was written of the previous one already.

    Returns:
        The action, assigned to the object together with its slot.

    Raises:
        WriteError: the object is read-only, or in NLA tweak mode. Nothing has changed then.
    """
    times = _checked(frames, channels)
    action = generated_action(obj, name, previous, replaceable=replaceable)
    written, known = None, dict[tuple[str, int], _Filled]()
    if filled is not None and filled.name == action.name:
        written, known = filled.all_of(channels), filled.curves
    if written is None:
        channelbag = _dense_channelbag(action)
        written = _Written()
        deque(written.filling(channelbag, times, channels, known, automatic=automatic), maxlen=0)
        _set_range(action, channelbag, times, repeats=repeats)
    if not beneath:
        assign_action(obj, action)
    _mark_written(action, obj.name, settings_note, len(times), written)
    return action


def filling_action(
    owner: str,
    action: bpy.types.Action,
    frames: Floats,
    channels: Sequence[Channel],
    *,
    settings_note: str,
    repeats: bool,
) -> Iterator[None]:
    """The same in steps, but that nobody gets the action, and that it stays as it is between them.

    Args:
        owner: name of the object that is to have it.
        action: made here, and nobody's yet.
        frames: (frames,), ascending.
        channels: values at these frames.
        settings_note: kept with the action.
        repeats: whether curves go on before their first key and after their last.
    """
    times = _checked(frames, channels)
    channelbag = _dense_channelbag(action)
    written = _Written()
    yield from written.filling(channelbag, times, channels, {}, automatic=False)
    _set_range(action, channelbag, times, repeats=repeats)
    yield
    _mark_written(action, owner, settings_note, len(times), written)


def _dense_channelbag(action: bpy.types.Action) -> bpy.types.ActionChannelbag:
    """The curves of an action made here, such that the keys of each are of one kind."""
    # Actions made here have one layer, one strip and one slot; with more, they count as edited.
    (slot,) = action.slots
    channelbag = own_channelbag(action, slot)
    if "frames" not in action.get(MARK, ("frames",)):
        # It was filled otherwise, as spliced actions are.
        for curve in channelbag.fcurves:
            curve.keyframe_points.clear()
    return channelbag


def _set_range(
    action: bpy.types.Action,
    channelbag: bpy.types.ActionChannelbag,
    times: np.ndarray,
    *,
    repeats: bool,
) -> None:
    _repeat(channelbag, repeats=repeats)
    own = (True, float(times[0]), float(times[-1]), repeats)
    for name, value in zip(_RANGE, own, strict=True):
        # Blender works all frames out anew where any is set.
        if getattr(action, name) != value:
            setattr(action, name, value)


def _mark_written(
    action: bpy.types.Action,
    owner: str,
    settings_note: str,
    frames: int,
    written: _Written,
) -> None:
    tracks = _tracks_of(action)
    fingerprint = written.fingerprint or written.seen_in(action)
    _mark(action, owner, settings_note, fingerprint, written.handles, keys=written.keys)
    action[MARK]["frames"] = frames
    for key, track in tracks.items():
        action[MARK][key] = track


def generated_action(
    obj: bpy.types.Object,
    name: str,
    previous: bpy.types.Action | None,
    *,
    replaceable: bool = False,
) -> bpy.types.Action:
    """The action to write for an object: ``previous``, if it may be replaced, else a new one.

    Args:
        obj: the object to animate.
        name: name of a new action.
        previous: the action to write anew, or none.
        replaceable: whether :func:`may_replace` has just said yes of ``previous``.

    Raises:
        WriteError: the object is read-only, or in NLA tweak mode.
    """
    writable_object(obj)
    if previous is not None and (replaceable or may_replace(previous, obj)):
        return previous
    return new_action(obj, name)


def assign_generated(obj: bpy.types.Object, action: bpy.types.Action, settings_note: str) -> None:
    """Give an object an action that was written into one of :func:`generated_action`, and mark it
    as it is now.
    """
    assign_action(obj, action)
    mark_generated(obj, action, settings_note)


def mark_generated(obj: bpy.types.Object, action: bpy.types.Action, settings_note: str) -> None:
    """Mark an action as it is now; of one that is a layer of the NLA, its tracks are remembered."""
    finished(marking_generated(obj.name, action, settings_note))


def marking_generated(
    owner: str, action: bpy.types.Action, settings_note: str
) -> Generator[None, None, None]:
    """The same in steps, between which the action stays as it is; the owner by name."""
    tracks = _tracks_of(action)
    handles: dict[tuple[str, int], np.ndarray] = {}
    listed = _listed(action)
    for start in range(0, len(listed), _CURVES_AT_ONCE):
        handles |= {
            (path, index): _handles(curve)
            for path, index, _, curve in listed[start : start + _CURVES_AT_ONCE]
            if _has_own_handles(curve)
        }
        yield
    fingerprint = ""
    for text in _fingerprint(action):
        fingerprint = text
        yield
    _mark(action, owner, settings_note, fingerprint, handles)
    for key, name in tracks.items():
        action[MARK][key] = name


def _tracks_of(action: bpy.types.Action) -> dict[str, str]:
    mark = action.get(MARK, {})
    return {key: mark[key] for key in ("track", "beneath") if key in mark}


def assign_action(obj: bpy.types.Object, action: bpy.types.Action) -> None:
    """Assign an action with its slot. The one before is saved from being purged if nothing else
    uses it.
    """
    data = obj.animation_data or obj.animation_data_create()
    assert data is not None
    before = data.action
    (slot,) = action.slots
    if before == action and data.action_slot == slot:
        # Blender would work the frame out anew.
        return
    data.action = action
    data.action_slot = slot
    if before is not None and before.library is None and before.users == 0:
        before.use_fake_user = True


def _mark(
    action: bpy.types.Action,
    owner: str,
    settings_note: str,
    fingerprint: str,
    handles: Mapping[tuple[str, int], np.ndarray],
    *,
    keys: int | None = None,
) -> None:
    action[MARK] = {
        "owner": owner,
        "name": action.name,
        "version": _MARK_VERSION,
        "fingerprint": fingerprint,
        "note": settings_note,
        "keys": key_count(action) if keys is None else keys,
        "curves": sum(len(each.fcurves) for each in channelbags_of(action)),
    }
    if handles:
        ordered = [handles[place] for place in sorted(handles)]
        action[MARK]["handles"] = np.concatenate(ordered).tobytes()


def is_generated(action: bpy.types.Action) -> bool:
    """Whether the action was made here, or is a copy of one that was."""
    return MARK in action


def is_edited(action: bpy.types.Action) -> bool:
    """Whether the action is not, or no longer, what was generated.

    Keys, handles, modifiers and further curves count, so do a muted or locked curve, markers and
    the frame range. A name, a colour, a selection and a fake user do not.
    """
    return finished(looking_whether_edited(action))


def looking_whether_edited(action: bpy.types.Action) -> Generator[float, None, bool]:
    """The same in steps; an action that is gone meanwhile counts as edited."""
    mark, name = action.get(MARK), action.name
    if mark is None or mark.get("version") != _MARK_VERSION:
        return True
    if (fingerprint := mark.get("fingerprint")) == _BEING_WRITTEN:
        return False
    now = ""
    for text in _fingerprint(action):
        now = text
        yield 0.5
    found = bpy.data.actions.get(name)
    if found is None or fingerprint != now:
        return True
    return (yield from _looking_at_handles(name))


def note_of(action: bpy.types.Action) -> str:
    """How an action was made, as whoever wrote it has noted it; "" for any other."""
    mark = action.get(MARK)
    return str(mark.get("note", "")) if mark is not None else ""


def unedited_with_note(note: str) -> list[bpy.types.Object]:
    """Objects whose action has this note and may be replaced: what an artist has edited since is
    theirs.
    """
    found: list[bpy.types.Object] = []
    for action in bpy.data.actions:
        if note_of(action) != note:
            continue
        for each in bpy.data.user_map(subset=[action])[action]:
            if not isinstance(each, bpy.types.Object) or not each.is_editable:
                continue
            data = each.animation_data
            if data is not None and data.action == action and may_replace(action, each):
                found.append(each)
    return found


def key_counts(action: bpy.types.Action) -> tuple[int, int]:
    """How many keys an action had when it was generated, and how many one per frame would be.

    The same number twice where that is not known.
    """
    mark = action.get(MARK)
    if mark is None or "curves" not in mark:
        return key_count(action), key_count(action)
    return int(mark["keys"]), int(mark["frames"]) * int(mark["curves"])


def key_count(action: bpy.types.Action) -> int:
    """Number of keys on all curves of an action."""
    return sum(len(curve.keyframe_points) for curve in curves_of(action))


def may_replace(action: bpy.types.Action, obj: bpy.types.Object) -> bool:
    """Whether this action is the object's alone, and all that is in it was generated."""
    return belongs_to(action, obj) and not is_edited(action)


def belongs_to(action: bpy.types.Action, obj: bpy.types.Object) -> bool:
    """Whether this action was generated and is the object's alone; it may have been edited."""
    if action.library is not None or action.override_library is not None:
        return False
    if not is_generated(action) or action.asset_data is not None:
        return False
    return _made_for(action, obj) and not _used_elsewhere(action, obj)


def _made_for(action: bpy.types.Action, obj: bpy.types.Object) -> bool:
    mark = action[MARK]
    if mark.get("owner") == obj.name:
        return True
    # The mark of another: an action that was handed over, and still is the other's, or what an
    # object has when it was renamed, appended, or duplicated together with its action.
    data = obj.animation_data
    if data is None or data.action != action:
        return False
    return mark.get("owner") not in bpy.data.objects or mark.get("name") != action.name


def _used_elsewhere(action: bpy.types.Action, obj: bpy.types.Object) -> bool:
    """Whether the action moves anything but this object, or this object by other ways too."""
    for user in bpy.data.user_map(subset=[action])[action]:
        data = getattr(user, "animation_data", None)
        if data is not None:
            if user != obj and action in (data.action, data.action_tweak_storage):
                return True
            own = action[MARK].get("track") if user == obj else None
            tracks = (track for track in data.nla_tracks if track.name != own)
            strips = (strip for track in tracks for strip in track.strips)
            if any(strip.action == action for strip in flattened(strips)):
                return True
        if isinstance(user, bpy.types.Object) and action in _constraint_actions(user):
            return True
    return False


def flattened(strips: Iterable[bpy.types.NlaStrip]) -> Iterator[bpy.types.NlaStrip]:
    """The strips, and those inside meta strips."""
    for strip in strips:
        yield strip
        yield from flattened(strip.strips)


def _constraint_actions(obj: bpy.types.Object) -> list[bpy.types.Action | None]:
    bones = obj.pose.bones if obj.pose is not None else ()
    return [
        constraint.action
        for owner in (obj, *bones)
        for constraint in owner.constraints
        if isinstance(constraint, bpy.types.ActionConstraint)
    ]


def new_action(obj: bpy.types.Object, name: str) -> bpy.types.Action:
    """An empty action of one slot for an object."""
    action = bpy.data.actions.new(name)
    action.slots.new("OBJECT", obj.name)
    action.layers.new("Layer").strips.new(type="KEYFRAME")
    return action


def _checked(frames: Floats, channels: Sequence[Channel]) -> np.ndarray:
    """Frames in Blender's precision. A ValueError here is a fault of the caller's, not a user's."""
    times = np.ascontiguousarray(frames, dtype=np.float32)
    if times.ndim != 1 or len(times) == 0:
        raise ValueError(f"frames must be one row of at least one frame, not {times.shape}")
    if not np.isfinite(times).all() or (np.diff(times) <= _LEAST_SPACING).any():
        raise ValueError(f"frames must ascend by more than {_LEAST_SPACING}")
    for channel in channels:
        if channel.values.ndim != 2 or len(channel.values) != len(times):
            raise ValueError(f"{channel.data_path}: {channel.values.shape} for {len(times)} frames")
        if not np.isfinite(channel.values).all():
            raise ValueError(f"{channel.data_path} has values that are no numbers")
    if len({channel.data_path for channel in channels}) != len(channels):
        raise ValueError("two channels for one property")
    return times


class _Written:
    """Curves that get their keys, by data path and index."""

    def __init__(self) -> None:
        self.digests: dict[tuple[str, int], bytes] = {}
        """The hash of each curve's keys: to read them back takes longer than to write them."""
        self.handles: dict[tuple[str, int], np.ndarray] = {}
        """The handles of those that have keys of their own."""
        self.keys = 0
        """How many there are."""
        self.fingerprint = ""
        """The action's, once that is known."""

    def seen_in(self, action: bpy.types.Action) -> str:
        """The fingerprint of an action that has these curves and no others."""
        return deque(_fingerprint(action, self.digests), maxlen=1).pop()

    def filling(
        self,
        channelbag: bpy.types.ActionChannelbag,
        times: np.ndarray,
        channels: Sequence[Channel],
        filled: Mapping[tuple[str, int], _Filled],
        *,
        automatic: bool,
    ) -> Iterator[None]:
        """Make the curves what the channels say, in steps. Curves that are there already are filled
        anew, so that their colours, selection and place in the editors stay, but for those that
        were so already.
        """
        curves = {(curve.data_path, curve.array_index): curve for curve in channelbag.fcurves}
        yield from self.filling_some(
            channelbag, curves, times, channels, filled, automatic=automatic
        )
        # A group goes with the last of its curves.
        for curve in curves.values():
            channelbag.fcurves.remove(curve)

    def filling_some(
        self,
        channelbag: bpy.types.ActionChannelbag,
        curves: dict[tuple[str, int], bpy.types.FCurve],
        times: np.ndarray,
        channels: Sequence[Channel],
        filled: Mapping[tuple[str, int], _Filled],
        *,
        automatic: bool,
    ) -> Iterator[None]:
        """The same of some of the curves, which are taken out of those that are there."""
        digests, handles = self.digests, self.handles
        # Everything goes through the same few buffers: memory stays modest, however many the bones.
        points, kinds = _dense_keys(times, automatic=automatic)
        for channel in channels:
            own = None
            for component in range(channel.values.shape[1]):
                place = (channel.data_path, component)
                curve = curves.pop(place, None)
                there = filled.get(place)
                if curve is None:
                    curve = channelbag.fcurves.new(channel.data_path, index=component)
                if there is not None and len(curve.keyframe_points) != there.count:
                    there = None
                group = curve.group
                # Dense and reduced keys are grouped in their own ways; else the artist's stays.
                if group is None or (
                    group.name != channel.group
                    and (_has_own_handles(curve) if there is None else there.had_own_handles)
                    != (channel.keys is not None)
                ):
                    # Looked for once: that takes the longer, the more there are.
                    own = own or group_named(channelbag, channel.group)
                    curve.group = own
                if there is None:
                    if channel.keys is not None:
                        there = _fill_bezier(curve, channel.keys, component)
                    else:
                        points[:, 1] = channel.values[:, component]
                        there = _fill_dense(curve, points, kinds)
                own_handles = there.handles if there.told else _tell(curve, channel)
                digests[place] = there.digest
                self.keys += there.count
                if own_handles is not None:
                    handles[place] = own_handles
            yield


def _dense_keys(times: np.ndarray, *, automatic: bool) -> tuple[np.ndarray, np.ndarray]:
    """Keys (keys, 2) on all frames whose values are to be filled in, and what they are, as of
    :func:`_fill_dense`.
    """
    points = np.empty((len(times), 2), dtype=np.float32)
    points[:, 0] = times
    # Blender draws keys of this type as a tool's own, unlike those that an artist sets.
    kinds = np.stack(
        [_filled(len(times), "interpolation", "BEZIER" if automatic else "LINEAR")]
        + [_filled(len(times), "type", "GENERATED")]
        + [_filled(len(times), "handle_left_type", "AUTO")] * automatic
    )
    return points, kinds


@dataclass(frozen=True, eq=False)
class _Filled:
    """What is known of a curve that has its keys."""

    count: int
    """Of keys."""
    digest: bytes
    """The hash of them: to read them back takes longer than to write them."""
    handles: np.ndarray | None = None
    """(keys, 4) as Blender has them, of one with handles of its own."""
    had_own_handles: bool = False
    """Whether it was one of these before."""
    told: bool = True
    """Whether Blender has heard of them."""


class HalfWritten:
    """A generated action that gets its keys a few curves at a time, while Blender goes on.

    Of curves that keep their number of keys nothing is seen before all are written, for Blender
    looks at keys anew only once it is told of them; of others each one is, and whoever lets these
    be written sees to it that what is in sight is shown again. Until then the action counts as one
    that nobody has edited, also after a step back.

    Args:
        action: one that may be replaced.
    """

    def __init__(self, action: bpy.types.Action) -> None:
        self.name = action.name
        self.curves: dict[tuple[str, int], _Filled] = {}
        """Those that are filled, by data path and index."""
        self.is_seen = False
        """Whether Blender has looked at some that are not nearly what they were."""
        self._written: _Written | None = None
        """All of them, once the action is what it will be."""
        self._channels: Sequence[Channel] = ()
        self._range = {name: getattr(action, name) for name in _RANGE}
        self._before: dict[tuple[str, int], dict[str, np.ndarray]] = {}
        self._new: set[tuple[str, int]] = set()
        """Curves that were not there before."""
        self._fingerprint: str = action[MARK]["fingerprint"]
        action[MARK]["fingerprint"] = _BEING_WRITTEN

    def all_of(self, channels: Sequence[Channel]) -> _Written | None:
        """All curves, with the action's fingerprint, where nothing of these channels is left to be
        filled.
        """
        own = self._channels
        if len(own) != len(channels) or any(map(is_not, own, channels)):
            return None
        return self._written

    def filling(
        self,
        frames: Floats,
        channels: Sequence[Channel],
        *,
        automatic: bool,
        nearly: bool,
        seen: bool,
        repeats: bool,
    ) -> Iterator[None]:
        """Fill the curves that are there, in steps. What would be seen of it waits, unless the
        motion is nearly the same, or it may be seen.
        """
        self.curves.clear()
        self.is_seen = False
        self._written, self._channels = None, list(channels)
        times = _checked(frames, channels)
        points, kinds = _dense_keys(times, automatic=automatic)

        def fill(curve: bpy.types.FCurve, channel: Channel, component: int) -> _Filled:
            if channel.keys is not None:
                return _fill_bezier(curve, channel.keys, component)
            points[:, 1] = channel.values[:, component]
            return _fill_dense(curve, points, kinds)

        done, of_frames = 0, max(_FRAMES_AT_ONCE // len(times), 1)
        while done < len(channels):
            yield
            curves = self._curves()
            most = _SEEN_AT_ONCE if self.is_seen else CHANNELS_AT_ONCE
            some = channels[done : done + min(most, of_frames)]
            done += len(some)
            for channel in some:
                for component in range(channel.values.shape[1]):
                    place = channel.data_path, component
                    count = len(times) if channel.keys is None else len(channel.keys)
                    if (curve := curves.get(place)) is None:
                        continue
                    other = len(curve.keyframe_points) != count and not nearly
                    if other and not seen:
                        continue
                    self.is_seen |= other
                    if place not in self._before and place not in self._new:
                        self._before[place] = _read_keys(curve)
                    own = place in self._before and _are_own_handles(self._before[place])
                    found = fill(curve, channel, component)
                    self.curves[place] = replace(found, had_own_handles=own)
        yield from self._telling(channels, fill)
        yield from self._ending(times, channels, automatic=automatic, repeats=repeats)

    def _ending(
        self, times: np.ndarray, channels: Sequence[Channel], *, automatic: bool, repeats: bool
    ) -> Iterator[None]:
        """Do what is left where Blender has been told of all curves, in steps."""
        count = sum(channel.values.shape[1] for channel in channels)
        told = len(self.curves) == count and all(each.told for each in self.curves.values())
        if not told or repeats != self._range["use_cyclic"]:
            return
        written = _Written()
        for start in range(0, len(channels), _LOOKED_AT_AT_ONCE):
            yield
            if (action := bpy.data.actions.get(self.name)) is None:
                return
            own = _dense_channelbag(action), self._curves(), times
            some = channels[start : start + _LOOKED_AT_AT_ONCE]
            deque(written.filling_some(*own, some, self.curves, automatic=automatic), maxlen=0)
        yield
        if (action := bpy.data.actions.get(self.name)) is None:
            return
        channelbag = _dense_channelbag(action)
        for place, curve in self._curves().items():
            if place not in self.curves:
                channelbag.fcurves.remove(curve)
        _set_range(action, channelbag, times, repeats=repeats)
        yield
        if (action := bpy.data.actions.get(self.name)) is not None:
            written.fingerprint = written.seen_in(action)
            self._written = written
        yield

    def _telling(
        self,
        channels: Sequence[Channel],
        fill: Callable[[bpy.types.FCurve, Channel, int], _Filled],
    ) -> Iterator[None]:
        """Let Blender look at what is filled, in steps: at the first of them all is seen that was
        filled, and has to be all that there is, curves that come new too; handles, which are put
        right, count between keys.
        """
        places = {
            (channel.data_path, component): channel
            for channel in channels
            for component in range(channel.values.shape[1])
        }
        missing = places.keys() - self.curves.keys()
        if not self.curves or not missing.isdisjoint(self._curves()):
            return
        known = [(place, channel) for place, channel in places.items() if place not in missing]
        for start in range(0, len(known), _TOLD_AT_ONCE):
            yield
            if start == 0:
                self._add({place: places[place] for place in places if place in missing}, fill)
            curves = self._curves()
            for place, channel in known[start : start + _TOLD_AT_ONCE]:
                if (curve := curves.get(place)) is not None:
                    handles = _tell(curve, channel)
                    self.curves[place] = replace(self.curves[place], handles=handles, told=True)

    def _add(
        self,
        missing: Mapping[tuple[str, int], Channel],
        fill: Callable[[bpy.types.FCurve, Channel, int], _Filled],
    ) -> None:
        """Make the curves that are not there, of which Blender is told."""
        action = bpy.data.actions.get(self.name)
        if action is None:
            return
        channelbag = _dense_channelbag(action)
        for (path, component), channel in missing.items():
            curve, place = channelbag.fcurves.new(path, index=component), (path, component)
            self._new.add(place)
            curve.group = group_named(channelbag, channel.group)
            found = fill(curve, channel, component)
            self.curves[place] = replace(found, handles=_tell(curve, channel), told=True)

    def give_back(self) -> None:
        """Let the action be as it was."""
        action = bpy.data.actions.get(self.name)
        if action is None or not self._before:
            return
        curves = self._curves()
        for place in self._new & curves.keys():
            _dense_channelbag(action).fcurves.remove(curves.pop(place))
        for place, keys in self._before.items():
            curve = curves.get(place)
            if curve is not None:
                _resize(curve, len(keys["type"]))
                for name, values in keys.items():
                    curve.keyframe_points.foreach_set(name, values.ravel())
                curve.update()
        for name, value in self._range.items():
            setattr(action, name, value)
        action[MARK]["fingerprint"] = self._fingerprint

    def _curves(self) -> dict[tuple[str, int], bpy.types.FCurve]:
        """All curves by data path and index; a reference does not outlive a step."""
        action = bpy.data.actions.get(self.name)
        if action is None:
            return {}
        return {(each.data_path, each.array_index): each for each in curves_of(action)}


def group_named(channelbag: bpy.types.ActionChannelbag, name: str) -> bpy.types.ActionGroup:
    """A group of channels, made if it is not there."""
    return channelbag.groups.get(name) or channelbag.groups.new(name)


def _repeat(channelbag: bpy.types.ActionChannelbag, *, repeats: bool) -> None:
    for curve in channelbag.fcurves:
        for modifier in list(curve.modifiers):
            curve.modifiers.remove(modifier)
        if repeats:
            add_cycles(curve)


def add_cycles(curve: bpy.types.FCurve) -> None:
    """Let a curve repeat what lies between its first key and its last."""
    cycles = curve.modifiers.new("CYCLES")
    first, last = (curve.keyframe_points[end].co[1] for end in (0, -1))
    if curve.data_path.endswith("location") and abs(last - first) > _TRAVELS:
        # What travels goes on from where a round has led.
        assert isinstance(cycles, bpy.types.FModifierCycles)
        cycles.mode_before = cycles.mode_after = "REPEAT_OFFSET"


def _fill_dense(curve: bpy.types.FCurve, points: np.ndarray, kinds: np.ndarray) -> _Filled:
    """Fill a curve with a key on each frame.

    Args:
        curve: all keys of one that has as many are of one kind, as nobody has edited them.
        points: (keys, 2) frames and values, single precision.
        kinds: (2 or 3, keys) interpolation, type, and the handles' type if they are automatic.
    """
    keys, automatic = curve.keyframe_points, len(kinds) > 2
    alike, as_many = _alike(curve, kinds), len(keys) == len(points)
    if not as_many:
        keys.clear()
    if automatic and curve.auto_smoothing != "NONE":
        # Else handles depend on those of all other keys, and swing after a sudden turn. Blender
        # places the handles of all keys that are there when this is set.
        curve.auto_smoothing = "NONE"
    if not as_many:
        keys.add(len(points))
    keys.foreach_set("co", points.ravel())
    if not alike:
        # New ones are curved already.
        if _kind_of(keys)[0] != ("BEZIER" if automatic else "LINEAR"):
            keys.foreach_set("interpolation", kinds[0])
        keys.foreach_set("type", kinds[1])
        if automatic:
            keys.foreach_set("handle_left_type", kinds[2])
            keys.foreach_set("handle_right_type", kinds[2])
    return _Filled(len(points), _keys_digest(points, kinds), told=False)


def _resize(curve: bpy.types.FCurve, count: int) -> None:
    keys = curve.keyframe_points
    if len(keys) != count:
        keys.clear()
        keys.add(count)


def _alike(curve: bpy.types.FCurve, kinds: np.ndarray) -> bool:
    """Whether a curve, all of whose keys are of one kind, has as many as there are to be (kinds,
    keys), and of that kind.
    """
    automatic = len(kinds) > 2
    interpolation, handles_are = _kind_of(curve.keyframe_points)
    alike = interpolation == ("BEZIER" if automatic else "LINEAR")
    return (
        len(curve.keyframe_points) == kinds.shape[1]
        and alike
        and (handles_are == "AUTO" or not automatic)
    )


def _fill_bezier(curve: bpy.types.FCurve, keys: BezierKeys, component: int) -> _Filled:
    """Fill a curve with Bézier keys."""
    _resize(curve, len(keys))
    points = curve.keyframe_points
    coordinates = np.column_stack([keys.frames, keys.values[:, component]])
    bezier = _filled(len(keys), "interpolation", "BEZIER")
    generated = _filled(len(keys), "type", "GENERATED")
    free = _filled(len(keys), "handle_left_type", "FREE")
    kinds = np.where(keys.smooth, _filled(len(keys), "handle_left_type", "ALIGNED"), free)
    points.foreach_set("co", coordinates.ravel())
    points.foreach_set("interpolation", bezier)
    points.foreach_set("type", generated)
    points.foreach_set("handle_left_type", kinds)
    points.foreach_set("handle_right_type", kinds)
    points.foreach_set("handle_left", np.ascontiguousarray(keys.left[:, component]).ravel())
    points.foreach_set("handle_right", np.ascontiguousarray(keys.right[:, component]).ravel())
    digest = _keys_digest(coordinates, np.stack([bezier, generated]))
    return _Filled(len(keys), digest, told=False)


def _tell(curve: bpy.types.FCurve, channel: Channel) -> np.ndarray | None:
    """Let Blender look at a curve's keys anew, and put its handles right; these (keys, 4), if it
    has some of its own.
    """
    if channel.keys is None:
        # They are in order, and none at one and the same frame: all that is left are handles.
        curve.keyframe_points.handles_recalc()
        return None
    curve.update()
    return _handles(curve)


def _read_keys(curve: bpy.types.FCurve) -> dict[str, np.ndarray]:
    """All that a generated curve's keys are, by name."""
    keys, count = curve.keyframe_points, len(curve.keyframe_points)
    found = {name: np.empty(count, dtype=_ENUMERATION) for name in _KINDS}
    # Types before places: handles that are automatic go where Blender has them.
    found |= {name: np.empty((count, 2), dtype=np.float32) for name in _PLACES}
    for name, values in found.items():
        keys.foreach_get(name, values.ravel())
    return found


def _kind_of(keys: bpy.types.FCurveKeyframePoints) -> tuple[str, str]:
    """Interpolation and left handle's type of a curve's first key, both "" where there is none."""
    if not len(keys):
        return "", ""
    first = keys[0]
    return first.interpolation, first.handle_left_type


def _has_own_handles(curve: bpy.types.FCurve) -> bool:
    """Whether it has handles that matter and were set, rather than left to Blender."""
    keys = curve.keyframe_points
    kinds = {name: np.empty(len(keys), dtype=_ENUMERATION) for name in _KINDS[:3]}
    for name, values in kinds.items():
        keys.foreach_get(name, values)
    return _are_own_handles(kinds)


def _are_own_handles(keys: Mapping[str, np.ndarray]) -> bool:
    """The same of keys as of :func:`_read_keys`."""
    interpolation, *handles = (keys[name] for name in _KINDS[:3])
    if not (interpolation == enum_value("interpolation", "BEZIER")).any():
        return False
    automatic = enum_value("handle_left_type", "AUTO")
    return any(bool((each != automatic).any()) for each in handles)


def _handles(curve: bpy.types.FCurve) -> np.ndarray:
    """Left and right handles (keys, 4) of a curve."""
    return np.column_stack([key_points(curve, "handle_left"), key_points(curve, "handle_right")])


def key_points(curve: bpy.types.FCurve, name: str = "co") -> np.ndarray:
    """(keys, 2) frames and values of keys, or of their handles, single precision."""
    points = np.empty((len(curve.keyframe_points), 2), dtype=np.float32)
    curve.keyframe_points.foreach_get(name, points.ravel())
    return points


def _looking_at_handles(name: str) -> Generator[float, None, bool]:
    """Whether a handle of Bézier keys is not, or no longer, where it was written; in steps.

    The keys themselves must be known to be as they were.
    """
    action = bpy.data.actions[name]
    written = np.frombuffer(action[MARK].get("handles", b""), dtype=np.float32).reshape(-1, 4)
    if not len(written):
        # Then it has no curve with handles of its own: its keys would be others.
        return False
    start, listed = 0, _listed(action)
    count = len(listed)
    for number in range(count):
        if number % _CURVES_AT_ONCE == _CURVES_AT_ONCE - 1:
            yield 0.9
            # No reference to a curve outlives a step.
            again = bpy.data.actions.get(name)
            listed = _listed(again) if again is not None else []
            if len(listed) != count:
                return True
        *_, curve = listed[number]
        points = curve.keyframe_points
        if not _has_own_handles(curve):
            continue
        now, then = _handles(curve), written[start : start + len(points)]
        start += len(points)
        if len(then) != len(now):
            return True
        keys = np.tile(key_points(curve), (1, 2))
        slack = _HANDLE_SLACK * np.abs(then - keys) + 8.0 * np.spacing(np.abs(keys))
        if (np.abs(now - then) > slack).any():
            return True
    return start != len(written)


def _filled(count: int, name: str, item: str) -> np.ndarray:
    """A keyframe's enumeration value, as many times as there are keys."""
    return np.full(count, enum_value(name, item), dtype=_ENUMERATION)


@cache
def enum_value(name: str, item: str) -> int:
    """What Blender keeps a keyframe's enumeration as."""
    definition = bpy.types.Keyframe.bl_rna.properties[name]
    assert isinstance(definition, bpy.types.EnumProperty)
    return definition.enum_items[item].value


def _fingerprint(
    action: bpy.types.Action, known: Mapping[tuple[str, int], bytes] | None = None
) -> Iterator[str]:
    """A hash of all in an action that an artist can have set on purpose, the last of what comes
    after each of some steps; no hash of one that is another one meanwhile.

    Handles of linear keys are left out: they have no effect, and a key that is made Bézier changes
    its interpolation. Of automatic ones their being so counts: one that is moved is so no more.
    Others are compared, not hashed: Blender rounds aligned ones anew each time that a curve is
    updated.

    Args:
        action: the action.
        known: hashes of its curves' keys, where they have just been written.
    """
    digest = hashlib.blake2b(digest_size=16)

    def add(*values: object) -> None:
        digest.update(repr(values).encode())

    add(action.use_frame_range, action.frame_start, action.frame_end, action.use_cyclic)
    add([(marker.name, marker.frame) for marker in action.pose_markers])
    add([slot.handle for slot in action.slots])
    add([len(layer.strips) for layer in action.layers])
    listed, name = _listed(action), action.name
    buffer, count = np.empty((0, 2), dtype=np.float32), len(listed)
    for number in range(count):
        if known is None and number % _CURVES_AT_ONCE == _CURVES_AT_ONCE - 1:
            yield ""
            # No reference to a curve outlives a step.
            again = bpy.data.actions.get(name)
            listed = _listed(again) if again is not None else []
            if len(listed) != count:
                return
        path, index, state, curve = listed[number]
        keys, many = curve.keyframe_points, len(curve.modifiers)
        modifiers = f"{many}{_modifier_settings(curve) if many else ''}"
        digest.update(f"({path!r}, {index}, {state}({len(keys)}, {modifiers})".encode())
        if known is not None:
            digest.update(known[path, index])
            continue
        if len(buffer) != len(keys):
            buffer = np.empty((len(keys), 2), dtype=np.float32)
        keys.foreach_get("co", buffer.ravel())
        digest.update(_keys_digest(buffer, _kinds(keys)))
    yield digest.hexdigest()


def is_setting(path: str) -> bool:
    """Whether a data path is that of a setting of this add-on: its keys are no part of a motion."""
    return path.startswith("octo_motion.")


def _listed(action: bpy.types.Action) -> list[tuple[str, int, str, bpy.types.FCurve]]:
    """Path, component, state as text and curve of all curves, by path and component: an artist may
    move channels up and down in the list.
    """
    found: list[tuple[str, int, str, bpy.types.FCurve]] = []
    for channelbag in channelbags_of(action):
        curves = channelbag.fcurves
        # What can be read of all at once is.
        index, extrapolation = np.empty((2, len(curves)), dtype=np.int32)
        mute, lock = np.empty((2, len(curves)), dtype=bool)
        curves.foreach_get("array_index", index)
        curves.foreach_get("extrapolation", extrapolation)
        curves.foreach_get("mute", mute)
        curves.foreach_get("lock", lock)
        states = zip(extrapolation.tolist(), mute.tolist(), lock.tolist(), strict=True)
        texts = [f"{_extrapolation(kind)!r}, {off}, {locked})" for kind, off, locked in states]
        paths = [curve.data_path for curve in curves]
        found.extend(zip(paths, index.tolist(), texts, curves, strict=True))
    return sorted((each for each in found if not is_setting(each[0])), key=itemgetter(0, 1))


_AS_GENERATED: Final = frozenset({("mode_before", "REPEAT"), ("mode_after", "REPEAT")})
"""What a new Cycles modifier has, as generated loops have it, though its properties' defaults are
others."""


def _modifier_settings(curve: bpy.types.FCurve) -> str:
    """What of a curve's modifiers is not as it is in new ones; "" if nothing is."""
    found: list[str] = []
    for number, modifier in enumerate(curve.modifiers):
        for definition in modifier.bl_rna.properties:
            name = definition.identifier
            if definition.is_readonly or name in ("name", "show_expanded", "active"):
                continue
            value: Any = getattr(modifier, name)
            default: Any = getattr(definition, "default", None)
            if getattr(definition, "is_array", False):
                value, default = tuple(value), None
            if value != default and (name, value) not in _AS_GENERATED:
                found.append(f"{number} {name} {value!r}")
        found.extend(
            f"{number} {point.frame} {point.min} {point.max}"
            for point in getattr(modifier, "control_points", ())
        )
    return "".join(found)


@cache
def _extrapolation(number: int) -> str:
    """Name of the way in which a curve goes on beyond its keys."""
    definition = bpy.types.FCurve.bl_rna.properties["extrapolation"]
    assert isinstance(definition, bpy.types.EnumProperty)
    return next(each.identifier for each in definition.enum_items if each.value == number)


def _kinds(keys: bpy.types.FCurveKeyframePoints) -> np.ndarray:
    """What a curve's keys are, (rows, keys): interpolation, type, and of automatic handles that."""
    kinds = np.empty((4, len(keys)), dtype=_ENUMERATION)
    keys.foreach_get("interpolation", kinds[0])
    keys.foreach_get("type", kinds[1])
    if not len(keys) or kinds[0, 0] != enum_value("interpolation", "BEZIER"):
        return kinds[:2]
    keys.foreach_get("handle_left_type", kinds[2])
    if kinds[2, 0] != enum_value("handle_left_type", "AUTO"):
        return kinds[:2]
    keys.foreach_get("handle_right_type", kinds[3])
    if kinds[2].tobytes() != kinds[3].tobytes():
        # As nothing was ever written.
        kinds[2] = 255
    return kinds[:3]


def _keys_digest(points: np.ndarray, kinds: np.ndarray) -> bytes:
    """Hash of a curve's keys.

    Args:
        points: (keys, 2) frames and values, single precision.
        kinds: (rows, keys) what they are.
    """
    digest = hashlib.blake2b(points, digest_size=16)
    digest.update(kinds)
    return digest.digest()


def curves_of(
    action: bpy.types.Action, slot: bpy.types.ActionSlot | None = None
) -> Iterator[bpy.types.FCurve]:
    """F-curves of an action, whatever they move: of one slot, or all."""
    for channelbag in channelbags_of(action, slot):
        yield from channelbag.fcurves


def shown_curves(
    action: bpy.types.Action, slot: bpy.types.ActionSlot
) -> Iterator[bpy.types.FCurve]:
    """A slot's curves that Blender lets act; a muted group alone silences nothing."""
    return (each for each in curves_of(action, slot) if not (each.mute or each.is_empty))


def renumber_keys(
    actions: Iterable[bpy.types.Action | None], path: str, places: Mapping[int, int | None]
) -> None:
    """Let keys of the items of a list follow them to other places, as data paths have numbers.

    Keys of an item that is gone go with it. Linked actions stay as they are.

    Args:
        actions: in which keys may be.
        path: of the list.
        places: by the number that an item had, the one that it has; none of one that is gone.
    """
    for action in {each for each in actions if each is not None and each.library is None}:
        for channelbag in channelbags_of(action):
            for curve in list(channelbag.fcurves):
                number, _, rest = curve.data_path.removeprefix(f"{path}[").partition("]")
                if not curve.data_path.startswith(f"{path}[") or not number.isdigit():
                    continue
                place = places.get(int(number), int(number))
                if place is None:
                    channelbag.fcurves.remove(curve)
                elif place != int(number):
                    curve.data_path = f"{path}[{place}]{rest}"


def channelbags_of(
    action: bpy.types.Action, slot: bpy.types.ActionSlot | None = None
) -> Iterator[bpy.types.ActionChannelbag]:
    """Channelbags of an action, such that their curves' keys can be read quickly.

    What is reached from one property to the next carries all that it was reached through, and so
    does each of its keys while they are read: that takes four times as long as the reading.
    """
    strips = (strip for layer in action.layers for strip in layer.strips)
    for strip in strips:
        if not isinstance(strip, bpy.types.ActionKeyframeStrip):
            continue
        for each in strip.channelbags:
            own = each.slot
            if slot is None or (own is not None and own.handle == slot.handle):
                yield (strip.channelbag(own) if own is not None else None) or each


def own_channelbag(
    action: bpy.types.Action, slot: bpy.types.ActionSlot
) -> bpy.types.ActionChannelbag:
    """A slot's curves in an action's first keyframe strip, made if there are none."""
    layer = action.layers[0] if action.layers else action.layers.new("Layer")
    if not layer.strips:
        layer.strips.new(type="KEYFRAME")
    strip = next(each for each in layer.strips if isinstance(each, bpy.types.ActionKeyframeStrip))
    channelbag = strip.channelbag(slot, ensure=True)
    assert channelbag is not None
    return channelbag


def acting_curves(data: bpy.types.AnimData | None) -> Iterator[bpy.types.FCurve]:
    """Curves by which a data-block is moved at present: its action's, and its NLA strips'."""
    if data is None:
        return
    if data.action is not None and data.action_slot is not None:
        yield from shown_curves(data.action, data.action_slot)
    yield from strip_curves(data)


def strip_curves(
    data: bpy.types.AnimData | None, left_out: Collection[bpy.types.Action] = ()
) -> Iterator[bpy.types.FCurve]:
    """Curves by which NLA strips move a data-block at present, but for those of some actions."""
    if data is None or not data.use_nla:
        return
    tracks = [track for track in data.nla_tracks if not track.mute]
    for strip in (strip for track in tracks for strip in flattened(track.strips)):
        action, slot = strip.action, strip.action_slot
        if action is not None and slot is not None and not strip.mute and action not in left_out:
            yield from shown_curves(action, slot)


def _pose_bones(armature: bpy.types.Object, bones: Sequence[str]) -> list[bpy.types.PoseBone]:
    armature_data(armature)
    found = pose_of(armature).bones
    missing = [name for name in bones if name not in found]
    if missing:
        raise RigError(
            phrase(
                "'{armature}' has no bone '{missing}' in its pose.",
                armature=armature.name,
                missing=missing[0],
            ),
            "Leave edit mode, or detect the arms again.",
        )
    return [found[name] for name in bones]


def parent_frame(obj: bpy.types.Object) -> Floats:
    """The frame (4, 4) in which the object's own channels stand, at the current frame."""
    if obj.parent is None:
        return np.eye(4)
    # Whatever kind of parent it is (object, bone, vertex, path), Blender has taken it off in
    # matrix_local. Constraints stand in both matrices and cancel. A path is known only to
    # evaluated objects.
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    parent = evaluated.matrix_world @ evaluated.matrix_local.inverted_safe()
    return np.array(parent @ obj.matrix_parent_inverse, dtype=np.float64)


def _parent_turn(obj: bpy.types.Object) -> Floats:
    """The rotation (4,) within the frame in which the object's own channels stand.

    Raises:
        RigError: the parent's scale is zero in some direction.
    """
    # The frame may scale, shear and mirror: its polar decomposition.
    left, sizes, right = np.linalg.svd(parent_frame(obj)[:3, :3])
    if sizes[-1] < 1e-6 * sizes[0]:
        raise RigError(
            phrase("The parent of '{obj}' is flat or has no size.", obj=obj.name),
            "Repair its scale.",
        )
    turn = left @ right
    # Blender takes a mirrored frame's axes the other way round: so reads its matrix_world.
    return from_matrix(turn if np.linalg.det(turn) > 0.0 else -turn)


def delta_rotation(obj: bpy.types.Object) -> Floats:
    """An object's delta rotation, (4,), in its rotation mode."""
    mode = obj.rotation_mode
    if mode == "AXIS_ANGLE":
        # Blender has such a delta, but no way to see or set it.
        return IDENTITY.copy()
    return from_mode_values(np.array(getattr(obj, f"delta_{rotation_property(mode)}")), mode)
