# SPDX-License-Identifier: GPL-3.0-or-later
"""A hurry: few frames to a cycle. What is held stays, and what the eye cannot follow is told."""

import re
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.core.locomotion.motion import planning
from tests.ui.locomotion.test_quality_report import WAY, bumpy
from tests.ui.made import Made, prepare
from tests.ui.rig import Octopus, joints_in_world

TOLD = "frames for a swing and jumps from pose to pose"


OCTOPUS = Octopus(
    add_on=True, with_mesh=False, route=WAY, frames=45, settings={"tell_overlaps": False}
)
"""On a route of some four arm lengths."""


def computed(armature: Any) -> Made:
    shot = prepare(armature, bpy.context)
    for _ in shot.compute():
        pass
    return shot


def told(armature: Any) -> str:
    """What is said of the pace."""
    return "".join(each for each in prepare(armature, bpy.context).warnings if TOLD in each)


@pytest.mark.parametrize("keys", ["DENSE", "REDUCED"])
def test_in_a_hurry_over_bumps_arms_hold_on_and_stay_off_the_ground_between_frames(
    octopus: Any, keys: str
) -> None:
    settings = octopus.octo_motion.locomotion
    settings.keys, settings.ground.object = keys, bumpy()
    shot = computed(octopus)
    assert shot.cycle < 10.0  # frames
    found = {figure.kind: figure.value for figure in shot.figures}
    assert found["SLIP"] < 0.01
    assert shot.depth_of_bones < 0.005

    # And that is what Blender plays.
    shot.write()
    names = [bone.name for bone in octopus.pose.bones]
    chosen = [names.index(name) for arm in shot.arms for name in arm.bones]
    assert shot.standing is not None
    deepest = 0.0
    for frame in range(15, 30):
        tails = joints_in_world(octopus, frame + 0.5)[chosen, 1]
        below = shot.standing.ground.height(tails) - tails[:, 2]
        deepest = max(deepest, below.max() / (shot.generator.arm_length * shot.scale))
    assert deepest < 0.005


def test_in_a_hurry_keys_on_every_frame_are_the_motion_as_it_was_computed(octopus: Any) -> None:
    shot = computed(octopus)
    assert shot.rotations is not None
    shot.write()
    names = [name for arm in shot.arms for name in arm.bones]
    for frame in (5, 20, 44):
        bpy.context.scene.frame_set(frame)
        played = np.array([octopus.pose.bones[name].rotation_quaternion[:] for name in names])
        cosines = np.abs(np.sum(played * shot.rotations[frame - 1], axis=-1))
        np.testing.assert_allclose(cosines, 1.0, atol=1e-6)


def test_at_the_pace_of_a_walk_keys_lead_on_by_themselves(octopus: Any) -> None:
    octopus.octo_motion.locomotion.timing = "CADENCE"  # 2 seconds to a cycle
    shot = prepare(octopus, bpy.context)
    assert not shot.plan.subframe_sampled
    assert shot.every == 1
    assert told(octopus) == ""


def test_what_is_dragged_in_a_long_hurry_need_not_wait_for_that(
    octopus: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert prepare(octopus, bpy.context, live=True).plan.subframe_sampled
    monkeypatch.setattr(planning, "_QUICKLY", 1_000)
    assert not prepare(octopus, bpy.context, live=True).plan.subframe_sampled
    assert prepare(octopus, bpy.context).plan.subframe_sampled


@pytest.mark.parametrize(
    ("timing", "setting", "value", "remedy"),
    [
        ("RANGE", "frame_end", 45, r"Let it end at frame ([\d,]+) or later"),
        ("SPEED", "speed", 4.0, r"Lower Speed to ([\d.]+) m/s"),
        ("CADENCE", "cycle_time", 0.3, r"Raise Cycle to ([\d.]+) s"),
    ],
)
def test_too_few_frames_for_a_swing_are_told_with_what_would_do(
    octopus: Any, timing: str, setting: str, value: float, remedy: str
) -> None:
    settings = octopus.octo_motion.locomotion
    settings.timing = timing
    setattr(settings, setting, value)
    found = re.search(remedy, told(octopus))
    assert found is not None
    enough = type(value)(found[1].replace(",", ""))
    setattr(settings, setting, enough)
    assert told(octopus) == ""
    # No more than it takes.
    setattr(settings, setting, type(value)(enough + 0.1 * (value - enough)))
    assert told(octopus) != ""


def test_a_swim_has_no_swings_to_tell_of(octopus: Any) -> None:
    octopus.octo_motion.locomotion.gait = "swim"
    assert told(octopus) == ""
