# SPDX-License-Identifier: GPL-3.0-or-later
"""The octopus' bones: names that mirror, positions, axes, collections."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from ...rotations import Floats, normalized
from .shape import HEAD_BASE, NECK, BodyForm, OctopusShape, body_form

ARM_COLLECTIONS: Final = ("Arms Left", "Arms Right", "Arms Middle")
"""Bone collections of the arms."""
SUCKER_AXIS: Final = "-Z"
"""Bones are rolled so that their local +Z is dorsal: the suckers face this axis."""

ROOT, BODY, HEAD, MANTLE, SIPHON, EYE_LEFT, EYE_RIGHT, FIRST_ARM_BONE = range(8)


@dataclass(frozen=True)
class OctopusBones:
    """An armature as plain arrays, parents before children, in the armature's own space."""

    names: tuple[str, ...]
    parents: tuple[int, ...]
    """Index of each bone's parent, −1 for the root."""
    heads: Floats
    """(bones, 3)"""
    tails: Floats
    """(bones, 3)"""
    dorsal_axes: Floats
    """(bones, 3), unit: the direction of each bone's local +Z."""
    connected: tuple[bool, ...]
    deform: tuple[bool, ...]
    collections: tuple[str, ...]
    """Name of each bone's collection."""
    pairs: tuple[int, ...]
    """Number of the arm pair, from 1 at the front, 0 for bones of the body."""

    @cached_property
    def matrices(self) -> Floats:
        """Rest matrices (bones, 4, 4): columns X, Y along the bone, Z dorsal, and the head."""
        along = normalized(self.tails - self.heads)
        matrices = np.zeros((len(self.names), 4, 4))
        matrices[:, :3, 0] = np.cross(along, self.dorsal_axes)
        matrices[:, :3, 1] = along
        matrices[:, :3, 2] = self.dorsal_axes
        matrices[:, :3, 3] = self.heads
        matrices[:, 3, 3] = 1.0
        return matrices


def arm_pairs(arms: int) -> tuple[tuple[int, str], ...]:
    """Pair number and side ("L", "R" or "") of each arm, in the order of their angles.

    Pairs count from 1 at the front. An odd arm lies on the plane of symmetry, in front, and has the
    first number and no side.
    """
    odd = arms % 2
    middle = [(1, "")] if odd else []
    numbers = range(1 + odd, arms // 2 + odd + 1)
    left, right = ([(pair, side) for pair in numbers] for side in "LR")
    return (*middle, *left, *reversed(right))


def arm_bone_names(arms: int, joints: int) -> tuple[tuple[str, ...], ...]:
    """Names of each arm's bones, root to tip, such as ``arm1.01.L … arm1.12.L``.

    All numbers have as many digits as the largest, so that names sort; ``.L`` and ``.R`` at the
    end are what Blender mirrors.
    """
    pair_digits = len(str((arms + 1) // 2))
    joint_digits = max(2, len(str(joints)))
    return tuple(
        tuple(
            f"arm{pair:0{pair_digits}}.{joint:0{joint_digits}}" + (f".{side}" if side else "")
            for joint in range(1, joints + 1)
        )
        for pair, side in arm_pairs(arms)
    )


def build_bones(shape: OctopusShape) -> OctopusBones:
    """All bones of an octopus at rest: the body's, then the arms' in the order of their angles."""
    form = body_form(shape)
    body_heads, body_tails, body_dorsal_axes = _body_bones(form)

    outward = np.stack([np.sin(shape.angles), -np.cos(shape.angles), np.zeros(shape.arms)], axis=-1)
    joints = outward[:, None, :] * (form.unit + shape.reach)[:, None]
    joints[..., 2] = shape.arm_height
    arm_bones = shape.arms * shape.joints
    parents = np.arange(arm_bones) + FIRST_ARM_BONE - 1
    parents[:: shape.joints] = BODY
    sides: dict[str, str] = dict(zip(("L", "R", ""), ARM_COLLECTIONS, strict=True))
    collections = [sides[side] for _, side in arm_pairs(shape.arms)]
    pairs = np.repeat([pair for pair, _ in arm_pairs(shape.arms)], shape.joints)
    arm_names = arm_bone_names(shape.arms, shape.joints)
    return OctopusBones(
        names=(*_BODY_NAMES, *(name for arm in arm_names for name in arm)),
        parents=(*_BODY_PARENTS, *parents.tolist()),
        heads=np.concatenate([body_heads, joints[:, :-1].reshape(-1, 3)]),
        tails=np.concatenate([body_tails, joints[:, 1:].reshape(-1, 3)]),
        dorsal_axes=np.concatenate(
            [body_dorsal_axes, np.broadcast_to([0.0, 0.0, 1.0], (arm_bones, 3))]
        ),
        connected=(*_BODY_CONNECTED, *(np.arange(arm_bones) % shape.joints > 0).tolist()),
        deform=(False, *(True for _ in range(FIRST_ARM_BONE - 1 + arm_bones))),
        collections=(
            *_BODY_COLLECTIONS,
            *(name for name in collections for _ in range(shape.joints)),
        ),
        pairs=(*(0 for _ in range(FIRST_ARM_BONE)), *pairs.tolist()),
    )


_BODY_NAMES: Final = ("root", "body", "head", "mantle", "siphon", "eye.L", "eye.R")
_BODY_PARENTS: Final = (-1, ROOT, BODY, HEAD, HEAD, HEAD, HEAD)
_BODY_CONNECTED: Final = (False, False, True, True, False, False, False)
_BODY_COLLECTIONS: Final = ("Body", "Body", "Body", "Body", "Body", "Eyes", "Eyes")


def _body_bones(form: BodyForm) -> tuple[Floats, Floats, Floats]:
    """Heads, tails and dorsal axes, each (7, 3)."""
    mirrored = np.array([-1.0, 1.0, 1.0])
    middle = np.array([0.0, 0.0, form.height])
    head_base = form.point(HEAD_BASE)
    neck = form.point(NECK)
    eye_tip = form.eye_centre + 2.0 * form.eye_radius * form.eye_gaze
    # The root lies on the ground along +Y: its space is the armature's own.
    heads = [0.0 * middle, middle, head_base, neck, form.siphon_root, form.eye_centre]
    tails = [
        np.array([0.0, 1.5 * form.unit, 0.0]), head_base, neck, form.apex, form.siphon_tip, eye_tip,
    ]  # fmt: skip
    heads.append(form.eye_centre * mirrored)
    tails.append(eye_tip * mirrored)
    # Dorsal is up for bones that lie, and to the front for those that stand.
    up, front = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])
    dorsal = np.stack([up, front, front, front, up, up, up])
    along = normalized(np.stack(tails) - np.stack(heads))
    across = np.sum(dorsal * along, axis=-1, keepdims=True) * along
    return np.stack(heads), np.stack(tails), normalized(dorsal - across)
