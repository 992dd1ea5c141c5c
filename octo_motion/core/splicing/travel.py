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

from ..rotations import Floats, conjugate, from_axis_angle, multiply, rotate
from .carry import Carrier, Side
from .clip import Clip
from .correspondence import chain_length
from .frames import BodyFrame
from .parts import landmark_bone
from .posture import Posture, sampled, sampled_world, slerp
from .timing import Window

_UP: Final = np.array([0.0, 0.0, 1.0])
_LEVEL: Final = np.array([1.0, 1.0, 0.0])

_GROUND_SAMPLES: Final = 500
"""Frames of a clip that are looked at to find the ground."""


@dataclass(frozen=True, eq=False)
class _Path:
    """A body frame in the world: orientations (frames, 4) and places (frames, 3)."""

    orientations: Floats
    places: Floats


def move_hips(
    carrier: Carrier, span: Window, base: Posture, rotations: Floats, locations: Floats
) -> None:
    """Write rotation and location of the hips into the base's arrays.

    Args:
        carrier: a leg, seen from the pelvis.
        span: when the splice acts.
        base: the whole base, as it was.
        rotations: (frames, bones, 4) of the whole base, to be changed.
        locations: (frames, bones, 3), likewise.
    """
    ours, theirs = carrier.frames
    clip, other = carrier.base.clip, carrier.splice.clip
    own = _path(clip, ours, base, clip.frames)
    path = _path(other, theirs, sampled(other, span.splice_frames), span.splice_frames)
    ratio = _leg(carrier.base) * clip.scale / (_leg(carrier.splice) * other.scale)
    first, last = span.frames.start, span.frames.stop - 1
    # Begin where the base is, and the way it faces.
    turn = _heading(own.orientations[first], path.orientations[0])
    places = own.places[first] + ratio * rotate(turn, path.places - path.places[0])
    places[:, 2] = _ground(carrier.base) + ratio * (path.places[:, 2] - _ground(carrier.splice))
    orientations = multiply(turn, path.orientations)
    # Go on from where it ends.
    away = _heading(orientations[-1], own.orientations[last])
    shift = (places[-1] - rotate(away, own.places[last])) * _LEVEL
    later = _Path(
        multiply(away, own.orientations[first:]), rotate(away, own.places[first:]) + shift
    )
    count = len(places)
    leaving = span.weights < span.entering
    goal_turns = np.where(
        leaving[:, None], later.orientations[:count], own.orientations[span.frames]
    )
    goal_places = np.where(leaving[:, None], later.places[:count], own.places[span.frames])
    weights = span.weights
    later.orientations[:count] = slerp(goal_turns, orientations, weights)
    later.places[:count] = goal_places + weights[:, None] * (places - goal_places)
    _write_hips(carrier.base, ours, base, later, (rotations, locations))


def _write_hips(
    side: Side,
    frame: BodyFrame,
    base: Posture,
    path: _Path,
    arrays: tuple[Floats, Floats],
) -> None:
    """Write a path of the pelvis from some frame on to the end."""
    clip, (rotations, locations) = side.clip, arrays
    first = len(clip) - len(path.places)
    chosen = slice(first, None)
    turns, shifts, scale = sampled_world(clip, clip.frames[chosen])
    back = conjugate(turns)
    orientation = multiply(multiply(back, path.orientations), conjugate(frame.turn))
    place = rotate(back, path.places - shifts) / scale - rotate(orientation, frame.origin)

    def part(values: Floats) -> Floats:
        return values[chosen] if values.ndim == 2 else values

    bone = frame.bone
    rotations[chosen, bone] = multiply(conjugate(part(base.carried(bone))), orientation)
    moved = place - part(base.unmoved_head(bone))
    locations[chosen, bone] = rotate(conjugate(part(base.location_axes(bone))), moved)


def _path(clip: Clip, frame: BodyFrame, posture: Posture, frames: Floats) -> _Path:
    turns, shifts, scale = sampled_world(clip, frames)
    return _Path(
        multiply(turns, frame.orientation(posture)),
        shifts + scale * rotate(turns, frame.place(posture)),
    )


def _heading(goal: Floats, start: Floats) -> Floats:
    """The turn about the vertical (4,) that brings one orientation closest to another."""
    between = multiply(goal, conjugate(start))
    return from_axis_angle(_UP, 2.0 * np.arctan2(between[3], between[0]))


def _leg(side: Side) -> float:
    """Length of the legs, armature units."""
    names = ("thigh", "shin", "foot")
    marks = side.humanoid()
    return 0.5 * sum(
        chain_length(
            side.skeleton, [landmark_bone(side.skeleton, marks, f"{name}.{left}") for name in names]
        )
        for left in "LR"
    )


def _ground(side: Side) -> float:
    """Height of the lowest point that a foot reaches in a clip, world units."""
    clip, marks = side.clip, side.humanoid()
    count = min(len(clip), _GROUND_SAMPLES)
    chosen = clip.frames[np.linspace(0, len(clip) - 1, count).astype(np.intp)]
    posture = sampled(clip, chosen)
    turns, shifts, scale = sampled_world(clip, chosen)
    heights = [
        (shifts + scale * rotate(turns, posture.head(landmark_bone(clip.skeleton, marks, foot))))[
            :, 2
        ].min()
        for foot in ("foot.L", "foot.R")
    ]
    return float(min(heights))
