# SPDX-License-Identifier: GPL-3.0-or-later
"""One measurement, in a process of its own so that its peak of memory is its own.

python -m tests.bench.case RESULT.json generate|bake bare|skin ARMS JOINTS FRAMES GAIT
"""

from __future__ import annotations

import importlib
import json
import sys
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

import bpy

import octo_motion
from octo_motion.blender.animation import actions
from octo_motion.core.locomotion.gait import gait_poser as generator
from octo_motion.ui.locomotion.writing import shot as workflow
from tests.bench import blender_way, scene
from tests.bench.stopwatch import Place, Stopwatch

# A module of the same name as the function that its package hands out.
computing = importlib.import_module("octo_motion.core.locomotion.motion.pipeline")

PARTS: dict[str, list[Place]] = {
    "read rig, route, settings": [(workflow, "prepare")],
    "travel along the route": [(computing, "plan_travel"), (computing, "object_transforms")],
    "gait angles and targets": [(generator.GaitPoser, "pose"), (generator, "pseudo_targets")],
    "solve (CCD)": [(generator, "solve_ccd"), (generator, "asked_shape")],
    "joints to bone rotations": [(generator, "rotate_bones")],
    "values of the channels": [(computing, "_motion")],
    "write keys": [(actions, "_write_curves")],
    "fingerprint of the keys": [(actions, "_keys_digest"), (actions, "_fingerprint")],
}


@dataclass
class Result:
    """What one run showed."""

    method: str
    """"generate" is ours, "bake" Blender's."""
    skin: bool
    arms: int
    joints: int
    frames: int
    seconds: float
    """Of the work itself: without starting Blender and building the scene."""
    cpu_seconds: float
    quality: scene.Quality
    megabytes: float
    """Peak of the process while it worked."""
    megabytes_before: float
    """Peak before the work: Blender itself and the rig."""
    parts: dict[str, float] = field(default_factory=dict)
    """Seconds by what they were spent on."""


def run(method: str, arms: int, joints: int, frames: int, gait: str, *, skin: bool) -> Result:
    """Build the scene and measure one way to animate it."""
    armature = scene.build(arms, joints, frames, gait, skin=skin)
    if method == "generate":
        before = peak_megabytes()
        watch = Stopwatch()
        cpu, start = time.process_time(), time.perf_counter()
        with watch.watching(PARTS), watch.measure("all else"):
            bpy.ops.octo_motion.generate_locomotion()
        seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
        after = peak_megabytes()
        wanted = scene.groups(armature)
        parts = dict(watch.seconds)
    else:
        wanted = scene.groups(armature)
        blender_way.rig_with_targets(armature, wanted, frames)
        before = peak_megabytes()
        cpu = time.process_time()
        # On the bare rig Blender is given every advantage; with the skin it is as it comes.
        seconds = blender_way.bake(armature, wanted, frames, rotations_only=not skin)
        cpu = time.process_time() - cpu
        after = peak_megabytes()
        parts = {}
    shown = scene.quality(armature, wanted, frames)
    return Result(
        *(method, skin, arms, joints, frames, seconds, cpu, shown, after, before), parts=parts
    )


def peak_megabytes() -> float:
    """The most memory that this process has had; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return 0.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1024.0**2 if sys.platform == "darwin" else 1024.0)


def main() -> None:
    """Run the case of the command line."""
    path, method, skin, arms, joints, frames, gait = sys.argv[1:]
    octo_motion.register()
    try:
        result = run(method, int(arms), int(joints), int(frames), gait, skin=skin == "skin")
    finally:
        # Blender 4.5 does not end while an operator is registered.
        octo_motion.unregister()
    Path(path).write_text(json.dumps(asdict(result)), encoding="utf-8")


if __name__ == "__main__":
    main()
