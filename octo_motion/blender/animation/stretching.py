# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bones may get longer and thinner.

A bone's scale reaches its children. Where they inherit it along their own axes (Blender's
*Aligned*) or not at all, each bone can be as long as it likes; where they inherit it in full,
stretched bones shear those that bend away from them.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import bpy

from ..rig import armature_data

ALIGNED: Final = "ALIGNED"
_APART: Final = {"NONE", "NONE_LEGACY"}
_CLOSE: Final = 1e-4
"""Bone lengths that a bone's head may be off its parent's tail."""


def may_stretch(armature: bpy.types.Object, bones: Sequence[str]) -> bool:
    """Whether the bones of an arm, root to tip, can be made longer without harm."""
    data = armature_data(armature).bones
    chain = [data[name] for name in bones]
    for upper, lower in pairwise(chain):
        if lower.parent != upper or lower.inherit_scale not in {ALIGNED, *_APART}:
            return False
        if (lower.head_local - upper.tail_local).length > _CLOSE * upper.length:
            return False
    return True
