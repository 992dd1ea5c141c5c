# SPDX-License-Identifier: GPL-3.0-or-later
"""How the joint of a limb has to turn so that the limb comes to lie where it was seen to be.

A limb is its triangle: joint, elbow (or knee), hand (or foot). After [Splice], section 2.2: the
limb is put onto the joint with all its own inner rotations; one rotation makes the normals of its
triangle and of the wanted one agree, a second one, about the normal, brings the hand into the
wanted direction. The source says nothing on a limb that is straight, and has no normal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from ...rotations import (
    Floats,
    conjugate,
    cross,
    from_axis_angle,
    multiply,
    normalized,
    rotate,
    shortest_arc,
)
from ...smoothing import smooth_step

_STRAIGHT: Final = np.radians(5.0)
"""Bend below which a triangle says nothing of how a limb is turned about itself."""

_BENT: Final = np.radians(60.0)
"""Bend above which it says all. In between it is believed little by little: on a body of other
proportions the triangle of a limb that is almost straight is another one, and a knee or an elbow
that leaves straight fast would spin the limb."""

_SHAPED: Final = np.radians(40.0)
"""Bend above which a limb of other proportions bends as far as its point asks."""

_AGREES: Final = np.radians(45.0)
_DISAGREES: Final = np.radians(120.0)
"""Angles between the normals up to which they are made to agree, and from which the triangles are
so unlike (bodies of other proportions) that their normals say nothing."""

_FOLDED: Final = np.radians(130.0)
"""Bend from which a triangle says less and less again, down to nothing as the limb is folded."""

_TIGHT: Final = np.radians(150.0)
_TIGHTEST: Final = np.radians(170.0)
"""Bends beyond which no limb folds of itself to reach a point: the first is left slowly."""

_MOVED: Final = np.radians(5.0)
"""Change of a bend that is worth turning a straight limb to its hinge."""

SOFT: Final = 0.03
"""Of a limb's length: the last stretch of its reach, over which it straightens slowly. To follow a
point exactly up to the end of its reach an elbow would have to open ever faster there, without
bound, and to stop at once."""


@dataclass(frozen=True, eq=False)
class LimbTriangle:
    """Joints of a limb over time, (frames, 3) each."""

    joint: Floats
    elbow: Floats
    hand: Floats

    def turned(self, turn: Floats) -> LimbTriangle:
        """The limb after a rotation (frames, 4) about its joint."""
        elbow, hand = (rotate(turn, each - self.joint) for each in (self.elbow, self.hand))
        return LimbTriangle(self.joint, self.joint + elbow, self.joint + hand)

    @cached_property
    def upper(self) -> Floats:
        """(frames, 3) from the joint to the elbow."""
        return self.elbow - self.joint

    @cached_property
    def lower(self) -> Floats:
        """(frames, 3) from the elbow to the hand."""
        return self.hand - self.elbow

    @cached_property
    def folded(self) -> Floats:
        """(frames,) how far the hand is from the joint when the limb is folded tightly."""
        upper, lower = np.linalg.norm(self.upper, axis=-1), np.linalg.norm(self.lower, axis=-1)
        return np.sqrt(upper**2 + lower**2 + 2.0 * upper * lower * np.cos(_TIGHT))

    @cached_property
    def normal(self) -> Floats:
        """(frames, 3) about which it is bent, none of a straight one."""
        return cross(self.upper, self.lower)

    @cached_property
    def bend(self) -> Floats:
        """(frames,) angle at the elbow by which it is off straight, 0…π."""
        cosine = np.sum(self.upper * self.lower, axis=-1)
        return np.arctan2(np.linalg.norm(self.normal, axis=-1), cosine)


def joint_turn(limb: LimbTriangle, wanted: LimbTriangle) -> Floats:
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
    angle = _angle_about(goal, rotate(aimed, limb.normal), wanted.normal)
    # It has faded out long before half a turn, where the way round would jump.
    trust = smooth_step((_DISAGREES - np.abs(angle)) / (_DISAGREES - _AGREES))
    share = np.minimum(_trust(limb.bend, _BENT), _trust(wanted.bend, _BENT)) * trust
    return multiply(from_axis_angle(goal, angle * share), aimed)


def _angle_about(axis: Floats, start: Floats, goal: Floats) -> Floats:
    """The angle (frames,) from one direction across an axis to another, about it."""
    sine = np.sum(cross(start, goal) * axis, axis=-1)
    return np.arctan2(sine, np.sum(start * goal, axis=-1))


def bend_to_reach(
    limb: LimbTriangle,
    target: Floats,
    hinge: Floats,
    *,
    alike: bool = True,
    soft: float = SOFT,
) -> tuple[Floats, Floats]:
    """Bend a limb so that its hand, which points at the target already, lands on it.

    It does so exactly up to the last stretch of its reach (``soft``), and where it is already.
    How fast the elbow opens is bounded by how fast hand and target move.

    The elbow stays on the side on which it is. A straight limb has no side: it bends about its
    hinge, and so does one that is bent the wrong way by a trifle.

    Args:
        limb: the limb.
        target: (frames, 3)
        hinge: (frames, 3) unit vectors about which the elbow bends.
        alike: whether the limb is of the proportions for which the target was seen. If not, the
            point means less than the shape: what is straight stays straight.
        soft: of the limb's length, the last stretch of its reach.

    Returns:
        Rotations (frames, 4) of the upper and of the lower limb.
    """
    upper, lower = np.linalg.norm(limb.upper, axis=-1), np.linalg.norm(limb.lower, axis=-1)
    bend = _wanted_bend(limb, target, soft)
    if not alike:
        bend = limb.bend + _trust(limb.bend, _SHAPED) * (bend - limb.bend)
    swung = _lift(upper, lower, bend) - _lift(upper, lower, limb.bend)
    direction = normalized(limb.hand - limb.joint)
    across = normalized(hinge - np.sum(hinge * direction, axis=-1, keepdims=True) * direction)
    plane = limb.normal / np.maximum(upper * lower, 1e-12)[:, None]
    missing = np.maximum(np.sin(_STRAIGHT) - np.linalg.norm(plane, axis=-1), 0.0)
    missing = missing * smooth_step(np.abs(bend - limb.bend) / _MOVED)
    axis = normalized(plane + missing[:, None] * across)
    straight = ~np.any(axis, axis=-1)
    axis[straight] = across[straight]
    # About the limb's line: from its own plane to that in which it bends.
    turn = from_axis_angle(direction, _angle_about(direction, limb.normal, axis))
    upper_turn = multiply(from_axis_angle(axis, -swung), turn)
    lower_turn = multiply(from_axis_angle(axis, bend - limb.bend - swung), turn)
    # The elbow goes round the limb's line to its new side, the bones do not twist with it.
    return _untwisted(upper_turn, limb.upper), _untwisted(lower_turn, limb.lower)


def _wanted_bend(limb: LimbTriangle, target: Floats, share: float) -> Floats:
    """The bend (frames,) with which a hand is as far from the joint as its target (frames, 3),
    softened over a share of the limb's length.
    """
    upper, lower = np.linalg.norm(limb.upper, axis=-1), np.linalg.norm(limb.lower, axis=-1)
    product = np.maximum(upper * lower, 1e-12)
    distance = np.linalg.norm(target - limb.joint, axis=-1)

    def bend_at(reached: Floats) -> Floats:
        cosine = (reached**2 - upper**2 - lower**2) / (2.0 * product)
        return np.arccos(np.clip(cosine, -1.0, 1.0))

    def eased(passed: Floats, edge: Floats, bend: Floats, room: Floats) -> Floats:
        """Beyond an edge: on as fast as it came there, and gently to rest."""
        speed = edge / np.maximum(product * np.sin(bend), 1e-12)
        share = np.clip(passed * speed / np.maximum(room, 1e-12), 0.0, 2.0)
        return room * (1.0 - (1.0 - 0.5 * share) ** 2)

    soft = share * (upper + lower)
    far = upper + lower - soft
    near = limb.folded
    straight, tight = bend_at(far), np.full(len(far), _TIGHT)
    bend = bend_at(np.clip(distance, near, far))
    bend -= eased(distance - far, far, straight, straight)
    bend += eased(near - distance, near, tight, _TIGHTEST - tight)
    # At both ends of its reach a limb that is there already stays as it is.
    now = limb.bend
    ends = np.maximum(1.0 - now / np.maximum(straight, 1e-12), (now - _TIGHT) / (np.pi - _TIGHT))
    span = soft * np.clip(ends, 0.0, 1.0)
    off = np.abs(distance - np.linalg.norm(limb.hand - limb.joint, axis=-1))
    own = 1.0 - smooth_step(off / np.maximum(span, 1e-9 * (upper + lower)))
    return own * now + (1.0 - own) * bend


def _lift(upper: Floats, lower: Floats, bend: Floats) -> Floats:
    """The angle (frames,) at the joint between the upper limb and the line to the hand."""
    return np.arctan2(lower * np.sin(bend), upper + lower * np.cos(bend))


def _untwisted(turn: Floats, segment: Floats) -> Floats:
    """The smallest rotation that points a segment where this one does."""
    start = normalized(segment)
    return shortest_arc(start, rotate(turn, start))


def hinge_axis(limb: LimbTriangle, orientation: Floats) -> Floats:
    """The axis (3,) about which a limb bends over a clip, along the upper limb's own axes, whose
    orientations (frames, 4) are given.
    """
    mean = rotate(conjugate(orientation), limb.normal).mean(axis=0)
    along = rotate(conjugate(orientation), limb.upper).mean(axis=0)
    if np.linalg.norm(mean) > 1e-3 * np.sum(along**2):
        return normalized(mean)
    # Always straight: any axis across the limb is as good.
    return normalized(np.cross(along, np.eye(3)[np.argmin(np.abs(along))]))


def _trust(bend: Floats, bent: float) -> Floats:
    """0 … 1: how much a bend (frames,) says, if one as large as ``bent`` says all."""
    opened = smooth_step((bend - _STRAIGHT) / (bent - _STRAIGHT))
    shut = np.pi - _STRAIGHT
    return np.minimum(opened, smooth_step((shut - bend) / (shut - _FOLDED)))
