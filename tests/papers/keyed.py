# SPDX-License-Identifier: GPL-3.0-or-later
"""The thesis' aim, put to the test: an octopus that somebody keyed by hand, and the same one with a
generated swim, in place and for as long.

The rig and its action are others' and not in the repository: $OCTO_MOTION_DATA has them.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any, Final

import bpy
import numpy as np

from tests.bench.splice_quality import log_dimensionless_jerk
from tests.referee import creature_measures as measures
from tests.referee.recording import moments, record

RIG: Final = "octo/nssm_octopus.blend"
STROKE: Final = (60, 100)
"""Frames of the action: one stroke of its swim, which ends as it begins."""


def keyed(*, quick: bool = False) -> Any:
    """Keys, jerk, overlap, largest turn and, of ours, seconds of work; None without data."""
    path = Path(os.environ.get("OCTO_MOTION_DATA") or "nowhere") / RIG
    if quick or not path.is_file():
        return None
    bpy.ops.wm.open_mainfile(filepath=str(path))
    armature: Any = next(each for each in bpy.data.objects if each.type == "ARMATURE")
    bpy.context.view_layer.objects.active = armature
    bpy.ops.octo_motion.detect_arms()
    settings = armature.octo_motion.locomotion
    scene: Any = bpy.context.scene
    first, last = STROKE
    rows = [_measured("by hand", armature, first, last)]
    seconds = (last - first) * scene.render.fps_base / scene.render.fps
    for name, keys in (("generated", "DENSE"), ("generated, few keys", "REDUCED")):
        began = time.perf_counter()
        bpy.ops.octo_motion.setup_load(name="swim")
        settings.travel_on, settings.cycles = "NONE", 1
        settings.cycle_time, settings.keys = seconds, keys
        settings.frame_start = first
        bpy.ops.octo_motion.generate_locomotion()
        took = time.perf_counter() - began
        start, end = (round(each) for each in settings.result.frame_range)
        rows.append(_measured(name, armature, start, end) | {"seconds": took})
    return {"frames": last - first, "rows": rows}


def _measured(name: str, armature: Any, first: int, last: int) -> dict[str, Any]:
    arms = [[bone.name for bone in arm.bones] for arm in armature.octo_motion.locomotion.arms]
    played = record(armature, moments(first, last))
    length = measures.arm_length(played, arms)
    # Round and round, so that the seam of the loop counts as well.
    tips = played.tails[:, [played.chain(arm)[-1] for arm in arms]]
    twice = np.concatenate([tips[:-1], tips[:-1], tips[:2]]).astype(np.float64)
    jerks = [log_dimensionless_jerk(twice[:, arm], played.fps) for arm in range(len(arms))]
    through = measures.skin_through_skin(played, arms, every=4)
    gap = float(np.linalg.norm(tips[-1] - tips[0], axis=-1).max()) / length
    return {
        "way": name,
        **_keys(armature, first, last),
        "jerk": float(np.median(jerks)),
        "pairs": through.most.value,
        "turn": measures.turns(played).value,
        "gap": 100.0 * gap,
    }


def _keys(armature: Any, first: int, last: int) -> dict[str, int]:
    """Keys within these frames of curves that move something, and frames that have some."""
    data = armature.animation_data
    bag = data.action.layers[0].strips[0].channelbag(data.action_slot)
    count, frames = 0, set[float]()
    for curve in bag.fcurves:
        places = np.array([key.co[:] for key in curve.keyframe_points])
        inside = places[(places[:, 0] >= first) & (places[:, 0] <= last)]
        if len(inside) and np.ptp(inside[:, 1]) > 1e-5:
            count += len(inside)
            frames |= set(inside[:, 0].tolist())
    return {"keys": count, "poses": len(frames)}


def keyed_text(found: Any) -> str:
    """The table."""
    lines = [
        f"{'':<21}{'keys':>7}{'frames':>8}{'jerk':>7}{'overlap':>9}{'turn':>7}{'gap':>8}{'work':>8}"
    ]
    for row in found["rows"]:
        work = f"{row['seconds']:.2f} s" if "seconds" in row else "?"
        lines.append(
            f"{row['way']:<21}{row['keys']:>7}{row['poses']:>8}{row['jerk']:>7.1f}"
            f"{row['pairs']:>9.0f}{row['turn']:>6.0f}°{row['gap']:>6.1f} %{work:>8}"
        )
    return "\n".join(
        [
            *lines,
            "",
            f"one stroke of {found['frames']} frames in place, eight arms of four bones",
            "keys: of curves that move; frames: that have keys; jerk: of the tips, natural",
            "  logarithm of the dimensionless jerk, round and round, median of the arms; nearer",
            "  to 0 is smoother",
            "overlap: faces of skin that cut others, at most; turn: of a bone in a frame, at most",
            "gap: of a tip from the last frame to the first, of an arm; work: from the set-up to",
            "  the action. Nobody knows how long the hand took; nothing stands, so nothing slips",
        ]
    )


def keyed_told(found: Any) -> str:
    """What the row says."""
    hand, ours, few = found["rows"]
    return (
        f"a stroke of a rig of others': {hand['keys']} keys by hand, {ours['keys']} generated in "
        f"{ours['seconds']:.1f} s of work, or {few['keys']} as few keys; jerk {hand['jerk']:.1f} "
        f"by hand, {ours['jerk']:.1f} generated, {few['jerk']:.1f} with few keys; at most "
        f"{hand['pairs']:.0f} and {ours['pairs']:.0f} pairs of faces go through each other"
    )
