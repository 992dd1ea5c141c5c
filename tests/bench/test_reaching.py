# SPDX-License-Identifier: GPL-3.0-or-later
"""What is said of a reach is measured from shapes alone, and ours does what octopuses do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from octo_motion.core.rotations import Floats
from tests.bench import reaching

ROOT = Path(reaching.__file__).resolve().parents[2]


def arm(places: Floats, angle: float = 1.2, joints: int = 60) -> Floats:
    """Shapes (moments, joints + 1, 3) of an arm of length one, bent at places (moments,)."""
    middles = (np.arange(joints) + 0.5) / joints
    turned = angle * np.clip((middles - places[:, None]) / 0.08 + 0.5, 0.0, 1.0)
    edges = np.stack([np.cos(turned), np.sin(turned), 0.0 * turned], axis=-1) / joints
    return np.concatenate([np.zeros((len(places), 1, 3)), np.cumsum(edges, axis=1)], axis=1)


def test_the_bend_is_found_where_it_is() -> None:
    places = np.linspace(0.1, 0.85, 31)
    found, angles = reaching.bends(arm(places))
    np.testing.assert_allclose(found, places, atol=0.02)
    np.testing.assert_allclose(angles, 1.2, atol=0.1)


def test_a_bend_that_runs_back_is_told_from_one_that_runs_out() -> None:
    way = np.linspace(0.1, 0.85, 121)
    out = reaching.told("out", arm(way))
    assert out.towards_tip > 0.99
    assert out.bend[0] == pytest.approx(0.1, abs=0.02)
    assert out.bend[-1] == pytest.approx(0.84, abs=0.02)
    to_and_fro = 0.4 + 0.3 * np.sin(np.linspace(-0.5 * np.pi, 4.5 * np.pi, 121)) + 0.1 * way
    assert reaching.told("to and fro", arm(to_and_fro)).towards_tip < 0.7


@pytest.mark.parametrize("count", [1, 2, 3])
def test_peaks_that_stand_out_are_counted(count: int) -> None:
    time = np.linspace(0.0, 1.0, 200)
    speeds = np.sin(count * np.pi * time) ** 2
    # What trembles is no peak.
    assert reaching.peaks(speeds + 0.03 * np.sin(60.0 * time) ** 2) == count


def test_our_reach_sends_one_bend_to_the_tip_in_one_go() -> None:
    own = reaching.told("ours", reaching.ours())
    assert own.towards_tip > 0.8
    assert np.all(np.diff(own.bend) > 0.0)
    assert own.bend[-1] > 0.85
    assert own.bend_peaks == own.tip_peaks == 1


def test_the_simulated_arm_does_too() -> None:
    if not (ROOT / ".venv" / "elastica").is_dir():
        pytest.skip("PyElastica is not set up: make bench ARGS=reaching does it")
    found = reaching.simulated()
    assert found is not None
    rod = reaching.told("rod", found[1])
    # Its thin end whips, and is bent more than the bend for some moments.
    assert rod.towards_tip > 0.7
    assert rod.bend_peaks == rod.tip_peaks == 1
