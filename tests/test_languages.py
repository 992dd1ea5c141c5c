# SPDX-License-Identifier: GPL-3.0-or-later
"""Every language says what English says, and says all of it."""

from __future__ import annotations

import ast
from typing import Any, cast

import bpy
import pytest

from octo_motion.ui import language
from octo_motion.ui.panel_base import lines_of
from tests import texts

pytestmark = [
    pytest.mark.usefixtures("add_on"),
    pytest.mark.one_blender,
]
LANGUAGES = sorted(language.languages())
COMPLETE = ["ja_JP"]
"""Languages that lack nothing."""


def test_japanese_is_among_the_languages() -> None:
    assert set(COMPLETE) <= set(LANGUAGES)


@pytest.mark.parametrize("name", LANGUAGES)
def test_a_translation_fills_in_what_its_text_fills_in(name: str) -> None:
    pairs = [pair for said in texts.catalogue(name).values() for pair in said.items()]
    wrong = [
        english
        for english, said in pairs
        if not said or texts.placeholders(english) != texts.placeholders(said)
    ]
    assert wrong == []


@pytest.mark.parametrize("name", LANGUAGES)
def test_blender_finds_a_text_wherever_it_looks_for_it(name: str) -> None:
    found = language.blender_texts({"*": {"Splice": "a", "Move": "b"}, "Operator": {"Move": "c"}})
    assert found == {
        ("*", "Splice"): "a",
        ("Operator", "Splice"): "a",
        ("Octo Motion", "Splice"): "a",
        ("*", "Move"): "b",
        ("Operator", "Move"): "c",
        ("Octo Motion", "Move"): "b",
    }
    known = language.blender_texts(texts.catalogue(name))
    assert {context for context, _ in known} == {"*", "Operator", "Octo Motion"}


def test_texts_that_are_registered_drawn_and_reported_are_all_found() -> None:
    found = texts.all_texts()
    assert found > {
        "Detect Arms",  # an operator's label
        "Which of the suggestions to take, 1 is the best",  # a property's tooltip
        "Swim",  # a choice
        "Splice",  # a panel
        "Save as Preset…",  # a button's own words
        "'{armature}' has no route.",  # an error
        "Select an armature.",  # what to do about it
        "Marked {bones}.",  # a report
        "key touched",  # a key in the status bar
        "left upper arm",  # a part of a sentence
        "Jet Escape",  # a set-up
    }


def formatted(node: ast.AST) -> bool:
    """Whether it is text with something filled in before anybody could look it up."""
    return isinstance(node, ast.JoinedStr) and any(
        isinstance(part, ast.Constant) and texts.WORD.search(str(part.value))
        for part in node.values
    )


def arguments(node: ast.Call) -> list[ast.expr]:
    """Those of a call that people read."""
    name = texts.name_of(node.func)
    if name in texts.errors():
        return [*node.args, *(each.value for each in node.keywords)]
    if name == "report" and len(node.args) == 2:
        return node.args[1:]
    if name in texts.LOOKED_UP:
        return node.args[:1]
    return [each.value for each in node.keywords if each.arg in {"text", "title"}]


def test_what_is_filled_in_is_left_to_phrases() -> None:
    """An f-string is a finished text that no catalogue knows: ``phrase("… {name}", name=…)``."""
    wrong = [
        f"{path.relative_to(texts.PACKAGE)}:{node.lineno}"
        for path, tree in texts.sources().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and any(map(formatted, arguments(node)))
    ]
    assert wrong == []


def test_a_phrase_has_a_value_for_each_placeholder() -> None:
    wrong = []
    for path, tree in texts.sources().items():
        for node in ast.walk(tree):
            if not (isinstance(node, ast.Call) and texts.name_of(node.func) == "phrase"):
                continue
            given = {each.arg for each in node.keywords}
            for text in texts.constants(node.args[0]):
                wanted = {each.partition("!")[0] for each in texts.placeholders(text)}
                if given and None not in given and wanted - given:
                    wrong.append(f"{path.relative_to(texts.PACKAGE)}:{node.lineno}")
    assert wrong == []


def test_what_comes_out_is_in_the_language_of_blender(monkeypatch: pytest.MonkeyPatch) -> None:
    known = language.blender_texts(texts.catalogue("ja_JP"))

    class Translations:
        @staticmethod
        def look_up(text: str, context: str) -> str:
            return known.get((context, text), text)

        pgettext_iface = pgettext_rpt = pgettext_tip = look_up

    monkeypatch.setattr(language, "bpy", type("Bpy", (), {"app": type("App", (), {})})())
    language.bpy.app.translations = Translations
    bpy.ops.mesh.primitive_cube_add()
    said: list[str] = []

    class Told:
        def report(self, _kind: Any, text: str) -> None:
            said.append(text)

    from octo_motion.ui.locomotion.operators.adding import OCTO_MOTION_OT_add_route
    from octo_motion.ui.operator_base import OctoOperator

    class Refusing(Told, OctoOperator):
        def run(self, context: bpy.types.Context) -> None:
            from octo_motion.blender.rig import armature_data

            armature_data(cast("Any", context.object))

    assert Refusing().execute(bpy.context) == {"CANCELLED"}
    name = cast("Any", bpy.context.object).name
    assert said == [f"「{name}」はアーマチュアではありません。アーマチュアを選択してください。"]
    assert OCTO_MOTION_OT_add_route.bl_label == "Octopus Route"  # Blender looks that up itself


def test_japanese_lines_fit_the_sidebar_and_begin_with_no_full_stop() -> None:
    text = "腕が見つかりません: チェーンになるボーンが 3 本ありません。検出し直してください。"
    for room in range(10, 60):
        lines = lines_of(text, room)
        assert "".join(lines).replace(" ", "") == text.replace(" ", "")
        assert not any(line[0] in "。、ー」）ょっゃ" for line in lines)
        assert all(2 * len(line) <= 2 * room + 4 for line in lines)
    assert lines_of("No arms were found: detect again.", 12) == [
        "No arms were",
        "found:",
        "detect",
        "again.",
    ]


@pytest.mark.parametrize("name", LANGUAGES)
def test_no_translation_is_of_a_text_that_nobody_says_any_more(name: str) -> None:
    known = set().union(*texts.catalogue(name).values())
    assert sorted(known - texts.all_texts() - texts.without_words()) == []


@pytest.mark.parametrize("name", COMPLETE)
def test_nothing_is_left_to_translate(name: str) -> None:
    """``python -m tests.texts ja_JP`` prints what is."""
    known = {english for _, english in language.blender_texts(texts.catalogue(name))}
    assert sorted(texts.all_texts() - known) == []
