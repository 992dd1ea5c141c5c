# SPDX-License-Identifier: GPL-3.0-or-later
"""[Octopus] in numbers: the thesis' own loop against ours, on its own arm."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import Any, Final

import bpy
import numpy as np

from octo_motion.core.locomotion.gait import GaitPoser, GaitSettings, gait_presets
from octo_motion.core.locomotion.gait.ccd import SWEEPS
from octo_motion.core.rotations import rotate, shortest_arc
from tests.core.rigs import body_with_arms
from tests.papers.source_loop import TABLES, Floats, SourceArm, angles
from tests.referee import creature_measures as measures
from tests.referee.recording import moments, record

CYCLE: Final = 48
"""Frames of a cycle: two seconds, at 24 in a second."""
FINER: Final = 4
"""Times as many frames a second, to see what is a jump: all else turns so much less a frame."""
JOINTS: Final = 12
EVEN: Final = 0.4
"""A weight for all joints, and ours as the extension comes."""
PROFILES: Final[dict[str, tuple[float, ...]]] = {
    "towards the root": (1.0, 0.05),
    "even": (EVEN, EVEN),
    "towards the tip": (0.05, 1.0),
}
"""Weights at an arm's root and tip, even between, by where they put the bend."""
OFF: Final[dict[str, Any]] = {"softness": 0.0, "lateral_bend": 0.0}
"""What the thesis has not; give, steady and stand are off in the core unless they are asked for."""
OFFERED: Final[dict[str, Any]] = {"stretch_slack": 0.08, "smoothing_cycles": 0.08}
"""What the panel sets besides, for an arm in the air."""
_SIDEWAYS: Final = np.radians(20.0)
"""R(−20°, 20°) [§3.4], on head and pitch, to see what becomes of the suckers."""


@functools.cache
def source_played(
    gait: str,
    weights: tuple[float, ...],
    frames: int = CYCLE,
    *,
    afresh: bool = False,
    as_printed: bool = False,
    cycles: int = 2,
) -> tuple[Floats, Floats, Floats]:
    """Directions (frames, 12, 3), misses (frames, 3) and sweeps (frames,) of the last cycle.

    Weights stand at even steps from root to tip.
    Each frame goes on from the frame before, as a program that runs does, or ``afresh`` from the
    straight arm.
    """
    arm, own = SourceArm(sum_as_printed=as_printed), profile(weights)
    found: list[tuple[Floats, Floats, int]] = []
    for frame in range(frames * (cycles - 1) * (not afresh), frames * cycles + 1):
        if afresh:
            arm.straighten()
        targets = arm.targets(angles(TABLES[gait], 2.0 * np.pi * frame / frames))
        swept = arm.solve(targets, own)
        found.append((arm.directions(), arm.misses(targets), swept))
    directions, misses, sweeps = (np.array(each) for each in zip(*found, strict=True))
    last = slice(-frames - 1, None)
    return directions[last], misses[last], sweeps[last]


def profile(weights: tuple[float, ...]) -> Floats:
    """A weight for each joint, of weights at even steps from root to tip."""
    return np.interp(np.linspace(0.0, 1.0, JOINTS), np.linspace(0.0, 1.0, len(weights)), weights)


def ours_played(
    gait: str, weights: tuple[float, ...] = (EVEN,), frames: int = CYCLE, **settings: Any
) -> tuple[Floats, Floats]:
    """The same directions and misses by the extension's solver, on an arm of the same build."""
    poser = one_arm(gait, weights=weights, **settings)
    phases = np.linspace(0.0, 2.0 * np.pi, frames + 1)[:, None]
    asked, steering = poser.asked(phases, np.zeros((frames + 1, 2)))
    directions, misses = poser.shapes(poser.builds[0], asked, steering)
    return np.moveaxis(directions[..., 0], -1, 0), misses[:, 0]


def one_arm(gait: str, **settings: Any) -> GaitPoser:
    """What moves one arm of the thesis' build, which leads to the right."""
    skeleton, arms, body = body_with_arms(1, JOINTS, taper=0.01 * JOINTS)
    return GaitPoser(skeleton, arms, body, GaitSettings(gait_presets()[gait], **settings))


def largest_turn(directions: Floats) -> float:
    """Degrees that a segment turns from one frame to the next, at most."""
    cosine = np.sum(directions[1:] * directions[:-1], axis=-1)
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).max())


def bend_centroid(directions: Floats) -> float:
    """The joint, counted from 0 at the root, about which an arm's bends lie, over a cycle."""
    first = np.broadcast_to([1.0, 0.0, 0.0], (len(directions), 1, 3))
    chain = np.concatenate([first, directions], axis=1)
    bends = np.arccos(np.clip(np.sum(chain[:, 1:] * chain[:, :-1], axis=-1), -1.0, 1.0))
    return float((bends @ np.arange(bends.shape[1])).sum() / bends.sum())


# --- The loop ------------------------------------------------------------------------------------


def loop(*, quick: bool = False) -> Any:
    """Miss, largest turn of a frame and sweeps, by gait and way."""
    ways: dict[str, Callable[[str, int], tuple[Floats, Floats, Any]]] = {
        "source, eq. 3.4 as printed": lambda gait, frames: source_played(
            gait, (1.0,), frames, as_printed=True
        ),
        "source, from the straight arm": lambda gait, frames: source_played(
            gait, (1.0,), frames, afresh=True, cycles=1
        ),
        "source, from the frame before": lambda gait, frames: source_played(gait, (1.0,), frames),
        f"source, likewise, a = {EVEN}": lambda gait, frames: source_played(gait, (EVEN,), frames),
        "ours, as published": lambda gait, frames: (
            *ours_played(gait, (EVEN,), frames, **OFF),
            3 * SWEEPS,
        ),
        "ours, as it comes": lambda gait, frames: (
            *ours_played(gait, (EVEN,), frames, **OFFERED),
            3 * SWEEPS,
        ),
    }
    rows = []
    for gait in ("walk", "swim"):
        for way, play in list(ways.items())[:: 5 if quick else 1]:
            directions, misses, sweeps = play(gait, CYCLE)
            finer, _, _ = play(gait, FINER * CYCLE) if not quick else (directions, 0, 0)
            swept = np.asarray(sweeps, dtype=np.float64)
            rows.append(
                {
                    "gait": gait,
                    "way": way,
                    "miss": 100.0 * float(misses.max()),
                    "turn": largest_turn(directions),
                    "finer": largest_turn(finer),
                    "sweeps": float(swept.mean()),
                    "most": int(swept.max()),
                }
            )
    return {"rows": rows}


def loop_text(found: Any) -> str:
    """The table."""
    lines = [
        f"{'':>4}  {'':<31}{'miss':>8}{'turn':>9}{'finer':>9}{'sweeps':>9}{'most':>6}",
        *(
            f"{row['gait']:>4}  {row['way']:<31}{row['miss']:>6.2f} %{row['turn']:>8.1f}°"
            f"{row['finer']:>8.1f}°{row['sweeps']:>9.0f}{row['most']:>6}"
            for row in found["rows"]
        ),
        "",
        "miss: of a group's end from its target, of the arm's length, at most over a cycle",
        f"turn: of a segment from one frame to the next, at most; {CYCLE} frames a cycle",
        f"finer: the same with {FINER} times as many frames: a quarter is smooth, as much a jump",
        "sweeps: of all three groups in a frame, mean and most; the source's end at 0.1 % of an",
        "  arm or after 50 a group",
    ]
    return "\n".join(lines)


def loop_told(found: Any) -> str:
    """What the row about the loop says."""
    rows = {(row["gait"], row["way"]): row for row in found["rows"]}
    before = rows.get(("walk", "source, from the frame before")) or found["rows"][0]
    ours = rows.get(("walk", "ours, as it comes")) or found["rows"][-1]
    return (
        f"walking, the source's loop misses by {before['miss']:.2f} % of an arm after "
        f"{before['sweeps']:.0f} sweeps a frame and turns by {before['turn']:.0f}° in a frame; "
        f"ours misses by {ours['miss']:.2f} % after {ours['sweeps']:.0f}, and turns by "
        f"{ours['turn']:.0f}°"
    )


# --- Weights -------------------------------------------------------------------------------------


def weights(*, quick: bool = False) -> Any:
    """Where the bend lies by weights [eq. 3.7], of the thesis' loop and of ours."""
    rows = []
    for gait in ("walk",) if quick else ("walk", "swim"):
        for name, ends in PROFILES.items():
            rows.append(
                {
                    "gait": gait,
                    "profile": name,
                    "source": bend_centroid(source_played(gait, ends)[0]),
                    "published": bend_centroid(ours_played(gait, ends, **OFF)[0]),
                    "ours": bend_centroid(ours_played(gait, ends, **OFFERED)[0]),
                }
            )
    return {"rows": rows}


def weights_text(found: Any) -> str:
    """The table."""
    return "\n".join(
        [
            f"{'':>4}  {'put the bend':<22}{'source':>9}{'published':>11}{'as it comes':>13}",
            *(
                f"{row['gait']:>4}  {row['profile']:<22}{row['source']:>9.2f}"
                f"{row['published']:>11.2f}{row['ours']:>13.2f}"
                for row in found["rows"]
            ),
            "",
            f"the joint, from 0 at the root to {JOINTS - 1}, about which the bends of a cycle lie",
        ]
    )


def weights_told(found: Any) -> str:
    """What the row about weights says."""
    said = []
    for gait in dict.fromkeys(row["gait"] for row in found["rows"]):
        rows = [row for row in found["rows"] if row["gait"] == gait]
        spans = {way: rows[-1][way] - rows[0][way] for way in ("source", "ours")}
        said.append(
            f"{gait}: the bend moves by {spans['source']:.1f} of {JOINTS} joints by the source's "
            f"loop, by {spans['ours']:.1f} with ours"
        )
    return "; ".join(said)


# --- The suckers' side ---------------------------------------------------------------------------


def varied(cycles: int, seed: int = 1) -> Iterator[tuple[float, Floats]]:
    """Phase, and additions (3, 2) to head and pitch, frame by frame [§3.4]."""
    random = np.random.default_rng(seed)
    drawn = random.uniform(-_SIDEWAYS, _SIDEWAYS, (4 * cycles + 1, 3, 2))
    for frame in range(CYCLE * cycles + 1):
        at = 4.0 * frame / CYCLE
        knot = min(int(at), 4 * cycles - 1)
        yield (
            2.0 * np.pi * frame / CYCLE,
            drawn[knot] + (at - knot) * (drawn[knot + 1] - drawn[knot]),
        )


def source_twisted(cycles: int) -> Iterator[SourceArm]:
    """The thesis' arm as it walks with variation, frame by frame."""
    arm = SourceArm()
    for phase, added in varied(cycles):
        head = angles(TABLES["walk"], phase) + added[:, 0]
        arm.solve(arm.targets(head, added[:, 1]), np.ones(JOINTS))
        yield arm


def suckers(*, quick: bool = False) -> Any:
    """How far the tip's suckers are turned about the arm after some cycles, source and ours."""
    cycles = 2 if quick else 10
    source = [np.abs(twists(arm.directions(), arm.turned)).max() for arm in source_twisted(cycles)]
    frames = CYCLE * cycles + 1
    poser = one_arm("walk", variation=(-_SIDEWAYS, _SIDEWAYS), **OFFERED)
    phases = 2.0 * np.pi * np.arange(float(frames)) / CYCLE
    rotations = poser.pose(phases, np.zeros((frames, 2))).rotations
    skeleton, arms, _ = body_with_arms(1, JOINTS, taper=0.01 * JOINTS)
    basis = np.zeros((frames, len(skeleton), 4))
    basis[..., 0] = 1.0
    rows = [skeleton.index[name] for name in arms[0].bones]
    basis[:, rows] = rotations
    played, _ = skeleton.pose(basis)
    ours = []
    for turned in played[:, rows]:
        # As the thesis' segments: x along, z away from the suckers.
        along, up = rotate(turned, [0.0, 1.0, 0.0]), rotate(turned, [0.0, 0.0, 1.0])
        axes = np.stack([along, np.cross(up, along), up], axis=-1)
        ours.append(np.abs(twists(along, axes, skeleton.rest_matrices[rows[0], :3, :3])).max())
    each = CYCLE
    return {
        "cycles": cycles,
        "source": [float(max(source[: each * count + 1])) for count in (1, cycles)],
        "ours": [float(max(ours[: each * count + 1])) for count in (1, cycles)],
    }


def twists(directions: Floats, turned: Floats, rest: Floats | None = None) -> Floats:
    """(segments,) degrees that each is turned about itself against the way without any twist.

    Without twist it comes from the one before by the smallest turn there is, the first from rest.
    """
    along = np.array([1.0, 0.0, 0.0]) if rest is None else rest[:, 1]
    up = np.array([0.0, 0.0, 1.0]) if rest is None else rest[:, 2]
    found = []
    for direction, axes in zip(directions, turned, strict=True):
        up = rotate(shortest_arc(along, direction), up)
        along = direction
        aside = np.cross(along, up)
        found.append(np.degrees(np.arctan2(axes[:, 2] @ aside, axes[:, 2] @ up)))
    return np.array(found)


def suckers_told(found: Any) -> str:
    """What the row about the suckers says."""
    return (
        f"with variation to the sides, the source's suckers are turned about the arm by up to "
        f"{found['source'][0]:.0f}° within a cycle and {found['source'][1]:.0f}° within "
        f"{found['cycles']}; ours by {found['ours'][1]:.1f}°, bank apart"
    )


def build(*, quick: bool = False) -> Any:
    """The thesis' arm [eq. 3.1, 3.2] and ours of the same numbers, in w₀."""
    del quick
    arm = SourceArm()
    lengths = one_arm("walk").builds[0].chain.lengths * arm.length
    return {"length": arm.length, "off": float(np.abs(lengths - arm.segments).max())}


def build_told(found: Any) -> str:
    """What the row about the arm says."""
    return (
        f"the same: {found['length']:.2f} w₀ long; no segment differs by more than "
        f"{found['off']:.0e} w₀"
    )


# --- From walking to swimming --------------------------------------------------------------------


def changing_octopus(fps: int = 24) -> Any:
    """An octopus in an empty file that walks, and swims where its route rises."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene: Any = bpy.context.scene
    scene.render.fps = fps
    bpy.ops.octo_motion.add_octopus()
    octopus: Any = bpy.context.object
    bpy.ops.octo_motion.detect_arms()
    bpy.ops.octo_motion.add_route(
        b0=(-1.6, 0, 0), b1=(-0.4, 0, -0.1), b2=(0.2, 0, 0), b3=(1.6, 0, 1.1)
    )
    octopus.octo_motion.locomotion.change.by = "HEIGHT"
    scene.frame_end = 1
    bpy.ops.octo_motion.generate_locomotion()
    octopus.show_in_front = False
    return octopus


def change(*, quick: bool = False) -> Any:
    """Degrees that a bone turns in a frame: the source's loop where one table follows the other,
    and ours while the gait changes; at 24 frames a second, and at 48.
    """
    arm, phase = SourceArm(), 0.0
    for frame in range(CYCLE + 1):
        phase = 2.0 * np.pi * (frame / CYCLE + 0.625)
        arm.solve(arm.targets(angles(TABLES["walk"], phase)), np.ones(JOINTS))
    before = arm.directions()
    arm.solve(arm.targets(angles(TABLES["swim"], phase)), np.ones(JOINTS))
    turns = []
    for fps in (24,) if quick else (24, 48):
        octopus = changing_octopus(fps)
        scene: Any = bpy.context.scene
        played = record(octopus, moments(scene.frame_start, scene.frame_end), with_skin=False)
        turns.append(measures.turns(played).value)
    return {"source": largest_turn(np.stack([before, arm.directions()])), "ours": turns}


def change_told(found: Any) -> str:
    """What the row about the change says."""
    finer = f", {found['ours'][1]:.0f}° at 48" if len(found["ours"]) > 1 else ""
    return (
        f"where one table simply follows the other, a segment turns by {found['source']:.0f}° in a "
        f"frame; ours turns no bone by more than {found['ours'][0]:.0f}° a frame at 24 frames a "
        f"second{finer}, the travel included"
    )
