# SPDX-License-Identifier: GPL-3.0-or-later
"""From core's result to actions, markers and figures."""

from .following import Following
from .shot import RESULTS, Before, Shot, Summary, generate_locomotion, make, prepare, show_contacts

__all__ = [
    "RESULTS",
    "Before",
    "Following",
    "Shot",
    "Summary",
    "generate_locomotion",
    "make",
    "prepare",
    "show_contacts",
]
