# SPDX-License-Identifier: GPL-3.0-or-later
"""An armature as a puppet: which bones are bodies, how thick, how heavy, how far they turn."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import bpy
import numpy as np

from ...core.errors import RigError, WriteError
from ...core.phrases import phrase
from ...core.posing.puppet import (
    BODY,
    FOLLOW,
    FREE,
    SIZE,
    SMALLEST,
    Figure,
    JointCoefficients,
    JointLimits,
    Material,
    Pose,
    PosedBones,
    RigFacts,
    Roles,
    build_figure,
    diagonal,
    find_roles,
)
from ...core.rotations import Floats, from_matrix
from ...core.skeleton import Skeleton
from .armature import (
    acts,
    armature_data,
    carrying_bone,
    driven_channels,
    even_scale,
    limb_skin,
    pose_of,
    read_skeleton,
    vertex_positions,
)
from .controls import FULL, control_names, goal_bones, hangs_on, ik_chain, reaches, stiff_joints

MARK: Final = "octo_motion_puppet"
"""Custom property of a bone: "BODY" or "FOLLOW", where the artist has decided it."""

MATERIAL: Final = "octo_motion_material"
"""Custom property of a bone: what its joint alone is made of, four numbers of ``Material`` or ten
of ``JointCoefficients``."""
_NEVER: Final = -1.0
"""In place of what a joint bears that never yields: files of other programs know no infinity."""

MOST_LIMBS: Final = 300
"""More cannot be moved at a speed at which one could pose them."""

_TOLERANT: Final = frozenset({"LIMIT_ROTATION", "LIMIT_LOCATION", "LIMIT_SCALE", "MAINTAIN_VOLUME"})
"""Constraints under which a bone still turns as its keys say."""
_CARRYING: Final = _TOLERANT | {"CHILD_OF", "ARMATURE"}
"""Constraints under which it does too, though something else than its parent carries it."""
_ANGLE_LIMIT: Final = 2.0 * np.pi - 1e-4
"""A range as wide as a whole turn limits nothing; less what single precision loses of it."""
_PART: Final = re.compile(r"\.\d+$")
"""What names of a limb's parts differ in."""
_STRAIGHT: Final = float(np.cos(np.radians(3.0)))
_SAME_JOINT: Final = 0.01
"""Of the figure's size: joints closer than this are the same one."""
_STRAIGHT_LIMB: Final = 1e-3
_OWN_AXIS: Final = 0.95
"""Cosine from which on a joint bends about an axis of its own."""
_LEAST_BENT: Final = 0.08
"""Radians from straight, to which a knee stretches that inverse kinematics bend."""
_MOST_BENT: Final = 2.7
"""Radians from straight, to which a knee bends."""
_TOGETHER: Final = 0.01
"""Of a bone's length: a gap that is none."""
_MOST_VERTICES: Final = 6000
"""Of each mesh that are looked at: more make no better radius."""
_LEAST_WEIGHT: Final = 0.35
"""A vertex counts for the bone that has at least this share of it, and the most."""


@dataclass(frozen=True, eq=False)
class PuppetRig:
    """An armature taken for a puppet."""

    skeleton: Skeleton
    roles: Roles
    figure: Figure
    pose: Pose
    unit: float
    """Puppet metres of one metre in the world: every puppet is simulated at the same size."""
    needs: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """Where limbs are posed through controls: for each limb's bone all bones that it depends on,
    and the objects among these that are controls."""

    def body(self, bone: str, armature: str) -> int:
        """The body of a bone, or the one that a helper bone follows.

        Raises:
            RigError: the armature has no such bone, or it follows nothing.
        """
        number = self.skeleton.index.get(bone)
        if number is None:
            raise RigError(
                phrase("'{armature}' has no bone '{bone}'.", armature=armature, bone=bone),
                "Check its name.",
            )
        body = self.roles.follows[number]
        if body < 0:
            raise RigError(
                phrase("The bone '{bone}' is no limb of the puppet.", bone=bone),
                "Choose one that it carries.",
            )
        return body


def read_rig(armature: bpy.types.Object, *, smallest: float = SMALLEST) -> PuppetRig:
    """Make a figure of an armature as it stands now. Nothing in the file is changed.

    Bones below the ``smallest`` share of its size only follow.

    Raises:
        RigError: it is no armature, has no bones, no size, an uneven scale, or nothing to pose; or
            it is shown at rest.
    """
    skeleton = read_skeleton(armature)
    if len(pose_of(armature).bones) != len(skeleton):
        bpy.context.view_layer.update()
    if armature_data(armature).pose_position == "REST":
        raise RigError(
            phrase("'{armature}' is shown at rest, whatever its pose is.", armature=armature.name),
            "Set its data to Pose Position (Properties > Data > Skeleton).",
        )
    scale = even_scale(armature)
    posed = posed_bones(armature, scale, skeleton)
    skin = _read_skin(armature, skeleton)
    facts = RigFacts(
        moved=moved_bones(armature),
        weights=skin.weights,
        marks=bone_marks(armature),
        locked=_locked_bones(armature),
        smallest=smallest,
        goals=frozenset(goal_bones(armature)),
        followed=_followed(armature),
    )
    roles, needs = _roles(armature, skeleton, facts)
    if len(roles.bodies) > MOST_LIMBS:
        raise RigError(
            phrase(
                "'{armature}' has {count} limbs, more than {most_limbs}.",
                armature=armature.name,
                count=len(roles.bodies),
                most_limbs=MOST_LIMBS,
            ),
            "Raise Smallest Bone, or mark bones that are to follow.",
        )
    bodies = list(roles.bodies)
    unit = SIZE / (diagonal(skeleton.heads[bodies], skeleton.tails[bodies]) * scale)
    figure, pose = build_figure(
        skeleton,
        roles,
        _scaled(_as_limbs(posed, skeleton, roles) if needs else posed, unit),
        skin={bone: points * unit for bone, points in skin.points.items()},
        limits=_hinges(armature, skeleton, roles) | joint_limits(armature, through_controls=True)
        if needs
        else joint_limits(armature),
    )
    return PuppetRig(skeleton, roles, figure, pose, unit, needs)


def _roles(
    armature: bpy.types.Object, skeleton: Skeleton, facts: RigFacts
) -> tuple[Roles, Mapping[str, frozenset[str]]]:
    """Which bones are bodies; and what these depend on, if they are posed through controls.

    They are where something else moves a limb, and no bone that could be turned in its place
    carries it.
    """
    if not facts.moved:
        return find_roles(skeleton, facts, armature.name), {}
    needs = hangs_on(armature)
    bent = frozenset(bent_bones(armature))
    facts = replace(facts, carried={name: _carriers(name, needs, bent) for name in facts.moved})
    controls = set(control_names(armature, set().union(*needs.values())))
    controlled = replace(
        facts,
        controls={name: len(needs[name] & controls) for name in skeleton.names},
        marks=_parts(skeleton, needs, controls) | dict(facts.marks),
    )
    try:
        roles = find_roles(skeleton, facts, armature.name)
        lost = [skeleton.names[each] for each in roles.driven]
    except RigError:
        roles, lost = None, sorted(facts.moved)
    found = find_roles(skeleton, controlled, armature.name) if lost else None
    if found is not None:
        found = _bending(armature, skeleton, controlled, found)
        limbs = {skeleton.names[each] for each in found.bodies}
        carried = {
            skeleton.names[above] for each in found.bodies for above in skeleton.ancestors(each)
        }
        beside = set().union(*(needs[each] for each in lost if each in limbs)) - limbs - carried
        own = carried_bones(armature) | (bent - bent_bones(armature, wholly=True))
        if control_names(armature, beside | (limbs & own)):
            return found, {name: frozenset(needs[name]) for name in limbs}
    return roles or find_roles(skeleton, facts, armature.name), {}


def _bending(
    armature: bpy.types.Object, skeleton: Skeleton, facts: RigFacts, roles: Roles
) -> Roles:
    """The roles without the bodies at whose joints no control bends the rig: parts of others."""
    names = [skeleton.names[each] for each in roles.bodies]
    joints = {
        name: names[parent]
        for name, parent in zip(names, roles.parents, strict=True)
        if parent >= 0
    }
    if not joints:
        return roles
    size = float(np.ptp(skeleton.heads, axis=0).max()) * even_scale(armature)
    stiff = stiff_joints(armature, joints, size)
    if not stiff:
        return roles
    marks = dict.fromkeys(sorted(stiff), FOLLOW) | dict(facts.marks)
    return find_roles(skeleton, replace(facts, marks=marks), armature.name)


def _carriers(name: str, needs: Mapping[str, set[str]], bent: frozenset[str]) -> frozenset[str]:
    """Bones that a bone depends on by way of no inverse kinematics."""
    behind = set().union(*(needs[each] for each in needs[name] & bent))
    return frozenset(needs[name] - behind)


def _parts(skeleton: Skeleton, needs: Mapping[str, set[str]], controls: set[str]) -> dict[str, str]:
    """Marks of bones that only go on where their parent ends: parts of one limb, for its twist."""
    found: dict[str, str] = {}
    along = skeleton.rest_matrices[:, :3, 1]
    for bone, parent in enumerate(skeleton.parents):
        name = skeleton.names[bone]
        if parent < 0 or _PART.sub("", name) != _PART.sub("", skeleton.names[parent]):
            continue
        straight = along[bone] @ along[parent] > _STRAIGHT
        gap = float(np.linalg.norm(skeleton.heads[bone] - skeleton.tails[parent]))
        joined = gap < _TOGETHER * float(skeleton.lengths[bone])
        same = needs[name] & controls == needs[skeleton.names[parent]] & controls
        if straight and joined and same and skeleton.deform[bone] and skeleton.deform[parent]:
            found[name] = FOLLOW
    return found


def _as_limbs(posed: PosedBones, skeleton: Skeleton, roles: Roles) -> PosedBones:
    """Bones as long as the parts of their limbs together."""
    lengths = posed.lengths.copy()
    for bone, parent in enumerate(skeleton.parents):
        body = roles.follows[bone]
        name = _PART.sub("", skeleton.names[bone])
        own = bone not in roles.bodies and parent >= 0 and body >= 0
        if own and name == _PART.sub("", skeleton.names[roles.bodies[body]]):
            lengths[roles.bodies[body]] += posed.lengths[bone]
    return replace(posed, lengths=lengths)


def _scaled(posed: PosedBones, unit: float) -> PosedBones:
    return replace(posed, heads=posed.heads * unit, lengths=posed.lengths * unit)


def posed_bones(armature: bpy.types.Object, scale: float, skeleton: Skeleton) -> PosedBones:
    """All bones as they are shown now, in the world.

    Raises:
        RigError: a bone is nowhere.
    """
    shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert shown.pose is not None
    count = len(shown.pose.bones)
    buffer = np.empty(16 * count, dtype=np.float32)
    shown.pose.bones.foreach_get("matrix", buffer)
    # Blender hands over matrices column by column.
    matrices = buffer.reshape(count, 4, 4).transpose(0, 2, 1).astype(np.float64)
    if not np.isfinite(matrices).all():
        raise RigError(
            phrase("'{armature}' has bones posed at undefined positions.", armature=armature.name),
            "Clear their transforms (Pose > Clear Transform > All).",
        )
    world = np.array(shown.matrix_world, dtype=np.float64)
    turned = world[:3, :3] @ matrices[:, :3, :3]
    sizes = np.linalg.norm(turned, axis=1)
    return PosedBones(
        heads=matrices[:, :3, 3] @ world[:3, :3].T + world[:3, 3],
        rotations=from_matrix(_nearest_rotations(turned)),
        lengths=skeleton.lengths * sizes[:, 1],
        turn=from_matrix(world[:3, :3] / scale),
    )


def moved_bones(armature: bpy.types.Object) -> frozenset[str]:
    """Names of the bones that something else than their own rotation turns."""
    if armature.pose is None:
        return frozenset()
    found = {
        bone.name
        for bone in armature.pose.bones
        if any(each.type not in _TOLERANT and acts(each) for each in bone.constraints)
    }
    found.update(bent_bones(armature))
    found.update(
        name
        for name, channel, driver in driven_channels(armature)
        if channel.startswith("rotation_") and not driver.mute
    )
    return frozenset(found)


def carried_bones(armature: bpy.types.Object) -> set[str]:
    """Names of the bones that turn by their own rotation, but that not only their parent carries.

    Controls that change spaces are such ones.
    """
    assert armature.pose is not None
    acting = {
        bone.name: {each.type for each in bone.constraints if acts(each)}
        for bone in armature.pose.bones
    }
    return {name for name, kinds in acting.items() if kinds <= _CARRYING and not kinds <= _TOLERANT}


def _followed(armature: bpy.types.Object) -> str:
    """Name of the other armature that bones follow by their constraints, most of them; or none."""
    assert armature.pose is not None
    targets: list[Any] = [
        getattr(each, "target", None)
        for bone in armature.pose.bones
        for each in bone.constraints
        if acts(each)
    ]
    others = Counter(
        each.name for each in targets if each and each.type == "ARMATURE" and each != armature
    )
    return others.most_common(1)[0][0] if others else ""


def bent_bones(armature: bpy.types.Object, *, wholly: bool = False) -> set[str]:
    """Names of the bones that inverse kinematics bend; ``wholly``, so that nothing is left of how
    they turn by themselves.
    """
    assert armature.pose is not None
    least = FULL if wholly else 0.0
    return {
        each
        for bone in armature.pose.bones
        for constraint in bone.constraints
        if constraint.type in {"IK", "SPLINE_IK"} and acts(constraint)
        if constraint.influence >= least
        for each in ik_chain(bone, constraint)
    }


def bone_marks(armature: bpy.types.Object) -> dict[str, str]:
    """What the artist has decided of bones: "BODY" or "FOLLOW"."""
    return {
        bone.name: str(bone[MARK])
        for bone in armature_data(armature).bones
        if bone.get(MARK) in (BODY, FOLLOW)
    }


def mark_bones(armature: bpy.types.Object, names: list[str], mark: str) -> None:
    """Decide for bones: "BODY", "FOLLOW", or "" to let the extension tell."""
    bones = armature_data(armature).bones
    for name in names:
        if mark:
            bones[name][MARK] = mark
        elif MARK in bones[name]:
            del bones[name][MARK]


def bone_materials(armature: bpy.types.Object) -> dict[str, Material | JointCoefficients]:
    """Materials and coefficients of single bones; what is damaged counts for nothing."""
    found: dict[str, Material | JointCoefficients] = {}
    for bone in armature_data(armature).bones:
        values: Any = bone.get(MATERIAL)
        try:
            numbers = [float(each) for each in values or ()]
        except (TypeError, ValueError):
            continue
        made_of = _material_of(numbers) if len(numbers) == 4 else _coefficients_of(numbers)
        if made_of is not None:
            found[bone.name] = made_of
    return found


def _material_of(numbers: list[float]) -> Material | None:
    bears, springs, settles, gives = numbers
    known = not np.isnan((bears, springs)).any() and np.isfinite((settles, gives)).all()
    if not (known and min(springs, settles) > 0.0 and gives >= 0.0 and bears != 0.0):
        return None
    return Material(bears if bears > 0.0 else float(np.inf), springs, settles, gives)


def _coefficients_of(numbers: list[float]) -> JointCoefficients | None:
    if len(numbers) != 10 or not np.isfinite(numbers).all():
        return None
    *each, limit = numbers
    if min(each) < 0.0 or min(each[6:]) <= 0.0 or (limit < 0.0 and limit != _NEVER):
        return None
    stiffness, damping, flow = ((each[at], each[at + 1], each[at + 2]) for at in (0, 3, 6))
    return JointCoefficients(stiffness, damping, flow, limit if limit != _NEVER else float(np.inf))


def set_bone_material(
    armature: bpy.types.Object, name: str, material: Material | JointCoefficients | None
) -> None:
    """Let a bone's joint be of a material or coefficients of its own, or of the figure's again with
    None.

    Raises:
        WriteError: the bones are linked.
    """
    data = armature_data(armature)
    if not data.is_editable:
        raise WriteError(
            phrase("The bones of '{armature}' are linked and read-only.", armature=armature.name),
            "Let the whole figure have the material, or measure in the linked file.",
        )
    bone = data.bones[name]
    if material is None:
        if MATERIAL in bone:
            del bone[MATERIAL]
        return
    if isinstance(material, JointCoefficients):
        limit = material.yield_torque if np.isfinite(material.yield_torque) else _NEVER
        bone[MATERIAL] = [*material.stiffness, *material.damping, *material.flow, limit]
        return
    bears = material.bears if np.isfinite(material.bears) else _NEVER
    bone[MATERIAL] = [bears, material.springs, material.settles, material.gives]


def joint_limits(
    armature: bpy.types.Object, *, through_controls: bool = False
) -> dict[str, JointLimits]:
    """Limits of bones, from Limit Rotation constraints and limits of inverse kinematics.

    About axes that are locked, bones stay as they are. A range that a constraint gives goes before
    that of inverse kinematics about the same axis. Locks say nothing of bones that are
    posed through controls.
    """
    assert armature.pose is not None
    found: dict[str, JointLimits] = {}
    for bone in armature.pose.bones:
        ranges = _ik_limits(bone) | _limit_constraint(bone)
        x, y, z = np.array(bone.lock_rotation).tolist() if not through_controls else (False,) * 3
        if ranges or x or y or z:
            found[bone.name] = JointLimits(
                ranges.get("x", FREE), ranges.get("y", FREE), ranges.get("z", FREE), (x, y, z)
            )
    return found


def _hinges(armature: bpy.types.Object, skeleton: Skeleton, roles: Roles) -> dict[str, JointLimits]:
    """Limits of the joints that inverse kinematics bend: to the one side that it bends them to.

    That is the side to which the limb is bent at rest, or of a straight one that of its pole.
    Joints that bend about none of their own axes are left free.
    """
    found: dict[str, JointLimits] = {}
    bones = armature_data(armature).bones
    bodies = list(roles.bodies)
    near = _SAME_JOINT * float(np.ptp(skeleton.heads[bodies], axis=0).max())
    for reach in reaches(armature):
        if len(reach.chain) != 2:
            continue
        lower, upper = (bones[each] for each in reach.chain)
        along = [
            np.array(each.tail_local - each.head_local).astype(float) for each in (upper, lower)
        ]
        first, second = (each / np.linalg.norm(each) for each in along)
        axis = np.cross(first, second)
        if np.linalg.norm(axis) < _STRAIGHT_LIMB:
            pole = bones.get(reach.pole)
            if pole is None:
                continue
            axis = np.cross(np.array(pole.head_local - lower.head_local), first)
        axis /= max(float(np.linalg.norm(axis)), 1e-12)
        bent = float(np.arctan2(np.cross(first, second) @ axis, first @ second))
        apart = np.linalg.norm(skeleton.heads[bodies] - np.array(lower.head_local), axis=1)
        body = bodies[int(np.argmin(apart))]
        own = skeleton.rest_matrices[body][:3, :3].T @ axis
        number = int(np.argmax(np.abs(own)))
        if apart.min() > near or number == 1 or abs(own[number]) < _OWN_AXIS:
            continue
        # Of a straight limb nothing would tell to which side it bends again.
        least, most = min(_LEAST_BENT - bent, 0.0), _MOST_BENT - bent
        wanted = (least, most) if own[number] > 0.0 else (-most, -least)
        still = (0.0, 0.0)
        found[skeleton.names[body]] = JointLimits(
            wanted if number == 0 else still,
            still,
            wanted if number == 2 else still,
        )
    return found


def _limit_constraint(bone: bpy.types.PoseBone) -> dict[str, tuple[float, float]]:
    for constraint in bone.constraints:
        limit: Any = constraint
        if limit.type != "LIMIT_ROTATION" or limit.mute or limit.influence < 1.0:
            continue
        # Other spaces limit something else than the joint.
        if limit.owner_space == "LOCAL":
            return {
                axis: (getattr(limit, f"min_{axis}"), getattr(limit, f"max_{axis}"))
                for axis in "xyz"
                if getattr(limit, f"use_limit_{axis}")
                and getattr(limit, f"max_{axis}") - getattr(limit, f"min_{axis}") < _ANGLE_LIMIT
            }
    return {}


def _ik_limits(bone: bpy.types.PoseBone) -> dict[str, tuple[float, float]]:
    own: Any = bone
    ranges = {
        axis: (getattr(own, f"ik_min_{axis}"), getattr(own, f"ik_max_{axis}"))
        for axis in "xyz"
        if getattr(own, f"use_ik_limit_{axis}")
    }
    return ranges | {axis: (0.0, 0.0) for axis in "xyz" if getattr(own, f"lock_ik_{axis}")}


def _locked_bones(armature: bpy.types.Object) -> frozenset[str]:
    assert armature.pose is not None
    return frozenset(bone.name for bone in armature.pose.bones if all(np.array(bone.lock_rotation)))


@dataclass(frozen=True, eq=False)
class _Skin:
    """The meshes that an armature deforms."""

    points: Mapping[int, Floats]
    """(points, 3), world, as the skin is shown now, by the bone that moves them most."""
    weights: Mapping[str, float]
    """Summed over the skin, by bone."""


def _read_skin(armature: bpy.types.Object, skeleton: Skeleton) -> _Skin:
    depsgraph = bpy.context.evaluated_depsgraph_get()
    points: dict[int, list[Floats]] = defaultdict(list)
    sums = np.zeros(len(skeleton))
    for item in bpy.data.objects:
        if item.type != "MESH" or not item.users_scene:
            continue
        shown = item.evaluated_get(depsgraph)
        if not isinstance(shown.data, bpy.types.Mesh) or not len(shown.data.vertices):
            continue
        carrier = carrying_bone(item, armature)
        if carrier is not None:
            place = _vertices(shown)
            step = -(-len(place) // _MOST_VERTICES)
            points[skeleton.index[carrier]].append(place[::step])
            sums[skeleton.index[carrier]] += len(place)
        elif item.find_armature() == armature:
            bone_of_group = [skeleton.index.get(group.name, -1) for group in item.vertex_groups]
            owners = _owners(shown.data, bone_of_group, sums)
            place = _vertices(shown)
            for bone in {each for each in owners.values() if each >= 0}:
                points[bone].append(place[[n for n, each in owners.items() if each == bone]])
    return _Skin(
        points={bone: np.concatenate(parts) for bone, parts in points.items()},
        weights={skeleton.names[bone]: float(sums[bone]) for bone in np.flatnonzero(sums > 1e-3)},
    )


def skin_points(armature: bpy.types.Object, skeleton: Skeleton) -> Mapping[int, Floats]:
    """Points (points, 3) of the skin as shown now, world, by the bone that moves them most."""
    return _read_skin(armature, skeleton).points


def is_part_of(item: bpy.types.Object, armature: bpy.types.Object) -> bool:
    """Whether an object goes along with an armature: as its skin, or hung on it."""
    above: bpy.types.Object | None = item
    while above is not None:
        if above == armature or above.find_armature() == armature:
            return True
        above = above.parent
    return False


def _vertices(shown: bpy.types.Object) -> Floats:
    """Positions (vertices, 3) of an evaluated mesh object in the world."""
    mesh = shown.data
    assert isinstance(mesh, bpy.types.Mesh)
    matrix = np.array(shown.matrix_world, dtype=np.float64)
    place = vertex_positions(mesh).astype(np.float64)
    return place @ matrix[:3, :3].T + matrix[:3, 3]


def _owners(mesh: bpy.types.Mesh, bone_of_group: list[int], sums: Floats) -> dict[int, int]:
    """The bone that moves each looked-at vertex most; adds all weights to the bones' sums."""
    numbers = limb_skin(mesh)
    step = max(1, -(-len(numbers) // _MOST_VERTICES))
    owners: dict[int, int] = {}
    for number in numbers[::step].tolist():
        best, most, total = -1, 0.0, 0.0
        for each in mesh.vertices[number].groups:
            bone = bone_of_group[each.group] if each.group < len(bone_of_group) else -1
            if bone >= 0:
                sums[bone] += each.weight * step
                total += each.weight
                if each.weight > most:
                    best, most = bone, each.weight
        if most >= _LEAST_WEIGHT * total:
            owners[number] = best
    return owners


def _nearest_rotations(matrices: Floats) -> Floats:
    """The rotations in matrices that may scale and shear: their polar decompositions."""
    left, _, right = np.linalg.svd(matrices)
    flipped = np.linalg.det(left @ right) < 0.0
    left[flipped, :, -1] *= -1.0
    return left @ right
