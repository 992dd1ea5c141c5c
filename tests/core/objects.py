# SPDX-License-Identifier: GPL-3.0-or-later
"""Things to grasp, made from numbers: vertices and triangles."""

from collections.abc import Sequence

import numpy as np

from octo_motion.core.rotations import Floats

Form = tuple[Floats, np.ndarray]


def turned_form(outline: Sequence[tuple[float, float]], around: int = 48) -> Form:
    """A solid turned about z from (radius, height) pairs, from its bottom to its top."""
    angles = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    rows = [
        np.stack([r * np.cos(angles), r * np.sin(angles), np.full(around, z)], axis=1)
        for r, z in outline
    ]
    lower = np.arange(around)
    upper = np.roll(lower, -1)
    faces = []
    for row in range(len(outline) - 1):
        a, b = row * around + lower, row * around + upper
        c, d = b + around, a + around
        faces += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    return np.concatenate(rows), np.concatenate(faces)


def rod(radius: float = 0.06, height: float = 1.2) -> Form:
    """A cylinder that stands on the ground."""
    return turned_form([(0.0, 0.0), (radius, 0.0), (radius, height), (0.0, height)])


def bottle(radius: float = 0.08, height: float = 0.5) -> Form:
    """A cylinder with a narrow neck."""
    return turned_form(
        [
            *((0.0, 0.0), (radius, 0.0), (radius, 0.6 * height)),
            *((0.3 * radius, 0.75 * height), (0.3 * radius, height), (0.0, height)),
        ]
    )


def ball(radius: float = 0.12) -> Form:
    """A sphere about the origin."""
    steps = np.linspace(0.0, np.pi, 33)
    return turned_form([(radius * np.sin(t), -radius * np.cos(t)) for t in steps])


def box(sizes: Sequence[float] = (0.12, 0.2, 0.5)) -> Form:
    """A box about the origin."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [(a, b, c) for a, b, c, _ in quads] + [(a, c, d) for a, _, c, d in quads]
    return 0.5 * corners * np.array(sizes), np.array(triangles)
