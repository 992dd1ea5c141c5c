# SPDX-License-Identifier: GPL-3.0-or-later
"""Where devices may come from."""

from .discovery import Discovery, Sources
from .network import KEY_BYTES

__all__ = ["KEY_BYTES", "Discovery", "Sources"]
