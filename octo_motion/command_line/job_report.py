# SPDX-License-Identifier: GPL-3.0-or-later
"""The report of a job: what became of each shot, and what a later run needs to know to skip it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Final, Literal

from ..core.errors import OctoMotionError, WriteError
from . import outputs
from .fingerprint import version

FORMAT: Final = "octo_motion.report"
FORMAT_VERSION: Final = 1

Status = Literal["done", "skipped", "failed"]


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


def judge(
    record: ShotRecord | None,
    fingerprint: str,
    inputs: Iterable[str],
    wanted: Iterable[str],
    digest: Callable[[str], str],
) -> Verdict:
    """Compare a shot with its record.

    A result that somebody has worked on since is never lost: while nothing else has changed the
    shot is skipped, otherwise it must not be baked.

    Args:
        record: of the run before, if any.
        fingerprint: of the shot as it is now.
        inputs: paths of the files that the shot names.
        wanted: paths of its outputs.
        digest: of the file at a path, "" where there is none.
    """
    paths = list(wanted)
    written = record.written if record else {}
    found = {path: digest(path) for path in paths}
    changed = tuple(path for path, value in found.items() if value and value != written.get(path))
    if (
        record is not None
        and record.status != "failed"
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
    what = "has been changed since it was baked" if path in written else "is there already"
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
        known = {each.name for each in fields(ShotRecord)}
        records = [
            ShotRecord(**{key: value for key, value in shot.items() if key in known})
            for shot in content["shots"]
        ]
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


def write_report(path: Path, job: Path, records: Iterable[ShotRecord]) -> None:
    """Write the report, whole or not at all.

    Raises:
        WriteError: it cannot be written.
    """
    shots = list(records)
    content: dict[str, Any] = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "octo_motion": version(),
        "job": job.name,
        **{status: count(shots, status) for status in ("done", "skipped", "failed")},
        "shots": [asdict(shot) for shot in shots],
    }
    outputs.write_json(path, content)


def count(records: Iterable[ShotRecord], status: str) -> int:
    """How many shots have a status."""
    return sum(record.status == status for record in records)
