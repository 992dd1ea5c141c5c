# SPDX-License-Identifier: GPL-3.0-or-later
"""The layers that an import contract alone does not keep. `make lint` checks their order."""

import ast
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

pytestmark = pytest.mark.one_blender

REPOSITORY = Path(__file__).resolve().parent.parent
PACKAGE = REPOSITORY / "octo_motion"
WITHOUT_BLENDER = [
    layer for layer in ("core", "device") if (PACKAGE / layer / "__init__.py").exists()
]
BLENDER_MODULES = {"aud", "blf", "bl_math", "bmesh", "bpy", "bpy_extras", "gpu", "idprop"} | {
    "imbuf",
    "mathutils",
    "nodeitems_utils",
    "rna_prop_ui",
}

IMPORT_EVERYTHING_WITHOUT_BLENDER = """
import importlib, pkgutil, sys

class NoBlender:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {blender_modules}:
            raise ImportError(name + " is blocked")

sys.meta_path.insert(0, NoBlender())
layer = importlib.import_module("octo_motion.{layer}")
for module in pkgutil.walk_packages(layer.__path__, layer.__name__ + "."):
    importlib.import_module(module.name)
    print(module.name)
"""


def sources(*folders: Path) -> Iterator[Path]:
    for folder in folders:
        yield from sorted(folder.rglob("*.py"))


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """Line and dotted name of each import of a file, also of those inside functions.

    A relative import keeps its dots: `from ..core import arm` is `..core.arm`.
    """
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            origin = "." * node.level + (node.module or "")
            joint = "" if origin.endswith(".") else "."
            yield from ((node.lineno, origin + joint + alias.name) for alias in node.names)


def offences(paths: Iterator[Path], allowed: set[str]) -> list[str]:
    """Absolute imports whose top-level name is not an allowed one."""
    return [
        f"{path.relative_to(REPOSITORY)}:{line} imports {name}"
        for path in paths
        for line, name in imports(path)
        if not name.startswith(".") and name.partition(".")[0] not in allowed
    ]


@pytest.mark.parametrize("layer", WITHOUT_BLENDER)
def test_layer_without_blender_can_be_imported_whole_where_bpy_is_absent(layer: str) -> None:
    script = IMPORT_EVERYTHING_WITHOUT_BLENDER.format(blender_modules=BLENDER_MODULES, layer=layer)

    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", script],
        cwd=REPOSITORY,
        capture_output=True,
        encoding="utf-8",
        check=False,
    )

    assert run.returncode == 0, run.stderr
    files = [path for path in sources(PACKAGE / layer) if path.name != "__init__.py"]
    packages = [path for path in sources(PACKAGE / layer) if path.name == "__init__.py"][1:]
    assert len(run.stdout.split()) == len(files) + len(packages)


def test_core_imports_numpy_and_the_standard_library_alone() -> None:
    assert offences(sources(PACKAGE / "core"), {"numpy", *sys.stdlib_module_names}) == []


def test_device_imports_hidapi_numpy_and_the_standard_library_alone() -> None:
    allowed = {"hid", "hidraw", "numpy", *sys.stdlib_module_names}
    assert offences(sources(PACKAGE / "device"), allowed) == []


def doors() -> list[Path]:
    """The packages that say what they hand out."""
    return [
        path
        for path in sources(PACKAGE)
        if path.name == "__init__.py" and "__all__" in path.read_text(encoding="utf-8")
    ]


def protected() -> list[str]:
    """The packages that the contracts let others enter by their door alone."""
    settings = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
    return [
        modules.removesuffix(".*")
        for contract in settings["tool"]["importlinter"]["contracts"]
        if contract["type"] == "protected"
        for modules in contract["protected_modules"]
    ]


def test_every_package_that_is_entered_by_its_door_says_what_it_hands_out() -> None:
    with_door = {".".join(path.parent.relative_to(REPOSITORY).parts) for path in doors()}
    packages = {each for each in protected() if Path(REPOSITORY, *each.split(".")).is_dir()}
    assert len(packages) > 20
    assert packages - with_door == set()


@pytest.mark.parametrize("door", doors(), ids=lambda path: path.parent.name)
def test_everything_that_a_door_hands_out_is_there_and_named_once(door: Path) -> None:
    tree = ast.parse(door.read_text(encoding="utf-8"))
    (named,) = (
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign | ast.AnnAssign)
        if node.value is not None and "__all__" in ast.unparse(node).partition("=")[0]
    )
    there = {name.rpartition(".")[2] for _, name in imports(door)}
    there |= {node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    there |= {
        each.id
        for node in tree.body
        for each in ast.walk(node)
        if isinstance(each, ast.Name)
        if isinstance(each.ctx, ast.Store)
    }
    assert len(set(named)) == len(named)
    assert set(named) <= there


def test_package_never_names_itself_because_blender_installs_it_under_another_name() -> None:
    assert [
        f"{path.relative_to(REPOSITORY)}:{line} imports {name}"
        for path in sources(PACKAGE)
        for line, name in imports(path)
        if name.partition(".")[0] == PACKAGE.name
    ] == []


def test_tests_of_core_and_device_need_no_blender() -> None:
    tests = REPOSITORY / "tests"
    assert [
        f"{path.relative_to(REPOSITORY)}:{line} imports {name}"
        for path in sources(tests / "core", tests / "device")
        for line, name in imports(path)
        if name.partition(".")[0] in BLENDER_MODULES
        or name.startswith(("octo_motion.blender", "octo_motion.ui", "octo_motion.command_line"))
    ] == []


def test_blenders_version_is_asked_for_in_one_module_alone() -> None:
    askers = {
        path.relative_to(PACKAGE).as_posix()
        for path in sources(PACKAGE)
        if any(asks_for_version(node) for node in ast.walk(ast.parse(path.read_text("utf-8"))))
    }
    assert askers <= {"blender/versions.py"}


def asks_for_version(node: ast.AST) -> bool:
    """Whether a node is `bpy.app.version…`, `app.version…` or an import of the like."""
    match node:
        case ast.Attribute(value=ast.Attribute(attr="app") | ast.Name(id="app"), attr=name):
            return name.startswith("version")
        case ast.ImportFrom(module="bpy.app", names=names):
            return any(alias.name.startswith("version") for alias in names)
    return False


@pytest.mark.parametrize(
    "line",
    [
        "bpy.app.version >= (5, 0, 0)",
        "bpy.app.version_string",
        "from bpy.app import version_file",
        "from bpy import app\napp.version",
    ],
)
def test_version_question_is_recognized_in_each_spelling(line: str) -> None:
    assert any(asks_for_version(node) for node in ast.walk(ast.parse(line)))
