# SPDX-License-Identifier: GPL-3.0-or-later
"""One piece of a body carried over from the splice clip onto the base, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...errors import ClipError
from ...rotations import (
    Floats,
    angle_between,
    conjugate,
    multiply,
    normalized,
    rotate,
    shortest_arc,
)
from ...skeleton import Skeleton
from ..clip import Clip, Posture, posture_of, sample_clip, slerp
from ..humanoid import (
    Correspondence,
    Landmarks,
    chain_length,
    find_correspondence,
    matched_bones,
    matched_chains,
)
from .body_frames import AnatomicalFrame, chain_frame, chest_frame, laid_over, pelvis_frame
from .limb_rotation import LimbTriangle, bend_to_reach, hinge_axis, joint_turn
from .parts import Part, bone_of, bones_beneath, landmark_bone, piece_bones

_LIMBS = {"arm": ("upper_arm", "forearm", "hand"), "leg": ("thigh", "shin", "foot")}

_UPRIGHT = np.radians(30.0)
"""Between chest and pelvis: at more than this nobody stands. Some files' bones all lie along one
axis at rest."""

_HINGE_SAMPLES = 200
"""Frames of a clip from which a limb's hinge is read."""


@dataclass(frozen=True, eq=False)
class Side:
    """A clip, and which bones of it are which."""

    clip: Clip
    landmarks: Landmarks | None

    @property
    def skeleton(self) -> Skeleton:
        """The clip's."""
        return self.clip.skeleton

    def humanoid(self) -> Landmarks:
        """The landmarks, where a part needs them."""
        if self.landmarks is None:
            raise ClipError(
                f"It is not known which bones of '{self.clip.name}' are arms and legs.",
                "Map its skeleton first.",
            )
        return self.landmarks

    @contextmanager
    def told(self) -> Iterator[None]:
        """Errors within say which of the two clips they speak of."""
        try:
            yield
        except ClipError as error:
            problem = f"{error.problem.removesuffix('.')} (clip '{self.clip.name}')."
            raise ClipError(problem, error.remedy) from error


@dataclass(frozen=True, eq=False)
class _Joined:
    """Bones that hang on each other alike on both skeletons.

    Seen from its parent, such a bone needs no other: ``before ∘ rotation ∘ after``.
    """

    base: tuple[int, ...]
    splice: tuple[int, ...]
    before: Floats
    """(bones, 4)"""
    after: Floats
    """(bones, 4)"""


@dataclass(frozen=True, eq=False)
class Carrier:
    """All that does not change over time: one piece on two skeletons."""

    base: Side
    splice: Side
    bones: tuple[int, ...]
    """Of the base, parents first; the joint is the first one's."""
    frames: tuple[AnatomicalFrame, AnatomicalFrame]
    """From which the piece is seen, on base and splice."""
    match: Correspondence
    limb: tuple[tuple[int, int, int], tuple[int, int, int]] | None
    """Joint, elbow and hand, on base and splice."""
    spread: tuple[tuple[int, ...], tuple[int, ...]] | None
    """Chains with unlike numbers of bones, on base and splice."""
    bent_rest: bool = False
    """Whether the rest pose of one of the two is none to compare the other's with."""

    @cached_property
    def joined(self) -> _Joined | None:
        """The bones that can be carried over one by one, if there are any."""
        base, other = self.base.skeleton, self.splice.skeleton
        pairs, constants = self.match.pairs, self.match.constants
        bones = [
            bone
            for bone in self.bones[1:]
            if bone in pairs
            and (parent := base.parents[bone]) in pairs
            and other.parents[pairs[bone]] == pairs[parent]
            and base.inherits_rotation[bone]
            and other.inherits_rotation[pairs[bone]]
        ]
        if not bones:
            return None
        answers = [pairs[bone] for bone in bones]
        after = np.stack([constants[bone] for bone in bones])
        above = np.stack([constants[base.parents[bone]] for bone in bones])
        before = multiply(
            multiply(conjugate(_offsets(base, bones)), conjugate(above)), _offsets(other, answers)
        )
        return _Joined(tuple(bones), tuple(answers), before, after)

    @cached_property
    def ratio(self) -> float:
        """How much longer the base's limb is than the splice's."""
        assert self.limb is not None
        ours, theirs = self.limb
        longer = chain_length(self.base.skeleton, ours)
        return longer / max(chain_length(self.splice.skeleton, theirs), 1e-12)

    @cached_property
    def hinge(self) -> Floats:
        """Along the base's upper limb (3,): the axis about which the splice clip bends it."""
        assert self.limb is not None
        (joint, _, _), others = self.limb
        clip = self.splice.clip
        chosen = np.linspace(clip.frames[0], clip.frames[-1], min(len(clip), _HINGE_SAMPLES))
        posture = sample_clip(clip, chosen)
        limb = LimbTriangle(*(posture.head(bone) for bone in others))
        axis = hinge_axis(limb, posture.orientation(others[0]))
        return rotate(conjugate(self.match.constants[joint]), axis)


def carriers(
    part: Part, base: Side, splice: Side, *, clavicle: bool, seen_from: str
) -> list[Carrier]:
    """The pieces of a part.

    Raises:
        ClipError: a bone is missing on either skeleton.
    """
    if part.root:
        return [_chain_carrier(part, base, splice)]
    return [
        _piece_carrier(piece, base, splice, clavicle=clavicle, seen_from=seen_from)
        for piece in part.pieces
    ]


def carry(
    carrier: Carrier,
    base: Posture,
    splice: Posture,
    rotations: Floats,
    locations: Floats,
    *,
    exact: bool,
) -> None:
    """Write the piece's rotations, fully spliced, into the base's arrays.

    Args:
        carrier: the piece.
        base: the base over these frames, as it was.
        splice: the splice clip at the moments that belong to them.
        rotations: (frames, bones, 4) of the base's skeleton, to be changed.
        locations: (frames, bones, 3), likewise.
        exact: whether hands and feet land on the point where they were seen, as far as the limb
            reaches; otherwise they lie in its direction, as in the source.
    """
    ours, theirs = carrier.frames
    our_frame = ours.orientation(base)
    # From the splice clip's world into the base's: the bodies' frames laid over each other.
    between = multiply(our_frame, conjugate(theirs.orientation(splice)))
    result = posture_of(base.skeleton, rotations, locations)
    if carrier.spread is not None:
        _carry_spread(carrier, between, splice, result, rotations)
        return
    _carry_inner(carrier, between, (result, splice), rotations, locations)
    if carrier.limb is None:
        return
    (joint, elbow, hand), (_, other_elbow, other_hand) = carrier.limb
    result = posture_of(base.skeleton, rotations, locations)
    limb = LimbTriangle(result.head(joint), result.head(elbow), result.head(hand))
    our_place, their_place = ours.place(base), theirs.place(splice)

    def seen(bone: int) -> Floats:
        return our_place + carrier.ratio * rotate(between, splice.head(bone) - their_place)

    wanted = LimbTriangle(limb.joint, seen(other_elbow), seen(other_hand))
    turn = joint_turn(limb, wanted)
    lower_turn = turn
    if exact:
        turned = LimbTriangle(
            limb.joint,
            limb.joint + rotate(turn, limb.elbow - limb.joint),
            limb.joint + rotate(turn, limb.hand - limb.joint),
        )
        hinge = rotate(multiply(turn, result.orientation(joint)), carrier.hinge)
        alike = carrier.match.same_body
        upper_bend, lower_bend = bend_to_reach(turned, wanted.hand, hinge, alike=alike)
        turn, lower_turn = multiply(upper_bend, turn), multiply(lower_bend, turn)
    _turn_limb(result, rotations, (joint, turn), (elbow, lower_turn))


def _turn_limb(
    result: Posture, rotations: Floats, upper: tuple[int, Floats], lower: tuple[int, Floats]
) -> None:
    """Turn two bones in armature space; what hangs on them keeps its own rotations."""
    (joint, turn), (elbow, lower_turn) = upper, lower
    wanted = multiply(turn, result.orientation(joint))
    rotations[:, joint] = multiply(conjugate(result.carried(joint)), wanted)
    if lower_turn is not turn:
        carried = result.carried(elbow)
        if result.skeleton.inherits_rotation[elbow]:
            carried = multiply(turn, carried)
        wanted = multiply(lower_turn, result.orientation(elbow))
        rotations[:, elbow] = multiply(conjugate(carried), wanted)


def _carry_inner(
    carrier: Carrier,
    between: Floats,
    postures: tuple[Posture, Posture],
    rotations: Floats,
    locations: Floats,
) -> None:
    """Orientations of all matched bones as they are seen from the body."""
    result, splice = postures
    joined = carrier.joined
    if joined is not None:
        inner = multiply(joined.before, splice.rotations(joined.splice))
        rotations[:, joined.base] = multiply(inner, joined.after)
        if carrier.match.same_rest:
            for bone, answer in zip(joined.base, joined.splice, strict=True):
                locations[:, bone] = splice.location(answer)
    inside = () if joined is None else joined.base
    for bone in carrier.bones:
        if bone in carrier.match.pairs and bone not in inside:
            answer, constant = carrier.match.pairs[bone], carrier.match.constants[bone]
            wanted = multiply(multiply(between, splice.orientation(answer)), constant)
            rotations[:, bone] = multiply(conjugate(result.carried(bone)), wanted)


def _carry_spread(
    carrier: Carrier, between: Floats, splice: Posture, result: Posture, rotations: Floats
) -> None:
    """A chain onto one with another number of bones: turns from rest, read off along its length."""
    assert carrier.spread is not None
    ours, theirs = carrier.spread
    base, other = result.skeleton, splice.skeleton
    rests = carrier.frames[0].at_rest(base), carrier.frames[1].at_rest(other)
    lay = multiply(rests[1], conjugate(rests[0]))
    places = np.interp(
        _fractions(base, ours), _fractions(other, theirs), np.arange(len(theirs), dtype=np.float64)
    )
    for bone, place in zip(ours, places, strict=True):
        first = int(place)
        turn = splice.turn(theirs[first])
        if place > first:
            after = splice.turn(theirs[first + 1])
            turn = slerp(turn, after, np.full(len(turn), place - first))
        rest = multiply(lay, base.rest_rotations[bone])
        wanted = multiply(between, multiply(turn, rest))
        if carrier.bent_rest and bone != ours[-1]:
            segment = base.heads[ours[ours.index(bone) + 1]] - base.heads[bone]
            along = rotate(between, _direction(splice, theirs, first))
            carried = result.carried(bone)
            own = rotate(multiply(carried, conjugate(base.rest_rotations[bone])), segment)
            own = np.broadcast_to(normalized(own), along.shape)
            wanted = multiply(shortest_arc(own, along), carried)
        if bone == ours[-1] and bone in carrier.match.constants:
            # The chest itself: its frame is met, not just its turn from rest.
            own = splice.orientation(theirs[-1])
            wanted = multiply(multiply(between, own), carrier.match.constants[bone])
        rotations[:, bone] = multiply(conjugate(result.carried(bone)), wanted)


def _direction(posture: Posture, bones: Sequence[int], place: int) -> Floats:
    """Where a chain leads from one of its bones on (from its last: to it), (frames, 3)."""
    first = min(place, len(bones) - 2)
    return normalized(posture.head(bones[first + 1]) - posture.head(bones[first]))


def _fractions(skeleton: Skeleton, bones: Sequence[int]) -> Floats:
    steps = np.linalg.norm(np.diff(skeleton.heads[list(bones)], axis=0), axis=1)
    passed = np.concatenate([[0.0], np.cumsum(steps)])
    return passed / passed[-1] if passed[-1] > 0.0 else np.linspace(0.0, 1.0, len(passed))


def _offsets(skeleton: Skeleton, bones: Sequence[int]) -> Floats:
    """Rest orientations (bones, 4) as the bones' parents see them."""
    parents = [skeleton.parents[bone] for bone in bones]
    return multiply(
        conjugate(skeleton.rest_rotations[parents]), skeleton.rest_rotations[list(bones)]
    )


def _piece_carrier(
    piece: str, base: Side, splice: Side, *, clavicle: bool, seen_from: str
) -> Carrier:
    ours, theirs = base.humanoid(), splice.humanoid()
    kind, _, side = piece.partition(".")
    if kind == "arm" and clavicle:
        clavicle = all(
            _has_clavicle(each.skeleton, each.humanoid(), side) for each in (base, splice)
        )
    from_pelvis = kind == "trunk" or (kind == "leg" and seen_from != "chest")
    with base.told():
        bones = piece_bones(piece, base.skeleton, ours, clavicle=clavicle)
        chest = chest_frame(base.skeleton, ours)
        pelvis = pelvis_frame(base.skeleton, ours) if from_pelvis else chest
    with splice.told():
        others = piece_bones(piece, splice.skeleton, theirs, clavicle=clavicle)
        chests = chest, laid_over(chest_frame(splice.skeleton, theirs), chest)
        frames = chests
        if from_pelvis:
            frames = pelvis, laid_over(pelvis_frame(splice.skeleton, theirs), pelvis)
    pairs = matched_bones(base.skeleton, bones, splice.skeleton, others, (ours, theirs))
    spread = None
    if kind == "trunk":
        if len(bones) == len(others):
            pairs = dict(zip(bones, others, strict=True))
        else:
            pairs = {bones[-1]: others[-1]}
            spread = tuple(bones), tuple(others)
    rests = frames[0].at_rest(base.skeleton), frames[1].at_rest(splice.skeleton)
    bent = False
    if kind == "trunk":
        sides = zip(frames, chests, (base, splice), strict=True)
        bent = any(
            angle_between(low.at_rest(each.skeleton), high.at_rest(each.skeleton)) > _UPRIGHT
            for low, high, each in sides
        )
    match = find_correspondence(
        base.skeleton, splice.skeleton, pairs, rests, (ours, theirs), aim_all=bent
    )
    if kind == "trunk":
        constants = dict(match.constants)
        constants[bones[-1]] = multiply(chests[1].turn, conjugate(chests[0].turn))
        match = replace(match, constants=constants)
    limb = None
    if kind in _LIMBS:
        names = [f"{name}.{side}" for name in _LIMBS[kind]]
        with base.told():
            our_limb = _three(base.skeleton, ours, names)
        with splice.told():
            limb = our_limb, _three(splice.skeleton, theirs, names)
    return Carrier(base, splice, tuple(bones), frames, match, limb, spread, bent)


def _has_clavicle(skeleton: Skeleton, landmarks: Landmarks, side: str) -> bool:
    """Whether there is a collar bone, and the arm hangs on it."""
    if landmarks.get(f"clavicle.{side}") is None:
        return False
    clavicle, upper = (
        landmark_bone(skeleton, landmarks, f"{name}.{side}") for name in ("clavicle", "upper_arm")
    )
    return upper in bones_beneath(skeleton, [clavicle])


def _three(skeleton: Skeleton, landmarks: Landmarks, names: Sequence[str]) -> tuple[int, int, int]:
    first, second, third = (landmark_bone(skeleton, landmarks, name) for name in names)
    for upper, lower in ((first, second), (second, third)):
        if lower not in bones_beneath(skeleton, [upper]):
            raise ClipError(
                f"'{skeleton.names[lower]}' does not hang on '{skeleton.names[upper]}'.",
                "Such a limb follows controls: bake its motion onto its bones first.",
            )
    return first, second, third


def _chain_carrier(part: Part, base: Side, splice: Side) -> Carrier:
    with base.told():
        bones = bones_beneath(base.skeleton, [bone_of(base.skeleton, part.root)])
    with splice.told():
        others = bones_beneath(
            splice.skeleton, [bone_of(splice.skeleton, part.splice_root or part.root)]
        )
    names = matched_bones(base.skeleton, bones, splice.skeleton, others, (None, None))
    pairs, spread = names, None
    if len(names) < len(bones) or names.get(bones[0]) != others[0]:
        pairs = matched_chains(base.skeleton, bones, splice.skeleton, others)
        single = all(
            _single(each, within)
            for each, within in ((base.skeleton, bones), (splice.skeleton, others))
        )
        if single and len(bones) != len(others):
            pairs, spread = {}, (tuple(bones), tuple(others))
    frames = chain_frame(base.skeleton, bones), chain_frame(splice.skeleton, others)
    rests = frames[0].at_rest(base.skeleton), frames[1].at_rest(splice.skeleton)
    match = find_correspondence(
        base.skeleton, splice.skeleton, pairs, rests, (None, None), aim_all=True
    )
    return Carrier(base, splice, tuple(bones), frames, match, None, spread)


def _single(skeleton: Skeleton, bones: Sequence[int]) -> bool:
    inside = set(bones)
    return all(sum(child in inside for child in skeleton.children[bone]) <= 1 for bone in bones)
