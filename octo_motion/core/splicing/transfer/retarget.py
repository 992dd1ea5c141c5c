# SPDX-License-Identifier: GPL-3.0-or-later
"""A part of a body on one side retargeted from the splice clip onto the base, frame by frame."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...errors import ClipError
from ...phrases import phrase
from ...rotations import (
    IDENTITY,
    Floats,
    conjugate,
    multiply,
    normalized,
    rotate,
    shortest_arc,
    slerp,
)
from ...skeleton import Skeleton
from ..clip import Clip, Posture, Reresting, posture_of, sample_clip, with_rest_pose
from ..humanoid import (
    Correspondence,
    Landmarks,
    chain_length,
    find_correspondence,
    matched_bones,
    matched_chains,
    rest_alike,
    same_build,
)
from .body_frames import (
    AnatomicalFrame,
    chain_frame,
    chest_frame,
    joint_frame,
    laid_over,
    pelvis_frame,
)
from .limb_rotation import LimbTriangle, bend_to_reach, hinge_axis, joint_turn
from .parts import (
    Part,
    PartKind,
    SeenFrom,
    bone_of,
    bones_beneath,
    kind_bones,
    landmark_bone,
    sided,
)
from .reference_pose import (
    ReferencePose,
    find_reference_pose,
    has_fingers,
    has_palms,
    has_toes,
    standing_up,
)
from .same_body import agreeing
from .upright import Body, body_of, facing, stand_over

_HINGE_SAMPLES = 200
"""Moments of a clip from which a limb's hinge is read."""


@dataclass(frozen=True, eq=False)
class MappedClip:
    """A clip, and which bones of it are which."""

    clip: Clip
    landmarks: Landmarks | None

    @property
    def reference(self) -> ReferencePose | None:
        """The pose in which the skeleton rests, if it is its reference pose."""
        return None

    def in_reference_pose(
        self, *, fingers: bool = True, palms: bool = False, toes: bool = True
    ) -> MappedClip:
        """The clip with its reference pose as its rest pose; itself where none can be found."""
        if self.landmarks is None:
            return self
        found = find_reference_pose(
            self.clip, self.landmarks, fingers=fingers, palms=palms, toes=toes
        )
        if found is None:
            return self
        return self.referred(found)

    def referred(self, found: ReferencePose) -> ReferredClip:
        """The clip with a reference pose as its rest pose."""
        rested = with_rest_pose(self.skeleton, found.orientations, found.offsets)
        rests = Reresting(self.skeleton, rested)
        return ReferredClip(rests.into(self.clip), self.landmarks, found, rests)

    @cached_property
    def up(self) -> Floats:
        """(3,) armature space: along it the body of the clip stands."""
        return standing_up(self.clip, self.humanoid())

    @property
    def skeleton(self) -> Skeleton:
        """The clip's."""
        return self.clip.skeleton

    def humanoid(self) -> Landmarks:
        """The landmarks, where a part needs them."""
        if self.landmarks is None:
            raise ClipError(
                phrase(
                    "It is not known which bones of '{clip}' are arms and legs.",
                    clip=self.clip.name,
                ),
                "Map its skeleton first.",
            )
        return self.landmarks

    def bone(self, landmark: str) -> int:
        """Index of a landmark's bone.

        Raises:
            ClipError: the skeleton has none.
        """
        return landmark_bone(self.skeleton, self.humanoid(), landmark)

    @contextmanager
    def named_in_errors(self) -> Iterator[None]:
        """Errors within say which of the two clips they speak of."""
        try:
            yield
        except ClipError as error:
            problem = phrase(
                "{problem} (clip '{clip}').",
                problem=error.problem.open_ended(),
                clip=self.clip.name,
            )
            raise ClipError(problem, error.remedy) from error


@dataclass(frozen=True, eq=False)
class ReferredClip(MappedClip):
    """A mapped clip that rests in its reference pose."""

    found: ReferencePose
    rests: Reresting
    """From its own rest pose into this one, and back."""

    @property
    def reference(self) -> ReferencePose:
        """The pose in which the skeleton rests."""
        return self.found


def compared(base: MappedClip, splice: MappedClip) -> tuple[MappedClip, MappedClip]:
    """Two clips in their reference poses, or both at rest where either has none.

    At rest too where both files rest alike, as two actions of one armature do: what one bone does
    is then known to be the same on the other, how a hand is turned included, which no joint tells.
    """
    if base.landmarks is None or splice.landmarks is None:
        return base, splice
    marks = base.landmarks, splice.landmarks
    asked = any(each.reference != "" for each in marks)
    if not asked and rest_alike(base.skeleton, splice.skeleton, marks):
        return base, splice
    fingers = any(
        has_fingers(each.clip, known) for each, known in zip((base, splice), marks, strict=True)
    )
    toes = all(
        has_toes(each.clip, known) for each, known in zip((base, splice), marks, strict=True)
    )
    palms = all(
        has_palms(each.clip, known) for each, known in zip((base, splice), marks, strict=True)
    )
    referred = tuple(
        each.in_reference_pose(fingers=fingers, palms=palms, toes=toes) for each in (base, splice)
    )
    first, second = (each.reference for each in referred)
    if first is None or second is None:
        return base, splice
    if not asked and same_build(base.skeleton, splice.skeleton, marks):
        found = first.orientations, second.orientations
        agreed = agreeing((base.clip, splice.clip), marks, found)
        return referred[0], splice.referred(replace(second, orientations=agreed))
    return referred[0], referred[1]


@dataclass(frozen=True, eq=False)
class _JoinedBones:
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
class Retarget:
    """All that does not change over time: a part on one side, on two skeletons."""

    base: MappedClip
    splice: MappedClip
    bones: tuple[int, ...]
    """Of the base, parents first; the joint is the first one's."""
    frames: tuple[AnatomicalFrame, AnatomicalFrame]
    """From which the part is seen, on base and splice."""
    match: Correspondence
    limb: tuple[tuple[int, int, int], tuple[int, int, int]] | None
    """Joint, elbow and hand, on base and splice."""
    spread: tuple[tuple[int, ...], tuple[int, ...]] | None
    """Chains with unlike numbers of bones, on base and splice."""
    bodies: tuple[Body, Body] | None = None
    """Base and splice, where it matters how they stand."""
    upright: bool = False
    """Whether the part is seen from upright axes that face as the frames do."""
    spine: bool = False
    """Whether the part is a trunk."""
    neck: tuple[tuple[int, int], tuple[int, int]] | None = None
    """Where neck and head begin, on base and splice, if there are further bones between on either:
    then the first one's turn alone does not tell where the head is."""
    same_build: bool = False
    """Whether the two bodies are the same, up to one factor: not just the part's bones."""
    chain: bool = False
    """Whether the part is no humanoid's: a tail, an octopus arm."""

    @cached_property
    def joined(self) -> _JoinedBones | None:
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
        return _JoinedBones(tuple(bones), tuple(answers), before, after)

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
        chosen = np.linspace(clip.frames[0], clip.frames[-1], _HINGE_SAMPLES)
        posture = sample_clip(clip, chosen)
        limb = LimbTriangle(*(posture.head(bone) for bone in others))
        axis = hinge_axis(limb, posture.orientation(others[0]))
        return rotate(conjugate(self.match.constants[joint]), axis)


def find_retargets(
    part: Part, base: MappedClip, splice: MappedClip, *, clavicle: bool, seen_from: SeenFrom
) -> list[Retarget]:
    """A part's retargets, one for each side.

    Raises:
        ClipError: a bone is missing on either skeleton.
    """
    kind = part.kind
    if kind is None:
        return [_chain_retarget(part, base, splice)]
    return [
        _side_retarget(kind, side, (base, splice), clavicle=clavicle, seen_from=seen_from)
        for side in part.sides
    ]


def writing_retargeted(
    retarget: Retarget,
    base: Posture,
    splice: Posture,
    rotations: Floats,
    locations: Floats,
    *,
    exact: bool,
) -> Iterator[None]:
    """Write the part's rotations, fully spliced, into the base's arrays, in steps.

    Args:
        retarget: of the part on one side.
        base: the base over these frames, as it was.
        splice: the splice clip at the moments that belong to them.
        rotations: (frames, bones, 4) of the base's skeleton, to be changed.
        locations: (frames, bones, 3), likewise.
        exact: whether hands and feet land on the point where they were seen, as far as the limb
            reaches; otherwise they lie in its direction, as in the source.
    """
    ours, theirs = retarget.frames
    our_frame = ours.orientation(base)
    # From the splice clip's world into the base's: the bodies' frames laid over each other.
    yield
    frames = our_frame, theirs.orientation(splice)
    between = yield from _between(retarget, (base, splice), frames)
    result = posture_of(base.skeleton, rotations, locations)
    yield
    if retarget.spread is not None:
        _write_spread(retarget, between, splice, result, rotations)
        locations[:, list(retarget.bones)] = 0.0
    else:
        _write_inner(retarget, between, (result, splice), rotations)
        yield
        _write_locations(retarget, between, splice, result, locations)
    yield
    if retarget.spine and retarget.bodies is not None:
        body, other = retarget.bodies
        result = posture_of(base.skeleton, rotations, locations)
        way = rotate(between, other.lean(splice))
        stand_over(body, result, rotations, way, np.ones(len(way)))
        yield
    if retarget.neck is not None:
        _write_neck(retarget, between, (base.skeleton, splice), rotations, locations)
    if retarget.limb is None:
        return
    _write_limb(retarget, between, (base, splice), (rotations, locations), exact=exact)


def _write_limb(
    retarget: Retarget,
    between: Floats,
    postures: tuple[Posture, Posture],
    arrays: tuple[Floats, Floats],
    *,
    exact: bool,
) -> None:
    """Turn joint and elbow so that the hand lies where it was seen."""
    assert retarget.limb is not None
    (base, splice), (rotations, locations) = postures, arrays
    ours, theirs = retarget.frames
    (joint, elbow, hand), (other_joint, other_elbow, other_hand) = retarget.limb
    result = posture_of(base.skeleton, rotations, locations)
    limb = LimbTriangle(result.head(joint), result.head(elbow), result.head(hand))
    # On a body of other proportions the joint sits elsewhere: from there a limb keeps its way.
    our_place, their_place = limb.joint, splice.head(other_joint)
    if retarget.same_build:
        our_place, their_place = ours.place(base), theirs.place(splice)

    def seen(bone: int) -> Floats:
        return our_place + retarget.ratio * rotate(between, splice.head(bone) - their_place)

    wanted = LimbTriangle(limb.joint, seen(other_elbow), seen(other_hand))
    turn = joint_turn(limb, wanted)
    lower_turn = turn
    if exact:
        hinge = rotate(multiply(turn, result.orientation(joint)), retarget.hinge)
        alike = retarget.match.same_body
        turned = limb.turned(turn)
        upper_bend, lower_bend = bend_to_reach(turned, wanted.hand, hinge, alike=alike)
        turn, lower_turn = multiply(upper_bend, turn), multiply(lower_bend, turn)
    _turn_limb(result, rotations, (joint, turn), (elbow, lower_turn))


def _write_neck(
    retarget: Retarget,
    between: Floats,
    bodies: tuple[Skeleton, Posture],
    rotations: Floats,
    locations: Floats,
) -> None:
    """Turn a neck so that the head lies where it was seen from the neck, and turned as it was."""
    assert retarget.neck is not None
    skeleton, splice = bodies
    (neck, head), (other_neck, other_head) = retarget.neck
    # What bends it further on the base alone does nothing.
    alone = [bone for bone in skeleton.ancestors(head) if neck in skeleton.ancestors(bone)]
    alone = [bone for bone in alone if bone not in retarget.match.pairs]
    rotations[:, alone] = IDENTITY
    result = posture_of(skeleton, rotations, locations)
    own = normalized(result.head(head) - result.head(neck))
    wanted = normalized(rotate(between, splice.head(other_head) - splice.head(other_neck)))
    turned = multiply(shortest_arc(own, wanted), result.orientation(neck))
    rotations[:, neck] = multiply(conjugate(result.carried(neck)), turned)
    result = posture_of(skeleton, rotations, locations)
    seen = multiply(
        multiply(between, splice.orientation(other_head)), retarget.match.constants[head]
    )
    rotations[:, head] = multiply(conjugate(result.carried(head)), seen)


def _neck_joints(
    kind: PartKind, clips: tuple[MappedClip, MappedClip], bones: tuple[list[int], list[int]]
) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """Where neck and head begin on both, if the part has them and other bones between."""
    if kind.limb is not None or kind.root != "head":
        return None
    found, further = [], False
    for mapped, own in zip(clips, bones, strict=True):
        index = mapped.skeleton.index
        joints = [index.get(mapped.humanoid().get(each) or "", -1) for each in ("neck", "head")]
        neck, head = joints
        if neck not in own or head not in own or neck not in mapped.skeleton.ancestors(head):
            return None
        further = further or mapped.skeleton.parents[head] != neck
        found.append((neck, head))
    return (found[0], found[1]) if further else None


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


def _between(
    retarget: Retarget, postures: tuple[Posture, Posture], frames: tuple[Floats, Floats]
) -> Generator[None, None, Floats]:
    """(frames, 4) from the splice clip's armature space into the base's: their frames laid over
    each other; in steps.
    """
    ours, theirs = frames
    between = multiply(ours, conjugate(theirs))
    if retarget.bodies is None or not retarget.upright:
        return between
    ups = retarget.base.up, retarget.splice.up
    standing = np.ones(len(between))
    for body, posture, up in zip(retarget.bodies, postures, ups, strict=True):
        standing = standing * body.standing(posture, up)
        yield
    upright = multiply(facing(ours, ups[0]), conjugate(facing(theirs, ups[1])))
    return slerp(between, upright, standing)


def _write_inner(
    retarget: Retarget,
    between: Floats,
    postures: tuple[Posture, Posture],
    rotations: Floats,
) -> None:
    """Orientations of all matched bones as they are seen from the body."""
    result, splice = postures
    joined = retarget.joined
    if joined is not None:
        inner = multiply(joined.before, splice.rotations(joined.splice))
        rotations[:, joined.base] = multiply(inner, joined.after)
    inside = () if joined is None else joined.base
    for bone in retarget.bones:
        if bone in retarget.match.pairs and bone not in inside:
            answer, constant = retarget.match.pairs[bone], retarget.match.constants[bone]
            wanted = multiply(multiply(between, splice.orientation(answer)), constant)
            rotations[:, bone] = multiply(conjugate(result.carried(bone)), wanted)


def _write_locations(
    retarget: Retarget, between: Floats, splice: Posture, result: Posture, locations: Floats
) -> None:
    """How bones have left their places: as in the splice clip on the same body and on chains, at
    the base's size. On another body bones are as long as its own, and so are those that answer to
    none there, or that cannot leave their parent: limbs are aimed by where joints come to lie.
    """
    size, stretches = retarget.match.size, retarget.match.same_body or retarget.chain
    fixed = retarget.base.skeleton.connected
    for bone in retarget.bones:
        answer = retarget.match.pairs.get(bone) if stretches and not fixed[bone] else None
        moved = None if answer is None else splice.location(answer)
        if answer is None or moved is None or not moved.any():
            locations[:, bone] = 0.0
            continue
        seen = rotate(multiply(between, splice.location_axes(answer)), moved)
        locations[:, bone] = size * rotate(conjugate(result.location_axes(bone)), seen)


def _write_spread(
    retarget: Retarget, between: Floats, splice: Posture, result: Posture, rotations: Floats
) -> None:
    """A chain onto one with another number of bones: turns from rest, read off along its length."""
    assert retarget.spread is not None
    ours, theirs = retarget.spread
    base, other = result.skeleton, splice.skeleton
    rests = retarget.frames[0].at_rest(base), retarget.frames[1].at_rest(other)
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
        if bone == ours[-1] and bone in retarget.match.constants:
            # The chest itself: its frame is met, not just its turn from rest.
            own = splice.orientation(theirs[-1])
            wanted = multiply(multiply(between, own), retarget.match.constants[bone])
        rotations[:, bone] = multiply(conjugate(result.carried(bone)), wanted)


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


def _side_retarget(
    kind: PartKind,
    side: str,
    clips: tuple[MappedClip, MappedClip],
    *,
    clavicle: bool,
    seen_from: SeenFrom,
) -> Retarget:
    """The retarget of a humanoid's part on one side."""
    base, splice = clips
    marks = base.humanoid(), splice.humanoid()
    asked = kind.frame(seen_from)
    if kind.clavicle and clavicle:
        clavicle = all(_hangs_on_clavicle(kind, side, each) for each in clips)

    def seen(mapped: MappedClip) -> tuple[list[int], AnatomicalFrame, AnatomicalFrame]:
        """Bones of the part, the chest's frame, and the frame from which the part is seen."""
        skeleton, landmarks = mapped.skeleton, mapped.humanoid()
        with mapped.named_in_errors():
            bones = kind_bones(kind, side, skeleton, landmarks, clavicle=clavicle)
            chest = chest_frame(skeleton, landmarks, mapped.reference)
            if asked == "chest":
                return bones, chest, chest
            if asked == "joint":
                return bones, chest, joint_frame(skeleton, bones[0], chest)
            pelvis = pelvis_frame(skeleton, landmarks, mapped.reference)
            return bones, chest, pelvis

    (bones, chest, frame), (others, other_chest, other_frame) = map(seen, clips)
    limb = None
    if kind.limb is not None:
        limb = _limb_joints(kind, side, base), _limb_joints(kind, side, splice)
    alike = same_build(base.skeleton, splice.skeleton, marks)
    chests, frames = (chest, other_chest), (frame, other_frame)
    if alike:
        chests, frames = (chest, laid_over(other_chest, chest)), _agreeing(frames, clips, limb)
    if kind.spine:
        found = _spine_retarget(clips, (bones, others), frames, chests)
        return replace(found, bodies=bodies_of(*clips), upright=asked == "world")
    pairs = matched_bones(base.skeleton, bones, splice.skeleton, others, marks)
    match = find_correspondence(
        base.skeleton,
        splice.skeleton,
        pairs,
        _at_rest(frames, clips),
        marks,
        referred=base.reference is not None,
    )
    neck = _neck_joints(kind, clips, (bones, others))
    found = Retarget(
        base, splice, tuple(bones), frames, match, limb, None, neck=neck, same_build=alike
    )
    return replace(found, bodies=bodies_of(*clips), upright=True) if asked == "world" else found


def _agreeing(
    frames: tuple[AnatomicalFrame, AnatomicalFrame],
    clips: tuple[MappedClip, MappedClip],
    limb: tuple[tuple[int, int, int], tuple[int, int, int]] | None,
) -> tuple[AnatomicalFrame, AnatomicalFrame]:
    """Frames of one body, laid over each other by the joints that are fixed to both.

    Where these do not tell, a limb is seen from where its own joint is on average: midway between
    both, one shoulder that is raised all the time would shift the other arm.
    """
    ours, theirs = frames
    laid = laid_over(theirs, ours)
    if laid is not theirs or limb is None or min(ours.bone, theirs.bone) < 0:
        return ours, laid
    (joint, *_), (other, *_) = limb
    base, splice = (each.skeleton for each in clips)
    return ours.beginning_at(joint, base), theirs.beginning_at(other, splice)


def bodies_of(base: MappedClip, splice: MappedClip) -> tuple[Body, Body] | None:
    """How both stand; none where either's trunk does not go along with its hips."""
    ours, theirs = (body_of(each.skeleton, each.humanoid()) for each in (base, splice))
    return None if ours is None or theirs is None else (ours, theirs)


def _spine_retarget(
    clips: tuple[MappedClip, MappedClip],
    bones: tuple[Sequence[int], Sequence[int]],
    frames: tuple[AnatomicalFrame, AnatomicalFrame],
    chests: tuple[AnatomicalFrame, AnatomicalFrame],
) -> Retarget:
    """The retarget of the bones between pelvis and chest, which ends with the chest's frame.

    Args:
        clips: base and splice, as are all of the following.
        bones: from the lowest up, the chest last.
        frames: from which the trunk is seen.
        chests: the chests' own frames.
    """
    (base, splice), (ours, theirs) = clips, bones
    if len(ours) == len(theirs):
        pairs, spread = dict(zip(ours, theirs, strict=True)), None
    else:
        pairs, spread = {ours[-1]: theirs[-1]}, (tuple(ours), tuple(theirs))
    rests = _at_rest(frames, clips)
    marks = base.humanoid(), splice.humanoid()
    match = find_correspondence(
        base.skeleton,
        splice.skeleton,
        pairs,
        rests,
        marks,
        referred=base.reference is not None,
    )
    top = multiply(chests[1].turn, conjugate(chests[0].turn))
    match = replace(match, constants={**match.constants, ours[-1]: top})
    return Retarget(base, splice, tuple(ours), frames, match, None, spread, spine=True)


def _at_rest(
    frames: tuple[AnatomicalFrame, AnatomicalFrame], clips: tuple[MappedClip, MappedClip]
) -> tuple[Floats, Floats]:
    """Orientations (4,) of base and splice's frames in their rest poses."""
    return frames[0].at_rest(clips[0].skeleton), frames[1].at_rest(clips[1].skeleton)


def _hangs_on_clavicle(kind: PartKind, side: str, mapped: MappedClip) -> bool:
    """Whether there is a collar bone, and the arm hangs on it."""
    clavicle, root = sided(kind.clavicle, side), sided(kind.root, side)
    if mapped.humanoid().get(clavicle) is None:
        return False
    return mapped.bone(clavicle) in mapped.skeleton.ancestors(mapped.bone(root))


def _limb_joints(kind: PartKind, side: str, mapped: MappedClip) -> tuple[int, int, int]:
    """The bones that begin at joint, elbow and hand."""
    skeleton = mapped.skeleton
    with mapped.named_in_errors():
        joint, elbow, hand = map(mapped.bone, kind.limb_on(side))
        for upper, lower in ((joint, elbow), (elbow, hand)):
            if upper not in skeleton.ancestors(lower):
                raise ClipError(
                    phrase(
                        "'{lower}' does not hang on '{upper}'.",
                        lower=skeleton.names[lower],
                        upper=skeleton.names[upper],
                    ),
                    "Such a limb follows controls: bake its motion onto its bones first.",
                )
    return joint, elbow, hand


def _chain_retarget(part: Part, base: MappedClip, splice: MappedClip) -> Retarget:
    with base.named_in_errors():
        bones = bones_beneath(base.skeleton, [bone_of(base.skeleton, part.root)])
    with splice.named_in_errors():
        root = bone_of(splice.skeleton, part.splice_root or part.root)
        others = bones_beneath(splice.skeleton, [root])
    pairs, spread = matched_bones(base.skeleton, bones, splice.skeleton, others, (None, None)), None
    if len(pairs) < len(bones) or pairs.get(bones[0]) != others[0]:
        pairs = matched_chains(base.skeleton, bones, splice.skeleton, others)
        single = _single(base.skeleton, bones) and _single(splice.skeleton, others)
        if single and len(bones) != len(others):
            pairs, spread = {}, (tuple(bones), tuple(others))
    frames = chain_frame(base.skeleton, bones), chain_frame(splice.skeleton, others)
    rests = _at_rest(frames, (base, splice))
    match = find_correspondence(
        base.skeleton, splice.skeleton, pairs, rests, (None, None), aim_all=True
    )
    return Retarget(base, splice, tuple(bones), frames, match, None, spread, chain=True)


def _single(skeleton: Skeleton, bones: Sequence[int]) -> bool:
    inside = set(bones)
    return all(sum(child in inside for child in skeleton.children[bone]) <= 1 for bone in bones)
