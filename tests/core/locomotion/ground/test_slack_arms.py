# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that stand close to what they hold: arches that stay arches, at heights they can bear."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.locomotion.ground.arm_curves import bent, curve, drawn, spread_chain
from octo_motion.core.locomotion.ground.contact_timing import finding_line
from octo_motion.core.locomotion.ground.footholds import easy_height
from octo_motion.core.locomotion.ground.surface import StanceSettings
from octo_motion.core.locomotion.path.travel import TravelSettings, bearings_of
from octo_motion.core.rotations import Floats
from octo_motion.core.rotations.components_first import normalized
from octo_motion.core.steps import finished
from tests.core.grounds import STRAIGHT, bumps, largest_turn, walker


def an_arch(steepest: float, count: int = 9) -> Floats:
    """Directions (segments, 3, 1) that lead along x, up and down again."""
    angles = np.linspace(steepest, -steepest, count)
    return np.stack([np.cos(angles), 0.0 * angles, np.sin(angles)], axis=1)[..., None]


@given(st.floats(0.3, 1.2), st.floats(0.4, 1.0))
def test_an_arch_is_bent_until_it_leads_as_far_as_it_should(steepest: float, share: float) -> None:
    arch, parts = an_arch(steepest), np.full((9, 1), 0.1)
    chord = np.array([[1.0], [0.0], [0.0]])
    found = bent(arch, parts, chord, np.array([share]))
    led = np.einsum("sb,scb->cb", parts, found)[:, 0]
    before = np.einsum("sb,scb->cb", parts, arch)[:, 0]
    # Six steps of Newton's leave much less than a thousandth of the arm.
    assert led[0] == pytest.approx(share * before[0], abs=1e-3)
    # Still an arch: symmetric, and each bone is bent down from the one before.
    assert abs(led[2]) < 1e-6
    climbs = np.arctan2(found[:, 2, 0], found[:, 0, 0])
    assert np.all(np.diff(climbs) < 0.0)
    assert np.allclose(np.linalg.norm(found, axis=1), 1.0)


def test_what_need_not_be_bent_stays_as_it_is() -> None:
    random = np.random.default_rng(1)
    ways = normalized(random.normal(size=(9, 3, 4)) + np.array([2.0, 0.0, 0.0])[:, None])
    parts = random.uniform(0.05, 0.2, (9, 4))
    chord = np.einsum("sb,scb->cb", parts, ways)
    assert np.allclose(bent(ways, parts, chord, np.ones(4)), ways, atol=1e-9)


def test_stiff_arms_do_not_turn_over_where_they_stand_close_to_their_foothold() -> None:
    walk = walker(bumps(), joints=10, gait="prowl", radii=(0.16, 0.036))
    assert np.degrees(largest_turn(walk.pose(walk.times).rotations)) < 45.0


@pytest.mark.parametrize("joints", [3, 4, 6, 12])
def test_from_its_easy_height_an_arm_reaches_the_ground_beside_it(joints: int) -> None:
    reach, radii = np.linspace(0.0, 1.0, joints + 1), np.full(joints + 1, 0.02)
    height = easy_height(reach, radii, StanceSettings(), may_stretch=False)
    free = reach[np.argmin(np.abs(reach - 0.7))]
    away = np.hypot(height - 0.02, 0.2)
    # Bent a little, and with a fifth of its length to the side.
    assert 0.6 * free < away < 0.9 * free
    assert easy_height(reach, radii, StanceSettings(), may_stretch=True) > height


@pytest.mark.parametrize("under", [0.0, 0.12])
def test_a_low_body_keeps_its_skin_out_of_a_hill_it_passes(under: float) -> None:
    ground, travel = bumps(), TravelSettings(stride=1.0)
    line = finished(
        finding_line(
            STRAIGHT,
            travel,
            bearings_of(STRAIGHT, travel),
            ground,
            clearance=0.16,
            reach=1.0,
            lean=0.7,
            smoothing=0.35,
            under=under,
        )
    )
    centres, _ = line.at(np.linspace(0.0, STRAIGHT.length, 400))
    gap = centres[:, 2] - ground.height(centres)
    # What it lacks is evened out along the way: a fiftieth of an arm may be left.
    assert gap.min() > max(0.55 * 0.16, under) - 0.02


@given(st.integers(0, 2**31), st.sampled_from([1e-6, 1e-3, 1e6]))
def test_an_arm_is_drawn_alike_whatever_the_unit_of_length(seed: int, size: float) -> None:
    random = np.random.default_rng(seed)
    ways = normalized(random.normal(size=(7, 3, 4)) + np.array([3.0, 0.0, 0.0])[:, None])
    lengths, free = random.uniform(0.05, 0.2, (7, 4)), random.uniform(0.0, 1.0, (7, 4))
    goal = 0.8 * np.einsum("sb,scb->cb", lengths, ways)

    def drawn_in(size: float) -> Floats:
        return drawn(
            ways,
            size * lengths,
            free=free,
            chosen=np.ones((7, 4)),
            roots=np.zeros((3, 4)),
            goal=size * goal,
            steps=4,
        )

    assert np.allclose(drawn_in(size), drawn_in(1.0), atol=1e-9)


def arches(*, opening: bool) -> Floats:
    """Directions (segments, 3, ratios) of arms that are slacker and slacker.

    They leave and arrive nearly in line with the way to where they are held.

    Args:
        opening: whether their ends are opened as far as they have to be.
    """
    ratio = np.linspace(0.95, 0.72, 500)
    count = len(ratio)
    edges = np.cumsum([0.0, 0.17, 0.13, 0.13, 0.14, 0.14, 0.15, 0.14])
    chord, upward, leaving, arriving = np.zeros((4, 3, count))
    chord[0], upward[2] = ratio, 1.0
    leaving[0], leaving[2] = np.cos(0.2), np.sin(0.2)
    arriving[0], arriving[2] = np.cos(0.25), -np.sin(0.25)
    if opening:
        leaving, arriving = spread_chain((leaving, arriving), chord, upward, ratio)
    return curve(
        leaving=leaving,
        arriving=arriving,
        chord=chord,
        size=np.ones(count),
        middles=0.5 * (edges[1:] + edges[:-1])[:, None, None] * np.ones(count),
        parts=np.diff(edges)[:, None] * np.ones(count),
    )


def test_an_arm_in_line_with_where_it_is_held_arches_and_does_not_double_back_on_itself() -> None:
    # At a point where it doubles back, a little more slack turns a segment over at once.
    assert arches(opening=False)[:, 0].min() < -0.3
    assert arches(opening=True)[:, 0].min() > 0.3


@given(st.floats(0.7, 1.5), st.floats(0.72, 0.97))
def test_an_arm_that_leaves_far_from_the_way_to_its_foothold_is_left_as_it_is(
    apart: float, ratio: float
) -> None:
    leaving = np.array([[np.cos(apart)], [0.3 * np.sin(apart)], [np.sin(apart)]])
    leaving /= np.linalg.norm(leaving)
    arriving = leaving * np.array([[1.0], [1.0], [-1.0]])
    chord, upward = np.array([[1.0], [0.0], [0.0]]), np.array([[0.0], [0.0], [1.0]])
    ends = spread_chain((leaving, arriving), chord, upward, np.array([ratio]))
    np.testing.assert_array_equal(ends, (leaving, arriving))


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(0.5, 1.0))
def test_what_is_opened_stays_of_length_one_and_turns_to_either_side_of_the_way(
    out: float, back: float, ratio: float
) -> None:
    leaving = np.array([[np.cos(out)], [0.0], [np.sin(out)]])
    arriving = np.array([[np.cos(back)], [0.0], [-np.sin(back)]])
    chord, upward = np.array([[1.0], [0.0], [0.0]]), np.array([[0.0], [0.0], [1.0]])
    wider, steeper = spread_chain((leaving, arriving), chord, upward, np.array([ratio]))
    assert np.linalg.norm([wider, steeper], axis=1) == pytest.approx(1.0)
    assert wider[2, 0] >= leaving[2, 0] - 1e-12
    assert steeper[2, 0] <= arriving[2, 0] + 1e-12
