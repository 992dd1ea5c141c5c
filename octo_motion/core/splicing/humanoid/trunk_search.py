# SPDX-License-Identifier: GPL-3.0-or-later
"""Hips, spine, chest, neck and head of a humanoid, between limbs that are known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from .limb_search import BodyProportions

_NEAR_THE_LEGS: Final = 0.9
"""How far the hips may lie from the middle of the thighs' heads, in lengths of a thigh."""


def find_trunk(
    body: BodyProportions, thighs: Sequence[int], shins: Sequence[int], shoulders: Sequence[int]
) -> dict[str, tuple[int, float]]:
    """The bones of the trunk, each with how sure it is, 0…1.

    Args:
        body: the skeleton.
        thighs: left and right.
        shins: left and right.
        shoulders: left and right, clavicles or upper arms.
    """
    found: dict[str, tuple[int, float]] = {}
    head = _named(body, "head") or _end_of_middle(body, thighs, shoulders)
    if head is None:
        return found
    found["head"] = head
    chest = _carrier(body, [*shoulders, head[0]], "chest")
    if chest is not None:
        found["chest"] = chest
    hips = _hips(body, thighs, shins, chest[0] if chest is not None else head[0])
    if hips is not None:
        found["hips"] = hips
    if hips is None or chest is None:
        return found
    between = _between(body, hips[0], chest[0])
    # "Body → Hips → Abdomen": what is named after the pelvis does not bend the trunk.
    bending = [bone for bone in between if not body.names[bone].weights.get("hips", 0.0) >= 1.0]
    if bending:
        found["spine"] = (bending[0], 0.9)
    necks = _between(body, chest[0], head[0])
    if necks:
        named = [bone for bone in necks if body.names[bone].weights.get("neck", 0.0) > 0.5]
        found["neck"] = (named[0], 1.0) if named else (necks[0], 0.7)
    return found


def _hips(
    body: BodyProportions, thighs: Sequence[int], shins: Sequence[int], upper: int
) -> tuple[int, float] | None:
    """The bone that carries legs and trunk, if it is at the pelvis; else the one so named."""
    heads = body.skeleton.heads
    middle = heads[list(thighs)].mean(axis=0)
    length = float(np.linalg.norm(heads[list(thighs)] - heads[list(shins)], axis=1).mean())
    carrier = _carrier(body, [*thighs, upper], "hips")
    if carrier is not None:
        distance = float(np.linalg.norm(heads[carrier[0]] - middle))
        if distance < _NEAR_THE_LEGS * length:
            return carrier
    named = [
        bone
        for bone in range(len(body.skeleton))
        if body.names[bone].weights.get("hips", 0.0) >= 0.7
        and not body.sides[bone]
        and any(body.is_ancestor(bone, thigh) for thigh in thighs)
    ]
    if named:
        return max(named, key=lambda bone: body.names[bone].weights["hips"]), 0.7
    return None


def _carrier(body: BodyProportions, bones: Sequence[int], part: str) -> tuple[int, float] | None:
    """The lowest bone that carries all of these and that keys can move."""
    shared = body.common_ancestor(bones)
    if shared is None:
        named = _named(body, part)
        return (named[0], 0.6) if named is not None else None
    if shared in bones:
        shared = body.skeleton.parents[shared]
    chain = [shared, *body.ancestors(shared)] if shared >= 0 else []
    free = [bone for bone in chain if _is_free(body, bone)]
    if not free:
        return None
    return free[0], 1.0 if body.names[free[0]].weights.get(part, 0.0) >= 0.5 else 0.8


def _is_free(body: BodyProportions, bone: int) -> bool:
    """Whether an artist moves it: no machinery, nothing that follows another bone."""
    return not (
        body.names[bone].machinery
        or body.names[bone].layer == "org"
        or body.skeleton.constrained[bone]
    )


def _between(body: BodyProportions, lower: int, upper: int) -> list[int]:
    """The free bones between two, from the lower one up."""
    chain = body.ancestors(upper)
    if lower not in chain:
        return []
    between = chain[: chain.index(lower)][::-1]
    free = [bone for bone in between if _is_free(body, bone)]
    # In some rigs the neck itself is called a twist bone.
    return free or between


def _named(body: BodyProportions, part: str) -> tuple[int, float] | None:
    """The bone of the middle whose name says it is this part, the first one down the tree."""
    best: tuple[int, float] | None = None
    for bone, name in enumerate(body.names):
        weight = name.weights.get(part, 0.0) if not body.sides[bone] else 0.0
        if body.skeleton.constrained[bone]:
            weight *= 0.7
        if weight > 0.5 and (best is None or weight > best[1] + 1e-9):
            best = bone, weight
    return best


def _end_of_middle(
    body: BodyProportions, thighs: Sequence[int], shoulders: Sequence[int]
) -> tuple[int, float] | None:
    """The last bone of the row that goes up from between the shoulders, where none is named."""
    skeleton = body.skeleton
    start = body.common_ancestor(shoulders)
    if start is None:
        return None
    up = skeleton.heads[start] - skeleton.heads[list(thighs)].mean(axis=0)
    step = 0.005 * body.size * float(np.linalg.norm(up))
    row: list[int] = []
    bone = start
    while True:
        children = [
            child
            for child in skeleton.children[bone]
            if body.off_middle(child) < 0.012
            and not body.sides[child]
            and not body.names[child].machinery
            and not any(child == each or body.is_ancestor(child, each) for each in shoulders)
            # Jaw and hair turn back.
            and float(skeleton.rest_matrices[child][:3, 1] @ up) > 0.0
            # A face starts within the head.
            and (not row or float((skeleton.heads[child] - skeleton.heads[bone]) @ up) > step)
        ]
        if len(children) != 1:
            break
        bone = children[0]
        row.append(bone)
    return (row[-1], 0.6) if row else None
