# SPDX-License-Identifier: GPL-3.0-or-later
"""What a hand at a device feels."""

from .pointer import Pointer
from .schedule import Schedule, make_real_time

__all__ = ["Pointer", "Schedule", "make_real_time"]
