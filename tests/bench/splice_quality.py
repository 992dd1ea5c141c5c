# SPDX-License-Identifier: GPL-3.0-or-later
"""How good a splice is, in numbers: how it meets what was seen, how smooth it is, how feet stand.

All measures look at poses alone, whatever made them: the result of a splice, a bone-by-bone copy,
or an animator's own work.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from octo_motion.core.rotations import Floats, angle_between, conjugate, multiply, rotate
from octo_motion.core.skeleton import Skeleton
from octo_motion.core.splicing.clip.clip import Clip, Posture, posture_of, sample_clip, sample_world
from octo_motion.core.splicing.clip.splice_timing import SpliceWindow, splice_window
from octo_motion.core.splicing.humanoid.landmarks import Landmarks
from octo_motion.core.splicing.transfer.body_frames import (
    AnatomicalFrame,
    chest_frame,
    laid_over,
    pelvis_frame,
)
from octo_motion.core.splicing.transfer.parts import LEG, Part, landmark_bone, sided
from octo_motion.core.splicing.transfer.splice import Splice

Bools = NDArray[np.bool_]

_STILL_SPEED: Final = 0.12
"""Leg lengths per second below which a foot stands: a tenth of a slow walk's speed."""
_STILL_HEIGHT: Final = 0.08
"""Leg lengths above its lowest place below which a foot may stand."""
_AROUND: Final = 3
"""Frames before and behind an ease that belong to its seam: a jump just there counts."""
_LEAST_SPEED: Final = 0.05
"""Limb lengths per second: of a limb that rests, smoothness says nothing."""


@dataclass(frozen=True)
class Seam:
    """The log dimensionless jerk of a limb's end where a splice comes or goes; 0 is smoothest."""

    result: float
    base: float
    """Of the base alone over the same frames."""
    splice: float
    """Of the splice clip alone over the same moments."""

    @property
    def roughness(self) -> float:
        """By how much the result is less smooth than the less smooth of its two sources."""
        return min(self.base, self.splice) - self.result


def path_error(result: Clip, landmarks: Landmarks, splice: Splice) -> Floats:
    """How far hands (feet) are from where the splice clip has them, seen from the chest (pelvis).

    Both are seen in anatomical frames, and the splice clip's is scaled by how much longer the limb
    is [Splice, 2.2].

    Args:
        result: to be measured.
        landmarks: of its skeleton.
        splice: what was to be spliced.

    Returns:
        (frames, limbs) in lengths of the result's limb, over the frames in which the splice is
        fully in; no limbs for trunk and head.
    """
    return _by_limb(
        [
            np.linalg.norm(found.end - found.wanted, axis=-1) / found.length
            for found in _limbs(result, landmarks, splice)
        ],
        result,
        splice,
    )


def out_of_reach(result: Clip, landmarks: Landmarks, splice: Splice) -> Floats:
    """How much farther from the joint the points are, to which hands (feet) should go, than limbs
    are long: so much no way to splice can help missing.

    Args:
        result: to be measured.
        landmarks: of its skeleton.
        splice: what was to be spliced.

    Returns:
        (frames, limbs) in lengths of the result's limb, 0 within reach; as :func:`path_error`.
    """
    return _by_limb(
        [
            np.maximum(np.linalg.norm(found.wanted - found.joint, axis=-1) / found.length - 1.0, 0)
            for found in _limbs(result, landmarks, splice)
        ],
        result,
        splice,
    )


@dataclass(frozen=True, eq=False)
class _SeenLimb:
    """A limb of the result, seen from its body; (window, 3) each."""

    joint: Floats
    end: Floats
    wanted: Floats
    """Where the end should be."""
    length: float


def _limbs(result: Clip, landmarks: Landmarks, splice: Splice) -> list[_SeenLimb]:
    span = splice_window(splice.timing, result, splice.clip)
    theirs = _landmarks(splice)
    base = _posture(result, span.frames)
    other = sample_clip(splice.clip, span.splice_frames)
    found: list[_SeenLimb] = []
    bodies = (result.skeleton, landmarks), (splice.clip.skeleton, theirs)
    for limb in _limbs_of(splice.part):
        ours, seen = _seen_from(splice.part, *bodies)
        length = limb_length(*bodies[0], limb)
        ratio = length / limb_length(*bodies[1], limb)
        joint, end = (_joint(base, ours, landmarks, limb[place]) for place in (0, -1))
        wanted = ratio * _joint(other, seen, theirs, limb[-1])
        found.append(_SeenLimb(joint, end, wanted, length))
    return found


def _by_limb(values: Sequence[Floats], result: Clip, splice: Splice) -> Floats:
    """(frames, limbs) over the frames in which a splice is fully in."""
    _, whole = _whole(result, splice)
    if not values:
        return np.zeros((int(whole.sum()), 0))
    return np.stack(values, axis=-1)[whole]


def turn_error(result: Clip, landmarks: Landmarks, splice: Splice) -> Floats:
    """How much trunk and head are turned otherwise than in the splice clip.

    The chest is seen from the pelvis. The head, and what else is no limb, is seen from the
    chest, by how it has turned since the rest pose.

    Args:
        result: to be measured.
        landmarks: of its skeleton.
        splice: what was to be spliced.

    Returns:
        (frames, sides) radians, over the frames in which the splice is fully in; (frames, 0) for
        limbs.
    """
    span, whole = _whole(result, splice)
    bodies = (
        (result.skeleton, landmarks, _posture(result, span.frames)),
        (splice.clip.skeleton, _landmarks(splice), sample_clip(splice.clip, span.splice_frames)),
    )
    kind = splice.part.kind
    if kind is None or kind.limb is not None:
        return np.zeros((int(whole.sum()), 0))
    if kind.spine:
        ours, theirs = (_chest_turn(*body) for body in bodies)
        return angle_between(ours, theirs)[whole][:, None]
    roots = [sided(kind.root, side) for side in splice.part.sides]
    turns = [[_turn_since_rest(*body, root) for body in bodies] for root in roots]
    return np.stack([angle_between(*pair)[whole] for pair in turns], axis=-1)


def log_dimensionless_jerk(path: Floats, rate: float) -> float:
    """Smoothness of a point's way, the same for any size and speed; the closer to 0, the smoother.

    −ln(T³ / v² · ∫ |d³x/dt³|² dt) with the duration T and the highest speed v, after
    Balasubramanian, Melendez-Calderon, Roby-Brami and Burdet, "On the analysis of movement
    smoothness" (2015). The smoothest way from rest to rest has −5.32.

    Args:
        path: (frames, 3), at least five.
        rate: frames per second.

    Returns:
        The measure; NaN where nothing moves.
    """
    if len(path) < 5:
        raise ValueError(f"a jerk needs five frames, not {len(path)}")
    speed = float(np.linalg.norm(np.gradient(path, axis=0), axis=-1).max()) * rate
    if speed <= 1e-12 * float(np.abs(path).max()) * rate:
        return float("nan")
    jerk = np.diff(path, n=3, axis=0) * rate**3
    # What three differences leave off at the ends counts as what is between.
    duration = (len(path) - 1) / rate
    squared = float(np.mean(np.sum(jerk * jerk, axis=-1))) * duration
    if squared == 0.0:
        # A straight line at even speed: as smooth as can be.
        return float("inf")
    return -float(np.log(duration**3 / speed**2 * squared))


def seams(result: Clip, base: Clip, landmarks: Landmarks, splice: Splice) -> list[Seam]:
    """How smoothly the ends of the spliced limbs move while the splice comes and goes.

    Ends are seen from the chest (feet: from the pelvis), as in :func:`path_error`, so that a walk's
    own travel does not hide what the limb does. Seams at which nothing moves are left out.

    Args:
        result: to be measured.
        base: what it was spliced onto.
        landmarks: of both.
        splice: what was spliced.
    """
    span = splice_window(splice.timing, base, splice.clip)
    theirs = _landmarks(splice)
    found: list[Seam] = []
    for frames in _seam_frames(span, len(base)):
        moments = _moments(span, splice, base, frames)
        for limb in _limbs_of(splice.part):
            sides = (base.skeleton, landmarks), (splice.clip.skeleton, theirs)
            ours, other = _seen_from(splice.part, *sides)
            paths = (
                _end(_posture(result, frames), ours, landmarks, limb),
                _end(_posture(base, frames), ours, landmarks, limb),
                _end(sample_clip(splice.clip, moments), other, theirs, limb),
            )
            length = limb_length(base.skeleton, landmarks, limb)
            speed = np.linalg.norm(np.diff(paths[0], axis=0), axis=-1).max() * base.rate / length
            jerks = [log_dimensionless_jerk(path, base.rate) for path in paths]
            if speed > _LEAST_SPEED and np.isfinite(jerks).all():
                found.append(Seam(*jerks))
    return found


def feet_at_rest(clip: Clip, landmarks: Landmarks, frames: Floats | None = None) -> Bools:
    """Where feet stand still.

    Args:
        clip: the motion.
        landmarks: of its skeleton.
        frames: (frames,) moments of the clip, its own frames if none are given. They need not
            follow one another at even steps.

    Returns:
        (frames, points) bool: ankles and, where there are any, balls of left and right foot. A
        point stands while it is low and slow towards the frames before and after.
    """
    times = clip.frames if frames is None else frames
    points = _foot_points(clip, landmarks, times)
    leg = _leg(clip, landmarks)
    steps = np.abs(np.diff(times))[:, None] / clip.rate
    moved = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    slow = moved < _STILL_SPEED * leg * np.maximum(steps, 1e-9)
    still = np.ones(points.shape[:2], dtype=bool)
    still[1:] &= slow
    still[:-1] &= slow
    low = points[..., 2] < points[..., 2].min(axis=0) + _STILL_HEIGHT * leg
    return still & low


def foot_slip(clip: Clip, landmarks: Landmarks, still: Bools) -> Floats:
    """How far feet that should stand slide along the ground, per frame.

    Args:
        clip: to be measured.
        landmarks: of its skeleton.
        still: (frames, points) bool, see :func:`feet_at_rest`; of another skeleton, say the
            splice clip's, whose feet these are.

    Returns:
        (stance frames,) metres for each point that stands both at a frame and at the one before.
    """
    points = _foot_points(clip, landmarks, clip.frames)
    if points.shape[1] != still.shape[1]:
        # One of the two has no toes: ankles are first.
        points, still = points[:, :2], still[:, :2]
    moved = np.linalg.norm(np.diff(points[..., :2], axis=0), axis=-1)
    return moved[still[1:] & still[:-1]]


def limb_length(skeleton: Skeleton, landmarks: Landmarks, limb: Sequence[str]) -> float:
    """Length of a limb along its landmarks' bones, armature units."""
    bones = [landmark_bone(skeleton, landmarks, name) for name in limb]
    return float(np.linalg.norm(np.diff(skeleton.heads[bones], axis=0), axis=1).sum())


def _limbs_of(part: Part) -> list[tuple[str, ...]]:
    """Landmarks of joint, bend and end of each limb of a part; none of trunk and head."""
    kind = part.kind
    return [kind.limb_on(side) for side in part.sides] if kind and kind.limb else []


def _landmarks(splice: Splice) -> Landmarks:
    if splice.landmarks is None:
        raise ValueError("a chain has no body to be seen from")
    return splice.landmarks


def _whole(result: Clip, splice: Splice) -> tuple[SpliceWindow, Bools]:
    """The splice's window, and which of its frames it is fully in, (window,) bool."""
    span = splice_window(splice.timing, result, splice.clip)
    return span, span.weights >= 1.0


def _posture(clip: Clip, frames: slice) -> Posture:
    return posture_of(clip.skeleton, clip.rotations[frames], clip.locations[frames])


def _seen_from(
    part: Part, ours: tuple[Skeleton, Landmarks], theirs: tuple[Skeleton, Landmarks]
) -> tuple[AnatomicalFrame, AnatomicalFrame]:
    assert part.kind is not None
    frame = chest_frame if part.kind.seen_from[0] == "chest" else pelvis_frame
    base = frame(*ours)
    return base, laid_over(frame(*theirs), base)


def _joint(posture: Posture, frame: AnatomicalFrame, landmarks: Landmarks, landmark: str) -> Floats:
    """A landmark's joint in a body's frame, (frames, 3)."""
    bone = landmark_bone(posture.skeleton, landmarks, landmark)
    return rotate(conjugate(frame.orientation(posture)), posture.head(bone) - frame.place(posture))


def _end(
    posture: Posture, frame: AnatomicalFrame, landmarks: Landmarks, limb: Sequence[str]
) -> Floats:
    """Hand or foot in a body's frame, (frames, 3)."""
    return _joint(posture, frame, landmarks, limb[-1])


def _chest_turn(skeleton: Skeleton, landmarks: Landmarks, posture: Posture) -> Floats:
    chest, pelvis = chest_frame(skeleton, landmarks), pelvis_frame(skeleton, landmarks)
    return multiply(conjugate(pelvis.orientation(posture)), chest.orientation(posture))


def _turn_since_rest(
    skeleton: Skeleton, landmarks: Landmarks, posture: Posture, landmark: str
) -> Floats:
    chest = chest_frame(skeleton, landmarks)
    bone = landmark_bone(skeleton, landmarks, landmark)
    at_rest = multiply(conjugate(chest.at_rest(skeleton)), skeleton.rest_rotations[bone])
    now = multiply(conjugate(chest.orientation(posture)), posture.orientation(bone))
    return multiply(now, conjugate(at_rest))


def _seam_frames(span: SpliceWindow, count: int) -> list[slice]:
    """Frames of the base around each ease; a hard cut has some too."""
    weights = np.zeros(count)
    weights[span.frames] = span.weights
    mixed = (weights > 0.0) & (weights < 1.0)
    # Where a weight leaps from one frame to the next, both belong to the seam.
    leaps = np.flatnonzero(np.abs(np.diff(weights)) > 0.0)
    mixed[leaps] = mixed[leaps + 1] = True
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mixed.astype(int), [0]])))
    slices = [
        slice(max(first - _AROUND, 0), min(last + _AROUND, count))
        for first, last in zip(edges[::2], edges[1::2], strict=True)
    ]
    return [each for each in slices if each.stop - each.start >= 5]


def _moments(span: SpliceWindow, splice: Splice, base: Clip, frames: slice) -> Floats:
    """The splice clip's moments for frames of the base, also just outside of the splice."""
    step = splice.timing.rate * splice.clip.rate / base.rate
    start, stop = span.frames.start, span.frames.stop
    numbers = np.arange(frames.start, frames.stop)
    inside = np.clip(numbers, start, stop - 1)
    away = base.frames[numbers] - base.frames[inside]
    return span.splice_frames[inside - start] + step * away


def _foot_points(clip: Clip, landmarks: Landmarks, times: Floats) -> Floats:
    """World places (frames, points, 3) of ankles, then balls if both feet have one."""
    names = ["foot.L", "foot.R"]
    if all(landmarks.get(f"toe.{side}") for side in "LR"):
        names += ["toe.L", "toe.R"]
    posture = sample_clip(clip, times)
    turns, places, scale = sample_world(clip, times)
    heads = (posture.head(landmark_bone(clip.skeleton, landmarks, name)) for name in names)
    return np.stack([places + scale * rotate(turns, head) for head in heads], axis=1)


def _leg(clip: Clip, landmarks: Landmarks) -> float:
    lengths: Sequence[float] = [
        limb_length(clip.skeleton, landmarks, LEG.limb_on(side)) for side in "LR"
    ]
    return clip.scale * sum(lengths) / len(lengths)
