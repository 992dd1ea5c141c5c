# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole clips onto an armature, from settings to keys: read → plain arrays → compute → write."""

from __future__ import annotations

import json
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, cast

import bpy
import numpy as np

from ...blender.animation import (
    PoseValues,
    StandIn,
    actions_for,
    clip_channels,
    filling_action,
    is_generated,
    may_replace,
    note_of,
    own_action,
    play_clip,
    still_clip,
    strips_of,
    writable_armature,
    write_clip,
)
from ...blender.rig import even_scale
from ...blender.scene import import_clip, read_triangles, remove_clips
from ...core.errors import ClipError, OctoMotionError, WriteError
from ...core.locomotion.ground import Ground, sample_ground
from ...core.phrases import as_phrase, joined_phrases, phrase
from ...core.rotations import Floats
from ...core.splicing.clip import Clip
from ...core.splicing.humanoid import LANDMARKS, OPTIONAL
from ...core.splicing.transfer import (
    LimbGoal,
    WholeBody,
    reference_doubts,
    retarget_clip,
    retargeting_clip,
)
from ...core.steps import finished
from ..declared_settings import assign
from .bodies import known_landmarks
from .properties import splicing_settings, title, write_landmarks
from .stack import ClipReader, Source, is_source, local_object

_GROUND_SPACING: Final = 0.02
"""Of the body's height: metres between samples of a ground."""

_GROUND_REACH: Final = 0.8
"""Of the body's height, to all sides of its way."""


@dataclass(frozen=True, eq=False)
class RetargetJob:
    """One clip for an armature, as plain data; see :func:`prepare_retarget`."""

    armature: str
    """Names of objects: references do not outlive a modal operator's tick."""
    base: Source
    """A motion of the body, its rest pose if there is none: by it the body is compared, and it
    tells at which height it stands."""
    still: Clip
    source: Source
    settings: WholeBody
    triangles: Floats | None = None
    """(faces, 3, 3) of the ground, world, none without."""
    slot: str = ""
    """Identifier of the clip's slot, "" for the one that fits."""

    @property
    def result_name(self) -> str:
        """What a new result is called."""
        return f"{self.source.clip.name} Retargeted"

    @property
    def note(self) -> str:
        """By which what was made of the same clip is known."""
        made_of = {"source": self.source.armature, "action": self.source.clip.name}
        return json.dumps({"retargeted": made_of}, sort_keys=True)

    def made(self, action: bpy.types.Action) -> bool:
        """Whether an action was made of this clip."""
        return note_of(action) == self.note

    def compute(self) -> Clip:
        """The clip on the armature's body.

        Raises:
            ClipError: a bone or landmark is missing.
            GroundError: it leaves the ground.
        """
        settings = replace(self.settings, ground=finished(self.finding_ground()))
        return retarget_clip(self.base, self.still, self.source, settings)

    def finding_ground(self) -> Generator[None, None, Ground | None]:
        """The ground under its way, in steps; none without a mesh."""
        if self.triangles is None:
            return None
        plain = replace(self.settings, foot_lock=False)
        clip = yield from retargeting_clip(self.base, self.still, self.source, plain)
        _, heads = clip.posed()
        hips = heads[:, clip.skeleton.index[self.base.humanoid()["hips"]]]
        size = float(np.ptp(heads[0, :, 2]))
        return sample_ground(
            self.triangles,
            hips,
            np.ones(len(hips), dtype=bool),
            reach=_GROUND_REACH * size,
            spacing=_GROUND_SPACING * size,
            headroom=0.5 * size,
        )


@dataclass(frozen=True)
class Retargeted:
    """What was made of one clip."""

    action: str
    frames: int
    warnings: tuple[str, ...] = ()

    @property
    def message(self) -> str:
        """One sentence."""
        return phrase("{frames} frames: '{action}'.", frames=self.frames, action=self.action)


def prepare_retarget(
    armature: bpy.types.Object,
    source: bpy.types.Object,
    action: bpy.types.Action,
    slot: str = "",
    *,
    reader: ClipReader | None = None,
    own: ClipReader | None = None,
) -> RetargetJob:
    """Read all that a clip on an armature needs. Nothing is changed.

    Args:
        armature: that gets it.
        source: the armature of the clip.
        action: the clip.
        slot: identifier of its slot, "" for the one that fits.
        reader: of clips, where several are read.
        own: of the armature's own motions, likewise.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """
    writable_armature(armature)
    even_scale(armature)
    check_source(armature, source)
    reader = reader or ClipReader()
    settings = splicing_settings(armature).retarget
    clip = reader.source(source, action, slot, visual=settings.visual)
    base = _own_motion(armature, own or reader) or _resting(armature)
    for each in (base, clip):
        _check_landmarks(each)
    # All bones get keys: which of them turn with their parents changes nothing but these.
    base, clip = (replace(each, clip=each.clip.inheriting) for each in (base, clip))
    goal = cast("LimbGoal", settings.mode.lower())
    return RetargetJob(
        armature.name,
        base,
        still_clip(armature, clip.clip.frames, clip.clip.rate).inheriting,
        clip,
        WholeBody(goal, travel=settings.travel, foot_lock=settings.foot_lock),
        _triangles(settings),
        slot,
    )


def check_source(armature: bpy.types.Object, source: bpy.types.Object) -> None:
    """Whether a clip's armature is another than the one that gets it.

    Raises:
        ClipError: it is the same.
    """
    if source == armature:
        raise ClipError(
            phrase("'{armature}' is both source and target.", armature=armature.name),
            "Select the armature with the clip, then Shift click the one that gets it.",
        )


def _triangles(settings: Any) -> Floats | None:
    if settings.ground is None or not (settings.travel and settings.foot_lock):
        return None
    triangles, _ = read_triangles(settings.ground, bpy.context.evaluated_depsgraph_get())
    return triangles


def _resting(armature: bpy.types.Object) -> Source:
    """A body of which nothing but its rest pose is known."""
    still = still_clip(armature, np.array([1.0]), 24.0)
    known = known_landmarks(armature, still.skeleton, None)
    return Source(still, known.landmarks, armature.name, known.problem, known.found)


def _own_motion(armature: bpy.types.Object, reader: ClipReader) -> Source | None:
    """A motion of the armature's own, none if there is none: the one that it has for this, the
    base of its splices, one in which it stands by its name, its action, or another with its slot.
    What was retargeted tells nothing of it.
    """
    settings = splicing_settings(armature)
    own = own_action(armature)
    choices: list[tuple[bpy.types.Action, str]] = []
    if settings.retarget.standing is not None:
        choices.append((settings.retarget.standing, ""))
    if settings.base is not None:
        choices.append((settings.base, settings.base_slot))
    slots = _own_slots(armature)
    others = [
        (each, slot.identifier)
        for each in actions_for(armature)
        for slot in each.slots
        if slot.identifier in slots
    ]
    choices += sorted([own, *others] if own is not None else others, key=_busy)
    for action, slot in choices:
        if is_generated(action):
            continue
        with suppress(ClipError):
            source = reader.source(armature, action, slot, visual=False)
            if source.landmarks is not None:
                return source
    return None


def _own_slots(armature: bpy.types.Object) -> set[str]:
    """Identifiers of slots that are an armature's: that of its name, those of its NLA strips, and
    that of its action, which files call as they like, unless another armature plays one of that
    name.
    """
    found = {f"OB{armature.name}"}
    own = own_action(armature)
    found |= {
        strip.action_slot.identifier
        for strip in strips_of(armature)
        if strip.action_slot is not None
    }
    if own is not None and own[1]:
        others = [each for each in bpy.data.objects if each.type == "ARMATURE" and each != armature]
        playing = {played[1] for each in others if (played := own_action(each)) is not None}
        found |= {own[1]} - playing
    return found


def _busy(choice: tuple[bpy.types.Action, str]) -> bool:
    """Whether an action's name does not say that somebody stands there."""
    name = choice[0].name.casefold()
    return not any(word in name for word in ("idle", "stand", "pose"))


def _check_landmarks(source: Source) -> None:
    """Ask for what cannot be told, with the name of whose it is."""
    bones = source.skeleton.index
    known = {} if source.landmarks is None else source.landmarks.bones
    missing = [each for each in LANDMARKS if each not in OPTIONAL and known.get(each) not in bones]
    if missing:
        problem = source.problem or phrase(
            "It is not known which bone is the {landmark}.", landmark=title(missing[0])
        )
        raise ClipError(
            phrase(
                "'{armature}' has no landmarks. {problem}",
                armature=source.armature,
                problem=as_phrase(problem),
            ),
            phrase(
                "Make '{armature}' active, click Find Landmarks in the panel Splice > Landmarks "
                "and choose there what it cannot find.",
                armature=source.armature,
            ),
        )


def filling_retargeted_clip(
    job: RetargetJob, clip: Clip, action: bpy.types.Action, posed: PoseValues
) -> Generator[None, None, None]:
    """Put the clip into an action that nobody plays yet, in steps; of the armature the pose is
    given.
    """
    armature = local_object(job.armature)
    channels = yield from clip_channels(armature, clip, posed)
    yield from filling_action(
        job.armature, action, clip.frames, channels, settings_note=job.note, repeats=clip.cyclic
    )


def write_retargeted_clip(
    job: RetargetJob, clip: Clip, name: str = "", *, stand_in: StandIn | None = None
) -> Retargeted:
    """Give the armature the clip as an action, in place of what was made of the same one before; it
    may be in one already.

    Raises:
        WriteError: the object is gone, or has become read-only.
    """
    armature = local_object(job.armature)
    writable_armature(armature)
    settings = splicing_settings(armature)
    _remember(settings, job)
    if stand_in is not None:
        action = play_clip(armature, stand_in)
    else:
        previous = previous_result(armature, job)
        name = name or job.result_name
        action = write_clip(armature, clip, name=name, note=job.note, previous=previous)
    if job.base.found and job.base.landmarks is not None:
        # What was used is what the table shows from now on.
        write_landmarks(settings.landmarks, job.base.landmarks.bones)
    return Retargeted(action.name, len(clip), tuple(_warnings(job)))


def _remember(settings: Any, job: RetargetJob) -> None:
    """Keep what the next one asks for: the armature's own action, which is not the armature's any
    more then; and where the clip is from, if that is still there.
    """
    retarget, source = settings.retarget, bpy.data.objects.get(job.source.armature)
    assign(retarget, "from_armature", source)
    clip = bpy.data.actions.get(job.source.clip.name) if source is not None else None
    assign(retarget, "from_action", clip)
    assign(retarget, "from_slot", job.slot)
    own = own_action(local_object(job.armature))
    if settings.retarget.standing is not None or own is None or is_generated(own[0]):
        return
    if own[0].name == job.base.clip.name:
        settings.retarget.standing = own[0]


def previous_result(armature: bpy.types.Object, job: RetargetJob) -> bpy.types.Action | None:
    """What was made of the same clip before and nobody has edited, unless it is spliced from."""
    return next(
        (
            action
            for action in bpy.data.actions
            if job.made(action) and may_replace(action, armature) and not is_source(action)
        ),
        None,
    )


def _warnings(job: RetargetJob) -> Iterator[str]:
    skeleton = job.still.skeleton
    assert job.base.landmarks is not None
    moved = [bone for bone in job.base.landmarks.bones.values() if bone in skeleton.index]
    held = [bone for bone in moved if skeleton.constrained[skeleton.index[bone]]]
    if held:
        listed = ", ".join(f"'{each}'" for each in held[:3])
        yield phrase(
            "Constraints or drivers act on {listed}{others}: mute them if the clip does not show.",
            listed=listed,
            others=phrase(" and others") if held[3:] else "",
        )


# --- Many clips -----------------------------------------------------------------------------------


class RetargetSession:
    """Many clips onto one armature, worked out one by one and written together: what is stopped on
    the way leaves nothing behind.

    Args:
        armature: that gets them.
        clips: of each, what it is called, and what to call for it: it reads the clip, and gives the
            job. What is refused by that is left out and told.
    """

    def __init__(
        self, armature: bpy.types.Object, clips: Sequence[tuple[str, Callable[[], RetargetJob]]]
    ) -> None:
        if not clips:
            raise ClipError("There is no clip to retarget.", "Choose one or more.")
        self.armature = armature.name
        self.refused: list[tuple[str, OctoMotionError]] = []
        self.made: list[Retargeted] = []
        self._clips = clips
        self._results: list[tuple[str, RetargetJob, Clip]] = []

    @property
    def target(self) -> bpy.types.Object:
        """The armature that gets them."""
        return local_object(self.armature)

    @property
    def current(self) -> str:
        """The clip whose turn it is, for people."""
        count = len(self._clips)
        number = min(len(self._results) + len(self.refused), count - 1)
        return phrase(
            "'{clip}' ({number} of {count})",
            clip=self._clips[number][0],
            number=number + 1,
            count=count,
        )

    def steps(self) -> Iterator[float]:
        """Work them out; yields the share of the work that is done."""
        for number, (name, prepare) in enumerate(self._clips, 1):
            try:
                job = prepare()
                self._results.append((name, job, job.compute()))
            except WriteError:
                raise
            except OctoMotionError as error:
                self.refused.append((name, error))
            yield number / len(self._clips)

    def end(self) -> RetargetSession:
        """Write what was worked out; the first clip is the armature's action then.

        Raises:
            OctoMotionError: all were refused, or the armature has become read-only.
        """
        if not self._results:
            name, error = self.refused[0]
            more = (
                phrase(" {count} more were refused.", count=len(self.refused) - 1)
                if self.refused[1:]
                else ""
            )
            raise ClipError(
                phrase("'{name}': {problem}", name=name, problem=error.problem),
                joined_phrases("", (error.remedy, more)),
            )
        # The first one last: that is the one that the armature has in the end.
        for name, job, clip in self._results[::-1]:
            written = write_retargeted_clip(job, clip, name)
            doubts = reference_doubts(job.source.clip, job.source.humanoid())
            self.made.append(replace(written, warnings=(*written.warnings, *doubts)))
            bpy.data.actions[self.made[-1].action].use_fake_user = True
        self.made.reverse()
        return self

    @property
    def message(self) -> str:
        """What was made, in a sentence."""
        count, frames = len(self.made), sum(each.frames for each in self.made)
        names = ", ".join(f"'{each.action}'" for each in self.made[:3])
        more = " …" if self.made[3:] else ""
        refused = phrase(" {count} refused.", count=len(self.refused)) if self.refused else ""
        word = phrase("clip") if count == 1 else phrase("clips")
        return phrase(
            "{count} {word}, {frames} frames: {names}{more}.{refused}",
            count=count,
            word=word,
            frames=frames,
            names=names,
            more=more,
            refused=refused,
        )


def file_clip(
    armature: str,
    path: Path,
    frame_start: int,
    reader: ClipReader,
    landmarks: Mapping[str, str] | None = None,
) -> Callable[[], RetargetJob]:
    """A clip of a file for :class:`RetargetSession`: imported, read, and taken away again.

    Args:
        armature: name of the object that gets it.
        path: the file.
        frame_start: where its first frame goes.
        reader: of the armature's own motions, the same for all clips.
        landmarks: bone names of the file's body by landmark, if they are known.
    """

    def prepare() -> RetargetJob:
        layer = bpy.context.view_layer
        assert layer is not None
        active = layer.objects.active
        kept = active.name if active is not None else ""
        chosen = {each.name for each in layer.objects if each.select_get(view_layer=layer)}
        imported = import_clip(path, bpy.context, frame_start)
        try:
            source = bpy.data.objects[imported.armatures[0]]
            if len(imported.armatures) > 1:
                raise ClipError(
                    phrase("The file has {count} armatures.", count=len(imported.armatures)),
                    "Import it, and choose the armature there.",
                )
            if landmarks:
                write_landmarks(splicing_settings(source).landmarks, landmarks)
            action = bpy.data.actions[imported.actions[0]]
            return prepare_retarget(local_object(armature), source, action, own=reader)
        finally:
            remove_clips([imported])
            layer.update()
            for each in layer.objects:
                each.select_set(each.name in chosen, view_layer=layer)
            layer.objects.active = layer.objects.get(kept)

    return prepare
