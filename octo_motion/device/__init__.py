# SPDX-License-Identifier: GPL-3.0-or-later
"""Six-degree-of-freedom devices: reading them, and giving them force, in a process of their own.

Frames and units are Blender's throughout: X right, Y away from the user, Z up; metres, radians,
seconds, newtons. Nothing here needs Blender.
"""
