# SPDX-License-Identifier: GPL-3.0-or-later
"""The bones of a humanoid that splicing needs to know, whatever the rig calls them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

MIDDLE: Final = ("hips", "spine", "chest", "neck", "head")
"""On the body's mid plane, from the pelvis up. ``spine`` is the lowest bone above the pelvis that
bends the trunk, ``chest`` the one that carries neck and shoulders."""

SIDED: Final = (
    *("clavicle", "upper_arm", "forearm", "hand"),
    *("thigh", "shin", "foot", "toe"),
)
"""On either side: "upper_arm.L" and "upper_arm.R"."""

LANDMARKS: Final = (*MIDDLE, *(f"{name}.{side}" for side in "LR" for name in SIDED))

OPTIONAL: Final = frozenset({"clavicle.L", "clavicle.R", "toe.L", "toe.R", "neck", "spine"})
"""What some rigs do not have; all else is required."""


@dataclass(frozen=True)
class Landmarks:
    """Which bone is which. A bone stands for the joint at its head."""

    bones: Mapping[str, str]
    """Bone name by landmark; optional ones may be missing."""

    def __getitem__(self, landmark: str) -> str:
        """Name of a landmark's bone; KeyError if the rig has none."""
        return self.bones[landmark]

    def get(self, landmark: str) -> str | None:
        """Name of a landmark's bone, or none."""
        return self.bones.get(landmark)
