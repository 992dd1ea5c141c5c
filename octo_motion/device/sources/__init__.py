# SPDX-License-Identifier: GPL-3.0-or-later
"""Where devices may come from."""

from .discovery import HID_DRIVERS, Discovery, Sources, hid_driver_for
from .network import KEY_BYTES

__all__ = ["HID_DRIVERS", "KEY_BYTES", "Discovery", "Sources", "hid_driver_for"]
