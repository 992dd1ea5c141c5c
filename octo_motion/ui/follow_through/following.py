# SPDX-License-Identifier: GPL-3.0-or-later
"""Follow-through of one armature, from settings to keys: read → plain arrays → compute → write."""

from __future__ import annotations

import json
from collections.abc import Generator
from dataclasses import dataclass
from typing import Any, Final

import bpy
import numpy as np

from ...blender.animation import (
    SplicedMotion,
    curves_of,
    layers_off,
    played_action,
    read_channels,
    read_clip,
    setting_values,
    strips_alone,
    strips_of,
    writable_armature,
    write_into,
    write_layer,
    write_spliced,
)
from ...blender.rig import LimbReader, is_part_of, pose_of, read_skeleton, selected_bones
from ...blender.scene import may_move, read_obstacle, read_places
from ...core.errors import ClipError, RigError, WriteError
from ...core.follow_through import (
    BodyCapsules,
    BoneMotion,
    Followed,
    FollowJob,
    FollowSettings,
    Limbs,
    MovingObstacles,
    between,
    chains_of,
    displacement,
    follow,
    limbs_of,
    own_rotations,
    repeats,
)
from ...core.keyframes import Channel, Limb, Track, reducing
from ...core.phrases import phrase
from ...core.posing.solver import Obstacle, OneThread, Plane
from ...core.rotations import Floats, conjugate, from_matrix, multiply, rotate
from ...core.skeleton import Skeleton
from ...core.splicing.clip import Clip
from ..declared_settings import plain, read_settings
from ..posing import marked_obstacles
from .properties import follow_settings

_READ: Final = 0.05
"""Share of the work that is done when all is read, …"""
_SIMULATED: Final = 0.9
"""… and when the motion is known, where few keys are wanted."""


@dataclass(frozen=True)
class FollowSummary:
    """What was made."""

    action: str
    frames: int
    bones: int
    frame_start: int
    frame_end: int
    warnings: tuple[str, ...] = ()

    @property
    def message(self) -> str:
        """One sentence."""
        return phrase(
            "{bones} {word}, {frames} frames: '{action}'.",
            bones=self.bones,
            word=phrase("bone") if self.bones == 1 else phrase("bones"),
            frames=self.frames,
            action=self.action,
        )


@dataclass(frozen=True, eq=False)
class _Read:
    """All that is needed of the scene, as plain data."""

    base: str
    """Names: references do not outlive a modal operator's tick."""
    slot: str
    clip: Clip
    job: FollowJob
    names: tuple[str, ...]
    modes: tuple[str, ...]


class FollowSession:
    """One armature's follow-through: worked out in steps, and written at the end."""

    def __init__(self, armature: bpy.types.Object) -> None:
        """Read what it is about. Nothing is changed.

        Raises:
            OctoMotionError: something is wrong that the user can put right.
        """
        self.armature = armature.name
        writable_armature(armature)
        self._read = _read(armature)
        self._channels: list[Channel] = []
        self._found: Followed | None = None

    def steps(self) -> Generator[float, None, None]:
        """Work it out; yields the share of the work that is done."""
        read, one_thread = self._read, OneThread()
        few = follow_settings(_local(self.armature)).keys == "REDUCED"
        span = (_SIMULATED if few else 1.0) - _READ
        yield _READ
        try:
            steps = follow(read.job)
            while True:
                try:
                    yield _READ + span * next(steps)
                except StopIteration as finished:
                    self._found = finished.value
                    break
        finally:
            one_thread.end()
        assert self._found is not None
        turn = from_matrix(read.clip.world[:, :3, :3] / read.clip.scale)
        job = read.job
        rotations = own_rotations(read.clip.skeleton, job.limbs, job.motion, turn, self._found)
        known = read_channels(_local(self.armature), read.names)
        channels = known.rotations(read.names, rotations)
        self._channels = (yield from self._reduced(channels)) if few else channels

    def _reduced(self, channels: list[Channel]) -> Generator[float, None, list[Channel]]:
        """The same with few keys."""
        settings, read = follow_settings(_local(self.armature)), self._read
        limbs = [
            Limb([Track(each.values, mode)], settings.key_angle, 1.0)
            for each, mode in zip(channels, read.modes, strict=True)
        ]
        steps = reducing(read.clip.frames, limbs, loops=read.job.cycle is not None)
        while True:
            try:
                yield _SIMULATED + (1.0 - _SIMULATED) * next(steps)
            except StopIteration as finished:
                found = finished.value
                break
        return [
            Channel(each.data_path, each.values, each.group, keys)
            for each, (keys,) in zip(channels, found, strict=True)
        ]

    def end(self) -> FollowSummary:
        """Write what was worked out.

        Raises:
            WriteError: the armature is gone, or has become read-only.
        """
        assert self._found is not None
        armature, read = _local(self.armature), self._read
        writable_armature(armature)
        settings = follow_settings(armature)
        base = bpy.data.actions.get(read.base)
        if base is None:
            raise WriteError(
                phrase("The action '{action}' is gone.", action=read.base), "Choose another one."
            )
        slot = base.slots.get(read.slot) if read.slot else None
        action = self._write(armature, settings, base, slot)
        if settings.base != base:
            settings.base = base
        settings.result = None if action == base else action
        frames = read.clip.frames
        warnings: list[str] = []
        if not self._found.repeats:
            warnings.append(
                phrase(
                    "The bones have not come to repeat themselves in {rounds} rounds: the end is "
                    "bent to meet the beginning. Raise Damping.",
                    rounds=self._found.rounds,
                )
            )
        return FollowSummary(
            action.name,
            len(frames),
            len(read.names),
            round(float(frames[0])),
            round(float(frames[-1])),
            tuple(warnings),
        )

    def _write(
        self,
        armature: bpy.types.Object,
        settings: Any,
        base: bpy.types.Action,
        slot: bpy.types.ActionSlot | None,
    ) -> bpy.types.Action:
        clip = self._read.clip
        if settings.result_as == "SAME":
            write_into(armature, base, slot, clip.frames, self._channels)
            return base
        first, last = float(clip.frames[0]), float(clip.frames[-1])
        motion = SplicedMotion(clip, clip, first, last, channels=self._channels)
        name = f"{base.name} Follow-Through"
        left_out = frozenset({"result", "active_chain"})
        note = json.dumps(plain(settings, without=left_out), sort_keys=True)
        previous = settings.result
        settings.result = None
        try:
            write = write_layer if settings.result_as == "LAYER" else write_spliced
            return write(armature, base, slot, motion, name=name, note=note, previous=previous)
        except BaseException:
            settings.result = previous
            raise


def _local(name: str) -> bpy.types.Object:
    found = bpy.data.objects.get((name, None))
    if found is None:
        raise WriteError(
            phrase("The armature '{armature}' is gone.", armature=name), "Choose another one."
        )
    return found


# --- Reading --------------------------------------------------------------------------------------


def followed_action(
    armature: bpy.types.Object,
) -> tuple[bpy.types.Action, bpy.types.ActionSlot | None]:
    """The action that is followed: the armature's own, or that of its one NLA strip. Where that has
    become a layer's base or is a result itself, the one that was followed before.

    Raises:
        ClipError: there is none, or the motion lies in several strips.
    """
    settings, data = follow_settings(armature), armature.animation_data
    own = None if data is None else data.action
    if own is not None and own != settings.result:
        assert data is not None
        slot = data.action_slot
        curves = () if slot is None else curves_of(own, slot)
        if any(not each.data_path.startswith("octo_motion.") for each in curves):
            return own, slot
    played = played_action(armature)
    if own is None and played is not None and played[0] != settings.result:
        action, slot = played
        return action, action.slots.get(slot)
    if settings.base is not None:
        return settings.base, None
    if strips_of(armature):
        raise strips_alone(armature)
    raise ClipError(
        phrase("'{armature}' has no action to follow.", armature=armature.name),
        "Give it one, or generate a motion first.",
    )


def _read(armature: bpy.types.Object) -> _Read:
    settings: Any = follow_settings(armature)
    skeleton = read_skeleton(armature)
    chains = _chosen(armature, settings, skeleton)
    bones = {bone for chain, _ in chains for bone in chain}
    limbs = limbs_of(skeleton, [skeleton.names[each] for each in bones])
    _check_free(skeleton, limbs)
    base, slot = followed_action(armature)
    above = {each for bone in limbs.bones for each in skeleton.ancestors(bone)}
    visual = settings.visual or any(skeleton.constrained[each] for each in above)
    with layers_off(armature, settings.result):
        clip = read_clip(armature, base, slot, visual=visual)
    reader = LimbReader(armature)
    orientations, heads = clip.posed()
    motion = BoneMotion(clip.rate, reader.unit * heads, orientations)
    root = [*skeleton.ancestors(limbs.bones[0]), limbs.bones[0]]
    still, things = _obstacles(armature, settings, reader.unit)
    cycle = displacement(motion, root[max(len(root) - 2, 0)])
    strengths = _strengths(armature, limbs, chains, clip.frames, (base, slot))
    # What else moves need not be where it was when the action begins again.
    alone = not things and (strengths is None or np.array_equal(strengths[0], strengths[-1]))
    loops = settings.loop and (clip.cyclic or (alone and repeats(motion, cycle)))
    job = FollowJob(
        limbs,
        reader.figure(limbs.bones, limbs.parents),
        motion,
        read_settings(FollowSettings, settings),
        wind=tuple(reader.unit * each for each in settings.wind),
        obstacles=still,
        moving=_moving(things, clip, reader.unit),
        body=BodyCapsules(*reader.rest_of_body(limbs.bones)) if settings.body else None,
        strengths=strengths,
        cycle=cycle if loops else None,
    )
    job.check()
    names = tuple(skeleton.names[each] for each in limbs.bones)
    pose = pose_of(armature).bones
    identifier = slot.identifier if slot is not None else ""
    modes = tuple(pose[each].rotation_mode for each in names)
    return _Read(base.name, identifier, clip, job, names, modes)


def _chosen(
    armature: bpy.types.Object, settings: Any, skeleton: Skeleton
) -> list[tuple[tuple[int, ...], int]]:
    """Chains of the list with their places in it, or of the bones that are selected (−1)."""
    if not len(settings.chains):
        picked = [skeleton.index[name] for name in selected_bones(armature)]
        return [(chain, -1) for chain in chains_of(skeleton, picked)]
    found = []
    for number, item in enumerate(settings.chains):
        if not item.use:
            continue
        first, last = item.name, item.last or item.name
        missing = next((each for each in (first, last) if each not in skeleton.index), None)
        if missing is not None:
            raise RigError(
                phrase("There is no bone '{name}'.", name=missing), "Choose the bones again."
            )
        chain = between(skeleton, skeleton.index[first], skeleton.index[last])
        if not chain:
            raise RigError(
                phrase("'{last}' does not hang on '{first}'.", last=last, first=first),
                "Choose the first and the last bone of one chain.",
            )
        found.append((chain, number))
    return found


def _check_free(skeleton: Skeleton, limbs: Limbs) -> None:
    held = [skeleton.names[each] for each in limbs.bones if skeleton.constrained[each]]
    if held:
        raise RigError(
            phrase(
                "Constraints or drivers move '{name}': keys of its own would not show.",
                name=held[0],
            ),
            "Choose the control bones that move it, or mute the constraints.",
        )


def _strengths(
    armature: bpy.types.Object,
    limbs: Limbs,
    chains: list[tuple[tuple[int, ...], int]],
    frames: Floats,
    followed: tuple[bpy.types.Action, bpy.types.ActionSlot | None],
) -> Floats | None:
    """(frames, bones) or (1, bones), none where all are as strong as all."""
    settings: Any = follow_settings(armature)
    place = {bone: number for number, bone in enumerate(limbs.bones)}
    result = np.ones((1, len(limbs.bones)))
    for chain, number in chains:
        if number < 0:
            continue
        item, along = settings.chains[number], np.linspace(0.0, 1.0, len(chain))
        values = [np.full(1, getattr(item, name)) for name in ("strength", "tip")]
        for row, name in enumerate(("strength", "tip")):
            path = f"octo_motion.follow_through.chains[{number}].{name}"
            keyed = setting_values(armature, path, frames, *followed)
            if keyed is not None:
                values[row] = np.clip(keyed, 0.001, 1000.0)
        strength, tip = (each[:, None] for each in values)
        own = strength * tip**along
        if len(own) > len(result):
            result = np.repeat(result, len(own), axis=0)
        result[:, [place[bone] for bone in chain]] = own
    return None if (result == 1.0).all() else result


def _obstacles(
    armature: bpy.types.Object, settings: Any, unit: float
) -> tuple[list[Obstacle], list[tuple[bpy.types.Object, Obstacle]]]:
    """What stands in the way, and objects that may move, as they are now."""
    scene = bpy.context.scene
    assert scene is not None
    found: list[Obstacle] = []
    things: list[tuple[bpy.types.Object, Obstacle]] = []
    if settings.floor:
        found.append(Plane(position=np.array([0.0, 0.0, unit * settings.floor_height])))
    for item, kind in marked_obstacles(scene) if settings.use_obstacles else ():
        if is_part_of(item, armature):
            continue
        shape = read_obstacle(item, kind, unit)
        if may_move(item):
            things.append((item, shape))
        else:
            found.append(shape)
    return found, things


def _moving(
    things: list[tuple[bpy.types.Object, Obstacle]], clip: Clip, unit: float
) -> MovingObstacles | None:
    """Things as they move over the frames of the action; none where there are none."""
    scene = bpy.context.scene
    if not things or scene is None:
        return None
    frames = np.append(clip.frames, scene.frame_current_final)
    positions, orientations = list[Floats](), list[Floats]()
    for item, shape in things:
        places, turns = read_places(item, frames)
        by = multiply(turns[:-1], conjugate(turns[-1]))
        apart = shape.position - unit * places[-1]
        positions.append(unit * places[:-1] + rotate(by, apart))
        orientations.append(multiply(by, shape.orientation))
    ways = BoneMotion(clip.rate, np.stack(positions, axis=1), np.stack(orientations, axis=1))
    return MovingObstacles(tuple(shape for _, shape in things), ways)


def follow_action(armature: bpy.types.Object) -> FollowSummary:
    """Let an armature's bones follow its action, all at once.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """
    session = FollowSession(armature)
    for _ in session.steps():
        pass
    return session.end()
