# SPDX-License-Identifier: GPL-3.0-or-later
"""Where devices may come from."""

from .discovery import HID_DRIVERS, Discovery, Sources, hid_driver_for

__all__ = ["HID_DRIVERS", "Discovery", "Sources", "hid_driver_for"]
