# SPDX-License-Identifier: GPL-3.0-or-later
"""Install the zip into an empty user folder, and let a Blender with a window live the first hour.

    python -m tests.window ARCHIVE [STEPS] [--language ja_JP] [--folder build/window] [--keep]

BLENDER names the Blender, options may follow it. Where there is none, or no display, that is said
and nothing is tried. Each step leaves pictures and a line in report.json; hour.png shows the
pictures of all of them, in their order.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from tests.bench.pages import machine
from tests.window import kept

HERE = Path(__file__).resolve().parent
CLIPS = HERE.parent.parent / "docs" / "examples" / "clips"
COLUMNS = 4
WINDOWS = platform.system() == "Windows"
PATIENCE = 1800.0
"""Seconds: drawn by software, each picture takes one or more."""


def main(arguments: Sequence[str]) -> int:
    """Run it; 0 where all steps went well, or where there is no window."""
    parser = argparse.ArgumentParser(prog="make test-window", description=__doc__)
    parser.add_argument("archive", type=Path, help="the extension's zip")
    parser.add_argument("steps", nargs="*", help="of the first hour; all if none is named")
    parser.add_argument("--language", default="en_US", help="that Blender speaks, such as ja_JP")
    parser.add_argument("--folder", type=Path, default=Path("build/window"))
    parser.add_argument(
        "--keep", action="store_true", help="in docs/first_hour.md, if it went well"
    )
    chosen = parser.parse_args(arguments)
    if chosen.keep and chosen.steps:
        parser.error("Only the whole hour is kept: name no steps, or leave out --keep.")
    words = shlex.split(os.environ.get("BLENDER") or "blender", posix=not WINDOWS)
    if missing := no_window(words[0]):
        print(f"Not tried in a window: {missing}")
        return 0
    folder, begun = chosen.folder.resolve(), machine()
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "user").mkdir(parents=True)
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(folder / "user")}
    install = ("extension", "install-file", "--repo", "user_default", "--enable")
    subprocess.run(
        [*words, "--background", "--command", *install, str(chosen.archive.resolve())],
        env=environment,
        check=True,
    )
    options = ("--enable-event-simulate", "--window-fullscreen")
    given = (str(folder), chosen.language, str(CLIPS), *chosen.steps)
    with (folder / "said.txt").open("w", encoding="utf-8") as said:
        ended = subprocess.run(
            [*words, *options, "--python", str(HERE / "hour.py"), "--", *given],
            env=environment,
            stdout=said,
            stderr=subprocess.STDOUT,
            check=False,
            timeout=PATIENCE,
        )
    join(sorted(folder.glob("*.png"), key=os.path.getmtime), folder / "hour.png")
    status = told(folder, ended.returncode)
    if chosen.keep and status == 0:
        print(f"Kept: {kept.keep(folder, chosen.language, begun)}")
    return status


def join(pictures: Sequence[Path], path: Path) -> None:
    """One sheet of them all, four beside each other, at half their size."""
    if not pictures:
        return
    small = []
    for each in pictures:
        image: Any = bpy.data.images.load(str(each))
        width, height = image.size
        pixels = np.empty(width * height * 4, dtype=np.float32)
        image.pixels.foreach_get(pixels)
        even = pixels.reshape(height, width, 4)[: height // 2 * 2, : width // 2 * 2]
        small.append(even.reshape(height // 2, 2, width // 2, 2, 4).mean(axis=(1, 3)))
    small += [np.ones_like(small[0])] * (-len(small) % COLUMNS)
    rows = [
        np.concatenate(small[at : at + COLUMNS], axis=1) for at in range(0, len(small), COLUMNS)
    ]
    # Blender's pictures begin at the bottom.
    sheet = np.concatenate(rows[::-1], axis=0)
    image = bpy.data.images.new("Hour", sheet.shape[1], sheet.shape[0])
    image.pixels.foreach_set(sheet.ravel())
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()


def no_window(blender: str) -> str:
    """Why there is no Blender with a window, "" if there is."""
    if shutil.which(blender) is None:
        return f"there is no '{blender}'; name one, as in make test-window BLENDER=/path/to/blender"
    own = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if platform.system() == "Linux" and not own and blender == "blender":
        return "there is no display"
    return ""


def told(folder: Path, status: int) -> int:
    """Say how it went; 0 if all went well."""
    report = folder / "report.json"
    if not report.exists():
        print((folder / "said.txt").read_text(encoding="utf-8", errors="replace")[-4000:])
        print(f"Blender ended with {status} before the first step was over.")
        return 1
    steps = json.loads(report.read_text(encoding="utf-8"))
    for each in steps:
        words = "; ".join(f"{name} {value}" for name, value in each["figures"].items())
        print(f"{'ok  ' if each['ok'] else 'FAIL'} {each['step']}: {words or each['problem']}")
        if not each["ok"] and words:
            print(f"     {each['problem']}")
    said = (folder / "said.txt").read_text(encoding="utf-8", errors="replace")
    errors = [line for line in said.splitlines() if line.startswith(("Traceback", "Error: Python"))]
    if errors:
        print(f"Blender's console has {len(errors)} faults: {folder / 'said.txt'}")
    print(f"Pictures: {folder}")
    return int(bool(errors) or not steps[-1]["last"] or not all(each["ok"] for each in steps))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
