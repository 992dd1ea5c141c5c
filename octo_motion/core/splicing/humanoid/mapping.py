# SPDX-License-Identifier: GPL-3.0-or-later
"""The landmarks of any humanoid, found from the names of its bones and from its shape.

Names come first: each limb is the chain of bones whose names and lengths fit best, the trunk is
what carries the limbs. Where names say nothing, the shape does: two pairs of limbs that mirror
each other. Left and right are compared with the way the feet point. What neither tells is left
out, with the reason, for the artist to say.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ...rotations import Floats
from ...skeleton import Skeleton
from .landmarks import LANDMARKS, OPTIONAL, Landmarks, read_names
from .name_match import ARM, LEG, OPTIONAL_PARTS, BodyProportions, body_of, find_limb, find_trunk
from .shape_match import Shape, shape_of

LIMBS: Final = {"arm": ARM, "leg": LEG}

_CORE: Final = {
    kind: [part for part in parts if part not in OPTIONAL_PARTS] for kind, parts in LIMBS.items()
}
_TITLES: Final = {"L": "left", "R": "right"}


@dataclass(frozen=True)
class SkeletonMapping:
    """What was found on a skeleton."""

    landmarks: Landmarks
    confidence: Mapping[str, float]
    """0…1 by landmark: 1 the name says it, 0.5 the shape does."""
    missing: Mapping[str, str]
    """Why a landmark could not be told, by landmark, optional ones included."""
    notes: tuple[str, ...]
    """What the artist should look at: sentences."""
    problem: str = ""
    """Why the skeleton is no humanoid, in one sentence; empty where it may be one."""

    @property
    def asked(self) -> tuple[str, ...]:
        """Required landmarks that could not be told."""
        return tuple(each for each in self.missing if each not in OPTIONAL)

    @property
    def complete(self) -> bool:
        """Whether all required landmarks are known."""
        return not self.asked


def map_skeleton(skeleton: Skeleton) -> SkeletonMapping:
    """Find the landmarks of a humanoid in any rest pose.

    Never fails: what cannot be told is in ``missing``, and ``problem`` says why a skeleton has
    nothing of a humanoid.
    """
    if not np.ptp(skeleton.heads, axis=0).any():
        return _result(skeleton, {}, {}, (), "All bones start at one point.")
    body = body_of(skeleton, read_names(skeleton.names))
    notes: list[str] = []
    missing: dict[str, str] = {}
    limbs = {
        (kind, side): _named_limb(body, kind, side, notes, missing)
        for kind in LIMBS
        for side in "LR"
    }
    if not all(_has_core(kind, limb) for (kind, _), limb in limbs.items()):
        _complete_from_shape(body, limbs, notes, missing)
    found = {
        f"{part}.{side}": bone for (_, side), limb in limbs.items() for part, bone in limb.items()
    }
    _drop_crossed_sides(skeleton, found, missing)
    trunk = _trunk(_with_mid_plane(body, found), found)
    found.update(trunk)
    _look_at_sides(skeleton, found, notes)
    problem = ""
    if not any(_has_core(kind, limb) for (kind, _), limb in limbs.items()):
        reasons = [*missing.values(), "No limb of a humanoid was found."]
        problem = shape_of(skeleton, body.names).problem or reasons[0]
        found, notes = {}, []
    return _result(skeleton, found, missing, notes, problem)


def _named_limb(
    body: BodyProportions, kind: str, side: str, notes: list[str], missing: dict[str, str]
) -> dict[str, tuple[int, float]]:
    """A limb by names; parts that several bones may be are told."""
    limb, rivals = find_limb(body, LIMBS[kind], side)
    if "toe" in rivals:
        # Any of five toes is not the joint at which a foot rolls.
        del limb["toe"]
        missing[f"toe.{side}"] = "The foot has several toes."
    if "hand" in rivals:
        bone, weight = limb["hand"]
        limb["hand"] = bone, 0.8 * weight
        notes.append(
            f"The {_TITLES[side]} hand has {len(rivals['hand']) + 1} bones: "
            f"'{body.skeleton.names[bone]}' was taken."
        )
    return limb


def _has_core(kind: str, limb: Mapping[str, object]) -> bool:
    return all(part in limb for part in _CORE[kind])


def _complete_from_shape(
    body: BodyProportions,
    limbs: dict[tuple[str, str], dict[str, tuple[int, float]]],
    notes: list[str],
    missing: dict[str, str],
) -> None:
    """Fill limbs that names do not tell, where the shape does and agrees with the names."""
    shape = shape_of(body.skeleton, body.names)
    if shape.problem:
        return
    sides = _sides_of_shape(body, shape, limbs)
    if sides is None:
        for kind, parts in LIMBS.items():
            for side in "LR":
                for part in parts:
                    if not _has_core(kind, limbs[kind, side]):
                        missing[f"{part}.{side}"] = "Neither names nor feet tell left from right."
        return
    for kind, pair in (("arm", shape.arms), ("leg", shape.legs)):
        for limb, side in zip(pair, sides, strict=True):
            known = limbs[kind, side]
            if _has_core(kind, known):
                continue
            agrees = all(limb.get(part, bone) == bone for part, (bone, _) in known.items())
            if not agrees:
                notes.append(
                    f"Names and shape of the {_TITLES[side]} {kind} do not agree: look at it."
                )
                continue
            for part, bone in limb.items():
                known.setdefault(part, (bone, 0.5))
            notes.append(
                f"The bones of the {kind}s were told by their lengths, not by names: look at them."
            )


def _sides_of_shape(
    body: BodyProportions,
    shape: Shape,
    limbs: Mapping[tuple[str, str], Mapping[str, tuple[int, float]]],
) -> tuple[str, str] | None:
    """Which side the first and the second limb of each pair of a shape are on."""
    named = 0
    for pair in (shape.arms, shape.legs):
        for sign, limb in zip((1, -1), pair, strict=True):
            for bone in limb.values():
                named += sign * {"L": 1, "R": -1}.get(body.names[bone].side, 0)
            # A limb of the other pair that names told says it for both.
            for (_, side), other in limbs.items():
                if {bone for bone, _ in other.values()} & set(limb.values()):
                    named += sign * (1 if side == "L" else -1)
    if named:
        return ("L", "R") if named > 0 else ("R", "L")
    heads = body.skeleton.heads
    legs = [[limb[part] for part in _CORE["leg"]] for limb in shape.legs]
    toes = [limb.get("toe") for limb in shape.legs]
    head = heads[shape.trunk["head"]]
    left = _left_by_feet(body.skeleton, legs, toes, head - heads[shape.trunk["hips"]])
    if left is None:
        return None
    first, second = (heads[leg[1]] for leg in legs)
    return ("L", "R") if float((first - second) @ left) > 0.0 else ("R", "L")


def _left_by_feet(
    skeleton: Skeleton, legs: Sequence[Sequence[int]], toes: Sequence[int | None], up: Floats
) -> Floats | None:
    """The body's left, (3,) of any length, from the way its feet point; none where that is open."""
    forward, down = np.zeros((2, 3))
    upward = up / max(float(np.linalg.norm(up)), 1e-12)
    for (thigh, _, foot), toe in zip(legs, toes, strict=True):
        tip = skeleton.heads[toe] if toe is not None else skeleton.tails[foot]
        forward += tip - skeleton.heads[foot]
        down += skeleton.heads[foot] - skeleton.heads[thigh]
    leg_lengths = float(np.linalg.norm(down))
    forward -= (forward @ upward) * upward
    # Some files rest with all bones along one axis: there, feet say nothing.
    if float(-down @ upward) < 0.5 * leg_lengths:
        return None
    if float(np.linalg.norm(forward)) <= 0.05 * leg_lengths:
        return None
    return np.cross(upward, forward)


def _drop_crossed_sides(
    skeleton: Skeleton, found: dict[str, tuple[int, float]], missing: dict[str, str]
) -> None:
    """Forget both arms and legs if the left arm is on the side of the right leg."""
    across = []
    for part in ("upper_arm", "thigh"):
        if f"{part}.L" not in found or f"{part}.R" not in found:
            return
        left, right = (skeleton.heads[found[f"{part}.{side}"][0]] for side in "LR")
        across.append(left - right)
    lengths = float(np.linalg.norm(across[0]) * np.linalg.norm(across[1]))
    if float(across[0] @ across[1]) < -0.3 * lengths:
        for name in [name for name in found if "." in name]:
            del found[name]
            missing[name] = "The left arm is on the side of the right leg."


def _trunk(
    body: BodyProportions, found: Mapping[str, tuple[int, float]]
) -> dict[str, tuple[int, float]]:
    def pair(part: str) -> list[int]:
        return [found[f"{part}.{side}"][0] for side in "LR" if f"{part}.{side}" in found]

    shoulders = pair("clavicle") if len(pair("clavicle")) == 2 else pair("upper_arm")
    if len(shoulders) < 2 or len(pair("thigh")) < 2 or len(pair("shin")) < 2:
        return {}
    return find_trunk(body, pair("thigh"), pair("shin"), shoulders)


def _with_mid_plane(
    body: BodyProportions, found: Mapping[str, tuple[int, float]]
) -> BodyProportions:
    """The body with the mid plane between its limbs, where its names have told none."""
    if body.left is not None:
        return body
    pairs = [
        [found[f"{part}.{side}"][0] for side in "LR"]
        for part in ("upper_arm", "thigh")
        if f"{part}.L" in found and f"{part}.R" in found
    ]
    if not pairs:
        return body
    left, right = body.skeleton.heads[np.array(pairs).T]
    across = (left - right).sum(axis=0)
    across = across / max(float(np.linalg.norm(across)), 1e-12)
    return replace(body, left=across, middle=(0.5 * (left + right)).mean(axis=0))


def _look_at_sides(
    skeleton: Skeleton, found: Mapping[str, tuple[int, float]], notes: list[str]
) -> None:
    """Say so where the feet point the other way than the names of left and right mean."""
    needed = ["hips", "head", *(f"{part}.{side}" for side in "LR" for part in _CORE["leg"])]
    if any(each not in found for each in needed):
        return
    heads = skeleton.heads
    legs = [[found[f"{part}.{side}"][0] for part in _CORE["leg"]] for side in "LR"]
    toes = [found[f"toe.{side}"][0] if f"toe.{side}" in found else None for side in "LR"]
    left = _left_by_feet(skeleton, legs, toes, heads[found["head"][0]] - heads[found["hips"][0]])
    if left is not None and float((heads[legs[0][0]] - heads[legs[1][0]]) @ left) < 0.0:
        notes.append(
            "The feet point backward if left is where the names say: look at left and right."
        )


def _result(
    skeleton: Skeleton,
    found: Mapping[str, tuple[int, float]],
    missing: Mapping[str, str],
    notes: Sequence[str],
    problem: str,
) -> SkeletonMapping:
    said = {}
    for each in LANDMARKS:
        if each not in found:
            said[each] = missing.get(each) or problem or "No bone's name or place tells it."
    return SkeletonMapping(
        landmarks=Landmarks(
            {each: skeleton.names[found[each][0]] for each in LANDMARKS if each in found}
        ),
        confidence={each: min(found[each][1], 1.0) for each in LANDMARKS if each in found},
        missing=said,
        notes=tuple(dict.fromkeys(notes)),
        problem=problem,
    )
