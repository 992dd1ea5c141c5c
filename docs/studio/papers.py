# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the experiments and figures of the three papers again: pictures, curves and one table.

Everything goes into build/papers. Names make some of it alone; --write keeps the figures and the
pictures for docs/papers.md, and writes that page. Recorded clips and rigs come from the folder of
$OCTO_MOTION_DATA; without it the project's own clips serve, and what needs a rig of others is left
out.
"""

from __future__ import annotations

import argparse
import importlib
import json
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Final

from tests.papers import pages

PAPERS: Final = (pages.OCTOPUS, pages.PLASTIC, pages.SPLICE)
_TOGETHER: Final = 2
"""Papers that are made at a time, each in a process of its own."""


def main() -> None:
    """Make what the command line asks for."""
    parser = argparse.ArgumentParser(prog="make papers", description=__doc__)
    known = list(pages.EXPERIMENTS)
    parser.add_argument(
        "names", nargs="*", help=f"of {', '.join([*PAPERS, *known])}; everything if none is named"
    )
    parser.add_argument("--folder", type=Path, default=Path("build/papers"), help="where it goes")
    parser.add_argument(
        "--quick", action="store_true", help="tiny pictures, few figures: to see that it works"
    )
    parser.add_argument("--write", action="store_true", help="keep it for docs/papers.md")
    parser.add_argument("--pages", action="store_true", help="only write docs/papers.md anew")
    parser.add_argument("--alone", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    for name in arguments.names:
        if name not in known and name not in PAPERS:
            parser.error(f"there is nothing called '{name}'")
    if arguments.write and arguments.quick:
        parser.error("what is made quickly is not worth keeping")
    wanted = [
        name
        for name, each in pages.EXPERIMENTS.items()
        if not arguments.names or name in arguments.names or each.paper in arguments.names
    ]
    folder = arguments.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if arguments.pages:
        pages.keep({})
    elif arguments.alone:
        _make(wanted, folder, quick=arguments.quick)
    else:
        start = time.perf_counter()
        found = _made_side_by_side(wanted, folder, quick=arguments.quick)
        pictures = {name: folder / f"{name}.png" for name in wanted if pages.EXPERIMENTS[name].alt}
        print(pages.printed(found, pictures))
        print(f"\nAll of it is in {folder}, made in {time.perf_counter() - start:.0f} s.")
        if arguments.write:
            _keep(found, pictures)


def _made_side_by_side(wanted: list[str], folder: Path, *, quick: bool) -> dict[str, Any]:
    """A process for each paper, so many at a time; figures by name.

    Blender's many words go into a file that is shown on failure.
    """
    waiting = [
        (paper, [name for name in wanted if pages.EXPERIMENTS[name].paper == paper])
        for paper in PAPERS
    ]
    waiting = [(paper, names) for paper, names in waiting if names]
    running: dict[str, tuple[subprocess.Popen[bytes], Path]] = {}
    failed = []
    while waiting or running:
        while waiting and len(running) < _TOGETHER:
            paper, names = waiting.pop(0)
            log = folder / f"{paper}.log"
            options = ["--alone", "--folder", str(folder), *(["--quick"] if quick else [])]
            with log.open("wb") as output:
                process = subprocess.Popen(
                    [sys.executable, __file__, *names, *options], stdout=output, stderr=output
                )
            running[paper] = process, log
        for paper, (process, log) in list(running.items()):
            if process.poll() is not None:
                del running[paper]
                if process.returncode:
                    failed.append((paper, log))
        time.sleep(0.2)
    for paper, log in failed:
        last_words = log.read_text(encoding="utf-8", errors="replace").splitlines()[-20:]
        print(f"[{paper}] failed:", *last_words, sep="\n  ", file=sys.stderr)
    if failed:
        sys.exit(1)
    found: dict[str, Any] = {}
    for name in wanted:
        path = _figures_file(folder, name)
        if path.exists():
            found[name] = json.loads(path.read_text(encoding="utf-8"))
    return found


def _figures_file(folder: Path, name: str) -> Path:
    return folder / f"{name}.json"


def _make(names: list[str], folder: Path, *, quick: bool) -> None:
    """Make experiments of one paper in this process."""
    # The process that starts the others needs no Blender.
    import stage  # noqa: PLC0415

    import octo_motion  # noqa: PLC0415

    octo_motion.register()
    try:
        for name in names:
            start = time.perf_counter()
            experiment = pages.EXPERIMENTS[name]
            _figures_file(folder, name).unlink(missing_ok=True)
            for figures in pages.measured([name], quick=quick).values():
                text = json.dumps(figures, indent=1, ensure_ascii=False)
                _figures_file(folder, name).write_text(text + "\n", encoding="utf-8")
            if experiment.alt:
                draw = getattr(importlib.import_module(f"papers_{experiment.paper}"), name)
                stage.save_pixels(draw(folder, quick=quick), folder / f"{name}.png")
            print(f"{name}: {time.perf_counter() - start:.1f} s", file=sys.stderr, flush=True)
    finally:
        # Blender 4.5 does not end while an operator is registered.
        octo_motion.unregister()


def _keep(found: dict[str, Any], pictures: dict[str, Path]) -> None:
    """Keep figures and pictures for the page."""
    images = pages.PAGE.parent / pages.IMAGES
    images.mkdir(parents=True, exist_ok=True)
    for path in pictures.values():
        shutil.copyfile(path, images / path.name)
    pages.keep(found)


if __name__ == "__main__":
    main()
