# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender's own operators report when they fail, in one line."""

from __future__ import annotations


def blender_said(error: RuntimeError) -> str:
    """The reason in an error raised by one of Blender's operators.

    If it is a traceback of Python, the reason is the first line that is not indented.
    """
    lines = [line for line in str(error).splitlines() if line.strip()]
    if lines and "Traceback" in lines[0]:
        lines = [line for line in lines[1:] if not line.startswith(" ")]
    if not lines:
        return "Blender does not say why."
    reason = lines[0].strip()
    return reason.removeprefix("Error: ").rstrip(".") + "."
