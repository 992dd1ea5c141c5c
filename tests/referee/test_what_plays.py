# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender plays is within its limits, in a few scenes; ``make referee`` looks at all."""

from __future__ import annotations

import json

import pytest

from tests.referee.__main__ import LIMITS, SHORT, beyond_limits, measured, popping

# Blender's importer leaves its files open.
pytestmark = [
    pytest.mark.one_blender,
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


@pytest.mark.parametrize("scene", SHORT)
def test_what_plays_is_within_the_limits(scene: str) -> None:
    row = measured(scene)
    limits = json.loads(LIMITS.read_text(encoding="utf-8"))
    assert row.keys() <= limits[scene].keys()
    assert {key: row[key] for key in beyond_limits(scene, row, limits)} == {}


@pytest.mark.parametrize("scene", ["octopus/walk/plane", "octopus/idle/plane"])
def test_what_plays_pops_no_more_than_it_may(scene: str) -> None:
    row = popping(scene)
    limits = json.loads(LIMITS.read_text(encoding="utf-8"))
    assert "pop" in limits[scene]
    assert beyond_limits(scene, row, limits) == []
