# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures after the figures of [Octopus], Ishizuka's thesis of 2008."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import contact_sheet
import numpy as np
import papers_shapes as paper
import shots
import stage
from stage import Colour, Pixels, Points

from octo_motion.core.rotations import from_axis_angle, rotate, shortest_arc
from tests.papers import octopus as figures
from tests.papers.source_loop import TABLES, SourceArm, angles

_ARM: Final[Colour] = (0.66, 0.30, 0.22)
_HEAD: Final[Colour] = (0.55, 0.20, 0.15)
_PALE: Final[Colour] = (0.93, 0.86, 0.80)
_PHASES: Final = 8
_UP: Final = np.array([0.0, 0.0, 1.0])


def spheres(_folder: Path, *, quick: bool) -> Pixels:
    """Fig. 3.1 and 3.2: an arm of spheres, and eight of them under a head, from above and aside."""
    paper.begin()
    arm = SourceArm()
    paper.spheres(paper.side_view(arm.joints), arm.diameters, _ARM)
    paper.text("3.1  one arm, n = 12", 2.8, 1.3, 0.42)
    for centre, tilt, title in ((13.5, 0.5 * np.pi, "from above"), (27.5, 0.16, "from the side")):
        turn, right = from_axis_angle([1.0, 0.0, 0.0], tilt), np.array([centre, 0.0, 0.0])
        for number in range(8):
            azimuth = from_axis_angle(_UP, np.radians(22.5 + 45.0 * number))
            joints = rotate(azimuth, arm.joints + np.array([0.9, 0.0, 0.0]))
            paper.spheres(_tilted(joints, turn) + right, arm.diameters, _ARM)
        head = np.array([[0.0, 0.0, 0.5], [0.0, 0.0, 1.5]])
        paper.spheres(_tilted(head, turn) + right, np.array([2.4, 3.2]), _HEAD)
        paper.text(f"3.2  eight arms, {title}", centre, -7.5, 0.5)
    return paper.end((-1.0, 35.0), (-8.2, 7.4), 900, quick=quick)


def _tilted(points: Points, turn: Points) -> Points:
    """Points of the world as they look from so far above, on the paper."""
    return paper.side_view(rotate(turn, points))


def ccd(_folder: Path, *, quick: bool) -> Pixels:
    """Fig. 3.3 and 3.4: what the last joint turns, then the one before, and after the sweep."""
    paper.begin()
    arm = SourceArm(count=6)
    arm.joints[:, 2] += 0.14 * np.arange(7.0) ** 2 * arm.length / 12.0
    steps = np.diff(arm.joints, axis=0)
    steps *= (arm.segments / np.linalg.norm(steps, axis=1))[:, None]
    arm.joints = np.concatenate([[np.zeros(3)], np.cumsum(steps, axis=0)])
    target = np.array([1.9, 0.0, -0.6])
    states = [arm.joints.copy()]
    states += [arm.joints.copy() for _ in arm.sweep(range(6), target, np.ones(6))]
    shown = (
        ("3.3  the last joint turns", states[0], 5),
        ("3.4  then the one before", states[1], 4),
        ("after the first", states[-1], None),
    )
    for number, (title, joints, turning) in enumerate(shown):
        right = np.array([4.0 * number, 0.0])
        flat = joints[:, [0, 2]] + right
        goal = target[[0, 2]] + right
        paper.line(flat, paper.INK, 0.045)
        paper.spheres(np.pad(flat, ((0, 0), (0, 1))), 0.2, paper.GREY)
        paper.spheres(np.append(goal, 2.0)[None], 0.22, paper.ORANGE)
        paper.text("A", goal[0] + 0.2, goal[1] - 0.2, 0.24)
        paper.text(title.replace("after the first", "after one sweep"), right[0] + 1.3, 1.75, 0.24)
        if turning is None:
            miss = np.linalg.norm(flat[-1] - goal) / arm.length
            paper.text(f"E = {100.0 * miss:.1f} % of the arm", right[0] + 1.3, -1.25, 0.2)
            continue
        paper.line([flat[turning], flat[-1]], paper.BLUE, 0.03, over=4.0)
        paper.line([flat[turning], goal], paper.RED, 0.03, over=4.0)
        paper.arc(flat[turning], flat[-1], goal, 0.36, paper.RED, 0.035)
        paper.text(f"P{turning}", flat[turning, 0] - 0.1, flat[turning, 1] + 0.27, 0.2)
        paper.text("P6", flat[-1, 0] + 0.22, flat[-1, 1] + 0.16, 0.2)
    return paper.end((-0.7, 11.3), (-1.6, 2.1), 900, quick=quick)


def targets(_folder: Path, *, quick: bool) -> Pixels:
    """Fig. 3.5: groups of joints, each at its own target; the source's loop, then ours."""
    paper.begin()
    phase = np.radians(240.0)
    asked = angles(TABLES["walk"], phase)
    source = SourceArm()
    for at in np.linspace(0.0, phase, 33):
        source.solve(source.targets(angles(TABLES["walk"], at)), np.ones(12))
    goals = source.targets(asked)
    directions, _ = figures.ours_played("walk", frames=240, **figures.OFF)
    ours = _joints(directions[160], source)
    for number, (title, joints) in enumerate(
        (("the source's loop", source.joints), ("ours", ours))
    ):
        right = np.array([6.2 * number, 0.0, 0.0])
        _grouped(joints, source, right, thin=0.6)
        places = paper.side_view(goals) + right
        paper.line(places, paper.INK, 0.035)
        paper.spheres(places + np.array([0.0, 0.0, 3.0]), 0.24, paper.ORANGE)
        beside = ((-0.1, 0.55), (-0.75, -0.1), (-0.2, 0.55), (0.5, 0.25))
        names = zip(("Q₀", "Q₁", "Q₂", "Q₃"), places, beside, strict=True)
        for name, place, (x, y) in names:
            paper.text(name, place[0] + x, place[1] + y, 0.34)
        paper.text(f"3.5  {title}, phase 240°", right[0] + 1.7, 1.35, 0.34)
    return paper.end((-1.0, 11.0), (-2.7, 1.8), 800, quick=quick)


def _joints(directions: Points, build: SourceArm) -> Points:
    """P₀ … Pₙ of an arm as long as the source's."""
    steps = build.segments[:, None] * directions
    return np.concatenate([[np.zeros(3)], np.cumsum(steps, axis=0)])


def _grouped(joints: Points, build: SourceArm, shift: Points, thin: float = 1.0) -> None:
    """An arm whose groups of joints have colours of their own, perhaps thinner than it is."""
    sizes = thin * build.diameters
    places = paper.side_view(joints) + shift
    third = build.count // 3
    # P₁ … belong to the groups; P₀ stays where it is.
    paper.spheres(places[:1], sizes[:1], paper.GREY)
    for group, colour in enumerate(paper.GROUPS):
        own = slice(1 + group * third, 1 + (group + 1) * third)
        paper.spheres(places[own], sizes[own], colour)


def phases(_folder: Path, *, quick: bool) -> Pixels:
    """Fig. 3.6 and 3.7: one arm through a cycle, by the source's loop and by ours."""
    paper.begin()
    build = SourceArm()
    apart, row = 7.0, 0.0
    rows: list[tuple[str, Points]] = []
    for gait, figure in (("walk", "3.6"), ("swim", "3.7")):
        source = figures.source_played(gait, (1.0,))[0]
        ours = figures.ours_played(gait, **figures.OFFERED)[0]
        rows += [(f"{figure}  {gait}, the source's loop", source), (f"{gait}, ours", ours)]
    for title, directions in rows:
        paper.text(title, -1.5, row + 2.9, 0.7, align="LEFT")
        for number in range(_PHASES):
            frame = number * figures.CYCLE // _PHASES
            joints = _joints(directions[frame], build)
            _grouped(joints, build, np.array([apart * number, row, 0.0]))
            if row == 0.0:
                paper.text(f"{360 * number // _PHASES}°", apart * number + 2.0, row + 1.8, 0.6)
        row -= 8.2
    return paper.end((-2.0, apart * _PHASES + 0.2), (row + 1.8, 4.0), 960, quick=quick)


def weights(_folder: Path, *, quick: bool) -> Pixels:
    """The thesis' weights a of joints [eq. 3.7]: by its own loop, and by ours."""
    paper.begin()
    build = SourceArm()
    apart, row = 6.4, 0.0
    frames = (9, 18, 27, 36)
    for way, title in enumerate(("the source's loop", "ours")):
        for place, (name, ends) in enumerate(figures.PROFILES.items()):
            colour = paper.GROUPS[place]
            if way == 0:
                played = figures.source_played("walk", ends)[0]
                paper.text(name, 7.5 + 6.0 * place, 2.7, 0.6, colour)
            else:
                played = figures.ours_played("walk", ends, **figures.OFFERED)[0]
            for number, frame in enumerate(frames):
                shift = np.array([apart * number, row, 0.3 * place])
                shown = paper.side_view(_joints(played[frame], build)) + shift
                paper.line(shown, colour, 0.13, over=1.0 + place)
                paper.spheres(shown, 0.26, colour)
        for number, frame in enumerate(frames):
            degrees = f"{360 * frame / figures.CYCLE:.0f}°"
            paper.text(degrees, apart * number + 4.2, row + 0.9, 0.5)
        paper.text(title, -0.8, row + 2.7, 0.6, align="LEFT")
        row -= 5.8
    return paper.end((-1.2, apart * len(frames)), (row + 1.6, 3.4), 900, quick=quick)


def suckers(_folder: Path, *, quick: bool) -> Pixels:
    """§4.2, the thesis' first open problem: which way the suckers face, then and now."""
    paper.begin()
    build = SourceArm()
    cycles = (1, 3, 6)
    source: dict[int, tuple[Points, Points]] = {}
    for number, arm in enumerate(figures.source_twisted(max(cycles))):
        if number % figures.CYCLE == 6 and number // figures.CYCLE + 1 in cycles:
            source[number // figures.CYCLE + 1] = arm.joints.copy(), -arm.turned[:, :, 2]
    for column, cycle in enumerate(cycles):
        joints, down = source[cycle]
        ours = joints, _untwisted(joints)
        for row, (title, (places, ways)) in enumerate(
            (("the source's loop", (joints, down)), ("ours", ours))
        ):
            shift = np.array([6.6 * column, -4.0 * row, 0.0])
            # From aside and a little from below, so that what faces down is seen.
            turn = from_axis_angle([1.0, 0.0, 0.0], np.radians(-25.0))
            shown = _tilted(places, turn) + shift
            facing = _tilted(ways, turn)
            paper.spheres(shown[:-1], build.diameters[:-1], _ARM, (_PALE, facing))
            if column == 0:
                paper.text(title, -0.8, shift[1] + 1.7, 0.42, align="LEFT")
            if row == 0:
                paper.text(f"cycle {cycle}", shift[0] + 3.8, shift[1] + 1.7, 0.42)
    return paper.end((-1.2, 19.2), (-6.6, 2.3), 900, quick=quick)


def _untwisted(joints: Points) -> Points:
    """Where suckers face (segments, 3) that are carried along an arm without any twist."""
    along, down = np.array([1.0, 0.0, 0.0]), -_UP
    found = []
    for step in np.diff(joints, axis=0):
        direction = step / np.linalg.norm(step)
        down = rotate(shortest_arc(along, direction), down)
        along = direction
        found.append(down)
    return np.array(found)


# --- The octopus as a whole ----------------------------------------------------------------------


WALK_POSES: Final = tuple(f"4.{number}  walk {number}" for number in range(1, 8))
SWIM_POSES: Final = (
    "4.8  arms raised",
    "4.9  arms beat down",
    "4.10  streamlined",
    "4.11  roots raised",
)
"""The thesis' names of its key poses."""
SWIM_PHASES: Final = (2, 3, 4, 6)
"""Eighths of a cycle at which the table has them: β₁ is highest at 90°, falls until 180°, where the
arm is stretched, and rises again with the other links still trailing."""
_CELL: Final = (176, 150)


def as_published(settings: Any) -> None:
    """The thesis' arm: none of what is ours."""
    for name in ("softness", "sway", "give", "steady", "burst", "bank_in_turns", "breathing"):
        setattr(settings, name, 0.0)
    settings.stand = settings.keep_apart = settings.ground.use = False
    # Evenly along the route, so that moments of both rows are the same phases.
    settings.speed_mode = "EVEN"


def key_poses(gait: str, *, published: bool, quick: bool) -> list[Pixels]:
    """The thesis' key poses of a gait."""
    cell = (48, 40) if quick else _CELL
    shot = shots.BY_NAME[gait]
    performance = shots.perform(shot, cell, as_published if published else lambda _: None)
    way = "as published" if published else "ours"
    if gait == "walk":
        names, moments = WALK_POSES, np.arange(7) / 7.0
    else:
        names, moments = SWIM_POSES, np.array(SWIM_PHASES) / 8.0
    if quick:
        names, moments = names[:2], moments[:2]
    view = contact_sheet.View("side", np.radians(12.0))
    notes = [f"{name}, {way}" for name in names]
    return contact_sheet.pictures_at(performance, view, cell, moments, notes)


def walk(_folder: Path, *, quick: bool) -> Pixels:
    """Fig. 4.1 to 4.7: seven moments of a walk, as published and ours."""
    return _both("walk", quick=quick)


def swim(_folder: Path, *, quick: bool) -> Pixels:
    """Fig. 4.8 to 4.11: the key poses of a swim, as published and ours."""
    return _both("swim", quick=quick)


def _both(gait: str, *, quick: bool) -> Pixels:
    rows = [key_poses(gait, published=published, quick=quick) for published in (True, False)]
    return contact_sheet.joined(rows)


def change(_folder: Path, *, quick: bool) -> Pixels:
    """§4.2, the thesis' second open problem: from walking to swimming."""
    size = (96, 64) if quick else (900, 400)
    octopus = figures.changing_octopus()
    scene = stage.the_scene()
    stage.set_light(scene)
    first, last = scene.frame_start, scene.frame_end
    shown = np.linspace(first, last, 2 if quick else 6)
    points = stage.skin_points(octopus, shown)
    stage.add_ground(points, 0.0, margin=0.3)
    camera = stage.add_camera("Camera", lens=60.0)
    stage.set_resolution(*size)
    stage.look(camera, np.array([0.1, 0.95, -0.28]), _UP)
    stage.frame_points(camera, points, margin=0.02)
    for frame in shown:
        stage.go_to(float(frame))
        stage.leave_copy(octopus)
    for child in octopus.children:
        child.hide_render = True
    return stage.render_pixels(*size)
