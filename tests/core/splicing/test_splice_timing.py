# SPDX-License-Identifier: GPL-3.0-or-later
"""A splice shows the right moment at the right time, and comes and goes softly."""

from dataclasses import replace

import numpy as np
import pytest

from octo_motion.core.errors import ClipError
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.clip.splice_timing import Timing, splice_window
from octo_motion.core.splicing.transfer.retarget import MappedClip
from octo_motion.core.splicing.transfer.timing_suggestions import Suggestion, suggest_timings
from tests.core.splice_bodies import LANDMARKS, humanoid, motion


def clip(frames: int, rate: float, first: float = 1.0) -> Clip:
    random = np.random.default_rng(1)
    made = motion(random, humanoid(random), frames)
    return replace(made, rate=rate, frames=np.arange(frames) + first)


def test_splice_time_follows_the_formula_in_real_time():
    base, splice = clip(60, 24.0, first=10.0), clip(100, 48.0)
    span = splice_window(Timing(base_start=20.0, splice_start=5.0, rate=0.5), base, splice)
    assert span.frames == slice(10, 60)
    # Half speed, twice the frame rate: a frame per frame.
    assert np.allclose(span.splice_frames, 5.0 + np.arange(50.0))
    assert (span.weights == 1.0).all()


def test_a_start_between_frames_is_kept():
    span = splice_window(Timing(20.25, 5.0), clip(60, 24.0), clip(100, 24.0))
    assert span.splice_frames[0] == pytest.approx(5.75)


def test_length_and_easing():
    timing = Timing(11.0, 1.0, length=20.0, ease_in=4.0, ease_out=8.0)
    span = splice_window(timing, clip(60, 24.0), clip(100, 24.0))
    assert span.frames == slice(10, 31)
    assert span.weights[0] == span.weights[-1] == 0.0
    assert span.weights[2] == pytest.approx(0.5)
    assert span.weights[-5] == pytest.approx(0.5)
    assert (span.weights[4:13] == 1.0).all()


@pytest.mark.parametrize(
    ("after", "last", "end"), [("hold", 39.0, 60), ("loop", 2.0, 60), ("stop", 9.0, 10)]
)
def test_what_happens_when_the_splice_clip_runs_out(after: str, last: float, end: int):
    splice = clip(10, 24.0, first=0.0)
    timing = Timing(1.0, 0.0, after=after)  # pyright: ignore[reportArgumentType]
    span = splice_window(timing, clip(60, 24.0), splice)
    assert span.frames == slice(0, end)
    if after == "loop":
        assert span.splice_frames.max() <= 9.0
        assert list(span.splice_frames[:12]) == [*range(10), 1.0, 2.0]
    elif after == "stop":
        assert span.splice_frames[-1] == last


def test_a_loops_rounds_meet_halfway_over_the_easing():
    splice = clip(11, 24.0, first=0.0)
    timing = Timing(1.0, 0.0, after="loop", ease_in=4.0, ease_out=4.0)
    span = splice_window(timing, clip(26, 24.0), splice)
    assert list(span.rounds) == [0] * 11 + [1] * 9 + [2] * 6
    # At the seam half of the step is taken by either side; further off than the easing nothing.
    assert span.seams[10] == pytest.approx(0.5)
    assert np.allclose(span.seams[:7], 0.0)
    assert np.allclose(span.seams[14:17], 0.0)
    assert (np.diff(span.seams[6:11]) > 0.0).all()
    assert (span.seams[11:14] < 0.0).all()
    # Nothing comes before the first round, and nothing behind the last.
    one_round = splice_window(timing, clip(11, 24.0), splice)
    assert (one_round.seams == 0.0).all()
    # Asked for a hard cut, it is one.
    assert (
        splice_window(replace(timing, ease_in=0.0, ease_out=0.0), splice, splice).seams == 0.0
    ).all()


def test_easing_on_one_side_alone_closes_a_loop_as_well():
    splice = clip(11, 24.0, first=0.0)
    for ease_in, ease_out in ((400.0, 0.0), (0.0, 400.0)):
        timing = Timing(1.0, 0.0, after="loop", ease_in=ease_in, ease_out=ease_out, rate=0.01)
        span = splice_window(timing, clip(2001, 24.0), splice)
        seam = int(np.flatnonzero(np.diff(span.rounds))[0])
        # What the two sides take makes up the whole step.
        assert span.seams[seam] - span.seams[seam + 1] == pytest.approx(1.0, abs=1e-4)


def test_a_held_clip_slows_down_to_its_last_pose():
    base, splice = clip(60, 24.0, first=0.0), clip(21, 24.0, first=0.0)
    timing = Timing(0.0, 0.0, ease_out=6.0)
    span = splice_window(timing, base, splice)
    assert np.array_equal(span.splice_frames[:15], np.arange(15.0))
    steps = np.diff(span.splice_frames)
    assert (steps >= 0.0).all()
    assert np.abs(np.diff(steps)).max() < 1.01 / 12.0
    assert span.splice_frames[26] == span.splice_frames[-1] == 20.0
    # A base that ends with the clip has nothing to hold.
    assert np.array_equal(splice_window(timing, splice, splice).splice_frames, splice.frames)
    hard = splice_window(replace(timing, ease_out=0.0), base, splice)
    assert hard.splice_frames[20] == 20.0


def test_a_window_outside_the_base_is_empty():
    span = splice_window(Timing(100.0, 1.0), clip(60, 24.0), clip(10, 24.0))
    assert span.frames == slice(0, 0)


@pytest.mark.parametrize(
    "wrong",
    [
        {"rate": 0.0},
        {"rate": float("nan")},
        {"length": 0.0},
        {"ease_in": -1.0},
        {"ease_out": -1.0},
        {"after": "explode"},
    ],
)
def test_a_timing_that_makes_no_sense_is_told(wrong: dict[str, float]):
    timing = replace(Timing(1.0, 1.0), **wrong)
    with pytest.raises(ClipError):
        splice_window(timing, clip(60, 24.0), clip(10, 24.0))


def suggested(base: Clip, splice: Clip, timing: Timing) -> list[Suggestion]:
    return suggest_timings(MappedClip(base, LANDMARKS), MappedClip(splice, LANDMARKS), timing)


@pytest.mark.parametrize("rate", [24.0, 120.0])
def test_a_clip_is_found_within_the_clip_that_it_was_cut_from(rate: float):
    random = np.random.default_rng(3)
    base = replace(motion(random, humanoid(random), 300, strength=0.4), rate=rate)
    cut = slice(120, 180)
    splice = replace(
        base,
        frames=base.frames[cut],
        rotations=base.rotations[cut],
        locations=base.locations[cut],
        world=base.world[cut],
    )
    best, *others = suggested(base, splice, Timing(1.0, splice.frames[0]))
    assert best.base_start == pytest.approx(121.0, abs=1.0)
    assert len(others) == 2
    assert all(best.cost < other.cost for other in others)
    apart = np.diff(sorted(each.base_start for each in (best, *others)))
    assert (apart >= 0.2 * rate).all()


def test_only_as_much_of_a_clip_as_is_spliced_counts():
    random = np.random.default_rng(3)
    base = replace(motion(random, humanoid(random), 300, strength=0.4), rate=24.0)
    order = np.r_[60:84, 200:280]
    splice = replace(
        base,
        frames=np.arange(1.0, len(order) + 1.0),
        rotations=base.rotations[order],
        locations=base.locations[order],
        world=base.world[order],
    )
    whole, *_ = suggested(base, splice, Timing(1.0, splice.frames[0]))
    assert whole.base_start == pytest.approx(201.0 - 24.0, abs=8.0)
    for rate in (1.0, 0.5):
        slow = replace(base, rate=base.rate * rate)
        first, *_ = suggested(slow, splice, Timing(1.0, splice.frames[0], rate, 23.0))
        assert first.base_start == pytest.approx(61.0, abs=1.0)
