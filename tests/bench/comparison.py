# SPDX-License-Identifier: GPL-3.0-or-later
"""Ours against what Blender has itself: the same rig, the same targets, the same frames.

Before any ratio both sides have to show, at a few frames, that they meet the same targets.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from octo_motion.core.processes import PROCESSES
from tests.bench.case import Case, Measured, Way, fastest, measure

WAYS: Final[dict[Way, str]] = {
    "generate": "ours",
    "ik": "inverse kinematics and bake",
    "spline": "spline IK and bake",
}
_OTHERS: Final = ("ik", "spline")
CONTRACT_FRAMES: Final = 50
CONTRACT_ERROR: Final = 1e-3
"""Arm lengths that any way may miss a target by at so many frames."""
_REPEATED: Final = 2000
"""Frames beyond which a case is run once: other programs' moods even out within it."""


@dataclass(frozen=True)
class Options:
    """What the command line asks for."""

    frames: Sequence[int] = (250, 1000, 4000)
    """Of all ways, and of ours as it comes."""
    long: Sequence[int] = (10_000, 20_000)
    """Of ours alone."""
    arms: Sequence[int] = (1, 2, 4, 8, 16, 32)
    gait: str = "walk"
    repeat: int = 2


def errors(gait: str) -> dict[str, float]:
    """The largest miss of each way at a few frames, in arm lengths."""
    return {
        way: measure(Case(way, CONTRACT_FRAMES, gait=gait))["quality"]["largest_error"]
        for way in WAYS
    }


def refusal(found: Mapping[str, float]) -> str:
    """Why these largest misses by way allow no ratio, empty if they do."""
    missing = [f"{way} by {miss:.2g}" for way, miss in found.items() if miss > CONTRACT_ERROR]
    if not missing:
        return ""
    return (
        f"No ratio: at {CONTRACT_FRAMES} frames all ways have to meet the same targets within "
        f"{CONTRACT_ERROR:g} arm lengths, but these miss: {', '.join(missing)}."
    )


def against_blender(options: Options) -> Measured:
    """All ways with bare bones and with the skin.

    Raises:
        SystemExit: they do not meet the same targets.
    """
    met = errors(options.gait)
    if reason := refusal(met):
        sys.exit(reason)
    rows = []
    for skin in (False, True):
        for frames in options.frames:
            row = {"rig": "skin" if skin else "bare", "frames": frames}
            rows.append(row | _by_turns(options, frames, skin=skin))
    return {"gait": options.gait, "contract": met, "rows": rows}


def _by_turns(options: Options, frames: int, *, skin: bool) -> dict[str, Measured]:
    """The fastest run of each way, run by turns: what else the machine does meets all."""
    best: dict[str, Measured] = {}
    for number in range(_runs(options, frames)):
        for way in WAYS:
            found = measure(Case(way, frames, skin, gait=options.gait, look=number == 0))
            found["quality"] = found["quality"] or best[way]["quality"]
            if number == 0 or found["seconds"] < best[way]["seconds"]:
                best[way] = found
    return best


def _runs(options: Options, frames: int) -> int:
    return options.repeat if frames <= _REPEATED else 1


def by_frames(options: Options) -> list[Measured]:
    """Ours alone with bare bones, from short to long."""
    return [
        fastest(Case("generate", frames, gait=options.gait, look=False), _runs(options, frames))
        for frames in sorted({*options.frames, *options.long})
    ]


def by_arms(options: Options) -> list[Measured]:
    """Ours alone with bare bones, from few arms to many."""
    return [
        {"arms": arms}
        | fastest(Case("generate", 1000, arms=arms, gait=options.gait, look=False), options.repeat)
        for arms in options.arms
    ]


def as_it_comes(options: Options) -> Measured:
    """What an artist gets: the default octopus and all settings, beside ours with targets alone."""
    rows = []
    for frames, arms in [
        *((frames, 8) for frames in options.frames),
        *((1000, arms) for arms in options.arms if arms >= _FEWEST and arms != 8),
    ]:
        runs = _runs(options, frames)
        own = fastest(Case("default", frames, arms=arms, gait=options.gait, look=False), runs)
        plain = Case("generate", own["frames"], skin=True, arms=arms, gait=options.gait, look=False)
        rows.append({"arms": arms, "default": own, "plain": fastest(plain, runs)})
    return {"gait": options.gait, "rows": rows}


def with_few_keys(options: Options) -> list[Measured]:
    """The same with few keys, from short to long, by one process and by as many as there may be."""
    rows = []
    for frames in sorted({*options.frames, *options.long}):
        case = Case("default", frames, gait=options.gait, look=False, few=True)
        alone = fastest(case, _runs(options, frames), {PROCESSES: "1"})
        rows.append({"alone": alone, "shared": fastest(case, _runs(options, frames))})
    return rows


_FEWEST: Final = 4
"""Arms of a walk that holds a ground."""


# --- Telling --------------------------------------------------------------------------------------


def comparison_text(found: Any) -> str:
    """The table of all ways.

    Raises:
        ValueError: the figures allow no ratio.
    """
    if reason := refusal(found["contract"]):
        raise ValueError(reason)
    columns = f"{'seconds':>8}{'error':>9}{'°/frame':>8}{'MB':>6} "
    lines = [
        f"{'':>12} │" + "│".join(f"{title:^32}" for title in WAYS.values()) + "│ ours is faster",
        f"{'rig':>5}{'frames':>7} │" + f"{columns}│" * len(WAYS) + " than IK  spline IK",
    ]
    for row in found["rows"]:
        cells = "".join(f"{_cells(row[way])}│" for way in WAYS)
        ratios = "".join(
            f"{_ratio(row, way):>{width}.1f}×" for way, width in zip(_OTHERS, (8, 10), strict=True)
        )
        lines.append(f"{row['rig']:>5}{row['frames']:>7} │{cells}{ratios}")
    held = ", ".join(f"{WAYS[way]} {found['contract'][way]:.1e}" for way in WAYS)
    return "\n".join(
        [
            *lines,
            "",
            "error: largest distance of a group's end from its target, in arm lengths",
            "°/frame: most that a bone turns within one frame",
            "MB: peak of the process, Blender itself included",
            f"at {CONTRACT_FRAMES} frames, which has to be below {CONTRACT_ERROR:g}: {held}",
        ]
    )


def _cells(result: Measured) -> str:
    quality = result["quality"]
    return (
        f"{result['seconds']:>8.2f}{quality['largest_error']:>9.1e}"
        f"{quality['largest_turn']:>8.1f}{result['megabytes']:>6.0f} "
    )


def _ratio(row: Measured, way: str) -> float:
    return row[way]["seconds"] / row["generate"]["seconds"]


def comparison_said(found: Any) -> list[str]:
    """What the table shows, in words."""
    said = []
    middle = found["rows"][len(found["rows"]) // 4]["frames"]
    for row in found["rows"]:
        if row["frames"] != middle:
            continue
        rig = "the default octopus" if row["rig"] == "skin" else "the bare bones"
        said.append(
            f"At {middle} frames generating takes {row['generate']['seconds']:.2f} s for {rig}; "
            f"inverse kinematics and bake takes {_ratio(row, 'ik'):.1f} times as long, spline IK "
            f"and bake {_ratio(row, 'spline'):.1f} times, by the processor's time "
            + " and ".join(
                f"{row[way]['cpu_seconds'] / row['generate']['cpu_seconds']:.1f}" for way in _OTHERS
            )
            + " times."
        )
    worst = {
        way: [
            max(row[way]["quality"][kind] for row in found["rows"])
            for kind in ("largest_error", "largest_turn")
        ]
        for way in WAYS
    }
    said.append(
        "Of all these runs the largest miss is "
        + ", ".join(f"{worst[way][0]:.1e} arm lengths ({WAYS[way]})" for way in WAYS)
        + "; bones turn by up to "
        + ", ".join(f"{worst[way][1]:.0f}°" for way in WAYS)
        + " within a frame, in the same order."
    )
    return said


def frames_text(found: Any) -> str:
    """Ours by frames, and where the time of the longest goes."""
    lines = ["Ours by frames", f"{'frames':>8} {'seconds':>9} {'ms/frame':>9} {'peak MB':>9}"]
    lines += [
        f"{each['frames']:>8} {each['seconds']:>9.2f} "
        f"{1000.0 * each['seconds'] / each['frames']:>9.2f} {each['megabytes']:>9.0f}"
        for each in found
    ]
    return "\n".join([*lines, "", *parts_lines(found[-1])])


def parts_lines(run: Measured) -> list[str]:
    """Where the time of a run goes, most first; what takes a thousandth of it is left out."""
    whole = run["seconds"]
    return [
        f"Where the time of {run['frames']} frames goes",
        *(
            f"{label:>32} {seconds:>7.2f} s {100.0 * seconds / whole:>5.1f} %"
            for label, seconds in sorted(run["parts"].items(), key=lambda item: -item[1])
            if seconds > 1e-3 * whole
        ),
    ]


def few_text(found: Any) -> str:
    """Few keys by frames, and where the time of the longest goes."""
    lines = [
        "The default walk with few keys",
        f"{'':>8} {'one process':>21}   {'one for each processor':>22}",
        f"{'frames':>8} {'seconds':>10} {'ms/frame':>10}   {'seconds':>10} {'processors’':>11}",
    ]
    for row in found:
        alone, shared = row["alone"], row["shared"]
        lines.append(
            f"{alone['frames']:>8} {alone['seconds']:>10.2f} "
            f"{1000.0 * alone['seconds'] / alone['frames']:>10.2f}   "
            f"{shared['seconds']:>10.2f} {shared['cpu_seconds']:>11.2f}"
        )
    note = "processors’: seconds that all processes had of all processors"
    return "\n".join([*lines, "", note, "", *parts_lines(found[-1]["shared"])])


def arms_text(found: Any) -> str:
    """Ours by arms."""
    lines = [
        "Ours by arms, 1000 frames",
        f"{'arms':>8} {'seconds':>9} {'ms/arm':>9} {'peak MB':>9}",
    ]
    lines += [
        f"{each['arms']:>8} {each['seconds']:>9.2f} "
        f"{1000.0 * each['seconds'] / each['arms']:>9.1f} {each['megabytes']:>9.0f}"
        for each in found
    ]
    return "\n".join(lines)


def default_text(found: Any) -> str:
    """What an artist gets, by frames and by arms, and where the time of the middle run goes."""
    lines = [
        "The default walk, everything on",
        (
            f"{'arms':>5} {'frames':>7} {'seconds':>9} {'ms/frame':>9} {'ms/arm':>9} {'peak MB':>9}"
            f" {'targets alone':>14} {'ratio':>7}"
        ),
    ]
    for row in found["rows"]:
        own, plain = row["default"], row["plain"]["seconds"]
        ratio = own["seconds"] / plain
        each = [1000.0 * own["seconds"] / count for count in (own["frames"], row["arms"])]
        lines.append(
            f"{row['arms']:>5} {own['frames']:>7} {own['seconds']:>9.2f} {each[0]:>9.2f}"
            f" {each[1]:>9.1f} {own['megabytes']:>9.0f} {plain:>14.2f} {ratio:>7.1f}"
        )
    note = (
        "targets alone: seconds of the same rig and frames without ground, keeping apart, smoothing"
    )
    return "\n".join([*lines, "", note, "", *parts_lines(found["rows"][1]["default"])])


def default_said(found: Any) -> list[str]:
    """What the table shows, in words."""
    longest = max(found["rows"], key=lambda row: (row["default"]["frames"], row["arms"] == 8))
    ratios = [row["default"]["seconds"] / row["plain"]["seconds"] for row in found["rows"]]
    own = longest["default"]
    return [
        (
            f"Everything on takes {min(ratios):.1f} to {max(ratios):.1f} times as long as meeting "
            f"targets alone; {own['frames']} frames take {own['seconds']:.1f} s."
        )
    ]
