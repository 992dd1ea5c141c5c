# SPDX-License-Identifier: GPL-3.0-or-later
"""Locomotion: rig, arms, gait, route, generate."""
