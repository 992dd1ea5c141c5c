# SPDX-License-Identifier: GPL-3.0-or-later
"""The pseudo-targets over the viewport lie where the arms' groups end, and follow the settings."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.core.locomotion.motion import GaitTargets, gait_targets
from octo_motion.ui.locomotion import target_overlay
from octo_motion.ui.locomotion.writing import prepare
from tests.ui.rig import ROUTE, Octopus, generate

OCTOPUS = Octopus(route=ROUTE, frames=24, setup="swim_as_published")


def targets_of(armature: Any) -> GaitTargets:
    return gait_targets(prepare(armature, bpy.context, live=True).job)


def ends(armature: Any, targets: GaitTargets, arm: int) -> np.ndarray:
    """Where the three groups of an arm end in the world (3, 3)."""
    bones = armature.pose.bones
    tails = [bones[group[-1]].tail for group in targets.groups[arm]]
    return np.array([armature.matrix_world @ tail for tail in tails])


def links(armature: Any, targets: GaitTargets, arm: int, frame: float) -> np.ndarray:
    """Ends of the links as they are drawn (3, 2, 3)."""
    lines = target_overlay.target_lines(armature, targets, arm, frame)
    return np.array([points[:2] for points, _, width in lines if width == target_overlay._LINK])


@pytest.mark.parametrize("travel", ["OBJECT", "BONE"])
@pytest.mark.parametrize("name", ["swim_as_published", "walk_as_published"])
def test_joints_end_at_the_targets_that_are_drawn(octopus: Any, name: str, travel: str) -> None:
    bpy.ops.octo_motion.setup_load(name=name)
    settings = octopus.octo_motion.locomotion
    bpy.ops.octo_motion.detect_arms()
    settings.travel_on = travel
    generate(octopus)
    targets = targets_of(octopus)
    for frame in (2, 9, 17, 22):
        bpy.context.scene.frame_set(frame)
        for arm in range(4):
            drawn = links(octopus, targets, arm, frame)
            root = octopus.matrix_world @ octopus.pose.bones[targets.groups[arm][0][0]].head
            # Q₀ is the arm's root, and each link begins where the one before ends.
            np.testing.assert_allclose(drawn[0, 0], root, atol=1e-4)
            np.testing.assert_allclose(drawn[1:, 0], drawn[:-1, 1], atol=1e-9)
            np.testing.assert_allclose(drawn[:, 1], ends(octopus, targets, arm), atol=1e-3)


def test_the_drawing_follows_the_table_as_it_is_edited(octopus: Any) -> None:
    before, seen = targets_of(octopus), target_overlay.content_of(octopus)
    octopus.octo_motion.locomotion.active_arm = 2
    assert target_overlay.content_of(octopus) == seen
    octopus.octo_motion.locomotion.table.curves[0].knots[1].head[0] += 0.3
    assert target_overlay.content_of(octopus) != seen
    assert np.abs(targets_of(octopus).places - before.places).max() > 0.05
    seen = target_overlay.content_of(octopus)
    route = octopus.octo_motion.locomotion.route
    route.data.splines[0].bezier_points[0].co.x += 0.5
    assert target_overlay.content_of(octopus) != seen


def test_settings_that_make_no_motion_draw_nothing_and_say_nothing(octopus: Any) -> None:
    name = octopus.name
    target_overlay.find(name, "now")
    assert target_overlay._known[name].targets is not None
    octopus.octo_motion.locomotion.route = None
    target_overlay.find(name, "later")
    assert target_overlay._known[name].targets is None
    target_overlay.find("nobody", "now")
    assert "nobody" not in target_overlay._known


def test_it_is_off_at_first_and_no_setup_switches_it(octopus: Any) -> None:
    settings = octopus.octo_motion.locomotion
    assert not settings.show_targets
    settings.show_targets = True
    bpy.ops.octo_motion.setup_load(name="walk")
    assert settings.show_targets
