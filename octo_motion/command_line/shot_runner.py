# SPDX-License-Identifier: GPL-3.0-or-later
"""One shot in this Blender: open or make the scene, generate or splice, write."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import bpy
from mathutils import Matrix

from ..blender.animation import writable_armature
from ..blender.overrides import linked_names
from ..blender.rig import read_skeleton, world_matrix
from ..blender.scene import add_octopus, add_route_curve, remove_markers
from ..core.errors import OctoMotionError, RigError, RouteError, SettingsError, WriteError
from ..core.locomotion.gait import gait_from_json
from ..core.locomotion.rig import detect_arms
from ..ui.locomotion.generate_motion import generate
from ..ui.locomotion.settings.contact_overrides import once_called, store
from ..ui.locomotion.settings.properties import locomotion_settings, set_gait
from ..ui.locomotion.writing import Summary
from . import pose_runner as pose_stage
from . import splice_runner as splice_stage
from .exports import check_export, export
from .motion_files import is_motion
from .operator_errors import blender_said
from .quality_limits import check_limits
from .shot_request import NewRoute, ShotEntry, frame_rate

_ROUTE_NAME: Final = "Octopus Route"
_COMPRESSED: Final = (b"\x28\xb5\x2f\xfd", b"\x1f\x8b")
"""How files compressed with Zstandard and with gzip begin."""


AnySummary = Summary | splice_stage.SpliceSummary | pose_stage.PoseSummary


@dataclass(frozen=True)
class Performed:
    """What came of a shot."""

    summary: AnySummary
    armature: str
    libraries: tuple[str, ...]
    """Paths of the files that the scene is linked from, and of those that clips consist of."""


def perform(entry: ShotEntry, places: Mapping[Path, Path]) -> Performed:
    """Make a shot and write its outputs.

    Args:
        entry: the shot.
        places: where each of its outputs is to be written.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
        LimitError: the motion is not as good as it has to be; nothing has been written.
    """
    clips = splice_stage.Clips()
    motion = entry.file if entry.splicing and entry.file and is_motion(entry.file) else None
    if motion is not None:
        armature, clips = splice_stage.import_base(motion, entry.fps)
        compress, scene = False, armature.users_scene[0]
    else:
        compress, (armature, scene) = _open(entry), _find(entry)
    libraries = [bpy.path.abspath(each.filepath) for each in bpy.data.libraries]
    with _context(scene, armature):
        if bpy.context.mode.startswith("EDIT"):
            # So was the file saved; what is being edited is not to be keyed, nor exported.
            bpy.ops.object.mode_set(mode="OBJECT")
        if entry.fps is not None:
            scene.render.fps, scene.render.fps_base = frame_rate(entry.fps)
        for path in entry.exports:
            check_export(path, armature, scene)
        if entry.splicing is not None:
            work = (entry.splicing, entry.settings)
            summary = splice_stage.splice(armature, *work, clips, motion)
        elif entry.posing is not None:
            summary = pose_stage.pose(armature, scene, entry.posing)
        else:
            _apply(entry, armature, scene)
            summary = generate(armature, bpy.context)
            check_limits(entry.limits, summary)
        if entry.octopus is not None or motion is not None:
            scene.frame_start, scene.frame_end = summary.frame_start, summary.frame_end
        if entry.output is not None:
            _save(places[entry.output], compress=compress)
        # Whatever the exports need of the scene, the file has been saved before.
        for path in entry.exports:
            export(places[path], armature, scene, summary.frame_start, summary.frame_end)
    libraries += [str(path) for path in clips.read]
    return Performed(summary, armature.name, tuple(libraries))


def _find(entry: ShotEntry) -> tuple[bpy.types.Object, bpy.types.Scene]:
    """The armature to move, and a scene that it is in."""
    scene = bpy.context.scene
    assert scene is not None
    if entry.octopus is not None:
        armature = add_octopus(
            bpy.context, entry.octopus.shape, Matrix(), with_skin=entry.octopus.with_mesh
        )
        return armature, scene
    fits = splice_stage.has_splices if entry.splicing else _has_arms
    if entry.posing is not None:
        fits = pose_stage.is_posable
    armature = find_armature(entry.armature, scene, fits)
    return armature, _scene_of(armature, scene)


def _open(entry: ShotEntry) -> bool:
    """Have the scene open; whether its file is compressed."""
    if entry.octopus is not None:
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        return False
    if entry.file is None:
        return _is_compressed(Path(bpy.data.filepath))
    if not entry.file.is_file():
        raise OctoMotionError(
            f"There is no file '{entry.file}'.", "Give the path of a .blend file."
        )
    try:
        bpy.ops.wm.open_mainfile(filepath=str(entry.file), load_ui=False)
    except RuntimeError as error:
        raise OctoMotionError(
            f"'{entry.file}' cannot be opened: {blender_said(error)}", "Give a .blend file."
        ) from error
    return _is_compressed(entry.file)


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
        found = [each for each in bpy.data.objects if each.name == name]
        if not found:
            raise RigError(f"There is no object '{name}'.", _choose(bpy.data.objects))
        local = [each for each in found if each.library is None]
        return _checked((local or found)[0])
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


def _checked(armature: bpy.types.Object) -> bpy.types.Object:
    if armature.type != "ARMATURE":
        raise RigError(f"'{armature.name}' is not an armature.", _choose(bpy.data.objects))
    return armature


def _has_arms(armature: bpy.types.Object) -> bool:
    if len(locomotion_settings(armature).arms):
        return True
    world = world_matrix(armature)
    try:
        detect_arms(read_skeleton(armature), world[2, :3], -world[1, :3])
    except RigError:
        return False
    return True


def _scene_of(armature: bpy.types.Object, scene: bpy.types.Scene) -> bpy.types.Scene:
    """The scene given if the armature is in it, else the first that has it."""
    if armature.name in scene.objects:
        return scene
    for other in bpy.data.scenes:
        if armature.name in other.objects:
            return other
    raise RigError(f"'{armature.name}' is in no scene.", "Link it to a scene.")


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


def _apply(entry: ShotEntry, armature: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """Write what the shot asks for into the armature's settings."""
    writable_armature(armature)
    settings: Any = locomotion_settings(armature)
    if entry.gait:
        set_gait(settings, gait_from_json(entry.gait))
    for name, value in entry.settings.items():
        *groups, last = name.split(".")
        group = settings
        for each in groups:
            group = getattr(group, each)
        setattr(group, last, value)
    if entry.ground:
        settings.ground.object = _object(entry.ground, "MESH", "a mesh")
    _fill_lists(entry, armature, settings)
    if isinstance(entry.route, NewRoute):
        settings.route = _draw(entry.route, scene)
    elif entry.route:
        settings.route = _curve(entry.route)


def _fill_lists(entry: ShotEntry, armature: bpy.types.Object, settings: Any) -> None:
    """Give the armature the lists of the shot, in place of its own."""
    lists = entry.lists
    if "changes" in lists:
        _filled(settings.change, "places", lists["changes"])
        if "change.by" not in entry.settings:
            settings.change.by = "MARKERS" if lists["changes"] else "NONE"
    if "reaches" in lists:
        objects = [each.get("target") for each in lists["reaches"]]
        found = [_object(name) if name else None for name in objects]
        rest = [{**each, "target": None} for each in lists["reaches"]]
        _filled(settings, "reaches", rest)
        for item, target in zip(list(settings.reaches)[-len(rest) :], found, strict=False):
            item.target = target
    if "contacts" in lists:
        names = [item.name for item in settings.arms]
        for each in lists["contacts"]:
            if names and each["arm"] not in names:
                raise RigError(
                    f"There is no arm '{each['arm']}'.", f"Name one of {', '.join(names)}."
                )
        # Those that are shown would count too.
        remove_markers(armature, once_called(settings.ground))
        settings.ground.shown = ""
        items = [{**each, "locked": "position" in each} for each in lists["contacts"]]
        store(settings.ground, {})
        _filled(settings.ground, "contacts", items)


def _filled(settings: Any, name: str, items: Sequence[Mapping[str, Any]]) -> None:
    """Give a list these items alone.

    What a library override has from its linked file cannot be removed: a reach is muted, a contact
    says nothing any more.

    Raises:
        SettingsError: it can neither be removed nor left out.
    """
    collection = getattr(settings, name)
    linked = linked_names(settings, name)
    if linked and name == "places":
        raise SettingsError(
            "Places of a linked file where the gait changes cannot be taken away.",
            "Leave changes out, or open the linked file itself.",
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


def _object(name: str, kind: str = "", what: str = "") -> bpy.types.Object:
    """The object of that name.

    Raises:
        SettingsError: there is none, or it is of another kind.
    """
    found = [each for each in bpy.data.objects if each.name == name]
    fitting = [each for each in found if kind in {"", each.type}]
    if fitting:
        return fitting[0]
    names = sorted({each.name for each in bpy.data.objects if kind in {"", each.type}})
    remedy = f"Name one of {', '.join(names)}." if names else "Give a file that has one."
    problem = f"'{name}' is not {what}." if found else f"There is no object '{name}'."
    raise SettingsError(problem, remedy)


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


def _curve(name: str) -> bpy.types.Object:
    found = [each for each in bpy.data.objects if each.name == name]
    curves = [each for each in found if each.type == "CURVE"]
    if curves:
        return curves[0]
    problem = f"'{name}' is not a curve." if found else f"There is no curve '{name}'."
    names = sorted(each.name for each in bpy.data.objects if each.type == "CURVE")
    raise RouteError(
        problem, f"Name one of {', '.join(names)}." if names else "Give a route by its points."
    )


def _save(place: Path, *, compress: bool) -> None:
    # As a copy: the file that is open stays what it is. Paths in it that are relative are made so
    # for the new folder.
    _run(
        lambda: bpy.ops.wm.save_as_mainfile(
            filepath=str(place),
            check_existing=False,
            compress=compress,
            relative_remap=True,
            copy=True,
        ),
        "The file",
    )


def _run(operator: Callable[[], Any], what: str) -> None:
    try:
        operator()
    except RuntimeError as error:
        raise WriteError(
            f"{what} cannot be written: {blender_said(error)}", "Choose another place."
        ) from error
