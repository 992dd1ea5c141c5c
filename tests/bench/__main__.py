# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed, precision and memory: our generate against Blender's inverse kinematics and bake.

Both animate the same rig to the same pseudo-targets over the same frames, twice: the bones alone,
where Blender bakes rotations only, and the octopus with its skin, where it bakes all that it does
by default. Ours is timed from the operator's call to the action on the armature, travel included;
Blender's is the bake alone, without constraints and targets. Then how fast splices are built. Each
measurement has a process of its own.

"splicing" as the first word measures the quality of splices instead; its own --help tells more.
"live" measures only how fast a walk follows a change, and what holding a ground costs.
"apart" measures how far arms pass through each other, with Keep Apart and without; "keys" how many
keys *Few* leaves of each gait.
"device" measures how well the loop at the devices keeps time, "posing" how long a step of the
plastic puppet takes.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from tests.bench import live_speed, splice_speed

Measured = dict[str, Any]

_JOINTS = 12
_ARMS = 8


def main() -> None:
    """Measure what the command line asks for, print tables, and write JSON if wanted."""
    if sys.argv[1:2] == ["splicing"]:
        from tests.bench import splicing

        splicing.main(sys.argv[2:])
        return
    if sys.argv[1:2] == ["posing"]:
        from tests.bench import posing

        posing.main(sys.argv[2:])
        return
    if sys.argv[1:2] == ["live"]:
        live_speed.tables()
        return
    if sys.argv[1:2] == ["apart"]:
        from tests.bench import apart

        apart.main(sys.argv[2:])
        return
    if sys.argv[1:2] == ["keys"]:
        from tests.bench import few_keys

        few_keys.main(sys.argv[2:])
        return
    if sys.argv[1:2] == ["device"]:
        from tests.bench import device_loop

        device_loop.main(sys.argv[2:])
        return
    arguments = _arguments()
    report: dict[str, Any] = {"machine": _machine(), "gait": arguments.gait}
    blender, processors = report["machine"]["blender"], report["machine"]["processors"]
    print(
        f"{blender} on {processors} processors: {_ARMS} arms × {_JOINTS} bones, "
        f"{3 * _ARMS} moving targets, gait '{arguments.gait}'\n"
    )
    report["against_blender"] = _against_blender(arguments)
    if not arguments.short:
        report["frames"] = _by_frames(arguments)
        report["arms"] = _by_arms(arguments)
        print()
        report["live"] = live_speed.tables()
        report["splices"] = splice_speed.tables(arguments.repeat)
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
        print(f"\nAll numbers are in {arguments.json}.")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument(
        "--frames", type=int, nargs="+", default=[250, 1000, 4000], help="how many, both ways"
    )
    parser.add_argument(
        "--long", type=int, default=10_000, help="frames of the longest run of ours alone"
    )
    parser.add_argument(
        "--arms", type=int, nargs="+", default=[1, 2, 4, 8, 16, 32], help="how many, ours alone"
    )
    parser.add_argument("--gait", default="walk", help="name of the gait")
    parser.add_argument(
        "--repeat", type=int, default=3, help="runs of each, of which the fastest counts"
    )
    parser.add_argument("--short", action="store_true", help="the comparison alone")
    parser.add_argument("--json", type=Path, help="file to write all numbers to")
    return parser.parse_args()


def _machine() -> dict[str, Any]:
    import bpy

    return {
        "blender": f"Blender {bpy.app.version_string}",
        "python": platform.python_version(),
        "system": platform.platform(),
        "processors": os.cpu_count(),
    }


def _against_blender(arguments: argparse.Namespace) -> list[dict[str, Any]]:
    titles = ("ours", "constraints and bake")
    print(f"{'':>6} {'':>7} │" + "│".join(f"{title:^49}" for title in titles) + "│")
    columns = f"{'seconds':>9}{'error: most':>13}{'mean':>9}{'°/frame':>9}{'MB':>8} "
    print(f"{'rig':>6} {'frames':>7} │{columns}│{columns}│ times faster: clock, processor")
    rows: list[dict[str, Any]] = []
    for rig in ("bare", "skin"):
        for frames in arguments.frames:
            ours, theirs = _best_of_each(arguments, frames, rig)
            ratio, of_processor = (theirs[time] / ours[time] for time in ("seconds", "cpu_seconds"))
            cells = f"{rig:>6} {frames:>7} │{_cells(ours)}│{_cells(theirs)}│"
            print(f"{cells}{ratio:>8.1f}{of_processor:>10.1f}", flush=True)
            rows.append(
                {
                    "rig": rig,
                    "frames": frames,
                    "ours": ours,
                    "blender": theirs,
                    "times_faster": ratio,
                    "times_faster_processor": of_processor,
                }
            )
    print(
        "\nerror: distance of a group's end from its target, in arm lengths"
        "\n°/frame: most that a bone turns within one frame"
        "\nMB: peak of the process, Blender itself included"
        "\nprocessor: by the processor's time, which other programs disturb less than the clock's\n"
    )
    return rows


def _cells(result: Measured) -> str:
    quality = result["quality"]
    return (
        f"{result['seconds']:>9.2f}{quality['largest_error']:>13.1e}{quality['mean_error']:>9.1e}"
        f"{quality['largest_turn']:>9.1f}{result['megabytes']:>8.0f} "
    )


def _by_frames(arguments: argparse.Namespace) -> list[Measured]:
    counts = sorted({*arguments.frames, arguments.long})
    results = [_best(arguments, _ARMS, frames) for frames in counts]
    print("Ours by frames")
    print(f"{'frames':>8} {'seconds':>9} {'ms/frame':>9} {'peak MB':>9}")
    for result in results:
        each = 1000.0 * result["seconds"] / result["frames"]
        print(
            f"{result['frames']:>8} {result['seconds']:>9.2f} {each:>9.2f} "
            f"{result['megabytes']:>9.0f}"
        )
    longest = results[-1]
    print(f"\nWhere the time of {longest['frames']} frames goes")
    for label, seconds in sorted(longest["parts"].items(), key=lambda item: -item[1]):
        print(f"{label:>28} {seconds:>7.2f} s {100.0 * seconds / longest['seconds']:>5.1f} %")
    print(flush=True)
    return results


def _by_arms(arguments: argparse.Namespace) -> list[Measured]:
    frames = 1000
    print(f"Ours by arms, {frames} frames")
    print(f"{'arms':>8} {'seconds':>9} {'ms/arm':>9} {'peak MB':>9}")
    results: list[Measured] = []
    for arms in arguments.arms:
        result = _best(arguments, arms, frames)
        each = 1000.0 * result["seconds"] / arms
        print(f"{arms:>8} {result['seconds']:>9.2f} {each:>9.1f} {result['megabytes']:>9.0f}")
        results.append(result)
    return results


def _best_of_each(
    arguments: argparse.Namespace, frames: int, rig: str
) -> tuple[Measured, Measured]:
    """The fastest run of each way, run by turns: what else the machine does meets both."""
    runs = [
        [_measure(method, rig, _ARMS, frames, arguments.gait) for method in ("generate", "bake")]
        for _ in range(arguments.repeat)
    ]
    return _fastest([ours for ours, _ in runs]), _fastest([theirs for _, theirs in runs])


def _best(arguments: argparse.Namespace, arms: int, frames: int) -> Measured:
    """The fastest run of ours on the bare rig."""
    return _fastest(
        [
            _measure("generate", "bare", arms, frames, arguments.gait)
            for _ in range(arguments.repeat)
        ]
    )


def _fastest(runs: list[Measured]) -> Measured:
    # Whatever disturbs a measurement adds to its time.
    return min(runs, key=lambda run: run["seconds"])


def _measure(method: str, rig: str, arms: int, frames: int, gait: str) -> Measured:
    with tempfile.TemporaryDirectory(prefix="octo-motion-bench-") as folder:
        path = Path(folder) / "result.json"
        case = [str(path), method, rig, str(arms), str(_JOINTS), str(frames), gait]
        finished = subprocess.run(
            [sys.executable, "-m", "tests.bench.case", *case],
            capture_output=True,
            text=True,
            check=False,
        )
        if finished.returncode != 0 or not path.exists():
            sys.exit(f"{method} of {arms} arms, {frames} frames failed:\n{finished.stderr}")
        return json.loads(path.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
