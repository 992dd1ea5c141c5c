# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the gait changes, as the settings say."""

from __future__ import annotations

from ....core.errors import SettingsError
from ....core.locomotion.motion import ChangeAt, ChangesByHeight
from ..settings import OCTO_MOTION_PG_change


def read_changes(
    settings: OCTO_MOTION_PG_change, first: str, *, in_place: bool
) -> tuple[ChangesByHeight | tuple[ChangeAt, ...], list[str]]:
    """Where the gait changes, and the names of the gaits that it changes to.

    Args:
        settings: what decides.
        first: name of the gait that the motion begins with.
        in_place: whether nothing travels, and the gait stays what it is.

    Raises:
        SettingsError: there is no place to change at.
    """
    if in_place or settings.by == "NONE":
        return (), []
    if settings.by == "MARKERS" and not len(settings.places):
        raise SettingsError(
            "The gait is to change at places, and there are none.",
            "Add a place, or set Change Gait to Never.",
        )
    by_height = settings.by == "HEIGHT"
    asked = [settings.gait] if by_height else [item.gait for item in settings.places]
    names = [name for name in dict.fromkeys(asked) if name != first]
    numbers = {first: 0, **{name: number + 1 for number, name in enumerate(names)}}
    if by_height:
        above = numbers[settings.gait]
        return ChangesByHeight(settings.height, settings.length, above), names
    places = [ChangeAt(item.position, item.length, numbers[item.gait]) for item in settings.places]
    return tuple(places), names
