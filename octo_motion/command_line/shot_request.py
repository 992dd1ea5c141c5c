# SPDX-License-Identifier: GPL-3.0-or-later
"""One shot as it is asked for: plain data that can be checked, and handed to another process."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from ..core.locomotion.octopus import OctopusShape
from .setting_values import Value

EXPORT_SUFFIXES: Final = (".glb", ".fbx", ".abc")
HIGHEST_FPS: Final = 32767
"""Blender's own limit."""

MOST_FRAMES: Final = 1_000_000
"""A little below Blender's last frame."""

Points = tuple[tuple[float, float, float], ...]


@dataclass(frozen=True)
class NewOctopus:
    """The octopus to make, where no file is given."""

    shape: OctopusShape = field(default_factory=OctopusShape)
    with_mesh: bool = True


@dataclass(frozen=True)
class NewRoute:
    """The route to draw, in world space and metres."""

    points: Points
    is_bezier: bool
    """Whether the points are the four control points of [Octopus, eq. 3.18] or lie on the route."""
    cyclic: bool = False


@dataclass(frozen=True)
class NewSplice:
    """One splice for the list of an armature."""

    clip: Path | None = None
    """The motion file that the part is from; without it, ``source`` and ``action`` say it."""
    source: str = ""
    """Armature in the .blend file that the clip is for, the one that is spliced onto if empty."""
    action: str = ""
    """Name of the action, the only one of the motion file or the source's own if empty."""
    settings: dict[str, Value] = field(default_factory=dict)
    """Values of the item by name, the part among them, and ``landmarks.NAME`` of the source."""


@dataclass(frozen=True)
class SpliceWork:
    """What to splice."""

    base: str = ""
    """Name of the action to splice onto; the armature's own, or the list's, if empty."""
    frames: int | None = None
    """Frames that the base is to last, repeated or cut; as long as it is if not given."""
    splices: tuple[NewSplice, ...] | None = None
    """In order, or none for the list that the file has."""


@dataclass(frozen=True)
class ShotEntry:
    """What one shot is made from, and what is made of it."""

    name: str
    file: Path | None = None
    """The file to open; without it and without an octopus, the file that is open. To splice, it
    may be a motion file."""
    octopus: NewOctopus | None = None
    armature: str = ""
    route: str | NewRoute = ""
    """Name of a curve, a route to draw, or "" for the armature's own."""
    ground: str = ""
    """Name of the object to walk on, or "" for the armature's own."""
    lists: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    """Items of its lists, by the names of ``shot_lists.LISTS``; others are as in the file."""
    gait: str = ""
    """The gait table as JSON, or "" for the armature's own."""
    settings: dict[str, Value] = field(default_factory=dict)
    fps: float | None = None
    output: Path | None = None
    exports: tuple[Path, ...] = ()
    splicing: SpliceWork | None = None
    """What to splice."""
    posing: Path | None = None
    """The pose script to play. With neither: the armature is to walk or swim."""
    limits: dict[str, float] = field(default_factory=dict)
    """How bad the figures of its motion may be, by name; see ``limits``."""

    @property
    def inputs(self) -> tuple[Path, ...]:
        """All files that are named to be read: scene and clips."""
        splices = (self.splicing and self.splicing.splices) or ()
        named = (self.file, self.posing, *(splice.clip for splice in splices))
        return tuple(dict.fromkeys(path for path in named if path is not None))

    @property
    def outputs(self) -> tuple[Path, ...]:
        """All files that are to be written."""
        return (*((self.output,) if self.output else ()), *self.exports)

    def to_plain(self) -> dict[str, Any]:
        """For JSON; ``from_plain`` reads it."""
        plain = asdict(self)
        plain["file"] = str(self.file) if self.file else None
        plain["posing"] = str(self.posing) if self.posing else None
        plain["output"] = str(self.output) if self.output else None
        plain["exports"] = [str(path) for path in self.exports]
        for splice in (plain["splicing"] or {}).get("splices") or ():
            splice["clip"] = str(splice["clip"]) if splice["clip"] else None
        return plain

    @classmethod
    def from_plain(cls, plain: dict[str, Any]) -> ShotEntry:
        """The entry that ``to_plain`` made plain."""
        octopus, route = plain["octopus"], plain["route"]
        if isinstance(route, dict):
            points = tuple((x, y, z) for x, y, z in route["points"])
            route = NewRoute(points, route["is_bezier"], route["cyclic"])
        return cls(
            name=plain["name"],
            file=Path(plain["file"]) if plain["file"] else None,
            octopus=NewOctopus(OctopusShape(**octopus["shape"]), octopus["with_mesh"])
            if octopus
            else None,
            armature=plain["armature"],
            route=route,
            ground=plain["ground"],
            lists=plain["lists"],
            gait=plain["gait"],
            settings=plain["settings"],
            fps=plain["fps"],
            output=Path(plain["output"]) if plain["output"] else None,
            exports=tuple(Path(path) for path in plain["exports"]),
            splicing=_splice_work(plain["splicing"]) if plain["splicing"] else None,
            posing=Path(plain["posing"]) if plain["posing"] else None,
            limits=plain["limits"],
        )


def _splice_work(plain: dict[str, Any]) -> SpliceWork:
    given = plain["splices"]
    splices = None if given is None else tuple(map(_new_splice, given))
    return SpliceWork(plain["base"], plain["frames"], splices)


def _new_splice(plain: dict[str, Any]) -> NewSplice:
    clip = Path(plain["clip"]) if plain["clip"] else None
    return NewSplice(clip, plain["source"], plain["action"], plain["settings"])


def frame_rate(fps: float) -> tuple[int, float]:
    """Frames per second as Blender keeps them: a whole number, and what it is divided by.

    29.97 is 30 and 1.001, as in broadcasting.
    """
    whole = math.ceil(fps - 1e-9)
    base = whole / fps
    # 30 / 29.97 is 1.001001: people write the rounded rate and mean the exact one.
    return whole, 1.001 if abs(base - 1.001) < 1e-5 else base
