# SPDX-License-Identifier: GPL-3.0-or-later
"""Few keys hold what rests on the ground, on frames and between them."""

from typing import Any

import bpy
import pytest

from tests.ui.rig import click, generate, give_route

WAY = ((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, -1.6, 0.0), (0.6, -2.0, 0.0))
SLIP = 0.006
"""Arm lengths that a foot may slide: a little over half of what the report lets pass."""
DEPTH = 0.004


@pytest.mark.parametrize("gait", ["walk", "crawl"])
def test_few_keys_hold_contacts(gait: str) -> None:
    click("add_octopus", with_mesh=False)
    armature: Any = bpy.context.object
    click("detect_arms")
    give_route(armature, WAY)
    settings = armature.octo_motion.locomotion
    settings.gait, settings.keys = gait, "REDUCED"
    generate(armature)
    told = {each.kind: each.value for each in settings.figures}
    assert told["SLIP"] <= SLIP
    assert told["DEPTH"] <= DEPTH
