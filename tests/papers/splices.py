# SPDX-License-Identifier: GPL-3.0-or-later
"""[Splice] in numbers: copying, upper on lower bodies, and ours, judged by joints alone."""

from __future__ import annotations

import importlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from octo_motion.core.rotations import Floats
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.clip.splice_timing import Timing, splice_window
from octo_motion.core.splicing.humanoid.landmarks import Landmarks
from octo_motion.core.splicing.transfer.parts import PARTS
from octo_motion.core.splicing.transfer.retarget import MappedClip
from octo_motion.core.splicing.transfer.splice import Splice
from octo_motion.core.splicing.transfer.timing_suggestions import suggest_timings
from tests.bench import splicing
from tests.bench.plain_copy import plain_copy
from tests.bench.splice_joints import joints_at
from tests.core.splice_bodies import spliced
from tests.papers.upper_lower import upper_on_lower, warped_moments
from tests.referee import clip_measures as measures

CLIPS: Final = Path(__file__).resolve().parents[2] / "docs" / "examples" / "clips"
PART: Final = "right_arm"
_EASE: Final = 0.2
"""Seconds."""
_CHOSEN: Final = 0.55
"""Seconds into the walk, half a cycle, at which somebody who wants it there lets the arm begin."""
TIMINGS: Final = ("none", "suggested", "chosen")
WAYS: Final = ("copied", "upper on lower", "ours")


def made_clips(folder: Path) -> dict[str, Path]:
    """The project's own clips by name, with a right arm that turns: standing, and walking half a
    step later than the walk.
    """
    performers = importlib.import_module("performers")
    walking = performers.turn(performers.walk(3.55))
    late = round(_CHOSEN * performers.RATE)
    walking.times = walking.times[:-late]
    walking.hips = walking.hips[late:]
    arm = {name: turns for name, turns in walking.turns.items() if name.startswith("RightArm")}
    walking.turns = {name: turns[late:] for name, turns in walking.turns.items()}
    walking.turns |= {name: turns[:-late] for name, turns in arm.items()}
    found = {path.stem: path for path in CLIPS.glob("*.bvh")}
    for name, acting in (("turn", performers.turn()), ("turn walking", walking)):
        found[name] = folder / f"{name}.bvh"
        found[name].write_text(performers.bvh(acting, performers.ADULT), encoding="utf-8")
    return found


def recorded_clips() -> dict[str, Path]:
    """Recorded ones, if they are here."""
    folder = Path(os.environ.get("OCTO_MOTION_DATA", "")) / "secondlife"
    names = {"walk": "walk", "throw": "throw_R", "punch": "punch_L", "hello": "hello"}
    found = {name: folder / f"avatar_{file}.bvh" for name, file in names.items()}
    return found if all(path.is_file() for path in found.values()) else {}


def ways(*, quick: bool = False) -> Any:
    """How far the arm is off its clip, how far the rest of the upper body is off the base, and how
    far the clip's legs are from the base's, by clip, way and timing; degrees.
    """
    rows = []
    with tempfile.TemporaryDirectory(prefix="octo-motion-") as folder:
        files = made_clips(Path(folder))
        sets = [(files["walk"], {name: files[name] for name in ("turn walking", "turn", "dance")})]
        if (recorded := recorded_clips()) and not quick:
            base = recorded.pop("walk")
            del recorded["punch"]
            sets.append((base, {f"{name}, recorded": path for name, path in recorded.items()}))
        for base, clips in sets:
            for name, path in list(clips.items())[: 1 if quick else None]:
                rows += _compared(name, splicing.read_take(base), splicing.read_take(path))
    return {"rows": rows}


def _compared(name: str, base: splicing.Take, other: splicing.Take) -> list[dict[str, Any]]:
    clip, marks = other.clip, other.landmarks
    lasts = (len(clip) - 1) / clip.rate
    whole = splicing.lengthened(base.clip, lasts + 1.2)
    rows = []
    for timed in TIMINGS:
        start = float(whole.frames[0])
        usual = Timing(start, float(clip.frames[0]), length=lasts * whole.rate - 1.0)
        if timed == "chosen":
            start += _CHOSEN * whole.rate
        if timed == "suggested":
            legs = MappedClip(whole, base.landmarks), MappedClip(clip, marks)
            start = suggest_timings(*legs, usual, 1)[0].base_start
        ease = _EASE * whole.rate
        timing = Timing(start, float(clip.frames[0]), 1.0, usual.length, ease, ease)
        splice = Splice(PARTS[PART], clip, timing, marks)
        span = splice_window(timing, whole, clip)
        full = np.asarray(span.weights) >= 1.0
        frames, moments = whole.frames[span.frames][full], span.splice_frames[full]

        def upper(
            frames: Floats = frames, moments: Floats = moments, *, warp: bool = timed == "suggested"
        ) -> tuple[Clip, Floats]:
            if warp:
                moments = warped_moments(whole, base.landmarks, clip, marks, frames)
            made = upper_on_lower(whole, base.landmarks, clip, marks, frames, moments)
            return made, moments

        made: dict[str, Callable[[], tuple[Clip, Floats]]] = {
            "copied": lambda splice=splice, moments=moments: (
                plain_copy(whole, base.landmarks, splice),
                moments,
            ),
            "upper on lower": upper,
            "ours": lambda splice=splice, moments=moments: (
                spliced(whole, base.landmarks, splice),
                moments,
            ),
        }
        for way, make in made.items():
            result, shown = make()
            rows.append(
                {"clip": name, "timing": timed, "way": way}
                | _judged(result, whole, base.landmarks, (clip, marks), frames, shown)
            )
    return rows


def _judged(  # noqa: PLR0917
    result: Clip,
    base: Clip,
    landmarks: Landmarks,
    other: tuple[Clip, Landmarks],
    frames: Floats,
    moments: Floats,
) -> dict[str, float]:
    """By joints alone: medians over frames of degrees."""
    ours, before = (joints_at(each, landmarks, frames) for each in (result, base))
    theirs = joints_at(*other, moments)
    arm = [
        measures.angle(one, wanted)
        for one, wanted in zip(
            measures.arm_directions(ours, "right"),
            measures.arm_directions(theirs, "right"),
            strict=True,
        )
    ]
    # In the world: legs and way are the base's, whatever is done above them.
    bones = (("left_shoulder", "left_elbow"), ("left_elbow", "left_hand"), ("hips", "neck"))
    rest = [
        measures.angle(ours[end] - ours[root], before[end] - before[root]) for root, end in bones
    ]
    legs = [
        measures.angle(one, wanted)
        for side in measures.SIDES
        for one, wanted in zip(
            measures.leg_directions(ours, side), measures.leg_directions(theirs, side), strict=True
        )
    ]
    return {
        key: float(np.median(np.max(each, axis=0)))
        for key, each in (("arm", arm), ("rest", rest), ("legs", legs))
    }


def ways_text(found: Any) -> str:
    """The table."""
    clips = dict.fromkeys(row["clip"] for row in found["rows"])
    rows = {(row["clip"], row["timing"], row["way"]): row for row in found["rows"]}
    lines = [
        f"{'':<17}{'':<10}" + "".join(f"│{way:^21}" for way in WAYS),
        f"{'clip':<17}{'timing':<10}" + f"│{'arm':>7}{'rest':>7}{'legs':>7}" * len(WAYS),
    ]
    for clip in clips:
        for timed in TIMINGS:
            own = [rows[clip, timed, way] for way in WAYS]
            keys = ("arm", "rest", "legs")
            cells = "".join("│" + "".join(f"{row[key]:>6.1f}°" for key in keys) for row in own)
            lines.append(f"{clip:<17}{timed:<10}{cells}")
    return "\n".join(
        [
            *lines,
            "",
            "right arms on a walk; medians over frames of the worst direction, from joints alone",
            "arm: off its clip, seen from the chest; rest: left arm and trunk off the base's",
            "legs: of the clip at that moment against the base's, seen as the pelvis faces",
            "upper on lower, suggested: with its own time warping",
        ]
    )


def ways_told(found: Any) -> str:
    """What the row says."""
    said = []
    for way in WAYS:
        rows = [row for row in found["rows"] if row["way"] == way]
        arm, rest = (max(row[key] for row in rows) for key in ("arm", "rest"))
        said.append(f"*{way}*: the arm {arm:.1f}° off its clip, the rest {rest:.1f}° off the base")
    return "; ".join(said)
