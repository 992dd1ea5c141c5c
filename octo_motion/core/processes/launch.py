# SPDX-License-Identifier: GPL-3.0-or-later
"""Start a program of ours from its file, wherever Blender has put the extension.

Installed, the package is called ``bl_ext.….octo_motion``, a name that exists within Blender alone,
and its folder lies beside other extensions, which must not become importable. So this file, run by
its path, loads the package under its short name from the folder it lies in, and nothing else.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from pathlib import Path


def load() -> None:
    """Make the package importable as ``octo_motion``."""
    folder = Path(__file__).resolve().parents[2]
    name = "octo_motion"
    specification = importlib.util.spec_from_file_location(
        name, folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    if specification is None or specification.loader is None:
        raise ImportError(name)
    package = importlib.util.module_from_spec(specification)
    sys.modules[name] = package
    specification.loader.exec_module(package)


def main() -> int:
    """Run the ``main`` of a module of ours, the first argument, with the arguments after it.

    ``--library FOLDER``, as often as needed, says where numpy and hidapi are, ``--dlls FOLDER``
    where Windows finds libraries that they need.
    """
    module, *arguments = sys.argv[1:]
    if "--dlls" in arguments:
        at = arguments.index("--dlls")
        if sys.platform == "win32":
            os.add_dll_directory(arguments[at + 1])
        del arguments[at : at + 2]
    while "--library" in arguments:
        at = arguments.index("--library")
        sys.path.extend(folder for folder in arguments[at + 1 : at + 2] if folder not in sys.path)
        del arguments[at : at + 2]
    load()
    return importlib.import_module(module).main(arguments)


if __name__ == "__main__":
    sys.exit(main())
