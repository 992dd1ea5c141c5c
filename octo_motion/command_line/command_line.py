# SPDX-License-Identifier: GPL-3.0-or-later
"""The words of the command line; no Blender is needed to read them."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from .schema import Kind, Number, Unfit
from .shot_schema import KINDS, Option

COMMAND: Final = "octo_motion"
"""Name of the command."""

_STATUS: Final = "Exit status: 0 all went well, 1 something failed, 2 wrong arguments or job."

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

_ABOUT: Final = {
    "generate": ("let the armature of one file walk or swim", _GENERATE),
    "splice": ("put parts of other motions onto one motion", _SPLICE),
    "pose": ("pose an armature by a script", _POSE),
    "retarget": ("put whole clips onto one armature", _RETARGET),
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
"""


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
        action="append",
        default=[],
        dest="only",
        help="only this shot; may be repeated",
    )
    command.add_argument("--check", action="store_true", help="only say what would be done")


def parse(
    arguments: Sequence[str], program: str, *, has_open_file: bool
) -> argparse.Namespace | int:
    """The arguments, or the exit status where there is no more to do."""
    try:
        return parser(program, has_open_file=has_open_file).parse_args(arguments)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 2
