# SPDX-License-Identifier: GPL-3.0-or-later
"""The laws of splicing on recorded clips: a sample of all pairs, of re-rested copies, and feet.

``make bench ARGS=pairs`` measures every part on every pair.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.clips import read_clip
from octo_motion.blender.scene.imports import import_clip
from octo_motion.core.rotations import IDENTITY, Floats, angle_between
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.clip.rest_pose import average_pose
from octo_motion.core.splicing.clip.splice_timing import Timing
from octo_motion.core.splicing.humanoid.mapping import map_skeleton
from octo_motion.core.splicing.transfer.foot_contacts import find_contacts, find_stance, own_paths
from octo_motion.core.splicing.transfer.parts import PARTS
from octo_motion.core.splicing.transfer.reference_pose import find_reference_pose
from octo_motion.core.splicing.transfer.retarget import MappedClip
from octo_motion.core.splicing.transfer.splice import Splice, build_splices
from octo_motion.core.splicing.transfer.whole_body import retarget_clip
from tests.bench.splice_pairs import (
    FOLDERS,
    LIMITS,
    STACKS,
    Off,
    Pair,
    Take,
    measured_where_possible,
    takes,
    text,
)
from tests.core.splice_bodies import in_another_file, reference_poses_found_once

pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.one_blender,
]

SharedData = Callable[[str], Path]

_SHARE = 10
"""Of all parts on all pairs one of so many is measured here: about a thousand."""
_LEAST = 30
"""Pairs on which each law has to have been measured."""


@pytest.fixture(scope="module")
def people(
    add_on: None,  # noqa: ARG001
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[list[Take]]:
    import os

    root = Path(__file__).resolve().parents[2].parent
    data = Path(os.environ.get("OCTO_MOTION_DATA") or root / "shared" / "data")
    if not all((data / each).is_dir() for each in FOLDERS):
        pytest.skip(f"lacking data: {data}")
    found = takes(data, tmp_path_factory.mktemp("clips"))
    with reference_poses_found_once():
        yield found


def test_laws_hold_between_all_kinds_of_skeletons(people: list[Take]) -> None:
    found = list[Off]()
    for row, base in enumerate(people):
        for column, clip in enumerate(people):
            for number, stack in enumerate(STACKS):
                if base is not clip and (row + 3 * column + 7 * number) % _SHARE == 0:
                    found += measured_where_possible(Pair(base, clip), stack)
    print(text(found))
    assert not [each for each in found if each.most > LIMITS[each.law]]
    for law in LIMITS:
        chosen = [each for each in found if each.law == law]
        assert len(chosen) > _LEAST, law
        assert np.median([each.median for each in chosen]) < 0.5, law


def copied(take: Take, seed: int) -> Take:
    """Its bones with other axes, in other units and with its first frame as its rest pose."""
    clip = in_another_file(np.random.default_rng(seed), take.clip, posed_rest=True)
    return Take(take.name, clip, take.landmarks)


def places(base: Take, clip: Take, part: str) -> Floats:
    """Joints (frames, bones, 3) of the result of a splice, in units of its armature."""
    timing = Timing(1.0, 1.0, rate=base.clip.rate / clip.clip.rate)
    splice = Splice(PARTS[part], clip.clip, timing, clip.landmarks, travel=part == "legs")
    made = build_splices(base.clip, base.landmarks, [splice])
    return made.posed()[1]


def test_re_rested_copies_are_spliced_alike(people: list[Take]) -> None:
    """Of one body in two rest poses tests/referee/test_copies.py tells."""
    most, number = 0.0, 0
    for row, base in enumerate(people):
        clip = people[(row + 17) % len(people)]
        if Pair(base, clip).same_build or not all(each.has_fixed_hips for each in (base, clip)):
            continue
        part = ("right_arm", "legs", "trunk", "head")[row % 4]
        plain = places(base, clip, part)
        height = float(np.linalg.norm(np.ptp(plain[0], axis=0)))
        for onto, source in ((base, copied(clip, row)), (copied(base, row), clip)):
            size = 1.0 if onto is base else 0.3
            off = float(np.abs(places(onto, source, part) / size - plain).max()) / height
            most, number = max(most, off), number + 1
            assert off < 1e-3, (base.name, clip.name, part, onto is base)
    print(f"{number} copies, {most:.2e} of the height off at most")
    assert number > _LEAST


def test_who_squats_for_most_of_a_dance_has_the_chest_and_pelvis_of_who_stands(
    people: list[Take],
) -> None:
    # Four clips of one body, so that there is one truth: 3.5° and 3.3° off where each squatting
    # moment counts a twentieth of an upright one.
    names = ("TeddyIdle", "HoldTeddyByArm", "TeddyDangle", "cossack dance 2")
    taken = [next(each for each in people if each.name == name) for name in names]
    found = [find_reference_pose(each.clip, each.landmarks) for each in taken]
    for bone in ("chest", "hips"):
        turns = np.array(
            [
                pose.orientations[take.clip.skeleton.index[take.landmarks[bone]]]
                for take, pose in zip(taken, found, strict=True)
                if pose is not None
            ]
        )
        off = np.degrees(angle_between(turns[:1], turns[1:]))
        assert off[:2].max() < 1.0, bone
        assert off[2] < 3.0, bone


_UNLIKE = (
    "animated_drawings/rokoko_jesse_dance.bvh",
    "makehuman/walk1.bvh",
    "rigs_with_actions/KayKit_Knight.glb#Walking_A",
)
"""Bodies of which the first stands on two grounds, and the last has legs of a third of the usual
length."""
_WALKING = (
    "cmu/12_01_walk.bvh",
    "misc/walk01.bvh",
    "secondlife/avatar_punch_R.bvh",
    "misc/assimp_Boxing_Toes.bvh",
)


def mapped(data: SharedData, name: str) -> MappedClip:
    """A clip at 30 frames a second, 200 of them at most."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene = bpy.context.scene
    assert scene is not None
    scene.render.fps = 30
    file, _, action = name.partition("#")
    armature = bpy.data.objects[import_clip(data(file), bpy.context).armatures[0]]
    chosen = next(each for each in bpy.data.actions if each.name.endswith(action))
    slot = next(each for each in chosen.slots if each.target_id_type == "OBJECT")
    clip = read_clip(armature, chosen, slot)
    clip = clip.taken(np.arange(min(len(clip), 200)))
    return MappedClip(clip, map_skeleton(clip.skeleton, average_pose(clip)).landmarks)


def idle(body: Clip, source: Clip) -> Clip:
    """A body that does nothing, for as long as a clip lasts."""
    count = len(source)
    return replace(
        body.taken(np.zeros(count, dtype=np.intp)),
        frames=source.frames,
        rate=source.rate,
        rotations=np.broadcast_to(IDENTITY, (count, len(body.skeleton), 4)).copy(),
        locations=np.zeros((count, len(body.skeleton), 3)),
        scales=None,
    )


@pytest.mark.parametrize("name", _UNLIKE)
def test_feet_are_on_the_ground_of_bodies_unlike_the_clips(
    shared_data: SharedData, name: str
) -> None:
    body = mapped(shared_data, name)
    stands = find_stance(own_paths(body))
    for file in _WALKING:
        source = mapped(shared_data, file)
        still = idle(body.clip, source.clip)
        result = MappedClip(retarget_clip(body, still, source), body.landmarks)
        theirs, ours = own_paths(source), own_paths(result)
        flat = find_contacts(theirs).held.all(axis=-1)
        # On steps feet stand higher in the clip, too.
        low = theirs.points[..., 0, 2] - find_stance(theirs).ankle < 0.08 * theirs.leg
        off = np.abs(ours.points[..., 0, 2] - stands.ankle)[flat & low] / ours.leg
        assert off.size, file
        assert off.max() < 0.01, file
