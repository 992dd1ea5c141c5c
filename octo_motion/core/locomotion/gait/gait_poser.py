# SPDX-License-Identifier: GPL-3.0-or-later
"""From a gait to bone rotations: what moves the arms of one body.

A frame's result depends on that frame's phase and turn alone, never on other frames. Everything
is solved in each arm's own frame, x outward and z up as the body has them, with the length of the
arm for unit; so neither rest pose nor bone roll nor scale of the rig matters.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Final

import numpy as np

from ...content_cache import ContentCache, content_key
from ...errors import RigError, SettingsError
from ...phrases import phrase
from ...rotations import (
    Floats,
    components_first,
    from_axis_angle,
    from_matrix,
    less_whole_turns,
    multiply,
    rotate,
)
from ...rotations.components_first import cumulative_sum
from ...settings import check_settings, setting, share_setting
from ...skeleton import Skeleton
from ...steps import finished
from ..rig import (
    ArmRest,
    BodyFrame,
    Side,
    arm_azimuths,
    arm_rest,
    chain_of,
    joint_positions,
    rotate_bones,
    smooth_floor,
)
from .ccd import (
    BANK,
    FLOOR_ROUNDING,
    GROUPS,
    HEAD,
    PITCH,
    JointChain,
    asked_shape,
    contraction,
    group_lengths,
    link_rotations,
    overreach,
    pseudo_targets,
    solving_ccd,
    weighted_groups,
)
from .swim_spread import swim_azimuths, trailing_asides, trailing_beside
from .table import GaitCurve, GaitTable, gait_angles
from .variation import unevenness, variation


@dataclass(frozen=True, eq=False)
class Build:
    """Arms whose segments have the same proportions, solved together."""

    arms: tuple[int, ...]
    chain: JointChain
    widths: Floats
    """(links,) rest lengths H_g, in arm lengths."""


def builds_of(
    segments: Sequence[Floats], weights: Sequence[tuple[float, ...]], *, on_ground: bool
) -> tuple[Build, ...]:
    """Arms by how they are built, of segments (bones,) as long, in any unit.

    Each arm's weights are of its joints, at even steps from its root to its tip [Octopus, eq. 3.7].
    """
    shares = [lengths / float(lengths.sum()) for lengths in segments]
    same: dict[tuple[tuple[float, ...], ...], list[int]] = {}
    for arm, own in enumerate(shares):
        # Bones' lengths are single precision.
        same.setdefault((tuple(np.round(own, 6).tolist()), weights[arm]), []).append(arm)
    builds = []
    for (_, given), arms in same.items():
        own = shares[arms[0]]
        sampled = np.interp(np.cumsum(own) - own, np.linspace(0.0, 1.0, len(given)), given)
        sizes = weighted_groups(own, sampled)
        chain = JointChain(own, sizes, sampled, pairs_as_asked=not on_ground)
        builds.append(Build(tuple(arms), chain, group_lengths(own, sizes)))
    return tuple(builds)


def bone_twists(build: Build, angles: Floats) -> Floats:
    """Radians (segments, frames, arms) by which each bone is twisted against the one before.

    Of the angles (frames, arms, links, 3), bank is spread evenly over its group.
    """
    sizes = build.chain.sizes
    shares = np.moveaxis(angles[..., BANK], -1, 0) / np.array(sizes)[:, None, None]
    return np.repeat(shares, sizes, axis=0)


_UP: Final = np.array([0.0, 0.0, 1.0])
_SIDEWAYS: Final = np.array([1.0, 0.0, 0.0])
_CHUNK: Final = 8192
"""Arms solved at a time, counted over frames: what stays within a processor's cache."""
_FEW: Final = 100
"""Shapes that are kept: of a few arms at a few frames, which cost as much to start as many."""
_CYCLE_SAMPLES: Final = 96
"""Phases at which a cycle is looked at as a whole …"""
_ROUGH_SAMPLES: Final = 24
"""… and of what is to be soon known."""
_RESTING: Final = 0.5
"""Share of what arms differ by in the water that is left where they rest on the ground in place:
what lies there is not to creep."""
_STANDING: Final = 0.3
"""Share of a cycle in which an arm would reach deeper than the floor."""
_LEAST_DEPTH: Final = 0.1
"""Arm lengths: a gait that reaches less deep moves its arms level, and stands on nothing."""


@dataclass(frozen=True)
class Arm:
    """One arm as the generator is given it."""

    name: str
    bones: tuple[str, ...]
    """Root to tip, at least three."""
    side: Side
    pair: int
    phase: float = 0.0
    """Radians that it is ahead of what the gait says."""
    flip: bool = False
    """Whether "towards the front" and the sense of bank are mirrored."""
    weights: tuple[float, ...] = ()
    """Of its own joints, in place of ``GaitSettings.weights``; none for those."""

    @property
    def handedness(self) -> float:
        """+1 where "towards the front" is anticlockwise seen from above (right side), else −1."""
        return (-1.0 if self.side == "LEFT" else 1.0) * (-1.0 if self.flip else 1.0)


@dataclass(frozen=True, eq=False)
class GaitSettings:
    """How the arms move. Angles in radians."""

    gait: GaitTable
    contraction: float = setting(
        "Contraction",
        "How much an arm shortens as it bends: 1 as an octopus does, 0 not at all",
        default=1.0,
        low=0.0,
        high=4.0,
        soft_high=1.0,
        step=5,
    )
    weights: tuple[float, ...] = (0.4,)
    """Weights a of the joints, at even steps from the arm's root to its tip, each in (0, 1]."""
    softness: float = share_setting(
        "Softness",
        "How far a bend spreads over neighbouring joints: 0 leaves it where it falls",
        default=0.8,
    )
    """0 leaves bends where CCD puts them."""
    stretch_slack: float = share_setting(
        "Give",
        "How far an arm may reach beyond its targets as it straightens, in lengths of a third of "
        "it: it straightens gently. 0 meets them exactly, and snaps straight",
        default=0.0,
        offered=0.08,
        stored_as="give",
        soft_high=0.3,
    )
    lateral_bend: float = setting(
        "Sway",
        "Bend across the gait's own that keeps an arm from becoming a straight line",
        default=np.radians(10.0),
        stored_as="sway",
        low=0.0,
        high=0.5 * np.pi,
        soft_high=np.radians(45.0),
        step=100,
        precision=1,
        subtype="ANGLE",
    )
    """Each group of joints starts with it."""
    phase_spread: float = setting(
        "Phase Spread",
        "How far the arms are apart in the cycle: 1 as the gait says, 0 all together",
        default=1.0,
        soft_low=0.0,
        soft_high=2.0,
        step=5,
    )
    uneven: float = setting(
        "Uneven",
        "Swimming and in place: how much arms and cycles differ, in when they begin "
        "and how far they reach and curl. 1 is natural, 0 all alike",
        default=0.0,
        offered=1.0,
        low=0.0,
        high=2.0,
        step=10,
        precision=2,
        subtype="FACTOR",
    )
    """Steps over the ground differ by where their footholds are."""
    variation: tuple[float, float] = (0.0, 0.0)
    """Limits j, k of the random additions to head and pitch [Octopus, §3.4]."""
    seed: int = setting(
        "Seed",
        "Another number gives another variation, the same number the same one",
        default=0,
        low=0,
    )
    period: int = 0
    """Cycles after which the random additions come again, 0 for never."""
    turning: float = setting(
        "Turning",
        "Share of the turn that lies ahead which the arms take on",
        default=0.5,
        low=0.0,
        high=4.0,
        soft_high=1.0,
        step=5,
    )
    """As pitch [Octopus, §3.5]."""
    smoothing_cycles: float = setting(
        "Steady",
        "How much of a cycle movement is evened out over, before and after each moment: arms in "
        "the air move smoothly. 0 keeps every corner of the gait's table",
        default=0.0,
        offered=0.08,
        stored_as="steady",
        low=0.0,
        high=0.25,  # over more than that, the movement is no longer there
        soft_high=0.15,
        step=1,
        precision=3,
    )
    heading: float = 0.0
    """WALK: radians anticlockwise from the way that the body goes to its front: arms take their
    phases from the gait by where they are seen from that way."""
    raise_to_floor: bool = setting(
        "Stand",
        "Walking, arms that would reach deeper than most lie down at their depth, so that several "
        "stand on the ground together. Off, the gait's angles alone count, and the creature hangs "
        "on the tip of its deepest arm",
        default=False,
        offered=True,
        stored_as="stand",
    )
    """Targets that lie deeper than most are raised to a floor where most are. The source's walk,
    whose targets are the table's alone, knows no ground."""
    swim_lean: float = 0.0
    """SWIM: how far from the body's +Z towards its back the way lies that its arms trail behind;
    see ``TravelSettings``. Radians."""

    def __post_init__(self) -> None:
        check_settings(self)
        _check_weights(self.weights)
        if self.variation[0] > self.variation[1]:
            raise SettingsError(
                "The variation's minimum is greater than its maximum.", "Exchange the two."
            )


@dataclass(frozen=True, eq=False)
class ArmPoses:
    """Arms at some frames."""

    rotations: Floats
    """(frames, bones, 4) unit quaternions in each bone's rest frame (Blender's matrix_basis)."""
    misses: Floats
    """(frames, arms, groups) distance of each group's end from its target, in arm lengths, less
    what the setting ``stretch_slack`` lets it and those before it reach beyond."""


@dataclass(frozen=True, eq=False)
class _Built:
    """What arms are like in any gait."""

    segments: list[Floats]
    """Of each arm (bones,), armature units."""
    lengths: Floats
    """(arms,)"""
    roots: Floats
    """(arms, 3) P₀ in the body's frame, armature units."""
    azimuths: Floats
    """(arms,) where each one leads to, seen from the way that it goes."""
    rests: list[ArmRest]


def _built(skeleton: Skeleton, arms: tuple[Arm, ...], body: BodyFrame, lean: float) -> _Built:
    """It, as it was found before while a gait alone has changed.

    Raises:
        RigError: arms share bones, or a bone does not exist.
    """

    def find() -> _Built:
        _check_disjoint(arms)
        for arm in arms:
            chain_of(skeleton, arm.bones)
        joints = [body.to_body(joint_positions(skeleton, arm.bones)) for arm in arms]
        segments = [np.linalg.norm(np.diff(each, axis=0), axis=1) for each in joints]
        around = partial(swim_azimuths, lean=lean) if lean else arm_azimuths
        return _Built(
            segments,
            np.array([float(each.sum()) for each in segments]),
            np.array([each[0] for each in joints]),
            around(skeleton, [arm.bones for arm in arms], body),
            [arm_rest(skeleton, arm.bones) for arm in arms],
        )

    return _known.get(content_key(skeleton, [arm.bones for arm in arms], body, lean), find)


_known: Final[ContentCache[_Built]] = ContentCache(2)


_Cycle = tuple[Floats, dict[int, Floats]]
"""Heights (phases, arms) over the body's centre of each arm's lowest joint, and the shape
(segments, 3) of each arm half way through its stance."""


class GaitPoser:
    """Moves the arms of one body.

    Raises:
        RigError: there are no arms, arms share bones, or a bone does not exist.
        SettingsError: a weight of an arm's own is not between 0 and 1.
    """

    arms: Final[tuple[Arm, ...]]
    """The arms as they were given."""
    builds: Final[tuple[Build, ...]]
    """The arms, by how they are built."""
    settings: Final[GaitSettings]
    """How the arms move."""
    offsets: Final[Floats]
    """(arms,) radians that each arm's phase is ahead of the body's."""
    roots: Final[Floats]
    """(arms, 3) P₀ in the body's frame, armature units."""
    lengths: Final[Floats]
    """(arms,) armature units."""
    outward: Final[Floats]
    """(arms, 4) from an arm's own frame, x outward and z up, to the body's."""
    rests: Final[tuple[ArmRest, ...]]
    """Each arm at rest."""
    rough = False
    """Whether arms that hold the ground are soon found, and may be a little off."""

    def __init__(
        self, skeleton: Skeleton, arms: Sequence[Arm], body: BodyFrame, settings: GaitSettings
    ) -> None:
        if not arms:
            raise RigError("The list of arms is empty.", "Detect the arms, or add one.")
        self.arms = tuple(arms)
        gait = settings.gait.for_pairs(max(arm.pair for arm in self.arms))
        settings = replace(settings, gait=gait)
        self.settings = settings
        lean = 0.0 if gait.on_ground else settings.swim_lean
        built = _built(skeleton, self.arms, body, lean)
        segments, self.lengths, self.roots = built.segments, built.lengths, built.roots
        # From an arm's own frame to the body's: azimuth counts from the front, −Y.
        azimuths = built.azimuths
        # The same to a body whose +Z is the way that it swims along.
        self._round = from_axis_angle(_UP, azimuths - 0.5 * np.pi)
        self.outward = self._round
        if lean:
            self.outward = multiply(from_axis_angle(_SIDEWAYS, -lean), self._round)
        # From an arm's own frame to armature space.
        self._to_armature = multiply(from_matrix(body.rotation), self.outward)
        self.rests = tuple(
            replace(rest, outward=outward)
            for rest, outward in zip(built.rests, self.opens_to, strict=True)
        )
        self._hands = np.array([arm.handedness for arm in self.arms])
        self._pairs = tuple(arm.pair for arm in self.arms)
        spread = [gait.offset(arm.side, arm.pair, max(self._pairs)) for arm in self.arms]
        if gait.on_ground and settings.heading != 0.0:
            spread = [spread[other] for other in _instead(azimuths, settings.heading)]
        self.offsets = settings.phase_spread * np.array(spread) + [arm.phase for arm in arms]
        sway = np.array([_across(gait.curve(pair)) for pair in self._pairs])
        sway[:, PITCH] *= self._hands
        self._sway = settings.lateral_bend * sway
        weights = [arm.weights or settings.weights for arm in self.arms]
        for each in weights:
            _check_weights(each)
        self.builds = builds_of(segments, weights, on_ground=gait.on_ground)
        self._few: ContentCache[tuple[Floats, Floats]] = ContentCache()

    def preparing(self) -> Generator[None, None, None]:
        """Look at its whole cycle in steps; else that is done once it is asked for."""
        if self._asks_for_a_floor and "_bare" not in self.__dict__:
            self.__dict__["_bare"] = yield from self._going_round(-np.inf)
        if "_cycle" not in self.__dict__:
            self.__dict__["_cycle"] = yield from self._going_round(self._floor)

    @property
    def bones(self) -> tuple[str, ...]:
        """Names of the bones that are turned, in the order of ``ArmPoses.rotations``."""
        return tuple(bone for arm in self.arms for bone in arm.bones)

    @property
    def arm_length(self) -> float:
        """Mean length of the arms, in the armature's units: what strides are counted in."""
        return float(self.lengths.mean())

    @cached_property
    def clearance(self) -> float:
        """Height of the body's centre over the lowest joint of a whole cycle, armature units.

        It is the gait's own, whatever variation and turning add: the same for every shot.
        """
        return -float(self._cycle[0].min())

    @property
    def _asks_for_a_floor(self) -> bool:
        return self.settings.raise_to_floor and self.settings.gait.on_ground

    @cached_property
    def _floor(self) -> float:
        """Height over the body's centre that pseudo-targets are raised to; −∞ for none."""
        if not self._asks_for_a_floor:
            return -np.inf
        floor = float(np.quantile(self._bare[0], _STANDING))
        return floor if floor < -_LEAST_DEPTH * self.arm_length else -np.inf

    @cached_property
    def _bare(self) -> _Cycle:
        """The whole cycle of arms that know no floor."""
        return finished(self._going_round(-np.inf))

    @cached_property
    def _cycle(self) -> _Cycle:
        """The whole cycle."""
        return finished(self._going_round(self._floor))

    def _going_round(self, floor: float) -> Generator[None, None, _Cycle]:
        """The whole cycle over a floor, in steps.

        At phases of the arms' own: arms that are built alike and have one curve go through the
        same heights, whichever side they are on, so one of them is looked at.
        """
        gait = self.settings.gait
        samples = _ROUGH_SAMPLES if self.rough else _CYCLE_SAMPLES
        phases = np.linspace(0.0, 2.0 * np.pi, samples, endpoint=False)
        phases = np.append(phases, gait.power_phase)
        heights = self.roots[:, 2] / self.lengths
        depths = np.empty((samples, len(self.arms)))
        middles: dict[int, Floats] = {}
        for build in self.builds:
            same: dict[tuple[int, float], list[int]] = {}
            for arm in build.arms:
                curve = self._pairs[arm] if self._pairs[arm] in gait.curves else 0
                same.setdefault((curve, round(float(heights[arm]), 6)), []).append(arm)
            chosen = [arms[0] for arms in same.values()]
            part = Build(tuple(chosen), build.chain, build.widths)
            own = np.repeat(phases[:, None], len(chosen), axis=1)
            pairs = tuple(self._pairs[arm] for arm in chosen)
            angles = gait_angles(gait, own, pairs, smoothing_cycles=self.settings.smoothing_cycles)
            angles[..., [PITCH, BANK]] *= self._hands[chosen][:, None, None]
            # Not from what is kept: that does not know the floor.
            steering = np.zeros((1, len(chosen)))
            asked = _chains_over(self, floor, part, angles, steering)
            shaping = self.shaping(part, angles, steering, asked, rough=self.rough)
            directions = yield from _last(shaping)
            # Up is the same for the arm's frame and the body's.
            climbs = cumulative_sum(build.chain.lengths[:, None, None] * directions[:, 2])
            lowest = np.minimum(climbs.min(axis=0), 0.0)
            for place, arms in enumerate(same.values()):
                low = lowest[:samples, place, None]
                depths[:, arms] = self.roots[arms, 2] + self.lengths[arms] * low
                for arm in arms:
                    middles[arm] = directions[:, :, -1, place].copy()
                    # The other side is its mirror image.
                    middles[arm][:, 1] *= self._hands[arm] * self._hands[arms[0]]
        return depths, middles

    def middle_shapes(self, arms: Sequence[int]) -> Floats:
        """Directions (segments, 3, arms) half way through the stance, of arms that are built alike.

        In the arms' frames, as the gait alone has them.
        """
        return np.stack([self._cycle[1][arm] for arm in arms], axis=-1)

    def arm_phases(self, phase: Floats) -> Floats:
        """Each arm's own phase (frames, arms) at the body's phases (frames,)."""
        return phase[:, None] + self.offsets

    def pose(self, phase: Floats, turn: Floats) -> ArmPoses:
        """The arms at phases (frames,) of the body's gait, radians.

        The turn (frames, 2) lies ahead, in the body's XY plane (``Travel.turn``).
        """
        phases = self.arm_phases(np.asarray(phase, dtype=np.float64))
        angles, steering = self.asked(phases, turn)
        step = max(1, _CHUNK // len(self.arms))
        parts = [
            self._pose(angles[start : start + step], steering[start : start + step])
            for start in range(0, len(angles), step)
        ]
        if not parts:
            parts = [self._pose(angles, steering)]
        return ArmPoses(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))

    def asked(
        self, phases: Floats, turn: Floats, cycle_period: Sequence[int] | None = None
    ) -> tuple[Floats, Floats]:
        """What the gait asks of the arms at their own phases (frames, arms), radians; ``turn`` is
        as of :meth:`pose`. Random additions come again after each arm's cycles, if that is not the
        same for all.

        Angles (frames, arms, links, 3), turns anticlockwise for every arm, and by how much the arms
        steer (frames, arms), radians.
        """
        settings, gait = self.settings, self.settings.gait
        steady, period = settings.smoothing_cycles, cycle_period or settings.period
        uneven = settings.uneven * (_RESTING * bool(settings.period) if gait.on_ground else 1.0)
        angles: Floats | float = 0.0
        if uneven:
            phases, angles = unevenness(phases, uneven, settings.seed, cycle_period=period)
        angles = angles + gait_angles(gait, phases, self._pairs, smoothing_cycles=steady)
        if any(settings.variation):
            angles = angles + variation(
                *(gait, phases, self._pairs, settings.variation, settings.seed),
                cycle_period=period,
                smoothing_cycles=steady,
            )
        if not gait.on_ground:
            angles = trailing_beside(angles, self._asides)
        # Towards the goal: by the part of the turn that lies across the arm.
        across = rotate(self._round, np.array([0.0, 1.0, 0.0]))[:, :2]
        steering = settings.turning * np.asarray(turn, dtype=np.float64) @ across.T
        # Turns anticlockwise for every arm.
        angles[..., [PITCH, BANK]] *= self._hands[:, None, None]
        return angles, steering

    @cached_property
    def _asides(self) -> Floats:
        """By how far the first link of each arm (arms,) has to point beside the way, radians."""
        out = rotate(self.outward, _SIDEWAYS)
        roots = np.sum(self.roots * out, axis=-1) / self.lengths
        firsts = {arm: build.widths[0] for build in self.builds for arm in build.arms}
        return trailing_asides(roots, np.array([firsts[arm] for arm in range(len(roots))]))

    @property
    def opens_to(self) -> Floats:
        """(arms, 3) unit: where each arm leads out of the body, armature space."""
        return rotate(self._to_armature, _SIDEWAYS)

    def _pose(self, angles: Floats, steering: Floats) -> tuple[Floats, Floats]:
        """Rotations and misses from angles (frames, arms, links, 3) and steering (frames, arms)."""
        frames = len(angles)
        ends = np.cumsum([0] + [len(arm.bones) for arm in self.arms])
        rotations = np.empty((frames, ends[-1], 4))
        misses = np.empty((frames, len(self.arms), GROUPS))
        for build in self.builds:
            columns = list(build.arms)
            own = angles[:, columns]
            directions, misses[:, columns] = self.shapes(build, own, steering[:, columns])
            count, size = len(directions), frames * len(columns)
            to_armature = np.tile(self._to_armature[columns].T, (1, frames))
            in_armature = components_first.rotate(to_armature, directions.reshape(count, 3, size))
            posed = rotate_bones(
                [self.rests[arm] for arm in columns],
                in_armature.reshape(directions.shape),
                bone_twists(build, own),
            )
            for place, arm in enumerate(columns):
                rotations[:, ends[arm] : ends[arm + 1]] = posed[:, place]
        return rotations, misses

    def shapes(self, build: Build, angles: Floats, steering: Floats) -> tuple[Floats, Floats]:
        """Directions (segments, 3, frames, arms) in the arms' frames; misses (frames, arms, 3).

        Angles (frames, arms, links, 3) and steering (frames, arms) of this build are from
        :meth:`asked`.
        """
        if angles.shape[0] * angles.shape[1] > _FEW:
            return self._shapes(build, angles, steering)
        # What is asked again and again, about a gait as such.
        key = content_key(build.arms, angles, steering)
        return self._few.get(key, lambda: self._shapes(build, angles, steering))

    def shaping(
        self,
        build: Build,
        angles: Floats,
        steering: Floats,
        asked: tuple[Floats, Floats, Floats | None],
        *,
        rough: bool = False,
    ) -> Iterator[Floats]:
        """Directions as of :meth:`shapes`, or roughly so, as far as they are found after each of
        some steps; the last ones are the answer. What is asked is from :meth:`chains`.
        """
        steered = angles[..., [HEAD, PITCH]]
        steered[..., 0, 1] += steering
        sway = self._sway[list(build.arms)]
        for directions in _solving(build, self.settings, sway, steered, asked, rough=rough):
            yield directions.reshape(len(directions), 3, *angles.shape[:2])

    def chains(
        self, build: Build, angles: Floats, steering: Floats
    ) -> tuple[Floats, Floats, Floats | None]:
        """Links (frames, arms, links, 4) and pseudo-targets Q₀ … Q₃ (frames, arms, links + 1, 3) of
        a build's arms, from :meth:`asked`, in their frames and lengths; heights (arms,) of the
        floor that targets are raised to, none where there is none.
        """
        return _chains_over(self, self._floor, build, angles, steering)

    def _shapes(self, build: Build, angles: Floats, steering: Floats) -> tuple[Floats, Floats]:
        asked = self.chains(build, angles, steering)
        (directions,) = deque(self.shaping(build, angles, steering, asked), maxlen=1)
        frames, arms = angles.shape[:2]
        joints = directions.reshape(len(directions), 3, frames * arms)
        joints = cumulative_sum(build.chain.lengths[:, None, None] * joints)
        ends = joints[np.cumsum(build.chain.sizes) - 1]
        missed = _missed(build, ends, _batch_last(asked[1], frames * arms), self.settings)
        return directions, np.moveaxis(missed.reshape(GROUPS, frames, arms), 0, -1)


def _chains_over(
    poser: GaitPoser, level: float, build: Build, angles: Floats, steering: Floats
) -> tuple[Floats, Floats, Floats | None]:
    """What :meth:`GaitPoser.chains` says, over a floor at this height over the body's centre."""
    width = build.widths * (1.0 + contraction(angles, poser.settings.contraction)) ** (
        # A group of a single bone cannot shorten.
        np.array(build.chain.sizes) > 1
    )
    steered = angles.copy()
    steered[..., 0, PITCH] += steering
    links = link_rotations(steered)
    targets = pseudo_targets(links, width)
    # Two targets raised to one height come nearer to each other, which a single bone cannot.
    if not np.isfinite(level) or min(build.chain.sizes) == 1:
        return links, targets, None
    columns = list(build.arms)
    floor = (level - poser.roots[columns, 2]) / poser.lengths[columns]
    targets[..., 1:, 2] = smooth_floor(targets[..., 1:, 2], floor[:, None], FLOOR_ROUNDING)
    return links, targets, floor


def _last(steps: Iterator[Floats]) -> Generator[None, None, Floats]:
    """The last of what comes after each of some steps."""
    last = np.empty(0)
    for last in steps:  # noqa: B007 - the last one
        yield
    return last


class RoughGaitPoser(GaitPoser):
    """One that is soon made: its cycle is looked at once, and what would reach below the floor is
    taken to lie on it.
    """

    rough = True

    @cached_property
    def _cycle(self) -> _Cycle:
        depths, middles = self._bare
        return np.maximum(depths, self._floor), middles

    def corrected(self, rough: GaitPoser, exact: GaitPoser) -> RoughGaitPoser:
        """The same as high as it is exactly, if it is as far off as of another gait the rough one
        is.
        """
        # Before the copy, which then has the cycle that was looked at for it.
        clearance = self.clearance + exact.clearance - rough.clearance
        result = copy(self)
        result.__dict__["clearance"] = clearance
        return result


def roughly(poser: GaitPoser) -> GaitPoser:
    """The same, but rough."""
    result = copy(poser)
    result.rough = True
    return result


def _missed(build: Build, ends: Floats, targets: Floats, settings: GaitSettings) -> Floats:
    """How far (groups, batch) ends of groups (groups, 3, batch) are from pseudo-targets Q₀ … Q₃."""
    missed = np.linalg.norm(ends - targets[1:], axis=1)
    if settings.stretch_slack > 0.0:
        roots = np.concatenate([np.zeros_like(ends[:1]), ends[:-1]])
        chords = np.linalg.norm(targets[1:] - roots, axis=1)
        beyond = overreach(chords, build.widths[:, None], settings.stretch_slack)
        # A group of a single bone begins where the one before has ended, and ends as far off.
        missed = np.maximum(missed - beyond.cumsum(axis=0), 0.0)
    return missed


def _solving(
    build: Build,
    settings: GaitSettings,
    sway: Floats,
    steered: Floats,
    asked: tuple[Floats, Floats, Floats | None],
    *,
    rough: bool,
) -> Iterator[Floats]:
    """Directions (segments, 3, frames · arms), in steps, of what :meth:`GaitPoser.chains` asks for,
    at heads and pitches (frames, arms, links, 2) with sways (arms, 2).
    """
    frames, arms = steered.shape[:2]
    batch = frames * arms
    links, targets, floor = asked
    swaying = np.broadcast_to(sway, (frames, arms, 2)).reshape(batch, 2)
    return solving_ccd(
        build.chain,
        asked_shape(build.chain, _batch_last(steered, batch), swaying.T),
        _batch_last(links, batch),
        _batch_last(targets, batch),
        softness=settings.softness,
        stretch_slack=settings.stretch_slack,
        floor=None if floor is None else np.tile(floor, frames),
        rough=rough,
    )


def target_places(poser: GaitPoser, phase: Floats, turn: Floats) -> Floats:
    """Pseudo-targets Q₀ … Q₃ (frames, arms, 4, 3) in the body's frame, armature units, at phases
    and turns as of :meth:`GaitPoser.pose`. What holds the ground has its foothold instead.
    """
    angles, steering = poser.asked(poser.arm_phases(phase), turn)
    result = np.empty((len(phase), len(poser.arms), GROUPS + 1, 3))
    for build in poser.builds:
        columns = list(build.arms)
        _, chain, _ = poser.chains(build, angles[:, columns], steering[:, columns])
        chain *= poser.lengths[columns, None, None]
        outward = poser.outward[columns, None]
        result[:, columns] = poser.roots[columns, None] + rotate(outward, chain)
    return result


def _batch_last(values: Floats, batch: int) -> Floats:
    """From (frames, arms, rows, components) to what the solver takes: (rows, components, batch)."""
    rows = values.reshape(batch, *values.shape[2:])
    return np.ascontiguousarray(np.moveaxis(rows, 0, -1))


def _check_weights(weights: Sequence[float]) -> None:
    if not weights or min(weights) <= 0.0 or max(weights) > 1.0:
        raise SettingsError(
            "A joint's weight is not between 0 and 1.", "Give weights above 0, 1 at most."
        )


def _check_disjoint(arms: Sequence[Arm]) -> None:
    owner: dict[str, str] = {}
    for arm in arms:
        for bone in arm.bones:
            if bone in owner:
                raise RigError(
                    phrase(
                        "Bone '{bone}' is in two arms, '{owner}' and '{arm}'.",
                        bone=bone,
                        owner=owner[bone],
                        arm=arm.name,
                    ),
                    "Remove one of the two from the list.",
                )
            owner[bone] = arm.name


def _instead(azimuths: Floats, heading: float) -> list[int]:
    """For each arm the one that stands where it does, seen from the way that the body goes.

    Of a body that goes sideways other arms are in front. In their own order neighbours that go
    across the way would step on each other. Azimuths (arms,) are radians from the front, and the
    heading is that from the way to the front, both anticlockwise.
    """
    apart = azimuths + heading - azimuths[:, None]
    nearest = np.abs(less_whole_turns(apart))
    # Of two that are as near always the same one, whatever the rounding.
    return np.argmin(np.round(nearest, 3), axis=0).tolist()


def _across(curve: GaitCurve) -> Floats:
    """Head and pitch (2,) of a unit bend across the one that a curve's angles mostly make."""
    samples = curve.angles[..., [HEAD, PITCH]].reshape(-1, 2)
    # Principal axes; of a table of zeros, whose axes are arbitrary, the sideways one.
    _, axes = np.linalg.eigh(samples.T @ samples + np.diag([1e-12, 0.0]))
    least = axes[:, 0]
    return least if least[PITCH] > 0.0 or (least[PITCH] == 0.0 and least[HEAD] > 0.0) else -least
