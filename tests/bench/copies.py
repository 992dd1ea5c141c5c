# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever files differ in, splices are the same: how far those from and onto copies are off.

Of each clip copies are made that play as it does: with other rest poses, bone axes, units, rotation
modes and frames, elsewhere, and through other file formats. All pairs are spliced, from and onto
each copy, by the buttons that an artist has; what differs is told from evaluated bones alone.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from itertools import permutations
from pathlib import Path
from typing import Final

import bpy

import octo_motion
from tests.bench.splicing import quiet_blender
from tests.referee.changed_copies import CHANGES
from tests.referee.copies import STACKS, Off, keep, sweep

CLIPS: Final = (
    "secondlife/avatar_walk.bvh",
    "secondlife/avatar_throw_R.bvh",
    "cmu/12_01_walk.bvh",
    "cmu/02_02_walk_daz43.bvh",
    "cmu/111_28_renamed_mixamorig.bvh",
    "animated_drawings/rokoko_jesse_dance.bvh",
    "makehuman/walk1.bvh",
    "rigs_with_actions/KayKit_Knight.glb#Walking_A",
    "rigs_with_actions/RobotExpressive.glb#Walking",
)
"""Of the folder of $OCTO_MOTION_DATA; an action behind #."""


def main(words: Sequence[str]) -> None:
    """Measure what the command line asks for, and print a table."""
    arguments = _arguments(words)
    with quiet_blender() as told, tempfile.TemporaryDirectory() as folder:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        octo_motion.register()
        people = {}
        for name in arguments.clips:
            file, _, action = name.partition("#")
            path = Path(os.environ["OCTO_MOTION_DATA"]) / file
            people[name] = keep(path, Path(folder), arguments.changes, action)
        pairs = list(permutations(people, 2))
        found: list[Off] = []
        for off in sweep(people, pairs, arguments.changes, arguments.stacks):
            found.append(off)
            if off.problem or off.landmarks or off.joints > arguments.beyond:
                print(_row(off), file=told, flush=True)
        print(text(found), file=told)
        told.flush()
    # Blender 4.5 may wait for ever at its own end.
    sys.stdout.flush()
    os._exit(0)


def text(found: Sequence[Off]) -> str:
    """A row for each way in which copies differ."""
    lines = [f"{'':20}{'splices':>9}{'joints':>10}{'fading':>10}{'turned °':>10}{'refused':>9}"]
    for change in dict.fromkeys(each.change for each in found):
        rows = [each for each in found if each.change == change]
        made = [each for each in rows if not each.problem]
        most = [max((getattr(e, key) for e in made), default=0.0) for key in _TOLD]
        cells = f"{len(rows):9}{most[0]:10.5f}{most[1]:10.5f}{most[2]:10.1f}"
        lines.append(f"{change:20}{cells}{len(rows) - len(made):9}")
    lines += [
        "",
        "joints: heights of the body by which a joint is off at most, where splices are fully in",
        "fading: the same where they come or go, too",
        "turned: degrees by which a bone is turned otherwise at most",
    ]
    return "\n".join(lines)


_TOLD: Final = ("joints", "fading", "turn")


def _row(off: Off) -> str:
    what = f"{off.base} <- {off.clip}, {off.stack}, {off.change} of {off.whose}"
    told = f"{off.joints:.5f} at {off.joint}, {off.turn:.1f}° at {off.turned}"
    return f"{what}: {off.problem or told} {'; '.join(off.landmarks)}"


def _arguments(words: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.bench copies", description=__doc__)
    parser.add_argument("--clips", nargs="+", default=CLIPS, help="default: one of each kind")
    parser.add_argument("--changes", nargs="+", default=list(CHANGES), choices=list(CHANGES))
    parser.add_argument("--stacks", nargs="+", default=list(STACKS), choices=list(STACKS))
    parser.add_argument("--beyond", type=float, default=1e-3, help="name what is farther off")
    return parser.parse_args(words)
