# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs as other programs build them, on the ground: judged by their skin."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from tests.referee import creature_measures as measures
from tests.referee import scenes
from tests.referee.recording import moments, record
from tests.referee.surface import Surface
from tests.ui.rig import bind_skin, make_octopus

_BEYOND = 1.45
"""Lengths of a leg's last bone that its skin is long: a file that knows joints and no tails was
given some."""


def legged(_: Any) -> bpy.types.Object:
    """Eight legs of three bones, as thin as a spider's."""
    armature: Any = make_octopus(arms=8, joints=3)
    points: list[np.ndarray] = []
    groups: dict[str, list[int]] = {}
    faces: list[tuple[int, ...]] = []
    for bone in armature.data.bones:
        if bone.parent is None:
            continue
        head, along = np.array(bone.head_local), np.array(bone.tail_local - bone.head_local)
        across = 0.02 * np.cross(along / np.linalg.norm(along), [0.0, 0.0, 1.0])
        first = len(points)
        far = 1.0 if bone.children else _BEYOND
        for share in (0.0, far):
            ring = (across, np.array([0.0, 0.0, 0.02]), -across, np.array([0.0, 0.0, -0.02]))
            points += [head + share * along + each for each in ring]
        groups[bone.name] = list(range(first, first + 8))
        around = [(first + k, first + (k + 1) % 4) for k in range(4)]
        faces += [(one, other, other + 4, one + 4) for one, other in around]
    bind_skin(armature, points, groups, faces)
    return armature


@pytest.mark.parametrize("ground", ["bumps", "stairs"])
def test_legs_whose_skin_goes_on_beyond_their_bones_stay_out_of_the_ground(
    ground: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scenes, "_creature", legged)
    scene = scenes.build("walk", ground)
    played = record(scene.armature, moments(scene.start, scene.end, 2))
    length = measures.arm_length(played, scene.arms)
    sunk = measures.sink(played, Surface.of(scene.ground), length)
    # 0.014 and 0.008 arm lengths; as long as the bones said they were, it was 0.074 and 0.069.
    assert sunk.deepest.value <= 0.02


@pytest.mark.one_blender
def test_arms_that_fold_near_the_body_turn_no_faster_for_lying_between_their_neighbours(
    shared_data: Callable[[str], Path],
) -> None:
    scene = scenes.build("curl", "bumps", shared_data("octo/octopus_cheli_sanjuan.glb"))
    played = record(scene.armature, moments(scene.start, scene.end, 1))
    # 25.3°; it was 58.4°, as a bone that stood across its arm rolled to its neighbours at once.
    assert measures.turns(played).value <= 30.0


@pytest.mark.one_blender
@pytest.mark.parametrize(
    ("joints", "deepest", "slides"), [(5, 0.01, 0.012), (6, 0.0075, 0.0075), (8, 0.004, 0.0042)]
)
def test_arms_of_few_long_bones_leave_level_ground_upwards(
    joints: int,
    deepest: float,
    slides: float,
    monkeypatch: pytest.MonkeyPatch,
    add_on: Any,  # noqa: ARG001
) -> None:
    """Lifted no sooner than finer ones, five were up to 0.018 in it as they left their place, and
    arms of five, six and eight slid by 0.0129, 0.0113 and 0.0047 arm lengths in a hold. Measured
    0.0081, 0.0061 and 0.0027; and 0.0099, 0.0062 and 0.0038.
    """

    def creature(_: Any) -> Any:
        bpy.ops.octo_motion.add_octopus(joints=joints)
        return bpy.context.object

    monkeypatch.setattr(scenes, "_creature", creature)
    scene = scenes.build("walk", "plane")
    played = record(scene.armature, moments(scene.start, scene.end, 1))
    length = measures.arm_length(played, scene.arms)
    ground = Surface.of(scene.ground)
    assert measures.sink(played, ground, length).deepest.value < deepest
    assert measures.creeping(played, ground, length).value < slides
