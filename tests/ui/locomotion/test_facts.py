# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of octopuses, held against what Blender plays.

Levy, Flash and Hochner, Current Biology 25 (2015): a crawl goes any way, whichever way the body
faces, pushes by lengthening arms that lead away from where it goes, and has no rhythm between its
arms. Kazakidi, Tsakiris and Ekaterinaris (2012 on): arms that scull open slowly and close fast.
"""

from typing import Any

import bpy
import numpy as np
import pytest

from tests.ui.made import prepare
from tests.ui.rig import Octopus, generate, still

pytestmark = pytest.mark.one_blender

OCTOPUS = Octopus(add_on=True, with_mesh=False)
STRAIGHT = {"b0": (0, 0, 0), "b1": (0, -1, 0), "b2": (0, -2, 0), "b3": (0, -4, 0)}


def crawling(octopus: Any, degrees: float) -> tuple[np.ndarray, np.ndarray]:
    """Places (frames, 3) of the body, and its fronts (frames, 3), as Blender plays them."""
    bpy.ops.octo_motion.setup_load(name="crawl")
    settings = octopus.octo_motion.locomotion
    if settings.route is None:
        bpy.ops.octo_motion.add_route(**STRAIGHT)
        bpy.context.view_layer.objects.active = octopus
    settings.timing, settings.frame_end, settings.keys = "RANGE", 120, "DENSE"
    settings.heading, settings.heading_angle = "FIXED", np.radians(degrees)
    still(settings)
    generate(octopus)
    places, fronts = [], []
    for frame in range(1, 121, 4):
        bpy.context.scene.frame_set(frame)
        evaluated = octopus.evaluated_get(bpy.context.evaluated_depsgraph_get())
        bone = evaluated.pose.bones["body"]
        turned = evaluated.matrix_world @ bone.matrix @ bone.bone.matrix_local.inverted()
        places.append(evaluated.matrix_world @ bone.head)
        fronts.append(-turned.col[1].to_3d())
    return np.array(places, dtype=np.float64), np.array(fronts, dtype=np.float64)


def test_a_crawl_goes_its_way_whichever_way_it_faces(octopus: Any) -> None:
    ahead, front = crawling(octopus, 0.0)
    for degrees in (90.0, 180.0):
        places, fronts = crawling(octopus, degrees)
        faces = np.degrees(np.arccos(np.clip(np.sum(fronts * front, axis=1), -1.0, 1.0)))
        np.testing.assert_allclose(faces, degrees, atol=1.0)
        # The body's bone is not where its middle is.
        apart = (places - places[0]) - (ahead - ahead[0])
        assert np.abs(apart).max() < 0.02  # m, on a way of 4 m


def computed(octopus: Any, setup: str) -> Any:
    """A set-up's motion along the straight route, before it is written."""
    bpy.ops.octo_motion.setup_load(name=setup)
    if octopus.octo_motion.locomotion.route is None:
        bpy.ops.octo_motion.add_route(**STRAIGHT)
        bpy.context.view_layer.objects.active = octopus
    shot = prepare(octopus, bpy.context)
    for _ in shot.compute():
        pass
    assert shot.shot.result is not None
    return shot.shot.result


def test_arms_that_hold_on_get_longer_before_they_let_go(octopus: Any) -> None:
    result = computed(octopus, "crawl")
    starts = np.cumsum([0] + [len(each) for each in result.plan.job.creature.bones])
    longer = []
    for arm, lying in enumerate(result.arms.in_contact):
        strains = result.arms.strains[:, starts[arm] : starts[arm + 1]].sum(axis=1)
        held = lying.any(axis=1).astype(int)
        begins, ends = (np.flatnonzero(np.diff(held) == sign) for sign in (1, -1))
        for first in begins:
            last = next((each for each in ends if each > first), None)
            if last is not None and last - first > 6:
                span = strains[first + 1 : last]
                lowest = int(span.argmin())
                longer.append(span[lowest:].max() - span.min())
    # From where it is shortest in its hold to where it is longest after that.
    assert len(longer) > 10
    assert np.median(longer) > 0.02


def rhythm(octopus: Any, setup: str) -> float:
    """How fixed the moments are at which arms let go against one another, 0 … 1.

    Each moment at which an arm lets go is an angle in the time from one of another arm's to the
    next; of all of a pair it is the length of their mean direction, and of all pairs the mean.
    """
    in_contact = computed(octopus, setup).arms.in_contact
    held = [lying.any(axis=1).astype(int) for lying in in_contact]
    lets_go = [np.flatnonzero(np.diff(each) == -1) for each in held]
    fixed = []
    for one in lets_go:
        for other in lets_go:
            between = other[(other > one[0]) & (other < one[-1])] if len(one) > 1 else other[:0]
            if one is other or len(between) < 4:
                continue
            before = np.searchsorted(one, between, side="right") - 1
            share = (between - one[before]) / np.diff(one)[before]
            fixed.append(np.abs(np.exp(2j * np.pi * share).mean()))
    assert len(fixed) > 10
    return float(np.mean(fixed))


def test_a_crawl_has_no_rhythm_between_its_arms_and_a_walk_has_one(octopus: Any) -> None:
    assert rhythm(octopus, "walk") > 0.9  # 0.996
    assert rhythm(octopus, "crawl") < 0.6  # 0.35


@pytest.mark.parametrize("setup", ["swim", "jet_escape"])
def test_swimming_arms_open_slowly_and_close_fast(octopus: Any, setup: str) -> None:
    bpy.ops.octo_motion.setup_load(name=setup)
    settings = octopus.octo_motion.locomotion
    settings.travel_on, settings.cycles, settings.keys = "NONE", 2, "DENSE"
    generate(octopus)
    last = int(octopus.animation_data.action.frame_range[1])
    names = [(arm.bones[0].name, arm.bones[len(arm.bones) // 2].name) for arm in settings.arms]
    spread = []
    for frame in range(1, last + 1):
        bpy.context.scene.frame_set(frame)
        evaluated = octopus.evaluated_get(bpy.context.evaluated_depsgraph_get())
        bones = evaluated.pose.bones
        axis = (bones["mantle"].tail - bones["body"].head).normalized()
        ways = [(bones[b].tail - bones[a].head).normalized() for a, b in names]
        spread.append(np.mean([np.degrees(np.arccos(-each.dot(axis))) for each in ways]))
    speed = np.diff(spread)
    # Fastest, and how long it takes.
    assert -speed.min() > 1.3 * speed.max()
    assert (speed > 0.0).sum() > (speed < 0.0).sum()
