# SPDX-License-Identifier: GPL-3.0-or-later
"""What the words of the command line do."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import bpy

from ..core.errors import OctoMotionError, SettingsError, WriteError
from ..core.locomotion.gait import gait_to_json
from ..ui.locomotion.writing import Summary
from .command_line import parse
from .job_file import Known, export_fault, is_gait_file, read_gait_file
from .job_runner import STOPPED, BakeOptions, bake
from .motion_files import is_motion
from .outputs import commit, staged
from .processes import stoppable
from .quality_limits import parse_limits, told
from .setting_values import Setting, Value, check_settings, parse_assignments
from .shot_request import ShotEntry, SpliceWork
from .shot_runner import perform
from .splice_entries import parse_splice, read_splices
from .vocabulary import check_file, known
from .worker import RUN_SHOT, run_shot

_WRONG: Final = 2


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
                return _bake(options)
            return _make(options)
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        return STOPPED


def _bake(options: argparse.Namespace) -> int:
    wanted = BakeOptions(
        job=options.job,
        report=options.report.resolve() if options.report else None,
        jobs=options.jobs,
        force=options.force,
        check=options.check,
        only=tuple(options.only),
    )
    try:
        return bake(wanted, known(), check_file, _say)
    except OctoMotionError as error:
        return _complain(error, _WRONG)


def _make(options: argparse.Namespace) -> int:
    """One file, to walk or swim, with splices or posed."""
    make_entry = {"splice": _splice_entry, "pose": _pose_entry}.get(options.command, _entry)
    try:
        entry = make_entry(options, known())
    except OctoMotionError as error:
        return _complain(error, _WRONG)
    try:
        with staged(entry.outputs) as places:
            performed = perform(entry, places)
            commit(places)
    except OctoMotionError as error:
        return _complain(error, 1)
    for warning in performed.summary.warnings:
        _say(f"Warning: {warning}")
    _say(f"{performed.armature}: {performed.summary.message}")
    if isinstance(performed.summary, Summary):
        _say(f"Quality: {told(performed.summary.figures)}.")
    for path in entry.outputs:
        _say(f"Written: {path}")
    return 0


def _entry(options: argparse.Namespace, may_name: Known) -> ShotEntry:
    """What the arguments of ``generate`` ask for.

    Raises:
        OctoMotionError: they make no sense.
    """
    source, read = _files(options)
    output, exports = _outputs(options, read)
    return ShotEntry(
        name=read.stem,
        file=source,
        armature=options.armature,
        route=options.route,
        ground=options.ground,
        gait=_gait(options.gait, may_name),
        settings=_settings(options, may_name.settings),
        limits=parse_limits(options.limits),
        fps=options.fps,
        output=output,
        exports=exports,
    )


def _splice_entry(options: argparse.Namespace, may_name: Known) -> ShotEntry:
    """What the arguments of ``splice`` ask for.

    Raises:
        OctoMotionError: they make no sense.
    """
    source, read = _files(options)
    tables = [parse_splice(words) for words in options.splices]
    splices, faults = None, []
    if tables:
        splices, faults = read_splices(tables, may_name.splice_settings, _resolved)
    elif is_motion(read):
        faults = ["There is nothing to splice: give --splice PART FILE."]
    if faults:
        raise SettingsError("\n".join(faults))
    output, exports = _outputs(options, read, *(each.clip for each in splices or () if each.clip))
    return ShotEntry(
        name=read.stem,
        file=source,
        armature=options.armature,
        settings=_settings(options, may_name.splicing_settings),
        fps=options.fps,
        output=output,
        exports=exports,
        splicing=SpliceWork(options.base, options.frames, splices),
    )


def _pose_entry(options: argparse.Namespace, may_name: Known) -> ShotEntry:
    """What the arguments of ``pose`` ask for.

    Raises:
        OctoMotionError: they make no sense.
    """
    del may_name
    source, read = _files(options)
    script = options.script.resolve()
    if not script.is_file():
        raise SettingsError(f"There is no file '{script}'.", "Give the path of a pose script.")
    output, exports = _outputs(options, read, script)
    return ShotEntry(
        name=read.stem,
        file=source,
        armature=options.armature,
        fps=options.fps,
        output=output,
        exports=exports,
        posing=script,
    )


def _files(options: argparse.Namespace) -> tuple[Path | None, Path]:
    """The file that is named, if any, and the one that is read."""
    source = options.file.resolve() if options.file else None
    read = source or (Path(bpy.data.filepath).resolve() if bpy.data.filepath else None)
    if read is None:
        raise OctoMotionError("No file is open.", "Give the .blend file to read.")
    return source, read


def _outputs(options: argparse.Namespace, *read: Path) -> tuple[Path | None, tuple[Path, ...]]:
    """The .blend file to write, and what to export to.

    Args:
        options: the arguments.
        read: all files that are read, the scene first.
    """
    output = options.output.resolve() if options.output else None
    # What is read may be a motion file: that is never the one to overwrite.
    if output is None and options.overwrite and not (options.export and is_motion(read[0])):
        output = read[0]
    exports = tuple(path.resolve() for path in options.export)
    if output is None and not exports:
        raise WriteError(
            "There is nothing to write.",
            "Give --output, --export, or --overwrite for the file itself.",
        )
    if output is not None and output.suffix.lower() != ".blend":
        raise WriteError(f"The output '{output.name}' is no .blend file.", "Let it end in .blend.")
    for path in exports:
        if fault := export_fault(path):
            raise WriteError(fault)
    outputs = (*((output,) if output else ()), *exports)
    if len(set(outputs)) < len(outputs):
        raise WriteError("Two outputs have the same path.", "Give each its own.")
    for path in outputs:
        if path in read[1:]:
            raise WriteError(f"'{path}' is a clip that is read.", "Give another path.")
        if path.exists() and not options.overwrite:
            what = "is the file that is read" if path == read[0] else "is there already"
            raise WriteError(f"'{path}' {what}.", "Give another path, or --overwrite.")
    return output, exports


def _settings(options: argparse.Namespace, valid: Mapping[str, Setting]) -> dict[str, Value]:
    values, faults = check_settings(valid, parse_assignments(options.settings))
    if faults:
        raise SettingsError("\n".join(faults))
    return values


def _resolved(text: str) -> Path:
    return Path(text).expanduser().resolve()


def _gait(name: str, may_name: Known) -> str:
    if not name:
        return ""
    table = read_gait_file(Path(name)) if is_gait_file(name) else may_name.gait(name)
    return gait_to_json(table)


def _complain(error: OctoMotionError, status: int) -> int:
    print(f"Error: {error}", file=sys.stderr, flush=True)
    return status


def _say(line: str) -> None:
    print(line, flush=True)
