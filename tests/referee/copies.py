# SPDX-License-Identifier: GPL-3.0-or-later
"""Splices from and onto changed copies of people, against those of the people as they came.

All is done by the buttons that an artist has, and measured from evaluated bones: how far joints are
off, in heights of the body, and by how many degrees bones are turned otherwise.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .changed_copies import CHANGES, Copy, Played
from .clips import imported
from .recording import Flags, Floats, show
from .rest_poses import Bvh

FRAMES = 48
"""So many at most are taken of a clip."""
FPS = 30.0

_LATER, _FADE = 3.0, 6.0
"""Frames after the base's first one at which splices begin, and over which they come and go."""

STACKS: dict[str, tuple[dict[str, Any], ...]] = {
    "arms and head": (
        {"part": "RIGHT_ARM", "mode": "EXACT"},
        {"part": "LEFT_ARM", "mode": "DIRECTION"},
        {"part": "HEAD"},
    ),
    "legs and trunk": ({"part": "LEGS", "with_travel": True}, {"part": "TRUNK"}),
    "whole": (),
}
"""What is spliced together; of ``whole`` the clip is retargeted."""

Library = dict[str, "Kept"]


@dataclass(frozen=True, eq=False)
class Kept:
    """A person and their copies, in a file of their own."""

    file: Path
    frames: Floats
    rows: dict[str, tuple[str, Floats, float, float]]
    """Name of the armature, into, shift, stretch; by change, "" for the one who came."""


def shortened(file: Path, folder: Path) -> Path:
    """A BVH file at about 30 frames a second, and no longer than needed; others as they are."""
    if file.suffix != ".bvh":
        return file
    clip = Bvh.read(file)
    step = max(1, round(1.0 / FPS / clip.frame_time))
    clip = Bvh(clip.joints, step * clip.frame_time, clip.motion[::step][:FRAMES])
    return clip.write(folder / file.name)


def keep(file: Path, folder: Path, changes: Sequence[str], action: str = "") -> Kept:
    """Import a clip, make its copies, and keep all in a file of Blender's."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene: Any = bpy.context.scene
    scene.render.fps = int(FPS)
    armature = imported(shortened(file, folder))
    if action:
        data = armature.animation_data
        data.action = next(each for each in bpy.data.actions if each.name.startswith(action))
        data.action_slot = next(s for s in data.action.slots if s.target_id_type == "OBJECT")
    for track in list(armature.animation_data.nla_tracks):
        armature.animation_data.nla_tracks.remove(track)
    first, last = armature.animation_data.action.frame_range
    frames = np.arange(np.ceil(first), min(np.floor(last), np.ceil(first) + FRAMES - 1) + 1.0)
    person = Played.of(armature, frames)
    rows: dict[str, tuple[str, Floats, float, float]] = {"": (armature.name, np.eye(4), 0.0, 1.0)}
    made = [armature]
    for change in changes:
        copy = CHANGES[change](person, folder)
        copy.armature.name = change
        rows[change] = (copy.armature.name, copy.into, copy.shift, copy.stretch)
        made.append(copy.armature)
    path = folder / f"{file.stem}{action}.blend"
    bpy.data.libraries.write(str(path), set(made))
    return Kept(path, frames, rows)


def _appended(kept: Kept, change: str) -> Copy:
    name, into, shift, stretch = kept.rows[change]
    libraries: Any = bpy.data.libraries
    with libraries.load(str(kept.file)) as (_, wanted):
        wanted.objects = [name]
    armature: Any = wanted.objects[0]
    scene: Any = bpy.context.scene
    scene.collection.objects.link(armature)
    return Copy(armature, into, shift, stretch)


@dataclass(frozen=True, eq=False)
class Seen:
    """Joints (frames, bones, 3) and turns (frames, bones, 3, 3) as in the world of who came."""

    names: list[str]
    joints: Floats
    turns: Floats


def _seen(copy: Copy, frames: Floats) -> Seen:
    names = [each.name for each in copy.armature.data.bones]
    matrices = []
    for frame in copy.frames(frames):
        show(bpy.context.scene, float(frame))
        seen = copy.armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        world = np.linalg.inv(copy.into) @ np.array(seen.matrix_world)
        matrices.append([world @ np.array(seen.pose.bones[name].matrix) for name in names])
    found = np.array(matrices)
    axes = found[..., :3, :3]
    turns = axes / np.linalg.norm(axes, axis=-2, keepdims=True)
    return Seen(names, found[..., :3, 3], turns)


@dataclass(frozen=True, eq=False)
class Made:
    """What came of a stack: the base before, and after; or why nothing did."""

    before: Seen
    after: Seen | None
    fully: Flags
    """(frames,) where splices are fully in: fades mix how limbs are turned about themselves."""
    landmarks: tuple[dict[str, str], dict[str, str]]
    problem: str = ""


def made(base: tuple[Kept, str], clip: tuple[Kept, str], stack: str) -> Made:
    """Splice by buttons: a clip, or a copy of it, onto a base or a copy of it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene: Any = bpy.context.scene
    onto, source = _appended(*base), _appended(*clip)
    scene.render.fps = int(FPS * onto.stretch)
    for each in (source, onto):
        bpy.context.view_layer.objects.active = each.armature
        bpy.ops.octo_motion.map_skeleton()
    marks = (_landmarks(source.armature), _landmarks(onto.armature))
    frames, theirs = base[0].frames, clip[0].frames
    before = _seen(onto, frames)
    try:
        if STACKS[stack]:
            _splice(onto, source, (frames[0], theirs[0]), STACKS[stack])
        else:
            frames = theirs
            bpy.ops.octo_motion.retarget(source=source.armature.name)
            # The result has the clip's frames.
            onto = Copy(onto.armature, onto.into, source.shift, source.stretch)
    except RuntimeError as error:
        return Made(before, None, np.zeros(0, dtype=bool), marks, str(error).strip())
    return Made(before, _seen(onto, frames), _fully(frames, theirs, stack), marks)


def _fully(frames: Floats, theirs: Floats, stack: str) -> Flags:
    since = frames - frames[0] - _LATER
    lasts = theirs[-1] - theirs[0]
    if not STACKS[stack]:
        return np.ones(len(frames), dtype=bool)
    goes = lasts - _FADE if lasts < since[-1] else np.inf
    return (since >= _FADE) & (since <= goes)


def _landmarks(armature: Any) -> dict[str, str]:
    group = armature.octo_motion.splicing.landmarks
    return {key: value for key in dir(group) if isinstance(value := getattr(group, key), str)}


def _splice(
    onto: Copy, source: Copy, starts: tuple[float, float], stack: Sequence[dict[str, Any]]
) -> None:
    for settings in stack:
        bpy.ops.octo_motion.splice_add(part=settings["part"], source=source.armature.name)
        splicing = onto.armature.octo_motion.splicing
        splice = splicing.splices[len(splicing.splices) - 1]
        splice.base_start = float(onto.frames(np.array(starts[0] + _LATER)))
        splice.splice_start = float(source.frames(np.array(starts[1])))
        splice.rate = source.stretch / onto.stretch
        splice.ease_in = splice.ease_out = _FADE * onto.stretch
        for key, value in settings.items():
            setattr(splice, key, value)
    bpy.ops.octo_motion.splice_build()


@dataclass(frozen=True)
class Off:
    """How far a copy's result is off."""

    base: str
    clip: str
    stack: str
    change: str
    whose: str
    """Of whom a copy was taken: of base, clip or both."""
    joints: float
    """Heights of the base's body, most of all where splices are fully in."""
    joint: str
    fading: float
    """The same where they come or go."""
    turn: float
    """Degrees, most of all; which bone."""
    turned: str
    turns: dict[str, float]
    """Degrees of each bone that is turned otherwise by more than 1°."""
    landmarks: list[str]
    """Landmarks that were found otherwise."""
    problem: str


def compare(plain: Made, changed: Made, words: tuple[str, str, str, str, str]) -> Off:
    """What differs between results, as seen in the world of who came."""
    otherwise = [
        f"{key}: {new.get(key)!r} not {old.get(key)!r}"
        for old, new in zip(plain.landmarks, changed.landmarks, strict=True)
        for key in old
        if new.get(key) != old.get(key)
    ]
    if plain.after is None or changed.after is None:
        same = plain.after is changed.after
        told = "" if same else plain.problem or changed.problem
        return Off(*words, 0.0 if same else np.inf, "", 0.0, 0.0, "", {}, otherwise, told)
    names = _playing_alike(plain, changed)
    rows = [plain.before.names.index(each) for each in names]
    others = [changed.before.names.index(each) for each in names]
    off = np.linalg.norm(plain.after.joints[:, rows] - changed.after.joints[:, others], axis=-1)
    off /= _height(plain)
    fully = off[plain.fully].max(axis=0, initial=0.0)
    # A copy's bones have other axes, which are as they are all the time.
    axes = np.swapaxes(plain.before.turns[0, rows], -1, -2) @ changed.before.turns[0, others]
    there = changed.after.turns[:, others] @ np.swapaxes(axes, -1, -2)
    chord = np.linalg.norm(there - plain.after.turns[:, rows], axis=(-2, -1))
    turns = np.degrees(2.0 * np.arcsin(np.clip(chord / np.sqrt(8.0), 0.0, 1.0))).max(axis=0)
    return Off(
        *words,
        float(fully.max()),
        names[int(fully.argmax())],
        float(off.max()),
        float(turns.max()),
        names[int(turns.argmax())],
        {name: round(float(t), 1) for name, t in zip(names, turns, strict=True) if t > 1.0},
        otherwise,
        "",
    )


def _height(made: Made) -> float:
    return float(np.ptp(made.before.joints[:, :, 2], axis=1).max())


def _playing_alike(plain: Made, changed: Made) -> list[str]:
    """Bones that both have and that play alike before: some files lose what ends a chain."""
    first, second = plain.before, changed.before
    return [
        name
        for name in first.names
        if name in second.names
        and np.abs(
            first.joints[:, first.names.index(name)] - second.joints[:, second.names.index(name)]
        ).max()
        < 1e-4 * _height(plain)
    ]


def sweep(
    people: dict[str, Kept],
    pairs: Sequence[tuple[str, str]],
    changes: Sequence[str],
    stacks: Sequence[str],
) -> Iterator[Off]:
    """All changes of base and clip of all pairs."""
    for base, clip in pairs:
        for stack in stacks:
            onto, source = people[base], people[clip]
            plain = made((onto, ""), (source, ""), stack)
            for change in changes:
                whose = {"base": (change, ""), "clip": ("", change), "both": (change, change)}
                for word in ("both",) if change == "fps" else ("base", "clip"):
                    first, second = whose[word]
                    changed = made((onto, first), (source, second), stack)
                    yield compare(plain, changed, (base, clip, stack, change, word))
