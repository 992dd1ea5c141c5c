# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists of a shot, as they are asked for in a job file: changes of gait, reaches, contacts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from ..core.errors import OctoMotionError
from .setting_values import Setting, check_settings, unknown

LISTS: Final = ("changes", "reaches", "contacts")
"""What a shot may have, each a list of tables."""

_NEEDED: Final[dict[str, tuple[str, ...]]] = {
    "changes": ("gait", "position"),
    "reaches": (),
    "contacts": ("arm", "cycle"),
}
_EXAMPLES: Final = {
    "changes": '[{ gait = "swim", position = 0.5 }]',
    "reaches": '[{ target = "Ball", arm = "Arm 1 L", frame_contact = 40 }]',
    "contacts": '[{ arm = "Arm 1 L", cycle = 2, shift = 0.1 }]',
}

Items = list[dict[str, Any]]
"""The settings of each item of a list, by name."""


def read_list(
    name: str, given: Any, settings: Mapping[str, Setting], gait: Callable[[str], object]
) -> tuple[Items, list[str]]:
    """The items of one list, and all that is wrong with them.

    Args:
        name: of the list, one of ``LISTS``.
        given: as it stands in the job file.
        settings: of an item, by name.
        gait: a gait by name; raises OctoMotionError.
    """
    if not isinstance(given, list) or not all(isinstance(each, dict) for each in given):
        return [], [f"{name} must be a list of tables, such as {_EXAMPLES[name]}."]
    items: Items = []
    faults: list[str] = []
    for place, table in enumerate(given, 1):
        values, wrong = check_settings(settings, table)
        wrong = [_of_item(fault, settings) for fault in wrong]
        wrong += [
            f"It has no {each}: write {each} = …." for each in _NEEDED[name] if each not in table
        ]
        if name == "changes" and isinstance(values.get("gait"), str):
            try:
                gait(str(values["gait"]))
            except OctoMotionError as error:
                wrong.append(str(error))
        items.append(dict(values))
        faults += [f"{name} {place}: {each}" for each in wrong]
    return items, faults


def _of_item(fault: str, settings: Mapping[str, Setting]) -> str:
    """A fault as it is told of an item, which has few settings."""
    start = "There is no setting '"
    if not fault.startswith(start):
        return fault
    return unknown("setting", fault.removeprefix(start).partition("'")[0], settings)
