# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of an armature's body: its landmarks, and how tall it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final

import bpy
import numpy as np

from ...blender.animation import read_clip
from ...blender.files import load_mappings
from ...blender.rig import armature_data, read_skeleton, world_matrix
from ...core.content_cache import ContentCache, content_key
from ...core.errors import OctoMotionError
from ...core.skeleton import Skeleton
from ...core.splicing.clip import average_pose
from ...core.splicing.humanoid import (
    LANDMARKS,
    OPTIONAL,
    Landmarks,
    ReferenceMoment,
    SkeletonMapping,
    map_skeleton,
    recognised,
    stature,
)
from ...core.splicing.transfer import reference_doubts
from .properties import read_landmarks, splicing_settings

REFERENCE_KEY: Final = "reference_pose"
"""Of a saved mapping: "rest", or a frame."""

_maps: Final[ContentCache[SkeletonMapping]] = ContentCache()
"""Landmarks that were found of skeletons."""

_LOOKS: Final = 50
"""Frames of an action that are looked at to see how its bones lie."""


def in_motion(armature: bpy.types.Object) -> Skeleton | None:
    """The bones as they lie in the armature's action, if it has one that moves them."""
    data = armature.animation_data
    if data is None or data.action is None:
        return None
    first, last = data.action.frame_range
    try:
        return average_pose(read_clip(armature, frames=np.unique(np.linspace(first, last, _LOOKS))))
    except OctoMotionError:
        return None


def clip_doubts(armature: bpy.types.Object, landmarks: Landmarks) -> list[str]:
    """What the armature's action does not tell of how its body stands: sentences."""
    try:
        return reference_doubts(read_clip(armature), landmarks)
    except OctoMotionError:
        return []


@dataclass(frozen=True)
class KnownBody:
    """What is known of an armature's body."""

    landmarks: Landmarks | None
    """None where the table is empty and the skeleton is no humanoid."""
    problem: str = ""
    """Why there are none."""
    found: bool = False
    """Whether the table was empty and could be filled with them."""
    mapping: str = ""
    """The saved mapping that they are from."""
    damaged: tuple[str, ...] = ()
    """What is wrong with saved mappings that were looked at: sentences."""


def known_landmarks(
    armature: bpy.types.Object, skeleton: Skeleton, moving: Skeleton | None
) -> KnownBody:
    """Landmarks of an armature: of its table, completed by the saved mapping of its kind of
    skeleton, and that by what can be found.

    Args:
        armature: the armature object.
        skeleton: its bones as they rest.
        moving: the same as they lie in a motion, if there is one.
    """
    table = read_landmarks(splicing_settings(armature).landmarks)
    bones = dict(table.bones)
    if is_complete(bones):
        return KnownBody(table)
    saved = saved_landmarks(armature)
    known = saved.bones | bones
    if not is_complete(known):
        key = content_key(skeleton, moving)
        found = _maps.get(key, partial(map_skeleton, skeleton, moving))
        if found.problem and not known:
            return KnownBody(None, found.problem, damaged=saved.damaged)
        known = dict(found.landmarks.bones) | known
    reference = table.reference if bones or table.reference != "" else saved.reference
    return KnownBody(
        Landmarks(known, reference), found=not bones, mapping=saved.mapping, damaged=saved.damaged
    )


def is_complete(bones: Mapping[str, str]) -> bool:
    """Whether bones by landmark have all that is required."""
    return all(each in bones for each in LANDMARKS if each not in OPTIONAL)


@dataclass(frozen=True)
class SavedLandmarks:
    """What the saved mappings tell of an armature."""

    mapping: str = ""
    """Name of the one of its kind of skeleton, "" if there is none."""
    bones: dict[str, str] = field(default_factory=dict[str, str])
    """Its bones by landmark."""
    damaged: tuple[str, ...] = ()
    """What is wrong with others: sentences."""
    reference: ReferenceMoment = ""
    """Where the reference pose is found."""


def saved_landmarks(armature: bpy.types.Object) -> SavedLandmarks:
    """What the saved mappings tell of an armature; quick enough to be asked while panels draw."""
    mappings, damaged = load_mappings()
    problems = tuple(str(each) for each in damaged)
    found = recognised(mappings, parents_of(armature)) if mappings else None
    if found is None:
        return SavedLandmarks(damaged=problems)
    name, reference = found[0].name, saved_reference(found[0].further)
    return SavedLandmarks(name, dict(found[1].bones), problems, reference)


def saved_reference(further: Mapping[str, Any]) -> ReferenceMoment:
    """Where a saved mapping says the reference pose is found; as usual if it says nothing."""
    told = further.get(REFERENCE_KEY, "")
    if isinstance(told, (int, float)) and not isinstance(told, bool) and np.isfinite(told):
        return float(told)
    return "rest" if told == "rest" else ""


def parents_of(armature: bpy.types.Object) -> dict[str, str]:
    """Name of the parent of each bone, "" of those without."""
    bones = armature_data(armature).bones
    return {bone.name: bone.parent.name if bone.parent else "" for bone in bones}


def height_of(armature: bpy.types.Object) -> float | None:
    """How tall the body of an armature stands in the world; none where it is no humanoid."""
    try:
        skeleton = read_skeleton(armature)
    except OctoMotionError:
        return None
    landmarks = known_landmarks(armature, skeleton, in_motion(armature)).landmarks
    height = stature(skeleton, landmarks) if landmarks is not None else None
    if height is None:
        return None
    size = float(np.cbrt(abs(np.linalg.det(world_matrix(armature)[:3, :3]))))
    return size * height or None
