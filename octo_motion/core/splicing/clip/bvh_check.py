# SPDX-License-Identifier: GPL-3.0-or-later
"""BVH files looked at before anything imports them: what is wrong, and in which line.

Sound files are told from damaged ones, and written anew in the plainest form: UTF-8, one keyword a
line, decimal points, one line a frame. The numbers keep their digits. What can be read in one way
only is repaired and noted (byte order marks, UTF-16, line ends of any kind, decimal commas, braces
anywhere, remarks behind the last frame); everything else is refused.
"""

from __future__ import annotations

import codecs
import math
import re
from dataclasses import dataclass, field
from typing import Final, NoReturn

from ...errors import ClipError

FASTEST: Final = 2000.0
"""Frames per second that no motion capture exceeds."""

_MARKS: Final = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_CHANNELS: Final = frozenset(f"{axis}{kind}" for axis in "xyz" for kind in ("position", "rotation"))
_NUMBER: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?$")
_DECIMAL_COMMA: Final = re.compile(r"(?<=\d),(?=\d)")
_REMEDY: Final = "Export it again, or repair that line in a text editor."


@dataclass(frozen=True)
class CheckedBvh:
    """A sound file."""

    text: str
    """The file in its plainest form."""
    frames: int
    rate: float
    """Frames per second."""
    joints: int
    notes: tuple[str, ...]
    """What was repaired or left out: sentences."""


def check_bvh(content: bytes) -> CheckedBvh:
    """Look at a whole file.

    Raises:
        ClipError: it is damaged; the message names the line.
    """
    reader = _Reader(*_decoded(content))
    hierarchy = _Hierarchy(reader)
    hierarchy.read()
    return _with_motion(reader, hierarchy)


def _refuse(problem: str, line: int | None = None) -> NoReturn:
    place = "" if line is None else f"Line {line}: "
    problem = f"{place}{problem}"
    raise ClipError(f"{problem[0].upper()}{problem[1:]}.", _REMEDY)


def _decoded(content: bytes) -> tuple[str, list[str]]:
    """The text, and what had to be done to read it."""
    notes = []
    for mark, encoding in _MARKS:
        if content.startswith(mark):
            try:
                text = content[len(mark) :].decode(encoding)
            except UnicodeDecodeError:
                _refuse(f"it begins like {encoding.upper()} text, but is none")
            if encoding != "utf-8":
                notes.append(f"Its text was {encoding.upper()}.")
            break
    else:
        try:
            text = content.decode("utf-8")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
            notes.append("Its names are not in UTF-8: some letters may look wrong.")
    text = text.replace("\r\n", "\n").replace("\r", "\n").rstrip("\0 \t\n")
    if not text:
        _refuse("the file is empty")
    if "\0" in text:
        _refuse("there are zero bytes in the text", text[: text.index("\0")].count("\n") + 1)
    return text, notes


@dataclass
class _Reader:
    """The lines of the file that are not blank, one after the other."""

    text: str
    notes: list[str]
    place: int = 0
    lines: list[tuple[int, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.lines = [
            (number, line.strip())
            for number, line in enumerate(self.text.split("\n"), start=1)
            if line.strip()
        ]
        first = self.lines[0][1]
        if first.split()[0].upper() != "HIERARCHY":
            _refuse("this is not a BVH file: it does not begin with HIERARCHY", self.lines[0][0])
        motion = next(
            (
                place
                for place, (_, line) in enumerate(self.lines)
                if line.split()[0].upper() == "MOTION"
            ),
            None,
        )
        last = len(self.lines) if motion is None else motion
        head = [(number, _braces_apart(line)) for number, line in self.lines[:last]]
        apart = [(number, part) for number, parts in head for part in parts]
        self.lines = [*apart, *self.lines[last:]]
        self.place = 1 if len(first.split()) == 1 else 0
        if self.place == 0:
            self.lines[0] = (self.lines[0][0], first.split(None, 1)[1])

    @property
    def number(self) -> int:
        """Line of the file, the last one at its end."""
        return self.lines[min(self.place, len(self.lines) - 1)][0]

    @property
    def at_end(self) -> bool:
        return self.place >= len(self.lines)

    def peek(self) -> str:
        return "" if self.at_end else self.lines[self.place][1]

    def next(self, expected: str) -> tuple[int, str]:
        """The next line, or a refusal because the file ends here."""
        if self.at_end:
            _refuse(f"the file ends where {expected} should follow", self.number)
        self.place += 1
        return self.lines[self.place - 1]


def _braces_apart(line: str) -> list[str]:
    """Keyword and braces that stand in one line, one by one."""
    # A brace within a name is the name's: only those at the ends of words count.
    parts = re.split(r"(?:(?<=\s)|^)([{}])(?=\s|$)", line)
    words = [part.strip() for part in parts if part.strip()]
    found: list[str] = []
    for word in words:
        found += re.split(
            r"\s+(?=CHANNELS\s|OFFSET\s|JOINT\s|End\s+Site)", word, flags=re.IGNORECASE
        )
    return found


class _Hierarchy:
    """The joints, and their text in the plainest form."""

    def __init__(self, reader: _Reader) -> None:
        self.reader = reader
        self.out: list[str] = ["HIERARCHY"]
        self.joints = 0
        self.channels = 0

    def read(self) -> None:
        """All roots, up to MOTION."""
        while not self.reader.at_end and self.reader.peek().upper() != "MOTION":
            number, line = self.reader.next("ROOT")
            if line.split()[0].upper() != "ROOT":
                _refuse(f"'{_short(line)}' stands where ROOT or MOTION should", number)
            self._joint("ROOT", line, number)
        if not self.joints:
            _refuse("there is no ROOT", self.reader.number)

    def _joint(self, keyword: str, line: str, number: int) -> None:
        """A joint and all below it. Not by recursion: chains may be long."""
        self._open(keyword, line, number)
        depth = 1
        while depth:
            number, line = self.reader.next("the rest of the hierarchy")
            word = line.split()[0].upper()
            if word == "}":
                depth -= 1
                self.out.append("}")
            elif word == "JOINT":
                self._open("JOINT", line, number)
                depth += 1
            elif word == "END":
                self._brace()
                self.out += ["End Site", "{", self._offset(), "}"]
                closing, line = self.reader.next("a closing brace")
                if line != "}":
                    _refuse(f"'{_short(line)}' stands where a closing brace should", closing)
            elif word == "MOTION":
                _refuse("MOTION comes before all braces are closed", number)
            else:
                _refuse(f"'{_short(line)}' is no part of a hierarchy", number)

    def _open(self, keyword: str, line: str, number: int) -> None:
        name = "_".join(line.split()[1:])
        if not name:
            _refuse("a joint has no name", number)
        self.joints += 1
        self._brace()
        self.out += [f"{keyword} {name}", "{", self._offset(), self._channels()]

    def _brace(self) -> None:
        number, line = self.reader.next("an opening brace")
        if line != "{":
            _refuse(f"'{_short(line)}' stands where an opening brace should", number)

    def _offset(self) -> str:
        number, line = self.reader.next("OFFSET")
        words = line.split()
        if words[0].upper() != "OFFSET":
            _refuse(f"'{_short(line)}' stands where OFFSET should", number)
        return " ".join(["OFFSET", *_numbers(words[1:], 3, number)])

    def _channels(self) -> str:
        number, line = self.reader.next("CHANNELS")
        words = line.split()
        if words[0].upper() != "CHANNELS":
            _refuse(f"'{_short(line)}' stands where CHANNELS should", number)
        names = words[2:]
        if len(words) < 2 or not words[1].isdigit() or int(words[1]) != len(names):
            _refuse(f"CHANNELS does not say how many of them there are: {len(names)}", number)
        for name in names:
            if name.lower() not in _CHANNELS:
                _refuse(f"'{_short(name)}' is no channel", number)
        if len({name.lower() for name in names}) != len(names):
            _refuse("a channel is there twice", number)
        self.channels += len(names)
        return " ".join(
            ["CHANNELS", str(len(names)), *(f"{n[0].upper()}{n[1:].lower()}" for n in names)]
        )


def _with_motion(reader: _Reader, hierarchy: _Hierarchy) -> CheckedBvh:
    if reader.at_end:
        _refuse("the file ends after its hierarchy: there is no MOTION", reader.number)
    reader.next("MOTION")
    number, line = reader.next("the number of frames")
    found = re.fullmatch(r"frames\s*:?\s*(-?\d+)", line, re.IGNORECASE)
    if not found:
        _refuse(f"'{_short(line)}' stands where 'Frames:' and a number should", number)
    declared = int(found[1])
    number, line = reader.next("'Frame Time:'")
    found = re.fullmatch(r"frame\s*time\s*:?\s*(\S+)", line, re.IGNORECASE)
    if not found:
        _refuse(f"'{_short(line)}' stands where 'Frame Time:' and seconds should", number)
    time = _frame_time(found[1], number)
    rows = _rows(reader, hierarchy.channels, declared)
    if not rows:
        _refuse("there are no frames", reader.number)
    if declared != len(rows):
        reader.notes.append(f"It says that it has {declared} frames, but has {len(rows)}.")
    text = [*hierarchy.out, "MOTION", f"Frames: {len(rows)}", f"Frame Time: {time!r}", *rows, ""]
    return CheckedBvh(
        text="\n".join(text),
        frames=len(rows),
        rate=1.0 / time,
        joints=hierarchy.joints,
        notes=tuple(reader.notes),
    )


def _frame_time(word: str, number: int) -> float:
    (text,) = _numbers([word], 1, number)
    time = float(text)
    if time <= 0.0:
        _refuse(f"the frame time is {word} seconds", number)
    if time * FASTEST < 1.0:
        _refuse(f"the frame time of {word} seconds means {1.0 / time:.0f} frames a second", number)
    return time


def _rows(reader: _Reader, channels: int, declared: int) -> list[str]:
    """The frames, one text of numbers each."""
    rows: list[str] = []
    commas = False
    while not reader.at_end:
        number, line = reader.next("a frame")
        words = line.split()
        if len(words) == channels and _are_finite(words):
            rows.append(line)
            continue
        if "," in line:
            # A decimal comma, or commas between values.
            plain = line.replace(",", " ") if "." in line else _DECIMAL_COMMA.sub(".", line)
            words = plain.split()
            commas = True
        if len(rows) >= declared > 0 and not any(_NUMBER.match(word) for word in words):
            left = len(reader.lines) - reader.place + 1
            reader.notes.append(f"Line {number} and what follows is no motion: {left} left out.")
            break
        rows.append(" ".join(_numbers(words, channels, number)))
    if commas:
        reader.notes.append("Its numbers were written with commas.")
    return rows


def _are_finite(words: list[str]) -> bool:
    """Whether all are plain finite numbers, quickly."""
    try:
        return math.isfinite(sum(map(float, words)))
    except ValueError:
        return False


def _numbers(words: list[str], count: int, number: int) -> list[str]:
    """So many finite numbers, each as it is written."""
    plain = [_DECIMAL_COMMA.sub(".", word) for word in words]
    for word in plain:
        if word.lower().lstrip("+-") in {"nan", "inf", "infinity"} or "#" in word:
            _refuse(f"'{_short(word)}' is not a finite number", number)
        if not _NUMBER.match(word):
            _refuse(f"'{_short(word)}' is no number", number)
        if not math.isfinite(float(word)):
            _refuse(f"'{_short(word)}' is not a finite number", number)
    if len(plain) != count:
        _refuse(f"there are {len(plain)} numbers instead of {count}", number)
    return plain


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:39]}…"
