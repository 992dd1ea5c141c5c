# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose panels the tab shows while something else than an armature is at hand."""

from pathlib import Path
from typing import Any

import bpy
import pytest

from octo_motion.ui.locomotion import panels
from octo_motion.ui.locomotion.operators import setups
from octo_motion.ui.locomotion.settings.properties import locomotion_settings
from octo_motion.ui.panel_base import armature_in
from octo_motion.ui.splicing.properties import PROPERTIES
from tests.ui.rig import click, give_route, make_octopus


def activate(item: Any) -> None:
    """Click an object: it is selected, and nothing else."""
    for each in bpy.context.view_layer.objects:
        each.select_set(state=each == item)
    bpy.context.view_layer.objects.active = item


def test_who_edits_a_route_works_on_the_armature_that_goes_along_it() -> None:
    armature = make_octopus()
    activate(give_route(armature))
    assert armature_in(bpy.context) == armature
    assert panels.OCTO_MOTION_PT_generate.poll(bpy.context)
    assert click("generate_locomotion") == {"FINISHED"}
    assert locomotion_settings(armature).result is not None
    # Also while the points of the route are dragged.
    bpy.ops.object.mode_set(mode="EDIT")
    assert armature_in(bpy.context) == armature


def test_who_shapes_the_ground_works_on_the_armature_that_walks_on_it() -> None:
    armature = make_octopus()
    give_route(armature)
    bpy.ops.mesh.primitive_plane_add(size=20.0)
    ground = bpy.context.object
    assert armature_in(bpy.context) is None
    locomotion_settings(armature).ground.object = ground
    assert armature_in(bpy.context) == armature
    assert click("generate_locomotion") == {"FINISHED"}
    assert locomotion_settings(armature).result is not None


def test_of_several_on_one_route_the_selected_one_is_meant() -> None:
    first, second = make_octopus("First"), make_octopus("Second")
    route = give_route(first)
    locomotion_settings(second).route = route
    for meant in (first, second):
        activate(route)
        meant.select_set(state=True)
        assert armature_in(bpy.context) == meant
    activate(route)
    assert armature_in(bpy.context) in {first, second}


def test_a_curve_that_nobody_follows_belongs_to_nobody() -> None:
    armature = make_octopus()
    route = give_route(armature)
    locomotion_settings(armature).route = None
    activate(route)
    assert armature_in(bpy.context) is None
    assert not panels.OCTO_MOTION_PT_generate.poll(bpy.context)


def test_one_more_route_leaves_the_armature_on_its_own() -> None:
    armature = make_octopus()
    route = give_route(armature)
    activate(route)
    assert click("add_route") == {"FINISHED"}
    assert locomotion_settings(armature).route == route


@pytest.mark.parametrize("at_hand", ["route", "marker"])
def test_a_setup_is_loaded_and_kept_while_a_route_or_a_contact_is_at_hand(at_hand: str) -> None:
    armature = make_octopus()
    route = give_route(armature)
    settings = locomotion_settings(armature)
    assert click("contacts_show") == {"FINISHED"}
    marker = next(each for each in bpy.data.objects if each.type == "EMPTY")
    item = route if at_hand == "route" else marker
    activate(item)
    assert click("setup_load", name="tiptoe") == {"FINISHED"}
    assert settings.gait == "tiptoe"
    assert click("setup_add", name="Mine") == {"FINISHED"}
    try:
        click("setup_load", name="walk")
        # Changes of gait may have taken the markers away.
        assert click("setup_load", name="Mine") == {"FINISHED"}
        assert settings.gait == "tiptoe"
    finally:
        setups.setup_paths()["Mine"].unlink()


def test_landmarks_are_kept_while_the_route_of_the_rig_is_at_hand() -> None:
    armature = make_octopus()
    activate(give_route(armature))
    setattr(armature.octo_motion.splicing.landmarks, PROPERTIES["hips"], "Root")
    try:
        assert bpy.ops.octo_motion.landmark_preset_add(name="Mine") == {"FINISHED"}
        (folder,) = bpy.utils.preset_paths("octo_motion/landmarks")
        kept = (Path(folder) / "Mine.py").read_text(encoding="utf-8")
        assert f"landmarks.{PROPERTIES['hips']} = 'Root'" in kept
    finally:
        bpy.ops.octo_motion.landmark_preset_add(name="Mine", remove_name=True)
