# SPDX-License-Identifier: GPL-3.0-or-later
"""What is worked out of a rig and a gait, the same as before while nothing of it has changed."""

from __future__ import annotations

from typing import Final

from ...content_cache import ContentCache, content_key
from ...skeleton import Skeleton
from ..gait import Arm, GaitPoser, GaitSettings
from ..rig import ArmFrames, BodyFrame, frames_of_arm

_posers: Final[ContentCache[GaitPoser]] = ContentCache(12)

_frames_known: Final[ContentCache[list[ArmFrames]]] = ContentCache(4)


def frames_of_arms(skeleton: Skeleton, arms: tuple[Arm, ...], body: BodyFrame) -> list[ArmFrames]:
    """What leads from bones of each arm to its joints."""
    bones = [arm.bones for arm in arms]
    return _frames_known.get(
        content_key(skeleton, bones, body),
        lambda: [frames_of_arm(skeleton, each, body) for each in bones],
    )


def poser_of(
    skeleton: Skeleton, arms: tuple[Arm, ...], body: BodyFrame, settings: GaitSettings
) -> GaitPoser:
    """What moves these arms, the same as before while nothing of it has changed."""
    key = content_key(skeleton, arms, body, settings)
    return _posers.get(key, lambda: GaitPoser(skeleton, arms, body, settings))
