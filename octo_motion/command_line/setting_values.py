# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings given as text or in a job file: what may be given, and what is wrong with what was."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

from ..core.errors import SettingsError

Kind = Literal["BOOLEAN", "INT", "FLOAT", "ENUM", "STRING", "POINT"]
Value = bool | int | float | str | list[float]

_TRUE: Final = {"true", "yes", "on", "1"}
_FALSE: Final = {"false", "no", "off", "0"}
_DEGREES: Final = re.compile(r"(?P<number>.+?)\s*(?:°|deg|degrees)$")


@dataclass(frozen=True)
class Setting:
    """One setting, as Blender knows it."""

    name: str
    """As scripts have it; of a group within the settings with its name before: ``table.stride``."""
    kind: Kind
    minimum: float = -math.inf
    maximum: float = math.inf
    choices: tuple[str, ...] = ()
    is_angle: bool = False

    def value(self, given: Any) -> Value:
        """What to set: as given, or read from a text.

        A text of an angle may be in degrees: "30°", "30 deg". Plain numbers are radians, as
        everywhere in Blender's Python. Blender itself would take a number out of range for the
        nearest within; here it is an error.

        Raises:
            SettingsError: the value makes no sense for this setting.
        """
        match self.kind:
            case "BOOLEAN":
                return self._boolean(given)
            case "INT":
                return self._whole_number(given)
            case "FLOAT":
                return self._number(given)
            case "ENUM":
                return self._choice(given)
            case "STRING":
                if isinstance(given, str):
                    return given
                raise self._wrong(given, "Give a text.")
            case "POINT":
                return self._point(given)

    def _point(self, given: Any) -> list[float]:
        numbers = given if isinstance(given, list) else ()
        if len(numbers) == 3 and not any(isinstance(each, bool | str) for each in numbers):
            found = [self._read_number(each) for each in numbers]
            if all(each is not None and math.isfinite(each) for each in found):
                return [float(each) for each in found if each is not None]
        raise self._wrong(given, "Give three numbers, [x, y, z].")

    def _boolean(self, given: Any) -> bool:
        if isinstance(given, bool):
            return given
        if isinstance(given, str) and given.strip().lower() in _TRUE | _FALSE:
            return given.strip().lower() in _TRUE
        raise self._wrong(given, "Give true or false.")

    def _whole_number(self, given: Any) -> int:
        number = self._number(given)
        if number != int(number):
            raise self._wrong(given, "Give a whole number.")
        return int(number)

    def _number(self, given: Any) -> float:
        remedy = "Give a number, such as '30°' or 0.5 (radians)." if self.is_angle else ""
        number = self._read_number(given)
        if number is None or not math.isfinite(number):
            raise self._wrong(given, remedy or "Give a number.")
        if not self.minimum <= number <= self.maximum:
            raise self._wrong(given, self._range())
        return number

    def _read_number(self, given: Any) -> float | None:
        if isinstance(given, bool) or not isinstance(given, int | float | str):
            return None
        if not isinstance(given, str):
            return float(given)
        text = given.strip()
        degrees = _DEGREES.match(text) if self.is_angle else None
        try:
            return math.radians(float(degrees["number"])) if degrees else float(text)
        except ValueError:
            return None

    def _choice(self, given: Any) -> str:
        for choice in self.choices:
            if isinstance(given, str) and given.strip().upper() == choice.upper():
                return choice
        raise self._wrong(given, f"Choose one of {', '.join(self.choices)}.")

    def _range(self) -> str:
        unit = " radians" if self.is_angle else ""
        if self.maximum == math.inf:
            return f"Give {self.minimum:g}{unit} or more."
        if self.minimum == -math.inf:
            return f"Give {self.maximum:g}{unit} or less."
        return f"Give a value from {self.minimum:g} to {self.maximum:g}{unit}."

    def _wrong(self, given: Any, remedy: str) -> SettingsError:
        return SettingsError(f"The setting '{self.name}' cannot be {given!r}.", remedy)


def check_settings(
    known: Mapping[str, Setting], given: Mapping[str, Any]
) -> tuple[dict[str, Value], list[str]]:
    """The values to set by name, and all that is wrong with what was given.

    Tables within the table stand for groups: ``{"table": {"stride": 2}}`` is ``table.stride``.
    """
    values: dict[str, Value] = {}
    faults: list[str] = []
    for name, value in _flattened(given):
        setting = known.get(name)
        if setting is None:
            faults.append(unknown("setting", name, known))
            continue
        try:
            values[name] = setting.value(value)
        except SettingsError as error:
            faults.append(str(error))
    return values, faults


def parse_assignments(texts: Iterable[str]) -> dict[str, str]:
    """``name=value`` texts as a table; of a name given twice the last counts.

    Raises:
        SettingsError: one has no equals sign or no name.
    """
    values: dict[str, str] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        if not sign or not name.strip():
            raise SettingsError(f"'{text}' sets nothing.", "Write --set name=value.")
        values[name.strip()] = value.strip()
    return values


def unknown(what: str, name: str, valid: Iterable[str]) -> str:
    """Sentences about a name that does not exist: the likely one, and all that do."""
    names = list(valid)
    near = difflib.get_close_matches(name, names, n=1)
    hint = f" Did you mean '{near[0]}'?" if near else ""
    return f"There is no {what} '{name}'.{hint} Valid: {', '.join(names)}."


def _flattened(table: Mapping[str, Any], before: str = "") -> Iterable[tuple[str, Any]]:
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _flattened(value, f"{before}{name}.")
        else:
            yield before + name, value
