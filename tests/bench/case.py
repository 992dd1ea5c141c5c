# SPDX-License-Identifier: GPL-3.0-or-later
"""One measurement, in a process of its own so that its peak of memory is its own.

python -m tests.bench.case RESULT.json '{"way": "generate", "skin": false, "arms": 8, …}'
"""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    import bpy

    from tests.bench.scene import Quality
    from tests.bench.stopwatch import Place

Measured = dict[str, Any]
Way = Literal["generate", "default", "ik", "spline"]
"""Ours with nothing but targets to meet, ours as it comes, or Blender's constraints and bake."""


@dataclass(frozen=True)
class Case:
    """What is measured."""

    way: Way
    frames: int
    skin: bool = False
    """Whether with the octopus's skin; *default* always is."""
    arms: int = 8
    joints: int = 12
    gait: str = "walk"
    look: bool = True
    """Whether to look at how good the motion is, which takes longer than making it."""
    few: bool = False
    """Whether with *Few* keys; of *default* alone."""


@dataclass
class Result:
    """What one run showed."""

    frames: int
    seconds: float
    """Of the work itself: without starting Blender and building the scene."""
    cpu_seconds: float
    megabytes: float
    """Peak of the process while it worked."""
    quality: Quality | None
    parts: dict[str, float] = field(default_factory=dict)
    """Seconds by what they were spent on."""


def measure(case: Case, environment: Mapping[str, str] | None = None) -> Measured:
    """Run a case in a process of its own; what ``Result`` has.

    Raises:
        SystemExit: it failed.
    """
    with tempfile.TemporaryDirectory(prefix="octo-motion-bench-") as folder:
        path = Path(folder) / "result.json"
        finished = subprocess.run(
            [sys.executable, "-m", "tests.bench.case", str(path), json.dumps(asdict(case))],
            capture_output=True,
            encoding="utf-8",
            env={**os.environ, **(environment or {})},
            check=False,
        )
        if finished.returncode != 0 or not path.exists():
            sys.exit(f"{case} failed:\n{finished.stderr}")
        return json.loads(path.read_text(encoding="utf-8"))


def fastest(case: Case, repeat: int, environment: Mapping[str, str] | None = None) -> Measured:
    """The fastest of some runs: whatever disturbs a measurement adds to its time."""
    return min((measure(case, environment) for _ in range(repeat)), key=lambda run: run["seconds"])


def run(case: Case) -> Result:
    """Build the scene and measure one way to animate it, in this process."""
    from tests.bench import scene

    sizes = (case.arms, case.joints, case.frames, case.gait)
    if case.way == "default":
        armature = scene.build_default(*sizes)
        if case.few:
            armature.octo_motion.locomotion.keys = "REDUCED"
    else:
        armature = scene.build(*sizes, skin=case.skin)
    result = _generated() if case.way in ("generate", "default") else _baked(armature, case)
    if case.way == "default":
        settings: Any = armature.octo_motion.locomotion
        first, last = settings.result.frame_range
        result.frames = round(last - first) + 1
    else:
        result.frames = case.frames
        if case.look:
            result.quality = scene.quality(armature, scene.groups(armature), case.frames)
    return result


def _generated() -> Result:
    import bpy

    from tests.bench.stopwatch import Stopwatch

    operators: Any = bpy.ops.octo_motion
    watch, places = Stopwatch(), _places()
    cpu, start = processor_seconds(), time.perf_counter()
    with watch.watching(places), watch.measure("all else"):
        operators.generate_locomotion()
    seconds, cpu = time.perf_counter() - start, processor_seconds() - cpu
    return Result(0, seconds, cpu, peak_megabytes(), None, dict(watch.seconds))


def _baked(armature: bpy.types.Object, case: Case) -> Result:
    from tests.bench import blender_way, scene

    wanted = scene.groups(armature)
    if case.way == "ik":
        blender_way.rig_with_targets(armature, wanted)
    else:
        blender_way.rig_with_curves(armature, scene.curves(armature))
    cpu = time.process_time()
    # On the bare rig Blender is given every advantage; with the skin it is as it comes.
    seconds = blender_way.bake(armature, wanted, case.frames, rotations_only=not case.skin)
    return Result(0, seconds, time.process_time() - cpu, peak_megabytes(), None)


def _places() -> dict[str, list[Place]]:
    """Functions by what they do, for the stopwatch."""
    from octo_motion.blender.animation import actions
    from octo_motion.core.locomotion.gait import gait_poser as generator
    from octo_motion.core.locomotion.ground import walk
    from octo_motion.ui.locomotion.operators import generate

    # A module of the same name as the function that its package hands out.
    computing = importlib.import_module("octo_motion.core.locomotion.motion.pipeline")
    planning = importlib.import_module("octo_motion.core.locomotion.motion.planning")
    return {
        "read rig, route, settings": [(generate, "prepare")],
        "plan: gaits, footholds": [(computing, "plan_motion")],
        "travel along the route": [(computing, "plan_travel"), (computing, "object_transforms")],
        "gait angles and targets": [(generator.GaitPoser, "pose"), (generator, "pseudo_targets")],
        "solve (CCD)": [(generator, "solving_ccd"), (generator, "asked_shape")],
        "joints to bone rotations": [(generator, "rotate_bones")],
        "lay down what holds on": [(walk.GroundedWalk, "posing")],
        "let turns take their time": [(computing, "_taking_time")],
        "body, mantle, siphon, eyes": [(planning, "_self_moving"), (computing, "organs_at")],
        "off the ground between frames": [(computing, "_clearing")],
        "keep arms apart": [(computing, "_separate")],
        "measure the figures": [(computing, "_measuring"), (computing, "finding_figures")],
        "handles, few keys": [(computing, "reduced"), (computing, "measuring_keyed")],
        "values of the channels": [(computing, "_motion")],
        "write keys": [(actions, "_fill_dense"), (actions, "_fill_bezier"), (actions, "_tell")],
        "fingerprint of the keys": [(actions, "_keys_digest"), (actions, "_fingerprint")],
    }


def labels() -> Collection[str]:
    """What the time of a run is spent on, but for all else."""
    return _places()


def processor_seconds() -> float:
    """Seconds of the processor that this process has had, and those that it started and that have
    ended.
    """
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


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
    import octo_motion

    path, asked = sys.argv[1:]
    octo_motion.register()
    try:
        result = run(Case(**json.loads(asked)))
    finally:
        # Blender 4.5 does not end while an operator is registered.
        octo_motion.unregister()
    Path(path).write_text(json.dumps(asdict(result)), encoding="utf-8")


if __name__ == "__main__":
    main()
