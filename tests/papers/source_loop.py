# SPDX-License-Identifier: GPL-3.0-or-later
"""The thesis' own way to move an arm [Octopus, §3.1–3.4], literally and plainly, one arm at a time.

Nothing of it comes from the extension: what is compared with it has to agree, or to be better, by
itself. Where the print has mistakes (docs/mathematics.md lists them) there is a switch.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

KNOTS: Final = np.array([0.0, 0.5, 1.0, 1.5, 2.0]) * np.pi
WALK: Final = np.radians(
    [
        [0.0, 25.0, -50.0, -75.0, 0.0],
        [0.0, -120.0, 80.0, 100.0, 0.0],
        [0.0, 30.0, -30.0, -60.0, 0.0],
    ]
)
"""(links, knots) what eq. 3.8–3.10 come to at 0, π/2, π, 3π/2 and 2π."""
SWIM: Final = np.radians(
    [[0.0, 10.0, -80.0, -5.0, 0.0], [0.0, 15.0, -5.0, -45.0, 0.0], [0.0, 15.0, 0.0, -60.0, 0.0]]
)
"""The same of eq. 3.15–3.17, whose third piece is taken as continuous, and fourth without the
second π."""
TABLES: Final = {"walk": WALK, "swim": SWIM}


def angles(table: Floats, phase: float) -> Floats:
    """(links,) radians of the links at a phase."""
    inside = phase % (2.0 * np.pi)
    return np.array([np.interp(inside, KNOTS, row) for row in table])


@dataclass
class SourceArm:
    """An arm of the thesis' octopus. Outward is x and up z; P₀ is the origin."""

    count: int = 12
    """n, a multiple of three."""
    first: float = 1.0
    """w₀"""
    sum_as_printed: bool = False
    """Whether H₁ has the term too many of eq. 3.4."""
    diameters: Floats = field(init=False)
    """(n + 1,) w₀ … wₙ."""
    segments: Floats = field(init=False)
    """(n,) l₀ … lₙ₋₁."""
    joints: Floats = field(init=False)
    """(n + 1, 3) P₀ … Pₙ."""
    turned: Floats = field(init=False)
    """(n, 3, 3) how each segment is turned, as a hierarchy of bones is."""

    def __post_init__(self) -> None:
        self.diameters = self.first * (1.0 - 0.01 * np.arange(self.count + 1.0))  # eq. 3.1
        self.segments = 0.5 * self.diameters[:-1]  # eq. 3.2
        self.straighten()

    @property
    def length(self) -> float:
        """Of the whole arm."""
        return float(self.segments.sum())

    def straighten(self) -> None:
        """As it is at rest: level with the ground."""
        along = np.concatenate([[0.0], np.cumsum(self.segments)])
        self.joints = along[:, None] * [1.0, 0.0, 0.0]
        self.turned = np.tile(np.eye(3), (self.count, 1, 1))

    def widths(self) -> Floats:
        """(3,) H₁, H₂, H₃ [eq. 3.4–3.6]."""
        third = self.count // 3
        if self.sum_as_printed:
            borders = [0, third + 1, 2 * third + 1, self.count + 1]
            halves = 0.5 * self.diameters
        else:
            borders, halves = [0, third, 2 * third, self.count], self.segments
        return np.array([halves[first:last].sum() for first, last in zip(borders, borders[1:])])  # noqa: B905, RUF007

    def targets(self, head: Floats, pitch: Floats | None = None) -> Floats:
        """(4, 3) Q₀ … Q₃ for the angles of the links (3,), each in the frame of the one before."""
        pitch = np.zeros(3) if pitch is None else pitch
        asked = np.hypot(head, pitch)
        widths = self.widths() * (1.0 - np.abs(asked) / (2.0 * np.pi))  # eq. 3.11–3.14
        frame, places = np.eye(3), [np.zeros(3)]
        for link in range(3):
            frame = (
                frame @ about((0.0, 0.0, 1.0), pitch[link]) @ about((0.0, -1.0, 0.0), head[link])
            )
            places.append(places[-1] + widths[link] * frame[:, 0])
        return np.array(places)

    def groups(self) -> list[range]:
        """Numbers of the joints that are turned to bring a group's end to its target."""
        third = self.count // 3
        return [range(third * group, third * (group + 1)) for group in range(3)]

    def sweep(self, group: range, target: Floats, weights: Floats) -> Iterator[int]:
        """One sweep from a group's end to its root [§3.1.2, eq. 3.7]; each joint, once turned."""
        for joint in reversed(group):
            centre = self.joints[joint]
            end, wanted = self.joints[group[-1] + 1] - centre, target - centre
            axis = cross(end, wanted)
            angle = math.atan2(math.hypot(*axis), float(end @ wanted))
            turn = about(axis, weights[joint] * angle)
            self.joints[joint + 1 :] = centre + (self.joints[joint + 1 :] - centre) @ turn.T
            self.turned[joint:] = turn @ self.turned[joint:]
            yield joint

    def solve(
        self, targets: Floats, weights: Floats, *, tolerance: float = 1e-3, most: int = 50
    ) -> int:
        """Bring group 1 to Q₁, then 2 to Q₂, then 3 to Q₃; the sweeps that it took.

        It ends with a group where the end is within ``tolerance`` arm lengths of its target
        [eq. 3.3], or after so many sweeps.
        """
        done = 0
        for group, target in zip(self.groups(), targets[1:], strict=True):
            for _ in range(most):
                if math.dist(target, self.joints[group[-1] + 1]) <= tolerance * self.length:
                    break
                for _ in self.sweep(group, target, weights):
                    pass
                done += 1
        return done

    def misses(self, targets: Floats) -> Floats:
        """(3,) how far each group's end is from its target, in arm lengths."""
        ends = self.joints[[group[-1] + 1 for group in self.groups()]]
        return np.linalg.norm(ends - targets[1:], axis=1) / self.length

    def directions(self) -> Floats:
        """(n, 3) of the segments."""
        return np.diff(self.joints, axis=0) / self.segments[:, None]


def cross(first: Floats, second: Floats) -> tuple[float, float, float]:
    """Of two vectors: numpy's own takes ten times as long for a single pair."""
    (a, b, c), (x, y, z) = first.tolist(), second.tolist()
    return (b * z - c * y, c * x - a * z, a * y - b * x)


def about(axis: tuple[float, float, float], angle: float) -> Floats:
    """The matrix that turns about an axis of any length (Rodrigues)."""
    size = math.hypot(*axis)
    if size < 1e-12:
        return np.eye(3)
    x, y, z = (each / size for each in axis)
    sine, rest = math.sin(angle), 1.0 - math.cos(angle)
    return np.array(
        [
            [1.0 - rest * (y * y + z * z), rest * x * y - sine * z, rest * x * z + sine * y],
            [rest * x * y + sine * z, 1.0 - rest * (x * x + z * z), rest * y * z - sine * x],
            [rest * x * z - sine * y, rest * y * z + sine * x, 1.0 - rest * (x * x + y * y)],
        ]
    )
