# SPDX-License-Identifier: GPL-3.0-or-later
"""What a motion is made from: all that was read of settings and scene, nothing worked out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np

from ...follow_through import Limbs
from ...keyframes import RigChannels
from ...posing.puppet import Figure
from ...rotations import Floats
from ...skeleton import Skeleton
from ..body import BodySettings, Organs
from ..clearance import BodyVolume
from ..gait import Arm, GaitSettings
from ..ground import ContactOverride, GroundMesh, MovingMesh, StanceSettings
from ..path import Route, TravelSettings
from ..reaching import Reaching
from ..rig import ArmSkin, BodyFrame

FINE: Final = 0.03
"""Arm lengths between the samples of a ground."""
EDGE: Final = 1.0 / 6.0
"""Arm lengths: radius with which arms feel an edge. At 1/8 skin of Walk is 0.5 % of an arm in
stairs instead of 0.3 %, without it 2.9 %."""


@dataclass(frozen=True, eq=False)
class Creature:
    """A rig, its arms, and where it stands."""

    skeleton: Skeleton
    """As its arms hang: bones that carry them and get no keys are in their poses."""
    at_rest: Skeleton
    """As its skin is made for."""
    arms: tuple[Arm, ...]
    bones: list[tuple[str, ...]]
    """Of each arm, root to tip."""
    body: BodyFrame
    listed: tuple[tuple[str, ...], ...]
    """Bones of all arms, also of those that are switched off: they are no mantle either."""
    root_bone: str
    """Bone that takes the travel, "" for the object."""
    world: Floats
    """(4, 4) of the object, of uniform scale."""
    scale: float
    """Metres of the armature's unit."""
    channels: RigChannels
    """Of all bones, and of the object if that travels."""


@dataclass(frozen=True, eq=False)
class GaitJob:
    """One way of moving. What hangs on the rig is still to be scaled to it."""

    settings: GaitSettings
    """Its lean is that of a body that lies as it swims wholly."""
    travel: TravelSettings
    """Its stride is in arm lengths."""


@dataclass(frozen=True, eq=False)
class Timing:
    """When it moves, and how fast."""

    kind: Literal["CYCLES", "SPEED", "RANGE"]
    """By the gait's rhythm, by the speed of the body, or between two frames."""
    start: int
    """First frame …"""
    end: int
    """… and last, of a RANGE."""
    speed: float
    """m/s"""
    cycle_time: float
    """Seconds of a cycle at full speed."""
    rate: float
    """Frames per second."""
    duty: float
    """Share of a cycle that arms hold on: what is left is there for a swing."""


@dataclass(frozen=True, eq=False)
class GroundJob:
    """What a walk holds on to."""

    stance: StanceSettings
    skins: Sequence[ArmSkin]
    """Of each arm."""
    may_stretch: Sequence[bool]
    """For each arm, whether its bones may get longer."""
    mesh: GroundMesh | None
    """None to follow the route."""
    moving: MovingMesh | None = None
    """How that moves meanwhile; none where it stays. Then the mesh is that of its first frame."""
    overrides: tuple[ContactOverride, ...] = ()
    """The artist's, for single contacts."""
    rest: tuple[bool, bool] = (False, False)
    """Whether all arms lie on the ground at the start, and at the end …"""
    rest_within: float = 0.0
    """… and within how many strides the body is slow there."""
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Floor:
    """What lies below a body that holds on to nothing there: one that swims, or is in place."""

    skins: Sequence[ArmSkin]
    """Of each arm."""
    triangles: Floats
    """(triangles, 3, 3) world."""
    content: bytes
    """A key of what they are."""


@dataclass(frozen=True)
class ChangeAt:
    """A place where the gait changes."""

    position: float
    """Share of the route's length."""
    length: float
    """Arm lengths over which it changes."""
    gait: int
    """Number of the one after it."""


@dataclass(frozen=True)
class ChangesByHeight:
    """The gait changes where the route leaves the ground, and where it comes back."""

    height: float
    """Arm lengths over the ground."""
    length: float
    """Arm lengths over which it changes."""
    gait: int
    """Number of the one above."""


@dataclass(frozen=True)
class Breathing:
    """A mantle that gets wider with each breath."""

    amount: float
    """By how much, as a share; 0 for none."""
    seconds: float
    """Of one breath."""


@dataclass(frozen=True, eq=False)
class Trailing:
    """Outer parts of arms that follow, as bodies."""

    limbs: Limbs
    figure: Figure
    """Of these bones, in metres of its own size."""
    unit: float
    """Of these metres in one of the world's."""


@dataclass(frozen=True, eq=False)
class BodyJob:
    """What a body does by itself."""

    settings: BodySettings = field(default_factory=BodySettings)
    """How much of it."""
    breathing: Breathing = field(default_factory=lambda: Breathing(0.0, 1.0))
    organs: Organs = field(default_factory=Organs)
    """The bones that do it."""
    unlike: float = 0.0
    """How much breaths differ, 1 for as much as is natural."""
    seed: int = 0
    trailing: Trailing | None = None
    """Outer parts of arms that follow, none where they do not."""
    look_at: Floats | None = None
    """(frames, 3) what the eyes look at, world; none for where the body goes."""


@dataclass(frozen=True, eq=False)
class GivenPose:
    """A pose of the artist's that a motion begins or ends in."""

    turns: Mapping[str, Floats]
    """(4,) rotations of all bones that it moves, in their rest frames …"""
    moves: Mapping[str, Floats]
    """… and their locations (3,) …"""
    sizes: Mapping[str, Floats]
    """… and scales (3,)."""
    place: tuple[Floats, Floats] | None
    """Location (3,) and orientation (4,) of the armature, world, as what travels carries it; none
    for wherever the motion has it."""
    frames: int
    """Over how many it goes over."""


# In one piece, for it is all that there is to say to core at once.
@dataclass(frozen=True, eq=False)
class MotionJob:
    """All that one motion is made from, as it was read."""

    creature: Creature
    in_place: bool
    """Whether nothing travels: the motion is a loop."""
    route: Route | None
    """None for whole cycles in place."""
    cycles: int
    """In place: how many."""
    repeats: bool
    """Whether curves go on before the motion and after it."""
    gaits: tuple[GaitJob, ...]
    """The first one, and those that it changes to."""
    changes: ChangesByHeight | tuple[ChangeAt, ...]
    timing: Timing
    height: float | None
    """Metres from the route or the ground to the body's centre; none for what the gait needs."""
    streamline: float
    """How far a mantle is stretched out along the way that its body swims: 0…1."""
    body: BodyJob
    ground: GroundJob | None
    """What walks hold on to, none where they do not."""
    volume: BodyVolume | None
    """What there is of the creature, where arms keep apart or overlaps are told."""
    keep_apart: bool
    """Whether arms make way for each other."""
    tell_overlaps: bool
    reaching: Reaching | None
    """What arms reach for."""
    tolerances: Tolerances | None
    """How far few keys may be off, distances in arm lengths; none for a key on every frame."""
    floor: Floor | None = None
    """What lies below where no gait holds on to it, none where nothing does; for figures alone."""
    begin: GivenPose | None = None
    """The pose in which it begins, none for its own …"""
    end: GivenPose | None = None
    """… and the one in which it ends."""
    live: bool = False
    """Whether it is to be quick: the same motion with a key on every frame, and without figures of
    how good it is."""
    warnings: tuple[str, ...] = ()
    """What there is to say of what was read."""


@dataclass(frozen=True, eq=False)
class ShownContact:
    """A contact with the ground, for a marker."""

    arm: str
    cycle: int
    position: Floats
    """(3,) the joint that touches first, world."""
    heading: float
    """Radians about world Z from +X."""
    frame_on: float
    frame_off: float
    cycle_frames: float
    """Frames of the arm's cycle."""


@dataclass(frozen=True, eq=False)
class Tolerances:
    """How far the motion may be off at any frame."""

    angle: float
    """Radians, of each bone against its parent."""
    distance: float | Floats
    """Of each arm's tip, in the armature's units; at each moment, where that differs."""
    by_bone: bool = True
    """Whether each bone has key frames of its own, rather than each arm."""
    held: float | Floats = np.inf
    """Of joints that rest on the ground, in the armature's units."""
