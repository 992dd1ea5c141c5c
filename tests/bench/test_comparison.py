# SPDX-License-Identifier: GPL-3.0-or-later
"""The bench compares like with like: every way meets the same targets, or there is no ratio."""

from __future__ import annotations

import copy
import json
from typing import Any

import pytest

from tests.bench import case, comparison
from tests.bench.case import Case, run
from tests.bench.pages import FIGURES

pytestmark = pytest.mark.usefixtures("add_on")


@pytest.mark.parametrize("way", comparison.WAYS)
def test_every_way_meets_the_same_targets(way: Any) -> None:
    shown = run(Case(way, comparison.CONTRACT_FRAMES)).quality
    assert shown is not None
    assert shown.largest_error < comparison.CONTRACT_ERROR


@pytest.mark.parametrize(
    ("setting", "value"), [("ground.use", True), ("steady", 0.08), ("give", 0.08)]
)
def test_a_walk_that_does_more_does_not_meet_them_and_gets_no_ratio(
    setting: str, value: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tests.bench import scene

    leave_targets = scene.set_for_comparison

    def forget_one(settings: Any) -> None:
        leave_targets(settings)
        owner = settings.ground if setting.startswith("ground.") else settings
        setattr(owner, setting.rpartition(".")[2], value)

    monkeypatch.setattr(scene, "set_for_comparison", forget_one)
    shown = run(Case("generate", comparison.CONTRACT_FRAMES)).quality
    assert shown is not None
    assert "No ratio" in comparison.refusal({"generate": shown.largest_error})


def test_where_the_time_goes_names_what_is_called_today() -> None:
    frames = 2 * comparison.CONTRACT_FRAMES
    spent = [run(Case(way, frames, look=False)).parts for way in ("default", "generate")]
    assert set(case.labels()) - set().union(*spent) == {"handles, few keys"}


def test_the_bench_stops_where_ways_do_not_meet_the_same_targets(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(comparison, "errors", lambda _gait: {"generate": 0.7, "ik": 1e-4})
    with pytest.raises(SystemExit, match=r"No ratio: .* generate by 0[.]7"):
        comparison.against_blender(comparison.Options())


def test_figures_that_allow_no_ratio_make_no_table() -> None:
    kept = json.loads(FIGURES.read_text(encoding="utf-8"))["comparison"]["figures"]
    comparison.comparison_text(kept)
    broken = copy.deepcopy(kept)
    broken["contract"]["ik"] = 0.02
    with pytest.raises(ValueError, match="No ratio"):
        comparison.comparison_text(broken)
