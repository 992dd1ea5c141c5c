# SPDX-License-Identifier: GPL-3.0-or-later
"""Splices made with the buttons that an artist has, and the joints of people before and after."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from . import clip_measures as measures
from .clip_measures import SIDES, Twist
from .recording import Floats, Recording, moments, record

_WORDS = {
    "hips": ("hip", "Hips", "Root", "pelvis"),
    "spine": ("abdomen", "LowerBack", "lowerback", "Spine", "Spine1"),
    "neck": ("neck", "Neck", "neckDummy", "lowerneck"),
    "head": ("head", "Head"),
}
_SIDED = {
    "shoulder": ("{s}Shldr", "{Side}Arm", "UpArm{S}", "{Side}Shoulder"),
    "elbow": ("{s}ForeArm", "{Side}ForeArm", "LoArm{S}", "{Side}Elbow"),
    "hand": ("{s}Hand", "{Side}Hand", "Hand{S}", "{Side}Wrist"),
    "thigh": ("{s}Thigh", "{Side}UpLeg", "UpLeg{S}", "{Side}Hip"),
    "knee": ("{s}Shin", "{Side}Leg", "LoLeg{S}", "{Side}Knee"),
    "foot": ("{s}Foot", "{Side}Foot", "Foot{S}", "{Side}Ankle"),
}
UNITS = {
    "lean": "° of hips → neck against the vertical, from whose trunk it is",
    "limb": "° of the part's bones as seen from the body, from the clip's",
    "twist": "° that upper arms or thighs are wrung more than in the base",
}
"""What each measure is in, in the order of the table."""


def bones_of(names: list[str]) -> dict[str, str]:
    """Which bone begins at each joint, in the skeletons that the referee knows."""
    bare = {name.split(":")[-1].replace("_", ""): name for name in names}
    found = {}
    for joint, words in _WORDS.items():
        found[joint] = _first(bare, words)
    for side in SIDES:
        letters = {"s": side[0], "S": side[0].upper(), "Side": side.capitalize()}
        for joint, words in _SIDED.items():
            found[f"{side}_{joint}"] = _first(bare, [word.format(**letters) for word in words])
    return found


def _first(names: Mapping[str, str], words: Any) -> str:
    for word in words:
        if word in names:
            return names[word]
    raise ValueError(f"None of {list(words)} in {sorted(names)}.")


@dataclass(frozen=True, eq=False)
class Person:
    """A person over time: joints, and how their bones are turned."""

    joints: dict[str, Floats]
    """(moments, 3) each, metres."""
    axes: dict[str, Floats]
    """(moments, 3, 3) each, of the bone that begins at the joint."""

    @classmethod
    def of(cls, played: Recording) -> Person:
        """From what was played."""
        rows = {joint: played.names.index(name) for joint, name in bones_of(played.names).items()}
        return cls(
            {joint: played.heads[:, row] for joint, row in rows.items()},
            {joint: played.turns[:, row] for joint, row in rows.items()},
        )

    def during(self, first: int, last: int) -> Person:
        """Some of the moments."""
        return Person(
            {joint: each[first:last] for joint, each in self.joints.items()},
            {joint: each[first:last] for joint, each in self.axes.items()},
        )

    def twist(self, limb: str, side: str) -> Twist:
        """Of ``arm`` or ``leg``."""
        chain = {"arm": ("shoulder", "elbow", "hand"), "leg": ("thigh", "knee", "foot")}[limb]
        root, middle, end = (f"{side}_{joint}" for joint in chain)
        return measures.twist(
            self.joints[root], self.joints[middle], self.joints[end], self.axes[root]
        )


def imported(path: Path) -> Any:
    """The armature of a clip, with its action."""
    if path.suffix == ".bvh":
        bpy.ops.import_anim.bvh(filepath=str(path), update_scene_fps=False, use_fps_scale=False)
        return bpy.context.object
    before = set(bpy.data.objects)
    if path.suffix == ".fbx":
        bpy.ops.import_scene.fbx(filepath=str(path))
    else:
        bpy.ops.import_scene.gltf(filepath=str(path))
    made = [each for each in bpy.data.objects if each not in before and each.type == "ARMATURE"]
    return made[0]


@dataclass(frozen=True, eq=False)
class Splice:
    """Base, clip and result, over the frames in which the splice is fully in."""

    part: str
    base: Person
    clip: Person
    result: Person


def spliced(base: Path, clip: Path, part: str, settings: Mapping[str, Any] | None = None) -> Splice:
    """Put one part of a clip onto a base, as buttons do, and play all three.

    The result is played at the frames where the splice is fully in, and the clip at those that
    come there.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    onto, source = imported(base), imported(clip)
    for armature in (source, onto):
        bpy.context.view_layer.objects.active = armature
        bpy.ops.octo_motion.map_skeleton()
    start, end = _range(onto)
    first, last = _range(source)
    lasts = min(end - start, last - first)
    played_base = Person.of(record(onto, moments(start, start + lasts), with_skin=False))
    played_clip = Person.of(record(source, moments(first, first + lasts), with_skin=False))
    bpy.ops.octo_motion.splice_add(part=part, source=source.name)
    splice = onto.octo_motion.splicing.splices[0]
    splice.base_start, splice.splice_start, splice.rate = start, first, 1.0
    for key, value in (settings or {}).items():
        setattr(splice, key, value)
    bpy.ops.octo_motion.splice_build()
    played = Person.of(record(onto, moments(start, start + lasts), with_skin=False))
    # The middle half: it eases in before, and out after.
    inside = (lasts // 4, max(3 * lasts // 4, lasts // 4 + 1))
    return Splice(
        part, played_base.during(*inside), played_clip.during(*inside), played.during(*inside)
    )


def _range(armature: Any) -> tuple[int, int]:
    first, last = armature.animation_data.action.frame_range
    return int(np.ceil(first)), int(np.floor(last))


def measure(splice: Splice) -> dict[str, float]:
    """Degrees by which the result is off, in what its part brings and in what it leaves alone.

    ``lean`` is that of hips → neck against the vertical, which the base has, or the clip if its
    trunk is taken; ``limb`` the direction of the part's bones as seen from the body; ``twist`` how
    much upper arms or thighs are wrung more than in the base.
    """
    result, clip, base = splice.result.joints, splice.clip.joints, splice.base.joints
    upright = clip if splice.part == "TRUNK" else base
    found = {"lean": _most(np.abs(measures.lean(result) - measures.lean(upright)))}
    if splice.part in {"RIGHT_ARM", "LEFT_ARM"}:
        side = splice.part.split("_")[0].lower()
        found["limb"] = _apart(
            measures.arm_directions(result, side), measures.arm_directions(clip, side)
        )
        found["twist"] = measures.twist_between(
            splice.result.twist("arm", side), splice.base.twist("arm", side)
        )
    elif splice.part == "LEGS":
        found["limb"] = max(
            _apart(measures.leg_directions(result, side), measures.leg_directions(clip, side))
            for side in SIDES
        )
        found["twist"] = max(
            measures.twist_between(splice.result.twist("leg", side), splice.base.twist("leg", side))
            for side in SIDES
        )
    elif splice.part == "HEAD":
        found["limb"] = _most(
            measures.angle(measures.head_direction(result), measures.head_direction(clip))
        )
    else:
        found["limb"] = _most(measures.angle(measures.tilt(result), measures.tilt(clip)))
    return found


def _apart(first: tuple[Floats, Floats], second: tuple[Floats, Floats]) -> float:
    return max(_most(measures.angle(a, b)) for a, b in zip(first, second, strict=True))


def _most(values: Floats) -> float:
    return float(np.max(values))
