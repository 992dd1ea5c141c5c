# SPDX-License-Identifier: GPL-3.0-or-later
"""Scripts of posing are checked before anything moves."""

import json
from typing import Any

import pytest

from octo_motion.core.errors import SettingsError
from octo_motion.core.posing.pose_script import parse_script


def script(*steps: Any, **more: Any) -> str:
    return json.dumps({"format": "octo_motion.pose", "version": 1, "steps": list(steps), **more})


def refused(text: str) -> str:
    with pytest.raises(SettingsError) as caught:
        parse_script(text, "wave.json")
    assert caught.value.remedy.endswith(".")
    return str(caught.value)


def test_script_is_read_step_by_step() -> None:
    found = parse_script(
        script(
            {"do": "pin", "bone": "head"},
            {"do": "grab", "bone": "hand.L", "at": 1.0},
            {"do": "pull", "by": [0, 0, 0.2], "turn": [0, 90, 0], "seconds": 0.5},
            {"do": "pull", "turn": [0, 90, 0], "seconds": 0.5},
            {"do": "release"},
            {"do": "key", "bones": ["hand.L", "head"]},
            settings={"material": "WIRE"},
        ),
        "wave.json",
    )
    assert [step.do for step in found.steps] == ["pin", "grab", "pull", "pull", "release", "key"]
    assert found.steps[2].by == (0.0, 0.0, 0.2)
    assert found.steps[2].seconds == 0.5
    assert found.steps[5].bones == ("hand.L", "head")
    assert found.settings == {"material": "WIRE"}


@pytest.mark.parametrize(
    ("step", "what"),
    [
        ("grab", "Step 2 of the script does not say what to do"),
        ({"do": "jump"}, "does not say what to do, one of grab, pull"),
        ({"do": "grab"}, r"('grab') lacks 'bone'"),
        ({"do": "grab", "bone": ""}, "'bone' that makes no sense"),
        ({"do": "grab", "bone": "a", "at": 1.5}, "'at' that makes no sense"),
        ({"do": "pull", "by": [0, 0, 1]}, "lacks 'seconds'"),
        ({"do": "pull", "seconds": 1}, "says either 'by' or 'to'"),
        (
            {"do": "pull", "by": [0, 0, 1], "to": [0, 0, 1], "seconds": 1},
            "says either 'by' or 'to'",
        ),
        ({"do": "pull", "by": [0, 1], "seconds": 1}, "'by' that makes no sense"),
        ({"do": "pull", "by": [0, 1, True], "seconds": 1}, "'by' that makes no sense"),
        ({"do": "pull", "by": [0, 0, 1e300], "seconds": 1}, "'by' that makes no sense"),
        ({"do": "pull", "turn": [1e200, 0, 0], "seconds": 1}, "'turn' that makes no sense"),
        ({"do": "frame", "frame": 10**12}, "'frame' that makes no sense"),
        ({"do": "wait", "seconds": -1}, "'seconds' that makes no sense"),
        ({"do": "wait", "seconds": 1e9}, "'seconds' that makes no sense"),
        ({"do": "frame", "frame": 1.5}, "'frame' that makes no sense"),
        ({"do": "key", "bones": "some"}, "'bones' that makes no sense"),
        ({"do": "key", "bones": []}, "'bones' that makes no sense"),
        ({"do": "release", "bone": "a"}, "unknown entry 'bone'"),
    ],
)
def test_step_that_makes_no_sense_is_named(step: Any, what: str) -> None:
    said = refused(script({"do": "release"}, step))
    assert said.startswith("Step 2 of the script")
    assert what in said


def test_not_a_number_is_refused() -> None:
    assert "'by'" in refused(script({"do": "pull", "by": [0, 0, float("nan")], "seconds": 1}))


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("{", "'wave.json' is not JSON"),
        ("[" * 100_000, "'wave.json' is not JSON"),
        ("[]", "no script of posing"),
        ('{"format": "octo_motion.gait", "version": 1}', "no script of posing"),
        ('{"format": "octo_motion.pose", "version": 2}', "has format version 2"),
        ('{"format": "octo_motion.pose", "version": 1}', "no list of steps"),
        (script(title="Wave"), "an unknown entry 'title'"),
        (script(settings=[]), "odd settings"),
    ],
)
def test_file_that_is_no_script_is_refused(text: str, what: str) -> None:
    assert what in refused(text)
