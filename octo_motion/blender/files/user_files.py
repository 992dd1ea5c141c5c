# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of the user's own, in the folder that Blender keeps for the extension."""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path

import bpy

from ...core.errors import WriteError


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
        raise unwritable(f"the folder for {name or 'settings'}", error) from error
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
        scratch.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            scratch.unlink(missing_ok=True)
        raise unwritable(f"'{path}'", error) from error


def unwritable(what: str, error: OSError) -> WriteError:
    """The error that says so."""
    reason = error.strerror or type(error).__name__
    return WriteError(f"Octo Motion cannot write {what}: {reason}.", "Choose another place.")
