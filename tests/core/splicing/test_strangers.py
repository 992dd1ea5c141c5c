# SPDX-License-Identifier: GPL-3.0-or-later
"""Skeletons that nobody has tried, whose motion is known beforehand: mapped, spliced, measured."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from octo_motion.core.rotations import IDENTITY, Floats
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.clip.rest_pose import average_pose
from octo_motion.core.splicing.clip.splice_timing import Timing
from octo_motion.core.splicing.humanoid.fingers import FINGERS, finger_bones
from octo_motion.core.splicing.humanoid.landmarks import LANDMARKS, Landmarks
from octo_motion.core.splicing.humanoid.mapping import map_skeleton
from octo_motion.core.splicing.transfer.parts import PARTS
from octo_motion.core.splicing.transfer.splice import Splice, build_splices
from tests.core.splice_bodies import spliced
from tests.core.stranger_kinds import EXPECTED, KINDS
from tests.core.strangers import Action, Mover, Stranger, played
from tests.referee.clip_measures import angle

pytestmark = pytest.mark.one_blender

SILENT = {"numbers"}
"""Their names say nothing: what was told by shape is said."""
SPINELESS = {"roblox", "markerless"}


def stranger(name: str, action: Action, number: int, frames: int = 60) -> Stranger:
    """One of a kind, with another rest pose, other axes and units than the one before."""
    mover, bones = Mover(action, frames), KINDS[name]
    return (
        Stranger(mover, bones),
        Stranger(mover, bones, "x", "A", 0.01, y_up=True),
        Stranger(mover, bones, "world", "crouching", 0.01, y_up=True),
        Stranger(mover, bones, "anyhow", "along x", 1.0, seed=number),
        Stranger(mover, bones, "x", "leaning", 2.54),
    )[number % 5]


@pytest.mark.parametrize("name", KINDS)
def test_all_landmarks_are_found_on(name: str) -> None:
    first = {(bone.key, bone.side): bone.name for bone in reversed(KINDS[name])}
    wanted = {
        landmark: bone
        for landmark in LANDMARKS
        if landmark != "spine"
        and (bone := first.get((landmark.split(".")[0], landmark.partition(".")[2])))
    } | EXPECTED.get(name, {})
    for number in range(4):
        clip = stranger(name, "walk", number, 30).clip
        found = map_skeleton(clip.skeleton, average_pose(clip))
        own = {key: found.landmarks.get(key) for key in wanted}
        assert own == wanted, number
        assert ("spine" in found.landmarks.bones) == (name not in SPINELESS)
        assert bool(found.notes) == (name in SILENT), found.notes


@pytest.mark.parametrize("name", ["acclaim", "markerless", "numbers"])
def test_rounding_does_not_change_what_is_found_where_all_bones_rest_along_one_axis(
    name: str,
) -> None:
    """One leg rests opposite to the other: their sum is rounding alone."""
    skeleton = Stranger(Mover("walk", 2), KINDS[name], "along", "along x").clip.skeleton
    random = np.random.default_rng(1)
    said = set[tuple[object, ...]]()
    for _ in range(20):
        matrices = skeleton.rest_matrices.copy()
        matrices[:, :3, 3] += 1e-6 * random.normal(size=(len(skeleton), 3))
        found = map_skeleton(replace(skeleton, rest_matrices=matrices))
        said.add((*found.landmarks.bones.items(), found.notes))
    assert len(said) == 1


class Person:
    """A stranger's clip, mapped, and where its body is."""

    def __init__(self, own: Stranger) -> None:
        self.mover, self.clip = own.mover, own.clip
        self.marks: Landmarks = map_skeleton(self.clip.skeleton, average_pose(self.clip)).landmarks
        self._keys = {bone.name: (bone.key, bone.side) for bone in own.bones}
        self._turns, self._heads = played(self.clip)

    @property
    def has_palm(self) -> bool:
        return {("index0", "R"), ("pinky0", "R")} <= set(self._keys.values())

    def row(self, landmark: str) -> int:
        return self.clip.skeleton.index[self.marks[landmark]]

    def way(self, start: str, end: str) -> Floats:
        """From joint to joint as the body has them."""
        ends = (self.mover.place(*self._keys[self.marks[each]]) for each in (end, start))
        return np.subtract(*ends)

    def segment(self, landmark: str) -> Floats:
        return self.mover.segment(*self._keys[self.marks[landmark]])

    def segment_in(self, clip: Clip, landmark: str) -> Floats:
        """How the segment of a bone is turned in another clip of this skeleton."""
        row = self.row(landmark)
        axes = self.segment(landmark).transpose(0, 2, 1) @ self._turns[:, row]
        return played(clip)[0][:, row] @ axes.transpose(0, 2, 1)


@cache
def person(name: str, action: Action, number: int) -> Person:
    return Person(stranger(name, action, number))


def apart(first: Floats, second: Floats) -> float:
    """Degrees between orientations (frames, 3, 3), at most."""
    cosine = (np.einsum("nij,nij->n", first, second) - 1.0) / 2.0
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)).max()))


@pytest.mark.parametrize(
    ("name", "fingers", "joints"),
    [
        *(("mixamo", 5, 4), ("unreal 4", 5, 3), ("character creator", 5, 3), ("smpl-x", 5, 3)),
        *(("rokoko", 5, 3), ("auto-rig pro", 5, 3), ("chat avatar", 5, 3), ("biped 001", 2, 2)),
        *(("unreal 5", 3, 3), ("game characters", 3, 2), ("genesis 8", 3, 2), ("smpl", 0, 0)),
    ],
)
def test_fingers_are_known_by_any_name(name: str, fingers: int, joints: int) -> None:
    skeleton = stranger(name, "walk", 0, 2).clip.skeleton
    places = {bone.name: bone.key for bone in KINDS[name]}
    hand = next(bone.name for bone in KINDS[name] if (bone.key, bone.side) == ("hand", "R"))
    found = finger_bones(skeleton, skeleton.index[hand])
    assert {finger for finger, _ in found} == set(FINGERS[:fingers])
    assert max((number for _, number in found), default=-1) == joints - 1
    assert all(f"{key[0]}{key[1]}" == places[skeleton.names[bone]] for key, bone in found.items())


PAIRS = [(name, number) for number, name in enumerate(sorted(KINDS))]


@pytest.mark.parametrize(("name", "number"), PAIRS)
def test_a_stranger_gives_and_takes_arms_legs_and_head_as_they_are(name: str, number: int) -> None:
    for onto, source in (
        (person(name, "walk", number), person("mixamo", "throw", 0)),
        (person("mixamo", "walk", 0), person(name, "throw", number)),
    ):
        parts = (
            ("right_arm", "chest", ("upper_arm.R", "forearm.R", "hand.R"), 15.0),
            ("legs", "pelvis", ("thigh.L", "shin.L", "foot.L"), 10.0),
            ("head", "chest", ("neck", "head"), 6.0),
        )
        result = build_splices(
            onto.clip,
            onto.marks,
            [Splice(PARTS[part], source.clip, Timing(1, 1), source.marks) for part, *_ in parts],
        )
        heads = played(result)[1]
        for part, body, limbs, end in parts:
            laid = onto.mover.turns[body] @ source.mover.turns[body].transpose(0, 2, 1)
            for upper, lower in pairwise(limbs):
                # A neck that carries the arms stays where it is; some have none.
                if upper == "neck" and ("biped, tri" in name or name in SPINELESS):
                    continue
                own = heads[:, onto.row(lower)] - heads[:, onto.row(upper)]
                wanted = np.einsum("nij,nj->ni", laid, source.way(upper, lower))
                # Two seconds of a throw hold the chest otherwise than a walk does, by up to 4°.
                limit = 4.0 if part == "right_arm" else 3.0
                assert angle(own, wanted).max() < limit, (part, upper)
            last = limbs[-1]
            off = apart(onto.segment_in(result, last), laid @ source.segment(last))
            # The roots of fingers tell how a palm lies, at any moment.
            palms = last == "hand.R" and all(each.has_palm for each in (onto, source))
            assert off < (6.0 if palms else end), (part, last)


@pytest.mark.parametrize("name", ["mixamo", "smpl", "unreal 4"])
def test_a_leg_that_is_always_up_does_not_tilt_the_pelvis(name: str) -> None:
    # Longer legs: of one body joints that sit on the pelvis would tell how it is turned.
    onto = person("mixamo", "walk", 0)
    source = Person(Stranger(Mover("stork", 60, {"legs": 1.2}), KINDS[name]))
    splice = Splice(PARTS["legs"], source.clip, Timing(1, 1), source.marks)
    heads = played(spliced(onto.clip, onto.marks, splice))[1]
    laid = onto.mover.turns["pelvis"] @ source.mover.turns["pelvis"].transpose(0, 2, 1)
    for upper, lower in (("thigh.L", "shin.L"), ("thigh.R", "shin.R"), ("shin.R", "foot.R")):
        own = heads[:, onto.row(lower)] - heads[:, onto.row(upper)]
        off = angle(own, np.einsum("nij,nj->ni", laid, source.way(upper, lower)))
        # Pelvises are compared as people stand, who lean by 6° as they walk. By both feet: 23°.
        assert off.max() < 8.0, upper


@pytest.mark.parametrize("name", ["mixamo", "smpl", "unreal 4"])
def test_feet_point_where_those_of_the_clip_do(name: str) -> None:
    """One foot is turned out all the time, the other one never stands; the base does."""
    source = Person(Stranger(Mover("balance", 60, {"legs": 1.2}), KINDS[name]))
    still = stranger(name, "walk", 0).clip
    base = replace(still, rotations=np.broadcast_to(IDENTITY, still.rotations.shape))
    marks = map_skeleton(base.skeleton).landmarks
    splice = Splice(PARTS["legs"], source.clip, Timing(1, 1), source.marks)
    heads = played(spliced(base, marks, splice))[1]
    for side in "LR":
        foot, toe = (base.skeleton.index[marks[f"{each}.{side}"]] for each in ("foot", "toe"))
        own = heads[:, toe] - heads[:, foot]
        way = source.way(f"foot.{side}", f"toe.{side}")
        seen = np.einsum("nji,nj->ni", source.mover.turns["pelvis"], way)
        off = angle(own, seen).max()
        # Without: 29° and 48°. Longer legs fall by 4° more from ankle to ball.
        assert off < 6.0, side
