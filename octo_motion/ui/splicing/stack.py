# SPDX-License-Identifier: GPL-3.0-or-later
"""A stack of splices from settings to keys: read → plain arrays → compute → write.

:func:`prepare_splices` reads everything and finds everything that is wrong; a :class:`Stack`
computes on plain arrays alone; :func:`write_splices` changes the file.
"""

from __future__ import annotations

import json
from collections.abc import Container, Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, Final, cast

import bpy
import numpy as np

from ...blender.animation import (
    STEP,
    PoseValues,
    SplicedMotion,
    StandIn,
    UnkeyedPose,
    check_layers,
    closes,
    filling_layer,
    filling_spliced,
    further_channels,
    is_recorded,
    marking_generated,
    play_layer,
    play_spliced,
    read_clip,
    reading_clip,
    resized_bones,
    slot_of,
    writable_armature,
    write_clip,
    write_layer,
    write_spliced,
)
from ...blender.rig import armature_data
from ...core.errors import ClipError, OctoMotionError, WriteError
from ...core.locomotion.ground import Ground
from ...core.phrases import as_phrase, joined_phrases, phrase
from ...core.skeleton import Skeleton
from ...core.splicing.clip import (
    Clip,
    average_pose,
    clip_at,
    moments_within,
    splice_span,
    splice_window,
)
from ...core.splicing.humanoid import LANDMARKS, OPTIONAL
from ...core.splicing.transfer import (
    CHAIN,
    LimbGoal,
    MappedClip,
    Matches,
    Part,
    Reference,
    SeenFrom,
    Splice,
    SpliceError,
    SplicePreview,
    Suggestion,
    building_splices,
    chain_part,
    numbered,
    opposite_part,
    part_bones,
    part_named,
    suggest_timings,
    whole_limbs,
)
from ...core.steps import finished
from ..declared_settings import plain
from .bodies import known_landmarks
from .mesh_ground import mesh_ground
from .properties import splicing_settings, write_landmarks, write_reference
from .timing_settings import read_timing, read_weight

_FINEST: Final = 4
"""Moments per frame of what is played, …"""
_FINE: Final = 2
"""… and of a motion that would have more than so many:"""
_MANY: Final = 10_000


@dataclass(frozen=True, eq=False)
class Source(MappedClip):
    """A clip with what is known of its skeleton."""

    armature: str
    problem: str
    """Why there are no landmarks."""
    found: bool
    """Whether the landmarks were found just now: the armature's table is not filled."""
    lies: Skeleton | None = None
    """Its bones as they lie on the average, of a clip that moves."""


class ListedSpliceError(ClipError):
    """A splice of an armature's list cannot be built: says which, for people and for the panel."""

    def __init__(self, armature: str, number: int, name: str, error: OctoMotionError) -> None:
        super().__init__(
            phrase(
                "'{name}' ({number}): {problem}",
                name=name,
                number=number + 1,
                problem=error.problem,
            ),
            error.remedy,
        )
        self.armature = armature
        self.number = number
        """Its place in the list, counted from 0."""

    def select(self) -> None:
        """Make it the active one of the list."""
        splicing_settings(local_object(self.armature)).active_splice = self.number


@dataclass(frozen=True, eq=False)
class Stack:
    """A base and all that goes onto it, as plain data; see :func:`prepare_splices`."""

    armature: str
    """Name of the object: references to Blender's data do not outlive a modal operator's tick."""
    base: Source
    splices: tuple[Splice | None, ...]
    """In the order of the list; none for one that is muted."""
    names: tuple[str, ...]
    """What the splices are called in the list."""
    mappings: tuple[str, ...] = ()
    """Whose landmarks are from saved mappings: sentences."""
    damaged: tuple[str, ...] = ()
    """What is wrong with saved mappings that could not be used: sentences."""
    finer: Clip | None = None
    """The base at the moments that matter, see :func:`read_between`; none where it can only be read
    on whole frames."""
    anew: tuple[str, ...] = ()
    """Bones that cannot keep the base's curves, …"""
    resized: tuple[str, ...] = ()
    """… because these above them are scaled, and lose their size."""

    @property
    def result_name(self) -> str:
        """What a new result is called."""
        return f"{self.base.clip.name} Spliced"

    @property
    def acting(self) -> list[Splice]:
        """Those that are not muted."""
        return [splice for splice in self.splices if splice is not None]

    def compute(self) -> SplicedMotion:
        """What :meth:`computing` comes to."""
        return finished(self.computing())

    def computing(self) -> Generator[None, None, SplicedMotion]:
        """The result beside the base, in steps.

        Raises:
            ListedSpliceError: a bone or landmark is missing, or a timing makes no sense.
        """
        base, marks = self.base.clip, self.base.landmarks
        first, last = float(base.frames[0]), float(base.frames[-1])
        anew = None
        with self.naming():
            if self.finer is None or self.anew:
                anew = yield from building_splices(base, marks, self.acting)
            if self.finer is None:
                assert anew is not None
                return SplicedMotion(base, anew, first, last, anew, base.skeleton.names)
            result = yield from building_splices(base, marks, self.acting, self.finer)
        return SplicedMotion(self.finer, result, first, last, anew, self.anew)

    def preview(self, number: int) -> SplicePreview:
        """The result at single frames, while this splice of the list is timed; none that is muted.

        Raises:
            ListedSpliceError: a bone or landmark is missing, or a timing makes no sense.
        """
        beneath = sum(each is not None for each in self.splices[:number])
        with self.naming():
            return SplicePreview(self.base.clip, self.base.landmarks, self.acting, beneath)

    @contextmanager
    def naming(self) -> Iterator[None]:
        """Say of what is wrong with one of those that act which of the list it is."""
        try:
            yield
        except SpliceError as error:
            acting = [number for number, each in enumerate(self.splices) if each is not None]
            number = acting[error.number]
            raise ListedSpliceError(self.armature, number, self.names[number], error) from error

    def retimed(self, number: int, base_start: float, splice_start: float) -> Stack:
        """The same with another start of one splice; what lies between frames is to be read."""
        splices = list(self.splices)
        splice = splices[number]
        if splice is not None:
            timing = replace(splice.timing, base_start=base_start, splice_start=splice_start)
            splices[number] = replace(splice, timing=timing)
        return replace(self, splices=tuple(splices), finer=None, anew=(), resized=())


@dataclass(frozen=True)
class SpliceSummary:
    """What was made, for people and for reports."""

    action: str
    frames: int
    splices: int
    """How many were not muted."""
    warnings: tuple[str, ...] = ()
    """What one may not see on the armature, and why: sentences."""
    mappings: tuple[str, ...] = ()
    """Whose landmarks are from saved mappings: sentences."""

    @property
    def message(self) -> str:
        """One sentence, and where landmarks are from."""
        if self.splices == 0:
            return phrase(
                "'{action}': all splices are muted, so it is the base again.", action=self.action
            )
        word = phrase("splice") if self.splices == 1 else phrase("splices")
        made = phrase(
            "{splices} {word} on {frames} frames: '{action}'.",
            splices=self.splices,
            word=word,
            frames=self.frames,
            action=self.action,
        )
        return joined_phrases(" ", (made, *self.mappings))


# --- Reading -------------------------------------------------------------------------------------


def prepare_splices(
    armature: bpy.types.Object, *, between: bool = True, kept: KeptClips | None = None
) -> Stack:
    """Read all that the stack of an armature needs. Nothing is changed.

    Args:
        armature: the armature object.
        between: whether the base is read between frames as well, to be built.
        kept: what is known to be as it was when it was read before.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """
    settings = splicing_settings(armature)
    writable_armature(armature)
    if len(settings.splices) == 0:
        raise ClipError(
            phrase("'{armature}' has no splices.", armature=armature.name),
            "Add one in the panel Splice (Add Splice).",
        )
    reader = ClipReader(kept)
    base = reader.base(armature)
    splices: list[Splice | None] = []
    for number, item in enumerate(settings.splices):
        try:
            splices.append(None if item.mute else _splice(reader, item, base))
        except OctoMotionError as error:
            raise ListedSpliceError(armature.name, number, item.name, error) from error
    stack = Stack(
        armature.name,
        base,
        tuple(splices),
        tuple(settings.splices.keys()),
        tuple(
            phrase("Mapping of '{whose}': {name} (saved).", whose=whose, name=name)
            for whose, name in reader.mappings.items()
        ),
        tuple(reader.damaged),
    )
    return read_between(stack) if between else stack


def read_between(stack: Stack) -> Stack:
    """What :func:`reading_between` comes to."""
    return finished(reading_between(stack))


def reading_between(
    stack: Stack, unkeyed: UnkeyedPose | None = None
) -> Generator[None, None, Stack]:
    """Read the base where its splices act, between frames as well: what is spliced is to be right
    there too. As shown, a base is read on whole frames alone, and all its bones get keys.

    In steps, between which the base must not get or lose curves; the armature's unkeyed pose may
    be known.

    Raises:
        OctoMotionError: it has become something that cannot be read.
    """
    armature = local_object(stack.armature)
    settings = splicing_settings(armature)
    if settings.visual or settings.base is None:
        return stack
    base = stack.base.clip
    spans = []
    for number, each in enumerate(stack.acting):
        with stack.naming(), numbered(number):
            start, end = splice_span(each.timing, base, each.clip)
        # Where legs have led to stays so until the end.
        spans.append((start, np.inf if each.travel else end))
    moments = moments_within(base, spans, _finer(len(base)), STEP)
    slot = _slot(settings.base, settings.base_slot)
    finer = base
    yield
    if len(moments) and is_recorded(armature, settings.base, slot):
        yield
        finer = yield from clip_at(base, moments)
    elif len(moments):
        finer = yield from reading_clip(
            armature, settings.base, slot, frames=moments, unkeyed=unkeyed
        )
    yield
    finer = replace(finer, cyclic=base.cyclic)
    changed = {bone for each in stack.acting for bone in _changed(stack.base, each)}
    yield
    lost, anew = resized_bones(armature, settings.base, slot, base.frames, changed, unkeyed=unkeyed)
    return replace(stack, finer=finer, anew=tuple(anew), resized=tuple(lost))


def _finer(frames: int) -> int:
    """How many moments per frame are looked at."""
    return _FINEST if _FINEST * frames <= _MANY else _FINE


def _slot(action: bpy.types.Action, identifier: str) -> bpy.types.ActionSlot | None:
    return action.slots.get(identifier) if identifier else None


@dataclass
class KeptClips:
    """Clips as they were read, for as long as they are so."""

    clips: dict[tuple[Any, ...], tuple[Clip, Skeleton]] = field(
        default_factory=dict[tuple[Any, ...], tuple[Clip, Skeleton]]
    )
    """With how their bones lie on the average, by the numbers that Blender gives armature and
    action for as long as it runs, and how they are read."""
    matches: Matches = field(default_factory=Matches)
    """Which bones of them answer to each other."""

    def forget(self, numbers: Container[int]) -> None:
        """Read clips of these armatures and actions again."""
        gone = [key for key in self.clips if key[0] in numbers or key[1] in numbers]
        for key in gone:
            del self.clips[key]
        if gone:
            self.matches.clear()


class ClipReader:
    """Reads clips, each of them once."""

    def __init__(self, kept: KeptClips | None = None) -> None:
        self.kept = kept or KeptClips()
        self.mappings: dict[str, str] = {}
        """Saved mappings that were used, by the armatures' names."""
        self.damaged: dict[str, None] = {}
        """What is wrong with saved mappings that could not be used: sentences."""
        self._sources: dict[tuple[Any, ...], Source] = {}

    def base(self, armature: bpy.types.Object) -> Source:
        """The base of an armature's stack.

        Raises:
            OctoMotionError: there is none, or it cannot be read.
        """
        settings = splicing_settings(armature)
        if settings.base is None:
            raise ClipError(
                phrase("'{armature}' has no base action, or it is gone.", armature=armature.name),
                "Choose the base in the panel Splice.",
            )
        if settings.visual and settings.result_as == "LAYER":
            raise ClipError(
                "As shown, a base has its NLA in it: a layer over that would not be it any more.",
                "Choose New Action as the Result, or turn off Base As Shown.",
            )
        if settings.visual:
            _check_mixing(armature)
        return self.source(armature, settings.base, settings.base_slot, visual=settings.visual)

    def item(self, item: Any) -> Source:
        """The clip of a splice.

        Raises:
            OctoMotionError: it is gone, or cannot be read.
        """
        remedy = "Choose it in the panel Splice, mute the splice or remove it."
        if item.source is None:
            raise ClipError("Its source armature is gone, or was never chosen.", remedy)
        if item.action is None:
            raise ClipError("Its action is gone, or was never chosen.", remedy)
        # What a clip does between its frames is seen where it is slowed down, and between those of
        # the result. To play the scene takes longer.
        between = not item.visual
        return self.source(item.source, item.action, item.slot, visual=item.visual, between=between)

    def source(
        self,
        armature: bpy.types.Object,
        action: bpy.types.Action,
        slot: str,
        *,
        visual: bool,
        between: bool = False,
    ) -> Source:
        """A clip by armature, action, and identifier of its slot ("" for the one that fits).

        ``visual``: as the scene shows it; ``between``: between whole frames as well.
        """
        key = (armature.session_uid, action.session_uid, slot, visual, between)
        if key not in self._sources:
            if key not in self.kept.clips:
                clip = self._read(armature, action, slot, visual=visual, between=between)
                self.kept.clips[key] = clip, average_pose(clip)
            clip, lies = self.kept.clips[key]
            known = known_landmarks(armature, clip.skeleton, lies)
            self.damaged |= dict.fromkeys(known.damaged)
            if known.mapping:
                self.mappings[armature.name] = known.mapping
            self._sources[key] = Source(
                clip, known.landmarks, armature.name, known.problem, known.found, lies
            )
        return self._sources[key]

    @staticmethod
    def _read(
        armature: bpy.types.Object,
        action: bpy.types.Action,
        slot: str,
        *,
        visual: bool,
        between: bool,
    ) -> Clip:
        chosen = None
        if slot:
            chosen = action.slots.get(slot)
            if chosen is None:
                raise ClipError(
                    phrase(
                        "Action '{action}' has no slot '{slot}'.",
                        action=action.name,
                        slot=slot[2:],
                    ),
                    "Choose one of its slots in the panel Splice, or leave the slot empty.",
                )
        clip = read_clip(armature, action, chosen, visual=visual)
        if between and not is_recorded(armature, action, chosen):
            finer = _finer(len(clip))
            count = finer * (len(clip) - 1) + 1
            frames = np.linspace(clip.frames[0], clip.frames[-1], count)
            clip = read_clip(armature, action, chosen, visual=visual, frames=frames)
        return clip


def _check_mixing(armature: bpy.types.Object) -> None:
    """As shown, a base has its NLA tracks in it; so the result must act alone."""
    data = armature.animation_data
    if data is None or not data.use_nla:
        return
    acting = any(len(track.strips) and not track.mute for track in data.nla_tracks)
    if not acting:
        return
    if data.action_blend_type != "REPLACE" or data.action_influence < 1.0:
        raise ClipError(
            phrase(
                "As shown, the base would be mixed with the NLA tracks of '{armature}' twice.",
                armature=armature.name,
            ),
            "In the NLA editor set the action's Blending to Replace and its Influence to 1, mute "
            "the tracks, or turn off Base As Shown.",
        )


def _ground(item: Any, part: Part) -> Ground | None:
    """What locked feet stand on, if it is a mesh."""
    if item.ground is None or not (item.foot_lock and _travels(item, part)):
        return None
    return mesh_ground(item.ground)


def _splice(reader: ClipReader, item: Any, base: Source) -> Splice:
    timing = read_timing(splicing_settings(item.id_data), item, base.clip)
    source = reader.item(item)
    part = _part(item, base, source)
    splice = Splice(
        part=part,
        # Of another body, which of its bones turn with their parents tells nothing.
        clip=source.clip if source.armature == base.armature else source.clip.inheriting,
        timing=timing,
        landmarks=source.landmarks,
        goal=cast("LimbGoal", item.mode.lower()),
        travel=_travels(item, part),
        foot_lock=item.foot_lock,
        ground=_ground(item, part),
        clavicle=item.with_clavicle,
        seen_from=cast("SeenFrom", "" if item.seen_from == "AUTO" else item.seen_from.lower()),
        mirror=item.mirror,
        weight=read_weight(splicing_settings(item.id_data), item, base.clip),
        additive=item.blending == "ADD",
        reference=_reference(item),
        matches=reader.kept.matches,
    )
    if part.kind is not None:
        for each in (base, source):
            _check_landmarks(splice, each)
    # What only both together can tell.
    splice.retargets(base)
    return splice


def _travels(item: Any, part: Part) -> bool:
    """The panel offers it for legs alone, and where the clip takes the place of the base."""
    legs = part.kind is not None and part.kind.travels
    return item.with_travel and legs and item.blending != "ADD"


def _reference(item: Any) -> Reference:
    if item.reference == "FRAME":
        return float(item.reference_frame)
    return "rest" if item.reference == "REST" else "first"


def _part(item: Any, base: Source, source: Source) -> Part:
    name = item.part.lower()
    if name != CHAIN.name:
        return part_named(name)
    if not item.bone:
        raise ClipError("Its chain has no first bone.", "Choose it in the panel Splice.")
    part = chain_part(item.bone, item.source_bone)
    for each, bone in ((base, part.root), (source, part.splice_root)):
        if bone not in each.clip.skeleton.index:
            raise ClipError(
                phrase(
                    "'{armature}' has no bone '{bone}', the first of its chain.",
                    armature=each.armature,
                    bone=bone,
                ),
                "Choose the first bones in the panel Splice.",
            )
    return part


def _check_landmarks(splice: Splice, source: Source) -> None:
    """Ask for what cannot be told, with the name of whose it is."""
    remedy = phrase(
        "Make '{armature}' active, click Find Landmarks in the panel Splice > Landmarks and "
        "choose there what it cannot find.",
        armature=source.armature,
    )
    if source.landmarks is None:
        raise ClipError(
            phrase(
                "'{armature}' has no landmarks. {problem}",
                armature=source.armature,
                problem=as_phrase(source.problem),
            ),
            remedy,
        )
    part = splice.part
    if splice.mirror and source.clip is splice.clip:
        # What the clip has to have is on its other side.
        part = opposite_part(part)
    own = replace(splice, part=part, clip=source.clip, landmarks=source.landmarks, mirror=False)
    try:
        own.retargets(source)
    except ClipError as error:
        known = source.landmarks.bones
        bones = source.clip.skeleton.index
        asked = any(known.get(each) not in bones for each in LANDMARKS if each not in OPTIONAL)
        # With all landmarks there, it is the rig that does not serve.
        remedy = remedy if asked else error.remedy
        raise ClipError(
            phrase("'{armature}': {problem}", armature=source.armature, problem=error.problem),
            remedy,
        ) from None


def suggestions(stack: Stack, number: int, count: int) -> list[Suggestion]:
    """The best starts of a splice, best first.

    Raises:
        ClipError: it is muted, one of the bodies has no legs, or too little overlaps.
    """
    splice = stack.splices[number]
    if splice is None:
        raise ClipError("The splice is muted.", "Unmute it, then ask for its timing.")
    if stack.base.landmarks is None or splice.landmarks is None:
        raise ClipError(
            "Timing is suggested from what the legs do, and one of the two has no landmarks.",
            "Drag the timing instead, or fill the table in the panel Splice > Landmarks.",
        )
    found = suggest_timings(stack.base, splice.mapped, splice.timing, count)
    if not found:
        raise ClipError(
            "There is no moment at which enough of the two motions overlaps.",
            "Begin the clip earlier (Clip Start), or drag the timing.",
        )
    return found


# --- Writing -------------------------------------------------------------------------------------


NO_SETTINGS: Final = frozenset(
    {"result", "live", "live_error", "from_armature", "from_action", "from_slot"}
)
"""What is no setting, though it is kept with them."""


@dataclass(frozen=True, eq=False)
class Filled:
    """A result that is in an action already, which waits to be played."""

    stand_in: StandIn
    unkeyed: UnkeyedPose
    """The armature's, before anything of it was shown, …"""
    posed: PoseValues
    """… and how it was posed."""


def filling_splices(
    stack: Stack, motion: SplicedMotion, filled: Filled
) -> Generator[None, None, None]:
    """Fill it, in steps, between which neither the base's action nor the armature's may get or lose
    curves. As shown, a base cannot be read in steps, and nothing is filled.
    """
    armature = local_object(stack.armature)
    settings, unkeyed, stand_in = splicing_settings(armature), filled.unkeyed, filled.stand_in
    base, slot = _base_slot(armature, settings)
    motion = _repeating(stack, motion)

    def target() -> bpy.types.Action:
        return stand_in.action

    yield
    if settings.result_as == "LAYER":
        check_layers(armature)
        filling = filling_layer(
            armature, base, slot, motion, target=target, unkeyed=unkeyed, posed=filled.posed
        )
    else:
        path = settings.path_from_id("splices")
        filling = filling_spliced(
            *(armature, base, slot, motion),
            target=target,
            unkeyed=unkeyed,
            posed=filled.posed,
            settings=path,
        )
    action = yield from filling
    yield from marking_generated(stack.armature, action, _note(settings))


def write_splices(
    stack: Stack, motion: SplicedMotion, filled: Filled | None = None
) -> SpliceSummary:
    """Give the armature the result, in place of the one that was built before.

    Raises:
        WriteError: the object is gone, or has become read-only.
    """
    armature = local_object(stack.armature)
    writable_armature(armature)
    settings = splicing_settings(armature)
    previous = settings.result
    if previous is not None and is_source(previous):
        # Someone splices from it: it stays as it is.
        previous = None
    kept, settings.result = settings.result, None
    try:
        motion = _repeating(stack, motion)
        action = (
            _write(armature, stack, motion, previous) if filled is None else _play(armature, filled)
        )
    except BaseException:
        settings.result = kept
        raise
    settings.result = action
    if stack.base.found and stack.base.landmarks is not None:
        # What was used is what the table shows from now on.
        write_landmarks(settings.landmarks, stack.base.landmarks.bones)
        write_reference(settings.landmarks, stack.base.landmarks.reference)
    warnings = list(_warnings(stack, settings.splices))
    if stack.base.clip.cyclic and not motion.result.cyclic:
        warnings.append(
            phrase(
                "'{clip}' is a cycle, but '{action}' ends in another pose than it begins in: it "
                "does not repeat.",
                clip=stack.base.clip.name,
                action=action.name,
            )
        )
    lost = stack.resized
    if lost:
        told = phrase(
            "{bones} is scaled and loses its size: of what it carries a part is spliced."
            if len(lost) == 1
            else "{bones} are scaled and lose their size: of what they carry a part is spliced.",
            bones=_listed(lost),
        )
        warnings.append(told)
    warnings += stack.damaged
    frames = len(stack.base.clip)
    return SpliceSummary(action.name, frames, len(stack.acting), tuple(warnings), stack.mappings)


def _write(
    armature: bpy.types.Object,
    stack: Stack,
    motion: SplicedMotion,
    previous: bpy.types.Action | None,
) -> bpy.types.Action:
    settings = splicing_settings(armature)
    name, note = stack.result_name, _note(settings)
    base, slot = settings.base, None
    if base is not None:
        slot = _slot(base, settings.base_slot)
    if stack.finer is None or base is None:
        frames = motion.result.frames
        besides = [] if base is None else further_channels(armature, base, slot, frames)
        return write_clip(
            armature, motion.result, name=name, note=note, previous=previous, besides=besides
        )
    if settings.result_as == "LAYER":
        return write_layer(armature, base, slot, motion, name=name, note=note, previous=previous)
    return write_spliced(
        armature,
        base,
        slot,
        motion,
        name=name,
        note=note,
        previous=previous,
        settings=settings.path_from_id("splices"),
    )


def _play(armature: bpy.types.Object, filled: Filled) -> bpy.types.Action:
    settings = splicing_settings(armature)
    if settings.result_as == "LAYER":
        return play_layer(armature, filled.stand_in, *_base_slot(armature, settings))
    return play_spliced(armature, filled.stand_in, filled.unkeyed)


def _base_slot(
    armature: bpy.types.Object, settings: Any
) -> tuple[bpy.types.Action, bpy.types.ActionSlot]:
    base = settings.base
    return base, _slot(base, settings.base_slot) or slot_of(armature, base)


def _note(settings: Any) -> str:
    """What a result was made from."""
    return json.dumps(plain(settings, without=NO_SETTINGS), sort_keys=True)


def _repeating(stack: Stack, motion: SplicedMotion) -> SplicedMotion:
    """The same as a cycle, if it is one: that of a cycle is, if it closes as far as that does."""
    base, result = stack.base.clip, motion.result
    cyclic = base.cyclic and (closes(result.rotations) or not closes(base.rotations))
    return replace(motion, result=replace(result, cyclic=cyclic))


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f"'{each}'" for each in names)


def _warnings(stack: Stack, items: Any) -> Iterator[str]:
    """Why something that was built cannot be seen."""
    base = stack.base.clip
    constrained: dict[str, None] = {}
    for splice, item in zip(stack.splices, items, strict=False):
        if splice is None:
            continue
        timing, clip = splice.timing, splice.clip
        if splice.weight is not None and not splice.weight[1].any():
            yield phrase("'{item}' changes nothing: its weight is 0.", item=item.name)
        elif not splice_window(timing, base, clip).weights.any():
            whose, start = phrase(", and the base"), timing.base_start
            frames = base.frames
            if timing.after == "stop" and timing.splice_start >= clip.frames[-1]:
                whose = phrase(" of its clip, which")
                start, frames = timing.splice_start, clip.frames
            yield (
                phrase(
                    "'{item}' changes nothing: it begins at frame {start:g}{whose} has frames "
                    "{first:g} to {last:g}.",
                    item=item.name,
                    start=start,
                    whose=whose,
                    first=frames[0],
                    last=frames[-1],
                )
            )
        constrained |= dict.fromkeys(_constrained(stack.base, splice))
    if constrained:
        whose = "its" if len(constrained) == 1 else "their"
        yield (
            phrase(
                "Constraints or drivers act on {listed} after {whose} keys: mute them if the "
                "splice does not show.",
                listed=_listed(constrained),
                whose=whose,
            )
        )


def _constrained(base: Source, splice: Splice) -> list[str]:
    """Bones of a splice that constraints or drivers move, of a body those that are landmarks."""
    skeleton, part = base.clip.skeleton, splice.part
    bones = _changed(base, splice)
    if part.kind is not None and base.landmarks is not None:
        # Rigs have machinery beneath them that is to follow.
        known = set(base.landmarks.bones.values())
        bones = tuple(each for each in bones if each in known)
    return [each for each in bones if skeleton.constrained[skeleton.index[each]]]


def _changed(base: Source, splice: Splice) -> tuple[str, ...]:
    """Names of the base's bones that a splice moves otherwise."""
    marks = base.landmarks
    skeleton = base.skeleton if splice.part.kind is None else whole_limbs(base)[0].skeleton
    bones = part_bones(splice.part, skeleton, marks, clavicle=splice.clavicle)
    return (*bones, marks["hips"]) if splice.travel and marks is not None else bones


def is_source(action: bpy.types.Action) -> bool:
    """Whether any stack in the file is made from this action."""
    for each in bpy.data.objects:
        if each.type != "ARMATURE":
            continue
        group = cast("Any", each).octo_motion.splicing
        if group.base == action or any(item.action == action for item in group.splices):
            return True
    return False


def local_object(name: str) -> bpy.types.Object:
    """An armature of this file by name.

    Raises:
        WriteError: it is gone.
    """
    try:
        found = bpy.data.objects[name, None]  # type: ignore[index]
        armature_data(found)
    except KeyError:
        raise WriteError(phrase("'{name}' is gone.", name=name), "Build again.") from None
    return found
