# SPDX-License-Identifier: GPL-3.0-or-later
"""Devices of the HID standard: space mice and the open force profile."""

from .drivers import HID_DRIVERS, hid_driver_for
from .force_profile import REPORTS, SIZES, report_descriptor
from .models import model_of
from .system import Found, descriptor_fingerprint, list_devices, open_device

__all__ = [
    "HID_DRIVERS",
    "REPORTS",
    "SIZES",
    "Found",
    "descriptor_fingerprint",
    "hid_driver_for",
    "list_devices",
    "model_of",
    "open_device",
    "report_descriptor",
]
