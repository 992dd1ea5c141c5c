# SPDX-License-Identifier: GPL-3.0-or-later
"""Set-ups that are told apart without their names, by what Blender plays."""

from itertools import pairwise
from typing import Any

import bpy
import numpy as np

from tests.ui.rig import Octopus, generate

OCTOPUS = Octopus(add_on=True, with_mesh=False)


def played(octopus: Any, setup: str, way: float = 4.0) -> dict[str, np.ndarray]:
    """Heads of bones (frames, 3), world, as Blender plays them, and where eyes look."""
    bpy.ops.octo_motion.setup_load(name=setup)
    settings = octopus.octo_motion.locomotion
    settings.keys = "DENSE"
    if settings.travel_on != "NONE":
        along = [(0.0, -share * way, 0.0) for share in (0.0, 0.25, 0.5, 1.0)]
        names = ("b0", "b1", "b2", "b3")
        bpy.ops.octo_motion.add_route(**dict(zip(names, along, strict=True)))
        bpy.context.view_layer.objects.active = octopus
    generate(octopus)
    last = int(octopus.animation_data.action.frame_range[1])
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


def test_prowl_freezes_crouches_looks_to_both_sides_and_goes_on(octopus: Any) -> None:
    found = played(octopus, "prowl", 2.7)
    body, across = found["body"], found["eye.L"] - found["eye.R"]
    speed = np.linalg.norm(np.diff(body[:, :2], axis=0), axis=1)
    still = np.pad(speed < 1e-3 * speed.max(), (0, 1))
    edges = np.flatnonzero(np.diff(still.astype(int)))
    stops = [
        slice(first + 1, last)
        for first, last in pairwise(edges)
        if still[first + 1] and last - first > 24 and last < len(body) - 24
    ]
    assert len(stops) >= 2
    for stop in stops:
        before = body[stop.start - 24, 2]
        print("prowl", before - body[stop, 2].min(), slid(octopus, found, stop))
        # Metres, of arms of 1 m: measured 0.026 and more.
        assert before - body[stop, 2].min() > 0.013
        aside = np.unwrap(np.arctan2(across[:, 1], across[:, 0]))
        looks = np.degrees(aside[stop] - aside[stop.start - 24])
        # Measured 12° and more.
        assert looks.min() < -7.0
        assert looks.max() > 7.0
        # Metres: measured 5e-7.
        assert slid(octopus, found, stop) < 1e-5


def slid(octopus: Any, found: dict[str, np.ndarray], stop: slice) -> float:
    """Metres by which tips move at most that stood while the body came to the stop."""
    tips = np.array([found[arm.bones[-1].name] for arm in octopus.octo_motion.locomotion.arms])
    coming = np.ptp(tips[:, stop.start - 12 : stop.start + 1], axis=1)
    stood = np.linalg.norm(coming, axis=1) < 0.003
    assert stood.sum() >= 2
    return float(np.linalg.norm(np.ptp(tips[stood, stop], axis=1), axis=1).max())


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
