# SPDX-License-Identifier: GPL-3.0-or-later
"""Job files: what they mean, and that everything wrong with one is told before anything runs."""

import json
import math
import shutil
from pathlib import Path

import pytest

from octo_motion.command_line.job import JobError, JobFile, read_job
from octo_motion.command_line.job_report import fingerprint, version
from octo_motion.command_line.schema import (
    Choice,
    Kind,
    Known,
    Number,
    Reading,
    Table,
    Text,
    flag,
    parse_assignments,
)
from octo_motion.command_line.shot_schema import NewRoute, ShotRequest, frame_rate
from octo_motion.command_line.vocabulary import known, make_request, resolver, with_gait
from octo_motion.core.errors import GaitError, SettingsError
from octo_motion.core.locomotion.gait import table as gait
from octo_motion.core.locomotion.octopus.shape import OctopusShape

REPOSITORY = Path(__file__).resolve().parent.parent.parent


def read(folder: Path, text: str) -> JobFile:
    path = folder / "job.toml"
    path.write_text(text, encoding="utf-8")
    return read_job(path, known(), folder / "job.report.json")


def faults(folder: Path, text: str) -> tuple[str, ...]:
    with pytest.raises(JobError) as caught:
        read(folder, text)
    return caught.value.faults


def in_another_process(job: JobFile, shot: ShotRequest) -> ShotRequest:
    """The shot as a process reads it that is to make it."""
    table = json.loads(json.dumps(job.asked[shot.name]))
    return make_request(table, resolver(job.path, shot.name))


WALK = '[[shots]]\nname = "walk"\nfile = "reef.blend"\noutput = "out/walk.blend"\n'
NEW = '[[shots]]\nname = "new"\noutput = "new.blend"\n'
ROUTE = "route = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]\n"


def test_shot_has_what_its_table_says_with_paths_beside_the_job(tmp_path: Path) -> None:
    text = WALK + (
        'armature = "Octopus"\nroute = "Wall"\ngait = "swim"\nfps = 25\n'
        'settings = { seed = 3, table.stride = 2, sway = "30°" }\nexport = "out/walk.glb"\n'
    )
    (shot,) = read(tmp_path, text).shots
    assert (shot.name, shot.armature, shot.route, shot.fps) == ("walk", "Octopus", "Wall", 25.0)
    assert shot.file == tmp_path / "reef.blend"
    assert shot.outputs == (tmp_path / "out/walk.blend", tmp_path / "out/walk.glb")
    assert gait.gait_from_json(str(shot.gait)).name == "swim"
    assert shot.settings == {
        "seed": 3,
        "table.stride": 2.0,
        "sway": pytest.approx(math.radians(30)),
    }


def test_defaults_are_shared_and_each_shot_may_say_otherwise(tmp_path: Path) -> None:
    job = read(
        tmp_path,
        '[defaults]\nfile = "reef.blend"\nfps = 24\noutput = "{name}.blend"\n'
        "settings = { seed = 1, burst = 0.5 }\n"
        '[[shots]]\nname = "a"\nsettings = { seed = 2 }\n'
        '[[shots]]\nname = "b"\nfps = 30\noctopus = { arms = 6 }\n' + ROUTE,
    )
    a, b = (shot for shot in job.shots)
    assert (a.settings, b.settings) == ({"seed": 2, "burst": 0.5}, {"seed": 1, "burst": 0.5})
    assert (a.fps, b.fps) == (24.0, 30.0)
    assert (a.output, b.output) == (tmp_path / "a.blend", tmp_path / "b.blend")
    assert (a.file, b.file) == (tmp_path / "reef.blend", None)
    assert b.octopus
    assert b.octopus.shape == OctopusShape(arms=6)


def test_route_is_four_control_points_or_leads_through_points(tmp_path: Path) -> None:
    points = "[[0, 0, 0], [1, 0, 0], [1, 1, 0.5]]"
    job = read(
        tmp_path,
        "[defaults]\noctopus = {}\noutput = '{name}.blend'\n"
        '[[shots]]\nname = "a"\n' + ROUTE + '[[shots]]\nname = "b"\n'
        "route = { control_points = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]] }\n"
        f'[[shots]]\nname = "c"\nroute = {{ points = {points}, cyclic = true }}\n',
    )
    a, b, c = (shot.route for shot in job.shots)
    assert a == b == NewRoute(((0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)), is_bezier=True)
    assert c == NewRoute(((0, 0, 0), (1, 0, 0), (1, 1, 0.5)), is_bezier=False, cyclic=True)


def test_limits_are_added_to_those_of_the_defaults_and_inf_lifts_one(tmp_path: Path) -> None:
    job = read(
        tmp_path,
        '[defaults]\nfile = "reef.blend"\noutput = "{name}.blend"\n'
        "limits = { slip = 0.01, turn = 45 }\n"
        '[[shots]]\nname = "a"\n'
        '[[shots]]\nname = "b"\nlimits = { slip = inf, overlap = 0.1 }\n'
        '[[shots]]\nname = "c"\nkind = "splice"\n',
    )
    a, b, c = (shot.limits for shot in job.shots)
    assert a == {"slip": 0.01, "turn": 45.0}
    assert b == {"turn": 45.0, "overlap": 0.1}
    assert c == {}


def test_ground_and_lists_are_what_the_table_says(tmp_path: Path) -> None:
    text = WALK + (
        'ground = "Sea Floor"\n'
        'settings = { change.height = 0.7, change.gait = "jet_escape", ground.duty = 0.6 }\n'
        'changes = [{ gait = "swim", position = 0.5 }]\n'
        'along = [{ setting = "lift", position = 0.5, lift = 0.2 }]\n'
        'reaches = [{ mode = "curl", arm = "Arm 1 L", turns = 1.5, frame_contact = 20 }]\n'
        '[[shots.contacts]]\narm = "Arm 2 R"\ncycle = 3\nposition = [1, 0.5, 0]\n'
        'heading = "90°"\n'
    )
    job = read(tmp_path, text)
    (shot,) = job.shots
    assert shot.ground == "Sea Floor"
    assert shot.settings["change.gait"] == "jet_escape"
    assert shot.changes == [{"gait": "swim", "position": 0.5}]
    assert shot.along == [{"setting": "LIFT", "position": 0.5, "lift": 0.2}]
    assert shot.reaches == [{"mode": "CURL", "arm": "Arm 1 L", "turns": 1.5, "frame_contact": 20}]
    assert shot.contacts == [
        {
            "arm": "Arm 2 R",
            "cycle": 3,
            "position": [1.0, 0.5, 0.0],
            "heading": pytest.approx(math.pi / 2.0),
        }
    ]
    assert in_another_process(job, shot) == shot


def test_every_fault_of_a_list_is_told_with_its_place(tmp_path: Path) -> None:
    text = WALK + (
        'changes = [{ gait = "hop", position = 2 }, { position = 0.5 }]\n'
        'reaches = [{ mode = "juggle" }, { traget = "Ball" }]\n'
        'contacts = [{ arm = "Arm 1 L", position = [1, 2] }]\n'
    )
    told = "\n".join(faults(tmp_path, text))
    assert "changes 1: position must be a number from 0 to 1, not 2." in told
    assert "changes 1: There is no gait 'hop'." in told
    assert "changes 2: It has no gait: write gait = …." in told
    assert "reaches 1: mode must be one of " in told
    assert "reaches 2: There is no setting 'traget'. Did you mean 'target'?" in told
    assert "contacts 1: It has no cycle" in told
    assert "position must be three numbers, [x, y, z], not [1, 2]." in told
    assert faults(tmp_path, WALK + "reaches = 3\n")[0].startswith(
        "shot 'walk': reaches must be a list of tables"
    )
    splice = '[[shots]]\nname = "s"\nkind = "splice"\nfile = "a.bvh"\noutput = "s.blend"\n'
    (told,) = [each for each in faults(tmp_path, splice + 'ground = "Sea"\n') if "ground" in each]
    assert told == "shot 's': ground is for shots with kind = \"generate\"."
    (told,) = faults(tmp_path, NEW + "octopus = {}\n" + ROUTE + 'ground = "Sea"\n')
    assert "A new octopus has no ground 'Sea'" in told


def test_gait_file_is_read_beside_the_job(tmp_path: Path) -> None:
    table = gait.renamed_gait(gait.gait_presets()["swim"], "sneak")
    (tmp_path / "sneak.json").write_text(gait.gait_to_json(table), encoding="utf-8")
    (shot,) = read(tmp_path, WALK + 'gait = "sneak.json"\n').shots
    assert gait.gait_from_json(str(with_gait(shot).gait)).name == "sneak"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "No such file"),
        (b"\xff\xfe\xff", "it is not text"),
        (b"{", "is not JSON"),
        (b"{}", "is not a gait"),
    ],
)
def test_gait_file_that_is_none_is_told_by_its_path(
    tmp_path: Path, content: bytes | None, reason: str
) -> None:
    if content is not None:
        (tmp_path / "sneak.json").write_bytes(content)
    (shot,) = read(tmp_path, WALK + 'gait = "sneak.json"\n').shots
    with pytest.raises(GaitError, match=r"sneak\.json") as caught:
        with_gait(shot)
    assert reason in str(caught.value)


def test_all_faults_are_told_at_once_with_their_shots(tmp_path: Path) -> None:
    told = faults(
        tmp_path,
        '[[shots]]\nname = "a"\nfile = "x.blend"\noutput = "a.blend"\nsettings = { speeed = 1 }\n'
        '[[shots]]\nname = "b"\noctopus = { arms = 0 }\noutput = "b.blend"\ngait = "hop"\n',
    )
    assert len(told) == 4
    assert told[0].startswith(
        "shot 'a': There is no setting 'speeed'. Did you mean 'speed'? Valid:"
    )
    assert "cycle_time" in told[0]
    assert told[1:] == (
        "shot 'b': octopus: Arms is 0. Choose a value from 1 to 64.",
        "shot 'b': There is no gait 'hop'. Choose one of " + ", ".join(gait.gait_presets()) + ".",
        "shot 'b': A new octopus has no route: give the route's points.",
    )


def test_a_shot_on_the_spot_needs_no_route(tmp_path: Path) -> None:
    (shot,) = read(
        tmp_path,
        '[[shots]]\nname = "loop"\noctopus = {}\noutput = "loop.blend"\n'
        'settings = { travel_on = "none", cycles = 2 }\n',
    ).shots
    assert shot.route == ""
    assert shot.settings == {"travel_on": "NONE", "cycles": 2}


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", "There are no shots"),
        ("shots = 3\n", "Write each shot as a table of its own, [[shots]]."),
        ("shot = []\n" + WALK, "There is no table 'shot'. Did you mean 'shots'?"),
        ("defaults = 3\n" + WALK, "defaults: It must be a table"),
        ('[defaults]\nname = "x"\n' + WALK, "defaults: A name belongs to one shot."),
        ("[[shots]]\n", "shot number 1: It has no name"),
        (WALK + WALK.replace("out", "other"), "shot 'walk': 2 shots have this name."),
        (WALK + "colour = 3\n", "There is no key 'colour'. Valid: name, kind, file, octopus"),
        ('[[shots]]\nname = "walk"\noutput = "w.blend"\n', "It has no creature: give file"),
        (WALK + "octopus = {}\n" + ROUTE, "It has a file and a new octopus"),
        ('[[shots]]\nname = "walk"\nfile = "x.blend"\n', "It writes nothing"),
        (
            WALK.replace("out/walk.blend", "out/walk.abc"),
            "'walk.abc' is no format to save to. Valid: .blend.",
        ),
        (WALK.replace('"reef.blend"', "3"), "file must be a text, not 3."),
        (WALK.replace("reef.blend", ""), "file must be a text, not ''."),
        (WALK.replace("out/walk.blend", "reef.blend"), "is an input of shot 'walk'"),
        (WALK.replace("out/walk.blend", "./out/../reef.blend"), "is an input of shot 'walk'"),
        (
            WALK + 'export = "job.toml"\n',
            "is no format to export to. Valid: .glb, .fbx, .abc, .usd, .usdc, .usda.",
        ),
        (WALK + 'export = "a.gltf"\n', "export to .glb, the same in one."),
        (WALK + "export = 3\n", "export must be a path or a list of paths, not 3."),
        (WALK + 'export = ["a.glb", "a.glb"]\n', "is an output of shot 'walk' too"),
        (WALK + 'gait = "sub/hop"\n', "There is no gait 'sub/hop'."),
        (WALK + "fps = 0\n", "fps must be a number from 1 to 32767, not 0."),
        (WALK + "fps = true\n", "fps must be a number"),
        (WALK + "settings = 3\n", "settings must be a table, not 3."),
        (WALK + "settings = { burst = 1.5 }\n", "burst must be a number from 0 to 1, not 1.5."),
        (WALK + 'settings = { gait = "swim" }\n', "There is no setting 'gait'."),
        (WALK + "settings = { route = 1 }\n", "There is no setting 'route'."),
        (WALK + "settings = { table.strid = 1 }\n", "Did you mean 'table.stride'?"),
        (WALK + "route = 3\n", "route must be a text, not 3."),
        (
            WALK + "route = [[0, 0], [1, 1]]\n",
            "a list of points, each of three numbers, [x, y, z].",
        ),
        (WALK + "route = [[0, 0, nan], [1, 1, 1]]\n", "a list of points"),
        (WALK + "route = [[0, 0, 0], [1, 1, 1]]\n", "control points are four, not 2."),
        (WALK + "route = [[0,0,0],[0,0,0],[0,0,0],[0,0,0]]\n", "are all the same"),
        (WALK + "route = { points = [[0, 0, 0]] }\n", "at least two that lie apart"),
        (
            WALK + "route = { points = [[0, 0, 0], [1, 0, 0]], cyclic = true }\n",
            "at least three that lie apart",
        ),
        (WALK + "route = { cyclic = true }\n", "give either control_points (four) or points"),
        (WALK + "route = { points = [], close = 1 }\n", "There is no key 'close'. Valid:"),
        (WALK + "route = { points = [[0,0,0],[1,0,0]], cyclic = 1 }\n", "cyclic must be true or"),
        (
            WALK
            + ROUTE.replace("[[", "{ cyclic = true, control_points = [[").replace("]]", "]] }"),
            "four control points make no cyclic route",
        ),
        (NEW + 'octopus = {}\nroute = "Wall"\n', "A new octopus has no curve 'Wall'"),
        (NEW + "octopus = 8\n" + ROUTE, "octopus must be a table, such as { arms = 8 }, not 8."),
        (NEW + "octopus = { legs = 8 }\n" + ROUTE, "There is no parameter 'legs'. Valid: arms"),
        (NEW + "octopus = { arms = 8.5 }\n" + ROUTE, "arms must be a whole number, not 8.5."),
        (NEW + 'octopus = { taper = "x" }\n' + ROUTE, "taper must be a number, not 'x'."),
        (NEW + "octopus = { with_mesh = 1 }\n" + ROUTE, "with_mesh must be true or false, not 1."),
        (WALK + "limits = 3\n", "limits must be a table, such as { slip = 0.01 }, not 3."),
        (
            WALK + "limits = { slide = 0.01 }\n",
            "limits: There is no figure 'slide'. Did you mean 'slip'? Valid: slip, drift, depth,",
        ),
        (
            WALK + "limits = { slip = -0.01 }\n",
            "limits: slip must be a number of 0 or more, not -0.01.",
        ),
        (WALK + "limits = { turn = nan }\n", "turn must be a number of 0 or more, not nan."),
        (WALK + "limits = { turn = true }\n", "turn must be a number of 0 or more, not True."),
        (WALK + 'limits = { turn = "45°" }\n', "turn must be a number of 0 or more, not '45°'."),
        (
            WALK + 'kind = "splice"\nlimits = { turn = 45 }\n',
            'limits is for shots with kind = "generate".',
        ),
        ("[[shots]\n", "It is not TOML"),
    ],
)
def test_fault_is_told(tmp_path: Path, text: str, fault: str) -> None:
    told = faults(tmp_path, text)
    assert any(fault in each for each in told), told


def test_job_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    known_names = Known({}, gait.gait_presets().__getitem__)
    with pytest.raises(JobError, match="It cannot be read: No such file"):
        read_job(tmp_path / "none.toml", known_names, tmp_path / "report.json")
    (tmp_path / "odd.toml").write_bytes(b"\xff")
    with pytest.raises(JobError, match="not a text in UTF-8"):
        read_job(tmp_path / "odd.toml", known_names, tmp_path / "report.json")


def test_output_must_not_be_the_report(tmp_path: Path) -> None:
    (tmp_path / "job.toml").write_text(WALK, encoding="utf-8")
    with pytest.raises(JobError, match="is the report: give another"):
        read_job(tmp_path / "job.toml", known(), tmp_path / "out" / "walk.blend")


def test_entry_survives_its_way_to_another_process(tmp_path: Path) -> None:
    job = read(
        tmp_path,
        WALK + 'gait = "walk"\nfps = 29.97\nsettings = { heading = "fixed" }\nexport = "a.fbx"\n'
        "limits = { slip = 0.01, turn = 45 }\n"
        "[[shots]]\nname = 'b'\noctopus = { taper = 0.2, with_mesh = false }\n"
        "output = 'b.blend'\n" + ROUTE,
    )
    for shot in job.shots:
        assert in_another_process(job, shot) == shot


def test_example_of_the_documentation_is_in_order(tmp_path: Path) -> None:
    path = shutil.copy(REPOSITORY / "docs/examples/shots.toml", tmp_path)
    job = read_job(Path(path), known(), tmp_path / "report.json")
    assert [shot.name for shot in job.shots] == ["walk", "sideways", "swim", "loop"]
    assert job.shots[2].octopus
    assert job.shots[2].octopus.shape == OctopusShape(arm_length=0.4)


@pytest.mark.parametrize(
    ("fps", "kept"),
    [
        (25.0, (25, 1.0)),
        (23.976, (24, 1.001)),
        (29.97, (30, 1.001)),
        (59.94, (60, 1.001)),
        (12.5, (13, 1.04)),
    ],
)
def test_frame_rate_is_kept_as_blender_and_broadcasters_have_it(
    fps: float, kept: tuple[int, float]
) -> None:
    assert frame_rate(fps) == (kept[0], pytest.approx(kept[1], abs=1e-12))


# --- Values of settings ----------------------------------------------------------------------


def values(kind: Kind, given: object) -> tuple[dict[str, object], list[str]]:
    """What a table of one key is read to, and what is said to be wrong."""
    reading = Reading(Known({}, gait.gait_presets().__getitem__), Path)
    return Table({"a": kind})({"a": given}, reading), reading.faults


@pytest.mark.parametrize(
    ("kind", "given", "value"),
    [
        (Number(), "0.5", 0.5),
        (Number(), 2, 2.0),
        (Number(is_angle=True), "90 deg", math.pi / 2),
        (Number(is_angle=True), "-90°", -math.pi / 2),
        (Number(is_angle=True), "0.5", 0.5),
        (Number(whole=True), "3", 3),
        (Number(whole=True), 3.0, 3),
        (flag, "Yes", True),
        (flag, "off", False),
        (flag, True, True),
        (Choice(("ALONG", "FIXED")), "fixed", "FIXED"),
        (Text(), "0", "0"),
        (Text(may_be_empty=True), "", ""),
    ],
)
def test_value_is_read_as_meant(kind: Kind, given: object, value: object) -> None:
    read_values, told = values(kind, given)
    assert told == []
    assert read_values == {"a": pytest.approx(value) if isinstance(value, float) else value}
    assert type(read_values["a"]) is type(value)


@pytest.mark.parametrize(
    ("kind", "given", "wanted"),
    [
        (Number(), "fast", "a number, not 'fast'."),
        (Number(), "30°", "a number, not '30°'."),
        (Number(), math.nan, "a number, not nan."),
        (Number(), "inf", "a number, not 'inf'."),
        (Number(), True, "a number, not True."),
        (Number(is_angle=True), "x°", "or degrees such as '30°', not 'x°'."),
        (Number(minimum=0), -1, "a number of 0 or more, not -1."),
        (Number(maximum=1), 2, "a number of 1 or less, not 2."),
        (Number(0, 2, is_angle=True), "180°", "a number from 0 to 2 in radians, or degrees"),
        (Number(whole=True), 2.5, "a whole number, not 2.5."),
        (flag, "maybe", "true or false, not 'maybe'."),
        (flag, 1, "true or false, not 1."),
        (Choice(("X", "Y")), "Z", "one of X, Y, not 'Z'."),
        (Choice(("X", "Y")), 1, "one of X, Y, not 1."),
        (Text(), 1, "a text, not 1."),
        (Text(), " ", "a text, not ' '."),
    ],
)
def test_value_that_makes_no_sense_is_refused(kind: Kind, given: object, wanted: str) -> None:
    read_values, (told,) = values(kind, given)
    assert read_values == {}
    assert told.startswith("a must be ")
    assert wanted in told


def test_every_setting_can_be_given_its_own_default() -> None:
    settings = known().tables["generate"]
    assert {"speed", "timing", "heading_angle", "table.stride", "root_bone"} <= set(settings)
    angle, timing = settings["heading_angle"], settings["timing"]
    assert isinstance(angle, Number)
    assert angle.is_angle
    assert not {"name", "gait", "route", "result", "arms", "table.name"} & set(settings)
    assert timing == Choice(("CADENCE", "SPEED", "RANGE"))


def test_assignments_of_the_command_line() -> None:
    assert parse_assignments(["speed=2", " a.b = c=d ", "speed=3"]) == {"speed": "3", "a.b": "c=d"}
    for text in ("speed", "=3"):
        with pytest.raises(SettingsError, match="Write --set name=value"):
            parse_assignments([text])


def test_settings_of_groups_are_named_with_their_group() -> None:
    table = Table({"table.stride": Number()})
    for given in ({"table": {"stride": 2}}, {"table.stride": "2"}):
        reading = Reading(Known({}, gait.gait_presets().__getitem__), Path)
        assert table(given, reading) == {"table.stride": 2.0}
        assert reading.faults == []


# --- Fingerprints ----------------------------------------------------------------------------


def test_fingerprint_changes_with_the_entry_and_the_gait_alone() -> None:
    asked = {"name": "a", "settings": {"seed": 1, "burst": 0.5}}
    same = {"settings": {"burst": 0.5, "seed": 1}, "name": "a"}
    assert fingerprint(asked, "{}") == fingerprint(same, "{}")
    assert fingerprint(asked, "{}") != fingerprint(asked, "")
    assert fingerprint(asked, "{}") != fingerprint({**asked, "settings": {"seed": 2}}, "{}")


def test_version_is_the_manifests() -> None:
    assert f'version = "{version()}"' in (REPOSITORY / "blender_manifest.toml").read_text(
        encoding="utf-8"
    )
