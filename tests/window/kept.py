# SPDX-License-Identifier: GPL-3.0-or-later
"""What docs/first_hour.md shows: runs of the first hour that were kept, each as a sheet of its
pictures and as the figures of its report. The page's table is made from these files alone.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, Final

from tests.bench.pages import REPOSITORY, told

PAGE: Final = REPOSITORY / "docs" / "first_hour.md"
FOLDER: Final = REPOSITORY / "docs" / "images" / "first_hour"
_WIDTH: Final = 1600
"""Pixels of a sheet."""
_QUALITY: Final = 80
_ROWS: Final = (
    ("First walk: clicks", "first_walk", "clicks"),
    ("ticks of the wheel", "first_walk", "wheel ticks"),
    ("seconds that Blender takes for them", "first_walk", "seconds of Blender"),
    ("Another set-up and its motion: clicks", "setup", "clicks"),
    ("Route dragged live: drags that the octopus followed", "live_drag", "drags followed"),
    ("milliseconds of the processor for each", "live_drag", "ms of processor a move"),
    ("redraws for each", "live_drag", "redraws a drag"),
    ("redraws a second", "live_drag", "redraws a second"),
    ("Clip dropped: clicks", "drop", "clicks"),
    ("seconds until it is there", "drop", "seconds"),
)
_SPOKEN: Final = {"en_US": "English", "ja_JP": "Japanese"}
_UNKNOWN: Final = "–"
"""What stands in place of a figure that was not counted yet when a run was kept."""
_DRAWN: Final = (
    "Each drag is followed by drawing the viewport, which takes most of the time where a\n"
    "processor draws in place of a graphics card, as it did here: the milliseconds of the\n"
    "processor are Octo Motion's own work."
)
_MARKED: Final = re.compile(r"<!-- figures -->.*?<!-- end of figures -->", re.DOTALL)


def keep(folder: Path, language: str, run: dict[str, Any]) -> Path:
    """Keep a run that went well, and fill the page; gives the run's file.

    Args:
        folder: where its pictures and its report are.
        language: that Blender spoke.
        run: when and where it began.
    """
    import bpy

    sheet: Any = bpy.data.images.load(str(folder / "hour.png"))
    # Any step's will do: all are of one window.
    pictures = sorted(each for each in folder.glob("*_*.png") if each.name != "hour.png")
    one: Any = bpy.data.images.load(str(pictures[0]))
    size = "{}x{}".format(*one.size)
    width, height = sheet.size
    sheet.scale(_WIDTH, round(height * _WIDTH / width))
    name = _name({"language": language, "size": size})
    FOLDER.mkdir(parents=True, exist_ok=True)
    sheet.file_format = "JPEG"
    sheet.save(filepath=str(FOLDER / f"{name}.jpg"), quality=_QUALITY)
    steps = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    figures = {each["step"]: each["figures"] for each in steps}
    # The Blender that was seen, not the one as a module that looks on.
    run = run | json.loads((folder / "blender.json").read_text(encoding="utf-8"))
    whole = {"language": language, "size": size, "run": run, "steps": figures}
    path = FOLDER / f"{name}.json"
    path.write_text(json.dumps(whole, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    return path


def runs() -> list[dict[str, Any]]:
    """Those that are kept, in the order of their names."""
    paths = sorted(FOLDER.glob("*.json"))
    return [json.loads(path.read_text(encoding="utf-8")) for path in paths]


def block() -> str:
    """What stands between the page's marks, marks included: the table, where it was measured, and
    the sheets.
    """
    kept = runs()
    heads = [
        f"{_SPOKEN.get(each['language'], each['language'])}, {each['size'].replace('x', ' × ')}"
        for each in kept
    ]
    lines = [["", *heads], ["---"] * (len(kept) + 1)]
    for words, step, figure in _ROWS:
        lines.append([words, *(str(each["steps"][step].get(figure, _UNKNOWN)) for each in kept)])
    table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    said = "\n".join(
        f"- {head}: {told(each['run'])[:1].lower()}{told(each['run'])[1:]}"
        for head, each in zip(heads, kept, strict=True)
    )
    sheets = "\n\n".join(
        f"## {head}\n\n![The first hour, {head}](images/first_hour/{_name(each)}.jpg)"
        for head, each in zip(heads, kept, strict=True)
    )
    parts = table, said, _DRAWN, sheets
    return "\n\n".join(["<!-- figures -->", *parts, "<!-- end of figures -->"])


def _name(run: dict[str, Any]) -> str:
    """What a run's files are called."""
    return f"{run['language']}_{run['size']}"


def filled(text: str) -> str:
    """A page with what is between its marks made from the runs that are kept."""
    return _MARKED.sub(lambda _: block(), text)
