# SPDX-License-Identifier: GPL-3.0-or-later
"""Several figures, and things that can be pushed about, as one figure of several trees.

Whatever is simulated together is one ``Figure``: the puppet first, then what stands beside it. A
thing is a tree of a single body. Balls and rods are capsules, as limbs are; boxes and hulls have a
capsule inside, by which they are picked, and a shape of their own among the obstacles of the world.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...rotations import IDENTITY, Floats
from .figure import Elements, Figure, Integers, Pose


def joined(figures: Sequence[Figure]) -> Figure:
    """Figures side by side, in this order; of a single one, itself."""
    if len(figures) == 1:
        return figures[0]
    counts = [len(each) for each in figures]
    starts = np.cumsum([0, *counts[:-1]]).tolist()

    def column(name: str) -> Floats:
        return np.concatenate([getattr(each, name) for each in figures])

    return Figure(
        names=tuple(name for each in figures for name in each.names),
        parents=tuple(
            parent + start if parent >= 0 else -1
            for each, start in zip(figures, starts, strict=True)
            for parent in each.parents
        ),
        **{name: column(name) for name in _COLUMNS},
        elements=joined_elements([each.elements for each in figures]),
        owners=tuple(number for number, count in enumerate(counts) for _ in range(count)),
        heavy=tuple(heavy for each in figures for heavy in (each.heavy or (False,) * len(each))),
    )


def joined_elements(elements: Sequence[Elements]) -> Elements:
    """Elements of figures that are joined."""
    parts = [(each.stiffness, each.damping, each.flow) for each in elements]
    if any(np.ndim(part) > 1 for each in parts for part in each):
        parts = [
            tuple(part if part.ndim > 1 else np.tile(part[:, None], 3) for part in each)
            for each in parts
        ]
    stiffness, damping, flow = (np.concatenate(each) for each in zip(*parts, strict=True))
    return Elements(
        stiffness, damping, flow, np.concatenate([each.yield_torque for each in elements])
    )


def bodies_with(figure: Figure, body: int) -> Integers:
    """Numbers of the bodies of the figure, or the thing, that a body belongs to."""
    if not figure.owners:
        return np.arange(len(figure))
    owners = np.array(figure.owners)
    return np.flatnonzero(owners == owners[body])


def part_of(figure: Figure, body: int) -> Figure:
    """The figure, or the thing, that a body belongs to by itself."""
    if not figure.owners:
        return figure
    which = bodies_with(figure, body)
    first = int(which[0])
    own = figure.elements
    return replace(
        figure,
        names=tuple(figure.names[each] for each in which),
        parents=tuple(
            figure.parents[each] - first if figure.parents[each] >= 0 else -1 for each in which
        ),
        **{name: getattr(figure, name)[which] for name in _COLUMNS},
        elements=Elements(
            own.stiffness[which], own.damping[which], own.flow[which], own.yield_torque[which]
        ),
        owners=(),
        heavy=(),
    )


def resized(figure: Figure, share: float) -> Figure:
    """The figure ``share`` times as large, as dense as before; its elements are without strength.

    Figures of several armatures are simulated together in one unit of length.
    """
    return replace(
        figure,
        anchors=share * figure.anchors,
        lengths=share * figure.lengths,
        masses=share**3 * figure.masses,
        centres=share * figure.centres,
        inertias=share**5 * figure.inertias,
        capsules=share * figure.capsules,
        radii=share * figure.radii,
        elements=Elements.limp(len(figure)),
    )


def thing(
    name: str, mass: float, inertia: Floats, ends: Floats, radius: float, *, heavy: bool = True
) -> Figure:
    """A loose body whose frame sits at its centre of mass.

    Args:
        name: of the object.
        mass: kg.
        inertia: (3, 3) kg·m², about the centre.
        ends: (2, 3) of the axis of the capsule that it is, or that lies inside it.
        radius: of that capsule.
        heavy: whether it has weight even where the puppet has none.
    """
    size = float(np.linalg.norm(ends[1] - ends[0])) + 2.0 * radius
    return Figure(
        names=(name,),
        parents=(-1,),
        anchors=np.zeros((1, 3)),
        rest=IDENTITY[None].copy(),
        lengths=np.array([size]),
        masses=np.array([mass]),
        centres=np.zeros((1, 3)),
        inertias=inertia[None],
        capsules=ends[None],
        radii=np.array([radius]),
        limits=np.tile([-np.pi, np.pi], (1, 3, 1)),
        elements=Elements.limp(1),
        heavy=(heavy,),
    )


def joined_poses(poses: Sequence[Pose]) -> Pose:
    """Poses of figures that are joined."""
    if len(poses) == 1:
        return poses[0]
    return Pose(
        np.concatenate([each.positions for each in poses]),
        np.concatenate([each.orientations for each in poses]),
    )


def solid_moments(corners: Floats) -> tuple[float, Floats, Floats]:
    """Volume m³, middle (3,) and moments (3, 3) per density of a closed surface of triangles
    (triangles, 3 corners, 3), turned outwards: ∫ r rᵀ about the middle.

    Sums over the tetrahedra to the origin (Tonon 2004).
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    volume = float(volumes.sum())
    sums = a + b + c
    middle = (volumes[:, None] * sums).sum(axis=0) / (4.0 * volume)
    # ∫ r rᵀ of a tetrahedron with a corner at the origin: V/20 (Σ p pᵀ + s sᵀ), s = Σ p.
    squares = sum(each[:, :, None] * each[:, None, :] for each in (a, b, c, sums))
    second = (volumes[:, None, None] * squares).sum(axis=0) / 20.0
    return volume, middle, second - volume * np.outer(middle, middle)


def inertia_of(second: Floats) -> Floats:
    """(3, 3) inertia of ∫ r rᵀ dm (3, 3)."""
    return np.trace(second) * np.eye(3) - second


_COLUMNS = (
    *("anchors", "rest", "lengths", "masses", "centres", "inertias", "capsules", "radii"),
    "limits",
)
