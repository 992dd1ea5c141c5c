# SPDX-License-Identifier: GPL-3.0-or-later
"""The splices of a shot as they are asked for, in a job file or on the command line."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from ..core.errors import SettingsError
from .motion_files import SUFFIXES, is_motion
from .setting_values import Setting, Value, check_settings, unknown
from .shot_request import NewSplice

SPLICE_KEYS: Final = ("clip", "source", "action")
"""What a splice may say beside the settings that it has in the list."""


def read_splices(
    given: Any,
    settings: Mapping[str, Setting],
    resolved: Callable[[str], Path],
) -> tuple[tuple[NewSplice, ...], list[str]]:
    """The splices in a list of tables, and all that is wrong with them.

    Args:
        given: as it stands in the job file.
        settings: of an item of the list, by name.
        resolved: the path that a text means.
    """
    if not isinstance(given, list) or not all(isinstance(each, dict) for each in given):
        example = '[{ part = "right_arm", clip = "throw.bvh" }]'
        return (), [f"splices must be a list of tables, such as {example}."]
    if not given:
        return (), ["splices is empty: write what to splice, or leave the key out."]
    found: list[NewSplice] = []
    faults: list[str] = []
    for place, table in enumerate(given, 1):
        splice, wrong = read_splice(table, settings, resolved)
        found.append(splice)
        faults += [f"splice {place}: {each}" for each in wrong]
    return tuple(found), faults


def read_splice(
    table: Mapping[str, Any], settings: Mapping[str, Setting], resolved: Callable[[str], Path]
) -> tuple[NewSplice, list[str]]:
    """One splice, and all that is wrong with it."""
    faults: list[str] = []
    texts = {key: _text(table, key, faults) for key in SPLICE_KEYS}
    rest = {key: value for key, value in table.items() if key not in SPLICE_KEYS}
    part = rest.pop("part", None)
    values, wrong = _checked(rest, settings)
    faults += wrong
    if part is None:
        faults.append(f'It has no part: write part = "…". Valid: {", ".join(_parts(settings))}.')
    else:
        try:
            values["part"] = settings["part"].value(part)
        except SettingsError:
            faults.append(unknown("part", str(part), _parts(settings)))
    if values.get("part") == "CHAIN" and not values.get("bone"):
        faults.append('A chain needs its first bone: write bone = "…".')
    clip = texts["clip"]
    if clip and texts["source"]:
        faults.append("It has a clip and a source: give the file, or the armature's name.")
    if clip and not is_motion(Path(clip)):
        faults.append(f"'{Path(clip).name}' is no motion file. Valid: {', '.join(SUFFIXES)}.")
    splice = NewSplice(
        clip=resolved(clip) if clip else None,
        source=texts["source"],
        action=texts["action"],
        settings=values,
    )
    return splice, faults


def parse_splice(words: Sequence[str]) -> dict[str, Any]:
    """The table that words of the command line mean: the part, a motion file, NAME=VALUE.

    Raises:
        SettingsError: there is more than one file.
    """
    table: dict[str, Any] = {"part": words[0]}
    for word in words[1:]:
        name, sign, value = word.partition("=")
        if not sign and "clip" in table:
            raise SettingsError(
                f"--splice {words[0]} has two files, '{table['clip']}' and '{word}'.",
                "Write --splice PART FILE NAME=VALUE, with the file to read before it.",
            )
        table[name.strip() if sign else "clip"] = value.strip() if sign else word
    return table


def _checked(
    rest: Mapping[str, Any], settings: Mapping[str, Setting]
) -> tuple[dict[str, Value], list[str]]:
    values, faults = check_settings(settings, rest)
    # A name that does not exist may have been meant for one of the others too.
    shown = _without_landmarks((*SPLICE_KEYS, *settings))
    for number, fault in enumerate(faults):
        name = fault.removeprefix("There is no setting '").partition("'")[0]
        if fault.startswith("There is no setting ") and not name.startswith("landmarks."):
            faults[number] = unknown("setting", name, shown)
    return values, faults


def _without_landmarks(names: Iterable[str]) -> list[str]:
    return [*(name for name in names if not name.startswith("landmarks.")), "landmarks"]


def _text(table: Mapping[str, Any], key: str, faults: list[str]) -> str:
    value = table.get(key, "")
    if not isinstance(value, str) or (key in table and not value.strip()):
        faults.append(f"{key} must be a text, not {value!r}.")
        return ""
    return value


def _parts(settings: Mapping[str, Setting]) -> list[str]:
    return [choice.lower() for choice in settings["part"].choices]
