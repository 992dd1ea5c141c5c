# SPDX-License-Identifier: GPL-3.0-or-later
"""Build an octopus that walks and one that swims, and show them.

Each gets a Blender file, a contact sheet of one cycle of its gait, and a video.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path
from typing import Final

_SHOTS: Final = ("walk", "swim")
_FILM: Final = (640, 360)
_PICTURE: Final = (320, 240)


def main() -> None:
    """Make the shots side by side: one alone would leave half of two processors idle."""
    parser = argparse.ArgumentParser(prog="make demo", description=__doc__)
    parser.add_argument("shots", nargs="*", help="walk, swim; both if none is named")
    parser.add_argument("--folder", type=Path, default=Path("build/demo"), help="where it all goes")
    parser.add_argument(
        "--quick", action="store_true", help="tiny pictures and a few frames, to see that it works"
    )
    parser.add_argument("--alone", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    names: list[str] = arguments.shots or list(_SHOTS)
    if unknown := set(names) - set(_SHOTS):
        parser.error(f"there is no shot '{unknown.pop()}', only {' and '.join(_SHOTS)}")
    folder = arguments.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if arguments.alone:
        _make(names[0], folder, quick=arguments.quick)
        return
    start = time.perf_counter()
    print(f"Making {' and '.join(names)}; without a graphics card this takes a minute or two.")
    _start_each(names, folder, quick=arguments.quick)
    print(f"Done in {time.perf_counter() - start:.0f} s:")
    for path, what in ((path, what) for name in names for path, what in _results(folder, name)):
        print(f"  {path}  {what}")


def _results(folder: Path, name: str) -> list[tuple[Path, str]]:
    return [
        (folder / f"{name}.blend", "octopus, route, action, light and camera"),
        (folder / f"{name}.png", "one cycle from the side and from above"),
        (folder / f"{name}.mp4", "video"),
    ]


def _start_each(names: list[str], folder: Path, *, quick: bool) -> None:
    """A process for each shot; Blender's many words go into a file that is shown on failure."""
    running: list[tuple[str, Path, subprocess.Popen[bytes]]] = []
    for name in names:
        log = folder / f"{name}.log"
        command = [sys.executable, __file__, name, "--alone", "--folder", str(folder)]
        with log.open("wb") as output:
            process = subprocess.Popen(
                [*command, "--quick"] if quick else command, stdout=output, stderr=output
            )
        running.append((name, log, process))
    failed = [(name, log) for name, log, process in running if process.wait() != 0]
    for name, log in failed:
        last_words = log.read_text(encoding="utf-8", errors="replace").splitlines()[-20:]
        print(f"The {name} failed:", *last_words, sep="\n  ", file=sys.stderr)
    if failed:
        sys.exit(1)
    for _, log, _ in running:
        log.unlink()


def _make(name: str, folder: Path, *, quick: bool) -> None:
    # The process that starts the others needs no Blender.
    import bpy  # noqa: PLC0415
    import contact_sheet  # noqa: PLC0415
    import film  # noqa: PLC0415
    import shots  # noqa: PLC0415
    import stage  # noqa: PLC0415

    import octo_motion  # noqa: PLC0415

    film_size, picture_size = ((64, 36), (48, 36)) if quick else (_FILM, _PICTURE)
    blend, sheet, video = (path for path, _ in _results(folder, name))
    octo_motion.register()
    try:
        performance = shots.perform(shots.BY_NAME[name], film_size)
        # No backup of the demo before.
        bpy.context.preferences.filepaths.save_version = 0
        bpy.ops.wm.save_as_mainfile(filepath=str(blend), compress=True)
        views = (contact_sheet.SIDE, contact_sheet.ABOVE)
        pixels = [contact_sheet.cycle_pixels(performance, view, picture_size) for view in views]
        stage.save_pixels(contact_sheet.stacked(pixels), sheet)
        if quick:
            stage.the_scene().frame_end = 3
        film.render_film(video, film_size)
    finally:
        # Blender 4.5 does not end while an operator is registered.
        octo_motion.unregister()


if __name__ == "__main__":
    main()
