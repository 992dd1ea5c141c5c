# SPDX-License-Identifier: GPL-3.0-or-later
"""Devices that speak HID: space mice, and force devices of the open profile."""
