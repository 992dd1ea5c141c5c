# SPDX-License-Identifier: GPL-3.0-or-later
"""Chains of bones that are arms, and how they stand round a body: sides, pairs, directions.

The body's canonical frame is a character's: its left is +X, its front −Y, up +Z. Which of the
armature's own axes those are is a :class:`BodyFrame`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, Literal

import numpy as np

from ...errors import RigError
from ...phrases import phrase
from ...rotations import Floats, normalized
from ...skeleton import Skeleton, median

Side = Literal["LEFT", "RIGHT", "CENTER"]

LEAST_BONES: Final = 3
MOST_BONES: Final = 200
MOST_ARMS: Final = 64

AXES: Final[dict[str, tuple[int, int, int]]] = {
    "X": (1, 0, 0),
    "Y": (0, 1, 0),
    "Z": (0, 0, 1),
    "-X": (-1, 0, 0),
    "-Y": (0, -1, 0),
    "-Z": (0, 0, -1),
}

# Joints closer than this share of the chain's length are at the same point.
COINCIDENT: Final = 1e-4
# Shapes are compared at this many points along each arm.
_SHAPE_POINTS: Final = 9
# The point up to which an arm leads away from the body before it may turn anywhere.
_FIRST_PART: Final = 3
# Mean distance, in arm lengths, up to which one arm still is another's mirror image.
_MIRROR_TOLERANCE: Final = 0.2
# Sines of the azimuth: on the mid plane for certain; close to it; how far a name may be wrong.
_ON_MID_PLANE: Final = 0.01
_NEAR_MID_PLANE: Final = 0.17
_NAME_LEEWAY: Final = 0.1


@dataclass(frozen=True)
class ArmChain:
    """The bones of one arm."""

    name: str
    bones: tuple[str, ...]
    """Root to tip, 3–200; each a descendant of the one before (helper bones may lie between)."""
    side: Side
    pair: int
    """1 is the front pair."""
    azimuth: float
    """Where the arm points, seen from above: radians from the front, positive to the left."""
    driven: bool = False
    """Whether constraints or drivers move one of the bones, so that keys on it have no effect."""


@dataclass(frozen=True)
class BodyFrame:
    """Where the body's canonical axes lie in armature space."""

    center: Floats
    """(3,): the middle of the arms' roots."""
    rotation: Floats
    """(3, 3): columns are the canonical X (left), Y (back) and Z (up)."""

    def to_body(self, points: Floats) -> Floats:
        """Points (…, 3) of armature space in the canonical frame."""
        return (points - self.center) @ self.rotation


def nearest_axis(direction: Floats, *, across: str | None = None) -> str:
    """Name of the axis ("X", "-Y", …) that is nearest a direction (3,), across another axis if
    given.
    """
    allowed = [
        name
        for name, axis in AXES.items()
        if across is None or not np.any(np.multiply(axis, AXES[across]))
    ]
    unit = normalized(direction)
    # Rounding makes a tie fall the same way whatever the noise in the direction.
    return max(allowed, key=lambda name: round(float(np.dot(AXES[name], unit)), 6))


def body_rotation(up: str, front: str) -> Floats:
    """The rotation of a :class:`BodyFrame` from the names of the armature's up and front axes.

    Raises:
        RigError: both are the same axis, or opposite.
    """
    up_axis, front_axis = np.array(AXES[up], float), np.array(AXES[front], float)
    left = np.cross(up_axis, front_axis)
    if not np.any(left):
        raise RigError(
            phrase("The body's front ({front}) and up ({up}) lie on one axis.", front=front, up=up),
            "Choose a front axis across the up axis.",
        )
    return np.stack([left, -front_axis, up_axis], axis=1)


def body_frame(skeleton: Skeleton, arms: Iterable[Sequence[str]], up: str, front: str) -> BodyFrame:
    """The frame of a body with these arms (bone names, root to tip) and these axes.

    Raises:
        RigError: front and up lie on one axis, or a bone does not exist.
    """
    roots = [_bone_index(skeleton, bones[0]) for bones in arms]
    center = skeleton.heads[roots].mean(axis=0) if roots else np.zeros(3)
    return BodyFrame(center=center, rotation=body_rotation(up, front))


def chain_of(skeleton: Skeleton, names: Iterable[str]) -> tuple[str, ...]:
    """The given bones in order from root to tip, checked to be usable as an arm.

    Raises:
        RigError: they are not one chain, too few or too many, or two start at the same point.
    """
    depth: dict[int, int] = {}
    for bone in sorted({_bone_index(skeleton, name) for name in names}):
        depth[bone] = sum(ancestor in depth for ancestor in skeleton.ancestors(bone))
    order = sorted(depth, key=depth.__getitem__)
    for upper, lower in pairwise(order):
        if depth[upper] == depth[lower]:
            raise RigError(
                phrase(
                    "'{upper}' and '{lower}' are not in one chain.",
                    upper=skeleton.names[upper],
                    lower=skeleton.names[lower],
                ),
                "Choose the bones of a single arm, from its root to its tip.",
            )
    if len(order) < LEAST_BONES:
        raise RigError(
            phrase(
                "An arm needs at least {least_bones} bones in a row, not {count}.",
                least_bones=LEAST_BONES,
                count=len(order),
            ),
            "Choose all bones of the arm, or subdivide them.",
        )
    if len(order) > MOST_BONES:
        raise RigError(
            phrase(
                "An arm can have {most_bones} bones at most, not {count}.",
                most_bones=MOST_BONES,
                count=len(order),
            ),
            "Choose fewer of its bones.",
        )
    segments = np.linalg.norm(np.diff(skeleton.heads[order], axis=0), axis=1)
    for number in np.flatnonzero(segments <= COINCIDENT * segments.sum()):
        upper, lower = (skeleton.names[order[number + step]] for step in (0, 1))
        raise RigError(
            phrase("'{upper}' and '{lower}' start at the same point.", upper=upper, lower=lower),
            "Leave out the one that is a helper.",
        )
    return tuple(skeleton.names[bone] for bone in order)


def joint_positions(skeleton: Skeleton, bones: Sequence[str]) -> Floats:
    """Joints P₀ … Pₙ of an arm at rest, (bones + 1, 3), armature space.

    The last joint is the last bone's tail if the chain's tails lie where the next bones begin.
    In many imported rigs they do not: there it continues the last segment, as long as that is. An
    arm whose skin goes on beyond that is as long as its skin.

    Raises:
        RigError: a bone does not exist.
    """
    order = [_bone_index(skeleton, name) for name in bones]
    heads, tails = skeleton.heads[order], skeleton.tails[order]
    if len(order) < 2:
        return np.concatenate([heads, tails])
    segments = np.diff(heads, axis=0)
    gaps = np.linalg.norm(tails[:-1] - heads[1:], axis=1)
    if median(gaps) <= 0.1 * median(np.linalg.norm(segments, axis=1)):
        tip = tails[-1]
    else:
        tip = heads[-1] + segments[-1]
    if far := skeleton.tips.get(bones[-1], 0.0):
        tip = heads[-1] + far * normalized(tip - heads[-1])
    return np.concatenate([heads, tip[None]])


def arrange(
    skeleton: Skeleton, arms: Sequence[Sequence[str]], body: BodyFrame
) -> tuple[ArmChain, ...]:
    """Sides, pairs, directions and names of arms (bones root to tip), front to back and left before
    right.

    An arm is on the side that its root bone's name says (``.L``, ``_R``, ``Left`` …), unless
    geometry contradicts; else on the side where it lies. Arms that mirror each other, by name or by
    shape, share a pair number. A single arm close to the mid plane is ``CENTER``.

    Raises:
        RigError: a bone does not exist.
    """
    if not arms:
        return ()
    shapes = arm_shapes(skeleton, arms, body)
    azimuths = _azimuths(shapes)
    sides, mates = _sides_and_mates([bones[0] for bones in arms], shapes, azimuths)
    for arm in np.flatnonzero(np.isnan(azimuths)):
        azimuths[arm] = {"LEFT": 0.5 * np.pi, "RIGHT": -0.5 * np.pi, "CENTER": 0.0}[sides[arm]]

    pairs = sorted(
        {tuple(sorted({arm, mates.get(arm, arm)})) for arm in range(len(arms))},
        key=lambda pair: (
            # Rounded, so that noise does not decide between arms one above the other.
            round(float(np.mean(np.abs(azimuths[list(pair)]))), 4),
            round(float(np.mean(-shapes[list(pair), :, 2])), 4),
            min(natural_key(arms[arm][0]) for arm in pair),
        ),
    )
    side_order = ("LEFT", "CENTER", "RIGHT")
    return tuple(
        ArmChain(
            name=arm_name(sides[arm], number),
            bones=tuple(arms[arm]),
            side=sides[arm],
            pair=number,
            azimuth=float(azimuths[arm]),
            driven=is_driven(skeleton, arms[arm]),
        )
        for number, pair in enumerate(pairs, start=1)
        for arm in sorted(pair, key=lambda arm: side_order.index(sides[arm]))
    )


def place_added(
    skeleton: Skeleton,
    bones: Sequence[str],
    others: Sequence[tuple[Sequence[str], Side, int]],
    body: BodyFrame,
) -> ArmChain:
    """Side and pair of an arm, its bones root to tip, that joins others, which stay as they are.

    Raises:
        RigError: a bone does not exist, or belongs to another arm already.
    """
    taken = {bone for arm, _, _ in others for bone in arm}
    for bone in bones:
        if bone in taken:
            raise RigError(
                phrase("'{bone}' belongs to another arm of the list.", bone=bone),
                "Remove that arm from the list first, or select other bones.",
            )
    arranged = arrange(skeleton, [bones, *(arm for arm, _, _ in others)], body)
    added = next(arm for arm in arranged if arm.bones == tuple(bones))
    mates = {arm.bones for arm in arranged if arm.pair == added.pair and arm.bones != added.bones}
    used = {(side, pair) for _, side, pair in others}
    wanted = [pair for arm, _, pair in others if tuple(arm) in mates]
    free = [pair for pair in (*wanted, added.pair) if (added.side, pair) not in used]
    pair = free[0] if free else max(pair for _, pair in used) + 1
    return replace(added, name=arm_name(added.side, pair), pair=pair)


def arm_name(side: Side, pair: int) -> str:
    """What an arm is called in the list: "Arm 1 L"."""
    return f"Arm {pair}" + {"LEFT": " L", "RIGHT": " R", "CENTER": ""}[side]


def is_driven(skeleton: Skeleton, bones: Iterable[str]) -> bool:
    """Whether constraints or drivers move one of the bones."""
    return any(skeleton.constrained[_bone_index(skeleton, name)] for name in bones)


def arm_shapes(skeleton: Skeleton, arms: Sequence[Sequence[str]], body: BodyFrame) -> Floats:
    """Points evenly spaced along each arm, (arms, points, 3), in the canonical frame.

    Lengths are in mean arm lengths.
    """
    shapes = np.empty((len(arms), _SHAPE_POINTS, 3))
    lengths = np.empty(len(arms))
    for number, bones in enumerate(arms):
        joints = body.to_body(joint_positions(skeleton, bones))
        reach = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(joints, axis=0), axis=1))])
        stations = np.linspace(0.0, reach[-1], _SHAPE_POINTS)
        shapes[number] = np.stack(
            [np.interp(stations, reach, joints[:, axis]) for axis in range(3)], axis=1
        )
        lengths[number] = reach[-1]
    return shapes / lengths.mean()


def arm_azimuths(skeleton: Skeleton, arms: Sequence[Sequence[str]], body: BodyFrame) -> Floats:
    """Where each arm, its bones root to tip, points at rest, (arms,): radians from the front,
    positive to the left.

    An arm that stands on the body's axis points to the front.

    Raises:
        RigError: a bone does not exist.
    """
    return np.nan_to_num(_azimuths(arm_shapes(skeleton, arms, body)))


def mirror_distances(shapes: Floats, axis: int) -> Floats:
    """Mean distance of each arm from each arm's mirror image across a plane, (arms, arms)."""
    signs = np.ones(3)
    signs[axis] = -1.0
    return np.linalg.norm(shapes[:, None] - signs * shapes[None, :], axis=-1).mean(axis=-1)


def name_side(name: str) -> Side | None:
    """The side that a bone's name tells, in Blender's and other programs' conventions."""
    found = _SIDE_IN_NAME.search(name)
    if found is None:
        return None
    return "LEFT" if found.group().lower().startswith("l") else "RIGHT"


def natural_key(name: str) -> tuple[tuple[int, str], ...]:
    """Sort key that puts ``Bone.9`` before ``Bone.10``."""
    return tuple(
        (int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", name)
    )


_SIDE_IN_NAME: Final = re.compile(
    # A word of its own, or one of CamelCase.
    r"(?<![^._\- ])(?:[lLrR]|left|right|LEFT|RIGHT)(?![^._\- ])"
    r"|(?<![A-Z])(?:Left|Right)(?![a-z])"
)


def _azimuths(shapes: Floats) -> Floats:
    """Direction of each arm seen from above, (arms,); NaN for one that stands on the body's axis.

    It is where the arm's first part leads to, seen from the centre, however the rest is curled.
    """
    root, part = shapes[:, 0], shapes[:, _FIRST_PART]
    direction = root + 2.0 * (part - root)
    azimuths = np.arctan2(direction[:, 0], -direction[:, 1])
    azimuths[np.hypot(direction[:, 0], direction[:, 1]) < 1e-3] = np.nan
    return azimuths


def _sides_and_mates(
    root_names: Sequence[str], shapes: Floats, azimuths: Floats
) -> tuple[list[Side], dict[int, int]]:
    """Each arm's side, and for those that have one their partner on the other side."""
    lateral = np.sin(np.nan_to_num(azimuths))
    named: dict[int, Side] = {}
    sides: list[Side] = []
    for arm, name in enumerate(root_names):
        side = name_side(name)
        if side is not None and lateral[arm] * (1 if side == "LEFT" else -1) > -_NAME_LEEWAY:
            named[arm] = side
            sides.append(side)
        elif abs(lateral[arm]) < _ON_MID_PLANE:
            sides.append("CENTER")
        else:
            sides.append("LEFT" if lateral[arm] > 0.0 else "RIGHT")

    mates = _mates_by_name(root_names, named)
    mates |= _mates_by_shape(sides, mirror_distances(shapes, axis=0), mates)
    for arm in range(len(sides)):
        if arm not in mates and arm not in named and abs(lateral[arm]) < _NEAR_MID_PLANE:
            sides[arm] = "CENTER"
    return sides, mates


def _mates_by_name(root_names: Sequence[str], named: dict[int, Side]) -> dict[int, int]:
    """Partners whose names differ in the side alone."""
    by_key: dict[str, list[int]] = {}
    for arm in named:
        by_key.setdefault(_SIDE_IN_NAME.sub("\0", root_names[arm], count=1), []).append(arm)
    mates = {}
    for arms in by_key.values():
        if len(arms) == 2 and named[arms[0]] != named[arms[1]]:
            mates[arms[0]], mates[arms[1]] = arms[1], arms[0]
    return mates


def _mates_by_shape(
    sides: Sequence[Side], distances: Floats, taken: dict[int, int]
) -> dict[int, int]:
    """Partners that mirror each other, the best match first."""
    lefts = [arm for arm, side in enumerate(sides) if side == "LEFT" and arm not in taken]
    rights = [arm for arm, side in enumerate(sides) if side == "RIGHT" and arm not in taken]
    mates: dict[int, int] = {}
    for _, left, right in sorted(
        (float(distances[left, right]), left, right) for left in lefts for right in rights
    ):
        if distances[left, right] <= _MIRROR_TOLERANCE and left not in mates and right not in mates:
            mates[left], mates[right] = right, left
    return mates


def _bone_index(skeleton: Skeleton, name: str) -> int:
    bone = skeleton.index.get(name)
    if bone is None:
        raise RigError(
            phrase("The armature has no bone '{name}'.", name=name), "Detect the arms again."
        )
    return bone
