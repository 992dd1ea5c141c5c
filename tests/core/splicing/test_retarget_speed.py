# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole clips are carried over in as many calls, however long they are: no frame costs one."""

import sys
from dataclasses import replace

import numpy as np

from octo_motion.core.skeleton import Skeleton
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.transfer.retarget import MappedClip
from octo_motion.core.splicing.transfer.whole_body import WholeBody, retarget_clip
from tests.core.rigs import skeleton_of
from tests.core.splice_bodies import LANDMARKS, humanoid, motion

BONES = 60


def with_fingers(skeleton: Skeleton) -> Skeleton:
    """The same with as many more bones on the hands."""
    more = BONES - len(skeleton)
    hands = [skeleton.index[f"hand.{side}"] for side in "LR"]
    parents = [hands[number % 2] for number in range(more)]
    return skeleton_of(
        [*skeleton.names, *(f"finger {number}" for number in range(more))],
        [*skeleton.parents, *parents],
        [*skeleton.rest_matrices, *skeleton.rest_matrices[parents]],
        [*skeleton.lengths, *([0.05] * more)],
    )


def bodies(frames: int) -> tuple[Clip, Clip, Clip]:
    """One that does nothing, the same for a frame, and a clip."""
    random = np.random.default_rng(1)
    source = motion(random, with_fingers(humanoid(random)), frames)
    body = with_fingers(humanoid(random, same_proportions=False))
    rest = np.zeros((frames, BONES, 4))
    rest[..., 0] = 1.0
    still = Clip(
        "still",
        body,
        source.frames,
        source.rate,
        rest,
        np.zeros((frames, BONES, 3)),
        np.broadcast_to(np.eye(4), (frames, 4, 4)).copy(),
    )
    return still, replace(still.taken([0]), name="base"), source


def calls(frames: int) -> int:
    """Functions that are called, Python's and numpy's, to retarget so many frames."""
    still, base, source = bodies(frames)
    count = 0

    def counted(_frame: object, event: str, _argument: object) -> None:
        nonlocal count
        count += event in {"call", "c_call"}

    sys.setprofile(counted)
    try:
        result = retarget_clip(MappedClip(base, LANDMARKS), still, MappedClip(source, LANDMARKS))
    finally:
        sys.setprofile(None)
    assert np.isfinite(result.rotations).all()
    assert np.isfinite(result.locations).all()
    return count


def test_ten_thousand_frames_onto_sixty_bones_take_no_more_calls_than_two_thousand() -> None:
    """90,919 for 2000 frames, 90,551 for 10,000."""
    calls(100)  # the first time more is done: what is known of a skeleton is worked out once
    assert calls(10_000) < 1.1 * calls(2_000)


def test_feet_are_held_at_the_clips_rate_whatever_that_of_the_body_is() -> None:
    still, base, source = bodies(120)
    # Slow enough for feet to stand.
    source = replace(source, rate=2.0)
    still = replace(still, rate=2.0)
    found = [
        retarget_clip(
            MappedClip(replace(base, rate=rate), LANDMARKS), still, MappedClip(source, LANDMARKS)
        )
        for rate in (2.0, 24.0)
    ]
    loose = retarget_clip(
        MappedClip(base, LANDMARKS),
        still,
        MappedClip(source, LANDMARKS),
        WholeBody(foot_lock=False),
    )
    assert np.abs(found[0].locations - loose.locations).max() > 1e-3
    np.testing.assert_array_equal(found[0].rotations, found[1].rotations)
    np.testing.assert_array_equal(found[0].locations, found[1].locations)
