# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms in stance on the ground while the body moves on, and in swing to the next foothold.

An arm at a time is one smooth curve: from the body to where it touches, along the ground, and up
again where it is not unrolled yet. In the middle of a swing it is the gait's own shape; between
the two it is a blend. Its segments are then turned, as little as it takes, until the arm meets its
foothold: those that lie on the ground not at all. All of it is a function of the frame's own
phase and place; there is no frame before it.

Vectors are (…, 3, batch), components first; the batch is frames × arms.

Where a constant says what was seen when it was other, that is the default octopus with the set-up
Walk on bumps of 0.3 arm lengths. As it is it slips by 0.0005 arm lengths, overlaps by 0.057 radii,
and no joint is below the ground; "jerk" is the most by which the change of a quaternion's component
from one frame to the next changes, 0.088.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from ...content_cache import part_of
from ...rotations import Floats, components_first
from ...rotations.components_first import dot
from ...smoothing import even_pace, least_jerk, smooth_step
from ..gait import shares_before
from ..rig import MARGIN, JointRoom, loose_from_root, room_needed
from .arm_curves import bent, curve, drawn, evened, lerp_bends, raise_over_ground, spread_chain
from .footholds import PEELING, UNROLLING, Footholds
from .surface import Ground, Limbs, StanceSettings

_STEPS: Final = (4, 3, 3, 4)
"""Newton's steps each time that an arm is drawn to its foothold, after it was raised. With half as
many arms miss it by 0.00001."""
_ROUGH_STEPS: Final = (2, 1, 1, 2)
"""The same of what is to be soon known, and may be off."""
_MORE_STEPS: Final = (2,) * 6
"""The same of arms that are in the ground even so: where they lie up a step, what comes before is
to fold into its corner. Without, arms of Settle are 0.022 deep there."""
_DEEP: Final = 0.0025
"""Arm lengths that joints are in the ground from which on that begins …"""
_DEEPENING: Final = 0.01
"""… within how many more all of it comes …"""
_IN_A_WALL: Final = 0.03
"""… and from where on, within as many again, it goes: what is as deep is in a wall, out of which
raising leads the wrong way. Without it bones turn over on steps that are not rounded."""
_HELPS: Final = (0.8, 0.5)
"""Shares of that depth left after it, at which it counts for nothing, and wholly. Without, arms of
an artist's rig with long bones slip by 0.003 on bumps instead of 0.002."""
_EVENED: Final = 0.3
"""Share of the mean of its neighbours that a segment takes on each time before it is raised.
Without it arms overlap by 0.077 radii, with a jerk of 0.097."""
_KEPT: Final = 0.3
"""Share of the gait's own shape in an arm that holds on. Without it arms slip less, by 0.0004, but
the gait hardly shows while they do, and the jerk is 0.109."""
_RAISED: Final = np.radians(12.0)
"""How far an arm that holds on leaves the body upwards of outward: at 0° arms overlap by 0.064
radii, with a jerk of 0.097."""
_RAISES: Final = 6
_RAISES_BETWEEN: Final = 2
"""How often the lowest joints of an arm are raised, in the air and before it is drawn down. Half as
often does as well on these bumps."""
_FALLING: Final = 0.2
"""Share of downward in the way that a slack arm comes to the ground. With half of it arms of Hurry
overlap by 0.075 radii instead of 0.045."""
_KNEE: Final = 2.8
"""Fewer segments than as many of equal length are as good as two with one joint between them: it
must point up, or it is in the way, and would snap from one side to the other."""
_STRAIGHT: Final = 0.999
"""Cosine of what is left of the knee's bend where the foothold is as far as it reaches."""
_ARCHED: Final = np.radians(15.0)
"""How much more an arm rises where it is slack: with 0° the jerk is 0.095 …"""
_ARCHING: Final = 0.5
"""… and over what share of its length that comes."""
_BUNCHED: Final = 0.7
"""Share of its length between body and foothold below which its curve is bent all over: a cubic
that is as long doubles back on itself at its top, and turns over at once."""
_BUNCHING: Final = 0.05
"""Over what share of its length that comes."""
_CURLED: Final = np.radians(85.0)
"""How far the tip stands up before it is unrolled. A choice of looks: at 20° arms slip by 0.0003,
and are hardly seen to unroll."""
_FOLDED: Final = np.radians(110.0)
"""How far the first bone of it is bent back at most from the one before: further on, which way it
has turned on itself is not definite. The default octopus' hardly come near."""
_BORDER: Final = 1.6
"""Segments before the ground over which an arm is less and less free to turn. At 0.8 the jerk is
0.093."""
_EASY: Final = 0.88
"""Share of its length between body and foothold from which on an arm stretches. At 0.44 all arms
are stretched, by 0.39 even in Idle."""
_CROWDED: Final = 0.7
"""The same below which it shortens …"""
_SHORTER: Final = 0.5
"""… by this share of the most stretch at most. With half of it Hurry has a jerk of 0.124 instead of
0.086."""
_NEARLY: Final = 0.97
_REST: Final = 0.025
"""Share of its length from which on an arm no longer reaches out all the way, and what is left.
Only an artist's own contacts are as far."""
_GENTLE: Final = 0.05
"""Strain over which stretching begins. At 0.025 bones of Settle stretch by 0.155 instead of 0.141,
at 0.1 Tiptoe has a jerk of 0.170 instead of 0.142."""
_GOING: Final = 0.12
"""Cycles within which an arm in the air comes to go along with its body. At 0.03 it leaves with a
start: arms slip by 0.0009 and come to be 0.001 below the ground."""
_SOFT: Final = 0.25
"""Share of the height that it needs within which a joint begins to be raised. At 0.5 Tiptoe has a
jerk of 0.183 instead of 0.142."""
_THIN: Final = 0.02
"""Arm lengths of its radius that count for that at most where it just lets go. An arm that is 0.05
thick dips by 0.003 into the ground then, and by 0.005 if all of it counts."""
_AT_ONCE: Final = 40.0
"""How much faster than its hold an arm loses its stiffness against the ground: so it does not pass
through it, as at 6, where it comes to be 0.005 below …"""
_LETTING_GO: Final = 3.0
"""… and how much faster it comes to keep its distance from it, where it has lain: without a jerk.
At 30 that is 0.243."""
_STARTING: Final = 10.0
"""Hold that it has lost, of the cube of the share of its way from the ground: the first coefficient
of ``least_jerk``."""
_ROLLED: Final = 0.6
"""Share of that way within which it may come to have rolled to any side: of a skin that is round
all sides are alike."""
_UNHELD: Final = 0.2
"""Share of its hold that an arm in the air has lost when all its movement is evened out: at 1, with
the middle of the swing, bones turn by 22° instead of 20° from frame to frame, with a jerk of
0.113."""
_EARLIER: Final = 0.2
"""Share of its way to the ground before its end from which on an arm unrolls. At 0.1 Crawl turns by
0.19 radians from frame to frame instead of 0.16."""
_PEELS_OFF: Final = 0.2
"""Share of the time that peeling takes in which it comes to its pace: at 0.5 Tiptoe turns by 26°
from frame to frame instead of 22°, at 0.1 an arm that goes to a reach by 31° instead of 23°."""
_DRAGGED_UP: Final = 0.03
"""Arm lengths that an arm which holds on is higher than it need be where it does not lie, so that
what its body drags on does not rest on the ground meanwhile. Without it what seems to rest drifts
by up to 0.055 arm lengths on ten ways of random turns, instead of 0.023 …"""
_DRAGGED_ALONG: Final = 0.15
"""… arm lengths beyond what lies over which it comes to be …"""
_DRAGGED_BY: Final = 0.15
"""… and arm lengths that a body goes meanwhile where all of it comes. In place nothing rises …"""
_DRAGGED_OVER: Final = 0.15
"""… nor on even ground, which an arm leaves by itself: radians between upwards where it lies and on
the whole from which on all of it comes. On any ground, arms of Walk on a slope touch at 13 % of the
moments instead of 5 %."""
_FROM_BELOW: Final = (0.05, 0.05)
"""Sine of the angle from which on an arm would run into the ground from below, and within which it
then comes along it instead. Without it arms of Settle are up to 0.0091 in winding stairs, at 7 % of
the moments by more than 0.005, instead of 0.003; if it began at 0, skin would slide by 0.0041 in a
hold on straight ones instead of 0.0027."""
_LEAVES_UPWARDS: Final = (0.008, 0.018)
"""Arm lengths that a joint is lifted at most while it leaves its place: as far as it goes aside;
after a short hold, and after a long one. Without it what peels off slowly slides on the ground,
arms of Settle by 0.007 on level ground instead of 0.0022. With 0.008 after long ones too, and the
next two numbers of short ones, by 0.0043 …"""
_LEAVES: Final = (5e-4, 1e-4)
"""… arm lengths aside within which that comes …"""
_LEAVES_NEAR: Final = (1.0, 0.25)
"""… and how loose a joint is taken to be at least: the nearer it is to what lies, the less it rises
of what it is to."""
_LONG_HOLD: Final = (0.6, 0.65)
"""Cycles from which on a hold is no short one, and a long one. If that were all from 0.3 on, arms
of Walk would drift by 0.0053 as they let go instead of 0.0046, and skin would slide by 0.0034 in a
hold of Tiptoe on steps instead of 0.0031."""
_LONG_BONES: Final = (0.085, 0.12)
"""Arm lengths up to which the longest bone that may lie is no long one, and from which on it is:
arms of such leave as after a long hold, …"""
_LEAVES_BY_BONES: Final = 0.04
"""… and are lifted by so much at most. Without it skin of arms of five bones is up to 0.018 in
level ground, at 62 % of the moments of a walk by more than 0.005."""
_TINY: Final = 1e-12


@dataclass(frozen=True, eq=False)
class Batch:
    """Arms at moments: frames × arms."""

    limbs: Limbs
    arms: np.ndarray
    """(batch,) place of each one's arm among the limbs."""
    roots: Floats
    """(3, batch) P₀, world."""
    outward: Floats
    """(3, batch) unit: straight out of the body, world."""
    upward: Floats
    """(3, batch) unit: the body's up, world."""
    lift: Floats
    """(batch,) metres that joints which do not lie are to be higher than they need be."""

    @cached_property
    def lengths(self) -> Floats:
        """(segments, batch) metres at rest."""
        return self.limbs.lengths[:, self.arms]

    @cached_property
    def reach(self) -> Floats:
        """(segments + 1, batch) metres along the arm to each joint, at rest."""
        return self.limbs.reach[:, self.arms]

    @cached_property
    def radii(self) -> Floats:
        """(segments + 1, batch) metres from each joint to the skin below it."""
        return self.limbs.radii[:, self.arms]


@dataclass(frozen=True, eq=False)
class Stance:
    """How a batch of arms holds on at its times."""

    weight: Floats
    """(batch,) 1 holds on, 0 free in the middle of a swing."""
    contact_from: Floats
    """(batch,) metres along the arm from which on it lies on the ground …"""
    contact_to: Floats
    """(batch,) … and up to which."""
    by_tip: np.ndarray
    """(batch,) whether it is the tip that the ground holds, or the joint that touches first."""
    joints: Floats
    """(segments + 1 − c, 3, batch) the joints as they lie, world."""
    carried: Floats
    """(3, batch) metres by which they have gone along with the body since, or still will."""
    goes: Floats
    """(batch,) metres that the arm's root goes while it holds on …"""
    lasts: Floats
    """(batch,) … and cycles for which it does."""
    normals: Floats
    """(segments + 1 − c, 3, batch) which way up the ground is there."""
    skins: Floats
    """(segments + 1 − c, batch) metres from each of these joints to the skin below it."""
    touching: int
    """c"""

    @property
    def place(self) -> Floats:
        """(3, batch) where the joint lies that the ground holds, world."""
        return np.where(self.by_tip, self.joints[-1], self.joints[0])

    def upwards(self, segments: int) -> Floats:
        """Which way is up for each segment (segments, 3, batch): what lies, lies on its ground."""
        lying = components_first.normalized(self.normals[1:] + self.normals[:-1])
        free = np.broadcast_to(self.normals[:1], (self.touching, *self.normals.shape[1:]))
        return np.concatenate([free, lying])[:segments]


@dataclass(frozen=True, eq=False)
class StancePose:
    """A batch of arms on the ground."""

    directions: Floats
    """(segments, 3, batch) unit, world."""
    strains: Floats
    """(segments, batch) by how much each is longer than at rest, as a share."""
    joints: Floats
    """(segments + 1, 3, batch) world."""
    misses: Floats
    """(batch,) metres between an arm that holds on and its foothold."""
    in_contact: np.ndarray
    """(segments + 1, batch) which joints rest on the ground and must not move."""


def stance_at(batch: Batch, footholds: Footholds, cycles: np.ndarray, since: Floats) -> Stance:
    """The footholds of a batch, and how far each is laid down or peeled off.

    Each one is in its cycle (batch,), and cycles (batch,) since the middle of the stance that the
    gait gives it.
    """
    roots = batch.roots
    at = batch.arms, cycles - footholds.first
    on, off = footholds.touch_down[at], footholds.lift_off[at]
    touching, whole = batch.reach[footholds.touching], batch.reach[-1]
    earlier = _EARLIER * (on + 0.5)
    down = smooth_step((since - on + earlier) / (UNROLLING * (off - on) + earlier))
    gone = even_pace((since - footholds.peeled()[at]) / (PEELING * (off - on)), _PEELS_OFF)
    landing = least_jerk((since + 0.5) / (on + 0.5))
    leaving = least_jerk((0.5 - since) / (0.5 - off))
    weight = np.where(since < on, landing, np.where(since > off, leaving, 1.0))
    joints = np.moveaxis(footholds.joints[at], 0, -1)
    # An arm in the air goes along with the body, and does so gently at first.
    before, after = np.maximum(on - since, 0.0), np.maximum(since - off, 0.0)
    starts, ends = footholds.roots_at_touch_down[at].T, footholds.roots_at_lift_off[at].T
    moved = roots - np.where(since < on, starts, ends)
    carried = moved * least_jerk((before + after) / _GOING)
    return Stance(
        weight=weight * footholds.present[at],
        contact_from=touching + gone * (footholds.peeled_to[at] - touching),
        contact_to=touching + down * (whole - touching),
        by_tip=since > footholds.middle[at],
        joints=np.ascontiguousarray(joints),
        carried=carried,
        goes=np.sqrt(dot(ends - starts, ends - starts)),
        lasts=off - on,
        normals=np.ascontiguousarray(np.moveaxis(footholds.normals[at], 0, -1)),
        skins=np.ascontiguousarray(footholds.skins[at].T),
        touching=footholds.touching,
    )


def pulling_to_footholds(
    batch: Batch,
    shapes: Floats,
    stance: Stance,
    ground: Ground,
    settings: StanceSettings,
    *,
    rough: bool = False,
) -> Generator[None, None, tuple[Floats, Floats]]:
    """Strains (segments, batch) and directions (segments, 3, batch) of arms, in steps.

    Arms with their gait's shapes (segments, 3, batch), world, brought to their footholds, or
    roughly so; in the air they may be in the ground.
    """
    steps = _ROUGH_STEPS if rough else _STEPS
    posing = _in_stance(batch, shapes, stance, ground, settings, steps=steps)
    strains, standing = yield from posing
    return strains, lerp_bends(batch.outward, standing, shapes, 1.0 - stance.weight)


def airborne(stance: Stance) -> Floats:
    """How far the movement of arms (batch,) is to be evened out over time: 0 while they hold on."""
    return np.minimum((1.0 - stance.weight) / _UNHELD, 1.0)


def kept_over_ground(
    batch: Batch,
    pose: tuple[Floats, Floats],
    stance: Stance,
    ground: Ground,
    lift: Floats,
) -> StancePose:
    """Arms that are in the air brought off the ground, by strains and directions as
    :func:`pulling_to_footholds` returns them, half way so many arm lengths (batch,) high.
    """
    (strains, directions), weight, reach = pose, stance.weight, batch.reach
    lengths = batch.lengths * (1.0 + strains)
    swinging = np.flatnonzero(weight < 1.0)
    if len(swinging):
        part, own = part_of(batch, swinging), part_of(stance, swinging)
        away = 1.0 - own.weight
        off_ground, at_once = smooth_step(_LETTING_GO * away), smooth_step(_AT_ONCE * away)
        free = _freedom(part, own)
        whole = part.reach[-1]
        # What has lain is as high as its skin is thick, and no higher yet.
        rising = (lift[swinging] * away**2 + MARGIN * off_ground) * whole + part.lift
        # In the air an arm may roll: any side of it may come to be below.
        rolled = smooth_step(np.cbrt(away / _STARTING) / _ROLLED)
        near = part.radii.copy()
        near[own.touching :] = own.skins + rolled * (near[own.touching :] - own.skins)
        near[own.touching :] += own.weight * _crested(own, ground)
        most = np.max(part.radii, axis=0) + rising
        loose = at_once * loose_from_root(part.reach, whole)
        thin = np.minimum(part.radii, _THIN * whole)
        soft = _SOFT * (thin + off_ground * (most - thin)) + _TINY
        directions = directions.copy()
        directions[..., swinging] = raise_over_ground(
            directions[..., swinging],
            lengths[:, swinging],
            JointRoom(near + rising - (1.0 - off_ground) * soft, loose, soft),
            free=free + (1.0 - free) * at_once,
            roots=part.roots,
            ground=ground,
            iterations=_RAISES,
        )
    joints = np.concatenate([batch.roots[None], lengths[:, None] * directions]).cumsum(axis=0)
    missed = np.where(stance.by_tip, joints[-1], joints[stance.touching]) - stance.place
    slack = 1e-9 * reach[-1]
    lying = (
        (reach >= stance.contact_from - slack)
        & (reach <= stance.contact_to + slack)
        & (weight >= 1.0)
    )
    return StancePose(
        directions, strains, joints, np.sqrt(dot(missed, missed)) * (weight >= 1.0), lying
    )


def _crested(stance: Stance, ground: Ground) -> Floats:
    """Metres (segments + 1 − c, batch) that joints lie higher than their skin is thick.

    Over a crest bones that are straight would cut into it: an arm that lays itself down there, or
    has just let go, stays above it as one that lies.
    """
    above = stance.joints[:, 2] - ground.height(np.moveaxis(stance.joints, 1, -1))
    return np.maximum(above - stance.skins, 0.0)


def _in_stance(
    batch: Batch,
    shapes: Floats,
    stance: Stance,
    ground: Ground,
    settings: StanceSettings,
    *,
    steps: tuple[int, ...],
) -> Generator[None, None, tuple[Floats, Floats]]:
    """Strains (segments, batch) and directions (segments, 3, batch) of arms that hold on, drawn to
    their footholds in rounds of so many of Newton's steps.

    Arms that do not, for the moment, are posed as they held on last, or will next; of those that
    never do it is the gait's shape.
    """
    strains, directions = np.zeros(shapes[:, 0].shape), shapes.copy()
    chosen = np.flatnonzero(stance.weight > 0.0)
    if len(chosen) == 0:
        return strains, directions
    batch, stance = part_of(batch, chosen), part_of(stance, chosen)
    shapes = shapes[..., chosen]
    strain, guess, chord = _asked(batch, stance, settings)
    strain = strain * _freedom(batch, stance)
    # Some of the gait stays, but for what lies or unrolls.
    kept = np.where(_kneed(batch, stance), 0.0, _KEPT)
    own = components_first.normalized(
        guess + (kept * _freedom(batch, stance))[:, None] * (shapes - guess)
    )
    bent_by = {"strain": strain, "chord": chord}
    own = yield from _drawn_to_foothold(batch, own, stance, ground, **bent_by, rounds=steps)
    if steps is not _ROUGH_STEPS:
        own = yield from _brought_out(batch, own, stance, ground, **bent_by)
    own = _laid_on_ground(batch, own, strain, stance, ground)
    strains[:, chosen], directions[..., chosen] = strain * stance.weight, own
    return strains, directions


def _drawn_to_foothold(
    batch: Batch,
    own: Floats,
    stance: Stance,
    ground: Ground,
    *,
    strain: Floats,
    chord: Floats,
    rounds: tuple[int, ...],
    share: Floats | float = 1.0,
) -> Generator[None, None, Floats]:
    """Directions (segments, 3, batch) of arms in stance, from their own, that meet their footholds.

    Strain (segments, batch) is by how much bones are longer than at rest, as a share; the chord (3,
    batch) leads from each one's root to where it meets the ground. By a ``share`` (batch,) of it
    they are raised off the ground and evened out on the way.
    """
    free, lengths = _freedom(batch, stance), batch.lengths * (1.0 + strain)
    # What is out of reach is pointed at: at full stretch no solver has a definite answer.
    stretched = stance.contact_from + np.sum(batch.lengths * strain, axis=0)
    ratio = np.sqrt(dot(chord, chord)) / stretched
    over = np.maximum(ratio - _NEARLY, 0.0)
    short = (over - _REST * np.tanh(over / _REST)) / np.maximum(ratio, _TINY)
    goal = stance.carried + stance.place - short * chord
    to_goal = _to_goal(batch, stance)
    needed = room_needed(batch.radii, batch.reach[-1], batch.lift)
    needed += _dragged_up(batch, stance) + _lifted_to_leave(batch, own, lengths, stance)
    soft = _SOFT * np.max(batch.radii, axis=0) + _TINY
    room = JointRoom(needed, share * _loose(batch, stance), soft)
    before = shares_before(batch.limbs.weights[:, 0])[:, None]
    for number, steps in enumerate(rounds):
        # The last time it only has to meet its goal.
        softer = evened(own, _EVENED * share * free, before) if number < len(rounds) - 1 else own
        own = raise_over_ground(
            softer,
            lengths,
            room,
            free=free,
            roots=batch.roots,
            ground=ground,
            iterations=_RAISES_BETWEEN,
        )
        own = drawn(
            own, lengths, free=free, chosen=to_goal, roots=batch.roots, goal=goal, steps=steps
        )
        yield
    return own


def _brought_out(
    batch: Batch, own: Floats, stance: Stance, ground: Ground, *, strain: Floats, chord: Floats
) -> Generator[None, None, Floats]:
    """The same, further out of the ground the deeper they are in it, where that is any help: as
    smooth as they come.
    """
    deep = _deepest(batch, own, strain, stance, ground)
    share = smooth_step((deep - _DEEP) / _DEEPENING)
    share *= 1.0 - smooth_step((deep - _IN_A_WALL) / _IN_A_WALL)
    # Where a body rests, or on level ground, what comes later brings them out, and this is help
    # at one frame and none at the next: arms of an artist's rig in Idle trembled by 10°.
    share *= _dragged(batch, stance)
    chosen = np.flatnonzero(share > 0.0)
    if len(chosen) == 0:
        return own
    part, posed = part_of(batch, chosen), part_of(stance, chosen)
    before, bent_by = own[..., chosen], {"strain": strain[:, chosen], "chord": chord[:, chosen]}
    after = yield from _drawn_to_foothold(
        part, before, posed, ground, **bent_by, rounds=_MORE_STEPS, share=share[chosen]
    )
    left = _deepest(part, after, bent_by["strain"], posed, ground) / deep[chosen]
    helps = smooth_step((_HELPS[0] - left) / (_HELPS[0] - _HELPS[1]))
    mixed = components_first.normalized(before + helps * (after - before))
    # Half way from one to the other they would miss.
    found = own.copy()
    found[..., chosen] = yield from _drawn_to_foothold(
        part, mixed, posed, ground, **bent_by, rounds=_STEPS[:1], share=0.0
    )
    return found


def _deepest(batch: Batch, own: Floats, strain: Floats, stance: Stance, ground: Ground) -> Floats:
    """Arm lengths (batch,) that joints are in the ground which may be raised."""
    lengths = batch.lengths * (1.0 + strain)
    joints = np.concatenate([batch.roots[None], lengths[:, None] * own]).cumsum(axis=0)
    deep = batch.radii + ground.height(np.moveaxis(joints, 1, -1)) - joints[:, 2]
    return np.max(deep * _loose(batch, stance), axis=0) / batch.reach[-1]


def _laid_on_ground(
    batch: Batch, own: Floats, strain: Floats, stance: Stance, ground: Ground
) -> Floats:
    """The same without what lies beyond the joint that is held in the ground.

    It can be raised without letting go; where it comes to lie it needs no raising, or it would
    stay up until the last moment and then drop.
    """
    beyond = smooth_step((batch.reach[1:] - stance.contact_to) / batch.lengths)
    skins = np.concatenate([batch.radii[: stance.touching], stance.skins])
    soft = _SOFT * skins + _TINY
    return raise_over_ground(
        own,
        batch.lengths * (1.0 + strain),
        JointRoom(skins - soft, _loose(batch, stance), soft),
        free=(1.0 - _to_goal(batch, stance)) * beyond,
        roots=batch.roots,
        ground=ground,
        iterations=_RAISES_BETWEEN,
    )


def _dragged_up(batch: Batch, stance: Stance) -> Floats:
    """Metres (segments + 1, batch) that joints rise which the body drags on, beyond what lies."""
    whole, beyond = batch.reach[-1], stance.contact_from - batch.reach
    along = smooth_step(beyond / (_DRAGGED_ALONG * whole))
    return _DRAGGED_UP * whole * _dragged(batch, stance) * along


def _lifted_to_leave(batch: Batch, own: Floats, lengths: Floats, stance: Stance) -> Floats:
    """Metres (segments + 1, batch) that joints rise which leave the place where they have lain."""
    whole, first = batch.reach[-1], stance.touching
    joints = np.concatenate([batch.roots[None], lengths[:, None] * own]).cumsum(axis=0)
    aside = joints[first:, :2] - stance.joints[:, :2] - stance.carried[:2]
    away = np.sqrt(dot(aside, aside)) / whole
    begins, ends = _LONG_HOLD
    long = smooth_step((stance.lasts - begins) / (ends - begins))
    begins, ends = _LONG_BONES
    longest = np.max(batch.lengths[first:], axis=0) / whole
    coarse = smooth_step((longest - begins) / (ends - begins))
    sooner = np.maximum(long, coarse)
    within, near = (short + sooner * (other - short) for short, other in (_LEAVES, _LEAVES_NEAR))
    short, other = _LEAVES_UPWARDS
    most = short + long * (other - short)
    most += coarse * (_LEAVES_BY_BONES - most)
    away *= away / (away + within)
    rising = np.zeros(batch.radii.shape)
    rising[first:] = stance.by_tip * whole * most * np.tanh(away / most)
    return rising / np.maximum(_loose_before(batch, stance), near)


def _dragged(batch: Batch, stance: Stance) -> Floats:
    """How far (batch,), 0…1, a body drags its arms over uneven ground while they hold on."""
    upward = components_first.normalized(np.sum(stance.normals, axis=0))
    uneven = np.arccos(np.clip(dot(stance.normals, upward).min(axis=0), -1.0, 1.0))
    goes = smooth_step(stance.goes / (_DRAGGED_BY * batch.reach[-1]))
    return goes * smooth_step(uneven / _DRAGGED_OVER)


def _to_goal(batch: Batch, stance: Stance) -> Floats:
    """1 for segments (segments, batch) before the joint that is held, else 0."""
    before = np.arange(len(batch.lengths))[:, None] < stance.touching
    return (before | stance.by_tip).astype(np.float64)


def _kneed(batch: Batch, stance: Stance) -> np.ndarray:
    """Which arms (batch,) have one joint that counts before they touch."""
    free = batch.limbs.lengths[: stance.touching]
    alone = np.sum(free, axis=0) ** 2 < _KNEE * np.sum(free * free, axis=0)
    return alone[batch.arms] & (stance.touching > 1)


def _knee(batch: Batch, stance: Stance, chord: Floats, longer: Floats) -> Floats:
    """Directions (segments, 3, batch) of arms with a single knee, as two sides of a triangle.

    It stands over the way to the ground, up and out: whichever way the body goes, its plane turns
    no faster than that way does. The chord (3, batch) is the way from each one's root to where it
    meets the ground; each is longer (batch,) than at rest by a factor.
    """
    reach = batch.reach
    inner = reach[1 : stance.touching]
    knee = 1 + np.argmin(np.abs(inner - 0.5 * reach[stance.touching]), axis=0)
    upper = longer * np.take_along_axis(reach, knee[None], axis=0)[0]
    lower = longer * stance.contact_from - upper
    away = np.maximum(np.sqrt(dot(chord, chord)), _TINY)
    along = chord / away
    side = batch.outward + batch.upward
    side = components_first.normalized(side - dot(side, along) * along)
    cosine = (upper * upper + away * away - lower * lower) / (2.0 * upper * away)
    cosine = np.clip(cosine, -_STRAIGHT, _STRAIGHT)
    thigh = cosine * along + np.sqrt(1.0 - cosine * cosine) * side
    shin = components_first.normalized(chord - upper * thigh)
    before = np.arange(len(batch.lengths))[:, None, None] < knee
    return np.where(before, thigh, shin)


def _freedom(batch: Batch, stance: Stance) -> Floats:
    """How far each segment (segments, batch) is free to turn: 0 where it lies on the ground."""
    return smooth_step((stance.contact_from - batch.reach[:-1]) / (_BORDER * batch.lengths))


def _loose(batch: Batch, stance: Stance) -> Floats:
    """How far each joint (segments + 1, batch) may be raised: 0 where it lies, and at the root."""
    reach, width = batch.reach, batch.reach[1]
    before = _loose_before(batch, stance)
    after = smooth_step((reach - stance.contact_to) / width)
    return np.maximum(before, np.where(stance.by_tip, 0.0, after)) * loose_from_root(
        reach, reach[-1]
    )


def _loose_before(batch: Batch, stance: Stance) -> Floats:
    """The same of those before what lies, were there no root."""
    return smooth_step((stance.contact_from - batch.reach) / batch.reach[1])


def _asked(batch: Batch, stance: Stance, settings: StanceSettings) -> tuple[Floats, Floats, Floats]:
    """Strains (1, batch) and directions (segments, 3, batch) of arms that hold on.

    And the way (3, batch) from each one's root to where it meets the ground.
    """
    first = stance.touching
    lying = np.diff(stance.joints, axis=0)
    lying /= batch.lengths[first:, None]
    place, arriving = _met(batch, stance, lying)
    chord = place - batch.roots
    ratio = np.sqrt(dot(chord, chord)) / stance.contact_from
    strain = np.zeros((1, ratio.shape[-1]))
    if batch.limbs.may_stretch and settings.stretch > 0.0:
        strain[0] = _strained(ratio, settings.stretch)
    directions = _arch(batch, stance, chord, arriving, strain[0])
    if np.any(kneed := _kneed(batch, stance)):
        directions = np.where(kneed, _knee(batch, stance, chord, 1.0 + strain[0]), directions)
    through = np.clip(
        (stance.contact_from - batch.reach[first:-1]) / batch.lengths[first:], 0.0, 1.0
    )
    directions[first:] = through[:, None] * directions[first:] + (1.0 - through[:, None]) * lying
    rolled = _rolled(batch, stance, lying, directions[first - 1])
    directions[first:] = np.where(stance.by_tip, directions[first:], rolled)
    return strain, components_first.normalized(directions), chord


def _met(batch: Batch, stance: Stance, lying: Floats) -> tuple[Floats, Floats]:
    """Where arms meet the ground, and which way they run into it, (3, batch) both, from unit
    vectors (segments − c, 3, batch) along the segments that lie.
    """
    lengths, reach, first, last = batch.lengths, batch.reach, stance.touching, len(lying) - 1
    # Directions at the joints that lie.
    at_joints = np.concatenate([lying[:1], 0.5 * (lying[1:] + lying[:-1]), lying[-1:]])
    place = stance.carried.copy()
    arriving, upward = np.zeros_like(batch.roots), np.zeros_like(batch.roots)
    for number in range(len(lying)):
        low, high = reach[first + number], reach[first + number + 1]
        share = np.clip((stance.contact_from - low) / (high - low), 0.0, 1.0)
        inside = (stance.contact_from >= low) & ((stance.contact_from < high) | (number == last))
        place += inside * (stance.joints[number] + share * lying[number] * lengths[first + number])
        arriving += inside * (
            at_joints[number] + share * (at_joints[number + 1] - at_joints[number])
        )
        # Of the ground a segment before, which it comes over.
        before, after = stance.normals[max(number - 1, 0)], stance.normals[number]
        upward += inside * (before + share * (after - before))
    return place, _from_above(
        components_first.normalized(arriving), components_first.normalized(upward)
    )


def _from_above(arriving: Floats, upward: Floats) -> Floats:
    """Ways (3, batch), unit, in which arms run into the ground, not from below it where it bends
    upwards there, as at the foot of a step. Up from it is (3, batch), unit.
    """
    begins, within = _FROM_BELOW
    rises = np.maximum(dot(arriving, upward) - begins, 0.0)
    return components_first.normalized(arriving - rises * rises / (rises + within) * upward)


def _strained(ratio: Floats, stretch: float) -> Floats:
    """Strains (batch,) of arms that may stretch by a share at most, and shorten where they are
    crowded.

    The ratio (batch,) is of the way from body to ground to the length of arm between the two.
    """
    taut = np.maximum(ratio / _EASY - 1.0, 0.0)
    taut = taut * taut / (taut + _GENTLE)
    slack = np.maximum(1.0 - ratio / _CROWDED, 0.0)
    slack = slack * slack / (slack + _GENTLE)
    shortest = _SHORTER * stretch
    return stretch * np.tanh(taut / stretch) - shortest * np.tanh(slack / shortest)


def _arch(batch: Batch, stance: Stance, chord: Floats, arriving: Floats, strain: Floats) -> Floats:
    """Directions (segments, 3, batch) of arms that are one curve from the body to the ground.

    A cubic that leaves and arrives as the arm does, and is as long. The slacker the arm, the more
    it rises. Its chord (3, batch) leads from the root to where it meets the ground, which it runs
    into by a unit vector (3, batch), longer than at rest by a share (batch,).
    """
    lengths, reach = batch.lengths, batch.reach
    ratio = np.sqrt(dot(chord, chord)) / stance.contact_from
    slack = smooth_step((_EASY - ratio) / _ARCHING)
    rising = _RAISED + _ARCHED * slack
    # Slack, it comes down rather than back from under the body.
    falling = _FALLING * slack
    arriving = components_first.normalized((1.0 - falling) * arriving - falling * batch.upward)
    leaving = np.cos(rising) * batch.outward + np.sin(rising) * batch.upward
    leaving, arriving = spread_chain(
        (leaving, arriving), chord, batch.upward, ratio / (1.0 + strain)
    )
    size = stance.contact_from * (1.0 + strain)
    parts = np.clip(stance.contact_from - reach[:-1], 0.0, lengths)
    # How far along, is counted in how readily the joints bend.
    bendable = batch.limbs.weights * lengths
    middles = np.cumsum(bendable, axis=0) - 0.5 * bendable
    middles /= np.sum(batch.limbs.weights * parts, axis=0)
    middles = np.clip(middles, 0.0, 1.0)[:, None]
    tight = ratio / (1.0 + strain)
    over = 0.5 * (tight - _BUNCHED)
    least = _BUNCHED + over + np.sqrt(over * over + _BUNCHING**2)
    directions = curve(
        leaving=leaving,
        arriving=arriving,
        chord=chord,
        size=size * tight / least,
        middles=middles,
        parts=parts,
    )
    return bent(directions, parts, chord, tight / least)


def _rolled(batch: Batch, stance: Stance, lying: Floats, before: Floats) -> Floats:
    """Directions (segments − c, 3, batch) of what is not unrolled yet: it stands up.

    It will lie along others of that shape, and comes after a segment with a direction (3, batch).
    """
    first, reach = stance.touching, batch.reach
    span = reach[-1] - reach[first]
    # The more, the further out.
    beyond = np.maximum(reach[first + 1 :] - stance.contact_to, 0.0) / span
    angle = _CURLED * beyond * np.sqrt(beyond)
    # It folds back no further than what comes before it leaves room for.
    bend = np.arccos(np.clip(dot(before, lying[0]), -1.0, 1.0))
    room = np.maximum(_FOLDED - bend, _TINY) / np.maximum(angle[0], _TINY)
    angle = (angle * room * np.tanh(1.0 / room))[:, None]
    up = np.zeros_like(lying)
    up[:, 2] = 1.0
    up = components_first.normalized(up - dot(up, lying)[:, None] * lying)
    return np.cos(angle) * lying + np.sin(angle) * up
