# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist says of follow-through: material, what is around, what is in the way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ..settings import setting, share_setting

MATERIALS: Final = (
    ("RUBBER", "Rubber", "Springs back to the action and swings about it: tails, ears, hair", 0),
    ("WIRE", "Wire", "Springs back a little, and keeps a bend that was too much for it", 1),
    ("CLAY", "Clay", "Gives way slowly and stays: what is shaken goes out of shape", 2),
    ("LIMP", "Limp", "Hangs without any spring: ropes, chains, braids. Give it gravity", 3),
    ("OWN", "Own", "What is set below", 4),
)

MEDIA: Final = (
    ("NONE", "None", "Nothing slows it down but its own damping", 0),
    ("AIR", "Air", "Air: thin hair drifts, thick tails hardly notice", 1),
    ("WATER", "Water", "Water: limbs trail behind, and float", 2),
)

STARTS: Final = (
    ("MOTION", "In Motion", "As if the action had gone on like this before its first frame", 0),
    ("REST", "At Rest", "Hanging still in the action's first pose", 1),
)


@dataclass(frozen=True)
class FollowSettings:
    """Lengths and speeds are the world's; gravity is a share of the Earth's."""

    material: str = setting(
        "Material", "What the bones are made of", default="RUBBER", items=MATERIALS
    )
    strength: float = setting(
        "Strength",
        "How firmly bones are held to the action: twice as strong, they lag half as much",
        default=1.0,
        low=0.001,
        high=1000.0,
        soft_low=0.1,
        soft_high=10.0,
        step=10,
    )
    damping: float = setting(
        "Damping",
        "How soon swinging dies away: 0 swings for long, 1 settles without swinging over",
        default=0.2,
        low=0.0,
        high=10.0,
        soft_high=1.0,
        step=5,
    )
    springs: float = setting(
        "Springs Back",
        "How far a limb would be bent by its own weight: so far it springs back",
        default=float(np.radians(20.0)),
        low=float(np.radians(0.01)),
        high=float(np.radians(720.0)),
        soft_high=float(np.radians(180.0)),
        subtype="ANGLE",
        step=100,
    )
    bears: float = setting(
        "Bears",
        "What a joint bears before it keeps its bend, in the weight of what hangs on it; 0 for one "
        "that always springs back",
        default=0.0,
        low=0.0,
        high=1000.0,
        soft_high=10.0,
        step=10,
    )
    gravity: float = setting(
        "Gravity",
        "Weight beyond that which the action's poses show already: 0 keeps a tail that hangs still "
        "where the action has it, 1 lets it sag as far as its material does",
        default=0.0,
        low=-10.0,
        high=10.0,
        soft_low=0.0,
        soft_high=1.0,
        step=10,
    )
    medium: str = setting("Medium", "What it moves through", default="AIR", items=MEDIA)
    drag: float = setting(
        "Drag",
        "How strongly air or water holds back what moves through it: 1 is a plain round limb, more "
        "is fur, fins or skin between",
        default=1.0,
        low=0.0,
        high=1000.0,
        soft_high=10.0,
        step=10,
    )
    buoyancy: float = share_setting("Buoyancy", "How much of the weight water bears", default=1.0)
    friction: float = setting(
        "Friction",
        "How hard bones slide on what they touch",
        default=0.4,
        low=0.0,
        high=10.0,
        soft_high=2.0,
        step=10,
    )
    self_collision: bool = setting(
        "Each Other", "Chosen bones that are no neighbours push each other away", default=False
    )
    start: str = setting(
        "Start", "How it moves at the action's first frame", default="MOTION", items=STARTS
    )
