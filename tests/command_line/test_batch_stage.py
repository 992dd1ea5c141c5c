# SPDX-License-Identifier: GPL-3.0-or-later
"""A shot's ground, changes, reaches and contacts, as they come into the open file."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.command_line.shot_runner import perform
from octo_motion.command_line.shot_schema import ShotRequest
from octo_motion.core.errors import RigError, SettingsError
from tests.blender.test_ground import make_square
from tests.ui.made import prepare
from tests.ui.rig import click, give_route

CUBE = [(x, y, z) for x in (-0.03, 0.03) for y in (-0.03, 0.03) for z in (-0.03, 0.03)]


@pytest.fixture
def octopus() -> Any:
    """An octopus with a route, over a mesh that is not its ground yet."""
    click("add_octopus", with_mesh=False)
    armature: Any = bpy.context.object
    click("detect_arms")
    give_route(armature, ((0.0, 0.0, 0.0), (0.0, -0.6, 0.0), (0.0, -1.2, 0.0), (0.0, -1.8, 0.0)))
    settings = armature.octo_motion.locomotion
    settings.timing, settings.frame_end, settings.tell_overlaps = "RANGE", 60, False
    floor = make_square(8.0)
    floor.name, floor.location.z = "Sea Floor", -0.2
    bpy.context.view_layer.update()
    return armature


def shot(**options: Any) -> ShotRequest:
    return ShotRequest("shot", armature="Octopus", **options)


def test_shot_walks_on_the_object_that_it_names(octopus: Any) -> None:
    perform(shot(ground="Sea Floor"), {})
    settings = octopus.octo_motion.locomotion
    assert settings.ground.object == bpy.data.objects["Sea Floor"]
    standing = prepare(octopus, bpy.context).standing
    assert standing is not None
    assert standing.ground.height(np.zeros(2)) == pytest.approx(-0.2, abs=1e-5)


def test_ground_that_is_not_there_or_no_mesh_is_told(octopus: Any) -> None:
    with pytest.raises(SettingsError, match=r"There is no mesh 'Moon'.*Sea Floor"):
        perform(shot(ground="Moon"), {})
    with pytest.raises(SettingsError, match="'Route' is not a mesh"):
        perform(shot(ground="Route"), {})
    assert octopus.octo_motion.locomotion.ground.object is None


def test_lists_take_the_place_of_those_in_the_file(octopus: Any) -> None:
    settings = octopus.octo_motion.locomotion
    click("contacts_show")
    settings.change.places.add()
    settings.along.add()
    settings.reaches.add()
    arm = settings.arms[2].name
    lists: dict[str, Any] = {
        "changes": [{"gait": "swim", "position": 0.6, "length": 1.0}],
        "along": [{"setting": "PACE", "position": 0.25, "pace": 2.0}],
        "reaches": [{"mode": "CURL", "arm": arm, "frame_start": 5, "frame_contact": 20}],
        "contacts": [
            {"arm": arm, "cycle": 1, "removed": True},
            {"arm": arm, "cycle": 2, "position": [0.2, -0.5, 0.0], "heading": 0.3},
        ],
    }
    perform(shot(**lists), {})
    assert settings.change.by == "MARKERS"
    assert [(each.gait, round(each.position, 3)) for each in settings.change.places] == [
        ("swim", 0.6)
    ]
    assert [(each.mode, each.arm, each.frame_start) for each in settings.reaches] == [
        ("CURL", arm, 5)
    ]
    contacts = settings.ground.contacts
    assert [(each.arm, each.cycle, each.removed, each.locked) for each in contacts] == [
        (arm, 1, True, False),
        (arm, 2, False, True),
    ]
    assert [(each.setting, each.position, each.pace) for each in settings.along] == [
        ("PACE", 0.25, 2.0)
    ]
    perform(shot(changes=[]), {})
    assert len(settings.along) == 1
    assert settings.change.by == "NONE"
    assert len(settings.reaches) == 1


def test_reach_finds_its_object_by_name(octopus: Any) -> None:
    mesh = bpy.data.meshes.new("Ball")
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh.from_pydata(CUBE, [], faces)
    ball = bpy.data.objects.new("Ball", mesh)
    bpy.context.scene.collection.objects.link(ball)
    ball.location = (0.25, -0.1, 0.15)
    bpy.context.view_layer.update()
    reach = {"mode": "TOUCH", "target": "Ball", "frame_start": 2, "frame_contact": 12}
    performed = perform(shot(reaches=[{**reach, "frame_release": 16}]), {})
    assert octopus.octo_motion.locomotion.reaches[0].target == ball
    assert performed.summary.frames == 60
    with pytest.raises(SettingsError, match="There is no object 'Bell'"):
        perform(shot(reaches=[{"target": "Bell"}]), {})


def test_contact_of_an_arm_that_is_not_there_is_told(octopus: Any) -> None:
    first = octopus.octo_motion.locomotion.arms[0].name
    with pytest.raises(RigError, match=f"There is no arm 'Arm 9'.*{first}"):
        perform(shot(contacts=[{"arm": "Arm 9", "cycle": 1}]), {})
