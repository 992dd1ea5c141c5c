# SPDX-License-Identifier: GPL-3.0-or-later
"""What is made by itself, as long as a switch of an armature says so: noticing, waiting, turns.

Blender tells after each update what has changed. If that is something that a motion was made from,
a timer shows the frame in sight as it is going to be, outside the update; what changes in the
meantime waits for the same turn. Once nothing has changed for a while, all of it is made anew, in
short turns between which Blender goes on. What our own writing changes is let through Blender's
update before we listen again. Where nothing is live, nobody is told of updates: thousands of
objects may move with each frame.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from typing import Any, Final, cast

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ..core.errors import OctoMotionError
from .declared_settings import assign
from .language import translated

SOON: Final = 0.0
"""Seconds from a change to the frame in sight at least: what changes together is told together."""
IDLE: Final = 0.1
"""Seconds without a change after which all other frames follow …"""
TURN: Final = 0.001
"""… and for how long at a time, before a step of the work that has begun is let end: that may take
five times as long, and so has to be the last."""
LATER: Final = 0.3
"""Seconds until it is tried again, while Blender renders or a tool of ours runs."""

_all: Final[list[Live]] = []
_followed: Final[set[str]] = set()
"""Kinds of motions of which some are live, and for which Python's collector leaves alone what there
was before."""


def tell_switched(settings: Any, _context: bpy.types.Context) -> None:
    """What a switch of a motion's settings does: a change in the panel is told to everyone by
    Blender, one by a script only like this.
    """
    for each in _all:
        each.switched.add(settings.id_data.name)
        each.begin_watching()
    settings.id_data.update_tag(refresh={"OBJECT"})


class _Following:
    """Motions of one kind on their way, in turns; see :class:`Live`."""

    def __init__(self) -> None:
        self.seen: dict[str, str | None] = {}
        """What each live armature's motion was made from, by the object's name."""
        self.changed: dict[str, bool] = {}
        """Armatures to look at, and whether it is known already that they changed."""
        self.following: dict[str, Any] = {}
        """Motions of which no more than the frame in sight is there, by the armature's name."""
        self.rates: dict[str, float] = {}
        """Frames per second of each scene."""
        self.complete = False
        """Whether all live armatures of the file are among those seen."""
        self.switched: set[str] = set()
        """Names of the armatures whose switch was touched, until somebody has looked."""
        self.busy = False
        # Blender knows timers by their objects: a method is another one each time.
        self.run_pending: Callable[[], float | None] = self._run_pending
        self.run_following: Callable[[], float | None] = self._run_following

    # --- What a kind of motion is ---

    def settings(self, armature: bpy.types.Object) -> Any:
        """The group with the properties ``live`` and ``live_error``."""
        raise NotImplementedError

    def sources(self, armature: bpy.types.Object) -> set[bpy.types.ID]:
        """Data-blocks that a motion is made from, but for its armature object."""
        raise NotImplementedError

    def made_from(self, armature: bpy.types.Object) -> str:
        """All that a motion is made from and that is the armature object's own, as text."""
        raise NotImplementedError

    def make(self, armature: bpy.types.Object) -> None:
        """Show the frame in sight, and put into ``following`` what makes all others."""
        raise NotImplementedError

    def work_on(self, armature: bpy.types.Object, work: Any, seconds: float) -> None:
        """Work for so long on what is being followed, and take it out when it is done."""
        raise NotImplementedError

    def show(self, armature: bpy.types.Object, work: Any, frame: float) -> None:
        """Show another frame as it is going to be."""
        raise NotImplementedError

    def give_back(self, armature: bpy.types.Object | None, work: Any) -> None:
        """Let all be as it was before anything of this was shown; the armature may be gone."""
        raise NotImplementedError

    def notice(
        self, armature: bpy.types.Object, touched: set[bpy.types.ID], *, certain: bool
    ) -> None:
        """See whether one that is live hangs on what Blender says has changed."""
        if certain or not touched.isdisjoint(self.sources(armature)):
            self.soon(armature.name, certain=True)

    def notice_itself(self, name: str) -> None:
        """See whether the settings of one that is live have changed."""
        self.soon(name, certain=False)

    def anew(self, armature: bpy.types.Object, *, certain: bool) -> str | None:
        """What a motion is made from now, if it has to be made anew."""
        now = self.made_from(armature)
        return now if certain or self.seen.get(armature.name) != now else None

    def saving(self) -> None:
        """The file is about to be saved, with what is still being followed."""

    def must_wait(self) -> bool:
        """Whether others are at work."""
        return others_at_work()

    def clear(self) -> None:
        """Forget all."""
        for known in (self.seen, self.changed, self.following, self.rates, self.switched):
            known.clear()
        self.complete = self.busy = False

    def drop(self) -> None:
        """Drop what was about to be made."""
        self.changed.clear()
        self.following.clear()
        stop_timer(self.run_pending)
        stop_timer(self.run_following)

    def made(self, armature: bpy.types.Object) -> None:
        """Tell that an armature's motion has just been made from its settings as they are."""
        settings = self.settings(armature)
        if settings.live:
            self.seen[armature.name] = self.made_from(armature)
        self.following.pop(armature.name, None)
        assign(settings, "live_error", "")

    def is_on(self, armature: bpy.types.Object) -> bool:
        """Whether an armature is to be followed."""
        # Settings come into being when they are looked at: what has none is left without.
        return (
            armature.library is None
            and armature.is_property_set("octo_motion")
            and self.settings(armature).live
        )

    # --- The two timers ---

    def pending(self) -> bool:
        """Whether the frame in sight is about to be made."""
        return bpy.app.timers.is_registered(self.run_pending)

    def _run_pending(self) -> float | None:
        """What a timer does: show the frame in sight of motions whose sources have changed.

        Returns seconds until it has to be called again, none if all is done.
        """
        if self.busy or self.must_wait():
            return LATER
        if self.seen:
            spare_what_is_there(type(self).__name__)
        for name in list(self.changed):
            _let_blender_tell(name)
        self._follow_changed()
        return None

    def _follow_changed(self) -> None:
        """Show the frame in sight of what has changed; all others follow a little later."""
        changed = dict(self.changed)
        self.changed.clear()
        for name, certain in changed.items():
            self.follow(name, certain=certain)
        # From the last change on, not from the first.
        stop_timer(self.run_following)
        if self.following:
            bpy.app.timers.register(self.run_following, first_interval=0.0 if plays() else IDLE)

    def _run_following(self) -> float | None:
        """What another timer does: all other frames, in short turns.

        Returns seconds until it has to be called again, none if all is done.
        """
        if self.busy or self.must_wait():
            return LATER
        for name in list(self.following)[:1]:
            _let_blender_tell(name)
            if not self.pending():
                self.go_on(name, TURN)
        return 0.0 if self.following else None

    def finish_following(self) -> None:
        """Make all motions that are on their way at once."""
        for name in list(self.seen):
            _let_blender_tell(name)
        stop_timer(self.run_pending)
        self._follow_changed()
        stop_timer(self.run_following)
        while self.following:
            self.go_on(next(iter(self.following)), np.inf)

    def soon(self, name: str, *, certain: bool, wait: float = SOON) -> None:
        """Look at an armature soon; ``certain`` if something is known to have changed."""
        self.changed[name] = certain or self.changed.get(name, False)
        if not self.pending():
            bpy.app.timers.register(self.run_pending, first_interval=wait)

    def follow(self, name: str, *, certain: bool) -> None:
        """Make an armature's motion anew, if it is not what it is made from says already."""
        armature = armature_named(name)
        if armature is None or not self.is_on(armature):
            self.seen.pop(name, None)
            return
        if armature.mode == "EDIT" or not within_scene(armature):
            # Leaving edit mode is a change of its own.
            return
        now = self.anew(armature, certain=certain)
        if now is None:
            return
        with self.telling(armature), self.deaf(), window_of(armature):
            self.make(armature)
        if self.settings(armature).live:
            self.seen[name] = now

    def go_on(self, name: str, seconds: float) -> None:
        """Work for so long on a motion that is on its way, and write it when it is there."""
        armature, work = armature_named(name), self.following[name]
        if armature is None or not self.is_on(armature):
            self.let_go(armature, name)
            return
        with self.telling(armature), window_of(armature):
            self.work_on(armature, work, seconds)

    def let_go(self, armature: bpy.types.Object | None, name: str = "") -> None:
        """Leave a motion that was on its way, and show what is there."""
        work = self.following.pop(armature.name if armature is not None else name, None)
        if work is not None:
            with self.deaf():
                self.give_back(armature, work)

    def pause(self, armature: bpy.types.Object) -> None:
        """Leave what is on its way while something else is done with the armature; what comes of
        that is looked at afterwards.
        """
        name = armature.name
        if name in self.following:
            self.let_go(armature)
            self.seen[name] = None
            self.soon(name, certain=False)

    def switch_off(self, armature: bpy.types.Object, why: str) -> None:
        """Follow no more, and say why."""
        settings = self.settings(armature)
        settings.live = False
        settings.live_error = translated(why)
        self.seen.pop(armature.name, None)
        self.let_go(armature)

    @contextmanager
    def telling(self, armature: bpy.types.Object) -> Iterator[None]:
        """Tell in the panel what goes wrong within; the motion stays as it was."""
        settings = self.settings(armature)
        try:
            yield
        except OctoMotionError as error:
            self.let_go(armature)
            settings.live_error = translated(error)
        except BaseException:
            self.let_go(armature)
            settings.live = False
            settings.live_error = translated(
                "Live has stopped at a fault: the console tells which."
            )
            raise

    @contextmanager
    def deaf(self) -> Iterator[None]:
        """Let nothing that happens within be a change to follow."""
        self.busy = True
        try:
            yield
        finally:
            try:
                # What was written is told now, while nobody listens.
                if bpy.context.view_layer is not None:
                    bpy.context.view_layer.update()
            finally:
                self.busy = False


class Live(_Following):
    """Motions of one kind that follow what they are made from, as Blender tells of it.

    Write ``settings``, ``sources``, ``made_from``, ``make``, ``work_on``, ``show`` and
    ``give_back``. Armatures are known by name: references to Blender's data do not outlive a turn.
    """

    def __init__(self) -> None:
        super().__init__()
        self.end_watching: Callable[[], None] = self._end_watching
        _all.append(self)

    def listen(self) -> None:
        """Listen to Blender."""
        for handlers, function in self._rare():
            handlers.append(function)
        # While an add-on is switched on, Blender's data is out of reach.
        self._watch_for_now()

    def listen_no_more(self) -> None:
        """Listen no more, and drop what was about to be made."""
        for name in list(self.following):
            self.let_go(armature_named(name), name)
        self.drop()
        self.clear()
        spare_no_more(type(self).__name__)
        stop_timer(self.end_watching)
        for handlers, function in (*self._frequent(), *self._rare()):
            if function in handlers:
                handlers.remove(function)

    def begin_watching(self) -> None:
        """Be told of each update from now on."""
        for handlers, function in self._frequent():
            if function not in handlers:
                handlers.append(function)

    def _end_watching(self) -> None:
        """Be told of none any more, if nothing is live."""
        if not self.listens() and self.complete:
            spare_no_more(type(self).__name__)
            for handlers, function in self._frequent():
                if function in handlers:
                    handlers.remove(function)

    def _watch_for_now(self) -> None:
        """Be told of updates, and soon of none if nothing is live. Where Blender goes through those
        that it tells, whoever comes after one that is taken out would be left out.
        """
        self.begin_watching()
        if not bpy.app.timers.is_registered(self.end_watching):
            bpy.app.timers.register(self.end_watching, first_interval=SOON)

    def _frequent(self) -> list[tuple[Any, Any]]:
        known = bpy.app.handlers
        return [
            (known.depsgraph_update_post, self.after_update),
            (known.frame_change_post, self.after_frame),
        ]

    def _rare(self) -> list[tuple[Any, Any]]:
        known = bpy.app.handlers
        return [
            (known.undo_pre, self._before_undo),
            (known.redo_pre, self._before_undo),
            (known.undo_post, self._after_undo),
            (known.redo_post, self._after_undo),
            (known.save_pre, self._before_saving),
            (known.load_pre, self._before_loading),
            (known.load_post, self._after_loading),
            (known.blend_import_post, self._after_import),
        ]

    @persistent
    def after_update(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        """After each update."""
        if self.busy or depsgraph.mode != "VIEWPORT" or not self._is_to_look():
            return
        touched = touched_by(depsgraph)
        for each in touched:
            if isinstance(each, bpy.types.Object) and each.type == "ARMATURE":
                self.look_at(each)
        rate = _rate(scene)
        another_rate = rate != self.rates.get(scene.name, rate)
        self.rates[scene.name] = rate
        for name in list(self.seen):
            armature = armature_named(name)
            if armature is None:
                del self.seen[name]
            else:
                self.notice(armature, touched, certain=another_rate and name in scene.objects)

    @persistent
    def after_frame(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        """A change that comes with another frame, as while it plays, is told here alone."""
        if self.busy or depsgraph.mode != "VIEWPORT" or not self._is_to_look():
            return
        self._show_again(scene)
        followed = [each for name in self.seen if (each := armature_named(name)) is not None]
        sources = [self.sources(each) for each in followed]
        touched = touched_by(depsgraph, set(followed).union(*sources))
        still = {each for each in touched if not is_animated(each)}
        for armature, its in zip(followed, sources, strict=True):
            if armature in touched and not self.pending():
                # It moves with every frame: now and then is enough to see whether it is set anew.
                self.soon(armature.name, certain=False, wait=LATER)
            if not still.isdisjoint(its):
                self.soon(armature.name, certain=True)

    def _is_to_look(self) -> bool:
        """Whether anything is live that an update may change."""
        if self.listens():
            return True
        self._watch_for_now()
        return False

    def _show_again(self, scene: bpy.types.Scene) -> None:
        """Show motions that are on their way as they are going to be at another frame, too."""
        if not self.following or plays():
            return
        self.busy = True
        try:
            for name, work in self.following.items():
                armature = armature_named(name)
                if armature is not None and name in scene.objects:
                    # What is wrong is told when all of it is worked out.
                    with suppress(OctoMotionError):
                        self.show(armature, work, scene.frame_current_final)
        finally:
            self.busy = False

    def listens(self) -> bool:
        """Whether any armature is live; all that are so are known then."""
        if not self.complete or not all(map(armature_named, self.seen)):
            # The add-on was switched on, a file was appended, an armature was renamed.
            for each in self.live_armatures():
                if each.name not in self.seen:
                    self.seen[each.name] = self.made_from(each)
            self.rates = {each.name: _rate(each) for each in bpy.data.scenes}
            # A linked one may be overridden or made local at any time.
            self.complete = not self._is_any_linked()
        while self.switched:
            armature = armature_named(self.switched.pop())
            if armature is not None:
                self.look_at(armature)
        return bool(self.seen)

    def _is_any_linked(self) -> bool:
        """Whether an armature is live that is linked from another file."""
        return len(bpy.data.libraries) > 0 and any(
            each.type == "ARMATURE"
            and each.library is not None
            and each.is_property_set("octo_motion")
            and self.settings(each).live
            for each in bpy.data.objects
        )

    def look_at(self, armature: bpy.types.Object) -> None:
        """Begin or cease to follow an armature, or see whether its settings have changed."""
        name = armature.name
        if not self.is_on(armature):
            for known in (self.seen, self.changed):
                known.pop(name, None)
        elif name in self.seen:
            self.notice_itself(name)
        else:
            self.seen[name] = None
            self.soon(name, certain=True)

    def live_armatures(self) -> list[bpy.types.Object]:
        """All that are to be followed."""
        return [each for each in bpy.data.objects if each.type == "ARMATURE" and self.is_on(each)]

    @persistent
    def _before_undo(self, *_: object) -> None:
        self.drop()

    @persistent
    def _after_undo(self, *_: object) -> None:
        """A step may have been made between a change and the motion that follows from it."""
        self.clear()
        for armature in self.live_armatures():
            self.seen[armature.name] = None
            self.soon(armature.name, certain=True)
        self.begin_watching()
        self._end_watching()

    @persistent
    def _before_saving(self, *_: object) -> None:
        """What is saved belongs together, sources and motion."""
        if not (self.busy or self.must_wait()):
            self.finish_following()
        self.saving()

    @persistent
    def _before_loading(self, *_: object) -> None:
        # Blender 4.5 as a module does not end where loading has taken a timer away.
        stop_timer(self.end_watching)
        self.drop()
        self.clear()

    @persistent
    def _after_loading(self, *_: object) -> None:
        self.begin_watching()
        self._end_watching()

    @persistent
    def _after_import(self, *_: object) -> None:
        self.complete = False
        self._watch_for_now()


# --- What there is to know of Blender, and of Python ----------------------------------------------


def spare_what_is_there(kind: str) -> None:
    """Have Python's collector leave alone all objects that are there now, as long as motions of a
    kind are live: to look through them takes 60 ms, in the middle of a drag.
    """
    if not _followed:
        gc.collect()
        gc.freeze()
    _followed.add(kind)


def spare_no_more(kind: str) -> None:
    """Have it look through all of them again, if no other kind is live."""
    if kind in _followed:
        _followed.remove(kind)
        if not _followed:
            gc.unfreeze()


def armature_named(name: str) -> bpy.types.Object | None:
    """A local armature, none if it is gone."""
    found = bpy.data.objects.get((name, None))
    return found if found is not None and found.type == "ARMATURE" else None


def stop_timer(timer: Callable[[], float | None]) -> None:
    """Let a timer not run, if it was to."""
    if bpy.app.timers.is_registered(timer):
        bpy.app.timers.unregister(timer)


def plays() -> bool:
    """Whether any window plays: each frame then shows what the action says."""
    manager = bpy.context.window_manager
    return manager is not None and any(
        each.screen is not None and each.screen.is_animation_playing for each in manager.windows
    )


def others_at_work() -> bool:
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


def _rate(scene: bpy.types.Scene) -> float:
    return scene.render.fps / scene.render.fps_base


def touched_by(
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


def is_animated(each: bpy.types.ID) -> bool:
    """Whether another frame may move it by itself; actions are told of with every frame."""
    if isinstance(each, bpy.types.Action):
        return True
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


def with_parents(
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


def within_scene(armature: bpy.types.Object) -> bool:
    """Whether it is in a scene that a window shows, or the one that is worked on."""
    return bool(_windows(armature)) or armature.name in bpy.context.view_layer.objects


def _windows(armature: bpy.types.Object) -> list[bpy.types.Window]:
    """Windows that show a view layer with the armature."""
    manager = bpy.context.window_manager
    if manager is None:
        return []
    return [each for each in manager.windows if armature.name in each.view_layer.objects]


def _let_blender_tell(name: str) -> None:
    """Have Blender tell now what has changed around an armature. A turn may come between a change
    and that: with what the turn writes, which is told while nobody listens, it would be lost.
    """
    armature = armature_named(name)
    if armature is not None:
        with window_of(armature):
            if bpy.context.view_layer is not None:
                bpy.context.view_layer.update()


def window_of(armature: bpy.types.Object) -> AbstractContextManager[object]:
    """A context in which the armature's scene is the one that is worked on."""
    windows = _windows(armature)
    return bpy.context.temp_override(window=windows[0]) if windows else nullcontext()
