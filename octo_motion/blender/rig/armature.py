# SPDX-License-Identifier: GPL-3.0-or-later
"""Armatures: their rest skeleton as plain arrays, their bones, and what may be done to them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Final

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector
from numpy.typing import NDArray

from ...core.content_cache import ContentCache, content_key
from ...core.errors import RigError, WriteError
from ...core.locomotion.rig import ArmSkin, arm_skin, joint_positions, nearest_bones
from ...core.phrases import phrase
from ...core.rotations import Floats
from ...core.skeleton import Skeleton, without_made_up_scale
from ...core.smoothing import smooth_step
from .. import versions

SUCKER_PROPERTY = "octo_motion_sucker"
"""Custom property of a bone: the local axis its suckers face, such as "-Z"."""

_known: Final[ContentCache[Skeleton]] = ContentCache(4)


def active_armature(context: bpy.types.Context) -> bpy.types.Object:
    """The armature that the user works on: the active object, the one that deforms it, the one
    whose contact it marks, or the one whose route or ground it is (a selected one first, of
    several).

    Raises:
        RigError: there is no such object.
    """
    active = context.object
    if active is None:
        raise RigError("No object is active.", "Select an armature.")
    if active.type == "ARMATURE":
        return active
    armature = active.find_armature() or _marked_armature(active) or _on_route(active, context)
    if armature is None:
        raise RigError(
            phrase("'{active}' is not an armature.", active=active.name), "Select an armature."
        )
    return armature


def _marked_armature(active: bpy.types.Object) -> bpy.types.Object | None:
    """The armature that a marker of a contact belongs to."""
    name = active.octo_motion.contact.armature  # type: ignore[attr-defined]
    found = bpy.data.objects.get(name) if name else None
    return found if found is not None and found.type == "ARMATURE" else None


def _on_route(active: bpy.types.Object, context: bpy.types.Context) -> bpy.types.Object | None:
    """The armature that goes along a curve, or over a mesh as its ground."""
    layer = context.view_layer
    if layer is None:
        return None
    followers = [
        each
        for each in layer.objects
        if each.type == "ARMATURE"
        # Settings come into being when they are looked at: what has none is left without.
        and each.is_property_set("octo_motion")
        and active in _goes_by(each.octo_motion.locomotion)
    ]
    return next((each for each in followers if each.select_get()), next(iter(followers), None))


def _goes_by(settings: Any) -> tuple[Any, Any]:
    return settings.route, settings.ground.object


def armature_data(armature: bpy.types.Object) -> bpy.types.Armature:
    """The armature's data, for an object that may turn out to be something else.

    Raises:
        RigError: the object is no armature.
    """
    data = armature.data
    if not isinstance(data, bpy.types.Armature):
        raise RigError(
            phrase("'{armature}' is not an armature.", armature=armature.name),
            "Select an armature.",
        )
    return data


def pose_of(armature: bpy.types.Object) -> bpy.types.Pose:
    """An armature object's pose.

    Raises:
        RigError: it has none yet.
    """
    if armature.pose is None:
        # An armature that was made a moment ago gets its pose with the next update.
        bpy.context.view_layer.update()
    if armature.pose is None:
        raise RigError(
            phrase("'{armature}' has no pose yet.", armature=armature.name),
            "Put it into a scene and leave edit mode.",
        )
    return armature.pose


def read_skeleton(armature: bpy.types.Object) -> Skeleton:
    """The rest skeleton of an armature object, in armature space; it may be in any mode.

    Raises:
        RigError: the object is no armature, has no bones, or a bone without length.
    """
    data = armature_data(armature)
    if armature.mode == "EDIT":
        # Bones made in edit mode exist for everyone else only once they are written back.
        armature.update_from_editmode()
    bones = list(data.bones)
    if not bones:
        raise RigError(
            phrase("'{armature}' has no bones.", armature=armature.name),
            "Add bones, or choose another armature.",
        )
    names = tuple(bone.name for bone in bones)
    index = {name: number for number, name in enumerate(names)}
    # Blender has them as they lie in memory: column by column, in single precision.
    columns = np.empty((len(bones), 4, 4), dtype=np.float32)
    data.bones.foreach_get("matrix_local", columns.ravel())
    matrices = columns.swapaxes(1, 2).astype(np.float64)
    if not np.isfinite(matrices).all():
        raise RigError(
            phrase("'{armature}' has bones at undefined positions.", armature=armature.name),
            "Repair its rest pose.",
        )
    lengths = np.empty(len(bones), dtype=np.float32)
    data.bones.foreach_get("length", lengths)
    lengths = lengths.astype(np.float64)
    above = [bone.parent for bone in bones]
    parents = tuple(-1 if each is None else index[each.name] for each in above)
    driven = _driven_bones(armature)
    weighted = {group.name for item in deformed_meshes(armature) for group in item.vertex_groups}
    skeleton = Skeleton(
        names=names,
        parents=parents,
        rest_matrices=matrices,
        lengths=without_made_up_scale(lengths, matrices[:, :3, 3], parents),
        connected=_flags(data, "use_connect"),
        deform=_flags(data, "use_deform"),
        inherits_rotation=_flags(data, "use_inherit_rotation"),
        constrained=tuple(bone.name in driven for bone in bones),
        weighted=tuple(bone.name in weighted for bone in bones),
        bendy_segments=_numbers(data, "bbone_segments"),
        sucker_axes=tuple(str(bone.get(SUCKER_PROPERTY, "")) for bone in bones),
    )
    # What was worked out of the same bones before stays with them.
    return _known.get(skeleton.content, lambda: skeleton)


def _flags(data: bpy.types.Armature, name: str) -> tuple[bool, ...]:
    """A property of all bones: read at once, that takes a fifth of the time."""
    found = np.empty(len(data.bones), dtype=np.bool_)
    data.bones.foreach_get(name, found)
    return tuple(found.tolist())


def _numbers(data: bpy.types.Armature, name: str) -> tuple[int, ...]:
    """The same of whole numbers."""
    found = np.empty(len(data.bones), dtype=np.int32)
    data.bones.foreach_get(name, found)
    return tuple(found.tolist())


def selected_bones(armature: bpy.types.Object) -> tuple[str, ...]:
    """Names of the bones selected in edit mode or in pose mode, parents before children."""
    data = armature_data(armature)
    if armature.mode == "EDIT":
        chosen = {bone.name for bone in data.edit_bones if bone.select}
        return tuple(bone.name for bone in data.edit_bones if bone.name in chosen)
    if armature.pose is None:
        return ()
    return tuple(bone.name for bone in armature.pose.bones if versions.is_selected(bone))


def deformed_meshes(armature: bpy.types.Object) -> list[bpy.types.Object]:
    """The mesh objects that an armature deforms, whether or not they are its children."""
    return [
        item
        for item in bpy.data.objects
        if item.type == "MESH" and item.find_armature() == armature
    ]


def acts(constraint: bpy.types.Constraint) -> bool:
    """Whether a constraint does anything at present."""
    return not constraint.mute and constraint.influence > 0.0


def even_scale(armature: bpy.types.Object) -> float:
    """The scale of an object, which must be the same in all directions.

    Raises:
        RigError: it is not, or zero, or negative, or sheared; or the object is nowhere.
    """
    world = np.array(armature.matrix_world, dtype=np.float64)
    matrix = world[:3, :3]
    sizes = np.linalg.norm(matrix, axis=0)
    name = f"'{armature.name}'"
    if not np.isfinite(world).all():
        raise RigError(
            phrase("{name} is at an undefined position.", name=name),
            "Clear its location, rotation and scale (Object > Clear).",
        )
    if sizes.min() <= 1e-9 * max(1.0, sizes.max()):
        raise RigError(
            phrase("{name} has no size.", name=name), "Give it a scale greater than zero."
        )
    if sizes.max() - sizes.min() > _EVEN * sizes.max():
        shown = ", ".join(f"{size:.4g}" for size in sizes)
        own = np.abs(np.array(armature.scale) * np.array(armature.delta_scale))
        inherited = armature.parent is not None and np.ptp(own) <= _EVEN * own.max()
        raise RigError(
            phrase("{name} is scaled unequally ({shown}).", name=name, shown=shown),
            "Apply the parent's scale."
            if inherited
            else "Apply its scale (Object > Apply > Scale).",
        )
    axes = matrix / sizes
    if np.abs(axes.T @ axes - np.eye(3)).max() > _EVEN:
        raise RigError(
            phrase("{name} is sheared by its parent.", name=name), "Apply the parent's scale."
        )
    if np.linalg.det(axes) < 0.0:
        raise RigError(
            phrase("{name} is mirrored by a negative scale.", name=name),
            "Apply its scale (Object > Apply > Scale).",
        )
    return float(sizes.mean())


def world_matrix(armature: bpy.types.Object) -> Floats:
    """The object's world matrix, (4, 4)."""
    return np.array(armature.matrix_world, dtype=np.float64)


def _driven_bones(armature: bpy.types.Object) -> set[str]:
    """Names of the bones that constraints move, or drivers."""
    if armature.pose is None:
        return set()
    names = {
        bone.name for bone in armature.pose.bones if any(acts(each) for each in bone.constraints)
    }
    transforms = ("location", "rotation_", "scale")
    return names | {
        name for name, channel, _ in driven_channels(armature) if channel.startswith(transforms)
    }


def driven_channels(
    armature: bpy.types.Object,
) -> Iterator[tuple[str, str, bpy.types.FCurve]]:
    """Bone, property and driver of all properties of bones that have one."""
    data = armature.animation_data
    for curve in data.drivers if data is not None else ():
        name, channel = bone_and_property(curve.data_path)
        if name:
            yield name, channel, curve


_EVEN: Final = 1e-3
"""Share by which scales of the three axes may differ, and cosine by which axes may be off a right
angle."""

_BONE_PATH: Final = re.compile(r'pose\.bones\["((?:[^"\\]|\\.)*)"\]\.?(.*)', re.DOTALL)


def bone_and_property(data_path: str) -> tuple[str, str]:
    """Name of the bone and its property that a data path leads to; "" and the path for others."""
    found = _BONE_PATH.fullmatch(data_path)
    if found is None:
        return "", data_path
    return bpy.utils.unescape_identifier(found[1]), found[2]


def is_driven_object(obj: bpy.types.Object) -> bool:
    """Whether drivers move or turn an object."""
    data = obj.animation_data
    moved = ("location", "rotation_", "delta_location", "delta_rotation_")
    return data is not None and any(
        not curve.mute and curve.data_path.startswith(moved) for curve in data.drivers
    )


def carrying_axes(bone: bpy.types.Bone) -> Matrix:
    """A bone's axes, seen along those in which its location is given when it is not local."""
    axes = bone.matrix_local.to_3x3()
    return axes if bone.parent is None else bone.parent.matrix_local.to_3x3().inverted() @ axes


def may_play_otherwise(armature: bpy.types.Object, bones: Iterable[str]) -> bool:
    """Whether bones may play otherwise than their keys and those of their object say.

    Constraints or drivers of theirs and of what carries them make it so, inverse kinematics
    anywhere, and NLA tracks. Constraints count that have no influence now: they may get one.
    """
    if armature.pose is None or armature_data(armature).pose_position == "REST":
        return False
    pose = armature.pose.bones
    moved = {each.name for name in bones for each in (pose[name], *pose[name].parent_recursive)}
    if any(
        not constraint.mute and (bone.name in moved or constraint.type in {"IK", "SPLINE_IK"})
        for bone in pose
        for constraint in bone.constraints
    ):
        return True
    if any(name in moved for name, _, _ in driven_channels(armature)):
        return True
    data = armature.animation_data
    tracks = data.nla_tracks if data is not None and data.use_nla else ()
    if any(len(track.strips) > 0 and not track.mute for track in tracks):
        return True
    return is_driven_object(armature) or _hangs_on_moving(armature)


def _hangs_on_moving(obj: bpy.types.Object) -> bool:
    """Whether constraints move an object, or anything its parents."""
    if any(not each.mute for each in obj.constraints):
        return True
    parent = obj.parent
    return parent is not None and (parent.animation_data is not None or _hangs_on_moving(parent))


# --- What the list of arms needs of an armature object --------------------------------------------


def world_directions(armature: bpy.types.Object) -> tuple[Floats, Floats]:
    """The world's up (+Z), and where a character faces (−Y), in armature space, (3,) each."""
    inverse = armature.matrix_world.to_3x3().inverted_safe()
    up, front = (inverse @ Vector(axis) for axis in ((0, 0, 1), (0, -1, 0)))
    return np.array(up, dtype=np.float64), np.array(front, dtype=np.float64)


def require_editable(armature: bpy.types.Object) -> None:
    """Make sure that settings written on this armature are saved with the file.

    Raises:
        RigError: the object is no armature.
        WriteError: it is linked, or a library override that is not editable.
    """
    armature_data(armature)
    if armature.library is not None:
        raise WriteError(
            phrase(
                "'{armature}' is linked from '{library}': its settings are read-only here.",
                armature=armature.name,
                library=armature.library.name,
            ),
            "Make a library override (Object > Library Override > Make).",
        )
    override = armature.override_library
    if override is not None and override.is_system_override:
        raise WriteError(
            phrase(
                "'{armature}' is a library override that is not editable.", armature=armature.name
            ),
            "Make it editable: select it and choose Object > Library Override > Make.",
        )


def hidden_bones(armature: bpy.types.Object, names: Iterable[str]) -> tuple[str, ...]:
    """Those of the bones that pose mode does not show.

    Raises:
        RigError: a bone does not exist.
    """
    bones = _pose_bones(armature, names)
    return tuple(bone.name for bone in bones if not _is_shown(bone))


def select_pose_bones(
    armature: bpy.types.Object, names: Iterable[str], *, extend: bool = False
) -> None:
    """Select bones in pose mode, the first of them active.

    Hidden bones stay unselected: they could be keyed by mistake.

    Raises:
        RigError: a bone does not exist.
    """
    chosen = [bone for bone in _pose_bones(armature, names) if _is_shown(bone)]
    if not extend and armature.pose is not None:
        for bone in armature.pose.bones:
            versions.select(bone, state=False)
    for bone in chosen:
        versions.select(bone, state=True)
    if chosen:
        bones = armature_data(armature).bones
        bones.active = bones[chosen[0].name]


def _pose_bones(armature: bpy.types.Object, names: Iterable[str]) -> list[bpy.types.PoseBone]:
    bones = armature.pose.bones if armature.pose is not None else {}
    found: list[bpy.types.PoseBone] = []
    for name in names:
        bone = bones.get(name)
        if bone is None:
            raise RigError(
                phrase("The armature has no bone '{name}'.", name=name), "Detect the arms again."
            )
        found.append(bone)
    return found


def _is_shown(bone: bpy.types.PoseBone) -> bool:
    collections = bone.bone.collections
    in_view = not collections or any(each.is_visible_effectively for each in collections)
    return in_view and not versions.is_hidden(bone)


# --- Which bones may get longer and thinner -------------------------------------------------------
#
# A bone's scale reaches its children. Where they inherit it along their own axes (Blender's
# *Aligned*) or not at all, each bone can be as long as it likes; where they inherit it in full,
# stretched bones shear those that bend away from them.


ALIGNED: Final = "ALIGNED"
_APART: Final = {"NONE", "NONE_LEGACY"}
"""Ways of a bone not to inherit its parent's scale."""
_CLOSE: Final = 1e-4
"""Bone lengths that a bone's head may be off its parent's tail."""


def may_stretch(
    armature: bpy.types.Object, bones: Sequence[str], *, by_moving: bool = False
) -> bool:
    """Whether the bones of an arm, root to tip, can be made longer without harm: by their scale, or
    by moving the one after each.
    """
    data = armature_data(armature).bones
    chain = [data[name] for name in bones]
    for upper, lower in pairwise(chain):
        if lower.parent != upper:
            return False
        if by_moving:
            along = lower.use_local_location and lower.use_inherit_rotation
            if lower.use_connect or not along:
                return False
            continue
        if lower.inherit_scale not in {ALIGNED, *_APART}:
            return False
        if (lower.head_local - upper.tail_local).length > _CLOSE * upper.length:
            return False
    return True


def connected_bones(armature: bpy.types.Object, arms: Sequence[Sequence[str]]) -> list[str]:
    """Bones of arms, root to tip, that are connected to the one before, and so cannot be moved."""
    data = armature_data(armature).bones
    return [
        name
        for bones in arms
        for before, name in pairwise(bones)
        if name in data and data[name].use_connect and data[name].parent == data.get(before)
    ]


def disconnect_bones(armature: bpy.types.Object, bones: Sequence[str]) -> None:
    """Let connected bones be moved. Nothing else changes.

    Raises:
        WriteError: the bones are linked, or the armature is hidden.
    """
    data = armature_data(armature)
    if not data.is_editable:
        raise WriteError(
            phrase("The bones of '{armature}' are linked and read-only.", armature=armature.name),
            "Open the file that they are from.",
        )
    layer = bpy.context.view_layer
    assert layer is not None
    if armature.name not in layer.objects or not armature.visible_get(view_layer=layer):
        raise WriteError(
            phrase("'{armature}' is hidden.", armature=armature.name),
            "Show it and its collection.",
        )
    active, mode = layer.objects.active, armature.mode
    layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for name in bones:
        data.edit_bones[name].use_connect = False
    bpy.ops.object.mode_set(mode=mode)
    layer.objects.active = active


# --- Lists of settings in library overrides -------------------------------------------------------


def linked_names(settings: bpy.types.PropertyGroup, collection: str) -> frozenset[str]:
    """Names of the items of a list of settings that a library override has from its linked file.

    Blender allows to change their settings, but neither to rename, remove nor reorder them; items
    added in this file are free.
    """
    override = settings.id_data.override_library if settings.id_data else None
    if override is None or override.reference is None:
        return frozenset()
    original: Any = override.reference.path_resolve(settings.path_from_id())
    return frozenset(item.name for item in getattr(original, collection))


_SAME: Final = 1e-5
"""Share of its largest number by which a matrix may be off another, in single precision."""


def world_of(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Matrix:
    """World matrix of an object, which may be disabled in viewports, or excluded.

    Blender leaves such an object's own world matrix as it was long ago, of a file that was opened
    even at the origin, and does not always tell so: what a setting points at counts as evaluated.
    So its transform and its parents' are put together here. Where something else moves it,
    Blender's matrix is all there is.
    """
    evaluated = obj.evaluated_get(depsgraph)
    if len(obj.constraints) > 0 or obj.rigid_body is not None or obj.parent_type != "OBJECT":
        return evaluated.matrix_world
    own = obj.matrix_basis
    if obj.parent is not None:
        own = world_of(obj.parent, depsgraph) @ obj.matrix_parent_inverse @ own
    away = np.abs(np.array(evaluated.matrix_world) - np.array(own)).max()
    # The same but for rounding: what others compute from it must not change in the last digit.
    return evaluated.matrix_world if away <= _SAME * np.abs(np.array(own)).max() else own


# --- How thick the skin is about bones, measured on the meshes that an armature deforms -----------


_MOST_POINTS: Final = 6000
"""Points of a skin that are looked at; an arm's thickness needs no more."""

_THICKEST: Final = 0.2
"""Arm lengths from an arm's middle line: what is further away is not its skin."""

_SLENDER: Final = (0.03, 0.008)
"""Radius of an arm without a skin at its root and at its tip, in arm lengths."""

_PLACED_TO: Final = 1e-5
"""Share of an armature's size, and of 1, to which it is known where its skin is."""

_SHARE: Final = 0.9
"""Of the points round a joint, the share that lies nearer to it than its radius: an arm lies on its
suckers, and on what comes out at bends …"""

_STANDS_OUT: Final = 1.25
"""… unless they are so many times as far away as half of them: webs and fins are no thickness …"""

_AT_LEAST: Final = 0.7
"""… but then this share lies nearer."""

_skins_known: Final[ContentCache[list[ArmSkin]]] = ContentCache(4)

_MOST_VERTICES: Final = 3_000
"""Of more, only every second, third … is looked at."""
_FEW: Final = 4
"""Vertices of a bone that do not yet tell its thickness."""
_MOST: Final = 0.75
"""Share of a bone's vertices that lie within its radius: suckers stand out a little."""
_MOST_OF_SIDE: Final = 0.95
"""The same of how far they lie to the sides. At 0.9 tips of Curl are in the octopus' mantle at two
moments of 49, at 0.95 at none."""
_NEAR: Final = 0.2
"""Share of a part's vertices that tell how thick it is somewhere along it."""
_ASIDE: Final = 0.1
"""Of the thickest part: how much wider than deep another has to be for that to matter."""
_TIMES: Final = 3
"""How often it is looked how thick it is where it ends, and where it ends as it is so thick."""
_LAST: Final = 0.05
"""Share of a part's vertices that tell whether its end is round …"""
_ROUND: Final = 0.4, 0.3
"""… as it is where they are nearer to its axis than that share of its radius, and not where they
are farther by the next: of a ball they are at 0.31."""
_REACHED: Final = 0.02
"""Share of a part's vertices at either end that stand out of it."""
_MUCH: Final = 1.5
"""How much larger a part about its bone may be than one about its own longest way."""
_THREAD: Final = 1e-4
"""Share of its length up to which a part has no thickness."""
_BEYOND: Final = 1.1
"""Lengths of an arm's last bone that its skin reaches at least to count as going beyond it."""
_TOP: Final = 0.8
"""Share of that skin's reach from which on it is its tip."""
_ROUNDED: Final = 1e-6
"""To which a skin's place on its armature is known."""
_BONE_ROOT, _BONE_TIP = 0.06, 0.012
"""Radius in arm lengths at root and tip of an arm without skin."""
WEB_ATTRIBUTE: Final = "octo_motion_web"
"""Boolean attribute of a skin's vertices: true where they are a web between limbs, no limb."""


def vertex_positions(mesh: bpy.types.Mesh) -> NDArray[np.float32]:
    """(vertices, 3) in the mesh's own space."""
    points = np.empty((len(mesh.vertices), 3), dtype=np.float32)
    if len(points):
        # The attribute is much quicker to read than the property that shows the same.
        attribute: Any = mesh.attributes["position"]
        attribute.data.foreach_get("vector", points.ravel())
    return points


def limb_skin(mesh: bpy.types.Mesh) -> NDArray[np.int64]:
    """Vertices (n,) of a mesh that tell how thick limbs are: all but a web between them."""
    web: Any = mesh.attributes.get(WEB_ATTRIBUTE)
    if (
        not isinstance(web, bpy.types.BoolAttribute)
        or web.domain != "POINT"
        or len(web.data) != len(mesh.vertices)
    ):
        return np.arange(len(mesh.vertices))
    flags = np.zeros(len(mesh.vertices), dtype=bool)
    web.data.foreach_get("value", flags)
    return np.flatnonzero(~flags)


def radii_of_skin(armature: bpy.types.Object, chains: Sequence[Sequence[str]]) -> list[Floats]:
    """Radii (bones + 1,) of the skin at the joints of each chain, root to tip, armature units.

    Within a bone's lie three quarters of the vertices that follow it more than any other bone, at
    rest. Bones without such vertices take over their neighbours'; a chain without any is given the
    slender form that arms usually have.
    """
    assert isinstance(armature.data, bpy.types.Armature)
    bones = armature.data.bones
    distances: dict[str, list[Floats]] = {}
    for name, points in _followers(armature):
        bone = bones.get(name)
        if bone is None:
            continue
        head, tail = (np.array(end) for end in (bone.head_local, bone.tail_local))
        along = tail - head
        share = np.clip((points - head) @ along / max(along @ along, 1e-18), 0.0, 1.0)
        off = points - head - share[:, None] * along
        distances.setdefault(name, []).append(np.linalg.norm(off, axis=1))
    measured = {name: np.concatenate(each) for name, each in distances.items()}
    return [_of_chain(bones, chain, measured) for chain in chains]


def with_tips(
    armature: bpy.types.Object, skeleton: Skeleton, arms: Sequence[Sequence[str]]
) -> Skeleton:
    """The same skeleton with arms (bones, root to tip) that end where their skin does."""
    ends = {bones[-1]: joint_positions(skeleton, bones)[-2:] for bones in arms}
    found: dict[str, list[Floats]] = {name: [] for name in ends}
    for name, points in _followers(armature):
        if name in found:
            found[name].append(points)
    tips: dict[str, float] = {}
    for name, each in found.items():
        points, (head, tail) = np.concatenate([np.zeros((0, 3)), *each]), ends[name]
        length = float(np.linalg.norm(tail - head))
        if len(points) < _FEW or length == 0.0:
            continue
        along = (points - head) @ (tail - head) / length
        if along.max() <= length:
            continue
        top = along >= _TOP * along.max()
        off = points[top] - head - along[top, None] * (tail - head) / length
        # A round end lies on its own middle.
        far = float(along.max() - np.quantile(np.linalg.norm(off, axis=1), _MOST))
        if far > _BEYOND * length:
            tips[name] = far
    if not tips:
        return skeleton
    longer = replace(skeleton, tips=tips)
    return _known.get(longer.content, lambda: longer)


def skin_parts(
    armature: bpy.types.Object, names: Sequence[str]
) -> list[tuple[str, Floats, Floats]]:
    """Parts of a body as thick and as long as the skin that follows single bones.

    A bone's own ends tell little of that: a head is round about a bone of any length, and files of
    other programs know no tails. So a part reaches as far as its skin does along its bone, or along
    the skin's own longest way if that makes it much smaller. Bones that no skin follows, or a mere
    line of it, are none. Returns name, joints (n, 3) and radii (n,) of each part, armature space.
    """
    assert isinstance(armature.data, bpy.types.Armature)
    bones = armature.data.bones
    found: dict[str, list[Floats]] = {name: [] for name in names}
    for name, points in _followers(armature):
        if name in found:
            found[name].append(points)
    parts: list[tuple[str, Floats, Floats]] = []
    for name, each in found.items():
        points = np.concatenate([np.zeros((0, 3)), *each])
        if len(points) < _FEW:
            continue
        head, tail = (np.array(end) for end in (bones[name].head_local, bones[name].tail_local))
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        around = points - points.mean(axis=0)
        own = np.linalg.eigh(around.T @ around)[1][:, 2]
        along = (tail - head) / max(float(np.linalg.norm(tail - head)), 1e-12)
        part, other = _part(points, head, along), _part(points, middle, own)
        joints, radii = part if _volume(*part) <= _MUCH * _volume(*other) else other
        if radii.max() > _THREAD * np.ptp(points, axis=0).max():
            parts.append((name, joints, radii))
    thickest = max((float(radii.max()) for _, _, radii in parts), default=0.0)
    return [(name, *_rounded(joints, radii, _ASIDE * thickest)) for name, joints, radii in parts]


def _part(points: Floats, start: Floats, along: Floats) -> tuple[Floats, Floats]:
    """Joints (4, 3) and radii (4,) of capsules about a line that points (n, 3) lie round: up one
    side, across, and down the other side, as far from each other as the part is wider than deep.
    """
    seen = points - start
    height = seen @ along
    across = seen - height[:, None] * along
    wide = np.linalg.eigh(across.T @ across)[1][:, 2]
    sides = np.abs(np.stack([across @ wide, across @ np.cross(along, wide)]))
    away = np.linalg.norm(across, axis=1)
    radius = float(np.quantile(away, _MOST))
    low, high = np.quantile(height, [_REACHED, 1.0 - _REACHED])
    order, left, right, radii = np.argsort(height), [], [], []
    some, few = (max(_FEW, round(share * len(points))) for share in (_NEAR, _LAST))
    for end, inwards, last in ((low, 1.0, order[:few]), (high, -1.0, order[-few:])):
        # As far from its end as it is thick there, and half as far where that is open and the
        # body goes on in another part; but not beyond the middle.
        share = np.array(np.median(away[last]) / max(radius, 1e-12))
        inside = 1.0 - 0.5 * float(smooth_step((share - _ROUND[0]) / _ROUND[1]))
        half, at = np.full(2, radius), end
        for _ in range(_TIMES):
            at = end + inwards * min(inside * float(half.min()), 0.5 * (high - low))
            near = np.argpartition(np.abs(height - at), min(some, len(height)) - 1)[:some]
            half = np.quantile(sides[:, near], _MOST_OF_SIDE, axis=1)
        shift = (half[0] - half.min()) * wide
        left.append(start + at * along - shift)
        right.append(start + at * along + shift)
        radii.append(float(half.min()))
    return np.array([*left, *reversed(right)]), np.array([*radii, *reversed(radii)])


def _rounded(joints: Floats, radii: Floats, least: float) -> tuple[Floats, Floats]:
    """One capsule in place of two beside each other, where these are no farther apart."""
    aside = 0.5 * np.linalg.norm(joints[:2] - joints[:1:-1], axis=1)
    if aside.max() > least:
        return joints, radii
    return 0.5 * (joints[:2] + joints[:1:-1]), radii[:2] + 0.5 * aside


def _volume(joints: Floats, radii: Floats) -> float:
    radius = float(radii.mean() + 0.25 * np.linalg.norm(joints[1] - joints[2]))
    length = float(np.linalg.norm(joints[1] - joints[0]))
    return radius * radius * (length + 4.0 / 3.0 * radius)


def skin_key(armature: bpy.types.Object) -> bytes:
    """What the radii hang on, as far as it can be read at once: not which bones points follow."""
    return content_key([(each.groups, _seen(each)) for each in _surfaces(armature)])


def _of_chain(
    bones: bpy.types.ArmatureBones, chain: Sequence[str], measured: dict[str, Floats]
) -> Floats:
    lengths = np.array([bones[name].length for name in chain])
    middles = np.cumsum(lengths) - 0.5 * lengths
    known = [number for number, name in enumerate(chain) if len(measured.get(name, ())) >= _FEW]
    joints = np.concatenate([[0.0], np.cumsum(lengths)])
    whole = float(lengths.sum())
    if not known:
        return np.interp(joints, [0.0, whole], [_BONE_ROOT * whole, _BONE_TIP * whole])
    radii = np.array([float(np.quantile(measured[chain[number]], _MOST)) for number in known])
    places = middles[known]
    result = np.interp(joints, places, radii)
    if len(known) > 1:
        # Beyond the last middle it goes on as it went, not below a third of what it was.
        slope = (radii[-1] - radii[-2]) / (places[-1] - places[-2])
        beyond = joints > places[-1]
        result[beyond] = radii[-1] + slope * (joints[beyond] - places[-1])
        result = np.maximum(result, 0.3 * radii[-1])
    # Thicker further out are webs, fins and what few vertices do not tell.
    return np.minimum.accumulate(result)


@dataclass(frozen=True, eq=False)
class _Surface:
    """A mesh that an armature moves, as it is at rest: limbs alone, webs left out."""

    points: NDArray[np.float32]
    """(n, 3) in the mesh's own space."""
    matrix: Floats
    """(4, 4) from there to the armature's."""
    groups: tuple[str, ...]
    """What each point can follow …"""
    leading: Callable[[], NDArray[np.int64]]
    """… and which of these each ``step``-th point follows most (some,), none by -1."""
    step: int
    """Of more points than are looked at, only every second, third … is."""


_SHAPING: Final = frozenset({"MIRROR", "MULTIRES", "SKIN", "SOLIDIFY", "SUBSURF"})
"""Modifiers that make of a mesh the surface which is seen, whatever moves it: of half a creature a
whole one, of a cage of few points the skin inside of it."""

_shaped: Final[ContentCache[NDArray[np.float32]]] = ContentCache(8)


def carrying_bone(item: bpy.types.Object, armature: bpy.types.Object) -> str | None:
    """The bone on which a stiff part hangs, itself or by its parents."""
    each: bpy.types.Object | None = item
    while each is not None:
        if each.parent == armature:
            known = each.parent_type == "BONE" and each.parent_bone in armature_data(armature).bones
            return each.parent_bone if known else None
        each = each.parent
    return None


def _surfaces(armature: bpy.types.Object) -> Iterator[_Surface]:
    """All that shows how thick an armature's limbs are: skins, and stiff parts hung on bones."""
    inverse = np.linalg.inv(np.array(armature.matrix_world, dtype=np.float64))
    bones = armature_data(armature).bones
    for item in bpy.data.objects:
        if item.type != "MESH":
            continue
        if item.find_armature() == armature:
            matrix = inverse @ np.array(item.matrix_world, dtype=np.float64)
            yield _surface(item, matrix, tuple(group.name for group in item.vertex_groups), bones)
        elif not item.hide_render and (carrier := carrying_bone(item, armature)) is not None:
            made = _surface(item, _hung_at_rest(item, bones[carrier]), (carrier,), bones)
            count = len(made.points[:: made.step])
            yield replace(made, leading=lambda count=count: np.zeros(count, dtype=np.int64))


def _hung_at_rest(item: bpy.types.Object, bone: bpy.types.Bone) -> Floats:
    """From a stiff part's space to its armature's (4, 4) with that at rest, however it is posed."""
    matrix, each = Matrix(), item
    while True:
        matrix = each.matrix_parent_inverse @ each.matrix_basis @ matrix
        if each.parent is None or each.parent_type == "BONE":
            break
        each = each.parent
    if not bone.use_relative_parent:
        matrix = bone.matrix_local @ Matrix.Translation((0.0, bone.length, 0.0)) @ matrix
    return np.array(matrix, dtype=np.float64)


def _surface(
    item: bpy.types.Object, matrix: Floats, groups: tuple[str, ...], bones: bpy.types.ArmatureBones
) -> _Surface:
    mesh = item.data
    assert isinstance(mesh, bpy.types.Mesh)
    own = [each for each in item.modifiers if each.type in _SHAPING and each.show_viewport]
    known = frozenset(number for number, name in enumerate(groups) if name in bones)
    if own and len(mesh.vertices) and item.mode == "OBJECT":
        corners = np.empty(len(mesh.loops), dtype=np.int32)
        mesh.loops.foreach_get("vertex_index", corners)
        settings = [_settings_of(each, item) for each in own]
        key = content_key(vertex_positions(mesh), limb_skin(mesh), corners, settings)
        points = _shaped.get(key, lambda: _with_modifiers(item)[0])
        return _Surface(
            points, matrix, groups, lambda: _with_modifiers(item, known)[1], _step(points)
        )
    numbers = limb_skin(mesh)
    points, step = vertex_positions(mesh)[numbers], _step(numbers)
    return _Surface(points, matrix, groups, lambda: _leading(mesh, numbers[::step], known), step)


def _step(points: NDArray[Any]) -> int:
    return max(1, -(-len(points) // _MOST_VERTICES))


def _settings_of(modifier: bpy.types.Modifier, item: bpy.types.Object) -> list[str]:
    """All that a modifier's effect hangs on, but for the mesh."""
    told = []
    for each in modifier.bl_rna.properties:
        value: Any = getattr(modifier, each.identifier, None)
        if isinstance(value, bpy.types.Object):
            near = np.array(item.matrix_world.inverted_safe() @ value.matrix_world)
            value = value.name, (np.round(near / _ROUNDED) * _ROUNDED).tolist()
        elif getattr(each, "is_array", False):
            value = tuple(value)
        elif isinstance(value, bpy.types.ID):
            value = value.name
        elif isinstance(value, bpy.types.bpy_struct):
            continue
        told.append(f"{each.identifier} {value}")
    return told


def _with_modifiers(
    item: bpy.types.Object, groups: frozenset[int] = frozenset()
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """A skin's points (n, 3) as its modifiers make them while no bone bends it, and of some vertex
    groups the one that each point which is looked at follows most.

    A copy is shown in a scene of its own: the artist's scene, its pose and frame stay untouched.
    """
    copy: Any = item.copy()
    scene: Any = bpy.data.scenes.new(item.name)
    try:
        copy.animation_data_clear()
        copy.constraints.clear()
        copy.parent = None
        copy.matrix_world = item.matrix_world
        for modifier in [each for each in copy.modifiers if each.type not in _SHAPING]:
            copy.modifiers.remove(modifier)
        scene.collection.objects.link(copy)
        layer = scene.view_layers[0]
        layer.update()
        shown = copy.evaluated_get(layer.depsgraph)
        mesh = shown.to_mesh(preserve_all_data_layers=True, depsgraph=layer.depsgraph)
        numbers = limb_skin(mesh)
        points = vertex_positions(mesh)[numbers]
        leading = _leading(mesh, numbers[:: _step(points)], groups)
        shown.to_mesh_clear()
    finally:
        bpy.data.objects.remove(copy)
        bpy.data.scenes.remove(scene)
    return points, leading


def _leading(
    mesh: bpy.types.Mesh, numbers: NDArray[np.int64], known: frozenset[int]
) -> NDArray[np.int64]:
    """Of some vertex groups the one that each of these vertices follows most, none by -1."""
    found = np.full(len(numbers), -1)
    vertices = mesh.vertices
    for place, number in enumerate(numbers.tolist()):
        groups = [each for each in vertices[number].groups if each.group in known]
        if groups:
            found[place] = max(groups, key=lambda each: each.weight).group
    return found


def _seen(surface: _Surface) -> Floats:
    """Those points (some, 3) of a surface that are looked at, armature space."""
    # Wherever the armature has walked to, its skin is as thick.
    matrix = np.round(surface.matrix / _ROUNDED) * _ROUNDED
    return surface.points[:: surface.step] @ matrix[:3, :3].T + matrix[:3, 3]


def _followers(armature: bpy.types.Object) -> Iterator[tuple[str, Floats]]:
    """Of each mesh, the points at rest that follow a bone most, with the bone's name.

    Groups of other names say nothing of bones: masks, pins of cloth.
    """
    for surface in _surfaces(armature):
        moved, leading = _seen(surface), surface.leading()
        for group in np.unique(leading[leading >= 0]).tolist():
            yield surface.groups[group], moved[leading == group]


def arm_skins(
    armature: bpy.types.Object, skeleton: Skeleton, arms: Sequence[Sequence[str]]
) -> list[ArmSkin]:
    """How far the skin of each arm is from its bones at rest.

    Where no mesh hangs on the armature, arms are taken to be slender.
    """
    joints = [joint_positions(skeleton, bones) for bones in arms]
    frames = [skeleton.rest_rotations[[skeleton.index[name] for name in bones]] for bones in arms]
    points = _skin(armature, float(np.ptp(np.concatenate(joints), axis=0).max()))
    return _skins_known.get(
        content_key(points, joints, frames), lambda: _arm_skins(points, joints, frames)
    )


def _arm_skins(points: Floats, joints: Sequence[Floats], frames: Sequence[Floats]) -> list[ArmSkin]:
    """The same from points (n, 3) of the skin, joints (bones + 1, 3) of each arm, and rest
    orientations (bones, 4) of its bones.
    """
    lengths = [float(np.linalg.norm(np.diff(each, axis=0), axis=1).sum()) for each in joints]
    found = [nearest_bones(points, each) for each in joints]
    distances = np.stack([np.linalg.norm(off, axis=1) for _, _, off in found])
    nearest = distances.argmin(axis=0)
    skins = []
    for arm, (bone, share, _) in enumerate(found):
        own = (nearest == arm) & (distances[arm] < _THICKEST * lengths[arm])
        slender = lengths[arm] * np.linspace(*_SLENDER, len(joints[arm]))
        radii = _radii(distances[arm][own], (bone + share)[own], slender)
        skins.append(arm_skin(points[own], joints[arm], frames[arm], radii))
    return skins


def _skin(armature: bpy.types.Object, size: float) -> Floats:
    """Some points (n, 3) of meshes that an armature of a size moves, at rest, armature space."""
    found: list[tuple[np.ndarray, Floats]] = []
    for surface in _surfaces(armature):
        place = surface.matrix.copy()
        # Wherever the armature has walked to, its skin is as thick.
        place[:3, :3] = np.round(place[:3, :3] / _PLACED_TO) * _PLACED_TO
        place[:3, 3] = np.round(place[:3, 3] / (_PLACED_TO * size)) * (_PLACED_TO * size)
        found.append((surface.points, place))
    step = max(1, sum(len(points) for points, _ in found) // _MOST_POINTS)
    parts, passed = [np.empty((0, 3))], 0
    for points, place in found:
        some = points[-passed % step :: step].astype(np.float64)
        parts.append(some @ place[:3, :3].T + place[:3, 3])
        passed += len(points)
    return np.concatenate(parts)


def _radii(distance: Floats, along: Floats, otherwise: Floats) -> Floats:
    """The radius at each joint (joints,), where there are points round it, else its neighbours'."""
    places = np.arange(len(otherwise))
    radii = np.full(len(otherwise), np.nan)
    for joint in places:
        near = distance[np.abs(along - joint) <= 0.5]
        if len(near):
            half, many, most = np.quantile(near, [0.5, _AT_LEAST, _SHARE])
            radii[joint] = max(many, min(most, _STANDS_OUT * half))
    known = np.isfinite(radii)
    if not np.any(known):
        return otherwise
    return np.interp(places, places[known], radii[known])


def set_rotation(bone: bpy.types.PoseBone | bpy.types.Object, turn: Quaternion) -> None:
    """Turn a bone or an object in its own rotation mode, on from the values that it has."""
    mode = bone.rotation_mode
    if mode == "QUATERNION":
        turn.make_compatible(bone.rotation_quaternion)
        bone.rotation_quaternion = turn
    elif mode == "AXIS_ANGLE":
        axis, angle = turn.to_axis_angle()
        if Vector(np.array(bone.rotation_axis_angle)[1:].tolist()).dot(axis) < 0.0:
            axis, angle = -axis, -angle
        bone.rotation_axis_angle = (angle, *axis)  # type: ignore[assignment]
    else:
        angles = turn.to_euler(mode, bone.rotation_euler)
        for axis in np.flatnonzero(np.array(bone.lock_rotation)).tolist():
            angles[axis] = bone.rotation_euler[axis]
        bone.rotation_euler = angles
