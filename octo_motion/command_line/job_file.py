# SPDX-License-Identifier: GPL-3.0-or-later
"""Job files: many shots in one TOML file, checked as a whole before anything runs.

What the text itself says is checked here; whether the files that it names can be used is seen
when they are looked at, and concerns one shot alone.
"""

from __future__ import annotations

import os
import tomllib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from ..core.errors import OctoMotionError
from .schema import Known, Reading, unknown
from .shot_schema import KINDS, ShotRequest, kind_of, read_shot

_TABLES: Final = ("defaults", "shots")
_ADDED: Final = ("settings", "octopus", "limits")
"""Tables of a shot that are added to those of the defaults; all else takes their place."""


class JobError(OctoMotionError):
    """The job is wrong; ``faults`` has a sentence or two for each reason."""

    def __init__(self, source: str, faults: Sequence[str]) -> None:
        self.faults = tuple(faults)
        count = "1 fault" if len(faults) == 1 else f"{len(faults)} faults"
        listed = "\n".join(f"  {fault}" for fault in faults)
        super().__init__(f"{source} has {count}; nothing was run:\n{listed}")


@dataclass(frozen=True)
class JobFile:
    """A job file that was found to be in order."""

    path: Path
    shots: tuple[ShotRequest, ...]
    asked: Mapping[str, Mapping[str, Any]]
    """Of each shot, by name: its table with the defaults filled in, as it stands in the file."""


def read_job(path: Path, known: Known, report: Path) -> JobFile:
    """The shots of a job file.

    Args:
        path: the file.
        known: what shots may name.
        report: the report's path, which no output may have.

    Raises:
        JobError: the file cannot be read or is wrong, with everything that is wrong with it.
    """
    path = path.resolve()
    content = _content(path)
    faults = [unknown("table", name, _TABLES) for name in content if name not in _TABLES]
    defaults = content.get("defaults", {})
    if not isinstance(defaults, dict):
        faults.append("defaults: It must be a table, [defaults].")
        defaults = {}
    if "name" in defaults:
        faults.append("defaults: A name belongs to one shot.")
    tables = content.get("shots", [])
    if not isinstance(tables, list) or not all(isinstance(each, dict) for each in tables):
        faults.append("shots: Write each shot as a table of its own, [[shots]].")
        tables = []
    elif not tables:
        faults.append("There are no shots: write each as a table of its own, [[shots]].")
    asked = [_merged(defaults, table) for table in tables]
    shots: list[ShotRequest] = []
    for place, table in enumerate(asked, 1):
        name = table.get("name")
        name = name if isinstance(name, str) and name.strip() else ""
        label = f"shot '{name}'" if name else f"shot number {place}"
        reading = Reading(known, resolver(path, name), faults)
        shots.append(read_shot(table, reading.within(label)))
    counts = Counter(shot.name for shot in shots if shot.name)
    faults += [
        f"shot '{name}': {count} shots have this name."
        for name, count in counts.items()
        if count > 1
    ]
    faults += _path_faults(shots, path, report)
    if faults:
        raise JobError(f"'{path}'", faults)
    return JobFile(path, tuple(shots), {table["name"]: table for table in asked})


def resolver(job: Path, name: str) -> Callable[[str], Path]:
    """The paths that the texts of a shot mean, by the job's path and the shot's name."""

    def resolve(text: str) -> Path:
        # An output that is a link is written where the link leads.
        return (job.parent / Path(text.replace("{name}", name)).expanduser()).resolve()

    return resolve


def _content(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise JobError(f"'{path}'", [f"It cannot be read: {error.strerror}."]) from error
    except UnicodeDecodeError as error:
        raise JobError(f"'{path}'", ["It is not a text in UTF-8."]) from error
    except tomllib.TOMLDecodeError as error:
        raise JobError(f"'{path}'", [f"It is not TOML: {error}."]) from error


def _merged(defaults: Mapping[str, Any], table: Mapping[str, Any]) -> dict[str, Any]:
    own = KINDS[kind_of({**defaults, **table})]
    others = {key for keys in KINDS.values() for key in keys if key not in own}
    # What only shots of another kind have is not meant for this one.
    merged = {key: value for key, value in defaults.items() if key not in {"name", *others}}
    # A shot that says where its creature comes from does not mean the defaults' other one.
    for key, other in (("file", "octopus"), ("octopus", "file")):
        if key in table and other not in table:
            merged.pop(other, None)
    shared = {key: merged[key] for key in _ADDED if key in merged}
    added = {key: table[key] for key in _ADDED if key in table}
    return {**merged, **table, **_united(shared, added)}


def _united(shared: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Tables with the values of both; of what both say, it is as the second one says."""
    result = dict(shared)
    for key, value in own.items():
        before = result.get(key)
        if isinstance(value, dict) and isinstance(before, dict):
            result[key] = _united(before, value)
        else:
            result[key] = value
    return result


def _path_faults(shots: Sequence[ShotRequest], job: Path, report: Path) -> list[str]:
    """Outputs that would overwrite what is read, or one another."""
    owners = {_key(job): "the job file itself", _key(report.resolve()): "the report"}
    for shot in shots:
        for path in shot.inputs:
            owners.setdefault(_key(path), f"an input of shot '{shot.name}'")
    faults = []
    for shot in shots:
        for path in shot.outputs:
            owner = owners.get(_key(path))
            if owner is not None:
                faults.append(f"shot '{shot.name}': Its output '{path}' is {owner}: give another.")
            owners.setdefault(_key(path), f"an output of shot '{shot.name}' too")
    return faults


def _key(path: Path) -> str:
    return os.path.normcase(path)
