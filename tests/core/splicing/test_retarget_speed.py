# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole clips are carried over as fast as one waits for it."""

import time
from dataclasses import replace

import numpy as np

from octo_motion.core.skeleton import Skeleton
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.transfer.retarget import MappedClip
from octo_motion.core.splicing.transfer.whole_body import retarget_clip
from tests.core.rigs import skeleton_of
from tests.core.splice_bodies import LANDMARKS, humanoid, motion

FRAMES = 10_000
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


def test_ten_thousand_frames_onto_sixty_bones_take_less_than_three_seconds() -> None:
    random = np.random.default_rng(1)
    source = motion(random, with_fingers(humanoid(random)), FRAMES)
    body = with_fingers(humanoid(random, same_proportions=False))
    rest = np.zeros((FRAMES, BONES, 4))
    rest[..., 0] = 1.0
    still = Clip(
        "still",
        body,
        source.frames,
        source.rate,
        rest,
        np.zeros((FRAMES, BONES, 3)),
        np.broadcast_to(np.eye(4), (FRAMES, 4, 4)).copy(),
    )
    base = replace(still.taken([0]), name="base")
    begun = time.process_time()
    result = retarget_clip(MappedClip(base, LANDMARKS), still, MappedClip(source, LANDMARKS))
    assert time.process_time() - begun < 3.0
    assert np.isfinite(result.rotations).all()
    assert np.isfinite(result.locations).all()
