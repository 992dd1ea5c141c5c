# SPDX-License-Identifier: GPL-3.0-or-later
"""A motion that was worked out, written: the action, markers, figures and what is carried."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy

from ....blender.animation import (
    SCALE,
    animated_bones,
    key_counts,
    rest_bones,
    unscale_bones,
    writable_armature,
    write_action,
)
from ....blender.scene import Contact, write_markers
from ....core.errors import WriteError
from ....core.locomotion.motion import (
    MotionJob,
    MotionPlan,
    MotionResult,
    compute,
    plan_motion,
    shown_contacts,
)
from ....core.locomotion.rig import Detection
from ..reading import bones_of, previous_action, write_arms, write_body
from ..settings import (
    ContactEdit,
    OCTO_MOTION_PG_locomotion,
    Place,
    locomotion_settings,
    note_shown,
    once_called,
    store,
    write_figures,
)
from .carried import write_carried
from .summary import Summary


@dataclass(eq=False)
class Shot:
    """A motion of one armature: what it is made from, and what is written when it is there.

    Armature and scene are kept by name: references to Blender's data do not outlive a modal
    operator's tick.
    """

    armature: str
    scene: str
    job: MotionJob
    detection: Detection | None
    """What was found, if the settings had no arms."""
    edits: dict[Place, ContactEdit]
    """What the artist wants of single contacts."""
    extend_scene_range: bool
    note: str
    """The settings as JSON, kept with the action."""
    result: MotionResult | None = None
    """What :meth:`compute` has come to."""

    def compute(self) -> Iterator[float]:
        """Do the work in steps, yielding the share that is done: 0…1, 1 at the end."""
        self.result = yield from compute(self.job)

    def plan(self) -> MotionPlan:
        """What is computed, without computing it.

        Raises:
            OctoMotionError: something is wrong that the user can put right.
        """
        steps = plan_motion(self.job)
        while True:
            try:
                next(steps)
            except StopIteration as finished:
                return finished.value

    def write(self, *, unedited: bool = False) -> Summary:
        """Give the armature its action, in place of the one that was generated before.

        Args:
            unedited: whether it is known already that the one before may be made anew.

        Raises:
            WriteError: the object is gone, or has become read-only.
        """
        made = self.result
        assert made is not None
        armature = _local_object(self.armature)
        writable_armature(armature)
        settings = locomotion_settings(armature)
        action = self._write_action(armature, settings, made, unedited=unedited)
        if self.detection is not None:
            # What was moved is what the list shows from now on.
            write_arms(settings, self.detection.arms)
            write_body(settings, self.detection)
        if made.plan.keeps_contacts:
            store(settings.ground, self.edits)
            if settings.ground.shown:
                show_contacts(armature, made.plan, self.edits)
        write_carried(armature, made.carried)
        write_figures(settings, made.figures)
        notes = self._extend_range(int(made.frames[-1]))
        keys, dense_keys = key_counts(action)
        return Summary(
            gait=made.plan.first.table.name,
            manner=made.plan.first.table.manner,
            action=action.name,
            frames=len(made.frames),
            frame_start=int(made.frames[0]),
            frame_end=int(made.frames[-1]),
            seconds=made.plan.schedule.seconds,
            miss=made.miss,
            keys=keys,
            dense_keys=dense_keys,
            warnings=made.warnings,
            figures=made.figures,
            notes=(*notes, *made.notes),
        )

    def _write_action(
        self,
        armature: bpy.types.Object,
        settings: OCTO_MOTION_PG_locomotion,
        made: MotionResult,
        *,
        unedited: bool,
    ) -> bpy.types.Action:
        """Write the keys, and lay to rest what the action before moved and this one does not."""
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
                made.frames,
                made.channels,
                previous=previous,
                settings_note=self.note,
                repeats=self.job.repeats,
                replaceable=unedited,
                automatic=made.automatic,
            )
        except WriteError:
            settings.result = previous
            raise
        settings.result = action
        rest_bones(armature, left_behind - animated_bones(action))
        unscale_bones(armature, scaled - animated_bones(action, SCALE))
        return action

    def _extend_range(self, last: int) -> tuple[str, ...]:
        """Let the scene end with the motion, if that is wanted; what there is to say of it."""
        scene = bpy.data.scenes.get(self.scene)
        if scene is None or last <= scene.frame_end:
            return ()
        if self.extend_scene_range and scene.is_editable:
            scene.frame_end = last
            return (f"The scene now ends at frame {last}.",)
        return (f"It lasts to frame {last}, the scene ends at {scene.frame_end}.",)


def show_contacts(
    armature: bpy.types.Object, plan: MotionPlan, edits: dict[Place, ContactEdit]
) -> int:
    """Put markers where a motion's contacts are; how many.

    Args:
        armature: whose they are.
        plan: of a motion that has contacts.
        edits: the artist's.
    """
    settings = locomotion_settings(armature).ground
    store(settings, edits)
    contacts = []
    for each in shown_contacts(plan):
        edit = edits.get((each.arm, each.cycle), ContactEdit())
        contacts.append(
            Contact(
                each.arm,
                each.cycle,
                each.position,
                each.heading,
                locked=edit.position is not None,
                shift=edit.shift,
                frame_on=each.frame_on,
                frame_off=each.frame_off,
                cycle_frames=each.cycle_frames,
            )
        )
    length = plan.first.poser.arm_length * plan.job.creature.scale
    write_markers(armature, contacts, length, once_called(settings))
    note_shown(settings, armature, contacts)
    return len(contacts)


def _local_object(name: str) -> bpy.types.Object:
    try:
        return bpy.data.objects[name, None]  # type: ignore[index]
    except KeyError:
        raise WriteError(f"'{name}' is gone.", "Generate again.") from None
