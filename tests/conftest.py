# SPDX-License-Identifier: GPL-3.0-or-later
"""What every test stands on: a clean Blender, the add-on registered once, repeatable randomness.

Tests of core and device never see bpy: it is imported only when a test of another folder runs.
"""

import atexit
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import hypothesis
import pytest

REPOSITORY = Path(__file__).resolve().parent.parent
WITHOUT_BLENDER = {"core", "device"}
UNDER_THE_OLDER = WITHOUT_BLENDER | {
    *("blender", "bench", "referee"),
    *("ui/posing", "ui/splicing", "ui/follow_through"),
}
"""Whose tests with the mark `one_blender` run under the older of two, where both run."""
ONE_BLENDER = {"core"}
"""Whose tests all have that mark: what never sees Blender is the same under each."""
BESIDE_ANOTHER = "OCTO_MOTION_BESIDE_ANOTHER"
"""What `make test` sets where it tests two Blenders side by side."""
LACKING_DATA = "lacking data"
"""How tests are counted that were skipped because the collection of rigs and clips is not here."""

# No deadline: a test must not depend on the clock. Derandomized: the same examples on each run.
hypothesis.settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
hypothesis.settings.load_profile("repeatable")


def pytest_sessionfinish(exitstatus: int) -> None:
    """End the process once everything is done and told, without Blender 4.5's own end.

    As a Python module it may wait for ever, after a long run, for a thread of its own that closes
    files. What an add-on could leave behind is tested in processes that do come to their end:
    tests/end_to_end/extension_life.py.
    """
    if sys.version_info < (3, 12):  # the Python of Blender 4.5
        _endings.append(int(exitstatus))


_endings: list[int] = []


@atexit.register  # at the start: so it comes last
def _end_at_once() -> None:
    if _endings:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(_endings[-1])


def pytest_configure(config: pytest.Config) -> None:
    """Give Blender an empty user folder: no one's preferences, presets or extensions matter."""
    user_folder = tempfile.TemporaryDirectory(prefix="octo-motion-tests-")
    config.add_cleanup(user_folder.cleanup)
    os.environ["BLENDER_USER_RESOURCES"] = user_folder.name


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Where another Blender is tested beside this one, leave it those that one is enough for: to
    the older one about half of them, to the newer one the rest.
    """
    named = any(Path(each.split("::")[0]).exists() for each in config.invocation_params.args)
    if named or BESIDE_ANOTHER not in os.environ:
        return
    newer = sys.version_info >= (3, 12)
    left = {
        each
        for each in items
        if (each.get_closest_marker("one_blender") or _layer(each.path) in ONE_BLENDER)
        and (not UNDER_THE_OLDER.isdisjoint(_folders(each.path))) == newer
    }
    items[:] = [each for each in items if each not in left]
    config.hook.pytest_deselected(items=list(left))


def _layer(path: Path) -> str:
    return path.relative_to(REPOSITORY / "tests").parts[0]


def _folders(path: Path) -> set[str]:
    """`core`, or `ui` and `ui/posing`: every folder of the tests that the file lies in."""
    inside = path.relative_to(REPOSITORY / "tests").parts
    return {"/".join(inside[: k + 1]) for k in range(len(inside))}


def pytest_report_teststatus(report: pytest.TestReport) -> tuple[str, str, str] | None:
    """Count tests without their data apart, so that one line tells of them and not hundreds."""
    if report.skipped and isinstance(report.longrepr, tuple) and LACKING_DATA in report.longrepr[2]:
        return LACKING_DATA, "s", "SKIPPED"
    return None


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say which tests were skipped because a clone lacks the collection of rigs and clips."""
    if lacking := terminalreporter.stats.get(LACKING_DATA):
        files = Counter(report.location[0] for report in lacking)
        named = ", ".join(f"{file} ({count})" for file, count in sorted(files.items()))
        terminalreporter.write_line(
            f"{len(lacking)} tests need rigs and clips that are not here; $OCTO_MOTION_DATA names "
            f"their folder: {named}"
        )


@pytest.fixture
def shared_data() -> Callable[[str], Path]:
    """Path of a file of the real-world collection, or a skip where the collection is absent.

    The collection is `$OCTO_MOTION_DATA`, else `../shared/data` beside the repository.
    """
    folder = Path(os.environ.get("OCTO_MOTION_DATA") or REPOSITORY.parent / "shared" / "data")

    def locate(relative_path: str) -> Path:
        path = folder / relative_path
        if not path.exists():
            pytest.skip(f"{LACKING_DATA}: {path}")
        return path

    return locate


@pytest.fixture(scope="session")
def add_on() -> Iterator[None]:
    """The add-on, registered for the whole session."""
    import octo_motion

    octo_motion.register()
    yield
    # bpy 4.5 hangs at exit while an Operator class is registered.
    octo_motion.unregister()


@pytest.fixture(autouse=True)
def clean_factory_state(request: pytest.FixtureRequest) -> None:
    """Start each test that uses Blender from factory settings and an empty file."""
    layer = _layer(request.path)
    if layer in WITHOUT_BLENDER or layer.endswith(".py"):
        return
    import bpy

    request.getfixturevalue("add_on")
    if _factory_add_ons and _are_factory_preferences():
        # The same, without Blender's own add-ons being switched off and on: five times as fast.
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        return
    bpy.ops.wm.read_factory_settings(use_empty=True)
    preferences = bpy.context.preferences
    _factory_add_ons[:], preferences.is_dirty = preferences.addons.keys(), False


_factory_add_ons: list[str] = []


def _are_factory_preferences() -> bool:
    """Whether no test has touched the preferences since they were read."""
    import bpy

    preferences = bpy.context.preferences
    return not preferences.is_dirty and preferences.addons.keys() == _factory_add_ons
