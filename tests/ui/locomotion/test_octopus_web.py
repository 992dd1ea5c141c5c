# SPDX-License-Identifier: GPL-3.0-or-later
"""The octopus' web in motion: it changes no key, and comes through every set-up in one piece."""

from typing import Any

import bpy
import numpy as np
import pytest

from tests.referee import creature_measures as referee
from tests.referee.recording import moments, record
from tests.referee.scenes import SETUPS, build, winding
from tests.referee.surface import Surface
from tests.referee.web_measures import Web, web
from tests.ui.rig import generate, keys

pytestmark = pytest.mark.one_blender

_EVERY = 7
"""Half frames: so many moments are looked at, between frames too."""


def keys_of(setup: str, *, with_web: bool) -> dict[tuple[str, int], np.ndarray]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.octo_motion.add_octopus(web=with_web)
    armature: Any = bpy.context.object
    assert ("Web" in armature.children[0].vertex_groups) == with_web
    bpy.ops.octo_motion.setup_load(name=setup)
    if armature.octo_motion.locomotion.travel_on != "NONE":
        bpy.ops.octo_motion.add_route()
        bpy.context.view_layer.objects.active = armature
    return keys(generate(armature))


@pytest.mark.parametrize("setup", ["walk", "swim", "settle"])
def test_a_motion_has_the_same_keys_with_and_without_it(
    setup: str,
    add_on: Any,  # noqa: ARG001
) -> None:
    first, second = (keys_of(setup, with_web=each) for each in (True, False))
    assert first.keys() == second.keys()
    assert len(first) > 100
    for each in first:
        np.testing.assert_array_equal(first[each], second[each])


def played(setup: str, ground: str, seed: int | None) -> tuple[Web, float]:
    """The web's measures, and the share of the moments at which any skin goes through it."""
    scene = build(setup, ground, way=None if seed is None else winding(seed))
    recording = record(scene.armature, moments(scene.start, scene.end, 2)[::_EVERY])
    length = referee.arm_length(recording, scene.arms)
    through = referee.skin_through_skin(recording, scene.arms, 4, webs=True)
    return web(recording, Surface.of(scene.ground), length), through.share


_INSIDE_OUT = {
    ("hurry", "plane", None): (0.015, 0.0009),
    ("hurry", "plane", 1): (0.1, 0.006),
    ("prowl", "plane", None): (0.035, 0.0016),
    ("walk", "bumps", None): (0.01, 0.0003),
    ("walk", "stairs", None): (0.022, 0.0005),
}
"""Share of the web's area that may be inside out where arms cross a neighbour, at the worst moment
and in the mean of all: 0.7 % and 0.05 % in a hurry, 5 % and 0.3 % in one on a way that winds,
2.0 % and 0.08 % in a prowl, 0.5 % and 0.01 % in a walk over bumps, 1.1 % and 0.02 % up stairs.
Elsewhere no face is."""


@pytest.mark.parametrize(
    ("setup", "ground", "seed"),
    [
        *((setup, "plane", None) for setup in SETUPS),
        ("walk", "bumps", None),
        ("walk", "stairs", None),
        ("walk", "plane", 1),
        ("hurry", "plane", 1),
    ],
)
def test_it_stays_whole_and_above_the_ground(
    setup: str,
    ground: str,
    seed: int | None,
    add_on: Any,  # noqa: ARG001
) -> None:
    found, through = played(setup, ground, seed)
    # It never comes near the ground; creatures that swim go through grounds that they do not see.
    if setup not in {"swim", "jet_escape"}:
        assert found.deepest.value == 0.0
    # 1.3 in a swim, 2.0 in a walk, 2.3 where it hurries.
    assert 1.0 < found.stretch.value < 3.5
    worst, mean = _INSIDE_OUT.get((setup, ground, seed), (0.0, 0.0))
    assert found.inside_out.value <= worst
    assert found.turned_over <= mean
    # Of few moments: 11 % in Idle, where the roots of the front arms fold, 2 % in a prowl.
    assert through < 0.15
