# SPDX-License-Identifier: GPL-3.0-or-later
"""What a puppet is made of: rigid bodies in a tree of ball joints, each with a plastic element.

Units are metres, kilograms, seconds, radians; the world is Blender's, Z up. A body's own frame sits
at its joint (the head of its bone) with the axes of the bone, +Y along it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...rotations import Floats, conjugate, multiply, rotate

Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Figure:
    """A tree of rigid bodies, parents before children; body i hangs on its parent by joint i.

    The joint of a body without parent ties it to the world: free, or pinned while posing.
    """

    names: tuple[str, ...]
    """One for each body: the bone that it moves."""
    parents: tuple[int, ...]
    """Index of each body's parent, −1 for a root."""
    anchors: Floats
    """(bodies, 3) where a body's joint sits in the frame of its parent; zeros for a root."""
    rest: Floats
    """(bodies, 4) orientation at rest seen from the parent's frame (the world's for a root)."""
    lengths: Floats
    """(bodies,) of the bones: what a joint's opening is measured against."""
    masses: Floats
    """(bodies,)"""
    centres: Floats
    """(bodies, 3) centre of mass in the body's frame."""
    inertias: Floats
    """(bodies, 3, 3) about the centre of mass, in the body's frame."""
    capsules: Floats
    """(bodies, 2, 3) ends of the capsule's axis in the body's frame."""
    radii: Floats
    """(bodies,) of the capsules."""
    limits: Floats
    """(bodies, 3, 2) least and greatest bend about X, twist about Y (the bone) and bend about Z, in
    the bone's axes at rest (see ``joint_limits``); −π and π where there is no end."""
    elements: Elements
    owners: tuple[int, ...] = ()
    """(bodies,) which of several figures and things each body belongs to, from 0 on, where they are
    simulated together: different ones push each other away. Empty where all is one figure."""
    heavy: tuple[bool, ...] = ()
    """(bodies,) what has weight even in a world without; empty for none."""

    def __len__(self) -> int:
        return len(self.names)


@dataclass(frozen=True, eq=False)
class Elements:
    """Coefficients of the three-element model [Plastic, eq. 16–26], for each joint alike about all
    axes (bodies,), or about the bone's own X, Y (twist) and Z (bodies, 3).

    A root's count only where the root is pinned.
    """

    stiffness: Floats
    """K_f, N·m/rad."""
    damping: Floats
    """D_f, beside the spring, N·m·s/rad."""
    flow: Floats
    """D_d, in series, N·m·s/rad: how fast the joint gives way."""
    yield_torque: Floats
    """(bodies,) N·m: below it the series damper holds; 0 lets it creep always, as in the source."""

    @classmethod
    def limp(cls, count: int) -> Elements:
        """Joints that resist nothing."""
        return cls(*np.zeros((4, count)))

    def where(self, works: Flags) -> Elements:
        """These in the joints (bodies,) of a mask, and others limp."""
        stiffness, damping, flow = (
            (each.T * works).T for each in (self.stiffness, self.damping, self.flow)
        )
        return Elements(stiffness, damping, flow, self.yield_torque)


@dataclass(frozen=True, eq=False)
class Pose:
    """Where the bodies of a figure are."""

    positions: Floats
    """(bodies, 3) of the joints, world."""
    orientations: Floats
    """(bodies, 4), world."""


def rest_pose(figure: Figure) -> Pose:
    """The figure as it was made, its roots' joints at the origin."""
    return pose_of(figure, figure.rest, np.zeros((len(figure), 3)))


def pose_of(figure: Figure, turns: Floats, roots: Floats) -> Pose:
    """The pose with joints turned by (bodies, 4) in their parents' frames; every joint is closed.

    ``roots`` (bodies, 3) has the world positions of the roots' joints; other rows count for
    nothing.
    """
    positions = np.array(roots, dtype=np.float64)
    orientations = np.array(turns, dtype=np.float64)
    for body, parent in enumerate(figure.parents):
        if parent >= 0:
            orientations[body] = multiply(orientations[parent], orientations[body])
            arm = rotate(orientations[parent], figure.anchors[body])
            positions[body] = positions[parent] + arm
    return Pose(positions, orientations)


def closed(figure: Figure, pose: Pose) -> Pose:
    """A pose with the same orientations and roots, and every joint closed."""
    parents = np.array(figure.parents)
    turns, hangs = pose.orientations.copy(), parents >= 0
    carried = conjugate(pose.orientations[parents[hangs]])
    turns[hangs] = multiply(carried, turns[hangs])
    return pose_of(figure, turns, pose.positions)


def distances_to_axes(ends: Floats, point: Floats) -> Floats:
    """(axes,) how far a point (3,) is from axes with ends (axes, 2, 3)."""
    start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    square = np.maximum((along * along).sum(axis=1), 1e-300)
    share = np.clip(((point - start) * along).sum(axis=1) / square, 0.0, 1.0)
    return np.linalg.norm(start + share[:, None] * along - point, axis=1)


def capsules_in_world(figure: Figure, pose: Pose) -> Floats:
    """Ends (bodies, 2, 3) of the capsules' axes."""
    turned = rotate(pose.orientations[:, None, :], figure.capsules)
    return pose.positions[:, None, :] + turned
