# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings that scripts set: names, defaults, explanations, overrides."""

import json
from collections.abc import Iterator
from typing import Any

import bpy
import pytest

from octo_motion.core.errors import RigError
from octo_motion.core.locomotion.gait.gait_poser import GaitSettings
from octo_motion.core.locomotion.ground.surface import StanceSettings
from octo_motion.core.locomotion.path.travel import TravelSettings
from octo_motion.core.settings import declared_settings
from octo_motion.ui import registration
from octo_motion.ui.declared_settings import plain, read_settings
from octo_motion.ui.locomotion.settings.properties import (
    OCTO_MOTION_PG_locomotion,
    locomotion_settings,
)
from octo_motion.ui.modal_job import Job
from tests.ui.rig import give_route, make_octopus

# What scripts rely on: a name is never changed or removed.
NAMES = {
    *("along", "active_along", "begin_pose", "end_pose"),
    *("arms", "active_arm", "body_front", "body_up", "root_bone", "keep_pose"),
    *("route", "spline", "speed_mode", "slow_in_bends", "ease_in", "ease_out"),
    *("heading", "heading_angle", "keep_upright", "look_ahead", "corner"),
    *("height_mode", "height", "stand", "ground"),
    *("gait", "table", "contraction", "softness", "give", "steady", "sway", "phase_spread"),
    *("turning", "change", "burst", "streamline", "bank_in_turns"),
    *("uneven", "stalk", "variation_min", "variation_max", "seed"),
    *("weight_root", "weight_tip", "use_weight_curve", "weight_curve"),
    *("timing", "cycle_time", "speed", "frame_start", "frame_end"),
    *("travel_on", "extend_scene_range", "keys", "key_angle", "key_distance", "key_columns"),
    *("result", "figures", "live", "live_error", "keep_apart", "tell_overlaps", "show_targets"),
    *("reaches", "active_reach", "cycles", "repeat", "breathing", "breath_time"),
    *("setup", "extended_from", "extended_to", "body"),
}


def groups() -> Iterator[Any]:
    for each in registration.CLASSES:
        if issubclass(each, bpy.types.PropertyGroup):
            yield each


def properties(group: Any) -> Iterator[Any]:
    """What a group of properties defines itself; its own come after those of all groups."""
    found = {each.identifier: each for each in group.bl_rna.properties}
    for each in group.__mro__:
        yield from (found[name] for name in vars(each).get("__annotations__", ()))


def test_the_names_are_those_that_scripts_use() -> None:
    assert {each.identifier for each in properties(OCTO_MOTION_PG_locomotion)} == NAMES


def test_every_setting_explains_itself() -> None:
    for group in groups():
        for definition in properties(group):
            if definition.is_hidden or group.__name__ == "OCTO_MOTION_PG_gait_note":
                continue
            assert definition.name, definition
            assert len(definition.description) > 10, (group, definition.identifier)
            assert not definition.description.endswith("."), definition.identifier


def test_every_setting_can_be_overridden_except_names_of_list_items() -> None:
    for group in groups():
        if group.__name__ == "OCTO_MOTION_PG_device":
            # Of the window manager: it is in no file.
            continue
        for definition in properties(group):
            items = {"ArmItem", "ArmBoneItem", "SpliceItem", "ReachItem", "ChangeItem"} | {
                *("FollowChain", "AlongItem")
            }
            if group.__name__ in items and definition.identifier in {"name", "known_as"}:
                continue
            if definition.identifier == "as_text":
                # What it says is kept in the table's other properties, which can be.
                continue
            assert definition.is_overridable, (group, definition.identifier)


@pytest.mark.parametrize("kind", [GaitSettings, TravelSettings, StanceSettings])
def test_what_core_declares_is_what_the_panel_begins_with(kind: type) -> None:
    settings: Any = locomotion_settings(make_octopus())
    group = settings.ground if kind is StanceSettings else settings
    for name, each in declared_settings(kind).items():
        expected = each.default if each.offered is None else each.offered
        value = getattr(group, each.stored_as or name)
        assert value == (expected if isinstance(expected, str) else pytest.approx(expected)), name


def test_core_reads_what_is_set_and_takes_single_precision_for_what_was_meant() -> None:
    ground = locomotion_settings(make_octopus()).ground
    ground.duty, ground.planted, ground.lift = 0.85, 0.8, 0.25
    read = read_settings(StanceSettings, ground, lean=0.5)
    assert (read.duty, read.planted, read.lift, read.lean) == (0.85, 0.8, 0.25, 0.5)


def test_settings_of_something_else_than_an_armature_are_refused() -> None:
    with pytest.raises(RigError, match="not an armature"):
        locomotion_settings(bpy.data.objects.new("Empty", None))


def test_only_a_curve_can_be_the_route() -> None:
    settings = locomotion_settings(make_octopus())
    empty = bpy.data.objects.new("Empty", None)
    curve = give_route(settings.id_data)
    assert settings.route == curve
    # Scripts may set any object, as Blender lets them; generating says what is wrong with it.
    settings.route = empty
    bpy.context.view_layer.objects.active = settings.id_data
    with pytest.raises(RuntimeError, match="not a curve"):
        bpy.ops.octo_motion.generate_locomotion()


def test_settings_are_plain_data_for_json() -> None:
    armature = make_octopus()
    give_route(armature)
    bpy.ops.octo_motion.detect_arms()
    settings = locomotion_settings(armature)
    settings.gait = "swim"
    data = json.loads(json.dumps(plain(settings)))
    assert set(data) >= NAMES
    assert data["route"] == "Route"
    assert data["result"] is None
    assert data["arms"][0]["bones"][0]["name"] == "Arm1_1.L"
    assert data["table"]["curves"][0]["knots"][1]["head"] == pytest.approx(
        list(settings.table.curves[0].knots[1].head)
    )
    assert "route" not in plain(settings, without=frozenset({"route"}))


def test_the_weight_curve_is_made_when_it_is_switched_on_and_kept_when_off() -> None:
    settings = locomotion_settings(make_octopus())
    settings.weight_root, settings.weight_tip = 0.9, 0.3
    settings.use_weight_curve = True
    group = settings.weight_curve
    assert group is not None
    settings.use_weight_curve = False
    settings.use_weight_curve = True
    assert settings.weight_curve == group


def test_the_weight_curve_moves_the_arms_as_weights_do() -> None:
    from octo_motion.ui.locomotion.reading.motion import gait_settings
    from octo_motion.ui.locomotion.settings import read_gait

    settings = locomotion_settings(make_octopus())
    settings.weight_root, settings.weight_tip = 0.9, 0.3
    straight = gait_settings(settings, read_gait(settings)).weights
    settings.use_weight_curve = True
    drawn = gait_settings(settings, read_gait(settings)).weights
    assert straight == pytest.approx((0.9, 0.3))
    assert len(drawn) == 33
    assert (drawn[0], drawn[16], drawn[-1]) == pytest.approx((0.9, 0.6, 0.3), abs=1e-4)


def test_a_job_works_at_least_a_step_and_stops_when_its_time_is_over() -> None:
    now = 0.0

    def steps() -> Iterator[float]:
        nonlocal now
        for number in range(5):
            now += 1.0
            yield (number + 1) / 5

    job = Job(steps(), clock=lambda: now)
    assert not job.work(0.0)
    assert job.progress == pytest.approx(0.2)
    assert not job.work(2.0)
    assert job.progress == pytest.approx(0.6)
    assert job.work(100.0)
    assert job.progress == 1.0
    assert job.work(0.0)
