# SPDX-License-Identifier: GPL-3.0-or-later
"""Take the documentation's pictures of Blender's own window, into docs/images.

Blender itself runs this, with its window:

    blender --factory-startup --enable-event-simulate --python docs/studio/window.py -- [NAMES]
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NoReturn, TextIO

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent))

import stage
import window_devices
import window_scenes
from screen import Steps, WindowError

import octo_motion

PICTURES: Final[dict[str, Callable[[], window_scenes.Taking]]] = {
    "panel": window_scenes.panel,
    "gait_table": window_scenes.gait_table,
    "targets": window_scenes.targets,
    "splicing": window_scenes.splicing,
    "posing": window_scenes.posing,
    "device_hand": window_devices.four_moments,
    "calibrate": window_devices.calibrate,
}
"""By file name."""


def main(arguments: Sequence[str]) -> None:
    """Begin to take all pictures, or those that are named; Blender ends when they are there."""
    parser = argparse.ArgumentParser(prog="make window", description=__doc__)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(PICTURES)}; all if none is named")
    parser.add_argument("--folder", type=Path, default=Path("docs/images"), help="where they go")
    chosen = parser.parse_args(arguments)
    if unknown := set(chosen.names) - set(PICTURES):
        parser.error(f"there is no picture '{unknown.pop()}'")
    if bpy.app.background:
        sys.exit("These are pictures of Blender's window: run `make window` with a display.")
    if not bpy.app.use_event_simulate:
        sys.exit("Start Blender with --enable-event-simulate, as `make window` does.")
    folder = chosen.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    # Blender tells of everything that it does; here only the pictures matter.
    told = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    assert bpy.context.preferences is not None
    assert bpy.context.preferences.view is not None
    bpy.context.preferences.view.show_splash = False
    octo_motion.register()
    _play(_all_pictures(chosen.names or list(PICTURES), folder, told))


def _all_pictures(names: Sequence[str], folder: Path, told: TextIO) -> Steps:
    for name in names:
        start = time.perf_counter()
        path = folder / f"{name}.png"
        pixels = yield from PICTURES[name]()
        stage.save_pixels(pixels, path)
        size = path.stat().st_size // 1000
        seconds = time.perf_counter() - start
        print(f"{path}  {size} kB, {seconds:.0f} s", file=told, flush=True)


def _play(steps: Steps) -> None:
    """Take one step after the other, with Blender drawing in between."""

    def step() -> float:
        try:
            return next(steps)
        except StopIteration:
            _end(0)
        except WindowError as error:
            print(error, file=sys.stderr)
        except Exception:  # noqa: BLE001 - a timer that fails would leave the window open for ever
            traceback.print_exc()
        _end(1)

    # Persistent: every picture begins with a new file.
    bpy.app.timers.register(step, first_interval=1.0, persistent=True)


def _end(status: int) -> NoReturn:
    """End Blender, but not by its own way out: that would write over the user's last session."""
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
