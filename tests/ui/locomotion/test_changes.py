# SPDX-License-Identifier: GPL-3.0-or-later
"""Walk, crawl and swim along one route, as the artist sees it in the scene."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.core.locomotion.path.travel import plan_travel
from octo_motion.ui.locomotion.settings.properties import locomotion_settings
from tests.blender.test_ground import make_mesh
from tests.ui.locomotion.test_quality_report import measured_joints, played_joints
from tests.ui.made import prepare
from tests.ui.rig import click, still

pytestmark = pytest.mark.one_blender

RISING = {"b0": (-2.5, 0, 0), "b1": (-0.5, 0, -0.1), "b2": (-0.2, 0.3, 0.1), "b3": (2.2, 0, 1.6)}
HUMP = {"b0": (-3.0, 0, 0), "b1": (-1.0, 0, 2.2), "b2": (1.0, 0, 2.2), "b3": (3.0, 0, 0)}


@pytest.fixture
def settings() -> Any:
    bpy.ops.octo_motion.add_octopus(with_mesh=False)
    assert bpy.context.object is not None
    found = locomotion_settings(bpy.context.object)
    bpy.ops.octo_motion.detect_arms()
    found.tell_overlaps = False
    return found


def computed(settings: Any) -> Any:
    shot = prepare(settings.id_data, bpy.context)
    for _ in shot.compute():
        pass
    return shot


def steps(rotations: np.ndarray) -> np.ndarray:
    """Degrees (frames − 1, bones) from frame to frame."""
    cosine = np.abs(np.sum(rotations[1:] * rotations[:-1], axis=-1)).clip(0.0, 1.0)
    return np.degrees(2.0 * np.arccos(cosine))


def test_route_that_never_rises_is_walked_all_the_way(settings: Any) -> None:
    bpy.ops.octo_motion.add_route()
    settings.change.by = "HEIGHT"
    shot = computed(settings)
    assert not shot.swimming.any()


def test_route_that_rises_is_walked_and_then_swum_mantle_first(settings: Any) -> None:
    bpy.ops.octo_motion.add_route(**RISING)
    settings.change.by = "HEIGHT"
    assert click("generate_locomotion") == {"FINISHED"}
    shot = computed(settings)
    np.testing.assert_allclose(shot.swimming[[0, -1]], [0.0, 1.0])
    up = np.array(settings.id_data.matrix_world.to_3x3().col[2])
    bpy.context.scene.frame_set(1)
    assert np.array(settings.id_data.matrix_world.col[2])[2] > 0.99
    bpy.context.scene.frame_set(int(shot.frames[-1]) - 10)
    before = np.array(settings.id_data.matrix_world.translation)
    bpy.context.scene.frame_set(int(shot.frames[-1]) - 9)
    travel = np.array(settings.id_data.matrix_world.translation) - before
    up = np.array(settings.id_data.matrix_world.to_3x3().col[2])
    assert up @ travel / np.linalg.norm(travel) > 0.8


@pytest.mark.parametrize(("route", "count"), [(RISING, 1), (HUMP, 2)])
def test_no_arm_jumps_while_the_gait_changes(
    settings: Any, route: dict[str, Any], count: int
) -> None:
    bpy.ops.octo_motion.add_route(**route)
    settings.change.by = "HEIGHT"
    largest = []
    for rate in (24, 48, 96):
        bpy.context.scene.render.fps = rate
        shot = computed(settings)
        assert len(shot.transitions.changes) == count
        distance = plan_travel(shot.route, shot.travel, shot.times).distance[:-1]
        inside = np.any(
            [(each.start < distance) & (distance < each.end) for each in shot.transitions.changes],
            axis=0,
        )
        largest.append(steps(shot.rotations)[inside].max())
    # Half the time, about half the way: a jump would stay.
    assert largest[1] < 0.75 * largest[0]
    assert largest[2] < 0.75 * largest[1]


def test_arms_that_hold_on_do_not_slide_while_the_gait_changes(settings: Any) -> None:
    bpy.ops.octo_motion.add_route(**RISING)
    settings.change.by = "HEIGHT"
    shot = computed(settings)
    (window,), (walk, _) = shot.transitions.windows, shot.plan.segments.walks
    unit = shot.travel.stride / (2.0 * np.pi)
    for each in walk.footholds():
        off = unit * each.lift_off
        if each.touch_down * unit < shot.transitions.changes[0].end:
            assert off <= window.start[each.arm] + 1e-6
    assert shot.late.max() < 1e-3


def test_places_let_each_gait_go_where_the_artist_says(settings: Any) -> None:
    bpy.ops.octo_motion.add_route(**RISING)
    bpy.ops.octo_motion.change_add(gait="swim", position=0.7)
    bpy.ops.octo_motion.change_add(gait="crawl", position=0.25)
    shot = computed(settings)
    length = shot.route.length
    assert [each.middle / length for each in shot.transitions.changes] == pytest.approx([0.25, 0.7])
    names = [shot.plan.segments.gaits[each.way].table.name for each in shot.transitions.changes]
    assert names == ["crawl", "swim"]
    assert click("generate_locomotion") == {"FINISHED"}
    bpy.ops.octo_motion.change_remove()
    assert [item.gait for item in settings.change.places] == ["swim"]


def test_journey_that_comes_back_to_its_first_gait_ends_as_it_began(settings: Any) -> None:
    bpy.ops.octo_motion.add_route(**HUMP)
    settings.change.by = "HEIGHT"
    shot = computed(settings)
    assert [each.way for each in shot.transitions.changes] == [1, 0]
    # The change may begin a little before the route does.
    np.testing.assert_allclose(shot.swimming[[0, -1]], 0.0, atol=0.01)
    assert shot.swimming.max() == 1.0


def test_mantle_is_stretched_out_only_where_it_swims(settings: Any) -> None:
    bpy.ops.octo_motion.add_route(**RISING)
    settings.change.by = "HEIGHT"
    still(settings)
    assert click("generate_locomotion") == {"FINISHED"}
    bone = settings.id_data.pose.bones["mantle"]
    scene = bpy.context.scene
    scene.frame_set(1)
    rest = bone.matrix_basis.copy()
    scene.frame_set(scene.frame_end)
    assert rest.to_quaternion().angle == pytest.approx(0.0, abs=1e-5)
    assert bone.matrix_basis.to_quaternion().angle > 0.05


@pytest.mark.parametrize(
    ("places", "told"),
    [
        ([("swim", 0.5), ("crawl", 0.52)], "Two changes of gait overlap"),
        ([("gone", 0.5)], "There is no gait 'gone'"),
        ([], "there are none"),
    ],
)
def test_senseless_changes_are_refused_and_nothing_is_made(
    settings: Any, places: list[tuple[str, float]], told: str
) -> None:
    bpy.ops.octo_motion.add_route(**RISING)
    settings.change.by = "MARKERS"
    for gait, position in places:
        item = settings.change.places.add()
        item.gait, item.position = gait, position
    with pytest.raises(RuntimeError, match=told):
        bpy.ops.octo_motion.generate_locomotion()
    assert settings.result is None
    assert not bpy.data.actions


def test_unknown_gait_is_not_added_as_a_change(settings: Any) -> None:
    with pytest.raises(RuntimeError, match="There is no gait 'fly'"):
        bpy.ops.octo_motion.change_add(gait="fly")
    assert len(settings.change.places) == 0


def figures_of(shot: Any) -> dict[str, float]:
    return {figure.kind: figure.value for figure in shot.figures}


def bumps() -> Any:
    """Hills of 0.2 metres from valley to top under a route, in faces of some centimetres."""
    steps = np.arange(-6.0, 6.01, 0.08)
    x, y = np.meshgrid(steps, steps, indexing="ij")
    z = 0.1 * np.sin(2.0 * np.pi * x / 1.4) * np.cos(2.0 * np.pi * y / 1.2)
    count = len(steps)
    corner = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    faces = np.stack([corner, corner + count, corner + count + 1, corner + 1], axis=1)
    return make_mesh(np.stack([x, y, z], axis=-1).reshape(-1, 3).tolist(), faces.tolist())


@pytest.mark.parametrize("rough", [False, True])
@pytest.mark.parametrize("between", ["crawl", "swim"])
def test_at_no_change_arms_slide_or_dip_into_the_ground(
    settings: Any, between: str, *, rough: bool
) -> None:
    bpy.ops.octo_motion.add_route()
    bpy.context.view_layer.objects.active = settings.id_data
    bpy.ops.octo_motion.change_add(gait=between, position=0.33)
    bpy.ops.octo_motion.change_add(gait="walk", position=0.66)
    if rough:
        settings.ground.object = bumps()
    made = computed(settings)
    found = figures_of(made)
    assert found["SLIP"] < 0.01
    assert made.depth_of_bones < 0.001
    assert found["DEPTH"] < 0.005


@pytest.mark.parametrize(
    ("setup", "position"), [("walk", 0.27), ("crawl", 0.33), ("hurry", 0.33), ("prowl", 0.33)]
)
def test_arms_that_set_out_for_a_swim_over_bumps_stay_above_them(
    settings: Any, setup: str, position: float
) -> None:
    """Wherever they do; at these places their tips were below by 0.7 to 1 % of an arm, and where a
    body that stalks stops and crouches meanwhile by 2.8 %.
    """
    bpy.ops.octo_motion.setup_load(name=setup)
    settings.tell_overlaps = False
    bpy.ops.octo_motion.add_route()
    bpy.context.view_layer.objects.active = settings.id_data
    bpy.ops.octo_motion.change_add(gait="swim", position=position)
    bpy.ops.octo_motion.change_add(gait=setup, position=position + 0.33)
    settings.ground.object = bumps()
    found = figures_of(computed(settings))
    assert found["DEPTH"] < 0.005
    assert found["SLIP"] < 0.01


def test_what_takes_off_by_height_leaves_the_ground_with_all_arms(settings: Any) -> None:
    """An arm that pushes off does not then swing through the ground."""
    for route in (RISING, HUMP):
        bpy.ops.octo_motion.add_route(**route)
        bpy.context.view_layer.objects.active = settings.id_data
        settings.change.by = "HEIGHT"
        assert computed(settings).depth_of_bones < 0.001


def test_in_a_hurry_arms_that_would_dip_between_frames_are_raised(settings: Any) -> None:
    bpy.ops.octo_motion.add_route()
    bpy.context.view_layer.objects.active = settings.id_data
    bpy.ops.octo_motion.change_add(gait="prowl", position=0.5)
    settings.ground.object = bumps()
    settings.timing, settings.frame_end = "RANGE", 150
    # Holds of two frames, which shorter ones would be, have no keys between which to stand still.
    settings.ground.duty = 0.55
    found = figures_of(computed(settings))
    assert found["SLIP"] < 0.01
    assert found["DEPTH"] < 0.005


@pytest.mark.parametrize("keys", ["DENSE", "REDUCED"])
def test_what_swims_and_then_walks_is_measured_as_blender_plays_it(
    settings: Any, keys: str
) -> None:
    """With its arms stretched where it walks, and half way between frames."""
    bpy.ops.octo_motion.add_route(**RISING)
    armature = bpy.context.view_layer.objects.active = settings.id_data
    settings.gait, settings.keys = "swim", keys
    bpy.ops.octo_motion.change_add(gait="walk", position=0.4)
    settings.timing, settings.frame_end = "RANGE", 180
    shot = computed(settings)
    shot.write()
    measured = shot.measured
    assert measured is not None
    assert measured.halfway is not None
    assert np.abs(measured.poses.strains).max() > 0.05
    chosen = np.arange(100, 178, 6)
    for poses, later in ((measured.poses, 0.0), (measured.halfway, 0.5)):
        seen = measured_joints(measured, poses)[chosen]
        played = played_joints(armature, shot, shot.frames[chosen] + later)
        # The object's Euler angles do not go quite the way of its quaternions.
        np.testing.assert_allclose(seen, played, atol=1e-3 if later else 1e-4)
