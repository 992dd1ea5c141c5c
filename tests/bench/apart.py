# SPDX-License-Identifier: GPL-3.0-or-later
"""How far arms pass through each other and the body, with Keep Apart and without.

Each set-up of the add-on moves the default octopus along a curved route, on a plane and on bumps
of 0.3 arm lengths. Beside how deep arms overlap, in radii of the thinner one, stand the figures
that keeping them apart must not spoil, and what it costs.
"""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from tests.bench.stopwatch import Stopwatch

GROUNDS: Final = ("plane", "bumps")
_BUMPS: Final = 0.3
"""Height of the bumps from valley to top, in arm lengths …"""
_WAVES: Final = (1.4, 1.2)
"""… and their lengths."""
_CELL: Final = 0.04
"""Arm lengths between the points of the bumps."""
_AROUND: Final = 4.0
"""Arm lengths to all sides of the route that they reach."""
_ROUTES: Final = {
    "curved": ((-1.9, 0.6, 0.0), (-0.7, -0.8, 0.0), (0.5, 0.9, 0.0), (1.9, 0.0, 0.0)),
    "turn": ((0.0, 0.0, 0.0), (0.0, -2.6, 0.0), (1.5, -2.6, 0.0), (3.1, -1.2, 0.0)),
}
"""Routes, in arm lengths."""
_RISING: Final = ((-6.2, 1.0, 1.5), (-2.1, -2.6, 1.0), (1.5, 3.1, 3.1), (6.2, 0.5, 3.4))
"""That of those that swim."""
_DEEP: Final = 0.1
"""Radii that arms may overlap."""

Measured = dict[str, Any]


_KINDS: Final = (("deepest", "9.2f"), ("share", "8.1f"), ("slip", "7.2f"), ("turn", "7.1f"))


def main(words: list[str]) -> None:
    """Measure what the command line asks for, and print a table."""
    from octo_motion.ui.locomotion.operators import setups

    parser = argparse.ArgumentParser(prog="python -m tests.bench apart", description=__doc__)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(setups.ORDER)}; all if none is")
    parser.add_argument("--route", choices=sorted(_ROUTES), default="curved", help="which way")
    parser.add_argument("--seeds", type=int, default=1, help="how many seeds, from 0; worst of all")
    arguments = parser.parse_args(words)
    print(text(measure(arguments.names, arguments.route, arguments.seeds)))


def measure(names: Sequence[str] = (), route: str = "curved", seeds: int = 1) -> list[Measured]:
    """The worst of some seeds of each set-up and ground.

    Args:
        names: of set-ups; all if there is none.
        route: one of the routes.
        seeds: how many, from 0.
    """
    import octo_motion
    from octo_motion.ui.locomotion.operators import setups

    octo_motion.register()
    rows: list[Measured] = []
    try:
        for name in names or setups.ORDER:
            for ground in GROUNDS:
                pairs = [_both(name, ground, route, seed) for seed in range(seeds)]
                if pairs[0]:
                    rows.append({"name": name, "ground": ground} | _worst(pairs))
    finally:
        # Blender 4.5 does not end while an operator is registered.
        octo_motion.unregister()
    return rows


def _worst(pairs: list[tuple[Measured, ...]]) -> Measured:
    """Without and with keeping apart, of all seeds."""
    more = [on["seconds"] for _, on in pairs]
    kinds = {
        kind: [max(pair[which][kind] for pair in pairs) for which in (0, 1)] for kind, _ in _KINDS
    }
    return {"frames": pairs[0][0]["frames"], "more": float(np.median(more))} | kinds


def text(rows: Any) -> str:
    """The table."""
    titles = (("overlaps: deepest", 19), ("share of frames", 19), ("slip", 15), ("turn", 15))
    columns = "".join(f"{'off':>{w}}{'on':>{w}} │" for w in (9, 9, 7, 7))
    lines = [
        f"{'':>20} │" + "".join(f"{title:^{w}}│" for title, w in titles) + " seconds",
        f"{'set-up and ground':>20} │{columns}{'frames':>7}{'more':>6}",
    ]
    for row in rows:
        title = f"{row['name']}, {row['ground']}"
        cells = ""
        for kind, form in _KINDS:
            percent = "%" * (kind == "share")
            cells += "".join(f"{value:{form}}{percent}" for value in row[kind]) + " │"
        lines.append(f"{title:>20} │{cells}{row['frames']:>7}{row['more']:>6.2f}")
    return "\n".join(
        [
            *lines,
            "",
            f"deepest: radii of the thinner arm; share of frames: where deeper than {_DEEP:g}",
            "slip: per cent of an arm's length; turn: degrees from one frame to the next",
            "more: seconds that it takes to keep them apart",
        ]
    )


def said(rows: Any) -> list[str]:
    """What the table shows, in words."""
    most = {kind: [max(row[kind][which] for row in rows) for which in (0, 1)] for kind, _ in _KINDS}
    slip, turn = (max(row[kind][1] - row[kind][0] for row in rows) for kind in ("slip", "turn"))
    left = [f"{row['name']} on {row['ground']}" for row in rows if row["share"][1] > 0.0]
    frames = sum(row["frames"] for row in rows)
    return [
        f"With **Keep Apart** arms overlap by {most['deepest'][1]:.2f} radii at most, without by "
        f"{most['deepest'][0]:.2f}. "
        + (
            f"Overlaps that count are left in {', '.join(left)}, at {most['share'][1]:.1f} % of "
            "the frames at most. **Tell Overlaps** names them."
            if left
            else "None that counts is left."
        ),
        (
            f"Slip grows by {max(slip, 0.0):.2f} per cent of an arm's length at most, the largest "
            f"turn of a motion by {max(turn, 0.0):.1f}°."
        ),
        f"Keeping apart takes {sum(row['more'] for row in rows):.1f} s for all {frames} frames.",
    ]


def _both(name: str, ground: str, route: str, seed: int) -> tuple[Measured, ...]:
    """Figures without and with arms that keep apart; none if this set-up needs no such ground."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    operators: Any = bpy.ops.octo_motion
    operators.add_octopus()
    octopus: Any = bpy.context.object
    operators.detect_arms()
    settings = octopus.octo_motion.locomotion
    operators.setup_load(name=name)
    settings.seed = seed
    swims = settings.table.manner == "SWIM"
    if swims and ground == "bumps":
        return ()
    unit = sum(octopus.data.bones[bone.name].length for bone in settings.arms[0].bones)
    points = unit * np.array(_RISING if swims else _ROUTES[route])
    operators.add_route(**dict(zip(("b0", "b1", "b2", "b3"), points, strict=True)))
    if ground == "bumps":
        settings.ground.object = add_bumps(points, unit)
        assert bpy.context.view_layer is not None
        bpy.context.view_layer.objects.active = octopus
    return tuple(_measured(octopus, keep_apart=keep) for keep in (False, True))


def _measured(octopus: Any, *, keep_apart: bool) -> Measured:
    import bpy

    from tests.ui.made import prepare

    octopus.octo_motion.locomotion.keep_apart = keep_apart
    shot = prepare(octopus, bpy.context)
    # A module of the same name as the function that its package hands out.
    computing = importlib.import_module("octo_motion.core.locomotion.motion.pipeline")
    watch = Stopwatch()
    with watch.watching({"apart": [(computing, "_separate")]}):
        for _ in shot.compute():
            pass
    assert shot.measured is not None
    assert shot.measured.separation is not None
    depths = shot.measured.separation.depths
    found = {figure.kind: figure.value for figure in shot.figures}
    return {
        "frames": len(shot.frames),
        "deepest": float(depths.max()),
        "share": 100.0 * float(np.mean(depths > _DEEP)),
        "slip": 100.0 * found.get("SLIP", 0.0),
        "turn": float(np.degrees(found["TURN"])),
        "seconds": watch.seconds["apart"],
    }


def add_bumps(points: np.ndarray, unit: float) -> Any:
    """A mesh of gentle bumps under points (n, 3); metres of an arm's length."""
    import bpy

    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    sides = [
        np.arange(a - _AROUND * unit, b + _AROUND * unit, _CELL * unit)
        for a, b in zip(low, high, strict=True)
    ]
    across, along = np.meshgrid(*sides, indexing="ij")
    turns = 2.0 * np.pi / unit
    waves = np.sin(turns * across / _WAVES[0]) * np.cos(turns * along / _WAVES[1])
    vertices = np.stack([across, along, 0.5 * _BUMPS * unit * waves], axis=-1).reshape(-1, 3)
    corner = np.arange(len(vertices)).reshape(across.shape)
    faces = np.stack(
        [corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], axis=-1
    ).reshape(-1, 4)
    mesh = bpy.data.meshes.new("Bumps")
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    ground = bpy.data.objects.new("Bumps", mesh)
    assert bpy.context.scene is not None
    bpy.context.scene.collection.objects.link(ground)
    return ground
