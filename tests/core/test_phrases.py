# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts that know what was filled into them."""

import json
import pickle

import pytest

from octo_motion.core.errors import OctoMotionError, RigError
from octo_motion.core.phrases import Phrase, as_phrase, joined_phrases, phrase, told

GERMAN = {
    "'{arm}' is {far:.1f} m away.": "{far:.2f} m weit weg ist '{arm}'.",
    "Move {what}.": "Bewege {what}.",
    "the arm": "den Arm",
    "Select an armature.": "Wähle ein Skelett.",
    "Step {number}: {error}": "Schritt {number}: {error}",
}


def german(text: str) -> str:
    return GERMAN.get(text, text)


def test_a_phrase_is_its_english_text_and_can_be_said_otherwise() -> None:
    away = phrase("'{arm}' is {far:.1f} m away.", arm="Arm {1}", far=2.25)
    assert away == "'Arm {1}' is 2.2 m away."
    assert told(away, german) == "2.25 m weit weg ist 'Arm {1}'."


def test_names_are_left_alone_and_phrases_within_are_translated() -> None:
    assert told(phrase("Move {what}.", what="the arm"), german) == "Bewege the arm."
    assert told(phrase("Move {what}.", what=phrase("the arm")), german) == "Bewege den Arm."


def test_what_an_error_says_is_translated_wherever_it_is_told() -> None:
    error = RigError(phrase("Move {what}.", what=as_phrase("the arm")), "Select an armature.")
    assert str(error) == "Move the arm. Select an armature."
    assert (error.problem, error.remedy) == ("Move the arm.", "Select an armature.")
    assert told(error, german) == "Bewege den Arm. Wähle ein Skelett."
    step = phrase("Step {number}: {error}", number=3, error=error)
    assert told(step, german) == "Schritt 3: Bewege den Arm. Wähle ein Skelett."
    other = phrase("Step {number}: {error}", number=4, error=ValueError("nothing"))
    assert told(other, german) == "Schritt 4: nothing"


def test_a_part_of_something_longer_loses_its_full_stop_in_every_language() -> None:
    moved = phrase("Move {what}.", what=phrase("the arm"))
    assert moved.open_ended() == "Move the arm"
    assert told(moved.open_ended(), german) == "Bewege den Arm"
    assert told(as_phrase("the arm").capitalised(), german) == "Den Arm"


def test_phrases_in_a_row_leave_out_what_is_empty() -> None:
    row = joined_phrases("; ", ("Select an armature.", "", phrase("the arm")))
    assert row == "Select an armature.; the arm"
    assert told(row, german) == "Wähle ein Skelett.; den Arm"


@pytest.mark.parametrize("cut", [Phrase.open_ended, Phrase.capitalised, lambda same: same])
def test_a_phrase_goes_from_process_to_process(cut: object) -> None:
    assert callable(cut)
    sent = cut(phrase("Move {what}.", what=phrase("the arm")))
    came = pickle.loads(pickle.dumps(sent))  # noqa: S301 - our own
    assert came == sent
    assert told(came, german) == told(sent, german)
    assert json.loads(json.dumps([sent])) == [str(sent)]


def test_an_error_holds_on_to_what_it_says_alone() -> None:
    kept = phrase("Step {number}: {error}", number=1, error=OctoMotionError("Wrong."))
    assert not any(isinstance(each, Exception) for each in kept.values.values())
