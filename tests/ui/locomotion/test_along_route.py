# SPDX-License-Identifier: GPL-3.0-or-later
"""Pace, lift, hold, lean and height as values at places of the route, as Blender plays them."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.ui.locomotion.settings import locomotion_settings
from tests.blender.test_ground import make_mesh
from tests.ui.locomotion.test_changes import steps
from tests.ui.made import prepare
from tests.ui.rig import click, generate, keys, still

pytestmark = pytest.mark.one_blender

STRAIGHT = {"b0": (0, 0, 0), "b1": (0, -2, 0), "b2": (0, -4, 0), "b3": (0, -6, 0)}
LENGTH = 6.0
ARM = 0.6
"""Metres that its arms are long."""
FIRST, LAST = 0.3, 0.6
"""Places of two values, as shares of the route."""
SLOPE = 0.25


@pytest.fixture
def settings() -> Any:
    """Of an octopus that goes straight on for six metres."""
    bpy.ops.octo_motion.add_octopus(with_mesh=False)
    assert bpy.context.object is not None
    found: Any = locomotion_settings(bpy.context.object)
    bpy.ops.octo_motion.detect_arms()
    click("add_route", **STRAIGHT)
    bpy.context.view_layer.objects.active = found.id_data
    still(found)
    return found


def along(settings: Any, setting: str, *values: tuple[float, float]) -> None:
    """Let a setting have values at places."""
    for place, value in values:
        click("along_add", setting=setting, position=place)
        setattr(settings.along[-1], setting.lower(), value)


def played(settings: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The motion as Blender plays it: shares of the route that the body has come, its places
    (frames, 3), its uprights (frames, 3), and joints of all arms (frames, arms, joints, 3).
    """
    armature: Any = settings.id_data
    action = generate(armature)
    joints, places, uprights = [], [], []
    for frame in range(int(action.frame_start), int(action.frame_end) + 1):
        bpy.context.scene.frame_set(frame)
        seen = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        world, bones = np.array(seen.matrix_world), seen.pose.bones
        arms = [[bone.name for bone in item.bones] for item in settings.arms]
        tails = np.array([[bones[name].tail for name in arm] for arm in arms])
        joints.append(tails @ world[:3, :3].T + world[:3, 3])
        places.append(world[:3, 3])
        uprights.append(world[:3, 2])
    whole = np.array(places)
    return -whole[:, 1] / LENGTH, whole, np.array(uprights), np.array(joints)


def before(share: np.ndarray) -> np.ndarray:
    """Where the first value holds, and the body goes at full speed."""
    return (share > 0.15) & (share < FIRST)


def after(share: np.ndarray) -> np.ndarray:
    """Where the last one does."""
    return (share > LAST) & (share < 0.85)


def test_pace_is_what_its_places_say_and_rises_from_one_to_the_next(settings: Any) -> None:
    along(settings, "PACE", (FIRST, 1.0), (LAST, 2.5))
    share, places, _, _ = played(settings)
    speed = -np.diff(places[:, 1]) * bpy.context.scene.render.fps
    share = 0.5 * (share[1:] + share[:-1])
    slow = speed[before(share)]
    # At full speed a cycle takes the time that is set.
    full = settings.table.stride * ARM / settings.cycle_time
    np.testing.assert_allclose(slow, slow.mean(), rtol=1e-3)
    np.testing.assert_allclose(speed[after(share)], 2.5 * slow.mean(), rtol=1e-3)
    assert slow.mean() == pytest.approx(full, rel=0.05)
    between = speed[(share > FIRST) & (share < LAST)]
    assert np.all(np.diff(between) > -1e-4)
    # As smoothly as a body of some mass: the steepest is 15/8 of the mean slope over the way.
    gained = np.diff(between) / np.diff(share[(share > FIRST) & (share < LAST)])
    assert gained.max() < 2.0 * 1.5 * slow.mean() / (LAST - FIRST)


def test_pace_leaves_feet_where_they_stand(settings: Any) -> None:
    walk = prepare(settings.id_data, bpy.context).plan.segments.walks[0]
    along(settings, "PACE", (0.2, 0.5), (0.5, 2.0), (0.8, 1.0))
    paced = prepare(settings.id_data, bpy.context).plan.segments.walks[0]
    assert walk is not None
    assert paced is not None
    for one, other in zip(walk.footholds(), paced.footholds(), strict=True):
        np.testing.assert_allclose(one.position, other.position, atol=1e-9)


@pytest.mark.parametrize("kind", ["SPEED", "CADENCE", "RANGE"])
def test_timing_keeps_its_word_where_the_pace_differs(settings: Any, kind: str) -> None:
    settings.timing, settings.speed, settings.cycle_time = kind, 0.5, 2.0
    settings.frame_end = 200
    even = prepare(settings.id_data, bpy.context).plan.schedule.seconds
    along(settings, "PACE", (0.5, 2.0))
    paced = prepare(settings.id_data, bpy.context).plan.schedule.seconds
    assert paced == pytest.approx(even if kind == "RANGE" else 0.5 * even, rel=1e-6)


def highest(joints: np.ndarray, chosen: np.ndarray) -> float:
    """How many arm lengths high arms swing with their outer half, in the mean."""
    outer = joints[chosen][:, :, joints.shape[2] // 2 :, 2].min(axis=2)
    return float(outer.max(axis=0).mean()) / ARM


def test_arms_are_lifted_as_high_as_the_places_say(settings: Any) -> None:
    along(settings, "LIFT", (FIRST, 0.06), (LAST, 0.3))
    share, _, _, joints = played(settings)
    middle = (share > 0.4) & (share < 0.5)
    low, half, high = (highest(joints, each) for each in (before(share), middle, after(share)))
    # Measured: 0.09, 0.19 and 0.32 arm lengths.
    assert low < 0.13
    assert low + 0.04 < half < high - 0.04
    assert high > 0.29


def test_arms_hold_on_for_as_long_as_the_places_say(settings: Any) -> None:
    along(settings, "HOLD", (FIRST, 0.6), (LAST, 0.35))
    share, _, _, joints = played(settings)
    # What holds on rests: its tip, or the joint where it touches first.
    outer = joints[:, :, joints.shape[2] // 2 :]
    moved = np.linalg.norm(np.diff(outer, axis=0), axis=-1).min(axis=2)
    resting = moved < 2e-4
    share = share[1:]
    long, short = resting[before(share)].mean(), resting[after(share)].mean()
    assert long == pytest.approx(0.6, abs=0.06)
    assert short == pytest.approx(0.35, abs=0.06)
    between = resting[(share > 0.35) & (share < 0.55)].mean()
    assert short + 0.05 < between < long - 0.05


def test_body_leans_and_rises_as_the_places_say(settings: Any) -> None:
    drop = 12.0 * np.tan(SLOPE)
    corners = [(-12, -12, drop), (12, -12, drop), (-12, 12, -drop), (12, 12, -drop)]
    settings.ground.object = make_mesh(corners, [(0, 1, 3, 2)], "Slope")
    along(settings, "LEAN", (FIRST, 0.0), (LAST, 1.0))
    along(settings, "HEIGHT", (FIRST, 0.0), (LAST, 0.15))
    share, places, uprights, _ = played(settings)
    tilt = np.arctan2(uprights[:, 1], uprights[:, 2])
    np.testing.assert_allclose(tilt[share < FIRST], 0.0, atol=1e-4)
    np.testing.assert_allclose(tilt[share > LAST], SLOPE, atol=2e-3)
    there = int(np.abs(share - 0.45).argmin())
    assert tilt[there] == pytest.approx(0.5 * SLOPE, abs=0.02)
    assert np.all(np.diff(tilt) > -1e-4)
    # Above the ground, along the body's own up.
    above = (places[:, 2] + np.tan(SLOPE) * places[:, 1]) * uprights[:, 2]
    low, high = above[before(share)].mean(), above[after(share)].mean()
    # A body that leans also has its centre before its origin's place.
    assert high - low == pytest.approx(0.15 * ARM, abs=0.01)
    assert low < above[there] < high


def test_a_swim_rises_and_hurries_along_its_route(settings: Any) -> None:
    bpy.ops.octo_motion.setup_load(name="swim")
    still(settings)
    _, even, _, _ = played(settings)
    along(settings, "HEIGHT", (FIRST, 0.0), (LAST, 0.4))
    along(settings, "PACE", (0.5, 2.0))
    _, raised, _, _ = played(settings)
    height = even[:, 2].mean()
    assert raised[0, 2] == pytest.approx(height, abs=1e-3)
    assert raised[-1, 2] == pytest.approx(height + 0.4 * ARM, abs=1e-3)
    assert len(raised) == pytest.approx(0.5 * len(even), abs=2)


EVERYTHING = {
    "PACE": (1.0, 2.0),
    "LIFT": (0.06, 0.2),
    "HOLD": (0.55, 0.45),
    "LEAN": (0.2, 1.0),
    "HEIGHT": (0.0, 0.1),
}


@pytest.mark.parametrize("setup", ["walk", "crawl"])
def test_nothing_pops_and_feet_hold_while_all_settings_change(settings: Any, setup: str) -> None:
    bpy.ops.octo_motion.setup_load(name=setup)
    for setting, (low, high) in EVERYTHING.items():
        along(settings, setting, (FIRST, low), (LAST, high))
    largest = []
    for rate in (24, 48, 96):
        bpy.context.scene.render.fps = rate
        made = prepare(settings.id_data, bpy.context)
        for _ in made.compute():
            pass
        largest.append(steps(made.rotations).max())
        figures = {each.kind: each.value for each in made.figures}
        assert figures["SLIP"] < 0.005
        assert figures["DEPTH"] < 0.01
        assert figures["MISS"] < 1e-3
    assert largest[0] < 30.0
    assert largest[1] < 0.65 * largest[0]
    assert largest[2] < 0.65 * largest[1]


def test_arms_that_hold_on_for_long_make_way_without_a_jump(settings: Any) -> None:
    """Held for so long they lie across each other: some cannot part, and move as they did."""
    bpy.ops.octo_motion.setup_load(name="walk")
    for setting, (low, high) in (EVERYTHING | {"HOLD": (0.55, 0.65)}).items():
        along(settings, setting, (FIRST, low), (LAST, high))
    largest = []
    for rate in (48, 96):
        bpy.context.scene.render.fps = rate
        made = prepare(settings.id_data, bpy.context)
        for _ in made.compute():
            pass
        largest.append(steps(made.rotations).max())
    # Measured 13.0° and 6.7°, as without keeping apart; as many degrees were allowed in a 96th of a
    # second as in a 24th, and it was 20.1° and 19.1°.
    assert largest[0] < 17.0
    assert largest[1] < 0.65 * largest[0]


def test_settings_change_while_the_gait_does(settings: Any) -> None:
    click("change_add", gait="swim", position=0.45)
    for setting, (low, high) in EVERYTHING.items():
        along(settings, setting, (FIRST, low), (LAST, high))
    largest = []
    for rate in (24, 48):
        bpy.context.scene.render.fps = rate
        made = prepare(settings.id_data, bpy.context)
        for _ in made.compute():
            pass
        largest.append(steps(made.rotations).max())
        assert made.late.max() < 1e-3
    assert largest[1] < 0.65 * largest[0]


def test_without_values_the_keys_are_those_that_they_were(settings: Any) -> None:
    plain = keys(generate(settings.id_data))
    click("along_add", setting="LIFT", position=0.5)
    settings.along[0].lift = 0.3
    lifted = keys(generate(settings.id_data))
    assert any(np.any(lifted[each] != plain[each]) for each in plain)
    click("along_remove")
    again = keys(generate(settings.id_data))
    assert again.keys() == plain.keys()
    assert all(np.array_equal(again[each], plain[each]) for each in plain)


@pytest.mark.parametrize("setting", ["LIFT", "HOLD", "LEAN"])
def test_a_value_that_is_the_settings_own_changes_nothing(settings: Any, setting: str) -> None:
    plain = keys(generate(settings.id_data))
    click("along_add", setting=setting, position=0.5)
    again = keys(generate(settings.id_data))
    assert all(np.array_equal(again[each], plain[each]) for each in plain)


def test_in_place_there_is_no_route_and_no_value_along_it(settings: Any) -> None:
    settings.travel_on = "NONE"
    plain = keys(generate(settings.id_data))
    along(settings, "PACE", (0.5, 3.0))
    along(settings, "LIFT", (0.5, 0.5))
    again = keys(generate(settings.id_data))
    assert all(np.array_equal(again[each], plain[each]) for each in plain)


def test_values_are_added_and_removed_with_undo_and_no_set_up_takes_them(settings: Any) -> None:
    name = settings.id_data.name
    bpy.ops.ed.undo_push(message="Start")
    click("along_add", setting="LIFT", position=0.5)
    click("along_add", setting="LIFT", position=0.5)
    bpy.ops.ed.undo()
    settings = bpy.data.objects[name].octo_motion.locomotion
    assert len(settings.along) == 1
    bpy.ops.ed.redo()
    settings = bpy.data.objects[name].octo_motion.locomotion
    bpy.ops.octo_motion.setup_load(name="hurry")
    # A second one at one place finds a place of its own.
    found = [(item.name, item.setting, round(item.position, 3)) for item in settings.along]
    assert found == [("Value", "LIFT", 0.5), ("Value.001", "LIFT", 0.25)]
    click("along_remove")
    assert [item.name for item in settings.along] == ["Value"]


def test_two_values_at_one_place_are_refused(settings: Any) -> None:
    along(settings, "PACE", (0.2, 1.0), (0.6, 2.0))
    settings.along[1].position = settings.along[0].position
    with pytest.raises(RuntimeError, match="at one place"):
        bpy.ops.octo_motion.generate_locomotion()
    assert settings.result is None
