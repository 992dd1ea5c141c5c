# SPDX-License-Identifier: GPL-3.0-or-later
"""The same figures on the same floor in MuJoCo, for ``posing``: runs in an environment of its own.

Reads figures as JSON from standard input and writes seconds of each step to standard output.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import mujoco  # pyright: ignore[reportMissingImports]
import numpy as np


def main() -> None:
    """Measure every figure, with its joints as springs and with the three elements in series."""
    asked = json.load(sys.stdin)
    answer: dict[str, Any] = {"version": mujoco.__version__, "rows": []}
    for figure in asked["figures"]:
        for series in (False, True):
            model = mujoco.MjModel.from_xml_string(_scene(figure, series=series))
            data = mujoco.MjData(model)
            for _ in range(asked["settle"]):
                mujoco.mj_step(model, data)
            seconds = np.empty(asked["steps"])
            for index in range(asked["steps"]):
                start = time.perf_counter()
                mujoco.mj_step(model, data)
                seconds[index] = time.perf_counter() - start
            answer["rows"].append(
                {
                    "name": figure["name"],
                    "series": series,
                    "contacts": int(data.ncon),
                    "finite": bool(np.isfinite(data.qpos).all()),
                    "seconds": seconds.tolist(),
                }
            )
    json.dump(answer, sys.stdout)


def _scene(figure: dict[str, Any], *, series: bool) -> str:
    """A model of capsules; the Voigt part and the series damper as two joints where asked."""
    children: dict[int, list[int]] = {}
    for body, parent in enumerate(figure["parents"]):
        children.setdefault(parent, []).append(body)

    def numbers(values: list[float]) -> str:
        return " ".join(f"{value:.9g}" for value in values)

    def body_of(index: int) -> str:
        root = figure["parents"][index] < 0
        place = figure["root"] if root else figure["anchors"][index]
        stiffness, damping = figure["stiffness"], figure["damping"]
        spring = f'<joint type="ball" stiffness="{stiffness}" damping="{damping}"/>'
        joint = "<freejoint/>" if root else spring
        inner = "".join(body_of(child) for child in children.get(index, []))
        tensor = figure["inertias"][index]
        geom = (
            f'<inertial pos="{numbers(figure["centres"][index])}" mass="{figure["masses"][index]}"'
            f' diaginertia="{numbers([tensor[0][0], tensor[1][1], tensor[2][2]])}"/>'
            f'<geom type="capsule" size="{figure["radii"][index]}"'
            f' fromto="{numbers([x for end in figure["capsules"][index] for x in end])}"/>'
        )
        start = f'pos="{numbers(place)}" quat="{numbers(figure["rest"][index])}"'
        if root or not series:
            return f"<body {start}>{joint}{geom}{inner}</body>"
        # A speck between the two joints: MuJoCo needs some mass on each.
        speck = '<inertial pos="0 0 0" mass="1e-3" diaginertia="1e-5 1e-5 1e-5"/>'
        flow = f'<joint type="ball" damping="{figure["flow"]}"/>'
        return f"<body {start}>{spring}{speck}<body>{flow}{geom}{inner}</body></body>"

    return (
        '<mujoco><option timestep="0.001" integrator="implicitfast"/>'
        '<default><geom friction="0.6 0 0" condim="3" contype="1" conaffinity="2"/></default>'
        '<worldbody><geom type="plane" size="50 50 1" contype="2" conaffinity="1"/>'
        f"{body_of(0)}</worldbody></mujoco>"
    )


if __name__ == "__main__":
    main()
