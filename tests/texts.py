# SPDX-License-Identifier: GPL-3.0-or-later
"""All texts of Octo Motion that people read in Blender, found in what it registers and in its
sources, and what the catalogues of languages lack of them:

    python -m tests.texts ja_JP

prints the lacking texts as a catalogue to fill in, and those that nothing says any more.
"""

from __future__ import annotations

import ast
import json
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from string import Formatter
from typing import Any

PACKAGE = Path(__file__).resolve().parent.parent / "octo_motion"
PLACES = ("core", "device", "blender", "ui")
"""Layers whose texts come to people in Blender. What the command line says stays English: scripts
and the logs of render farms read it."""
OTHERS = ("command_line/operators.py",)
WITHOUT = ("device/__main__.py",)
SENTENCE = re.compile(r"""['"{(●A-Z0-9][^\n]*\s[^\n]*[.…]$""")
WORD = re.compile(r"[^\W\d_]{2,}")
IDENTIFIER = re.compile(r"[A-Z][A-Z0-9_]*$")
CODE = re.compile(r"[A-Z]+(_[A-Z]+)+|[a-z_]+\.[LR]")
"""Identifiers, and landmarks as files name them."""
LOOKED_UP = {"phrase", "as_phrase", "translated", "reported", "hinted"}
"""Functions whose first argument is a text."""
NAMED = {
    "text",
    "title",
    "heading",
    "bl_label",
    "bl_description",
    "bl_category",
    "remedy",
    "problem",
}
"""Arguments and class attributes that are texts."""
SAID = {"message", "instead", "one", "_stopped"}
"""Attributes and fields that hold a text."""


def placeholders(text: str) -> list[str]:
    """What is filled into a text, each as it is written there, in order of its name."""
    try:
        parts = list(Formatter().parse(text))
    except ValueError:  # a brace that is none
        return []
    return sorted(
        f"{name}!{conversion}:{spec}" for _, name, spec, conversion in parts if name is not None
    )


def is_text(text: str) -> bool:
    """Whether there is anything to translate."""
    if CODE.fullmatch(text):
        return False
    bare = "".join(each for each, *_ in Formatter().parse(text)) if "{" in text else text
    return WORD.search(bare) is not None


# --- In the sources -------------------------------------------------------------------------------


@cache
def sources() -> dict[Path, ast.Module]:
    """The modules that say something to people."""
    paths = [path for place in PLACES for path in sorted((PACKAGE / place).rglob("*.py"))]
    paths += [PACKAGE / each for each in OTHERS]
    left = {PACKAGE / each for each in WITHOUT}
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in paths if path not in left}


@cache
def errors() -> frozenset[str]:
    """Names of all errors that an artist can put right."""
    bases = {
        node.name: {name_of(base) for base in node.bases}
        for tree in sources().values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
    }
    found = {"OctoMotionError"}
    while more := {name for name, own in bases.items() if own & found} - found:
        found |= more
    return frozenset(found)


def name_of(node: ast.expr) -> str:
    """What is called or assigned to, without its owner."""
    return node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")


def constants(node: ast.AST | None) -> Iterator[str]:
    """The texts that an expression may be: itself, or either side of a choice."""
    match node:
        case ast.Constant(value=str(text)):
            yield text
        case ast.IfExp(body=body, orelse=other):
            yield from constants(body)
            yield from constants(other)
        case ast.BoolOp(values=values) | ast.Tuple(elts=values) | ast.List(elts=values):
            for each in values:
                yield from constants(each)
        case _:
            pass


def _in_call(node: ast.Call) -> Iterator[str]:
    name = name_of(node.func)
    if name in LOOKED_UP:
        yield from constants(node.args[0] if node.args else None)
    elif name in errors() | {"Notice"}:
        for each in node.args:
            yield from constants(each)
    elif (name == "report" and len(node.args) == 2) or name == "joined_phrases":
        yield from constants(node.args[1])
    elif name == "append" and node.args:
        yield from (each for each in constants(node.args[0]) if SENTENCE.match(each))
    for each in node.keywords:
        if each.arg in NAMED | SAID:
            yield from constants(each.value)


def _in_tuple(node: ast.Tuple) -> Iterator[str]:
    """Label and description of a choice: identifier, label, description, and more."""
    match node.elts:
        case [ast.Constant(value=str(key)), ast.Constant(value=str(label)), *more] if (
            more and IDENTIFIER.match(key) and not IDENTIFIER.match(label)
        ):
            yield label
            yield from constants(more[0])
        case _:
            pass


def _of_node(node: ast.AST) -> Iterator[str]:
    match node:
        case ast.Call():
            yield from _in_call(node)
        case ast.Tuple():
            yield from _in_tuple(node)
        case ast.Assign(targets=[target], value=value) if name_of(target) in NAMED | SAID:
            yield from constants(value)
        case ast.FunctionDef(name="obstacle" | "status"):
            for each in ast.walk(node):
                if isinstance(each, ast.Return):
                    yield from constants(each.value)
        case ast.Constant(value=str(text)) if SENTENCE.match(text):
            yield text
        case _:
            pass


def _no_texts(tree: ast.Module) -> set[ast.AST]:
    """What is written for programmers: docstrings, logs, and errors that are faults."""
    found: set[ast.AST] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            found.add(node.value)
        elif isinstance(node, ast.JoinedStr):
            found.update(node.values)
        elif isinstance(node, ast.Call):
            name = name_of(node.func)
            owner = name_of(node.func.value) if isinstance(node.func, ast.Attribute) else ""
            fault = name.endswith("Error") and name not in errors()
            if fault or owner in {"log", "_log", "_logger", "re"}:
                found.update(ast.walk(node))
    return found


def said() -> set[str]:
    """Texts in the sources: what is drawn, told and reported."""
    found: set[str] = set()
    for tree in sources().values():
        without = _no_texts(tree)
        for node in ast.walk(tree):
            if node not in without:
                found.update(_of_node(node))
    return {each for each in found if is_text(each)}


# --- Registered -----------------------------------------------------------------------------------


def _properties(kind: Any) -> Iterator[str]:
    """Names, descriptions and choices of a class's own properties."""
    import bpy

    operator = issubclass(kind, bpy.types.Operator)
    rna = _operator(kind).get_rna_type() if operator else kind.bl_rna
    ours = [each for each in kind.__mro__ if each.__module__.startswith("octo_motion")]
    own = {name for each in ours for name in vars(each).get("__annotations__", ())}
    inherited = list(rna.base.properties) if rna.base is not None else []
    for each in rna.properties:
        if each.identifier not in own or each in inherited:
            continue
        if each.name != each.identifier:  # which it has where nobody is to see it
            yield each.name
        yield each.description
        if each.type == "ENUM":
            for item in each.enum_items_static:
                yield from (item.name, item.description)


def _operator(kind: Any) -> Any:
    import bpy

    module, name = kind.bl_idname.split(".") if "." in kind.bl_idname else ("", "")
    if not name:  # as Blender writes it once it is registered
        module, _, name = kind.bl_idname.lower().partition("_ot_")
    return getattr(getattr(bpy.ops, module), name)


def _classes(kind: type) -> Iterator[Any]:
    for each in kind.__subclasses__():
        if each.__module__.startswith("octo_motion"):
            yield each
        yield from _classes(each)


def registered() -> dict[str, set[str]]:
    """Texts of what is registered: by context, as Blender looks them up."""
    import bpy

    labels: set[str] = set()
    others: set[str] = set()
    for kind in _classes(bpy.types.bpy_struct):
        if "bl_rna" not in kind.__dict__:
            continue
        others.update(_properties(kind))
        operator = issubclass(kind, bpy.types.Operator)
        if not issubclass(kind, bpy.types.Menu):  # whose label is the preset that was chosen last
            (labels if operator else others).add(getattr(kind, "bl_label", ""))
        others.add(getattr(kind, "bl_description", None) or "")
        others.add(getattr(kind, "bl_category", ""))
    for owner in (bpy.types.Object, bpy.types.WindowManager):
        for each in owner.bl_rna.properties:
            if each.identifier.startswith("octo_motion"):
                others |= {each.name, each.description}
    return {
        "*": {each for each in others if is_text(each)},
        "Operator": {each for each in labels if is_text(each)},
    }


def made() -> set[str]:
    """Texts that are made of names: of gaits and set-ups, parts of the body, kinds of figures."""
    import bpy

    from octo_motion.core.phrases import joined_phrases
    from octo_motion.core.splicing.humanoid import LANDMARKS
    from octo_motion.core.splicing.transfer.parts import PART_TABLE, spoken
    from octo_motion.ui.locomotion.settings import KIND_NAMES
    from octo_motion.ui.splicing.properties import title

    files = [
        *(PACKAGE / "presets/octo_motion").rglob("*.py"),
        *(PACKAGE / "core/locomotion/gait/presets").glob("*.json"),
    ]
    found = {bpy.path.display_name(path.stem) for path in files}
    found |= {spoken(each) for each in LANDMARKS} | {title(each) for each in LANDMARKS}
    found |= {part.kind.name for part in PART_TABLE if part.kind is not None}
    found |= {name.lower() for name in KIND_NAMES.values()}
    # How sentences follow one another.
    return found | {joined_phrases(" ", "x" * count).template for count in (2, 3)}


def without_words() -> set[str]:
    """Phrases of nothing but what is filled in: a language may say them with other signs."""
    from octo_motion.core.phrases import joined_phrases

    found = {
        text
        for tree in sources().values()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and name_of(node.func) == "phrase"
        for text in constants(node.args[0])
        if not is_text(text)
    }
    rows = [", ", "; "]
    return found | {joined_phrases(sign, "x" * n).template for sign in rows for n in range(2, 9)}


def all_texts() -> set[str]:
    """Every text that a catalogue has to have."""
    return said() | set().union(*registered().values()) | made()


# --- Catalogues -----------------------------------------------------------------------------------


def catalogue(language: str) -> dict[str, dict[str, str]]:
    """A language's texts by context."""
    path = PACKAGE / "languages" / f"{language}.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def main(language: str) -> None:
    """Print what a language lacks, and what of it is stale."""
    import octo_motion

    octo_motion.register()
    texts, known = all_texts(), catalogue(language)
    octo_motion.unregister()
    there = set().union(*known.values()) if known else set()
    lacking = dict.fromkeys(sorted(texts - there), "")
    print(json.dumps({"*": lacking}, ensure_ascii=False, indent=2))
    for each in sorted(there - texts - without_words()):
        print("stale:", json.dumps(each, ensure_ascii=False), file=sys.stderr)


if __name__ == "__main__":
    main(sys.argv[1])
