# SPDX-License-Identifier: GPL-3.0-or-later
"""What the words of the command line do."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy

from ..core.errors import OctoMotionError, SettingsError, WriteError
from ..ui.locomotion import Summary
from .bake import Wanted, bake
from .command_line import STOPPED, WRONG, parse, status_of
from .job_report import figures_in_words
from .outputs import commit, staged
from .shot_runner import perform
from .shot_schema import KINDS, ShotRequest, is_motion
from .stopping import stoppable
from .vocabulary import make_request
from .worker import RUN_SHOT, run_shot


def main(arguments: Sequence[str], program: str, *, has_open_file: bool) -> int:
    """Do what the command line says; the exit status."""
    if len(arguments) == 3 and arguments[0] == RUN_SHOT:
        return run_shot(Path(arguments[1]), Path(arguments[2]))
    options = parse(arguments, program, has_open_file=has_open_file)
    if isinstance(options, int):
        return options
    try:
        with stoppable():
            if options.command == "bake":
                said = {name: value for name, value in vars(options).items() if name != "command"}
                return bake(Wanted(**said))
            return _make(_requested(options))
    except OctoMotionError as error:
        return _complain(error, WRONG)
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        return STOPPED


def _make(shot: ShotRequest) -> int:
    """One file, to walk or swim, with splices or posed."""
    try:
        with staged(shot.outputs) as places:
            performed = perform(shot, places)
            commit(places)
    except OctoMotionError as error:
        return _complain(error, status_of(error))
    summary = performed.summary
    for warning in summary.warnings:
        print(f"Warning: {warning}", flush=True)
    print(f"{performed.armature}: {summary.message}", flush=True)
    if isinstance(summary, Summary):
        print(f"Quality: {figures_in_words(summary.figures)}.", flush=True)
    for path in shot.outputs:
        print(f"Written: {path}", flush=True)
    return 0


def _requested(options: argparse.Namespace) -> ShotRequest:
    """The shot that the arguments ask for: a table of a job, put into other words."""
    if not (options.file or bpy.data.filepath):
        raise OctoMotionError("No file is open.", "Give the .blend file to read.")
    read = _resolved(options.file or bpy.data.filepath)
    table: dict[str, Any] = {"name": "shot", "kind": options.command}
    for name, key in KINDS[options.command].items():
        value = getattr(options, name, None)
        if key.option is not None and value:
            table[name] = key.option.collect(value) if key.option.collect else value
    # What is read may be a motion file: that is never the one to overwrite.
    if options.overwrite and not (options.output or (options.export and is_motion(read))):
        table["output"] = str(read)
    if not table.keys() & {"output", "export"}:
        raise WriteError(
            "There is nothing to write.",
            "Give --output, --export, or --overwrite for the file itself.",
        )
    if options.command == "splice" and is_motion(read) and not options.splices:
        raise SettingsError("There is nothing to splice: give --splice PART FILE.")
    shot = make_request(table, _resolved, has_open_file=True)
    _check_outputs(shot, read, overwrite=options.overwrite)
    return shot


def _check_outputs(shot: ShotRequest, read: Path, *, overwrite: bool) -> None:
    """Make sure that no file is lost: that no output is there already, or is read."""
    if len({str(path).casefold() for path in shot.outputs}) < len(shot.outputs):
        raise WriteError("Two outputs have the same path.", "Give each its own.")
    for path in shot.outputs:
        is_read = _same(path, read)
        if any(_same(path, each) for each in shot.inputs) and not is_read:
            raise WriteError(f"'{path}' is a clip that is read.", "Give another path.")
        if path.exists() and not overwrite:
            what = "is the file that is read" if is_read else "is there already"
            raise WriteError(f"'{path}' {what}.", "Give another path, or --overwrite.")


def _same(one: Path, other: Path) -> bool:
    """Whether two paths lead to one file, whatever its names are."""
    try:
        return one.samefile(other)
    except OSError:
        return one == other


def _resolved(text: str) -> Path:
    return Path(text).expanduser().resolve()


def _complain(error: OctoMotionError, status: int) -> int:
    print(f"Error: {error}", file=sys.stderr, flush=True)
    return status
