# SPDX-License-Identifier: GPL-3.0-or-later
"""No rest pose changes what a splice gives: clips of others, rewritten with other rest poses."""

from collections.abc import Callable
from functools import cache
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
from tests.blender.test_splice_laws import height, imported, positions
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
    pytest.mark.usefixtures("reference_poses"),
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


Mapped = Callable[..., tuple[Clip, Landmarks]]


@pytest.fixture(scope="module")
def mapped(
    add_on: None,  # noqa: ARG001
    tmp_path_factory: pytest.TempPathFactory,
) -> Mapped:
    """A clip, as it is or rewritten with another rest pose, and its landmarks; read once each."""

    @cache
    def read(path: Path, rest: RestOf | None = None) -> tuple[Clip, Landmarks]:
        if rest is not None:
            other = tmp_path_factory.mktemp("rests") / path.name
            path = with_rest(Bvh.read(path), rest).write(other)
        clip, _ = imported(path)
        return clip, map_skeleton(clip.skeleton, average_pose(clip)).landmarks

    return read


@pytest.mark.parametrize("rest", RESTS)
@pytest.mark.parametrize("name", [*WALKS, "makehuman/walk1.bvh"])
def test_landmarks_are_found_in_any_rest_pose(
    shared_data: SharedData, mapped: Mapped, name: str, rest: str
) -> None:
    _, wanted = mapped(shared_data(name))
    _, found = mapped(shared_data(name), RESTS[rest])
    assert {key: found.get(key) for key in wanted.bones} == dict(wanted.bones)


@pytest.mark.parametrize("rest", RESTS)
@pytest.mark.parametrize(("onto", "name"), PAIRS)
def test_the_rest_pose_of_clip_and_base_changes_nothing(
    shared_data: SharedData, mapped: Mapped, onto: str, name: str, rest: str
) -> None:
    base, landmarks = mapped(shared_data(onto))
    clip, marks = mapped(shared_data(name))
    onto_other, _ = mapped(shared_data(onto), RESTS[rest])
    other, _ = mapped(shared_data(name), RESTS[rest])
    size, timing = height(base, landmarks), Timing(base.frames[0], clip.frames[0])
    limbs = [base.skeleton.index[bone] for key, bone in landmarks.bones.items() if _wrung(key)]
    for part in PARTS.values():
        travel = part.kind is LEG
        plain, rewritten, onto_rewritten = (
            spliced(target, names, Splice(part, each, timing, known, travel=travel))
            for target, names, each, known in (
                (base, landmarks, clip, marks),
                (base, landmarks, other, marks),
                (onto_other, landmarks, clip, marks),
            )
        )
        assert np.abs(positions(rewritten) - positions(plain)).max() < 1e-3 * size
        assert np.abs(positions(onto_rewritten) - positions(plain)).max() < 1e-3 * size
        turned = angle_between(rewritten.rotations[:, limbs], plain.rotations[:, limbs])
        assert turned.max() < np.radians(1.0)


@pytest.mark.parametrize("rest", [arms_lowered(40.0), arms_lowered(75.0, elbows=30.0)])
@pytest.mark.parametrize("name", ["throw_R", "dance1", "hello", "sword_strike_R", "aim_L_bow"])
def test_one_body_in_other_poses_to_stand_in_is_not_wrung(
    shared_data: SharedData, mapped: Mapped, name: str, rest: RestOf
) -> None:
    # Elbows bend anyhow here: from the motions alone arms are off by 24° in the median, and by 99°
    # at most. By the rest poses 2.6° at most, and less
    # than 1° with straight elbows.
    base, landmarks = mapped(shared_data("secondlife/avatar_walk.bvh"))
    clip, marks = mapped(shared_data(f"secondlife/avatar_{name}.bvh"))
    other, _ = mapped(shared_data(f"secondlife/avatar_{name}.bvh"), rest)
    timing = Timing(base.frames[0], clip.frames[0])
    for part in PARTS.values():
        plain, rewritten = (
            spliced(base, landmarks, Splice(part, each, timing, known))
            for each, known in ((clip, marks), (other, marks))
        )
        off = np.abs(positions(rewritten) - positions(plain)).max()
        assert off < 1e-3 * height(base, landmarks)
        assert angle_between(rewritten.rotations, plain.rotations).max() < np.radians(5.0)


def _wrung(landmark: str) -> bool:
    return landmark.partition(".")[0] in {"upper_arm", "thigh", "shin", "clavicle", "neck", "spine"}
