# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones as long as they are, whatever an importer has made of files that know joints alone."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.skeleton import without_made_up_scale

PARENTS = (-1, 0, 1, 2, 0, 4, 5, 0, 7, 8)
HEADS = np.array(
    [
        *((0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.5, 0.1, 0.0), (0.9, 0.1, 0.0)),
        *((-0.3, 0.0, 0.0), (-0.6, 0.0, 0.2), (-0.8, 0.0, 0.2)),
        *((0.0, 0.4, 0.0), (0.0, 0.55, 0.0), (0.0, 0.9, 0.1)),
    ]
)


def true_lengths() -> np.ndarray:
    """Each bone ends where its first child begins; the last ones are as long as those before."""
    lengths = np.zeros(len(PARENTS))
    for bone, parent in reversed(list(enumerate(PARENTS))):
        if parent >= 0:
            lengths[parent] = np.linalg.norm(HEADS[bone] - HEADS[parent])
    for bone in (3, 6, 9):
        lengths[bone] = lengths[PARENTS[bone]]
    return lengths


@given(st.floats(1e-3, 1e3))
def test_bones_that_are_all_too_long_by_a_factor_end_where_the_next_ones_begin(
    factor: float,
) -> None:
    found = without_made_up_scale(factor * true_lengths(), HEADS, PARENTS)
    off = abs(np.log(factor))
    if off > np.log(1.11):
        assert np.allclose(found, true_lengths(), rtol=1e-9)
    elif off < np.log(1.09):
        assert (found == factor * true_lengths()).all()


@given(st.lists(st.floats(0.05, 2.0), min_size=10, max_size=10, unique=True))
def test_bones_that_an_artist_has_made_longer_or_shorter_stay(lengths: list[float]) -> None:
    drawn = np.array(lengths)
    ways = np.linalg.norm(HEADS[1:] - HEADS[list(PARENTS[1:])], axis=1)
    ratios = np.sort(np.log(drawn[list(PARENTS[1:])] / ways))
    if (np.diff(ratios) > 0.05).all():
        assert (without_made_up_scale(drawn, HEADS, PARENTS) == drawn).all()


def test_two_bones_do_not_agree_on_anything() -> None:
    lengths = np.array([10.0, 10.0, 10.0])
    heads = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 2.0]])
    assert (without_made_up_scale(lengths, heads, (-1, 0, 1)) == lengths).all()
