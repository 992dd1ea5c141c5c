# SPDX-License-Identifier: GPL-3.0-or-later
"""A small octopus, and a session in which it is posed by hand."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import pytest

from octo_motion.ui.posing.controls import PoseControls
from octo_motion.ui.posing.puppet_session import PuppetSession


@pytest.fixture
def octopus(request: pytest.FixtureRequest) -> Any:
    """The one that the test's module describes as OCTOPUS, else the add-on's, small and bare."""
    if wanted := getattr(request.module, "OCTOPUS", None):
        return wanted.make()
    bpy.ops.octo_motion.add_octopus(with_mesh=False, arms=4, joints=4)
    return bpy.context.object


@pytest.fixture
def session(octopus: Any) -> Iterator[PuppetSession]:
    """One that no clock drives."""
    made = PuppetSession(octopus, bpy.context.scene, clock=None)
    # Long steps: what is tested does not hang on them.
    made.core.change(step=4e-3)
    yield made
    made.abandon()


@pytest.fixture
def controls(session: PuppetSession) -> PoseControls:
    """What mouse and keys do in it."""
    return PoseControls(session)
