# SPDX-License-Identifier: GPL-3.0-or-later
"""From core's result to actions, markers and figures."""

from .shot import RESULTS, Shot, Summary, generate_locomotion, make, prepare, show_contacts

__all__ = ["RESULTS", "Shot", "Summary", "generate_locomotion", "make", "prepare", "show_contacts"]
