# SPDX-License-Identifier: GPL-3.0-or-later
"""The default octopus, written into Blender: an armature and its skin."""

from __future__ import annotations

import colorsys
from typing import Final

import bmesh
import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...core.errors import WriteError
from ...core.locomotion.octopus import (
    ARM_COLLECTIONS,
    FIRST_ARM_BONE,
    SUCKER_AXIS,
    OctopusBones,
    OctopusMesh,
    OctopusShape,
    SkinMaterial,
    build_bones,
    build_mesh,
)
from ..rig import ALIGNED, SUCKER_PROPERTY, WEB_ATTRIBUTE

_NAME: Final = "Octopus"
WEB_GROUP: Final = "Web"
"""Vertex group by which an artist selects the web, paints or pins it."""
OWN_COLLECTION: Final = "octo_motion_creature"
"""Custom property of a collection that was made for a creature and what belongs to it."""
_Colour = tuple[float, float, float]

_MATERIALS: Final[dict[SkinMaterial, tuple[str, _Colour, float]]] = {
    SkinMaterial.SKIN: ("Octopus Skin", (0.50, 0.13, 0.075), 0.45),
    SkinMaterial.UNDERSIDE: ("Octopus Underside", (0.78, 0.48, 0.36), 0.5),
    SkinMaterial.SUCKER: ("Octopus Sucker", (0.88, 0.72, 0.60), 0.35),
    SkinMaterial.EYE: ("Octopus Eye", (0.83, 0.62, 0.18), 0.1),
    SkinMaterial.PUPIL: ("Octopus Pupil", (0.01, 0.01, 0.012), 0.05),
    SkinMaterial.BEAK: ("Octopus Beak", (0.04, 0.022, 0.015), 0.3),
}
"""Name, linear RGB and roughness of each slot."""

_ARM_HUES: Final[dict[str, float]] = dict(zip(ARM_COLLECTIONS, (0.58, 0.0, 0.13), strict=True))
"""Blue to the left, red to the right, yellow between, as rigs have it."""
_BODY_HUE: Final = 0.36


def add_octopus(
    context: bpy.types.Context,
    shape: OctopusShape,
    matrix: Matrix,
    *,
    with_skin: bool = True,
    apart: bool = False,
) -> bpy.types.Object:
    """A new armature object in object mode, active and alone selected, with its skin as a child.

    The objects go where the view layer puts new ones, or apart, into a new collection there, which
    takes the creature's route and markers too. The armature's origin goes by a matrix of the world.

    Raises:
        WriteError: the scene is linked from another file.
    """
    collection = _destination(context)
    if apart:
        collection = _own_collection(collection)
    bones = build_bones(shape)
    skin = build_mesh(shape) if with_skin else None
    for each in context.selected_objects:
        each.select_set(state=False)
    armature = _new_armature(context, bones, collection)
    armature.matrix_world = matrix
    if skin is not None:
        _new_skin(armature, bones.names, skin, collection)
    return armature


def _destination(context: bpy.types.Context) -> bpy.types.Collection:
    if context.scene.is_editable:
        for collection in (context.collection, context.scene.collection):
            if collection is not None and collection.is_editable:
                return collection
    raise WriteError("The scene is linked from another file.", "Work in a scene of this file.")


def _own_collection(parent: bpy.types.Collection) -> bpy.types.Collection:
    made = bpy.data.collections.new(_NAME)
    made[OWN_COLLECTION] = True
    parent.children.link(made)
    return made


def own_collection(creature: bpy.types.Object) -> bpy.types.Collection | None:
    """The collection that was made for a creature and what belongs to it; none without."""
    return next(
        (each for each in creature.users_collection if OWN_COLLECTION in each and each.is_editable),
        None,
    )


def _new_armature(
    context: bpy.types.Context, bones: OctopusBones, collection: bpy.types.Collection
) -> bpy.types.Object:
    data = bpy.data.armatures.new(_NAME)
    armature = bpy.data.objects.new(_NAME, data)
    # Bones are made in edit mode, which needs an object in sight; the scene's own collection is
    # never hidden, and the artist's may be.
    root = context.scene.collection
    root.objects.link(armature)
    context.view_layer.objects.active = armature
    armature.select_set(state=True)
    bpy.ops.object.mode_set(mode="EDIT")
    _write_bones(data, bones)
    bpy.ops.object.mode_set(mode="OBJECT")
    if collection != root:
        collection.objects.link(armature)
        root.objects.unlink(armature)
        if armature in context.view_layer.objects.values():
            context.view_layer.objects.active = armature
            armature.select_set(state=True)
    # The skin would hide the bones; thin ones do not hide the skin.
    armature.show_in_front = True
    data.display_type = "STICK"
    return armature


def _write_bones(data: bpy.types.Armature, bones: OctopusBones) -> None:
    """All bones, while the armature is in edit mode.

    In bulk wherever Blender can: setting a bone's ends one by one makes it look at every other.
    """
    made = [data.edit_bones.new(name) for name in bones.names]
    data.edit_bones.foreach_set("head", bones.heads.ravel())
    data.edit_bones.foreach_set("tail", bones.tails.ravel())
    for bone, parent, dorsal in zip(made, bones.parents, bones.dorsal_axes, strict=True):
        bone.align_roll(Vector(dorsal))
        if parent >= 0:
            bone.parent = made[parent]
    data.edit_bones.foreach_set("use_connect", bones.connected)
    data.edit_bones.foreach_set("use_deform", bones.deform)
    for bone in made[FIRST_ARM_BONE:]:
        bone[SUCKER_PROPERTY] = SUCKER_AXIS
        # So that bones can stretch one by one, and yet grow with a body that is scaled.
        bone.inherit_scale = ALIGNED
    names = dict.fromkeys(bones.collections)
    collections = {name: data.collections.new(name) for name in names}
    for bone, name, pair in zip(made, bones.collections, bones.pairs, strict=True):
        collections[name].assign(bone)
        _paint(bone, _bone_colour(name, pair))


def _bone_colour(collection: str, pair: int) -> _Colour:
    """A hue for each side; every other pair is lighter, so that neighbours stand apart."""
    hue = _ARM_HUES.get(collection, _BODY_HUE)
    return colorsys.hsv_to_rgb(hue, 0.9 if pair % 2 else 0.55, 0.75)


def _paint(bone: bpy.types.EditBone, colour: _Colour) -> None:
    assert bone.color is not None
    bone.color.palette = "CUSTOM"
    custom = bone.color.custom
    custom.normal = colour
    custom.select = _lightened(colour, 0.6)
    custom.active = _lightened(colour, 0.85)


def _lightened(colour: _Colour, share: float) -> _Colour:
    red, green, blue = (part + share * (1.0 - part) for part in colour)
    return red, green, blue


def _new_skin(
    armature: bpy.types.Object,
    bone_names: tuple[str, ...],
    skin: OctopusMesh,
    collection: bpy.types.Collection,
) -> bpy.types.Object:
    mesh = _new_mesh(skin)
    _write_weights(mesh, skin)
    item = bpy.data.objects.new(mesh.name, mesh)
    item.parent = armature
    # Weights know bones by number, so every bone has a group, also those that move nothing.
    for name in bone_names:
        item.vertex_groups.new(name=name)
    if skin.web.any():
        _mark_web(item, mesh, skin)
    modifier = item.modifiers.new("Armature", "ARMATURE")
    assert isinstance(modifier, bpy.types.ArmatureModifier)
    modifier.object = armature
    collection.objects.link(item)
    return item


def _mark_web(item: bpy.types.Object, mesh: bpy.types.Mesh, skin: OctopusMesh) -> None:
    """Say which vertices are the web's, to artists and to whoever measures how thick arms are."""
    group = item.vertex_groups.new(name=WEB_GROUP)
    group.add(np.flatnonzero(skin.web).tolist(), 1.0, "REPLACE")
    mark = mesh.attributes.new(WEB_ATTRIBUTE, "BOOLEAN", "POINT")
    assert isinstance(mark, bpy.types.BoolAttribute)
    mark.data.foreach_set("value", skin.web)


def _new_mesh(skin: OctopusMesh) -> bpy.types.Mesh:
    mesh = bpy.data.meshes.new(f"{_NAME} Skin")
    faces = len(skin.quads)
    mesh.vertices.add(len(skin.vertices))
    mesh.vertices.foreach_set("co", skin.vertices.astype(np.float32).ravel())
    mesh.loops.add(4 * faces)
    mesh.loops.foreach_set("vertex_index", skin.quads.astype(np.int32).ravel())
    mesh.polygons.add(faces)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 4 * faces, 4, dtype=np.int32))
    mesh.polygons.foreach_set("material_index", skin.materials.astype(np.int32))
    mesh.update(calc_edges=True)
    mesh.shade_smooth()
    for slot in SkinMaterial:
        mesh.materials.append(_new_material(*_MATERIALS[slot]))
    return mesh


def _write_weights(mesh: bpy.types.Mesh, skin: OctopusMesh) -> None:
    """Weights, through a bmesh: vertex groups take them in time that grows with their number."""
    editable = bmesh.new()
    try:
        editable.from_mesh(mesh)
        layer = editable.verts.layers.deform.verify()
        bones, weights = skin.bones.tolist(), skin.weights.tolist()
        for vertex, its_bones, its_weights in zip(editable.verts, bones, weights, strict=True):
            groups = vertex[layer]
            for bone, weight in zip(its_bones, its_weights, strict=True):
                if weight > 0.0:
                    groups[bone] = weight
        editable.to_mesh(mesh)
    finally:
        editable.free()


def _new_material(name: str, colour: _Colour, roughness: float) -> bpy.types.Material:
    """A material whose colour solid view, EEVEE and Cycles agree on."""
    material = bpy.data.materials.new(name)
    material.diffuse_color = (*colour, 1.0)  # type: ignore[assignment]
    material.roughness = roughness
    if material.node_tree is None:
        material.use_nodes = True
    assert material.node_tree is not None
    for node in material.node_tree.nodes:
        if node.type == "BSDF_PRINCIPLED":
            for socket, value in (("Base Color", (*colour, 1.0)), ("Roughness", roughness)):
                node.inputs[socket].default_value = value  # type: ignore[attr-defined]
    return material
