# SPDX-License-Identifier: GPL-3.0-or-later
"""One table of a job for many shots: for each file of a folder, or for each action of a file."""

from __future__ import annotations

import fnmatch
import glob
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from ..core.errors import SettingsError
from ..core.files import plain_name
from ..core.splicing.clip import MOTION_SUFFIXES
from .vocabulary import check_path

_ENDINGS: Final = (*MOTION_SUFFIXES, ".blend")


def for_each(
    table: Mapping[str, Any], folder: Path, actions: Callable[[Path], list[str]]
) -> list[dict[str, Any]]:
    """The shots that a table means: itself, or with ``each`` one for each file or action, in whose
    texts ``{each}`` is the file, or the action's name, and ``{stem}`` what shots may be called by.

    ``each`` is a folder, a pattern such as "clips/*.bvh", or { actions = "hero.blend" }, of which
    ``named`` may say which: { actions = "hero.blend", named = "Walk*" }.

    Raises:
        OctoMotionError: it is none of these, or there is nothing of the kind.
    """
    if "each" not in table:
        return [dict(table)]
    given, rest = table["each"], {"name": "{stem}", **table}
    del rest["each"]
    if isinstance(given, str) and given.strip():
        found = _files(given, folder)
    elif (
        isinstance(given, Mapping)
        and given.keys() <= {"actions", "named"}
        and all(isinstance(each, str) for each in given.values())
        and "actions" in given
    ):
        file, pattern = given["actions"], given.get("named", "*")
        check_path(file)
        names = actions((folder / Path(file).expanduser()).resolve())
        found = {name: name for name in sorted(names) if fnmatch.fnmatchcase(name, pattern)}
    else:
        raise SettingsError(
            f"each must be a folder, a pattern, or a table, not {given!r}.",
            'Write each = "clips/*.bvh", or each = { actions = "hero.blend" }.',
        )
    if not found:
        raise SettingsError(f"There is nothing for each of {given!r}.", "Give what is there.")
    return [
        _filled(rest, {"{each}": text, "{stem}": plain_name(stem)}) for text, stem in found.items()
    ]


def _files(text: str, folder: Path) -> dict[str, str]:
    """Files of a folder or a pattern, as a job has them, with their names: the same order on every
    system.
    """
    check_path(text)
    pattern = Path(text).expanduser()
    if (folder / pattern).is_dir():
        named = (each for each in (folder / pattern).iterdir() if each.suffix.lower() in _ENDINGS)
    else:
        # Not Path.glob: the pattern may be an absolute path.
        found = glob.glob(str(pattern), root_dir=folder, recursive=True)  # noqa: PTH207
        named = (folder / each for each in found)
    files = (each for each in named if each.is_file() and not each.name.startswith("."))
    ordered = sorted(files, key=lambda each: each.as_posix())
    return {_relative(each, folder): each.stem for each in ordered}


def _relative(path: Path, folder: Path) -> str:
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:
        # On another drive of Windows.
        return path.as_posix()


def _filled(value: Any, words: Mapping[str, str]) -> Any:
    """A value of a table with words in place of others, in all of its texts."""
    if isinstance(value, str):
        for word, meant in words.items():
            value = value.replace(word, meant)
        return value
    if isinstance(value, Mapping):
        return {name: _filled(each, words) for name, each in value.items()}
    if isinstance(value, list):
        return [_filled(each, words) for each in value]
    return value
