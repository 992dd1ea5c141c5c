# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground, light, camera and Workbench settings for pictures that need no graphics card.

Everything is measured from the animation itself, over all its frames, so that whatever route and
size an octopus has, the camera sees all of it and the ground reaches beyond it.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

Points = NDArray[np.float64]
Pixels = NDArray[np.float32]
Colour = tuple[float, float, float]

_WATER: Colour = (0.045, 0.135, 0.19)
_TILES: tuple[Colour, Colour] = ((0.50, 0.43, 0.31), (0.44, 0.375, 0.27))
_ROUTE: Colour = (0.95, 0.62, 0.08)
_OCTAHEDRON = np.array(
    [
        (0, 0, 0),
        (0.16, 0.2, 0.16),
        (0.16, 0.2, -0.16),
        (-0.16, 0.2, -0.16),
        (-0.16, 0.2, 0.16),
        (0, 1, 0),
    ]
)
"""A bone of length 1, along Y."""
_FACETS = [
    facet
    for first, second in ((1, 2), (2, 3), (3, 4), (4, 1))
    for facet in ((0, first, second), (5, second, first))
]
_SIDE_BY_SIDE = 20
"""Ground tiles across the shorter side of the animation."""


_SKIN_POINTS = 1000
"""Of each mesh, at least so many vertices are looked at, if it has them."""


def the_scene() -> bpy.types.Scene:
    """The scene that is shown; there always is one."""
    scene = bpy.context.scene
    assert scene is not None
    return scene


def set_light(scene: bpy.types.Scene) -> None:
    """Workbench: studio light and a shadow from above, materials' own colours, dark creases.

    Edges are smoothed after drawing: Workbench's own samples would draw the shadow once for each,
    which takes seconds for every picture without a graphics card.
    """
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.film_transparent = False
    # Noise that nobody sees would make the files three times as large.
    scene.render.dither_intensity = 0.0
    view, display = scene.view_settings, scene.display
    assert view is not None
    assert display is not None
    view.view_transform = "Standard"
    display.render_aa = "FXAA"
    # Blender's own order here is left, up, front.
    display.light_direction = Vector((0.2, 0.95, 0.15)).normalized()
    display.shadow_focus = 0.2
    display.shadow_shift = 0.05
    shading = display.shading
    assert shading is not None
    shading.light = "STUDIO"
    shading.studio_light = "paint.sl"
    shading.color_type = "MATERIAL"
    shading.show_specular_highlight = True
    shading.show_shadows = True
    shading.shadow_intensity = 0.45
    shading.show_cavity = True
    shading.cavity_type = "BOTH"
    shading.cavity_ridge_factor = 0.6
    shading.cavity_valley_factor = 1.2
    shading.curvature_ridge_factor = 0.6
    shading.curvature_valley_factor = 0.8
    _set_background(scene, _WATER)


def set_flat_light(scene: bpy.types.Scene, background: Colour) -> None:
    """Workbench: nothing but the materials' own colours."""
    set_light(scene)
    assert scene.display is not None
    shading = scene.display.shading
    assert shading is not None
    shading.light = "FLAT"
    shading.show_shadows = shading.show_cavity = False
    _set_background(scene, background)


def _set_background(scene: bpy.types.Scene, colour: Colour) -> None:
    world = bpy.data.worlds.new("Background")
    world.color = colour
    scene.world = world


def skin_points(armature: bpy.types.Object, frames: Iterable[float]) -> Points:
    """Points of the skin (frames, points, 3) in world space, a few thousand at most per frame.

    Without a skin: the heads and tails of the bones.
    """
    each = []
    for frame in frames:
        go_to(frame)
        each.append(_points_now(armature))
    return np.stack(each)


def go_to(frame: float) -> None:
    """Show the scene at a frame, or between two."""
    whole = int(np.floor(frame))
    the_scene().frame_set(whole, subframe=float(frame - whole))


def _points_now(armature: bpy.types.Object) -> Points:
    depsgraph = bpy.context.evaluated_depsgraph_get()
    parts: list[Points] = []
    for child in the_scene().objects:
        if child.type != "MESH" or armature not in (child.parent, child.find_armature()):
            continue
        evaluated = child.evaluated_get(depsgraph)
        mesh = evaluated.data
        assert isinstance(mesh, bpy.types.Mesh)
        points = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        mesh.vertices.foreach_get("co", points)
        # Of a fine skin every few vertices are enough, none is far from the next; of a coarse one
        # each may be a corner that stands out.
        step = max(1, len(mesh.vertices) // _SKIN_POINTS)
        parts.append(_moved(evaluated.matrix_world, points.reshape(-1, 3)[::step]))
    if not parts:
        assert armature.pose is not None
        ends = [end for bone in armature.pose.bones for end in (bone.head, bone.tail)]
        parts.append(_moved(armature.matrix_world, np.array(ends)))
    return np.concatenate(parts)


def _moved(matrix: Matrix, points: NDArray[np.floating]) -> Points:
    array = np.array(matrix, dtype=np.float64)
    return points @ array[:3, :3].T + array[:3, 3]


def add_ground(
    points: Points,
    height: float,
    margin: float = 0.8,
    colours: tuple[Colour, Colour] = _TILES,
) -> bpy.types.Object:
    """A tiled floor below the points (…, 3); one sees on its tiles whether an arm slides.

    Args:
        points: what the floor reaches beneath.
        height: its height in world space.
        margin: how far it goes on, as a share of the points' extent.
        colours: of its tiles.
    """
    flat = points.reshape(-1, 3)[:, :2]
    low, high = flat.min(axis=0), flat.max(axis=0)
    low, high = low - margin * (high - low).max(), high + margin * (high - low).max()
    size = (high - low).min() / _SIDE_BY_SIDE
    counts = np.ceil((high - low) / size).astype(int)
    low = 0.5 * (low + high) - 0.5 * size * counts
    columns, rows = np.meshgrid(np.arange(counts[0] + 1), np.arange(counts[1] + 1))
    vertices = np.stack(
        [low[0] + size * columns, low[1] + size * rows, np.zeros(columns.shape)], axis=-1
    ).reshape(-1, 3)
    corner = (np.arange(counts[1])[:, None] * (counts[0] + 1) + np.arange(counts[0])).ravel()
    faces = corner[:, None] + [0, 1, counts[0] + 2, counts[0] + 1]
    mesh = bpy.data.meshes.new("Ground")
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    for colour in colours:
        mesh.materials.append(new_material("Ground", colour, roughness=1.0))
    across, along = np.meshgrid(np.arange(counts[0]), np.arange(counts[1]))
    mesh.polygons.foreach_set("material_index", ((across + along) % 2).ravel().astype(np.int32))
    ground = bpy.data.objects.new("Ground", mesh)
    ground.location.z = height
    the_scene().collection.objects.link(ground)
    return ground


def show_route(route: bpy.types.Object, thickness: float) -> bpy.types.Object:
    """A tube along a curve object; the curve itself renders as nothing and stays as it is."""
    data = route.data.copy() if route.data else None
    assert isinstance(data, bpy.types.Curve)
    data.bevel_depth = 0.5 * thickness
    data.bevel_resolution = 2
    data.use_fill_caps = True
    data.materials.clear()
    data.materials.append(new_material("Route", _ROUTE, roughness=0.6))
    tube = bpy.data.objects.new("Route Tube", data)
    tube.matrix_world = route.matrix_world
    the_scene().collection.objects.link(tube)
    return tube


def leave_copy(armature: bpy.types.Object) -> None:
    """Leave the skin standing where it is now, in the pose it has now."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for child in armature.children:
        if child.type != "MESH":
            continue
        evaluated = child.evaluated_get(depsgraph)
        mesh = bpy.data.meshes.new_from_object(evaluated, depsgraph=depsgraph)
        copy = bpy.data.objects.new(f"{child.name} Copy", mesh)
        copy.matrix_world = evaluated.matrix_world
        the_scene().collection.objects.link(copy)


def show_bones(armature: bpy.types.Object) -> None:
    """Bones as the 3D view draws them, octahedra in their own colours: renders leave bones out."""
    assert isinstance(armature.data, bpy.types.Armature)
    for bone in armature.data.bones:
        mesh = bpy.data.meshes.new(bone.name)
        mesh.from_pydata((_OCTAHEDRON * bone.length).tolist(), [], _FACETS)
        assert bone.color is not None
        assert bone.color.custom is not None
        colour = bone.color.custom.normal
        mesh.materials.append(
            new_material(bone.name, (colour.r, colour.g, colour.b), roughness=0.5)
        )
        shown = bpy.data.objects.new(bone.name, mesh)
        shown.matrix_world = armature.matrix_world @ bone.matrix_local
        the_scene().collection.objects.link(shown)


def new_material(name: str, colour: Colour, roughness: float = 1.0) -> bpy.types.Material:
    """A material as Workbench shows it; the colour is linear."""
    material = bpy.data.materials.new(name)
    material.diffuse_color = (*colour, 1.0)
    material.roughness = roughness
    return material


def add_camera(name: str, *, lens: float | None = None) -> bpy.types.Object:
    """A camera, which becomes the scene's: orthographic, or with a lens in millimetres."""
    data = bpy.data.cameras.new(name)
    if lens is None:
        data.type = "ORTHO"
    else:
        data.lens = lens
    camera = bpy.data.objects.new(name, data)
    scene = the_scene()
    scene.collection.objects.link(camera)
    scene.camera = camera
    return camera


def look(camera: bpy.types.Object, forward: Points, up: Points) -> None:
    """Turn a camera to look along ``forward`` (3,), with ``up`` (3,) upwards as far as it can."""
    back = -forward / np.linalg.norm(forward)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(back, right), back], axis=1)
    place = camera.matrix_world.translation.copy()
    camera.matrix_world = Matrix(axes.tolist()).to_4x4()
    camera.location = place


def frame_points(camera: bpy.types.Object, points: Points, margin: float = 0.08) -> None:
    """Move a camera, which keeps looking the way it does, so that it sees all points (…, 3).

    Args:
        camera: with a lens, not orthographic.
        points: world space.
        margin: how much farther away it goes than they need, as a share of the distance.
    """
    flat = points.reshape(-1, 3)
    bpy.context.view_layer.update()
    place, _ = camera.camera_fit_coords(
        bpy.context.evaluated_depsgraph_get(), flat.ravel().tolist()
    )
    # A step back from where they fit exactly.
    distance = float(np.linalg.norm(flat.mean(axis=0) - np.asarray(place, dtype=np.float64)))
    back = camera.matrix_world.to_3x3() @ Vector((0.0, 0.0, 1.0))
    camera.location = place
    camera.location += margin * distance * back
    bpy.context.view_layer.update()


def render_pixels(width: int, height: int, *, note: str = "", finer: int = 2) -> Pixels:
    """The scene as it stands, (height, width, 3) from the top row down, 0…1 as displayed.

    Args:
        width: in pixels.
        height: in pixels.
        note: written into the picture's upper left corner.
        finer: how many times finer it is rendered, and then averaged.
    """
    set_resolution(finer * width, finer * height)
    render = the_scene().render
    set_note(render, note)
    with tempfile.TemporaryDirectory(prefix="octo-motion-") as folder:
        path = Path(folder) / "picture.png"
        render.image_settings.file_format = "PNG"
        render.filepath = str(path)
        bpy.ops.render.render(write_still=True)
        fine = load_pixels(path)
    return fine.reshape(height, finer, width, finer, 3).mean(axis=(1, 3))


def set_resolution(width: int, height: int) -> None:
    """Size of the pictures to come, which decides what a camera can see."""
    render = the_scene().render
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100


def set_note(render: bpy.types.RenderSettings, note: str) -> None:
    """Write a note into the upper left corner of pictures to come; nothing if it is empty."""
    for name in dir(render):
        if name.startswith("use_stamp_"):
            setattr(render, name, name == "use_stamp_note")
    render.use_stamp = bool(note)
    render.stamp_note_text = note
    render.stamp_font_size = max(10, min(render.resolution_x, render.resolution_y) // 20)
    render.stamp_foreground = (1.0, 1.0, 1.0, 1.0)
    render.stamp_background = (0.0, 0.0, 0.0, 0.35)


def load_pixels(path: Path) -> Pixels:
    """The pixels of an image file, (height, width, 3) from the top row down."""
    image = bpy.data.images.load(str(path), check_existing=False)
    width, height = (int(each) for each in Vector(image.size))  # type: ignore[arg-type]
    pixels = np.empty(width * height * image.channels, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    channels = image.channels
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, channels)[::-1, :, :3].copy()


def save_pixels(pixels: Pixels, path: Path) -> None:
    """Write pixels (height, width, 3), from the top row down, into a PNG file, well packed."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(path.stem, width, height)
    whole = np.ones((height, width, 4), dtype=np.float32)
    whole[..., :3] = pixels[::-1]
    image.pixels.foreach_set(whole.ravel())  # type: ignore[arg-type]
    scene = the_scene()
    assert scene.view_settings is not None
    scene.view_settings.view_transform = "Standard"
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.compression = "PNG", "RGB", 100
    # Packs harder than the image's own save(), and leaves values as they are.
    image.save_render(str(path), scene=scene)
    bpy.data.images.remove(image)
