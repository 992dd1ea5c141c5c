# SPDX-License-Identifier: GPL-3.0-or-later
"""What a shot reads of its rig: arms, body, root bone, and what stands in their way."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, cast

import bpy
import numpy as np

from ....blender.animation import (
    LENGTH,
    animated_bones,
    as_posed,
    displaced_bones,
    is_generated,
    is_layer,
    read_channels,
)
from ....blender.rig import (
    acts,
    armature_data,
    even_scale,
    is_driven_object,
    linked_names,
    radii_of_skin,
    read_skeleton,
    skin_key,
    skin_parts,
    with_tips,
    world_directions,
)
from ....core.content_cache import ContentCache, content_key
from ....core.errors import RigError
from ....core.locomotion.clearance import BodyVolume, Capsules
from ....core.locomotion.gait import Arm
from ....core.locomotion.motion import Creature
from ....core.locomotion.rig import (
    ArmChain,
    BodyFrame,
    Detection,
    Side,
    body_frame,
    chain_of,
    detect_arms,
    frames_of_arm,
    is_driven,
    nearest_axis,
)
from ....core.phrases import phrase
from ....core.rotations import Floats, conjugate, rotate
from ....core.skeleton import Skeleton
from ...declared_settings import assign, emptied, free_name
from ..settings import OCTO_MOTION_PG_locomotion

# Names that detection gives, and the numbers that keep them apart.
_GIVEN_NAME: Final = re.compile(r"Arm \d+( [LR])?(\.\d+)?")


def bones_of(arm: Any) -> tuple[str, ...]:
    """Names of an arm's bones, root to tip."""
    return tuple(bone.name for bone in arm.bones)


def placed_arms(
    settings: OCTO_MOTION_PG_locomotion, skeleton: Skeleton
) -> list[tuple[tuple[str, ...], Side, int]]:
    """Bones, side and pair of the arms in the list whose bones all exist."""
    return [
        (bones, cast("Side", arm.side), arm.pair)
        for arm in settings.arms
        if (bones := bones_of(arm)) and skeleton.index.keys() >= set(bones)
    ]


def body_axes(settings: OCTO_MOTION_PG_locomotion, armature: bpy.types.Object) -> tuple[str, str]:
    """The body's up and front: as set, or as the armature stands in the world."""
    if settings.arms or settings.is_property_set("body_front"):
        return settings.body_up, settings.body_front
    world_up, world_front = world_directions(armature)
    up = nearest_axis(world_up)
    return up, nearest_axis(world_front, across=up)


def write_arms(settings: OCTO_MOTION_PG_locomotion, arms: Iterable[ArmChain]) -> int:
    """Make the list these arms, keeping what the artist has set on those it had.

    Returns how many arms of a linked file could only be switched off.
    """
    linked = linked_names(settings, "arms")
    kept = {bones_of(item): _set_by_hand(item) for item in settings.arms if item.name not in linked}
    remaining = {bones_of(item): item.name for item in emptied(settings, "arms")}
    for arm in arms:
        name = remaining.pop(arm.bones, None)
        if name is None:
            item = add_item(settings, arm, **kept.get(arm.bones, {}))
        else:
            item = settings.arms[name]
        assign(item, "side", arm.side)
        assign(item, "pair", arm.pair)
    for name in remaining.values():
        assign(settings.arms[name], "enabled", value=False)
    settings.active_arm = min(settings.active_arm, max(0, len(settings.arms) - 1))
    return len(remaining)


def _set_by_hand(item: Any) -> dict[str, Any]:
    kept = ("phase", "flip", "enabled", "use_weights", "weight_root", "weight_tip")
    values = {name: getattr(item, name) for name in kept}
    if not _GIVEN_NAME.fullmatch(item.name):
        values["name"] = item.name
    return values


def add_item(settings: OCTO_MOTION_PG_locomotion, arm: ArmChain, **values: Any) -> Any:
    """Append an arm under a name that no other has, with these values of its properties."""
    name = free_name(settings.arms, values.pop("name", arm.name))
    item = settings.arms.add()
    item.name, item.side, item.pair = name, arm.side, arm.pair
    for bone in arm.bones:
        item.bones.add().name = bone
    for key, value in values.items():
        setattr(item, key, value)
    return item


def write_body(settings: OCTO_MOTION_PG_locomotion, found: Detection) -> None:
    """Set which way the body faces; the root bone stays as it is if it is one."""
    assign(settings, "body_up", found.up)
    assign(settings, "body_front", found.front)
    if settings.root_bone not in cast("Any", settings.id_data).data.bones:
        assign(settings, "root_bone", found.root_bone)


# --- The action that a motion is made anew in place of --------------------------------------------


def playing_action(armature: bpy.types.Object) -> bpy.types.Action | None:
    """The action that an armature has."""
    data = armature.animation_data
    return data.action if data is not None else None


def previous_action(
    armature: bpy.types.Object, settings: OCTO_MOTION_PG_locomotion
) -> bpy.types.Action | None:
    """The action to make anew: the one that plays if it was generated, else the last result."""
    spliced = cast("Any", armature).octo_motion.splicing.result
    playing = playing_action(armature)
    if playing is not None and playing != spliced and is_generated(playing):
        return playing
    return settings.result


@dataclass(frozen=True, eq=False)
class RigRead:
    """A creature as it was read, and what was seen on the way."""

    creature: Creature
    rest_body: BodyFrame
    """Where the body lies in the armature at rest."""
    detection: Detection | None
    """What was found, if the settings had no arms."""
    warnings: tuple[str, ...]
    """What there is to say of constraints and drivers."""
    poses: tuple[str, ...]
    """What there is to say of poses that stay."""


def read_creature(
    armature: bpy.types.Object, settings: OCTO_MOTION_PG_locomotion, world: Floats
) -> RigRead:
    """The rig, its arms, and where it stands by its world matrix (4, 4).

    Raises:
        RigError: it has no arms, bones are gone, or it is scaled unequally.
    """
    at_rest = read_skeleton(armature)
    scale = uniform_scale(armature)
    arms, rest_body, detection = listed_arms(settings, armature, at_rest)
    root_bone = chosen_root_bone(settings, armature, detection)
    skeleton, body = at_rest, rest_body
    for arm in arms:
        # Complains of bones that are gone.
        chain_of(skeleton, arm.bones)
    skeleton = at_rest = with_tips(armature, at_rest, [arm.bones for arm in arms])
    turned = [bone for arm in arms for bone in arm.bones]
    carriers: list[str] = []
    if settings.keep_pose:
        carriers = posed_carriers(settings, armature, skeleton, arms, root_bone)
    if carriers and (posed := as_posed(armature, skeleton, carriers, turned)) is not None:
        # Arms hang where the bones that carry them are.
        skeleton, carriers = posed, []
        body = listed_body(settings, posed, arms, detection)
    moved = {*turned, root_bone} - {""}
    present = armature.pose.bones if armature.pose is not None else ()
    channels = read_channels(
        armature,
        [name for name in at_rest.names if name in moved or name in present],
        travels=settings.travel_on == "OBJECT",
    )
    if settings.ground.stretch_as == "LOCATION":
        ways = [carried_by_length(at_rest, arm.bones) for arm in arms]
        channels = replace(channels, moved={name: way for each in ways for name, way in each})
    return RigRead(
        creature=Creature(
            skeleton=skeleton,
            at_rest=at_rest,
            arms=arms,
            bones=[arm.bones for arm in arms],
            body=body,
            listed=tuple(bones_of(item) for item in settings.arms if item.bones),
            root_bone=root_bone,
            world=world,
            scale=scale,
            channels=channels,
        ),
        rest_body=rest_body,
        detection=detection,
        # Detection has looked for constraints itself.
        warnings=(
            *(detection.notes if detection else warnings_for_driven_arms(skeleton, arms)),
            *warnings_for_driven(settings, armature, skeleton, root_bone),
        ),
        poses=tuple(
            warnings_for_poses(settings, armature, arms, carriers) if settings.keep_pose else ()
        ),
    )


def carried_by_length(
    skeleton: Skeleton, bones: Sequence[str]
) -> list[tuple[str, tuple[str, Floats]]]:
    """Of each bone of an arm but the last the one after it, and how far (3,) that moves in its rest
    frame where the bone gets twice as long.
    """
    numbers = [skeleton.index[name] for name in bones]
    steps = np.diff(skeleton.heads[numbers], axis=0)
    ways = rotate(conjugate(skeleton.rest_rotations[numbers[1:]]), steps)
    return list(zip(bones[:-1], zip(bones[1:], ways, strict=True), strict=True))


def uniform_scale(armature: bpy.types.Object) -> float:
    """Metres of the armature's unit.

    Raises:
        RigError: its world matrix is no rotation and one scale.
    """
    scale = even_scale(armature)
    # A world matrix has the scale but for the rounding of its rotation, and rotation is what an
    # earlier result changes: the same settings must give the same keys.
    own = np.abs(np.array(armature.scale) * np.array(armature.delta_scale)).mean()
    return float(own) if np.isclose(own, scale, rtol=1e-5) else float(f"{scale:.6g}")


def listed_arms(
    settings: OCTO_MOTION_PG_locomotion, armature: bpy.types.Object, skeleton: Skeleton
) -> tuple[tuple[Arm, ...], BodyFrame, Detection | None]:
    """Arms of the list, or those that are found where it is empty."""
    if len(settings.arms) == 0:
        found = detect_arms(skeleton, *world_directions(armature))
        arms = tuple(Arm(each.name, each.bones, each.side, each.pair) for each in found.arms)
        return arms, found.body, found
    arms = tuple(
        Arm(
            name=item.name,
            bones=bones_of(item),
            side=cast("Side", item.side),
            pair=item.pair,
            phase=item.phase,
            flip=item.flip,
            weights=(item.weight_root, item.weight_tip) if item.use_weights else (),
        )
        for item in settings.arms
        if item.enabled
    )
    if not arms:
        raise RigError("All arms are switched off.", "Switch on at least one in the list.")
    return arms, listed_body(settings, skeleton, arms, None), None


def listed_body(
    settings: OCTO_MOTION_PG_locomotion,
    skeleton: Skeleton,
    arms: tuple[Arm, ...],
    detection: Detection | None,
) -> BodyFrame:
    """Where the body lies in the armature, as its settings or detection say."""
    if detection is not None:
        found = [arm.bones for arm in arms]
        return body_frame(skeleton, found, detection.up, detection.front)
    # The body stays where it is, whichever arms are switched off.
    bones = [bones_of(item) for item in settings.arms if item.bones]
    return body_frame(skeleton, bones, settings.body_up, settings.body_front)


def chosen_root_bone(
    settings: OCTO_MOTION_PG_locomotion, armature: bpy.types.Object, detection: Detection | None
) -> str:
    """The bone that carries the body, "" for none.

    Raises:
        RigError: there is none to choose, or it cannot move.
    """
    if settings.travel_on == "OBJECT":
        return ""
    name = settings.root_bone or (detection.root_bone if detection else "")
    if not name and settings.travel_on == "NONE":
        return ""
    if not name:
        raise RigError(
            phrase("'{armature}' has no root bone.", armature=armature.name),
            "Choose the bone that carries the body, or let the object travel.",
        )
    bone = armature_data(armature).bones.get(name)
    if bone is None:
        raise RigError(
            phrase(
                "'{armature}' has no bone '{name}' to travel on.", armature=armature.name, name=name
            ),
            "Choose another root bone.",
        )
    if bone.use_connect and bone.parent is not None:
        raise RigError(
            phrase("The root bone '{name}' is connected to its parent and cannot move.", name=name),
            "Disconnect it, or choose the topmost bone.",
        )
    if not bone.use_local_location and bone.parent is not None:
        raise RigError(
            phrase("The root bone '{name}' does not move along its own axes.", name=name),
            "Switch on Local Location in its Relations, or choose the topmost bone.",
        )
    return name


def warnings_for_driven(
    settings: OCTO_MOTION_PG_locomotion,
    armature: bpy.types.Object,
    skeleton: Skeleton,
    root_bone: str,
) -> list[str]:
    """What there is to say of constraints and drivers that move the body."""
    told: list[str] = []
    if root_bone and is_driven(skeleton, [root_bone]):
        told.append(
            phrase(
                "Constraints or drivers move the root bone '{root_bone}': its keys have no "
                "effect while those are on.",
                root_bone=root_bone,
            )
        )
    travels = settings.travel_on == "OBJECT"
    if travels and any(acts(each) for each in armature.constraints):
        told.append(
            phrase("Constraints move '{armature}' away from its route.", armature=armature.name)
        )
    if travels and is_driven_object(armature):
        told.append(
            phrase("Drivers move '{armature}' away from its route.", armature=armature.name)
        )
    return told


def warnings_for_driven_arms(skeleton: Skeleton, arms: tuple[Arm, ...]) -> list[str]:
    """What there is to say of arms that constraints or drivers move."""
    bones = [bone for arm in arms for bone in arm.bones if is_driven(skeleton, [bone])]
    if not bones:
        return []
    told = phrase(
        "Constraints or drivers move {bones} of the arms ('{example}'{more}): keys there have "
        "little or no effect while those are on.",
        bones=_counted(bones),
        example=bones[0],
        more=" …" if bones[1:] else "",
    )
    return [told]


def _counted(bones: Sequence[str]) -> str:
    return phrase("one bone") if len(bones) == 1 else phrase("{count} bones", count=len(bones))


def warnings_for_display(armature: bpy.types.Object, render: bpy.types.RenderSettings) -> list[str]:
    """What there is to say of a motion that is there, but is not shown as it is."""
    told = warnings_for_layers(armature)
    if armature_data(armature).pose_position == "REST":
        told.append(
            phrase(
                "'{armature}' is shown in its rest position: its arms do not move. Choose Pose "
                "Position in the properties of the armature.",
                armature=armature.name,
            )
        )
    if render.frame_map_old != render.frame_map_new:
        told.append(
            phrase(
                "The scene stretches time ({old} to {new}): the motion plays at another speed "
                "than it was made for. Set both to the same number in the output properties.",
                old=render.frame_map_old,
                new=render.frame_map_new,
            )
        )
    return told


def warnings_for_layers(armature: bpy.types.Object) -> list[str]:
    """What there is to say of NLA tracks that do not let the motion through as it is."""
    data = armature.animation_data
    tracks = data.nla_tracks if data is not None and data.use_nla else ()
    if data is None or not any(len(track.strips) for track in tracks if not track.mute):
        return []
    name = f"'{armature.name}'"
    if is_layer(data.action):
        # An artist's own, over the motion.
        return []
    if any(track.is_solo for track in tracks):
        return [
            phrase("A solo NLA track of {name} hides the motion. Switch its star off.", name=name)
        ]
    if data.action_blend_type != "REPLACE" or data.action_influence < 1.0:
        told = phrase(
            "The NLA mixes the motion of {name} with its tracks. In the NLA editor's "
            "sidebar set Blending to Replace and Influence to 1 if it should not.",
            name=name,
        )
        return [told]
    return []


def keyed_anew(
    settings: OCTO_MOTION_PG_locomotion, armature: bpy.types.Object, root_bone: str
) -> set[str]:
    """Bones that carry the body and whose present pose does not last: the root bone gets keys, and
    what the motion before has keyed goes back to rest if it is not keyed again.
    """
    previous = previous_action(armature, settings)
    return {root_bone} | (animated_bones(previous) if previous is not None else set())


def posed_carriers(
    settings: OCTO_MOTION_PG_locomotion,
    armature: bpy.types.Object,
    skeleton: Skeleton,
    arms: tuple[Arm, ...],
    root_bone: str,
) -> list[str]:
    """Bones that carry arms, get no keys and are posed: by an artist, or by an imported file."""
    turned = {bone for arm in arms for bone in arm.bones}
    carrying = {each for bone in turned for each in skeleton.ancestors(skeleton.index[bone])}
    own = {skeleton.names[number] for number in carrying} - turned
    own -= keyed_anew(settings, armature, root_bone)
    return displaced_bones(armature, (), sorted(own))


def warnings_for_poses(
    settings: OCTO_MOTION_PG_locomotion,
    armature: bpy.types.Object,
    arms: tuple[Arm, ...],
    carriers: Sequence[str],
) -> list[str]:
    """What there is to say of poses that stay and move the arms.

    Carriers are bones that move the arms and could not be reckoned with.
    """
    turned = [bone for arm in arms for bone in arm.bones]
    if (previous := previous_action(armature, settings)) is not None:
        stretched_by_it = animated_bones(previous, LENGTH)
        turned = [bone for bone in turned if bone not in stretched_by_it]
    found = [*displaced_bones(armature, turned, ()), *carriers]
    if not found:
        return []
    told = phrase(
        "The pose of {bones} moves the arms ('{example}'): the body stands off its route by "
        "that. Clear it (Alt G, Alt R, Alt S in pose mode) if it should not.",
        bones=_counted(found),
        example=found[0],
    )
    return [told]


# --- Whether arms keep apart: from the rig and its skin to what is said of it ---------------------


_known: Final[ContentCache[BodyVolume]] = ContentCache(2)


def read_volume(
    settings: OCTO_MOTION_PG_locomotion,
    armature: bpy.types.Object,
    creature: Creature,
    *,
    live: bool = False,
) -> BodyVolume | None:
    """The arms and the parts of the body as thick as their skin, where that is asked for.

    Live, it is to be quick: which bones a skin follows is then looked at anew only where the skin
    has changed its form (see ``forget_skins``), and nothing is told of overlaps.
    """
    if not settings.keep_apart and (live or not settings.tell_overlaps):
        return None
    if not live:
        forget_skins()
    rig = creature.skeleton, creature.arms, creature.body
    key = content_key(*rig, skin_key(armature))
    return _known.get(key, lambda: _read_volume(armature, *rig))


def forget_skins() -> None:
    """Look anew at which bones skins follow."""
    _known.clear()


def _read_volume(
    armature: bpy.types.Object, skeleton: Skeleton, arms: tuple[Arm, ...], body: BodyFrame
) -> BodyVolume:
    limbs = {skeleton.index[bone] for arm in arms for bone in arm.bones}
    parts = [
        name
        for number, name in enumerate(skeleton.names)
        if skeleton.deform[number]
        and skeleton.weighted[number]
        # Neither of an arm, nor hanging on one.
        and limbs.isdisjoint([number, *skeleton.ancestors(number)])
    ]
    radii = radii_of_skin(armature, [arm.bones for arm in arms])
    parts_of_body = [
        Capsules(name, ends[None], thick, ends) for name, ends, thick in skin_parts(armature, parts)
    ]
    return BodyVolume(
        arms=tuple(frames_of_arm(skeleton, arm.bones, body) for arm in arms),
        names=tuple(arm.name for arm in arms),
        radii=tuple(radii),
        body=tuple(parts_of_body),
        upward=body.rotation[:, 2],
    )
