# SPDX-License-Identifier: GPL-3.0-or-later
"""One shot in a Blender of its own, and how to start that Blender."""

from __future__ import annotations

import json
import os
import shutil
import sys
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import bpy

from ..core.errors import OctoMotionError
from ..ui.locomotion import Summary
from .command_line import COMMAND
from .outputs import remove_staged, write_json
from .processes import dying_with_parent
from .quality_limits import LimitError, quality
from .shot_request import ShotRequest
from .shot_runner import AnySummary, perform

RUN_SHOT: Final = "--run-shot"
"""First argument of a process that makes one shot; the paths of request and answer follow."""

_PACKAGE: Final = __name__.removesuffix(".command_line.worker")


def child_command(request: Path, answer: Path) -> list[str]:
    """The command that makes one shot in another Blender like this one."""
    arguments = [RUN_SHOT, str(request), str(answer)]
    if not bpy.app.binary_path:
        return [sys.executable, "-m", _PACKAGE, *arguments]
    factory = ["--factory-startup"] if bpy.app.factory_startup else []
    # Named once more: it may have been enabled for this session alone.
    command = [*factory, "--addons", _PACKAGE, "--command", COMMAND]
    return [bpy.app.binary_path, "--background", *command, *arguments]


def child_environment(scratch: Path) -> dict[str, str]:
    """Environment in which another Python finds this package.

    Args:
        scratch: folder for temporary files; a Blender that is killed leaves its own there.
    """
    root = Path(__file__).resolve().parents[1 + len(_PACKAGE.split("."))]
    paths = [str(root), *filter(None, [os.environ.get("PYTHONPATH", "")])]
    temporary = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(scratch))
    python = {"PYTHONPATH": os.pathsep.join(paths), "PYTHONUNBUFFERED": "1"}
    return {**os.environ, **temporary, **python}


def write_request(path: Path, shot: ShotRequest, places: Mapping[Path, Path]) -> None:
    """Write down what a process is to do; ``run_shot`` does it."""
    plain = {str(output): str(place) for output, place in places.items()}
    write_json(path, {"shot": shot.to_plain(), "places": plain})


def read_answer(path: Path) -> dict[str, Any]:
    """What a process has said of its shot, nothing if it ended before it could.

    ``error`` if it failed, ``libraries`` that it has read, and what a report says of the motion.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}


def run_shot(request: Path, answer: Path) -> int:
    """Make the shot that is asked for, in the process of its own; the exit status."""
    asked = json.loads(request.read_text(encoding="utf-8"))
    shot = ShotRequest.from_plain(asked["shot"])
    places = {Path(output): Path(place) for output, place in asked["places"].items()}

    def clean_up() -> None:
        for place in places.values():
            remove_staged(place)
        # Requests, answers and logs of a run that is no more.
        shutil.rmtree(request.parent, ignore_errors=True)

    said: dict[str, Any]
    try:
        with dying_with_parent(clean_up):
            performed = perform(shot, places)
        said = {**_said(performed.summary), "libraries": performed.libraries}
    except LimitError as error:
        said = {"error": str(error), **_said(error.summary)}
    except OctoMotionError as error:
        said = {"error": str(error)}
    except Exception as error:  # noqa: BLE001 - a fault of ours is one shot's, and is told
        traceback.print_exc()
        said = {"error": f"{type(error).__name__}: {error}"}
    write_json(answer, said)
    return 1 if "error" in said else 0


def _said(summary: AnySummary) -> dict[str, Any]:
    """What an answer says of a motion."""
    said: dict[str, Any] = {
        "frames": summary.frames,
        "frame_start": summary.frame_start,
        "frame_end": summary.frame_end,
        "warnings": summary.warnings,
    }
    if isinstance(summary, Summary):
        said["quality"] = quality(summary.figures)
        said["keys"], said["dense_keys"] = summary.keys, summary.dense_keys
    return said
