# SPDX-License-Identifier: GPL-3.0-or-later
"""No rest pose changes what a splice gives: clips of others, rewritten with other rest poses."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from octo_motion.core.rotations import angle_between
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.clip.rest_pose import average_pose
from octo_motion.core.splicing.clip.splice_timing import Timing
from octo_motion.core.splicing.humanoid.landmarks import Landmarks
from octo_motion.core.splicing.humanoid.mapping import map_skeleton
from octo_motion.core.splicing.transfer.parts import LEG, PARTS
from octo_motion.core.splicing.transfer.splice import Splice
from tests.blender.test_splice_laws import height, load, positions
from tests.core.splice_bodies import spliced
from tests.referee.recording import Floats
from tests.referee.rest_poses import (
    Bvh,
    Joint,
    along_x,
    anyhow,
    arms_lowered,
    hanging,
    leaning,
    with_rest,
)

pytestmark = [
    pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning"),
    pytest.mark.one_blender,
]

SharedData = Callable[[str], Path]
RestOf = Callable[[Joint, Floats], Floats]

WALKS = ("secondlife/avatar_walk.bvh", "cmu/12_01_walk.bvh", "cmu/02_02_walk_daz43.bvh")
PAIRS = [(base, clip) for base in WALKS for clip in WALKS if base != clip]
RESTS = {
    "along x": along_x,
    "leaning": leaning(26.0),
    "leaning back": leaning(-18.0),
    "hanging": hanging,
    "anyhow": anyhow(3),
}


def mapped(path: Path, kept: Landmarks | None = None) -> tuple[Clip, Landmarks]:
    clip, _ = load(path)
    return clip, kept or map_skeleton(clip.skeleton, average_pose(clip)).landmarks


@pytest.mark.parametrize("rest", RESTS)
@pytest.mark.parametrize("name", [*WALKS, "makehuman/walk1.bvh"])
def test_landmarks_are_found_in_any_rest_pose(
    shared_data: SharedData, tmp_path: Path, name: str, rest: str
) -> None:
    path = shared_data(name)
    other = with_rest(Bvh.read(path), RESTS[rest]).write(tmp_path / "other.bvh")
    _, wanted = mapped(path)
    _, found = mapped(other)
    assert {key: found.get(key) for key in wanted.bones} == dict(wanted.bones)


@pytest.mark.parametrize("rest", RESTS)
@pytest.mark.parametrize(("onto", "name"), PAIRS)
def test_the_rest_pose_of_clip_and_base_changes_nothing(
    shared_data: SharedData, tmp_path: Path, onto: str, name: str, rest: str
) -> None:
    folder = {each: shared_data(each) for each in (onto, name)}
    base, landmarks = mapped(folder[onto])
    clip, marks = mapped(folder[name])
    other = {}
    for each, kept in ((onto, landmarks), (name, marks)):
        file = tmp_path / f"{Path(each).stem}.bvh"
        with_rest(Bvh.read(folder[each]), RESTS[rest]).write(file)
        other[each] = mapped(file, kept)
    size, timing = height(base, landmarks), Timing(base.frames[0], clip.frames[0])
    limbs = [base.skeleton.index[bone] for key, bone in landmarks.bones.items() if _wrung(key)]
    for part in PARTS.values():
        travel = part.kind is LEG
        plain, rewritten, onto_rewritten = (
            spliced(target, names, Splice(part, each, timing, known, travel=travel))
            for target, names, each, known in (
                (base, landmarks, clip, marks),
                (base, landmarks, *other[name]),
                (*other[onto], clip, marks),
            )
        )
        assert np.abs(positions(rewritten) - positions(plain)).max() < 1e-3 * size
        assert np.abs(positions(onto_rewritten) - positions(plain)).max() < 1e-3 * size
        turned = angle_between(rewritten.rotations[:, limbs], plain.rotations[:, limbs])
        assert turned.max() < np.radians(1.0)


@pytest.mark.parametrize("rest", [arms_lowered(40.0), arms_lowered(75.0, elbows=30.0)])
@pytest.mark.parametrize("name", ["throw_R", "dance1", "hello", "sword_strike_R", "aim_L_bow"])
def test_one_body_in_other_poses_to_stand_in_is_not_wrung(
    shared_data: SharedData, tmp_path: Path, name: str, rest: RestOf
) -> None:
    # Elbows bend anyhow here: from the motions alone arms are off by 24° in the median, and by 99°
    # at most. By the rest poses 2.6° at most, and less
    # than 1° with straight elbows.
    base, landmarks = mapped(shared_data("secondlife/avatar_walk.bvh"))
    file = shared_data(f"secondlife/avatar_{name}.bvh")
    clip, marks = mapped(file)
    other = with_rest(Bvh.read(file), rest).write(tmp_path / "other.bvh")
    timing = Timing(base.frames[0], clip.frames[0])
    for part in PARTS.values():
        plain, rewritten = (
            spliced(base, landmarks, Splice(part, each, timing, known))
            for each, known in ((clip, marks), mapped(other, marks))
        )
        off = np.abs(positions(rewritten) - positions(plain)).max()
        assert off < 1e-3 * height(base, landmarks)
        assert angle_between(rewritten.rotations, plain.rotations).max() < np.radians(5.0)


def _wrung(landmark: str) -> bool:
    return landmark.partition(".")[0] in {"upper_arm", "thigh", "shin", "clavicle", "neck", "spine"}
