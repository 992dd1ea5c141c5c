# SPDX-License-Identifier: GPL-3.0-or-later
"""A job of short shots, a Blender that farms can start, and what must hold when they are done."""

from __future__ import annotations

import json
import sys
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

REPOSITORY: Final = Path(__file__).resolve().parent.parent.parent

HEAD: Final = """[defaults]
output = "out/{name}.blend"
octopus = { arms = 4, joints = 3, with_mesh = false }
route = [[0, 0, 0], [0, -1, 0], [1, -1, 0], [2, -1, 0]]
settings = { timing = "RANGE", frame_end = 6 }
"""


def make_job(folder: Path, shots: int) -> Path:
    """A job of so many short shots, each with a seed of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "job.toml"
    tables = (
        f'[[shots]]\nname = "s{number:04}"\nsettings = {{ seed = {number}, variation_max = 0.2 }}\n'
        for number in range(1, shots + 1)
    )
    path.write_text(HEAD + "".join(tables), encoding="utf-8")
    return path


def blender(folder: Path) -> Path:
    """A program with the words of `blender --background --command octo_motion`: Blender as a Python
    module. Each start that makes shots is noted in `starts`, and a file `slow` lets the next of
    them sleep.
    """
    path = folder / "blender"
    path.write_text(
        f"""#!/bin/sh
shift 3
case "$*" in *--index*)
    echo $$ >> '{folder}/starts'
    if rm '{folder}/slow' 2>/dev/null; then exec sleep 600; fi ;;
esac
PYTHONPATH='{REPOSITORY}' exec '{sys.executable}' -m octo_motion "$@"
""",
        encoding="utf-8",
    )
    path.chmod(0o755)
    return path


def told(job: Path) -> dict[str, dict[str, Any]]:
    """The shots of the report."""
    content = json.loads(job.with_suffix(".report.json").read_text(encoding="utf-8"))
    return {shot["name"]: shot for shot in content["shots"]}


def losses(job: Path, shots: int) -> list[str]:
    """What is not as it must be: a shot that is not done, twice there, or not what its record says,
    and anything in the folder that is no shot's.
    """
    found = told(job)
    wrong = [f"{len(found)} of {shots} shots are in the report"] if len(found) != shots else []
    written: set[str] = set()
    for name, shot in found.items():
        if shot["status"] == "failed":
            wrong.append(f"{name}: {shot['error']}")
        for path, digest in shot["outputs"].items():
            file = job.parent / path
            if not file.is_file() or sha256(file.read_bytes()).hexdigest() != digest:
                wrong.append(f"{name}: {path} is not what its record says")
            written.add(file.name)
    extra = {each.name for each in (job.parent / "out").iterdir()} - written
    return wrong + [f"{name} is nobody's" for name in sorted(extra)]
