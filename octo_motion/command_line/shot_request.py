# SPDX-License-Identifier: GPL-3.0-or-later
"""One shot as it is asked for: plain data that can be checked, and handed to another process."""

from __future__ import annotations

import math
import types
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, Final, get_args, get_origin, get_type_hints

from ..core.locomotion.octopus import OctopusShape

HIGHEST_FPS: Final = 32767
"""Blender's own limit."""

Points = tuple[tuple[float, float, float], ...]
Settings = dict[str, Any]
"""Values by name: truths, numbers, texts and points."""


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
    settings: Settings = field(default_factory=dict)
    """Values of the item by name, the part among them, and ``landmarks.NAME`` of the source."""


@dataclass(frozen=True)
class ShotRequest:
    """What one shot is made from, and what is made of it: its keys in a job file, see
    ``shot_schema``.
    """

    name: str = ""
    kind: str = "generate"
    file: Path | None = None
    """The file to open; without it and without an octopus, the file that is open. To splice, it
    may be a motion file."""
    octopus: NewOctopus | None = None
    armature: str = ""
    route: str | NewRoute = ""
    """Name of a curve, a route to draw, or "" for the armature's own."""
    ground: str = ""
    """Name of the object to walk on, or "" for the armature's own."""
    gait: str | Path = ""
    """The gait table as JSON, a file that is still to be read, or "" for the armature's own."""
    changes: list[Settings] | None = None
    """Items of the list, as in the file if not given; so are the next two."""
    reaches: list[Settings] | None = None
    contacts: list[Settings] | None = None
    script: Path | None = None
    """The pose script to play."""
    base: str = ""
    """Name of the action to splice onto; the armature's own, or the list's, if empty."""
    frames: int | None = None
    """Frames that the base is to last, repeated or cut; as long as it is if not given."""
    splices: list[NewSplice] | None = None
    """In order, or none for the list that the file has."""
    settings: Settings = field(default_factory=dict)
    limits: dict[str, float] = field(default_factory=dict)
    """How bad the figures of its motion may be, by name; see ``quality_limits``."""
    fps: float | None = None
    output: Path | None = None
    export: tuple[Path, ...] = ()

    @property
    def opened(self) -> tuple[Path, ...]:
        """All files that Blender is to open or import: scene and clips."""
        named = (self.file, *(splice.clip for splice in self.splices or ()))
        return tuple(dict.fromkeys(path for path in named if path is not None))

    @property
    def inputs(self) -> tuple[Path, ...]:
        """All files that are named to be read."""
        texts = (each for each in (self.script, self.gait) if isinstance(each, Path))
        return (*self.opened, *texts)

    @property
    def outputs(self) -> tuple[Path, ...]:
        """All files that are to be written."""
        return (*((self.output,) if self.output else ()), *self.export)

    def to_plain(self) -> dict[str, Any]:
        """For JSON; ``from_plain`` reads it."""
        return _plain(self)

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> ShotRequest:
        """The request that ``to_plain`` made plain."""
        return _restored(cls, plain)


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return {each.name: _plain(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return str(value) if isinstance(value, Path) else value


def _restored(hint: Any, plain: Any) -> Any:
    """The value of a type that was made plain; of several types, the first that it could be of."""
    origin, arguments = get_origin(hint), get_args(hint)
    if plain is None:
        return None
    if origin is types.UnionType:
        fits = (each for each in arguments if is_dataclass(each) == isinstance(plain, dict))
        return _restored(next(fits), plain)
    if origin in {list, tuple} and isinstance(plain, list):
        values = [_restored(arguments[0], each) for each in plain]
        return values if origin is list else tuple(values)
    if isinstance(hint, type) and is_dataclass(hint):
        hints = get_type_hints(hint)
        return hint(**{name: _restored(hints[name], value) for name, value in plain.items()})
    return Path(plain) if hint is Path else plain


def frame_rate(fps: float) -> tuple[int, float]:
    """Frames per second as Blender keeps them: a whole number, and what it is divided by.

    29.97 is 30 and 1.001, as in broadcasting.
    """
    whole = math.ceil(fps - 1e-9)
    base = whole / fps
    # 30 / 29.97 is 1.001001: people write the rounded rate and mean the exact one.
    return whole, 1.001 if abs(base - 1.001) < 1e-5 else base
