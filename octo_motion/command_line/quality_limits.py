# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of how good a motion is, for the report, and limits that let a shot fail."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from ..core.errors import OctoMotionError
from ..core.locomotion.metrics import KINDS, Figure

NAMES: Final = tuple(kind.lower() for kind in KINDS)
"""What may be limited, as jobs and reports call it."""

_DEGREES: Final = "turn"
"""What people know in degrees."""
_LOOKED_FOR: Final = "overlap"
"""What is measured only where the settings say so."""


class LimitError(OctoMotionError):
    """A motion is not as good as it has to be.

    ``summary`` is that of the motion, whose outputs are not to be kept.
    """

    def __init__(self, problem: str, summary: Any, remedy: str = "") -> None:
        super().__init__(problem, remedy)
        self.summary = summary


def quality(figures: Sequence[Figure]) -> dict[str, dict[str, Any]]:
    """Figures for a report: value, frame and arm of the worst of each kind, by name.

    Values are in arm lengths (slip, depth, miss), shares (strain), degrees per frame (turn) and
    radii (overlap); none for what is no finite number, which JSON does not know.
    """
    return {
        figure.kind.lower(): {
            "value": _value(figure) if math.isfinite(figure.value) else None,
            "frame": figure.frame,
            "arm": figure.arm,
        }
        for figure in figures
    }


def told(figures: Sequence[Figure]) -> str:
    """Figures in words, in the units of :func:`quality`."""
    return "; ".join(
        f"{figure.kind.lower()} {_value(figure):.3g} at frame {figure.frame}{_of(figure)}"
        for figure in figures
    )


def check_limits(limits: Mapping[str, float], summary: Any) -> None:
    """Make sure that a motion is as good as it has to be.

    A figure that it does not have, such as the slip of a swim, keeps to any limit.

    Args:
        limits: by name, in the units of :func:`quality`.
        summary: of the motion, with its ``figures``.

    Raises:
        LimitError: a figure is above its limit, or nobody has looked.
    """
    found = {figure.kind.lower(): figure for figure in summary.figures}
    if _LOOKED_FOR in limits and _LOOKED_FOR not in found:
        raise LimitError(
            "Overlaps are limited, but were not looked for.",
            summary,
            "Switch tell_overlaps on, or leave the limit out.",
        )
    above = []
    for name in NAMES:
        if name not in limits or name not in found:
            continue
        figure, limit = found[name], limits[name]
        value = _value(figure)
        # What is no number keeps to no limit.
        if not value <= limit:
            above.append(
                f"{name} is {_shown(value, limit)} at frame {figure.frame}{_of(figure)}, "
                f"above its limit of {limit:g}"
            )
    if above:
        sentence = "; ".join(above)
        raise LimitError(f"{sentence[0].upper()}{sentence[1:]}.", summary)


def _value(figure: Figure) -> float:
    name = figure.kind.lower()
    return math.degrees(figure.value) if name == _DEGREES else figure.value


def _of(figure: Figure) -> str:
    return f" ({figure.arm})" if figure.arm else ""


def _shown(value: float, limit: float) -> str:
    """A value with as many digits as it takes to see that it is above its limit."""
    texts = (f"{value:.{digits}g}" for digits in range(3, 17))
    return next((text for text in texts if not float(text) <= limit), repr(value))
