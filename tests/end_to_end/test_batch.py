# SPDX-License-Identifier: GPL-3.0-or-later
"""The real commands, in Blenders of their own: many shots from a job, or one file."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable
from contextlib import ExitStack, chdir, suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

import bpy
import pytest

from octo_motion import command_line
from octo_motion.blender.animation import curves_of
from octo_motion.command_line import bake, commands, worker
from octo_motion.core.errors import WriteError
from tests.processes import has_console

REPOSITORY = Path(__file__).resolve().parent.parent.parent
WINDOWS = os.name == "nt"
PROGRAM = "python -m octo_motion"
RANGE = 'settings = { timing = "RANGE", frame_end = 6 }\n'
SMALL = "octopus = { arms = 4, joints = 3, with_mesh = false }\n"
ROUTE = "route = [[0, 0, 0], [0, -1, 0], [1, -1, 0], [2, -1, 0]]\n"


def run(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "octo_motion", *arguments],
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), "PYTHONUTF8": "1", **environment},
        cwd=REPOSITORY,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        encoding="utf-8",
        check=False,
        timeout=120,
    )


def run_here(*arguments: str | Path) -> int:
    """The command in this Blender, which spares the start of another; shots have their own."""
    return commands.main([str(each) for each in arguments], PROGRAM, has_open_file=True)


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def report(job: Path) -> dict[str, dict[str, Any]]:
    content = json.loads(job.with_suffix(".report.json").read_text(encoding="utf-8"))
    return {shot["name"]: shot for shot in content["shots"]}


def statuses(job: Path) -> dict[str, str]:
    return {name: shot["status"] for name, shot in report(job).items()}


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.fixture
def new_scene() -> Callable[[Path], Path]:
    """Makes a file with an octopus that has an action of its own, and a curve named Wall."""

    def make(path: Path) -> Path:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.ops.octo_motion.add_octopus(arms=4, joints=3, with_mesh=True)
        octopus: Any = bpy.context.object
        bpy.ops.octo_motion.add_route()
        octopus.octo_motion.locomotion.route.name = "Wall"
        octopus.octo_motion.locomotion.route = None
        octopus.keyframe_insert("location", frame=1)
        octopus.animation_data.action.name = "Mine"
        bpy.data.objects.new("Lamp", None)
        bpy.context.scene.collection.objects.link(bpy.data.objects["Lamp"])
        bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
        return path

    return make


@pytest.fixture
def scene(new_scene: Callable[[Path], Path], tmp_path: Path) -> Path:
    path = new_scene(tmp_path / "reef.blend")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return path


def digest(path: Path) -> str:
    return sha256(path.read_bytes()).hexdigest()


def keys(action: Any) -> list[tuple[str, int, tuple[float, ...]]]:
    (layer,) = action.layers
    (strip,) = layer.strips
    return [
        (curve.data_path, curve.array_index, tuple(key.co[1] for key in curve.keyframe_points))
        for bag in strip.channelbags
        for curve in bag.fcurves
    ]


def test_job_makes_its_good_shots_and_tells_of_the_bad_ones(scene: Path, tmp_path: Path) -> None:
    before = digest(scene)
    bpy.data.libraries.write(str(tmp_path / "bare.blend"), {bpy.context.scene})
    write(tmp_path / "torn.blend", "BLENDER-v300 and no more")
    job = write(
        tmp_path / "job.toml",
        f'[defaults]\noutput = "out/{{name}}.blend"\nfps = 29.97\n{RANGE}'
        '[[shots]]\nname = "wall"\nfile = "reef.blend"\nroute = "Wall"\ngait = "swim"\n'
        "settings = { frame_start = 3, table.stride = 1.5 }\n"
        f'[[shots]]\nname = "new"\n{SMALL}{ROUTE}export = "out/new.glb"\n'
        f'[[shots]]\nname = "backward"\n{SMALL}{ROUTE}settings = {{ frame_start = 9 }}\n'
        f'[[shots]]\nname = "bare"\nfile = "bare.blend"\n{ROUTE}'
        '[[shots]]\nname = "gone"\nfile = "gone.blend"\n'
        '[[shots]]\nname = "torn"\nfile = "torn.blend"\n'
        '[[shots]]\nname = "astray"\nfile = "reef.blend"\nroute = "Wal"\n',
    )

    ended = run("bake", job, "--jobs", "2")

    assert ended.returncode == 3, ended.stdout + ended.stderr
    told = report(job)
    assert {name: shot["error"] for name, shot in told.items()} == {
        "wall": "",
        "new": "",
        "backward": "The motion ends at frame 6 and starts at 9. Let it end after its start.",
        "bare": "The scene 'Scene' has no armature. Give a file that has one.",
        "gone": f"There is no file '{tmp_path / 'gone.blend'}'. Give the path of a .blend file.",
        "torn": f"'{tmp_path / 'torn.blend'}' is not a file that this Blender can read. "
        "Give a .blend file.",
        "astray": "There is no curve 'Wal'. Name one of Wall.",
    }
    for name, shot in told.items():
        assert shot["status"] == ("failed" if shot["error"] else "done")
        assert f"] {name}: {shot['status']}" in ended.stdout
    assert "2 done, 0 skipped, 5 failed. Report: " in ended.stdout
    wall = told["wall"]
    assert (wall["frames"], wall["frame_start"], wall["frame_end"]) == (4, 3, 6)
    assert wall["seconds"] > 0.0
    assert wall["outputs"] == {"out/wall.blend": digest(tmp_path / "out/wall.blend")}
    assert wall["inputs"] == {"reef.blend": before}
    # What was written is all that is there, and what was read is as it was.
    assert names(tmp_path / "out") == {"wall.blend", "new.blend", "new.glb"}
    assert digest(scene) == before

    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "out/wall.blend"))
    octopus: Any = bpy.data.objects["Octopus"]
    render = bpy.context.scene.render
    assert octopus.octo_motion.locomotion.route.name == "Wall"
    assert octopus.octo_motion.locomotion.table.stride == 1.5
    assert octopus.octo_motion.locomotion.gait == "swim"
    assert octopus.animation_data.action.name != "Mine"
    assert tuple(octopus.animation_data.action.frame_range) == (3, 6)
    assert [key[0] for key in keys(bpy.data.actions["Mine"])] == ["location"] * 3
    assert (render.fps, round(render.fps_base, 6)) == (30, 1.001)
    assert not (tmp_path / "out/wall.blend").read_bytes().startswith(b"BLENDER")  # as its source
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "out/new.blend"))
    assert sorted(each.type for each in bpy.data.objects) == ["ARMATURE", "CURVE"]
    assert (bpy.context.scene.frame_start, bpy.context.scene.frame_end) == (1, 6)
    bpy.ops.import_scene.gltf(filepath=str(tmp_path / "out/new.glb"))
    assert len(bpy.data.actions) == 2


def test_motion_worse_than_its_limits_fails_its_shot_and_the_report_has_the_figures(
    tmp_path: Path,
) -> None:
    shots = (
        f'[defaults]\noutput = "out/{{name}}.blend"\n{SMALL}{ROUTE}{RANGE}'
        "limits = { depth = 9, overlap = 99 }\n"
        '[[shots]]\nname = "good"\nsettings = { keys = "REDUCED" }\n'
        '[[shots]]\nname = "bad"\nlimits = { turn = 0.5 }\n'
    )
    job = write(tmp_path / "job.toml", shots)
    assert run_here("bake", job) == 3
    told = report(job)

    good, bad = told["good"], told["bad"]
    assert (good["status"], bad["status"]) == ("done", "failed")
    assert names(tmp_path / "out") == {"good.blend"}
    assert list(good["quality"]) == ["slip", "drift", "depth", "strain", "miss", "turn", "overlap"]
    assert good["quality"]["turn"]["value"] > 0.5
    assert 1 <= good["quality"]["turn"]["frame"] <= 6
    # Half of them, or more, are left out; 12 bones of 4 components and the travel at 6 frames.
    assert 0 < good["keys"] < good["dense_keys"]
    assert bad["keys"] == bad["dense_keys"] >= 6 * (12 * 4 + 6)
    # A shot that fails its limits tells how bad it is.
    worst = bad["quality"]["turn"]
    assert (bad["frames"], worst["arm"][:3]) == (6, "Arm")
    assert bad["error"] == (
        f"Turn is {worst['value']:.3g} at frame {worst['frame']} ({worst['arm']}), "
        "above its limit of 0.5."
    )

    # Again: what was good is kept, what was bad is made as soon as it is good enough.
    write(job, shots.replace("turn = 0.5", "turn = inf"))
    assert run_here("bake", job) == 0
    assert statuses(job) == {"good": "skipped", "bad": "done"}
    assert report(job)["good"]["quality"] == good["quality"]
    assert names(tmp_path / "out") == {"good.blend", "bad.blend"}


def test_shot_of_a_job_may_be_posed_by_a_script(tmp_path: Path) -> None:
    steps = '[{"do": "grab", "bone": "arm1.02.L", "at": 1.0}, {"do": "release"}, {"do": "key"}]'
    script = f'{{"format": "octo_motion.pose", "version": 1, "steps": {steps}}}'
    write(tmp_path / "wave.json", script)
    shot = f'[[shots]]\nname = "a"\nkind = "pose"\noutput = "a.blend"\n{SMALL}'
    job = write(tmp_path / "job.toml", f'{shot}script = "wave.json"\n')
    assert run_here("bake", job) == 0
    assert statuses(job) == {"a": "done"}
    # Another script: the shot is made anew.
    write(tmp_path / "wave.json", script.replace("1.0}", "0.5}"))
    assert run_here("bake", job, "--check") == 0
    assert run_here("bake", job) == 0
    assert statuses(job) == {"a": "done"}


def test_second_run_makes_only_what_is_new_or_changed(tmp_path: Path) -> None:
    text = f'[defaults]\noutput = "{{name}}.blend"\n{SMALL}{ROUTE}{RANGE}'
    shot = '[[shots]]\nname = "{}"\n'
    job = write(tmp_path / "job.toml", text + shot.format("a") + shot.format("b"))
    assert run_here("bake", job) == 0
    first = digest(tmp_path / "a.blend")

    changed = shot.format("b") + "settings = { seed = 1, variation_max = 0.1 }\n"
    write(job, text + shot.format("a") + changed)
    assert run_here("bake", job, "--check") == 0
    assert run_here("bake", job) == 0

    assert statuses(job) == {"a": "skipped", "b": "done"}
    assert report(job)["a"]["frames"] == 6
    assert digest(tmp_path / "a.blend") == first

    # Somebody has worked on a result: it stays until that is wanted otherwise.
    with (tmp_path / "b.blend").open("ab") as file:
        file.write(b"by hand")
    by_hand = digest(tmp_path / "b.blend")
    assert run_here("bake", job) == 0
    assert statuses(job) == {"a": "skipped", "b": "skipped"}
    write(job, text + shot.format("a") + shot.format("b"))
    assert run_here("bake", job) == 3
    assert "has been changed since it was baked" in report(job)["b"]["error"]
    assert digest(tmp_path / "b.blend") == by_hand
    assert run_here("bake", job, "--force", "--shot", "b") == 0
    assert run_here("bake", job, "--gather") == 0
    assert statuses(job) == {"a": "skipped", "b": "done"}
    assert digest(tmp_path / "b.blend") != by_hand


def test_rig_that_is_linked_is_moved_through_its_override_and_watched(tmp_path: Path) -> None:
    rig = bpy.data.collections.new("Rig")
    bpy.context.scene.collection.children.link(rig)
    layers = bpy.context.view_layer.layer_collection.children
    bpy.context.view_layer.active_layer_collection = layers["Rig"]
    bpy.ops.octo_motion.add_octopus(arms=4, joints=3, with_mesh=False)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "rig.blend"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    library: Any = bpy.data.libraries.load(str(tmp_path / "rig.blend"), link=True)
    with library as (_inside, taken):
        taken.collections = ["Rig"]
    linked = bpy.data.collections["Rig"]
    bpy.context.scene.collection.children.link(linked)
    linked.override_hierarchy_create(
        bpy.context.scene, bpy.context.view_layer, do_fully_editable=True
    )
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    shot = '[[shots]]\nname = "a"\nfile = "shot.blend"\noutput = "out/a.blend"\n'
    job = write(tmp_path / "job.toml", shot + ROUTE + RANGE)

    assert run_here("bake", job) == 0
    assert set(report(job)["a"]["inputs"]) == {"shot.blend", "rig.blend"}
    assert run_here("bake", job) == 0
    assert statuses(job) == {"a": "skipped"}

    with (tmp_path / "rig.blend").open("ab") as file:
        file.write(b"changed")
    assert run_here("bake", job) == 0
    assert statuses(job) == {"a": "done"}
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "out" / "a.blend"))
    # Paths relative to the file lead from the new folder.
    assert [each.filepath for each in bpy.data.libraries] == [f"//..{os.sep}rig.blend"]
    octopus: Any = bpy.data.objects["Octopus"]
    assert octopus.override_library
    assert tuple(octopus.animation_data.action.frame_range) == (1, 6)


def test_wrong_job_runs_nothing(tmp_path: Path) -> None:
    text = f'[[shots]]\nname = "a"\noutput = "a.blend"\n{SMALL}{ROUTE}'
    bad = text.replace('"a', '"b') + 'gait = "hop"\nsettings = { speeed = 1 }\n'
    ended = run("bake", write(tmp_path / "job.toml", text + bad))
    assert ended.returncode == 2
    assert "has 2 faults; nothing was run:\n  shot 'b': There is no gait 'hop'." in ended.stderr
    assert "shot 'b': There is no setting 'speeed'. Did you mean 'speed'? Valid: " in ended.stderr
    assert names(tmp_path) == {"job.toml"}


def test_unknown_shot_or_a_file_in_the_reports_place_runs_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = f'[[shots]]\nname = "a"\noutput = "a.blend"\n{SMALL}{ROUTE}'
    job = write(tmp_path / "job.toml", text)
    other = write(tmp_path / "notes.json", "{}")
    assert run_here("bake", job, "--shot", "c") == 2
    assert "There is no shot 'c'. Valid: a." in capsys.readouterr().err
    assert run_here("bake", job, "--report", other) == 2
    assert "is not a report" in capsys.readouterr().err
    assert run_here("bake", job, "--report", job / "below" / "report.json") == 2
    assert names(tmp_path) == {"job.toml", "notes.json"}
    assert other.read_text(encoding="utf-8") == "{}"


# Python runs this when it starts: the Blender of a shot comes to grief with its file half written.
GRIEF = """
import os, signal, sys, time
if "--run-shot" in sys.orig_argv:
    from octo_motion.command_line import shot_runner as stage
    save = stage._save
    def come_to_grief(place, *, compress):
        save(place, compress=compress)
        os.truncate(place, 1000)
        with open(str(place) + "@", "wb") as file:
            file.write(b"half")
        {grief}
    stage._save = come_to_grief
"""


def grieving(folder: Path, grief: str) -> dict[str, str]:
    """Environment for a run whose shots come to grief."""
    site = folder / "site"
    site.mkdir()
    write(site / "sitecustomize.py", GRIEF.format(grief=grief))
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(REPOSITORY), str(site)])}


def test_blender_that_is_killed_while_it_writes_leaves_nothing_behind(tmp_path: Path) -> None:
    environment = grieving(tmp_path, "from tests.processes import end; end(os.getpid())")
    job = write(
        tmp_path / "job.toml",
        f'[[shots]]\nname = "a"\noutput = "out/a.blend"\n{SMALL}{ROUTE}{RANGE}',
    )

    ended = run("bake", job, **environment)

    assert ended.returncode == 4, ended.stdout + ended.stderr
    # Windows tells a status alone, which whoever ends a process chooses.
    how = "ended early, with status 15" if WINDOWS else "crashed or was ended (SIGKILL)"
    assert report(job)["a"]["error"] == f"Blender {how}."
    assert names(tmp_path / "out") == set()
    assert run_here("bake", job) == 0
    assert statuses(job) == {"a": "done"}
    assert names(tmp_path / "out") == {"a.blend"}


def test_fault_of_ours_is_one_shots_and_leaves_its_traceback_in_the_report(tmp_path: Path) -> None:
    environment = grieving(tmp_path, "raise TypeError('odd')")
    shot = f'[[shots]]\nname = "a"\noutput = "out/a.blend"\n{SMALL}{ROUTE}{RANGE}'
    job = write(tmp_path / "job.toml", shot)
    assert run("bake", job, **environment).returncode == 1
    assert report(job)["a"]["error"] == "TypeError: odd"
    assert "Traceback (most recent call last)" in report(job)["a"]["log"]
    assert names(tmp_path / "out") == set()


@pytest.mark.parametrize("how", ["asked to stop", "killed"])
def test_run_that_is_stopped_leaves_no_process_and_no_unfinished_file(
    tmp_path: Path, how: str
) -> None:
    if how != "killed" and not has_console():
        pytest.skip("there is no console, whose Ctrl-Break this is")
    text = f'[defaults]\noutput = "out/{{name}}.blend"\n{SMALL}{ROUTE}{RANGE}'
    job = write(tmp_path / "job.toml", text + '[[shots]]\nname="a"\n[[shots]]\nname="b"\n')
    (tmp_path / "tmp").mkdir()
    with socket.create_server(("127.0.0.1", 0)) as server, ExitStack() as shots:
        server.settimeout(120.0)
        # The shots hold a line as long as they live; that it is there says that they are so far.
        line = f"socket.create_connection(('127.0.0.1', {server.getsockname()[1]}))"
        environment = grieving(tmp_path, f"import socket; line = {line}; time.sleep(600)")
        environment["TMPDIR"] = str(tmp_path / "tmp")
        process = subprocess.Popen(
            [sys.executable, "-m", "octo_motion", "bake", job, "--jobs", "2"],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        )
        lines = [shots.enter_context(server.accept()[0]) for _ in "ab"]
        assert len(names(tmp_path / "out")) == 4
        if how == "killed":
            process.kill()
        else:
            process.send_signal(getattr(signal, "CTRL_BREAK_EVENT", signal.SIGINT))
        status = process.wait()
        for each in lines:
            each.settimeout(60.0)
            with suppress(ConnectionResetError):  # as Windows tells that they have ended
                assert each.recv(1) == b""

    assert names(tmp_path / "out") == set()
    assert not list((tmp_path / "tmp").glob("octo-motion-*"))
    if how == "killed":
        assert status not in {0, 130}
    else:
        assert status == 130
        assert {shot["error"] for shot in report(job).values()} == {"Stopped before it was done."}


def test_shot_that_is_done_when_its_run_is_killed_leaves_nothing(tmp_path: Path) -> None:
    """Its files have not taken their places, and nobody else knows of them."""
    text = f'[[shots]]\nname = "a"\noutput = "a.blend"\n{SMALL}{ROUTE}{RANGE}'
    job, place = write(tmp_path / "job.toml", text), tmp_path / ".a.part.blend"
    (scratch := tmp_path / "scratch").mkdir()
    (table,) = tomllib.loads(text)["shots"]
    request = worker.Request(job, table, {tmp_path / "a.blend": place}, "")
    request.write(scratch / "request.json")
    answer = scratch / "answer.json"
    with subprocess.Popen(
        worker.child_command(scratch / "request.json", answer),
        env=worker.child_environment(scratch),
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
    ) as process:
        while not answer.exists():
            assert process.poll() is None
            time.sleep(0.05)
        assert "error" not in worker.read_answer(answer)
        assert place.exists()
        # Which is closed now, as by the end of whoever holds it.
    assert names(tmp_path) == {"job.toml"}


def test_report_that_cannot_be_written_any_more_stops_no_shot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_arguments: object) -> None:
        monkeypatch.setattr(bake, "write_report", fail)

    def fail(*_arguments: object) -> None:
        raise WriteError("The disk is full.", "Make room.")

    monkeypatch.setattr(bake, "write_report", full)  # the first report is written, no other
    shot = f'[[shots]]\nname = "a"\noutput = "out/a.blend"\n{SMALL}{ROUTE}{RANGE}'
    assert run_here("bake", write(tmp_path / "job.toml", shot)) == 1
    told = capsys.readouterr().out
    assert "1 done, 0 skipped, 0 failed. Report: The disk is full. Make room." in told
    assert names(tmp_path / "out") == {"a.blend"}


# --- One file ------------------------------------------------------------------------------------


def test_one_file_is_read_and_another_written(scene: Path, tmp_path: Path) -> None:
    before, output = digest(scene), tmp_path / "out" / "walk.blend"
    ended = run(
        *("generate", scene, "--output", output, "--route", "Wall", "--gait", "swim"),
        *("--set", "timing=range", "--set", "frame_end=5", "--set", "sway=12°", "--fps", "25"),
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert f"Written: {output}" in ended.stdout
    assert digest(scene) == before
    assert names(tmp_path / "out") == {"walk.blend"}
    bpy.ops.wm.open_mainfile(filepath=str(output))
    octopus: Any = bpy.data.objects["Octopus"]
    assert tuple(octopus.animation_data.action.frame_range) == (1, 5)
    assert octopus.octo_motion.locomotion.sway == pytest.approx(0.2094395)
    assert bpy.context.scene.render.fps == 25


def test_file_is_written_only_if_its_motion_keeps_to_the_limits(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "a.blend"
    given = ("generate", scene, "-o", output, "--route", "Wall", "--set", "timing=RANGE")
    assert run_here(*given, "--limit", "slide=1") == 2
    assert "There is no figure 'slide'. Did you mean 'slip'?" in capsys.readouterr().err
    assert run_here(*given, "--limit", "depth=9", "--limit", "turn=0.1") == 3
    told = capsys.readouterr().err
    assert "Error: Turn is " in told
    assert "above its limit of 0.1." in told
    assert names(tmp_path) == {"reef.blend"}
    assert run_here(*given, "--limit", "turn=180") == 0
    assert "\nQuality: slip " in capsys.readouterr().out
    assert names(tmp_path) == {"reef.blend", "a.blend"}


def test_file_is_overwritten_only_if_that_is_asked_for(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before, short = digest(scene), ("--route", "Wall", "--set", "timing=RANGE")
    assert run_here("generate", scene, "--output", scene, *short) == 2
    assert "is the file that is read. Give another path, or --overwrite." in capsys.readouterr().err
    assert run_here("generate", scene, *short) == 2
    assert "There is nothing to write." in capsys.readouterr().err
    other = write(tmp_path / "other.blend", "precious")
    assert run_here("generate", scene, "--output", other, *short) == 2
    assert "is there already." in capsys.readouterr().err
    assert digest(scene) == before
    assert run_here("generate", scene, "--overwrite", *short) == 0
    assert digest(scene) != before
    assert names(tmp_path) == {"reef.blend", "other.blend"}


def test_open_file_is_used_where_no_other_is_named(scene: Path, tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(scene))
    before = digest(scene)
    arguments = ["generate", "-o", str(tmp_path / "a.blend"), "--route", "Wall"]
    assert command_line._execute([*arguments, "--set", "timing=RANGE"]) == 0
    assert bpy.data.filepath == str(scene)
    assert digest(scene) == before
    job = write(
        tmp_path / "job.toml",
        f'[[shots]]\nname = "b"\nfile = "reef.blend"\noutput = "b.blend"\n{ROUTE}{RANGE}',
    )
    assert command_line._execute(["bake", str(job)]) == 0


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("none.blend",), (3, "There is no file '{folder}none.blend'.")),
        (("torn.blend",), (3, "'{folder}torn.blend' cannot be opened: ")),
        (("reef.blend",), (3, "'Octopus' has no route.")),
        (
            ("reef.blend", "--armature", "Squid"),
            (3, "There is no object 'Squid'. Name the armature"),
        ),
        (("reef.blend", "--armature", "Lamp"), (3, "'Lamp' is not an armature.")),
        (("reef.blend", "--route", "Wal"), (3, "There is no curve 'Wal'. Name one of Wall.")),
        (("reef.blend", "--route", "Lamp"), (3, "'Lamp' is not a curve.")),
        (("reef.blend", "--gait", "hop"), (2, "There is no gait 'hop'.")),
        (("reef.blend", "--gait", "hop.json"), (2, "'hop.json' cannot be read: No such file")),
        (("reef.blend", "--set", "speeed=1"), (2, "There is no setting 'speeed'. Did you mean")),
        (("reef.blend", "--set", "speed"), (2, "'speed' sets nothing. Write --set name=value.")),
        (("reef.blend", "--set", "burst=2"), (2, "burst must be a number from 0 to 1, not '2'.")),
        (("reef.blend", "--export", "a.obj"), (2, "'a.obj' is no format to export to.")),
        (
            ("reef.blend", "--export", "a.glb", "--export", "a.glb"),
            (2, "Two outputs have the same"),
        ),
        (
            ("reef.blend", "--output", "a.fbx"),
            (2, "'a.fbx' is no format to save to. Valid: .blend."),
        ),
        ((), (2, "No file is open. Give the .blend file to read.")),
    ],
)
def test_complaint_of_generate(
    new_scene: Callable[[Path], Path],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    complaint: tuple[int, str],
) -> None:
    if "reef.blend" in arguments:
        new_scene(tmp_path / "reef.blend")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    write(tmp_path / "torn.blend", "BLENDER-v300 and no more")
    before = names(tmp_path)
    output = () if "--output" in arguments else ("--output", "out.blend")
    status, sentence = complaint
    with chdir(tmp_path):
        assert run_here("generate", *arguments, *output) == status
    assert sentence.format(folder=f"{tmp_path}{os.sep}") in capfd.readouterr().err
    assert names(tmp_path) == before


def test_of_several_armatures_the_one_with_arms_is_meant(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(scene))
    bpy.ops.object.armature_add()  # one bone, and active
    bpy.ops.wm.save_as_mainfile(filepath=str(scene))
    short = ("--route", "Wall", "--set", "timing=RANGE")
    assert run_here("generate", scene, "-o", tmp_path / "a.blend", *short) == 0
    assert "Octopus: " in capsys.readouterr().out

    bpy.ops.octo_motion.add_octopus(arms=4, joints=3, with_mesh=False)
    bpy.ops.wm.save_as_mainfile(filepath=str(scene))
    assert run_here("generate", scene, "-o", tmp_path / "b.blend", *short) == 0
    assert "Octopus.001: " in capsys.readouterr().out  # the active one

    bpy.context.view_layer.objects.active = bpy.data.objects["Wall"]
    bpy.ops.wm.save_as_mainfile(filepath=str(scene))
    assert run_here("generate", scene, "-o", tmp_path / "c.blend", *short) == 3
    assert (
        "2 armatures could be meant. Name the armature: Octopus, Octopus.001."
        in capsys.readouterr().err
    )


# Blender 5.2's exporter does what a later numpy will refuse.
@pytest.mark.filterwarnings("ignore:Setting the shape on a NumPy array:DeprecationWarning")
@pytest.mark.parametrize("suffix", [".glb", ".fbx", ".abc", ".usd"])
def test_export_has_the_creature_and_its_motion_alone(
    scene: Path, tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"walk{suffix}"
    arguments = ("--route", "Wall", "--set", "timing=RANGE", "--set", "frame_end=9")
    assert run_here("generate", scene, "--export", path, *arguments) == 0
    assert names(tmp_path) == {"reef.blend", path.name}

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene_now = bpy.context.scene
    scene_now.render.fps = 24
    if suffix == ".glb":
        bpy.ops.import_scene.gltf(filepath=str(path))
    elif suffix == ".fbx":
        bpy.ops.import_scene.fbx(filepath=str(path))
    elif suffix == ".usd":
        bpy.ops.wm.usd_import(filepath=str(path))
    else:
        bpy.ops.wm.alembic_import(filepath=str(path), as_background_job=False)
    types = [each.type for each in bpy.data.objects if not each.name.startswith("Icosphere")]
    assert types.count("MESH") == 1
    assert {"CURVE", "LIGHT", "CAMERA"}.isdisjoint(types)
    if suffix != ".abc":
        assert types.count("ARMATURE") == 1
        lasting = [each.frame_range[1] - each.frame_range[0] for each in bpy.data.actions]
        assert max(lasting) == pytest.approx(8)
    else:
        assert scene_now.frame_end - scene_now.frame_start == 8
    mesh: Any
    (mesh,) = [
        each
        for each in bpy.data.objects
        if each.type == "MESH" and not each.name.startswith("Icosphere")
    ]
    places = []
    for frame in (scene_now.frame_start, scene_now.frame_start + 8):
        scene_now.frame_set(frame)
        seen = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
        places.append(seen.matrix_world @ seen.data.vertices[0].co)
    assert (places[1] - places[0]).length > 0.1


# Blender 5.2's exporter does what a later numpy will refuse.
@pytest.mark.filterwarnings("ignore:Setting the shape on a NumPy array:DeprecationWarning")
def test_what_a_format_does_not_carry_is_told_and_stretch_as_location_has_nothing_of_it(
    tmp_path: Path,
) -> None:
    bent = "octopus = { arms = 4, joints = 6, with_mesh = false }\n"
    way = "route = [[0, 0, 0], [0, -0.3, 0], [0.1, -0.5, 0], [0.3, -0.6, 0]]\n"
    job = write(
        tmp_path / "job.toml",
        f'[[shots]]\nname = "scaled"\nexport = "a.glb"\n{bent}{way}'
        f'[[shots]]\nname = "moved"\nexport = "b.glb"\noutput = "b.blend"\n{bent}{way}'
        'settings = { ground.stretch_as = "location" }\n',
    )
    assert run_here("bake", job) == 0
    (told,) = report(job)["scaled"]["warnings"]
    assert told.startswith(".glb hands the scale of bones on otherwise than Blender: ")
    assert "Set ground.stretch_as to location" in told
    assert report(job)["moved"]["warnings"] == []
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "b.blend"))
    armature: Any = bpy.data.objects["Octopus"]
    assert not any(bone.use_connect for bone in armature.data.bones if "arm" in bone.name)
    assert any(
        curve.data_path.startswith('pose.bones["arm1.02.L"].location')
        for curve in curves_of(armature.animation_data.action)
    )


def test_file_saved_in_edit_mode_is_as_good(scene: Path, tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(scene))
    bpy.context.view_layer.objects.active = bpy.data.objects["Octopus Skin"]
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.wm.save_as_mainfile(filepath=str(scene))
    arguments = ("--route", "Wall", "--set", "timing=RANGE", "--set", "frame_end=3")
    assert run_here("generate", scene, "--export", tmp_path / "a.glb", *arguments) == 0


def test_alembic_without_a_mesh_is_refused(tmp_path: Path) -> None:
    job = write(
        tmp_path / "job.toml", f'[[shots]]\nname = "a"\nexport = "a.abc"\n{SMALL}{ROUTE}{RANGE}'
    )
    assert run_here("bake", job) == 3
    assert report(job)["a"]["error"] == (
        "'Octopus' has no mesh, and Alembic keeps no bones. Export to .glb or .fbx."
    )
    assert names(tmp_path) == {"job.toml", "job.report.json", "job.records"}
