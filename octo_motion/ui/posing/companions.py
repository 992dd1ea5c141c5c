# SPDX-License-Identifier: GPL-3.0-or-later
"""What is posed beside a figure's bones in its session, other figures, loose objects and objects
that lead limbs: their keys, and how they were before.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import bpy

from ...blender.animation import (
    Keyed,
    ObjectKeys,
    PoseKeys,
    pose_kept,
    pose_values,
    restore_pose,
    writable_armature,
)
from ...blender.rig import Puppet, bone_materials, is_part_of, puppet_of, read_rig
from ...blender.scene import (
    Company,
    LooseObject,
    check_partner,
    part_of_pose,
    put_transform,
    transform_of,
)
from ...core.errors import OctoMotionError
from ...core.posing.puppet import Elements, Pose, elements_for
from ...core.posing.session import Session
from .properties import STANDS, marked_obstacles, posing_settings
from .recording import ObjectRecording, Recording
from .session_settings import SessionSettings


def company_of(
    armature: bpy.types.Object, partners: Iterable[bpy.types.Object], scene: bpy.types.Scene
) -> Company:
    """An armature's puppet with others, and with the scene's objects that may be pushed about.

    Raises:
        OctoMotionError: one cannot be posed or pushed.
    """
    there = [armature]
    puppets: list[Puppet] = []
    for each in partners:
        check_partner(each, there)
        there.append(each)
    for each in there:
        settings: Any = posing_settings(each)
        puppets.append(puppet_of(each, read_rig(each, smallest=settings.smallest)))
    main: Any = posing_settings(armature)
    unit, things = puppets[0].rig.unit, []
    for item, kind in marked_obstacles(scene) if main.use_obstacles else []:
        own: Any = item
        moves = own.octo_motion.posing.moves
        if moves == STANDS or any(is_part_of(item, each) for each in there):
            continue
        heavy, mass = moves == "MOVES", own.octo_motion.posing.mass
        things.append(LooseObject(item, kind, unit, mass=mass, heavy=heavy))
    return Company(puppets[0], puppets[1:], things)


def elements_beside(company: Company) -> list[Elements]:
    """The joints of other figures, by their own settings, and of things, which have none.

    Raises:
        OctoMotionError: an armature is gone.
    """
    found: list[Elements] = []
    for partner, _ in company.partners_with():
        puppet = partner.puppet
        armature = puppet.armature()
        own, names = bone_materials(armature), puppet.figure.names
        materials = {body: own[name] for body, name in enumerate(names) if name in own}
        settings = SessionSettings.of(armature)
        # As strong as they are by themselves: torques grow with the fourth power of a size.
        strong = elements_for(puppet.figure, *settings.joints, own=materials)
        share = partner.share**4
        found.append(
            Elements(
                share * strong.stiffness,
                share * strong.damping,
                share * strong.flow,
                share * strong.yield_torque,
            )
        )
    return [*found, *(Elements.limp(1) for _ in company.things)]


def hold_partners(company: Company, session: Session) -> None:
    """Pin the roots of other figures, as their own settings say."""
    for partner, span in company.partners_with():
        settings = SessionSettings.of(partner.puppet.armature())
        settings.hold_root(partner.puppet, session, span[0])


class Companions:
    """Other figures and loose objects of a session, from its start to its end.

    Raises:
        OctoMotionError: an armature cannot be keyed.
    """

    def __init__(self, company: Company) -> None:
        self._company = company
        self._keys: list[PoseKeys] = []
        self._values: list[Any] = []
        for partner in company.partners:
            armature = partner.puppet.armature()
            writable_armature(armature)
            settings: Any = posing_settings(armature)
            keys = PoseKeys(armature, settings.keys_to, settings.action, blend=settings.key_blend)
            self._keys.append(keys)
            self._values.append(pose_values(armature))
        self._object_keys = [ObjectKeys(each.found()) for each in company.things]
        self._leads = {
            each.name: (ObjectKeys(each), transform_of(each))
            for puppet in self._puppets()
            for each in puppet.leading()
        }
        """Of objects that lead limbs: their keys, and what they were like at first."""
        self._recordings: list[Recording | ObjectRecording] = []
        self.layered = ""
        """The action of an object with a key on every frame over which the last keys lie, if they
        do."""

    # --- Keys -----------------------------------------------------------------------------------

    def objects_among(self, keyed: Iterable[str]) -> int:
        """How many of those that ``insert`` tells are objects."""
        names = {each.name for each in self._company.things} | self._leads.keys()
        return len(names.intersection(keyed))

    def insert(
        self, bodies: Iterable[int], frame: float, *, auto: bool = False, all_bones: bool = False
    ) -> list[str]:
        """Key those of the bodies that are beside the figure, and the objects that lead limbs; what
        got a key, by its names.
        """
        wanted, done = set(bodies), []
        self.layered = ""
        own = wanted.intersection(self._company.own)
        done += self._insert_leads(self._company.main, own, frame, auto=auto, all_bones=all_bones)
        for (partner, span), keys in zip(self._company.partners_with(), self._keys, strict=True):
            own = [each - span[0] for each in sorted(wanted.intersection(span))]
            puppet = partner.puppet
            if not own and not all_bones:
                continue
            done += self._insert_leads(puppet, own, frame, auto=auto, all_bones=all_bones)
            keyed = [Keyed(*each) for each in puppet.keyed(own, all_bones=all_bones)]
            if not keyed:
                continue
            armature = puppet.armature()
            with pose_kept(armature):
                inserted = keys.insert(armature, keyed, frame, auto=auto)
            done += [f"{puppet.name}: {each}" for each in inserted]
        for (thing, body), keys in zip(self._company.things_with(), self._object_keys, strict=True):
            if body in wanted and self._insert_object(keys, thing.found(), frame, auto=auto):
                done.append(thing.name)
        return done

    def _insert_leads(
        self, puppet: Puppet, bodies: Iterable[int], frame: float, *, auto: bool, all_bones: bool
    ) -> list[str]:
        return [
            each.name
            for each in puppet.keyed_objects(bodies, all_bones=all_bones)
            if self._insert_object(self._leads[each.name][0], each, frame, auto=auto)
        ]

    def _insert_object(
        self, keys: ObjectKeys, item: bpy.types.Object, frame: float, *, auto: bool
    ) -> bool:
        done = keys.insert_object(item, frame, auto=auto)
        self.layered = keys.layered or self.layered
        return done

    # --- A motion ---------------------------------------------------------------------------------

    def check_motion(self) -> None:
        """See whether motions can be written.

        Raises:
            WriteError: one cannot.
        """
        for partner, keys in zip(self._company.partners, self._keys, strict=True):
            keys.check_motion(partner.puppet.armature())

    def record(self, frame: float, pose: Pose) -> None:
        """Begin to keep what is beside the figure at each frame."""
        self._recordings = [
            Recording(partner.puppet, frame, partner.own(part_of_pose(pose, span)))
            for partner, span in self._company.partners_with()
        ]
        self._recordings += [ObjectRecording(each, frame) for each in self._company.things]

    def keep(self, frame: float, pose: Pose) -> None:
        """One frame more; the objects are where they are shown."""
        spans = self._company.partners_with()
        for recording in self._recordings:
            if isinstance(recording, ObjectRecording):
                recording.keep(frame)
            else:
                partner, span = next(spans)
                recording.keep(frame, partner.own(part_of_pose(pose, span)))

    def write_motion(self) -> int:
        """Write what was kept; how many bones and objects got keys."""
        recordings, self._recordings = self._recordings, []
        count = 0
        for recording, keys in zip(recordings, [*self._keys, *self._object_keys], strict=False):
            if isinstance(recording, ObjectRecording):
                assert isinstance(keys, ObjectKeys)
                count += recording.write(keys)
                continue
            with pose_kept(recording.armature()):
                bones, _ = recording.write(keys)
            recording.go_along(bones)
            count += len(bones)
        return count

    # --- Ends -----------------------------------------------------------------------------------

    def take_back(self) -> None:
        """Put back poses, places and keys as they were; who is gone is passed."""
        for partner, keys, values in zip(
            self._company.partners, self._keys, self._values, strict=True
        ):
            try:
                armature = partner.puppet.found()
            except OctoMotionError:
                continue
            with pose_kept(armature):
                keys.take_back(armature)
            restore_pose(armature, values)
        for thing, keys in zip(self._company.things, self._object_keys, strict=True):
            try:
                keys.take_back(thing.found())
                thing.restore()
            except OctoMotionError:
                continue
        for name, (keys, before) in self._leads.items():
            item = bpy.data.objects.get((name, None))
            if item is not None:
                keys.take_back(item)
                put_transform(item, before)

    # --- Inside -----------------------------------------------------------------------------------

    def _puppets(self) -> list[Puppet]:
        return [self._company.main, *(each.puppet for each in self._company.partners)]
