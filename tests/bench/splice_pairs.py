# SPDX-License-Identifier: GPL-3.0-or-later
"""The laws of splicing over all pairs of recorded clips: every part, as joints have it.

Each clip is thinned to some moments over its whole length, so that hundreds of pairs take a minute.
What is measured are the referee's angles (tests/referee/clip_measures.py). Parts are seen from
chest and pelvis as these ride on their bones, turned as joints have them on average: from shoulders
at each moment a shrug would turn the chest. Where two files rest alike, both ride alike.

What a body or a clip does not tell is not measured: of game characters whose hip joints slide,
which way a pelvis faces; of people who never stand, how it is tilted; of limbs that bend in any
plane, how they are wrung; of who lies, whether they lean. All that joints say, and no name.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import bpy
import numpy as np

from octo_motion.blender.animation.clips import read_clip
from octo_motion.blender.scene.imports import import_clip
from octo_motion.core.errors import ClipError, OctoMotionError
from octo_motion.core.rotations import multiply, to_matrix
from octo_motion.core.splicing.clip.clip import Clip, posture_of, sample_world
from octo_motion.core.splicing.clip.rest_pose import average_pose
from octo_motion.core.splicing.clip.splice_timing import Timing
from octo_motion.core.splicing.humanoid.correspondence import rest_alike, same_build
from octo_motion.core.splicing.humanoid.landmarks import Landmarks
from octo_motion.core.splicing.humanoid.mapping import map_skeleton
from octo_motion.core.splicing.transfer.parts import PARTS
from octo_motion.core.splicing.transfer.splice import Splice, build_splices
from tests.bench.splice_joints import joints_at
from tests.bench.splicing import quiet_blender
from tests.core.splice_bodies import reference_poses_found_once
from tests.referee import clip_measures as measures
from tests.referee.clip_measures import SIDES, Joints, Twist
from tests.referee.recording import Flags, Floats
from tests.referee.rest_poses import Bvh

MOMENTS: Final = 48
"""So many at most are taken of a clip, over its whole length."""

FOLDERS: Final = (
    *("animated_drawings", "cmu", "makehuman", "misc", "odd_real", "pybvh", "secondlife"),
    "rigs_with_actions",
)
_RATE: Final = 24.0
"""Frames per second of a new scene."""
_LEAST: Final = 5
"""Moments of which a clip has to have more to be a motion."""
ACTIONS: Final = {
    "KayKit_Knight": ("Idle", "Walking_A", "Running_A", "Unarmed_Melee_Attack_Punch_A"),
    "RobotExpressive": ("Idle", "Walking", "Punch", "Wave"),
}
"""Of files with many: some that differ."""

STACKS: Final[dict[str, tuple[tuple[str, dict[str, Any]], ...]]] = {
    "above": (("right_arm", {}), ("left_arm", {"goal": "exact"}), ("head", {})),
    "legs": (("legs", {}),),
    "travel": (("legs", {"travel": True}),),
    "trunk": (("trunk", {}),),
}
"""What is spliced onto a base at once; arms in either way to reach."""

LIMITS: Final = {
    "lean": 3.0,
    "hand": 3.0,
    "foot": 3.0,
    "arm": 3.0,
    "leg": 3.0,
    "head": 3.0,
    "trunk": 3.0,
    "reach": 2.0,
    "wrung": 20.0,
}
"""Degrees; of the reach percent of the arm."""

_UPRIGHT: Final = 45.0
"""Degrees of hips → neck against the vertical beyond which nobody is upright."""
_LIKE: Final = 1.0
"""Degrees by which upper and lower limbs of other proportions may lie off, of which the one points
from root to end as the other does, and is bent as much: limbs are built alike where it is less."""
_FIXED: Final = 0.02
"""Leg lengths that hip joints may move on the pelvis: those of some game characters slide."""
_SWAYING: Final = 3.0
"""Degrees by which the line across a chest that is still may turn on it."""
_APART: Final = 0.08
"""Of the shoulders' width: how far collar bones begin from each other at least to tell left."""
_SAME: Final = 0.01
"""Of their distance: how far joints on a bone may be off, and it is the same body's."""
_FLAT: Final = 1e-3
"""Joints that spread less than this sideways do not tell how a bone is turned."""
_STANDS: Final = (0.9, 0.1)
"""Of legs and trunk, how long a body is that stands; and for how much of the clip it does."""
_ONE_PLANE: Final = (15.0, 0.9)
"""Degrees off their usual plane that limbs bend which have one, and for how much of the clip."""
_SOFT: Final = 0.04
"""Of an arm: the last stretch of its reach, over which elbows straighten gently."""

_LIMBS: Final = {"arm": ("shoulder", "elbow", "hand"), "leg": ("thigh", "knee", "foot")}
_ROOTS: Final = {"arm": "upper_arm", "leg": "thigh"}


@dataclass(frozen=True, eq=False)
class Take:
    """A clip that was read and thinned, and what its joints tell."""

    name: str
    clip: Clip
    landmarks: Landmarks

    @cached_property
    def joints(self) -> Joints:
        """(moments, 3) each, world."""
        return joints_at(self.clip, self.landmarks, self.clip.frames)

    def axes(self, clip: Clip, landmark: str) -> Floats:
        """(moments, 3, 3) of a bone in a clip of this skeleton, world."""
        bone = clip.skeleton.index[self.landmarks[landmark]]
        turned = posture_of(clip.skeleton, clip.rotations, clip.locations).orientation(bone)
        return to_matrix(multiply(sample_world(clip, clip.frames)[0], turned))

    @cached_property
    def riding(self) -> dict[str, Floats]:
        """Along the axes of hips and chest (3, 3): the frame that joints tell on average."""
        joints = self.joints
        feet = 0.5 * (joints["left_foot"] + joints["right_foot"])
        ways = {
            "hips": (joints["left_thigh"] - joints["right_thigh"], joints["neck"] - feet),
            "chest": (self._across, joints["neck"] - joints["spine"]),
        }
        weights = np.clip((self._stretched / self._stretched.max() - 0.8) / 0.15, 0.02, 1.0)
        return {
            bone: _usual(_seen(self.axes(self.clip, bone), _frame(*way)), weights)
            for bone, way in ways.items()
        }

    def fixed(self, bone: str) -> dict[str, Floats]:
        """Joints that stay on hips or chest: places (3,) along its axes, its own left out."""
        names = {"hips": ("left_thigh", "right_thigh", "spine"), "chest": ("neck", "head")}[bone]
        places = {name: self.joints[name] for name in names}
        if bone == "chest":
            sides = zip(SIDES, self._collars, strict=False)
            places |= {f"{side}_collar": each for side, each in sides}
        clip, own = self.clip, self.landmarks[bone]
        begins = _places(clip, own)
        axes, size = self.axes(clip, bone), self.length("leg", "left")
        seen = {name: _along(axes, each - begins) for name, each in places.items()}
        return {
            name: each.mean(axis=0)
            for name, each in seen.items()
            if np.linalg.norm(np.ptp(each, axis=0)) < _FIXED * size
        }

    @cached_property
    def _collars(self) -> tuple[Floats, ...]:
        """Where left and right collar bones begin (moments, 3), world, if there are any."""
        names = [self.landmarks.get(f"clavicle.{side}") for side in "LR"]
        return tuple(_places(self.clip, each) for each in names if each) if all(names) else ()

    @cached_property
    def _stretched(self) -> Floats:
        """(moments,) how far the neck is from the feet, in lengths of trunk and legs."""
        joints = self.joints
        middle, feet = (
            0.5 * (joints[f"left_{each}"] + joints[f"right_{each}"]) for each in ("thigh", "foot")
        )
        trunk = np.linalg.norm(joints["neck"] - middle, axis=1).max()
        length = trunk + 0.5 * sum(self.length("leg", side) for side in SIDES)
        return np.linalg.norm(joints["neck"] - feet, axis=1) / length

    @cached_property
    def _across(self) -> Floats:
        """(moments, 3) to the left, by what moves least on the chest: shoulders or collar bones."""
        return min(self._lines(), key=self._sway)

    def _lines(self) -> Sequence[Floats]:
        joints = self.joints
        lines = [joints["left_shoulder"] - joints["right_shoulder"]]
        if self._collars:
            roots = self._collars[0] - self._collars[1]
            width = float(np.median(np.linalg.norm(lines[0], axis=1)))
            # Some begin in the middle, both of them.
            if np.linalg.norm(roots, axis=1).min() > _APART * width:
                lines.append(roots)
        return lines

    def _sway(self, line: Floats) -> float:
        """Degrees by which a line turns on the chest."""
        seen = _along(self.axes(self.clip, "chest"), measures.unit(line))
        return float(np.quantile(measures.angle(seen, np.median(seen, axis=0)[None]), 0.9))

    @cached_property
    def has_still_chest(self) -> bool:
        """Whether there is a line across the chest that stays on it."""
        return self._sway(self._across) < _SWAYING

    @cached_property
    def has_fixed_hips(self) -> bool:
        """Whether hip joints stay where they are on the pelvis."""
        axes, most = self.axes(self.clip, "hips"), 0.0
        for side in SIDES:
            places = _along(axes, self.joints[f"{side}_thigh"] - self.joints["hips"])
            most = max(most, float(np.linalg.norm(np.ptp(places, axis=0))))
        return most < _FIXED * self.length("leg", "left")

    @cached_property
    def stands(self) -> bool:
        """Whether somebody stands in the clip, with a pelvis as one stands."""
        stretched, share = _STANDS
        return bool((self._stretched > stretched).mean() > share)

    def parts(self, limb: str, side: str) -> tuple[float, float]:
        """Lengths of upper and lower limb, world."""
        root, middle, end = (self.joints[f"{side}_{each}"] for each in _LIMBS[limb])
        upper, lower = (np.linalg.norm(each, axis=1) for each in (middle - root, end - middle))
        return float(np.median(upper)), float(np.median(lower))

    def length(self, limb: str, side: str) -> float:
        """Of a limb, world."""
        return sum(self.parts(limb, side))

    def bends(self, clip: Clip, joints: Joints, limb: str, side: str) -> Twist:
        """How a limb's upper bone is turned against the plane in which it bends."""
        upper, middle, lower = (joints[f"{side}_{each}"] for each in _LIMBS[limb])
        return measures.twist(
            upper, middle, lower, self.axes(clip, f"{_ROOTS[limb]}.{side[0].upper()}")
        )


def _places(clip: Clip, bone: str) -> Floats:
    """(moments, 3) where a bone begins, world."""
    turns, shifts, scale = sample_world(clip, clip.frames)
    head = posture_of(clip.skeleton, clip.rotations, clip.locations).head(clip.skeleton.index[bone])
    return shifts + scale * np.einsum("mij,mj->mi", to_matrix(turns), head)


def _frame(left: Floats, up: Floats) -> Floats:
    x = measures.unit(left)
    z = measures.unit(up - np.sum(up * x, axis=-1, keepdims=True) * x)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _seen(axes: Floats, frames: Floats) -> Floats:
    return np.einsum("mji,mjk->mik", axes, frames)


def _along(axes: Floats, vectors: Floats) -> Floats:
    return np.einsum("mji,mj->mi", axes, vectors)


def _usual(turns: Floats, weights: Floats) -> Floats:
    """A mean (3, 3) of rotations (moments, 3, 3) that few strange ones do not draw away."""
    mean, near = np.eye(3), weights
    for _ in range(8):
        left, _, right = np.linalg.svd(np.einsum("m,mij->ij", near, turns))
        mean = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
        near = weights / np.maximum(np.linalg.norm(turns - mean, axis=(1, 2)), 0.05)
    return mean


@dataclass(frozen=True, eq=False)
class Pair:
    """A clip spliced onto a base."""

    base: Take
    clip: Take

    @cached_property
    def rest_alike(self) -> bool:
        """Whether both are of one armature, or as good as that."""
        return rest_alike(
            self.base.clip.skeleton,
            self.clip.clip.skeleton,
            (self.base.landmarks, self.clip.landmarks),
        )

    @cached_property
    def same_build(self) -> bool:
        """Whether all bones between landmarks are of the same lengths, up to one factor."""
        return same_build(
            self.base.clip.skeleton,
            self.clip.clip.skeleton,
            (self.base.landmarks, self.clip.landmarks),
        )

    def laid(self, bone: str) -> Floats | None:
        """(3, 3) from axes of the base's hips or chest to those of the clip's, where the same
        joints sit on both at the same places, but for one size; none where it is another body.
        """
        ours, theirs = self.base.fixed(bone), self.clip.fixed(bone)
        names = sorted(ours.keys() & theirs.keys())
        if len(names) < 2 or not self.same_build:
            return None
        first, second = (np.array([each[name] for name in names]) for each in (ours, theirs))
        first, second = (each / max(np.linalg.norm(each), 1e-12) for each in (first, second))
        left, spread, right = np.linalg.svd(second.T @ first)
        turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
        alike = np.linalg.norm(second - first @ turn.T, axis=1).max() < _SAME
        return turn if alike and spread[1] > _FLAT else None

    def measured(self, stack: str) -> dict[str, Floats]:
        """(moments, …) of each law, as in ``LIMITS``; only what the two bodies tell."""
        base, other = self.base, self.clip
        count = min(len(base.clip), len(other.clip))
        timing = Timing(1.0, 1.0, rate=base.clip.rate / other.clip.rate)
        splices = [
            Splice(PARTS[part], other.clip, timing, other.landmarks, **settings)
            for part, settings in STACKS[stack]
        ]
        made = build_splices(base.clip, base.landmarks, splices).taken(np.arange(count))
        ours = joints_at(made, base.landmarks, made.frames)
        theirs, before = (
            {joint: places[:count] for joint, places in each.joints.items()}
            for each in (other, base)
        )
        look = _Look(self, made, ours, theirs, before)
        found = look.above() if stack == "above" else getattr(look, stack)()
        found["lean"] = look.lean(theirs if stack == "trunk" else before)
        return {name: values for name, values in found.items() if values.size}


@dataclass(frozen=True, eq=False)
class _Look:
    """A result, the clip and the base as it was, at the same moments."""

    pair: Pair
    made: Clip
    ours: Joints
    theirs: Joints
    before: Joints

    @property
    def _upright(self) -> Flags:
        return (measures.lean(self.before) < _UPRIGHT) & (measures.lean(self.theirs) < _UPRIGHT)

    def lean(self, wanted: Joints) -> Floats:
        """Of who is upright."""
        off = np.abs(measures.lean(self.ours) - measures.lean(wanted))
        return off[self._upright]

    def _frames(self, bone: str) -> tuple[Floats, Floats]:
        """Chest or hips as they ride on their bones, of the result and of the clip."""
        base, other = self.pair.base, self.pair.clip
        rides = base.riding[bone], other.riding[bone]
        between = np.eye(3) if self.pair.rest_alike else self.pair.laid(bone)
        if between is not None:
            rides = rides[0], between @ rides[0]
        axes = base.axes(self.made, bone), other.axes(other.clip, bone)[: len(self.made)]
        return axes[0] @ rides[0], axes[1] @ rides[1]

    def _apart(self, frames: tuple[Floats, Floats], start: str, end: str) -> Floats:
        ways = (each[end] - each[start] for each in (self.ours, self.theirs))
        return measures.angle(*(_along(*each) for each in zip(frames, ways, strict=True)))

    def above(self) -> dict[str, Floats]:
        """Arms and head."""
        pair, found = self.pair, dict[str, list[Floats]]()
        found["reach"] = [self._reach("left")]
        found["wrung"] = [np.array([self._wrung("arm", side)]) for side in SIDES]
        if pair.rest_alike or (pair.base.has_still_chest and pair.clip.has_still_chest):
            frames = self._frames("chest")
            found |= self._limb(frames, "arm", "hand")
            if np.linalg.norm(self.theirs["head"] - self.theirs["neck"], axis=1).min() > 0.0 and (
                np.linalg.norm(self.ours["head"] - self.ours["neck"], axis=1).min() > 0.0
            ):
                found["head"] = [self._apart(frames, "neck", "head")]
        return _joined(found)

    def legs(self) -> dict[str, Floats]:
        """Legs seen from the pelvis."""
        pair, found = self.pair, dict[str, list[Floats]]()
        found["wrung"] = [np.array([self._wrung("leg", side)]) for side in SIDES]
        stands = pair.base.stands and pair.clip.stands
        if pair.rest_alike or (stands and self._fixed_hips):
            found |= self._limb(self._frames("hips"), "leg", "foot")
        return _joined(found)

    def travel(self) -> dict[str, Floats]:
        """Legs with their way, seen by one who faces as the pelvis does."""
        if not self._fixed_hips:
            return {}
        level = measures.level(self.ours), measures.level(self.theirs)
        return _joined(self._limb(level, "leg", "foot", self._upright))

    def trunk(self) -> dict[str, Floats]:
        """Hips to neck, likewise."""
        if not self._fixed_hips:
            return {}
        off = measures.angle(measures.tilt(self.ours), measures.tilt(self.theirs))
        return {"trunk": off[self._upright]}

    @property
    def _fixed_hips(self) -> bool:
        return self.pair.base.has_fixed_hips and self.pair.clip.has_fixed_hips

    def _limb(
        self, frames: tuple[Floats, Floats], limb: str, end: str, chosen: Flags | None = None
    ) -> dict[str, list[Floats]]:
        """From root to end; and upper and lower limb where these are built alike."""
        found = dict[str, list[Floats]]({end: [], limb: []})
        chosen = np.ones(len(self.made), dtype=bool) if chosen is None else chosen
        for side in SIDES:
            root, middle, last = (f"{side}_{each}" for each in _LIMBS[limb])
            found[end].append(self._apart(frames, root, last)[chosen])
            # An arm that reaches, the left one, bends as it has to.
            if (limb, side) != ("arm", "left"):
                like = chosen & (self._unlike(limb, side) < _LIKE)
                found[limb] += [
                    self._apart(frames, *each)[like] for each in ((root, middle), (middle, last))
                ]
        return found

    def _unlike(self, limb: str, side: str) -> Floats:
        """(moments,) degrees that proportions alone turn upper and lower limb."""
        root, middle, end = (self.theirs[f"{side}_{each}"] for each in _LIMBS[limb])
        bend = np.radians(measures.angle(middle - root, end - middle))
        lifts = [
            np.stack(
                [
                    np.arctan2(each * np.sin(bend), other + each * np.cos(bend))
                    for each, other in ((lower, upper), (upper, lower))
                ]
            )
            for upper, lower in (
                take.parts(limb, side) for take in (self.pair.base, self.pair.clip)
            )
        ]
        return np.degrees(np.abs(lifts[0] - lifts[1])).max(axis=0)

    def _reach(self, side: str) -> Floats:
        """Percent of the arm by which a hand is nearer or farther than it should, where an arm
        like this gets there.
        """
        ends = []
        for take, joints in ((self.pair.base, self.ours), (self.pair.clip, self.theirs)):
            way = joints[f"{side}_hand"] - joints[f"{side}_shoulder"]
            ends.append(np.linalg.norm(way, axis=1) / take.length("arm", side))
        upper, lower = self.pair.base.parts("arm", side)
        least = abs(upper - lower) / (upper + lower)
        within = (ends[1] < 1.0 - _SOFT) & (ends[1] > max(least + 0.1, 0.3))
        return 100.0 * np.abs(ends[0] - ends[1])[within]

    def _wrung(self, limb: str, side: str) -> float:
        """Degrees by which an upper arm or thigh is turned about itself otherwise than its own
        clip has it; NaN where that does not tell it. Of one armature the clip does.
        """
        base, other = self.pair.base, self.pair.clip
        result = base.bends(self.made, self.ours, limb, side)
        source = other.bends(other.clip, other.joints, limb, side)
        if self.pair.rest_alike:
            count = len(result.bent)
            bent = (result.bent > measures.BENT) & (source.bent[:count] > measures.BENT)
            off = measures.angle(result.normals, source.normals[:count])[bent]
            return float(off.max()) if off.size else np.nan
        own = base.bends(base.clip, base.joints, limb, side)
        # Of one body in files that rest otherwise tests/referee/test_copies.py tells: one of these
        # clips bends a knee 44° off the plane in which the same leg bends in the others.
        if self.pair.same_build or not (_one_plane(source) and _one_plane(own)):
            return np.nan
        return measures.twist_between(result, own)


def _one_plane(twist: Twist) -> bool:
    """Whether a limb bends in one plane, as seen from its upper bone."""
    bent = twist.normals[twist.bent > measures.BENT]
    if len(bent) < 3:
        return False
    degrees, share = _ONE_PLANE
    off = measures.angle(bent, np.median(bent, axis=0)[None])
    return bool((off < degrees).mean() > share)


def _joined(found: dict[str, list[Floats]]) -> dict[str, Floats]:
    joined = {name: np.concatenate(each) for name, each in found.items() if each}
    return {name: values[np.isfinite(values)] for name, values in joined.items()}


# --- Reading -------------------------------------------------------------------------------------


def takes(data: Path, folder: Path) -> list[Take]:
    """All clips of people that can be read, thinned."""
    found = []
    for path in sorted(path for each in FOLDERS for path in (data / each).iterdir()):
        if path.suffix not in {".bvh", ".glb"}:
            continue
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        for name, clip in _clips(path, folder):
            mapped = map_skeleton(clip.skeleton, average_pose(clip))
            if not mapped.problem:
                found.append(Take(name, clip, mapped.landmarks))
    return found


def _clips(path: Path, folder: Path) -> Iterator[tuple[str, Clip]]:
    try:
        with quiet_blender():
            armature: Any = bpy.data.objects[
                import_clip(_thinned(path, folder), bpy.context).armatures[0]
            ]
        actions = {path.stem: armature.animation_data.action}
        if path.suffix != ".bvh":
            each = {action.name.rpartition(" ")[2]: action for action in bpy.data.actions}
            wanted = ACTIONS.get(path.stem, ())
            actions = {f"{path.stem} {key}": each[key] for key in wanted if key in each}
        for name, action in actions.items():
            slot = next(each for each in action.slots if each.target_id_type == "OBJECT")
            clip = read_clip(armature, action, slot)
            thinned = max(1, -(-len(clip) // MOMENTS))
            rows = np.arange(0, len(clip), thinned)
            if len(rows) < _LEAST:
                continue
            frames = np.arange(1.0, len(rows) + 1.0)
            yield name, replace(clip.taken(rows), frames=frames, rate=clip.rate / thinned)
    except OctoMotionError:
        # A pose, or a file without a motion.
        return


def _thinned(path: Path, folder: Path) -> Path:
    if path.suffix != ".bvh":
        return path
    try:
        clip = Bvh.read(path)
    except ValueError:
        # Only the import reads what is not well formed.
        return path
    step = max(1, -(-len(clip.motion) // MOMENTS))
    # A moment a frame: what is measured does not hang on how fast people move.
    return Bvh(clip.joints, 1.0 / _RATE, clip.motion[::step]).write(folder / path.name)


# --- Telling -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Off:
    """The worst moment of one law on one pair, and the usual one."""

    base: str
    clip: str
    stack: str
    law: str
    most: float
    median: float


def measured(pair: Pair, stack: str) -> list[Off]:
    """All laws of a stack on a pair."""
    return [
        Off(pair.base.name, pair.clip.name, stack, law, float(each.max()), float(np.median(each)))
        for law, each in pair.measured(stack).items()
    ]


def text(found: Sequence[Off]) -> str:
    """A row for each law."""
    return _table(_rows(found))


def _rows(found: Sequence[Off]) -> list[dict[str, Any]]:
    rows = []
    for stack, law in dict.fromkeys((each.stack, each.law) for each in found):
        chosen = [each for each in found if (each.stack, each.law) == (stack, law)]
        most = np.array([each.most for each in chosen])
        rows.append(
            {
                "law": f"{stack}, {law}",
                "pairs": len(most),
                "median": float(np.median([each.median for each in chosen])),
                "nearly": float(np.quantile(most, 0.99)),
                "most": float(most.max()),
                "limit": LIMITS[law],
                "beyond": int((most > LIMITS[law]).sum()),
            }
        )
    return rows


def _table(rows: Sequence[dict[str, Any]]) -> str:
    head = f"{'':16}{'pairs':>7}{'median':>9}{'99 %':>9}{'most':>9}{'limit':>8}{'beyond':>8}"
    return "\n".join(
        [
            head,
            *(
                f"{each['law']:16}{each['pairs']:7}{each['median']:9.3f}{each['nearly']:9.3f}"
                f"{each['most']:9.3f}{each['limit']:8.0f}{each['beyond']:8}"
                for each in rows
            ),
        ]
    )


_LEGEND: Final = """\
first what is spliced, then what is measured: degrees (of the reach, percent of the arm)
median: of all moments of a pair, and of these of all pairs; 99 %, most: of each pair's worst moment
above: both arms and the head; travel: legs with their way"""


def summary(data: Path, most: int = 20) -> dict[str, Any]:
    """All pairs of the clips of a folder as JSON keeps them: a row for each law, and names of what
    is beyond one, the worst first, so many at most.
    """
    found = all_measured(data, list(STACKS))
    beyond = sorted((e for e in found if e.most > LIMITS[e.law]), key=lambda e: -e.most)
    return {"laws": _rows(found), "beyond": [asdict(each) for each in beyond[:most]]}


def summary_text(found: dict[str, Any]) -> str:
    """The table, and what its columns are."""
    return f"{_table(found['laws'])}\n\n{_LEGEND}"


def summary_said(found: dict[str, Any]) -> list[str]:
    """How many rows there are, and which are beyond a law."""
    rows = sum(each["pairs"] for each in found["laws"])
    beyond = sum(each["beyond"] for each in found["laws"])
    said = f"Of {rows:,} measured laws on pairs {beyond or 'none'} {'is' if beyond < 2 else 'are'}"
    names = [f"{e['base']} ← {e['clip']}, {e['law']}: {e['most']:.1f}" for e in found["beyond"]]
    return [f"{said} beyond the limit{': ' * bool(names)}{'; '.join(names)}."]


def main(words: Sequence[str]) -> None:
    """Measure all pairs, and print a table."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench pairs", description=__doc__)
    parser.add_argument("--stacks", nargs="+", default=list(STACKS), choices=list(STACKS))
    parser.add_argument("--beyond", type=int, default=10, help="name so many of each law")
    arguments = parser.parse_args(words)
    data = os.environ.get("OCTO_MOTION_DATA")
    if not data:
        parser.error("OCTO_MOTION_DATA is to name the folder with the clips.")
    found = all_measured(Path(data), arguments.stacks)
    print(text(found))
    for stack, law in dict.fromkeys((each.stack, each.law) for each in found):
        beyond = [e for e in found if (e.stack, e.law) == (stack, law) and e.most > LIMITS[law]]
        for each in sorted(beyond, key=lambda e: -e.most)[: arguments.beyond]:
            print(f"{stack}, {law}: {each.base} <- {each.clip}: {each.most:.2f}")
    sys.stdout.flush()
    os._exit(0)  # Blender 4.5 may wait for ever at its own end.


def all_measured(data: Path, stacks: Sequence[str]) -> list[Off]:
    """All laws of some stacks on all pairs of the clips of a folder."""
    with quiet_blender(), tempfile.TemporaryDirectory() as folder:
        people = takes(data, Path(folder))
        with reference_poses_found_once():
            return [
                off
                for base in people
                for clip in people
                if base is not clip
                for stack in stacks
                for off in measured_where_possible(Pair(base, clip), stack)
            ]


def measured_where_possible(pair: Pair, stack: str) -> list[Off]:
    """The same; nothing of a limb that follows controls, which is refused."""
    try:
        return measured(pair, stack)
    except ClipError:
        return []
