# SPDX-License-Identifier: GPL-3.0-or-later
"""The bridge as a process: it poses the puppet, tells what happens, and ends when it must."""

from __future__ import annotations

import contextlib
import logging
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from octo_motion.core.errors import DeviceError
from octo_motion.core.posing.solver.obstacle_shapes import Plane
from octo_motion.core.processes.python import LAUNCHER, library_folders
from octo_motion.device import __main__ as program
from octo_motion.device import messages as say
from octo_motion.device.ipc import process
from octo_motion.device.ipc.client import Client, ClientState
from tests.device.bridges import (
    FIGURE,
    OPTIONS,
    POSE,
    bridge_of,
    holding,
    kill_blender,
    kill_bridge_and_start_again,
    kill_hands,
    wait_for,
)
from tests.processes import alive, children_of

REPOSITORY = Path(__file__).resolve().parents[2]
SOON = 5.0
"""s: on a machine that has other things to do; python -m tests.device.kill says how soon it is."""


def write(path: Path, text: str) -> None:
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")


@pytest.fixture
def client() -> Iterator[Client]:
    client = Client()
    yield client
    client.stop()


def test_hand_grabs_the_nearest_limb_and_bends_the_puppet(client: Client) -> None:
    holding(client)
    hello = client.hello
    assert hello
    assert client._child
    started = client._child._process.pid
    assert hello.process in {started, *children_of(started)}

    def bent() -> bool:
        assert client.pose
        return bool(np.abs(client.pose.orientations - POSE.orientations).max() > 0.02)

    wait_for(client, bent, "the puppet bends")
    pointer = client.pointers[0]
    assert np.linalg.norm(np.subtract(pointer.coupled_position, pointer.position)) < 0.05
    wait_for(client, lambda: any(client.pointers[0].force), "the hand feels it")
    wait_for(client, lambda: client.times, "how well time is kept is told")
    client.send(say.Grab(0, grab=False))
    wait_for(client, lambda: client.pointers[0].body == -1, "it lets go")
    assert client.notices == []


def test_hand_far_from_the_puppet_grabs_nothing(client: Client) -> None:
    client.start(OPTIONS)
    client.send_figure(FIGURE, POSE)
    wait_for(client, lambda: client.devices, "the hand is there")
    client.send(say.Workspace(0, (10.0, 0.0, 0.0)))
    client.send(say.Grab(0, grab=True))
    wait_for(
        client, lambda: 0 in client.pointers and client.pointers[0].position[0] > 9.0, "it moves"
    )
    end = time.monotonic() + 0.2
    while time.monotonic() < end:
        client.poll()
        assert client.pointers[0].body == -1


def test_puppet_can_be_put_pinned_and_stood_on_the_ground(client: Client) -> None:
    client.start(OPTIONS)
    client.send(say.WorldMessage(gravity=(0.0, 0.0, -9.81), step=4e-3))
    client.send_obstacle(0, Plane(position=np.array([0.0, 0.0, -0.5])))
    client.send_figure(FIGURE, POSE)
    wait_for(client, lambda: client.pose and client.pose.positions[0, 2] < -0.3, "it falls")
    wait_for(
        client,
        lambda: client.pose and abs(client.pose.positions[:, 2].min() + 0.47) < 0.05,
        "it lies on the ground",
    )
    client.send_pose(POSE)
    client.send_pins({0: True, 1: True, 2: True})
    wait_for(
        client, lambda: client.pose and abs(client.pose.positions[0, 2]) < 0.05, "it is put back"
    )


def test_nonsense_is_answered_with_a_notice_and_nothing_breaks(client: Client) -> None:
    client.start(OPTIONS)
    client.send(say.Place(POSE.positions, POSE.orientations))
    wait_for(client, lambda: client.notices, "the bridge complains")
    assert "a pose came before a figure" in client.notices.pop().problem
    client.send_figure(FIGURE, POSE)
    client.send(say.Pins((1,) * 50))
    wait_for(client, lambda: client.notices, "the bridge complains")
    assert "does not exist" in client.notices.pop().problem
    client.send(say.Settings(dead_zone=(2.0,) * 6))  # pyright: ignore[reportArgumentType]
    wait_for(client, lambda: client.notices, "the bridge complains")
    assert client.state is ClientState.RUNNING


def test_meshes_of_a_whole_scene_wait_for_a_bridge_that_is_still_starting(client: Client) -> None:
    client.start(OPTIONS)
    client.send_figure(FIGURE, POSE)
    far, turn = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    # As large as the largest, and each of them refused, which takes no time: a corner is missing.
    corners = np.zeros((149_999, 3))
    meshes = [say.ObstacleMessage(n, 5, far, turn, 0.0, corners) for n in range(6)]
    for mesh in meshes:
        client.send(mesh)
    wait_for(client, lambda: client.devices, "the hand is there")
    wait_for(client, lambda: len(client.notices) == 6, "all have come")
    assert client.state is ClientState.RUNNING


def test_bridge_that_is_stopped_ends_at_once_and_is_not_lost(client: Client) -> None:
    holding(client)
    process_id = bridge_of(client)
    assert process_id
    client.stop()
    assert client.state is ClientState.OFF
    assert bridge_of(client) is None
    assert not alive(process_id)
    client.stop()
    assert client.poll() == []
    client.send(say.Grab(0, grab=True))
    assert client.notices == []


def test_killed_bridge_is_told_keeps_the_pose_and_can_be_started_again() -> None:
    noticed, ended = kill_bridge_and_start_again()
    assert max(noticed, ended) < SOON


def test_killed_blender_leaves_no_process_behind() -> None:
    assert kill_blender() < SOON


def test_killed_process_at_the_devices_is_started_again() -> None:
    kill_hands()


def test_stranger_at_the_bridges_door_changes_nothing(tmp_path: Path) -> None:
    """Whoever finds the port and does not know the secret is sent away; no file is written."""
    with subprocess.Popen(
        [process.python_executable(), "-I", LAUNCHER, process.PROGRAM, "bridge", *OPTIONS],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=tmp_path,
    ) as run:
        assert run.stdin
        assert run.stdout
        assert run.stderr
        run.stdin.write(b"00" * 32 + b"\n")
        run.stdin.flush()
        port = int(run.stdout.readline().decode().removeprefix("port "))
        with (
            socket.create_connection(("127.0.0.1", port)) as stranger,
            contextlib.suppress(ConnectionResetError),
        ):
            stranger.sendall(b"let me in" * 20)
            stranger.settimeout(10.0)
            while stranger.recv(1000):
                pass
        run.kill()
        said = run.stderr.read().decode()
    assert "another language" in said
    assert list(tmp_path.iterdir()) == []


def test_program_that_does_not_start_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="does not start"):
        Client().start(OPTIONS, python=tmp_path / "no-python")
    if os.name != "nt":
        silent = tmp_path / "python3"
        write(silent, "#!/bin/sh\nexit 1\n")
        silent.chmod(0o755)
        with pytest.raises(DeviceError, match="does not answer"):
            Client().start(OPTIONS, python=silent)


def test_blenders_own_python_is_found_wherever_it_lies(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert process.python_executable() == Path(sys.executable)
    name = "python.exe" if os.name == "nt" else f"python3.{sys.version_info.minor}"
    folder = tmp_path / ("." if os.name == "nt" else "bin")
    folder.mkdir(exist_ok=True)
    (folder / name).touch(0o755)
    for blender in ("/opt/blender/blender", ""):
        monkeypatch.setattr(sys, "executable", blender)
        monkeypatch.setattr(sys, "prefix", str(tmp_path))
        assert process.python_executable() == folder / name
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "nothing"))
    monkeypatch.setattr(sys, "base_prefix", str(tmp_path / "nothing"))
    monkeypatch.setattr(sys, "exec_prefix", str(tmp_path / "nothing"))
    with pytest.raises(DeviceError, match="Python was not found"):
        process.python_executable()


def test_program_runs_from_where_blender_installs_it(tmp_path: Path) -> None:
    """Below bl_ext the package has another name, and beside it lie folders that must stay out."""
    installed = tmp_path / "extensions" / "user_default" / "octo_motion"
    installed.parent.mkdir(parents=True)
    skipped = shutil.ignore_patterns("__pycache__", "presets", "ui", "blender", "splicing")
    shutil.copytree(REPOSITORY / "octo_motion", installed, ignore=skipped)
    write(installed.parent / "json" / "__init__.py", "raise SystemExit('the wrong json')")
    launcher = LAUNCHER.relative_to(REPOSITORY / "octo_motion")
    run = subprocess.run(
        [process.python_executable(), "-I", installed / launcher, process.PROGRAM, "descriptor"],
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    assert run.stdout.startswith("0x06, 0x4f, 0xff, 0x09, 0x01, 0xa1, 0x01")


def test_libraries_that_came_with_the_extension_are_handed_over(tmp_path: Path) -> None:
    write(tmp_path / "octo_test_library.py", "")
    script = (
        "import sys, runpy\n"
        f"sys.argv = ['launch.py', {process.PROGRAM!r}, '--library', sys.argv[1], 'descriptor']\n"
        f"try: runpy.run_path({str(LAUNCHER)!r}, run_name='__main__')\n"
        "except SystemExit: pass\n"
        "import octo_test_library"
    )
    run = subprocess.run([sys.executable, "-c", script, tmp_path], check=False)
    assert run.returncode == 0
    assert any((Path(each) / "numpy").is_dir() for each in library_folders())


# --- The command line ----------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["bridge", "hands"])
@pytest.mark.parametrize("said", ["", "hello\n"])
def test_program_without_blender_ends_without_a_riddle(command: str, said: str) -> None:
    """Blender killed in the moment of starting it, or a person who tries it out."""
    ended = subprocess.run(
        [sys.executable, str(LAUNCHER), process.PROGRAM, command],
        input=said,
        capture_output=True,
        encoding="utf-8",
        timeout=60.0,
        check=False,
    )
    assert ended.returncode != 0
    assert "Traceback" not in ended.stderr
    assert ("started by Blender" in ended.stderr) == bool(said)


def test_descriptor_is_printed_for_firmware_and_for_people(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert program.main(["descriptor"]) == 0
    printed = capsys.readouterr().out
    from octo_motion.device.hid.force_profile import report_descriptor

    values = bytes(int(each, 16) for each in printed.replace("\n", " ").split(",") if each.strip())
    assert values == report_descriptor()
    assert program.main(["descriptor", "--table"]) == 0
    assert "Report 1, input, 53 bytes with its number" in capsys.readouterr().out


def test_watching_prints_what_a_device_says(capsys: pytest.CaptureFixture[str]) -> None:
    assert program.main(["watch", "--seconds", "0.3", *OPTIONS]) == 0
    assert "Simulated hand:" in capsys.readouterr().out


@pytest.mark.parametrize(
    "wrong",
    [
        ["watch", "--udp", "5000"],
        ["watch", "--udp", "5000", "--key", "00" * 16],
        ["watch", "--udp", "1", "--tcp", "2", "--key-file", "key"],
        ["watch", "--tcp", "70000", "--key-file", "key"],
    ],
)
def test_command_line_that_makes_no_sense_is_refused(wrong: list[str]) -> None:
    with pytest.raises(SystemExit):
        program.main(wrong)


@pytest.fixture(autouse=True)
def quiet_log() -> Iterator[None]:
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    yield
    root.handlers[:], root.level = handlers, level
