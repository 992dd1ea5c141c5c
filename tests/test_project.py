# SPDX-License-Identifier: GPL-3.0-or-later
"""The project's own files agree with each other, and its set-up scripts say what is wrong."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

pytestmark = pytest.mark.one_blender

REPOSITORY = Path(__file__).resolve().parent.parent
SET_UP = REPOSITORY / ".ci"
REQUIREMENTS = sorted(SET_UP.glob("requirements-*.txt"))
MANIFEST = tomllib.loads((REPOSITORY / "blender_manifest.toml").read_text(encoding="utf-8"))

needs_posix_shell = pytest.mark.skipif(os.name == "nt", reason="the set-up scripts are POSIX shell")


def pinned_version(requirements: Path, distribution: str) -> str:
    text = requirements.read_text(encoding="utf-8")
    match = re.search(rf"^{distribution}==(\S+)", text, re.MULTILINE)
    assert match, f"{distribution} is not in {requirements.name}"
    return match[1]


@pytest.mark.parametrize("requirements", REQUIREMENTS, ids=lambda path: path.name)
def test_every_requirement_is_pinned_to_one_version(requirements: Path) -> None:
    joined = requirements.read_text(encoding="utf-8").replace("\\\n", " ")
    lines = [line for line in joined.splitlines() if line and not line.startswith("#")]
    assert lines
    assert [line for line in lines if not re.match(r"[\w.-]+==\d[\w.]*( |;|$)", line)] == []


def test_oldest_blender_the_extension_accepts_is_the_oldest_one_tested() -> None:
    tested = pinned_version(SET_UP / "requirements-4.5.txt", "bpy").split(".")
    assert MANIFEST["blender_version_min"].split(".")[:2] == tested[:2]


@pytest.mark.parametrize("blender", ["5.2", "4.5"])
def test_bpy_is_of_the_blender_its_requirement_file_is_named_after(blender: str) -> None:
    version = pinned_version(SET_UP / f"requirements-{blender}.txt", "bpy")
    assert version.startswith(f"{blender}.")


def test_a_device_works_on_every_python_and_system_that_blender_ships_for() -> None:
    systems = ("manylinux_2_17_x86_64", "win_amd64", "macosx_11_0_arm64")
    expected = {(python, system) for python in ("cp311", "cp313", "cp314") for system in systems}
    expected.add(("cp311", "macosx_10_9_x86_64"))  # Blender 4.5 is the last for Intel Macs
    tags = [Path(wheel).stem.split("-")[2:] for wheel in MANIFEST["wheels"]]
    carried = [(python, platforms.split(".")[-1]) for python, _abi, platforms in tags]
    assert sorted(carried) == sorted(expected)


def test_every_wheel_in_the_manifest_has_a_pinned_version_and_a_hash() -> None:
    requirements = SET_UP / "requirements-wheels.txt"
    version = pinned_version(requirements, "hidapi")
    hashes = re.findall(r"--hash=sha256:[0-9a-f]{64}\b", requirements.read_text(encoding="utf-8"))
    assert {Path(wheel).name.split("-")[1] for wheel in MANIFEST["wheels"]} == {version}
    assert len(set(hashes)) == len(hashes) == len(MANIFEST["wheels"])


def test_licence_is_the_same_wherever_it_is_stated() -> None:
    text = (REPOSITORY / "LICENSE").read_text(encoding="utf-8")
    assert MANIFEST["license"] == ["SPDX:GPL-3.0-or-later"]
    assert "GNU GENERAL PUBLIC LICENSE\n                       Version 3, 29 June 2007" in text
    folders = ("octo_motion", "tests", "docs", ".ci")
    files = [path for folder in folders for path in (REPOSITORY / folder).rglob("*.py")]
    header = "# SPDX-License-Identifier: GPL-3.0-or-later\n"
    assert [path for path in files if not path.read_text(encoding="utf-8").startswith(header)] == []


def test_manifest_says_whose_work_it_carries_and_why_it_wants_its_permissions() -> None:
    said = " ".join(MANIFEST["copyright"])
    assert all(name in said for name in ("Octo Motion", "Signal 11", "Gary Bishop"))
    assert set(MANIFEST["permissions"]) == {"files", "network"}
    for reason in MANIFEST["permissions"].values():
        # As Blender's platform asks: short, and no full stop.
        assert len(reason) <= 64
        assert not reason.endswith(".")
    # Nothing but this computer is talked to, which Blender's switch for the network is not about.
    assert "this computer" in MANIFEST["permissions"]["network"]


def validated(manifest: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """What Blender's own validator says of a manifest whose files are all there."""
    specification = importlib.util.find_spec("bpy")
    assert specification is not None
    assert specification.origin is not None
    (scripts,) = Path(specification.origin).parent.glob("*/scripts")
    tool = scripts / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
    tags = scripts / "modules" / "_bpy_internal" / "extensions" / "tags.py"
    (folder / "wheels").mkdir(exist_ok=True)
    for wheel in MANIFEST["wheels"]:
        (folder / wheel).touch()
    (folder / "__init__.py").touch()
    (folder / "blender_manifest.toml").write_text(manifest, encoding="utf-8")
    return subprocess.run(
        [sys.executable, tool, "validate", folder, "--valid-tags", tags],
        capture_output=True,
        encoding="utf-8",
        check=False,
    )


def test_blenders_validator_takes_the_manifest(tmp_path: Path) -> None:
    text = (REPOSITORY / "blender_manifest.toml").read_text(encoding="utf-8")
    run = validated(text, tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr


@pytest.mark.parametrize(
    ("said", "wrong"),
    [
        ("on this computer alone", "on this computer alone."),
        ('"2026 Octo', '"Octo'),
        ("[permissions]", '[permissions]\nmind = "Read it"'),
        ('website = "', 'website = "\\n'),
        ('"Rigging"', '"Octopuses"'),
    ],
)
def test_blenders_validator_refuses_what_the_platform_does(
    tmp_path: Path, said: str, wrong: str
) -> None:
    text = (REPOSITORY / "blender_manifest.toml").read_text(encoding="utf-8")
    assert said in text
    assert validated(text.replace(said, wrong), tmp_path).returncode != 0


def test_changelog_begins_with_the_version_of_the_manifest() -> None:
    text = (REPOSITORY / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## (\S+)", text, re.MULTILINE)[0] == MANIFEST["version"]


def test_manifest_names_a_page_about_the_extension() -> None:
    assert re.fullmatch(r"https://[a-z0-9.-]+\.[a-z]+/\S*", MANIFEST["website"])


def test_libraries_in_the_wheels_are_named_with_their_terms() -> None:
    text = (REPOSITORY / "THIRD_PARTY.md").read_text(encoding="utf-8")
    version = pinned_version(SET_UP / "requirements-wheels.txt", "hidapi")
    assert f"hidapi-{version}.tar.gz" in text
    rows = [line.split("|") for line in text.splitlines() if line.startswith("| ")]
    assert len(rows) == 10
    for _, work, _within, _version, holders, licence, _ in rows[1:]:
        assert work.strip()
        assert re.search(r"\d{4} \w+|none is claimed", holders)
        assert licence.strip()


@needs_posix_shell
def test_make_help_lists_every_target() -> None:
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    phony = re.search(r"^\.PHONY: (.*)$", makefile, re.MULTILINE)
    assert phony
    run = subprocess.run(
        ["make", "--no-print-directory", "help"],
        cwd=REPOSITORY,
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    assert [line.split()[1] for line in run.stdout.splitlines()] == phony[1].split()


def test_every_target_of_make_is_a_task_that_needs_no_make() -> None:
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    phony = re.search(r"^\.PHONY: (.*)$", makefile, re.MULTILINE)
    assert phony
    run = subprocess.run(
        [sys.executable, SET_UP / "dev.py", "help"],
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    tasks = [line.split()[0] for line in run.stdout.splitlines()]
    assert [each for each in tasks if each not in {"venv", "find-python"}] == phony[1].split()


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """A machine with the project's set-up scripts and shell tools, but no Python at all."""
    shutil.copytree(SET_UP, tmp_path / "project" / ".ci")
    tools = tmp_path / "tools"
    tools.mkdir()
    for tool in ("dirname", "grep", "sh", "tr"):
        path = shutil.which(tool)
        assert path, f"{tool} is not on PATH"
        add_script(tools / tool, f'exec {path} "$@"')
    return tmp_path


def run_on(machine: Path, *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command,
        cwd=machine / "project",
        env={"PATH": f"{machine / 'broken'}:{machine / 'tools'}", "HOME": str(machine)},
        capture_output=True,
        encoding="utf-8",
        check=False,
    )


DEV = (sys.executable, ".ci/dev.py")
"""A task with Python alone. This Python is one of an environment, which makes no others."""


def add_script(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    path.chmod(0o755)


@needs_posix_shell
def test_pictures_of_the_window_say_that_there_is_no_blender(machine: Path) -> None:
    run = run_on(machine, *DEV, "window")
    assert run.returncode == 1
    assert run.stderr == (
        "There is no 'blender': name a Blender, as in make window BLENDER=/path/to/blender.\n"
    )


@needs_posix_shell
def test_pictures_of_the_window_say_that_there_is_no_display(machine: Path) -> None:
    add_script(machine / "tools" / "blender", "echo Blender was started")

    run = run_on(machine, *DEV, "window")

    assert (run.returncode, run.stdout) == (1, "")
    assert "there is no display" in run.stderr


@needs_posix_shell
def test_pictures_of_the_window_hand_on_what_is_asked_for(machine: Path) -> None:
    add_script(machine / "tools" / "blender", 'echo "$@"')

    run = run_on(
        machine,
        "sh",
        "-c",
        'DISPLAY=:0 exec "$@"',
        "sh",
        *DEV,
        "window",
        "panel",
        "--folder",
        "a b",
    )

    assert run.returncode == 0
    assert run.stdout.endswith("--python docs/studio/window.py -- panel --folder a b\n")


FINDERS = ((".ci/find-python",), (*DEV, "find-python"))
"""The shell's way, which finds a Python for the other's."""
VERSION = f"{sys.version_info.major}.{sys.version_info.minor}"
THIS_PYTHON = f'exec "{sys.executable}" "$@"'


@needs_posix_shell
@pytest.mark.parametrize(
    "place",
    [
        f"tools/python{VERSION}",
        "tools/python3",
        f".pyenv/versions/{VERSION}.99/bin/python{VERSION}",
    ],
)
def test_python_is_found_behind_a_shim_that_does_not_work(machine: Path, place: str) -> None:
    add_script(machine / "broken" / f"python{VERSION}", "exit 127")
    add_script(machine / place, THIS_PYTHON)

    for find in FINDERS:
        run = run_on(machine, *find, VERSION)
        assert (run.returncode, run.stdout) == (0, f"{sys.executable}\n")


@needs_posix_shell
def test_python_is_found_through_uv(machine: Path) -> None:
    add_script(machine / "tools" / "uv", f'[ "$*" = "python find {VERSION}" ] && echo "$0-python"')
    add_script(machine / "tools" / "uv-python", THIS_PYTHON)

    for find in FINDERS:
        run = run_on(machine, *find, VERSION)
        assert (run.returncode, run.stdout) == (0, f"{sys.executable}\n")


@needs_posix_shell
def test_python_of_another_version_is_not_taken(machine: Path) -> None:
    add_script(machine / "tools" / "python3", THIS_PYTHON)
    for find in FINDERS:
        run = run_on(machine, *find, "3.99")
        assert (run.returncode, run.stdout) == (1, "")


@needs_posix_shell
def test_without_any_python_the_tests_fail_and_say_what_to_install(machine: Path) -> None:
    for command in ((".ci/dev", "test"), (*DEV, "test")):
        run = run_on(machine, *command)
        assert run.returncode == 1
        assert "No working Python 3.13 was found" in run.stderr
        assert "uv python install 3.11" in run.stderr
    assert run.stdout.count("NOT TESTED, its Python is missing") == 2


@needs_posix_shell
@pytest.mark.parametrize(("status", "verdict"), [(0, "passed"), (1, "FAILED")])
def test_with_one_python_its_blender_is_tested_and_the_other_named_at_the_end(
    machine: Path, status: int, verdict: str
) -> None:
    environment = machine / "project" / ".venv" / "bpy-4.5"
    add_script(
        environment / "bin" / "python",
        f'case "$*" in "-m pytest"*) echo "tests: $*"; exit {status};; esac',
    )
    shutil.copy(SET_UP / "requirements-4.5.txt", environment / ".installed")

    run = run_on(machine, *DEV, "test", "-k", "gait")

    assert run.returncode == status
    assert "tests: -m pytest -k gait\n" in run.stdout
    assert run.stdout.endswith(
        f"Blender 5.2: NOT TESTED, its Python is missing (see above)\nBlender 4.5: {verdict}\n"
    )


@needs_posix_shell
def test_environment_is_set_up_again_when_its_requirements_change(machine: Path) -> None:
    requirements = machine / "project" / ".ci" / "requirements-4.5.txt"
    python = machine / "project" / ".venv" / "bpy-4.5" / "bin" / "python"
    add_script(python, 'echo "$*" >> installed')
    add_script(machine / "tools" / "python3.11", f'echo "{python}"')
    command = (*DEV, "venv", "bpy-5.2", "bpy-4.5")

    first, second = run_on(machine, *command), run_on(machine, *command)
    requirements.write_text("bpy==4.5.16\n", encoding="utf-8")
    third = run_on(machine, *command)
    assert third.returncode == 0, third.stderr

    assert [run.stdout for run in (first, second, third)] == [f"{python}\n"] * 3
    assert [bool(run.stderr) for run in (first, second, third)] == [True, False, True]
    assert (machine / "project" / "installed").read_text(encoding="utf-8").count("pip install") == 2
