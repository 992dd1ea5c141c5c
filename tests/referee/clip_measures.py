# SPDX-License-Identifier: GPL-3.0-or-later
"""What an animator sees go wrong in a splice, from joint positions alone.

A person is some joints over time. No rest pose, no bone axis and no file format has a say: frames
of pelvis and chest are built from where joints are at each moment. Angles are in degrees.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .recording import Floats

SIDES = ("left", "right")
JOINTS = (
    "hips", "spine", "neck", "head",
    *(f"{side}_{joint}" for side in SIDES for joint in
      ("shoulder", "elbow", "hand", "thigh", "knee", "foot")),
)  # fmt: skip
"""What is known of a person: hips and spine are where the trunk begins and where it bends first,
shoulder and thigh where arm and leg begin."""

BENT = 20.0
"""Degrees: a limb that is straighter has no plane."""

Joints = Mapping[str, Floats]
"""(moments, 3) of each of ``JOINTS``, metres."""

UP = np.array([0.0, 0.0, 1.0])


def unit(vectors: Floats) -> Floats:
    """Of length 1."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def angle(first: Floats, second: Floats) -> Floats:
    """Between directions (…, 3)."""
    a, b = unit(first), unit(second)
    return np.degrees(
        2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    )


def _frame(across: Floats, up: Floats) -> Floats:
    """(moments, 3, 3) axes as columns: x to the left, z up the trunk as far as that is square."""
    x = unit(across)
    z = unit(up - np.sum(up * x, axis=-1, keepdims=True) * x)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def chest(joints: Joints) -> Floats:
    """The chest's frame from shoulders, neck and the spine's lower end."""
    return _frame(
        joints["left_shoulder"] - joints["right_shoulder"], joints["neck"] - joints["spine"]
    )


def pelvis(joints: Joints) -> Floats:
    """The pelvis' frame from both thighs, and from them to the spine's lower end."""
    middle = 0.5 * (joints["left_thigh"] + joints["right_thigh"])
    return _frame(joints["left_thigh"] - joints["right_thigh"], joints["spine"] - middle)


def lean(joints: Joints) -> Floats:
    """Of hips → neck against the vertical: a person who bows, or falls over backwards."""
    return angle(joints["neck"] - joints["hips"], UP)


def tilt(joints: Joints) -> Floats:
    """(moments, 3) hips → neck, as seen by one who faces as the pelvis does: which way it leans."""
    return _seen(level(joints), unit(joints["neck"] - joints["hips"]))


def level(joints: Joints) -> Floats:
    """(moments, 3, 3) axes as columns: z upright, x to the left as the thighs have it."""
    x = joints["left_thigh"] - joints["right_thigh"]
    x = unit(x * [1.0, 1.0, 0.0])
    return np.stack([x, np.cross(UP, x), np.broadcast_to(UP, x.shape)], axis=-1)


def _seen(axes: Floats, vectors: Floats) -> Floats:
    return np.einsum("mji,mj->mi", axes, vectors)


def arm_directions(joints: Joints, side: str) -> tuple[Floats, Floats]:
    """Upper arm and forearm, as seen from the chest."""
    shoulder, elbow, hand = (joints[f"{side}_{each}"] for each in ("shoulder", "elbow", "hand"))
    axes = chest(joints)
    return _seen(axes, unit(elbow - shoulder)), _seen(axes, unit(hand - elbow))


def leg_directions(joints: Joints, side: str) -> tuple[Floats, Floats]:
    """Thigh and shin, as seen by one who faces as the pelvis does.

    Not from the pelvis itself: where the spine's lower end lies beside the thighs is the file's
    choice (33° behind them in one, 23° before them in another), and nobody sees it.
    """
    thigh, knee, foot = (joints[f"{side}_{each}"] for each in ("thigh", "knee", "foot"))
    axes = level(joints)
    return _seen(axes, unit(knee - thigh)), _seen(axes, unit(foot - knee))


def head_direction(joints: Joints) -> Floats:
    """Neck → head, as seen from the chest."""
    return _seen(chest(joints), unit(joints["head"] - joints["neck"]))


def trunk_turn(joints: Joints) -> Floats:
    """(moments, 3, 3): the chest, as seen from the pelvis."""
    return np.einsum("mji,mjk->mik", pelvis(joints), chest(joints))


@dataclass(frozen=True, eq=False)
class Twist:
    """How a bone is turned about itself, against the plane in which its limb bends."""

    normals: Floats
    """(moments, 3) of that plane, in the bone's own axes."""
    bent: Floats
    """(moments,) degrees: where it is little there is no plane."""


def twist(root: Floats, middle: Floats, end: Floats, axes: Floats) -> Twist:
    """Of an upper arm or a thigh: the skin is wrung where this changes from clip to result.

    Args:
        root: (moments, 3) shoulder or thigh.
        middle: (moments, 3) elbow or knee.
        end: (moments, 3) hand or foot.
        axes: (moments, 3, 3) the upper bone's own, in the world.
    """
    upper, lower = middle - root, end - middle
    return Twist(_seen(axes, unit(np.cross(upper, lower))), angle(upper, lower))


def twist_between(first: Twist, second: Twist) -> float:
    """By how much one is wrung more than the other, from where both are bent; NaN if nowhere.

    Each with its usual plane, so that two clips which bend at other moments compare.
    """
    usual = []
    for each in (first, second):
        bent = each.normals[each.bent > BENT]
        if not len(bent):
            return float("nan")
        usual.append(unit(np.median(bent, axis=0)))
    return float(angle(*usual))


def height_of(joints: Joints) -> float:
    """Metres from the lower foot to the head, at most of all moments."""
    feet = np.minimum(joints["left_foot"][:, 2], joints["right_foot"][:, 2])
    return float(np.max(joints["head"][:, 2] - feet))
