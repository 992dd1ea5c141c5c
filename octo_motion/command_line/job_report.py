# SPDX-License-Identifier: GPL-3.0-or-later
"""The report of a job: what became of each shot, how good its motion is, and what a later run needs
to know to skip it.
"""

from __future__ import annotations

import hashlib
import json
import math
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal

from ..core.errors import OctoMotionError, WriteError
from ..core.locomotion.metrics import Figure
from .outputs import commit, staged, unwritable
from .shot_schema import NAMES


def fingerprint(asked: Mapping[str, Any], gait: str) -> str:
    """Digits that change with the shot's table, the gait's content and our version.

    Files that are read have digests of their own, see :func:`digest`.
    """
    content = {"asked": asked, "gait": gait, "version": version()}
    text = json.dumps(content, sort_keys=True, ensure_ascii=False, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def digest(path: Path) -> str:
    """SHA-256 of a file's content, or "" where there is none that can be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


@cache
def version() -> str:
    """Our version, from the manifest: in an installed extension beside the code, else above it."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package, package.parent):
        manifest = folder / "blender_manifest.toml"
        if manifest.is_file():
            return str(tomllib.loads(manifest.read_text(encoding="utf-8"))["version"])
    return "unknown"


# --- Figures of how good a motion is, for the report, and limits that let a shot fail -------------


_DEGREES: Final = "turn"
"""What people know in degrees."""
_LOOKED_FOR: Final = "overlap"
"""What is measured only where the settings say so."""


class LimitError(OctoMotionError):
    """A motion is not as good as it has to be.

    ``summary`` is that of the motion, whose outputs are not to be kept.
    """

    def __init__(self, problem: str, summary: Any, remedy: str = "") -> None:
        super().__init__(problem, remedy)
        self.summary = summary


def quality(figures: Sequence[Figure]) -> dict[str, dict[str, Any]]:
    """Figures for a report: value, frame and arm of the worst of each kind, by name.

    Values are in arm lengths (slip, depth, miss), shares (strain), degrees per frame (turn) and
    radii (overlap); none for what is no finite number, which JSON does not know.
    """
    return {
        figure.kind.lower(): {
            "value": _value(figure) if math.isfinite(figure.value) else None,
            "frame": figure.frame,
            "arm": figure.arm,
        }
        for figure in figures
    }


def figures_in_words(figures: Sequence[Figure]) -> str:
    """Figures in words, in the units of :func:`quality`."""
    return "; ".join(
        f"{figure.kind.lower()} {_value(figure):.3g} at frame {figure.frame}{_of_arm(figure)}"
        for figure in figures
    )


def check_limits(limits: Mapping[str, float], summary: Any) -> None:
    """Make sure that a motion is as good as it has to be: limits are in the units of ``quality``.

    A figure that it does not have, such as the slip of a swim, keeps to any limit.

    Raises:
        LimitError: a figure is above its limit, or nobody has looked.
    """
    found = {figure.kind.lower(): figure for figure in summary.figures}
    if _LOOKED_FOR in limits and _LOOKED_FOR not in found:
        raise LimitError(
            "Overlaps are limited, but were not looked for.",
            summary,
            "Switch tell_overlaps on, or leave the limit out.",
        )
    above = []
    for name in NAMES:
        if name not in limits or name not in found:
            continue
        figure, limit = found[name], limits[name]
        value = _value(figure)
        # What is no number keeps to no limit.
        if not value <= limit:
            above.append(
                f"{name} is {_value_above(value, limit)} at frame {figure.frame}{_of_arm(figure)}, "
                f"above its limit of {limit:g}"
            )
    if above:
        sentence = "; ".join(above)
        raise LimitError(f"{sentence[0].upper()}{sentence[1:]}.", summary)


def _value(figure: Figure) -> float:
    name = figure.kind.lower()
    return math.degrees(figure.value) if name == _DEGREES else figure.value


def _of_arm(figure: Figure) -> str:
    return f" ({figure.arm})" if figure.arm else ""


def _value_above(value: float, limit: float) -> str:
    """A value with as many digits as it takes to see that it is above its limit."""
    texts = (f"{value:.{digits}g}" for digits in range(3, 17))
    return next((text for text in texts if not float(text) <= limit), repr(value))


# --- The report -----------------------------------------------------------------------------------


FORMAT: Final = "octo_motion.report"
FORMAT_VERSION: Final = 1

RECORD_FORMAT: Final = "octo_motion.record"
REPORT_ENDING: Final = ".report.json"

Status = Literal["done", "skipped", "failed"]
Cause = Literal["", "again", "final", "crash"]
"""Of a failure: it may go well if it is tried again, or on another machine; it will not, for it is
the rig's, the limits' or the files'; or Blender came to its end.
"""


@dataclass(frozen=True)
class ShotSummary:
    """What was made of a shot that is spliced or posed, for people and for reports."""

    message: str
    frames: int
    frame_start: int
    frame_end: int
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class ShotRecord:
    """What became of one shot. Paths are relative to the job's folder where that is possible."""

    name: str
    status: Status
    error: str = ""
    frames: int | None = None
    frame_start: int | None = None
    frame_end: int | None = None
    seconds: float | None = None
    """What the shot took when it was baked."""
    warnings: list[str] = field(default_factory=list)
    quality: dict[str, dict[str, Any]] = field(default_factory=dict)
    """The worst of each figure, of a motion that was generated."""
    keys: int | None = None
    """Its keys …"""
    dense_keys: int | None = None
    """… and how many there would be with one per frame."""
    outputs: dict[str, str] = field(default_factory=dict)
    """Digest of each file that was written."""
    inputs: dict[str, str] = field(default_factory=dict)
    """Digest of each file that was read: the scene, its libraries, the gait."""
    fingerprint: str = ""
    earlier_outputs: dict[str, str] = field(default_factory=dict)
    """Of a failed shot: what an earlier run has written, and is still there."""
    log: str = ""
    """Of a failed shot: the last that Blender said."""
    cause: Cause = ""
    motion: str = ""
    """Digest of all keys, the same wherever the shot is made."""
    action: str = ""
    """Name of its action in the .blend file."""

    def wrote(self, path: str, found: str) -> bool:
        """Whether a file with a digest is this job's work."""
        return found in {self.earlier_outputs.get(path), self.outputs.get(path)}

    @property
    def written(self) -> dict[str, str]:
        """Digests of all files that are this job's work."""
        return {**self.earlier_outputs, **self.outputs}


@dataclass(frozen=True)
class Verdict:
    """Whether a shot has to be baked; ``reason`` says why it may not be."""

    skip: bool
    reason: str = ""
    kept: tuple[str, ...] = ()
    """Outputs of a shot to skip that somebody has changed since."""

    @property
    def must_bake(self) -> bool:
        """Whether it is new or has changed, and nothing stands in the way."""
        return not (self.skip or self.reason)


def judge(
    record: ShotRecord | None,
    fingerprint: str,
    inputs: Iterable[str],
    wanted: Iterable[str],
    digest: Callable[[str], str],
) -> Verdict:
    """Compare a shot as it is now, its inputs and wanted outputs, with its record of the run
    before.

    A result that somebody has worked on since is never lost: while nothing else has changed the
    shot is skipped, otherwise it must not be baked. The digest is "" where there is no file.
    """
    paths = list(wanted)
    found = {path: digest(path) for path in paths}
    changed = tuple(
        path
        for path, value in found.items()
        if value and not (record and record.wrote(path, value))
    )
    if (
        record is not None
        # One that failed has outputs if it was stopped while they took their places.
        and (record.status != "failed" or found == record.outputs)
        and record.fingerprint == fingerprint
        and set(inputs) <= set(record.inputs)
        and all(digest(path) == value for path, value in record.inputs.items())
        and all(found.values())
        and set(paths) == set(record.outputs)
    ):
        return Verdict(skip=True, kept=changed)
    if not changed:
        return Verdict(skip=False)
    path = changed[0]
    known = record is not None and path in record.written
    what = "has been changed since it was baked" if known else "is there already"
    return Verdict(
        skip=False, reason=f"'{path}' {what}. Move it away, or give --force to overwrite it."
    )


def read_report(path: Path) -> dict[str, ShotRecord]:
    """The records of a report by shot; none if there is no report.

    Raises:
        OctoMotionError: the file is no report, so that it must not be overwritten.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if (content["format"], content["format_version"]) != (FORMAT, FORMAT_VERSION):
            raise _not_a_report(path)
        records = [_record(shot) for shot in content["shots"]]
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise WriteError(
            f"The report '{path}' cannot be read: {error.strerror}.", "Give another with --report."
        ) from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise _not_a_report(path) from error
    return {record.name: record for record in records}


def _not_a_report(path: Path) -> OctoMotionError:
    return OctoMotionError(
        f"'{path}' is not a report that this version of Octo Motion can read.",
        "Move it away, or give another with --report.",
    )


def write_report(path: Path, job: Path, records: Iterable[ShotRecord]) -> Counter[str]:
    """Write the report, whole or not at all; how many shots have each status.

    Records are taken one after the other: there may be more than the memory holds.

    Raises:
        WriteError: it cannot be written.
    """
    counts: Counter[str] = Counter()
    head = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "octo_motion": version(),
        "job": job.name,
    }
    with staged([path]) as places:
        try:
            with places[path].open("w", encoding="utf-8", newline="\n") as file:
                file.write(f'{_json(head)[:-2]},\n "shots": [')
                for record in records:
                    file.write(f"{',' if counts else ''}\n{_json(asdict(record))}")
                    counts[record.status] += 1
                told = {status: counts[status] for status in ("done", "skipped", "failed")}
                file.write(f"\n ],{_json(told)[1:]}\n")
        except OSError as error:
            raise unwritable(f"'{path}'", error) from error
        commit(places)
    return counts


def _json(content: Mapping[str, Any]) -> str:
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)


def read_record(path: Path) -> ShotRecord | None:
    """The record of one shot; None if there is none, or it is damaged: then the shot is looked at
    as if it had none.

    Raises:
        WriteError: it is there and cannot be read.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if (content["format"], content["format_version"]) == (RECORD_FORMAT, FORMAT_VERSION):
            return _record(content["shot"])
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise WriteError(
            f"The record '{path}' cannot be read: {error.strerror}.", "Try again."
        ) from error
    except (ValueError, KeyError, TypeError, AttributeError):
        return None
    return None


def record_file(job: Path, record: ShotRecord) -> dict[str, Any]:
    """What the file of a shot's record has."""
    return {
        "format": RECORD_FORMAT,
        "format_version": FORMAT_VERSION,
        "octo_motion": version(),
        "job": job.name,
        "shot": asdict(record),
    }


def _record(shot: Mapping[str, Any]) -> ShotRecord:
    known = {each.name for each in fields(ShotRecord)}
    return ShotRecord(**{key: value for key, value in shot.items() if key in known})
