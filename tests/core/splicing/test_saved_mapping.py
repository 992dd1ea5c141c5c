# SPDX-License-Identifier: GPL-3.0-or-later
"""A saved mapping knows the skeletons of its kind, whatever else they have, and no others."""

import json
from typing import Any

import pytest

from octo_motion.core.errors import RigError
from octo_motion.core.splicing.humanoid.landmarks import LANDMARKS, Landmarks
from octo_motion.core.splicing.humanoid.saved_mapping import (
    SavedMapping,
    mapping_from_json,
    new_mapping,
    recognised,
)
from tests.core.humanoids import PARENTS

# Names from which nobody would guess.
NAMES = {each: f"n{number:02d}" for number, each in enumerate(PARENTS)}
BODY = {NAMES[each]: NAMES.get(parent, "") for each, parent in PARENTS.items()}
TABLE = Landmarks({each: NAMES[each] for each in LANDMARKS})


def with_prefix(body: dict[str, str], prefix: str) -> dict[str, str]:
    return {prefix + bone: parent and prefix + parent for bone, parent in body.items()}


def saved(name: str = "Doll", body: dict[str, str] | None = None) -> SavedMapping:
    return new_mapping(name, body or BODY, TABLE)


@pytest.mark.parametrize("prefix", ["", "Bob:", "mixamorig5", "Bip01 ", "Bob:Bob_"])
@pytest.mark.parametrize("own", ["", "Ann:", "CC_Base_"])
def test_a_skeleton_of_its_kind_is_known_behind_any_prefix(own: str, prefix: str) -> None:
    table = Landmarks({each: own + bone for each, bone in TABLE.bones.items()})
    mapping = new_mapping("Doll", with_prefix(BODY, own), table)
    found = mapping.on(with_prefix(BODY, prefix))
    assert found is not None
    assert found.bones == {each: prefix + bone for each, bone in TABLE.bones.items()}


def test_fingers_and_what_carries_the_hips_make_no_difference() -> None:
    hips, hand = TABLE["hips"], TABLE["hand.L"]
    more = {"root": "", **BODY, "finger": hand, "tip": "finger"}
    more[hips] = "root"
    assert saved().on(more) == TABLE
    assert saved(body=more).on(BODY) == TABLE


@pytest.mark.parametrize("part", ["hips", "spine", "hand.R", "toe.L"])
def test_a_skeleton_that_lacks_a_bone_or_has_it_elsewhere_is_of_another_kind(part: str) -> None:
    bone = TABLE[part]
    lacking = {each: parent for each, parent in BODY.items() if each != bone}
    assert saved().on({each: "" if up == bone else up for each, up in lacking.items()}) is None
    if part != "hips":
        assert saved().on(BODY | {"between": BODY[bone], bone: "between"}) is None


def test_of_two_that_fit_the_one_that_tells_more_counts() -> None:
    few = Landmarks({each: TABLE[each] for each in ("hips", "spine", "chest", "head")})
    both = [new_mapping("Trunk", BODY, few), saved(), new_mapping("Trunk 2", BODY, few)]
    found = recognised(both, BODY)
    assert found is not None
    assert found[0].name == "Doll"
    assert recognised(both, {"a": "", "b": "a"}) is None
    assert recognised([], BODY) is None


def test_a_file_says_all_and_keeps_what_it_does_not_know() -> None:
    text = json.loads(saved().to_json())
    text["reference_pose"] = {"from": "frame", "frame": 3}
    again = mapping_from_json(json.dumps(text), "Other name")
    assert again.name == "Other name"
    assert again.on(BODY) == TABLE
    assert json.loads(again.to_json())["reference_pose"] == {"from": "frame", "frame": 3}


DAMAGED: dict[str, tuple[Any, str]] = {
    "no JSON": ("{", "it is no JSON"),
    "a list": ([], "a file of something else"),
    "another format": ({"format": "octo_motion.gait"}, "a file of something else"),
    "a later version": ({"version": 2}, "its version is 2, not 1"),
    "no parents": ({"parents": 3}, "'parents' is no table of names"),
    "numbers": ({"landmarks": {"hips": 3}}, "'landmarks' is no table of names"),
    "nothing in it": ({"landmarks": {}}, "it has no landmarks"),
    "a bone that is nowhere": ({"landmarks": {"hips": "x"}}, "on what 'x' hangs"),
    "two roots": ({"parents": {**BODY, "a": ""}}, "carries all others"),
}


@pytest.mark.parametrize("how", DAMAGED)
def test_a_damaged_file_is_one_clear_sentence(how: str) -> None:
    spoilt, reason = DAMAGED[how]
    if isinstance(spoilt, dict):
        spoilt = json.loads(saved().to_json()) | spoilt
    text = spoilt if isinstance(spoilt, str) else json.dumps(spoilt)
    with pytest.raises(RigError, match=f"The saved mapping 'Doll' cannot be read: .*{reason}"):
        mapping_from_json(text, "Doll")


def test_a_table_that_tells_nothing_is_not_saved() -> None:
    for table, reason in (
        (Landmarks({}), "is empty"),
        (Landmarks({"hips": "gone"}), "no bone 'gone'"),
        (Landmarks({"hips": TABLE["hips"]}), "too few bones"),
    ):
        with pytest.raises(RigError, match=reason):
            new_mapping("Doll", BODY, table)
    with pytest.raises(RigError, match="several roots"):
        new_mapping("Doll", BODY | {TABLE["head"]: ""}, TABLE)
