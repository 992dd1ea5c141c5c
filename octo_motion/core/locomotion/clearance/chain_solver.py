# SPDX-License-Identifier: GPL-3.0-or-later
"""Chains whose segments turn, as little and as evenly as it takes, to bring joints somewhere.

Damped least squares in closed form (Buss, "Introduction to Inverse Kinematics with Jacobian
Transpose, Pseudoinverse and Damped Least Squares Methods", 2004): segments are told by their
directions, so turning one moves all joints after it by the same vector, and the three coordinates
share one small matrix.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from ...rotations import Floats

_DAMPED: Final = 0.02
"""Stiffness of a segment, in squares of its length …"""
_EVEN: Final = 0.1
"""… and of each joint between two, likewise."""
_BOLD: Final = 0.5
"""Radians that a segment turns at most."""
_TINY: Final = 1e-12


def turned_towards(
    directions: Floats, lengths: Floats, *, free: Floats, goals: Floats, weights: Floats
) -> Floats:
    """Directions (chains, segments, 3) that bring joints nearer to where they are to go.

    Args:
        directions: (chains, segments, 3) unit, or zero for segments of no length, which stay so.
        lengths: (chains, segments)
        free: (chains, segments) how far each is free to turn, 0…1; at 0 it stays as it is.
        goals: (chains, segments, 3) by how much the joint after each segment is to move.
        weights: (chains, segments) how much that matters.
    """
    count = lengths.shape[1]
    ease = np.sqrt(free)
    lever = lengths * ease
    # Which joints are moved by turning a segment: all that come after it.
    after = np.tril(np.ones((count, count)))
    # Sums over the joints after both of two segments, those after the later one.
    beyond = np.cumsum(weights[:, ::-1], axis=1)[:, ::-1]
    later = np.maximum.outer(np.arange(count), np.arange(count))
    matrix = beyond[:, later] * lever[:, :, None] * lever[:, None, :]
    # Of segments of no length, too, but little of that of the others.
    stiff = lengths**2 + _TINY * np.max(lengths**2, axis=1, keepdims=True)
    rows = np.arange(count)
    matrix[:, rows, rows] += _DAMPED * stiff
    between = _EVEN * np.sqrt(stiff[:, 1:] * stiff[:, :-1])
    matrix[:, rows[1:], rows[1:]] += between * free[:, 1:]
    matrix[:, rows[:-1], rows[:-1]] += between * free[:, :-1]
    mixed = between * ease[:, 1:] * ease[:, :-1]
    matrix[:, rows[1:], rows[:-1]] -= mixed
    matrix[:, rows[:-1], rows[1:]] -= mixed
    right = lever[..., None] * np.einsum("jk,ijc->ikc", after, weights[..., None] * goals)
    turn = ease[..., None] * np.linalg.solve(matrix, right)
    turn -= np.sum(turn * directions, axis=2, keepdims=True) * directions
    most = np.sqrt(np.max(np.sum(turn**2, axis=2), axis=1))[:, None, None]
    result = directions + turn / np.sqrt(1.0 + (most / _BOLD) ** 2)
    size = np.linalg.norm(result, axis=2, keepdims=True)
    turns = (free > 0.0) & (lengths > 0.0)
    return np.where(turns[..., None], result / np.maximum(size, _TINY), directions)


def joints_of(roots: Floats, directions: Floats, lengths: Floats) -> Floats:
    """Joints (chains, segments + 1, 3) of chains that begin at roots (chains, 3)."""
    steps = np.concatenate([roots[:, None], lengths[..., None] * directions], axis=1)
    return np.cumsum(steps, axis=1)
