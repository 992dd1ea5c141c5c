# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose action is it: ours is made anew in place, an artist's work is never touched."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation import actions
from octo_motion.core.errors import RigError, WriteError
from octo_motion.core.keyframes.channels import Channel

BONES = ("Arm", "Tip", "Eye")


def make_armature(name: str = "Rig") -> bpy.types.Object:
    armature = bpy.data.armatures.new(name)
    obj = bpy.data.objects.new(name, armature)
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in BONES:
        armature.edit_bones.new(bone).tail = (0.0, 1.0, 0.0)
    bpy.ops.object.mode_set(mode="OBJECT")
    return obj


def animation(obj: bpy.types.Object) -> bpy.types.AnimData:
    data = obj.animation_data_create()
    assert data is not None
    return data


def assigned(obj: bpy.types.Object) -> bpy.types.Action:
    action = animation(obj).action
    assert action is not None
    return action


def pose_bone(obj: bpy.types.Object, name: str) -> bpy.types.PoseBone:
    assert obj.pose is not None
    return obj.pose.bones[name]


def generate(
    obj: bpy.types.Object,
    previous: bpy.types.Action | None = None,
    *,
    height: float = 1.0,
    count: int = 10,
    bones: tuple[str, ...] = ("Arm", "Tip"),
    automatic: bool = True,
) -> bpy.types.Action:
    """A walk whose height tells which one it is."""
    turns = np.zeros((count, len(bones), 4))
    turns[..., 0] = 1.0
    channels = [
        Channel("location", np.tile([0.0, 0.0, height], (count, 1)), "Object Transforms"),
        *actions.read_channels(obj, bones).rotations(bones, turns),
    ]
    frames = np.arange(1.0, count + 1.0)
    return actions.write_action(
        obj, "Walk", frames, channels, previous=previous, automatic=automatic
    )


def height_at(obj: bpy.types.Object, frame: int) -> float:
    bpy.context.scene.frame_set(frame)
    return obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).location.z


def channelbag(action: bpy.types.Action) -> bpy.types.ActionChannelbag:
    (layer,) = action.layers
    (strip,) = layer.strips
    assert isinstance(strip, bpy.types.ActionKeyframeStrip)
    return strip.channelbags[0]


def curve(action: bpy.types.Action, index: int = 2, path: str = "location") -> bpy.types.FCurve:
    found = channelbag(action).fcurves.find(path, index=index)
    assert found is not None
    return found


def everything(item: Any) -> dict[str, object]:
    """All that an action holds and where, but for its place in memory."""
    result: dict[str, object] = {}
    for definition in item.bl_rna.properties:
        name = definition.identifier
        value = getattr(item, name)
        if name in ("rna_type", "original", "id_root", "slot", "group", "action_slot"):
            continue
        if definition.type == "COLLECTION":
            owned = name in (
                "slots", "layers", "strips", "channelbags", "fcurves", "groups", "keyframe_points",
                "modifiers", "pose_markers",
            )  # fmt: skip
            result[name] = [everything(each) for each in value] if owned else len(value)
        elif definition.type == "POINTER":
            result[name] = None if value is None else str(getattr(value, "name", ""))
        else:
            result[name] = tuple(value) if getattr(definition, "is_array", False) else value
    if isinstance(item, bpy.types.ID):
        groups = {key: item[key] for key in item.keys()}  # noqa: SIM118 - Blender's, no dictionary
        result["custom"] = {
            key: value.to_dict() if hasattr(value, "to_dict") else value
            for key, value in groups.items()
        }
    return result


def idle(obj: bpy.types.Object, name: str = "Idle") -> bpy.types.Action:
    """An action that an artist has made."""
    action = bpy.data.actions.new(name)
    slot = action.slots.new("OBJECT", obj.name)
    action.layers.new("Layer").strips.new(type="KEYFRAME").channelbag(slot, ensure=True)
    keys = channelbag(action).fcurves.new("location", index=0).keyframe_points
    keys.insert(1.0, 2.0)
    keys.insert(20.0, 5.0)
    data = animation(obj)
    data.action, data.action_slot = action, slot
    return action


# Making anew in place


def test_generating_again_fills_the_same_action() -> None:
    obj = make_armature()
    first = generate(obj)
    slot = first.slots[0].handle
    second = generate(obj, first, height=2.0, count=15)
    assert second == first
    assert [action.name for action in bpy.data.actions] == ["Walk"]
    assert [each.handle for each in second.slots] == [slot]
    assert animation(obj).action_slot_handle == slot
    assert (second.frame_start, second.frame_end) == (1.0, 15.0)
    assert height_at(obj, 15) == 2.0
    assert not actions.is_edited(second)


def test_curves_and_groups_that_are_no_longer_wanted_go() -> None:
    obj = make_armature()
    first = generate(obj, bones=("Arm", "Tip"))
    generate(obj, first, bones=("Eye", "Arm"))
    bag = channelbag(first)
    assert {group.name for group in bag.groups} == {"Object Transforms", "Arm", "Eye"}
    assert {each.data_path for each in bag.fcurves} == {
        "location",
        'pose.bones["Arm"].rotation_quaternion',
        'pose.bones["Eye"].rotation_quaternion',
    }
    assert {len(each.keyframe_points) for each in bag.fcurves} == {10}


def test_name_fake_user_and_other_references_stay() -> None:
    obj = make_armature()
    first = generate(obj)
    first.name = "My favourite walk"
    first.use_fake_user = True
    bpy.context.scene["export this"] = first
    users = first.users
    second = generate(obj, first, height=3.0)
    assert second.name == "My favourite walk"
    assert bpy.context.scene["export this"] == second
    assert (second.users, second.use_fake_user) == (users, True)


@pytest.mark.parametrize(
    "look",
    [
        lambda action: setattr(curve(action), "select", True),
        lambda action: setattr(curve(action), "hide", True),
        lambda action: setattr(curve(action), "color_mode", "CUSTOM"),
        lambda action: setattr(channelbag(action).groups[1], "show_expanded", True),
        lambda action: setattr(curve(action).keyframe_points[3], "select_control_point", True),
        lambda action: setattr(action, "name", "Other"),
        lambda action: setattr(action.slots[0], "name_display", "Other"),
    ],
)
def test_looking_at_an_action_or_naming_it_is_no_edit(
    look: Callable[[bpy.types.Action], None],
) -> None:
    obj = make_armature()
    first = generate(obj)
    look(first)
    assert not actions.is_edited(first)
    assert generate(obj, first, height=2.0) == first


def test_colours_and_selection_outlive_generating_again() -> None:
    obj = make_armature()
    first = generate(obj)
    curve(first).color_mode = "CUSTOM"
    curve(first).hide = True
    channelbag(first).groups["Arm"].show_expanded = True
    generate(obj, first, count=20)
    assert (curve(first).color_mode, curve(first).hide) == ("CUSTOM", True)
    assert channelbag(first).groups["Arm"].show_expanded


def test_own_action_comes_back_when_another_is_assigned_meanwhile() -> None:
    obj = make_armature()
    first = generate(obj)
    first.use_fake_user = True
    other = idle(obj)
    assert generate(obj, first, height=2.0) == first
    assert assigned(obj) == first
    assert other.use_fake_user


def test_slot_that_the_artist_unassigned_is_assigned_again() -> None:
    obj = make_armature()
    first = generate(obj)
    animation(obj).action_slot = None
    generate(obj, first)
    assert animation(obj).action_slot == first.slots[0]


def test_renamed_slot_is_found_again() -> None:
    obj = make_armature()
    first = generate(obj)
    first.slots[0].name_display = "Octopus"
    idle(obj)
    assert generate(obj, first, height=2.0) == first
    assert animation(obj).action_slot == first.slots[0]
    assert height_at(obj, 5) == 2.0


def test_renamed_object_keeps_its_action() -> None:
    obj = make_armature()
    first = generate(obj)
    obj.name = "Kraken"
    assert generate(obj, first, height=2.0) == first
    assert first[actions.MARK]["owner"] == "Kraken"


# Edits are kept

EDITS: dict[str, Callable[[bpy.types.Action], object]] = {
    "key moved up": lambda action: setattr(curve(action).keyframe_points[3].co, "y", 1.001),
    "key moved in time": lambda action: setattr(curve(action).keyframe_points[3].co, "x", 4.5),
    "key deleted": lambda action: curve(action).keyframe_points.remove(
        curve(action).keyframe_points[3]
    ),
    "key inserted": lambda action: curve(action).keyframe_points.insert(4.5, 1.0),
    "interpolation": lambda action: setattr(
        curve(action).keyframe_points[3], "interpolation", "CONSTANT"
    ),
    "handle": lambda action: setattr(curve(action).keyframe_points[3], "handle_right_type", "FREE"),
    "first handle": lambda action: setattr(
        curve(action).keyframe_points[0], "handle_left_type", "VECTOR"
    ),
    "key type": lambda action: setattr(curve(action).keyframe_points[3], "type", "EXTREME"),
    "modifier": lambda action: curve(action).modifiers.new("NOISE"),
    "extrapolation": lambda action: setattr(curve(action), "extrapolation", "LINEAR"),
    "curve muted": lambda action: setattr(curve(action), "mute", True),
    "curve locked": lambda action: setattr(curve(action), "lock", True),
    "curve deleted": lambda action: channelbag(action).fcurves.remove(curve(action)),
    "all curves deleted": lambda action: channelbag(action).fcurves.clear(),
    "curve added": lambda action: channelbag(action).fcurves.new("scale", index=0),
    "curve for another bone": lambda action: setattr(
        curve(action), "data_path", 'pose.bones["Eye"].location'
    ),
    "marker": lambda action: action.pose_markers.new("contact"),
    "frame range": lambda action: setattr(action, "frame_end", 8.0),
    "no frame range": lambda action: setattr(action, "use_frame_range", False),
    "cyclic": lambda action: setattr(action, "use_cyclic", True),
    "slot added": lambda action: action.slots.new("OBJECT", "Camera"),
    "layer deleted": lambda action: action.layers.remove(action.layers[0]),
    "mark removed": lambda action: action.pop(actions.MARK),
    "mark of another version": lambda action: action[actions.MARK].update({"version": 0}),
}


@pytest.mark.parametrize("edit", EDITS.values(), ids=EDITS.keys())
def test_edited_action_is_kept_and_a_new_one_made(
    edit: Callable[[bpy.types.Action], object],
) -> None:
    obj = make_armature()
    first = generate(obj)
    edit(first)
    assert actions.is_edited(first)
    first.use_fake_user = True
    before = everything(first)
    second = generate(obj, first, height=2.0)
    assert second != first
    assert everything(first) | {"users": 0} == before | {"users": 0}
    assert assigned(obj) == second
    assert not actions.is_edited(second)
    assert height_at(obj, 5) == 2.0
    # From then on the new one is made anew, the edited one stays.
    assert generate(obj, second, height=3.0) == second
    assert everything(first) | {"users": 0} == before | {"users": 0}


def test_linear_keys_made_bezier_are_an_edit_and_their_handles_are_none() -> None:
    obj = make_armature()
    first = generate(obj, automatic=False)
    curve(first).keyframe_points[3].handle_left_type = "FREE"
    assert not actions.is_edited(first)
    curve(first).keyframe_points[3].interpolation = "BEZIER"
    assert actions.is_edited(first)


def test_a_motion_may_be_made_anew_with_the_other_kind_of_keys() -> None:
    obj = make_armature()
    first = generate(obj, automatic=False)
    for automatic in (True, False, True):
        assert generate(obj, first, automatic=automatic) == first
        assert not actions.is_edited(first)
        kind = "BEZIER" if automatic else "LINEAR"
        assert {key.interpolation for key in curve(first).keyframe_points} == {kind}


def test_eye_keyed_by_the_artist_in_the_same_action_is_kept() -> None:
    obj = make_armature()
    first = generate(obj)
    eye = pose_bone(obj, "Eye")
    eye.location = (0.0, 0.5, 0.0)
    assert eye.keyframe_insert("location", frame=5)
    second = generate(obj, first)
    assert second != first
    path = 'pose.bones["Eye"].location'
    kept = curve(first, 1, path).keyframe_points
    assert [(key.co.x, key.co.y) for key in kept] == [(5.0, 0.5)]
    assert first.use_fake_user


def test_action_whose_layer_is_gone_is_kept_even_if_it_had_no_keys() -> None:
    obj = make_armature()
    first = actions.write_action(obj, "Walk", np.ones(1), [], previous=None)
    assert not actions.is_edited(first)
    first.layers.remove(first.layers[0])
    assert generate(obj, first) != first


def test_an_edit_taken_back_is_no_edit() -> None:
    obj = make_armature()
    first = generate(obj)
    key = curve(first).keyframe_points[3]
    key.co.y = 7.0
    assert actions.is_edited(first)
    key.co.y = 1.0
    assert not actions.is_edited(first)


def test_edited_survives_saving_and_so_does_unedited(tmp_path: Path) -> None:
    obj = make_armature()
    first = generate(obj)
    edited = generate(obj)
    curve(edited).keyframe_points[3].co.y = 7.0
    assert (first.name, edited.name) == ("Walk", "Walk.001")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert not actions.is_edited(bpy.data.actions["Walk"])
    assert actions.is_edited(bpy.data.actions["Walk.001"])
    obj = bpy.data.objects["Rig"]
    first = bpy.data.actions["Walk"]
    assert generate(obj, first, height=4.0) == first
    assert height_at(obj, 5) == 4.0


# The actions of others


def test_action_of_the_artist_is_not_touched_but_saved_from_purging() -> None:
    obj = make_armature()
    action = idle(obj)
    before = everything(action)
    made = generate(obj, action)
    assert made != action
    assert action.use_fake_user
    changed = {"use_fake_user", "users"}
    after = everything(action)
    assert {key: after[key] for key in after.keys() - changed} == {
        key: before[key] for key in before.keys() - changed
    }
    assert not actions.is_generated(action)


def test_action_of_the_artist_that_others_use_gets_no_fake_user() -> None:
    obj, other = make_armature(), make_armature("Other")
    action = idle(obj)
    animation(other).action = action
    generate(obj)
    assert not action.use_fake_user
    assert assigned(other) == action


def nla_strip(action: bpy.types.Action, user: bpy.types.Object) -> bpy.types.NlaStrip:
    strip = animation(user).nla_tracks.new().strips.new("Walk", 1, action)
    strip.action_slot = action.slots[0]
    return strip


def use_in_own_nla(action: bpy.types.Action, obj: bpy.types.Object) -> None:
    nla_strip(action, obj)


def use_in_own_meta_strip(action: bpy.types.Action, obj: bpy.types.Object) -> None:
    strip = nla_strip(action, obj)
    strip.select = True
    window = bpy.context.window_manager.windows[0]
    area = window.screen.areas[0]
    area.type = "NLA_EDITOR"
    with bpy.context.temp_override(window=window, area=area, region=area.regions[-1]):
        bpy.ops.nla.meta_add()
    (meta,) = animation(obj).nla_tracks[0].strips
    assert meta.type == "META"


def use_in_other_nla(action: bpy.types.Action, _obj: bpy.types.Object) -> None:
    nla_strip(action, make_armature("Other"))


def use_on_other_object(action: bpy.types.Action, _obj: bpy.types.Object) -> None:
    data = animation(make_armature("Other"))
    data.action, data.action_slot = action, action.slots[0]


def use_in_other_bones_constraint(action: bpy.types.Action, _obj: bpy.types.Object) -> None:
    pose_bone(make_armature("Other"), "Eye").constraints.new("ACTION").action = action


def use_in_own_constraint(action: bpy.types.Action, obj: bpy.types.Object) -> None:
    obj.constraints.new("ACTION").action = action


def use_as_asset(action: bpy.types.Action, _obj: bpy.types.Object) -> None:
    action.asset_mark()


@pytest.mark.parametrize(
    "use",
    [
        use_in_own_nla,
        use_in_own_meta_strip,
        use_in_other_nla,
        use_on_other_object,
        use_in_other_bones_constraint,
        use_in_own_constraint,
        use_as_asset,
    ],
)
def test_action_that_something_else_uses_is_kept(
    use: Callable[[bpy.types.Action, bpy.types.Object], None],
) -> None:
    obj = make_armature()
    first = generate(obj)
    use(first, obj)
    before = everything(first)
    second = generate(obj, first, height=2.0)
    assert second != first
    assert everything(first) | {"users": 0} == before | {"users": 0}


def test_action_of_another_object_is_not_taken_over() -> None:
    one, two = make_armature("One"), make_armature("Two")
    first = generate(one)
    animation(one).action = None
    first.use_fake_user = True
    before = everything(first)
    second = generate(two, first, height=2.0)
    # Nor if the artist has handed it over.
    animation(two).action = first
    third = generate(two, first, height=3.0)
    assert len({first.name, second.name, third.name}) == 3
    assert everything(first) == before


# Two octopuses


def duplicate(obj: bpy.types.Object, *, linked_actions: bool) -> bpy.types.Object:
    bpy.context.preferences.edit.use_duplicate_action = not linked_actions
    bpy.ops.object.select_all(action="DESELECT")
    obj.select_set(state=True)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.duplicate()
    twin = bpy.context.view_layer.objects.active
    assert twin != obj
    return twin


@pytest.mark.parametrize("linked_actions", [False, True])
@pytest.mark.parametrize("remembered", ["original", "assigned"])
def test_twin_never_overwrites_the_action_of_its_twin(
    *, linked_actions: bool, remembered: str
) -> None:
    obj = make_armature()
    first = generate(obj)
    twin = duplicate(obj, linked_actions=linked_actions)
    before = everything(first)
    previous = first if remembered == "original" else assigned(twin)
    second = generate(twin, previous, height=2.0)
    assert second != first
    assert everything(first) | {"users": 0} == before | {"users": 0}
    assert (height_at(obj, 5), height_at(twin, 5)) == (1.0, 2.0)
    # Each has its own from now on.
    assert generate(twin, second, height=3.0) == second
    assert generate(obj, first, height=4.0) == first
    assert (height_at(obj, 5), height_at(twin, 5)) == (4.0, 3.0)


def test_copy_that_came_with_its_twin_is_made_anew_in_place() -> None:
    obj = make_armature()
    generate(obj)
    twin = duplicate(obj, linked_actions=False)
    copy = assigned(twin)
    assert generate(twin, copy, height=2.0) == copy
    assert len(bpy.data.actions) == 2


def test_twin_does_not_take_an_action_that_its_twin_has_put_aside() -> None:
    obj = make_armature()
    first = generate(obj)
    twin = duplicate(obj, linked_actions=True)
    animation(twin).action = None
    idle(obj)
    first.use_fake_user = True
    before = everything(first)
    assert generate(twin, first, height=2.0) != first
    assert everything(first) == before


def test_two_objects_have_their_own_actions() -> None:
    one, two = make_armature("One"), make_armature("Two")
    first, second = generate(one, height=1.0), generate(two, height=2.0)
    assert first != second
    assert generate(one, first, height=3.0) == first
    assert (height_at(one, 5), height_at(two, 5)) == (3.0, 2.0)


# Read-only rigs


def refused(obj: bpy.types.Object, match: str) -> None:
    actions_before = {action.name for action in bpy.data.actions}
    with pytest.raises(WriteError, match=match) as caught:
        actions.writable_armature(obj)
    assert caught.value.remedy
    with pytest.raises(WriteError, match=match):
        generate(obj)
    assert {action.name for action in bpy.data.actions} == actions_before


def test_nla_tweak_mode_is_refused_and_left_alone() -> None:
    obj = make_armature()
    first = generate(obj)
    strip = nla_strip(first, obj)
    data = animation(obj)
    data.action = None
    data.nla_tracks[0].select = True
    strip.select = True
    data.use_tweak_mode = True
    before = everything(first)
    refused(obj, "'Rig' is in the tweak mode of the NLA editor")
    assert everything(first) == before
    assert data.use_tweak_mode
    data.use_tweak_mode = False
    assert generate(obj, first) != first


def test_what_is_no_armature_is_refused() -> None:
    empty = bpy.data.objects.new("Empty", None)
    with pytest.raises(RigError, match="'Empty' is not an armature"):
        actions.writable_armature(empty)


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """A file with a rig in a collection; the rig has an action of its own."""
    obj = make_armature()
    idle(obj)
    collection = bpy.data.collections.new("Character")
    bpy.context.scene.collection.children.link(collection)
    bpy.context.scene.collection.objects.unlink(obj)
    collection.objects.link(obj)
    path = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return path


def link(library: Path, kind: str, name: str) -> Any:
    with bpy.data.libraries.load(  # pyright: ignore[reportGeneralTypeIssues]
        str(library), link=True
    ) as (_, wanted):
        setattr(wanted, kind, [name])
    (linked,) = getattr(wanted, kind)
    return linked


def linked_collection(library: Path) -> bpy.types.Collection:
    collection = link(library, "collections", "Character")
    bpy.context.scene.collection.children.link(collection)
    return collection


def reopened(path: Path) -> bpy.types.Object:
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return local_rig()


def local_rig() -> bpy.types.Object:
    (obj,) = (each for each in bpy.data.objects if each.type == "ARMATURE" and not each.library)
    return obj


def override(library: Path, *, editable: bool) -> bpy.types.Object:
    collection = linked_collection(library)
    collection.override_hierarchy_create(
        bpy.context.scene, bpy.context.view_layer, do_fully_editable=editable
    )
    return local_rig()


def test_linked_rig_is_refused_with_the_way_out(library: Path) -> None:
    (obj,) = linked_collection(library).objects
    refused(obj, "'Rig' is linked from 'library.blend' and is read-only here. Make a library over")


def test_rig_in_a_linked_scene_is_refused_with_the_way_out(library: Path) -> None:
    link(library, "scenes", "Scene")
    refused(bpy.data.objects["Rig"], "Link its collection into a scene of this file")


def test_override_that_is_not_editable_is_refused_until_it_is_made_so(library: Path) -> None:
    obj = override(library, editable=False)
    refused(obj, "'Rig' is a library override that is not editable. Make it editable")
    # What the message tells the artist to do.
    bpy.context.view_layer.objects.active = obj
    obj.select_set(state=True)
    bpy.ops.object.make_override_library()
    actions.writable_armature(obj)


def test_editable_override_is_animated_and_keeps_it_in_its_file(
    library: Path, tmp_path: Path
) -> None:
    obj = override(library, editable=True)
    linked = assigned(obj)
    assert linked.library is not None
    before = everything(linked)
    actions.writable_armature(obj)
    made = generate(obj, linked, height=2.0)
    assert made.library is None
    assert everything(linked) | {"users": 0} == before | {"users": 0}
    obj = reopened(tmp_path / "shot.blend")
    assert height_at(obj, 5) == 2.0
    made = assigned(obj)
    assert not actions.is_edited(made)
    # Again and again, also after the library has changed.
    assert generate(obj, made, height=3.0) == made
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(library))
    bpy.data.objects["Rig"].location.x = 9.0
    bpy.data.collections["Character"].objects.link(bpy.data.objects.new("Hat", None))
    bpy.ops.wm.save_as_mainfile(filepath=str(library))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    obj = reopened(tmp_path / "shot.blend")
    assert obj.override_library is not None
    assert height_at(obj, 5) == 3.0
    made = assigned(obj)
    assert generate(obj, made, height=4.0) == made
    assert height_at(obj, 5) == 4.0


def test_override_of_a_rig_without_animation_keeps_its_action(
    library: Path, tmp_path: Path
) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(library))
    bpy.data.objects["Rig"].animation_data_clear()
    bpy.ops.wm.save_as_mainfile(filepath=str(library))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    generate(override(library, editable=True), height=2.0)
    obj = reopened(tmp_path / "shot.blend")
    assert (assigned(obj).name, height_at(obj, 5)) == ("Walk", 2.0)


def test_two_overrides_of_one_rig_are_animated_apart(library: Path, tmp_path: Path) -> None:
    one = override(library, editable=True)
    collection = next(each for each in bpy.data.collections if each.library is not None)
    collection.override_hierarchy_create(
        bpy.context.scene, bpy.context.view_layer, do_fully_editable=True
    )
    (two,) = (each for each in bpy.data.objects if not each.library and each.pose and each != one)
    names = one.name, two.name
    first, second = generate(one, height=1.0), generate(two, height=2.0)
    assert first != second
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    one, two = (
        next(each for each in bpy.data.objects if each.name == name and not each.library)
        for name in names
    )
    assert (height_at(one, 5), height_at(two, 5)) == (1.0, 2.0)
    previous = assigned(one)
    assert generate(one, previous, height=3.0) == previous
    assert (height_at(one, 5), height_at(two, 5)) == (3.0, 2.0)


def test_local_object_with_linked_armature_data_is_animated(library: Path, tmp_path: Path) -> None:
    obj = link(library, "objects", "Rig").copy()
    bpy.context.scene.collection.objects.link(obj)
    assert obj.data.library is not None
    actions.writable_armature(obj)
    generate(obj, height=2.0)
    obj = reopened(tmp_path / "shot.blend")
    assert height_at(obj, 5) == 2.0


def test_generated_action_that_is_linked_is_not_written_to(library: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(library))
    generate(bpy.data.objects["Rig"])
    bpy.ops.wm.save_as_mainfile(filepath=str(library))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    obj = override(library, editable=True)
    linked = assigned(obj)
    assert actions.is_generated(linked)
    before = everything(linked)
    made = generate(obj, linked, height=2.0)
    assert made != linked
    assert everything(linked) | {"users": 0} == before | {"users": 0}


def test_generated_action_that_is_linked_alone_is_not_written_to(library: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(library))
    generate(bpy.data.objects["Rig"])
    bpy.ops.wm.save_as_mainfile(filepath=str(library))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    obj = make_armature()
    linked = link(library, "actions", "Walk")
    animation(obj).action = linked
    before = everything(linked)
    made = generate(obj, linked, height=2.0)
    assert made.library is None
    assert everything(linked) | {"users": 0} == before | {"users": 0}
    assert height_at(obj, 5) == 2.0


# Undo


def state() -> dict[str, object]:
    """All actions, and who has them assigned."""
    return {
        "actions": {action.name: everything(action) for action in bpy.data.actions},
        "assigned": {
            obj.name: (repr(obj.animation_data.action), obj.animation_data.action_slot_handle)
            for obj in bpy.data.objects
            if obj.animation_data is not None
        },
    }


def step(message: str) -> dict[str, object]:
    """A step that can be undone, as an operator ends with."""
    bpy.ops.ed.undo_push(message=message)
    return state()


def test_undo_takes_back_a_new_action_and_redo_brings_it_again() -> None:
    obj = make_armature()
    idle(obj)
    before = step("before")
    generate(obj)
    after = step("generate")
    assert after != before
    bpy.ops.ed.undo()
    assert state() == before
    bpy.ops.ed.redo()
    assert state() == after


def test_undo_brings_the_previous_keys_back() -> None:
    generate(make_armature())
    before = step("first")
    obj = bpy.data.objects["Rig"]
    generate(obj, assigned(obj), height=2.0, count=30, bones=("Eye",))
    after = step("second")
    assert after != before
    bpy.ops.ed.undo()
    assert state() == before
    obj = bpy.data.objects["Rig"]
    assert not actions.is_edited(assigned(obj))
    assert height_at(obj, 5) == 1.0
    bpy.ops.ed.redo()
    assert state() == after


def test_undo_of_an_edit_makes_the_action_ours_again() -> None:
    generate(make_armature())
    step("generate")
    curve(bpy.data.actions["Walk"]).keyframe_points[3].co.y = 7.0
    step("edit")
    assert actions.is_edited(bpy.data.actions["Walk"])
    bpy.ops.ed.undo()
    assert not actions.is_edited(bpy.data.actions["Walk"])
