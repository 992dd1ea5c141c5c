# SPDX-License-Identifier: GPL-3.0-or-later
"""[Plastic] in numbers: the three elements, the solver, a doll that is bent, twisted, pushed."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from typing import Any, Final

import bpy
import numpy as np

from octo_motion.core.posing.puppet.figure import Elements
from octo_motion.core.posing.puppet.plastic_element import PlasticLaw
from octo_motion.core.posing.solver.newton import Newton
from octo_motion.core.posing.solver.world import World, WorldSettings
from octo_motion.core.rotations import Floats, from_axis_angle
from tests.core.oracles import gauss_seidel
from tests.core.puppets import doll, posed, soft

# --- The three elements [fig. 5] -----------------------------------------------------------------


MASS, K_F, D_F, D_D = 0.1, 1.0, 10.0, 100.0
STEP: Final = 0.02
"""The paper's h, with its other numbers above."""
FORCE, LOADED, LASTS = 1.0, 5.0, 20.0
"""Newton and seconds, which the paper does not say, and seconds that are looked at."""
STEPS: Final = (STEP, 0.1, 0.5)


def force(times: Floats) -> Floats:
    """Newton, at times."""
    return np.where(times <= LOADED + 1e-9, FORCE, 0.0)


def closed_form(times: Floats) -> tuple[Floats, Floats]:
    """Displacement and velocity at times, worked out without steps.

    With q of the spring, q' = (D_d v − K q)/S and m v' = F − D_d (v − q'), S = D_d + D_f: linear
    with a constant force, so a sum of exponentials before the force ends, and another one after.
    """
    total = D_D + D_F
    rates = np.array(
        [[-D_D * D_F / (MASS * total), -D_D * K_F / (MASS * total)], [D_D / total, -K_F / total]]
    )
    values, vectors = np.linalg.eig(rates)

    def played(start: Floats, pushed: float, seconds: Floats) -> Floats:
        """x, v and q (3, times) from those at the start."""
        rest = np.linalg.solve(rates, [-pushed / MASS, 0.0])
        shares = np.linalg.solve(vectors, start[1:] - rest)
        decay = np.exp(values[:, None] * seconds)
        grown = (decay - 1.0) / values[:, None]
        speeds = rest[:, None] + vectors @ (shares[:, None] * decay)
        moved = start[0] + rest[0] * seconds + vectors[0] @ (shares[:, None] * grown)
        return np.real(np.concatenate([moved[None], speeds]))

    loaded = played(np.zeros(3), FORCE, np.minimum(times, LOADED))
    turn = played(np.zeros(3), FORCE, np.array([LOADED]))[:, 0]
    after = played(turn, 0.0, np.maximum(times - LOADED, 0.0))
    both = np.where(times <= LOADED, loaded, after)
    return both[0], both[1]


def stepped(step: float, lasts: float = LASTS) -> tuple[Floats, Floats, Floats, Floats]:
    """Times, displacement, velocity and the spring's q_f by the extension's element in steps."""
    axis = np.array([[1.0, 0.0, 0.0]])
    law = PlasticLaw(Elements(*(np.array([each]) for each in (K_F, D_F, D_D, 0.0))), step)
    count = round(lasts / step)
    moved = speed = spring = 0.0
    rows = [(0.0, 0.0, 0.0, 0.0)]
    for number in range(count):
        pushed = float(force(np.array((number + 0.5) * step)))
        answer = law.respond(law.at_rest(spring * axis), speed * axis)
        speed += step * (pushed + answer.load[0, 0]) / (MASS + step * answer.slope[0, 0, 0])
        answer = law.respond(law.at_rest(spring * axis), speed * axis)
        flow = 0.0 if answer.flows is None else float(answer.flows_with()[0, 0])
        spring += step * (speed - flow)
        moved += step * speed
        rows.append(((number + 1) * step, moved, speed, spring))
    times, x, v, q = np.array(rows).T
    return times, x, v, q


def element(*, quick: bool = False) -> Any:
    """How far the displacement by steps is from the closed form, by step."""
    rows = []
    for step in STEPS[: 1 if quick else None]:
        times, moved, _, _ = stepped(step)
        off = np.abs(moved - closed_form(times)[0])
        rows.append({"step": step, "most": 1000.0 * float(off.max())})
    top, end, later = (float(closed_form(np.array([at]))[0][0]) for at in (LOADED, LASTS, 1e4))
    return {"rows": rows, "top": top, "end": end, "residue": later}


def element_text(found: Any) -> str:
    """The table."""
    return "\n".join(
        [
            f"{'h, s':>6}{'largest error of x, mm':>26}{'of the rise':>14}",
            *(
                f"{row['step']:>6g}{row['most']:>26.3f}"
                f"{100.0 * row['most'] / (1000.0 * found['top']):>12.2f} %"
                for row in found["rows"]
            ),
        ]
    )


def element_told(found: Any) -> str:
    """What the row says."""
    first = found["rows"][0]
    return (
        f"{FORCE:g} N for {LOADED:g} s moves it by {found['top']:.3f} m; "
        f"{LASTS - LOADED:g} s later it is back to {found['end']:.3f} m, and "
        f"{found['residue']:.3f} m stay for good. With the paper's h = {STEP:g} s it is "
        f"{first['most']:.2f} mm off the closed form at most, and less with a smaller h"
    )


# --- The solver [§4.1, §4.2] ---------------------------------------------------------------------


_ELEMENTS: Final = (5.0, 0.5, 5.0)
"""K_f, D_f and D_d of every joint of the doll, for turning: N·m/rad and N·m·s/rad."""
_SWEEPS: Final = (5, 20, 80)
_DRAGGED: Final = 60
"""Steps of a drag, of which the last are compared."""
_COMPARED: Final = 10


def solver(*, quick: bool = False) -> Any:
    """Error of the velocities by Gauss–Seidel, cold and warm, and by ours, as a doll is dragged."""
    # As the paper has it, without a threshold.
    figure = doll(soft(20, *_ELEMENTS, 0.0))
    world = World(figure, posed(figure), WorldSettings(step=4e-3))
    world.pin(0)
    hand = 8
    at = world.pose().positions[hand].copy()
    grab = world.grab(hand, at)
    exact = Newton(world._tree, tolerance=1e-12, iterations=200)
    counts = _SWEEPS[:1] if quick else _SWEEPS
    kept: dict[int, list[Floats]] = {count: [] for count in counts}
    errors: dict[tuple[int, str], list[float]] = {}
    taken: dict[str, list[float]] = {"ours": [], "systems": [], "seconds": [], "sweep": []}
    for number in range(_DRAGGED):
        grab.pull(at + number / _DRAGGED * np.array([-0.2, 0.3, 0.2]))
        problem, start = world.problem()
        wanted = exact.solve(problem, start).velocities
        scale = np.abs(wanted).max()
        compared = number >= _DRAGGED - (2 if quick else _COMPARED)
        # Warm impulses have to come from a step before that was solved as well.
        for count in counts if number >= _DRAGGED - _COMPARED - 5 else ():
            for way in ("cold", "warm"):
                began = time.perf_counter()
                slow = gauss_seidel.solve(
                    problem,
                    figure.parents,
                    sweeps=count,
                    tolerance=0.0,
                    start=kept[count] if way == "warm" else (),
                )
                taken["sweep"].append((time.perf_counter() - began) / count)
                if way == "warm":
                    kept[count] = slow.impulses
                if compared:
                    off = float(np.abs(slow.velocities - wanted).max() / scale)
                    errors.setdefault((count, way), []).append(off)
        began = time.perf_counter()
        world.step()
        taken["seconds"].append(time.perf_counter() - began)
        assert world.last is not None
        taken["systems"].append(world.last.iterations)
        if compared:
            taken["ours"].append(float(np.abs(world.last.velocities - wanted).max() / scale))
    return {
        "bodies": len(figure),
        "rows": [
            {"sweeps": count, **{way: _mean(errors[count, way]) for way in ("cold", "warm")}}
            for count in counts
        ],
        "ours": _mean(taken["ours"]),
        "systems": _mean(taken["systems"]),
        "milliseconds": 1000.0 * float(np.median(taken["seconds"])),
        "sweep": 1000.0 * float(np.median(taken["sweep"])),
    }


def _mean(values: list[float]) -> float:
    return float(np.mean(values))


def solver_text(found: Any) -> str:
    """The table."""
    return "\n".join(
        [
            f"{'':<22}{'cold':>10}{'warm':>10}",
            *(
                f"{'Gauss–Seidel, ' + str(row['sweeps']) + ' sweeps':<22}"
                f"{100.0 * row['cold']:>8.2f} %{100.0 * row['warm']:>8.2f} %"
                for row in found["rows"]
            ),
            f"{'ours':<22}{'':>10}{100.0 * found['ours']:>8.3f} %",
            "",
            "error of the fastest velocity, mean over steps; warm: from the impulses of the step",
            f"  before. A doll of {found['bodies']} bodies, pinned, dragged by a hand, h = 4 ms",
        ]
    )


def solver_told(found: Any) -> str:
    """What the row says."""
    last = found["rows"][-1]
    return (
        f"after {last['sweeps']} sweeps Gauss–Seidel is {100.0 * last['cold']:.2f} % off when it "
        f"starts cold, {100.0 * last['warm']:.2f} % warm; ours is {100.0 * found['ours']:.3f} % "
        f"off after {found['systems']:.1f} linear systems, in {found['milliseconds']:.1f} ms a step"
    )


# --- A doll, bent, twisted and pushed [§3, §5.2, §6] ---------------------------------------------


TICK: Final = 1.0 / 60.0
_BOX: Final = (0.62, -0.06, 0.56)
_HALF: Final = 0.13
_SAMPLES: Final = 12
Take = Callable[[str], None]
"""Is told when something is worth a picture."""


def doll_in_blender() -> Any:
    """The doll of the guide's pictures in an empty file, with a box below its left hand."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    figure: Any = importlib.import_module("puppets").make_doll()
    figure.show_in_front = False
    settings = figure.octo_motion.posing
    settings.material = "DOLL"
    bpy.ops.mesh.primitive_cube_add(size=2.0 * _HALF, location=_BOX)
    box: Any = bpy.context.object
    box.octo_motion.posing.obstacle = "BOX"
    bpy.context.view_layer.objects.active = figure
    return figure


def dragged(
    figure: Any,
    bone: str,
    way: tuple[float, float, float],
    *,
    turn: float = 0.0,
    obstacles: bool = True,
    seconds: float = 1.0,
    pulled: Callable[[], None] = lambda: None,
) -> Any:
    """Rows (share of the way, N, N·m) of a drag at the end of a bone, and degrees that are kept.

    It ends as it began: the figure is put back.
    """
    session_type = importlib.import_module("octo_motion.ui.posing.puppet_session").PuppetSession
    figure.octo_motion.posing.use_obstacles = obstacles
    session = session_type(figure, bpy.context.scene, clock=None)
    body = session.body(bone)
    start = session.grab_bone(bone, 1.0)
    before = session.core.pose.orientations[body].copy()
    axis = session.core.pose.positions[body] - start
    count = round(seconds / TICK)
    rows = []
    most = 0.0
    for tick in range(1, count + 1):
        share = tick / count
        hand = start + share * np.array(way)
        session.tick(TICK, hand, from_axis_angle(axis, np.radians(share * turn)))
        held = session.held
        rows.append((share, *(float(np.linalg.norm(held.wrench[part])) for part in _PARTS)))
        most = max(most, _between(before, session.core.pose.orientations[body]))
    pulled()
    session.release()
    for _ in range(60):
        session.tick(TICK)
    kept = _between(before, session.core.pose.orientations[body])
    session.cancel()
    return {"rows": rows[:: max(1, count // _SAMPLES)], "most": most, "kept": kept}


_PARTS: Final = (slice(0, 3), slice(3, 6))


def _between(first: Floats, second: Floats) -> float:
    return float(np.degrees(2.0 * np.arccos(min(1.0, abs(float(first @ second))))))


DRAGS: Final[dict[str, dict[str, Any]]] = {
    "bent": {"bone": "hand.L", "way": (0.1, -0.2, 0.48), "obstacles": False},
    "twisted": {"bone": "chest", "way": (0.0, 0.0, 0.0), "turn": 60.0, "obstacles": False},
    "pushed into a box": {"bone": "hand.L", "way": (0.0, 0.0, -0.3)},
    "pushed, no box": {"bone": "hand.L", "way": (0.0, 0.0, -0.3), "obstacles": False},
}


def puppet(*, quick: bool = False) -> Any:
    """Forces and torques on the hand, by drag."""
    figure = doll_in_blender()
    names = list(DRAGS)[:2] if quick else list(DRAGS)
    return {name: dragged(figure, **DRAGS[name]) for name in names}


def puppet_text(found: Any) -> str:
    """The table."""
    lines = [f"{'':<20}{'force, N':>10}{'torque, N·m':>13}{'turned':>9}{'kept':>7}"]
    for name, drag in found.items():
        newton, torque = (max(row[part] for row in drag["rows"]) for part in (1, 2))
        lines.append(
            f"{name:<20}{newton:>10.0f}{torque:>13.1f}{drag['most']:>8.0f}°{drag['kept']:>6.0f}°"
        )
    lines += [
        "",
        "force, torque: on the bone in the hand, at most, in the doll's own newtons: it is as",
        "  heavy as a person; turned: of that bone at most; kept: a second after it was let go",
    ]
    return "\n".join(lines)


def puppet_told(found: Any) -> str:
    """What the row says."""
    said = []
    if "pushed into a box" in found:
        box, free = (
            max(row[1] for row in found[name]["rows"])
            for name in ("pushed into a box", "pushed, no box")
        )
        said.append(
            f"the hand that presses into the box is met by {box:.0f} N, by {free:.0f} without it"
        )
    twisted = max(row[2] for row in found["twisted"]["rows"])
    said.append(
        f"twist is met by {twisted:.1f} N·m; of {found['bent']['most']:.0f}° bent "
        f"{found['bent']['kept']:.0f}° stay"
    )
    return "; ".join(said)
