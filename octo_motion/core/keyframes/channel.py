# SPDX-License-Identifier: GPL-3.0-or-later
"""What is to be keyed, before Blender is asked."""

from __future__ import annotations

from dataclasses import dataclass

from ..rotations import Floats
from .reduction import BezierKeys


@dataclass(frozen=True, eq=False)
class Channel:
    """One animated property: as many F-curves as it has components."""

    data_path: str
    values: Floats
    """(frames, components)"""
    group: str
    keys: BezierKeys | None = None
    """What is written in place of one linear key per frame."""
