# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/device.md says what the code does: options, reports, packets, messages, errors."""

from __future__ import annotations

import argparse
import ast
import re
from pathlib import Path

import pytest

from octo_motion.device import messages as say
from octo_motion.device.__main__ import _parser
from octo_motion.device.codec import Codec, Many, Number, Table, Text
from octo_motion.device.driver import Dynamics
from octo_motion.device.haptics.force import DAMPER_SHARE, SHARE, gains_for
from octo_motion.device.haptics.passivity import STORED
from octo_motion.device.hid import force_profile as profile
from octo_motion.device.hid.system import UDEV_FILE
from octo_motion.device.sources import packets

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGE = REPOSITORY / "octo_motion" / "device"
PAGE = (REPOSITORY / "docs" / "device.md").read_text(encoding="utf-8")
SCALARS = {"B": "u8", "H": "u16", "I": "u32", "i": "i32", "d": "f64", "?": "bool", "h": "i16"}


def rows(text: str = PAGE) -> list[list[str]]:
    return [
        [cell.strip() for cell in line.strip().strip("|").split("|")]
        for line in text.splitlines()
        if line.startswith("|")
    ]


def test_every_option_of_the_command_line_is_described() -> None:
    told = {
        row[0].strip("`"): set(re.findall(r"`(\w+)`", row[1])) for row in rows() if len(row) > 2
    }
    real: dict[str, set[str]] = {}
    subcommands = next(
        each.choices for each in _parser()._actions if isinstance(each, argparse._SubParsersAction)
    )
    for name, parser in subcommands.items():
        assert f"`{name}`" in PAGE
        for action in parser._actions:
            for option in action.option_strings:
                if option not in {"-h", "--help"}:
                    real.setdefault(option, set()).add(name)
    assert {name: told.get(name) for name in real} == real
    assert {name for name in told if name.startswith("--") and name[2:3].isalpha()} == set(real)


def test_every_field_of_the_profile_is_described() -> None:
    told = [tuple(row) for row in rows() if len(row) == 3]
    for number, (way, items) in profile.REPORTS.items():
        size = profile.SIZES[number]
        assert f"Report {number}, {way}, {size} bytes with its number" in PAGE
        for each in items:
            row = (f"`{each.name}`", f"{SCALARS[each.code]} × {each.count}", each.unit)
            assert row in told


def test_every_packet_is_described_with_its_size() -> None:
    sizes = {
        int(row[0].split(",")[0]): int(row[2])
        for row in rows()
        if len(row) == 4 and re.match(r"\d, ", row[0])
    }
    assert sizes == packets.SIZES


def name_of(codec: Codec) -> str:
    match codec:
        case Number():
            return SCALARS[codec.code] + (f"[{codec.count}]" if codec.count > 1 else "")
        case Text():
            return "text"
        case Many():
            return f"list of {name_of(codec.of)}"
        case Table():
            return "table" + (f"[{', '.join(map(str, codec.row))}]" if codec.row else "")
        case _:
            raise AssertionError(codec)


@pytest.mark.parametrize("kind", say.KINDS.values(), ids=lambda each: each.__name__)
def test_every_message_is_described_as_it_is(kind: type[say.Message]) -> None:
    fields = say.RECORDS[kind].codecs.items()
    text = ", ".join(f"{name.replace('_', ' ')} {name_of(codec)}" for name, codec in fields)
    told = {row[1]: (row[0], row[3]) for row in rows() if len(row) == 4 and row[0].isdigit()}
    assert told[f"`{kind.__name__}`"] == (str(kind.KIND), text)


def test_every_error_of_devices_is_explained() -> None:
    said: set[str] = set()
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if (
                isinstance(node, ast.Call)
                and ast.unparse(node.func) in {"DeviceError", "Notice", "messages.Notice"}
                and node.args
                and isinstance(node.args[0], ast.Constant | ast.JoinedStr | ast.Call)
            ):
                said.add(pattern_of(node.args[0]))
    page = PAGE.split("## Messages", 1)[1].split("\n## ", 1)[0]
    explained = [row[0].strip("*") for row in rows(page) if row[0].startswith("*")]
    wanted = {text for text in said if not text.startswith("The bridge did not take a message")}
    wanted = {text for text in wanted if not text.startswith("The device's settings were not")}
    assert wanted <= set(explained), wanted - set(explained)
    assert set(explained) <= said


def pattern_of(node: ast.Constant | ast.JoinedStr | ast.Call) -> str:
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.Call):
        # A phrase: the text, and what is filled into it.
        (text, *_) = node.args
        assert isinstance(text, ast.Constant)
        return re.sub(r"\{[^}]*\}", "…", str(text.value)).replace("….", "…")
    parts = [str(part.value) if isinstance(part, ast.Constant) else "…" for part in node.values]
    # An ellipsis ends a sentence by itself.
    return "".join(parts).replace("….", "…")


def test_numbers_of_the_page_are_those_of_the_code() -> None:
    assert UDEV_FILE in PAGE
    assert "four fifths" in PAGE
    assert SHARE == 0.8
    assert round(SHARE * (1.0 - DAMPER_SHARE), 6) == 0.64
    assert round(gains_for(Dynamics(8.0, damping=0.5), 0.001).stiffness) == 640
    assert STORED == 0.02
