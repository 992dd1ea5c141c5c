# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of a body that can be spliced: sets of bones with one joint to all the rest.

:data:`PART_TABLE` is the one place that says which there are: panel, command line and tests read
it. docs/extending.md tells how to add a row.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final, Literal

from ...errors import ClipError
from ...phrases import as_phrase, phrase
from ...skeleton import Skeleton
from ..humanoid import Landmarks

SeenFrom = Literal["", "chest", "pelvis", "joint", "world"]
"""From where a part is seen: the chest; the pelvis; what it hangs on; upright axes that face as the
pelvis does."""


@dataclass(frozen=True)
class PartKind:
    """How a part is found on a skeleton and seen from the body, the same for left and right."""

    name: str
    """For messages."""
    root: str
    """Landmark of the bone with which the part begins, without its side."""
    seen_from: tuple[SeenFrom, ...]
    """Frames of the body from which it can be seen [Splice, 2.1]; the first one unless asked
    otherwise."""
    below: str = ""
    """Landmark of the bone on which the part hangs, if it begins farther up than with its root:
    with the first bone on the way there."""
    limb: tuple[str, str, str] | None = None
    """Landmarks of joint, elbow (knee) and hand (foot), without their side, of what points
    somewhere [Splice, 2.2]; a part without takes over how the splice clip's is turned."""
    clavicle: str = ""
    """Landmark of the bone that may come along above the root."""
    travels: bool = False
    """Whether it can bring the splice clip's way through the world with it."""
    spine: bool = False
    """Whether it ends with its root, and is matched along its length, whatever the numbers of its
    bones, so that the chest comes to lie as it does in the splice clip."""

    def frame(self, asked: SeenFrom) -> SeenFrom:
        """The frame from which such a part is seen if one is asked for, "" for the usual."""
        return asked if asked in self.seen_from else self.seen_from[0]

    def limb_on(self, side: str) -> tuple[str, ...]:
        """Landmarks of joint, elbow and hand on a side; none of a part that is no limb."""
        return tuple(sided(name, side) for name in self.limb or ())


ARM: Final = PartKind(
    "arm",
    root="upper_arm",
    seen_from=("chest", "pelvis", "joint", "world"),
    limb=("upper_arm", "forearm", "hand"),
    clavicle="clavicle",
)
LEG: Final = PartKind(
    "leg",
    root="thigh",
    seen_from=("pelvis", "chest", "joint", "world"),
    limb=("thigh", "shin", "foot"),
    travels=True,
)
TRUNK: Final = PartKind(
    "trunk", root="chest", below="hips", seen_from=("world", "pelvis", "joint"), spine=True
)
HEAD: Final = PartKind(
    "head", root="head", below="chest", seen_from=("chest", "pelvis", "joint", "world")
)


@dataclass(frozen=True)
class Part:
    """What to splice. A part of a humanoid, or any chain of bones."""

    name: str
    """In capitals the identifier in Blender's files."""
    title: str
    """In the panel."""
    description: str
    """In the panel's tooltip."""
    kind: PartKind | None = None
    """None for a chain."""
    sides: tuple[str, ...] = ("",)
    """"L", "R" or both; "" on the mid plane. Each has a joint of its own."""
    root: str = ""
    """Of a chain: its first bone on the base's skeleton; all beneath belongs to it."""
    splice_root: str = ""
    """The same on the splice clip's skeleton, if it has another name there."""


CHAIN: Final = Part("chain", "Chain", "A bone and all beneath it: a tail, an octopus arm")

PART_TABLE: Final = (
    Part(
        "right_arm",
        "Right Arm",
        "From the right collar bone or shoulder to the fingers",
        ARM,
        ("R",),
    ),
    Part(
        "left_arm", "Left Arm", "From the left collar bone or shoulder to the fingers", ARM, ("L",)
    ),
    Part("legs", "Legs", "Both legs", LEG, ("L", "R")),
    Part("trunk", "Trunk", "From above the pelvis to the chest", TRUNK),
    Part("head", "Head", "Neck and head", HEAD),
    Part("right_leg", "Right Leg", "From the right hip to the toes", LEG, ("R",)),
    Part("left_leg", "Left Leg", "From the left hip to the toes", LEG, ("L",)),
    CHAIN,
)
"""All parts, in the panel's order. Blender's files keep a part by its place: new rows go last."""

PARTS: Final = {part.name: part for part in PART_TABLE if part.kind is not None}
"""Parts of a humanoid, by name."""


def chain_part(root: str, splice_root: str = "") -> Part:
    """A bone and all beneath it: a tail, an octopus arm."""
    return replace(CHAIN, name=root, root=root, splice_root=splice_root or root)


def part_named(name: str) -> Part:
    """A part of a humanoid.

    Raises:
        ValueError: there is none of this name.
    """
    if name not in PARTS:
        raise ValueError(f"part must be one of {', '.join(PARTS)}, not {name!r}")
    return PARTS[name]


def opposite_part(part: Part) -> Part:
    """The part on the other side of the body: of the left arm the right one, of the head itself."""
    sides = tuple(sorted({"L": "R", "R": "L"}.get(side, side) for side in part.sides))
    if part.kind is None or sides == part.sides:
        return part
    return next(each for each in PARTS.values() if each.kind == part.kind and each.sides == sides)


def sided(landmark: str, side: str) -> str:
    """A landmark on a side ("L", "R"), or on the mid plane ("")."""
    return f"{landmark}.{side}" if side else landmark


def bone_of(skeleton: Skeleton, name: str) -> int:
    """Index of a bone.

    Raises:
        ClipError: the skeleton has no such bone.
    """
    if name not in skeleton.index:
        raise ClipError(
            phrase("There is no bone '{name}'.", name=name), "Choose the bones of the part again."
        )
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
        phrase("It is not known which bone is the {landmark}.", landmark=spoken(choices[0])),
        "Say it in the bone table.",
    )


def bones_beneath(skeleton: Skeleton, roots: Iterable[int]) -> list[int]:
    """Bones and all that hang on them, parents first."""
    inside: set[int] = set(roots)
    for bone, parent in enumerate(skeleton.parents):
        if parent in inside:
            inside.add(bone)
    return sorted(inside)


def part_bones(
    part: Part, skeleton: Skeleton, landmarks: Landmarks | None, *, clavicle: bool = True
) -> tuple[str, ...]:
    """Names of the bones that splicing the part changes (travel changes the hips as well).

    Raises:
        ClipError: a bone or landmark that the part needs is missing.
    """
    if part.kind is None:
        found = set(bones_beneath(skeleton, [bone_of(skeleton, part.root)]))
    else:
        assert landmarks is not None
        sides = (
            kind_bones(part.kind, side, skeleton, landmarks, clavicle=clavicle)
            for side in part.sides
        )
        found = set[int]().union(*sides)
    return tuple(skeleton.names[bone] for bone in sorted(found))


def kind_bones(
    kind: PartKind, side: str, skeleton: Skeleton, landmarks: Landmarks, *, clavicle: bool
) -> list[int]:
    """Indices of the bones on one side, parents first; their joint is the first bone's.

    Raises:
        ClipError: the skeleton has no such part, or it does not hang where it should.
    """

    def bone(*choices: str) -> int:
        return landmark_bone(skeleton, landmarks, *(sided(each, side) for each in choices))

    if not kind.below:
        first = (kind.clavicle,) if clavicle and kind.clavicle else ()
        return bones_beneath(skeleton, [bone(*first, kind.root)])
    top, end = bone(kind.below), bone(kind.root)
    above = skeleton.ancestors(end)
    if top not in above:
        raise ClipError(
            phrase(
                "The {kind} cannot be spliced: '{lower}' does not hang on '{upper}'.",
                kind=as_phrase(kind.name),
                lower=skeleton.names[end],
                upper=skeleton.names[top],
            ),
            "Look at the bone table, or choose another part.",
        )
    path = [*above[: above.index(top)][::-1], end]
    if kind.spine:
        return path
    # A neck that carries the arms is no part of the head.
    carriers = {
        each
        for name in ("upper_arm.L", "upper_arm.R")
        if (arm := skeleton.index.get(landmarks.get(name) or "")) is not None
        for each in skeleton.ancestors(arm)
    }
    return bones_beneath(skeleton, [next(each for each in path if each not in carriers)])


def spoken(landmark: str) -> str:
    """The words for a landmark, looked up as one: "left upper arm"."""
    name, _, side = landmark.partition(".")
    sides = {"L": "left ", "R": "right ", "": ""}
    return as_phrase(sides[side] + name.replace("_", " "))
