# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole motion, worked out on plain arrays."""

from .few_keys import Body, Motion, Tolerances, reduced

__all__ = ["Body", "Motion", "Tolerances", "reduced"]
