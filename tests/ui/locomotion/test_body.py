# SPDX-License-Identifier: GPL-3.0-or-later
"""The body moves by itself, and what its arms hold on to stays where it is."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.core.locomotion.ground.walk import Foothold
from tests.ui.made import prepare
from tests.ui.rig import Octopus, generate, give_route, joints_in_world, keys

pytestmark = pytest.mark.one_blender

WAY = {"b0": (-0.4, 0.1, 0.0), "b1": (0.0, -0.2, 0.0), "b2": (0.4, 0.2, 0.0), "b3": (0.8, 0.0, 0.0)}
OCTOPUS = Octopus(add_on=True, with_mesh=False, route=WAY, settings={"keep_apart": False})


def bodies(octopus: Any, times: np.ndarray, rate: int) -> np.ndarray:
    """Where the bone 'body' begins at times (n,) in seconds (n, 3), world."""
    bone = _bone(octopus, "body")
    return np.array([joints_in_world(octopus, 1.0 + each * rate)[bone, 0] for each in times])


def test_the_body_surges_and_bobs_and_feet_stay_where_they_are(octopus: Any) -> None:
    body = octopus.octo_motion.locomotion.body
    figures = {}
    for amount in (0.0, 1.0):
        body.surge = amount
        generate(octopus)
        heights = bodies(octopus, np.arange(1.5, 4.0, 0.05), 24)[:, 2]
        told = octopus.octo_motion.locomotion.figures
        figures[amount] = np.ptp(heights), {each.kind: each.value for each in told}
    # Metres, of arms of 0.58 m: 4 mm.
    assert figures[0.0][0] < 1e-6
    assert 0.002 < figures[1.0][0] < 0.012
    for kind in ("SLIP", "DRIFT"):
        assert figures[1.0][1][kind] <= 1.05 * figures[0.0][1][kind] + 2e-4


def test_footholds_are_those_of_a_body_that_does_not(octopus: Any) -> None:
    places: list[list[Foothold]] = []
    for amount in (0.0, 2.0):
        octopus.octo_motion.locomotion.body.surge = amount
        (walk,) = prepare(octopus, bpy.context).plan.segments.walks
        assert walk is not None
        places.append(walk.footholds())
    for before, after in zip(*places, strict=True):
        np.testing.assert_array_equal(before.position, after.position)


def test_it_is_the_same_motion_at_any_frame_rate(octopus: Any) -> None:
    render: Any = bpy.context.scene.render
    times, found = np.array([0.5, 1.25, 2.0, 3.5]), []
    for rate in (24, 48):
        render.fps, render.fps_base = rate, 1.0
        generate(octopus)
        found.append(bodies(octopus, times, rate))
    np.testing.assert_allclose(found[0], found[1], atol=1e-6)


def saved_as_before(octopus: Any, path: Path, knows: int) -> None:
    """Save the file as an earlier version has it."""
    from octo_motion.ui import registration

    bpy.app.handlers.save_pre.remove(registration._before_saving)
    try:
        octopus.octo_motion.locomotion.body.file_knows = knows
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
    finally:
        bpy.app.handlers.save_pre.append(registration._before_saving)


def test_files_of_before_keep_their_look(octopus: Any, tmp_path: Path) -> None:
    along = octopus.octo_motion.locomotion.along.add()
    along.setting = "HOLD"
    names = ("new", "breathing", "old")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "new.blend"))
    assert octopus.octo_motion.locomotion.body.file_knows == 2
    for knows, name in ((1, "breathing"), (0, "old")):
        saved_as_before(octopus, tmp_path / f"{name}.blend", knows)
    for name, amount, hold in zip(names, (1.0, 1.0, 0.0), (0.5, 0.55, 0.55), strict=True):
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / f"{name}.blend"))
        opened = bpy.data.objects["Octopus"].octo_motion.locomotion
        assert opened.body.surge == pytest.approx(amount)
        assert opened.ground.duty == pytest.approx(hold)
        assert opened.along[0].hold == pytest.approx(hold)
        assert opened.slow_in_bends == pytest.approx(float(name == "new"))
        assert opened.body.file_knows == 2


def test_a_hold_that_a_file_of_before_tells_is_kept(octopus: Any, tmp_path: Path) -> None:
    octopus.octo_motion.locomotion.ground.duty = 0.5
    saved_as_before(octopus, tmp_path / "old.blend", 1)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "old.blend"))
    opened = bpy.data.objects["Octopus"].octo_motion.locomotion
    assert opened.ground.duty == pytest.approx(0.5)


# --- Mantle, head, siphon and eyes ----------------------------------------------------------------


def turns(octopus: Any, name: str, frames: np.ndarray) -> np.ndarray:
    """World rotation matrices (n, 3, 3) of a bone at frames (n,), as Blender plays them."""
    scene: Any = bpy.context.scene
    found = []
    for frame in frames:
        scene.frame_set(int(np.floor(frame)), subframe=float(frame % 1.0))
        seen = octopus.evaluated_get(bpy.context.evaluated_depsgraph_get())
        found.append(
            np.array((seen.matrix_world @ seen.pose.bones[name].matrix).to_3x3().normalized())
        )
    return np.array(found)


def test_slits_of_the_eyes_are_level_in_any_swim(octopus: Any) -> None:
    """Across the gaze and level: the bone's X, along which the pupil lies."""
    give_route(octopus, ((0.0, 0.0, 0.0), (0.5, -0.3, 1.0), (1.5, 0.3, -0.5), (2.0, 0.0, 0.5)))
    settings = octopus.octo_motion.locomotion
    settings.gait = "swim"
    frames = np.arange(1.0, 120.0, 7.5)
    tilts = {}
    for amount in (0.0, 1.0):
        settings.body.eyes = amount
        generate(octopus)
        across = [turns(octopus, name, frames)[:, 2, 0] for name in ("eye.L", "eye.R")]
        tilts[amount] = np.degrees(np.arcsin(np.abs(np.concatenate(across)).max()))
    assert tilts[0.0] > 40.0  # the body lies on its back
    assert tilts[1.0] < 0.5


def test_eyes_look_at_what_they_are_told_to(octopus: Any) -> None:
    target = bpy.data.objects.new("Crab", None)
    bpy.context.scene.collection.objects.link(target)
    target.location = (0.2, -3.0, 0.1)
    body = octopus.octo_motion.locomotion.body
    frames, away = np.array([30.0, 60.0]), []
    for look_at in (None, target):
        body.look_at = look_at
        generate(octopus)
        gaze = turns(octopus, "eye.L", frames)[:, :, 1]
        places = np.array(
            [joints_in_world(octopus, each)[_bone(octopus, "eye.L"), 0] for each in frames]
        )
        wanted = np.array(target.location) - places
        wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
        away.append(np.degrees(np.arccos(np.sum(gaze * wanted, axis=1))))
    assert np.all(away[1] < away[0] - 10.0)


def _bone(octopus: Any, name: str) -> int:
    return octopus.pose.bones.keys().index(name)


def test_a_loop_has_no_seam_and_equal_seeds_are_equal_motions(octopus: Any) -> None:
    settings = octopus.octo_motion.locomotion
    settings.gait, settings.travel_on, settings.cycles = "swim", "NONE", 2
    action = generate(octopus)
    found = keys(action)
    own = {path: each for path, each in found.items() if "arm" not in path[0]}
    assert {path.split('"')[1] for path, _ in own if '"' in path} >= {"mantle", "siphon", "eye.L"}
    for path, each in own.items():
        values = each[:, 1]
        assert values[0] == pytest.approx(values[-1], abs=1e-6), path
        # Nor in speed: what comes after the last frame comes after the first.
        steps = np.diff(np.concatenate([values[:-1], values[:2]]))
        bend = np.abs(np.diff(np.concatenate([steps, steps[:1]])))
        assert bend[[-2, -1]].max() <= 1.5 * np.sort(bend)[-3] + 1e-5, path
    again = keys(generate(octopus))
    assert all(np.array_equal(again[path], each) for path, each in own.items())


def test_without_any_amount_nothing_but_arms_and_travel_is_keyed(octopus: Any) -> None:
    settings = octopus.octo_motion.locomotion
    settings.breathing = 0.0
    for name in ("surge", "mantle", "siphon", "eyes", "head"):
        setattr(settings.body, name, 0.0)
    found = {path.split('"')[1] for path, _ in keys(generate(octopus)) if '"' in path}
    assert found == {bone.name for arm in settings.arms for bone in arm.bones}


def test_a_bone_that_carries_arms_is_no_mantle(octopus: Any) -> None:
    octopus.octo_motion.locomotion.body.mantle_bone = "body"
    with pytest.raises(RuntimeError, match="'body' cannot move by itself"):
        generate(octopus)


def test_a_part_is_taken_away_by_hand(octopus: Any) -> None:
    octopus.octo_motion.locomotion.body.siphon_bone = "-"
    found = {path.split('"')[1] for path, _ in keys(generate(octopus)) if '"' in path}
    assert "siphon" not in found
    assert "eye.L" in found


def test_the_mantle_swings_out_after_the_last_frame(octopus: Any) -> None:
    settings = octopus.octo_motion.locomotion
    settings.keys, settings.ease_out, settings.ground.come_to_rest = "DENSE", 0.0, False
    # Who stands looks about, and the mantle goes with the head.
    settings.body.head = 0.0
    bone, way = _bone(octopus, "mantle"), []
    for seconds in (0.0, 2.0):
        settings.body.settle = seconds
        action = generate(octopus)
        last = int(action.frame_range[1])
        tails = [joints_in_world(octopus, frame) for frame in range(1, last + 1)]
        way.append(np.array(tails))
    plain, settled = way
    end = len(plain)
    assert len(settled) == end + 48
    # A body that stops at once, as here, lets swinging arms stop within a part of a cycle.
    np.testing.assert_allclose(settled[: end - 40], plain[: end - 40], atol=1e-5)
    tip = settled[end - 1 :, bone, 1]
    # Metres: measured 0.044, and 0.002 in the last half second of two.
    assert np.linalg.norm(np.ptp(tip, axis=0)) > 0.01
    assert np.linalg.norm(np.ptp(tip[-12:], axis=0)) < 0.1 * np.linalg.norm(np.ptp(tip, axis=0))
    arms = [octopus.data.bones.find(each.name) for arm in settings.arms for each in arm.bones]
    assert np.ptp(settled[end + 40 :, arms], axis=0).max() < 1e-5


def test_a_loop_and_a_pose_at_the_end_have_nothing_after_them(octopus: Any) -> None:
    settings = octopus.octo_motion.locomotion
    settings.body.settle = 2.0
    whole = prepare(octopus, bpy.context).plan.schedule
    assert whole.frames[-1] > 24 + prepared_without(octopus)
    settings.travel_on = "NONE"
    assert prepare(octopus, bpy.context).plan.schedule.times.max() == 1.0


def prepared_without(octopus: Any) -> float:
    """The last frame of the same motion that does not settle."""
    body = octopus.octo_motion.locomotion.body
    seconds, body.settle = body.settle, 0.0
    last = float(prepare(octopus, bpy.context).plan.schedule.frames[-1])
    body.settle = seconds
    return last
