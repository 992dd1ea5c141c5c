# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding the chains of bones that are arms, on whatever armature an artist brings.

1. Bones that move the mesh are looked at: those with the deform flag and a vertex group; without
   vertex groups the deform flag alone, without that all bones. They form a tree, other bones
   between them skipped; chains are its branches that end in a tip (``bone_tree``).
2. Arms are a family of such chains: alike in bones and length, long compared with the rest of the
   rig, springing from one place (``arm_family``).
3. Where constraints move those, the control bones at the same joints take their place.
4. Names and symmetry tell which way the body faces; sides and pairs follow (``chains``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...errors import RigError
from ...rotations import Floats
from ...skeleton import Skeleton
from .arm_chains import (
    AXES,
    COINCIDENT,
    MOST_ARMS,
    ArmChain,
    BodyFrame,
    arm_shapes,
    arrange,
    body_frame,
    body_rotation,
    is_driven,
    joint_positions,
    mirror_distances,
    name_side,
    nearest_axis,
)
from .arm_family import best_family
from .bone_tree import REMEDY, BoneChain, BoneTree, candidate_chains, is_control_name

# Arm lengths: how far mirror images may lie apart, on average, for a rig to be symmetric.
_SYMMETRIC: Final = 0.05
# Arm lengths: how far an arm may lean out and still count as upright.
_UPRIGHT: Final = 1e-3

__all__ = ["ArmChain", "BodyFrame", "Detection", "control_chain", "detect_arms"]


@dataclass(frozen=True)
class Detection:
    """What was found on an armature."""

    arms: tuple[ArmChain, ...]
    body: BodyFrame
    root_bone: str
    """The bone that carries the whole body, "" if there is none."""
    up: str
    """Armature axis that is the body's up, such as "Z"."""
    front: str
    """Armature axis that the body faces, such as "-Y"."""
    notes: tuple[str, ...] = ()
    """Sentences that the artist should read."""


def detect_arms(
    skeleton: Skeleton,
    world_up: Floats,
    world_front: Floats,
    *,
    up: str | None = None,
    front: str | None = None,
) -> Detection:
    """The arms of an octopus, or of anything built like one.

    Where constraints move the arms that deform, and the rig has control bones at the same joints,
    the arms are the control bones: what the artist keys.

    Args:
        skeleton: the rig.
        world_up: (3,) the world's up (+Z), in armature space.
        world_front: (3,) where a character faces (the world's −Y), in armature space.
        up: axis of the armature that is the body's up, if the artist has said so.
        front: axis of the armature that the body faces, if the artist has said so. Else it is
            read from bone names and from the symmetry of the arms, and is ``world_front`` where
            they do not tell.

    Raises:
        RigError: nothing on the armature looks like arms, or front and up lie on one axis.
    """
    if up is None:
        up = nearest_axis(world_up, across=front)
    elif front is not None:
        body_rotation(up, front)  # raises where they lie on one axis
    tree, chains = candidate_chains(skeleton)
    family = best_family(skeleton, tree, chains, up)
    if len(family) > MOST_ARMS:
        raise RigError(f"{len(family)} chains could be arms, and {MOST_ARMS} is the most.", REMEDY)
    deforming = [tuple(skeleton.names[bone] for bone in chain.bones) for chain in family]
    arms, notes = _keyable(skeleton, deforming)
    if front is None:
        usual = nearest_axis(world_front, across=up)
        front, reason = _facing(skeleton, arms, up, usual)
        notes += reason
    body = body_frame(skeleton, arms, up, front)
    notes += _unclear_directions(skeleton, arms, body)
    return Detection(
        arms=arrange(skeleton, arms, body),
        body=body,
        root_bone=_root_bone(skeleton, tree, family),
        up=up,
        front=front,
        notes=tuple(notes),
    )


def control_chain(skeleton: Skeleton, bones: Sequence[str]) -> tuple[str, ...]:
    """The chain that an animator keys where constraints move the arm: its free twin, or ``()``.

    Control rigs lay several chains over one another: one that deforms, one or more that carry
    constraints, and one for the animator. The last is the one of the same joints whose root is
    not constrained, with as few constrained bones as there are.

    Raises:
        RigError: a bone does not exist.
    """
    joints = joint_positions(skeleton, bones)
    reach = float(np.linalg.norm(np.diff(joints, axis=0), axis=1).sum())
    own = set(bones)

    def at(joint: Floats, candidates: Sequence[int]) -> list[int]:
        distances = np.linalg.norm(skeleton.heads[list(candidates)] - joint, axis=1)
        near = (distances < COINCIDENT * reach).tolist()
        return [
            bone
            for bone, is_near in zip(candidates, near, strict=True)
            if is_near and skeleton.names[bone] not in own
        ]

    roots = at(joints[0], range(len(skeleton)))
    twins = [[root] for root in roots if not skeleton.constrained[root]]
    for joint in joints[1:-1]:
        # A child at the next joint that itself leads on; a tweak bone sits there alone.
        twins = [[*twin, bone] for twin in twins for bone in at(joint, skeleton.children[twin[-1]])]
    if not twins:
        return ()
    best = min(
        twins,
        key=lambda twin: (
            sum(skeleton.constrained[bone] for bone in twin),
            is_control_name(skeleton.names[twin[0]]),
            -float(skeleton.lengths[twin].sum()),
            skeleton.names[twin[0]],
        ),
    )
    return tuple(skeleton.names[bone] for bone in best)


def _root_bone(skeleton: Skeleton, tree: BoneTree, family: tuple[BoneChain, ...]) -> str:
    """The topmost bone that carries all that deforms and that keys can move."""
    arms = {bone for chain in family for bone in chain.bones}
    carried = [0] * len(skeleton)
    for bone in tree.members:
        carried[bone] = 1
    for bone in reversed(range(len(skeleton))):
        if skeleton.parents[bone] >= 0:
            carried[skeleton.parents[bone]] += carried[bone]
    for bone in range(len(skeleton)):
        if (
            carried[bone] == len(tree.members)
            and bone not in arms
            and not skeleton.constrained[bone]
        ):
            return skeleton.names[bone]
    return ""


def _keyable(
    skeleton: Skeleton, deforming: list[tuple[str, ...]]
) -> tuple[list[tuple[str, ...]], list[str]]:
    """Each arm's bones that keys can move, and what the artist should know about them."""
    arms: list[tuple[str, ...]] = []
    exchanged = held = 0
    further: set[str] = set()
    for bones in deforming:
        controls = control_chain(skeleton, bones) if is_driven(skeleton, bones) else ()
        arms.append(controls or bones)
        if controls:
            exchanged += 1
            further.update(bone for bone in controls if is_driven(skeleton, [bone]))
        else:
            held += is_driven(skeleton, bones)
    notes: list[str] = []
    if exchanged:
        example = next(bones[0] for bones in arms if bones not in deforming)
        notes.append(
            f"Constraints move the bones that deform {_arms(exchanged)}: the list has the control "
            f"bones at the same joints ('{example}' …)."
        )
    if further:
        notes.append(
            f"{len(further)} of these have constraints of their own ('{min(further)}' …): mute "
            "those if the arms bend more than they should."
        )
    if held:
        notes.append(
            f"Constraints or drivers move {_arms(held)}, and no control bones were found: keys "
            "have no effect while the constraints are on."
        )
    return arms, notes


def _arms(number: int) -> str:
    return "1 arm" if number == 1 else f"{number} arms"


def _facing(
    skeleton: Skeleton, arms: list[tuple[str, ...]], up: str, usual: str
) -> tuple[str, list[str]]:
    """The axis that the body faces, and the reason where it is not the usual one."""
    rotation = body_rotation(up, usual)
    shapes = arm_shapes(skeleton, arms, BodyFrame(np.zeros(3), rotation))
    shapes -= shapes[:, :1].mean(axis=0)
    # Where the arms lie, (arms, 2) towards the usual left and back.
    places = (shapes.mean(axis=1) + shapes[:, -1] - shapes[:, 0])[:, :2]

    signs = [{"LEFT": 1.0, "RIGHT": -1.0, None: 0.0}[name_side(bones[0])] for bones in arms]
    if len(set(signs) - {0.0}) == 2:
        left = signs @ places
        sideways, along = float(left[0]), float(left[1])
        if sideways >= 0.5 * float(np.hypot(sideways, along)):
            return usual, []
        axis = nearest_axis(rotation[:, :2] @ left, across=up)
        # What lies to the left of the front: front = left × up.
        front = nearest_axis(np.cross(np.array(AXES[axis], float), np.array(AXES[up], float)))
        return front, [f"The bones named left lie towards {axis}: Front was set to {front}."]

    if len(arms) > 2:
        across = mirror_distances(shapes, axis=0).min(axis=1).mean()
        lengthwise = mirror_distances(shapes, axis=1).min(axis=1).mean()
        if lengthwise < _SYMMETRIC and across > 3.0 * lengthwise:
            # The rest of the body is where the arms are not.
            ahead = 1.0 if places[:, 0].mean() >= 0.0 else -1.0
            front = nearest_axis(ahead * rotation[:, 0])
            axis = front.removeprefix("-")
            reason = (
                f"The arms mirror each other across {axis}: Front was set to {front}. "
                "Change it and detect again if the body faces the other way."
            )
            return front, [reason]
    return usual, []


def _unclear_directions(
    skeleton: Skeleton, arms: list[tuple[str, ...]], body: BodyFrame
) -> list[str]:
    """What to say of arms whose side cannot be told, because they stand on the body's axis."""
    shapes = arm_shapes(skeleton, arms, body)
    upright = int(np.sum(np.linalg.norm(shapes[..., :2], axis=-1).max(axis=1) < _UPRIGHT))
    if not upright or len(arms) == 1:
        return []
    verb = "stands" if upright == 1 else "stand"
    note = (
        f"{_arms(upright).capitalize()} {verb} upright in the middle of the body: sides and pairs "
        "cannot be told from the rest pose; set them by hand."
    )
    return [note]
