# SPDX-License-Identifier: GPL-3.0-or-later
"""One scene of a creature, measured whole: what a row of the referee's table says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from . import creature_measures as measures
from .creature_measures import Worst
from .recording import Recording, moments, record
from .scenes import Scene, build
from .surface import Surface

RATES = (24, 48, 96)
"""Frames a second at which the same motion is made, to see whether it pops."""

UNITS = {
    "slip": "% of an arm in a frame",
    "drift": "% of an arm in a hold",
    "creep": "% of an arm in a hold, of skin that touches the ground, along it",
    "roll": "° in a hold, of a bone whose ends keep still",
    "sink": "% of an arm, deepest skin",
    "sunk": "% of the moments with skin deeper than 0.5 % of an arm",
    "through": "% of the moments with skin through skin",
    "turn": "° in a frame, of a bone in the world",
    "pop": "1: turns halve as the frame rate doubles; 2: they jump",
    "sudden": "starts from rest of more than 15° in a frame",
    "jitter": "% of the tips' velocity above 4 Hz",
    "stretch": "times its length at rest that skin is drawn to",
}
"""What each measure is in, in the order of the table."""


@dataclass(frozen=True)
class Figure:
    """One measure of one scene."""

    value: float
    frame: float | None = None
    where: str = ""

    @classmethod
    def worst(cls, worst: Worst, factor: float = 1.0) -> Figure:
        """From the worst moment."""
        return cls(factor * worst.value, float(worst.frame), worst.name)


def every(recording: Recording, step: int) -> Recording:
    """A recording's moments, one of so many."""
    return replace(
        recording,
        frames=recording.frames[::step],
        heads=recording.heads[::step],
        tails=recording.tails[::step],
        turns=recording.turns[::step],
        skins=[replace(skin, points=skin.points[::step]) for skin in recording.skins],
    )


def measure(scene: Scene) -> dict[str, Figure]:
    """All measures of a motion that is there, frames and half frames."""
    halves = record(scene.armature, moments(scene.start, scene.end, 2))
    whole = every(halves, 2)
    length = measures.arm_length(whole, scene.arms)
    surface = Surface.of(scene.ground)
    rest = measures.resting(whole, scene.arms, surface, length)
    sink = measures.sink(halves, surface, length)
    through = measures.skin_through_skin(whole, scene.arms)
    return {
        "slip": Figure.worst(rest.slip, 100.0),
        "drift": Figure.worst(rest.drift, 100.0),
        "creep": Figure.worst(measures.creeping(whole, surface, length), 100.0),
        "roll": Figure.worst(measures.rolling(whole, scene.arms, length)[0]),
        "sink": Figure.worst(sink.deepest, 100.0),
        "sunk": Figure(100.0 * sink.share),
        "through": Figure(100.0 * through.share, float(through.most.frame)),
        "turn": Figure.worst(measures.turns(whole)),
        "sudden": Figure(float(measures.sudden_starts(whole))),
        "jitter": Figure.worst(measures.jitter(whole, scene.arms), 100.0),
        "stretch": Figure.worst(measures.stretch(whole)),
    }


def continuity(
    setup: str,
    ground: str,
    rig: Path | None = None,
    *,
    change: Callable[[Any], None] | None = None,
    rates: tuple[int, ...] = RATES,
) -> Figure:
    """Whether a motion is smooth: made again and again, at twice the frame rate each time."""
    largest = []
    for rate in rates:
        scene = build(setup, ground, rig, fps=rate, change=change)
        played = record(scene.armature, moments(scene.start, scene.end), with_skin=False)
        largest.append(measures.turns(played))
    found = measures.pop([worst.value for worst in largest])
    return Figure(found, largest[-1].frame * rates[0] / rates[-1], largest[-1].name)
