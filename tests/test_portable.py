# SPDX-License-Identifier: GPL-3.0-or-later
"""The project's Python runs wherever Blender does: nothing in it that one system alone has."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

pytestmark = pytest.mark.one_blender

REPOSITORY = Path(__file__).resolve().parent.parent
FILES = sorted(
    path
    for folder in ("octo_motion", "tests", "docs", ".ci")
    for path in (REPOSITORY / folder).rglob("*.py")
)
LINUX_ALONE = {"tests/farm/slurm.py"}
"""What is run there and nowhere else."""


def faults(tree: ast.AST) -> Iterator[str]:
    """What another system does otherwise, with its line."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            for decorator in node.decorator_list:
                if "SIGKILL" in {getattr(each, "attr", "") for each in ast.walk(decorator)}:
                    yield f"{decorator.lineno}: Windows has no SIGKILL, and imports the module"
        if isinstance(node, ast.Call):
            yield from (f"{node.lineno}: {fault}" for fault in call_faults(node))


def call_faults(call: ast.Call) -> Iterator[str]:
    """What is wrong with one call."""
    name = getattr(call.func, "attr", getattr(call.func, "id", ""))
    owner = getattr(getattr(call.func, "value", None), "id", "")
    given = {each.arg: each.value for each in call.keywords}
    values = [getattr(each, "value", None) for each in call.args]
    if getattr(given.get("text"), "value", None) is True and "encoding" not in given:
        yield "what the process says has no encoding"
    if name == "read_text" and not (call.args or "encoding" in given):
        yield "the text has no encoding"
    if name == "write_text" and len(call.args) == 1 and "encoding" not in given:
        yield "the text has no encoding"
    if name == "open" and owner != "os" and "encoding" not in given:
        place = int(isinstance(call.func, ast.Name))
        mode = getattr(given["mode"], "value", None) if "mode" in given else "r"
        mode = next(iter(values[place : place + 1]), mode)
        if isinstance(mode, str) and "b" not in mode:
            yield "the file has no encoding"
    if (owner, name) == ("os", "kill") and values[1:] == [0]:
        yield "on Windows this is Ctrl-C: tests.processes.alive"
    if name in {"symlink", "symlink_to"}:
        yield "Windows lets few people make links"


def test_nothing_is_of_one_system_alone() -> None:
    found = {
        path.relative_to(REPOSITORY).as_posix(): list(faults(ast.parse(path.read_bytes())))
        for path in FILES
    }
    assert {name: each for name, each in found.items() if each and name not in LINUX_ALONE} == {}


@pytest.mark.parametrize(
    ("line", "count"),
    [
        ("os.kill(process, 0)", 1),
        ("os.kill(process, signal.SIGTERM)", 0),
        ("path.read_text()", 1),
        ('path.read_text(encoding="utf-8")', 0),
        ('path.write_text("a")', 1),
        ("open(path)", 1),
        ('open(path, "w")', 1),
        ('open(path, "rb")', 0),
        ("path.open()", 1),
        ('path.open("a")', 1),
        ('path.open("ab")', 0),
        ("link.symlink_to(path)", 1),
        ("subprocess.run(command, text=True)", 1),
        ('subprocess.run(command, encoding="utf-8")', 0),
        ("@mark.parametrize('how', [signal.SIGKILL])\ndef test() -> None: ...", 1),
    ],
)
def test_what_is_of_one_system_is_found(line: str, count: int) -> None:
    assert len(list(faults(ast.parse(line)))) == count
