# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion made: by the button, or live, by itself.

Live, whoever drags a point of the route or a slider sees the motion follow. Blender tells after
each update what has changed. If that is something that a motion was made from, a timer shows the
frame in sight as it is going to be, outside the update; what changes in the meantime waits for the
same turn. Once nothing has changed for a while, the motion is made anew in place, in short turns
between which Blender goes on. Only an action that was generated and that nobody has edited is
touched. What our own writing changes is let through Blender's update before we listen again. Where
nothing is live, Blender is not kept waiting: thousands of objects may move with each frame.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any, Final, cast

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ....blender.animation import belongs_to, is_edited
from ....blender.rig import active_armature, deformed_meshes, read_skeleton
from ....core.content_cache import clear_caches, content_key
from ....core.errors import OctoMotionError, RigError
from ....core.locomotion.motion import MotionResult, Sketch
from ....core.phrases import phrase
from ...declared_settings import assign, plain
from ...language import reported, translated
from ...modal_job import Job, ModalJob
from ...operator_base import ArmatureOperator
from ...overlay_lines import Lines, draw_lines
from ..reading import playing_action, previous_action
from ..settings import (
    SWITCHED,
    OCTO_MOTION_PG_locomotion,
    locomotion_settings,
    once_called,
    read_overrides,
)
from ..writing import RESULTS, Before, Following, Shot, Summary, make, prepare

PATIENCE: Final = 1.5
"""Seconds that the window may stand still; a longer job shows its progress and can be stopped."""


class OCTO_MOTION_OT_generate_locomotion(ModalJob, ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.generate_locomotion"
    bl_label = "Generate Locomotion"
    bl_description = (
        "Let the armature walk or swim along its route, and all others that are selected and have "
        "one. What was generated before is made anew in place; an action that you have edited is "
        "kept, and a new one is made"
    )

    _shots: Sequence[Shot] = ()

    def run(self, context: bpy.types.Context) -> None:
        self._shots = _prepared(context)
        for _ in make(self._shots):
            pass
        self.conclude(context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:  # noqa: ARG002
        """Run at once if that is quick, else go on with progress and Esc."""
        try:
            self._shots = _prepared(context)
        except OctoMotionError as error:
            self.report({"ERROR"}, reported(error))
            return {"CANCELLED"}
        return self.begin(context, make(self._shots), PATIENCE)

    def conclude(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        # Blender's status bar keeps the last: that of the active armature.
        for shot in reversed(self._shots):
            assert shot.summary is not None
            self._tell(shot.summary)
            made(bpy.data.objects[shot.armature, None], shot.result)  # type: ignore[index]

    def give_up(self, context: bpy.types.Context) -> set[Any]:
        """Change nothing; motions that are there and only being measured stay."""
        if any(shot.summary is None for shot in self._shots):
            return ModalJob.give_up(self, context)
        self._finish(context)
        self.report({"WARNING"}, "Not measured as it plays: Quality is that of its keys alone.")
        return {"FINISHED"}

    def status(self, progress: float) -> str:
        return phrase(
            "Generating locomotion: {progress:.0f} %    Esc: stop", progress=100.0 * progress
        )

    def _tell(self, summary: Summary) -> None:
        self.report({"INFO"}, reported(summary.message))
        # Blender's status bar keeps the last, which is to be the one that says most.
        for warning in reversed(summary.warnings):
            self.report({"WARNING"}, reported(warning))


def _prepared(context: bpy.types.Context) -> list[Shot]:
    """All that move, each with a seed of its own: a copy is not to breathe with its original.

    The first that has a seed keeps it. Those of others are changed when their motion is written.
    """
    shots: list[Shot] = []
    for each in _meant(context):
        settings = locomotion_settings(each)
        before, taken = settings.seed, {shot.seed for shot in shots}
        own = next(seed for seed in count(before) if seed not in taken)
        assign(settings, "seed", own)
        try:
            shot = prepare(each, context)
        finally:
            assign(settings, "seed", before)
        shot.seed = own
        shots.append(shot)
    return shots


def _meant(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The active armature, then all others that are selected and could move as well."""
    active = active_armature(context)
    return [active, *(each for each in context.selected_objects if each != active and _goes(each))]


def _goes(item: bpy.types.Object) -> bool:
    # Settings come into being when they are looked at: what has none is left without.
    if item.type != "ARMATURE" or not item.is_editable or not item.is_property_set("octo_motion"):
        return False
    settings = locomotion_settings(item)
    return settings.route is not None or settings.travel_on == "NONE"


# --- What is known while a motion is live ---------------------------------------------------------


_SOON: Final = 0.0
"""Seconds from a change to the frame in sight at least: what changes together is told together."""
_IDLE: Final = 0.1
"""Seconds without a change after which all other frames follow …"""
_TURN: Final = 0.004
"""… and for how long at a time, before a step of the work that has begun is let end: it takes about
as long again."""
_LATER: Final = 0.3
"""Seconds until it is tried again, while Blender renders or a tool of ours runs."""
_NO_MATTER: Final = RESULTS | {
    *(
        "contacts",
        "active_arm",
        "active_reach",
        "active_curve",
        "active_change",
        "shown_angle",
        "active_along",
    ),
    *("keys", "key_angle", "key_distance", "key_columns", "tell_overlaps"),
}
"""Settings that the motion does not depend on while it is live; contacts are looked at otherwise.
"""


@dataclass
class _Work:
    """A motion on its way."""

    motion: Following | None
    """None while it is made as Generate does."""
    job: Job
    lines: Lines = field(default_factory=list)
    """Where it leads, to be drawn until it is there."""
    known: bool = False
    """Whether it is worked out, and on its way to the action."""


@dataclass
class _State:
    """What is known between two updates."""

    seen: dict[str, str | None] = field(default_factory=dict)
    """What each live armature's motion was made from, by the object's name."""
    changed: dict[str, bool] = field(default_factory=dict)
    """Armatures to look at, and whether it is known already that they changed."""
    known: dict[str, Shot] = field(default_factory=dict)
    """What was read of armatures …"""
    rigs: dict[str, str] = field(default_factory=dict)
    """… when this was so of their rigs …"""
    touched: dict[str, set[str]] = field(default_factory=dict)
    """… and what of it may have changed since: "RIG", "GROUND" or "ELSE", which is not the route.
    """
    following: dict[str, _Work] = field(default_factory=dict)
    """Motions of which no more than the frame in sight is there, by the armature's name."""
    sketches: dict[str, Sketch] = field(default_factory=dict)
    """What the frame in sight is drawn from until a motion is planned, by the armature's name."""
    rates: dict[str, float] = field(default_factory=dict)
    """Frames per second of each scene."""
    complete: bool = False
    """Whether all live armatures of the file are among those seen."""
    busy: bool = False

    def clear(self) -> None:
        vars(self).update(vars(_State()))


_state: Final = _State()


_drawing: Final[list[Any]] = []
"""Blender's handle of what draws."""


def _draw() -> None:
    """Draw where motions lead that are on their way."""
    space: Any = bpy.context.space_data
    if _state.following and space is not None and space.overlay.show_overlays:
        draw_lines([line for work in _state.following.values() for line in work.lines])


def listen() -> None:
    """Listen to Blender."""
    for handlers, function in _handlers():
        handlers.append(function)
    _drawing.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW"))


def listen_no_more() -> None:
    """Listen no more, and drop what was about to be made."""
    while _drawing:
        bpy.types.SpaceView3D.draw_handler_remove(_drawing.pop(), "WINDOW")
    for name in list(_state.following):
        _let_go(_armature(name), name)
    _drop()
    _state.clear()
    clear_caches()
    for handlers, function in _handlers():
        if function in handlers:
            handlers.remove(function)


def _handlers() -> list[tuple[Any, Any]]:
    known = bpy.app.handlers
    return [
        (known.depsgraph_update_post, _after_update),
        (known.frame_change_post, _after_frame),
        (known.undo_pre, _before_undo),
        (known.redo_pre, _before_undo),
        (known.undo_post, _after_undo),
        (known.redo_post, _after_undo),
        (known.save_pre, _before_saving),
        (known.load_pre, _before_loading),
        (known.load_post, _after_loading),
        (known.blend_import_post, _after_import),
    ]


def made(armature: bpy.types.Object, result: MotionResult | None) -> None:
    """Tell that an armature's motion has just been made from its settings as they are."""
    settings = locomotion_settings(armature)
    if settings.live:
        _state.seen[armature.name] = _made_from(armature, settings)
        if result is not None:
            _state.sketches[armature.name] = Sketch(result.known)
    _state.following.pop(armature.name, None)
    assign(settings, "live_error", "")


def pending() -> bool:
    """Whether the frame in sight is about to be made."""
    return bpy.app.timers.is_registered(run_pending)


def run_pending() -> float | None:
    """What the timer does: show the frame in sight of motions whose sources have changed.

    Returns seconds until it has to be called again, none if all is done.
    """
    if _state.busy or _others_at_work():
        return _LATER
    changed = dict(_state.changed)
    _state.changed.clear()
    for name, certain in changed.items():
        _follow(name, certain=certain)
    # From the last change on, not from the first.
    _stop(run_following)
    if _state.following:
        bpy.app.timers.register(run_following, first_interval=0.0 if _plays() else _IDLE)
    return None


def run_following() -> float | None:
    """What another timer does: all other frames, in short turns.

    Returns seconds until it has to be called again, none if all is done.
    """
    if _state.busy or _others_at_work():
        return _LATER
    if not pending():
        for name in list(_state.following)[:1]:
            _go_on(name, _TURN)
    return 0.0 if _state.following else None


def finish_following() -> None:
    """Make all motions that are on their way at once."""
    if pending():
        _stop(run_pending)
        run_pending()
    _stop(run_following)
    while _state.following:
        _go_on(next(iter(_state.following)), np.inf)


# --- What Blender tells --------------------------------------------------------------------------


@persistent
def _after_update(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if _state.busy or depsgraph.mode != "VIEWPORT" or not _listens():
        return
    touched = _touched(depsgraph)
    for each in touched:
        if isinstance(each, bpy.types.Object) and each.type == "ARMATURE":
            _look_at(each)
    rate = _rate(scene)
    another_rate = rate != _state.rates.get(scene.name, rate)
    _state.rates[scene.name] = rate
    marked = {_marked(each) for each in touched if isinstance(each, bpy.types.Object)}
    meshes = {each for each in touched if isinstance(each, bpy.types.Mesh)}
    for name in list(_state.seen):
        armature = _armature(name)
        if armature is None:
            del _state.seen[name]
        elif (
            (another_rate and name in scene.objects)
            or not touched.isdisjoint(_sources(armature))
            or _is_skin(armature, meshes)
        ):
            _soon(name, certain=True, touched=_changed(armature, touched, meshes))
        elif marked & {name, once_called(locomotion_settings(armature).ground)} - {""}:
            _soon(name, certain=False, touched={"ELSE"})


@persistent
def _after_frame(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """A change that comes together with another frame, as while it plays, is told here alone."""
    if _state.busy or depsgraph.mode != "VIEWPORT" or not _listens():
        return
    _show_again(scene)
    followed = [each for name in _state.seen if (each := _armature(name)) is not None]
    sources = [_sources(each) for each in followed]
    touched = _touched(depsgraph, set(followed).union(*sources))
    still = {each for each in touched if not _is_animated(each)}
    for armature, its in zip(followed, sources, strict=True):
        if armature in touched and not pending():
            # It moves with every frame: now and then is enough to see whether it is set anew.
            _soon(armature.name, certain=False, wait=_LATER)
        if not still.isdisjoint(its):
            _soon(armature.name, certain=True)


def _show_again(scene: bpy.types.Scene) -> None:
    """Show motions that are on their way as they are going to be at another frame, too."""
    if not _state.following or _plays():
        return
    _state.busy = True
    try:
        for name, work in _state.following.items():
            armature = _armature(name)
            if armature is not None and work.motion is not None and name in scene.objects:
                # What is wrong is told when all of it is worked out.
                with suppress(OctoMotionError):
                    work.motion.show(armature, scene.frame_current_final)
    finally:
        _state.busy = False


def _listens() -> bool:
    """Whether any armature is live; all that are so are known then."""
    if not _state.complete or not all(map(_armature, _state.seen)):
        # The add-on was switched on, a file was appended, an armature was renamed.
        for each in _live_armatures():
            if each.name not in _state.seen:
                _state.seen[each.name] = _made_from(each, locomotion_settings(each))
        _state.rates = {each.name: _rate(each) for each in bpy.data.scenes}
        _state.complete = True
    while SWITCHED:
        armature = _armature(SWITCHED.pop())
        if armature is not None:
            _look_at(armature)
    return bool(_state.seen)


def _rate(scene: bpy.types.Scene) -> float:
    return scene.render.fps / scene.render.fps_base


def _touched(
    depsgraph: bpy.types.Depsgraph, among: set[bpy.types.ID] | None = None
) -> set[bpy.types.ID]:
    """What has changed, of all or some, so that something may move; a selection, for one, moves
    nothing.
    """
    found: set[bpy.types.ID] = set()
    for update in depsgraph.updates:
        each = cast("bpy.types.ID", update.id.original)  # type: ignore[union-attr]
        if among is not None and each not in among:
            continue
        if (
            not isinstance(each, bpy.types.Object)
            or update.is_updated_geometry
            or update.is_updated_transform
        ):
            found.add(each)
    return found


def _is_animated(each: bpy.types.ID) -> bool:
    """Whether another frame may move it by itself."""
    item: Any = each
    while item is not None:
        data = getattr(item, "data", item)
        parts = (item, data, getattr(data, "shape_keys", None))
        if any(getattr(part, "animation_data", None) is not None for part in parts):
            return True
        if isinstance(item, bpy.types.Object) and (item.constraints or item.modifiers):
            return True
        item = getattr(item, "parent", None)
    return False


def _look_at(armature: bpy.types.Object) -> None:
    """Begin or cease to follow an armature, or see whether its settings have changed."""
    name = armature.name
    if not _is_live(armature):
        for known in (_state.seen, _state.changed):
            known.pop(name, None)
    elif name in _state.seen:
        # What of its rig has changed is looked at itself.
        _soon(name, certain=False, touched={"ELSE"})
    else:
        _state.seen[name] = None
        _soon(name, certain=True)


def _is_live(armature: bpy.types.Object) -> bool:
    # Settings come into being when they are looked at: what has none is left without.
    return (
        armature.library is None
        and armature.is_property_set("octo_motion")
        and locomotion_settings(armature).live
    )


def _marked(item: bpy.types.Object) -> str:
    """Name of the armature whose contact an object marks."""
    if item.type != "EMPTY" or not item.is_property_set("octo_motion"):
        return ""
    return item.octo_motion.contact.armature  # type: ignore[attr-defined]


def _sources(armature: bpy.types.Object) -> set[bpy.types.ID]:
    """Data-blocks that a motion is made from, but for its armature object."""
    settings = locomotion_settings(armature)
    roots: list[bpy.types.Object | None] = [
        *(settings.route, settings.ground.object, armature.parent, settings.body.look_at),
        # What is carried gets keys from us.
        *(each.target for each in settings.reaches if not each.carry),
    ]
    found: set[bpy.types.ID] = set().union(*(_with_parents(root, armature) for root in roots))
    # Blender tags the armature's data with every pose: its bones are looked at themselves.
    return found | ({settings.weight_curve} - {None})


def _with_parents(
    root: bpy.types.Object | None, until: bpy.types.Object | None = None
) -> set[bpy.types.ID]:
    """An object, those that carry it up to another one, and their data."""
    found: set[bpy.types.ID] = set()
    each = root
    while each is not None and each != until:
        found.add(each)
        if each.data is not None:
            found.add(each.data)
        each = each.parent
    return found


def _route_of(armature: bpy.types.Object) -> set[bpy.types.ID]:
    """Data-blocks that are a motion's route and nothing else of it."""
    settings = locomotion_settings(armature)
    route, own = settings.route, {settings.ground.object, settings.body.look_at, armature.parent}
    return {route, route.data} - own if route is not None and route not in own else set()


def _changed(
    armature: bpy.types.Object, touched: set[bpy.types.ID], meshes: set[bpy.types.Mesh]
) -> set[str]:
    """What of a motion these are that have changed, besides its route."""
    ground = locomotion_settings(armature).ground.object
    its = _with_parents(ground) if ground is not None else set[bpy.types.ID]()
    found = {"GROUND"} if touched & its else set[str]()
    if _is_skin(armature, meshes) or touched & _with_parents(armature.parent):
        found.add("RIG")
    if touched & (_sources(armature) - its - _route_of(armature)) or not touched & _route_of(
        armature
    ):
        found.add("ELSE")
    return found


def _is_skin(armature: bpy.types.Object, meshes: set[bpy.types.Mesh]) -> bool:
    """Whether the armature deforms any of these."""
    return bool(meshes) and any(each.data in meshes for each in deformed_meshes(armature))


@persistent
def _before_undo(*_: object) -> None:
    _drop()


@persistent
def _after_undo(*_: object) -> None:
    """A step may have been made between a change and the motion that follows from it."""
    # Motions are nearly what they were.
    sketches = _state.sketches
    _state.clear()
    _state.sketches.update(sketches)
    for armature in _live_armatures():
        _state.seen[armature.name] = None
        _soon(armature.name, certain=True)
    _state.complete = True


@persistent
def _before_saving(*_: object) -> None:
    """What is saved belongs together, route and motion."""
    if not (_state.busy or _others_at_work()):
        finish_following()
    for work in _state.following.values():
        if work.known and work.motion is not None:
            work.motion.take_back()
            work.job, work.known = Job(iter(())), False


@persistent
def _before_loading(*_: object) -> None:
    _drop()
    _state.clear()
    clear_caches()


@persistent
def _after_loading(*_: object) -> None:
    _listens()


@persistent
def _after_import(*_: object) -> None:
    _state.complete = False


def _live_armatures() -> list[bpy.types.Object]:
    return [each for each in bpy.data.objects if each.type == "ARMATURE" and _is_live(each)]


# --- The motion ----------------------------------------------------------------------------------


_ANYTHING: Final = frozenset({"RIG", "GROUND", "ELSE"})


def _soon(
    name: str, *, certain: bool, wait: float = _SOON, touched: Collection[str] = _ANYTHING
) -> None:
    _state.touched.setdefault(name, set()).update(touched)
    _state.changed[name] = certain or _state.changed.get(name, False)
    if not pending():
        bpy.app.timers.register(run_pending, first_interval=wait)


def _drop() -> None:
    for known in (_state.changed, _state.known, _state.touched, _state.following):
        known.clear()
    _stop(run_pending)
    _stop(run_following)


def _stop(timer: Callable[[], float | None]) -> None:
    if bpy.app.timers.is_registered(timer):
        bpy.app.timers.unregister(timer)


def _plays() -> bool:
    """Whether any window plays: each frame then shows what the action says."""
    manager = bpy.context.window_manager
    return manager is not None and any(
        each.screen is not None and each.screen.is_animation_playing for each in manager.windows
    )


def _others_at_work() -> bool:
    """Whether Blender renders, or a modal tool of ours has the screen."""
    if bpy.app.is_job_running("RENDER"):
        return True
    manager = bpy.context.window_manager
    return manager is not None and any(
        operator.bl_idname.startswith("OCTO_MOTION_OT_")
        for window in manager.windows
        for operator in window.modal_operators
        # Of one whose add-on was switched off meanwhile nothing is left.
        if operator is not None
    )


def _armature(name: str) -> bpy.types.Object | None:
    found = bpy.data.objects.get((name, None))
    return found if found is not None and found.type == "ARMATURE" else None


def _follow(name: str, *, certain: bool) -> None:
    """Make an armature's motion anew, if it is not what it is made from says already."""
    armature = _armature(name)
    settings = locomotion_settings(armature) if armature is not None else None
    if armature is None or settings is None or not settings.live:
        _state.seen.pop(name, None)
        return
    if armature.mode == "EDIT" or not _within_scene(armature):
        # Leaving edit mode is a change of its own.
        return
    now, rig = _read_from(armature, settings)
    if _state.seen.get(name) != now:
        _state.touched.setdefault(name, set()).add("ELSE")
    elif not certain:
        return
    if _state.rigs.get(name) != rig:
        _state.touched.setdefault(name, set()).update(_ANYTHING)
        _state.rigs[name] = rig
    with _telling(armature, settings), _deaf(), _window_of(armature):
        _make(armature, settings)
    if settings.live:
        _state.seen[name] = now


@contextmanager
def _telling(armature: bpy.types.Object, settings: OCTO_MOTION_PG_locomotion) -> Iterator[None]:
    """Tell in the panel what goes wrong within; the motion stays as it was."""
    try:
        yield
    except OctoMotionError as error:
        _let_go(armature)
        settings.live_error = translated(error)
    except BaseException:
        _let_go(armature)
        settings.live = False
        settings.live_error = translated("Live has stopped at a fault: the console tells which.")
        raise


def _make(armature: bpy.types.Object, settings: OCTO_MOTION_PG_locomotion) -> None:
    """Show the frame in sight, and let the others follow."""
    name, before = armature.name, None
    earlier, known = _state.following.get(name), _state.known.pop(name, None)
    touched = _state.touched.pop(name, set())
    if known is not None:
        before = Before(
            known,
            rig="RIG" not in touched and not settings.keep_pose,
            ground="GROUND" not in touched,
            all_else=not touched,
        )
    shown = earlier.motion if earlier is not None else None
    motion = Following(armature, bpy.context, shown, before, _state.sketches.get(name))
    _state.known[name] = replace(motion.shot)
    _state.following[armature.name] = _Work(motion, Job(motion.steps()), motion.lines())
    # Whose action it is that another frame shows again is looked at before it is written.
    scene = bpy.context.scene
    if scene is not None and _generated(armature, settings):
        motion.show(armature, scene.frame_current_final)
    _note_sketch(armature, motion)
    assign(settings, "live_error", "")


def _note_sketch(armature: bpy.types.Object, motion: Following) -> None:
    if motion.sketch is not None:
        _state.sketches[armature.name] = motion.sketch


def _go_on(name: str, seconds: float) -> None:
    """Work for so long on a motion that is on its way, and write it when it is there."""
    armature, work = _armature(name), _state.following[name]
    settings = locomotion_settings(armature) if armature is not None else None
    if armature is None or settings is None or not settings.live:
        _let_go(armature, name)
        return
    with _telling(armature, settings), _window_of(armature):
        there, motion = work.job.work(seconds), work.motion
        if motion is not None and motion.has_news:
            with _deaf():
                motion.tell(armature)
            work.lines = motion.lines()
            _note_sketch(armature, motion)
        if there and _is_written(armature, settings, work):
            with _deaf():
                _write(armature, settings, motion)


def _is_written(
    armature: bpy.types.Object, settings: OCTO_MOTION_PG_locomotion, work: _Work
) -> bool:
    """Whether all is there of a motion but what has to be written at once; if not, the action gets
    what is to come before that, unless it is an artist's.
    """
    motion = work.motion
    if motion is None or work.known:
        return True
    if kept := _whose(armature, settings, edited=motion.edited):
        settings.live = False
        settings.live_error = translated(kept)
        _state.seen.pop(armature.name, None)
        _let_go(armature)
        return False
    # While it plays, frames are shown as the action has them.
    work.known = True
    work.job = Job(iter(()) if _plays() else motion.filling(armature))
    return False


def _write(
    armature: bpy.types.Object,
    settings: OCTO_MOTION_PG_locomotion,
    motion: Following | None,
) -> None:
    """Write a motion that was worked out; where Generate makes other keys of it, these follow."""
    if motion is None:
        del _state.following[armature.name]
        return
    if motion.shot.rig.detection is not None:
        # What was found is what is set from now on.
        _state.known.pop(armature.name, None)
    motion.write()
    _note_sketch(armature, motion)
    # Markers of contacts are where the motion has them now.
    _state.seen[armature.name] = _made_from(armature, settings)
    if motion.exact:
        del _state.following[armature.name]
    else:
        _state.following[armature.name] = _Work(None, Job(_exactly(armature)))


def _exactly(armature: bpy.types.Object) -> Iterator[float]:
    """What Generate does."""
    shot = prepare(armature, bpy.context)
    yield 0.0
    yield from shot.compute(brief=True)
    if not _whose(armature, locomotion_settings(armature)):
        with _deaf():
            shot.write(unedited=True)


def _let_go(armature: bpy.types.Object | None, name: str = "") -> None:
    """Leave a motion that was on its way, and show what is there."""
    work = _state.following.pop(armature.name if armature is not None else name, None)
    if work is not None and work.motion is not None and armature is not None:
        with _deaf():
            work.motion.give_back(armature)


def _generated(armature: bpy.types.Object, settings: OCTO_MOTION_PG_locomotion) -> bool:
    """Whether the armature plays what was generated, or nothing."""
    playing = playing_action(armature)
    return playing is None or playing == previous_action(armature, settings)


def _whose(
    armature: bpy.types.Object,
    settings: OCTO_MOTION_PG_locomotion,
    *,
    edited: bool | None = None,
) -> str:
    """Why the armature's action must be left alone, "" if it is ours; whether somebody has edited
    it may be known already.
    """
    previous, playing = previous_action(armature, settings), playing_action(armature)
    if playing is not None and playing != previous:
        return phrase("Live is off: '{playing}' is not what was generated.", playing=playing.name)
    if previous is None:
        return ""
    edited = is_edited(previous) if edited is None else edited
    if not edited and belongs_to(previous, armature):
        return ""
    if edited:
        return phrase("Live is off: '{previous}' was edited and is yours.", previous=previous.name)
    return phrase("Live is off: '{previous}' has other users too.", previous=previous.name)


def _made_from(armature: bpy.types.Object, settings: OCTO_MOTION_PG_locomotion) -> str:
    """All that a motion is made from and that belongs to the armature object itself, as text."""
    return _read_from(armature, settings)[0]


_OF_RIG: Final = frozenset(
    {
        *("arms", "root_bone", "body_up", "body_front", "keep_pose", "travel_on", "keep_apart"),
        *("mantle_bone", "siphon_bone", "eye_left", "eye_right", "trail"),
        *("use", "object", "stretch_as", "gait"),
    }
)
"""Settings that hang on the rig and on the ground, of the motion, its body or its ground."""


def _read_from(armature: bpy.types.Object, settings: OCTO_MOTION_PG_locomotion) -> tuple[str, str]:
    """All that a motion is made from and that belongs to the armature object itself, as text, and
    of that what is its rig.
    """
    wishes = [
        (place, each.removed, each.shift, each.heading, np.asarray(each.position).tolist())
        for place, each in sorted(read_overrides(settings.ground, armature).items())
    ]
    bones = armature.pose.bones if armature.pose is not None else ()
    try:
        rest = content_key(read_skeleton(armature)).hex()
    except RigError:
        # Generating says what is wrong with it.
        rest = ""
    # Where it travels itself, its place is what the motion makes of it.
    travels = settings.travel_on == "OBJECT"
    place = armature.scale if travels else [value for row in armature.matrix_world for value in row]
    asked = plain(settings, without=_NO_MATTER)
    hangs = [*armature.delta_location, *armature.delta_rotation_euler]
    hangs += [*armature.delta_rotation_quaternion]
    hangs += [value for row in armature.matrix_parent_inverse for value in row]
    modes = [armature.rotation_mode, *(each.rotation_mode for each in bones)]
    rig: list[Any] = [[*place], hangs, rest, modes]
    groups = asked, asked["body"], asked["ground"]
    known = [{name: each[name] for name in sorted(_OF_RIG & each.keys())} for each in groups]
    return json.dumps([asked, wishes, rig], sort_keys=True), json.dumps([known, rig])


@contextmanager
def _deaf() -> Iterator[None]:
    """Let nothing that happens within be a change to follow."""
    _state.busy = True
    try:
        yield
    finally:
        try:
            # What was written is told now, while nobody listens.
            if bpy.context.view_layer is not None:
                bpy.context.view_layer.update()
        finally:
            _state.busy = False


def _within_scene(armature: bpy.types.Object) -> bool:
    return bool(_windows(armature)) or armature.name in bpy.context.view_layer.objects


def _windows(armature: bpy.types.Object) -> list[bpy.types.Window]:
    """Windows that show a view layer with the armature."""
    manager = bpy.context.window_manager
    if manager is None:
        return []
    return [each for each in manager.windows if armature.name in each.view_layer.objects]


def _window_of(armature: bpy.types.Object) -> AbstractContextManager[object]:
    """A context in which the armature's scene is the one that is worked on."""
    windows = _windows(armature)
    return bpy.context.temp_override(window=windows[0]) if windows else nullcontext()
