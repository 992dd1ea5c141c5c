# SPDX-License-Identifier: GPL-3.0-or-later
"""How fast a walk follows a change while it is live, and what holding a ground costs.

The default octopus with its skin walks for 250 frames, along a route that is level, over a mesh
with bumps of 40,000 faces, and with a change of gait where the ground is far below. A live change
is timed from before the change to when Blender has evaluated the frame in sight: nothing is left
but to draw it. All other frames follow while Blender idles, outside of that time, in slices: the
longest of each change is told, with what Blender works out anew itself. All in one process of its
own.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

FRAMES: Final = 250
_CHANGES: Final = 15
_CELLS: Final = 200
_FOLLOWS: Final = 1e-4
"""Seconds above which something has followed."""

Measured = dict[str, Any]


def measure() -> list[Measured]:
    """In a process of its own."""
    with tempfile.TemporaryDirectory(prefix="octo-motion-bench-") as folder:
        path = Path(folder) / "result.json"
        finished = subprocess.run(
            [sys.executable, "-m", "tests.bench.live_speed", str(path)],
            capture_output=True,
            encoding="utf-8",
            check=False,
        )
        if finished.returncode != 0 or not path.exists():
            sys.exit(f"Measuring live motion failed:\n{finished.stderr}")
        results: list[Measured] = json.loads(path.read_text(encoding="utf-8"))
    return results


def text(results: Any) -> str:
    """The table."""
    lines = [
        f"The default octopus with its skin, {FRAMES} frames",
        f"{'':>44} {'seconds':>9} {'slowest':>9} {'processor':>10} {'slice':>7}",
    ]
    lines += [
        f"{each['what']:<44} {each['seconds']:>9.3f} {each['slowest']:>9.3f} "
        f"{each['cpu_seconds']:>10.3f} {_slice(each['slice'])}".rstrip()
        for each in results
    ]
    note = (
        f"median of {_CHANGES} changes; processor: by the processor's time, likewise; slice: in "
        "which other frames follow, the longest of a change"
    )
    return "\n".join([*lines, "", note])


def _slice(seconds: float) -> str:
    """As a cell; empty where nothing follows."""
    return f"{seconds:>7.4f}" if seconds > _FOLLOWS else ""


# --- One process ----------------------------------------------------------------------------------


def _octopus() -> Any:
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    operators: Any = bpy.ops.octo_motion
    operators.add_octopus()
    operators.add_route()
    armature = next(each for each in bpy.data.objects if each.type == "ARMATURE")
    bpy.context.view_layer.objects.active = armature
    settings: Any = armature.octo_motion.locomotion
    settings.timing, settings.frame_end = "RANGE", FRAMES
    bpy.context.scene.frame_set(FRAMES // 2)
    return armature


def _bumps() -> Any:
    """A mesh of 20 m with bumps of 0.08 m."""
    import bpy

    bpy.ops.mesh.primitive_grid_add(x_subdivisions=_CELLS, y_subdivisions=_CELLS, size=20.0)
    ground: Any = bpy.context.object
    points = np.empty((len(ground.data.vertices), 3), dtype=np.float32)
    ground.data.vertices.foreach_get("co", points.ravel())
    points[:, 2] = 0.08 * np.sin(3.0 * points[:, 0]) * np.cos(2.5 * points[:, 1])
    ground.data.vertices.foreach_set("co", points.ravel())
    ground.data.update()
    return ground


def _timed(what: str, change: Callable[[int], None]) -> Measured:
    seconds, processor, slices = [], [], []
    # The first of its kind fills what is kept for the next.
    for number in range(_CHANGES + 1):
        cpu, start = time.process_time(), time.perf_counter()
        change(number)
        seconds.append(time.perf_counter() - start)
        processor.append(time.process_time() - cpu)
        slices.append(_followed())
    return {
        "what": what,
        "seconds": float(np.median(seconds[1:])),
        "slowest": max(seconds[1:]),
        "cpu_seconds": float(np.median(processor[1:])),
        "slice": float(np.median(slices[1:])),
    }


def _followed() -> float:
    """Seconds of the longest slice in which all other frames follow; 0 where there are none."""
    import bpy

    from octo_motion.ui.locomotion.operators import generate as live

    longest, going = 0.0, True
    if live.pending():
        bpy.app.timers.unregister(live.run_pending)
    while going:
        start = time.perf_counter()
        going = live.run_following() is not None
        longest = max(longest, time.perf_counter() - start)
    live.finish_following()
    return longest


def _follow(armature: Any, *, tagged: bool = True) -> None:
    """Let the frame in sight catch up with a change, of its settings or of another object."""
    import bpy

    from octo_motion.ui.locomotion.operators import generate as live

    if tagged:
        armature.update_tag(refresh={"OBJECT"})
    bpy.context.view_layer.update()
    live.run_pending()
    assert armature.octo_motion.locomotion.live
    assert not armature.octo_motion.locomotion.live_error


def _route(armature: Any) -> Callable[[int], None]:
    point = armature.octo_motion.locomotion.route.data.splines[0].bezier_points[-1]

    def change(_number: int) -> None:
        point.co.x += 0.02
        _follow(armature, tagged=False)

    return change


def _slider(armature: Any) -> Callable[[int], None]:
    def change(number: int) -> None:
        armature.octo_motion.locomotion.softness = 0.3 + 0.02 * number
        _follow(armature)

    return change


def _ground(armature: Any) -> Callable[[int], None]:
    def change(_number: int) -> None:
        armature.octo_motion.locomotion.ground.object.location.x += 0.05
        _follow(armature, tagged=False)

    return change


def _run() -> list[Measured]:
    import bpy

    operators: Any = bpy.ops.octo_motion

    def generate(_number: int) -> None:
        operators.generate_locomotion()

    results: list[Measured] = []
    armature = _octopus()
    settings = armature.octo_motion.locomotion
    settings.ground.use = False
    results.append(_timed("generate, no ground held", generate))
    settings.ground.use = True
    results.append(_timed("generate, ground at the route", generate))
    settings.ground.object = _bumps()
    bpy.context.view_layer.objects.active = armature
    results.append(_timed("generate, bumpy mesh", generate))
    settings.change.by = "HEIGHT"
    results.append(_timed("generate, bumpy mesh, change by height", generate))
    armature = _octopus()
    armature.octo_motion.locomotion.live = True
    _follow(armature)
    results.append(_timed("live, a point of the route", _route(armature)))
    results.append(_timed("live, a slider", _slider(armature)))
    armature.octo_motion.locomotion.ground.object = _bumps()
    _follow(armature)
    results.append(_timed("live, bumpy mesh, a point of the route", _route(armature)))
    results.append(_timed("live, bumpy mesh, a slider", _slider(armature)))
    results.append(_timed("live, the bumpy mesh itself", _ground(armature)))
    return results


def main() -> None:
    """Measure in this process."""
    import octo_motion

    octo_motion.register()
    try:
        results = _run()
    finally:
        # Blender 4.5 does not end while an operator is registered.
        octo_motion.unregister()
    Path(sys.argv[1]).write_text(json.dumps(results), encoding="utf-8")


if __name__ == "__main__":
    main()
