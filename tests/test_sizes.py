# SPDX-License-Identifier: GPL-3.0-or-later
"""Nothing is so long that a newcomer loses the thread, unless a comment there says why."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

pytestmark = pytest.mark.one_blender

PACKAGE = Path(__file__).resolve().parent.parent / "octo_motion"
LINES_OF_A_FUNCTION = 60
LINES_OF_A_CLASS = 300
FIELDS = 20
REASON = "# In one piece"
"""How the comment begins, right above, that says why something longer is better so."""


def _definitions() -> Iterator[tuple[str, ast.FunctionDef | ast.ClassDef]]:
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        lines = text.splitlines()
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                first = min([node.lineno, *(each.lineno for each in node.decorator_list)])
                above = first - 2
                while lines[above].lstrip().startswith("#") and REASON not in lines[above]:
                    above -= 1
                if REASON not in lines[above]:
                    yield f"{path.relative_to(PACKAGE)}: {node.name}", node


def _length(node: ast.FunctionDef | ast.ClassDef) -> int:
    assert node.end_lineno is not None
    return node.end_lineno - node.lineno + 1


def test_no_function_is_longer_than_a_screen() -> None:
    long = {
        name: _length(node)
        for name, node in _definitions()
        if isinstance(node, ast.FunctionDef) and _length(node) > LINES_OF_A_FUNCTION
    }
    assert long == {}


def test_no_class_is_longer_than_one_can_keep_in_mind() -> None:
    long = {
        name: _length(node)
        for name, node in _definitions()
        if isinstance(node, ast.ClassDef) and _length(node) > LINES_OF_A_CLASS
    }
    assert long == {}


def test_no_dataclass_has_more_fields_than_one_can_tell_apart() -> None:
    many = {
        name: fields
        for name, node in _definitions()
        if isinstance(node, ast.ClassDef)
        and any("dataclass" in ast.unparse(each) for each in node.decorator_list)
        and (fields := sum(isinstance(each, ast.AnnAssign) for each in node.body)) > FIELDS
    }
    assert many == {}
