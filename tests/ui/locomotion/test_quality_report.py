# SPDX-License-Identifier: GPL-3.0-or-later
"""The quality report, as the artist has it: figures after generating, and a button to each."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import blf
import bpy
import numpy as np
import pytest

from octo_motion.core.locomotion.metrics import report as quality
from octo_motion.core.locomotion.metrics.report import KINDS, Figure, Measured
from octo_motion.core.locomotion.rig import turns_in_world
from octo_motion.core.locomotion.rig.poses import Poses
from octo_motion.core.rotations import angle_between, rotate
from octo_motion.ui.locomotion.operators import quality as quality_operators
from octo_motion.ui.locomotion.settings import properties as quality_report
from octo_motion.ui.locomotion.writing import shot as shots
from tests.blender.test_ground import make_mesh
from tests.ui.made import Made, prepare
from tests.ui.rig import Octopus, click, generate, give_route, joints_in_world, make_octopus

WAY = ((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, -1.6, 0.0), (0.6, -2.0, 0.0))
OF_ARM = 0.01
"""The most that a foot may slip, in arm lengths."""


OCTOPUS = Octopus(add_on=True, with_mesh=False, route=WAY, frames=80)
"""On a route of some four arm lengths: a hurry."""


@pytest.fixture
def small() -> Any:
    """An octopus of four arms that swims, which is soon done."""
    armature = make_octopus()
    give_route(armature)
    settings = armature.octo_motion.locomotion
    settings.timing, settings.frame_start, settings.frame_end = "RANGE", 5, 30
    settings.gait = "swim"
    return armature


def figures(armature: Any) -> dict[str, Any]:
    """What is known, by kind."""
    return {
        item.kind: item for item in quality_report.known_figures(armature.octo_motion.locomotion)
    }


def bumpy() -> Any:
    """Hills of a tenth of a metre from valley to top, in faces of a few centimetres."""
    steps = np.arange(-3.0, 3.01, 0.06)
    x, y = np.meshgrid(steps, steps, indexing="ij")
    z = 0.05 * np.sin(2.0 * np.pi * x / 0.6) * np.cos(2.0 * np.pi * y / 0.5)
    count = len(steps)
    corner = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    faces = np.stack([corner, corner + count, corner + count + 1, corner + 1], axis=1)
    return make_mesh(np.stack([x, y, z], axis=-1).reshape(-1, 3).tolist(), faces.tolist())


def test_a_walk_on_a_plane_has_all_figures_and_keeps_to_its_limits(octopus: Any) -> None:
    octopus.octo_motion.locomotion.frame_end = 200  # at the pace of a walk
    generate(octopus)
    found = figures(octopus)
    assert tuple(found) == KINDS
    assert found["SLIP"].value < OF_ARM
    assert found["DRIFT"].value < OF_ARM
    assert found["DEPTH"].value < 0.005
    assert 0.01 < found["STRAIN"].value <= 0.4  # it stretches, and no more than it may
    assert found["MISS"].value < 1e-3
    assert 0.0 < found["TURN"].value < np.radians(90.0)
    arms = {arm.name for arm in octopus.octo_motion.locomotion.arms}
    for kind in ("SLIP", "DRIFT", "STRAIN", "TURN"):
        assert found[kind].arm in arms
        assert 1 <= found[kind].frame <= 200


def test_the_figure_of_the_turn_is_what_blender_plays(octopus: Any) -> None:
    generate(octopus)
    figure = figures(octopus)["TURN"]
    bones = [bone.name for arm in octopus.octo_motion.locomotion.arms for bone in arm.bones]
    poses = []
    for frame in range(1, 81):
        bpy.context.scene.frame_set(frame)
        world = octopus.matrix_world
        poses.append([(world @ octopus.pose.bones[name].matrix).to_quaternion() for name in bones])
    turned = angle_between(np.array(poses[:-1]), np.array(poses[1:]))
    played = quality.change(turned, np.arange(1.0, 81.0))
    # Blender keeps matrices in single precision.
    assert played.value == pytest.approx(figure.value, abs=1e-4)
    assert played.sample + 1 == figure.frame


@pytest.mark.one_blender
def test_the_figure_of_the_depth_is_what_blender_plays_between_frames(octopus: Any) -> None:
    """With few keys that may be far off an arm dives below the ground between two frames."""
    settings = octopus.octo_motion.locomotion
    settings.ground.object = bumpy()
    settings.keys, settings.key_angle, settings.key_distance = "REDUCED", np.radians(8.0), 0.08
    generate(octopus)
    figure = figures(octopus)["DEPTH"]
    assert figure.value > 0.0
    shot = prepare(octopus, bpy.context)
    assert shot.standing is not None
    number = [arm.name for arm in shot.arms].index(figure.arm)
    names = [bone.name for bone in octopus.pose.bones]
    chosen = [names.index(name) for name in shot.arms[number].bones]
    deepest = 0.0
    for later in (0.0, 0.5):
        tails = joints_in_world(octopus, figure.frame + later)[chosen, 1]
        below = shot.standing.ground.height(tails) - tails[:, 2]
        below += shot.standing.radii[number][1:]
        deepest = max(deepest, below.max() / shot.generator.lengths[number])
    # The object's Euler angles do not go quite the way of its quaternions.
    assert deepest == pytest.approx(figure.value, abs=1e-3)


@pytest.mark.parametrize("halves", [False, True])
def test_the_figure_of_the_turn_is_that_of_what_is_keyed(octopus: Any, *, halves: bool) -> None:
    octopus.octo_motion.locomotion.steady = 0.0
    shot = prepare(octopus, bpy.context)
    shot.on_frames_alone = not halves
    for _ in shot.compute():
        pass

    measured = shot.result.measured

    assert measured is not None
    assert (shot.every == 2) == halves
    poses = measured.poses
    turns = turns_in_world(measured.arms, poses.rotations, poses.orientations)
    # What keys make of a motion that is worked out between frames turns otherwise.
    assert (measured.turning is None) == halves
    if measured.turning is not None:
        # Of small angles the arc cosine keeps half the digits.
        np.testing.assert_allclose(measured.turning, turns, atol=1e-6)
    (turn,) = [each for each in shot.result.figures if each.kind == "TURN"]
    assert turn.value == pytest.approx(turns.max(), rel=1e-9)


def test_a_swim_has_no_slip(small: Any) -> None:
    generate(small)
    assert set(figures(small)) == {"MISS", "TURN", "OVERLAP"}
    small.octo_motion.locomotion.tell_overlaps = False
    generate(small)
    assert set(figures(small)) == {"MISS", "TURN"}


def test_misses_of_a_gait_have_their_frame(small: Any) -> None:
    # So few bones cannot take every shape that the gait asks for, with all its corners.
    small.octo_motion.locomotion.steady = small.octo_motion.locomotion.uneven = 0.0
    shot = prepare(small, bpy.context)
    for _ in shot.compute():
        pass
    assert shot.misses is not None
    frame, arm = np.unravel_index(shot.misses.argmax(), shot.misses.shape)
    figure = next(each for each in shot.figures if each.kind == "MISS")
    assert figure.frame == shot.frames[frame]
    assert figure.arm == shot.arms[arm].name
    assert figure.value == pytest.approx(shot.misses.max())
    assert shot.misses.shape == (26, 4)
    assert np.ptp(shot.misses.max(axis=1)) > 0.0


def computed(armature: Any) -> Made:
    shot = prepare(armature, bpy.context)
    # What is reached for is known on frames alone: nobody looks between them.
    shot.on_frames_alone = True
    for _ in shot.compute():
        pass
    return shot


def test_an_arm_that_reaches_neither_slips_nor_misses(octopus: Any) -> None:
    octopus.octo_motion.locomotion.frame_end = 120
    # Those that make way for it are another matter.
    octopus.octo_motion.locomotion.keep_apart = False
    before = {figure.kind: figure for figure in computed(octopus).figures}
    cube: Any = make_mesh(
        [(x, y, z) for x in (-0.03, 0.03) for y in (-0.03, 0.03) for z in (-0.03, 0.03)],
        [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)],
    )
    cube.location = (0.25, -0.1, 0.15)
    item = octopus.octo_motion.locomotion.reaches.add()
    item.mode, item.target, item.arm = "TOUCH", cube, "Arm 1 L"
    item.frame_start, item.frame_contact, item.frame_release = 2, 12, 16
    item.back_frames = 10
    bpy.context.view_layer.update()
    after = {figure.kind: figure for figure in computed(octopus).figures}
    assert after["SLIP"].value < OF_ARM
    assert after["SLIP"].value == pytest.approx(before["SLIP"].value, abs=OF_ARM / 2.0)
    assert after["MISS"].value == pytest.approx(before["MISS"].value)


def test_a_button_goes_to_the_worst_frame_and_is_no_step_of_undo(small: Any) -> None:
    generate(small)
    frame = figures(small)["TURN"].frame
    bpy.context.scene.frame_set(1)
    assert click("quality_jump", kind="TURN") == {"FINISHED"}
    assert bpy.context.scene.frame_current == frame
    assert "UNDO" not in quality_operators.OCTO_MOTION_OT_quality_jump.bl_options


def test_its_tooltip_says_in_full_what_a_narrow_sidebar_cuts_off(small: Any) -> None:
    operator: Any = quality_operators.OCTO_MOTION_OT_quality_jump
    turn = SimpleNamespace(kind="TURN")
    assert operator.description(bpy.context, turn) == operator.bl_description
    generate(small)
    item = figures(small)["TURN"]
    told = operator.description(bpy.context, turn)
    assert told.startswith("How far a bone turns in the world from one frame to the next. ")
    assert f"Go to frame {item.frame}, where it is worst. Turn: " in told
    assert told.endswith(f"°, {item.arm}")
    bpy.context.view_layer.objects.active = None
    assert operator.description(bpy.context, turn) == operator.bl_description


def test_what_is_not_known_is_told(small: Any) -> None:
    with pytest.raises(RuntimeError, match=r"Nothing is known of slip. Generate a motion first."):
        click("quality_jump", kind="SLIP")
    generate(small)
    bpy.context.scene.frame_set(3)
    with pytest.raises(RuntimeError, match="Nothing is known of slip"):
        click("quality_jump", kind="SLIP")
    assert bpy.context.scene.frame_current == 3


class Drawn:
    """A layout that remembers what it shows."""

    def __init__(self) -> None:
        self.labels: list[str] = []
        self.marked: list[str] = []
        self.warned: list[str] = []
        self.buttons: list[tuple[str, Any]] = []
        self.alert = False

    def column(self, **_: Any) -> "Drawn":
        return self

    def split(self, **_: Any) -> "Drawn":
        return self

    def row(self, **_: Any) -> "Drawn":
        return self

    def label(self, *, text: str, icon: str, translate: bool = True) -> None:  # noqa: ARG002
        self.labels.append(text)
        if icon == "ERROR":
            self.warned.append(text)
        if self.alert:
            self.marked.append(text)

    def operator(self, name: str, *, text: str, icon: str) -> Any:  # noqa: ARG002 - Blender's
        button = SimpleNamespace(kind="")
        self.buttons.append((text, button))
        return button


def test_rows_say_what_how_much_and_whose_with_a_button_to_the_frame(small: Any) -> None:
    settings = small.octo_motion.locomotion
    quality_report.write_figures(
        settings,
        [
            Figure("TURN", np.radians(12.34), 40, "Left"),
            Figure("SLIP", 0.00123, 17, "Right"),
            Figure("OVERLAP", 0.0, 1, ""),
            Figure("STRAIN", 0.251, 5, "Left"),
        ],
    )
    drawn = Drawn()
    quality_operators.OCTO_MOTION_PT_quality.show(cast("Any", None), drawn, settings)
    assert drawn.labels == [
        "Slip: 0.12 %",
        "Strain: 25.1 %",
        "Turn: 12.3°",
        "Overlap: 0.00 radii",
    ]
    assert [(text, button.kind) for text, button in drawn.buttons] == [
        ("17", "SLIP"),
        ("5", "STRAIN"),
        ("40", "TURN"),
        ("1", "OVERLAP"),
    ]


def test_figures_are_saved_with_the_file_and_are_no_setting(small: Any, tmp_path: Path) -> None:
    generate(small)  # which fills the list of arms
    shot = computed(small)
    small.octo_motion.locomotion.figures.clear()
    assert prepare(small, bpy.context).note == shot.note
    shot.write()
    expected = [(figure.kind, figure.frame, figure.arm) for figure in shot.figures]
    values = [figure.value for figure in shot.figures]
    # The same settings give the same note, whatever was found.
    assert "figures" not in json.loads(prepare(small, bpy.context).note)
    assert prepare(small, bpy.context).note == shot.note

    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    again: Any = bpy.data.objects["Octopus"]
    items = list(again.octo_motion.locomotion.figures)
    assert [(item.kind, item.frame, item.arm) for item in items] == expected
    np.testing.assert_allclose([item.value for item in items], values, rtol=1e-6, atol=1e-9)


def test_an_override_forgets_what_its_linked_file_knew_of_another_motion(
    small: Any, tmp_path: Path
) -> None:
    settings = small.octo_motion.locomotion
    quality_report.write_figures(settings, [Figure("SLIP", 0.5, 7, "A"), Figure("MISS", 0, 7, "A")])
    library = str(tmp_path / "rig.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(library, link=True) as (_, wanted):  # type: ignore[attr-defined]
        wanted.objects = ["Octopus"]
    linked: Any = bpy.data.objects["Octopus"]
    bpy.context.scene.collection.objects.link(linked)
    armature = linked.override_create(remap_local_usages=True)
    bpy.context.view_layer.objects.active = armature
    give_route(armature)
    generate(armature)
    assert set(figures(armature)) == {"MISS", "TURN", "OVERLAP"}
    frames = {kind: item.frame for kind, item in figures(armature).items()}

    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    again = next(each for each in bpy.data.objects if each.override_library)
    assert {kind: item.frame for kind, item in figures(again).items()} == frames
    bpy.context.view_layer.objects.active = again
    with pytest.raises(RuntimeError, match="Nothing is known of slip"):
        click("quality_jump", kind="SLIP")


def played_joints(armature: Any, shot: Made, times: np.ndarray) -> np.ndarray:
    """Joints of the arms (times, arms, joints, 3) as Blender plays them."""
    names = [bone.name for bone in armature.pose.bones]
    found = []
    for time in times:
        ends = joints_in_world(armature, time)
        arms = [[names.index(name) for name in arm.bones] for arm in shot.arms]
        found.append([np.concatenate([ends[own, 0], ends[own[-1:], 1]]) for own in arms])
    return np.array(found)


def measured_joints(measured: Measured, poses: Poses) -> np.ndarray:
    """The same as they are measured."""
    ends = np.cumsum([0, *(len(arm.bones) for arm in measured.arms)])
    found = []
    for number, arm in enumerate(measured.arms):
        bones = slice(ends[number], ends[number + 1])
        own = arm.joints(arm.from_bones(poses.rotations[:, bones]), poses.strains[:, bones])
        turned = rotate(poses.orientations[:, None], measured.scale * own)
        found.append(poses.locations[:, None] + turned)
    return np.stack(found, axis=1)


@pytest.mark.one_blender
@pytest.mark.parametrize("travel_on", ["OBJECT", "BONE"])
@pytest.mark.parametrize("mode", ["QUATERNION", "ZXY", "AXIS_ANGLE"])
def test_few_keys_are_measured_as_blender_plays_them(travel_on: str, mode: str) -> None:
    armature = make_octopus(length=0.5)
    give_route(armature)
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(parent)
    parent.location, parent.rotation_euler = (1.0, 2.0, 3.0), (0.2, 0.3, 0.4)
    armature.parent, armature.scale = parent, (2.0, 2.0, 2.0)
    armature.rotation_mode = mode
    armature.delta_location, armature.delta_rotation_euler = (0.3, 0.2, 0.1), (0.1, 0.2, 0.3)
    for bone in armature.pose.bones:
        bone.rotation_mode = mode
    for bone in armature.data.bones:
        bone.inherit_scale = "ALIGNED"
    settings = armature.octo_motion.locomotion
    settings.timing, settings.frame_end, settings.keys = "RANGE", 30, "REDUCED"
    settings.travel_on, settings.root_bone = travel_on, "Root"
    settings.key_angle, settings.key_distance = np.radians(5.0), 0.05
    bpy.context.view_layer.update()

    shot = computed(armature)
    shot.write()
    measured = shot.measured
    assert measured is not None
    assert measured.halfway is not None
    assert shot.rotations is not None
    # Few keys are something else than what was computed.
    assert np.abs(measured.poses.rotations - shot.rotations).max() > 1e-3
    times = shot.frames[::4]
    # Single precision, along a chain of bones two metres out in the world.
    np.testing.assert_allclose(
        measured_joints(measured, measured.poses)[::4],
        played_joints(armature, shot, times),
        atol=1e-5,
    )
    np.testing.assert_allclose(
        measured_joints(measured, measured.halfway)[::4],
        played_joints(armature, shot, times[: len(measured.poses.strains[:-1:4])] + 0.5),
        atol=1e-5,
    )


def test_few_keys_hold_what_rests_however_far_tips_may_be_off(octopus: Any) -> None:
    exact = {figure.kind: figure.value for figure in computed(octopus).figures}
    octopus.octo_motion.locomotion.keys = "REDUCED"
    octopus.octo_motion.locomotion.key_distance = 0.02
    few = {figure.kind: figure.value for figure in computed(octopus).figures}
    # They are what the keys play, and so not the same ...
    assert few["SLIP"] != exact["SLIP"]
    # ... but what rests has a bound of its own, to either side, at and between frames.
    assert few["SLIP"] < exact["SLIP"] + 2.5 * 0.003


def test_a_walk_in_place_is_measured_against_the_ground_that_goes_by(octopus: Any) -> None:
    settings = octopus.octo_motion.locomotion
    settings.travel_on, settings.timing, settings.cycle_time = "NONE", "CADENCE", 3.0
    for keys in ("DENSE", "REDUCED"):
        settings.keys = keys
        found = {figure.kind: figure.value for figure in computed(octopus).figures}
        assert found["SLIP"] < 2.0 * OF_ARM
        assert found["DEPTH"] < OF_ARM


def test_what_one_would_see_is_marked_in_the_panel(small: Any) -> None:
    settings = small.octo_motion.locomotion
    values = {
        "SLIP": 0.02,
        "DRIFT": 0.01,
        "DEPTH": 0.004,
        "STRAIN": 0.3,
        "MISS": 0.1,
        "TURN": 0.3,
        "OVERLAP": 0.05,
    }
    quality_report.write_figures(
        settings, [Figure(kind, value, 7, "Arm") for kind, value in values.items()]
    )
    drawn = Drawn()
    quality_operators.OCTO_MOTION_PT_quality.show(cast("Any", None), drawn, settings)
    assert drawn.warned == ["Slip: 2.0 %", "Miss: 10.0 %"]
    # Whose it is stands below.
    assert drawn.marked == ["Slip: 2.0 %", "Arm", "Miss: 10.0 %", "Arm"]
    assert len(drawn.labels) == len(values) + 2


def test_the_closed_panel_is_marked_too(small: Any) -> None:
    settings = small.octo_motion.locomotion
    panel: Any = SimpleNamespace(layout=Drawn())
    draw: Any = quality_operators.OCTO_MOTION_PT_quality.draw_header
    for value, marks in ((0.01, 0), (0.011, 1)):
        quality_report.write_figures(settings, [Figure("SLIP", value, 7, "Arm")])
        draw(panel, bpy.context)
        assert len(panel.layout.warned) == marks


def test_rows_are_not_cut_off_in_a_narrow_sidebar(small: Any) -> None:
    settings = small.octo_motion.locomotion
    worst = [Figure(kind, 0.1234, 12345, "Arm 1 L") for kind in KINDS if kind != "OVERLAP"]
    worst += [Figure("OVERLAP", 1.23, 12345, "Arm 1 L, Arm 2 L")]
    quality_report.write_figures(settings, worst)
    drawn = Drawn()
    quality_operators.OCTO_MOTION_PT_quality.show(cast("Any", None), drawn, settings)
    blf.size(0, 11.0)
    # Of 200 pixels, an icon and margins take 30.
    room = 200.0 * quality_operators._WORDS - 30.0
    assert max(blf.dimensions(0, label)[0] for label in drawn.labels) < room


# --- What plays -----------------------------------------------------------------------------------


def hung_down(armature: Any, item: Any) -> Any:
    """A constraint that lets an arm hang down from its root, whatever its keys say."""
    hook = bpy.data.objects.new("Hook", None)
    bpy.context.scene.collection.objects.link(hook)
    hook.rotation_euler = (-np.pi / 2.0, 0.0, 0.0)
    for bone in item.bones:
        constraint = armature.pose.bones[bone.name].constraints.new("COPY_ROTATION")
        constraint.target = hook
    return hook


def test_figures_are_those_of_the_rig_with_its_constraints(octopus: Any) -> None:
    settings = octopus.octo_motion.locomotion
    generate(octopus)
    assert figures(octopus)["DEPTH"].value < 0.005
    item = settings.arms[2]
    hung_down(octopus, item)
    generate(octopus)
    figure = figures(octopus)["DEPTH"]
    assert figure.arm == item.name
    tip = [bone.name for bone in octopus.pose.bones].index(item.bones[-1].name)
    depths = [-joints_in_world(octopus, frame)[tip, 1, 2] for frame in range(1, 81)]
    length = sum(octopus.data.bones[bone.name].length for bone in item.bones)
    assert figure.value > 0.2
    # But for the skin about the tip.
    assert figure.value == pytest.approx(max(depths) / length, abs=0.02)
    assert depths[figure.frame - 1] == pytest.approx(max(depths), abs=0.01)


def test_drivers_and_what_carries_the_armature_are_seen_too(octopus: Any) -> None:
    generate(octopus)
    before = figures(octopus)["DEPTH"].value
    constraint = octopus.constraints.new("TRANSFORM")
    generate(octopus)
    # One that moves nothing: what plays is what was computed.
    assert figures(octopus)["DEPTH"].value == pytest.approx(before, abs=1e-4)
    constraint.mute = True
    bone = octopus.octo_motion.locomotion.arms[0].bones[0].name
    driver = octopus.pose.bones[bone].driver_add("rotation_quaternion", 1).driver
    driver.expression = "0.8 * (frame % 2)"
    generate(octopus)
    assert figures(octopus)["TURN"].value > np.radians(60.0)


def test_playing_leaves_the_scene_as_it_was(octopus: Any) -> None:
    generate(octopus)
    hung_down(octopus, octopus.octo_motion.locomotion.arms[0])
    lamp = bpy.data.objects.new("Lamp", None)
    bpy.context.scene.collection.objects.link(lamp)
    lamp.keyframe_insert("location", frame=1)
    bpy.context.scene.frame_set(7, subframe=0.25)
    lamp.location.x = 3.0  # not keyed yet
    octopus.octo_motion.locomotion.keep_pose = True
    mantle = octopus.pose.bones[0]
    mantle.location.x = 0.5
    generate(octopus)
    assert (bpy.context.scene.frame_current, bpy.context.scene.frame_subframe) == (7, 0.25)
    assert lamp.location.x == 3.0
    assert mantle.location.x == 0.5
    first = octopus.octo_motion.locomotion.arms[1].bones[0].name
    shown = tuple(octopus.pose.bones[first].rotation_quaternion)
    bpy.context.scene.frame_set(7, subframe=0.25)
    assert tuple(octopus.pose.bones[first].rotation_quaternion) == pytest.approx(shown, abs=1e-6)


def test_a_rig_that_nothing_else_moves_is_not_played_through(
    octopus: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    played = []
    monkeypatch.setattr(shots, "play_bones", lambda *_: played.append(1) or np.empty((0, 1, 4, 4)))
    generate(octopus)
    assert not played
    hung_down(octopus, octopus.octo_motion.locomotion.arms[0])
    generate(octopus)
    assert played


@pytest.mark.parametrize("keys", ["DENSE", "REDUCED"])
def test_a_motion_that_breaks_is_never_silent(octopus: Any, keys: str) -> None:
    settings = octopus.octo_motion.locomotion
    settings.keys, settings.frame_end = keys, 12  # the whole way in half a second
    found = computed(octopus).write()
    turn = next(each for each in found.figures if each.kind == "TURN")
    assert turn.value > np.radians(60.0)
    (told,) = [each for each in found.warnings if each.startswith("The motion breaks: ")]
    assert f"'{turn.arm}' turns by {np.degrees(turn.value):.0f}° at frame {turn.frame}" in told


@pytest.mark.parametrize("name", ["idle", "curl"])
def test_what_rests_rests_while_nobody_goes_anywhere(name: str, octopus: Any) -> None:
    bpy.ops.octo_motion.setup_load(name=name)
    computed(octopus).write()
    # 0.004 and 0.006, where it was 0.029 and 0.014.
    assert figures(octopus)["DRIFT"].value <= 0.01


def test_resting_arms_that_creep_in_place_are_told(octopus: Any) -> None:
    bpy.ops.octo_motion.setup_load(name="idle")
    octopus.octo_motion.locomotion.table.stride = 0.1
    summary = computed(octopus).write()
    found = figures(octopus)
    assert found["SLIP"].value < 1e-3
    assert found["DRIFT"].value > 0.02
    (told,) = [each for each in summary.warnings if "drifts" in each]
    assert told.startswith("One sees that ")
    assert f"'{found['DRIFT'].arm}' drifts by" in told
    assert f"at frame {found['DRIFT'].frame}" in told
