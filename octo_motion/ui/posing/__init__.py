# SPDX-License-Identifier: GPL-3.0-or-later
"""Posing a rig by hand, as a puppet."""
