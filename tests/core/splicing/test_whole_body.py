# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole clip onto the body that it came from."""

from dataclasses import replace

import numpy as np
import pytest

from octo_motion.core.rotations import IDENTITY, Floats
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.transfer.retarget import MappedClip
from octo_motion.core.splicing.transfer.whole_body import WholeBody, retarget_clip
from tests.core.splice_bodies import LANDMARKS, humanoid, in_another_file, motion


def creeping() -> Clip:
    """So slow that feet count as standing while they creep."""
    random = np.random.default_rng(4)
    clip = motion(random, humanoid(random), 60, strength=0.2)
    return replace(clip, rate=3.0)


def idle(clip: Clip) -> Clip:
    """Its body, doing nothing."""
    at_rest = np.broadcast_to(IDENTITY, clip.rotations.shape).copy()
    return replace(clip, rotations=at_rest, locations=np.zeros_like(clip.locations))


def places(clip: Clip) -> Floats:
    """Joints (frames, bones, 3) from where the hips begin, level, in units of the armature."""
    heads = clip.skeleton.pose(clip.rotations, clip.locations)[1]
    return heads - heads[:1, :1] * [1.0, 1.0, 0.0]


def carried(base: Clip, source: Clip, *, foot_lock: bool = True) -> Floats:
    """Where the joints of a body are that gets a clip."""
    result = retarget_clip(
        MappedClip(base, LANDMARKS),
        idle(base),
        MappedClip(source, LANDMARKS),
        WholeBody(foot_lock=foot_lock),
    )
    return places(result)


def test_a_clip_on_its_own_body_comes_out_as_it_was_its_creeping_feet_too() -> None:
    clip = creeping()
    np.testing.assert_allclose(carried(clip, clip), places(clip), atol=1e-6)


def test_a_body_of_the_same_build_and_another_size_does_as_the_clip_at_its_size() -> None:
    clip = creeping()
    # Another file: other axes, 0.3 times the size.
    small = in_another_file(np.random.default_rng(7), clip, posed_rest=False)
    for base, source, size in ((small, clip, 0.3), (clip, small, 1.0 / 0.3)):
        assert np.abs(carried(base, source) - size * places(source)).max() < 1e-5 * size


@pytest.mark.parametrize("foot_lock", [False, True])
def test_on_another_body_creeping_feet_are_held(*, foot_lock: bool) -> None:
    clip = creeping()
    base = motion(np.random.default_rng(5), humanoid(np.random.default_rng(6)), 60)
    wide = base.skeleton.rest_matrices.copy()
    for side, sign in (("L", 1.0), ("R", -1.0)):
        for name in ("thigh", "shin", "foot", "toe"):
            wide[base.skeleton.index[f"{name}.{side}"], 0, 3] += 0.05 * sign
    base = replace(base, skeleton=replace(base.skeleton, rest_matrices=wide), rate=3.0)
    loose = carried(base, clip, foot_lock=False)
    moved = np.abs(carried(base, clip, foot_lock=foot_lock) - loose).max()
    assert (moved > 1e-3) == foot_lock
