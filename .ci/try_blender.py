# SPDX-License-Identifier: GPL-3.0-or-later
"""Try the extension's zip in an official build of Blender: .ci/try_blender.py BLENDER ZIP.

Installs it into an empty user folder, makes shots of a job in a folder whose name is not plain,
from a file with the mark of Windows' editors; kills that half way and does it again; has a job with
backslashes refused. Needs Python alone.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

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


def main(blender: str, archive: str) -> None:
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
        expect(names == {f"s{number}.blend" for number in range(6)}, "and nothing else")

        wrong = folder / "wrong.toml"
        wrong.write_text(
            JOB.replace('"out/{name}.blend"', r'"out\new.blend"') + shots, encoding="utf-8"
        )
        expect(bake(wrong) == 2, "backslashes are refused")


def expect(holds: bool, what: str) -> None:  # noqa: FBT001 - a statement and whether it holds
    print(f"{'ok' if holds else 'NOT SO'}: {what}", flush=True)
    if not holds:
        sys.exit(1)


if __name__ == "__main__":
    main(*sys.argv[1:3])
