# SPDX-License-Identifier: GPL-3.0-or-later
"""Splices on a cycle: what comes of it is a cycle, with no jump where it begins again."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.rotations import Floats, angle_between, from_rotation_vector
from octo_motion.core.skeleton import Skeleton
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.clip.clip_clock import MarkerPair
from octo_motion.core.splicing.clip.splice_timing import After, Timing, splice_window
from octo_motion.core.splicing.transfer.parts import PARTS, Part
from octo_motion.core.splicing.transfer.splice import Splice, SplicePreview
from tests.core.splice_bodies import LANDMARKS, humanoid, motion, spliced

few = settings(max_examples=30)
seeds = st.integers(0, 2**31)
parts = st.sampled_from(list(PARTS.values()))

COUNT = 97


def cycle(random: np.random.Generator, skeleton: Skeleton, frames: int = COUNT) -> Clip:
    """Bones that swing once in so many frames, the last of which is the first again."""
    angles = np.linspace(0.0, 2.0 * np.pi, frames)[:, None, None]
    size = random.normal(0.0, 0.3, (2, 1, len(skeleton), 3))
    turns = size[0] * np.sin(angles) + size[1] * np.cos(angles)
    made = motion(random, skeleton, frames)
    return replace(
        made,
        rotations=from_rotation_vector(turns),
        locations=np.zeros_like(made.locations),
        cyclic=True,
    )


def played(clip: Clip) -> Floats:
    """Joints over two rounds, (frames, bones, 3)."""
    joints = clip.posed()[1]
    return np.concatenate([joints[:-1], joints])


def kinks(positions: Floats) -> Floats:
    """(frames,) how much each frame's joints change their speed, at most."""
    return np.linalg.norm(np.diff(positions, 2, axis=0), axis=-1).max(axis=1)


@few
@given(
    seed=seeds,
    part=parts,
    start=st.floats(-150.0, 250.0),
    after=st.sampled_from(["stop", "hold", "loop"]),
    length=st.sampled_from([None, 30.0]),
)
def test_a_splice_on_a_cycle_gives_a_cycle_wherever_it_begins(
    seed: int, part: Part, start: float, after: After, length: float | None
):
    random = np.random.default_rng(seed)
    skeleton = humanoid(random)
    base, clip = cycle(random, skeleton), motion(random, skeleton, 61)
    timing = Timing(start, 1.0, length=length, ease_in=20.0, ease_out=20.0, after=after)
    result = spliced(base, LANDMARKS, Splice(part, clip, timing, LANDMARKS))
    assert result.cyclic
    assert angle_between(result.rotations[0], result.rotations[-1]).max() < 1e-6
    assert np.abs(result.locations[0] - result.locations[-1]).max() < 1e-6
    found = kinks(played(result))
    # Where it begins again nothing bends more sharply than elsewhere.
    assert found[COUNT - 2] <= 1.05 * np.delete(found[: COUNT - 1], 0).max()


def test_a_splice_that_begins_late_goes_on_at_the_start_of_the_cycle():
    random = np.random.default_rng(2)
    skeleton = humanoid(random)
    base, clip = cycle(random, skeleton), motion(random, skeleton, 41)
    late = splice_window(Timing(81.0, 1.0, after="stop"), base, clip)
    # 16 frames are left; the other 24 come at the start of the next round.
    frames = base.frames[late.frames]
    for frame, moment in ((81.0, 1.0), (97.0, 17.0), (1.0, 17.0), (25.0, 41.0)):
        row = int(np.flatnonzero(frames == frame)[0])
        assert late.weights[row] == 1.0
        assert late.splice_frames[row] == pytest.approx(moment)
    between = (frames > 25.0) & (frames < 81.0)
    assert (late.weights[between] == 0.0).all()
    # Beginning a round later is the same.
    again = splice_window(Timing(81.0 + 96.0, 1.0, after="stop"), base, clip)
    assert np.allclose(again.weights, late.weights)
    assert np.allclose(again.splice_frames, late.splice_frames)


def test_what_lies_outside_a_splice_that_wraps_is_the_bases_to_the_last_digit():
    random = np.random.default_rng(2)
    skeleton = humanoid(random)
    base, clip = cycle(random, skeleton), motion(random, skeleton, 41)
    timing = Timing(81.0, 1.0, ease_in=6.0, ease_out=6.0, after="stop")
    result = spliced(base, LANDMARKS, Splice(PARTS["left_arm"], clip, timing, LANDMARKS))
    assert np.array_equal(result.rotations[25:80], base.rotations[25:80])
    assert not np.allclose(result.rotations[90], base.rotations[90])
    assert not np.allclose(result.rotations[10], base.rotations[10])


def test_a_loop_is_fitted_to_the_cycle_by_whole_rounds():
    random = np.random.default_rng(3)
    skeleton = humanoid(random)
    base, clip = cycle(random, skeleton), cycle(random, skeleton, 29)
    timing = Timing(13.0, 5.0, after="loop", ease_in=6.0, ease_out=6.0)
    span = splice_window(timing, base, clip)
    assert span.frames == slice(0, COUNT)
    assert (span.weights == 1.0).all()
    result = spliced(base, LANDMARKS, Splice(PARTS["left_arm"], clip, timing, LANDMARKS))
    # Three rounds of 28 frames take 96.
    third = (COUNT - 1) // 3
    arm = [number for number, name in enumerate(skeleton.names) if name.startswith("forearm.L")]
    turns = result.rotations[:, arm]
    assert angle_between(turns[: 2 * third], turns[third : 3 * third]).max() < 1e-2
    found = kinks(played(result))
    assert found[COUNT - 2] <= 1.05 * np.delete(found[: COUNT - 1], 0).max()


@pytest.mark.parametrize("after", ["stop", "hold", "loop"])
def test_what_is_seen_while_dragged_over_the_end_of_a_cycle_is_what_is_built(after: After):
    random = np.random.default_rng(4)
    skeleton = humanoid(random)
    base, clip = cycle(random, skeleton), motion(random, skeleton, 41)
    timing = Timing(81.0, 1.0, ease_in=6.0, ease_out=9.0, after=after)
    timing = replace(timing, markers=(MarkerPair("hit", 90.0, 20.0),))
    splice = Splice(PARTS["left_arm"], clip, timing, LANDMARKS)
    preview = SplicePreview(base, LANDMARKS, [splice], 0)
    built = spliced(base, LANDMARKS, splice)
    for row in (0, 3, 18, 30, 82, 90, 96):
        seen = preview.at(base.frames[row], timing)
        assert np.abs(seen.posed()[1] - built.posed()[1][row]).max() < 1e-9


def test_legs_with_travel_come_and_go_within_the_cycle():
    random = np.random.default_rng(4)
    skeleton = humanoid(random)
    base, clip = cycle(random, skeleton), motion(random, skeleton, 41, strength=0.2)
    timing = Timing(81.0, 1.0, ease_in=6.0, ease_out=6.0, after="stop")
    splice = Splice(PARTS["legs"], clip, timing, LANDMARKS, travel=True)
    result = spliced(base, LANDMARKS, splice)
    legs = [skeleton.index[f"{each}.L"] for each in ("thigh", "shin", "foot")]
    assert np.allclose(result.rotations[0, legs], result.rotations[-1, legs])
    assert np.allclose(result.rotations[:80], base.rotations[:80])
