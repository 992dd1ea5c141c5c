# SPDX-License-Identifier: GPL-3.0-or-later
"""How the joint of a limb has to turn so that the limb comes to lie where it was seen to be.

A limb is its triangle: joint, elbow (or knee), hand (or foot). After [Splice], section 2.2: the
limb is put onto the joint with all its own inner rotations; one rotation makes the normals of its
triangle and of the wanted one agree, a second one, about the normal, brings the hand into the
wanted direction. The source says nothing on a limb that is straight, and has no normal.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ..rotations import (
    Floats,
    conjugate,
    cross,
    from_axis_angle,
    multiply,
    normalized,
    rotate,
    shortest_arc,
)

_STRAIGHT: Final = float(np.sin(np.radians(5.0)))
"""Sine of the bend below which a triangle says nothing of how a limb is turned about itself."""

_BENT: Final = float(np.sin(np.radians(20.0)))
"""Sine of the bend above which it says all."""

_AGREES: Final = np.radians(45.0)
_DISAGREES: Final = np.radians(120.0)
"""Angles between the normals up to which they are made to agree, and from which the triangles are
so unlike (bodies of other proportions) that their normals say nothing."""

_MOVED: Final = np.radians(5.0)
"""Change of a bend that is worth turning a straight limb to its hinge."""

SOFT_ALIKE: Final = 5e-4
_SOFT: Final = 1e-2
"""Of a limb's length: how far short of a point a limb may stay when it is almost stretched, so that
the elbow does not shoot out and in as the point passes the end of its reach. The first where hands
are to be where they were; the second where bodies are of other proportions anyway."""


@dataclass(frozen=True, eq=False)
class Limb:
    """Joints of a limb over time, (frames, 3) each."""

    joint: Floats
    elbow: Floats
    hand: Floats


def joint_turn(limb: Limb, wanted: Limb) -> Floats:
    """The rotation (frames, 4) about a limb's joint that brings it to the wanted one's shape.

    The hand points from the joint exactly where the wanted one does. About that direction the limb
    is turned until the normals agree: both together are the source's two rotations. The flatter
    one of the triangles, the less it is turned, down to the smallest rotation that aims the hand,
    which keeps the upper limb's orientation as it was put on.

    Args:
        limb: as it was put onto the joint.
        wanted: with the same joint, and elbow and hand where they were seen to be.
    """
    own, goal = normalized(limb.hand - limb.joint), normalized(wanted.hand - limb.joint)
    aimed = shortest_arc(own, goal)
    normal = rotate(aimed, cross(limb.elbow - limb.joint, limb.hand - limb.elbow))
    other = cross(wanted.elbow - limb.joint, wanted.hand - wanted.elbow)
    sine = np.sum(cross(normal, other) * goal, axis=-1)
    angle = np.arctan2(sine, np.sum(normal * other, axis=-1))
    # It has faded out long before half a turn, where the way round would jump.
    trust = _smooth((_DISAGREES - np.abs(angle)) / (_DISAGREES - _AGREES))
    share = _bend(limb) * _bend(wanted) * trust
    return multiply(from_axis_angle(goal, angle * share), aimed)


def reach(
    limb: Limb, target: Floats, hinge: Floats, *, alike: bool = True
) -> tuple[Floats, Floats]:
    """Bend a limb so that its hand, which points at the target already, lands on it.

    The elbow stays on the side on which it is. A straight limb has no side: it bends about its
    hinge, and so does one that is bent the wrong way by a trifle.

    Args:
        limb: the limb.
        target: (frames, 3)
        hinge: (frames, 3) unit vectors about which the elbow bends.
        alike: whether the limb is of the proportions for which the target was seen. If not, the
            point means less than the shape: what is straight stays straight.

    Returns:
        Rotations (frames, 4) of the upper and of the lower limb.
    """
    upper = np.linalg.norm(limb.elbow - limb.joint, axis=-1)
    lower = np.linalg.norm(limb.hand - limb.elbow, axis=-1)
    now = np.linalg.norm(limb.hand - limb.joint, axis=-1)
    wanted = np.linalg.norm(target - limb.joint, axis=-1)
    whole = upper + lower
    # Measured as a change, so that a limb whose hand is there already does not move at all.
    soft = SOFT_ALIKE if alike else _SOFT
    change = _soft_reach(wanted, whole, soft) - _soft_reach(now, whole, soft)
    distance = now + (change if alike else _bend(limb) * change)
    distance = np.clip(distance, np.abs(upper - lower), whole)
    opened = _angle(upper, lower, now) - _angle(upper, lower, distance)
    swung = _angle(upper, now, lower) - _angle(upper, distance, lower)
    direction = normalized(limb.hand - limb.joint)
    normal = cross(limb.elbow - limb.joint, limb.hand - limb.elbow)
    across = normalized(hinge - np.sum(hinge * direction, axis=-1, keepdims=True) * direction)
    plane = normal / np.maximum(upper * lower, 1e-12)[:, None]
    missing = np.maximum(_STRAIGHT - np.linalg.norm(plane, axis=-1), 0.0)
    missing = missing * _smooth(np.abs(opened) / _MOVED)
    axis = normalized(plane + missing[:, None] * across)
    straight = ~np.any(axis, axis=-1)
    axis[straight] = across[straight]
    # About the limb's line: from its own plane to that in which it bends.
    sine = np.sum(cross(normal, axis) * direction, axis=-1)
    turn = from_axis_angle(direction, np.arctan2(sine, np.sum(normal * axis, axis=-1)))
    upper_turn = multiply(from_axis_angle(axis, swung), turn)
    lower_turn = multiply(from_axis_angle(axis, swung + opened), turn)
    # The elbow goes round the limb's line to its new side, the bones do not twist with it.
    return _untwisted(upper_turn, limb.elbow - limb.joint), _untwisted(
        lower_turn, limb.hand - limb.elbow
    )


def _untwisted(turn: Floats, segment: Floats) -> Floats:
    """The smallest rotation that points a segment where this one does."""
    start = normalized(segment)
    return shortest_arc(start, rotate(turn, start))


def hinge_axis(limb: Limb, orientation: Floats) -> Floats:
    """The axis (3,) about which a limb bends over a clip, along the upper limb's own axes.

    Args:
        limb: the joints over the clip.
        orientation: (frames, 4) of the upper limb.
    """
    normals = cross(limb.elbow - limb.joint, limb.hand - limb.elbow)
    mean = rotate(conjugate(orientation), normals).mean(axis=0)
    along = rotate(conjugate(orientation), limb.elbow - limb.joint).mean(axis=0)
    if np.linalg.norm(mean) > 1e-3 * np.sum(along**2):
        return normalized(mean)
    # Always straight: any axis across the limb is as good.
    return normalized(np.cross(along, np.eye(3)[np.argmin(np.abs(along))]))


def _bend(limb: Limb) -> Floats:
    """0 … 1: how much a limb's triangle says of its turn."""
    upper, lower = limb.elbow - limb.joint, limb.hand - limb.elbow
    sine = np.linalg.norm(cross(upper, lower), axis=-1) / np.maximum(
        np.linalg.norm(upper, axis=-1) * np.linalg.norm(lower, axis=-1), 1e-12
    )
    return _smooth((sine - _STRAIGHT) / (_BENT - _STRAIGHT))


def _smooth(share: Floats) -> Floats:
    bounded = np.clip(share, 0.0, 1.0)
    return bounded * bounded * (3.0 - 2.0 * bounded)


def _soft_reach(distance: Floats, whole: Floats, soft: float) -> Floats:
    """The distance itself well within reach; close to the whole length beyond, without a corner."""
    slack = whole - distance
    return whole - 0.5 * (slack + np.sqrt(slack**2 + (2.0 * soft * whole) ** 2))


def _angle(first: Floats, second: Floats, opposite: Floats) -> Floats:
    """The angle between two sides of a triangle, from its three lengths."""
    cosine = (first**2 + second**2 - opposite**2) / np.maximum(2.0 * first * second, 1e-12)
    return np.arccos(np.clip(cosine, -1.0, 1.0))
