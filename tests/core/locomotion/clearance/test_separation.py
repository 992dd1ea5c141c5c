# SPDX-License-Identifier: GPL-3.0-or-later
"""How deep arms pass through each other is measured right, whatever way they lie."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.locomotion.clearance.capsule_overlap import Capsules, measure_overlap
from octo_motion.core.locomotion.gait import table as gait
from octo_motion.core.locomotion.gait.gait_poser import GaitPoser, GaitSettings
from octo_motion.core.locomotion.rig.bone_rotations import frames_of_arm
from octo_motion.core.rotations import Floats
from tests.core.rigs import body_with_arms

ALONG = np.array([1.0, 0.0, 0.0])
HIGH = np.array([0.0, 0.0, 1.4])
FAR = np.array([[10.0, 0.0, 0.0], [11.0, 0.0, 0.0]])


def capsule(name: str, start: Floats, end: Floats, radius: float, *, rest: float = 0.0) -> Capsules:
    joints = np.stack([np.atleast_2d(start), np.atleast_2d(end)], axis=1)
    return Capsules(name, joints, np.full(2, radius), FAR + np.array([0.0, rest, 0.0]))


def nearest(a: Floats, b: Floats, c: Floats, d: Floats) -> float:
    """Distance of two line segments, by search."""
    s, t = np.meshgrid(np.linspace(0, 1, 401), np.linspace(0, 1, 401))
    gap = a + s[..., None] * (b - a) - c - t[..., None] * (d - c)
    return float(np.linalg.norm(gap, axis=-1).min())


@given(st.integers(0, 2**31))
@settings(max_examples=60)
def test_depth_is_what_is_missing_to_the_sum_of_radii(seed: int) -> None:
    random = np.random.default_rng(seed)
    a, b, c, d = random.normal(size=(4, 3))
    if seed % 5 == 0:
        d = c + 0.7 * (b - a)  # parallel
    if seed % 7 == 0:
        d = c  # no length
    radii = random.uniform(0.1, 1.0, 2)
    found = measure_overlap(
        [capsule("one", a, b, radii[0]), capsule("two", c, d, radii[1], rest=9.0)]
    )
    expected = max((radii.sum() - nearest(a, b, c, d)) / radii.min(), 0.0)
    assert found.depths[0] == pytest.approx(expected, abs=0.02 / radii.min())


@given(st.integers(0, 2**31), st.sampled_from([1e-6, 1e-3, 1e3]))
@settings(max_examples=40)
def test_depth_does_not_hang_on_the_unit_of_length(seed: int, unit: float) -> None:
    random = np.random.default_rng(seed)
    ends, radii = random.normal(size=(4, 3)), random.uniform(0.1, 1.0, 2)

    def deep(size: float) -> float:
        a, b, c, d = size * ends
        chains = [
            capsule("one", a, b, size * radii[0]),
            capsule("two", c, d, size * radii[1], rest=9.0),
        ]
        chains = [replace(each, at_rest=size * each.at_rest) for each in chains]
        return float(measure_overlap(chains).depths[0])

    assert deep(unit) == pytest.approx(deep(1.0), abs=1e-9)


def test_a_part_without_skin_overlaps_nothing() -> None:
    """A helper bone in the midst of the body: arms were 5·10³⁰ of its radius deep in it."""
    zero = np.zeros((1, 3))
    arm = capsule("arm", zero, zero + ALONG, 0.3)
    helper = capsule("helper", zero, zero + 0.1 * HIGH, 0.0, rest=9.0)
    assert measure_overlap([arm], [helper]).worst is None


def test_the_worst_frame_and_the_pair_are_named() -> None:
    start = np.array([[0.0, 0.0, 5.0], [0.0, 0.0, 0.5], [0.0, 0.0, 1.0]])
    moving = capsule("moving", start, start + ALONG, 0.3, rest=9.0)
    zero = np.zeros((3, 3))
    lying = capsule("lying", zero, zero + ALONG, 0.3)
    body = capsule("body", zero + HIGH, zero + ALONG + HIGH, 0.3, rest=20.0)
    found = measure_overlap([moving, lying], [body])
    np.testing.assert_allclose(found.depths, [0.0, 1.0 / 3.0, 2.0 / 3.0], atol=1e-9)
    assert [(each.first, each.second, each.frame) for each in found.overlaps] == [
        ("moving", "body", 2),
        ("moving", "lying", 1),
    ]
    assert found.worst == found.overlaps[0]


def test_what_overlaps_at_rest_is_built_so() -> None:
    zero = np.zeros((2, 3))
    one = capsule("one", zero, zero + ALONG, 0.3)
    two = capsule("two", zero, zero + ALONG, 0.3)
    found = measure_overlap([one, two])
    assert found.worst is None
    assert not found.depths.any()


def test_nothing_is_nothing() -> None:
    assert measure_overlap([]).worst is None
    one = capsule("one", np.zeros((4, 3)), np.ones((4, 3)), 0.1)
    assert measure_overlap([one]).depths.shape == (4,)


def posed_arms(preset: str, frames: int = 96, radius: float = 0.05) -> list[Capsules]:
    skeleton, arms, body = body_with_arms(8, 12)
    generator = GaitPoser(skeleton, arms, body, GaitSettings(gait.gait_presets()[preset]))
    phases = np.linspace(0.0, 2.0 * np.pi, frames, endpoint=False)
    rotations = generator.pose(phases, np.zeros((frames, 2))).rotations
    result = []
    for number, each in enumerate(arms):
        arm = frames_of_arm(skeleton, each.bones, body)
        joints = arm.joints(arm.from_bones(rotations[:, 12 * number : 12 * number + 12]))
        radii = np.interp(arm.reach, [0.0, 1.0], [radius, 0.1 * radius])
        result.append(Capsules(each.name, joints, radii, arm.joints(arm.at_rest)))
    return result


@pytest.mark.parametrize("preset", ["walk", "walk_search", "swim"])
def test_the_presets_keep_arms_apart(preset: str) -> None:
    found = measure_overlap(posed_arms(preset))
    assert found.worst is None or found.worst.depth <= 0.1


def test_the_literal_walk_crosses_neighbouring_arms() -> None:
    found = measure_overlap(posed_arms("walk_literal"))
    assert found.worst is not None
    assert found.worst.depth > 1.0


def test_coarse_bounds_miss_nothing() -> None:
    arms = posed_arms("walk_literal", 8)
    shifted = [Capsules(each.name, each.joints + 1000.0, each.radii, each.at_rest) for each in arms]
    np.testing.assert_allclose(
        measure_overlap(shifted).depths, measure_overlap(arms).depths, atol=1e-6
    )


def test_next_to_what_is_built_together_there_is_no_room_to_keep() -> None:
    # Two arms of two bones that spring from one place, side by side: their second bones are apart
    # at rest, by less than they are thick.
    ends = np.array([[0.0, 0.0, 0.0], [1.0, 0.25, 0.0], [2.0, 0.25, 0.0]])
    mirrored = ends * (1.0, -1.0, 1.0)
    joints = np.stack([ends, ends])
    joints[1, 1:, 1] = -0.1
    one = Capsules("one", joints, np.full(3, 0.2), ends)
    two = Capsules("two", np.stack([mirrored, mirrored]), np.full(3, 0.2), mirrored)

    assert measure_overlap([one, two]).worst is None
    # The same bones that spring from nowhere near do count.
    apart = [Capsules(each.name, each.joints, each.radii, each.at_rest) for each in (one, two)]
    apart[1] = Capsules("two", two.joints, two.radii, mirrored - 3.0 * np.eye(3)[1])
    assert measure_overlap(apart).depths[1] > 1.0
