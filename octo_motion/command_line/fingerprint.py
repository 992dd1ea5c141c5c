# SPDX-License-Identifier: GPL-3.0-or-later
"""What a result depends on, in a few digits: unchanged, it need not be made again."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any


def fingerprint(asked: Mapping[str, Any], gait: str) -> str:
    """Digits that change with the shot's table, the gait's content and our version.

    Files that are read have digests of their own, see :func:`digest`.
    """
    content = {"asked": asked, "gait": gait, "version": version()}
    text = json.dumps(content, sort_keys=True, ensure_ascii=False, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def digest(path: Path) -> str:
    """SHA-256 of a file's content, or "" where there is none that can be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


@cache
def version() -> str:
    """Our version, from the manifest: in an installed extension beside the code, else above it."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package, package.parent):
        manifest = folder / "blender_manifest.toml"
        if manifest.is_file():
            return str(tomllib.loads(manifest.read_text(encoding="utf-8"))["version"])
    return "unknown"
