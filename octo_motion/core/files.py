# SPDX-License-Identifier: GPL-3.0-or-later
"""Files as every system takes them: names, texts that people write, and taking a file's place."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Final

from .phrases import phrase

BUSY: Final = {5, 32, 33}
"""Windows' numbers for a file that another program has open: access denied, sharing, lock."""
_PAUSES: Final = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.6)
"""Seconds; about two in all."""


def replace(source: Path, target: Path) -> None:
    """Let a file take the place of another.

    On Windows, scanners and programs that synchronize folders hold new files for a moment: that is
    waited for, about two seconds.

    Raises:
        OSError: it cannot.
    """
    for pause in _PAUSES:
        try:
            source.replace(target)
        except PermissionError as error:
            if getattr(error, "winerror", None) not in BUSY:
                raise
            time.sleep(pause)
        else:
            return
    source.replace(target)


def read_text(path: Path) -> str:
    """The text of a file that people write; the mark that some editors put before it is no part.

    Raises:
        OSError: it cannot be read.
        UnicodeDecodeError: it is not in UTF-8.
    """
    return path.read_text(encoding="utf-8-sig")


LONGEST_PART: Final = 200
"""Bytes of a part of a path, to which what is unfinished adds some."""
DEVICES: Final = re.compile(
    r"(?i)^(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[0-9\u00b9\u00b2\u00b3])(?=$| *\.)"
)
"""How names begin that mean a device on Windows, whatever ending follows."""


_ODD: Final = re.compile(r'[\x00-\x1f<>:"/\\|?*\x7f]|[. ]$')


def name_fault(name: str) -> str:
    """What is wrong with a name that is to be part of a path as it is; "" if every system takes it.

    Where a name need not stand in a path as it is, :func:`blender.files.file_named` takes any.
    """
    if odd := _ODD.search(name):
        return phrase(
            "{name!r} has {letters!r}, which not every system takes in the name of a file.",
            name=name,
            letters=odd.group(),
        )
    if DEVICES.match(name):
        return phrase("'{name}' is the name of a device on Windows.", name=name)
    if len(name.encode()) > LONGEST_PART:
        return phrase(
            "'{name}' is longer than the {longest_part} letters that every system takes.",
            name=name,
            longest_part=LONGEST_PART,
        )
    return ""


def plain_name(name: str) -> str:
    """A name in which what :func:`name_fault` finds is replaced."""
    plain = _ODD.sub("_", name)
    if DEVICES.match(plain):
        plain = f"{plain[:3]}_{plain[3:]}"
    if len(plain.encode()) <= LONGEST_PART:
        return plain
    return _ODD.sub("_", plain[: LONGEST_PART // 4])
