# SPDX-License-Identifier: GPL-3.0-or-later
"""One shot as it is asked for: plain data that can be checked, and handed to another process."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from ...core.locomotion.octopus_shape import OctopusShape
from .setting_values import Value

EXPORT_SUFFIXES: Final = (".glb", ".fbx", ".abc")
HIGHEST_FPS: Final = 32767
"""Blender's own limit."""

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
class ShotEntry:
    """What one shot is made from, and what is made of it."""

    name: str
    file: Path | None = None
    """The file to open; without it and without an octopus, the file that is open."""
    octopus: NewOctopus | None = None
    armature: str = ""
    route: str | NewRoute = ""
    """Name of a curve, a route to draw, or "" for the armature's own."""
    gait: str = ""
    """The gait table as JSON, or "" for the armature's own."""
    settings: dict[str, Value] = field(default_factory=dict)
    fps: float | None = None
    output: Path | None = None
    exports: tuple[Path, ...] = ()

    @property
    def outputs(self) -> tuple[Path, ...]:
        """All files that are to be written."""
        return (*((self.output,) if self.output else ()), *self.exports)

    def to_plain(self) -> dict[str, Any]:
        """For JSON; ``from_plain`` reads it."""
        plain = asdict(self)
        plain["file"] = str(self.file) if self.file else None
        plain["output"] = str(self.output) if self.output else None
        plain["exports"] = [str(path) for path in self.exports]
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
            gait=plain["gait"],
            settings=plain["settings"],
            fps=plain["fps"],
            output=Path(plain["output"]) if plain["output"] else None,
            exports=tuple(Path(path) for path in plain["exports"]),
        )


def frame_rate(fps: float) -> tuple[int, float]:
    """Frames per second as Blender keeps them: a whole number, and what it is divided by.

    29.97 is 30 and 1.001, as in broadcasting.
    """
    whole = math.ceil(fps - 1e-9)
    base = whole / fps
    # 30 / 29.97 is 1.001001: people write the rounded rate and mean the exact one.
    return whole, 1.001 if abs(base - 1.001) < 1e-5 else base
