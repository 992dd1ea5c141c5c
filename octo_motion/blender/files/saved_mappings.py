# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's mappings of skeletons: JSON files in the folder that Blender keeps for them."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from ...core.errors import RigError
from ...core.files import read_text
from ...core.phrases import phrase
from ...core.splicing.humanoid import SavedMapping, damaged_mapping, mapping_from_json
from .user_files import (
    LONGEST_NAME,
    SUFFIX,
    file_named,
    name_of,
    own_folder,
    unwritable,
    write_whole,
)

_read: Final[dict[Path, tuple[tuple[int, int], SavedMapping | RigError]]] = {}
"""What files have, by path, with the time they were written and their length then."""


def mapping_names() -> list[str]:
    """Names of all saved mappings, damaged ones too, sorted."""
    return sorted((name_of(path) for path in _folder().glob(f"*{SUFFIX}")), key=str.casefold)


def load_mappings() -> tuple[list[SavedMapping], list[RigError]]:
    """All that can be read, by name, and what is wrong with the others."""
    mappings: list[SavedMapping] = []
    damaged: list[RigError] = []
    for name in mapping_names():
        found = _load(name)
        if isinstance(found, RigError):
            damaged.append(found)
        else:
            mappings.append(found)
    return mappings, damaged


def load_mapping(name: str) -> SavedMapping:
    """A mapping by name.

    Raises:
        RigError: there is none, or its file is damaged.
    """
    if not name or not _path(name).is_file():
        raise RigError(phrase("There is no saved mapping '{name}'.", name=name), _choice())
    found = _load(name)
    if isinstance(found, RigError):
        raise found
    return found


def save_mapping(mapping: SavedMapping, *, overwrite: bool = False) -> Path:
    """Keep a mapping under its own name.

    Raises:
        RigError: the name is empty, too long, or taken.
        WriteError: the file cannot be written.
    """
    name = mapping.name
    if not name.strip():
        raise RigError("The mapping has no name.", "Give it one.")
    if len(name) > LONGEST_NAME:
        raise RigError(
            phrase("The mapping's name has {count} letters.", count=len(name)),
            phrase("Use {longest_name} at most.", longest_name=LONGEST_NAME),
        )
    path = _path(name)
    if path.exists() and not overwrite:
        raise RigError(
            phrase("There is a mapping '{name}' already.", name=name),
            "Choose another name, or overwrite.",
        )
    _folder(create=True)
    write_whole(path, mapping.to_json())
    return path


def remove_mapping(name: str) -> None:
    """Delete a saved mapping, damaged or not.

    Raises:
        RigError: there is none of that name.
        WriteError: the file cannot be deleted.
    """
    path = _path(name)
    if not name or not path.is_file():
        raise RigError(phrase("There is no saved mapping '{name}'.", name=name), _choice())
    try:
        path.unlink()
    except OSError as error:
        raise unwritable(f"'{path}'", error) from error


def _folder(*, create: bool = False) -> Path:
    return own_folder("mappings", create=create)


def _path(name: str) -> Path:
    return file_named(_folder(), name)


def _choice() -> str:
    names = mapping_names()
    return phrase("Choose one of {names}.", names=", ".join(names)) if names else "Save one first."


def _load(name: str) -> SavedMapping | RigError:
    path = _path(name)
    try:
        state = path.stat()
        written = state.st_mtime_ns, state.st_size
        if path not in _read or _read[path][0] != written:
            _read[path] = written, _parsed(read_text(path), name)
    except (OSError, UnicodeDecodeError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or phrase("it is not text")
        return damaged_mapping(name, reason)
    return _read[path][1]


def _parsed(text: str, name: str) -> SavedMapping | RigError:
    try:
        return mapping_from_json(text, name)
    except RigError as error:
        return error
