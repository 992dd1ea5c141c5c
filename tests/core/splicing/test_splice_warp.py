# SPDX-License-Identifier: GPL-3.0-or-later
"""A splice's clip faster and slower: by a rate that changes, by markers, and over a loop's seam."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.errors import ClipError
from octo_motion.core.rotations import Floats
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.clip.clip_clock import ClipClock, MarkerPair, RateCurve
from octo_motion.core.splicing.clip.splice_timing import Timing, splice_clock, splice_window
from octo_motion.core.splicing.transfer.mirror import mirrored_clip
from octo_motion.core.splicing.transfer.parts import PARTS, Part
from octo_motion.core.splicing.transfer.retarget import MappedClip
from octo_motion.core.splicing.transfer.splice import Splice, SplicePreview
from octo_motion.core.splicing.transfer.timing_suggestions import suggest_timings
from tests.core.splice_bodies import LANDMARKS, humanoid, motion, spliced

few = settings(max_examples=40)
seeds = st.integers(0, 2**31)

STEADY = Timing(11.0, 5.0)


def clip(frames: int, rate: float = 24.0, first: float = 1.0) -> Clip:
    random = np.random.default_rng(1)
    made = motion(random, humanoid(random), frames)
    return replace(made, rate=rate, frames=np.arange(frames) + first)


def pairs_from(random: np.random.Generator, count: int) -> tuple[MarkerPair, ...]:
    frames, moments = (start + np.cumsum(random.uniform(0.5, 30.0, count)) for start in (11.0, 5.0))
    return tuple(
        MarkerPair(f"m{number}", float(frame), float(moment))
        for number, (frame, moment) in enumerate(zip(frames, moments, strict=True))
    )


def clock_of(timing: Timing) -> ClipClock:
    return splice_clock(timing, 24.0, 24.0)


@few
@given(seed=seeds, count=st.integers(1, 6))
def test_markers_are_met_and_the_clip_never_runs_backwards(seed: int, count: int):
    random = np.random.default_rng(seed)
    pairs = pairs_from(random, count)
    clock = clock_of(replace(STEADY, markers=pairs))
    for each in pairs:
        assert clock.at(np.array(each.base)) == pytest.approx(each.clip)
    assert clock.at(np.array(11.0)) == pytest.approx(5.0)
    looks = np.linspace(0.0, pairs[-1].base + 20.0, 4001)
    assert (np.diff(clock.at(looks)) > 0.0).all()
    # And back.
    assert np.abs(clock.when(clock.at(looks)) - looks).max() < 1e-6


@few
@given(seed=seeds, count=st.integers(1, 6))
def test_between_markers_the_speed_never_jumps(seed: int, count: int):
    clock = clock_of(replace(STEADY, markers=pairs_from(np.random.default_rng(seed), count)))
    for frame in clock.frames:
        around = frame + np.array([-1e-5, 0.0, 1e-5])
        before, behind = np.diff(clock.at(around)) / 1e-5
        assert before == pytest.approx(behind, abs=1e-3 * max(1.0, before))
        assert clock.speed(around)[1] == pytest.approx(behind, abs=1e-3 * max(1.0, behind))


def test_behind_the_last_marker_the_rate_holds():
    pairs = (MarkerPair("hit", 31.0, 15.0),)
    clock = clock_of(replace(STEADY, rate=0.75, markers=pairs))
    assert np.allclose(np.diff(clock.at(np.arange(31.0, 60.0))), 0.75)


def test_markers_before_a_start_do_not_count_so_that_starts_can_be_dragged_over_them():
    pairs = (MarkerPair("early", 9.0, 8.0), MarkerPair("hit", 31.0, 15.0))
    alone = clock_of(replace(STEADY, markers=pairs[1:]))
    assert np.array_equal(
        clock_of(replace(STEADY, markers=pairs)).at(np.arange(60.0)), alone.at(np.arange(60.0))
    )
    late = clock_of(replace(STEADY, base_start=40.0, markers=pairs))
    assert np.array_equal(late.at(np.arange(60.0)), 5.0 + np.arange(60.0) - 40.0)


def test_markers_that_cross_are_told_by_name():
    pairs = (MarkerPair("step", 20.0, 30.0), MarkerPair("hit", 31.0, 15.0))
    with pytest.raises(ClipError, match="'step' and 'hit'"):
        clock_of(replace(STEADY, markers=pairs))


def test_a_rate_that_changes_adds_up():
    looks = np.arange(1.0, 80.0, 0.25)
    curve = RateCurve(looks, 1.0 + 0.5 * np.sin(looks / 7.0))
    clock = splice_clock(replace(STEADY, rates=curve), 24.0, 48.0)
    frames = np.linspace(11.0, 79.0, 500)
    summed = frames - 11.0 - 3.5 * (np.cos(frames / 7.0) - np.cos(11.0 / 7.0))
    assert np.abs(clock.at(frames) - 5.0 - 2.0 * summed).max() < 1e-3
    assert np.abs(clock.when(clock.at(frames)) - frames).max() < 1e-6
    level = replace(STEADY, rates=RateCurve(looks, np.full(len(looks), 0.5)))
    assert np.allclose(clock_of(level).at(frames), clock_of(replace(STEADY, rate=0.5)).at(frames))


def test_a_warped_clip_ends_when_it_has_run_out():
    pairs = (MarkerPair("hit", 31.0, 15.0),)
    timing = replace(STEADY, markers=pairs, after="stop", ease_out=4.0)
    span = splice_window(timing, clip(80), clip(25))
    # Half as fast up to the marker, then ten frames more.
    assert span.frames == slice(10, 41)
    assert span.splice_frames[-1] == pytest.approx(25.0)
    held = splice_window(replace(timing, after="hold"), clip(80), clip(25))
    steps = np.diff(held.splice_frames)
    assert (steps >= 0.0).all()
    assert np.abs(np.diff(steps)).max() < 0.2
    assert held.splice_frames[-1] == 25.0


@pytest.mark.parametrize("rates", [None, RateCurve(np.array([1.0, 80.0]), np.array([0.5, 2.0]))])
@pytest.mark.parametrize("part", [PARTS["left_arm"], PARTS["legs"]])
def test_what_is_seen_while_a_warped_splice_is_dragged_is_what_is_built(
    rates: RateCurve | None, part: Part
):
    base, other = clip(80), clip(25)
    pairs = () if rates is not None else pairs_from(np.random.default_rng(4), 3)
    timing = replace(STEADY, rates=rates, markers=pairs, after="loop", ease_in=3.0, ease_out=4.0)
    splice = Splice(
        part, other, STEADY, LANDMARKS, travel=part.kind is not None and part.kind.travels
    )
    preview = SplicePreview(base, LANDMARKS, [splice], 0)
    for start in (3.0, 20.5):
        moved = replace(timing, base_start=start)
        built = spliced(base, LANDMARKS, replace(splice, timing=moved))
        for row in (0, 30, 55, 79):
            seen = preview.at(base.frames[row], moved)
            assert np.abs(seen.posed()[1] - built.posed()[1][row]).max() < 1e-9


def test_timing_is_suggested_for_the_clip_as_it_is_warped_and_mirrored():
    random = np.random.default_rng(3)
    base = replace(motion(random, humanoid(random), 300, strength=0.4), rate=24.0)
    cut = base.taken(np.arange(120, 180))
    # Every frame of it is shown twice: the base at half speed has its match where it did.
    slow = replace(base, frames=2.0 * base.frames - 1.0, rate=24.0)
    looks = np.arange(1.0, 600.0)
    timing = Timing(1.0, cut.frames[0], rates=RateCurve(looks, np.full(len(looks), 0.5)))
    onto = MappedClip(slow, LANDMARKS)
    best, *_ = suggest_timings(onto, MappedClip(cut, LANDMARKS), timing)
    assert best.base_start == pytest.approx(241.0, abs=2.0)
    mirrored, marks = mirrored_clip(cut, LANDMARKS)
    splice = Splice(PARTS["legs"], mirrored, timing, marks, mirror=True)
    again, *_ = suggest_timings(onto, splice.mapped, timing)
    assert again.base_start == best.base_start


# --- Loops ----------------------------------------------------------------------------------------


def kinks(positions: Floats) -> Floats:
    """(frames,) how much each frame's joints change their speed, at most."""
    return np.linalg.norm(np.diff(positions, 2, axis=0), axis=-1).max(axis=1)


@few
@given(seed=seeds, travel=st.booleans())
def test_position_and_speed_go_on_over_the_seam_of_a_loop(seed: int, *, travel: bool):
    random = np.random.default_rng(seed)
    skeleton = humanoid(random)
    # In small steps a jump in speed stands out from what bends.
    still = motion(random, skeleton, 200).taken(np.zeros(600, dtype=int))
    base = replace(still, frames=np.arange(1.0, 601.0), rate=120.0)
    # It ends elsewhere, in another pose and at another speed than it begins.
    made = replace(motion(random, skeleton, 241, strength=0.3), rate=120.0)
    ways = np.linspace(0.0, 1.0, 241)[:, None] * random.normal(0.0, 0.5, 3)
    made.locations[:, 0] = ways + 0.1 * np.sin(4.0 * ways)
    part = PARTS["legs"] if travel else PARTS["left_arm"]
    timing = Timing(1.0, 1.0, after="loop", ease_in=48.0, ease_out=48.0)
    found = kinks(
        spliced(base, LANDMARKS, Splice(part, made, timing, LANDMARKS, travel=travel)).posed()[1]
    )
    # The clip's last frame, which is its first one again, each time.
    for seam in (240, 480):
        around = found[seam - 49 : seam + 47]
        assert found[seam - 1] <= np.delete(around, 48).max()


def test_a_hard_cut_stays_one():
    timing = Timing(1.0, 1.0, after="loop")
    span = splice_window(timing, clip(80), clip(25))
    assert (span.seams == 0.0).all()
    assert (span.seam_speeds == 0.0).all()
