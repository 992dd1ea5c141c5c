# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the extension's zip: fetch its wheels, stage its files, pack and validate with Blender.

Run by `make build` with a Python that has the bpy wheel, whose packer is used. The zip goes to the
folder given, else to dist; its path is the last line printed.
"""

import importlib.util
import shutil
import subprocess
import sys
import tomllib
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory

REPOSITORY = Path(__file__).resolve().parent.parent
PINS = REPOSITORY / ".ci" / "requirements-wheels.txt"
WHEELS = REPOSITORY / "build" / "wheels"


def run(*command: str | Path) -> None:
    subprocess.run([str(word) for word in command], check=True)  # noqa: S603 - our own commands


def fetch_wheel(name: str) -> Path:
    """Download one wheel by name, or take the one that is there if its hash is a pinned one."""
    wheel = WHEELS / name
    if wheel.exists() and f"sha256:{sha256(wheel.read_bytes()).hexdigest()}" in PINS.read_text(
        encoding="utf-8"
    ):
        return wheel
    _distribution, _version, python_tag, abi, platforms = name.removesuffix(".whl").split("-")
    WHEELS.mkdir(parents=True, exist_ok=True)
    # Put in its place as a whole: another build may be looking for it at the same time.
    with TemporaryDirectory(dir=WHEELS) as scratch:
        run(
            *(sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check"),
            *("--no-input", "--no-deps", "--only-binary", ":all:", "--require-hashes"),
            *("--requirement", PINS, "--dest", scratch, "--implementation", "cp"),
            *("--python-version", python_tag.removeprefix("cp"), "--abi", abi),
            *(f"--platform={platform}" for platform in platforms.split(".")),
        )
        (Path(scratch) / name).replace(wheel)
    return wheel


def lay_out(folder: Path, wheels: list[str]) -> None:
    """Put the files side by side as they will be in the zip: manifest, licence, code, manual,
    wheels.
    """
    shutil.copytree(
        REPOSITORY / "octo_motion", folder, ignore=shutil.ignore_patterns("__pycache__")
    )
    shutil.copy(REPOSITORY / "blender_manifest.toml", folder)
    shutil.copy(REPOSITORY / "LICENSE", folder)
    shutil.copy(REPOSITORY / "THIRD_PARTY.md", folder)
    run(sys.executable, REPOSITORY / ".ci" / "manual.py", folder / "manual")
    (folder / "wheels").mkdir()
    for wheel in wheels:
        shutil.copy(fetch_wheel(wheel), folder / "wheels")


def packer() -> Path:
    """Blender's own extension tool inside the bpy wheel; it runs under plain Python."""
    specification = importlib.util.find_spec("bpy")
    if specification is None or specification.origin is None:
        sys.exit("The packer is part of bpy, which this Python has not: run `make build`.")
    folder = Path(specification.origin).parent
    return next(folder.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))


def tags() -> tuple[str | Path, ...]:
    """The option that names the tags that Blender's platform has."""
    modules = packer().parents[3] / "modules"
    return "--valid-tags", modules / "_bpy_internal" / "extensions" / "tags.py"


def main(output: Path) -> None:
    manifest = tomllib.loads((REPOSITORY / "blender_manifest.toml").read_text(encoding="utf-8"))
    archive = output / f"{manifest['id']}-{manifest['version']}.zip"
    output.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as scratch:
        folder = Path(scratch) / "extension"
        lay_out(folder, [Path(wheel).name for wheel in manifest["wheels"]])
        run(
            *(sys.executable, packer(), "build"),
            *("--source-dir", folder, "--output-filepath", archive),
        )
    run(sys.executable, packer(), "validate", archive, *tags())
    print(archive)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else REPOSITORY / "dist")
