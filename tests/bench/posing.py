# SPDX-License-Identifier: GPL-3.0-or-later
"""How long a step of the plastic puppet takes, beside MuJoCo, and whether it ever breaks.

Figures of 20 and of 97 capsules fall onto a floor and lie there; then a hand drags them over it.
MuJoCo steps the same figures on the same floor in the same run, once with springs at the joints and
once with the three elements as two joints in series. One core, steps of 1 ms.

make bench ARGS="posing --random 100000"
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from octo_motion.core.posing.puppet.figure import Figure
from octo_motion.core.posing.puppet.materials import elements_for
from octo_motion.core.posing.session import hand_for
from octo_motion.core.posing.solver.obstacle_shapes import Box, Plane, Sphere
from octo_motion.core.posing.solver.world import World, WorldSettings
from octo_motion.core.rotations import Floats
from tests.core.puppets import Torn, chain, doll, octopus, posed, soft, torn, tree

_HIGH: Final = 0.12
"""Metres from which a figure falls."""
_ONE_CORE: Final = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
_SETTLE: Final = 1500
_WEIGHT: Final = (0.0, 0.0, -9.81)


@dataclass(frozen=True)
class Measured:
    """Seconds of the steps of one figure in one way."""

    name: str
    bodies: int
    contacts: float
    """Mean number of contacts that were carried in a step."""
    median: float
    p99: float
    processor: float
    """Median of the processor's time, which other programs disturb less; 0 if not known."""


def main(words: Sequence[str]) -> None:
    """Measure, print tables and write JSON if wanted."""
    if os.environ.get("OPENBLAS_NUM_THREADS") != "1":
        # Numpy reads it when it is loaded: once more, on one core.
        again = [sys.executable, "-m", "tests.bench", "posing", *words]
        sys.exit(subprocess.run(again, env=os.environ | _ONE_CORE, check=False).returncode)
    parser = argparse.ArgumentParser(prog="python -m tests.bench posing", description=__doc__)
    parser.add_argument("--steps", type=int, default=3000, help="measured, of each figure")
    parser.add_argument(
        "--random", type=int, default=0, help="steps of random tearing instead, of each figure"
    )
    parser.add_argument("--only", default="", help="of these, figures with this word in their name")
    parser.add_argument("--json", type=Path, help="file to write all numbers to")
    arguments = parser.parse_args(words)
    if arguments.random:
        report = {"random": measure_torn(arguments.random, arguments.only)}
        print(text_torn(report["random"]))
    else:
        report = {"rows": _steps(arguments.steps)}
        print(text(report["rows"]))
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")


def measure(*words: str) -> Any:
    """What the command line would write to its file, on one core: in a process of its own."""
    with tempfile.TemporaryDirectory(prefix="octo-motion-bench-") as folder:
        path = Path(folder) / "result.json"
        command = [sys.executable, "-m", "tests.bench", "posing", *words, "--json", str(path)]
        finished = subprocess.run(
            command, env=os.environ | _ONE_CORE, capture_output=True, encoding="utf-8", check=False
        )
        if finished.returncode != 0 or not path.exists():
            sys.exit(f"Measuring the puppet failed:\n{finished.stderr}")
        (found,) = json.loads(path.read_text(encoding="utf-8")).values()
        return found


def _steps(steps: int) -> list[dict[str, Any]]:
    figures = {"doll": _doll(), "octopus": _octopus()}
    rows: list[Measured] = []
    for name, figure in figures.items():
        rows += _ours(name, figure, steps)
    rows += [_dragged_chain(count, steps) for count in (100, 200)]
    return [asdict(row) for row in rows + _mujoco(figures, steps)]


def _dragged_chain(count: int, steps: int) -> Measured:
    """A chain of clay, held at one end and led about at the other."""
    figure = chain(count, 1.5 / count, 0.3 / count)
    figure = replace(figure, elements=elements_for(figure, "clay"))
    world = World(figure, posed(figure), WorldSettings())
    world.pin(0)
    start = world.pose().positions[-1]
    grab = world.grab(count - 1, start)

    def drag(number: int) -> None:
        angle = 2.0 * np.pi * number / 2000.0
        grab.pull(start + np.array([0.3 * np.sin(angle), 0.3 * np.cos(angle) - 0.3, 0.1]))

    return _timed(world, f"chain of {count}, dragged", steps, drag)


def _doll() -> Figure:
    return doll(soft(20, 40.0, 2.0, 5.0, 10.0))


def _octopus() -> Figure:
    return octopus(soft(97, 0.5, 0.02, 0.05, 0.1))


def _ours(name: str, figure: Figure, steps: int) -> list[Measured]:
    world = World(
        figure, posed(figure, at=(0.0, 0.0, _HIGH)), WorldSettings(gravity=_WEIGHT), [Plane()]
    )
    # A mixed time of falling, landing and coming to rest: what is measured begins with it.
    rows = [_timed(world, f"{name}, falling onto the floor", _SETTLE)]
    rows.append(_timed(world, f"{name}, lying on the floor", steps))
    body = len(figure) - 1
    start = world.pose().positions[body]
    grab = world.grab(body, start)

    def drag(number: int) -> None:
        angle = 2.0 * np.pi * number / 2000.0
        way = np.array([0.3 * np.sin(angle), 0.3 - 0.3 * np.cos(angle), 0.1])
        grab.pull(start + way)

    rows.append(_timed(world, f"{name}, dragged over the floor", steps, drag))
    return rows


def _timed(world: World, name: str, steps: int, before: Any = None) -> Measured:
    clock, processor = np.empty(steps), np.empty(steps)
    carried = 0
    gc.collect()
    for number in range(steps):
        if before is not None:
            before(number)
        start, own = time.perf_counter(), time.thread_time()
        world.step()
        clock[number] = time.perf_counter() - start
        processor[number] = time.thread_time() - own
        assert world.last is not None
        assert world.contacts is not None
        pushes = world.last.impulses[: len(world.contacts)]
        carried += int(pushes.any(axis=1).sum())
    return Measured(
        name,
        len(world.figure),
        carried / steps,
        *_middle_and_worst(clock),
        float(np.median(processor)),
    )


def _middle_and_worst(seconds: Floats) -> tuple[float, float]:
    return float(np.median(seconds)), float(np.percentile(seconds, 99.0))


def _mujoco(figures: dict[str, Figure], steps: int) -> list[Measured]:
    found = subprocess.run(
        [".ci/dev", "venv", "mujoco"], capture_output=True, encoding="utf-8", check=False
    )
    if found.returncode != 0:
        _warn("could not be set up", found.stderr)
        return []
    asked = {
        "settle": _SETTLE,
        "steps": steps,
        "figures": [_described(name, figure) for name, figure in figures.items()],
    }
    run = subprocess.run(
        [found.stdout.strip(), str(Path(__file__).with_name("mujoco_side.py"))],
        input=json.dumps(asked),
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    if run.returncode != 0:
        _warn("failed", run.stderr)
        return []
    answer = json.loads(run.stdout)
    rows: list[Measured] = []
    for row in answer["rows"]:
        kind = "elements as joints in series" if row["series"] else "springs"
        middle, worst = _middle_and_worst(np.array(row["seconds"]))
        name = f"{row['name']}, lying, MuJoCo {answer['version']}, {kind}"
        if not row["finite"]:
            name += " (broke)"
        rows.append(Measured(name, len(figures[row["name"]]), row["contacts"], middle, worst, 0.0))
    return rows


def _warn(what: str, why: str) -> None:
    print(f"Without MuJoCo, which {what}:", *why.strip().splitlines()[-1:], file=sys.stderr)


def _described(name: str, figure: Figure) -> dict[str, Any]:
    elements = figure.elements
    return {
        "name": name,
        "parents": list(figure.parents),
        "anchors": figure.anchors.tolist(),
        "rest": figure.rest.tolist(),
        "masses": figure.masses.tolist(),
        "centres": figure.centres.tolist(),
        "inertias": figure.inertias.tolist(),
        "capsules": figure.capsules.tolist(),
        "radii": figure.radii.tolist(),
        "root": [0.0, 0.0, _HIGH],
        "stiffness": float(elements.stiffness[0]),
        "damping": float(elements.damping[0]),
        "flow": float(elements.flow[0]),
    }


def text(rows: Any) -> str:
    """The table of steps."""
    lines = [f"{'':<62} {'bodies':>6} {'contacts':>8} {'median':>8} {'99 %':>8} {'processor':>9}"]
    for row in rows:
        own = f"{1e6 * row['processor']:>9.0f}" if row["processor"] else f"{'':>9}"
        lines.append(
            f"{row['name']:<62} {row['bodies']:>6} {row['contacts']:>8.1f} "
            f"{1e6 * row['median']:>8.0f} {1e6 * row['p99']:>8.0f} {own}".rstrip()
        )
    note = "µs a step; contacts: carried, in the mean; processor: median of its time"
    return "\n".join([*lines, "", note])


def said(rows: Any) -> list[str]:
    """What the table shows, in words."""
    result = []
    for row in rows:
        figure, _, way = row["name"].partition(", lying, ")
        if not way:
            continue
        lying = next(each for each in rows if each["name"] == f"{figure}, lying on the floor")
        result.append(
            f"{way} steps the {figure} in {row['median'] / lying['median']:.2f} times the time "
            "that ours takes."
        )
    if not result:
        return ["MuJoCo could not be set up in this run."]
    return [" ".join(result), *_in_steps_of_springs(rows)]


def _in_steps_of_springs(rows: Any) -> list[str]:
    """Our steps counted in MuJoCo's with springs of the same figure, in a sentence: how fast the
    machine is, and what else runs on it, is in both.
    """
    told = []
    for row in rows:
        figure, _, way = row["name"].partition(", lying, ")
        if not way.endswith("springs"):
            continue
        ours = [
            (each["name"].split(", ")[1].split()[0], each["median"] / row["median"])
            for each in rows
            if each["name"].startswith(f"{figure}, ") and ", lying, " not in each["name"]
        ]
        parts = ", ".join(f"{share:.1f} {doing}" for doing, share in ours)
        told.append(f"of the {figure} {parts}")
    if not told:
        return []
    return [f"In steps of MuJoCo with springs a step of ours takes, {'; '.join(told)}."]


def measure_torn(steps: int, only: str = "") -> list[dict[str, Any]]:
    """Grabs, pulls and pins at random, among a floor, a box and a ball."""
    rng = np.random.default_rng(0)
    kinds = {
        "doll of clay": (_limited(_doll()), "clay"),
        "octopus of wire": (_octopus(), "wire"),
        "random tree of rubber": (tree(rng, 12), "rubber"),
    }
    results: list[dict[str, Any]] = []
    for name, (bare, material) in kinds.items():
        if only not in name:
            continue
        figure = replace(bare, elements=elements_for(bare, material))
        world = World(
            figure,
            posed(figure, at=(0.0, 0.0, 0.5)),
            WorldSettings(gravity=_WEIGHT, self_collision=True),
            [
                Plane(),
                Box(position=np.array([0.4, 0.4, 0.1]), half=np.array([0.2, 0.2, 0.1])),
                Sphere(position=np.array([-0.4, 0.4, 0.1]), radius=0.2),
            ],
        )
        start = time.perf_counter()
        found = Torn()
        for found in torn(world, rng, steps, hand_for(figure)):
            if found.steps % max(steps // 20, 1) == 0:
                _tell(name, found, time.perf_counter() - start)
        seconds = time.perf_counter() - start
        results.append({"name": name, "seconds": seconds, **asdict(found)})
    return results


def text_torn(results: Any) -> str:
    """The table of figures that were torn at."""
    lines = [
        (
            f"{'figure':<24} {'steps':>8} {'unsettled':>10} {'opening':>8} {'broken':>7} {'m/s':>5}"
            f" {'energy J':>9} {'gain J':>7} {'limits °':>9} {'ms/step':>8}"
        )
    ]
    lines += [
        f"{row['name']:<24} {row['steps']:>8} {row['unsettled'] / row['steps']:>10.1%}"
        f" {row['widest']:>8.0e} {row['broken']:>7} {row['fastest']:>5.0f} {row['energy']:>9.0f}"
        f" {row['gain']:>7.0e} {np.degrees(row['overrun']):>9.1f}"
        f" {1000.0 * row['seconds'] / row['steps']:>8.1f}"
        for row in results
    ]
    return "\n".join(
        [
            *lines,
            "",
            "unsettled: steps that wanted more linear systems than are allowed",
            "opening: of a joint, against its bone; broken: steps with a number that is not finite",
            "gain: of energy in a step in which no hand held it; limits: how far beyond its range",
            "ms/step: checks included",
        ]
    )


def _tell(name: str, found: Torn, seconds: float) -> None:
    print(
        f"{seconds:>6.0f} s  {name}: {found.steps} steps, {found.unsettled} unsettled,"
        f" opening {found.widest:.0e}, {found.broken} broken, {found.fastest:.0f} m/s,"
        f" {found.energy:.0f} J, gained {found.gain:.0e} J in {found.alone} steps alone",
        file=sys.stderr,
        flush=True,
    )


def _limited(figure: Figure) -> Figure:
    """With ends to the range of every joint."""
    ends = np.radians([[-10.0, 130.0], [-30.0, 60.0], [-40.0, 40.0]])
    return replace(figure, limits=np.tile(ends, (len(figure), 1, 1)))


if __name__ == "__main__":
    main(sys.argv[1:])
