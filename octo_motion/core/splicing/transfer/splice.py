# SPDX-License-Identifier: GPL-3.0-or-later
"""Splicing: a part of one clip put onto another, and stacks of such splices.

After Takebayashi, Nishio and Kobori, "Motion synthesis based on splicing of parts" [Splice]: what
is kept of a part is where it lies as seen from the chest (the trunk: from the pelvis), and a
splice's result can be the base of the next. Beyond the source: legs are seen from the pelvis,
unless asked otherwise, for a chest that bows would lift them off the ground; a limb may reach for
the exact point; clavicles may belong to the arm.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from ...errors import ClipError, OctoMotionError
from ...phrases import phrase
from ...rotations import (
    IDENTITY,
    Floats,
    conjugate,
    multiply,
)
from ...steps import finished
from ..clip import (
    Clip,
    Posture,
    SpliceWindow,
    Timing,
    posture_of,
    sample_clip,
    sample_scales,
    splice_window,
)
from ..humanoid import Landmarks
from .easing import ease
from .foot_lock import GroundHeight
from .leg_travel import LegTravel, ground_height
from .mirror import mirror_name, mirrored_clip
from .parts import Part, SeenFrom
from .rehung import whole_limbs
from .retarget import (
    MappedClip,
    ReferredClip,
    Retarget,
    compared,
    find_retargets,
    writing_retargeted,
)
from .travel_lock import SIGHT, TravelLock

LimbGoal = Literal["direction", "exact"]

Reference = Literal["first", "rest"] | float
"""Of a clip: its first frame, its rest pose (or the reference pose that was found), or a frame."""


@dataclass(frozen=True)
class Matches:
    """What was found of how clips go onto each other, by all that was asked; with it the clips: as
    long as they are kept no others are taken for them.
    """

    poses: dict[Any, tuple[tuple[MappedClip, MappedClip], tuple[Clip, Clip]]] = field(
        default_factory=dict[Any, Any]
    )
    """Two clips in the poses in which they are compared."""
    parts: dict[Any, tuple[list[Retarget], tuple[Clip, Clip]]] = field(
        default_factory=dict[Any, Any]
    )
    """How their parts go onto each other."""

    def clear(self) -> None:
        """Keep nothing."""
        self.poses.clear()
        self.parts.clear()


@dataclass(frozen=True, eq=False)
class Splice:
    """One part of one clip, and when. All that is needed to do it again."""

    part: Part
    clip: Clip
    timing: Timing
    landmarks: Landmarks | None = None
    """Of the splice clip's skeleton; a chain needs none."""
    goal: LimbGoal = "direction"
    """Hands and feet in the direction where they were seen (the source), or on the very point."""
    travel: bool = False
    """Whether legs bring the splice clip's way through the world with them."""
    clavicle: bool = True
    """Whether an arm takes its clavicle along, where both skeletons have one; the source's joint
    is the shoulder."""
    foot_lock: bool = False
    """Whether feet stand where the clip's do, with travel."""
    ground: GroundHeight | None = None
    """What they stand on; none for the height at which the base stands."""
    seen_from: SeenFrom = ""
    """From where the part is seen; as usual for it if empty. Legs with travel from the pelvis."""
    weight: tuple[Floats, Floats] | None = None
    """Frames of the base (samples,) and how much the splice acts there (samples,), 0…1; in full if
    none is given."""
    additive: bool = False
    """Whether what the clip does is put on top of what the base does, instead of taking its place:
    turns of each bone since the reference, after the base's own."""
    reference: Reference = "first"
    """With ``additive``: the pose in which the clip does nothing."""
    mirror: bool = False
    """Whether the clip is seen in a mirror: its right arm is then the part's left one. Of a chain
    the mirror image is taken, unless its bone on the splice clip is named."""
    matches: Matches = field(default_factory=Matches)
    """What :meth:`retargets` has found; splices may share it."""

    @cached_property
    def mapped(self) -> MappedClip:
        """The splice clip as it is spliced, with its landmarks."""
        if self.mirror:
            return MappedClip(*mirrored_clip(self.clip, self.landmarks))
        return MappedClip(self.clip, self.landmarks)

    @cached_property
    def _part(self) -> Part:
        """The part, with the names that bones have in the mapped clip."""
        part = self.part
        if not self.mirror or part.splice_root in ("", part.root):
            return part
        root = mirror_name(self.clip.skeleton, self.landmarks, part.splice_root)
        return replace(part, splice_root=root)

    def retargets(self, base: MappedClip) -> list[Retarget]:
        """How the part goes onto a base, one for each side: both clips in their reference poses.

        Raises:
            ClipError: a bone or landmark is missing.
        """
        seen_from: SeenFrom = "pelvis" if self.travel else self.seen_from
        told = [_told(each) for each in (base.landmarks, self.landmarks)]
        asked = self.part, self.mirror, self.clavicle, seen_from
        known = id(base.clip), id(self.clip), *told, *asked
        if known not in self.matches.parts:
            ours, theirs = self._compared(base)
            found = find_retargets(
                self._part, ours, theirs, clavicle=self.clavicle, seen_from=seen_from
            )
            self.matches.parts[known] = found, (base.clip, self.clip)
        return self.matches.parts[known][0]

    def _compared(self, base: MappedClip) -> tuple[MappedClip, MappedClip]:
        """The two clips in the poses in which they are compared."""
        if self.part.kind is None:
            return base, self.mapped
        told = [_told(each) for each in (base.landmarks, self.landmarks)]
        known = id(base.clip), id(self.clip), *told, self.mirror
        if known not in self.matches.poses:
            pair = compared(whole_limbs(base)[0], whole_limbs(self.mapped)[0])
            self.matches.poses[known] = pair, (base.clip, self.clip)
        return self.matches.poses[known][0]


def _told(landmarks: Landmarks | None) -> Any:
    """Landmarks such that they can be looked up."""
    return landmarks and (tuple(sorted(landmarks.bones.items())), landmarks.reference)


class SpliceError(ClipError):
    """One splice of several cannot be done."""

    def __init__(self, number: int, error: OctoMotionError) -> None:
        super().__init__(error.problem, error.remedy)
        self.number = number
        """Which of those that were given, counted from 0."""


@contextmanager
def numbered(number: int) -> Iterator[None]:
    """Say of what is wrong with a splice which one it is."""
    try:
        yield
    except OctoMotionError as error:
        raise SpliceError(number, error) from error


def build_splices(
    base: Clip, landmarks: Landmarks | None, splices: Sequence[Splice], finer: Clip | None = None
) -> Clip:
    """What :func:`building_splices` comes to."""
    return finished(building_splices(base, landmarks, splices, finer))


def building_splices(
    base: Clip, landmarks: Landmarks | None, splices: Sequence[Splice], finer: Clip | None = None
) -> Generator[None, None, Clip]:
    """All splices of a stack, each onto the result of those before, in steps. Nothing given is
    changed.

    Args:
        base: what they go onto.
        landmarks: of its skeleton.
        splices: in order.
        finer: the base at the moments at which the result is wanted, between frames too; see
            :func:`~octo_motion.core.splicing.clip.moments_within`. Its own frames without.

    Raises:
        SpliceError: a bone or landmark is missing, or a timing makes no sense.
    """
    # All on the same base: the ground is where it stands, whatever is done to its legs on the way.
    ready: list[Splicer] = []
    for number in range(len(splices)):
        ready += _made_ready(base, landmarks, splices[number : number + 1], number)
        yield
    result = base if finer is None else finer
    for number, each in enumerate(ready):
        with numbered(number):
            result = yield from each.onto(result, each.window(each.splice.timing, result.frames))
        yield
    return result


def _made_ready(
    base: Clip, landmarks: Landmarks | None, splices: Sequence[Splice], first: int = 0
) -> list[Splicer]:
    """Splices of which the first has this number."""
    ready: list[Splicer] = []
    for number, splice in enumerate(splices, first):
        with numbered(number):
            ready.append(Splicer(base, landmarks, splice))
    return ready


class Splicer:
    """A splice made ready: what does not hang on its timing is found once.

    For a timing that is dragged, with few frames in sight: poses do not hang on each other, but
    for where legs have led to by then, and for the way round that easing takes.
    """

    def __init__(self, base: Clip, landmarks: Landmarks | None, splice: Splice) -> None:
        """Match the two skeletons; ClipError if a bone or landmark is missing."""
        if splice.travel and not (splice.part.kind is not None and splice.part.kind.travels):
            raise ClipError(
                phrase("The part '{part}' has no legs to travel with.", part=splice.part.name),
                "Turn travel off.",
            )
        if splice.travel and splice.additive:
            raise ClipError("An additive splice has no travel.", "Turn With Travel off.")
        mapped = MappedClip(base, landmarks)
        self.splice = splice
        self._base = base
        self._retargets = splice.retargets(mapped)
        compared_base, compared_splice = self._retargets[0].base, self._retargets[0].splice
        self._rests = compared_base.rests if isinstance(compared_base, ReferredClip) else None
        self._clip = compared_splice.clip
        self._hung = whole_limbs(mapped)[1] if splice.part.kind is not None else None
        self._bones = sorted({bone for each in self._retargets for bone in each.bones})
        self._travel = None
        if splice.travel:
            self._travel = LegTravel(self._retargets[0], ground_height(mapped))
        self._lock = None
        if splice.travel and splice.foot_lock:
            lock = TravelLock(self._retargets, splice.part.sides, splice.ground)
            self._lock = lock if lock.needed else None

    def window(self, timing: Timing, moments: Floats | None = None) -> SpliceWindow:
        """What a timing means for the base or moments of it; ClipError if it makes no sense."""
        # A way through the world has a beginning and an end.
        wraps = self._travel is None
        clip, weight = self.splice.clip, self.splice.weight
        span = splice_window(timing, self._base, clip, wraps=wraps, moments=moments)
        if weight is None:
            return span
        frames = self._base.frames if moments is None else moments
        return span.weighted(np.interp(frames[span.frames], *weight))

    def needed(self, span: SpliceWindow, rows: Iterable[int]) -> list[int]:
        """Frames on which the result at these hangs, themselves included, ascending."""
        needed = set(rows)
        for row in tuple(needed):
            needed.update(span.easing(row))
        if self._lock is not None:
            sight = round(SIGHT * self._base.rate)
            for row in tuple(needed):
                first, last = (
                    max(row - sight, span.frames.start),
                    min(row + sight, span.frames.stop - 1),
                )
                if span.frames.start <= row < span.frames.stop:
                    needed.update(range(first, last + 1))
        if self._travel is not None and max(needed, default=0) >= span.frames.start:
            needed |= {span.frames.start, span.frames.stop - 1} if len(span.weights) else set()
        return sorted(needed)

    def onto(self, base: Clip, span: SpliceWindow) -> Generator[None, None, Clip]:
        """Put the part onto a clip of the base's skeleton, or onto those of its frames that are
        :meth:`needed`, in steps; the span says when it acts on these.
        """
        if span.frames.stop == span.frames.start:
            return base
        if self._hung is None:
            return (yield from self._onto_limbs(base, span))
        before = self._hung.into(base)
        yield
        result = yield from self._onto_limbs(before, span)
        return self._hung.back(result, before, base)

    def _onto_limbs(self, base: Clip, span: SpliceWindow) -> Generator[None, None, Clip]:
        """The same, of a clip whose limbs are whole."""
        if self._rests is None:
            return (yield from self._onto(base, span))
        before = self._rests.into(base)
        yield
        result = yield from self._onto(before, span)
        return self._rests.back(result, before, base)

    def _onto(self, base: Clip, span: SpliceWindow) -> Generator[None, None, Clip]:
        """The same, of a clip that rests as the base does where the two were compared."""
        rotations, locations = base.rotations.copy(), base.locations.copy()
        before = posture_of(base.skeleton, base.rotations[span.frames], base.locations[span.frames])
        moment = sample_clip(self._clip, span.splice_frames, span.seams, span.seam_speeds)
        # Views: what is written here is written into the whole.
        turned, moved = rotations[span.frames], locations[span.frames]
        exact = self.splice.goal == "exact"
        for each in self._retargets:
            yield from writing_retargeted(each, before, moment, turned, moved, exact=exact)
            yield
        if self.splice.additive:
            yield from self._adding(base, span, before, turned, moved)
            yield
        if (span.weights < 1.0).any():
            ease(base, span, self._bones, turned, moved)
            yield
        if self._travel is not None:
            whole = posture_of(base.skeleton, base.rotations, base.locations)
            self._travel.move(base, span, whole, rotations, locations)
        yield
        scales = self._scaled(base, span)
        result = replace(base, rotations=rotations, locations=locations, scales=scales)
        yield
        return result if self._lock is None else (yield from self._lock.onto(result, span))

    def _adding(
        self, base: Clip, span: SpliceWindow, before: Posture, turned: Floats, moved: Floats
    ) -> Iterator[None]:
        """Put what was written, as seen from the reference, on top of what the base has there, in
        steps.

        The reference goes onto the same postures of the base; seen from it, each bone's own turn is
        what the clip does, and comes after the base's. Blender's NLA combines quaternions alike.
        """
        still, placed = base.rotations[span.frames].copy(), base.locations[span.frames].copy()
        pose, exact = self._reference(len(still)), self.splice.goal == "exact"
        for each in self._retargets:
            yield from writing_retargeted(each, before, pose, still, placed, exact=exact)
        yield
        bones = self._bones
        own = base.rotations[span.frames][:, bones]
        done = multiply(conjugate(still[:, bones]), turned[:, bones])
        turned[:, bones] = multiply(own, done)
        moved[:, bones] += base.locations[span.frames][:, bones] - placed[:, bones]

    def _scaled(self, base: Clip, span: SpliceWindow) -> Floats | None:
        """The base's scales with those of the part, which only mean something on the same bones."""
        clip, moments = self._clip, (span.splice_frames, span.seams, span.seam_speeds)
        if base.scales is None and clip.scales is None:
            return None
        shape = base.locations.shape
        scales = np.ones(shape) if base.scales is None else base.scales.copy()
        # A view: what is written here is written into the whole.
        acting = scales[span.frames]
        weights = span.weights[:, None, None]
        for each in self._retargets:
            pairs = each.match.pairs if each.match.same_body else {}
            bones = [bone for bone in each.bones if bone in pairs and each.match.same_axes(bone)]
            others = [pairs[bone] for bone in bones]
            there = sample_scales(clip, *moments, others)
            if self.splice.additive:
                acting[:, bones] += weights * (there - self._reference_scales(len(there), others))
                continue
            rest = [bone for bone in each.bones if bone not in bones]
            acting[:, bones] += weights * (there - acting[:, bones])
            acting[:, rest] += weights * (1.0 - acting[:, rest])
        return scales

    def _reference_scales(self, count: int, bones: Sequence[int]) -> Floats:
        frame, none = self._reference_frame(), np.zeros(count)
        if frame is None:
            return np.ones((count, len(bones), 3))
        return sample_scales(self._clip, np.full(count, frame), none, none, bones)

    def _reference(self, count: int) -> Posture:
        """The clip's reference, so many times."""
        frame, skeleton = self._reference_frame(), self._clip.skeleton
        if frame is not None:
            return sample_clip(self._clip, np.full(count, frame))
        rotations = np.tile(IDENTITY, (count, len(skeleton), 1))
        return posture_of(skeleton, rotations, np.zeros((count, len(skeleton), 3)))

    def _reference_frame(self) -> float | None:
        """The frame at which an additive splice does nothing; none if that is at rest."""
        reference = self.splice.reference
        if reference == "rest":
            return None
        return float(self._clip.frames[0]) if reference == "first" else float(reference)


# --- A stack looked at frame by frame, quick enough for every move of the mouse -------------------


class SplicePreview:
    """The result of a stack at single frames, while one of its splices is timed anew.

    What does not hang on that timing is computed once: all splices beneath it, which bones answer
    to which, where the ground is. Each look then takes the frame in sight and the few others that
    it hangs on.

    Raises:
        SpliceError: a bone or landmark is missing, or a timing makes no sense.
    """

    def __init__(
        self, base: Clip, landmarks: Landmarks | None, splices: Sequence[Splice], number: int
    ) -> None:
        self._number = number
        self._base = build_splices(base, landmarks, splices[:number])
        # Made ready on the stack's own base: it tells the ground.
        self._levels = _made_ready(base, landmarks, splices[number:], number)
        self._above: list[SpliceWindow] = []
        for above, each in enumerate(self._levels[1:], number + 1):
            with numbered(above):
                self._above.append(each.window(each.splice.timing))

    def at(self, frame: float, timing: Timing) -> Clip:
        """The result at the base's frame nearest to this one, in a clip that has no other.

        Raises:
            SpliceError: the timing makes no sense.
        """
        with numbered(self._number):
            spans = [self._levels[0].window(timing), *self._above]
        row = int(np.abs(self._base.frames - frame).argmin())
        needed = [row]
        for level, span in zip(self._levels[::-1], spans[::-1], strict=True):
            needed = level.needed(span, needed)
        rows = np.asarray(needed, dtype=np.intp)
        result = self._base.taken(rows)
        for number, (level, span) in enumerate(zip(self._levels, spans, strict=True), self._number):
            with numbered(number):
                result = finished(level.onto(result, span.taken(rows)))
        return result.taken([needed.index(row)])
