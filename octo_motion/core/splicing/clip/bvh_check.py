# SPDX-License-Identifier: GPL-3.0-or-later
"""BVH files looked at before anything imports them: what is wrong, and in which line.

Sound files are told from damaged ones, and written anew in the plainest form: UTF-8, one keyword a
line, decimal points, one line a frame, all three axes of what a joint does. The numbers keep their
digits. What can be read in one way only is repaired and noted (byte order marks, UTF-16, names in
Shift-JIS, line ends of any kind, decimal commas, braces anywhere, remarks behind the last frame);
everything else is refused.
"""

from __future__ import annotations

import codecs
import math
import re
from dataclasses import dataclass
from operator import itemgetter
from typing import Final, NoReturn

from ...errors import ClipError
from ...phrases import as_phrase, phrase

FASTEST: Final = 2000.0
"""Frames per second that no motion capture exceeds."""

_MARKS: Final = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_SHIFT_JIS: Final = re.compile(rb"[\x81-\x9f]")
"""Its kana and usual kanji begin with one of these, which are no letters in Latin-1."""
_KINDS: Final = ("position", "rotation")
_CHANNELS: Final = frozenset(f"{axis}{kind}" for axis in "xyz" for kind in _KINDS)
_NUMBER: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?$")
_DECIMAL_COMMA: Final = re.compile(r"(?<=\d),(?=\d)")
_REMEDY: Final = "Export it again, or repair that line in a text editor."


@dataclass(frozen=True)
class CheckedBvh:
    """A sound file."""

    text: str
    """The file in its plainest form."""
    rate: float
    """Frames per second."""
    notes: tuple[str, ...]
    """What was repaired or left out: sentences."""


def check_bvh(content: bytes) -> CheckedBvh:
    """Look at a whole file.

    Raises:
        ClipError: it is damaged; the message names the line.
    """
    file = _File(*_decoded(content))
    file.read_hierarchy()
    time = file.read_motion()
    return CheckedBvh("\n".join([*file.plain, ""]), 1.0 / time, tuple(file.notes))


def _refuse(problem: str, line: int | None = None) -> NoReturn:
    told = as_phrase(problem)
    if line is None:
        raise ClipError(phrase("{problem}.", problem=told.capitalised()), _REMEDY)
    raise ClipError(phrase("Line {line}: {problem}.", line=line, problem=told), _REMEDY)


def _decoded(content: bytes) -> tuple[str, list[str]]:
    """The text, and what had to be done to read it."""
    notes = []
    for mark, encoding in _MARKS:
        if content.startswith(mark):
            try:
                text = content[len(mark) :].decode(encoding)
            except UnicodeDecodeError:
                _refuse(
                    phrase("it begins like {encoding} text, but is none", encoding=encoding.upper())
                )
            if encoding != "utf-8":
                notes.append(phrase("Its text was {encoding}.", encoding=encoding.upper()))
            break
    else:
        text, note = _unmarked(content)
        notes += [note] if note else []
    text = text.replace("\r\n", "\n").replace("\r", "\n").rstrip("\0 \t\n")
    if not text:
        _refuse(phrase("the file is empty"))
    if "\0" in text:
        _refuse(
            phrase("there are zero bytes in the text"), text[: text.index("\0")].count("\n") + 1
        )
    return text, notes


def _unmarked(content: bytes) -> tuple[str, str]:
    """Text without a mark that says how it is encoded, and a sentence if that had to be guessed."""
    if b"\0" in content[:2]:
        # It begins with a letter, of which UTF-16 makes two bytes.
        wide = "utf-16-le" if content[1:2] == b"\0" else "utf-16-be"
        text = _strictly(content, wide)
        if text is not None:
            return text, phrase("Its text was {wide}.", wide=wide.upper())
    text = _strictly(content, "utf-8")
    if text is not None:
        return text, ""
    # Names in Shift-JIS break the rules of EUC-JP, not so the other way round.
    for encoding, title in (("euc_jp", "EUC-JP"), ("cp932", "Shift-JIS")):
        text = _strictly(content, encoding)
        if text is not None and (encoding == "euc_jp" or _SHIFT_JIS.search(content)):
            return text, phrase(
                "Its names are not in UTF-8: they were read as {title}.", title=title
            )
    return content.decode("latin-1"), "Its names are not in UTF-8: some letters may look wrong."


def _strictly(content: bytes, encoding: str) -> str | None:
    """The text, or none if it breaks the rules of the encoding."""
    try:
        return content.decode(encoding)
    except UnicodeDecodeError:
        return None


class _File:
    """The lines of a file that are not blank, read one after the other and written plainly."""

    def __init__(self, text: str, notes: list[str]) -> None:
        self.notes = notes
        self.plain = ["HIERARCHY"]
        self.channels = 0
        self.added: list[tuple[int, str]] = []
        """Values that stay the same, each behind so many of the channels of the file."""
        lines = [(number, line.strip()) for number, line in enumerate(text.split("\n"), 1)]
        self.lines = [(number, line) for number, line in lines if line]
        number, first = self.lines[0]
        if first.split()[0].upper() != "HIERARCHY":
            _refuse(phrase("this is not a BVH file: it does not begin with HIERARCHY"), number)
        self.lines[:1] = [(number, part) for part in first.split(None, 1)]
        self.place = 1
        begun = (place for place, (_, line) in enumerate(self.lines) if _keyword(line) == "MOTION")
        motion = next(begun, len(self.lines))
        self.lines[:motion] = [
            (number, part) for number, line in self.lines[:motion] for part in _braces_apart(line)
        ]

    @property
    def at_end(self) -> bool:
        return self.place >= len(self.lines)

    def refuse(self, problem: str) -> NoReturn:
        """Refuse the file because of the line that was read last."""
        _refuse(problem, self.lines[self.place - 1][0])

    def refuse_instead_of(self, expected: str) -> NoReturn:
        self.refuse(
            phrase(
                "'{text}' stands where {expected} should",
                text=_short(self.lines[self.place - 1][1]),
                expected=expected,
            )
        )

    def next(self, expected: str) -> str:
        """The next line, or a refusal because the file ends here."""
        if self.at_end:
            self.refuse(phrase("the file ends where {expected} should follow", expected=expected))
        self.place += 1
        return self.lines[self.place - 1][1]

    def after(self, keyword: str, expected: str = "") -> list[str]:
        """The words that follow a keyword, in its line."""
        first, *words = self.next(expected or keyword).split()
        if first.upper() != keyword:
            self.refuse_instead_of(expected or keyword)
        return words

    def value(self, pattern: str, expected: str) -> str:
        """What a line says that is written like this."""
        found = re.fullmatch(pattern, self.next(expected), re.IGNORECASE)
        if not found:
            self.refuse_instead_of(expected)
        return found[1]

    def read_hierarchy(self) -> None:
        """All roots, up to MOTION."""
        while not self.at_end and self.lines[self.place][1].upper() != "MOTION":
            line = self.next("ROOT")
            if _keyword(line) != "ROOT":
                self.refuse_instead_of(phrase("ROOT or MOTION"))
            self._read_root(line)
        if len(self.plain) == 1:
            self.refuse(phrase("there is no ROOT"))

    def _read_root(self, line: str) -> None:
        """A root and all below it. Not by recursion: chains may be long."""
        self._open("ROOT", line)
        depth = 1
        while depth:
            line = self.next(phrase("the rest of the hierarchy"))
            word = _keyword(line)
            if word == "}":
                depth -= 1
                self.plain.append("}")
            elif word == "JOINT":
                self._open("JOINT", line)
                depth += 1
            elif word == "END":
                self.after("{", phrase("an opening brace"))
                self.plain += ["End Site", "{", self._offset(), "}"]
                self.after("}", phrase("a closing brace"))
            elif word == "MOTION":
                self.refuse(phrase("MOTION comes before all braces are closed"))
            else:
                self.refuse(phrase("'{text}' is no part of a hierarchy", text=_short(line)))

    def _open(self, keyword: str, line: str) -> None:
        name = "_".join(line.split()[1:])
        if not name:
            self.refuse(phrase("a joint has no name"))
        self.after("{", phrase("an opening brace"))
        offset = self._offset()
        channels = self._channels(offset.split()[1:])
        self.plain += [f"{keyword} {name}", "{", offset, channels]

    def _offset(self) -> str:
        return " ".join(["OFFSET", *self._numbers(self.after("OFFSET"), 3)])

    def _channels(self, offset: list[str]) -> str:
        """Channels of a joint, which is so far from its parent. Joints that turn about one axis or
        two, or move along them, get the others as well, for Blender's importer has no other joints.
        """
        count, *names = self.after("CHANNELS") or [""]
        if not count.isdigit() or int(count) != len(names):
            self.refuse(
                phrase(
                    "CHANNELS does not say how many of them there are: {count}", count=len(names)
                )
            )
        for name in names:
            if name.lower() not in _CHANNELS:
                self.refuse(phrase("'{text}' is no channel", text=_short(name)))
        if len({name.lower() for name in names}) != len(names):
            self.refuse(phrase("a channel is there twice"))
        self.channels += len(names)
        plain = [f"{name[0].upper()}{name[1:].lower()}" for name in names]
        for kind, still in zip(_KINDS, (offset, ["0"] * 3), strict=True):
            if any(name.endswith(kind) for name in plain):
                lacking = [axis for axis in range(3) if f"{'XYZ'[axis]}{kind}" not in plain]
                plain += [f"{'XYZ'[axis]}{kind}" for axis in lacking]
                self.added += [(self.channels, still[axis]) for axis in lacking]
        return " ".join(["CHANNELS", str(len(plain)), *plain])

    def read_motion(self) -> float:
        """All frames; the time of one, seconds."""
        if self.at_end:
            self.refuse(phrase("the file ends after its hierarchy: there is no MOTION"))
        self.next("MOTION")
        declared = int(self.value(r"frames\s*:?\s*(-?\d+)", phrase("'Frames:' and a number")))
        word = self.value(r"frame\s*time\s*:?\s*(\S+)", phrase("'Frame Time:' and seconds"))
        time = float(self._numbers([word], 1)[0])
        if time <= 0.0:
            self.refuse(phrase("the frame time is {word} seconds", word=word))
        if time * FASTEST < 1.0:
            self.refuse(
                phrase(
                    "the frame time of {word} seconds means {rate:.0f} frames a second",
                    word=word,
                    rate=1.0 / time,
                )
            )
        rows = self._rows(declared)
        if not rows:
            self.refuse(phrase("there are no frames"))
        if declared != len(rows):
            self.notes.append(
                phrase(
                    "It says that it has {declared} frames, but has {count}.",
                    declared=declared,
                    count=len(rows),
                )
            )
        self.plain += ["MOTION", f"Frames: {len(rows)}", f"Frame Time: {time!r}", *rows]
        return time

    def _rows(self, declared: int) -> list[str]:
        """The frames, one text of numbers each."""
        rows: list[str] = []
        commas = False
        while not self.at_end:
            line = self.next(phrase("a frame"))
            words = line.split()
            if len(words) == self.channels and _are_finite(words):
                rows.append(line)
                continue
            if "," in line:
                # A decimal comma, or commas between values.
                plain = line.replace(",", " ") if "." in line else _DECIMAL_COMMA.sub(".", line)
                words = plain.split()
                commas = True
            if len(rows) >= declared > 0 and not any(_NUMBER.match(word) for word in words):
                number, left = self.lines[self.place - 1][0], len(self.lines) - self.place + 1
                self.notes.append(
                    phrase(
                        "Line {number} and what follows is no motion: {left} left out.",
                        number=number,
                        left=left,
                    )
                )
                break
            rows.append(" ".join(self._numbers(words, self.channels)))
        if commas:
            self.notes.append("Its numbers were written with commas.")
        return self._completed(rows)

    def _completed(self, rows: list[str]) -> list[str]:
        """The frames with what was added to the channels of the file."""
        if not self.added:
            return rows
        order = list(range(self.channels))
        for number, (place, _) in reversed(list(enumerate(self.added))):
            order.insert(place, self.channels + number)
        arrange, values = itemgetter(*order), [value for _, value in self.added]
        return [" ".join(arrange(row.split() + values)) for row in rows]

    def _numbers(self, words: list[str], count: int) -> list[str]:
        """So many finite numbers, each as it is written."""
        plain = [_DECIMAL_COMMA.sub(".", word) for word in words]
        for word in plain:
            named = word.lower().lstrip("+-") in {"nan", "inf", "infinity"} or "#" in word
            if not named and not _NUMBER.match(word):
                self.refuse(phrase("'{text}' is no number", text=_short(word)))
            if named or not math.isfinite(float(word)):
                self.refuse(phrase("'{text}' is not a finite number", text=_short(word)))
        if len(plain) != count:
            self.refuse(
                phrase(
                    "there are {count} numbers instead of {expected}",
                    count=len(plain),
                    expected=count,
                )
            )
        return plain


def _keyword(line: str) -> str:
    return line.split(None, 1)[0].upper()


def _braces_apart(line: str) -> list[str]:
    """Keyword and braces that stand in one line, one by one."""
    # A brace within a name is the name's: only those at the ends of words count.
    parts = re.split(r"(?:(?<=\s)|^)([{}])(?=\s|$)", line)
    words = [part.strip() for part in parts if part.strip()]
    keywords = r"\s+(?=CHANNELS\s|OFFSET\s|JOINT\s|End\s+Site)"
    return [each for word in words for each in re.split(keywords, word, flags=re.IGNORECASE)]


def _are_finite(words: list[str]) -> bool:
    """Whether all are plain finite numbers, quickly."""
    try:
        return math.isfinite(sum(map(float, words)))
    except ValueError:
        return False


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:39]}…"
