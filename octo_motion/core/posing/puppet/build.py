# SPDX-License-Identifier: GPL-3.0-or-later
"""From bones to rigid bodies: capsules, masses, joints and their limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats, conjugate, multiply, rotate, to_rotation_vector
from ...skeleton import Skeleton
from .bone_roles import Roles
from .figure import Elements, Figure, Pose
from .joint_limits import bends

DENSITY: Final = 1000.0
"""kg/m³, of water and nearly of flesh."""

SIZE: Final = 1.5
"""Metres across that every puppet is simulated with: rigs come in all units, and clay that is
worked with must not become stiffer because a file is in centimetres."""

_SLIM: Final = 0.12
"""Radius of a limb without skin, as a share of its length."""
_THINNEST: Final = 0.02
_THICKEST: Final = 0.75
"""Bounds of a radius, as shares of the limb's length."""
_THICK: Final = 60.0
"""Percentile of the skin's distances that becomes a radius: neither folds nor fingers count."""
_FAR: Final = 95.0
"""Percentile of the skin's distances at which a limb ends whose bone does not say."""
_FEW: Final = 6
"""A limb with fewer points of skin is taken for one without."""
_LEAST_BULK: Final = 0.1
"""For inertia no body counts as thinner than this share of its length: a thread that is spun
about itself would need steps of its own."""
_LEAST_MASS: Final = 1e-3
"""No body is lighter than this share of the heaviest one."""
_SLACK: Final = 1e-3
"""Radians by which a pose may lie inside its limits; one beyond widens them."""
_TURNED: Final = float(np.radians(0.1))
"""A joint that is turned by more counts, and a root that is moved by more of its length."""
_MISLEADING: Final = 3.0
"""A bone that is so many times longer or shorter than the way to the next joint is no measure of
the limb: importers make such bones."""


@dataclass(frozen=True, eq=False)
class PosedBones:
    """All bones of an armature as they stand now, in the puppet's metres (see ``SIZE``)."""

    heads: Floats
    """(bones, 3)"""
    rotations: Floats
    """(bones, 4)"""
    lengths: Floats
    """(bones,)"""
    turn: Floats
    """(4,) of the armature object itself."""


FREE: Final = (-float(np.pi), float(np.pi))
"""A range without ends."""


@dataclass(frozen=True)
class JointLimits:
    """How far a bone may be turned from rest about each of its axes, least and most, radians."""

    x: tuple[float, float] = FREE
    twist: tuple[float, float] = FREE
    """About the bone, its Y."""
    z: tuple[float, float] = FREE
    held: tuple[bool, bool, bool] = (False, False, False)
    """About which of them the bone stays as it is, whatever the range."""


def build_figure(
    skeleton: Skeleton,
    roles: Roles,
    posed: PosedBones,
    *,
    skin: Mapping[int, Floats] | None = None,
    limits: Mapping[str, JointLimits] | None = None,
    thick: float = _THICK,
) -> tuple[Figure, Pose]:
    """Rigid bodies for the bones that are bodies, jointed as the bones stand now, and that pose.

    Joints are where the pose has them, so that a bone that was moved away from its parent stays
    there, and a pose beyond a limit widens it: a puppet that is taken up does not move. The joints'
    elements are without strength; see the presets. ``skin`` has points (points, 3), world, by the
    bone that moves them most; limbs without are slim. ``limits`` are by name of the bone. Limbs are
    as ``thick`` as so many of a hundred points are within.
    """
    bones = list(roles.bodies)
    parents = np.array(roles.parents)
    heads, rotations = posed.heads[bones], posed.rotations[bones]
    clouds = _clouds(roles, skin or {})
    ends = _ends(roles, posed, clouds)
    axes = rotate(conjugate(rotations), ends - heads)
    lengths = np.linalg.norm(axes, axis=1)

    anchors = joints_of(roles.parents, Pose(heads, rotations))
    rest = _in_parents(parents, multiply(posed.turn, skeleton.rest_rotations[bones]))

    radius = _radii(roles, heads, ends, clouds, thick)
    along = axes / lengths[:, None]
    inset = np.minimum(radius, 0.5 * lengths)
    # Caps end where the limb does; one that is shorter than it is thick becomes a ball.
    capsules = np.stack([inset[:, None] * along, (lengths - inset)[:, None] * along], axis=1)
    masses, inertias = _bulk(lengths - 2.0 * inset, along, radius, lengths)

    figure = Figure(
        names=tuple(skeleton.names[bone] for bone in bones),
        parents=roles.parents,
        anchors=anchors,
        rest=rest,
        lengths=lengths,
        masses=masses,
        centres=0.5 * axes,
        inertias=inertias,
        capsules=capsules,
        radii=radius,
        limits=_limits(skeleton, bones, limits or {}, _from_rest(parents, rest, rotations)),
        elements=Elements.limp(len(bones)),
    )
    return figure, Pose(heads.copy(), rotations.copy())


def _clouds(roles: Roles, skin: Mapping[int, Floats]) -> list[Floats]:
    """Points of the skin of each body: its bone's own, or of what follows it as well."""
    found: list[Floats] = []
    for body, bone in enumerate(roles.bodies):
        own = skin.get(bone, np.zeros((0, 3)))
        if len(own) < _FEW:
            mine = [points for each, points in skin.items() if roles.follows[each] == body]
            own = np.concatenate([own, *mine]) if mine else own
        found.append(own)
    return found


def _ends(roles: Roles, posed: PosedBones, clouds: Sequence[Floats]) -> Floats:
    """Where each limb ends (bodies, 3): at its bone's tail, unless that is misleading."""
    bones = list(roles.bodies)
    heads = posed.heads[bones]
    directions = rotate(posed.rotations[bones], np.array([0.0, 1.0, 0.0]))
    lengths = posed.lengths[bones]
    ends = heads + lengths[:, None] * directions
    children: list[list[int]] = [[] for _ in bones]
    for body, parent in enumerate(roles.parents):
        if parent >= 0:
            children[parent].append(body)
    least = 1e-6 * max(float(np.ptp(posed.heads, axis=0).max()), float(lengths.max()))
    for body, beneath in enumerate(children):
        head, length, parent = heads[body], lengths[body], roles.parents[body]
        ways = heads[beneath] - head
        reach = np.linalg.norm(ways, axis=1)
        if beneath and reach.max() > least:
            far = float(reach.max())
            fits = far / _MISLEADING <= length <= far * _MISLEADING
            ahead = (ways @ directions[body] > 0.5 * reach).any() or len(beneath) > 1
            if not (fits and ahead):
                ends[body] = heads[beneath[int(np.argmax(reach))]]
        elif parent >= 0 and not beneath:
            before = float(np.linalg.norm(head - heads[parent]))
            if length * _MISLEADING < before:
                ends[body] = _end_of_skin(head, clouds[body])
                if np.linalg.norm(ends[body] - head) < 0.1 * before:
                    ends[body] = head + 0.5 * (head - heads[parent])
        if np.linalg.norm(ends[body] - head) < least:
            ends[body] = head + least * directions[body]
    return ends


def _end_of_skin(head: Floats, cloud: Floats) -> Floats:
    if len(cloud) < _FEW:
        return head
    way = cloud.mean(axis=0) - head
    size = float(np.linalg.norm(way))
    if size == 0.0:
        return head
    return head + way / size * max(float(np.percentile((cloud - head) @ way / size, _FAR)), 0.0)


def _radii(
    roles: Roles, heads: Floats, ends: Floats, clouds: Sequence[Floats], thick: float
) -> Floats:
    """Radius of each limb: of the skin about it, of its neighbours' or else slim."""
    count = len(heads)
    axes = ends - heads
    lengths = np.linalg.norm(axes, axis=1)
    radius = np.full(count, np.nan)
    for body, cloud in enumerate(clouds):
        if len(cloud) >= _FEW:
            along = axes[body] / lengths[body]
            offset = cloud - heads[body]
            share = np.clip(offset @ along, 0.0, lengths[body])
            apart = np.linalg.norm(offset - share[:, None] * along, axis=1)
            radius[body] = np.percentile(apart, thick)
    known = radius.copy()
    for body in np.flatnonzero(np.isnan(known)):
        near = [each for each, parent in enumerate(roles.parents) if parent == body]
        if roles.parents[body] >= 0:
            near.append(roles.parents[body])
        given = known[near][~np.isnan(known[near])] if near else np.zeros(0)
        radius[body] = given.min() if len(given) else _SLIM * lengths[body]
    return np.clip(radius, _THINNEST * lengths, _THICKEST * lengths)


def _bulk(
    straight: Floats, along: Floats, radius: Floats, lengths: Floats
) -> tuple[Floats, Floats]:
    """Masses (bodies,) and inertias (bodies, 3, 3) of solid capsules about their middles.

    They lie along unit vectors (bodies, 3), and are straight (bodies,) for a length between the
    caps.
    """
    tube = DENSITY * np.pi * radius**2 * straight
    ball = DENSITY * 4.0 / 3.0 * np.pi * radius**3
    masses = tube + ball
    masses = np.maximum(masses, _LEAST_MASS * masses.max())
    share = tube / (tube + ball)
    bulk = np.maximum(radius, _LEAST_BULK * lengths)
    about = masses * bulk**2 * (0.5 * share + 0.4 * (1.0 - share))
    # Of each half ball the middle lies 3/8 of the radius beyond the tube's end.
    across = masses * (
        share * (straight**2 / 12.0 + bulk**2 / 4.0)
        + (1.0 - share) * (0.4 * bulk**2 + 0.25 * straight**2 + 0.375 * straight * bulk)
    )
    axis = along[:, :, None] * along[:, None, :]
    inertias = across[:, None, None] * (np.eye(3) - axis) + about[:, None, None] * axis
    return masses, inertias


def _from_rest(parents: np.ndarray, rest: Floats, rotations: Floats) -> Floats:
    """How far each body is turned from rest now, (bodies, 4) in its own frame at rest."""
    return multiply(conjugate(rest), _in_parents(parents, rotations))


def _in_parents(parents: np.ndarray, rotations: Floats) -> Floats:
    """Orientations (bodies, 4) in the parents' frames, of roots in the world's."""
    seen = rotations.copy()
    hanging = parents >= 0
    seen[hanging] = multiply(conjugate(rotations[parents[hanging]]), rotations[hanging])
    return seen


def _limits(
    skeleton: Skeleton, bones: list[int], limits: Mapping[str, JointLimits], turns: Floats
) -> Floats:
    given = [limits.get(skeleton.names[bone], JointLimits()) for bone in bones]
    ranges = np.array([(each.x, each.twist, each.z) for each in given])
    ranges = np.clip(np.sort(ranges, axis=2), *FREE)
    now = bends(turns)
    held = np.array([each.held for each in given])
    least = np.where(held, np.inf, ranges[..., 0])
    most = np.where(held, -np.inf, ranges[..., 1])
    least = np.minimum(least, now - _SLACK)
    most = np.maximum(most, now + _SLACK)
    return np.clip(np.stack([least, most], axis=2), *FREE)


def joints_of(parents: Sequence[int], pose: Pose) -> Floats:
    """(bodies, 3) where joints sit in the frames of their parents, in a pose; zeros for roots."""
    hanging = np.array(parents) >= 0
    above = np.array(parents)[hanging]
    anchors = np.zeros((len(parents), 3))
    anchors[hanging] = rotate(
        conjugate(pose.orientations[above]), pose.positions[hanging] - pose.positions[above]
    )
    return anchors


def turned_bodies(figure: Figure, before: Pose, after: Pose) -> list[int]:
    """Bodies whose joint has turned, and roots that have moved or turned."""
    parents = np.array(figure.parents)
    first = _from_rest(parents, figure.rest, before.orientations)
    second = _from_rest(parents, figure.rest, after.orientations)
    angles = np.linalg.norm(to_rotation_vector(multiply(conjugate(first), second)), axis=-1)
    moved = np.linalg.norm(after.positions - before.positions, axis=-1)
    turned = (angles > _TURNED) | ((parents < 0) & (moved > _TURNED * figure.lengths))
    return np.flatnonzero(turned).tolist()
