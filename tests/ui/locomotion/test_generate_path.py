# SPDX-License-Identifier: GPL-3.0-or-later
"""From the button to the keys: a way short enough to be followed by one who reads it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import FrameType
from typing import Any

import bpy

import octo_motion

PACKAGE = Path(octo_motion.__file__).parent
MODULES = 45
CLIMBS = 4
WORDS = {"core/phrases.py", "ui/language.py"}
"""How something is said in another language, wherever it is said: no step of the way."""
LOADED = """
import sys

import bpy

import octo_motion
from tests.bench.scene import build

octo_motion.register()
build(4, 6, 60, "walk", skin=False)
before = set(sys.modules)
bpy.ops.octo_motion.generate_locomotion()
print("loaded", *sorted(set(sys.modules) - before))
octo_motion.unregister()
"""
LAYERS = ("core", "device", "blender", "ui", "command_line")


def test_generate_passes_few_modules_and_hardly_climbs_back_up() -> None:
    bpy.ops.octo_motion.add_octopus(with_mesh=False)
    octopus: Any = bpy.context.object
    bpy.ops.octo_motion.add_route()
    passed: set[str] = set()
    climbs: set[tuple[str, str]] = set()

    def layer(file: str) -> int:
        return LAYERS.index(file.split("/", maxsplit=1)[0])

    def watch(frame: FrameType, event: str, _: Any) -> None:
        file = frame.f_code.co_filename
        if event != "call" or not file.startswith(f"{PACKAGE}/"):
            return
        here = file.removeprefix(f"{PACKAGE}/")
        if here not in WORDS:
            passed.add(here)
        caller = frame.f_back.f_code.co_filename if frame.f_back is not None else ""
        if caller.startswith(f"{PACKAGE}/"):
            there = caller.removeprefix(f"{PACKAGE}/")
            if layer(here) > layer(there):
                climbs.add((there, here))

    sys.setprofile(watch)
    try:
        bpy.ops.octo_motion.generate_locomotion()
    finally:
        sys.setprofile(None)
    assert octopus.animation_data.action is not None
    assert len(passed) <= MODULES, "\n".join(sorted(passed))
    assert len(climbs) <= CLIMBS, sorted(climbs)


def test_the_first_generate_of_a_session_loads_nothing_of_numpy() -> None:
    # Its masked arrays, which np.unique and np.median ask for, took a tenth of the time.
    shown = subprocess.run(
        [sys.executable, "-c", LOADED],
        cwd=PACKAGE.parent,
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    (line,) = [each for each in shown.stdout.splitlines() if each.startswith("loaded")]
    assert not [each for each in line.split() if each.startswith("numpy")]
