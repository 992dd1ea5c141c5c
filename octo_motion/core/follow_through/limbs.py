# SPDX-License-Identifier: GPL-3.0-or-later
"""Chosen bones as a figure that is carried: what they hang on, what they are made of."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ..errors import RigError
from ..phrases import phrase
from ..posing.puppet import (
    GRAVITY,
    MATERIALS,
    Elements,
    Figure,
    Flags,
    Material,
    Pose,
    elements_for,
    joint_loads,
)
from ..posing.solver import nearest_on_segments
from ..rotations import IDENTITY, Floats, conjugate, multiply, rotate
from ..skeleton import Skeleton
from .sampling import BoneMotion
from .settings import FollowSettings

_NOWHERE: Final = -1e9
"""Radius of what touches nothing."""
_LIGHT: Final = 1e-3
"""Of the lightest bone: what a carrier weighs, which moves as it is carried."""
_MOST: Final = 300
_INSIDE: Final = 0.3
"""Of two radii together: axes that are closer have no sides."""


@dataclass(frozen=True, eq=False)
class Limbs:
    """The bones that are chosen, as a forest."""

    bones: tuple[int, ...]
    """Of the skeleton, parents before children."""
    parents: tuple[int, ...]
    """For each the place among them of the nearest one above it; −1 where there is none."""
    carriers: tuple[int, ...]
    """For each that has none, in order, the bone of the skeleton that it hangs on; −1 for none."""

    @property
    def roots(self) -> list[int]:
        """Places of those that hang on no other."""
        return [place for place, parent in enumerate(self.parents) if parent < 0]


def limbs_of(skeleton: Skeleton, names: Collection[str]) -> Limbs:
    """The forest of bones by name.

    Raises:
        RigError: there are none, there are too many, or one is not there.
    """
    missing = sorted(set(names) - skeleton.index.keys())
    if missing:
        raise RigError(
            phrase("There is no bone '{name}'.", name=missing[0]), "Choose the bones again."
        )
    if not names:
        raise RigError("No bones are chosen.", "Select bones in pose mode, and add them.")
    if len(names) > _MOST:
        raise RigError(
            phrase("{count} bones are chosen, more than {most}.", count=len(names), most=_MOST),
            "Choose fewer.",
        )
    chosen = {skeleton.index[name] for name in names}
    # Parents come before their children.
    bones = tuple(sorted(chosen, key=lambda bone: (len(skeleton.ancestors(bone)), bone)))
    place = {bone: number for number, bone in enumerate(bones)}
    parents, carriers = list[int](), list[int]()
    for bone in bones:
        above = next((each for each in skeleton.ancestors(bone) if each in chosen), -1)
        parents.append(place.get(above, -1))
        if above < 0:
            carriers.append(skeleton.parents[bone])
    return Limbs(bones, tuple(parents), tuple(carriers))


def carried_figure(
    limbs: Limbs, figure: Figure, motion: BoneMotion, settings: FollowSettings
) -> Figure:
    """The figure of the bones (bodies in their order) with one carrier for each that hangs on no
    other, in front. Carriers sit at the joints of what hangs on them.

    ``motion`` is that of all bones of the skeleton: joints are where they mostly are in it.
    """
    figure = replace(figure, parents=limbs.parents, anchors=_anchors(limbs, motion))
    elements = elements_of(figure, settings)
    roots = limbs.roots
    count = len(roots)
    none = np.zeros(count)
    own = iter(range(count))
    parents = [next(own) if parent < 0 else parent + count for parent in limbs.parents]
    inertia = _LIGHT * float(np.trace(figure.inertias, axis1=1, axis2=2).min())
    zeros = np.zeros((count, 3))
    return replace(
        figure,
        names=(*(f"carries {figure.names[each]}" for each in roots), *figure.names),
        parents=(*(-1 for _ in roots), *parents),
        anchors=np.concatenate([zeros, figure.anchors]),
        rest=np.concatenate([np.tile(IDENTITY, (count, 1)), figure.rest]),
        lengths=np.concatenate([np.zeros(count), figure.lengths]),
        masses=np.concatenate([np.full(count, _LIGHT * figure.masses.min()), figure.masses]),
        centres=np.concatenate([zeros, figure.centres]),
        inertias=np.concatenate([np.tile(inertia * np.eye(3), (count, 1, 1)), figure.inertias]),
        capsules=np.concatenate([np.zeros((count, 2, 3)), figure.capsules]),
        radii=np.concatenate([np.full(count, _NOWHERE), figure.radii]),
        limits=np.tile([-np.pi, np.pi], (count + len(figure), 3, 1)),
        elements=Elements(
            np.concatenate([none, elements.stiffness]),
            np.concatenate([none, elements.damping]),
            np.concatenate([none, elements.flow]),
            np.concatenate([none, elements.yield_torque]),
        ),
    )


def _anchors(limbs: Limbs, motion: BoneMotion) -> Floats:
    """(bones, 3) of joints in the frames of what they hang on; zeros on carriers."""
    anchors = np.zeros((len(limbs.bones), 3))
    for place, parent in enumerate(limbs.parents):
        if parent >= 0:
            bone, above = limbs.bones[place], limbs.bones[parent]
            apart = motion.positions[:, bone] - motion.positions[:, above]
            seen = rotate(conjugate(motion.orientations[:, above]), apart)
            anchors[place] = np.median(seen, axis=0)
    return anchors


def led_motion(limbs: Limbs, motion: BoneMotion) -> BoneMotion:
    """Of all bones' motion that of the carriers, and then of the bones themselves."""
    roots = [limbs.bones[each] for each in limbs.roots]
    turns = [
        np.broadcast_to(IDENTITY, motion.orientations[:, 0].shape)
        if bone < 0
        else motion.orientations[:, bone]
        for bone in limbs.carriers
    ]
    orientations = np.concatenate(
        [np.stack(turns, axis=1), motion.orientations[:, list(limbs.bones)]], axis=1
    )
    places = motion.positions[:, [*roots, *limbs.bones]]
    return BoneMotion(motion.rate, places, orientations)


def turns_to(figure: Figure, orientations: Floats) -> Floats:
    """Orientations (…, bodies, 4) seen from the parents'; of roots, the world's."""
    parents = np.array(figure.parents)
    hanging = parents >= 0
    result = orientations.copy()
    above = orientations[..., parents[hanging], :]
    result[..., hanging, :] = multiply(conjugate(above), orientations[..., hanging, :])
    return result


def pose_at(figure: Figure, motion: BoneMotion, row: int) -> Pose:
    """The figure at a moment of what leads it, every joint closed."""
    orientations = motion.orientations[row]
    positions = motion.positions[row].copy()
    for body, parent in enumerate(figure.parents):
        if parent >= 0:
            arm = rotate(orientations[parent], figure.anchors[body])
            positions[body] = positions[parent] + arm
    return Pose(positions, orientations.copy())


def own_rotations(
    skeleton: Skeleton, limbs: Limbs, motion: BoneMotion, own: Floats, found: Followed
) -> Floats:
    """The bones' rotations from rest (frames, bones, 4), Blender's ``matrix_basis``, of what came
    of a motion; the armature object is turned by ``own`` (frames, 4).
    """
    result = np.empty(found.turns.shape)
    carriers = iter(limbs.carriers)
    rest = skeleton.rest_rotations
    for place, bone in enumerate(limbs.bones):
        parent, above = skeleton.parents[bone], limbs.parents[place]
        if not skeleton.inherits_rotation[bone]:
            if above < 0:
                next(carriers)
            carried = multiply(own, rest[bone])
            result[:, place] = multiply(conjugate(carried), found.orientations[:, place])
            continue
        holder = limbs.bones[above] if above >= 0 else next(carriers)
        if parent < 0:
            carried = multiply(own, rest[bone])
        else:
            # What stands between goes along as the action has it.
            seen = motion.orientations[:, parent]
            if holder >= 0:
                seen = multiply(conjugate(motion.orientations[:, holder]), seen)
            carried = multiply(seen, multiply(conjugate(rest[parent]), rest[bone]))
        result[:, place] = multiply(conjugate(carried), found.turns[:, place])
    return result


@dataclass(frozen=True, eq=False)
class Followed:
    """What has come of a job."""

    turns: Floats
    """(frames, bones, 4) of the limbs' bones, seen from what they hang on."""
    orientations: Floats
    """(frames, bones, 4) the same in the world."""
    repeats: bool = True
    """Of a cycle, whether it has come to repeat itself."""
    rounds: int = 1
    """How many it took."""


# --- What they are made of ------------------------------------------------------------------------


def elements_of(figure: Figure, settings: FollowSettings) -> Elements:
    """The joints' elements: the puppet's materials, but for their damper.

    Whatever springs back does so along a whole limb, so that three bones and twelve behave alike.
    How long it swings is what an artist says; a limb's slowest swing has that damping.
    """
    material = _material(settings)
    elements = elements_for(figure, replace(material, of_limb=True), settings.strength)
    loads = settings.strength * joint_loads(figure)
    stiffness = np.where(elements.stiffness > 0.0, elements.stiffness, loads)
    swing = _slowest_swings(figure, stiffness)
    damping = 2.0 * settings.damping / swing * stiffness
    return replace(elements, damping=damping)


def _material(settings: FollowSettings) -> Material:
    if settings.material != "OWN":
        return MATERIALS[settings.material.lower()]
    yields = settings.bears > 0.0
    return Material(
        bears=settings.bears if yields else np.inf,
        springs=settings.springs,
        settles=0.1,
        gives=10.0 if yields else 0.0,
    )


def _slowest_swings(figure: Figure, stiffness: Floats) -> Floats:
    """(bodies,) rad/s: of all that hangs together with each, stretched out, the slowest swing.

    About one axis, with joint angles a: aᵀ M a/2 is its kinetic, aᵀ K a/2 its elastic energy.
    """
    parents = np.array(figure.parents)
    count = len(parents)
    tree, reach, above = np.zeros(count, dtype=np.intp), np.zeros(count), np.eye(count, dtype=bool)
    for body, parent in enumerate(figure.parents):
        tree[body] = body if parent < 0 else tree[parent]
        if parent >= 0:
            reach[body] = reach[parent] + float(np.linalg.norm(figure.anchors[body]))
            above[body] |= above[parent]
    centres = reach + np.linalg.norm(figure.centres, axis=1)
    # How far each body's middle is from each joint that turns it.
    arms = np.where(above, centres[:, None] - reach[None, :], 0.0)
    across = np.trace(figure.inertias, axis1=1, axis2=2) / 3.0
    masses = arms.T @ (figure.masses[:, None] * arms)
    masses += above.T.astype(float) @ (across[:, None] * above)
    swings = np.ones(count)
    for root in np.flatnonzero(parents < 0):
        own = np.flatnonzero(tree == root)
        part = masses[np.ix_(own, own)]
        scaled = part / np.sqrt(stiffness[own][:, None] * stiffness[own][None, :])
        swings[own] = 1.0 / np.sqrt(np.linalg.eigvalsh(scaled)[-1])
    return swings


def strengthened(elements: Elements, factors: Floats) -> Elements:
    """All torques times a factor (bodies,) of each joint."""
    return Elements(
        elements.stiffness * factors,
        elements.damping * factors,
        elements.flow * factors,
        elements.yield_torque * factors,
    )


def touching(ends: Floats, radii: Floats, others: Floats, thick: Floats) -> tuple[Flags, Floats]:
    """Which capsules with axes (bodies, 2, 3) and (capsules, 2, 3) may touch, (bodies, capsules),
    and how far they are in each other as they stand: so far they may be from then on.

    Of those whose axes nearly meet nobody knows on which side they are.
    """
    on_own, on_other = nearest_on_segments(ends[:, None], others[None, :])
    distance = np.linalg.norm(on_own - on_other, axis=-1)
    wanted = radii[:, None] + thick
    return distance > _INSIDE * wanted, np.maximum(wanted - distance, 0.0)


EARTH: Final = GRAVITY
"""m/s²"""
