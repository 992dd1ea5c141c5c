# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground and its contacts, arms, reaches, changes: as they are saved with the armature."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import bpy
import numpy as np

from ....blender.scene import WITH_SURFACE, Contact, markers, read_markers
from ....core.locomotion.gait import Arm
from ....core.locomotion.ground import ContactOverride, StanceSettings
from ....core.rotations import Floats
from ... import declared_settings as props
from ...declared_settings import declared, emptied
from .gait import SIDES, GaitName, weight_property


def may_be_ground(settings: Any, candidate: bpy.types.Object) -> bool:
    """Whether an object is offered as ground: a mesh, but nobody's own skin."""
    return candidate.type == "MESH" and candidate.find_armature() != settings.id_data


def _shift() -> Any:
    return props.FloatProperty(
        name="Shift",
        description="Share of a cycle by which the contact is later, negative if it is earlier",
        min=-0.3,
        max=0.3,
        step=1,
        precision=3,
    )


class ContactItem(bpy.types.PropertyGroup):
    """What an artist wants of one contact: it stays when the motion is generated again."""

    arm: props.StringProperty(name="Arm", description="Name of the arm in the list")
    cycle: props.IntProperty(name="Cycle", description="Number of the arm's cycle along the route")
    removed: props.BoolProperty(
        name="Removed", description="The arm does not touch the ground here"
    )
    shift: _shift()
    locked: props.BoolProperty(
        name="Locked",
        description="The contact stays where it is in the world, however the route or the gait "
        "are changed",
    )
    position: props.FloatVectorProperty(
        name="Position",
        description="Where the arm touches the ground, if the contact is locked",
        subtype="TRANSLATION",
        size=3,
    )
    heading: props.FloatProperty(
        name="Heading",
        description="Which way the arm lies from there, about the world's Z axis, if the contact "
        "is locked",
        subtype="ANGLE",
    )


_SCALED: Final = (
    "They are scaled, and get thinner as they get longer. Alembic plays the same; glTF, FBX and "
    "USD hand scale on otherwise, and play arms off by some percent of their length"
)
_MOVED: Final = (
    "The bone after each is moved; none is scaled. For games: glTF, FBX and USD play what Blender "
    "plays. Bones must not be connected"
)


class OCTO_MOTION_PG_ground(bpy.types.PropertyGroup):
    """How a walking creature stands on the ground."""

    use: props.BoolProperty(
        name="Hold the Ground",
        description="Walking, each arm takes hold of the ground and does not slide over it, while "
        "the body moves on; a swim keeps over it. Off, the arms move as the gait alone has them",
        default=True,
    )
    object: props.PointerProperty(
        name="Ground",
        description="Mesh to walk on, or to swim over, as it is seen: with its modifiers, moved "
        "and scaled. Without one, a walk's ground is where the route is",
        type=bpy.types.Object,
        poll=may_be_ground,
    )
    duty: declared(StanceSettings, "duty")
    planted: declared(StanceSettings, "planted")
    stretch: declared(StanceSettings, "stretch")
    stretch_as: props.EnumProperty(
        name="Stretch as",
        description="What makes bones longer",
        items=(
            ("SCALE", "Scale", _SCALED, 0),
            ("LOCATION", "Location", _MOVED, 1),
        ),
    )
    lift: declared(StanceSettings, "lift")
    lean: declared(StanceSettings, "lean")
    smoothing: declared(StanceSettings, "smoothing")
    up: declared(StanceSettings, "up")
    start_at_rest: props.BoolProperty(
        name="Start at Rest",
        description="All arms lie on the ground at the start, and leave it as the body gets going. "
        "Only with an Ease In: without one the creature comes walking",
        default=True,
    )
    come_to_rest: props.BoolProperty(
        name="Come to Rest",
        description="All arms lie on the ground at the end: each takes its last step in time. Only "
        "with an Ease Out: without one the creature walks on",
        default=True,
    )
    rest_within: props.FloatProperty(
        name="Within",
        description="Cycles of the gait that the body takes at least to get going from its rest, "
        "and to come to it, if that is more than Ease In and Out give it",
        default=1.0,
        min=0.0,
        soft_max=4.0,
        max=100.0,
        step=10,
    )
    shown: props.StringProperty(
        name="Shown",
        description="Which contacts have markers",
        options={"HIDDEN"},
    )
    contacts: props.CollectionProperty(
        name="Contacts",
        description="Contacts that were moved, locked, shifted or removed by hand",
        type=ContactItem,
    )


_HiddenFloat: Final = partial(props.FloatProperty, options={"HIDDEN"})
_HiddenText: Final = partial(props.StringProperty, options={"HIDDEN"})


class OCTO_MOTION_PG_contact(bpy.types.PropertyGroup):
    """What a marker stands for: ``Object.octo_motion.contact``."""

    armature: _HiddenText(name="Armature", description="Object whose arm touches here")
    arm: _HiddenText(name="Arm", description="Name of the arm")
    cycle: props.IntProperty(
        name="Cycle",
        description="Number of the arm's cycle along the route",
        options={"HIDDEN"},
    )
    locked: props.BoolProperty(
        name="Locked",
        description="The contact stays here, however the route or the gait are changed. One that "
        "was dragged or turned is locked; free it to have it where the gait wants it",
    )
    shift: _shift()
    position: props.FloatVectorProperty(
        name="Position",
        description="Where the marker was put",
        size=3,
        options={"HIDDEN"},
    )
    heading: _HiddenFloat(name="Heading", description="How the marker was turned")
    frame_on: _HiddenFloat(name="From", description="Frame at which the arm takes hold")
    frame_off: _HiddenFloat(name="To", description="Frame at which the arm lets go")
    cycle_frames: _HiddenFloat(
        name="Cycle Frames", description="Frames that a cycle takes there", default=1.0
    )


# --- What an artist wants of single contacts: kept in the settings, changed on markers ------------


Place = tuple[str, int]
"""Name of an arm, and number of its cycle."""


@dataclass(frozen=True, eq=False)
class ContactEdit:
    """What is wanted of one contact."""

    removed: bool = False
    shift: float = 0.0
    position: Floats | None = None
    """(3,) where it is locked, world."""
    heading: float = 0.0

    @property
    def matters(self) -> bool:
        """Whether it differs from what would be there anyway."""
        return self.removed or self.shift != 0.0 or self.position is not None


def read_overrides(
    settings: OCTO_MOTION_PG_ground, armature: bpy.types.Object
) -> dict[Place, ContactEdit]:
    """All wishes: those in the settings, and what was done to the markers since."""
    wanted = {
        (item.arm, item.cycle): ContactEdit(
            item.removed,
            item.shift,
            np.array(item.position, dtype=np.float64) if item.locked else None,
            item.heading,
        )
        for item in settings.contacts
    }
    once, places = _shown(settings)
    found = read_markers(armature, once) if settings.shown else {}
    # Of a copy of an armature that has markers, nobody has taken any away.
    if found or once == armature.name:
        for place in places:
            if place not in found:
                wanted[place] = replace(wanted.get(place, ContactEdit()), removed=True)
    for place, contact in found.items():
        wanted[place] = ContactEdit(
            shift=contact.shift,
            position=contact.position if contact.locked else None,
            heading=contact.heading,
        )
    return {place: each for place, each in wanted.items() if each.matters}


def overrides_for_core(
    wanted: dict[Place, ContactEdit], arms: Sequence[Arm]
) -> list[ContactOverride]:
    """Wishes as core has them, of those arms that there are."""
    numbers = {arm.name: number for number, arm in enumerate(arms)}
    return [
        ContactOverride(
            numbers[arm],
            cycle,
            removed=each.removed,
            shift=each.shift,
            position=each.position,
            heading=each.heading if each.position is not None else None,
        )
        for (arm, cycle), each in wanted.items()
        if arm in numbers
    ]


def store(settings: OCTO_MOTION_PG_ground, wanted: dict[Place, ContactEdit]) -> None:
    """Keep wishes in the settings."""
    for item in emptied(settings, "contacts"):
        if (item.arm, item.cycle) not in wanted:
            item.removed, item.shift, item.locked = False, 0.0, False
    for (arm, cycle), each in sorted(wanted.items()):
        name = _name(arm, cycle)
        item = settings.contacts.get(name)
        if item is None:
            item = settings.contacts.add()
            item.name, item.arm, item.cycle = name, arm, cycle
        item.removed = each.removed
        item.shift, item.locked = each.shift, each.position is not None
        if each.position is not None:
            item.position, item.heading = each.position, each.heading


def rename_arm(armature: Any, before: str, now: str) -> None:
    """Let reaches, contacts and their markers speak of an arm by its new name."""
    settings = armature.octo_motion.locomotion
    for reach in settings.reaches:
        if reach.arm == before:
            reach.arm = now
    ground = settings.ground
    for item in ground.contacts:
        if item.arm == before:
            item.arm, item.name = now, _name(now, item.cycle)
    once, places = _shown(ground)
    if places:
        renamed = [(now if arm == before else arm, cycle) for arm, cycle in places]
        ground.shown = json.dumps({"armature": once, "contacts": renamed})
    for marker in markers(armature, once):
        own: Any = marker.octo_motion.contact  # type: ignore[attr-defined]
        if own.arm == before:
            own.arm = now


def changed_by_hand(settings: OCTO_MOTION_PG_ground) -> int:
    """How many contacts the settings have wishes of."""
    return sum(item.removed or item.shift != 0.0 or item.locked for item in settings.contacts)


def note_shown(
    settings: OCTO_MOTION_PG_ground, armature: bpy.types.Object, contacts: Sequence[Contact]
) -> None:
    """Remember which markers were put, so that one that is gone is known to be removed."""
    places = [(each.arm, each.cycle) for each in contacts]
    settings.shown = json.dumps({"armature": armature.name, "contacts": places})


def once_called(settings: OCTO_MOTION_PG_ground) -> str:
    """What the armature, or the one that it is a copy of, was called when it got markers."""
    return _shown(settings)[0]


def _name(arm: str, cycle: int) -> str:
    """What a contact is called in the settings."""
    return f"{arm} {cycle}"


def _shown(settings: OCTO_MOTION_PG_ground) -> tuple[str, list[Place]]:
    """What :func:`note_shown` has noted: "" and nothing where no markers are shown."""
    if not settings.shown:
        return "", []
    noted = json.loads(settings.shown)
    return noted["armature"], [(arm, cycle) for arm, cycle in noted["contacts"]]


# --- Lists that are saved with the armature object: arms, reaches, and where the gait changes -----
#
# Names of arms and bones are what Blender tells the items of a linked list apart by: a library
# override that renames one gets the whole list once more when the file is opened again. So they
# alone cannot be overridden.


AXES: Final = (
    ("X", "X", "The armature's own +X", 0),
    ("Y", "Y", "The armature's own +Y", 1),
    ("Z", "Z", "The armature's own +Z", 2),
    ("-X", "-X", "The armature's own −X", 3),
    ("-Y", "-Y", "The armature's own −Y", 4),
    ("-Z", "-Z", "The armature's own −Z", 5),
)


def _renamed(arm: ArmItem, _context: bpy.types.Context) -> None:
    """Let what speaks of an arm by its name follow: reaches, and contacts that were changed."""
    before, arm.known_as = arm.known_as, arm.name
    if before not in ("", arm.name):
        rename_arm(arm.id_data, before, arm.name)


class ArmBoneItem(bpy.types.PropertyGroup):
    """A bone of an arm."""

    name: bpy.props.StringProperty(name="Bone", description="Name of the bone")


class ArmItem(bpy.types.PropertyGroup):
    """An arm: its bones from root to tip, and its place in the gait."""

    name: bpy.props.StringProperty(
        name="Name", description="What this arm is called in the list", update=_renamed
    )
    known_as: bpy.props.StringProperty(
        name="Known As",
        description="What it was called until its name was changed",
        options={"HIDDEN"},
    )
    bones: props.CollectionProperty(
        name="Bones",
        description="The arm's bones, from its root to its tip",
        type=ArmBoneItem,
    )
    side: props.EnumProperty(
        name="Side",
        description="Side of the body. Gaits mirror forward and backward between left and right",
        items=SIDES,
    )
    pair: props.IntProperty(
        name="Pair",
        description="Which pair it belongs to, counted from 1 in front. Gaits can give each pair "
        "its own motion, and shift the pairs against one another",
        default=1,
        min=1,
    )
    phase: props.AngleProperty(
        name="Phase",
        description="How far this arm is ahead of its place in the gait: 360° is a whole cycle",
        soft_min=-math.tau,
        soft_max=math.tau,
    )
    flip: props.BoolProperty(
        name="Flip",
        description="Mirror this arm's motion: forward and twist turn the other way, for an arm "
        "that moves backward where others move forward",
    )
    use_weights: props.BoolProperty(
        name="Own Weights",
        description="Joint weights of this arm's own, in place of those of Joint Weights",
    )
    weight_root: weight_property("Root", 0)
    weight_tip: weight_property("Tip", -1)
    enabled: props.BoolProperty(
        name="Enabled",
        description="Move this arm. Switched off, it gets no keys and keeps its pose",
        default=True,
    )


class ArmList:
    """What ``Object.octo_motion.locomotion`` has of the rig."""

    arms: props.CollectionProperty(
        name="Arms",
        description="The arms that are moved; without any, they are detected when generating",
        type=ArmItem,
    )
    active_arm: props.IntProperty(name="Active Arm", options={"HIDDEN"})
    body_front: props.EnumProperty(
        name="Front",
        description="Which way the body faces, as an axis of the armature",
        items=AXES,
        default="-Y",
    )
    body_up: props.EnumProperty(
        name="Up",
        description="Where the body's top is, as an axis of the armature",
        items=AXES,
        default="Z",
    )
    root_bone: props.StringProperty(
        name="Root Bone",
        description="Bone that carries the whole body; it can take the travel along the route",
    )
    keep_pose: props.BoolProperty(
        name="Keep Pose",
        description="Let bones that carry the arms stay as they are posed, and work the motion out "
        "from there. Off, the motion is that of the rig at rest, whatever pose or frame it stands "
        "in: what the action before has moved goes back to rest, and what is posed by hand gets "
        "keys at rest",
    )


# --- Reaches --------------------------------------------------------------------------------------


MODES: Final = (
    ("COIL", "Coil", "Wind about the object, hold it, and let go", 0),
    ("TOUCH", "Touch", "Lay the arm on the object", 1),
    ("CURL", "Curl", "Curl the arm up and stretch it again; needs no object", 2),
    (
        "MOUTH",
        "Bring to Mouth",
        (
            "Wind about the object, draw it in under the body to the mouth, and let the arms "
            "beside close over it with the web. The object gets keys for that"
        ),
        3,
    ),
)


class ReachItem(bpy.types.PropertyGroup):
    """An arm reaches for an object while it moves, and goes back to its gait."""

    name: bpy.props.StringProperty(name="Name", description="What this reach is called in the list")
    mute: props.BoolProperty(name="Mute", description="Leave this reach out")
    arm: props.StringProperty(
        name="Arm",
        description="The arm of the list that reaches; empty takes the one nearest to the object",
    )
    target: props.PointerProperty(
        name="Object",
        description="What is reached for. It may move; only if it is carried is it changed",
        type=bpy.types.Object,
        poll=props.is_of(WITH_SURFACE),
    )
    mode: props.EnumProperty(name="Mode", description="What the arm does", items=MODES)
    turns: props.FloatProperty(
        name="Turns",
        description="Winds about the object at most so often, as far as the arm is long enough",
        default=2.0,
        min=0.1,
        max=20.0,
        step=10,
        precision=2,
    )
    carry: props.BoolProperty(
        name="Carry",
        description="Take the object along, from when the arm is wound, or its suckers have taken "
        "hold, until it lets go. The object gets keys for that; it must have none of its own",
    )
    axis: props.EnumProperty(
        name="Axis",
        description="What of the object is wound about",
        items=(
            (
                "AUTO",
                "Automatic",
                "The longest way through the object; of a ball or a cube its Z",
                0,
            ),
            ("X", "X", "The object's own X", 1),
            ("Y", "Y", "The object's own Y", 2),
            ("Z", "Z", "The object's own Z", 3),
        ),
    )
    frame_start: props.IntProperty(
        name="Start", description="Frame at which the arm sets out", default=1
    )
    frame_contact: props.IntProperty(
        name="Contact",
        description="Frame at which the arm touches the object; a curl is closed then",
        default=30,
    )
    coil_frames: props.IntProperty(
        name="Coil",
        description="Frames from the touch until the arm is wound all the way",
        default=20,
        min=1,
        soft_max=100,
    )
    bring_frames: props.IntProperty(
        name="Bring",
        description="Frames from when the arm is wound until the object is at the mouth",
        default=40,
        min=1,
        soft_max=100,
    )
    frame_release: props.IntProperty(
        name="Release",
        description="Frame at which the arm begins to let go; after the end of the motion, it "
        "holds on",
        default=80,
    )
    back_frames: props.IntProperty(
        name="Back",
        description="Frames from letting go until the arm does what its gait says",
        default=40,
        min=1,
        soft_max=100,
    )


class Reaches:
    """What ``Object.octo_motion.locomotion`` has of reaches."""

    reaches: props.CollectionProperty(
        name="Reaches",
        description="What single arms reach for while the body moves",
        type=ReachItem,
    )
    active_reach: props.IntProperty(name="Active Reach", options={"HIDDEN"})


# --- Settings along the route ---------------------------------------------------------------------


SETTINGS_ALONG: Final = (
    ("PACE", "Pace", "How many times as fast as elsewhere the body is", 0),
    ("LIFT", "Lift", "How high arms in the air are above the ground at least", 1),
    ("HOLD", "Hold", "Share of its cycle for which an arm holds on to the ground", 2),
    ("LEAN", "Lean", "How far the body leans with the ground", 3),
    ("HEIGHT", "Height", "How much higher than elsewhere the body is", 4),
)


class AlongItem(bpy.types.PropertyGroup):
    """A value that a setting has at a place of the route."""

    name: bpy.props.StringProperty(name="Name", description="What this value is called in the list")
    setting: props.EnumProperty(
        name="Setting",
        description="What has a value of its own here",
        items=SETTINGS_ALONG,
    )
    position: props.FactorProperty(
        name="Position",
        description="Where along the route the value is reached: 0 at its start, 1 at its end. "
        "From one place to the next it goes over gently; before the first place of a setting and "
        "after its last it stays",
        default=0.5,
        precision=3,
    )
    pace: props.FloatProperty(
        name="Pace",
        description="How many times as fast the body is, with the rhythm of its arms",
        default=1.0,
        min=0.05,
        max=20.0,
        soft_min=0.2,
        soft_max=5.0,
        step=10,
    )
    lift: declared(StanceSettings, "lift")
    hold: declared(StanceSettings, "duty")
    lean: declared(StanceSettings, "lean")
    height: props.FloatProperty(
        name="Height",
        description="How much higher the body is, in arm lengths; below 0 it is lower",
        default=0.0,
        min=-10.0,
        max=10.0,
        soft_min=-0.5,
        soft_max=0.5,
        step=5,
    )

    @property
    def value(self) -> float:
        """The one that counts; holds as of ``StanceSettings``, to so many digits."""
        value = float(getattr(self, self.setting.lower()))
        return round(value, 6) if self.setting == "HOLD" else value


# --- Poses that a motion begins and ends in -------------------------------------------------------


class OCTO_MOTION_PG_given_pose(bpy.types.PropertyGroup):
    """A pose that the motion begins or ends in, ``begin_pose`` and ``end_pose`` of locomotion."""

    action: props.PointerProperty(
        name="Pose",
        description="Action that has the pose; without one the motion is its own here. Its keys "
        "count alone, of bones and of the object",
        type=bpy.types.Action,
    )
    frame: props.FloatProperty(
        name="Frame",
        description="Frame of that action, whichever the scene is at",
        default=1.0,
        step=100,
        precision=1,
    )
    frames: props.IntProperty(
        name="Over",
        description="Frames that it takes from the pose into the motion, or from the motion into "
        "the pose. Arms that stand on the ground step over one after the other",
        default=24,
        min=1,
        soft_max=200,
    )
    with_place: props.BoolProperty(
        name="Place",
        description="The body is where it is in that pose, and eases from there to its route. Off, "
        "it is on its route at once, in that pose",
        default=True,
    )


# --- Where along the route the gait changes: ``octo_motion.locomotion.change`` --------------------


def _length() -> Any:
    return props.FloatProperty(
        name="Length",
        description="How long the change takes along the route, in arm lengths. The body goes over "
        "all the while; each arm as soon as it holds on to nothing",
        default=1.5,
        min=0.1,
        soft_max=5.0,
        step=10,
    )


class ChangeItem(bpy.types.PropertyGroup):
    """A place of the route from which on another gait goes."""

    name: bpy.props.StringProperty(
        name="Name", description="What this change is called in the list"
    )
    gait: GaitName(
        name="Gait",
        description="The gait from here on. Its own strides, the other settings of this armature",
        default="swim",
    )
    position: props.FactorProperty(
        name="Position",
        description="Where along the route the change is half done: 0 at its start, 1 at its end",
        default=0.5,
        precision=3,
    )
    length: _length()


class OCTO_MOTION_PG_change(bpy.types.PropertyGroup):
    """Changes of gait along the route."""

    by: props.EnumProperty(
        name="Change Gait",
        description="Whether the gait changes along the route, and what decides where",
        items=(
            ("NONE", "Never", "One gait all the way", 0),
            (
                "HEIGHT",
                "By Height",
                "Where the route is high over the ground, or its lowest point, another gait goes",
                1,
            ),
            ("MARKERS", "At Places", "At the places of a list, each with its own gait", 2),
        ),
    )
    gait: GaitName(
        name="Above",
        description="The gait that goes where the route is high over the ground",
        default="swim",
    )
    height: props.FloatProperty(
        name="Height",
        description="Height of the route over the ground at which the change is half done, in arm "
        "lengths",
        default=0.5,
        min=0.0,
        soft_max=3.0,
        step=5,
    )
    length: _length()
    places: props.CollectionProperty(
        name="Places",
        description="Places of the route where the gait changes, in any order",
        type=ChangeItem,
    )
    active_place: props.IntProperty(name="Active Place", options={"HIDDEN"})
