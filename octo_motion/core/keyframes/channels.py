# SPDX-License-Identifier: GPL-3.0-or-later
"""Channels: motion in space, as values of Blender's own properties, and what their keys play.

What Blender knows of a rig's channels (what they are called, in which rotation modes, which bones
hand their scale on, what frame an object's own channels stand in) is read once; from then on it is
plain data, and so is all that is made of it here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..rotations import (
    Floats,
    conjugate,
    continuous_axis_angle,
    continuous_euler,
    multiply,
    normalized,
    to_euler,
)

Booleans = NDArray[np.bool_]

_HANDLE: Final = 1.0 / 2.5614
"""Length of an automatic handle, as a share of the time between two keys."""


@dataclass(frozen=True, eq=False)
class Channel:
    """One animated property: as many F-curves as it has components."""

    data_path: str
    values: Floats
    """(frames, components)"""
    group: str
    keys: BezierKeys | None = None
    """What is written in place of one linear key per frame."""


OBJECT_GROUP: Final = "Object Transforms"
"""Where Blender's own keying puts an object's channels."""
_TURN: Final = 2.0 * np.pi
_UNUSED: Final = 1e-5
"""Scales that differ from 1 by less need no keys."""
_FLAT: Final = 1e-3
"""Share of its length to which a bone shrinks at least."""


def rotation_property(mode: str) -> str:
    """The property that holds a rotation in one of Blender's rotation modes."""
    if mode in ("QUATERNION", "AXIS_ANGLE"):
        return f"rotation_{mode.lower()}"
    return "rotation_euler"


def in_rotation_mode(quaternions: Floats, mode: str) -> Floats:
    """Quaternions (frames, …, 4) as values of a rotation mode, continuous over the frames.

    Each frame continues the one before: quaternions keep their sign, Euler angles and the angle
    about an axis go on past the half turn instead of jumping.
    """
    if mode == "QUATERNION":
        return _continuous_curves(quaternions)
    if mode == "AXIS_ANGLE":
        return continuous_axis_angle(quaternions)
    return continuous_euler(to_euler(quaternions, mode), mode)


def _continuous_curves(quaternions: Floats) -> Floats:
    """Quaternions (frames, …, 4) whose signs go on from frame to frame, from the side of rest on.

    The frames of each component lie next to each other in memory: keys are written curve by curve.
    """
    curves = np.array(np.moveaxis(quaternions, 0, -1), order="C")
    w, x, y, z = np.moveaxis(curves, -2, 0)
    same = w[..., 1:] * w[..., :-1]
    for each in (x, y, z):
        same += each[..., 1:] * each[..., :-1]
    away = np.empty(w.shape, dtype=bool)
    # Rest is (1, 0, 0, 0).
    np.less(w[..., :1], 0.0, out=away[..., :1])
    np.less(same, 0.0, out=away[..., 1:])
    if away.any():
        np.logical_xor.accumulate(away, axis=-1, out=away)
        np.negative(curves, out=curves, where=away[..., None, :])
    return np.moveaxis(curves, -1, 0)


def going_on_from(values: Floats, mode: str, start: Floats) -> Floats:
    """The same rotations as continuous values (frames, components) that begin next to others.

    A rotation has many values in each mode: a quaternion with either sign, angles and whole turns
    more, three Euler angles and the triple on the other side of the pole. Curves that go on from
    a key have to go on from its values, or the way there would lead through a turn.

    Args:
        values: (frames, components) of :func:`in_rotation_mode`.
        mode: the rotation mode.
        start: (components,) values to go on from.
    """
    if mode == "QUATERNION":
        return values if start @ values[0] >= 0.0 else -values
    if mode == "AXIS_ANGLE":
        same = values if start[1:] @ values[0, 1:] >= 0.0 else -values
        whole = np.array([1.0, 0.0, 0.0, 0.0])
        return same + whole * _TURN * np.round((start[0] - same[0, 0]) / _TURN)
    i, j, k = ("XYZ".index(letter) for letter in mode)
    other = values.copy()
    other[:, (i, k)] += np.pi
    other[:, j] = np.pi - other[:, j]
    found = [each + _TURN * np.round((start - each[0]) / _TURN) for each in (values, other)]
    return min(found, key=lambda each: float(np.abs(each[0] - start).sum()))


@dataclass(frozen=True, eq=False)
class ObjectChannels:
    """How an object's own channels stand to the world."""

    rotation_mode: str
    frame: Floats
    """(4, 4) in which its own channels stand: parent and parent inverse."""
    turn: Floats
    """(4,) the rotation within that frame."""
    delta_location: Floats
    """(3,)"""
    delta_rotation: Floats
    """(4,)"""

    @property
    def unit(self) -> float:
        """Metres in the world of one unit of the location: the longest, if they are unequal."""
        return float(np.linalg.norm(self.frame[:3, :3], ord=2))

    def channels(self, locations: Floats, quaternions: Floats) -> list[Channel]:
        """Travel through the world as a location and a rotation.

        Args:
            locations: (frames, 3), world.
            quaternions: (frames, 4), world.
        """
        frame = self.frame
        own = np.linalg.solve(frame[:3, :3], (locations - frame[:3, 3]).T).T
        return self.own_channels(own, multiply(conjugate(self.turn), normalized(quaternions)))

    def own_channels(self, locations: Floats, quaternions: Floats) -> list[Channel]:
        """The same, of places (frames, 3) and orientations (frames, 4) before the parent and
        constraints: delta transforms and rotation mode are taken off.
        """
        mode = self.rotation_mode
        rotations = multiply(conjugate(self.delta_rotation), quaternions)
        return [
            Channel("location", locations - self.delta_location, OBJECT_GROUP),
            Channel(rotation_property(mode), in_rotation_mode(rotations, mode), OBJECT_GROUP),
        ]

    def places(self, locations: Floats, quaternions: Floats) -> tuple[Floats, Floats]:
        """Inverse of :meth:`channels`: where values of the channels put the object.

        Args:
            locations: (frames, 3), values of its location.
            quaternions: (frames, 4), what the values of its rotation mean.

        Returns:
            Locations (frames, 3) and orientations (frames, 4) in the world.
        """
        places = (locations + self.delta_location) @ self.frame[:3, :3].T + self.frame[:3, 3]
        return places, multiply(multiply(self.turn, self.delta_rotation), quaternions)


@dataclass(frozen=True, eq=False)
class RigChannels:
    """What the channels of some bones of an armature are."""

    paths: Mapping[str, str]
    """By bone, the data path that its properties begin with."""
    modes: Mapping[str, str]
    """By bone, its rotation mode."""
    aligned: frozenset[str] = frozenset()
    """Bones that the one before makes longer with itself."""
    moved: Mapping[str, tuple[str, Floats]] | None = None
    """Where bones get longer by what comes after them being moved: by bone the one after it, and by
    how much (3,), in its rest frame, where the bone is to be twice as long. None where they get
    longer by their scale."""
    own: ObjectChannels | None = None
    """Those of the armature object, where they are wanted."""

    def path(self, bone: str, name: str) -> str:
        """Data path of a bone's property."""
        return f"{self.paths[bone]}.{name}"

    def rotation_path(self, bone: str) -> str:
        """Data path of a bone's rotation, in the mode that it has."""
        return self.path(bone, rotation_property(self.modes[bone]))

    def rotations(self, bones: Sequence[str], quaternions: Floats) -> list[Channel]:
        """Bones' rotations (frames, bones, 4) from rest, what Blender calls ``matrix_basis``."""
        modes = [self.modes[bone] for bone in bones]
        channels: dict[int, Channel] = {}
        for mode in set(modes):
            chosen = [number for number, each in enumerate(modes) if each == mode]
            values = in_rotation_mode(quaternions[:, chosen], mode)
            for place, number in enumerate(chosen):
                bone = bones[number]
                channels[number] = Channel(self.rotation_path(bone), values[:, place], bone)
        return [channels[number] for number in range(len(modes))]

    def location(self, bone: str, locations: Floats) -> Channel:
        """A bone's locations (frames, 3), in its rest frame."""
        return Channel(self.path(bone, "location"), locations, bone)

    def scale(self, bone: str, scales: Floats) -> Channel:
        """A bone's scales (frames, 3)."""
        return Channel(self.path(bone, "scale"), scales, bone)

    def handed(self, bones: Sequence[str]) -> list[bool]:
        """Of each bone of an arm, root to tip, whether the one before makes it longer."""
        aligned = self.aligned if self.moved is None else frozenset[str]()
        return [bool(place) and name in aligned for place, name in enumerate(bones)]

    def stretches(self, arms: Sequence[Sequence[str]], strains: Floats) -> list[Channel]:
        """Scales of bones that are longer by a share, and thinner so that they keep their volume.

        Args:
            arms: bones of each arm, root to tip.
            strains: (frames, bones) of all arms, one after the other.

        Returns:
            Channels of those bones whose scale differs from 1 at some frame; :meth:`written` has
            them as locations, if that is how bones get longer.
        """
        channels: list[Channel] = []
        start = 0
        for bones in arms:
            longer = 1.0 + strains[:, start : start + len(bones)]
            start += len(bones)
            for place, (name, handed) in enumerate(zip(bones, self.handed(bones), strict=True)):
                along = longer[:, place]
                if handed:
                    along = along / longer[:, place - 1]
                if np.abs(along - 1.0).max() <= _UNUSED or not self._gets_longer(name):
                    continue
                across = 1.0 / np.sqrt(along)
                channels.append(self.scale(name, np.stack([across, along, across], axis=1)))
        return channels

    def strains(
        self, arms: Sequence[Sequence[str]], alongs: Mapping[str, Floats], count: int
    ) -> Floats:
        """Inverse of :meth:`stretches`: by how much bones are longer, as a share.

        Args:
            arms: bones of each arm, root to tip.
            alongs: by bone, its scale along itself (moments,); a bone without is not scaled.
            count: number of moments.

        Returns:
            (moments, bones) of all arms, one after the other.
        """
        strains = []
        for bones in arms:
            longer = np.ones(count)
            for name, handed in zip(bones, self.handed(bones), strict=True):
                own = alongs.get(name, 1.0)
                longer = longer * own if handed else np.ones(count) * own
                strains.append(longer - 1.0)
        return np.stack(strains, axis=1)

    def _gets_longer(self, bone: str) -> bool:
        return self.moved is None or bone in self.moved

    def written(self, channels: Sequence[Channel]) -> list[Channel]:
        """The same as Blender gets them: scales of bones that get longer by what comes after them
        being moved become locations of that. Keys and handles go along, for a location is linear in
        the scale.
        """
        moved = {self.path(name, "scale"): found for name, found in (self.moved or {}).items()}
        result: dict[str, Channel] = {}
        for each in channels:
            own = each
            if each.data_path in moved:
                bone, way = moved[each.data_path]
                # An arm's few keys stand in one group.
                group = bone if each.keys is None else each.group
                values = (each.values[:, 1:2] - 1.0) * way
                keys = None if each.keys is None else _moving(each.keys, way)
                own = Channel(self.path(bone, "location"), values, group, keys)
            if (other := result.get(own.data_path)) is not None:
                # A pose of the artist's may have moved it, too.
                own = replace(own, values=own.values + other.values, keys=None)
            result[own.data_path] = own
        return list(result.values())

    def given(
        self, moves: Mapping[str, Floats], sizes: Mapping[str, Floats]
    ) -> tuple[dict[str, Floats], dict[str, Floats]]:
        """Inverse of :meth:`written`, of locations (3,) and scales (3,) of bones in a pose: how far
        bones are moved because the one before is longer, as the scale of that.
        """
        left, scales = dict(moves), dict(sizes)
        for name, (bone, way) in (self.moved or {}).items():
            if bone not in left or not np.any(way):
                continue
            longer = float(left[bone] @ way / (way @ way))
            left[bone] = left[bone] - longer * way
            across = 1.0 / np.sqrt(max(1.0 + longer, _FLAT))
            scales[name] = np.array([across, 1.0 + longer, across])
        return left, scales


def _moving(keys: BezierKeys, way: Floats) -> BezierKeys:
    """Keys of a location (3,) that is as far along a way as a scale, of the second component, is
    from 1.
    """

    def moved(values: NDArray[np.float32]) -> NDArray[np.float32]:
        return ((values[:, 1:2].astype(np.float64) - 1.0) * way).astype(np.float32)

    left, right = (
        np.stack([np.repeat(side[:, 1:2, 0], 3, axis=1), moved(side[..., 1])], axis=-1)
        for side in (keys.left, keys.right)
    )
    return replace(keys, values=moved(keys.values), left=left, right=right)


# --- What keys play: values of Bézier curves ------------------------------------------------------


def values_at(keys: BezierKeys, times: Floats) -> Floats:
    """Values (times, components) of curves; before the first key and after the last as there.

    Args:
        keys: with handles at thirds of the time between two keys, as :func:`keys.reduce_keys` has
            them: a curve is then a cubic in time itself.
        times: (times,) frames, which need not be whole.
    """
    frames, values = keys.frames.astype(np.float64), keys.values.astype(np.float64)
    if len(frames) == 1:
        return np.tile(values, (len(times), 1))
    span = np.clip(np.searchsorted(frames, times, side="right") - 1, 0, len(frames) - 2)
    start, end = frames[span], frames[span + 1]
    share = np.clip((times - start) / (end - start), 0.0, 1.0)[:, None]
    rest = 1.0 - share
    out, into = keys.right[span, :, 1], keys.left[span + 1, :, 1]
    return (
        rest**3 * values[span]
        + 3.0 * share * rest**2 * out
        + 3.0 * share**2 * rest * into
        + share**3 * values[span + 1]
    )


@dataclass(frozen=True, eq=False)
class BezierKeys:
    """Keys of one track in single precision, as Blender keeps them."""

    frames: NDArray[np.float32]
    """(keys,)"""
    values: NDArray[np.float32]
    """(keys, components)"""
    left: NDArray[np.float32]
    """(keys, components, 2) frame and value of the handles before the keys."""
    right: NDArray[np.float32]
    """(keys, components, 2) likewise after them."""
    smooth: Booleans
    """(keys,) whether both handles lie on one line, as Blender's aligned ones do."""

    def __len__(self) -> int:
        """Number of keys of each component."""
        return len(self.frames)


def constant_keys(frame: float, values: Floats) -> BezierKeys:
    """A single key of values (components,) that hold for ever."""
    own = np.stack(np.broadcast_arrays(frame, values), axis=-1)[None].astype(np.float32)
    reach = np.array([1.0, 0.0], dtype=np.float32)
    return BezierKeys(
        own[:, 0, 0], own[..., 1], own - reach, own + reach, np.ones(1, dtype=np.bool_)
    )


def bezier_keys(
    frames: Floats, values: Floats, out: Floats, into: Floats, smooth: Booleans
) -> BezierKeys:
    """Keys with handles at thirds of the time between two of them.

    Args:
        frames: (keys,) at least two.
        values: (keys, components)
        out: (keys − 1, components) values of the handles after all keys but the last one.
        into: (keys − 1, components) values of the handles before all but the first one.
        smooth: (keys,) whether both handles lie on one line.
    """
    third = np.diff(frames)[:, None] / 3.0
    own = np.stack(np.broadcast_arrays(frames[:, None], values), axis=-1)
    left, right = own.copy(), own.copy()
    left[1:, :, 0] -= third
    left[1:, :, 1] = into
    right[:-1, :, 0] += third
    right[:-1, :, 1] = out
    # Nothing lies before the first key and after the last: their handles go straight on.
    left[0], right[-1] = 2.0 * own[0] - right[0], 2.0 * own[-1] - left[-1]
    inner = smooth.copy()
    inner[[0, -1]] = False
    return BezierKeys(
        frames=frames.astype(np.float32),
        values=values.astype(np.float32),
        left=left.astype(np.float32),
        right=right.astype(np.float32),
        smooth=inner,
    )


def halfway_values(values: Floats, slopes: Floats) -> Floats:
    """What is played half way from each frame to the next (frames − 1, …).

    Args:
        values: (frames, …) of keys with automatic handles.
        slopes: (frames, …) of these, per frame.
    """
    return 0.5 * (values[:-1] + values[1:]) + 0.375 * _HANDLE * (slopes[:-1] - slopes[1:])
