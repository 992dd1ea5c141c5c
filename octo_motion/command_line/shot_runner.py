# SPDX-License-Identifier: GPL-3.0-or-later
"""One shot in this Blender: open or make the scene, generate, splice or pose, write."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import bpy
from mathutils import Matrix

from ..blender.animation import curves_of, key_points, writable_armature
from ..blender.rig import linked_names, read_skeleton, world_matrix
from ..blender.scene import add_octopus, add_route_curve, remove_markers
from ..core.errors import OctoMotionError, RigError, SettingsError, WriteError
from ..core.locomotion.gait import gait_from_json
from ..core.locomotion.rig import detect_arms
from ..ui.locomotion import (
    Summary,
    disconnect_arms,
    generate_locomotion,
    locomotion_settings,
    once_called,
    set_gait,
    store,
)
from ..ui.posing import play_file
from .follow_runner import follow
from .job_report import ShotSummary, check_limits
from .outputs import blender_said, check_export, export, uncarried
from .retarget_runner import retarget
from .schema import set_values
from .shot_schema import NewRoute, ShotRequest, frame_rate, is_motion
from .splice_runner import Clips, has_splices, import_base, named, splice

_ROUTE_NAME: Final = "Octopus Route"
_COMPRESSED: Final = (b"\x28\xb5\x2f\xfd", b"\x1f\x8b")
"""How files compressed with Zstandard and with gzip begin."""


AnySummary = Summary | ShotSummary


@dataclass(frozen=True)
class Performed:
    """What came of a shot."""

    summary: AnySummary
    armature: str
    libraries: tuple[str, ...]
    """Paths of the files that the scene is linked from, and of those that clips consist of."""
    motion: str
    """Digest of all keys."""
    action: str
    """Name of the armature's action."""


def perform(
    shot: ShotRequest,
    places: Mapping[Path, Path],
    note: Callable[[Performed], None] | None = None,
) -> Performed:
    """Make a shot and write each of its outputs to its place; ``note`` is called before that.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
        LimitError: the motion is not as good as it has to be; nothing has been written.
    """
    clips = Clips()
    takes_motion = shot.kind in {"splice", "retarget", "follow"}
    motion = shot.file if takes_motion and shot.file and is_motion(shot.file) else None
    if motion is not None:
        armature, clips = import_base(motion, shot.fps)
        compress, scene = False, armature.users_scene[0]
    else:
        compress, (armature, scene) = _open(shot), _find(shot)
    libraries = [bpy.path.abspath(each.filepath) for each in bpy.data.libraries]
    with _context(scene, armature):
        if bpy.context.mode.startswith("EDIT"):
            # So was the file saved; what is being edited is not to be keyed, nor exported.
            bpy.ops.object.mode_set(mode="OBJECT")
        if shot.fps is not None:
            scene.render.fps, scene.render.fps_base = frame_rate(shot.fps)
        for path in shot.export:
            check_export(path, armature, scene)
        if shot.kind == "splice":
            summary = splice(armature, shot, clips, motion)
        elif shot.kind == "retarget":
            summary = retarget(armature, shot)
        elif shot.kind == "follow":
            if motion is not None and not shot.base:
                clips.action(motion, "")
            summary = follow(armature, shot)
        elif shot.script is not None:
            summary = _pose(armature, scene, shot.script)
        else:
            _apply(shot, armature, scene)
            if locomotion_settings(armature).ground.stretch_as == "LOCATION":
                disconnect_arms(armature)
            summary = generate_locomotion(armature, bpy.context)
            check_limits(shot.limits, summary)
        if shot.octopus is not None or motion is not None:
            scene.frame_start, scene.frame_end = summary.frame_start, summary.frame_end
        told = [each for path in shot.export if (each := uncarried(path, armature))]
        summary = replace(summary, warnings=(*summary.warnings, *told))
        read = (*libraries, *(str(path) for path in clips.read))
        data = armature.animation_data
        action = data.action.name if data is not None and data.action is not None else ""
        performed = Performed(summary, armature.name, read, _motion(), action)
        if note is not None:
            note(performed)
        if shot.output is not None:
            _save(places[shot.output], compress=compress)
        # Whatever the exports need of the scene, the file has been saved before.
        for path in shot.export:
            export(places[path], armature, scene, summary.frame_start, summary.frame_end)
    return performed


def _motion() -> str:
    """Digest of all keys of the open file's own actions: their curves, frames, values, handles."""
    found = hashlib.sha256()
    for action in sorted(bpy.data.actions, key=lambda each: each.name):
        if action.library is None:
            for curve in curves_of(action):
                found.update(f"{action.name}\0{curve.data_path}\0{curve.array_index}\0".encode())
                for name in ("co", "handle_left", "handle_right"):
                    found.update(key_points(curve, name).tobytes())
    return found.hexdigest()


def _find(shot: ShotRequest) -> tuple[bpy.types.Object, bpy.types.Scene]:
    """The armature to move, and a scene that it is in."""
    scene = bpy.context.scene
    assert scene is not None
    if shot.octopus is not None:
        shape, with_mesh = shot.octopus.shape, shot.octopus.with_mesh
        return add_octopus(bpy.context, shape, Matrix(), with_skin=with_mesh), scene
    fits = {"generate": _has_arms, "splice": has_splices}.get(shot.kind, _is_posable)
    armature = find_armature(shot.armature, scene, fits)
    if armature.name in scene.objects:
        return armature, scene
    for other in bpy.data.scenes:
        if armature.name in other.objects:
            return armature, other
    raise RigError(f"'{armature.name}' is in no scene.", "Link it to a scene.")


def _open(shot: ShotRequest) -> bool:
    """Have the scene open; whether its file is compressed."""
    if shot.octopus is not None:
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        return False
    if shot.file is None:
        return _is_compressed(Path(bpy.data.filepath))
    if not shot.file.is_file():
        raise OctoMotionError(f"There is no file '{shot.file}'.", "Give the path of a .blend file.")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(shot.file), load_ui=False)
    except RuntimeError as error:
        raise OctoMotionError(
            f"'{shot.file}' cannot be opened: {blender_said(error)}", "Give a .blend file."
        ) from error
    return _is_compressed(shot.file)


def _is_compressed(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(4).startswith(_COMPRESSED)
    except OSError:
        return False


def find_armature(
    name: str, scene: bpy.types.Scene, fits: Callable[[bpy.types.Object], bool]
) -> bpy.types.Object:
    """The armature of that name, or the one that fits.

    Where several fit, the scene's active object decides. Linked armatures count only where there
    is no other: nothing could be written on them.

    Raises:
        RigError: there is none, or it is not clear which.
    """
    if name:
        armature = named(bpy.data.objects, name)
        if armature is None:
            raise RigError(f"There is no object '{name}'.", _choose(bpy.data.objects))
        if armature.type != "ARMATURE":
            raise RigError(f"'{name}' is not an armature.", _choose(bpy.data.objects))
        return armature
    every = [each for each in scene.objects if each.type == "ARMATURE"]
    armatures = [each for each in every if each.library is None] or every
    if not armatures:
        raise RigError(f"The scene '{scene.name}' has no armature.", "Give a file that has one.")
    fitting = [each for each in armatures if fits(each)]
    if len(fitting) == 1:
        return fitting[0]
    active = scene.view_layers[0].objects.active
    candidates = fitting or armatures
    if active in candidates:
        return active
    if len(candidates) == 1:
        return candidates[0]
    raise RigError(f"{len(candidates)} armatures could be meant.", _choose(candidates))


def _choose(objects: Any) -> str:
    names = sorted(each.name for each in objects if each.type == "ARMATURE")
    if not names:
        return "Give a file that has an armature."
    return f"Name the armature: {', '.join(names)}."


def _has_arms(armature: bpy.types.Object) -> bool:
    if len(locomotion_settings(armature).arms):
        return True
    world = world_matrix(armature)
    try:
        detect_arms(read_skeleton(armature), world[2, :3], -world[1, :3])
    except RigError:
        return False
    return True


def _context(scene: bpy.types.Scene, armature: bpy.types.Object) -> Any:
    """A context manager: Blender's context, with the scene and a view layer that has the armature.

    A command that Blender runs with a file has no window in its context, but exporters need one.
    """
    layers = list(scene.view_layers)
    layer = next((each for each in layers if armature.name in each.objects), layers[0])
    window_manager: Any = bpy.context.window_manager
    window = bpy.context.window or next(iter(window_manager.windows), None)
    given = {"window": window} if window else {}
    return bpy.context.temp_override(**given, scene=scene, view_layer=layer)


def _apply(shot: ShotRequest, armature: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """Write what the shot asks for into the armature's settings."""
    writable_armature(armature)
    settings: Any = locomotion_settings(armature)
    if shot.gait:
        set_gait(settings, gait_from_json(str(shot.gait)))
    set_values(settings, shot.settings)
    if shot.ground:
        settings.ground.object = _object(shot.ground, "MESH")
    if shot.changes is not None:
        _filled(settings.change, "places", shot.changes)
        if "change.by" not in shot.settings:
            settings.change.by = "MARKERS" if shot.changes else "NONE"
    if shot.along is not None:
        _filled(settings, "along", shot.along)
    if shot.reaches is not None:
        names = [each.get("target") for each in shot.reaches]
        targets = [_object(name) if name else None for name in names]
        pairs = zip(shot.reaches, targets, strict=True)
        _filled(settings, "reaches", [{**each, "target": target} for each, target in pairs])
    if shot.contacts is not None:
        _fill_contacts(shot.contacts, armature, settings)
    if isinstance(shot.route, NewRoute):
        settings.route = _draw(shot.route, scene)
    elif shot.route:
        settings.route = _object(shot.route, "CURVE", "Give a route by its points.")


def _fill_contacts(
    contacts: Sequence[Mapping[str, Any]], armature: bpy.types.Object, settings: Any
) -> None:
    names = [item.name for item in settings.arms]
    for each in contacts:
        if names and each["arm"] not in names:
            raise RigError(f"There is no arm '{each['arm']}'.", f"Name one of {', '.join(names)}.")
    # Those that are shown would count too.
    remove_markers(armature, once_called(settings.ground))
    settings.ground.shown = ""
    store(settings.ground, {})
    items = [{**each, "locked": "position" in each} for each in contacts]
    _filled(settings.ground, "contacts", items)


def _filled(settings: Any, name: str, items: Sequence[Mapping[str, Any]]) -> None:
    """Give a list these items alone.

    What a library override has from its linked file cannot be removed: a reach is muted, a contact
    says nothing any more, a place cannot be left out.
    """
    collection = getattr(settings, name)
    linked = linked_names(settings, name)
    if linked and name in {"places", "along"}:
        raise SettingsError(
            "Places of a linked file where the gait or a setting changes cannot be taken away.",
            "Leave changes and along out, or open the linked file itself.",
        )
    for number in reversed(range(len(collection))):
        if collection[number].name not in linked:
            collection.remove(number)
        elif name == "reaches":
            collection[number].mute = True
    for values in items:
        item = collection.add()
        for each, value in values.items():
            setattr(item, each, value)


def _object(
    name: str, kind: str = "", instead: str = "Give a file that has one."
) -> bpy.types.Object:
    """The object of that name and kind, of any without; ``instead`` helps where none is there."""
    fitting = [each for each in bpy.data.objects if kind in {"", each.type}]
    found = named(fitting, name)
    if found is not None:
        return found
    noun = kind.lower() or "object"
    other = named(bpy.data.objects, name)
    problem = f"'{name}' is not a {noun}." if other else f"There is no {noun} '{name}'."
    names = ", ".join(sorted({each.name for each in fitting}))
    raise SettingsError(problem, f"Name one of {names}." if names else instead)


def _draw(route: NewRoute, scene: bpy.types.Scene) -> bpy.types.Object:
    if not scene.is_editable:
        raise WriteError(f"The scene '{scene.name}' is linked.", "Name a curve as the route.")
    if route.is_bezier:
        return add_route_curve(_ROUTE_NAME, route.points, scene.collection)
    data = bpy.data.curves.new(_ROUTE_NAME, "CURVE")
    data.dimensions = "3D"
    spline = data.splines.new("BEZIER")
    spline.bezier_points.add(len(route.points) - 1)
    spline.use_cyclic_u = route.cyclic
    for point, place in zip(spline.bezier_points, route.points, strict=True):
        point.co = place
        point.handle_left_type = point.handle_right_type = "AUTO"
    curve = bpy.data.objects.new(_ROUTE_NAME, data)
    scene.collection.objects.link(curve)
    return curve


def _save(place: Path, *, compress: bool) -> None:
    # As a copy: the file that is open stays what it is. Paths in it that are relative are made so
    # for the new folder.
    try:
        bpy.ops.wm.save_as_mainfile(
            filepath=str(place),
            check_existing=False,
            compress=compress,
            relative_remap=True,
            copy=True,
        )
    except RuntimeError as error:
        raise WriteError(
            f"The file cannot be written: {blender_said(error)}", "Choose another place."
        ) from error


def _is_posable(armature: bpy.types.Object) -> bool:
    """Whether an armature could be meant: it has bones."""
    return isinstance(armature.data, bpy.types.Armature) and bool(len(armature.data.bones))


def _pose(armature: bpy.types.Object, scene: bpy.types.Scene, script: Path) -> ShotSummary:
    """Play a pose script on an armature; the context has its scene."""
    player = play_file(armature, scene, script)
    first, last = scene.frame_start, scene.frame_end
    message = f"played '{script.name}', {player.keys} bones keyed."
    return ShotSummary(message, last - first + 1, first, last)
