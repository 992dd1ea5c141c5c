# SPDX-License-Identifier: GPL-3.0-or-later
"""NURBS curves cut into rational Bézier segments, one for each span between two knots.

A rational Bézier segment is an ordinary one in four dimensions, (w·x, w·y, w·z, w); a route made
of such segments needs one evaluation for every kind of curve.
"""

from __future__ import annotations

import numpy as np

from ...rotations import Floats


def bezier_spans(
    points: Floats, weights: Floats, order: int, knots: Floats
) -> tuple[Floats, Floats]:
    """Cut a NURBS curve at its knots.

    The control points of a span are the values of its polar form ("blossom") at the span's two
    ends, each taken so often that the two make up the degree; the polar form is de Boor's
    algorithm with a parameter of its own at each of its steps.

    Args:
        points: (n, 3) control points.
        weights: (n,) positive weights.
        order: degree + 1, at least 2 and at most n.
        knots: (n + order,) ascending; the curve runs from knots[order − 1] to knots[n].

    Returns:
        Homogeneous control points (spans, order, 4) of the spans that are not empty, and the
        knots between them (spans + 1,).
    """
    degree = order - 1
    inner = np.arange(degree, len(points))
    inner = inner[knots[inner + 1] > knots[inner]]
    start, end = knots[inner], knots[inner + 1]
    homogeneous = np.concatenate([points * weights[:, None], weights[:, None]], axis=-1)
    # The control points that each span feels, and the knots around it.
    felt = homogeneous[inner[:, None] + np.arange(-degree, 1)]
    around = knots[inner[:, None] + np.arange(1 - degree, degree + 1)]
    spans = np.empty_like(felt)
    for corner in range(order):
        values = felt
        for step in range(1, order):
            at = end if step <= corner else start
            left, right = around[:, step - 1 : degree], around[:, degree : 2 * degree + 1 - step]
            share = ((at[:, None] - left) / (right - left))[..., None]
            values = (1.0 - share) * values[:, :-1] + share * values[:, 1:]
        spans[:, corner] = values[:, 0]
    return spans, np.append(start, end[-1:])
