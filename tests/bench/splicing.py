# SPDX-License-Identifier: GPL-3.0-or-later
"""How good splices are: ours, both ways to reach, against copying the part's curves bone by bone.

Every clip is spliced onto every base, part by part. Without a folder, on the clips of the
examples; with folders, on all BVH files in them. The table has a row for each part, over pairs of
clips on the same skeleton and on different ones.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, TextIO

import bpy
import numpy as np

from octo_motion.blender.animation.clips import read_clip
from octo_motion.blender.scene.imports import import_clip
from octo_motion.command_line.shot_schema import frame_rate
from octo_motion.core.errors import OctoMotionError
from octo_motion.core.rotations import Floats
from octo_motion.core.splicing.clip.bvh_check import check_bvh
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.clip.splice_timing import Timing, splice_window
from octo_motion.core.splicing.humanoid.landmarks import Landmarks
from octo_motion.core.splicing.humanoid.mapping import map_skeleton
from octo_motion.core.splicing.transfer.parts import LEG, PARTS, part_bones
from octo_motion.core.splicing.transfer.splice import Splice
from tests.bench.plain_copy import plain_copy
from tests.bench.splice_joints import degrees_off
from tests.bench.splice_quality import (
    feet_at_rest,
    foot_slip,
    limb_length,
    seams,
)
from tests.core.splice_bodies import spliced

LEGS = PARTS["legs"]

EXAMPLES: Final = Path(__file__).resolve().parents[2] / "docs" / "examples" / "clips"
PARTS_TOLD: Final = ("right_arm", "left_arm", "legs", "trunk", "head")
METHODS: Final = ("copied", "direction", "exact")

_EASE: Final = 0.25
"""Seconds that a splice takes to come and to go."""
_LEG: Final = 0.82
"""Length of the legs of a body of 1.7 m; slip is told as on such a body."""
_SHORTEST: Final = 1.0
"""Seconds below which a clip is left out: seams would be most of it."""


@dataclass(frozen=True, eq=False)
class Take:
    """A clip that was read."""

    name: str
    clip: Clip
    landmarks: Landmarks


@dataclass(frozen=True)
class Measured:
    """One part of one clip on one base, by one way."""

    base: str
    splice: str
    part: str
    method: str
    same_skeleton: bool
    off: list[float]
    """Degrees by which the part points elsewhere than in its clip, frame by frame."""
    lean: list[float]
    """Degrees by which the body leans otherwise than it should, likewise."""
    roughness: list[float]
    """Log dimensionless jerk of the rougher source less the result's, for each seam."""
    slip: list[float]
    """Millimetres for each frame of a foot that should stand, on a body of 1.7 m."""


def main(words: Sequence[str]) -> None:
    """Measure what the command line asks for, and print a table."""
    arguments = _arguments(words)
    with quiet_blender() as told:
        takes, left_out, results = _spliced(
            arguments.folders or [EXAMPLES], arguments.base, arguments.clips
        )
        if arguments.each:
            _print_each(results, told)
        print(text(_summary(takes, left_out, results)), file=told)
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        content = [asdict(each) for each in results]
        arguments.json.write_text(json.dumps(content) + "\n", encoding="utf-8")


def summary(folders: Sequence[Path], bases: Sequence[str]) -> dict[str, Any]:
    """What all clips of some folders come to on those bases whose names have one of these words."""
    with quiet_blender():
        return _summary(*_spliced(folders, bases, ()))


@contextmanager
def quiet_blender() -> Iterator[TextIO]:
    """Blender tells of everything that it imports; what is printed to this is seen all the same."""
    sys.stdout.flush()
    shown = os.dup(1)
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    try:
        with os.fdopen(os.dup(shown), "w") as told:
            yield told
    finally:
        os.dup2(shown, 1)
        os.close(shown)
        os.close(silence)


def _spliced(
    folders: Sequence[Path], bases: Sequence[str], words: Sequence[str]
) -> tuple[list[Take], list[str], list[Measured]]:
    files = sorted({path for folder in folders for path in _files(folder, words)})
    takes, left_out = _takes(files)
    pairs = _pairs(takes, bases)
    return takes, left_out, [each for base, other in pairs for each in measure(base, other)]


def _arguments(words: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.bench splicing", description=__doc__)
    parser.add_argument("folders", type=Path, nargs="*", help="where BVH files are")
    parser.add_argument(
        "--base", nargs="+", default=["walk"], help="words in the names of bases; default: walk"
    )
    parser.add_argument(
        "--clips", nargs="+", default=[], help="words in the names of clips; default: all files"
    )
    parser.add_argument("--each", action="store_true", help="a row for every splice as well")
    parser.add_argument("--json", type=Path, help="file to write all numbers to")
    return parser.parse_args(words)


def _files(folder: Path, words: Sequence[str]) -> list[Path]:
    found = [folder] if folder.is_file() else folder.rglob("*.bvh")
    return [path for path in found if not words or _named(path.stem, words)]


def _named(name: str, words: Sequence[str]) -> bool:
    return any(word.lower() in name.lower() for word in words)


def _takes(files: Sequence[Path]) -> tuple[list[Take], list[str]]:
    takes: list[Take] = []
    left_out: list[str] = []
    for path in files:
        try:
            take = read_take(path)
        except OctoMotionError as error:
            left_out.append(f"{path.name}: {error.problem}")
            continue
        if (len(take.clip) - 1) / take.clip.rate < _SHORTEST and "walk" not in take.name:
            left_out.append(f"{path.name}: It is shorter than {_SHORTEST:g} s.")
            continue
        takes.append(take)
    return takes, left_out


def read_take(path: Path) -> Take:
    """A file at its own frame rate."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene = bpy.context.scene
    assert scene is not None
    rate = check_bvh(path.read_bytes()).rate
    scene.render.fps, scene.render.fps_base = frame_rate(float(np.clip(rate, 1.0, 32767.0)))
    imported = import_clip(path, bpy.context)
    clip = read_clip(bpy.data.objects[imported.armatures[0]])
    found = map_skeleton(clip.skeleton)
    if found.problem:
        raise OctoMotionError(found.problem)
    for part in PARTS_TOLD:
        part_bones(PARTS[part], clip.skeleton, found.landmarks)
    return Take(path.stem, clip, found.landmarks)


def _pairs(takes: Sequence[Take], words: Sequence[str]) -> list[tuple[Take, Take]]:
    bases = [take for take in takes if _named(take.name, words)]
    return [(base, other) for base in bases for other in takes if other is not base]


# --- Measuring -----------------------------------------------------------------------------------


def measure(base: Take, other: Take) -> list[Measured]:
    """All parts of a clip on a base, by all ways."""
    seconds = (len(other.clip) - 1) / other.clip.rate
    whole = lengthened(base.clip, seconds + 4.0 * _EASE)
    rate = whole.rate
    # Between the ends of the base, so that there are two seams.
    lasting = min(seconds * rate, whole.frames[-1] - whole.frames[0] - 4.0 * _EASE * rate)
    timing = Timing(
        base_start=float(whole.frames[0]) + 2.0 * _EASE * rate,
        splice_start=float(other.clip.frames[0]),
        length=lasting,
        ease_in=_EASE * rate,
        ease_out=_EASE * rate,
    )
    ways: dict[str, Callable[[Splice], Clip]] = {
        "copied": lambda splice: plain_copy(whole, base.landmarks, splice),
        "direction": lambda splice: spliced(whole, base.landmarks, splice),
        "exact": lambda splice: spliced(whole, base.landmarks, replace(splice, goal="exact")),
    }
    same = base.clip.skeleton.names == other.clip.skeleton.names and np.allclose(
        base.clip.skeleton.heads, other.clip.skeleton.heads, atol=1e-5
    )
    found: list[Measured] = []
    for name in PARTS_TOLD:
        part = PARTS[name]
        splice = Splice(part, other.clip, timing, other.landmarks, travel=part == LEGS)
        for method, make in ways.items():
            result = make(splice)
            off, lean = degrees_off(result, whole, base.landmarks, splice)
            jerks = seams(result, whole, base.landmarks, splice)
            found.append(
                Measured(
                    *(base.name, other.name, name, method, bool(same)),
                    off=off.ravel().tolist(),
                    lean=lean.tolist(),
                    roughness=[seam.roughness for seam in jerks],
                    slip=_slip(result, whole, base.landmarks, splice).tolist(),
                )
            )
    return found


def _slip(result: Clip, base: Clip, landmarks: Landmarks, splice: Splice) -> Floats:
    """Millimetres per stance frame of the feet, on a body of 1.7 m."""
    leg = result.scale * limb_length(result.skeleton, landmarks, LEG.limb_on("L"))
    if splice.part == LEGS:
        assert splice.landmarks is not None
        span = splice_window(splice.timing, base, splice.clip)
        whole = span.weights >= 1.0
        still = feet_at_rest(splice.clip, splice.landmarks, span.splice_frames[whole])
        chosen = np.arange(len(base))[span.frames][whole]
    else:
        still = feet_at_rest(base, landmarks)
        chosen = np.arange(len(base))
    shown = replace(
        result,
        frames=result.frames[chosen],
        rotations=result.rotations[chosen],
        locations=result.locations[chosen],
        world=result.world[chosen],
    )
    return 1000.0 * _LEG / leg * foot_slip(shown, landmarks, still)


def lengthened(clip: Clip, seconds: float) -> Clip:
    """A walk that goes on for at least so long: cycle after cycle, each from where the last led."""
    count = round(seconds * clip.rate) + 1
    if count <= len(clip):
        return clip
    numbers = np.arange(count)
    order, rounds = numbers % (len(clip) - 1), numbers // (len(clip) - 1)
    travel = clip.locations[-1] - clip.locations[0]
    # Up and down, and at bones within, cycles repeat.
    travel = np.where(np.array(clip.skeleton.parents)[:, None] < 0, travel, 0.0)
    return replace(
        clip,
        frames=clip.frames[0] + numbers,
        rotations=clip.rotations[order],
        locations=clip.locations[order] + rounds[:, None, None] * travel,
        world=clip.world[order],
    )


# --- Telling -------------------------------------------------------------------------------------

_HEAD: Final = f"{'':>25} {'pairs':>5} │" + "│".join(f"{name:^45}" for name in METHODS) + "│"
_COLUMNS: Final = f"{'off °':>8}{'99 %':>7}{'lean':>6}{'seam':>7}{'slip mm':>9}{'99 %':>6}  "

_LEGEND: Final = (
    "off: degrees by which shoulder → hand (seen from the chest), thigh → foot (seen as the",
    "  pelvis faces), hips → neck (likewise) or neck → head (seen from the chest) point elsewhere",
    "  than in the clip, from joint positions alone: median, and what 99 of 100 frames stay below",
    "lean: degrees by which hips → neck leans otherwise than it should: 99 of 100 frames",
    "seam: by how much a hand or foot is less smooth where the splice comes and goes than in",
    "  the rougher clip (natural logarithm of the dimensionless jerk; median of all seams, 0 or",
    "  less is as smooth)",
    "slip: millimetres per frame that feet slide which stand in their own clip, on a body of",
    "  1.7 m: median, and what 99 of 100 frames stay below",
)


def _summary(
    takes: Sequence[Take], left_out: Sequence[str], results: Sequence[Measured]
) -> dict[str, Any]:
    rows = []
    for same, title in ((True, "same skeleton"), (False, "other skeleton")):
        for part in PARTS_TOLD:
            chosen = [each for each in results if (each.part, each.same_skeleton) == (part, same)]
            if chosen:
                rows.append({"title": f"{title}, {part}"} | _row(chosen))
    exact = [each for each in results if each.method == "exact"]
    return {
        "blender": bpy.app.version_string,
        "clips": len(takes),
        "pairs": len({(each.base, each.splice) for each in results}),
        "splices": len(exact),
        "rows": rows,
        "left_out": list(left_out),
    }


def _row(results: Sequence[Measured]) -> dict[str, Any]:
    """Figures by method; none where nothing was measured."""
    row: dict[str, Any] = {"pairs": len({(each.base, each.splice) for each in results})}
    for method in METHODS:
        chosen = [each for each in results if each.method == method]
        off = [value for each in chosen for value in each.off]
        lean = [value for each in chosen for value in each.lean]
        jerks = [value for each in chosen for value in each.roughness]
        slips = [value for each in chosen for value in each.slip]
        row[method] = {
            "median": _quantile(off, 50),
            "most": _quantile(off, 99),
            "lean": _quantile(lean, 99),
            "seam": _quantile(jerks, 50),
            "slip": _quantile(slips, 50),
            "slip_most": _quantile(slips, 99),
        }
    return row


def _quantile(values: Sequence[float], share: int) -> float | None:
    return float(np.percentile(values, share)) if values else None


def text(found: Any) -> str:
    """The table of a summary."""
    lines = [
        f"{found['clips']} clips, {found['pairs']} pairs, {found['splices']} splices by each way",
        "",
        _HEAD,
        f"{'':>25} {'':>5} │" + "│".join([_COLUMNS] * len(METHODS)) + "│",
        *(_line(row["title"], row) for row in found["rows"]),
        "",
        *_LEGEND,
        *(f"Left out: {reason}" for reason in found["left_out"]),
    ]
    return "\n".join(lines)


def said(found: Any) -> list[str]:
    """What the table shows of both kinds of pairs, in words."""
    rows = {row["title"]: row for row in found["rows"]}
    legs, lines = rows.get("same skeleton, legs"), []
    if legs:
        lines.append(
            "Between clips on one skeleton copied feet slide by "
            f"{legs['copied']['slip']:.1f} mm a frame where they should stand, spliced ones with "
            f"their travel by {legs['exact']['slip']:.1f} mm."
        )
    for method in METHODS:
        told = [
            f"{part.replace('_', ' ')} {rows[title][method]['median']:.1f}°"
            for part in PARTS_TOLD
            if (title := f"other skeleton, {part}") in rows
        ]
        if told:
            lines.append(f"Between skeletons *{method}* points elsewhere by {', '.join(told)}.")
    return lines


def _print_each(results: Sequence[Measured], told: TextIO) -> None:
    groups: dict[tuple[str, str], list[Measured]] = {}
    for each in results:
        groups.setdefault((each.base, each.splice), []).append(each)
    for (base, splice), chosen in groups.items():
        print(f"{splice} on {base}", file=told)
        for part in PARTS_TOLD:
            print(_line(part, _row([each for each in chosen if each.part == part])), file=told)
    print(file=told)


def _line(title: str, row: Any) -> str:
    cells = []
    for method in METHODS:
        own = row[method]
        cells.append(
            f"{own['median']:>8.1f}{own['most']:>7.1f}{own['lean']:>6.1f}{_cell(own['seam'], 7, 2)}"
            f"{_cell(own['slip'], 9, 1)}{_cell(own['slip_most'], 6, 0)}  "
        )
    return f"{title:>25} {row['pairs']:>5} │" + "│".join(cells) + "│"


def _cell(value: float | None, width: int, digits: int) -> str:
    return f"{'–':>{width}}" if value is None else f"{value:>{width}.{digits}f}"
