# SPDX-License-Identifier: GPL-3.0-or-later
"""A stack looked at frame by frame is the stack as it is built, and computes little for it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from octo_motion.core.rotations import angle_between
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.clip.splice_timing import After, Timing
from octo_motion.core.splicing.transfer import splice
from octo_motion.core.splicing.transfer.parts import PARTS, Part
from octo_motion.core.splicing.transfer.splice import Splice, SplicePreview, build_splices
from tests.core.splice_bodies import LANDMARKS, humanoid, motion

HEAD, LEFT_ARM, LEGS, RIGHT_ARM, TRUNK = (
    PARTS[name] for name in ("head", "left_arm", "legs", "right_arm", "trunk")
)


def clips(count: int, frames: int = 60) -> list[Clip]:
    random = np.random.default_rng(21)
    bodies = [humanoid(random, same_proportions=False) for _ in range(count)]
    return [motion(random, body, frames) for body in bodies]


def assert_same(stack: list[Splice], number: int, base: Clip, timing: Timing) -> None:
    looked_at = SplicePreview(base, LANDMARKS, stack, number)
    retimed = [*stack[:number], replace(stack[number], timing=timing), *stack[number + 1 :]]
    whole = build_splices(base, LANDMARKS, retimed)
    for row, frame in enumerate(base.frames):
        seen = looked_at.at(float(frame), timing)
        assert seen.frames == [frame]
        assert angle_between(seen.rotations[0], whole.rotations[row]).max() < 1e-6
        assert np.allclose(seen.locations[0], whole.locations[row])


@pytest.mark.parametrize("after", ["hold", "loop", "stop"])
@pytest.mark.parametrize("part", [RIGHT_ARM, LEFT_ARM, LEGS, TRUNK, HEAD])
def test_each_frame_is_that_of_the_whole(part: Part, after: After) -> None:
    base, clip = clips(2)
    clip = clip.taken(range(14))
    timing = Timing(7.5, 3.0, 0.8, 40.0, ease_in=6.0, ease_out=5.0, after=after)
    for travel in {False, part == LEGS}:
        start = replace(timing, base_start=1.0)
        assert_same([Splice(part, clip, start, LANDMARKS, travel=travel)], 0, base, timing)


def test_other_splices_below_and_above_count() -> None:
    base, one, two, three = clips(4)
    first = Timing(5.0, 1.0, ease_in=4.0)
    stack = [
        Splice(LEGS, one, first, LANDMARKS),
        Splice(LEGS, two, Timing(20.0, 1.0, ease_in=9.0), LANDMARKS, travel=True),
        Splice(RIGHT_ARM, three, first, LANDMARKS, "exact"),
        Splice(
            LEGS,
            three,
            Timing(30.0, 4.0, length=15.0, ease_out=6.0),
            LANDMARKS,
            travel=True,
        ),
    ]
    for number in range(4):
        assert_same(stack, number, base, replace(stack[number].timing, base_start=12.0))


def test_a_look_matches_no_bones_and_takes_few_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    base, one, two = clips(3, 1000)
    timing = Timing(100.0, 1.0, ease_in=6.0, ease_out=6.0)
    stack = [
        Splice(LEGS, one, timing, LANDMARKS, travel=True),
        Splice(LEGS, two, Timing(500.0, 1.0), LANDMARKS, travel=True),
    ]
    looked_at = SplicePreview(base, LANDMARKS, stack, 0)
    widths: list[int] = []
    write = splice.writing_retargeted

    def watched(
        retarget: Any, before: Any, moment: Any, turned: Any, *rest: Any, **named: Any
    ) -> Any:
        widths.append(len(turned))
        return write(retarget, before, moment, turned, *rest, **named)

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("bones are matched again")

    monkeypatch.setattr(splice, "writing_retargeted", watched)
    monkeypatch.setattr(splice, "find_retargets", refuse)
    monkeypatch.setattr(splice, "Splicer", refuse)
    for start in (100.0, 250.0, 598.0):
        looked_at.at(600.0, replace(timing, base_start=start))
    # The frame itself, where each of the two begins and ends, half an easing.
    assert 0 < max(widths) <= 9
