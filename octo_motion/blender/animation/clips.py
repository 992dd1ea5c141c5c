# SPDX-License-Identifier: GPL-3.0-or-later
"""Actions to clips and clips to actions: motion as arrays, exactly as Blender shows it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Generator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Final

import bpy
import numpy as np
from numpy.typing import ArrayLike

from ...core.errors import ClipError
from ...core.keyframes import Channel, RigChannels, rotation_property
from ...core.phrases import phrase
from ...core.rotations import (
    IDENTITY,
    Floats,
    angle_between,
    from_matrix,
    from_mode_values,
    multiply,
    to_matrix,
)
from ...core.skeleton import Skeleton
from ...core.splicing.clip import Clip, orientations_of, unposed, without_scale
from ...core.splicing.transfer import bones_beneath
from ...core.steps import finished
from ..rig import armature_data, bone_and_property, pose_of, read_skeleton, world_matrix
from .actions import (
    curves_of,
    delta_rotation,
    key_points,
    parent_frame,
    read_channels,
    read_object_channels,
    shown_curves,
    writable_armature,
    write_action,
)
from .fcurves import evaluate_fcurve, goes_straight, key_range
from .poses import (
    AT_REST,
    PoseValues,
    UnkeyedPose,
    keep_unkeyed_pose,
    pose_values,
    posed_value,
    unkeyed_pose,
)
from .scene_playback import assigned, shown_poses

_LEAST_SCALING: Final = 1e-6
"""Factors by which a bone's scale may be off one, and be taken for one."""

_ROUNDING: Final = 1e-4
"""Factors by which importers' scale keys are off one, or unequal, without meaning it."""

_CLOSED: Final = np.radians(1.0)
"""By which a bone may be off in the last frame of a cycle."""

_ON_FRAME: Final = 0.01
"""Frames by which keys may miss the ends of a cycle."""

_AT_ONCE: Final = 8
"""Bones whose rotations become keys at one step."""

_APART: Final = frozenset({"ALIGNED", "AVERAGE", "NONE"})
"""Ways of a bone to inherit its parent's scale that leave its own axes straight."""

_STILL: Final = 1e-7
"""Of the skeleton's size: a location that is smaller is none."""

_POSED: Final = frozenset({*AT_REST, "rotation_mode"})
"""Properties of a bone that a clip is about, …"""

_PLACED: Final = frozenset(
    {"rotation_mode"}
    | {f"{kind}{name}" for kind in ("", "delta_") for name in AT_REST if name != "scale"}
)
"""… and of an object; its size is not."""

_Curves = dict[tuple[str, str], dict[int, bpy.types.FCurve]]
"""F-curves by bone ("" is the object itself) and property, then by component."""


def read_clip(
    armature: bpy.types.Object,
    action: bpy.types.Action | None = None,
    slot: bpy.types.ActionSlot | None = None,
    *,
    visual: bool = False,
    frames: ArrayLike | None = None,
    rate: float | None = None,
) -> Clip:
    """What :func:`reading_clip` comes to."""
    return finished(reading_clip(armature, action, slot, visual=visual, frames=frames, rate=rate))


def reading_clip(
    armature: bpy.types.Object,
    action: bpy.types.Action | None = None,
    slot: bpy.types.ActionSlot | None = None,
    *,
    visual: bool = False,
    frames: ArrayLike | None = None,
    rate: float | None = None,
    unkeyed: UnkeyedPose | None = None,
) -> Generator[None, None, Clip]:
    """The motion that an action gives an armature. Nothing in the file is changed.

    In steps, but for what is read as shown; between them the action must not get or lose curves.

    What the action has no curve for keeps its value: where the object stands, and a bone's pose,
    as far as nothing else moves it (glTF files pose bones that no action of theirs moves). But
    what another action on the armature has left there is no part of this clip: such a bone is
    at rest. Parents of the object are taken as they stand at the current frame. Scaled bones
    move and turn those they carry; the clip keeps where they are, not how large. But bones that
    carry no other, or stretch and have children that do not inherit their scale in full, keep it,
    and their children are where they are without it.

    Args:
        armature: the armature object.
        action: the action; the armature's own if none is given. With ``visual`` and none given
            there need not be any: NLA tracks will do.
        slot: the slot of the action; if none is given the one that the armature uses, or would.
        visual: as the scene shows it, with NLA, constraints, drivers and moving parents. Plays
            the scene, so takes longer.
        frames: (frames,) ascending, subframes allowed; those between the slot's first and last
            key, whole ones unless most keys miss these, or of the action's manual frame range, if
            none is given.
        rate: frames per second, the scene's if none is given.
        unkeyed: the armature's unkeyed pose, if it is known.

    Raises:
        RigError: the object is no armature, or has no bones.
        ClipError: there is no action, no slot for the armature, no curve for it, only one frame,
            a key that is no number, or the armature is scaled unequally; with ``visual``, the
            scene does not show it.
    """
    skeleton = read_skeleton(armature)
    data = armature.animation_data
    if action is None and data is not None:
        action = data.action
        slot = slot or (data.action_slot if action is not None else None)
    per_second = float(rate or scene_rate())
    if action is None:
        tracks = data is not None and any(track.strips for track in data.nla_tracks)
        if not (visual and tracks):
            raise ClipError(
                phrase("'{armature}' has no action.", armature=armature.name),
                "Give it one, or import a clip.",
            )
        times = _checked_frames(_track_range(armature) if frames is None else frames, frames)
        return _shown_clip(armature, skeleton, armature.name, times, per_second)
    slot = slot or slot_of(armature, action)
    own = partial(_action_clip, armature, skeleton, action, slot)
    return (yield from own(visual=visual, frames=frames, rate=per_second, unkeyed=unkeyed))


def read_pose(
    armature: bpy.types.Object, action: bpy.types.Action, frame: float
) -> tuple[dict[str, tuple[Floats, Floats, Floats]], Floats | None]:
    """The pose that an action has an armature in at a frame, by its keys alone.

    Returns:
        By bone that it moves, rotation (4,), location (3,) and scale (3,) from rest as Blender has
        them; and the world matrix (4, 4) of the object, none if it does not move that.

    Raises:
        ClipError: it has no slot for the armature, or no keys.
    """
    slot, skeleton = slot_of(armature, action), read_skeleton(armature)
    curves, times = _curves_of(action, slot, skeleton), np.array([frame])
    modes = _rotation_modes(armature, skeleton)
    found: dict[str, tuple[Floats, Floats, Floats]] = {}
    for name in dict.fromkeys(owner for owner, _ in curves if owner):
        turn = rotation_property(modes[name])
        turned, moved, scaled = (
            _values(curves, name, channel, AT_REST[channel], times)
            for channel in (turn, "location", "scale")
        )
        found[name] = from_mode_values(turned, modes[name])[0], moved[0], scaled[0]
    placed = any(not owner for owner, _ in curves)
    return found, _object_motion(armature, curves, times)[0][0] if placed else None


def write_clip(
    armature: bpy.types.Object,
    clip: Clip,
    *,
    name: str = "",
    note: str = "",
    previous: bpy.types.Action | None = None,
    besides: Sequence[Channel] = (),
) -> bpy.types.Action:
    """Give an armature a clip as a new action, with keys on all bones.

    Each bone keeps its rotation mode, and turns the short way from frame to frame. The action
    that the armature had is not changed. The object gets keys where the clip moves it. A cyclic
    clip repeats.

    Args:
        armature: an armature with the clip's bones.
        clip: the motion.
        name: name of the new action, the clip's if empty.
        note: what the clip was made from, kept with the action.
        previous: an action written here before, to be written anew if nobody has edited it.
        besides: what else the action moves; see :func:`further_channels`.

    Returns:
        The action, assigned to the armature.

    Raises:
        RigError: the object is no armature, or lacks a bone.
        WriteError: it is read-only, or in NLA tweak mode.
    """
    writable_armature(armature)
    channels = finished(clip_channels(armature, clip))
    channels += besides
    keep_unkeyed_pose(armature)
    return write_action(
        armature,
        name or clip.name,
        clip.frames,
        channels,
        previous=previous,
        settings_note=note,
        repeats=clip.cyclic,
    )


def is_recorded(
    armature: bpy.types.Object, action: bpy.types.Action, slot: bpy.types.ActionSlot | None
) -> bool:
    """Whether an action has poses a frame apart, and nothing of its own in between.

    Straight curves of angles from one to the next are what the file's format or its rest pose makes
    of it, and may lead far off the shortest way: so nothing is read from them.
    """
    curves = _curves_of(action, slot or slot_of(armature, action), read_skeleton(armature))
    off = _off_whole_frames(curves) if curves else 0.0
    return all(goes_straight(each, off) for own in curves.values() for each in own.values())


def clip_channels(
    armature: bpy.types.Object, clip: Clip, posed: PoseValues | None = None
) -> Generator[None, None, list[Channel]]:
    """Channels of all bones of a clip and of the object, in steps; see :func:`bone_channels`."""
    clip = clip.on_bones(read_skeleton(armature).inherits_rotation)
    channels = yield from bone_channels(armature, clip, clip.skeleton.names, posed)
    return channels + _object_channels(armature, clip)


def bone_channels(
    armature: bpy.types.Object,
    clip: Clip,
    bones: Collection[str],
    posed: PoseValues | None = None,
) -> Generator[None, None, list[Channel]]:
    """Channels of some bones of a clip: rotations, and locations and scales where there are any.

    In steps. How the armature is posed may be known.

    Raises:
        RigError: the object is no armature, or lacks a bone.
    """
    skeleton, pose = clip.skeleton, pose_values(armature) if posed is None else posed
    numbers = [number for number, name in enumerate(skeleton.names) if name in bones]
    names = [skeleton.names[number] for number in numbers]
    known = read_channels(armature, names)
    channels: list[Channel] = []
    for first in range(0, len(names), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        channels += known.rotations(names[some], clip.rotations[:, numbers[some]])
        yield
    channels += _location_channels(armature, clip, known, numbers, pose)
    yield
    scales = np.ones(clip.locations.shape) if clip.scales is None else clip.scales
    for bone in pose_of(armature).bones:
        if bone.name not in known.paths:
            continue
        own = scales[:, skeleton.index[bone.name]]
        if posed_value(pose, bone.name, "scale") != (1.0, 1.0, 1.0) or (own != 1.0).any():
            channels.append(known.scale(bone.name, own))
    return channels


def further_channels(
    armature: bpy.types.Object,
    action: bpy.types.Action,
    slot: bpy.types.ActionSlot | None,
    frames: Floats,
) -> list[Channel]:
    """What an action moves that is no part of a clip: custom properties, influences of constraints,
    the object's size and visibility.

    Args:
        armature: the armature object.
        action: the action.
        slot: its slot; if none is given the one that the armature uses, or would.
        frames: (frames,)

    Raises:
        ClipError: there is no slot for the armature.
    """
    bones = armature_data(armature).bones
    found: dict[str, dict[int, bpy.types.FCurve]] = defaultdict(dict)
    for curve in shown_curves(action, slot or slot_of(armature, action)):
        name, channel = bone_and_property(curve.data_path)
        if not (channel in _POSED and name in bones if name else channel in _PLACED):
            found[curve.data_path][curve.array_index] = curve
    channels: list[Channel] = []
    for path, components in found.items():
        try:
            value: Any = armature.path_resolve(path)
        except ValueError:
            # Of a bone or a property that is gone.
            continue
        # What has no curve keeps its value. Curves know choices from a list by their numbers.
        now: list[Any] = [0.0]
        if not isinstance(value, str):
            now = [value] if isinstance(value, (bool, int, float)) else list(value)
        values = _values({("", ""): components}, "", "", now, frames)
        if not np.isfinite(values).all():
            continue
        group = next(iter(components.values())).group
        bone = path.removeprefix('pose.bones["').partition('"]')[0]
        channels.append(Channel(path, values, group.name if group is not None else bone))
    return channels


def setting_values(
    armature: bpy.types.Object,
    path: str,
    frames: Floats,
    action: bpy.types.Action | None,
    slot: bpy.types.ActionSlot | None,
) -> Floats | None:
    """Values (frames,) of a setting of an armature that has keys; none if it has none.

    Keys are in the action that the armature has at present, which is what its editors show, or else
    in the one that is given.

    Args:
        armature: the armature object.
        path: of the setting.
        frames: (frames,)
        action: where else to look.
        slot: its slot; if none is given the one that the armature uses, or would.
    """
    data = armature.animation_data
    places = [] if data is None or data.action is None else [(data.action, data.action_slot)]
    if action is not None:
        places.append((action, slot or slot_of(armature, action)))
    for each, own in places:
        for curve in () if own is None else shown_curves(each, own):
            if curve.data_path == path:
                return evaluate_fcurve(curve, frames)
    return None


def resized_bones(
    armature: bpy.types.Object,
    action: bpy.types.Action,
    slot: bpy.types.ActionSlot | None,
    frames: Floats,
    changed: Collection[str],
    *,
    unkeyed: UnkeyedPose | None = None,
) -> tuple[list[str], list[str]]:
    """Bones that are scaled and carry others, of which a clip has the places, not the size.

    Where none of what they carry is changed, all of it can be as the action has it.

    Args:
        armature: the armature object.
        action: the action that the clip was read from.
        slot: its slot; if none is given the one that the armature uses, or would.
        frames: (frames,)
        changed: names of the bones that no longer move as the action says.
        unkeyed: the armature's unkeyed pose, if it is known.

    Returns:
        Names of the bones that lose their size, and of these and all that they carry.
    """
    skeleton = read_skeleton(armature)
    curves = _curves_of(action, slot or slot_of(armature, action), skeleton)
    pose = unkeyed_pose(armature) if unkeyed is None else unkeyed

    def size(name: str) -> Floats:
        otherwise = pose.get((name, "scale"), AT_REST["scale"])
        return _values(curves, name, "scale", otherwise, frames)

    sized = {name for name, channel in (*curves, *pose) if channel == "scale"}
    off = [np.abs(size(name) - 1.0).max() if name in sized else 0.0 for name in skeleton.names]
    scaled = np.array(off) > _ROUNDING
    lost: list[str] = []
    done: dict[int, bool] = {}
    for number in np.flatnonzero(scaled & ~_stretches_apart(armature, skeleton, scaled)).tolist():
        if number in done:
            continue
        carried = bones_beneath(skeleton, [number])
        loses = any(skeleton.names[each] in changed for each in carried)
        done |= dict.fromkeys(carried, loses)
        if loses:
            lost.append(skeleton.names[number])
    return lost, [skeleton.names[each] for each, loses in done.items() if loses]


def _action_clip(
    armature: bpy.types.Object,
    skeleton: Skeleton,
    action: bpy.types.Action,
    slot: bpy.types.ActionSlot,
    *,
    visual: bool,
    frames: ArrayLike | None,
    rate: float,
    unkeyed: UnkeyedPose | None,
) -> Generator[None, None, Clip]:
    curves = _curves_of(action, slot, skeleton)
    if not curves:
        raise ClipError(
            phrase(
                "Action '{action}' has no keys for the bones of '{armature}'.",
                action=action.name,
                armature=armature.name,
            ),
            "Choose an action made for this armature.",
        )
    times = _checked_frames(_action_range(action, curves) if frames is None else frames, frames)
    if visual:
        with assigned(armature, action, slot):
            shown = _shown_clip(armature, skeleton, action.name, times, rate)
        return replace(shown, cyclic=frames is None and _is_cyclic(action, curves, shown))
    pose = unkeyed_pose(armature) if unkeyed is None else unkeyed
    moved = yield from _bone_motion(armature, skeleton, curves, pose, times)
    rotations, locations, scales = moved
    world, own = _object_motion(armature, curves, times)
    if not all(np.isfinite(each).all() for each in (rotations, locations, world)):
        raise ClipError(
            phrase("Action '{action}' has keys that are no finite numbers.", action=action.name),
            "Repair or delete them, or choose another action.",
        )
    _check_scale(armature, world)
    clip = Clip(action.name, skeleton, times, rate, rotations, locations, world, scales, own)
    return replace(clip, cyclic=frames is None and _is_cyclic(action, curves, clip))


def _is_cyclic(action: bpy.types.Action, curves: _Curves, clip: Clip) -> bool:
    """Whether an action says that its range is a cycle, or its curves repeat just that."""
    if action.use_frame_range and action.use_cyclic:
        return len(clip) > 2
    ends = clip.frames[[0, -1]]
    repeated = [
        key_range(curve)
        for components in curves.values()
        for curve in components.values()
        if any(each.type == "CYCLES" and not each.mute for each in curve.modifiers)
    ]
    # One that goes on for more than a round serves to make it last.
    alike = all(np.abs(ends - each).max() < _ON_FRAME for each in repeated)
    return bool(repeated) and alike and closes(clip.rotations)


def closes(rotations: Floats) -> bool:
    """Whether the last of rotations (frames, bones, 4) are the first ones again."""
    return len(rotations) > 2 and bool(angle_between(rotations[0], rotations[-1]).max() < _CLOSED)


def _object_channels(armature: bpy.types.Object, clip: Clip) -> list[Channel]:
    """The object's own motion; none where it stands as it does now."""
    moved, still = clip.own, np.array(armature.matrix_basis, dtype=np.float64)
    if moved is None:
        moved, still = clip.world, world_matrix(armature)
    if np.abs(moved - still).max() <= _STILL * max(1.0, np.abs(still).max()):
        return []
    if clip.own is None:
        turns = from_matrix(moved[:, :3, :3] / clip.scale)
        return read_object_channels(armature).channels(moved[:, :3, 3], turns)
    signs = np.sign(np.array(armature.scale) * np.array(armature.delta_scale))
    turns = from_matrix(
        moved[:, :3, :3] / (np.linalg.norm(moved[:, :3, :3], axis=1) * signs)[:, None]
    )
    return read_object_channels(armature).own_channels(moved[:, :3, 3], turns)


def _location_channels(
    armature: bpy.types.Object,
    clip: Clip,
    known: RigChannels,
    numbers: Sequence[int],
    pose: PoseValues,
) -> list[Channel]:
    """Locations of roots, and of all bones that are not, or would not stay, where rest has them."""
    skeleton = clip.skeleton
    size = np.ptp(skeleton.heads, axis=0).max() + skeleton.lengths.max()
    channels: list[Channel] = []
    for number in numbers:
        if skeleton.connected[number]:
            continue
        name = skeleton.names[number]
        values = clip.locations[:, number]
        still = posed_value(pose, name, "location") == (0.0, 0.0, 0.0)
        at_rest = still and np.abs(values).max() < _STILL * size
        if at_rest and skeleton.parents[number] >= 0:
            continue
        axes = location_axes(armature, skeleton, number)
        channels.append(known.location(name, values @ axes.T))
    return channels


def _shown_clip(
    armature: bpy.types.Object, skeleton: Skeleton, name: str, times: Floats, rate: float
) -> Clip:
    _check_shown(armature)
    matrices, world, own = shown_poses(armature, times)
    _check_scale(armature, world)
    orientations = from_matrix(orientations_of(matrices[..., :3, :3]))
    rotations, locations = unposed(skeleton, orientations, matrices[..., :3, 3])
    sizes = np.linalg.norm(matrices[..., :3, :3], axis=-2)
    scaled = np.abs(sizes - 1.0).max(axis=(0, 2)) > _ROUNDING
    # What constraints and drivers scale they will scale again.
    alone = scaled & ~_beneath(skeleton, scaled) & ~np.array(skeleton.constrained)
    alone &= np.array([not each for each in skeleton.children])
    scales = np.where(alone[:, None], sizes, 1.0) if alone.any() else None
    return Clip(name, skeleton, times, rate, rotations, locations, world, scales, own)


def _check_shown(armature: bpy.types.Object) -> None:
    """Blender would hand out the one pose that it has worked out last, at every frame."""
    layer = bpy.context.view_layer
    assert layer is not None
    if armature.hide_viewport or not _is_within(armature, layer.layer_collection):
        raise ClipError(
            phrase(
                "'{armature}' is not in the scene, or disabled in viewports: it cannot be read "
                "as shown.",
                armature=armature.name,
            ),
            "Enable it and its collection in the Outliner, or turn off As Shown.",
        )
    if armature_data(armature).pose_position == "REST":
        raise ClipError(
            phrase(
                "'{armature}' is in its rest position: it cannot be read as shown.",
                armature=armature.name,
            ),
            "Choose Pose Position in its armature properties, or turn off As Shown.",
        )


def _is_within(obj: bpy.types.Object, layer: bpy.types.LayerCollection) -> bool:
    """Whether Blender works the object out because of this collection or one beneath it."""
    collection = layer.collection
    if collection.hide_viewport:
        return False
    own = not layer.exclude and obj in collection.objects.values()
    return own or any(_is_within(obj, each) for each in layer.children)


def slot_of(armature: bpy.types.Object, action: bpy.types.Action) -> bpy.types.ActionSlot:
    """The slot that Blender would give the armature, or the only one with its bones."""
    data = armature.animation_data
    slots = [slot for slot in action.slots if slot.target_id_type in ("OBJECT", "UNSPECIFIED")]
    if data is not None and data.action == action and data.action_slot is not None:
        return data.action_slot
    for slot in slots:
        if armature in slot.users():
            return slot
    wanted = [f"OB{armature.name}"]
    if data is not None:
        wanted.insert(0, data.last_slot_identifier)
    fitting = [slot for slot in slots if _curves_of(action, slot, read_skeleton(armature))]
    for identifier in wanted:
        for slot in fitting:
            if slot.identifier == identifier:
                return slot
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        names = ", ".join(f"'{slot.name_display}'" for slot in fitting)
        raise ClipError(
            phrase(
                "Action '{action}' has several slots that fit '{armature}': {names}.",
                action=action.name,
                armature=armature.name,
                names=names,
            ),
            "Assign the action to the armature and choose its slot in the Action editor.",
        )
    if next(curves_of(action), None) is not None:
        raise ClipError(
            phrase(
                "Action '{action}' has no slot for '{armature}'.",
                action=action.name,
                armature=armature.name,
            ),
            "Choose an action made for this armature.",
        )
    raise ClipError(
        phrase("Action '{action}' is empty.", action=action.name), "Choose an action that has keys."
    )


def _curves_of(action: bpy.types.Action, slot: bpy.types.ActionSlot, skeleton: Skeleton) -> _Curves:
    """The curves that move the armature or its bones; none at all if no bone is among them."""
    curves: _Curves = defaultdict(dict)
    bones = False
    for curve in shown_curves(action, slot):
        name, channel = bone_and_property(curve.data_path)
        if name and name not in skeleton.index:
            continue
        if channel.removeprefix("delta_") in AT_REST:
            curves[name, channel][curve.array_index] = curve
            bones = bones or bool(name)
    return curves if bones else {}


def _action_range(action: bpy.types.Action, curves: _Curves) -> Floats:
    """The frames within the keys (or the artist's own range), at least the two ends: whole ones,
    or as far off these as most keys are, or the range begins.
    """
    if action.use_frame_range:
        start, end = action.frame_start, action.frame_end
        off = start
    else:
        off = _off_whole_frames(curves)
        ranges = [
            key_range(curve)
            for components in curves.values()
            for curve in components.values()
            if len(curve.keyframe_points) or len(curve.sampled_points)
        ]
        if not ranges:
            raise ClipError(
                phrase(
                    "Action '{action}' has no keys, so no beginning and no end.", action=action.name
                ),
                "Give it a manual frame range.",
            )
        start, end = min(each[0] for each in ranges), max(each[1] for each in ranges)
    if end - start < 0.5:
        raise ClipError(
            phrase(
                "Action '{action}' has only one frame: it is a pose, not a motion.",
                action=action.name,
            ),
            "Choose an action with keys at two frames or more.",
        )
    return _frames_within(start, end, off)


def _frames_within(start: float, end: float, off: float = 0.0) -> Floats:
    # Frames are single precision in Blender, and importers miss whole ones by a little.
    off = float(np.round(off, 3)) % 1.0
    first, last = np.ceil(start - off - 1e-3), np.floor(end - off + 1e-3)
    return off + np.arange(first, last + 1.0) if last > first else np.array([start, end])


def _off_whole_frames(curves: _Curves) -> float:
    """By how much of a frame most keys miss whole frames: a recorded motion may be moved by half of
    one, and between its keys is what its format makes of it.
    """
    every = [curve for components in curves.values() for curve in components.values()]
    longest = max(every, key=lambda curve: len(curve.keyframe_points))
    parts = np.round(np.round(key_points(longest)[:, 0].astype(np.float64), 3) % 1.0, 3) % 1.0
    values, counts = np.unique(parts, return_counts=True)
    most = int(counts.argmax()) if len(counts) else -1
    return float(values[most]) if most >= 0 and 2 * counts[most] > len(parts) else 0.0


def scene_rate() -> float:
    """Frames per second of the scene."""
    scene = bpy.context.scene
    assert scene is not None
    return scene.render.fps / scene.render.fps_base


def _track_range(armature: bpy.types.Object) -> Floats:
    data = armature.animation_data
    assert data is not None
    strips = [strip for track in data.nla_tracks for strip in track.strips if not strip.mute]
    if not strips:
        raise ClipError(
            phrase("All NLA strips of '{armature}' are muted.", armature=armature.name),
            "Unmute one.",
        )
    return _frames_within(
        min(strip.frame_start for strip in strips), max(strip.frame_end for strip in strips)
    )


def _checked_frames(times: ArrayLike, given: ArrayLike | None) -> Floats:
    """A ValueError is a fault of the caller's, not a user's."""
    checked = np.asarray(times, dtype=np.float64)
    if checked.ndim != 1 or len(checked) == 0 or not (np.diff(checked) > 0.0).all():
        raise ValueError(f"frames must be one ascending row, not {given}")
    return checked


def _values(
    curves: _Curves, owner: str, channel: str, otherwise: Sequence[float], times: Floats
) -> Floats:
    """(frames, components) of one property."""
    result = np.tile(np.array(otherwise, dtype=np.float64), (len(times), 1))
    for component, curve in curves.get((owner, channel), {}).items():
        if component < result.shape[1]:
            result[:, component] = evaluate_fcurve(curve, times)
    return result


def _bone_motion(
    armature: bpy.types.Object,
    skeleton: Skeleton,
    curves: _Curves,
    unkeyed: UnkeyedPose,
    times: Floats,
) -> Generator[None, None, tuple[Floats, Floats, Floats | None]]:
    """Rotations (frames, bones, 4), locations and, if there are any, scales (frames, bones, 3), in
    steps.
    """
    shape = (len(times), len(skeleton))
    rotations = np.broadcast_to(IDENTITY, (*shape, 4)).copy()
    locations = np.zeros((*shape, 3))
    scales = np.ones((*shape, 3))
    modes = _rotation_modes(armature, skeleton)
    present = {*curves, *unkeyed}

    def values(name: str, channel: str) -> Floats:
        otherwise = unkeyed.get((name, channel), AT_REST[channel])
        return _values(curves, name, channel, otherwise, times)

    for number, name in enumerate(skeleton.names):
        if (name, "location") in present and not skeleton.connected[number]:
            moved = values(name, "location")
            locations[:, number] = moved @ location_axes(armature, skeleton, number)
        if (name, "scale") in present:
            scales[:, number] = values(name, "scale")
        yield
    for mode in set(modes.values()):
        channel = rotation_property(mode)
        chosen = [
            name for name in skeleton.names if modes[name] == mode and (name, channel) in present
        ]
        if chosen:
            numbers = [skeleton.index[name] for name in chosen]
            turned: list[Floats] = []
            for name in chosen:
                turned.append(values(name, channel))
                yield
            rotations[:, numbers] = from_mode_values(np.stack(turned, axis=1), mode)
            yield
    off = np.abs(scales - 1.0).max(axis=(0, 2))
    stretching = (off > _ROUNDING) & _stretches_apart(armature, skeleton, off > _ROUNDING)
    kept = None
    if stretching.any():
        kept = np.where(stretching[:, None], scales, 1.0)
        off = np.where(stretching, 0.0, off)
    _check_inheritance(armature, skeleton, off > _ROUNDING)
    if (off > _LEAST_SCALING).any():
        scales = np.where(stretching[:, None], 1.0, scales)
        return *without_scale(skeleton, rotations, locations, scales), kept
    return rotations, locations, kept


def _stretches_apart(
    armature: bpy.types.Object, skeleton: Skeleton, scaled: np.ndarray
) -> np.ndarray:
    """Whether each bone's children all keep their own axes when it is scaled; at the end of a
    chain, whether the bone itself does, or has nothing scaled above it.
    """
    bones = armature_data(armature).bones
    inside = _beneath(skeleton, scaled)
    apart = [
        bones[name].inherit_scale in _APART or not (inside[number] or skeleton.children[number])
        for number, name in enumerate(skeleton.names)
    ]
    return np.array(
        [
            all(apart[child] for child in children or (number,))
            for number, children in enumerate(skeleton.children)
        ]
    )


def _beneath(skeleton: Skeleton, chosen: np.ndarray) -> np.ndarray:
    """Which bones hang on one of these, (bones,)."""
    inside = np.zeros(len(skeleton), dtype=bool)
    for number, parent in enumerate(skeleton.parents):
        inside[number] = parent >= 0 and (chosen[parent] or inside[parent])
    return inside


def location_axes(armature: bpy.types.Object, skeleton: Skeleton, bone: int) -> Floats:
    """A bone's own axes (3, 3), as columns, seen along those in which its location is given: its
    own, or, where it is not local, its parent's or the armature's.
    """
    if armature_data(armature).bones[skeleton.names[bone]].use_local_location:
        return np.eye(3)
    axes = skeleton.rest_matrices[bone, :3, :3]
    parent = skeleton.parents[bone]
    return axes if parent < 0 else skeleton.rest_matrices[parent, :3, :3].T @ axes


def _check_inheritance(armature: bpy.types.Object, skeleton: Skeleton, scaled: np.ndarray) -> None:
    bones = armature_data(armature).bones
    bones_beneath = scaled.copy()
    for number, parent in enumerate(skeleton.parents):
        if parent < 0 or not bones_beneath[parent]:
            continue
        bone = bones[number]
        if bone.inherit_scale != "FULL" or not bone.use_inherit_rotation:
            raise ClipError(
                phrase(
                    "'{armature}' scales bones above '{bone}', which does not inherit it.",
                    armature=armature.name,
                    bone=bone.name,
                ),
                "Turn on As Shown: the motion is then read as the scene shows it.",
            )
        bones_beneath[number] = True


def _rotation_modes(armature: bpy.types.Object, skeleton: Skeleton) -> dict[str, str]:
    pose = {bone.name: bone.rotation_mode for bone in pose_of(armature).bones}
    return {name: pose.get(name, "QUATERNION") for name in skeleton.names}


def _object_motion(
    armature: bpy.types.Object, curves: _Curves, times: Floats
) -> tuple[Floats, Floats]:
    """World matrices (frames, 4, 4) of the armature object, and what its own channels make."""
    if not any(not name for name, _ in curves):
        shape = (len(times), 4, 4)
        basis = np.array(armature.matrix_basis, dtype=np.float64)
        world = np.broadcast_to(world_matrix(armature), shape)
        return world.copy(), np.broadcast_to(basis, shape).copy()

    def values(channel: str) -> Floats:
        return _values(curves, "", channel, tuple(getattr(armature, channel)), times)

    mode = armature.rotation_mode
    channel = rotation_property(mode)
    rotations = from_mode_values(values(channel), mode)
    delta = f"delta_{channel}"
    if ("", delta) in curves and mode != "AXIS_ANGLE":
        rotations = multiply(from_mode_values(values(delta), mode), rotations)
    else:
        rotations = multiply(delta_rotation(armature), rotations)
    own = np.zeros((len(times), 4, 4))
    scales = values("scale") * values("delta_scale")
    own[:, :3, :3] = to_matrix(rotations) * scales[:, None, :]
    own[:, :3, 3] = values("location") + values("delta_location")
    own[:, 3, 3] = 1.0
    return parent_frame(armature) @ own, own


def _check_scale(armature: bpy.types.Object, world: Floats) -> None:
    sizes = np.linalg.norm(world[:, :3, :3], axis=1)
    mean = sizes.mean()
    if mean == 0.0 or not np.isfinite(world).all():
        raise ClipError(
            phrase("'{armature}' has no size.", armature=armature.name),
            "Repair the object's scale.",
        )
    if (np.linalg.det(world[:, :3, :3]) < 0.0).any():
        raise ClipError(
            phrase("'{armature}' is mirrored by a negative scale.", armature=armature.name),
            "Apply its scale (Object > Apply > Scale).",
        )
    if np.abs(sizes / mean - 1.0).max() > _ROUNDING:
        raise ClipError(
            phrase(
                "The scale of '{armature}' is not the same in all directions and at all frames.",
                armature=armature.name,
            ),
            "Give it one scale: apply it (Object > Apply > Scale), and remove its scale keys.",
        )
