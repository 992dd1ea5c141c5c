# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole job: many shots in one TOML file, checked as a whole before anything runs.

What the text itself says is checked first; whether the files that it names can be used is seen when
they are looked at, and concerns one shot alone.
"""

from __future__ import annotations

import tomllib
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from ..core.errors import OctoMotionError, SettingsError
from ..core.files import read_text
from .for_each import for_each
from .schema import Known, Reading, unknown
from .shot_schema import KINDS, ShotRequest, kind_of, read_shot
from .vocabulary import BACKSLASHES, resolver

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
    """A job file; of the shots that were asked for, everything was found to be in order."""

    path: Path
    shots: tuple[ShotRequest, ...]
    """Those that were asked for."""
    asked: Mapping[str, Mapping[str, Any]]
    """Of each shot, by name: its table with the defaults filled in, as it stands in the file."""
    warnings: tuple[str, ...] = ()
    """What is wrong with shots that were not asked for."""


@dataclass(frozen=True)
class Choice:
    """Which shots of a job are meant: all, or those with these names and at these places."""

    names: Sequence[str] = ()
    places: Sequence[range] = ()
    """Counted from 1; what is beyond the last is left out."""

    @property
    def is_everything(self) -> bool:
        """Whether nothing is left out."""
        return not (self.names or self.places)

    def of(self, names: Sequence[str]) -> list[int]:
        """Places in the list of all names, counted from 0, in the job's order.

        Raises:
            SettingsError: a name is not there, or nothing is left.
        """
        if self.is_everything:
            return list(range(len(names)))
        if faults := [unknown("shot", name, names) for name in self.names if name not in names]:
            raise SettingsError("\n".join(faults))
        wanted = set(self.names)
        meant = [
            place
            for place, name in enumerate(names)
            if name in wanted or any(place + 1 in each for each in self.places)
        ]
        if not meant:
            raise SettingsError(f"None of its {len(names)} shots is at the places that were given.")
        return meant


EVERYTHING: Final = Choice()


def read_tables(path: Path, known: Known) -> tuple[list[dict[str, Any]], list[str]]:
    """The table of each shot of a job file, with the defaults filled in, and what is wrong with
    the file as a whole.

    Raises:
        JobError: the file cannot be read.
    """
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
    asked: list[dict[str, Any]] = []
    for place, table in enumerate(tables, 1):
        try:
            asked += for_each(_merged(defaults, table), path.parent, known.actions)
        except OctoMotionError as error:
            faults.append(f"shot number {place}: {error}")
    return asked, faults


def read_job(path: Path, known: Known, report: Path, choice: Choice = EVERYTHING) -> JobFile:
    """The shots of a job file; none of their outputs may have the report's path.

    Raises:
        JobError: the file cannot be read or is wrong, with everything that is wrong with it, and
            with the shots that are meant.
    """
    path = path.resolve()
    asked, faults = read_tables(path, known)
    names = [name_in(table) for table in asked]
    try:
        meant = set(choice.of(names))
    except SettingsError as error:
        raise JobError(f"'{path}'", [*faults, str(error)]) from error
    shots: dict[int, ShotRequest] = {}
    elsewhere: list[str] = []
    for place, (name, table) in enumerate(zip(names, asked, strict=True)):
        label = f"shot '{name}'" if name else f"shot number {place + 1}"
        # Of shots that are not meant paths are not looked up: there may be a million of them.
        told, resolve = (
            (faults, resolver(path, name))
            if place in meant
            else (elsewhere, resolver(path, name, follow=False))
        )
        reading = Reading(known, resolve, told)
        shots[place] = read_shot(table, reading.within(label))
    clashes = [*_name_faults(names), *_path_faults(shots, meant, path, report)]
    for place, fault in clashes:
        told = faults if place in meant else elsewhere
        if fault not in told:
            told.append(fault)
    if faults:
        raise JobError(f"'{path}'", faults)
    chosen = tuple(shots[place] for place in sorted(meant))
    by_name = {names[place]: asked[place] for place in sorted(meant)}
    return JobFile(path, chosen, by_name, tuple(elsewhere))


def name_in(table: Mapping[str, Any]) -> str:
    """The name that a shot's table has; "" if it has none."""
    name = table.get("name")
    return name if isinstance(name, str) and name.strip() else ""


def _name_faults(names: Sequence[str]) -> Iterator[tuple[int, str]]:
    """Names that are the same, where capitals count as small letters, with their places."""
    places: dict[str, list[int]] = {}
    for place, name in enumerate(names):
        if name:
            places.setdefault(name.casefold(), []).append(place)
    for found in places.values():
        if len(found) == 1:
            continue
        same = len({names[place] for place in found}) == 1
        fault = (
            f"{len(found)} shots have this name."
            if same
            else "Another name differs from it in capitals alone."
        )
        for place in found:
            yield place, f"shot '{names[place]}': {fault}"


def _content(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(read_text(path))
    except OSError as error:
        raise JobError(f"'{path}'", [f"It cannot be read: {error.strerror}."]) from error
    except UnicodeDecodeError as error:
        raise JobError(f"'{path}'", ["It is not a text in UTF-8."]) from error
    except tomllib.TOMLDecodeError as error:
        hint = f" {BACKSLASHES}" if "hex value" in str(error) or "\\" in str(error) else ""
        raise JobError(f"'{path}'", [f"It is not TOML: {error}.{hint}"]) from error


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


def _path_faults(
    shots: Mapping[int, ShotRequest], meant: set[int], job: Path, report: Path
) -> Iterator[tuple[int, str]]:
    """Outputs that would overwrite what is read, or one another, with the places of their shots."""
    owners = {job: "the job file itself", report.resolve(): "the report"}
    for shot in shots.values():
        for path in shot.inputs:
            owners.setdefault(path, f"an input of shot '{shot.name}'")
    keys = {_key(path): owner for path, owner in owners.items()}
    # The same file by another name, as links and mapped drives give it; files are few.
    numbers = {number: owner for path, owner in owners.items() if (number := _number(path))}
    for place, shot in shots.items():
        for path in shot.outputs:
            owner = keys.get(_key(path))
            if owner is None and place in meant:
                owner = numbers.get(number) if (number := _number(path)) else None
            if owner is not None:
                yield place, f"shot '{shot.name}': Its output '{path}' is {owner}: give another."
            keys.setdefault(_key(path), f"an output of shot '{shot.name}' too")


def _key(path: Path) -> str:
    """What is the same for paths that are the same file on some system: not all tell capitals from
    small letters, or a letter from the same one in two parts.
    """
    return unicodedata.normalize("NFC", str(path)).casefold()


def _number(path: Path) -> tuple[int, int] | None:
    """What the file system knows a file by, where there is one."""
    try:
        state = path.stat()
    except OSError:
        return None
    return state.st_dev, state.st_ino
