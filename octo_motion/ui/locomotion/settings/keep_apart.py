# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of how arms keep apart."""

from __future__ import annotations

from ...overridable import BoolProperty


class KeepingApart:
    """What ``Object.octo_motion.locomotion`` has of it."""

    keep_apart: BoolProperty(
        name="Keep Apart",
        description="Arms that would pass through each other or through the body make way: those "
        "in the air, and what does not lie on the ground of those that hold on",
        default=True,
    )
    tell_overlaps: BoolProperty(
        name="Tell Overlaps",
        description="After generating, say at which frame an arm passes deepest through another "
        "or through the body, if by more than a tenth of its thickness",
        default=True,
    )
