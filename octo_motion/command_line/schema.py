# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables as people write them: what each key may be, and what is wrong with what was written.

A *kind* of value reads what is given and tells what it wants. Tables are kinds too, made of keys
with their kinds. Everything that is wrong is told at once, each in a sentence or two.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path
from typing import Any, Final

from ..core.errors import OctoMotionError, SettingsError
from ..core.files import name_fault
from ..core.locomotion.gait import GaitTable

_TRUE: Final = {"true", "yes", "on", "1"}
_FALSE: Final = {"false", "no", "off", "0"}
_DEGREES: Final = re.compile(r"(?P<number>.+?)\s*(?:°|deg|degrees)$")
_LARGE: Final = 2.0**31 - 1.0
"""Bounds as large as this are those of Blender's numbers, which nobody needs to be told."""
_LANDMARKS: Final = "landmarks."


class Unfit(ValueError):  # noqa: N818 - no error of the program
    """A value is not what its key wants; the text says what that is: "a whole number"."""


@dataclass(frozen=True)
class Known:
    """What shots may name, as Blender knows it."""

    tables: Mapping[str, Mapping[str, Kind]]
    """Settings by name, of all tables that have what a group of properties has."""
    gait: Callable[[str], GaitTable]
    """A gait by name; raises GaitError."""
    actions: Callable[[Path], list[str]] = lambda _: []
    """Names of the actions of a .blend file; raises OctoMotionError."""


@dataclass(frozen=True)
class Reading:
    """Where a table is read, and who is told what is wrong with it."""

    known: Known
    resolve: Callable[[str], Path]
    """The path that a text means."""
    faults: list[str] = field(default_factory=list)
    place: str = ""
    """What a fault begins with."""
    has_open_file: bool = False
    """Whether Blender has a file open that is meant where no other is named."""

    def fault(self, sentence: str) -> None:
        self.faults.append(f"{self.place}{sentence}")

    def within(self, place: str) -> Reading:
        return replace(self, place=f"{self.place}{place}: ") if place else self


Kind = Callable[[Any, Reading], Any]
"""What a value may be: reads what is given to the value that is meant.

Raises Unfit if it is of another kind, OctoMotionError if it is wrong otherwise. Of things within it
that are wrong, tells the reading.
"""


@dataclass(frozen=True)
class Text:
    """A text."""

    may_be_empty: bool = False

    def __call__(self, given: Any, _reading: Reading) -> str:
        if not isinstance(given, str) or not (self.may_be_empty or given.strip()):
            raise Unfit("a text")
        return given


def flag(given: Any, _reading: Reading) -> bool:
    """Yes or no."""
    if isinstance(given, bool):
        return given
    if isinstance(given, str) and given.strip().lower() in _TRUE | _FALSE:
        return given.strip().lower() in _TRUE
    raise Unfit("true or false")


@dataclass(frozen=True)
class Number:
    """A number, also one that is written as a text.

    A text of an angle may be in degrees: "30°", "30 deg". Plain numbers are radians, as everywhere
    in Blender's Python. Blender itself would take a number out of range for the nearest within;
    here it is a fault.
    """

    minimum: float = -math.inf
    maximum: float = math.inf
    whole: bool = False
    is_angle: bool = False
    may_be_infinite: bool = False

    def __call__(self, given: Any, _reading: Reading | None = None) -> float:
        number = self._number(given)
        fits = self.minimum <= number <= self.maximum  # which what is no number does not
        endless = math.isinf(number) and not self.may_be_infinite
        if not fits or endless or (self.whole and not number.is_integer()):
            raise Unfit(self._wanted())
        return int(number) if self.whole else number

    def _number(self, given: Any) -> float:
        if isinstance(given, bool) or not isinstance(given, int | float | str):
            return math.nan
        degrees = isinstance(given, str) and self.is_angle and _DEGREES.match(given.strip())
        try:
            return math.radians(float(degrees["number"])) if degrees else float(given)
        except (ValueError, OverflowError):
            return math.nan

    def _wanted(self) -> str:
        wanted = "a whole number" if self.whole else "a number"
        low, high = _in_words(self.minimum), _in_words(self.maximum)
        if low and high:
            wanted += f" from {low} to {high}"
        elif low:
            wanted += f" of {low} or more"
        elif high:
            wanted += f" of {high} or less"
        return f"{wanted} in radians, or degrees such as '30°'" if self.is_angle else wanted


def _in_words(bound: float) -> str:
    if abs(bound) >= _LARGE:
        return ""
    return str(int(bound)) if bound == int(bound) else f"{bound:g}"


@dataclass(frozen=True)
class Choice:
    """One of several texts, written large or small."""

    choices: tuple[str, ...]
    what: str = ""
    """What they are, for a sentence about one that does not exist."""

    def __call__(self, given: Any, _reading: Reading) -> str:
        for choice in self.choices:
            if isinstance(given, str) and given.strip().lower() == choice.lower():
                return choice
        if self.what:
            raise SettingsError(unknown(self.what, str(given), map(str.lower, self.choices)))
        raise Unfit(f"one of {', '.join(self.choices)}")


def point(given: Any, _reading: Reading) -> list[float]:
    """A place in space."""
    numbers = given if isinstance(given, list) else ()
    if len(numbers) != 3 or not all(map(_is_finite, numbers)):
        raise Unfit("three numbers, [x, y, z]")
    return [float(each) for each in numbers]


def _is_finite(given: Any) -> bool:
    is_number = isinstance(given, int | float) and not isinstance(given, bool)
    return is_number and math.isfinite(given)


@dataclass(frozen=True)
class File:
    """A path."""

    what: str = ""
    """What files with other endings are not."""
    suffixes: tuple[str, ...] = ()
    is_written: bool = False
    """Whether its name has to be one that every system takes."""

    def __call__(self, given: Any, reading: Reading) -> Path:
        path = Path(Text()(given, reading))
        resolved = reading.resolve(given)
        if self.suffixes and path.suffix.lower() not in self.suffixes:
            valid = ", ".join(self.suffixes)
            raise SettingsError(f"'{path.name}' is no {self.what}. Valid: {valid}.")
        if self.is_written:
            for part in path.parts:
                if part not in {path.anchor, ".."} and (fault := name_fault(part)):
                    raise SettingsError(fault, "Give the file another name.")
        return resolved


@dataclass(frozen=True)
class Table:
    """A table, read to its values by name."""

    keys: Mapping[str, Kind] = field(default_factory=dict)
    known: str = ""
    """Which settings that Blender knows it has too."""
    place: str = ""
    """What its faults begin with."""
    what: str = "setting"
    """What its keys are."""
    example: str = ""
    needed: tuple[str, ...] = ()
    finish: Callable[[dict[str, Any], Reading], Any] | None = None
    """Makes something of the values, and tells what is wrong with them together."""

    def __call__(self, given: Any, reading: Reading) -> Any:
        if not isinstance(given, Mapping):
            raise Unfit(f"a table{self.example and f', such as {self.example}'}")
        reading = reading.within(self.place)
        keys = {**self.keys, **reading.known.tables.get(self.known, {})}
        values = dict[str, Any]()
        for name, value in _flattened(given, keys):
            if name in keys:
                values[name] = read_value(name, keys[name], value, reading)
            else:
                reading.fault(unknown(self.what, name, _shown(keys, name)))
        for name in self.needed:
            if name not in given:
                kind = keys.get(name)
                valid = ", ".join(map(str.lower, kind.choices)) if isinstance(kind, Choice) else ""
                hint = valid and f" Valid: {valid}."
                reading.fault(f"It has no {name}: write {name} = ….{hint}")
        if self.finish is not None:
            try:
                return self.finish(values, reading)
            except OctoMotionError as error:
                reading.fault(str(error))
                return None
        return {name: value for name, value in values.items() if value is not None}


@dataclass(frozen=True)
class Tables:
    """A list of tables."""

    table: Table
    item: str
    """What the faults of each begin with, before its number."""
    if_empty: str = ""
    """What is wrong with a list of none, if anything is."""

    def __call__(self, given: Any, reading: Reading) -> list[Any]:
        if not isinstance(given, list) or not all(isinstance(each, dict) for each in given):
            raise Unfit(f"a list of tables, such as [{self.table.example}]")
        if not given and self.if_empty:
            raise SettingsError(self.if_empty)
        return [
            self.table(each, reading.within(f"{self.item} {place}"))
            for place, each in enumerate(given, 1)
        ]


def read_value(name: str, kind: Kind, given: Any, reading: Reading) -> Any:
    """The value of a key, or None after telling what is wrong with it."""
    try:
        return kind(given, reading)
    except Unfit as unfit:
        reading.fault(f"{name} must be {unfit}, not {given!r}.")
    except OctoMotionError as error:
        reading.fault(str(error))
    return None


def set_values(group: object, values: Mapping[str, Any]) -> None:
    """Set properties by name, those of groups within by the group's name, a dot and theirs."""
    for name, value in values.items():
        *groups, last = name.split(".")
        setattr(reduce(getattr, groups, group), last, value)


def parse_assignments(texts: Iterable[str], option: str = "--set") -> dict[str, str]:
    """``name=value`` texts of the command line as a table; of a name given twice the last counts.

    Raises:
        SettingsError: one has no equals sign or no name.
    """
    values: dict[str, str] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        if not sign or not name.strip():
            raise SettingsError(f"'{text}' sets nothing.", f"Write {option} name=value.")
        values[name.strip()] = value.strip()
    return values


def unknown(what: str, name: str, valid: Iterable[str]) -> str:
    """Sentences about a name that does not exist: the likely one, and all that do."""
    names = list(valid)
    near = difflib.get_close_matches(name, names, n=1)
    hint = f" Did you mean '{near[0]}'?" if near else ""
    return f"There is no {what} '{name}'.{hint} Valid: {', '.join(names)}."


def _shown(names: Iterable[str], name: str) -> list[str]:
    """Names that exist, for one that does not: all landmarks in a word, unless one was meant."""
    if name.startswith(_LANDMARKS):
        return list(names)
    return list(dict.fromkeys(_LANDMARKS[:-1] if _LANDMARKS in each else each for each in names))


def _flattened(
    table: Mapping[str, Any], keys: Iterable[str], before: str = ""
) -> Iterator[tuple[str, Any]]:
    """Keys and values, of groups with the group's name before: ``{"table": {"stride": 2}}`` is
    ``table.stride``.
    """
    for name, value in table.items():
        full = before + name
        if isinstance(value, Mapping) and any(each.startswith(f"{full}.") for each in keys):
            yield from _flattened(value, keys, f"{full}.")
        else:
            yield full, value
