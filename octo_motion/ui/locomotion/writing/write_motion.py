# SPDX-License-Identifier: GPL-3.0-or-later
"""One motion of one creature, on plain arrays: worked out in steps, then written."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import bpy
import numpy as np

from ....blender.animation import (
    SCALE,
    Channel,
    animated_bones,
    key_counts,
    location_channel,
    object_channels,
    rest_bones,
    rotation_channels,
    stretch_channels,
    unscale_bones,
    writable_armature,
    write_action,
)
from ....blender.scene import Contact, write_markers
from ....core.errors import WriteError
from ....core.locomotion.clearance import (
    ArmsOverGround,
    Opened,
    keep_off_ground,
    raise_between_frames,
    separate_arms,
)
from ....core.locomotion.gait import Arm, GaitPoser, GaitTable
from ....core.locomotion.ground import Ground, Raise, SwingSmoothing
from ....core.locomotion.metrics import TOLD, Figure, KeyedRig, Measured, figures, measure_keyed
from ....core.locomotion.motion import Body, Motion, Tolerances, reduced
from ....core.locomotion.path import Route, Travel, TravelSettings, plan_travel
from ....core.locomotion.rig import (
    BodyFrame,
    Detection,
    Poses,
    halfway_automatic,
    object_transforms,
    root_bone_transforms,
)
from ....core.rotations import IDENTITY, Floats, from_matrix, rotate, slerp
from ....core.skeleton import Skeleton
from ..reading import (
    Apart,
    Carried,
    GaitTransitionPlan,
    Reaching,
    SegmentedMotion,
    Standing,
    Travelling,
    bones_of,
    frames_of_arms,
    previous_action,
    write_arms,
    write_body,
    write_carried,
)
from ..settings.contact_overrides import ContactEdit, Place, note_shown, once_called, store
from ..settings.properties import locomotion_settings
from ..settings.quality import write_figures
from .summary import Summary

MISS: Final = TOLD["MISS"]
"""Arm lengths by which a target may be missed without a word."""

_MOVING: Final = 0.4
"""Share of the work that is over when the motion is there, but not yet its few keys."""
_EXACT_ANGLE: Final = np.radians(0.5)
"""Radians that keys on every frame may be off there …"""
_EXACT_DISTANCE: Final = 0.002
"""… and arm lengths of an arm's tip."""
_BONES_AT_ONCE: Final = 24_000
"""Bones times frames of one step of the work: some tens of megabytes."""
_UP: Final = np.array([0.0, 0.0, 1.0])


@dataclass(eq=False)
class _Posed:
    """The arms at all frames, while they are worked out."""

    rotations: Floats
    """(frames, bones, 4)"""
    strains: Floats
    """(frames, bones) by how much bones are longer than at rest, as a share."""
    late: Floats
    """(frames, arms) arm lengths to the foothold that an arm cannot reach."""
    misses: Floats
    """(frames, arms) arm lengths to the targets of the gait."""
    lying: list[np.ndarray]
    """For each arm (frames, joints) which rest on the ground."""
    cycles: np.ndarray
    """(frames, arms) number of each arm's cycle."""

    @classmethod
    def of(cls, frames: int, arms: Sequence[Arm]) -> _Posed:
        """Arms that hold on to nothing."""
        bones = sum(len(arm.bones) for arm in arms)
        return cls(
            rotations=np.empty((frames, bones, 4)),
            strains=np.zeros((frames, bones)),
            late=np.zeros((frames, len(arms))),
            misses=np.zeros((frames, len(arms))),
            lying=[np.zeros((frames, len(arm.bones) + 1), dtype=bool) for arm in arms],
            cycles=np.zeros((frames, len(arms)), dtype=np.int64),
        )

    def at_every(self, count: int) -> _Posed:
        """The same at every so many of these frames, from the first on."""
        return _Posed(
            rotations=self.rotations[::count],
            strains=self.strains[::count],
            late=self.late[::count],
            misses=self.misses[::count],
            lying=[each[::count] for each in self.lying],
            cycles=self.cycles[::count],
        )


@dataclass(frozen=True, eq=False)
class _Moving:
    """What gets keys, at all moments at which it is worked out."""

    rotations: Floats
    """(moments, bones, 4)"""
    strains: Floats
    """(moments, bones)"""
    locations: Floats
    """(moments, 3)"""
    orientations: Floats
    """(moments, 4)"""
    swimming: Floats | None
    """(moments,) how far the body swims, 0…1, where the gait changes."""
    lying: Sequence[np.ndarray]
    """For each arm (moments, joints) which rest on the ground."""


@dataclass(eq=False)
class Shot:
    """All that one journey needs, as plain data; see :func:`prepare`."""

    armature: str
    """Name of the object: references to Blender's data do not outlive a modal operator's tick."""
    scene: str
    skeleton: Skeleton
    arms: tuple[Arm, ...]
    detection: Detection | None
    """What was found, if the settings had no arms."""
    body: BodyFrame
    gait: GaitTable
    generator: GaitPoser
    route: Route
    travel: TravelSettings
    world: Floats
    """(4, 4) of the object, of uniform scale."""
    scale: float
    height: float
    """Metres from the route to the body's centre."""
    frames: Floats
    """(frames,) whole numbers."""
    times: Floats
    """(frames,) share of the journey's time, 0…1."""
    seconds: float
    root_bone: str
    """Bone that takes the travel, "" for the object."""
    mantle: tuple[str, ...]
    """Bones that are stretched out, none in a walk."""
    mantle_rotations: Floats
    """(bones, 4) how, the same at every frame."""
    tolerances: Tolerances | None
    """How far few keys may be off, none for a key on every frame."""
    hasty: bool
    """Whether a cycle has so few frames that the motion is worked out half way between them, too,
    for its keys to keep to that."""
    in_place: bool
    """Whether nothing travels: the motion is a loop."""
    repeats: bool
    """Whether curves go on before the motion and after it."""
    breath: Sequence[Channel]
    """Of the mantle."""
    extend_scene_range: bool
    standing: Standing | None
    """What holds the ground, none for a swim."""
    changing: GaitTransitionPlan | None
    """Where the gait changes, none for one gait all the way."""
    wanted: dict[Place, ContactEdit]
    """What the artist wants of single contacts."""
    apart: Apart | None
    """What there is of the creature, where arms keep apart or overlaps are told."""
    keep_apart: bool
    """Whether arms make way for each other."""
    tell_overlaps: bool
    cycle: float
    """Frames of a cycle of the gait."""
    measure: bool
    """Whether figures of the motion are wanted."""
    reaching: Reaching | None
    """What arms reach for."""
    note: str
    """The settings as JSON, kept with the action."""
    warnings: list[str] = field(default_factory=list)
    rotations: Floats | None = None
    locations: Floats | None = None
    orientations: Floats | None = None
    misses: Floats | None = None
    """(frames, arms) arm lengths from an arm to the targets of its gait."""
    strains: Floats | None = None
    """(frames, bones) by how much each bone is longer than at rest, as a share."""
    out_of_reach: Floats | None = None
    """(frames, arms) arm lengths from an arm to the foothold that it cannot reach."""
    reached: tuple[str, ...] = ()
    """What arms that reach do."""
    swimming: Floats | None = None
    """(frames,) how far the body swims, 0…1, where the gait changes."""
    carried: tuple[Carried, ...] = ()
    """Where they take objects."""
    overlaps: tuple[str, ...] = ()
    """Where arms pass through each other or the body."""
    measured: Measured | None = None
    """What the figures are taken from, none where they are not wanted."""
    figures: tuple[Figure, ...] = ()
    """The worst of each kind."""
    moving: _Moving | None = None
    few: list[Channel] | None = None
    """The channels with keys of their own: few, or with handles of their own."""

    @property
    def every(self) -> int:
        """At every how many moments that are worked out there is a frame."""
        return 2 if self.hasty else 1

    @cached_property
    def moments(self) -> Floats:
        """(moments,) frames at which the motion is worked out, which need not be whole."""
        return _with_halves(self.frames) if self.hasty else self.frames

    def compute(self) -> Iterator[float]:
        """Do the work in steps, yielding the share that is done: 0…1, 1 at the end."""
        table = self.standing.bearings if self.standing is not None else None
        times = _with_halves(self.times) if self.hasty else self.times
        travel = plan_travel(self.route, self.travel, times, table)
        places = self._places(travel)
        # In place the ground goes by, and arms are measured as if the body went along it.
        going = object_transforms(self.body, self.scale, *places)
        self.locations, self.orientations = self._in_place() if self.in_place else going
        posed = _Posed.of(len(self.moments), self.arms)
        if self.changing is not None:
            steps = self._change(self.changing, travel, places, going, posed)
        elif self.standing is not None:
            steps = self._stand(self.standing, travel, places, going, posed)
        else:
            steps = self._follow(travel, posed)
        reducing = self.tolerances is not None or self.hasty
        moving = _MOVING if reducing else 1.0
        for share in steps:
            yield moving * share
        busy = self._reach(posed)
        self._part(posed, busy, going)
        posed, going = self._keep(posed, going)
        self._look(posed, going)
        self.rotations, self.misses = posed.rotations, posed.misses
        self.strains, self.out_of_reach = posed.strains, posed.late
        if reducing:
            yield moving
            for share in self._reduce():
                yield moving + (1.0 - moving) * share
        self._tell_quality()
        yield 1.0

    def _keep(
        self, posed: _Posed, going: tuple[Floats, Floats]
    ) -> tuple[_Posed, tuple[Floats, Floats]]:
        """Keep what moves at all moments for its keys; the arms and the travel on frames."""
        assert self.locations is not None
        assert self.orientations is not None
        self.moving = _Moving(
            rotations=posed.rotations,
            strains=posed.strains,
            locations=self.locations,
            orientations=self.orientations,
            swimming=self.swimming,
            lying=posed.lying,
        )
        every = self.every
        self.locations, self.orientations = self.locations[::every], self.orientations[::every]
        if self.swimming is not None:
            self.swimming = self.swimming[::every]
        return posed.at_every(every), (going[0][::every], going[1][::every])

    def _places(self, travel: Travel) -> tuple[Floats, Floats]:
        """Centres (frames, 3) and orientations (frames, 4) of the body, world."""
        if self.changing is not None:
            return self.changing.course.at(travel.distance)
        if self.standing is not None:
            return self.standing.place(travel)
        up = rotate(travel.rotations, _UP) if self.gait.on_ground else _UP
        return travel.positions + self.height * up, travel.rotations

    def _portions(self) -> Iterator[slice]:
        """Frames that are worked on at a time."""
        count = len(self.moments)
        step = max(1, _BONES_AT_ONCE // max(len(self.generator.bones), 1))
        return (slice(start, min(start + step, count)) for start in range(0, count, step))

    def _follow(self, travel: Travel, posed: _Posed) -> Iterator[float]:
        """Arms as the gait alone has them."""
        count = len(self.moments)
        for part in self._portions():
            poses = self.generator.pose(travel.phase[part], travel.turn[part])
            posed.rotations[part] = poses.rotations
            posed.misses[part] = poses.misses.max(axis=2)
            if part.stop < count:
                yield part.stop / count

    def _change(
        self,
        changing: GaitTransitionPlan,
        travel: Travel,
        places: tuple[Floats, Floats],
        going: tuple[Floats, Floats],
        posed: _Posed,
    ) -> Iterator[float]:
        """Arms of a journey on which the gait changes, and that do not dip between frames."""
        step = next(self._portions(), slice(0, 1)).stop
        self.swimming = changing.swimming(travel.distance)
        journey: SegmentedMotion | None = None
        per_metre = self.every * self.cycle / self.travel.stride
        for done in changing.compute(travel.distance, places, step, per_metre):
            if isinstance(done, SegmentedMotion):
                journey = done
            else:
                yield done
        assert journey is not None
        moved = journey.moved
        posed.rotations, posed.strains = moved.rotations, moved.strains
        posed.late, posed.misses = moved.late, moved.misses
        posed.lying, posed.cycles = list(moved.lying), moved.cycles
        ground = self._ground()
        if ground is None:
            return

        def kept_off(poses: Poses, loose: Floats) -> Poses:
            """The same with arms off the ground that know of none."""
            return replace(poses, rotations=keep_off_ground(course, poses, radii, loose))

        def again(chosen: np.ndarray, lift: Floats) -> tuple[Poses, list[Floats]]:
            """Some frames anew, with arms raised; others are left as they are."""
            rotations, strains, posed.late[chosen] = journey.higher(chosen, lift)
            poses = Poses(rotations, strains, going[0][chosen], going[1][chosen])
            poses = kept_off(poses, loose[chosen])
            return poses, course.joints(poses)

        course = ArmsOverGround(
            frames_of_arms(self.skeleton, self.arms, self.body), ground, self.scale
        )
        radii = next(each.walk.radii for each in self._stands())
        # On a journey on which the gait never changes, one number stands for all.
        loose = np.broadcast_to(changing.afloat(travel.distance), posed.late.shape)
        whole = kept_off(Poses(posed.rotations, posed.strains, *going), loose)
        raised = raise_between_frames(course, whole, course.joints(whole), again)
        posed.rotations, posed.strains = raised.rotations, raised.strains

    def _stand(
        self,
        standing: Standing,
        travel: Travel,
        places: tuple[Floats, Floats],
        going: tuple[Floats, Floats],
        posed: _Posed,
    ) -> Iterator[float]:
        """Arms that hold the ground, and do not dip into it between frames."""
        count = len(self.moments)
        joints: list[list[Floats]] = []
        shapes: list[tuple[Floats, ...]] = []
        evened: list[tuple[Floats, ...]] = []
        steady = self._steady()
        for part in self._portions():
            stood = standing.pose_steadily(travel, part, places, steady, cyclic=self.in_place)
            posed.rotations[part], posed.strains[part] = stood.rotations, stood.strains
            posed.late[part], posed.cycles[part] = stood.misses, stood.cycles
            joints.append(standing.walk.by_arm(stood.joints))
            shapes.append(stood.shapes)
            evened.append(stood.evened)
            for arm, rests in zip(posed.lying, standing.walk.by_arm(stood.in_contact), strict=True):
                arm[part] = rests
            if part.stop < count:
                yield part.stop / count

        def again(chosen: np.ndarray, lift: Floats) -> tuple[Poses, list[Floats]]:
            """Some frames anew, with arms raised; others are left as they are."""
            known = (tuple(each[:, :, chosen] for each in of) for of in (asked, added))
            higher = Raise(lift, *known)
            stood = standing.pose(travel, chosen, places, higher)
            posed.late[np.ix_(chosen, higher.arms)] = stood.misses[:, higher.arms]
            poses = Poses(stood.rotations, stood.strains, going[0][chosen], going[1][chosen])
            return poses, standing.walk.by_arm(stood.joints, higher)

        asked, added = (
            [np.concatenate(each, axis=2) for each in zip(*of, strict=True)]
            for of in (shapes, evened)
        )
        frames = frames_of_arms(self.skeleton, self.arms, self.body)
        course = ArmsOverGround(frames, standing.ground, self.scale, cyclic=self.in_place)
        together = [np.concatenate(each) for each in zip(*joints, strict=True)]
        whole = Poses(posed.rotations, posed.strains, *going)
        raised = raise_between_frames(course, whole, together, again)
        posed.rotations, posed.strains = raised.rotations, raised.strains

    def _steady(self) -> SwingSmoothing | None:
        """How arms in the air are evened out over time, if at all."""
        return SwingSmoothing.over(
            self.generator.settings.smoothing_cycles, self.every * self.cycle
        )

    def _reach(self, posed: _Posed) -> np.ndarray:
        """Let arms reach; which of them do (frames, arms)."""
        if self.reaching is None:
            return np.zeros(posed.late.shape, dtype=bool)
        assert self.locations is not None
        assert self.orientations is not None
        travelling = Travelling(self.locations, self.orientations, self.scale)
        before = posed.rotations.copy()
        reached = self.reaching.apply(self.frames, posed.rotations, travelling, posed.strains)
        self.reached, self.carried = reached
        return self._let_go(np.any(posed.rotations != before, axis=-1), posed)

    def _part(self, posed: _Posed, busy: np.ndarray, going: tuple[Floats, Floats]) -> None:
        """Let arms make way for each other, but for those that are busy (frames, arms)."""
        if self.apart is None or not self.keep_apart:
            return
        too_many = self.apart.too_many(len(self.moments))
        if too_many:
            self.warnings.append(too_many)
            return
        moved = separate_arms(
            replace(self.apart.bulk, opened=self._opened()),
            posed.rotations,
            posed.strains,
            in_contact=posed.lying,
            busy=busy,
            travel=going,
            ground=self._ground(),
            scale=self.scale,
            frames_per_cycle=self.every * self.cycle,
            cyclic=self.in_place,
        )
        if moved is not None:
            posed.rotations = moved

    def _opened(self) -> Opened | None:
        """Where arms stand round a body that swims as it lies, none if it never does."""
        known = [self.generator]
        if self.changing is not None:
            known = [way.generator for way in self.changing.ways]
        lying = next((each for each in known if each.settings.swim_lean), None)
        if lying is None:
            return None
        share = np.ones(len(self.moments)) if self.swimming is None else self.swimming
        return Opened(lying.opens_to, share)

    def _look(self, posed: _Posed, going: tuple[Floats, Floats]) -> None:
        """Look where arms overlap, and keep what figures are taken from."""
        separation, every = None, 1
        if self.apart is not None and self.tell_overlaps:
            separation, every = self.apart.measure(posed.rotations, posed.strains)
            self.overlaps = self.apart.told(separation, every, self.frames)
        if not self.measure:
            return
        poses = Poses(posed.rotations, posed.strains, *going)
        self.measured = Measured(
            frames=self.frames,
            arms=frames_of_arms(self.skeleton, self.arms, self.body),
            names=[arm.name for arm in self.arms],
            poses=poses,
            misses=np.maximum(posed.late, posed.misses),
            scale=self.scale,
            ground=self._ground(),
            lying=posed.lying,
            cycles=posed.cycles,
            separation=separation,
            every=every,
            halfway=halfway_automatic(poses, cyclic=self.repeats),
        )

    def _tell_quality(self) -> None:
        """Measure what the keys play, where figures are wanted."""
        if self.measured is None:
            return
        if self.few is not None:
            rig = KeyedRig(
                armature=_local_object(self.armature),
                skeleton=self.skeleton,
                arms=[arm.bones for arm in self.arms],
                travels=not self.in_place,
                root_bone=self.root_bone,
                world=self.world,
            )
            self.measured = measure_keyed(self.measured, rig, self.few)
        self.figures = figures(self.measured)

    def _reduce(self) -> Iterator[float]:
        """Find keys with handles of their own, in steps that yield the share that is done."""
        armature = _local_object(self.armature)
        body = Body(*(armature, self.scale, self.skeleton, self.arms, self.mantle, self.root_bone))
        exact = Tolerances(_EXACT_ANGLE, _EXACT_DISTANCE * self.generator.arm_length)
        steps = reduced(
            self.moments,
            body,
            self._motion(armature),
            self.tolerances or exact,
            every=self.every,
            dense=self.tolerances is None,
            loops=self.in_place,
        )
        while True:
            try:
                share = next(steps)
            except StopIteration as finished:
                self.few = finished.value
                return
            yield share

    def _let_go(self, moved: np.ndarray, posed: _Posed) -> np.ndarray:
        """Note that arms which reach hold no ground and follow no gait.

        Returns:
            Which arms (frames, arms) these are.

        Args:
            moved: (frames, bones) which bones reach.
            posed: the arms; changed in place.
        """
        start, busy = 0, np.zeros(posed.late.shape, dtype=bool)
        for number, arm in enumerate(self.arms):
            own = moved[:, start : start + len(arm.bones)]
            start += len(arm.bones)
            posed.lying[number][:, 1:] &= ~np.logical_or.accumulate(own, axis=1)
            reaches = own.any(axis=1)
            posed.late[reaches, number] = posed.misses[reaches, number] = 0.0
            busy[:, number] = reaches
        return busy

    def _ground(self) -> Ground | None:
        """What the arms stand on, where they do."""
        return next((each.ground for each in self._stands()), None)

    def _stands(self) -> list[Standing]:
        """What holds the ground, of every way that does."""
        ways = self.changing.ways if self.changing is not None else ()
        return [each for each in (self.standing, *(way.standing for way in ways)) if each]

    def write(self, *, unedited: bool = False) -> Summary:
        """Give the armature its action, in place of the one that was generated before.

        Args:
            unedited: whether it is known already that the one before may be made anew.

        Raises:
            WriteError: the object is gone, or has become read-only.
        """
        armature = _local_object(self.armature)
        writable_armature(armature)
        settings = locomotion_settings(armature)
        channels = self._channels(armature)
        previous = previous_action(armature, settings)
        left_behind = animated_bones(previous) if previous is not None else set[str]()
        scaled = animated_bones(previous, SCALE) if previous is not None else set[str]()
        # An arm that was switched off is left to the artist, in the pose that it has.
        for item in settings.arms:
            left_behind.difference_update(() if item.enabled else bones_of(item))
        # The settings' own pointer must not count as a user when it comes to saving an edited
        # action from being purged.
        settings.result = None
        try:
            action = write_action(
                armature,
                f"{armature.name} Locomotion",
                self.frames,
                channels,
                previous=previous,
                settings_note=self.note,
                repeats=self.repeats,
                replaceable=unedited,
                automatic=self.few is None,
            )
        except WriteError:
            settings.result = previous
            raise
        settings.result = action
        if self.detection is not None:
            # What was moved is what the list shows from now on.
            write_arms(settings, self.detection.arms)
            write_body(settings, self.detection)
        rest_bones(armature, left_behind - animated_bones(action))
        unscale_bones(armature, scaled - animated_bones(action, SCALE))
        if self.standing is not None and self.changing is None and not self.in_place:
            store(settings.ground, self.wanted)
            if settings.ground.shown:
                show_contacts(armature, self)
        write_carried(armature, self.carried)
        write_figures(settings, self.figures)
        notes = self._extend_range()
        keys, dense_keys = key_counts(action)
        assert self.misses is not None
        return Summary(
            gait=self.gait.name,
            manner=self.gait.manner,
            action=action.name,
            frames=len(self.frames),
            frame_start=int(self.frames[0]),
            frame_end=int(self.frames[-1]),
            seconds=self.seconds,
            miss=float(self.misses.max()),
            keys=keys,
            dense_keys=dense_keys,
            warnings=(*self.warnings, *self._missed(), *self.overlaps),
            figures=self.figures,
            notes=(*notes, *self.reached),
        )

    def _channels(self, armature: bpy.types.Object) -> list[Channel]:
        few = self.few if self.few is not None else self._motion(armature).all()
        return [*few, *self.breath]

    def _motion(self, armature: bpy.types.Object) -> Motion:
        """What was computed, as channels with a key at every moment."""
        moving = self.moving
        assert moving is not None
        held = np.tile(self.mantle_rotations, (len(self.moments), 1, 1))
        if moving.swimming is not None:
            rest = np.broadcast_to(IDENTITY, held.shape)
            held = slerp(rest, held, np.repeat(moving.swimming[:, None], held.shape[1], axis=1))
        if self.in_place and not self.root_bone:
            travel = []
        elif self.root_bone:
            locations, rotations = root_bone_transforms(
                self.skeleton, self.root_bone, self.world, moving.locations, moving.orientations
            )
            travel = [
                location_channel(armature, self.root_bone, locations),
                *rotation_channels(armature, [self.root_bone], rotations[:, None]),
            ]
        else:
            travel = object_channels(armature, moving.locations, moving.orientations)
        return Motion(
            travel=travel,
            arms=rotation_channels(armature, self.generator.bones, moving.rotations),
            mantle=rotation_channels(armature, self.mantle, held),
            stretch=self._stretch(armature, moving.strains),
            lying=moving.lying if self._ground() is not None else (),
        )

    def _in_place(self) -> tuple[Floats, Floats]:
        """Locations (frames, 3) and orientations (frames, 4) of an armature that stays.

        Its origin is taken to be on the ground; a root bone lifts a walking body to its height.
        """
        up = self.body.rotation[:, 2]
        lift = self.height / self.scale - float(self.body.center @ up)
        raised = lift * up if self.root_bone and self.gait.on_ground else 0.0 * up
        location = self.world[:3, 3] + self.world[:3, :3] @ raised
        orientation = from_matrix(self.world[:3, :3] / self.scale)
        count = len(self.moments)
        return np.tile(location, (count, 1)), np.tile(orientation, (count, 1))

    def _stretch(self, armature: bpy.types.Object, strains: Floats) -> list[Channel]:
        # A swim that becomes a walk stretches there.
        if not any(each.stretching for each in self._stands()):
            return []
        return stretch_channels(armature, [arm.bones for arm in self.arms], strains)

    def _missed(self) -> list[str]:
        assert self.misses is not None
        assert self.out_of_reach is not None
        if self.out_of_reach.max() > MISS:
            frame, arm = np.unravel_index(self.out_of_reach.argmax(), self.out_of_reach.shape)
            # Bones that may not get longer do not, whatever Stretch is.
            longer = any(each.stretching for each in self._stands())
            remedy = "raise Stretch" if longer else "lower Height"
            first = "Drag its marker nearer" if self._dragged(int(arm)) else "Lower Hold"
            told = (
                f"'{self.arms[arm].name}' slides at frame {self.frames[frame]:.0f}: its contact is "
                f"{self.out_of_reach[frame, arm]:.2g} arm lengths out of reach. {first}, "
                f"{remedy} or shorten the stride."
            )
            return [told]
        misses = self.misses.max(axis=0)
        worst = int(misses.argmax())
        if misses[worst] <= MISS:
            return []
        many = int((misses > MISS).sum())
        told = (
            f"{many} of {len(self.arms)} arms cannot follow the gait everywhere: "
            f"'{self.arms[worst].name}' stays {misses[worst]:.2g} arm lengths away."
        )
        return [told]

    def _dragged(self, arm: int) -> bool:
        """Whether a contact of an arm is where the artist has put it."""
        name = self.arms[arm].name
        return any(
            wish.position is not None for (whose, _), wish in self.wanted.items() if whose == name
        )

    def _extend_range(self) -> tuple[str, ...]:
        scene = bpy.data.scenes.get(self.scene)
        last = int(self.frames[-1])
        if scene is None or last <= scene.frame_end:
            return ()
        if self.extend_scene_range and scene.is_editable:
            scene.frame_end = last
            return (f"The scene now ends at frame {last}.",)
        return (f"It lasts to frame {last}, the scene ends at {scene.frame_end}.",)


def show_contacts(armature: bpy.types.Object, shot: Shot) -> int:
    """Put markers where a shot's contacts are; how many."""
    assert shot.standing is not None
    settings = locomotion_settings(armature).ground
    store(settings, shot.wanted)
    travel = plan_travel(shot.route, shot.travel, shot.times, shot.standing.bearings)
    # The first of equal phases, where the body stands still, is as good as any.
    phases, first = np.unique(travel.phase, return_index=True)
    frames = shot.frames[first]
    contacts = []
    for each in shot.standing.walk.footholds():
        name = shot.arms[each.arm].name
        wish = shot.wanted.get((name, each.cycle), ContactEdit())
        on, off = np.interp([each.touch_down, each.lift_off], phases, frames)
        contacts.append(
            Contact(
                name,
                each.cycle,
                each.position,
                each.heading,
                locked=wish.position is not None,
                shift=wish.shift,
                frame_on=float(on),
                frame_off=float(off),
                cycle_frames=float(off - on) / each.lasts,
            )
        )
    length = shot.generator.arm_length * shot.scale
    write_markers(armature, contacts, length, once_called(settings))
    note_shown(settings, armature, contacts)
    return len(contacts)


def _local_object(name: str) -> bpy.types.Object:
    try:
        return bpy.data.objects[name, None]  # type: ignore[index]
    except KeyError:
        raise WriteError(f"'{name}' is gone.", "Generate again.") from None


def _with_halves(values: Floats) -> Floats:
    """Values (frames,) with those half way in between (2 frames − 1,)."""
    result = np.empty(2 * len(values) - 1)
    result[::2], result[1::2] = values, 0.5 * (values[:-1] + values[1:])
    return result
