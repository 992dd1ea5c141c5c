# SPDX-License-Identifier: GPL-3.0-or-later
"""A walk on the ground: the gait's arms, brought to their footholds while the body passes."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ...rotations import Floats, components_first, conjugate, from_matrix, multiply, rotate
from ...skeleton import Skeleton
from ...steps import finished
from ..gait import CYCLE, Build, GaitPoser, UnevenHolds, bone_twists
from ..path import Line, values_along
from ..rig import ArmSkin, BodyFrame, Facing, rotate_bones, sucker_sides
from .arm_curves import Seen, skin_below
from .contact_timing import ContactTiming, EvenTiming
from .footholds import ContactOverride, Footholds, cycles_at, laying, relaid
from .stance_swing import (
    Batch,
    Stance,
    StancePose,
    airborne,
    kept_over_ground,
    pulling_to_footholds,
    stance_at,
)
from .surface import Foothold, Ground, GroundedPoses, Limbs, Raise, StanceSettings

_PASSES: Final = 4
"""Means in a row: what comes of them falls off like a bell. With two Settle has a jerk of 0.051
instead of 0.045."""
_TINY: Final = 1e-12


@dataclass(frozen=True)
class SwingSmoothing:
    """Means over time: of so many frames, in part of one frame more to either side."""

    frames: int
    """To either side of each mean."""
    more: float
    """Share of the mean of one frame more, 0…1."""

    @classmethod
    def over(cls, cycles: float, frames_per_cycle: float) -> SwingSmoothing | None:
        """Means over so many cycles before and after each frame, h; none where that is nothing.

        Weights that fall off evenly to nothing within h have a variance of h² / 6, as has the
        rounding of a gait's table (``GaitCurve.rounding``). That of a mean over k frames to either
        side is k (k + 1) / 3, and variances of means in a row add up.
        """
        variance = (cycles * frames_per_cycle) ** 2 / 6.0 / _PASSES
        if not variance > 0.0:
            return None
        frames = int(0.5 * (np.sqrt(1.0 + 12.0 * variance) - 1.0))
        less = frames * (frames + 1) / 3.0
        return cls(frames, float((variance - less) / (2.0 * (frames + 1) / 3.0)))

    @property
    def reach(self) -> int:
        """Frames to either side that what is made of a frame hangs on."""
        return _PASSES * (self.frames + 1)

    def evened(self, directions: Floats, share: Floats) -> Floats:
        """Directions (segments, 3, frames, arms), unit, evened out over frames that follow one
        another, each arm by a share (frames, arms) of 0…1.

        Before the first and after the last frame it goes on as it is there: those within
        :attr:`reach` of an end that is none of the motion's own are of no use.
        """
        result = directions
        for _ in range(_PASSES):
            mean = self._mean(result)
            mean -= result
            mean *= share
            mean += result
            # Half a turn within a few frames has no middle: it stays of some length.
            size = np.sqrt(np.einsum("scfa,scfa->sfa", mean, mean))
            mean /= np.maximum(size, _TINY)[:, None]
            result = mean
        return result

    def _mean(self, values: Floats) -> Floats:
        """Means (segments, 3, frames, arms) over the frames round each."""
        most, count = self.frames + 1, values.shape[2]
        frames_around = values[:, :, np.clip(np.arange(-most, count + most), 0, count - 1)]
        weights = np.full(2 * most + 1, (1.0 - self.more) / (2 * most - 1))
        weights[[0, -1]] = 0.0
        weights += self.more / (2 * most + 1)
        result = weights[0] * frames_around[:, :, :count]
        for step, weight in enumerate(weights[1:].tolist(), start=1):
            result += weight * frames_around[:, :, step : step + count]
        return result


def frames_around(part: slice, reach: int, count: int, *, cyclic: bool) -> tuple[np.ndarray, slice]:
    """Numbers of some frames that follow one another and of those round them, and where among these
    the frames are.

    So many more are within reach to either side, of ``count`` in all; cyclic, the last is the
    first.
    """
    if not cyclic or count < 2:
        first = max(part.start - reach, 0)
        own = slice(part.start - first, part.stop - first)
        return np.arange(first, min(part.stop + reach, count)), own
    # The first and the last are left as they are: only what is beyond them goes round.
    numbers = np.arange(part.start - reach, part.stop + reach)
    outside = (numbers < 0) | (numbers >= count)
    numbers = np.where(outside, numbers % (count - 1), numbers)
    return numbers, slice(reach, reach + part.stop - part.start)


# --- Arms of one build, brought from their gait's shapes to their footholds, at any frames --------


_ASKEW: Final = np.radians(35.0)
"""How far from straight outward a foothold may lie, and an arm from there. On bumps Tiptoe slips by
0.0085 arm lengths instead of 0.0023 at 17°, and its arms overlap by 0.145 radii instead of 0.019
at 70°."""
_TURN: Final = 12.0
"""Radians that the suckers of an arm are turned at most from root to tip. At 6 bones that hold roll
by 29° in a hold of Walk over bumps instead of 4°, and by 1.5° instead of 0.3° in the mean."""
_MOST_TURN: Final = 1.0
"""The same from one bone to the next, of arms of less than twelve bones: at 1 a bone that faces
nearly right faces right. At 1.5 it goes beyond that, and what holds rolls by 0.5° in the mean."""
_FREE_TURN: Final = 0.5
"""Share of it beyond what lies on the ground. With all of it tips of Curl turn by 17° in a frame,
not by 15°."""
_FIRST_TURN: Final = 0.15
"""Share of it at the root, which the body's skin surrounds, …"""
_ALL_TURN: Final = 0.45
"""… and of an arm from where on it is all there. At half of that four bones of Hurry on a plane set
out all at once."""


@dataclass(frozen=True, eq=False)
class Moments:
    """What is asked of all arms of a body at some frames, and where it is then."""

    angles: Floats
    """(frames, arms, links, 3) as of ``GaitPoser.asked`` …"""
    steering: Floats
    """(frames, arms) … and likewise."""
    cycles: np.ndarray
    """(frames, arms) number of the cycle that each arm is in."""
    since: Floats
    """(frames, arms) cycles since the middle of its stance."""
    centres: Floats
    """(frames, 3) of the body, world."""
    orientations: Floats
    """(frames, 4) of the canonical body, world."""
    to_armature: Floats
    """(frames, 4) from the world to the armature."""
    lift: Floats
    """(frames,) arm lengths that arms are above the ground at least in the middle of a swing."""


@dataclass(frozen=True, eq=False)
class PartPoses:
    """Some arms of one build at some frames."""

    arms: list[int]
    """Their numbers among all arms of the body."""
    rotations: Floats
    """(frames, arms, bones, 4) unit quaternions in each bone's rest frame."""
    strains: Floats
    """(bones, frames, arms) by how much each bone is longer than at rest, as a share."""
    misses: Floats
    """(frames, arms) distance of an arm in stance from its foothold, in arm lengths."""
    joints: Floats
    """(frames, arms, segments + 1, 3), world."""
    in_contact: np.ndarray
    """(frames, arms, segments + 1) which joints rest on the ground."""
    shapes: Floats | None = None
    """(segments, 3, frames, arms of the build) the gait's own; none where they were known."""
    evened: Floats | None = None
    """(segments, 3, frames, arms) what evening out over time has added; none if it was not asked.
    """

    @classmethod
    def of_none(cls, frames: int, bones: int) -> PartPoses:
        """Of no arms at all."""
        return cls(
            [],
            np.zeros((frames, 0, bones, 4)),
            np.zeros((bones, frames, 0)),
            np.zeros((frames, 0)),
            np.zeros((frames, 0, bones + 1, 3)),
            np.zeros((frames, 0, bones + 1), dtype=bool),
        )


@dataclass(frozen=True, eq=False)
class WalkPart:
    """Arms of one build, all of which may stretch or none, on their ground."""

    poser: GaitPoser
    ground: Ground
    settings: StanceSettings
    sides: Sequence[Floats]
    """Of all arms of the body (bones, 3): where their suckers are, in the bones' rest frames."""
    build: Build
    limbs: Limbs
    footholds: Footholds

    def posing(
        self,
        number: int,
        moments: Moments,
        higher: Raise | None,
        smoothing: SwingSmoothing | None,
    ) -> Generator[None, None, PartPoses]:
        """The arms of this part, by its number as ``Raise`` counts them, at some moments, in steps.

        Some are to be higher, or all are as high as they have to be. In the air they are evened out
        over frames that follow one another.
        """
        wanted = self.build.arms if higher is None else higher.arms
        chosen = [place for place, arm in enumerate(self.build.arms) if arm in wanted]
        columns = [self.build.arms[place] for place in chosen]
        frames, many = len(moments.angles), len(columns)
        bones = len(self.build.chain.lengths)
        if not columns:
            return PartPoses.of_none(frames, bones)
        asked = None
        if higher is None or higher.shapes is None:
            shapes = asked = yield from self._asked(moments)
        else:
            shapes = higher.shapes[number]
        arms, facing = self._batch(moments, chosen, higher)
        yield
        shapes = components_first.rotate(facing, shapes[..., chosen].reshape(bones, 3, -1))
        times = (each[:, columns].reshape(-1) for each in (moments.cycles, moments.since))
        stance = stance_at(arms, self.footholds, *times)
        pulling = pulling_to_footholds(
            *(arms, shapes, stance, self.ground, self.settings), rough=self.poser.rough
        )
        strains, ways = yield from pulling
        yield
        evened, each_frame = None, (bones, 3, frames, many)
        if higher is not None and higher.evened:
            ways = components_first.normalized(
                ways + higher.evened[number][..., chosen].reshape(ways.shape)
            )
        elif higher is None and smoothing is not None:
            before, share = ways, airborne(stance).reshape(frames, many)
            ways = smoothing.evened(ways.reshape(each_frame), share).reshape(ways.shape)
            evened = (ways - before).reshape(each_frame)
        yield
        lift = np.repeat(moments.lift, many)
        pose = kept_over_ground(arms, (strains, ways), stance, self.ground, lift)
        yield
        twists = bone_twists(self.build, moments.angles[:, columns])
        joints = pose.joints.reshape(bones + 1, 3, frames, many)
        in_contact = pose.in_contact.reshape(bones + 1, frames, many)
        return PartPoses(
            arms=columns,
            rotations=self._rotations(columns, (arms, pose, stance), moments.to_armature, twists),
            strains=pose.strains.reshape(bones, frames, many),
            misses=(pose.misses / arms.reach[-1]).reshape(frames, many),
            joints=np.moveaxis(joints, (0, 1), (2, 3)),
            in_contact=np.moveaxis(in_contact, 0, 2),
            shapes=asked,
            evened=evened,
        )

    def _asked(self, moments: Moments) -> Generator[None, None, Floats]:
        """The gait's own directions (segments, 3, frames, arms of the build), in steps."""
        every = list(self.build.arms)
        angles, steering = moments.angles[:, every], moments.steering[:, every]
        chains = self.poser.chains(self.build, angles, steering)
        directions = np.zeros(0)
        for found in self.poser.shaping(
            self.build, angles, steering, chains, rough=self.poser.rough
        ):
            directions = found
            yield
        return directions

    def _batch(
        self, moments: Moments, chosen: list[int], higher: Raise | None
    ) -> tuple[Batch, Floats]:
        """Arms of some places in the build at the frames, and what turns each one's own frame to
        the world's (4, batch).
        """
        columns = [self.build.arms[place] for place in chosen]
        turn = moments.orientations[:, None]
        facing = multiply(turn, self.poser.outward[columns]).reshape(-1, 4).T
        roots = moments.centres[:, None] + rotate(turn, self.limbs.roots[chosen])
        lift = np.zeros(facing.shape[-1])
        if higher is not None:
            lift = (higher.lift[:, columns] * self.limbs.reach[-1, chosen]).reshape(-1)
        batch = Batch(
            self.limbs,
            np.tile(chosen, len(moments.angles)),
            np.ascontiguousarray(roots.reshape(-1, 3).T),
            components_first.rotate(facing, np.array([1.0, 0.0, 0.0])[:, None]),
            components_first.rotate(facing, np.array([0.0, 0.0, 1.0])[:, None]),
            lift,
        )
        return batch, facing

    def _rotations(
        self,
        columns: list[int],
        standing: tuple[Batch, StancePose, Stance],
        to_armature: Floats,
        bank: Floats,
    ) -> Floats:
        """Rotations (frames, arms, bones, 4) of some arms that stand, their suckers to the ground.

        Quaternions (frames, 4) lead to the armature from the world; the gait twists bones by angles
        (bones, frames, arms).
        """
        batch, pose, stance = standing
        segments, many = len(pose.directions), len(columns)
        shape = segments, 3, len(to_armature), many
        back = np.ascontiguousarray(np.repeat(to_armature, many, axis=0).T)
        towards = components_first.rotate(back, -stance.upwards(segments)).reshape(shape)
        along = np.interp(np.arange(segments) / segments, (0.0, _ALL_TURN), (_FIRST_TURN, 1.0))
        most = min(_MOST_TURN, _TURN / segments) * along
        turns = (most[:, None] * _turning(batch, stance)).reshape(segments, *shape[2:])
        return rotate_bones(
            [self.poser.rests[arm] for arm in columns],
            components_first.rotate(back, pose.directions).reshape(shape),
            bank,
            Facing([self.sides[arm] for arm in columns], towards, turns),
        )


def _turning(batch: Batch, stance: Stance) -> Floats:
    """How far (segments, batch) bones of arms that hold on turn their suckers down, 0…1: what is
    still to come down, or only plays with its tip, has time for it.
    """
    first = batch.reach[stance.touching]
    lies = first + stance.weight * (stance.contact_to - first) - batch.reach[:-1]
    return stance.weight * (
        _FREE_TURN + (1.0 - _FREE_TURN) * np.clip(lies / batch.lengths, 0.0, 1.0)
    )


def limbs_of(
    poser: GaitPoser,
    build: Build,
    radii: Sequence[Floats],
    *,
    scale: float,
    planted: float,
    may_stretch: bool,
) -> Limbs:
    """Arms of one build in the world's measure, and where their gait has its footholds.

    Args:
        poser: their gait.
        build: the arms.
        radii: for each arm of the body (bones + 1,) armature units from joints to the skin below.
        scale: metres of the armature's unit.
        planted: share of an arm that lies down.
        may_stretch: whether their bones may get longer.
    """
    columns, gait = list(build.arms), poser.settings.gait
    limbs = Limbs(
        arms=build.arms,
        roots=scale * poser.roots[columns],
        outward=poser.outward[columns],
        offsets=poser.offsets[columns],
        lengths=scale * build.chain.lengths[:, None] * poser.lengths[columns],
        radii=scale * np.stack([radii[arm] for arm in columns], axis=1),
        aims=np.zeros((len(columns), 2)),
        weights=build.chain.weights[:, None],
        may_stretch=may_stretch,
        free=np.array([gait.curve(poser.arms[arm].pair).free for arm in columns]),
    )
    steps = build.chain.lengths[:, None, None] * poser.middle_shapes(columns)
    joint = limbs.touching(planted)
    near, far = steps[:joint].sum(axis=0), steps[joint:].sum(axis=0)
    aims = np.arctan2([near[1], far[1]], [near[0], far[0]]).T
    return replace(limbs, aims=_ASKEW * np.tanh(aims / _ASKEW))


_LOOKS: Final = 16
"""Moments of a cycle at which it is looked at which side of its skin an arm lies on."""


def _are_round(parts: Sequence[WalkPart], skins: Sequence[ArmSkin]) -> bool:
    return not skins or all(
        skins[arm].is_round(part.sides[arm], part.footholds.touching)
        for part in parts
        for arm in part.build.arms
    )


class GroundedWalk:
    """A body that walks over a ground.

    Args:
        skeleton: the rig.
        poser: its gait.
        body: where the body lies in armature space.
        line: its way.
        ground: what it walks on.
        settings: how arms hold on.
        scale: metres of the armature's unit.
        radii: for each arm (bones + 1,) armature units from each joint to the skin below it.
        may_stretch: for each arm, whether its bones may get longer.
        phases: the first and the last of the body's phases, radians.
        contact_overrides: the artist's footholds.
        timing: when arms hold on; none for the gait's own.
        cyclic: whether each cycle is like the one before.
        skins: of each arm: where one is not round, it lies on the side that is below. None for
            round ones.
    """

    def __init__(  # noqa: PLR0917 - what it is made of, in the order in which it is made
        self,
        skeleton: Skeleton,
        poser: GaitPoser,
        body: BodyFrame,
        line: Line,
        ground: Ground,
        settings: StanceSettings,
        *,
        scale: float,
        radii: Sequence[Floats],
        may_stretch: Sequence[bool],
        phases: tuple[float, float],
        contact_overrides: Sequence[ContactOverride] = (),
        timing: ContactTiming | None = None,
        cyclic: bool = False,
        skins: Sequence[ArmSkin] = (),
    ) -> None:
        self._poser, self._line, self._ground, self._settings = poser, line, ground, settings
        self._scale, self._cyclic = scale, cyclic
        self._middle = poser.settings.gait.power_phase
        self._body_turn = from_matrix(body.rotation)
        self._stride = line.settings.stride
        self._timing = timing or EvenTiming(self._stride, poser.offsets)
        ends, _ = cycles_at(self.arm_phases(np.array(phases)), self._middle)
        first, last = ends
        self._cycles = int(first.min()), int(last.max())
        self._last = first, last
        down = -body.rotation[:, 2]
        sides = [sucker_sides(skeleton, arm.bones, down) for arm in poser.arms]
        self._ends = np.cumsum([0] + [len(arm.bones) for arm in poser.arms])
        self._found: list[WalkPart] = []
        self._laying = self._laying_footholds(
            sides, radii, may_stretch, contact_overrides, below=(skins, phases)
        )

    def laying(self) -> Generator[None, None, None]:
        """Lay all footholds, in steps; else that is done when they are first asked for."""
        yield from self._laying

    @property
    def _parts(self) -> list[WalkPart]:
        if not self._found:
            deque(self._laying, maxlen=0)
        return self._found

    def _laying_footholds(
        self,
        sides: Sequence[Floats],
        radii: Sequence[Floats],
        may_stretch: Sequence[bool],
        contact_overrides: Sequence[ContactOverride],
        *,
        below: tuple[Sequence[ArmSkin], tuple[float, float]],
    ) -> Generator[None, None, None]:
        poser, ground, settings = self._poser, self._ground, self._settings
        # Where nothing varies at random, the seed does not matter.
        seed = poser.settings.seed if any(poser.settings.variation) else 0
        parts: list[WalkPart] = []
        for build in poser.builds:
            for stretch in sorted({may_stretch[arm] for arm in build.arms}):
                arms = tuple(arm for arm in build.arms if may_stretch[arm] == stretch)
                own = Build(arms, build.chain, build.widths)
                limbs = limbs_of(
                    *(poser, own, radii),
                    scale=self._scale,
                    planted=settings.planted,
                    may_stretch=stretch,
                )
                yield
                footholds = yield from laying(
                    *(limbs, self._line, ground, settings, self._timing),
                    middle=self._middle,
                    cycles=self._cycles,
                    contact_overrides=contact_overrides,
                    seed=seed,
                    cyclic=self._cyclic,
                    uneven=self._uneven,
                    rough=poser.rough,
                )
                parts.append(WalkPart(poser, ground, settings, sides, own, limbs, footholds))
        self._found = parts
        if not _are_round(parts, below[0]):
            self._found = [
                replace(part, footholds=relaid(part.footholds, part.limbs, ground, own))
                for part, own in zip(parts, self._below(*below), strict=True)
            ]

    @property
    def _uneven(self) -> UnevenHolds | None:
        """How holds differ in place; none on the way, where the ground sees to it."""
        settings = self._poser.settings
        if not self._cyclic or settings.uneven <= 0.0:
            return None
        periods = self._timing.cycle_period or settings.period
        return UnevenHolds(settings.uneven, settings.seed, periods)

    def _below(self, skins: Sequence[ArmSkin], phases: tuple[float, float]) -> list[Floats]:
        """For each build (arms, cycles, segments + 1 − c) metres from joints to the skin below.

        Which side of a bone is below is what the arms show as they would lie if they were round.
        """
        looks = int(np.ceil((phases[1] - phases[0]) / CYCLE * _LOOKS)) + 1
        phase = np.linspace(*phases, looks)
        centres, orientations = self._line.at(phase / CYCLE * self._stride)
        pose = self.pose(phase, np.zeros((looks, 2)), centres, orientations)
        to_world = multiply(orientations, conjugate(self._body_turn))
        found: list[Floats] = []
        for number, part in enumerate(self._parts):
            footholds = part.footholds
            below = np.empty(footholds.skins.shape)
            for place, arm in enumerate(part.build.arms):
                own = pose.rotations[:, self._ends[arm] : self._ends[arm + 1]]
                carried = self._poser.rests[arm].orientations(own)
                cycles = pose.cycles[:, arm] - footholds.first
                seen = Seen(
                    joints=pose.joints[number][:, place],
                    orientations=multiply(to_world[:, None], carried),
                    upward=footholds.normals[place, cycles],
                    rests=pose.in_contact[number][:, place, footholds.touching :],
                    cycles=0 * cycles if self._cyclic else cycles,
                )
                known = footholds.skins[place, :1] if self._cyclic else footholds.skins[place]
                below[place] = skin_below(skins[arm], seen, known, self._ground, scale=self._scale)
            found.append(below)
        return found

    def arm_phases(self, phase: Floats) -> Floats:
        """Each arm's own phase (frames, arms) at the body's phases (frames,)."""
        return self._timing.phases(self._stride * np.asarray(phase) / CYCLE)

    def pose(
        self,
        phase: Floats,
        turn: Floats,
        centres: Floats,
        orientations: Floats,
        higher: Raise | None = None,
        *,
        smoothing: SwingSmoothing | None = None,
    ) -> GroundedPoses:
        """The arms at some frames; arguments are as of :meth:`posing`."""
        return finished(
            self.posing(phase, turn, centres, orientations, higher, smoothing=smoothing)
        )

    def posing(
        self,
        phase: Floats,
        turn: Floats,
        centres: Floats,
        orientations: Floats,
        higher: Raise | None = None,
        *,
        smoothing: SwingSmoothing | None = None,
    ) -> Generator[None, None, GroundedPoses]:
        """The arms at some frames, in steps.

        Args:
            phase: (frames,) of the body's gait, radians.
            turn: (frames, 2) turn that lies ahead, in the body's XY plane.
            centres: (frames, 3) of the body, world.
            orientations: (frames, 4) of the canonical body, world.
            higher: which arms are to be higher, and nothing is said of the others; none for all
                of them, as high as they have to be.
            smoothing: how arms in the air are evened out over frames that follow one another, none
                for each frame by itself. Those that are within its reach of an end that is none of
                the motion's own are of no use.
        """
        phases = self.arm_phases(phase)
        angles, steering = self._poser.asked(phases, turn, self._timing.cycle_period)
        cycles, since = cycles_at(phases, self._middle)
        to_armature = multiply(self._body_turn, conjugate(orientations))
        moments = Moments(
            angles, steering, cycles, since, centres, orientations, to_armature, self._lift(phase)
        )
        # While they are laid they are looked at themselves, as round arms lie.
        if not self._found:
            yield from self.laying()
        parts: list[PartPoses] = []
        for number, part in enumerate(self._parts):
            parts.append((yield from part.posing(number, moments, higher, smoothing)))
            yield
        rotations = np.zeros((len(phase), self._ends[-1], 4))
        strains = np.zeros(rotations.shape[:2])
        misses = np.zeros(phases.shape)
        for part in parts:
            for place, arm in enumerate(part.arms):
                bones = slice(self._ends[arm], self._ends[arm + 1])
                rotations[:, bones] = part.rotations[:, place]
                strains[:, bones] = part.strains[:, :, place].T
            misses[:, part.arms] = part.misses
        return GroundedPoses(
            rotations,
            strains,
            misses,
            tuple(each.joints for each in parts),
            tuple(each.in_contact for each in parts),
            cycles,
            tuple(each.shapes for each in parts if each.shapes is not None),
            tuple(each.evened for each in parts if each.evened is not None),
        )

    def _lift(self, phase: Floats) -> Floats:
        """Arm lengths (frames,) that arms are lifted at the body's phases (frames,)."""
        share = self._line.route.share_at(phase / CYCLE * self._stride)
        return values_along(self._line.settings.along.lift, share, self._settings.lift)

    @property
    def builds(self) -> tuple[tuple[int, ...], ...]:
        """Numbers of the arms of each build, in the order of ``GroundedPoses.joints``."""
        return tuple(part.build.arms for part in self._parts)

    def by_arm(self, values: Sequence[np.ndarray], higher: Raise | None = None) -> list[np.ndarray]:
        """What poses have for each build (frames, arms, …), for each arm (frames, …) instead.

        Of those arms that were not asked of it is none at all.
        """
        wanted = range(len(self._poser.arms)) if higher is None else higher.arms
        found = {arm: np.zeros((0, 1, 3)) for arm in range(len(self._poser.arms))}
        found |= {
            arm: each[:, place]
            for arms, each in zip(self.builds, values, strict=True)
            for place, arm in enumerate(arm for arm in arms if arm in wanted)
        }
        return [found[arm] for arm in sorted(found)]

    def footholds(self) -> list[Foothold]:
        """All footholds that are there, arm by arm."""
        found: list[Foothold] = []
        first, last = self._last
        for part in self._parts:
            laid, arms = part.footholds, list(part.build.arms)
            cycles = laid.first + np.arange(laid.present.shape[1])
            since = np.stack([laid.touch_down, laid.lift_off], axis=-1)
            turns = self._middle / CYCLE + cycles[:, None] + since
            ends = self._timing.distances(arms, turns) * CYCLE / self._stride
            there = (cycles >= first[arms, None]) & (cycles <= last[arms, None]) & laid.present
            found += [
                Foothold(
                    arms[place],
                    laid.first + number,
                    laid.joints[place, number, 0],
                    float(laid.headings[place, number]),
                    touch_down=float(ends[place, number, 0]),
                    lift_off=float(ends[place, number, 1]),
                    lasts=float(since[place, number, 1] - since[place, number, 0]),
                )
                for place, number in np.argwhere(there).tolist()
            ]
        return sorted(found, key=lambda each: (each.arm, each.cycle))
