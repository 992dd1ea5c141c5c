# SPDX-License-Identifier: GPL-3.0-or-later
"""``Object.octo_motion.splicing``: landmarks and the stack, as saved with the armature object.

The name of a splice is what Blender tells the items of a linked list apart by, so it alone cannot
be overridden.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import bpy

from ...blender.rig import armature_data
from ...core.phrases import as_phrase
from ...core.splicing.humanoid import LANDMARKS, Landmarks, ReferenceMoment
from ...core.splicing.transfer import CHAIN, PART_TABLE, PartKind, part_named
from .. import declared_settings as props
from ..declared_settings import make_overridable
from ..live import tell_switched


def _bone(name: str, description: str) -> Any:
    return props.StringProperty(name=name, description=description)


_MIDDLE: Final = {
    "hips": _bone("Hips", "Bone of the pelvis, which carries legs and trunk"),
    "spine": _bone("Spine", "Lowest bone above the pelvis that bends the trunk, if there is one"),
    "chest": _bone("Chest", "Bone that carries neck and shoulders"),
    "neck": _bone("Neck", "Lowest bone of the neck, if there is one"),
    "head": _bone("Head", "Bone of the head"),
}
_SIDED: Final = {
    "clavicle": ("Collar Bone", "Bone from the chest to the {} shoulder, if any"),
    "upper_arm": ("Upper Arm", "Bone that begins at the {} shoulder"),
    "forearm": ("Forearm", "Bone that begins at the {} elbow"),
    "hand": ("Hand", "Bone that begins at the {} wrist"),
    "thigh": ("Thigh", "Bone that begins at the {} hip"),
    "shin": ("Shin", "Bone that begins at the {} knee"),
    "foot": ("Foot", "Bone that begins at the {} ankle"),
    "toe": ("Toes", "Bone that begins at the ball of the {} foot, if there is one"),
}


REFERENCE_POSES: Final = (
    ("FOUND", "As Found", "From where the joints are while the clip plays", 0),
    ("FRAME", "Frame", "From one frame, in which the body stands upright", 1),
    ("REST", "Rest", "From the rest pose, where that is a pose of the body", 2),
)


def _take_frame(group: Any, context: bpy.types.Context) -> None:
    """Whoever asks for a frame means the one that is seen."""
    if group.reference_pose == "FRAME" and context.scene is not None:
        group.reference_frame = context.scene.frame_current


_REFERENCE: Final = {
    "reference_pose": props.EnumProperty(
        name="Reference Pose",
        description="Where it is found how each bone lies when the body stands upright. In this "
        "pose bodies are compared: neither rest pose nor bone axes of a file change a splice",
        items=REFERENCE_POSES,
        update=_take_frame,
    ),
    "reference_frame": props.IntProperty(
        name="Frame", description="Frame of the action in which the body stands upright", default=1
    ),
}


class OCTO_MOTION_PG_landmarks(bpy.types.PropertyGroup):
    """One bone name for each landmark, empty where the rig has none; and how the body stands."""

    __annotations__ = (
        _MIDDLE
        | _REFERENCE
        | {
            f"{part}_{side[0]}": _bone(f"{side.capitalize()} {name}", description.format(side))
            for side in ("left", "right")
            for part, (name, description) in _SIDED.items()
        }
    )


PROPERTIES: Final = {each: each.replace(".", "_").lower() for each in LANDMARKS}
"""Name of the property by landmark: "upper_arm.L" is ``upper_arm_l``."""


def title(landmark: str) -> str:
    """What the table calls a landmark: "left hand"."""
    definition = OCTO_MOTION_PG_landmarks.bl_rna.properties[PROPERTIES[landmark]]
    return as_phrase(definition.name.lower())


def read_landmarks(group: Any) -> Landmarks:
    """The table as core's landmarks, whether the bones exist or not."""
    bones = {each: getattr(group, name) for each, name in PROPERTIES.items()}
    return Landmarks({each: bone for each, bone in bones.items() if bone}, _reference(group))


def _reference(group: Any) -> ReferenceMoment:
    """Where the table says the reference pose is to be found."""
    if group.reference_pose == "FRAME":
        return float(group.reference_frame)
    return "rest" if group.reference_pose == "REST" else ""


def write_reference(group: Any, reference: ReferenceMoment) -> None:
    """Set where the reference pose is found."""
    if isinstance(reference, str):
        group.reference_pose = "REST" if reference else "FOUND"
    else:
        group.reference_pose = "FRAME"
        group.reference_frame = round(reference)


def write_landmarks(group: Any, bones: Mapping[str, str]) -> None:
    """Fill the table; landmarks that are not named become empty."""
    for landmark, name in PROPERTIES.items():
        setattr(group, name, bones.get(landmark, ""))


# --- The stack of splices, as it is saved with the armature object --------------------------------
#
# The name of a splice is what Blender tells the items of a linked list apart by, so it alone cannot
# be overridden.


PARTS: Final = tuple(
    (part.name.upper(), part.title, part.description, number)
    for number, part in enumerate(PART_TABLE)
)

AFTER: Final = (
    ("STOP", "Stop", "Back to the base", 0),
    ("HOLD", "Hold", "Stay in the last pose", 1),
    ("LOOP", "Loop", "Begin again with the clip's first frame", 2),
)

FADE_UNITS: Final = (
    ("FRAMES", "Frames", "They get shorter with more frames per second", 0),
    ("SECONDS", "Seconds", "They last as long at any frame rate", 1),
)

MODES: Final = (
    ("DIRECTION", "Direction", "Hands and feet lie in the direction where the clip has them", 0),
    ("EXACT", "Exact", "The limb bends so that hands and feet are where the clip has them", 1),
)


SEEN_FROM: Final = (
    (
        "AUTO",
        "Usual",
        "Arms and head from the chest, legs from the pelvis, the trunk from upright axes",
        2,
    ),
    ("CHEST", "Chest", "The part goes along with a chest that leans or turns", 1),
    ("PELVIS", "Pelvis", "The part goes along with a pelvis that tilts", 0),
    (
        "JOINT",
        "Own Joint",
        "The part is turned against the bone that it hangs on as it is in the clip",
        3,
    ),
    (
        "WORLD",
        "Upright",
        "As the pelvis faces, but upright: what leans or points up in the clip does so on the base",
        4,
    ),
)
"""Files keep the numbers."""


BLENDINGS: Final = (
    ("REPLACE", "Replace", "The part moves as the clip has it", 0),
    (
        "ADD",
        "Add",
        "What the clip does is put on top of what the base does: a breath, a limp",
        1,
    ),
)

RESULTS: Final = (
    ("ACTION", "New Action", "One action with all of the motion, in place of the base", 0),
    (
        "LAYER",
        "NLA Layer",
        "An action with nothing but what is spliced, on an NLA track over the base",
        1,
    ),
)

REFERENCES: Final = (
    ("FIRST", "First Frame", "What the clip does since its first frame", 0),
    (
        "REST",
        "Rest",
        "What the clip does beyond its rest pose, or the reference pose that was found",
        1,
    ),
    ("FRAME", "Frame", "What the clip does against a frame of its own", 2),
)


def part_kind(item: Any) -> PartKind | None:
    """What a splice's part is, ``None`` for a chain."""
    name = item.part.lower()
    return None if name == CHAIN.name else part_named(name).kind


def _is_armature(_: Any, candidate: bpy.types.Object) -> bool:
    return candidate.type == "ARMATURE"


def _is_mesh(_: Any, candidate: bpy.types.Object) -> bool:
    return candidate.type == "MESH"


def _slot(description: str) -> Any:
    return props.StringProperty(name="Slot", description=description)


def _action(name: str, description: str) -> Any:
    return props.PointerProperty(name=name, description=description, type=bpy.types.Action)


def _as_shown(name: str, what: str) -> Any:
    return props.BoolProperty(
        name=name,
        description=f"Take the {what} as the scene shows it, with constraints, drivers and NLA. "
        "That plays the scene, so it takes longer",
    )


def _frame(name: str, description: str, **options: Any) -> Any:
    """A moment, or how long something takes, in frames."""
    return props.FloatProperty(name=name, description=description, step=100, precision=1, **options)


def _seconds(name: str, description: str) -> Any:
    """How long something takes."""
    return props.FloatProperty(
        name=name,
        description=description,
        default=0.25,
        min=0.0,
        soft_max=2.0,
        step=5,
        precision=2,
        subtype="TIME_ABSOLUTE",
        unit="TIME_ABSOLUTE",
    )


class SpliceItem(bpy.types.PropertyGroup):
    """One part of one clip, and when."""

    name: bpy.props.StringProperty(
        name="Name", description="What this splice is called in the list"
    )
    part: props.EnumProperty(
        name="Part",
        description="Which part of the body is taken from the source",
        items=PARTS,
    )
    bone: props.StringProperty(
        name="First Bone",
        description="With the part Chain: its first bone on this armature",
    )
    source_bone: props.StringProperty(
        name="Source Bone",
        description="With the part Chain: its first bone on the source, if it is called otherwise",
    )
    source: props.PointerProperty(
        name="Source",
        description="The armature that the clip is for. It may have other proportions, bones and "
        "axes, and may be this armature itself",
        type=bpy.types.Object,
        poll=_is_armature,
    )
    action: _action("Action", "The clip. It is never changed")
    slot: _slot("Slot of the clip's action; empty takes the one that fits the source")
    visual: _as_shown("As Shown", "clip")
    mirror: props.BoolProperty(
        name="Mirror",
        description="Take the clip as in a mirror: a throw with the right arm is spliced onto the "
        "left one; legs, trunk, head and travel are mirrored as well. Of a chain its mirror image "
        "is taken, unless Source Bone names another",
    )
    splice_start: _frame("Clip Start", "Frame of the clip that is shown first", default=1.0)
    base_start: _frame("Base Start", "Frame of the base at which the splice begins", default=1.0)
    rate: props.FloatProperty(
        name="Rate",
        description="Speed of the clip, 1 as it is. With keys (I over the field) the clip goes "
        "faster and slower: all that it has gone by then adds up",
        default=1.0,
        min=0.01,
        max=100.0,
        soft_max=4.0,
        step=5,
    )
    match_markers: props.BoolProperty(
        name="Match Markers",
        description="Show the moments of the clip's pose markers where the base has markers of "
        "the same name: pose markers of its action, else the scene's. Between them the clip goes "
        "faster or slower as it must, without a jump in speed; after the last one at Rate",
    )
    length: _frame(
        "Length",
        "Frames of the base that the splice lasts; 0 is as long as there is motion",
        min=0.0,
    )
    fade_unit: props.EnumProperty(
        name="Fades",
        description="What the lengths of fades are given in",
        items=FADE_UNITS,
    )
    fade_in_seconds: _seconds(
        "Ease In", "Time over which the splice comes in, and each further round of a loop"
    )
    fade_out_seconds: _seconds(
        "Ease Out",
        "Time over which the splice goes, if it ends before the base; over which a round of a loop "
        "goes; and over which a clip that is held comes to rest",
    )
    ease_in: _frame(
        "Ease In",
        "Frames over which the splice comes in, and each further round of a loop",
        default=6.0,
        min=0.0,
    )
    ease_out: _frame(
        "Ease Out",
        "Frames over which the splice goes, if it ends before the base; over which a round of a "
        "loop goes; and over which a clip that is held comes to rest",
        default=6.0,
        min=0.0,
    )
    after: props.EnumProperty(
        name="After",
        description="What happens when the clip runs out",
        items=AFTER,
    )
    mode: props.EnumProperty(
        name="Reach",
        description="Where hands and feet go on a body of other proportions",
        items=MODES,
    )
    with_clavicle: props.BoolProperty(
        name="With Collar Bone",
        description="An arm takes its collar bone along, where both armatures have one: the hand "
        "is then where it was seen. Without, the shoulder stays the base's",
        default=True,
    )
    seen_from: props.EnumProperty(
        name="Seen From",
        description="From where the part is seen in the clip, so that it lies alike on the base. "
        "Legs with travel are always seen from the pelvis",
        items=SEEN_FROM,
        default="AUTO",
    )
    with_travel: props.BoolProperty(
        name="With Travel",
        description="Legs bring the clip's way through the world with them, so that feet do not "
        "skate",
    )
    foot_lock: props.BoolProperty(
        name="Foot Lock",
        description="With travel, feet that stand in the clip stand here as well, on the ground of "
        "the base: legs of other proportions would slide",
        default=True,
    )
    ground: props.PointerProperty(
        name="Ground",
        description="Mesh on which locked feet stand. If empty it is level, at the height at which "
        "the base stands",
        type=bpy.types.Object,
        poll=_is_mesh,
    )
    weight: props.FloatProperty(
        name="Weight",
        description="How much of the splice is seen: 0 is the base, 1 the splice. It may have keys",
        default=1.0,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
    )
    blending: props.EnumProperty(
        name="Blending",
        description="Whether the clip takes the place of what the base does, or comes on top of it",
        items=BLENDINGS,
    )
    reference: props.EnumProperty(
        name="Reference",
        description="With Add: the pose in which the clip does nothing",
        items=REFERENCES,
    )
    reference_frame: _frame(
        "Reference Frame", "Frame of the clip in which it does nothing", default=1.0
    )
    mute: props.BoolProperty(name="Mute", description="Leave this splice out")


class OCTO_MOTION_PG_retarget(bpy.types.PropertyGroup):
    """How whole clips are retargeted onto the armature."""

    mode: props.EnumProperty(
        name="Hands",
        description="Where hands go on a body of other proportions. Feet go where they stand",
        items=MODES,
    )
    travel: props.BoolProperty(
        name="Travel",
        description="Go through the world as the clip does, with strides of this body's size. Off, "
        "the body stays where the armature is, as games want it",
        default=True,
    )
    foot_lock: props.BoolProperty(
        name="Foot Lock",
        description="Feet that stand in the clip stand here as well: they neither slide nor hover "
        "nor sink. Where a leg is too short, the pelvis comes down",
        default=True,
    )
    ground: props.PointerProperty(
        name="Ground",
        description="Mesh on which locked feet stand: slopes, stairs, rough ground. If empty it is "
        "level, at the height at which the armature stands in its own action, or at rest",
        type=bpy.types.Object,
        poll=_is_mesh,
    )
    standing: _action(
        "Stands As in",
        "An action of this armature that tells at which height it stands, and how it holds "
        "fingers, hair and all else that no part takes; empty is found: the base of its splices, "
        "or an idle action, or its own one. Otherwise it stands as it rests",
    )
    visual: _as_shown("As Shown", "clip")
    from_armature: props.PointerProperty(
        name="Source",
        description="The armature whose clip was retargeted last, which Live follows",
        type=bpy.types.Object,
        poll=_is_armature,
    )
    from_action: _action("Action", "The clip that was retargeted last, which Live follows")
    from_slot: _slot("Slot of that clip; empty takes the one that fits its armature")
    live: props.BoolProperty(
        name="Live",
        description="Retarget the last clip again by itself whenever a setting, the clip, the "
        "ground or the landmarks change: the frame in sight at once, all others while Blender "
        "idles. Switches itself off when you edit the result",
        update=tell_switched,
    )
    live_error: props.StringProperty(
        name="Live Error",
        description="Why the result does not follow at the moment; the last one that could be "
        "made is still there",
        options={"HIDDEN"},
    )


class OCTO_MOTION_PG_splicing(bpy.types.PropertyGroup):
    """Settings of splicing, saved with the armature object."""

    base: _action("Base", "The action onto which parts are spliced. It is never changed")
    base_slot: _slot("Slot of the base; empty takes the one that fits the armature")
    visual: _as_shown("Base As Shown", "base")
    splices: props.CollectionProperty(
        name="Splices",
        description="What is spliced onto the base, each onto the result of those above it",
        type=SpliceItem,
    )
    active_splice: props.IntProperty(name="Active Splice", options={"HIDDEN"})
    result: _action(
        "Result",
        "The action that was built last. It is made anew in place until you edit it; then it is "
        "yours, and the next one is a new action",
    )
    result_as: props.EnumProperty(
        name="Result As",
        description="What is built: both play alike",
        items=RESULTS,
    )
    live: props.BoolProperty(
        name="Live",
        description="Build by itself whenever a splice, its clip, the base or the landmarks "
        "change: the frame in sight at once, all others while Blender idles. Switches itself off "
        "when you edit the result",
        update=tell_switched,
    )
    live_error: props.StringProperty(
        name="Live Error",
        description="Why the result does not follow at the moment; the last one that could be "
        "made is still there",
        options={"HIDDEN"},
    )
    retarget: props.PointerProperty(
        name="Retarget",
        description="How whole clips are retargeted onto this armature",
        type=OCTO_MOTION_PG_retarget,
    )
    landmarks: props.PointerProperty(
        name="Landmarks",
        description="Which bone is which part of the body",
        type=OCTO_MOTION_PG_landmarks,
    )


def splicing_settings(armature: bpy.types.Object) -> Any:
    """The settings of an armature object, of whose properties type checkers know nothing.

    Raises:
        RigError: the object is no armature.
    """
    armature_data(armature)
    make_overridable(armature)
    return armature.octo_motion.splicing  # type: ignore[attr-defined]
