# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's own Python, to run programs of ours in processes of their own."""

from __future__ import annotations

import contextlib
import importlib.util
import itertools
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

LAUNCHER: Final = Path(__file__).with_name("launch.py")
PROCESSES: Final = "OCTO_MOTION_PROCESSES"
"""Environment variable: how many processes may work for this one at a time."""


def processors() -> int:
    """Processors that this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def python_path() -> Path | None:
    """The Python to run programs of ours with, of the same version as this one; None without one.

    Within Blender ``sys.executable`` is the Python that Blender brings; in some builds it is
    Blender itself, or empty. Then Python lies below ``sys.prefix``.
    """
    major, minor, *_ = sys.version_info
    names: tuple[str, ...] = (f"python{major}.{minor}", "python3", "python")
    if os.name == "nt":
        names = ("python.exe",)
    prefixes = dict.fromkeys((sys.prefix, sys.base_prefix, sys.exec_prefix))
    below = (Path(*each) for each in itertools.product(prefixes, ("bin", "."), names))
    for path in (Path(sys.executable or "."), *below):
        if path.name.lower().startswith("python") and path.is_file() and os.access(path, os.X_OK):
            return path
    return None


def library_folders() -> list[str]:
    """Where this Python has numpy and hidapi; the extension's wheels have a folder of their own."""
    folders: dict[str, None] = {}
    for name in ("numpy", "hid", "hidraw"):
        with contextlib.suppress(ImportError, ValueError):
            specification = importlib.util.find_spec(name)
            if specification is not None and specification.origin:
                origin = Path(specification.origin).parent
                folders[str(origin.parent if name == "numpy" else origin)] = None
    return list(folders)


def start_program(
    python: Path,
    module: str,
    arguments: Sequence[str],
    *,
    messages: Any = None,
    environment: Mapping[str, str] | None = None,
) -> subprocess.Popen[bytes]:
    """Start the ``main`` of a module of ours, which has no Blender, with pipes to it and from it.

    ``messages`` is where its standard error goes, as ``subprocess`` has it; the environment is
    added to that of this process.

    Raises:
        OSError: it does not start.
    """
    command = [str(python), "-I", "-X", "utf8", str(LAUNCHER), module, *arguments]
    for folder in library_folders():
        command += ["--library", folder]
    added = dict(environment or {})
    runtime = runtime_folder(python)
    if runtime is not None:
        command += ["--dlls", str(runtime)]
        added["PATH"] = f"{runtime}{os.pathsep}{os.environ.get('PATH', '')}"
    return subprocess.Popen(  # noqa: S603 - our own program
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=messages,
        env={**os.environ, **added} if added else None,
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
    )


def runtime_folder(python: Path) -> Path | None:
    """Where Blender for Windows has Microsoft's C runtime: its Python alone does not find it."""
    for folder in python.parents[:5]:
        if (folder / "blender.crt").is_dir():
            return folder / "blender.crt"
    return None
