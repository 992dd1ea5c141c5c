# SPDX-License-Identifier: GPL-3.0-or-later
"""Follow-through of the octopus' own walk and swim: one tick box, and contacts stay exact."""

from typing import Any

import bpy
import numpy as np
import pytest

from tests.ui.made import prepare
from tests.ui.rig import Octopus, generate

pytestmark = pytest.mark.one_blender

OCTOPUS = Octopus(add_on=True)


def tails(armature: Any, frames: Any) -> np.ndarray:
    """(frames, arms, bones, 3) world, as Blender plays them."""
    found = []
    for frame in frames:
        bpy.context.scene.frame_set(int(frame))
        evaluated = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        bones, world = evaluated.pose.bones, evaluated.matrix_world
        arms = armature.octo_motion.locomotion.arms
        found.append([[world @ bones[each.name].tail for each in arm.bones] for arm in arms])
    return np.array(found, dtype=np.float64)


def both(octopus: Any, frames: Any) -> tuple[np.ndarray, np.ndarray]:
    """Without and with follow-through."""
    settings = octopus.octo_motion.locomotion
    settings.keys = "DENSE"
    generate(octopus)
    plain = tails(octopus, frames)
    settings.body.trail = True
    generate(octopus)
    return plain, tails(octopus, frames)


def arm_length(places: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(places[0, 0], axis=0), axis=-1).sum())


def test_swimming_arms_trail_and_the_loop_closes(octopus: Any) -> None:
    bpy.ops.octo_motion.setup_load(name="swim")
    settings = octopus.octo_motion.locomotion
    settings.travel_on, settings.cycles = "NONE", 2
    generate(octopus)
    last = int(octopus.animation_data.action.frame_range[1])
    plain, followed = both(octopus, range(1, last + 1))
    apart = np.linalg.norm(followed - plain, axis=-1) / arm_length(plain)
    print("swim", apart[..., -1].max(), apart.max())
    # Only outer thirds, and enough to be seen.
    np.testing.assert_allclose(apart[:, :, : 2 * apart.shape[2] // 3], 0.0, atol=1e-5)
    assert 0.03 < apart[..., -1].max() < 0.3
    np.testing.assert_allclose(followed[0], followed[-1], atol=1e-5)
    speeds = followed[1] - followed[0], followed[-1] - followed[-2]
    assert np.abs(speeds[0] - speeds[1]).max() < 2.0 * np.abs(np.diff(followed, 2, axis=0)).max()


def test_what_rests_on_the_ground_stays_to_the_last_digit(octopus: Any) -> None:
    bpy.ops.octo_motion.setup_load(name="walk")
    bpy.ops.octo_motion.add_route()
    bpy.context.view_layer.objects.active = octopus
    settings = octopus.octo_motion.locomotion
    settings.timing, settings.frame_end, settings.keys = "RANGE", 90, "DENSE"

    def made(*, trail: bool) -> Any:
        settings.body.trail = trail
        shot = prepare(octopus, bpy.context)
        for _ in shot.compute():
            pass
        return shot.shot.result

    plain, followed = made(trail=False), made(trail=True)
    moved = np.any(plain.arms.rotations != followed.arms.rotations, axis=-1)
    assert moved.any()
    start = 0
    for lying in plain.arms.in_contact:
        bones = lying.shape[1] - 1
        assert not moved[lying.any(axis=1), start : start + bones].any()
        start += bones
    depth = {each.kind: each.value for each in followed.figures}
    before = {each.kind: each.value for each in plain.figures}
    print("walk", before, depth)
    for kind in ("SLIP", "DRIFT"):
        # Between frames an arm that lets go may be elsewhere.
        assert depth[kind] < 1.05 * before[kind] + 1e-6
    assert depth["DEPTH"] < before["DEPTH"] + 0.002


def test_walking_anew_follows_anew(octopus: Any) -> None:
    bpy.ops.octo_motion.setup_load(name="swim")
    settings = octopus.octo_motion.locomotion
    settings.travel_on, settings.cycles = "NONE", 1
    both(octopus, [5])
    settings.cycle_time *= 1.5
    generate(octopus)
    slower = tails(octopus, [5, 12])
    settings.body.trail = False
    generate(octopus)
    assert np.abs(slower - tails(octopus, [5, 12])).max() > 0.003
