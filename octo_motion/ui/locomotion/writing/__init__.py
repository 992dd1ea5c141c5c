# SPDX-License-Identifier: GPL-3.0-or-later
"""From core's result to actions, markers and figures."""

from .summary import Summary
from .write_motion import Shot, show_contacts

__all__ = ["Shot", "Summary", "show_contacts"]
