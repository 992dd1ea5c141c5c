# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension comes and goes without a trace, as source and as the zip that artists install."""

import os
import re
import subprocess
import sys
from io import BytesIO
from pathlib import Path
from zipfile import ZipFile

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent.parent


def run_blender(*arguments: str | Path) -> str:
    """Whole output of extension_life.py, with every warning of Python an error."""
    run = subprocess.run(
        [sys.executable, "-u", "-W", "error", "-m", "tests.end_to_end.extension_life", *arguments],
        cwd=REPOSITORY,
        env=dict(os.environ),  # Python's view of it: bpy in this process has added to C's
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        check=False,
        timeout=120,  # Blender 4.5 hangs at exit where an operator, menu entry or timer is left
    )
    assert run.returncode == 0, run.stdout
    return run.stdout


def test_add_on_leaves_no_trace_however_often_it_is_registered() -> None:
    assert run_blender("register") == ""


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The zip that `make build` makes, validated by Blender's own tool as it is built; or the one
    that `make release` has made.
    """
    if made := os.environ.get("OCTO_MOTION_ZIP"):
        return Path(made)
    folder = tmp_path_factory.mktemp("extension")
    subprocess.run(
        [sys.executable, REPOSITORY / ".ci" / "build.py", folder],
        check=True,
        stdin=subprocess.DEVNULL,
    )
    return next(folder.glob("*.zip"))


def test_works_of_others_in_the_zip_are_all_named_in_it(archive: Path) -> None:
    with ZipFile(archive) as extension:
        text = extension.read("THIRD_PARTY.md").decode()
        assert {"LICENSE", "blender_manifest.toml"} <= set(extension.namelist())
        wheels = [name for name in extension.namelist() if name.endswith(".whl")]
        files: set[str] = set()
        for name in wheels:
            with ZipFile(BytesIO(extension.read(name))) as wheel:
                files |= {
                    each for each in wheel.namelist() if re.search(r"\.(so|pyd|dll|dylib)", each)
                }
    named = set(re.findall(r"`([\w.-]+)`", text))
    stems = {re.split(r"[.-]", Path(each).name)[0] for each in files}
    # Each file begins as it is named there: libusb-1-150b88da.0.so.0.1.0 is `libusb-1.0`.
    assert wheels
    assert stems <= {re.split(r"[.-]", name)[0] for name in named}


def test_zip_installs_disables_enables_and_uninstalls_without_a_complaint_on_the_console(
    archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BLENDER_USER_RESOURCES", str(tmp_path))

    said = [
        line
        for line in run_blender("install", archive).splitlines()
        if not line.startswith("Octo Motion device: Found")  # the bridge's own log
    ]
    installed, operators, walk, bridge, hidapi, removed = (
        line for line in said if not line.startswith(("Info: ", "Warning: "))
    )

    assert installed == 'STATUS Installed "octo_motion"'
    assert {"add_octopus", "add_route", "detect_arms", "generate_locomotion"} <= set(
        operators.split()
    )
    assert int(walk.removeprefix("walk ")) > 100
    # The bridge runs in Blender's own Python, which is told where the wheel's files are.
    what, device, library, *folders = bridge.split()
    assert (what, device, library) == ("bridge", "Simulated-hand", "hidapi")
    assert any(Path(each).is_relative_to(tmp_path / "extensions" / ".local") for each in folders)
    python = f"{sys.version_info.major}{sys.version_info.minor}"
    assert hidapi.startswith((f"hid.cpython-{python}", f"hid.cp{python}"))
    assert removed == 'STATUS Removed "octo_motion"'
