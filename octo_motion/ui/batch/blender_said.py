# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender's own operators report when they fail, in one line."""

from __future__ import annotations


def blender_said(error: RuntimeError) -> str:
    """The reason in an error raised by one of Blender's operators.

    If it is a traceback of Python, the reason is its last line but for the place.
    """
    lines = [line.strip() for line in str(error).splitlines()]
    lines = [line for line in lines if line and not line.startswith("Location: ")]
    if not lines:
        return "Blender does not say why."
    reason = lines[-1] if "Traceback" in lines[0] else lines[0]
    return reason.removeprefix("Error: ").rstrip(".") + "."
