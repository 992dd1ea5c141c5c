# SPDX-License-Identifier: GPL-3.0-or-later
"""Joint weights of the octopus as it comes: they move its bends, as it walks and as it swims."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.core.rotations import normalized
from tests.ui.rig import Octopus, click, generate

pytestmark = pytest.mark.one_blender

FRAMES = range(1, 241, 4)


def made(setup: str) -> Any:
    return Octopus(add_on=True, with_mesh=False, setup=setup, route={}, frames=240).make()


def bends(armature: Any) -> np.ndarray:
    """Bends at all joints of all arms but their roots (frames, arms, joints), radians."""
    arms = [[bone.name for bone in arm.bones] for arm in armature.octo_motion.locomotion.arms]
    found = []
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        bones = armature.pose.bones
        ways = np.array([[bones[bone].tail - bones[bone].head for bone in arm] for arm in arms])
        found.append(normalized(ways))
    ways = np.array(found)
    cosines = np.sum(ways[:, :, 1:] * ways[:, :, :-1], axis=-1)
    return np.arccos(np.clip(cosines, -1.0, 1.0))


def centroids(bends: np.ndarray) -> np.ndarray:
    """Number of the joint, 0 at the root, about which each arm's bends lie (arms,)."""
    joints = np.arange(1, bends.shape[-1] + 1)
    return np.sum(bends * joints, axis=(0, 2)) / np.sum(bends, axis=(0, 2))


@pytest.mark.parametrize("setup", ["walk", "swim"])
def test_the_bend_follows_the_weights(setup: str) -> None:
    armature = made(setup)
    settings = armature.octo_motion.locomotion
    lain = {}
    for name, weights in (("root", (1.0, 0.05)), ("tip", (0.05, 1.0))):
        settings.weight_root, settings.weight_tip = weights
        generate(armature)
        lain[name] = centroids(bends(armature)).mean()
        figures = {item.kind: item.value for item in settings.figures}
        assert figures["MISS"] < 1e-3
        assert figures.get("SLIP", 0.0) < 5e-3
    # Of twelve joints. Measured: 1.7 walking, where what lies on the ground is as the ground is,
    # and 2.9 swimming.
    assert lain["tip"] - lain["root"] >= 1.5


def test_one_arm_has_weights_of_its_own() -> None:
    armature = made("swim")
    settings = armature.octo_motion.locomotion
    generate(armature)
    before = centroids(bends(armature))
    arm = settings.arms[2]
    arm.use_weights, arm.weight_root, arm.weight_tip = True, 0.05, 1.0
    generate(armature)
    moved = centroids(bends(armature)) - before
    assert moved[2] > 0.8
    assert np.abs(np.delete(moved, 2)).max() < 0.05
    # Detected again, they are kept.
    click("detect_arms")
    assert settings.arms[2].use_weights
