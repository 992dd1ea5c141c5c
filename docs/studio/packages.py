# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw the packages and who imports whom, read from the sources: docs/images/packages.svg.

A table with a row and a column for each package, layer below layer, and within a layer importers
above what they import. A mark in a row says that its package imports that of the column. Data flow
down: all marks stand to the right of the diagonal; one that imports upwards would stand to its
left, in red.
"""

from __future__ import annotations

import argparse
import ast
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final
from xml.sax.saxutils import escape

REPOSITORY: Final = Path(__file__).resolve().parents[2]
PACKAGE: Final = REPOSITORY / "octo_motion"
PICTURE: Final = REPOSITORY / "docs" / "images" / "packages.svg"

LAYERS: Final = {
    "octo_motion": "#6b7280",
    "command_line": "#7c3aed",
    "ui": "#2563eb",
    "blender": "#d97706",
    "device": "#059669",
    "core": "#475569",
}
"""From top to bottom, each with its colour."""
_CELL: Final = 17
_NAMES: Final = 190
"""Width of the rows' names, and height of the columns', in pixels."""
_UPWARDS: Final = "#dc2626"


def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(prog="make diagram", description=__doc__)
    parser.add_argument("--file", type=Path, default=PICTURE, help="where it goes")
    path = parser.parse_args().file
    path.write_text(drawn(), encoding="utf-8")
    print(path)


def drawn() -> str:
    """The picture of the sources as they are."""
    imports = imports_between(PACKAGE)
    return picture(ordered(imports), imports)


def imports_between(root: Path) -> dict[tuple[str, str], int]:
    """How many modules of one package import another one, by the names of the two.

    Each package is there as an importer of itself, with the number of its modules. Modules that
    stand beside packages and import one of them are above these: they have a row of their own,
    "device (top)", and what the packages share stays in "device". One that stands between, because
    others of these packages import it, is a row by itself.
    """
    modules = [path for path in sorted(root.rglob("*.py")) if is_package(path.parent)]
    imported = {path: set(imported_files(path)) - {path} for path in modules}
    names = {path: _row_of(path, imported, root) for path in modules}
    found: Counter[tuple[str, str]] = Counter()
    for path, own in names.items():
        found[own, own] += 1
        others = {names[each] for each in imported[path] if each in names} - {own}
        found.update((own, other) for other in others)
    # A package of packages that has a door and nothing else has nothing to show.
    empty = {name for name in names.values() if not _has_modules(name, names, found)}
    return {key: count for key, count in found.items() if not empty.intersection(key)}


def _row_of(path: Path, imported: Mapping[Path, set[Path]], root: Path) -> str:
    """The name of the row that a module belongs to."""

    def lies_below(other: Path) -> bool:
        return other.parent != path.parent and other.is_relative_to(path.parent)

    name = path.parent.relative_to(root).as_posix() if path.parent != root else root.name
    if not any(map(lies_below, imported[path])):
        return name
    if any(path in imports and lies_below(other) for other, imports in imported.items()):
        return f"{name}/{path.stem}"
    return f"{name} (top)"


def _has_modules(
    name: str, names: Mapping[Path, str], found: Mapping[tuple[str, str], int]
) -> bool:
    own = [path for path, row in names.items() if row == name]
    return any(path.name != "__init__.py" for path in own) or any(
        name == importer and name != other for importer, other in found
    )


def is_package(folder: Path) -> bool:
    """Whether Python can import it."""
    return (folder / "__init__.py").exists()


def imported_files(path: Path) -> Iterator[Path]:
    """The files that a module imports by relative imports; of a package, its door."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.ImportFrom) or node.level == 0:
            continue
        origin = path.parents[node.level - 1].joinpath(*(node.module or "").split("."))
        for alias in node.names:
            for target in (origin / alias.name, origin):
                files = (target.with_suffix(".py"), target / "__init__.py")
                if file := next((each for each in files if each.exists()), None):
                    yield file
                    break


def ordered(imports: Mapping[tuple[str, str], int]) -> list[str]:
    """Packages layer by layer, importers first; by their names where either order would do."""
    result: list[str] = []
    for layer in LAYERS:
        waiting = sorted({name for name, _ in imports if layer_of(name) == layer})
        while waiting:
            # In a circle nobody comes first: then the name decides, and the picture shows it.
            first = next((name for name in waiting if not _is_needed(name, waiting, imports)), "")
            result.append(first or waiting[0])
            waiting.remove(result[-1])
    return result


def _is_needed(name: str, waiting: list[str], imports: Mapping[tuple[str, str], int]) -> bool:
    """Whether a package that is not placed yet imports it."""
    return any(other != name and (other, name) in imports for other in waiting)


def layer_of(name: str) -> str:
    """The layer that a package belongs to."""
    return name.partition("/")[0].removesuffix(" (top)")


def picture(names: list[str], imports: Mapping[tuple[str, str], int]) -> str:
    """The table as SVG."""
    size = _NAMES + _CELL * len(names)
    lines = [
        '<svg xmlns="http://www.w3.org/2000/svg" font-family="sans-serif" font-size="11"',
        f'    width="{size + 12}" height="{size + 12}">',
        "<title>Which package of Octo Motion imports which</title>",
        '<rect width="100%" height="100%" fill="#ffffff"/>',
    ]
    for row, name in enumerate(names):
        lines.extend(_row(row, name, names, imports))
    for column, name in enumerate(names):
        x = _NAMES + _CELL * (column + 0.68)
        lines.append(
            f'<text transform="translate({x:.1f} {_NAMES - 6}) rotate(-90)" '
            f'fill="{LAYERS[layer_of(name)]}">{escape(name)}</text>'
        )
    return "\n".join([*lines, "</svg>", ""])


def _row(
    row: int, name: str, names: list[str], imports: Mapping[tuple[str, str], int]
) -> Iterator[str]:
    """A package's name, the line below it, and a mark for each package that it imports."""
    y, colour = _NAMES + _CELL * row, LAYERS[layer_of(name)]
    yield (
        f'<text x="{_NAMES - 6}" y="{y + 12}" text-anchor="end" fill="{colour}">'
        f"{escape(name)}</text>"
    )
    yield (
        f'<path d="M{_NAMES} {y + _CELL}h{_CELL * len(names)}'
        f'M{_NAMES + _CELL * (row + 1)} {_NAMES}v{_CELL * len(names)}" stroke="#e5e7eb"/>'
    )
    for column, other in enumerate(names):
        x = _NAMES + _CELL * column
        if column == row:
            yield f'<rect x="{x}" y="{y}" width="{_CELL}" height="{_CELL}" fill="{colour}"/>'
        elif count := imports.get((name, other), 0):
            mark = colour if column > row else _UPWARDS
            said = f"{name} imports {other}: modules that do: {count}"
            yield (
                f'<circle cx="{x + _CELL / 2}" cy="{y + _CELL / 2}" r="{3 if count < 4 else 5.5}" '
                f'fill="{mark}"><title>{escape(said)}</title></circle>'
            )


if __name__ == "__main__":
    main()
