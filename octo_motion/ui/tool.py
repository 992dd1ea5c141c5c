# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of the three tools the sidebar shows of an armature: the one that was chosen, else the one
that its rig looks like.
"""

from __future__ import annotations

from typing import Any, Final

import bpy

from ..blender.rig import read_skeleton
from ..core.errors import RigError
from ..core.splicing.humanoid import map_skeleton
from .declared_settings import EnumProperty, IntProperty

TOOLS: Final = (
    ("MOVE", "Move", "Let it walk or swim along a route", "CON_FOLLOWPATH", 0),
    ("SPLICE", "Splice", "Put body parts of clips onto each other, and clips onto it", "NLA", 1),
    ("POSE", "Pose", "Bend it by hand, like a puppet", "VIEW_PAN", 2),
)
_CHOSEN: Final = "chosen_tool"
_UNCHOSEN: Final = -1


def tool_of(armature: bpy.types.Object) -> str:
    """Identifier of the tool that is shown of an armature."""
    return TOOLS[_number(armature.octo_motion)][0]  # type: ignore[attr-defined]


def _number(group: Any) -> int:
    number = getattr(group, _CHOSEN)
    if number != _UNCHOSEN:
        return number
    armature = group.id_data
    if armature.type != "ARMATURE" or len(group.locomotion.arms):
        return 0
    # Asked with every redraw: looked at once for so many bones.
    key = armature.session_uid, len(armature.data.bones)
    # To read bones that are being edited would write them back, which no redraw may.
    if key not in _humanoids and armature.mode != "EDIT":
        _humanoids[key] = _is_humanoid(armature)
    return 1 if _humanoids.get(key) else 0


_humanoids: dict[tuple[int, int], bool] = {}
"""Whether an armature is one, by the object's own number and that of its bones."""


def _is_humanoid(armature: bpy.types.Object) -> bool:
    """Whether it has arms, legs and a head."""
    try:
        found = map_skeleton(read_skeleton(armature))
    except RigError:
        return False
    return not found.problem and not found.asked


def _choose(group: Any, number: int) -> None:
    setattr(group, _CHOSEN, number)


def chosen() -> object:
    """The number of the tool that was chosen."""
    return IntProperty(
        name="Chosen Tool",
        description="The tool that was chosen last; -1 for none, which goes by the rig",
        default=_UNCHOSEN,
        min=_UNCHOSEN,
        max=len(TOOLS) - 1,
        options={"HIDDEN"},
    )


def switch() -> object:
    """The switch that shows it and sets it."""
    return EnumProperty(
        name="Tool",
        description="What the sidebar shows of this armature",
        items=TOOLS,
        get=_number,
        set=_choose,
        options={"SKIP_SAVE"},
    )
