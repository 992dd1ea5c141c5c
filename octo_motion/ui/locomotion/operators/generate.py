# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion made: by the button, or live, by itself.

Live, whoever drags a point of the route or a slider sees the motion follow, see
:mod:`~octo_motion.ui.live`. Only an action that was generated and that nobody has edited is
touched.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any, Final

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
from ...language import reported
from ...live import SOON, Live, plays, with_parents
from ...modal_job import Job, ModalJob
from ...operator_base import ArmatureOperator
from ...overlay_lines import Lines, draw_lines
from ..reading import forget_skins, playing_action, previous_action
from ..settings import (
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


# --- Live -----------------------------------------------------------------------------------------


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
_ANYTHING: Final = frozenset({"RIG", "GROUND", "ELSE"})


@dataclass
class _Work:
    """A motion on its way."""

    motion: Following
    job: Job
    lines: Lines = field(default_factory=list)
    """Where it leads, to be drawn until it is there."""
    known: bool = False
    """Whether it is worked out, and on its way to the action."""


class _LiveMotions(Live):
    """Locomotion that follows."""

    def __init__(self) -> None:
        super().__init__()
        self.known: dict[str, Shot] = {}
        """What was read of armatures …"""
        self.rigs: dict[str, str] = {}
        """… when this was so of their rigs …"""
        self.touched: dict[str, set[str]] = {}
        """… and what of it may have changed since: "RIG", "GROUND" or "ELSE", which is not the
        route."""
        self.sketches: dict[str, Sketch] = {}
        """What the frame in sight is drawn from until a motion is planned, by the armature's name.
        """

    def settings(self, armature: bpy.types.Object) -> OCTO_MOTION_PG_locomotion:
        return locomotion_settings(armature)

    def sources(self, armature: bpy.types.Object) -> set[bpy.types.ID]:
        return _sources(armature)

    def made_from(self, armature: bpy.types.Object) -> str:
        return _read_from(armature, locomotion_settings(armature))[0]

    def make(self, armature: bpy.types.Object) -> None:
        _make(armature, locomotion_settings(armature))

    def show(self, armature: bpy.types.Object, work: _Work, frame: float) -> None:
        work.motion.show(armature, frame)

    def give_back(self, armature: bpy.types.Object | None, work: _Work) -> None:
        if armature is not None:
            work.motion.give_back(armature)

    def clear(self) -> None:
        super().clear()
        for known in (self.known, self.rigs, self.touched, self.sketches):
            known.clear()

    def drop(self) -> None:
        super().drop()
        self.known.clear()
        self.touched.clear()

    def soon(
        self,
        name: str,
        *,
        certain: bool,
        wait: float = SOON,
        touched: Collection[str] = _ANYTHING,
    ) -> None:
        self.touched.setdefault(name, set()).update(touched)
        super().soon(name, certain=certain, wait=wait)

    def notice(
        self, armature: bpy.types.Object, touched: set[bpy.types.ID], *, certain: bool
    ) -> None:
        meshes = {each for each in touched if isinstance(each, bpy.types.Mesh)}
        if certain or not touched.isdisjoint(_sources(armature)) or _is_skin(armature, meshes):
            what = _changed(armature, touched, meshes)
            self.soon(armature.name, certain=True, touched=what)
            return
        marked = {_marked(each) for each in touched if isinstance(each, bpy.types.Object)}
        own = {armature.name, once_called(locomotion_settings(armature).ground)}
        if marked & own - {""}:
            self.soon(armature.name, certain=False, touched={"ELSE"})

    def notice_itself(self, name: str) -> None:
        # What of its rig has changed is looked at itself.
        self.soon(name, certain=False, touched={"ELSE"})

    def anew(self, armature: bpy.types.Object, *, certain: bool) -> str | None:
        name = armature.name
        now, rig = _read_from(armature, locomotion_settings(armature))
        if self.seen.get(name) != now:
            self.touched.setdefault(name, set()).add("ELSE")
        elif not certain:
            return None
        if self.rigs.get(name) != rig:
            self.touched.setdefault(name, set()).update(_ANYTHING)
            self.rigs[name] = rig
        return now

    def work_on(self, armature: bpy.types.Object, work: _Work, seconds: float) -> None:
        settings = locomotion_settings(armature)
        motion = work.motion
        # What keys on their way to the action change is no change to follow; Blender works the
        # frame out anew with them, which takes longer than the keys.
        if work.known:
            # While it plays, nothing of it is to be half written.
            seconds = np.inf if plays() else 0.5 * seconds
        with self.deaf() if work.known else nullcontext():
            there = work.job.work(seconds)
            if work.known:
                motion.cover(armature)
        if motion.has_news:
            with self.deaf():
                motion.tell(armature)
            work.lines = motion.lines()
            _note_sketch(armature, motion)
        if there and _is_written(armature, settings, work):
            with self.deaf():
                _write(armature, motion)

    def saving(self) -> None:
        for work in self.following.values():
            if work.known:
                work.motion.take_back()
                work.job, work.known = Job(iter(())), False

    @persistent
    def _after_undo(self, *_: object) -> None:
        # Motions are nearly what they were.
        sketches = dict(self.sketches)
        super()._after_undo()
        self.sketches.update(sketches)

    @persistent
    def _before_loading(self, *_: object) -> None:
        super()._before_loading()
        clear_caches()


_state: Final = _LiveMotions()
pending: Final = _state.pending
run_pending: Final = _state.run_pending
run_following: Final = _state.run_following
finish_following: Final = _state.finish_following


_drawing: Final[list[Any]] = []
"""Blender's handle of what draws."""


def _draw() -> None:
    """Draw where motions lead that are on their way."""
    space: Any = bpy.context.space_data
    if _state.following and space is not None and space.overlay.show_overlays:
        draw_lines([line for work in _state.following.values() for line in work.lines])


def listen() -> None:
    """Listen to Blender."""
    _state.listen()
    _drawing.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW"))


def listen_no_more() -> None:
    """Listen no more, and drop what was about to be made."""
    while _drawing:
        bpy.types.SpaceView3D.draw_handler_remove(_drawing.pop(), "WINDOW")
    _state.listen_no_more()
    clear_caches()


def made(armature: bpy.types.Object, result: MotionResult | None) -> None:
    """Tell that an armature's motion has just been made from its settings as they are."""
    _state.following.pop(armature.name, None)
    settings = locomotion_settings(armature)
    assign(settings, "live_error", "")
    if settings.live:
        _state.made(armature)
        if result is not None:
            _state.sketches[armature.name] = Sketch(result.known)


# --- What a motion is made from -------------------------------------------------------------------


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
    found: set[bpy.types.ID] = set().union(*(with_parents(root, armature) for root in roots))
    # Blender tags the armature's data with every pose: its bones are looked at themselves.
    return found | ({settings.weight_curve} - {None})


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
    its = with_parents(ground) if ground is not None else set[bpy.types.ID]()
    found = {"GROUND"} if touched & its else set[str]()
    if _is_skin(armature, meshes) or touched & with_parents(armature.parent):
        found.add("RIG")
    if touched & (_sources(armature) - its - _route_of(armature)) or not touched & _route_of(
        armature
    ):
        found.add("ELSE")
    return found


def _is_skin(armature: bpy.types.Object, meshes: set[bpy.types.Mesh]) -> bool:
    """Whether the armature deforms any of these."""
    return bool(meshes) and any(each.data in meshes for each in deformed_meshes(armature))


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
    # What may stretch hangs on that.
    passed_on = [(each.bone.inherit_scale, each.bone.use_connect) for each in bones]
    rig: list[Any] = [[*place], hangs, rest, modes, passed_on]
    groups = asked, asked["body"], asked["ground"]
    known = [{name: each[name] for name in sorted(_OF_RIG & each.keys())} for each in groups]
    return json.dumps([asked, wishes, rig], sort_keys=True), json.dumps([known, rig])


# --- The motion ----------------------------------------------------------------------------------


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
    if known is None or "RIG" in touched:
        forget_skins()
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


def _is_written(
    armature: bpy.types.Object, settings: OCTO_MOTION_PG_locomotion, work: _Work
) -> bool:
    """Whether all is there of a motion but what has to be written at once; if not, the action gets
    what is to come before that, unless it is an artist's.
    """
    motion = work.motion
    if work.known:
        return True
    if kept := _whose(armature, settings, edited=motion.edited):
        _state.switch_off(armature, kept)
        return False
    # While it plays, frames are shown as the action has them.
    work.known = True
    work.job = Job(iter(()) if plays() else motion.filling(armature))
    return False


def _write(armature: bpy.types.Object, motion: Following) -> None:
    """Write a motion that was worked out; where Generate makes other keys of it, these follow."""
    found = motion.shot.rig.detection is not None
    if found:
        # What was found is what is set from now on.
        _state.known.pop(armature.name, None)
    motion.write()
    _note_sketch(armature, motion)
    if found or locomotion_settings(armature).ground.shown:
        # Markers of contacts are where the motion has them now.
        _state.seen[armature.name] = _state.made_from(armature)
    if motion.exact:
        del _state.following[armature.name]
    else:
        _state.following[armature.name] = _Work(motion, Job(motion.exactly()))


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
