# SPDX-License-Identifier: GPL-3.0-or-later
"""How good a motion is: slip, drift, depth, strain, miss, turn, overlap."""

from .report import (
    KINDS,
    TOLD,
    Figure,
    Measured,
    Played,
    finding_figures,
    played_arm,
    warnings_for_figures,
)

__all__ = [
    "KINDS",
    "TOLD",
    "Figure",
    "Measured",
    "Played",
    "finding_figures",
    "played_arm",
    "warnings_for_figures",
]
