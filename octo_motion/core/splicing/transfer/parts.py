# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of a body that can be spliced: sets of bones with one joint to all the rest."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from ...errors import ClipError
from ...skeleton import Skeleton
from ..humanoid import Landmarks


@dataclass(frozen=True)
class Part:
    """What to splice. A part of a humanoid, or any chain of bones."""

    name: str
    pieces: tuple[str, ...]
    """"arm.L", "arm.R", "leg.L", "leg.R", "trunk", "head"; empty for a chain."""
    root: str = ""
    """Of a chain: its first bone on the base's skeleton; all beneath belongs to it."""
    splice_root: str = ""
    """The same on the splice clip's skeleton, if it has another name there."""


RIGHT_ARM: Final = Part("right_arm", ("arm.R",))
LEFT_ARM: Final = Part("left_arm", ("arm.L",))
LEGS: Final = Part("legs", ("leg.L", "leg.R"))
TRUNK: Final = Part("trunk", ("trunk",))
HEAD: Final = Part("head", ("head",))
LEFT_LEG: Final = Part("left_leg", ("leg.L",))
RIGHT_LEG: Final = Part("right_leg", ("leg.R",))

PARTS: Final = {
    part.name: part for part in (RIGHT_ARM, LEFT_ARM, LEGS, TRUNK, HEAD, LEFT_LEG, RIGHT_LEG)
}


def chain_part(root: str, splice_root: str = "") -> Part:
    """A bone and all beneath it: a tail, an octopus arm."""
    return Part(root, (), root, splice_root or root)


def bone_of(skeleton: Skeleton, name: str) -> int:
    """Index of a bone.

    Raises:
        ClipError: the skeleton has no such bone.
    """
    if name not in skeleton.index:
        raise ClipError(f"There is no bone '{name}'.", "Choose the bones of the part again.")
    return skeleton.index[name]


def landmark_bone(skeleton: Skeleton, landmarks: Landmarks, *choices: str) -> int:
    """Index of the first landmark that there is.

    Raises:
        ClipError: the skeleton has none of them.
    """
    for choice in choices:
        name = landmarks.get(choice)
        if name is not None:
            return bone_of(skeleton, name)
    raise ClipError(
        f"It is not known which bone is the {_spoken(choices[0])}.", "Say it in the bone table."
    )


def bones_beneath(skeleton: Skeleton, roots: Iterable[int]) -> list[int]:
    """Bones and all that hang on them, parents first."""
    inside: set[int] = set(roots)
    for bone, parent in enumerate(skeleton.parents):
        if parent in inside:
            inside.add(bone)
    return sorted(inside)


def path_down(skeleton: Skeleton, top: int, end: int, what: str) -> list[int]:
    """The bones beneath ``top`` that lead to ``end``, which comes last.

    Raises:
        ClipError: ``end`` does not hang on ``top``.
    """
    path, bone = [], end
    while bone not in (top, -1):
        path.append(bone)
        bone = skeleton.parents[bone]
    if bone != top or not path:
        raise ClipError(
            f"The {what} cannot be spliced: '{skeleton.names[end]}' does not hang on "
            f"'{skeleton.names[top]}'.",
            "Look at the bone table, or choose another part.",
        )
    return path[::-1]


def part_bones(
    part: Part, skeleton: Skeleton, landmarks: Landmarks | None, *, clavicle: bool = True
) -> tuple[str, ...]:
    """Names of the bones that splicing the part changes (travel changes the hips as well).

    Raises:
        ClipError: a bone or landmark that the part needs is missing.
    """
    found: set[int] = set()
    for piece in part.pieces:
        assert landmarks is not None
        found |= set(piece_bones(piece, skeleton, landmarks, clavicle=clavicle))
    if part.root:
        found |= set(bones_beneath(skeleton, [bone_of(skeleton, part.root)]))
    return tuple(skeleton.names[bone] for bone in sorted(found))


def piece_bones(
    piece: str, skeleton: Skeleton, landmarks: Landmarks, *, clavicle: bool
) -> list[int]:
    """Indices of the bones of one piece, parents first; its joint is the first bone's."""

    def bone(*choices: str) -> int:
        return landmark_bone(skeleton, landmarks, *choices)

    kind, _, side = piece.partition(".")
    if kind == "arm":
        first = (f"clavicle.{side}",) if clavicle else ()
        return bones_beneath(skeleton, [bone(*first, f"upper_arm.{side}")])
    if kind == "leg":
        return bones_beneath(skeleton, [bone(f"thigh.{side}")])
    if kind == "trunk":
        return path_down(skeleton, bone("hips"), bone("chest"), "trunk")
    return bones_beneath(skeleton, path_down(skeleton, bone("chest"), bone("head"), "head")[:1])


def _spoken(landmark: str) -> str:
    name, _, side = landmark.partition(".")
    sides = {"L": "left ", "R": "right ", "": ""}
    return sides[side] + name.replace("_", " ")
