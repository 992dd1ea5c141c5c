# SPDX-License-Identifier: GPL-3.0-or-later
"""The page of the first hour shows what was kept of runs in a window, and nothing else."""

from __future__ import annotations

from itertools import product

from tests.window import kept

TEXT = kept.PAGE.read_text(encoding="utf-8")


def test_the_page_shows_the_figures_that_are_kept() -> None:
    assert kept.block() in TEXT, "run make test-window ARGS=--keep"


def test_the_first_hour_is_kept_in_both_languages_at_both_sizes() -> None:
    shown = {(each["language"], each["size"]) for each in kept.runs()}
    assert shown == set(product(("en_US", "ja_JP"), ("1600x1000", "1366x768")))
    for language, size in shown:
        name = f"{language}_{size}.jpg"
        assert f"images/first_hour/{name}" in TEXT
        assert (kept.FOLDER / name).exists()


def test_every_figure_was_counted_in_every_run() -> None:
    assert kept._UNKNOWN not in kept.block()


def test_a_first_walk_takes_three_clicks_and_no_wheel() -> None:
    for each in kept.runs():
        walk = each["steps"]["first_walk"]
        assert (walk["clicks"], walk["wheel ticks"]) == (3, 0)


def test_a_changed_figure_is_found() -> None:
    changed = TEXT.replace("| 3 |", "| 2 |", 1)
    assert changed != TEXT
    assert kept.filled(changed) == TEXT
