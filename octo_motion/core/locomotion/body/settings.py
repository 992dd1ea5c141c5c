# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of all that a body does by itself it does."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Final

from ...settings import check_settings, setting

_amount: Final = partial(
    setting, default=0.0, offered=1.0, low=0.0, high=2.0, step=10, precision=2, subtype="FACTOR"
)
"""A slider that reads 0 … 1 … 2: nothing, as it is meant, twice that."""


@dataclass(frozen=True)
class BodySettings:
    """Amounts of what a body does by itself: 0 for nothing, 1 for what is natural, 2 at most."""

    surge: float = _amount(
        "Surge and Bob",
        "Walking: how far the body shoots ahead and rises with each push of its arms, and sinks "
        "and slows down in between: more where fewer arms hold on. Feet stay where they are",
    )

    mantle: float = _amount(
        "Mantle",
        "How far the mantle trails behind the body, swings and settles when that turns, starts and "
        "stops, and how far each stroke of a swim draws it together",
    )
    siphon: float = _amount(
        "Siphon",
        "How far the siphon points against the travel, where the jet goes, and how much it swells "
        "as the mantle breathes out",
    )
    eyes: float = _amount(
        "Eyes",
        "How far the eyes turn towards where the body goes, or to what they look at, blink, and "
        "keep their slits level; from 1 on they are level all the time",
    )
    head: float = _amount(
        "Steady Head",
        "How much of the body's quick turns the head takes back",
    )
    trail: bool = setting(
        "Follow-Through",
        "The outer thirds of free arms trail in the water, swing and settle. What rests on the "
        "ground stays where it is. Generate takes longer",
        default=False,
    )

    def __post_init__(self) -> None:
        check_settings(self)
