# SPDX-License-Identifier: GPL-3.0-or-later
"""The first hour, step by step; Blender runs this, see ``__main__.py``.

blender --enable-event-simulate --python tests/window/hour.py -- FOLDER LANGUAGE CLIPS [STEPS]
"""

from __future__ import annotations

import json
import os
import platform
import sys
import time
import traceback
from collections.abc import Callable
from math import cos, dist, pi, sin
from pathlib import Path
from typing import Any, Final

sys.path.insert(0, str(Path(__file__).resolve().parent))

import bpy
from hand import PAUSE, Hand, HandError, Steps

MODULE: Final = "bl_ext.user_default.octo_motion"
Figures = dict[str, Any]


def check(condition: object, what: str) -> None:
    """Raise what is not so."""
    if not condition:
        raise HandError(what)


def octopus() -> Any:
    return next(
        each for each in bpy.data.objects if each.type == "ARMATURE" and "Octo" in each.name
    )


def settings() -> Any:
    return octopus().octo_motion.locomotion


def action_of(item: Any) -> Any:
    data = item.animation_data
    return data.action if data is not None else None


def joints(item: Any) -> list[tuple[float, ...]]:
    """Where its bones begin, world space."""
    return [tuple(item.matrix_world @ each.head) for each in item.pose.bones]


def select(item: Any) -> None:
    """Make an object active alone, as a click on it does."""
    for each in bpy.data.objects:
        each.select_set(state=False)
    item.select_set(state=True)
    bpy.context.view_layer.objects.active = item


# --- Steps ----------------------------------------------------------------------------------------


def first_walk(hand: Hand, figures: Figures) -> Steps:
    """From a new file to a walk: three clicks."""
    for each in list(bpy.data.objects):
        if each.type == "MESH":
            bpy.data.objects.remove(each)
    yield from hand.show_tab()
    yield from hand.take("first_walk_0_tab")
    begun, hand.clicks, seconds = time.perf_counter(), 0, 0.0
    for number, (button, there) in enumerate(
        (
            ("octo_motion.add_octopus", lambda: bool(bpy.data.armatures)),
            ("octo_motion.add_route", lambda: bool(bpy.data.curves)),
            ("octo_motion.generate_locomotion", lambda: action_of(octopus()) is not None),
        ),
        1,
    ):
        yield from hand.find(button)
        clicked = time.perf_counter()
        yield from hand.click()
        yield from hand.until(there, button)
        yield from hand.settled()
        seconds += time.perf_counter() - clicked
        yield from hand.take(f"first_walk_{number}")
    figures |= {
        "clicks": hand.clicks,
        "wheel ticks": hand.wheel,
        "seconds of Blender": round(seconds, 1),
        "with looking for buttons": round(time.perf_counter() - begun, 1),
        "frames": action_of(octopus()).frame_range[1],
    }
    check(octopus().users_collection[0].name == "Octopus", "It has no collection of its own.")
    yield from hand.over()
    for _ in range(2):
        yield from hand.key("Z", ctrl=True)
    yield from hand.until(lambda: not bpy.data.curves, "Undo of the route")
    for _ in range(2):
        yield from hand.key("Z", ctrl=True, shift=True)
    yield from hand.until(lambda: action_of(octopus()) is not None, "Redo of the walk")


def setup_by_picture(hand: Hand, figures: Figures) -> Steps:
    """The picture is clicked, and one of those that it shows."""
    select(octopus())
    before = action_of(octopus()).frame_range[1]
    chosen = bpy.context.window_manager.octo_motion_setup
    region = hand.region("UI")
    clicks = hand.clicks
    yield from hand.find("octo_motion.generate_locomotion")
    generate = hand._place
    yield from hand.move(region.x + region.width // 2, generate[1] + 75)
    yield from hand.click()
    yield 1.0
    yield from hand.take("setup_1_pictures")
    x, y = hand._place
    yield from hand.move(x, y - 140)
    yield from hand.click()
    yield 1.0
    after = bpy.context.window_manager.octo_motion_setup
    check(after != chosen, "The click on a picture has chosen nothing.")
    yield from hand.move(*generate)
    yield from hand.click()
    yield from hand.until(lambda: action_of(octopus()).frame_range[1] != before, "Another motion")
    # Soon enough that what swims fast is still in sight.
    bpy.context.scene.frame_set(10)
    yield from hand.take("setup_2_generated")
    figures |= {"from": chosen, "to": after, "clicks": hand.clicks - clicks}


def live_drag(hand: Hand, figures: Figures) -> Steps:
    """The end of the route is dragged over bumps, for 700 frames, and the creature follows."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=200, y_subdivisions=200, size=20.0)
    ground: Any = bpy.context.object
    for vertex in ground.data.vertices:
        vertex.co.z = 0.08 * sin(3.0 * vertex.co.x) * cos(2.5 * vertex.co.y)
    select(octopus())
    bpy.ops.octo_motion.setup_load(name="walk")
    own = settings()
    own.ground.object, own.timing, own.frame_end = ground, "RANGE", 700
    bpy.context.scene.frame_set(120)
    own.live = True
    yield from hand.until(lambda: action_of(octopus()).frame_range[1] == 700, "The live motion")
    yield 2.0
    with bpy.context.temp_override(window=hand.window, area=hand.area(), region=hand.region()):
        bpy.ops.view3d.view_selected()
    route = own.route
    select(route)
    yield from hand.over()
    latencies, shown, own_work = [], joints(octopus()), _timed_follow()
    draws, begun = len(hand.draws), time.perf_counter()
    yield from hand.key("G")
    x, y = hand._place
    drags = 20
    for number in range(drags):
        moved = time.perf_counter()
        hand._place = (x + 4 * (number + 1), y + 2 * (number % 3))
        hand.event("MOUSEMOVE", "NOTHING")
        while time.perf_counter() - moved < 3.0:
            yield 0.0
            now = joints(octopus())
            if now != shown and hand.draws[-1] > moved:
                shown = now
                latencies.append(hand.draws[-1] - moved)
                break
    lasted, drawn = time.perf_counter() - begun, len(hand.draws) - draws
    yield from hand.take("live_drag_1_held")
    hand.event("LEFTMOUSE", "PRESS")
    hand.event("LEFTMOUSE", "RELEASE")
    released, slices, last = time.perf_counter(), [], time.perf_counter()
    written = (
        action_of(octopus())["octo_motion"]["fingerprint"]
        if "octo_motion" in action_of(octopus())
        else None
    )
    while time.perf_counter() - released < 20.0:
        yield 0.0
        slices.append(time.perf_counter() - last)
        last = time.perf_counter()
        now = action_of(octopus()).get("octo_motion")
        if now is not None and now["fingerprint"] != written:
            break
    check(latencies, "The creature did not follow the drag.")
    latencies.sort()
    own_work.sort()
    figures |= {
        "ms of processor a move": round(1e3 * own_work[len(own_work) // 2]),
        "drags followed": f"{len(latencies)} of {drags}",
        "ms to the redraw": round(1e3 * latencies[len(latencies) // 2]),
        "slowest": round(1e3 * latencies[-1]),
        "redraws a drag": round(drawn / drags, 1),
        "redraws a second": round(drawn / lasted, 1),
        "ms longest turn after": round(1e3 * max(slices)),
    }
    yield from hand.take("live_drag_2_let_go")
    yield from hand.key("Z", ctrl=True)
    yield 3.0
    yield from hand.take("live_drag_3_undone")
    settings().live = False


def live_slider(hand: Hand, figures: Figures) -> Steps:
    """A slider is dragged, and the creature follows while the button is held."""
    own = settings()
    select(octopus())
    own.timing, own.live = "CADENCE", True
    bpy.context.scene.frame_set(120)
    yield 5.0
    yield from hand.find("locomotion.cycle_time")
    x, y = hand._place
    hand.event("LEFTMOUSE", "PRESS")
    yield PAUSE
    poses, drags = set[Any](), 12
    for number in range(drags):
        yield from hand.move(x + 6 * (number + 1), y)
        yield 0.5
        poses.add(tuple(tuple(each.matrix.translation) for each in octopus().pose.bones))
    yield from hand.take("live_slider_held")
    hand.event("LEFTMOUSE", "RELEASE")
    yield 3.0
    figures |= {"poses while held": f"{len(poses)} of {drags}", "cycle": round(own.cycle_time, 2)}
    check(len(poses) > 2, "The creature did not follow while the button was held.")
    settings().live = False


def splice(hand: Hand, figures: Figures) -> Steps:
    """A part of another clip, its timing dragged in the viewport."""
    new_file(hand)
    yield 1.0
    yield from hand.show_tab()
    waver, walker = person("Waver", 1.5, wave=True), person("Walker", 0.0, wave=False)
    select(waver)
    walker.select_set(state=True)
    bpy.context.view_layer.objects.active = walker
    with bpy.context.temp_override(window=hand.window, area=hand.area(), region=hand.region()):
        bpy.ops.view3d.view_selected()
    yield from hand.settled()
    yield from hand.search("Add Splice")
    yield from hand.until(lambda: len(walker.octo_motion.splicing.splices) == 1, "The splice")
    yield from hand.take("splice_1_added")
    yield from hand.search("Drag Timing of Splice")
    yield 1.0
    x, y = hand._place
    for number in range(20):
        yield from hand.move(x + 15 * (number + 1), y)
    yield from hand.take("splice_2_dragged")
    yield from hand.click()
    stack = walker.octo_motion.splicing
    yield from hand.until(lambda: stack.result is not None, "The spliced action")
    figures["begins at"] = stack.splices[0].base_start
    check(stack.splices[0].base_start > 1.0, "The drag did not move its start.")
    yield from hand.take("splice_3_built")
    yield from hand.key("Z", ctrl=True)
    yield from hand.until(
        lambda: bpy.data.objects["Walker"].octo_motion.splicing.result is None, "Undo"
    )


def drop(hand: Hand, figures: Figures) -> Steps:
    """Two clips are let fall into the viewport, and a part of one is put onto the other."""
    new_file(hand)
    yield 1.0
    yield from hand.show_tab()
    files = [{"name": name} for name in ("walk.bvh", "throw.bvh")]
    clips = sys.argv[sys.argv.index("--") + 3]
    # No event tells of files from outside: this is what Blender calls once they are let go.
    with bpy.context.temp_override(window=hand.window, area=hand.area(), region=hand.region()):
        bpy.ops.octo_motion.import_clips("INVOKE_DEFAULT", directory=clips, files=files)
    yield from hand.until(lambda: len(bpy.data.armatures) == 2, "Both clips")
    yield 2.0
    people = [each for each in bpy.data.objects if each.type == "ARMATURE"]
    yield from hand.take("drop_1_imported")
    walker = next(each for each in people if "walk" in each.name.lower())
    (thrower,) = (each for each in people if each is not walker)
    select(thrower)
    walker.select_set(state=True)
    bpy.context.view_layer.objects.active = walker
    begun, hand.clicks = time.perf_counter(), 0
    yield from hand.search("Add Splice")
    stack = walker.octo_motion.splicing
    yield from hand.until(lambda: len(stack.splices) == 1, "The splice")
    yield from hand.press("octo_motion.splice_build")
    yield from hand.until(lambda: stack.result is not None, "The spliced action")
    yield from hand.take("drop_2_built")
    figures |= {"clicks": hand.clicks, "seconds": round(time.perf_counter() - begun, 1)}


def pose(hand: Hand, figures: Figures) -> Steps:
    """An arm is pinned, pulled, keyed; undo; and Blender asks before it quits over the key."""
    new_file(hand)
    yield 1.0
    yield from hand.show_tab()
    yield from hand.search("Octopus")
    if not bpy.data.armatures:
        bpy.ops.octo_motion.add_octopus("INVOKE_DEFAULT")
    creature = octopus()
    select(creature)
    yield from hand.settled()
    yield from hand.search("Pose by Hand")
    yield 2.0
    check(_modal("OCTO_MOTION_OT_pose"), "The session has not begun.")
    yield from _pull(hand, creature, "arm2.08.L", still=0.0, picture="pose_1_pulled")
    yield from hand.key("P")
    yield from hand.key("K")
    yield 0.5
    figures["keys"] = sum(len(curve.keyframe_points) for curve in curves(action_of(creature)))
    check(figures["keys"], "K has set no key.")
    yield from hand.take("pose_2_keyed")
    yield from hand.key("Z", ctrl=True)
    yield 0.5
    yield from hand.take("pose_3_undone")
    yield from hand.key("K")
    yield 0.5
    yield from hand.key("RET")
    yield 1.0
    check(not _modal("OCTO_MOTION_OT_pose"), "Enter has not ended the session.")
    check(bpy.data.is_dirty, "Blender does not know of the keys: it would quit without asking.")
    yield from hand.over()
    yield from hand.key("Q", ctrl=True)
    yield 1.0
    yield from hand.take("pose_4_quit")
    yield from hand.key("ESC")
    yield 0.5


def undisturbed(hand: Hand, figures: Figures) -> Steps:
    """While a session runs, no key of Blender's reaches the scene, nor a click beside a limb; what
    was bent stays, only that is keyed, a step back and forward go as expected, and Tab ends it.
    """
    new_file(hand)
    yield 1.0
    yield from hand.show_tab()
    bpy.ops.octo_motion.add_octopus("INVOKE_DEFAULT")
    creature = octopus()
    select(creature)
    yield from hand.settled()
    yield from _begin_session(hand)
    chosen = [each.name for each in bpy.context.selected_objects]
    scale, count = tuple(creature.scale), len(bpy.data.objects)
    region = hand.region()
    yield from hand.move(region.x + 0.3 * region.width, region.y + 0.9 * region.height)
    for key in ("X", "S", "H", "DEL", "A"):
        yield from hand.key(key)
    yield from hand.click()
    check(_modal("OCTO_MOTION_OT_pose"), "A key or a click has ended the session.")
    check(len(bpy.data.objects) == count, "Something was deleted.")
    check(tuple(creature.scale) == scale and not creature.hide_get(), "Scaled or hidden.")
    now = [each.name for each in bpy.context.selected_objects]
    check(now == chosen, f"Chosen now: {now}")
    yield from hand.take("undisturbed_1_keys")

    before = joints(creature)
    yield from _pull(hand, creature, "arm2.08.L", still=1.5)
    let_go = creature.matrix_world @ creature.pose.bones["arm2.08.L"].head
    yield 1.5
    after = joints(creature)
    tip = creature.pose.bones.find("arm2.08.L")
    way = _apart(after[tip], before[tip])
    figures["comes back %"] = round(100.0 * _apart(after[tip], let_go) / way, 2)
    check(figures["comes back %"] < 1.0, "Clay springs back.")
    yield from hand.key("Z", ctrl=True)
    yield 0.5
    check(_farthest(joints(creature), before) < 1e-4, "Ctrl Z does not take the drag back.")
    yield from hand.key("Z", ctrl=True, shift=True)
    yield 0.5
    check(_farthest(joints(creature), after) < 1e-4, "Ctrl Shift Z does not bring it again.")
    yield from hand.key("K")
    yield 0.5
    keyed = {curve.data_path.split('"')[1] for curve in curves(action_of(creature))}
    figures["keyed"] = len(keyed)
    check(keyed and all(each.startswith("arm2.") for each in keyed), f"Keyed: {sorted(keyed)}")
    yield from hand.take("undisturbed_2_keyed")
    yield from hand.key("TAB")
    yield 1.0
    check(not _modal("OCTO_MOTION_OT_pose"), "Tab has not ended the session.")
    check(creature.mode != "EDIT", "Tab has gone on to edit mode.")
    check(_farthest(joints(creature), after) < 1e-4, "The pose was not kept.")
    yield from hand.take("undisturbed_3_tab")


def over_a_motion(hand: Hand, figures: Figures) -> Steps:
    """A key over a generated walk goes to a layer: the walk stays as it was, and nothing pops."""
    new_file(hand)
    yield 1.0
    yield from hand.show_tab()
    bpy.ops.octo_motion.add_octopus("INVOKE_DEFAULT")
    creature = octopus()
    select(creature)
    bpy.ops.octo_motion.add_route()
    select(creature)
    bpy.ops.octo_motion.generate_locomotion()
    walk = action_of(creature)
    values = [_values(curve) for curve in curves(walk)]
    scene: Any = bpy.context.scene
    scene.frame_set(40)
    yield from hand.settled()
    yield from _begin_session(hand)
    yield from _pull(hand, creature, "arm2.08.L", still=0.3)
    yield from hand.key("K")
    yield 0.7
    yield from hand.take("over_a_motion_1_keyed")
    yield from hand.key("RET")
    yield 1.0
    check([_values(curve) for curve in curves(walk)] == values, "The walk's own keys have changed.")
    data = creature.animation_data
    layers = [strip.action.name for track in data.nla_tracks for strip in track.strips]
    figures["layers"] = len(layers) + (data.action is not None and data.action != walk)
    check(figures["layers"], "There is no layer.")
    places = []
    for frame in range(30, 51):
        scene.frame_set(frame)
        places.append(creature.matrix_world @ creature.pose.bones["arm2.08.L"].head)
    steps = [_apart(one, other) for one, other in zip(places[1:], places[:-1], strict=True)]
    figures["largest step, m"] = round(max(steps), 4)
    check(max(steps) < 0.25 * _apart(places[0], places[10]) + 0.05, "It pops.")
    scene.frame_set(40)
    yield from hand.take("over_a_motion_2_layer")


def controls(hand: Hand, figures: Figures) -> Steps:
    """A foot that an empty leads is pulled: the empties get the keys, and play what was seen."""
    new_file(hand)
    yield 1.0
    yield from hand.show_tab()
    somebody, empties = led_by_empties()
    yield from hand.settled()
    yield from _begin_session(hand)
    begun = joints(somebody)
    places = [tuple(each.location) for each in empties]
    yield from _pull(hand, somebody, "LeftFoot", still=0.2, way=(4, 3), picture="controls_1_pulled")
    shown = joints(somebody)
    yield from hand.key("K")
    yield 0.5
    keyed = {each.name: len(curves(action_of(each))) for each in empties}
    figures["keyed"] = ", ".join(name for name, count in keyed.items() if count)
    check(keyed["Left Goal"], f"The goal has no key: {keyed}")
    check(not keyed["Right Goal"], f"The other foot's goal has one: {keyed}")
    yield from hand.take("controls_2_keyed")
    yield from hand.key("RET")
    yield 1.0
    check(not _modal("OCTO_MOTION_OT_pose"), "Enter has not ended the session.")
    for each, place in zip(empties, places, strict=True):
        each.location = place
    scene: Any = bpy.context.scene
    scene.frame_set(2)
    scene.frame_set(1)
    now = joints(somebody)
    foot = somebody.pose.bones.find("LeftFoot")
    figures["pulled, m"] = round(_apart(shown[foot], begun[foot]), 3)
    figures["off, mm"] = round(1e3 * _farthest(now, shown), 2)
    check(figures["pulled, m"] > 0.1, "The foot has hardly moved.")
    check(figures["off, mm"] < 1.0, "The keys play something else than was seen.")
    yield from hand.take("controls_3_played")


def language(hand: Hand, figures: Figures) -> Steps:
    """Blender speaks Japanese, and then again what it spoke; the panel follows at once."""
    new_file(hand)
    yield 1.0
    yield from hand.show_tab()
    bpy.ops.octo_motion.add_octopus("INVOKE_DEFAULT")
    yield from hand.settled()
    view: Any = bpy.context.preferences.view
    spoken = view.language
    other = "ja_JP" if spoken != "ja_JP" else "en_US"
    told = bpy.app.translations.pgettext_iface
    before = told("Generate", "Operator")
    for chosen, name in ((other, "language_1_other"), (spoken, "language_2_back")):
        speak(chosen)
        hand.redraw()
        yield 1.0
        yield from hand.show_tab()
        yield from hand.take(name)
        now = told("Generate", "Operator")
        check((now == before) == (chosen == spoken), f"{chosen}: the button says '{now}'.")
        figures[chosen] = now


def switched_off(hand: Hand, figures: Figures) -> Steps:
    """The add-on is disabled in the middle of a session, and enabled again."""
    if not bpy.data.armatures:
        bpy.ops.octo_motion.add_octopus("INVOKE_DEFAULT")
    select(octopus())
    yield from hand.search("Pose by Hand")
    yield 2.0
    check(_modal("OCTO_MOTION_OT_pose"), "The session has not begun.")
    bpy.ops.preferences.addon_disable(module=MODULE)
    yield 1.0
    yield from hand.take("switched_off_1")
    check(not hasattr(bpy.types.Object, "octo_motion"), "Settings are left.")
    check("octo_motion" not in dir(bpy.ops) or not dir(bpy.ops.octo_motion), "Operators are left.")
    yield from hand.over()
    yield from hand.key("HOME")
    bpy.ops.preferences.addon_enable(module=MODULE)
    yield 1.0
    yield from hand.show_tab()
    check(hasattr(bpy.types.Object, "octo_motion"), "It does not come back.")
    yield from hand.take("switched_off_2_again")
    figures["left behind"] = "nothing"


STEPS: Final[dict[str, Callable[[Hand, Figures], Steps]]] = {
    "first_walk": first_walk,
    "setup": setup_by_picture,
    "live_drag": live_drag,
    "live_slider": live_slider,
    "splice": splice,
    "drop": drop,
    "pose": pose,
    "undisturbed": undisturbed,
    "over_a_motion": over_a_motion,
    "controls": controls,
    "language": language,
    "switched_off": switched_off,
}


# --- What they need -------------------------------------------------------------------------------


def _timed_follow() -> list[float]:
    """Seconds of the processor that the extension takes for each change from now on: what Blender
    draws by software, and other programs, are not in them.
    """
    live: Any = sys.modules[f"{MODULE}.ui.locomotion.operators.generate"]
    follow, taken = live._state.follow, []

    def timed(*arguments: Any, **more: Any) -> None:
        begun = time.thread_time()
        follow(*arguments, **more)
        taken.append(time.thread_time() - begun)

    live._state.follow = timed
    return taken


def speak(language: str) -> None:
    """Let Blender speak a language: interface, tooltips and reports, not names of new data."""
    view: Any = bpy.context.preferences.view
    view.language = language
    view.use_translate_interface = view.use_translate_tooltips = language != "en_US"
    view.use_translate_reports, view.use_translate_new_dataname = language != "en_US", False


def _modal(name: str) -> bool:
    return any(
        each is not None and each.bl_idname.startswith(name)
        for window in bpy.context.window_manager.windows
        for each in window.modal_operators
    )


def _begin_session(hand: Hand) -> Steps:
    yield from hand.search("Pose by Hand")
    yield 2.0
    check(_modal("OCTO_MOTION_OT_pose"), "The session has not begun.")


def _pull(
    hand: Hand,
    creature: Any,
    bone: str,
    *,
    still: float,
    way: tuple[float, float] = (2.0, 6.0),
    picture: str = "",
) -> Steps:
    """Drag a bone by 25 times so many pixels, and hold it still for some seconds, in which a
    picture may be taken, before letting go.
    """
    start = hand.pixel(creature.matrix_world @ creature.pose.bones[bone].head)
    yield from hand.move(*start)
    hand.event("LEFTMOUSE", "PRESS")
    yield PAUSE
    for number in range(25):
        yield from hand.move(start[0] + way[0] * number, start[1] + way[1] * number)
    yield still
    if picture:
        yield from hand.take(picture)
    hand.event("LEFTMOUSE", "RELEASE")
    yield 0.3


def _apart(one: Any, other: Any) -> float:
    return dist(tuple(one), tuple(other))


def _farthest(some: list[tuple[float, ...]], others: list[tuple[float, ...]]) -> float:
    return max(dist(one, other) for one, other in zip(some, others, strict=True))


def _values(curve: Any) -> list[tuple[float, float]]:
    return [tuple(key.co) for key in curve.keyframe_points]


def curves(action: Any) -> list[Any]:
    if action is None:
        return []
    bags = [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
    return [curve for bag in bags for curve in bag.fcurves]


def new_file(hand: Hand) -> None:
    """An empty scene, without a question."""
    for each in list(bpy.data.objects):
        bpy.data.objects.remove(each)
    data: Any = bpy.data
    for kind in (data.armatures, data.curves, data.actions, data.meshes):
        for each in list(kind):
            kind.remove(each)
    bpy.context.scene.frame_set(1)
    hand.redraw()


_BONES: Final = {
    "Hips": ("", (0.0, 0.0, 1.0), (0.0, 0.0, 1.1)),
    "Spine": ("Hips", (0.0, 0.0, 1.1), (0.0, 0.0, 1.35)),
    "Chest": ("Spine", (0.0, 0.0, 1.35), (0.0, 0.0, 1.5)),
    "Neck": ("Chest", (0.0, 0.0, 1.5), (0.0, 0.0, 1.6)),
    "Head": ("Neck", (0.0, 0.0, 1.6), (0.0, 0.0, 1.8)),
    "{}Shoulder": ("Chest", (0.03, 0.0, 1.48), (0.15, 0.0, 1.48)),
    "{}Arm": ("{}Shoulder", (0.15, 0.0, 1.48), (0.45, 0.0, 1.48)),
    "{}ForeArm": ("{}Arm", (0.45, 0.0, 1.48), (0.7, 0.0, 1.48)),
    "{}Hand": ("{}ForeArm", (0.7, 0.0, 1.48), (0.85, 0.0, 1.48)),
    "{}UpLeg": ("Hips", (0.1, 0.0, 1.0), (0.1, -0.01, 0.55)),
    "{}Leg": ("{}UpLeg", (0.1, -0.01, 0.55), (0.1, 0.02, 0.1)),
    "{}Foot": ("{}Leg", (0.1, 0.02, 0.1), (0.1, -0.15, 0.02)),
}


def person(name: str, aside: float, *, wave: bool) -> Any:
    """Somebody who walks on the spot, or waves."""
    armature: Any = bpy.data.objects.new(name, bpy.data.armatures.new(name))
    bpy.context.scene.collection.objects.link(armature)
    armature.location.x = aside
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    for pattern, (above, head, tail) in _BONES.items():
        for side, sign in (("Left", 1.0), ("Right", -1.0)) if "{}" in pattern else (("", 1.0),):
            bone = armature.data.edit_bones.new(pattern.format(side))
            bone.head, bone.tail = ((sign * x, y, z) for x, y, z in (head, tail))
            if above:
                bone.parent = armature.data.edit_bones[above.format(side)]
    bpy.ops.object.mode_set(mode="POSE")
    for bone in armature.pose.bones:
        bone.rotation_mode = "XYZ"
    for frame in range(1, 121, 5):
        phase = 2.0 * pi * (frame - 1) / 40.0
        for side, sign in (("Left", 1.0), ("Right", -1.0)):
            turns = {"UpLeg": 0.5 * sign * sin(phase), "Leg": 0.4 + 0.3 * sign * cos(phase)}
            turns["Arm"] = -0.9 + (0.7 * sin(2.0 * phase) + 1.2 if wave else 0.2 * sin(phase))
            for part, angle in turns.items():
                bone = armature.pose.bones[f"{side}{part}"]
                bone.rotation_euler.x = angle
                bone.keyframe_insert("rotation_euler", frame=frame)
    bpy.ops.object.mode_set(mode="OBJECT")
    armature.animation_data.action.name = f"{name} Clip"
    return armature


def led_by_empties() -> tuple[Any, list[Any]]:
    """Somebody whose legs reach for empties and bend towards others; and these."""
    somebody = person("Led", 0.0, wave=False)
    somebody.animation_data_clear()
    bones, empties = somebody.pose.bones, list[Any]()
    for bone in bones:
        bone.rotation_euler = (0.0, 0.0, 0.0)
    for side in ("Left", "Right"):
        constraint: Any = bones[f"{side}Leg"].constraints.new("IK")
        places = {"Goal": bones[f"{side}Leg"].tail, "Pole": bones[f"{side}Leg"].head}
        for kind, place in places.items():
            empty: Any = bpy.data.objects.new(f"{side} {kind}", None)
            bpy.context.scene.collection.objects.link(empty)
            empty.location, empty.empty_display_size = place, 0.05
            empties.append(empty)
        empties[-1].location.y -= 0.8
        constraint.target, constraint.pole_target = empties[-2:]
        constraint.chain_count, constraint.pole_angle = 2, -0.5 * pi
    select(somebody)
    return somebody, empties


def main(folder: Path, language: str, names: list[str]) -> None:
    """Begin; Blender ends when all is over."""
    view: Any = bpy.context.preferences.view
    view.show_splash, view.smooth_view = False, 0
    speak(language)
    hand = Hand(folder)
    seen = {"blender": f"Blender {bpy.app.version_string}", "python": platform.python_version()}
    (folder / "blender.json").write_text(json.dumps(seen), encoding="utf-8")
    report: list[Figures] = []

    def all_steps() -> Steps:
        chosen = names or list(STEPS)
        for name in chosen:
            figures: Figures = {}
            problem = ""
            try:
                yield from STEPS[name](hand, figures)
            except Exception as error:  # noqa: BLE001 - the next step is to be tried all the same
                problem = str(error) if isinstance(error, HandError) else traceback.format_exc()
                hand.event("ESC", "PRESS")
                hand.event("ESC", "RELEASE")
                yield 1.0
                yield from hand.take(f"{name}_failed")
            report.append(
                {
                    "step": name,
                    "ok": not problem,
                    "problem": problem,
                    "figures": figures,
                    "last": name == chosen[-1],
                }
            )
            (folder / "report.json").write_text(json.dumps(report, indent=2), encoding="utf-8")

    steps = all_steps()

    def play() -> float:
        try:
            return next(steps)
        except StopIteration:
            sys.stdout.flush()
            # Not by its own way out: that would ask about what is not saved.
            os._exit(0)

    bpy.app.timers.register(play, first_interval=2.0, persistent=True)


if __name__ == "__main__":
    begins = sys.argv.index("--") + 1
    main(Path(sys.argv[begins]), sys.argv[begins + 1], sys.argv[begins + 3 :])
