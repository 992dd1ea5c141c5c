# SPDX-License-Identifier: GPL-3.0-or-later
"""Made-up humanoids and motions for tests of splicing."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any
from unittest.mock import patch
from weakref import WeakKeyDictionary

import numpy as np

from octo_motion.core.rotations import (
    Floats,
    conjugate,
    from_rotation_vector,
    multiply,
    normalized,
    rotate,
    to_matrix,
)
from octo_motion.core.skeleton import Skeleton
from octo_motion.core.splicing.clip.clip import Clip, unposed
from octo_motion.core.splicing.humanoid.landmarks import Landmarks
from octo_motion.core.splicing.transfer import retarget
from octo_motion.core.splicing.transfer.splice import Splice, build_splices
from tests.core.rigs import skeleton_of

_TRUNK = (
    ("hips", "", (0.0, 0.0, 1.0)),
    ("spine", "hips", (0.0, 0.02, 1.1)),
    ("chest", "spine", (0.0, 0.0, 1.25)),
    ("neck", "chest", (0.0, 0.02, 1.5)),
    ("head", "neck", (0.0, 0.0, 1.6)),
    ("crown", "head", (0.0, 0.01, 1.8)),
)
_SIDE = (
    ("clavicle", "chest", (0.04, 0.0, 1.45)),
    ("upper_arm", "clavicle", (0.18, 0.02, 1.44)),
    ("forearm", "upper_arm", (0.45, 0.03, 1.44)),
    ("hand", "forearm", (0.7, 0.0, 1.44)),
    ("finger", "hand", (0.8, 0.0, 1.43)),
    ("thigh", "hips", (0.1, 0.0, 0.95)),
    ("shin", "thigh", (0.11, -0.02, 0.5)),
    ("foot", "shin", (0.1, 0.03, 0.08)),
    ("toe", "foot", (0.1, -0.12, 0.02)),
)


def spliced(base: Clip, landmarks: Landmarks | None, splice: Splice) -> Clip:
    """One splice onto a clip."""
    return build_splices(base, landmarks, [splice])


@contextmanager
def reference_poses_found_once() -> Iterator[None]:
    """Each clip's reference pose is found once, however many splices are made of it: it hangs on
    the clip and its landmarks alone.
    """
    find, known = retarget.find_reference_pose, WeakKeyDictionary[Clip, dict[Any, Any]]()

    def once(clip: Clip, landmarks: Landmarks, **asked: bool) -> Any:
        of_clip = known.setdefault(clip, {})
        key = (landmarks.reference, *sorted(landmarks.bones.items()), *sorted(asked.items()))
        if key not in of_clip:
            of_clip[key] = find(clip, landmarks, **asked)
        return of_clip[key]

    with patch.object(retarget, "find_reference_pose", once):
        yield


def humanoid(random: np.random.Generator, *, same_proportions: bool = True) -> Skeleton:
    """A humanoid whose bones' axes lie anywhere."""
    rows = [(name, parent, np.array(head)) for name, parent, head in _TRUNK]
    for side, sign in (("L", 1.0), ("R", -1.0)):
        for name, parent, head in _SIDE:
            above = parent if parent in ("chest", "hips") else f"{parent}.{side}"
            rows.append((f"{name}.{side}", above, np.array(head) * (sign, 1.0, 1.0)))
    if not same_proportions:
        stretch = random.uniform(0.8, 1.25, 3)
        rows = [(n, p, h * stretch + random.normal(0.0, 0.005, 3)) for n, p, h in rows]
    index = {name: number for number, (name, _, _) in enumerate(rows)}
    matrices = []
    for _, _, head in rows:
        matrix = np.eye(4)
        matrix[:3, :3] = to_matrix(normalized(random.normal(size=4)))
        matrix[:3, 3] = head
        matrices.append(matrix)
    return skeleton_of(
        [name for name, _, _ in rows],
        [index.get(parent, -1) for _, parent, _ in rows],
        matrices,
        [0.1] * len(rows),
    )


LANDMARKS = Landmarks(
    {
        name: name
        for name in (
            *(row[0] for row in _TRUNK if row[0] != "crown"),
            *(f"{row[0]}.{side}" for row in _SIDE for side in "LR" if row[0] != "finger"),
        )
    }
)


def motion(
    random: np.random.Generator, skeleton: Skeleton, frames: int = 12, *, strength: float = 0.5
) -> Clip:
    """Bones that turn smoothly and at random, on hips that wander."""
    steps = np.linspace(0.0, 1.0, frames)[:, None, None]
    waves = [
        np.sin(2.0 * np.pi * (number * steps + random.uniform(size=(1, len(skeleton), 3))))
        * random.normal(0.0, strength, (1, len(skeleton), 3))
        for number in (0.5, 1.0)
    ]
    rotations = from_rotation_vector(sum(waves, np.zeros(())))
    locations = np.zeros((frames, len(skeleton), 3))
    locations[:, 0] = np.cumsum(random.normal(0.0, 0.05, (frames, 3)), axis=0)
    return Clip(
        "made up",
        skeleton,
        np.arange(1.0, frames + 1.0),
        30.0,
        rotations,
        locations,
        np.broadcast_to(np.eye(4), (frames, 4, 4)).copy(),
    )


def moved(clip: Clip, turn: Floats, shift: Floats) -> Clip:
    """The same motion elsewhere in the world, by the root bone."""
    orientations, heads = clip.skeleton.pose(clip.rotations, clip.locations)

    placed = unposed(clip.skeleton, multiply(turn, orientations), rotate(turn, heads) + shift)
    return replace(clip, rotations=placed[0], locations=placed[1])


def in_another_file(random: np.random.Generator, clip: Clip, *, posed_rest: bool) -> Clip:
    """The same motion on bones with other axes, perhaps with its first frame as its rest pose, in
    other units.
    """
    scale = 0.3
    skeleton = clip.skeleton
    orientations, heads = skeleton.pose(clip.rotations, clip.locations)
    rests, places = skeleton.rest_rotations, skeleton.heads
    if posed_rest:
        rests, places = orientations[0], heads[0]
    other_axes = normalized(random.normal(size=(len(skeleton), 4)))
    matrices = np.tile(np.eye(4), (len(skeleton), 1, 1))
    matrices[:, :3, :3] = to_matrix(multiply(rests, other_axes))
    matrices[:, :3, 3] = scale * places
    other = replace(skeleton, rest_matrices=matrices)
    rotations, locations = unposed(other, multiply(orientations, other_axes), scale * heads)
    return replace(clip, skeleton=other, rotations=rotations, locations=locations)


def relative(clip: Clip, bone: str, reference: str) -> Floats:
    """Where a bone's head is as seen from another bone, (frames, 3)."""

    orientations, heads = clip.skeleton.pose(clip.rotations, clip.locations)
    one, other = clip.skeleton.index[bone], clip.skeleton.index[reference]
    return rotate(conjugate(orientations[:, other]), heads[:, one] - heads[:, other])


def turned_about(axis: tuple[float, float, float], angle: float) -> Floats:
    return from_rotation_vector(np.array(axis) * angle)
