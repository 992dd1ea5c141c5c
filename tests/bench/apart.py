# SPDX-License-Identifier: GPL-3.0-or-later
"""How far arms pass through each other and the body, with Keep Apart and without.

Each set-up of the add-on moves the default octopus along a curved route, on a plane and on bumps
of 0.3 arm lengths. Beside how deep arms overlap, in radii of the thinner one, stand the figures
that keeping them apart must not spoil, and what it costs.
"""

from __future__ import annotations

import argparse
import time
from typing import Any, Final

import numpy as np

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


def main(words: list[str]) -> None:
    """Measure what the command line asks for, and print a table."""
    import octo_motion
    from octo_motion.ui.locomotion.operators import setups

    parser = argparse.ArgumentParser(prog="python -m tests.bench apart", description=__doc__)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(setups.ORDER)}; all if none is")
    parser.add_argument("--route", choices=sorted(_ROUTES), default="curved", help="which way")
    parser.add_argument("--seeds", type=int, default=1, help="how many seeds, from 0; worst of all")
    arguments = parser.parse_args(words)
    octo_motion.register()
    try:
        print(f"{'':>20} │{'overlaps: deepest':^19}│{'share of frames':^19}│", end="")
        print(f"{'slip':^15}│{'turn':^15}│ seconds")
        columns = "".join(f"{'off':>{w}}{'on':>{w}} │" for w in (9, 9, 7, 7))
        print(f"{'set-up and ground':>20} │{columns}{'frames':>7}{'more':>6}")
        for name in arguments.names or setups.ORDER:
            for ground in GROUNDS:
                rows = [
                    _both(name, ground, arguments.route, seed) for seed in range(arguments.seeds)
                ]
                if rows[0]:
                    _show(f"{name}, {ground}", rows)
    finally:
        # Blender 4.5 does not end while an operator is registered.
        octo_motion.unregister()
    print(
        "\ndeepest: radii of the thinner arm; share of frames: where overlaps are deeper than"
        f" {_DEEP:g}"
        "\nslip: per cent of an arm's length; turn: degrees from one frame to the next"
        "\nmore: seconds that keeping apart adds"
    )


def _show(title: str, rows: list[tuple[Measured, ...]]) -> None:
    print(f"{title:>20} │", end="")
    for kind, form in (("deepest", "9.2f"), ("share", "8.1f"), ("slip", "7.2f"), ("turn", "7.1f")):
        for which in (0, 1):
            value = max(row[which][kind] for row in rows)
            print(f"{value:{form}}" + "%" * (kind == "share"), end="")
        print(" │", end="")
    more = [row[1]["seconds"] - row[0]["seconds"] for row in rows]
    print(f"{rows[0][0]['frames']:>7}{float(np.median(more)):>6.2f}", flush=True)


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
    start = time.process_time()
    for _ in shot.compute():
        pass
    seconds = time.process_time() - start
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
        "seconds": seconds,
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
