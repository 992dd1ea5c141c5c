# SPDX-License-Identifier: GPL-3.0-or-later
"""What must end before the classes go."""

from __future__ import annotations

from contextlib import suppress

from ...core.errors import OctoMotionError
from .device_pose import active_hands
from .overlay import take_down_all
from .puppet_session import active_session


def unregister() -> None:
    """End the session that is going on, if one is, and draw no more."""
    hands = active_hands()
    if hands is not None:
        hands.stop()
    session = active_session()
    if session is not None:
        with suppress(OctoMotionError):
            session.finish()
    take_down_all()
