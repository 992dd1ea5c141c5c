# SPDX-License-Identifier: GPL-3.0-or-later
"""Hairpins and loops: the body slows down, its arms take more steps and keep out of each other."""

from typing import Any

import bpy
import numpy as np
import pytest

from tests.referee import creature_measures as measures
from tests.referee.recording import moments, record
from tests.referee.scenes import Scene, build

pytestmark = pytest.mark.one_blender

HAIRPIN = np.array([[-0.6, 0.0, 0.0], [0.9, 0.0, 0.0], [0.9, 0.3, 0.0], [-0.6, 0.3, 0.0]])
U_TURN = np.array([[-0.5, 0.0, 0.0], [0.7, -0.05, 0.0], [0.7, 0.65, 0.0], [-0.5, 0.6, 0.0]])
LOOP = np.array([[-0.3, 0.0, 0.0], [1.2, 0.9, 0.0], [-1.2, 0.9, 0.0], [0.3, 0.0, 0.0]])
"""Control points, metres for an arm of 0.58."""


def figures(scene: Scene) -> dict[str, float]:
    settings = scene.armature.octo_motion.locomotion
    return {each.kind: each.value for each in settings.figures}


# Without it: 1.7, 3.2, 3.7, 4.8 and 3.1 radii, and up to 400 pairs of faces through each other. At
# their roots, where the skin folds, seven are so at most.
@pytest.mark.parametrize(
    ("setup", "way", "turn"),
    [
        ("walk", HAIRPIN, 27.0),
        ("walk", U_TURN, 27.0),
        ("walk", LOOP, 27.0),
        ("hurry", U_TURN, 40.0),
        ("hurry", HAIRPIN, 40.0),
        ("tiptoe", LOOP, 25.0),
        ("crawl", HAIRPIN, 25.0),
        ("prowl", HAIRPIN, 15.0),
    ],
)
def test_arms_keep_out_of_each_other_in_a_tight_bend(
    setup: str, way: np.ndarray, turn: float
) -> None:
    scene = build(setup, "plane", way=way)
    assert figures(scene)["OVERLAP"] <= 0.051
    played = record(scene.armature, moments(scene.start, scene.end), with_skin=False)
    assert measures.turns(played).value <= turn
    # The skin where the way bends, in its middle third.
    third = (scene.end - scene.start) // 3
    bend = record(scene.armature, moments(scene.start + third, scene.end - third)[::6])
    assert measures.skin_through_skin(bend, scene.arms, every=1).most.value <= 14.0


def test_without_it_the_body_keeps_its_pace_and_its_arms_tangle() -> None:
    scene = build(
        "hurry",
        "plane",
        way=U_TURN,
        change=lambda settings: setattr(settings, "slow_in_bends", 0.0),
    )
    assert figures(scene)["OVERLAP"] > 1.0
    assert _slowest(scene) > 0.9
    assert _slowest(build("hurry", "plane", way=U_TURN)) < 0.6


def _slowest(scene: Scene) -> float:
    """Of the body in the middle of its way, as a share of its usual speed."""
    played = record(scene.armature, moments(scene.start, scene.end), with_skin=False)
    body = played.heads[:, played.names.index("body"), :2]
    # In a whole cycle, for it surges.
    come = np.cumsum(np.linalg.norm(np.diff(body, axis=0), axis=1))
    speed = come[48:] - come[:-48]
    # Half way, where it neither gets going nor stops.
    third = len(speed) // 3
    return float(speed[third:-third].min() / speed.max())


def test_a_body_that_does_not_turn_need_not_slow_down() -> None:
    def fixed(amount: float) -> Any:
        def change(settings: Any) -> None:
            settings.heading, settings.slow_in_bends = "FIXED", amount

        return change

    ends = {build("crawl", "plane", way=LOOP, change=fixed(each)).end for each in (0.0, 1.0)}
    assert len(ends) == 1


def test_a_walk_that_holds_no_ground_has_its_pace_from_the_gait_alone() -> None:
    def change(settings: Any) -> None:
        settings.ground.use = False

    scene = build("walk", "plane", way=U_TURN, change=change)
    settings = scene.armature.octo_motion.locomotion
    settings.slow_in_bends = 0.0
    bpy.ops.octo_motion.generate_locomotion()
    assert round(settings.result.frame_range[1]) == scene.end


def test_a_change_of_gait_stays_where_it_was_put_on_the_route() -> None:
    """Behind a hairpin, whatever that takes."""
    places = []
    for amount in (0.0, 1.0):

        def change(settings: Any, amount: float = amount) -> None:
            settings.slow_in_bends = amount
            settings.change.by = "MARKERS"
            place = settings.change.places.add()
            place.gait, place.position, place.length = "swim", 0.7, 0.6

        scene = build("walk", "plane", way=HAIRPIN, change=change)
        played = record(scene.armature, moments(scene.start, scene.end), with_skin=False)
        body = played.heads[:, played.names.index("body")]
        # It rises by more than it ever does on its arms.
        first = int(np.argmax(body[:, 2] > body[: len(body) // 3, 2].max() + 0.02))
        places.append(body[first, :2])
    assert np.linalg.norm(places[1] - places[0]) < 0.03
