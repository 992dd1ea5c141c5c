# SPDX-License-Identifier: GPL-3.0-or-later
"""One shot from settings to keys: read → plain arrays → compute → write."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import bpy
import numpy as np

from ....blender.animation import (
    CYCLES,
    HalfWritten,
    curves_of,
    edit_layer,
    follow,
    key_counts,
    play_bones,
    posed_channels,
    read_object_channels,
    rest_channel,
    rest_properties,
    unedited_with_note,
    writable_armature,
    write_action,
)
from ....blender.rig import bone_and_property, may_play_otherwise, read_skeleton, world_matrix
from ....blender.scene import CARRIED, Contact, put_back, read_route, write_markers
from ....core.errors import RouteError, WriteError
from ....core.keyframes import Channel
from ....core.locomotion.metrics import (
    Figure,
    Played,
    finding_figures,
    played_arm,
    warnings_for_figures,
)
from ....core.locomotion.motion import (
    MotionJob,
    MotionPlan,
    MotionResult,
    compute,
    in_bends,
    plan_motion,
    schedule,
    shown_contacts,
)
from ....core.locomotion.reaching import Carried
from ....core.phrases import as_phrase, joined_phrases, phrase
from ....core.rotations import Floats
from ....core.steps import finished
from ...declared_settings import assign, plain
from ..reading import (
    RigRead,
    bones_of,
    playing_action,
    previous_action,
    read_body,
    read_changes,
    read_creature,
    read_floor,
    read_gaits,
    read_given_poses,
    read_ground,
    read_look,
    read_moving,
    read_reaches,
    read_timing,
    read_volume,
    tolerances_of,
    warnings_for_display,
    write_arms,
    write_body,
)
from ..settings import (
    ContactEdit,
    OCTO_MOTION_PG_locomotion,
    Place,
    locomotion_settings,
    note_shown,
    once_called,
    read_overrides,
    store,
    write_figures,
)

_PLAYING: Final = 0.7
"""Share of the work that it takes to play a motion through, where that has to be."""
_AT_ONCE: Final = 0.2
"""Seconds that it is played for before one looks whether it is to go on."""


@dataclass(frozen=True)
class Summary:
    """What was made, for people and for reports."""

    gait: str
    manner: str
    """"WALK" or "SWIM"."""
    action: str
    """Name of the action."""
    frames: int
    frame_start: int
    frame_end: int
    seconds: float
    """Length of the motion."""
    lasts: float
    """Seconds from its first key to its last."""
    miss: float
    """Largest distance of a group of joints from its target, in arm lengths."""
    keys: int
    dense_keys: int
    """How many keys there would be with one per frame."""
    warnings: tuple[str, ...] = ()
    figures: tuple[Figure, ...] = ()
    """The worst of each kind."""
    notes: tuple[str, ...] = ()
    """Things that happened as they should, but that one may want to know."""

    @property
    def message(self) -> str:
        """One sentence, and the notes."""
        told = phrase(
            "{gait} of {frames} frames ({lasts:.1f} s): '{action}'.",
            gait=as_phrase(bpy.path.display_name(self.gait)),
            frames=self.frames,
            lasts=self.lasts,
            action=self.action,
        )
        fewer = phrase(
            "{keys:,} keys instead of {dense_keys:,}.", keys=self.keys, dense_keys=self.dense_keys
        )
        return joined_phrases(
            " ", (told, fewer if self.keys < self.dense_keys else "", *self.notes)
        )


# --- Objects that arms carry: the keys of their ways ----------------------------------------------


def write_carried(armature: bpy.types.Object, carried: Sequence[Carried]) -> None:
    """Give objects the keys of their ways; those that they got before are made anew.

    What is no longer carried loses them, and stands where it stood before.

    Raises:
        WriteError: an object has become read-only.
    """
    note = CARRIED.format(armature.name)
    still = {each.target for each in carried}
    for target in unedited_with_note(note):
        if target.name not in still:
            put_back(target)
    for each in carried:
        target = bpy.data.objects.get(each.target)
        if target is None:
            continue
        data = target.animation_data
        write_action(
            target,
            f"{target.name} Carried",
            each.frames,
            read_object_channels(target).channels(each.positions, each.rotations),
            previous=data.action if data is not None else None,
            settings_note=note,
        )


# --- A motion that was worked out, written: the action, markers, figures and what is carried ------


@dataclass(eq=False)
class Shot:
    """A motion of one armature: what it is made from, and what is written when it is there.

    Armature and scene are kept by name: references to Blender's data do not outlive a modal
    operator's tick.
    """

    armature: str
    scene: str
    job: MotionJob
    rig: RigRead
    """The rig as it was read; with it comes what was found, if the settings had no arms."""
    edits: dict[Place, ContactEdit]
    """What the artist wants of single contacts."""
    extend_scene_range: bool
    note: str
    """The settings as JSON, kept with the action; "" for live until there is time for it."""
    result: MotionResult | None = None
    """What :meth:`compute` has come to."""
    summary: Summary | None = None
    """What :meth:`write` has made …"""
    told: tuple[str, ...] = ()
    """… and what there is to know of the poses that it found."""
    seed: int | None = None
    """The seed that it was made with, if its settings may have another."""

    def compute(self, *, brief: bool = False) -> Iterator[float]:
        """Do the work in steps, brief ones or not, yielding the share that is done: 0…1, 1 at the
        end.
        """
        self.result = yield from compute(self.job, brief=brief)

    def plan(self) -> MotionPlan:
        """What is computed, without computing it.

        Raises:
            OctoMotionError: something is wrong that the user can put right.
        """
        return finished(plan_motion(self.job))

    def write(self, *, unedited: bool = False, filled: HalfWritten | None = None) -> Summary:
        """Give the armature its action, in place of the one that was generated before.

        Unedited, it is known already that the one before may be made anew, and what is filled of it
        already is written.

        Raises:
            WriteError: the object is gone, or has become read-only.
        """
        made = self.result
        assert made is not None
        armature = bpy.data.objects.get((self.armature, None))
        if armature is None:
            raise WriteError(
                phrase("'{armature}' is gone.", armature=self.armature), "Generate again."
            )
        writable_armature(armature)
        settings = locomotion_settings(armature)
        action = self._write_action(armature, settings, made, unedited=unedited, filled=filled)
        if self.seed is not None:
            assign(settings, "seed", self.seed)
        if self.rig.detection is not None:
            # What was moved is what the list shows from now on.
            write_arms(settings, self.rig.detection.arms)
            write_body(settings, self.rig.detection)
        if made.plan.keeps_contacts:
            store(settings.ground, self.edits)
            if settings.ground.shown:
                show_contacts(armature, made.plan, self.edits)
        write_carried(armature, made.carried)
        write_figures(settings, made.figures)
        notes = self._extend_range(settings, int(made.frames[-1]))
        keys, dense_keys = key_counts(action)
        self.summary = Summary(
            gait=made.plan.first.table.name,
            manner=made.plan.first.table.manner,
            action=action.name,
            frames=len(made.frames),
            frame_start=int(made.frames[0]),
            frame_end=int(made.frames[-1]),
            seconds=made.plan.schedule.seconds,
            lasts=float(made.frames[-1] - made.frames[0]) / self.job.timing.rate,
            miss=made.miss,
            keys=keys,
            dense_keys=dense_keys,
            warnings=(*made.warnings, *warnings_for_figures(made.figures)),
            figures=made.figures,
            notes=(*notes, *self.told, *made.notes),
        )
        return self.summary

    def measure(self) -> Iterator[float]:
        """Take the figures from what plays, where that may be something else than was written.

        Yields the share that is done; the scene is as it was found between any two steps.
        """
        made = self.result
        if made is None or made.measured is None or not self.plays_otherwise():
            return
        if made.plan.carry is not None:
            # Figures are of the ground as it was planned on.
            return
        arms = self.job.creature.arms
        names = [name for arm in arms for name in arm.bones]
        starts = np.cumsum([len(arm.bones) for arm in arms])[:-1]
        moments = made.measured.moments
        parts: list[list[tuple[Floats, Floats]]] = []
        done = 0
        while done < len(moments):
            armature = bpy.data.objects.get((self.armature, None))
            if armature is None:
                return
            skeleton = read_skeleton(armature)
            matrices = play_bones(armature, names, moments[done:], _AT_ONCE)
            if len(matrices) == 0:
                return
            parts.append(
                [
                    played_arm(own, skeleton.lengths[skeleton.index[arm.bones[-1]]])
                    for arm, own in zip(arms, np.split(matrices, starts, axis=1), strict=True)
                ]
            )
            done += len(matrices)
            yield done / len(moments)
        joints, orientations = (
            [np.concatenate([part[number][which] for part in parts]) for number in range(len(arms))]
            for which in range(2)
        )
        played = replace(made.measured, played=Played(joints, orientations))
        self._measured((yield from finding_figures(played)))

    def _measured(self, found: tuple[Figure, ...]) -> None:
        """Let these be the figures of what was written."""
        assert self.result is not None
        assert self.summary is not None
        write_figures(locomotion_settings(bpy.data.objects[self.armature, None]), found)  # type: ignore[index]
        warnings = (*self.result.warnings, *warnings_for_figures(found))
        self.summary = replace(self.summary, figures=found, warnings=warnings)

    def plays_otherwise(self) -> bool:
        """Whether more than keys moves the arms."""
        armature = bpy.data.objects.get((self.armature, None))
        names = [name for arm in self.job.creature.bones for name in arm]
        return armature is not None and may_play_otherwise(armature, names)

    def _write_action(
        self,
        armature: bpy.types.Object,
        settings: OCTO_MOTION_PG_locomotion,
        made: MotionResult,
        *,
        unedited: bool,
        filled: HalfWritten | None,
    ) -> bpy.types.Action:
        """Write the keys, and lay to rest what the action before moved and this one does not."""
        previous = previous_action(armature, settings)
        layer = edit_layer(armature, previous) if previous is not None else None
        cycles = list(previous.get(CYCLES, ())) if previous is not None else []
        before = {previous}
        if not settings.keep_pose and layer is None:
            # Whoever made it: its pose of one frame is nobody's.
            before.add(playing_action(armature))
        old = [action for action in before if action is not None]
        # An arm that was switched off is left to the artist, in the pose that it has.
        left = {bone for item in settings.arms if not item.enabled for bone in bones_of(item)}
        passing = {curve.data_path for action in old for curve in curves_of(action)}
        passing = {path for path in passing if bone_and_property(path)[0] not in left}
        channels = made.channels
        if not settings.keep_pose:
            # What lies over the motion is no pose.
            over = {curve.data_path for curve in curves_of(layer)} if layer is not None else set()
            channels = [*channels, *self._at_rest(armature, made, passing | over, old)]
        # The settings' own pointer must not count as a user when it comes to saving an edited
        # action from being purged.
        settings.result = None
        try:
            action = write_action(
                armature,
                f"{armature.name} Locomotion",
                made.frames,
                channels,
                previous=previous,
                settings_note=self.note,
                repeats=self.job.repeats,
                replaceable=unedited,
                automatic=made.automatic,
                beneath=layer is not None,
                filled=filled,
            )
        except WriteError:
            settings.result = previous
            raise
        settings.result = action
        action[CYCLES] = _passed_quarters(made)
        if layer is not None:
            assert previous is not None
            follow(armature, layer, (previous, action), cycles)
        rest_properties(armature, passing - {each.data_path for each in channels})
        return action

    def _at_rest(
        self,
        armature: bpy.types.Object,
        made: MotionResult,
        passing: set[str],
        old: Sequence[bpy.types.Action],
    ) -> list[Channel]:
        """Channels of what carries the arms, and of the mantle, that would stay in some pose.

        What passing paths lead to goes back to rest by itself: it was moved by old actions.
        """
        creature, keyed = self.job.creature, {each.data_path for each in made.channels}
        numbers = [creature.skeleton.index[name] for arm in creature.bones for name in arm]
        carrying = {each for number in numbers for each in creature.skeleton.ancestors(number)}
        names = [creature.skeleton.names[each] for each in sorted({*numbers, *carrying})]
        names += [*made.plan.schedule.head, creature.root_bone]
        found = [
            rest_channel(armature, *each, made.frames, few=self.job.tolerances is not None)
            for each in posed_channels(armature, names, passing=passing, own=old)
        ]
        found = [each for each in found if each.data_path not in keyed]
        if bones := sorted({each.group for each in found}):
            told = phrase(
                "'{bone}' is posed, and keyed at rest; Keep Pose lets that pose count."
                if len(bones) == 1
                else "'{bone}' and {count} more bones are posed, and keyed at rest; Keep Pose lets "
                "that pose count.",
                bone=bones[0],
                count=len(bones) - 1,
            )
            self.told = (told,)
        return found

    def _extend_range(self, settings: OCTO_MOTION_PG_locomotion, last: int) -> tuple[str, ...]:
        """Let the scene end with the motion, if that is wanted; what there is to say of it."""
        scene = bpy.data.scenes.get(self.scene)
        if scene is None:
            return ()
        if not (self.extend_scene_range and scene.is_editable):
            over = last > scene.frame_end
            told = phrase(
                "It lasts to frame {last}, the scene ends at {end}.", last=last, end=scene.frame_end
            )
            return (told,) if over else ()
        before = scene.frame_end
        # What it was extended for itself is taken back, unless somebody has changed it since.
        own = before if before != settings.extended_to else settings.extended_from
        scene.frame_end = max(own, last)
        assign(settings, "extended_from", own)
        assign(settings, "extended_to", scene.frame_end if last > own else 0)
        changed = scene.frame_end != before
        return (
            (phrase("The scene now ends at frame {end}.", end=scene.frame_end),) if changed else ()
        )


def _passed_quarters(made: MotionResult) -> list[float]:
    """Frames at which the gait passes quarters of its cycles."""
    # Not by np.unique, whose first call imports numpy's masked arrays.
    order = np.argsort(made.phase, kind="stable")
    first = order[np.diff(made.phase[order], prepend=-np.inf) > 0.0]
    phases = made.phase[first]
    wanted = 0.5 * np.pi * np.arange(np.floor(phases[-1] / (0.5 * np.pi)) + 1.0)
    return np.interp(wanted, phases, made.frames[first]).tolist()


def show_contacts(
    armature: bpy.types.Object, plan: MotionPlan, edits: dict[Place, ContactEdit]
) -> int:
    """Put markers where a motion's contacts are, with the artist's edits; how many."""
    settings = locomotion_settings(armature).ground
    store(settings, edits)
    contacts = []
    for each in shown_contacts(plan):
        edit = edits.get((each.arm, each.cycle), ContactEdit())
        locked = edit.position is not None
        contacts.append(Contact(**vars(each), locked=locked, shift=edit.shift))
    length = plan.first.poser.arm_length * plan.job.creature.scale
    write_markers(armature, contacts, length, once_called(settings))
    note_shown(settings, armature, contacts)
    return len(contacts)


RESULTS: Final = frozenset(
    {
        *("result", "shown", "figures", "live", "live_error", "show_targets"),
        *("extended_from", "extended_to", "file_knows"),
    }
)
"""What is no setting, though it is kept with them."""


def make(shots: Sequence[Shot]) -> Iterator[float]:
    """Compute all shots, write them, and measure what plays, yielding the share that is done: 0…1.

    Raises:
        OctoMotionError: something is wrong that the user can put right; nothing has changed.
    """
    count = len(shots)
    computing = 1.0 - _PLAYING * any(shot.plays_otherwise() for shot in shots)
    for number, shot in enumerate(shots):
        for share in shot.compute():
            yield computing * (number + share) / count
    for shot in shots:
        shot.write()
    for number, shot in enumerate(shots):
        for share in shot.measure():
            yield computing + (1.0 - computing) * (number + share) / count


def generate_locomotion(armature: bpy.types.Object, context: bpy.types.Context) -> Summary:
    """Prepare, compute and write in one go.

    Raises:
        OctoMotionError: something is wrong that the user can put right; nothing has changed.
    """
    shot = prepare(armature, context)
    for _ in make([shot]):
        pass
    assert shot.summary is not None
    return shot.summary


@dataclass(frozen=True, eq=False)
class Before:
    """What was read for the motion before, and what of it Blender says is still so."""

    shot: Shot
    rig: bool = False
    """The rig with its skin, and all settings that hang on it."""
    ground: bool = False
    """The ground's mesh."""
    all_else: bool = False
    """All but the route."""

    @property
    def ground_stays(self) -> bool:
        """Whether the ground is as it was at any frame."""
        ground = self.shot.job.ground
        return self.ground and ground is not None and ground.moving is None


# In one piece, for it is all that is read, one thing after the other.
def prepare(
    armature: bpy.types.Object,
    context: bpy.types.Context,
    *,
    live: bool = False,
    before: Before | None = None,
) -> Shot:
    """Read all that the motion of an armature needs. Nothing is changed, nothing worked out.

    Live, it is to be quick: the same with a key on every frame, and no figures of how good it is;
    what is known to be as it was before is not read again.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """
    settings = locomotion_settings(armature)
    writable_armature(armature)
    scene = context.scene
    assert scene is not None
    in_place = settings.travel_on == "NONE"
    _check_route(settings, armature)
    _write_back(settings.route, settings.ground.object)
    depsgraph = context.evaluated_depsgraph_get()
    last = before.shot.job if before is not None else None
    same_rig = last if before is not None and before.rig else None
    same_ground = last if before is not None and before.ground_stays else None
    found = (
        before.shot.rig
        if before is not None and before.rig
        else read_creature(armature, settings, world_matrix(armature))
    )
    creature, edits = found.creature, read_overrides(settings.ground, armature)
    changes, names = read_changes(settings.change, settings.gait, in_place=in_place)
    gaits = read_gaits(settings, names)
    walks = any(each.settings.gait.on_ground for each in gaits)
    begin, end = read_given_poses(armature, settings, creature)
    job = MotionJob(
        creature=creature,
        in_place=in_place,
        route=None if in_place else read_route(settings.route, depsgraph, settings.spline),
        cycles=settings.cycles,
        repeats=in_place and settings.repeat and not (begin or end),
        gaits=gaits,
        changes=changes,
        timing=read_timing(settings, scene.render),
        height=settings.height if settings.height_mode == "MANUAL" else None,
        streamline=settings.streamline,
        body=read_body(settings, creature, same_rig.body.organs if same_rig else None),
        ground=read_ground(
            *(settings, armature, depsgraph, creature, edits),
            walks=walks,
            same_rig=same_rig.ground if same_rig else None,
            same_mesh=same_ground.ground if same_ground else None,
        ),
        floor=read_floor(
            *(settings, armature, depsgraph, creature),
            walks=walks,
            same_rig=same_rig.floor if same_rig else None,
            same_mesh=last.floor if last and before and before.ground else None,
        ),
        volume=same_rig.volume
        if same_rig and (live or same_rig.volume is not None)
        else read_volume(settings, armature, creature, live=live),
        keep_apart=settings.keep_apart,
        tell_overlaps=settings.tell_overlaps and not live,
        reaching=None,
        tolerances=None if live else tolerances_of(settings),
        begin=begin,
        end=end,
        live=live,
        warnings=(*found.warnings, *warnings_for_display(armature, scene.render), *found.poses),
    )
    if settings.body.look_at is not None or any(not item.mute for item in settings.reaches):
        frames = schedule(in_bends(job)).frames
        look = replace(job.body, look_at=read_look(settings, armature, frames))
        reaching = read_reaches(armature, settings, found, frames)
        job = replace(job, reaching=reaching, body=look)
    return Shot(
        armature=armature.name,
        scene=scene.name,
        job=job if same_ground else _with_motion_of_ground(job, armature, settings.ground.object),
        rig=found,
        edits=edits,
        extend_scene_range=settings.extend_scene_range,
        note="" if live else note_of(settings),
    )


def note_of(settings: OCTO_MOTION_PG_locomotion) -> str:
    """All settings as text, to be kept with what is made of them."""
    return json.dumps(plain(settings, without=RESULTS), sort_keys=True)


def prepare_anew(
    armature: bpy.types.Object, context: bpy.types.Context, before: Before | None
) -> Shot:
    """The same live, of an armature that may have been read before.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """
    if before is None or not before.all_else:
        return prepare(armature, context, live=True, before=before)
    job, settings = before.shot.job, locomotion_settings(armature)
    read = job.reaching, job.body.look_at, job.begin, job.end
    moves = job.ground is not None and job.ground.moving is not None
    if moves or job.route is None or any(each is not None for each in read):
        # What moves meanwhile is read at the frames of the motion, and poses where they are.
        return prepare(armature, context, live=True)
    _check_route(settings, armature)
    _write_back(settings.route)
    route = read_route(settings.route, context.evaluated_depsgraph_get(), settings.spline)
    return replace(before.shot, job=replace(job, route=route))


def _with_motion_of_ground(
    job: MotionJob, armature: bpy.types.Object, ground: bpy.types.Object | None
) -> MotionJob:
    """The same motion, on ground that moves meanwhile if it does."""
    if job.ground is None or job.ground.mesh is None:
        return job

    def frames() -> Floats:
        return schedule(in_bends(job)).frames

    return replace(job, ground=read_moving(job.ground, armature, ground, frames))


def _write_back(*objects: bpy.types.Object | None) -> None:
    """Let what is being edited count as it is: else it would be one drag behind."""
    for each in objects:
        if each is not None and each.mode == "EDIT":
            each.update_from_editmode()
            assert each.data is not None
            each.data.update_tag()


def _check_route(settings: OCTO_MOTION_PG_locomotion, armature: bpy.types.Object) -> None:
    """A route has to be there; one that its own traveller carries would be elsewhere each time."""
    if settings.route is None and settings.travel_on != "NONE":
        raise RouteError(
            phrase("'{armature}' has no route.", armature=armature.name),
            "Choose a curve as its route, or add one.",
        )
    route = child = settings.route
    while route is not None and child is not None and child.parent is not None:
        carried = settings.travel_on == "OBJECT" or child.parent_type == "BONE"
        if child.parent == armature and carried:
            raise RouteError(
                phrase(
                    "The route '{route}' hangs on '{armature}' and would move with it.",
                    route=route.name,
                    armature=armature.name,
                ),
                "Clear its parent (Alt P).",
            )
        child = child.parent
