# SPDX-License-Identifier: GPL-3.0-or-later
"""Laws that rotations obey, whatever the numbers."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core import rotations
from octo_motion.core.rotations import EULER_ORDERS, Floats

orders = st.sampled_from(EULER_ORDERS)
seeds = st.integers(0, 2**32 - 1)
angles = st.floats(-20.0, 20.0)


def components(count: int) -> st.SearchStrategy[Floats]:
    # Tiny and exact values on purpose: rotations meet their special cases there.
    number = st.one_of(
        st.floats(-1.0, 1.0), st.sampled_from([0.0, 1.0, -1.0, 0.5**0.5, 1e-9, -1e-9, 1e-5])
    )
    return st.lists(number, min_size=count, max_size=count).map(np.array)


def units(count: int) -> st.SearchStrategy[Floats]:
    return (
        components(count)
        .filter(lambda array: bool(np.linalg.norm(array) > 1e-3))
        .map(rotations.normalized)
    )


quaternions = units(4)
directions = units(3)
vectors = components(3)


def assert_same_rotation(first: Floats, second: Floats, tolerance: float = 1e-12) -> None:
    assert np.max(rotations.angle_between(first, second)) <= tolerance


def smooth_motion(seed: int, frames: int, bones: int, step: float) -> Floats:
    """Orientations (frames, bones, 4) that wander by about ``step`` a frame, through anywhere."""
    random = np.random.default_rng(seed)
    motion = np.empty((frames, bones, 4))
    motion[0] = rotations.normalized(random.normal(size=(bones, 4)))
    for frame in range(1, frames):
        turn = rotations.from_rotation_vector(step * random.normal(size=(bones, 3)))
        motion[frame] = rotations.multiply(turn, motion[frame - 1])
    return motion


@given(quaternions, quaternions, quaternions)
def test_product_is_associative_and_the_conjugate_its_inverse(
    a: Floats, b: Floats, c: Floats
) -> None:
    left = rotations.multiply(rotations.multiply(a, b), c)
    right = rotations.multiply(a, rotations.multiply(b, c))
    np.testing.assert_allclose(left, right, atol=1e-14)
    identity = rotations.multiply(a, rotations.conjugate(a))
    np.testing.assert_allclose(identity, rotations.IDENTITY, atol=1e-14)


@given(quaternions, quaternions, vectors)
def test_product_turns_by_the_second_and_then_by_the_first(a: Floats, b: Floats, v: Floats) -> None:
    both = rotations.rotate(rotations.multiply(a, b), v)
    np.testing.assert_allclose(both, rotations.rotate(a, rotations.rotate(b, v)), atol=1e-14)


@given(quaternions, vectors)
def test_matrix_turns_like_its_quaternion(q: Floats, v: Floats) -> None:
    matrix = rotations.to_matrix(q)
    np.testing.assert_allclose(matrix @ v, rotations.rotate(q, v), atol=1e-14)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(matrix) == pytest.approx(1.0)


@given(quaternions)
def test_quaternion_comes_back_from_its_matrix(q: Floats) -> None:
    back = rotations.from_matrix(rotations.to_matrix(q))
    assert back[0] >= 0.0
    assert_same_rotation(q, back)


@given(directions, vectors)
def test_turning_keeps_lengths_and_the_axis(axis: Floats, v: Floats) -> None:
    q = rotations.from_axis_angle(axis, 0.7)
    np.testing.assert_allclose(rotations.rotate(q, axis), axis, atol=1e-14)
    assert np.linalg.norm(rotations.rotate(q, v)) == pytest.approx(np.linalg.norm(v), abs=1e-14)


@given(vectors, vectors)
def test_cross_product_is_numpys(a: Floats, b: Floats) -> None:
    np.testing.assert_array_equal(rotations.cross(a, b), np.cross(a, b))


@given(directions, angles)
def test_axis_angle_and_rotation_vector_agree(axis: Floats, angle: float) -> None:
    np.testing.assert_allclose(
        rotations.from_axis_angle(axis, angle),
        rotations.from_rotation_vector(axis * angle),
        atol=1e-14,
    )


@given(quaternions)
def test_logarithm_is_the_shortest_and_leads_back(q: Floats) -> None:
    vector = rotations.to_rotation_vector(q)
    assert np.linalg.norm(vector) <= np.pi + 1e-12
    assert_same_rotation(q, rotations.from_rotation_vector(vector))


@given(directions, st.floats(0.0, np.pi), quaternions)
def test_angle_between_orientations_is_the_angle_of_the_turn(
    axis: Floats, angle: float, q: Floats
) -> None:
    turned = rotations.multiply(rotations.from_axis_angle(axis, angle), q)
    assert rotations.angle_between(q, turned) == pytest.approx(angle, abs=1e-14)
    assert rotations.angle_between(q, -turned) == pytest.approx(angle, abs=1e-14)


@given(directions, directions)
def test_shortest_arc_takes_start_to_end_without_twist(start: Floats, end: Floats) -> None:
    q = rotations.shortest_arc(start, end)
    np.testing.assert_allclose(rotations.rotate(q, start), end, atol=2e-8)
    assert q[1:] @ start == pytest.approx(0.0, abs=2e-8)
    assert q[1:] @ end == pytest.approx(0.0, abs=2e-8)


@given(directions, directions, st.floats(-16.0, -1.0))
def test_shortest_arc_is_true_close_to_opposite_directions(
    start: Floats, aside: Floats, exponent: float
) -> None:
    end = rotations.normalized(-start + 10.0**exponent * aside)
    q = rotations.shortest_arc(start, end)
    np.testing.assert_allclose(rotations.rotate(q, start), end, atol=5e-8)
    assert np.linalg.norm(q) == pytest.approx(1.0)


def test_shortest_arc_of_many_pairs_at_once_with_opposite_ones_among_them() -> None:
    starts = np.array([[1.0, 0, 0], [1.0, 0, 0], [0, 0, 1.0], [0, 1.0, 0]])
    ends = np.array([[-1.0, 0, 0], [0, 1.0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    q = rotations.shortest_arc(starts, ends)
    np.testing.assert_allclose(rotations.rotate(q, starts), ends, atol=1e-15)


@given(seeds)
def test_continuous_quaternions_are_the_same_rotations_and_never_jump(seed: int) -> None:
    motion = smooth_motion(seed, 50, 3, 0.3)
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=(50, 3, 1))
    result = rotations.continuous(motion * signs)
    np.testing.assert_array_equal(result[0], (motion * signs)[0])
    assert_same_rotation(result, motion)
    assert (np.sum(result[1:] * result[:-1], axis=-1) >= 0.0).all()


@given(vectors.map(lambda v: 4.0 * v), orders)
def test_euler_angles_lead_back_to_the_rotation(turns: Floats, order: str) -> None:
    q = rotations.from_euler(turns, order)
    back = rotations.to_euler(q, order)
    middle = back["XYZ".index(order[1])]
    assert abs(middle) <= np.pi / 2 + 1e-12
    assert (np.abs(back) <= np.pi + 1e-12).all()
    assert_same_rotation(q, rotations.from_euler(back, order), 1e-11)


@given(angles, angles, st.sampled_from([-1.0, 1.0]), st.floats(-17.0, -2.0), orders)
def test_euler_angles_are_exact_at_the_poles(
    first: float, last: float, pole: float, exponent: float, order: str
) -> None:
    i, j, k = ("XYZ".index(letter) for letter in order)
    turns = np.empty(3)
    turns[i], turns[j], turns[k] = first, pole * (np.pi / 2 - 10.0**exponent), last
    q = rotations.from_euler(turns, order)
    assert_same_rotation(q, rotations.from_euler(rotations.to_euler(q, order), order), 1e-11)


@given(orders, st.integers(0, 2), st.floats(-3.1, 3.1))
def test_a_turn_about_one_axis_is_that_axis_euler_angle(
    order: str, axis: int, angle: float
) -> None:
    if axis == "XYZ".index(order[1]):
        angle /= 2.1
    q = rotations.from_axis_angle(np.eye(3)[axis], angle)
    np.testing.assert_allclose(rotations.to_euler(q, order), np.eye(3)[axis] * angle, atol=1e-12)


def nearest_one_by_one(angles: Floats, order: str) -> Floats:
    """The triple nearest to the frame before, found by trying all that there are."""
    i, j, k = ("XYZ".index(letter) for letter in order)
    turns = 2.0 * np.pi * np.array(list(itertools.product(range(-6, 7), repeat=3)))
    result = [np.zeros(3)]
    for triple in angles:
        other = triple.copy()
        other[[i, k]] += np.pi
        other[j] = np.pi - other[j]
        equal = np.concatenate([triple + turns, other + turns])
        result.append(equal[np.argmin(np.abs(equal - result[-1]).sum(axis=-1))])
    return np.array(result[1:])


@given(seeds, orders)
def test_continuous_euler_takes_the_nearest_of_all_equal_triples(seed: int, order: str) -> None:
    given_angles = rotations.to_euler(smooth_motion(seed, 30, 1, 0.5), order)
    result = rotations.continuous_euler(given_angles, order)
    np.testing.assert_allclose(
        result[:, 0], nearest_one_by_one(given_angles[:, 0], order), atol=1e-9
    )


@given(seeds, orders)
def test_continuous_euler_angles_are_the_same_rotations(seed: int, order: str) -> None:
    motion = smooth_motion(seed, 50, 4, 0.5)
    result = rotations.continuous_euler(rotations.to_euler(motion, order), order)
    assert_same_rotation(motion, rotations.from_euler(result, order), 1e-11)


@given(orders, st.integers(0, 2))
def test_euler_angles_of_a_steady_spin_grow_without_a_jump(order: str, axis: int) -> None:
    turns = np.linspace(0.0, 30.0, 400)
    spin = rotations.from_axis_angle(np.eye(3)[axis], turns)
    result = rotations.continuous_euler(rotations.to_euler(spin, order), order)
    assert np.abs(np.diff(result, axis=0)).max() < 0.1
    np.testing.assert_allclose(result[-1], 30.0 * np.eye(3)[axis], atol=1e-9)


@given(seeds)
def test_axis_and_angle_are_the_same_rotations(seed: int) -> None:
    motion = smooth_motion(seed, 50, 4, 0.5)
    result = rotations.continuous_axis_angle(motion)
    np.testing.assert_allclose(np.linalg.norm(result[..., 1:], axis=-1), 1.0)
    assert_same_rotation(motion, rotations.from_axis_angle(result[..., 1:], result[..., 0]), 1e-11)


@given(directions, st.floats(-10.0, 10.0))
def test_angle_about_a_steady_axis_neither_jumps_nor_turns_back(axis: Floats, start: float) -> None:
    turns = np.linspace(start, start + 30.0, 500)
    result = rotations.continuous_axis_angle(rotations.from_axis_angle(axis, turns))
    np.testing.assert_allclose(np.abs(np.diff(result[:, 0])), 30.0 / 499, atol=1e-9)
    np.testing.assert_allclose(np.abs(result[:, 1:] @ axis), 1.0, atol=1e-9)
    assert np.abs(np.diff(result[:, 1:], axis=0)).max() < 1e-6
    assert abs(result[0, 0]) <= np.pi + 1e-12


def test_axis_is_kept_through_rest() -> None:
    turns = np.array([0.0, 0.0, 0.2, 0.0, -0.2, 0.0])
    result = rotations.continuous_axis_angle(rotations.from_axis_angle([0.0, 0.0, 1.0], turns))
    np.testing.assert_allclose(result[:, 0], turns, atol=1e-15)
    np.testing.assert_array_equal(result[:, 1:], [[0.0, 0.0, 1.0]] * 6)


def test_axis_of_a_bone_that_never_turns_is_blenders_default() -> None:
    resting = np.broadcast_to(rotations.IDENTITY, (5, 2, 4))
    np.testing.assert_array_equal(
        rotations.continuous_axis_angle(resting), np.broadcast_to([0.0, 0.0, 1.0, 0.0], (5, 2, 4))
    )


def test_vectors_of_no_length_stay_zero_without_a_warning() -> None:
    np.testing.assert_array_equal(rotations.normalized([[0.0, 0, 0], [0, 3.0, 4.0]])[0], 0.0)
    np.testing.assert_allclose(rotations.normalized([0, 3, 4]), [0.0, 0.6, 0.8])


@given(seeds, st.sampled_from([(), (5,), (2, 3), (4, 1, 2)]))
def test_batches_equal_one_by_one(seed: int, shape: tuple[int, ...]) -> None:
    random = np.random.default_rng(seed)
    p = rotations.normalized(random.normal(size=(*shape, 4)))
    q = rotations.normalized(random.normal(size=(*shape, 4)))
    v = rotations.normalized(random.normal(size=(*shape, 3)))
    w = rotations.normalized(random.normal(size=(*shape, 3)))
    for function, arrays in (
        (rotations.multiply, (p, q)),
        (rotations.rotate, (q, v)),
        (rotations.shortest_arc, (v, w)),
        (rotations.angle_between, (p, q)),
        (rotations.to_matrix, (q,)),
        (rotations.to_rotation_vector, (q,)),
        (rotations.from_rotation_vector, (v,)),
        (lambda each: rotations.from_matrix(rotations.to_matrix(each)), (q,)),
        (lambda each: rotations.from_euler(each, "ZXY"), (v,)),
        (lambda each: rotations.to_euler(each, "ZXY"), (q,)),
    ):
        together = function(*arrays)
        for index in np.ndindex(shape):
            alone = function(*(array[index] for array in arrays))
            np.testing.assert_allclose(together[index], alone, atol=1e-15)


@given(components(2), angles)
def test_plane_vectors_turn_as_they_do_about_the_vertical(vector: Floats, angle: float) -> None:
    about = rotations.from_axis_angle(np.array([0.0, 0.0, 1.0]), angle)
    expected = rotations.rotate(about, np.append(vector, 0.0))[:2]
    np.testing.assert_allclose(rotations.rotate_in_plane(vector, angle), expected, atol=1e-12)


@given(quaternions, quaternions, st.floats(0.0, 1.0))
def test_between_two_poses_a_bone_takes_the_shortest_way(
    first: np.ndarray, second: np.ndarray, share: float
) -> None:
    there = rotations.slerp(first, second, np.array(share))
    whole = rotations.angle_between(first, second)
    assert rotations.angle_between(first, there) == pytest.approx(share * whole, abs=1e-6)
    assert rotations.angle_between(there, second) == pytest.approx((1.0 - share) * whole, abs=1e-6)


def test_values_of_every_rotation_mode_are_rotations() -> None:
    expected = np.array([np.cos(0.25), np.sin(0.25), 0.0, 0.0])
    decode = rotations.from_mode_values
    # Blender plays quaternions of any length.
    np.testing.assert_allclose(decode(2.0 * expected, "QUATERNION"), expected, atol=1e-12)
    axis_angle = np.array([0.5, 3.0, 0.0, 0.0])
    np.testing.assert_allclose(decode(axis_angle, "AXIS_ANGLE"), expected, atol=1e-12)
    euler = np.array([0.5, 0.2, -0.1])
    np.testing.assert_allclose(decode(euler, "ZXY"), rotations.from_euler(euler, "ZXY"))
    assert decode(euler, "XYZ") != pytest.approx(decode(euler, "ZYX"))
