# SPDX-License-Identifier: GPL-3.0-or-later
"""The landmarks of any humanoid, found from the names of its bones and from its shape.

Names come first: each limb is the chain of bones whose names and lengths fit best, the trunk is
what carries the limbs. Where names say nothing, the shape does: two pairs of limbs that mirror
each other. Left and right are compared with the way the feet point. What neither tells is left
out, with the reason, for the artist to say.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...phrases import phrase
from ...rotations import Floats
from ...skeleton import Skeleton
from .landmarks import LANDMARKS, OPTIONAL, Landmarks, read_names
from .name_match import (
    ARM,
    LEG,
    OPTIONAL_PARTS,
    BodyProportions,
    body_of,
    find_limb,
    find_trunk,
    points_to_its_end,
)
from .shape_match import Shape, shape_of

LIMBS: Final = {"arm": ARM, "leg": LEG}

_CORE: Final = {
    kind: [part for part in parts if part not in OPTIONAL_PARTS] for kind, parts in LIMBS.items()
}
_TITLES: Final = {"L": phrase("left"), "R": phrase("right")}
_KINDS: Final = {"arm": phrase("arm"), "leg": phrase("leg")}


@dataclass(frozen=True)
class SkeletonMapping:
    """What was found on a skeleton."""

    landmarks: Landmarks
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


def map_skeleton(skeleton: Skeleton, in_motion: Skeleton | None = None) -> SkeletonMapping:
    """Find the landmarks of a humanoid.

    Never fails: what cannot be told is in ``missing``, and ``problem`` says why a skeleton has
    nothing of a humanoid.

    Args:
        skeleton: as it rests.
        in_motion: the same bones as they lie in a motion, if there is one. A rest pose may be no
            pose of a body (all bones along one axis): then this counts, if it tells as much, and
            where a rest pose leaves something open, and this tells more.
    """
    found = _map_at_rest(skeleton)
    if in_motion is None:
        return found
    whole = not (found.asked or found.problem)
    if whole and _rests_as_a_body(skeleton, found.landmarks):
        return found
    other = _map_at_rest(in_motion)
    more = len(other.landmarks.bones) - len(found.landmarks.bones)
    return other if more > 0 or (whole and more == 0) else found


def _rests_as_a_body(skeleton: Skeleton, landmarks: Landmarks) -> bool:
    """Whether both legs lead the same way, away from the head: sitting people rest so, too."""
    places = {name: skeleton.heads[skeleton.index[bone]] for name, bone in landmarks.bones.items()}
    up = places["head"] - places["hips"]
    legs = [places[f"foot.{side}"] - places[f"thigh.{side}"] for side in "LR"]
    lengths = [float(np.linalg.norm(each)) for each in (up, *legs)]
    alike = float(legs[0] @ legs[1]) > 0.5 * lengths[1] * lengths[2]
    return alike and all(
        float(leg @ up) < 0.5 * length * lengths[0]
        for leg, length in zip(legs, lengths[1:], strict=True)
    )


def _map_at_rest(skeleton: Skeleton) -> SkeletonMapping:
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
    found.update(_trunk(body, found))
    _look_at_sides(skeleton, found, notes)
    problem = ""
    if not any(_has_core(kind, limb) for (kind, _), limb in limbs.items()):
        reasons = [*missing.values(), "No limb of a humanoid was found."]
        problem = shape_of(skeleton, body.names).problem or reasons[0]
        found, notes = {}, []
    return _result(skeleton, found, missing, notes, problem)


def _named_limb(
    body: BodyProportions, kind: str, side: str, notes: list[str], missing: dict[str, str]
) -> dict[str, int]:
    """A limb by names; parts that several bones may be are told."""
    limb, rivals = find_limb(body, LIMBS[kind], side)
    if "toe" in rivals:
        # Any of five toes is not the joint at which a foot rolls.
        del limb["toe"]
        missing[f"toe.{side}"] = "The foot has several toes."
    if "hand" in rivals:
        notes.append(
            phrase(
                "The {side} hand has {count} bones: '{bone}' was taken.",
                side=_TITLES[side],
                count=len(rivals["hand"]) + 1,
                bone=body.skeleton.names[limb["hand"]],
            )
        )
    return limb


def _has_core(kind: str, limb: Mapping[str, object]) -> bool:
    return all(part in limb for part in _CORE[kind])


def _complete_from_shape(
    body: BodyProportions,
    limbs: dict[tuple[str, str], dict[str, int]],
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
            if any(limb.get(part, bone) != bone for part, bone in known.items()):
                notes.append(
                    phrase(
                        "Names and shape of the {side} {kind} do not agree: look at it.",
                        side=_TITLES[side],
                        kind=_KINDS[kind],
                    )
                )
                continue
            known |= {part: bone for part, bone in limb.items() if part not in known}
            notes.append(
                "The bones of the arms were told by their lengths, not by names: look at them."
                if kind == "arm"
                else "The bones of the legs were told by their lengths, not by names: look at them."
            )


def _sides_of_shape(
    body: BodyProportions,
    shape: Shape,
    limbs: Mapping[tuple[str, str], Mapping[str, int]],
) -> tuple[str, str] | None:
    """Which side the first and the second limb of each pair of a shape are on."""
    named = 0
    for pair in (shape.arms, shape.legs):
        for sign, limb in zip((1, -1), pair, strict=True):
            sides = [body.names[bone].side for bone in limb.values()]
            # A limb of the other pair that names told says it for both.
            for (_, side), other in limbs.items():
                sides += [side] if set(other.values()) & set(limb.values()) else []
            named += sign * (sides.count("L") - sides.count("R"))
    if named:
        return ("L", "R") if named > 0 else ("R", "L")
    heads = body.skeleton.heads
    up = heads[shape.trunk["head"]] - heads[shape.trunk["hips"]]
    left = _left_by_feet(body.skeleton, shape.legs, up)
    if left is None:
        return None
    first, second = (heads[leg["shin"]] for leg in shape.legs)
    return ("L", "R") if float((first - second) @ left) > 0.0 else ("R", "L")


def _left_by_feet(
    skeleton: Skeleton, legs: Sequence[Mapping[str, int]], up: Floats
) -> Floats | None:
    """The body's left, (3,) of any length, from the way its feet point; none where that is open."""
    forward, down = np.zeros((2, 3))
    leg_lengths = 0.0
    upward = up / max(float(np.linalg.norm(up)), 1e-12)
    for leg in legs:
        foot = skeleton.heads[leg["foot"]]
        if "toe" in leg:
            tip = skeleton.heads[leg["toe"]]
        elif points_to_its_end(skeleton, leg["shin"], leg["foot"]):
            tip = skeleton.tails[leg["foot"]]
        else:
            return None
        forward += tip - foot
        way = foot - skeleton.heads[leg["thigh"]]
        down += way
        # Not of their sum: where one leg rests opposite to the other, that is rounding alone.
        leg_lengths += float(np.linalg.norm(way))
    forward -= (forward @ upward) * upward
    # Some files rest with all bones along one axis: there, feet say nothing.
    if float(-down @ upward) < 0.5 * leg_lengths:
        return None
    if float(np.linalg.norm(forward)) <= 0.05 * leg_lengths:
        return None
    return np.cross(upward, forward)


def _pair(found: Mapping[str, int], part: str) -> list[int]:
    """The bones of a part on left and right, as far as they were found."""
    return [found[f"{part}.{side}"] for side in "LR" if f"{part}.{side}" in found]


def _drop_crossed_sides(skeleton: Skeleton, found: dict[str, int], missing: dict[str, str]) -> None:
    """Forget both arms and legs if the left arm is on the side of the right leg."""
    pairs = [_pair(found, part) for part in ("upper_arm", "thigh")]
    if any(len(pair) < 2 for pair in pairs):
        return
    arms, legs = (skeleton.heads[left] - skeleton.heads[right] for left, right in pairs)
    if float(arms @ legs) < -0.3 * float(np.linalg.norm(arms) * np.linalg.norm(legs)):
        for name in [name for name in found if "." in name]:
            del found[name]
            missing[name] = "The left arm is on the side of the right leg."


def _trunk(body: BodyProportions, found: Mapping[str, int]) -> dict[str, int]:
    arms, thighs, shins, clavicles = (
        _pair(found, part) for part in ("upper_arm", "thigh", "shin", "clavicle")
    )
    shoulders = clavicles if len(clavicles) == 2 else arms
    if len(shoulders) < 2 or len(thighs) < 2 or len(shins) < 2:
        return {}
    if body.left is None:
        # Names have told no mid plane: it is between the limbs.
        body = body.between([pair for pair in (arms, thighs) if len(pair) == 2])
    return find_trunk(body, thighs, shins, shoulders)


def _look_at_sides(skeleton: Skeleton, found: Mapping[str, int], notes: list[str]) -> None:
    """Say so where the feet point the other way than the names of left and right mean."""
    legs = [
        {part: found[f"{part}.{side}"] for part in LEG if f"{part}.{side}" in found}
        for side in "LR"
    ]
    if not {"hips", "head"} <= found.keys() or not all(_has_core("leg", leg) for leg in legs):
        return
    heads = skeleton.heads
    left = _left_by_feet(skeleton, legs, heads[found["head"]] - heads[found["hips"]])
    if left is not None and float((heads[legs[0]["thigh"]] - heads[legs[1]["thigh"]]) @ left) < 0.0:
        notes.append(
            "The feet point backward if left is where the names say: look at left and right."
        )


def _result(
    skeleton: Skeleton,
    found: Mapping[str, int],
    missing: Mapping[str, str],
    notes: Sequence[str],
    problem: str,
) -> SkeletonMapping:
    bones = {each: skeleton.names[found[each]] for each in LANDMARKS if each in found}
    reasons = {
        each: missing.get(each) or problem or "No bone's name or place tells it."
        for each in LANDMARKS
        if each not in found
    }
    return SkeletonMapping(Landmarks(bones), reasons, tuple(dict.fromkeys(notes)), problem)
