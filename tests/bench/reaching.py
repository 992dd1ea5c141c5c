# SPDX-License-Identifier: GPL-3.0-or-later
"""How an arm reaches: ours beside a Cosserat rod in water that PyElastica simulates.

Ours is kinematics, made to look like what Gutfreund et al. measured in 1996; the rod obeys
mechanics and an activation that runs along it at a constant speed. They have the arm's length and
thickness and the time in common, and nothing else: what both do is no coincidence of one model.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from octo_motion.core.locomotion.octopus import OctopusShape
from octo_motion.core.locomotion.reaching import Places, Target, Timeline, plan_grasp, profile_of
from octo_motion.core.locomotion.rig import frames_of_arm
from octo_motion.core.rotations import IDENTITY, Floats
from tests.core import objects
from tests.core.rigs import body_with_arms

_SECONDS: Final = 1.25
"""From setting out to the touch."""
_FRAMES: Final = 120
"""Moments from setting out to the end, a quarter later than the touch."""
_POINTS: Final = 40
"""Bones of our arm, and elements of the rod."""
_STRETCH: Final = 0.1
"""Arm lengths within which a bend lies."""
_BENT: Final = np.radians(20.0)
"""What is bent less is straight."""
_ARRIVED: Final = 0.98
"""Share of the farthest place of the bend from which on it has arrived there."""
_PROMINENT: Final = 0.2
"""How high a second peak of speed stands out, of the highest."""


@dataclass(frozen=True)
class Told:
    """What can be seen of a reach. Places are shares of the arm's length, times of the reach's."""

    name: str
    bend: list[float]
    """Where the bend is at its start, at each quarter of its way's time, and at its end."""
    bent: list[float]
    """When it is there."""
    towards_tip: float
    """Share of the bend's way that leads to the tip."""
    bend_peaks: int
    """Of the speed of the bend in space."""
    bend_peak: float
    """When it is fastest."""
    bend_strays: float
    """Arm lengths that it is off the straight line between the ends of its way, at most."""
    tip_peaks: int
    """Of the speed of the tip."""
    tip_peak: float
    tip_way: float
    """Arm lengths that the tip goes."""


def measure() -> list[dict[str, Any]]:
    """Ours, and the rod where PyElastica can be had."""
    found = [told("Octo Motion, Reach", ours())]
    rod = simulated()
    if rod is not None:
        version, points = rod
        found.append(told(f"Cosserat rod, PyElastica {version}", points))
    return [asdict(each) for each in found]


def beside() -> list[dict[str, Any]] | None:
    """Both, or none where only ours can be measured."""
    found = measure()
    return found if len(found) > 1 else None


def text(results: Any) -> str:
    """The table."""
    heads = ("from", "to", "out", "peaks", "at", "strays", "tip", "at", "way")
    widths = (5, 5, 5, 6, 5, 7, 4, 5, 5)
    head = " ".join(f"{each:>{width}}" for each, width in zip(heads, widths, strict=True))
    lines = [f"{'':<32} {'where the bend is':^24} {head}"]
    for row in results:
        bend = " ".join(f"{place:.2f}" for place in row["bend"])
        lines.append(
            f"{row['name']:<32} {bend:>24} {row['bent'][0]:>5.2f} {row['bent'][-1]:>5.2f}"
            f" {row['towards_tip']:>5.0%} {row['bend_peaks']:>6} {row['bend_peak']:>5.2f}"
            f" {row['bend_strays']:>7.2f} {row['tip_peaks']:>4} {row['tip_peak']:>5.2f}"
            f" {row['tip_way']:>5.2f}"
        )
    return "\n".join(
        [
            *lines,
            "",
            "where the bend is: arm lengths from the base, at its start, each quarter and its end",
            "from, to, at: times, 1 is the touch, or when the wave is at the tip",
            "out: share of the bend's way; strays: arm lengths off a straight line",
            "tip: peaks of its speed; way: in arm lengths",
        ]
    )


def said(results: Any) -> list[str]:
    """What of it agrees, and what does not."""
    if len(results) < 2:
        return []
    own, rod = results
    both = (own, rod)
    single = [
        what
        for what, key in (("the bend's", "bend_peaks"), ("the tip's", "tip_peaks"))
        if all(each[key] == 1 for each in both)
    ]
    ways = f"{own['towards_tip']:.0%} and {rod['towards_tip']:.0%}"
    first = f"Of the ways of the bends, ours first, {ways} lead outwards."
    if single:
        first += f" Of both, {' and '.join(single)} speed has one peak."
    return [
        first,
        (
            f"What differs: ours is bent from {own['bend'][0]:.2f} arm lengths on, for it has to"
            f" gather first, and the rod from {rod['bend'][0]:.2f}, for it lies folded. Our bend is"
            f" fastest at {own['bend_peak']:.2f} of the reach, the rod's at {rod['bend_peak']:.2f};"
            f" they stray {own['bend_strays']:.2f} and {rod['bend_strays']:.2f} arm lengths from a"
            f" straight line."
        ),
    ]


def main(_words: list[str]) -> None:
    """Measure and print."""
    found = measure()
    print("\n\n".join([text(found), *said(found)]))


# --- Two arms -------------------------------------------------------------------------------------


def ours() -> Floats:
    """Joints (moments, points, 3) of an arm that lies straight and reaches, in arm lengths."""
    skeleton, arms, body = body_with_arms(8, _POINTS)
    arm = frames_of_arm(skeleton, arms[0].bones, body)
    timeline = Timeline(0.0, 1.0, 1.25, 2.0, 3.0)
    times = np.linspace(0.0, 1.25, _FRAMES + 1)
    # About as far as an arm can reach that has to lie on what it touches.
    radii = np.interp(arm.reach, [0.0, arm.length], [0.05, 0.008])
    root = arm.joints(arm.from_bones(np.tile(IDENTITY, (1, _POINTS, 1))))[0]
    away = root[-1] - root[0]
    place = root[0] + 0.75 * away + np.array([0.0, 0.0, 0.1 * arm.length])
    places = Places(np.tile(place, (len(times), 1)), np.tile(IDENTITY, (len(times), 1)))
    target = Target(profile_of(*objects.rod()), places, "'Rod'")
    grasp = plan_grasp(arm, radii, target, timeline, times, mode="TOUCH", name="'Arm'")
    grasp = grasp.paced(times, target.places)
    still = np.tile(IDENTITY, (len(times), _POINTS, 1))
    return arm.joints(arm.from_bones(grasp.apply(times, places, still))) / arm.length


def simulated() -> tuple[str, Floats] | None:
    """PyElastica's version and the rod's points; none where it cannot be set up."""
    found = subprocess.run(
        [".ci/dev", "venv", "elastica"], capture_output=True, encoding="utf-8", check=False
    )
    if found.returncode != 0:
        return _without("could not be set up", found.stderr)
    shape = OctopusShape()
    middles = (np.arange(float(_POINTS)) + 0.5) * (shape.arm_length / _POINTS)
    asked = {
        "radii": (0.5 * shape.skin_diameter(middles)).tolist(),
        "length": shape.arm_length,
        "seconds": _SECONDS,
        "frames": _FRAMES,
    }
    run = subprocess.run(
        [found.stdout.strip(), str(Path(__file__).with_name("elastica_side.py"))],
        input=json.dumps(asked),
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    if run.returncode != 0:
        return _without("failed", run.stderr)
    answer = json.loads(run.stdout)
    return answer["version"], np.array(answer["points"]) / shape.arm_length


def _without(what: str, why: str) -> None:
    print(f"Without PyElastica, which {what}:", *why.strip().splitlines()[-1:], file=sys.stderr)


# --- What is seen ---------------------------------------------------------------------------------


def told(name: str, points: Floats) -> Told:
    """What is seen of an arm (moments, points, 3) that reaches, in arm lengths; the last moment is
    a quarter of the reach's time after its end.
    """
    times = np.linspace(0.0, 1.25, len(points))
    bend, angles = bends(points)
    # From when there is a bend until it is as far out as it gets.
    first = int(np.argmax(angles > _BENT))
    farthest = bend[first:][angles[first:] > _BENT].max()
    there = (np.arange(len(bend)) >= first) & (bend >= _ARRIVED * farthest) & (angles > _BENT)
    on_its_way = slice(first, int(np.argmax(there)) + 1)
    spots = np.array([_along(each, at) for each, at in zip(points, bend, strict=True)])[on_its_way]
    bend_times, tip = times[on_its_way], points[:, -1]
    quarters = np.linspace(bend_times[0], bend_times[-1], 5)
    bend_speeds = _speeds(spots)
    tip_speeds = _speeds(tip)
    steps = np.diff(bend[on_its_way])
    return Told(
        name=name,
        bend=np.interp(quarters, bend_times, bend[on_its_way]).tolist(),
        bent=quarters.tolist(),
        towards_tip=float(steps[steps > 0.0].sum() / max(np.abs(steps).sum(), 1e-9)),
        bend_peaks=peaks(bend_speeds),
        bend_peak=float(bend_times[np.argmax(bend_speeds)]),
        bend_strays=_strays(spots),
        tip_peaks=peaks(tip_speeds),
        tip_peak=float(times[np.argmax(tip_speeds)]),
        tip_way=float(np.linalg.norm(np.diff(tip, axis=0), axis=1).sum()),
    )


def bends(points: Floats) -> tuple[Floats, Floats]:
    """Where (moments,) along an arm a tenth of it is bent most, as a share of its length, and by
    how much, in radians. The outermost tenth is no arm that bends but a tip that trails.
    """
    edges = np.diff(points, axis=1)
    lengths = np.linalg.norm(edges, axis=-1)
    directions = edges / lengths[..., None]
    cosines = np.sum(directions[:, 1:] * directions[:, :-1], axis=-1)
    turned = np.arccos(np.clip(cosines, -1.0, 1.0))
    ends = np.cumsum(lengths, axis=1)
    joints = ends[:, :-1] / ends[:, -1:]
    places, angles = np.empty(len(points)), np.empty(len(points))
    for moment, (angle, joint) in enumerate(zip(turned, joints, strict=True)):
        # Joints on the edge of it are in it, whichever way they were rounded.
        near = np.abs(joint[:, None] - joint) <= 0.5 * _STRETCH + 1e-6
        within = np.where(joint <= 1.0 - _STRETCH, near @ angle, 0.0)
        bend = near[int(np.argmax(within))]
        angles[moment] = within.max()
        places[moment] = np.average(joint[bend], weights=angle[bend] + 1e-9)
    return places, angles


def peaks(speeds: Floats) -> int:
    """How many peaks stand out: each has to come down before the next by a fifth of the highest."""
    count, lowest, highest, rises = 0, speeds[0], speeds[0], True
    least = _PROMINENT * speeds.max()
    for speed in np.append(speeds, 0.0):
        lowest, highest = min(lowest, speed), max(highest, speed)
        if rises and speed < highest - least:
            count, rises, lowest = count + 1, False, speed
        elif not rises and speed > lowest + least:
            rises, highest = True, speed
    return count


def _speeds(spots: Floats) -> Floats:
    """Of a place over time, over a twentieth of the reach's time."""
    speeds = np.linalg.norm(np.diff(spots, axis=0), axis=1)
    return np.convolve(speeds, np.full(5, 0.2), "valid")


def _along(points: Floats, place: float) -> Floats:
    lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    return np.array([np.interp(place * lengths[-1], lengths, axis) for axis in points.T])


def _strays(spots: Floats) -> float:
    way = spots[-1] - spots[0]
    way = way / np.linalg.norm(way)
    off = spots - spots[0]
    return float(np.linalg.norm(off - np.outer(off @ way, way), axis=1).max())
