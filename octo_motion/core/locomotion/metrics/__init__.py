# SPDX-License-Identifier: GPL-3.0-or-later
"""How good a motion is: slip, depth, strain, miss, turn, overlap."""

from .report import KINDS, TOLD, Figure, Measured, figures

__all__ = ["KINDS", "TOLD", "Figure", "Measured", "figures"]
