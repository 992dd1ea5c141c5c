# SPDX-License-Identifier: GPL-3.0-or-later
"""`make test-farm`: the job scripts of the extension in the engines that they are for.

Says what was run and what was skipped; the status is 1 if anything is not as it must be.
``--shots`` is how many go through Slurm with a third of their tasks killed.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from . import job as jobs
from .slurm import Slurm, killer, missing, slurm

TEMPLATE = jobs.REPOSITORY / "octo_motion" / "command_line" / "farm" / "openjd.yaml"
CHUNK = 20
"""Shots of a task, where there are many."""
FLAMENCO = TEMPLATE.with_name("flamenco.js")

# As much of Flamenco's job compiler as job types see: author, print, and a job with its tasks.
COMPILER = """
const fs = require("fs"), vm = require("vm");
let made = 0;
const author = {
    Task: (name, type) => {
        if (!name.trim() || !type.trim()) throw "a task needs a name and a type";
        const task = { id: ++made, name, type, commands: [], needs: [] };
        task.addCommand = (command) => { task.commands.push(command); };
        task.addDependency = (other) => { task.needs.push(other.id); };
        return task;
    },
    Command: (name, parameters) => ({ name, parameters }),
};
const job = { settings: JSON.parse(process.argv[2]), tasks: [] };
job.addTask = (task) => { job.tasks.push(task); };
const room = vm.createContext({ author, print: () => {} });
const text = fs.readFileSync(process.argv[1], "utf8");
vm.runInContext(text + "; this.known = JOB_TYPE; compileJob", room)(job);
console.log(JSON.stringify({ type: room.known, tasks: job.tasks }));
"""


def bake(job: Path, *words: str) -> float:
    """Run `bake`; how long it took, in seconds. What it has not made, the report tells."""
    began = time.monotonic()
    subprocess.run(
        [sys.executable, "-m", "octo_motion", "bake", str(job), *words, "--quiet"],
        cwd=jobs.REPOSITORY,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    return time.monotonic() - began


def gathering(job: Path) -> tuple[float, float]:
    """Gather a report in a Blender that runs: how long that takes, in s, and how much memory more
    than the Blender had before, in MB.
    """
    command = [sys.executable, "-c", _GATHERING, str(job)]
    said = subprocess.run(
        command, cwd=jobs.REPOSITORY, stdout=subprocess.PIPE, encoding="utf-8", check=True
    ).stdout
    seconds, memory = said.splitlines()[-1].split()
    return float(seconds), float(memory)


_GATHERING = """
import resource, sys, time
import octo_motion
from octo_motion.command_line import commands
octo_motion.register()
def most(): return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
before, began = most(), time.monotonic()
words = ["bake", sys.argv[1], "--gather", "--quiet"]
commands.main(words, "octo_motion", has_open_file=True)
print(f"{time.monotonic() - began:.2f} {most() - before:.1f}")
octo_motion.unregister()
"""


def open_job_description(folder: Path, openjd: str) -> list[str]:
    """Check, summarize and run the template over 7 shots in chunks of 3."""
    job = jobs.make_job(folder, 7)
    given = [f"-p{name}={value}" for name, value in {"Job": job, "Shots": 7, "Chunk": 3}.items()]
    given.append(f"-pBlender={jobs.blender(folder)}")
    for words in (["check", str(TEMPLATE)], ["summary", str(TEMPLATE), *given]):
        print(
            subprocess.run(
                [openjd, *words], encoding="utf-8", capture_output=True, check=True
            ).stdout
        )
    ended = subprocess.run(
        [openjd, "run", str(TEMPLATE), *given], encoding="utf-8", capture_output=True, check=False
    )
    lines = ended.stdout.splitlines()
    told = ("openjd_progress", "Places(", "Results", "Session ended", "Duration", "Chunks")
    print("\n".join(line for line in lines if any(each in line for each in told)))
    if ended.returncode:
        return [f"openjd run ended with {ended.returncode}", *lines[-20:]]
    return jobs.losses(job, 7)


def flamenco(folder: Path, node: str) -> list[str]:
    """Compile the job type as Flamenco does, and run the tasks that come of it in their order."""
    job, program = jobs.make_job(folder, 7), jobs.blender(folder)
    settings = {"job_file": str(job), "shots": 7, "chunk_size": 3}
    command = [node, "-e", COMPILER, str(FLAMENCO), json.dumps(settings)]
    compiled = json.loads(
        subprocess.run(command, encoding="utf-8", capture_output=True, check=True).stdout
    )
    waiting, done = list(compiled["tasks"]), set[int]()
    while waiting:
        task = next(each for each in waiting if set(each["needs"]) <= done)
        for command in task["commands"]:
            words = command["parameters"]
            program_of = words["exe"].replace("{blender}", str(program))
            subprocess.run([program_of, *words["args"]], check=True, capture_output=True)
        print(f"{task['name']} ({task['type']}), after {len(task['needs'])} others: done")
        waiting.remove(task)
        done.add(task["id"])
    return jobs.losses(job, 7)


def troubles(cluster: Slurm, folder: Path) -> list[str]:
    """20 shots: a node daemon killed, a task put back by hand, a task over its time."""
    job, program = jobs.make_job(folder, 20), jobs.blender(folder)
    (folder / "slow").touch()  # the first start sleeps: it will be over its time
    # Of two minutes a task has one and a half: enough for a shot where others work as well.
    number = cluster.submit(job, program, 20, 1, "--time=2")
    (starts := folder / "starts").touch()

    def trouble() -> Iterator[None]:
        while len(starts.read_text(encoding="utf-8").split()) < 5:
            yield
        cluster.kill_node()
        print("node daemon killed")
        for _ in range(4):
            yield
        cluster.start_node()
        # Not the first: it hangs, and its time has to end it.
        while not (chosen := [task for task in cluster.running() if not task.endswith("_1")]):
            yield
        cluster.run("scontrol", "requeue", chosen[-1])
        print(f"put back by hand: {chosen[-1]}")

    cluster.wait(trouble())
    bake(job, "--gather")
    began = len(starts.read_text(encoding="utf-8").split())
    print(f"array {number}: {began} starts for 20 shots")
    return jobs.losses(job, 20)


def at_scale(cluster: Slurm, folder: Path, shots: int) -> list[str]:
    """Many shots, a third of whose tasks are killed at random and put back."""
    job, program = jobs.make_job(folder, shots), jobs.blender(folder)
    alone = bake(jobs.make_job(folder / "alone", CHUNK), "--here")
    began = time.monotonic()
    cluster.submit(job, program, shots, CHUNK)
    (folder / "starts").touch()
    cluster.wait(killer(folder / "starts", 1 / 3, alone, seed=1))
    took = time.monotonic() - began
    killed = folder / "killed"
    count = len(killed.read_text(encoding="utf-8").split()) if killed.exists() else 0
    starts = len((folder / "starts").read_text(encoding="utf-8").split())
    whole = bake(job, "--gather")
    seconds, memory = gathering(job)
    most = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    wrong = jobs.losses(job, shots)
    print(
        f"{shots} shots in {took:.0f} s: {starts} starts of {-(-shots // CHUNK)} tasks, {count} "
        f"killed; {len(wrong)} wrong. Report gathered in {whole:.1f} s with Blender's start, in "
        f"{seconds:.1f} s and {memory:.1f} MB without; no process took more than {most:.0f} MB"
    )
    return wrong


def side_by_side(cluster: Slurm, folder: Path) -> list[str]:
    """The same 20 shots by two processes of `bake` and by two tasks of Slurm."""
    here, there = jobs.make_job(folder / "here", 20), jobs.make_job(folder / "there", 20)
    alone = bake(here, "--jobs", "2")
    began = time.monotonic()
    cluster.submit(there, jobs.blender(folder), 20, 10)
    cluster.wait()
    farm = time.monotonic() - began
    bake(there, "--gather")
    print(f"20 shots: {alone:.0f} s with bake --jobs 2, {farm:.0f} s with 2 tasks of Slurm")
    first, second = jobs.told(here), jobs.told(there)
    other = [name for name in first if first[name]["motion"] != second[name]["motion"]]
    return [f"{name}: other keys on the farm" for name in other] + jobs.losses(there, 20)


def main() -> int:
    options = argparse.ArgumentParser(prog="make test-farm", description=__doc__)
    options.add_argument("--shots", type=int, default=1000)
    options.add_argument("--openjd", default="", help="the program openjd")
    options.add_argument("--node", default="", help="the program node")
    options.add_argument("only", nargs="*", help="openjd, flamenco, slurm")
    given = options.parse_args()
    results: dict[str, str] = {}

    def show(name: str, engine: str, lacking: str, check: Callable[[], list[str]]) -> None:
        if given.only and engine not in given.only:
            return
        if lacking:
            results[name] = f"SKIPPED, {lacking}"
            return
        print(f"== {name}", flush=True)
        wrong = check()
        print("\n".join(wrong[:20]), flush=True)
        results[name] = f"FAILED, {len(wrong)} wrong" if wrong else "passed"

    with tempfile.TemporaryDirectory(prefix="octo-farm-", ignore_cleanup_errors=True) as scratch:
        root = Path(scratch)
        lacking = "" if given.openjd else "openjd-cli is not there"
        show(
            "Open Job Description",
            "openjd",
            lacking,
            lambda: open_job_description(root / "openjd", given.openjd),
        )
        lacking = "" if given.node else "there is no JavaScript"
        show("Flamenco", "flamenco", lacking, lambda: flamenco(root / "flamenco", given.node))
        lacking = missing() if os.name == "posix" else "it is for Linux"
        if lacking or (given.only and "slurm" not in given.only):
            show("Slurm", "slurm", lacking, list)
        else:
            with slurm(root / "cluster") as cluster:
                for name, check in (
                    ("Slurm, with troubles", lambda: troubles(cluster, root / "troubles")),
                    ("Slurm beside bake", lambda: side_by_side(cluster, root / "beside")),
                    (
                        "Slurm at scale",
                        lambda: at_scale(cluster, root / "scale", given.shots),
                    ),
                ):
                    show(name, "slurm", "", check)
    print("==")
    for name, result in results.items():
        print(f"{name}: {result}")
    return int(any(result.startswith("FAILED") for result in results.values()))


if __name__ == "__main__":
    sys.exit(main())
