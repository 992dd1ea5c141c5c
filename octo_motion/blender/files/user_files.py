# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's own files, in the folder that Blender keeps for the extension: gaits and devices."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import re
import secrets
from pathlib import Path
from typing import Any, Final

import bpy

from ...core.errors import DeviceError, GaitError, WriteError
from ...core.files import BUSY, DEVICES, read_text, replace
from ...core.locomotion.gait import (
    GaitTable,
    gait_from_json,
    gait_presets,
    gait_to_json,
    renamed_gait,
)
from ...core.phrases import phrase
from ...device.calibration import Calibration
from ...device.driver import six


def own_folder(name: str = "", *, create: bool = False) -> Path:
    """A folder for the user's files: of the extension its own, else below the scripts' presets.

    Raises:
        WriteError: it is to be made and cannot be.
    """
    package = __name__.rpartition(".blender.")[0]
    try:
        if package.startswith("bl_ext."):
            path = bpy.utils.extension_path_user(package, path=name, create=create)
        else:
            folder = os.path.join("presets", "octo_motion", name)  # noqa: PTH118 - Blender's way
            path = bpy.utils.user_resource("SCRIPTS", path=folder, create=create)
    except OSError as error:
        raise unwritable(
            phrase("the folder for {name}", name=name or phrase("settings")), error
        ) from error
    return Path(path)


def write_whole(path: Path, text: str) -> None:
    """Write a file, whole or not at all.

    Raises:
        WriteError: it cannot be written.
    """
    # Not tempfile's: those are for their owner's eyes alone, and this one becomes the result.
    scratch = path.with_name(f".{secrets.token_hex(4)}.part")
    try:
        with scratch.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
        replace(scratch, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            scratch.unlink(missing_ok=True)
        raise unwritable(f"'{path}'", error) from error


def unwritable(what: str, error: OSError) -> WriteError:
    """The error that says so."""
    if getattr(error, "winerror", None) in BUSY:
        return WriteError(
            phrase("{what} is protected, or open in another program.", what=what),
            "Close it there, and try again.",
        )
    reason = error.strerror or type(error).__name__
    return WriteError(
        phrase("Octo Motion cannot write {what}: {reason}.", what=what, reason=reason),
        "Choose another place.",
    )


# --- The user's own gaits: JSON files in the folder that Blender keeps for the extension ----------


SUFFIX: Final = ".json"
LONGEST_NAME: Final = 60
"""Letters, each at most four bytes, escaped or not: with the ending within the 255 bytes that file
systems take."""

# What some file system refuses, and the escape itself.
_UNSAFE: Final = re.compile(r'[\x00-\x1f<>:"/\\|?*%\x7f]|^[. ]|[. ]$')
_ESCAPE: Final = re.compile("%([0-9a-f]{2})")


def user_folder(*, create: bool = False) -> Path:
    """Where the user's gaits are; of the extension its own folder, else the scripts' presets.

    Raises:
        WriteError: it is to be made and cannot be.
    """
    return own_folder("gaits", create=create)


def gait_names() -> list[str]:
    """Names of all gaits: those that come with the extension, then the user's."""
    return [*gait_presets(), *user_gait_names()]


def has_gait(name: str) -> bool:
    """Whether there is a gait of that name; quick enough to be asked while a panel is drawn."""
    return name in gait_presets() or (bool(name) and _path_of(name).is_file())


def user_gait_names() -> list[str]:
    """Names of the user's own gaits, sorted."""
    built_in = gait_presets()
    names = (name_of(path) for path in user_folder().glob(f"*{SUFFIX}"))
    return sorted((name for name in names if name not in built_in), key=str.casefold)


def load_gait(name: str) -> GaitTable:
    """A gait by name, with that name.

    Raises:
        GaitError: there is none, or its file is damaged.
    """
    built_in = gait_presets()
    if not name:
        raise GaitError(
            "No gait is chosen.",
            phrase("Choose one of {names}.", names=", ".join(gait_names())),
        )
    if name in built_in:
        return built_in[name]
    path = _path_of(name)
    if not path.is_file():
        raise GaitError(
            phrase("There is no gait '{name}'.", name=name),
            phrase("Choose one of {names}.", names=", ".join(gait_names())),
        )
    return renamed_gait(read_gait_file(path), name)


def save_gait(table: GaitTable, *, overwrite: bool = False) -> Path:
    """Keep a table as one of the user's gaits, under its own name.

    Raises:
        GaitError: the name is empty, too long, that of a gait of the extension, or taken.
        WriteError: the file cannot be written.
    """
    name = table.name
    if not name.strip():
        raise GaitError("The gait has no name.", "Give it one.")
    if len(name) > LONGEST_NAME:
        raise GaitError(
            phrase("The gait's name has {count} letters.", count=len(name)),
            phrase("Use {longest_name} at most.", longest_name=LONGEST_NAME),
        )
    if name in gait_presets():
        raise GaitError(
            phrase("The gait '{name}' comes with Octo Motion.", name=name), "Choose another name."
        )
    path = _path_of(name)
    if path.exists() and not overwrite:
        raise GaitError(
            phrase("There is a gait '{name}' already.", name=name),
            "Choose another name, or overwrite.",
        )
    user_folder(create=True)
    write_gait(table, path)
    return path


def remove_gait(name: str) -> None:
    """Delete one of the user's gaits.

    Raises:
        GaitError: there is none of that name, or it comes with the extension.
        WriteError: the file cannot be deleted.
    """
    if name in gait_presets():
        raise GaitError(
            phrase("The gait '{name}' comes with Octo Motion.", name=name), "It cannot be removed."
        )
    path = _path_of(name)
    if not name or not path.is_file():
        raise GaitError(
            phrase("There is no saved gait '{name}'.", name=name), "Choose one that you have saved."
        )
    try:
        path.unlink()
    except OSError as error:
        raise unwritable(f"'{path}'", error) from error


def read_gait_file(path: Path) -> GaitTable:
    """The gait in a file.

    Raises:
        GaitError: it cannot be read, or is no gait.
    """
    try:
        text = read_text(path)
    except (OSError, UnicodeDecodeError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or phrase("it is not text")
        raise GaitError(
            phrase("'{path}' cannot be read: {reason}.", path=path.name, reason=reason),
            "Choose a gait file.",
        ) from error
    return gait_from_json(text, f"'{path.name}'")


def write_gait(table: GaitTable, path: Path) -> None:
    """Write a gait to a file, whole or not at all.

    Raises:
        WriteError: it cannot be written.
    """
    write_whole(path, gait_to_json(table))


def _path_of(name: str) -> Path:
    return file_named(user_folder(), name)


def file_named(folder: Path, name: str) -> Path:
    """The file of a name: any name has one, and no two names share one."""
    safe = _UNSAFE.sub(lambda found: f"%{ord(found.group()):02x}", name)
    safe = DEVICES.sub(lambda found: f"%{ord(found.group()[0]):02x}{found.group()[1:]}", safe)
    return folder / f"{safe}{SUFFIX}"


def name_of(path: Path) -> str:
    """The name of a file that :func:`file_named` gave."""
    return _ESCAPE.sub(lambda found: chr(int(found.group(1), 16)), path.stem)


# --- What was learned of the user's devices: one file for this computer, whatever is opened -------


log = logging.getLogger(__name__)

_FORMAT: Final = "octo_motion.devices"
_VERSION: Final = 1
_AXES: Final = ("rest", "least", "most")


def _path(*, create: bool = False) -> Path:
    return own_folder("devices", create=create) / "calibrations.json"


def load_calibrations() -> dict[str, Calibration]:
    """By a device's identity. What is damaged counts as never learned, and is said in the log."""
    path = _path()
    try:
        data: Any = json.loads(path.read_text(encoding="utf-8"))
        entries: Any = data["devices"] if data["format"] == _FORMAT else {}
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        log.warning("Calibrations of devices cannot be read: %s", error)
        return {}
    found: dict[str, Calibration] = {}
    for identity, entry in entries.items() if isinstance(entries, dict) else ():
        try:
            found[identity] = Calibration(*(six(entry[name]) for name in _AXES))
        except (ValueError, KeyError, TypeError, DeviceError) as error:
            log.warning("The calibration of %s cannot be read: %s", identity, error)
    return found


def save_calibrations(calibrations: dict[str, Calibration]) -> None:
    """Keep these, and no others.

    Raises:
        WriteError: the file cannot be written.
    """
    devices = {
        identity: {name: getattr(each, name) for name in _AXES}
        for identity, each in sorted(calibrations.items())
    }
    text = json.dumps({"format": _FORMAT, "version": _VERSION, "devices": devices}, indent=1)
    write_whole(_path(create=True), text + "\n")
