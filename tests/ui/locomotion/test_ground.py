# SPDX-License-Identifier: GPL-3.0-or-later
"""Walks that hold the ground, as the artist makes them: settings, markers, what is told."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.scene.contact_markers import markers
from octo_motion.core.errors import GroundError
from octo_motion.core.locomotion.ground.surface import LevelGround
from octo_motion.core.locomotion.metrics import report as quality
from octo_motion.core.locomotion.path.travel import plan_travel
from octo_motion.ui.locomotion.settings import lists as ground_properties
from octo_motion.ui.locomotion.settings.lists import (
    ContactEdit,
    changed_by_hand,
    read_overrides,
    store,
)
from octo_motion.ui.locomotion.settings.properties import locomotion_settings
from tests.blender.test_ground import make_mesh, make_square
from tests.core.grounds import deepest_joint
from tests.ui.made import prepare
from tests.ui.rig import Octopus, click, generate, give_route, joints_in_world, keys

WAY = ((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, -1.6, 0.0), (0.6, -2.0, 0.0))


OCTOPUS = Octopus(
    add_on=True, with_mesh=False, route=WAY, frames=160, settings={"tell_overlaps": False}
)
"""On a route of some four arm lengths. Whether arms keep apart is another matter."""


def ground_of(armature: Any) -> Any:
    return armature.octo_motion.locomotion.ground


def warnings(armature: Any) -> list[str]:
    """What the button warns of."""
    shot = prepare(armature, bpy.context)
    for _ in shot.compute():
        pass
    return list(shot.write().warnings)


def arms_in_world(armature: Any, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joints (frames, arms, joints, 3) as played, which of them must rest, and cycles."""
    shot = prepare(armature, bpy.context)
    standing = shot.standing
    assert standing is not None
    times = np.interp(frames, shot.frames, shot.times)
    travel = plan_travel(shot.route, shot.travel, times, standing.bearings)
    poses = standing.pose(travel, slice(None), standing.place(travel))
    (arms,) = standing.walk.builds
    order = [bone.name for bone in armature.pose.bones]
    numbers = [[order.index(bone) for bone in shot.arms[arm].bones] for arm in arms]
    played = []
    for frame in frames:
        ends = joints_in_world(armature, frame)
        played.append([np.concatenate([ends[own, 0], ends[own[-1:], 1]]) for own in numbers])
    return np.array(played), poses.in_contact[0], poses.cycles[:, list(arms)]


def test_one_click_walks_on_a_plane_and_nothing_slides(octopus: Any) -> None:
    generate(octopus)
    length = prepare(octopus, bpy.context).generator.lengths
    frames = np.arange(20.0, 60.0, 0.5)
    joints, lying, cycles = arms_in_world(octopus, frames)
    # Within a hundredth of the arm between frames, and what single precision leaves at them.
    assert quality.slip(joints, lying, cycles, length).value < 0.01
    assert quality.slip(joints[::2], lying[::2], cycles[::2], length).value < 1e-5
    assert deepest_joint(joints, LevelGround(0.0), float(length[0])) < 0.005
    assert lying.any(axis=-1).sum(axis=1).min() >= 2


@pytest.mark.parametrize("gait", ["walk", "crawl"])
def test_a_walk_ends_where_its_route_ends_with_all_arms_at_rest(octopus: Any, gait: str) -> None:
    settings = octopus.octo_motion.locomotion
    settings.gait = gait
    generate(octopus)
    frames = np.array([1.0, 2.0, 40.0, 41.0, 159.0, 160.0])
    joints, lying, _ = arms_in_world(octopus, frames)
    assert lying[[0, -1]].sum(axis=-1).min() >= 3
    speed = np.linalg.norm(np.diff(joints, axis=0), axis=-1).max(axis=(1, 2))
    assert max(speed[0], speed[-1]) < 0.02 * speed[2]
    bpy.context.scene.frame_set(160)
    np.testing.assert_allclose(octopus.matrix_world.translation[:2], WAY[-1][:2], atol=1e-4)
    # One that walks out of the picture does not stop for it.
    settings.ease_in = settings.ease_out = 0.0
    generate(octopus)
    joints, lying, _ = arms_in_world(octopus, frames)
    assert lying[[0, -1]].sum(axis=-1).min() == 0
    speed = np.linalg.norm(np.diff(joints, axis=0), axis=-1).max(axis=(1, 2))
    assert min(speed[0], speed[-1]) > 0.1 * speed[2]


def test_arms_hold_the_ground_where_a_posed_body_carries_them(octopus: Any) -> None:
    root = octopus.pose.bones["root"]
    root.location, root.rotation_mode = (0.02, 0.03, -0.01), "XYZ"
    root.rotation_euler = (0.15, 0.1, 0.3)
    octopus.octo_motion.locomotion.keep_pose = True
    bpy.context.view_layer.update()
    assert warnings(octopus) == []
    assert tuple(root.location) == pytest.approx((0.02, 0.03, -0.01))
    length = prepare(octopus, bpy.context).generator.lengths
    joints, lying, cycles = arms_in_world(octopus, np.arange(20.0, 60.0, 1.0))
    assert quality.slip(joints, lying, cycles, length).value < 1e-5
    assert deepest_joint(joints, LevelGround(0.0), float(length[0])) < 0.005
    heights = joints[lying][:, 2]
    assert 0.0 < heights.min() < heights.max() < 0.03


def test_a_body_scaled_unequally_cannot_be_reckoned_with_and_is_told(octopus: Any) -> None:
    octopus.pose.bones["root"].scale = (1.0, 0.8, 0.8)
    octopus.octo_motion.locomotion.keep_pose = True
    bpy.context.view_layer.update()
    (told,) = warnings(octopus)
    assert told.startswith("The pose of one bone moves the arms ('root')")


def test_bones_that_stretch_get_keys_and_lose_them_again(octopus: Any) -> None:
    scaled = {path for path, _ in keys(generate(octopus)) if path.endswith(".scale")}
    assert any(path.startswith('pose.bones["arm') for path in scaled)
    ground_of(octopus).stretch = 0.0
    bpy.context.scene.frame_set(30)
    again = {path for path, _ in keys(generate(octopus)) if path.endswith(".scale")}
    # Mantle, siphon and eyes breathe, puff and blink.
    assert not any(path.startswith('pose.bones["arm') for path in again)
    for bone in octopus.pose.bones:
        assert not bone.name.startswith("arm") or tuple(bone.scale) == (1.0, 1.0, 1.0)
    assert warnings(octopus) == []


def test_a_second_click_does_not_warn_of_the_first_ones_stretch(octopus: Any) -> None:
    generate(octopus)
    bpy.context.scene.frame_set(30)
    assert warnings(octopus) == []


def test_few_keys_hold_the_ground_too(octopus: Any) -> None:
    octopus.octo_motion.locomotion.keys = "REDUCED"
    generate(octopus)
    length = prepare(octopus, bpy.context).generator.lengths
    joints, lying, cycles = arms_in_world(octopus, np.arange(20.0, 60.0, 1.0))
    # The tolerance, to either side.
    tolerance = octopus.octo_motion.locomotion.key_distance
    assert quality.slip(joints, lying, cycles, length).value < 2.5 * tolerance


def test_a_mesh_is_walked_on_where_it_is(octopus: Any) -> None:
    ground = make_square(12.0)
    ground.location.z, ground.rotation_euler.x = 0.4, np.radians(20.0)
    ground_of(octopus).object = ground
    bpy.context.view_layer.update()
    generate(octopus)
    plane = LevelGround(0.4, (0.0, float(np.tan(np.radians(20.0)))))
    length = prepare(octopus, bpy.context).generator.lengths
    joints, lying, cycles = arms_in_world(octopus, np.arange(20.0, 60.0, 1.0))
    assert deepest_joint(joints, plane, float(length[0])) < 0.005
    assert quality.slip(joints, lying, cycles, length).value < 1e-5
    assert np.abs(joints[lying][:, 2] - plane.height(joints[lying])).max() < 0.03


def test_the_ground_may_be_left_out(octopus: Any) -> None:
    ground_of(octopus).use = False
    action = generate(octopus)
    scaled = {path for path, _ in keys(action) if path.endswith(".scale")}
    assert not any(path.startswith('pose.bones["arm') for path in scaled)
    assert prepare(octopus, bpy.context).standing is None


def test_a_swim_holds_nothing(octopus: Any) -> None:
    octopus.octo_motion.locomotion.gait = "swim"
    ground_of(octopus).object = make_mesh([(0, 0, 0)], [])
    generate(octopus)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: make_mesh([(0, 0, 0), (1, 0, 0)], []), "The ground 'Ground' has no faces"),
        (lambda: make_square(2.0), r"The route leaves the ground after \d+ % of its length"),
    ],
)
def test_a_ground_that_cannot_be_walked_on_is_told(octopus: Any, make: Any, told: str) -> None:
    ground_of(octopus).object = make()
    with pytest.raises(GroundError, match=told):
        _ = prepare(octopus, bpy.context).plan
    with pytest.raises(RuntimeError, match=told):
        click("generate_locomotion")
    assert octopus.animation_data is None or octopus.animation_data.action is None


def test_a_ground_whose_modifiers_do_not_count_is_told(octopus: Any) -> None:
    ground = make_square(20.0)
    ground_of(octopus).object = ground
    ground.hide_viewport = True
    assert not any("modifiers" in told for told in warnings(octopus))
    ground.modifiers.new("Bumps", "DISPLACE")
    assert any("its modifiers do not count" in told for told in warnings(octopus))


def test_a_route_over_itself_is_warned_of(octopus: Any) -> None:
    stairs = ((0.0, 0.0, 0.0), (9.0, -2.0, 0.2), (-9.0, -2.0, 1.2), (0.2, 0.0, 1.4))
    give_route(octopus, stairs)
    assert any("passes over itself" in told for told in warnings(octopus))


# --- Contacts -------------------------------------------------------------------------------------


def test_markers_show_where_arms_hold_and_change_nothing(octopus: Any) -> None:
    before = keys(generate(octopus))
    click("contacts_show")
    shown = markers(octopus)
    standing = prepare(octopus, bpy.context).standing
    assert standing is not None
    assert len(shown) == len(standing.walk.footholds())
    after = keys(generate(octopus))
    assert all(np.array_equal(after[key], values) for key, values in before.items())
    assert len(ground_of(octopus).contacts) == 0


def middle_marker(octopus: Any) -> Any:
    arm = octopus.octo_motion.locomotion.arms[2].name
    own = [item for item in markers(octopus) if item.octo_motion.contact.arm == arm]
    return own[len(own) // 2]


def test_a_dragged_contact_is_held_there_and_survives_everything(octopus: Any) -> None:
    generate(octopus)
    click("contacts_show")
    marker = middle_marker(octopus)
    place = marker.octo_motion.contact.arm, marker.octo_motion.contact.cycle
    marker.location.x += 0.03
    wanted = np.array(marker.location)
    bpy.context.view_layer.update()
    generate(octopus)
    (item,) = ground_of(octopus).contacts
    assert (item.arm, item.cycle, item.locked) == (*place, True)
    np.testing.assert_allclose(np.array(marker.location)[:2], wanted[:2], atol=1e-6)
    frames = np.arange(np.ceil(marker.octo_motion.contact.frame_on) + 1.0, 160.0)[:4]
    joints, lying, _ = arms_in_world(octopus, frames)
    gap = np.linalg.norm(joints - wanted, axis=-1)[lying].min()
    assert gap < 0.01
    click("contacts_hide")
    assert markers(octopus) == []
    octopus.octo_motion.locomotion.heading_angle = 0.2
    generate(octopus)
    click("contacts_show")
    again = next(
        each
        for each in markers(octopus)
        if (each.octo_motion.contact.arm, each.octo_motion.contact.cycle) == place
    )
    np.testing.assert_allclose(np.array(again.location)[:2], wanted[:2], atol=1e-6)
    click("contacts_clear")
    assert len(ground_of(octopus).contacts) == 0


def test_a_deleted_marker_is_a_contact_less(octopus: Any) -> None:
    click("contacts_show")
    marker = middle_marker(octopus)
    count = len(markers(octopus))
    bpy.data.objects.remove(marker)
    generate(octopus)
    assert len(markers(octopus)) == count - 1
    (item,) = ground_of(octopus).contacts
    assert item.removed
    generate(octopus)
    assert len(markers(octopus)) == count - 1


def test_a_copy_of_an_octopus_with_markers_walks_as_the_octopus_does(octopus: Any) -> None:
    octopus.octo_motion.locomotion.frame_end = 40
    click("contacts_show")
    marker = middle_marker(octopus)
    marker.location.x += 0.03
    bpy.context.view_layer.update()
    before = keys(generate(octopus))
    count = len(markers(octopus))
    copy = octopus.copy()
    bpy.context.scene.collection.objects.link(copy)
    after = keys(generate(copy))
    for key, values in before.items():
        # Where it stood when it was copied is another place than where it was at first.
        np.testing.assert_allclose(after[key], values, atol=1e-4)
    assert not any(item.removed for item in ground_of(copy).contacts)
    assert len(markers(copy)) == len(markers(octopus)) == count


def test_markers_stay_those_of_an_octopus_that_is_renamed(octopus: Any) -> None:
    octopus.octo_motion.locomotion.frame_end = 40
    click("contacts_show")
    count = len(markers(octopus))
    bpy.data.objects.remove(middle_marker(octopus))
    before = keys(generate(octopus))
    octopus.name = "Kraken"
    after = keys(generate(octopus))
    assert all(np.array_equal(after[key], values) for key, values in before.items())
    assert len(ground_of(octopus).contacts) == 1
    assert len(markers(octopus)) == count - 1
    octopus.name = "Leviathan"
    click("contacts_hide")
    assert not [each for each in bpy.data.objects if each.type == "EMPTY"]
    assert not bpy.data.collections


def test_contacts_are_free_even_where_no_markers_can_be_shown_anew(octopus: Any) -> None:
    click("contacts_show")
    bpy.data.objects.remove(middle_marker(octopus))
    octopus.octo_motion.locomotion.route = None
    assert click("contacts_clear") == {"FINISHED"}
    assert len(ground_of(octopus).contacts) == 0
    assert not ground_of(octopus).shown
    assert markers(octopus) == []


def test_a_linked_collection_of_the_same_name_does_not_get_the_markers(
    octopus: Any, tmp_path: Path
) -> None:
    library = str(tmp_path / "library.blend")
    linked = bpy.data.collections.new("Octopus Contacts")
    bpy.data.libraries.write(library, {linked}, fake_user=True)
    bpy.data.collections.remove(linked)
    file: Any = bpy.data.libraries.load(library, link=True)  # the stubs know no context manager
    with file as (_, wanted):
        wanted.collections = ["Octopus Contacts"]
    click("contacts_show")
    (holder,) = markers(octopus)[0].users_collection
    assert holder.library is None


def test_contacts_are_shifted_in_object_mode_alone(octopus: Any) -> None:
    click("contacts_show")
    markers(octopus)[0].select_set(state=True)
    assert bpy.ops.octo_motion.contacts_shift.poll()
    bpy.context.view_layer.objects.active = octopus
    bpy.ops.object.mode_set(mode="EDIT")
    assert not bpy.ops.octo_motion.contacts_shift.poll()


def test_a_contact_can_be_shifted_by_frames(octopus: Any) -> None:
    click("contacts_show")
    marker = middle_marker(octopus)
    before = marker.octo_motion.contact.frame_on
    for each in bpy.context.selected_objects:
        each.select_set(state=False)
    marker.select_set(state=True)
    bpy.context.view_layer.objects.active = marker
    click("contacts_shift", frames=2.0)
    # A marker is active: the button knows whose it is.
    click("generate_locomotion")
    assert marker.octo_motion.contact.frame_on == pytest.approx(before + 2.0, abs=0.3)


def test_meshes_are_offered_as_ground_but_not_the_creatures_own_skin() -> None:
    click("add_octopus")
    armature: Any = bpy.context.object
    skin = next(each for each in armature.children if each.type == "MESH")
    ground = make_square()
    offered = [
        each.name
        for each in (skin, ground, armature)
        if ground_properties.may_be_ground(armature.octo_motion.locomotion.ground, each)
    ]
    assert offered == ["Ground"]


def test_contacts_and_reaches_follow_an_arm_that_is_called_otherwise(octopus: Any) -> None:
    settings = locomotion_settings(octopus)
    click("contacts_show")
    marker = middle_marker(octopus)
    name, cycle = marker.octo_motion.contact.arm, marker.octo_motion.contact.cycle
    marker.location.x += 0.05
    bpy.context.view_layer.update()
    reach = settings.reaches.add()
    reach.arm, reach.mute = name, True
    settings.arms[name].name = "Grabber"
    assert reach.arm == "Grabber"
    wanted = read_overrides(settings.ground, octopus)
    assert set(wanted) == {("Grabber", cycle)}
    assert wanted["Grabber", cycle].position is not None
    # Hidden or shown, the contact stays where it was put.
    click("contacts_hide")
    settings.arms["Grabber"].name = "Other"
    assert set(read_overrides(settings.ground, octopus)) == {("Other", cycle)}
    assert {each.arm for each in settings.ground.contacts} == {"Other"}


def test_a_contact_out_of_reach_is_told_with_its_frame(octopus: Any) -> None:
    click("contacts_show")
    marker = middle_marker(octopus)
    marker.location.x += 2.0
    bpy.context.view_layer.update()
    name = marker.octo_motion.contact.arm
    (told,) = [each for each in warnings(octopus) if "out of reach" in each]
    assert told.startswith(f"'{name}' slides at frame ")
    assert "Drag its marker nearer, raise Stretch" in told


def test_an_override_keeps_contacts_of_its_own_and_lays_down_those_of_its_linked_file(
    octopus: Any, tmp_path: Path
) -> None:
    settings = octopus.octo_motion.locomotion
    arms = [item.name for item in settings.arms]
    frees = [(arms[0], 1), (arms[1], 1)]
    store(settings.ground, {place: ContactEdit(removed=True) for place in frees})
    library = str(tmp_path / "rig.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(library, link=True) as (_, wanted):  # type: ignore[attr-defined]
        wanted.objects = ["Octopus"]
    linked: Any = bpy.data.objects["Octopus"]
    bpy.context.scene.collection.objects.link(linked)
    armature: Any = linked.override_create(remap_local_usages=True)
    armature.override_library.is_system_override = False
    bpy.context.view_layer.objects.active = armature
    give_route(armature, WAY)
    kept = {(arms[0], 1): ContactEdit(shift=0.1), (arms[2], 2): ContactEdit(removed=True)}
    ground = armature.octo_motion.locomotion.ground
    for _ in range(2):
        store(ground, kept)
        generate(armature)
        assert set(read_overrides(ground, armature)) == set(kept)
    assert changed_by_hand(ground) == 2
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    again: Any = next(each for each in bpy.data.objects if each.override_library)
    ground = again.octo_motion.locomotion.ground
    found = read_overrides(ground, again)
    assert {place: (each.removed, round(each.shift, 3)) for place, each in found.items()} == {
        (arms[0], 1): (False, 0.1),
        (arms[2], 2): (True, 0.0),
    }
    bpy.context.view_layer.objects.active = again
    click("contacts_clear")
    assert read_overrides(ground, again) == {}
    assert changed_by_hand(ground) == 0


def test_there_are_no_contacts_to_show_of_a_swim(octopus: Any) -> None:
    octopus.octo_motion.locomotion.gait = "swim"
    with pytest.raises(RuntimeError, match="has no contacts with the ground"):
        click("contacts_show")


def test_the_skin_of_the_default_octopus_stays_out_of_bumpy_ground() -> None:
    """Its bones do, and between two joints it bends: half a hundredth of an arm is left to it."""
    bpy.ops.octo_motion.add_octopus()
    armature = next(each for each in bpy.data.objects if each.type == "ARMATURE")
    bpy.ops.octo_motion.add_route()
    bpy.context.view_layer.objects.active = armature
    settings = locomotion_settings(armature)
    settings.tell_overlaps = False
    shot = prepare(armature, bpy.context)
    reach = shot.generator.arm_length * shot.scale
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=300, y_subdivisions=300, size=24.0 * reach)
    ground: Any = bpy.context.object
    points = np.empty((len(ground.data.vertices), 3), dtype=np.float32)
    ground.data.vertices.foreach_get("co", points.ravel())
    x, y = 2.0 * np.pi * points[:, 0] / 1.4 / reach, 2.0 * np.pi * points[:, 1] / 1.2 / reach
    points[:, 2] = 0.15 * reach * np.sin(x) * np.cos(y)
    ground.data.vertices.foreach_set("co", points.ravel())
    ground.data.update()
    settings.ground.object = ground
    bpy.context.view_layer.objects.active = armature

    shot = prepare(armature, bpy.context)
    for _ in shot.compute():
        pass
    shot.write()

    assert shot.standing is not None
    skin = next(each for each in bpy.data.objects if each.find_armature() == armature)
    deepest = []
    for frame in range(160, 600, 12):
        bpy.context.scene.frame_set(frame)
        seen = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
        mesh: Any = seen.to_mesh()
        places = np.empty((len(mesh.vertices), 3), dtype=np.float32)
        mesh.vertices.foreach_get("co", places.ravel())
        world = np.array(seen.matrix_world)
        seen.to_mesh_clear()
        placed = places.astype(np.float64) @ world[:3, :3].T + world[:3, 3]
        below = (shot.standing.ground.height(placed) - placed[:, 2]) / reach
        deepest.append(float(below.max()))
    assert max(deepest) < 0.005
    # Arms that lie touch it.
    assert min(deepest) > -0.001
