# SPDX-License-Identifier: GPL-3.0-or-later
"""What a shot may say: each key declared once, for job files and for the command line.

A :class:`ShotRequest` is what came of it: plain data that can be checked.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final

from ..core.errors import SettingsError
from ..core.files import name_fault, read_text
from ..core.locomotion.gait import gait_to_json
from ..core.locomotion.metrics import KINDS as FIGURES
from ..core.locomotion.octopus import OctopusShape
from ..core.posing.pose_script import parse_script
from ..core.splicing.clip import MOTION_SUFFIXES
from .schema import (
    Choice,
    File,
    Kind,
    Number,
    Reading,
    Table,
    Tables,
    Text,
    Unfit,
    flag,
    parse_assignments,
    point,
    read_value,
)

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
    ground: str = ""
    """Name of the mesh on which locked feet stand; level ground if empty."""
    settings: Settings = field(default_factory=dict)
    """Values of the item by name, the part among them, and ``landmarks.NAME`` of the source."""


# In one piece, for it is a job's table as it is written.
@dataclass(frozen=True)
class ShotRequest:
    """What one shot is made from, and what is made of it: its keys in a job file."""

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
    """Items of the list, as in the file if not given; so are the next three. Of a shot that
    follows, its chains."""
    along: list[Settings] | None = None
    reaches: list[Settings] | None = None
    contacts: list[Settings] | None = None
    script: Path | None = None
    """The pose script to play."""
    base: str = ""
    """Name of the action to splice onto; the armature's own, or the list's, if empty."""
    frames: int | None = None
    """Frames that the base is to last, repeated or cut; as long as it is if not given."""
    splices: list[NewSplice] | None = None
    """In order, or none for the list that the file has; of a shot that retargets, its clips."""
    settings: Settings = field(default_factory=dict)
    limits: dict[str, float] = field(default_factory=dict)
    """How bad the figures of its motion may be, by name; see ``check_limits``."""
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


def frame_rate(fps: float) -> tuple[int, float]:
    """Frames per second as Blender keeps them: a whole number, and what it is divided by.

    29.97 is 30 and 1.001, as in broadcasting.
    """
    whole = math.ceil(fps - 1e-9)
    base = whole / fps
    # 30 / 29.97 is 1.001001: people write the rounded rate and mean the exact one.
    return whole, 1.001 if abs(base - 1.001) < 1e-5 else base


# --- Keys -----------------------------------------------------------------------------------------


_EXPORT_SUFFIXES: Final = (".glb", ".fbx", ".abc", ".usd", ".usdc", ".usda")
_MOST_FRAMES: Final = 1_000_000
"""A little below Blender's last frame."""

NAMES: Final = tuple(kind.lower() for kind in FIGURES)
"""The figures of a motion that may be limited, as jobs and reports call them."""


@dataclass(frozen=True)
class Option:
    """How the command line says what a key says."""

    help: str
    metavar: str | tuple[str, ...] = "NAME"
    """Two of an option that takes as many words as there are."""
    flags: tuple[str, ...] = ()
    """Without any: the key's name."""
    collect: Callable[[list[Any]], Any] | None = None
    """Of an option that may be repeated: what the key has for all that was given."""
    required: bool = False


@dataclass(frozen=True)
class Key:
    """One key of a shot."""

    kind: Kind
    option: Option | None = None


# --- Kinds of values that shots alone have -------------------------------------------------------


def gait_name(given: Any, reading: Reading) -> str:
    """The name of a gait."""
    name = Text()(given, reading)
    reading.known.gait(name)
    return name


def _gait(given: Any, reading: Reading) -> str | Path:
    """A gait by name, read to its table as JSON, or a gait file."""
    name = Text()(given, reading)
    if name.lower().endswith(".json"):
        return reading.resolve(name)
    return gait_to_json(reading.known.gait(name))


def _shot_name(given: Any, reading: Reading) -> str:
    """The name of a shot, of which files are named: folders may be in it."""
    name = Text()(given, reading)
    for part in name.split("/"):
        if fault := name_fault(part) or ("" if part.strip(". ") else f"'{name}' is no name."):
            raise SettingsError(fault, "Give the shot another name.")
    return name


def _script(given: Any, reading: Reading) -> Path:
    """A pose script, which is read to see whether it makes sense."""
    path = File()(given, reading)
    if not path.is_file():
        raise SettingsError(f"There is no file '{path}'.", "Give the path of a pose script.")
    try:
        parse_script(read_text(path), path.name)
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"The script '{path.name}' cannot be read: {error}.") from error
    return path


def _export(given: Any, reading: Reading) -> Path:
    name = Path(Text()(given, reading)).name
    if name.lower().endswith(".gltf"):
        raise SettingsError(f"'{name}' would be several files: export to .glb, the same in one.")
    return File("format to export to", _EXPORT_SUFFIXES, is_written=True)(given, reading)


def _exports(given: Any, reading: Reading) -> tuple[Path, ...] | None:
    """A file to export to, or a list of them."""
    listed = [given] if isinstance(given, str) else given
    if not isinstance(listed, list) or not all(isinstance(each, str) for each in listed):
        raise Unfit("a path or a list of paths")
    paths = tuple(read_value("export", _export, each, reading) for each in listed)
    return None if None in paths else paths


def _clips(given: Any, reading: Reading) -> tuple[Path, ...] | None:
    """A motion file, or a folder of such files, or a list of them."""
    listed = [given] if isinstance(given, str) else given
    if not isinstance(listed, list) or not all(isinstance(each, str) for each in listed):
        raise Unfit("a path or a list of paths")
    paths: list[Path] = []
    for each in listed:
        path = reading.resolve(each)
        if not path.is_dir():
            # Without an ending it is a folder that is not there yet: that is told before all runs.
            suffixes = MOTION_SUFFIXES if path.suffix else ()
            paths.append(File("motion file", suffixes)(each, reading))
            continue
        found = sorted(file for file in path.iterdir() if is_motion(file) and file.is_file())
        if not found:
            raise SettingsError(f"The folder '{each}' has no motion files.")
        paths += found
    return tuple(dict.fromkeys(paths))


def _points(given: Any, reading: Reading) -> Points:
    try:
        points = [point(each, reading) for each in given]
    except (TypeError, Unfit):
        points = []
    if not isinstance(given, list) or not points:
        raise SettingsError(
            "its points must be a list of points, each of three numbers, [x, y, z]."
        )
    return tuple((x, y, z) for x, y, z in points)


def _drawn(values: Mapping[str, Any], reading: Reading) -> NewRoute | None:
    cyclic = bool(values.get("cyclic"))
    if ("control_points" in values) == ("points" in values):
        reading.fault("give either control_points (four) or points (that it leads through).")
        return None
    points = values.get("points") or values.get("control_points")
    if points is None:
        return None
    if "points" in values:
        least, number = (3, "three") if cyclic else (2, "two")
        if len(set(points)) < least:
            reading.fault(f"points must be at least {number} that lie apart.")
        return NewRoute(points, is_bezier=False, cyclic=cyclic)
    if cyclic:
        reading.fault("four control points make no cyclic route: give points.")
    if len(points) != 4:
        reading.fault(
            f"control points are four, not {len(points)}. For a route that leads through points "
            "write route = { points = […] }."
        )
    elif len(set(points)) == 1:
        reading.fault("its control points are all the same.")
    return NewRoute(points, is_bezier=True)


def _route(given: Any, reading: Reading) -> str | NewRoute | None:
    """The name of a curve, four control points, or a table of points."""
    table = {"control_points": given} if isinstance(given, list) else given
    return (_ROUTE if isinstance(table, dict) else Text())(table, reading)


_ROUTE: Final = Table(
    {"control_points": _points, "points": _points, "cyclic": flag},
    place="route",
    what="key",
    finish=_drawn,
)


# --- Tables within a shot ------------------------------------------------------------------------


def _new_octopus(values: dict[str, Any], _reading: Reading) -> NewOctopus:
    shape = {name: value for name, value in values.items() if value is not None}
    with_mesh = shape.pop("with_mesh", True)
    return NewOctopus(OctopusShape(**shape), with_mesh=with_mesh)


OCTOPUS: Final = Table(
    {
        **{
            each.name: Number(whole=isinstance(each.default, int))
            for each in dataclasses.fields(OctopusShape)
        },
        "with_mesh": flag,
    },
    place="octopus",
    what="parameter",
    example="{ arms = 8 }",
    finish=_new_octopus,
)
LIMITS: Final = Table(
    dict.fromkeys(NAMES, Number(0.0, may_be_infinite=True)),
    place="limits",
    what="figure",
    example="{ slip = 0.01 }",
)
"""How bad a motion may be."""


def _new_splice(values: dict[str, Any], reading: Reading) -> NewSplice:
    names = ("clip", "source", "action", "ground")
    own = {key: values.pop(key) for key in names if values.get(key)}
    if values.get("part") == "CHAIN" and not values.get("bone"):
        reading.fault('A chain needs its first bone: write bone = "…".')
    if "clip" in own and "source" in own:
        reading.fault("It has a clip and a source: give the file, or the armature's name.")
    return NewSplice(**own, settings=values)


SPLICES: Final = Tables(
    Table(
        {
            "clip": File("motion file", MOTION_SUFFIXES),
            "source": Text(),
            "action": Text(),
            "ground": Text(),
        },
        known="splices",
        example='{ part = "right_arm", clip = "throw.bvh" }',
        needed=("part",),
        finish=_new_splice,
    ),
    "splice",
    if_empty="splices is empty: write what to splice, or leave the key out.",
)


def parse_splices(options: Iterable[Sequence[str]]) -> list[dict[str, str]]:
    """The tables that words of the command line mean: each a part, a motion file, NAME=VALUE.

    Raises:
        SettingsError: one has more than one file.
    """
    tables = []
    for part, *words in options:
        files = [word for word in words if "=" not in word]
        values = (word for word in words if "=" in word)
        table = {"part": part, **parse_assignments(values, f"--splice {part}")}
        files += [table["clip"]] if files and "clip" in table else []
        if len(files) > 1:
            raise SettingsError(
                f"--splice {part} has two files, '{files[0]}' and '{files[1]}'.",
                "Write --splice PART FILE NAME=VALUE, with the file to read before it.",
            )
        tables.append(table | ({"clip": files[0]} if files else {}))
    return tables


CHAINS: Final = Tables(
    Table(known="chains", example='{ name = "Tail.1", last = "Tail.5" }', needed=("name",)),
    "chain",
    if_empty="chains is empty: write which bones follow, or leave the key out.",
)


def parse_chains(options: Iterable[Sequence[str]]) -> list[dict[str, str]]:
    """The tables that words of the command line mean: each a first bone, a last one, NAME=VALUE.

    Raises:
        SettingsError: one has more than one last bone.
    """
    tables = []
    for first, *words in options:
        last = [word for word in words if "=" not in word]
        if len(last) > 1:
            raise SettingsError(
                f"--chain {first} has two last bones, '{last[0]}' and '{last[1]}'.",
                "Write --chain FIRST LAST NAME=VALUE, with the file to read before it.",
            )
        values = (word for word in words if "=" in word)
        table = {"name": first, **parse_assignments(values, f"--chain {first}")}
        tables.append(table | ({"last": last[0]} if last else {}))
    return tables


def _items(name: str, example: str, *needed: str) -> Key:
    """A list of what the panels keep in a list of that name."""
    return Key(Tables(Table(known=name, example=example, needed=needed), name))


# --- Shots ---------------------------------------------------------------------------------------


def _file(help_: str) -> Key:
    return Key(File(), Option(help_, "FILE"))


def _named(help_: str, metavar: str = "NAME") -> Key:
    return Key(Text(), Option(help_, metavar))


def _settings(known: str, help_: str) -> Key:
    option = Option(f"{help_}; may be repeated", "NAME=VALUE", ("--set",), parse_assignments)
    return Key(Table(known=known), option)


def _kind(own: dict[str, Key], exported: str) -> dict[str, Key]:
    """The keys of a kind of shot: its own, and those that all have."""
    suffixes = ", ".join(_EXPORT_SUFFIXES)
    export = Option(
        f"export {exported} as well ({suffixes}); may be repeated", "FILE", collect=list
    )
    output = Option("the .blend file to write", "FILE", ("-o", "--output"))
    return {
        "name": Key(_shot_name),
        "kind": Key(Choice(("generate", "splice", "pose", "retarget", "follow"), "kind")),
        **own,
        "fps": Key(Number(1.0, HIGHEST_FPS), Option("frames per second of the scene", "FPS")),
        "output": Key(File("format to save to", (".blend",), is_written=True), output),
        "export": Key(_exports, export),
    }


KINDS: Final[dict[str, dict[str, Key]]] = {
    "generate": _kind(
        {
            "file": _file("the .blend file to read"),
            "octopus": Key(OCTOPUS),
            "armature": _named("default: the one that has arms"),
            "route": Key(_route, Option("the curve; default: the armature's own")),
            "ground": _named("the mesh to walk on; default: its own"),
            "gait": Key(_gait, Option("a gait by name, or a gait file (.json)")),
            "changes": _items("changes", '{ gait = "swim", position = 0.5 }', "gait", "position"),
            "along": _items(
                "along", '{ setting = "PACE", position = 0.5, pace = 2.0 }', "position"
            ),
            "reaches": _items(
                "reaches", '{ target = "Ball", arm = "Arm 1 L", frame_contact = 40 }'
            ),
            "contacts": _items(
                "contacts", '{ arm = "Arm 1 L", cycle = 2, shift = 0.1 }', "arm", "cycle"
            ),
            "settings": _settings(
                "generate", "a setting, such as speed=0.4, sway=12° or table.stride=1.2"
            ),
            "limits": Key(
                LIMITS,
                Option(
                    f"write nothing if a figure of the motion ({', '.join(NAMES)}) is above; "
                    "may be repeated",
                    "NAME=VALUE",
                    ("--limit",),
                    partial(parse_assignments, option="--limit"),
                ),
            ),
        },
        "the creature",
    ),
    "splice": _kind(
        {
            "file": _file("the motion or .blend file to splice onto, before any --splice"),
            "armature": _named("default: the one that has splices"),
            "base": _named("default: the list's, or the armature's own", "ACTION"),
            "frames": Key(
                Number(2, _MOST_FRAMES, whole=True),
                Option(
                    "how long the base lasts: a walk of one cycle is repeated, a longer one is cut",
                    "N",
                ),
            ),
            "splices": Key(
                SPLICES,
                Option(
                    "a part, the motion file that it is from, and settings; may be repeated",
                    ("PART", "FILE NAME=VALUE"),
                    ("--splice",),
                    parse_splices,
                ),
            ),
            "settings": _settings(
                "splice", "a setting of the base, such as visual=true or landmarks.chest=Spine2"
            ),
        },
        "the armature and what hangs on it",
    ),
    "pose": _kind(
        {
            "file": _file("the .blend file to read"),
            "octopus": Key(OCTOPUS),
            "armature": _named("default: the only one, or the active one"),
            "script": Key(_script, Option("the pose script (.json)", "FILE", required=True)),
        },
        "the figure",
    ),
    "retarget": _kind(
        {
            "file": _file("the .blend file, or motion file, with the armature that gets the clips"),
            "armature": _named("default: the only one, or the active one"),
            "clips": Key(
                _clips,
                Option(
                    "a motion file, or a folder of such files; may be repeated",
                    "FILE",
                    ("--clips",),
                    collect=list,
                    required=True,
                ),
            ),
            "ground": _named("the mesh to stand on; default: level ground"),
            "settings": _settings(
                "retarget", "a setting, such as foot_lock=false or landmarks.chest=Spine2"
            ),
        },
        "the armature and what hangs on it",
    ),
    "follow": _kind(
        {
            "file": _file("the .blend or motion file with the action, before any --chain"),
            "armature": _named("default: the only one, or the active one"),
            "base": _named("the action to follow; default: the armature's own", "ACTION"),
            "chains": Key(
                CHAINS,
                Option(
                    "first and last bone of a chain, and settings of it; may be repeated; default: "
                    "the file's list, or what hangs loose by its names",
                    ("FIRST", "LAST NAME=VALUE"),
                    ("--chain",),
                    parse_chains,
                ),
            ),
            "settings": _settings(
                "follow", "a setting, such as material=limp, gravity=1 or damping=0.4"
            ),
        },
        "the armature and what hangs on it",
    ),
}
"""The keys of each kind of shot."""


def is_motion(path: Path) -> bool:
    """Whether a file is one of motion, judged by its name."""
    return path.suffix.lower() in MOTION_SUFFIXES


def kind_of(given: Mapping[str, Any]) -> str:
    """The kind of shot that a table asks for, one of ``KINDS`` whatever it says."""
    kind = str(given.get("kind", "")).strip().lower()
    return kind if kind in KINDS else "generate"


def read_shot(given: Mapping[str, Any], reading: Reading) -> ShotRequest:
    """The shot that a table asks for; what is wrong with it is told to the reading."""
    kind = kind_of(given)
    own = dict(given)
    for name in given:
        others = [each for each in KINDS if name in KINDS[each]]
        if others and kind not in others:
            reading.fault(f'{name} is for shots with kind = "{others[0]}".')
            del own[name]
    table = Table(
        {name: key.kind for name, key in KINDS[kind].items()},
        what="key",
        needed=("name",),
        finish=_CHECKS[kind],
    )
    values = table(own, reading)
    if "output" not in values and values.get("export", ()) == ():
        reading.fault('It writes nothing: give output = "….blend", or export.')
    # What is wrong was told: the rest is as if it had not been said.
    said = {name: value for name, value in values.items() if value is not None}
    return ShotRequest(**said)


def _check_generate(values: dict[str, Any], reading: Reading) -> dict[str, Any]:
    _check_creature(values, reading)
    if "octopus" in values:
        route, ground = values.get("route"), values.get("ground")
        travels = (values.get("settings") or {}).get("travel_on") != "NONE"
        if isinstance(route, str):
            reading.fault(f"A new octopus has no curve '{route}': give the route's points.")
        elif "route" not in values and travels:
            reading.fault("A new octopus has no route: give the route's points.")
        if ground:
            reading.fault(f"A new octopus has no ground '{ground}': leave it to walk on its route.")
    limits = values.get("limits") or {}
    return {
        **values,
        "limits": {name: each for name, each in limits.items() if math.isfinite(each)},
    }


def _check_splice(values: dict[str, Any], reading: Reading) -> dict[str, Any]:
    file = values.get("file")
    if "file" not in values and not reading.has_open_file:
        reading.fault('It has no base: give file, a motion file or "….blend".')
    if file is not None and is_motion(file) and "splices" not in values:
        reading.fault("It splices nothing: give splices, a list of tables.")
    return values


def _check_pose(values: dict[str, Any], reading: Reading) -> dict[str, Any]:
    _check_creature(values, reading)
    if "script" not in values:
        reading.fault('It poses nothing: give script = "….json", a pose script.')
    return values


def _check_retarget(values: dict[str, Any], reading: Reading) -> dict[str, Any]:
    values = dict(values)
    if "file" not in values and not reading.has_open_file:
        reading.fault('It has no armature: give file, "….blend" or a motion file.')
    clips = values.pop("clips", ())
    if clips == ():
        reading.fault("It retargets nothing: give clips, a folder or a list of motion files.")
    return {**values, "splices": [NewSplice(clip=path) for path in clips or ()]}


def _check_follow(values: dict[str, Any], reading: Reading) -> dict[str, Any]:
    values = dict(values)
    if "file" not in values and not reading.has_open_file:
        reading.fault('It has no armature: give file, "….blend" or a motion file.')
    if "chains" in values:
        values["changes"] = values.pop("chains")
    return values


_CHECKS: Final = {
    "generate": _check_generate,
    "splice": _check_splice,
    "pose": _check_pose,
    "retarget": _check_retarget,
    "follow": _check_follow,
}


def _check_creature(values: Mapping[str, Any], reading: Reading) -> None:
    """The file that has it, or the octopus that is to be made."""
    file = values.get("file")
    if file is not None and is_motion(file):
        reading.fault(f"'{file.name}' is a motion file, which is for kind = \"splice\".")
    if file is not None and values.get("octopus") is not None:
        reading.fault("It has a file and a new octopus: give one of the two.")
    elif not ({"file", "octopus"} & values.keys() or reading.has_open_file):
        reading.fault('It has no creature: give file = "….blend", or octopus = {} for a new one.')
