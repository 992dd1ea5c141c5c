# SPDX-License-Identifier: GPL-3.0-or-later
"""The floor that no gait holds on to: below one that swims, and about one that stays.

A gait in the water knows no ground, and one in place knows a level one that goes by. What a mesh
that lies there all the same has of their arms in it is measured.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from ...rotations import Floats, rotate
from ..ground import Ground, sample_ground
from .job import MotionJob

_AROUND: Final = 2.5
"""Arm lengths to all sides of the body in which the floor is looked at …"""
_FINE: Final = 0.02
"""… and those from one sample of it to the next."""
_HEADROOM: Final = 0.0
"""Arm lengths above the body up to which a surface is a floor and not a roof."""
_PLACES: Final = 1000
"""Places of the body, or twice as many, that say which of several surfaces is below it."""
_NOWHERE: Final = 1000.0
"""Arm lengths below the body: as deep as this is what has no faces."""


def floor_under(job: MotionJob, places: tuple[Floats, Floats], length: float) -> Ground | None:
    """The floor under an armature, none where there is none.

    Args:
        job: the motion.
        places: locations (moments, 3) and orientations (moments, 4) of the armature, world.
        length: of an arm, metres.
    """
    if job.floor is None:
        return None
    creature = job.creature
    some = slice(None, None, max(1, len(places[0]) // _PLACES))
    path = places[0][some] + rotate(places[1][some], creature.scale * creature.body.center)
    return sample_ground(
        job.floor.triangles,
        path,
        np.zeros(len(path), dtype=bool),
        reach=_AROUND * length,
        spacing=_FINE * length,
        headroom=_HEADROOM * length,
        content=job.floor.content,
        bare=float(path[:, 2].min()) - _NOWHERE * length,
    )
