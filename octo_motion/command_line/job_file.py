# SPDX-License-Identifier: GPL-3.0-or-later
"""Job files: many shots in one TOML file, checked as a whole before anything runs.

What the text itself says is checked here; whether the files that it names can be used is seen
when they are looked at, and concerns one shot alone.
"""

from __future__ import annotations

import dataclasses
import math
import os
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from ..core.errors import OctoMotionError
from ..core.locomotion.gait import GaitError, GaitTable, gait_from_json, gait_to_json
from ..core.locomotion.octopus import OctopusShape
from ..core.posing.pose_script import parse_script
from .motion_files import is_motion
from .quality_limits import read_limits
from .setting_values import Setting, check_settings, unknown
from .shot_lists import LISTS, Items, read_list
from .shot_request import (
    EXPORT_SUFFIXES,
    HIGHEST_FPS,
    MOST_FRAMES,
    NewOctopus,
    NewRoute,
    Points,
    ShotEntry,
    SpliceWork,
)
from .splice_entries import read_splices

KINDS: Final = {
    "generate": (
        *("name", "kind", "file", "octopus", "armature", "route", "ground", "gait", "settings"),
        *("fps", *LISTS, "limits", "output", "export"),
    ),
    "splice": (
        *("name", "kind", "file", "armature", "base", "frames", "splices", "settings", "fps"),
        *("output", "export"),
    ),
    "pose": ("name", "kind", "file", "octopus", "armature", "script", "fps", "output", "export"),
}
"""What a shot of each kind may say."""
KEYS: Final = tuple(dict.fromkeys(key for keys in KINDS.values() for key in keys))
_OCTOPUS_KEYS: Final = (*(each.name for each in dataclasses.fields(OctopusShape)), "with_mesh")
_ROUTE_KEYS: Final = ("control_points", "points", "cyclic")
_POINTS: Final = "each of three numbers, [x, y, z]"


class JobError(OctoMotionError):
    """The job is wrong; ``faults`` has a sentence or two for each reason."""

    def __init__(self, source: str, faults: Sequence[str]) -> None:
        self.faults = tuple(faults)
        count = "1 fault" if len(faults) == 1 else f"{len(faults)} faults"
        listed = "\n".join(f"  {fault}" for fault in faults)
        super().__init__(f"{source} has {count}; nothing was run:\n{listed}")


@dataclass(frozen=True)
class Known:
    """What a shot may name."""

    settings: Mapping[str, Setting]
    gait: Callable[[str], GaitTable]
    """A gait by name; raises GaitError."""
    splicing_settings: Mapping[str, Setting] = field(default_factory=dict)
    """Of a shot that splices."""
    splice_settings: Mapping[str, Setting] = field(default_factory=dict)
    """Of each splice in its list."""
    lists: Mapping[str, Mapping[str, Setting]] = field(default_factory=dict)
    """Of each item in the lists of a shot that is to walk or swim."""


@dataclass(frozen=True)
class JobShot:
    """A shot of a job file."""

    entry: ShotEntry
    asked: dict[str, Any]
    """The shot's table with the defaults filled in, as it stands in the file."""
    gait_file: Path | None = None

    @property
    def inputs(self) -> tuple[Path, ...]:
        """All files that the shot names to be read."""
        return (*self.entry.inputs, *((self.gait_file,) if self.gait_file else ()))


@dataclass(frozen=True)
class JobFile:
    """A job file that was found to be in order."""

    path: Path
    shots: tuple[JobShot, ...]


def read_job(path: Path, known: Known, report: Path) -> JobFile:
    """The shots of a job file.

    Args:
        path: the file.
        known: what shots may name.
        report: the report's path, which no output may have.

    Raises:
        JobError: the file cannot be read or is wrong, with everything that is wrong with it.
    """
    path = path.resolve()
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise JobError(f"'{path}'", [f"It cannot be read: {error.strerror}."]) from error
    except UnicodeDecodeError as error:
        raise JobError(f"'{path}'", ["It is not a text in UTF-8."]) from error
    except tomllib.TOMLDecodeError as error:
        raise JobError(f"'{path}'", [f"It is not TOML: {error}."]) from error
    faults: list[str] = [
        unknown("table", name, ("defaults", "shots"))
        for name in content
        if name not in {"defaults", "shots"}
    ]
    defaults = content.get("defaults", {})
    if not isinstance(defaults, dict):
        faults.append("defaults: It must be a table, [defaults].")
        defaults = {}
    if "name" in defaults:
        faults.append("defaults: A name belongs to one shot.")
    tables = content.get("shots", [])
    if not isinstance(tables, list) or not all(isinstance(each, dict) for each in tables):
        faults.append("shots: Write each shot as a table of its own, [[shots]].")
        tables = []
    elif not tables:
        faults.append("There are no shots: write each as a table of its own, [[shots]].")
    shots = [
        _Reader(_merged(defaults, table), path.parent, known, place, faults).shot()
        for place, table in enumerate(tables, 1)
    ]
    faults += _name_faults([shot.entry.name for shot in shots])
    faults += _path_faults(shots, path, report)
    if faults:
        raise JobError(f"'{path}'", faults)
    return JobFile(path, tuple(shots))


def load_gait_file(shot: JobShot) -> ShotEntry:
    """The entry with the content of its gait file, if it has one.

    Raises:
        GaitError: it cannot be read, or is no gait.
    """
    if shot.gait_file is None:
        return shot.entry
    return replace(shot.entry, gait=gait_to_json(read_gait_file(shot.gait_file)))


def read_gait_file(path: Path) -> GaitTable:
    """The gait in a file.

    Raises:
        GaitError: it cannot be read, or is no gait.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or "it is not text"
        raise GaitError(f"'{path}' cannot be read: {reason}.", "Give a gait file.") from error
    return gait_from_json(text, f"'{path}'")


def is_gait_file(name: str) -> bool:
    """Whether a gait is given as a file rather than by name."""
    return name.lower().endswith(".json")


def _merged(defaults: dict[str, Any], table: dict[str, Any]) -> dict[str, Any]:
    kind = table.get("kind", defaults.get("kind", "generate"))
    of_others = {key for keys in KINDS.values() for key in keys}
    of_others -= set(KINDS.get(kind, KEYS) if isinstance(kind, str) else KEYS)
    # What only shots of another kind have is not meant for this one.
    merged = {key: value for key, value in defaults.items() if key not in {"name", *of_others}}
    # A shot that says where its creature comes from does not mean the defaults' other one.
    for key, other in (("file", "octopus"), ("octopus", "file")):
        if key in table and other not in table:
            merged.pop(other, None)
    for key, value in table.items():
        shared = merged.get(key)
        if (
            key in {"settings", "octopus", "limits"}
            and isinstance(value, dict)
            and isinstance(shared, dict)
        ):
            merged[key] = _united(shared, value)
        else:
            merged[key] = value
    return merged


def _united(shared: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    result = dict(shared)
    for key, value in own.items():
        before = result.get(key)
        if isinstance(value, dict) and isinstance(before, dict):
            result[key] = _united(before, value)
        else:
            result[key] = value
    return result


class _Reader:
    """Turns one table into a shot, and notes everything that is wrong with it."""

    def __init__(
        self, table: dict[str, Any], folder: Path, known: Known, place: int, faults: list[str]
    ) -> None:
        self._table = table
        self._folder = folder
        self._known = known
        self._faults = faults
        name = table.get("name")
        self._name = name if isinstance(name, str) and name.strip() else ""
        self._label = f"shot '{self._name}'" if self._name else f"shot number {place}"
        if not self._name:
            self._fault('It has no name: write name = "…".')

    def shot(self) -> JobShot:
        kind = self._table.get("kind", "generate")
        if not isinstance(kind, str) or kind not in KINDS:
            self._fault(unknown("kind", str(kind), KINDS))
            kind = "generate"
        for key in self._table:
            if key not in KINDS[kind]:
                self._fault(self._strange(key, kind))
        makers = {"splice": self._splicing, "pose": self._posing}
        return makers.get(kind, self._generating)()

    def _strange(self, key: str, kind: str) -> str:
        others = [each for each in KINDS if key in KINDS[each]]
        if others:
            return f'{key} is for shots with kind = "{others[0]}".'
        return unknown("key", key, KINDS[kind])

    def _creature(self) -> tuple[Path | None, NewOctopus | None]:
        """The file that has it, or the octopus that is to be made."""
        file, octopus = self._path("file"), self._octopus()
        if file is not None and is_motion(file):
            self._fault(f"'{file.name}' is a motion file, which is for kind = \"splice\".")
        if file is not None and octopus is not None:
            self._fault("It has a file and a new octopus: give one of the two.")
        elif "file" not in self._table and "octopus" not in self._table:
            self._fault('It has no creature: give file = "….blend", or octopus = {} for a new one.')
        return file, octopus

    def _posing(self) -> JobShot:
        file, octopus = self._creature()
        script = self._path("script")
        if script is None:
            self._fault('It poses nothing: give script = "….json", a pose script.')
        else:
            try:
                parse_script(script.read_text(encoding="utf-8"), script.name)
            except OctoMotionError as error:
                self._fault(str(error))
            except (OSError, UnicodeDecodeError) as error:
                self._fault(f"The script '{script.name}' cannot be read: {error}.")
        output, exports = self._outputs()
        entry = ShotEntry(
            name=self._name,
            file=file,
            octopus=octopus,
            armature="" if octopus else self._text("armature"),
            fps=self._fps(),
            output=output,
            exports=exports,
            posing=script,
        )
        return JobShot(entry, self._table)

    def _generating(self) -> JobShot:
        file, octopus = self._creature()
        gait_text, gait_file = self._gait()
        output, exports = self._outputs()
        entry = ShotEntry(
            name=self._name,
            file=file,
            octopus=octopus,
            armature="" if octopus else self._text("armature"),
            route=self._route(),
            ground=self._ground(),
            lists=self._lists(),
            gait=gait_text,
            settings=self._settings(self._known.settings),
            fps=self._fps(),
            output=output,
            exports=exports,
            limits=self._limits(),
        )
        return JobShot(entry, self._table, gait_file)

    def _splicing(self) -> JobShot:
        file = self._path("file")
        if "file" not in self._table:
            self._fault('It has no base: give file, a motion file or "….blend".')
        splices = None
        if "splices" in self._table:
            splices, faults = read_splices(
                self._table["splices"], self._known.splice_settings, self._resolved
            )
            for fault in faults:
                self._fault(fault)
        elif file is not None and is_motion(file):
            self._fault("It splices nothing: give splices, a list of tables.")
        output, exports = self._outputs()
        entry = ShotEntry(
            name=self._name,
            file=file,
            armature=self._text("armature"),
            settings=self._settings(self._known.splicing_settings),
            fps=self._fps(),
            output=output,
            exports=exports,
            splicing=SpliceWork(self._text("base"), self._frames(), splices),
        )
        return JobShot(entry, self._table)

    def _outputs(self) -> tuple[Path | None, tuple[Path, ...]]:
        exports = self._exports()
        output = self._path("output")
        if output is not None and output.suffix.lower() != ".blend":
            self._fault(f"The output '{output.name}' must end in .blend.")
        if "output" not in self._table and not exports:
            self._fault('It writes nothing: give output = "….blend", or export.')
        return output, exports

    def _fault(self, sentences: str) -> None:
        self._faults.append(f"{self._label}: {sentences}")

    def _text(self, key: str) -> str:
        value = self._table.get(key, "")
        if not isinstance(value, str) or (key in self._table and not value.strip()):
            self._fault(f"{key} must be a text, not {value!r}.")
            return ""
        return value

    def _path(self, key: str) -> Path | None:
        text = self._text(key)
        return self._resolved(text) if text else None

    def _resolved(self, text: str) -> Path:
        # An output that is a link is written where the link leads.
        return (self._folder / Path(text.replace("{name}", self._name)).expanduser()).resolve()

    def _octopus(self) -> NewOctopus | None:
        table = self._table.get("octopus")
        if table is None:
            return None
        if not isinstance(table, dict):
            self._fault(f"octopus must be a table, such as {{ arms = 8 }}, not {table!r}.")
            return None
        names = [name for name in table if name not in _OCTOPUS_KEYS]
        for name in names:
            self._fault(f"octopus: {unknown('parameter', name, _OCTOPUS_KEYS)}")
        with_mesh = table.get("with_mesh", True)
        if not isinstance(with_mesh, bool):
            self._fault(f"octopus: with_mesh must be true or false, not {with_mesh!r}.")
        numbers: dict[str, Any] = {}
        for each in dataclasses.fields(OctopusShape):
            if each.name not in table:
                continue
            value, is_whole = table[each.name], isinstance(each.default, int)
            accepted = int if is_whole else int | float
            if isinstance(value, bool) or not isinstance(value, accepted):
                kind = "a whole number" if is_whole else "a number"
                self._fault(f"octopus: {each.name} must be {kind}, not {value!r}.")
            else:
                numbers[each.name] = value
        try:
            return NewOctopus(OctopusShape(**numbers), with_mesh=bool(with_mesh))
        except OctoMotionError as error:
            self._fault(f"octopus: {error}")
            return None

    def _route(self) -> str | NewRoute:
        route = self._table.get("route", "")
        if isinstance(route, list):
            return self._control_points(route)
        if isinstance(route, dict):
            return self._route_table(route)
        name = self._text("route")
        if "octopus" in self._table:
            if name:
                self._fault(f"A new octopus has no curve '{name}': give the route's points.")
            elif "route" not in self._table and not self._stays():
                self._fault("A new octopus has no route: give the route's points.")
        return name

    def _ground(self) -> str:
        name = self._text("ground")
        if name and "octopus" in self._table:
            self._fault(f"A new octopus has no ground '{name}': leave it to walk on its route.")
        return name

    def _lists(self) -> dict[str, Items]:
        """The lists that the shot has of its own."""
        found: dict[str, Items] = {}
        for name in LISTS:
            if name not in self._table:
                continue
            known = self._known.lists.get(name, {})
            found[name], faults = read_list(name, self._table[name], known, self._known.gait)
            for fault in faults:
                self._fault(fault)
        return found

    def _stays(self) -> bool:
        """Whether the settings let nothing travel, which takes no route."""
        settings = self._table.get("settings")
        travel_on = settings.get("travel_on") if isinstance(settings, dict) else None
        return isinstance(travel_on, str) and travel_on.strip().upper() == "NONE"

    def _route_table(self, route: dict[str, Any]) -> str | NewRoute:
        for key in route:
            if key not in _ROUTE_KEYS:
                self._fault(f"route: {unknown('key', key, _ROUTE_KEYS)}")
        cyclic = route.get("cyclic", False)
        if not isinstance(cyclic, bool):
            self._fault(f"route: cyclic must be true or false, not {cyclic!r}.")
        if ("control_points" in route) == ("points" in route):
            self._fault(
                "route: give either control_points (four) or points (that it leads through)."
            )
            return ""
        if "control_points" in route:
            if cyclic:
                self._fault("route: four control points make no cyclic route: give points.")
            return self._control_points(route["control_points"])
        points = self._points(route["points"])
        if points is None:
            return ""
        if len(set(points)) < (3 if cyclic else 2):
            least = "three" if cyclic else "two"
            self._fault(f"route: points must be at least {least} that lie apart.")
            return ""
        return NewRoute(points, is_bezier=False, cyclic=bool(cyclic))

    def _control_points(self, given: Any) -> str | NewRoute:
        points = self._points(given)
        if points is None:
            return ""
        if len(points) != 4:
            self._fault(
                f"route: control points are four, not {len(points)}. For a route that leads "
                "through points write route = { points = […] }."
            )
            return ""
        if len(set(points)) == 1:
            self._fault("route: its control points are all the same.")
            return ""
        return NewRoute(points, is_bezier=True)

    def _points(self, given: Any) -> Points | None:
        if isinstance(given, list) and given and all(_is_point(each) for each in given):
            return tuple((float(x), float(y), float(z)) for x, y, z in given)
        self._fault(f"route: its points must be a list of points, {_POINTS}.")
        return None

    def _gait(self) -> tuple[str, Path | None]:
        name = self._text("gait")
        if not name:
            return "", None
        if is_gait_file(name):
            return "", self._resolved(name)
        try:
            return gait_to_json(self._known.gait(name)), None
        except OctoMotionError as error:
            self._fault(str(error))
            return "", None

    def _settings(self, known: Mapping[str, Setting]) -> dict[str, Any]:
        given = self._table.get("settings", {})
        if not isinstance(given, dict):
            self._fault(f"settings must be a table, not {given!r}.")
            return {}
        values, faults = check_settings(known, given)
        for fault in faults:
            self._fault(fault)
        return values

    def _limits(self) -> dict[str, float]:
        limits, faults = read_limits(self._table.get("limits", {}))
        for fault in faults:
            self._fault(fault)
        return limits

    def _fps(self) -> float | None:
        fps = self._table.get("fps")
        if fps is None:
            return None
        if isinstance(fps, bool) or not isinstance(fps, int | float) or not 1 <= fps <= HIGHEST_FPS:
            self._fault(f"fps must be a number from 1 to {HIGHEST_FPS}, not {fps!r}.")
            return None
        return float(fps)

    def _frames(self) -> int | None:
        frames = self._table.get("frames")
        if frames is None:
            return None
        if (
            isinstance(frames, bool)
            or not isinstance(frames, int)
            or not 2 <= frames <= MOST_FRAMES
        ):
            self._fault(f"frames must be a whole number from 2 to {MOST_FRAMES}, not {frames!r}.")
            return None
        return frames

    def _exports(self) -> tuple[Path, ...]:
        given = self._table.get("export", [])
        listed = [given] if isinstance(given, str) else given
        if not isinstance(listed, list) or not all(isinstance(each, str) for each in listed):
            self._fault(f"export must be a path or a list of paths, not {given!r}.")
            return ()
        for each in listed:
            if fault := export_fault(Path(each)):
                self._fault(fault)
        return tuple(self._resolved(each) for each in listed)


def export_fault(path: Path) -> str:
    """What is wrong with a file to export to, judged by its name; "" if nothing is."""
    suffix = path.suffix.lower()
    if suffix in EXPORT_SUFFIXES:
        return ""
    if suffix == ".gltf":
        return f"'{path.name}' would be several files: export to .glb, the same in one."
    return f"'{path.name}' is no format to export to. Valid: {', '.join(EXPORT_SUFFIXES)}."


def _is_point(given: Any) -> bool:
    return (
        isinstance(given, list)
        and len(given) == 3
        and all(isinstance(each, int | float) and not isinstance(each, bool) for each in given)
        and all(math.isfinite(each) for each in given)
    )


def _name_faults(names: Iterable[str]) -> list[str]:
    counts: dict[str, int] = {}
    for name in names:
        if name:
            counts[name] = counts.get(name, 0) + 1
    return [
        f"shot '{name}': {count} shots have this name."
        for name, count in counts.items()
        if count > 1
    ]


def _path_faults(shots: Sequence[JobShot], job: Path, report: Path) -> list[str]:
    """Outputs that would overwrite what is read, or one another."""
    owners = {_key(job): "the job file itself", _key(report.resolve()): "the report"}
    for shot in shots:
        for path in shot.inputs:
            owners.setdefault(_key(path), f"an input of shot '{shot.entry.name}'")
    faults = []
    for shot in shots:
        for path in shot.entry.outputs:
            owner = owners.get(_key(path))
            if owner is not None:
                faults.append(
                    f"shot '{shot.entry.name}': Its output '{path}' is {owner}: give another."
                )
            owners.setdefault(_key(path), f"an output of shot '{shot.entry.name}' too")
    return faults


def _key(path: Path) -> str:
    return os.path.normcase(path)
