# SPDX-License-Identifier: GPL-3.0-or-later
"""The pose in which two people are compared: found from where joints are while a clip plays.

A file's rest pose may be a T, hanging arms, a lean, or no pose at all: it says nothing of the body.
So each clip is given another rest pose before anything is carried over, its reference pose
[Splice, 2.1]: upright, facing −Y, arms stretched sideways, legs straight down. It is found from
joint positions and from how bones turn against each other, as robust means over the clip, and from
nothing else. Give a bone another rest rotation, R(t) → R(t)·A, and its orientation Q in the
reference pose becomes Q·A as well: whatever is worked out from there is the same.

What joints do not tell is as on average over the clip. One thing alone is taken from the rest pose,
where that is a pose of this body: how a hand without fingers is turned about its forearm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from ...rotations import (
    IDENTITY,
    Floats,
    angle_between,
    conjugate,
    cross,
    dot,
    from_matrix,
    multiply,
    normalized,
    rotate,
    shortest_arc,
)
from ...smoothing import smooth_step
from ..clip import Clip, robust_direction, robust_rotations, spread_clip, usual_offsets
from ..humanoid import Landmarks, palm_directions, palm_roots
from .reference_feet import FootMoments, feet_at_rest

_SAMPLES: Final = 240
"""Moments of a clip that are looked at."""

_STANDING: Final = (0.8, 0.92)
"""Of the length of legs and trunk: how far the neck is from the feet when nobody stands, and from
where on somebody does. From 0.75 on, crouching moments of a dance turn its pelvis by 1.7°."""

_IN_LINE: Final = (float(np.cos(np.radians(60.0))), float(np.cos(np.radians(20.0))))
"""Cosines of the angle between a leg and the trunk: of a leg that is raised, and of one to stand
on."""

_SITTING: Final = 0.02
"""Weight of a moment at which nobody stands. At 0.05 one who squats for most of a dance and stands
up in between has its chest turned by 3.5° against other clips of the same body, and not by 2.6°."""

_RAISED: Final = 0.02
"""Weight of a leg that is raised all the time."""

BENT: Final = (np.radians(10.0), np.radians(35.0))
"""Bends of elbow and knee below which their plane says nothing, and from which it says all."""

_STRAIGHT: Final = 0.03
"""Weight, beside that of one bent moment, of the plane of a limb that swings without twisting: it
decides where a limb is always straight."""

_POSED: Final = np.radians(60.0)
"""How far the parts of a body rest off the reference pose when a rest pose is one to stand in."""

_UPRIGHT: Final = float(np.cos(np.radians(60.0)))
"""Cosine of how far off the vertical people may lean on average, and that is still up: sprinters
do by 40°, a file that lies on its back by 90°."""

_RIGID: Final = 2e-3
"""Of the body's size: what a joint may move against a bone and count as fixed to it."""

_FLAT: Final = 0.1
"""Of its length: how wide a palm is at least whose fingers tell how it lies."""

_ROOTS: Final = (0.04, 0.08)
"""Of the shoulders' width: how far the collar bones' roots are apart where they begin to tell left
from right, and where they tell it alone: at 0.086 they do to 0.1°, where an arm that is up all the
time turns the shoulders by 17°."""

_SQUARE: Final = float(np.cos(np.radians(45.0)))
"""Cosine of the angle by which their line may be off that of the shoulders: an arm that is up all
the time on the other side of one that hangs turns the shoulders by 15–27°."""

_LONE: Final = (0.6, 1.4)
"""Difference of two arms' heights, in lengths of an upper arm, from which on the higher one raises
its shoulder, and at which it does so fully."""

_X, _Y, _Z = np.eye(3)
LIMBS: Final = (
    # root, middle and end; what they are seen from; where they hang, where they rest, and the axis
    # about which they bend as they hang: a body that faces −Y, a side that is +1 on the left.
    (("upper_arm", "forearm", "hand"), "chest", -_X, _X),
    (("thigh", "shin", "foot"), "hips", _X, -_Z),
)
_FIXED: Final = {
    "chest": ("neck", "head", "clavicle.L", "clavicle.R", "upper_arm.L", "upper_arm.R"),
    "hips": ("thigh.L", "thigh.R", "spine", "chest"),
}


@dataclass(frozen=True, eq=False)
class ReferencePose:
    """A clip's reference pose."""

    orientations: Floats
    """(bones, 4), armature space."""
    offsets: Floats
    """(bones, 3): where bones sit on their parents, along these."""
    fixed: dict[str, dict[str, Floats]]
    """Joints that never move against the chest and the hips: places along the bone's axes, by
    landmark, by "chest" and "hips"."""


def has_fingers(clip: Clip, landmarks: Landmarks) -> bool:
    """Whether joints tell how a hand is turned."""
    skeleton = clip.skeleton
    hands = (skeleton.index.get(landmarks.get(f"hand.{side}") or "", -1) for side in "LR")
    return any(hand >= 0 and skeleton.children[hand] for hand in hands)


def has_palms(clip: Clip, landmarks: Landmarks) -> bool:
    """Whether the roots of fingers tell how both palms lie."""
    skeleton = clip.skeleton
    _, heads = skeleton.pose(clip.rotations[:1], clip.locations[:1])
    for side in "LR":
        hand = skeleton.index.get(landmarks.get(f"hand.{side}") or "", -1)
        roots = palm_roots(skeleton, hand) if hand >= 0 else None
        if roots is None:
            return False
        along, across = (each[0] for each in palm_directions(heads, hand, roots))
        # Some files have all fingers begin at one place.
        if np.linalg.norm(np.cross(along, across)) < _FLAT * float(along @ along):
            return False
    return True


def has_toes(clip: Clip, landmarks: Landmarks) -> bool:
    """Whether joints tell where both feet point."""
    return all(landmarks.get(f"toe.{side}") in clip.skeleton.index for side in "LR")


def find_reference_pose(
    clip: Clip,
    landmarks: Landmarks,
    *,
    fingers: bool = True,
    palms: bool = False,
    toes: bool = True,
) -> ReferencePose | None:
    """The reference pose of a clip; none where a landmark that it needs is missing.

    Fingers are joints: where they come to lie no rest pose may change. If neither of two bodies has
    any (``fingers``), forearms and hands are as they rest, where that is a pose of this body. If
    both tell how their palms lie (``palms``), these face down, with the thumb in front; if both
    have ``toes``, these point straight ahead.
    """
    if not len(clip) or not {
        *("hips", "chest", "thigh.L", "thigh.R", "upper_arm.L", "upper_arm.R")
    } <= {name for name, bone in landmarks.bones.items() if bone in clip.skeleton.index}:
        return None
    try:
        told = told_by(clip, landmarks)
        finder = ReferenceFinder(told, landmarks)
        return finder.pose(usual_offsets(told), fingers=fingers, palms=palms, toes=toes)
    except NoFrameError:
        return None


def told_by(clip: Clip, landmarks: Landmarks) -> Clip:
    """What of a clip the reference pose is found from: all, its rest pose, or one frame."""
    moment = landmarks.reference
    if moment == "":
        return clip
    if moment == "rest":
        one = clip.taken([0])
        at_rest = np.broadcast_to(IDENTITY, one.rotations.shape)
        return replace(one, rotations=at_rest, locations=np.zeros(one.locations.shape))
    return clip.taken([int(np.abs(clip.frames - moment).argmin())])


def standing_up(clip: Clip, landmarks: Landmarks) -> Floats:
    """Which way is up (3,), armature space: that of the world where people stand along it, lean
    as they may.

    A file may lie on its back: then it is how they stand on average.
    """
    up: Floats = clip.world[0, 2, :3] / clip.scale
    try:
        found = ReferenceFinder(clip, landmarks).upward()
    except (NoFrameError, KeyError):
        return up
    return up if up @ found > _UPRIGHT else found


class NoFrameError(Exception):
    """Joints from which left and up are to be told lie in one line."""


class ReferenceFinder:
    """What a reference pose is found from: bones at some moments, armature space."""

    def __init__(self, clip: Clip, landmarks: Landmarks) -> None:
        self._skeleton = clip.skeleton
        looks = spread_clip(clip, _SAMPLES)
        self._turns, self._heads = clip.skeleton.pose(looks.rotations, looks.locations)
        world = looks.world[:, :3] / clip.scale
        self._world = from_matrix(world[..., :3]), world[..., 3]
        index = clip.skeleton.index
        self._bones = {name: index[bone] for name, bone in landmarks.bones.items() if bone in index}
        self._standing = self._how_standing()

    def pose(self, offsets: Floats, *, fingers: bool, palms: bool, toes: bool) -> ReferencePose:
        """The whole."""
        hips, chest = self._bones["hips"], self._bones["chest"]
        made = self._told_by_joints()
        if not fingers:
            made |= self._arms_at_rest(made)
        if palms:
            made |= self._palms_down()
        made |= feet_at_rest(self._feet(conjugate(made[hips])), toes=toes)
        self._means(made, hips, chest)
        orientations = np.array([made[bone] for bone in range(len(self._skeleton))])
        return ReferencePose(orientations, offsets, self._fixed())

    def _told_by_joints(self) -> dict[int, Floats]:
        """Pelvis, chest, upper and lower limbs."""
        axes = {"hips": self._pelvis_axes(), "chest": self._chest_axes()}
        made = {self._bones[name]: conjugate(each) for name, each in axes.items()}
        for limb, seen_from, bends, rests in LIMBS:
            for side, sign in (("L", 1.0), ("R", -1.0)):
                names = [f"{each}.{side}" for each in limb]
                if all(each in self._bones for each in names):
                    goal = rests * (sign, 1.0, 1.0)
                    frame = self._bones[seen_from], axes[seen_from]
                    made |= self._limb([self._bones[each] for each in names], frame, bends, goal)
        return made

    def upward(self) -> Floats:
        """(3,) from feet to head of who stands."""
        return robust_direction(self._upward, self._standing)

    def _feet(self, pelvis: Floats) -> FootMoments:
        sides = [side for side in "LR" if f"foot.{side}" in self._bones]
        toes = {self._bones[f"foot.{each}"]: self._bones.get(f"toe.{each}", -1) for each in sides}
        turns, shifts = self._world
        hips = multiply(self._turns[:, self._bones["hips"]], pelvis)
        heads = {b: rotate(turns, self._heads[:, b]) + shifts for b in (*toes, *toes.values())}
        return FootMoments(
            toes,
            {foot: multiply(turns, self._turns[:, foot]) for foot in toes},
            heads,
            rotate(turns, self._upward),
            rotate(turns, rotate(hips, -_Y)),
            self._standing,
        )

    def _how_standing(self) -> Floats:
        """(moments,) weights: how much each says of where up is."""
        joints = self._joints
        tops, middles = self._top(), 0.5 * (joints("thigh.L") + joints("thigh.R"))
        trunks = tops - middles
        full, told, feet = lengths(trunks).max(), 0.0, np.zeros_like(tops)
        for side in "LR":
            leg = [f"{each}.{side}" for each in ("thigh", "shin", "foot")]
            leg = [each for each in leg if each in self._bones]
            for upper, lower in pairwise(leg):
                full += 0.5 * lengths(joints(lower) - joints(upper)).mean()
            foot = joints(leg[-1])
            # By all moments at once: a walk has each leg before it and behind in turn.
            in_line = dot(normalized(trunks), normalized(joints(leg[0]) - foot))
            says = max(float(_between(in_line, _IN_LINE).mean()), _RAISED) ** 2
            feet, told = feet + says * foot, told + says
        self._upward = tops - feet / told
        return np.maximum(_between(lengths(self._upward) / max(full, 1e-12), _STANDING), _SITTING)

    def _joints(self, landmark: str) -> Floats:
        return self._heads[:, self._bones[landmark]]

    def _top(self) -> Floats:
        for name in ("neck", "head"):
            if name in self._bones:
                return self._joints(name)
        raise NoFrameError

    def _seen(self, bone: int, vectors: Floats) -> Floats:
        return rotate(conjugate(self._turns[:, bone]), vectors)

    def _pelvis_axes(self) -> Floats:
        """(4,) of the pelvis along the hips bone's axes: left by the thighs, up as one stands."""
        hips = self._bones["hips"]
        left = self._joints("thigh.L") - self._joints("thigh.R")
        middle = 0.5 * (self._joints("thigh.L") + self._joints("thigh.R"))
        # Who never stands has the pelvis below the trunk.
        ways = np.concatenate([self._upward, self._top() - middle])
        weights = np.concatenate([self._standing, _SITTING * (1.01 - self._standing)])
        up = np.concatenate([self._seen(hips, each) for each in np.split(ways, 2)])
        return _axes(
            robust_direction(self._seen(hips, left), self._standing),
            robust_direction(up, weights),
        )

    def _chest_axes(self) -> Floats:
        """(4,) of the chest along its bone's axes: left by the shoulders, up along the trunk."""
        chest = self._bones["chest"]
        trunk = self._top() - self._joints("spine" if "spine" in self._bones else "hips")
        up = robust_direction(self._seen(chest, trunk), self._standing)
        return _axes(self._collars(chest, self._shoulders(chest, trunk, up)), up)

    def _shoulders(self, chest: int, trunk: Floats, up: Floats) -> Floats:
        """(3,) from right to left shoulder along the chest's axes; where one arm is higher than the
        other all the time, square to the neck that sits still on the chest, or to the trunk: bodies
        are alike on both sides.
        """
        left = self._joints("upper_arm.L") - self._joints("upper_arm.R")
        line = robust_direction(self._seen(chest, left), self._standing)
        neck = self._seen(chest, self._top() - self._joints("chest"))
        place, width = np.median(neck, axis=0), float(np.median(lengths(left)))
        still = lengths(neck - place).max() < _RIGID * width
        middle = normalized(place) if still and lengths(place) > _ROOTS[1] * width else up
        sine = float(line @ middle)
        if sine**2 > 1.0 - _SQUARE**2:
            return line
        # No shoulder is lower for an arm that is up.
        share = max(self._raises_left(normalized(trunk)) * np.sign(sine), 0.0)
        return normalized(line - share * sine * middle)

    def _raises_left(self, up: Floats) -> float:
        """From −1 to 1: how much higher the left arm is than the right one, all in all."""
        if not {"forearm.L", "forearm.R"} <= self._bones.keys():
            return 0.0
        heights = [
            dot(normalized(self._joints(f"forearm.{s}") - self._joints(f"upper_arm.{s}")), up)
            for s in "LR"
        ]
        apart = np.average(heights[0] - heights[1], weights=self._standing)
        return float(np.copysign(_between(np.abs(apart), _LONE), apart))

    def _collars(self, chest: int, shoulders: Floats) -> Floats:
        """(3,) to the left along the chest's axes: by the collar bones' roots, which no shrug
        and no raised arm moves; by the shoulders where those are in the middle or move.
        """
        if not {"clavicle.L", "clavicle.R"} <= self._bones.keys():
            return shoulders
        roots = self._seen(chest, self._joints("clavicle.L") - self._joints("clavicle.R"))
        middle = np.median(roots, axis=0)
        width = float(np.median(lengths(self._joints("upper_arm.L") - self._joints("upper_arm.R"))))
        apart = float(np.linalg.norm(middle))
        still = lengths(roots - middle).max() < _RIGID * width
        if not still or normalized(middle) @ shoulders < _SQUARE:
            return shoulders
        share = _between(np.array(apart / max(width, 1e-12)), _ROOTS)
        return normalized((1.0 - share) * shoulders + share * normalized(middle))

    def _limb(
        self, bones: Sequence[int], frame: tuple[int, Floats], bends: Floats, goal: Floats
    ) -> dict[int, Floats]:
        """Upper and lower limb, stretched out; elbow and knee bend in the same plane."""
        root, middle, end = bones
        upper = self._heads[:, middle] - self._heads[:, root]
        lower = self._heads[:, end] - self._heads[:, middle]
        normal = cross(normalized(upper), normalized(lower))
        bend = np.arctan2(lengths(normal), dot(normalized(upper), normalized(lower)))
        says = _between(bend, BENT)
        says *= smooth_step((np.pi - bend) / np.radians(30.0))
        # Straight, it is turned as if it had swung there from hanging, on the shortest way.
        carrier = multiply(self._turns[:, frame[0]], frame[1])
        way = rotate(conjugate(carrier), normalized(upper))
        swung = rotate(carrier, rotate(shortest_arc(np.broadcast_to(-_Z, way.shape), way), bends))
        made = {}
        # The hinge as it lies when the limb is where it rests.
        across = rotate(shortest_arc(-_Z, goal), bends)
        rest = from_matrix(np.stack([goal, across, np.cross(goal, across)], axis=-1))
        for bone, along in ((root, upper), (middle, lower)):
            ways = np.concatenate([normal, swung])
            # Straight up there is no shortest way.
            clear = (0.5 - 0.5 * way[:, 2]) ** 2
            weights = np.concatenate([says, _STRAIGHT / len(says) * clear])
            hinge = robust_direction(
                np.concatenate([self._seen(bone, each) for each in np.split(ways, 2)]), weights
            )
            length = robust_direction(self._seen(bone, along), np.ones(len(along)))
            own = _axes(length, hinge, first_and_second=True)
            made[bone] = multiply(rest, conjugate(own))
        return made

    def _arms_at_rest(self, made: dict[int, Floats]) -> dict[int, Floats]:
        """Forearms and hands without fingers as they rest, where that is a pose of this body.

        How forearm and hand are turned about the forearm no joint tells, and the average of a clip
        is no palm of its own: a hand that waves would face as one does that hangs.
        """
        if not self._rests_in_a_pose(made):
            return {}
        rests, heads = self._skeleton.rest_rotations, self._skeleton.heads
        chest = self._bones["chest"]
        found = {}
        for side in "LR":
            names = [f"{each}.{side}" for each in ("upper_arm", "forearm", "hand")]
            if not all(each in self._bones for each in names):
                continue
            root, middle, end = (self._bones[each] for each in names)
            lay = multiply(made[chest], conjugate(rests[chest]))
            goal = _X if side == "L" else -_X
            for upper, lower in ((root, middle), (middle, end)):
                way = normalized(rotate(lay, heads[lower] - heads[upper]))
                lay = multiply(shortest_arc(way, goal), lay)
            found[middle], found[end] = multiply(lay, rests[middle]), multiply(lay, rests[end])
        return found

    def _palms_down(self) -> dict[int, Floats]:
        """Hands whose palms are told by the roots of their fingers."""
        found = {}
        for side, goal in (("L", _X), ("R", -_X)):
            hand = self._bones.get(f"hand.{side}", -1)
            roots = palm_roots(self._skeleton, hand) if hand >= 0 else None
            if roots is None:
                continue
            ways = palm_directions(self._heads, hand, roots)
            along, across = (
                robust_direction(self._seen(hand, way), np.ones(len(way))) for way in ways
            )
            # From index to little finger is backwards.
            rest = from_matrix(np.stack([goal, _Y, np.cross(goal, _Y)], axis=-1))
            own = _axes(along, across, first_and_second=True)
            found[hand] = multiply(rest, conjugate(own))
        return found

    def _rests_in_a_pose(self, made: dict[int, Floats]) -> bool:
        """Whether pelvis, chest, thighs and shins rest in each other about as in the reference
        pose, seated and stooping people included.
        """
        rests = self._skeleton.rest_rotations
        names = [f"{each}.{side}" for each in ("thigh", "shin") for side in "LR"]
        names = ["chest", *(each for each in names if each in self._bones)]
        hips = self._bones["hips"]
        whole = multiply(made[hips], conjugate(rests[hips]))
        return all(
            angle_between(multiply(whole, rests[self._bones[each]]), made[self._bones[each]])
            < _POSED
            for each in names
        )

    def _means(self, made: dict[int, Floats], hips: int, chest: int) -> None:
        """All bones that have no place of their own: as they are on average."""
        skeleton = self._skeleton
        parents = np.maximum(skeleton.parents, 0)
        carriers = np.array(parents)
        spine = skeleton.ancestors(chest)
        # Between pelvis and chest as the chest sees them, above the pelvis as that does.
        spine = spine[: spine.index(hips)] if hips in spine else []
        above = skeleton.ancestors(hips)
        carriers[spine], carriers[above] = chest, hips
        between = multiply(conjugate(self._turns[:, carriers]), self._turns)
        means = robust_rotations(between, self._standing[:, None])
        for bone in (*spine, *above):
            made[bone] = multiply(made[carriers[bone]], means[bone])
        for bone, parent in enumerate(skeleton.parents):
            if bone not in made and parent >= 0:
                made[bone] = multiply(made[parent], means[bone])
            elif bone not in made:
                made[bone] = skeleton.rest_rotations[bone]

    def _fixed(self) -> dict[str, dict[str, Floats]]:
        """What never moves against chest and hips."""
        size = 2.0 * float(lengths(self._heads[0] - self._heads[0].mean(axis=0)).max())
        found: dict[str, dict[str, Floats]] = {}
        for carrier, names in _FIXED.items():
            bone = self._bones[carrier]
            found[carrier] = {}
            for name in names:
                # The first bone on the way there: what hangs on it may be still by chance.
                path = self._skeleton.ancestors(end) if (end := self._bones.get(name)) else []
                path = path[: path.index(bone)] if bone in path else []
                if end is not None and (path or self._skeleton.parents[end] == bone):
                    first = path[-1] if path else end
                    places = self._seen(bone, self._heads[:, first] - self._heads[:, bone])
                    place = np.median(places, axis=0)
                    if lengths(places - place).max() < _RIGID * size:
                        found[carrier][name] = places.mean(axis=0)
        return found


def _between(values: Floats, ends: tuple[float, float]) -> Floats:
    """From 0 at the first of two values to 1 at the second."""
    return smooth_step((values - ends[0]) / (ends[1] - ends[0]))


def lengths(vectors: Floats) -> Floats:
    """Of vectors (…, 3)."""
    return np.linalg.norm(vectors, axis=-1)


def _axes(left: Floats, up: Floats, *, first_and_second: bool = False) -> Floats:
    """(4,) X along the first and Z near the second; or X along the first and Y near the second.

    Raises:
        NoFrameError: they lie in one line.
    """
    x, other = normalized(left), normalized(up)
    other = other - np.dot(x, other) * x
    if np.linalg.norm(x) < 0.5 or np.linalg.norm(other) < 1e-3:
        raise NoFrameError
    other = normalized(other)
    columns = [x, other, np.cross(x, other)] if first_and_second else [x, np.cross(other, x), other]
    return from_matrix(np.stack(columns, axis=-1))
