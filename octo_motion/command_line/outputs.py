# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are written whole or not at all.

Each is written under another name in its own folder, so that paths relative to it are right and
taking its place is one step of the file system. Only when all of them are complete do they.
"""

from __future__ import annotations

import json
import os
import secrets
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..core.errors import WriteError


@contextmanager
def staged(outputs: Iterable[Path]) -> Iterator[dict[Path, Path]]:
    """Where to write each output for now. On leaving, nothing of that is left.

    Folders are made as needed.

    Raises:
        WriteError: a folder cannot be made or written to.
    """
    token = secrets.token_hex(4)
    places = {path: path.with_name(f".{path.stem}.{token}.part{path.suffix}") for path in outputs}
    try:
        for path, place in places.items():
            _check_writable(path, place)
        yield places
    finally:
        for place in places.values():
            remove_staged(place)


def commit(places: Mapping[Path, Path]) -> None:
    """Let the files that were written take the places of the outputs.

    Raises:
        WriteError: one is missing, or cannot take its place. As a rule nothing has changed then.
    """
    for path, place in places.items():
        if not place.is_file():
            raise WriteError(f"'{path}' was not written.", "See what Blender said.")
    for path, place in places.items():
        try:
            place.replace(path)
        except OSError as error:
            raise _unwritable(path, error) from error


def remove_staged(place: Path) -> None:
    """Delete an unfinished file, and the one that Blender itself first writes beside it."""
    for leftover in (place, place.with_name(place.name + "@")):
        # What cannot be deleted is at least no output.
        try:
            leftover.unlink(missing_ok=True)
        except OSError:
            continue


def write_json(path: Path, content: Any) -> None:
    """Write a JSON file, whole or not at all.

    Raises:
        WriteError: it cannot be written.
    """
    with staged([path]) as places:
        try:
            text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
            places[path].write_text(text, encoding="utf-8")
        except OSError as error:
            raise _unwritable(path, error) from error
        commit(places)


def _check_writable(path: Path, place: Path) -> None:
    if path.is_dir():
        raise WriteError(f"'{path}' is a folder.", "Give the name of a file.")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        place.touch(exist_ok=False)
        # An exporter must not find a file there that it has not written itself.
        place.unlink()
    except OSError as error:
        raise _unwritable(path, error) from error


def _unwritable(path: Path, error: OSError) -> WriteError:
    reason = error.strerror or os.fspath(type(error).__name__)
    return WriteError(f"'{path}' cannot be written: {reason}.", "Choose another place.")
