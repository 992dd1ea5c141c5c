# SPDX-License-Identifier: GPL-3.0-or-later
"""A humanoid skeleton under any names and in any rest pose, made from numbers."""

from collections.abc import Mapping

import numpy as np

from octo_motion.core.rotations import Floats
from octo_motion.core.skeleton import Skeleton
from tests.core.rigs import bone_matrix, skeleton_of

PARENTS = {
    "hips": "",
    "spine": "hips",
    "chest": "spine",
    "neck": "chest",
    "head": "neck",
    **{
        f"{part}.{side}": parent if parent in {"hips", "chest"} else f"{parent}.{side}"
        for side in "LR"
        for part, parent in (
            *(("clavicle", "chest"), ("upper_arm", "clavicle"), ("forearm", "upper_arm")),
            *(("hand", "forearm"), ("thigh", "hips"), ("shin", "thigh"), ("foot", "shin")),
            ("toe", "foot"),
        )
    },
}
"""Parent of each landmark's bone."""

MIDDLE: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "hips": ((0.0, 0.0, 1.0), (0.0, 0.0, 1.1)),
    "spine": ((0.0, 0.0, 1.1), (0.0, 0.0, 1.25)),
    "chest": ((0.0, 0.0, 1.25), (0.0, 0.0, 1.45)),
    "neck": ((0.0, 0.0, 1.5), (0.0, 0.0, 1.58)),
    "head": ((0.0, 0.0, 1.58), (0.0, 0.0, 1.8)),
}
LEFT = {
    "clavicle": ((0.03, 0.0, 1.44), (0.17, 0.0, 1.46)),
    "thigh": ((0.1, 0.0, 0.95), (0.1, -0.01, 0.52)),
    "shin": ((0.1, -0.01, 0.52), (0.1, 0.02, 0.1)),
    "foot": ((0.1, 0.02, 0.1), (0.1, -0.12, 0.02)),
    "toe": ((0.1, -0.12, 0.02), (0.1, -0.19, 0.02)),
}
"""Heads and tails in metres; the body faces −Y, its left is +X."""


def humanoid(
    names: Mapping[str, str] | None = None,
    *,
    arms_down: float = 0.0,
    turn: Floats | None = None,
    scale: float = 1.0,
    without: frozenset[str] = frozenset(),
) -> Skeleton:
    """A humanoid.

    Args:
        names: name of each landmark's bone; those that are not named are called by numbers.
        arms_down: angle between the arms and a T-pose, radians.
        turn: (3, 3) rotation of the whole body.
        scale: size of the whole body.
        without: landmarks that the skeleton lacks; their children hang on the bone before.
    """
    down = np.array([np.cos(arms_down), 0.0, -np.sin(arms_down)])
    start = np.array([0.18, 0.0, 1.46])
    ends = {name: (np.array(head), np.array(tail)) for name, (head, tail) in MIDDLE.items()}
    joints = {"upper_arm": (0.0, 0.28), "forearm": (0.28, 0.54), "hand": (0.54, 0.7)}
    left = {name: (np.array(head), np.array(tail)) for name, (head, tail) in LEFT.items()}
    left |= {name: (start + a * down, start + b * down) for name, (a, b) in joints.items()}
    mirror = np.array([-1.0, 1.0, 1.0])
    for name, (head, tail) in left.items():
        ends[f"{name}.L"] = head, tail
        ends[f"{name}.R"] = head * mirror, tail * mirror
    turn = np.eye(3) if turn is None else turn
    landmarks = [each for each in PARENTS if each not in without]
    matrices = [
        bone_matrix(scale * turn @ ends[each][0], turn @ (ends[each][1] - ends[each][0]), 0.3)
        for each in landmarks
    ]
    lengths = [scale * float(np.linalg.norm(ends[each][1] - ends[each][0])) for each in landmarks]
    return skeleton_of(
        [names[each] if names else number_name(each) for each in landmarks],
        [_parent(each, landmarks) for each in landmarks],
        matrices,
        lengths,
    )


def number_name(landmark: str) -> str:
    """A name that says nothing."""
    return f"Bone.{list(PARENTS).index(landmark):03d}"


def _parent(landmark: str, landmarks: list[str]) -> int:
    parent = PARENTS[landmark]
    while parent and parent not in landmarks:
        parent = PARENTS[parent]
    return landmarks.index(parent) if parent else -1
