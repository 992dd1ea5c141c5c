# SPDX-License-Identifier: GPL-3.0-or-later
"""Legs that bring their travel with them: the hips follow the splice clip through the world.

Without it feet skate: legs of one walk above the ground covered by another. The splice's path is
turned about the vertical and shifted so that it begins where the base stands and the way it faces;
what the base does afterwards goes on from where the path has led. Heights are measured from the
ground on which each clip stands.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...errors import ClipError
from ...phrases import phrase
from ...rotations import (
    IDENTITY,
    Floats,
    conjugate,
    from_axis_angle,
    multiply,
    rotate,
    slerp,
)
from ...skeleton import Skeleton
from ...smoothing import smooth_step
from ..clip import (
    Clip,
    Posture,
    SpliceWindow,
    posture_of,
    sample_clip,
    sample_world,
    seam_shifts,
    seam_turns,
)
from ..humanoid import chain_length
from .body_frames import AnatomicalFrame
from .foot_contacts import find_stance, own_paths
from .parts import LEG
from .retarget import MappedClip, Retarget, bodies_of
from .upright import heading, stand_over

_UP: Final = np.array([0.0, 0.0, 1.0])
_LEVEL: Final = np.array([1.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class BodyPath:
    """A body's frame in the world: orientations (frames, 4) and places (frames, 3)."""

    orientations: Floats
    places: Floats


class LegTravel:
    """What of the way through the world does not hang on its timing.

    The leg is seen from the pelvis; ``ground`` is the height of the base's ankles as it stands.

    Raises:
        ClipError: the base's hips cannot leave their parent.
    """

    def __init__(self, retarget: Retarget, ground: float) -> None:
        self._retarget = retarget
        self._ground = ground
        self._other_ground = ground_height(retarget.splice)
        ours, theirs = retarget.base, retarget.splice
        check_hips(ours.skeleton, retarget.frames[0].bone)
        self._frames = tuple(
            frame.midway([mapped.bone(f"thigh.{side}") for side in "LR"], mapped.skeleton)
            for frame, mapped in zip(retarget.frames, (ours, theirs), strict=True)
        )
        """Of the pelvis, between its hip joints: legs may be seen from one of these."""
        self._ratio = leg_length(ours) * ours.clip.scale / (leg_length(theirs) * theirs.clip.scale)
        self._bodies = bodies_of(ours, theirs)

    def move(
        self, clip: Clip, span: SpliceWindow, base: Posture, rotations: Floats, locations: Floats
    ) -> None:
        """Write rotation and location of the hips into the base's arrays.

        Args:
            clip: the base; of its frames at least the first and last of the splice.
            span: when the splice acts on these frames.
            base: the posture of all these frames, as it was.
            rotations: (frames, bones, 4) of them, to be changed.
            locations: (frames, bones, 3), likewise.
        """
        ours = self._frames[0]
        own = body_path(clip, ours, base, clip.frames)
        path = self._way(span)
        first = span.frames.start
        begin, end = span.ends
        # Begin where the base is, and the way it faces.
        turn = heading(own.orientations[first + begin], path.orientations[begin])
        way = path.places - path.places[begin]
        places = own.places[first + begin] + self._ratio * rotate(turn, way)
        heights = path.places[:, 2] - self._other_ground
        places[:, 2] = self._ground + self._ratio * heights
        orientations = multiply(turn, path.orientations)
        # Go on from where it ends.
        away = heading(orientations[end], own.orientations[first + end])
        shift = (places[end] - rotate(away, own.places[first + end])) * _LEVEL
        later = BodyPath(
            multiply(away, own.orientations[first:]), rotate(away, own.places[first:]) + shift
        )
        count = len(places)
        leaving = (span.weights < span.entering)[:, None]
        goal_turns = np.where(leaving, later.orientations[:count], own.orientations[span.frames])
        goal_places = np.where(leaving, later.places[:count], own.places[span.frames])
        later.orientations[:count] = slerp(goal_turns, orientations, span.weights)
        later.places[:count] = goal_places + span.weights[:, None] * (places - goal_places)
        write_hips(clip, ours, base, later, (rotations, locations))
        if self._bodies is not None:
            self._keep_upright(clip, span, (own, later), base, (rotations, locations))

    def _keep_upright(
        self,
        clip: Clip,
        span: SpliceWindow,
        paths: tuple[BodyPath, BodyPath],
        base: Posture,
        arrays: tuple[Floats, Floats],
    ) -> None:
        """Turn the trunk so that it leans as the base's does.

        The legs bring their pelvis along: the body on it is to stand as it stood, unless one of the
        two lies or turns over (Heck, Kovar and Gleicher, 2006, do likewise).
        """
        assert self._bodies is not None
        (own, path), (rotations, locations) = paths, arrays
        body, other = self._bodies
        chosen = slice(len(clip) - len(path.places), None)
        standing = body.standing(base, _up(clip))[chosen]
        other_clip = self._retarget.splice.clip
        there = sample_clip(other_clip, span.splice_frames, span.seams, span.seam_speeds)
        standing[: len(span.weights)] *= other.standing(there, _up(other_clip))
        carried = multiply(path.orientations, conjugate(own.orientations[chosen]))
        # Over on its head a pelvis has no heading.
        standing = standing * smooth_step(1.0 + 2.0 * rotate(carried, _UP)[:, 2])
        turned = heading(carried, IDENTITY)
        turns, _, _ = sample_world(clip, clip.frames[chosen])
        # The waist as the base's, seen in the world but for the heading, …
        turn = slerp(IDENTITY, multiply(turned, conjugate(carried)), standing)
        turn = multiply(multiply(conjugate(turns), turn), turns)
        result = posture_of(clip.skeleton, rotations[chosen], locations[chosen])
        waist = multiply(turn, result.orientation(body.waist))
        rotations[chosen, body.waist] = multiply(conjugate(result.carried(body.waist)), waist)
        # … and the neck over the hips, on which the waist may sit askew.
        result = posture_of(clip.skeleton, rotations[chosen], locations[chosen])
        turned = multiply(multiply(conjugate(turns), turned), turns)
        way = rotate(turned, body.lean(base)[chosen])
        stand_over(body, result, rotations[chosen], way, standing)

    def _way(self, span: SpliceWindow) -> BodyPath:
        """The splice's pelvis through the world, round after round where it loops."""
        clip, frame = self._retarget.splice.clip, self._frames[1]
        path = body_path(clip, frame, sample_clip(clip, span.splice_frames), span.splice_frames)
        if not (span.rounds.any() or span.seams.any()):
            return path
        times = clip.frames[[-2, -1, 0, 1]]
        ends = body_path(clip, frame, sample_clip(clip, times), times)
        last, first = ends.places[1].copy(), ends.places[2].copy()
        # Each round goes on from where the one before has led, and the way it faced then.
        turn = heading(ends.orientations[1], ends.orientations[2])
        numbers = np.arange(span.rounds.max() + 1.0)
        turns = from_axis_angle(_UP, 2.0 * np.arctan2(turn[3], turn[0]) * numbers)
        step = rotate(turns, (last - first) * _LEVEL)
        shifts = np.concatenate([np.zeros((1, 3)), np.cumsum(step, axis=0)[:-1]])
        # What is left at the seam: how the pelvis leans, how high it is, and its speeds.
        begins = slice(2, None)
        ends.orientations[begins] = multiply(turn, ends.orientations[begins])
        begun = rotate(turn, ends.places[begins] - first)
        ends.places[begins] = begun + last * _LEVEL + first * _UP
        seams = span.seams, span.seam_speeds * (not clip.closed)
        added = seam_turns(ends.orientations, times, *seams)
        shift = seam_shifts(ends.places, times, *seams)
        # Behind the seam as the round that begins there sees it.
        shift = np.where(span.seams[:, None] < 0.0, rotate(conjugate(turn), shift), shift)
        own = turns[span.rounds]
        places = rotate(own, path.places - first + shift) + shifts[span.rounds] + first
        return BodyPath(multiply(multiply(own, path.orientations), added), places)


def check_hips(skeleton: Skeleton, hips: int) -> None:
    """Whether the hips can leave their parent.

    Raises:
        ClipError: they cannot.
    """
    if skeleton.connected[hips] and skeleton.parents[hips] >= 0:
        name, parent = skeleton.names[hips], skeleton.names[skeleton.parents[hips]]
        raise ClipError(
            phrase(
                "'{name}' cannot travel: it is connected to '{parent}'.", name=name, parent=parent
            ),
            "Turn off its Connected (bone properties, Relations), or With Travel.",
        )


def write_hips(
    clip: Clip,
    frame: AnatomicalFrame,
    base: Posture,
    path: BodyPath,
    arrays: tuple[Floats, Floats],
) -> None:
    """Write a path of the pelvis from some frame on to the end."""
    rotations, locations = arrays
    first = len(clip) - len(path.places)
    chosen = slice(first, None)
    turns, shifts, scale = sample_world(clip, clip.frames[chosen])
    back = conjugate(turns)
    orientation = multiply(multiply(back, path.orientations), conjugate(frame.turn))
    place = rotate(back, path.places - shifts) / scale - rotate(orientation, frame.origin)

    def part(values: Floats) -> Floats:
        return values[chosen] if values.ndim == 2 else values

    bone = frame.bone
    rotations[chosen, bone] = multiply(conjugate(part(base.carried(bone))), orientation)
    moved = place - part(base.unmoved_head(bone))
    locations[chosen, bone] = rotate(conjugate(part(base.location_axes(bone))), moved)


def body_path(clip: Clip, frame: AnatomicalFrame, posture: Posture, frames: Floats) -> BodyPath:
    """The way of a body's frame at some moments of a clip, whose posture there is given."""
    turns, shifts, scale = sample_world(clip, frames)
    return BodyPath(
        multiply(turns, frame.orientation(posture)),
        shifts + scale * rotate(turns, frame.place(posture)),
    )


def _up(clip: Clip) -> Floats:
    """The vertical (3,), armature space."""
    return clip.world[0, 2, :3] / clip.scale


def leg_length(mapped: MappedClip) -> float:
    """Length of the legs, armature units."""
    joints = ([mapped.bone(name) for name in LEG.limb_on(side)] for side in "LR")
    return 0.5 * sum(chain_length(mapped.skeleton, each) for each in joints)


def ground_height(mapped: MappedClip) -> float:
    """Height of the ankles of somebody who stands in a clip, world units."""
    return find_stance(own_paths(mapped)).ankle
