# SPDX-License-Identifier: GPL-3.0-or-later
"""The words of the command line; no Blender is needed to read them."""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from ..core.errors import OctoMotionError, WriteError
from .schema import Kind, Number, Unfit
from .shot_schema import KINDS, Option

COMMAND: Final = "octo_motion"
"""Name of the command."""

FAILED: Final = 1
WRONG: Final = 2
FINAL: Final = 3
CRASHED: Final = 4
STOPPED: Final = 130
"""As shells have it."""

_STATUS: Final = (
    "Exit status: 0 all is done, or was unchanged; 1 something failed here, try again; 2 wrong "
    "arguments or job; 3 it fails each time, for the limits, rig or files are so; 4 Blender "
    "crashed; 130 stopped."
)

_GENERATE: Final = """\
Let one armature walk or swim along a curve, and save the result as a new file.

What is not given is as it is set in the file. The file that is read stays as it is, unless
--overwrite is given; an output is written whole or not at all.
"""

_SPLICE: Final = """\
Put parts of other motions onto one motion, and save the result as a new file.

FILE is the motion to splice onto: a motion file (.bvh, .fbx, .glb, .gltf), or a .blend file with
an armature and its action. Each --splice goes onto the result of those before it; without any, the
list that the .blend file has is built. What is read stays as it is.

  splice walk.bvh --splice right_arm throw.bvh base_start=20 after=stop \\
         --splice left_arm punch.bvh base_start=60 mode=exact -o walk_throw_punch.blend

What is not given has the value that the panel gives to a new splice. Settings have the names that
scripts use: Object.octo_motion.splicing.splices[N].NAME. clip=FILE, action=NAME and source=NAME (an
armature of the .blend file) say where the part is from; ground=MESH says on what locked feet stand;
landmarks.NAME=BONE says which bone is which, where it cannot be told.
"""

_POSE: Final = """\
Pose an armature by a script of grabs, pulls, pins and keys, and save the result as a new file.

The script is a JSON file, as it is described in the scripting reference. The same script gives the
same keys each time, on the same computer. The file that is read stays as it is, unless --overwrite
is given; an output is written whole or not at all.
"""

_RETARGET: Final = """\
Put whole clips onto one armature, each as an action with the name of its file, and save the result
as a new file.

FILE is a .blend file with the armature, or a motion file. --clips is a motion file (.bvh, .fbx,
.glb, .gltf), or a folder, of which all are taken. What is read stays as it is.

  retarget hero.blend --clips walks --clips throw.bvh -o hero_clips.blend

Settings have the names that scripts use: Object.octo_motion.splicing.retarget.NAME;
landmarks.NAME=BONE says which bone of the armature is which, where it cannot be told.
"""

_FOLLOW: Final = """\
Let chains of bones follow an armature's action: they lag, swing, stop at what is in their way and
settle. The result is saved as a new file.

FILE is a .blend file with the armature, or a motion file, and comes before --chain. Without any
--chain it is the file's list of chains, or all bones whose names say that they hang and swing.

  follow fox.blend --chain Tail.1 Tail.5 strength=0.5 --set damping=0.3 -o fox_tail.blend

Settings have the names that scripts use: Object.octo_motion.follow_through.NAME. Here, the result
is a new action unless --set result_as says otherwise.
"""

_ABOUT: Final = {
    "generate": ("let the armature of one file walk or swim", _GENERATE),
    "splice": ("put parts of other motions onto one motion", _SPLICE),
    "pose": ("pose an armature by a script", _POSE),
    "retarget": ("put whole clips onto one armature", _RETARGET),
    "follow": ("let bones follow an action", _FOLLOW),
}
_BAKE: Final = """\
Make many shots from a job file, each in a process of its own.

The whole job is checked before anything runs. A shot that fails is reported with its reason and
does not stop the others. Run again, only what is new or has changed is made.
"""

_JOB: Final = """\
A job file is TOML; its paths are relative to its folder. [defaults] is for all shots.

  [defaults]
  fps = 25
  output = "shots/{name}.blend"
  settings = { timing = "SPEED", speed = 0.4 }
  limits = { slip = 0.01, depth = 0.005, turn = 45.0 }   # worse, and the shot fails

  [[shots]]
  name = "along_the_wall"
  file = "reef.blend"               # the scene; its armature and curve by name
  armature = "Octopus"              # if there are several
  route = "Wall"                    # default: the armature's own
  ground = "Sea Floor"              # the mesh to walk on; default: its own
  gait = "walk"                     # or a gait file, "gaits/sneak.json"

  [[shots]]
  name = "newcomer"
  octopus = { arms = 8, arm_length = 0.5 }                    # a new one in an empty scene
  route = [[0, 0, 0], [0, -2, 0], [1, -3, 0.5], [3, -3, 1]]   # four control points
  # or: route = { points = [[0, 0, 0], [1, -1, 0], …], cyclic = true }
  gait = "swim"
  settings = { variation_max = "5°", table.stride = 1.2 }
  export = ["shots/newcomer.glb", "shots/newcomer.abc"]

Settings have the names that scripts use: Object.octo_motion.locomotion.NAME. Numbers of angles are
radians, texts may be in degrees.

  [[shots]]
  name = "walk_and_throw"
  kind = "splice"                   # parts of other motions onto this one
  file = "clips/walk.bvh"           # or a .blend file, with armature and base (an action) by name
  splices = [
      { part = "right_arm", clip = "clips/throw.bvh", base_start = 20, after = "stop" },
      { part = "left_arm", clip = "clips/punch.bvh", base_start = 60, mode = "exact" },
  ]

  [[shots]]
  name = "hero_clips"
  kind = "retarget"                 # whole clips onto this one, each as an action
  file = "hero.blend"
  clips = ["clips", "more/throw.bvh"]   # files, and folders of files

  [[shots]]
  name = "fox_tail"
  kind = "follow"                   # bones that follow an action
  file = "fox.blend"
  chains = [{ name = "Tail.1", last = "Tail.5", strength = 0.5 }]
"""


def status_of(error: OctoMotionError) -> int:
    """The exit status for an error in what was to be made."""
    return FAILED if isinstance(error, WriteError) else FINAL


def parser(program: str, *, has_open_file: bool) -> argparse.ArgumentParser:
    """The parser of all commands; the file may be left out where Blender has one open."""
    main = argparse.ArgumentParser(
        prog=program,
        description="Octo Motion: creatures with arms walk and swim along a route, parts of one "
        "motion are put onto another, figures are posed like puppets.",
        epilog=f"{_STATUS} '{program} bake --help' shows what a job file looks like.",
    )
    commands = main.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for kind, keys in KINDS.items():
        title, description = _ABOUT[kind]
        command = _command(commands, kind, title, description, _STATUS)
        for name, key in keys.items():
            if key.option is not None:
                _add_option(command, name, key.kind, key.option, has_open_file=has_open_file)
        command.add_argument(
            "--overwrite",
            action="store_true",
            help="let the output replace a file that is there; without --output the one that is "
            "read",
        )
    _add_bake(commands)
    return main


def _command(
    commands: argparse._SubParsersAction[argparse.ArgumentParser],
    name: str,
    title: str,
    description: str,
    epilog: str,
) -> argparse.ArgumentParser:
    return commands.add_parser(
        name,
        help=title,
        description=description,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def _add_option(
    command: argparse.ArgumentParser, name: str, kind: Kind, option: Option, *, has_open_file: bool
) -> None:
    """What says on the command line what a key says in a job file."""
    if name == "file":
        default = " (default: the one that is open)" if has_open_file else ""
        command.add_argument(
            name,
            metavar=option.metavar,
            nargs="?" if has_open_file else None,
            help=option.help + default,
        )
        return
    repeated = {"action": "append", "default": []} if option.collect else {}
    words = {"nargs": "+"} if isinstance(option.metavar, tuple) else {}
    command.add_argument(
        *(option.flags or (f"--{name}",)),
        metavar=option.metavar,
        dest=name,
        type=_number(kind) if isinstance(kind, Number) else str,
        help=option.help,
        required=option.required,
        **repeated,
        **words,
    )


def _number(kind: Number) -> Callable[[str], float]:
    def number(text: str) -> float:
        try:
            return kind(text)
        except Unfit as unfit:
            raise argparse.ArgumentTypeError(f"'{text}' is not {unfit}") from None

    return number


def _places(text: str) -> tuple[range, ...]:
    """Places in a list, counted from 1: "3,7,20-29"."""
    found = []
    for part in text.split(","):
        first, sign, last = part.strip().partition("-")
        try:
            place = range(int(first), int(last if sign else first) + 1)
        except ValueError:
            place = range(0)
        if not place or place.start < 1:
            raise argparse.ArgumentTypeError(f"'{text}' is not a list of places, such as 1-10")
        found.append(place)
    return tuple(found)


def _add_bake(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    command = _command(
        commands, "bake", "make many shots from a job file", _BAKE, f"{_JOB}\n{_STATUS}"
    )
    command.add_argument("job", metavar="JOB.toml", type=Path, help="the job file")
    command.add_argument(
        "-j",
        "--jobs",
        metavar="N",
        type=_number(Number(1, whole=True)),
        help="processes at a time (default: one for each processor, four at most)",
    )
    command.add_argument(
        "--report", metavar="FILE", type=Path, help="default: JOB.report.json beside the job"
    )
    command.add_argument(
        "--force", action="store_true", help="make every shot anew, whatever is there"
    )
    command.add_argument(
        "--shot",
        metavar="NAME",
        nargs="+",
        action="extend",
        default=[],
        dest="only",
        help="only these shots",
    )
    command.add_argument(
        "--index",
        metavar="PLACES",
        type=_places,
        default=(),
        help="only the shots at these places, such as 1-10 or 3,7,20-29",
    )
    command.add_argument("--check", action="store_true", help="only say what would be done")
    command.add_argument("--list", action="store_true", help="only print all names, as JSON")
    command.add_argument(
        "--files", action="store_true", help="only print what is read and written, as JSON"
    )
    command.add_argument(
        "--gather",
        action="store_true",
        help="only write the report, from what runs with --shot and --index have recorded",
    )
    command.add_argument(
        "--here", action="store_true", help="make shots in this Blender, one after the other"
    )
    command.add_argument("--quiet", action="store_true", help="say nothing but what is wrong")
    command.add_argument(
        "--progress", action="store_true", help="print lines of progress that render farms read"
    )


def parse(
    arguments: Sequence[str], program: str, *, has_open_file: bool
) -> argparse.Namespace | int:
    """The arguments, or the exit status where there is no more to do."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # A console of Windows may not know all letters.
            stream.reconfigure(errors="replace")
    try:
        return parser(program, has_open_file=has_open_file).parse_args(arguments)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 2
