# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that can be computed without Blender: numpy and the standard library only."""
