# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion files that shots name: BVH, FBX, glTF."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

from ..core.errors import ClipError
from ..core.splicing.clip import check_bvh

SUFFIXES: Final = (".bvh", ".fbx", ".glb", ".gltf")


def is_motion(path: Path) -> bool:
    """Whether a file is one of motion, judged by its name."""
    return path.suffix.lower() in SUFFIXES


def check_motion(path: Path) -> None:
    """Find out what can be found without importing it: whether it is there, and of BVH, which is
    text, everything.

    Raises:
        ClipError: it cannot be used.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise ClipError(
            f"There is no file '{path}'.", f"Give a motion file ({', '.join(SUFFIXES)})."
        ) from None
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise ClipError(f"'{path}' cannot be read: {reason}.", "Give another file.") from error
    if not content:
        raise ClipError(f"'{path}' is empty.", "Export it again.")
    if path.suffix.lower() == ".bvh":
        try:
            check_bvh(content)
        except ClipError as error:
            raise ClipError(f"'{path}': {error.problem}", error.remedy) from error


def files_within(path: Path) -> tuple[Path, ...]:
    """Further files that a .gltf file names; they belong to it."""
    if path.suffix.lower() != ".gltf":
        return ()
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        named = [each.get("uri", "") for each in content.get("buffers", ())]
    except (OSError, ValueError, AttributeError, TypeError):
        # The importer has read it, so this is a matter of what we know of glTF.
        return ()
    found = (path.parent / uri for uri in named if isinstance(uri, str) and "data:" not in uri)
    return tuple(each for each in found if each.is_file())
