# SPDX-License-Identifier: GPL-3.0-or-later
"""No figure in a page that no command makes: pages show what tests/bench/figures.json has."""

from __future__ import annotations

import re

import pytest

from tests.bench import pages

TEXTS = {
    name: (pages.REPOSITORY / "docs" / name).read_text(encoding="utf-8") for name in pages.PAGES
}
MEASURED = re.compile(
    r"\d[\d,]*\.\d|\d\s?(?:%|°|×|ms\b|µs\b|s\b|MB\b|mm\b|J\b)"
    r"|\b(?:times as|(?:half|thirds?|fifths?|tenths?|twentieth) of)\b"
)
"""What a figure looks like that somebody has measured: with a point, or with a unit."""


@pytest.mark.parametrize("page", pages.PAGES)
def test_a_page_shows_the_figures_that_are_kept(page: str) -> None:
    kept = pages.read()
    for name, shown in pages.marked(TEXTS[page]):
        assert shown == pages.block(name, kept), f"run make bench ARGS='--write {name}'"


def test_every_section_has_its_place_in_one_page() -> None:
    shown = [name for text in TEXTS.values() for name, _ in pages.marked(text)]
    assert sorted(shown) == sorted(pages.SECTIONS)
    assert set(pages.read()) == set(pages.SECTIONS)


@pytest.mark.parametrize("page", pages.PAGES)
def test_what_people_write_in_a_page_has_no_measured_figures(page: str) -> None:
    text = pages.unmarked(TEXTS[page])
    # What devices must do and how packets are made are no measurements.
    text = text[text.find("\n## Measured") :] if page == "device.md" else text
    words = re.sub(r"```.*?```|`[^`\n]*`", "", text, flags=re.DOTALL)
    assert [each[0] for each in MEASURED.finditer(words)] == []


def test_a_changed_figure_in_a_page_is_found() -> None:
    name, shown = next(iter(pages.marked(TEXTS["speed.md"])))
    changed = re.sub(r"\d\.\d\d", "0.01", shown)
    assert changed != pages.block(name, pages.read())
    assert pages.filled(changed, pages.read()) == shown


def test_each_section_says_when_where_and_from_what_it_was_measured() -> None:
    for own in pages.read().values():
        assert set(own["run"]) >= {"date", "commit", "blender", "processors", "load"}
        assert own["run"]["commit"] != "unknown"
