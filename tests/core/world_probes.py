# SPDX-License-Identifier: GPL-3.0-or-later
"""What tests alone ask of a simulated puppet: its energy, and a push to begin with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from octo_motion.core.posing.puppet import Pose
from octo_motion.core.posing.solver.world import World
from octo_motion.core.rotations import Floats, conjugate, multiply, to_rotation_vector


@dataclass(frozen=True)
class Energy:
    """Joules."""

    kinetic: float
    elastic: float
    """In the springs of the elements."""
    weight: float
    """In the height of the centres of mass, against the origin."""

    @property
    def total(self) -> float:
        """Their sum."""
        return self.kinetic + self.elastic + self.weight


def energy_of(world: World) -> Energy:
    """What the figure holds now."""
    bodies, masses = world._bodies, world.figure.masses
    kinetic = 0.5 * float(
        (masses[:, None] * bodies.linear**2).sum() + (bodies.angular * bodies.spin).sum()
    )
    springs = joint_springs(world)
    elastic = 0.5 * float((world._law.stiffness[:, None] * springs * springs).sum())
    weight = -float(masses @ (_centres(world) @ world.settings.gravity))
    return Energy(kinetic, elastic, weight)


def joint_turns(world: World) -> Floats:
    """(bodies, 4) orientation of each body in its parent's frame (a root's in the world's)."""
    return world._bodies.turns.copy()


def joint_springs(world: World) -> Floats:
    """(bodies, 3) q_f of the elements: rotation vectors in the parent's frame, radians."""
    return to_rotation_vector(multiply(joint_turns(world), conjugate(world._bodies.rest)))


def set_velocities(world: World, velocities: Floats) -> None:
    """Give the bodies velocities (bodies, 6) as ``World.velocities`` reports them.

    The next step takes from them what the joints allow.
    """
    bodies, tree, warm = world._bodies, world._tree, world._warm
    bodies.linear = np.array(velocities[:, :3], dtype=np.float64)
    bodies.angular = np.array(velocities[:, 3:], dtype=np.float64)
    bodies.spin = (_inertias(world) @ bodies.angular[:, :, None])[:, :, 0]
    warm.contacts.slips = np.zeros(0)
    # Where the solver begins; it ends in the same place from anywhere.
    before = np.where(bodies.is_root[:, None], 0.0, bodies.angular[bodies.parent_or_self])
    warm.speeds = np.zeros_like(warm.speeds)
    warm.speeds[tree.joint_slot] = bodies.angular - before
    lever = bodies.positions[tree.roots] - _centres(world)[tree.roots]
    warm.speeds[tree.shift_slot] = bodies.linear[tree.roots] + np.cross(
        bodies.angular[tree.roots], lever
    )


def bend_springs(world: World, pose: Pose) -> None:
    """Put the figure into a pose, at rest, with springs that pull towards where they were."""
    rest = world._bodies.rest
    world.set_pose(pose)
    world._bodies.rest = rest


def _centres(world: World) -> Floats:
    """(bodies, 3) of mass, world."""
    bodies = world._bodies
    return bodies.positions + (bodies.matrices @ world.figure.centres[:, :, None])[:, :, 0]


def _inertias(world: World) -> Floats:
    """(bodies, 3, 3) about the centres of mass, world axes."""
    matrices = world._bodies.matrices
    return matrices @ world.figure.inertias @ matrices.transpose(0, 2, 1)
