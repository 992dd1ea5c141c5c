# SPDX-License-Identifier: GPL-3.0-or-later
"""Gait tables: the paper's numbers, variation, files."""

import dataclasses
import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.errors import GaitError
from octo_motion.core.locomotion.gait import table as gait
from octo_motion.core.locomotion.gait.variation import variation
from octo_motion.core.rotations import Floats
from tests.core import oracle

HEAD, PITCH, BANK = range(3)
PRESETS = gait.gait_presets()
seeds = st.integers(0, 2**31)


def angles_of(name: str, phases: Floats) -> Floats:
    return gait.gait_angles(PRESETS[name], np.asarray(phases)[:, None], (1,))[:, 0]


@pytest.mark.parametrize(
    ("name", "angle", "expected"),
    [
        ("walk", HEAD, oracle.WALK_ANGLES),
        ("walk_literal", PITCH, oracle.WALK_ANGLES),
        ("swim", HEAD, oracle.SWIM_ANGLES),
    ],
)
def test_presets_have_the_angles_of_the_paper(
    name: str, angle: int, expected: list[list[float]]
) -> None:
    angles = angles_of(name, np.array(oracle.PHASES))

    assert np.max(np.abs(angles[..., angle] - np.array(expected).T)) <= 1e-9
    others = [each for each in (HEAD, PITCH, BANK) if each != angle]
    assert not np.any(angles[..., others])


@given(st.floats(-50.0, 50.0), st.integers(-5, 5))
def test_every_cycle_is_like_the_first(phase: float, cycles: int) -> None:
    here = angles_of("walk", np.array([phase]))
    there = angles_of("walk", np.array([phase + 2.0 * np.pi * cycles]))

    # The steepest angle turns 2.2 rad a radian of phase, and the phase is exact to 1e-14.
    assert np.max(np.abs(here - there)) <= 1e-12


def test_walking_arms_fill_the_cycle_and_swimming_arms_move_together() -> None:
    arms = [(side, pair) for pair in range(1, 5) for side in ("LEFT", "RIGHT")]

    walk = {round(PRESETS["walk"].offset(*arm, 4) / (2 * np.pi) % 1.0, 6) for arm in arms}
    swim = {PRESETS["swim"].offset(*arm, 4) for arm in arms}

    assert walk == {0.0, 0.25, 0.5, 0.75}
    assert swim == {0.0}


def test_an_offset_given_for_one_arm_replaces_the_spread() -> None:
    table = dataclasses.replace(PRESETS["walk"], offsets={(2, "LEFT"): 0.3})

    assert table.offset("LEFT", 2, 4) == 0.3
    assert table.offset("RIGHT", 2, 4) == PRESETS["walk"].offset("RIGHT", 2, 4)


def counted_from_the_front() -> gait.GaitTable:
    """Tiptoe as files of others may have it, for four pairs."""
    table = PRESETS["tiptoe"]
    curves = {pair if pair >= 0 else 5 + pair: curve for pair, curve in table.curves.items()}
    return dataclasses.replace(table, curves=curves)


@pytest.mark.parametrize("pairs", [1, 2, 3, 4, 5, 6])
def test_the_rear_pair_tiptoes_however_many_there_are(pairs: int) -> None:
    table = PRESETS["tiptoe"]
    own = table.for_pairs(pairs)
    stepping = [pair for pair in range(1, pairs + 1) if not own.curve(pair).free]
    assert stepping == [pairs]
    assert own.curve(pairs) is table.curve(-1)


@pytest.mark.parametrize("pairs", [1, 2, 3, 4, 5])
def test_rear_arms_do_what_a_gait_has_for_them_where_there_are_fewer(pairs: int) -> None:
    table = counted_from_the_front()
    own = table.for_pairs(pairs)
    # Five pairs are more than it knows of: its fourth is the fourth.
    rear = min(pairs, 4)
    stepping = [pair for pair in range(1, pairs + 1) if not own.curve(pair).free]
    assert stepping == [rear]
    assert own.curve(rear) is table.curve(4)


def test_offsets_of_single_arms_move_to_the_rear_with_their_pairs() -> None:
    offsets = {(4, "LEFT"): 1.0, (1, "RIGHT"): 2.0}
    table = dataclasses.replace(counted_from_the_front(), offsets=offsets)
    assert table.for_pairs(3).offsets == {(3, "LEFT"): 1.0}
    assert table.for_pairs(4) is table


def test_arms_that_hold_no_ground_sway_and_their_ends_follow_behind() -> None:
    phases = np.linspace(0.0, gait.CYCLE, 72, endpoint=False)
    held = [curve for table in PRESETS.values() for curve in table.curves.values() if curve.free]
    assert held
    for curve in held:
        sideways = curve.evaluate(phases)[..., PITCH]
        # Less than 20° to and fro is not to be seen in an arm that is curled up.
        assert np.degrees(np.ptp(sideways, axis=0)).min() >= 20.0
        first = np.angle(np.exp(-1j * phases) @ sideways)
        behind = np.degrees(np.mod(-np.diff(first), gait.CYCLE))
        # What hangs further out swings later, by less than a quarter of the cycle each.
        assert np.all((behind >= 30.0) & (behind <= 90.0))


def test_where_all_arms_walk_each_pair_keeps_its_own() -> None:
    assert PRESETS["hurry"].for_pairs(3) is PRESETS["hurry"]


def test_a_pair_may_have_a_curve_of_its_own() -> None:
    own = gait.curve_from_degrees([0, 180, 360], head=[[0, 30, 0], [0, 0, 0], [0, 0, 0]])
    table = dataclasses.replace(PRESETS["walk"], curves={**PRESETS["walk"].curves, 4: own})

    angles = gait.gait_angles(table, np.full((1, 2), np.pi), (1, 4))

    assert np.degrees(angles[0, 0, 0, HEAD]) == pytest.approx(-50.0)
    assert np.degrees(angles[0, 1, 0, HEAD]) == pytest.approx(30.0)
    assert np.degrees(angles[0, 1, 1, HEAD]) == pytest.approx(0.0)


# --- Variation -----------------------------------------------------------------------------------


def varied(
    phases: Floats, seed: int, limits: tuple[float, float] = (-0.2, 0.3), arms: int = 3
) -> Floats:
    columns = np.broadcast_to(np.asarray(phases)[:, None], (len(phases), arms))
    return variation(PRESETS["walk"], columns, (1,) * arms, limits, seed)


def test_no_frames_are_no_variation() -> None:
    assert varied(np.empty(0), 5).shape == (0, 3, 3, 3)


def test_no_range_is_no_variation() -> None:
    assert not np.any(varied(np.linspace(0, 40, 100), 5, (0.0, 0.0)))


@given(seeds)
def test_variation_keeps_its_limits_reaches_for_them_and_leaves_bank(seed: int) -> None:
    values = varied(np.linspace(0, 200, 400), seed)

    assert values[..., :2].min() >= -0.2
    assert values[..., :2].max() < 0.3
    # 128 knots in 18 series: the chance that all stay out of the outer fifth is nil.
    assert values[..., :2].min() < -0.1
    assert values[..., :2].max() > 0.2
    assert not np.any(values[..., BANK])


@given(seeds)
def test_variation_is_continuous_over_knots_and_cycles(seed: int) -> None:
    knots = np.linspace(0.0, 5.5 * np.pi, 12)

    before, after = varied(knots - 1e-9, seed), varied(knots + 1e-9, seed)

    # At most 0.5 rad in a quarter of a cycle.
    assert np.max(np.abs(before - after)) <= 2e-9


@given(seeds, st.integers(0, 50))
def test_a_frame_varies_alike_whichever_frames_are_asked_for(seed: int, first: int) -> None:
    phases = np.linspace(0, 60, 51)

    assert np.array_equal(varied(phases, seed)[first], varied(phases[[first]], seed)[0])


def test_arms_links_cycles_and_seeds_vary_apart() -> None:
    values = varied(np.array([0.0, 2.0 * np.pi]), 1)[..., :2]

    assert len(np.unique(values)) == values.size
    assert not np.any(values == varied(np.array([0.0, 2.0 * np.pi]), 2)[..., :2])


# --- Files ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_a_saved_gait_loads_as_it_was(name: str) -> None:
    table = dataclasses.replace(PRESETS[name], offsets={(1, "LEFT"): 0.5, (2, "CENTER"): -1.0})

    loaded = gait.gait_from_json(gait.gait_to_json(table))

    for field in dataclasses.fields(table):
        if field.name not in {"curves", "offsets"}:
            assert getattr(loaded, field.name) == getattr(table, field.name)
    assert loaded.offsets.keys() == table.offsets.keys()
    assert all(abs(loaded.offsets[key] - table.offsets[key]) < 1e-12 for key in table.offsets)
    assert loaded.curves.keys() == table.curves.keys()
    for pair, curve in table.curves.items():
        assert np.max(np.abs(loaded.curves[pair].phases - curve.phases)) <= 1e-12
        assert np.max(np.abs(loaded.curves[pair].angles - curve.angles)) <= 1e-12


def damaged(**changes: Any) -> str:
    content = json.loads(gait.gait_to_json(PRESETS["walk"]))
    curve = content["pairs"]["all"]
    for key, value in changes.items():
        if key in curve:
            curve[key] = value
        else:
            content[key] = value
    return json.dumps(content)


FLAT = [0.0] * 5


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("walk", "The gait file is not JSON (line 1: Expecting value). Choose a gait file."),
        ("[]", "The gait file is not a gait of Octo Motion. Choose a gait file."),
        (damaged(version=7), "format version 7, not 1. Update Octo Motion"),
        (damaged(manner="fly"), "has the manner 'FLY'. It must be walk, crawl or swim."),
        (damaged(pairs={}), "has no curve for all arms"),
        (damaged(pairs=3), "is damaged"),
        (damaged(stride=0.0), "has a stride of 0. It must be above zero."),
        (damaged(stride=float("nan")), "has a number that is not finite. Correct it."),
        (damaged(offsets={"1 up": 0.0}), "is damaged (ValueError: no side is called 'UP')"),
        (damaged(phase=[0, 90, 80, 270, 360]), "has knots that do not ascend. Sort them by phase."),
        (damaged(phase=[10, 90, 180, 270, 360]), "does not start at phase 0. Add a knot there."),
        (damaged(phase=[0, 90, 180, 270, 350]), "does not end at phase 360°. Add a knot there."),
        (damaged(phase=[0, 90, float("inf"), 270, 360]), "has a number that is not finite."),
        (damaged(head=[[0, 1, 2, 3, 4], FLAT, FLAT]), "ends at other angles than it starts with."),
        (damaged(head=[FLAT, FLAT, [0, float("nan"), 0, 0, 0]]), "a number that is not finite."),
        (damaged(head=[FLAT, FLAT]), "is damaged"),
        (damaged(head=[[0, 1], FLAT, FLAT]), "is damaged"),
        (damaged(head="up"), "is damaged"),
        (damaged(head=5.0), "is damaged"),
        (damaged(head=[0.0, 1.0, 2.0]), "is damaged"),
        (damaged(phase=[[0], [90], [180], [270], [360]]), "is damaged"),
        (damaged(pairs={"all": {"phase": [[0, 0], [360, 360]]}}), "is damaged"),
        ("[" * 200_000, "The gait file is not JSON ("),
        ("1" * 5000, "The gait file is not JSON ("),
    ],
)
def test_a_damaged_gait_file_says_what_is_wrong_with_it(text: str, message: str) -> None:
    with pytest.raises(GaitError) as caught:
        gait.gait_from_json(text)

    assert message in str(caught.value)


CREATURES = {
    3: [("LEFT", 1), ("RIGHT", 1), ("CENTER", 2)],
    6: [(side, pair) for pair in (1, 2, 3) for side in ("LEFT", "RIGHT")],
    8: [(side, pair) for pair in (1, 2, 3, 4) for side in ("LEFT", "RIGHT")],
    12: [(side, pair) for pair in range(1, 7) for side in ("LEFT", "RIGHT")],
}


@pytest.mark.parametrize("arms", CREATURES)
def test_a_gait_by_halves_and_from_the_rear_fits_any_number_of_arms(arms: int) -> None:
    text = """{"format": "octo_motion.gait", "version": 1, "name": "halves", "manner": "walk",
        "spread": {"sides": 0.5, "halves": 0.25}, "offsets": {"-1 left": 90, "-6 right": 45},
        "pairs": {"all": {"phase": [0, 360], "head": [[0, 0], [0, 0], [0, 0]]},
                  "-1": {"phase": [0, 360], "head": [[9, 9], [0, 0], [0, 0]], "free": true}}}"""
    written = gait.gait_from_json(text)
    assert gait.gait_from_json(gait.gait_to_json(written)).offsets == written.offsets
    assert gait.gait_from_json(gait.gait_to_json(written)).spread_halves == 0.25
    creature = CREATURES[arms]
    pairs = max(pair for _, pair in creature)
    table = written.for_pairs(pairs)
    # The last pair, whichever it is, has its own curve, and no other.
    assert [pair for pair in range(1, pairs + 1) if table.curve(pair).free] == [pairs]
    side_share = {"LEFT": 0.0, "CENTER": 0.5, "RIGHT": 1.0}
    for side, pair in creature:
        cycles = table.offset(side, pair, pairs) / (2.0 * np.pi)
        if (side, pair) == ("LEFT", pairs):
            assert cycles == pytest.approx(0.25)
        elif (side, pair) == ("RIGHT", pairs - 5):
            assert cycles == pytest.approx(0.125)
        else:
            half = {True: 0.0, False: 0.25}[pair <= pairs // 2]
            half = 0.125 if 2 * pair == pairs + 1 else half
            assert cycles == pytest.approx(0.5 * side_share[side] + half)


def test_where_a_pair_is_told_both_ways_the_number_from_the_front_counts() -> None:
    table = dataclasses.replace(PRESETS["walk"], offsets={(-1, "LEFT"): 1.0, (3, "LEFT"): 2.0})
    assert table.for_pairs(3).offsets == {(3, "LEFT"): 2.0}
    assert table.for_pairs(4).offsets == {(4, "LEFT"): 1.0, (3, "LEFT"): 2.0}
    # A body that has fewer pairs does without.
    far = dataclasses.replace(PRESETS["walk"], offsets={(-4, "LEFT"): 1.0})
    assert far.for_pairs(3).offsets == {}
