# SPDX-License-Identifier: GPL-3.0-or-later
"""Devices of the HID standard: space mice and the open force profile."""

from .force_device import ForceDevice, is_force_device
from .force_profile import REPORTS, SIZES, report_descriptor
from .models import model_of
from .space_mouse import SpaceMouse, is_space_mouse
from .system import Found, descriptor_fingerprint, list_devices, open_device

__all__ = [
    "REPORTS",
    "SIZES",
    "ForceDevice",
    "Found",
    "SpaceMouse",
    "descriptor_fingerprint",
    "is_force_device",
    "is_space_mouse",
    "list_devices",
    "model_of",
    "open_device",
    "report_descriptor",
]
