# SPDX-License-Identifier: GPL-3.0-or-later
"""Splices and retargets that follow what they are made from: what both have in common.

A result is worked out and written in turns, into an action that nobody plays yet; then it takes the
place of the one before at once. Clips are read again only if Blender says that they have changed.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Generator, Iterable, Iterator
from typing import Any, Final

import bpy
import numpy as np

from ...blender.animation import (
    PoseValues,
    StandIn,
    acting_curves,
    belongs_to,
    curves_of,
    drop_stand_ins,
    is_setting,
    looking_whether_edited,
    pose_values,
    restore_pose,
    show_pose,
    unkeyed_pose,
)
from ...blender.rig import read_skeleton
from ...core.content_cache import content_key
from ...core.errors import RigError
from ...core.phrases import phrase
from ...core.splicing.clip import Clip
from ..declared_settings import assign, plain
from ..live import Live, is_animated, with_parents
from ..modal_job import Job
from .properties import splicing_settings
from .stack import KeptClips

_TURN: Final = 0.001
"""Seconds of a turn before a step that has begun is let end: steps are not all small here."""


class LeftAloneError(Exception):
    """A result is somebody's own, or not what is played: it is not followed any more."""

    def __init__(self, why: str) -> None:
        super().__init__(why)
        self.why = why


class Shown:
    """The pose of an armature in place of that of its action, and what it was before."""

    def __init__(self) -> None:
        self._before: PoseValues | None = None
        self._frame = 0.0

    def __bool__(self) -> bool:
        return self._before is not None

    def show(self, armature: bpy.types.Object, clip: Clip) -> None:
        """Pose it as the one frame of a clip says."""
        if self._before is None:
            self._before, self._frame = pose_values(armature), _frame_now()
        scales = None if clip.scales is None else clip.scales[0]
        show_pose(armature, clip.skeleton.names, clip.rotations[0], clip.locations[0], scales)

    def give_back(self, armature: bpy.types.Object) -> None:
        """Let it be as it was; safe to call twice."""
        if self._before is None:
            return
        restore_pose(armature, self._before)
        self._before, scene = None, bpy.context.scene
        if scene is not None and _frame_now() != self._frame:
            # At another frame its action says what it is like.
            scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)


def _frame_now() -> float:
    scene = bpy.context.scene
    return 0.0 if scene is None else scene.frame_current_final


class Following(ABC):
    """One result as its settings are now, of which nothing is written yet.

    Args:
        armature: that gets it.
        read: actions of which curves are looked at from step to step.
    """

    def __init__(self, armature: bpy.types.Object, read: Iterable[bpy.types.Action]) -> None:
        self.name = armature.name
        self.unkeyed, self.posed = unkeyed_pose(armature), pose_values(armature)
        """The armature's own pose, before anything is shown."""
        self.stand_in: StandIn | None = None
        """What it is written into."""
        self._curves = {each.name: _pointers(each) for each in read}

    @property
    def intact(self) -> bool:
        """Whether all is there that is being read."""
        for name, known in self._curves.items():
            action = bpy.data.actions.get(name)
            if action is None or _pointers(action) != known:
                return False
        return self.stand_in is None or self.stand_in.is_there

    @abstractmethod
    def pose(self, frame: float) -> Clip | None:
        """It at a frame, or nearly so; none if nothing is to be shown.

        Raises:
            OctoMotionError: something is wrong that the user can put right.
        """

    def steps(self) -> Iterator[float]:
        """Work all of it out."""
        for _ in self.working():
            yield 0.5

    @abstractmethod
    def working(self) -> Iterator[object]:
        """The same, whatever it yields.

        Raises:
            LeftAloneError: the result before is not ours any more.
            OctoMotionError: something is wrong that the user can put right.
        """

    @abstractmethod
    def write(self) -> None:
        """Let the armature play it."""

    def drop(self) -> None:
        """Leave nothing of it behind; safe to call twice."""
        if self.stand_in is not None:
            self.stand_in.drop()


def check_ours(
    armature: bpy.types.Object, previous: bpy.types.Action | None
) -> Generator[float, None, None]:
    """Make sure that a result may be made anew, in steps.

    Raises:
        LeftAloneError: it is not, or no longer, what was made.
    """
    if previous is None:
        return
    name = previous.name
    if (yield from looking_whether_edited(previous)):
        raise LeftAloneError(
            phrase("Live is off: '{previous}' was edited and is yours.", previous=name)
        )
    found = bpy.data.actions.get(name)
    if found is None or not belongs_to(found, armature):
        raise LeftAloneError(
            phrase("Live is off: '{previous}' has other users too.", previous=name)
        )


def not_ours(playing: bpy.types.Action) -> str:
    """What there is to say of an armature that plays something else."""
    return phrase("Live is off: '{playing}' is not what was generated.", playing=playing.name)


def _pointers(action: bpy.types.Action) -> list[int]:
    return [action.as_pointer(), *(each.as_pointer() for each in curves_of(action))]


class Work:
    """A result on its way."""

    def __init__(self, following: Following, shown: Shown) -> None:
        self.following, self.shown = following, shown
        self.job = Job(following.steps())


class _Known:
    """What was read for one armature."""

    def __init__(self) -> None:
        self.kept = KeptClips()
        self.bodies: dict[str, str] = {}
        """What was so of the bodies then, by their names."""
        self.gone: set[int] = set()
        """Numbers that Blender gives what has changed since."""


class ClipLive(Live, ABC):
    """Results that follow the clips and settings they are made from."""

    def __init__(self) -> None:
        super().__init__()
        self.known: dict[str, _Known] = {}
        """What was read, by the armature's name."""
        self.now: dict[str, str] = {}
        """What is so of bodies as far as is known, by their names."""

    @abstractmethod
    def begin(self, armature: bpy.types.Object, kept: KeptClips) -> Following:
        """A result on its way.

        Raises:
            OctoMotionError: something is wrong that the user can put right.
        """

    @abstractmethod
    def others(self, armature: bpy.types.Object) -> list[bpy.types.Object]:
        """Armatures whose clips it is made from."""

    @abstractmethod
    def asked(self, armature: bpy.types.Object) -> Any:
        """All that is set, as plain data."""

    @abstractmethod
    def further(self, armature: bpy.types.Object) -> Iterator[bpy.types.ID | None]:
        """Actions, grounds and whatever else it is made from."""

    # --- What Live asks for ---

    def sources(self, armature: bpy.types.Object) -> set[bpy.types.ID]:
        found: set[bpy.types.ID] = set()
        for each in self.further(armature):
            if isinstance(each, bpy.types.Object):
                found |= with_parents(each)
            elif each is not None:
                found.add(each)
        return found

    def notice(
        self, armature: bpy.types.Object, touched: set[bpy.types.ID], *, certain: bool
    ) -> None:
        its = touched & self.sources(armature)
        if armature.name in self.known:
            self.known[armature.name].gone |= {each.session_uid for each in its}
        moved = any(each in touched or each.data in touched for each in self.others(armature))
        if certain or its:
            self.soon(armature.name, certain=True)
        elif moved:
            self.soon(armature.name, certain=False)

    def look_at(self, armature: bpy.types.Object) -> None:
        self.now.pop(armature.name, None)
        super().look_at(armature)

    def made_from(self, armature: bpy.types.Object) -> str:
        everybody = armature, *self.others(armature)
        self.now.pop(armature.name, None)
        for each in everybody:
            if each.name not in self.now:
                self.now[each.name] = self._body(each)
        return self._text(armature)

    def _text(self, armature: bpy.types.Object) -> str:
        everybody = armature, *self.others(armature)
        landmarks = [plain(splicing_settings(each).landmarks) for each in everybody]
        bodies = [self.now.get(each.name) for each in everybody]
        return json.dumps([self.asked(armature), landmarks, bodies], sort_keys=True)

    def make(self, armature: bpy.types.Object) -> None:
        name = armature.name
        earlier = self.following.pop(name, None)
        shown = earlier.shown if earlier is not None else Shown()
        if earlier is not None:
            earlier.following.drop()
        # What is read of it must not be what was shown.
        shown.give_back(armature)
        known = self.known.setdefault(name, _Known())
        known.kept.forget(known.gone | self._changed_bodies(armature, known))
        known.gone.clear()
        following = self.begin(armature, known.kept)
        work = self.following[name] = Work(following, shown)
        self.show(armature, work, _frame_now())
        assign(self.settings(armature), "live_error", "")

    def work_on(self, armature: bpy.types.Object, work: Work, seconds: float) -> None:
        if not work.following.intact:
            self.let_go(armature)
            self.soon(armature.name, certain=True)
            return
        try:
            there = work.job.work(min(seconds, _TURN) if np.isfinite(seconds) else seconds)
        except LeftAloneError as error:
            self.switch_off(armature, error.why)
            return
        if there:
            with self.deaf():
                work.shown.give_back(armature)
                work.following.write()
                self.following.pop(armature.name, None)
            # Landmarks that were found are in the table now.
            self.seen[armature.name] = self._text(armature)

    def show(self, armature: bpy.types.Object, work: Work, frame: float) -> None:
        clip = work.following.pose(frame)
        if clip is not None:
            work.shown.show(armature, clip)

    def give_back(self, armature: bpy.types.Object | None, work: Work) -> None:
        work.following.drop()
        if armature is not None:
            work.shown.give_back(armature)

    def made(self, armature: bpy.types.Object) -> None:
        self.let_go(armature)
        super().made(armature)

    def drop(self) -> None:
        for work in self.following.values():
            work.following.drop()
        super().drop()

    def clear(self) -> None:
        super().clear()
        self.known.clear()
        self.now.clear()
        drop_stand_ins()

    # --- Bodies ---

    def _body(self, armature: bpy.types.Object) -> str:
        """All that is read of an armature, beside its actions, as text."""
        name = armature.name
        work, known = self.following.get(name), self.known.get(name)
        if work is not None and work.shown and known is not None and name in known.bodies:
            # The pose is not its own now.
            pose = json.loads(known.bodies[name])["pose"]
        else:
            pose = {"/".join(place): each for place, each in unkeyed_pose(armature).items()}
        try:
            rest = content_key(read_skeleton(armature)).hex()
        except RigError:
            # Reading it says what is wrong with it.
            rest = ""
        bones = armature.pose.bones if armature.pose is not None else ()
        modes = [armature.rotation_mode, *(each.rotation_mode for each in bones)]
        told = {"rest": rest, "pose": pose, "modes": modes, "stands": _stands(armature)}
        return json.dumps(told, sort_keys=True)

    def _changed_bodies(self, armature: bpy.types.Object, known: _Known) -> set[int]:
        """Numbers of the armatures that are not what they were when their clips were read."""
        changed: set[int] = set()
        for each in (armature, *self.others(armature)):
            now = self.now[each.name]
            if known.bodies.get(each.name) != now:
                known.bodies[each.name] = now
                changed.add(each.session_uid)
        return changed


_PLACES: Final = ("location", "rotation", "scale", "delta_")


def _stands(armature: bpy.types.Object) -> list[float]:
    """Where an armature object stands; nothing if something moves it from frame to frame."""
    moves = bool(armature.constraints) or (
        armature.parent is not None and is_animated(armature.parent)
    )
    curves = acting_curves(armature.animation_data)
    if moves or any(curve.data_path.startswith(_PLACES) for curve in curves):
        return []
    return [value for row in armature.matrix_world for value in row]


def setting_action(armature: bpy.types.Object) -> bpy.types.Action | None:
    """The action that an armature has, if it has keys of settings; those of its bones are not
    looked at.
    """
    data = armature.animation_data
    action = data.action if data is not None else None
    if action is None or not any(is_setting(each.data_path) for each in curves_of(action)):
        return None
    return action
