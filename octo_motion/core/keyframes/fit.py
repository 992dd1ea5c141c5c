# SPDX-License-Identifier: GPL-3.0-or-later
"""The best values and slopes of all keys of a limb together.

What is minimal is a sum of squares: of errors as far as they are near their bounds or beyond, and,
with very little weight, of all. It is quadratic piece by piece, and a few rounds of Newton's method
take it down [Nocedal & Wright, *Numerical Optimization*, 2006, §17.1, quadratic penalties of
inequalities], each by conjugate gradients [Shewchuk, *An introduction to the conjugate gradient
method without the agonizing pain*, 1994, §B3]: the tracks of a limb are coupled by the ends that
they move.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from .curves import Curves, Singles
from .linear_model import LinearModel

_NEAR: Final = 0.9
"""Share of the bounds from which on an error counts."""
_CALM: Final = 0.1
"""Weight, against what counts, with which the rest stays as it is …"""
_HOME: Final = 0.001
"""… and with which it is drawn to where it should be."""
_FAR: Final = 0.05
"""Both for ends of bones, against tracks' own errors: what they couple takes long to solve."""
_BLOCK: Final = 16
"""Choices that are solved for together."""
_RIDGE: Final = 1e-3
"""Share by which they are held for themselves: some hardly matter to any frame."""


def fitted(
    curves: Curves, model: LinearModel, off: Singles, steps: int, *, bounded: bool
) -> Singles:
    """By how much to change choices (4, size) to make errors smaller.

    Args:
        curves: what is chosen for.
        model: what they are to follow.
        off: (4, tracks, frames) how far off they are.
        steps: of conjugate gradients.
        bounded: whether errors matter near the bounds and beyond, rather than all alike.
    """
    errors = model.errors(off)
    pulls, stiff = [], []
    for each, share in zip(errors, (1.0, _FAR), strict=False):
        if not bounded:
            weights = np.full(each.shape[1:], share, dtype=np.float32)
            pulls.append(weights)
            stiff.append(weights)
            continue
        size = np.sqrt((each**2).sum(axis=0))
        beyond = np.maximum(1.0 - _NEAR / np.maximum(size, _NEAR), 0.0)
        pulls.append(beyond + np.float32(_HOME * share))
        stiff.append((size > _NEAR) + np.float32(_CALM * share))

    def gradient(change: Singles, errors: list[Singles], weights: list[Singles]) -> Singles:
        weighted = [weight * each for weight, each in zip(weights, errors, strict=True)]
        return curves.gathered(model.pull(change, weighted, weights[0]))

    eased = _eased(curves, model.weights(stiff[0]))
    rest = -gradient(off, errors, pulls)
    turned = eased(rest)
    way = turned.copy()
    total = np.zeros_like(rest)
    size = float(np.vdot(rest, turned))
    for _ in range(steps):
        if size <= 1e-12:
            break
        change = curves.spread(way)
        answer = gradient(change, model.errors(change), stiff)
        share = size / max(float(np.vdot(way, answer)), 1e-30)
        total += share * way
        rest -= share * answer
        turned = eased(rest)
        before, size = size, float(np.vdot(rest, turned))
        way *= np.float32(size / before)
        way += turned
    return total


def _eased(curves: Curves, weight: Singles) -> Callable[[Singles], Singles]:
    """What nearly solves the system of tracks by themselves: the choices of some keys at a time.

    Args:
        curves: what is chosen for.
        weight: (tracks, frames) of each value by itself.
    """
    blocks = -(-curves.size // _BLOCK)
    matrix = np.zeros((blocks, _BLOCK, _BLOCK), dtype=np.float32)
    for one in range(4):
        for two in range(one, 4):
            rows, columns = curves.choices[one], curves.choices[two]
            near = (rows // _BLOCK == columns // _BLOCK) & curves.free[rows] & curves.free[columns]
            rows, columns = rows[near], columns[near]
            both = curves.coupled(one, two, weight)[near]
            np.add.at(matrix, (rows // _BLOCK, rows % _BLOCK, columns % _BLOCK), both)
            if one != two:
                np.add.at(matrix, (rows // _BLOCK, columns % _BLOCK, rows % _BLOCK), both)
    place = np.arange(_BLOCK)
    diagonal = matrix[:, place, place]
    # What is not free, and what fills up the last block, is by itself.
    matrix[:, place, place] = diagonal * np.float32(1.0 + _RIDGE) + (diagonal == 0.0)
    inverse = np.linalg.inv(matrix)

    def solved(pulls: Singles) -> Singles:
        padded = np.zeros((4, blocks * _BLOCK), dtype=np.float32)
        padded[:, : curves.size] = pulls
        result = inverse @ padded.reshape(4, blocks, _BLOCK).transpose(1, 2, 0)
        return result.transpose(2, 0, 1).reshape(4, -1)[:, : curves.size]

    return solved
