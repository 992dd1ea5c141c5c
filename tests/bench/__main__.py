# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed, precision and memory: our generate against what Blender has itself, and much more.

Without a first word: the same rig meets the same targets over the same frames by ours, by inverse
kinematics and bake and by spline IK and bake, with bare bones and with the skin; then the default
walk with everything on, ours by frames and by arms, live motion, and splices. Ours is timed from
the operator's call to the action on the armature, travel included; Blender's is the bake alone.
Each measurement has a process of its own.

A first word measures one thing: "splicing" the quality of splices, "copies" how little they hang
on rest poses, units and file formats, "live" how fast a walk follows a change, "apart" how far arms
pass through each other, "keys" how many keys *Few* leaves of each gait, "device" how well the loop
at the devices keeps time, "posing" how long a step of the plastic puppet takes, "follow" how long
follow-through takes, "reaching" how an arm reaches beside one that PyElastica simulates. Their own
--help tells more.

--write measures all that docs/speed.md, docs/quality.md and docs/apart.md show, or the sections
that are named after it, keeps it in tests/bench/figures.json and writes it into the pages. Recorded
clips come from the folder of $OCTO_MOTION_DATA; without it their figures stay as they are.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from pathlib import Path
from typing import Any, Final

from tests.bench import pages
from tests.bench.comparison import Options

_APART: Final = {
    "splicing": "splicing",
    "copies": "copies",
    "pairs": "splice_pairs",
    "posing": "posing",
    "apart": "apart",
    "keys": "few_keys",
    "device": "device_loop",
    "follow": "follow_through",
    "reaching": "reaching",
}
"""First words, and the modules that they run."""
_SHORT: Final = ("comparison",)
_USUAL: Final = ("comparison", "default", "frames", "few", "arms", "live", "splices")


def main() -> None:
    """Measure what the command line asks for, print tables, and write JSON or pages if wanted."""
    first = sys.argv[1] if len(sys.argv) > 1 else ""
    if first in _APART:
        importlib.import_module(f"tests.bench.{_APART[first]}").main(sys.argv[2:])
        return
    arguments = _arguments(["--only", "live"] if first == "live" else sys.argv[1:])
    options = Options(
        *(arguments.frames, arguments.long, arguments.arms, arguments.gait, arguments.repeat)
    )
    if arguments.pages:
        pages.write_pages()
        return
    if arguments.write is not None:
        pages.write(arguments.write, options)
        return
    report: dict[str, Any] = {}
    for name in arguments.only or (_SHORT if arguments.short else _USUAL):
        section = pages.SECTIONS[name]
        found = section.measure(options)
        report[name] = found
        print("\n\n".join([section.text(found), *section.said(found)]), end="\n\n", flush=True)
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
        print(f"All numbers are in {arguments.json}.")


def _arguments(words: list[str]) -> argparse.Namespace:
    usual = Options()
    parser = argparse.ArgumentParser(
        prog="python -m tests.bench",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--frames", type=int, nargs="+", default=usual.frames, help="how many, all ways"
    )
    parser.add_argument(
        "--long", type=int, nargs="+", default=usual.long, help="frames of ours alone"
    )
    parser.add_argument(
        "--arms", type=int, nargs="+", default=usual.arms, help="how many, ours alone"
    )
    parser.add_argument("--gait", default=usual.gait, help="name of the gait")
    parser.add_argument(
        "--repeat", type=int, default=usual.repeat, help="runs of each, of which the fastest counts"
    )
    parser.add_argument("--short", action="store_true", help="the comparison alone")
    parser.add_argument("--json", type=Path, help="file to write all numbers to")
    parser.add_argument("--only", nargs="+", help=f"these alone: {', '.join(pages.SECTIONS)}")
    parser.add_argument("--write", nargs="*", help="write the pages: all sections, or these")
    parser.add_argument(
        "--pages", action="store_true", help="write the pages from the figures that are kept"
    )
    arguments = parser.parse_args(words)
    for name in (*(arguments.write or ()), *(arguments.only or ())):
        if name not in pages.SECTIONS:
            parser.error(f"there is no section {name}, but {', '.join(pages.SECTIONS)}")
    return arguments


if __name__ == "__main__":
    main()
