# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures after the figures of [Splice], Takebayashi, Nishio and Kobori."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import bpy
import contact_sheet
import experiment
import figures as bodies
import numpy as np
import papers_shapes as paper
import stage
from stage import Colour, Pixels, Points

from octo_motion.core.rotations import from_axis_angle, rotate
from tests.bench import splicing
from tests.bench.splice_joints import joints_at
from tests.papers import splices as figures
from tests.referee import clip_measures as measures

_STEPS: Final = (
    ("1", "choose the part", "Add Splice: Part"),
    ("2", "choose when it begins, in both clips", "Drag Timing, Suggest Timing"),
    ("3", "splice", "Build Splices"),
    ("4", "not yet right: 2 and 3 again", "Drag Timing: seen at once"),
    ("5", "another part: the result is the base", "Add Splice: the next in the list"),
)
"""Of the paper's figure 1, and what they are with us."""
_LIMBS: Final = (
    ("head", "neck", "spine", "hips"),
    *(
        chain
        for side in measures.SIDES
        for chain in (
            ("neck", f"{side}_shoulder", f"{side}_elbow", f"{side}_hand"),
            ("hips", f"{side}_thigh", f"{side}_knee", f"{side}_foot"),
        )
    ),
)
_PARTS: Final = (
    ("RIGHT_ARM", "throw", ("arm.R",)),
    ("LEFT_ARM", "punch", ("arm.L",)),
    ("LEGS", "dance", ("leg.L", "leg.R")),
    ("TRUNK", "throw", ("trunk",)),
    ("HEAD", "dance", ("head",)),
)
"""The paper's five parts, the clips that they come from here, and what is coloured."""


def steps(_folder: Path, *, quick: bool) -> Pixels:
    """Fig. 1: the order of the work, and the buttons for it."""
    paper.begin()
    for row, (number, theirs, ours) in enumerate(_STEPS):
        y = -1.2 * row
        corners = np.array([(0.0, -0.4), (6.6, -0.4), (6.6, 0.4), (0.0, 0.4), (0.0, -0.4)])
        paper.line(corners + np.array([0.0, y]), paper.INK, 0.03)
        paper.text(number, 0.35, y, 0.36, paper.RED)
        paper.text(theirs, 0.75, y, 0.28, align="LEFT")
        paper.text(ours, 8.2, y, 0.28, paper.BLUE, "LEFT")
        if row < len(_STEPS) - 1:
            paper.arrow(np.array([3.3, y - 0.4]), np.array([3.3, y - 0.8]), paper.INK, 0.03)
    for start, end, aside in ((-3.6, -1.2, 7.2), (-4.8, 0.0, 7.7)):
        paper.line(
            [np.array(each) for each in ((6.6, start), (aside, start), (aside, end))],
            paper.FAINT,
            0.03,
        )
        paper.arrow(np.array([aside, end]), np.array([6.6, end]), paper.FAINT, 0.03)
    paper.text("fig. 1  in the paper", 0.0, 0.8, 0.3, align="LEFT")
    paper.text("here", 8.2, 0.8, 0.3, paper.BLUE, "LEFT")
    return paper.end((-0.3, 13.2), (-5.5, 1.2), 800, quick=quick)


def two_stage(folder: Path, *, quick: bool) -> Pixels:
    """Fig. 2: features from the chest's centre, restored places, and the two triangles."""
    clips = figures.made_clips(folder)
    base, other = (splicing.read_take(clips[name]) for name in ("walk", "throw"))
    before = _joints(base, 12.0, 0.0)
    theirs = _joints(other, 24.0, -25.0)
    paper.begin()
    axes = {name: _chest(each) for name, each in (("base", before), ("clip", theirs))}
    seen = {
        joint: axes["clip"][1].T @ (theirs[f"right_{joint}"] - axes["clip"][0])
        for joint in ("elbow", "hand")
    }
    restored = {
        joint: axes["base"][0] + axes["base"][1] @ feature for joint, feature in seen.items()
    }
    shoulder = before["right_shoulder"]
    hanging = {
        joint: shoulder + theirs[f"right_{joint}"] - theirs["right_shoulder"]
        for joint in ("elbow", "hand")
    }
    for column, (title, joints) in enumerate(
        (("2(a)  features", theirs), ("2(b)  restored", before), ("2(c)  triangles", before))
    ):
        shift = np.array([1.9 * column, 0.0])
        _stick(joints, shift, skip="right_elbow" if column else "")
        paper.text(title, 1.9 * column, 1.95, 0.12)
        centre, flat = axes["base" if column else "clip"][0], _flat
        places = restored if column else {key: theirs[f"right_{key}"] for key in seen}
        if column < 2:
            paper.spheres(_deep(flat(centre) + shift), 0.07, paper.ORANGE)
            for place in places.values():
                paper.arrow(flat(centre) + shift, flat(place) + shift, paper.ORANGE, 0.012)
        else:
            for chain, colour in ((hanging, paper.FAINT), (restored, paper.RED)):
                corners = [shoulder, chain["elbow"], chain["hand"], shoulder]
                paper.line([flat(each) + shift for each in corners], colour, 0.016)
                normal = np.cross(chain["elbow"] - shoulder, chain["hand"] - chain["elbow"])
                normal *= 0.35 / np.linalg.norm(normal)
                middle = np.mean(corners[:3], axis=0)
                paper.arrow(flat(middle) + shift, flat(middle + normal) + shift, colour, 0.01)
        for place in places.values():
            paper.spheres(_deep(flat(place) + shift), 0.06, paper.RED if column else paper.BLUE)
    paper.text("grey: attached without turning", 3.8, -0.12, 0.09)
    paper.text("red: restored; arrows: normals", 3.8, -0.27, 0.09)
    return paper.end((-0.95, 4.9), (-0.4, 2.15), 840, quick=quick)


def _joints(take: splicing.Take, frame: float, degrees: float) -> dict[str, Points]:
    """Joints (3,) at a frame, about the hips' place on the ground, turned about the vertical."""
    found = joints_at(take.clip, take.landmarks, np.array([frame]))
    turn = from_axis_angle([0.0, 0.0, 1.0], np.radians(degrees))
    centre = found["hips"][0] * [1.0, 1.0, 0.0]
    return {name: rotate(turn, place[0] - centre) for name, place in found.items()}


def _chest(joints: dict[str, Points]) -> tuple[Points, Points]:
    """The chest's centre (3,) and its axes as columns."""
    axes = measures.chest({name: place[None] for name, place in joints.items()})[0]
    shoulders = 0.5 * (joints["left_shoulder"] + joints["right_shoulder"])
    return 0.5 * (shoulders + joints["spine"]), np.asarray(axes, dtype=np.float64)


def _flat(point: Points) -> Points:
    """A place (3,) as it is seen from the front, somewhat from the right and above."""
    turned = rotate(from_axis_angle([0.0, 0.0, 1.0], np.radians(30.0)), point)
    turned = rotate(from_axis_angle([1.0, 0.0, 0.0], np.radians(10.0)), turned)
    # Seen along +Y: the figure faces the reader.
    return turned[[0, 2]]


def _deep(flat: Points) -> Points:
    return np.append(flat, 4.0)[None]


def _stick(joints: dict[str, Points], shift: Points, skip: str) -> None:
    """A person of lines; of a limb with the joint that is named nothing."""
    for chain in _LIMBS:
        if skip not in chain:
            colour = paper.BLUE if "right_elbow" in chain else paper.INK
            shown = chain[1:] if "right_elbow" in chain else chain
            paper.line([_flat(joints[name]) + shift for name in shown], colour, 0.02)
    paper.spheres(_deep(_flat(joints["head"]) + np.array([0.0, 0.08]) + shift), 0.2, paper.GREY)


def timings(folder: Path, *, quick: bool) -> Pixels:
    """Fig. 3 to 5: a walk, a right arm that turns, a punch of the left, and two results."""
    made, recorded = figures.made_clips(folder), figures.recorded_clips()
    clips = {**made, **recorded}
    # Nobody has recorded a turning arm here.
    chosen = experiment.Clips(clips["walk"], made["turn"], clips["punch"])
    return experiment.sheet(chosen, (30, 38) if quick else (110, 150), 2 if quick else 8)


def parts(_folder: Path, *, quick: bool) -> Pixels:
    """§2: all five parts, a row of poses each; what is spliced is orange."""
    cell, columns = ((30, 38), 2) if quick else ((110, 150), 8)
    rows: list[Sequence[Pixels]] = []
    for part, source, coloured in _PARTS[: 1 if quick else None]:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        stage.the_scene().render.fps = 30
        walker, giver = (
            experiment.imported(figures.CLIPS / f"{name}.bvh") for name in ("walk", source)
        )
        colours: dict[str, Colour] = dict.fromkeys(coloured, paper.ORANGE)
        bodies.dress(walker, colours, experiment.PLAIN)
        bodies.dress(giver, colours, experiment.PLAIN)
        experiment.select(walker)
        bpy.ops.octo_motion.splice_add(part=part, source=giver.name)
        walker.octo_motion.splicing.splices[0].base_start = 10.0
        bpy.ops.octo_motion.splice_build()
        result: Any = walker.octo_motion.splicing.result
        experiment.prepare_stage()
        first, last = 10.0, 10.0 + min(experiment.span(giver)[1], 70.0)
        shown = tuple(np.linspace(first, last, columns).tolist())
        name = f"{part.lower().replace('_', ' ')}: {source}"
        row = experiment.Row(name, walker.name, result.name, shown)
        rows.append(experiment.row_pixels(row, cell))
    return contact_sheet.joined(rows)
