# SPDX-License-Identifier: GPL-3.0-or-later
"""Try the extension's zip in an official build of Blender: .ci/try_blender.py BLENDER ZIP.

Installs it into an empty user folder and takes the first walk; starts the bridge to devices, looks
what it costs while nobody holds a hand, kills it, then Blender; makes shots of a job in a folder
whose name is not plain, from a file with the mark of Windows' editors; kills that half way and does
it again; has a job with backslashes refused. Needs Python alone. For ZIP, the folder that has it
will do.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from tests.processes import alive, children_of, end, processor_seconds

JOB = """\ufeff[defaults]
output = "out/{name}.blend"
octopus = { arms = 4, joints = 3 }
route = [[0, 0, 0], [0, -1, 0], [1, -1, 0], [2, -1, 0]]
"""
WALK = (
    "import bpy; bpy.ops.octo_motion.add_octopus(); octopus = bpy.context.object; "
    "bpy.ops.octo_motion.add_route(); bpy.ops.octo_motion.generate_locomotion(); "
    "print('WALKED', octopus.animation_data.action.frame_range[1])"
)
BRIDGE = """
import importlib, time
name = "bl_ext.user_default.octo_motion.device.ipc.client"
client = importlib.import_module(name).Client()
def wait(what):
    end = time.monotonic() + 60.0
    while not what():
        client.poll()
        time.sleep(0.01)
        assert time.monotonic() < end, (client.state, client.notices)
client.start(("--simulate", "--no-haply"))
wait(lambda: client.hello and client.devices)
print("BRIDGE", client.hello.process, flush=True)
wait(lambda: client.state.name == "LOST")
client.restart()
wait(lambda: client.state.name == "RUNNING" and client.devices)
print("BACK", client.hello.process, flush=True)
while True:
    client.poll()
    time.sleep(0.01)
"""
IDLE = 10.0
"""s for which nobody holds the hand."""
MOST = 0.4
"""Share of one processor that each process of the bridge may take meanwhile."""


def main(blender: str, archive: str) -> None:
    blender = str(Path(blender).resolve())
    if Path(archive).is_dir():
        archive = str(max(Path(archive).glob("*.zip"), key=lambda path: path.stat().st_mtime))
    archive = str(Path(archive).resolve())
    with tempfile.TemporaryDirectory(
        prefix="octo ~ Łódź é ", ignore_cleanup_errors=True
    ) as scratch:
        folder = Path(scratch)
        environment = {**os.environ, "BLENDER_USER_RESOURCES": str(folder / "user")}
        (folder / "user").mkdir()

        def run(*words: str | Path) -> subprocess.CompletedProcess[str]:
            command = [blender, "--background", *map(str, words)]
            ended = subprocess.run(  # noqa: S603 - the Blender that is tried
                command,
                env=environment,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                encoding="utf-8",
                errors="replace",
                check=False,
            )
            print(ended.stdout, ended.stderr, sep="\n", flush=True)
            return ended

        def bake(job: Path, *words: str) -> int:
            return run("--command", "octo_motion", "bake", job, *words).returncode

        install = ("extension", "install-file", "--repo", "user_default", "--enable")
        expect(run("--command", *install, archive).returncode == 0, "the zip is installed")
        walked = run("--python-exit-code", "1", "--python-expr", WALK)
        expect("WALKED" in walked.stdout, "the first walk is there")

        try_bridge([blender, "--background", "--python-expr", BRIDGE], environment)

        job = folder / "job.toml"
        shots = "".join(f'[[shots]]\nname = "s{number}"\n' for number in range(6))
        job.write_text(JOB + shots, encoding="utf-8")
        words = [blender, "--background", "--command", "octo_motion", "bake", str(job), "-j", "2"]
        process = subprocess.Popen(words, env=environment, stdin=subprocess.DEVNULL)  # noqa: S603
        while process.poll() is None and not list((folder / "out").glob("s*.blend")):
            time.sleep(0.1)
        process.kill()
        process.wait()
        expect(bake(job) == 0, "a job that was killed half way goes on")
        report = json.loads(job.with_suffix(".report.json").read_text(encoding="utf-8"))
        expect(report["failed"] == 0 and len(report["shots"]) == 6, "all of its shots are there")
        names = {path.name for path in (folder / "out").iterdir()}
        deadline = time.monotonic() + 60.0
        while any(".part" in each for each in names) and time.monotonic() < deadline:
            time.sleep(1.0)
            names = {path.name for path in (folder / "out").iterdir()}
        expect(
            names == {f"s{number}.blend" for number in range(6)},
            f"and nothing else: {sorted(names)}",
        )

        wrong = folder / "wrong.toml"
        wrong.write_text(
            JOB.replace('"out/{name}.blend"', r'"out\new.blend"') + shots, encoding="utf-8"
        )
        expect(bake(wrong) == 2, "backslashes are refused")


def try_bridge(command: list[str], environment: dict[str, str]) -> None:
    """Start the bridge from a Blender, let it idle, kill it, kill Blender."""
    process = subprocess.Popen(  # noqa: S603 - the Blender that is tried
        command,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        encoding="utf-8",
        errors="replace",
    )

    def told(what: str) -> int:
        assert process.stdout is not None
        for line in process.stdout:
            print(line, end="", flush=True)
            if line.startswith(f"{what} "):
                return int(line.split()[1])
        return expect(holds=False, what=f"Blender says {what}")

    try:
        bridge = told("BRIDGE")
        started = children_of(process.pid)
        expect(bridge in started and len(started) > 1, "the bridge and the loop at the devices run")
        time.sleep(2.0)
        before = {each: processor_seconds(each) for each in started}
        time.sleep(IDLE)
        shares = {each: (processor_seconds(each) - before[each]) / IDLE for each in started}
        print(f"processors' time while idle: {shares}")
        expect(max(shares.values()) < MOST, "what waits for a hand leaves the processor alone")
        end(bridge)
        expect(told("BACK") != bridge, "a bridge that was killed is told, and starts again")
        started = children_of(process.pid)
    finally:
        process.kill()
        process.wait()
    latest = time.monotonic() + 20.0
    while (left := [each for each in started if alive(each)]) and time.monotonic() < latest:
        time.sleep(0.1)
    expect(not left, "no process outlives a Blender that was killed")


def expect(holds: bool, what: str) -> int:  # noqa: FBT001 - a statement and whether it holds
    print(f"{'ok' if holds else 'NOT SO'}: {what}", flush=True)
    if not holds:
        sys.exit(1)
    return 0


if __name__ == "__main__":
    main(*sys.argv[1:3])
