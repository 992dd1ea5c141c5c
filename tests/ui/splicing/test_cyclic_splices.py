# SPDX-License-Identifier: GPL-3.0-or-later
"""A walk cycle with splices stays a cycle, as Blender plays it, before and after its range too."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.actions import MARK, curves_of
from octo_motion.blender.animation.clips import read_clip
from tests.referee.clips import imported
from tests.referee.recording import Floats, moments, record
from tests.ui.splicing.test_splicing import (
    OPERATORS,
    give_motion,
    make_humanoid,
    select,
    stack_of,
)

# Blender's importer leaves the file open.
pytestmark = pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")

LAST = 51
"""The motion of these bodies repeats every 25 frames."""


def cyclic_body(how: str) -> tuple[Any, Any, Any]:
    """Base that repeats, source, and the splice of an arm."""
    source, hero = make_humanoid("Source"), make_humanoid("Hero")
    give_motion(source, 1, 41)
    action = give_motion(hero, 2, LAST)
    if how == "modifiers":
        action.use_frame_range = action.use_cyclic = False
        for curve in curves_of(action):
            curve.modifiers.new("CYCLES")
    else:
        action.use_frame_range = action.use_cyclic = True
        action.frame_start, action.frame_end = 1, LAST
    select(source, hero)
    OPERATORS.splice_add(part="RIGHT_ARM")
    return hero, source, stack_of(hero).splices[0]


def joints(armature: Any, frames: Floats) -> Floats:
    return record(armature, frames, with_skin=False).tails.astype(np.float64)


def kinks(positions: Floats) -> Floats:
    """(frames,) how much each frame's bones change their speed, at most."""
    return np.linalg.norm(np.diff(positions, 2, axis=0), axis=-1).max(axis=1)


@pytest.mark.parametrize("how", ["modifiers", "range"])
@pytest.mark.parametrize(
    ("start", "after"), [(10.0, "STOP"), (35.0, "STOP"), (35.0, "HOLD"), (20.0, "LOOP")]
)
def test_the_result_of_a_cyclic_base_is_cyclic(how: str, start: float, after: str):
    hero, _, item = cyclic_body(how)
    item.base_start, item.after = start, after
    OPERATORS.splice_build()
    result = hero.animation_data.action
    assert result != stack_of(hero).base
    assert result.use_cyclic
    assert tuple(result.frame_range) == (1.0, float(LAST))
    for curve in curves_of(result):
        if curve.data_path.startswith("pose"):
            assert [each.type for each in curve.modifiers] == ["CYCLES"]
    # It plays on: the second round is the first, half frames included.
    one = joints(hero, moments(1, LAST, 2))
    two = joints(hero, moments(LAST, 2 * LAST - 1, 2))
    assert np.abs(one - two).max() < 2e-3
    found = kinks(joints(hero, moments(1, 2 * LAST - 1)))
    at_seam, elsewhere = found[LAST - 2], np.delete(found[: LAST - 1], LAST - 2).max()
    assert at_seam <= 1.2 * elsewhere


def test_a_throw_at_the_end_of_a_cycle_goes_on_at_its_start():
    hero, _, item = cyclic_body("range")
    before = joints(hero, moments(1, LAST))
    item.base_start, item.after, item.ease_in, item.ease_out = 35.0, "STOP", 4.0, 4.0
    OPERATORS.splice_build()
    changed = np.abs(joints(hero, moments(1, LAST)) - before).max(axis=(1, 2)) > 1e-4
    # 40 frames from frame 35 on: up to the last, and up to frame 25 of the next round.
    assert changed[36:].all()
    assert changed[:22].all()
    assert not changed[25:34].any()


def test_it_is_written_anew_in_place_and_can_be_spliced_again():
    hero, _, item = cyclic_body("modifiers")
    item.base_start = 35.0
    OPERATORS.splice_build()
    first = hero.animation_data.action
    OPERATORS.splice_build()
    assert hero.animation_data.action == first
    assert MARK in first
    stack_of(hero).base = first
    OPERATORS.splice_build()
    assert hero.animation_data.action != first
    assert hero.animation_data.action.use_cyclic


def test_the_result_of_a_base_that_is_no_cycle_is_none():
    source, hero = make_humanoid("Source"), make_humanoid("Hero")
    give_motion(source, 1, 41)
    give_motion(hero, 2, 40)
    select(source, hero)
    OPERATORS.splice_add(part="RIGHT_ARM")
    OPERATORS.splice_build()
    assert not hero.animation_data.action.use_cyclic
    assert bpy.context.scene is not None


@pytest.mark.parametrize("after", ["STOP", "HOLD", "LOOP"])
def test_an_arm_of_another_on_a_walk_cycle_ends_where_it_begins(shared_data: Any, after: str):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    walk, throw = (
        imported(shared_data(f"secondlife/avatar_{name}.bvh")) for name in ("walk", "throw_R")
    )
    action = walk.animation_data.action
    action.use_frame_range = action.use_cyclic = True
    action.frame_start, action.frame_end = 1, 14
    select(throw, walk)
    OPERATORS.splice_add(part="RIGHT_ARM")
    item = stack_of(walk).splices[0]
    item.base_start, item.splice_start, item.after = 9.0, 6.0, after
    OPERATORS.splice_build()
    assert walk.animation_data.action.use_cyclic
    played = record(walk, np.array([1.0, 14.0]), with_skin=False)
    chest, *arm = (played.names.index(each) for each in ("chest", "rShldr", "rForeArm", "rHand"))
    seen = np.einsum("mji,mbjk->mbik", played.turns[:, chest], played.turns[:, arm])
    assert np.abs(seen[0] - seen[1]).max() < 2e-2


def test_legs_that_turn_the_body_are_told_to_break_the_cycle():
    hero, _, item = cyclic_body("range")
    item.part, item.with_travel, item.after, item.base_start = "LEGS", True, "HOLD", 10.0
    OPERATORS.splice_build()
    ends = read_clip(hero).rotations[[0, -1]]
    closes = bool(np.abs(np.abs(np.sum(ends[0] * ends[1], axis=-1)) - 1.0).max() < 1e-4)
    assert hero.animation_data.action.use_cyclic == closes
