# SPDX-License-Identifier: GPL-3.0-or-later
"""How many keys *Few* leaves of a motion, and how long it takes to find them.

The default octopus moves along its default route with each gait of the add-on, at several
tolerances of the bones' angle and of the tips' distance, with key frames for each bone and for
each arm.
"""

from __future__ import annotations

import argparse
import time
from typing import Any, Final

GAITS: Final = ("walk", "hurry", "prowl", "crawl", "swim", "settle")
ANGLES: Final = (0.25, 0.5, 1.0, 2.0)
"""Degrees."""
DISTANCES: Final = (0.005, 0.01)
"""Arm lengths."""
COLUMNS: Final = {"BONE": "each bone", "ARM": "each arm"}


def main(words: list[str]) -> None:
    """Measure what the command line asks for, and print a table."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench keys", description=__doc__)
    parser.add_argument("gaits", nargs="*", default=list(GAITS), help="of these only")
    gaits = parser.parse_args(words).gaits

    import bpy

    import octo_motion

    octo_motion.register()
    try:
        angles = "".join(f"{each:>7g}°" for each in ANGLES)
        print(f"{'times fewer keys, bones within':<32}{angles}   seconds at 0.5°")
        for gait in gaits:
            for columns, name in COLUMNS.items():
                for distance in DISTANCES:
                    found, seconds = zip(
                        *(_measured(bpy, gait, angle, distance, columns) for angle in ANGLES),
                        strict=True,
                    )
                    label = f"{gait}, {name}, tips {distance:g}"
                    shares = "".join(f"{each:>8.1f}" for each in found)
                    print(f"{label:<32}{shares}   {seconds[ANGLES.index(0.5)]:>10.1f}", flush=True)
    finally:
        octo_motion.unregister()


def _measured(
    bpy: Any, gait: str, degrees: float, distance: float, columns: str
) -> tuple[float, float]:
    """How many times fewer keys there are, and the seconds that it takes to find them."""
    import numpy as np

    from octo_motion.ui.locomotion.writing.shot import generate_locomotion

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.octo_motion.add_octopus(with_mesh=False)
    armature = bpy.context.object
    bpy.ops.octo_motion.add_route()
    bpy.context.view_layer.objects.active = armature
    settings = armature.octo_motion.locomotion
    settings.gait, settings.tell_overlaps = gait, False
    seconds = []
    for keys in ("DENSE", "REDUCED"):
        settings.keys = keys
        settings.key_angle, settings.key_distance = np.radians(degrees), distance
        settings.key_columns = columns
        start = time.perf_counter()
        summary = generate_locomotion(armature, bpy.context)
        seconds.append(time.perf_counter() - start)
    return summary.dense_keys / summary.keys, seconds[1] - seconds[0]
