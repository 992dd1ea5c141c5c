# SPDX-License-Identifier: GPL-3.0-or-later
"""A stack of splices from settings to keys: read → plain arrays → compute → write.

:func:`prepare_splices` reads everything and finds everything that is wrong; a :class:`Stack`
computes on plain arrays alone; :func:`write_splices` changes the file.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Final, cast

import bpy
import numpy as np

from ...blender.animation import (
    Channel,
    closes,
    further_channels,
    read_clip,
    scaled_channels,
    writable_armature,
    write_clip,
)
from ...blender.rig import armature_data
from ...core.errors import ClipError, OctoMotionError, WriteError
from ...core.splicing.clip import Clip, average_pose, splice_window
from ...core.splicing.humanoid import LANDMARKS, OPTIONAL
from ...core.splicing.transfer import (
    CHAIN,
    LimbGoal,
    MappedClip,
    Part,
    Splice,
    SpliceError,
    SplicePreview,
    Suggestion,
    build_splices,
    chain_part,
    opposite_part,
    part_bones,
    part_named,
    suggest_timings,
)
from ..declared_settings import plain
from .bodies import known_landmarks
from .properties import splicing_settings, write_landmarks
from .timing_settings import is_slowed, read_timing

_FINER: Final = 4
"""Samples per frame of a clip that is slowed down, …"""
_MOST: Final = 20_000
"""… and how many of them at most."""


@dataclass(frozen=True, eq=False)
class Source(MappedClip):
    """A clip with what is known of its skeleton."""

    armature: str
    problem: str
    """Why there are no landmarks."""
    found: bool
    """Whether the landmarks were found just now: the armature's table is not filled."""


class ListedSpliceError(ClipError):
    """A splice of an armature's list cannot be built: says which, for people and for the panel."""

    def __init__(self, armature: str, number: int, name: str, error: OctoMotionError) -> None:
        super().__init__(f"'{name}' ({number + 1}): {error.problem}", error.remedy)
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

    @property
    def acting(self) -> list[Splice]:
        """Those that are not muted."""
        return [splice for splice in self.splices if splice is not None]

    def compute(self) -> Clip:
        """The whole result.

        Raises:
            ListedSpliceError: a bone or landmark is missing, or a timing makes no sense.
        """
        with self.naming():
            return build_splices(self.base.clip, self.base.landmarks, self.acting)

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
        """The same with another start of one splice."""
        splices = list(self.splices)
        splice = splices[number]
        if splice is not None:
            timing = replace(splice.timing, base_start=base_start, splice_start=splice_start)
            splices[number] = replace(splice, timing=timing)
        return replace(self, splices=tuple(splices))


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
            return f"'{self.action}': all splices are muted, so it is the base again."
        word = "splice" if self.splices == 1 else "splices"
        made = f"{self.splices} {word} on {self.frames} frames: '{self.action}'."
        return " ".join([made, *self.mappings])


# --- Reading -------------------------------------------------------------------------------------


def prepare_splices(armature: bpy.types.Object) -> Stack:
    """Read all that the stack of an armature needs. Nothing is changed.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """
    settings = splicing_settings(armature)
    writable_armature(armature)
    if len(settings.splices) == 0:
        raise ClipError(
            f"'{armature.name}' has no splices.", "Add one in the panel Splicing (Add Splice)."
        )
    reader = ClipReader()
    base = reader.base(armature)
    splices: list[Splice | None] = []
    for number, item in enumerate(settings.splices):
        try:
            splices.append(None if item.mute else _splice(reader, item, base))
        except OctoMotionError as error:
            raise ListedSpliceError(armature.name, number, item.name, error) from error
    return Stack(
        armature.name,
        base,
        tuple(splices),
        tuple(settings.splices.keys()),
        tuple(f"Mapping of '{whose}': {name} (saved)." for whose, name in reader.mappings.items()),
        tuple(reader.damaged),
    )


class ClipReader:
    """Reads clips, each of them once."""

    def __init__(self) -> None:
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
                f"'{armature.name}' has no base action, or it is gone.",
                "Choose the base in the panel Splicing.",
            )
        if settings.visual:
            _check_mixing(armature)
        return self.source(armature, settings.base, settings.base_slot, visual=settings.visual)

    def item(self, item: Any, *, slowed: bool) -> Source:
        """The clip of a splice; of one that is ``slowed`` what it does between its frames as well.

        Raises:
            OctoMotionError: it is gone, or cannot be read.
        """
        remedy = "Choose it in the panel Splicing, mute the splice or remove it."
        if item.source is None:
            raise ClipError("Its source armature is gone, or was never chosen.", remedy)
        if item.action is None:
            raise ClipError("Its action is gone, or was never chosen.", remedy)
        # To play the scene takes longer.
        between = slowed and not item.visual
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
        key = (armature.name_full, action.name_full, slot, visual, between)
        if key not in self._sources:
            chosen = None
            if slot:
                chosen = action.slots.get(slot)
                if chosen is None:
                    raise ClipError(
                        f"Action '{action.name}' has no slot '{slot[2:]}'.",
                        "Choose one of its slots in the panel Splicing, or leave the slot empty.",
                    )
            clip = read_clip(armature, action, chosen, visual=visual)
            finer = min(_FINER, _MOST // len(clip)) if between else 1
            if finer > 1:
                count = finer * (len(clip) - 1) + 1
                frames = np.linspace(clip.frames[0], clip.frames[-1], count)
                clip = read_clip(armature, action, chosen, visual=visual, frames=frames)
            known = known_landmarks(armature, clip.skeleton, average_pose(clip))
            self.damaged |= dict.fromkeys(known.damaged)
            if known.mapping:
                self.mappings[armature.name] = known.mapping
            self._sources[key] = Source(
                clip, known.landmarks, armature.name, known.problem, known.found
            )
        return self._sources[key]


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
            f"As shown, the base would be mixed with the NLA tracks of '{armature.name}' twice.",
            "In the NLA editor set the action's Blending to Replace and its Influence to 1, mute "
            "the tracks, or turn off Base As Shown.",
        )


def _splice(reader: ClipReader, item: Any, base: Source) -> Splice:
    timing = read_timing(splicing_settings(item.id_data), item, base.clip)
    source = reader.item(item, slowed=is_slowed(timing))
    part = _part(item, base, source)
    splice = Splice(
        part=part,
        clip=source.clip,
        timing=timing,
        landmarks=source.landmarks,
        goal=cast("LimbGoal", item.mode.lower()),
        # The panel offers it for legs alone.
        travel=item.with_travel and part.kind is not None and part.kind.travels,
        foot_lock=item.foot_lock,
        clavicle=item.with_clavicle,
        seen_from=item.seen_from.lower(),
        mirror=item.mirror,
    )
    if part.kind is not None:
        for each in (base, source):
            _check_landmarks(splice, each)
    # What only both together can tell.
    splice.retargets(base)
    return splice


def _part(item: Any, base: Source, source: Source) -> Part:
    name = item.part.lower()
    if name != CHAIN.name:
        return part_named(name)
    if not item.bone:
        raise ClipError("Its chain has no first bone.", "Choose it in the panel Splicing.")
    part = chain_part(item.bone, item.source_bone)
    for each, bone in ((base, part.root), (source, part.splice_root)):
        if bone not in each.clip.skeleton.index:
            raise ClipError(
                f"'{each.armature}' has no bone '{bone}', the first of its chain.",
                "Choose the first bones in the panel Splicing.",
            )
    return part


def _check_landmarks(splice: Splice, source: Source) -> None:
    """Ask for what cannot be told, with the name of whose it is."""
    remedy = (
        f"Make '{source.armature}' active, click Find Landmarks in the panel Splicing > Landmarks "
        "and choose there what it cannot find."
    )
    if source.landmarks is None:
        raise ClipError(f"'{source.armature}' has no landmarks. {source.problem}", remedy)
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
        raise ClipError(f"'{source.armature}': {error.problem}", remedy) from None


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
            "Drag the timing instead, or fill the table in the panel Splicing > Landmarks.",
        )
    found = suggest_timings(stack.base, splice.mapped, splice.timing, count)
    if not found:
        raise ClipError(
            "There is no moment at which enough of the two motions overlaps.",
            "Begin the clip earlier (Clip Start), or drag the timing.",
        )
    return found


# --- Writing -------------------------------------------------------------------------------------


def write_splices(stack: Stack, clip: Clip) -> SpliceSummary:
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
    besides, lost = _besides(armature, stack, clip)
    kept, settings.result = settings.result, None
    try:
        action = write_clip(
            armature,
            clip,
            name=f"{stack.base.clip.name} Spliced",
            # What it was made from.
            note=json.dumps(plain(settings, without=frozenset({"result"})), sort_keys=True),
            previous=previous,
            besides=besides,
        )
    except BaseException:
        settings.result = kept
        raise
    settings.result = action
    if stack.base.found and stack.base.landmarks is not None:
        # What was used is what the table shows from now on.
        write_landmarks(settings.landmarks, stack.base.landmarks.bones)
    warnings = list(_warnings(stack, settings.splices))
    if clip.cyclic and closes(stack.base.clip.rotations) and not closes(clip.rotations):
        warnings.append(
            f"'{stack.base.clip.name}' is a cycle, but '{action.name}' ends in another pose than "
            "it begins in: it does not repeat."
        )
    if lost:
        verbs = "is scaled and loses its" if len(lost) == 1 else "are scaled and lose their"
        warnings.append(f"{_listed(lost)} {verbs} size: of what they carry a part is spliced.")
    warnings += stack.damaged
    return SpliceSummary(action.name, len(clip), len(stack.acting), tuple(warnings), stack.mappings)


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
        if not splice_window(timing, base, clip).weights.any():
            whose, start, frames = ", and the base", timing.base_start, base.frames
            if timing.after == "stop" and timing.splice_start >= clip.frames[-1]:
                whose = " of its clip, which"
                start, frames = timing.splice_start, clip.frames
            yield (
                f"'{item.name}' changes nothing: it begins at frame {start:g}"
                f"{whose} has frames {frames[0]:g} to {frames[-1]:g}."
            )
        constrained |= dict.fromkeys(_constrained(stack.base, splice))
    if constrained:
        whose = "its" if len(constrained) == 1 else "their"
        yield (
            f"Constraints or drivers act on {_listed(constrained)} after {whose} keys: mute them "
            "if the splice does not show."
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


def _besides(
    armature: bpy.types.Object, stack: Stack, clip: Clip
) -> tuple[list[Channel], list[str]]:
    """What the base moves besides the body, as it does; and bones that lose their size."""
    settings = splicing_settings(armature)
    if settings.base is None:
        return [], []
    slot = settings.base.slots.get(settings.base_slot) if settings.base_slot else None
    found = further_channels(armature, settings.base, slot, clip.frames)
    if settings.visual:
        return found, []
    changed = {bone for each in stack.acting for bone in _changed(stack.base, each)}
    scaled, lost = scaled_channels(armature, settings.base, slot, clip.frames, changed)
    return found + scaled, lost


def _changed(base: Source, splice: Splice) -> tuple[str, ...]:
    """Names of the base's bones that a splice moves otherwise."""
    marks = base.landmarks
    bones = part_bones(splice.part, base.clip.skeleton, marks, clavicle=splice.clavicle)
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
        raise WriteError(f"'{name}' is gone.", "Build again.") from None
    return found
