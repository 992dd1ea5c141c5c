# SPDX-License-Identifier: GPL-3.0-or-later
"""Programs of ours in processes of their own, under Blender's Python and without Blender."""

from .pool import computed_apart, helpers
from .python import LAUNCHER, PROCESSES, processors, python_path, start_program

__all__ = [
    "LAUNCHER",
    "PROCESSES",
    "computed_apart",
    "helpers",
    "processors",
    "python_path",
    "start_program",
]
