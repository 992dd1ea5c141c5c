# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference pose: chosen in the table, shown as a figure, and doubts about it told."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.clips import read_clip
from octo_motion.core.rotations import angle_between
from octo_motion.ui.splicing.properties import read_landmarks, splicing_settings
from octo_motion.ui.splicing.reference_figure import figure_lines, is_shown, take_down_all
from tests.ui.rig import click
from tests.ui.splicing.test_splicing import hero_and_source, motion, stack_of


def table(armature: Any) -> Any:
    return splicing_settings(armature).landmarks


def test_the_figure_stands_upright_with_its_left_on_the_left() -> None:
    hero, _ = hero_and_source()
    click("map_skeleton")
    points, colours = figure_lines(read_clip(hero), read_landmarks(table(hero)))
    assert points.shape == (len(colours), 3)
    assert len(points) % 2 == 0
    blue = points[colours[:, 2] > 0.9 * colours.max(axis=1)]
    red = points[(colours[:, 0] > 0.9) & (colours[:, 1] < 0.5)]
    # Facing -Y the left is on +X.
    assert blue[:, 0].max() > 0.1
    assert red[:, 0].min() < -0.1
    assert points[:, 2].min() == pytest.approx(0.0, abs=1e-9)
    assert np.ptp(points[:, 2]) > 0.5
    # The line that shows where it faces.
    assert points[-1][1] < points[-2][1]


def test_one_click_shows_it_and_another_takes_it_away(capfd: pytest.CaptureFixture[str]) -> None:
    hero, _ = hero_and_source()
    click("map_skeleton")
    capfd.readouterr()
    assert click("reference_show") == {"FINISHED"}
    assert is_shown(hero)
    assert capfd.readouterr().out
    assert click("reference_show") == {"FINISHED"}
    assert not is_shown(hero)


def test_no_drawing_is_left_behind() -> None:
    hero, _ = hero_and_source()
    click("reference_show")
    take_down_all()
    assert not is_shown(hero)


def test_without_an_action_there_is_none_to_show() -> None:
    hero, _ = hero_and_source()
    hero.animation_data_clear()
    with pytest.raises(RuntimeError, match="has no action"):
        bpy.ops.octo_motion.reference_show()


def test_a_frame_that_is_asked_for_is_the_one_in_sight() -> None:
    hero, _ = hero_and_source()
    bpy.context.scene.frame_set(5)
    table(hero).reference_pose = "FRAME"
    assert table(hero).reference_frame == 5
    assert read_landmarks(table(hero)).reference == 5.0
    table(hero).reference_pose = "REST"
    assert read_landmarks(table(hero)).reference == "rest"
    table(hero).reference_pose = "FOUND"
    assert read_landmarks(table(hero)).reference == ""


def test_another_reference_pose_is_another_splice_and_back_again_the_first() -> None:
    hero, source = hero_and_source()
    for each in (source, hero):
        bpy.context.view_layer.objects.active = each
        click("map_skeleton")
    click("splice_add", part="LEFT_ARM")
    results = []
    for where in ("FOUND", "FRAME", "FOUND"):
        table(source).reference_pose = where
        click("splice_build")
        results.append(np.stack(list(motion(hero, stack_of(hero).result).values())))
    assert angle_between(results[0], results[1]).max() > 1e-3
    assert angle_between(results[0], results[2]).max() < 1e-6


def test_exchanged_sides_are_told(capfd: pytest.CaptureFixture[str]) -> None:
    hero, _ = hero_and_source()
    click("map_skeleton")
    known = table(hero)
    for part in ("upper_arm", "forearm", "hand", "clavicle"):
        left, right = getattr(known, f"{part}_l"), getattr(known, f"{part}_r")
        setattr(known, f"{part}_l", right)
        setattr(known, f"{part}_r", left)
    capfd.readouterr()
    click("reference_show")
    assert "Arms and legs are on opposite sides: look at Upper Arm" in capfd.readouterr().out
