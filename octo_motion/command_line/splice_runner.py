# SPDX-License-Identifier: GPL-3.0-or-later
"""Splices of one shot in this Blender: import clips, fill the list, build."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import bpy

from ..blender.animation import lasting, played_action, writable_armature
from ..blender.scene import NOTE, ImportedClip, import_clip
from ..core.errors import ClipError, OctoMotionError, SettingsError
from ..ui.splicing import (
    ClipReader,
    add_splice,
    name_splice,
    prepare_splices,
    splicing_settings,
    write_splices,
)
from .job_report import ShotSummary
from .schema import set_values, unknown
from .shot_schema import HIGHEST_FPS, NewSplice, ShotRequest, frame_rate
from .vocabulary import check_file

_FIRST_FRAME: Final = 1

_BROADCAST: Final = 1.001
"""What whole rates are divided by for television."""


@dataclass
class Clips:
    """Motion files in this Blender, each imported once."""

    warnings: list[str] = field(default_factory=list)
    """What was repaired, or was odd."""
    read: list[Path] = field(default_factory=list)
    """Further files that belong to those that were named."""
    _imported: dict[Path, ImportedClip] = field(default_factory=dict)

    def armature(self, path: Path) -> bpy.types.Object:
        """The armature of a file.

        Raises:
            OctoMotionError: the file cannot be used, or has several.
        """
        first, *others = self._clip(path).armatures
        if others:
            raise ClipError(
                f"'{path.name}' has {1 + len(others)} armatures.",
                "Import it into a .blend file and name the armature there.",
            )
        return bpy.data.objects[first]

    def action(self, path: Path, name: str) -> bpy.types.Action:
        """An action of a file by its name, its only one if that is empty.

        Raises:
            OctoMotionError: there is none of that name, or there are several.
        """
        clip = self._clip(path)
        short = {each.removeprefix(f"{path.stem} "): each for each in clip.actions}
        if name:
            found = short.get(name) or (name if name in clip.actions else "")
            if not found:
                raise ClipError(f"'{path.name}': {unknown('action', name, short)}")
            return bpy.data.actions[found]
        if len(short) > 1:
            raise ClipError(
                f"'{path.name}' has {len(short)} actions.", f"Name one: {', '.join(short)}."
            )
        return bpy.data.actions[clip.actions[0]]

    def _clip(self, path: Path) -> ImportedClip:
        if path not in self._imported:
            check_file(path)
            try:
                clip = import_clip(path, bpy.context, _FIRST_FRAME)
            except OctoMotionError as error:
                raise type(error)(f"'{path.name}': {error.problem}", error.remedy) from error
            self._imported[path] = clip
            self.warnings += [f"'{clip.file}': {note}" for note in clip.notes]
            self.read += files_within(path)
        return self._imported[path]


def import_base(path: Path, fps: float | None) -> tuple[bpy.types.Object, Clips]:
    """A motion file as the only thing in the file, in a scene of its own frame rate.

    Raises:
        OctoMotionError: the file cannot be used.
    """
    clips = _alone(path, fps)
    armature = clips.armature(path)
    if fps is None:
        action: Any = bpy.data.actions[0]
        own = min(max(_rounded(float(action[NOTE]["rate"])), 1.0), float(HIGHEST_FPS))
        scene = armature.users_scene[0]
        if abs(own - scene.render.fps / scene.render.fps_base) > 1e-6:
            # Only now the rate is known, by which the keys are to be placed.
            clips = _alone(path, own)
            armature = clips.armature(path)
    return armature, clips


def _alone(path: Path, fps: float | None) -> Clips:
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene = bpy.context.scene
    assert scene is not None
    if fps is not None:
        scene.render.fps, scene.render.fps_base = frame_rate(fps)
    clips = Clips()
    clips.armature(path)
    return clips


def _rounded(rate: float) -> float:
    """Files round the time of a frame: 0.033333 s are 30 frames per second, 0.041708 s are 23.976,
    as in broadcasting.
    """
    usual = (float(round(rate)), round(_BROADCAST * rate) / _BROADCAST)
    nearest = min(usual, key=lambda each: abs(rate - each))
    return nearest if abs(rate - nearest) < 1e-3 * rate else rate


def has_splices(armature: bpy.types.Object) -> bool:
    """Whether an armature's list of splices has any."""
    stack: Any = splicing_settings(armature)
    return bool(len(stack.splices))


def splice(
    armature: bpy.types.Object, shot: ShotRequest, clips: Clips, base_file: Path | None
) -> ShotSummary:
    """Fill the list of an armature as it is asked for, and build; the context has its scene.

    ``clips`` have been imported, and the armature with them, if it is from a motion file.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """
    writable_armature(armature)
    stack: Any = splicing_settings(armature)
    if shot.splices is None and not has_splices(armature):
        raise ClipError(
            f"'{armature.name}' has no splices in its list.",
            "Say what to splice, a part and a motion file at least.",
        )
    if base_file is not None:
        stack.base, stack.base_slot = clips.action(base_file, shot.base), ""
    elif shot.base:
        stack.base, stack.base_slot = _action(shot.base), ""
    set_values(stack, shot.settings)
    if shot.frames is not None or shot.splices is not None:
        # Where none is set, the armature's own action is the base.
        own = played_action(armature)
        if stack.base is None and own is not None:
            stack.base, stack.base_slot = own
    if shot.frames is not None and stack.base is not None:
        stack.base = lasting(stack.base, shot.frames)
    if shot.splices is not None:
        stack.splices.clear()
        if len(stack.splices):
            raise ClipError(
                "The list of splices is in a linked file and cannot be replaced.",
                "Leave splices out to build it as it is.",
            )
        stack.active_splice = 0
        for number, each in enumerate(shot.splices, 1):
            try:
                _add(armature, each, clips, base_file)
            except OctoMotionError as error:
                which = f"'{each.settings['name']}' ({number})" if "name" in each.settings else ""
                which = which or f"Splice {number}"
                raise type(error)(f"{which}: {error.problem}", error.remedy) from error
    prepared = prepare_splices(armature)
    made = write_splices(prepared, prepared.compute())
    first, last = (round(each) for each in bpy.data.actions[made.action].frame_range)
    warnings = (*clips.warnings, *made.warnings)
    return ShotSummary(made.message, made.frames, first, last, warnings)


def named(blocks: Iterable[Any], name: str) -> Any:
    """The data-block of that name, that of a linked file only where there is no other."""
    found = [each for each in blocks if each.name == name]
    return next((each for each in found if each.library is None), found[0] if found else None)


def mesh_named(name: str) -> bpy.types.Object:
    """A mesh of the file, for feet to stand on."""
    found = named(bpy.data.objects, name)
    if found is None or found.type != "MESH":
        raise SettingsError(f"There is no mesh '{name}'.", "Name a mesh of the file.")
    return found


def _action(name: str) -> bpy.types.Action:
    action = named(bpy.data.actions, name)
    if action is None:
        raise ClipError(unknown("action", name, sorted(each.name for each in bpy.data.actions)))
    return action


def _add(
    armature: bpy.types.Object, asked: NewSplice, clips: Clips, base_file: Path | None
) -> None:
    """Add a splice with what the panel's button gives it, and what is asked for."""
    source, action = _source(armature, asked, clips, base_file)
    values, landmarks = dict[str, Any](), dict[str, Any]()
    for name, each in asked.settings.items():
        (landmarks if name.startswith("landmarks.") else values)[name] = each
    set_values(splicing_settings(source), landmarks)
    reader = ClipReader()
    stack: Any = splicing_settings(armature)
    slot, visual = str(values.get("slot", "")), bool(values.get("visual", False))
    begins = float(reader.base(armature).clip.frames[0])
    frames = reader.source(source, action, slot, visual=visual).clip.frames
    item = add_splice(stack, source, action, begins, frames)
    set_values(item, values)
    if asked.ground:
        item.ground = mesh_named(asked.ground)
    if not item.name:
        name_splice(stack, item)


def _source(
    armature: bpy.types.Object, asked: NewSplice, clips: Clips, base_file: Path | None
) -> tuple[bpy.types.Object, bpy.types.Action]:
    """The armature of a splice and its action."""
    if asked.clip is not None and asked.clip != base_file:
        return clips.armature(asked.clip), clips.action(asked.clip, asked.action)
    if asked.source:
        source = _armature(asked.source)
        return source, _action(asked.action) if asked.action else _own_action(source, armature)
    if base_file is not None and (asked.clip is not None or asked.action):
        return armature, clips.action(base_file, asked.action)
    if not asked.action:
        raise ClipError(
            "It is not said what is spliced.",
            "Give a motion file (clip), or the name of an armature (source) or of an action.",
        )
    return armature, _action(asked.action)


def _armature(name: str) -> bpy.types.Object:
    armatures = [each for each in bpy.data.objects if each.type == "ARMATURE"]
    armature = named(armatures, name)
    if armature is None:
        raise ClipError(unknown("armature", name, sorted(each.name for each in armatures)))
    return armature


def _own_action(source: bpy.types.Object, armature: bpy.types.Object) -> bpy.types.Action:
    own = played_action(source)
    if own is None:
        raise ClipError(f"The source '{source.name}' has no action.", "Name the action.")
    if source == armature:
        raise ClipError(f"'{source.name}' is both base and source.", "Name the source's action.")
    return own[0]


def files_within(path: Path) -> tuple[Path, ...]:
    """Further files that a .gltf file names; they belong to it."""
    if path.suffix.lower() != ".gltf":
        return ()
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        named = [each.get("uri", "") for each in content.get("buffers", ())]
    except (OSError, ValueError, AttributeError, TypeError):
        # The importer has read it, so this is a matter of what we know of glTF.
        return ()
    found = (path.parent / uri for uri in named if isinstance(uri, str) and "data:" not in uri)
    return tuple(each for each in found if each.is_file())
