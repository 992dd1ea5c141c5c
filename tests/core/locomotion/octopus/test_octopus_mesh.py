# SPDX-License-Identifier: GPL-3.0-or-later
"""The octopus' skin: closed, of quads, symmetric, with weights that bend without pinching."""

from typing import Any

import numpy as np
import pytest

from octo_motion.core.locomotion.octopus.mesh import build_mesh
from octo_motion.core.locomotion.octopus.rig import (
    EYE_LEFT,
    EYE_RIGHT,
    FIRST_ARM_BONE,
    OctopusBones,
    build_bones,
)
from octo_motion.core.locomotion.octopus.shape import OctopusShape
from octo_motion.core.locomotion.octopus.surface import OctopusMesh, SkinMaterial
from octo_motion.core.rotations import Floats

pytestmark = pytest.mark.one_blender

SHAPES = {
    "default": OctopusShape(),
    "one arm": OctopusShape(arms=1),
    "two arms": OctopusShape(arms=2),
    "three arms": OctopusShape(arms=3, joints=3),
    "seven arms": OctopusShape(arms=7, joints=30),
    "twenty arms": OctopusShape(arms=20, joints=7),
    "most arms": OctopusShape(arms=64, joints=3),
    "most joints": OctopusShape(arms=4, joints=200),
    "cylinders": OctopusShape(taper=0.0, mesh_taper=0.0),
    "cones": OctopusShape(taper=1.0, mesh_taper=1.0),
    "threads": OctopusShape(arm_length=20.0, first_diameter=0.01),
    "stumps": OctopusShape(arm_length=0.05, first_diameter=0.5),
}
SLENDER = ("default", "seven arms", "twenty arms", "cylinders", "cones")


@pytest.fixture(params=SHAPES, scope="module")
def shape(request: pytest.FixtureRequest) -> OctopusShape:
    return SHAPES[request.param]


@pytest.fixture(scope="module")
def mesh(shape: OctopusShape) -> OctopusMesh:
    return build_mesh(shape)


def edges_of(mesh: OctopusMesh) -> Any:
    """Directed edges (4 faces, 2)."""
    return np.stack([mesh.quads, np.roll(mesh.quads, -1, axis=1)], axis=-1).reshape(-1, 2)


def volume(points: Floats, quads: Any) -> float:
    """Volume inside a closed surface, positive if its faces look outwards."""
    a, b, c, d = (points[quads[:, corner]] for corner in range(4))
    triangles = np.einsum("ij,ij->i", a, np.cross(b, c)) + np.einsum("ij,ij->i", a, np.cross(c, d))
    return float(np.sum(triangles)) / 6.0


def islands_of(mesh: OctopusMesh) -> Any:
    """Number of the connected part that each vertex belongs to."""
    edges = edges_of(mesh)
    label = np.arange(len(mesh.vertices))
    while True:
        least = label.copy()
        np.minimum.at(least, edges[:, 0], label[edges[:, 1]])
        np.minimum.at(least, edges[:, 1], label[edges[:, 0]])
        # Jump on to the label's own label: the rounds grow with the logarithm of the size.
        least = least[least]
        if np.array_equal(least, label):
            return label
        label = least


def mirror_partners(points: Floats) -> Any:
    """Index of each vertex' mirror image; fails where there is none."""
    size = float(np.max(np.abs(points)))
    rounded = np.round(points / size, 7) + 0.0
    mirrored = np.round(points / size * [-1.0, 1.0, 1.0], 7) + 0.0
    order, other = np.lexsort(rounded.T), np.lexsort(mirrored.T)
    partner = np.empty(len(points), dtype=np.int64)
    partner[other] = order
    np.testing.assert_allclose(points[partner], points * [-1.0, 1.0, 1.0], atol=2e-7 * size)
    return partner


def test_every_edge_joins_two_faces_that_look_the_same_way(mesh: OctopusMesh) -> None:
    edges, count = np.unique(edges_of(mesh), axis=0, return_counts=True)
    assert np.all(count == 1)
    opposite = np.unique(edges[:, ::-1], axis=0)
    np.testing.assert_array_equal(edges, opposite)


def test_faces_are_quads_with_four_different_corners_and_no_vertex_is_loose(
    mesh: OctopusMesh,
) -> None:
    corners = np.sort(mesh.quads, axis=1)
    assert np.all(np.diff(corners, axis=1) > 0)
    np.testing.assert_array_equal(np.unique(corners), np.arange(len(mesh.vertices)))
    assert np.all(np.isfinite(mesh.vertices))


def test_the_skin_is_one_piece_with_two_eyeballs_in_it(mesh: OctopusMesh) -> None:
    islands = islands_of(mesh)
    assert len(np.unique(islands)) == 3
    moved_by_eyes = np.isin(mesh.bones[:, 0], (EYE_LEFT, EYE_RIGHT))
    assert len(np.unique(islands[moved_by_eyes])) == 2
    assert len(np.unique(islands[~moved_by_eyes])) == 1


def test_every_piece_is_a_sphere_in_disguise_without_handles_or_holes(mesh: OctopusMesh) -> None:
    vertices, faces = len(mesh.vertices), len(mesh.quads)
    assert vertices - 2 * faces + faces == 2 * 3


def test_faces_look_outwards(mesh: OctopusMesh) -> None:
    islands = islands_of(mesh)
    for island in np.unique(islands):
        assert volume(mesh.vertices, mesh.quads[islands[mesh.quads[:, 0]] == island]) > 0.0


def test_weights_sum_to_one_over_at_most_four_bones(mesh: OctopusMesh, shape: OctopusShape) -> None:
    assert mesh.bones.shape[1] == mesh.weights.shape[1] == 4
    np.testing.assert_allclose(np.sum(mesh.weights, axis=1), 1.0, atol=1e-9)
    assert np.all(mesh.weights >= 0.0)
    assert np.all(np.diff(mesh.weights, axis=1) <= 0.0)
    assert np.min(mesh.bones) >= 0
    assert np.max(mesh.bones) < FIRST_ARM_BONE + shape.arms * shape.joints
    for first in range(4):
        for second in range(first):
            twice = mesh.bones[:, first] == mesh.bones[:, second]
            assert not np.any(twice & (mesh.weights[:, first] > 0.0))


def test_the_root_moves_no_point_by_itself(mesh: OctopusMesh) -> None:
    assert not np.any((mesh.bones == 0) & (mesh.weights > 0.0))


def test_every_arm_bone_moves_some_skin(mesh: OctopusMesh, shape: OctopusShape) -> None:
    moved = np.unique(mesh.bones[mesh.weights > 0.0])
    assert set(range(1, FIRST_ARM_BONE + shape.arms * shape.joints)) == set(moved.tolist())


def test_left_and_right_are_mirror_images_with_mirrored_weights(
    mesh: OctopusMesh, shape: OctopusShape
) -> None:
    partner = mirror_partners(mesh.vertices)
    names = build_bones(shape).names
    index = {name: number for number, name in enumerate(names)}
    swap = {"L": "R", "R": "L"}
    flipped = np.array(
        [
            index[stem + dot + swap.get(side, side)]
            for stem, dot, side in (name.rpartition(".") for name in names)
        ]
    )
    influence: dict[int, Any] = {}
    for slot in range(4):
        # Summed by bone in any order: equal weights may stand in either order.
        for side, bones in ((0, flipped[mesh.bones[:, slot]]), (1, mesh.bones[partner, slot])):
            weight = mesh.weights[:, slot] if side == 0 else mesh.weights[partner, slot]
            key = weight * np.sin(bones + 1.0)
            influence[side] = influence.get(side, 0.0) + key
    np.testing.assert_allclose(influence[0], influence[1], atol=1e-6)


def test_faces_mirror_faces(mesh: OctopusMesh) -> None:
    partner = mirror_partners(mesh.vertices)
    faces = {tuple(sorted(quad)) for quad in mesh.quads.tolist()}
    assert faces == {tuple(sorted(quad)) for quad in partner[mesh.quads].tolist()}


def test_every_material_is_used(mesh: OctopusMesh) -> None:
    np.testing.assert_array_equal(np.unique(mesh.materials), [int(each) for each in SkinMaterial])


def test_suckers_face_the_ground() -> None:
    mesh = build_mesh(OctopusShape())
    suckers = mesh.quads[mesh.materials == SkinMaterial.SUCKER]
    a, b, c, d = (mesh.vertices[suckers[:, corner]] for corner in range(4))
    normals = 0.5 * np.cross(c - a, d - b)
    # Rims have walls and cups have slopes; together they look down by far.
    assert np.sum(normals[:, 2]) < -0.25 * np.sum(np.linalg.norm(normals, axis=1))
    assert np.max(mesh.vertices[suckers][..., 2]) < OctopusShape().arm_height


def test_the_suckers_reach_down_to_the_ground_and_no_further() -> None:
    shape = OctopusShape()
    lowest = float(np.min(build_mesh(shape).vertices[:, 2]))
    assert abs(lowest) < 0.1 * shape.first_diameter


def test_the_biggest_octopus_stays_within_bounds() -> None:
    mesh = build_mesh(OctopusShape(arms=64, joints=200))
    assert len(mesh.vertices) < 300_000
    assert len(build_mesh(OctopusShape()).vertices) < 50_000


def coiled(bones: OctopusBones, joints: int, degrees: float, axis: int) -> Floats:
    """Matrices (bones, 4, 4) that carry rest to the pose with every arm joint bent."""
    angle = np.radians(degrees)
    turn = np.eye(4)
    rows = [each for each in range(3) if each != axis]
    turn[np.ix_(rows, rows)] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    rest = bones.matrices
    posed = rest.copy()
    for bone in range(FIRST_ARM_BONE, len(rest)):
        parent = bones.parents[bone]
        own = np.eye(4) if (bone - FIRST_ARM_BONE) % joints == 0 else turn
        posed[bone] = posed[parent] @ np.linalg.inv(rest[parent]) @ rest[bone] @ own
    return posed @ np.linalg.inv(rest)


def skinned(mesh: OctopusMesh, carry: Floats) -> Floats:
    """Linear blend skinning, as Blender's Armature modifier and game engines do it."""
    matrices = np.einsum("vi,vijk->vjk", mesh.weights, carry[mesh.bones])
    return np.einsum("vij,vj->vi", matrices[:, :3, :3], mesh.vertices) + matrices[:, :3, 3]


def volume_kept_by_an_arm(shape: OctopusShape, degrees: float, axis: int) -> float:
    """Volume of the first arm's outer two thirds, bent all along its length, against rest."""
    mesh, bones = build_mesh(shape), build_bones(shape)
    posed = skinned(mesh, coiled(bones, shape.joints, degrees / shape.joints, axis))
    first, last = FIRST_ARM_BONE + shape.joints // 3, FIRST_ARM_BONE + shape.joints
    on_arm = (mesh.bones[:, 0] >= first) & (mesh.bones[:, 0] < last)
    quads = mesh.quads[np.all(on_arm[mesh.quads], axis=1)]
    edges = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    inner = {tuple(edge) for edge in edges.tolist()}
    open_end = [a for a, b in edges.tolist() if (b, a) not in inner]
    # Seen from a point in its open end, the tube has the volume that it would have if closed.
    rest, bent = (
        volume(points - np.mean(points[open_end], axis=0), quads)
        for points in (mesh.vertices, posed)
    )
    return bent / rest


def least_kept(joints: int, degrees: float) -> float:
    """What linear blending leaves of a section half way between two bones, cos² of half their
    angle: it shrinks towards the chord. A per cent more for a section that is a polygon.
    """
    return float(np.cos(0.5 * np.radians(degrees) / joints) ** 2) - 0.01


@pytest.mark.parametrize("axis", [0, 2], ids=["up and down", "sideways"])
@pytest.mark.parametrize("name", SLENDER)
def test_a_tight_coil_does_not_pinch(name: str, axis: int) -> None:
    # More than once round: 35° at each of 12 joints. Skin that collapses at its joints loses
    # more than blending takes.
    least = least_kept(SHAPES[name].joints, 420.0)
    for degrees in (420.0, -420.0):
        assert least < volume_kept_by_an_arm(SHAPES[name], degrees, axis) < 1.01


@pytest.mark.parametrize("name", SLENDER)
def test_a_twisted_arm_keeps_its_thickness(name: str) -> None:
    least = least_kept(SHAPES[name].joints, 360.0)
    assert least < volume_kept_by_an_arm(SHAPES[name], 360.0, 1) < 1.01
