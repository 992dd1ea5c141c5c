# SPDX-License-Identifier: GPL-3.0-or-later
"""Set-ups that are told apart without their names, by what Blender plays."""

from typing import Any

import bpy
import numpy as np

from tests.ui.rig import Octopus, generate

OCTOPUS = Octopus(add_on=True, with_mesh=False)


def played(octopus: Any, setup: str, frames: int = 0) -> dict[str, np.ndarray]:
    """Heads of bones (frames, 3), world, as Blender plays them, and where eyes look."""
    bpy.ops.octo_motion.setup_load(name=setup)
    settings = octopus.octo_motion.locomotion
    settings.keys = "DENSE"
    if settings.travel_on != "NONE":
        bpy.ops.octo_motion.add_route(b0=(0, 0, 0), b1=(0, -1, 0), b2=(0, -2, 0), b3=(0, -4, 0))
        bpy.context.view_layer.objects.active = octopus
    generate(octopus)
    last = frames or int(octopus.animation_data.action.frame_range[1])
    names = ["body", "head", "mantle", "eye.L", "eye.R"]
    names += [arm.bones[-1].name for arm in settings.arms]
    found: dict[str, list[Any]] = {each: [] for each in names}
    for frame in range(1, last + 1):
        bpy.context.scene.frame_set(frame)
        evaluated = octopus.evaluated_get(bpy.context.evaluated_depsgraph_get())
        for name in names:
            bone = evaluated.pose.bones[name]
            place = bone.tail if name not in names[:5] else bone.head
            found[name].append(evaluated.matrix_world @ place)
    return {name: np.array(each, dtype=np.float64) for name, each in found.items()}


def test_tiptoe_backs_away_from_where_it_looks_and_its_raised_arms_live(octopus: Any) -> None:
    found = played(octopus, "tiptoe")
    middle = slice(len(found["body"]) // 4, -(len(found["body"]) // 4))
    way = np.diff(found["body"], axis=0)[middle].sum(axis=0)
    # Its mantle is behind its face, and leads.
    mantle = (found["mantle"] - found["head"])[:-1][middle].mean(axis=0)
    flat = np.array([1.0, 1.0, 0.0])
    way, mantle = way * flat / np.linalg.norm(way * flat), mantle * flat / np.linalg.norm(mantle)
    assert way @ mantle / np.linalg.norm(mantle) > 0.95
    raised = [arm.bones[-1].name for arm in octopus.octo_motion.locomotion.arms if arm.pair < 4]
    for name in raised:
        seen = (found[name] - found["body"])[middle]
        assert np.linalg.norm(np.ptp(seen, axis=0)) > 0.1  # m, of arms of 1 m


def test_prowl_goes_stops_and_goes_on(octopus: Any) -> None:
    found = played(octopus, "prowl")
    speed = np.linalg.norm(np.diff(found["body"], axis=0), axis=1)
    inner = speed[len(speed) // 8 : -(len(speed) // 8)]
    stands = inner < 0.25 * inner.max()
    stops = int(np.sum(np.diff(stands.astype(int)) == 1))
    assert stops >= 2
    assert 0.1 < stands.mean() < 0.6


def test_idle_shifts_its_weight_and_its_tips_explore(octopus: Any) -> None:
    found = played(octopus, "idle")
    shifted = np.ptp(found["body"], axis=0)
    assert shifted[:2].max() > 0.01  # m, of arms of 1 m; it was 0
    tips = [
        np.linalg.norm(np.ptp(found[arm.bones[-1].name], axis=0))
        for arm in octopus.octo_motion.locomotion.arms
    ]
    assert np.median(tips) > 0.1
    for each in found.values():
        np.testing.assert_allclose(each[0], each[-1], atol=1e-4)


def test_the_next_set_up_looks_where_it_goes(octopus: Any) -> None:
    settings = octopus.octo_motion.locomotion
    for name, angle in (("tiptoe", np.pi), ("walk", 0.0)):
        bpy.ops.octo_motion.setup_load(name=name)
        assert abs(settings.heading_angle - angle) < 1e-5
    settings.heading_angle = 0.5
    bpy.ops.octo_motion.setup_load(name="hurry")
    assert abs(settings.heading_angle - 0.5) < 1e-5
