# SPDX-License-Identifier: GPL-3.0-or-later
"""The documentation's figures: measured, kept as JSON beside this, and written into the pages.

A page has a pair of marks for each of them. What is between is made from the JSON alone, tables and
sentences: nobody copies a number.
"""

from __future__ import annotations

import datetime as dt
import importlib
import json
import os
import platform
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from tests.bench import (
    apart,
    comparison,
    device_loop,
    live_speed,
    posing,
    reaching,
    splice_speed,
)
from tests.bench.comparison import Options

REPOSITORY: Final = Path(__file__).resolve().parents[2]
FIGURES: Final = Path(__file__).with_name("figures.json")
PAGES: Final = ("speed.md", "quality.md", "apart.md", "device.md")
_TORN_STEPS: Final = 1000
_RECORDED: Final = ("secondlife", "cmu", "animated_drawings")
_RECORDED_BASES: Final = ("avatar_walk", "12_01_walk", "02_02_walk")
_KILLS: Final = 5
_INPUTS: Final = 1_000_000
_DIGITS: Final = 6
"""Of a number in the JSON."""


@dataclass(frozen=True)
class Section:
    """One table, and what it shows."""

    measure: Callable[[Options], Any]
    """Gives what JSON can keep, or none where it cannot be measured here."""
    text: Callable[[Any], str]
    said: Callable[[Any], list[str]] = lambda _: []
    """Paragraphs."""


def _splicing() -> Any:
    # It imports bpy, and everything else here does not need it.
    return importlib.import_module("tests.bench.splicing")


def _recorded(_options: Options) -> Any:
    data = os.environ.get("OCTO_MOTION_DATA", "")
    folders = [Path(data) / name for name in _RECORDED]
    if not data or not all(folder.is_dir() for folder in folders):
        return None
    return _splicing().summary(folders, _RECORDED_BASES)


def _pairs() -> Any:
    return importlib.import_module("tests.bench.splice_pairs")


def _all_pairs(_options: Options) -> Any:
    data = os.environ.get("OCTO_MOTION_DATA", "")
    if not data or not all((Path(data) / name).is_dir() for name in _pairs().FOLDERS):
        return None
    return _pairs().summary(Path(data))


def _splicing_text(found: Any) -> str:
    return _splicing().text(found)


def _splicing_said(found: Any) -> list[str]:
    return _splicing().said(found)


SECTIONS: Final[dict[str, Section]] = {
    "comparison": Section(
        comparison.against_blender, comparison.comparison_text, comparison.comparison_said
    ),
    "default": Section(comparison.as_it_comes, comparison.default_text, comparison.default_said),
    "frames": Section(comparison.by_frames, comparison.frames_text),
    "few": Section(comparison.with_few_keys, comparison.few_text),
    "arms": Section(comparison.by_arms, comparison.arms_text),
    "splices": Section(lambda options: splice_speed.measure(options.repeat), splice_speed.text),
    "live": Section(lambda _: live_speed.measure(), live_speed.text),
    "posing": Section(lambda _: posing.measure(), posing.text, posing.said),
    "torn": Section(lambda _: posing.measure("--random", str(_TORN_STEPS)), posing.text_torn),
    "examples": Section(
        lambda _: _splicing().summary([_splicing().EXAMPLES], ["walk"]),
        _splicing_text,
        _splicing_said,
    ),
    "recorded": Section(_recorded, _splicing_text, _splicing_said),
    "pairs": Section(
        _all_pairs,
        lambda found: _pairs().summary_text(found),
        lambda found: _pairs().summary_said(found),
    ),
    "device": Section(lambda _: asdict(device_loop.measure(10.0)), device_loop.text),
    "floods": Section(lambda _: device_loop.flooded(5.0), device_loop.text_flooded),
    "kills": Section(lambda _: device_loop.killed(_KILLS), device_loop.text_killed),
    "fuzz": Section(lambda _: device_loop.fuzzed(_INPUTS), device_loop.text_fuzzed),
    "reaching": Section(lambda _: reaching.beside(), reaching.text, reaching.said),
    "apart": Section(lambda _: apart.measure(), apart.text, apart.said),
    "apart_turn": Section(
        lambda _: apart.measure(("walk", "hurry", "prowl", "crawl", "settle"), "turn", 3),
        apart.text,
        apart.said,
    ),
}


def write(names: Iterable[str], options: Options) -> None:
    """Measure some sections, or all, keep the figures and write them into the pages."""
    kept = read()
    where = machine()
    for name in names or SECTIONS:
        print(f"Measuring: {name}", file=sys.stderr, flush=True)
        start = time.perf_counter()
        found = SECTIONS[name].measure(options)
        if found is None:
            print(f"Left as it was, for its data are not here: {name}", file=sys.stderr)
            continue
        run = where | {"took": round(time.perf_counter() - start)}
        print(f"It took {run['took']} s.", file=sys.stderr, flush=True)
        kept[name] = {"run": run, "figures": rounded(found)}
        # At once: what was measured is not lost where a later section fails.
        FIGURES.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    write_pages()


def write_pages() -> None:
    """Write the figures that are kept into the pages."""
    kept = read()
    for name in PAGES:
        page = REPOSITORY / "docs" / name
        page.write_text(filled(page.read_text(encoding="utf-8"), kept), encoding="utf-8")


def read() -> dict[str, Any]:
    """All figures that are kept, by section."""
    return json.loads(FIGURES.read_text(encoding="utf-8")) if FIGURES.exists() else {}


def block(name: str, kept: dict[str, Any]) -> str:
    """What stands between the marks of a section, marks included."""
    section, own = SECTIONS[name], kept[name]
    table = "\n".join(line.rstrip() for line in section.text(own["figures"]).splitlines())
    paragraphs = [told(own["run"]), f"```text\n{table}\n```", *section.said(own["figures"])]
    return "\n\n".join([f"<!-- figures: {name} -->", *paragraphs, "<!-- end of figures -->"])


def filled(text: str, kept: dict[str, Any]) -> str:
    """A page with everything between its marks made from the figures that are kept."""
    return _MARKED.sub(
        lambda found: block(found["name"], kept) if found["name"] in kept else found[0], text
    )


def marked(text: str) -> Iterator[tuple[str, str]]:
    """Name and text of everything that is made from figures in a page."""
    return ((found["name"], found[0]) for found in _MARKED.finditer(text))


def unmarked(text: str) -> str:
    """What of a page is not made from figures."""
    return _MARKED.sub("", text)


_MARKED: Final = re.compile(r"<!-- figures: (?P<name>\w+) -->.*?<!-- end of figures -->", re.DOTALL)


def told(run: dict[str, Any]) -> str:
    """When and where figures were measured."""
    load = run["load"]
    others = (
        "other programs running"
        if load is None or load > _QUIET
        else "no other programs of note running"
    )
    if load is not None:
        others += f" (load {load:.1f} when it began)"
    return (
        f"Measured on {run['date']} at commit {run['commit']}: {run['blender']}, Python "
        f"{run['python']}, {run['system']}, {run['processors']} processors, {others}."
    )


_QUIET: Final = 0.5
"""Programs that want a processor on the mean of a minute."""


def machine() -> dict[str, Any]:
    """When and where figures are measured."""
    import bpy

    return {
        "date": dt.datetime.now(tz=dt.UTC).date().isoformat(),
        "commit": _commit(),
        "blender": f"Blender {bpy.app.version_string}",
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "processors": os.cpu_count(),
        # Before anything is measured: how much else the machine does.
        "load": round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None,
    }


def _commit() -> str:
    """Of the repository, marked where something was changed that has an effect on figures."""

    def git(*words: str) -> str:
        asked = subprocess.run(
            ["git", "-C", str(REPOSITORY), *words],
            capture_output=True,
            encoding="utf-8",
            check=False,
        )
        return asked.stdout.strip() if asked.returncode == 0 else ""

    changed = git(
        "status", "--porcelain", "--untracked-files=no", "octo_motion", "tests/bench/*.py"
    )
    return (git("rev-parse", "--short=10", "HEAD") or "unknown") + " with changes" * bool(changed)


def rounded(value: Any) -> Any:
    """The same with fewer digits: the rest is noise."""
    if isinstance(value, float):
        return float(f"{value:.{_DIGITS}g}")
    if isinstance(value, dict):
        return {key: rounded(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(each) for each in value]
    return value
