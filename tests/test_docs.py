# SPDX-License-Identifier: GPL-3.0-or-later
"""The documentation is right: examples run, tables agree with Blender, links lead somewhere."""

from __future__ import annotations

import ast
import importlib
import math
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.one_blender

REPOSITORY = Path(__file__).resolve().parent.parent
PAGES = [
    *(
        REPOSITORY / name
        for name in ("README.md", "README.ja.md", "CONTRIBUTING.md", "CHANGELOG.md")
    ),
    *sorted((REPOSITORY / "docs").glob("*.md")),
]
SCRIPTING = REPOSITORY / "docs" / "scripting.md"
BATCH = REPOSITORY / "docs" / "batch.md"

UNITS = {
    "ROTATION": "radians",
    "LENGTH": "metres",
    "TIME_ABSOLUTE": "seconds",
    "VELOCITY": "m/s",
}
"""What the tables call Blender's units."""


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def name_of(page: Path) -> str:
    return page.relative_to(REPOSITORY).as_posix()


def code_blocks(page: Path, language: str) -> list[Any]:
    """Blocks of a language, each with the place where it begins, for pytest."""
    text = text_of(page)
    found = re.finditer(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return [
        pytest.param(block[1], id=f"{name_of(page)}:{text[: block.start()].count(chr(10)) + 1}")
        for block in found
    ]


def without_code(page: Path) -> str:
    return re.sub(r"^```.*?^```$|`[^`\n]*`", "", text_of(page), flags=re.MULTILINE | re.DOTALL)


@pytest.fixture
def clean_blender(
    add_on: None,  # noqa: ARG001 - registered
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> Path:
    """A new file in a folder of its own, which is the working folder too."""
    import bpy

    monkeypatch.chdir(tmp_path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "untitled.blend"))
    return tmp_path


# --- Examples ------------------------------------------------------------------------------------


@pytest.mark.usefixtures("clean_blender")
@pytest.mark.parametrize(
    "block", [block for page in PAGES for block in code_blocks(page, "python")]
)
def test_example_runs_in_a_new_file_and_leaves_a_motion(block: str) -> None:
    import bpy

    exec(compile(block, "example", "exec"), {"__name__": "__main__"})  # noqa: S102 - our own text

    armatures: list[Any] = [each for each in bpy.data.objects if each.type == "ARMATURE"]
    assert armatures
    for armature in armatures:
        own = armature.octo_motion
        action = own.splicing.result or own.locomotion.result
        assert armature.animation_data.action == action
        assert action.frame_end > action.frame_start


def files_shown(format_name: str) -> list[Any]:
    """JSON files of a format that the scripting reference shows."""
    blocks = code_blocks(SCRIPTING, "json")
    return [block for block in blocks if f'"{format_name}"' in block.values[0]]


@pytest.mark.parametrize("block", files_shown("octo_motion.pose"))
def test_pose_script_that_is_shown_can_be_played(block: str, clean_blender: Path) -> None:
    import bpy

    file = clean_blender / "pose.json"
    file.write_text(block, encoding="utf-8")
    bpy.ops.octo_motion.add_octopus(with_mesh=False)
    assert bpy.ops.octo_motion.pose_script(filepath=str(file)) == {"FINISHED"}
    octopus: Any = bpy.context.object
    assert octopus.animation_data.action


@pytest.mark.parametrize("block", files_shown("octo_motion.gait"))
def test_gait_file_that_is_shown_can_be_imported(block: str, clean_blender: Path) -> None:
    import bpy

    file = clean_blender / "gait.json"
    file.write_text(block, encoding="utf-8")
    bpy.ops.octo_motion.add_octopus(with_mesh=False)
    bpy.ops.octo_motion.add_route()
    bpy.ops.octo_motion.gait_import(filepath=str(file))
    assert bpy.ops.octo_motion.generate_locomotion() == {"FINISHED"}


@pytest.mark.parametrize("block", code_blocks(BATCH, "toml"))
def test_job_that_is_shown_has_no_faults(block: str, clean_blender: Path) -> None:
    import bpy

    from octo_motion.command_line.job import read_job
    from octo_motion.command_line.vocabulary import known

    # What a table is repeated for has to be there.
    (clean_blender / "clips").mkdir()
    (clean_blender / "clips" / "walk.bvh").touch()
    bpy.data.actions.new("Walk").use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(clean_blender / "hero.blend"), copy=True)
    file = clean_blender / "job.toml"
    file.write_text(block, encoding="utf-8")
    assert read_job(file, known(), clean_blender / "job.report.json").shots


# --- Reference -----------------------------------------------------------------------------------


def rows(text: str) -> dict[str, list[str]]:
    """Cells of all tables in a text, by the name in the first one."""
    found: dict[str, list[str]] = {}
    for line in tables(text).splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        name = re.fullmatch(r"`(\w+)`", cells[0])
        if name:
            assert name[1] not in found, f"{name[1]} is described twice"
            found[name[1]] = cells[1:]
    return found


def tables(text: str) -> str:
    return "\n".join(line for line in text.splitlines() if line.startswith("|"))


def section(heading: str, page: Path = SCRIPTING) -> str:
    """What stands below a heading, its subsections included."""
    level = len(heading.split(" ", 1)[0])
    text = re.sub(r"^```.*?^```$", "", text_of(page), flags=re.MULTILINE | re.DOTALL)
    found = re.search(
        rf"^{re.escape(heading)}\n(.*?)(?=^#{{1,{level}}} |\Z)", text, re.MULTILINE | re.DOTALL
    )
    assert found, f"there is no heading '{heading}'"
    return found[1]


def after(opening: str, heading: str) -> str:
    """The table that follows a sentence of a section."""
    text = section(heading)
    assert opening in text
    return text.split(opening, 1)[1].strip().split("\n\n", 1)[0]


def described(group: str) -> dict[str, list[str]]:
    arms, table = "## The list of arms", "## The gait table"
    match group:
        case "locomotion":
            return rows(section("## Settings"))
        case "arm":
            return rows(after("An item of `arms`:", arms))
        case "bone":
            return rows(after("An item of its `bones`:", arms))
        case "figure":
            return rows(after("An item of `figures`:", "## Quality"))
        case "change":
            return rows(section("## Change of gait").split("An item of", 1)[0])
        case "place":
            return rows(after("An item of `places`:", "## Change of gait"))
        case "along":
            return rows(after("An item of `along`:", "## Settings along the route"))
        case "body":
            return rows(section("## Body"))
        case "given_pose":
            return rows(section("## Begin and end in a pose"))
        case "ground":
            return rows(section("## The ground").split("An item of", 1)[0])
        case "contact":
            return rows(after("An item of `contacts`:", "## The ground"))
        case "reach":
            return rows(section("## Reaches"))
        case "landmarks":
            return rows(section("## Landmarks"))
        case "posing":
            return rows(section("## Posing").split("### Pose scripts", 1)[0])
        case "splicing":
            return rows(section("## Splicing").split("An item of", 1)[0])
        case "follow_through":
            return rows(section("## Follow-through").split("An item of", 1)[0])
        case "chain":
            return rows(after("An item of `chains`:", "## Follow-through"))
        case "splice":
            return rows(after("An item of `splices`:", "## Splicing"))
        case "table":
            return rows(section(table).split("An item of", 1)[0])
        case "knot":
            return rows(after("An item of its `knots`:", table))
        case _:
            return rows(after(f"An item of `{group}s`:", table))


def group_class(group: str) -> Any:
    from octo_motion.ui.follow_through.properties import (
        FollowChain,
        OCTO_MOTION_PG_follow_through,
    )
    from octo_motion.ui.locomotion.settings import body, lists, properties
    from octo_motion.ui.locomotion.settings import gait as gait_properties
    from octo_motion.ui.locomotion.settings import lists as ground_properties
    from octo_motion.ui.locomotion.settings import properties as quality_report
    from octo_motion.ui.posing.properties import OCTO_MOTION_PG_posing
    from octo_motion.ui.splicing.properties import (
        OCTO_MOTION_PG_landmarks,
        OCTO_MOTION_PG_splicing,
        SpliceItem,
    )

    own = {
        "locomotion": properties.OCTO_MOTION_PG_locomotion,
        "arm": lists.ArmItem,
        "bone": lists.ArmBoneItem,
        "figure": quality_report.FigureItem,
        "reach": lists.ReachItem,
        "ground": ground_properties.OCTO_MOTION_PG_ground,
        "contact": ground_properties.ContactItem,
        "body": body.OCTO_MOTION_PG_body,
        "change": lists.OCTO_MOTION_PG_change,
        "place": lists.ChangeItem,
        "along": lists.AlongItem,
        "given_pose": lists.OCTO_MOTION_PG_given_pose,
        "landmarks": OCTO_MOTION_PG_landmarks,
        "posing": OCTO_MOTION_PG_posing,
        "splicing": OCTO_MOTION_PG_splicing,
        "splice": SpliceItem,
        "follow_through": OCTO_MOTION_PG_follow_through,
        "chain": FollowChain,
    }
    return own.get(group) or getattr(gait_properties, f"OCTO_MOTION_PG_gait_{group}")


def type_of(definition: Any) -> str:
    """Type, unit and range as the tables write them."""
    match definition.type:
        case "ENUM":
            return " ".join(f'`"{item.identifier}"`' for item in definition.enum_items)
        case "BOOLEAN":
            return "bool"
        case "STRING":
            return "str"
        case "COLLECTION":
            return "list"
        case "POINTER":
            kinds = {"Object": "object", "Action": "action", "NodeTree": "node group"}
            return kinds.get(definition.fixed_type.identifier, "group")
        case "INT":
            words = ["int"]
        case _:
            words = ["3 floats" if definition.is_array else "float"]
            words += [UNITS[definition.unit]] if definition.unit != "NONE" else []
    lowest, highest = definition.hard_min, definition.hard_max
    if lowest > -2e9:
        least, most = number(lowest, definition), number(highest, definition)
        words.append(f"{least} or more" if highest > 2e9 else f"{least} to {most}")
    return ", ".join(words)


def default_of(definition: Any) -> str:
    """The default as the tables write it."""
    match definition.type:
        case "ENUM" | "STRING":
            return f'`"{definition.default}"`'
        case "BOOLEAN":
            return f"`{definition.default}`"
        case "COLLECTION":
            return "empty"
        case "POINTER":
            return "" if type_of(definition) == "group" else "`None`"
        case _ if definition.is_array:
            return ", ".join(number(value, definition) for value in definition.default_array)
        case _:
            return number(definition.default, definition)


def number(value: float, definition: Any) -> str:
    """A number, angles in degrees; properties are of single precision."""
    if definition.unit == "ROTATION":
        return f"{math.degrees(value):.5g}°"
    return f"{value:.6g}"


@pytest.mark.usefixtures("clean_blender")
@pytest.mark.parametrize(
    "group",
    [
        *("locomotion", "arm", "bone", "reach", "change", "place", "ground", "contact", "body"),
        *("figure", "along", "given_pose"),
        *("table", "curve", "knot", "offset", "note"),
        *("splicing", "splice", "landmarks", "posing"),
        *("follow_through", "chain"),
    ],
)
def test_every_setting_is_described_with_its_type_and_its_default(group: str) -> None:
    owner = group_class(group)
    # A group's own, and those of the classes that it is put together from.
    names = {name for each in owner.__mro__ for name in vars(each).get("__annotations__", ())}
    names |= set(owner.__annotations__)
    definitions = {name: owner.bl_rna.properties[name] for name in names}
    expected = {
        name: [type_of(each), default_of(each)] for name, each in sorted(definitions.items())
    }
    found = {name: cells[:2] for name, cells in sorted(described(group).items())}
    assert found == expected
    assert all(len(cells) == 3 and cells[2] for cells in described(group).values())


def shown_operators() -> dict[str, ast.Call]:
    """Operators as they are shown with their properties, outside the examples."""
    text = re.sub(r"^```python\n.*?^```$", "", text_of(SCRIPTING), flags=re.MULTILINE | re.DOTALL)
    calls = re.findall(r"bpy\.ops\.octo_motion\.(\w+)(\([^()]*\))", text)
    # A name without a value stands for one that is found when the operator runs.
    found: dict[str, ast.Call] = {}
    for name, arguments in calls:
        given = re.sub(r"(?<=[(,\s])(\w+)(?=\s*[,)])", r"\1=...", arguments)
        call = ast.parse(name + given, mode="eval").body
        assert isinstance(call, ast.Call)
        assert name not in found, f"{name} is shown twice"
        found[name] = call
    return found


@pytest.mark.usefixtures("clean_blender")
def test_every_operator_is_shown_with_its_properties_and_their_defaults() -> None:
    import bpy

    shown = shown_operators()
    assert set(shown) == set(dir(bpy.ops.octo_motion))
    for name, call in shown.items():
        kind: Any = getattr(bpy.ops.octo_motion, name).get_rna_type()
        definitions = {
            each.identifier: each
            for each in kind.properties
            if each.identifier != "rna_type" and not each.is_hidden
        }
        assert set(definitions) == {keyword.arg for keyword in call.keywords}, name
        for keyword in call.keywords:
            value = ast.literal_eval(keyword.value)
            if value is not ...:
                default = definitions[str(keyword.arg)].default
                close = isinstance(value, float) and math.isclose(value, default, rel_tol=1e-6)
                assert close or value == default, f"{name}({keyword.arg}={value!r})"


@pytest.mark.usefixtures("clean_blender")
def test_ranges_of_the_octopus_are_the_operators_own() -> None:
    import bpy

    properties: Any = bpy.ops.octo_motion.add_octopus.get_rna_type().properties
    table = rows(section("### Octopus"))
    for name in ("arms", "joints", "arm_length", "first_diameter", "taper", "web_reach"):
        definition = properties[name]
        least, most = definition.hard_min, definition.hard_max
        expected = f"{least:.6g} or more" if most > 2e9 else f"{least:g} to {most:g}"
        assert table[name][0] == expected


@pytest.mark.parametrize("word", ["generate", "splice", "bake", "pose"])
def test_every_option_of_the_command_line_is_described(word: str) -> None:
    from octo_motion.command_line.command_line import parser

    commands: Any = parser("octo_motion", has_open_file=True)._subparsers
    command = commands._group_actions[0].choices[word]
    options = {option for action in command._actions for option in action.option_strings}
    described_ones = set(re.findall(r"(?<![\w-])--?[a-z]+", tables(section(f"## `{word}`", BATCH))))
    # An option may be named beside another one, but none that does not exist.
    assert described_ones == options - {"-h", "--help"}


def test_every_key_of_a_job_is_described() -> None:
    from octo_motion.command_line.shot_schema import KINDS

    keys = {key for keys in KINDS.values() for key in keys}
    assert set(rows(section("## Job files", BATCH))) == keys | {"each"}


def test_every_parameter_of_a_new_octopus_is_named_for_jobs() -> None:
    from octo_motion.command_line.shot_schema import OCTOPUS

    text = rows(section("## Job files", BATCH))["octopus"][0]
    assert [name for name in OCTOPUS.keys if f"`{name}`" not in text] == []


def test_every_gait_that_comes_along_is_in_the_guide() -> None:
    from octo_motion.core.locomotion.gait import table as gait

    guide = text_of(REPOSITORY / "docs" / "guide.md")
    assert [name for name in gait.gait_presets() if f"`{name}`" not in guide] == []


# --- Messages ------------------------------------------------------------------------------------

NOT_IN_THE_PANELS = (
    # Limits of the properties keep these from happening.
    *("… is not a number.", "… is …."),
    *("A joint's weight is not between 0 and 1.", "The stride is … m.", "The speed is … m/s."),
    # What a session asks of the simulation always makes sense.
    *("The figure has no bodies.", "The step of the simulation is not positive."),
    *("There is no material ….", "An obstacle has no faces."),
    *("The strength of the joints is not positive.",),
    # An empty list is filled before.
    "The list of arms is empty.",
    # Limits of a splice's properties, and what is asked for before.
    *("The timing has values that are no numbers.", "The rate of a splice must be above zero."),
    *("The length of a splice must be above zero.", "Easing cannot be below zero."),
    *("… is no ending.", "The part … has no legs to travel with.", "There is no part …."),
    "An additive splice has no travel.",
    "It is not known which bones of … are arms and legs.",
    # Whose it is, or which line, before a problem that is explained.
    *("…: …", "….", "Line …: …."),
)
"""Errors that scripts alone could meet."""


def sources() -> list[ast.Module]:
    """The modules of the extension, without the command line."""
    modules = (REPOSITORY / "octo_motion").rglob("*.py")
    return [ast.parse(text_of(each)) for each in modules if each.parent.name != "command_line"]


def message(node: ast.AST) -> str | None:
    """A text of the source with … for what is filled in."""
    match node:
        case ast.Constant(value=str(text)):
            return re.sub(r"'\{\w+\}'|\{\w+(![rs])?(:[^}]*)?\}", "…", text)
        case ast.Call(func=ast.Name(id="phrase" | "as_phrase"), args=[text]):
            return message(text)
        case ast.JoinedStr(values=parts):
            return "".join(
                str(getattr(part, "value", "")) if isinstance(part, ast.Constant) else "…"
                for part in parts
            ).replace("'…'", "…")
        case _:
            return None


def explained() -> dict[str, re.Pattern[str]]:
    """Messages of the guide, … standing for anything."""
    guide = section("## When something goes wrong", REPOSITORY / "docs" / "guide.md")
    cells = [line.strip("|").split("|")[0].strip() for line in tables(guide).splitlines()]
    shown = [each for cell in cells if cell.strip("-") for each in cell.split(" / ")]
    return {
        each: re.compile(re.escape(each.rstrip(".")).replace("…", ".*"))
        for each in shown
        if each != "Message"
    }


def test_every_message_that_the_guide_explains_is_one_that_artists_can_read() -> None:
    said = {text for tree in sources() for node in ast.walk(tree) if (text := message(node))}
    unknown = [
        shown
        for shown, pattern in explained().items()
        if not any(pattern.match(text) for text in said)
    ]
    assert unknown == []


ERRORS = frozenset(
    f"{kind}Error" for kind in ("Clip", "Gait", "Ground", "Rig", "Route", "Settings", "Write")
)


def test_every_error_that_artists_can_meet_is_explained_in_the_guide() -> None:
    errors = [
        text
        for tree in sources()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ERRORS
        if node.args and (text := message(node.args[0]))
    ]
    assert len(errors) > len(NOT_IN_THE_PANELS)
    patterns = explained().values()
    missing = [
        text
        for text in errors
        if text not in NOT_IN_THE_PANELS and not any(each.match(text) for each in patterns)
    ]
    assert missing == []


# --- Links ---------------------------------------------------------------------------------------


def anchors(page: Path) -> set[str]:
    """What headings can be linked as, in the way of code forges."""
    text = re.sub(r"^```.*?^```$", "", text_of(page), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    plain = [re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings]
    return {heading.strip().replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_module_that_a_page_names_is_there(page: Path) -> None:
    sources = [each.relative_to(REPOSITORY) for each in REPOSITORY.glob("octo_motion/**/*.py")]
    rooms = {f"/{each.with_suffix('')}" for each in sources} | {
        f"/{each.parent}" for each in sources
    }
    named = re.findall(r"`([a-z_]+(?:/[a-z_]+)+(?:\.py)?)`", text_of(page))
    missing = [
        name
        for name in named
        if not any(room.endswith(f"/{name.removesuffix('.py')}") for room in rooms)
        and not any((each / name).exists() for each in (REPOSITORY, REPOSITORY / "octo_motion"))
        and not name.startswith("build/")
    ]
    assert missing == []


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_link_and_picture_is_in_the_repository(page: Path) -> None:
    wrong = []
    for target in re.findall(r"\]\(([^)\s]+)\)", without_code(page)):
        if target.startswith(("https://", "http://")):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        is_here = file.is_relative_to(REPOSITORY) and file.exists()
        if not is_here or (anchor and anchor not in anchors(file)):
            wrong.append(target)
    assert wrong == []


def test_every_page_can_be_reached_from_the_readme() -> None:
    reached, waiting = set[Path](), [REPOSITORY / "README.md"]
    while waiting:
        page = waiting.pop()
        reached.add(page)
        for target in re.findall(r"\]\(([^)#\s]+\.md)", without_code(page)):
            linked = (page.parent / target).resolve()
            if linked not in reached:
                waiting.append(linked)
    assert set(PAGES) <= reached


def test_every_picture_is_used() -> None:
    used = {
        (page.parent / target).resolve()
        for page in PAGES
        for target in re.findall(r"!\[[^\]]*\]\(([^)\s]+)\)", text_of(page))
    }
    assert set((REPOSITORY / "docs" / "images").glob("*.png")) <= used


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_picture_says_what_it_shows(page: Path) -> None:
    assert re.findall(r"!\[\s*\]\([^)]*\)", text_of(page)) == []


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_no_page_names_a_path_of_some_machine(page: Path) -> None:
    machine = r"(?<![\w.:/`])/(?:work|home|root|tmp|usr|opt|mnt|Users)\b|\b[A-Z]:\\|\bfile://"
    assert re.findall(machine, text_of(page)) == []


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_make_target_that_is_named_exists(page: Path) -> None:
    listed = subprocess.run(
        ["make", "--no-print-directory", "help"],
        cwd=REPOSITORY,
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    targets = {line.split()[1] for line in listed.stdout.splitlines()}
    code = re.findall(r"^```.*?^```$|`[^`\n]+`", text_of(page), re.MULTILINE | re.DOTALL)
    assert set(re.findall(r"\bmake ([a-z]+)", "\n".join(code))) <= targets


def test_the_diagram_of_packages_shows_the_sources_as_they_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.syspath_prepend(str(REPOSITORY / "docs" / "studio"))
    packages = importlib.import_module("packages")
    assert text_of(packages.PICTURE) == packages.drawn(), "make diagram"


def test_every_source_file_that_a_page_names_is_there() -> None:
    there = [
        "/" + path.relative_to(REPOSITORY).as_posix()
        for folder in ("octo_motion", "tests", "docs", ".ci")
        for path in (REPOSITORY / folder).rglob("*.py")
    ]
    missing = [
        f"{name_of(page)}: {name}"
        for page in PAGES
        for name in re.findall(r"`([\w./]+\.py)`", text_of(page))
        # A name in capitals stands for one of the reader's own.
        if not Path(name).stem.isupper() and not any(path.endswith("/" + name) for path in there)
    ]
    assert missing == []


def test_every_picture_is_made_by_a_target_or_said_to_be_made_by_hand() -> None:
    studio = REPOSITORY / "docs" / "studio"
    made = {
        key.value
        for script in ("pictures.py", "window.py")
        for table in ast.walk(ast.parse(text_of(studio / script)))
        if isinstance(table, ast.AnnAssign) and getattr(table.target, "id", "") == "PICTURES"
        for key in getattr(table.value, "keys", ())
    }
    by_hand = set(re.findall(r"`(\w+)\.png`", text_of(REPOSITORY / "docs" / "README.md")))
    there = {path.stem for path in (REPOSITORY / "docs" / "images").glob("*.png")}
    assert there == made | by_hand
    assert not made & by_hand
