# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion files into Blender through its own importers, round their faults.

Whatever happens, the scene keeps its frame rate, its range and its current frame, and a file that
cannot be used leaves no data-block behind.
"""

from __future__ import annotations

import gc
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import bpy
import numpy as np

from ...core.errors import ClipError, WriteError
from ...core.phrases import phrase
from ...core.rotations import normalized
from ...core.splicing.clip import MOTION_SUFFIXES, check_bvh
from ...core.splicing.humanoid import map_skeleton
from ..animation import curves_of, key_points, read_clip, time_kept
from ..rig import read_skeleton

NOTE: Final = "octo_motion_clip"
"""Custom property of an imported action: a group with the name of its file and its own rate."""

COLLECTION: Final = "Clips"
_COLLECTION_MARK: Final = "octo_motion_clips"

Up = Literal["AUTO", "Y", "Z"]

_LOOKS: Final = 7
"""Frames at which is looked at how a body lies."""

_LYING: Final = 0.8
"""Cosine between a body's length and the axis along which it lies."""

_IMPORTED: Final = 0.8
"""Of the work on a file: Blender's own importer, about."""

_ANOTHER: Final = phrase(
    "Choose a file that ends with {endings} or {last}.",
    endings=", ".join(MOTION_SUFFIXES[:-1]),
    last=MOTION_SUFFIXES[-1],
)


@dataclass(frozen=True)
class ImportedClip:
    """What came of one file; names, because data-blocks do not outlive an undo step."""

    file: str
    armatures: tuple[str, ...]
    actions: tuple[str, ...]
    rate: float
    """Frames per second in the file; of glTF, which has none, as its keys tell."""
    notes: tuple[str, ...]
    """What was repaired: sentences."""
    blocks: frozenset[int] = frozenset()
    """Session identities of all data-blocks that were made."""


def clips_collection(scene: bpy.types.Scene) -> bpy.types.Collection:
    """The scene's collection for clips, made if it is not there."""
    for each in scene.collection.children_recursive:
        if each.get(_COLLECTION_MARK) and each.library is None:
            return each
    made = bpy.data.collections.new(COLLECTION)
    made[_COLLECTION_MARK] = True
    scene.collection.children.link(made)
    return made


def remove_clips(clips: Iterable[ImportedClip]) -> None:
    """Take back what was imported, all of it."""
    blocks = {identity for clip in clips for identity in clip.blocks}
    bpy.data.batch_remove([each for each in _all_blocks() if each.session_uid in blocks])


def import_clip(
    path: Path,
    context: bpy.types.Context,
    frame_start: int = 1,
    *,
    up: Up = "AUTO",
    progress: Callable[[float], None] = lambda _: None,
) -> ImportedClip:
    """One file as armatures with their actions, in the scene's collection for clips.

    Keys lie where the scene's frame rate puts their seconds, so the clip plays at its own speed,
    mostly between whole frames; the first one is on ``frame_start``. No key is made up or lost.

    Args:
        path: the file.
        context: with a scene and a view layer.
        frame_start: frame of the first key.
        up: which axis of a BVH file points up, usually Y; "AUTO" looks at how the body lies. Other
            formats say it themselves.
        progress: is told which share of the work is done, from time to time.

    Raises:
        ClipError: the file cannot be read or has no motion; nothing has changed.
        WriteError: the scene is linked.
    """
    importer = _importer(path)
    before = _data_blocks()
    scene = context.scene
    assert scene is not None
    if scene.library is not None:
        raise WriteError("The scene is linked from another file.", "Work in a scene of this file.")
    rate = scene.render.fps / scene.render.fps_base
    try:
        with _unchanged(context, scene):
            result = importer(path, scene, up)
            progress(_IMPORTED)
            made = _made_since(before)
            _remove_strays(made)
            armatures, actions = _motion(made)
            for each in made:
                _take_off_tracks(each)
            own_rate = result.rate or _rate_of_keys(actions, result.placed_by)
            starts = _starts(actions, takes=result.takes)
            for number, action in enumerate(actions, 1):
                _place_keys(action, rate / result.placed_by, starts[action.name], frame_start)
                progress(_IMPORTED + (1.0 - _IMPORTED) * number / len(actions))
            _label(path, own_rate, armatures, actions)
            _collect(made, clips_collection(scene))
            clip = ImportedClip(
                file=path.name,
                armatures=tuple(each.name for each in armatures),
                actions=tuple(each.name for each in actions),
                rate=own_rate,
                notes=result.notes,
                blocks=frozenset(each.session_uid for each in _made_since(before)),
            )
    except BaseException:
        bpy.data.batch_remove(list(_made_since(before)))
        raise
    return clip


@dataclass(frozen=True)
class _Result:
    """What an importer did: the frame rate its keys were placed by, and the file's own."""

    placed_by: float
    rate: float | None
    notes: tuple[str, ...] = ()
    takes: bool = False
    """Whether actions are called "what moves|take", and those of one take play together."""


def _import_bvh(path: Path, scene: bpy.types.Scene, up: Up) -> _Result:  # noqa: ARG001 - as all
    checked = check_bvh(_content(path))
    # Always the plain copy: what is tested is what is used. Windows cannot delete it as long as
    # the importer's open file waits for the garbage collector.
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        copy = Path(folder) / f"{path.stem}.bvh"
        copy.write_text(checked.text, encoding="utf-8", newline="\n")
        options = {"filepath": str(copy), "update_scene_fps": False}
        before, notes = _data_blocks(), checked.notes
        _call(bpy.ops.import_anim.bvh, **options, **_AXES["Z" if up == "Z" else "Y"])
        if up == "AUTO" and _lies_as_if_z_were_up(_made_since(before)):
            bpy.data.batch_remove(_made_since(before))
            _call(bpy.ops.import_anim.bvh, **options, **_AXES["Z"])
            notes = (*notes, "Its Z axis points up, unlike in most BVH files: it was stood up.")
        gc.collect()
    return _Result(checked.rate, checked.rate, notes)


_AXES: Final[Mapping[str, Mapping[str, str]]] = {
    "Y": {"axis_forward": "-Z", "axis_up": "Y"},
    "Z": {"axis_forward": "Y", "axis_up": "Z"},
}


def _lies_as_if_z_were_up(made: Iterable[bpy.types.ID]) -> bool:
    """Whether a body, read as if Y pointed up, lies on its back, at rest and as it moves."""
    for each in made:
        data = each.animation_data if isinstance(each, bpy.types.Object) else None
        if not isinstance(each, bpy.types.Object) or data is None or data.action is None:
            continue
        skeleton = read_skeleton(each)
        marks = map_skeleton(skeleton).landmarks
        names = [marks.get(mark) for mark in ("head", "foot.L", "foot.R")]
        if None in names:
            return False
        chosen = [skeleton.index[name] for name in names if name is not None]
        first, last = data.action.frame_range
        frames = np.unique(np.linspace(first, last, _LOOKS))
        try:
            heads = read_clip(each, frames=frames).posed()[1][:, chosen]
        except ClipError:
            return False
        heads = np.concatenate([skeleton.heads[None, chosen], heads])
        upright = normalized(heads[:, 0] - heads[:, 1:].mean(axis=1))
        lying = upright @ (0.0, -1.0, 0.0) > _LYING
        return bool(lying[0] and np.mean(lying[1:]) > 0.5)
    return False


def _import_fbx(path: Path, scene: bpy.types.Scene, up: Up) -> _Result:  # noqa: ARG001 - as all
    _content(path)
    _call(bpy.ops.import_scene.fbx, filepath=str(path))
    # The importer sets the scene's rate to the file's, and counts in whole frames a second.
    own = scene.render.fps / scene.render.fps_base
    return _Result(float(scene.render.fps), own, takes=True)


def _import_gltf(path: Path, scene: bpy.types.Scene, up: Up) -> _Result:  # noqa: ARG001 - as all
    _content(path)
    # The importer multiplies by the base of the rate where it should divide.
    scene.render.fps_base = 1.0
    _call(bpy.ops.import_scene.gltf, filepath=str(path), disable_bone_shape=True)
    return _Result(float(scene.render.fps), None)


_REFUSALS: Final = (
    (
        "draco",
        "Its meshes are compressed by Draco, which this Blender cannot read.",
        "Export it again without compression.",
    ),
    ("ascii fbx", "It is no binary FBX file.", "Export it again as binary FBX."),
    ("missing resource", "", "Put that file beside it, or export one file (.glb)."),
    ("is not available on this", "", "Export it again without this extension."),
)
"""A word of what an importer says, what to say in its place (empty: the same), and what to do."""

_Importer = Callable[[Path, bpy.types.Scene, Up], _Result]
_IMPORTERS: Final[Mapping[str, _Importer]] = {
    ".bvh": _import_bvh,
    ".fbx": _import_fbx,
    ".glb": _import_gltf,
    ".gltf": _import_gltf,
}


def _importer(path: Path) -> _Importer:
    importer = _IMPORTERS.get(path.suffix.lower())
    if importer is None:
        raise ClipError(
            phrase("'{suffix}' files are no motion that can be imported.", suffix=path.suffix),
            _ANOTHER,
        )
    if not path.is_file():
        raise ClipError("There is no such file.", _ANOTHER)
    return importer


def _content(path: Path) -> bytes:
    try:
        content = path.read_bytes()
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise ClipError(
            phrase("The file cannot be read: {reason}.", reason=reason), "Choose another one."
        ) from error
    if not content:
        raise ClipError("The file is empty.", "Export it again.")
    return content


def _call(operator: Any, **options: Any) -> None:
    """Run one of Blender's importers.

    Raises:
        ClipError: it failed, in whatever way it says so.
    """
    try:
        result = operator(**options)
    except (RuntimeError, TypeError, ValueError, AttributeError) as error:
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        reason = next((line for line in reversed(lines) if not line.startswith("Location")), "")
        reason = reason.removeprefix("Error: ").rstrip(".") or phrase("it does not say why")
        said = str(error).casefold()
        known = next((each[1:] for each in _REFUSALS if each[0] in said), ("", "Export it again."))
        problem = known[0] or phrase("Blender's importer cannot read it: {reason}.", reason=reason)
        raise ClipError(problem, known[1]) from error
    if "FINISHED" not in result:
        raise ClipError("Blender's importer cannot read it.", "Export it again.")


# --- What was made --------------------------------------------------------------------------------


def _kinds() -> Iterator[Any]:
    for definition in bpy.data.bl_rna.properties:
        if definition.type == "COLLECTION":
            yield getattr(bpy.data, definition.identifier)


def _all_blocks() -> list[bpy.types.ID]:
    # By what identifies them: some are in more than one of the file's lists.
    return list({each.session_uid: each for kind in _kinds() for each in kind}.values())


def _data_blocks() -> set[int]:
    return {each.session_uid for each in _all_blocks()}


def _made_since(before: set[int]) -> list[bpy.types.ID]:
    return [each for each in _all_blocks() if each.session_uid not in before]


@contextmanager
def _unchanged(context: bpy.types.Context, scene: bpy.types.Scene) -> Iterator[None]:
    """Give the scene back its time, and the view layer what was selected if the import fails."""
    render = scene.render
    ends = scene.frame_start, scene.frame_end
    rate = (render.fps, render.fps_base)
    layer = context.view_layer
    assert layer is not None
    active = layer.objects.active
    selected = [each for each in layer.objects if each.select_get(view_layer=layer)]
    try:
        with time_kept(scene):
            yield
    except BaseException:
        for each in layer.objects:
            each.select_set(each in selected, view_layer=layer)
        layer.objects.active = active
        raise
    finally:
        render.fps, render.fps_base = rate
        scene.frame_start, scene.frame_end = ends


def _remove_strays(made: list[bpy.types.ID]) -> None:
    """Take away what the glTF importer adds for itself: shapes of bones, in a hidden collection."""
    strays: list[bpy.types.ID] = []
    for each in made:
        if isinstance(each, bpy.types.Collection) and each.name.startswith("glTF_not_exported"):
            strays += [*each.objects, each]
    strays += [each.data for each in strays if isinstance(each, bpy.types.Object) and each.data]
    for each in strays:
        made.remove(each)
    bpy.data.batch_remove(strays)


def _motion(
    made: Iterable[bpy.types.ID],
) -> tuple[list[bpy.types.Object], list[bpy.types.Action]]:
    """Armatures, and the actions that have keys.

    Raises:
        ClipError: there are none, or keys are no numbers.
    """
    armatures = [
        each for each in made if isinstance(each, bpy.types.Object) and each.type == "ARMATURE"
    ]
    actions = [each for each in made if isinstance(each, bpy.types.Action)]
    moving = [
        each for each in actions if any(len(curve.keyframe_points) for curve in curves_of(each))
    ]
    if not armatures and moving:
        raise ClipError(
            "It moves objects, not the bones of an armature.",
            "Export it with the mesh that the bones deform.",
        )
    if not armatures:
        raise ClipError("There is no armature in it.", "Choose a file of a character's motion.")
    if not moving:
        raise ClipError(
            "Its armature has no motion.", "Use Blender's own importer for a rig without any."
        )
    for action in moving:
        if not all(np.isfinite(key_points(curve)).all() for curve in curves_of(action)):
            raise ClipError("Some of its keys are no finite numbers.", "Export it again.")
    return armatures, moving


def _take_off_tracks(owner: bpy.types.ID) -> None:
    """Show the first action instead of the tracks that the glTF importer makes."""
    data = getattr(owner, "animation_data", None)
    if data is None or not len(data.nla_tracks):
        return
    strips = [strip for track in data.nla_tracks for strip in track.strips if strip.action]
    found = [(strip.action, strip.action_slot) for strip in strips]
    for track in list(data.nla_tracks):
        data.nla_tracks.remove(track)
    if found:
        data.action, slot = found[0]
        data.action_slot = slot


def _rate_of_keys(actions: Iterable[bpy.types.Action], placed_by: float) -> float:
    """Frames per second that the distances of keys tell, else those they were placed by."""
    steps = []
    for action in actions:
        times = [key_points(curve)[:, 0] for curve in curves_of(action)]
        longest = max(times, key=len)
        steps += list(np.diff(longest))
    usual = float(np.median(steps)) if steps else 0.0
    return placed_by / usual if usual > 1e-3 else placed_by


def _starts(actions: Iterable[bpy.types.Action], *, takes: bool) -> dict[str, float]:
    """The first key of each action, by its name; of those of one take, the first of all."""
    own: dict[str, float] = {}
    shared: dict[str, float] = {}
    for action in actions:
        curves = (curve for curve in curves_of(action) if len(curve.keyframe_points))
        own[action.name] = min(float(key_points(curve)[:, 0].min()) for curve in curves)
        take = _take(action.name)
        shared[take] = min(own[action.name], shared.get(take, np.inf))
    return {name: shared[_take(name)] for name in own} if takes else own


def _take(action: str) -> str:
    """FBX: "Armature|Take 1|Layer"."""
    return action.split("|", 1)[-1]


def _place_keys(action: bpy.types.Action, factor: float, start: float, frame_start: int) -> None:
    """Stretch an action in time, and move a moment of it to a frame."""
    curves = [curve for curve in curves_of(action) if len(curve.keyframe_points)]
    first, last = np.inf, -np.inf
    for curve in curves:
        for name in ("co", "handle_left", "handle_right"):
            points = key_points(curve, name).astype(np.float64)
            points[:, 0] = frame_start + (points[:, 0] - start) * factor
            curve.keyframe_points.foreach_set(name, points.astype(np.float32).ravel())
            if name == "co":
                first = min(first, float(points[:, 0].min()))
                last = max(last, float(points[:, 0].max()))
        curve.update()
    action.use_frame_range = True
    action.frame_start, action.frame_end = first, last


def _label(
    path: Path,
    rate: float,
    armatures: Iterable[bpy.types.Object],
    actions: Sequence[bpy.types.Action],
) -> None:
    """Call everything after the file; of several actions each keeps its own name behind it."""
    for each in armatures:
        each.name = path.stem
        if each.data is not None:
            each.data.name = path.stem
    for action in actions:
        several = len(actions) > 1
        action.name = f"{path.stem} {_take(action.name)}" if several else path.stem
        action.use_fake_user = True
        action[NOTE] = {"file": path.name, "rate": rate}


def _collect(made: Iterable[bpy.types.ID], collection: bpy.types.Collection) -> None:
    """Put all objects into one collection, and remove those that the importer made for them."""
    own: list[bpy.types.ID] = []
    for each in made:
        if isinstance(each, bpy.types.Object):
            for other in each.users_collection:
                other.objects.unlink(each)
            collection.objects.link(each)
        elif isinstance(each, bpy.types.Collection):
            own.append(each)
    bpy.data.batch_remove(own)
