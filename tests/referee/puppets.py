# SPDX-License-Identifier: GPL-3.0-or-later
"""What an animator sees go wrong in posing by hand, on the keys that a drag has left."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .creature_measures import angles_between
from .recording import Integers, Recording, record

MATERIALS = ("CLAY", "WIRE", "DOLL", "RUBBER", "LIMP", "CUSTOM")
BEFORE, AFTER = 1, 10
UNITS = {
    "back": "% of a drag given back after release",
    "others": "° that bones of other limbs have turned",
}
"""What each measure is in, in the order of the table."""


@dataclass(frozen=True)
class Drag:
    """A drag of a tip that was held still, then let go."""

    given_back: float
    """Share of the way that the tip goes back once it is free: clay stays, rubber does not."""
    others: float
    """Degrees that any bone of another limb has turned, which nobody touched."""
    moved: float
    """Metres that the tip was dragged: no use to look at a drag that did nothing."""


def drag(material: str, folder: Path, joints: int = 12) -> Drag:
    """Drag an arm's tip of the add-on's octopus, hold it still, let go, and look at the keys.

    Args:
        material: what the puppet is made of.
        folder: where the script of the drag may be written.
        joints: bones of an arm.
    """
    held, tip, others = _played(material, folder, joints, let_go=False)
    free, _, _ = _played(material, folder, joints, let_go=True)
    place = held.names.index(tip)
    before, dragged, after = held.tails[0, place], held.tails[-1, place], free.tails[-1, place]
    way = dragged - before
    moved = float(np.linalg.norm(way))
    turned = angles_between(free.turns[-1, others], free.turns[0, others])
    return Drag(float((dragged - after) @ way) / moved**2, float(turned.max()), moved)


def _played(
    material: str, folder: Path, joints: int, *, let_go: bool
) -> tuple[Recording, str, Integers]:
    """The keys before and at the end, the bone that was dragged, and the bones of other arms."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.octo_motion.add_octopus(with_mesh=False, joints=joints)
    armature: Any = bpy.context.object
    bpy.ops.octo_motion.detect_arms()
    arms = [[bone.name for bone in arm.bones] for arm in armature.octo_motion.locomotion.arms]
    tip = arms[0][-1]
    steps: list[dict[str, Any]] = [
        {"do": "key", "bones": "all"},
        {"do": "frame", "frame": AFTER},
        {"do": "grab", "bone": tip, "at": 1.0},
        {"do": "pull", "by": [0.1, 0.0, 0.25], "seconds": 0.5},
        {"do": "wait", "seconds": 1.0},
    ]
    if let_go:
        steps += [{"do": "release"}, {"do": "wait", "seconds": 2.0}]
    steps.append({"do": "key", "bones": "all"})
    script = {"format": "octo_motion.pose", "version": 1, "settings": {"material": material}}
    file = folder / f"{material}.json"
    file.write_text(json.dumps({**script, "steps": steps}), encoding="utf-8")
    bpy.ops.octo_motion.pose_script(filepath=str(file))
    played = record(armature, np.array([BEFORE, AFTER], float), with_skin=False)
    return played, tip, played.chain([name for arm in arms[1:] for name in arm])
