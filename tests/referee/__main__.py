# SPDX-License-Identifier: GPL-3.0-or-later
"""The referee's tables: what Blender plays of set-ups on grounds and rigs, of splices, of drags.

Each scene has a process of its own, so many at once as there are processors. What is worse than
tests/referee/limits.json allows is marked with a star, and makes the exit code 1. Rigs and clips of
others come from the folder of $OCTO_MOTION_DATA; without it the project's own are looked at alone.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[2]
LIMITS = Path(__file__).with_name("limits.json")
RIGS = {
    "octopus": None,
    "six-armed": "octo/octopus_cheli_sanjuan.glb",
    "eight-armed": "octo/nssm_octopus.blend",
}
OWN = REPOSITORY / "docs/examples/clips"
CLIPS = {
    "walk": OWN / "walk.bvh",
    "throw": OWN / "throw.bvh",
    "dance": OWN / "dance.bvh",
    "walk SL": "secondlife/avatar_walk.bvh",
    "throw SL": "secondlife/avatar_throw_R.bvh",
    "dance SL": "secondlife/avatar_dance1.bvh",
    "walk CMU": "cmu/12_01_walk.bvh",
    "walk daz": "cmu/02_02_walk_daz43.bvh",
    "dance 60": "animated_drawings/rokoko_jesse_dance.bvh",
}
SPLICES = (
    ("walk", "throw", "RIGHT_ARM"),
    ("walk", "dance", "TRUNK"),
    ("walk", "dance", "LEGS"),
    ("walk SL", "walk SL", "LEGS"),
    ("walk SL", "throw SL", "RIGHT_ARM"),
    ("walk SL", "walk CMU", "LEGS"),
    ("walk CMU", "throw SL", "RIGHT_ARM"),
    ("walk CMU", "dance 60", "LEFT_ARM"),
    ("walk CMU", "walk daz", "TRUNK"),
    ("walk daz", "dance 60", "LEGS"),
    ("walk daz", "dance SL", "HEAD"),
    ("dance 60", "walk SL", "TRUNK"),
)
SHORT: tuple[str, ...] = (
    "octopus/walk/plane",
    "octopus/walk/bumps",
    "octopus/idle/plane",
    "octopus/swim/plane",
    "splice/walk/throw/RIGHT_ARM",
    "puppet/CLAY",
)
"""Scenes with which one sees whether all is well; none needs what a clone lacks."""

Row = dict[str, dict[str, Any]]


def main() -> int:
    """Measure what the command line asks for, and print the tables."""
    wanted = _arguments()
    if wanted.scene:
        print("\n" + json.dumps(_found(wanted)))
        sys.stdout.flush()
        # Blender 4.5 may wait for ever at its own end.
        os._exit(0)
    names = _scenes(wanted)
    limits = json.loads(LIMITS.read_text(encoding="utf-8")) if LIMITS.exists() else {}
    with ThreadPoolExecutor(wanted.processes) as pool:
        rows = dict(zip(names, pool.map(lambda name: _process(name, wanted), names), strict=True))
    beyond = _print(rows, limits)
    if wanted.json:
        Path(wanted.json).write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    if wanted.write:
        text = json.dumps(_tightened(limits, rows), indent=1, sort_keys=True)
        LIMITS.write_text(text + "\n", encoding="utf-8")
    print(f"\n{beyond} figures are beyond their limits." if beyond else "\nAll within limits.")
    return int(beyond > 0)


def _found(wanted: argparse.Namespace) -> Row:
    """What is asked of a scene."""
    if wanted.pops_alone:
        return popping(wanted.scene)
    return measured(wanted.scene, pops=not wanted.no_pops)


def limit_of(value: float) -> float:
    """What may be from now on where this is what is: a tenth more, and two digits of it."""
    return float(f"{1.1 * value + 0.005:.2g}")


def beyond_limits(name: str, row: Row, limits: dict[str, dict[str, float]]) -> list[str]:
    """Measures of a scene that are worse than they may be; all where no number was found."""
    allowed = limits.get(name, {})
    return [
        key for key, figure in row.items() if key in allowed and not figure["value"] <= allowed[key]
    ]


def data_folder() -> Path:
    """Where rigs and clips of others are, if they are."""
    return Path(os.environ.get("OCTO_MOTION_DATA") or REPOSITORY.parent / "shared" / "data")


def measured(name: str, *, pops: bool = False) -> Row:
    """All figures of a scene, by its name in the tables."""
    import bpy

    import octo_motion

    from . import clips, creatures, puppets, scenes

    if not hasattr(bpy.types.Object, "octo_motion"):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        octo_motion.register()
    kind, *words = name.split("/")
    if kind == "splice":
        base, clip, part = words
        settings = {"with_travel": True} if part == "LEGS" else {}
        values = clips.measure(clips.spliced(_clip(base), _clip(clip), part, settings))
        return {key: {"value": value} for key, value in values.items()}
    if kind == "puppet":
        with tempfile.TemporaryDirectory() as folder:
            drag = puppets.drag(words[0], Path(folder))
        return {"back": {"value": 100.0 * drag.given_back}, "others": {"value": drag.others}}
    setup, ground = words
    rig = RIGS[kind]
    file = data_folder() / rig if rig is not None else None
    figures = creatures.measure(scenes.build(setup, ground, file))
    if pops:
        figures["pop"] = creatures.continuity(setup, ground, file)
    return {key: asdict(figures[key]) for key in creatures.UNITS if key in figures}


def popping(name: str) -> Row:
    """Whether a creature's scene pops, by its name in the tables."""
    import bpy

    import octo_motion

    from . import creatures

    if not hasattr(bpy.types.Object, "octo_motion"):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        octo_motion.register()
    kind, setup, ground = name.split("/")
    rig = RIGS[kind]
    file = data_folder() / rig if rig is not None else None
    return {"pop": asdict(creatures.continuity(setup, ground, file))}


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="make referee ARGS=…", description=__doc__)
    parser.add_argument("only", nargs="*", help="scenes that have these words, as 'walk/stairs'")
    parser.add_argument("--short", action="store_true", help="a few scenes that need no data")
    parser.add_argument("--json", metavar="FILE", help="keep all figures, with frame and bone")
    parser.add_argument("--write", action="store_true", help="keep what is better as the new limit")
    parser.add_argument("--no-pops", action="store_true", help="without other frame rates: quicker")
    parser.add_argument("--pops-alone", action="store_true", help="other frame rates and no more")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--scene", help=argparse.SUPPRESS)
    return parser.parse_args()


def _clip(name: str) -> Path:
    # A path that is absolute stays what it is.
    return data_folder() / CLIPS[name]


def _scenes(wanted: argparse.Namespace) -> list[str]:
    from .puppets import MATERIALS
    from .scenes import GROUNDS, SETUPS

    rigs = [rig for rig, file in RIGS.items() if file is None or (data_folder() / file).exists()]
    names = [f"{rig}/{setup}/{ground}" for rig in rigs for setup in SETUPS for ground in GROUNDS]
    there = [each for each in SPLICES if all(_clip(clip).exists() for clip in each[:2])]
    names += ["splice/" + "/".join(each) for each in there]
    names += [f"puppet/{material}" for material in MATERIALS]
    if len(rigs) < len(RIGS) or len(there) < len(SPLICES):
        print("Rigs and clips of others are not here; $OCTO_MOTION_DATA names their folder.")
    if wanted.short:
        names = list(SHORT)
    if wanted.pops_alone:
        names = [name for name in names if name.split("/")[0] in RIGS]
    if wanted.only:
        names = [name for name in names if any(word in name for word in wanted.only)]
    return names


def _process(name: str, wanted: argparse.Namespace) -> Row:
    command = [sys.executable, "-m", "tests.referee", "--scene", name]
    command += ["--no-pops"] * wanted.no_pops + ["--pops-alone"] * wanted.pops_alone
    done = subprocess.run(
        command, cwd=REPOSITORY, capture_output=True, encoding="utf-8", check=False
    )
    print(".", end="", file=sys.stderr, flush=True)
    if done.returncode:
        print(f"{name}: {done.stderr.strip().splitlines()[-1:]}", file=sys.stderr)
        return {}
    return json.loads(done.stdout.splitlines()[-1])


def _print(rows: dict[str, Row], limits: dict[str, dict[str, float]]) -> int:
    from . import clips, creatures, puppets

    count = 0
    tables = {"splice": clips.UNITS, "puppet": puppets.UNITS}
    for kind in ("", *tables):
        units = tables.get(kind, creatures.UNITS)
        chosen = {
            name: row
            for name, row in rows.items()
            if (name.split("/")[0] == kind) or (not kind and name.split("/")[0] not in tables)
        }
        if not chosen:
            continue
        print("\n" + f"{'':36}" + "".join(f"{key:>10}" for key in units))
        for name, row in chosen.items():
            beyond = beyond_limits(name, row, limits)
            count += len(beyond) + (not row)
            cells = [f"{row[key]['value']:9.2f}" if key in row else f"{'–':>9}" for key in units]
            marks = ["*" if key in beyond else " " for key in units]
            told = "".join(cell + mark for cell, mark in zip(cells, marks, strict=True))
            print(f"{name:36}{told}" if row else f"{name:36} could not be made")
        print()
        for key, unit in units.items():
            print(f"{key:>8}: {unit}")
    return count


def _tightened(
    limits: dict[str, dict[str, float]], rows: dict[str, Row]
) -> dict[str, dict[str, float]]:
    """Limits never rise by themselves: what got worse is to be mended, or raised by hand."""
    found = {name: dict(kept) for name, kept in limits.items()}
    for name, row in rows.items():
        if not row:
            continue
        kept = found.setdefault(name, {})
        for key, figure in row.items():
            limit = limit_of(max(figure["value"], 0.0))
            kept[key] = min(kept.get(key, float("inf")), limit)
    return found


if __name__ == "__main__":
    sys.exit(main())
