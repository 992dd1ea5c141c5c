# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings that are declared once: bounds and defaults beside the fields that core reads."""

from dataclasses import dataclass, fields, replace

import pytest

from octo_motion.core.errors import SettingsError
from octo_motion.core.locomotion.gait import GaitSettings, gait_presets
from octo_motion.core.locomotion.ground import StanceSettings
from octo_motion.core.locomotion.path import TravelSettings
from octo_motion.core.settings import check_settings, declared_settings, setting

OWN = (GaitSettings(gait_presets()["walk"]), TravelSettings(), StanceSettings())


@dataclass(frozen=True)
class Kettle:
    """What the tests set."""

    heat: float = setting("Heat", "How hot it is", default=0.5, low=0.0, high=1.0)
    cups: int = setting("Cups", "How many it fills", default=2, low=1)
    cold: float = setting("Cold", "How cold it is", default=0.0, high=1.0)
    lid: bool = setting("Lid", "Whether it is closed", default=True)
    weight: float = 1.0
    sizes: tuple[float, ...] = (1.0,)

    def __post_init__(self) -> None:
        check_settings(self)


def test_a_setting_is_a_field_like_any_other() -> None:
    assert (Kettle.heat, Kettle(0.25).heat, Kettle().lid) == (0.5, 0.25, True)
    assert list(declared_settings(Kettle)) == ["heat", "cups", "cold", "lid"]


@pytest.mark.parametrize("wrong", ["heat", "weight", "cold"])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_what_is_not_finite_is_told_by_its_label(wrong: str, value: float) -> None:
    with pytest.raises(SettingsError, match=f"{wrong.capitalize()} is not a number. Set it anew."):
        replace(Kettle(), **{wrong: value})
    with pytest.raises(SettingsError, match="Sizes is not a number"):
        Kettle(sizes=(1.0, value))


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"heat": 1.5}, "Heat is 1.5. Give a value from 0 to 1."),
        ({"heat": -0.5}, "Heat is -0.5. Give a value from 0 to 1."),
        ({"cups": 0}, "Cups is 0. Give 1 or more."),
        ({"cold": 2.0}, "Cold is 2. Give 1 or less."),
    ],
)
def test_what_is_out_of_bounds_is_told_with_the_bounds(wrong: dict[str, float], says: str) -> None:
    with pytest.raises(SettingsError) as caught:
        replace(Kettle(), **wrong)

    assert str(caught.value) == says


@pytest.mark.parametrize("own", OWN, ids=lambda own: type(own).__name__)
def test_bounds_themselves_are_allowed(own: object) -> None:
    declared = declared_settings(type(own))
    assert declared.keys() <= {each.name for each in fields(own)}  # type: ignore[arg-type]
    for name, each in declared.items():
        for bound in (each.low, each.high, each.soft_low, each.soft_high, each.offered):
            if bound is not None:
                replace(own, **{name: bound})  # type: ignore[type-var]
