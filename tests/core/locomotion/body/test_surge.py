# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that push make a body shoot ahead and rise: where it is on its way says all."""

import numpy as np
import pytest

from octo_motion.core.locomotion.body import Holds, Surge, surge

LENGTH, STRIDE, REACH = 4.0, 0.8, 1.0


def straight(distance: np.ndarray) -> np.ndarray:
    return np.stack([0.0 * distance, -distance, 0.0 * distance], axis=-1)


def holds(arms: int, *, loop: bool = False) -> Holds:
    """Arms evenly apart in their cycle, that hold on for half of it, every second one behind."""
    cycles = np.arange(0 if loop else -1, round(LENGTH / STRIDE) + (0 if loop else 2))
    start = (STRIDE * (cycles[:, None] + np.arange(arms) / arms)).ravel()
    behind = np.tile(np.where(np.arange(arms) % 2, 1.0, -1.0), len(cycles))
    return Holds(start, start + 0.5 * STRIDE, behind)


def made(arms: int = 4, *, amount: float = 1.0, loop: bool = False) -> Surge:
    found = surge(
        holds(arms, loop=loop),
        straight,
        LENGTH,
        stride=STRIDE,
        reach=REACH,
        amount=amount,
        cyclic=loop,
    )
    assert found is not None
    return found


def test_it_goes_ahead_and_back_and_up_and_down_by_little() -> None:
    table = made().table
    assert 0.003 < np.ptp(table[:, 1]) < 0.05  # 0.022
    assert 0.003 < np.ptp(table[:, 2]) < 0.025  # 0.017
    assert not table[:, 0].any()


def test_the_body_never_goes_back() -> None:
    found = made(2, amount=2.0)
    assert np.abs(np.diff(found.table[:, 1])).max() < 0.5 * found.spacing


def test_it_starts_and_stops_at_its_place() -> None:
    np.testing.assert_allclose(made().at(np.array([-1.0, 0.0, LENGTH, 9.0])), 0.0, atol=1e-12)


def test_with_fewer_arms_down_it_does_so_more() -> None:
    heights = [np.ptp(made(arms).table[:, 2]) for arms in (2, 4, 8)]
    assert heights[0] > heights[1] > heights[2]


def test_more_is_more_and_nothing_is_nothing() -> None:
    assert np.ptp(made(amount=2.0).table[:, 2]) > np.ptp(made().table[:, 2])
    nothing = surge(holds(4), straight, LENGTH, stride=STRIDE, reach=REACH, amount=0.0)
    assert nothing is None
    none_hold = Holds(*np.zeros((3, 0)))
    assert surge(none_hold, straight, LENGTH, stride=STRIDE, reach=REACH, amount=1.0) is None


def test_a_loop_has_no_seam() -> None:
    found = made(loop=True)
    near = np.array([1e-4, 2e-4])
    before, after = found.at(LENGTH - near), found.at(near)
    np.testing.assert_allclose(found.at(np.array([0.0])), found.at(np.array([LENGTH])), atol=1e-12)
    # Neither in place nor in speed: what is ahead goes on as it came.
    np.testing.assert_allclose(before[0] - before[1], after[1] - after[0], atol=1e-7)
    np.testing.assert_allclose(found.table.mean(axis=0), 0.0, atol=2e-3)


def test_it_is_calm_where_it_is_to_be() -> None:
    found = surge(
        holds(4),
        straight,
        LENGTH,
        stride=STRIDE,
        reach=REACH,
        amount=1.0,
        calm=np.array([[1.5, 2.5]]),
    )
    assert found is not None
    assert found.at(np.linspace(1.5, 2.5, 9)) == pytest.approx(0.0, abs=1e-12)
    assert np.abs(found.at(np.linspace(0.5, 1.0, 9))).max() > 1e-3


def test_a_hold_that_is_cut_short_does_not_jolt_it() -> None:
    every = holds(4)
    middle = len(every.start) // 2
    lasts = np.full(len(every.start), 0.5 * STRIDE)

    def height(lasting: float) -> np.ndarray:
        lasts[middle] = lasting * STRIDE
        some = Holds(every.start, every.start + lasts, every.behind)
        found = surge(some, straight, LENGTH, stride=STRIDE, reach=REACH, amount=1.0)
        assert found is not None
        return found.table[:, 2]

    nearly_none, brief, whole = (height(each) for each in (1e-3, 0.1, 0.5))
    # Were it as strong as the others, 0.65 of what a whole one does, in a fifth of the time.
    assert np.abs(brief - nearly_none).max() < 0.15 * np.abs(whole - nearly_none).max()
