# SPDX-License-Identifier: GPL-3.0-or-later
"""What a body does by itself: springs, breaths, strokes and blinks over time, and which bones."""

from dataclasses import replace

import numpy as np
import pytest

from octo_motion.core.errors import RigError, SettingsError
from octo_motion.core.locomotion.body import (
    BodySettings,
    BodyTrack,
    OrganPoses,
    SelfMotion,
    carriages,
    find_organs,
    self_motion,
    steps_of,
)
from octo_motion.core.locomotion.body.by_itself import sprung
from octo_motion.core.locomotion.octopus import OctopusShape, build_bones
from octo_motion.core.locomotion.rig import BodyFrame, body_frame
from octo_motion.core.rotations import conjugate, multiply, rotate
from octo_motion.core.skeleton import Skeleton

ALL = BodySettings(surge=1.0, mantle=1.0, siphon=1.0, eyes=1.0, head=1.0)


def track(seconds: float, places: np.ndarray | None = None, *, cyclic: bool = False) -> BodyTrack:
    times = steps_of(seconds)
    zeros = np.zeros(len(times))
    located = np.zeros((len(times), 3))
    if places is not None:
        located[:, 1] = np.interp(times, np.linspace(0.0, seconds, len(places)), places)
    turned = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1))
    return BodyTrack(times, located, turned, zeros, zeros, cyclic)


def made(of: BodyTrack, *, seed: int = 0) -> SelfMotion:
    return self_motion(of, ALL, breath=(0.05, 3.0), unlike=1.0, seed=seed, eyes=2)


def stopping(seconds: float = 8.0, stop: float = 2.0) -> BodyTrack:
    """A body that goes an arm length in a second towards −Y, and stops within a fifth of one."""
    times = np.linspace(0.0, seconds, 4001)
    speed = np.clip((stop + 0.2 - times) / 0.2, 0.0, 1.0)
    return track(
        seconds, -np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) * times[1]
    )


def test_a_spring_is_what_its_equation_says() -> None:
    """Of a step: 1 − e^(−ζωt) (cos ω't + ζω/ω' sin ω't)."""
    step, whole, damping = 0.01, 2.0 * np.pi * 1.1, 0.3
    values = np.ones((500, 1))
    values[0] = 0.0
    found = sprung(values, step, frequency=1.1, damping=damping, cyclic=False)[:, 0]
    # The step is a ramp of one step's length: in the mean half a step late.
    times = np.maximum(step * (np.arange(500) - 0.5), 0.0)
    slower = whole * np.sqrt(1.0 - damping**2)
    fading = np.exp(-damping * whole * times)
    exact = 1.0 - fading * (
        np.cos(slower * times) + damping * whole / slower * np.sin(slower * times)
    )
    np.testing.assert_allclose(found, exact, atol=1e-3)


def test_a_spring_goes_round_a_loop_without_a_seam() -> None:
    values = np.sin(np.linspace(0.0, 2.0 * np.pi, 101))[:, None] ** 3
    once = sprung(values, 0.01, frequency=1.1, damping=0.3, cyclic=True)
    many = np.concatenate([np.tile(values[:-1], (30, 1)), values[:1]])
    long = sprung(many, 0.01, frequency=1.1, damping=0.3, cyclic=False)[-101:]
    np.testing.assert_allclose(once, long, atol=1e-7)
    np.testing.assert_allclose(once[0], once[-1], atol=1e-12)


def test_the_mantle_trails_swings_past_rest_and_settles() -> None:
    found = made(stopping())
    back = found.swing[:, 1]  # it goes towards −Y: +Y is behind it
    at = dict(
        zip(("going", "stopped"), np.searchsorted(found.track.times, [1.5, 2.2]), strict=True)
    )
    assert back[at["going"]] == pytest.approx(0.22, rel=0.1)
    after = back[at["stopped"] :]
    assert after.min() < -0.05  # it swings on ahead
    late = np.abs(back[np.searchsorted(found.track.times, 5.0) :])
    assert late.max() < 0.01


def test_it_does_not_hang_on_how_long_the_motion_is() -> None:
    """Equal to half a step's time: a longer motion is looked at at other moments."""
    short, long = made(stopping(4.0)), made(stopping(8.0))
    times = np.linspace(0.5, 3.5, 13)
    np.testing.assert_allclose(short.at(short.swing, times), long.at(long.swing, times), atol=2e-3)


def test_breaths_are_not_alike_and_neither_are_seeds() -> None:
    widths = [made(track(60.0), seed=seed).filled for seed in (0, 0, 1)]
    np.testing.assert_array_equal(widths[0], widths[1])
    assert np.abs(widths[0] - widths[2]).max() > 0.005
    inner = widths[0][1:-1]
    tops = inner[(inner > widths[0][:-2]) & (inner >= widths[0][2:])]
    # 0.3 a second at rest: 20 in a minute, each of another depth.
    assert 18 <= len(tops) <= 22
    assert np.ptp(tops) > 0.01
    assert 0.035 < tops.min() < tops.max() < 0.065


def test_who_goes_fast_breathes_faster() -> None:
    def count(filled: np.ndarray) -> int:
        middle = filled - 0.02
        return int(np.sum((middle[1:] > 0.0) & (middle[:-1] <= 0.0)))

    fast = track(30.0, np.linspace(0.0, 30.0, 301))
    assert count(made(fast).filled) > 1.3 * count(made(track(30.0)).filled)


@pytest.mark.parametrize("seconds", [1.0, 5.0, 20.0])
def test_a_loop_breathes_and_blinks_without_a_seam(seconds: float) -> None:
    found = made(track(seconds, cyclic=True))
    for table in (found.filled, found.outflow, *found.shut.T):
        assert table[0] == pytest.approx(table[-1], abs=1e-9)
        assert abs((table[1] - table[0]) - (table[-1] - table[-2])) < 2e-3


def test_a_breath_has_no_corner_and_fills_faster_than_it_empties() -> None:
    still = track(10.0, cyclic=True)
    filled = self_motion(still, ALL, breath=(0.2, 2.9), unlike=0.0, seed=0, eyes=0).filled
    assert filled.max() == pytest.approx(0.2, abs=1e-4)
    assert filled.min() == pytest.approx(0.0, abs=1e-12)
    peaks = np.flatnonzero((filled[1:-1] > filled[:-2]) & (filled[1:-1] >= filled[2:]))
    assert len(peaks) == 3
    slope = np.diff(filled)
    assert slope.max() > -slope.min()
    assert np.abs(np.diff(slope)).max() < 0.03 * slope.max()
    with pytest.raises(SettingsError, match="breath takes"):
        self_motion(still, ALL, breath=(0.2, 0.0), unlike=0.0, seed=0, eyes=0)


def test_a_stroke_draws_the_mantle_together_and_the_glide_swells_it() -> None:
    times = steps_of(4.0)
    swims = replace(track(4.0), strokes=times / 2.0, swimming=np.ones(len(times)))
    filled = made(swims).filled
    stroke = filled[np.searchsorted(times, 2.1)]
    glide = filled[np.searchsorted(times, 3.5)]
    assert stroke < -0.08 < 0.02 < glide


def test_eyes_blink_now_and_then() -> None:
    shut = made(track(60.0)).shut
    assert shut.shape[1] == 2
    for eye in shut.T:
        blinks = np.sum((eye[1:] > 0.5) & (eye[:-1] <= 0.5))
        assert 8 <= blinks <= 12
    assert 0.02 < shut.mean() < 0.05


# --- Which bones ----------------------------------------------------------------------------------


def octopus(*names: tuple[str, str]) -> tuple[Skeleton, list[tuple[str, ...]]]:
    """The default one, with some bones called otherwise."""
    bones = build_bones(OctopusShape())
    other = dict(names)
    called = tuple(other.get(name, name) for name in bones.names)
    count = len(called)
    skeleton = Skeleton(
        names=called,
        parents=bones.parents,
        rest_matrices=bones.matrices,
        lengths=np.linalg.norm(bones.tails - bones.heads, axis=1),
        connected=bones.connected,
        deform=bones.deform,
        inherits_rotation=(True,) * count,
        constrained=(False,) * count,
        weighted=(True,) * count,
        bendy_segments=(1,) * count,
        sucker_axes=("",) * count,
    )
    arms: dict[str, list[str]] = {}
    for name in called:
        if name.startswith("arm"):
            arms.setdefault(name.split(".")[0] + name[-1], []).append(name)
    return skeleton, [tuple(each) for each in arms.values()]


def frame(skeleton: Skeleton, arms: list[tuple[str, ...]]) -> BodyFrame:
    return body_frame(skeleton, arms, "Z", "-Y")


@pytest.mark.parametrize(
    ("left", "right", "siphon"),
    [
        ("eye.L", "eye.R", "siphon"),
        ("LeftEye", "RightEye", "Funnel"),
        ("DEF-Eye_l", "DEF-Eye_r", "Hyponome_01"),
        ("Kugel.L", "Kugel.R", "siphon"),  # by their places
    ],
)
def test_parts_are_found_by_names_and_places(left: str, right: str, siphon: str) -> None:
    skeleton, arms = octopus(("eye.L", left), ("eye.R", right), ("siphon", siphon))
    found = find_organs(skeleton, arms, frame(skeleton, arms))
    assert found.mantle == ("head", "mantle")
    assert found.eyes == (left, right)
    assert found.siphon == siphon


def test_what_is_given_by_hand_counts() -> None:
    skeleton, arms = octopus()
    body = frame(skeleton, arms)
    found = find_organs(skeleton, arms, body, mantle="head", siphon="-", eyes=("eye.R", "-"))
    assert found == type(found)(("head",), "", ("eye.R",))
    with pytest.raises(RigError, match="no bone 'Fin'"):
        find_organs(skeleton, arms, body, siphon="Fin")


def test_parts_of_a_body_are_where_the_bones_that_carry_them_are() -> None:
    skeleton, _ = octopus()
    generator = np.random.default_rng(3)
    turned = ("head", "mantle", "siphon")
    rotations = generator.normal(size=(5, len(turned), 4))
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    found = carriages(OrganPoses(turned, rotations, {}), skeleton, [*turned, "eye.L", "body"])
    basis = np.tile([1.0, 0.0, 0.0, 0.0], (5, len(skeleton), 1))
    basis[:, [skeleton.index[name] for name in turned]] = rotations
    whole, heads = skeleton.pose(basis)
    for name, (turns, shifts) in found.items():
        bone = skeleton.index[name]
        np.testing.assert_allclose(
            rotate(turns, skeleton.heads[bone]) + shifts, heads[:, bone], atol=1e-12
        )
        expected = multiply(whole[:, bone], conjugate(skeleton.rest_rotations[bone]))
        np.testing.assert_allclose(np.abs(np.sum(turns * expected, axis=1)), 1.0, atol=1e-12)
