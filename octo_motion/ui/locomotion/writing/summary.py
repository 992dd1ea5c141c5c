# SPDX-License-Identifier: GPL-3.0-or-later
"""What is said of a motion that was made."""

from __future__ import annotations

from dataclasses import dataclass

from ....core.locomotion.metrics import Figure


@dataclass(frozen=True)
class Summary:
    """What was made, for people and for reports."""

    gait: str
    manner: str
    """"WALK" or "SWIM"."""
    action: str
    """Name of the action."""
    frames: int
    frame_start: int
    frame_end: int
    seconds: float
    """Length of the motion."""
    miss: float
    """Largest distance of a group of joints from its target, in arm lengths."""
    keys: int
    dense_keys: int
    """How many keys there would be with one per frame."""
    warnings: tuple[str, ...] = ()
    figures: tuple[Figure, ...] = ()
    """The worst of each kind."""
    notes: tuple[str, ...] = ()
    """Things that happened as they should, but that one may want to know."""

    @property
    def message(self) -> str:
        """One sentence, and the notes."""
        told = (
            f"{self.manner.capitalize()} of {self.frames} frames ({self.seconds:.1f} s): "
            f"'{self.action}'."
        )
        fewer = f"{self.keys:,} keys instead of {self.dense_keys:,}."
        return " ".join([told, *([fewer] * (self.keys < self.dense_keys)), *self.notes])
