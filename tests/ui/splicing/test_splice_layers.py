# SPDX-License-Identifier: GPL-3.0-or-later
"""Splices as a layer of the NLA, over the base."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.actions import is_edited
from tests.ui.splicing.test_kept_curves import (
    ARM,
    apart,
    channelbag,
    curves,
    played,
    sparse_hero,
    told,
)
from tests.ui.splicing.test_splicing import OPERATORS, hero_and_source, stack_of

MOMENTS = np.arange(0.0, 42.01, 0.5)


def tracks(armature: Any) -> list[tuple[str, list[Any]]]:
    data = armature.animation_data
    return [(track.name, [strip.action for strip in track.strips]) for track in data.nla_tracks]


@pytest.mark.parametrize("blending", ["REPLACE", "ADD"])
def test_a_layer_plays_as_the_action_does_and_has_the_part_alone(blending: str) -> None:
    hero, base = sparse_hero()
    stack = stack_of(hero)
    stack.splices[0].blending, stack.splices[0].weight = blending, 0.7
    OPERATORS.splice_add(part="HEAD", source="Source")
    stack.splices[1].base_start, stack.splices[1].length = 20.0, 15.0
    OPERATORS.splice_build()
    as_action = played(hero, MOMENTS)
    before = {place: told(each) for place, each in curves(base).items()}
    stack.result_as = "LAYER"
    OPERATORS.splice_build()
    layer = stack.result
    assert apart(as_action, played(hero, MOMENTS)) < 2e-5
    assert hero.animation_data.action is None
    assert [used for _, used in tracks(hero)] == [[base], [layer]]
    bones = {curve.data_path.split('"')[1] for curve in channelbag(layer).fcurves}
    assert bones == ARM | {"neck", "head"}
    keyed = [key.co.x for curve in channelbag(layer).fcurves for key in curve.keyframe_points]
    assert (min(keyed), max(keyed)) == (10.0, 35.0)
    (strip,) = hero.animation_data.nla_tracks[-1].strips
    assert (strip.frame_start, strip.frame_end) == (10.0, 35.0)
    assert (strip.blend_type, strip.extrapolation) == ("REPLACE", "NOTHING")
    assert {place: told(each) for place, each in curves(base).items()} == before


def test_built_again_a_layer_is_made_anew_in_place_with_what_was_set_of_its_strip() -> None:
    hero, base = sparse_hero()
    stack = stack_of(hero)
    stack.result_as = "LAYER"
    OPERATORS.splice_build()
    layer = stack.result
    (strip,) = hero.animation_data.nla_tracks[-1].strips
    strip.blend_in = 2.0
    stack.splices[0].base_start = 14.0
    assert not is_edited(layer)
    OPERATORS.splice_build()
    assert stack.result == layer
    assert [used for _, used in tracks(hero)] == [[base], [layer]]
    (strip,) = hero.animation_data.nla_tracks[-1].strips
    assert (strip.frame_start, strip.frame_end, strip.blend_in) == (14.0, 30.0, 2.0)


def test_without_the_layer_the_base_is_played_as_before() -> None:
    hero, _ = sparse_hero()
    before = played(hero, np.arange(1.0, 41.01, 0.5))
    stack_of(hero).result_as = "LAYER"
    OPERATORS.splice_build()
    assert apart(before, played(hero, np.arange(1.0, 41.01, 0.5))) > 0.01
    hero.animation_data.nla_tracks.remove(hero.animation_data.nla_tracks[-1])
    assert apart(before, played(hero, np.arange(1.0, 41.01, 0.5))) < 1e-6
    # Built again it is there once more, on the track of the base that there is.
    OPERATORS.splice_build()
    assert len(hero.animation_data.nla_tracks) == 2


def test_a_layer_becomes_an_action_again_and_its_tracks_go() -> None:
    hero, base = sparse_hero()
    stack = stack_of(hero)
    OPERATORS.splice_build()
    wanted = played(hero, MOMENTS)
    result = stack.result
    stack.result_as = "LAYER"
    OPERATORS.splice_build()
    assert stack.result == result
    stack.result_as = "ACTION"
    OPERATORS.splice_build()
    assert tracks(hero) == []
    assert hero.animation_data.action == stack.result == result
    assert set(curves(result)) == set(curves(base))
    assert apart(wanted, played(hero, MOMENTS)) < 1e-6


def test_an_edited_layer_is_kept() -> None:
    hero, _ = sparse_hero()
    stack = stack_of(hero)
    stack.result_as = "LAYER"
    OPERATORS.splice_build()
    first = stack.result
    channelbag(first).fcurves[0].keyframe_points[3].co.y += 0.3
    before = {place: told(each) for place, each in curves(first).items()}
    OPERATORS.splice_build()
    assert stack.result != first
    assert {place: told(each) for place, each in curves(first).items()} == before


@pytest.mark.parametrize(
    ("setting", "message"), [("nla", "is switched off"), ("visual", "a base has its NLA in it")]
)
def test_a_layer_that_would_not_be_seen_is_told_and_nothing_changes(
    setting: str, message: str
) -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    stack = stack_of(hero)
    stack.result_as = "LAYER"
    if setting == "nla":
        hero.animation_data.use_nla = False
    else:
        stack.visual = True
    actions = set(bpy.data.actions.keys())
    with pytest.raises(RuntimeError, match=message):
        OPERATORS.splice_build()
    assert tracks(hero) == []
    assert set(bpy.data.actions.keys()) == actions
    assert stack.result is None
