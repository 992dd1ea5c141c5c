# SPDX-License-Identifier: GPL-3.0-or-later
"""How fast splices are built and clips retargeted, from the button to the action, and how fast a
drag follows the mouse.

A body of 65 bones, fingers included, all of them moving, gets the legs of another one with their
travel, its right arm and its head; then all of it. Each measurement has a process of its own.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from tests.bench.comparison import parts_lines

FRAMES: Final = (1000, 10_000)
_PARTS: Final = ("LEGS", "RIGHT_ARM", "HEAD")
_DRAGGED: Final = ("RIGHT_ARM", "LEFT_ARM", "LEGS", "LEGS with travel", "TRUNK", "HEAD")
_MOVES: Final = 200
_FINGERS: Final = ("thumb", "index", "middle", "ring", "little")
_TWISTS: Final = ("upper_arm.L", "upper_arm.R", "thigh.L", "thigh.R")

Measured = dict[str, Any]


@dataclass
class Result:
    """What one process showed."""

    frames: int
    bones: int
    seconds: float
    """From the button to a new action."""
    cpu_seconds: float
    """The same by the processor's time, which other programs disturb less than the clock's."""
    again: float
    """The same when the action is made anew in place."""
    parts: dict[str, float]
    """Seconds of the first one by what they were spent on."""
    megabytes: float
    """Peak of the process, Blender itself included."""
    drag: dict[str, tuple[float, float]]
    """Milliseconds of a mouse move by part: the median, and the slowest."""
    retarget: tuple[float, float]
    """Seconds from the button **Retarget Clip** to a new action, and the processor's."""


def measure(repeat: int = 2) -> list[Measured]:
    """The fastest of some runs of each number of frames."""
    return [
        min((_measure(frames) for _ in range(repeat)), key=lambda each: each["seconds"])
        for frames in FRAMES
    ]


def text(results: Any) -> str:
    """The tables."""
    lines = [
        f"Splicing onto {results[0]['bones']} bones: legs with travel, an arm, the head",
        (
            f"{'frames':>8} {'seconds':>9} {'processor':>10} {'anew':>9} "
            f"{'ms/frame':>9} {'peak MB':>9}"
        ),
    ]
    lines += [
        f"{each['frames']:>8} {each['seconds']:>9.2f} {each['cpu_seconds']:>10.2f} "
        f"{each['again']:>9.2f} "
        f"{1000.0 * each['seconds'] / each['frames']:>9.2f} {each['megabytes']:>9.0f}"
        for each in results
    ]
    lines += ["", *parts_lines(results[-1]), ""]
    lines += [
        "The whole clip retargeted: all parts, travel, foot lock",
        f"{'frames':>8} {'seconds':>9} {'processor':>10}",
    ]
    lines += [
        f"{each['frames']:>8} {each['retarget'][0]:>9.2f} {each['retarget'][1]:>10.2f}"
        for each in results
    ]
    lines += [
        "",
        f"A move of the mouse while a timing is dragged, {results[0]['frames']} frames",
        f"{'part':>20} {'median ms':>10} {'slowest':>9}",
    ]
    lines += [
        f"{part:>20} {median:>10.1f} {slowest:>9.1f}"
        for part, (median, slowest) in results[0]["drag"].items()
    ]
    return "\n".join(lines)


def _measure(frames: int) -> Measured:
    with tempfile.TemporaryDirectory(prefix="octo-motion-bench-") as folder:
        path = Path(folder) / "result.json"
        finished = subprocess.run(
            [sys.executable, "-m", "tests.bench.splice_speed", str(path), str(frames)],
            capture_output=True,
            encoding="utf-8",
            check=False,
        )
        if finished.returncode != 0 or not path.exists():
            sys.exit(f"Splicing {frames} frames failed:\n{finished.stderr}")
        return json.loads(path.read_text(encoding="utf-8"))


# --- One process ----------------------------------------------------------------------------------


def _body(name: str, scale: float) -> Any:
    """An armature of 65 bones with Euler angles, as files of motion capture have them."""
    import bpy

    from octo_motion.core.splicing.humanoid.landmarks import LANDMARKS
    from tests.core.humanoids import humanoid

    skeleton = humanoid({each: each for each in LANDMARKS}, scale=scale)
    armature: Any = bpy.data.objects.new(name, bpy.data.armatures.new(name))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    bones = armature.data.edit_bones
    for number, bone_name in enumerate(skeleton.names):
        bone = bones.new(bone_name)
        bone.tail = (0.0, 0.0, skeleton.lengths[number])
        bone.matrix = skeleton.rest_matrices[number].T.tolist()
        if skeleton.parents[number] >= 0:
            bone.parent = bones[skeleton.parents[number]]
    for side in "LR":
        for place, finger in enumerate(_FINGERS):
            parent = bones[f"hand.{side}"]
            along = 0.03 * scale * parent.vector.normalized()
            start = parent.tail + type(along)((0.0, 0.02 * scale * (place - 2), 0.0))
            for joint in range(4):
                bone = bones.new(f"{finger}_{joint + 1}.{side}")
                bone.parent, bone.head, bone.tail = parent, start, start + along
                parent, start = bone, bone.tail.copy()
    for limb in _TWISTS:
        bone = bones.new(f"twist_{limb}")
        bone.parent = bones[limb]
        bone.head, bone.tail = bones[limb].head, bones[limb].center
    bpy.ops.object.mode_set(mode="OBJECT")
    for bone in armature.pose.bones:
        bone.rotation_mode = "XYZ"
    return armature


def _move(armature: Any, frames: int, seed: int) -> None:
    """Let all bones swing, and the body walk away."""
    from octo_motion.blender.animation.actions import MARK
    from octo_motion.blender.animation.clips import write_clip
    from octo_motion.blender.rig.armature import read_skeleton, world_matrix
    from octo_motion.core.rotations import from_rotation_vector
    from octo_motion.core.splicing.clip.clip import Clip

    skeleton = read_skeleton(armature)
    random = np.random.default_rng(seed)
    times = np.arange(1.0, frames + 1.0)
    axes = random.normal(size=(len(skeleton), 3)) * 0.2
    phases = random.uniform(0.0, 6.0, size=len(skeleton))
    swing = np.sin(2.0 * np.pi * times[:, None] / 30.0 + phases)
    locations = np.zeros((frames, len(skeleton), 3))
    locations[:, 0, 2] = -0.03 * times
    world = np.broadcast_to(world_matrix(armature), (frames, 4, 4)).copy()
    rotations = from_rotation_vector(swing[..., None] * axes)
    clip = Clip(armature.name, skeleton, times, 24.0, rotations, locations, world)
    # As if an artist had made it.
    del write_clip(armature, clip)[MARK]


def _run(frames: int) -> Result:
    import bpy

    from octo_motion.blender.animation import actions, kept_curves, spliced_action
    from octo_motion.ui.splicing import stack
    from tests.bench.case import peak_megabytes
    from tests.bench.stopwatch import Place, Stopwatch

    places: dict[str, list[Place]] = {
        "read base and clips": [(stack, "read_clip")],
        "match bones and landmarks": [
            (stack, "known_landmarks"),
            (stack.Splice, "retargets"),
        ],
        "compute": [(stack.Stack, "compute")],
        "keys of what is changed": [
            (spliced_action._Changes, "rotation"),
            (spliced_action._Changes, "vector"),
            (spliced_action, "stretch_keys"),
        ],
        "write keys": [
            (spliced_action, "copy_curve"),
            (spliced_action, "write_stretches"),
            (kept_curves, "write_kept_keys"),
        ],
        "fingerprint of the keys": [(actions, "_keys_digest"), (actions, "_fingerprint")],
    }
    bpy.ops.wm.read_factory_settings(use_empty=True)
    source, hero = _body("Source", 0.85), _body("Hero", 1.0)
    for number, each in enumerate((source, hero)):
        _move(each, frames, number)
    for each in bpy.data.objects:
        each.select_set(state=True)
    operators: Any = bpy.ops.octo_motion
    for part in _PARTS:
        operators.splice_add(part=part)
    hero.octo_motion.splicing.splices[0].with_travel = True
    watch, cpu, start = Stopwatch(), time.process_time(), time.perf_counter()
    with watch.watching(places), watch.measure("all else"):
        operators.splice_build()
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    parts = dict(watch.seconds)
    start = time.perf_counter()
    operators.splice_build()
    again = time.perf_counter() - start
    drag = {part: _dragged(hero, part) for part in _DRAGGED}
    bones, peak = len(hero.data.bones), peak_megabytes()
    return Result(frames, bones, seconds, cpu, again, parts, peak, drag, _retargeted(hero, source))


def _retargeted(hero: Any, source: Any) -> tuple[float, float]:
    """Seconds of the whole clip onto the body, and the processor's."""
    import bpy

    operators: Any = bpy.ops.octo_motion
    bpy.context.view_layer.objects.active = hero
    cpu, start = time.process_time(), time.perf_counter()
    operators.retarget(source=source.name)
    return time.perf_counter() - start, time.process_time() - cpu


def _dragged(hero: Any, part: str) -> tuple[float, float]:
    """Milliseconds of a move of the mouse with one splice of this part: median and slowest."""
    import bpy

    from octo_motion.ui.splicing.stack import prepare_splices
    from octo_motion.ui.splicing.timing_drag import DragSession

    splices = hero.octo_motion.splicing.splices
    while len(splices) > 1:
        splices.remove(1)
    splices[0].part = part.partition(" ")[0]
    splices[0].with_travel, splices[0].mode = "travel" in part, "EXACT"
    scene: Any = bpy.context.scene
    scene.frame_set(scene.frame_start + 500)
    session = DragSession(prepare_splices(hero), 0, scene)
    session.show()
    moves = []
    for number in range(_MOVES):
        session.drag.tick(17.0 if number % 3 else -12.0)
        start = time.perf_counter()
        session.show()
        bpy.context.view_layer.update()
        moves.append(1000.0 * (time.perf_counter() - start))
    session.tear_down()
    return float(np.median(moves)), max(moves)


def main() -> None:
    """Run the case of the command line, or all of them."""
    if len(sys.argv) != 3 or sys.argv[1].startswith("-"):
        parser = argparse.ArgumentParser(description=__doc__)
        parser.add_argument("--repeat", type=int, default=2, help="runs, the fastest counts")
        print(text(measure(parser.parse_args().repeat)))
        return
    import octo_motion

    path, frames = sys.argv[1:]
    octo_motion.register()
    try:
        result = _run(int(frames))
    finally:
        # Blender 4.5 does not end while an operator is registered.
        octo_motion.unregister()
    Path(path).write_text(json.dumps(asdict(result)), encoding="utf-8")


if __name__ == "__main__":
    main()
