# SPDX-License-Identifier: GPL-3.0-or-later
"""Few keys hold what rests on the ground, on frames and between them."""

import math
from typing import Any

import bpy
import pytest

from tests.ui.made import prepare
from tests.ui.rig import click, give_route

pytestmark = pytest.mark.one_blender

WAY = ((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, -1.6, 0.0), (0.6, -2.0, 0.0))
SLIP = 0.006
"""Arm lengths that a foot may slide: a little over half of what the report lets pass."""
DEPTH = 0.004
BUMP, ARM = 0.3, 0.6
"""How high bumps are, in arm lengths, and how many metres these are."""


def bumps(height: float) -> Any:
    """Ground that rises and falls by so many arm lengths."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=160, y_subdivisions=160, size=8.0 * ARM)
    ground: Any = bpy.context.object
    for vertex in ground.data.vertices:
        x, y, _ = vertex.co / ARM
        wave = math.sin(math.tau * x / 1.4) * math.cos(math.tau * y / 1.2)
        vertex.co.z = 0.5 * height * ARM * wave
    ground.data.update()
    return ground


@pytest.mark.parametrize(("gait", "bump"), [("walk", 0.0), ("crawl", 0.0), ("walk", BUMP)])
def test_few_keys_hold_contacts(gait: str, bump: float) -> None:
    click("add_octopus", with_mesh=False)
    armature: Any = bpy.context.object
    click("detect_arms")
    give_route(armature, WAY)
    settings = armature.octo_motion.locomotion
    settings.gait, settings.keys = gait, "REDUCED"
    settings.tell_overlaps = False
    if bump:
        settings.ground.object = bumps(bump)
        bpy.context.view_layer.objects.active = armature
    made = prepare(armature, bpy.context)
    for _ in made.compute():
        pass
    told = {each.kind: each.value for each in made.figures}
    assert told["SLIP"] <= SLIP
    assert made.depth_of_bones <= DEPTH
