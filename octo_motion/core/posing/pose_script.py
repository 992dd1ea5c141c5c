# SPDX-License-Identifier: GPL-3.0-or-later
"""Scripts of sessions: JSON with grabs, pulls, pins, waits and keys, checked before they play."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from ..errors import SettingsError
from ..phrases import phrase

FORMAT: Final = "octo_motion.pose"
VERSION: Final = 1
LONGEST: Final = 600.0
"""Seconds of one step: more is a slip of the pen."""
FARTHEST: Final = 1e6
"""Metres and degrees of one step, likewise."""
LAST_FRAME: Final = 1048574
"""Of a scene of Blender."""

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class ScriptStep:
    """One line of a script; what it does not need is left as it is."""

    do: str
    bone: str = ""
    at: float = 0.5
    """Share of the bone's length, 0 at its head."""
    by: Vector | None = None
    """Metres from where the hand is."""
    to: Vector | None = None
    """Where the hand goes, world."""
    turn: Vector = (0.0, 0.0, 0.0)
    """Axis times angle in degrees, world: how the hand turns on the way."""
    seconds: float = 0.0
    frame: int = 0
    bones: str | tuple[str, ...] = "touched"
    hand: str = ""
    """Which of several hands, by any name."""
    meanwhile: bool = False
    """Whether the next steps go on while this pull lasts."""


@dataclass(frozen=True)
class PoseScript:
    """A session as data."""

    steps: tuple[ScriptStep, ...]
    settings: Mapping[str, Any]
    """By name, of ``Object.octo_motion.posing``."""
    figures: tuple[str, ...] = ()
    """Names of other armatures that are posed along."""


_NEEDED: Final[dict[str, frozenset[str]]] = {
    "grab": frozenset({"bone"}),
    "pull": frozenset({"seconds"}),
    "release": frozenset(),
    "wait": frozenset({"seconds"}),
    "pin": frozenset({"bone"}),
    "unpin": frozenset({"bone"}),
    "frame": frozenset({"frame"}),
    "key": frozenset(),
    "record": frozenset(),
    "stop": frozenset(),
    "restore": frozenset(),
}
"""Steps, and what each must say."""
_ALLOWED: Final[dict[str, frozenset[str]]] = {
    "grab": frozenset({"bone", "at", "hand"}),
    "pull": frozenset({"by", "to", "turn", "seconds", "hand", "meanwhile"}),
    "release": frozenset({"hand"}),
    "key": frozenset({"bones"}),
}
"""What else a step may say, where that is more than it must."""


def parse_script(text: str, name: str) -> PoseScript:
    """Read a script.

    Args:
        text: JSON.
        name: of the file, for messages.

    Raises:
        SettingsError: it is no such script, or a step makes no sense; the message says which.
    """
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise SettingsError(
            phrase("'{name}' is not JSON: {error}.", name=name, error=error), "Repair it there."
        ) from None
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise SettingsError(
            phrase("'{name}' is no script of posing.", name=name),
            phrase('It begins with "format": "{format}".', format=FORMAT),
        )
    if data.get("version") != VERSION:
        raise SettingsError(
            phrase(
                "'{name}' has format version {version}.", name=name, version=data.get("version")
            ),
            phrase("This version of Octo Motion reads version {version}.", version=VERSION),
        )
    extra = sorted(set(data) - {"format", "version", "settings", "steps", "figures"})
    settings, steps = data.get("settings", {}), data.get("steps")
    if extra:
        raise SettingsError(
            phrase("'{name}' has an unknown entry '{extra}'.", name=name, extra=extra[0]),
            "Check its spelling.",
        )
    if not isinstance(settings, dict) or not isinstance(steps, list):
        raise SettingsError(
            phrase("'{name}' has no list of steps, or odd settings.", name=name),
            "See the scripting reference.",
        )
    figures = data.get("figures", [])
    if not isinstance(figures, list) or not all(map(_text, figures)):
        raise SettingsError(
            phrase("'{name}' names other figures in an odd way.", name=name),
            "It is a list of armatures' names.",
        )
    return PoseScript(
        steps=tuple(_step(each, number) for number, each in enumerate(steps, 1)),
        settings=settings,
        figures=tuple(figures),
    )


def _step(data: Any, number: int) -> ScriptStep:
    def wrong(what: str) -> SettingsError:
        return SettingsError(
            phrase("Step {number} of the script {what}.", number=number, what=what),
            "See the scripting reference.",
        )

    if not isinstance(data, dict) or data.get("do") not in _NEEDED:
        raise wrong(phrase("does not say what to do, one of {needed}", needed=", ".join(_NEEDED)))
    do = data["do"]
    needed = _NEEDED[do]
    allowed = _ALLOWED.get(do, needed) | {"do"}
    if missing := sorted(needed - set(data)):
        raise wrong(phrase("('{do}') lacks '{missing}'", do=do, missing=missing[0]))
    if extra := sorted(set(data) - allowed):
        raise wrong(phrase("('{do}') has an unknown entry '{extra}'", do=do, extra=extra[0]))
    if (
        do == "pull"
        and ("by" in data) == ("to" in data)
        and not ("turn" in data and "by" not in data)
    ):
        raise wrong(phrase("('pull') says either 'by' or 'to'"))
    values: dict[str, Any] = {"do": do}
    for key in set(data) - {"do"}:
        value = _READERS[key](data[key])
        if value is None:
            raise wrong(phrase("('{do}') has a '{key}' that makes no sense", do=do, key=key))
        values[key] = value
    return ScriptStep(**values)


def _text(value: Any) -> str | None:
    return value if isinstance(value, str) and value else None


def _yes_or_no(value: Any) -> bool | None:
    return value if isinstance(value, bool) else None


def _number_up_to(most: float) -> Callable[[Any], float | None]:
    def read(value: Any) -> float | None:
        number = _number(value)
        return number if number is not None and 0.0 <= number <= most else None

    return read


def _number(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value)


def _frame_number(value: Any) -> int | None:
    whole = isinstance(value, int) and not isinstance(value, bool)
    return value if whole and abs(value) <= LAST_FRAME else None


def _vector(value: Any) -> Vector | None:
    if not isinstance(value, list) or len(value) != 3:
        return None
    x, y, z = map(_number, value)
    if x is None or y is None or z is None:
        return None
    return (x, y, z) if max(abs(x), abs(y), abs(z)) <= FARTHEST else None


def _names(value: Any) -> str | tuple[str, ...] | None:
    if value in ("touched", "all"):
        return value
    if isinstance(value, list) and value and all(_text(each) for each in value):
        return tuple(value)
    return None


_READERS: Final[dict[str, Callable[[Any], Any]]] = {
    "bone": _text,
    "at": _number_up_to(1.0),
    "by": _vector,
    "to": _vector,
    "turn": _vector,
    "seconds": _number_up_to(LONGEST),
    "frame": _frame_number,
    "bones": _names,
    "hand": _text,
    "meanwhile": _yes_or_no,
}
