# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of each shot, one file for each: processes on many machines may make the shots of one
job at once. The report is gathered from them.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import bpy

from ..blender.files import file_named
from .job_report import (
    REPORT_ENDING,
    ShotRecord,
    digest,
    read_record,
    read_report,
    record_file,
)
from .outputs import write_json

_LOOKS: Final = 20
_TEXT: Final = "Octo Motion Shot"
"""Name of the text in a .blend file that says from what it was made."""


@dataclass(frozen=True)
class Records:
    """The records of a job; paths in them are relative to the job's folder where that can be."""

    job: Path
    report: Path

    @property
    def folder(self) -> Path:
        """Where they are, beside the report."""
        return self.report.with_name(self.report.name.removesuffix(REPORT_ENDING) + ".records")

    def path(self, name: str) -> Path:
        """The file of a shot's record."""
        return file_named(self.folder, name)

    @cached_property
    def _reported(self) -> dict[str, ShotRecord]:
        return read_report(self.report)

    def read(self, name: str) -> ShotRecord | None:
        """A shot's record; where it has none, as in jobs of an earlier version, that of the report.

        Raises:
            OctoMotionError: it cannot be read; the report is none.
        """
        found = read_record(self.path(name))
        # A record by that name may be another shot's, where capitals are not told from others.
        return found if found and found.name == name else self._reported.get(name)

    def write(self, record: ShotRecord) -> None:
        """Keep a record, whole or not at all.

        Raises:
            WriteError: it cannot be written.
        """
        write_json(self.path(record.name), record_file(self.job, record))

    def settle(self, record: ShotRecord) -> None:
        """Keep the record of a shot whose files have taken their places just now.

        Another process may make the same shot at the same time. Each of its files is whole,
        whichever process it is from; whoever writes the record last looks at the files once more,
        so the record that stays is that of the files that stay.

        Raises:
            WriteError: it cannot be written.
        """
        for _ in range(_LOOKS):
            self.write(record)
            found = {path: digest(self.job.parent / path) for path in record.outputs}
            if found == record.outputs:
                return
            record = replace(record, outputs=found)

    def relative(self, path: Path) -> str:
        """A path as records have it, so that a job may be moved with its files."""
        try:
            return Path(os.path.relpath(path, self.job.parent)).as_posix()
        except ValueError:
            # On another drive of Windows.
            return path.as_posix()

    def absolute(self, path: str) -> Path:
        """The path that is meant by one of a record."""
        return self.job.parent / path

    def found_in_output(self, path: Path) -> ShotRecord | None:
        """What a .blend file says from what it was made; None if it says nothing of the kind.

        What it does not say is which bytes the files had, that this is the work of others since.
        """
        if path.suffix.lower() != ".blend" or not path.is_file():
            return None
        try:
            library: Any = bpy.data.libraries.load(str(path))
            with library as (inside, taken):
                taken.texts = [_TEXT] if _TEXT in inside.texts else []
            if not taken.texts:
                return None
            text: Any = taken.texts[0]
            said = json.loads(text.as_string())
            bpy.data.texts.remove(text)
            return ShotRecord(**said)
        except (OSError, ValueError, TypeError):
            return None


def sign(said: Mapping[str, Any]) -> None:
    """Let the open file say from what it was made, in a text: should the record be lost, the file
    is known again. ``said`` are fields of its record, without its own digest.
    """
    before = bpy.data.texts.get(_TEXT)
    if before is not None:
        bpy.data.texts.remove(before)
    text = bpy.data.texts.new(_TEXT)
    text.write(json.dumps(said, indent=1, ensure_ascii=False, sort_keys=True) + "\n")
