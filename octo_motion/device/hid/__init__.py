# SPDX-License-Identifier: GPL-3.0-or-later
"""Devices of the HID standard: space mice and the open force profile."""

from .force_profile import REPORTS, SIZES, ForceDevice, report_descriptor
from .space_mouse import SpaceMouse, model_of
from .system import (
    Found,
    HidDriver,
    descriptor_fingerprint,
    list_devices,
    open_device,
    why_not_read,
)

__all__ = [
    "REPORTS",
    "SIZES",
    "ForceDevice",
    "Found",
    "HidDriver",
    "SpaceMouse",
    "descriptor_fingerprint",
    "list_devices",
    "model_of",
    "open_device",
    "report_descriptor",
    "why_not_read",
]
