# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the extension's zip: fetch its wheels, stage its files, pack and validate with Blender.

Run by `make build` with a Python that has the bpy wheel, whose packer is used. The zip's path is
the last line printed.
"""

import importlib.util
import shutil
import subprocess
import sys
import tomllib
from hashlib import sha256
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
PINS = REPOSITORY / ".ci" / "requirements-wheels.txt"
WHEELS = REPOSITORY / "build" / "wheels"
STAGE = REPOSITORY / "build" / "extension"
OUTPUT = REPOSITORY / "dist"


def run(*command: str | Path) -> None:
    subprocess.run([str(word) for word in command], check=True)  # noqa: S603 - our own commands


def fetch_wheel(name: str) -> Path:
    """Download one wheel by name, or take the one that is there if its hash is a pinned one."""
    wheel = WHEELS / name
    if wheel.exists() and f"sha256:{sha256(wheel.read_bytes()).hexdigest()}" in PINS.read_text():
        return wheel
    _distribution, _version, python_tag, abi, platforms = name.removesuffix(".whl").split("-")
    # fmt: off
    run(
        sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check",
        "--no-input", "--no-deps", "--only-binary", ":all:", "--require-hashes",
        "--requirement", PINS, "--dest", WHEELS,
        "--implementation", "cp", "--python-version", python_tag.removeprefix("cp"), "--abi", abi,
        *(word for platform in platforms.split(".") for word in ("--platform", platform)),
    )
    # fmt: on
    return wheel


def stage(wheels: list[str]) -> None:
    """Lay out the extension as it will be in the zip: manifest, code and licence side by side."""
    shutil.rmtree(STAGE, ignore_errors=True)
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(REPOSITORY / "octo_motion", STAGE, ignore=ignore)
    shutil.copy(REPOSITORY / "blender_manifest.toml", STAGE)
    shutil.copy(REPOSITORY / "LICENSE", STAGE)
    (STAGE / "wheels").mkdir()
    for wheel in wheels:
        shutil.copy(fetch_wheel(wheel), STAGE / "wheels")


def packer() -> Path:
    """Blender's own extension tool inside the bpy wheel; it runs under plain Python."""
    specification = importlib.util.find_spec("bpy")
    if specification is None or specification.origin is None:
        sys.exit("The packer is part of bpy, which this Python has not: run `make build`.")
    folder = Path(specification.origin).parent
    return next(folder.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))


def main() -> None:
    manifest = tomllib.loads((REPOSITORY / "blender_manifest.toml").read_text(encoding="utf-8"))
    stage([Path(wheel).name for wheel in manifest["wheels"]])
    OUTPUT.mkdir(exist_ok=True)
    archive = OUTPUT / f"{manifest['id']}-{manifest['version']}.zip"
    run(sys.executable, packer(), "build", "--source-dir", STAGE, "--output-filepath", archive)
    run(sys.executable, packer(), "validate", archive)
    print(archive.relative_to(REPOSITORY))


if __name__ == "__main__":
    main()
