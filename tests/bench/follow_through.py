# SPDX-License-Identifier: GPL-3.0-or-later
"""How long follow-through takes: tails that follow a body for a thousand frames, on one core.

A body turns to and fro once a second, at 24 frames a second. Tails of ten bones hang on it, or one
of as many as there are; with all settings as they come, and with everything in the way: floor,
gravity, each other, in water.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from typing import Any, Final

import numpy as np

from octo_motion.core.follow_through import FollowJob, FollowSettings, follow
from octo_motion.core.posing.solver import OneThread, Plane
from tests.core.tails import tail_job, wagging

FRAMES: Final = 1000
_SIZES: Final = ((10, 1), (20, 1), (20, 2), (100, 10), (100, 1))
"""Bones, and the tails that they are."""
_BUSY: Final = FollowSettings(material="LIMP", gravity=1.0, medium="WATER", self_collision=True)


def measure() -> list[dict[str, Any]]:
    """Seconds of each."""
    one_thread = OneThread()
    found = []
    for bones, tails in _SIZES:
        for what, settings in (("as it comes", FollowSettings()), ("floor and all", _BUSY)):
            job = _job(bones, tails, settings)
            if settings is _BUSY:
                job = replace(job, obstacles=(Plane(position=np.array([0.0, 0.0, -0.3])),))
            wall, processor = time.perf_counter(), time.process_time()
            for _ in follow(job):
                pass
            found.append(
                {
                    "what": what,
                    "bones": bones,
                    "tails": tails,
                    "seconds": time.perf_counter() - wall,
                    "cpu_seconds": time.process_time() - processor,
                }
            )
    one_thread.end()
    return found


def _job(bones: int, tails: int, settings: FollowSettings) -> FollowJob:
    return tail_job(wagging, settings, count=bones // tails, tails=tails, seconds=(FRAMES - 1) / 24)


def text(results: Any) -> str:
    """The table."""
    lines = [f"{FRAMES} frames {'bones':>24} {'chains':>7} {'seconds':>9} {'processor':>10}"]
    lines += [
        f"{each['what']:<24} {each['bones']:>11} {each['tails']:>7} {each['seconds']:>9.1f} "
        f"{each['cpu_seconds']:>10.1f}"
        for each in results
    ]
    return "\n".join(lines)


def main(_words: list[str]) -> None:
    """Measure and print."""
    print(text(measure()))


if __name__ == "__main__":
    main(sys.argv[1:])
